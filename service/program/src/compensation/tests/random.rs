//! Random contours, convex and concave, with slots narrower than the tool, against brute force: no point of the tool is nearer
//! to the contour than its radius, unless that was reported, and nothing is reported that is not so.

use core::f64::consts::{PI, TAU};

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use super::*;
use crate::{ArcGeometry, Feed, MoveKind, PathControl, Position, Spindle};

/// Contours in the suite.
const CASES: u32 = 150;
/// Contours in the long form.
const MANY_CASES: u32 = 10_000;
/// Points per stretch of the path.
const SAMPLES: usize = 40;
/// The tool may be that much too near, mm.
const TOLERANCE_MM: f64 = 1e-6;

const RADIUS_MM: f64 = 3.0;

/// A block of a contour.
#[derive(Clone, Copy, Debug)]
enum Element {
    /// Turn before it, rad, and length, mm.
    Line(f64, f64),
    /// Turn before it, rad, radius, mm, and angle, rad.
    Arc(f64, f64, f64),
    /// Down a slot of this width and up again: turns to this side.
    Slot(f64, f64, bool),
}

fn turn() -> impl Strategy<Value = f64> {
    prop_oneof![3 => -3.0..3.0_f64, 2 => Just(0.0), 1 => -0.2..0.2_f64, 1 => Just(PI / 2.0), 1 => Just(-PI / 2.0)]
}

fn element() -> impl Strategy<Value = Element> {
    let length = prop_oneof![0.3..4.0_f64, 4.0..25.0_f64];
    let radius = prop_oneof![0.5..4.0_f64, 4.0..20.0_f64];
    let sweep = (0.2..4.5_f64, any::<bool>()).prop_map(|(sweep, left)| if left { sweep } else { -sweep });
    prop_oneof![
        4 => (turn(), length).prop_map(|(turn, length)| Element::Line(turn, length)),
        4 => (turn(), radius, sweep).prop_map(|(turn, radius, sweep)| Element::Arc(turn, radius, sweep)),
        1 => (1.0..9.0_f64, 3.0..15.0_f64, any::<bool>()).prop_map(|(width, depth, left)| Element::Slot(width, depth, left)),
    ]
}

fn rules() -> impl Strategy<Value = CompensationRules> {
    let entry = prop_oneof![Just(CompensationEntry::A), Just(CompensationEntry::B)];
    let corner = prop_oneof![Just(CompensationCorner::Linear), Just(CompensationCorner::Circular)];
    prop_oneof![
        Just(CompensationRules::LinuxCnc),
        (entry, corner).prop_map(|(entry, corner)| CompensationRules::Fanuc { entry, corner }),
    ]
}

/// The moves of a contour: an entry, its blocks, and an exit.
struct Writer {
    moves: Vec<Move>,
    at: [f64; 2],
    heading: f64,
}

impl Writer {
    fn step(&mut self, to: [f64; 2], arc: Option<ArcGeometry>) {
        let position = |[x, y]: [f64; 2]| -> Position {
            let mut position = [0.0; 9];
            [position[0], position[1]] = [x, y];
            position
        };
        self.moves.push(Move {
            kind: MoveKind::Cutting,
            start: position(self.at),
            end: position(to),
            work_offset: [0.0; 9],
            arc,
            spline: None,
            path_control: PathControl::ExactPath,
            feed: Feed::PerMinute(100.0),
            spindle: Spindle::STOPPED,
            tool: 1,
            leads_xyz: false,
            cycle: None,
        });
        self.at = to;
    }

    fn line(&mut self, turn: f64, length: f64) {
        self.heading += turn;
        let (sine, cosine) = libm::sincos(self.heading);
        self.step([self.at[0] + length * cosine, self.at[1] + length * sine], None);
    }

    fn element(&mut self, element: Element) {
        match element {
            Element::Line(turn, length) => self.line(turn, length),
            Element::Slot(width, depth, left) => {
                let turn = if left { PI / 2.0 } else { -PI / 2.0 };
                [depth, width, depth].into_iter().for_each(|length| self.line(turn, length));
            }
            Element::Arc(turn, radius, sweep_rad) => {
                self.heading += turn;
                let (sine, cosine) = libm::sincos(self.heading);
                let out = radius.copysign(sweep_rad);
                let center = [self.at[0] - out * sine, self.at[1] + out * cosine];
                self.heading += sweep_rad;
                let (sine, cosine) = libm::sincos(self.heading);
                let to = [center[0] + out * sine, center[1] - out * cosine];
                let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep_rad < 0.0, sweep_rad };
                self.step(to, Some(arc));
            }
        }
    }
}

/// The moves of a contour with its entry and its exit.
fn contour(elements: &[Element], entry_turn: f64) -> Vec<Move> {
    let mut writer = Writer { moves: Vec::new(), at: [0.0; 2], heading: 0.0 };
    writer.line(0.0, 4.0 * RADIUS_MM);
    writer.heading += entry_turn;
    elements.iter().for_each(|&element| writer.element(element));
    writer.line(0.4, 4.0 * RADIUS_MM);
    writer.moves
}

/// Distance of a point from a curve, by the angle about the centre of an arc.
fn distance_from(step: &Move, point: [f64; 2]) -> f64 {
    let to = |x: f64, y: f64| (point[0] - x).hypot(point[1] - y);
    let ends = to(step.start[0], step.start[1]).min(to(step.end[0], step.end[1]));
    match &step.arc {
        None => {
            let [x, y] = [step.end[0] - step.start[0], step.end[1] - step.start[1]];
            let share = ((point[0] - step.start[0]) * x + (point[1] - step.start[1]) * y) / (x * x + y * y);
            to(step.start[0] + share.clamp(0.0, 1.0) * x, step.start[1] + share.clamp(0.0, 1.0) * y)
        }
        Some(arc) => {
            let angle = |x: f64, y: f64| libm::atan2(y - arc.center[1], x - arc.center[0]);
            let passed = angle(point[0], point[1]) - angle(step.start[0], step.start[1]);
            let passed = if arc.clockwise { -passed } else { passed }.rem_euclid(TAU);
            if passed <= arc.sweep_rad.abs() {
                let radius = (step.end[0] - arc.center[0]).hypot(step.end[1] - arc.center[1]);
                return (to(arc.center[0], arc.center[1]) - radius).abs();
            }
            ends
        }
    }
}

/// Points of a move, and how far apart they are.
fn points(step: &Move) -> (Vec<[f64; 2]>, f64) {
    let length = match &step.arc {
        None => (step.end[0] - step.start[0]).hypot(step.end[1] - step.start[1]),
        Some(arc) => arc.sweep_rad.abs() * (step.start[0] - arc.center[0]).hypot(step.start[1] - arc.center[1]),
    };
    let at = |place: usize| {
        let share = place as f64 / SAMPLES as f64;
        match &step.arc {
            None => [0, 1].map(|axis| step.start[axis] + (step.end[axis] - step.start[axis]) * share),
            Some(arc) => {
                // The radius changes evenly where those of both ends differ.
                let out = [step.start[0] - arc.center[0], step.start[1] - arc.center[1]];
                let end = (step.end[0] - arc.center[0]).hypot(step.end[1] - arc.center[1]);
                let scale = 1.0 + (end / out[0].hypot(out[1]) - 1.0) * share;
                let (sine, cosine) = libm::sincos(arc.sweep_rad * share);
                [
                    arc.center[0] + (out[0] * cosine - out[1] * sine) * scale,
                    arc.center[1] + (out[0] * sine + out[1] * cosine) * scale,
                ]
            }
        }
    };
    ((0..=SAMPLES).map(at).collect(), length / SAMPLES as f64)
}

/// By how much the tool is too near to the contour on these moves, and how far apart the points are that say so.
fn overcut<'a>(path: impl Iterator<Item = &'a Move>, contour: &[Move]) -> (f64, f64) {
    path.fold((f64::NEG_INFINITY, 0.0), |(worst, widest), step| {
        let (points, apart) = points(step);
        let depth = points
            .into_iter()
            .flat_map(|point| contour.iter().map(move |block| RADIUS_MM - distance_from(block, point)))
            .fold(worst, f64::max);
        (depth, f64::max(widest, apart))
    })
}

/// Largest reported depth of a code.
fn reported(findings: &FindingLog, code: crate::FindingCode) -> f64 {
    let of_code = findings.findings().iter().filter(|found| found.code == code && found.severity == code.severity());
    let depths = of_code.flat_map(|found| &found.values).filter(|value| value.name == "depth");
    depths.fold(f64::NEG_INFINITY, |worst, value| worst.max(value.value))
}

/// What happened to a contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Clean,
    Warned,
    Refused,
}

fn check(elements: &[Element], entry_turn: f64, left: bool, rules: CompensationRules) -> Outcome {
    let programmed = contour(elements, entry_turn);
    let mode =
        CompensationMode { left, plane: Plane::Xy, tilted: false, radius_mm: RADIUS_MM, reference_mm: [0.0; 2], rules };
    let mut stage = Compensator::default();
    let (mut out, mut findings) = (Vec::new(), FindingLog::default());
    let span = |line: usize| SourceSpan { line: line as u32, column: 1, length: 1, ..SourceSpan::default() };
    let last = programmed.len();
    let mut push = |line: usize, kind: OperationKind| {
        stage.push(Operation { span: span(line), kind }, &mut out, &mut findings);
    };
    push(1, OperationKind::Compensation(CompensationCommand::On(mode)));
    for (index, step) in programmed.iter().enumerate() {
        if index + 1 == last {
            push(last, OperationKind::Compensation(CompensationCommand::Off));
        }
        push(index + 1, OperationKind::Move(step.clone()));
    }
    assert!(stage.is_off());
    is_continuous(&out);
    if findings.has_errors() {
        return Outcome::Refused;
    }
    let blocks = &programmed[1..last - 1];
    let path: Vec<_> = out.iter().filter(|operation| operation.span.line > 1).collect();
    let path = moves_of(&path);
    let (depth, apart) = overcut(path[..path.len() - 1].iter().copied(), blocks);
    let gouge = reported(&findings, crate::code::COMP_GOUGE);
    let straight = reported(&findings, crate::code::COMP_STRAIGHT);
    // Cuts into arcs that lead to the contour or away from it are reported as such.
    let link = reported(&findings, crate::code::COMP_GOUGE_LINK);
    let said = gouge.max(link).max(0.0) + straight.max(0.0);
    assert!(depth <= TOLERANCE_MM + said, "{depth}: {gouge} {link} {straight}");
    assert!(gouge == f64::NEG_INFINITY || depth >= gouge - apart, "{depth} is not {gouge}");
    let links: Vec<_> = moves_of(&out.iter().collect::<Vec<_>>());
    let (depth, _) = overcut([links[0], links[links.len() - 1]].into_iter(), blocks);
    assert!(depth <= TOLERANCE_MM + link.max(0.0), "{depth} on a link: {link}");
    if gouge > 0.0 { Outcome::Warned } else { Outcome::Clean }
}

fn moves_of<'a>(operations: &[&'a Operation]) -> Vec<&'a Move> {
    let moves = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Move(step) => Some(step),
        _ => None,
    });
    moves.collect()
}

/// How many contours came out clean, with a warning, and refused.
fn check_many(cases: u32) -> [u32; 3] {
    let strategy = (proptest::collection::vec(element(), 1..9), turn(), any::<bool>(), rules());
    let counts = core::cell::Cell::new([0; 3]);
    let config = proptest::repeatable(Config { cases, ..Config::default() });
    let result = TestRunner::new(config).run(&strategy, |(elements, entry_turn, left, rules)| {
        let outcome = check(&elements, entry_turn, left, rules);
        let mut now = counts.get();
        now[outcome as usize] += 1;
        counts.set(now);
        Ok(())
    });
    assert!(result.is_ok(), "{}", result.unwrap_err());
    counts.get()
}

#[test]
fn random_contours_are_not_cut_into_unreported() {
    let [clean, warned, refused] = check_many(CASES);
    assert!(clean >= CASES / 10 && warned > 0 && refused > 0, "{clean} clean, {warned} warned, {refused} refused");
}

#[test]
#[ignore = "the long form: minutes without optimisation"]
fn ten_thousand_random_contours_are_not_cut_into_unreported() {
    let [clean, warned, refused] = check_many(MANY_CASES);
    assert!(clean >= MANY_CASES / 10 && warned > 0 && refused > 0, "{clean} clean, {warned} warned, {refused} refused");
}
