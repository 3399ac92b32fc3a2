//! What the least squares say, and what they do not.

use super::fit::{EDGE_RUN_OUT, FORCES, Least, MODES, NAMES, Problem, SCAN, SURFACE, samples_of_turn};
use super::residuals::Residuals;
use super::{Estimate, LearningError, Learnt, LearntMode};

/// Standard error of a damping ratio, as a share of it, from which on its mode may be another one.
const WEAK: f64 = 0.04;
/// Variances of a sample by which squares may differ that explain as much: 99 % of χ² of one degree of freedom.
const AS_MUCH: f64 = 6.6;
/// How far beyond the ends of the scan a frequency may be found: half of a step.
const BEYOND_SCAN: f64 = 0.02;
/// Standard errors by which a value has to differ from 0 to count as another.
const SIGNIFICANT: f64 = 1.959_963_984_540_054;

impl Problem<'_> {
    /// What the least squares that were found say, if no other mode explains as much.
    ///
    /// A mode that answers the forces so little that its damping is uncertain may be found at other frequencies as well: the one that explains most
    /// counts, and where another one explains as much, none does.
    pub(super) fn judge(&self, short: &Problem<'_>, mut found: Least) -> Result<Learnt, LearningError> {
        let mut learnt = self.conclude(&found)?;
        for axis in 0..2 {
            let mode = if axis == 0 { learnt.mode_x } else { learnt.mode_y };
            if mode.damping_ratio.standard_error < WEAK * mode.damping_ratio.value {
                continue;
            }
            let starts = short.starts_at_other_frequencies(&found.parameters, axis);
            let mut others = Vec::new();
            for other in starts.into_iter().filter_map(|start| self.descend_anew(start).ok()) {
                let (lesser, more) =
                    if other.normal.squares < found.normal.squares { (other, found) } else { (found, other) };
                found = lesser;
                others.push(more);
            }
            learnt = self.conclude(&found)?;
            let told = if axis == 0 { learnt.mode_x } else { learnt.mode_y }.frequency_hz;
            let error_mm = learnt.residual_mm * learnt.correlation_factor;
            let explains_as_much = |other: &Least| {
                let is_beyond = !(told.lower..=told.upper).contains(&other.parameters[MODES + 2 * axis]);
                is_beyond && other.normal.squares - found.normal.squares < AS_MUCH * error_mm * error_mm
            };
            if others.iter().any(explains_as_much) {
                return Err(LearningError::NotIdentifiable(NAMES[MODES + 2 * axis]));
            }
        }
        Ok(learnt)
    }

    /// By how much correlated residuals widen the standard errors, over a turn of the spindle or from turn to turn.
    pub(super) fn correlation_factor(&self, parameters: &[f64]) -> f64 {
        let mut residuals = Residuals::new(self.records.iter().map(samples_of_turn).max().unwrap_or(0));
        for (number, cut) in self.records.iter().enumerate() {
            let samples = cut.spindle_angle_deg.len();
            let mut axes: [Vec<(f64, f64)>; 2] = [Vec::new(), Vec::new()];
            self.rows(number, parameters, &mut |places, row, left| {
                // The last derivative is the place in the record.
                let place = ((row[row.len() - 1] + 0.5) * samples as f64).round() as usize;
                axes[usize::from(places[6] != MODES)].push((cut.spindle_angle_deg[place] / 360.0, left));
            });
            axes.iter().for_each(|axis| residuals.add(axis, samples_of_turn(cut)));
        }
        residuals.factor()
    }

    /// Refuses values that no tool and no material has: they explain the records, but mean something else.
    fn check(&self, learnt: &Learnt) -> Result<(), LearningError> {
        let implausible = |what, estimate: &Estimate, least, most| {
            Err(LearningError::Implausible { what, value: estimate.value, least, most })
        };
        let tangential = &learnt.tangential_n_per_mm2;
        if tangential.value <= SIGNIFICANT * tangential.standard_error {
            return implausible(NAMES[FORCES], tangential, 0.0, f64::INFINITY);
        }
        let others = [&learnt.edge_tangential_n_per_mm, &learnt.radial_n_per_mm2, &learnt.edge_radial_n_per_mm];
        for (place, estimate) in others.into_iter().enumerate() {
            if estimate.upper < 0.0 {
                return implausible(NAMES[FORCES + 1 + place], estimate, 0.0, f64::INFINITY);
            }
        }
        let modes = [(&learnt.mode_x, &self.model.mode_x), (&learnt.mode_y, &self.model.mode_y)];
        for (axis, (mode, library)) in modes.into_iter().enumerate() {
            let least = library.frequency_hz * (SCAN[0] - BEYOND_SCAN);
            let most = library.frequency_hz * (SCAN[SCAN.len() - 1] + BEYOND_SCAN);
            if !(least..=most).contains(&mode.frequency_hz.value) {
                return implausible(NAMES[MODES + 2 * axis], &mode.frequency_hz, least, most);
            }
        }
        Ok(())
    }

    fn conclude(&self, Least { parameters, normal }: &Least) -> Result<Learnt, LearningError> {
        let places = self.all();
        let factor = normal.factor(0.0).map_err(|place| self.not_identifiable(&places, place))?;
        let free = (self.judged() - places.len()) as f64;
        let correlation_factor = self.correlation_factor(parameters);
        let variance = normal.squares / free;
        let scale = variance * correlation_factor * correlation_factor;
        let index = |place: usize| places.iter().position(|wanted| *wanted == place);
        let covariance = |place: usize, other: usize| -> f64 {
            let (Some(place), Some(other)) = (index(place), index(other)) else { return 0.0 };
            scale * factor.inverse_column(place)[other]
        };
        let of = |place: usize| Estimate::of_value(parameters[place], covariance(place, place).max(0.0).sqrt());
        let length = |first: usize| {
            let [a, b] = [parameters[first], parameters[first + 1]];
            let [aa, ab, bb] =
                [[first, first], [first, first + 1], [first + 1, first + 1]].map(|[one, other]| covariance(one, other));
            Estimate::of_length([a, b], [aa, ab, bb])
        };
        let mode =
            |axis: usize| LearntMode { frequency_hz: of(MODES + 2 * axis), damping_ratio: of(MODES + 2 * axis + 1) };
        let learnt = Learnt {
            tangential_n_per_mm2: of(FORCES),
            edge_tangential_n_per_mm: of(FORCES + 1),
            radial_n_per_mm2: of(FORCES + 2),
            edge_radial_n_per_mm: of(FORCES + 3),
            edge_run_out_mm: (self.edge_run_outs > 0).then(|| length(EDGE_RUN_OUT)),
            run_out_mm: length(SURFACE),
            mode_x: mode(0),
            mode_y: mode(1),
            residual_mm: variance.sqrt(),
            correlation_factor,
            samples: self.judged(),
        };
        self.check(&learnt)?;
        Ok(learnt)
    }
}
