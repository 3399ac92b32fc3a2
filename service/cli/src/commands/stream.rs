//! `feedwave stream`: setpoints of a job into a file, resumed after a break.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::{Encoding, Frame, ServoOutput, StreamHeader, StreamSetpointsRequest};
use tonic::Status;

use super::CliError;
use super::client::{Client, Decoder, MAX_RETRIES, ServerArgs, is_passing, pause};
use super::overrides::OverrideArgs;
use super::plan::{FrameArg, format_of, time, writer};
use super::terminal::{Unit, count, progress, tell};
use crate::output::{FileFormat, SetpointWriter};

/// Arguments of `feedwave stream`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 all written, 2 wrong usage, no answer or an unusable file.

Examples:
  feedwave stream jobs/0197b3c2-… > shaft.csv
  feedwave stream \"$(feedwave submit shaft.nc)\" --out shaft.parquet
  feedwave stream \"$job\" --from-time 12.5 --count 1000
      One second of it, at a period of 1 ms.
  feedwave stream \"$job\" --encoding delta --out shaft.csv
      A fraction of the bytes on the wire, rounded to the resolution of each column.
  feedwave stream \"$job\" --override 2:50 --override 3.5:0 --override 5:100 --out shaft.csv
      As with a hand on the feed override: half the feed from 2 s on, feed hold from 3.5 s to 5 s.")]
pub struct Args {
    /// The job, `jobs/{job}` or the part after the slash
    #[arg(value_name = "JOB")]
    job: String,
    #[command(flatten)]
    server: ServerArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
    /// File to write, `.csv` or `.parquet`; `-` writes CSV to standard output
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
    /// Form of the file, where its name does not say
    #[arg(long, value_enum, value_name = "FORMAT")]
    file_format: Option<FileFormat>,
    /// First setpoint to write
    #[arg(long, value_name = "INDEX", default_value_t = 0)]
    from_index: u64,
    /// Write from the first setpoint at or after this time on, s
    #[arg(long, value_name = "SECONDS", conflicts_with = "from_index", value_parser = time)]
    from_time: Option<f64>,
    /// Setpoints to write at most
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// How values travel
    #[arg(long, value_enum, value_name = "ENCODING", default_value_t = EncodingArg::Double)]
    encoding: EncodingArg,
    /// Coordinates of the axes
    #[arg(long, value_enum, value_name = "FRAME", default_value_t = FrameArg::Machine)]
    frame: FrameArg,
    /// For a job in servo-side mode: what the drives generate, instead of the conditions they generate it from
    #[arg(long)]
    servo_expanded: bool,
}

/// How values travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EncodingArg {
    /// Every value to the last bit
    Double,
    /// Differences of rounded values: smaller
    Delta,
    /// Every value to the last bit, as bytes
    Raw,
}

/// Reads it.
///
/// # Errors
/// [`CliError`] when the service does not answer or a file cannot be written.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let format = format_of(&args.out, args.file_format)?;
    let mut client = args.server.connect().await?;
    let start = args.from_time.map_or(Start::StartIndex(args.from_index), Start::StartTimeS);
    let request = StreamSetpointsRequest {
        job: if args.job.contains('/') { args.job.clone() } else { format!("jobs/{}", args.job) },
        start: Some(start),
        encoding: match args.encoding {
            EncodingArg::Double => Encoding::PackedDouble,
            EncodingArg::Delta => Encoding::FixedPointDelta,
            EncodingArg::Raw => Encoding::RawDouble,
        }
        .into(),
        frame: match args.frame {
            FrameArg::Machine => Frame::Machine,
            FrameArg::Work => Frame::Work,
        }
        .into(),
        servo_output: if args.servo_expanded { ServoOutput::Expanded } else { ServoOutput::Conditions }.into(),
        overrides: args.overrides.into_request(),
        ..StreamSetpointsRequest::default()
    };
    let failed = |error: std::io::Error| CliError::file(&args.out, &error);
    let mut target: Option<Box<dyn SetpointWriter>> = None;
    let mut bar = indicatif::ProgressBar::hidden();
    let wanted = args.count.unwrap_or(u64::MAX);
    let written = read(&mut client, request, wanted, |event| {
        match event {
            Event::Header(header, decoder) => {
                let left = header.setpoint_count.unwrap_or(0).saturating_sub(header.first_index);
                bar = progress("streaming", Unit::Setpoints, left.min(wanted));
                target = Some(writer(&args.out, format, decoder.layout())?);
            }
            Event::Block(block, rows) => {
                bar.inc(rows.len() as u64);
                if let Some(target) = &mut target {
                    target.write(block, rows).map_err(failed)?;
                }
            }
        }
        Ok(())
    })
    .await?;
    if let Some(target) = target {
        target.finish().map_err(failed)?;
    }
    bar.finish_and_clear();
    if args.out.as_os_str() != "-" {
        tell(&format!("wrote {} setpoints to {}\n", count(written), args.out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// What comes out of a stream.
pub(super) enum Event<'a> {
    /// Once, before everything else.
    Header(&'a StreamHeader, &'a Decoder),
    /// Rows of a block, in order and without gaps however often the connection broke.
    Block(&'a feedwave_cutting::SetpointBlock, std::ops::Range<usize>),
}

/// Reads up to `wanted` setpoints, resuming the stream where it broke; how many there were.
pub(super) async fn read(
    client: &mut Client,
    mut request: StreamSetpointsRequest,
    wanted: u64,
    mut take: impl FnMut(Event<'_>) -> Result<(), CliError>,
) -> Result<u64, CliError> {
    let mut position = Position { next_index: None, total: None, written: 0, wanted };
    let mut retries = 0;
    loop {
        let before = position.written;
        match attempt(client, &request, &mut position, &mut take).await? {
            Ok(()) => return Ok(position.written),
            // The connection broke after the last setpoint, before the end of the call.
            Err(_) if position.total.is_some() && position.next_index == position.total => {
                return Ok(position.written);
            }
            Err(status) if is_passing(&status) => {
                retries = if position.written > before { 1 } else { retries + 1 };
                if retries > MAX_RETRIES {
                    return Err(client.failed(&status));
                }
                tell(&format!("{}: {}; resuming the stream\n", client.url, status.message()));
                pause(retries).await;
                if let Some(next_index) = position.next_index {
                    request.start = Some(Start::StartIndex(next_index));
                }
            }
            Err(status) => return Err(client.failed(&status)),
        }
    }
}

/// How far a stream has come.
struct Position {
    /// Index of the next setpoint; unknown before the first header.
    next_index: Option<u64>,
    /// Setpoints of the whole program, where the service says so.
    total: Option<u64>,
    written: u64,
    wanted: u64,
}

/// One call; the outer error is ours, the inner one the service's.
async fn attempt(
    client: &mut Client,
    request: &StreamSetpointsRequest,
    position: &mut Position,
    take: &mut impl FnMut(Event<'_>) -> Result<(), CliError>,
) -> Result<Result<(), Status>, CliError> {
    let mut messages = match client.setpoints.stream_setpoints(request.clone()).await {
        Ok(response) => response.into_inner(),
        Err(status) => return Ok(Err(status)),
    };
    let mut decoder = None;
    let broken = |what: &str| CliError::trouble(format!("the service broke its contract: {what}"));
    while position.written < position.wanted {
        let message = match messages.message().await {
            Ok(Some(response)) => response.message,
            Ok(None) => return Ok(Ok(())),
            Err(status) => return Ok(Err(status)),
        };
        match (message, &decoder) {
            (Some(Message::Header(header)), None) => {
                let made = Decoder::new(&header);
                if position.next_index.is_none() {
                    take(Event::Header(&header, &made))?;
                    position.next_index = Some(header.first_index);
                    position.total = header.setpoint_count;
                }
                decoder = Some(made);
            }
            (Some(Message::Chunk(chunk)), Some(decoder)) => {
                let block = decoder.block(&chunk).map_err(|what| broken(&what))?;
                if position.next_index != Some(block.first_index) {
                    return Err(broken("setpoints are missing between two chunks"));
                }
                let left = position.wanted - position.written;
                let rows = usize::try_from(left).map_or(block.len(), |left| block.len().min(left));
                take(Event::Block(&block, 0..rows))?;
                position.written += rows as u64;
                position.next_index = Some(block.first_index + rows as u64);
            }
            (None, _) => {}
            _ => return Err(broken("a stream must begin with its one header")),
        }
    }
    Ok(Ok(()))
}
