//! The path of the tool through one pass over the spindle angle: what the generator runs and a follower plays.
//!
//! Programmed are straight parts, each with its lead. Where the speed along them changes, at the start, between parts,
//! where the tool is pulled out and at the end, it changes as 3s² − 2s³ over an angle with its middle at the vertex:
//! beyond that angle the path is the programmed one exactly, since what is missing before the vertex is caught up after
//! it. The run-up is such a change from rest, the run-down one to rest.

use core::f64::consts::TAU;
use core::ops::Range;

use feedwave_motion::PathLimits;
use serde::{Deserialize, Serialize};

use super::{LeadAxis, RetreatWave, START_JERK, StartUp, ThreadJob, ThreadPass};

/// X on the radius, Z and the length of the path, mm.
type Place = [f64; 3];

/// Most parts of one pass.
pub const MAX_THREAD_PARTS: usize = 100;

/// Where the tool is, as a pure function of the spindle angle from the thread-start reference point in the direction of
/// rotation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadPath {
    start: Place,
    /// In order of the angle, without gaps; the last one ends at `lead_end_deg`.
    pieces: Vec<Piece>,
    end: Place,
    lead_end_deg: f64,
    wave: RetreatWave,
    start_up: StartUp,
    /// Sign in which the tool retreats; 0 without vibration.
    outwards: f64,
    /// Axis of the lead: it retreats across it.
    lead_axis: LeadAxis,
    /// Where the vibration has ended.
    rest_deg: f64,
}

/// A piece of the path: at `at + slope·t`, and with a change of the slope `at + slope·t + change·L·s³(1 − s/2)` with
/// s = t/L, where t is the angle from `origin_deg`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Piece {
    start_deg: f64,
    origin_deg: f64,
    at: Place,
    /// mm per degree.
    slope: Place,
    change: Place,
    /// Angle of the change; 0 for a straight piece.
    length_deg: f64,
    line: u32,
}

/// Where the tool is on a [`ThreadPath`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadPlace {
    /// X on the radius, mm; with the retreat where the lead is along Z.
    pub radius_mm: f64,
    /// Z, mm; with the retreat where the lead is along X.
    pub z_mm: f64,
    /// Length of the path behind it, mm, without the vibration.
    pub path_mm: f64,
    /// Retreat from the programmed depth, mm across the lead, within 0 and A.
    pub retreat_mm: f64,
}

/// A straight part of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathPart {
    /// X on the radius and Z of its end, mm.
    pub(crate) end: [f64; 2],
    /// Spindle angle that it takes, degrees.
    pub(crate) angle_deg: f64,
    pub(crate) line: u32,
}

impl PathPart {
    /// The part to `end` with a lead along whichever axis travels further.
    pub(crate) fn new(start: [f64; 2], end: [f64; 2], lead_mm: f64, line: u32) -> Self {
        let travel_mm = (end[0] - start[0]).abs().max((end[1] - start[1]).abs());
        Self { end, angle_deg: 360.0 * travel_mm / lead_mm, line }
    }

    /// Travel per degree of the spindle of X, Z and the path, mm.
    pub(crate) fn slope(&self, start: [f64; 2]) -> Place {
        let [x, z] = [self.end[0] - start[0], self.end[1] - start[1]];
        [x, z, libm::hypot(x, z)].map(|travel_mm| travel_mm / self.angle_deg)
    }
}

/// The vibration of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathVibration {
    pub(crate) wave: RetreatWave,
    pub(crate) start_up: StartUp,
    /// Axis of the lead: the tool retreats across it.
    pub(crate) lead_axis: LeadAxis,
    /// Sign in which the tool retreats.
    pub(crate) outwards: f64,
}

impl Piece {
    /// Adds what a vertex of the path is made of: the change between the slopes before and behind it, mm per degree, over
    /// `length_deg` around `vertex_deg`, and the straight part behind.
    fn push_vertex(
        pieces: &mut Vec<Self>,
        at: Place,
        [slope, next]: [Place; 2],
        vertex_deg: f64,
        length_deg: f64,
        line: u32,
    ) {
        let half_deg = 0.5 * length_deg;
        if half_deg > 0.0 {
            pieces.push(Piece {
                start_deg: vertex_deg - half_deg,
                origin_deg: vertex_deg - half_deg,
                at: core::array::from_fn(|axis| at[axis] - slope[axis] * half_deg),
                slope,
                change: core::array::from_fn(|axis| next[axis] - slope[axis]),
                length_deg,
                line,
            });
        }
        pieces.push(Piece {
            start_deg: vertex_deg + half_deg,
            origin_deg: vertex_deg,
            at,
            slope: next,
            change: [0.0; 3],
            length_deg: 0.0,
            line,
        });
    }

    #[inline]
    fn value(&self, axis: usize, angle_deg: f64) -> f64 {
        let t = angle_deg - self.origin_deg;
        let straight = self.at[axis] + self.slope[axis] * t;
        if self.length_deg == 0.0 {
            return straight;
        }
        let s = t / self.length_deg;
        straight + self.change[axis] * self.length_deg * (s * s * s * (1.0 - 0.5 * s))
    }

    /// mm per degree.
    #[inline]
    fn rate(&self, axis: usize, angle_deg: f64) -> f64 {
        if self.length_deg == 0.0 {
            return self.slope[axis];
        }
        let s = (angle_deg - self.origin_deg) / self.length_deg;
        self.slope[axis] + self.change[axis] * (s * s * (3.0 - 2.0 * s))
    }
}

impl ThreadPath {
    /// The path from `start` (X on the radius and Z, mm) through `parts`, starting at `start_angle_deg`. `changes_deg`
    /// are the angles of the changes of speed at the start and at the end of every part; those of neighbouring vertices
    /// must not overlap.
    pub(crate) fn new(
        start: [f64; 2],
        parts: &[PathPart],
        start_angle_deg: f64,
        changes_deg: &[f64],
        vibration: PathVibration,
    ) -> Self {
        let mut pieces = Vec::with_capacity(2 * parts.len() + 1);
        let [mut at, mut slope] = [[start[0], start[1], 0.0], [0.0; 3]];
        let mut vertex_deg = start_angle_deg + 0.5 * changes_deg.first().copied().unwrap_or(0.0);
        let mut line = parts.first().map_or(0, |part| part.line);
        for (part, &length_deg) in parts.iter().zip(changes_deg) {
            let next = part.slope([at[0], at[1]]);
            line = part.line;
            Piece::push_vertex(&mut pieces, at, [slope, next], vertex_deg, length_deg, line);
            at = [part.end[0], part.end[1], at[2] + next[2] * part.angle_deg];
            slope = next;
            vertex_deg += part.angle_deg;
        }
        let last_deg = changes_deg.get(parts.len()).copied().unwrap_or(0.0);
        Piece::push_vertex(&mut pieces, at, [slope, [0.0; 3]], vertex_deg, last_deg, line);
        // It rests beyond.
        pieces.pop();
        let lead_end_deg = vertex_deg + 0.5 * last_deg;
        let PathVibration { wave, start_up, lead_axis, outwards } = vibration;
        let rest_deg = if wave.amplitude_mm > 0.0 {
            // The vibration goes on until its retreat is zero at a whole turn of its phase, where its speed is, too.
            let from_deg = lead_end_deg.max(wave.in_phase_deg(start_up));
            let turns = (wave.phase_deg(from_deg) / 360.0).ceil();
            lead_end_deg.max((360.0 * turns + wave.phase_shift_deg) / wave.vibrations_per_rev)
        } else {
            lead_end_deg
        };
        let outwards = if wave.amplitude_mm > 0.0 { outwards } else { 0.0 };
        Self {
            start: [start[0], start[1], 0.0],
            pieces,
            end: at,
            lead_end_deg,
            wave,
            start_up,
            outwards,
            lead_axis,
            rest_deg,
        }
    }

    /// The path of a pass of a thread.
    #[must_use]
    pub fn of_pass(job: &ThreadJob, pass: &ThreadPass) -> Self {
        let geometry = &job.geometry;
        let length_mm = geometry.length_mm().max(pass.start_travel_mm);
        let lead_axis = geometry.lead_axis;
        let place = |travel_mm: f64| {
            lead_axis.place(geometry.across_mm(pass.depth_mm, travel_mm), geometry.along_mm(travel_mm))
        };
        let start = place(pass.start_travel_mm);
        let part = PathPart::new(start, place(length_mm), geometry.lead_mm, pass.span.line);
        let change_deg = job.run_up.angle_deg.min(part.angle_deg);
        let vibration =
            PathVibration { wave: job.wave(pass), start_up: job.start_up, lead_axis, outwards: geometry.inwards() };
        Self::new(start, &[part], pass.start_angle_deg, &[change_deg; 2], vibration)
    }

    /// Where the tool is at a spindle angle from the thread-start reference point, degrees in the direction of rotation;
    /// negative before it.
    #[must_use]
    pub fn at(&self, spindle_angle_deg: f64) -> ThreadPlace {
        let retreat_mm = self.retreat_mm(spindle_angle_deg);
        let [x, z, path_mm] = match self.piece_at(spindle_angle_deg) {
            Some(piece) => [0, 1, 2].map(|axis| piece.value(axis, spindle_angle_deg)),
            None => self.beyond(spindle_angle_deg),
        };
        let [radius_mm, z_mm] = match self.lead_axis {
            LeadAxis::Z => [x + self.outwards * retreat_mm, z],
            LeadAxis::X => [x, z + self.outwards * retreat_mm],
        };
        ThreadPlace { radius_mm, z_mm, path_mm, retreat_mm }
    }

    /// Retreat at a spindle angle, mm across the lead.
    #[must_use]
    pub fn retreat_mm(&self, spindle_angle_deg: f64) -> f64 {
        if spindle_angle_deg >= self.rest_deg {
            return 0.0;
        }
        self.wave.retreat_mm(self.start_up, spindle_angle_deg)
    }

    /// Spindle angle at which the lead axis starts, degrees.
    #[must_use]
    pub fn lead_start_deg(&self) -> f64 {
        self.pieces.first().map_or(self.lead_end_deg, |piece| piece.start_deg)
    }

    /// Spindle angle at which the lead axis has come to rest, degrees.
    #[must_use]
    pub fn lead_end_deg(&self) -> f64 {
        self.lead_end_deg
    }

    /// Spindle angle at which everything has come to rest, degrees.
    #[must_use]
    pub fn rest_deg(&self) -> f64 {
        self.rest_deg
    }

    /// Angle from which on something moves with the spindle, degrees: the start of the lead, or of the vibration where that comes
    /// before.
    pub(crate) fn first_motion_deg(&self) -> f64 {
        let vibrates = self.outwards != 0.0 && self.wave.amplitude_mm != 0.0;
        let wave_deg = if vibrates { self.wave.start_deg(self.start_up) } else { f64::INFINITY };
        self.lead_start_deg().min(wave_deg)
    }

    /// Highest speed of the spindle at which X and Z keep their limits between two angles, rev/s; infinite where nothing moves.
    ///
    /// At `u` rev/s a slope of `m` mm per degree is 360·m·u mm/s, a change of slope by `c` over the angle `L` takes at most
    /// 1.5·c·(360·u)²/L and 6·c·(360·u)³/L², and the vibration (A/2)·(2π·D·u)ⁿ; in its start-up n = 3 has its share more.
    pub(crate) fn fastest_rev_per_s(&self, between_deg: [f64; 2], limits: [PathLimits; 2]) -> f64 {
        let [first_deg, last_deg] = [between_deg[0].min(between_deg[1]), between_deg[0].max(between_deg[1])];
        let ends = self.pieces.iter().skip(1).map(|piece| piece.start_deg).chain([self.lead_end_deg]);
        let on_lead = self
            .pieces
            .iter()
            .zip(ends)
            .filter(|(piece, end_deg)| piece.start_deg <= last_deg && *end_deg >= first_deg);
        let vibrates =
            self.outwards != 0.0 && last_deg >= self.wave.start_deg(self.start_up) && first_deg < self.rest_deg;
        let rad = TAU * self.wave.vibrations_per_rev;
        let half_mm = if vibrates { 0.5 * self.wave.amplitude_mm } else { 0.0 };
        let wave = [half_mm * rad, half_mm * rad * rad, half_mm * rad * rad * rad * (1.0 + START_JERK)];
        let across = match self.lead_axis {
            LeadAxis::Z => 0,
            LeadAxis::X => 1,
        };
        let mut demands = [[0.0_f64; 3]; 2];
        for (piece, _) in on_lead {
            for (axis, demand) in demands.iter_mut().enumerate() {
                let (slope, change) = (piece.slope[axis], piece.change[axis]);
                let steepest = slope.abs().max((slope + change).abs());
                demand[0] = demand[0].max(360.0 * steepest);
                if piece.length_deg > 0.0 {
                    let per_rev = 360.0 / piece.length_deg;
                    let change_mm = 360.0 * change.abs();
                    demand[1] = demand[1].max(1.5 * change_mm * per_rev);
                    demand[2] = demand[2].max(6.0 * change_mm * per_rev * per_rev);
                }
            }
        }
        let fastest = |axis: usize| {
            let superposed = if axis == across { wave } else { [0.0; 3] };
            let [velocity, acceleration, jerk] = [0, 1, 2].map(|order| demands[axis][order] + superposed[order]);
            let limit = limits[axis];
            let by_velocity = limit.velocity / velocity;
            let by_acceleration = libm::sqrt(limit.acceleration / acceleration);
            by_velocity.min(by_acceleration).min(libm::cbrt(limit.jerk / jerk))
        };
        fastest(0).min(fastest(1))
    }

    /// Angle over which the speed of the lead axis changes, all changes together, degrees.
    pub(crate) fn changing_deg(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.length_deg).sum()
    }

    /// X on the radius and Z where it starts, mm.
    pub(crate) const fn start(&self) -> [f64; 2] {
        [self.start[0], self.start[1]]
    }

    /// Length of the path, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.end[2]
    }

    /// Source line of the last part.
    pub(crate) fn last_line(&self) -> u32 {
        self.line(f64::INFINITY)
    }

    /// Source line at a spindle angle before or after the lead axis moves.
    fn line(&self, angle_deg: f64) -> u32 {
        let line = if angle_deg >= self.lead_end_deg { self.pieces.last() } else { self.pieces.first() };
        line.map_or(0, |piece| piece.line)
    }

    fn piece_at(&self, angle_deg: f64) -> Option<&Piece> {
        if angle_deg >= self.lead_end_deg {
            return None;
        }
        let after = self.pieces.partition_point(|piece| piece.start_deg <= angle_deg);
        self.pieces.get(after.checked_sub(1)?)
    }

    /// Where the lead axis rests before its start or after its end.
    fn beyond(&self, angle_deg: f64) -> Place {
        if angle_deg >= self.lead_end_deg { self.end } else { self.start }
    }

    /// [`ThreadPath::at`] of ascending angles, column by column, with the speed along the path in mm per degree and the
    /// source lines.
    pub(crate) fn fill(&self, angles_deg: &[f64], columns: PathColumns<'_>) {
        let PathColumns { x, z, path_mm, speed, retreat_mm, line } = columns;
        let mut done = 0;
        while done < angles_deg.len() {
            let angle_deg = angles_deg[done];
            let after = self.pieces.partition_point(|piece| piece.start_deg <= angle_deg);
            let next_deg = match self.pieces.get(after) {
                _ if angle_deg >= self.lead_end_deg => f64::INFINITY,
                Some(next) => next.start_deg.min(self.lead_end_deg),
                None => self.lead_end_deg,
            };
            let count = angles_deg[done..].partition_point(|angle_deg| *angle_deg < next_deg).max(1);
            let rows = done..done + count;
            match self.piece_at(angle_deg) {
                Some(piece) => {
                    let angles_deg = &angles_deg[rows.clone()];
                    for (axis, column) in [(0, &mut *x), (1, &mut *z), (2, &mut *path_mm)] {
                        fill_column(piece, axis, angles_deg, &mut column[rows.clone()]);
                    }
                    for (speed, angle_deg) in speed[rows.clone()].iter_mut().zip(angles_deg) {
                        *speed = piece.rate(2, *angle_deg);
                    }
                    line[rows].fill(piece.line);
                }
                None => {
                    let place = self.beyond(angle_deg);
                    x[rows.clone()].fill(place[0]);
                    z[rows.clone()].fill(place[1]);
                    path_mm[rows.clone()].fill(place[2]);
                    speed[rows.clone()].fill(0.0);
                    line[rows].fill(self.line(angle_deg));
                }
            }
            done += count;
        }
        self.fill_retreat(angles_deg, retreat_mm);
        if self.outwards != 0.0 {
            let across = match self.lead_axis {
                LeadAxis::Z => x,
                LeadAxis::X => z,
            };
            for (across, retreat_mm) in across.iter_mut().zip(&*retreat_mm) {
                *across += self.outwards * retreat_mm;
            }
        }
    }

    fn fill_retreat(&self, angles_deg: &[f64], retreat_mm: &mut [f64]) {
        if self.outwards == 0.0 {
            return retreat_mm.fill(0.0);
        }
        let Range { start, end } = self.in_phase(angles_deg);
        for (retreat_mm, angle_deg) in retreat_mm[..start].iter_mut().zip(angles_deg) {
            *retreat_mm = self.retreat_mm(*angle_deg);
        }
        for (retreat_mm, angle_deg) in retreat_mm[start..end].iter_mut().zip(&angles_deg[start..end]) {
            *retreat_mm = self.wave.at_phase_mm(self.wave.phase_deg(*angle_deg));
        }
        retreat_mm[end..].fill(0.0);
    }

    /// The angles between the place from which on the vibration has its phase and its end.
    fn in_phase(&self, angles_deg: &[f64]) -> Range<usize> {
        let end = angles_deg.partition_point(|angle_deg| *angle_deg < self.rest_deg);
        let in_phase_deg = self.wave.in_phase_deg(self.start_up);
        angles_deg[..end].partition_point(|angle_deg| *angle_deg < in_phase_deg)..end
    }
}

/// Columns that [`ThreadPath::fill`] fills, each as long as the angles.
pub(crate) struct PathColumns<'a> {
    pub(crate) x: &'a mut [f64],
    pub(crate) z: &'a mut [f64],
    pub(crate) path_mm: &'a mut [f64],
    /// mm per degree.
    pub(crate) speed: &'a mut [f64],
    pub(crate) retreat_mm: &'a mut [f64],
    pub(crate) line: &'a mut [u32],
}

fn fill_column(piece: &Piece, axis: usize, angles_deg: &[f64], column: &mut [f64]) {
    // Most of a thread: without the branch of each value, so that the loop vectorises.
    if piece.length_deg == 0.0 {
        let (at, slope, origin_deg) = (piece.at[axis], piece.slope[axis], piece.origin_deg);
        for (value, angle_deg) in column.iter_mut().zip(angles_deg) {
            *value = at + slope * (angle_deg - origin_deg);
        }
        return;
    }
    for (value, angle_deg) in column.iter_mut().zip(angles_deg) {
        *value = piece.value(axis, *angle_deg);
    }
}
