//! Where everything of a picture goes, and what is said about it: the legend built from the inks that are drawn, what is
//! cut off at the edges of panels, and by how much lengths are exaggerated.

use std::borrow::Cow;
use std::ops::Range;

use super::clip;
use super::figure::{Beyond, ColorScale, Figure, Layer, Layout, Panel, Place, Proportions, Shape};
use super::theme::{self, Ink};

/// Space at the left of headline and legend.
pub(super) const EDGE: f64 = 24.0;
/// Height of the title, of a line under it, of a row of the legend, of a line over a panel.
const TITLE_HEIGHT: f64 = 52.0;
const SUBTITLE_HEIGHT: f64 = 24.0;
const LEGEND_HEIGHT: f64 = 30.0;
pub(super) const PANEL_TITLE_HEIGHT: f64 = 26.0;
pub(super) const NOTE_HEIGHT: f64 = 22.0;
/// A swatch, the space after it, and the space after an entry.
pub(super) const SWATCH: f64 = 38.0;
pub(super) const SWATCH_GAP: f64 = 9.0;
const ENTRY_GAP: f64 = 30.0;
/// Space around a panel's plotting area.
const PANEL_LEFT: f64 = 104.0;
const PANEL_RIGHT: f64 = 30.0;
const PANEL_TOP: f64 = 8.0;
const LABEL_BOTTOM: f64 = 66.0;
const NUMBER_BOTTOM: f64 = 34.0;
/// The part of a panel in proportion that its contents fill.
const FILLED: f64 = 1.0 / 1.1;
/// Exaggeration below this is none that one sees.
const SEEN: f64 = 1.02;

/// A rectangle, design units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// A legend entry: everything that is drawn under a name.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) name: Cow<'static, str>,
    pub(super) inks: Vec<Ink>,
    /// Left edge and middle.
    pub(super) at: (f64, f64),
}

/// A panel in its place.
#[derive(Clone, Debug)]
pub(super) struct Placed<'a> {
    pub(super) panel: &'a Panel,
    pub(super) rect: Rect,
    /// Plotting area.
    pub(super) plot: Rect,
    pub(super) x: Range<f64>,
    pub(super) y: Range<f64>,
    /// Title and what is said under it.
    pub(super) title: Vec<String>,
    pub(super) notes: Vec<String>,
}

/// A picture laid out.
#[derive(Clone, Debug)]
pub(super) struct Page<'a> {
    pub(super) subtitle: Vec<String>,
    pub(super) legend: Vec<Entry>,
    pub(super) panels: Vec<Placed<'a>>,
    pub(super) colors: Vec<(&'a ColorScale, Rect)>,
}

impl<'a> Page<'a> {
    pub(super) fn of(figure: &'a Figure) -> Self {
        let (width, height) = (f64::from(figure.size.0), f64::from(figure.size.1));
        let subtitle = theme::wrapped(&figure.subtitle, theme::SUBTITLE_SIZE, width - 2.0 * EDGE);
        let top = TITLE_HEIGHT + SUBTITLE_HEIGHT * subtitle.len() as f64 + 8.0;
        // What cannot be seen has no entry, but may leave its space.
        let mut legend = entries(&figure.body);
        let rows = arrange(&mut legend, top, width);
        let top_of_body = top + LEGEND_HEIGHT * f64::from(rows);
        let mut page = Self { subtitle, legend: Vec::new(), panels: Vec::new(), colors: Vec::new() };
        let body = Rect { left: 0.0, top: top_of_body, width, height: height - top_of_body };
        page.place(&figure.body, body);
        legend.retain(|entry| page.shows(&entry.name));
        arrange(&mut legend, top, width);
        page.legend = legend;
        page
    }

    fn place(&mut self, layout: &'a Layout, rect: Rect) {
        let total = |parts: &[(f64, Layout)]| parts.iter().map(|part| part.0).sum::<f64>();
        match layout {
            Layout::Panel(panel) => self.panels.push(Placed::new(panel, rect)),
            Layout::Colors(colors) => self.colors.push((colors, rect)),
            Layout::Row(parts) => {
                let (unit, mut left) = (rect.width / total(parts), rect.left);
                for (share, part) in parts {
                    self.place(part, Rect { left, width: unit * share, ..rect });
                    left += unit * share;
                }
            }
            Layout::Column(parts) => {
                let (unit, mut top) = (rect.height / total(parts), rect.top);
                for (share, part) in parts {
                    self.place(part, Rect { top, height: unit * share, ..rect });
                    top += unit * share;
                }
            }
        }
    }

    /// Whether anything of this name can be seen.
    fn shows(&self, name: &str) -> bool {
        self.panels.iter().any(|placed| placed.visible().any(|layer| layer.ink.name == name))
    }
}

/// All panels of a layout, in order.
pub(super) fn panels(layout: &Layout) -> Vec<&Panel> {
    match layout {
        Layout::Panel(panel) => vec![panel],
        Layout::Colors(_) => Vec::new(),
        Layout::Row(parts) | Layout::Column(parts) => parts.iter().flat_map(|part| panels(&part.1)).collect(),
    }
}

/// Every ink with a name, in the order of drawing.
fn entries(body: &Layout) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for ink in panels(body).iter().flat_map(|panel| panel.layers.iter().map(|layer| &layer.ink)) {
        if ink.name.is_empty() {
            continue;
        }
        match entries.iter_mut().find(|entry| entry.name == ink.name) {
            Some(entry) if entry.inks.contains(ink) => {}
            Some(entry) => entry.inks.push(ink.clone()),
            None => entries.push(Entry { name: ink.name.clone(), inks: vec![ink.clone()], at: (0.0, 0.0) }),
        }
    }
    entries
}

/// Arranges the legend in rows no wider than the picture; how many rows it has.
fn arrange(entries: &mut [Entry], top: f64, width: f64) -> u32 {
    let (mut left, mut rows) = (EDGE, 0);
    for entry in entries {
        let space = SWATCH + SWATCH_GAP + theme::text_width(&entry.name, theme::LEGEND_SIZE);
        if rows == 0 || left + space > width - EDGE {
            (left, rows) = (EDGE, rows + 1);
        }
        entry.at = (left, top + LEGEND_HEIGHT * (f64::from(rows) - 0.5));
        left += space + ENTRY_GAP;
    }
    rows
}

impl<'a> Placed<'a> {
    fn new(panel: &'a Panel, rect: Rect) -> Self {
        let bare = panel.proportions == Proportions::Bare;
        let (left, right) = if bare { (10.0, 10.0) } else { (PANEL_LEFT, PANEL_RIGHT) };
        let bottom = match (bare, panel.x.labelled) {
            (true, _) => 10.0,
            (_, true) => LABEL_BOTTOM,
            (_, false) => NUMBER_BOTTOM,
        };
        let width = rect.width - left - right;
        let title = theme::wrapped(&panel.title, theme::PANEL_TITLE_SIZE, width);
        let mut placed = Self {
            panel,
            rect,
            plot: rect,
            x: panel.x.range.clone(),
            y: panel.y.range.clone(),
            title,
            notes: Vec::new(),
        };
        // What is to be said depends on the space that it leaves, which hardly changes with it.
        for _ in 0..3 {
            let lines = PANEL_TITLE_HEIGHT * placed.title.len() as f64 + NOTE_HEIGHT * placed.notes.len() as f64;
            let top = PANEL_TOP + lines;
            let (left, top_edge) = (rect.left + left, rect.top + top);
            let height = (rect.height - top - bottom).max(1.0);
            placed.plot = Rect { left, top: top_edge, width: width.max(1.0), height };
            (placed.x, placed.y) = placed.ranges();
            placed.notes = theme::wrapped_whole(&placed.remarks(), theme::NOTE_SIZE, width);
        }
        placed
    }

    /// Ranges that fill the plotting area in the proportions of the panel.
    fn ranges(&self) -> (Range<f64>, Range<f64>) {
        let (x, y) = (self.panel.x.range.clone(), self.panel.y.range.clone());
        if self.panel.proportions == Proportions::Free {
            return (x, y);
        }
        let share = if self.panel.proportions == Proportions::Bare { 1.0 } else { FILLED };
        let needed = ((x.end - x.start) / self.plot.width).max((y.end - y.start) / self.plot.height);
        let per_unit = needed.max(1e-9) / share;
        let widened = |range: Range<f64>, length: f64| {
            let middle = 0.5 * (range.start + range.end);
            middle - 0.5 * per_unit * length..middle + 0.5 * per_unit * length
        };
        (widened(x, self.plot.width), widened(y, self.plot.height))
    }

    /// By how much heights are larger than widths, where both axes are lengths.
    pub(super) fn exaggeration(&self) -> Option<f64> {
        let (x_mm, y_mm) = (self.panel.x.unit.length_mm()?, self.panel.y.unit.length_mm()?);
        let right = self.plot.width / ((self.x.end - self.x.start) * x_mm);
        let up = self.plot.height / ((self.y.end - self.y.start) * y_mm);
        Some(up / right)
    }

    /// What the panel says under its title: its own notes, then what is exaggerated and cut off.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = self.panel.notes.clone();
        if let Some(times) = self.exaggeration() {
            if times > SEEN {
                remarks.push(format!("heights are magnified {} times against widths", two_digits(times)));
            } else if times < 1.0 / SEEN {
                remarks.push(format!("widths are magnified {} times against heights", two_digits(1.0 / times)));
            }
        }
        remarks.extend(self.cut_off());
        remarks
    }

    /// One sentence for everything of a name that lies beyond the panel.
    pub(super) fn cut_off(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        for layer in &self.panel.layers {
            let (Shape::Dots(places), Beyond::Said(name)) = (&layer.shape, &layer.beyond) else { continue };
            for place in places.iter().filter(|place| !is_inside(**place, &self.x, &self.y)) {
                let [x, y] = [(&self.panel.x, place.0), (&self.panel.y, place.1)];
                let [x, y] = [x, y].map(|(axis, value)| format!("{} {}", axis.label, axis.value(value)));
                sentences.push(format!("beyond the scale: {name} at {x}, {y}"));
            }
        }
        let mut found: Vec<(&str, [Option<f64>; 4])> = Vec::new();
        for layer in &self.panel.layers {
            let (Shape::Path(points), Beyond::Said(name)) = (&layer.shape, &layer.beyond) else { continue };
            let farthest = self.farthest(points);
            if farthest.iter().all(Option::is_none) {
                continue;
            }
            match found.iter_mut().find(|(other, _)| other == name) {
                Some((_, known)) => {
                    for (index, (known, value)) in known.iter_mut().zip(farthest).enumerate() {
                        let outer = if index % 2 == 0 { f64::min } else { f64::max };
                        *known = known.map_or(value, |known| Some(value.map_or(known, |value| outer(known, value))));
                    }
                }
                None => found.push((name, farthest)),
            }
        }
        let sentence = |(name, [left, right, low, high]): (&str, [Option<f64>; 4])| {
            let (x, y) = (&self.panel.x, &self.panel.y);
            // Both directions are named where the panel is a view in space.
            let named = |axis: &super::figure::Axis| match self.panel.proportions {
                Proportions::Free => String::new(),
                _ => format!("{} ", axis.label),
            };
            let directions = [
                left.map(|value| format!("{}down to {}", named(x), x.value(value))),
                right.map(|value| format!("{}up to {}", named(x), x.value(value))),
                low.map(|value| format!("{}down to {}", named(y), y.value(value))),
                high.map(|value| format!("{}up to {}", named(y), y.value(value))),
            ];
            let directions: Vec<_> = directions.into_iter().flatten().collect();
            format!("beyond the scale: {name}, {}", directions.join(", "))
        };
        sentences.extend(found.into_iter().map(sentence));
        sentences
    }

    /// Farthest places beyond the left, right, lower and upper edge.
    fn farthest(&self, points: &[Place]) -> [Option<f64>; 4] {
        let (low, high) = (f64::min as fn(f64, f64) -> f64, f64::max as fn(f64, f64) -> f64);
        let (x_room, y_room) = (1e-6 * (self.x.end - self.x.start), 1e-6 * (self.y.end - self.y.start));
        let x = || points.iter().map(|point| point.0);
        let y = || points.iter().map(|point| point.1);
        let beyond = |value: Option<f64>, holds: &dyn Fn(f64) -> bool| value.filter(|value| holds(*value));
        [
            beyond(x().reduce(low), &|value| value < self.x.start - x_room),
            beyond(x().reduce(high), &|value| value > self.x.end + x_room),
            beyond(y().reduce(low), &|value| value < self.y.start - y_room),
            beyond(y().reduce(high), &|value| value > self.y.end + y_room),
        ]
    }

    /// Layers of which anything lies in the panel.
    pub(super) fn visible(&self) -> impl Iterator<Item = &'a Layer> {
        let (x, y) = (self.x.clone(), self.y.clone());
        self.panel.layers.iter().filter(move |layer| match &layer.shape {
            Shape::Path(points) => !clip::polyline(points, &x, &y).is_empty(),
            Shape::Area(outline) => clip::polygon(outline, &x, &y).len() > 2,
            Shape::Dots(places) => places.iter().any(|place| is_inside(*place, &x, &y)),
            Shape::Arrow(_, to) => is_inside(*to, &x, &y),
            Shape::Cells(cells) => !cells.is_empty(),
        })
    }
}

/// Whether a place lies in a rectangle, edges included.
pub(super) fn is_inside(place: Place, x: &Range<f64>, y: &Range<f64>) -> bool {
    (x.start..=x.end).contains(&place.0) && (y.start..=y.end).contains(&place.1)
}

/// A ratio with two significant digits.
fn two_digits(value: f64) -> String {
    let magnitude = value.log10().floor();
    let step = 10.0_f64.powf(magnitude - 1.0);
    super::figure::short((value / step).round() * step, if magnitude < 1.0 { 1 } else { 0 })
}
