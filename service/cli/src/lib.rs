//! The command line: one binary, a subcommand for each thing it does, with files of setpoints ([`output`]); its pictures are those of
//! `feedwave-plot`.

pub mod args;
mod client_tls;
pub mod commands;
pub mod output;
