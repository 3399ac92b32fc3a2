//! How a motion ends while another one begins, of one parameter: at the corner between a line of the tool centre point and a turn
//! of the tool at rest, and the other way round.
//!
//! With x from 0 to 1, of what ends the part (1 − x)³ of its last a is left, and of what begins x³ of its first b is done: each as it is at
//! constant jerk, both in the same time. The parameter of the element is what both have done together,
//!
//! ```text
//! σ(x) = a·(1 − (1 − x)³) + b·x³,   0 ≤ σ ≤ a + b
//! ```
//!
//! so that neither is faster than σ, and where one of them rests, the other one has the slope 1 and no second derivative by σ: both meet
//! the rest of their blocks smoothly.

use serde::{Deserialize, Serialize};

/// What a motion does at a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ease {
    /// It comes to rest.
    Ends,
    /// It starts from rest.
    Begins,
}

/// Two motions of which one ends while the other begins: a and b, each mm of a line or degrees of a turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Easing {
    pub(crate) ends: f64,
    pub(crate) begins: f64,
}

/// Most steps to a parameter: halvings alone would be enough.
const MOST_STEPS: usize = 64;

impl Ease {
    /// Its part that is done at x.
    fn done(self, x: f64) -> f64 {
        match self {
            Self::Ends => 1.0 - (1.0 - x) * (1.0 - x) * (1.0 - x),
            Self::Begins => x * x * x,
        }
    }

    /// The derivative of that.
    const fn slope(self, x: f64) -> f64 {
        match self {
            Self::Ends => 3.0 * (1.0 - x) * (1.0 - x),
            Self::Begins => 3.0 * x * x,
        }
    }
}

impl Easing {
    /// Length of the element.
    pub(crate) const fn length(&self) -> f64 {
        self.ends + self.begins
    }

    fn done(&self, x: f64) -> f64 {
        self.ends * Ease::Ends.done(x) + self.begins * Ease::Begins.done(x)
    }

    const fn slope(&self, x: f64) -> f64 {
        self.ends * Ease::Ends.slope(x) + self.begins * Ease::Begins.slope(x)
    }

    /// x where both have done `done` together: Newton's method, kept within halves.
    pub(crate) fn parameter(&self, done: f64) -> f64 {
        if done <= 0.0 {
            return 0.0;
        }
        if done >= self.length() {
            return 1.0;
        }
        let [mut low, mut high] = [0.0, 1.0];
        let mut x = done / self.length();
        for _ in 0..MOST_STEPS {
            let missing = done - self.done(x);
            if missing > 0.0 {
                low = x;
            } else {
                high = x;
            }
            let next = x + missing / self.slope(x);
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            if next == x {
                break;
            }
            x = next;
        }
        x
    }

    /// The part that one of them has done at a share of the element.
    pub(crate) fn share(&self, ease: Ease, share: f64) -> f64 {
        ease.done(self.parameter(share * self.length()))
    }

    /// The derivative of that by the share.
    pub(crate) fn share_slope(&self, ease: Ease, share: f64) -> f64 {
        let x = self.parameter(share * self.length());
        ease.slope(x) * (self.length() / self.slope(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parameter_is_what_both_have_done() {
        for (ends, begins) in [(1.0, 1.0), (0.05, 2.0), (30.0, 0.1), (1e-4, 1e-4)] {
            let easing = Easing { ends, begins };
            for step in 0..=1_000 {
                let share = f64::from(step) / 1_000.0;
                let x = easing.parameter(easing.length() * share);
                assert!((0.0..=1.0).contains(&x), "{x}");
                assert!((easing.done(x) - easing.length() * share).abs() <= 1e-15 * easing.length(), "{share}: {x}");
                // Neither is faster than both.
                let [ended, begun] = [Ease::Ends, Ease::Begins].map(|ease| easing.share_slope(ease, share));
                let speeds = [ended * ends, begun * begins].map(|speed| speed / easing.length());
                assert!(speeds.iter().all(|speed| (0.0..=1.0 + 1e-12).contains(speed)), "{speeds:?}");
                assert!((speeds[0] + speeds[1] - 1.0).abs() < 1e-12, "{speeds:?}");
            }
            // With no second derivative where the other one rests, which has done a/b·(1e-4)²/27 of the step there.
            let step = 1e-4 * ends.min(begins);
            let after = ends * easing.share(Ease::Ends, step / easing.length());
            let before = begins * (1.0 - easing.share(Ease::Begins, 1.0 - step / easing.length()));
            assert!((after - step).abs() < 1e-6 * step && (before - step).abs() < 1e-6 * step, "{after} {before}");
        }
    }
}
