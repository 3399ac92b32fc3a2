//! What an installation brings along besides the binary: completions of shells, and manual pages. Both are made from the
//! same description of the command line as its help.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::CommandFactory as _;
use clap_complete::Shell;

use super::CliError;
use super::terminal::{print, tell};
use crate::args::Cli;

/// Arguments of `feedwave completions`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = "Examples:
  feedwave completions bash > ~/.local/share/bash-completion/completions/feedwave
  feedwave completions zsh > ~/.zfunc/_feedwave
      With ~/.zfunc in fpath before compinit.
  feedwave completions fish > ~/.config/fish/completions/feedwave.fish
  feedwave completions powershell >> $PROFILE")]
pub struct CompletionArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    shell: Shell,
}

/// Writes the completions of a shell to standard output.
pub(super) fn completions(args: &CompletionArgs) -> Result<ExitCode, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "feedwave", &mut script);
    print(&String::from_utf8(script).map_err(CliError::trouble)?)?;
    Ok(ExitCode::SUCCESS)
}

/// Arguments of `feedwave man`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = "Examples:
  feedwave man ~/.local/share/man/man1 && man feedwave-validate")]
pub struct ManArgs {
    /// Directory for the pages, made where it is not there: feedwave.1, feedwave-validate.1 and so on
    #[arg(value_name = "DIRECTORY")]
    directory: PathBuf,
}

/// Writes a manual page for the binary and each of its subcommands.
pub(super) fn man(args: &ManArgs) -> Result<ExitCode, CliError> {
    let directory = &args.directory;
    std::fs::create_dir_all(directory).map_err(|error| CliError::file(directory, &error))?;
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let count = write_pages(directory, &command)?;
    tell(&format!("{count} pages in {}\n", directory.display()));
    Ok(ExitCode::SUCCESS)
}

/// The page of a command and those of its subcommands; returns how many.
fn write_pages(directory: &Path, command: &clap::Command) -> Result<u32, CliError> {
    // `feedwave-job-list`: the name of a page is a word, that of the command several.
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let mut page = Vec::new();
    let described = clap_mangen::Man::new(command.clone()).title(name.to_uppercase()).manual("feedwave");
    described.render(&mut page).map_err(CliError::trouble)?;
    let path = directory.join(format!("{name}.1"));
    std::fs::write(&path, page).map_err(|error| CliError::file(&path, &error))?;
    let further = command.get_subcommands().filter(|further| !further.is_hide_set());
    further.map(|further| write_pages(directory, further)).sum::<Result<u32, _>>().map(|further| further + 1)
}
