//! Thread turning with low-frequency vibration (file 004): passes, phases, chips and a planner of passes.
//!
//! The tool vibrates across the lead, on the retreat side only, in a fixed ratio to the spindle, and the phase is shifted
//! from pass to pass, so that one pass cuts shallow where the pass before cut deep. Everything is a function of
//! the spindle angle: a generator asks [`ThreadJob::position`], whatever turns the spindle.

mod analysis;
mod chip;
pub(crate) mod code;
mod driven;
mod findings;
mod follower;
mod following;
mod following_cures;
mod geometry;
mod infeed;
mod job;
mod open_thread;
mod parameters;
mod pass;
mod path;
mod planner;
mod program_text;
mod report;
mod run_up;
mod settings;
mod state;
mod superposition;
mod tap;
#[cfg(test)]
mod tests;
mod watch;
mod wave;

pub(crate) use analysis::ThreadAnalysis;
pub use chip::{ChipLevel, Clearance, ThreadChip};
pub use follower::{NotAnAngle, ThreadFollower};
pub use following::{PassFollowing, ThreadDrives, ThreadFollowing};
pub use geometry::{GrooveProfile, Hand, LeadAxis, SpindleRotation, ThreadGeometry, ThreadSide};
pub use infeed::{DepthLaw, InfeedPattern};
pub use job::{GroovePlace, ThreadJob, ThreadPass, ThreadPosition};
pub use pass::TAPER_SHARE;
pub use path::{MAX_THREAD_PARTS, ThreadPath, ThreadPlace};
pub(crate) use path::{PathColumns, PathPart, PathVibration};
pub use planner::{PassMethod, ThreadPlan, ThreadRequest, plan_thread};
pub use program_text::{ThreadTextOptions, thread_program_text};
pub use report::{
    CrestReport, MAX_THREAD_PASSES, ThreadLimits, ThreadPassReport, ThreadReport, ThreadSectionReport, judge_thread,
};
pub use run_up::RunUp;
pub use settings::ThreadVibrationSettings;
pub use state::KeptPass;
pub(crate) use state::{Pass, ThreadInputs, Threads, WaitingPass, WantedPass};
pub(crate) use superposition::{ThreadRun, ThreadScratch};
pub(crate) use tap::{TapRun, straight};
pub use watch::{REVERSAL_DEG, STANDSTILL_S, SpindleEvent, SpindleWatch};
pub(crate) use wave::START_JERK;
pub use wave::{RetreatWave, StartUp, default_phase_shift_deg, reduce_deg};
