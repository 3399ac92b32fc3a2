//! Spindle words of a block: speed, speed mode, clamp, direction.

use super::execute::{Execution, LEAST_RATE};
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::{DialectName, Finding, GCodeSystem, OperationKind, SourceSpan, Spindle, SpindleDirection};

impl Execution<'_> {
    /// Carries out `S`, `G96`, `G97`, the clamp and `M3`, `M4`; emits the spindle if it changed.
    pub(super) fn spindle(&mut self) {
        let before = self.state.spindle();
        let clamp = self.speed_clamp();
        let mode = self.speed_mode();
        let speed = self.speed();
        let mut direction_span = None;
        if let Some((Meaning::Spindle(direction), span)) = self.code(Group::Spindle)
            && direction != SpindleDirection::Stopped
        {
            self.state.spindle_direction = direction;
            self.state.unread &= !letter_bit(b'M');
            self.state.reported.spindle = false;
            direction_span = Some(span);
        }
        if let Some(span) = direction_span.or(speed).or(mode).or(clamp) {
            self.emit_spindle(before, span);
        }
    }

    /// Carries out `M5`.
    pub(super) fn spindle_stop(&mut self) {
        let Some((Meaning::Spindle(SpindleDirection::Stopped), span)) = self.code(Group::Spindle) else {
            return;
        };
        let before = self.state.spindle();
        self.state.spindle_direction = SpindleDirection::Stopped;
        self.state.reported.spindle = false;
        self.emit_spindle(before, span);
    }

    /// Emits the spindle if it differs from what it was.
    pub(super) fn emit_spindle(&mut self, before: Spindle, span: SourceSpan) {
        let after = self.state.spindle();
        let stays_stopped = [before, after].iter().all(|spindle| spindle.direction == SpindleDirection::Stopped);
        if after != before && !stays_stopped {
            self.emit(span, OperationKind::Spindle(after));
        }
    }

    /// `G50 S`, `G92 S`; returns the place of the code.
    fn speed_clamp(&mut self) -> Option<SourceSpan> {
        let span = match self.code(Group::NonModal)? {
            (Meaning::SpeedClamp, span) => span,
            (Meaning::SpeedClampOrThreadCycle, span) if !self.is_thread_block() => {
                if self.is_system_a() {
                    self.clamp_of_other_system(span);
                    return None;
                }
                self.show_by_code(false, Group::NonModal);
                span
            }
            _ => return None,
        };
        let axes = self.block.letters & self.table.axis_letters;
        match self.take(b'S') {
            Some(word) if word.number.value() >= LEAST_RATE => self.state.max_rev_per_min = Some(word.number.value()),
            Some(word) => self.speed_invalid(self.block.word_span(&word), word.number.value()),
            None if axes == 0 => self.speed_missing(span, "the speed clamp has no S word"),
            None => {}
        }
        Some(span)
    }

    /// `G92 S` in G-code system A, whose control cuts threads by it and clamps no speed.
    #[cold]
    fn clamp_of_other_system(&mut self, span: SourceSpan) {
        self.used |= letter_bit(b'S');
        self.findings.push_with(code::UNKNOWN_CODE, |code| {
            let message = "G92 without axis words is the speed clamp of G-code systems B and C: in A, where it is G50, \
                           the control clamps nothing";
            Finding::new(code, span, message)
                .suggest("write the clamp of system A, such as G50 S3000; for a thread, write its end in the block")
                .suggest(
                    "where the program is written in another system, set language.g_code_system of the machine profile to \
                     G_CODE_SYSTEM_B or G_CODE_SYSTEM_C",
                )
        });
    }

    /// `G96`, `G97`; returns the place of the code.
    fn speed_mode(&mut self) -> Option<SourceSpan> {
        let (Meaning::SpeedMode { surface }, span) = self.code(Group::SpeedMode)? else {
            return None;
        };
        let has_speed = self.block.letters & !self.used & letter_bit(b'S') != 0;
        if surface {
            if !has_speed && self.state.m_per_min == 0.0 {
                self.speed_missing(span, "constant surface speed has no S word");
            }
            self.state.surface_speed = true;
            if self.table.dialect.is_linuxcnc {
                self.clamp_word();
            }
            if self.state.max_rev_per_min.is_none() && !self.state.reported.speed_clamp {
                self.state.reported.speed_clamp = true;
                let such_as = match (self.settings.dialect, self.settings.g_code_system) {
                    (DialectName::LinuxCnc, _) => "as D of G96, such as G96 D3000",
                    (DialectName::Lathe, None | Some(GCodeSystem::A)) => "before it, such as G50 S3000",
                    (DialectName::Lathe, _) | (DialectName::Mill, _) => "before it, such as G92 S3000",
                };
                self.findings.push_with(code::SPEED_CLAMP_MISSING, |code| {
                    Finding::new(
                        code,
                        span,
                        "constant surface speed without a clamp: the speed grows without limit towards X0",
                    )
                    .suggest(format!("program the highest speed {such_as}"))
                });
            }
        } else {
            if self.state.surface_speed && !has_speed && self.state.spindle_turns() {
                self.keep_present_speed(span);
            }
            self.state.surface_speed = false;
            self.state.reported.thread_surface_speed = false;
        }
        Some(span)
    }

    /// `D` of LinuxCNC's `G96`: the speed clamp, none where it is missing.
    fn clamp_word(&mut self) {
        self.state.max_rev_per_min = None;
        if let Some(word) = self.take(b'D') {
            let value = word.number.value();
            if value >= LEAST_RATE {
                self.state.max_rev_per_min = Some(value);
            } else {
                self.speed_invalid(self.block.word_span(&word), value);
            }
        }
    }

    /// `G97` without `S` goes on at the speed the spindle has at the present radius, clamped by the program and the machine.
    fn keep_present_speed(&mut self, span: SourceSpan) {
        let rev_per_min = self.state.spindle().rev_per_min(self.state.position[0]).min(self.spindle_limit_rev_per_min);
        if !rev_per_min.is_finite() {
            return self.speed_missing(span, "constant speed has no S word, and the present speed is unlimited at X0");
        }
        self.state.rev_per_min = rev_per_min;
        self.findings.push_with(code::SPEED_IN_FORCE, |code| {
            let message = format!("constant speed has no S word: the present {rev_per_min:.1} rev/min stays");
            Finding::new(code, span, message).with_value("speed", rev_per_min, "rev/min")
        });
    }

    /// `S`; returns its place.
    fn speed(&mut self) -> Option<SourceSpan> {
        let word = self.take(b'S')?;
        self.state.unread &= !letter_bit(b'S');
        let span = self.block.word_span(&word);
        let value = word.number.value();
        if value != 0.0 && value < LEAST_RATE {
            self.speed_invalid(span, value);
        } else if self.state.surface_speed {
            self.state.m_per_min = self.m_per_min(value);
        } else {
            self.state.rev_per_min = value;
        }
        self.state.reported.spindle = false;
        Some(span)
    }

    fn speed_invalid(&mut self, span: SourceSpan, speed: f64) {
        self.findings.push_with(code::SPEED_INVALID, |code| {
            Finding::new(code, span, format!("{speed} is no spindle speed")).with_value("speed", speed, "")
        });
    }

    fn speed_missing(&mut self, span: SourceSpan, message: &'static str) {
        self.findings
            .push_with(code::SPEED_MISSING, |code| Finding::new(code, span, message).suggest("add S to the block"));
    }
}
