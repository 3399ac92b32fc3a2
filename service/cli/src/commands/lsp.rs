//! `feedwave lsp`: a language server on standard input and output.
//!
//! Three threads: one reads messages, one judges documents, one answers questions; the main one keeps the documents and writes.
//! A document is judged as a whole in every version, and given up as soon as a newer one comes. Sizes and counts are bounded.

mod answers;
mod callers;
mod document;
mod hover;
mod input;
mod judge;
mod places;
mod server;
mod setup;
mod syntax;
mod transport;
mod uris;

use std::process::ExitCode;

use super::CliError;

/// Arguments of `feedwave lsp`.
#[derive(Clone, Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 after shutdown and exit, 1 where the editor goes without them, 2 where the stream breaks.

The machine, tools, offsets and further files of a program are the options of feedwave validate: from the table [validate] of the
nearest feedwave.toml from the program's directory up to that of the workspace, or from the editor's setting feedwave.options."
)]
pub struct Args {
    /// The messages come on standard input, as they always do; editors say so
    #[arg(long)]
    stdio: bool,
}

/// Serves until the editor goes.
///
/// # Errors
/// [`CliError`] when the stream breaks.
pub(super) fn run(args: &Args) -> Result<ExitCode, CliError> {
    let Args { stdio: _ } = args;
    server::run()
}
