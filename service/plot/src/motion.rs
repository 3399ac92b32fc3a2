//! Pictures over time: the position with its vibration, the feed and the axis velocities.

use std::ops::Range;

use feedwave_cutting::SetpointBlock;

use super::AxisShown;
use super::dynamics::both_limits;
use super::figure::{Axis, DEG_PER_MIN, Figure, Layout, MM, MM_PER_MIN, Panel, SECONDS, extent, padded};
use super::rapids::RapidLines;
use super::series::Series;
use super::theme::{self, Ink};

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
    was_rapid: bool,
}

#[derive(Clone, Debug)]
struct AxisCurve {
    axis: AxisShown,
    velocity: Series,
}

impl MotionCurves {
    /// Curves of these axes.
    pub(super) fn new(axes: &[AxisShown], period_s: f64) -> Self {
        let curve = |axis: &AxisShown| AxisCurve { axis: axis.clone(), velocity: Series::default() };
        Self {
            position: Series::default(),
            feed: Series::default(),
            velocities: axes.iter().map(curve).collect(),
            windows: Vec::new(),
            vibrating_spans: Vec::new(),
            oscillates: false,
            period_s,
            previous: None,
            was_rapid: false,
        }
    }

    /// Keeps every setpoint of a short stretch of time for a picture of its own.
    pub(super) fn add_window(&mut self, title: impl Into<String>, time_s: Range<f64>) {
        self.windows.push(Window::new(title, time_s));
    }

    /// Takes in a block of setpoints.
    #[allow(clippy::cast_precision_loss, reason = "indices stay far below 2^53")]
    pub(super) fn push(&mut self, block: &SetpointBlock, rapids: &RapidLines) {
        for row in 0..block.len() {
            let time_s = (block.first_index + row as u64) as f64 * self.period_s;
            let (position_mm, offset_mm) = (block.path_position_mm[row], block.vibration_offset_mm[row]);
            self.position.push(time_s, position_mm);
            let feed_mm_per_min = block.feed_mm_per_min[row];
            let is_rapid = rapids.contains(block.line[row], feed_mm_per_min);
            let add = |is_rapid: bool| if is_rapid { Series::push } else { Series::push_cut };
            add(is_rapid)(&mut self.feed, time_s, feed_mm_per_min);
            // A velocity belongs to both its setpoints.
            let between = is_rapid || self.was_rapid;
            self.was_rapid = is_rapid;
            for window in &mut self.windows {
                window.push(time_s, position_mm, offset_mm);
            }
            if offset_mm != 0.0 {
                self.mark_vibrating(time_s);
            }
            let previous = self.previous.get_or_insert_with(|| block.axes.iter().map(|axis| axis[row]).collect());
            for ((curve, axis), previous) in self.velocities.iter_mut().zip(&block.axes).zip(previous) {
                add(between)(&mut curve.velocity, time_s, (axis[row] - *previous) / self.period_s * 60.0);
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

    /// Says that what is superposed is a tool oscillation.
    pub(super) const fn oscillate(&mut self) {
        self.oscillates = true;
    }

    /// What the tool does in the coloured times.
    pub(super) const fn doing(&self) -> &'static str {
        if self.oscillates { "oscillating" } else { "vibrating" }
    }

    /// Whether anything is superposed on the motion along the path.
    pub(super) const fn is_superposed(&self) -> bool {
        !self.vibrating_spans.is_empty()
    }

    /// Colours the times in which the tool vibrates.
    pub(super) fn shade_vibrating(&self, panel: &mut Panel) {
        panel.shade(&Ink::fill(self.doing(), theme::VIBRATION, 0.15), self.vibrating_spans.iter().copied());
    }

    fn time(&self) -> Axis {
        Axis::new("time", SECONDS, 0.0..self.duration_s().max(self.period_s))
    }
}

/// Path position over time, the whole program above and a few vibration periods below.
pub(super) struct PositionPicture<'a> {
    pub(super) program: &'a str,
    pub(super) curves: &'a MotionCurves,
}

impl PositionPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let curves = self.curves;
        let subtitle = format!(
            "{} \u{b7} path position: distance along the programmed path since its start \u{b7} setpoints every {} ms",
            self.program,
            curves.period_s * 1e3
        );
        let y = Axis::new("path position", MM.along_a_path(), range_of(curves.position.extent(), 0.05));
        let mut whole = Panel::new("the whole program", curves.time(), y);
        curves.shade_vibrating(&mut whole);
        whole.path(&commanded(), curves.position.points());
        let windows: Vec<_> = curves.windows.iter().filter(|window| window.command.len() > 1).collect();
        let body: Layout = if windows.is_empty() {
            whole.into()
        } else {
            let windows = windows.into_iter().map(|window| self.window(window)).collect();
            Layout::Column(vec![(0.45, whole.into()), (0.55, Layout::row(windows))])
        };
        Figure::new("position", "Position over time", subtitle, body)
    }

    fn window(&self, window: &Window) -> Panel {
        let values = window.command.iter().chain(&window.vibrating).map(|point| point.1);
        let range = extent(values).map_or(0.0..1.0, |(low, high)| padded(low, high, 0.08));
        let x = Axis::new("time", SECONDS, window.time_s.clone());
        let mut panel = Panel::new(&window.title, x, Axis::new("path position", MM.along_a_path(), range));
        let name = if self.curves.oscillates { "with oscillation along the feed" } else { "with vibration" };
        panel.path(&Ink::line(name, theme::VIBRATION, 2.6), window.vibrating.clone());
        panel.path(&commanded(), window.command.clone());
        panel
    }
}

fn commanded() -> Ink {
    Ink::line("commanded path position", theme::COMMAND, 2.0)
}

/// Feed along the path and axis velocities over time, each in a panel of its own: what vibrates would hide the others.
pub(super) struct FeedPicture<'a> {
    pub(super) program: &'a str,
    pub(super) curves: &'a MotionCurves,
}

/// Height of a panel and of what is around all of them, design units.
const PANEL_HEIGHT: u32 = 190;
const AROUND_HEIGHT: u32 = 150;

impl FeedPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let curves = self.curves;
        let range = |series: &Series| range_of(series.legible_extent(), 0.12);
        let panel = |label: &str, unit, series: &Series| {
            let mut panel = Panel::new("", curves.time(), Axis::new(label, unit, range(series)));
            curves.shade_vibrating(&mut panel);
            panel
        };
        let mut feed = panel("feed", MM_PER_MIN, &curves.feed);
        let ink = Ink::line("commanded feed along the path", theme::INK, 2.0);
        feed.path_beyond(&ink, curves.feed.points(), "rapid moves");
        let mut panels = vec![feed];
        for (index, AxisCurve { axis, velocity }) in curves.velocities.iter().enumerate() {
            let unit = if axis.rotary { DEG_PER_MIN } else { MM_PER_MIN };
            let mut panel = panel(&axis.name, unit, velocity);
            let color = theme::PALETTE[index % theme::PALETTE.len()];
            let ink = Ink::line(format!("velocity of {}", axis.name), color, 2.0);
            panel.path_beyond(&ink, velocity.points(), "rapid moves");
            let limit = (60.0 * axis.max_velocity_per_s, axis.name.clone());
            both_limits(&mut panel, &Ink::limit("limit of the axis"), &[limit]);
            panels.push(panel);
        }
        panels.iter_mut().rev().skip(1).for_each(|panel| panel.x.labelled = false);
        let height = AROUND_HEIGHT + PANEL_HEIGHT * u32::try_from(panels.len()).unwrap_or(1);
        let figure = Figure::new("feed", "Feed and axis velocities", self.program, Layout::column(panels));
        figure.with_height(height.max(super::figure::SIZE.1))
    }
}

fn range_of(extent: Option<(f64, f64)>, share: f64) -> Range<f64> {
    extent.map_or(0.0..1.0, |(low, high)| padded(low, high, share))
}
