//! What the vibration of a pass asks of the axis across its lead, and the amplitudes and speeds that the axis can follow.

use core::f64::consts::TAU;

use feedwave_program::{Finding, FindingLog};

use super::{SAME_LENGTH_MM, number};
use crate::functions::axis_load::{AxisCodes, AxisLoad};
use crate::functions::thread::report::ThreadPassReport;
use crate::functions::thread::{START_JERK, StartUp, ThreadJob, ThreadLimits, ThreadPass, code};
use crate::shared::wording::{decimal, round_down, round_up};

/// Tolerance for the rounding of computed limits, which are met exactly.
const ROUNDING: f64 = 1e-9;
const AXIS_CODES: AxisCodes =
    [code::THREAD_VIBRATION_VELOCITY, code::THREAD_VIBRATION_ACCELERATION, code::THREAD_VIBRATION_JERK];
/// Largest third difference of a step of acceleration at setpoints, as a share of the step over their period.
const STEP_OVER_PERIOD: f64 = 0.75;

/// What an amplitude asks: peaks of (A/2)·sin at D·n, and its ends.
struct Demand {
    loads: [AxisLoad; 3],
    /// Velocity of the axis that a taper asks beside the vibration, mm/s.
    taper: f64,
    /// Acceleration with which the vibration starts from rest and comes to rest, mm/s²: its whole one, (A/2)·(2πDn)².
    step: f64,
    /// Jerk of that at the setpoints: over their period T up to ¾ of the step over T, the peak of the quadratic B-spline;
    /// mm/s³.
    step_jerk: f64,
}

impl Demand {
    fn of(job: &ThreadJob, limits: &ThreadLimits, pass: &ThreadPass, amplitude_mm: f64) -> Self {
        let rad_per_s = TAU * job.frequency_hz();
        let velocity = 0.5 * amplitude_mm * rad_per_s;
        // On a taper the axis follows the lead as well.
        let taper = job.geometry.taper.abs() * job.geometry.lead_mm * job.spindle_rev_per_min / 60.0;
        // A start in the middle of the wave adds to the jerk only.
        let starts_within = job.start_up == StartUp::Preparatory && job.wave(pass).starts_within();
        let start_jerk = if starts_within { 1.0 + START_JERK } else { 1.0 };
        let step = velocity * rad_per_s;
        let demanded = [velocity + taper, step, start_jerk * step * rad_per_s];
        let limited = [
            limits.vibration_velocity_mm_per_s,
            limits.vibration_acceleration_mm_per_s2,
            limits.vibration_jerk_mm_per_s3,
        ];
        let step_jerk = if limits.period_s > 0.0 { STEP_OVER_PERIOD * step / limits.period_s } else { 0.0 };
        Self { loads: AxisLoad::of_linear(demanded, limited), taper, step, step_jerk }
    }

    /// Largest share of the amplitude with which every limit is kept; the taper takes its part of the velocity first.
    fn permitted_share(&self, jerk_limit: f64) -> f64 {
        let share = |load: &AxisLoad| {
            let beside = if load.order() > 1.0 { 0.0 } else { self.taper };
            (load.limit - beside) / (load.demanded - beside)
        };
        self.loads.iter().map(share).fold(jerk_limit / self.step_jerk, f64::min)
    }
}

/// Why the axis across the lead cannot follow an amplitude of a pass, mm; `None` where it can.
pub(super) fn objection(job: &ThreadJob, limits: &ThreadLimits, index: usize, amplitude_mm: f64) -> Option<String> {
    let demand = Demand::of(job, limits, &job.passes[index], amplitude_mm);
    let letter = job.geometry.lead_axis.across().letter();
    let would = |what: &str, demanded: f64, limit: f64, unit: &str| {
        format!(
            "the {letter} axis' {what} would have to be {} of the permitted {} {unit}",
            decimal(demanded, 1),
            decimal(limit, 1)
        )
    };
    if let Some(load) = demand.loads.iter().find(|load| load.exceeds(ROUNDING)) {
        return Some(would(&load.quantity.to_string(), load.demanded, load.limit, load.unit()));
    }
    let limit = limits.vibration_jerk_mm_per_s3;
    (demand.step_jerk > limit * (1.0 + ROUNDING))
        .then(|| would("jerk where the vibration starts and ends", demand.step_jerk, limit, "mm/s³"))
}

/// The limits of the axis across the lead.
pub(super) fn demand(
    job: &ThreadJob,
    limits: &ThreadLimits,
    index: usize,
    own: &ThreadPassReport,
    findings: &mut FindingLog,
) {
    let pass = &job.passes[index];
    let demand = Demand::of(job, limits, pass, pass.amplitude_mm);
    let permitted = Permitted::of(&demand, limits, own);
    let letter = job.geometry.lead_axis.across().letter();
    for load in demand.loads.into_iter().filter(|load| load.exceeds(ROUNDING)) {
        let AxisLoad { quantity, demanded, limit, .. } = load;
        let message = format!(
            "the vibration of pass {} takes {} {} of {letter}' {quantity}, whose limit is {}{}",
            number(index),
            decimal(demanded, 1),
            load.unit(),
            decimal(limit, 1),
            permitted.no_cure()
        );
        let finding = Finding::new(load.code(&AXIS_CODES), pass.amplitude_span(), message).at("pass", number(index));
        let finding = permitted.suggest(load.with_numbers(finding, ""), job, pass);
        findings.push(slower(finding, job, libm::pow(limit / demanded, 1.0 / load.order())));
    }
    step(job, limits, index, &demand, &permitted, findings);
}

/// The ends of the vibration.
fn step(
    job: &ThreadJob,
    limits: &ThreadLimits,
    index: usize,
    demand: &Demand,
    permitted: &Permitted,
    findings: &mut FindingLog,
) {
    let (pass, jerk, limit) = (&job.passes[index], demand.step_jerk, limits.vibration_jerk_mm_per_s3);
    if jerk <= limit * (1.0 + ROUNDING) {
        return;
    }
    let message = format!(
        "the vibration of pass {} starts or ends with its whole acceleration of {} mm/s²: at this period a jerk of up to {} \
         mm/s³ of {}, whose limit is {}{}",
        number(index),
        decimal(demand.step, 1),
        decimal(jerk, 0),
        job.geometry.lead_axis.across().letter(),
        decimal(limit, 0),
        permitted.no_cure()
    );
    let finding = Finding::new(code::THREAD_VIBRATION_STEP, pass.amplitude_span(), message)
        .at("pass", number(index))
        .ranked("", jerk / limit)
        .with_value("step", demand.step, "mm/s²")
        .with_value("jerk", jerk, "mm/s³")
        .with_value("limit", limit, "mm/s³");
    findings.push(slower(permitted.suggest(finding, job, pass), job, libm::sqrt(limit / jerk)));
}

fn slower(finding: Finding, job: &ThreadJob, share: f64) -> Finding {
    let speed = round_down(job.spindle_rev_per_min * share, 1);
    let cure = format!("turn at {} rev/min at most", decimal(speed, 1));
    finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min")
}

/// The largest amplitude that can be written and keeps every limit of the axis.
struct Permitted {
    /// 0 where none does, as on a steep taper.
    mm: f64,
    /// What the chip needs, where it breaks now and would not with that amplitude: then it is no cure.
    needed_mm: Option<f64>,
}

impl Permitted {
    fn of(demand: &Demand, limits: &ThreadLimits, own: &ThreadPassReport) -> Self {
        let share = demand.permitted_share(limits.vibration_jerk_mm_per_s3);
        let mm = round_down(own.amplitude_mm * share, 4).max(0.0);
        let needed = |is_so: bool, least_mm: f64| if is_so { least_mm } else { 0.0 };
        let needed_mm = needed(own.depth.broken, own.depth.least_amplitude_mm)
            .max(needed(own.section.broken, own.section.least_amplitude_mm))
            .max(needed(own.amplitude_mm > own.infeed_mm + SAME_LENGTH_MM, own.infeed_mm));
        Self { mm, needed_mm: (mm > 0.0 && mm <= needed_mm + SAME_LENGTH_MM).then_some(needed_mm) }
    }

    /// What the message adds where it is no cure.
    fn no_cure(&self) -> String {
        self.needed_mm.map_or_else(String::new, |needed_mm| {
            let (mm, needed_mm) = (decimal(self.mm, 4), decimal(round_up(needed_mm, 4), 4));
            format!("; with {mm} mm, which the axis can follow, the chip would not break: it needs {needed_mm} mm")
        })
    }

    fn suggest(&self, finding: Finding, job: &ThreadJob, pass: &ThreadPass) -> Finding {
        if self.needed_mm.is_some() || self.mm <= 0.0 {
            return finding;
        }
        let across = job.geometry.lead_axis.across_words();
        let cure = format!("the axis can follow {}", pass.amplitude_text(self.mm, across));
        let word = pass.amplitude_replacement(self.mm);
        finding.suggest_value(pass.cure_by_word(cure), word, "amplitude", self.mm, "mm")
    }
}
