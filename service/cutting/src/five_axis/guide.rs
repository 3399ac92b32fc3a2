//! Guided moves: from what the program says about the tool to elements of the machine's axes.

use std::sync::Arc;

use feedwave_motion::kinematics::vector::{angle, unit};
use feedwave_motion::kinematics::{
    FiveAxisBlock, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, JointValues, Kinematics, KinematicsError, Setup,
    Toward,
};
use feedwave_program::{
    AXIS_COUNT, Axis, Finding, FindingLog, GuidedMove, Move, MoveKind, Position, SourceSpan, ToolGuide,
};
use serde::{Deserialize, Serialize};

use crate::PipelineConfig;

/// Blocks that pass a pole within this angle are looked at, degrees.
const NEAR_POLE_DEG: f64 = 2.0;
/// Directions closer to the line of the first rotary axis than this are taken along it, rad, as the elements take them.
const POLE_RAD: f64 = 1e-7;
/// Turn of the first rotary axis within one block near a pole that is worth a finding, degrees.
const POLE_TURN_DEG: f64 = 10.0;

/// Where the tool is: what lasts between two guided moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct GuideState {
    /// Machine position of the axes by letter, mm and degrees, where the last move ended.
    position: Position,
    /// The tool there, while it is guided.
    tool: Option<Tool>,
    /// The block before passed a pole, which was reported.
    near_pole: bool,
    /// Number of the tool length with which guided moves were refused for want of data, which was reported.
    refused: Option<u32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Tool {
    length_offset: u32,
    work_offset: Position,
    setup: Setup,
    point: FiveAxisPoint,
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
        Self { position, tool: None, near_pole: false, refused: None }
    }

    /// Whether a refusal for want of data is the first one with this tool length: the blocks after it say nothing new.
    pub(crate) fn is_first_refusal(&mut self, length_offset: u32) -> bool {
        self.refused.replace(length_offset) != Some(length_offset)
    }

    /// The axes have moved without being guided.
    pub(crate) fn moved(&mut self, step: &Move) {
        self.position = std::array::from_fn(|axis| step.end[axis] + step.work_offset[axis]);
        self.tool = None;
    }
}

impl Guide {
    pub(crate) const fn new(kinematics: Arc<Kinematics>) -> Self {
        Self { kinematics }
    }

    /// Carries a guided move out; nothing after a finding.
    pub(crate) fn carry_out(
        &self,
        guided: &GuidedMove,
        span: SourceSpan,
        state: &mut GuideState,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<Guided> {
        let step = &guided.step;
        let work = |axis: usize| state.position[axis] - step.work_offset[axis];
        if guided.guide == ToolGuide::Axes {
            let start: Position = std::array::from_fn(work);
            let held = |axis: usize| guided.held.contains(Axis::ALL[axis]);
            let end = std::array::from_fn(|axis| if held(axis) { start[axis] } else { step.end[axis] });
            return Some(Guided::Axes(Move { start, end, ..step.clone() }));
        }
        // Axes beside the chain, and axes that the program places though the tool is guided by a vector.
        let (_, rotary) = self.kinematics.letters();
        let by_angles = guided.guide == ToolGuide::Angles;
        let moves = |axis: &Axis| {
            let index = axis.index();
            let is_guided = index < 3 || rotary.contains(axis) || guided.held.contains(*axis);
            index < AXIS_COUNT && !is_guided && step.end[index] != work(index)
        };
        if let Some(axis) = Axis::ALL.into_iter().find(moves) {
            findings.push(no_axis(axis, span));
            return None;
        }
        if state.tool.as_ref().is_none_or(|tool| !tool.is_for(guided)) {
            let setup = match self.setup(guided, span, config) {
                Ok(setup) => setup,
                Err(finding) => {
                    if state.is_first_refusal(guided.length_offset) {
                        findings.push(*finding);
                    }
                    return None;
                }
            };
            let point = self.kinematics.point_at(&state.position, &setup);
            let (length_offset, work_offset) = (guided.length_offset, step.work_offset);
            state.tool = Some(Tool { length_offset, work_offset, setup, point });
        }
        let tool = state.tool.as_mut()?;
        let held = |axis: Axis| guided.held.contains(axis);
        let end_mm = [Axis::X, Axis::Y, Axis::Z].map(|axis| {
            let axis_index = axis.index();
            if held(axis) { tool.point.tip_mm[axis_index] } else { step.end[axis_index] }
        });
        let toward = match guided.guide {
            ToolGuide::Vector { end, .. } => Toward::Vector(end.unwrap_or(tool.point.direction)),
            _ => Toward::Angles(rotary.map(|axis| {
                let place = axis.index();
                if held(axis) { tool.point.position[place] } else { step.end[place] + step.work_offset[place] }
            })),
        };
        let block = FiveAxisBlock {
            end_mm,
            toward,
            pole_tolerance_rad: config.profile.pole_tolerance_deg.to_radians(),
            source: span,
            rapid: step.kind == MoveKind::Rapid,
        };
        let before = tool.point;
        let motion = match self.elements(&tool.setup, &before, &block) {
            Ok(motion) => motion,
            Err(refusal) => {
                findings.push(refused(&refusal, span));
                return None;
            }
        };
        tool.point = motion.end;
        state.position = motion.end.position;
        self.check_pole(&motion, &before, by_angles, span, state, findings);
        Some(Guided::Elements(motion))
    }

    /// The elements of a block. Where it tilts the tool away from a pole, in which the first rotary axis is free, that axis
    /// turns first to the solution that the profile prefers among those within the ranges.
    fn elements(
        &self,
        setup: &Setup,
        start: &FiveAxisPoint,
        block: &FiveAxisBlock,
    ) -> Result<FiveAxisMotion, FiveAxisRefusal> {
        let Some(angles) = self.turn_in_pole(setup, start, block) else {
            return self.kinematics.elements(setup, start, block);
        };
        let turn = FiveAxisBlock { end_mm: start.tip_mm, toward: Toward::Angles(angles), ..*block };
        let turn = self.kinematics.elements(setup, start, &turn)?;
        let (stood, start) = (start, FiveAxisPoint { direction: start.direction, ..turn.end });
        let motion = self.kinematics.elements(setup, &start, block)?;
        let place = self.kinematics.letters().1[0].index();
        let turn_in_pole_rad = (turn.end.position[place] - stood.position[place]).abs().to_radians();
        let elements = turn.elements.into_iter().chain(motion.elements).collect();
        Ok(FiveAxisMotion { elements, turn_in_pole_rad: motion.turn_in_pole_rad.max(turn_in_pole_rad), ..motion })
    }

    /// Rotary angles, degrees, to turn to before a block that leaves a pole; nothing where there is nothing to turn.
    fn turn_in_pole(&self, setup: &Setup, start: &FiveAxisPoint, block: &FiveAxisBlock) -> Option<[f64; 2]> {
        let Toward::Vector(target) = block.toward else { return None };
        let stand_rad = self.kinematics.from_position(&start.position).rotary_rad;
        if self.kinematics.pole_distance_rad(stand_rad) > POLE_RAD {
            return None;
        }
        let target = unit(target).filter(|&target| angle(target, start.direction) > POLE_RAD)?;
        let chosen = self.kinematics.choose_start([target], setup, stand_rad).ok()?;
        let turn_rad = chosen.start_rad[0] - stand_rad[0];
        (chosen.singular == 0 && turn_rad.abs() > POLE_RAD)
            .then(|| [chosen.start_rad[0].to_degrees(), stand_rad[1].to_degrees()])
    }

    /// Work coordinates and tool length, or a finding.
    fn setup(&self, guided: &GuidedMove, span: SourceSpan, config: &PipelineConfig) -> Result<Setup, Box<Finding>> {
        let number = guided.length_offset;
        let length_mm = config.tools.iter().find(|tool| tool.number == number).and_then(|tool| tool.length_mm);
        let Some(length_mm) = length_mm else {
            let message = format!("no tool {number} with a length is known, so that H{number} means nothing");
            let finding = Finding::error("TOOL-LENGTH", span, message)
                .with_value("length_offset", f64::from(number), "")
                .suggest("give the tool its length, and the job the tool");
            return Err(Box::new(finding));
        };
        let (_, rotary) = self.kinematics.letters();
        let offset = &guided.step.work_offset;
        if let Some(axis) = rotary.into_iter().find(|axis| offset[axis.index()] != 0.0) {
            let (letter, value) = (axis.letter(), offset[axis.index()]);
            let message = format!(
                "the work offset turns {letter} by {value} degrees: work coordinates that are turned against the machine \
                 are not supported under tool centre point control"
            );
            let finding = Finding::error("FIVE-AXIS-OFFSET", span, message)
                .with_value("offset", value, "deg")
                .suggest("set the rotary axes of the work offset to zero");
            return Err(Box::new(finding));
        }
        let linear_mm = self.kinematics.letters().0.map(|axis| offset[axis.index()]);
        let origin = self.kinematics.gauge_point_at(&JointValues { linear_mm, rotary_rad: [0.0; 2] });
        Ok(Setup::new(origin, length_mm))
    }

    /// Names the block in which the first rotary axis turns because the tool is parallel to it, or nearly so.
    fn check_pole(
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
        if !std::mem::replace(&mut state.near_pole, near) && near {
            let letter = first.letter();
            let message = format!(
                "the tool is within {distance_deg:.4} degrees of the {letter} axis here, which turns by {turn_deg:.1} \
                 degrees in this block: its velocity and acceleration limit the feed"
            );
            let finding = Finding::warning("FIVE-AXIS-SINGULAR", span, message)
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

impl Tool {
    fn is_for(&self, guided: &GuidedMove) -> bool {
        self.length_offset == guided.length_offset && self.work_offset == guided.step.work_offset
    }
}

fn no_axis(axis: Axis, span: SourceSpan) -> Finding {
    let message = format!("{} is not among the five axes of the kinematics", axis.letter());
    Finding::error("AXIS-MISSING", span, message)
        .suggest("remove the word, or move the axis while tool centre point control is off")
}

/// Tool centre point control on a machine that has no kinematics.
pub(crate) fn no_kinematics(span: SourceSpan) -> Finding {
    let message = "tool centre point control needs the kinematics of the machine, which its profile does not have";
    Finding::error("FIVE-AXIS-KINEMATICS", span, message).suggest("describe the five axes in the machine profile")
}

fn refused(refusal: &FiveAxisRefusal, span: SourceSpan) -> Finding {
    let message = refusal.to_string();
    match *refusal {
        FiveAxisRefusal::Pose { share, reason } => {
            let finding = |code| Finding::error(code, span, message.clone()).with_value("share", share, "");
            match reason {
                KinematicsError::OutOfRange { excess_rad, .. } => finding("FIVE-AXIS-RANGE")
                    .with_value("excess", excess_rad.to_degrees(), "deg")
                    .suggest("start the cut with the rotary axes in their other solution, or a turn back")
                    .suggest("clamp the work in another position"),
                KinematicsError::Unreachable { missing_rad } => finding("FIVE-AXIS-UNREACHABLE")
                    .with_value("missing", missing_rad.to_degrees(), "deg")
                    .suggest("clamp the work in another position"),
                _ => finding("FIVE-AXIS-POSE").suggest("check the kinematics in the machine profile"),
            }
        }
        FiveAxisRefusal::Opposite(_) => Finding::error("FIVE-AXIS-OPPOSITE", span, message)
            .suggest("write a direction in between, which says over which side the tool turns"),
        FiveAxisRefusal::Start { difference, .. } => Finding::error("FIVE-AXIS-START", span, message)
            .with_value("difference", difference, "")
            .suggest("move to the start of the cut with G0 first"),
        FiveAxisRefusal::TooSharp { share } => Finding::error("FIVE-AXIS-TOO-SHARP", span, message)
            .with_value("share", share, "")
            .suggest("keep off the edge of what the rotary axes can reach"),
        FiveAxisRefusal::NotANumber => Finding::error("FIVE-AXIS-POSE", span, message)
            .suggest("check the numbers of the block and of the work offset"),
    }
}
