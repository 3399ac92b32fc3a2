//! What is cut: the thread and the section of its groove (docs/functions/thread-vibration.md, "Program words" and
//! "Infeed, tapers and run-up").
//!
//! All lengths of this module are on the radius. *Travel* is the distance of the lead axis from the thread's start
//! position in the direction of the cut, so that nothing here depends on the direction of Z.

use serde::{Deserialize, Serialize};

/// Which side of the work carries the thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThreadSide {
    /// On the outside: deeper is towards smaller X.
    #[default]
    External,
    /// In a bore: deeper is towards larger X.
    Internal,
}

/// Hand of a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hand {
    /// Right hand.
    #[default]
    Right,
    /// Left hand.
    Left,
}

/// Direction of the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpindleRotation {
    /// `M3`: cutting towards the chuck (−Z) makes a right-hand thread.
    #[default]
    Forward,
    /// `M4`: cutting towards the chuck makes a left-hand thread.
    Reverse,
}

/// A straight or tapered thread with one or more starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadGeometry {
    /// Outside or inside.
    pub side: ThreadSide,
    /// Diameter of the uncut work at [`Self::start_z_mm`], mm.
    pub work_diameter_mm: f64,
    /// Where the lead axis starts, mm; before the work by the approach length.
    pub start_z_mm: f64,
    /// Where the thread ends, mm.
    pub end_z_mm: f64,
    /// Change of the work's radius per travel of the lead axis, mm/mm; 0 for a straight thread.
    pub taper: f64,
    /// Lead, mm per revolution.
    pub lead_mm: f64,
    /// Number of starts.
    pub starts: u32,
    /// Direction of the spindle.
    pub rotation: SpindleRotation,
}

impl ThreadGeometry {
    /// Pitch, mm: lead divided by the number of starts.
    #[must_use]
    pub fn pitch_mm(&self) -> f64 {
        self.lead_mm / f64::from(self.starts.max(1))
    }

    /// +1 where the cut goes towards +Z, −1 towards −Z.
    #[must_use]
    pub fn direction(&self) -> f64 {
        if self.end_z_mm < self.start_z_mm { -1.0 } else { 1.0 }
    }

    /// Travel of the lead axis from start to end, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        (self.end_z_mm - self.start_z_mm).abs()
    }

    /// Hand of the thread that this direction of cut and spindle makes.
    #[must_use]
    pub fn hand(&self) -> Hand {
        let towards_chuck = self.direction() < 0.0;
        if towards_chuck == (self.rotation == SpindleRotation::Forward) { Hand::Right } else { Hand::Left }
    }

    /// +1 where deeper means a smaller radius, −1 where it means a larger one.
    #[must_use]
    pub(crate) fn inwards(&self) -> f64 {
        match self.side {
            ThreadSide::External => 1.0,
            ThreadSide::Internal => -1.0,
        }
    }

    /// Radius of the tool tip at a depth below the work's surface, mm.
    #[must_use]
    pub fn radius_mm(&self, depth_mm: f64, travel_mm: f64) -> f64 {
        0.5 * self.work_diameter_mm + self.taper * travel_mm - self.inwards() * depth_mm
    }

    /// Z at a travel, mm.
    #[must_use]
    pub fn z_mm(&self, travel_mm: f64) -> f64 {
        self.start_z_mm + self.direction() * travel_mm
    }
}

/// Section of the groove that the tool cuts: symmetric flanks and a flat at the root.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrooveProfile {
    /// Included angle 2β of the flanks, degrees: 60 for metric, 55 for Whitworth, 30 for trapezoidal threads.
    pub included_angle_deg: f64,
    /// Width of the tool's tip along the lead, mm; 0 for a pointed tool.
    pub root_flat_mm: f64,
}

impl GrooveProfile {
    /// A pointed tool with this included angle, degrees.
    #[must_use]
    pub const fn pointed(included_angle_deg: f64) -> Self {
        Self { included_angle_deg, root_flat_mm: 0.0 }
    }

    /// tan β of the half angle.
    #[must_use]
    pub fn tan_half_angle(&self) -> f64 {
        libm::tan(0.5 * self.included_angle_deg.to_radians())
    }

    /// Width of the groove at the work's surface, mm, when the tip is at this depth.
    #[must_use]
    pub fn width_mm(&self, depth_mm: f64) -> f64 {
        self.root_flat_mm + 2.0 * depth_mm * self.tan_half_angle()
    }

    /// Depth to which a tool whose tip is at `tip_depth_mm` cuts at an axial distance from its middle, mm.
    #[must_use]
    pub fn depth_at_mm(&self, tip_depth_mm: f64, distance_mm: f64) -> f64 {
        tip_depth_mm - (distance_mm.abs() - 0.5 * self.root_flat_mm).max(0.0) / self.tan_half_angle()
    }
}
