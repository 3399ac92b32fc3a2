//! Whether the chip of a pass is cut through, and what of amplitude, phase and section is to blame where it is not.

use feedwave_program::{Finding, FindingLog};

use super::{SAME_ANGLE_DEG, SAME_LENGTH_MM, demand, number};
use crate::functions::thread::chip::chip;
use crate::functions::thread::report::ThreadPassReport;
use crate::functions::thread::{
    ChipLevel, LeadAxis, ThreadJob, ThreadLimits, ThreadPass, ThreadReport, code, reduce_deg,
};
use crate::shared::wording::{decimal, round_up};

/// Whether the chip of a vibrating pass is cut through, and if not, why.
pub(super) fn broken(
    job: &ThreadJob,
    limits: &ThreadLimits,
    report: &ThreadReport,
    index: usize,
    findings: &mut FindingLog,
) {
    let (pass, own) = (&job.passes[index], &report.passes[index]);
    let before = job.passes[..index].iter().rposition(|before| before.start == pass.start);
    if own.amplitude_mm <= own.infeed_mm + SAME_LENGTH_MM {
        amplitude_small(job, limits, own, index, before, findings);
    } else if !own.depth.broken
        && let Some(before) = before
    {
        phase_unbroken(job, limits, report, index, before, findings);
    } else if own.depth.broken && !own.section.broken {
        ribbon(job, limits, report, index, findings);
    }
}

/// The worst pass is the one that lacks most of its amplitude.
fn with_amplitude(finding: Finding, number: u64, own: &ThreadPassReport, least_mm: f64) -> Finding {
    finding
        .at("pass", number)
        .ranked("", least_mm - own.amplitude_mm)
        .with_value("infeed", own.infeed_mm, "mm")
        .with_value("amplitude", own.amplitude_mm, "mm")
}

/// The smallest amplitude that can be written and breaks the chip.
struct LeastAmplitude {
    mm: f64,
    /// What forbids it: then it is no cure.
    objection: Option<String>,
}

impl LeastAmplitude {
    fn of(job: &ThreadJob, limits: &ThreadLimits, index: usize, least_mm: f64) -> Self {
        let mm = round_up(least_mm + 1e-6, 4);
        Self { mm, objection: demand::objection(job, limits, index, mm) }
    }

    /// What the message adds where it is no cure.
    fn no_cure(&self) -> String {
        let objection = self.objection.as_ref();
        objection.map_or_else(String::new, |why| format!("; {} mm would be no cure: {why}", decimal(self.mm, 4)))
    }

    /// Suggests it, for the place of the pass' word where the finding is there.
    fn suggest(&self, finding: Finding, job: &ThreadJob, pass: &ThreadPass) -> Finding {
        if self.objection.is_some() {
            return finding;
        }
        let text = pass.amplitude_text(self.mm, job.geometry.lead_axis.across_words());
        let word = pass.amplitude_replacement(self.mm).filter(|_| finding.span == pass.amplitude_span());
        let cure = pass.cure_by_word(format!("vibrate with at least {text}"));
        finding.suggest_value(cure, word, "amplitude", self.mm, "mm")
    }
}

/// The ratio that breaks the section of every pass, where it decides all amplitudes and no axis forbids one of them.
fn ratio_for_all(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport) -> Option<f64> {
    let ratio = round_up(report.least_section_ratio?, 2);
    let has_own = |pass: &ThreadPass| pass.amplitude_word.is_some_and(|word| word.span.is_some());
    let possible = |index: usize| {
        let pass = &job.passes[index];
        let amplitude_mm = ratio * job.infeed_mm(index);
        !pass.vibrates() || (!has_own(pass) && demand::objection(job, limits, index, amplitude_mm).is_none())
    };
    (0..job.passes.len()).all(possible).then_some(ratio)
}

/// The vibration does not reach beyond what the pass cuts.
fn amplitude_small(
    job: &ThreadJob,
    limits: &ThreadLimits,
    own: &ThreadPassReport,
    index: usize,
    before: Option<usize>,
    findings: &mut FindingLog,
) {
    let (pass, number, lead_axis) = (&job.passes[index], number(index), job.geometry.lead_axis);
    let (code, what) = match before {
        None if lead_axis == LeadAxis::Z => (code::THREAD_FIRST_PASS, "does not leave the work diameter"),
        None => (code::THREAD_FIRST_PASS, "does not leave the face of the work"),
        Some(_) => (code::THREAD_AMPLITUDE_SMALL, "does not reach beyond its infeed"),
    };
    let least_mm = own.depth.least_amplitude_mm.max(own.infeed_mm);
    let least = LeastAmplitude::of(job, limits, index, least_mm);
    let message = format!(
        "the vibration of pass {number} {what}: amplitude {} mm, infeed {} mm {}{}",
        decimal(own.amplitude_mm, 4),
        decimal(own.infeed_mm, 4),
        lead_axis.across_words(),
        least.no_cure()
    );
    let finding = with_amplitude(Finding::new(code, pass.amplitude_span(), message), number, own, least_mm);
    findings.push(least.suggest(finding, job, pass));
}

/// The pass vibrates too much in step with the one before.
fn phase_unbroken(
    job: &ThreadJob,
    limits: &ThreadLimits,
    report: &ThreadReport,
    index: usize,
    before: usize,
    findings: &mut FindingLog,
) {
    let (pass, own, number) = (&job.passes[index], &report.passes[index], number(index));
    let shift_before = report.passes[before].place.phase_shift_deg;
    let difference_deg = reduce_deg(own.place.phase_shift_deg - shift_before);
    // What has to be programmed to be opposite to the pass before, whatever the turns in between.
    let cure_deg = reduce_deg(pass.phase_shift_deg + 180.0 - difference_deg);
    let equal = difference_deg.min(360.0 - difference_deg) <= SAME_ANGLE_DEG;
    let code = if equal { code::THREAD_PHASE_EQUAL } else { code::THREAD_PHASE_UNBROKEN };
    let least = LeastAmplitude::of(job, limits, index, own.depth.least_amplitude_mm);
    let message = format!(
        "passes {} and {number} are {} degrees apart in phase at the same place on the work: the chip of pass \
         {number} is not cut through{}",
        before + 1,
        decimal(difference_deg, 3),
        least.no_cure()
    );
    let finding = with_amplitude(Finding::new(code, pass.span, message), number, own, own.depth.least_amplitude_mm)
        .with_value("phase_difference", difference_deg, "deg")
        .suggest_value(pass.cure_by_word(shift_cure(job, index, cure_deg)), None, "phase_shift", cure_deg, "deg");
    findings.push(least.suggest(finding, job, pass));
}

/// How a pass is shifted so that the chips of those behind it stay broken, too.
fn shift_cure(job: &ThreadJob, index: usize, cure_deg: f64) -> String {
    let pass = &job.passes[index];
    let cure = format!("shift the phase by {} degrees", decimal(cure_deg, 3));
    let mut shifted = job.clone();
    shifted.passes[index].phase_shift_deg = cure_deg;
    let is_broken = |job: &ThreadJob, index: usize| chip(job, index, ChipLevel::Depth).broken;
    let behind = |&next: &usize| job.passes[next].start == pass.start && job.passes[next].vibrates();
    let unbroken =
        (index + 1..job.passes.len()).find(behind).filter(|&next| is_broken(job, next) && !is_broken(&shifted, next));
    let Some(next) = unbroken else { return cure };
    // What all of them are shifted by changes nothing between them.
    let more_deg = reduce_deg(cure_deg - pass.phase_shift_deg);
    format!(
        "{cure}, and every pass behind it by {} degrees more than now: pass {} would not be cut through otherwise",
        decimal(more_deg, 3),
        number(next)
    )
}

/// The chip is cut through at its depth, but not over the whole section.
fn ribbon(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport, index: usize, findings: &mut FindingLog) {
    let (pass, own, number) = (&job.passes[index], &report.passes[index], number(index));
    let least_mm = own.section.least_amplitude_mm;
    let least = LeastAmplitude::of(job, limits, index, least_mm);
    let message = format!(
        "the chip of pass {number} holds together at the flank: the full section needs an amplitude of {} mm {}, not {}{}",
        decimal(round_up(least_mm, 4), 4),
        job.geometry.lead_axis.across_words(),
        decimal(own.amplitude_mm, 4),
        least.no_cure()
    );
    let finding = Finding::new(code::THREAD_CHIP_RIBBON, pass.amplitude_span(), message);
    let finding = with_amplitude(finding, number, own, least_mm).with_value("section_amplitude", least_mm, "mm");
    let finding = least.suggest(finding, job, pass);
    let finding = match ratio_for_all(job, limits, report) {
        Some(ratio) => {
            let cure = format!("use a ratio of {} for all passes", decimal(ratio, 2));
            finding.suggest_value(cure, None, "ratio", ratio, "")
        }
        None => finding,
    };
    findings.push(finding.suggest("come straight in: radial infeed leaves no ribbon"));
}
