//! Polar coordinates (`G16`), mirror image (`G51.1`), scaling (`G51`) and rotation (`G68`) of FANUC and Haas mills.
//!
//! They are switched on in the order mirror image, scaling, rotation, radius compensation, and off in the reverse order.

use super::Execution;
use crate::block::Word;
use crate::code;
use crate::coordinates::{Polar, Rotation, Scaling, Transform, direction};
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::ToolMode;
use crate::{Axis, Finding, Position, SourceSpan};

/// Letters of the factors of a scaling along X, Y and Z.
const FACTORS: [u8; 3] = [b'I', b'J', b'K'];

/// In which order the stages are switched on.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Stage {
    Mirror,
    Scaling,
    Rotation,
}

impl Stage {
    const fn name(self) -> &'static str {
        match self {
            Self::Mirror => "the mirror image (G51.1)",
            Self::Scaling => "the scaling (G51)",
            Self::Rotation => "the rotation (G68)",
        }
    }
}

impl Execution<'_> {
    /// The codes of a block: what goes off, last stage first, then what comes on.
    #[cold]
    pub(super) fn planar_codes(&mut self) {
        match self.code(Group::Rotation) {
            Some((Meaning::RotationOff, span)) => self.rotation_off(span),
            Some((Meaning::Rotation, span)) => self.rotation_on(span),
            _ => {}
        }
        if let Some((Meaning::Scaling { on }, span)) = self.code(Group::Scaling) {
            if on { self.scaling_on(span) } else { self.scaling_off(span) }
        }
        match self.code(Group::Mirror) {
            Some((Meaning::Mirror { on: true }, span)) => self.mirror_on(span, false),
            Some((Meaning::Mirror { on: false }, span)) => self.mirror_off(span),
            Some((Meaning::HaasMirror { on }, span)) => {
                if self.is_other_style(span, "G100 and G101 are the mirror image of Haas controls") {
                    self.take_axes();
                } else if on {
                    self.mirror_on(span, true);
                } else {
                    self.mirror_off(span);
                }
            }
            _ => {}
        }
        if let Some((Meaning::Polar { on }, span)) = self.code(Group::PolarCoordinates) {
            self.switch_polar(on, span);
        }
    }

    fn switch_polar(&mut self, on: bool, span: SourceSpan) {
        if !on {
            self.state.coords.polar = None;
            return;
        }
        if self.is_five_axis(span, "polar coordinates") || self.state.coords.polar.is_some() {
            return;
        }
        let plane = Some(self.state.plane);
        self.state.coords.polar = Some(Polar { plane, on_line: span.line, ..Polar::default() });
    }

    /// The stages that are on.
    fn transform(&self) -> Transform {
        self.state.coords.transform.as_deref().copied().unwrap_or_default()
    }

    /// Whether tool centre point control, a tilted plane or what they leave does not permit a transformation, which is then reported.
    fn is_five_axis(&mut self, span: SourceSpan, what: &str) -> bool {
        let control = &self.state.tool_control;
        if control.mode == ToolMode::Off && control.held.is_empty() {
            return false;
        }
        let message = if control.mode == ToolMode::Off {
            format!("{what}, while only the machine knows where the axes are")
        } else {
            format!("{what} under tool centre point control or in a tilted plane")
        };
        self.coord(
            code::COORD_BLOCK,
            span,
            message,
            "switch it off with G49 or G69, and place every axis with an absolute word",
        );
        true
    }

    /// Whether a later stage is on, so that this one cannot be switched; that is then reported.
    fn is_out_of_order(&mut self, stage: Stage, span: SourceSpan) -> bool {
        let transform = self.transform();
        let (later, cure) = match () {
            () if self.state.compensation.on.is_some() => ("the radius compensation", "switch it off with G40 first"),
            () if stage < Stage::Rotation && transform.rotation.is_some() => {
                (Stage::Rotation.name(), "switch it off with G69 first")
            }
            () if stage < Stage::Scaling && transform.scaling.is_some() => {
                (Stage::Scaling.name(), "switch it off with G50 first")
            }
            () => return false,
        };
        let message = format!("{} cannot be switched while {later} is on", stage.name());
        self.coord(code::COORD_ORDER, span, message, cure);
        true
    }

    fn replace(&mut self, transform: Transform) {
        self.rebase(|state| state.coords.set_transform(transform));
    }

    /// The words of the axes X, Y and Z, mm; others are refused. Nothing after a finding.
    fn linear_words(&mut self, span: SourceSpan, what: &str) -> Option<[Option<f64>; 3]> {
        let mut words = [None; 3];
        for (axis, increment, value) in self.take_axes() {
            let Some(word) = words.get_mut(axis.index()).filter(|_| !increment) else {
                let message = format!("{what} takes no {}", axis.letter());
                self.coord(code::COORD_WORD, span, message, "name X, Y and Z only");
                return None;
            };
            *word = Some(value);
        }
        Some(words)
    }

    /// Whether `G91` makes the words of a code doubtful, which is then reported.
    fn is_incremental(&mut self, span: SourceSpan, what: &str) -> bool {
        if self.state.absolute {
            return false;
        }
        let message = format!("whether the words of {what} are incremental under G91 depends on the control");
        self.coord(code::COORD_AMBIGUOUS, span, message, "write G90 in the block before it");
        true
    }

    fn mirror_on(&mut self, span: SourceSpan, about_zero: bool) {
        let name = if about_zero { "G101" } else { "G51.1" };
        let Some(words) = self.linear_words(span, name) else { return };
        if words == [None; 3] {
            let message = format!("{name} names no axis");
            return self.coord(code::COORD_WORD, span, message, "add the axes to mirror, such as X0");
        }
        if self.is_five_axis(span, "a mirror image")
            || !about_zero && self.is_incremental(span, name)
            || self.is_out_of_order(Stage::Mirror, span)
        {
            return;
        }
        let mut transform = self.transform();
        for (mirror, word) in transform.mirror.iter_mut().zip(words) {
            *mirror = word.map(|value| if about_zero { 0.0 } else { value }).or(*mirror);
        }
        self.replace(transform);
    }

    fn mirror_off(&mut self, span: SourceSpan) {
        let Some(words) = self.linear_words(span, "the end of a mirror image") else { return };
        let mut transform = self.transform();
        if transform.mirror == [None; 3] {
            return;
        }
        if words == [None; 3] {
            return self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "whether the end of a mirror image without axes is that of all depends on the control",
                "name the axes, such as X0 Y0",
            );
        }
        if self.is_out_of_order(Stage::Mirror, span) {
            return;
        }
        for (mirror, word) in transform.mirror.iter_mut().zip(words) {
            *mirror = mirror.filter(|_| word.is_none());
        }
        self.replace(transform);
    }

    fn scaling_on(&mut self, span: SourceSpan) {
        let factors = self.factors(span);
        let Some(words) = self.linear_words(span, "G51") else { return };
        let Some(factors) = factors else { return };
        if self.is_five_axis(span, "a scaling")
            || words != [None; 3] && self.is_incremental(span, "G51")
            || self.is_out_of_order(Stage::Scaling, span)
        {
            return;
        }
        let mut transform = self.transform();
        if transform.scaling.is_some() {
            return self.coord(
                code::COORD_ORDER,
                span,
                "the scaling (G51) is on already",
                "switch it off with G50 first",
            );
        }
        let Some(center) = self.center(&transform, words, span) else { return };
        transform.scaling = Some(Scaling { center: [center[0], center[1], center[2]], factors });
        self.replace(transform);
    }

    fn scaling_off(&mut self, span: SourceSpan) {
        let mut transform = self.transform();
        if transform.scaling.is_none() || self.is_out_of_order(Stage::Scaling, span) {
            return;
        }
        transform.scaling = None;
        self.replace(transform);
    }

    /// The factors of `G51`; nothing after a finding.
    fn factors(&mut self, span: SourceSpan) -> Option<[f64; 3]> {
        let all = self.take(b'P');
        let each = FACTORS.map(|letter| self.take(letter));
        let given = each.iter().flatten().count();
        let factors = match all {
            Some(word) if given == 0 => {
                let factor = self.factor(&word)?;
                [factor; 3]
            }
            Some(word) => {
                self.word_conflict(&word, "G51 takes one factor P, or factors I, J and K");
                return None;
            }
            None if given == 3 => {
                let mut factors = [1.0; 3];
                for (factor, word) in factors.iter_mut().zip(each.iter().flatten()) {
                    *factor = self.factor(word)?;
                }
                factors
            }
            None => {
                let message = "a factor that is not written is a parameter of the control";
                self.coord(
                    code::COORD_SETTING,
                    span,
                    message,
                    "write the factor P, or all of I, J and K, such as P2. or I2. J2. K1.",
                );
                return None;
            }
        };
        Some(factors)
    }

    fn factor(&mut self, word: &Word) -> Option<f64> {
        let span = self.block.word_span(word);
        let value = word.number.value();
        if !word.number.has_point() && self.is_haas() {
            let message = "whether a factor without a decimal point is in thousandths depends on the control";
            self.coord(code::COORD_AMBIGUOUS, span, message, "write it with a decimal point");
            return None;
        }
        // Without a decimal point it is in thousandths.
        let factor = if word.number.has_point() { value } else { value / 1_000.0 };
        if factor.abs() >= 1e-5 && factor.abs() <= 1e5 {
            return Some(factor);
        }
        self.findings.push_with(code::COORD_WORD, |code| {
            Finding::new(code, span, format!("a factor of {factor} scales to nothing, or without bounds"))
                .with_value("factor", factor, "")
                .suggest("write the factor with a decimal point, such as P0.5")
        });
        None
    }

    fn rotation_on(&mut self, span: SourceSpan) {
        let angle = self.take(b'R');
        let plane = self.state.plane;
        let (first, second) = plane.axes();
        let mut words = [None; 3];
        let mut foreign = None;
        for (axis, increment, value) in self.take_axes() {
            match words.get_mut(axis.index()).filter(|_| !increment && (axis == first || axis == second)) {
                Some(word) => *word = Some(value),
                None => foreign = Some(axis),
            }
        }
        if let Some(axis) = foreign {
            let message = format!("{} is no axis of the plane of the rotation", axis.letter());
            return self.coord(code::COORD_WORD, span, message, "write the centre along the axes of the plane");
        }
        let Some(angle) = angle else {
            let message = "the angle of a rotation that is not written is a parameter of the control";
            return self.coord(code::COORD_SETTING, span, message, "write the angle R");
        };
        if self.is_five_axis(span, "a rotation")
            || self.is_incremental(span, "G68")
            || self.is_out_of_order(Stage::Rotation, span)
        {
            return;
        }
        let mut transform = self.transform();
        let is_whole = words[first.index()].is_some() && words[second.index()].is_some();
        if let Some(rotation) = transform.rotation
            && (!is_whole || rotation.plane != plane)
        {
            let message =
                "a rotation is on already, and controls differ in what a further one without its centre turns about";
            return self.coord(
                code::COORD_AMBIGUOUS,
                span,
                message,
                "switch it off with G69 first, or write the whole centre",
            );
        }
        let angle_deg = self.scaled(&angle, false);
        let Some(center) = self.center(&transform, words, span) else { return };
        if let Some(scaling) = transform.scaling {
            // The centre is a programmed point as any other.
            let scaled = |axis: Axis| {
                let place = axis.index();
                match words[place] {
                    Some(_) => scaling.center[place] + scaling.factors[place] * (center[place] - scaling.center[place]),
                    None => self.before_rotation(&transform)[place],
                }
            };
            transform.rotation = Some(Rotation::new(plane, [scaled(first), scaled(second)], angle_deg));
        } else {
            transform.rotation = Some(Rotation::new(plane, [center[first.index()], center[second.index()]], angle_deg));
        }
        self.replace(transform);
        self.state.coords.awaits_absolute = true;
    }

    /// The present position, mirrored and scaled.
    fn before_rotation(&self, transform: &Transform) -> Position {
        transform.before_rotation(&self.state.position)
    }

    /// `G69`, which ends a tilted plane as well.
    fn rotation_off(&mut self, span: SourceSpan) {
        let mut transform = self.transform();
        if transform.rotation.is_none() || self.is_out_of_order(Stage::Rotation, span) {
            return;
        }
        transform.rotation = None;
        self.replace(transform);
        self.state.coords.awaits_absolute = true;
    }

    /// The centre that words name behind the mirror image; where there is none, the present position. Nothing after a finding.
    fn center(&mut self, transform: &Transform, words: [Option<f64>; 3], span: SourceSpan) -> Option<Position> {
        let mirror = Transform { mirror: transform.mirror, ..Transform::default() };
        let mut center = mirror.apply(&self.state.position);
        for ((place, word), mirrored) in words.iter().enumerate().zip(transform.mirror) {
            let Some(value) = *word else { continue };
            if mirrored.is_some_and(|at| 2.0 * at - value != value) {
                let message = "whether a mirror image mirrors the centre of a scaling or a rotation as well depends on the control";
                self.coord(code::COORD_AMBIGUOUS, span, message, "go to the centre, and leave its coordinates out");
                return None;
            }
            center[place] = value;
        }
        Some(center)
    }

    /// The words of the plane as a radius and an angle; returns the mask of the others.
    #[cold]
    pub(in super::super) fn polar_target(&mut self, axes: u32, end: &mut Position) -> u32 {
        let Some(mut polar) = self.state.coords.polar else { return axes };
        let (first, second) = self.state.plane.axes();
        let letter = |axis: Axis| letter_bit(axis.letter() as u8);
        let [radius, angle] = [first, second].map(|axis| {
            let is_there = axes & letter(axis) != 0;
            is_there.then(|| *self.block.slot(usize::from(axis.letter() as u8 - b'A')))
        });
        let others = axes & !letter(first) & !letter(second);
        if radius.is_none() && angle.is_none() {
            return others;
        }
        let is_incremental = !self.state.absolute;
        let mut pole = [0.0; 2];
        if let Some(word) = radius {
            polar.radius_mm = Some(self.scaled(&word, true));
            polar.from_present = is_incremental;
            if is_incremental {
                pole = [end[first.index()], end[second.index()]];
            }
        } else if polar.from_present {
            let span = self.block.span();
            self.coord(
                code::COORD_AMBIGUOUS,
                span,
                "an angle alone behind a radius from the present position: controls differ in the pole",
                "write the radius as well",
            );
            return others;
        }
        if let Some(word) = angle {
            let value = self.scaled(&word, false);
            let adds = is_incremental && radius.is_none();
            polar.angle_deg = if adds { polar.angle_deg.map(|before| before + value) } else { Some(value) };
        }
        let (Some(radius_mm), Some(angle_deg)) = (polar.radius_mm, polar.angle_deg) else {
            let span = self.block.span();
            let message = "polar coordinates need a radius and an angle, and one of them has not been written yet";
            self.coord(code::COORD_WORD, span, message, "write both in the first block behind G16");
            return others;
        };
        self.state.coords.polar = Some(polar);
        let [cosine, sine] = direction(angle_deg);
        end[first.index()] = pole[0] + radius_mm * cosine;
        end[second.index()] = pole[1] + radius_mm * sine;
        others
    }

    /// Warns of a move directly behind the start or the end of a rotation that is incremental, or names one axis of the plane alone.
    #[cold]
    pub(in super::super) fn check_absolute(&mut self, axes: u32) {
        let (first, second) = self.state.plane.axes();
        let in_plane = letter_bit(first.letter() as u8) | letter_bit(second.letter() as u8);
        if axes & in_plane == 0 {
            return;
        }
        self.state.coords.awaits_absolute = false;
        let (message, cure) = match (self.state.absolute, axes & in_plane == in_plane) {
            (true, true) => return,
            (false, _) => (
                "the first move behind the start or the end of a rotation is incremental: it is counted from the present \
                 place in the coordinates that are in force now",
                "let an absolute move come first",
            ),
            (true, false) => (
                "the first move behind the start or the end of a rotation names one axis of the plane: the other one stays \
                 at its present place in the coordinates that are in force now, on other controls at its programmed value",
                "name both axes of the plane in it",
            ),
        };
        let span = self.block.span();
        self.coord(code::COORD_INCREMENT, span, message, cure);
    }
}
