//! What the pictures of a program show: its moves, its vibration close up, its chip.

mod five_axis;

use std::collections::HashSet;
use std::ops::Range;

use feedwave_cutting::{
    CutCondition, GuidedCuts, PipelineConfig, SectionReport, SetpointBlock, ToolMotion, ToolPath, ToolPathSink,
    ValidationReport,
};
use feedwave_motion::MachineKind;

use super::CliError;
use super::source::Source;
use super::terminal::number;
use crate::plot::{self, AxisShown, PathTrace, Plots, Point, RapidLines};

/// Pictures of chips at most: sections of one program are mostly alike.
const MAX_CHIP_PICTURES: usize = 8;
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
    for change in &config.overrides {
        plots.add_override(change.index as f64 * config.period_s(), change.ratio);
    }
    let (Traced { trace, rapids }, guided) = Traced::read(source, config)?;
    plots.set_path(trace, rapids);
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
    let mut drawn = HashSet::new();
    for section in &report.sections {
        let Some((subtitle, cuts)) = cuts(section) else { continue };
        let headings: Vec<_> = cuts.iter().map(|cut| cut.heading.clone()).collect();
        if drawn.len() < MAX_CHIP_PICTURES && drawn.insert(headings) {
            plots.add_chip(format!("chip-line-{}", section.first_line), subtitle, cuts);
        }
    }
    Ok(plots)
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
        let mut path = ToolPath::new(config);
        let mut traced = Self::default();
        while let Some(place) = path.read(&mut traced) {
            match source.read(place)? {
                [] => path.finish_input(),
                piece => path.push(piece),
            }
        }
        let cuts = path.finish(&mut traced);
        traced.rapids.finish();
        Ok((traced, cuts))
    }
}

/// The programmed cut and, where it does not break the chip, the suggested one.
fn cuts(section: &SectionReport) -> Option<(String, Vec<plot::Cut>)> {
    let chip = section.chip.as_ref()?;
    let condition = chip.condition;
    let subtitle = format!(
        "lines {} to {} \u{b7} {} rev/min \u{b7} feed {} mm/rev",
        section.first_line,
        section.last_line,
        number(condition.spindle_rev_per_min, 5),
        number(condition.feed_per_rev_mm, 4)
    );
    let mut cuts = vec![cut("programmed", condition)];
    if !chip.broken
        && let Some(&frequency_hz) = chip.recommended_frequencies_hz.first()
    {
        let mut suggested = CutCondition { frequency_hz, ..condition };
        if !suggested.breaks_chip() {
            // At half-integer D half the feed is enough; a little more breaks it with certainty.
            suggested.amplitude_mm = 0.6 * condition.feed_per_rev_mm;
        }
        cuts.push(cut("suggested", suggested));
    }
    Some((subtitle, cuts))
}

fn cut(which: &str, condition: CutCondition) -> plot::Cut {
    let broken = condition.breaks_chip();
    let heading = format!(
        "{which}: {} Hz, amplitude {} mm",
        number(condition.frequency_hz, 5),
        number(condition.amplitude_mm, 3)
    );
    let per_rev = format!("{:.3} vibrations per revolution", condition.vibrations_per_rev());
    let margin = condition.breaking_margin();
    let verdict = if broken {
        format!("{per_rev}: the chip breaks")
    } else if margin == 0.0 {
        format!("{per_rev}: in phase, no amplitude breaks the chip")
    } else {
        format!("{per_rev}: the amplitude is {} % of what breaks the chip", number(margin * 100.0, 2))
    };
    plot::Cut { heading, verdict, condition }
}
