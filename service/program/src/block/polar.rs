//! Polar words of LinuxCNC: `@`, the distance from the origin, and `^`, the angle from X. They take the place of X and Y.

use super::computed::nothing_between;
use super::{Block, LARGEST_NUMBER, Word};
use crate::code;
use crate::dialect::{CodeTable, Group, Meaning, letter_bit};
use crate::expression::{Context, evaluate};
use crate::interpreter::System;
use crate::lexer::Token;
use crate::number::Number;
use crate::{Finding, FindingLog, Plane};

/// The letters whose place polar words take.
const REPLACED: u32 = letter_bit(b'X') | letter_bit(b'Y');

/// The polar words of one block.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PolarWords {
    /// `@`, in the unit of the program.
    pub(crate) radius: Option<Word>,
    /// `^`, degrees.
    pub(crate) angle: Option<Word>,
}

impl Block {
    /// The polar words, which place X and Y: their letters are among `letters`, their words say nothing.
    #[inline]
    pub(crate) const fn polar(&self) -> Option<&PolarWords> {
        self.polar.as_ref()
    }

    /// Reads `@` or `^`.
    #[cold]
    pub(super) fn read_polar(
        &mut self,
        line: &[u8],
        token: Token,
        table: &CodeTable,
        system: System<'_>,
        findings: &mut FindingLog,
    ) {
        (self.extent.0, self.extent.1) = (self.extent.0.min(token.start), token.end);
        let is_radius = line[token.start as usize] == b'@';
        let name = if is_radius { "@" } else { "^" };
        if token.end == token.start + 1 {
            return self.refuse_polar(token, format!("{name} has no number"), "write its number behind it", findings);
        }
        let mut context = Context::new(table.expressions, &system, system.settings.angle_range);
        let read = evaluate(line, token.start as usize + 1, &mut context).and_then(|(value, read_to)| {
            nothing_between(line, read_to, token.end as usize, "put expressions in brackets: @[#1+2]").map(|()| value)
        });
        self.note(&context.notes, findings);
        let value = match read {
            Ok(value) => value.unwrap_or(0.0),
            Err(defect) => return self.fail(&defect, findings),
        };
        if value.abs() > LARGEST_NUMBER {
            let message = format!("the number of {name} is beyond ±{LARGEST_NUMBER:e}");
            return self.refuse_polar(token, message, "check it", findings);
        }
        let words = self.polar.get_or_insert_default();
        let word = if is_radius { &mut words.radius } else { &mut words.angle };
        if word.is_some() {
            let message = format!("{name} occurs twice in the block");
            return self.refuse_polar(token, message, "keep one of them", findings);
        }
        *word = Some(Word { number: Number::computed(value), start: token.start, end: token.end });
    }

    /// Checks that polar words place the end of a move, once the line has been read, and puts them in the place of X and Y.
    #[cold]
    pub(super) fn take_polar(&mut self, table: &CodeTable, plane: Plane, findings: &mut FindingLog) {
        let Some(words) = self.polar else { return };
        let Some(first) = words.radius.or(words.angle) else { return };
        let meaning = |group| self.code(group).map(|code| table.code(code.place).meaning);
        let is_other_plane =
            plane != Plane::Xy || meaning(Group::Plane).is_some_and(|it| it != Meaning::Plane(Plane::Xy));
        let cure = "write the end as X and Y, such as X[10 * COS[30]] Y[10 * SIN[30]] for @10 ^30";
        let (message, cure) = match () {
            () if self.letters & REPLACED != 0 => ("polar words beside X or Y", "keep the polar words or X and Y"),
            () if is_other_plane => ("polar words are of the plane XY", "select it with G17 in a block before"),
            () if meaning(Group::NonModal).is_some_and(|it| it != Meaning::Dwell) => {
                ("polar words with a one-block code", cure)
            }
            () if matches!(meaning(Group::LengthCompensation), Some(Meaning::LengthOffset { .. })) => {
                ("polar words in a block that sets a tool offset", cure)
            }
            () if meaning(Group::Cycle).is_some() => ("polar words with the end of the cycles", cure),
            () if matches!(
                meaning(Group::Motion),
                Some(Meaning::ThreadCycles | Meaning::Turning(_) | Meaning::Nurbs | Meaning::NurbsEnd)
            ) =>
            {
                ("polar words with a cycle of turning or a NURBS", cure)
            }
            () => return self.replace_by_polar(&first),
        };
        self.replace_by_polar(&first);
        self.polar = None;
        self.unclear = true;
        let span = self.word_span(&first);
        findings.push_with(code::POLAR_WORD, |code| Finding::new(code, span, message).suggest(cure));
    }

    /// Puts words that say nothing in the place of X and Y, so that the block names these axes.
    fn replace_by_polar(&mut self, first: &Word) {
        for letter in *b"XY" {
            if self.letters & letter_bit(letter) == 0 {
                self.words[usize::from(letter - b'A')] = Word { number: Number::ZERO, ..*first };
            }
        }
        self.letters |= REPLACED;
    }

    fn refuse_polar(&mut self, token: Token, message: String, cure: &'static str, findings: &mut FindingLog) {
        self.defect(code::POLAR_WORD, token, findings, |mut finding| {
            finding.message = message;
            finding.suggest(cure)
        });
    }
}
