//! How the feed lies to the tool axis: the unit feed direction x̂ = c·ĥ + s·ẑ has a part c across the tool, along ĥ, and a part s
//! along its axis ẑ, c² + s² = 1. On a level cut c = 1 and s = 0; where the path climbs or descends an offset u·x̂ is c·u across
//! the tool and s·u along it.

use feedwave_motion::Element;
use feedwave_motion::kinematics::ToolFrame;
use feedwave_motion::kinematics::vector::Vec3;
use serde::{Deserialize, Serialize};

use super::feed_direction::heading;

/// A unit feed direction in the directions of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FeedDirection {
    /// ĥ, the direction of its part across the tool.
    pub(crate) plane: [f64; 2],
    /// c, its part across the tool, 0 to 1.
    pub(crate) across: f64,
    /// s, its part along the tool axis, positive away from the work.
    pub(crate) along: f64,
}

/// A part along the axis that is no more than how closely the axes of a guided tool follow their direction: what it moves an offset by is
/// beyond the last digit of any setpoint.
const ROUNDING: f64 = 1e-10;

impl FeedDirection {
    /// Of a direction of any length by its components across and along the tool. Where nothing is across, which the builder
    /// refuses, ĥ is the first direction.
    pub(crate) fn of([x, y, z]: Vec3) -> Self {
        let square = x * x + y * y;
        let (in_plane, length) = (square.sqrt(), (square + z * z).sqrt());
        let plane = if in_plane > 0.0 { [x / in_plane, y / in_plane] } else { [1.0, 0.0] };
        if z.abs() <= ROUNDING * length {
            // Level to the last bit.
            return Self { plane, across: 1.0, along: 0.0 };
        }
        Self { plane, across: in_plane / length, along: z / length }
    }
}

/// How much of the feed direction is across the tool and along it at most along an element: rounded up, so that neighbouring
/// elements have the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Slope {
    /// c at most.
    pub(crate) across: f64,
    /// |s| at most.
    pub(crate) along: f64,
    /// By how much c and s change at most, by mm of the path, rounded up to a power of two.
    pub(crate) change_per_mm: f64,
}

/// Steps in which c and |s| are rounded up.
const STEPS: f64 = 32.0;
/// What is left to rounding when they are.
const SLACK: f64 = 1e-6;
/// Parts that differ by less are the same.
const SAME: f64 = 1e-9;
/// Least |s| that is told from a level cut: less is rounding of the program's words, and tilts the end of a tool of 100 mm by 1 µm.
const LEAST_ALONG: f64 = 1e-5;
/// Least places between which a stretch that turns is examined.
const LEAST_PLACES: f64 = 8.0;
/// Places for each radian that it may turn by, and most of one stretch.
const PLACES_PER_RAD: f64 = 32.0;
const MOST_PLACES: f64 = 256.0;
/// Least change for each mm that is told from none.
const LEAST_CHANGE: f64 = 1.0 / 1_048_576.0;

impl Slope {
    /// Of a cut square to the tool axis.
    pub(crate) const LEVEL: Self = Self { across: 1.0, along: 0.0, change_per_mm: 0.0 };

    pub(crate) fn is_level(&self) -> bool {
        *self == Self::LEVEL
    }

    /// Which of the 33 steps of |s| it is.
    pub(crate) fn step(&self) -> u32 {
        (self.along * STEPS) as u32
    }

    /// Of an element, and its inclination where it is steepest, degrees from 0 to 90.
    ///
    /// x̂ turns by at most the rates of [`Element::turnings`], and c and s by no more than it: between two places they are at most
    /// their mean and half of what that is over the distance. Where all places have the same, they are constant.
    pub(crate) fn of(frame: Option<&ToolFrame>, element: &Element) -> (Self, f64) {
        let at = |s: f64| {
            let [x, y, z, ..] = heading(frame, element, s);
            let FeedDirection { across, along, .. } = FeedDirection::of([x, y, z]);
            [across, along]
        };
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut most, mut rate_per_mm) = ([0.0_f64; 2], 0.0_f64);
        let mut start_mm = 0.0;
        for turning in element.turnings() {
            let length_mm = turning.end_mm - start_mm;
            let per_mm = turning.path_rad_per_mm + turning.rotary_rad_per_mm;
            let turned_rad = per_mm * length_mm;
            let places = if turned_rad > 0.0 {
                (PLACES_PER_RAD * turned_rad).ceil().clamp(LEAST_PLACES, MOST_PLACES)
            } else {
                1.0
            };
            let mut before = at(start_mm);
            for place in 1..=places as u32 {
                let here = at(start_mm + length_mm * f64::from(place) / places);
                for part in 0..2 {
                    low[part] = low[part].min(before[part]).min(here[part]);
                    high[part] = high[part].max(before[part]).max(here[part]);
                    let mean = 0.5 * (before[part].abs() + here[part].abs());
                    most[part] = most[part].max(mean + 0.5 * turned_rad / places);
                }
                before = here;
            }
            rate_per_mm = rate_per_mm.max(per_mm);
            start_mm = turning.end_mm;
        }
        let steepest = high[1].max(-low[1]).clamp(0.0, 1.0);
        if steepest < LEAST_ALONG {
            return (Self::LEVEL, 0.0);
        }
        let is_constant = (0..2).all(|part| high[part] - low[part] <= SAME);
        let [across, along] = if is_constant { [high[0], steepest] } else { most };
        let up = |share: f64| (libm::ceil((share * STEPS) - SLACK) / STEPS).min(1.0);
        let slope = Self {
            across: up(across),
            along: up(along),
            change_per_mm: if is_constant { 0.0 } else { power_of_two(rate_per_mm) },
        };
        (slope, libm::asin(steepest).to_degrees())
    }
}

/// Rounded up to a power of two, at least [`LEAST_CHANGE`].
pub(super) fn power_of_two(value: f64) -> f64 {
    let mut rounded = LEAST_CHANGE;
    while rounded < value {
        rounded *= 2.0;
    }
    rounded
}
