//! Pictures over time: the position with its vibration, the feed and the axis velocities.

use std::ops::Range;

use feedwave_cutting::SetpointBlock;
use plotters::coord::Shift;
use plotters::element::Rectangle;
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::{Color, RGBColor};

use super::DrawResult;
use super::canvas::Picture;
use super::series::Series;
use super::theme::{self, AxisSpec, Scale, Swatch};
use crate::output::AxisColumn;

/// Samples kept of each window at most; the windows are a few vibration periods long.
const MAX_WINDOW_SAMPLES: usize = 20_000;
/// Vibrating stretches marked at most.
const MAX_SPANS: usize = 500;
/// Vibrating setpoints nearer to each other than this belong to the same stretch (the wave passes through zero), s.
const SPAN_GAP_S: f64 = 0.1;

/// A short stretch of time in which every setpoint is kept.
#[derive(Clone, Debug)]
struct Window {
    title: String,
    time_s: Range<f64>,
    command: Vec<(f64, f64)>,
    vibrating: Vec<(f64, f64)>,
}

impl Window {
    fn new(title: impl Into<String>, time_s: Range<f64>) -> Self {
        Self { title: title.into(), time_s, command: Vec::new(), vibrating: Vec::new() }
    }

    fn push(&mut self, time_s: f64, path_position_mm: f64, vibration_offset_mm: f64) {
        if self.time_s.contains(&time_s) && self.command.len() < MAX_WINDOW_SAMPLES {
            self.command.push((time_s, path_position_mm));
            self.vibrating.push((time_s, path_position_mm + vibration_offset_mm));
        }
    }
}

/// Collects the curves over time, setpoint by setpoint, in bounded memory.
#[derive(Clone, Debug)]
pub(super) struct MotionCurves {
    position: Series,
    feed: Series,
    velocities: Vec<AxisCurve>,
    windows: Vec<Window>,
    /// Times in which the tool vibrates.
    vibrating_spans: Vec<(f64, f64)>,
    /// Whether what is superposed is a tool oscillation.
    oscillates: bool,
    period_s: f64,
    previous: Option<Vec<f64>>,
}

#[derive(Clone, Debug)]
struct AxisCurve {
    name: String,
    rotary: bool,
    velocity: Series,
}

impl MotionCurves {
    /// Curves of these axes.
    pub(super) fn new(axes: &[AxisColumn], period_s: f64) -> Self {
        let curve =
            |axis: &AxisColumn| AxisCurve { name: axis.name.clone(), rotary: axis.rotary, velocity: Series::default() };
        Self {
            position: Series::default(),
            feed: Series::default(),
            velocities: axes.iter().map(curve).collect(),
            windows: Vec::new(),
            vibrating_spans: Vec::new(),
            oscillates: false,
            period_s,
            previous: None,
        }
    }

    /// Keeps every setpoint of a short stretch of time for a picture of its own.
    pub(super) fn add_window(&mut self, title: impl Into<String>, time_s: Range<f64>) {
        self.windows.push(Window::new(title, time_s));
    }

    /// Takes in a block of setpoints.
    #[allow(clippy::cast_precision_loss, reason = "indices stay far below 2^53")]
    pub(super) fn push(&mut self, block: &SetpointBlock) {
        for row in 0..block.len() {
            let time_s = (block.first_index + row as u64) as f64 * self.period_s;
            let (position_mm, offset_mm) = (block.path_position_mm[row], block.vibration_offset_mm[row]);
            self.position.push(time_s, position_mm);
            self.feed.push(time_s, block.feed_mm_per_min[row]);
            for window in &mut self.windows {
                window.push(time_s, position_mm, offset_mm);
            }
            if offset_mm != 0.0 {
                self.mark_vibrating(time_s);
            }
            let previous = self.previous.get_or_insert_with(|| block.axes.iter().map(|axis| axis[row]).collect());
            for ((curve, axis), previous) in self.velocities.iter_mut().zip(&block.axes).zip(previous) {
                curve.velocity.push(time_s, (axis[row] - *previous) / self.period_s * 60.0);
                *previous = axis[row];
            }
        }
    }

    fn mark_vibrating(&mut self, time_s: f64) {
        let full = self.vibrating_spans.len() == MAX_SPANS;
        match self.vibrating_spans.last_mut() {
            // When the spans run out, the last one grows: the picture could not show them apart anyway.
            Some(last) if full || time_s - last.1 <= SPAN_GAP_S => last.1 = time_s,
            _ => self.vibrating_spans.push((time_s, time_s)),
        }
    }

    fn duration_s(&self) -> f64 {
        self.position.points().last().map_or(0.0, |point| point.0)
    }

    /// Whether the tool vibrates at any time.
    pub(super) fn vibrates(&self) -> bool {
        !self.vibrating_spans.is_empty()
    }

    /// Says that what is superposed is a tool oscillation.
    pub(super) const fn oscillate(&mut self) {
        self.oscillates = true;
    }

    /// What the tool does in the coloured times.
    pub(super) const fn doing(&self) -> &'static str {
        if self.oscillates { "oscillating" } else { "vibrating" }
    }

    /// Colours the times in which the tool vibrates.
    pub(super) fn shade_vibrating<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        y: &Range<f64>,
    ) -> DrawResult<(), DB> {
        let fill = theme::VIBRATION.mix(0.13).filled();
        let spans = self.vibrating_spans.iter();
        chart.draw_series(spans.map(|span| Rectangle::new([(span.0, y.start), (span.1, y.end)], fill)))?;
        Ok(())
    }
}

/// Path position over time, the whole program above and a few vibration periods below.
pub(super) struct PositionPicture<'a> {
    pub(super) program: &'a str,
    pub(super) curves: &'a MotionCurves,
}

impl Picture for PositionPicture<'_> {
    fn name(&self) -> String {
        "position".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let curves = self.curves;
        let subtitle = format!("{} \u{b7} setpoints every {} ms", self.program, curves.period_s * 1e3);
        let body = theme::headline(area, scale, "Position over time", &subtitle)?;
        let windows: Vec<_> = curves.windows.iter().filter(|window| window.command.len() > 1).collect();
        let mut entries = vec![(Swatch::Line, theme::COMMAND, "commanded path position")];
        if !windows.is_empty() {
            let label = if curves.oscillates { "with oscillation along the feed" } else { "with vibration" };
            entries.push((Swatch::Line, theme::VIBRATION, label));
        }
        if curves.vibrates() {
            entries.push((Swatch::Fill, theme::VIBRATION, curves.doing()));
        }
        let body = theme::legend(&body, scale, &entries)?;
        let height = body.dim_in_pixel().1;
        let (whole, zoomed) = if windows.is_empty() { (body, None) } else { split(&body, height * 45 / 100) };

        let y = range_of(curves.position.extent(), 0.05);
        let x = AxisSpec::new("time, s", 0.0..curves.duration_s().max(curves.period_s));
        let mut chart =
            theme::panel(&whole, scale, "the whole program", &x, &AxisSpec::new("path position, mm", y.clone()))?;
        curves.shade_vibrating(&mut chart, &y)?;
        theme::curve(&mut chart, &curves.position.points(), scale.stroke(theme::COMMAND, 2.0))?;
        if let Some(zoomed) = zoomed {
            for (area, window) in zoomed.split_evenly((1, windows.len())).iter().zip(windows) {
                draw_window(area, scale, window)?;
            }
        }
        Ok(())
    }
}

type Area<DB> = DrawingArea<DB, Shift>;

fn split<DB: DrawingBackend>(area: &Area<DB>, upper_px: u32) -> (Area<DB>, Option<Area<DB>>) {
    let (upper, lower) = area.split_vertically(upper_px);
    (upper, Some(lower))
}

fn draw_window<DB: DrawingBackend>(area: &Area<DB>, scale: Scale, window: &Window) -> DrawResult<(), DB> {
    let extent = |points: &[(f64, f64)]| {
        points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| (low.min(point.1), high.max(point.1)))
    };
    let (a, b) = (extent(&window.command), extent(&window.vibrating));
    let y = theme::padded(a.0.min(b.0), a.1.max(b.1), 0.08);
    let x = AxisSpec::new("time, s", window.time_s.clone());
    let mut chart = theme::panel(area, scale, &window.title, &x, &AxisSpec::new("path position, mm", y))?;
    theme::curve(&mut chart, &window.vibrating, scale.stroke(theme::VIBRATION, 2.5))?;
    theme::curve(&mut chart, &window.command, scale.stroke(theme::COMMAND, 1.8))?;
    Ok(())
}

/// Feed along the path and axis velocities over time.
pub(super) struct FeedPicture<'a> {
    pub(super) program: &'a str,
    pub(super) curves: &'a MotionCurves,
}

impl Picture for FeedPicture<'_> {
    fn name(&self) -> String {
        "feed".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let curves = self.curves;
        let body = theme::headline(area, scale, "Feed and axis velocities", self.program)?;
        let colors = theme::PALETTE.into_iter().cycle();
        let (rotary, linear): (Vec<_>, Vec<_>) =
            curves.velocities.iter().zip(colors).partition(|(axis, _)| axis.rotary);
        let panels = 1 + usize::from(!linear.is_empty()) + usize::from(!rotary.is_empty());
        let areas = body.split_evenly((panels, 1));

        let feed = [(&curves.feed, theme::INK, "commanded feed along the path")];
        self.draw_panel(&areas[0], scale, "feed, mm/min", &feed)?;
        let groups = [(linear, "axis velocity, mm/min"), (rotary, "axis velocity, degrees/min")];
        let groups = groups.into_iter().filter(|(group, _)| !group.is_empty());
        for (area, (group, label)) in areas[1..].iter().zip(groups) {
            let group: Vec<_> =
                group.iter().map(|(axis, color)| (&axis.velocity, *color, axis.name.as_str())).collect();
            self.draw_panel(area, scale, label, &group)?;
        }
        Ok(())
    }
}

impl FeedPicture<'_> {
    fn draw_panel<DB: DrawingBackend>(
        &self,
        area: &Area<DB>,
        scale: Scale,
        label: &str,
        group: &[(&Series, RGBColor, &str)],
    ) -> DrawResult<(), DB> {
        let curves = self.curves;
        let mut entries: Vec<_> = group.iter().map(|(_, color, name)| (Swatch::Line, *color, *name)).collect();
        if curves.vibrates() {
            entries.push((Swatch::Fill, theme::VIBRATION, curves.doing()));
        }
        let area = theme::legend(area, scale, &entries)?;
        let extents: Vec<_> = group.iter().filter_map(|(series, _, _)| series.legible_extent()).collect();
        let joined = extents.iter().map(|extent| extent.0).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let cut = extents.iter().any(|extent| extent.1);
        let title = if cut { "rapid moves go beyond the scale" } else { "" };
        let x = AxisSpec::new("time, s", 0.0..curves.duration_s().max(curves.period_s));
        let y = AxisSpec::new(label, range_of(joined, 0.08));
        let mut chart = theme::panel(&area, scale, title, &x, &y)?;
        curves.shade_vibrating(&mut chart, &y.range)?;
        for (series, color, _) in group {
            theme::curve(&mut chart, &series.points(), scale.stroke(*color, 1.6))?;
        }
        Ok(())
    }
}

fn range_of(extent: Option<(f64, f64)>, share: f64) -> Range<f64> {
    extent.map_or(0.0..1.0, |(low, high)| theme::padded(low, high, share))
}
