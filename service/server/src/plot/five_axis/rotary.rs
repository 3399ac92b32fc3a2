//! Rotary axes over time, as programmed and thinned: the whole program, then a stretch of the path close up with its
//! velocities.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, DrawingBackend};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{FiveAxisPlots, Plan};

pub(super) struct RotaryPicture<'a> {
    pub(super) program: &'a str,
    pub(super) plots: &'a FiveAxisPlots,
}

impl Picture for RotaryPicture<'_> {
    fn name(&self) -> String {
        "rotary-axes".to_owned()
    }

    fn size(&self) -> (u32, u32) {
        (1_400, 1_080)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let plots = self.plots;
        let mut subtitle = self.program.to_owned();
        if let Some(thinning) = &plots.thinning {
            let [before_s, after_s] = thinning.times_s;
            let [read, dropped] = thinning.blocks;
            subtitle.push_str(&format!(
                " \u{b7} {dropped} of {read} blocks dropped \u{b7} machining time {before_s:.1} s as programmed, \
                 {after_s:.1} s thinned"
            ));
        }
        let body = theme::headline(area, scale, "Rotary axes over time", &subtitle)?;
        let entries: Vec<_> = plots.plans().map(|(_, color, name)| (Swatch::Line, color, name)).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let columns = body.split_evenly((1, 2));
        for (axis, column) in columns.iter().enumerate() {
            let rows = column.split_evenly((3, 1));
            self.draw_whole(&rows[0], scale, axis)?;
            self.draw_close(&rows[1], scale, axis)?;
            self.draw_velocity(&rows[2], scale, axis)?;
        }
        Ok(())
    }
}

type Points = Vec<(f64, f64)>;

/// Range of all points, with some air.
fn joined<'a>(curves: impl IntoIterator<Item = &'a Points>, of: fn(&(f64, f64)) -> f64, share: f64) -> Range<f64> {
    let values = curves.into_iter().flatten().map(of);
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    theme::padded(low, high, share)
}

impl RotaryPicture<'_> {
    /// Draws a curve of each plan.
    fn draw_curves<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        (title, x, y): (&str, &str, &str),
        range: Option<Range<f64>>,
        curve: impl Fn(&Plan) -> Points,
    ) -> DrawResult<(), DB> {
        let curves: Vec<_> = self.plots.plans().map(|(plan, color, _)| (curve(plan), color)).collect();
        let points = || curves.iter().map(|(points, _)| points);
        let x = AxisSpec::new(x, joined(points(), |point| point.0, 0.0));
        let y = AxisSpec::new(y, range.unwrap_or_else(|| joined(points(), |point| point.1, 0.08)));
        let mut chart = theme::panel(area, scale, title, &x, &y)?;
        for (points, color) in &curves {
            theme::curve(&mut chart, points, scale.stroke(*color, 1.8))?;
        }
        Ok(())
    }

    fn draw_whole<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        axis: usize,
    ) -> DrawResult<(), DB> {
        let letter = self.plots.setup.letters[axis];
        let title = match &self.plots.thinning {
            Some(thinning) => format!(
                "{letter} axis: {} reversals as programmed, {} thinned",
                thinning.reversals_before[axis], thinning.reversals_after[axis]
            ),
            None => format!("{letter} axis"),
        };
        let labels = (title.as_str(), "time, s", "angle, degrees");
        // Where it swings to before and after the cuts would make them small.
        let extents = self.plots.plans().map(|(plan, _, _)| plan.cut_extents_deg[axis]);
        let extent = extents.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let range = extent.filter(|(low, high)| low <= high).map(|(low, high)| theme::padded(low, high, 0.12));
        self.draw_curves(area, scale, labels, range, |plan| plan.angles_deg[axis].points())
    }

    fn draw_close<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        axis: usize,
    ) -> DrawResult<(), DB> {
        let letter = self.plots.setup.letters[axis];
        let lines = &self.plots.setup.close_lines;
        let title = format!("{letter} close up: lines {} to {}", lines.start(), lines.end());
        let labels = (title.as_str(), "path of the tool centre point, mm", "angle, degrees");
        self.draw_curves(area, scale, labels, None, |plan| {
            plan.close.iter().map(|sample| (sample.path_mm, sample.angles_deg[axis])).collect()
        })
    }

    fn draw_velocity<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        axis: usize,
    ) -> DrawResult<(), DB> {
        let letter = self.plots.setup.letters[axis];
        let title = format!("velocity of {letter} in the same stretch of the path");
        let labels = (title.as_str(), "time from its start, s", "velocity, degrees/s");
        self.draw_curves(area, scale, labels, None, |plan| {
            let start_s = plan.close.first().map_or(0.0, |sample| sample.time_s);
            let pairs = plan.close.windows(2);
            pairs
                .map(|pair| {
                    let way_deg = pair[1].angles_deg[axis] - pair[0].angles_deg[axis];
                    (pair[1].time_s - start_s, way_deg / (pair[1].time_s - pair[0].time_s))
                })
                .collect()
        })
    }
}
