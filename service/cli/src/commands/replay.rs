//! `feedwave replay`: compares a run with what its log gives.

use std::process::ExitCode;

use feedwave_contract::proto::{ReplayRunRequest, ReplayRunResponse};

use super::client::ServerArgs;
use super::terminal::{Style, print, print_json};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED};

/// Arguments of `feedwave replay`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 identical, 1 something differs, 2 wrong usage or no answer.

Examples:
  feedwave replay runs/0197b3c2-…
  feedwave replay runs/0197b3c2-… --from 30000000
      Proves the end of a run of hours only, from the checkpoint before setpoint 30 000 000.
  feedwave decisions \"$job\" | tail -1
      Names the run of the last decision.")]
pub struct Args {
    /// The run, `runs/{run}` or the part after the slash
    #[arg(value_name = "RUN")]
    run: String,
    /// Generate setpoints from the run's last checkpoint at or before this one only
    #[arg(long, value_name = "SETPOINT", default_value_t = 0)]
    from: u64,
    #[command(flatten)]
    server: ServerArgs,
    /// Form of the answer
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

/// Replays it.
///
/// # Errors
/// [`CliError`] when the service does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let run = if args.run.contains('/') { args.run } else { format!("runs/{}", args.run) };
    let request = ReplayRunRequest { run: run.clone(), start_index: args.from };
    let replayed = client.runs().replay_run(request).await;
    let replayed = replayed.map_err(|status| client.failed(&status))?.into_inner();
    if args.format == Format::Json {
        print_json(&replayed)?;
    } else {
        print(&text(&run, &replayed))?;
    }
    Ok(if replayed.identical { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

/// The verdict, and what differs.
fn text(run: &str, replayed: &ReplayRunResponse) -> String {
    let style = Style::stdout();
    let first = replayed.first_index;
    let from = if first > 0 { format!(" from {first} on") } else { String::new() };
    let counts = format!("{} decisions and {} setpoints{from}", replayed.decision_count, replayed.setpoint_count);
    if replayed.identical {
        let digest = if replayed.digest.is_empty() { String::new() } else { format!(", SHA-256 {}", replayed.digest) };
        return format!("{run}: {}: {counts}{digest}\n", style.good("identical"));
    }
    let differences = replayed.differences.iter().map(|difference| format!("  {difference}\n"));
    format!("{run}: {} among {counts}\n{}", style.bad("differences"), differences.collect::<String>())
}
