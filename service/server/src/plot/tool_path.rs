//! Picture of the tool path: where the tool goes, what is rapid, what vibrates. Both axes have the same scale.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::element::{Circle, DashedPathElement, EmptyElement, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::canvas::Picture;
use super::theme::{self, AxisSpec, Scale, Swatch};
use super::trace::{PathTrace, Point, Stretch};
use super::{DrawResult, clip};

/// The tool path of a program.
pub(super) struct ToolPathPicture<'a> {
    pub(super) program: &'a str,
    pub(super) trace: &'a PathTrace,
    /// Drawn like a lathe: Z to the right, X upwards, the spindle's axis at X = 0.
    pub(super) turning: bool,
}

/// A view: which coordinates run to the right and upwards.
struct View {
    title: &'static str,
    right: (usize, &'static str),
    up: (usize, &'static str),
}

const TURNING: View = View { title: "", right: (2, "Z, mm"), up: (0, "X (radius), mm") };
const FROM_ABOVE: View = View { title: "from above", right: (0, "X, mm"), up: (1, "Y, mm") };
const FROM_FRONT: View = View { title: "from the front", right: (0, "X, mm"), up: (2, "Z, mm") };

impl Picture for ToolPathPicture<'_> {
    fn name(&self) -> String {
        "tool-path".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let subtitle = format!("{} \u{b7} work coordinates \u{b7} both axes to the same scale", self.program);
        let body = theme::headline(area, scale, "Tool path", &subtitle)?;
        let has = |stretch| self.trace.runs().iter().any(|run| run.stretch == stretch);
        let entries = [
            (Stretch::Cutting, Swatch::Line, theme::COMMAND, "cutting"),
            (Stretch::Vibrating, Swatch::Line, theme::VIBRATION, "cutting with vibration along the path"),
            (Stretch::Oscillating, Swatch::Line, theme::VIBRATION, "cutting with an oscillating tool"),
            (Stretch::Rapid, Swatch::Dashed, theme::RAPID, "rapid"),
        ];
        let entries: Vec<_> = entries
            .into_iter()
            .filter(|entry| has(entry.0))
            .map(|(_, swatch, color, label)| (swatch, color, label))
            .collect();
        let body = theme::legend(&body, scale, &entries)?;
        if self.turning {
            return self.draw_view(&body, scale, &TURNING);
        }
        let (left, right) = body.split_horizontally(body.dim_in_pixel().0 / 2);
        self.draw_view(&left, scale, &FROM_ABOVE)?;
        self.draw_view(&right, scale, &FROM_FRONT)
    }
}

impl ToolPathPicture<'_> {
    fn draw_view<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        view: &View,
    ) -> DrawResult<(), DB> {
        let project = |point: &Point| (point[view.right.0], point[view.up.0]);
        let (mut x, mut y) = self.part(project);
        (x, y) = same_scale(area.dim_in_pixel(), scale, x, y);
        let (x, y) = (AxisSpec::new(view.right.1, x), AxisSpec::new(view.up.1, y));
        let mut chart = theme::panel(area, scale, view.title, &x, &y)?;
        if self.turning {
            let axis = [(x.range.start, 0.0), (x.range.end, 0.0)];
            let style = scale.stroke(theme::MUTED, 1.0);
            chart.draw_series([DashedPathElement::new(axis, scale.px(16.0), scale.px(6.0), style)])?;
            let label_style = scale.text(13.0, theme::MUTED).pos(Pos::new(HPos::Left, VPos::Top));
            let text = Text::new("spindle axis", (scale.px(10.0), scale.px(7.0)), label_style);
            chart.draw_series([EmptyElement::at((x.range.start, 0.0)) + text])?;
        }
        // Rapids below, what vibrates on top.
        for stretch in [Stretch::Rapid, Stretch::Cutting, Stretch::Vibrating, Stretch::Oscillating] {
            for run in self.trace.runs().iter().filter(|run| run.stretch == stretch) {
                let line: Vec<_> = run.points.iter().map(project).collect();
                draw_run(&mut chart, scale, stretch, &line)?;
            }
        }
        let first = self.trace.runs().first().and_then(|run| run.points.first()).map(project);
        let last = self.trace.runs().last().and_then(|run| run.points.last()).map(project);
        let middle = (x.range.start + x.range.end) / 2.0;
        let same_place = first == last;
        for (point, label, color) in [(first, "start", theme::GOOD), (last, "end", theme::INK)] {
            let Some(point) = point.filter(|point| x.range.contains(&point.0) && y.range.contains(&point.1)) else {
                continue;
            };
            let label = if same_place { "start and end" } else { label };
            mark(&mut chart, scale, point, label, color, point.0 > middle)?;
        }
        Ok(())
    }
}

fn draw_run<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    stretch: Stretch,
    line: &[(f64, f64)],
) -> DrawResult<(), DB> {
    match stretch {
        Stretch::Rapid => {
            let (x, y) = (chart.plotting_area().get_x_range(), chart.plotting_area().get_y_range());
            let style = scale.stroke(theme::RAPID, 1.5);
            for line in clip::polyline(line, &x, &y) {
                chart.draw_series([DashedPathElement::new(line, scale.px(7.0), scale.px(5.0), style)])?;
            }
            Ok(())
        }
        Stretch::Cutting => theme::curve(chart, line, scale.stroke(theme::COMMAND, 2.0)),
        Stretch::Vibrating | Stretch::Oscillating => theme::curve(chart, line, scale.stroke(theme::VIBRATION, 3.0)),
    }
}

fn mark<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    point: (f64, f64),
    label: &str,
    color: RGBColor,
    label_left: bool,
) -> DrawResult<(), DB> {
    chart.draw_series([Circle::new(point, scale.px(4.5), color.filled())])?;
    let (side, offset) = if label_left { (HPos::Right, -9.0) } else { (HPos::Left, 9.0) };
    let style = scale.text(14.0, color).pos(Pos::new(side, VPos::Bottom));
    let text = EmptyElement::at(point) + Text::new(label.to_owned(), (scale.px(offset), scale.px(-3.0)), style);
    chart.draw_series([text])?;
    Ok(())
}

impl ToolPathPicture<'_> {
    /// What of the path is shown: all that is cut with some room around it. Rapids to a far tool change would
    /// make the part tiny, so they leave the picture at its edge.
    fn part(&self, project: impl Fn(&Point) -> (f64, f64)) -> (Range<f64>, Range<f64>) {
        let cut = self.trace.runs().iter().filter(|run| run.stretch != Stretch::Rapid);
        let cut: Vec<_> = cut.flat_map(|run| run.points.iter().map(&project)).collect();
        let all = self.trace.runs().iter().flat_map(|run| run.points.iter().map(&project));
        let all: Vec<_> = all.collect();
        let shown = if cut.is_empty() { &all } else { &cut };
        let x = extent(shown.iter().map(|point| point.0));
        let mut y = extent(shown.iter().map(|point| point.1));
        if self.turning {
            // The spindle's axis belongs to the picture of a turned part.
            y.start = y.start.min(0.0);
        }
        let room = if cut.is_empty() { 0.0 } else { ROOM_SHARE * (x.end - x.start).max(y.end - y.start) };
        let grown = |part: Range<f64>, whole: Range<f64>| {
            (part.start - room).max(whole.start.min(part.start))..(part.end + room).min(whole.end.max(part.end))
        };
        let whole = (extent(all.iter().map(|point| point.0)), extent(all.iter().map(|point| point.1)));
        (grown(x, whole.0), grown(y, whole.1))
    }
}

/// Room around what is cut, in which rapids are shown, as a share of its larger side.
const ROOM_SHARE: f64 = 0.25;

fn extent(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low <= high { low..high } else { 0.0..1.0 }
}

/// Widens one of the ranges so that a millimetre is as long to the right as upwards.
pub(super) fn same_scale(size_px: (u32, u32), scale: Scale, x: Range<f64>, y: Range<f64>) -> (Range<f64>, Range<f64>) {
    let room = |pixels: u32, taken: f64| (f64::from(pixels) - f64::from(scale.px(taken))).max(1.0);
    let width_px = room(size_px.0, theme::PANEL_LEFT + theme::PANEL_RIGHT);
    let height_px = room(size_px.1, theme::PANEL_TOP + theme::PANEL_BOTTOM);
    let mm_per_px = 1.1 * ((x.end - x.start) / width_px).max((y.end - y.start) / height_px).max(1e-6);
    let widen = |range: Range<f64>, pixels: f64| {
        let middle = (range.start + range.end) / 2.0;
        middle - mm_per_px * pixels / 2.0..middle + mm_per_px * pixels / 2.0
    };
    (widen(x, width_px), widen(y, height_px))
}
