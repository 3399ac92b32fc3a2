//! Which database a URI names, and how what names none is refused.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use feedwave_store::{RawValue, Store, StoreSettings, StoreUri};
use proptest::prelude::*;

fn refusal(text: &str) -> String {
    text.parse::<StoreUri>().expect_err(text).to_string()
}

#[test]
fn a_file_is_named_by_its_absolute_path() {
    for (text, path) in [
        ("sqlite:///var/lib/feedwave/feedwave.db", "/var/lib/feedwave/feedwave.db"),
        ("SQLite:///feedwave.db", "/feedwave.db"),
        ("sqlite:///a%20b/100%25/c%23%3F.db", "/a b/100%/c#?.db"),
        ("sqlite:///gr%C3%B6%C3%9Fe.db", "/größe.db"),
        ("sqlite:///größe.db", "/größe.db"),
        ("sqlite:///a.db?readers=64&busy_timeout_s=0", "/a.db"),
    ] {
        let uri: StoreUri = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(uri.file(), Some(Path::new(path)), "{text}");
        assert_eq!(uri.to_string().parse(), Ok(uri), "shown as it is read");
    }
}

#[test]
fn a_server_is_named_by_user_host_and_database() {
    for text in [
        "postgres://feedwave@db.plant.example/feedwave",
        "postgresql://feedwave@db.plant.example:5433/feedwave",
        "postgres://feedwave:secret@[::1]:5432/feed%20wave?sslmode=disable",
        "postgres:///feedwave?host=/run/postgresql&user=feedwave",
        "postgres://f@db/f?sslmode=verify-ca&sslrootcert=/ca.pem&sslcert=/c.pem&sslkey=/k.pem&password_file=/p",
        "postgres://f@db/f?connections=1000&connect_timeout_s=1&statement_timeout_s=3600&application_name=cell%207",
    ] {
        let uri: StoreUri = text.parse().unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(uri.file(), None, "{text}");
    }
}

#[test]
fn what_names_no_database_is_refused_with_the_cure() {
    let absolute = "the path must be absolute, behind three slashes, as in sqlite:///var/lib/feedwave/feedwave.db";
    for (text, reason) in [
        ("", "it is empty; one is sqlite:///"),
        ("feedwave.db", "it has no scheme, as in sqlite:///"),
        ("/var/lib/feedwave.db", "it has no scheme"),
        ("oracle://plant/feedwave", "the scheme \"oracle\" is unknown, known are: sqlite"),
        ("sqlite:", absolute),
        ("sqlite:feedwave.db", absolute),
        ("sqlite::memory:", absolute),
        ("sqlite:/feedwave.db", absolute),
        ("sqlite://", absolute),
        ("sqlite://feedwave.db", absolute),
        ("sqlite://./feedwave.db", absolute),
        ("sqlite://host/feedwave.db", absolute),
        ("sqlite://user:secret@host/feedwave.db", absolute),
        ("sqlite://host:port/feedwave.db", "it is no URI: "),
        ("sqlite:///", "the path names no file"),
        ("sqlite:///var/lib/", "the path names no file"),
        ("sqlite:///a b.db", "written as in %20"),
        (" sqlite:///a.db", "written as in %20"),
        ("sqlite:///a.db\n", "written as in %20"),
        ("sqlite:///100%.db", "a percent sign itself is %25"),
        ("sqlite:///a%2.db", "a percent sign itself is %25"),
        ("sqlite:///a%", "a percent sign itself is %25"),
        ("sqlite:///a%00.db", "a path has no %00"),
        ("sqlite:///a#1.db", "a # in a path is written %23"),
        ("sqlite:///a?.db", "the option \".db\" is unknown, known are: readers, busy_timeout_s"),
        ("sqlite:///a.db?mode=ro", "the option \"mode\" is unknown"),
        ("sqlite:///a.db?readers=0", "readers must be a whole number from 1 to 64, is \"0\""),
        ("sqlite:///a.db?readers=65", "readers must be"),
        ("sqlite:///a.db?readers=", "readers must be"),
        ("sqlite:///a.db?busy_timeout_s=1.5", "busy_timeout_s must be a whole number from 0 to 3600, is \"1.5\""),
        ("sqlite:///a.db?readers=2&readers=2", "the option readers is given twice"),
        ("postgres://db/feedwave", "it names no user, as postgres://feedwave@db.plant.example/feedwave does"),
        ("postgres:///feedwave?user=f", "it names no host, as postgres://"),
        ("postgres://f@db", "its path is not the name of a database, as in postgres://"),
        ("postgres://f@db/", "its path is not the name of a database"),
        ("postgres://f@db/a/b", "its path is not the name of a database"),
        (
            "postgres://f@db/f?sslmode=prefer",
            "sslmode must be one of disable, require, verify-ca, verify-full, is \"prefer\"",
        ),
        ("postgres://f@db/f?sslmode=require&sslrootcert=/ca.pem", "sslmode=require does not look at sslrootcert"),
        ("postgres://f@localhost/f?sslmode=disable&sslrootcert=/ca.pem", "sslmode=disable uses no certificates"),
        ("postgres://f@db/f?sslcert=/c.pem", "sslcert and sslkey are given together"),
        ("postgres://f@db/f?sslrootcert=ca.pem", "sslrootcert must be an absolute path"),
        ("postgres://f:p@db/f?password_file=/p", "it has a password and a password_file: keep one"),
        ("postgres://f@db/f?host=/run/postgresql", "the option host is the folder of a socket"),
        ("postgres://f@db/f?connections=0", "connections must be a whole number from 1 to 1000, is \"0\""),
        ("postgres://f@db/f?options=-c", "the option \"options\" is unknown, known are: host, user, sslmode"),
        ("postgres://f@db/f#1", "a # is written %23"),
    ] {
        let error = refusal(text);
        assert!(error.contains(reason), "{text:?}: {error}");
    }
}

#[test]
fn a_password_is_never_repeated() {
    for text in [
        "postgres://user:secret@host",
        "postgres://user:secret@host/x?sslmode=off",
        "sqlite://user:secret@host/x",
        "x y://user:secret@host",
        "//a:secret@b",
    ] {
        assert!(!refusal(text).contains("secret"), "{text}");
    }
    let uri: StoreUri = "postgres://user:secret@host/x".parse().unwrap();
    assert_eq!(uri.to_string(), "postgres://user:***@host/x");
    assert!(!format!("{uri:?}").contains("secret"));
}

#[test]
fn a_relative_path_is_one_of_the_working_folder() {
    let uri = StoreUri::of_file(Path::new("feedwave.db")).unwrap();
    assert_eq!(uri.file(), Some(std::env::current_dir().unwrap().join("feedwave.db").as_path()));
    assert!(StoreUri::of_file(Path::new("")).is_err());
}

#[tokio::test]
async fn options_and_odd_names_reach_the_database() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("100% größe #1?.db");
    let uri = format!("{}?readers=1&busy_timeout_s=60", StoreUri::of_file(&path).unwrap());
    let store = Store::open(&uri.parse().unwrap(), StoreSettings::default()).await.unwrap();
    store.create_machine(Some("m"), RawValue::from_string("{}".into()).unwrap()).await.unwrap();
    assert!(path.is_file());
    assert_eq!(store.uri().to_string(), uri);
    assert!(format!("{store:?}").contains(&uri));
}

proptest! {
    /// The URI of any path that names a file gives the path back.
    #[test]
    fn any_path_goes_there_and_back(parts in prop::collection::vec(prop::collection::vec(1_u8..=255, 1..8), 1..4)) {
        let bytes: Vec<u8> = parts.iter().flat_map(|part| std::iter::once(b'/').chain(part.iter().copied())).collect();
        let path = Path::new(OsStr::from_bytes(&bytes));
        let mut names = bytes.split(|byte| *byte == b'/').skip(1);
        let plain = names.all(|name| !name.is_empty() && name != b"." && name != b"..");
        prop_assume!(plain);
        let uri = StoreUri::of_file(path).unwrap();
        prop_assert_eq!(uri.file(), Some(path));
        let read: StoreUri = uri.to_string().parse().unwrap();
        prop_assert_eq!(read.file(), Some(path));
    }
}
