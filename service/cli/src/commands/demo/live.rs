//! The live step of the demo: a simulated machine in the loop, a connection that breaks, and the proof from the log.

use std::path::{Path, PathBuf};

use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::{
    Decision, DecisionAction, ReplayRunRequest, RunSettings, RunState, SetMonitoringRequest,
};
use feedwave_plot::write_run;
use feedwave_simulator::{Contact, Description, Simulator, Where};

use super::super::CliError;
use super::super::client::Client;
use super::super::decisions::{self, heading, line};
use super::super::run::{Drive, default_monitoring};
use super::super::terminal::{count, number};
use super::Stage;
use super::common::submit;

/// A slot, milled too fast for its depth.
const SLOT: &str = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X100 F1200\nG0 X110\nM30\n";
const NAME: &str = "slot-mill.nc";
const CUT_LINE: u32 = 3;
const DEPTH_MM: f64 = 0.75;
/// Spindle speed of the baseline, rev/min.
const IDLE_REV_PER_MIN: f64 = 1_000.0;
/// Setpoints after which the connection breaks.
const BREAK_AT: u64 = 800;

/// All of it; the files written.
pub(super) async fn all(
    stage: &mut Stage,
    client: &mut Client,
    machine: &str,
    out: &Path,
) -> Result<Vec<PathBuf>, CliError> {
    stage.step(&format!("A live run: {NAME} on a simulated machine, its deflection decides the feed"))?;
    stage
        .say("Four edges, 10 mm, half immersed in steel; two distance sensors at 20 kHz; limits 0.003 and 0.01 mm.")?;
    let description = Description {
        seed: 7,
        contacts: vec![Contact { at: Where::Lines { first: CUT_LINE, last: CUT_LINE }, depth_mm: DEPTH_MM }],
        ..Description::default()
    };
    let checked = submit(client, machine, NAME, SLOT).await?;
    let config = default_monitoring(&description)?;
    let limits_mm = config.rules.as_ref().and_then(|rules| rules.feed).map(|feed| [feed.lower, feed.upper]);
    let mut telemetry = client.telemetry();
    let request = SetMonitoringRequest { job: checked.job.name.clone(), config: Some(config) };
    telemetry.set_monitoring(request).await.map_err(|status| client.failed(&status))?;
    let simulate = |interpolation_period_us| {
        Simulator::new(Description { interpolation_period_us, ..description })
            .map_err(|violations| CliError::trouble(format!("{violations:?}")))
    };
    let mut run = Drive::begin(client, &checked.job.name, RunSettings::default(), limits_mm, simulate).await?;
    let mut heard: Vec<Decision> = Vec::new();
    let mut hear = |decision: &Decision| {
        heard.push(decision.clone());
        Ok(())
    };
    run.idle(IDLE_REV_PER_MIN, &[], &mut hear).await?;
    run.follow(BREAK_AT, &mut hear).await?;
    let (taken, changes) = (run.taken, run.summary.changes());
    let durable = run.take_up(&mut hear).await?;
    run.follow(u64::MAX, &mut hear).await?;

    stage.say(&heading())?;
    for decision in &heard {
        stage.say(&line(decision))?;
    }
    loop_is_closed(stage, &heard)?;
    stage.check(
        taken >= BREAK_AT && durable.is_some() && changes > 0,
        &format!(
            "resumed after a break at setpoint {}: no setpoint is missing, none of the {changes} reported changes is lost",
            count(taken)
        ),
    )?;
    prove(stage, client, &run, &heard).await?;
    let directory = out.join("live");
    std::fs::create_dir_all(&directory).map_err(|error| CliError::file(&directory, &error))?;
    let program = out.join(NAME);
    std::fs::write(&program, SLOT).map_err(|error| CliError::file(&program, &error))?;
    let mut written = vec![program];
    written.extend(write_run(&run.trace, &directory).map_err(CliError::trouble)?);
    Ok(written)
}

/// The deflection that a window showed, mm, and the action.
fn judged(decisions: &[Decision]) -> impl Iterator<Item = (f64, DecisionAction)> {
    decisions.iter().filter_map(|decision| match decision.inputs.as_ref()?.evidence.as_ref()? {
        Evidence::Process(process) => Some((process.max_deviation, decision.outcome?.action())),
        _ => None,
    })
}

fn loop_is_closed(stage: &mut Stage, heard: &[Decision]) -> Result<(), CliError> {
    let windows: Vec<_> = judged(heard).collect();
    let slower = windows.iter().take_while(|(_, action)| *action == DecisionAction::Change).count();
    let [first, last] = [windows.first(), windows.last()].map(|window| window.map_or(f64::NAN, |window| window.0));
    let percent =
        heard.last().and_then(|decision| decision.outcome?.after).map_or(f64::NAN, |after| 100.0 * after.feed);
    stage.check(
        first > 0.01 && slower >= 2 && percent < 100.0,
        &format!(
            "the programmed feed bends the tool by {} mm; {slower} decisions lower it to {} %",
            number(first, 3),
            number(percent, 3)
        ),
    )?;
    let inside = &windows[slower.min(windows.len())..];
    stage.check(
        inside.len() >= 3
            && inside.iter().all(|(mm, action)| *action == DecisionAction::Keep && (0.003..=0.01).contains(mm)),
        &format!(
            "then every one of {} windows is inside the limits, the last at {} mm, and nothing changes",
            inside.len(),
            number(last, 3)
        ),
    )
}

async fn prove(stage: &mut Stage, client: &Client, run: &Drive, heard: &[Decision]) -> Result<(), CliError> {
    let request = ReplayRunRequest { run: run.name.clone(), start_index: 0 };
    let replayed = client.runs().replay_run(request).await;
    let replayed = replayed.map_err(|status| client.failed(&status))?.into_inner();
    let end = run.summary.end.clone().unwrap_or_default();
    stage.check(
        end.state() == RunState::Finished && replayed.identical && replayed.digest == end.digest,
        &format!(
            "replayed from the log: {} decisions and {} setpoints are the same, SHA-256 {}…",
            replayed.decision_count,
            count(replayed.setpoint_count),
            replayed.digest.get(..16).unwrap_or_default()
        ),
    )?;
    let listed = decisions::page(client, &run.name, 0).await?.decisions;
    stage.check(
        listed == heard,
        &format!("all {} decisions are in the log, each once, with all their inputs", listed.len()),
    )
}
