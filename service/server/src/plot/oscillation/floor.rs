//! The floor with and without oscillation: heights in one scale of colours, and profiles along the feed.

use std::ops::Range;

use feedwave_cutting::tool_oscillation::{FloorArea, HeightField, Roughness, ToolOscillation};
use plotters::coord::Shift;
use plotters::element::{Rectangle, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{OscillationPictures, sampled, short};

/// Revolutions whose feed is shown.
const REVOLUTIONS: f64 = 6.0;
/// Cells along the feed, and rows that are drawn across it.
const COLUMNS: f64 = 300.0;
const ROWS: usize = 160;
/// Most rows that are simulated: the floor of a wider track is that of its middle.
const MAX_ROWS: f64 = 20_000.0;
/// Colours that are told apart.
const COLORS: u32 = 24;
/// The least range of colours, µm: below it a floor is flat.
const LEAST_RANGE_UM: f64 = 0.1;
/// Colours from low to high.
const RAMP: [RGBColor; 5] = [
    RGBColor(49, 46, 129),
    RGBColor(37, 99, 235),
    RGBColor(45, 170, 158),
    RGBColor(190, 205, 90),
    RGBColor(253, 231, 110),
];
/// Room on the right for the scale of colours, design units.
const SCALE_WIDTH: f64 = 120.0;

/// The floor with and without oscillation.
pub(super) struct FloorPicture<'a> {
    pass: &'a OscillationPictures<'a>,
    /// With and without; none where it cannot be simulated.
    floors: Option<[Floor; 2]>,
    /// Middle of the shown width, mm to the right of the feed.
    across_mm: f64,
}

struct Floor {
    field: HeightField,
    roughness: Roughness,
}

impl Floor {
    fn new(field: HeightField) -> Self {
        let roughness = field.roughness();
        Self { field, roughness }
    }

    /// Mean height of the cells of a column in some rows above the mean of the floor, µm; none where nothing swept.
    fn height_um(&self, rows: Range<usize>, column: usize) -> Option<f64> {
        let heights = rows.filter_map(|row| self.field.heights_mm.get(row * self.field.columns + column));
        let swept = heights.filter(|height| height.is_finite());
        let (sum_mm, count) = swept.fold((0.0, 0.0), |(sum, count), height| (sum + f64::from(*height), count + 1.0));
        (count > 0.0).then(|| 1e3 * (sum_mm / count - self.roughness.height_mm))
    }

    fn extent_um(&self) -> (f64, f64) {
        let heights = self.field.heights_mm.iter().filter(|height| height.is_finite());
        heights.fold((0.0, 0.0), |(low, high): (f64, f64), height| {
            let height_um = 1e3 * (f64::from(*height) - self.roughness.height_mm);
            (low.min(height_um), high.max(height_um))
        })
    }
}

impl<'a> FloorPicture<'a> {
    pub(super) fn new(pass: &'a OscillationPictures<'a>) -> Self {
        let length_mm = REVOLUTIONS * pass.feed_per_rev_mm();
        let resolution_mm = length_mm / COLUMNS;
        // Close to the sides of the track the edges go along it.
        let swept_mm = pass.engaged_mm();
        let width_mm = 0.98 * (swept_mm.end - swept_mm.start);
        let area = FloorArea {
            length_mm,
            width_mm: width_mm.max(resolution_mm).min(resolution_mm * MAX_ROWS),
            across_mm: 0.5 * (swept_mm.start + swept_mm.end),
            resolution_mm,
            trailing: true,
        };
        let simulate = |oscillation: &ToolOscillation| {
            HeightField::simulate(pass.tool, oscillation, &pass.section.cut, &area).map(Floor::new).ok()
        };
        let floors = simulate(pass.oscillation).zip(simulate(&pass.plain())).map(|(with, without)| [with, without]);
        Self { pass, floors, across_mm: area.across_mm }
    }
}

impl Picture for FloorPicture<'_> {
    fn name(&self) -> String {
        format!("{}-floor", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let title = "The floor that the ends of the edges leave";
        let body = theme::headline(area, scale, title, &self.pass.subtitle())?;
        let Some(floors) = &self.floors else {
            let style = scale.text(17.0, theme::MUTED);
            let text = "the feed is too small for a floor of several revolutions to be simulated";
            return body.draw(&Text::new(text, (scale.px(theme::PANEL_LEFT), scale.px(20.0)), style));
        };
        let extents = floors.each_ref().map(Floor::extent_um);
        let (low, high) = (extents[0].0.min(extents[1].0), extents[0].1.max(extents[1].1));
        let room = (0.5 * (LEAST_RANGE_UM - (high - low))).max(0.0);
        let range = low - room..high + room;
        let (maps, profiles) = body.split_vertically(body.dim_in_pixel().1 * 64 / 100);
        let width = i32::try_from(maps.dim_in_pixel().0).unwrap_or(i32::MAX);
        let (maps, colors) = maps.split_horizontally(width - scale.px(SCALE_WIDTH));
        for ((area, floor), name) in maps.split_evenly((1, 2)).iter().zip(floors).zip(["with", "without"]) {
            draw_map(area, scale, floor, name, self.across_mm, &range)?;
        }
        draw_colors(&colors, scale, &range)?;
        self.draw_profiles(&profiles, scale, floors, &range)
    }
}

/// Place of a height within the scale, as one of the colours.
fn level(height_um: f64, range: &Range<f64>) -> u32 {
    let share = (height_um - range.start) / (range.end - range.start);
    (share * f64::from(COLORS)).clamp(0.0, f64::from(COLORS - 1)) as u32
}

fn color(level: u32) -> RGBColor {
    let place = (f64::from(level) + 0.5) / f64::from(COLORS) * (RAMP.len() - 1) as f64;
    let index = (place as usize).min(RAMP.len() - 2);
    let share = place - index as f64;
    let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
    let (a, b) = (RAMP[index], RAMP[index + 1]);
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

fn draw_map<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    floor: &Floor,
    name: &str,
    across_mm: f64,
    range: &Range<f64>,
) -> DrawResult<(), DB> {
    let Floor { field, roughness } = floor;
    let length_mm = field.columns as f64 * field.resolution_mm;
    let width_mm = field.rows as f64 * field.resolution_mm;
    let side_mm = across_mm - 0.5 * width_mm;
    let title = format!(
        "{name} oscillation: peak to valley {} µm, mean {} µm, at {} mm",
        short(1e3 * roughness.peak_to_valley_mm, 2),
        short(1e3 * roughness.mean_mm, 2),
        short(roughness.height_mm, 4)
    );
    let (x, y) = (
        AxisSpec::new("along the feed, mm", 0.0..length_mm),
        AxisSpec::new("to the right of the feed, mm", side_mm..side_mm + width_mm),
    );
    let mut chart = theme::panel(area, scale, &title, &x, &y)?;
    let rows = ROWS.min(field.rows);
    let mut parts = Vec::new();
    for row in 0..rows {
        // Where the edges go along the track their marks are finer than a row: its mean is shown.
        let of_field = row * field.rows / rows..(row + 1) * field.rows / rows;
        let levels: Vec<_> = (0..field.columns)
            .map(|column| floor.height_um(of_field.clone(), column).map(|height| level(height, range)))
            .collect();
        let (low, high) =
            (side_mm + width_mm * row as f64 / rows as f64, side_mm + width_mm * (row + 1) as f64 / rows as f64);
        let mut start = 0;
        for column in 1..=field.columns {
            if column < field.columns && levels[column] == levels[start] {
                continue;
            }
            if let Some(level) = levels[start] {
                let at = |column: usize| column as f64 * field.resolution_mm;
                parts.push(Rectangle::new([(at(start), low), (at(column), high)], color(level).filled()));
            }
            start = column;
        }
    }
    chart.draw_series(parts)?;
    Ok(())
}

fn draw_colors<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    range: &Range<f64>,
) -> DrawResult<(), DB> {
    let height = i32::try_from(area.dim_in_pixel().1).unwrap_or(i32::MAX);
    let (top, bottom) = (scale.px(theme::PANEL_TOP), height - scale.px(theme::PANEL_BOTTOM));
    let (left, right) = (scale.px(6.0), scale.px(30.0));
    let at = |share: f64| bottom - (share * f64::from(bottom - top)) as i32;
    for step in 0..COLORS {
        let corners =
            [(left, at(f64::from(step + 1) / f64::from(COLORS))), (right, at(f64::from(step) / f64::from(COLORS)))];
        area.draw(&Rectangle::new(corners, color(step).filled()))?;
    }
    let style = scale.text(14.0, theme::MUTED).pos(Pos::new(HPos::Left, VPos::Center));
    let span = range.end - range.start;
    let decimals = if span < 1.0 { 3 } else { 1 };
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let text = format!("{} µm", short(range.start + share * span, decimals));
        area.draw(&Text::new(text, (right + scale.px(7.0), at(share)), style.clone()))?;
    }
    let style = scale.text(15.0, theme::INK).pos(Pos::new(HPos::Left, VPos::Top));
    area.draw(&Text::new("above the mean", (left, scale.px(9.0)), style))
}

impl FloorPicture<'_> {
    fn draw_profiles<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        floors: &[Floor; 2],
        range: &Range<f64>,
    ) -> DrawResult<(), DB> {
        let entries =
            [(Swatch::Line, theme::VIBRATION, "with oscillation"), (Swatch::Line, theme::MUTED, "without oscillation")];
        let area = theme::legend(area, scale, &entries)?;
        let field = &floors[0].field;
        let x = AxisSpec::new("along the feed, mm", 0.0..field.columns as f64 * field.resolution_mm);
        let y = AxisSpec::new("above the mean, µm", theme::padded(range.start, range.end, 0.15));
        let mut chart = theme::panel(&area, scale, "profile along the middle of the track", &x, &y)?;
        for (floor, color) in floors.iter().zip([theme::VIBRATION, theme::MUTED]).rev() {
            let (row, last) = (floor.field.rows / 2, floor.field.columns.saturating_sub(1));
            let steps = u32::try_from(last).unwrap_or(1).max(1);
            let profile = sampled(0.0, last as f64, steps, |column| {
                let height = floor.height_um(row..row + 1, column.round() as usize).unwrap_or(f64::NAN);
                ((column + 0.5) * floor.field.resolution_mm, height)
            });
            for swept in profile.split(|point| point.1.is_nan()).filter(|swept| swept.len() > 1) {
                theme::curve(&mut chart, swept, scale.stroke(color, 2.4))?;
            }
        }
        Ok(())
    }
}
