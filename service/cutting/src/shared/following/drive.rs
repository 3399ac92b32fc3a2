//! One drive: a moving-average filter, a position loop and the velocity loop inside it, as a transfer function.

use core::f64::consts::{PI, TAU};

use feedwave_motion::{ProfileProblem, sin_turns};
use serde::{Deserialize, Serialize};

/// Highest frequency of a velocity loop, Hz.
const MAX_LOOP_FREQUENCY_HZ: f64 = 1e5;
/// Largest damping of a velocity loop.
const MAX_DAMPING: f64 = 10.0;
/// Below this gain nothing arrives: the rounding of f·T_f alone leaves this much of a vibration at a zero of the
/// filter.
const ERASED_GAIN: f64 = 1e-12;
/// Below this angle, rad, sin x/x − 1 is taken from its series, whose next term is below 1e-19.
const SMALL_RAD: f64 = 1e-3;

/// One drive between setpoint and position: what is `None` passes everything.
///
/// A moving average of length T behind interpolation, then the cascade of a position loop around a velocity loop
/// (Gross, Hamann, Wiegärtner: Electrical Feed Drives in Automation, Publicis 2001, position and velocity control;
/// Altintas: Manufacturing Automation, 2nd ed., Cambridge 2012, chapter 5). With the commanded position r and the
/// position x, K the gain of the position loop, k the share of the commanded velocity that is fed forward, and V the
/// velocity loop:
///
/// ```text
/// ẋ = V·(K·(r − x) + k·ṙ)            V(s) = 1/(1 + a₁·s + a₂·s²)
/// G(s) = x/r = (K + k·s) / (K + s + a₁·s² + a₂·s³)
/// H(s) = G(s)·(1 − e^(−s·T))/(s·T)
/// ```
///
/// - no velocity loop (a₁ = a₂ = 0): first order;
/// - a velocity loop of frequency f_v without damping: a first-order lag, a₁ = 1/(2πf_v), a₂ = 0; the position loop is of
///   second order with natural frequency √(K/a₁) and damping 1/(2·√(K·a₁)), stable for every K > 0;
/// - with damping ζ: a₁ = 2ζ/(2πf_v), a₂ = 1/(2πf_v)²; of third order, stable where K < a₁/a₂ = 2ζ·2πf_v (Routh and
///   Hurwitz).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveModel {
    /// Length T of a moving-average filter behind interpolation, s.
    pub filter_length_s: Option<f64>,
    /// Gain K of the position loop, 1/s.
    pub position_loop_gain_per_s: Option<f64>,
    /// Frequency f_v of the velocity loop, Hz: its corner, or with a damping its natural frequency.
    pub velocity_loop_frequency_hz: Option<f64>,
    /// Damping ζ of the velocity loop; `None` for one of first order.
    pub velocity_loop_damping: Option<f64>,
    /// Share k of the commanded velocity that is fed forward, 0 to 1.
    pub velocity_feed_forward: f64,
}

/// A value of a transfer function, or any other complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Response {
    pub(crate) re: f64,
    pub(crate) im: f64,
}

impl Response {
    pub(crate) fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    pub(crate) fn minus(self, other: Self) -> Self {
        self.plus(other.scaled(-1.0))
    }

    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }

    fn over(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        self.times(Self { re: other.re / square, im: -other.im / square })
    }

    pub(crate) fn magnitude(self) -> f64 {
        libm::hypot(self.re, self.im)
    }

    /// By how much what it stands for lags, rad from 0 to 2π.
    pub(crate) fn lag_rad(self) -> f64 {
        within_turn(-libm::atan2(self.im, self.re))
    }
}

/// Numerator and denominator of G at s = iω, and G − 1 over the same denominator without cancellation.
struct Loop {
    numerator: Response,
    denominator: Response,
    less_one: Response,
}

impl DriveModel {
    /// Whether it states anything that changes a motion.
    #[must_use]
    pub const fn is_stated(&self) -> bool {
        self.filter_length_s.is_some() || self.position_loop_gain_per_s.is_some()
    }

    /// a₁ and a₂, s and s².
    fn velocity_loop(&self) -> [f64; 2] {
        let Some(frequency_hz) = self.velocity_loop_frequency_hz else { return [0.0; 2] };
        let lag_s = 1.0 / (TAU * frequency_hz);
        self.velocity_loop_damping.map_or([lag_s, 0.0], |damping| [2.0 * damping * lag_s, lag_s * lag_s])
    }

    fn position_loop(&self, rad_per_s: f64) -> Option<Loop> {
        let gain_per_s = self.position_loop_gain_per_s?;
        let [a1, a2] = self.velocity_loop();
        let (square, forward) = (rad_per_s * rad_per_s, self.velocity_feed_forward);
        let (inertia, jerk) = (a1 * square, a2 * square * rad_per_s);
        Some(Loop {
            numerator: Response { re: gain_per_s, im: forward * rad_per_s },
            denominator: Response { re: gain_per_s - inertia, im: rad_per_s - jerk },
            less_one: Response { re: inertia, im: (forward - 1.0) * rad_per_s + jerk },
        })
    }

    /// |sinc(f·T)| of the filter: exactly 1 at 0 and exactly 0 at the other whole f·T.
    #[must_use]
    pub fn filter_gain(&self, frequency_hz: f64) -> f64 {
        self.filter_length_s.map_or(1.0, |length_s| {
            let periods = frequency_hz * length_s;
            if periods == 0.0 { 1.0 } else { (sin_turns(0.5 * periods) / (PI * periods)).abs() }
        })
    }

    /// Lag of the filter, rad from 0 to π: half its length, less the half turns at which its gain changes its sign.
    fn filter_lag_rad(&self, frequency_hz: f64) -> f64 {
        self.filter_length_s.map_or(0.0, |length_s| {
            let periods = frequency_hz * length_s;
            PI * (periods - periods.floor())
        })
    }

    /// |G| of the position loop.
    #[must_use]
    pub fn loop_gain(&self, frequency_hz: f64) -> f64 {
        self.position_loop(TAU * frequency_hz).map_or(1.0, |it| it.numerator.magnitude() / it.denominator.magnitude())
    }

    /// Lag of the position loop, rad from 0 to 3π/2.
    #[must_use]
    pub fn loop_lag_rad(&self, frequency_hz: f64) -> f64 {
        self.position_loop(TAU * frequency_hz).map_or(0.0, |it| {
            let lead = libm::atan2(it.numerator.im, it.numerator.re);
            // Beyond half a turn the denominator of a stable loop is in the third quadrant.
            within_turn(libm::atan2(it.denominator.im, it.denominator.re)) - lead
        })
    }

    /// Gain of filter and position loop together.
    #[must_use]
    pub fn gain(&self, frequency_hz: f64) -> f64 {
        self.filter_gain(frequency_hz) * self.loop_gain(frequency_hz)
    }

    /// Lag of filter and position loop together, rad from 0 to 2π.
    #[must_use]
    pub fn lag_rad(&self, frequency_hz: f64) -> f64 {
        within_turn(self.filter_lag_rad(frequency_hz) + self.loop_lag_rad(frequency_hz))
    }

    /// H at a frequency.
    pub(crate) fn response(&self, frequency_hz: f64) -> Response {
        let (gain, lag_rad) = (self.gain(frequency_hz), self.lag_rad(frequency_hz));
        let (sine, cosine) = libm::sincos(lag_rad);
        Response { re: gain * cosine, im: -gain * sine }
    }

    /// H − 1 at ω, rad/s, with all its digits where it is small.
    pub(crate) fn error(&self, rad_per_s: f64) -> Response {
        let filter = self.filter_length_s.map_or(Response::default(), |length_s| {
            let x = 0.5 * rad_per_s * length_s;
            if x == 0.0 {
                return Response::default();
            }
            let sine = libm::sin(x);
            let double = 2.0 * x;
            let square = double * double;
            let re = if double.abs() < SMALL_RAD {
                square * (square / 120.0 - 1.0 / 6.0)
            } else {
                libm::sin(double) / double - 1.0
            };
            Response { re, im: -sine * sine / x }
        });
        let lag = self.position_loop(rad_per_s).map_or(Response::default(), |it| it.less_one.over(it.denominator));
        // (1 + F)(1 + G) − 1
        filter.plus(lag).plus(filter.times(lag))
    }

    /// By how much it lags a steady motion, s: half the filter, and what the feed-forward leaves of 1/K.
    #[must_use]
    pub fn steady_lag_s(&self) -> f64 {
        let filter_s = 0.5 * self.filter_length_s.unwrap_or(0.0);
        filter_s
            + self.position_loop_gain_per_s.map_or(0.0, |gain_per_s| (1.0 - self.velocity_feed_forward) / gain_per_s)
    }

    /// What to command so that `wanted` arrives where this much of it does; `None` where nothing does.
    #[must_use]
    pub fn command_for(wanted: f64, gain: f64) -> Option<f64> {
        (gain > ERASED_GAIN).then(|| wanted / gain)
    }

    /// Everything that makes it unusable, with the field; empty when it is valid.
    #[must_use]
    pub fn problems(&self) -> Vec<ProfileProblem> {
        let mut problems = Vec::new();
        let mut refuse = |field: &str, message: String| {
            problems.push(ProfileProblem { field: field.to_owned(), message });
        };
        for (field, value) in
            [("filter_length_s", self.filter_length_s), ("position_loop_gain_per_s", self.position_loop_gain_per_s)]
        {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                refuse(field, format!("must be a positive finite number, is {value}"));
            }
        }
        for (field, value, most) in [
            ("velocity_loop_frequency_hz", self.velocity_loop_frequency_hz, MAX_LOOP_FREQUENCY_HZ),
            ("velocity_loop_damping", self.velocity_loop_damping, MAX_DAMPING),
        ] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && *value <= most)) {
                refuse(field, format!("must be above 0 and at most {most}, is {value}"));
            }
        }
        if !(0.0..=1.0).contains(&self.velocity_feed_forward) {
            let message = format!("must lie between 0 and 1, is {}", self.velocity_feed_forward);
            refuse("velocity_feed_forward", message);
        }
        if self.velocity_loop_damping.is_some() && self.velocity_loop_frequency_hz.is_none() {
            refuse("velocity_loop_damping", "needs velocity_loop_frequency_hz".to_owned());
        }
        let needs_loop = [
            ("velocity_loop_frequency_hz", self.velocity_loop_frequency_hz.is_some()),
            ("velocity_feed_forward", self.velocity_feed_forward != 0.0),
        ];
        for (field, _) in
            needs_loop.into_iter().filter(|(_, stated)| *stated && self.position_loop_gain_per_s.is_none())
        {
            refuse(field, "needs position_loop_gain_per_s".to_owned());
        }
        if problems.is_empty()
            && let (Some(gain_per_s), [a1, a2]) = (self.position_loop_gain_per_s, self.velocity_loop())
            && a2 > 0.0
            && gain_per_s >= a1 / a2
        {
            let message = format!(
                "the loop is unstable: with this velocity loop the gain must be below {}, is {gain_per_s}",
                a1 / a2
            );
            problems.push(ProfileProblem { field: "position_loop_gain_per_s".to_owned(), message });
        }
        problems
    }
}

/// An angle, rad, from 0 to below a turn.
fn within_turn(angle_rad: f64) -> f64 {
    let rest = angle_rad - TAU * (angle_rad / TAU).floor();
    // Rounding of a tiny negative angle.
    if rest >= TAU { 0.0 } else { rest }
}
