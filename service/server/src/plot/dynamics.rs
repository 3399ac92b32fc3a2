//! Picture of the planned motion over time: feed, acceleration and jerk along the path.

use std::ops::Range;

use feedwave_cutting::SetpointBlock;
use plotters::coord::Shift;
use plotters::element::{DashedPathElement, EmptyElement, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::DrawResult;
use super::canvas::Picture;
use super::motion::MotionCurves;
use super::series::Series;
use super::theme::{self, AxisSpec, Scale, Swatch};

/// Changes of the override marked at most; more of them are a grey wall.
const MAX_MARKS: usize = 100;
/// Room that the label of a change takes, design units.
const LABEL_ROOM: f64 = 56.0;

/// Collects the motion along the path from its feed, setpoint by setpoint, in bounded memory.
#[derive(Clone, Debug)]
pub(super) struct PathDynamics {
    period_s: f64,
    feed_mm_per_min: Series,
    acceleration_m_per_s2: Series,
    jerk_m_per_s3: Series,
    /// The last two feeds, older first, m/s.
    last: [f64; 2],
    seen: u64,
    /// Times of the changes of the feed override, s, and the ratios.
    overrides: Vec<(f64, f64)>,
}

impl PathDynamics {
    pub(super) fn new(period_s: f64) -> Self {
        Self {
            period_s,
            feed_mm_per_min: Series::default(),
            acceleration_m_per_s2: Series::default(),
            jerk_m_per_s3: Series::default(),
            last: [0.0; 2],
            seen: 0,
            overrides: Vec::new(),
        }
    }

    pub(super) fn add_override(&mut self, time_s: f64, ratio: f64) {
        self.overrides.push((time_s, ratio));
    }

    /// Takes in a block of setpoints at the interpolation period.
    pub(super) fn push(&mut self, block: &SetpointBlock) {
        let h = self.period_s;
        for (&feed_mm_per_min, index) in block.feed_mm_per_min.iter().zip(block.first_index..) {
            let time_s = index as f64 * h;
            self.feed_mm_per_min.push(time_s, feed_mm_per_min);
            let speed = feed_mm_per_min / 60.0 / 1e3;
            let [older, last] = self.last;
            // A difference belongs to the middle of its setpoints.
            if self.seen >= 1 {
                self.acceleration_m_per_s2.push(time_s - 0.5 * h, (speed - last) / h);
            }
            if self.seen >= 2 {
                self.jerk_m_per_s3.push(time_s - h, (speed - 2.0 * last + older) / (h * h));
            }
            self.last = [last, speed];
            self.seen += 1;
        }
    }

    /// The changes within the program.
    fn overrides_within(&self, end_s: f64) -> &[(f64, f64)] {
        &self.overrides[..self.overrides.partition_point(|&(time_s, _)| time_s <= end_s)]
    }
}

/// Feed, acceleration and jerk along the path, one below the other.
pub(super) struct DynamicsPicture<'a> {
    pub(super) program: &'a str,
    pub(super) dynamics: &'a PathDynamics,
    /// For the stretches that vibrate.
    pub(super) curves: &'a MotionCurves,
}

impl Picture for DynamicsPicture<'_> {
    fn name(&self) -> String {
        "motion".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let dynamics = self.dynamics;
        let period_ms = dynamics.period_s * 1e3;
        let subtitle =
            format!("{} \u{b7} along the path, without vibration \u{b7} setpoints every {period_ms} ms", self.program);
        let body = theme::headline(area, scale, "Motion over time", &subtitle)?;
        let end_s = dynamics.feed_mm_per_min.points().last().map_or(0.0, |point| point.0).max(dynamics.period_s);
        let marks = dynamics.overrides_within(end_s);
        let mut entries = Vec::new();
        if !marks.is_empty() {
            entries.push((Swatch::Dashed, theme::GOOD, "the feed override changes"));
        }
        if self.curves.vibrates() {
            entries.push((Swatch::Fill, theme::VIBRATION, self.curves.doing()));
        }
        let body = if entries.is_empty() { body } else { theme::legend(&body, scale, &entries)? };

        let feed = dynamics.feed_mm_per_min.legible_extent();
        let is_cut = feed.is_some_and(|(_, is_cut)| is_cut);
        let feed_range = feed.map_or(0.0..1.0, |((_, high), _)| 0.0..(high * HEADROOM).max(1e-3));
        let note = if is_cut { "rapid moves go beyond the scale" } else { "" };
        let panels = [
            ("feed, mm/min", &dynamics.feed_mm_per_min, feed_range, theme::INK, note),
            (
                "acceleration, m/s²",
                &dynamics.acceleration_m_per_s2,
                about_zero(&dynamics.acceleration_m_per_s2),
                theme::COMMAND,
                "",
            ),
            ("jerk, m/s³", &dynamics.jerk_m_per_s3, about_zero(&dynamics.jerk_m_per_s3), theme::PALETTE[3], ""),
        ];
        let areas = body.split_evenly((panels.len(), 1));
        for (number, (area, (label, series, range, color, note))) in areas.iter().zip(panels).enumerate() {
            let x = AxisSpec::new(if number == 2 { "time, s" } else { "" }, 0.0..end_s);
            let y = AxisSpec::new(label, range);
            let mut chart = theme::panel(area, scale, note, &x, &y)?;
            self.curves.shade_vibrating(&mut chart, &y.range)?;
            // The curves on top of the marks: what happens at a change is what one wants to see.
            draw_marks(&mut chart, scale, marks, &y.range, number == 0)?;
            theme::curve(&mut chart, &series.points(), scale.stroke(color, 1.6))?;
        }
        Ok(())
    }
}

/// Changes of the feed override as upright lines; `labelled` with the percentage where there is room for it.
fn draw_marks<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    marks: &[(f64, f64)],
    y: &Range<f64>,
    labelled: bool,
) -> DrawResult<(), DB> {
    let label_style = scale.text(13.0, theme::GOOD).pos(Pos::new(HPos::Left, VPos::Top));
    let mut free_from = i32::MIN;
    for &(time_s, ratio) in marks.iter().take(MAX_MARKS) {
        let line = [(time_s, y.start), (time_s, y.end)];
        chart.draw_series([DashedPathElement::new(
            line,
            scale.px(6.0),
            scale.px(5.0),
            scale.stroke(theme::GOOD, 1.2),
        )])?;
        let (left, _) = chart.plotting_area().map_coordinate(&(time_s, y.end));
        if labelled && left >= free_from {
            free_from = left + scale.px(LABEL_ROOM);
            let text = if ratio == 0.0 { "hold".to_owned() } else { format!("{} %", (ratio * 1e4).round() / 1e2) };
            let text = Text::new(text, (scale.px(4.0), scale.px(2.0)), label_style.clone());
            chart.draw_series([EmptyElement::at((time_s, y.end)) + text])?;
        }
    }
    Ok(())
}

/// Room above the highest value.
const HEADROOM: f64 = 1.15;

/// A range with zero in its middle.
fn about_zero(series: &Series) -> Range<f64> {
    let largest = series.extent().map_or(0.0, |(low, high)| high.max(-low));
    let largest = (largest * HEADROOM).max(1e-3);
    -largest..largest
}
