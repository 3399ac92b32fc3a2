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
