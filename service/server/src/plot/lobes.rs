//! Stability lobes over the spindle speed: how deep the cut may be, with the speeds of the spindle table, and below at which
//! frequency it chatters beyond.

use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::element::{Circle, PathElement, Polygon, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::canvas::{self, DrawResult, Picture, PlotError};
use super::theme::{self, AxisSpec, Scale, Swatch};
use crate::proto::StabilityLobes;

/// Room above the deepest speed of the table.
const HEADROOM: f64 = 1.3;
/// What is drawn at least, as a multiple of the limit below which nothing chatters.
const LEAST_LIMITS: f64 = 2.5;

/// Lobes to draw.
#[derive(Clone, Debug)]
pub struct LobesPicture<'a> {
    /// What they are of, in one line.
    pub subtitle: String,
    /// The lobes with their table.
    pub lobes: &'a StabilityLobes,
}

/// Draws `lobes.svg` and `lobes.png` into a directory, which is created where it is missing; their paths.
///
/// # Errors
/// [`PlotError`] when a file cannot be written.
pub fn write_lobes(picture: &LobesPicture<'_>, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    std::fs::create_dir_all(directory)
        .map_err(|error| PlotError(format!("cannot create {}: {error}", directory.display())))?;
    canvas::write(picture, directory)
}

/// Speed and stable depth of a row of the table, and where its band ends.
struct Mark {
    speed_rpm: f64,
    up_to_rpm: f64,
    stable_mm: Option<f64>,
}

impl LobesPicture<'_> {
    fn margin(&self) -> f64 {
        self.lobes.search.and_then(|search| search.margin).unwrap_or_default()
    }

    fn marks(&self) -> Vec<Mark> {
        let pockets = self.lobes.pockets.iter();
        pockets
            .filter_map(|pocket| {
                let band = pocket.band?;
                Some(Mark { speed_rpm: band.speed_rpm, up_to_rpm: band.up_to_rpm, stable_mm: pocket.stable_mm })
            })
            .collect()
    }

    /// Top of the picture, mm: the speeds of the table can be seen, peaks beyond are cut.
    fn top_mm(&self) -> f64 {
        let deepest = self.lobes.pockets.iter().filter_map(|pocket| pocket.stable_mm).fold(0.0, f64::max);
        let least = self.lobes.least_limit_mm.unwrap_or_default();
        (HEADROOM * deepest / (1.0 - self.margin())).max(LEAST_LIMITS * least).max(1e-6)
    }

    /// The limit over the speed, times `share`; where nothing chatters it lies above the picture.
    fn curve(&self, share: f64, top_mm: f64) -> Vec<(f64, f64)> {
        let chart = self.lobes.chart.iter();
        chart.map(|point| (point.speed_rpm, point.limit_mm.map_or(2.0 * top_mm, |limit| share * limit))).collect()
    }

    fn depths<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        x: &AxisSpec,
    ) -> DrawResult<(), DB> {
        let top_mm = self.top_mm();
        let depth = if self.lobes.radial_immersion.is_some() { "axial depth, mm" } else { "width of cut, mm" };
        let mut chart = theme::panel(area, scale, "limit of stability", x, &AxisSpec::new(depth, 0.0..top_mm))?;
        let stable = self.curve(1.0 - self.margin(), top_mm);
        let ends = [(x.range.end, 0.0), (x.range.start, 0.0)];
        let region = stable.iter().map(|&(speed, limit)| (speed, limit.min(top_mm))).chain(ends);
        chart.draw_series([Polygon::new(region.collect::<Vec<_>>(), theme::GOOD.mix(0.12).filled())])?;
        theme::curve(&mut chart, &stable, scale.stroke(theme::GOOD, 1.4))?;
        theme::curve(&mut chart, &self.curve(1.0, top_mm), scale.stroke(theme::BAD, 2.2))?;
        let marks = self.marks();
        // The last band ends with the picture.
        for mark in marks.iter().rev().skip(1) {
            let line = vec![(mark.up_to_rpm, 0.0), (mark.up_to_rpm, top_mm)];
            chart.draw_series([PathElement::new(line, scale.stroke(theme::RAPID.mix(0.7), 1.0))])?;
        }
        let style = scale.text(14.0, theme::INK).pos(Pos::new(HPos::Left, VPos::Bottom));
        for mark in &marks {
            let depth = mark.stable_mm.unwrap_or(top_mm).min(top_mm);
            let line = vec![(mark.speed_rpm, 0.0), (mark.speed_rpm, depth)];
            chart.draw_series([PathElement::new(line, scale.stroke(theme::COMMAND, 1.6))])?;
            chart.draw_series([Circle::new((mark.speed_rpm, depth), scale.px(4.5), theme::COMMAND.filled())])?;
            // At the foot of its line, where no curve passes. On the whole panel: the chart would cut it off at its end.
            let (left, foot) = chart.plotting_area().map_coordinate(&(mark.speed_rpm, 0.0));
            let (columns, rows) = area.get_pixel_range();
            let place = (left - columns.start + scale.px(5.0), foot - rows.start - scale.px(4.0));
            area.draw(&Text::new(format!("{:.0}", mark.speed_rpm), place, style.clone()))?;
        }
        Ok(())
    }

    fn frequencies<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        x: &AxisSpec,
    ) -> DrawResult<(), DB> {
        let points = self.lobes.chart.iter().filter(|point| point.limit_mm.is_some());
        let (low, high) = points.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
            (low.min(point.chatter_hz), high.max(point.chatter_hz))
        });
        let y = AxisSpec::new("frequency, Hz", theme::padded(low, high, 0.1));
        let mut chart = theme::panel(area, scale, "frequency at which it chatters beyond", x, &y)?;
        // Along a branch of a lobe the frequency rises less than the speed; anything else is a jump to another one.
        let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut lobe = None;
        for point in points {
            let place = (point.speed_rpm, point.chatter_hz);
            let goes_on = lobe.replace(point.lobe) == Some(point.lobe);
            match lines.last_mut() {
                Some(line) if goes_on && line.last().is_some_and(|last| continues(*last, place)) => line.push(place),
                _ => lines.push(vec![place]),
            }
        }
        for line in lines.iter().filter(|line| line.len() > 1) {
            theme::curve(&mut chart, line, scale.stroke(theme::VIBRATION, 2.0))?;
        }
        Ok(())
    }
}

/// Whether two points, speed and frequency, can be neighbours on one branch.
fn continues((speed, frequency): (f64, f64), (next_speed, next_frequency): (f64, f64)) -> bool {
    let rise = next_frequency / frequency;
    (1.0 - 1e-6..1.0 + 2.0 * (next_speed / speed - 1.0)).contains(&rise)
}

impl Picture for LobesPicture<'_> {
    fn name(&self) -> String {
        "lobes".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let body = theme::headline(area, scale, "Stability lobes", &self.subtitle)?;
        let stable = format!("stable with the margin of {:.0} %", 100.0 * self.margin());
        let entries: [(Swatch, RGBColor, &str); 3] = [
            (Swatch::Line, theme::BAD, "limit: chatter above"),
            (Swatch::Fill, theme::GOOD, &stable),
            (Swatch::Line, theme::COMMAND, "speed of the table for its band, rev/min"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        let speed = |point: Option<&crate::proto::StabilityPoint>| point.map_or(0.0, |point| point.speed_rpm);
        let range = speed(self.lobes.chart.first())..speed(self.lobes.chart.last());
        let areas = body.split_evenly((2, 1));
        self.depths(&areas[0], scale, &AxisSpec::new("", range.clone()))?;
        self.frequencies(&areas[1], scale, &AxisSpec::new("spindle speed, rev/min", range))
    }
}
