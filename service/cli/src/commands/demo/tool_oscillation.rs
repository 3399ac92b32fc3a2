//! The oscillation steps of the demo: a face that four edges rough and finish in one pass, and what is refused.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use feedwave_contract::convert::tool_for_pipeline;
use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::{
    CreateToolRequest, FeedOverrideChange, JobState, OscillationEdge, OscillationSectionReport, Tool,
};
use feedwave_cutting::tool_oscillation::{OscillationPeriod, Waveform};
use feedwave_cutting::{MachineProfile, PipelineConfig, SetpointBlock, code};

use super::super::CliError;
use super::super::client::Client;
use super::super::machine::read_machine;
use super::super::terminal::{count, number};
use super::super::tools::read_library;
use super::Stage;
use super::common::{self, Checked, make_machine, read, submit_with};

const PROGRAM: &str = include_str!("../../../../../tests/fixtures/oscillation-mill.nc");
const NAME: &str = "oscillation-mill.nc";
const PROFILE: &str = include_str!("../../../../../tests/fixtures/oscillation-mill.toml");
const TOOLS: &str = include_str!("../../../../../tests/fixtures/oscillation-tools.toml");
const MACHINE: &str = "demo-oscillating-mill";
const TOOL: &str = "demo-cutter";
/// The tool of the program.
const TOOL_NUMBER: u32 = 4;

/// The path of the program while the tool oscillates: a line, a quarter of a circle to the left, a line, mm.
const LINES_MM: [f64; 2] = [100.0, 60.0];
const RADIUS_MM: f64 = 40.0;
const START_MM: [f64; 2] = [-70.0, 0.0];
const DEPTH_MM: f64 = 1.0;
/// Over this much of the path at both ends the oscillation is blended in and out, mm: two periods.
const RAMP_MM: f64 = 2.0;
/// Amplitudes of the condition, mm.
const FEED_MM: f64 = 0.4;
const AXIAL_MM: f64 = 0.03;
/// Feed override while it runs: setpoint and ratio.
const OVERRIDES: [(u64, f64); 3] = [(4_000, 0.4), (9_000, 0.0), (10_000, 1.5)];

/// All of them; the files written.
pub(super) async fn all(stage: &mut Stage, client: &mut Client, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    stage.step(&format!("A tool that oscillates: {NAME}"))?;
    stage.say(
        "A face mill of 120 mm with four edges goes 0.4 mm forwards and backwards and 0.03 mm up and down\nin every \
         revolution, so that its edges share the work: some rough, one finishes. As published.",
    )?;
    let mut written = Vec::new();
    for (name, text) in [("oscillation-mill.toml", PROFILE), ("oscillation-tools.toml", TOOLS)] {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|error| CliError::file(&path, &error))?;
        written.push(path);
    }
    let mut profile = read_machine(&written[0], None)?.profile;
    let tools = read_library(&written[1])?;
    add_wrong_conditions(&mut profile);
    make_machine(stage, client, MACHINE, "Mill whose tool oscillates", &profile).await?;
    make_tool(stage, client, &tools).await?;
    let checked = judge(stage, client).await?;
    follow(stage, client, &checked).await?;
    refuse(stage, client).await?;
    written.extend(draw(profile, &tools, out)?);
    Ok(written)
}

/// Conditions that cannot be or are not good: three periods in a revolution of four edges, and too short a hold.
fn add_wrong_conditions(profile: &mut MachineProfile) {
    let Some(accuracy) = profile.tool_oscillation.first().cloned() else { return };
    let mut thirds = accuracy.clone();
    (thirds.name, thirds.number) = ("thirds".to_owned(), 8);
    thirds.condition.period = OscillationPeriod::PerRevolution(3);
    let mut hasty = accuracy;
    (hasty.name, hasty.number) = ("hasty".to_owned(), 9);
    hasty.condition.axial.waveform = Waveform::HeldPeak { hold_share: 0.2 };
    profile.tool_oscillation.extend([thirds, hasty]);
}

async fn make_tool(stage: &Stage, client: &Client, tools: &[Tool]) -> Result<(), CliError> {
    let tool = tools.iter().find(|tool| tool.number == TOOL_NUMBER).cloned();
    let request = CreateToolRequest { tool_id: TOOL.to_owned(), tool };
    client.tools().create_tool(request).await.map_err(|status| client.failed(&status))?;
    stage.say(&format!("and tools/{TOOL}: its edges, their length, height and angles"))
}

/// Width and height of each layer of an edge, mm.
fn layers(edge: &OscillationEdge) -> Vec<[f64; 4]> {
    edge.layers.iter().map(|layer| [layer.low_mm, layer.high_mm, layer.from_mm, layer.to_mm]).collect()
}

/// The worked example: what every edge removes.
async fn judge(stage: &mut Stage, client: &mut Client) -> Result<Checked, CliError> {
    let checked = submit_with(client, MACHINE, NAME, PROGRAM, &[TOOL]).await?;
    let section = checked.report.oscillations.first().cloned().unwrap_or_default();
    let OscillationSectionReport { hold_share, required_hold_share, edges, .. } = &section;
    stage.check(
        checked.job.state() == JobState::Ready && section.feasible,
        &format!(
            "the machine can run it: the protrusion is held for {} of the period, {} is enough",
            number(*hold_share, 3),
            number(*required_hold_share, 3)
        ),
    )?;
    let expected: [&[[f64; 4]]; 4] = [
        &[[0.0, 0.03, -0.5, 0.0], [0.03, 1.0, -0.35, 0.0]],
        &[[0.03, 1.0, 0.0, 0.65]],
        &[[0.0, 0.03, 0.0, 0.5]],
        &[[-0.03, 0.0, -0.65, 0.35]],
    ];
    let as_published = edges.len() == 4
        && edges.iter().zip(expected).all(|(edge, expected)| {
            let found = layers(edge);
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
            found.len() == expected.len() && found.iter().flatten().zip(expected.iter().flatten()).all(near)
        });
    stage.check(as_published, "E2 takes the surface, E1 and E3 the layer below, E4 the deepest: as published")?;
    let area_mm2: f64 = edges.iter().map(|edge| edge.area_mm2).sum();
    stage.check(
        (area_mm2 - 1.03).abs() < 1e-9 && section.finishing_edges == [4],
        &format!("together {} mm² per revolution: 1 mm of feed, 1.03 mm deep; E4 finishes", number(area_mm2, 4)),
    )?;
    let finding = checked.report.findings.iter().find(|finding| finding.code == code::OSC_JERK_STEP.name());
    let step = finding.and_then(|finding| finding.values.first()).map_or(f64::NAN, |value| value.value);
    stage.check(
        (step - 740.22).abs() < 0.01 && finding.is_some_and(|finding| !finding.suggestions.is_empty()),
        &format!(
            "its published waveform steps the acceleration by {} mm/s²: OSC-JERK-STEP, with a smooth one offered",
            number(step, 4)
        ),
    )?;
    let floor = section.floor.unwrap_or_default();
    let roughness = floor.oscillating.unwrap_or_default();
    stage.check(
        roughness.unswept_share == 0.0
            && roughness.peak_to_valley_mm < 1e-6
            && (roughness.height_mm + AXIAL_MM).abs() < 1e-6,
        &format!("{} mm lower than commanded the simulated floor is flat", number(-roughness.height_mm, 3)),
    )?;
    Ok(checked)
}

/// Setpoints of the oscillating part.
struct Followed {
    /// Those with the whole oscillation.
    whole: u64,
    /// Largest distance of any of them from the formula of docs/functions/tool-oscillation.md ("Motion"), mm.
    farthest_mm: f64,
    /// Furthest before the start and beyond the end of the section in the feed direction, mm.
    beyond_mm: f64,
}

/// Compares setpoints with the formula of docs/functions/tool-oscillation.md ("Motion"), each at its own spindle angle
/// and place on the path.
fn followed(blocks: &[SetpointBlock]) -> Followed {
    let length_mm = LINES_MM[0] + 0.5 * PI * RADIUS_MM + LINES_MM[1];
    let rows = || blocks.iter().flat_map(|block| (0..block.len()).map(move |row| (block, row)));
    // The section starts where the path was when X was at its start.
    let first = rows().find(|(block, row)| block.line[*row] == 9);
    let start_mm = first.map_or(f64::NAN, |(block, row)| {
        block.path_position_mm[row] - (block.axes[0][row] - block.vibration_offset_mm[row] - START_MM[0])
    });
    let mut found = Followed { whole: 0, farthest_mm: 0.0, beyond_mm: 0.0 };
    for (block, row) in rows() {
        let along_mm = block.path_position_mm[row] - start_mm;
        if !(0.0..=length_mm).contains(&along_mm) || !(9..=11).contains(&block.line[row]) {
            continue;
        }
        let place = [0, 1, 2].map(|axis| block.axes[axis][row]);
        found.beyond_mm = found.beyond_mm.max(START_MM[0] - place[0]).max(place[1] - (RADIUS_MM + LINES_MM[1]));
        if along_mm < RAMP_MM || along_mm > length_mm - RAMP_MM {
            continue;
        }
        let turned_rad = ((along_mm - LINES_MM[0]) / RADIUS_MM).clamp(0.0, 0.5 * PI);
        let (sin, cos) = turned_rad.sin_cos();
        let straight_mm = (along_mm - LINES_MM[0] - 0.5 * PI * RADIUS_MM).max(0.0);
        let command = [
            START_MM[0] + along_mm.min(LINES_MM[0]) + RADIUS_MM * sin,
            START_MM[1] + RADIUS_MM * (1.0 - cos) + straight_mm,
        ];
        // A clockwise spindle turns against the feed direction's turn to the left.
        let turns = block.spindle_angle_deg[row] / 360.0 + turned_rad / TAU;
        let turns = turns - turns.floor();
        let forwards_mm = FEED_MM * (TAU * turns).sin();
        let wanted = [command[0] + forwards_mm * cos, command[1] + forwards_mm * sin, -DEPTH_MM + retraction_mm(turns)];
        let square: f64 = place.iter().zip(wanted).map(|(a, b)| (a - b) * (a - b)).sum();
        found.farthest_mm = found.farthest_mm.max(square.sqrt());
        found.whole += 1;
    }
    found
}

/// The axial waveform as the source states it: held for 0.3 of the period at both extremes, half sines between.
fn retraction_mm(turns: f64) -> f64 {
    match turns {
        _ if turns < 0.1 => AXIAL_MM * (TAU * turns / 0.4).sin(),
        _ if turns < 0.4 => AXIAL_MM,
        _ if turns < 0.6 => AXIAL_MM * (PI * (turns - 0.4) / 0.2).cos(),
        _ if turns < 0.9 => -AXIAL_MM,
        _ => -AXIAL_MM * (PI * (turns - 0.9) / 0.2).cos(),
    }
}

/// The setpoints, as programmed and with the feed override moved.
async fn follow(stage: &mut Stage, client: &mut Client, checked: &Checked) -> Result<(), CliError> {
    let (blocks, _) = read(client, &checked.job, 0, Vec::new()).await?;
    let found = followed(&blocks);
    stage.check(
        found.whole > 20_000 && found.farthest_mm < 1e-7,
        &format!(
            "{} setpoints lie on the published formula at their own spindle angle, along the curve too",
            count(found.whole)
        ),
    )?;
    stage.check(found.beyond_mm < 1e-9, "the tool never passes the ends of the cut in the feed direction")?;
    let change = |(index, ratio)| FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) };
    let (blocks, _) = read(client, &checked.job, 0, OVERRIDES.map(change).to_vec()).await?;
    let found = followed(&blocks);
    stage.check(
        found.whole > 20_000 && found.farthest_mm < 1e-7 && found.beyond_mm < 1e-9,
        "at 40 %, held, and at 150 % of the feed they still do: the spindle drives the phase",
    )
}

/// What is refused, with numbers and a cure.
async fn refuse(stage: &mut Stage, client: &mut Client) -> Result<(), CliError> {
    stage.step("What no tool can do is refused before anything moves")?;
    let wrong: [(&str, String, &[&str], &str, bool); 4] = [
        ("three-periods.nc", PROGRAM.replace("P1", "P8"), &[TOOL], code::OSC_EDGES_PERIOD.name(), true),
        ("too-fast.nc", PROGRAM.replace("F600", "F1200"), &[TOOL], code::OSC_STEP_LONG.name(), true),
        ("no-edges.nc", PROGRAM.to_owned(), &[], code::OSC_TOOL_UNKNOWN.name(), true),
        ("short-hold.nc", PROGRAM.replace("P1", "P9"), &[TOOL], code::OSC_HOLD_SHORT.name(), false),
    ];
    for (name, program, tools, code, refused) in wrong {
        let checked = submit_with(client, MACHINE, name, &program, tools).await?;
        let finding = checked.report.findings.iter().find(|finding| finding.code == code).cloned().unwrap_or_default();
        let cure = finding.suggestions.first().map_or("", |suggestion| suggestion.message.as_str());
        stage.say(&format!("{}: {}", finding.code, finding.message))?;
        let is_refused = checked.job.state() == JobState::Rejected;
        let how = if refused { "refused" } else { "warned of" };
        stage.check(is_refused == refused && !cure.is_empty(), &format!("{how}, and the cure is named: {cure}"))?;
    }
    Ok(())
}

fn draw(profile: MachineProfile, tools: &[Tool], out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let tools = tools.iter().map(tool_for_pipeline).collect();
    common::draw(NAME, PROGRAM, PipelineConfig { tools, ..PipelineConfig::new(profile) }, out, "oscillation")
}
