//! The levels of a cycle along its axis: where it starts, the R level, the bottom.

use std::borrow::Cow;

use super::super::execute::{Execution, MM_PER_INCH};
use crate::code;
use crate::dialect::{Letter, letter_bit};
use crate::state::Cycle;
use crate::{Axis, Finding};

/// Levels along the drilling axis.
pub(super) struct Levels {
    pub(super) r: f64,
    pub(super) bottom: f64,
    pub(super) start: f64,
    /// Its sign is the direction out of the hole.
    pub(super) up: f64,
}

impl Execution<'_> {
    /// R level and bottom.
    pub(super) fn levels(&mut self, cycle: Cycle, axis: Axis, along: u32) -> Option<Levels> {
        let index = axis.index();
        let start = self.start_level(index);
        if self.is_cycle_of_open_system(start) {
            self.used |= along | letter_bit(b'R');
            return None;
        }
        let is_said = self.block.word(b'R').is_some() || self.state.drilling.r_level.is_some();
        let r = self.r_level(axis, along, start);
        if r.is_none() {
            let name = self.cycle_name();
            self.cycle_word(&format!("{name} has no R level"), "add R with the level to which the tool goes rapidly");
        }
        let bottom = self.bottom(axis, along, r);
        let (r, bottom) = (r?, bottom?);
        if !is_said {
            self.note_no_r(start);
        }
        self.check_levels(cycle, index, start, r, bottom)
    }

    /// The R level, from its word or a block before; where nothing has said it, the level of the start on controls that take that.
    pub(super) fn r_level(&mut self, axis: Axis, along: u32, start: f64) -> Option<f64> {
        let linuxcnc = self.is_linuxcnc();
        let absolute = self.state.absolute;
        let r_word = self.take(b'R').map(|word| self.scaled(&word, true));
        let r_is_distance = self.is_r_a_distance();
        self.check_due_level(axis, along, r_is_distance && r_word.is_some());
        match r_word {
            Some(value) if linuxcnc => {
                self.state.drilling.r_level = Some(value);
                Some(if absolute { value } else { value + start })
            }
            Some(value) => {
                let r = if r_is_distance { start + value } else { value };
                self.state.drilling.r_level = Some(r);
                Some(r)
            }
            None if linuxcnc => self.state.drilling.r_level.map(|value| if absolute { value } else { value + start }),
            None => {
                let stored = self.state.drilling.r_level.or_else(|| self.starts_without_r().then_some(start));
                self.state.drilling.r_level = stored;
                stored
            }
        }
    }

    /// Whether a cycle without R feeds from the level of its start: on Haas controls, and where R is a distance, which is none then.
    /// Where it is a level, some controls take 0 and others the last one.
    fn starts_without_r(&self) -> bool {
        self.is_r_a_distance() || self.settings.is_haas()
    }

    fn note_no_r(&mut self, start: f64) {
        let (span, name) = (self.cycle_span(), self.cycle_name());
        self.findings.push_with(code::CYCLE_NO_R, |code| {
            let message = format!("{name} has no R: the tool feeds from the level of its start, {start}");
            Finding::new(code, span, message)
                .with_value("level", start, "mm")
                .suggest("add R with the level to which the tool goes rapidly")
        });
    }

    /// Whether `R` counts from the level of the start.
    fn is_r_a_distance(&self) -> bool {
        let is_distance_in_a =
            self.has_lathe_cycles() && self.is_system_a() && !self.settings.drilling.lathe_r_is_level;
        is_distance_in_a || !self.state.absolute
    }

    /// The bottom, from the word of the drilling axis or a block before.
    fn bottom(&mut self, axis: Axis, along: u32, r: Option<f64>) -> Option<f64> {
        self.used |= along;
        let linuxcnc = self.is_linuxcnc();
        let absolute = self.state.absolute;
        if along.count_ones() > 1 {
            let word = *self.block.slot(along.trailing_zeros() as usize);
            self.word_conflict(&word, "the block has both an absolute and an incremental word for this axis");
            return None;
        }
        if along == 0 {
            let stored = self.state.drilling.bottom;
            if stored.is_none() {
                let (name, letter) = (self.cycle_name(), axis.letter());
                self.cycle_word(&format!("{name} has no bottom"), &format!("add {letter} with the bottom of the hole"));
            }
            return match stored {
                Some(value) if linuxcnc && !absolute => r.map(|r| r + value),
                stored => stored,
            };
        }
        let place = along.trailing_zeros() as usize;
        let word = *self.block.slot(place);
        let value = if axis == Axis::X { self.radius(&word) } else { self.scaled(&word, true) };
        let is_distance = !absolute || matches!(self.table.dialect.letters[place], Letter::Increment(_));
        let bottom = if is_distance { r.map(|r| r + value) } else { Some(value) };
        self.state.drilling.bottom = if linuxcnc { Some(value) } else { bottom };
        bottom
    }

    /// Whether the R level lies above the bottom, and the tool above the R level.
    fn check_levels(&mut self, cycle: Cycle, axis: usize, start: f64, r: f64, bottom: f64) -> Option<Levels> {
        let here = self.state.position[axis];
        let back = cycle == Cycle::BackBore;
        let up = if self.has_lathe_cycles() && bottom > start { -1.0 } else { 1.0 };
        let wrong = if back { up * (bottom - r) < 0.0 } else { up * (r - bottom) < 0.0 };
        let is_below = !back && !self.is_linuxcnc() && (up * (start - r) < 0.0 || up * (here - r) < 0.0);
        if !wrong && !is_below {
            return Some(Levels { r, bottom, start, up });
        }
        let span = self.cycle_span();
        let name = self.cycle_name();
        let unit_mm = if self.state.inch { MM_PER_INCH } else { 1.0 };
        let is_distance = self.is_r_a_distance() && self.has_lathe_cycles() && self.block.word(b'R').is_some();
        self.findings.push_with(code::CYCLE_LEVEL, |code| {
            let (message, cure): (_, Cow<'_, str>) = if wrong && back {
                (format!("{name} cuts upwards, but its R level {r} is above its bottom {bottom}"), "check R and Z".into())
            } else if wrong {
                (
                    format!("the R level {r} of {name} is below the bottom {bottom} of the hole"),
                    "check the signs of R and the bottom, and whether G91 makes them distances".into(),
                )
            } else {
                (
                    if up < 0.0 && (r - here) * (bottom - here) < 0.0 {
                        format!(
                            "the R level {r} and the bottom {bottom} of {name} are on different sides of the tool, which is at {here}"
                        )
                    } else {
                        format!(
                            "the tool is at {here}, below the R level {r} of {name}: the control would go to the hole there"
                        )
                    },
                    // Written as a level, as mills and Haas lathes have it.
                    if is_distance && up * (start - (r - start)) >= 0.0 {
                        let distance = (r - start - start) / unit_mm;
                        let distance = (distance * 1e4).round() / 1e4;
                        let as_level = format!(
                            "R counts from the level of the start here: where it is meant as a level, write R{distance:?}, or set \
                             language.drilling.lathe_r_is_level of the machine profile where the control reads levels"
                        );
                        as_level.into()
                    } else {
                        "move the tool above the R level before the cycle".into()
                    },
                )
            };
            Finding::new(code, span, message)
                .with_value("r_level", r, "mm")
                .with_value("bottom", bottom, "mm")
                .with_value("level", here, "mm")
                .suggest(cure)
        });
        None
    }
}
