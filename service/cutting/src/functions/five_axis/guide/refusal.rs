//! Guided moves that cannot be made: findings with their numbers and cures.

use feedwave_motion::kinematics::{FiveAxisPoint, FiveAxisRefusal, KinematicsError, Toward};
use feedwave_program::{Axis, Finding, GuidedMove, SourceSpan, ToolGuide};

use super::super::ahead::CutNote;
use super::super::code;
use super::Guide;
use crate::shared::code::AXIS_MISSING;

/// Half a turn is as far in one direction as in the other, within this, degrees.
const HALF_TURN_TOLERANCE_DEG: f64 = 1e-9;

impl Guide {
    /// An absolute angle of an axis that rolls over half a turn away: both directions are equally short.
    pub(super) fn half_a_turn(&self, guided: &GuidedMove, from: &FiveAxisPoint, span: SourceSpan) -> Option<Finding> {
        if guided.guide != ToolGuide::Angles {
            return None;
        }
        let (step, rotary) = (&guided.step, self.kinematics.letters().1);
        let is_doubtful = |&turning: &usize| {
            let (axis, place) = (rotary[turning], rotary[turning].index());
            let turn_deg = step.end[place] + step.work_offset[place] - from.position[place];
            let is_placed = !guided.held.contains(axis) && !guided.turned.contains(axis);
            let from_half_deg = libm::remainder(turn_deg - 180.0, 360.0).abs();
            is_placed && self.kinematics.rolls_over(turning) && from_half_deg <= HALF_TURN_TOLERANCE_DEG
        };
        let axis = rotary[(0..2).find(is_doubtful)?];
        let (letter, place) = (axis.letter(), axis.index());
        let present_deg = from.position[place] - step.work_offset[place];
        let message =
            format!("{letter}{} is half a turn from {present_deg}: both directions are equally short", step.end[place]);
        let finding = Finding::new(code::FIVE_AXIS_OPPOSITE, span, message).with_value("present", present_deg, "deg");
        Some(finding.suggest("go there in two moves, or by an incremental word"))
    }

    /// Adds what helps where a rotary axis would leave its range, rad: with vectors another approach may, with angles
    /// only other angles do. Angles are those of the program, thus without the work offset.
    pub(super) fn cure_range(
        &self,
        mut finding: Finding,
        (axis, range_rad): (Axis, [f64; 2]),
        guided: &GuidedMove,
        toward: Toward,
    ) -> Finding {
        let programmed = |axis: Axis, angle_rad: f64| {
            // Without a negative zero.
            angle_rad.to_degrees() - guided.step.work_offset[axis.index()] + 0.0
        };
        match (&guided.guide, toward) {
            (ToolGuide::Angles, Toward::Angles(angles_deg)) => {
                let asked_rad = angles_deg.map(f64::to_radians);
                let direction = self.kinematics.rotary_directions().at(asked_rad);
                if let Ok(other_rad) = self.kinematics.nearest_rotary(direction, asked_rad) {
                    let [first, second] = self.kinematics.letters().1;
                    let message = format!(
                        "turn to {} {:.3} and {} {:.3} degrees, which give the same tool direction within the ranges",
                        first.letter(),
                        programmed(first, other_rad[0]),
                        second.letter(),
                        programmed(second, other_rad[1])
                    );
                    finding = finding.suggest(message);
                }
                let [low_deg, high_deg] = range_rad.map(|angle_rad| programmed(axis, angle_rad));
                let letter = axis.letter();
                let message = format!("keep {letter} from {low_deg:.3} to {high_deg:.3} degrees");
                let asked_deg = angles_deg
                    .into_iter()
                    .zip(self.kinematics.letters().1)
                    .find_map(|(angle_deg, it)| (it == axis).then_some(programmed(axis, angle_deg.to_radians())));
                let nearest_deg = asked_deg.map_or(low_deg, |asked_deg| asked_deg.max(low_deg).min(high_deg));
                finding = finding.suggest_value(message, None, "angle", nearest_deg, "deg");
            }
            (ToolGuide::Vector { .. }, _) => {
                finding = finding.suggest(
                    "divide the cut before this block: retract with G0, and approach it anew with G0 and its direction",
                );
            }
            _ => {}
        }
        finding.suggest("clamp the work in another position")
    }
}

pub(super) fn no_axis(axis: Axis, span: SourceSpan) -> Finding {
    let message = format!("{} is not among the five axes of the kinematics", axis.letter());
    Finding::new(AXIS_MISSING, span, message)
        .suggest("remove the word, or move the axis while tool centre point control is off")
        .everywhere(axis.letter().to_string())
}

/// Tool centre point control on a machine that has no kinematics.
pub(crate) fn no_kinematics(span: SourceSpan) -> Finding {
    let message = "tool centre point control and tilted planes need the kinematics of the machine, which its profile does not have";
    Finding::new(code::FIVE_AXIS_KINEMATICS, span, message)
        .suggest("describe the five axes in the machine profile")
        .everywhere("")
}

/// A rotary axis that leaves its range, and how its other solution fares.
fn out_of_range(
    reason: &KinematicsError,
    message: String,
    share: f64,
    span: SourceSpan,
    cut: Option<&CutNote>,
) -> Finding {
    let KinematicsError::OutOfRange { value_rad, range_rad: [low_rad, high_rad], .. } = *reason else {
        return Finding::new(code::FIVE_AXIS_RANGE, span, message);
    };
    let other = cut.and_then(|cut| cut.other);
    let message = match (cut, other) {
        (Some(cut), Some(other)) => format!(
            "{message}; the cut begins in line {}, and begun in the other solution or a turn off it gets no further: {} would \
             reach {:.3} degrees in line {}, beyond its range from {:.3} to {:.3}",
            cut.line,
            other.axis.letter(),
            other.value_deg,
            other.line,
            other.range_deg[0],
            other.range_deg[1]
        ),
        (Some(cut), None) => format!("{message}; the cut begins in line {}", cut.line),
        (None, _) => message,
    };
    let mut finding = Finding::new(code::FIVE_AXIS_RANGE, span, message)
        .with_value("share", share, "")
        .with_value("angle", value_rad.to_degrees(), "deg")
        .with_value("range_min", low_rad.to_degrees(), "deg")
        .with_value("range_max", high_rad.to_degrees(), "deg")
        .with_value("excess", reason.excess_rad().to_degrees(), "deg");
    if let Some(cut) = cut {
        finding = finding.with_value("cut_line", f64::from(cut.line), "");
    }
    if let Some(other) = other {
        finding = finding
            .with_value("other_line", f64::from(other.line), "")
            .with_value("other_angle", other.value_deg, "deg")
            .with_value("other_range_min", other.range_deg[0], "deg")
            .with_value("other_range_max", other.range_deg[1], "deg");
    }
    finding
}

/// The finding of a refusal; the cures of a range come from [`Guide::cure_range`].
pub(super) fn refused(refusal: &FiveAxisRefusal, span: SourceSpan, cut: Option<&CutNote>) -> Finding {
    let message = refusal.to_string();
    match *refusal {
        FiveAxisRefusal::Pose { share, reason } => {
            let finding = |code| Finding::new(code, span, message.clone()).with_value("share", share, "");
            match reason {
                KinematicsError::OutOfRange { .. } => out_of_range(&reason, message, share, span, cut),
                KinematicsError::Unreachable { missing_rad } => finding(code::FIVE_AXIS_UNREACHABLE)
                    .with_value("missing", missing_rad.to_degrees(), "deg")
                    .suggest("clamp the work in another position"),
                _ => finding(code::FIVE_AXIS_POSE).suggest("check the kinematics in the machine profile"),
            }
        }
        FiveAxisRefusal::Opposite(_) => Finding::new(code::FIVE_AXIS_OPPOSITE, span, message)
            .suggest("write a direction in between, which says over which side the tool turns"),
        FiveAxisRefusal::Start { difference, .. } => Finding::new(code::FIVE_AXIS_START, span, message)
            .with_value("difference", difference, "")
            .suggest("move to the start of the cut with G0 first"),
        FiveAxisRefusal::TooSharp { share } => Finding::new(code::FIVE_AXIS_TOO_SHARP, span, message)
            .with_value("share", share, "")
            .suggest("keep off the edge of what the rotary axes can reach"),
        FiveAxisRefusal::NotANumber => Finding::new(code::FIVE_AXIS_POSE, span, message)
            .suggest("check the numbers of the block and of the work offset"),
    }
}
