//! `feedwave acknowledge`: acknowledges a condition of a run, such as a held feed.

use std::process::ExitCode;

use feedwave_contract::proto::AcknowledgeConditionRequest;

use super::CliError;
use super::client::ServerArgs;
use super::terminal::print;

/// Arguments of `feedwave acknowledge`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 acknowledged, now or before, 2 wrong usage, no such condition or no answer.

Examples:
  feedwave acknowledge runs/0197b3c2-… --by 'Ada L.' --note 'insert replaced'
      The newest condition of the run. The feed stays held until the machine resumes.")]
pub struct Args {
    /// The run, `runs/{run}` or the part after the slash
    #[arg(value_name = "RUN")]
    run: String,
    /// Who acknowledges
    #[arg(long, value_name = "NAME")]
    by: String,
    /// Anything to be remembered with it
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// Number of the decision that raised the condition; otherwise the newest condition
    #[arg(long, value_name = "NUMBER")]
    decision: Option<u64>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Acknowledges it.
///
/// # Errors
/// [`CliError`] when there is no such condition, or the service does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let run = if args.run.contains('/') { args.run } else { format!("runs/{}", args.run) };
    let request = AcknowledgeConditionRequest {
        run: run.clone(),
        decision_number: args.decision,
        acknowledged_by: args.by,
        note: args.note,
    };
    let answer = client.telemetry().acknowledge_condition(request).await;
    let condition = answer.map_err(|status| client.failed(&status))?.into_inner().condition.unwrap_or_default();
    let (number, by) = (condition.decision_number, condition.acknowledged_by);
    print(&format!("{run}: condition of decision {number}: acknowledged by {by}\n"))?;
    Ok(ExitCode::SUCCESS)
}
