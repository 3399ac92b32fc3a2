//! Requests of path control: `G61` to `G64`, `G9`, and the contour control of FANUC and Haas.

use super::execute::Execution;
use crate::block::Word;
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::Motion;
use crate::{Finding, MAX_PATH_TOLERANCE_MM, PathControl, PathControlMode, SourceSpan};

/// The levels of contour control that `G187 P1` (rough), `P2` (medium) and `P3` (finish) stand for.
const SMOOTHNESS_LEVELS: [usize; 3] = [1, 5, 10];

/// `G5 P10000` switches contour control on.
const HIGH_PRECISION_ON: f64 = 10_000.0;

impl Execution<'_> {
    /// `G61` to `G64`, `G9`, `G8` and `G187`.
    pub(super) fn path_modes(&mut self) {
        match self.code(Group::NonModal) {
            Some((Meaning::ExactStop, _)) => self.exact_stop = true,
            Some((Meaning::LookAhead, span)) => self.look_ahead(span),
            Some((Meaning::Smoothness, span)) => self.smoothness(span),
            Some((Meaning::BlockLimit, _)) => drop(self.take(b'P')),
            _ => {}
        }
        if let Some(tenths) = self.code_number(Group::PathControl) {
            self.state.path_code = tenths as u16;
        }
        match self.code(Group::PathControl) {
            Some((Meaning::PathControl(mode), _)) => {
                self.state.path_control = self.settings.path_control(mode);
                if mode == PathControlMode::Continuous {
                    self.path_tolerances();
                }
            }
            Some((Meaning::CuttingMode, span)) => {
                // They end an exact stop, and ask for nothing else that is not the machine's.
                self.state.path_control = self.settings.path_control(self.settings.initial_path_control);
                self.findings.push_with(code::PATH_REQUEST_NOTED, |code| {
                    Finding::new(code, span, "the overrides at corners and while tapping are the machine's")
                });
            }
            _ => {}
        }
    }

    /// How the path runs through the end point of this block.
    pub(super) const fn path_control(&self) -> PathControl {
        if self.exact_stop { PathControl::ExactStop } else { self.state.path_control }
    }

    /// `P` and `Q` of `G64`, which without them has the default tolerance.
    fn path_tolerances(&mut self) {
        let default_mm = self.settings.default_path_tolerance_mm;
        let (tolerance_word, merge_word) = (self.take(b'P'), self.take(b'Q'));
        let Some(given_mm) = tolerance_word.map_or(Some(default_mm), |word| self.path_tolerance(&word, 'P')) else {
            return;
        };
        // In LinuxCNC no tolerance is none at all, as without P: the profile's is meant.
        let unlimited = self.table.dialect.is_linuxcnc && given_mm == 0.0;
        let tolerance_mm = if unlimited { default_mm } else { given_mm };
        // As in LinuxCNC, lines are merged within P where there is no Q; Q0 merges none.
        let Some(mut merge_tolerance_mm) =
            merge_word.map_or(Some(tolerance_mm), |word| self.path_tolerance(&word, 'Q'))
        else {
            return;
        };
        if let Some(word) = merge_word
            && merge_tolerance_mm > tolerance_mm
        {
            let span = self.block.word_span(&word);
            let replacement = tolerance_word.map(|word| format!("Q{}", word.number.value()));
            self.findings.push_with(code::PATH_TOLERANCE_LIMITED, |code| {
                let message = format!(
                    "Q, {merge_tolerance_mm} mm, is part of the tolerance P: lines are merged within its {tolerance_mm} mm"
                );
                Finding::new(code, span, message)
                    .with_value("merge_tolerance", merge_tolerance_mm, "mm")
                    .with_value("tolerance", tolerance_mm, "mm")
                    .suggest_value("use P at most", replacement, "merge_tolerance", tolerance_mm, "mm")
            });
            merge_tolerance_mm = tolerance_mm;
        }
        self.state.path_control = PathControl::Continuous { tolerance_mm, merge_tolerance_mm };
    }

    /// A tolerance of `G64` or `G187` in the word of this letter, mm; `None` after a finding.
    fn path_tolerance(&mut self, word: &Word, letter: char) -> Option<f64> {
        let tolerance_mm = self.scaled(word, true);
        if (0.0..=MAX_PATH_TOLERANCE_MM).contains(&tolerance_mm) {
            return Some(tolerance_mm);
        }
        let span = self.block.word_span(word);
        let usual = if self.state.inch { "0.0004" } else { "0.01" };
        self.findings.push_with(code::PATH_TOLERANCE, |code| {
            let message =
                format!("the tolerance is {tolerance_mm} mm, but must lie between 0 and {MAX_PATH_TOLERANCE_MM} mm");
            Finding::new(code, span, message)
                .with_value("tolerance", tolerance_mm, "mm")
                .with_value("max_tolerance", MAX_PATH_TOLERANCE_MM, "mm")
                .suggest(format!("write how far the path may leave the programmed one, such as {letter}{usual}"))
        });
        None
    }

    /// Whether a block of `G5` or `G5.1` without a curve switches contour control, as FANUC has it; motion stays as it was
    /// `before`.
    pub(super) fn is_contour_control(&mut self, axes: u32, before: Motion) -> bool {
        let word = |letter| self.block.letters & !self.used & letter_bit(letter) != 0;
        let curve = word(b'I') || word(b'J') || word(b'K') || axes != 0;
        let Some((meaning @ (Meaning::CubicSpline | Meaning::QuadraticSpline), span)) = self.code(Group::Motion) else {
            return false;
        };
        let is_either = meaning == Meaning::CubicSpline && word(b'P') == word(b'Q');
        if curve || is_either || self.table.dialect.is_linuxcnc {
            return false;
        }
        self.state.motion = before;
        if meaning == Meaning::CubicSpline {
            let p = self.take(b'P').map(|word| word.number.value());
            match p {
                Some(HIGH_PRECISION_ON) => self.contour_on(self.settings.default_path_tolerance_mm),
                Some(0.0) => self.contour_off(),
                _ => self.request_error(span, "G5 takes P10000 to switch contour control on and P0 to switch it off"),
            }
            return true;
        }
        let (q, level) = (self.take(b'Q').map(|word| word.number.value()), self.take(b'R'));
        match q {
            Some(1.0) => match level {
                None => self.contour_on(self.settings.default_path_tolerance_mm),
                Some(word) => self.contour_level(&word),
            },
            Some(0.0) => self.contour_off(),
            _ => {
                self.used |= letter_bit(b'P');
                self.request_error(span, "G5.1 takes Q1 to switch contour control on and Q0 to switch it off");
            }
        }
        true
    }

    /// Whether a block is `G5.1 Q2` or `Q3` with zeros for its axes, which on FANUC controls begins contour control with smoothing along
    /// these axes; motion stays as it was `before`.
    pub(super) fn is_smooth_interpolation(&mut self, axes: u32, before: Motion) -> bool {
        let Some((Meaning::QuadraticSpline, _)) = self.code(Group::Motion) else { return false };
        let value = |letter: u8| self.block.word(letter).map(|word| word.number.value());
        let is_asked = matches!(value(b'Q'), Some(2.0 | 3.0)) && value(b'P').is_none();
        let others = self.block.letters & (letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K')) != 0;
        let rest =
            (b'A'..=b'Z').filter(|letter| axes & letter_bit(*letter) != 0).all(|letter| value(letter) == Some(0.0));
        if self.table.dialect.is_linuxcnc || !is_asked || others || axes == 0 || !rest {
            return false;
        }
        self.used |= axes | letter_bit(b'Q');
        self.state.motion = before;
        match self.take(b'R') {
            None => self.contour_on(self.settings.default_path_tolerance_mm),
            Some(word) => self.contour_level(&word),
        }
        true
    }

    /// `R` of `G5.1 Q1`.
    fn contour_level(&mut self, word: &Word) {
        let value = word.number.value();
        let level = value as usize;
        if level as f64 == value && (1..=self.settings.contour_tolerances_mm.len()).contains(&level) {
            return self.contour_on(self.settings.contour_tolerances_mm[level - 1]);
        }
        self.request_error(self.block.word_span(word), "the level R of contour control must be 1 to 10");
    }

    /// `G8`: `P1` switches the look-ahead on, `P0` off.
    fn look_ahead(&mut self, span: SourceSpan) {
        match self.take(b'P').map(|word| word.number.value()) {
            Some(1.0) => self.contour_on(self.settings.default_path_tolerance_mm),
            Some(0.0) => self.contour_off(),
            _ => self.request_error(span, "G8 takes P1 to switch the look-ahead on and P0 to switch it off"),
        }
    }

    /// `G187`: a level `P`, a tolerance `E`, or neither for the machine's own.
    fn smoothness(&mut self, span: SourceSpan) {
        let (level, tolerance) = (self.take(b'P'), self.take(b'E'));
        if let Some(word) = tolerance {
            if let Some(tolerance_mm) = self.path_tolerance(&word, 'E') {
                self.contour_on(tolerance_mm);
            }
            return;
        }
        let Some(word) = level else { return self.contour_off() };
        let value = word.number.value();
        let place = (1..=SMOOTHNESS_LEVELS.len()).find(|&place| place as f64 == value);
        match place {
            Some(place) => self.contour_on(self.settings.contour_tolerances_mm[SMOOTHNESS_LEVELS[place - 1] - 1]),
            None => self.request_error(span, "G187 takes P1 for roughing, P2 for medium and P3 for finishing"),
        }
    }

    fn contour_on(&mut self, tolerance_mm: f64) {
        let before = self.state.path_control;
        self.state.before_contour.get_or_insert(before);
        self.state.path_control = PathControl::Continuous { tolerance_mm, merge_tolerance_mm: tolerance_mm };
    }

    const fn contour_off(&mut self) {
        if let Some(before) = self.state.before_contour.take() {
            self.state.path_control = before;
        }
    }

    #[cold]
    fn request_error(&mut self, span: SourceSpan, message: &'static str) {
        self.findings.push_with(code::PATH_REQUEST, |code| Finding::new(code, span, message));
    }
}
