//! Stability lobes over the spindle speed: how deep the cut may be, with the speeds of the spindle table, and below at which
//! frequency it chatters beyond.

use std::path::{Path, PathBuf};

use feedwave_contract::proto::StabilityLobes;

use plotters::style::text_anchor::HPos;

use super::canvas::{self, PlotError};
use super::figure::{Axis, Beside, Figure, HERTZ, Layout, MM, Panel, Place, REV_PER_MIN, extent, padded};
use super::theme::{self, Ink};

/// Space above the deepest speed of the table.
const HEADROOM: f64 = 1.3;
/// What is drawn at least, as a multiple of the limit below which nothing chatters.
const LEAST_LIMITS: f64 = 2.5;

/// Design units that the speeds take at least in the picture's width.
const LEAST_PANEL_WIDTH: f64 = 1_200.0;
/// Between a line and its text, design units.
const LABEL_GAP: f64 = 6.0;
/// Height of a row of texts, design units.
const LABEL_ROW: f64 = 19.0;
/// Rows of texts above each other.
const LABEL_ROWS: usize = 4;

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
    canvas::make(directory)?;
    canvas::write(&picture.figure(), directory)
}

/// Speed and stable depth of a row of the table, and where its band ends.
struct Mark {
    spindle_rev_per_min: f64,
    up_to_rev_per_min: f64,
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
                Some(Mark {
                    spindle_rev_per_min: band.spindle_rev_per_min,
                    up_to_rev_per_min: band.up_to_rev_per_min,
                    stable_mm: pocket.stable_mm,
                })
            })
            .collect()
    }

    /// Top of the picture, mm: the speeds of the table can be seen, peaks beyond are cut.
    fn top_mm(&self) -> f64 {
        let deepest = self.lobes.pockets.iter().filter_map(|pocket| pocket.stable_mm).fold(0.0, f64::max);
        let least = self.lobes.least_limit_mm.unwrap_or_default();
        (HEADROOM * deepest / (1.0 - self.margin())).max(LEAST_LIMITS * least).max(1e-6)
    }

    /// The limit over the speed, times `share`; `unlimited` where nothing chatters.
    fn curve(&self, share: f64, unlimited: f64) -> Vec<Place> {
        let chart = self.lobes.chart.iter();
        chart
            .map(|point| (point.spindle_rev_per_min, point.limit_mm.map_or(unlimited, |limit| share * limit)))
            .collect()
    }

    fn depths(&self, speeds: Axis) -> Panel {
        let top_mm = self.top_mm();
        let depth = if self.lobes.radial_immersion.is_some() { "axial depth" } else { "width of cut" };
        let range = speeds.range.clone();
        let y = Axis::new(depth, MM, 0.0..top_mm);
        let mut panel = Panel::new("limit of stability", speeds.labelled_if(false), y);
        let stable = self.curve(1.0 - self.margin(), 2.0 * top_mm);
        let name = format!("stable with the margin of {:.0} %", 100.0 * self.margin());
        let ends = [(range.end, 0.0), (range.start, 0.0)];
        panel.area(&Ink::fill(name.clone(), theme::GOOD, 0.15), stable.iter().copied().chain(ends).collect());
        panel.endless(&Ink::line(name, theme::GOOD, 1.6), stable);
        let limit = Ink::line("limit: chatter above", theme::BAD, 2.6);
        panel.path(&limit, self.curve(1.0, f64::NAN));
        let marks = self.marks();
        // The last band ends with the picture.
        let borders: Vec<f64> = marks.iter().rev().skip(1).map(|mark| mark.up_to_rev_per_min).collect();
        for border in &borders {
            panel.upright(&Ink::dashed("border of a band of speeds", theme::MUTED, 1.2), *border);
        }
        let lines = marks.iter().map(|mark| mark.spindle_rev_per_min).chain(borders).collect();
        let mut labels =
            FootLabels { lines, per_unit: (range.end - range.start) / LEAST_PANEL_WIDTH, taken: Vec::new() };
        let name = "best speed of its band, rev/min, with its depth";
        for mark in &marks {
            let depth = mark.stable_mm.unwrap_or(top_mm).min(top_mm);
            panel.endless(
                &Ink::line(name, theme::COMMAND, 2.0),
                vec![(mark.spindle_rev_per_min, 0.0), (mark.spindle_rev_per_min, depth)],
            );
            panel.dots(&Ink::dot(name, theme::COMMAND, 5.5), vec![(mark.spindle_rev_per_min, depth)]);
            let text = super::figure::short(mark.spindle_rev_per_min, 0);
            if let Some(beside) = labels.place(mark.spindle_rev_per_min, &text) {
                panel.label((mark.spindle_rev_per_min, 0.0), text, theme::INK, beside);
            }
        }
        panel
    }

    fn frequencies(&self, speeds: Axis) -> Panel {
        let points = self.lobes.chart.iter().filter(|point| point.limit_mm.is_some());
        let frequencies = extent(points.clone().map(|point| point.chatter_hz));
        let range = frequencies.map_or(0.0..1.0, |(low, high)| padded(low, high, 0.1));
        let y = Axis::new("frequency", HERTZ, range);
        let mut panel = Panel::new("frequency at which it chatters beyond the limit", speeds, y);
        // Along a branch of a lobe the frequency rises less than the speed; anything else is a jump to another one.
        let mut lines: Vec<Vec<Place>> = Vec::new();
        let mut lobe = None;
        for point in points {
            let place = (point.spindle_rev_per_min, point.chatter_hz);
            let goes_on = lobe.replace(point.lobe) == Some(point.lobe);
            match lines.last_mut() {
                Some(line) if goes_on && line.last().is_some_and(|last| continues(*last, place)) => line.push(place),
                _ => lines.push(vec![place]),
            }
        }
        let ink = Ink::line("frequency of the chatter, one line for each branch of a lobe", theme::VIBRATION, 2.4);
        for line in lines.into_iter().filter(|line| line.len() > 1) {
            panel.path(&ink, line);
        }
        panel
    }

    pub(super) fn figure(&self) -> Figure {
        let speed = |point: Option<&feedwave_contract::proto::StabilityPoint>| {
            point.map_or(0.0, |point| point.spindle_rev_per_min)
        };
        let range = speed(self.lobes.chart.first())..speed(self.lobes.chart.last());
        let speeds = || Axis::new("spindle speed", REV_PER_MIN, range.clone());
        let panels = vec![self.depths(speeds()), self.frequencies(speeds())];
        Figure::new("lobes", "Stability lobes", &self.subtitle, Layout::column(panels))
    }
}

/// Places for texts at the feet of lines, where no curve passes, beside each other and beside the lines where there is room.
struct FootLabels {
    /// Lines that a text had better not cross.
    lines: Vec<f64>,
    /// Speed of a design unit, rev/min.
    per_unit: f64,
    /// Speeds that texts take in a row above the foot.
    taken: Vec<(usize, [f64; 2])>,
}

impl FootLabels {
    /// Where the text of a line goes; `None` where there is no room at all.
    fn place(&mut self, at: f64, text: &str) -> Option<Beside> {
        let (near, far) =
            (LABEL_GAP * self.per_unit, (LABEL_GAP + theme::text_width(text, theme::LABEL_SIZE)) * self.per_unit);
        let sides = [(HPos::Left, [at + near, at + far]), (HPos::Right, [at - far, at - near])];
        let places = |rows| {
            (0..rows).flat_map(move |row: usize| sides.into_iter().map(move |(side, speeds)| (row, side, speeds)))
        };
        let is_free = |place: &(usize, HPos, [f64; 2])| {
            let [from, to] = place.2;
            self.taken.iter().all(|(row, [first, last])| *row != place.0 || to < *first || *last < from)
        };
        let is_clear = |place: &(usize, HPos, [f64; 2])| {
            let [from, to] = [place.2[0].min(at), place.2[1].max(at)];
            !self.lines.iter().any(|line| *line != at && (from..=to).contains(line))
        };
        let found = places(1).find(|place| is_free(place) && is_clear(place));
        let found = found.or_else(|| places(LABEL_ROWS).find(is_free));
        let (row, x, speeds) = found?;
        self.taken.push((row, speeds));
        let right = if matches!(x, HPos::Left) { LABEL_GAP } else { -LABEL_GAP };
        Some(Beside { x, by: (right, -5.0 - LABEL_ROW * row as f64), ..Beside::INSIDE_BOTTOM })
    }
}

/// Whether two points, speed and frequency, can be neighbours on one branch.
fn continues((speed, frequency): (f64, f64), (next_speed, next_frequency): (f64, f64)) -> bool {
    let rise = next_frequency / frequency;
    (1.0 - 1e-6..1.0 + 2.0 * (next_speed / speed - 1.0)).contains(&rise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_at_feet_never_overlap_and_avoid_lines_where_they_can() {
        let lines = vec![1_000.0, 1_004.0, 1_300.0, 1_305.0, 1_310.0, 1_315.0, 1_900.0];
        let mut labels = FootLabels { lines: lines.clone(), per_unit: 1.0, taken: Vec::new() };
        let places: Vec<_> = lines.iter().map(|line| labels.place(*line, "1234").map(|it| (it.x, it.by))).collect();
        // Between both lines there is no room: one text on either side.
        assert!(matches!(places[0], Some((HPos::Right, _))) && matches!(places[1], Some((HPos::Left, _))));
        assert!(places.iter().all(Option::is_some));
        for (place, (row, speeds)) in labels.taken.iter().enumerate() {
            let overlaps =
                |(other, [first, last]): &(usize, [f64; 2])| other == row && speeds[0] <= *last && *first <= speeds[1];
            assert!(!labels.taken[..place].iter().any(overlaps), "{:?}", labels.taken);
        }
    }
}
