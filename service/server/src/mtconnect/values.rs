//! What the data items of a machine show in a state of it.

use feedwave_contract::proto::{
    Availability, ConditionSeverity, ConditionSource, DecisionReason, Execution, MachineCondition, MachineState,
    RunActivity,
};

use super::model::{Category, Item, Role};

/// A condition that is active.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Active {
    pub(super) is_fault: bool,
    /// Tells conditions of one item apart.
    pub(super) code: String,
    pub(super) qualifier: Option<&'static str>,
    pub(super) text: String,
}

/// The value of a data item.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Unavailable,
    Text(String),
    Whole(u64),
    Number(f64),
    /// The largest of a window, and its length, s.
    OfWindow(f64, f64),
    Vector([f64; 3]),
    /// Everything that is active; nothing: all is normal.
    Condition(Vec<Active>),
}

fn number(value: Option<f64>) -> Value {
    value.filter(|value| value.is_finite()).map_or(Value::Unavailable, Value::Number)
}

fn whole(value: Option<u64>) -> Value {
    value.map_or(Value::Unavailable, Value::Whole)
}

fn word(text: &str) -> Value {
    Value::Text(text.to_owned())
}

/// The execution in words of MTConnect.
pub(super) const fn execution(execution: Execution) -> &'static str {
    match execution {
        Execution::Ready => "READY",
        Execution::Running => "ACTIVE",
        Execution::Held => "FEED_HOLD",
        Execution::Stopped => "STOPPED",
        Execution::Finished => "PROGRAM_COMPLETED",
        Execution::Fault | Execution::Interrupted => "INTERRUPTED",
        Execution::Idle | Execution::Unspecified => "UNAVAILABLE",
    }
}

/// The value of an item, of the component with this name, in a state. Without a run that is connected nothing but the constant
/// has one.
pub(super) fn of(item: &Item, component: &str, state: &MachineState) -> Value {
    if let Some(constant) = item.constant {
        return word(constant);
    }
    let available = state.availability() == Availability::Available;
    let Some(run) = state.run.as_ref().filter(|_| available) else { return Value::Unavailable };
    match item.category {
        Category::Condition => Value::Condition(active(item.role, state)),
        Category::Event => event(item.role, state, run),
        Category::Sample if item.role == Role::Axis => axis(item, component, run),
        Category::Sample => sample(item.role, run),
    }
}

fn event(role: Role, state: &MachineState, run: &RunActivity) -> Value {
    let commanded = run.commanded.as_ref();
    match role {
        Role::Availability => word("AVAILABLE"),
        Role::ControllerMode => word("AUTOMATIC"),
        Role::Execution => word(execution(state.execution())),
        Role::Program => {
            let name = if run.job_display_name.trim().is_empty() { &run.job } else { &run.job_display_name };
            word(name)
        }
        Role::LineNumber => whole(commanded.map(|commanded| commanded.line.into())),
        Role::ToolNumber => whole(run.tool.map(u64::from)),
        Role::FeedOverride => number(run.overrides.map(|overrides| overrides.feed * 100.0)),
        Role::SpindleOverride => number(run.overrides.map(|overrides| overrides.spindle * 100.0)),
        Role::PartCount => Value::Whole(state.finished_runs),
        _ => Value::Unavailable,
    }
}

/// The position of an axis. The run has the axes of its job, which may be others than those that the machine has by now.
fn axis(item: &Item, name: &str, run: &RunActivity) -> Value {
    let unit = if item.units == Some("DEGREE") { "deg" } else { "mm" };
    let machine = run.commanded.as_ref().filter(|commanded| !commanded.work_coordinates);
    let axis = machine.and_then(|machine| machine.axes.iter().find(|axis| axis.axis == name && axis.unit == unit));
    number(axis.map(|axis| axis.position))
}

fn sample(role: Role, run: &RunActivity) -> Value {
    let commanded = run.commanded.as_ref();
    let process = run.process.as_ref();
    let programmed = commanded.map(|commanded| commanded.spindle_rev_per_min).or(run.programmed_rev_per_min);
    let of_window = |unit: &str| {
        let process = process.filter(|process| process.deviation_unit == unit && process.max_deviation.is_finite());
        process.map_or(Value::Unavailable, |process| Value::OfWindow(process.max_deviation, process.window_s))
    };
    let line = process.and_then(|process| process.line);
    match role {
        Role::PathFeed => number(commanded.map(|commanded| commanded.feed_mm_per_min / 60.0)),
        Role::ProcessTimer => number(run.progress.map(|progress| progress.machining_s)),
        Role::PathPosition => {
            let work = commanded.filter(|commanded| commanded.work_coordinates);
            let axis = |name: &str| {
                let axes = &work?.axes;
                axes.iter().find(|axis| axis.axis == name).map(|axis| axis.position).filter(|value| value.is_finite())
            };
            match (axis("X"), axis("Y"), axis("Z")) {
                // A lathe without Y moves in the plane where it is 0.
                (Some(x), y, Some(z)) => Value::Vector([x, y.unwrap_or(0.0), z]),
                _ => Value::Unavailable,
            }
        }
        Role::SpindleProgrammed => number(programmed),
        Role::SpindleCommanded => {
            number(programmed.zip(run.overrides).map(|(speed, overrides)| speed * overrides.spindle))
        }
        Role::Deviation => of_window("mm"),
        Role::DeviationAcceleration => of_window("mm/s²"),
        Role::Frequency => number(line.map(|line| line.frequency_hz)),
        Role::Amplitude => {
            let in_mm = process.is_some_and(|process| process.deviation_unit == "mm");
            number(line.filter(|_| in_mm).map(|line| line.amplitude))
        }
        _ => Value::Unavailable,
    }
}

fn active(role: Role, state: &MachineState) -> Vec<Active> {
    let belongs = |condition: &&MachineCondition| {
        let own = match condition.source() {
            ConditionSource::Process | ConditionSource::Program => Role::MotionProgram,
            ConditionSource::Telemetry => Role::Communications,
            ConditionSource::Service | ConditionSource::Unspecified => Role::System,
        };
        own == role
    };
    let mut active: Vec<Active> = Vec::new();
    for condition in state.conditions.iter().filter(belongs) {
        // Conditions of one code are one: the worst, which comes first.
        if active.iter().all(|known| known.code != condition.code) {
            active.push(Active {
                is_fault: condition.severity() == ConditionSeverity::Fault,
                code: condition.code.clone(),
                qualifier: qualifier(&condition.code),
                text: condition.message.clone(),
            });
        }
    }
    active
}

/// On which side of a limit a condition is.
fn qualifier(code: &str) -> Option<&'static str> {
    let reason = DecisionReason::from_str_name(&format!("DECISION_REASON_{code}"))?;
    match reason {
        DecisionReason::FeedAboveLimit | DecisionReason::AngleAboveLimit | DecisionReason::AboveLimitAtBound => {
            Some("HIGH")
        }
        DecisionReason::FeedBelowLimit | DecisionReason::AngleBelowLimit => Some("LOW"),
        _ => None,
    }
}
