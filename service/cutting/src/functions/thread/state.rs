//! Threads in the program: the words that switch their vibration, the passes that belong together, and what is to
//! say about them.

use feedwave_motion::Planner;
use feedwave_program::{Axis, Finding, FindingLog, FunctionCommand, Move, SourceSpan, SpindleDirection, ThreadMove};
use serde::{Deserialize, Serialize};

use super::pass::{PassWay, TAPER_SHARE, ThreadBlock, axis_limits, peak_velocity};
use super::{
    GrooveProfile, MAX_THREAD_PARTS, MAX_THREAD_PASSES, PathVibration, RetreatWave, SpindleRotation, StartUp,
    ThreadGeometry, ThreadJob, ThreadLimits, ThreadPass, ThreadSectionReport, ThreadSide, judge_thread,
};
use crate::PipelineConfig;
use crate::code;
use crate::frame::builder::checks::missing;
use crate::frame::builder::{Analysis, Builder};
use crate::frame::interpolator::Barrier;

/// Reports kept in full; further threads are counted.
const MAX_THREAD_REPORTS: usize = 100;
/// Lengths, leads and tapers that differ by less are the same.
const SAME: f64 = 1e-6;
/// Leads by which start and end of passes of one thread may be apart: a start position takes up to one, an infeed along
/// the flank less than half of one.
const LEADS_APART: f64 = 1.5;
/// Depth of a single pass where nothing states the work's diameter, in leads.
const ASSUMED_DEPTH: f64 = 0.1;

/// What threads need to remember between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Threads {
    mode: Option<Mode>,
    /// Whether the vibration was switched on with words that cannot be used: an error that was reported already.
    unusable: bool,
    /// A rapid that may become a combined preparatory movement.
    rapid: Option<(Move, SourceSpan)>,
    /// Blocks of one pass, as long as more may follow.
    blocks: Vec<ThreadBlock>,
    open: Option<Box<OpenThread>>,
}

/// Vibration of threads is on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Mode {
    on_span: SourceSpan,
    work_radius_mm: f64,
    ratio: f64,
}

/// A thread whose passes come in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct OpenThread {
    mode: Option<Mode>,
    job: ThreadJob,
    tool: u32,
    work_offset: [f64; 2],
    last_line: u32,
}

const X: usize = Axis::X.index();
const Z: usize = Axis::Z.index();

impl Threads {
    /// Whether something waits for the next operation.
    pub(crate) fn is_waiting(&self) -> bool {
        self.rapid.is_some() || !self.blocks.is_empty()
    }
}

impl Builder {
    /// Holds a rapid back where it may become part of the start-up of a pass.
    pub(crate) fn holds_rapid(&mut self, mv: &Move, span: SourceSpan, config: &PipelineConfig) -> bool {
        let settings = &config.profile.thread_vibration;
        let combines = settings.combined_preparation && settings.start_up == StartUp::Preparatory;
        let holds = combines && self.state.threads.mode.is_some() && mv.kind == feedwave_program::MoveKind::Rapid;
        if holds {
            self.state.threads.rapid = Some((mv.clone(), span));
        }
        holds
    }

    /// A threading block.
    pub(crate) fn thread(
        &mut self,
        mv: &ThreadMove,
        span: SourceSpan,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let blocks = &mut self.state.threads.blocks;
        if blocks.last().is_some_and(|last| last.goes_on_in(mv)) {
            if blocks.len() >= MAX_THREAD_PARTS {
                let message = format!("the thread has more than {MAX_THREAD_PARTS} parts");
                let finding = Finding::new(code::THREAD_PARTS, span, message);
                findings.push(
                    finding.with_value("limit", MAX_THREAD_PARTS as f64, "").suggest("cut the thread in longer blocks"),
                );
                blocks.clear();
            }
            let vibrates = self.state.threads.mode.is_some();
            if blocks.first().is_some_and(|first| contradicts(&first.mv, mv, vibrates)) {
                let message = "the vibration of a thread of several parts is that of its first block";
                let finding = Finding::new(code::THREAD_PART_VIBRATION, span, message);
                findings.push(finding.suggest("write A and R in the first block of the thread only"));
            }
        } else if !blocks.is_empty() {
            self.flush_threads(config, planner, findings);
        }
        self.state.threads.blocks.push(ThreadBlock { mv: mv.clone(), span });
    }

    /// Plans what waits: a rapid, or a pass that is complete now.
    pub(crate) fn flush_threads(
        &mut self,
        config: &PipelineConfig,
        planner: &mut Planner<Barrier>,
        findings: &mut FindingLog,
    ) {
        let rapid = self.state.threads.rapid.take();
        let blocks = std::mem::take(&mut self.state.threads.blocks);
        let pass = self.pass(&blocks, config, findings);
        let mut combines = false;
        if let Some((mut mv, span)) = rapid {
            if let (Some(pass), Some(first)) = (&pass, blocks.first())
                && mv.end == first.mv.start
            {
                let wave = &pass.vibration.wave;
                let prepared_mm = wave.retreat_mm(pass.vibration.start_up, -1.0);
                mv.end[X] += pass.vibration.outwards * prepared_mm;
                combines = wave.amplitude_mm > 0.0;
            }
            self.motion(&mv, span, config, planner, findings);
        }
        let (Some(pass), Some(last)) = (pass, blocks.last()) else { return };
        let machine = &config.profile.machine;
        let settings = &config.profile.thread_vibration;
        let Some(run) = pass.way.run(&blocks, pass.vibration, settings, !combines, machine, findings) else { return };
        self.state.radius_mm = last.end()[X];
        if let Some(analysis) = &mut self.analysis {
            analysis.add_pass(run.path.length_mm(), blocks.len(), pass.way.rev_per_s());
            let open = self.state.threads.open.as_ref();
            let place = open.and_then(|open| Some((analysis.thread_count, open.job.passes.len().checked_sub(1)?)));
            if place.is_some() && place == analysis.wanted_pass {
                analysis.wanted_path = Some(run.path.clone());
            }
        }
        planner.push_barrier(Barrier::Thread(Box::new(run)));
    }

    /// The path and the vibration of the blocks of one pass, which joins its thread.
    fn pass(&mut self, blocks: &[ThreadBlock], config: &PipelineConfig, findings: &mut FindingLog) -> Option<Pass> {
        let first = blocks.first()?;
        let machine = &config.profile.machine;
        let way = PassWay::new(blocks, machine, findings)?;
        if let Some(axis) = way.missing_axis(first, machine) {
            findings.push(missing(axis, first.span));
            return None;
        }
        self.check_speed(&first.mv.spindle, first.mv.tool, first.span, config, findings);
        if self.state.vibration.is_some() {
            let message = "vibration along the path does not act on a thread, but is on";
            let finding = Finding::new(code::VIB_THREAD, first.span, message);
            findings.push(finding.suggest("switch it off before the thread; threads have a vibration of their own"));
        }
        let settings = &config.profile.thread_vibration;
        let mode = self.state.threads.mode;
        let still = PathVibration {
            wave: RetreatWave {
                amplitude_mm: 0.0,
                vibrations_per_rev: settings.vibrations_per_rev,
                phase_shift_deg: 0.0,
            },
            start_up: settings.start_up,
            outwards: 1.0,
        };
        if mode.is_none() && !self.state.threads.unusable && first.mv.amplitude_mm.is_some_and(|mm| mm > 0.0) {
            let message = "the pass has an amplitude, but the vibration of threads is off";
            let finding = Finding::new(code::THREAD_VIBRATION_OFF, first.span, message);
            findings.push(finding.suggest("switch it on before the first pass, or leave the A word out"));
        }
        if !first.leads_along_z() {
            if mode.is_some() && first.mv.amplitude_mm != Some(0.0) {
                let message = "the thread vibrates in X, which is the direction of its lead here";
                let finding = Finding::new(code::THREAD_LEAD_X, first.span, message);
                findings.push(finding.suggest("switch the vibration off for this thread, or write A0.0"));
                return None;
            }
            self.close_thread(config, findings);
            way.check_speeds(0.0, false, machine, first.span, findings);
            return way.check_length(false, None, first.span, findings).then_some(Pass { way, vibration: still });
        }
        let vibration = self.join(first, &way, still, config, findings)?;
        let peak_mm_per_s = peak_velocity(&vibration, way.rev_per_s());
        way.check_speeds(peak_mm_per_s, true, machine, first.span, findings);
        let judged = self.analysis.is_some();
        let number = self.state.threads.open.as_ref().map(|open| open.job.passes.len() as u64);
        way.check_length(judged, number, first.span, findings).then_some(Pass { way, vibration })
    }

    /// Adds a pass to its thread and says how it vibrates.
    fn join(
        &mut self,
        first: &ThreadBlock,
        way: &PassWay,
        still: PathVibration,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) -> Option<PathVibration> {
        let settings = &config.profile.thread_vibration;
        let mode = self.state.threads.mode;
        let joins = self.state.threads.open.as_ref().is_some_and(|open| open.takes(first, way, mode, findings));
        if !joins {
            self.close_thread(config, findings);
            let profile_deg = first.mv.included_angle_deg.unwrap_or(settings.included_angle_deg);
            self.state.threads.open = Some(Box::new(OpenThread::new(first, way, mode, still, profile_deg)));
        }
        let open = self.state.threads.open.as_mut()?;
        if open.job.passes.len() >= MAX_THREAD_PASSES {
            let message = format!("the thread has more than {MAX_THREAD_PASSES} passes");
            let finding = Finding::new(code::THREAD_PASSES, first.span, message);
            findings
                .push(finding.with_value("limit", MAX_THREAD_PASSES as f64, "").suggest("let every pass go deeper"));
            return None;
        }
        open.last_line = first.span.line;
        let index = open.add(first);
        let job = &mut open.job;
        let start = job.passes[index].start;
        if let Some(mode) = mode {
            let number = job.passes[..index].iter().filter(|pass| pass.start == start).count();
            let infeed_mm = job.infeed_mm(index);
            if first.mv.amplitude_mm.is_none() && infeed_mm * mode.ratio == 0.0 {
                let message = "the pass goes no deeper than the one before, so the ratio gives it no vibration";
                let finding = Finding::new(code::THREAD_NO_INFEED, first.span, message);
                findings.push(finding.suggest("write its amplitude as A; A0.0 for a pass without vibration"));
            }
            let pass = &mut job.passes[index];
            pass.amplitude_mm = first.mv.amplitude_mm.unwrap_or(infeed_mm * mode.ratio);
            pass.phase_shift_deg = first.mv.phase_shift_deg.unwrap_or_else(|| settings.phase_shift_deg(number));
        }
        let wave = job.wave(&job.passes[index]);
        Some(PathVibration { wave, start_up: job.start_up, outwards: job.geometry.inwards() })
    }

    /// Ends the thread: judges it where a report is wanted.
    pub(crate) fn close_thread(&mut self, config: &PipelineConfig, findings: &mut FindingLog) {
        let Some(open) = self.state.threads.open.take() else { return };
        if let Some(analysis) = &mut self.analysis {
            analysis.thread_count += 1;
            let report = open.judge(config);
            for finding in &report.report.findings {
                findings.push(finding.clone());
            }
            if analysis.threads.len() < MAX_THREAD_REPORTS {
                analysis.threads.push(report);
            }
        }
    }

    /// The words that switch the vibration of threads.
    pub(crate) fn switch_thread_vibration(
        &mut self,
        command: &FunctionCommand,
        span: SourceSpan,
        config: &PipelineConfig,
        findings: &mut FindingLog,
    ) {
        self.close_thread(config, findings);
        let threads = &mut self.state.threads;
        let before = threads.mode.take();
        let was_unusable = std::mem::take(&mut threads.unusable);
        if !command.on {
            if before.is_none() && !was_unusable {
                let message = "the vibration of threads is switched off but was not on";
                let finding = Finding::new(code::THREAD_OFF_WITHOUT_ON, span, message);
                findings.push(finding.suggest("remove the block, or switch the vibration on before it"));
            }
            return;
        }
        if let Some(before) = before {
            let line = before.on_span.line;
            let message = format!("the vibration of threads is on already, since line {line}");
            let finding = Finding::new(code::THREAD_NESTED, span, message).with_value("on_line", f64::from(line), "");
            findings.push(finding.suggest("switch it off before it is switched on with other values"));
        }
        let work_radius_mm = mode_word(command, span, 'X', "work diameter", "X10.0", 0.0, findings);
        // The amplitude has to exceed the infeed.
        let ratio = mode_word(command, span, 'Q', "amplitude ratio", "Q1.2", 1.0, findings);
        threads.mode =
            work_radius_mm.zip(ratio).map(|(work_radius_mm, ratio)| Mode { on_span: span, work_radius_mm, ratio });
        threads.unusable = threads.mode.is_none();
    }

    /// The program ends.
    pub(crate) fn end_threads(&mut self, config: &PipelineConfig, findings: &mut FindingLog) {
        self.close_thread(config, findings);
        if let Some(mode) = self.state.threads.mode.take() {
            let message = "the program ends while the vibration of threads switched on here is still on";
            let finding = Finding::new(code::THREAD_UNCLOSED, mode.on_span, message);
            findings.push(finding.suggest("switch it off after the last pass"));
        }
    }
}

/// Whether a further part of a thread states another vibration than the first: what it does not state, or states as the first
/// does, is that of the first. A thread that does not vibrate has amplitude 0.
fn contradicts(first: &ThreadMove, part: &ThreadMove, vibrates: bool) -> bool {
    let amplitude_mm = first.amplitude_mm.or_else(|| (!vibrates).then_some(0.0));
    part.amplitude_mm.is_some() && part.amplitude_mm != amplitude_mm
        || part.phase_shift_deg.is_some() && part.phase_shift_deg != first.phase_shift_deg
}

/// A pass that is about to be planned.
struct Pass {
    way: PassWay,
    vibration: PathVibration,
}

/// A word of the block that switches the vibration on: a number above `above`.
fn mode_word(
    command: &FunctionCommand,
    span: SourceSpan,
    letter: char,
    name: &'static str,
    example: &str,
    above: f64,
    findings: &mut FindingLog,
) -> Option<f64> {
    let cure = format!("write {letter} with a number above {above}, such as {example}");
    let Some(word) = command.word(letter) else {
        let message = format!("the vibration of threads has no {name} ({letter} word)");
        findings.push(Finding::new(code::THREAD_MODE_WORD, span, message).suggest(cure));
        return None;
    };
    if word.value > above && word.value <= 1e6 {
        return Some(word.value);
    }
    let message = format!("the {name} of the vibration of threads must be above {above}, is {}", word.value);
    let name = if letter == 'X' { "work_radius" } else { "ratio" };
    let unit = if letter == 'X' { "mm" } else { "" };
    let finding = Finding::new(code::THREAD_MODE_WORD, word.span, message).with_value(name, word.value, unit);
    findings.push(finding.suggest(cure));
    None
}

impl OpenThread {
    fn new(first: &ThreadBlock, way: &PassWay, mode: Option<Mode>, still: PathVibration, angle_deg: f64) -> Self {
        let mv = &first.mv;
        let [x, z] = first.travel();
        let outside = mode.is_none_or(|mode| mv.start[X] <= mode.work_radius_mm);
        let geometry = ThreadGeometry {
            side: if outside { ThreadSide::External } else { ThreadSide::Internal },
            // Without a word for it the first pass is the measure until all are known.
            work_diameter_mm: 2.0 * mode.map_or(mv.start[X], |mode| mode.work_radius_mm),
            start_z_mm: mv.start[Z],
            end_z_mm: mv.end[Z],
            taper: x / z.abs(),
            lead_mm: mv.lead_mm,
            starts: 1,
            rotation: match mv.spindle.direction {
                SpindleDirection::CounterClockwise => SpindleRotation::Reverse,
                SpindleDirection::Clockwise | SpindleDirection::Stopped => SpindleRotation::Forward,
            },
        };
        let job = ThreadJob {
            geometry,
            profile: GrooveProfile::pointed(angle_deg),
            vibrations_per_rev: still.wave.vibrations_per_rev,
            start_up: still.start_up,
            run_up: way.run_up(),
            spindle_rev_per_min: 60.0 * way.rev_per_s(),
            passes: Vec::new(),
        };
        let work_offset = [mv.work_offset[X], mv.work_offset[Z]];
        Self { mode, job, tool: mv.tool, work_offset, last_line: first.span.line }
    }

    /// Whether a pass belongs to this thread.
    fn takes(&self, first: &ThreadBlock, way: &PassWay, mode: Option<Mode>, findings: &mut FindingLog) -> bool {
        let (mv, geometry) = (&first.mv, &self.job.geometry);
        let [x, z] = first.travel();
        let apart_mm = LEADS_APART * geometry.lead_mm;
        let is_same = self.mode == mode
            && self.tool == mv.tool
            && self.work_offset == [mv.work_offset[X], mv.work_offset[Z]]
            && (mv.lead_mm - geometry.lead_mm).abs() <= SAME
            && (x / z.abs() - geometry.taper).abs() <= SAME
            && z.signum() == geometry.direction()
            && (mv.start[Z] - geometry.start_z_mm).abs() <= apart_mm
            && (mv.end[Z] - geometry.end_z_mm).abs() <= apart_mm
            && (mv.spindle.direction == SpindleDirection::CounterClockwise)
                == (geometry.rotation == SpindleRotation::Reverse);
        let rev_per_min = 60.0 * way.rev_per_s();
        if is_same && rev_per_min != self.job.spindle_rev_per_min {
            let message = format!(
                "the spindle turns at {rev_per_min} rev/min, at {} rev/min in the pass before: the lead axis comes into \
                 step at another place, beside the groove",
                self.job.spindle_rev_per_min
            );
            findings.push(
                Finding::new(code::THREAD_SPEED_CHANGED, first.span, message)
                    .ranked("", (rev_per_min / self.job.spindle_rev_per_min - 1.0).abs())
                    .with_value("spindle_speed", rev_per_min, "rev/min")
                    .with_value("before", self.job.spindle_rev_per_min, "rev/min")
                    .suggest("cut all passes of a thread at one spindle speed"),
            );
            return false;
        }
        // Without vibration nothing says where a thread begins: a return to a smaller depth does.
        let goes_back = mode.is_none() && self.goes_back(first);
        is_same && !goes_back && (mode.is_some() || self.job.passes.len() < MAX_THREAD_PASSES)
    }

    /// Depth of the tool, mm on the radius, and travel of its start position.
    fn depth(&self, first: &ThreadBlock) -> (f64, f64) {
        let geometry = &self.job.geometry;
        let travel_mm = geometry.direction() * (first.mv.start[Z] - geometry.start_z_mm);
        let surface_mm = 0.5 * geometry.work_diameter_mm + geometry.taper * travel_mm;
        (geometry.inwards() * (surface_mm - first.mv.start[X]), travel_mm)
    }

    fn goes_back(&self, first: &ThreadBlock) -> bool {
        let depths = self.job.passes.iter().map(|pass| pass.depth_mm);
        // Inside the depths are negative until the side is known.
        let deepest = depths.fold(0.0, |deepest: f64, depth| if depth.abs() > deepest.abs() { depth } else { deepest });
        deepest.abs() > SAME && (self.depth(first).0 / deepest) <= SAME
    }

    /// Adds a pass without vibration; its index.
    fn add(&mut self, first: &ThreadBlock) -> usize {
        let (depth_mm, start_travel_mm) = self.depth(first);
        let mut pass = ThreadPass {
            start: first.mv.thread_start,
            depth_mm,
            start_travel_mm,
            start_angle_deg: first.mv.start_angle_deg,
            amplitude_mm: 0.0,
            phase_shift_deg: 0.0,
            span: first.span,
        };
        let index = self.job.passes.len();
        if pass.start == 0 {
            pass.start = self.groove(&pass);
        }
        let geometry = &mut self.job.geometry;
        geometry.starts = geometry.starts.max(pass.start.saturating_add(1));
        self.job.passes.push(pass);
        index
    }

    /// Which start a pass without a word for it cuts: that of the groove it meets. Where it meets none, it is a new one,
    /// unless it goes deeper than the pass before, as alternating flanks do before they meet.
    fn groove(&self, pass: &ThreadPass) -> u32 {
        let job = &self.job;
        let lead_mm = job.geometry.lead_mm;
        let origin_mm = |pass: &ThreadPass| pass.start_travel_mm - lead_mm * pass.start_angle_deg / 360.0;
        let apart_mm = |other: &ThreadPass| {
            let offset_mm = origin_mm(pass) - origin_mm(other);
            (offset_mm - lead_mm * (offset_mm / lead_mm).round()).abs()
        };
        let meets = |other: &&ThreadPass| {
            let reach_mm = (pass.depth_mm.abs() + other.depth_mm.abs()) * job.profile.tan_half_angle();
            apart_mm(other) < reach_mm - SAME || apart_mm(other) < SAME
        };
        let nearest = job.passes.iter().filter(meets).min_by(|a, b| apart_mm(a).total_cmp(&apart_mm(b)));
        match (nearest, job.passes.last()) {
            (Some(nearest), _) => nearest.start,
            (None, Some(last)) if pass.depth_mm.abs() > last.depth_mm.abs() + SAME => last.start,
            (None, Some(_)) => job.geometry.starts,
            (None, None) => 0,
        }
    }

    fn judge(self, config: &PipelineConfig) -> ThreadSectionReport {
        let Self { mode, mut job, last_line, .. } = self;
        if mode.is_none() {
            assume_work(&mut job);
        }
        let first_line = job.passes.first().map_or(last_line, |pass| pass.span.line);
        let settings = &config.profile.thread_vibration;
        let [x, z] = [Axis::X, Axis::Z].map(|axis| axis_limits(&config.profile.machine, axis));
        // On a taper X has to accelerate with the lead axis, too.
        let share = if job.geometry.taper.abs() > 0.0 { 1.0 - TAPER_SHARE } else { 1.0 };
        let limits = ThreadLimits {
            lead_velocity_mm_per_s: z.velocity,
            lead_acceleration_mm_per_s2: z.acceleration,
            lead_jerk_mm_per_s3: z.jerk,
            vibration_velocity_mm_per_s: x.velocity,
            vibration_acceleration_mm_per_s2: share * x.acceleration,
            vibration_jerk_mm_per_s3: share * x.jerk,
            approach_mm: settings.approach_mm.unwrap_or(f64::INFINITY),
            period_s: config.period_s(),
            thickness_mm: settings.max_thickness_mm.unwrap_or(f64::INFINITY),
            finishing_thickness_mm: settings.max_finishing_thickness_mm,
        };
        let report = judge_thread(&job, &limits);
        ThreadSectionReport {
            on_line: mode.map(|mode| mode.on_span.line),
            first_line,
            last_line,
            ratio: mode.map(|mode| mode.ratio),
            work_diameter_assumed: mode.is_none(),
            job,
            report,
        }
    }
}

/// Side and work diameter of a thread whose passes are all that is known: the first infeed is taken to be the largest of
/// the later ones.
fn assume_work(job: &mut ThreadJob) {
    if job.passes.last().is_some_and(|last| last.depth_mm < 0.0) {
        job.geometry.side = ThreadSide::Internal;
        for pass in &mut job.passes {
            pass.depth_mm = -pass.depth_mm;
        }
    }
    let later_mm = (1..job.passes.len()).map(|index| job.infeed_mm(index)).fold(0.0, f64::max);
    let first_mm = if later_mm > SAME { later_mm } else { ASSUMED_DEPTH * job.geometry.lead_mm };
    for pass in &mut job.passes {
        pass.depth_mm += first_mm;
    }
    job.geometry.work_diameter_mm += 2.0 * job.geometry.inwards() * first_mm;
}

impl Analysis {
    fn add_pass(&mut self, length_mm: f64, blocks: usize, rev_per_s: f64) {
        self.moves += blocks as u64;
        self.cutting_moves += blocks as u64;
        self.path_length_mm += length_mm;
        self.cutting_length_mm += length_mm;
        self.thread_passes += 1;
        let speed = 60.0 * rev_per_s;
        let [least, most] = self.spindle_rev_per_min.get_or_insert([speed; 2]);
        *least = least.min(speed);
        *most = most.max(speed);
    }
}
