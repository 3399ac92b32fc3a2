//! The lines of the screen, from what the service said.

use std::time::Duration;

use feedwave_contract::proto::{
    Availability, ConditionSeverity, Execution, Job, JobState, MachineCondition, MachineState, RunActivity,
};

use super::super::report::duration;
use super::super::terminal::{Style, count, counted, number};

/// What the service said at one look.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub machines: Vec<MachineState>,
    /// The newest jobs.
    pub jobs: Vec<Job>,
}

/// Widest name that is shown in full.
const NAME_WIDTH: usize = 24;

/// All lines. With `trouble`, how long there has been no answer and why: what was said last is shown faint, as it is old.
pub(super) fn screen(seen: &Seen, url: &str, trouble: Option<(Duration, &str)>, style: Style) -> Vec<String> {
    let mut lines = vec![style.bold(&format!(
        "{}, {} at {}",
        counted(seen.machines.len() as u64, "machine"),
        counted(attention(seen), "condition"),
        printable(url)
    ))];
    if let Some((silence, reason)) = trouble {
        let text = format!("NO ANSWER for {} s ({}): what follows is old", silence.as_secs(), printable(reason));
        lines.push(style.bad(&text));
    }
    let mut body = vec![String::new(), style.faint(&heading())];
    for state in &seen.machines {
        body.push(paint(state, &machine_line(state), style));
        body.extend(state.conditions.iter().map(|condition| condition_line(condition, style)));
    }
    if !seen.jobs.is_empty() {
        body.extend([String::new(), style.faint(&format!("{:NAME_WIDTH$}  {:<11}  newest jobs", "job", "state"))]);
        body.extend(seen.jobs.iter().map(|job| job_line(job, style)));
    }
    if trouble.is_some() {
        body = body.iter().map(|line| style.faint(&console::strip_ansi_codes(line))).collect();
    }
    lines.extend(body);
    lines
}

/// Conditions that nobody has acknowledged.
fn attention(seen: &Seen) -> u64 {
    let open = |condition: &&MachineCondition| condition.acknowledge_time.is_none();
    seen.machines.iter().map(|state| state.conditions.iter().filter(open).count() as u64).sum()
}

fn heading() -> String {
    format!(
        "{:NAME_WIDTH$}  {:<11}  {:>6}  {:>9}  {:>6}  {:>9}  {:>7}  {:>9}  job",
        "machine", "state", "line", "mm/min", "feed %", "spindle %", "done", "left"
    )
}

/// A machine in one line, without colours.
pub(super) fn machine_line(state: &MachineState) -> String {
    let name = match state.display_name.as_str() {
        "" => state.machine.trim_start_matches("machines/"),
        name => name,
    };
    let run = state.run.as_ref();
    let of = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let commanded = run.and_then(|run| run.commanded.as_ref());
    let overrides = run.and_then(|run| run.overrides);
    let progress = run.and_then(|run| run.progress.as_ref());
    let percent = |ratio: f64| number(100.0 * ratio, 4);
    format!(
        "{:NAME_WIDTH$}  {:<11}  {:>6}  {:>9}  {:>6}  {:>9}  {:>7}  {:>9}  {}",
        short(name),
        execution(state),
        of(commanded.map(|it| count(it.line.into()))),
        of(commanded.map(|it| number(it.feed_mm_per_min, 5))),
        of(overrides.map(|it| percent(it.feed))),
        of(overrides.map(|it| percent(it.spindle))),
        of(progress.map(|it| format!("{} %", (100.0 * it.ratio).floor()))),
        of(progress.and_then(|it| it.remaining_s).map(|left_s| duration(left_s.ceil()))),
        run.map_or_else(String::new, job_of),
    )
}

fn job_of(run: &RunActivity) -> String {
    let name = match run.job_display_name.as_str() {
        "" => &run.job,
        name => name,
    };
    printable(name)
}

/// What it does; what cannot be seen is said to be so.
fn execution(state: &MachineState) -> String {
    let name = words(state.execution().as_str_name(), "EXECUTION_");
    let cut = matches!(state.execution(), Execution::Running | Execution::Ready | Execution::Held);
    let unseen = cut && state.availability() != Availability::Available;
    if unseen { format!("{name}?") } else { name }
}

fn paint(state: &MachineState, line: &str, style: Style) -> String {
    match state.execution() {
        Execution::Held | Execution::Interrupted => style.warning(line),
        Execution::Stopped | Execution::Fault => style.bad(line),
        Execution::Running => style.good(line),
        Execution::Idle | Execution::Ready | Execution::Finished | Execution::Unspecified => line.to_owned(),
    }
}

fn condition_line(condition: &MachineCondition, style: Style) -> String {
    let mut text = format!("{:4}{}: {}", "", printable(&condition.code), printable(&condition.message));
    if condition.acknowledge_time.is_some() {
        text += &format!(" (acknowledged by {})", printable(&condition.acknowledged_by));
        return style.faint(&text);
    }
    if condition.needs_acknowledgement
        && let Some(number) = condition.decision_number
    {
        text += &format!(" (feedwave acknowledge {} {number})", printable(&condition.run));
    }
    if condition.severity() == ConditionSeverity::Fault { style.bad(&text) } else { style.warning(&text) }
}

fn job_line(job: &Job, style: Style) -> String {
    let name = if job.display_name.is_empty() { job.name.trim_start_matches("jobs/") } else { &job.display_name };
    let state = words(job.state().as_str_name(), "JOB_STATE_");
    let more = match (&job.validation, &job.summary) {
        (Some(validation), _) if validation.queue_place > 0 => format!("place {} in the queue", validation.queue_place),
        (Some(validation), _) => {
            format!("{} of {} bytes read", count(validation.read_bytes), count(job.program_bytes))
        }
        (None, Some(summary)) if job.state() == JobState::Ready => duration(summary.duration_s),
        _ => printable(&job.state_message),
    };
    let line = format!("{:NAME_WIDTH$}  {state:<11}  {more}", short(name));
    match job.state() {
        JobState::Failed | JobState::Rejected => style.bad(&line),
        _ => line,
    }
}

/// A name as wide as its column: others are cut.
fn short(name: &str) -> String {
    console::truncate_str(&printable(name), NAME_WIDTH, "…").into_owned()
}

/// Text of others without what would change the terminal.
fn printable(text: &str) -> String {
    text.chars().map(|character| if character.is_control() { '\u{fffd}' } else { character }).collect()
}

/// The name of an enumeration's value as words.
fn words(name: &str, prefix: &str) -> String {
    name.trim_start_matches(prefix).to_lowercase().replace('_', " ")
}

#[cfg(test)]
mod tests {
    use feedwave_contract::proto::{CommandedState, Overrides, RunProgress};

    use super::*;

    fn running() -> MachineState {
        MachineState {
            machine: "machines/mill-3".to_owned(),
            display_name: "Mill 3".to_owned(),
            availability: Availability::Available.into(),
            execution: Execution::Running.into(),
            run: Some(RunActivity {
                job_display_name: "housing \u{1b}[31m".to_owned(),
                commanded: Some(CommandedState { line: 1_204, feed_mm_per_min: 1_080.0, ..Default::default() }),
                overrides: Some(Overrides { feed: 0.9, spindle: 1.0 }),
                progress: Some(RunProgress { ratio: 0.999, remaining_s: Some(62.3), ..Default::default() }),
                ..Default::default()
            }),
            ..Default::default()
        }
    }

    fn in_words(line: &str) -> String {
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_line_has_what_the_machine_does_now() {
        assert_eq!(
            in_words(&machine_line(&running())),
            "Mill 3 running 1 204 1080 90 100 99 % 1 min 03 s housing \u{fffd}[31m"
        );
        let idle =
            MachineState { machine: "machines/a".to_owned(), execution: Execution::Idle.into(), ..Default::default() };
        assert_eq!(in_words(&machine_line(&idle)), "a idle - - - - - -");
        let unseen = MachineState { availability: Availability::Unavailable.into(), ..running() };
        assert!(machine_line(&unseen).contains("running?"));
    }

    #[test]
    fn conditions_say_how_they_are_acknowledged() {
        let condition = MachineCondition {
            code: "ABOVE_LIMIT_AT_BOUND".to_owned(),
            severity: ConditionSeverity::Warning.into(),
            message: "0.02 mm is above 0.01 mm".to_owned(),
            decision_number: Some(7),
            run: "runs/r".to_owned(),
            needs_acknowledgement: true,
            ..Default::default()
        };
        let seen = Seen { machines: vec![MachineState { conditions: vec![condition], ..running() }], jobs: Vec::new() };
        let lines = screen(&seen, "http://here", None, Style::plain());
        assert_eq!(lines[0], "1 machine, 1 condition at http://here");
        assert_eq!(lines[4], "    ABOVE_LIMIT_AT_BOUND: 0.02 mm is above 0.01 mm (feedwave acknowledge runs/r 7)");
    }

    #[test]
    fn what_is_old_is_said_to_be_old() {
        let seen = Seen { machines: vec![running()], jobs: Vec::new() };
        let lines = screen(&seen, "http://here", Some((Duration::from_secs(4), "gone")), Style::plain());
        assert_eq!(lines[1], "NO ANSWER for 4 s (gone): what follows is old");
    }

    #[test]
    fn a_job_says_how_far_it_is() {
        let job = Job {
            name: "jobs/j".to_owned(),
            state: JobState::Validating.into(),
            program_bytes: 2_000,
            validation: Some(feedwave_contract::proto::ValidationProgress { read_bytes: 1_500, ..Default::default() }),
            ..Default::default()
        };
        assert_eq!(in_words(&job_line(&job, Style::plain())), "j validating 1 500 of 2 000 bytes read");
    }
}
