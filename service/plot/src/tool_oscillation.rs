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
use plotters::style::RGBColor;

use super::canvas::{self, PlotError};
use super::figure::{Figure, Place, short};
use super::theme::{self, Ink};

/// An oscillating pass to draw.
#[derive(Clone, Debug)]
pub struct OscillationPictures<'a> {
    /// What the files are called: `NAME-waveform`, `NAME-path`, `NAME-edges`, `NAME-stages`, `NAME-layers`, `NAME-floor`.
    pub name: String,
    /// The tool.
    pub tool: &'a ToolGeometry,
    /// How it oscillates.
    pub oscillation: &'a ToolOscillation,
    /// How it is used, and its report.
    pub section: &'a OscillationSectionReport,
}

/// Draws an oscillating pass into the directory, which is created where it is missing.
///
/// # Errors
/// When a file cannot be written.
pub fn write_oscillation(pass: &OscillationPictures<'_>, directory: &Path) -> Result<Vec<PathBuf>, PlotError> {
    canvas::make(directory)?;
    let mut files = Vec::new();
    for figure in figures(pass) {
        files.extend(canvas::write(&figure, directory)?);
    }
    Ok(files)
}

/// Every picture of an oscillating pass, as data.
pub(super) fn figures(pass: &OscillationPictures<'_>) -> Vec<Figure> {
    vec![
        waveform::WaveformPicture { pass }.figure(),
        path::PathPicture { pass }.figure(),
        trochoids::EdgesPicture { pass }.figure(),
        stages::StagesPicture { pass }.figure(),
        layers::LayersPicture::new(pass).figure(),
        floor::FloorPicture::new(pass).figure(),
    ]
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
            ahead if ahead == "0" => "along the feed".to_owned(),
            azimuth => format!("outwards at {azimuth} degrees from the feed"),
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

    /// The inks of an edge: all of one colour have one name.
    fn edge_name(&self, edge: usize) -> String {
        let color = self.color(edge);
        let same: Vec<usize> = (0..self.edge_count()).filter(|other| self.color(*other) == color).collect();
        let names: Vec<_> = same.iter().take(NAMED_EDGES).map(|edge| format!("E{}", edge + 1)).collect();
        let more = if same.len() > NAMED_EDGES { ", …" } else { "" };
        format!("{}{more}", names.join(", "))
    }

    /// What an edge removes.
    fn fill(&self, edge: usize) -> Ink {
        Ink::fill(self.edge_name(edge), self.color(edge), 0.6)
    }

    /// A line of an edge.
    fn line(&self, edge: usize, width: f64) -> Ink {
        Ink::line(self.edge_name(edge), self.color(edge), width)
    }
}

/// Edges of one colour that a legend names.
const NAMED_EDGES: usize = 3;

/// Points of a curve at equal steps.
fn sampled(from: f64, to: f64, steps: u32, point: impl Fn(f64) -> Place) -> Vec<Place> {
    (0..=steps).map(|step| point(from + (to - from) * f64::from(step) / f64::from(steps))).collect()
}
