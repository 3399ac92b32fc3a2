//! The pages of reference that are generated: `docs/findings.md` from the table of finding codes, `docs/api.md` from the
//! contract. The tests fail where a page is not what would be generated;
//!
//!     FEEDWAVE_WRITE_DOCS=1 cargo test -p feedwave-contract --test reference
//!
//! writes them. The examples of the codes are run here too.

mod api;
mod examples;
mod findings;

use std::fs;
use std::path::Path;

use feedwave_contract::proto::DESCRIPTORS;

/// First line of a generated page.
const GENERATED: &str = "<!-- Generated: FEEDWAVE_WRITE_DOCS=1 cargo test -p feedwave-contract --test reference -->\n";

/// Holds the page against what is generated, or writes it where that is asked for.
fn check(page: &str, generated: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(page);
    let generated = format!("{GENERATED}{generated}");
    if std::env::var_os("FEEDWAVE_WRITE_DOCS").is_some() {
        fs::write(&path, generated).expect("docs/ is writable");
        return;
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    let first =
        (1..).zip(written.lines().zip(generated.lines())).find(|(_, (written, generated))| written != generated);
    assert!(
        written == generated,
        "docs/{page} is not what the source says, first in {first:?}; write it with: {}",
        GENERATED.trim_matches(['<', '!', '-', '>', ' ', '\n'])
    );
}

#[test]
fn findings() {
    check("findings.md", &findings::page());
}

#[test]
fn api() {
    check("api.md", &api::page());
}

/// The overview of the services is written by people, and forgets nothing.
#[test]
fn the_overview_names_every_method_and_encoding() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/services.md");
    let page = fs::read_to_string(path).expect("docs/services.md");
    for service in DESCRIPTORS.services().filter(|service| service.package_name() == "feedwave.v1") {
        let start = format!("| `{}` |", service.full_name());
        let row = page.lines().find(|line| line.starts_with(&start)).unwrap_or_else(|| panic!("no row {start}"));
        for method in service.methods() {
            assert!(row.contains(&format!("`{}`", method.name())), "{} is not in {row}", method.full_name());
        }
    }
    let encoding = DESCRIPTORS.get_enum_by_name("feedwave.v1.Encoding").expect("the encodings");
    for value in encoding.values().filter(|value| value.number() != 0) {
        assert!(page.contains(&format!("| `{}` |", value.name())), "{} is not in docs/services.md", value.name());
    }
}
