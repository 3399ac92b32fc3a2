//! The rotary axes along a great circle, in closed form: no pole, and no passing near one, costs it precision.
//!
//! Along a great circle the direction is cos ψ·p + sin ψ·q with p its point nearest to a pole f (one end of the first
//! rotary axis' line, at the angle δ) and ψ the angle from there. Across the axis it has the components η = cos ψ·sin δ
//! along m, the direction in which p lies beside the pole, and σ = sin ψ along q; m, q, f are right-handed. The first
//! axis' angle is that of (η, σ) about f, less that of the middle direction z of the inverse solution (see
//! `inverse`), which lies as far from the pole.
//!
//! Where the great circle passes the pole within the tolerance, it is bent to lead through it: δ falls to zero there, as
//! δ·ρ·(4 − 6ρ + 4ρ² − ρ³) with ρ = (σ/σ_w)² within |σ| < σ_w, which has three continuous derivatives. Then η = σ·τ with a
//! smooth τ, so that the angle of (τ, 1) is smooth, and with the distance from the axis counted negative before the pole the
//! second axis goes through its value in the pole and on, where beside it the first one would turn by half a turn.

use core::f64::consts::{FRAC_PI_2, PI};

use super::series::{Series, SeriesVec, dot_constant};
use crate::kinematics::chain::{Kinematics, KinematicsError};
use crate::kinematics::inverse::travel;
use crate::kinematics::range::nearest_turn;
use crate::kinematics::vector::{Vec3, add_scaled, cross, dot, norm, scale, unit};
use crate::tolerance::{POLE_RAD, REACHED_POLE, SAME_DIRECTION_RAD};

/// Places per radian of a great circle at which the turns of the second axis are counted.
const STEPS_PER_RAD: f64 = 4.0;

/// The two rotary axes along a great circle, both in one branch of the inverse solution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turning {
    first: Vec3,
    /// Components of the axes and the tool, in the frames of the inverse solution.
    frame: Frame,
    /// 1 or −1: which end of the first axis' line is passed.
    sign: f64,
    /// Angle from the point nearest to the pole to the start, rad.
    start_rad: f64,
    /// Angle between the ends, rad.
    pub(super) angle_rad: f64,
    /// Azimuth of m about the first axis, rad.
    azimuth_rad: f64,
    /// Angle at which the pole is passed, rad; with the sign of the side.
    beside_rad: f64,
    /// Half of the width on which the great circle is bent through the pole, as a sine; none where it is not.
    bent: Option<f64>,
    /// ±1: the branch.
    branch: f64,
}

/// The geometry of the two rotary axes and the tool.
#[derive(Clone, Copy, Debug)]
struct Frame {
    /// Unit vectors across the first axis: in the plane of the axes, and perpendicular to it.
    e1: Vec3,
    e2: Vec3,
    /// a₁·a₂ and |a₁×a₂|.
    between: f64,
    sine: f64,
    /// a₂·d, the cosine of the second axis to the tool.
    tool: f64,
    /// Rows that turn a vector into its components along d across a₂, and perpendicular to both.
    rows: [Vec3; 2],
}

impl Frame {
    fn of(kinematics: &Kinematics) -> Option<Self> {
        let [first, second] = kinematics.rotary.map(|index| kinematics.joints[index].direction);
        let tool = kinematics.tool_direction;
        let across = cross(cross(first, second), first);
        let sine = norm(across);
        let e1 = scale(across, 1.0 / sine);
        let row = unit(add_scaled(tool, second, -dot(second, tool)))?;
        Some(Self {
            e1,
            e2: cross(first, e1),
            between: dot(first, second),
            sine,
            tool: dot(second, tool),
            rows: [row, cross(second, row)],
        })
    }
}

impl Frame {
    /// How far the second axis misses turning the tool into an end of the first axis' line, as a difference of cosines.
    fn at_pole(&self, sign: f64) -> f64 {
        let missed = self.tool - sign * self.between;
        if missed.abs() <= REACHED_POLE { 0.0 } else { missed }
    }

    fn reaches_pole(&self, sign: f64) -> bool {
        self.at_pole(sign) == 0.0
    }
}

/// Half of the width on which a great circle is bent through a pole that it passes at the angle `beside_rad`, as a sine: as far
/// as both ends allow, which are at these angles from there. None where bending would not help: bent, the first axis turns by
/// what is left to half a turn otherwise.
fn bent_width(ends_rad: [f64; 2], beside_rad: f64) -> Option<f64> {
    // An end in the pole itself is no end of anything.
    let angles_rad = ends_rad.map(|end| end.abs().min(FRAC_PI_2)).into_iter().filter(|&end| end > POLE_RAD);
    let width = libm::sin(angles_rad.fold(FRAC_PI_2, f64::min));
    (width > libm::sin(beside_rad.abs()) || beside_rad.abs() <= POLE_RAD).then_some(width)
}

impl Turning {
    /// Along the great circle from `from` to `to` (unit vectors in chain coordinates), in the branch that is nearest to
    /// `reference_rad` where it starts. A pole within `tolerance_rad` is passed through. `None` for equal directions.
    ///
    /// # Errors
    /// [`KinematicsError::Unreachable`] where the start cannot be reached.
    pub(super) fn new(
        kinematics: &Kinematics,
        [from, to]: [Vec3; 2],
        tolerance_rad: f64,
        reference_rad: [f64; 2],
    ) -> Result<Option<Self>, KinematicsError> {
        let first = kinematics.joints[kinematics.rotary[0]].direction;
        let frame = Frame::of(kinematics).ok_or(KinematicsError::Degenerate)?;
        let [from, to] = [from, to].map(|direction| {
            let sign = if dot(direction, first) < 0.0 { -1.0 } else { 1.0 };
            let is_pole = norm(cross(direction, first)) <= POLE_RAD && frame.reaches_pole(sign);
            if is_pole { scale(first, sign) } else { direction }
        });
        let normal = cross(from, to);
        let angle_rad = libm::atan2(norm(normal), dot(from, to));
        let (Some(normal), true) = (unit(normal), angle_rad > SAME_DIRECTION_RAD) else { return Ok(None) };
        let towards = cross(normal, from);
        // The component along the first axis is R·cos(φ − φ₀).
        let nearest = libm::atan2(dot(towards, first), dot(from, first));
        let half_turn = if nearest > 0.0 { -PI } else { PI };
        let is_between = |angle: f64| (-POLE_RAD..=angle_rad + POLE_RAD).contains(&angle);
        let middle = 0.5 * angle_rad;
        let is_other = !is_between(nearest) && (is_between(nearest + half_turn) || libm::cos(middle - nearest) < 0.0);
        let (sign, nearest) = if is_other { (-1.0, nearest + half_turn) } else { (1.0, nearest) };
        let pole = scale(first, sign);
        let (sine, cosine) = libm::sincos(nearest);
        let along = add_scaled(scale(towards, cosine), from, -sine);
        let side = cross(along, pole);
        let beside_rad = libm::asin(dot(pole, normal).clamp(-1.0, 1.0));
        let mut turning = Self {
            first,
            frame,
            sign,
            start_rad: -nearest,
            angle_rad,
            azimuth_rad: libm::atan2(dot(side, frame.e2), dot(side, frame.e1)),
            beside_rad,
            bent: None,
            branch: 1.0,
        };
        let is_passed = is_between(nearest) && frame.reaches_pole(sign);
        if is_passed && beside_rad.abs() <= tolerance_rad.max(POLE_RAD) {
            let ends = [turning.start_rad, turning.start_rad + angle_rad];
            turning.bent = bent_width(ends, beside_rad);
        }
        turning.in_nearest_branch(reference_rad).map(Some)
    }

    /// In the branch that is nearest to `reference_rad` where it starts.
    fn in_nearest_branch(self, reference_rad: [f64; 2]) -> Result<Self, KinematicsError> {
        let (mut best, mut chosen) = (f64::INFINITY, self);
        for branch in [1.0, -1.0] {
            let candidate = Self { branch, ..self };
            let values = candidate.at(0.0)?;
            let values = [0, 1].map(|axis| nearest_turn(values[axis], reference_rad[axis]));
            let travel = travel(values, reference_rad);
            if travel < best {
                (best, chosen) = (travel, candidate);
            }
        }
        Ok(chosen)
    }

    /// Largest angle between the great circle and the direction that is taken, rad.
    pub(super) fn deviation_rad(&self) -> f64 {
        if self.bent.is_some() { self.beside_rad.abs() } else { 0.0 }
    }

    /// Smallest angle to the line of the first axis along the programmed turn, rad.
    pub(super) fn pole_distance_rad(&self) -> f64 {
        let ends = [self.start_rad, self.start_rad + self.angle_rad];
        let inside = ends[0] <= 0.0 && ends[1] >= 0.0;
        let distance = |psi: f64| {
            let (sine, cosine) = libm::sincos(psi);
            let beside = libm::sin(self.beside_rad) * cosine;
            libm::atan2(libm::hypot(sine, beside), (cosine * libm::cos(self.beside_rad)).abs())
        };
        if inside { self.beside_rad.abs() } else { distance(ends[0]).min(distance(ends[1])) }
    }

    /// Whether the first axis is free where it starts.
    pub(super) fn starts_in_pole(&self) -> bool {
        self.bent.is_some() && self.start_rad.abs() <= POLE_RAD
    }

    /// Share of the angle at which the pole is nearest, where that is within the turn.
    pub(super) fn nearest_share(&self) -> Option<f64> {
        let share = -self.start_rad / self.angle_rad;
        (share > 0.0 && share < 1.0).then_some(share)
    }

    /// Values at a share of the angle, followed from `start_rad`, rad. Nothing that the first axis' angle is made of passes
    /// ±π in between; the second one's may, slowly.
    pub(super) fn reached(&self, start_rad: [f64; 2], share: f64) -> Result<[f64; 2], KinematicsError> {
        let steps = 1 + (self.angle_rad * share * STEPS_PER_RAD) as u32;
        let [first, mut second] = start_rad;
        let mut turned = 0.0;
        for step in 0..=steps {
            let values = self.at(share * f64::from(step) / f64::from(steps))?;
            second = nearest_turn(values[1], second);
            if step == 0 {
                turned = values[0];
            }
            if step == steps {
                turned = values[0] - turned;
            }
        }
        Ok([first + turned, second])
    }

    /// Shares of the angle where a high derivative of the path is not continuous, in order; outside 0 to 1 where
    /// there are none.
    pub(super) fn bends(&self) -> [f64; 2] {
        let width = self.bent.map_or(f64::NAN, libm::asin);
        [-width, width].map(|psi| (psi - self.start_rad) / self.angle_rad)
    }

    /// Values at a share of the angle but for whole turns, rad.
    pub(super) fn at(&self, share: f64) -> Result<[f64; 2], KinematicsError> {
        Ok(self.series::<1>(share, 0.0)?.map(|series| series.0[0]))
    }

    /// The angles (but for whole turns) as series of t, with the share of the angle `share` + `half`·t.
    pub(super) fn series<const N: usize>(&self, share: f64, half: f64) -> Result<[Series<N>; 2], KinematicsError> {
        let frame = &self.frame;
        let psi = Series::linear(self.start_rad + self.angle_rad * share, self.angle_rad * half);
        let (sigma, cosine) = psi.sincos();
        // Across the axis the direction is (eta, s) of the length n, times a factor that is negative before a pole which is
        // passed through.
        let (eta, s, n, radius, upright);
        match self.bent {
            Some(width) if sigma.0[0].abs() < width => {
                let rho = (sigma * sigma).scaled(1.0 / (width * width));
                let falling = (((-rho).plus(4.0) * rho).plus(-6.0) * rho).plus(4.0);
                // δ(σ) = σ·gain, and sin δ(σ) = σ·gain·sinc.
                let gain = (falling * sigma).scaled(self.beside_rad / (width * width));
                let bent = gain * sigma;
                eta = cosine * gain * sinc(bent * bent);
                s = Series::constant(1.0);
                n = (eta * eta).plus(1.0).sqrt();
                radius = sigma * n;
                upright = cosine * bent.sincos().1;
            }
            _ => {
                let (sine_beside, cosine_beside) = libm::sincos(self.beside_rad);
                let side = if self.bent.is_some() && sigma.0[0] < 0.0 { -1.0 } else { 1.0 };
                eta = cosine.scaled(side * sine_beside);
                s = sigma.scaled(side);
                n = (eta * eta + s * s).sqrt();
                radius = n.scaled(side);
                upright = cosine.scaled(cosine_beside);
            }
        }
        // Seen from the side on which the pole is passed, the angle does not pass ±π.
        let is_behind = self.bent.is_none() && self.beside_rad < 0.0;
        let about_pole = if is_behind { Series::atan2(-s, -eta).plus(PI) } else { Series::atan2(s, eta) };
        // x/r from 1 − cos = r²/(1 + cos), and what the pole itself misses.
        let at_pole = frame.at_pole(self.sign);
        // A share of the distance from the axis.
        let mut x = (radius.divided_by(upright.plus(1.0))).scaled(self.sign * frame.between / frame.sine);
        if at_pole != 0.0 {
            x = x + Series::constant(at_pole / frame.sine).divided_by(radius);
        }
        let square = (x * x).scaled(-1.0).plus(1.0);
        if square.0[0].is_nan() || square.0[0] <= 0.0 {
            let missing_rad = ((x.0[0].abs() - 1.0) * radius.0[0].abs()).max(0.0);
            return Err(KinematicsError::Unreachable { missing_rad });
        }
        let y = square.sqrt().scaled(self.branch);
        let first = about_pole.scaled(self.sign) - Series::atan2(y, x);
        let axial = upright.scaled(self.sign);
        let (along, across) = (radius * x, radius * y);
        let middle: SeriesVec<N> = core::array::from_fn(|k| {
            axial.scaled(self.first[k]) + along.scaled(frame.e1[k]) + across.scaled(frame.e2[k])
        });
        let [cosine, sine] = frame.rows.map(|row| dot_constant(row, &middle));
        let second = Series::atan2(sine, cosine);
        Ok([first.plus(self.azimuth_rad), second])
    }
}

/// sin x / x for |x| ≤ 0.1, of x².
fn sinc<const N: usize>(square: Series<N>) -> Series<N> {
    let tail = square.scaled(1.0 / 362_880.0).plus(-1.0 / 5_040.0);
    let tail = (tail * square).plus(1.0 / 120.0);
    ((tail * square).plus(-1.0 / 6.0) * square).plus(1.0)
}
