//! How pictures look: fonts, colours, line widths, and the frame of every panel.

use std::ops::Range;
use std::sync::OnceLock;

use plotters::chart::{ChartBuilder, ChartContext, LabelAreaPosition};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::{DashedPathElement, PathElement, Rectangle, Text};
use plotters::prelude::{Cartesian2d, DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle, register_font};

use super::{DrawResult, PlotError, clip};

/// Text and frames.
pub(super) const INK: RGBColor = RGBColor(31, 41, 55);
/// Secondary text.
pub(super) const MUTED: RGBColor = RGBColor(91, 103, 120);
/// Grid lines.
const GRID: RGBColor = RGBColor(228, 231, 236);
/// What the program commands.
pub(super) const COMMAND: RGBColor = RGBColor(37, 99, 235);
/// Rapid moves.
pub(super) const RAPID: RGBColor = RGBColor(148, 163, 184);
/// What vibrates.
pub(super) const VIBRATION: RGBColor = RGBColor(220, 76, 30);
/// Good news.
pub(super) const GOOD: RGBColor = RGBColor(4, 120, 87);
/// Bad news.
pub(super) const BAD: RGBColor = RGBColor(185, 28, 28);
/// Colours of curves that are told apart only by the legend.
pub(super) const PALETTE: [RGBColor; 6] = [
    RGBColor(37, 99, 235),
    RGBColor(220, 76, 30),
    RGBColor(4, 120, 87),
    RGBColor(147, 51, 234),
    RGBColor(180, 130, 10),
    RGBColor(15, 118, 160),
];

const FONT: &str = "sans-serif";

/// Makes the embedded font known, once.
pub(super) fn load_font() -> Result<(), PlotError> {
    static LOADED: OnceLock<bool> = OnceLock::new();
    let loaded =
        *LOADED.get_or_init(|| register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok());
    if loaded { Ok(()) } else { Err(PlotError("the embedded font cannot be read".to_owned())) }
}

/// Pixels per design unit: one for vector pictures, more for bitmaps that are drawn larger and averaged down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale(pub(super) f64);

impl Scale {
    /// A length in pixels.
    #[allow(clippy::cast_possible_truncation, reason = "pixel counts are small")]
    pub(super) fn px(self, units: f64) -> i32 {
        (units * self.0).round() as i32
    }

    /// A stroke.
    #[allow(clippy::cast_sign_loss, reason = "widths are positive")]
    pub(super) fn stroke(self, color: impl Color, width: f64) -> ShapeStyle {
        ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: self.px(width).max(1) as u32 }
    }

    /// A text style.
    pub(super) fn text(self, size: f64, color: RGBColor) -> TextStyle<'static> {
        (FONT, size * self.0).into_font().color(&color)
    }
}

/// An axis of a panel.
#[derive(Clone, Debug)]
pub(super) struct AxisSpec {
    pub(super) label: String,
    pub(super) range: Range<f64>,
}

impl AxisSpec {
    pub(super) fn new(label: impl Into<String>, range: Range<f64>) -> Self {
        Self { label: label.into(), range }
    }
}

pub(super) type Panel<'a, DB> = ChartContext<'a, DB, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Room around a panel's plotting area, design units: left, right, top, bottom.
pub(super) const PANEL_LEFT: f64 = 92.0;
pub(super) const PANEL_RIGHT: f64 = 24.0;
pub(super) const PANEL_TOP: f64 = 34.0;
pub(super) const PANEL_BOTTOM: f64 = 52.0;
/// What of the room on the left stays free, so that the axis label is not cut.
const PANEL_EDGE: f64 = 18.0;

/// Draws the frame of a panel: title, axes with units, grid.
pub(super) fn panel<'a, DB: DrawingBackend + 'a>(
    area: &'a DrawingArea<DB, Shift>,
    scale: Scale,
    title: &str,
    x: &AxisSpec,
    y: &AxisSpec,
) -> DrawResult<Panel<'a, DB>, DB> {
    let title_style = scale.text(17.0, INK).pos(Pos::new(HPos::Left, VPos::Top));
    area.draw(&Text::new(title.to_owned(), (scale.px(PANEL_LEFT), scale.px(9.0)), title_style))?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(scale.px(PANEL_TOP))
        .margin_right(scale.px(PANEL_RIGHT))
        .margin_left(scale.px(PANEL_EDGE))
        .set_label_area_size(LabelAreaPosition::Left, scale.px(PANEL_LEFT - PANEL_EDGE))
        .set_label_area_size(LabelAreaPosition::Bottom, scale.px(PANEL_BOTTOM))
        .build_cartesian_2d(x.range.clone(), y.range.clone())?;
    chart
        .configure_mesh()
        .x_labels(9)
        .y_labels(7)
        .max_light_lines(0)
        .bold_line_style(scale.stroke(GRID, 1.0))
        .axis_style(scale.stroke(MUTED, 1.0))
        .x_desc(x.label.clone())
        .y_desc(y.label.clone())
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .label_style(scale.text(14.0, MUTED))
        .axis_desc_style(scale.text(15.0, INK))
        .set_all_tick_mark_size(scale.px(4.0))
        .draw()?;
    Ok(chart)
}

/// Draws a curve, cut at the edges of the panel. It is drawn in stretches between sharp turns: thick lines with
/// mitred corners would shoot far beyond the peaks of dense curves.
pub(super) fn curve<'a, DB: DrawingBackend + 'a>(
    chart: &mut Panel<'a, DB>,
    points: &[(f64, f64)],
    style: ShapeStyle,
) -> DrawResult<(), DB> {
    let area = chart.plotting_area();
    let (x, y) = (area.get_x_range(), area.get_y_range());
    for part in clip::polyline(points, &x, &y) {
        let pixels: Vec<_> = part.iter().map(|point| chart.plotting_area().map_coordinate(point)).collect();
        let mut stretch = vec![part[0]];
        let mut last_pixel = pixels[0];
        let mut heading = None;
        for (point, pixel) in part.iter().zip(&pixels).skip(1) {
            let step = (f64::from(pixel.0 - last_pixel.0), f64::from(pixel.1 - last_pixel.1));
            if step == (0.0, 0.0) {
                continue;
            }
            if heading.is_some_and(|heading| turns_sharply(heading, step)) {
                let corner = stretch[stretch.len() - 1];
                chart.draw_series([PathElement::new(std::mem::replace(&mut stretch, vec![corner]), style)])?;
            }
            stretch.push(*point);
            (last_pixel, heading) = (*pixel, Some(step));
        }
        chart.draw_series([PathElement::new(stretch, style)])?;
    }
    Ok(())
}

/// Whether two directions differ by more than 45°.
fn turns_sharply(a: (f64, f64), b: (f64, f64)) -> bool {
    let dot = a.0 * b.0 + a.1 * b.1;
    dot < std::f64::consts::FRAC_1_SQRT_2 * a.0.hypot(a.1) * b.0.hypot(b.1)
}

/// Title and second line of a whole picture; the area that is left below them.
pub(super) fn headline<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    title: &str,
    subtitle: &str,
) -> DrawResult<DrawingArea<DB, Shift>, DB> {
    let anchor = Pos::new(HPos::Left, VPos::Top);
    area.draw(&Text::new(title.to_owned(), (scale.px(24.0), scale.px(16.0)), scale.text(27.0, INK).pos(anchor)))?;
    area.draw(&Text::new(subtitle.to_owned(), (scale.px(24.0), scale.px(50.0)), scale.text(16.0, MUTED).pos(anchor)))?;
    Ok(area.split_vertically(scale.px(80.0)).1)
}

/// What a legend entry shows.
#[derive(Clone, Copy, Debug)]
pub(super) enum Swatch {
    Line,
    Dashed,
    Fill,
}

/// Draws a legend in one row; the area that is left below it.
pub(super) fn legend<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    entries: &[(Swatch, RGBColor, &str)],
) -> DrawResult<DrawingArea<DB, Shift>, DB> {
    let style = scale.text(15.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
    let y = scale.px(12.0);
    let mut x = scale.px(PANEL_LEFT);
    for (swatch, color, label) in entries {
        let end = x + scale.px(30.0);
        let line = scale.stroke(*color, 2.5);
        match swatch {
            Swatch::Line => area.draw(&PathElement::new(vec![(x, y), (end, y)], line))?,
            Swatch::Dashed => {
                let points = [(x, y), (end, y)];
                area.draw(&DashedPathElement::new(points, scale.px(7.0), scale.px(5.0), line))?;
            }
            Swatch::Fill => {
                let corners = [(x, y - scale.px(6.0)), (end, y + scale.px(6.0))];
                area.draw(&Rectangle::new(corners, color.mix(0.25).filled()))?;
            }
        }
        area.draw(&Text::new((*label).to_owned(), (end + scale.px(8.0), y), style.clone()))?;
        let (width, _) = area.estimate_text_size(label, &style)?;
        x = end + scale.px(36.0) + i32::try_from(width).unwrap_or(0);
    }
    Ok(area.split_vertically(scale.px(26.0)).1)
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

/// A number on an axis: no superfluous digits, a real minus sign.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature plotters asks for")]
fn tick(value: &f64) -> String {
    let mut text = format!("{value:.6}");
    if text.contains('.') {
        text.truncate(text.trim_end_matches('0').trim_end_matches('.').len());
    }
    if text == "-0" { "0".to_owned() } else { text.replace('-', "\u{2212}") }
}
