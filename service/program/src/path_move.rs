//! A move along a path that the program knows, whichever operation holds it.
//!
//! What acts on the path alone (radius compensation, chamfers and roundings) is the same for a plain move, for one in a tilted
//! plane and for one of axes some of which only the machine knows: the operation is kept, and its step is replaced.

use core::ops::{Deref, DerefMut};

use serde::{Deserialize, Serialize};

use crate::{AxisSet, GuidedMove, Move, OperationKind, TiltedPlane, ToolGuide};

/// A step with the operation that holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "most are plain, and a box would allocate once per block")]
pub(crate) enum PathMove {
    /// Every axis goes where the program says.
    Plain(Move),
    /// In a tilted plane, or of the axes while some of them are held.
    Guided(Box<GuidedMove>),
}

/// The coordinates of a path: moves of different ones do not lie side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathFrame {
    plane: Option<TiltedPlane>,
    tool_length_mm: Option<f64>,
}

impl GuidedMove {
    /// Whether start and end are places of its coordinates, between which the path is that of a plain move.
    const fn has_path(&self) -> bool {
        matches!(self.guide, ToolGuide::Plane | ToolGuide::Axes)
    }
}

impl OperationKind {
    /// The step of a move along a path that the program knows.
    pub(crate) const fn path_step(&self) -> Option<&Move> {
        match self {
            Self::Move(step) => Some(step),
            Self::Guided(guided) if guided.has_path() => Some(&guided.step),
            _ => None,
        }
    }

    /// The same, to be replaced.
    pub(crate) const fn path_step_mut(&mut self) -> Option<&mut Move> {
        match self {
            Self::Move(step) => Some(step),
            Self::Guided(guided) if guided.has_path() => Some(&mut guided.step),
            _ => None,
        }
    }

    /// The coordinates of its path. The tool's length is part of those of a tilted plane, and of the offset of others.
    pub(crate) const fn path_frame(&self) -> PathFrame {
        match self {
            Self::Guided(guided) if guided.plane.is_some() => {
                PathFrame { plane: guided.plane, tool_length_mm: guided.tool_length_mm }
            }
            _ => PathFrame { plane: None, tool_length_mm: None },
        }
    }
}

impl PathMove {
    /// The move of an operation.
    ///
    /// # Errors
    /// The operation, where it is none along a path in the coordinates asked for: those of a tilted plane, or work coordinates.
    #[inline]
    #[allow(clippy::result_large_err, reason = "the operation goes on as it came, and a box would allocate for it")]
    pub(crate) fn of(kind: OperationKind, is_in_plane: bool) -> Result<Self, OperationKind> {
        match kind {
            OperationKind::Move(step) if !is_in_plane => Ok(Self::Plain(step)),
            OperationKind::Guided(guided)
                if guided.has_path()
                    && is_in_plane == (guided.guide == ToolGuide::Plane)
                    && !guided.held.meets(AxisSet::LINEAR) =>
            {
                Ok(Self::Guided(guided))
            }
            kind => Err(kind),
        }
    }

    /// Whether it moves nothing. Of axes some of which are held this cannot be seen: a word may have placed one of them.
    pub(crate) fn is_nothing(&self) -> bool {
        match self {
            Self::Plain(step) => step.is_nothing(),
            Self::Guided(guided) => guided.guide == ToolGuide::Plane && guided.step.is_nothing(),
        }
    }

    /// Lets the rotary axes rest where they are, in a piece before the move that turns them.
    pub(crate) fn rest_rotary(&mut self) {
        if let Self::Guided(guided) = self {
            guided.held = guided.held.with(AxisSet::ROTARY);
        }
    }
}

impl Deref for PathMove {
    type Target = Move;

    #[inline]
    fn deref(&self) -> &Move {
        match self {
            Self::Plain(step) => step,
            Self::Guided(guided) => &guided.step,
        }
    }
}

impl DerefMut for PathMove {
    #[inline]
    fn deref_mut(&mut self) -> &mut Move {
        match self {
            Self::Plain(step) => step,
            Self::Guided(guided) => &mut guided.step,
        }
    }
}

impl From<PathMove> for OperationKind {
    #[inline]
    fn from(step: PathMove) -> Self {
        match step {
            PathMove::Plain(step) => Self::Move(step),
            PathMove::Guided(guided) => Self::Guided(guided),
        }
    }
}
