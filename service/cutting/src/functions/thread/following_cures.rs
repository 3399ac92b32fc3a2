//! What ends that the drives keep a pass from breaking its chip, or let it cut too deep. Every value is judged as it is written,
//! with what arrives of it, before it is named.

use feedwave_program::Severity;

use super::chip::chip;
use super::following::{ThreadFollowing, is_too_deep};
use super::{ChipLevel, ThreadDrives, ThreadJob, ThreadLimits, judge_thread};
use crate::shared::wording::{round_down, round_up};

/// Doublings of an amplitude, or of a ratio, that are tried.
const DOUBLINGS: u32 = 6;
/// Halvings until it is known to a thousandth of 0.1 µm.
const BISECTIONS: u32 = 32;
/// Other spindle speeds are tried in steps of this share.
const SPEED_STEP: f64 = 0.95;
/// Steps: down to a fiftieth, and up to nearly three times the speed.
const SPEED_STEPS: i32 = 77;
const FASTER_STEPS: i32 = 20;

/// Smallest amplitude of one pass, mm to 0.1 µm, of which enough arrives to break its chip; `None` where none does, or something
/// else forbids it.
pub(super) fn amplitude_mm(job: &ThreadJob, index: usize, limits: &ThreadLimits) -> Option<f64> {
    let with = |amplitude_mm: f64| {
        let mut job = job.clone();
        job.passes[index].amplitude_mm = amplitude_mm;
        job
    };
    let breaks = |amplitude_mm: f64| {
        let following = ThreadFollowing::of(&with(amplitude_mm), &limits.drives);
        following.is_some_and(|following| following.passes[index].depth_broken)
    };
    let least_mm = round_up(least_above(job.passes[index].amplitude_mm, breaks)? + 1e-6, 4);
    (breaks(least_mm) && forbids_nothing_more(job, &with(least_mm), limits)).then_some(least_mm)
}

/// Smallest ratio of amplitude to infeed, to a hundredth, of which enough arrives to break the chip of every pass; `None` as with an
/// amplitude, and where a pass has an amplitude of its own.
pub(super) fn ratio(job: &ThreadJob, limits: &ThreadLimits) -> Option<f64> {
    let vibrating = || (0..job.passes.len()).filter(|index| job.passes[*index].vibrates());
    let is_own = |index: usize| job.passes[index].amplitude_word.is_none_or(|word| word.span.is_some());
    let ratio_of = |index: usize| job.passes[index].amplitude_mm / job.infeed_mm(index);
    let present = ratio_of(vibrating().next()?);
    if vibrating().any(|index| is_own(index) || (ratio_of(index) / present - 1.0).abs() > 1e-9) {
        return None;
    }
    let with = |ratio: f64| {
        let mut job = job.clone();
        let still: Vec<bool> = job.passes.iter().map(|pass| !pass.vibrates()).collect();
        job.apply_ratio(ratio, |index| still[index].then_some(0.0));
        job
    };
    let breaks = |ratio: f64| arrives_well(&with(ratio), limits);
    let least = round_up(least_above(present, breaks)?, 2);
    (breaks(least) && forbids_nothing_more(job, &with(least), limits)).then_some(least)
}

/// The nearest spindle speed, rev/min to a tenth, at which the passes arrive well: a slower one, which the drives follow, or a faster
/// one above their resonance.
pub(super) fn spindle_speed(job: &ThreadJob, limits: &ThreadLimits) -> Option<f64> {
    let with = |rev_per_min: f64| ThreadJob { spindle_rev_per_min: rev_per_min, ..job.clone() };
    let speeds = (1..=SPEED_STEPS).flat_map(|step| {
        let share = libm::pow(SPEED_STEP, step.into());
        let slower = round_down(job.spindle_rev_per_min * share, 1);
        let faster = (step <= FASTER_STEPS).then(|| round_down(job.spindle_rev_per_min / share, 1));
        let faster = faster.filter(|speed| *speed <= limits.max_spindle_rev_per_min);
        core::iter::once(slower).chain(faster)
    });
    let mut speeds = speeds.filter(|speed| *speed > 0.0);
    speeds.find(|speed| arrives_well(&with(*speed), limits) && forbids_nothing_more(job, &with(*speed), limits))
}

/// Every vibrating pass that breaks its chip as it is commanded does so with what arrives, and none cuts too deep.
fn arrives_well(job: &ThreadJob, limits: &ThreadLimits) -> bool {
    ThreadFollowing::of(job, &limits.drives).is_some_and(|following| {
        let passes = job.passes.iter().zip(&following.passes).enumerate().filter(|(_, (pass, _))| pass.vibrates());
        passes.into_iter().all(|(index, (_, arriving))| {
            let is_broken = arriving.depth_broken || !chip(job, index, ChipLevel::Depth).broken;
            is_broken && !is_too_deep(arriving)
        })
    })
}

/// Nothing is said of a changed thread that is not said of the present one, the drives apart.
fn forbids_nothing_more(job: &ThreadJob, changed: &ThreadJob, limits: &ThreadLimits) -> bool {
    let limits = ThreadLimits { drives: ThreadDrives::default(), ..*limits };
    let said = judge_thread(job, &limits).findings;
    let is_new = |code| said.iter().all(|known| known.code != code);
    let changed = judge_thread(changed, &limits).findings;
    changed.iter().all(|finding| finding.severity == Severity::Info || !is_new(finding.code))
}

/// The least value above `present` from which on something holds.
fn least_above(present: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut most = (1..=DOUBLINGS).map(|doublings| present * f64::from(1 << doublings)).find(|value| holds(*value))?;
    let mut least = 0.5 * most;
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (least + most);
        *(if holds(middle) { &mut most } else { &mut least }) = middle;
    }
    Some(most)
}
