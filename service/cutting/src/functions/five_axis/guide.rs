//! Guided moves: from what the program says about the tool to elements of the machine's axes.

mod curve;
mod elements;
mod plane;
mod refusal;
mod turns;

use std::sync::Arc;

use feedwave_motion::kinematics::vector::angle;
use feedwave_motion::kinematics::{
    BranchPreference, CutSearch, FiveAxisBlock, FiveAxisCorners, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal,
    Kinematics, KinematicsError, Setup, TipCurve, ToolFrame, Toward,
};
use feedwave_program::{AXIS_COUNT, Axis, FindingLog, GuidedMove, Move, MoveKind, Position, SourceSpan, ToolGuide};
use serde::{Deserialize, Serialize};

pub(crate) use self::refusal::no_kinematics;
use self::refusal::{no_axis, refused};
use super::ahead::{Ahead, Chosen, CutNote};

/// Angles of a rotary axis in a tilted plane closer than this are the same: only rounding is between them.
const SAME_ANGLE_DEG: f64 = 1e-9;
/// Directions closer to the line of the first rotary axis than this are taken along it, rad, as the elements take them.
const POLE_RAD: f64 = 1e-7;

/// Where the tool is: what lasts between two guided moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GuideState {
    /// Machine position of the axes by letter, mm and degrees, where the last move ended.
    position: Position,
    /// The tool there, while it is guided.
    tool: Option<Tool>,
    /// The move before was a cut.
    cutting: bool,
    /// The present cut, where look-ahead has covered it.
    cut: Option<CutNote>,
    /// A rotary axis has left its range, which was reported: what follows in the cut says nothing new.
    ran_out: bool,
    /// The block before was a cut that passed a pole, which was reported.
    near_pole: bool,
    /// Line that tilted the plane in which the tool was beside the normal, which was reported.
    beside_normal: Option<u32>,
    /// Number of the tool length with which guided moves were refused for want of data, which was reported.
    refused: Option<u32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Tool {
    work_offset: Position,
    setup: Setup,
    point: FiveAxisPoint,
}

/// What a run of the pipeline gives the guide.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuideInputs {
    /// Angle to the line of the first rotary axis within which the direction may be bent to lead through it, degrees.
    pub(crate) pole_tolerance_deg: f64,
    /// Largest angle between the programmed direction and the one at a rounded corner or in one curve of short blocks, degrees.
    pub(crate) corner_direction_tolerance_deg: f64,
}

/// The guide: compiled kinematics.
#[derive(Clone, Debug)]
pub(crate) struct Guide {
    kinematics: Arc<Kinematics>,
}

/// What becomes of a guided move.
pub(crate) enum Guided {
    /// A plain move of the axes.
    Axes(Move),
    /// Elements, in order, under the feed and spindle of the move.
    Elements(FiveAxisMotion),
}

impl GuideState {
    pub(crate) const fn at(position: Position) -> Self {
        Self {
            position,
            tool: None,
            cutting: false,
            cut: None,
            ran_out: false,
            near_pole: false,
            beside_normal: None,
            refused: None,
        }
    }

    /// Whether a refusal for want of data is the first one with this tool length: the blocks after it say nothing new.
    pub(crate) fn is_first_refusal(&mut self, length_offset: u32) -> bool {
        self.refused.replace(length_offset) != Some(length_offset)
    }

    /// The axes have moved without being guided.
    pub(crate) fn moved(&mut self, step: &Move) {
        self.position = std::array::from_fn(|axis| step.end[axis] + step.work_offset[axis]);
        (self.tool, self.cutting, self.cut) = (None, false, None);
    }
}

impl Guide {
    pub(crate) const fn new(kinematics: Arc<Kinematics>) -> Self {
        Self { kinematics }
    }

    /// The frame of the tool, in which it oscillates.
    pub(crate) fn tool_frame(&self) -> ToolFrame {
        self.kinematics.tool_frame()
    }

    /// How corners between guided cuts are rounded.
    pub(crate) fn corners(&self, inputs: &GuideInputs) -> FiveAxisCorners<'_> {
        let direction_tolerance_rad = inputs.corner_direction_tolerance_deg.to_radians();
        FiveAxisCorners { kinematics: &self.kinematics, direction_tolerance_rad }
    }

    /// A guide for times alone: its rotary axes never run out.
    pub(crate) fn without_ranges(&self) -> Self {
        Self { kinematics: Arc::new(Kinematics::clone(&self.kinematics).without_rotary_ranges()) }
    }

    /// What to look ahead for at a move where the inverse solution is free: a rapid that tilts the tool, or a move that
    /// leaves a pole. Nothing at every other move.
    pub(crate) fn ahead(
        &self,
        guided: &GuidedMove,
        line: u32,
        state: &GuideState,
        inputs: &GuideInputs,
    ) -> Option<Ahead> {
        let ToolGuide::Vector { end: Some(target), .. } = guided.guide else { return None };
        let tool = state.tool.as_ref().filter(|tool| tool.is_for(guided));
        if tool.is_some_and(|tool| tool.point.direction == target) {
            return None;
        }
        let setup = match tool {
            Some(tool) => tool.setup,
            None => self.setup(guided)?,
        };
        let direction = tool
            .map_or_else(|| self.kinematics.point_at(&state.position, &setup).direction, |tool| tool.point.direction);
        let stand_rad = self.kinematics.from_position(&state.position).rotary_rad;
        let is_rapid = guided.step.kind == MoveKind::Rapid;
        if angle(target, direction) <= POLE_RAD
            || !(is_rapid || self.kinematics.pole_distance_rad(stand_rad) <= POLE_RAD)
        {
            return None;
        }
        let tolerance_rad = inputs.pole_tolerance_deg.to_radians();
        let mut ahead = Ahead {
            kinematics: Arc::clone(&self.kinematics),
            search: CutSearch::new(setup, stand_rad, tolerance_rad),
            // Within a cut the axes turn no further than they have to.
            preferred: if state.cutting && !is_rapid { BranchPreference::Nearest } else { self.kinematics.preferred() },
            tool_length_mm: guided.tool_length_mm,
            work_offset: guided.step.work_offset,
            direction,
            line,
            failed_lines: [0; 2],
            ended: false,
        };
        ahead.push(target, line);
        Some(ahead)
    }

    /// What a guided move asks of the machine axes.
    fn block(
        &self,
        guided: &GuidedMove,
        span: SourceSpan,
        tool: &Tool,
        inputs: &GuideInputs,
    ) -> FiveAxisBlock<'static> {
        let step = &guided.step;
        let (_, rotary) = self.kinematics.letters();
        let held = |axis: Axis| guided.held.contains(axis);
        let end_mm = match &guided.plane {
            Some(plane) => plane::end_in_work(plane, guided, tool.point.tip_mm),
            None => [Axis::X, Axis::Y, Axis::Z].map(|axis| {
                let axis_index = axis.index();
                if held(axis) { tool.point.tip_mm[axis_index] } else { step.end[axis_index] }
            }),
        };
        let toward = match guided.guide {
            ToolGuide::Vector { end, .. } => Toward::Vector(end.unwrap_or(tool.point.direction)),
            _ => Toward::Angles(std::array::from_fn(|turning| {
                let (axis, place) = (rotary[turning], rotary[turning].index());
                let (here, there) = (tool.point.position[place], step.end[place] + step.work_offset[place]);
                // In a plane the rotary axes rest, unless a word turns them.
                let rests = guided.guide == ToolGuide::Plane && (there - here).abs() <= SAME_ANGLE_DEG;
                if rests || held(axis) {
                    here
                } else if guided.turned.contains(axis) && self.kinematics.rolls_over(turning) {
                    // The program counts turns that the axis has not made on its shorter ways.
                    here + (step.end[place] - step.start[place])
                } else {
                    self.kinematics.approach_deg(turning, there, here)
                }
            })),
        };
        FiveAxisBlock {
            end_mm,
            curve: curve::circle_in_work(guided).map(TipCurve::Circle),
            toward,
            pole_tolerance_rad: inputs.pole_tolerance_deg.to_radians(),
            source: span,
            rapid: step.kind == MoveKind::Rapid,
        }
    }

    /// Reports a move that the machine axes cannot make; within a cut that a rotary axis cannot follow, once.
    fn refuse(
        &self,
        refusal: &FiveAxisRefusal,
        guided: &GuidedMove,
        block: &FiveAxisBlock<'_>,
        state: &mut GuideState,
        findings: &mut FindingLog,
    ) {
        let out_of_range = match *refusal {
            FiveAxisRefusal::Pose { reason: KinematicsError::OutOfRange { axis, range_rad, .. }, .. } => {
                Some((axis, range_rad))
            }
            _ => None,
        };
        let was_reported = std::mem::replace(&mut state.ran_out, out_of_range.is_some());
        if was_reported && out_of_range.is_some() {
            return;
        }
        let finding = refused(refusal, block.source, state.cut.as_ref());
        findings.push(match out_of_range {
            Some(range) => self.cure_range(finding, range, guided, block.toward),
            None => finding,
        });
    }

    /// Carries a guided move out; nothing after a finding. `chosen` says where a cut starts that was looked ahead over.
    pub(crate) fn carry_out(
        &self,
        guided: &GuidedMove,
        span: SourceSpan,
        chosen: Option<Chosen>,
        state: &mut GuideState,
        inputs: &GuideInputs,
        findings: &mut FindingLog,
    ) -> Option<Guided> {
        match guided.guide {
            ToolGuide::Align { solution, about_tip } => {
                let rotary_rad = self.onto_normal(guided, solution, span, state, findings)?;
                match about_tip {
                    false => Some(Guided::Axes(self.align(guided, rotary_rad, state))),
                    true => self.align_about_tip(guided, rotary_rad, span, state, findings).map(Guided::Elements),
                }
            }
            ToolGuide::Axes => {
                let step = &guided.step;
                let start: Position = std::array::from_fn(|axis| state.position[axis] - step.work_offset[axis]);
                let held = |axis: usize| guided.held.contains(Axis::ALL[axis]);
                let end = std::array::from_fn(|axis| if held(axis) { start[axis] } else { step.end[axis] });
                Some(Guided::Axes(Move { start, end, ..step.clone() }))
            }
            _ => self.lead(guided, span, chosen, state, inputs, findings).map(Guided::Elements),
        }
    }

    /// Leads the tool along a move; nothing after a finding.
    fn lead(
        &self,
        guided: &GuidedMove,
        span: SourceSpan,
        chosen: Option<Chosen>,
        state: &mut GuideState,
        inputs: &GuideInputs,
        findings: &mut FindingLog,
    ) -> Option<FiveAxisMotion> {
        if let Some(axis) = self.unguided_axis(guided, &state.position) {
            findings.push(no_axis(axis, span));
            return None;
        }
        let by_angles = guided.guide == ToolGuide::Angles;
        self.place_tool(guided, state)?;
        let tool = state.tool.as_mut()?;
        if let Some(finding) = self.half_a_turn(guided, &tool.point, span) {
            findings.push(finding);
            return None;
        }
        let block = self.block(guided, span, tool, inputs);
        let before = tool.point;
        let parts = curve::spline_in_work(guided, [before.tip_mm, block.end_mm], span, findings)?;
        let start_rad = chosen.as_ref().map(|chosen| chosen.start_rad);
        let is_free_rapid = chosen.is_some() && block.rapid;
        if let Some(chosen) = chosen {
            state.cut = Some(chosen.cut);
        } else if block.rapid && !matches!(guided.guide, ToolGuide::Vector { .. }) {
            state.cut = None;
        }
        let motion = match parts.as_slice() {
            [] => self.elements(&tool.setup, &before, &block, start_rad),
            parts => self.along_spline(&tool.setup, &before, &block, parts),
        };
        let motion = match motion {
            Ok(motion) => motion,
            Err(refusal) => {
                self.refuse(&refusal, guided, &block, state, findings);
                return None;
            }
        };
        state.ran_out = false;
        tool.point = motion.end;
        state.position = motion.end.position;
        state.cutting = !block.rapid;
        if let (true, Some(cut)) = (is_free_rapid, &state.cut) {
            self.report_turn(cut, [&before, &motion.end], span, findings);
        }
        self.check_aligned(guided, before.direction, span, state, findings);
        if block.rapid {
            // It turns without a feed: most approaches leave a pole.
            state.near_pole = false;
        } else {
            self.check_pole(&motion, &before, by_angles, span, state, findings);
        }
        Some(motion)
    }

    /// An axis that a move of a guided tool cannot place: one beside the chain, or one that the program places though the tool
    /// is guided by a vector. `position` is where the machine axes are.
    fn unguided_axis(&self, guided: &GuidedMove, position: &Position) -> Option<Axis> {
        let step = &guided.step;
        let (_, rotary) = self.kinematics.letters();
        let moves = |axis: &Axis| {
            let index = axis.index();
            let is_guided = index < 3 || rotary.contains(axis) || guided.held.contains(*axis);
            index < AXIS_COUNT && !is_guided && step.end[index] != position[index] - step.work_offset[index]
        };
        Axis::ALL.into_iter().find(moves)
    }

    /// Sees to it that the tool in the state is the one of a move; nothing where its length is not known.
    fn place_tool(&self, guided: &GuidedMove, state: &mut GuideState) -> Option<()> {
        if state.tool.as_ref().is_none_or(|tool| !tool.is_for(guided)) {
            let setup = self.setup(guided)?;
            let point = self.kinematics.point_at(&state.position, &setup);
            state.tool = Some(Tool { work_offset: guided.step.work_offset, setup, point });
        }
        Some(())
    }

    /// Work coordinates and tool length; `None` where the length is not known, which the interpreter has reported.
    fn setup(&self, guided: &GuidedMove) -> Option<Setup> {
        // Parallel to the machine's axes where the rotary ones are at their offsets: there the program has them at zero.
        let work = self.kinematics.work_frame_at(&self.kinematics.from_position(&guided.step.work_offset));
        Some(Setup { work, tool_length_mm: guided.tool_length_mm? })
    }
}

impl Tool {
    fn is_for(&self, guided: &GuidedMove) -> bool {
        Some(self.setup.tool_length_mm) == guided.tool_length_mm && self.work_offset == guided.step.work_offset
    }
}
