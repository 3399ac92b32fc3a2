//! What the steps of the demo have in common: machines, jobs, setpoints, pictures.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use feedwave_contract::convert::profile_to_proto;
use feedwave_contract::proto::create_job_request::Source as ProgramSource;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{
    CreateJobRequest, CreateMachineRequest, FeedOverrideChange, Finding, Job, Machine, StreamSetpointsRequest,
    ValidationReport,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, SetpointBlock};

use super::super::CliError;
use super::super::client::Client;
use super::super::local;
use super::super::pictures::FirstVibration;
use super::super::plan;
use super::super::source::Source;
use super::super::stream::{self, Event};
use super::super::terminal::number;
use super::Stage;

/// A job that was validated.
pub(super) struct Checked {
    pub(super) job: Job,
    pub(super) report: ValidationReport,
}

impl Checked {
    pub(super) fn finding(&self, code: &str) -> Option<&Finding> {
        self.report.findings.iter().find(|finding| finding.code == code)
    }

    /// Whether the chip of the first vibrating section breaks.
    pub(super) fn broken(&self) -> Option<bool> {
        Some(self.report.sections.first()?.chip.as_ref()?.broken)
    }
}

/// Makes a machine and says how fast its first axis is.
pub(super) async fn make_machine(
    stage: &Stage,
    client: &Client,
    id: &str,
    name: &str,
    profile: &MachineProfile,
) -> Result<(), CliError> {
    let machine =
        Machine { display_name: name.to_owned(), profile: Some(profile_to_proto(profile)), ..Machine::default() };
    let request = CreateMachineRequest { machine_id: id.to_owned(), machine: Some(machine) };
    let mut machines = client.machines();
    machines.create_machine(request).await.map_err(|status| client.failed(&status))?;
    let axis = &profile.machine.axes[0];
    let axes: Vec<&str> = profile.machine.axes.iter().map(|axis| axis.name.as_str()).collect();
    let axes = axes.join(", ");
    stage.say(&format!(
        "It knows machines/{id}: {axes}, {} m/min, {} m/s², jerk {} m/s³",
        number(axis.max_velocity_per_s * 0.06, 4),
        number(axis.max_acceleration_per_s2 / 1e3, 4),
        number(axis.max_jerk_per_s3 / 1e3, 4)
    ))
}

pub(super) async fn submit(client: &mut Client, machine: &str, name: &str, program: &str) -> Result<Checked, CliError> {
    submit_with(client, machine, name, program, &[]).await
}

/// A job with tools of the library.
pub(super) async fn submit_with(
    client: &mut Client,
    machine: &str,
    name: &str,
    program: &str,
    tools: &[&str],
) -> Result<Checked, CliError> {
    let request = CreateJobRequest {
        tools: tools.iter().map(|tool| feedwave_contract::names::tool(tool)).collect(),
        machine: feedwave_contract::names::machine(machine),
        source: Some(ProgramSource::InlineProgram(program.as_bytes().to_vec().into())),
        display_name: name.to_owned(),
        ..CreateJobRequest::default()
    };
    let response = client.jobs.create_job(request).await.map_err(|status| client.failed(&status))?;
    let job = response.into_inner().job.unwrap_or_default();
    let job = client.validated(&job.name).await?;
    let report = client.report(&job.name).await?;
    Ok(Checked { job, report })
}

/// The setpoints of a job from one on, and how many were announced.
pub(super) async fn read(
    client: &mut Client,
    job: &Job,
    from: u64,
    overrides: Vec<FeedOverrideChange>,
) -> Result<(Vec<SetpointBlock>, u64), CliError> {
    let start = Some(Start::StartIndex(from));
    let job = job.name.clone();
    read_request(client, StreamSetpointsRequest { overrides, job, start, ..StreamSetpointsRequest::default() }).await
}

/// The setpoints that a request asks for, and how many were announced.
pub(super) async fn read_request(
    client: &mut Client,
    request: StreamSetpointsRequest,
) -> Result<(Vec<SetpointBlock>, u64), CliError> {
    let mut blocks = Vec::new();
    let mut announced = 0;
    stream::read(client, request, u64::MAX, |event| {
        match event {
            Event::Header(header, _) => announced = header.setpoint_count.unwrap_or_default(),
            Event::Block(block, _) => blocks.push(block.clone()),
        }
        Ok(())
    })
    .await?;
    Ok((blocks, announced))
}

/// The values of setpoint rows from `from` on, as bits.
pub(super) fn bits(blocks: &[SetpointBlock], from: u64) -> impl Iterator<Item = Vec<u64>> + '_ {
    blocks.iter().flat_map(move |block| {
        let first = from.saturating_sub(block.first_index).min(block.len() as u64) as usize;
        (first..block.len()).map(move |row| {
            let columns = block.axes.iter().chain([
                &block.path_position_mm,
                &block.feed_mm_per_min,
                &block.vibration_offset_mm,
                &block.spindle_angle_deg,
            ]);
            let place = [block.first_index + row as u64, u64::from(block.line[row])];
            columns.map(|column| column[row].to_bits()).chain(place).collect()
        })
    })
}

/// Writes a program and the pictures of it into a directory of their own; the files.
pub(super) fn draw(
    name: &str,
    program: &str,
    config: PipelineConfig,
    out: &Path,
    directory: &str,
) -> Result<Vec<PathBuf>, CliError> {
    let path = out.join(name);
    std::fs::write(&path, program).map_err(|error| CliError::file(&path, &error))?;
    let mut written = vec![path];
    let config = Arc::new(config);
    let mut source = Source::of_text(name, program)?;
    let mut vibration = FirstVibration::default();
    let report = local::validate(&mut source, config.clone(), |block| vibration.observe(block))?;
    written.extend(plan::draw(&mut source, &config, &report, &vibration, &out.join(directory))?);
    Ok(written)
}
