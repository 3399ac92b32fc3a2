//! Picture of the planned motion over time: feed, acceleration and jerk along the path.

use std::ops::Range;

use feedwave_cutting::SetpointBlock;

use super::AxisShown;
use super::figure::{Axis, Beside, Figure, Layout, M_PER_S2, M_PER_S3, MM_PER_MIN, Panel, SECONDS, Unit};
use super::motion::MotionCurves;
use super::rapids::RapidLines;
use super::series::Series;
use super::theme::{self, Ink};

/// Changes of the override marked at most; more of them are a grey wall.
const MAX_MARKS: usize = 100;
/// Share of the panel that the label of a change takes.
const LABEL_SPACE: f64 = 0.055;
/// Space above the highest value.
const HEADROOM: f64 = 1.15;
/// The same where a limit is named above its line, as a share of the whole range on both sides of zero.
const LABELLED_HEADROOM: f64 = 1.35;
/// A limit up to this many times as large as what is drawn is drawn, too.
const NEAR_LIMIT: f64 = 2.5;
/// Ways below this, mm or degrees, say nothing of a direction: positions are rounded.
const LEAST_WAY: f64 = 1e-6;

/// Collects the motion along the path from its feed, setpoint by setpoint, in bounded memory.
#[derive(Clone, Debug)]
pub(super) struct PathDynamics {
    period_s: f64,
    feed_mm_per_min: Series,
    acceleration_m_per_s2: Series,
    jerk_m_per_s3: Series,
    limits: PathLimits,
    /// The last two feeds, older first, m/s.
    last: [f64; 2],
    seen: u64,
    /// Times of the changes of the feed override, s, and the ratios.
    overrides: Vec<(f64, f64)>,
}

/// What the axes permit along the path in its direction: where the first of them is at its own limit.
#[derive(Clone, Debug)]
struct PathLimits {
    axes: Vec<AxisShown>,
    /// The last positions of the axes, and the place on the path.
    last: Option<(Vec<f64>, f64)>,
    feed_mm_per_min: Series,
    acceleration_m_per_s2: Series,
    jerk_m_per_s3: Series,
}

impl PathLimits {
    fn new(axes: &[AxisShown]) -> Self {
        let [feed_mm_per_min, acceleration_m_per_s2, jerk_m_per_s3] = [(); 3].map(|()| Series::default());
        Self { axes: axes.to_vec(), last: None, feed_mm_per_min, acceleration_m_per_s2, jerk_m_per_s3 }
    }

    /// Takes in a setpoint: the direction is that from the one before.
    fn push(&mut self, block: &SetpointBlock, row: usize, time_s: f64) {
        let place = block.path_position_mm[row] + block.vibration_offset_mm[row];
        let here: Vec<f64> = block.axes.iter().map(|axis| axis[row]).collect();
        let Some((before, place_before)) = self.last.replace((here, place)) else { return };
        let way = (place - place_before).abs();
        let Some((here, _)) = self.last.as_ref().filter(|_| way > LEAST_WAY) else { return };
        let along = |limit: fn(&AxisShown) -> f64| {
            let axes = self.axes.iter().zip(here.iter().zip(&before));
            let permitted = axes.map(|(axis, (here, before))| limit(axis) * way / (here - before).abs());
            permitted.fold(f64::INFINITY, f64::min)
        };
        let [velocity, acceleration, jerk] = [
            along(|axis| axis.max_velocity_per_s),
            along(|axis| axis.max_acceleration_per_s2),
            along(|axis| axis.max_jerk_per_s3),
        ];
        if velocity.is_finite() {
            self.feed_mm_per_min.push(time_s, 60.0 * velocity);
            self.acceleration_m_per_s2.push(time_s, 1e-3 * acceleration);
            self.jerk_m_per_s3.push(time_s, 1e-3 * jerk);
        }
    }
}

impl PathDynamics {
    pub(super) fn new(axes: &[AxisShown], period_s: f64) -> Self {
        Self {
            period_s,
            feed_mm_per_min: Series::default(),
            acceleration_m_per_s2: Series::default(),
            jerk_m_per_s3: Series::default(),
            limits: PathLimits::new(axes),
            last: [0.0; 2],
            seen: 0,
            overrides: Vec::new(),
        }
    }

    pub(super) fn add_override(&mut self, time_s: f64, ratio: f64) {
        self.overrides.push((time_s, ratio));
    }

    /// Takes in a block of setpoints at the interpolation period.
    pub(super) fn push(&mut self, block: &SetpointBlock, rapids: &RapidLines) {
        let h = self.period_s;
        for row in 0..block.len() {
            let (feed_mm_per_min, line) = (block.feed_mm_per_min[row], block.line[row]);
            let time_s = (block.first_index + row as u64) as f64 * h;
            // The direction from one setpoint to the next belongs to the middle of both.
            self.limits.push(block, row, time_s - 0.5 * h);
            if rapids.contains(line, feed_mm_per_min) {
                self.feed_mm_per_min.push(time_s, feed_mm_per_min);
            } else {
                self.feed_mm_per_min.push_cut(time_s, feed_mm_per_min);
            }
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
    pub(super) axes: &'a [AxisShown],
    /// Whether the setpoints are those of the axes, not of the work.
    pub(super) axes_are_the_machines: bool,
}

impl DynamicsPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let dynamics = self.dynamics;
        let superposed =
            if self.curves.is_superposed() { "these curves are without what is superposed \u{b7} " } else { "" };
        let limited = if self.axes_are_the_machines {
            " \u{b7} limit along the path: where the first axis is at its own in the direction of the path"
        } else {
            ""
        };
        let subtitle = format!(
            "{} \u{b7} as commanded along the path \u{b7} {superposed}setpoints every {} ms{limited}",
            self.program,
            dynamics.period_s * 1e3
        );
        let end_s = dynamics.feed_mm_per_min.points().last().map_or(0.0, |point| point.0).max(dynamics.period_s);
        let feed = &dynamics.feed_mm_per_min;
        let high = feed.legible_extent().map_or(0.0, |extent| extent.1);
        let mut panel = self.panel("feed", MM_PER_MIN, 0.0..(high * HEADROOM).max(1e-3), end_s);
        self.mark_overrides(&mut panel, end_s, true);
        let ink = Ink::line("feed along the path", theme::INK, 2.0);
        panel.path_beyond(&ink, feed.points(), "rapid moves");
        self.limit(&mut panel, &dynamics.limits.feed_mm_per_min, false);
        note_limits(&mut panel, &limits(self.axes, |axis| 60.0 * axis.max_velocity_per_s));
        let mut panels = vec![panel];
        let acceleration = limits(self.axes, |axis| 1e-3 * axis.max_acceleration_per_s2);
        let jerk = limits(self.axes, |axis| 1e-3 * axis.max_jerk_per_s3);
        for (name, unit, series, limit, limits, color) in [
            (
                "acceleration",
                M_PER_S2,
                &dynamics.acceleration_m_per_s2,
                &dynamics.limits.acceleration_m_per_s2,
                acceleration,
                theme::COMMAND,
            ),
            ("jerk", M_PER_S3, &dynamics.jerk_m_per_s3, &dynamics.limits.jerk_m_per_s3, jerk, theme::PALETTE[3]),
        ] {
            let mut panel = self.panel(name, unit, about_zero(series, self.drawn(limit)), end_s);
            self.mark_overrides(&mut panel, end_s, false);
            panel.path(&Ink::line(format!("{name} along the path"), color, 2.0), series.points());
            self.limit(&mut panel, limit, true);
            note_limits(&mut panel, &limits);
            panels.push(panel);
        }
        panels.iter_mut().rev().skip(1).for_each(|panel| panel.x.labelled = false);
        Figure::new("motion", "Motion over time", subtitle, Layout::column(panels))
    }

    /// The limit along the path, where the picture has one.
    fn drawn<'b>(&self, limit: &'b Series) -> Option<&'b Series> {
        Some(limit).filter(|_| self.axes_are_the_machines)
    }

    /// Draws the limit along the path, `mirrored` below zero as well. What is superposed takes its part of it, so it is left out there.
    fn limit(&self, panel: &mut Panel, limit: &Series, mirrored: bool) {
        let Some(limit) = self.drawn(limit) else { return };
        let plain = |(time_s, value)| (time_s, if self.curves.vibrates_at(time_s) { f64::NAN } else { value });
        let points: Vec<_> = limit.points().into_iter().map(plain).collect();
        let ink = Ink::limit("limit along the path");
        if mirrored {
            panel.path(&ink, points.iter().map(|&(time_s, value)| (time_s, -value)).collect());
        }
        panel.path(&ink, points);
    }

    fn panel(&self, label: &str, unit: Unit, range: Range<f64>, end_s: f64) -> Panel {
        let mut panel = Panel::new("", Axis::new("time", SECONDS, 0.0..end_s), Axis::new(label, unit, range));
        self.curves.shade_vibrating(&mut panel);
        panel
    }

    /// Changes of the feed override as upright lines; `labelled` with the percentage where there is space for it.
    fn mark_overrides(&self, panel: &mut Panel, end_s: f64, labelled: bool) {
        let ink = Ink::dashed("the feed override changes", theme::GOOD, 1.6);
        let mut free_from_s = f64::NEG_INFINITY;
        for &(time_s, ratio) in self.dynamics.overrides_within(end_s).iter().take(MAX_MARKS) {
            panel.upright(&ink, time_s);
            if labelled && time_s >= free_from_s {
                free_from_s = time_s + LABEL_SPACE * end_s;
                let text = if ratio == 0.0 { "hold".to_owned() } else { format!("{} %", (ratio * 1e4).round() / 1e2) };
                panel.label((time_s, panel.y.range.end), text, theme::INK, Beside::INSIDE_TOP);
            }
        }
    }
}

/// Distinct limits of the linear axes with the letters of those that have them.
fn limits(axes: &[AxisShown], of: impl Fn(&AxisShown) -> f64) -> Vec<(f64, String)> {
    let mut limits: Vec<(f64, String)> = Vec::new();
    for axis in axes.iter().filter(|axis| !axis.rotary) {
        let value = of(axis);
        match limits.iter_mut().find(|(known, _)| *known == value) {
            Some((_, names)) => *names = format!("{names}, {}", axis.name),
            None => limits.push((value, axis.name.clone())),
        }
    }
    limits
}

/// Says the limits of the axes.
fn note_limits(panel: &mut Panel, limits: &[(f64, String)]) {
    let each = limits.iter().map(|(value, axes)| format!("{axes} {}", panel.y.value(*value)));
    let each = each.collect::<Vec<_>>().join(", ");
    if !each.is_empty() {
        panel.note(format!("limits of the axes: {each}"));
    }
}

/// Draws limits of both signs; named once.
pub(super) fn both_limits(panel: &mut Panel, ink: &Ink, limits: &[(f64, String)]) {
    for (value, axes) in limits {
        let what = format!("limit of {axes}");
        let y = panel.y.range.clone();
        match [y.contains(value), y.contains(&-value)] {
            [false, true] => panel.limit(ink, -value, &what),
            [_, false] => panel.limit(ink, *value, &what),
            [true, true] => {
                panel.limit(ink, *value, &what);
                panel.endless(ink, vec![(panel.x.range.start, -value), (panel.x.range.end, -value)]);
            }
        }
    }
}

/// A range widened to the limits of either sign that are near.
pub(super) fn with_limits(range: &Range<f64>, limits: &[(f64, String)]) -> Range<f64> {
    let near =
        |largest: f64| limits.iter().map(move |limit| limit.0).filter(move |limit| *limit <= NEAR_LIMIT * largest);
    let low = near(-range.start).map(|limit| -LABELLED_HEADROOM * limit).fold(range.start, f64::min);
    let high = near(range.end).map(|limit| LABELLED_HEADROOM * limit).fold(range.end, f64::max);
    low..high
}

/// A range with zero in its middle, with the limit where it is near.
fn about_zero(series: &Series, limit: Option<&Series>) -> Range<f64> {
    let largest = series.extent().map_or(0.0, |(low, high)| high.max(-low));
    let highest = limit.and_then(Series::extent).map_or(0.0, |extent| extent.1);
    let near = if highest <= NEAR_LIMIT * largest { highest } else { 0.0 };
    let largest = (HEADROOM * largest.max(near)).max(1e-3);
    -largest..largest
}
