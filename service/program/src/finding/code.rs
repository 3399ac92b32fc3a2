//! The table of finding codes: every finding is made with a row of it, so that a code without a row does not compile.

use std::fmt;

use super::Severity;

/// One row of the table: what a finding's code says, whatever the place and the numbers.
#[derive(Debug, PartialEq, Eq)]
pub struct CodeEntry {
    /// The code as callers see it, such as `VIB-CHIP-UNBROKEN`. Never changes once released.
    pub name: &'static str,
    /// Its severity; several where it depends on the case, worst first.
    pub severities: &'static [Severity],
    /// What the finding says: a phrase without a full stop.
    pub meaning: &'static str,
    /// How it comes about, in sentences.
    pub cause: &'static str,
    /// What to do about it, in sentences; the finding itself has the numbers.
    pub cure: &'static str,
    /// Words that explain it where they could not be read: it then only follows from them. Empty for most.
    pub explained_by: &'static [Explanation],
    /// What gives it.
    pub example: Example,
}

/// Words that, where they could not be read, explain a finding about what is missing or does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// Words of the finding's own block only, not those of blocks before that are still in force.
    pub in_block: bool,
    /// Their address letters.
    pub letters: &'static str,
}

impl Explanation {
    /// Words of its own block.
    #[must_use]
    pub const fn block(letters: &'static str) -> Self {
        Self { in_block: true, letters }
    }

    /// Words of its own block and of any block before that are still in force.
    #[must_use]
    pub const fn modal(letters: &'static str) -> Self {
        Self { in_block: false, letters }
    }
}

/// What gives a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Example {
    /// A program, which need not be whole: other findings may come with it.
    Program {
        /// The machine that it is for, and what of its profile or of the job differs: `"lathe, interpolation_period_us = 4000"`.
        machine: &'static str,
        /// The program.
        text: &'static str,
    },
    /// Anything else, in words.
    Words(&'static str),
}

impl Example {
    /// A program for a machine as [`Example::Program`] says it.
    #[must_use]
    pub const fn on(machine: &'static str, text: &'static str) -> Self {
        Self::Program { machine, text }
    }

    /// A program for the lathe as delivered.
    #[must_use]
    pub const fn lathe(text: &'static str) -> Self {
        Self::on("lathe", text)
    }

    /// A program for the mill as delivered, with tool 1 of 120 mm.
    #[must_use]
    pub const fn mill(text: &'static str) -> Self {
        Self::on("mill", text)
    }

    /// A program for the mill as delivered, in the dialect of LinuxCNC.
    #[must_use]
    pub const fn linuxcnc(text: &'static str) -> Self {
        Self::on("mill, language.dialect = DIALECT_LINUXCNC", text)
    }

    /// A program for the five-axis mill of the fixtures, with tool 1 of 120 mm.
    #[must_use]
    pub const fn five_axis(text: &'static str) -> Self {
        Self::on("five-axis mill", text)
    }

    /// A program for the mill of the fixtures whose tool 4 oscillates.
    #[must_use]
    pub const fn oscillation(text: &'static str) -> Self {
        Self::on("oscillation mill", text)
    }

    /// Anything but a program.
    #[must_use]
    pub const fn words(text: &'static str) -> Self {
        Self::Words(text)
    }
}

/// The rows of one topic, in the order of the reference.
#[derive(Debug, PartialEq, Eq)]
pub struct CodeTable {
    /// What the rows are about; a heading of the reference.
    pub title: &'static str,
    /// The rows.
    pub entries: &'static [CodeEntry],
}

/// The code of a finding: a row of the table with the severity of the case.
///
/// Constants made by [`finding_codes`](crate::finding_codes) are the only ones. Two are equal when they have the same row.
#[derive(Clone, Copy)]
pub struct FindingCode {
    entry: &'static CodeEntry,
    severity: Severity,
}

impl FindingCode {
    /// For [`finding_codes`](crate::finding_codes) only.
    #[doc(hidden)]
    #[must_use]
    pub const fn of(entry: &'static CodeEntry, severity: Severity) -> Self {
        Self { entry, severity }
    }

    /// Its row.
    #[must_use]
    pub const fn entry(self) -> &'static CodeEntry {
        self.entry
    }

    /// The code as callers see it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry.name
    }

    /// The severity of findings made with this constant.
    #[must_use]
    pub const fn severity(self) -> Severity {
        self.severity
    }
}

impl PartialEq for FindingCode {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for FindingCode {}

impl PartialEq<str> for FindingCode {
    fn eq(&self, name: &str) -> bool {
        self.name() == name
    }
}

impl PartialEq<&str> for FindingCode {
    fn eq(&self, name: &&str) -> bool {
        self.name() == *name
    }
}

impl fmt::Debug for FindingCode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl fmt::Display for FindingCode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.name())
    }
}

/// Declares a [`CodeTable`] and a [`FindingCode`] constant for each severity that a row has:
///
/// ```
/// feedwave_program::finding_codes! {
///     /// Codes of drilling.
///     pub DRILLING: "Drilling";
///
///     "DRILL-DEPTH" [DEPTH: Error, DEPTH_UNUSUAL: Warning] {
///         meaning: "a hole deeper than the drill is long, or (a warning) than ten times its diameter",
///         cause: "The depth is measured from another plane than the surface.",
///         cure: "Check the depth.",
///         example: mill("G83 Z-500"),
///     }
/// }
///
/// assert_eq!(DEPTH, DEPTH_UNUSUAL);
/// assert_eq!(DRILLING.entries[0].severities, [DEPTH.severity(), DEPTH_UNUSUAL.severity()]);
/// ```
#[macro_export]
macro_rules! finding_codes {
    (
        $(#[$about:meta])*
        pub $table:ident: $title:literal;
        $($name:literal [$($constant:ident: $severity:ident),+] {
            meaning: $meaning:literal,
            cause: $cause:literal,
            cure: $cure:literal,
            $(explained_by: $scope:ident($letters:literal),)?
            example: $example:ident($($given:literal),+),
        })+
    ) => {
        $(#[$about])*
        pub const $table: $crate::CodeTable = $crate::CodeTable {
            title: $title,
            entries: &[$($crate::CodeEntry {
                name: $name,
                severities: &[$($crate::Severity::$severity),+],
                meaning: $meaning,
                cause: $cause,
                cure: $cure,
                explained_by: &[$($crate::Explanation::$scope($letters))?],
                example: $crate::Example::$example($($given),+),
            }),+],
        };
        $($(
            #[doc = concat!("`", $name, "`: ", $meaning, ".")]
            pub const $constant: $crate::FindingCode =
                $crate::FindingCode::of($table.entry($name), $crate::Severity::$severity);
        )+)+
    };
}

impl CodeTable {
    /// The row of this name, found while compiling.
    #[doc(hidden)]
    #[must_use]
    pub const fn entry(&self, name: &str) -> &'static CodeEntry {
        let mut at = 0;
        while at < self.entries.len() {
            if same(self.entries[at].name.as_bytes(), name.as_bytes()) {
                return &self.entries[at];
            }
            at += 1;
        }
        panic!("not in the table")
    }
}

const fn same(one: &[u8], other: &[u8]) -> bool {
    if one.len() != other.len() {
        return false;
    }
    let mut at = 0;
    while at < one.len() {
        if one[at] != other[at] {
            return false;
        }
        at += 1;
    }
    true
}
