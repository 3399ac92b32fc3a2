//! Forces of the edges by what they are linear in.

use std::f64::consts::{PI, TAU};

use super::chips::{Chip, chips, within_a_turn};
use super::response::{GAUSS, Moments, legendre};
use super::{CutRecord, LearningModel};

/// Forces on the tool in the axes of the sensors between two samples, N over the unit of each coefficient: of K_tc, K_te, K_rc and K_re, and of
/// both components of the run-out of the edges.
pub(super) type Columns = [[Moments; 2]; 6];

/// Least share of the mean turn between two samples that is between any: an encoder may say the same twice.
const LEAST_TURN: f64 = 0.1;

/// Forces in a record.
pub(super) struct Forces<'a> {
    cut: &'a CutRecord<'a>,
    /// K_tc, K_te, K_rc and K_re.
    coefficients: [f64; 4],
    /// 1 forwards, −1 backwards.
    rotation: f64,
    /// Mean turn between two samples.
    step_rad: f64,
    /// Unit vectors along and across the feed.
    frame: [[f64; 2]; 2],
    /// How far behind the first edge each is, rad, and its chips.
    edges: Vec<(f64, Vec<Chip>)>,
}

impl<'a> Forces<'a> {
    /// With these specific forces (K_tc, K_te, K_rc, K_re) and this run-out of the edges, mm as cosine and sine over the edges.
    pub(super) fn new(
        model: &LearningModel,
        cut: &'a CutRecord<'a>,
        coefficients: [f64; 4],
        run_out_mm: [f64; 2],
    ) -> Self {
        let samples = cut.spindle_angle_deg.len();
        let turned_deg = cut.spindle_angle_deg[samples - 1] - cut.spindle_angle_deg[0];
        let rotation = if turned_deg < 0.0 { -1.0 } else { 1.0 };
        let step_rad = (turned_deg / (samples - 1) as f64).abs().to_radians();
        let rev_per_min = step_rad / TAU * model.sample_rate_hz * 60.0;
        let per_edge_mm = cut.feed_mm_per_min / (f64::from(model.edges) * rev_per_min);
        let [x, y] = cut.feed_direction;
        let arc = [model.entry_rad, model.exit_rad];
        let of_edge = |edge: u32| {
            let behind_rad = TAU / f64::from(model.edges) * f64::from(edge);
            (behind_rad, chips(edge, model.edges, per_edge_mm, run_out_mm, arc))
        };
        Self {
            cut,
            coefficients,
            rotation,
            step_rad,
            frame: [[x, y], [-y * rotation, x * rotation]],
            edges: (0..model.edges).map(of_edge).collect(),
        }
    }

    /// Between a sample and the next one.
    pub(super) fn between(&self, place: usize) -> Columns {
        let angle_rad =
            |place: usize| self.rotation * (self.cut.spindle_angle_deg[place] - self.cut.first_edge_deg).to_radians();
        let (here, next) = (angle_rad(place), angle_rad(place + 1));
        let half_rad = 0.5 * (next - here).max(LEAST_TURN * self.step_rad);
        let mut columns = Columns::default();
        for (behind_rad, chips) in &self.edges {
            // Between two samples that are more than half a turn apart, the arc may be passed more than once.
            let ahead_rad = TAU * (half_rad / PI).floor();
            let mut middle_rad = within_a_turn(0.5 * (here + next) - behind_rad) + ahead_rad;
            while middle_rad + half_rad > 0.0 {
                for chip in chips {
                    if middle_rad - half_rad < chip.to_rad && middle_rad + half_rad > chip.from_rad {
                        self.add(chip, middle_rad, half_rad, &mut columns);
                    }
                }
                middle_rad -= TAU;
            }
        }
        columns
    }

    /// Adds the force of a chip while an edge turns from so much before an angle to so much behind it.
    fn add(&self, chip: &Chip, middle_rad: f64, half_rad: f64, columns: &mut Columns) {
        let [tangential, edge_tangential, radial, edge_radial] = self.coefficients;
        let from_rad = chip.from_rad.max(middle_rad - half_rad);
        let to_rad = chip.to_rad.min(middle_rad + half_rad);
        let share = (to_rad - from_rad) / (2.0 * half_rad);
        for (place, weight) in GAUSS {
            let angle_rad = 0.5 * (from_rad + to_rad + place * (to_rad - from_rad));
            let (thickness, [along, outwards]) = self.at(angle_rad);
            let chip_mm = chip.feed_mm * thickness + chip.extra_mm;
            let by_chip = [0, 1].map(|axis| tangential * along[axis] + radial * outwards[axis]);
            let parts = [
                along.map(|force| force * chip_mm),
                along,
                outwards.map(|force| force * chip_mm),
                outwards,
                by_chip.map(|force| force * chip.extra[0]),
                by_chip.map(|force| force * chip.extra[1]),
            ];
            add(columns, parts, (angle_rad - middle_rad) / half_rad, share * weight);
        }
        // Where a thicker chip begins sooner or ends later, the edge adds its force there.
        for (angle_rad, moves) in [(chip.from_rad, chip.sooner), (chip.to_rad, chip.later)] {
            let place = (angle_rad - middle_rad) / half_rad;
            if moves > 0.0 && (-1.0..1.0).contains(&place) {
                let (_, [along, outwards]) = self.at(angle_rad);
                let by_chip = [0, 1].map(|axis| edge_tangential * along[axis] + edge_radial * outwards[axis]);
                let mut parts = [[0.0; 2]; 6];
                parts[4] = by_chip.map(|force| force * chip.extra[0]);
                parts[5] = by_chip.map(|force| force * chip.extra[1]);
                add(columns, parts, place, moves / (2.0 * half_rad));
            }
        }
    }

    /// Sine of an edge's angle, and the forces of 1 N/mm against its motion and against its way outwards, in the axes of the sensors.
    fn at(&self, angle_rad: f64) -> (f64, [[f64; 2]; 2]) {
        let (sin, cos) = libm::sincos(angle_rad);
        let [along, across] = self.frame;
        let turned = |[first, second]: [f64; 2]| {
            [0, 1].map(|axis| self.cut.depth_mm * (first * along[axis] + second * across[axis]))
        };
        (sin, [turned([-cos, sin]), turned([-sin, -cos])])
    }
}

/// Adds what is there at a place in −1 to 1, for this share of the time.
fn add(columns: &mut Columns, parts: [[f64; 2]; 6], place: f64, share: f64) {
    let legendre = legendre(place);
    // Over −1 to 1 the square of a polynomial of the order n is 2/(2n + 1).
    let weights = [share, 3.0 * share * legendre[1], 5.0 * share * legendre[2], 7.0 * share * legendre[3]];
    for (column, part) in columns.iter_mut().zip(parts) {
        for (moments, value) in column.iter_mut().zip(part) {
            for (moment, weight) in moments.iter_mut().zip(weights) {
                *moment += value * weight;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Pair;
    use crate::learning::response::{Response, State};
    use crate::lobes::Mode;

    const COEFFICIENTS: [f64; 4] = [1_850.0, 22.0, 650.0, 31.0];
    const SAMPLES: usize = 400;
    const DEGREES: f64 = 11.3;

    fn model(arc_deg: [f64; 2]) -> LearningModel {
        let mode = Mode { frequency_hz: 950.0, damping_ratio: 0.03, stiffness_n_per_mm: 12_000.0 };
        let [entry_rad, exit_rad] = arc_deg.map(f64::to_radians);
        LearningModel { sample_rate_hz: 6_000.0, edges: 3, entry_rad, exit_rad, mode_x: mode, mode_y: mode }
    }

    fn cut(angles_deg: &[f64]) -> CutRecord<'_> {
        CutRecord {
            deflection_mm: Pair { x: angles_deg, y: angles_deg },
            spindle_angle_deg: angles_deg,
            feed_mm_per_min: 0.06 * 3.0 * DEGREES * 6_000.0 / 6.0,
            depth_mm: 1.5,
            feed_direction: [0.6, 0.8],
            first_edge_deg: 17.0,
            missing: &[],
        }
    }

    /// Deflection in X at every sample, and how it changes with both components of the run-out.
    fn deflection(model: &LearningModel, cut: &CutRecord<'_>, run_out_mm: [f64; 2]) -> [Vec<f64>; 3] {
        let forces = Forces::new(model, cut, COEFFICIENTS, run_out_mm);
        let response = Response::new(&model.mode_x, model.sample_rate_hz);
        let mut states = [State::default(); 6];
        let mut all = [const { Vec::new() }; 3];
        for place in 0..cut.spindle_angle_deg.len() {
            let of_part = |part: usize| COEFFICIENTS[part] * states[part][0];
            all[0].push((0..4).map(of_part).sum());
            all[1].push(states[4][0]);
            all[2].push(states[5][0]);
            if place + 1 < cut.spindle_angle_deg.len() {
                let columns = forces.between(place);
                states.iter_mut().zip(columns).for_each(|(state, column)| response.advance(state, &column[0]));
            }
        }
        all
    }

    /// The mode here has six samples in a period and the spindle turns by 11° between two.
    #[test]
    fn the_deflection_between_few_samples_is_that_between_a_thousand_times_as_many() {
        const TIMES: usize = 1_000;
        let coarse: Vec<f64> = (0..SAMPLES).map(|place| DEGREES * place as f64).collect();
        let fine: Vec<f64> = (0..SAMPLES * TIMES).map(|place| DEGREES / TIMES as f64 * place as f64).collect();
        for (arc_deg, run_out_mm) in
            [([25.0, 130.0], [0.004, 0.003]), ([0.0, 180.0], [-0.012, 0.02]), ([90.0, 180.0], [0.03, -0.05])]
        {
            let model = model(arc_deg);
            let finely = LearningModel { sample_rate_hz: model.sample_rate_hz * TIMES as f64, ..model };
            let [found, _, _] = deflection(&model, &cut(&coarse), run_out_mm);
            let [expected, _, _] = deflection(&finely, &cut(&fine), run_out_mm);
            let largest = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            for (found, expected) in found.iter().zip(expected.iter().step_by(TIMES)) {
                assert!((found - expected).abs() < 1e-4 * largest, "{arc_deg:?}: {found} {expected} of {largest}");
            }
        }
    }

    #[test]
    fn the_deflection_changes_with_the_run_out_as_it_says() {
        const MORE_MM: f64 = 1e-7;
        let angles_deg: Vec<f64> = (0..SAMPLES).map(|place| DEGREES * place as f64).collect();
        let cut = cut(&angles_deg);
        for (arc_deg, [a, b]) in
            [([25.0, 130.0], [0.004, 0.003]), ([0.0, 180.0], [-0.012, 0.02]), ([90.0, 180.0], [0.03, -0.05])]
        {
            let model = model(arc_deg);
            let [_, first, second] = deflection(&model, &cut, [a, b]);
            for (by, more) in [(first, [MORE_MM, 0.0]), (second, [0.0, MORE_MM])] {
                let [ahead, _, _] = deflection(&model, &cut, [a + more[0], b + more[1]]);
                let [behind, _, _] = deflection(&model, &cut, [a - more[0], b - more[1]]);
                let largest = by.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                for ((ahead, behind), by) in ahead.iter().zip(&behind).zip(&by) {
                    let expected = (ahead - behind) / (2.0 * MORE_MM);
                    assert!((by - expected).abs() < 1e-3 * largest, "{arc_deg:?}: {by} {expected} of {largest}");
                }
            }
        }
    }
}
