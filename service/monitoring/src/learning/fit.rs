//! The search: Levenberg's and Marquardt's steps from the modes of the tool library.

use super::forces::Forces;
use super::residuals::MOST_LAGS;
use super::response::{Moments, Response, State, settling_samples};
use super::squares::Normal;
use super::{CutRecord, LearningError, LearningModel, Learnt, LearntMode, check_samples};
use crate::lobes::Mode;

/// Parameters that all records share, in this order.
pub(super) const NAMES: [&str; 12] = [
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
pub(super) const SHARED: usize = NAMES.len();
/// Of every record and direction: where the deflection counts from, and its drift over the record.
pub(super) const OWN: usize = 4;

/// Places of the shared parameters.
pub(super) const FORCES: usize = 0;
pub(super) const EDGE_RUN_OUT: usize = 4;
pub(super) const MODES: usize = 6;
pub(super) const SURFACE: usize = 10;

const MAX_STEPS: u32 = 100;
/// How often samples are left out anew, and how much longer a mode may take to forget: what is left is then below 1e-4.
const MOST_SETTLINGS: u32 = 4;
const SETTLING_SLACK: f64 = 1.3;
/// The search ends where a whole step would lower the squares by less than this share of the variance of a sample: it would move
/// no parameter by more than a hundredth of its standard error.
const SETTLED: f64 = 1e-4;
/// Damping of the steps from which on the squares have a kink, and so may be least without being flat: where the run-out is so small that an edge
/// begins to cut at its entry, as all do without any.
const STALLED: f64 = 1e3;
/// There a whole step may be taken to lower the squares by so many variances of a sample: as if every side of the kink were the only one, its least is
/// within two standard errors.
const KINK: f64 = 4.0;
/// Factor of the standard errors from which on what is left is more than noise: the search begins elsewhere as well.
const ASTRAY: f64 = 2.0;
/// Shares of a frequency that a start is looked for at: up to a quarter off.
pub(super) const SCAN: [f64; 15] =
    [0.78, 0.81, 0.84, 0.87, 0.9, 0.93, 0.96, 1.0, 1.04, 1.08, 1.12, 1.16, 1.2, 1.24, 1.28];
/// Relative step of numeric derivatives: the cube root of the rounding.
const STEP: f64 = 6e-6;

/// What the records are held against.
pub(super) struct Problem<'a> {
    pub(super) model: &'a LearningModel,
    pub(super) records: &'a [CutRecord<'a>],
    pub(super) settling: usize,
    /// Components of the run-out of the edges: one edge has none, and two are in line with the spindle.
    pub(super) edge_run_outs: usize,
}

/// Parameters: those that are shared, then those of each record.
pub(super) type Parameters = Vec<f64>;

/// What takes a sample: places of parameters, its derivatives by them, and what is left of it.
type Taken<'a> = dyn FnMut(&[usize], &[f64], f64) + 'a;

/// Where the squares are least.
pub(super) struct Least {
    pub(super) parameters: Parameters,
    pub(super) normal: Normal,
}

/// Learns from valid records.
///
/// How a tool moved before a record is not known: samples are judged once that is forgotten. A mode that turns out to forget more slowly than that of
/// the tool library is looked for again in what it has forgotten by.
pub(super) fn fit(model: &LearningModel, records: &[CutRecord<'_>]) -> Result<Learnt, LearningError> {
    let mut settling = settling_samples(model);
    for _ in 0..MOST_SETTLINGS {
        let learnt = fit_behind(settling, model, records)?;
        let of = |mode: Mode, learnt: LearntMode| Mode {
            frequency_hz: learnt.frequency_hz.value,
            damping_ratio: learnt.damping_ratio.value,
            ..mode
        };
        let (mode_x, mode_y) = (of(model.mode_x, learnt.mode_x), of(model.mode_y, learnt.mode_y));
        let needed = settling_samples(&LearningModel { mode_x, mode_y, ..*model });
        if needed as f64 <= SETTLING_SLACK * settling as f64 {
            return Ok(learnt);
        }
        settling = needed;
        let which = "in a record, too few for a mode with as little damping as was found";
        records.iter().try_for_each(|cut| check_samples(settling, which, cut))?;
    }
    Err(LearningError::NoFit(MAX_STEPS))
}

/// Learns from what comes so many samples behind the begin of each record.
fn fit_behind(settling: usize, model: &LearningModel, records: &[CutRecord<'_>]) -> Result<Learnt, LearningError> {
    let problem = Problem::new(settling, model, records);
    let missing = problem.missing_of_excerpts();
    let excerpts = problem.excerpts(&missing);
    let short = Problem::new(settling, model, &excerpts);
    let found = short.scan([0.0; 2], 1).and_then(|start| problem.descend_anew(start));
    // Much run-out, of edges that cut little or nothing, may lead the way from none astray: then nothing is found, or much is left that is no noise.
    let is_astray = |found: &Least| problem.correlation_factor(&found.parameters) >= ASTRAY;
    let other = match &found {
        Ok(found) if !is_astray(found) => None,
        _ => short.least_with_run_out().and_then(|other| problem.descend_anew(other.parameters).ok()),
    };
    match (found, other) {
        (Ok(found), Some(other)) => problem.judge(&short, found.lesser(other)),
        (Ok(found), None) => problem.judge(&short, found),
        // What only means nothing is no better than nothing.
        (Err(refused), Some(other)) => problem.judge(&short, other).map_err(|_| refused),
        (Err(refused), None) => Err(refused),
    }
}

impl Least {
    fn lesser(self, other: Self) -> Self {
        if other.normal.squares < self.normal.squares { other } else { self }
    }
}

impl<'a> Problem<'a> {
    fn new(settling: usize, model: &'a LearningModel, records: &'a [CutRecord<'a>]) -> Self {
        Self { model, records, settling, edge_run_outs: model.edges.clamp(1, 3) as usize - 1 }
    }
}

impl Problem<'_> {
    /// Goes down from parameters of other records of the same cuts.
    pub(super) fn descend_anew(&self, parameters: Parameters) -> Result<Least, LearningError> {
        self.solved(parameters).and_then(|(_, start)| self.descend(start, MAX_STEPS))
    }

    /// Goes down to the least squares.
    pub(super) fn descend(&self, mut parameters: Parameters, most_steps: u32) -> Result<Least, LearningError> {
        let mut normal = self.normal(&parameters, &self.all());
        let mut damping = 1e-3;
        for _ in 0..most_steps {
            let gain = self.gain(&normal)?;
            if gain <= SETTLED || (damping >= STALLED && gain <= KINK) {
                return Ok(Least { parameters, normal });
            }
            let factor = normal.factor(damping).map_err(|place| self.not_identifiable(&self.all(), place))?;
            let mut next = parameters.clone();
            for (&place, step) in self.all().iter().zip(normal.step(&factor)) {
                next[place] += step;
            }
            let tried = self.is_possible(&next).then(|| self.normal(&next, &self.all()));
            match tried.filter(|tried| tried.squares < normal.squares) {
                Some(better) => {
                    (parameters, normal) = (next, better);
                    damping = (damping * 0.1_f64).max(1e-12);
                }
                None => damping *= 10.0,
            }
        }
        Err(LearningError::NoFit(most_steps))
    }

    /// By how much a whole step would lower the squares, in variances of a sample.
    pub(super) fn gain(&self, normal: &Normal) -> Result<f64, LearningError> {
        let factor = normal.factor(0.0).map_err(|place| self.not_identifiable(&self.all(), place))?;
        Ok(normal.gain(&factor) * self.judged() as f64 / normal.squares)
    }

    /// Parameters that are looked for.
    pub(super) fn all(&self) -> Vec<usize> {
        let own = SHARED + OWN * self.records.len();
        (0..own).filter(|place| !(EDGE_RUN_OUT + self.edge_run_outs..MODES).contains(place)).collect()
    }

    pub(super) fn not_identifiable(&self, places: &[usize], index: usize) -> LearningError {
        let place = places.get(index).copied().unwrap_or(0);
        NAMES.get(place).map_or(LearningError::Steady, |name| LearningError::NotIdentifiable(name))
    }

    /// Modes that can be: below the highest frequency that the samples tell, and damped less than critically.
    pub(super) fn is_possible(&self, parameters: &[f64]) -> bool {
        let highest_hz = 0.5 * self.model.sample_rate_hz;
        (0..2).all(|axis| {
            let (frequency_hz, damping) = (parameters[MODES + 2 * axis], parameters[MODES + 2 * axis + 1]);
            frequency_hz > 0.0 && frequency_hz < highest_hz && damping > 0.0 && damping < 1.0
        }) && parameters.iter().all(|value| value.is_finite())
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
    pub(super) fn normal(&self, parameters: &[f64], places: &[usize]) -> Normal {
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
    pub(super) fn rows(&self, number: usize, parameters: &[f64], take: &mut Taken<'_>) {
        let cut = &self.records[number];
        let coefficients = std::array::from_fn(|part| parameters[FORCES + part]);
        let run_out_mm = [parameters[EDGE_RUN_OUT], parameters[EDGE_RUN_OUT + 1]];
        let forces = Forces::new(self.model, cut, coefficients, run_out_mm);
        let mut axes = [0, 1].map(|axis| Axis::new(&self.mode(parameters, axis), self.model.sample_rate_hz));
        let samples = cut.spindle_angle_deg.len();
        for (place, is_missing) in missing_of(cut).into_iter().enumerate() {
            if place >= self.settling && !is_missing {
                let (sin, cos) = libm::sincos(cut.spindle_angle_deg[place].to_radians());
                let surface = [[cos, -sin], [-sin, -cos]];
                let share = place as f64 / samples as f64 - 0.5;
                let measured = [cut.deflection_mm.x[place], cut.deflection_mm.y[place]];
                for (axis, response) in axes.iter().enumerate() {
                    let own = SHARED + OWN * number + 2 * axis;
                    let mode = MODES + 2 * axis;
                    let places = [0, 1, 2, 3, 4, 5, mode, mode + 1, SURFACE, SURFACE + 1, own, own + 1];
                    let row = response.row(surface[axis], share);
                    // Linear in all but the run-out of the edges and the mode.
                    let linear = [0, 1, 2, 3, 8, 9, 10, 11];
                    let predicted: f64 = linear.iter().map(|&at: &usize| parameters[places[at]] * row[at]).sum();
                    take(&places, &row, measured[axis] - predicted);
                }
            }
            if place + 1 < samples {
                let columns = forces.between(place);
                for (axis, response) in axes.iter_mut().enumerate() {
                    response.advance(&columns.map(|column| column[axis]), &coefficients);
                }
            }
        }
    }

    /// Residuals that are judged, of both directions.
    pub(super) fn judged(&self) -> usize {
        let missing =
            |cut: &CutRecord<'_>| cut.missing.iter().filter(|place| **place as usize >= self.settling).count();
        self.records.iter().map(|cut| 2 * (cut.spindle_angle_deg.len() - self.settling - missing(cut))).sum()
    }
}

/// Samples of a turn of the spindle.
pub(super) fn samples_of_turn(cut: &CutRecord<'_>) -> usize {
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

/// What one direction of the tool does under the forces, and how that changes with its mode.
struct Axis {
    response: Response,
    /// Under each column of the forces.
    parts: [State; 6],
    /// With another frequency or damping ratio, on either side, and what twice the difference is.
    moved: [(Response, State); 4],
    steps: [f64; 2],
}

impl Axis {
    fn new(mode: &Mode, rate_hz: f64) -> Self {
        let moved = |frequency: f64, damping: f64| {
            let frequency_hz = mode.frequency_hz * (1.0 + frequency);
            let damping_ratio = mode.damping_ratio * (1.0 + damping);
            (Response::new(&Mode { frequency_hz, damping_ratio, ..*mode }, rate_hz), State::default())
        };
        Self {
            response: Response::new(mode, rate_hz),
            parts: [State::default(); 6],
            moved: [moved(STEP, 0.0), moved(-STEP, 0.0), moved(0.0, STEP), moved(0.0, -STEP)],
            steps: [2.0 * STEP * mode.frequency_hz, 2.0 * STEP * mode.damping_ratio],
        }
    }

    fn advance(&mut self, columns: &[Moments; 6], coefficients: &[f64; 4]) {
        for (state, force) in self.parts.iter_mut().zip(columns) {
            self.response.advance(state, force);
        }
        let mut whole = Moments::default();
        for (column, coefficient) in columns.iter().zip(coefficients) {
            whole.iter_mut().zip(column).for_each(|(whole, moment)| *whole += coefficient * moment);
        }
        for (response, state) in &mut self.moved {
            response.advance(state, &whole);
        }
    }

    /// Derivatives of the deflection by forces, run-out of the edges, frequency and damping (by central differences), run-out of the
    /// surface, zero and drift.
    fn row(&self, surface: [f64; 2], share: f64) -> [f64; 12] {
        let [k_tc, k_te, k_rc, k_re, cosine, sine] = self.parts.map(|[deflection_mm, _]| deflection_mm);
        let [faster, slower, damped, lively] = [0, 1, 2, 3].map(|which| self.moved[which].1[0]);
        let [by_frequency, by_damping] = [(faster - slower) / self.steps[0], (damped - lively) / self.steps[1]];
        [k_tc, k_te, k_rc, k_re, cosine, sine, by_frequency, by_damping, surface[0], surface[1], 1.0, share]
    }
}
