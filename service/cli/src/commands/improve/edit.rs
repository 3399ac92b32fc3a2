//! The text of a program: the words that switch a vibration on, and their replacement in place.

use std::collections::BTreeMap;

use feedwave_cutting::{Interpretation, InterpretationStep, PipelineConfig};
use feedwave_program::lexer::{Lexer, TokenKind};
use feedwave_program::{Function, OperationKind, SourceSpan};
use similar::{ChangeTag, TextDiff};

use super::plan::Change;

/// Most steps of the interpreter, each of some thousand lines.
const MAX_STEPS: u32 = 20_000;
/// Lines around a change in a diff.
const CONTEXT_LINES: usize = 3;

/// A block that switches vibration along the path on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FunctionBlock {
    /// Its line, counted from 1.
    pub(super) line: u32,
    /// Whether lengths are inches there.
    pub(super) inch: bool,
    /// The word of the frequency, where it is written as a number.
    pub(super) frequency: Option<Word>,
    /// The word of the amplitude, likewise.
    pub(super) amplitude: Option<Word>,
}

/// A word in the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Word {
    pub(super) span: SourceSpan,
    pub(super) text: String,
}

/// The blocks that switch vibration along the path on, each line once, in the order of the lines.
pub(super) fn function_blocks(program: &[u8], config: &PipelineConfig) -> Vec<FunctionBlock> {
    let lines = Lines::of(program);
    let mut interpretation = Interpretation::new(config);
    let mut blocks: BTreeMap<u32, FunctionBlock> = BTreeMap::new();
    for _ in 0..MAX_STEPS {
        let step = interpretation.step();
        for operation in interpretation.take_operations() {
            let OperationKind::Function(command) = &operation.kind else { continue };
            if command.function != Function::PathVibration || !command.on || operation.span.program != 0 {
                continue;
            }
            let word = |letter| command.word(letter).and_then(|word| lines.word(program, word.span));
            let line = operation.span.line;
            let block = FunctionBlock { line, inch: command.inch, frequency: word('F'), amplitude: word('A') };
            // In a loop, or with lengths in another unit, a line may come again; its text is the same.
            let known = blocks.entry(line).or_insert_with(|| block.clone());
            if known.inch != block.inch {
                (known.frequency, known.amplitude) = (None, None);
            }
        }
        match step {
            InterpretationStep::NeedInput(place) => interpretation.supply(place, program),
            InterpretationStep::More => {}
            InterpretationStep::Ended => break,
        }
    }
    blocks.into_values().collect()
}

/// Where lines begin, as the interpreter counts them.
#[derive(Debug)]
struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    fn of(program: &[u8]) -> Self {
        let mark = if program.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        let ends = program
            .iter()
            .enumerate()
            .filter(|(at, byte)| **byte == b'\n' || **byte == b'\r' && program.get(at + 1) != Some(&b'\n'));
        Self { starts: std::iter::once(mark).chain(ends.map(|(at, _)| at + 1)).collect() }
    }

    /// The byte at which a place begins.
    fn offset(&self, span: SourceSpan) -> Option<usize> {
        Some(self.starts.get(span.line.checked_sub(1)? as usize)? + span.column.checked_sub(1)? as usize)
    }

    /// The word at a place, where it is a plain number.
    fn word(&self, program: &[u8], span: SourceSpan) -> Option<Word> {
        let start = self.offset(span)?;
        let text = program.get(start..start + span.length as usize)?;
        let mut tokens = Lexer::new(text);
        let is_plain = tokens.next().is_some_and(|token| token.kind == TokenKind::Word) && tokens.next().is_none();
        is_plain.then(|| Word { span, text: String::from_utf8_lossy(text).into_owned() })
    }
}

/// The program with other words in place of some.
pub(super) fn apply(program: &[u8], changes: &[&Change]) -> Vec<u8> {
    let lines = Lines::of(program);
    let mut places: Vec<_> =
        changes.iter().filter_map(|change| Some((lines.offset(change.word.span)?, *change))).collect();
    places.sort_by_key(|(start, _)| *start);
    let mut improved = Vec::with_capacity(program.len() + 16 * places.len());
    let mut copied = 0;
    for (start, change) in places {
        improved.extend_from_slice(&program[copied..start]);
        improved.extend_from_slice(change.new.as_bytes());
        copied = start + change.word.span.length as usize;
    }
    improved.extend_from_slice(&program[copied..]);
    improved
}

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
