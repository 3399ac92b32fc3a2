//! What a lathe's program shows of its G-code system where the profile names none. What the systems read alike is carried out; what
//! they read otherwise is refused until a code has shown which of them the program is written in, and so is a code that
//! speaks against the one before.

use super::doubt::SYSTEM_CURE;
use super::execute::Execution;
use crate::code;
use crate::dialect::{FeedUnit, Group, Meaning, letter_bit};
use crate::state::ShownBy;
use crate::{DialectName, Finding, GCodeSystem, SourceSpan};

/// Letters that count increments in system A, and move nothing in B and C.
const INCREMENTS: u32 = letter_bit(b'U') | letter_bit(b'V') | letter_bit(b'W') | letter_bit(b'H');

impl Execution<'_> {
    /// Whether the codes of the program have to say which system they are of. Haas lathes have A.
    #[inline]
    fn shows_its_system(&self) -> bool {
        self.settings.dialect == DialectName::Lathe && self.settings.g_code_system.is_none() && !self.settings.is_haas()
    }

    /// Whether it is not known whether the program is written in system A.
    pub(super) fn is_system_open(&self) -> bool {
        self.shows_its_system() && !self.state.is_system_a && !self.state.not_system_a
    }

    /// Whether the system is A, by the profile or by what the program has shown.
    pub(super) fn is_system_a(&self) -> bool {
        match self.settings.g_code_system {
            Some(system) => system == GCodeSystem::A,
            None => self.state.is_system_a || self.settings.is_haas(),
        }
    }

    /// Takes up the codes of the block besides motion that A alone has, or does not have.
    pub(super) fn show_system(&mut self) {
        if !self.shows_its_system() {
            // Of a Haas lathe nothing else follows from it than that its G90 and G94 are modes.
            let is_incremental = matches!(self.code(Group::Distance), Some((Meaning::Distance { absolute: false }, _)));
            self.state.not_system_a |= is_incremental;
            return;
        }
        if let Some((Meaning::Distance { absolute: false }, _)) = self.code(Group::Distance) {
            self.show_by_code(false, Group::Distance);
        }
        if self.code_number(Group::FeedUnit) == Some(950) {
            self.show_by_code(false, Group::FeedUnit);
        }
        if matches!(self.code_number(Group::NonModal), Some(500 | 503)) {
            self.show_by_code(true, Group::NonModal);
        }
    }

    /// `G32` of A, `G33` of B and C.
    pub(super) fn show_system_by_thread(&mut self) {
        if self.shows_its_system()
            && let Some(number @ (320 | 330)) = self.code_number(Group::Motion)
        {
            self.show_by_code(number == 320, Group::Motion);
        }
    }

    /// Takes up a code that A alone has, or does not have.
    pub(super) fn show_by_code(&mut self, of_a: bool, group: Group) {
        if let (Some((_, span)), Some(tenths)) = (self.code(group), self.code_number(group)) {
            self.show(of_a, ShownBy { letter: b'G', tenths, line: span.line }, span);
        }
    }

    /// Takes up the words of the mask `letters`, of which increments are of A alone.
    #[inline]
    pub(super) fn show_by_words(&mut self, letters: u32) {
        if letters & INCREMENTS != 0 && self.shows_its_system() && !self.state.is_system_a {
            self.show_by_increments(letters & INCREMENTS);
        }
    }

    #[cold]
    fn show_by_increments(&mut self, letters: u32) {
        let place = letters.trailing_zeros();
        let span = self.block.word_span(self.block.slot(place as usize));
        self.show(true, ShownBy { letter: b'A' + place as u8, tenths: 0, line: span.line }, span);
    }

    /// Takes up what shows the system to be A, or not to be.
    fn show(&mut self, of_a: bool, by: ShownBy, span: SourceSpan) {
        let is_against = if of_a { self.state.not_system_a } else { self.state.is_system_a };
        if is_against {
            return self.report_two_systems(of_a, by, self.state.system_shown_by, span);
        }
        if !of_a && let Some(feed) = self.state.feed_of_system_a.take() {
            self.report_two_systems(of_a, by, Some(feed), span);
        }
        let state = &mut *self.state;
        if !(state.is_system_a || state.not_system_a) {
            state.system_shown_by = Some(by);
        }
        if of_a {
            state.is_system_a = true;
            // Its cycles return to the level of the start.
            state.drilling.to_r = false;
        } else {
            state.not_system_a = true;
        }
    }

    /// Refuses a code or a word that is of another system than one before.
    #[cold]
    fn report_two_systems(&mut self, of_a: bool, by: ShownBy, before: Option<ShownBy>, span: SourceSpan) {
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let [here, there] = match of_a {
                true => ["A", "B and C"],
                false => ["B and C", "A"],
            };
            let message = format!("{by} is of G-code system {here}");
            let finding = match before {
                Some(before) => Finding::new(
                    code,
                    span,
                    format!("{message}, but the {before} of line {} was read as one of {there}", before.line),
                )
                .with_value("line", f64::from(before.line), ""),
                None => Finding::new(code, span, format!("{message}, but the program is written in {there}")),
            };
            finding.suggest("write both in one system").suggest(SYSTEM_CURE)
        });
    }

    /// `G98` and `G99` where no profile names the system: feed modes in A, return levels of cycles in B and C. While it is
    /// open they are taken as both: a cycle, or a code that is not of A, tells.
    pub(super) fn feed_or_return(&mut self) -> Option<FeedUnit> {
        let (Meaning::FeedOrReturn { to_r }, span) = self.code(Group::CycleReturn)? else { return None };
        if self.state.not_system_a && !self.is_system_a() {
            self.state.drilling.to_r = to_r;
            return None;
        }
        let unit = if to_r { FeedUnit::PerRevolution } else { FeedUnit::PerMinute };
        if self.is_system_open() {
            self.state.drilling.to_r = to_r;
            let by = ShownBy { letter: b'G', tenths: if to_r { 990 } else { 980 }, line: span.line };
            if unit != self.state.feed_unit {
                self.state.feed_of_system_a.get_or_insert(by);
            }
        }
        if self.block.code(Group::FeedUnit).is_some() {
            self.report_feed_beside_return(span);
        }
        Some(unit)
    }

    /// `G93` or `G94` beside `G98` or `G99`: two feed modes in A, a feed mode and a return level in B and C.
    #[cold]
    fn report_feed_beside_return(&mut self, span: SourceSpan) {
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message =
                "the block has two feed modes in G-code system A, and one with the return level of cycles in B and C";
            Finding::new(code, span, message).suggest(SYSTEM_CURE)
        });
    }

    /// Refuses a drilling cycle whose levels the systems read differently, while the system is open; whether it is so.
    /// `start` is the level of its start.
    pub(super) fn is_cycle_of_open_system(&mut self, start: f64) -> bool {
        if !self.is_system_open() || !self.has_lathe_cycles() {
            return false;
        }
        let has_r = self.block.word(b'R').is_some();
        let is_settled = self.settings.drilling.lathe_r_is_level || has_r && start == 0.0;
        let is_r_read_twice = !is_settled && (has_r || self.state.drilling.r_level.is_none());
        if !is_r_read_twice && !self.state.drilling.to_r {
            return false;
        }
        let span = self.cycle_span();
        let name = self.cycle_name();
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message = if is_r_read_twice {
                format!("the R level of {name} is a distance from its start in G-code system A, and a level in B and C")
            } else {
                format!("behind G99, {name} returns to its start in G-code system A, and to its R level in B and C")
            };
            Finding::new(code, span, message).suggest(SYSTEM_CURE)
        });
        true
    }
}
