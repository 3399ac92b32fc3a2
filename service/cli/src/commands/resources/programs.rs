//! `feedwave program`

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use feedwave_contract::proto::{
    GetProgramRequest, ListProgramsRequest, ListProgramsResponse, ListUploadsRequest, ListUploadsResponse, Program,
    ProgramsDeleteProgramRequest, ReadProgramRequest, Upload,
};
use tonic::Status;

use super::collection::{self, Collection, GetArgs, ListArgs, PAGE, Page};
use super::{card, full_name, refused, time};
use crate::commands::CliError;
use crate::commands::client::{Client, ServerArgs};
use crate::commands::terminal::{print, print_json, tell};
use crate::commands::validate::Format;
use crate::output::OutputFile;

/// Arguments of `feedwave program`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

/// Arguments of `feedwave program uploads`.
#[derive(Debug, clap::Args)]
struct UploadsArgs {
    /// Form of the output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show what is known of a program
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage, no such program or no answer.")]
    Get(GetArgs),
    /// Show all programs, newest first
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage or no answer.")]
    List {
        /// Only those whose file has this name
        #[arg(long, value_name = "NAME", default_value = "")]
        file_name: String,
        #[command(flatten)]
        list: ListArgs,
    },
    /// Show unfinished uploads; `delete` deletes one
    #[command(after_long_help = "Exit codes: 0 shown, 2 wrong usage or no answer.")]
    Uploads(UploadsArgs),
    /// Read the bytes of a program
    #[command(after_long_help = "Exit codes: 0 read, 2 wrong usage, no such program, no answer or an unusable file.

Examples:
  feedwave program read programs/5f1e… > shaft.nc
  feedwave program read \"$program\" --offset 1000000 --length 200")]
    Read {
        /// Resource name, or the part of it after the slash
        #[arg(value_name = "NAME")]
        name: String,
        /// File to write; `-` is standard output
        #[arg(long, value_name = "FILE", default_value = "-")]
        out: PathBuf,
        /// First byte to read
        #[arg(long, value_name = "BYTE", default_value_t = 0)]
        offset: u64,
        /// Bytes to read at most; 0: all
        #[arg(long, value_name = "BYTES", default_value_t = 0)]
        length: u64,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Delete a program that no job uses; one that is not there is as good as deleted
    #[command(after_long_help = "Exit codes: 0 deleted or not there, 2 wrong usage, a job uses it or no answer.")]
    Delete {
        /// Resource name, or the part of it after the slash
        #[arg(value_name = "NAME")]
        name: String,
        #[command(flatten)]
        server: ServerArgs,
    },
}

/// Does it.
///
/// # Errors
/// [`CliError`] when the service does not answer or refuses, or a file cannot be used.
pub(in crate::commands) async fn run(args: Args) -> Result<ExitCode, CliError> {
    match args.command {
        Command::Get(args) => collection::get(Programs::default(), args).await,
        Command::List { file_name, list } => collection::list(Programs { file_name }, list).await,
        Command::Uploads(args) => uploads(&args).await,
        Command::Read { name, out, offset, length, server } => {
            let client = server.connect().await?;
            let request = ReadProgramRequest { name: full_name(Programs::NAME, &name), offset, length };
            read(&client, request, &out).await?;
            Ok(ExitCode::SUCCESS)
        }
        Command::Delete { name, server } => {
            let client = server.connect().await?;
            collection::delete_one(&Programs::default(), &client, full_name(Programs::NAME, &name), String::new()).await
        }
    }
}

/// The programs of a service.
#[derive(Default)]
struct Programs {
    /// Only those of this name; empty: all.
    file_name: String,
}

impl Collection for Programs {
    const NAME: &'static str = "programs";
    type Resource = Program;

    async fn get(&self, client: &Client, name: String) -> Result<Program, Status> {
        let answer = client.programs().get_program(GetProgramRequest { name }).await?;
        Ok(answer.into_inner().program.unwrap_or_default())
    }

    async fn page(&self, client: &Client, page_token: String) -> Result<Page<Program>, Status> {
        let request = ListProgramsRequest { page_size: PAGE, page_token, file_name: self.file_name.clone() };
        let page = client.programs().list_programs(request).await?.into_inner();
        Ok(Page { resources: page.programs, next: page.next_page_token, unreachable: page.unreachable })
    }

    async fn delete(&self, client: &Client, name: String, _etag: String) -> Result<(), Status> {
        client.programs().delete_program(ProgramsDeleteProgramRequest { name }).await.map(drop)
    }

    fn card(program: &Program) -> String {
        card(&[
            ("program", program.name.clone()),
            ("file", program.file_name.clone()),
            ("size", format!("{} bytes", program.size_bytes)),
            ("jobs", program.job_count.to_string()),
            ("created", time(program.create_time.as_ref())),
        ])
    }

    fn head() -> String {
        format!("{:<73}  {:>12}  {:>5}  {:<27}  file", "program", "bytes", "jobs", "created")
    }

    fn line(program: &Program) -> String {
        let created = time(program.create_time.as_ref());
        let Program { name, size_bytes, job_count, file_name, .. } = program;
        format!("{name:<73}  {size_bytes:>12}  {job_count:>5}  {created:<27}  {file_name}")
    }

    /// One answer with all pages.
    async fn print_json(&self, client: &Client) -> Result<(), CliError> {
        let mut all = ListProgramsResponse::default();
        collection::each_page(self, client, |page| {
            all.programs.extend(page);
            Ok(())
        })
        .await?;
        print_json(&all)
    }
}

/// Shows unfinished uploads.
async fn uploads(args: &UploadsArgs) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let mut answer = ListUploadsResponse::default();
    loop {
        let request = ListUploadsRequest { page_size: PAGE, page_token: answer.next_page_token };
        let page =
            client.programs().list_uploads(request).await.map_err(|status| refused(&client, &status))?.into_inner();
        answer.uploads.extend(page.uploads);
        answer.next_page_token = page.next_page_token;
        if answer.next_page_token.is_empty() {
            break;
        }
    }
    if args.format == Format::Json {
        print_json(&answer)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = format!("{:<73}  {:>12}  {:>12}  {:<27}  client\n", "program", "bytes", "received", "last bytes");
    for Upload { program, program_bytes, received_bytes, client, update_time, .. } in &answer.uploads {
        let updated = time(update_time.as_ref());
        text += &format!("{program:<73}  {program_bytes:>12}  {received_bytes:>12}  {updated:<27}  {client}\n");
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the bytes of a program where they are wanted; a file appears only when all of them are there.
async fn read(client: &Client, request: ReadProgramRequest, out: &Path) -> Result<(), CliError> {
    let answer = client.programs().read_program(request).await.map_err(|status| refused(client, &status))?;
    let mut pieces = answer.into_inner();
    let to_stdout = out == Path::new("-");
    let failed = |error: io::Error| CliError::file(out, &error);
    let mut file = if to_stdout { None } else { Some(OutputFile::create(out).map_err(failed)?) };
    while let Some(piece) = pieces.message().await.map_err(|status| refused(client, &status))? {
        match &mut file {
            Some(file) => file.write_all(&piece.data).map_err(failed)?,
            None => {
                let written = io::stdout().lock().write_all(&piece.data);
                written.map_err(|error| CliError::written("standard output", &error))?;
            }
        }
    }
    if let Some(file) = file {
        file.commit().map_err(failed)?;
        tell(&format!("{}: written\n", out.display()));
    }
    Ok(())
}
