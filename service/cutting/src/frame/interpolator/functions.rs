//! The machining functions in the interpolator: their barriers, what runs of them, and what each does when an activity
//! that it asked for has ended.
//!
//! This is the place to which a function is added. One that superposes offsets on the path, blended in and out by the place
//! on it, is a variant of [`Superposition`]; one with activities of its own has its barriers, activities and steps here and
//! a file beside this one.

use feedwave_motion::Planned;
use serde::{Deserialize, Serialize};

use super::{Activity, After, Barrier, Interpolator};
use crate::functions::path_vibration::{
    GenerationMode, RunningVibration, SectionBarrier, SectionSamples, SectionStart, VibrationScratch,
};
use crate::functions::thread::{TapRun, ThreadRun, ThreadScratch};
use crate::functions::tool_oscillation::{OscillationRun, OscillationScratch};
use crate::shared::columns::{Samples, fill_axes, still};
use crate::shared::setpoint::SetpointBlock;
use crate::shared::superposition::SuperpositionBarrier;
use crate::shared::track::{PathBarrier, Track};

/// A barrier of a machining function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum FunctionBarrier {
    /// Of a section that vibrates along the path.
    Vibration(SectionBarrier),
    /// Offsets are superposed on the path from here on.
    Superpose(Superposition),
    /// They end.
    EndSuperposition,
    /// A threading pass.
    Thread(Box<ThreadRun>),
    /// A stroke of a rigid tap.
    Tap(Box<TapRun>),
}

/// Offsets of a function on a part of the path: 0 at both of its ends, where the path rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Superposition {
    /// The tool oscillates.
    Oscillation(Box<OscillationRun>),
}

impl From<Box<OscillationRun>> for Superposition {
    fn from(run: Box<OscillationRun>) -> Self {
        Self::Oscillation(run)
    }
}

impl Superposition {
    /// Length of path over which the offsets are blended in and out, mm.
    fn ramp_mm(&self) -> f64 {
        match self {
            Self::Oscillation(run) => run.ramp_mm,
        }
    }

    /// Adds the offsets to the rows from `start` on.
    fn superpose<B: PathBarrier>(
        &self,
        at: &Samples<'_, B>,
        scratch: &mut FunctionScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        match self {
            Self::Oscillation(run) => {
                let scratch = scratch.oscillation.get_or_insert_with(OscillationScratch::new);
                run.superpose(at, scratch, block, start);
            }
        }
    }
}

impl From<SectionBarrier> for FunctionBarrier {
    fn from(barrier: SectionBarrier) -> Self {
        Self::Vibration(barrier)
    }
}

impl<R> From<SuperpositionBarrier<R>> for FunctionBarrier
where
    Superposition: From<Box<R>>,
{
    fn from(barrier: SuperpositionBarrier<R>) -> Self {
        match barrier {
            SuperpositionBarrier::Start(run) => Self::Superpose(run.into()),
            SuperpositionBarrier::End => Self::EndSuperposition,
        }
    }
}

impl From<ThreadRun> for FunctionBarrier {
    fn from(run: ThreadRun) -> Self {
        Self::Thread(Box::new(run))
    }
}

impl From<TapRun> for FunctionBarrier {
    fn from(run: TapRun) -> Self {
        Self::Tap(Box::new(run))
    }
}

impl PathBarrier for FunctionBarrier {
    fn starts_path(&self) -> bool {
        matches!(self, Self::Vibration(SectionBarrier::PartStart(_)) | Self::Superpose(_))
    }

    fn ends_path(&self) -> bool {
        matches!(self, Self::Vibration(SectionBarrier::End | SectionBarrier::PartEnd) | Self::EndSuperposition)
    }

    fn moves_tool(&self) -> bool {
        matches!(self, Self::Thread(_) | Self::Tap(_))
    }
}

/// An activity that a function has for itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum FunctionActivity {
    /// X moving to the vibration position of the current pass.
    ThreadPreparation {
        /// First source line of the pass.
        line: u32,
    },
    /// The current pass, from this spindle angle to the reference point on, degrees in the direction of rotation.
    Thread {
        /// The angle; not positive.
        start_deg: f64,
    },
    /// The current stroke of a rigid tap.
    Tap,
}

/// What a function does when an activity that it asked for has ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum FunctionStep {
    /// The pass whose preparatory movement is done is run.
    RunThread,
    /// The pass is over.
    LeaveThread,
    /// The stroke of a rigid tap is over.
    LeaveTap,
    /// The vibrating section starts.
    OpenSection(SectionStart),
    /// The wait for the vibration is over: align to the grid.
    SettleSection,
    /// The vibrating section is over.
    CloseSection,
    /// Nothing is superposed any more.
    EndSuperposition,
}

/// What runs of every function.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RunningFunctions {
    pub(super) vibration: RunningVibration,
    /// A vibrating section that ended since it was last asked for.
    pub(super) finished_section: Option<SectionSamples>,
    superposition: Option<Superposition>,
    /// First and last setpoint of the threading pass begun last.
    pub(super) last_pass: Option<(u64, u64)>,
}

/// Buffers of every function for one block, made where it first runs, so that a program without it starts sooner.
#[derive(Clone, Debug, Default)]
pub(super) struct FunctionScratch {
    vibration: Option<VibrationScratch>,
    oscillation: Option<OscillationScratch>,
    pub(super) thread: Option<ThreadScratch>,
}

impl RunningFunctions {
    /// Path behind the tool that a function may go back over, mm.
    pub(super) fn reach_back_mm(&self) -> f64 {
        self.vibration.reach_mm()
    }

    /// Whether the path is known as far ahead as a function may reach from here, and as one is blended out over.
    pub(super) fn know_path<B: PathBarrier>(&self, track: &Track<B>) -> bool {
        let blend_mm = self.superposition.as_ref().map(Superposition::ramp_mm);
        self.vibration.needed_ahead_mm().into_iter().chain(blend_mm).all(|reach_mm| track.is_known_ahead(reach_mm))
    }

    /// Fills the axes of the rows from `start` on with the commanded path and what the functions make of it.
    pub(super) fn fill_axes<B: PathBarrier>(
        &mut self,
        at: &Samples<'_, B>,
        mode: GenerationMode,
        scratch: &mut FunctionScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        if self.vibration.is_in_section() {
            let scratch = scratch.vibration.get_or_insert_with(VibrationScratch::new);
            self.vibration.fill(at, mode, scratch, block, start);
            return;
        }
        fill_axes(at.columns, at.tool, at.element, at.s, block, start);
        if let Some(superposition) = &self.superposition {
            superposition.superpose(at, scratch, block, start);
        }
        if let Some(servo) = &mut block.servo {
            still(servo, start);
        }
    }
}

impl Interpolator {
    /// Does what the barrier of a function that the tool has come to asks for.
    pub(super) fn begin_function(&mut self) {
        let Some(Planned::Barrier(Barrier::Function(barrier))) = self.state.track.current() else { return };
        match barrier {
            &FunctionBarrier::Vibration(barrier) => self.begin_section_barrier(barrier),
            FunctionBarrier::Superpose(superposition) => {
                self.state.functions.superposition = Some(superposition.clone());
                self.state.track.advance(0.0);
            }
            FunctionBarrier::EndSuperposition => self.align_then(After::Function(FunctionStep::EndSuperposition)),
            FunctionBarrier::Thread(_) => self.begin_thread(),
            FunctionBarrier::Tap(_) => self.begin_tap(),
        }
    }

    /// Does what comes when an activity that a function asked for has ended.
    pub(super) fn carry_out(&mut self, step: FunctionStep) {
        match step {
            FunctionStep::RunThread => self.run_thread(),
            FunctionStep::LeaveThread => self.leave_thread(),
            FunctionStep::LeaveTap => self.leave_tap(),
            FunctionStep::OpenSection(condition) => self.open_section(condition),
            FunctionStep::SettleSection => self.settle_section(),
            FunctionStep::CloseSection => self.close_section(),
            FunctionStep::EndSuperposition => {
                self.state.functions.superposition = None;
                self.state.track.advance(0.0);
            }
        }
    }

    /// Setpoints of a function's own activity, `first` periods after its start.
    pub(super) fn emit_function(
        &mut self,
        block: &mut SetpointBlock,
        start: usize,
        first: u64,
        activity: Activity,
        kind: FunctionActivity,
    ) {
        match kind {
            FunctionActivity::ThreadPreparation { line } => self.emit_preparation(block, start, first, line),
            FunctionActivity::Thread { start_deg } => self.emit_thread(block, start, first, activity, start_deg),
            FunctionActivity::Tap => self.emit_tap(block, start, first, activity),
        }
    }

    /// Counts the time of a function's own activity.
    pub(super) fn share_function(&mut self, activity: Activity, kind: FunctionActivity) {
        match kind {
            FunctionActivity::ThreadPreparation { .. } => self.share_preparation(),
            FunctionActivity::Thread { .. } => self.share_pass(activity.duration_s),
            FunctionActivity::Tap => self.share_tap(),
        }
    }
}
