//! Threads: `G32` and `G33`, and what every thread has.
//!
//! The modal `F` is one word with two meanings, feed and lead, as on FANUC controls: the one written last is in force.
//! Unlike there, neither is ever taken for the other. A cutting move after a thread asks for a feed of its own rather
//! than cut at the lead, and a thread after a cutting move asks for a lead. `K` of `G33` is of its block alone.

mod cycles;
mod drive_line;
mod infeed;
mod words;

use core::ops::RangeInclusive;

use super::execute::{Execution, MM_PER_INCH, counts_increments};
use super::motion::{Frame, set_bits};
use crate::block::Word;
use crate::code;
use crate::consequence::JUDGED_BY;
use crate::dialect::{Group, Letter, Meaning, letter_bit};
use crate::state::Motion;
use crate::{
    Axis, DecimalPointRule, DialectName, Finding, Function, MoveKind, OperationKind, Position, PullOut,
    ThreadAmplitudeWord, ThreadEWord, ThreadKind, ThreadMove,
};

/// Leads of threads, mm: what common controls take.
const LEADS_MM: RangeInclusive<f64> = 1e-4..=500.0;

/// What a start angle is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AngleOf {
    /// One block of `G32` or `G33`.
    Pass,
    /// `G92` or `G76`.
    Cycle,
}

/// Start angles and phase shifts, degrees.
const ANGLES_DEG: RangeInclusive<f64> = 0.0..=360.0;

/// What a threading pass states besides its path.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    lead_mm: f64,
    start_angle_deg: f64,
    amplitude_mm: Option<f64>,
    amplitude_word: Option<ThreadAmplitudeWord>,
    phase_shift_deg: Option<f64>,
    pull_out: Option<PullOut>,
    included_angle_deg: Option<f64>,
}

/// Threads per inch below which hardly a thread is.
const FEW_THREADS_PER_INCH: f64 = 4.0;

impl Execution<'_> {
    /// Whether the `F` of this block is the lead of a thread.
    pub(super) fn is_thread_block(&self) -> bool {
        if !self.table.dialect.f_is_lead {
            return false;
        }
        let meaning = |group| self.block.code(group).map(|code| self.table.code(code.place).meaning);
        if meaning(Group::NonModal) == Some(Meaning::SpeedClampOrThreadCycle) {
            return self.block.letters & self.table.axis_letters != 0;
        }
        match meaning(Group::Motion) {
            Some(meaning) => matches!(meaning, Meaning::Thread | Meaning::ThreadCycles | Meaning::ThreadCycle),
            None => {
                let in_force = self.state.drilling.cycle.is_none()
                    && matches!(self.state.motion, Motion::Thread | Motion::ThreadCycle);
                in_force && self.doubt.is_none_or(|doubt| !doubt.stays())
            }
        }
    }

    /// A block while `G32`, `G33` or `G92` is in force.
    pub(super) fn thread_motion(&mut self) {
        let mut axes = self.block.letters & self.table.axis_letters & !self.used;
        if self.state.motion == Motion::Thread {
            self.show_system_by_thread();
            // The amplitude.
            axes &= !letter_bit(b'A');
        }
        if self.block.unclear {
            if self.state.motion == Motion::Thread {
                self.state.position = self.target(axes, Frame::Work);
            }
        } else if axes == 0 {
            if self.block.letters & !self.used & (letter_bit(b'F') | letter_bit(b'E')) != 0 {
                self.lead();
            }
        } else if self.state.motion == Motion::Thread {
            self.thread(axes);
        } else {
            self.thread_cycle(axes);
        }
    }

    /// A pass of `G32` or `G33`.
    fn thread(&mut self, axes: u32) {
        let path_lead = self.take(b'K');
        let lead_mm = match path_lead {
            Some(_) if !self.is_linuxcnc_dialect() => None,
            _ if self.is_linuxcnc_dialect() && self.has_other_lead() => None,
            Some(word) => self.checked_lead(&word, self.scaled(&word, true)),
            None => self.lead(),
        };
        let start_angle_deg = self.start_angle(AngleOf::Pass);
        let phase_shift_deg = self.thread_angle(b'R', "phase shift");
        let amplitude_span = self.block.word(b'A').map(|word| self.block.word_span(word));
        let amplitude_mm = self.thread_amplitude();
        let only_x_and_z = self.are_thread_axes(axes);
        let turns = self.spindle_cuts_threads();
        let end = self.target(axes, Frame::Work);
        let travel = [Axis::X, Axis::Z].map(|axis| (end[axis.index()] - self.state.position[axis.index()]).abs());
        let [along_x, along_z] = travel;
        let further = along_x.max(along_z);
        if let Some(word) = path_lead.filter(|_| !self.is_linuxcnc_dialect()) {
            self.change_of_lead(&word, travel);
        }
        if further == 0.0 && only_x_and_z {
            self.thread_travel("the thread ends where it starts");
        } else if let (Some(lead_mm), Some(start_angle_deg), Some(phase_shift_deg), Some(amplitude_mm)) =
            (lead_mm, start_angle_deg, phase_shift_deg, amplitude_mm)
            && only_x_and_z
            && turns
        {
            // K is the travel per revolution along the path, as in LinuxCNC.
            let share =
                if path_lead.is_some() { further / (along_x * along_x + along_z * along_z).sqrt() } else { 1.0 };
            let lead_mm = lead_mm * share;
            // It is across the lead: of X, whose words are diameters, unless that has the lead.
            let is_of_x = along_z > along_x;
            let amplitude_mm = amplitude_mm.map(|[of_x, of_z]| if is_of_x { of_x } else { of_z });
            let unit_mm = if self.state.inch { MM_PER_INCH } else { 1.0 };
            let mm_per_unit = if is_of_x && self.state.x_diameter { 0.5 * unit_mm } else { unit_mm };
            let amplitude_word = Some(ThreadAmplitudeWord { span: amplitude_span, mm_per_unit });
            let cut = Cut { lead_mm, start_angle_deg, amplitude_mm, amplitude_word, phase_shift_deg, ..Cut::default() };
            self.cut_thread(end, cut);
        }
        self.state.position = end;
    }

    /// Whether a thread of LinuxCNC, whose lead is `K`, has an `F` or an `E`, which is reported.
    fn has_other_lead(&mut self) -> bool {
        let leads = letter_bit(b'F') | letter_bit(b'E');
        let Some(word) = [b'F', b'E'].into_iter().find_map(|letter| self.block.word(letter)).copied() else {
            return false;
        };
        self.used |= leads;
        self.state.reported.lead = true;
        let span = self.block.word_span(&word);
        self.findings.push_with(code::WORD_CONFLICT, |code| {
            let message =
                "G33 of LinuxCNC takes no F and no E: its lead is K, the travel per revolution along the path";
            Finding::new(code, span, message).suggest("leave it out, and write the lead as K")
        });
        true
    }

    /// Refuses `K` of a thread of FANUC and Haas controls, where the lead is `F` along the axis of the larger travel and `K` its
    /// change in every revolution (`G34`); in LinuxCNC it is the lead along the path.
    #[cold]
    fn change_of_lead(&mut self, word: &Word, [along_x, along_z]: [f64; 2]) {
        let leads = letter_bit(b'F') | letter_bit(b'E');
        let has_lead = self.block.letters & leads != 0;
        self.used |= leads;
        self.state.reported.lead = true;
        let share = along_x.max(along_z) / libm::hypot(along_x, along_z);
        let written = word.number.value();
        let lead = (written * share * 1e6).round() / 1e6;
        let span = self.block.word_span(word);
        self.findings.push_with(code::THREAD_LEAD, |code| {
            let message = "K is no lead on FANUC and Haas controls: F is, and K is what the lead changes by in every \
                           revolution of G34";
            let finding = Finding::new(code, span, message).with_value("written", written, "");
            if has_lead {
                return finding.suggest("leave K out: the lead is F, or E");
            }
            if lead > 0.0 {
                let text = format!("F{lead:?}");
                let cure = format!("where K is meant as the lead along the path, as in LinuxCNC, write {text}");
                return finding.suggest_replacement(cure, text);
            }
            finding.suggest("write the lead as F with the travel per revolution, such as F1.5")
        });
    }

    /// The lead of this block, mm: its `F` or `E`, or the modal one; `None` after a finding, now or before.
    fn lead(&mut self) -> Option<f64> {
        let inch = if self.state.inch { MM_PER_INCH } else { 1.0 };
        let feed = self.take(b'F');
        let (word, lead_mm) = match (feed, self.take(b'E')) {
            (None, None) => return self.modal_lead(),
            (Some(_), Some(word)) => {
                self.word_conflict(&word, "the thread has two leads: keep one of F and E");
                self.state.reported.lead = true;
                return None;
            }
            (None, Some(word)) if self.settings.thread_e_word == ThreadEWord::ThreadsPerInch => {
                let lead_mm = MM_PER_INCH / word.number.value();
                self.check_threads_per_inch(&word, lead_mm);
                (word, lead_mm)
            }
            (Some(word), None) | (None, Some(word)) if counts_increments(self.settings.decimal_point, &word) => {
                self.report_increments(&word);
                self.state.reported.lead = true;
                return None;
            }
            (Some(word), None) | (None, Some(word)) => (word, word.number.value() * inch),
        };
        let lead_mm = self.checked_lead(&word, lead_mm);
        self.state.unread &= !letter_bit(b'F');
        // One modal word: the lead takes the place of the feed.
        self.state.feed = 0.0;
        self.state.reported.feed = false;
        self.state.thread.lead_mm = lead_mm;
        self.state.thread.lead_as_written = feed.map(|word| word.number.value());
        self.state.reported.lead = lead_mm.is_none();
        lead_mm
    }

    /// Warns of a number of threads per inch so small that it may be meant as the lead, in mm.
    fn check_threads_per_inch(&mut self, word: &Word, lead_mm: f64) {
        let per_inch = word.number.value();
        if per_inch >= FEW_THREADS_PER_INCH || !LEADS_MM.contains(&lead_mm) {
            return;
        }
        let span = self.block.word_span(word);
        self.findings.push_with(code::THREAD_FEW_PER_INCH, |code| {
            Finding::new(code, span, format!("E{per_inch} is read as threads per inch: the lead is {lead_mm} mm"))
                .with_value("lead", lead_mm, "mm")
                .suggest(format!("where {per_inch} is the lead, write it as F{per_inch:?}, or set thread_e_word of the profile's language to THREAD_E_WORD_PRECISE_LEAD"))
        });
    }

    fn modal_lead(&mut self) -> Option<f64> {
        if self.state.thread.lead_mm.is_none() && !self.state.reported.lead {
            self.state.reported.lead = true;
            let span = self.block.span();
            let feed = self.state.feed_as_written;
            let has_feed = self.state.feed > 0.0;
            let is_linuxcnc = self.is_linuxcnc_dialect();
            self.findings.push_with(code::THREAD_LEAD_MISSING, |code| {
                let message = "the thread has no lead";
                let finding = Finding::new(code, span, message);
                let finding = finding.suggest(match is_linuxcnc {
                    true => "add K with the travel per revolution along the path, such as K1.5",
                    false => "add F with the travel per revolution, such as F1.5",
                });
                if !has_feed {
                    return finding;
                }
                let mut finding = finding.with_value("feed", feed, "");
                finding.message = format!("{message}: the feed F{feed} before it is not taken for one");
                finding
            });
        }
        self.state.thread.lead_mm
    }

    pub(super) fn checked_lead(&mut self, word: &Word, lead_mm: f64) -> Option<f64> {
        // Of a zero or negative number of threads per inch, and of zero, too.
        if LEADS_MM.contains(&lead_mm) {
            return Some(lead_mm);
        }
        let span = self.block.word_span(word);
        let written = word.number.value();
        let cure = match self.is_linuxcnc_dialect() {
            true => "write the travel per revolution, without a sign",
            false => "write the travel per revolution as F, or the threads per inch as E where the machine reads it so",
        };
        self.findings.push_with(code::THREAD_LEAD, |code| {
            let (least, most) = (*LEADS_MM.start(), *LEADS_MM.end());
            let message = format!("{written} makes no lead: it must be {least} to {most} mm per revolution");
            Finding::new(code, span, message)
                .with_value("written", written, "")
                .with_value("min_lead", least, "mm")
                .with_value("max_lead", most, "mm")
                .suggest(cure)
        });
        None
    }

    /// The start angle Q of a pass or of the passes of a cycle, degrees, 0 without the word; `None` after a finding.
    ///
    /// FANUC and Haas lathes take no decimal point and count thousandths. The published vibration of passes has degrees: within a turn
    /// a number is degrees where passes vibrate, and in `G32`, which may be one of their passes that does not.
    fn start_angle(&mut self, of: AngleOf) -> Option<f64> {
        let counted = self.block.word(b'Q').copied().filter(|word| {
            let calculator = self.settings.decimal_point == DecimalPointRule::Calculator;
            calculator && self.settings.dialect == DialectName::Lathe && !word.number.has_point()
        });
        let Some(word) = counted else {
            return self.thread_angle(b'Q', "start angle").map(|angle| angle.unwrap_or(0.0));
        };
        let written = self.scaled(&word, false);
        let (is_within_turn, thousandths) = (ANGLES_DEG.contains(&written), written / 1_000.0);
        if !ANGLES_DEG.contains(&thousandths) {
            return self.thread_angle(b'Q', "start angle").map(|angle| angle.unwrap_or(0.0));
        }
        self.take(b'Q');
        // `A` of a cycle is the angle of its tool.
        let is_still = of == AngleOf::Pass && self.block.word(b'A').is_some_and(|word| word.number.value() == 0.0);
        let vibrates = self.state.functions_on.contains(Function::ThreadVibration) && !is_still;
        let is_degrees = is_within_turn && (of == AngleOf::Pass || vibrates);
        if is_within_turn && written != 0.0 && !vibrates {
            let span = self.block.word_span(&word);
            self.findings.push_with(code::THREAD_ANGLE_UNIT, |code| {
                let (angle_deg, other) = match is_degrees {
                    true => (written, format!("{thousandths}° on a control that counts thousandths of a degree")),
                    false => (thousandths, format!("not {written}°: the control counts thousandths of a degree")),
                };
                let text = format!("Q{}", (written * 1_000.0).round());
                Finding::new(code, span, format!("Q{written} is {angle_deg}°, and {other}"))
                    .with_value("angle", angle_deg, "deg")
                    .suggest_replacement(format!("{text} is {written}° in both readings"), text)
            });
        }
        Some(if is_degrees { written } else { thousandths })
    }

    /// An angle of 0 to 360°, `Some(None)` without the word, `None` after a finding.
    fn thread_angle(&mut self, letter: u8, name: &'static str) -> Option<Option<f64>> {
        let Some(word) = self.take(letter) else {
            return Some(None);
        };
        let angle_deg = self.scaled(&word, false);
        if ANGLES_DEG.contains(&angle_deg) {
            return Some(Some(angle_deg));
        }
        let counts = letter == b'Q' && self.settings.dialect == DialectName::Lathe && !word.number.has_point();
        let span = self.block.word_span(&word);
        self.findings.push_with(code::THREAD_ANGLE, |code| {
            let letter = char::from(letter);
            let message = format!("the {name} {letter} is {angle_deg}°, but must be 0° to 360°");
            let value = (angle_deg.rem_euclid(360.0) * 1_000.0).round() / 1_000.0;
            // Where it is not counted, with a decimal point, which every rule reads in the same way.
            let text = match counts {
                true => format!("{letter}{}", (value * 1_000.0).round()),
                false => format!("{letter}{value:?}"),
            };
            Finding::new(code, span, message).with_value("angle", angle_deg, "deg").suggest_value(
                format!("the same angle is {text}"),
                Some(text),
                "angle",
                value,
                "deg",
            )
        });
        None
    }

    /// `A` as a travel of X, mm on the radius, and of Z, mm.
    fn thread_amplitude(&mut self) -> Option<Option<[f64; 2]>> {
        let Some(word) = self.take(b'A') else {
            return Some(None);
        };
        let amplitude_mm = self.radius(&word);
        if amplitude_mm >= 0.0 {
            return Some(Some([amplitude_mm, self.scaled(&word, true)]));
        }
        let span = self.block.word_span(&word);
        let written = -word.number.value();
        self.findings.push_with(code::THREAD_AMPLITUDE, |code| {
            let message = format!("the amplitude is {amplitude_mm} mm on the radius, but must not be negative");
            Finding::new(code, span, message)
                .with_value("amplitude", amplitude_mm, "mm")
                .suggest_replacement("write the peak-to-peak travel without a sign", format!("A{written}"))
                .suggest_replacement("write A0 for a pass without vibration", "A0")
        });
        None
    }

    /// Whether the axis words are of X and Z only; the others are reported.
    fn are_thread_axes(&mut self, axes: u32) -> bool {
        let mut valid = true;
        for place in set_bits(axes) {
            let (Letter::Axis(axis) | Letter::Increment(axis)) = self.table.dialect.letters[place] else {
                continue;
            };
            if matches!(axis, Axis::X | Axis::Z) {
                continue;
            }
            valid = false;
            let span = self.block.word_span(self.block.slot(place));
            self.findings.push_with(code::THREAD_AXIS, |code| {
                let message = format!("a thread moves X and Z, not {}", axis.letter());
                Finding::new(code, span, message).suggest("move the other axes in a block before it")
            });
        }
        valid
    }

    /// Whether the spindle turns at a constant speed, which a thread needs; reported once while it lasts.
    pub(super) fn spindle_cuts_threads(&mut self) -> bool {
        let span = self.block.span();
        if self.state.surface_speed {
            if !self.state.reported.thread_surface_speed {
                self.state.reported.thread_surface_speed = true;
                let present = self.state.spindle().rev_per_s(self.state.position[Axis::X.index()]) * 60.0;
                self.findings.push_with(code::THREAD_SURFACE_SPEED, |code| {
                    let message = "constant surface speed changes the spindle speed with X, which spoils a thread";
                    let finding = Finding::new(code, span, message);
                    if !(present.is_finite() && present >= 1.0) {
                        return finding.suggest("switch to a constant speed before it, such as G97 S500");
                    }
                    let speed = present.round();
                    finding.with_value("speed_here", present, "rev/min").suggest_value(
                        format!("switch to a constant speed before it, such as G97 S{speed}"),
                        None,
                        "speed",
                        speed,
                        "rev/min",
                    )
                });
            }
            return false;
        }
        if self.state.unread & JUDGED_BY != 0 {
            return false;
        }
        if self.state.spindle_turns() {
            return true;
        }
        if !self.state.reported.spindle {
            self.state.reported.spindle = true;
            self.findings.push_with(code::SPINDLE_STOPPED, |code| {
                Finding::new(code, span, "a thread follows the spindle, which does not turn")
                    .suggest("start the spindle first, such as M3 S500")
            });
        }
        false
    }

    #[cold]
    fn thread_travel(&mut self, message: &'static str) {
        let span = self.block.span();
        self.findings.push_with(code::THREAD_TRAVEL, |code| {
            Finding::new(code, span, message).suggest("check the end point and the position before it")
        });
    }

    /// Emits a pass from the present position and moves there, a pull-out included.
    fn cut_thread(&mut self, end: Position, cut: Cut) {
        if cut.amplitude_mm != Some(0.0) && self.is_work_elsewhere() {
            return;
        }
        let step = ThreadMove {
            kind: ThreadKind::Turned,
            start: self.state.position,
            end,
            work_offset: self.machine_offset(),
            frame_offset: self.frame_offset(),
            lead_mm: cut.lead_mm,
            start_angle_deg: cut.start_angle_deg,
            thread_start: 0,
            amplitude_mm: cut.amplitude_mm,
            amplitude_word: cut.amplitude_word,
            phase_shift_deg: cut.phase_shift_deg,
            pull_out: cut.pull_out,
            included_angle_deg: cut.included_angle_deg,
            spindle: self.state.spindle(),
            tool: self.state.tool,
            plane: self.thread_plane(),
        };
        self.emit(self.block.span(), OperationKind::Thread(Box::new(step)));
        self.state.position = end;
        if let Some(pull_out) = cut.pull_out {
            self.state.position[Axis::X.index()] += pull_out.retreat_mm;
        }
    }

    /// Whether the thread would vibrate away from a work whose surface is stated in other coordinates; it is then reported.
    fn is_work_elsewhere(&mut self) -> bool {
        let vibrates = self.state.functions_on.contains(Function::ThreadVibration);
        if !(vibrates && self.state.thread.work_is_elsewhere) {
            return false;
        }
        let span = self.block.span();
        self.findings.push_with(code::THREAD_PLANE_WORK, |code| {
            let message = "the thread vibrates away from a work whose surface was stated before a plane was tilted or cancelled: in the \
                           present coordinates that is another one";
            Finding::new(code, span, message)
                .suggest("switch the vibration of threads off, and on again in the present coordinates")
                .suggest("write A0.0 for a pass without vibration")
        });
        true
    }

    /// The present position with another X and Z.
    pub(super) fn moved(&self, x: f64, z: f64) -> Position {
        let mut position = self.state.position;
        position[Axis::X.index()] = x;
        position[Axis::Z.index()] = z;
        position
    }

    fn rapid_to(&mut self, x: f64, z: f64) {
        let end = self.moved(x, z);
        self.emit_move(MoveKind::Rapid, &end, None, crate::Feed::PerMinute(0.0));
        self.state.position = end;
    }
}
