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
      What has come since. What is in progress has no endTime, and its result comes into the same entry: export again from
      before the first of them to have it.
  feedwave audit --principal planning | jq -r 'select(.result == \"PERMISSION_DENIED\") | .method'
      What the client planning was refused.")]
pub struct Args {
    #[command(flatten)]
    server: ServerArgs,
    /// Only entries after this sequence number
    #[arg(long, value_name = "SEQUENCE", default_value_t = 0)]
    after: u64,
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
    let mut request =
        ListAuditEntriesRequest { after: args.after, page_size: PAGE, principal: args.principal, ..Default::default() };
    loop {
        let page = client.audit().list_audit_entries(request.clone()).await;
        let page = page.map_err(|status| client.failed(&status))?.into_inner();
        for entry in &page.entries {
            print(&format!("{}\n", json::to_string(entry)))?;
        }
        // What is removed meanwhile is passed over, as by a cursor and not by a place in a page.
        match page.entries.last() {
            Some(last) if !page.next_page_token.is_empty() => request.after = last.sequence,
            _ => return Ok(ExitCode::SUCCESS),
        }
    }
}
