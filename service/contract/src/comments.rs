//! The comments of the contract, which its descriptors bring along.

use std::collections::BTreeMap;

use prost_reflect::FileDescriptor;

/// The comments of a file by the path of what they are about.
#[derive(Clone, Debug)]
pub struct Comments(BTreeMap<Vec<i32>, String>);

impl Comments {
    /// Those of a file.
    #[must_use]
    pub fn of(file: &FileDescriptor) -> Self {
        let info = file.file_descriptor_proto().source_code_info.iter().flat_map(|info| &info.location);
        let comment = |text: &str| text.lines().map(str::trim).collect::<Vec<_>>().join("\n").trim().to_owned();
        let located = info.map(|location| (location.path.clone(), comment(location.leading_comments())));
        Self(located.filter(|(_, comment)| !comment.is_empty()).collect())
    }

    /// A comment as it is written, line by line; empty where there is none.
    #[must_use]
    pub fn paragraphs(&self, path: &[i32]) -> &str {
        self.0.get(path).map_or("", String::as_str)
    }

    /// A comment in one line.
    #[must_use]
    pub fn line(&self, path: &[i32]) -> String {
        self.paragraphs(path).split_whitespace().collect::<Vec<_>>().join(" ")
    }
}
