//! Turns of the rotary axes that are named though they are carried out: to another solution, and near a pole.

use feedwave_motion::kinematics::{FiveAxisMotion, FiveAxisPoint};
use feedwave_program::{Axis, Finding, FindingLog, SourceSpan};

use super::super::ahead::CutNote;
use super::super::code;
use super::{Guide, GuideState};

/// Blocks that pass a pole within this angle are examined, degrees.
const NEAR_POLE_DEG: f64 = 2.0;
/// Turn of the first rotary axis by which a rapid to another solution differs from an ordinary one, degrees.
const BRANCH_TURN_DEG: f64 = 90.0;
/// Turn of the first rotary axis within one block near a pole that is worth a finding, degrees.
const POLE_TURN_DEG: f64 = 10.0;

impl Guide {
    /// Names a rapid that goes to another solution because the one at hand would leave a range later.
    pub(super) fn report_turn(
        &self,
        cut: &CutNote,
        [before, end]: [&FiveAxisPoint; 2],
        span: SourceSpan,
        findings: &mut FindingLog,
    ) {
        let Some(other) = cut.other.filter(|other| other.line > span.line) else { return };
        let (_, [first, second]) = self.kinematics.letters();
        let degrees = |point: &FiveAxisPoint, axis: Axis| point.position[axis.index()];
        if (degrees(end, first) - degrees(before, first)).abs() < BRANCH_TURN_DEG {
            return;
        }
        let message = format!(
            "{} goes from {:.3} to {:.3} degrees and {} from {:.3} to {:.3} here: otherwise {} would leave its range in line {}",
            first.letter(),
            degrees(before, first),
            degrees(end, first),
            second.letter(),
            degrees(before, second),
            degrees(end, second),
            other.axis.letter(),
            other.line
        );
        findings.push(
            Finding::new(code::FIVE_AXIS_SOLUTION, span, message)
                .with_value("first_axis", degrees(end, first), "deg")
                .with_value("second_axis", degrees(end, second), "deg")
                .with_value("other_line", f64::from(other.line), "")
                .with_value("other_angle", other.value_deg, "deg")
                .with_value("other_range_min", other.range_deg[0], "deg")
                .with_value("other_range_max", other.range_deg[1], "deg")
                .suggest("retract before this block so far that the work may turn"),
        );
    }

    /// Names the cut in which the first rotary axis turns because the tool is parallel to it, or nearly so.
    pub(super) fn check_pole(
        &self,
        motion: &FiveAxisMotion,
        before: &FiveAxisPoint,
        by_angles: bool,
        span: SourceSpan,
        state: &mut GuideState,
        findings: &mut FindingLog,
    ) {
        let (_, [first, _]) = self.kinematics.letters();
        let distance_deg = motion.least_pole_distance_rad.to_degrees();
        let turn_deg = (motion.end.position[first.index()] - before.position[first.index()]).abs();
        let deviation_deg = motion.deviation_rad.to_degrees();
        let near = distance_deg < NEAR_POLE_DEG && (turn_deg > POLE_TURN_DEG || deviation_deg > 0.0);
        // A cut is named though the rapid before it was.
        let is_named = std::mem::replace(&mut state.near_pole, near && state.cutting);
        if near && !is_named {
            let letter = first.letter();
            let message = format!(
                "the tool is within {distance_deg:.4} degrees of the {letter} axis here, which turns by {turn_deg:.1} \
                 degrees in this block: its velocity and acceleration limit the feed"
            );
            let finding = Finding::new(code::FIVE_AXIS_SINGULAR, span, message)
                .with_value("pole_distance", distance_deg, "deg")
                .with_value("turn", turn_deg, "deg")
                .with_value("turn_at_rest", motion.turn_in_pole_rad.to_degrees(), "deg")
                .with_value("direction_deviation", deviation_deg, "deg");
            findings.push(if by_angles {
                finding.suggest("tilt the work, so that the tool keeps away from the axis")
            } else {
                finding.suggest("tilt the work, so that the tool keeps away from the axis").suggest(
                    "allow a pole tolerance in the machine profile, within which the direction may pass the pole",
                )
            });
        }
    }
}
