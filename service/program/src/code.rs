//! The codes of the program language's findings.

mod motion;
mod text;
mod thread;
mod tool;
mod words;

pub use self::motion::*;
pub use self::text::*;
pub use self::thread::*;
pub use self::tool::*;
pub use self::words::*;

use crate::{CodeTable, FindingCode};

/// Every finding code of the program language, by topic.
pub const TABLES: [CodeTable; 5] = [TEXT_CODES, WORDS_CODES, MOTION_CODES, THREAD_CODES, TOOL_CODES];

/// Whether the program language makes findings of this code.
pub(crate) fn is_of_language(code: FindingCode) -> bool {
    code.name().starts_with("PRG-")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CodeEntry, Example, Interpreter, LanguageSettings, ToolLength};

    fn entries() -> impl Iterator<Item = &'static CodeEntry> {
        TABLES.iter().flat_map(|table| table.entries)
    }

    #[test]
    fn codes_are_of_the_language() {
        for entry in entries() {
            assert!(entry.name.starts_with("PRG-"), "{}", entry.name);
        }
    }

    #[test]
    fn examples_give_their_findings() {
        let (mut in_words, mut wrong) = (Vec::new(), Vec::new());
        for entry in entries() {
            let Example::Program { machine, text: program } = entry.example else {
                in_words.push(entry.name);
                continue;
            };
            let settings = match machine {
                "lathe" => LanguageSettings::default(),
                "mill" => LanguageSettings::mill(),
                _ => panic!("{}: {machine}", entry.name),
            };
            let tools = vec![ToolLength { number: 1, length_mm: 100.0 }];
            let (_, findings) = Interpreter::new(settings).with_tool_lengths(tools).read_all(program.as_bytes());
            let found = findings.findings().iter().find(|finding| finding.code == entry.name);
            if !found.is_some_and(|found| entry.severities.contains(&found.severity)) {
                let found: Vec<_> = findings.findings().iter().map(|found| (found.code, &found.message)).collect();
                wrong.push(format!("{}: {program:?} gives {found:?}", entry.name));
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
        assert_eq!(in_words, ["PRG-LINE-TOO-LONG", "PRG-NOT-UTF8", "PRG-NURBS-TOO-LONG"]);
    }
}
