//! Operations of the interpreter as actions of the contract.

use std::f64::consts::TAU;

use feedwave_program::{
    ArcGeometry, Axis, Coolant, DwellTime, Feed, Function, FunctionWord, GuidedMove, MachineCommand, Move, MoveKind,
    Operation, OperationKind, PathControl, Plane, Position, SourceSpan, Spindle, SpindleDirection, SpindleSpeed,
    SplineGeometry, ThreadKind, ThreadMove, ToolGuide,
};

use super::language::position_to_proto;
use super::machine_codes::effect_to_proto;
use crate::proto::{self, ActionKind};

/// A turn is full although its angle is smaller by rounding, turns.
const FULL_TURN: f64 = 1e-9;

/// An operation as the contract has it; `programs` are the names of the job's further files.
#[must_use]
pub fn action_to_proto(operation: &Operation, programs: &[String]) -> proto::Action {
    let span = operation.span;
    let mut action = proto::Action {
        line: span.line,
        column: span.column,
        length: span.length,
        file: file_name(span, programs),
        ..proto::Action::default()
    };
    let kind = match &operation.kind {
        OperationKind::Move(step) => motion(step, &mut action),
        OperationKind::Guided(guided) => guided_motion(guided, &mut action),
        OperationKind::Thread(pass) => thread(pass, &mut action),
        OperationKind::Dwell { time, .. } => {
            match time {
                DwellTime::Seconds(seconds) => action.dwell_s = Some(*seconds),
                DwellTime::Revolutions(revolutions) => action.dwell_rev = Some(*revolutions),
            }
            ActionKind::Dwell
        }
        OperationKind::Spindle(state) => {
            action.spindle = Some(spindle(state));
            ActionKind::Spindle
        }
        OperationKind::Tool { number, offset } => {
            (action.tool, action.tool_offset) = (*number, *offset);
            ActionKind::Tool
        }
        OperationKind::Coolant(Coolant { mist, flood }) => {
            action.coolant = Some(proto::ActionCoolant { mist: *mist, flood: *flood });
            ActionKind::Coolant
        }
        OperationKind::Function(command) => {
            let name = match command.function {
                Function::PathVibration => "path_vibration",
                Function::ThreadVibration => "thread_vibration",
                Function::Thinning => "thinning",
                Function::ToolOscillation => "tool_oscillation",
            };
            let words = words(&command.words);
            action.function = Some(proto::ActionFunction { name: name.to_owned(), on: command.on, words });
            ActionKind::Function
        }
        OperationKind::MachineCode(command) => machine_code(command, &mut action),
        // The stage behind the interpreter takes these out.
        OperationKind::Compensation(_) => ActionKind::Unspecified,
        OperationKind::Stop { optional: false } => ActionKind::Stop,
        OperationKind::Stop { optional: true } => ActionKind::OptionalStop,
        OperationKind::End => ActionKind::End,
    };
    action.kind = kind.into();
    action
}

/// Name of the further file that a place is in; empty for the program itself.
pub(super) fn file_name(span: SourceSpan, programs: &[String]) -> String {
    let place = (span.program as usize).checked_sub(1);
    place.and_then(|place| programs.get(place)).cloned().unwrap_or_default()
}

fn motion(step: &Move, action: &mut proto::Action) -> ActionKind {
    action.start = Some(position_to_proto(&step.start));
    action.end = Some(position_to_proto(&step.end));
    action.machine_end = Some(position_to_proto(&sum(&step.end, &step.work_offset)));
    action.offset = Some(position_to_proto(&step.work_offset));
    action.spindle = Some(spindle(&step.spindle));
    action.tool = step.tool;
    action.path_control = Some(path_control(step.path_control));
    if step.kind == MoveKind::Rapid {
        return ActionKind::Rapid;
    }
    action.feed = Some(feed(step.feed));
    match (&step.arc, &step.spline) {
        (Some(circle), _) => {
            action.plane = plane(circle.plane).into();
            action.arc = Some(arc(circle));
            ActionKind::Arc
        }
        (None, Some(curve)) => {
            action.plane = plane(curve.plane).into();
            action.spline = Some(spline(curve));
            ActionKind::Spline
        }
        (None, None) => ActionKind::Line,
    }
}

fn guided_motion(guided: &GuidedMove, action: &mut proto::Action) -> ActionKind {
    let kind = motion(&guided.step, action);
    action.machine_end = None;
    let mut direction = None;
    let guide = match &guided.guide {
        ToolGuide::Axes => proto::ActionGuideKind::Axes,
        ToolGuide::Angles => proto::ActionGuideKind::Angles,
        ToolGuide::Vector { end, .. } => {
            direction = end.map(|[x, y, z]| proto::Vector { x, y, z });
            proto::ActionGuideKind::Vector
        }
        ToolGuide::Plane => proto::ActionGuideKind::Plane,
        ToolGuide::Align { about_tip: false, .. } => proto::ActionGuideKind::Align,
        ToolGuide::Align { about_tip: true, .. } => proto::ActionGuideKind::AlignAboutTip,
    };
    action.guide = Some(proto::ActionGuide {
        kind: guide.into(),
        length_offset: guided.length_offset,
        direction,
        held: Axis::ALL.into_iter().filter(|axis| guided.held.contains(*axis)).map(Axis::letter).collect(),
    });
    kind
}

fn thread(pass: &ThreadMove, action: &mut proto::Action) -> ActionKind {
    action.start = Some(position_to_proto(&pass.start));
    action.end = Some(position_to_proto(&pass.end));
    action.machine_end = Some(position_to_proto(&sum(&pass.end, &pass.work_offset)));
    action.offset = Some(position_to_proto(&pass.work_offset));
    action.spindle = Some(spindle(&pass.spindle));
    action.tool = pass.tool;
    action.thread = Some(proto::ActionThread {
        lead_mm: pass.lead_mm,
        start_angle_deg: pass.start_angle_deg,
        start_number: pass.thread_start,
        pull_out_mm: pass.pull_out.map_or(0.0, |pull_out| pull_out.travel_mm),
        pull_out_retreat_mm: pass.pull_out.map_or(0.0, |pull_out| pull_out.retreat_mm),
    });
    if let Some(plane) = &pass.plane {
        action.machine_end = None;
        action.guide = Some(proto::ActionGuide {
            kind: proto::ActionGuideKind::Plane.into(),
            length_offset: plane.length_offset,
            direction: None,
            // The program places the linear axes of a thread or a tap; the rotary ones stay.
            held: Axis::ALL.into_iter().filter(|axis| axis.is_rotary()).map(Axis::letter).collect(),
        });
    }
    match pass.kind {
        ThreadKind::Turned => ActionKind::Thread,
        ThreadKind::Tapped => ActionKind::Tap,
    }
}

fn machine_code(command: &MachineCommand, action: &mut proto::Action) -> ActionKind {
    let (effect, dwell_s) = effect_to_proto(command.effect);
    action.dwell_s = dwell_s;
    let words = words(&command.words);
    action.machine_code = Some(proto::ActionMachineCode { number: command.number, effect: effect.into(), words });
    ActionKind::MachineCode
}

fn sum(position: &Position, offset: &Position) -> Position {
    core::array::from_fn(|axis| position[axis] + offset[axis])
}

fn words(words: &[FunctionWord]) -> Vec<proto::ActionWord> {
    words.iter().map(|word| proto::ActionWord { letter: word.letter.to_string(), value: word.value }).collect()
}

const fn plane(plane: Plane) -> proto::ActionPlane {
    match plane {
        Plane::Xy => proto::ActionPlane::Xy,
        Plane::Zx => proto::ActionPlane::Zx,
        Plane::Yz => proto::ActionPlane::Yz,
    }
}

fn arc(arc: &ArcGeometry) -> proto::ActionArc {
    let [center_first, center_second] = arc.center;
    proto::ActionArc {
        center_first,
        center_second,
        clockwise: arc.clockwise,
        sweep_deg: arc.sweep_rad.to_degrees(),
        turns: (arc.sweep_rad.abs() / TAU - FULL_TURN).ceil().max(1.0) as u32,
    }
}

fn spline(spline: &SplineGeometry) -> proto::ActionSpline {
    proto::ActionSpline {
        order: u32::from(spline.order),
        first: spline.points.iter().map(|point| point[0]).collect(),
        second: spline.points.iter().map(|point| point[1]).collect(),
        weights: spline.weights.clone(),
    }
}

fn feed(feed: Feed) -> proto::ActionFeed {
    let (mode, value) = match feed {
        Feed::PerMinute(value) => (proto::ActionFeedMode::PerMinute, value),
        Feed::PerRevolution(value) => (proto::ActionFeedMode::PerRevolution, value),
        Feed::InverseTime(value) => (proto::ActionFeedMode::InverseTime, value),
    };
    proto::ActionFeed { mode: mode.into(), value }
}

fn spindle(spindle: &Spindle) -> proto::ActionSpindle {
    let direction = match spindle.direction {
        SpindleDirection::Stopped => proto::ActionSpindleDirection::Stopped,
        SpindleDirection::Clockwise => proto::ActionSpindleDirection::Clockwise,
        SpindleDirection::CounterClockwise => proto::ActionSpindleDirection::CounterClockwise,
    };
    let mut shown = proto::ActionSpindle { direction: direction.into(), ..proto::ActionSpindle::default() };
    match spindle.speed {
        SpindleSpeed::Constant { rev_per_min } => shown.rev_per_min = Some(rev_per_min),
        SpindleSpeed::Surface { m_per_min, max_rev_per_min } => {
            shown.surface_m_per_min = Some(m_per_min);
            shown.max_rev_per_min = Some(max_rev_per_min).filter(|speed| speed.is_finite());
        }
    }
    shown
}

fn path_control(control: PathControl) -> proto::ActionPathControl {
    let mode = |mode: proto::PathControl| proto::ActionPathControl { mode: mode.into(), ..Default::default() };
    match control {
        PathControl::ExactPath => mode(proto::PathControl::ExactPath),
        PathControl::ExactStop => mode(proto::PathControl::ExactStop),
        PathControl::Continuous { tolerance_mm, merge_tolerance_mm } => {
            proto::ActionPathControl { tolerance_mm, merge_tolerance_mm, ..mode(proto::PathControl::Continuous) }
        }
    }
}

#[cfg(test)]
mod tests {
    use feedwave_program::{LanguageSettings, interpret};

    use super::*;

    fn actions(program: &str) -> Vec<proto::Action> {
        let settings = LanguageSettings::mill();
        let (operations, findings) = interpret(program.as_bytes(), settings);
        assert!(!findings.has_errors(), "{findings:?}");
        operations.iter().map(|operation| action_to_proto(operation, &[])).collect()
    }

    #[test]
    fn a_program_becomes_actions_with_everything_that_is_in_force() {
        let program = "G21 G90 G54 T3 M6\nS1200 M3\nG0 X10 Y0 Z5\nG1 Z-1 F200\nG2 X10 Y0 I-10\nG4 P1500\nM30\n";
        let actions = actions(program);
        let kinds: Vec<_> = actions.iter().map(proto::Action::kind).collect();
        use ActionKind::*;
        assert_eq!(kinds, [Tool, Spindle, Rapid, Line, Arc, Dwell, End]);
        let [.., line, arc, dwell, _] = &actions[..] else { panic!() };
        assert_eq!((line.feed.unwrap().value, line.spindle.unwrap().rev_per_min, line.tool), (200.0, Some(1200.0), 3));
        let circle = arc.arc.unwrap();
        assert_eq!((circle.center_first, circle.center_second, circle.turns), (0.0, 0.0, 1));
        assert_eq!((arc.plane(), circle.clockwise, circle.sweep_deg), (proto::ActionPlane::Xy, true, -360.0));
        assert_eq!((dwell.dwell_s, dwell.line), (Some(1.5), 6));
    }
}
