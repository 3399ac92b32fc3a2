//! Execution of one block: everything but motion.

use super::corner::Corner;
use super::doubt::Doubt;
use crate::block::{Block, CodeWord, Word};
use crate::code;
use crate::dialect::{CodeTable, FeedUnit, Group, MachineStep, Meaning, letter_bit};
use crate::expression::whole_near;
use crate::state::{InterpreterState, Phase};
use crate::{
    DecimalPointRule, DwellTime, DwellUnit, Finding, FindingLog, LanguageSettings, MachineCommand, Operation,
    OperationKind, SourceSpan, ToolOffset, XWord,
};

/// One inch in mm, by definition.
pub(super) const MM_PER_INCH: f64 = 25.4;

/// One foot in m, by definition: surface speed in an inch program is in feet/min.
pub(super) const M_PER_FOOT: f64 = 0.3048;

/// Feeds and speeds below this are mistakes, as numbers beyond the largest one are: together the two limits keep
/// every time and every ratio derived from them finite.
pub(super) const LEAST_RATE: f64 = 1e-9;

/// A length of a word, mm, or its number where nothing is in inches: decimal-point rule, then unit.
#[inline]
pub(super) fn scaled_length(rule: DecimalPointRule, inch: bool, word: &Word) -> f64 {
    let mut value = word.number.value();
    if rule == DecimalPointRule::LeastIncrement && !word.number.has_point() {
        value /= if inch { 10_000.0 } else { 1_000.0 };
    }
    if inch { value * MM_PER_INCH } else { value }
}

/// Whether a feed or lead per revolution counts in increments of the control, whose size is not known: without a decimal point where such
/// numbers count increments.
#[inline]
pub(super) fn counts_increments(rule: DecimalPointRule, word: &Word) -> bool {
    let number = word.number;
    rule == DecimalPointRule::LeastIncrement && !number.has_point() && !number.is_computed() && number.value() != 0.0
}

/// A block in execution.
pub(super) struct Execution<'a> {
    pub(super) settings: &'a LanguageSettings,
    pub(super) table: &'a CodeTable,
    pub(super) tools: &'a [ToolOffset],
    /// Highest speed of the machine's spindle, rev/min.
    pub(super) spindle_limit_rev_per_min: f64,
    pub(super) state: &'a mut InterpreterState,
    pub(super) block: &'a Block,
    pub(super) operations: &'a mut Vec<Operation>,
    pub(super) findings: &'a mut FindingLog,
    /// Letters whose words have been used.
    pub(super) used: u32,
    /// `G9`: this block ends in an exact stop.
    pub(super) exact_stop: bool,
    /// `G53` goes rapidly whatever motion is in force.
    pub(super) machine_rapid: bool,
    /// Corners behind operations, by the places of these.
    pub(super) corners: &'a mut Vec<(usize, Corner)>,
    /// The words with a comma have been used.
    pub(super) commas_used: bool,
    /// A code that another control reads as a cycle.
    pub(super) doubt: Option<Doubt>,
    /// M codes of a lathe's drilling cycle, for the place of each of its holes.
    pub(super) clamps: Vec<(SourceSpan, MachineCommand)>,
}

impl Execution<'_> {
    /// Carries the block out; returns the place of the code that ends the program, if there is one.
    #[inline]
    pub(super) fn run(&mut self) -> Option<SourceSpan> {
        if self.state.nurbs.is_some() {
            self.check_open_nurbs();
        }
        if self.state.plane_sequence.is_some() {
            self.check_plane_sequence();
        }
        self.labels();
        if self.block.has_codes_besides_motion() {
            let switches = self.block.has_only(Group::Function);
            return if switches { self.run_function() } else { self.run_codes() };
        }
        // Most blocks: of the steps that codes have, these can do something.
        self.feed();
        if self.block.letters & (letter_bit(b'S') | letter_bit(b'T')) != 0 {
            self.tool();
            self.spindle();
        }
        if self.state.compensation.on.is_some() {
            self.check_compensated_block();
        }
        if self.block.letters & letter_bit(b'H') != 0 {
            self.length_compensation();
        }
        self.motion();
        if self.block.has_comma_words() {
            self.check_comma_words();
        }
        self.unused_words();
        None
    }

    /// A block that switches a machining function, as many do, and has no other code.
    #[inline(never)]
    fn run_function(&mut self) -> Option<SourceSpan> {
        let function = self.function();
        self.feed();
        self.tool();
        self.spindle();
        self.check_compensated_block();
        self.switch(function);
        self.motion();
        self.check_comma_words();
        self.unused_words();
        None
    }

    /// A block with codes besides motion, in the order of its dialect.
    #[inline(never)]
    fn run_codes(&mut self) -> Option<SourceSpan> {
        let order = &self.table.dialect.order;
        let unit_first = order.unit_before_feed || self.block.code(Group::Function).is_some();
        if self.block.code(Group::Cycle).is_some() {
            self.state.machine.rigid_tapping = false;
        }
        if let Some(number) = self.block.last_m_code() {
            self.state.m_code = self.block.code(Group::Subprogram).is_none().then_some(number);
        }
        let mut machine = if self.block.machine_codes().is_empty() { Vec::new() } else { self.machine_codes() };
        self.doubt = self.doubt();
        if unit_first {
            self.units();
        }
        self.feed_unit();
        self.tool_control();
        let function = self.function();
        self.feed();
        self.machine_step(&mut machine, MachineStep::Signals);
        self.tool();
        self.spindle();
        self.machine_step(&mut machine, MachineStep::Spindle);
        if !order.stops_after_motion {
            self.spindle_stop();
        }
        self.coolant(!order.stops_after_motion);
        if !unit_first {
            self.units();
        }
        if !machine.is_empty() && self.is_lathe_cycle_block() {
            self.keep_clamps(&mut machine);
        }
        self.machine_step(&mut machine, MachineStep::Before);
        self.dwell();
        self.check_compensated_block();
        self.modes();
        self.compensation();
        self.length_compensation();
        self.tilted_plane();
        self.switch(function);
        self.drilling_modes();
        self.coordinates();
        self.motion();
        if !self.clamps.is_empty() {
            // No hole has taken them.
            let clamps = std::mem::take(&mut self.clamps);
            self.clamp(&clamps);
        }
        if order.stops_after_motion {
            self.spindle_stop();
            self.coolant(true);
        }
        self.machine_step(&mut machine, MachineStep::After);
        if let Some((meaning, _)) = self.code(Group::Subprogram) {
            self.used |= match meaning {
                Meaning::Return => letter_bit(b'P'),
                _ => letter_bit(b'P') | letter_bit(b'L') | letter_bit(b'Q'),
            };
        }
        if self.block.has_comma_words() {
            self.check_comma_words();
        }
        self.unused_words();
        self.stop()
    }

    pub(super) fn emit(&mut self, span: SourceSpan, kind: OperationKind) {
        // Where a plane was refused nobody knows where its moves go: they are not judged.
        let is_motion = matches!(kind, OperationKind::Move(_) | OperationKind::Guided(_) | OperationKind::Thread(_));
        if is_motion && self.state.is_plane_refused() {
            return;
        }
        if self.state.tool_control.turned_length != 0 {
            self.check_turned_length(span, &kind);
        }
        self.operations.push(Operation { span, kind });
    }

    /// The word with this letter, marked as used, unless a step before has used it.
    pub(super) fn take(&mut self, letter: u8) -> Option<Word> {
        if self.used & letter_bit(letter) != 0 {
            return None;
        }
        let word = *self.block.word(letter)?;
        self.used |= letter_bit(letter);
        Some(word)
    }

    /// The code of a group with its place.
    pub(super) fn code(&self, group: Group) -> Option<(Meaning, SourceSpan)> {
        let code: &CodeWord = self.block.code(group)?;
        Some((self.table.code(code.place).meaning, self.block.code_span(code)))
    }

    /// A length (mm) or angle (degrees) of a word: decimal-point rule, then units.
    #[inline]
    pub(super) fn scaled(&self, word: &Word, is_length: bool) -> f64 {
        scaled_length(self.settings.decimal_point, is_length && self.state.inch, word)
    }

    /// An X length of a word, mm on the radius: half of it where X words are diameters.
    #[inline]
    pub(super) fn radius(&self, word: &Word) -> f64 {
        let value = self.scaled(word, true);
        if self.state.x_diameter { value * 0.5 } else { value }
    }

    #[inline]
    fn labels(&mut self) {
        let labels = letter_bit(b'N') | letter_bit(b'O');
        self.used |= labels;
        if self.block.letters & labels != 0 {
            self.numbers();
        }
        if self.block.letters & !labels != 0 || self.block.has_codes() {
            self.state.phase = Phase::Blocks;
        }
    }

    /// Keeps the numbers of the block and of the program that it begins.
    #[inline]
    fn numbers(&mut self) {
        let program = self.block.word(b'O').map(|word| word.number.value() as u32);
        self.state.sequence_number = self.block.sequence_number().or(self.state.sequence_number);
        self.state.program_number = self.block.named_program.unwrap_or(program.or(self.state.program_number));
    }

    fn units(&mut self) {
        let Some((Meaning::Units { inch }, span)) = self.code(Group::Units) else {
            return;
        };
        if inch != self.state.inch && self.block.word(b'F').is_some() && self.block.code(Group::Function).is_none() {
            self.unit_with_feed(span);
        }
        if inch != self.state.inch && self.table.dialect.is_linuxcnc {
            self.note_unit_under_offset(span);
        }
        self.state.inch = inch;
    }

    /// A feed in the block that changes the unit: dialects differ in the unit that it is read in.
    #[cold]
    fn unit_with_feed(&mut self, span: SourceSpan) {
        let (new, old) = if self.state.inch { ("mm", "inch") } else { ("inch", "mm") };
        let (here, elsewhere, others) = match self.table.dialect.order.unit_before_feed {
            true => (new, old, "LinuxCNC"),
            false => (old, new, "other controls"),
        };
        self.findings.push_with(code::UNIT_WITH_FEED, |code| {
            let message =
                format!("the feed in the block that changes the unit is read in {here}, by {others} in {elsewhere}");
            Finding::new(code, span, message).suggest("change the unit in a block of its own before it")
        });
    }

    fn feed_unit(&mut self) {
        let stated = match self.code(Group::FeedUnit) {
            Some((Meaning::Feed(unit), _)) => Some(unit),
            _ => None,
        };
        if let Some(unit) = self.feed_or_return().or(stated)
            && (unit != self.state.feed_unit || self.table.dialect.order.feed_mode_clears_feed)
        {
            self.state.feed_unit = unit;
            self.state.feed = 0.0;
            self.state.reported.feed = false;
        }
    }

    #[inline]
    fn feed(&mut self) {
        if self.block.letters & letter_bit(b'F') != 0 && self.is_thread_block() {
            return;
        }
        let Some(word) = self.take(b'F') else {
            return;
        };
        self.state.unread &= !letter_bit(b'F');
        // One modal word: a feed takes the place of a thread's lead.
        self.state.thread.forget_lead();
        self.state.reported.lead = false;
        let value = word.number.value();
        if self.state.feed_unit == FeedUnit::PerRevolution && counts_increments(self.settings.decimal_point, &word) {
            self.state.reported.feed = true;
            return self.report_increments(&word);
        }
        if value == 0.0 && self.table.dialect.is_linuxcnc {
            // No feed: what needs one says so.
            (self.state.feed, self.state.feed_as_written) = (0.0, 0.0);
            self.state.reported.feed = false;
        } else if value >= LEAST_RATE {
            let per_length = self.state.inch && self.state.feed_unit != FeedUnit::InverseTime;
            self.state.feed = if per_length { value * MM_PER_INCH } else { value };
            self.state.feed_as_written = value;
            self.state.reported.feed = false;
        } else {
            let span = self.block.word_span(&word);
            self.state.reported.feed = true;
            self.findings.push_with(code::FEED_NOT_POSITIVE, |code| {
                Finding::new(code, span, format!("the feed is {value}, but must be at least {LEAST_RATE}"))
                    .with_value("feed", value, "")
                    .with_value("least", LEAST_RATE, "")
            });
        }
    }

    /// A feed or lead per revolution without a decimal point on a machine whose numbers without one are increments.
    #[cold]
    pub(super) fn report_increments(&mut self, word: &Word) {
        let (span, value) = (self.block.word_span(word), word.number.value());
        self.findings.push_with(code::FEED_WITHOUT_POINT, |code| {
            let message = format!(
                "F{value} per revolution without a decimal point: in which increments it counts depends on the control"
            );
            Finding::new(code, span, message)
                .with_value("feed", value, "")
                .suggest("write it with a decimal point, such as F0.2 for 0.2 per revolution")
        });
    }

    fn tool(&mut self) {
        if let Some(word) = self.take(b'T')
            && let Some(tool) = self.whole(&word)
        {
            self.state.unread &= !letter_bit(b'T');
            if self.state.tool_word != tool {
                self.state.tool_word = tool;
                self.state.parameters.changed();
            }
            if self.table.dialect.tool_word_changes {
                // T0101 is tool 1 with offset 1; T1 and T01 are tool 1 without one, where no offset is known.
                let same = self.settings.coordinates.two_digit_tools;
                let is_short = word.number.integer_digits() < 3;
                let (number, offset) = match (is_short, same) {
                    (false, _) => (tool / 100, tool % 100),
                    (true, true) => (tool, tool),
                    (true, false) => (tool, 0),
                };
                let span = self.block.word_span(&word);
                if is_short && !same && tool > 0 {
                    self.check_short_tool_word(tool, span);
                }
                self.check_compensated_tool(number, offset, span);
                self.state.tool = number;
                self.state.compensation.number = Some(offset);
                self.emit(span, OperationKind::Tool { number, offset });
                self.turning_offset(number, offset, span);
            } else {
                self.state.next_tool = Some(tool);
            }
        }
        if let Some((Meaning::ToolChange, span)) = self.code(Group::ToolChange) {
            self.change_tool(span);
        }
    }

    /// The whole number of a word, or a finding.
    pub(super) fn whole(&mut self, word: &Word) -> Option<u32> {
        let value = word.number.value();
        let whole = value as u32;
        if f64::from(whole) == value {
            return Some(whole);
        }
        if word.number.is_computed()
            && let Some(whole) = whole_near(value, f64::from(u32::MAX))
        {
            return Some(whole);
        }
        let span = self.block.word_span(word);
        self.findings.push_with(code::NUMBER_NOT_WHOLE, |code| {
            Finding::new(code, span, format!("{value} is not a whole number from 0 on")).with_value("number", value, "")
        });
        None
    }

    /// `M7`, `M8`, and where `off` says so `M9`.
    fn coolant(&mut self, off: bool) {
        let Some((meaning, span)) = self.code(Group::Coolant) else {
            return;
        };
        if meaning == Meaning::CoolantOff && !off {
            return;
        }
        let mut coolant = self.state.coolant;
        match meaning {
            Meaning::Mist => coolant.mist = true,
            Meaning::Flood => coolant.flood = true,
            _ => coolant = crate::Coolant::default(),
        }
        if coolant != self.state.coolant {
            self.state.coolant = coolant;
            self.emit(span, OperationKind::Coolant(coolant));
        }
    }

    /// Stands still under the work offset in force.
    pub(super) fn dwell_for(&mut self, span: SourceSpan, time: DwellTime) {
        self.emit(span, OperationKind::Dwell { time, work_offset: self.machine_offset() });
    }

    /// Whether the `P` of a dwell, `G4` or that of a cycle, is in milliseconds. With a decimal point it is in seconds on Haas controls;
    /// FANUC takes whole milliseconds only.
    pub(super) fn is_dwell_in_ms(&self, word: &Word) -> bool {
        self.settings.dwell_p_unit == DwellUnit::Milliseconds && !word.number.has_point()
    }

    fn dwell(&mut self) {
        let Some((Meaning::Dwell, span)) = self.code(Group::NonModal) else {
            return;
        };
        let dialect = self.table.dialect;
        let u = if dialect.dwell_takes_u { self.take(b'U') } else { None };
        // In LinuxCNC X is a word of the motion in the same block.
        let x = if dialect.is_linuxcnc { None } else { self.take(b'X') };
        let candidates = [(self.take(b'P'), true), (x, false), (u, false)];
        let mut times = candidates.into_iter().filter_map(|(word, is_p)| Some((word?, is_p)));
        let first = times.next();
        if let (Some((word, _)), Some(_)) = (first, times.next()) {
            return self.word_conflict(&word, "a dwell takes one of P, X and U");
        }
        let per_revolution = self.settings.dwell_in_revolutions && self.state.feed_unit == FeedUnit::PerRevolution;
        if let Some((word, false)) = first
            && per_revolution
            && word.number.value() >= 0.0
        {
            return self.dwell_for(span, DwellTime::Revolutions(word.number.value()));
        }
        let seconds = first.map(|(word, is_p)| {
            let value = word.number.value();
            let thousandths = match is_p {
                true => self.is_dwell_in_ms(&word),
                // The least increment of a time is a millisecond.
                false => self.settings.decimal_point == DecimalPointRule::LeastIncrement && !word.number.has_point(),
            };
            if thousandths { value / 1_000.0 } else { value }
        });
        let is_linuxcnc = self.is_linuxcnc_dialect();
        match seconds {
            Some(seconds) if seconds >= 0.0 => self.dwell_for(span, DwellTime::Seconds(seconds)),
            Some(seconds) => self.findings.push_with(code::DWELL_TIME, |code| {
                Finding::new(code, span, format!("the dwell lasts {seconds} s, but must not be negative"))
                    .with_value("time", seconds, "s")
            }),
            None => self.findings.push_with(code::DWELL_TIME, |code| {
                let cure = if is_linuxcnc { "add P with the seconds" } else { "add P or X" };
                Finding::new(code, span, "the dwell has no time").suggest(cure)
            }),
        }
    }

    /// Plane, path control, work offset and distance mode.
    fn modes(&mut self) {
        if let Some((Meaning::Plane(plane), span)) = self.code(Group::Plane)
            && plane != self.state.plane
            && !self.is_plane_refused(span)
        {
            self.state.plane = plane;
            self.state.spline_exit = None;
            self.state.turning.plane_reported = false;
        }
        self.path_modes();
        self.work_system();
        if let Some((Meaning::Distance { absolute }, _)) = self.code(Group::Distance) {
            self.state.absolute = absolute;
        }
        if let Some((Meaning::ArcDistance { absolute }, _)) = self.code(Group::ArcDistance) {
            self.state.arc_absolute = absolute;
        }
        if let Some((Meaning::XWord(x_word), _)) = self.code(Group::Diameter) {
            self.state.x_diameter = x_word == XWord::Diameter;
        }
    }

    /// Whether another plane is refused, as polar coordinates or a rotation belong to one; it is then reported.
    fn is_plane_refused(&mut self, span: SourceSpan) -> bool {
        let coords = &self.state.coords;
        let has_plane =
            coords.polar.is_some() || coords.transform.as_ref().is_some_and(|transform| transform.rotation.is_some());
        has_plane && !self.is_linuxcnc_dialect() && self.is_transform_on(span, "another plane")
    }

    fn stop(&mut self) -> Option<SourceSpan> {
        let (meaning, span) = self.code(Group::Stop)?;
        match meaning {
            Meaning::Stop { optional } => {
                self.emit(span, OperationKind::Stop { optional });
                None
            }
            Meaning::End => Some(span),
            _ => None,
        }
    }

    pub(super) fn word_conflict(&mut self, word: &Word, message: &'static str) {
        let span = self.block.word_span(word);
        self.findings.push_with(code::WORD_CONFLICT, |code| Finding::new(code, span, message));
    }

    /// Reports every word that no step has used, unless the block is not understood as a whole.
    #[inline]
    fn unused_words(&mut self) {
        let mut unused = self.block.letters & !self.used;
        if unused == 0 || self.block.unclear {
            return;
        }
        if unused & letter_bit(b'D') != 0 && self.takes_offset_number() {
            unused &= !letter_bit(b'D');
        }
        unused &= !self.takes_wall(unused);
        while unused != 0 {
            let place = unused.trailing_zeros() as usize;
            unused &= unused - 1;
            let word = *self.block.slot(place);
            self.word_unused(&word, b'A' + place as u8);
        }
    }

    /// Reports a word that no code takes.
    #[cold]
    pub(super) fn word_unused(&mut self, word: &Word, letter: u8) {
        let span = self.block.word_span(word);
        let value = word.number.value();
        self.findings.push_with(code::WORD_UNUSED, |code| {
            let letter = char::from(letter);
            let message = format!("{letter}{value} has no meaning in this block: no code of it takes {letter}");
            Finding::new(code, span, message)
                .with_value("value", value, "")
                .suggest("add the code it belongs to, or remove it if it does nothing on the machine either")
        });
    }

    pub(super) const fn m_per_min(&self, surface_speed: f64) -> f64 {
        if self.state.inch { surface_speed * M_PER_FOOT } else { surface_speed }
    }
}
