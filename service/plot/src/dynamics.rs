//! Picture of the planned motion over time: the feed along the path, acceleration and jerk of the axes against their limits.

use std::ops::Range;

use feedwave_cutting::SetpointBlock;

use super::AxisShown;
use super::figure::{
    Axis, Beside, Figure, Layout, M_PER_S2, M_PER_S3, MM_PER_MIN, PERCENT, Panel, SECONDS, Unit, number,
};
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

/// Collects the motion along the path from its feed, setpoint by setpoint, in bounded memory.
#[derive(Clone, Debug)]
pub(super) struct PathDynamics {
    period_s: f64,
    feed_mm_per_min: Series,
    acceleration_m_per_s2: Series,
    jerk_m_per_s3: Series,
    axes: Vec<AxisUse>,
    /// The last two feeds, older first, m/s.
    last: [f64; 2],
    seen: u64,
    /// Times of the changes of the feed override, s, and the ratios.
    overrides: Vec<(f64, f64)>,
}

/// What an axis is asked for by its setpoints, in per cent of its limits.
#[derive(Clone, Debug)]
struct AxisUse {
    axis: AxisShown,
    /// The last three positions, older first.
    last: [f64; 3],
    acceleration: Series,
    jerk: Series,
}

impl AxisUse {
    fn new(axis: &AxisShown) -> Self {
        Self { axis: axis.clone(), last: [0.0; 3], acceleration: Series::default(), jerk: Series::default() }
    }

    /// Takes in a position behind so many others.
    fn push(&mut self, position: f64, seen: u64, time_s: f64, h: f64) {
        let [a, b, c] = self.last;
        // A difference belongs to the middle of its setpoints.
        if seen >= 2 {
            let acceleration = ((position - c) - (c - b)) / (h * h);
            self.acceleration.push(time_s - h, 100.0 * acceleration / self.axis.max_acceleration_per_s2);
        }
        if seen >= 3 {
            let jerk = ((position - a) - 3.0 * (c - b)) / (h * h * h);
            self.jerk.push(time_s - 1.5 * h, 100.0 * jerk / self.axis.max_jerk_per_s3);
        }
        self.last = [b, c, position];
    }
}

impl PathDynamics {
    pub(super) fn new(axes: &[AxisShown], period_s: f64) -> Self {
        Self {
            period_s,
            feed_mm_per_min: Series::default(),
            acceleration_m_per_s2: Series::default(),
            jerk_m_per_s3: Series::default(),
            axes: axes.iter().map(AxisUse::new).collect(),
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
            for (axis, positions) in self.axes.iter_mut().zip(&block.axes) {
                axis.push(positions[row], self.seen, time_s, h);
            }
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
            if self.curves.is_superposed() { " \u{b7} the feed is without what is superposed" } else { "" };
        let used = if self.axes_are_the_machines {
            " \u{b7} acceleration and jerk of each axis by its setpoints, in per cent of its limit"
        } else {
            ""
        };
        let subtitle = format!(
            "{} \u{b7} as commanded{superposed}{used} \u{b7} setpoints every {} ms",
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
        note_limits(&mut panel, &limits(self.axes, |axis| 60.0 * axis.max_velocity_per_s), MM_PER_MIN);
        let mut panels = vec![panel];
        for (name, unit, series, color) in [
            ("acceleration", M_PER_S2, &dynamics.acceleration_m_per_s2, theme::COMMAND),
            ("jerk", M_PER_S3, &dynamics.jerk_m_per_s3, theme::PALETTE[3]),
        ] {
            if self.axes_are_the_machines {
                panels.push(self.used(name, unit, end_s));
                continue;
            }
            let largest = series.extent().map_or(0.0, |(low, high)| high.max(-low));
            let largest = (HEADROOM * largest).max(1e-3);
            let mut panel = self.panel(name, unit, -largest..largest, end_s);
            self.mark_overrides(&mut panel, end_s, false);
            panel.path(&Ink::line(format!("{name} along the path"), color, 2.0), series.points());
            panels.push(panel);
        }
        panels.iter_mut().rev().skip(1).for_each(|panel| panel.x.labelled = false);
        Figure::new("motion", "Motion over time", subtitle, Layout::column(panels))
    }

    /// What the axes are asked for, in per cent of their limits, which hold for each axis and not along the path.
    fn used(&self, name: &str, unit: Unit, end_s: f64) -> Panel {
        type Of = (fn(&AxisUse) -> &Series, fn(&AxisShown) -> f64);
        let (series, limit): Of = match name {
            "jerk" => (|axis| &axis.jerk, |axis| 1e-3 * axis.max_jerk_per_s3),
            _ => (|axis| &axis.acceleration, |axis| 1e-3 * axis.max_acceleration_per_s2),
        };
        let axes = &self.dynamics.axes;
        let largest = |(low, high): (f64, f64)| high.max(-low);
        let largest = axes.iter().filter_map(|axis| series(axis).extent().map(largest)).fold(0.0, f64::max);
        let largest = (HEADROOM * largest).max(100.0 * LABELLED_HEADROOM);
        let mut panel = self.panel(&format!("{name} / limit"), PERCENT, -largest..largest, end_s);
        self.mark_overrides(&mut panel, end_s, false);
        for (index, axis) in axes.iter().enumerate() {
            let color = theme::PALETTE[index % theme::PALETTE.len()];
            panel.path(&Ink::line(axis.axis.name.clone(), color, 2.0), series(axis).points());
        }
        both_limits(&mut panel, &Ink::limit("limit of the axis"), &[(100.0, "the axis".to_owned())]);
        note_limits(&mut panel, &limits(self.axes, limit), unit);
        panel
    }

    fn panel(&self, label: &str, unit: Unit, range: Range<f64>, end_s: f64) -> Panel {
        let mut panel = Panel::new("", Axis::new("time", SECONDS, 0.0..end_s), Axis::new(label, unit, range));
        self.curves.shade_vibrating(&mut panel);
        panel
    }

    /// Changes of the feed override as upright lines; `labelled` with the percentage where there is space for it.
    fn mark_overrides(&self, panel: &mut Panel, end_s: f64, labelled: bool) {
        let ink = Ink::dashed("the feed override changes", theme::MUTED, 1.6);
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

/// Says the limits of the linear axes.
fn note_limits(panel: &mut Panel, limits: &[(f64, String)], unit: Unit) {
    let each = limits.iter().map(|(value, axes)| format!("{axes} {} {}", number(*value, *value), unit.symbol));
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
