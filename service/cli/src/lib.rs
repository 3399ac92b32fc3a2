//! The command line: one binary, a subcommand for each thing it does, with files of setpoints ([`output`]) and
//! pictures ([`plot`]).

pub mod args;
mod client_tls;
pub mod commands;
pub mod output;
pub mod plot;
