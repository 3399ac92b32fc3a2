//! A live run over time: the deflection of the tool and its limits above, the feed override that follows below.

use std::path::{Path, PathBuf};

use super::canvas::{self, PlotError};
use super::figure::{Axis, Figure, Layout, MM, PERCENT, Panel, Place, SECONDS};
use super::series::Series;
use super::theme::{self, Ink};

/// Space above the highest value.
const HEADROOM: f64 = 1.2;

/// Collects what the picture of a run shows. Times are those of the sensors' clock, s, and ascend in each curve: what is
/// heard late, as after a connection that broke, is kept at its own time.
#[derive(Clone, Debug)]
pub struct RunTrace {
    subtitle: String,
    /// Limits of what is measured, mm: lower and upper.
    limits_mm: Option<[f64; 2]>,
    true_mm: Series,
    measured_mm: Series,
    /// Feed override from a time on, %.
    feed_percent: Vec<Place>,
}

impl RunTrace {
    /// A run at the programmed feed; `limits_mm` are those of the deflection that is measured.
    #[must_use]
    pub fn new(subtitle: impl Into<String>, limits_mm: Option<[f64; 2]>) -> Self {
        Self {
            subtitle: subtitle.into(),
            limits_mm,
            true_mm: Series::default(),
            measured_mm: Series::default(),
            feed_percent: vec![(0.0, 100.0)],
        }
    }

    /// Adds the largest true deflection since the time before, mm.
    pub fn deflect(&mut self, time_s: f64, peak_mm: f64) {
        self.true_mm.push(time_s, peak_mm);
    }

    /// Adds what a window measured, mm, at its end.
    pub fn measure(&mut self, time_s: f64, deflection_mm: f64) {
        self.measured_mm.push(time_s, deflection_mm);
    }

    /// Sets the feed override from a time on.
    pub fn decide(&mut self, time_s: f64, feed: f64) {
        let percent = 100.0 * feed;
        if self.feed_percent.last().is_some_and(|last| last.1 != percent) {
            self.feed_percent.push((time_s, percent));
        }
    }

    /// The feed override as steps that end with the run.
    fn steps(&self, end_s: f64) -> Vec<Place> {
        let mut steps: Vec<Place> = Vec::with_capacity(2 * self.feed_percent.len() + 1);
        for &(time_s, percent) in &self.feed_percent {
            if let Some(&(_, before)) = steps.last() {
                steps.push((time_s, before));
            }
            steps.push((time_s, percent));
        }
        let last = steps.last().map_or(100.0, |step| step.1);
        steps.push((end_s, last));
        steps
    }

    fn end_s(&self) -> f64 {
        let curves = [self.true_mm.points(), self.measured_mm.points(), self.feed_percent.clone()];
        curves.iter().filter_map(|curve| curve.last().map(|point| point.0)).fold(1e-3, f64::max)
    }

    pub(super) fn figure(&self) -> Figure {
        let time = || Axis::new("time of the sensors", SECONDS, 0.0..self.end_s());
        let high = |series: &Series| series.extent().map_or(0.0, |extent| extent.1);
        let upper_mm = self.limits_mm.map_or(0.0, |[_, upper]| upper);
        let highest = high(&self.true_mm).max(high(&self.measured_mm)).max(upper_mm);
        let y = Axis::new("deflection", MM.along_a_path(), 0.0..(highest * HEADROOM).max(1e-6));
        let mut deflection = Panel::new("deflection of the tool", time().labelled_if(false), y);
        let peak = Ink::line("true momentary peak of the deflection: not judged", theme::RAPID, 1.8);
        deflection.path(&peak, self.true_mm.points());
        let name = "judged: largest mean deflection of each window, at its end";
        let measured = self.measured_mm.points();
        deflection.path(&Ink::line(name, theme::COMMAND, 2.4), measured.clone());
        deflection.dots(&Ink::dot(name, theme::COMMAND, 4.0), measured);
        if let Some([lower, upper]) = self.limits_mm {
            deflection.note("the limits bound the means of the windows, not the momentary peaks");
            let limit = Ink::limit("limits of what is judged");
            deflection.limit(&limit, upper, "above it the feed is lowered: upper limit");
            deflection.limit(&limit, lower, "below it the feed is raised: lower limit");
        }
        let percent = self.feed_percent.iter().map(|step| step.1).fold(100.0, f64::max);
        let y = Axis::new("feed override", PERCENT, 0.0..percent * HEADROOM);
        let mut feed = Panel::new("feed override that follows", time(), y);
        feed.path(&Ink::line("feed override", theme::GOOD, 2.4), self.steps(self.end_s()));
        let title = "Deflection and feed override over time";
        Figure::new("run", title, &self.subtitle, Layout::Column(vec![(0.56, deflection.into()), (0.44, feed.into())]))
    }
}

/// Draws `run.svg` and `run.png` into a directory; their paths.
///
/// # Errors
/// [`PlotError`] when a file cannot be written.
pub fn write_run(trace: &RunTrace, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    canvas::write(&trace.figure(), directory)
}
