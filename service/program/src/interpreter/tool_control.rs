//! Tool centre point control: `G43.4` with the angles of the rotary axes, `G43.5` with direction vectors, `G49`; and
//! the moves under it.

mod held;

use super::execute::Execution;
use super::motion::{CURVE_LETTERS, Frame, curve_letters, set_bits};
use super::spline::is_point;
use crate::block::Word;
use crate::code;
use crate::dialect::{FeedUnit, Group, Letter, Meaning, letter_bit};
use crate::state::{Motion, ToolControl, ToolMode};
use crate::{
    ArcGeometry, AxisSet, Feed, Finding, Function, FunctionCommand, GuidedMove, Move, MoveKind, OperationKind,
    Position, SourceSpan, SplineGeometry, ToolGuide,
};

/// The letters of a direction vector.
const VECTOR_LETTERS: u32 = letter_bit(b'I') | letter_bit(b'J') | letter_bit(b'K');
/// The letters of rotary axes.
pub(super) const ROTARY_LETTERS: u32 = letter_bit(b'A') | letter_bit(b'B') | letter_bit(b'C');

/// The path of a guided move, in the coordinates of its end.
pub(super) enum GuidedPath {
    Straight,
    Arc(ArcGeometry),
    Spline(Box<SplineGeometry>),
}

impl Execution<'_> {
    /// `G43.4`, `G43.5` and `G49`; and what the mode does not permit in a block.
    pub(super) fn tool_control(&mut self) {
        match self.code(Group::LengthCompensation) {
            Some((Meaning::ToolControl { vectors }, span)) => self.tool_control_on(vectors, span),
            Some((Meaning::ToolControlOff, _)) => self.tool_control_off(),
            _ => {}
        }
        if self.state.tool_control.mode != ToolMode::Off {
            self.check_guided_block();
        }
    }

    fn tool_control_on(&mut self, vectors: bool, span: SourceSpan) {
        let length = self.take(b'H');
        let thinning = self.take(b'P');
        if self.state.tool_control.mode == ToolMode::Plane {
            return self.not_permitted(span, "tool centre point control");
        }
        let is_on = self.state.tool_control.mode != ToolMode::Off;
        if is_on && (length.is_some() || thinning.is_none()) {
            let on_line = self.state.tool_control.on_line;
            return self.findings.push_with(code::TOOL_CONTROL_NESTED, |code| {
                let message = format!("tool centre point control is on already, since line {on_line}");
                Finding::new(code, span, message)
                    .with_value("on_line", f64::from(on_line), "")
                    .suggest("switch it off with G49 before it is switched on with another form or length")
            });
        }
        if !is_on && self.is_transform_on(span, "tool centre point control") {
            return;
        }
        if self.state.length.is_on {
            return self.length_nested(span, "tool length compensation", self.state.length.on_line);
        }
        if !is_on {
            let Some(length_offset) = self.length_offset(length, span) else { return };
            let tool_length_mm = self.known_length_mm(length_offset, span);
            let mode = if vectors { ToolMode::Vectors } else { ToolMode::Angles };
            let held = self.state.tool_control.held.with(AxisSet::LINEAR);
            let on_line = span.line;
            self.state.tool_control =
                ToolControl { mode, on_line, length_offset, tool_length_mm, held, ..ToolControl::default() };
        }
        if let Some(word) = thinning {
            self.thinning_parameter(&word, span);
        }
    }

    /// The number of the tool length; `None` after a finding.
    pub(super) fn length_offset(&mut self, word: Option<Word>, span: SourceSpan) -> Option<u32> {
        let number = match word {
            Some(word) => Some(self.whole(&word)?),
            None => None,
        };
        let number = number.filter(|&number| number > 0);
        if number.is_none() {
            self.length_missing(span);
        }
        number
    }

    #[cold]
    pub(super) fn length_missing(&mut self, span: SourceSpan) {
        self.findings.push_with(code::TOOL_CONTROL_LENGTH, |code| {
            let message = "the tool centre point is not known without a tool length";
            Finding::new(code, span, message).suggest("add H with the number of the tool, such as H1")
        });
    }

    /// `G43.4 P1` and `P0`.
    fn thinning_parameter(&mut self, word: &Word, span: SourceSpan) {
        let value = word.number.value();
        if value != 0.0 && value != 1.0 {
            let span = self.block.word_span(word);
            return self.findings.push_with(code::WORD_CONFLICT, |code| {
                Finding::new(code, span, "P here switches thinning: P1 on, P0 off")
                    .with_value("word", value, "")
                    .suggest_replacement("switch thinning on", "P1")
                    .suggest_replacement("switch thinning off", "P0")
            });
        }
        let on = value == 1.0;
        if on != self.state.tool_control.thinning {
            self.state.tool_control.thinning = on;
            self.emit(span, OperationKind::Function(self.thinning(on)));
        }
    }

    fn thinning(&self, on: bool) -> FunctionCommand {
        let (inch, frame_offset) = (self.state.inch, self.frame_offset());
        FunctionCommand { function: Function::Thinning, on, inch, frame_offset, words: Vec::new() }
    }

    /// The code that switches thinning: whether it is carried out.
    pub(super) fn switch_thinning(&mut self, on: bool, span: SourceSpan) -> bool {
        let control = &mut self.state.tool_control;
        if on && matches!(control.mode, ToolMode::Off | ToolMode::Plane) {
            self.findings.push_with(code::TOOL_CONTROL_OFF, |code| {
                let message = "five-axis blocks are thinned under tool centre point control, which is off";
                Finding::new(code, span, message)
                    .suggest("switch it on first: G43.4 H with the angles of the rotary axes, G43.5 H with vectors")
            });
            return false;
        }
        std::mem::replace(&mut control.thinning, on) != on
    }

    fn tool_control_off(&mut self) {
        let control = &mut self.state.tool_control;
        if matches!(control.mode, ToolMode::Off | ToolMode::Plane) {
            return;
        }
        let mut held = control.held.with(AxisSet::LINEAR);
        if control.mode == ToolMode::Vectors {
            held = held.with(AxisSet::ROTARY);
        }
        if std::mem::take(&mut control.thinning) {
            self.emit(self.block.span(), OperationKind::Function(self.thinning(false)));
        }
        self.state.tool_control = ToolControl { held, ..ToolControl::default() };
    }

    /// Reports codes that contradict the mode.
    fn check_guided_block(&mut self) {
        let one_block = self.code(Group::NonModal);
        let offset = self.code(Group::WorkOffset).filter(|&(meaning, span)| {
            let here = self.state.tool_control.on_line == span.line;
            !here
                && match meaning {
                    Meaning::WorkOffset(system) | Meaning::HaasWorkOffset(system) => system != self.state.coords.system,
                    Meaning::ExtendedWorkOffset { .. } => true,
                    _ => false,
                }
        });
        let tool = self.code(Group::ToolChange).filter(|(meaning, _)| *meaning == Meaning::ToolChange);
        let refused = match one_block {
            _ if self.state.tool_control.mode == ToolMode::Plane => None,
            Some((Meaning::Reference, span)) => Some((span, "the return to the reference position")),
            Some((Meaning::MachineCoordinates, span)) => Some((span, "motion in machine coordinates")),
            _ => None,
        };
        let refused = refused
            .or(offset.map(|(_, span)| (span, "another work offset")))
            .or(tool.map(|(_, span)| (span, "a tool change")));
        if let Some((span, what)) = refused {
            self.not_permitted(span, what);
        }
    }

    #[cold]
    pub(super) fn not_permitted(&mut self, span: SourceSpan, what: &'static str) {
        let ToolControl { on_line, mode, .. } = self.state.tool_control;
        let (code, place, cure) = match mode {
            ToolMode::Plane if self.is_on_contour() => {
                let cure = "leave the contour with G40 and a straight move, and cancel the plane with G69 behind that";
                (code::PLANE_BLOCK, "on a contour in a tilted plane", cure)
            }
            ToolMode::Plane => (code::PLANE_BLOCK, "in a tilted plane", "cancel the plane with G69 first"),
            _ => (code::TOOL_CONTROL_BLOCK, "under tool centre point control", "switch it off with G49 first"),
        };
        self.findings.push_with(code, |code| {
            Finding::new(code, span, format!("{what} {place}, which is on since line {on_line}"))
                .with_value("on_line", f64::from(on_line), "")
                .suggest(cure)
        });
    }

    /// Motion of a block under tool centre point control or in a tilted plane, or while axes are held after it.
    #[cold]
    pub(super) fn guided_motion(&mut self, frame: Frame, motion_before: Motion) {
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        let ToolControl { mode, held: held_before, direction: direction_before, .. } = self.state.tool_control;
        let (motion, used_before) = (self.state.motion, self.used);
        if mode == ToolMode::Plane && motion == Motion::Thread && frame == Frame::Work {
            return self.thread_in_plane();
        }
        if self.is_contour_control(axes, motion_before) {
            return;
        }
        let by_vectors = mode == ToolMode::Vectors;
        // Along a curve under G43.4, and in a tilted plane, I J K are the curve's own.
        if matches!(motion, Motion::Linear | Motion::Rapid) || by_vectors && matches!(motion, Motion::Arc { .. }) {
            self.tool_direction(axes);
        }
        let more = match motion {
            Motion::Linear | Motion::Rapid => VECTOR_LETTERS,
            _ => curve_letters(motion),
        };
        let mut letters = axes | self.block.letters & more & !used_before;
        let mut placed = axes;
        if self.is_refused_here(axes, frame) {
            self.used |= CURVE_LETTERS | axes;
            letters = 0;
            // An angle that was refused is not taken, so that nothing else is said of it.
            placed &= if frame == Frame::Work { !ROTARY_LETTERS } else { u32::MAX };
        }
        // Linear axes that a word of this very block places do not say where a curve starts.
        let is_curve = matches!(motion, Motion::Arc { .. } | Motion::Cubic | Motion::Quadratic) && letters != 0;
        let is_held_curve = is_curve && held_before.meets(AxisSet::LINEAR) && !self.block.unclear;
        let end = self.target(placed, frame);
        if letters == 0 || self.block.unclear {
            return self.state.position = end;
        }
        let Some((kind, path, feed)) = self.guided_path(motion, axes, &end, is_held_curve) else {
            return self.state.position = end;
        };
        // From within a plane, places of the machine are those of other coordinates.
        let goes_to_the_machine = mode == ToolMode::Plane && frame == Frame::Machine;
        let still = matches!(path, GuidedPath::Straight)
            && !goes_to_the_machine
            && self.is_still(&end, held_before)
            && direction_before == self.state.tool_control.direction;
        if let Some(feed) = feed.filter(|_| !still) {
            if goes_to_the_machine {
                self.emit_from_plane(kind, end, self.named_axes(axes), feed);
            } else {
                let guide = self.guide(direction_before);
                let corner = self.guided_corner(guide, kind, axes, held_before);
                self.emit_with_corner(corner, |this| this.emit_guided(guide, kind, end, feed, path));
            }
        }
        self.state.position = end;
    }

    /// Kind, path and feed of a guided move; nothing where its motion is none that can be guided, or starts from where only the machine
    /// is, which is then reported. Without a feed nothing moves, after a finding.
    fn guided_path(
        &mut self,
        motion: Motion,
        axes: u32,
        end: &Position,
        is_held_curve: bool,
    ) -> Option<(MoveKind, GuidedPath, Option<Feed>)> {
        let mode = self.state.tool_control.mode;
        Some(match motion {
            Motion::Rapid => (MoveKind::Rapid, GuidedPath::Straight, Some(Feed::PerMinute(0.0))),
            Motion::Linear => (MoveKind::Cutting, GuidedPath::Straight, self.cutting_feed()),
            Motion::Arc { .. } | Motion::Cubic | Motion::Quadratic if is_held_curve => {
                self.used |= CURVE_LETTERS;
                self.held_start(self.block.span());
                return None;
            }
            Motion::Arc { clockwise } => {
                let path = self.guided_arc(clockwise, end).map(GuidedPath::Arc);
                let feed = path.as_ref().and_then(|_| self.cutting_feed());
                (MoveKind::Cutting, path.unwrap_or(GuidedPath::Straight), feed)
            }
            Motion::Cubic | Motion::Quadratic if mode == ToolMode::Vectors => {
                self.used = u32::MAX;
                self.not_permitted(self.block.span(), "a spline, whose I J K would be the tool direction of G43.5,");
                return None;
            }
            Motion::Cubic | Motion::Quadratic => {
                // Under G43.4 the rotary axes turn evenly along the curve.
                let own = if mode == ToolMode::Angles { axes & !ROTARY_LETTERS } else { axes };
                let spline = self.spline(motion == Motion::Cubic, own, end).filter(|spline| !is_point(spline));
                let feed = spline.as_ref().and_then(|_| self.cutting_feed());
                (MoveKind::Cutting, spline.map_or(GuidedPath::Straight, GuidedPath::Spline), feed)
            }
            Motion::None => {
                self.motion_missing();
                return None;
            }
            Motion::Unclear | Motion::Doubtful { .. } => (MoveKind::Rapid, GuidedPath::Straight, None),
            Motion::Nurbs
            | Motion::Probe
            | Motion::Thread
            | Motion::ThreadCycle
            | Motion::SingleCycle(_)
            | Motion::RigidTap => {
                self.used = u32::MAX;
                let span = self.block.span();
                match mode {
                    ToolMode::Off => self.held_start(span),
                    _ => self.not_permitted(span, "a thread"),
                }
                return None;
            }
        })
    }

    /// Whether a NURBS cannot be opened here, which is then reported: it starts from a place that only the machine knows, or its
    /// blocks cannot hold the directions of the tool.
    pub(super) fn is_nurbs_refused(&mut self) -> bool {
        let ToolControl { mode, held, .. } = self.state.tool_control;
        let span = self.block.span();
        if mode == ToolMode::Vectors {
            self.not_permitted(span, "a NURBS, whose blocks hold no tool direction,");
        } else if held.meets(AxisSet::LINEAR) {
            self.held_start(span);
        } else {
            return false;
        }
        true
    }

    /// The circle of a guided move; `None` after a finding. Under `G43.5` I J K are the tool direction, so that only R can
    /// say which circle it is.
    fn guided_arc(&mut self, clockwise: bool, end: &Position) -> Option<ArcGeometry> {
        let has_radius = self.block.letters & letter_bit(b'R') & !self.used != 0;
        if self.state.tool_control.mode == ToolMode::Vectors && !has_radius {
            let span = self.block.span();
            self.findings.push_with(code::ARC_CENTRE_MISSING, |code| {
                let message = "the arc has no R: under G43.5 I, J and K are the tool direction and no centre";
                Finding::new(code, span, message)
                    .suggest("add the radius, R; a full circle takes two arcs")
                    .suggest("write the directions as angles, G43.4, under which I, J and K are the centre")
            });
            return None;
        }
        self.arc(clockwise, end)
    }

    /// Whether the axis words of a block are refused as a whole, which is reported.
    fn is_refused_here(&mut self, axes: u32, frame: Frame) -> bool {
        let is_plane = self.state.tool_control.mode == ToolMode::Plane;
        match frame {
            // Reported before, where the mode does not permit it.
            Frame::Machine => !self.block.unclear && self.is_wrong_machine_motion(axes),
            Frame::Work => is_plane && self.refuse_rotary_words(axes & ROTARY_LETTERS),
        }
    }

    /// How moves are guided here.
    pub(super) const fn guide(&self, direction_before: Option<[f64; 3]>) -> ToolGuide {
        match self.state.tool_control.mode {
            ToolMode::Off => ToolGuide::Axes,
            ToolMode::Angles => ToolGuide::Angles,
            ToolMode::Vectors => ToolGuide::Vector { start: direction_before, end: self.state.tool_control.direction },
            ToolMode::Plane => ToolGuide::Plane,
        }
    }

    /// Emits a move to `end` whose places only the machine knows.
    pub(super) fn emit_guided(
        &mut self,
        guide: ToolGuide,
        kind: MoveKind,
        end: Position,
        feed: Feed,
        path: GuidedPath,
    ) {
        let mut step = self.new_move(kind, end, feed);
        let has_path = matches!(guide, ToolGuide::Plane | ToolGuide::Axes);
        if has_path && matches!(path, GuidedPath::Straight) && !self.state.compensator.is_off() {
            self.name_exit(&end);
        }
        match path {
            GuidedPath::Straight => {}
            GuidedPath::Arc(arc) => step.arc = Some(arc),
            GuidedPath::Spline(spline) => step.spline = Some(spline),
        }
        step.feed = self.feed_of_guided(&step);
        let guided = self.guided_step(guide, step);
        self.emit(self.block.span(), OperationKind::Guided(Box::new(guided)));
    }

    /// A move as one of a guided tool.
    pub(super) fn guided_step(&self, guide: ToolGuide, step: Move) -> GuidedMove {
        let ToolControl { mode, length_offset, tool_length_mm, direction, held, .. } = self.state.tool_control;
        let (length_offset, tool_length_mm) = match mode {
            ToolMode::Plane => (self.state.length.number, Some(self.state.length.length_mm)),
            _ => (length_offset, tool_length_mm),
        };
        let others = letter_bit(b'S') | letter_bit(b'T');
        let is_pure_cut = step.kind == MoveKind::Cutting
            && (step.arc.is_none() && step.spline.is_none())
            && (mode == ToolMode::Angles || mode == ToolMode::Vectors && direction.is_some())
            && held.is_empty()
            && self.state.feed_unit != FeedUnit::InverseTime
            && !self.block.has_codes_besides_motion()
            && self.block.letters & others == 0;
        let (turned, plane) = (self.turned_axes(), self.state.plane_tilted);
        GuidedMove { step, guide, held, turned, length_offset, tool_length_mm, plane, is_pure_cut }
    }

    /// The rotary axes that the block turns by incremental words. Those of a return to the reference position are on their way to a
    /// position.
    fn turned_axes(&self) -> AxisSet {
        let non_modal = self.block.code(Group::NonModal).map(|code| self.table.code(code.place).meaning);
        if matches!(non_modal, Some(Meaning::Reference | Meaning::FurtherReference | Meaning::ReferenceReturn)) {
            return AxisSet::NONE;
        }
        let is_absolute = self.state.absolute || non_modal == Some(Meaning::MachineCoordinates);
        let turned = |place: usize| match self.table.dialect.letters[place] {
            Letter::Axis(axis) if !is_absolute => Some(axis),
            Letter::Increment(axis) => Some(axis),
            _ => None,
        };
        let axes = set_bits(self.block.letters & self.table.axis_letters).filter_map(turned);
        axes.filter(|axis| axis.is_rotary()).fold(AxisSet::NONE, AxisSet::with_axis)
    }

    /// `I J K` as a direction under `G43.5`; the words of the other form are reported.
    fn tool_direction(&mut self, axes: u32) {
        let vector = self.block.letters & VECTOR_LETTERS & !self.used;
        let foreign = match self.state.tool_control.mode {
            ToolMode::Off | ToolMode::Plane => return,
            ToolMode::Angles => vector,
            ToolMode::Vectors => axes & ROTARY_LETTERS,
        };
        if foreign != 0 {
            // The direction next to it is no further mistake.
            self.used |= foreign | vector;
            let place = foreign.trailing_zeros() as usize;
            let span = self.block.word_span(self.block.slot(place));
            let value = self.block.slot(place).number.value();
            let message = match self.state.tool_control.mode {
                ToolMode::Vectors => "an angle of a rotary axis, while G43.5 takes the direction as a vector I J K",
                _ => "a component of a vector, while G43.4 takes the angles of the rotary axes",
            };
            return self.findings.push_with(code::TOOL_DIRECTION, |code| {
                Finding::new(code, span, message)
                    .with_value("word", value, "")
                    .suggest("write one form throughout: G43.4 with A B C, or G43.5 with I J K")
            });
        }
        if self.state.tool_control.mode != ToolMode::Vectors || vector == 0 {
            return;
        }
        let span = self.block.span();
        // A component that is missing is zero. A direction has no unit, so neither inch nor increments scale it.
        let components = [b'I', b'J', b'K'].map(|letter| self.take(letter).map_or(0.0, |word| word.number.value()));
        match normalised(components) {
            Some(direction) => self.state.tool_control.direction = Some(direction),
            None => self.findings.push_with(code::TOOL_DIRECTION, |code| {
                Finding::new(code, span, "the tool direction is a zero vector")
                    .with_value("i", components[0], "")
                    .with_value("j", components[1], "")
                    .with_value("k", components[2], "")
                    .suggest("write the direction from the tip to the spindle, such as I0 J0 K1")
            }),
        }
    }
}

/// The unit vector of finite components; nothing for a zero vector.
pub(super) fn normalised(components: [f64; 3]) -> Option<[f64; 3]> {
    let largest = components.iter().fold(0.0_f64, |largest, component| largest.max(component.abs()));
    if largest == 0.0 {
        return None;
    }
    // The largest component first, so that tiny ones do not underflow.
    let reduced = components.map(|component| component / largest);
    let length = reduced.iter().map(|component| component * component).sum::<f64>().sqrt();
    Some(reduced.map(|component| component / length))
}
