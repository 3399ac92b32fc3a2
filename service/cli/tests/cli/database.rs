//! The commands about a database that no service uses.

use super::{code, run, stderr, stdout};

#[test]
fn a_database_that_is_not_there_is_not_made_to_be_brought_up_to_date() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("feedwave.db");
    let uri = format!("sqlite://{}", path.display());
    let output = run(&[&"migrate", &"--store", &uri]);
    assert_eq!((code(&output), stdout(&output)), (2, String::new()), "{}", stderr(&output));
    assert!(stderr(&output).contains("there is no such file"), "{}", stderr(&output));
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}
