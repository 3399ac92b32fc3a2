//! Pictures of a five-axis program: its rotary axes over time and its tool directions on the sphere, as programmed and
//! thinned, and what thinning deviates along the program.

mod deviation;
mod rotary;
mod sphere;

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use feedwave_cutting::SetpointBlock;
use feedwave_cutting::thinning::{DeviationTrace, ThinningSettings};
use feedwave_motion::kinematics::RotaryDirections;

use super::canvas::{self, PlotError};
use super::series::Series;
use super::theme;
use super::trace::{PathTrace, Point, Stretch};
use deviation::DeviationPicture;
use rotary::RotaryPicture;
use sphere::SpherePicture;

/// Samples kept of the close view at most.
const MAX_CLOSE_SAMPLES: usize = 20_000;
/// The colours of both plans.
const AS_PROGRAMMED: plotters::style::RGBColor = theme::VIBRATION;
const AS_RUN: plotters::style::RGBColor = theme::COMMAND;

/// What has to be known of the machine and the program before setpoints come.
#[derive(Clone, Debug)]
pub struct FiveAxisSetup {
    /// Column of each rotary axis and its sign there; the one next to the work first.
    pub columns: [(usize, f64); 2],
    /// Their letters.
    pub letters: [char; 2],
    /// Which directions their angles give.
    pub directions: RotaryDirections,
    /// Lines of the cuts with a guided tool, in ascending stretches.
    pub cuts: Vec<RangeInclusive<u32>>,
    /// Lines of the close view.
    pub close_lines: RangeInclusive<u32>,
    /// Interpolation period, s.
    pub period_s: f64,
}

/// What thinning did, for captions and tolerances.
#[derive(Clone, Debug)]
pub struct ThinningShown {
    /// The tolerances.
    pub settings: ThinningSettings,
    /// Deviations along the program.
    pub deviations: DeviationTrace,
    /// Reversals of each rotary axis as programmed.
    pub reversals_before: [u64; 2],
    /// Reversals that are left.
    pub reversals_after: [u64; 2],
    /// Times of the thinned blocks as programmed and as they are left, s.
    pub times_s: [f64; 2],
    /// Blocks read and dropped.
    pub blocks: [u64; 2],
}

/// One plan: its rotary axes, setpoint by setpoint, in bounded memory.
#[derive(Clone, Debug)]
struct Plan {
    /// Over time, degrees.
    angles_deg: [Series; 2],
    /// Extent of each axis while cutting, degrees.
    cut_extents_deg: [(f64, f64); 2],
    /// Tool directions while cutting.
    directions: PathTrace,
    close: Vec<CloseSample>,
    last: Option<Point>,
}

/// A setpoint of the close view.
#[derive(Clone, Copy, Debug)]
struct CloseSample {
    time_s: f64,
    path_mm: f64,
    angles_deg: [f64; 2],
}

/// Which setpoints belong to the close view.
#[derive(Clone, Debug)]
enum Close {
    Lines(RangeInclusive<u32>),
    Path(Range<f64>),
}

impl Plan {
    fn new() -> Self {
        Self {
            angles_deg: Default::default(),
            cut_extents_deg: [(f64::INFINITY, f64::NEG_INFINITY); 2],
            directions: PathTrace::default(),
            close: Vec::new(),
            last: None,
        }
    }

    fn push(&mut self, block: &SetpointBlock, setup: &FiveAxisSetup, close: &Close) {
        for row in 0..block.len() {
            let time_s = (block.first_index + row as u64) as f64 * setup.period_s;
            let angles_deg = setup.columns.map(|(column, sign)| sign * block.axes[column][row]);
            for (series, angle_deg) in self.angles_deg.iter_mut().zip(angles_deg) {
                series.push(time_s, angle_deg);
            }
            let (line, path_mm) = (block.line[row], block.path_position_mm[row]);
            let place = setup.cuts.partition_point(|cut| *cut.end() < line);
            if setup.cuts.get(place).is_none_or(|cut| !cut.contains(&line)) {
                self.last = None;
                continue;
            }
            for (extent, angle_deg) in self.cut_extents_deg.iter_mut().zip(angles_deg) {
                *extent = (extent.0.min(angle_deg), extent.1.max(angle_deg));
            }
            let direction = setup.directions.at(angles_deg.map(f64::to_radians));
            if let Some(last) = self.last.replace(direction) {
                self.directions.line(Stretch::Cutting, last, direction);
            }
            let is_close = match close {
                Close::Lines(lines) => lines.contains(&line),
                Close::Path(path) => path.contains(&path_mm),
            };
            if is_close && self.close.len() < MAX_CLOSE_SAMPLES {
                self.close.push(CloseSample { time_s, path_mm, angles_deg });
            }
        }
    }

    /// The path of the close view.
    fn close_path_mm(&self) -> Option<Range<f64>> {
        Some(self.close.first()?.path_mm..self.close.last()?.path_mm)
    }
}

/// Collects what the pictures of a five-axis program show.
#[derive(Clone, Debug)]
pub struct FiveAxisPlots {
    setup: FiveAxisSetup,
    thinning: Option<ThinningShown>,
    /// Without thinning, where it makes a difference.
    as_programmed: Option<Plan>,
    as_run: Plan,
    close: Close,
}

impl FiveAxisPlots {
    /// Pictures of a program in which nothing is compared yet.
    #[must_use]
    pub fn new(setup: FiveAxisSetup, thinning: Option<ThinningShown>) -> Self {
        let close = Close::Lines(setup.close_lines.clone());
        Self { setup, thinning, as_programmed: None, as_run: Plan::new(), close }
    }

    /// Takes in a block of the program with every block; before those of the program as it is run.
    pub fn push_as_programmed(&mut self, block: &SetpointBlock) {
        self.as_programmed.get_or_insert_with(Plan::new).push(block, &self.setup, &self.close);
    }

    /// Says that every block was taken in: the close view shows the same stretch of the path from here on.
    pub fn finish_as_programmed(&mut self) {
        if let Some(path_mm) = self.as_programmed.as_ref().and_then(Plan::close_path_mm) {
            self.close = Close::Path(path_mm);
        }
    }

    /// Forgets the program with every block.
    pub fn discard_as_programmed(&mut self) {
        self.as_programmed = None;
    }

    /// Takes in a block of the program as it is run.
    pub fn push(&mut self, block: &SetpointBlock) {
        self.as_run.push(block, &self.setup, &self.close);
    }

    /// Both plans with their colours and names, the first one below.
    fn plans(&self) -> impl Iterator<Item = (&Plan, plotters::style::RGBColor, &'static str)> {
        let before = self.as_programmed.iter().map(|plan| (plan, AS_PROGRAMMED, "as programmed"));
        before.chain([(&self.as_run, AS_RUN, if self.as_programmed.is_some() { "thinned" } else { "as run" })])
    }

    /// Draws everything.
    pub(super) fn write(&self, program: &str, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
        let mut files = Vec::new();
        files.extend(canvas::write(&RotaryPicture { program, plots: self }, directory)?);
        if !self.as_run.directions.runs().is_empty() {
            files.extend(canvas::write(&SpherePicture { program, plots: self }, directory)?);
        }
        if let Some(thinning) = self.thinning.as_ref().filter(|thinning| thinning.blocks[1] > 0) {
            files.extend(canvas::write(&DeviationPicture { program, thinning }, directory)?);
        }
        Ok(files)
    }
}
