//! Thinning between the interpreter and the builder: operations in, operations out, fewer of them.

use std::sync::Arc;

use feedwave_motion::kinematics::{Kinematics, Setup, ToolPose};
use feedwave_program::{
    Axis, AxisSet, Feed, Function, GuidedMove, Operation, OperationKind, Position, SourceSpan, ToolGuide,
};
use serde::{Deserialize, Serialize};

use super::{
    CutPoint, DeviationTrace, DirectionInterpolation, DroppedRun, FittedDirection, Kept, Thinner, ThinningMethod,
    ThinningReport, ThinningSettings,
};

/// Runs of dropped blocks listed; further ones are counted.
const MAX_DROPPED_RUNS: usize = 1_000;

/// A block that waits for its group to be full.
type Waiting = (SourceSpan, Box<GuidedMove>);

/// What the stage remembers between operations: at most a group of blocks.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct StageState {
    on: bool,
    thinner: Option<Thinner<Waiting>>,
    /// Feed of the block before, to tell which block programs one.
    feed: Option<Feed>,
    /// Where the rotary axes are after the block before, rad, where vectors are programmed.
    rotary_rad: [f64; 2],
    /// The work coordinates of the last work offset, for their directions.
    turned: Option<(Position, Setup)>,
    /// Where the rotary axes are after the kept block before, rad, where vectors are fitted.
    kept_rotary_rad: [f64; 2],
}

/// The stage.
#[derive(Clone, Debug)]
pub(crate) struct ThinningStage {
    pub(crate) state: StageState,
    settings: ThinningSettings,
    /// Whether the program's word is followed.
    is_wanted: bool,
    kinematics: Option<Arc<Kinematics>>,
    /// What was dropped, by program line; gathered while validating only.
    pub(crate) dropped: Option<DroppedRuns>,
}

/// Runs of dropped blocks in the order of the program.
#[derive(Clone, Debug, Default)]
pub(crate) struct DroppedRuns {
    pub(crate) runs: Vec<DroppedRun>,
    /// Further ones.
    pub(crate) not_listed: u64,
}

impl DroppedRuns {
    fn add<T>(&mut self, kept: &Kept<T>) {
        let Some([first_line, last_line]) = kept.dropped_lines else { return };
        if self.runs.len() < MAX_DROPPED_RUNS {
            let (blocks, kept_line) = (kept.dropped, kept.point.line);
            self.runs.push(DroppedRun { first_line, last_line, blocks, kept_line });
        } else {
            self.not_listed += 1;
        }
    }
}

impl ThinningStage {
    /// A stage; `is_wanted` says whether the program's word is followed.
    pub(crate) fn new(
        settings: ThinningSettings,
        is_wanted: bool,
        kinematics: Option<Arc<Kinematics>>,
        for_report: bool,
    ) -> Self {
        Self {
            state: StageState::default(),
            settings,
            is_wanted,
            kinematics,
            dropped: for_report.then(DroppedRuns::default),
        }
    }

    /// A stage with nothing read yet that thins by the other method: what this one is compared with.
    pub(crate) fn by_other_method(&self) -> Self {
        let settings = self.settings.with_other_method();
        let (is_wanted, kinematics) = (self.is_wanted, self.kinematics.clone());
        Self { state: StageState::default(), settings, is_wanted, kinematics, dropped: None }
    }

    /// How it thins.
    pub(crate) const fn method(&self) -> ThinningMethod {
        self.settings.method
    }

    /// A stage in the same state that keeps no record.
    pub(crate) fn beside(&self) -> Self {
        let (state, kinematics) = (self.state.clone(), self.kinematics.clone());
        Self { state, settings: self.settings, is_wanted: self.is_wanted, kinematics, dropped: None }
    }

    /// Whether blocks are thinned.
    pub(crate) fn is_on(&self) -> bool {
        self.state.on
    }

    /// What was done, once thinning has been on.
    pub(crate) fn report(&self) -> Option<ThinningReport> {
        self.state.thinner.as_ref().map(Thinner::report)
    }

    /// Deviations of dropped blocks along the program.
    pub(crate) fn deviations(&self) -> DeviationTrace {
        let trace = self.state.thinner.as_ref().and_then(Thinner::trace);
        trace.cloned().unwrap_or_default()
    }

    /// Letters of the rotary axes, the one next to the work first.
    pub(crate) fn rotary_letters(&self) -> Vec<char> {
        let letters = |kinematics: &Arc<Kinematics>| kinematics.letters().1.map(Axis::letter).to_vec();
        self.kinematics.as_ref().map(letters).unwrap_or_default()
    }

    /// Takes an operation in; what may go on now goes to `out`, in order.
    pub(crate) fn operation(&mut self, operation: Operation, out: &mut impl FnMut(Operation)) {
        if let OperationKind::Function(command) = &operation.kind
            && command.function == Function::Thinning
        {
            self.switch(command.on, out);
            return out(operation);
        }
        if !self.state.on {
            return out(operation);
        }
        let span = operation.span;
        match operation.kind {
            OperationKind::Guided(guided) => match self.cut_point(&guided, span.line) {
                Some((point, interpolation)) => self.thin(point, interpolation, (span, guided), out),
                None => {
                    self.other(out);
                    out(Operation { span, kind: OperationKind::Guided(guided) });
                }
            },
            kind => {
                self.other(out);
                out(Operation { span, kind });
            }
        }
    }

    /// Thinning is switched on or off.
    fn switch(&mut self, on: bool, out: &mut impl FnMut(Operation)) {
        let on = on && self.is_wanted;
        if on && self.state.thinner.is_none() {
            // The settings of a profile in use are valid; with others nothing is thinned.
            let thinner = Thinner::new(self.settings, DirectionInterpolation::GreatCircle).ok();
            self.state.thinner = if self.dropped.is_some() { thinner.map(Thinner::keeping_trace) } else { thinner };
        }
        if self.state.on {
            self.other(out);
        }
        self.state.on = on && self.state.thinner.is_some();
        self.state.feed = None;
    }

    /// An operation that does anything else, or more, than cut straight.
    fn other(&mut self, out: &mut impl FnMut(Operation)) {
        self.with_thinner(out, |thinner, out| thinner.push_other(out));
    }

    /// Does something with the thinner, and passes on what it keeps.
    fn with_thinner(
        &mut self,
        out: &mut impl FnMut(Operation),
        run: impl FnOnce(&mut Thinner<Waiting>, &mut dyn FnMut(Kept<Waiting>)),
    ) {
        let Some(thinner) = &mut self.state.thinner else { return };
        let dropped = &mut self.dropped;
        if self.settings.method == ThinningMethod::Published {
            return run(thinner, &mut |kept| pass_on(kept, dropped.as_mut(), out));
        }
        let mut all = Vec::new();
        run(thinner, &mut |kept| all.push(kept));
        for kept in all {
            let kept = self.turn(kept);
            pass_on(kept, self.dropped.as_mut(), out);
        }
    }

    /// Gives a block that the fitted method keeps its direction.
    fn turn(&mut self, mut kept: Kept<Waiting>) -> Kept<Waiting> {
        let Some(kinematics) = self.kinematics.as_deref() else { return kept };
        let guided = &mut kept.payload.1;
        match &mut guided.guide {
            ToolGuide::Vector { end, .. } => {
                if let Some(FittedDirection::Vector(direction)) = kept.fitted {
                    *end = Some(direction);
                }
                let in_chain = self.state.turned.filter(|(offset, _)| *offset == guided.step.work_offset);
                let rotary_rad = in_chain.and_then(|(_, setup)| {
                    let pose = ToolPose { tip_mm: [0.0; 3], direction: kept.point.direction };
                    kinematics.nearest_rotary(setup.to_chain(&pose).direction, self.state.kept_rotary_rad).ok()
                });
                self.state.kept_rotary_rad = rotary_rad.unwrap_or(self.state.kept_rotary_rad);
                if let Some(thinner) = &mut self.state.thinner {
                    thinner.is_kept_at(rotary_rad);
                }
            }
            _ => {
                if let Some(FittedDirection::Angles(rotary_rad)) = kept.fitted {
                    for (axis, value_rad) in kinematics.letters().1.into_iter().zip(rotary_rad) {
                        let place = axis.index();
                        guided.step.end[place] = value_rad.to_degrees() - guided.step.work_offset[place];
                    }
                }
            }
        }
        kept
    }

    fn thin(
        &mut self,
        mut point: CutPoint,
        interpolation: DirectionInterpolation,
        waiting: Waiting,
        out: &mut impl FnMut(Operation),
    ) {
        let feed = waiting.1.step.feed;
        if self.state.feed != Some(feed) {
            point.feed_word = self.state.feed.replace(feed).map(|_| value_of(feed));
        }
        self.with_thinner(out, |thinner, out| {
            thinner.interpolate(interpolation, out);
            thinner.push(point, waiting, out);
        });
    }

    /// What thinning looks at in a block; nothing for one that may not be dropped.
    fn cut_point(&mut self, guided: &GuidedMove, line: u32) -> Option<(CutPoint, DirectionInterpolation)> {
        let kinematics = self.kinematics.as_deref().filter(|_| guided.is_pure_cut)?;
        let end = &guided.step.end;
        let tip_mm = [Axis::X, Axis::Y, Axis::Z].map(|axis| end[axis.index()]);
        let (direction, rotary_rad, interpolation) = match guided.guide {
            ToolGuide::Axes | ToolGuide::Plane | ToolGuide::Align { .. } => return None,
            ToolGuide::Angles if guided.held.meets(AxisSet::ROTARY) => return None,
            // The next block would turn an axis that rolls over by less, were this one dropped.
            ToolGuide::Angles if !guided.turned.is_empty() && (0..2).any(|axis| kinematics.rolls_over(axis)) => {
                return None;
            }
            ToolGuide::Angles => {
                let offset = &guided.step.work_offset;
                let position = std::array::from_fn(|axis| end[axis] + offset[axis]);
                let rotary_rad = kinematics.from_position(&position).rotary_rad;
                let directions = kinematics.rotary_directions();
                (directions.at(rotary_rad), Some(rotary_rad), DirectionInterpolation::Angles(directions))
            }
            ToolGuide::Vector { end, .. } => {
                let direction = end?;
                // For the figures of the rotary axes only; what cannot be reached is the builder's to refuse.
                let in_chain = match &self.state.turned {
                    Some((offset, setup)) if *offset == guided.step.work_offset => *setup,
                    _ => {
                        let offset = guided.step.work_offset;
                        let work = kinematics.work_frame_at(&kinematics.from_position(&offset));
                        let setup = Setup { work, tool_length_mm: 0.0 };
                        self.state.turned = Some((offset, setup));
                        setup
                    }
                };
                let in_chain = in_chain.to_chain(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
                let rotary_rad = kinematics.nearest_rotary(in_chain, self.state.rotary_rad).ok();
                self.state.rotary_rad = rotary_rad.unwrap_or(self.state.rotary_rad);
                (direction, rotary_rad, DirectionInterpolation::GreatCircle)
            }
        };
        Some((CutPoint { line, tip_mm, direction, rotary_rad, feed_word: None }, interpolation))
    }
}

/// The number of a feed.
const fn value_of(feed: Feed) -> f64 {
    match feed {
        Feed::PerMinute(value) | Feed::PerRevolution(value) | Feed::InverseTime(value) => value,
    }
}

/// A kept block goes on. Its feed is the modal one that was in force where it was read, and so that of the dropped blocks
/// before it already.
fn pass_on(kept: Kept<Waiting>, dropped: Option<&mut DroppedRuns>, out: &mut impl FnMut(Operation)) {
    if let Some(dropped) = dropped {
        dropped.add(&kept);
    }
    let (span, guided) = kept.payload;
    out(Operation { span, kind: OperationKind::Guided(guided) });
}
