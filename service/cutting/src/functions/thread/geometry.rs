//! What is cut: the thread and the section of its groove (docs/functions/thread-vibration.md, "Program words" and
//! "Infeed, tapers and run-up").
//!
//! *Travel* is the distance of the lead axis from the thread's start position in the direction of the cut, *depth* the
//! distance of the tool from the work's surface across the lead, so that nothing here depends on the direction of an axis.
//! Lengths along X are on the radius.

use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

/// Which side of the work carries the thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThreadSide {
    /// On the outside: deeper is towards smaller X. On a face: deeper is towards smaller Z.
    #[default]
    External,
    /// In a bore: deeper is towards larger X. On a face from behind: deeper is towards larger Z.
    Internal,
}

/// The axis of a lathe along which a thread advances; the tool goes deeper, and vibrates, across it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeadAxis {
    /// Straight threads and tapers up to 45°.
    #[default]
    Z,
    /// Threads on a face: scrolls.
    X,
}

impl LeadAxis {
    /// The axis of the lead.
    #[must_use]
    pub const fn along(self) -> Axis {
        match self {
            Self::Z => Axis::Z,
            Self::X => Axis::X,
        }
    }

    /// The axis across the lead.
    #[must_use]
    pub const fn across(self) -> Axis {
        match self {
            Self::Z => Axis::X,
            Self::X => Axis::Z,
        }
    }

    /// Where a length across the lead is, for messages.
    pub(crate) const fn across_words(self) -> &'static str {
        match self {
            Self::Z => "on the radius",
            Self::X => "along Z",
        }
    }

    /// X on the radius and Z of a place.
    pub(crate) const fn place(self, across_mm: f64, along_mm: f64) -> [f64; 2] {
        match self {
            Self::Z => [across_mm, along_mm],
            Self::X => [along_mm, across_mm],
        }
    }
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
    /// Axis of the lead.
    pub lead_axis: LeadAxis,
    /// Outside or inside.
    pub side: ThreadSide,
    /// Surface of the uncut work at [`Self::start_mm`], across the lead: its radius, or Z of the face, mm.
    pub work_mm: f64,
    /// Where the lead axis starts, Z or a radius, mm; before the work by the approach length.
    pub start_mm: f64,
    /// Where the thread ends, Z or a radius, mm.
    pub end_mm: f64,
    /// Change of the work's surface per travel of the lead axis, mm/mm; 0 for a straight thread.
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

    /// +1 where the cut goes towards larger Z, or X, −1 towards smaller.
    #[must_use]
    pub fn direction(&self) -> f64 {
        if self.end_mm < self.start_mm { -1.0 } else { 1.0 }
    }

    /// Travel of the lead axis from start to end, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        (self.end_mm - self.start_mm).abs()
    }

    /// Hand of the thread that this direction of cut and spindle makes.
    #[must_use]
    pub fn hand(&self) -> Hand {
        let towards_chuck = self.direction() < 0.0;
        if towards_chuck == (self.rotation == SpindleRotation::Forward) { Hand::Right } else { Hand::Left }
    }

    /// +1 where deeper means a smaller radius, or Z, −1 where it means a larger one.
    #[must_use]
    pub(crate) fn inwards(&self) -> f64 {
        match self.side {
            ThreadSide::External => 1.0,
            ThreadSide::Internal => -1.0,
        }
    }

    /// Place of the tool tip across the lead at a depth below the work's surface: its radius, or Z, mm.
    #[must_use]
    pub fn across_mm(&self, depth_mm: f64, travel_mm: f64) -> f64 {
        self.work_mm + self.taper * travel_mm - self.inwards() * depth_mm
    }

    /// Place along the lead at a travel: Z, or a radius, mm.
    #[must_use]
    pub fn along_mm(&self, travel_mm: f64) -> f64 {
        self.start_mm + self.direction() * travel_mm
    }

    /// Largest radius on which the thread winds about the axis of the work, mm: of the work, or of the face.
    #[must_use]
    pub fn winding_radius_mm(&self) -> f64 {
        match self.lead_axis {
            LeadAxis::Z => self.work_mm,
            LeadAxis::X => self.start_mm.abs().max(self.end_mm.abs()),
        }
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
