//! Threads in the program: the words that switch their vibration, the passes that belong together, and their
//! judgement.

use feedwave_motion::{Element, Machine};
use feedwave_program::{Finding, FindingCode, FindingLog, FunctionCommand, Move, MoveKind, SourceSpan, ThreadMove};
use serde::{Deserialize, Serialize};

use super::code;
use super::open_thread::OpenThread;
use super::pass::{PassPath, ThreadBlock, peak_velocity};
use super::{
    LeadAxis, MAX_THREAD_PARTS, MAX_THREAD_PASSES, PathVibration, RetreatWave, StartUp, TapRun, ThreadAnalysis,
    ThreadPath, ThreadRun, ThreadVibrationSettings,
};
use crate::functions::switch::{Modal, Switch};
use crate::shared::checks::{Travel, missing};
use crate::shared::following::FollowingModel;
use crate::shared::plane_frame::PlaneFrame;
use crate::shared::wording::decimal;

/// What a run of the pipeline gives this function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThreadInputs<'a> {
    pub(crate) settings: &'a ThreadVibrationSettings,
    pub(crate) machine: &'a Machine,
    pub(crate) travel: Travel<'a>,
    pub(crate) following: &'a FollowingModel,
    pub(crate) period_s: f64,
}

/// What threads need to remember between operations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Threads {
    switch: Switch<Mode>,
    /// A rapid that may become a combined preparatory movement.
    rapid: Option<(Move, SourceSpan)>,
    /// Blocks of one pass, as long as more may follow.
    blocks: Vec<ThreadBlock>,
    /// The last block of a pass behind which something else came, until something moves.
    interrupted: Option<Box<Interrupted>>,
    open: Option<Box<OpenThread>>,
    /// Threads that were closed: the reports there are while validating.
    closed: u64,
    /// That the feed override does not act on taps was said.
    taps_reported: bool,
}

/// A pass that would have gone on but for what comes behind it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Interrupted {
    last: ThreadBlock,
    by: SourceSpan,
}

impl Interrupted {
    /// The finding that the tool stops within the thread, where `next` is its next block.
    fn finding(&self, next: &ThreadBlock) -> Option<Finding> {
        let [before, behind] = [self.last.travel(), next.travel()];
        let goes_on = before[0] * behind[0] + before[1] * behind[1] > 0.0;
        if !(goes_on && self.last.is_left_at(&next.mv)) {
            return None;
        }
        let message = format!(
            "the thread of line {} would go on here, but line {} comes between: the tool stops in the work, and waits there for \
             the spindle to come round",
            self.last.span.line, self.by.line
        );
        let finding = Finding::new(code::THREAD_STOPS, next.span, message).ranked("", 0.0);
        let finding = finding.related_to("what comes between", self.by);
        Some(finding.suggest("write it before the first block of the thread, or behind the last one"))
    }
}

/// Vibration of threads is on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Mode {
    pub(super) on_span: SourceSpan,
    /// Axis of the lead that its threads have: that across which the work's surface is stated.
    pub(super) lead_axis: LeadAxis,
    /// Surface of the work as it is stated: a radius, or Z of its face, mm.
    work_mm: f64,
    /// What machine coordinates are more than those that it is stated in, mm along the same axis, but for the tool.
    frame_mm: f64,
    pub(super) ratio: f64,
}

impl Mode {
    /// Surface of the work in the coordinates of a pass: the work stays where it was stated, whatever shifts the coordinates
    /// behind it.
    pub(super) fn work_mm(&self, pass: &ThreadMove) -> f64 {
        self.work_mm + (self.frame_mm - pass.frame_offset[self.lead_axis.across().index()])
    }
}

impl Modal for Mode {
    const NAME: &'static str = "the vibration of threads";
    const OFF_WITHOUT_ON: FindingCode = code::THREAD_OFF_WITHOUT_ON;
    const NESTED: FindingCode = code::THREAD_NESTED;
    const UNCLOSED: FindingCode = code::THREAD_UNCLOSED;

    fn on_span(&self) -> SourceSpan {
        self.on_span
    }
}

/// A pass whose path is requested.
#[derive(Clone, Debug)]
pub(crate) struct WantedPass {
    /// Its thread and its number there, counted from 0 as in the report.
    pub(crate) place: (u64, usize),
    /// It, once it is planned.
    pub(crate) pass: Option<KeptPass>,
}

/// A pass as it is planned, for a follower.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptPass {
    /// Its path.
    pub path: ThreadPath,
    /// Whether X and Z of the path are those of a tilted plane.
    pub in_plane: bool,
}

/// What waits for the next operation: a rapid, and the blocks of a pass.
pub(crate) struct WaitingPass {
    pub(crate) rapid: Option<(Move, SourceSpan)>,
    pub(crate) blocks: Vec<ThreadBlock>,
}

/// A pass that is about to be planned.
pub(crate) struct Pass {
    path: PassPath,
    vibration: PathVibration,
}

impl Threads {
    /// Whether something waits for the next operation.
    pub(crate) fn is_waiting(&self) -> bool {
        self.rapid.is_some() || !self.blocks.is_empty()
    }

    /// Keeps a rapid that may become part of the start-up of a pass; whether it does.
    pub(crate) fn holds_rapid(&mut self, mv: &Move, span: SourceSpan, settings: &ThreadVibrationSettings) -> bool {
        let combines = settings.combined_preparation && settings.start_up == StartUp::Preparatory;
        let holds = combines && self.switch.is_on() && mv.kind == MoveKind::Rapid;
        if holds {
            self.rapid = Some((mv.clone(), span));
        }
        holds
    }

    /// Whether a block begins another pass than the one whose blocks wait.
    pub(crate) fn ends_pass(&self, mv: &ThreadMove) -> bool {
        // A rapid in plain coordinates comes before a thread in a tilted plane, and is none of its own.
        self.rapid.is_some() && mv.plane.is_some() || self.blocks.last().is_some_and(|last| !last.goes_on_in(mv))
    }

    /// Something other than a thread comes behind the blocks that wait.
    pub(crate) fn interrupt(&mut self, by: SourceSpan, moves: bool) {
        if moves {
            self.interrupted = None;
        } else if let Some(last) = self.blocks.last() {
            self.interrupted = Some(Box::new(Interrupted { last: last.clone(), by }));
        }
    }

    /// Whether passes may still join a thread.
    pub(crate) const fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Whether a block begins a thread: none is in progress that it would be a pass or a part of.
    pub(crate) fn would_begin(&self, mv: &ThreadMove, span: SourceSpan) -> bool {
        let block = ThreadBlock { mv: mv.clone(), frame: None, span };
        let mode = self.switch.on().copied();
        self.blocks.is_empty() && self.open.as_ref().is_none_or(|open| !open.is_same_thread(&block, mode))
    }

    /// Takes in a threading block of the pass in hand.
    pub(crate) fn add_block(
        &mut self,
        mv: &ThreadMove,
        frame: Option<Box<PlaneFrame>>,
        span: SourceSpan,
        findings: &mut FindingLog,
    ) {
        let block = ThreadBlock { mv: mv.clone(), frame, span };
        if let Some(finding) = self.interrupted.take().and_then(|it| it.finding(&block)) {
            findings.push(finding);
        }
        let blocks = &mut self.blocks;
        if blocks.len() >= MAX_THREAD_PARTS {
            let message = format!("the thread has more than {MAX_THREAD_PARTS} parts");
            let finding = Finding::new(code::THREAD_PARTS, span, message);
            findings.push(
                finding.with_value("limit", MAX_THREAD_PARTS as f64, "").suggest("cut the thread in longer blocks"),
            );
            blocks.clear();
        }
        if blocks.first().is_some_and(|first| contradicts(&first.mv, mv, self.switch.is_on())) {
            let message = "the vibration of a thread of several parts is that of its first block";
            let finding = Finding::new(code::THREAD_PART_VIBRATION, span, message);
            findings.push(finding.suggest("write A and R in the first block of the thread only"));
        }
        blocks.push(block);
    }

    /// What waits, to be planned now.
    pub(crate) fn take_waiting(&mut self) -> WaitingPass {
        WaitingPass { rapid: self.rapid.take(), blocks: std::mem::take(&mut self.blocks) }
    }

    /// The vibration of the blocks of one pass, which joins its thread; nothing after a finding.
    pub(crate) fn pass(
        &mut self,
        first: &ThreadBlock,
        path: PassPath,
        inputs: &ThreadInputs<'_>,
        analysis: Option<&mut ThreadAnalysis>,
        findings: &mut FindingLog,
    ) -> Option<Pass> {
        let settings = inputs.settings;
        let still = PathVibration {
            wave: RetreatWave {
                amplitude_mm: 0.0,
                vibrations_per_rev: settings.vibrations_per_rev,
                phase_shift_deg: 0.0,
            },
            start_up: settings.start_up,
            lead_axis: first.lead_axis(),
            outwards: 1.0,
        };
        let is_off = !self.switch.is_on() && !self.switch.is_unusable();
        let amplitude = first.mv.amplitude_mm.filter(|mm| *mm > 0.0).map(|_| ("an amplitude", 'A'));
        let stated = amplitude.or(first.mv.phase_shift_deg.map(|_| ("a phase shift", 'R')));
        if let Some((what, word)) = stated.filter(|_| is_off) {
            let message = format!("the pass has {what}, but the vibration of threads is off");
            let finding = Finding::new(code::THREAD_VIBRATION_OFF, first.span, message);
            findings.push(finding.suggest(format!("switch it on before the first pass, or leave the {word} word out")));
        }
        let lead_axis = still.lead_axis;
        let vibrating = self.switch.on().map(|mode| mode.lead_axis);
        // A thread along X is judged where its face is stated.
        if vibrating.map_or(still.lead_axis == LeadAxis::X, |vibrating| vibrating != still.lead_axis) {
            if let Some(vibrating) = vibrating.filter(|_| first.mv.amplitude_mm != Some(0.0)) {
                findings.push(vibrates_along_lead(vibrating, first.span));
                return None;
            }
            return self.alone(first, path, still, inputs, analysis, findings);
        }
        if let Some(finding) = self.switch.on().and_then(|mode| above_face(mode, first)) {
            if first.mv.amplitude_mm != Some(0.0) {
                findings.push(finding);
                return None;
            }
            // It is none of the passes of a thread in this face.
            return self.alone(first, path, still, inputs, analysis, findings);
        }
        let is_judged = analysis.is_some();
        let vibration = self.join(first, &path, still, inputs, analysis, findings)?;
        let peak_mm_per_s = peak_velocity(&vibration, path.rev_per_s());
        // The thread's own report knows X and Z, not the axes that carry them out in a tilted plane.
        let is_compared = first.frame.is_none();
        path.check_speeds((lead_axis, peak_mm_per_s), is_compared, first.span, findings);
        path.check_corners(findings);
        let number = self.open.as_ref().map(|open| open.job.passes.len() as u64);
        path.check_length(is_judged, number, first.span, findings).then_some(Pass { path, vibration })
    }

    /// A pass without vibration that joins no thread; the open one is closed.
    fn alone(
        &mut self,
        first: &ThreadBlock,
        path: PassPath,
        still: PathVibration,
        inputs: &ThreadInputs<'_>,
        analysis: Option<&mut ThreadAnalysis>,
        findings: &mut FindingLog,
    ) -> Option<Pass> {
        self.close(inputs, analysis, findings);
        path.check_speeds((still.lead_axis, 0.0), false, first.span, findings);
        path.check_corners(findings);
        path.check_length(false, None, first.span, findings).then_some(Pass { path, vibration: still })
    }

    /// Adds a pass to its thread and says how it vibrates.
    fn join(
        &mut self,
        first: &ThreadBlock,
        path: &PassPath,
        still: PathVibration,
        inputs: &ThreadInputs<'_>,
        analysis: Option<&mut ThreadAnalysis>,
        findings: &mut FindingLog,
    ) -> Option<PathVibration> {
        let settings = inputs.settings;
        let mode = self.switch.on().copied();
        let joins = self.open.as_ref().is_some_and(|open| open.takes(first, path, mode, findings));
        if !joins {
            self.close(inputs, analysis, findings);
            let profile_deg = first.mv.included_angle_deg.unwrap_or(settings.included_angle_deg);
            self.open = Some(Box::new(OpenThread::new(first, path, mode, still, profile_deg)));
        }
        let open = self.open.as_mut()?;
        if open.job.passes.len() >= MAX_THREAD_PASSES {
            let message = format!("the thread has more than {MAX_THREAD_PASSES} passes");
            let finding = Finding::new(code::THREAD_PASSES, first.span, message);
            findings
                .push(finding.with_value("limit", MAX_THREAD_PASSES as f64, "").suggest("let every pass go deeper"));
            return None;
        }
        open.last_line = first.span.line;
        open.moves_across |= path.moves_across(first.lead_axis());
        let index = open.add(first);
        let job = &mut open.job;
        let start = job.passes[index].start;
        if let Some(mode) = mode {
            let number = job.passes[..index].iter().filter(|pass| pass.start == start).count();
            let infeed_mm = job.infeed_mm(index);
            if first.mv.amplitude_mm.is_none() && infeed_mm * mode.ratio == 0.0 {
                let message = "the pass goes no deeper than the one before, so the ratio gives it no vibration";
                let finding = Finding::new(code::THREAD_NO_INFEED, first.span, message);
                let cure = "write its amplitude as A; A0.0 for a pass without vibration".to_owned();
                findings.push(finding.suggest(job.passes[index].cure_by_word(cure)));
            }
            let pass = &mut job.passes[index];
            pass.amplitude_mm = first.mv.amplitude_mm.unwrap_or(infeed_mm * mode.ratio);
            pass.phase_shift_deg = first.mv.phase_shift_deg.unwrap_or_else(|| settings.phase_shift_deg(number));
        }
        let wave = job.wave(&job.passes[index]);
        let lead_axis = job.geometry.lead_axis;
        Some(PathVibration { wave, start_up: job.start_up, lead_axis, outwards: job.geometry.inwards() })
    }

    /// What the interpolator runs of a pass. With `prepares` the tool moves to the vibration position by itself.
    pub(crate) fn run(
        &self,
        pass: &Pass,
        blocks: &[ThreadBlock],
        prepares: bool,
        inputs: &ThreadInputs<'_>,
        analysis: Option<&mut ThreadAnalysis>,
        findings: &mut FindingLog,
    ) -> Option<ThreadRun> {
        let run = pass.path.run(blocks, pass.vibration, inputs.settings, prepares, inputs.travel, findings)?;
        if let Some(analysis) = analysis {
            analysis.passes += 1;
        }
        Some(run)
    }

    /// Thread and number of the pass that is planned next, counted from 0, where it belongs to the thread in hand.
    pub(crate) fn next_pass(&self) -> (u64, usize) {
        (self.closed, self.open.as_ref().map_or(0, |open| open.job.passes.len()))
    }

    /// A stroke of a rigid tap; nothing after a finding that forbids it.
    pub(crate) fn tap(
        &mut self,
        stroke: &ThreadMove,
        element: Element,
        travel: Travel<'_>,
        findings: &mut FindingLog,
    ) -> Option<TapRun> {
        let span = element.source;
        let run = TapRun::new(stroke, element, span, travel, findings)?;
        if !std::mem::replace(&mut self.taps_reported, true) {
            let message = "the feed override does not act on rigid taps: the tool is bound to the spindle";
            findings.push(Finding::new(code::THREAD_TAP_OVERRIDE, span, message));
        }
        if let Some(finding) = run.speed_finding(stroke) {
            findings.push(finding);
        }
        Some(run)
    }

    /// Ends the thread: judges it where a report is wanted.
    pub(crate) fn close(
        &mut self,
        inputs: &ThreadInputs<'_>,
        analysis: Option<&mut ThreadAnalysis>,
        findings: &mut FindingLog,
    ) {
        let Some(open) = self.open.take() else { return };
        self.closed += 1;
        let Some(analysis) = analysis else { return };
        analysis.judged(open.judge(inputs), findings);
    }

    /// Carries out a block that switches the vibration of threads; an open thread is closed before.
    pub(crate) fn turn(&mut self, command: &FunctionCommand, span: SourceSpan, findings: &mut FindingLog) {
        self.switch.turn(command, span, findings, |findings| {
            let work = work_surface(command, span, findings);
            // The amplitude has to exceed the infeed.
            let ratio = mode_word(command, span, 'Q', "amplitude ratio", "Q1.2", 1.0, findings);
            let ((lead_axis, work_mm), ratio) = work.zip(ratio)?;
            let frame_mm = command.frame_offset[lead_axis.across().index()];
            Some(Mode { on_span: span, lead_axis, work_mm, frame_mm, ratio })
        });
    }

    /// The program ends.
    pub(crate) fn end(&mut self, findings: &mut FindingLog) {
        self.switch.end(findings);
    }
}

impl Pass {
    /// The path through blocks that are one pass; nothing after a finding.
    pub(crate) fn path(blocks: &[ThreadBlock], machine: &Machine, findings: &mut FindingLog) -> Option<PassPath> {
        let first = blocks.first()?;
        let path = PassPath::new(blocks, machine, findings)?;
        if let Some(axis) = path.missing_axis(first, machine) {
            findings.push(missing(axis, first.span, machine, false));
            return None;
        }
        Some(path)
    }

    /// Lets a rapid go to the vibration position at once, where the pass starts at its end; whether the tool prepares so.
    pub(crate) fn combine(&self, rapid: &mut Move, first: &ThreadBlock) -> bool {
        if rapid.end != first.mv.start {
            return false;
        }
        let wave = &self.vibration.wave;
        let prepared_mm = wave.retreat_mm(self.vibration.start_up, -1.0);
        rapid.end[self.vibration.lead_axis.across().index()] += self.vibration.outwards * prepared_mm;
        wave.amplitude_mm > 0.0
    }

    pub(crate) fn rev_per_s(&self) -> f64 {
        self.path.rev_per_s()
    }
}

/// Whether a further part of a thread states another vibration than the first: what it does not state, or states as the first
/// does, is that of the first. A thread that does not vibrate has amplitude 0.
fn contradicts(first: &ThreadMove, part: &ThreadMove, vibrates: bool) -> bool {
    let amplitude_mm = first.amplitude_mm.or_else(|| (!vibrates).then_some(0.0));
    part.amplitude_mm.is_some() && part.amplitude_mm != amplitude_mm
        || part.phase_shift_deg.is_some() && part.phase_shift_deg != first.phase_shift_deg
}

/// A pass above the face that was stated: the vibration retreats from the work, and this could be the face on its other side.
fn above_face(mode: &Mode, first: &ThreadBlock) -> Option<Finding> {
    let work_mm = mode.work_mm(&first.mv);
    let above_mm = first.mv.start[mode.lead_axis.across().index()] - work_mm;
    (mode.lead_axis == LeadAxis::X && above_mm > 0.0).then(|| {
        let message = format!(
            "the pass starts {} mm above the face at Z{} that is threaded, so it is open to which side the vibration retreats",
            decimal(above_mm, 4),
            decimal(work_mm, 4)
        );
        Finding::new(code::THREAD_FACE_SIDE, first.span, message)
            .ranked("", above_mm)
            .with_value("above", above_mm, "mm")
            .suggest("start the pass at or below the face, or state the face where it is (Z of G165)")
            .suggest("write A0.0 for a pass without vibration")
    })
}

/// A thread whose lead is along the axis that would vibrate.
fn vibrates_along_lead(vibrating: LeadAxis, span: SourceSpan) -> Finding {
    let (vibrates, stated, other) = match vibrating {
        LeadAxis::Z => ("X", "a work diameter (X)", "state its face instead, such as G165 P3 Z0.0 Q1.2"),
        LeadAxis::X => ("Z", "a face (Z)", "state its work diameter instead, such as G165 P3 X10.0 Q1.2"),
    };
    let message =
        format!("the thread vibrates in {vibrates}, since {stated} is stated, which is the direction of its lead here");
    Finding::new(code::THREAD_LEAD_X, span, message)
        .suggest(other)
        .suggest("switch the vibration off for this thread, or write A0.0")
}

/// The surface of the work that the block states, and with it the axis of the lead: a diameter, or Z of a face.
fn work_surface(command: &FunctionCommand, span: SourceSpan, findings: &mut FindingLog) -> Option<(LeadAxis, f64)> {
    let Some(face) = command.word('Z') else {
        let radius_mm = mode_word(command, span, 'X', "work diameter", "X10.0", 0.0, findings);
        return radius_mm.map(|radius_mm| (LeadAxis::Z, radius_mm));
    };
    if face.value.abs() <= 1e6 {
        return Some((LeadAxis::X, face.value));
    }
    let message = format!("the face of the work is at Z {}, more than 1000000 mm away", face.value);
    let finding = Finding::new(code::THREAD_MODE_WORD, face.span, message).with_value("face", face.value, "mm");
    findings.push(finding.suggest("write Z with the face of the work, such as Z0.0"));
    None
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
