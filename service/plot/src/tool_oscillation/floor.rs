//! The floor with and without oscillation: heights in one scale of colours, and profiles along the feed.

use std::ops::Range;

use feedwave_cutting::tool_oscillation::{FloorArea, HeightField, Roughness, ToolOscillation};
use plotters::style::RGBColor;

use super::super::figure::{Axis, ColorScale, Figure, Layout, MM, Panel, Place, UM, padded, short};
use super::super::theme::{self, Ink};
use super::{OscillationPictures, sampled};

/// Revolutions whose feed is shown.
const REVOLUTIONS: f64 = 6.0;
/// Cells along the feed, and rows that are drawn across it.
const COLUMNS: f64 = 300.0;
const ROWS: usize = 160;
/// Most rows that are simulated: the floor of a wider track is that of its middle.
const MAX_ROWS: f64 = 20_000.0;
/// Colours that can be distinguished.
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
/// A floor rougher than the other by this factor is called so.
const ROUGHER: f64 = 1.05;
/// With and without oscillation.
const NAMES: [&str; 2] = ["with oscillation", "without oscillation"];

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

impl FloorPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let title = "The floor that the ends of the edges leave";
        let (name, subtitle) = (format!("{}-floor", self.pass.name), self.pass.subtitle());
        let Some(floors) = &self.floors else {
            let text = "no picture: the feed is too small for a floor of several revolutions to be simulated";
            return Figure::new(name, title, format!("{subtitle} \u{b7} {text}"), Layout::Row(Vec::new()))
                .with_height(120);
        };
        let extents = floors.each_ref().map(Floor::extent_um);
        let (low, high) = (extents[0].0.min(extents[1].0), extents[0].1.max(extents[1].1));
        if high - low < LEAST_RANGE_UM {
            return Figure::new(name, title, subtitle, self.flat(floors)).with_height(560);
        }
        let range = low..high;
        let maps =
            floors.iter().zip(NAMES).map(|(floor, name)| (0.455, map(floor, name, self.across_mm, &range).into()));
        let colors = ColorScale {
            title: "above the mean".to_owned(),
            range: range.clone(),
            unit: UM.symbol,
            colors: (0..COLORS).map(color).collect(),
        };
        let maps = maps.chain([(0.09, Layout::Colors(colors))]).collect();
        let profiles = self.profiles(floors, &range);
        let body = Layout::Column(vec![(0.62, Layout::Row(maps)), (0.38, profiles.into())]);
        Figure::new(name, title, subtitle, body).with_height(1_000)
    }

    /// Two floors without marks: how deep they lie.
    fn flat(&self, floors: &[Floor; 2]) -> Panel {
        let heights = floors.each_ref().map(|floor| 1e3 * floor.roughness.height_mm);
        let (low, high) = (heights[0].min(heights[1]).min(0.0), heights[0].max(heights[1]).max(0.0));
        let y = Axis::new("above the commanded end of the tool", UM, padded(low, high, 0.3));
        let mut panel =
            Panel::new("profile along the middle of the track: both floors are flat", self.along(floors), y);
        panel.note(
            "every edge protrudes alike, and none marks the floor: what measured edges leave is seen where the tool has \
             their set-overs",
        );
        self.add_profiles(&mut panel, floors, |floor| 1e3 * floor.roughness.height_mm);
        panel
    }

    fn along(&self, floors: &[Floor; 2]) -> Axis {
        let field = &floors[0].field;
        Axis::new("along the feed", MM, 0.0..field.columns as f64 * field.resolution_mm)
    }

    fn profiles(&self, floors: &[Floor; 2], range: &Range<f64>) -> Panel {
        let y = Axis::new("above the mean", UM, padded(range.start, range.end, 0.15));
        let mut panel = Panel::new("profile along the middle of the track", self.along(floors), y);
        if let Some(reason) = self.why_rougher(floors) {
            panel.note(reason);
        }
        self.add_profiles(&mut panel, floors, |_| 0.0);
        panel
    }

    /// Why the oscillation leaves the rougher floor, where it does.
    fn why_rougher(&self, floors: &[Floor; 2]) -> Option<String> {
        let [with, without] = floors.each_ref().map(|floor| floor.roughness.peak_to_valley_mm);
        if with <= ROUGHER * without {
            return None;
        }
        let edges = &self.pass.tool.edges;
        let finishing = &self.pass.section.report.finishing_edges;
        let stands_out = |edge: &u32| edges.get(*edge as usize - 1).map_or(0.0, |edge| edge.axial_set_over_mm);
        let finisher = finishing.iter().copied().max_by(|a, b| stands_out(a).total_cmp(&stands_out(b)));
        let farthest = (1..=edges.len() as u32).max_by(|a, b| stands_out(a).total_cmp(&stands_out(b)));
        let start = "the oscillation leaves the rougher floor here";
        Some(match (finisher, farthest) {
            (Some(finisher), Some(farthest)) if stands_out(&farthest) > stands_out(&finisher) => format!(
                "{start}: E{finisher} finishes ahead of the tool, but E{farthest} protrudes {} µm further and cuts deeper at \
                 the sides; let E{farthest} finish (word L)",
                short(1e3 * (stands_out(&farthest) - stands_out(&finisher)), 2)
            ),
            _ => format!(
                "{start}: its edges end at different heights where they pass, without it all of them level the floor"
            ),
        })
    }

    /// Profiles of both floors, above their means and `lifted`, µm.
    fn add_profiles(&self, panel: &mut Panel, floors: &[Floor; 2], lifted: impl Fn(&Floor) -> f64) {
        let inks = [Ink::line(NAMES[0], theme::VIBRATION, 2.8), Ink::dashed(NAMES[1], theme::INK, 2.2)];
        for (floor, ink) in floors.iter().zip(inks) {
            let (row, last) = (floor.field.rows / 2, floor.field.columns.saturating_sub(1));
            let steps = u32::try_from(last).unwrap_or(1).max(1);
            let profile = sampled(0.0, last as f64, steps, |column| {
                let height = floor.height_um(row..row + 1, column.round() as usize).unwrap_or(f64::NAN);
                ((column + 0.5) * floor.field.resolution_mm, height + lifted(floor))
            });
            panel.path(&ink, profile);
        }
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

fn map(floor: &Floor, name: &str, across_mm: f64, range: &Range<f64>) -> Panel {
    let Floor { field, roughness } = floor;
    let length_mm = field.columns as f64 * field.resolution_mm;
    let width_mm = field.rows as f64 * field.resolution_mm;
    let side_mm = across_mm - 0.5 * width_mm;
    let title = format!("{name}: peak to valley {} µm", short(1e3 * roughness.peak_to_valley_mm, 2));
    let x = Axis::new("along the feed", MM, 0.0..length_mm);
    let y = Axis::new("to the right of the feed", MM, side_mm..side_mm + width_mm);
    let mut panel = Panel::new(title, x, y);
    panel.note(format!(
        "mean deviation {} µm, mean height {} mm",
        short(1e3 * roughness.mean_mm, 2),
        short(roughness.height_mm, 4)
    ));
    let rows = ROWS.min(field.rows);
    let mut cells: Vec<([Place; 2], RGBColor)> = Vec::new();
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
                cells.push(([(at(start), low), (at(column), high)], color(level)));
            }
            start = column;
        }
    }
    panel.cells(cells);
    panel
}
