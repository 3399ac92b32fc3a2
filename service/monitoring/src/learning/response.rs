//! Forces of the edges by what they are linear in, and what a mode makes of them.

use std::f64::consts::TAU;

use super::{CutRecord, LearningModel};
use crate::lobes::Mode;

/// Time constants of a mode after which what was before is forgotten to 1e-5.
const SETTLING_TIME_CONSTANTS: f64 = 12.0;

/// Forces on the tool in the axes of the sensors, sample by sample, N over the unit of each coefficient: of K_tc, K_te, K_rc and
/// K_re, and of both components of the run-out of the edges.
pub(super) type Columns = [[Vec<f64>; 2]; 6];

/// Samples at the begin of a record after which the modes have forgotten how they began: they are not judged.
#[must_use]
pub fn settling_samples(model: &LearningModel) -> usize {
    let slowest = [&model.mode_x, &model.mode_y]
        .into_iter()
        .map(|mode| mode.damping_ratio * mode.frequency_hz)
        .fold(f64::INFINITY, f64::min);
    (SETTLING_TIME_CONSTANTS * model.sample_rate_hz / (TAU * slowest)).ceil() as usize
}

/// Forces with these specific forces (K_tc, K_te, K_rc, K_re) and this run-out of the edges, mm as cosine and sine over the edges.
///
/// Where a chip begins or ends within a sample, its force is the mean over the sample: so it changes with the run-out without
/// steps.
pub(super) fn forces(
    model: &LearningModel,
    cut: &CutRecord<'_>,
    [tangential, edge_tangential, radial, edge_radial]: [f64; 4],
    run_out_mm: [f64; 2],
) -> Columns {
    let samples = cut.spindle_angle_deg.len();
    let mut columns: Columns = std::array::from_fn(|_| [vec![0.0; samples], vec![0.0; samples]]);
    let turned_deg = cut.spindle_angle_deg[samples - 1] - cut.spindle_angle_deg[0];
    let rotation = if turned_deg < 0.0 { -1.0 } else { 1.0 };
    let rate = model.sample_rate_hz / (samples - 1) as f64;
    let rev_per_min = turned_deg.abs() / 360.0 * rate * 60.0;
    let per_edge_mm = cut.feed_mm_per_min / (f64::from(model.edges) * rev_per_min);
    let step_rad = (turned_deg / (samples - 1) as f64).abs().to_radians();
    let pitch = TAU / f64::from(model.edges);
    let [x, y] = cut.feed_direction;
    let frame = [[x, y], [-y * rotation, x * rotation]];
    let (entry, exit) = (libm::sincos(model.entry_rad), libm::sincos(model.exit_rad));
    for edge in 0..model.edges {
        let (sine, cosine) = libm::sincos(-pitch * f64::from(edge));
        // What a run-out of cos and of sin over the edges adds to the chip of this one.
        let [here, before] =
            [edge, (edge + model.edges - 1) % model.edges].map(|it| libm::sincos(pitch * f64::from(it)));
        let extra = [here.1 - before.1, here.0 - before.0];
        let extra_mm = extra[0] * run_out_mm[0] + extra[1] * run_out_mm[1];
        for (place, angle_deg) in cut.spindle_angle_deg.iter().enumerate() {
            let (sin, cos) = libm::sincos(rotation * (angle_deg - cut.first_edge_deg).to_radians());
            let (sin, cos) = (sin * cosine + cos * sine, cos * cosine - sin * sine);
            let entered = sin * entry.1 - cos * entry.0 >= 0.0;
            let leaving = exit.0 * cos - exit.1 * sin >= 0.0;
            if !(entered && leaving) {
                continue;
            }
            let change_mm = (per_edge_mm * cos * step_rad).abs().max(f64::MIN_POSITIVE);
            let Some(Chip { mean_mm, share, by_mm }) = Chip::within(per_edge_mm * sin + extra_mm, change_mm) else {
                continue;
            };
            let [along, outwards] = [[-cos, sin], [-sin, -cos]].map(|axis| axis.map(|part| cut.depth_mm * part));
            let by_chip = [0, 1].map(|it| {
                (tangential * share + edge_tangential * by_mm) * along[it]
                    + (radial * share + edge_radial * by_mm) * outwards[it]
            });
            let parts = [
                along.map(|force| force * mean_mm),
                along.map(|force| force * share),
                outwards.map(|force| force * mean_mm),
                outwards.map(|force| force * share),
                by_chip.map(|force| force * extra[0]),
                by_chip.map(|force| force * extra[1]),
            ];
            for (column, [first, second]) in columns.iter_mut().zip(parts) {
                for (axis, column) in column.iter_mut().enumerate() {
                    column[place] += first * frame[0][axis] + second * frame[1][axis];
                }
            }
        }
    }
    columns
}

/// A chip over one sample.
struct Chip {
    /// Mean thickness, mm; nothing counts as 0.
    mean_mm: f64,
    /// Share of the sample in which there is one.
    share: f64,
    /// By how much that share changes with the thickness, 1/mm.
    by_mm: f64,
}

impl Chip {
    /// Of this thickness in the middle of the sample, over which it changes by `change_mm`; `None` where there is none.
    fn within(middle_mm: f64, change_mm: f64) -> Option<Self> {
        let half_mm = 0.5 * change_mm;
        if middle_mm >= half_mm {
            return Some(Self { mean_mm: middle_mm, share: 1.0, by_mm: 0.0 });
        }
        (middle_mm > -half_mm).then(|| {
            let share = middle_mm / change_mm + 0.5;
            Self { mean_mm: 0.5 * share * share * change_mm, share, by_mm: 1.0 / change_mm }
        })
    }
}

/// Deflection of a mode at rest under a force that is constant over every sample, mm: the transition of (x − F/k, ẋ) in closed
/// form.
pub(super) fn deflection(mode: &Mode, sample_rate_hz: f64, force_n: &[f64]) -> Vec<f64> {
    let sample_s = 1.0 / sample_rate_hz;
    let omega = TAU * mode.frequency_hz;
    let decay = mode.damping_ratio * omega;
    let damped = omega * (1.0 - mode.damping_ratio * mode.damping_ratio).sqrt();
    let scale = libm::exp(-decay * sample_s);
    let sine = scale * libm::sin(damped * sample_s) / damped;
    let cosine = scale * libm::cos(damped * sample_s);
    let transition = [[cosine + decay * sine, sine], [-omega * omega * sine, cosine - decay * sine]];
    let (mut at_mm, mut speed) = (0.0, 0.0);
    force_n
        .iter()
        .map(|force_n| {
            let here_mm = at_mm;
            let still_mm = force_n / mode.stiffness_n_per_mm;
            let offset_mm = at_mm - still_mm;
            at_mm = still_mm + transition[0][0] * offset_mm + transition[0][1] * speed;
            speed = transition[1][0] * offset_mm + transition[1][1] * speed;
            here_mm
        })
        .collect()
}
