//! Bolt patterns of Haas mills: `G70` on a circle, `G71` on an arc, `G72` along a line. The cycle in force is carried out at each of
//! their holes; the tool is at the centre, of a line at its first hole, unless the block says where that is.

use super::super::execute::Execution;
use super::Hole;
use crate::code;
use crate::coordinates::direction;
use crate::state::{BoltPattern, Motion};
use crate::{DrillingStyle, Finding, Plane, Position, SourceSpan};

/// The words of a bolt pattern beside its place.
const WORDS: [u8; 4] = [b'I', b'J', b'K', b'L'];

/// The words of a bolt pattern.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bolts {
    pattern: BoltPattern,
    /// `I`: the radius, negative for clockwise; of a line the distance from hole to hole, mm.
    length_mm: f64,
    /// `J`: where the first hole is, or in which direction the others are, degrees.
    start_deg: f64,
    /// From hole to hole about the centre, degrees.
    step_deg: f64,
    /// `L`
    pub(super) count: u32,
}

/// Where the holes of a pattern are: first and second axis of the plane, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pattern {
    Circle { center: [f64; 2], radius_mm: f64, start_deg: f64, step_deg: f64 },
    Line { start: [f64; 2], step: [f64; 2] },
}

impl Pattern {
    /// Puts the plane's axes of `at` to the hole of this number, from 0.
    pub(super) fn place(&self, number: u32, plane: Plane, at: &mut Position) {
        let (first, second) = plane.axes();
        let number = f64::from(number);
        let [along, across] = match *self {
            Self::Circle { center, radius_mm, start_deg, step_deg } => {
                let [cosine, sine] = direction(start_deg + number * step_deg);
                [center[0] + radius_mm * cosine, center[1] + radius_mm * sine]
            }
            Self::Line { start, step } => [start[0] + number * step[0], start[1] + number * step[1]],
        };
        (at[first.index()], at[second.index()]) = (along, across);
    }
}

impl Execution<'_> {
    /// The words of a pattern, which are then used up; nothing after a finding.
    pub(super) fn bolts(&mut self, pattern: BoltPattern, span: SourceSpan) -> Option<Bolts> {
        if !self.is_bolt_control(pattern, span) {
            return None;
        }
        if self.state.coords.polar.is_some() {
            self.coord(
                code::COORD_BLOCK,
                span,
                "a bolt pattern in polar coordinates (G16)",
                "end them with G15 before it",
            );
            return None;
        }
        let [length, start, step, count] = WORDS.map(|letter| {
            // The K of other patterns is none of theirs.
            if pattern == BoltPattern::Arc || letter != b'K' { self.take(letter) } else { None }
        });
        let needs_step = pattern == BoltPattern::Arc;
        let (Some(length), Some(count_word), true) = (length, count, step.is_some() || !needs_step) else {
            let missing = match (length, count) {
                (None, _) => 'I',
                (_, None) => 'L',
                _ => 'K',
            };
            self.bolt_word(span, format!("{} has no {missing}", pattern.name()), words_of(pattern));
            return None;
        };
        let length_mm = self.scaled(&length, true);
        let count = self.whole(&count_word)?;
        if count == 0 || length_mm == 0.0 {
            let message = format!("{} with I {length_mm} mm and L {count} has no holes", pattern.name());
            self.bolt_word(span, message, words_of(pattern));
            return None;
        }
        let start_deg = start.map_or(0.0, |word| self.scaled(&word, false));
        let spacing_deg = step.map_or(360.0 / f64::from(count), |word| self.scaled(&word, false));
        let step_deg = if length_mm < 0.0 { -spacing_deg } else { spacing_deg };
        Some(Bolts { pattern, length_mm, start_deg, step_deg, count })
    }

    /// Gives a hole its places; the position of its first one is where the tool is or the block says.
    pub(super) fn place_bolts(&mut self, hole: &mut Hole, bolts: Bolts) {
        let plane = self.state.plane;
        let (first, second) = plane.axes();
        let from = [hole.at[first.index()], hole.at[second.index()]];
        let Bolts { pattern, length_mm, start_deg, step_deg, .. } = bolts;
        let pattern = match pattern {
            BoltPattern::Line => {
                let [cosine, sine] = direction(start_deg);
                Pattern::Line { start: from, step: [length_mm * cosine, length_mm * sine] }
            }
            BoltPattern::Circle | BoltPattern::Arc => {
                Pattern::Circle { center: from, radius_mm: length_mm.abs(), start_deg, step_deg }
            }
        };
        pattern.place(0, plane, &mut hole.at);
        hole.pattern = Some(pattern);
    }

    /// A pattern without a cycle to carry out at its holes.
    #[cold]
    pub(in super::super) fn bolts_without_cycle(&mut self, pattern: BoltPattern) {
        let span = self.block.span();
        let is_known = self.state.motion != Motion::Unclear && self.is_bolt_control(pattern, span);
        self.used = u32::MAX;
        if is_known {
            let message = format!("{} has no drilling cycle in force to carry out at its holes", pattern.name());
            let cure = match self.state.inch {
                true => {
                    "open one before it, with L0 where there is no hole at its own place, such as G81 Z-0.4 R0.1 F4. L0"
                }
                false => {
                    "open one before it, with L0 where there is no hole at its own place, such as G81 Z-10. R2. F100. L0"
                }
            };
            self.bolt_word(span, message, cure);
        }
    }

    /// Whether the control has bolt patterns; elsewhere the codes are something else, which is then reported.
    fn is_bolt_control(&mut self, pattern: BoltPattern, span: SourceSpan) -> bool {
        let (what, elsewhere) = match pattern {
            BoltPattern::Circle => ("holes on a circle", Some(("inches", "write G20 for inches"))),
            BoltPattern::Arc => ("holes on an arc", Some(("millimetres", "write G21 for millimetres"))),
            BoltPattern::Line => ("holes along a line", None),
        };
        self.is_haas_code(pattern.name(), what, elsewhere, span)
    }

    /// Whether the control is one whose codes are those of Haas; otherwise says what the code is there, and what elsewhere, with the
    /// cure for that.
    pub(in super::super) fn is_haas_code(
        &mut self,
        name: &'static str,
        what: &'static str,
        elsewhere: Option<(&'static str, &'static str)>,
        span: SourceSpan,
    ) -> bool {
        if self.settings.drilling.style == DrillingStyle::Haas {
            return true;
        }
        self.findings.push_with(code::CYCLE_SETTING, |code| {
            let mut message = format!("{name} is {what} on Haas mills");
            if let Some((units, _)) = elsewhere {
                message.push_str(&format!(", and {units} on others"));
            }
            let cure =
                "set language.drilling.style of the machine profile to DRILLING_STYLE_HAAS if this is such a control";
            let finding = Finding::new(code, span, message).suggest(cure);
            elsewhere.into_iter().fold(finding, |finding, (_, cure)| finding.suggest(cure))
        });
        false
    }

    #[cold]
    fn bolt_word(&mut self, span: SourceSpan, message: String, cure: &'static str) {
        self.findings.push_with(code::CYCLE_WORD, |code| Finding::new(code, span, message).suggest(cure));
    }
}

/// What the words of a pattern are.
const fn words_of(pattern: BoltPattern) -> &'static str {
    match pattern {
        BoltPattern::Circle => "write I with the radius, J with the angle of the first hole, L with how many there are",
        BoltPattern::Arc => {
            "write I with the radius, J with the angle of the first hole, K with the angle from hole to hole, L with how many there are"
        }
        BoltPattern::Line => {
            "write I with the distance from hole to hole, J with the angle of the line, L with how many there are"
        }
    }
}
