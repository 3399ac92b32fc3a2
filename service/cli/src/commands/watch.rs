//! `feedwave watch`: what the machines of a service do now, and its newest jobs, in the terminal.

mod screen;

use std::collections::HashMap;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use console::Term;
use feedwave_contract::json;
use feedwave_contract::proto::{Job, ListJobsRequest, ListStatesRequest, MachineState};
use tonic::{Code, Status};

use self::screen::{Seen, machine_line, screen};
use super::CliError;
use super::client::{Client, ServerArgs, is_passing};
use super::terminal::{Style, print, tell};
use super::validate::Format;

/// States asked for at a time.
const PAGE: i32 = 500;
/// Most machines that are asked for: what no screen shows.
const MAX_MACHINES: usize = 10_000;
/// Jobs that are shown.
const JOBS: i32 = 10;
/// How long an answer may take. Longer, and what is shown is old.
const PATIENCE: Duration = Duration::from_secs(3);
/// Screen of a terminal that does not say its size.
const USUAL_SIZE: (u16, u16) = (24, 100);

/// Arguments of `feedwave watch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 ended by the user, or shown once; 2 wrong usage or no answer.

Examples:
  feedwave watch
      A screen that is drawn anew each second, until Ctrl+C.
  feedwave watch --once
      The machines as they are now.
  feedwave watch --format json | jq 'select(.execution == \"EXECUTION_HELD\")'
      One JSON object for each change of a machine.")]
pub struct Args {
    #[command(flatten)]
    server: ServerArgs,
    /// Seconds from one look to the next, 0.1 to 60
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = interval)]
    interval: Duration,
    /// Show what is now, and end
    #[arg(long)]
    once: bool,
    /// Form of the output; JSON has one object per line, the state of a machine
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

fn interval(text: &str) -> Result<Duration, String> {
    let seconds = text.trim().parse::<f64>().ok().filter(|seconds| (0.1..=60.0).contains(seconds));
    seconds.map(Duration::from_secs_f64).ok_or_else(|| "must be a number of seconds from 0.1 to 60".to_owned())
}

/// Shows it.
///
/// # Errors
/// [`CliError`] when the service does not answer at first, refuses, or the output cannot be written.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    if args.once {
        return once(&client, args.format).await;
    }
    let term = Term::stdout();
    if args.format == Format::Text && term.is_term() {
        return on_screen(&client, &args, &term).await;
    }
    tokio::select! {
        ended = changes(&client, &args) => ended,
        _ = tokio::signal::ctrl_c() => Ok(ExitCode::SUCCESS),
    }
}

async fn once(client: &Client, format: Format) -> Result<ExitCode, CliError> {
    let seen = look(client).await.map_err(|status| client.failed(&status))?;
    match format {
        Format::Json => {
            for state in &seen.machines {
                print(&format!("{}\n", json::to_string(state)))?;
            }
        }
        Format::Text => {
            let lines = screen(&seen, &client.url, None, Style::stdout());
            print(&format!("{}\n", lines.join("\n")))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A line for each machine at first, and for each change.
async fn changes(client: &Client, args: &Args) -> Result<ExitCode, CliError> {
    let mut shown: HashMap<String, String> = HashMap::new();
    let mut last_answer = Instant::now();
    let mut is_away = false;
    loop {
        match look(client).await {
            Ok(seen) => {
                if std::mem::take(&mut is_away) {
                    tell(&format!("{} answers again after {} s\n", client.url, last_answer.elapsed().as_secs()));
                }
                last_answer = Instant::now();
                shown.retain(|name, _| seen.machines.iter().any(|state| &state.machine == name));
                for state in &seen.machines {
                    let line = match args.format {
                        Format::Json => json::to_string(state),
                        Format::Text => machine_line(state),
                    };
                    if shown.get(&state.machine) != Some(&line) {
                        print(&format!("{line}\n"))?;
                        shown.insert(state.machine.clone(), line);
                    }
                }
            }
            Err(status) => {
                give_up(client, &status, last_answer)?;
                if !std::mem::replace(&mut is_away, true) {
                    let seconds = SILENCE.as_secs();
                    tell(&format!("{} does not answer: {}; trying for {seconds} s\n", client.url, status.message()));
                }
            }
        }
        tokio::time::sleep(args.interval).await;
    }
}

/// How long whoever reads changes is left without any before the command ends.
const SILENCE: Duration = Duration::from_secs(60);

fn give_up(client: &Client, status: &Status, last_answer: Instant) -> Result<(), CliError> {
    if is_passing(status) && last_answer.elapsed() < SILENCE { Ok(()) } else { Err(client.failed(status)) }
}

async fn on_screen(client: &Client, args: &Args, term: &Term) -> Result<ExitCode, CliError> {
    let written = |error: std::io::Error| CliError::written("standard output", &error);
    // A screen of its own, so that what was there comes back.
    term.write_str("\u{1b}[?1049h").and_then(|()| term.hide_cursor()).map_err(written)?;
    let ended = tokio::select! {
        ended = draw(client, args, term) => ended,
        _ = tokio::signal::ctrl_c() => Ok(()),
    };
    let restored = term.show_cursor().and_then(|()| term.write_str("\u{1b}[?1049l"));
    ended?;
    restored.map_err(written)?;
    Ok(ExitCode::SUCCESS)
}

/// Draws until there is an error that does not pass.
async fn draw(client: &Client, args: &Args, term: &Term) -> Result<(), CliError> {
    let mut seen = Seen::default();
    let mut last_answer = Instant::now();
    loop {
        let trouble = match look(client).await {
            Ok(now) => {
                seen = now;
                last_answer = Instant::now();
                None
            }
            Err(status) if is_passing(&status) => Some((last_answer.elapsed(), status.message().to_owned())),
            Err(status) => return Err(client.failed(&status)),
        };
        let (rows, columns) = term.size_checked().unwrap_or(USUAL_SIZE);
        let mut lines = screen(&seen, &client.url, trouble.as_ref().map(|it| (it.0, it.1.as_str())), Style::stdout());
        let room = usize::from(rows.max(2)) - 1;
        if lines.len() > room {
            let hidden = lines.len() + 1 - room;
            lines.truncate(room - 1);
            lines.push(format!("… {hidden} more lines"));
        }
        let mut text = String::from("\u{1b}[H");
        for line in &lines {
            text += &console::truncate_str(line, usize::from(columns), "…");
            text += "\u{1b}[K\r\n";
        }
        text += "\u{1b}[J";
        print(&text)?;
        tokio::time::sleep(args.interval).await;
    }
}

/// What the service says now.
async fn look(client: &Client) -> Result<Seen, Status> {
    let late = |_| Status::new(Code::Unavailable, format!("no answer within {} s", PATIENCE.as_secs()));
    tokio::time::timeout(PATIENCE, async { Ok(Seen { machines: machines(client).await?, jobs: jobs(client).await? }) })
        .await
        .map_err(late)?
}

async fn machines(client: &Client) -> Result<Vec<MachineState>, Status> {
    let mut states = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = ListStatesRequest { page_size: PAGE, page_token };
        let page = client.machines().list_states(request).await?.into_inner();
        states.extend(page.states);
        if page.next_page_token.is_empty() || states.len() >= MAX_MACHINES {
            return Ok(states);
        }
        page_token = page.next_page_token;
    }
}

async fn jobs(client: &Client) -> Result<Vec<Job>, Status> {
    let request = ListJobsRequest { page_size: JOBS, ..ListJobsRequest::default() };
    Ok(client.jobs.clone().list_jobs(request).await?.into_inner().jobs)
}
