//! `feedwave demo`: everything once, with a real server and a real client over TCP, checking what it shows.

mod common;
mod five_axis;
mod live;
mod milling;
mod steps;
mod threading;
mod tool_oscillation;

use std::path::PathBuf;
use std::process::ExitCode;

use super::terminal::{Style, print};
use super::{CliError, EXIT_REFUSED};

/// Arguments of `feedwave demo`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Examples:
  feedwave demo
      Writes to ./feedwave-demo: open feedwave-demo/as-programmed/chip-line-32.png first.
  feedwave demo --out /tmp/demo")]
pub struct Args {
    /// Directory for the pictures, the programs and the setpoints; files of an earlier demo are replaced
    #[arg(long, value_name = "DIRECTORY", default_value = "feedwave-demo")]
    out: PathBuf,
}

/// Shows it.
///
/// # Errors
/// [`CliError`] when the server cannot start or files cannot be written.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    std::fs::create_dir_all(&args.out).map_err(|error| CliError::file(&args.out, &error))?;
    let mut stage = Stage { style: Style::stdout(), step: 0, checks: 0, failed: 0 };
    steps::all(&mut stage, &args.out).await?;
    stage.end()
}

/// Where the demo speaks, and keeps count of what held.
struct Stage {
    style: Style,
    step: u32,
    checks: u32,
    failed: u32,
}

impl Stage {
    /// A new step.
    fn step(&mut self, title: &str) -> Result<(), CliError> {
        self.step += 1;
        print(&format!("\n{}\n", self.style.bold(&format!("{}  {title}", self.step))))
    }

    /// Something to read.
    fn say(&self, text: &str) -> Result<(), CliError> {
        let lines: String = text.lines().map(|line| format!("   {line}").trim_end().to_owned() + "\n").collect();
        print(&lines)
    }

    /// A claim.
    fn check(&mut self, holds: bool, claim: &str) -> Result<(), CliError> {
        self.checks += 1;
        let mark = if holds {
            self.style.good("✓")
        } else {
            self.failed += 1;
            self.style.bad("✗ does not hold:")
        };
        print(&format!("   {mark} {claim}\n"))
    }

    fn end(&self) -> Result<ExitCode, CliError> {
        let (checks, failed) = (self.checks, self.failed);
        if failed > 0 {
            print(&format!("\n{}\n", self.style.bad(&format!("{failed} of {checks} checks failed"))))?;
            return Ok(ExitCode::from(EXIT_REFUSED));
        }
        print(&format!("\n{}\n", self.style.good(&format!("all {checks} checks hold"))))?;
        Ok(ExitCode::SUCCESS)
    }
}
