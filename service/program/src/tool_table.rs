//! The table of tool offsets: what `H`, `D` and the offset number of a lathe's `T` word name.

use serde::{Deserialize, Serialize};

use crate::{Axis, Position};

/// One row of the table of tool offsets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ToolOffset {
    /// Number of the row: `H`, `D`, the offset number of a lathe's `T` word, the tool number in LinuxCNC.
    pub number: u32,
    /// From the machine's control point to the tip, mm, X a radius; Z is the length of a mill's tool. `None` where it is not
    /// known, so that nothing is moved by it.
    pub geometry: Option<Position>,
    /// Wear, which is added to the geometry, mm, X a radius.
    pub wear: Position,
    /// Radius of the cutter, or of the nose of a turning tool, mm. `None` where it is not known.
    pub radius_mm: Option<f64>,
    /// Wear of the radius, which is added to it, mm.
    pub radius_wear_mm: f64,
    /// Place of the nose's centre from the imaginary tip, FANUC's numbers 0 to 9.
    pub tip: u8,
    /// Angle of the front edge, degrees.
    pub front_angle_deg: f64,
    /// Angle of the back edge, degrees.
    pub back_angle_deg: f64,
}

impl ToolOffset {
    /// An empty row.
    #[must_use]
    pub fn new(number: u32) -> Self {
        Self { number, ..Self::default() }
    }

    /// With a tool length, mm.
    #[must_use]
    pub fn with_length(mut self, length_mm: f64) -> Self {
        self.geometry.get_or_insert_default()[Axis::Z.index()] = length_mm;
        self
    }

    /// With the radius of a cutter or a nose, mm.
    #[must_use]
    pub fn with_radius(mut self, radius_mm: f64) -> Self {
        self.radius_mm = Some(radius_mm);
        self
    }

    /// Geometry and wear together, mm; `None` where the geometry is not known.
    #[must_use]
    pub fn total(&self) -> Option<Position> {
        let geometry = self.geometry?;
        Some(core::array::from_fn(|axis| geometry[axis] + self.wear[axis]))
    }

    /// Radius with its wear, mm; `None` where the radius is not known.
    #[must_use]
    pub fn total_radius_mm(&self) -> Option<f64> {
        Some(self.radius_mm? + self.radius_wear_mm)
    }

    /// Length of a mill's tool with its wear, mm.
    #[must_use]
    pub fn length_mm(&self) -> Option<f64> {
        self.total().map(|total| total[Axis::Z.index()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wear_is_added_to_what_is_known_only() {
        let wear = [0.1, 0.0, -0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let bare = ToolOffset { wear, radius_wear_mm: -0.05, ..ToolOffset::new(3) };
        assert_eq!((bare.total(), bare.length_mm(), bare.total_radius_mm()), (None, None, None));
        let measured = bare.with_length(120.5).with_radius(4.0);
        assert_eq!(measured.total(), Some([0.1, 0.0, 120.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        assert_eq!((measured.length_mm(), measured.total_radius_mm()), (Some(120.25), Some(3.95)));
    }
}
