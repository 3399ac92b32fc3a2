//! Draws a picture that is laid out, on any backend.

use plotters::chart::{ChartBuilder, ChartContext, LabelAreaPosition};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Circle, DashedPathElement, EmptyElement, PathElement, Polygon, Rectangle, Text};
use plotters::prelude::{Cartesian2d, DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, WHITE};

use super::canvas::DrawResult;
use super::clip;
use super::figure::{ColorScale, Figure, Label, Layer, Place, Proportions, Shape, short};
use super::layout::{EDGE, Entry, NOTE_HEIGHT, PANEL_TITLE_HEIGHT, Page, Placed, Rect, SWATCH, SWATCH_GAP, is_inside};
use super::theme::{self, Ink, Mark, Scale};

type Area<DB> = DrawingArea<DB, Shift>;
type Chart<'a, DB> = ChartContext<'a, DB, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Length and half width of the head of an arrow, design units.
const ARROW: (f64, f64) = (14.0, 5.5);
/// Half height of a swatch that is filled.
const SWATCH_HALF: f64 = 8.0;

/// Draws a picture.
pub(super) fn figure<DB: DrawingBackend>(area: &Area<DB>, scale: Scale, figure: &Figure) -> DrawResult<(), DB> {
    let page = Page::of(figure);
    let top_left = Pos::new(HPos::Left, VPos::Top);
    let title = scale.text(theme::TITLE_SIZE, theme::INK).pos(top_left);
    area.draw(&Text::new(figure.title.clone(), (scale.px(EDGE), scale.px(14.0)), title))?;
    let style = scale.text(theme::SUBTITLE_SIZE, theme::MUTED).pos(top_left);
    for (index, line) in page.subtitle.iter().enumerate() {
        let top = 54.0 + 24.0 * index as f64;
        area.draw(&Text::new(line.clone(), (scale.px(EDGE), scale.px(top)), style.clone()))?;
    }
    for entry in &page.legend {
        draw_entry(area, scale, entry)?;
    }
    for placed in &page.panels {
        draw_panel(area, scale, placed)?;
    }
    for (colors, rect) in &page.colors {
        draw_colors(area, scale, colors, *rect)?;
    }
    Ok(())
}

/// A legend entry: every ink of its name, as it is in the picture.
fn draw_entry<DB: DrawingBackend>(area: &Area<DB>, scale: Scale, entry: &Entry) -> DrawResult<(), DB> {
    let (left, middle) = entry.at;
    let place = |x: f64, y: f64| (scale.px(x), scale.px(y));
    for ink in &entry.inks {
        let ends = [place(left, middle), place(left + SWATCH, middle)];
        match ink.mark {
            Mark::Line { width } => {
                area.draw(&PathElement::new(ends.to_vec(), scale.stroke(ink.color, width)))?;
            }
            Mark::Dashed { width, dash, gap } => {
                let style = scale.stroke(ink.color, width);
                area.draw(&DashedPathElement::new(ends, scale.px(dash), scale.px(gap), style))?;
            }
            Mark::Fill { opacity } => {
                let corners = [place(left, middle - SWATCH_HALF), place(left + SWATCH, middle + SWATCH_HALF)];
                area.draw(&Rectangle::new(corners, ink.color.mix(opacity).filled()))?;
            }
            Mark::Dot { radius } => {
                let center = place(left + 0.5 * SWATCH, middle);
                area.draw(&Circle::new(center, scale.px(radius), ink.color.filled()))?;
            }
        }
    }
    let style = scale.text(theme::LEGEND_SIZE, theme::INK).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new(entry.name.to_string(), place(left + SWATCH + SWATCH_GAP, middle), style))
}

fn draw_panel<DB: DrawingBackend>(area: &Area<DB>, scale: Scale, placed: &Placed<'_>) -> DrawResult<(), DB> {
    let Placed { panel, rect, plot, .. } = placed;
    let top_left = Pos::new(HPos::Left, VPos::Top);
    let mut top = plot.top - PANEL_TITLE_HEIGHT * placed.title.len() as f64 - NOTE_HEIGHT * placed.notes.len() as f64;
    for line in &placed.title {
        let style = scale.text(theme::PANEL_TITLE_SIZE, theme::INK).pos(top_left);
        area.draw(&Text::new(line.clone(), (scale.px(plot.left), scale.px(top)), style))?;
        top += PANEL_TITLE_HEIGHT;
    }
    for line in &placed.notes {
        let style = scale.text(theme::NOTE_SIZE, theme::MUTED).pos(top_left);
        area.draw(&Text::new(line.clone(), (scale.px(plot.left), scale.px(top)), style))?;
        top += NOTE_HEIGHT;
    }
    let inner =
        area.clone().shrink((scale.px(rect.left), scale.px(rect.top)), (scale.px(rect.width), scale.px(rect.height)));
    let bottom = rect.top + rect.height - plot.top - plot.height;
    let right = rect.left + rect.width - plot.left - plot.width;
    // What of the space on the left stays free, so that the axis label is not cut.
    let edge = if panel.proportions == Proportions::Bare { plot.left - rect.left } else { 18.0 };
    let mut chart = ChartBuilder::on(&inner)
        .margin_top(scale.px(plot.top - rect.top))
        .margin_right(scale.px(right))
        .margin_left(scale.px(edge))
        .set_label_area_size(LabelAreaPosition::Left, scale.px(plot.left - rect.left - edge))
        .set_label_area_size(LabelAreaPosition::Bottom, scale.px(bottom))
        .build_cartesian_2d(placed.x.clone(), placed.y.clone())?;
    if panel.proportions != Proportions::Bare {
        draw_mesh(&mut chart, scale, placed)?;
    }
    for layer in &panel.layers {
        draw_layer(&mut chart, scale, placed, layer)?;
    }
    for label in &panel.labels {
        draw_label(area, &chart, scale, placed, label)?;
    }
    Ok(())
}

fn draw_mesh<DB: DrawingBackend>(chart: &mut Chart<'_, DB>, scale: Scale, placed: &Placed<'_>) -> DrawResult<(), DB> {
    let (panel, plot) = (placed.panel, placed.plot);
    let across = (plot.width / 110.0).clamp(4.0, 10.0) as usize;
    let up = (plot.height / 30.0).clamp(5.0, 9.0) as usize;
    let span_x = placed.x.end - placed.x.start;
    let span_y = placed.y.end - placed.y.start;
    let x_number = move |value: &f64| super::figure::number(*value, span_x);
    let y_number = move |value: &f64| super::figure::number(*value, span_y);
    let mut mesh = chart.configure_mesh();
    mesh.x_labels(across)
        .y_labels(if panel.y_numbers { up } else { 0 })
        .max_light_lines(0)
        .bold_line_style(scale.stroke(theme::GRID, 1.0))
        .axis_style(scale.stroke(theme::MUTED, 1.0))
        .x_label_formatter(&x_number)
        .y_label_formatter(&y_number)
        .label_style(scale.text(theme::TICK_SIZE, theme::MUTED))
        .axis_desc_style(scale.text(theme::AXIS_SIZE, theme::INK))
        .set_all_tick_mark_size(scale.px(4.0));
    if panel.x.labelled {
        mesh.x_desc(panel.x.text());
    }
    mesh.y_desc(panel.y.text()).draw()
}

fn draw_layer<DB: DrawingBackend>(
    chart: &mut Chart<'_, DB>,
    scale: Scale,
    placed: &Placed<'_>,
    layer: &Layer,
) -> DrawResult<(), DB> {
    let (x, y) = (&placed.x, &placed.y);
    let color = layer.ink.color;
    match (&layer.shape, layer.ink.mark) {
        (Shape::Path(points), Mark::Dashed { width, dash, gap }) => {
            for part in clip::polyline(points, x, y) {
                let style = scale.stroke(color, width);
                chart.draw_series([DashedPathElement::new(part, scale.px(dash), scale.px(gap), style)])?;
            }
        }
        (Shape::Path(points), mark) => {
            let width = if let Mark::Line { width } = mark { width } else { 1.5 };
            for part in clip::polyline(points, x, y) {
                draw_line(chart, &part, scale.stroke(color, width))?;
            }
        }
        (Shape::Area(outline), mark) => {
            let opacity = if let Mark::Fill { opacity } = mark { opacity } else { 1.0 };
            let corners = clip::polygon(outline, x, y);
            if corners.len() > 2 {
                chart.draw_series([Polygon::new(corners, color.mix(opacity).filled())])?;
            }
        }
        (Shape::Dots(places), mark) => {
            let radius = if let Mark::Dot { radius } = mark { radius } else { 5.0 };
            let inside = places.iter().filter(|place| is_inside(**place, x, y));
            chart.draw_series(inside.map(|place| Circle::new(*place, scale.px(radius), color.filled())))?;
        }
        (Shape::Arrow(from, to), _) => draw_arrow(chart, scale, *from, *to, &layer.ink)?,
        (Shape::Cells(cells), _) => {
            chart.draw_series(cells.iter().map(|(corners, color)| Rectangle::new(*corners, color.filled())))?;
        }
    }
    Ok(())
}

/// Draws a line in stretches between sharp turns: thick lines with mitred corners would shoot far beyond the peaks of
/// dense curves.
fn draw_line<DB: DrawingBackend>(
    chart: &mut Chart<'_, DB>,
    part: &[Place],
    style: plotters::style::ShapeStyle,
) -> DrawResult<(), DB> {
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
    if stretch.len() > 1 {
        chart.draw_series([PathElement::new(stretch, style)])?;
    }
    Ok(())
}

fn turns_sharply(a: (f64, f64), b: (f64, f64)) -> bool {
    let dot = a.0 * b.0 + a.1 * b.1;
    dot < std::f64::consts::FRAC_1_SQRT_2 * a.0.hypot(a.1) * b.0.hypot(b.1)
}

fn draw_arrow<DB: DrawingBackend>(
    chart: &mut Chart<'_, DB>,
    scale: Scale,
    from: Place,
    to: Place,
    ink: &Ink,
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
    let corners = vec![corner(0.0, 0.0), corner(ARROW.0, ARROW.1), corner(ARROW.0, -ARROW.1)];
    chart.draw_series([EmptyElement::at(to) + Polygon::new(corners, ink.color.filled())])?;
    Ok(())
}

/// Draws a label on the whole picture: a panel would cut it off at its edge.
fn draw_label<DB: DrawingBackend>(
    area: &Area<DB>,
    chart: &Chart<'_, DB>,
    scale: Scale,
    placed: &Placed<'_>,
    label: &Label,
) -> DrawResult<(), DB> {
    if !is_inside(label.at, &placed.x, &placed.y) {
        return Ok(());
    }
    let (left, top) = chart.plotting_area().map_coordinate(&label.at);
    let at = (left + scale.px(label.beside.by.0), top + scale.px(label.beside.by.1));
    let style = scale.text(theme::LABEL_SIZE, label.color).pos(Pos::new(label.beside.x, label.beside.y));
    area.draw(&Text::new(label.text.clone(), at, style))
}

fn draw_colors<DB: DrawingBackend>(
    area: &Area<DB>,
    scale: Scale,
    colors: &ColorScale,
    rect: Rect,
) -> DrawResult<(), DB> {
    let (left, right) = (rect.left + 4.0, rect.left + 30.0);
    let (top, bottom) = (rect.top + 60.0, rect.top + rect.height - 66.0);
    let count = colors.colors.len().max(1) as f64;
    let at = |share: f64| scale.px(bottom - share * (bottom - top));
    for (step, color) in colors.colors.iter().enumerate() {
        let (low, high) = (step as f64 / count, (step + 1) as f64 / count);
        let corners = [(scale.px(left), at(high)), (scale.px(right), at(low))];
        area.draw(&Rectangle::new(corners, color.filled()))?;
    }
    let style = scale.text(theme::TICK_SIZE, theme::MUTED).pos(Pos::new(HPos::Left, VPos::Center));
    let span = colors.range.end - colors.range.start;
    let decimals = if span < 1.0 { 3 } else { 1 };
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let text = format!("{} {}", short(colors.range.start + share * span, decimals), colors.unit);
        area.draw(&Text::new(text, (scale.px(right + 7.0), at(share)), style.clone()))?;
    }
    let style = scale.text(theme::NOTE_SIZE, theme::INK).pos(Pos::new(HPos::Left, VPos::Bottom));
    let lines = theme::wrapped(&colors.title, theme::NOTE_SIZE, rect.width - 4.0);
    for (index, line) in lines.iter().rev().enumerate() {
        let bottom = top - 12.0 - NOTE_HEIGHT * index as f64;
        area.draw(&Text::new(line.clone(), (scale.px(left), scale.px(bottom)), style.clone()))?;
    }
    Ok(())
}

/// White paper.
pub(super) fn clear<DB: DrawingBackend>(area: &Area<DB>) -> DrawResult<(), DB> {
    area.fill(&WHITE)
}
