//! Figures of machines: made from the floor when they are asked for, so that a machine without data has no series.

use feedwave_contract::proto::{Availability, ConditionSeverity, Execution, MachineState, ProcessReading, RunActivity};
use prometheus::proto::MetricFamily;
use prometheus::{GaugeVec, IntGaugeVec, Opts, Registry};

/// Most machines that are shown: clients create them.
pub(crate) const MAX_MACHINES: usize = 1_000;

const MM_PER_M: f64 = 1e3;

/// What a machine does, as a label.
const STATES: [(Execution, &str); 8] = [
    (Execution::Idle, "idle"),
    (Execution::Ready, "ready"),
    (Execution::Running, "running"),
    (Execution::Held, "held"),
    (Execution::Stopped, "stopped"),
    (Execution::Finished, "finished"),
    (Execution::Fault, "fault"),
    (Execution::Interrupted, "interrupted"),
];

const SEVERITIES: [(ConditionSeverity, &str); 2] =
    [(ConditionSeverity::Warning, "warning"), (ConditionSeverity::Fault, "fault")];

/// Name, what it is, and where it comes from in a run whose stream is connected.
type Figure = (&'static str, &'static str, fn(&RunActivity) -> Option<f64>);

fn in_m(run: &RunActivity, value: fn(&ProcessReading) -> Option<f64>) -> Option<f64> {
    let process = run.process.as_ref().filter(|process| process.deviation_unit == "mm")?;
    value(process).map(|mm| mm / MM_PER_M)
}

/// A limit of the deviation itself.
fn limit(process: &ProcessReading, limit: f64) -> Option<f64> {
    use feedwave_contract::proto::ProcessProperty;
    (process.property() == ProcessProperty::Deviation).then_some(limit)
}

const FIGURES: [Figure; 12] = [
    ("feedwave_machine_feed_override_ratio", "Feed override in force, 1 is as programmed.", |run| {
        run.overrides.map(|overrides| overrides.feed)
    }),
    ("feedwave_machine_spindle_override_ratio", "Spindle override decided last, 1 is as programmed.", |run| {
        run.overrides.map(|overrides| overrides.spindle)
    }),
    ("feedwave_machine_progress_ratio", "Share of the machining time that is over, an estimate.", |run| {
        run.progress.map(|progress| progress.ratio)
    }),
    ("feedwave_machine_remaining_seconds", "Machining time left, an estimate.", |run| {
        run.progress.and_then(|progress| progress.remaining_s)
    }),
    ("feedwave_machine_path_feed_meters_per_second", "Commanded feed along the path.", |run| {
        run.commanded.as_ref().map(|commanded| commanded.feed_mm_per_min / MM_PER_M / 60.0)
    }),
    ("feedwave_machine_spindle_revolutions_per_second", "Commanded spindle speed.", |run| {
        let speed =
            run.commanded.as_ref().map(|commanded| commanded.spindle_rev_per_min).or(run.programmed_rev_per_min);
        speed.zip(run.overrides).map(|(rev_per_min, overrides)| rev_per_min * overrides.spindle / 60.0)
    }),
    ("feedwave_machine_deflection_meters", "Largest deflection of the tool in the last window.", |run| {
        in_m(run, |process| Some(process.max_deviation))
    }),
    ("feedwave_machine_deflection_lower_limit_meters", "Deflection below which the feed goes up.", |run| {
        in_m(run, |process| limit(process, process.lower))
    }),
    ("feedwave_machine_deflection_upper_limit_meters", "Deflection above which the feed goes down.", |run| {
        in_m(run, |process| limit(process, process.upper))
    }),
    (
        "feedwave_machine_deflection_meters_per_second_squared",
        "Largest acceleration of the tool in the last window, with acceleration sensors.",
        |run| {
            let process = run.process.as_ref().filter(|process| process.deviation_unit != "mm")?;
            Some(process.max_deviation / MM_PER_M)
        },
    ),
    ("feedwave_machine_vibration_amplitude_meters", "Amplitude of the dominant line of the last window.", |run| {
        in_m(run, |process| process.line.map(|line| line.amplitude))
    }),
    ("feedwave_machine_vibration_hertz", "Frequency of the dominant line of the last window.", |run| {
        run.process.as_ref().and_then(|process| process.line).map(|line| line.frequency_hz)
    }),
];

/// The figures of these machines.
pub(crate) fn gather<'a>(states: impl Iterator<Item = &'a MachineState> + Clone) -> Vec<MetricFamily> {
    let registry = Registry::new();
    let shown = states.take(MAX_MACHINES);
    let execution =
        counts(&registry, "feedwave_machine_state", "1 for what the machine does, 0 for what it does not.", "state");
    let available = gauge(&registry, "feedwave_machine_available", "1 while the stream of a run is connected.");
    let alarms = counts(&registry, "feedwave_machine_alarms", "Conditions that need attention.", "severity");
    for state in shown.clone() {
        let machine = machine_of(state);
        for (known, label) in STATES {
            execution.with_label_values(&[machine, label]).set(i64::from(state.execution() == known));
        }
        let is_available = state.availability() == Availability::Available;
        available.with_label_values(&[machine]).set(f64::from(u8::from(is_available)));
        for (severity, label) in SEVERITIES {
            let count = state.conditions.iter().filter(|condition| condition.severity() == severity).count();
            alarms.with_label_values(&[machine, label]).set(i64::try_from(count).unwrap_or(i64::MAX));
        }
    }
    for (name, help, value) in FIGURES {
        let figure = gauge(&registry, name, help);
        for state in shown.clone().filter(|state| state.availability() == Availability::Available) {
            let value = state.run.as_ref().and_then(value).filter(|value| value.is_finite());
            if let Some(value) = value {
                figure.with_label_values(&[machine_of(state)]).set(value);
            }
        }
    }
    registry.gather()
}

fn machine_of(state: &MachineState) -> &str {
    state.machine.strip_prefix("machines/").unwrap_or(&state.machine)
}

fn gauge(registry: &Registry, name: &str, help: &str) -> GaugeVec {
    super::Registrar(registry.clone()).add(GaugeVec::new(Opts::new(name, help), &["machine"]))
}

fn counts(registry: &Registry, name: &str, help: &str, label: &str) -> IntGaugeVec {
    super::Registrar(registry.clone()).add(IntGaugeVec::new(Opts::new(name, help), &["machine", label]))
}

#[cfg(test)]
mod tests {
    use feedwave_contract::proto::{MachineCondition, Overrides, ProcessProperty, RunProgress};
    use prometheus::{Encoder as _, TextEncoder};

    use super::*;

    fn text(states: &[MachineState]) -> String {
        let mut text = Vec::new();
        TextEncoder::new().encode(&gather(states.iter()), &mut text).unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn figures_are_in_base_units_and_only_there_while_they_are_current() {
        let process = ProcessReading {
            property: ProcessProperty::Deviation.into(),
            lower: 0.003,
            upper: 0.01,
            max_deviation: 0.0125,
            deviation_unit: "mm".to_owned(),
            ..Default::default()
        };
        let run = RunActivity {
            overrides: Some(Overrides { feed: 0.81, spindle: 1.0 }),
            progress: Some(RunProgress { ratio: 0.25, ..Default::default() }),
            process: Some(process),
            ..Default::default()
        };
        let mut state = MachineState {
            machine: "machines/lathe".to_owned(),
            availability: Availability::Available.into(),
            execution: Execution::Running.into(),
            run: Some(run),
            conditions: vec![MachineCondition { severity: ConditionSeverity::Fault.into(), ..Default::default() }],
            ..Default::default()
        };
        let shown = text(std::slice::from_ref(&state));
        for line in [
            "feedwave_machine_state{machine=\"lathe\",state=\"running\"} 1",
            "feedwave_machine_state{machine=\"lathe\",state=\"held\"} 0",
            "feedwave_machine_feed_override_ratio{machine=\"lathe\"} 0.81",
            "feedwave_machine_progress_ratio{machine=\"lathe\"} 0.25",
            "feedwave_machine_deflection_meters{machine=\"lathe\"} 0.0000125",
            "feedwave_machine_deflection_upper_limit_meters{machine=\"lathe\"} 0.00001",
            "feedwave_machine_alarms{machine=\"lathe\",severity=\"fault\"} 1",
            "feedwave_machine_available{machine=\"lathe\"} 1",
        ] {
            assert!(shown.lines().any(|known| known == line), "{line} is not in\n{shown}");
        }
        assert!(!shown.contains("vibration_hertz{") && !shown.contains("remaining_seconds{"), "{shown}");
        state.set_availability(Availability::Unavailable);
        let gone = text(&[state]);
        assert!(gone.contains("feedwave_machine_state{") && !gone.contains("_ratio{"), "{gone}");
    }

    #[test]
    fn clients_cannot_grow_the_answer_without_end() {
        let machine = |number| MachineState { machine: format!("machines/m{number}"), ..Default::default() };
        let states: Vec<_> = (0..2 * MAX_MACHINES).map(machine).collect();
        let lines = text(&states).lines().filter(|line| line.starts_with("feedwave_machine_available{")).count();
        assert_eq!(lines, MAX_MACHINES);
    }
}
