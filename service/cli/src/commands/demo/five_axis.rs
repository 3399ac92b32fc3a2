//! The five-axis steps of the demo: a freeform surface whose tool directions flicker, thinned, streamed and checked by
//! forward kinematics.

use std::path::{Path, PathBuf};

use feedwave_contract::proto::{CreateToolRequest, JobState, ThinningReport, Tool};
use feedwave_cutting::{MachineProfile, PipelineConfig, SetpointBlock, code};
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, dot, norm, sub};
use feedwave_motion::kinematics::{JointValues, Kinematics, Setup};
use feedwave_program::{AXIS_COUNT, Axis, ToolOffset};

use super::super::CliError;
use super::super::client::Client;
use super::super::machine::read_machine;
use super::super::terminal::{count, counted, number};
use super::Stage;
use super::common::{self, Checked, make_machine, read, submit_with};

/// A part of what `cargo run -p feedwave-tests --bin freeform` writes.
const FREEFORM: &str = include_str!("../../../../../tests/fixtures/freeform.nc");
const NAME: &str = "freeform.nc";
/// An A/C trunnion table under a spindle with three linear axes.
const PROFILE: &str = include_str!("../../../../../tests/fixtures/five-axis-mill.toml");
const PROFILE_NAME: &str = "five-axis-mill.toml";
const MACHINE: &str = "demo-five-axis";
const TOOL: &str = "demo-ball";
const LENGTH_MM: f64 = 120.0;
/// A direction that is none, and one that the table cannot tilt to.
const WRONG: &str = "G0 A-20\nG43.5 H1\nG0 X0 Y0 Z20 I0 J0.3 K1\nG1 X5 I0 J0 K0 F1000\nG1 X6 I0 J-1 K-1\nM30\n";

/// All of them; the files written.
pub(super) async fn all(stage: &mut Stage, client: &mut Client, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let path = out.join(PROFILE_NAME);
    std::fs::write(&path, PROFILE).map_err(|error| CliError::file(&path, &error))?;
    let profile = read_machine(&path, None)?.profile;
    let lines = counted(FREEFORM.lines().count() as u64, "line");
    stage.step(&format!("Five axes: {NAME}, {lines}"))?;
    stage.say("A concave surface cut into triangles, a block at each edge that the path crosses. Directions averaged\nthere flicker, and the rotary axes with them.")?;
    make_machine(stage, client, MACHINE, "Five-axis mill of the demo", &profile).await?;
    let tool = Tool { number: 1, length_mm: Some(LENGTH_MM), ..Tool::default() };
    let request = CreateToolRequest { tool_id: TOOL.to_owned(), tool: Some(tool) };
    let mut tools = client.tools();
    tools.create_tool(request).await.map_err(|status| client.failed(&status))?;

    let checked = thinned(stage, client, &profile).await?;
    follow(stage, client, &checked, &profile).await?;
    refuse(stage, client).await?;
    draw(profile, path, out)
}

/// The program as a job: what thinning makes of it.
async fn thinned(stage: &mut Stage, client: &mut Client, profile: &MachineProfile) -> Result<Checked, CliError> {
    let checked = submit_with(client, MACHINE, NAME, FREEFORM, &[TOOL]).await?;
    let thinning = checked.report.thinning.clone().unwrap_or_default();
    let ThinningReport { blocks_read, blocks_dropped, position_deviation_mm, .. } = thinning;
    stage.check(
        checked.job.state() == JobState::Ready && blocks_dropped > blocks_read / 2,
        &format!("M33 drops {} of {} blocks", count(blocks_dropped), count(blocks_read)),
    )?;
    let axes = &thinning.rotary_axes;
    let reversals: Vec<_> =
        axes.iter().map(|axis| format!("{} {} → {}", axis.axis, axis.reversals_before, axis.reversals_after)).collect();
    stage.check(
        axes.len() == 2 && axes.iter().all(|axis| axis.reversals_after * 10 < axis.reversals_before),
        &format!("and with them the flicker, in reversals: {}", reversals.join(", ")),
    )?;
    let tolerance_mm = profile.thinning.distance_tolerance_mm;
    stage.check(
        position_deviation_mm > 0.0 && position_deviation_mm < tolerance_mm,
        &format!(
            "no dropped block is more than {} mm off the path that is left, of {tolerance_mm} mm permitted",
            number(position_deviation_mm, 3)
        ),
    )?;
    let (before_s, after_s) = (thinning.time_before_s, thinning.time_after_s);
    stage.check(after_s < 0.5 * before_s, &format!("{} s instead of {} s", number(after_s, 3), number(before_s, 4)))?;
    Ok(checked)
}

/// Where each line of the program ends, mm: words are modal.
fn ends() -> Vec<Vec3> {
    let mut place = [0.0; 3];
    let lines = FREEFORM.lines().map(|line| {
        for word in line.split_whitespace() {
            let Some(axis) = "XYZ".find(|letter| word.starts_with(letter)) else { continue };
            place[axis] = word[1..].parse().unwrap_or(place[axis]);
        }
        place
    });
    lines.collect()
}

/// The machine axes of the stream, by forward kinematics, against the programmed segments.
async fn follow(
    stage: &mut Stage,
    client: &mut Client,
    checked: &Checked,
    profile: &MachineProfile,
) -> Result<(), CliError> {
    let (blocks, _) = read(client, &checked.job, 0, Vec::new()).await?;
    let Some(kinematics) = profile.kinematics.as_ref().and_then(|description| Kinematics::new(description).ok()) else {
        return stage.check(false, "the machine has kinematics");
    };
    let offset = profile.language.work_offsets[0];
    let linear_mm = [Axis::X, Axis::Y, Axis::Z].map(|axis| offset[axis.index()]);
    let linear_mm = kinematics.letters().0.map(|axis| linear_mm[axis.index()]);
    let origin = kinematics.gauge_point_at(&JointValues { linear_mm, rotary_rad: [0.0; 2] });
    let setup = Setup::new(origin, LENGTH_MM);
    let tip = |block: &SetpointBlock, row: usize| {
        let mut position = [0.0; AXIS_COUNT];
        for (axis, column) in profile.machine.axes.iter().zip(&block.axes) {
            position[axis.axis.index()] = axis.sign() * column[row];
        }
        kinematics.forward(&kinematics.from_position(&position), &setup).tip_mm
    };
    let ends = ends();
    // From the first cut to the last.
    let of = |word: &str| FREEFORM.lines().position(|line| line.starts_with(word)).unwrap_or_default();
    let guided = of("M33") + 2..of("M34") + 1;
    let (mut before, mut line, mut farthest_mm, mut points) = (0, 0, 0.0_f64, 0_u64);
    for block in &blocks {
        for row in (0..block.len()).filter(|row| guided.contains(&(block.line[*row] as usize))) {
            let here = block.line[row] as usize;
            if here != line {
                (before, line) = (line, here);
            }
            if before > 0 {
                farthest_mm = farthest_mm.max(distance_mm(tip(block, row), ends[before - 1], ends[line - 1]));
                points += 1;
            }
        }
    }
    stage.check(
        points > 10_000 && farthest_mm < 1e-9,
        &format!(
            "{} setpoints of X Y Z A C, by forward kinematics: the tool centre point is on its segment within 1e-9 mm",
            count(points)
        ),
    )
}

/// Distance of a point from a segment, mm.
fn distance_mm(point: Vec3, start: Vec3, end: Vec3) -> f64 {
    let (travel, from_start) = (sub(end, start), sub(point, start));
    let square = dot(travel, travel);
    let share = if square > 0.0 { (dot(from_start, travel) / square).clamp(0.0, 1.0) } else { 0.0 };
    norm(sub(point, add_scaled(start, travel, share)))
}

/// Directions that cannot be.
async fn refuse(stage: &mut Stage, client: &mut Client) -> Result<(), CliError> {
    let checked = submit_with(client, MACHINE, "wrong-directions.nc", WRONG, &[TOOL]).await?;
    let finding = |code: &str| checked.report.findings.iter().find(|finding| finding.code == code);
    let refused = checked.job.state() == JobState::Rejected;
    stage.check(
        refused && finding(feedwave_program::code::TOOL_DIRECTION.name()).is_some(),
        "I0 J0 K0 is no direction, and is refused before anything moves: PRG-TOOL-DIRECTION",
    )?;
    let range = finding(code::FIVE_AXIS_RANGE.name()).cloned().unwrap_or_default();
    if let Some(cure) = range.suggestions.first() {
        stage.say(&format!("{}: {}\ncure: {}", range.code, range.message, cure.message))?;
    }
    stage.check(
        refused && !range.values.is_empty() && !range.suggestions.is_empty(),
        "nor can the table tilt that far: numbers and a cure",
    )
}

fn draw(profile: MachineProfile, profile_path: PathBuf, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let offset = ToolOffset::new(1).with_length(LENGTH_MM);
    let tool = feedwave_cutting::Tool { number: 1, offset, ..feedwave_cutting::Tool::default() };
    let config = PipelineConfig { tools: vec![tool], ..PipelineConfig::new(profile) };
    let mut written = vec![profile_path];
    written.extend(common::draw(NAME, FREEFORM, config, out, "five-axis")?);
    Ok(written)
}
