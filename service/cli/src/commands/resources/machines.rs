//! `feedwave machine`

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use feedwave_contract::proto::{
    AxisLetter, CreateMachineRequest, DeleteMachineRequest, GetMachineRequest, ListMachinesRequest,
    ListMachinesResponse, Machine, UpdateMachineRequest,
};
use prost_types::FieldMask;
use tonic::Status;

use super::collection::{self, Collection, DeleteArgs, GetArgs, ListArgs, PAGE, Page};
use super::{card, put, target, time, words};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::machine::{Kind, read_machine};
use crate::commands::terminal::{print_json, tell};

/// Arguments of `feedwave machine`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show a machine
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage, no such machine or no answer.

Examples:
  feedwave machine get lathe
  feedwave machine get mill-3 --format json > mill-3.json
      A file for `feedwave machine put`, `feedwave validate --profile` and so on.")]
    Get(GetArgs),
    /// Show all machines
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage or no answer.")]
    List(ListArgs),
    /// Replace a machine by what a file says, or create it
    ///
    /// The file is that of `--profile`: the contract's `MachineProfile` or `Machine`. It is checked as the service checks it
    /// before anything is sent. A `Machine` with an etag replaces only the machine that has it still. Of a `MachineProfile`
    /// the name for people stays. Jobs keep the profile they were created with.
    #[command(
        after_long_help = "Exit codes: 0 replaced or created, 2 wrong usage, a file or etag that is refused, or no answer.

Examples:
  feedwave machine put mill-3.toml mill-3 --display-name 'Mill 3'
  feedwave machine get mill-3 --format json > mill-3.json && $EDITOR mill-3.json && feedwave machine put mill-3.json
      Refused where somebody else changed the machine in between."
    )]
    Put(PutArgs),
    /// Delete a machine; one that is not there is as good as deleted
    ///
    /// Jobs keep the profile they were created with.
    #[command(after_long_help = "Exit codes: 0 deleted or not there, 2 wrong usage, another etag or no answer.")]
    Delete(DeleteArgs),
}

#[derive(Debug, clap::Args)]
struct PutArgs {
    /// The file, TOML or JSON
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The machine, `machines/{machine}` or the part after the slash [default: what the file says]
    #[arg(value_name = "MACHINE")]
    name: Option<String>,
    /// Name for people [default: what the file says, or what it was]
    #[arg(long, value_name = "NAME")]
    display_name: Option<String>,
    /// Kind of a machine whose file says none; axes that it leaves out are those of the generic machine of its kind
    #[arg(long, value_enum, value_name = "KIND")]
    machine_kind: Option<Kind>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Does it.
///
/// # Errors
/// [`CliError`] when the service does not answer or refuses, or a file cannot be used.
pub(in crate::commands) async fn run(args: Args) -> Result<ExitCode, CliError> {
    match args.command {
        Command::Get(args) => collection::get(Machines, args).await,
        Command::List(args) => collection::list(Machines, args).await,
        Command::Put(args) => put_file(args).await,
        Command::Delete(args) => collection::delete(Machines, args).await,
    }
}

/// The machines of a service.
struct Machines;

impl Collection for Machines {
    const NAME: &'static str = "machines";
    type Resource = Machine;

    async fn get(&self, client: &Client, name: String) -> Result<Machine, Status> {
        let answer = client.machines().get_machine(GetMachineRequest { name }).await?;
        Ok(answer.into_inner().machine.unwrap_or_default())
    }

    async fn page(&self, client: &Client, page_token: String) -> Result<Page<Machine>, Status> {
        let request = ListMachinesRequest { page_size: PAGE, page_token };
        let page = client.machines().list_machines(request).await?.into_inner();
        Ok(Page { resources: page.machines, next: page.next_page_token, unreachable: page.unreachable })
    }

    async fn delete(&self, client: &Client, name: String, etag: String) -> Result<(), Status> {
        client.machines().delete_machine(DeleteMachineRequest { name, etag }).await.map(drop)
    }

    fn card(machine: &Machine) -> String {
        text(machine)
    }

    fn head() -> String {
        format!("{:<28}  {:<6}  {:<20}  name for people", "machine", "kind", "axes")
    }

    fn line(machine: &Machine) -> String {
        let model = machine.profile.as_ref().and_then(|profile| profile.machine.clone()).unwrap_or_default();
        let kind = words(model.kind().as_str_name(), "MACHINE_KIND_");
        let axes: Vec<_> = model.axes.iter().map(|axis| axis.name.as_str()).collect();
        format!("{:<28}  {kind:<6}  {:<20}  {}", machine.name, axes.join(" "), machine.display_name)
    }

    /// One answer with all pages.
    async fn print_json(&self, client: &Client) -> Result<(), CliError> {
        let mut all = ListMachinesResponse::default();
        collection::each_page(self, client, |page| {
            all.machines.extend(page);
            Ok(())
        })
        .await?;
        print_json(&all)
    }
}

async fn put_file(args: PutArgs) -> Result<ExitCode, CliError> {
    let file = read_machine(&args.file, args.machine_kind)?;
    let place = args.file.display();
    if file.completed.contains(&"kind") && args.machine_kind.is_none() {
        return Err(CliError::trouble(format!(
            "{place}: machine.kind: must be \"MACHINE_KIND_LATHE\" or \"MACHINE_KIND_MILL\", or given by --machine-kind"
        )));
    }
    let mut machine = file.machine;
    machine.name = target(Machines::NAME, &args.file, &machine.name, args.name.as_deref())?;
    let id = feedwave_contract::names::parse_machine(&machine.name);
    let id = id.map_err(|error| CliError::trouble(format!("{}: {error}", machine.name)))?.to_owned();
    let mut paths = if file.is_profile { vec!["profile".to_owned()] } else { vec!["*".to_owned()] };
    if let Some(name) = args.display_name {
        machine.display_name = name;
        if file.is_profile {
            paths.push("display_name".to_owned());
        }
    }
    let generic: Vec<_> = file.completed.iter().map(|field| format!("machine.{field}")).collect();
    if !generic.is_empty() {
        tell(&format!("{place}: leaves out {}: those of the generic machine are taken\n", generic.join(", ")));
    }
    let client = args.server.connect().await?;
    let update = async || {
        let update_mask = Some(FieldMask { paths: paths.clone() });
        let request = UpdateMachineRequest { machine: Some(machine.clone()), update_mask };
        client.machines().update_machine(request).await.map(drop)
    };
    let create = async || -> Result<(), Status> {
        let request = CreateMachineRequest { machine_id: id.clone(), machine: Some(machine.clone()) };
        client.machines().create_machine(request).await.map(drop)
    };
    put(&client, &machine.name, &machine.etag, update, create).await?.tell(&machine.name)?;
    Ok(ExitCode::SUCCESS)
}

/// A machine for people.
fn text(machine: &Machine) -> String {
    let model = machine.profile.as_ref().and_then(|profile| profile.machine.clone()).unwrap_or_default();
    let mut text = card(&[
        ("machine", machine.name.clone()),
        ("name", machine.display_name.clone()),
        ("kind", words(model.kind().as_str_name(), "MACHINE_KIND_")),
        ("spindle", format!("up to {} rev/min", model.max_spindle_rev_per_min)),
        ("created", time(machine.create_time.as_ref())),
        ("changed", time(machine.update_time.as_ref())),
        ("etag", machine.etag.clone()),
    ]);
    let _ = writeln!(
        text,
        "\n{:<6}  {:>12}  {:>12}  {:>12}  {:>20}",
        "axis", "velocity /s", "accel. /s²", "jerk /s³", "travel"
    );
    for axis in &model.axes {
        let rotary = matches!(axis.axis(), AxisLetter::A | AxisLetter::B | AxisLetter::C);
        let unit = if rotary { "deg" } else { "mm" };
        let travel = match (axis.travel_min, axis.travel_max) {
            (None, None) => "unlimited".to_owned(),
            (low, high) => {
                let end = |end: Option<f64>| end.map_or("…".to_owned(), |end| end.to_string());
                format!("{} to {}", end(low), end(high))
            }
        };
        let (velocity, acceleration) = (axis.max_velocity_per_s, axis.max_acceleration_per_s2);
        let jerk = axis.max_jerk_per_s3;
        let _ =
            writeln!(text, "{:<6}  {velocity:>12}  {acceleration:>12}  {jerk:>12}  {travel:>20}  {unit}", axis.name);
    }
    text
}
