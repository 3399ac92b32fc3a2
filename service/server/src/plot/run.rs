//! A live run over time: the deflection of the tool and its limits above, the feed override that follows below.

use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::series::DashedLineSeries;

use super::canvas::{self, DrawResult, Picture, PlotError};
use super::series::Series;
use super::theme::{self, AxisSpec, Scale, Swatch};

/// Room above the highest value.
const HEADROOM: f64 = 1.15;

/// Collects what the picture of a run shows. Times are those of the sensors' clock, s.
#[derive(Clone, Debug, Default)]
pub struct RunTrace {
    /// What the picture is of.
    pub subtitle: String,
    /// Limits of the measured deflection, mm.
    pub limits_mm: Option<[f64; 2]>,
    /// Largest true deflection since the sample before, mm.
    pub true_mm: Series,
    /// Deflection measured in the windows that decisions are about, mm, at their ends.
    pub measured_mm: Series,
    /// Feed override, %: one value before and one after each decision.
    pub feed_percent: Series,
}

/// Draws `run.svg` and `run.png` into a directory; their paths.
///
/// # Errors
/// [`PlotError`] when a file cannot be written.
pub fn write_run(trace: &RunTrace, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    canvas::write(&RunPicture(trace), directory)
}

struct RunPicture<'a>(&'a RunTrace);

impl Picture for RunPicture<'_> {
    fn name(&self) -> String {
        "run".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let trace = self.0;
        let body = theme::headline(area, scale, "Deflection and feed override over time", &trace.subtitle)?;
        let mut entries = vec![
            (Swatch::Line, theme::RAPID, "true momentary peak"),
            (Swatch::Line, theme::COMMAND, "measured: largest mean of each window"),
        ];
        if trace.limits_mm.is_some() {
            entries.push((Swatch::Dashed, theme::BAD, "limits"));
        }
        let body = theme::legend(&body, scale, &entries)?;
        let curves = [&trace.true_mm, &trace.measured_mm, &trace.feed_percent];
        let end_s = curves.iter().filter_map(|curve| curve.points().last().map(|point| point.0)).fold(1e-3, f64::max);
        let high = |series: &[&Series]| {
            series.iter().filter_map(|series| series.extent()).map(|(_, high)| high).fold(0.0, f64::max)
        };
        let areas = body.split_evenly((2, 1));

        let highest = high(&curves[..2]).max(trace.limits_mm.map_or(0.0, |[_, upper]| upper));
        let y = AxisSpec::new("deflection, mm", 0.0..(highest * HEADROOM).max(1e-6));
        let mut chart = theme::panel(&areas[0], scale, "", &AxisSpec::new("", 0.0..end_s), &y)?;
        for limit in trace.limits_mm.into_iter().flatten() {
            let line = [(0.0, limit), (end_s, limit)];
            let (dash, gap) = (scale.px(7.0), scale.px(5.0));
            chart.draw_series(DashedLineSeries::new(line, dash, gap, scale.stroke(theme::BAD, 1.6)))?;
        }
        theme::curve(&mut chart, &trace.true_mm.points(), scale.stroke(theme::RAPID, 1.6))?;
        theme::curve(&mut chart, &trace.measured_mm.points(), scale.stroke(theme::COMMAND, 2.0))?;

        let y = AxisSpec::new("feed override, %", 0.0..(high(&curves[2..]) * HEADROOM).max(100.0 * HEADROOM));
        let mut chart = theme::panel(&areas[1], scale, "", &AxisSpec::new("time of the sensors, s", 0.0..end_s), &y)?;
        theme::curve(&mut chart, &trace.feed_percent.points(), scale.stroke(theme::GOOD, 2.0))?;
        Ok(())
    }
}
