//! Where the search begins.

use std::f64::consts::TAU;

use super::fit::{EDGE_RUN_OUT, Least, MODES, OWN, Parameters, Problem, SCAN, SHARED, SURFACE, samples_of_turn};
use super::{CutRecord, LearningError};
use crate::batch::Pair;

/// Run-outs of the edges that a start is looked for at, in feeds per edge, and their directions in a turn.
const RUN_OUTS: [f64; 4] = [0.05, 0.12, 0.25, 0.4];
const DIRECTIONS: u32 = 8;
/// Of them, the search goes on from so many.
const CANDIDATES: usize = 8;
/// How often the frequencies of both directions are looked for with each.
const ROUNDS: usize = 3;
/// Steps of the search from each: the right one needs a dozen.
const FEW_STEPS: u32 = 30;
/// Steps of the frequency, over the range of the scan, in which other modes are looked for.
const FINE_STEPS: u32 = 40;
/// Judged samples and turns of a record that are looked at for the start, at least.
const EXCERPT_SAMPLES: usize = 1_500;
const EXCERPT_TURNS: usize = 4;

impl Problem<'_> {
    /// What the tool library says, and no forces.
    fn library(&self) -> Parameters {
        let mut parameters = vec![0.0; SHARED + OWN * self.records.len()];
        for (place, mode) in [&self.model.mode_x, &self.model.mode_y].into_iter().enumerate() {
            parameters[MODES + 2 * place] = mode.frequency_hz;
            parameters[MODES + 2 * place + 1] = mode.damping_ratio;
        }
        parameters
    }

    /// Those in which the deflection is linear, without the run-out of the edges.
    fn linear(&self) -> Vec<usize> {
        let own = SHARED + OWN * self.records.len();
        (0..own).filter(|place| *place < EDGE_RUN_OUT || *place >= SURFACE).collect()
    }

    /// Frequencies near those of the library with which the linear parameters explain most, at a run-out of the edges: one direction after the other,
    /// so many times.
    pub(super) fn scan(&self, run_out_mm: [f64; 2], rounds: usize) -> Result<Parameters, LearningError> {
        let mut parameters = self.library();
        parameters[EDGE_RUN_OUT..][..2].copy_from_slice(&run_out_mm);
        let library = self.library();
        for axis in (0..2 * rounds).map(|it| it % 2) {
            let place = MODES + 2 * axis;
            let library_hz = library[place];
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
    pub(super) fn solved(&self, mut parameters: Parameters) -> Result<(f64, Parameters), LearningError> {
        let places = self.linear();
        let normal = self.normal(&parameters, &places);
        let factor = normal.factor(0.0).map_err(|place| self.not_identifiable(&places, place))?;
        for (&place, step) in places.iter().zip(normal.step(&factor)) {
            parameters[place] += step;
        }
        // What is linear is solved by one step, and lowers the squares by as much as it says.
        Ok((normal.squares - normal.gain(&factor), parameters))
    }

    /// Least squares from the run-outs of the edges, none among them, that explain most at the frequencies of the library.
    pub(super) fn least_with_run_out(&self) -> Option<Least> {
        let candidates = self.run_outs(&self.library());
        let found = candidates.into_iter().take(CANDIDATES).filter_map(|(_, run_out_mm)| {
            let start = self.scan(run_out_mm, ROUNDS).ok()?;
            self.descend(start, FEW_STEPS).ok()
        });
        found.min_by(|a, b| a.normal.squares.total_cmp(&b.normal.squares))
    }

    /// Where the linear parameters explain more than at frequencies beside, with the damping that was found and with that of the library.
    pub(super) fn starts_at_other_frequencies(&self, found: &[f64], axis: usize) -> Vec<Parameters> {
        let place = MODES + 2 * axis;
        let library = self.library();
        let (lowest_hz, highest_hz) = (library[place] * SCAN[0], library[place] * SCAN[SCAN.len() - 1]);
        let mut starts = Vec::new();
        for damping in [found[place + 1], library[place + 1]] {
            let mut tried = Vec::new();
            for step in 0..=FINE_STEPS {
                let mut parameters = found.to_vec();
                parameters[place] = lowest_hz + (highest_hz - lowest_hz) * f64::from(step) / f64::from(FINE_STEPS);
                parameters[place + 1] = damping;
                tried.extend(self.is_possible(&parameters).then(|| self.solved(parameters).ok()).flatten());
            }
            let beside =
                |place: usize| tried.get(place).map_or(f64::INFINITY, |(squares, _): &(f64, Parameters)| *squares);
            for (place, (squares, parameters)) in tried.iter().enumerate() {
                if *squares <= beside(place.wrapping_sub(1)) && *squares <= beside(place + 1) {
                    starts.push(parameters.clone());
                }
            }
        }
        starts
    }

    /// Run-outs of the edges, and the squares that the linear parameters leave with them, the least first.
    fn run_outs(&self, parameters: &[f64]) -> Vec<(f64, [f64; 2])> {
        let feeds_mm = self.records.iter().map(|cut| {
            let last = cut.spindle_angle_deg.len() - 1;
            let turned_deg = (cut.spindle_angle_deg[last] - cut.spindle_angle_deg[0]).abs();
            let turn_s = 360.0 / turned_deg * last as f64 / self.model.sample_rate_hz;
            cut.feed_mm_per_min / 60.0 * turn_s / f64::from(self.model.edges)
        });
        let feed_mm = feeds_mm.sum::<f64>() / self.records.len() as f64;
        // That of two edges is in line with them, to either side.
        let directions = match self.edge_run_outs {
            0 => 0,
            1 => 2,
            _ => DIRECTIONS,
        };
        let mut tried = Vec::new();
        tried.extend(self.solved(parameters.to_vec()).ok().map(|(squares, _)| (squares, [0.0; 2])));
        for share in RUN_OUTS {
            for direction in 0..directions {
                let (sin, cos) = libm::sincos(TAU / f64::from(directions) * f64::from(direction));
                let run_out_mm = [share * feed_mm * cos, if directions == 2 { 0.0 } else { share * feed_mm * sin }];
                let mut parameters = parameters.to_vec();
                parameters[EDGE_RUN_OUT..][..2].copy_from_slice(&run_out_mm);
                tried.extend(self.solved(parameters).ok().map(|(squares, _)| (squares, run_out_mm)));
            }
        }
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        tried
    }

    /// Where samples of the excerpts are missing.
    pub(super) fn missing_of_excerpts(&self) -> Vec<Vec<u32>> {
        let within = |cut: &CutRecord<'_>| {
            let samples = self.excerpt(cut);
            cut.missing.iter().copied().filter(|place| (*place as usize) < samples).collect()
        };
        self.records.iter().map(within).collect()
    }

    /// The begin of every record: enough to find where to begin.
    pub(super) fn excerpts<'a>(&'a self, missing: &'a [Vec<u32>]) -> Vec<CutRecord<'a>> {
        let records = self.records.iter().zip(missing);
        let excerpts = records.map(|(cut, missing)| {
            let samples = self.excerpt(cut);
            let Pair { x, y } = cut.deflection_mm;
            CutRecord {
                deflection_mm: Pair { x: &x[..samples], y: &y[..samples] },
                spindle_angle_deg: &cut.spindle_angle_deg[..samples],
                missing,
                ..*cut
            }
        });
        excerpts.collect()
    }

    fn excerpt(&self, cut: &CutRecord<'_>) -> usize {
        let judged = EXCERPT_SAMPLES.max(EXCERPT_TURNS * samples_of_turn(cut));
        cut.spindle_angle_deg.len().min(self.settling + judged)
    }
}
