//! `feedwave tool`

use std::collections::HashSet;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use feedwave_contract::names;
use feedwave_contract::proto::{
    CreateToolRequest, DeleteToolRequest, GetToolRequest, ListToolsRequest, ListToolsResponse, Tool, UpdateToolRequest,
};
use prost_types::FieldMask;
use tonic::Status;

use super::collection::{self, Collection, DeleteArgs, GetArgs, ListArgs, PAGE, Page};
use super::{card, put, target, time, words};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::terminal::print_json;
use crate::commands::tools::read_library;

/// Arguments of `feedwave tool`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show a tool
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage, no such tool or no answer.")]
    Get(GetArgs),
    /// Show all tools
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage or no answer.

Examples:
  feedwave tool list --format json > tools.json
      A file for `feedwave tool put` and `feedwave validate --tools`.")]
    List(ListArgs),
    /// Replace tools by what a file says, or create them
    ///
    /// The file is that of `--tools`: a list `tools`, or one tool. Every tool in it needs its `name`, but for one alone, which
    /// may be named behind the file. All are checked as the service checks them before anything is sent. A tool with an etag
    /// replaces only the one that has it still. Jobs keep the tools they were created with.
    #[command(
        after_long_help = "Exit codes: 0 all replaced or created, 2 wrong usage, a file or etag that is refused, or no answer.

Examples:
  feedwave tool put tools.toml
      Every tool of the library, one line for each.
  feedwave tool put face-mill.toml face-mill-120"
    )]
    Put {
        /// The file, TOML or JSON
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// The tool, `tools/{tool}` or the part after the slash, where the file has one [default: what the file says]
        #[arg(value_name = "TOOL")]
        name: Option<String>,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Delete a tool; one that is not there is as good as deleted
    ///
    /// Jobs keep the tools they were created with.
    #[command(after_long_help = "Exit codes: 0 deleted or not there, 2 wrong usage, another etag or no answer.")]
    Delete(DeleteArgs),
}

/// Does it.
///
/// # Errors
/// [`CliError`] when the service does not answer or refuses, or a file cannot be used.
pub(in crate::commands) async fn run(args: Args) -> Result<ExitCode, CliError> {
    match args.command {
        Command::Get(args) => collection::get(Tools, args).await,
        Command::List(args) => collection::list(Tools, args).await,
        Command::Put { file, name, server } => {
            let tools = named(&file, name.as_deref())?;
            let client = server.connect().await?;
            for (tool, id) in &tools {
                put_tool(&client, tool, id).await?;
            }
            Ok(ExitCode::SUCCESS)
        }
        Command::Delete(args) => collection::delete(Tools, args).await,
    }
}

/// The tool library of a service.
struct Tools;

impl Collection for Tools {
    const NAME: &'static str = "tools";
    type Resource = Tool;

    async fn get(&self, client: &Client, name: String) -> Result<Tool, Status> {
        let answer = client.tools().get_tool(GetToolRequest { name }).await?;
        Ok(answer.into_inner().tool.unwrap_or_default())
    }

    async fn page(&self, client: &Client, page_token: String) -> Result<Page<Tool>, Status> {
        let page = client.tools().list_tools(ListToolsRequest { page_size: PAGE, page_token }).await?.into_inner();
        Ok(Page { resources: page.tools, next: page.next_page_token, unreachable: page.unreachable })
    }

    async fn delete(&self, client: &Client, name: String, etag: String) -> Result<(), Status> {
        client.tools().delete_tool(DeleteToolRequest { name, etag }).await.map(drop)
    }

    fn card(tool: &Tool) -> String {
        text(tool)
    }

    fn head() -> String {
        format!("{:<28}  {:>6}  {:>10}  {:<10}  name for people", "tool", "number", "length mm", "kind")
    }

    fn line(tool: &Tool) -> String {
        let length = tool.length_mm.map_or("-".to_owned(), |length| length.to_string());
        let kind = words(tool.kind().as_str_name(), "TOOL_KIND_");
        format!("{:<28}  {:>6}  {length:>10}  {kind:<10}  {}", tool.name, tool.number, tool.display_name)
    }

    /// One answer with all pages.
    async fn print_json(&self, client: &Client) -> Result<(), CliError> {
        let mut all = ListToolsResponse::default();
        collection::each_page(self, client, |page| {
            all.tools.extend(page);
            Ok(())
        })
        .await?;
        print_json(&all)
    }
}

/// The tools of a file with their identifiers, each of them another.
fn named(file: &std::path::Path, asked: Option<&str>) -> Result<Vec<(Tool, String)>, CliError> {
    let tools = read_library(file)?;
    if asked.is_some() && tools.len() != 1 {
        let message = format!("{}: has {} tools, so that none can be named behind it", file.display(), tools.len());
        return Err(CliError::trouble(message));
    }
    let mut known = HashSet::new();
    let mut named = Vec::new();
    for mut tool in tools {
        tool.name = target(Tools::NAME, file, &tool.name, asked)
            .map_err(|error| CliError::trouble(format!("{} (tool number {})", error.message, tool.number)))?;
        let id = names::parse_tool(&tool.name).map_err(|error| CliError::trouble(format!("{}: {error}", tool.name)))?;
        let id = id.to_owned();
        if !known.insert(id.clone()) {
            return Err(CliError::trouble(format!("{}: {} is there twice", file.display(), tool.name)));
        }
        named.push((tool, id));
    }
    Ok(named)
}

async fn put_tool(client: &Client, tool: &Tool, id: &str) -> Result<(), CliError> {
    let update = async || {
        let update_mask = Some(FieldMask { paths: vec!["*".to_owned()] });
        let request = UpdateToolRequest { tool: Some(tool.clone()), update_mask };
        client.tools().update_tool(request).await.map(drop)
    };
    let create = async || -> Result<(), Status> {
        let request = CreateToolRequest { tool_id: id.to_owned(), tool: Some(tool.clone()) };
        client.tools().create_tool(request).await.map(drop)
    };
    put(client, &tool.name, &tool.etag, update, create).await?.tell(&tool.name)
}

/// A tool for people.
fn text(tool: &Tool) -> String {
    let of = |value: Option<f64>, unit: &str| value.map_or_else(String::new, |value| format!("{value} {unit}"));
    let geometry = tool.geometry.as_ref();
    let edges = geometry.map(|geometry| geometry.edges.len() as u32).or(tool.edge_count);
    card(&[
        ("tool", tool.name.clone()),
        ("number", tool.number.to_string()),
        ("name", tool.display_name.clone()),
        ("kind", words(tool.kind().as_str_name(), "TOOL_KIND_")),
        ("length", of(tool.length_mm, "mm")),
        ("diameter", of(tool.diameter_mm.or(geometry.map(|geometry| 2.0 * geometry.radius_mm)), "mm")),
        ("nose radius", of(tool.nose_radius_mm, "mm")),
        ("edges", edges.map_or_else(String::new, |edges| edges.to_string())),
        ("spindle", of(tool.max_spindle_rev_per_min, "rev/min at most")),
        ("dynamics", tool.dynamics.as_ref().map_or_else(String::new, |_| "known, for stability lobes".to_owned())),
        ("created", time(tool.create_time.as_ref())),
        ("changed", time(tool.update_time.as_ref())),
        ("etag", tool.etag.clone()),
    ])
}
