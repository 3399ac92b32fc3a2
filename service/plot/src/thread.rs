//! Pictures of a thread: the unrolled work with the paths of all passes, X over the spindle angle, and the section of
//! the groove. All show one groove at the same place on the work, as the chip is judged.

mod position;
mod section;
mod unrolled;

use std::path::{Path, PathBuf};

use feedwave_cutting::thread::{Clearance, LeadAxis, ThreadJob, ThreadPass, ThreadReport};
use plotters::style::RGBColor;

use super::canvas::{self, PlotError};
use super::figure::Figure;
use super::theme::Ink;

/// Passes that a legend entry names.
const LEGEND_PASSES: usize = 4;
/// Colours of passes: none of them is near those of what becomes of the chip.
const PASS_COLORS: [RGBColor; 6] = [
    RGBColor(0, 100, 170),
    RGBColor(240, 190, 50),
    RGBColor(205, 130, 200),
    RGBColor(45, 15, 200),
    RGBColor(205, 85, 0),
    RGBColor(120, 200, 245),
];

/// A thread to draw.
#[derive(Clone, Debug)]
pub struct ThreadPictures<'a> {
    /// What the files are called: `NAME-unrolled`, `NAME-position` and `NAME-section`.
    pub name: String,
    /// The thread.
    pub job: &'a ThreadJob,
    /// Its report.
    pub report: &'a ThreadReport,
}

/// Draws a thread into the directory, which is created where it is missing; no picture of a thread whose report has no
/// passes.
///
/// # Errors
/// When a file cannot be written.
pub fn write_thread(pictures: &ThreadPictures<'_>, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    canvas::make(directory)?;
    let mut files = Vec::new();
    for figure in figures(pictures) {
        files.extend(canvas::write(&figure, directory)?);
    }
    Ok(files)
}

/// Every picture of a thread, as data.
pub(super) fn figures(pictures: &ThreadPictures<'_>) -> Vec<Figure> {
    if pictures.report.passes.is_empty() {
        return Vec::new();
    }
    let groove = &Groove::new(pictures);
    vec![
        unrolled::UnrolledPicture { groove }.figure(),
        position::PositionPicture { groove }.figure(),
        section::SectionPicture { groove }.figure(),
    ]
}

/// One groove of a thread with its passes: what the pictures show.
struct Groove<'a> {
    name: &'a str,
    job: &'a ThreadJob,
    report: &'a ThreadReport,
    /// Passes of the groove that is drawn, as indices into the thread's.
    passes: Vec<usize>,
}

impl<'a> Groove<'a> {
    /// The first groove: the others of a multi-start thread are cut alike.
    fn new(pictures: &'a ThreadPictures<'_>) -> Self {
        let passes = &pictures.job.passes;
        let start = passes.iter().map(|pass| pass.start).min().unwrap_or_default();
        let own = (0..passes.len()).filter(|index| passes[*index].start == start);
        Self { name: &pictures.name, job: pictures.job, report: pictures.report, passes: own.collect() }
    }

    fn pass(&self, index: usize) -> &'a ThreadPass {
        &self.job.passes[index]
    }

    fn deepest_mm(&self) -> f64 {
        self.passes.iter().map(|index| self.pass(*index).depth_mm).fold(0.0, f64::max)
    }

    /// Retreat of a pass, mm on the radius, at a spindle angle of the first pass, degrees: where that one is at the
    /// same place on the work.
    fn retreat_mm(&self, index: usize, work_angle_deg: f64) -> f64 {
        let wave = self.job.wave(self.pass(index));
        let shift_deg = self.report.passes[index].place.phase_shift_deg;
        wave.at_phase_mm(self.job.vibrations_per_rev * work_angle_deg - shift_deg)
    }

    /// Depth of the tip of a pass, mm on the radius; below 0 above the work.
    fn tip_mm(&self, index: usize, work_angle_deg: f64) -> f64 {
        self.pass(index).depth_mm - self.retreat_mm(index, work_angle_deg)
    }

    /// Phase ψ at a spindle angle of the first pass, degrees.
    fn phase_deg(&self, work_angle_deg: f64) -> f64 {
        self.job.vibrations_per_rev * work_angle_deg
    }

    /// Clearances of a pass in both models: depth only, full section.
    fn clearances(&self, index: usize) -> [Clearance; 2] {
        use feedwave_cutting::thread::ChipLevel::{Depth, Section};
        [Depth, Section].map(|level| Clearance::of(self.job, index, level))
    }

    /// What is drawn, in one line.
    fn subtitle(&self) -> String {
        let geometry = &self.job.geometry;
        let starts = match geometry.starts {
            0 | 1 => String::new(),
            starts => format!(" \u{b7} first of {starts} starts"),
        };
        let line = match self.passes.first().map(|index| self.pass(*index).span.line) {
            None | Some(0) => String::new(),
            Some(line) => format!("from line {line} \u{b7} "),
        };
        let work = match geometry.lead_axis {
            LeadAxis::Z => format!("{} mm diameter", short(2.0 * geometry.work_mm)),
            LeadAxis::X => format!("a face at Z {} mm", short(geometry.work_mm)),
        };
        format!(
            "{line}{} passes on {work} \u{b7} lead {} mm \u{b7} tool {} degrees \u{b7} {} vibrations per \
             revolution{starts}",
            self.passes.len(),
            short(geometry.lead_mm),
            short(self.job.profile.included_angle_deg),
            short(self.job.vibrations_per_rev)
        )
    }

    /// Name of the axis across the lead.
    fn across_name(&self) -> &'static str {
        match self.job.geometry.lead_axis {
            LeadAxis::Z => "X (radius)",
            LeadAxis::X => "Z",
        }
    }

    /// Name of the axis along the lead.
    fn along_name(&self) -> &'static str {
        match self.job.geometry.lead_axis {
            LeadAxis::Z => "Z",
            LeadAxis::X => "X (radius)",
        }
    }

    /// Colour of the pass at a place of `passes`; neighbours differ.
    fn color(&self, place: usize) -> RGBColor {
        PASS_COLORS[place % PASS_COLORS.len()]
    }

    /// What the pass at a place of `passes` is called: all passes of one colour have one name.
    fn pass_name(&self, place: usize) -> String {
        let first = place % PASS_COLORS.len();
        let same: Vec<usize> = (first..self.passes.len()).step_by(PASS_COLORS.len()).collect();
        let number = |place: &usize| {
            let still = if self.pass(self.passes[*place]).vibrates() { "" } else { " (no vibration)" };
            format!("{}{still}", self.passes[*place] + 1)
        };
        let numbers: Vec<String> = same.iter().take(LEGEND_PASSES).map(number).collect();
        let more = if same.len() > LEGEND_PASSES { ", …" } else { "" };
        format!("{} {}{more}", if same.len() > 1 { "passes" } else { "pass" }, numbers.join(", "))
    }

    /// What the work that a pass cuts is filled with.
    fn fill(&self, place: usize) -> Ink {
        Ink::fill(self.pass_name(place), self.color(place), 0.6)
    }

    /// Spindle angle, degrees, after which everything repeats: one revolution where D is a whole number, else more, but
    /// no more than fits.
    fn shown_deg(&self) -> f64 {
        let vibrations = self.job.vibrations_per_rev;
        // Few vibrations can be distinguished.
        let revolutions: f64 = if (vibrations - vibrations.round()).abs() < 1e-9 { 1.0 } else { 2.0 };
        360.0 * revolutions.min(24.0 / vibrations)
    }
}

/// A number without superfluous decimals.
fn short(value: f64) -> String {
    super::figure::short(value, 4)
}

/// The ink of a path in the air, where the chip is cut through.
fn cut_through() -> Ink {
    Ink::line("in the air with the full section: the chip is cut through", super::theme::GOOD, 4.5)
}

/// Stretches of consecutive points for which a condition holds, each with at least two points.
fn stretches(points: &[(f64, f64)], holds: impl Fn(usize) -> bool) -> Vec<Vec<(f64, f64)>> {
    let mut found: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut open = false;
    for (index, point) in points.iter().enumerate() {
        let inside = holds(index);
        match found.last_mut() {
            Some(last) if inside && open => last.push(*point),
            _ if inside => found.push(vec![*point]),
            _ => {}
        }
        open = inside;
    }
    found.retain(|stretch| stretch.len() > 1);
    found
}
