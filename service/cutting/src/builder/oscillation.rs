//! Parts of the path on which a rotary tool oscillates: the words, the section's start and end, what is left of the axes'
//! limits, and the report.

use std::sync::Arc;

use feedwave_motion::{Curve, Element, Machine, Planner, TANGENT_TOLERANCE_RAD, top_command};
use feedwave_program::{
    AXIS_COUNT, Axis, Finding, FindingLog, FunctionCommand, Position, Severity, SourceSpan, SpindleDirection,
    SpindleSpeed,
};
use serde::{Deserialize, Serialize};

use super::{Builder, MAX_SECTION_REPORTS};
use crate::PipelineConfig;
use crate::cut::Cut;
use crate::interpolator::{Barrier, OscillationRun};
use crate::tool_oscillation::{
    DirectionLimits, OscillationCut, OscillationJob, OscillationLimits, OscillationSectionReport, find_condition,
    judge, ramp_mm, synchronise,
};
use crate::wording::decimal;

/// Most of the spindle's angular speed with which the feed direction may turn.
const TURNING_SHARE: f64 = 0.05;
/// What that adds to the velocity of the oscillation at most: the phase runs by this share faster, and the offset turns by the
/// same share of its peak velocity. Accelerations and jerks are covered by its powers.
const TURNING_FACTOR: f64 = 1.0 + 2.0 * TURNING_SHARE;
/// Least component of the feed direction in the work plane: beyond 84 degrees the tool plunges.
const LEAST_IN_PLANE: f64 = 0.1;
/// Least share of a limit that the oscillation has to leave to the feed.
const LEAST_SHARE: f64 = 0.02;
/// Largest feed override: what is blended over the path comes that much faster.
const TOP_OVERRIDE: f64 = 2.0;
/// Largest first, second and third derivative of the blend.
const BLEND_PEAKS: [f64; 3] = [1.875, 5.774, 60.0];

/// An oscillation that was switched on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ActiveOscillation {
    on_span: SourceSpan,
    number: u32,
    feed_amplitude_mm: Option<f64>,
    axial_amplitude_mm: Option<f64>,
    depth_mm: Option<f64>,
    leading_edge: Option<u32>,
    /// Whether it cannot run; that was reported.
    refused: bool,
    /// What it was judged at last: tool, feed (mm/min), spindle speed (rev/min, negative counter-clockwise).
    judged: Option<(u32, f64, f64)>,
    /// What the generator gets, and what the axes have left.
    run: Option<Box<OscillationRun>>,
    left: Option<LeftLimits>,
    /// The open section: its length so far, mm, and the direction at its end.
    open: Option<(f64, Position)>,
    short_reported: bool,
}

/// What the oscillation leaves of the limits of every machine axis, on straight and on curved elements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct LeftLimits {
    #[serde(with = "shared")]
    straight: Arc<Machine>,
    #[serde(with = "shared")]
    curved: Arc<Machine>,
}

/// A shared machine in a snapshot is the machine.
mod shared {
    use std::sync::Arc;

    use feedwave_motion::Machine;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(machine: &Arc<Machine>, serializer: S) -> Result<S::Ok, S::Error> {
        Machine::serialize(machine, serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Machine>, D::Error> {
        Machine::deserialize(deserializer).map(Arc::new)
    }
}

impl Builder {
    pub(super) fn switch_oscillation(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        self.close_oscillation(planner, findings);
        let active = self.state.oscillation.take();
        if !command.on {
            if active.is_none() {
                let message = "the oscillation is switched off but was not on";
                let finding = Finding::error("OSC-OFF-WITHOUT-ON", span, message);
                findings.push(finding.suggest("remove the block, or switch the oscillation on before it"));
            }
            return;
        }
        if let Some(active) = active {
            let line = active.on_span.line;
            let message = format!("the oscillation is on already, since line {line}");
            findings.push(
                Finding::error("OSC-NESTED", span, message)
                    .with_value("on_line", f64::from(line), "")
                    .suggest("switch it off before it is switched on with other values"),
            );
        }
        let mut refused = false;
        let mut whole = |letter: char, name: &'static str, needed: bool| {
            let word = command.word(letter);
            let value = word.map(|word| word.value).filter(|value| value.fract() == 0.0 && (0.0..=1e6).contains(value));
            if value.is_none() && (needed || word.is_some()) {
                let place = word.map_or(span, |word| word.span);
                let message = format!("the {name} of the oscillation ({letter} word) is missing or not a whole number");
                let finding = Finding::error("OSC-WORD", place, message);
                findings.push(finding.suggest(format!("write the {name}, such as {letter}1")));
                refused = true;
            }
            value.map(|value| value as u32)
        };
        let number = whole('P', "number of the condition", true).unwrap_or_default();
        let leading_edge = whole('L', "leading edge", false);
        let length = |letter| command.word(letter).map(|word| word.value);
        self.state.oscillation = Some(Box::new(ActiveOscillation {
            on_span: span,
            number,
            feed_amplitude_mm: length('A'),
            axial_amplitude_mm: length('Q'),
            depth_mm: length('D'),
            leading_edge,
            refused,
            judged: None,
            run: None,
            left: None,
            open: None,
            short_reported: false,
        }));
    }

    /// The end of the program.
    pub(super) fn end_oscillation(&mut self, findings: &mut FindingLog) {
        if let Some(active) = self.state.oscillation.take() {
            let message = "the program ends while the oscillation switched on here is still on";
            let finding = Finding::warning("OSC-UNCLOSED", active.on_span, message);
            findings.push(finding.suggest("switch the oscillation off before the end of the program"));
        }
    }

    pub(super) fn close_oscillation(&mut self, planner: &mut Planner<Barrier>, findings: &mut FindingLog) {
        let Some(active) = &mut self.state.oscillation else { return };
        let Some((length_mm, _)) = active.open.take() else { return };
        planner.push_barrier(Barrier::OscillationEnd);
        let Some(run) = &active.run else { return };
        let needed_mm = 2.0 * run.ramp_mm;
        if length_mm < needed_mm && !active.short_reported {
            active.short_reported = true;
            let message = format!(
                "a part of the path without corners is {} mm long, shorter than the {} mm over which the oscillation is \
                 blended in and out",
                decimal(length_mm, 4),
                decimal(needed_mm, 4)
            );
            findings.push(
                Finding::warning("OSC-SECTION-SHORT", active.on_span, message)
                    .with_value("length", length_mm, "mm")
                    .with_value("ramps", needed_mm, "mm")
                    .suggest("round corners with G64, or blend over fewer periods"),
            );
        }
    }

    /// Opens a section before a cutting element, or goes on with it; what the axes have left for the element.
    pub(super) fn oscillate(
        &mut self,
        element: &Element,
        cut: &Cut,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) -> Option<Arc<Machine>> {
        let turns_sharply =
            self.state.oscillation.as_ref().and_then(|active| active.open).is_some_and(|(_, before)| {
                let after = element.tangent(0.0);
                let linear = (0..AXIS_COUNT).filter(|&index| !Axis::ALL[index].is_rotary());
                let square: f64 =
                    linear.map(|index| (after[index] - before[index]) * (after[index] - before[index])).sum();
                square.sqrt() > TANGENT_TOLERANCE_RAD
            });
        if turns_sharply {
            // The offsets turn with the path: they have to be 0 where it turns at once.
            self.close_oscillation(planner, findings);
        }
        let tool = self.state.tool;
        let vibrates = self.state.vibration.is_some();
        let reports =
            self.analysis.as_mut().map(|analysis| (&mut analysis.oscillations, &mut analysis.oscillation_count));
        let active = self.state.oscillation.as_mut().filter(|active| !active.refused)?;
        let mut found = Vec::new();
        let report = active.prepare(element, cut, tool, vibrates, config, reports.is_some(), &mut found);
        active.refused = found.iter().any(|finding| finding.severity == Severity::Error);
        for finding in found {
            findings.push(finding);
        }
        if let (Some((kept, count)), Some(report)) = (reports, report) {
            *count += 1;
            if kept.len() < MAX_SECTION_REPORTS {
                kept.push(report);
            }
        }
        if active.refused {
            return None;
        }
        let (run, left) = (active.run.as_ref()?, active.left.as_ref()?);
        if active.open.is_none() {
            planner.push_barrier(Barrier::OscillationStart(run.clone()));
        }
        let length_mm = active.open.map_or(0.0, |(length_mm, _)| length_mm) + element.length;
        active.open = Some((length_mm, element.tangent(element.length)));
        Some(Arc::clone(if element.curve == Curve::Line { &left.straight } else { &left.curved }))
    }
}

impl ActiveOscillation {
    /// Judges the element: what can be said about it alone, and the whole pass where feed, speed or tool are new.
    #[allow(clippy::too_many_arguments, reason = "what an element is judged by has no other thing in common")]
    fn prepare(
        &mut self,
        element: &Element,
        cut: &Cut,
        tool: u32,
        vibrates: bool,
        config: &PipelineConfig,
        reports: bool,
        found: &mut Vec<Finding>,
    ) -> Option<OscillationSectionReport> {
        let span = element.source;
        let mut refuse =
            |code, message: &str, cure: &str| found.push(Finding::error(code, span, message).suggest(cure));
        let turns_axes = Axis::ALL.into_iter().any(|axis| axis.is_rotary() && element.moves(axis));
        if turns_axes || matches!(element.curve, Curve::FiveAxis(_)) {
            refuse("OSC-ROTARY", "the tool oscillates while a rotary axis moves", "switch the oscillation off before");
            return None;
        }
        if vibrates {
            let message = "the tool oscillates while the vibration along the path is on";
            refuse("OSC-WITH-VIBRATION", message, "switch one of them off");
            return None;
        }
        let SpindleSpeed::Constant { rev_per_min } = cut.spindle.speed else {
            let message = "the tool oscillates in step with a constant spindle speed only";
            refuse("OSC-SURFACE-SPEED", message, "program a spindle speed with G97");
            return None;
        };
        if !cut.spindle.is_turning() {
            refuse("OSC-SPINDLE-STOPPED", "the oscillation is driven by the spindle, which stands", "start it before");
            return None;
        }
        let spindle_rev_per_min = rev_per_min.min(config.profile.machine.max_spindle_rev_per_min);
        let in_plane = |s: f64| {
            let tangent = element.tangent(s);
            libm::hypot(tangent[Axis::X.index()], tangent[Axis::Y.index()])
        };
        let least = [0.0, 0.5, 1.0].map(|share| in_plane(share * element.length)).into_iter().fold(1.0, f64::min);
        if least < LEAST_IN_PLANE {
            let message = "the path goes along the tool axis: there is no feed direction to oscillate in";
            refuse("OSC-PLUNGE", message, "switch the oscillation off for this block");
            return None;
        }
        let feed_mm_per_s = top_command(element, cut.feed, &cut.spindle, &config.profile.machine);
        let curvature = element.curvature();
        let largest_mm_per_s = TURNING_SHARE * core::f64::consts::TAU * spindle_rev_per_min / 60.0 / curvature;
        if TOP_OVERRIDE * feed_mm_per_s > largest_mm_per_s {
            let feed = 60.0 / TOP_OVERRIDE * largest_mm_per_s;
            let message = "the feed direction turns too fast for the oscillation to follow it";
            found.push(
                Finding::error("OSC-TURNING", span, message)
                    .with_value("curvature", curvature, "1/mm")
                    .with_value("feed", feed_mm_per_s * 60.0, "mm/min")
                    .suggest_value("feed slower on this curve", None, "feed", feed, "mm/min"),
            );
            return None;
        }
        let clockwise = cut.spindle.direction == SpindleDirection::Clockwise;
        let feed_mm_per_min = feed_mm_per_s * 60.0;
        let signed = if clockwise { spindle_rev_per_min } else { -spindle_rev_per_min };
        // A slower feed is within everything that the faster one was judged by.
        if self
            .judged
            .is_some_and(|(old_tool, feed, speed)| old_tool == tool && feed >= feed_mm_per_min && speed == signed)
        {
            return None;
        }
        self.judged = Some((tool, feed_mm_per_min, signed));
        let cutting = OscillationCut {
            feed_mm_per_min,
            spindle_rev_per_min,
            clockwise,
            depth_mm: 0.0,
            engagement_deg: [-90.0, 90.0],
        };
        self.judge(span.line, tool, cutting, config, reports, found)
    }

    fn judge(
        &mut self,
        line: u32,
        tool_number: u32,
        mut cut: OscillationCut,
        config: &PipelineConfig,
        reports: bool,
        found: &mut Vec<Finding>,
    ) -> Option<OscillationSectionReport> {
        let span = self.on_span;
        let profile = &config.profile;
        let Some(named) = find_condition(&profile.tool_oscillation, self.number, tool_number) else {
            let known: Vec<String> =
                profile.tool_oscillation.iter().map(|named| format!("P{} {}", named.number, named.name)).collect();
            let message = format!("the machine has no oscillation condition {} for tool {tool_number}", self.number);
            let cure = if known.is_empty() {
                "add the condition to the machine profile".to_owned()
            } else {
                format!("it has {}", known.join(", "))
            };
            found.push(
                Finding::error("OSC-CONDITION-UNKNOWN", span, message)
                    .with_value("condition", f64::from(self.number), "")
                    .with_value("tool", f64::from(tool_number), "")
                    .suggest(cure),
            );
            return None;
        };
        let known = config.tools.iter().find(|tool| tool.number == tool_number);
        let Some(tool) = known.and_then(|tool| tool.geometry.as_ref()) else {
            let message = format!("nothing is known of the cutting edges of tool {tool_number}");
            let finding =
                Finding::error("OSC-TOOL-UNKNOWN", span, message).with_value("tool", f64::from(tool_number), "");
            found.push(finding.suggest("give edges, radius, edge length and edge height in the tool library"));
            return None;
        };
        let mut condition = named.at(cut.feed_mm_per_min, cut.spindle_rev_per_min);
        if let Some(amplitude_mm) = self.feed_amplitude_mm {
            condition.feed.amplitude_mm = amplitude_mm;
        }
        if let Some(amplitude_mm) = self.axial_amplitude_mm {
            condition.axial.amplitude_mm = amplitude_mm;
        }
        // Without a depth the deepest pass that the edges can cut.
        let deepest_mm = (tool.axial_edge_height_mm - 2.0 * condition.axial.amplitude_mm).max(0.0);
        cut.depth_mm = self.depth_mm.unwrap_or(deepest_mm);
        let job = OscillationJob {
            tool,
            condition: &condition,
            leading_edge: self.leading_edge.unwrap_or(condition.leading_edge.edge),
            cut,
            limits: limits(&profile.machine),
            floor: None,
            span,
        };
        let report = if reports {
            let (report, findings) = judge(&job);
            found.extend(findings);
            report
        } else {
            None
        };
        // While streaming the program has been judged before.
        let oscillation = synchronise(&job, &mut if reports { Vec::new() } else { std::mem::take(found) });
        let oscillation = oscillation?;
        let feed_per_period_mm = cut.feed_mm_per_min / cut.spindle_rev_per_min / f64::from(oscillation.periods_per_rev);
        let run = OscillationRun {
            ramp_mm: ramp_mm(
                condition.ramp_periods,
                feed_per_period_mm,
                oscillation.feed.amplitude_mm,
                condition.may_overrun,
            ),
            oscillation,
            clockwise: cut.clockwise,
        };
        let straight = left_limits(&profile.machine, &run, &cut, 1.0);
        let curved = left_limits(&profile.machine, &run, &cut, TURNING_FACTOR);
        match (straight, curved) {
            (Ok(straight), Ok(curved)) => {
                self.left = Some(LeftLimits { straight: Arc::new(straight), curved: Arc::new(curved) });
            }
            (Err(shortage), _) | (_, Err(shortage)) => {
                // The report has the peaks themselves; here they leave nothing for the feed and its blend.
                let message = format!(
                    "the oscillation takes {} of the {} axis' limit of {} {}: nothing is left for the feed",
                    decimal(shortage.taken, 1),
                    shortage.axis,
                    decimal(shortage.limit, 1),
                    shortage.unit
                );
                found.push(
                    Finding::error("OSC-AXIS-LIMIT", span, message)
                        .with_value("demanded", shortage.taken, shortage.unit)
                        .with_value("limit", shortage.limit, shortage.unit)
                        .suggest("use smaller amplitudes, a lower spindle speed, or blend over more periods"),
                );
                return None;
            }
        }
        self.run = Some(Box::new(run));
        report.map(|report| OscillationSectionReport {
            on_line: self.on_span.line,
            line,
            tool: tool_number,
            condition: named.name.clone(),
            cut,
            report,
        })
    }
}

/// The weaker axis of the work plane, and the tool axis.
fn limits(machine: &Machine) -> OscillationLimits {
    let none = DirectionLimits {
        velocity_mm_per_s: f64::INFINITY,
        acceleration_mm_per_s2: f64::INFINITY,
        jerk_mm_per_s3: f64::INFINITY,
    };
    let weakest = |axes: &[Axis]| {
        machine.axes.iter().filter(|axis| axes.contains(&axis.axis)).fold(none, |least, axis| DirectionLimits {
            velocity_mm_per_s: least.velocity_mm_per_s.min(axis.max_velocity_per_s),
            acceleration_mm_per_s2: least.acceleration_mm_per_s2.min(axis.max_acceleration_per_s2),
            jerk_mm_per_s3: least.jerk_mm_per_s3.min(axis.max_jerk_per_s3),
        })
    };
    OscillationLimits { plane: weakest(&[Axis::X, Axis::Y]), axial: weakest(&[Axis::Z]) }
}

/// A limit that leaves nothing for the feed.
struct Shortage {
    axis: String,
    taken: f64,
    limit: f64,
    unit: &'static str,
}

/// The machine with what the oscillation leaves of its limits. With E the blend, s the place on the path and D its length, the
/// offset E(s)·u(t) has
///
/// ```text
/// (E·u)'   = E·u' + E'·s'·u
/// (E·u)''  = E·u'' + 2·E'·s'·u' + (E''·s'² + E'·s'')·u
/// (E·u)''' = E·u''' + 3·E'·s'·u'' + 3·(E''·s'² + E'·s'')·u' + (E'''·s'³ + 3·E''·s'·s'' + E'·s''')·u
/// ```
///
/// The parts with s'' and s''' go with the feed's own acceleration and jerk: what is left for the feed is divided by 1 + E'·A.
fn left_limits(
    machine: &Machine,
    run: &OscillationRun,
    cut: &OscillationCut,
    turning: f64,
) -> Result<Machine, Shortage> {
    let period_s = 60.0 / cut.spindle_rev_per_min / f64::from(run.oscillation.periods_per_rev);
    let rate = TOP_OVERRIDE * cut.feed_mm_per_min / 60.0 / run.ramp_mm;
    let [first, second, third] = BLEND_PEAKS;
    // Amplitude and peaks in the plane: both directions at once at worst.
    let sum = |motions: &[&crate::tool_oscillation::DirectionMotion]| {
        motions.iter().fold([0.0; 4], |[a, v, c, j], motion| {
            let peaks = motion.peaks(period_s);
            [
                a + motion.amplitude_mm,
                v + turning * peaks.velocity_mm_per_s,
                c + turning * turning * peaks.acceleration_mm_per_s2,
                j + turning * turning * turning * peaks.jerk_mm_per_s3,
            ]
        })
    };
    let oscillation = &run.oscillation;
    let in_plane: Vec<_> = core::iter::once(&oscillation.feed).chain(&oscillation.cross).collect();
    let plane = sum(&in_plane);
    let axial = sum(&[&oscillation.axial]);
    let mut left = machine.clone();
    let mut path = [0.0f64; 2];
    // The plane first: its acceleration and jerk are what the axial blend has to follow.
    for is_axial in [false, true] {
        let [amplitude, velocity, acceleration, jerk] = if is_axial { axial } else { plane };
        let slope = first * amplitude / run.ramp_mm;
        for axis in &mut left.axes {
            if is_axial != (axis.axis == Axis::Z) || !matches!(axis.axis, Axis::X | Axis::Y | Axis::Z) {
                continue;
            }
            let take = |limit: f64, taken: f64, unit: &'static str| {
                let rest = (limit - taken) / if is_axial { 1.0 } else { 1.0 + slope };
                if rest >= LEAST_SHARE * limit {
                    Ok(rest)
                } else {
                    Err(Shortage { axis: axis.name.clone(), taken, limit, unit })
                }
            };
            let feed = |index: usize| if is_axial { slope * path[index] } else { 0.0 };
            let taken = velocity + first * rate * amplitude;
            let velocity_left = take(axis.max_velocity_per_s, taken, "mm/s")?;
            let taken = acceleration + 2.0 * first * rate * velocity + second * rate * rate * amplitude + feed(0);
            let acceleration_left = take(axis.max_acceleration_per_s2, taken, "mm/s²")?;
            let path_acceleration = if is_axial { path[0] } else { acceleration_left };
            let bend = second * rate * rate + first * path_acceleration / run.ramp_mm;
            let taken = jerk
                + 3.0 * first * rate * acceleration
                + 3.0 * bend * velocity
                + (third * rate * rate * rate + 3.0 * second * rate * path_acceleration / run.ramp_mm) * amplitude
                + feed(1);
            let jerk_left = take(axis.max_jerk_per_s3, taken, "mm/s³")?;
            (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) =
                (velocity_left, acceleration_left, jerk_left);
            if !is_axial {
                path = [path[0].max(acceleration_left), path[1].max(jerk_left)];
            }
        }
    }
    Ok(left)
}
