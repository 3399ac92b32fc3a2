//! The `feedwave` binary: runs the command line.

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;
use feedwave::args::Cli;
use feedwave::commands::CliError;

/// Every setpoint stream and every validation holds a thread while it runs. Threads are made when needed; this is
/// above what the configuration can permit.
const MAX_BLOCKING_THREADS: usize = 16_384;

fn main() -> ExitCode {
    let cli = Cli::parse();
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
