//! The words of a cycle: pecks, dwell, repeats, shift.

use super::super::execute::Execution;
use super::cut::MAX_STROKES;
use super::levels::Levels;
use super::{Hole, Pecks};
use crate::block::Word;
use crate::code;
use crate::dialect::{Letter, letter_bit};
use crate::state::Cycle;
use crate::{Axis, BoringShift, DrillingStyle, Finding, Position};

/// Values of the settings of where a pecking tool goes, with what each says.
const PECK_RETURNS: &str = "PECK_RETURN_R_LEVEL where the tool goes out of the hole, to PECK_RETURN_BACK where it goes back by \
                            the retract of chip breaking";
/// Values of the setting of the direction off the wall.
const BORING_SHIFTS: &str = "BORING_SHIFT_FIRST_PLUS or BORING_SHIFT_FIRST_MINUS along the first axis of the plane (X in G17), \
                             to BORING_SHIFT_SECOND_PLUS or BORING_SHIFT_SECOND_MINUS along the second";
/// The axes of `I`, `J` and `K`.
const CENTRE_AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

impl Execution<'_> {
    /// The holes that a block asks for, and how often; nothing after a finding. `along` are the words of the drilling axis,
    /// `start` is where the tool was, `at` where the first hole is.
    pub(super) fn hole(
        &mut self,
        cycle: Cycle,
        axis: Axis,
        along: u32,
        start: &Position,
        at: Position,
    ) -> Option<(Hole, u32)> {
        let opens = self.state.drilling.returned_to_r.is_none();
        let index = axis.index();
        if self.state.drilling.axis.replace(index as u8).is_some_and(|before| usize::from(before) != index)
            && !self.is_linuxcnc()
        {
            let drilling = &mut self.state.drilling;
            (drilling.start_level, drilling.r_level, drilling.bottom) = (None, None, None);
        }
        let levels = self.levels(cycle, axis, along);
        let dwell_s = self.cycle_dwell(cycle, opens);
        let pecks = self.pecks(cycle);
        let shift = self.boring_shift(cycle);
        let repeats = self.repeats();
        let tap_retract = self.tap_retract(cycle);
        let drive = self.drive(cycle);
        let Levels { r, bottom, start: level, up } = levels?;
        let (dwell_s, (pecks, out_after), shift, repeats, drive) = (dwell_s?, pecks?, shift?, repeats?, drive?);
        let tap_retract = tap_retract?;
        self.check_strokes(pecks.strokes((r - bottom).abs()), repeats)?;
        let step = self.pattern_step(start, &at, index);
        let clear = if self.state.drilling.to_r {
            r
        } else if up * (level - r) > 0.0 {
            level
        } else {
            r
        };
        let hole = Hole {
            cycle,
            axis: index,
            up,
            at,
            step,
            repeats,
            r,
            bottom,
            clear,
            pecks,
            out_after,
            dwell_s,
            shift,
            drive,
            pattern: None,
            tap_retract,
            polar_step_deg: None,
        };
        Some((hole, repeats))
    }

    /// Whether a block makes no more strokes than are carried out.
    pub(super) fn check_strokes(&mut self, strokes: u32, repeats: u32) -> Option<()> {
        if u64::from(strokes) * u64::from(repeats) <= u64::from(MAX_STROKES) {
            return Some(());
        }
        let span = self.cycle_span();
        self.findings.push_with(code::CYCLE_VALUE, |code| {
            let message =
                format!("{repeats} holes with {strokes} or more strokes each are more than {MAX_STROKES} in one block");
            Finding::new(code, span, message)
                .with_value("repeats", f64::from(repeats), "")
                .with_value("strokes", f64::from(strokes), "")
                .with_value("limit", f64::from(MAX_STROKES), "")
                .suggest("write a larger peck or fewer repeats; a decimal point may be missing")
        });
        None
    }

    /// From hole to hole of a pattern: what the words of the block add, across the drilling axis.
    fn pattern_step(&self, start: &Position, at: &Position, drilled: usize) -> Position {
        let mut step: Position = core::array::from_fn(|axis| at[axis] - start[axis]);
        if self.state.absolute {
            for axis in Axis::ALL {
                if self.block.letters & self.increments_of(axis) == 0 {
                    step[axis.index()] = 0.0;
                }
            }
        }
        step[drilled] = 0.0;
        step
    }

    /// The letters of the words that place an axis incrementally whatever the distance mode.
    fn increments_of(&self, axis: Axis) -> u32 {
        let letters = self.table.dialect.letters.iter().enumerate();
        let names = letters.filter(|(_, letter)| matches!(letter, Letter::Increment(named) if *named == axis));
        names.fold(0, |mask, (place, _)| mask | 1 << place)
    }

    /// The code that is in force, as written.
    pub(in super::super) fn cycle_name(&self) -> &'static str {
        self.state.drilling.cycle.map_or("the cycle", Cycle::name)
    }

    /// `P`, s.
    fn cycle_dwell(&mut self, cycle: Cycle, opens: bool) -> Option<f64> {
        let linuxcnc = self.is_linuxcnc();
        let takes = match cycle {
            Cycle::DrillDwell | Cycle::Tap | Cycle::TapLeft | Cycle::BoreStop | Cycle::BoreDwell => true,
            Cycle::FineBore | Cycle::BackBore => true,
            Cycle::Peck | Cycle::ChipBreak => {
                self.has_lathe_cycles() || !linuxcnc && self.settings.drilling.style == DrillingStyle::Haas
            }
            Cycle::Drill | Cycle::Bore | Cycle::BoreManual => false,
        };
        if !takes {
            return Some(0.0);
        }
        let Some(word) = self.take(b'P') else {
            let needs = matches!(cycle, Cycle::DrillDwell | Cycle::BoreStop | Cycle::BoreDwell);
            if linuxcnc && needs && opens {
                let name = self.cycle_name();
                self.cycle_word(&format!("{name} has no P, its dwell at the bottom"), "add P with the time in seconds");
                return None;
            }
            return Some(self.state.drilling.dwell_s.unwrap_or(0.0));
        };
        let value = word.number.value();
        let seconds = if self.is_dwell_in_ms(&word) { value / 1_000.0 } else { value };
        if seconds < 0.0 {
            self.drill_value(
                &word,
                format!("the dwell lasts {seconds} s, but must not be negative"),
                "remove the sign",
            );
            return None;
        }
        self.state.drilling.dwell_s = Some(seconds);
        Some(seconds)
    }

    /// `Q`, or `I J K` of Haas: the pecks, and after how much `G73` goes out of the hole.
    fn pecks(&mut self, cycle: Cycle) -> Option<(Pecks, Option<f64>)> {
        let rigid = matches!(cycle, Cycle::Tap | Cycle::TapLeft) && self.taps_rigidly();
        let pecks = matches!(cycle, Cycle::Peck | Cycle::ChipBreak);
        if !pecks && !rigid {
            return Some((Pecks::None, None));
        }
        let lathe = self.has_lathe_cycles();
        let haas = !self.is_linuxcnc() && self.settings.drilling.style == DrillingStyle::Haas;
        self.read_pecks(cycle)?;
        let [first, less, least] = self.state.drilling.ijk;
        match (self.state.drilling.q, first) {
            (_, Some(first)) if cycle == Cycle::Peck || haas && cycle == Cycle::ChipBreak => {
                let (less, least) = (less.unwrap_or(0.0), least.unwrap_or(0.0));
                if first <= 0.0 || less > 0.0 && least <= 0.0 {
                    let message = "pecks that get smaller by J need I, the first, and K, the least, above 0";
                    self.cycle_word(message, "write I, J and K, or Q for equal pecks");
                    return None;
                }
                Some((Pecks::Reducing { first, less, least: least.min(first) }, None))
            }
            (Some(q), _) if !rigid || self.settings.drilling.tap_peck.is_some() => {
                self.check_lathe_peck(lathe, cycle)?;
                let out_after = least.filter(|total| cycle == Cycle::ChipBreak && *total > 0.0);
                Some((Pecks::Constant(q), out_after))
            }
            (Some(_), _) => {
                self.cycle_setting(
                    "whether a tap that pecks goes out of the hole or only back",
                    "tap_peck",
                    PECK_RETURNS,
                );
                None
            }
            (None, _) if rigid || lathe => Some((Pecks::None, None)),
            (None, _) => {
                let name = self.cycle_name();
                self.cycle_word(&format!("{name} has no Q, the depth of its pecks"), "add Q");
                None
            }
        }
    }

    /// Keeps the words of a block that say how deep the pecks of a cycle are.
    fn read_pecks(&mut self, cycle: Cycle) -> Option<()> {
        let lathe = self.has_lathe_cycles();
        self.check_two_pecks(cycle, lathe)?;
        self.peck_depth(lathe)?;
        let haas = !self.is_linuxcnc() && self.settings.drilling.style == DrillingStyle::Haas;
        // I and J of G83 are Haas's whatever the style; K belongs to them there only.
        let reducing = cycle == Cycle::Peck
            && !self.is_linuxcnc()
            && !lathe
            && self.block.letters & !self.used & (letter_bit(b'I') | letter_bit(b'J')) != 0;
        if reducing || haas && matches!(cycle, Cycle::Peck | Cycle::ChipBreak) {
            self.reducing_pecks()?;
        }
        Some(())
    }

    /// A block with `R` but without a place and a bottom, which come in the blocks behind it: its words are kept.
    pub(super) fn keep_cycle_words(&mut self, cycle: Cycle, axis: Axis) {
        self.state.drilling.axis = Some(axis.index() as u8);
        let start = self.start_level(axis.index());
        self.r_level(axis, 0, start);
        self.cycle_dwell(cycle, true);
        match cycle {
            Cycle::FineBore | Cycle::BackBore => {
                let (first, second) = self.state.plane.axes();
                self.read_boring_shift([first, second]);
            }
            Cycle::Peck | Cycle::ChipBreak | Cycle::Tap | Cycle::TapLeft => {
                self.read_pecks(cycle);
            }
            _ => {}
        }
    }

    /// Refuses a block with both `Q`, the depth of equal pecks, and words of pecks that get smaller.
    fn check_two_pecks(&mut self, cycle: Cycle, lathe: bool) -> Option<()> {
        let is_haas = self.settings.drilling.style == DrillingStyle::Haas;
        // K repeats the cycle on other controls, and in G73 it says after how much the tool goes out of the hole.
        let least = if is_haas && cycle == Cycle::Peck { letter_bit(b'K') } else { 0 };
        let reducing = letter_bit(b'I') | letter_bit(b'J') | least;
        let is_taken = self.is_linuxcnc() || lathe || self.block.letters & !self.used & reducing == 0;
        let Some(word) = self.block.word(b'Q').copied().filter(|_| !is_taken) else { return Some(()) };
        self.used |= reducing | letter_bit(b'Q');
        self.word_conflict(&word, "the block has two kinds of pecks: keep Q for equal ones, or I, J and K");
        None
    }

    /// `Q`: pecks of one depth.
    fn peck_depth(&mut self, lathe: bool) -> Option<()> {
        let Some(word) = self.take(b'Q') else { return Some(()) };
        // A lathe's Q is in least increments unless it has a point.
        let peck = if lathe { self.thousandths(&word) } else { self.scaled(&word, true) };
        if peck <= 0.0 {
            self.drill_value(
                &word,
                format!("the peck Q is {peck} mm, but must be positive"),
                "write how deep each peck goes",
            );
            return None;
        }
        self.state.drilling.q = Some(peck);
        self.state.drilling.ijk = [None; 3];
        Some(())
    }

    /// `I J K`: the first peck, by how much each is less than the one before, and the least.
    fn reducing_pecks(&mut self) -> Option<()> {
        for (place, letter) in [b'I', b'J', b'K'].into_iter().enumerate() {
            let Some(word) = self.take(letter) else { continue };
            let value = self.scaled(&word, true);
            if value < 0.0 {
                let letter = char::from(letter);
                self.drill_value(&word, format!("{letter} is {value} mm, but must not be negative"), "remove the sign");
                return None;
            }
            self.state.drilling.ijk[place] = Some(value);
            if place == 0 {
                self.state.drilling.q = None;
            }
        }
        Some(())
    }

    fn check_lathe_peck(&mut self, lathe: bool, cycle: Cycle) -> Option<()> {
        if lathe && cycle == Cycle::Peck && self.settings.drilling.lathe_peck.is_none() {
            let what = "whether the tool goes out of the hole between pecks or only back";
            self.cycle_setting(what, "lathe_peck", PECK_RETURNS);
            return None;
        }
        Some(())
    }

    /// Where the oriented tool leaves the wall: `I J` along the axes of the plane, or `Q` in the direction of the profile.
    fn boring_shift(&mut self, cycle: Cycle) -> Option<Position> {
        let mut shift = [0.0; crate::AXIS_COUNT];
        if !matches!(cycle, Cycle::FineBore | Cycle::BackBore) {
            return Some(shift);
        }
        let (first, second) = self.state.plane.axes();
        self.read_boring_shift([first, second])?;
        if self.state.drilling.ijk.iter().any(Option::is_some) {
            for (axis, value) in CENTRE_AXES.into_iter().zip(self.state.drilling.ijk) {
                shift[axis.index()] = value.unwrap_or(0.0);
            }
            return Some(shift);
        }
        match (self.state.drilling.q, self.settings.drilling.boring_shift) {
            (None, _) => {
                let name = self.cycle_name();
                self.cycle_word(&format!("{name} does not say how far the tool leaves the wall"), "add Q, or I and J");
                None
            }
            (Some(_), None) => {
                self.cycle_setting(
                    "in which direction the oriented tool leaves the wall",
                    "boring_shift",
                    BORING_SHIFTS,
                );
                None
            }
            (Some(q), Some(direction)) => {
                let (axis, sign) = match direction {
                    BoringShift::FirstPlus => (first, 1.0),
                    BoringShift::FirstMinus => (first, -1.0),
                    BoringShift::SecondPlus => (second, 1.0),
                    BoringShift::SecondMinus => (second, -1.0),
                };
                shift[axis.index()] = sign * q;
                Some(shift)
            }
        }
    }

    /// Keeps the words of a block that say where the oriented tool leaves the wall; nothing after a finding.
    fn read_boring_shift(&mut self, plane_axes: [Axis; 2]) -> Option<()> {
        let mut has_words = false;
        for (place, letter) in [b'I', b'J', b'K'].into_iter().enumerate() {
            if !plane_axes.contains(&CENTRE_AXES[place])
                || letter == b'K' && self.repeat_letters() & letter_bit(b'K') != 0
            {
                continue;
            }
            if let Some(word) = self.take(letter) {
                has_words = true;
                self.state.drilling.ijk[place] = Some(self.scaled(&word, true));
            }
        }
        let q = self.take(b'Q').map(|word| (word, self.scaled(&word, true)));
        if let Some((word, value)) = q {
            if value < 0.0 || has_words {
                self.drill_value(
                    &word,
                    format!("the shift Q is {value} mm beside I or J, or negative"),
                    "write Q without a sign, or I and J",
                );
                return None;
            }
            self.state.drilling.q = Some(value);
            self.state.drilling.ijk = [None; 3];
        } else if has_words {
            self.state.drilling.q = None;
        }
        Some(())
    }

    /// The letters that say how often.
    fn repeat_letters(&self) -> u32 {
        let haas = self.settings.drilling.style == DrillingStyle::Haas;
        let k = if self.is_linuxcnc() || haas { 0 } else { letter_bit(b'K') };
        k | letter_bit(b'L')
    }

    /// `K` or `L`.
    fn repeats(&mut self) -> Option<u32> {
        let letters = self.repeat_letters();
        let l = self.take(b'L');
        let k = if letters & letter_bit(b'K') != 0 { self.take(b'K') } else { None };
        if let (Some(word), Some(_)) = (l, k) {
            self.word_conflict(&word, "the cycle says twice how often it is repeated: keep one of K and L");
            return None;
        }
        let Some(word) = l.or(k) else { return Some(1) };
        let repeats = self.whole(&word)?;
        if repeats == 0 && self.is_linuxcnc() {
            let message = format!("{} is repeated 0 times, which LinuxCNC refuses", self.cycle_name());
            self.drill_value(&word, message, "write how often, or remove the block");
            return None;
        }
        Some(repeats)
    }

    #[cold]
    pub(super) fn drill_value(&mut self, word: &Word, message: String, cure: &str) {
        let span = self.block.word_span(word);
        let value = word.number.value();
        // That something is missing at the next hole is no mistake of its own.
        self.state.unread |= letter_bit(b'Q');
        self.findings.push_with(code::CYCLE_VALUE, |code| {
            Finding::new(code, span, message).with_value("value", value, "").suggest(cure)
        });
    }

    #[cold]
    pub(super) fn cycle_setting(&mut self, what: &str, setting: &str, values: &str) {
        let span = self.cycle_span();
        self.findings.push_with(code::CYCLE_SETTING, |code| {
            let message = format!("the machine profile does not say {what}");
            let cure =
                format!("set language.drilling.{setting} of the machine profile as its manual says: to {values}");
            Finding::new(code, span, message).suggest(cure)
        });
    }
}
