//! Moves of a guided tool: tool centre point control (`G43.4`, `G43.5`), tilted planes (`G68.2`, `G53.1`), and the
//! return to plain axes.

use serde::{Deserialize, Serialize};

use crate::{Axis, Move};

/// A move whose axis positions depend on the kinematics of the machine: the program says where the tool is, not where the axes
/// are.
///
/// The program knows the end of such a move only. It starts where the machine is after the move before: switching the
/// tool centre point control or a tilted plane on or off moves nothing, so that then the same place has other coordinates,
/// which the program cannot know without the kinematics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuidedMove {
    /// The move. In its end, X Y Z are the tool centre point in work coordinates where the tool is guided, and rotary
    /// axes are positions of the axes. Its start counts where nothing was held in the guided move before.
    pub step: Move,
    /// How the tool is guided.
    pub guide: ToolGuide,
    /// Axes of the end that no word has placed since the coordinates changed: they stay where the machine has them.
    pub held: AxisSet,
    /// Rotary axes whose word says how far they turn, not where to: they turn by the difference of end and start.
    pub turned: AxisSet,
    /// Number of the tool length (`H`), 0 where the tool is not guided, and in a tilted plane for no length.
    pub length_offset: u32,
    /// That length with its wear, mm, as the table has it where it was called; 0 for no length, `None` where it is not known,
    /// which was reported.
    pub tool_length_mm: Option<f64>,
    /// The tilted plane whose coordinates the end and the circle of the move are in, instead of work coordinates.
    pub plane: Option<TiltedPlane>,
    /// Whether the block does nothing but cut straight: position, direction and modal feed. Only such a block may be
    /// thinned out.
    pub is_pure_cut: bool,
}

/// How the tool is guided.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolGuide {
    /// Not any more (`G49`): a plain move of the axes, some of which are still held.
    Axes,
    /// `G43.4`: tool centre point, and the angles of the rotary axes in the end of the move.
    Angles,
    /// `G43.5`: tool centre point and tool direction.
    Vector {
        /// Unit vector from the tip to the spindle at the start, work coordinates; where there is none, the direction that the
        /// tool has.
        start: Option<[f64; 3]>,
        /// The same at the end.
        end: Option<[f64; 3]>,
    },
    /// In a tilted plane (`G68.2`): tool centre point; the rotary axes rest.
    Plane,
    /// The rotary axes turn the tool axis onto the normal of the plane, at rapid.
    Align {
        /// Which solution.
        solution: ToolAxisSolution,
        /// `G53.6`: the linear axes keep the tool centre point where it is on the work; `G53.1`: they rest.
        about_tip: bool,
    },
}

/// Which of the two inverse solutions `G53.1` and `G53.6` take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolAxisSolution {
    /// `P0` or none: the one that the machine profile prefers.
    Preferred,
    /// `P1`: the one with the larger angle of the rotary axis next to the tool, within (−180°, 180°].
    Larger,
    /// `P2`: the one with the smaller angle.
    Smaller,
}

/// A tilted work plane (`G68.2`): coordinates turned and shifted against the work coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TiltedPlane {
    /// Its origin, work coordinates, mm.
    pub origin_mm: [f64; 3],
    /// Unit vectors along its X, Y and Z, work coordinates.
    pub axes: [[f64; 3]; 3],
    /// Program line that tilted it.
    pub line: u32,
}

impl TiltedPlane {
    /// The plane by Euler angles z-x-z, degrees: turned about Z by the first, about its own X by the second, and about its own Z
    /// by the third. Multiples of 90° are exact.
    #[must_use]
    pub fn by_euler_angles(origin_mm: [f64; 3], angles_deg: [f64; 3], line: u32) -> Self {
        let [(s1, c1), (s2, c2), (s3, c3)] = angles_deg.map(sincos_deg);
        let x = [c1 * c3 - s1 * c2 * s3, s1 * c3 + c1 * c2 * s3, s2 * s3];
        let y = [-c1 * s3 - s1 * c2 * c3, -s1 * s3 + c1 * c2 * c3, s2 * c3];
        let z = [s1 * s2, -c1 * s2, c2];
        Self { origin_mm, axes: [x, y, z], line }
    }

    /// The images of X, Y and Z when they are turned, right-handed, about one of them (0: X, 1: Y, 2: Z) by an angle, degrees.
    /// Multiples of 90° are exact.
    #[must_use]
    pub fn about(axis: usize, angle_deg: f64) -> [[f64; 3]; 3] {
        let (sine, cosine) = sincos_deg(angle_deg);
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut axes = [[0.0; 3]; 3];
        axes[axis][axis] = 1.0;
        (axes[next][next], axes[next][last]) = (cosine, sine);
        (axes[last][last], axes[last][next]) = (cosine, -sine);
        axes
    }

    /// The Euler angles z-x-z that turn the work coordinates into its own, degrees; the third one is 0 where its normal is along
    /// Z of the work.
    #[must_use]
    pub fn euler_angles_deg(&self) -> [f64; 3] {
        let [x, y, z] = &self.axes;
        let across = (z[0] * z[0] + z[1] * z[1]).sqrt();
        let angles_rad = if across > 1e-12 {
            [libm::atan2(z[0], -z[1]), libm::atan2(across, z[2]), libm::atan2(x[2], y[2])]
        } else {
            [libm::atan2(x[1], x[0]), libm::atan2(across, z[2]), 0.0]
        };
        angles_rad.map(f64::to_degrees)
    }

    /// A direction in its coordinates as one in work coordinates.
    #[must_use]
    pub fn turned_out(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [along_x, along_y, along_z] = &self.axes;
        core::array::from_fn(|k| along_x[k] * x + along_y[k] * y + along_z[k] * z)
    }

    /// A point in its coordinates as one in work coordinates, mm.
    #[must_use]
    pub fn to_work(&self, point_mm: [f64; 3]) -> [f64; 3] {
        let turned = self.turned_out(point_mm);
        core::array::from_fn(|k| self.origin_mm[k] + turned[k])
    }

    /// A point in work coordinates as one in its coordinates, mm.
    #[must_use]
    pub fn from_work(&self, point_mm: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = core::array::from_fn(|k| point_mm[k] - self.origin_mm[k]);
        self.axes.map(|axis| axis[0] * x + axis[1] * y + axis[2] * z)
    }
}

/// Sine and cosine of degrees, exact at multiples of 90.
fn sincos_deg(angle_deg: f64) -> (f64, f64) {
    let turned = angle_deg % 360.0;
    match turned.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => libm::sincos(turned.to_radians()),
    }
}

/// A set of axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisSet(u16);

impl AxisSet {
    /// No axis.
    pub const NONE: Self = Self(0);
    /// X, Y and Z.
    pub const LINEAR: Self = Self(0b111);
    /// A, B and C.
    pub const ROTARY: Self = Self(0b111_000);

    /// Whether the axis is in the set.
    #[must_use]
    pub const fn contains(self, axis: Axis) -> bool {
        self.0 & (1 << axis.index()) != 0
    }

    /// Whether no axis is in the set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// All axes of both sets.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The set with an axis.
    #[must_use]
    pub const fn with_axis(self, axis: Axis) -> Self {
        Self(self.0 | 1 << axis.index())
    }

    /// The set without an axis.
    #[must_use]
    pub const fn without(self, axis: Axis) -> Self {
        Self(self.0 & !(1 << axis.index()))
    }

    /// Whether the sets have an axis in common.
    #[must_use]
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}
