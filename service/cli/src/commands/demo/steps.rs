//! The steps of the demo, in order.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use feedwave_contract::columns::Extras;
use feedwave_contract::proto::{JobState, ListJobsRequest};
use feedwave_cutting::{MachineProfile, PipelineConfig, SetpointBlock, code};
use feedwave_server::config::{Config, GrpcConfig, HttpConfig, StoreConfig};
use feedwave_server::lifecycle::{RunningServer, Server};

use super::super::CliError;
use super::super::client::Client;
use super::super::local::{self, Progress};
use super::super::report;
use super::super::source::Source;
use super::super::terminal::{count, counted, number};
use super::common::{self, Checked, bits, make_machine, read, submit};
use super::{Stage, five_axis, live, milling, threading, tool_oscillation};
use crate::output::{FileFormat, create};

/// The program of the demo.
const TURNING: &str = include_str!("../../../../../tests/fixtures/turning-demo.nc");
const TURNING_NAME: &str = "turning-demo.nc";
/// The example of the patent, ES 2 634 340 T3.
const TRAP: &str = include_str!("../../../../../tests/fixtures/spec-trap.nc");
const UNBROKEN: &str = code::VIB_CHIP_UNBROKEN.name();
/// The machine that the demo makes.
const MACHINE: &str = "demo-lathe";
/// Where its tool changes: X radius and Z, mm.
const TOOL_CHANGE_MM: (f64, f64) = (60.0, 80.0);

/// All of them.
pub(super) async fn all(stage: &mut Stage, out: &Path) -> Result<(), CliError> {
    stage.say("feedwave: a machining program goes in, checked and interpolated setpoints come out.")?;
    let directory = tempfile::tempdir().map_err(CliError::trouble)?;
    let server = start(stage, directory.path()).await?;
    let result = with_server(stage, out, server.grpc_addr()).await;
    server.shutdown().await;
    result
}

async fn start(stage: &mut Stage, directory: &Path) -> Result<RunningServer, CliError> {
    stage.step("A server starts")?;
    let free_port = SocketAddr::from(([127, 0, 0, 1], 0));
    let config = Config {
        grpc: GrpcConfig { listen: free_port, ..GrpcConfig::default() },
        http: HttpConfig { listen: free_port, ..HttpConfig::default() },
        store: StoreConfig::of_file(&directory.join("demo.db")).map_err(CliError::trouble)?,
        ..Config::default()
    };
    let server = Server::start(config).await.map_err(CliError::trouble)?;
    stage.say(&format!(
        "gRPC on {}, dashboards on http://{}, a temporary store",
        server.grpc_addr(),
        server.http_addr()
    ))?;
    Ok(server)
}

async fn with_server(stage: &mut Stage, out: &Path, address: SocketAddr) -> Result<(), CliError> {
    let url = format!("http://{address}");
    let channel = tonic::transport::Endpoint::from_shared(url.clone()).map_err(CliError::trouble)?;
    let channel = channel.connect().await.map_err(CliError::trouble)?;
    let mut client = Client::new(url, channel);
    let profile = profile();
    make_machine(stage, &client, MACHINE, "Lathe of the demo", &profile).await?;
    trap(stage, &mut client).await?;
    let trapped = turning(stage, &mut client).await?;
    let cured_program = cure(&trapped)?;
    let cured = apply(stage, &mut client, &cured_program).await?;
    let setpoints = stream_all(stage, &mut client, &cured, &profile, out).await?;
    resume(stage, &mut client, &cured, &setpoints).await?;
    compare_local(stage, &cured_program, &profile, &setpoints)?;
    let mut others = threading::all(stage, &mut client, MACHINE, &profile, out).await?;
    others.extend(milling::all(stage, &mut client, out).await?);
    others.extend(five_axis::all(stage, &mut client, out).await?);
    others.extend(live::all(stage, &mut client, milling::MACHINE, out).await?);
    others.extend(tool_oscillation::all(stage, &mut client, out).await?);
    list(stage, &mut client).await?;
    draw(stage, &cured_program, &profile, others, out)
}

/// A lathe whose tool changes well away from the work, and whose threading tool withstands no thick finishing chips.
fn profile() -> MachineProfile {
    let mut profile = MachineProfile::lathe();
    profile.thread_vibration.max_finishing_thickness_mm = Some(threading::FINISHING_MM);
    let (x, z) = (feedwave_program::Axis::X.index(), feedwave_program::Axis::Z.index());
    for position in [&mut profile.language.initial_position, &mut profile.language.reference_position] {
        (position[x], position[z]) = TOOL_CHANGE_MM;
    }
    profile
}

/// The example of the source: 50 Hz at 1000 rev/min is in phase with the spindle.
async fn trap(stage: &mut Stage, client: &mut Client) -> Result<(), CliError> {
    stage.step("A trap: the textbook example of chip breaking does not break the chip")?;
    stage.say("S1000 with G200 F50: the tool swings exactly three times per revolution, so every\nrevolution follows the one before, at any amplitude.")?;
    let checked = submit(client, MACHINE, "spec-trap.nc", TRAP).await?;
    let chip = checked.report.sections.first().and_then(|section| section.chip.clone()).unwrap_or_default();
    stage.check(
        chip.vibrations_per_rev == 3.0,
        &format!("D = {:.3} vibrations per revolution", chip.vibrations_per_rev),
    )?;
    stage.check(!chip.broken && chip.min_amplitude_mm.is_none(), "no amplitude would break the chip")?;
    let thickness = number(chip.largest_thickness_mm, 4);
    stage.check(
        (chip.largest_thickness_mm - chip.feed_mm_per_rev).abs() < 1e-9,
        &format!("the chip is {thickness} mm thick everywhere: the feed per revolution"),
    )?;
    stage.check(checked.finding(UNBROKEN).is_some(), &format!("the service says so: {UNBROKEN}"))
}

/// The turning program as programmed: the same trap in a real program.
async fn turning(stage: &mut Stage, client: &mut Client) -> Result<Checked, CliError> {
    stage.step(&format!(
        "A turning program goes in: {TURNING_NAME}, {}",
        counted(TURNING.lines().count() as u64, "line")
    ))?;
    stage.say("Facing at constant surface speed, roughing, a contour of lines and arcs finished\nwith vibration along the path, an undercut.")?;
    let checked = submit(client, MACHINE, TURNING_NAME, TURNING).await?;
    let mut source = Source::of_text(TURNING_NAME, TURNING)?;
    stage.say("")?;
    stage.say(&report::text(&checked.report, &mut source, stage.style)?)?;
    stage.check(checked.job.state() == JobState::Ready, "the machine can run it")?;
    stage.check(
        checked.finding(UNBROKEN).is_some() && checked.broken() == Some(false),
        "but its long chip is caught before anything moves",
    )?;
    Ok(checked)
}

/// The program with the first suggestion of the finding in its place.
fn cure(trapped: &Checked) -> Result<String, CliError> {
    let suggestion = trapped.finding(UNBROKEN).and_then(|finding| {
        let replacement = finding.suggestions.iter().find_map(|suggestion| suggestion.replacement.clone())?;
        Some((finding, replacement))
    });
    let (finding, replacement) = suggestion.ok_or_else(|| CliError::trouble("the finding suggests no replacement"))?;
    let mut lines: Vec<String> = TURNING.lines().map(str::to_owned).collect();
    let line = lines
        .get_mut((finding.line as usize).wrapping_sub(1))
        .ok_or_else(|| CliError::trouble("the finding has no line"))?;
    let start = (finding.column as usize).saturating_sub(1);
    let end = start + finding.length as usize;
    if !line.is_char_boundary(start) || !line.is_char_boundary(end) {
        return Err(CliError::trouble("the finding has no place in its line"));
    }
    line.replace_range(start..end, &replacement);
    Ok(lines.join("\n") + "\n")
}

async fn apply(stage: &mut Stage, client: &mut Client, program: &str) -> Result<Checked, CliError> {
    stage.step("The suggestion is taken")?;
    for (number, (before, after)) in (1..).zip(TURNING.lines().zip(program.lines())) {
        if before != after {
            stage.say(&format!("line {number}: {} → {}", stage.style.bad(before), stage.style.good(after)))?;
        }
    }
    let checked = submit(client, MACHINE, "turning-demo-cured.nc", program).await?;
    let chip = checked.report.sections.first().and_then(|section| section.chip.clone()).unwrap_or_default();
    stage.check(checked.report.findings.is_empty(), "nothing is left to find")?;
    stage.check(
        checked.broken() == Some(true),
        &format!(
            "the chip breaks: D = {:.3}, {} breaks per revolution, {} % of it in air",
            chip.vibrations_per_rev,
            number(chip.breaks_per_rev, 3),
            number(chip.air_share * 100.0, 3)
        ),
    )?;
    let longest = chip.longest_chip_mm.map(|length| number(length, 3)).unwrap_or_default();
    stage.check(chip.longest_chip_mm.is_some(), &format!("no chip is longer than {longest} mm"))?;
    Ok(checked)
}

async fn stream_all(
    stage: &mut Stage,
    client: &mut Client,
    cured: &Checked,
    profile: &MachineProfile,
    out: &Path,
) -> Result<Vec<SetpointBlock>, CliError> {
    stage.step("Setpoints stream out")?;
    let (blocks, announced) = read(client, &cured.job, 0, Vec::new()).await?;
    let received: u64 = blocks.iter().map(|block| block.len() as u64).sum();
    let summary = cured.report.summary.clone().unwrap_or_default();
    stage.check(
        received == announced && received == summary.setpoint_count && received > 0,
        &format!("{} setpoints over gRPC, one per millisecond, as many as announced", count(received)),
    )?;
    let last = |axis: usize| blocks.last().and_then(|block| block.axes.get(axis)?.last().copied());
    stage.check(
        (last(0), last(1)) == (Some(TOOL_CHANGE_MM.0), Some(TOOL_CHANGE_MM.1)),
        "the last one is the programmed end, to the last bit",
    )?;
    let amplitude_mm = cured.report.sections.first().map_or(f64::NAN, |section| section.amplitude_mm);
    let offsets = blocks.iter().flat_map(|block| &block.vibration_offset_mm);
    let peak_mm = offsets.fold(0.0_f64, |peak, offset| peak.max(offset.abs()));
    stage.check(
        peak_mm > 0.98 * amplitude_mm && peak_mm <= amplitude_mm * (1.0 + 1e-9),
        &format!("the tool swings by ±{} mm of the ±{amplitude_mm} mm programmed", number(peak_mm, 3)),
    )?;
    let path = out.join("turning-demo-cured.csv");
    let period_us = f64::from(summary.interpolation_period_us);
    let layout = crate::output::Layout::of_machine(&profile.machine, Extras::default(), period_us);
    let failed = |error: std::io::Error| CliError::file(&path, &error);
    let mut writer = create(&path, FileFormat::Csv, layout).map_err(failed)?;
    for block in &blocks {
        writer.write(block, 0..block.len()).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    Ok(blocks)
}

async fn resume(
    stage: &mut Stage,
    client: &mut Client,
    cured: &Checked,
    setpoints: &[SetpointBlock],
) -> Result<(), CliError> {
    stage.step("A dropped connection would cost nothing")?;
    let total: u64 = setpoints.iter().map(|block| block.len() as u64).sum();
    // Anywhere but at the start of a block.
    let middle = (total / 2) | 1;
    let (resumed, _) = read(client, &cured.job, middle, Vec::new()).await?;
    stage.check(
        !resumed.is_empty() && bits(&resumed, middle).eq(bits(setpoints, middle)),
        &format!("a stream resumed at setpoint {} equals the first one, bit for bit", count(middle)),
    )
}

fn compare_local(
    stage: &mut Stage,
    program: &str,
    profile: &MachineProfile,
    setpoints: &[SetpointBlock],
) -> Result<(), CliError> {
    let mut source = Source::of_text(TURNING_NAME, program)?;
    let mut blocks = Vec::new();
    local::generate(&mut source, Arc::new(PipelineConfig::new(profile.clone())), |block| {
        blocks.push(block.clone());
        Ok(Progress::Continue)
    })?;
    stage.check(bits(&blocks, 0).eq(bits(setpoints, 0)), "`feedwave plan` gives the same without a server, bit for bit")
}

async fn list(stage: &mut Stage, client: &mut Client) -> Result<(), CliError> {
    stage.step("The store remembers")?;
    let response = client.jobs.list_jobs(ListJobsRequest::default()).await.map_err(|status| client.failed(&status))?;
    let jobs = response.into_inner().jobs;
    stage.say(&format!("{:<22} {:<9} {:>9} {:>10}  job", "program", "state", "warnings", "setpoints"))?;
    for job in jobs.iter().rev() {
        let summary = job.summary.clone().unwrap_or_default();
        let state = job.state().as_str_name().trim_start_matches("JOB_STATE_").to_lowercase();
        let (warnings, setpoints) = (count(summary.warnings), count(summary.setpoint_count));
        stage.say(&format!("{:<22} {state:<9} {warnings:>9} {setpoints:>10}  {}", job.display_name, job.name))?;
    }
    stage.check(jobs.len() == 15, "fifteen jobs are stored with their programs and reports")
}

fn draw(
    stage: &mut Stage,
    cured: &str,
    profile: &MachineProfile,
    others: Vec<PathBuf>,
    out: &Path,
) -> Result<(), CliError> {
    stage.step("Pictures")?;
    let mut written: Vec<PathBuf> = vec![out.join("turning-demo-cured.csv")];
    for (name, directory, program) in
        [(TURNING_NAME, "as-programmed", TURNING), ("turning-demo-cured.nc", "cured", cured)]
    {
        written.extend(common::draw(name, program, PipelineConfig::new(profile.clone()), out, directory)?);
    }
    written.extend(others);
    for path in written.iter().filter(|path| path.extension().is_none_or(|extension| extension != "svg")) {
        stage.say(&path.display().to_string())?;
    }
    let drawn = written.iter().filter(|path| path.metadata().is_ok_and(|metadata| metadata.len() > 0)).count();
    stage.check(drawn == written.len(), "each picture is there as PNG and as SVG")?;
    let start = out.join("as-programmed");
    let chip = written.iter().find(|path| path.starts_with(&start) && path.to_string_lossy().contains("chip"));
    if let Some(chip) = chip {
        stage.say(&format!(
            "Open {} first: the trap and its cure side by side.",
            chip.with_extension("png").display()
        ))?;
    }
    Ok(())
}
