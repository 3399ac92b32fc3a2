//! The search: Levenberg's and Marquardt's steps from the modes of the tool library.

use super::residuals::{MOST_LAGS, Residuals};
use super::response::{Columns, deflection, forces, settling_samples};
use super::squares::Normal;
use super::{CutRecord, Estimate, LearningError, LearningModel, Learnt, LearntMode};
use crate::lobes::Mode;

/// Parameters that all records share, in this order.
const NAMES: [&str; 12] = [
    "tangential force by chip thickness",
    "tangential force of the edge",
    "radial force by chip thickness",
    "radial force of the edge",
    "run-out of the edges",
    "run-out of the edges",
    "frequency in X",
    "damping in X",
    "frequency in Y",
    "damping in Y",
    "run-out of the surface",
    "run-out of the surface",
];
const SHARED: usize = NAMES.len();
/// Of every record and direction: where the deflection counts from, and its drift over the record.
const OWN: usize = 4;

/// Places of the shared parameters.
const FORCES: usize = 0;
const EDGE_RUN_OUT: usize = 4;
const MODES: usize = 6;
const SURFACE: usize = 10;

const MAX_STEPS: u32 = 100;
/// The search ends where a whole step would lower the squares by less than this share of the variance of a sample: it would move
/// no parameter by more than a hundredth of its standard error.
const SETTLED: f64 = 1e-4;
/// Shares of a frequency that a start is looked for at: up to a quarter off.
const SCAN: [f64; 15] = [0.78, 0.81, 0.84, 0.87, 0.9, 0.93, 0.96, 1.0, 1.04, 1.08, 1.12, 1.16, 1.2, 1.24, 1.28];
/// Relative step of numeric derivatives: the cube root of the rounding.
const STEP: f64 = 6e-6;
/// How far beyond the ends of the scan a frequency may be found: half of a step.
const BEYOND_SCAN: f64 = 0.02;
/// Standard errors by which a value has to differ from 0 to count as another.
const SIGNIFICANT: f64 = 1.959_963_984_540_054;

/// What the records are held against.
struct Problem<'a> {
    model: &'a LearningModel,
    records: &'a [CutRecord<'a>],
    settling: usize,
    /// Components of the run-out of the edges: one edge has none, and two are in line with the spindle.
    edge_run_outs: usize,
}

/// Parameters: those that are shared, then those of each record.
type Parameters = Vec<f64>;

/// What takes a sample: places of parameters, its derivatives by them, and what is left of it.
type Taken<'a> = dyn FnMut(&[usize], &[f64], f64) + 'a;

/// Learns from valid records.
pub(super) fn fit(model: &LearningModel, records: &[CutRecord<'_>]) -> Result<Learnt, LearningError> {
    let problem = Problem {
        model,
        records,
        settling: settling_samples(model),
        edge_run_outs: model.edges.clamp(1, 3) as usize - 1,
    };
    let mut parameters = vec![0.0; SHARED + OWN * records.len()];
    for (place, mode) in [&model.mode_x, &model.mode_y].into_iter().enumerate() {
        parameters[MODES + 2 * place] = mode.frequency_hz;
        parameters[MODES + 2 * place + 1] = mode.damping_ratio;
    }
    // Only what the deflection is linear in, first.
    parameters = problem.scan(parameters)?;
    let mut normal = problem.normal(&parameters, &problem.all());
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        if problem.is_settled(&normal)? {
            return problem.conclude(&parameters, &normal);
        }
        let factor = normal.factor(damping).map_err(|place| problem.not_identifiable(&problem.all(), place))?;
        let mut next = parameters.clone();
        for (&place, step) in problem.all().iter().zip(normal.step(&factor)) {
            next[place] += step;
        }
        let tried = problem.is_possible(&next).then(|| problem.normal(&next, &problem.all()));
        match tried.filter(|tried| tried.squares < normal.squares) {
            Some(better) => {
                (parameters, normal) = (next, better);
                damping = (damping * 0.1_f64).max(1e-12);
            }
            None => damping *= 10.0,
        }
    }
    Err(LearningError::NoFit(MAX_STEPS))
}

impl Problem<'_> {
    /// Whether the least squares are reached.
    fn is_settled(&self, normal: &Normal) -> Result<bool, LearningError> {
        let factor = normal.factor(0.0).map_err(|place| self.not_identifiable(&self.all(), place))?;
        Ok(normal.gain(&factor) <= SETTLED * normal.squares / self.judged() as f64)
    }

    /// Parameters that are looked for.
    fn all(&self) -> Vec<usize> {
        let own = SHARED + OWN * self.records.len();
        (0..own).filter(|place| !(EDGE_RUN_OUT + self.edge_run_outs..MODES).contains(place)).collect()
    }

    /// Those in which the deflection is linear, without the run-out of the edges.
    fn linear(&self) -> Vec<usize> {
        let own = SHARED + OWN * self.records.len();
        (0..own).filter(|place| *place < EDGE_RUN_OUT || *place >= SURFACE).collect()
    }

    fn not_identifiable(&self, places: &[usize], index: usize) -> LearningError {
        let place = places.get(index).copied().unwrap_or(0);
        LearningError::NotIdentifiable(NAMES.get(place).copied().unwrap_or("zero of the deflection"))
    }

    /// Modes that can be: below the highest frequency that the samples tell, and damped less than critically.
    fn is_possible(&self, parameters: &[f64]) -> bool {
        let highest_hz = 0.5 * self.model.sample_rate_hz;
        (0..2).all(|axis| {
            let (frequency_hz, damping) = (parameters[MODES + 2 * axis], parameters[MODES + 2 * axis + 1]);
            frequency_hz > 0.0 && frequency_hz < highest_hz && damping > 0.0 && damping < 1.0
        }) && parameters.iter().all(|value| value.is_finite())
    }

    /// Frequencies near those of the library with which the linear parameters explain most, one direction after the other.
    fn scan(&self, mut parameters: Parameters) -> Result<Parameters, LearningError> {
        for axis in 0..2 {
            let place = MODES + 2 * axis;
            let library_hz = parameters[place];
            let mut best: Option<(f64, Parameters)> = None;
            for share in SCAN {
                parameters[place] = library_hz * share;
                if !self.is_possible(&parameters) {
                    continue;
                }
                let tried = self.solved(parameters.clone())?;
                if best.as_ref().is_none_or(|(squares, _)| tried.0 < *squares) {
                    best = Some(tried);
                }
            }
            parameters = best.map_or(parameters, |(_, best)| best);
        }
        Ok(parameters)
    }

    /// Linear parameters that explain most, and the squares that are left.
    fn solved(&self, mut parameters: Parameters) -> Result<(f64, Parameters), LearningError> {
        let places = self.linear();
        let normal = self.normal(&parameters, &places);
        let factor = normal.factor(0.0).map_err(|place| self.not_identifiable(&places, place))?;
        for (&place, step) in places.iter().zip(normal.step(&factor)) {
            parameters[place] += step;
        }
        // What is linear is solved by one step, and lowers the squares by as much as it says.
        Ok((normal.squares - normal.gain(&factor), parameters))
    }

    fn mode(&self, parameters: &[f64], axis: usize) -> Mode {
        let library = if axis == 0 { &self.model.mode_x } else { &self.model.mode_y };
        Mode {
            frequency_hz: parameters[MODES + 2 * axis],
            damping_ratio: parameters[MODES + 2 * axis + 1],
            stiffness_n_per_mm: library.stiffness_n_per_mm,
        }
    }

    /// The normal equations at these parameters for those of `places`.
    fn normal(&self, parameters: &[f64], places: &[usize]) -> Normal {
        let mut normal = Normal::new(places.len());
        let index: Vec<Option<usize>> =
            (0..parameters.len()).map(|place| places.iter().position(|wanted| *wanted == place)).collect();
        for number in 0..self.records.len() {
            self.rows(number, parameters, &mut |row_places, row, left| {
                let mut kept = [0; SHARED + OWN];
                let mut values = [0.0; SHARED + OWN];
                let mut count = 0;
                for (&place, &value) in row_places.iter().zip(row) {
                    if let Some(place) = index[place] {
                        (kept[count], values[count]) = (place, value);
                        count += 1;
                    }
                }
                normal.add(&kept[..count], &values[..count], left);
            });
        }
        normal
    }

    /// Every sample of a record that is judged: its derivatives by parameters, and what is left of it.
    fn rows(&self, number: usize, parameters: &[f64], take: &mut Taken<'_>) {
        let (model, cut) = (self.model, &self.records[number]);
        let rate_hz = model.sample_rate_hz;
        let columns: Columns = forces(
            model,
            cut,
            std::array::from_fn(|part| parameters[FORCES + part]),
            [parameters[EDGE_RUN_OUT], parameters[EDGE_RUN_OUT + 1]],
        );
        let samples = cut.spindle_angle_deg.len();
        for (axis, measured) in [cut.deflection_mm.x, cut.deflection_mm.y].into_iter().enumerate() {
            let mode = self.mode(parameters, axis);
            let parts: Vec<Vec<f64>> = columns.iter().map(|column| deflection(&mode, rate_hz, &column[axis])).collect();
            let force: Vec<f64> = (0..samples)
                .map(|place| (0..4).map(|part| parameters[FORCES + part] * columns[part][axis][place]).sum())
                .collect();
            let [by_frequency, by_damping] = by_mode(mode, rate_hz, &force);
            let is_missing = missing_of(cut);
            let own = SHARED + OWN * number + 2 * axis;
            let places = [
                FORCES,
                FORCES + 1,
                FORCES + 2,
                FORCES + 3,
                EDGE_RUN_OUT,
                EDGE_RUN_OUT + 1,
                MODES + 2 * axis,
                MODES + 2 * axis + 1,
                SURFACE,
                SURFACE + 1,
                own,
                own + 1,
            ];
            for place in (self.settling..samples).filter(|place| !is_missing[*place]) {
                let (sin, cos) = libm::sincos(cut.spindle_angle_deg[place].to_radians());
                let surface = if axis == 0 { [cos, -sin] } else { [-sin, -cos] };
                let share = place as f64 / samples as f64 - 0.5;
                let mut predicted = parameters[own] + parameters[own + 1] * share;
                for part in 0..4 {
                    predicted += parameters[FORCES + part] * parts[part][place];
                }
                predicted += parameters[SURFACE] * surface[0] + parameters[SURFACE + 1] * surface[1];
                let [k_tc, k_te, k_rc, k_re, cosine, sine] = std::array::from_fn(|part| parts[part][place]);
                let by_mode = [by_frequency[place], by_damping[place]];
                let row =
                    [k_tc, k_te, k_rc, k_re, cosine, sine, by_mode[0], by_mode[1], surface[0], surface[1], 1.0, share];
                take(&places, &row, measured[place] - predicted);
            }
        }
    }

    /// By how much correlated residuals widen the standard errors, over a turn of the spindle or from turn to turn.
    fn correlation_factor(&self, parameters: &[f64]) -> f64 {
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

    /// Residuals that are judged, of both directions.
    fn judged(&self) -> usize {
        let missing =
            |cut: &CutRecord<'_>| cut.missing.iter().filter(|place| **place as usize >= self.settling).count();
        self.records.iter().map(|cut| 2 * (cut.spindle_angle_deg.len() - self.settling - missing(cut))).sum()
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

    fn conclude(&self, parameters: &[f64], normal: &Normal) -> Result<Learnt, LearningError> {
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

/// Samples of a turn of the spindle.
fn samples_of_turn(cut: &CutRecord<'_>) -> usize {
    let samples = cut.spindle_angle_deg.len();
    let turned_deg = cut.spindle_angle_deg[samples - 1] - cut.spindle_angle_deg[0];
    (360.0 * samples as f64 / turned_deg.abs()).min(MOST_LAGS as f64) as usize
}

/// Which samples of a record are missing.
fn missing_of(cut: &CutRecord<'_>) -> Vec<bool> {
    let mut is_missing = vec![false; cut.spindle_angle_deg.len()];
    for place in cut.missing {
        is_missing[*place as usize] = true;
    }
    is_missing
}

/// How the deflection under a force changes with the mode's frequency and with its damping, by central differences.
fn by_mode(mode: Mode, rate_hz: f64, force: &[f64]) -> [Vec<f64>; 2] {
    let by = |change: &dyn Fn(&mut Mode, f64), value: f64| -> Vec<f64> {
        let [ahead, behind] = [STEP, -STEP].map(|step| {
            let mut moved = mode;
            change(&mut moved, value * (1.0 + step));
            deflection(&moved, rate_hz, force)
        });
        ahead.iter().zip(&behind).map(|(ahead, behind)| (ahead - behind) / (2.0 * STEP * value)).collect()
    };
    [
        by(&|mode, value| mode.frequency_hz = value, mode.frequency_hz),
        by(&|mode, value| mode.damping_ratio = value, mode.damping_ratio),
    ]
}
