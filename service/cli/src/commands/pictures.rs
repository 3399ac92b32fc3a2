//! What the pictures of a program show: its moves, its vibration close up, its chip.

mod five_axis;

use std::collections::HashSet;
use std::f64::consts::PI;
use std::ops::Range;

use feedwave_cutting::{Cut, CutCondition, PipelineConfig, SectionReport, SetpointBlock, ValidationReport};
use feedwave_motion::{Element, MachineKind, PathSmoother, Smoothed};
use feedwave_program::{
    Feed, FindingLog, Function, Interpreter, LineOutcome, Move, MoveKind, Operation, OperationKind, Position, Spindle,
    SpindleSpeed, ThreadMove,
};

use self::five_axis::GuidedPath;
use super::CliError;
use super::source::Source;
use super::terminal::number;
use crate::plot::{self, AxisShown, PathTrace, Plots, Point, RapidLines, Stretch};

/// Pictures of chips at most: sections of one program are mostly alike.
const MAX_CHIP_PICTURES: usize = 8;
/// Vibration periods in a close view.
const PERIODS_SHOWN: f64 = 5.0;
/// Curves are drawn with chords of this angle where they bend most, rad: half a thousandth of the radius off.
const CHORD_RAD: f64 = PI / 90.0;
/// Chords of one curve at most.
const MAX_CHORDS: f64 = 20_000.0;

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
    let mut tracer = Tracer::new(config);
    tracer.read(source, config)?;
    let Tracer { trace, rapids, guided_path, .. } = tracer;
    plots.set_path(trace, rapids);
    if let Some(five_axis) = five_axis::prepare(source, config, report, guided_path)? {
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

/// Follows the program through its operations: the path that is run, in work coordinates, with the curves that `G64` puts
/// in place of corners; which lines move rapidly; the path of a guided tool.
struct Tracer {
    trace: PathTrace,
    rapids: RapidLines,
    guided_path: GuidedPath,
    smoother: PathSmoother<Cut>,
    /// What cuts are at this place of the program.
    cutting: Stretch,
    thread_vibration: bool,
    /// Largest feed override.
    most: f64,
}

impl Tracer {
    fn new(config: &PipelineConfig) -> Self {
        Self {
            trace: PathTrace::default(),
            rapids: RapidLines::default(),
            guided_path: GuidedPath::default(),
            smoother: PathSmoother::default(),
            cutting: Stretch::Cutting,
            thread_vibration: false,
            most: config.overrides.iter().map(|change| change.ratio).fold(1.0, f64::max),
        }
    }

    /// Reads the whole program.
    fn read(&mut self, source: &mut Source, config: &PipelineConfig) -> Result<(), CliError> {
        source.rewind()?;
        let mut interpreter =
            Interpreter::new(config.profile.language.clone()).with_tool_lengths(config.tool_lengths());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::with_limit(0));
        let (mut unread, mut ended) = (Vec::new(), false);
        loop {
            let mut consumed = 0;
            let outcome = loop {
                match interpreter.read_line(&unread[consumed..], ended, &mut operations, &mut findings) {
                    LineOutcome::Consumed(bytes) => consumed += bytes,
                    outcome => break outcome,
                }
                operations.drain(..).for_each(|operation| self.follow(&operation));
            };
            if outcome == LineOutcome::Ended {
                self.flush();
                self.rapids.finish();
                return Ok(());
            }
            unread.drain(..consumed);
            let piece = source.next_piece()?;
            ended = piece.is_empty();
            unread.extend_from_slice(piece);
        }
    }

    fn follow(&mut self, Operation { kind, span }: &Operation) {
        match kind {
            OperationKind::Move(step) => {
                self.guided_path.interrupt();
                self.count(step, span.line);
                if step.kind == MoveKind::Rapid {
                    self.flush();
                }
                let Some(element) = Element::from_move(step, *span) else { return };
                let cut = Cut::of(step, &element);
                let (trace, cutting) = (&mut self.trace, self.cutting);
                let mut draw = |smoothed: Smoothed<Cut>| draw_element(&smoothed.element, cutting, trace);
                for part in element.smooth_parts() {
                    self.smoother.push(part, step.path_control, cut, &mut draw);
                }
            }
            OperationKind::Guided(guided) => {
                self.flush();
                self.count(&guided.step, span.line);
                self.guided_path.add(guided, span.line, &mut self.trace);
            }
            OperationKind::Thread(pass) => {
                self.flush();
                self.rapids.cut(span.line, THREAD_MARGIN * pass.lead_mm * most_rev_per_min(&pass.spindle));
                self.thread(pass);
            }
            OperationKind::Function(command) => {
                self.flush();
                let of = |superposed| if command.on { superposed } else { Stretch::Cutting };
                match command.function {
                    Function::PathVibration => self.cutting = of(Stretch::Vibrating),
                    Function::ToolOscillation => self.cutting = of(Stretch::Oscillating),
                    Function::ThreadVibration => self.thread_vibration = command.on,
                    _ => {}
                }
            }
            _ => self.flush(),
        }
    }

    fn flush(&mut self) {
        let (trace, cutting) = (&mut self.trace, self.cutting);
        self.smoother.flush(&mut |smoothed| draw_element(&smoothed.element, cutting, trace));
    }

    /// Keeps whether a line moves rapidly, and how fast it cuts.
    fn count(&mut self, step: &Move, line: u32) {
        if step.kind == MoveKind::Rapid {
            return self.rapids.rapid(line);
        }
        let feed_mm_per_min = match step.feed {
            Feed::PerMinute(feed) => feed,
            Feed::PerRevolution(feed) => feed * most_rev_per_min(&step.spindle),
            Feed::InverseTime(_) => f64::INFINITY,
        };
        self.rapids.cut(line, self.most * feed_mm_per_min);
    }

    /// A threading pass, with its pull-out; a pass with an amplitude of 0 of its own does not vibrate.
    fn thread(&mut self, pass: &ThreadMove) {
        let vibrates = self.thread_vibration && pass.amplitude_mm != Some(0.0);
        let stretch = if vibrates { Stretch::VibratingThread } else { Stretch::Threading };
        let (from, mut to) = (point(&pass.start), point(&pass.end));
        let mut last = from;
        if let Some(pull_out) = pass.pull_out {
            let travel = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            let length = travel.iter().fold(0.0_f64, |length, travel| length.max(travel.abs()));
            let share = if length > 0.0 { (pull_out.travel_mm / length).min(1.0) } else { 0.0 };
            let begin = [0, 1, 2].map(|axis| to[axis] - share * travel[axis]);
            self.trace.line(stretch, last, begin);
            last = begin;
            to[0] += pull_out.retreat_mm;
        }
        self.trace.line(stretch, last, to);
    }
}

/// The path along a taper is longer than the travel of the lead axis, at most by this.
const THREAD_MARGIN: f64 = 1.5;

/// Highest speed that a spindle state permits; infinite under constant surface speed without a limit.
const fn most_rev_per_min(spindle: &Spindle) -> f64 {
    match spindle.speed {
        SpindleSpeed::Constant { rev_per_min } => rev_per_min,
        SpindleSpeed::Surface { max_rev_per_min, .. } => max_rev_per_min,
    }
}

/// Draws an element: a line as such, a curve with chords.
fn draw_element(element: &Element, cutting: Stretch, trace: &mut PathTrace) {
    let stretch = if element.rapid { Stretch::Rapid } else { cutting };
    let turn_rad = element.length * element.curvature();
    let chords = (turn_rad / CHORD_RAD).ceil().clamp(1.0, MAX_CHORDS) as u32;
    let mut from = point(&element.start);
    for chord in 1..=chords {
        let to = point(&element.position(element.length * (f64::from(chord) / f64::from(chords))));
        trace.line(stretch, from, to);
        from = to;
    }
}

fn point(position: &Position) -> Point {
    [position[0], position[1], position[2]]
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
