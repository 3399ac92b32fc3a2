//! What the commands about every collection of a service have in common: show one, show all, delete one.

use std::process::ExitCode;

use prost::Name;
use tonic::{Code, Status};

use super::{full_name, refused};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::terminal::{print, print_json, tell};
use crate::commands::validate::Format;

/// Resources asked for at a time.
pub(super) const PAGE: i32 = 500;

/// Arguments of `get`.
#[derive(Debug, clap::Args)]
pub(super) struct GetArgs {
    /// Resource name, or the part of it after the slash
    #[arg(value_name = "NAME")]
    name: String,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    server: ServerArgs,
}

/// Arguments of `list`.
#[derive(Debug, clap::Args)]
pub(super) struct ListArgs {
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    server: ServerArgs,
}

/// Arguments of `delete`.
#[derive(Debug, clap::Args)]
pub(super) struct DeleteArgs {
    /// Resource name, or the part of it after the slash
    #[arg(value_name = "NAME")]
    name: String,
    /// Only if it has this etag still
    #[arg(long, value_name = "ETAG", default_value = "")]
    etag: String,
    #[command(flatten)]
    server: ServerArgs,
}

/// Form of what is shown.
#[derive(Debug, clap::Args)]
struct Output {
    /// Form of the output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

/// A page of a list.
pub(super) struct Page<R> {
    pub(super) resources: Vec<R>,
    /// Token of the next page; empty after the last one.
    pub(super) next: String,
    /// Names of those that belong here and are damaged in the store.
    pub(super) unreachable: Vec<String>,
}

/// A collection of the service.
pub(super) trait Collection {
    /// What its resource names begin with.
    const NAME: &'static str;
    type Resource: Name;

    async fn get(&self, client: &Client, name: String) -> Result<Self::Resource, Status>;

    /// The resources from a page token on; an empty one is the start.
    async fn page(&self, client: &Client, page_token: String) -> Result<Page<Self::Resource>, Status>;

    async fn delete(&self, client: &Client, name: String, etag: String) -> Result<(), Status>;

    /// A resource for people.
    fn card(resource: &Self::Resource) -> String;

    /// Head of the table of all.
    fn head() -> String;

    /// Line of the table of all.
    fn line(resource: &Self::Resource) -> String;

    /// All as JSON.
    async fn print_json(&self, client: &Client) -> Result<(), CliError>;
}

/// Shows one.
pub(super) async fn get<C: Collection>(collection: C, args: GetArgs) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let resource = collection.get(&client, full_name(C::NAME, &args.name)).await;
    let resource = resource.map_err(|status| refused(&client, &status))?;
    match args.output.format {
        Format::Text => print(&C::card(&resource))?,
        Format::Json => print_json(&resource)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Shows all.
pub(super) async fn list<C: Collection>(collection: C, args: ListArgs) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    match args.output.format {
        Format::Json => collection.print_json(&client).await?,
        Format::Text => {
            let mut head = Some(format!("{}\n", C::head()));
            let line = |resource: &C::Resource| format!("{}\n", C::line(resource).trim_end());
            let shown = |page: Vec<C::Resource>| {
                print(&(head.take().unwrap_or_default() + &page.iter().map(line).collect::<String>()))
            };
            each_page(&collection, &client, shown).await?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Deletes one. What is not there any more is as good as deleted.
pub(super) async fn delete<C: Collection>(collection: C, args: DeleteArgs) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    delete_one(&collection, &client, full_name(C::NAME, &args.name), args.etag).await
}

/// Deletes the resource of this name.
pub(super) async fn delete_one<C: Collection>(
    collection: &C,
    client: &Client,
    name: String,
    etag: String,
) -> Result<ExitCode, CliError> {
    match collection.delete(client, name.clone(), etag).await {
        Ok(()) => print(&format!("{name}: deleted\n"))?,
        Err(status) if status.code() == Code::NotFound => print(&format!("{name}: is not there, nothing deleted\n"))?,
        Err(status) => return Err(refused(client, &status)),
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads a collection page by page: there may be any number of resources.
pub(super) async fn each_page<C: Collection>(
    collection: &C,
    client: &Client,
    mut shown: impl FnMut(Vec<C::Resource>) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let mut page_token = String::new();
    loop {
        let page = collection.page(client, page_token).await;
        let Page { resources, next, unreachable } = page.map_err(|status| refused(client, &status))?;
        shown(resources)?;
        for name in unreachable {
            tell(&format!("{name}: is damaged in the store, `feedwave check` there says what is lost\n"));
        }
        if next.is_empty() {
            return Ok(());
        }
        page_token = next;
    }
}
