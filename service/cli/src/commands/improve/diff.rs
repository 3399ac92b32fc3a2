//! What changed of a program, as a unified diff.

use similar::{ChangeTag, TextDiff};

/// Lines around a change in a diff.
const CONTEXT_LINES: usize = 3;

/// What changed, as a unified diff; empty where nothing did.
pub(super) fn diff(before: &[u8], after: &[u8], name: &str) -> Vec<u8> {
    let mut text = Vec::new();
    if before != after {
        // The bytes as they are, in whatever encoding, and lines as `patch` counts them.
        let [before, after] = [before, after].map(|bytes| bytes.split_inclusive(|&byte| byte == b'\n').collect());
        let (before, after): (Vec<&[u8]>, Vec<&[u8]>) = (before, after);
        let diff = TextDiff::configure().diff_slices(&before, &after);
        text.extend_from_slice(format!("--- {name}\n+++ {name}\n").as_bytes());
        for hunk in diff.unified_diff().context_radius(CONTEXT_LINES).iter_hunks() {
            text.extend_from_slice(format!("{}\n", hunk.header()).as_bytes());
            for change in hunk.iter_changes() {
                text.push(match change.tag() {
                    ChangeTag::Equal => b' ',
                    ChangeTag::Delete => b'-',
                    ChangeTag::Insert => b'+',
                });
                text.extend_from_slice(change.value());
                if !change.value().ends_with(b"\n") {
                    text.extend_from_slice(b"\n\\ No newline at end of file\n");
                }
            }
        }
    }
    text
}
