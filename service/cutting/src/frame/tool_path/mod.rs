//! The path that a program takes, without planning it: polylines in work coordinates, with the curves that `G64` puts in
//! place of corners. Bounded memory: what is found is handed to a [`ToolPathSink`] at once.

mod guided;

use std::f64::consts::PI;

use feedwave_motion::{CornerSpeed, Element, Joining, Machine, PathSmoother, Smoothed};
use feedwave_program::{
    Feed, FindingLog, Function, Move, MoveKind, Operation, OperationKind, Place, Position, Reader, Reading,
    SourcePages, Spindle, SpindleSpeed, ThreadMove,
};

pub use self::guided::GuidedCuts;
use self::guided::GuidedTip;
use crate::frame::pipeline::supply;
use crate::{Cut, PipelineConfig};

/// Curves have chords of this angle where they bend most, rad: half a thousandth of the radius off.
const CHORD_RAD: f64 = PI / 90.0;
/// Chords of one curve at most.
const MAX_CHORDS: f64 = 20_000.0;
/// The path along a taper is longer than the travel of the lead axis, at most by this.
const THREAD_MARGIN: f64 = 1.5;

/// A point of the path: X (radius), Y, Z, mm.
pub type PathPoint = [f64; 3];

/// What the tool does along a stretch of the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolMotion {
    /// Rapid move.
    Rapid,
    /// Cutting.
    Cutting,
    /// Cutting with vibration along the path.
    Vibrating,
    /// Cutting while the tool oscillates.
    Oscillating,
    /// A threading pass.
    Threading,
    /// A threading pass with vibration.
    VibratingThread,
}

/// Receiver of the path, in its order.
pub trait ToolPathSink {
    /// The tool goes straight.
    fn line(&mut self, motion: ToolMotion, from: PathPoint, to: PathPoint);
    /// A line of the program moves rapidly.
    fn rapid(&mut self, line: u32);
    /// A line of the program cuts, at most this fast, mm/min; infinite where it is not bounded.
    fn cut(&mut self, line: u32, max_mm_per_min: f64);
    /// A line of the program cuts straight, as it is written.
    fn programmed(&mut self, _line: u32, _from: PathPoint, _to: PathPoint) {}
    /// What comes next by [`ToolPathSink::line`] is run for a line of the program, at most `largest_mm` from the path as it is
    /// written, which is here. Under tool centre point control it is not said.
    fn deviates(&mut self, _line: u32, _largest_mm: f64, _here: PathPoint) {}
}

/// Reads a program for its path. What is wrong with it is not said: that is the business of validation.
#[derive(Debug)]
pub struct ToolPath {
    reader: Reader,
    pages: SourcePages,
    operations: Vec<Operation>,
    findings: FindingLog,
    follower: Follower,
}

/// What operations have to remember of each other.
#[derive(Debug)]
struct Follower {
    tip: GuidedTip,
    smoother: PathSmoother<Cut>,
    machine: Machine,
    corner_speed: CornerSpeed,
    /// What cuts are at this place of the program.
    cutting: ToolMotion,
    thread_vibration: bool,
    /// Largest feed override, at least 1.
    max_override: f64,
}

impl ToolPath {
    /// The path of a program on this machine, with these tools and changes of the feed override.
    #[must_use]
    pub fn new(config: &PipelineConfig) -> Self {
        Self {
            reader: Reader::new(config.interpreter()),
            pages: SourcePages::default(),
            operations: Vec::new(),
            findings: FindingLog::with_limit(0),
            follower: Follower {
                tip: GuidedTip::default(),
                smoother: PathSmoother::default(),
                machine: config.profile.machine.clone(),
                corner_speed: config.profile.corner_speed(),
                cutting: ToolMotion::Cutting,
                thread_vibration: false,
                max_override: config.overrides.iter().map(|change| change.ratio).fold(1.0, f64::max),
            },
        }
    }

    /// Reads as far as there are bytes: where more are wanted, for [`ToolPath::push`] or [`ToolPath::finish_input`], or
    /// nothing at the end of the program.
    pub fn read(&mut self, sink: &mut impl ToolPathSink) -> Option<Place> {
        let Self { reader, pages, operations, findings, follower } = self;
        loop {
            let reading = reader.read_line(pages, operations, findings);
            operations.drain(..).for_each(|operation| follower.follow(&operation, sink));
            match reading {
                Reading::More => {}
                Reading::NeedInput => return Some(pages.wanted()),
                Reading::Ended => return None,
            }
        }
    }

    /// See [`Pipeline::push`](crate::Pipeline::push).
    pub fn push(&mut self, bytes: &[u8]) {
        self.pages.push(bytes);
    }

    /// See [`Pipeline::finish_input`](crate::Pipeline::finish_input).
    pub fn finish_input(&mut self) {
        self.pages.finish();
    }

    /// See [`Pipeline::supply`](crate::Pipeline::supply).
    pub fn supply(&mut self, place: Place, program: &[u8]) {
        supply(&mut self.pages, place, program);
    }

    /// Ends the path; the cuts that it makes with a guided tool.
    pub fn finish(mut self, sink: &mut impl ToolPathSink) -> GuidedCuts {
        self.follower.flush(sink);
        self.follower.tip.into_cuts()
    }
}

/// What is superposed is shaped by the programmed blocks and their corners.
fn joining(cutting: ToolMotion, machine: &Machine, corner_speed: CornerSpeed) -> Joining<'_> {
    Joining { machine, many_blocks: cutting == ToolMotion::Cutting, corner_speed, corners: None }
}

impl Follower {
    fn follow(&mut self, Operation { kind, span }: &Operation, sink: &mut impl ToolPathSink) {
        match kind {
            OperationKind::Move(step) => {
                self.tip.interrupt();
                let element = Element::from_move(step, *span);
                let length_mm = element.as_ref().map_or(0.0, |element| element.length);
                self.count(step, step.feed_on_path(length_mm), span.line, sink);
                if step.kind == MoveKind::Rapid {
                    self.flush(sink);
                }
                let Some(element) = element else { return };
                let cut = Cut::of(step, &element);
                let cutting = self.cutting;
                let joining = joining(self.cutting, &self.machine, self.corner_speed);
                for part in element.smooth_parts() {
                    if !part.rapid {
                        each_chord(&part, |from, to| sink.programmed(span.line, from, to));
                    }
                    let mut draw = |smoothed| draw(&smoothed, cutting, sink);
                    self.smoother.push(part, step.path_control, cut, joining, &mut draw);
                }
            }
            OperationKind::Guided(guided) => {
                self.flush(sink);
                self.count(&guided.step, guided.step.feed, span.line, sink);
                self.tip.follow(guided, *span, self.cutting, sink);
            }
            OperationKind::Thread(pass) => {
                self.flush(sink);
                sink.cut(span.line, THREAD_MARGIN * pass.lead_mm * max_rev_per_min(&pass.spindle));
                self.thread(pass, sink);
            }
            OperationKind::Function(command) => {
                self.flush(sink);
                let of = |superposed| if command.on { superposed } else { ToolMotion::Cutting };
                match command.function {
                    Function::PathVibration => self.cutting = of(ToolMotion::Vibrating),
                    Function::ToolOscillation => self.cutting = of(ToolMotion::Oscillating),
                    Function::ThreadVibration => self.thread_vibration = command.on,
                    _ => {}
                }
            }
            _ => self.flush(sink),
        }
    }

    fn flush(&mut self, sink: &mut impl ToolPathSink) {
        let cutting = self.cutting;
        let joining = joining(self.cutting, &self.machine, self.corner_speed);
        self.smoother.flush(joining, &mut |smoothed| draw(&smoothed, cutting, sink));
    }

    /// Tells whether a line moves rapidly, and how fast it cuts.
    fn count(&self, step: &Move, feed: Feed, line: u32, sink: &mut impl ToolPathSink) {
        if step.kind == MoveKind::Rapid {
            return sink.rapid(line);
        }
        let feed_mm_per_min = match feed {
            Feed::PerMinute(feed) => feed,
            Feed::PerRevolution(feed) => feed * max_rev_per_min(&step.spindle),
            Feed::InverseTime(_) => f64::INFINITY,
        };
        sink.cut(line, self.max_override * feed_mm_per_min);
    }

    /// A threading pass, with its pull-out; a pass with an amplitude of 0 of its own does not vibrate.
    fn thread(&self, pass: &ThreadMove, sink: &mut impl ToolPathSink) {
        let vibrates = self.thread_vibration && pass.amplitude_mm != Some(0.0);
        let motion = if vibrates { ToolMotion::VibratingThread } else { ToolMotion::Threading };
        let place = |position: &Position| match &pass.plane {
            Some(it) => it.plane.to_work(point(position)),
            None => point(position),
        };
        let (from, mut to) = (place(&pass.start), place(&pass.end));
        let mut last = from;
        if let Some(pull_out) = pass.pull_out {
            let travel = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            let length = travel.iter().fold(0.0_f64, |length, travel| length.max(travel.abs()));
            let share = if length > 0.0 { (pull_out.travel_mm / length).min(1.0) } else { 0.0 };
            let begin = [0, 1, 2].map(|axis| to[axis] - share * travel[axis]);
            sink.line(motion, last, begin);
            last = begin;
            to[0] += pull_out.retreat_mm;
        }
        sink.line(motion, last, to);
    }
}

/// Highest speed that a spindle state permits; infinite under constant surface speed without a limit.
const fn max_rev_per_min(spindle: &Spindle) -> f64 {
    match spindle.speed {
        SpindleSpeed::Constant { rev_per_min } => rev_per_min,
        SpindleSpeed::Surface { max_rev_per_min, .. } => max_rev_per_min,
    }
}

/// How many chords a curve takes that turns by this angle.
fn chord_count(turn_rad: f64) -> u32 {
    (turn_rad / CHORD_RAD).ceil().clamp(1.0, MAX_CHORDS) as u32
}

/// An element as it is run, with how far it is from the programmed path.
fn draw(smoothed: &Smoothed<Cut>, cutting: ToolMotion, sink: &mut impl ToolPathSink) {
    let Smoothed { element, deviation, .. } = smoothed;
    let motion = if element.rapid { ToolMotion::Rapid } else { cutting };
    sink.deviates(element.source.line, deviation.largest_mm, point(&element.position(deviation.at_mm)));
    each_chord(element, |from, to| sink.line(motion, from, to));
}

/// An element: a line as such, a curve as chords.
fn each_chord(element: &Element, mut line: impl FnMut(PathPoint, PathPoint)) {
    let count = chord_count(element.length * element.curvature());
    let mut from = point(&element.start);
    for chord in 1..=count {
        let to = point(&element.position(element.length * (f64::from(chord) / f64::from(count))));
        line(from, to);
        from = to;
    }
}

fn point(position: &Position) -> PathPoint {
    [position[0], position[1], position[2]]
}
