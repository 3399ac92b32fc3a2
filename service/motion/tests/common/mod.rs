//! Seven synthetic programs on which motion is compared, for tests and benches: sharp corners, tangent arcs, and the short
//! blocks that CAM systems write. Each as moves, as elements and as program text.
//!
//! A bench reaches it by `#[path = "../tests/common/mod.rs"] mod common;`.

#![allow(dead_code, reason = "every test uses a part of it")]

mod run;

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use core::fmt::Write;

use feedwave_motion::{Element, Machine, MachineAxis, MachineKind};
use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};

#[allow(unused_imports, reason = "every test uses a part of it")]
pub use run::{Cut, PERIOD_S, planned, request, seconds, smoothed, smoothed_elements, within};

/// X, Y and Z, mm.
pub type Point = [f64; 3];

/// One block of a program; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Block {
    /// Straight to this point.
    Line(Point),
    /// In XY to this point about this centre.
    Arc {
        /// Where it ends.
        end: Point,
        /// X and Y of the centre.
        center: [f64; 2],
        /// Swept angle, rad; positive counter-clockwise.
        sweep_rad: f64,
    },
}

/// A program of cutting blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Name in reports.
    pub name: &'static str,
    /// Where it starts.
    pub start: Point,
    /// Its blocks in order.
    pub blocks: Vec<Block>,
}

/// The machine of the comparison: every axis 200 mm/s, 2 000 mm/s², 30 000 mm/s³.
#[must_use]
pub fn machine() -> Machine {
    let axes = [Axis::X, Axis::Y, Axis::Z].map(|axis| MachineAxis::new(axis, 200.0, 2_000.0, 30_000.0));
    Machine { kind: MachineKind::Mill, axes: axes.to_vec(), max_spindle_rev_per_min: 20_000.0 }
}

/// All seven.
#[must_use]
pub fn programs() -> Vec<Program> {
    vec![zigzag(), pocket(), lines_and_arcs(), chord_circle(), raster(), freeform(), line_arc_line()]
}

/// 40 legs of 5 mm, alternately along X and Y.
#[must_use]
pub fn zigzag() -> Program {
    let mut at = [0.0; 3];
    let legs = (0..40).map(|leg| {
        at[leg % 2] += 5.0;
        Block::Line(at)
    });
    Program { name: "zigzag", start: [0.0; 3], blocks: legs.collect() }
}

/// Three rounds of a pocket, each a rectangle with tangent fillets of 5 mm.
#[must_use]
pub fn pocket() -> Program {
    const FILLET: f64 = 5.0;
    let mut path = Path::at([0.0, -20.0, 0.0]);
    for [half_x, half_y] in [[30.0, 20.0], [20.0, 14.0], [12.0, 8.0]] {
        path.line([0.0, -half_y, 0.0]);
        let mut heading = 0.0;
        for [to_fillet, side] in [[half_x, half_y], [half_y, half_x], [half_x, half_y], [half_y, half_x]] {
            path.ahead(heading, to_fillet - FILLET);
            path.turn(heading, FILLET, FRAC_PI_2);
            heading += FRAC_PI_2;
            path.ahead(heading, side - FILLET);
        }
    }
    path.named("pocket")
}

/// Lines of 8 to 20 mm that run into arcs of 4 to 12 mm radius, to both sides, all tangent.
#[must_use]
pub fn lines_and_arcs() -> Program {
    let mut path = Path::at([0.0; 3]);
    let mut heading = 0.0;
    let turns = [[12.0, 6.0, 1.2], [8.0, 10.0, -0.9], [20.0, 4.0, -1.6], [10.0, 12.0, 2.2], [15.0, 5.0, -1.0]];
    for [length, radius, sweep_rad] in turns.into_iter().chain(turns.map(|[length, r, sweep]| [length, r, -sweep])) {
        path.ahead(heading, length);
        path.turn(heading, radius, sweep_rad);
        heading += sweep_rad;
    }
    path.ahead(heading, 10.0);
    path.named("lines and arcs")
}

/// A full circle of 20 mm radius in chords of about 0.2 mm.
#[must_use]
pub fn chord_circle() -> Program {
    const CHORDS: u32 = 628;
    let at = |k: u32| {
        let (sin, cos) = sincos(TAU * f64::from(k) / f64::from(CHORDS));
        [20.0 * cos, 20.0 * sin, 0.0]
    };
    Program { name: "chord circle", start: at(0), blocks: (1..=CHORDS).map(|k| Block::Line(at(k))).collect() }
}

/// The circle of [`chord_circle`] as one arc.
#[must_use]
pub fn one_circle() -> Program {
    let start = [20.0, 0.0, 0.0];
    let arc = Block::Arc { end: start, center: [0.0; 2], sweep_rad: TAU };
    Program { name: "one arc", start, blocks: vec![arc] }
}

/// Eight lines to and fro over a wavy surface in blocks of 0.1 to 0.5 mm, written to a micrometre.
#[must_use]
pub fn raster() -> Program {
    let mut path = Path::at(surface(0.0, 0.0));
    let mut step = 0_u32;
    for row in 0..8 {
        let y = f64::from(row);
        let forth = row % 2 == 0;
        let place = |along: f64| surface(if forth { along } else { 30.0 - along }, y);
        let mut along = 0.0;
        path.line(place(0.0));
        while along < 30.0 {
            // Lengths that repeat after 97 blocks only.
            along = (along + 0.1 + 0.4 * f64::from((step * 37) % 97) / 96.0).min(30.0);
            step += 1;
            path.line(place(along));
        }
    }
    path.named("raster")
}

/// A curve of changing curvature in blocks of 0.2 mm, written to a micrometre.
#[must_use]
pub fn freeform() -> Program {
    let at = |t: f64| {
        let (wide, slow) = (sincos(t), sincos(2.0 * t + 0.4));
        let quick = sincos(5.0 * t);
        rounded([30.0 * wide.1 + 3.0 * quick.1, 20.0 * wide.0 + 5.0 * slow.0 + 2.0 * quick.0, 2.0 * slow.1])
    };
    let mut path = Path::at(at(0.0));
    let mut t = 0.0;
    while t < TAU {
        // The length of the chord follows the parameter closely enough in steps of 0.2 mm.
        let ahead = at(t + 1e-3);
        let here = at(t - 1e-3);
        let speed = distance(here, ahead) / 2e-3;
        t = (t + 0.2 / speed).min(TAU);
        path.line(at(t));
    }
    path.named("freeform")
}

/// As many blocks of 0.2 mm along a curve with ripples that stays within 40 mm, written to a tenth of a micrometre: a program as
/// long as one likes, of curves that a common feed passes alternate with such that it has to slow down for.
#[must_use]
pub fn ripples(blocks: usize) -> Program {
    let at = |t: f64| {
        let (once, twice, five) = (sincos(t), sincos(2.0 * t + 0.4), sincos(5.0 * t));
        let ripple = [sincos(31.0 * t).0, sincos(29.0 * t).1].map(|ripple| 0.4 * ripple);
        let x = 30.0 * once.1 + 3.0 * five.1 + ripple[0];
        let y = 20.0 * once.0 + 5.0 * twice.0 + 2.0 * five.0 + ripple[1];
        [x, y, 2.0 * twice.1 + 0.01 * t]
    };
    let mut path = Path::at(at(0.0));
    let mut t = 0.0;
    for _ in 0..blocks {
        let speed = distance(at(t - 1e-4), at(t + 1e-4)) / 2e-4;
        t += 0.2 / speed;
        path.line(at(t).map(|value| (value * 1e4).round() / 1e4));
    }
    path.named("ripples")
}

/// A line of 30 mm, a tangent quarter circle of 10 mm radius, and a line of 30 mm.
#[must_use]
pub fn line_arc_line() -> Program {
    let mut path = Path::at([0.0; 3]);
    path.ahead(0.0, 30.0);
    path.turn(0.0, 10.0, FRAC_PI_2);
    path.ahead(FRAC_PI_2, 30.0);
    path.named("line-arc-line")
}

impl Program {
    /// Its elements, without blocks that do not move; block k is on line k + 1.
    #[must_use]
    pub fn elements(&self) -> Vec<Element> {
        let mut start = self.start;
        let mut elements = Vec::new();
        for (line, block) in (1..).zip(&self.blocks) {
            let (end, arc) = match *block {
                Block::Line(end) => (end, None),
                Block::Arc { end, center, sweep_rad } => {
                    let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep_rad < 0.0, sweep_rad };
                    (end, Some(arc))
                }
            };
            let mv = Move {
                kind: MoveKind::Cutting,
                start: position(start),
                end: position(end),
                work_offset: [0.0; 9],
                arc,
                spline: None,
                path_control: PathControl::default(),
                feed: Feed::PerMinute(FEED_MM_PER_MIN),
                spindle: Spindle::STOPPED,
                tool: 0,
                cycle: None,
                leads_xyz: false,
            };
            elements
                .extend(Element::from_move(&mv, SourceSpan { line, column: 1, length: 1, ..SourceSpan::default() }));
            start = end;
        }
        elements
    }

    /// It as a program under this path control, such as `G61.1` or `G64 P0.05`.
    #[must_use]
    pub fn text(&self, control: &str) -> String {
        let [x, y, z] = self.start;
        let mut text =
            format!("G17 G21 G90 G94 M3 S10000 F{FEED_MM_PER_MIN:.1} {control}\nG0 X{x:.9} Y{y:.9} Z{z:.9}\n");
        let mut start = self.start;
        for block in &self.blocks {
            let written = match *block {
                Block::Line([x, y, z]) => {
                    start = [x, y, z];
                    writeln!(text, "G1 X{x:.9} Y{y:.9} Z{z:.9}")
                }
                Block::Arc { end: [x, y, z], center, sweep_rad } => {
                    let code = if sweep_rad < 0.0 { 2 } else { 3 };
                    let [i, j] = [center[0] - start[0], center[1] - start[1]];
                    start = [x, y, z];
                    writeln!(text, "G{code} X{x:.9} Y{y:.9} Z{z:.9} I{i:.9} J{j:.9}")
                }
            };
            written.expect("a string takes everything");
        }
        text + "M30\n"
    }
}

/// Fast enough that the axes decide.
pub const FEED_MM_PER_MIN: f64 = 60_000.0;

/// A path under construction.
pub struct Path {
    start: Point,
    at: Point,
    blocks: Vec<Block>,
}

impl Path {
    /// Begins at this point.
    pub fn at(start: Point) -> Self {
        Self { start, at: start, blocks: Vec::new() }
    }

    fn line(&mut self, end: Point) {
        if end != self.at {
            self.blocks.push(Block::Line(end));
            self.at = end;
        }
    }

    /// A line of this length in XY.
    pub fn ahead(&mut self, heading_rad: f64, length: f64) {
        let (sin, cos) = sincos(heading_rad);
        self.line([self.at[0] + length * cos, self.at[1] + length * sin, self.at[2]]);
    }

    /// A tangent arc, to the left where `sweep_rad` is positive.
    pub fn turn(&mut self, heading_rad: f64, radius: f64, sweep_rad: f64) {
        let side = radius * sweep_rad.signum();
        let (sin, cos) = sincos(heading_rad);
        let center = [self.at[0] - side * sin, self.at[1] + side * cos];
        let (sin, cos) = sincos(heading_rad + sweep_rad);
        let end = [center[0] + side * sin, center[1] - side * cos, self.at[2]];
        self.blocks.push(Block::Arc { end, center, sweep_rad });
        self.at = end;
    }

    /// The program of it.
    pub fn named(self, name: &'static str) -> Program {
        Program { name, start: self.start, blocks: self.blocks }
    }
}

/// A point of the wavy surface, written to a micrometre.
fn surface(x: f64, y: f64) -> Point {
    let (along, across) = (sincos(PI * x / 10.0), sincos(PI * y / 6.0));
    rounded([x, y, 1.5 * along.0 + 0.5 * across.1])
}

fn rounded(point: Point) -> Point {
    point.map(|value| (value * 1e3).round() / 1e3)
}

fn distance(a: Point, b: Point) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis])).sum::<f64>().sqrt()
}

/// The same on every platform.
fn sincos(angle_rad: f64) -> (f64, f64) {
    feedwave_motion::sincos_turns(angle_rad / TAU)
}

fn position([x, y, z]: Point) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}
