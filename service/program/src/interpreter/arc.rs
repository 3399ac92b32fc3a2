//! The circle of a `G2` or `G3` block, from its centre or its radius.

use super::coordinates::HAAS_STYLE;
use super::execute::{Execution, MM_PER_INCH};
use crate::block::Word;
use crate::code;
use crate::dialect::{FeedUnit, letter_bit};
use crate::state::ToolMode;
use crate::{ArcGeometry, Axis, DecimalPointRule, Finding, FindingCode, Position, SourceSpan};

/// A chord below this, mm, is no chord: far below any program's resolution, far above rounding.
const SHORTEST_CHORD_MM: f64 = 1e-7;

/// What both radii of an arc differ by at most when start, end and centre are rounded to 0.0001 inch, mm: four coordinates by
/// 0.00005 inch each, and the end by as much again.
const INCH_ROUNDING_MM: f64 = 0.000_3 * MM_PER_INCH;

/// LinuxCNC: how much a radius may be too short for its chord, mm (0.00005 inch).
const LINUXCNC_SHORT_RADIUS_MM: f64 = 0.001_27;

/// LinuxCNC: an arc with a smaller radius is none, mm.
const LINUXCNC_LEAST_RADIUS_MM: f64 = 0.001_27;

/// LinuxCNC: what start and end radius may differ by in any case, 2·√2·0.01 mm.
const LINUXCNC_SPIRAL_MM: f64 = 0.02 * core::f64::consts::SQRT_2;

/// LinuxCNC: and beyond, as a share of the larger radius.
const LINUXCNC_SPIRAL_SHARE: f64 = 0.001;

/// LinuxCNC: and never more than this, mm.
const LINUXCNC_LARGEST_SPIRAL_MM: f64 = 100.0 * LINUXCNC_SPIRAL_MM;

/// Most turns of an arc; a program that asks for more has lost a decimal point.
const MOST_TURNS: u32 = 10_000;

/// Start, end and sense of an arc in its plane, mm.
struct Chord {
    start: [f64; 2],
    end: [f64; 2],
    length: f64,
    clockwise: bool,
}

impl Execution<'_> {
    /// The circle from the present position to `end`; `None` after a finding.
    pub(super) fn arc(&mut self, clockwise: bool, end: &Position) -> Option<ArcGeometry> {
        self.check_inverse_time()?;
        let plane = self.state.plane;
        let (first, second) = plane.axes();
        let position = &self.state.position;
        let start = [position[first.index()], position[second.index()]];
        let end = [end[first.index()], end[second.index()]];
        let length = distance(start, end);
        let chord = Chord { start, end, length, clockwise };

        let radius = self.take(b'R');
        let offsets = [self.take(centre_letter(first)), self.take(centre_letter(second))];
        let centre_word = offsets[0].or(offsets[1]);
        self.check_placed_arc(plane, centre_word.is_some())?;
        let center = match (radius, centre_word) {
            (Some(radius), None) => self.center_by_radius(&radius, &chord)?,
            (None, Some(word)) => {
                let [along_first, along_second] = offsets.map(|word| word.map_or(0.0, |word| self.scaled(&word, true)));
                let from = if self.state.arc_absolute { self.centre_origin(offsets, &word)? } else { start };
                let center = [from[0] + along_first, from[1] + along_second];
                self.check_radii(&word, center, &chord)?;
                center
            }
            (Some(radius), Some(_)) => {
                let span = self.block.word_span(&radius);
                self.arc_error(code::ARC_CENTRE_AMBIGUOUS, span, |mut finding| {
                    finding.message.push_str("the arc has both a radius and a centre");
                    finding.suggest("keep one of them")
                })?
            }
            (None, None) => {
                let letters = [centre_letter(first), centre_letter(second)].map(char::from);
                self.arc_error(code::ARC_CENTRE_MISSING, self.block.span(), |mut finding| {
                    finding.message = format!("the arc has neither {} and {} nor R", letters[0], letters[1]);
                    finding.suggest("add the centre or the radius")
                })?
            }
        };
        let turns = self.turns()?;
        let full_turns = f64::from(turns - 1) * core::f64::consts::TAU;
        let sweep_rad = sweep(&chord, center) + if clockwise { -full_turns } else { full_turns };
        Some(ArcGeometry { plane, center, clockwise, sweep_rad })
    }

    /// Whether `G93` says how long the arc takes; nothing after a finding. On Haas and LinuxCNC it does, as for lines; FANUC controls
    /// have F as speed over radius there.
    fn check_inverse_time(&mut self) -> Option<()> {
        let is_by_radius = !self.table.dialect.is_linuxcnc && !self.settings.is_haas();
        if self.state.feed_unit != FeedUnit::InverseTime || !is_by_radius {
            return Some(());
        }
        let span = self.block.word(b'F').map_or(self.block.span(), |word| self.block.word_span(word));
        self.arc_error(code::ARC_INVERSE_TIME, span, |mut finding| {
            finding.message.push_str(
                "F of an arc under G93 is its speed over its radius on FANUC controls, and one over its time on others",
            );
            finding
                .suggest("write the arc under G94 with its feed, and G93 with F again in the block behind it")
                .suggest(format!("set {HAAS_STYLE} if this is such a control, where it is one over the time"))
        })
    }

    /// Whether the coordinates keep circles of the plane, and polar coordinates the centre; nothing after a finding.
    fn check_placed_arc(&mut self, plane: crate::Plane, has_center: bool) -> Option<()> {
        let coords = &self.state.coords;
        if has_center && coords.polar.is_some() {
            let span = self.block.span();
            return self.arc_error(code::COORD_BLOCK, span, |mut finding| {
                finding.message.push_str("the centre of an arc in polar coordinates (G16)");
                finding.suggest("write its radius, R")
            });
        }
        if coords.transform.as_ref().is_none_or(|transform| transform.keeps_circles(plane)) {
            return Some(());
        }
        let span = self.block.span();
        self.arc_error(code::COORD_SHAPE, span, |mut finding| {
            finding
                .message
                .push_str("scaling and rotation would make something else than a circle of this plane of the arc");
            finding.suggest("scale both axes of the plane alike, and keep to the plane of the rotation")
        })
    }

    /// `G90.1`: centres are counted from the origin, and both of their words are needed.
    fn centre_origin(&mut self, words: [Option<Word>; 2], first: &Word) -> Option<[f64; 2]> {
        if words.iter().all(Option::is_some) {
            return Some([0.0; 2]);
        }
        let span = self.block.word_span(first);
        self.arc_error(code::ARC_CENTRE_MISSING, span, |mut finding| {
            finding.message.push_str("the absolute centre of the arc (G90.1) lacks one of its two words");
            finding.suggest("write both, or G91.1 for centres from the start")
        })
    }

    /// `P`: how often an arc of LinuxCNC passes its end, the last time included.
    fn turns(&mut self) -> Option<u32> {
        let word = if self.table.dialect.is_linuxcnc { self.take(b'P') } else { None };
        let Some(word) = word else { return Some(1) };
        let value = word.number.value();
        let turns = value as u32;
        if f64::from(turns) == value && (1..=MOST_TURNS).contains(&turns) {
            return Some(turns);
        }
        self.arc_error(code::ARC_TURNS, self.block.word_span(&word), |mut finding| {
            finding.message = format!("{value} turns: an arc has a whole number of turns, 1 to {MOST_TURNS}");
            finding.with_value("turns", value, "").suggest("write how often the arc passes its end, such as P2")
        })
    }

    /// Centre of the arc of this radius: positive for the arc of at most half a turn, negative for the other.
    fn center_by_radius(&mut self, word: &Word, chord: &Chord) -> Option<[f64; 2]> {
        let span = self.block.word_span(word);
        let radius = self.scaled(word, true);
        if chord.length < SHORTEST_CHORD_MM {
            let by_vectors = self.state.tool_control.mode == ToolMode::Vectors;
            return self.arc_error(code::ARC_FULL_BY_RADIUS, span, |finding| {
                let mut finding = finding.with_value("radius", radius, "mm");
                finding.message.push_str("the arc ends where it starts: a radius does not say where its centre is");
                // Under G43.5 a centre cannot be written.
                finding.suggest(if by_vectors {
                    "write a full circle as two arcs"
                } else {
                    "write a full circle with its centre (I, J, K)"
                })
            });
        }
        let half = chord.length * 0.5;
        let excess = radius.abs() - half;
        let tolerance = match self.table.dialect.is_linuxcnc {
            true => LINUXCNC_SHORT_RADIUS_MM,
            false => self.radius_tolerance_mm(),
        };
        if excess < -tolerance {
            let unit = if self.state.inch { MM_PER_INCH } else { 1.0 };
            // Rounded up to what the program's decimals can say.
            let least = (half / unit * 10_000.0).ceil() / 10_000.0;
            let least = if radius < 0.0 { -least } else { least };
            let counts_increments = self.settings.decimal_point == DecimalPointRule::LeastIncrement;
            return self.arc_error(code::ARC_RADIUS_TOO_SMALL, span, |finding| {
                let mut finding = finding
                    .with_value("radius", radius, "mm")
                    .with_value("chord", chord.length, "mm")
                    .with_value("min_radius", half, "mm");
                finding.message = format!(
                    "radius {} mm cannot span the {} mm from start to end: it takes at least {} mm",
                    shown(radius.abs()),
                    shown(chord.length),
                    shown(half)
                );
                let text = if counts_increments { format!("R{least:?}") } else { format!("R{least}") };
                finding.suggest_value(format!("use {text} or more"), Some(text), "radius", least * unit, "mm")
            });
        }
        // Height of the centre over the chord: r² = (L/2)² + h²; none if rounding left the radius a little short.
        let height = if excess > 0.0 { (excess * (radius.abs() + half)).sqrt() } else { 0.0 };
        // The centre of a counter-clockwise arc of at most half a turn lies left of its chord.
        let left = chord.clockwise == (radius < 0.0);
        let scale = if left { height } else { -height } / chord.length;
        let [along, across] = [chord.end[0] - chord.start[0], chord.end[1] - chord.start[1]];
        Some([
            (chord.start[0] + chord.end[0]) * 0.5 - across * scale,
            (chord.start[1] + chord.end[1]) * 0.5 + along * scale,
        ])
    }

    /// By how much radii may differ, mm: at least by what rounding to the least increment of an inch program makes of them.
    fn radius_tolerance_mm(&self) -> f64 {
        let tolerance_mm = self.settings.arc_radius_tolerance_mm;
        if self.state.inch { tolerance_mm.max(INCH_ROUNDING_MM) } else { tolerance_mm }
    }

    /// Whether start and end are equally far from the centre.
    fn check_radii(&mut self, word: &Word, center: [f64; 2], chord: &Chord) -> Option<()> {
        let span = self.block.word_span(word);
        let start_radius = distance(center, chord.start);
        let end_radius = distance(center, chord.end);
        let mut tolerance = self.radius_tolerance_mm();
        let mut least_radius = SHORTEST_CHORD_MM;
        if self.table.dialect.is_linuxcnc {
            let share = LINUXCNC_SPIRAL_SHARE * start_radius.max(end_radius);
            tolerance = tolerance.max(share.clamp(LINUXCNC_SPIRAL_MM, LINUXCNC_LARGEST_SPIRAL_MM));
            least_radius = LINUXCNC_LEAST_RADIUS_MM;
        }
        let place = if start_radius <= end_radius { "starts" } else { "ends" };
        if start_radius.min(end_radius) < least_radius {
            return self.arc_error(code::ARC_RADIUS_ZERO, span, |mut finding| {
                finding.message = format!("the arc {place} at its own centre");
                let finding = finding.with_value("start_radius", start_radius, "mm");
                finding.with_value("end_radius", end_radius, "mm").suggest("check the centre and the end point")
            });
        }
        let difference = (start_radius - end_radius).abs();
        if difference <= tolerance {
            return Some(());
        }
        let moved_by = self.state.moved_by;
        self.arc_error(code::ARC_RADIUS_MISMATCH, span, |finding| {
            let mut finding = finding
                .related_to("the arc starts where this block ends", moved_by)
                .with_value("start_radius", start_radius, "mm")
                .with_value("end_radius", end_radius, "mm")
                .with_value("difference", difference, "mm")
                .with_value("tolerance", tolerance, "mm");
            finding.message = format!(
                "the arc starts {} mm and ends {} mm from its centre: the difference of {} mm exceeds {} mm",
                shown(start_radius),
                shown(end_radius),
                shown(difference),
                shown(tolerance)
            );
            finding.suggest("check the end point, the centre and whether the centre is incremental")
        })
    }

    #[cold]
    fn arc_error<T>(
        &mut self,
        code: FindingCode,
        span: SourceSpan,
        fill: impl FnOnce(Finding) -> Finding,
    ) -> Option<T> {
        self.used |= letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K') | letter_bit(b'R');
        self.findings.push_with(code, |code| fill(Finding::new(code, span, "")));
        None
    }
}

/// `I`, `J` or `K`.
pub(super) const fn centre_letter(axis: Axis) -> u8 {
    match axis {
        Axis::X => b'I',
        Axis::Y => b'J',
        _ => b'K',
    }
}

fn distance(from: [f64; 2], to: [f64; 2]) -> f64 {
    let [along, across] = [to[0] - from[0], to[1] - from[1]];
    (along * along + across * across).sqrt()
}

/// Signed angle from start to end about the centre; a full turn where they coincide.
fn sweep(chord: &Chord, center: [f64; 2]) -> f64 {
    let full = core::f64::consts::TAU;
    if chord.length < SHORTEST_CHORD_MM {
        return if chord.clockwise { -full } else { full };
    }
    let from = [chord.start[0] - center[0], chord.start[1] - center[1]];
    let to = [chord.end[0] - center[0], chord.end[1] - center[1]];
    // One arctangent of cross and dot product stays accurate for small angles, where two would cancel.
    let angle = libm::atan2(from[0] * to[1] - from[1] * to[0], from[0] * to[0] + from[1] * to[1]);
    match chord.clockwise {
        true if angle >= 0.0 => angle - full,
        false if angle <= 0.0 => angle + full,
        _ => angle,
    }
}

/// A length in a message: nanometres at most, without trailing zeros.
fn shown(value_mm: f64) -> f64 {
    (value_mm * 1e6).round() / 1e6
}
