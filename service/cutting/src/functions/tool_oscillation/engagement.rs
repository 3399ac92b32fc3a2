//! Where the work is around the tool.

use serde::{Deserialize, Serialize};

/// Azimuths between which the tool is in the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Engagement {
    /// A full slot: the whole front half.
    #[default]
    Slot,
    /// From entry to exit of an edge, degrees from the feed direction in the direction of rotation, within ±90.
    Angles {
        /// Where an edge enters the work.
        entry_deg: f64,
        /// Where it leaves the work, beyond the entry.
        exit_deg: f64,
    },
    /// A stock of this width beside the path that the tool takes away.
    Width {
        /// Radial engagement, mm: from the side of the tool, more than 0 and at most its diameter.
        width_mm: f64,
        /// Side of the path on which the work is.
        side: WorkSide,
    },
}

/// Side of the path on which the work is, looking along the feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorkSide {
    /// To the left: with a clockwise spindle the edges cut against the feed (conventional milling).
    Left,
    /// To the right: with a clockwise spindle the edges cut with the feed (climb milling).
    Right,
}

impl Engagement {
    /// Entry and exit of an edge, degrees from the feed direction in the direction of rotation.
    #[must_use]
    pub fn azimuths_deg(&self, radius_mm: f64, clockwise: bool) -> [f64; 2] {
        match *self {
            Self::Slot => [-90.0, 90.0],
            Self::Angles { entry_deg, exit_deg } => [entry_deg, exit_deg],
            Self::Width { width_mm, side } => {
                let inner_deg = libm::asin(((radius_mm - width_mm) / radius_mm).clamp(-1.0, 1.0)).to_degrees();
                // A clockwise spindle takes the edges from the feed direction to the right.
                if (side == WorkSide::Right) == clockwise { [inner_deg, 90.0] } else { [-90.0, -inner_deg] }
            }
        }
    }

    /// What makes it impossible for every tool, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        match *self {
            Self::Slot => None,
            Self::Angles { entry_deg, exit_deg } => {
                // NaN is refused as well.
                let is_possible = entry_deg >= -90.0 && exit_deg <= 90.0 && entry_deg < exit_deg;
                (!is_possible)
                    .then(|| format!("must lead from −90 or more to 90 degrees or less, is {entry_deg} to {exit_deg}"))
            }
            Self::Width { width_mm, .. } => (!(width_mm > 0.0 && width_mm <= MAX_WIDTH_MM))
                .then(|| format!("must be more than 0 and at most {MAX_WIDTH_MM} mm wide, is {width_mm}")),
        }
    }
}

/// Diameter of the largest tool, mm.
const MAX_WIDTH_MM: f64 = 2_000.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_is_the_azimuths_of_its_side() {
        let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-9 && (b - d).abs() < 1e-9;
        let of = |width_mm, side, clockwise| Engagement::Width { width_mm, side }.azimuths_deg(10.0, clockwise);
        assert!(near(of(5.0, WorkSide::Right, true), [30.0, 90.0]));
        assert!(near(of(5.0, WorkSide::Right, false), [-90.0, -30.0]));
        assert!(near(of(5.0, WorkSide::Left, true), [-90.0, -30.0]));
        assert!(near(of(15.0, WorkSide::Left, false), [-30.0, 90.0]));
        assert!(near(of(20.0, WorkSide::Left, true), Engagement::Slot.azimuths_deg(10.0, true)));
    }

    #[test]
    fn impossible_engagements_are_named() {
        let side = WorkSide::Left;
        for wrong in [
            Engagement::Angles { entry_deg: -91.0, exit_deg: 0.0 },
            Engagement::Angles { entry_deg: 20.0, exit_deg: 20.0 },
            Engagement::Angles { entry_deg: f64::NAN, exit_deg: 20.0 },
            Engagement::Width { width_mm: 0.0, side },
            Engagement::Width { width_mm: f64::INFINITY, side },
        ] {
            assert!(wrong.problem().is_some(), "{wrong:?}");
        }
        assert_eq!(Engagement::Width { width_mm: 3.0, side }.problem(), None);
    }
}
