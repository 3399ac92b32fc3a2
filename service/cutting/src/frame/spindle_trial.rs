//! Whether what follows a place between sections may be cut at another spindle speed: it is run as a validation would, up to the
//! next such place, and what is found then is compared with what is found at the programmed speed.

use std::sync::Arc;

use feedwave_program::{Finding, FindingCode, FindingLog, Place, Severity, SourceSpan};

use crate::code;
use crate::frame::builder::Analysis;
use crate::frame::config::OverrideChange;
use crate::frame::pipeline::{Pipeline, Step};
use crate::functions::path_vibration::SectionReport;
use crate::shared::setpoint::SetpointBlock;

/// What became of a step of a [`SpindleTrial`].
#[derive(Clone, Debug, PartialEq)]
pub enum TrialStep {
    /// Program bytes from this place on are needed: [`SpindleTrial::push`], or [`SpindleTrial::finish_input`].
    NeedInput(Place),
    /// There is more to do.
    More,
    /// What follows may be cut at that speed; whether anything is cut there.
    Holds {
        /// A cut follows before the next such place.
        cuts: bool,
    },
    /// It may not: the first condition that holds at the programmed speed and would no longer hold.
    Fails(Box<Finding>),
}

/// Judges another spindle speed for what follows a place between sections, without touching the pipeline there.
///
/// The feed override is 100 %; conditions that hold for a range of overrides are judged for all that may be in force there.
#[derive(Debug)]
pub struct SpindleTrial {
    run: Run,
    /// The same at the programmed speed; asked only where the other speed brings warnings.
    programmed: Option<Run>,
    /// What was found at the other speed.
    found: Option<Judged>,
}

/// What a run has found.
#[derive(Debug, Default)]
struct Judged {
    findings: Vec<Finding>,
    /// Of vibrating sections, in their order.
    sections: Vec<SectionReport>,
    /// Whether anything is cut.
    cuts: bool,
}

#[derive(Debug)]
struct Run {
    pipeline: Pipeline,
    block: SetpointBlock,
}

impl Run {
    fn new(at_place: &Pipeline, ratio: f64, largest_override: f64) -> Self {
        let mut pipeline = at_place.clone();
        let profile = &mut Arc::make_mut(&mut pipeline.config).profile;
        profile.max_feed_override = largest_override.clamp(1.0, profile.max_feed_override);
        pipeline.findings = FindingLog::default();
        pipeline.builder.analysis = Some(Analysis::default());
        // A held feed would never come to the end, and what is ahead in the configuration is none of the trial's.
        let index = pipeline.earliest_override();
        let _ = pipeline.append_override(OverrideChange { index, ratio: 1.0 });
        pipeline.leave_place_at(ratio);
        let block = pipeline.new_block();
        Self { pipeline, block }
    }

    /// Goes on by a block; what was found, at the end.
    fn step(&mut self) -> Result<Judged, Option<Place>> {
        match self.pipeline.next_block(&mut self.block) {
            Step::NeedInput(place) => return Err(Some(place)),
            Step::Block if self.pipeline.place_between().is_none() => return Err(None),
            Step::Block | Step::Finished | Step::Refused => {}
        }
        let Pipeline { builder, findings, config, spindle, .. } = &mut self.pipeline;
        let (mut sections, mut cuts) = (Vec::new(), false);
        if let Some(analysis) = &mut builder.analysis {
            cuts = analysis.cutting_moves > 0;
            analysis.functions.vibration.finish_waiting(findings);
            sections = std::mem::take(&mut analysis.functions.vibration.sections.first);
        }
        builder.close_thread(config, findings);
        let mut findings = std::mem::take(findings).into_findings();
        findings.extend(spindle.above_clamp_line.map(above_clamp));
        Ok(Judged { findings, sections, cuts })
    }
}

fn above_clamp(line: u32) -> Finding {
    let span = SourceSpan { line, column: 1, ..SourceSpan::default() };
    let message =
        "a faster spindle would exceed the highest speed that the program permits under constant surface speed";
    Finding::new(code::SPINDLE_SPEED, span, message).suggest("permit a higher speed in the program")
}

/// Warnings that a limit or a condition is exceeded, which may not be by more than at the programmed speed. The steps of a held
/// oscillation and of the published form are what was chosen.
const LIMITS: [FindingCode; 7] = [
    code::OSC_OVERRIDE,
    code::THREAD_CORNER,
    code::THREAD_FOLLOWING_DEEP,
    code::THREAD_VIBRATION_STEP,
    code::VIB_CHIP_OVERRIDE,
    code::VIB_FOLLOWING_CONTOUR,
    code::VIB_FOLLOWING_EXCESS,
];

impl Judged {
    /// The first warning about what holds in another run and does not hold here. That a chip does not break is said once of a
    /// section: a cut whose chip breaks there counts, whatever others of its section do.
    fn lost_against(&self, known: &Self) -> Option<&Finding> {
        if self.sections.iter().zip(&known.sections).any(|(here, there)| here.loses_chips_of(there))
            && let Some(finding) = self.findings.iter().find(|finding| finding.code == code::VIB_CHIP_UNBROKEN)
        {
            return Some(finding);
        }
        let is_known = |finding: &Finding| {
            let is_limit = LIMITS.contains(&finding.code);
            let is_same = |other: &Finding| (other.code, other.span.line) == (finding.code, finding.span.line);
            known.findings.iter().any(|other| if is_limit { finding.is_within(other) } else { is_same(other) })
        };
        self.findings.iter().find(|finding| !is_known(finding))
    }
}

impl SpindleTrial {
    /// A trial of a ratio to the programmed speed; `None` where the pipeline is at no place between sections. `largest_override` is
    /// the largest feed override that may be in force behind it, beside that of the machine
    /// ([`crate::MachineProfile::max_feed_override`]).
    #[must_use]
    pub fn new(pipeline: &Pipeline, ratio: f64, largest_override: f64) -> Option<Self> {
        pipeline.place_between()?;
        let run = |ratio: f64| Run::new(pipeline, ratio, largest_override);
        Some(Self { run: run(ratio), programmed: (ratio != 1.0).then(|| run(1.0)), found: None })
    }

    /// Goes on by at most a block of setpoints.
    pub fn step(&mut self) -> TrialStep {
        let Some(found) = &self.found else {
            return match self.run.step() {
                Ok(found) => self.judge(found),
                Err(Some(place)) => TrialStep::NeedInput(place),
                Err(None) => TrialStep::More,
            };
        };
        match self.programmed.as_mut().map(Run::step) {
            Some(Err(Some(place))) => TrialStep::NeedInput(place),
            Some(Err(None)) => TrialStep::More,
            Some(Ok(known)) => found
                .lost_against(&known)
                .map_or(TrialStep::Holds { cuts: found.cuts }, |finding| TrialStep::Fails(Box::new(finding.clone()))),
            None => TrialStep::Holds { cuts: found.cuts },
        }
    }

    /// Errors decide; warnings are compared with those at the programmed speed.
    fn judge(&mut self, mut found: Judged) -> TrialStep {
        if let Some(error) = found.findings.iter().find(|finding| finding.severity == Severity::Error) {
            return TrialStep::Fails(Box::new(error.clone()));
        }
        found.findings.retain(|finding| finding.severity == Severity::Warning);
        if found.findings.is_empty() || self.programmed.is_none() {
            return TrialStep::Holds { cuts: found.cuts };
        }
        self.found = Some(found);
        TrialStep::More
    }

    fn in_hand(&mut self) -> Option<&mut Pipeline> {
        let run = if self.found.is_some() { self.programmed.as_mut()? } else { &mut self.run };
        Some(&mut run.pipeline)
    }

    /// See [`Pipeline::push`].
    pub fn push(&mut self, bytes: &[u8]) {
        if let Some(pipeline) = self.in_hand() {
            pipeline.push(bytes);
        }
    }

    /// See [`Pipeline::finish_input`].
    pub fn finish_input(&mut self) {
        if let Some(pipeline) = self.in_hand() {
            pipeline.finish_input();
        }
    }
}
