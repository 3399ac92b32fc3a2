//! Block thinning for five-axis programs: CAM systems emit a block at each crossing of the tool path with a triangle edge, and
//! directions averaged at edges flicker over short distances. Blocks whose change in direction *and* in position is small
//! are dropped before interpolation (docs/functions/five-axis-thinning.md, "Conditions" and "Algorithm").
//!
//! A streaming stage: a group of blocks goes in, the kept ones come out. Memory is one group; the results are those of
//! the algorithm of that page, while trees of bounds over the group let the searches leap over blocks that cannot stop
//! them. Besides that published method there is a fitted one, whose directions lie on a smooth curve and are bounded everywhere
//! ("The fitted method").

mod bounds;
pub(crate) mod code;
mod fitted;
mod program_report;
mod report;
mod settings;
mod span;
mod stage;
mod thinner;
mod trace;
mod tube;

pub(crate) use program_report::report_findings;
pub use program_report::{DroppedRun, MethodFigures, ProgramThinning};
pub use report::{RotaryReport, ThinningReport};
pub use settings::{MAX_GROUP_BLOCKS, MIN_GROUP_BLOCKS, ThinningMethod, ThinningSettings};
pub(crate) use stage::{StageState, ThinningStage};
pub use thinner::{CutPoint, DirectionInterpolation, FittedDirection, Kept, Thinner};
pub use trace::{Deviation, DeviationTrace};
