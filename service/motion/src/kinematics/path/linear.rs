//! The linear axes along a stretch, for given rotary axes and tool centre point.

use super::series::{Series, SeriesVec, cross, dot, plus, rotate, vector};
use crate::kinematics::chain::{Joint, Kinematics, KinematicsError, LEAST_VOLUME, solve};
use crate::kinematics::vector::{Vec3, add_scaled};

impl Kinematics {
    /// The linear axes as series, where `tip` is the tool centre point in chain coordinates: like
    /// [`Kinematics::joints_at`]. Rotary axes before the first linear one turn the tool centre point back, those
    /// behind the last linear one the tool; only those between make the linear axes' directions change.
    pub(super) fn linear_series<const N: usize>(
        &self,
        rotary_rad: [Series<N>; 2],
        mut tip: SeriesVec<N>,
        tool_length_mm: f64,
    ) -> Result<SeriesVec<N>, KinematicsError> {
        let turns = rotary_rad.map(Series::sincos);
        let turned = |joint: &Joint, (sine, cosine): (Series<N>, Series<N>), point: SeriesVec<N>| {
            let from = plus(point, joint.point, -1.0);
            plus(rotate(joint.direction, (sine, cosine), &from), joint.point, 1.0)
        };
        let first = self.linear.iter().copied().min().unwrap_or_default();
        let last = self.linear.iter().copied().max().unwrap_or_default();
        for (joint, &place) in self.joints[..first].iter().zip(&self.places) {
            let (sine, cosine) = turns[place];
            tip = turned(joint, (-sine, cosine), tip);
        }
        let mut origin: SeriesVec<N> = vector(add_scaled(self.gauge_point, self.tool_direction, -tool_length_mm));
        let mut constant = [[0.0; 3]; 3];
        let mut columns = [[Series::ZERO; 3]; 3];
        let is_mixed = self.rotary.iter().any(|&rotary| rotary > first && rotary < last);
        for (joint, &place) in self.joints.iter().zip(&self.places).skip(first).rev() {
            if joint.axis.is_rotary() {
                origin = turned(joint, turns[place], origin);
                if is_mixed {
                    columns = columns.map(|column| rotate(joint.direction, turns[place], &column));
                }
            } else {
                constant[place] = joint.direction;
                columns[place] = vector(joint.direction);
            }
        }
        let travel: SeriesVec<N> = core::array::from_fn(|k| tip[k] - origin[k]);
        if is_mixed { solve_series(&columns, &travel) } else { solve_constant(constant, &travel) }
    }
}

/// [`solve`] for the coefficients of each power.
fn solve_constant<const N: usize>(columns: [Vec3; 3], travel: &SeriesVec<N>) -> Result<SeriesVec<N>, KinematicsError> {
    let mut solved = [Series::ZERO; 3];
    for k in 0..N {
        let power = solve(columns, [travel[0].0[k], travel[1].0[k], travel[2].0[k]])?;
        for (solved, value) in solved.iter_mut().zip(power) {
            solved.0[k] = value;
        }
    }
    Ok(solved)
}

/// [`solve`] with directions that change.
fn solve_series<const N: usize>(
    [a, b, c]: &[SeriesVec<N>; 3],
    travel: &SeriesVec<N>,
) -> Result<SeriesVec<N>, KinematicsError> {
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let volume = dot(a, &bc);
    if volume.0[0].abs() < LEAST_VOLUME {
        return Err(KinematicsError::Degenerate);
    }
    let per_volume = Series::constant(1.0).divided_by(volume);
    Ok([bc, ca, ab].map(|row| dot(&row, travel) * per_volume))
}
