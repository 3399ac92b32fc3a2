//! What the pictures of a program show: its moves, its vibration close up, its chip.

mod deviation;
mod five_axis;
mod path_vibration;
mod thread;
mod tool_oscillation;

use std::ops::Range;
use std::path::{Path, PathBuf};

use feedwave_cutting::{
    Frame, GuidedCuts, PipelineConfig, SetpointBlock, ToolMotion, ToolPath, ToolPathSink, ValidationReport,
};
use feedwave_motion::MachineKind;
use feedwave_plot::{AxisShown, PathTrace, PlotError, Plots, Point, RapidLines};

use super::CliError;
use super::source::Source;

/// Vibration periods in a close view.
const PERIODS_SHOWN: f64 = 5.0;

/// Finds the first stretch of time in which the tool vibrates, while the program is validated.
#[derive(Clone, Debug, Default)]
pub(super) struct FirstVibration {
    indices: Option<Range<u64>>,
    ended: bool,
}

impl FirstVibration {
    /// Looks at a block.
    pub(super) fn observe(&mut self, block: &SetpointBlock) {
        if self.ended {
            return;
        }
        for row in 0..block.len() {
            let index = block.first_index + row as u64;
            let vibrates = match &block.servo {
                Some(servo) => servo.frequency_hz[row] > 0.0,
                None => block.vibration_offset_mm[row] != 0.0,
            };
            match (&mut self.indices, vibrates) {
                (None, true) => self.indices = Some(index..index + 1),
                (Some(indices), true) => indices.end = index + 1,
                // The wave passes through zero; a longer rest is the end.
                (Some(indices), false) if index > indices.end + GAP_SETPOINTS => {
                    self.ended = true;
                    return;
                }
                _ => {}
            }
        }
    }
}

/// Setpoints without offset within a vibration.
const GAP_SETPOINTS: u64 = 1_000;

/// Pictures of a valid program, ready to take its setpoints at `period_s`.
pub(super) fn prepare(
    source: &mut Source,
    config: &PipelineConfig,
    report: &ValidationReport,
    vibration: &FirstVibration,
    period_s: f64,
) -> Result<Plots, CliError> {
    let profile = &config.profile;
    let turning = profile.machine.kind == MachineKind::Lathe;
    let program = source.name.rsplit('/').next().unwrap_or_default().to_owned();
    let mut plots = Plots::new(program, turning, axes(config), config.period_s(), period_s);
    if config.frame == Frame::Work && profile.kinematics.is_some() {
        plots.show_the_work();
    }
    for change in &config.overrides {
        plots.add_override(change.index as f64 * config.period_s(), change.ratio);
    }
    let (Traced { trace, rapids }, guided) = Traced::read(source, config)?;
    plots.set_path(trace, rapids);
    if let Some(deviations) = deviation::trace(source, config, report)? {
        plots.set_deviations(deviations);
    }
    if let Some(five_axis) = five_axis::prepare(source, config, report, guided)? {
        plots.set_five_axis(five_axis);
    }
    let superposed = match (report.sections.first(), report.oscillations.first()) {
        (Some(section), _) => Some(("vibration", section.first_line, 1.0 / section.condition.frequency_hz)),
        (None, Some(section)) => {
            plots.oscillate();
            Some(("oscillation", section.line, section.report.period_s))
        }
        (None, None) => None,
    };
    if let (Some(indices), Some((what, line, wave_s))) = (&vibration.indices, superposed) {
        let title = format!("start of the {what}, line {line}");
        for (title, window) in windows(indices, title, wave_s, config.period_s()) {
            plots.add_window(title, window);
        }
    }
    path_vibration::prepare(&mut plots, report);
    Ok(plots)
}

/// Draws the sections of one machining function into a directory; the files.
type DrawSections = fn(&PipelineConfig, &ValidationReport, &Path) -> Result<Vec<PathBuf>, PlotError>;

/// The functions whose sections have pictures of their own.
const FUNCTIONS: [DrawSections; 2] = [thread::draw, tool_oscillation::draw];

/// Draws what needs no setpoints: every section on its own; the files.
pub(super) fn draw_sections(
    config: &PipelineConfig,
    report: &ValidationReport,
    directory: &Path,
) -> Result<Vec<PathBuf>, CliError> {
    let mut files = Vec::new();
    for draw in FUNCTIONS {
        files.extend(draw(config, report, directory).map_err(CliError::trouble)?);
    }
    Ok(files)
}

/// A close view of the start, called `title`, and one of the middle, for waves of `wave_s`.
fn windows(indices: &Range<u64>, title: String, wave_s: f64, period_s: f64) -> [(String, Range<f64>); 2] {
    let start_s = indices.start as f64 * period_s;
    let middle_s = (indices.start + (indices.end - indices.start) / 2) as f64 * period_s;
    [
        (title, (start_s - 0.1 * wave_s).max(0.0)..start_s + (PERIODS_SHOWN - 0.1) * wave_s),
        ("in the middle of the section".to_owned(), middle_s..middle_s + PERIODS_SHOWN * wave_s),
    ]
}

/// The axes of the machine with their limits.
fn axes(config: &PipelineConfig) -> Vec<AxisShown> {
    let axes = config.profile.machine.axes.iter();
    axes.map(|axis| AxisShown {
        name: axis.name.clone(),
        rotary: axis.axis.is_rotary(),
        max_velocity_per_s: axis.max_velocity_per_s,
        max_acceleration_per_s2: axis.max_acceleration_per_s2,
        max_jerk_per_s3: axis.max_jerk_per_s3,
    })
    .collect()
}

/// The path of a program, and which lines move rapidly.
#[derive(Default)]
struct Traced {
    trace: PathTrace,
    rapids: RapidLines,
}

impl ToolPathSink for Traced {
    fn line(&mut self, motion: ToolMotion, from: Point, to: Point) {
        self.trace.line(motion.into(), from, to);
    }

    fn rapid(&mut self, line: u32) {
        self.rapids.rapid(line);
    }

    fn cut(&mut self, line: u32, max_mm_per_min: f64) {
        self.rapids.cut(line, max_mm_per_min);
    }
}

impl Traced {
    /// Of the whole program, with its cuts with a guided tool.
    fn read(source: &mut Source, config: &PipelineConfig) -> Result<(Self, GuidedCuts), CliError> {
        let mut traced = Self::default();
        let cuts = read_path(source, config, &mut traced)?;
        traced.rapids.finish();
        Ok((traced, cuts))
    }
}

/// Reads the path of a whole program; its cuts with a guided tool.
fn read_path(
    source: &mut Source,
    config: &PipelineConfig,
    sink: &mut impl ToolPathSink,
) -> Result<GuidedCuts, CliError> {
    let mut path = ToolPath::new(config);
    while let Some(place) = path.read(sink) {
        match source.read(place)? {
            [] => path.finish_input(),
            piece => path.push(piece),
        }
    }
    Ok(path.finish(sink))
}
