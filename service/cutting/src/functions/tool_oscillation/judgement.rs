//! Judging oscillating cuts: what can be said about an element alone, and about a whole pass where tool, feed or spindle
//! speed are new.

use feedwave_motion::kinematics::ToolFrame;
use feedwave_motion::{Curve, Element, top_command};
use feedwave_program::{Axis, Finding, SourceSpan, SpindleDirection, SpindleSpeed};

use super::code;
use super::feed_direction::{Plunge, turning_per_mm};
use super::inclination::Slope;
use super::judgements::Judgements;
use super::limits::{AxisShares, GuidedLimits, LeftLimits, Shortage, TOP_OVERRIDE, TURNING_SHARE, machine_limits};
use super::state::ActiveOscillation;
use super::{
    ConditionChoice, LeadingEdge, NamedCondition, OscillationCondition, OscillationCut, OscillationDrives,
    OscillationInputs, OscillationJob, OscillationLimits, OscillationRequest, OscillationRun, OscillationSectionReport,
    RoleReport, RoleRotation, ToolGeometry, ToolOscillation, find_condition, known_names, ramp_mm, synchronise,
};
use crate::shared::cut::Cut;
use crate::shared::wording::{decimal, round_down};

/// Components of unit vectors that differ by more are other directions.
const TILTED: f64 = 1e-6;
/// Where a pass is judged.
#[derive(Clone, Copy, Debug)]
struct Place {
    line: u32,
    /// Whether the tool is guided.
    guided: bool,
}

impl ActiveOscillation {
    /// Judges the element. The report of a pass comes where `judgements` are kept and the pass is new.
    pub(crate) fn prepare(
        &mut self,
        element: &Element,
        cut: &Cut,
        inputs: &OscillationInputs<'_>,
        judgements: Option<&mut Judgements>,
        found: &mut Vec<Finding>,
    ) -> Option<OscillationSectionReport> {
        let rev_per_min = steady_rev_per_min(element, cut, inputs, found)?;
        let spindle_rev_per_min = rev_per_min.min(inputs.machine.max_spindle_rev_per_min);
        let feed_mm_per_s = top_command(element, cut.feed, &cut.spindle, inputs.machine);
        if !can_follow(element, feed_mm_per_s, spindle_rev_per_min, inputs.frame.as_ref(), found) {
            return None;
        }
        let (slope, incline_deg) = Slope::of(inputs.frame.as_ref(), element);
        let shares = match (&element.curve, &inputs.frame) {
            (Curve::FiveAxis(five_axis), Some(frame)) => {
                let shares = AxisShares::of(frame, element, five_axis, slope);
                if shares.is_none() {
                    let message = "the linear axes cannot move the tool in every direction here";
                    found.push(
                        Finding::new(code::OSC_FIVE_AXIS, element.source, message)
                            .suggest("switch the oscillation off for this block, or tilt the tool less"),
                    );
                    return None;
                }
                shares
            }
            _ => (!slope.is_level()).then(|| AxisShares::upright(element, slope)),
        };
        self.by_shares = shares.is_some();
        let clockwise = cut.spindle.direction == SpindleDirection::Clockwise;
        let feed_mm_per_min = feed_mm_per_s * 60.0;
        let signed = if clockwise { spindle_rev_per_min } else { -spindle_rev_per_min };
        let judged = self.judged.filter(|&(old_tool, feed, speed)| {
            // A slower feed is within everything that the faster one was judged by, where no table decides otherwise.
            let is_within = if self.has_tables { feed == feed_mm_per_min } else { feed >= feed_mm_per_min };
            old_tool == inputs.tool && is_within && speed == signed
        });
        if judged.is_none() {
            (self.left, self.guided_left, self.judged_slopes) = (None, None, 0);
        }
        let slope_bit = 1 << slope.step();
        if self.judged_slopes & slope_bit != 0 {
            self.leave_limits(shares, inputs, found);
            return None;
        }
        // Another inclination is judged at the feed that the section has.
        let (.., feed_mm_per_min, _) = *self.judged.insert(judged.unwrap_or((inputs.tool, feed_mm_per_min, signed)));
        self.judged_slopes |= slope_bit;
        let cutting = OscillationCut {
            feed_mm_per_min,
            spindle_rev_per_min,
            clockwise,
            depth_mm: 0.0,
            engagement_deg: [-90.0, 90.0],
            incline_deg,
        };
        let limits = shares.map_or_else(|| machine_limits(inputs.machine), |shares| shares.limits(inputs.machine));
        let guided = matches!(element.curve, Curve::FiveAxis(_));
        let place = Place { line: element.source.line, guided };
        let mut report = self.judge(place, cutting, limits, inputs, judgements, found);
        let has_left = self.leave_limits(shares, inputs, found);
        if let Some(report) = report.as_mut().filter(|_| !has_left) {
            // What was judged is reported all the same.
            report.report.feasible = false;
        }
        report
    }

    /// Settles what the oscillation leaves of the axes' limits, of a guided tool and on a path that climbs with these shares of the axes;
    /// `false` after a finding.
    fn leave_limits(
        &mut self,
        shares: Option<AxisShares>,
        inputs: &OscillationInputs<'_>,
        found: &mut Vec<Finding>,
    ) -> bool {
        let (Some(run), Some((_, feed_mm_per_min, signed))) = (&self.run, self.judged) else { return true };
        let cut = OscillationCut {
            feed_mm_per_min,
            spindle_rev_per_min: signed.abs(),
            clockwise: signed > 0.0,
            depth_mm: 0.0,
            engagement_deg: [-90.0, 90.0],
            incline_deg: 0.0,
        };
        let mut said = |shortage: Shortage, fits: &dyn Fn(&OscillationRun) -> bool| {
            let feed_per_period_mm = cut.feed_per_rev_mm() / f64::from(run.oscillation.periods_per_rev);
            found.push(shortage.finding(self.on_span, run, feed_per_period_mm, fits));
            false
        };
        match shares {
            None if self.left.is_some() => true,
            None => match LeftLimits::of(inputs.machine, run, &cut) {
                Ok(left) => {
                    self.left = Some(left);
                    true
                }
                Err(shortage) => said(shortage, &|run| LeftLimits::of(inputs.machine, run, &cut).is_ok()),
            },
            Some(shares) if self.guided_left.as_ref().is_some_and(|left| left.are_of(&shares)) => true,
            Some(shares) => match GuidedLimits::of(inputs.machine, run, &cut, shares) {
                Ok(left) => {
                    self.guided_left = Some(left);
                    true
                }
                Err(shortage) => said(shortage, &|run| GuidedLimits::of(inputs.machine, run, &cut, shares).is_ok()),
            },
        }
    }

    fn judge(
        &mut self,
        Place { line, guided }: Place,
        mut cut: OscillationCut,
        limits: OscillationLimits,
        inputs: &OscillationInputs<'_>,
        judgements: Option<&mut Judgements>,
        found: &mut Vec<Finding>,
    ) -> Option<OscillationSectionReport> {
        let (span, tool_number) = (self.on_span, inputs.tool);
        let named = self.choose(inputs, found)?;
        self.has_tables = !named.tables.is_empty();
        let tool = self.geometry(inputs, found)?;
        let condition = self.condition(named, &cut);
        // Without a depth the deepest pass that the edges can cut.
        let deepest_mm = (tool.axial_edge_height_mm - 2.0 * condition.axial.amplitude_mm).max(0.0);
        cut.depth_mm = self.depth_mm.unwrap_or(deepest_mm);
        cut.engagement_deg = condition.engagement.azimuths_deg(tool.radius_mm, cut.clockwise);
        let max_feed_override = inputs.max_feed_override;
        let (leading_edge, roles) = self.roles(&condition.leading_edge, tool, inputs.request);
        let job = OscillationJob {
            tool,
            condition: &condition,
            leading_edge,
            cut,
            limits,
            max_feed_override,
            drives: Some(OscillationDrives { model: inputs.following, guided }),
            floor: None,
            span,
        };
        // While streaming the program has been judged before.
        let mut ignored = Vec::new();
        let (report, said) = match judgements {
            Some(judgements) => {
                let report = judgements.judge(tool_number, job, inputs.floor, found);
                report_roles(&roles, leading_edge, span, found);
                (report, &mut ignored)
            }
            None => (None, &mut *found),
        };
        let oscillation = synchronise(&job, said)?;
        self.run = Some(Box::new(run(oscillation, &condition, &cut)));
        report.map(|report| OscillationSectionReport {
            on_line: self.on_span.line,
            line,
            tool: tool_number,
            condition: named.name.clone(),
            roles,
            cut,
            report,
        })
    }

    /// The condition at a feed and a spindle speed, with the program's amplitudes.
    fn condition(&self, named: &NamedCondition, cut: &OscillationCut) -> OscillationCondition {
        let mut condition = named.at(cut.feed_mm_per_min, cut.spindle_rev_per_min);
        if let Some(amplitude_mm) = self.feed_amplitude_mm {
            condition.feed.amplitude_mm = amplitude_mm;
        }
        if let Some(amplitude_mm) = self.axial_amplitude_mm {
            condition.axial.amplitude_mm = amplitude_mm;
        }
        condition
    }

    /// The condition that the request or the program chooses.
    fn choose<'a>(&self, inputs: &OscillationInputs<'a>, found: &mut Vec<Finding>) -> Option<&'a NamedCondition> {
        let (conditions, tool) = (inputs.conditions, inputs.tool);
        let requested = inputs.request.condition.as_deref();
        let number = self.number.unwrap_or_default();
        let choice = requested.map_or(ConditionChoice::Number(number), ConditionChoice::Name);
        let Some(named) = find_condition(conditions, choice, tool) else {
            let which = requested.map_or_else(|| number.to_string(), |name| format!("{name:?}"));
            let message = format!("the machine has no oscillation condition {which} for tool {tool}");
            let cure = if conditions.is_empty() {
                "add the condition to the machine profile".to_owned()
            } else {
                known_names(conditions)
            };
            let finding = Finding::new(code::OSC_CONDITION_UNKNOWN, self.on_span, message);
            // A name is no number.
            let finding =
                if requested.is_none() { finding.with_value("condition", f64::from(number), "") } else { finding };
            found.push(finding.with_value("tool", f64::from(tool), "").suggest(cure));
            return None;
        };
        if let Some(number) = self.number
            && number != named.number
        {
            let message = format!(
                "the program chooses condition {number}, the job {:?}, which is {}: the job's is run",
                named.name, named.number
            );
            found.push(
                Finding::new(code::OSC_CONDITION_OVERRIDDEN, self.on_span, message)
                    .with_value("programmed", f64::from(number), "")
                    .with_value("condition", f64::from(named.number), "")
                    .suggest("leave P out of the program, or the condition out of the job"),
            );
        }
        Some(named)
    }

    /// The tool's cutting edges.
    fn geometry<'a>(&self, inputs: &OscillationInputs<'a>, found: &mut Vec<Finding>) -> Option<&'a ToolGeometry> {
        let number = inputs.tool;
        let known = inputs.tools.iter().find(|tool| tool.number == number);
        let geometry = known.and_then(|tool| tool.geometry.as_ref());
        if geometry.is_none() {
            let message = format!("nothing is known of the cutting edges of tool {number}");
            let finding = Finding::new(code::OSC_TOOL_UNKNOWN, self.on_span, message);
            let finding = finding.with_value("tool", f64::from(number), "");
            found.push(finding.suggest("give edges, radius, edge length and edge height in the tool library"));
        }
        geometry
    }

    /// Which edge leads, and why. A word of the program says which edge leads the first part.
    fn roles(&self, leading: &LeadingEdge, tool: &ToolGeometry, request: &OscillationRequest) -> (u32, RoleReport) {
        let parts_before = request.parts_before;
        let cutting_time_before_s = request.cutting_time_before_s + self.cutting_time_before_s;
        let first_edge = self.leading_edge.unwrap_or(leading.edge);
        let leading = LeadingEdge { edge: first_edge, ..*leading };
        let changes = leading.steps_after(parts_before, cutting_time_before_s);
        let edge = if (1..=tool.edge_count()).contains(&first_edge) {
            leading.edge_after(parts_before, cutting_time_before_s, tool.edge_count())
        } else {
            // Not an edge of the tool, which is found.
            first_edge
        };
        (edge, RoleReport { first_edge, rotation: leading.rotation, parts_before, cutting_time_before_s, changes })
    }
}

/// The constant spindle speed with which the tool may oscillate along an element, rev/min; nothing after a finding.
fn steady_rev_per_min(
    element: &Element,
    cut: &Cut,
    inputs: &OscillationInputs<'_>,
    found: &mut Vec<Finding>,
) -> Option<f64> {
    let frame = inputs.frame.as_ref();
    let span = element.source;
    let mut refuse = |code, message: &str, cure: &str| found.push(Finding::new(code, span, message).suggest(cure));
    let turns_axes = Axis::ALL.into_iter().any(|axis| axis.is_rotary() && element.moves(axis));
    let guided = match &element.curve {
        Curve::FiveAxis(five_axis) => Some(five_axis),
        _ => None,
    };
    if guided.is_none() && frame.is_some_and(|frame| is_tilted(frame, element)) {
        let message = "the tool oscillates along X, Y and Z here, but these are not its own directions, without tool centre point control";
        refuse(
            code::OSC_FIVE_AXIS,
            message,
            "switch tool centre point control on, or tilt the plane with G68.2 and G53.1",
        );
        return None;
    }
    if guided.map_or(turns_axes, |five_axis| five_axis.tip().length_mm() == 0.0) {
        refuse(code::OSC_ROTARY, "the tool oscillates while a rotary axis moves", "switch the oscillation off before");
        return None;
    }
    if inputs.vibrates {
        let message = "the tool oscillates while the vibration along the path is on";
        refuse(code::OSC_WITH_VIBRATION, message, "switch one of them off");
        return None;
    }
    let SpindleSpeed::Constant { rev_per_min } = cut.spindle.speed else {
        let message = "the tool oscillates in step with a constant spindle speed only";
        refuse(code::OSC_SURFACE_SPEED, message, "program a spindle speed with G97");
        return None;
    };
    if !cut.spindle.is_turning() {
        refuse(
            code::OSC_SPINDLE_STOPPED,
            "the oscillation follows the spindle, which is stopped",
            "start the spindle before",
        );
        return None;
    }
    Some(rev_per_min)
}

/// Whether there is a feed direction everywhere, and turns slowly enough for the oscillation to follow it, or a finding.
fn can_follow(
    element: &Element,
    feed_mm_per_s: f64,
    spindle_rev_per_min: f64,
    frame: Option<&ToolFrame>,
    found: &mut Vec<Finding>,
) -> bool {
    let most_rad_per_s = TURNING_SHARE * core::f64::consts::TAU * spindle_rev_per_min / 60.0;
    let curvature = match turning_per_mm(frame, element, most_rad_per_s / (TOP_OVERRIDE * feed_mm_per_s)) {
        Ok(curvature) => curvature,
        Err(Plunge(s)) => {
            let mut finding = Finding::new(
                code::OSC_PLUNGE,
                element.source,
                "the path goes along the tool axis: there is no feed direction to oscillate in",
            );
            for (axis, name) in [(Axis::X, "x"), (Axis::Y, "y"), (Axis::Z, "z")] {
                let mut place_mm = [0.0];
                element.fill_work_axis(axis, &[s], &mut place_mm);
                finding = finding.with_value(name, place_mm[0], "mm");
            }
            found.push(finding.suggest("switch the oscillation off for this block"));
            return false;
        }
    };
    let largest_mm_per_s = most_rad_per_s / curvature;
    if TOP_OVERRIDE * feed_mm_per_s > largest_mm_per_s {
        let feed = 60.0 / TOP_OVERRIDE * largest_mm_per_s;
        let message = format!(
            "the feed direction turns too fast for the oscillation to follow it, as on a radius of {} mm at {} mm/min",
            decimal(1.0 / curvature, 3),
            decimal(60.0 * feed_mm_per_s, 1)
        );
        let cure = format!("feed slower on this curve, {} mm/min at most", decimal(round_down(feed, 1), 1));
        let finding = Finding::new(code::OSC_TURNING, element.source, message)
            .ranked("", feed_mm_per_s / largest_mm_per_s)
            .with_value("curvature", curvature, "1/mm")
            .with_value("feed", feed_mm_per_s * 60.0, "mm/min")
            .suggest_value(cure, None, "feed", feed, "mm/min");
        found.push(match &element.curve {
            // The curve at a corner is one.
            Curve::Spline(_) => {
                finding.suggest("where a corner is rounded, raise P of G64, or pass it exactly with G61")
            }
            _ => finding,
        });
        return false;
    }
    true
}

/// Logs which edge leads where the roles change.
fn report_roles(roles: &RoleReport, leading_edge: u32, span: SourceSpan, found: &mut Vec<Finding>) {
    let (interval, unit, before, name) = match roles.rotation {
        RoleRotation::Fixed => return,
        RoleRotation::EveryParts(parts) => (f64::from(parts), "parts", roles.parts_before as f64, "parts_before"),
        RoleRotation::EverySeconds(seconds) => (seconds, "s", roles.cutting_time_before_s, "cutting_time_before"),
    };
    let number = |value: f64| decimal(value, 3);
    let message = format!(
        "edge {leading_edge} leads this part: the lead moves on every {} {unit}, and {} {unit} came before",
        number(interval),
        number(before)
    );
    found.push(
        Finding::new(code::OSC_ROLES_TURNED, span, message)
            .with_value("leading_edge", f64::from(leading_edge), "")
            .with_value("first_edge", f64::from(roles.first_edge), "")
            .with_value("changes", roles.changes as f64, "")
            .with_value(name, before, if unit == "s" { "s" } else { "" }),
    );
}

/// Whether the linear axes do not move along X, Y and Z of the tool where an element that is not guided starts: the tool or the
/// work is tilted, the spindle lies, or the axes are not square.
fn is_tilted(frame: &ToolFrame, element: &Element) -> bool {
    let at_rad =
        frame.rotary_axes().map(|axis| (element.start[axis.index()] + element.work_offset[axis.index()]).to_radians());
    let axes = frame.linear_axes();
    (0..3).any(|direction| {
        let mut own = [0.0; 3];
        own[direction] = 1.0;
        let Ok(moved) = frame.linear_mm(at_rad, own) else { return true };
        axes.iter().zip(moved).any(|(axis, moved_mm)| {
            let expected = f64::from(u8::from(axis.index() == direction));
            (moved_mm - expected).abs() > TILTED
        })
    })
}

/// What the generator gets.
fn run(oscillation: ToolOscillation, condition: &OscillationCondition, cut: &OscillationCut) -> OscillationRun {
    let feed_per_period_mm = cut.feed_per_rev_mm() / f64::from(oscillation.periods_per_rev);
    let amplitude_mm = oscillation.feed.amplitude_mm;
    OscillationRun {
        ramp_mm: ramp_mm(condition.ramp_periods, feed_per_period_mm, amplitude_mm, condition.may_overrun),
        oscillation,
        clockwise: cut.clockwise,
        frame: None,
    }
}
