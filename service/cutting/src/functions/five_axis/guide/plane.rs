//! Tilted planes: their coordinates as work coordinates, and the tool axis turned onto their normal.
//!
//! Every move in a plane is one of the tool centre point with resting rotary axes. So lines and arcs are those of tool centre
//! point control, in work coordinates that move with the table, and the length is along the tool axis whatever machine it is.

use feedwave_motion::kinematics::vector::{Vec3, angle};
use feedwave_motion::kinematics::{
    BranchPreference, FiveAxisBlock, FiveAxisMotion, FiveAxisRefusal, InverseSolution, KinematicsError, ToolPose,
    Toward,
};
use feedwave_program::{
    Axis, Finding, FindingLog, GuidedMove, Move, MoveKind, Position, SourceSpan, TiltedPlane, ToolAxisSolution,
    ToolGuide,
};

use super::super::code;
use super::{Guide, GuideInputs, GuideState, refused};
use crate::shared::plane_frame::PlaneFrame;

/// A tool axis further from the normal of its plane than this is not meant to be on it, rad: programs write rotary axes with
/// three decimals of a degree.
const ALIGNED_RAD: f64 = 1e-4;

/// The end of a move in a plane, work coordinates, mm; axes that nothing has placed stay where `from_mm` has them.
pub(super) fn end_in_work(plane: &TiltedPlane, guided: &GuidedMove, from_mm: Vec3) -> Vec3 {
    let from_mm = plane.from_work(from_mm);
    plane.to_work([Axis::X, Axis::Y, Axis::Z].map(|axis| {
        let place = axis.index();
        if guided.held.contains(axis) { from_mm[place] } else { guided.step.end[place] }
    }))
}

/// A rotary axis that cannot turn as far as the normal asks for; and the code that is to be written without `P`, where the other
/// solution is within its range.
fn out_of_range(reason: &KinematicsError, other_solution: Option<&'static str>, span: SourceSpan) -> Finding {
    let mut finding = Finding::new(code::FIVE_AXIS_RANGE, span, format!("the tool axis onto the plane: {reason}"))
        .with_value("excess", reason.excess_rad().to_degrees(), "deg");
    if let Some(written) = other_solution {
        finding = finding.suggest(format!("take the other solution: {written} without P"));
    }
    finding.suggest("clamp the work in another position")
}

impl Guide {
    /// The values of the rotary axes that turn the tool axis onto the normal of the plane, rad; nothing after a finding.
    pub(super) fn onto_normal(
        &self,
        guided: &GuidedMove,
        solution: ToolAxisSolution,
        span: SourceSpan,
        state: &mut GuideState,
        findings: &mut FindingLog,
    ) -> Option<[f64; 2]> {
        let plane = guided.plane.as_ref()?;
        self.place_tool(guided, state)?;
        let tool = state.tool.as_ref()?;
        let (setup, pose) = (tool.setup, ToolPose { tip_mm: tool.point.tip_mm, direction: plane.axes[2] });
        let stand_rad = self.kinematics.from_position(&state.position).rotary_rad;
        let travel = |values: [f64; 2]| (values[0] - stand_rad[0]).abs().max((values[1] - stand_rad[1]).abs());
        let preference = match solution {
            ToolAxisSolution::Larger => BranchPreference::Larger,
            ToolAxisSolution::Smaller => BranchPreference::Smaller,
            ToolAxisSolution::Preferred => self.kinematics.preferred(),
        };
        let written = match guided.guide {
            ToolGuide::Align { about_tip: true, .. } => "G53.6",
            _ => "G53.1",
        };
        let mut other_solution = None;
        let chosen = self.kinematics.inverse_branches(&pose, &setup, stand_rad).and_then(|[larger, smaller]| {
            let values = |branch: Result<InverseSolution, _>| branch.map(|solution| solution.joints.rotary_rad);
            match (values(larger), values(smaller), solution, preference) {
                // What the program asks for is not replaced by anything else.
                (larger, smaller, ToolAxisSolution::Larger, _) => {
                    other_solution = smaller.is_ok().then_some(written);
                    larger
                }
                (larger, smaller, ToolAxisSolution::Smaller, _) => {
                    other_solution = larger.is_ok().then_some(written);
                    smaller
                }
                (Ok(larger), Ok(smaller), _, BranchPreference::Nearest) => {
                    Ok(if travel(smaller) < travel(larger) { smaller } else { larger })
                }
                (Ok(_), Ok(smaller), _, BranchPreference::Smaller) => Ok(smaller),
                (Ok(larger), _, _, _) => Ok(larger),
                (Err(_), Ok(smaller), _, _) => Ok(smaller),
                (Err(refusal), Err(_), _, _) => Err(refusal),
            }
        });
        match chosen {
            Ok(rotary_rad) => Some(rotary_rad),
            Err(reason) => {
                findings.push(match reason {
                    KinematicsError::OutOfRange { .. } => out_of_range(&reason, other_solution, span),
                    _ => refused(&FiveAxisRefusal::Pose { share: 1.0, reason }, span, None),
                });
                None
            }
        }
    }

    /// `G53.1`: the move of the rotary axes.
    pub(super) fn align(&self, guided: &GuidedMove, rotary_rad: [f64; 2], state: &GuideState) -> Move {
        let offset = &guided.step.work_offset;
        let start: Position = std::array::from_fn(|axis| state.position[axis] - offset[axis]);
        let mut end = start;
        for (axis, value_rad) in self.kinematics.letters().1.into_iter().zip(rotary_rad) {
            end[axis.index()] = value_rad.to_degrees() - offset[axis.index()];
        }
        Move { start, end, ..guided.step.clone() }
    }

    /// `G53.6`: the elements in which the linear axes follow the rotary ones, so that the tool centre point rests on the work; nothing
    /// after a finding.
    pub(super) fn align_about_tip(
        &self,
        guided: &GuidedMove,
        rotary_rad: [f64; 2],
        span: SourceSpan,
        state: &mut GuideState,
        findings: &mut FindingLog,
    ) -> Option<FiveAxisMotion> {
        let tool = state.tool.as_mut()?;
        let block = FiveAxisBlock {
            end_mm: tool.point.tip_mm,
            curve: None,
            toward: Toward::Angles(rotary_rad.map(f64::to_degrees)),
            pole_tolerance_rad: 0.0,
            source: span,
            rapid: true,
        };
        match self.kinematics.elements(&tool.setup, &tool.point, &block) {
            Ok(motion) => {
                tool.point = motion.end;
                (state.position, state.cutting, state.cut) = (motion.end.position, false, None);
                Some(motion)
            }
            Err(refusal) => {
                self.refuse(&refusal, guided, &block, state, findings);
                None
            }
        }
    }

    /// Leads the tool along a straight thread in a plane, X and Z of which are `ends` in its coordinates; nothing after a finding.
    pub(crate) fn thread_in_plane(
        &self,
        guided: &GuidedMove,
        ends: [[f64; 2]; 2],
        span: SourceSpan,
        state: &mut GuideState,
        inputs: &GuideInputs,
        findings: &mut FindingLog,
    ) -> Option<PlaneFrame> {
        let plane = guided.plane.as_ref()?;
        self.place_tool(guided, state)?;
        let start = state.tool.as_ref()?.point;
        self.lead(guided, span, None, state, inputs, findings)?;
        let tool = state.tool.as_ref()?;
        match PlaneFrame::new(&self.kinematics, plane, &tool.setup, [start, tool.point], ends) {
            Ok(frame) => Some(frame),
            Err(reason) => {
                findings.push(refused(&FiveAxisRefusal::Pose { share: 0.0, reason }, span, None));
                None
            }
        }
    }

    /// Names the first cut in a plane with a tool axis that is not its normal; controls permit it.
    pub(super) fn check_aligned(
        &self,
        guided: &GuidedMove,
        direction: Vec3,
        span: SourceSpan,
        state: &mut GuideState,
        findings: &mut FindingLog,
    ) {
        let Some(plane) = guided.plane.as_ref().filter(|_| guided.step.kind == MoveKind::Cutting) else { return };
        let beside_rad = angle(direction, plane.axes[2]);
        if beside_rad <= ALIGNED_RAD || state.beside_normal.replace(plane.line) == Some(plane.line) {
            return;
        }
        let beside_deg = beside_rad.to_degrees();
        let message = format!(
            "the tool axis is {beside_deg:.3} degrees beside the normal of the plane that line {} tilts",
            plane.line
        );
        findings.push(
            Finding::new(code::FIVE_AXIS_NOT_NORMAL, span, message)
                .with_value("beside", beside_deg, "deg")
                .with_value("plane_line", f64::from(plane.line), "")
                .suggest("turn the tool axis onto the plane with G53.1, in the block after G68.2"),
        );
    }
}
