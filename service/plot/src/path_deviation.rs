//! Picture of the path as programmed and as run: how far they are apart in colour, and the worst places close up.

use std::ops::Range;

use plotters::style::RGBColor;

use super::figure::{Axis, Beside, Figure, Layout, MM, Panel, Place, extent, padded, short};
use super::theme::{self, Ink};
use super::trace::{PathTrace, Point};

/// Steps of colour.
const LEVELS: usize = 4;
/// From where the paths nearly are one to where they are farthest apart; told apart without seeing red or green.
const COLORS: [RGBColor; LEVELS] = [theme::RAPID, theme::COMMAND, theme::GOOD, theme::VIBRATION];
/// Width of the path as run, design units.
const WIDTHS: [f64; LEVELS] = [2.0, 2.6, 3.2, 3.8];
/// Half of a close view's side as a multiple of the deviation there.
const CLOSE_FACTOR: f64 = 12.0;
/// Least and largest half side of a close view, mm.
const CLOSE_MM: Range<f64> = 0.02..5.0;
/// Share of the panel within which two numbers would be written over each other.
const LABEL_SHARE: f64 = 0.05;
/// Chords kept of a close view.
const MAX_CLOSE: usize = 20_000;

/// A place to be shown close up.
#[derive(Clone, Debug, PartialEq)]
pub struct CloseView {
    /// What is worst here.
    pub title: String,
    /// Its middle: X (radius), Y, Z, mm.
    pub center: Point,
    /// Deviation there, mm.
    pub deviation_mm: f64,
}

impl CloseView {
    /// Half of its side, mm.
    fn half_mm(&self) -> f64 {
        (CLOSE_FACTOR * self.deviation_mm).clamp(CLOSE_MM.start, CLOSE_MM.end)
    }

    /// Whether a place is in it.
    #[must_use]
    pub fn shows(&self, place: Point) -> bool {
        let half_mm = self.half_mm();
        place.iter().zip(self.center).all(|(place, center)| (place - center).abs() <= half_mm)
    }
}

/// A stretch of a path.
type Chord = [Point; 2];

/// What a close view shows.
#[derive(Clone, Debug)]
struct Close {
    view: CloseView,
    half_mm: f64,
    programmed: Vec<Chord>,
    run: Vec<(usize, Chord)>,
}

/// Collects the path as programmed and as run, in bounded memory.
#[derive(Clone, Debug)]
pub struct PathDeviations {
    largest_mm: f64,
    programmed: PathTrace<()>,
    run: PathTrace<usize>,
    close: Vec<Close>,
    level: usize,
}

impl PathDeviations {
    /// Of a path that is at most this far from the programmed one, with these places close up.
    #[must_use]
    pub fn new(largest_mm: f64, views: Vec<CloseView>) -> Self {
        let close = |view: CloseView| {
            let half_mm = view.half_mm();
            Close { view, half_mm, programmed: Vec::new(), run: Vec::new() }
        };
        Self {
            largest_mm,
            programmed: PathTrace::default(),
            run: PathTrace::default(),
            close: views.into_iter().map(close).collect(),
            level: 0,
        }
    }

    /// Takes in a straight cut as it is written.
    pub fn programmed(&mut self, from: Point, to: Point) {
        self.programmed.line((), from, to);
        for close in &mut self.close {
            if close.shows(from, to) && close.programmed.len() < MAX_CLOSE {
                close.programmed.push([from, to]);
            }
        }
    }

    /// What is run next is this far from the programmed path, mm.
    pub fn deviates(&mut self, mm: f64) {
        let share = mm / self.largest_mm.max(f64::MIN_POSITIVE);
        self.level = ((share * LEVELS as f64) as usize).min(LEVELS - 1);
    }

    /// Takes in a straight cut as it is run.
    pub fn run(&mut self, from: Point, to: Point) {
        self.run.line(self.level, from, to);
        for close in &mut self.close {
            if close.shows(from, to) && close.run.len() < MAX_CLOSE {
                close.run.push((self.level, [from, to]));
            }
        }
    }

    /// What a level is drawn with.
    fn ink(&self, level: usize) -> Ink {
        let um = |level: usize| short(1e3 * self.largest_mm * level as f64 / LEVELS as f64, 3);
        let name = format!("as run, {} to {} µm off", um(level), um(level + 1));
        Ink::line(name, COLORS[level], WIDTHS[level])
    }
}

impl Close {
    /// Whether a chord may be inside.
    fn shows(&self, from: Point, to: Point) -> bool {
        (0..3).all(|axis| {
            let [low, high] = [from[axis].min(to[axis]), from[axis].max(to[axis])];
            // The view is widened where the panel is wider than high.
            let reach = 3.0 * self.half_mm;
            low <= self.view.center[axis] + reach && high >= self.view.center[axis] - reach
        })
    }
}

/// The coordinates to the right and upwards, with their names.
type View = [(usize, &'static str); 2];

const TURNING: View = [(2, "Z"), (0, "X (radius)")];
const FROM_ABOVE: View = [(0, "X"), (1, "Y")];
const FROM_FRONT: View = [(0, "X"), (2, "Z")];
const FROM_SIDE: View = [(1, "Y"), (2, "Z")];

fn as_programmed() -> Ink {
    Ink::dashed("as programmed", theme::INK, 1.4)
}

/// The path as programmed and as run.
pub(super) struct PathDeviationPicture<'a> {
    pub(super) program: &'a str,
    pub(super) deviations: &'a PathDeviations,
    pub(super) turning: bool,
}

impl PathDeviationPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let largest_um = short(1e3 * self.deviations.largest_mm, 3);
        let subtitle = format!(
            "{} \u{b7} at most {largest_um} µm apart \u{b7} work coordinates \u{b7} in each panel both axes to the same scale, none \
             exaggerated: colour shows what the whole path is too large for",
            self.program
        );
        let close = self.deviations.close.iter().map(|close| self.close_panel(close).into());
        let close: Vec<_> = close.map(|panel| (1.0, panel)).collect();
        let whole = self.whole_panel().into();
        let body =
            if close.is_empty() { whole } else { Layout::Row(vec![(0.55, whole), (0.45, Layout::Column(close))]) };
        Figure::new("path-deviation", "Path as programmed and as run", subtitle, body).with_height(1_000)
    }

    fn whole_panel(&self) -> Panel {
        let deviations = self.deviations;
        let points = || deviations.programmed.runs().iter().flat_map(|run| run.points.iter().copied());
        let view = self.view(points());
        let project = |point: &Point| project(view, *point);
        let range = |of: fn(&Place) -> f64| {
            let places = points().map(|point| project(&point));
            extent(places.map(|place| of(&place))).map_or(0.0..1.0, |(low, high)| padded(low, high, 0.05))
        };
        let (x, y) = (range(|place| place.0), range(|place| place.1));
        let title = "the whole path, coloured by how far each block is off at most";
        let mut panel = Panel::new(title, Axis::new(view[0].1, MM, x), Axis::new(view[1].1, MM, y)).in_proportion();
        for level in 0..LEVELS {
            for run in deviations.run.runs().iter().filter(|run| run.stretch == level) {
                panel.path(&deviations.ink(level), run.points.iter().map(project).collect());
            }
        }
        let mut above: Vec<Place> = Vec::new();
        for (number, close) in (1..).zip(&deviations.close) {
            let place = project(&close.view.center);
            panel.place(&Ink::dot("close view", theme::BAD, 5.0), place);
            // A number that would be written over another one is below.
            let span = |range: &Range<f64>| range.end - range.start;
            // Both axes are to one scale.
            let near = LABEL_SHARE * span(&panel.x.range).max(span(&panel.y.range));
            let is_taken = above.iter().any(|it| (it.0 - place.0).abs() < near && (it.1 - place.1).abs() < near);
            let beside = if is_taken { Beside::BELOW } else { Beside::ABOVE };
            if !is_taken {
                above.push(place);
            }
            panel.label(place, number.to_string(), theme::INK, beside);
        }
        panel
    }

    fn close_panel(&self, close: &Close) -> Panel {
        let inside = close.programmed.iter().flatten().map(|point| {
            let center = close.view.center;
            [0, 1, 2].map(|axis| point[axis].clamp(center[axis] - close.half_mm, center[axis] + close.half_mm))
        });
        let view = self.view(inside);
        let center = project(view, close.view.center);
        let axis = |(_, name), middle: f64| Axis::new(name, MM, middle - close.half_mm..middle + close.half_mm);
        let number =
            self.deviations.close.iter().position(|other| other.view == close.view).map_or(1, |index| index + 1);
        let title = format!("{number}: {}", close.view.title);
        let mut panel = Panel::new(title, axis(view[0], center.0), axis(view[1], center.1)).in_proportion();
        for level in 0..LEVELS {
            let ink = self.deviations.ink(level);
            joined(close.run.iter().filter(|(own, _)| *own == level).map(|(_, chord)| *chord), view)
                .into_iter()
                .for_each(|line| panel.endless(&ink, line));
        }
        joined(close.programmed.iter().copied(), view)
            .into_iter()
            .for_each(|line| panel.endless(&as_programmed(), line));
        panel
    }

    /// The view in which some points lie farthest apart.
    fn view(&self, points: impl Iterator<Item = Point>) -> View {
        if self.turning {
            return TURNING;
        }
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let [x, y, z] = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        // From above unless that hides more than another view.
        if x.min(y) >= 0.5 * z.min(x.max(y)) {
            FROM_ABOVE
        } else if x >= y {
            FROM_FRONT
        } else {
            FROM_SIDE
        }
    }
}

fn project(view: View, point: Point) -> Place {
    (point[view[0].0], point[view[1].0])
}

/// Chords as lines, as far as they hang together.
fn joined(chords: impl Iterator<Item = Chord>, view: View) -> Vec<Vec<Place>> {
    let mut lines: Vec<Vec<Place>> = Vec::new();
    let mut last = None;
    for [from, to] in chords {
        match lines.last_mut().filter(|_| last == Some(from)) {
            Some(line) => line.push(project(view, to)),
            None => lines.push(vec![project(view, from), project(view, to)]),
        }
        last = Some(to);
    }
    lines
}
