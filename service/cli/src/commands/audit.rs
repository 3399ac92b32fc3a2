//! `feedwave audit`: the audit log of a service as lines of JSON.

use std::process::ExitCode;

use feedwave_contract::json;
use feedwave_contract::proto::ListAuditEntriesRequest;

use super::CliError;
use super::client::ServerArgs;
use super::terminal::print;

/// Entries asked for at a time.
const PAGE: i32 = 500;

/// Arguments of `feedwave audit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 all written, 2 wrong usage, no answer, or not an admin.

Examples:
  feedwave audit --token-file admin.token > audit.jsonl
      Everything that is kept, oldest first, one JSON object a line.
  feedwave audit --after $(tail -n 1 audit.jsonl | jq -r .sequence) >> audit.jsonl
      The entries that were made since. What is in progress has no endTime, and its result comes into the same entry.
  feedwave audit --changed-after $(tail -n 1 follow.jsonl | jq -r .change) >> follow.jsonl
      Every entry and every result since, each once: an entry that was written while its call was in progress comes again
      with its result. The first time: --changed-after 0.
  feedwave audit --principal planning | jq -r 'select(.result == \"PERMISSION_DENIED\") | .method'
      What the client planning was refused.")]
pub struct Args {
    #[command(flatten)]
    server: ServerArgs,
    /// Only entries after this sequence number
    #[arg(long, value_name = "SEQUENCE", default_value_t = 0)]
    after: u64,
    /// Only entries that were made or got their results after this change, in the order of their changes
    #[arg(long, value_name = "CHANGE", conflicts_with = "after")]
    changed_after: Option<u64>,
    /// Only what this client asked for, by its name in the file of known clients
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    principal: String,
}

/// Writes them.
///
/// # Errors
/// [`CliError`] when the service does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let mut request = ListAuditEntriesRequest {
        after: args.after,
        changed_after: args.changed_after,
        page_size: PAGE,
        principal: args.principal,
        ..Default::default()
    };
    loop {
        let page = client.audit().list_audit_entries(request.clone()).await;
        let page = page.map_err(|status| client.failed(&status))?.into_inner();
        for entry in &page.entries {
            print(&format!("{}\n", json::to_string(entry)))?;
        }
        // What is removed meanwhile is passed over, as by a cursor and not by a place in a page.
        let Some(last) = page.entries.last().filter(|_| !page.next_page_token.is_empty()) else {
            return Ok(ExitCode::SUCCESS);
        };
        match &mut request.changed_after {
            Some(change) => *change = last.change,
            None => request.after = last.sequence,
        }
    }
}
