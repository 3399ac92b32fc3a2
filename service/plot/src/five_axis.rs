//! Pictures of a five-axis program: its rotary axes over time and its tool directions on the sphere, as programmed and
//! thinned, and what thinning deviates along the program.

mod deviation;
mod rotary;
mod sphere;

use std::ops::{Range, RangeInclusive};

use deviation::DeviationPicture;
use feedwave_cutting::SetpointBlock;
use feedwave_cutting::thinning::{DeviationTrace, ThinningMethod, ThinningSettings};
use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{RotaryDirections, Setup, ToolPose};
use rotary::RotaryPicture;
use sphere::SpherePicture;

use super::figure::Figure;
use super::series::Series;
use super::theme::{self, Ink};
use super::trace::{PathTrace, Point, Stretch};

/// Samples kept of the close view at most.
const MAX_CLOSE_SAMPLES: usize = 20_000;
/// A rotary axis that turns back by less has not turned back: setpoints are rounded, degrees.
const STILL_DEG: f64 = 1e-6;

/// What has to be known of the machine and the program before setpoints come.
#[derive(Clone, Debug)]
pub struct FiveAxisSetup {
    /// Column of each rotary axis and its sign there; the one next to the work first.
    pub columns: [(usize, f64); 2],
    /// Their letters.
    pub letters: [char; 2],
    /// Their largest velocities, degrees/s.
    pub max_velocities_deg_per_s: [f64; 2],
    /// Which directions their angles give.
    pub directions: RotaryDirections,
    /// Work coordinates in which they are shown: rotary offsets turn them against the machine.
    pub work: Setup,
    /// Lines of the cuts with a guided tool, in ascending stretches.
    pub cuts: Vec<RangeInclusive<u32>>,
    /// Lines of the close view.
    pub close_lines: RangeInclusive<u32>,
    /// Interpolation period, s.
    pub period_s: f64,
}

impl FiveAxisSetup {
    /// A direction on the part of the machine that carries the work, in work coordinates.
    fn on_work(&self, direction: Vec3) -> Vec3 {
        self.work.to_work(&ToolPose { tip_mm: [0.0; 3], direction }).direction
    }

    /// The tool direction of a setpoint, in work coordinates.
    fn direction(&self, block: &SetpointBlock, row: usize, angles_deg: [f64; 2]) -> Vec3 {
        match block.tool_direction.as_slice() {
            [x, y, z] => [x[row], y[row], z[row]],
            _ => self.on_work(self.directions.at(angles_deg.map(f64::to_radians))),
        }
    }
}

/// What thinning did, for captions and tolerances.
#[derive(Clone, Debug)]
pub struct ThinningShown {
    /// The tolerances.
    pub settings: ThinningSettings,
    /// Deviations along the program.
    pub deviations: DeviationTrace,
    /// Reversals of each rotary axis inside the thinned cuts as programmed.
    pub reversals_before: [u64; 2],
    /// Reversals inside them that are left.
    pub reversals_after: [u64; 2],
    /// Reversals that the other method leaves.
    pub reversals_by_other_method: Option<[u64; 2]>,
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
    reversals: [Reversals; 2],
}

/// Counts how often an angle turns back.
#[derive(Clone, Copy, Debug, Default)]
struct Reversals {
    /// Farthest angle in the sense of the last turn, and that sense; none before it has turned.
    farthest: Option<(f64, f64)>,
    count: u64,
}

impl Reversals {
    fn add(&mut self, angle_deg: f64) {
        match self.farthest {
            None => self.farthest = Some((angle_deg, 0.0)),
            Some((from, sense)) => {
                let travel = angle_deg - from;
                if travel * sense > 0.0 {
                    self.farthest = Some((angle_deg, sense));
                } else if travel.abs() > STILL_DEG {
                    self.count += u64::from(sense != 0.0);
                    self.farthest = Some((angle_deg, travel.signum()));
                }
            }
        }
    }
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
            reversals: Default::default(),
        }
    }

    fn push(&mut self, block: &SetpointBlock, setup: &FiveAxisSetup, close: &Close) {
        for row in 0..block.len() {
            let time_s = (block.first_index + row as u64) as f64 * setup.period_s;
            let angles_deg = setup.columns.map(|(column, sign)| sign * block.axes[column][row]);
            for (series, angle_deg) in self.angles_deg.iter_mut().zip(angles_deg) {
                series.push(time_s, angle_deg);
            }
            for (reversals, angle_deg) in self.reversals.iter_mut().zip(angles_deg) {
                reversals.add(angle_deg);
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
            let direction = setup.direction(block, row, angles_deg);
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
    /// Thinned by the other method.
    by_other_method: Option<Plan>,
    as_run: Plan,
    close: Close,
}

/// How a program is thinned by a method.
const fn named(method: ThinningMethod) -> &'static str {
    match method {
        ThinningMethod::Published => "thinned as published",
        ThinningMethod::Fitted => "thinned by a fit",
    }
}

impl FiveAxisPlots {
    /// Pictures of a program in which nothing is compared yet.
    #[must_use]
    pub fn new(setup: FiveAxisSetup, thinning: Option<ThinningShown>) -> Self {
        let close = Close::Lines(setup.close_lines.clone());
        Self { setup, thinning, as_programmed: None, by_other_method: None, as_run: Plan::new(), close }
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

    /// Takes in a block of the program thinned by the other method; behind those of the program with every block.
    pub fn push_by_other_method(&mut self, block: &SetpointBlock) {
        self.by_other_method.get_or_insert_with(Plan::new).push(block, &self.setup, &self.close);
    }

    /// Forgets the program thinned by the other method.
    pub fn discard_by_other_method(&mut self) {
        self.by_other_method = None;
    }

    /// Takes in a block of the program as it is run.
    pub fn push(&mut self, block: &SetpointBlock) {
        self.as_run.push(block, &self.setup, &self.close);
    }

    /// The plans with their inks, the first one below and wider, so that none hides the others.
    fn plans(&self) -> impl Iterator<Item = (&Plan, Ink)> {
        let method = self.thinning.as_ref().map(|thinning| thinning.settings.method);
        let before = self.as_programmed.iter().map(|plan| (plan, Ink::line("as programmed", theme::VIBRATION, 3.2)));
        let other_name = method.map_or("thinned otherwise", |method| named(method.other()));
        let other = self.by_other_method.iter().map(move |plan| (plan, Ink::line(other_name, theme::GOOD, 2.4)));
        let name = match method {
            Some(method) if self.by_other_method.is_some() => named(method),
            _ if self.as_programmed.is_some() => "thinned",
            _ => "as run",
        };
        before.chain(other).chain([(&self.as_run, Ink::line(name, theme::COMMAND, 1.6))])
    }

    /// Every picture, as data.
    pub(super) fn figures(&self, program: &str) -> Vec<Figure> {
        let mut figures = vec![RotaryPicture { program, plots: self }.figure()];
        if !self.as_run.directions.runs().is_empty() {
            figures.push(SpherePicture { program, plots: self }.figure());
        }
        if let Some(thinning) = self.thinning.as_ref().filter(|thinning| thinning.blocks[1] > 0) {
            figures.push(DeviationPicture { program, thinning }.figure());
        }
        figures
    }
}

#[cfg(test)]
mod tests {
    use feedwave_motion::kinematics::vector::{angle, norm, sub};
    use feedwave_program::{Axis, Position};

    use super::*;

    fn block(rotary_deg: [f64; 2], tool_direction: Vec<Vec<f64>>) -> SetpointBlock {
        let [first, second] = rotary_deg.map(|angle_deg| vec![angle_deg]);
        SetpointBlock {
            first_index: 0,
            axes: vec![second, first],
            tool_direction,
            path_position_mm: vec![0.0],
            feed_mm_per_min: vec![0.0],
            vibration_offset_mm: vec![0.0],
            spindle_angle_deg: vec![0.0],
            line: vec![1],
            servo: None,
        }
    }

    #[test]
    fn turning_back_is_counted_and_noise_is_not() {
        let count = |angles: &[f64]| {
            let mut reversals = Reversals::default();
            angles.iter().for_each(|angle| reversals.add(*angle));
            reversals.count
        };
        assert_eq!(count(&[0.0, 0.0, 1.0, 2.0, 2.0 - 1e-9, 3.0, 3.0]), 0);
        assert_eq!(count(&[0.0, -1.0, -2.0, -1.0, -1.0, 5.0, 4.0]), 2);
        // Slowly, by less than the threshold at a time.
        let slowly: Vec<f64> =
            (0..100).map(|step| f64::from(if step < 50 { step } else { 100 - step }) * 4e-7).collect();
        assert_eq!(count(&slowly), 1);
    }

    #[test]
    fn directions_are_in_work_coordinates_whatever_the_stream_is_in() {
        let (z, kinematics) = ([0.0, 0.0, 1.0], crate::tests::trunnion());
        let mut offset = Position::default();
        (offset[Axis::A.index()], offset[Axis::C.index()]) = (-20.0, 30.0);
        let setup = FiveAxisSetup {
            columns: [(1, 1.0), (0, 1.0)],
            letters: ['C', 'A'],
            max_velocities_deg_per_s: [720.0, 360.0],
            directions: kinematics.rotary_directions(),
            work: Setup { work: kinematics.work_frame_at(&kinematics.from_position(&offset)), tool_length_mm: 0.0 },
            cuts: vec![1..=1],
            close_lines: 1..=1,
            period_s: 1e-3,
        };
        let shown = |block: &SetpointBlock, angles_deg| setup.direction(block, 0, angles_deg);
        // At the offsets the tool is along Z of the work, which is not the line of C any more.
        let at_offset = shown(&block([30.0, -20.0], Vec::new()), [30.0, -20.0]);
        assert!(norm(sub(at_offset, z)) < 1e-12, "{at_offset:?}");
        let pole = setup.on_work(setup.directions.first_axis());
        assert!((angle(pole, z).to_degrees() - 20.0).abs() < 1e-9);
        // A stream in work coordinates says itself where the tool points; its angles count from the offsets.
        let told = block([0.0, 0.0], vec![vec![0.0], vec![0.6], vec![0.8]]);
        assert_eq!(shown(&told, [0.0, 0.0]), [0.0, 0.6, 0.8]);
    }
}
