//! The milling steps of the demo: rounded corners, a feed hold and a feed override.

use std::path::{Path, PathBuf};

use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::{FeedOverrideChange, LimitTimes};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, SetpointBlock};

use super::super::CliError;
use super::super::client::Client;
use super::super::terminal::{counted, number};
use super::Stage;
use super::common::{self, Checked, bits, make_machine, read, submit};

const CONTOUR: &str = include_str!("../../../../../tests/fixtures/contour-mill.nc");
const NAME: &str = "contour-mill.nc";
pub(super) const MACHINE: &str = "demo-mill";
/// What the program asks for at corners, and what it is compared with.
const ROUNDED: &str = "G64 P0.02";
const EXACT: &str = "G61";
const TOLERANCE_MM: f64 = 0.02;
/// Feed hold, for a second, and then one and a half times the feed.
const HOLD: (u64, u64) = (2_000, 3_000);
const FASTER: f64 = 1.5;

/// All of them; the pictures drawn.
pub(super) async fn all(stage: &mut Stage, client: &mut Client, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let profile = MachineProfile::mill();
    stage.step(&format!("A milling program: {NAME}, {}", counted(CONTOUR.lines().count() as u64, "line")))?;
    stage.say("A frame with sharp corners, a pocket of short lines, a spline; corners within 0.02 mm.")?;
    make_machine(stage, client, MACHINE, "Mill of the demo", &profile).await?;
    let rounded = submit(client, MACHINE, NAME, CONTOUR).await?;
    let exact = submit(client, MACHINE, "contour-mill-exact.nc", &CONTOUR.replace(ROUNDED, EXACT)).await?;
    let rounded_blocks = compare(stage, client, &rounded, &exact).await?;
    override_feed(stage, client, &rounded, &rounded_blocks).await?;
    draw(&profile, out)
}

fn duration_s(checked: &Checked) -> f64 {
    checked.report.summary.as_ref().map_or(f64::NAN, |summary| summary.duration_s)
}

/// Rounded against exact corners.
async fn compare(
    stage: &mut Stage,
    client: &mut Client,
    rounded: &Checked,
    exact: &Checked,
) -> Result<Vec<SetpointBlock>, CliError> {
    let [rounded_s, exact_s] = [rounded, exact].map(duration_s);
    stage.check(
        rounded_s < exact_s,
        &format!(
            "{ROUNDED} takes {} s, {EXACT} with a rest at every corner {} s",
            number(rounded_s, 4),
            number(exact_s, 4)
        ),
    )?;
    if let Some(LimitTimes { feed_s, corners_s, curvature_s, acceleration_s, jerk_s, .. }) =
        rounded.report.summary.as_ref().and_then(|summary| summary.limit_times)
    {
        stage.say(&format!(
            "Of it {} s at the programmed feed, {} s slowed by curves, {} s by their neighbours, {} s accelerating",
            number(feed_s, 3),
            number(curvature_s, 3),
            number(corners_s, 3),
            number(acceleration_s + jerk_s, 3)
        ))?;
    }
    let (rounded_blocks, _) = read(client, &rounded.job, 0, Vec::new()).await?;
    let (exact_blocks, _) = read(client, &exact.job, 0, Vec::new()).await?;
    let farthest_mm = farthest(&points(&rounded_blocks), &points(&exact_blocks));
    stage.check(
        farthest_mm <= TOLERANCE_MM * (1.0 + 1e-6) && farthest_mm > 0.5 * TOLERANCE_MM,
        &format!("the tool is never more than {} mm off the programmed path", number(farthest_mm, 3)),
    )?;
    Ok(rounded_blocks)
}

fn points(blocks: &[SetpointBlock]) -> Vec<[f64; 3]> {
    let point = |block: &SetpointBlock, row: usize| [0, 1, 2].map(|axis| block.axes[axis][row]);
    blocks.iter().flat_map(|block| (0..block.len()).map(move |row| point(block, row))).collect()
}

/// Largest distance of a point from the polyline through the others, mm. Both run in the same direction, so that the
/// nearest place moves on with the points.
fn farthest(points: &[[f64; 3]], polyline: &[[f64; 3]]) -> f64 {
    let square = |point: &[f64; 3], segment: &[[f64; 3]]| {
        let along: [f64; 3] = std::array::from_fn(|axis| segment[1][axis] - segment[0][axis]);
        let to: [f64; 3] = std::array::from_fn(|axis| point[axis] - segment[0][axis]);
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let share =
            if dot(&along, &along) > 0.0 { (dot(&to, &along) / dot(&along, &along)).clamp(0.0, 1.0) } else { 0.0 };
        let beside: [f64; 3] = std::array::from_fn(|axis| to[axis] - share * along[axis]);
        dot(&beside, &beside)
    };
    let mut near = 0;
    let mut largest = 0.0_f64;
    for point in points {
        // Beyond a few hundred setpoints ahead lies another part of the path.
        let window = polyline[near..].windows(2).take(400);
        let nearest = window.enumerate().map(|(index, segment)| (square(point, segment), index));
        let (distance, index) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
        near += index;
        largest = largest.max(distance.sqrt());
    }
    largest
}

/// How far the curve that points lie on may be from the chords between them, mm: an eighth of their largest second difference.
fn off_chords(points: &[[f64; 3]]) -> f64 {
    let bend = |around: &[[f64; 3]]| {
        let square = |axis: usize| (around[0][axis] - 2.0 * around[1][axis] + around[2][axis]).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    };
    points.windows(3).map(bend).fold(0.0, f64::max) / 8.0
}

/// Feed hold and override while the program runs.
async fn override_feed(
    stage: &mut Stage,
    client: &mut Client,
    rounded: &Checked,
    plain: &[SetpointBlock],
) -> Result<(), CliError> {
    stage.step("The feed override is part of the plan")?;
    let change = |index, ratio| FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) };
    let (blocks, _) = read(client, &rounded.job, 0, vec![change(HOLD.0, 0.0), change(HOLD.1, FASTER)]).await?;
    let rows = HOLD.0 as usize;
    stage.check(
        bits(&blocks, 0).take(rows).eq(bits(plain, 0).take(rows)),
        &format!("up to the feed hold at {} s not a bit differs", HOLD.0 as f64 / 1e3),
    )?;
    let (held, all) = (points(&blocks), points(plain));
    let still = held[..=HOLD.1 as usize].iter().rev().take_while(|point| **point == held[HOLD.1 as usize]).count();
    stage.check(still > 900, &format!("the axes are at rest for {still} of the 1 000 ms it lasts"))?;
    stage.check(
        held.last() == all.last() && farthest(&held, &all) < 1e-3 + off_chords(&all),
        "then one and a half times the feed, on the same path to the same end",
    )
}

fn draw(profile: &MachineProfile, out: &Path) -> Result<Vec<PathBuf>, CliError> {
    let overrides = [(HOLD.0, 0.0), (HOLD.1, FASTER)];
    let overrides = overrides.map(|(index, ratio)| OverrideChange { index, ratio }).to_vec();
    let config = PipelineConfig { overrides, ..PipelineConfig::new(profile.clone()) };
    common::draw(NAME, CONTOUR, config, out, "milling")
}
