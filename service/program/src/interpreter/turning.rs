//! Turning, facing and grooving cycles of lathes.
//!
//! Single cycles and grooves become moves at once. A cycle along a contour first reads the blocks of the contour, which are
//! executed as anywhere else but move nothing, and then hands on its passes a few at a time, so that little is remembered
//! however many there are (docs/turning-cycles.md).

mod beyond;
mod contour;
mod follow;
mod frame;
mod gouge;
mod groove;
mod linuxcnc;
mod passes;
mod pockets;
mod request;
mod single;
mod stock;

pub(crate) use follow::ContourRun;
pub(super) use passes::Step;

use core::ops::RangeInclusive;

use super::doubt::SYSTEM_CURE;
use super::execute::Execution;
use super::motion::{Frame, set_bits};
use crate::block::Word;
use crate::code;
use crate::dialect::{Group, letter_bit};
use crate::state::{Motion, SingleCycle, TurningCycle};
use crate::{Axis, DialectName, Finding, FindingCode, Plane};

/// Depths, pecks and allowances, mm: larger ones are mistakes.
const LENGTHS_MM: RangeInclusive<f64> = 0.0..=1_000.0;

/// Depths and pecks that cannot be nothing, mm.
const DEPTHS_MM: RangeInclusive<f64> = 1e-4..=1_000.0;

/// Lengths with a sign, mm.
const SIGNED_MM: RangeInclusive<f64> = -1_000.0..=1_000.0;

/// How a word is read.
type Reading = fn(&Execution<'_>, &Word) -> f64;

/// A word that is a length like any other.
const SCALED: Reading = |this, word| this.scaled(word, true);

/// A word that counts in least increments unless it has a point.
const THOUSANDTHS: Reading = |this, word| this.thousandths(word);

impl Execution<'_> {
    /// A block with the code of a turning cycle; `before` is the motion in force before it.
    pub(super) fn turning_cycle(&mut self, cycle: TurningCycle, before: Motion) {
        self.state.spline_exit = None;
        if self.block.unclear {
            if matches!(cycle, TurningCycle::SingleTurn | TurningCycle::SingleFace) {
                self.state.motion = Motion::Unclear;
            }
            self.used = u32::MAX;
            return;
        }
        if let Some((_, span)) = self.code(Group::NonModal) {
            self.used = u32::MAX;
            return self.findings.push_with(code::GROUP_CONFLICT, |code| {
                Finding::new(code, span, "a turning cycle needs a block of its own").suggest("write them in two blocks")
            });
        }
        if self.is_doubtful_cycle(cycle) {
            return;
        }
        if self.state.plane != Plane::Zx {
            // Some posts write the units of other controls.
            let of_cycle = b"PQUWRDI".iter().fold(0, |mask, &letter| mask | letter_bit(letter));
            let unit = match cycle {
                _ if self.block.letters & of_cycle != 0 => None,
                TurningCycle::Finish => Some("for inches write G20; for the cycle select the plane before, G18"),
                TurningCycle::Turn(_) => Some("for millimetres write G21; for the cycle select the plane before, G18"),
                _ => None,
            };
            self.used = u32::MAX;
            if core::mem::replace(&mut self.state.turning.plane_reported, true) {
                return;
            }
            return self.turning_finding(
                code::TURNING_FORM,
                "a turning cycle needs the plane of Z and X",
                unit.unwrap_or("select it before, G18"),
            );
        }
        match cycle {
            TurningCycle::SingleTurn => self.open_single_cycle(SingleCycle::Turn, before),
            TurningCycle::SingleFace => self.open_single_cycle(SingleCycle::Face, before),
            TurningCycle::FaceGroove => self.groove(Axis::Z),
            TurningCycle::Groove => self.groove(Axis::X),
            _ if self.settings.dialect == DialectName::LinuxCnc => self.contour_of_linuxcnc(cycle),
            _ => self.contour_cycle(cycle),
        }
    }

    /// The letters of the words that place X and Z.
    fn turning_letters(&self) -> [u32; 2] {
        let of = |wanted: Axis| {
            let letters = self.table.dialect.letters.iter().enumerate();
            letters.filter(|(_, letter)| letter.is_of(wanted)).fold(0, |mask, (place, _)| mask | 1 << place)
        };
        [of(Axis::X), of(Axis::Z)]
    }

    /// X and Z that the words of the block name, each where it is named; other axes are refused. The words are used by this.
    fn turning_end(&mut self) -> Option<([f64; 2], [bool; 2])> {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let letters = self.turning_letters();
        let others = axes & !(letters[0] | letters[1]);
        let end = self.target(axes, Frame::Work);
        let named = letters.map(|letters| axes & letters != 0);
        if let Some(place) = set_bits(others).next() {
            let span = self.block.word_span(self.block.slot(place));
            let letter = char::from(b'A' + place as u8);
            self.findings.push_with(code::TURNING_FORM, |code| {
                Finding::new(code, span, format!("a turning cycle moves X and Z, not {letter}"))
                    .suggest("move the other axes in a block before it")
            });
            return None;
        }
        Some(([end[Axis::X.index()], end[Axis::Z.index()]], named))
    }

    /// X and Z of the tool.
    const fn tool_place(&self) -> [f64; 2] {
        [self.state.position[Axis::X.index()], self.state.position[Axis::Z.index()]]
    }

    #[cold]
    fn turning_finding(&mut self, code: FindingCode, message: &str, cure: &str) {
        let span = self.block.span();
        self.findings.push_with(code, |code| Finding::new(code, span, message).suggest(cure));
    }

    /// A length of a cycle, mm: `Some(None)` without the word, `None` after a finding.
    fn turning_length(
        &mut self,
        letter: u8,
        name: &'static str,
        range: &RangeInclusive<f64>,
        read: Reading,
    ) -> Option<Option<f64>> {
        let Some(word) = self.take(letter) else { return Some(None) };
        let value = read(self, &word);
        if range.contains(&value) {
            return Some(Some(value));
        }
        let span = self.block.word_span(&word);
        self.findings.push_with(code::TURNING_VALUE, |code| {
            let (least, most) = (*range.start(), *range.end());
            let shown = name.replace('_', " ");
            Finding::new(code, span, format!("the {shown} is {value} mm, but must be {least} to {most} mm"))
                .with_value(name, value, "mm")
                .with_value("min", least, "mm")
                .with_value("max", most, "mm")
                .suggest("write a value in this range, and check for a missing or an extra decimal point")
        });
        None
    }

    /// A whole number of a cycle: `Some(None)` without the word, `None` after a finding.
    fn turning_count(&mut self, letter: u8, name: &'static str, range: &RangeInclusive<u32>) -> Option<Option<u32>> {
        let Some(word) = self.take(letter) else { return Some(None) };
        let value = self.whole(&word)?;
        if range.contains(&value) {
            return Some(Some(value));
        }
        let span = self.block.word_span(&word);
        self.findings.push_with(code::TURNING_VALUE, |code| {
            let (least, most) = (*range.start(), *range.end());
            let shown = name.replace('_', " ");
            Finding::new(code, span, format!("the {shown} is {value}, but must be {least} to {most}"))
                .with_value(name, f64::from(value), "")
                .with_value("min", f64::from(least), "")
                .with_value("max", f64::from(most), "")
                .suggest("write a value in this range")
        });
        None
    }

    #[cold]
    fn turning_word_missing(&mut self, what: &str, cure: &str) {
        self.turning_finding(code::TURNING_WORD, &format!("the turning cycle has no {what}"), cure);
    }

    /// A value that the profile may state; the default is reported once.
    fn turning_default(&mut self, place: usize, stated: Option<f64>, setting: &'static str, default_mm: f64) -> f64 {
        if let Some(value) = stated {
            return value;
        }
        if !std::mem::replace(&mut self.state.turning.default_reported[place], true) {
            let span = self.block.span();
            self.findings.push_with(code::TURNING_DEFAULT, |code| {
                let message = format!(
                    "neither the program nor language.turning.{setting} of the machine profile states it: {default_mm} mm is taken"
                );
                Finding::new(code, span, message)
                    .with_value("default", default_mm, "mm")
                    .suggest(format!("set {setting} as the control has it, or write R in the cycle"))
            });
        }
        default_mm
    }

    /// Whether this block may be another cycle in another G-code system, while the profile names none; that is then reported.
    fn is_doubtful_cycle(&mut self, cycle: TurningCycle) -> bool {
        if self.settings.dialect != DialectName::Lathe || self.settings.g_code_system.is_some() {
            return false;
        }
        let letters = self.block.letters & !self.used;
        let has = |text: &[u8]| text.iter().any(|&letter| letters & letter_bit(letter) != 0);
        let contour = has(b"P") && has(b"Q");
        // What of the block system C has no words for, or that it needs words for which are not there.
        let is_certain = match cycle {
            TurningCycle::Finish => contour,
            TurningCycle::Turn(_) => contour || has(b"UR"),
            // In C the finishing cycle, which has a contour and nothing else.
            TurningCycle::Face(_) => has(b"WURDIK"),
            // In C roughing along Z, whose first line has no W.
            TurningCycle::Pattern => !contour && has(b"W") || has(b"IK"),
            // In C roughing along X, and the pattern: their second lines name neither X nor Z.
            TurningCycle::FaceGroove | TurningCycle::Groove => has(b"XZIKD") || !has(b"PQUW"),
            TurningCycle::SingleTurn | TurningCycle::SingleFace => true,
        };
        // R alone could be the first line of another cycle in C, whose depth was said before.
        self.state.not_system_c |= is_certain && has(b"XZPQUWIKD");
        if is_certain || self.state.not_system_c {
            return false;
        }
        self.used = u32::MAX;
        let Some((_, span)) = self.code(Group::Motion) else { return true };
        let (here, elsewhere) = match cycle {
            TurningCycle::Finish => ("the finishing cycle in G-code systems A and B", "inches in C"),
            TurningCycle::Turn(_) => ("roughing along Z in G-code systems A and B", "millimetres in C"),
            TurningCycle::Face(_) => ("roughing along X in G-code systems A and B", "the finishing cycle in C"),
            TurningCycle::Pattern => ("the pattern in G-code systems A and B", "roughing along Z in C"),
            TurningCycle::FaceGroove => {
                ("the grooving cycle along Z in G-code systems A and B", "roughing along X in C")
            }
            _ => ("the grooving cycle along X in G-code systems A and B", "the pattern in C"),
        };
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            Finding::new(code, span, format!("with these words the code is {here} and {elsewhere}"))
                .suggest(SYSTEM_CURE)
        });
        true
    }

    /// A code that means another cycle in each G-code system, while the profile names none.
    #[cold]
    pub(super) fn cycle_of_no_system(&mut self, what: &str) {
        self.used = u32::MAX;
        self.state.motion = Motion::Unclear;
        let Some((_, span)) = self.code(Group::Motion) else { return };
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message = format!("this is {what}, but the machine profile names no G-code system");
            Finding::new(code, span, message).suggest(SYSTEM_CURE)
        });
    }
}
