//! The subcommands for people at a terminal.
//!
//! Invariants: what a program is judged by and turned into comes from the same crates as in the service; memory
//! does not grow with the program; results go to standard output and everything else to standard error; a reader
//! that stops reading (`| head`) ends a command quietly.

mod acknowledge;
mod audit;
mod called;
mod client;
mod data_file;
pub mod database;
mod decisions;
mod demo;
mod findings;
pub mod healthcheck;
mod improve;
mod installation;
mod interpret;
mod learn;
mod lobes;
mod local;
mod lsp;
mod machine;
mod offsets;
mod overrides;
mod pictures;
mod plan;
mod replay;
mod report;
mod resources;
mod robustness;
mod run;
pub mod serve;
mod source;
mod stability;
mod stream;
mod submit;
mod terminal;
mod thread_plan;
mod token;
mod tool_oscillation;
mod tools;
mod validate;
mod watch;

use std::io;
use std::path::Path;
use std::process::ExitCode;

use clap::Subcommand;
use feedwave_server::config::{ConfigError, EXIT_CONFIG};

/// Exit code of a command that found errors in the program.
const EXIT_REFUSED: u8 = 1;
/// Exit code of a command that could not do its work: wrong usage, files, connections.
const EXIT_TROUBLE: u8 = 2;

/// What people do at a terminal.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check a program: findings under the source line, chip breaking, times
    ///
    /// Shows everything found, each finding under its source line with the suggested cure, then for every section with
    /// vibration along the path whether the chip breaks and whether the machine can follow, then times and extents.
    Validate(validate::Args),
    /// Change a program so that every chip breaks, and that it takes less time
    ///
    /// For every block that switches vibration along the path on, finds the frequency with which the least amplitude breaks every
    /// chip of its sections: with a margin, up to the largest feed override, within a tolerance of the spindle speed, and within
    /// the limits of the axes. Threading passes get the amplitude or phase that their findings name; feeds, spindle speeds and
    /// tolerances change only where an option permits it. Writes the changed words as a unified diff, and says each change's
    /// reason and gain; what comes out is validated again. The program itself is never written.
    Improve(improve::Args),
    /// Turn a program into a file of setpoints, and into pictures
    ///
    /// Writes one row per interpolation period: index, time, each axis, path position, feed, vibration offset, spindle
    /// angle, source line; the header says the units. A program with errors is refused, and no file appears.
    Plan(plan::Args),
    /// Judge how surely chips break when speed, feed and amplitude are known within tolerances only
    ///
    /// For every vibrating section the worst case and the share of all values within the tolerances for which the chip breaks, and
    /// with the lobes of a tool and a depth how surely the cut is stable; with --out a map of speed and feed for each section.
    Robustness(robustness::Args),
    /// Show what a program means: every action, fully resolved
    ///
    /// Carries out every modal state, expression, loop, call, cycle, offset and compensation, and writes one action for each
    /// motion, dwell, spindle and tool change in its order. Nothing is planned; actions end before the first error.
    Interpret(interpret::Args),
    /// Plan the passes of a thread so that its chip breaks, as a program
    ///
    /// Finds depths, amplitudes and phases with which the vibration across the lead breaks the chip in both models, depth only and
    /// full section, within the limits of the machine and the tool, and leaves the finishing pass no more than it may find.
    /// What cannot be cut so is refused with the numbers and what would help.
    ThreadPlan(thread_plan::Args),
    /// Find the spindle speeds at which a tool cuts deepest without chatter
    ///
    /// Computes stability lobes of milling or turning from the modes of the tool, of the command line or of the tool library
    /// of a running service, and from them the best speed of every band: the spindle table of the monitoring.
    Lobes(lobes::Args),
    /// Learn cutting forces, run-out and natural frequencies from runs, for the tool library
    ///
    /// Estimates them by least squares from the steady cuts that runs kept (`feedwave run --record`), each with its uncertainty,
    /// and shows what was used and left out, what the tool would become, and which spindle table would follow. Nothing is changed
    /// without --adopt.
    Learn(learn::Args),
    /// Send a program to a running service and show what it found
    ///
    /// The job is stored durably before the service answers. Small programs travel with the request; larger ones are
    /// uploaded, and a broken upload continues where it ended. With --wait the validation report is shown as `feedwave
    /// validate` would.
    Submit(submit::Args),
    /// Read the setpoints of a job from a running service
    ///
    /// Writes CSV to standard output, or a file. When the connection breaks, the stream is taken up at the next setpoint:
    /// values do not depend on where a stream starts, so the result is the same to the last bit.
    Stream(stream::Args),
    /// Run a job on a simulated machine, whose telemetry changes its feed
    ///
    /// The machine follows the setpoints that the service hands out, and what its sensors say goes back on the same stream.
    /// Decisions are shown as they are made; at last the feed override over time and how the run ended.
    Run(run::Args),
    /// See what the machines of a service do now, and its newest jobs
    ///
    /// On a terminal a screen that is drawn anew each second; otherwise a line for each machine, and for each change of one. When
    /// the service does not answer, it says for how long, and that what it shows is old.
    Watch(watch::Args),
    /// Show the decisions of a job or a run
    ///
    /// One line per decision in the order in which they were made: when on the sensors' clock, the deviation, feed and
    /// spindle overrides before and after, and the reason.
    Decisions(decisions::Args),
    /// Acknowledge a condition of a run
    ///
    /// A decision that holds the feed or stops the machine, because a property stays above its limit at the lower feed bound,
    /// raises a condition that dashboards show until it is acknowledged. The feed stays held until the machine resumes.
    Acknowledge(acknowledge::Args),
    /// Write the audit log of a running service as lines of JSON
    ///
    /// Every call that changed something, and every request that was refused for want of rights: who, what, when, from where,
    /// and what came of it. Needs the role admin.
    Audit(audit::Args),
    /// Prove that a run can be made again from its log
    ///
    /// The service makes every decision again from its stored inputs, and every setpoint from the stored program, profile
    /// and changes of the feed, and compares them with what was sent, to the last bit.
    Replay(replay::Args),
    /// Show, upload and delete machines of a running service
    Machine(resources::machines::Args),
    /// Show, upload and delete tools of a running service
    Tool(resources::tools::Args),
    /// Show, read and delete programs of a running service
    Program(resources::programs::Args),
    /// Show, cancel and delete jobs of a running service
    Job(resources::jobs::Args),
    /// Make a token for a client of the service
    ///
    /// Writes a new random token to standard output, once: the service keeps its hash alone, in the file of known clients
    /// (auth.clients), to which --clients adds it. The service takes a changed file over within 10 s, or on SIGHUP.
    Token(token::Args),
    /// Serve an editor: findings as one types, hover, quick fixes, times
    ///
    /// Speaks the language server protocol on standard input and output. A program is judged as by `feedwave validate`, in every
    /// version as a whole; a judgement ends when a newer version comes.
    Lsp(lsp::Args),
    /// Write the completions of a shell to standard output
    Completions(installation::CompletionArgs),
    /// Write manual pages, one for each command
    Man(installation::ManArgs),
    /// See all of it work: a server, a turning program, the trap and its cure, pictures
    ///
    /// Starts the service on free ports with a temporary database, sends it a turning program through a real client,
    /// shows a vibration that never breaks the chip being caught and cured, streams the setpoints, takes a stream up in the
    /// middle, lets a milling tool oscillate, and draws pictures. Every claim is checked; the exit code is 0 only if all of
    /// them hold.
    Demo(demo::Args),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// [`CliError`] with what to tell the user and the exit code.
    pub async fn run(self) -> Result<ExitCode, CliError> {
        let result = match self {
            Self::Validate(args) => validate::run(args),
            Self::Improve(args) => improve::run(&args),
            Self::Plan(args) => plan::run(args),
            Self::Robustness(args) => robustness::run(&args),
            Self::Interpret(args) => interpret::run(args),
            Self::ThreadPlan(args) => thread_plan::run(args),
            Self::Lobes(args) => lobes::run(args).await,
            Self::Learn(args) => learn::run(args).await,
            Self::Submit(args) => submit::run(args).await,
            Self::Stream(args) => stream::run(args).await,
            Self::Run(args) => run::run(args).await,
            Self::Watch(args) => watch::run(args).await,
            Self::Decisions(args) => decisions::run(args).await,
            Self::Acknowledge(args) => acknowledge::run(args).await,
            Self::Audit(args) => audit::run(args).await,
            Self::Replay(args) => replay::run(args).await,
            Self::Machine(args) => resources::machines::run(args).await,
            Self::Tool(args) => resources::tools::run(args).await,
            Self::Program(args) => resources::programs::run(args).await,
            Self::Job(args) => resources::jobs::run(args).await,
            Self::Token(args) => token::run(&args),
            Self::Lsp(args) => lsp::run(&args),
            Self::Completions(args) => installation::completions(&args),
            Self::Man(args) => installation::man(&args),
            Self::Demo(args) => demo::run(args).await,
        };
        match result {
            Err(error) if error.exit_code == 0 => Ok(ExitCode::SUCCESS),
            other => other,
        }
    }
}

/// Has this process make files and folders that nobody but its user can read: databases and their copies hold the programs of all
/// tenants. What exists keeps its mode.
fn make_files_private() {
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
}

/// Why a subcommand failed: message and exit code.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct CliError {
    /// What went wrong, for people.
    pub message: String,
    /// Exit code of the process.
    pub exit_code: u8,
}

impl CliError {
    /// An error with exit code 1.
    pub fn new(message: impl ToString) -> Self {
        Self { message: message.to_string(), exit_code: 1 }
    }

    /// Wrong usage, or a file or connection that cannot be used: exit code 2.
    pub(crate) fn trouble(message: impl ToString) -> Self {
        Self { message: message.to_string(), exit_code: EXIT_TROUBLE }
    }

    /// A file that cannot be used.
    pub(crate) fn file(path: &Path, error: &io::Error) -> Self {
        Self::written(&path.display().to_string(), error)
    }

    /// Output that cannot be written. A reader that has gone is no error.
    pub(crate) fn written(place: &str, error: &io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Self { message: String::new(), exit_code: 0 };
        }
        Self::trouble(format!("{place}: {}", reason(error)))
    }

    /// The exit code as the process returns it.
    #[must_use]
    pub fn code(&self) -> ExitCode {
        ExitCode::from(self.exit_code)
    }
}

/// The system's words without its error number, in lower case.
fn reason(error: &io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default();
    let mut letters = text.chars();
    letters.next().map(|first| first.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

impl From<ConfigError> for CliError {
    fn from(error: ConfigError) -> Self {
        Self { message: error.to_string(), exit_code: EXIT_CONFIG }
    }
}
