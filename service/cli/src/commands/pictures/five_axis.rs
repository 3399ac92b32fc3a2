//! What the pictures of a five-axis program show: the path of the tool centre point, and both plans where it is
//! thinned.

use std::ops::RangeInclusive;
use std::sync::Arc;

use feedwave_cutting::{Frame, GuidedCuts, PipelineConfig, ValidationReport};
use feedwave_motion::kinematics::{Kinematics, Setup};
use feedwave_plot::{FiveAxisPlots, FiveAxisSetup, ThinningShown};
use feedwave_program::Axis;

use super::super::CliError;
use super::super::local::{self, Progress};
use super::super::source::Source;
use super::super::terminal::{Unit, progress};

/// Lines of the close view, and how many of a cut lie before it, where the cut is that long.
const CLOSE_LINES: u32 = 48;
const LINES_BEFORE: u32 = 15;

/// Lines of a close view: of the first cut that is long enough, or of the longest one.
fn close_lines(cuts: &[RangeInclusive<u32>]) -> Option<RangeInclusive<u32>> {
    let length = |cut: &&RangeInclusive<u32>| cut.end() - cut.start();
    let long = cuts.iter().find(|cut| length(cut) >= CLOSE_LINES + LINES_BEFORE);
    let cut = long.or_else(|| cuts.iter().max_by_key(length))?;
    let start = if long.is_some() { cut.start() + LINES_BEFORE } else { *cut.start() };
    Some(start..=(start + CLOSE_LINES).min(*cut.end()))
}

/// The pictures of a program with guided moves, with every block taken in where thinning drops some.
pub(super) fn prepare(
    source: &mut Source,
    config: &PipelineConfig,
    report: &ValidationReport,
    guided: GuidedCuts,
) -> Result<Option<FiveAxisPlots>, CliError> {
    let kinematics = config.profile.kinematics.as_ref().and_then(|description| Kinematics::new(description).ok());
    let (Some(kinematics), Some(close_lines)) = (kinematics, close_lines(&guided.lines)) else { return Ok(None) };
    let machine = &config.profile.machine;
    let rotary = kinematics.letters().1;
    let column = |axis: Axis| {
        let column = machine.column_of(axis)?;
        let sign = if config.frame == Frame::Machine { machine.axes[column].sign() } else { 1.0 };
        Some(((column, sign), machine.axes[column].max_velocity_per_s))
    };
    let [Some(first), Some(second)] = rotary.map(column) else { return Ok(None) };
    let setup = FiveAxisSetup {
        columns: [first.0, second.0],
        letters: rotary.map(Axis::letter),
        max_velocities_deg_per_s: [first.1, second.1],
        directions: kinematics.rotary_directions(),
        work: Setup {
            work: kinematics.work_frame_at(&kinematics.from_position(&guided.work_offset.unwrap_or_default())),
            tool_length_mm: 0.0,
        },
        cuts: guided.lines,
        close_lines,
        period_s: config.period_s(),
    };
    let thinning = report.thinning.as_ref().map(|thinning| ThinningShown {
        settings: config.profile.thinning,
        deviations: thinning.deviations.clone(),
        reversals_before: thinning.figures.rotary.reversals_before,
        reversals_after: thinning.figures.rotary.reversals_after,
        reversals_by_other_method: {
            let other = thinning.methods.iter().find(|of| of.method != thinning.method);
            other.map(|of| of.figures.rotary.reversals_after)
        },
        times_s: [thinning.time_before_s, thinning.time_after_s],
        blocks: [thinning.figures.blocks_read, thinning.figures.blocks_dropped],
    });
    let drops = thinning.as_ref().is_some_and(|thinning| thinning.blocks[1] > 0);
    let mut plots = FiveAxisPlots::new(setup, thinning);
    if drops {
        compare(source, config, &mut plots)?;
    }
    Ok(Some(plots))
}

/// Plans the program again with every block, and by the other method of thinning, for what the pictures compare.
fn compare(source: &mut Source, config: &PipelineConfig, plots: &mut FiveAxisPlots) -> Result<(), CliError> {
    let every_block = Arc::new(PipelineConfig { every_block: true, ..config.clone() });
    let bar = progress("comparing", Unit::Setpoints, 0);
    let is_whole = local::run_plan(source, every_block, |block| {
        bar.inc(block.len() as u64);
        plots.push_as_programmed(block);
        Ok(Progress::Continue)
    })?;
    bar.finish_and_clear();
    // A block that thinning drops may be one that the machine cannot reach.
    if is_whole {
        plots.finish_as_programmed();
    } else {
        plots.discard_as_programmed();
    }
    let mut other = config.clone();
    other.profile.thinning = config.profile.thinning.with_other_method();
    let bar = progress("comparing", Unit::Setpoints, 0);
    let is_whole = local::run_plan(source, Arc::new(other), |block| {
        bar.inc(block.len() as u64);
        plots.push_by_other_method(block);
        Ok(Progress::Continue)
    })?;
    bar.finish_and_clear();
    if !is_whole {
        plots.discard_by_other_method();
    }
    Ok(())
}
