//! `feedwave decisions`: the decisions of a job or a run.

use std::process::ExitCode;

use feedwave_contract::json;
use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::{
    Decision, DecisionReason, EscalationAction, GetJobRequest, GetRunRequest, HoldReason, ListDecisionsRequest,
    ListDecisionsResponse, OverrideBound, Overrides,
};

use super::CliError;
use super::client::{Client, ServerArgs};
use super::resources::full_name;
use super::terminal::print;
use super::validate::Format;

/// Decisions asked for at a time.
const PAGE: i32 = 500;

/// Arguments of `feedwave decisions`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 all shown, 2 wrong usage, no such job or run, or no answer.

Examples:
  feedwave decisions jobs/0197b3c2-…
      One line per decision: what was seen, the reason, and the overrides before and after.
  feedwave decisions runs/0197b3c2-… --format json | jq '.inputs.process.maxDeviation'
      One JSON object per decision, with everything it depended on.")]
pub struct Args {
    /// The job or run, `jobs/{job}` or `runs/{run}`
    #[arg(value_name = "JOB")]
    of: String,
    #[command(flatten)]
    server: ServerArgs,
    /// Form of the output; JSON has one object per line
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

/// Shows them.
///
/// # Errors
/// [`CliError`] when the service does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let mut listed = page(&client, &args.of, 0).await?;
    if listed.decisions.is_empty() {
        ask_for(&client, &args.of).await?;
    }
    if args.format == Format::Text {
        print(&format!("{}\n", heading()))?;
    }
    loop {
        for decision in &listed.decisions {
            match args.format {
                Format::Text => print(&format!("{}\n", line(decision)))?,
                Format::Json => print(&format!("{}\n", json::to_string(decision)))?,
            }
        }
        let last = listed.decisions.last().filter(|_| !listed.next_page_token.is_empty());
        let Some(after) = last.map(|last| last.sequence) else { return Ok(ExitCode::SUCCESS) };
        listed = page(&client, &args.of, after).await?;
    }
}

/// Fails where there is no such job or run. Of one that has been deleted decisions may be there all the same.
async fn ask_for(client: &Client, of: &str) -> Result<(), CliError> {
    let name = full_name("jobs", of);
    let answer = if name.starts_with("runs/") {
        client.telemetry().get_run(GetRunRequest { name }).await.map(drop)
    } else {
        client.jobs.clone().get_job(GetJobRequest { name }).await.map(drop)
    };
    answer.map_err(|status| client.failed(&status))
}

/// Decisions of a job or run after a place in the log.
pub(super) async fn page(client: &Client, of: &str, after: u64) -> Result<ListDecisionsResponse, CliError> {
    let name = full_name("jobs", of);
    let (job, run) = if name.starts_with("runs/") { (String::new(), name) } else { (name, String::new()) };
    let request = ListDecisionsRequest { after, page_size: PAGE, page_token: String::new(), job, run };
    let response = client.telemetry().list_decisions(request).await;
    Ok(response.map_err(|status| client.failed(&status))?.into_inner())
}

pub(super) fn heading() -> String {
    format!("{:>6}  {:>12}  {:>12}  {:>15}  {:>15}  reason", "number", "time s", "deviation", "feed %", "spindle %")
}

/// A decision as a line for people.
pub(super) fn line(decision: &Decision) -> String {
    let inputs = decision.inputs.clone().unwrap_or_default();
    let outcome = decision.outcome.unwrap_or_default();
    let deviation = match &inputs.evidence {
        Some(Evidence::Process(process)) => format!("{:.6}", process.max_deviation),
        Some(Evidence::IdleCheck(check)) => format!("{:.6}", check.difference),
        _ => "-".to_owned(),
    };
    let change = |of: fn(&Overrides) -> f64| {
        let percent = |overrides: Option<Overrides>| overrides.map_or(f64::NAN, |overrides| 100.0 * of(&overrides));
        let (before, after) = (percent(inputs.before), percent(outcome.after));
        if before == after { format!("{after:.1}") } else { format!("{before:.1} → {after:.1}") }
    };
    let bound = |bound: OverrideBound, what: &str| match bound {
        OverrideBound::Unspecified => String::new(),
        OverrideBound::Lower => format!(", lower bound of the {what}"),
        OverrideBound::Upper => format!(", upper bound of the {what}"),
    };
    let hold = match outcome.hold_reason() {
        HoldReason::Unspecified => String::new(),
        reason => format!(": {}", words(reason.as_str_name(), "HOLD_REASON_")),
    };
    let escalation = inputs.rules.as_ref().and_then(|rules| rules.escalation);
    let is_off = escalation.is_some_and(|escalation| escalation.action() == EscalationAction::Off);
    let off = if is_off { ", escalation off" } else { "" };
    let reason = words(outcome.reason().as_str_name(), "DECISION_REASON_");
    let action = match outcome.reason() {
        DecisionReason::Data => "hold, ".to_owned(),
        _ => format!("{}, ", words(outcome.action().as_str_name(), "DECISION_ACTION_")),
    };
    format!(
        "{:>6}  {:>12.3}  {deviation:>12}  {:>15}  {:>15}  {action}{reason}{hold}{}{}{off}",
        decision.number,
        decision.sensor_time_ns as f64 * 1e-9,
        change(|overrides| overrides.feed),
        change(|overrides| overrides.spindle),
        bound(outcome.feed_bound(), "feed"),
        bound(outcome.spindle_bound(), "spindle"),
    )
}

/// The name of an enumeration's value as words.
fn words(name: &str, prefix: &str) -> String {
    name.trim_start_matches(prefix).to_lowercase().replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use feedwave_contract::proto::{DecisionAction, DecisionInputs, DecisionOutcome, ProcessEvidence};

    #[test]
    fn a_line_says_what_was_seen_and_what_follows() {
        let overrides = |feed| Some(Overrides { feed, spindle: 1.0 });
        let decision = Decision {
            number: 7,
            sensor_time_ns: 2_500_000_000,
            inputs: Some(DecisionInputs {
                evidence: Some(Evidence::Process(ProcessEvidence { max_deviation: 0.012, ..Default::default() })),
                before: overrides(1.0),
                ..Default::default()
            }),
            outcome: Some(DecisionOutcome {
                action: DecisionAction::Change.into(),
                reason: DecisionReason::FeedAboveLimit.into(),
                after: overrides(0.95),
                ..Default::default()
            }),
            ..Default::default()
        };
        let words: Vec<_> = line(&decision).split_whitespace().map(str::to_owned).collect();
        assert_eq!(words.join(" "), "7 2.500 0.012000 100.0 → 95.0 100.0 change, feed above limit");
    }
}
