//! What a picture is, before it is drawn: panels with axes that know their units, layers of ink, limits, labels. Pictures are
//! made as this data; the legend, statements on what is cut off and on exaggeration, and the drawing follow from it
//! alike for all of them.

use std::borrow::Cow;
use std::ops::Range;

use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

use super::theme::{self, Ink};

/// Place in a panel, in the units of its axes.
pub(super) type Place = (f64, f64);

/// A whole picture.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// File name without the ending.
    pub(super) name: String,
    pub(super) title: String,
    pub(super) subtitle: String,
    /// Width and height, design units.
    pub(super) size: (u32, u32),
    pub(super) body: Layout,
}

/// Default width and height of a picture, design units.
pub(super) const SIZE: (u32, u32) = (1_400, 900);

impl Figure {
    pub(super) fn new(
        name: impl Into<String>,
        title: impl Into<String>,
        subtitle: impl Into<String>,
        body: impl Into<Layout>,
    ) -> Self {
        Self { name: name.into(), title: title.into(), subtitle: subtitle.into(), size: SIZE, body: body.into() }
    }

    pub(super) const fn with_height(mut self, height: u32) -> Self {
        self.size.1 = height;
        self
    }
}

/// How panels share the space; numbers are shares of it.
#[derive(Clone, Debug)]
pub(super) enum Layout {
    Panel(Box<Panel>),
    Colors(ColorScale),
    Row(Vec<(f64, Layout)>),
    Column(Vec<(f64, Layout)>),
}

impl Layout {
    /// Panels below each other, all of the same height.
    pub(super) fn column(panels: Vec<Panel>) -> Self {
        Self::Column(panels.into_iter().map(|panel| (1.0, panel.into())).collect())
    }

    /// Panels beside each other, all of the same width.
    pub(super) fn row(panels: Vec<Panel>) -> Self {
        Self::Row(panels.into_iter().map(|panel| (1.0, panel.into())).collect())
    }
}

impl From<Panel> for Layout {
    fn from(panel: Panel) -> Self {
        Self::Panel(Box::new(panel))
    }
}

/// What the colours of a map mean.
#[derive(Clone, Debug)]
pub(super) struct ColorScale {
    pub(super) title: String,
    pub(super) range: Range<f64>,
    pub(super) unit: &'static str,
    /// From low to high.
    pub(super) colors: Vec<RGBColor>,
}

/// What an axis counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) symbol: &'static str,
    /// Millimetres that one of it is on paper in true size, for lengths.
    length_mm: Option<f64>,
}

const fn unit(symbol: &'static str) -> Unit {
    Unit { symbol, length_mm: None }
}

pub(super) const MM: Unit = Unit { symbol: "mm", length_mm: Some(1.0) };
pub(super) const UM: Unit = Unit { symbol: "µm", length_mm: Some(1e-3) };
pub(super) const DEGREES: Unit = unit("degrees");
pub(super) const SECONDS: Unit = unit("s");
pub(super) const MILLISECONDS: Unit = unit("ms");
pub(super) const PERCENT: Unit = unit("%");
pub(super) const MM_PER_MIN: Unit = unit("mm/min");
pub(super) const DEG_PER_MIN: Unit = unit("degrees/min");
pub(super) const DEG_PER_S: Unit = unit("degrees/s");
pub(super) const M_PER_S2: Unit = unit("m/s²");
pub(super) const M_PER_S3: Unit = unit("m/s³");
pub(super) const REVOLUTIONS: Unit = unit("revolutions");
pub(super) const REV_PER_MIN: Unit = unit("rev/min");
pub(super) const HERTZ: Unit = unit("Hz");
/// What has no unit: numbers of lines, edges.
pub(super) const COUNT: Unit = unit("");

impl Unit {
    /// Lengths that are no distances in space, such as those along a bent path over time, are never exaggerated.
    pub(super) const fn along_a_path(self) -> Self {
        Self { length_mm: None, ..self }
    }

    /// Millimetres in space that one of it is, where it is a length.
    pub(super) const fn length_mm(self) -> Option<f64> {
        self.length_mm
    }

    /// An angle on a cylinder: one of it is so many millimetres of the circumference.
    pub(super) const fn of_circumference(self, mm: f64) -> Self {
        Self { length_mm: Some(mm), ..self }
    }
}

/// An axis of a panel.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// What it counts.
    pub(super) label: String,
    pub(super) unit: Unit,
    pub(super) range: Range<f64>,
    /// Whether label and numbers are written: of panels below each other only the last needs the label.
    pub(super) labelled: bool,
}

impl Axis {
    pub(super) fn new(label: impl Into<String>, unit: Unit, range: Range<f64>) -> Self {
        Self { label: label.into(), unit, range, labelled: true }
    }

    /// The label is under a panel further down.
    pub(super) fn labelled_if(mut self, labelled: bool) -> Self {
        self.labelled = labelled;
        self
    }

    /// Label and unit.
    pub(super) fn text(&self) -> String {
        match (self.label.as_str(), self.unit.symbol) {
            (label, "") => label.to_owned(),
            ("", unit) => unit.to_owned(),
            (label, unit) => format!("{label}, {unit}"),
        }
    }

    /// A value with the unit.
    pub(super) fn value(&self, value: f64) -> String {
        format!("{} {}", number(value, value.abs()), self.unit.symbol).trim_end().to_owned()
    }
}

/// How the axes of a panel belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Proportions {
    /// Each axis fills the panel.
    Free,
    /// A millimetre is as long to the right as upwards.
    True,
    /// True, and without axes.
    Bare,
}

/// A frame with what is drawn in it, from the lowest layer to the highest.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) notes: Vec<String>,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) proportions: Proportions,
    pub(super) layers: Vec<Layer>,
    pub(super) labels: Vec<Label>,
    /// Whether heights are written at the left.
    pub(super) y_numbers: bool,
}

/// Something drawn with one ink.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub(super) ink: Ink,
    pub(super) shape: Shape,
    pub(super) beyond: Beyond,
}

#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// A polyline; points that are no numbers interrupt it.
    Path(Vec<Place>),
    /// A polygon.
    Area(Vec<Place>),
    Dots(Vec<Place>),
    /// The head of an arrow that points from the first place to the second, at the latter.
    Arrow(Place, Place),
    /// Rectangles in colours of a [`ColorScale`].
    Cells(Vec<([Place; 2], RGBColor)>),
}

/// What happens at the edges of the panel.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Beyond {
    /// What is cut off is said under the title, under this name.
    Said(Cow<'static, str>),
    /// It goes on: a plane, an axis, the work.
    GoesOn,
}

/// A text in a panel.
#[derive(Clone, Debug)]
pub(super) struct Label {
    pub(super) at: Place,
    pub(super) text: String,
    pub(super) color: RGBColor,
    pub(super) beside: Beside,
}

/// Side of its place at which a text is.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    pub(super) x: HPos,
    pub(super) y: VPos,
    /// Distance, design units, right and down.
    pub(super) by: (f64, f64),
}

impl std::fmt::Debug for Beside {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Beside").field(&self.by).finish()
    }
}

impl Beside {
    pub(super) const RIGHT: Self = Self { x: HPos::Left, y: VPos::Center, by: (9.0, 0.0) };
    pub(super) const CENTER: Self = Self { x: HPos::Center, y: VPos::Center, by: (0.0, 0.0) };
    pub(super) const ABOVE: Self = Self { x: HPos::Center, y: VPos::Bottom, by: (0.0, -8.0) };
    pub(super) const BELOW: Self = Self { x: HPos::Center, y: VPos::Top, by: (0.0, 8.0) };
    /// In the upper left corner of what begins at a place.
    pub(super) const INSIDE_TOP: Self = Self { x: HPos::Left, y: VPos::Top, by: (5.0, 4.0) };
    pub(super) const INSIDE_BOTTOM: Self = Self { x: HPos::Left, y: VPos::Bottom, by: (8.0, -8.0) };
    /// Above a line, at its right end.
    pub(super) const ON_LINE: Self = Self { x: HPos::Right, y: VPos::Bottom, by: (-6.0, -3.0) };
}

impl Panel {
    pub(super) fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        let (layers, labels) = (Vec::new(), Vec::new());
        Self {
            title: title.into(),
            notes: Vec::new(),
            x,
            y,
            proportions: Proportions::Free,
            layers,
            labels,
            y_numbers: true,
        }
    }

    /// Both axes to the same scale: the ranges are widened to fill the panel.
    pub(super) const fn in_proportion(mut self) -> Self {
        self.proportions = Proportions::True;
        self
    }

    /// Without axes.
    pub(super) fn bare(title: impl Into<String>, half: f64) -> Self {
        let axis = || Axis::new("", COUNT, -half..half).labelled_if(false);
        Self { proportions: Proportions::Bare, y_numbers: false, ..Self::new(title, axis(), axis()) }
    }

    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    fn push(&mut self, ink: &Ink, shape: Shape, beyond: Beyond) {
        self.layers.push(Layer { ink: ink.clone(), shape, beyond });
    }

    /// Draws a curve. What of it is beyond the panel is said.
    pub(super) fn path(&mut self, ink: &Ink, points: Vec<Place>) {
        self.push(ink, Shape::Path(points), Beyond::Said(ink.name.clone()));
    }

    /// Draws a curve whose parts beyond the panel have a name of their own, such as rapid moves.
    pub(super) fn path_beyond(&mut self, ink: &Ink, points: Vec<Place>, beyond: &'static str) {
        self.push(ink, Shape::Path(points), Beyond::Said(beyond.into()));
    }

    /// Draws a line that goes on beyond the panel.
    pub(super) fn endless(&mut self, ink: &Ink, points: Vec<Place>) {
        self.push(ink, Shape::Path(points), Beyond::GoesOn);
    }

    pub(super) fn area(&mut self, ink: &Ink, outline: Vec<Place>) {
        self.push(ink, Shape::Area(outline), Beyond::GoesOn);
    }

    pub(super) fn rectangle(&mut self, ink: &Ink, x: Range<f64>, y: Range<f64>) {
        self.area(ink, vec![(x.start, y.start), (x.end, y.start), (x.end, y.end), (x.start, y.end)]);
    }

    /// Fills stretches of the x axis over the whole height.
    pub(super) fn shade(&mut self, ink: &Ink, stretches: impl IntoIterator<Item = (f64, f64)>) {
        let height = self.y.range.clone();
        for (from, to) in stretches {
            self.rectangle(ink, from..to, height.clone());
        }
    }

    pub(super) fn dots(&mut self, ink: &Ink, places: Vec<Place>) {
        self.push(ink, Shape::Dots(places), Beyond::GoesOn);
    }

    /// Draws a dot. Where it is is said when it lies beyond the panel.
    pub(super) fn place(&mut self, ink: &Ink, place: Place) {
        self.push(ink, Shape::Dots(vec![place]), Beyond::Said(ink.name.clone()));
    }

    pub(super) fn arrow(&mut self, ink: &Ink, from: Place, to: Place) {
        self.push(ink, Shape::Arrow(from, to), Beyond::GoesOn);
    }

    pub(super) fn cells(&mut self, cells: Vec<([Place; 2], RGBColor)>) {
        self.push(&Ink::fill("", theme::INK, 1.0), Shape::Cells(cells), Beyond::GoesOn);
    }

    pub(super) fn label(&mut self, at: Place, text: impl Into<String>, color: RGBColor, beside: Beside) {
        self.labels.push(Label { at, text: text.into(), color, beside });
    }

    /// A vertical line from edge to edge.
    pub(super) fn upright(&mut self, ink: &Ink, x: f64) {
        let height = self.y.range.clone();
        self.endless(ink, vec![(x, height.start), (x, height.end)]);
    }

    /// A limit: a dashed line with what it is and its value; said instead where it is beyond the panel.
    pub(super) fn limit(&mut self, ink: &Ink, value: f64, what: &str) {
        let text = format!("{what} {}", self.y.value(value));
        let (x, y) = (self.x.range.clone(), self.y.range.clone());
        if !(y.start..=y.end).contains(&value) {
            return self.note(format!("{text} is beyond the scale"));
        }
        self.endless(ink, vec![(x.start, value), (x.end, value)]);
        let near_top = y.end - value < 0.1 * (y.end - y.start);
        let beside = Beside { y: if near_top { VPos::Top } else { VPos::Bottom }, ..Beside::ON_LINE };
        let by = if near_top { (-6.0, 4.0) } else { beside.by };
        self.label((x.end, value), text, ink.color, Beside { by, ..beside });
    }
}

/// A range with some air around the values, never empty.
pub(super) fn padded(low: f64, high: f64, share: f64) -> Range<f64> {
    if !(low.is_finite() && high.is_finite()) {
        return -1.0..1.0;
    }
    let span = high - low;
    let smallest = 1e-6 * low.abs().max(high.abs()).max(1e-3);
    let pad = if span > smallest { span * share } else { smallest.max(0.5 * low.abs()).max(1e-3) };
    low - pad..high + pad
}

/// Lowest and highest of some values.
pub(super) fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let values = values.into_iter().filter(|value| value.is_finite());
    values.fold(None, |extent, value| match extent {
        None => Some((value, value)),
        Some((low, high)) => Some((low.min(value), high.max(value))),
    })
}

/// A number with the decimals that a scale of this span shows, no superfluous ones, groups of thousands and a real minus
/// sign.
pub(super) fn number(value: f64, span: f64) -> String {
    let decimals = if span > 0.0 { (3.0 - span.log10().floor()).clamp(0.0, 9.0) as usize } else { 6 };
    short(value, decimals)
}

/// A number with at most so many decimals and no superfluous ones.
pub(super) fn short(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let mut grouped = String::new();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && whole.len() > 4 && (whole.len() - index).is_multiple_of(3) {
            grouped.push('\u{a0}');
        }
        grouped.push(digit);
    }
    if !fraction.is_empty() {
        grouped.push('.');
        grouped.push_str(fraction);
    }
    if value < 0.0 && text != "0" { format!("\u{2212}{grouped}") } else { grouped }
}
