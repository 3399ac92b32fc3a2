//! Pictures of an oscillating pass: both waveforms, the path of the reference point, the paths of the edges, what every
//! edge removes stage by stage and altogether, and the floor. All show the steady state, from the first edge's passage
//! through the feed direction on.

mod floor;
mod layers;
mod path;
mod section;
mod stages;
mod trochoids;
mod waveform;

use std::ops::Range;
use std::path::{Path, PathBuf};

use feedwave_cutting::tool_oscillation::{OscillationSectionReport, ToolGeometry, ToolOffset, ToolOscillation};
use plotters::element::{Circle, EmptyElement, Polygon, Text};
use plotters::prelude::DrawingBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::DrawResult;
use super::canvas::{self, PlotError};
use super::theme::{self, Scale, Swatch};

/// Edges that a legend names.
const LEGEND_EDGES: usize = 12;

/// An oscillating pass to draw.
#[derive(Clone, Debug)]
pub struct OscillationPictures<'a> {
    /// What the files are called: `NAME-waveform`, `NAME-path`, `NAME-edges`, `NAME-stages`, `NAME-layers`, `NAME-floor`.
    pub name: String,
    /// The tool.
    pub tool: &'a ToolGeometry,
    /// How it oscillates.
    pub oscillation: &'a ToolOscillation,
    /// How it is used, and what there is to say about it.
    pub section: &'a OscillationSectionReport,
}

/// Draws an oscillating pass into the directory, which is created where it is missing.
///
/// # Errors
/// When a file cannot be written.
pub fn write_oscillation(pass: &OscillationPictures<'_>, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    std::fs::create_dir_all(directory)
        .map_err(|error| PlotError(format!("cannot create {}: {error}", directory.display())))?;
    let mut files = Vec::new();
    files.extend(canvas::write(&waveform::WaveformPicture { pass }, directory)?);
    files.extend(canvas::write(&path::PathPicture { pass }, directory)?);
    files.extend(canvas::write(&trochoids::EdgesPicture { pass }, directory)?);
    files.extend(canvas::write(&stages::StagesPicture { pass }, directory)?);
    files.extend(canvas::write(&layers::LayersPicture::new(pass), directory)?);
    files.extend(canvas::write(&floor::FloorPicture::new(pass), directory)?);
    Ok(files)
}

impl OscillationPictures<'_> {
    fn edge_count(&self) -> usize {
        self.tool.edges.len()
    }

    fn feed_per_rev_mm(&self) -> f64 {
        self.section.cut.feed_per_rev_mm()
    }

    /// Offset of the tool after so many turns of the spindle.
    fn offset(&self, turns: f64) -> ToolOffset {
        self.oscillation.offset(self.phase_turns(turns))
    }

    /// Phase of the oscillation then, turns.
    fn phase_turns(&self, turns: f64) -> f64 {
        let first = self.tool.edges.first().map_or(0.0, |edge| edge.angle_deg / 360.0);
        self.oscillation.phase_turns(first + turns, 0.0)
    }

    /// One period, turns of the spindle.
    fn period_turns(&self) -> f64 {
        1.0 / f64::from(self.oscillation.periods_per_rev.max(1))
    }

    /// What the tool sweeps of the work, mm to the right of the feed.
    fn engaged_mm(&self) -> Range<f64> {
        let side = if self.section.cut.clockwise { 1.0 } else { -1.0 };
        let across = |azimuth_deg: f64| side * self.tool.radius_mm * azimuth_deg.to_radians().sin();
        let [from_mm, to_mm] = self.section.cut.engagement_deg.map(across);
        from_mm.min(to_mm)..from_mm.max(to_mm)
    }

    /// The same pass without oscillation.
    fn plain(&self) -> ToolOscillation {
        let mut plain = self.oscillation.clone();
        plain.feed.amplitude_mm = 0.0;
        plain.axial.amplitude_mm = 0.0;
        plain.cross = None;
        plain
    }

    /// Label of the axis along the plane of the layers.
    fn outwards(&self) -> String {
        match short(self.section.report.plane_deg, 1) {
            ahead if ahead == "0" => "along the feed, mm".to_owned(),
            azimuth => format!("outwards at {azimuth} degrees from the feed, mm"),
        }
    }

    /// Colour of an edge; neighbours differ.
    fn color(&self, edge: usize) -> RGBColor {
        let colors = theme::PALETTE.len();
        // The last one would be next to the first.
        let wraps = edge + 1 == self.edge_count() && edge > 0 && edge.is_multiple_of(colors);
        theme::PALETTE[if wraps { 1 } else { edge % colors }]
    }

    /// What is drawn, in one line.
    fn subtitle(&self) -> String {
        let (section, report) = (self.section, &self.section.report);
        format!(
            "{} in line {} \u{b7} tool {}: {} edges, radius {} mm \u{b7} {} mm/min at {} rev/min \u{b7} period {} ms, {} mm \
             of feed",
            section.condition,
            section.line,
            section.tool,
            self.edge_count(),
            short(self.tool.radius_mm, 3),
            short(section.cut.feed_mm_per_min, 1),
            short(section.cut.spindle_rev_per_min, 1),
            short(1e3 * report.period_s, 3),
            short(report.feed_per_period_mm, 4)
        )
    }

    /// Legend entries of the edges.
    fn legend(&self, swatch: Swatch) -> Vec<(Swatch, RGBColor, String)> {
        let entry = |edge: usize| (swatch, self.color(edge), format!("E{}", edge + 1));
        (0..self.edge_count().min(LEGEND_EDGES)).map(entry).collect()
    }
}

/// A number with at most so many decimals and no superfluous ones.
fn short(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.replace('-', "\u{2212}") }
}

/// Points of a curve at equal steps.
fn sampled(from: f64, to: f64, steps: u32, point: impl Fn(f64) -> (f64, f64)) -> Vec<(f64, f64)> {
    (0..=steps).map(|step| point(from + (to - from) * f64::from(step) / f64::from(steps))).collect()
}

/// Where a text stands beside its point.
#[derive(Clone, Copy)]
struct Beside {
    x: HPos,
    y: VPos,
    /// Distance, design units, right and down.
    by: (f64, f64),
}

const RIGHT: Beside = Beside { x: HPos::Left, y: VPos::Center, by: (9.0, 0.0) };
const CENTRE: Beside = Beside { x: HPos::Center, y: VPos::Center, by: (0.0, 0.0) };

/// A text at a place of the panel.
fn write<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    at: (f64, f64),
    text: &str,
    color: RGBColor,
    beside: Beside,
) -> DrawResult<(), DB> {
    let style = scale.text(15.0, color).pos(Pos::new(beside.x, beside.y));
    let text = Text::new(text.to_owned(), (scale.px(beside.by.0), scale.px(beside.by.1)), style);
    chart.draw_series([EmptyElement::at(at) + text])?;
    Ok(())
}

/// A dot with a name.
fn mark<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    at: (f64, f64),
    text: &str,
    color: RGBColor,
    beside: Beside,
) -> DrawResult<(), DB> {
    chart.draw_series([Circle::new(at, scale.px(5.5), color.filled())])?;
    write(chart, scale, at, text, color, beside)
}

/// The head of an arrow that points from one place to another, at the latter.
fn arrow<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    from: (f64, f64),
    to: (f64, f64),
    color: RGBColor,
) -> DrawResult<(), DB> {
    let area = chart.plotting_area();
    let (start, end) = (area.map_coordinate(&from), area.map_coordinate(&to));
    let (x, y) = (f64::from(end.0 - start.0), f64::from(end.1 - start.1));
    let length = x.hypot(y);
    if length < 1.0 {
        return Ok(());
    }
    let (x, y) = (x / length, y / length);
    let corner = |back: f64, aside: f64| (scale.px(-back * x - aside * y), scale.px(-back * y + aside * x));
    let head = Polygon::new(vec![corner(0.0, 0.0), corner(14.0, 5.5), corner(14.0, -5.5)], color.filled());
    chart.draw_series([EmptyElement::at(to) + head])?;
    Ok(())
}
