//! Moves of a guided tool: tool centre point control (`G43.4`, `G43.5`), and the way back to plain axes.

use serde::{Deserialize, Serialize};

use crate::{Axis, Move};

/// A move whose axis positions depend on the kinematics of the machine: the program says where the tool is, not where the axes
/// are.
///
/// The program knows the end of such a move only. It starts where the machine stands after the move before: switching the
/// tool centre point control on or off moves nothing, so that then the same place has other coordinates, which the program
/// cannot know without the kinematics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuidedMove {
    /// The move. In its end, X Y Z are the tool centre point in work coordinates where the tool is guided, and rotary
    /// axes are positions of the axes. Its start counts where nothing was held in the guided move before.
    pub step: Move,
    /// How the tool is guided.
    pub guide: ToolGuide,
    /// Axes of the end that no word has placed since the coordinates changed: they stay where the machine has them.
    pub held: AxisSet,
    /// Number of the tool length (`H`), 0 where the tool is not guided.
    pub length_offset: u32,
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
