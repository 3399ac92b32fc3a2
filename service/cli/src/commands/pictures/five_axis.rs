//! What the pictures of a five-axis program show: the path of the tool centre point, and both plans where it is
//! thinned.

use std::ops::RangeInclusive;
use std::sync::Arc;

use feedwave_cutting::{Frame, PipelineConfig, ValidationReport};
use feedwave_motion::kinematics::{Kinematics, Setup};
use feedwave_program::{Axis, GuidedMove, MoveKind, Position, ToolGuide};

use super::super::CliError;
use super::super::local::{self, Progress};
use super::super::source::Source;
use super::super::terminal::{Unit, progress};
use super::{CHORD_RAD, MAX_CHORDS};
use crate::plot::{FiveAxisPlots, FiveAxisSetup, PathTrace, Point, Stretch, ThinningShown};

/// Cuts distinguished at most; further ones belong to the last one.
const MAX_CUTS: usize = 2_000;
/// Lines of the close view, and how many of a cut lie before it, where the cut is that long.
const CLOSE_LINES: u32 = 48;
const LINES_BEFORE: u32 = 15;

/// The path of a guided tool, as the program gives it.
#[derive(Clone, Debug, Default)]
pub(super) struct GuidedPath {
    /// Where its centre point is, once every coordinate was programmed.
    tip_mm: Option<Point>,
    /// Lines of the cuts.
    cuts: Vec<RangeInclusive<u32>>,
    cutting: bool,
    /// Work offset of the first cut, whose work coordinates the tool directions are shown in.
    work_offset: Option<Position>,
}

impl GuidedPath {
    /// The tool is not guided, or not any more.
    pub(super) const fn interrupt(&mut self) {
        (self.tip_mm, self.cutting) = (None, false);
    }

    /// Draws a move.
    pub(super) fn add(&mut self, guided: &GuidedMove, line: u32, trace: &mut PathTrace) {
        // The tip moves with the rotary axes and how, only the machine knows.
        if matches!(guided.guide, ToolGuide::Axes | ToolGuide::Align(_)) {
            return self.interrupt();
        }
        let cutting = guided.step.kind != MoveKind::Rapid;
        let before = self.tip_mm;
        // In a tilted plane the words are in its coordinates, and what is drawn in work coordinates.
        let from = match &guided.plane {
            Some(plane) => before.map(|tip_mm| plane.from_work(tip_mm)),
            None => before,
        };
        let value = |axis: Axis| {
            let index = axis.index();
            if guided.held.contains(axis) { from.map(|tip| tip[index]) } else { Some(guided.step.end[index]) }
        };
        let to = match [Axis::X, Axis::Y, Axis::Z].map(value) {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        };
        self.tip_mm = match &guided.plane {
            Some(plane) => to.map(|point_mm| plane.to_work(point_mm)),
            None => to,
        };
        if let (Some(from_mm), Some(to_mm)) = (before, self.tip_mm) {
            let stretch = if cutting { Stretch::Cutting } else { Stretch::Rapid };
            let circle = from.and_then(|from| Circle::of(guided, from, to?));
            let chords = circle.as_ref().map_or(1, Circle::chords);
            let mut last_mm = from_mm;
            for chord in 1..=chords {
                let next_mm = match &circle {
                    Some(circle) if chord < chords => {
                        let point_mm = circle.at(f64::from(chord) / f64::from(chords));
                        guided.plane.as_ref().map_or(point_mm, |plane| plane.to_work(point_mm))
                    }
                    _ => to_mm,
                };
                trace.line(stretch, last_mm, next_mm);
                last_mm = next_mm;
            }
        }
        let full = self.cuts.len() == MAX_CUTS;
        match self.cuts.last_mut() {
            Some(last) if cutting && (self.cutting || full) => *last = *last.start()..=line,
            _ if cutting => self.cuts.push(line..=line),
            _ => {}
        }
        if cutting {
            self.work_offset.get_or_insert(guided.step.work_offset);
        }
        self.cutting = cutting;
    }

    /// Lines of a close view: of the first cut that is long enough, or of the longest one.
    fn close_lines(&self) -> Option<RangeInclusive<u32>> {
        let length = |cut: &&RangeInclusive<u32>| cut.end() - cut.start();
        let long = self.cuts.iter().find(|cut| length(cut) >= CLOSE_LINES + LINES_BEFORE);
        let cut = long.or_else(|| self.cuts.iter().max_by_key(length))?;
        let start = if long.is_some() { cut.start() + LINES_BEFORE } else { *cut.start() };
        Some(start..=(start + CLOSE_LINES).min(*cut.end()))
    }
}

/// The circle of a move in a tilted plane, in the coordinates of the plane.
struct Circle {
    start: Point,
    end: Point,
    /// First and second axis of the circle's plane.
    axes: [usize; 2],
    center: [f64; 2],
    sweep_rad: f64,
}

impl Circle {
    fn of(guided: &GuidedMove, start: Point, end: Point) -> Option<Self> {
        let arc = guided.step.arc?;
        let (first, second) = arc.plane.axes();
        let axes = [first.index(), second.index()];
        Some(Self { start, end, axes, center: arc.center, sweep_rad: arc.sweep_rad })
    }

    fn chords(&self) -> u32 {
        (self.sweep_rad.abs() / CHORD_RAD).ceil().clamp(1.0, MAX_CHORDS) as u32
    }

    fn at(&self, share: f64) -> Point {
        let from = [0, 1].map(|axis| self.start[self.axes[axis]] - self.center[axis]);
        let (sine, cosine) = (self.sweep_rad * share).sin_cos();
        let mut point = [0, 1, 2].map(|axis| self.start[axis] + (self.end[axis] - self.start[axis]) * share);
        point[self.axes[0]] = self.center[0] + from[0] * cosine - from[1] * sine;
        point[self.axes[1]] = self.center[1] + from[0] * sine + from[1] * cosine;
        point
    }
}

/// The pictures of a program with guided moves, with every block taken in where thinning drops some.
pub(super) fn prepare(
    source: &mut Source,
    config: &PipelineConfig,
    report: &ValidationReport,
    guided_path: GuidedPath,
) -> Result<Option<FiveAxisPlots>, CliError> {
    let kinematics = config.profile.kinematics.as_ref().and_then(|description| Kinematics::new(description).ok());
    let (Some(kinematics), Some(close_lines)) = (kinematics, guided_path.close_lines()) else { return Ok(None) };
    let machine = &config.profile.machine;
    let rotary = kinematics.letters().1;
    let column = |axis: Axis| {
        let column = machine.column_of(axis)?;
        let sign = if config.frame == Frame::Machine { machine.axes[column].sign() } else { 1.0 };
        Some((column, sign))
    };
    let [Some(first), Some(second)] = rotary.map(column) else { return Ok(None) };
    let setup = FiveAxisSetup {
        columns: [first, second],
        letters: rotary.map(Axis::letter),
        directions: kinematics.rotary_directions(),
        work: Setup {
            work: kinematics.work_frame_at(&kinematics.from_position(&guided_path.work_offset.unwrap_or_default())),
            tool_length_mm: 0.0,
        },
        cuts: guided_path.cuts,
        close_lines,
        period_s: config.period_s(),
    };
    let thinning = report.thinning.as_ref().map(|thinning| ThinningShown {
        settings: config.profile.thinning,
        deviations: thinning.deviations.clone(),
        reversals_before: thinning.figures.rotary.reversals_before,
        reversals_after: thinning.figures.rotary.reversals_after,
        times_s: [thinning.time_before_s, thinning.time_after_s],
        blocks: [thinning.figures.blocks_read, thinning.figures.blocks_dropped],
    });
    let drops = thinning.as_ref().is_some_and(|thinning| thinning.blocks[1] > 0);
    let mut plots = FiveAxisPlots::new(setup, thinning);
    if drops {
        let every_block = Arc::new(PipelineConfig { every_block: true, ..config.clone() });
        let bar = progress("comparing", Unit::Setpoints, 0);
        let is_whole = local::run_plan(source, every_block, |block| {
            bar.inc(block.len() as u64);
            plots.push_as_programmed(block);
            Ok(Progress::Continue)
        })?;
        bar.finish_and_clear();
        // A block that thinning drops may be one that the machine cannot reach.
        if is_whole { plots.finish_as_programmed() } else { plots.discard_as_programmed() }
    }
    Ok(Some(plots))
}
