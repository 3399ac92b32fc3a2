//! Where the chip of a cut breaks, over spindle speed and feed: as programmed, and for all values within the tolerances.

use std::path::{Path, PathBuf};

use super::canvas::{self, PlotError};
use super::figure::{Axis, Figure, Layout, MM, Panel, Place, REV_PER_MIN};
use super::theme::{self, Ink};

/// Values over the spindle speed, rev/min.
type Curve = Vec<(f64, f64)>;

/// A map to draw.
#[derive(Clone, Debug)]
pub struct RobustnessPicture {
    /// File name without the ending.
    pub name: String,
    /// What it is of, in one line.
    pub subtitle: String,
    /// Largest feed in mm/rev with which the chip breaks as programmed, over the speed in rev/min.
    pub limit: Vec<(f64, f64)>,
    /// The same for all values within the tolerances.
    pub safe: Vec<(f64, f64)>,
    /// Speed and feed as programmed.
    pub programmed: (f64, f64),
    /// Range of the feeds.
    pub largest_feed_mm: f64,
    /// Limit of stability in mm over the speed, and the depths of the cut, mm, where they are known.
    pub stability: Option<(Curve, [f64; 2])>,
}

/// Draws a map as SVG and PNG into a directory, which is created where it is missing; their paths.
///
/// # Errors
/// [`PlotError`] when a file cannot be written.
pub fn write_robustness(picture: &RobustnessPicture, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    canvas::make(directory)?;
    canvas::write(&picture.figure(), directory)
}

impl RobustnessPicture {
    fn speeds(&self) -> Axis {
        let first = self.limit.first().map_or(0.0, |place| place.0);
        let last = self.limit.last().map_or(1.0, |place| place.0);
        Axis::new("spindle speed", REV_PER_MIN, first..last)
    }

    fn chips(&self) -> Panel {
        let feeds = Axis::new("feed of a revolution", MM, 0.0..self.largest_feed_mm);
        let speeds = self.speeds().labelled_if(self.stability.is_none());
        let mut panel = Panel::new("where the chip breaks", speeds, feeds);
        let name = "breaks for all values within the tolerances";
        let ends: [Place; 2] = [(self.speeds().range.end, 0.0), (self.speeds().range.start, 0.0)];
        panel.area(&Ink::fill(name, theme::GOOD, 0.18), self.safe.iter().copied().chain(ends).collect());
        panel.endless(&Ink::line(name, theme::GOOD, 2.2), self.safe.clone());
        panel.endless(&Ink::line("breaks below, as programmed", theme::BAD, 2.4), self.limit.clone());
        panel.dots(&Ink::dot("programmed", theme::COMMAND, 6.0), vec![self.programmed]);
        panel
    }

    fn depths(&self, limit: &[Place], [shallow, deep]: [f64; 2]) -> Panel {
        let most = limit.iter().map(|place| place.1).filter(|mm| mm.is_finite()).fold(deep, f64::max);
        let speeds = self.speeds();
        let range = speeds.range.clone();
        let mut panel = Panel::new("limit of stability", speeds, Axis::new("depth of cut", MM, 0.0..1.1 * most));
        panel.rectangle(
            &Ink::fill("depths of the cut", theme::COMMAND, 0.3),
            range,
            shallow..deep.max(shallow + 0.004 * most),
        );
        panel.endless(&Ink::line("limit: chatter above", theme::BAD, 2.4), limit.to_vec());
        panel
    }

    pub(super) fn figure(&self) -> Figure {
        let mut panels = vec![self.chips()];
        if let Some((limit, depths)) = &self.stability {
            panels.push(self.depths(limit, *depths));
        }
        Figure::new(&self.name, "How surely the chip breaks", &self.subtitle, Layout::column(panels))
    }
}
