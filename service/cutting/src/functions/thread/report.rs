//! The judgement of a thread before it is cut (docs/functions/thread-vibration.md, "Findings").

use feedwave_program::{Finding, FindingLog};

use super::chip::{Clearance, chip, least_ratio};
use super::parameters::parameters;
use super::{ChipLevel, GroovePlace, ThreadChip, ThreadDrives, ThreadFollowing, ThreadJob, findings, following};

/// Most passes of one thread; more are refused.
pub const MAX_THREAD_PASSES: usize = 100;

/// What machine, tool and setup allow a thread. A limit that is not stated is infinite; the report then says
/// nothing about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadLimits {
    /// Highest velocity of the lead axis, mm/s.
    pub lead_velocity_mm_per_s: f64,
    /// Highest acceleration of the lead axis, mm/s².
    pub lead_acceleration_mm_per_s2: f64,
    /// Highest jerk of the lead axis, mm/s³.
    pub lead_jerk_mm_per_s3: f64,
    /// Highest velocity of X on the radius, mm/s.
    pub vibration_velocity_mm_per_s: f64,
    /// Highest acceleration of X on the radius, mm/s².
    pub vibration_acceleration_mm_per_s2: f64,
    /// Highest jerk of X on the radius, mm/s³.
    pub vibration_jerk_mm_per_s3: f64,
    /// Travel from the start position to the work, mm.
    pub approach_mm: f64,
    /// Highest spindle speed, rev/min.
    pub max_spindle_rev_per_min: f64,
    /// Interpolation period, s; 0 where setpoints follow the spindle angle.
    pub period_s: f64,
    /// Largest thickness on the radius that the tool withstands, mm.
    pub thickness_mm: f64,
    /// Largest thickness on the radius that the finishing pass may find, mm; `None` compares the crests with the
    /// finishing infeed.
    pub finishing_thickness_mm: Option<f64>,
    /// The drives of its axes.
    pub drives: ThreadDrives,
}

impl Default for ThreadLimits {
    fn default() -> Self {
        let unlimited = f64::INFINITY;
        Self {
            lead_velocity_mm_per_s: unlimited,
            lead_acceleration_mm_per_s2: unlimited,
            lead_jerk_mm_per_s3: unlimited,
            vibration_velocity_mm_per_s: unlimited,
            vibration_acceleration_mm_per_s2: unlimited,
            vibration_jerk_mm_per_s3: unlimited,
            approach_mm: unlimited,
            max_spindle_rev_per_min: unlimited,
            period_s: 0.0,
            thickness_mm: unlimited,
            finishing_thickness_mm: None,
            drives: ThreadDrives::default(),
        }
    }
}

/// One pass of a thread.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadPassReport {
    /// Infeed, mm on the radius.
    pub infeed_mm: f64,
    /// Peak-to-peak vibration A, mm on the radius.
    pub amplitude_mm: f64,
    /// Where it lies in its groove, and its phase there.
    pub place: GroovePlace,
    /// D·Q: vibration phase at the moment the lead axis starts, degrees, without the phase shift.
    pub phase_advance_deg: f64,
    /// Phase to which start-up A moves X beforehand, degrees.
    pub prepared_phase_deg: f64,
    /// Retreat at that phase, mm on the radius.
    pub prepared_retreat_mm: f64,
    /// Spindle angle at which start-up B starts the vibration, degrees.
    pub delay_deg: f64,
    /// Spindle angle from which on the vibration has its phase, degrees: start-up A takes two vibrations to come into it where
    /// it starts in the middle of the wave.
    pub in_phase_deg: f64,
    /// The chip, looking at the depth only.
    pub depth: ThreadChip,
    /// The chip, looking at the full section.
    pub section: ThreadChip,
}

/// What the vibrating passes leave for the finishing pass at the worst phase, in the groove where it is most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrestReport {
    /// Crests above the depth of the last vibrating pass, depth only, mm on the radius.
    pub crest_mm: f64,
    /// The same with the full section.
    pub section_crest_mm: f64,
    /// Nominal infeed of the finishing pass, mm on the radius; 0 where there is none.
    pub finishing_infeed_mm: f64,
    /// What the finishing pass finds at most, depth only, mm on the radius; the crests where there is none.
    pub finishing_thickness_mm: f64,
    /// Crests that one more vibrating pass at the last depth with opposite phase and the same amplitude leaves, mm.
    pub crest_with_another_pass_mm: f64,
    /// What the finishing pass finds then, as in `finishing_thickness_mm`.
    pub finishing_thickness_with_another_pass_mm: f64,
    /// Crests that the last vibrating pass leaves with the smallest amplitude that cuts its chip through, over the full section where
    /// it is cut through there, otherwise at its depth, mm.
    pub crest_with_least_amplitude_mm: f64,
    /// What the finishing pass finds then, as in `finishing_thickness_mm`.
    pub finishing_thickness_with_least_amplitude_mm: f64,
    /// That amplitude, mm on the radius.
    pub least_amplitude_mm: f64,
    /// Last vibrating pass, from 0.
    pub pass: usize,
}

/// A thread of a program: its passes and their judgement.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadSectionReport {
    /// Line that switched the vibration on; `None` for a thread without vibration.
    pub on_line: Option<u32>,
    /// First line with a pass.
    pub first_line: u32,
    /// Last line with a pass.
    pub last_line: u32,
    /// Ratio of amplitude to infeed, where the vibration is on.
    pub ratio: Option<f64>,
    /// Whether the work's diameter is assumed: no word states it without vibration. The first infeed is then taken to be
    /// the largest of the later ones. A thread on the other side of the axis is told as its mirror image.
    pub work_diameter_assumed: bool,
    /// The thread as it is cut.
    pub job: ThreadJob,
    /// Its judgement.
    pub report: ThreadReport,
}

/// The judgement of a thread.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadReport {
    /// Every pass; empty where the thread itself is impossible.
    pub passes: Vec<ThreadPassReport>,
    /// What is left for the finishing pass; `None` without a vibrating pass.
    pub crests: Option<CrestReport>,
    /// Smallest ratio of amplitude to infeed with which every vibrating pass breaks its chip, depth only, where all
    /// amplitudes follow the ratio; `None` where none does.
    pub least_ratio: Option<f64>,
    /// The same with the full section.
    pub least_section_ratio: Option<f64>,
    /// Velocity of the lead axis, mm/s.
    pub lead_velocity_mm_per_s: f64,
    /// Vibration frequency, Hz.
    pub frequency_hz: f64,
    /// Travel of the lead axis at either end over which its lead is not exact, mm.
    pub run_up_mm: f64,
    /// Length of thread with exact lead, mm, in the pass where it is shortest.
    pub exact_length_mm: f64,
    /// What arrives at the tool; `None` where nothing is stated of the drives, and where the thread itself is impossible.
    pub following: Option<ThreadFollowing>,
    /// Findings in the order of the first pass that each concerns.
    pub findings: Vec<Finding>,
    /// Whether nothing forbids to cut the thread.
    pub feasible: bool,
}

/// Judges a thread: what every pass does to the chip, what is left, and whether machine and tool can do it.
///
/// Bounded by [`MAX_THREAD_PASSES`].
#[must_use]
pub fn judge_thread(job: &ThreadJob, limits: &ThreadLimits) -> ThreadReport {
    judge(job, limits, false)
}

/// The same for a thread whose work diameter may be assumed.
pub(super) fn judge(job: &ThreadJob, limits: &ThreadLimits, work_is_assumed: bool) -> ThreadReport {
    let mut findings = FindingLog::default();
    parameters(job, limits, &mut findings);
    let mut report = ThreadReport {
        passes: Vec::new(),
        crests: None,
        least_ratio: None,
        least_section_ratio: None,
        lead_velocity_mm_per_s: job.geometry.lead_mm * job.spindle_rev_per_min / 60.0,
        frequency_hz: job.frequency_hz(),
        run_up_mm: job.run_up.travel_mm(job.geometry.lead_mm),
        exact_length_mm: 0.0,
        following: None,
        findings: Vec::new(),
        feasible: false,
    };
    if findings.findings().is_empty() {
        let lengths_mm = job.passes.iter().map(|pass| job.exact_length_mm(pass));
        report.exact_length_mm = lengths_mm.fold(f64::INFINITY, f64::min).max(0.0);
        report.passes = (0..job.passes.len()).map(|index| pass_report(job, index)).collect();
        report.crests = worst_crests(job);
        report.least_ratio = common_ratio(job, ChipLevel::Depth);
        report.least_section_ratio = common_ratio(job, ChipLevel::Section);
        report.following = ThreadFollowing::of(job, &limits.drives);
        findings::thread(job, limits, work_is_assumed, &report, &mut findings);
        following::findings(job, limits, &report, &mut findings);
    }
    report.feasible = !findings.has_errors();
    report.findings = findings.into_findings();
    report
}

fn pass_report(job: &ThreadJob, index: usize) -> ThreadPassReport {
    let pass = &job.passes[index];
    let wave = job.wave(pass);
    ThreadPassReport {
        infeed_mm: job.infeed_mm(index),
        amplitude_mm: pass.amplitude_mm,
        place: job.place(index),
        phase_advance_deg: job.phase_advance_deg(pass),
        prepared_phase_deg: wave.prepared_phase_deg(),
        prepared_retreat_mm: wave.at_phase_mm(wave.prepared_phase_deg()),
        delay_deg: wave.delay_deg(),
        in_phase_deg: wave.in_phase_deg(job.start_up),
        depth: chip(job, index, ChipLevel::Depth),
        section: chip(job, index, ChipLevel::Section),
    }
}

fn common_ratio(job: &ThreadJob, level: ChipLevel) -> Option<f64> {
    let follows = |index: &usize| job.passes[*index].vibrates() && job.infeed_mm(*index) > 0.0;
    let mut passes = (0..job.passes.len()).filter(follows).peekable();
    passes.peek()?;
    passes.try_fold(0.0, |ratio: f64, index| Some(ratio.max(least_ratio(job, index, level)?)))
}

fn worst_crests(job: &ThreadJob) -> Option<CrestReport> {
    // A thread of many starts has the same passes in each: what differs is how far each is.
    let starts = 0..job.geometry.starts.min(MAX_THREAD_PASSES as u32);
    starts
        .filter_map(|start| crests(job, start))
        .max_by(|a, b| a.finishing_thickness_mm.total_cmp(&b.finishing_thickness_mm))
}

/// Crests in one groove.
fn crests(job: &ThreadJob, start: u32) -> Option<CrestReport> {
    let pass = job.passes.iter().rposition(|pass| pass.start == start && pass.vibrates())?;
    let last = job.passes[pass];
    let still = super::ThreadPass { amplitude_mm: 0.0, ..last };
    let finishing = job.passes[pass + 1..].iter().position(|after| after.start == start).map(|after| pass + 1 + after);
    let another = super::ThreadPass { phase_shift_deg: last.phase_shift_deg + 180.0, ..last };
    let mut with_another = job.clone();
    with_another.passes.insert(pass + 1, another);
    // A section that is cut through stays so.
    let section = chip(job, pass, ChipLevel::Section);
    let cut = if section.broken { section } else { chip(job, pass, ChipLevel::Depth) };
    let least_amplitude_mm = cut.least_amplitude_mm;
    let mut with_least = job.clone();
    with_least.passes[pass].amplitude_mm = least_amplitude_mm;
    // The crests and what the finishing pass finds, with so many passes added.
    let left = |job: &ThreadJob, added: usize| {
        let crest_mm = left_for(job, pass + 1 + added, still, ChipLevel::Depth);
        let found = |index: usize| Clearance::of(job, index + added, ChipLevel::Depth).largest_thickness_mm();
        (crest_mm, finishing.map_or(crest_mm, found))
    };
    let (crest_mm, finishing_thickness_mm) = left(job, 0);
    let (crest_with_another_pass_mm, finishing_thickness_with_another_pass_mm) = left(&with_another, 1);
    let (crest_with_least_amplitude_mm, finishing_thickness_with_least_amplitude_mm) = left(&with_least, 0);
    Some(CrestReport {
        crest_mm,
        section_crest_mm: left_for(job, pass + 1, still, ChipLevel::Section),
        finishing_infeed_mm: finishing.map_or(0.0, |index| job.infeed_mm(index)),
        finishing_thickness_mm,
        crest_with_another_pass_mm,
        finishing_thickness_with_another_pass_mm,
        crest_with_least_amplitude_mm,
        finishing_thickness_with_least_amplitude_mm,
        least_amplitude_mm,
        pass,
    })
}

/// What a pass would find after the first `done` passes, mm on the radius.
fn left_for(job: &ThreadJob, done: usize, pass: super::ThreadPass, level: ChipLevel) -> f64 {
    let mut passes = job.passes[..done].to_vec();
    passes.push(pass);
    Clearance::of(&ThreadJob { passes, ..job.clone() }, done, level).largest_thickness_mm()
}
