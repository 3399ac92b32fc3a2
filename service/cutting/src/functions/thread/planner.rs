//! Pass planner: from thread, tool and limits to passes whose chips break in both models
//! (docs/functions/thread-vibration.md).
//!
//! Depths follow the law, offsets the infeed pattern, phases alternate between 0° and 180° at the same place on the
//! work, and every amplitude is the smallest that clears the full section, with a margin. Where machine or tool
//! cannot do that, more passes are tried: each is shallower and needs less. Crests that are too much for
//! the finishing pass are taken by one more vibrating pass at the last depth, whose own amplitude is all that
//! remains of them.

use feedwave_program::{Finding, Severity, SourceSpan};

use super::chip::least_amplitude_mm;
use super::code;
use super::parameters::refusal;
use super::report::ThreadLimits;
use super::{
    ChipLevel, DepthLaw, GrooveProfile, Hand, InfeedPattern, LeadAxis, MAX_THREAD_PASSES, RunUp, StartUp, ThreadDrives,
    ThreadGeometry, ThreadJob, ThreadPass, ThreadReport, ThreadSide, judge_thread, reduce_deg,
};
use crate::shared::wording::{decimal, round_down, round_to, round_up};

/// How passes with an axial offset, and the starts of a thread, are brought to their place
/// (docs/functions/thread-vibration.md, "Phase").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PassMethod {
    /// Method 1: by the start position in Z; all start angles are 0.
    StartPosition,
    /// Method 2: by the start angle; all start positions are equal.
    #[default]
    StartAngle,
}

/// What is to be cut, with what, and within which limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadRequest {
    /// The thread.
    pub geometry: ThreadGeometry,
    /// Its hand, where it is to be checked against direction and spindle.
    pub hand: Option<Hand>,
    /// Section of the groove.
    pub profile: GrooveProfile,
    /// Depth of the finished thread, mm on the radius.
    pub depth_mm: f64,
    /// Depth left to the finishing pass, mm on the radius.
    pub finishing_allowance_mm: f64,
    /// Largest depth of the first pass, mm on the radius.
    pub first_depth_mm: f64,
    /// How the tool comes into the groove.
    pub infeed: InfeedPattern,
    /// How the depth grows.
    pub law: DepthLaw,
    /// How passes are brought to their place.
    pub method: PassMethod,
    /// How the vibration starts.
    pub start_up: StartUp,
    /// Vibrations per spindle revolution D.
    pub vibrations_per_rev: f64,
    /// Spindle speed, rev/min.
    pub spindle_rev_per_min: f64,
    /// Amplitude over the smallest that breaks the chip; above 1.
    pub amplitude_margin: f64,
    /// What machine and tool allow.
    pub limits: ThreadLimits,
}

/// A thread that breaks its chips.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadPlan {
    /// The passes.
    pub job: ThreadJob,
    /// Their judgement; without errors and warnings but of what the drives leave of it.
    pub report: ThreadReport,
}

/// What a machine resolves in a program: 0.001 mm and 0.001°.
const PLACES: usize = 3;

/// Plans the passes of a thread.
///
/// # Errors
/// Findings that say why not: impossible quantities, or limits that no number of passes keeps.
pub fn plan_thread(request: &ThreadRequest) -> Result<ThreadPlan, Vec<Finding>> {
    let invalid = check(request);
    if !invalid.is_empty() {
        return Err(invalid);
    }
    let rough_depth_mm = request.depth_mm - request.finishing_allowance_mm;
    // One finishing pass, and perhaps one for the crests, belong to every start.
    let most = (MAX_THREAD_PASSES / request.geometry.starts as usize).saturating_sub(2);
    let Some(mut passes) = request.law.passes(rough_depth_mm, request.first_depth_mm, most) else {
        return Err(vec![too_many(request, most, None)]);
    };
    // More passes do not help a drive.
    let limits = ThreadLimits { drives: ThreadDrives::default(), ..request.limits };
    loop {
        let job = build(request, passes);
        let report = judge_thread(&job, &limits);
        let disturbing = || report.findings.iter().filter(|finding| finding.severity != Severity::Info);
        if disturbing().next().is_none() {
            let report = judge_thread(&job, &request.limits);
            return Ok(ThreadPlan { job, report });
        }
        if !disturbing().all(is_cured_by_passes) {
            return Err(disturbing().cloned().collect());
        }
        let more = passes + (passes / 8).max(1);
        if more > most {
            return Err(vec![too_many(request, passes, disturbing().next())]);
        }
        passes = more;
    }
}

/// Whether shallower passes with smaller amplitudes need less of what a finding asks for.
fn is_cured_by_passes(finding: &Finding) -> bool {
    [
        code::THREAD_VIBRATION_VELOCITY,
        code::THREAD_VIBRATION_ACCELERATION,
        code::THREAD_VIBRATION_JERK,
        code::THREAD_VIBRATION_STEP,
        code::THREAD_THICKNESS,
    ]
    .contains(&finding.code)
}

fn too_many(request: &ThreadRequest, passes: usize, remaining: Option<&Finding>) -> Finding {
    let reason = remaining.map_or_else(
        || format!("more than {passes} vibrating passes"),
        |finding| format!("more than {passes} vibrating passes: {}", finding.message),
    );
    let message = format!("the thread of {} mm depth would need {reason}", decimal(request.depth_mm, 3));
    let mut finding = Finding::new(code::THREAD_PLAN_PASSES, SourceSpan::default(), message)
        .with_value("depth", request.depth_mm, "mm")
        .with_value("first_depth", request.first_depth_mm, "mm")
        .with_value("passes", passes as f64, "");
    match remaining {
        Some(remaining) => {
            finding.values.extend(remaining.values.iter().cloned());
            finding.suggest("turn slower, use fewer vibrations per revolution, or come straight in")
        }
        None => finding.suggest("allow a deeper first pass"),
    }
}

/// What can be said before any pass exists.
fn check(request: &ThreadRequest) -> Vec<Finding> {
    let span = SourceSpan::default();
    let mut findings = Vec::new();
    let mut refuse = |name: &'static str, value: f64, unit: &'static str, permitted: &str| {
        findings.push(refusal(span, name, value, unit, permitted));
    };
    if !(request.depth_mm > 0.0 && request.depth_mm <= 1e4) {
        refuse("depth", request.depth_mm, "mm", "above 0 and at most 10000");
    }
    let allowance_mm = request.finishing_allowance_mm;
    if !(allowance_mm >= 0.0 && allowance_mm < request.depth_mm) {
        refuse("finishing_allowance", allowance_mm, "mm", "from 0 to below the depth");
    }
    if !(request.first_depth_mm >= 0.001 && request.first_depth_mm.is_finite()) {
        refuse("first_depth", request.first_depth_mm, "mm", "at least 0.001");
    }
    if !(request.amplitude_margin > 1.0 && request.amplitude_margin <= 10.0) {
        refuse("amplitude_margin", request.amplitude_margin, "", "above 1 and at most 10");
    }
    if !(1..=30).contains(&request.geometry.starts) {
        refuse("starts", f64::from(request.geometry.starts), "", "from 1 to 30");
    }
    if let InfeedPattern::ModifiedFlank { relief_deg } = request.infeed
        && !(relief_deg >= 0.0 && relief_deg <= 0.5 * request.profile.included_angle_deg)
    {
        refuse("relief_angle", relief_deg, "deg", "from 0 to half the included angle");
    }
    if request.geometry.lead_axis == LeadAxis::X && request.geometry.side == ThreadSide::Internal {
        let message = "a thread on a face is planned from its side of larger Z: a program could not say otherwise";
        let finding = Finding::new(code::THREAD_FACE_SIDE, span, message);
        findings.push(finding.suggest("turn the work, so that its face is on the side of larger Z"));
    }
    findings.extend(no_crests(request, span));
    findings.extend(other_hand(request, span));
    findings
}

/// The finishing pass may find too little for crests.
fn no_crests(request: &ThreadRequest, span: SourceSpan) -> Option<Finding> {
    let allowance_mm = request.finishing_allowance_mm;
    // Below, amplitude and crests would come under what a program can say.
    let budget_mm = crest_budget_mm(request);
    if budget_mm >= 0.002 {
        return None;
    }
    let permitted_mm = permitted_mm(request);
    let needed_mm = round_up(allowance_mm + 0.002, PLACES);
    let message = format!(
        "the finishing pass may find {} mm, which leaves nothing for crests above its allowance of {} mm",
        decimal(permitted_mm, 4),
        decimal(allowance_mm, 4)
    );
    Some(
        Finding::new(code::THREAD_PLAN_CRESTS, span, message)
            .with_value("permitted", permitted_mm, "mm")
            .with_value("finishing_allowance", allowance_mm, "mm")
            .suggest_value(
                format!("permit at least {} mm", decimal(needed_mm, 3)),
                None,
                "finishing_thickness",
                needed_mm,
                "mm",
            ),
    )
}

/// The thread would have the other hand than is wanted.
fn other_hand(request: &ThreadRequest, span: SourceSpan) -> Option<Finding> {
    let hand = request.geometry.hand();
    if request.hand.is_none_or(|wanted| wanted == hand) {
        return None;
    }
    let name = match hand {
        Hand::Right => "right-hand",
        Hand::Left => "left-hand",
    };
    let message = format!("this direction of cut and spindle make a {name} thread");
    Some(
        Finding::new(code::THREAD_HAND, span, message)
            .with_value("start_z", request.geometry.start_mm, "mm")
            .with_value("end_z", request.geometry.end_mm, "mm")
            .suggest("exchange start and end of the thread")
            .suggest("reverse the spindle"),
    )
}

/// Largest thickness that the finishing pass may find, mm on the radius.
fn permitted_mm(request: &ThreadRequest) -> f64 {
    request.limits.finishing_thickness_mm.unwrap_or(2.0 * request.finishing_allowance_mm)
}

fn crest_budget_mm(request: &ThreadRequest) -> f64 {
    permitted_mm(request) - request.finishing_allowance_mm
}

/// The thread in `passes` roughing passes per start, with what follows them.
fn build(request: &ThreadRequest, passes: usize) -> ThreadJob {
    let ThreadRequest { geometry, profile, limits, .. } = *request;
    let run_up = RunUp::within(
        geometry.lead_mm,
        request.spindle_rev_per_min / 60.0,
        limits.lead_acceleration_mm_per_s2,
        limits.lead_jerk_mm_per_s3,
    );
    let mut job = ThreadJob {
        geometry,
        profile,
        vibrations_per_rev: request.vibrations_per_rev,
        start_up: request.start_up,
        run_up: RunUp { angle_deg: round_up(run_up.angle_deg, PLACES) },
        spindle_rev_per_min: request.spindle_rev_per_min,
        passes: Vec::new(),
    };
    let rough_depth_mm = request.depth_mm - request.finishing_allowance_mm;
    let depth_mm = |pass| round_to(request.law.depth_mm(pass, passes, rough_depth_mm), PLACES);
    for pass in 0..passes {
        add(&mut job, request, pass, depth_mm(0), depth_mm(pass), Swing::Breaking);
    }
    let last_mm = depth_mm(passes - 1);
    let budget_mm = crest_budget_mm(request);
    let amplitude_mm = job.passes.last().map_or(0.0, |pass| pass.amplitude_mm);
    if amplitude_mm > budget_mm {
        // As the last roughing pass, but opposite in phase.
        let swing = Swing::Given { amplitude_mm: round_down(budget_mm, PLACES), offset_of: passes - 1 };
        add(&mut job, request, passes, depth_mm(0), last_mm, swing);
    }
    add(&mut job, request, passes, depth_mm(0), round_to(request.depth_mm, PLACES), Swing::None);
    job
}

/// How a planned pass vibrates.
#[derive(Clone, Copy)]
enum Swing {
    /// So that the chip breaks in both models.
    Breaking,
    /// With an amplitude, at the axial offset of another pass.
    Given { amplitude_mm: f64, offset_of: usize },
    /// Not at all.
    None,
}

/// Adds one pass to every start.
fn add(job: &mut ThreadJob, request: &ThreadRequest, pass: usize, first_mm: f64, depth_mm: f64, swing: Swing) {
    let place = if let Swing::Given { offset_of, .. } = swing { offset_of } else { pass };
    let offset_mm = request.infeed.axial_offset_mm(&job.profile, place, first_mm, depth_mm, request.depth_mm);
    let offset_mm = round_to(offset_mm, PLACES);
    let ThreadGeometry { lead_mm, starts, .. } = job.geometry;
    let pitch_mm = job.geometry.pitch_mm();
    for start in 0..starts {
        let (start_travel_mm, start_angle_deg) = match request.method {
            // Further starts begin further before the work, never in it.
            PassMethod::StartPosition => (offset_mm - pitch_mm * f64::from(start), 0.0),
            PassMethod::StartAngle => {
                let turns = f64::from(start) / f64::from(starts) - offset_mm / lead_mm;
                (0.0, reduce_deg(round_to(reduce_deg(360.0 * turns), PLACES)))
            }
        };
        let index = job.passes.len();
        job.passes.push(ThreadPass { start, depth_mm, start_travel_mm, start_angle_deg, ..ThreadPass::default() });
        // Opposite to the pass before at the same place on the work, however many turns later that is.
        let wanted_deg = super::default_phase_shift_deg(pass);
        let shift_deg = reduce_deg(wanted_deg - job.place(index).phase_shift_deg);
        job.passes[index].amplitude_mm = match swing {
            Swing::None => 0.0,
            Swing::Given { amplitude_mm, .. } => amplitude_mm,
            Swing::Breaking => {
                job.passes[index].phase_shift_deg = shift_deg;
                let least_mm = least_amplitude_mm(job, index, ChipLevel::Section).max(job.infeed_mm(index));
                round_up(least_mm * request.amplitude_margin, PLACES)
            }
        };
        if job.passes[index].vibrates() {
            job.passes[index].phase_shift_deg = reduce_deg(round_to(shift_deg, PLACES));
        }
    }
}
