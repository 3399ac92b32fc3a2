//! The `feedwave` binary: runs the command line.

use std::io::Write as _;
use std::process::ExitCode;

use clap::{Command, CommandFactory as _, FromArgMatches as _};
use feedwave::args::Cli;
use feedwave::commands::CliError;

/// Every setpoint stream and every validation holds a thread while it runs. Threads are made when needed; this is
/// above what the configuration can permit.
const MAX_BLOCKING_THREADS: usize = 16_384;

/// A negative number is the value of its option, which says what is wrong with it; it is no unknown option.
fn numbers_may_be_negative(command: Command) -> Command {
    command.allow_negative_numbers(true).mut_subcommands(numbers_may_be_negative)
}

fn main() -> ExitCode {
    let arguments = numbers_may_be_negative(Cli::command()).get_matches();
    let cli = Cli::from_arg_matches(&arguments).unwrap_or_else(|error| error.exit());
    let runtime =
        tokio::runtime::Builder::new_multi_thread().enable_all().max_blocking_threads(MAX_BLOCKING_THREADS).build();
    let ended = match runtime {
        Ok(runtime) => {
            let ended = runtime.block_on(cli.command.run(&cli.global));
            // What still runs waits for a disk that does not answer.
            runtime.shutdown_background();
            ended
        }
        Err(error) => Err(CliError::new(error)),
    };
    match ended {
        Ok(code) => code,
        Err(error) => {
            // Nothing can be done where even this cannot be written.
            let _ = writeln!(std::io::stderr(), "feedwave: {error}");
            error.code()
        }
    }
}
