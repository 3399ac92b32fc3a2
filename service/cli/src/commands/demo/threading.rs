//! The threading steps of the demo: a thread whose chip only seems to break, a planned one, and a spindle that is not
//! constant.

use std::path::{Path, PathBuf};

use feedwave_contract::proto::follow_spindle_request::Message as Follow;
use feedwave_contract::proto::follow_spindle_response::Message as Followed;
use feedwave_contract::proto::plan_thread_request::{Advance, On};
use feedwave_contract::proto::{
    FollowSpindleRequest, FollowSpindleStart, FollowedPositions, Frame, InfeedPattern, JobState, PlanThreadRequest,
    PlanThreadResponse, SpindleAngleKind, SpindleAngles, StreamSetpointsRequest, ThreadPassReport, ThreadReport,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, SetpointBlock, code};
use futures_util::stream;

use super::super::CliError;
use super::super::client::Client;
use super::super::terminal::{count, number};
use super::Stage;
use super::common::{self, Checked, read_request, submit};

/// Program A of the source, file 004.
const THREAD: &str = include_str!("../../../../../tests/fixtures/thread-a.nc");
const NAME: &str = "thread-a.nc";
const PLANNED: &str = "thread-planned.nc";
/// The tool withstands no thicker chip in a finishing pass, mm on the radius.
pub(super) const FINISHING_MM: f64 = 0.1;
/// Pass that is followed, from 0: the second one, which vibrates opposite to the first.
const FOLLOWED_PASS: u32 = 1;

/// All of them; the files written.
pub(super) async fn all(
    stage: &mut Stage,
    client: &mut Client,
    machine: &str,
    profile: &MachineProfile,
    out: &Path,
) -> Result<Vec<PathBuf>, CliError> {
    let programmed = judge(stage, client, machine).await?;
    let planned = plan_thread(stage, client, machine).await?;
    follow(stage, client, &programmed).await?;
    draw(profile, &planned, out)
}

fn report(checked: &Checked) -> ThreadReport {
    checked.report.threads.first().and_then(|section| section.report.clone()).unwrap_or_default()
}

fn vibrating(report: &ThreadReport) -> impl Iterator<Item = &ThreadPassReport> {
    report.passes.iter().filter(|pass| pass.amplitude_mm > 0.0)
}

fn breaks(pass: &ThreadPassReport) -> (bool, bool) {
    (pass.depth.is_some_and(|chip| chip.broken), pass.section.is_some_and(|chip| chip.broken))
}

async fn judge(stage: &mut Stage, client: &mut Client, machine: &str) -> Result<Checked, CliError> {
    stage.step(&format!("A thread: {NAME}, flank infeed, X vibrating twice per revolution"))?;
    stage.say("Amplitude 1.2 times the infeed, every pass opposite in phase to the one before, as published.")?;
    let checked = submit(client, machine, NAME, THREAD).await?;
    let report = report(&checked);
    stage.check(
        checked.job.state() == JobState::Ready && vibrating(&report).count() == 3,
        "the machine can run it: three vibrating passes and one to finish",
    )?;
    stage.check(vibrating(&report).all(|pass| breaks(pass).0), "looking at the depth alone, every chip breaks")?;
    let held: Vec<String> = (1..)
        .zip(&report.passes)
        .filter(|(_, pass)| breaks(pass) == (true, false))
        .map(|(number, _): (u32, _)| number.to_string())
        .collect();
    stage.check(
        held == ["2", "3"] && has(&checked, code::THREAD_CHIP_RIBBON.name()),
        &format!("but along the flank those of passes {} hold together: THREAD-CHIP-RIBBON", held.join(" and ")),
    )?;
    let crests = report.crests.unwrap_or_default();
    stage.check(
        has(&checked, code::THREAD_CRESTS.name()) && (crests.crest_mm - 0.35).abs() < 0.005,
        &format!(
            "and the finishing pass, meant for {} mm, finds crests of {} mm: THREAD-CRESTS",
            number(crests.finishing_infeed_mm, 2),
            number(crests.crest_mm, 3)
        ),
    )?;
    Ok(checked)
}

fn has(checked: &Checked, code: &str) -> bool {
    checked.report.findings.iter().any(|finding| finding.code == code)
}

/// The same thread from the planner; its program.
async fn plan_thread(stage: &mut Stage, client: &mut Client, machine: &str) -> Result<String, CliError> {
    stage.step("The same thread, planned")?;
    let request = PlanThreadRequest {
        on: Some(On::Machine(feedwave_contract::names::machine(machine))),
        work_diameter_mm: 10.0,
        advance: Some(Advance::LeadMm(2.5)),
        start_z_mm: 100.0,
        end_z_mm: 60.0,
        depth_mm: 1.75,
        first_depth_mm: 1.0,
        finishing_allowance_mm: Some(0.018),
        infeed: InfeedPattern::Flank.into(),
        spindle_rev_per_min: 300.0,
        ..PlanThreadRequest::default()
    };
    let mut threads = client.threads();
    let response = threads.plan_thread(request).await.map_err(|status| client.failed(&status))?;
    let PlanThreadResponse { program, .. } = response.into_inner();
    for line in program.lines().filter(|line| line.starts_with("G32")) {
        stage.say(line)?;
    }
    let checked = submit(client, machine, PLANNED, &program).await?;
    let report = report(&checked);
    let both = vibrating(&report).filter(|pass| breaks(pass) == (true, true)).count();
    stage.check(
        checked.report.findings.is_empty() && both == 4 && vibrating(&report).count() == 4,
        &format!("as a job: {both} vibrating passes break their chips in depth and full section, nothing is found"),
    )?;
    let found_mm = report.crests.unwrap_or_default().finishing_thickness_mm;
    stage.check(
        found_mm <= FINISHING_MM && found_mm > 0.0,
        &format!("the finishing pass finds {} mm, of {FINISHING_MM} mm permitted", number(found_mm, 3)),
    )?;
    Ok(program)
}

/// One pass against a spindle whose speed varies, compared with the stream of the job.
async fn follow(stage: &mut Stage, client: &mut Client, programmed: &Checked) -> Result<(), CliError> {
    stage.step("A spindle that is not constant")?;
    let section = programmed.report.threads.first().cloned().unwrap_or_default();
    let thread = section.thread.unwrap_or_default();
    let line = thread.passes.get(FOLLOWED_PASS as usize).map_or(0, |pass| pass.line);
    let request = StreamSetpointsRequest {
        job: programmed.job.name.clone(),
        frame: Frame::Work.into(),
        ..StreamSetpointsRequest::default()
    };
    let (blocks, _) = read_request(client, request).await?;
    let streamed = pass_of(&blocks, line);
    // The thread starts at a passage of the reference point: the last whole turn before Z moves.
    let start_deg = streamed.first().map_or(0.0, |point| 360.0 * (point[0] / 360.0).floor());
    // The measured spindle slows down and speeds up again: its angles come closer together and further apart.
    let end_deg = streamed.last().map_or(0.0, |point| point[0]);
    let share = |step: usize| step as f64 / STEPS as f64;
    let measured = |step: usize| {
        let turned = share(step) + 0.08 * (2.0 * std::f64::consts::TAU * share(step)).sin();
        start_deg + turned.clamp(0.0, 1.0) * (end_deg - start_deg)
    };
    // Where the stream has its setpoints, the same angles, in between others.
    let mut angles: Vec<f64> = (0..=STEPS).map(measured).chain(streamed.iter().map(|point| point[0])).collect();
    angles.sort_by(f64::total_cmp);
    let start = FollowSpindleStart {
        job: programmed.job.name.clone(),
        pass: FOLLOWED_PASS,
        angle_kind: SpindleAngleKind::Unwrapped.into(),
        reference_angle_deg: Some(start_deg),
        ..FollowSpindleStart::default()
    };
    let messages =
        [Follow::Start(start), Follow::Angles(SpindleAngles { angles_deg: angles.clone(), time_ns: Vec::new() })]
            .map(|message| FollowSpindleRequest { message: Some(message) });
    let mut threads = client.threads();
    let answer = threads.follow_spindle(stream::iter(messages)).await.map_err(|status| client.failed(&status))?;
    let mut answer = answer.into_inner();
    let mut followed = FollowedPositions::default();
    while let Some(message) = answer.message().await.map_err(|status| client.failed(&status))? {
        if let Some(Followed::Positions(positions)) = message.message {
            followed = positions;
        }
    }
    let farthest_mm = streamed.iter().filter_map(|[angle_deg, x, z]| {
        let index = angles.partition_point(|angle| angle < angle_deg);
        Some((followed.x_mm.get(index)? - x).abs().max((followed.z_mm.get(index)? - z).abs()))
    });
    let farthest_mm = farthest_mm.fold(0.0, f64::max);
    stage.check(
        streamed.len() > 1_000 && followed.x_mm.len() == angles.len() && farthest_mm < 1e-9,
        &format!(
            "pass 2 played against {} measured angles is on the thread of the stream at {} equal ones",
            count(angles.len() as u64),
            count(streamed.len() as u64)
        ),
    )
}

/// Angles that the spindle reports.
const STEPS: usize = 5_000;

/// Spindle angle in degrees, X and Z of the setpoints of a line while Z moves.
fn pass_of(blocks: &[SetpointBlock], line: u32) -> Vec<[f64; 3]> {
    let point =
        |block: &SetpointBlock, row: usize| [block.spindle_angle_deg[row], block.axes[0][row], block.axes[1][row]];
    let rows = blocks.iter().flat_map(|block| (0..block.len()).map(move |row| (block, row)));
    let points: Vec<_> =
        rows.filter(|(block, row)| block.line[*row] == line).map(|(block, row)| point(block, row)).collect();
    let first = points.windows(2).position(|pair| pair[0][2] != pair[1][2]).map_or(0, |first| first + 1);
    let last = points.windows(2).rposition(|pair| pair[0][2] != pair[1][2]).map_or(0, |last| last + 1);
    points.get(first..=last).map(<[_]>::to_vec).unwrap_or_default()
}

fn draw(profile: &MachineProfile, planned: &str, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let mut written = Vec::new();
    for (name, directory, program) in [(NAME, "thread-as-programmed", THREAD), (PLANNED, "thread-planned", planned)] {
        written.extend(common::draw(name, program, PipelineConfig::new(profile.clone()), out, directory)?);
    }
    Ok(written)
}
