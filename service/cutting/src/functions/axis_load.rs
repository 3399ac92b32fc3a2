//! What a function asks of an axis against the limit of velocity, acceleration or jerk.

use std::borrow::Cow;

use feedwave_motion::Quantity;
use feedwave_program::{Finding, FindingCode};

/// The quantities that an axis has limits of, in the order of their derivatives.
pub(crate) const QUANTITIES: [Quantity; 3] = [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk];

/// A function's codes for what exceeds an axis' velocity, acceleration and jerk.
pub(crate) type AxisCodes = [FindingCode; 3];

/// What is asked of one limit of an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisLoad {
    pub(crate) quantity: Quantity,
    /// Whether the axis is a rotary one.
    pub(crate) rotary: bool,
    pub(crate) demanded: f64,
    pub(crate) limit: f64,
}

impl AxisLoad {
    /// Loads of a linear axis from demands and limits in the order of [`QUANTITIES`].
    pub(crate) fn of_linear(demanded: [f64; 3], limits: [f64; 3]) -> [Self; 3] {
        core::array::from_fn(|index| Self {
            quantity: QUANTITIES[index],
            rotary: false,
            demanded: demanded[index],
            limit: limits[index],
        })
    }

    /// Whether the limit is exceeded by more than this share of it.
    pub(crate) fn exceeds(&self, rounding: f64) -> bool {
        self.demanded > self.limit * (1.0 + rounding)
    }

    /// The power of the frequency that it grows with.
    pub(crate) fn order(&self) -> f64 {
        match self.quantity {
            Quantity::Velocity => 1.0,
            Quantity::Acceleration => 2.0,
            Quantity::Jerk => 3.0,
        }
    }

    pub(crate) fn unit(&self) -> &'static str {
        self.quantity.unit(self.rotary)
    }

    pub(crate) fn code(&self, [velocity, acceleration, jerk]: &AxisCodes) -> FindingCode {
        match self.quantity {
            Quantity::Velocity => *velocity,
            Quantity::Acceleration => *acceleration,
            Quantity::Jerk => *jerk,
        }
    }

    /// Adds the numbers to the finding that the limit is exceeded; `about` says of which axis or direction.
    pub(crate) fn with_numbers(&self, finding: Finding, about: impl Into<Cow<'static, str>>) -> Finding {
        finding.ranked(about, self.demanded / self.limit).with_value("demanded", self.demanded, self.unit()).with_value(
            "limit",
            self.limit,
            self.unit(),
        )
    }
}
