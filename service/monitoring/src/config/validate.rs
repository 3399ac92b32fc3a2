//! Refuses configurations under which no valid decision could be made.

use super::{
    ContactSource, Grouping, IdleRunUp, Length, MonitoringConfig, Quality, Quantity, Sensors, SpectrumConfig, Violation,
};
use crate::rules::{Bounds, Rules, SpindleRule, SpindleTable};
use crate::spectrum::MAX_SAMPLES;

/// Most windows before an escalation.
const MAX_ESCALATION_WINDOWS: f64 = 10_000.0;
/// Most angular points: half a degree each.
const MAX_POINTS: u32 = 720;
/// Most passes of a series.
const MAX_SERIES: u32 = 10_000;
/// Longest duration of anything, s: an hour.
const MAX_SECONDS: f64 = 3600.0;
/// Most steps of the run-up.
const MAX_IDLE_STEPS: usize = 64;
/// Most rows of a spindle table.
const MAX_TABLE_ROWS: usize = 256;
/// Sizes of the spectrum.
const SPECTRUM_SAMPLES: [u32; 2] = [64, MAX_SAMPLES];
/// Largest sensor value: sums of squares stay far from overflow.
const MAX_VALUE: f64 = 1e9;
/// Highest spindle speed, rev/min.
const MAX_RPM: f64 = 1e6;

/// Collects violations, the first for each field.
struct Check(Vec<Violation>);

impl Check {
    fn refuse(&mut self, field: &str, problem: String) {
        if self.0.iter().all(|violation| violation.field != field) {
            self.0.push(Violation { field: field.to_owned(), problem });
        }
    }

    fn require(&mut self, holds: bool, field: &str, problem: impl FnOnce() -> String) {
        if !holds {
            self.refuse(field, problem());
        }
    }

    /// The value is a number in the closed interval.
    fn within(&mut self, field: &str, value: f64, least: f64, most: f64) {
        self.require(value >= least && value <= most, field, || format!("{value} is not between {least} and {most}"));
    }
}

pub(super) fn violations(config: &MonitoringConfig) -> Vec<Violation> {
    let mut check = Check(Vec::new());
    check.within("sample_rate_hz", config.sample_rate_hz, 1.0, 100_000.0);
    sensors(&mut check, config);
    match config.grouping {
        Grouping::Angle { points } => {
            check.within("grouping.angular_points", f64::from(points), 4.0, f64::from(MAX_POINTS));
        }
        Grouping::Time { samples_per_point } => {
            check.within("grouping.samples_per_point", f64::from(samples_per_point), 1.0, 100_000.0);
        }
    }
    length(&mut check, "baseline", config.baseline, config);
    length(&mut check, "window", config.window, config);
    for (field, limit) in [
        ("tool_check.max_ratio", config.tool_check.max_ratio),
        ("tool_check.max_run_out", config.tool_check.max_run_out),
    ] {
        if let Some(limit) = limit {
            check.within(field, limit, f64::MIN_POSITIVE, 1e9);
        }
    }
    let distances = [config.tool, config.work]
        .into_iter()
        .flatten()
        .all(|sensors| sensors.quantity == Quantity::Displacement && sensors.min >= 0.0);
    let relative = config.tool.is_some() && config.work.is_some();
    check.require(config.tool_check.max_ratio.is_none() || (distances && !relative), "tool_check.max_ratio", || {
        "a ratio to the largest value needs one pair of sensors that measure a distance from 0 up; \
         set tool_check.max_run_out instead"
            .to_owned()
    });
    if let Some(idle) = &config.idle_run_up {
        idle_run_up(&mut check, idle, config);
    }
    if let ContactSource::Detected { threshold, on_samples, off_samples } = config.contact {
        check.within("contact.threshold", threshold, f64::MIN_POSITIVE, 1e9);
        check.within("contact.on_samples", f64::from(on_samples), 1.0, 1e6);
        check.within("contact.off_samples", f64::from(off_samples), 1.0, 1e6);
    }
    check.within("settling_s", config.settling_s, 0.0, MAX_SECONDS);
    if let Some(spectrum) = &config.spectrum {
        self::spectrum(&mut check, spectrum, config);
    }
    quality(&mut check, &config.quality, config);
    rules(&mut check, &config.rules, config.spectrum.is_some());
    check.0
}

fn sensors(check: &mut Check, config: &MonitoringConfig) {
    check.require(config.tool.is_some() || config.work.is_some(), "tool", || {
        "neither the tool nor the work has sensors; give at least one pair".to_owned()
    });
    for (name, sensors) in [("tool", config.tool), ("work", config.work)] {
        let Some(Sensors { quantity, min, max }) = sensors else { continue };
        let field = format!("{name}.min");
        check.within(&field, min, -MAX_VALUE, MAX_VALUE);
        check.within(&format!("{name}.max"), max, -MAX_VALUE, MAX_VALUE);
        check.require(min < max, &field, || format!("the sensor's range {min}..{max} is empty"));
        if let Quantity::Strain { mm_per_strain } = quantity {
            check.require(
                mm_per_strain.is_finite() && mm_per_strain != 0.0 && mm_per_strain.abs() <= 1e9,
                &format!("{name}.mm_per_strain"),
                || format!("{mm_per_strain} mm per unit of strain does not turn strain into displacement"),
            );
        }
    }
    if let (Some(tool), Some(work)) = (config.tool, config.work) {
        let acceleration = |sensors: Sensors| sensors.quantity == Quantity::Acceleration;
        check.require(acceleration(tool) == acceleration(work), "work.quantity", || {
            "displacement and acceleration cannot be subtracted; measure the same on tool and work".to_owned()
        });
    }
}

fn length(check: &mut Check, field: &str, length: Length, config: &MonitoringConfig) {
    match length {
        Length::Seconds(seconds) => {
            check.within(field, seconds, 1e-3, MAX_SECONDS);
            let samples = seconds * config.sample_rate_hz;
            let needed = config.quality.min_valid_samples;
            check.require(samples >= f64::from(needed), field, || {
                format!("{seconds} s hold {samples} samples, quality.min_valid_samples asks for {needed}")
            });
            if let Grouping::Time { samples_per_point } = config.grouping {
                check.require(samples >= f64::from(samples_per_point), field, || {
                    format!("{seconds} s hold {samples} samples, less than one point of {samples_per_point}")
                });
            }
        }
        Length::Series(series) => {
            check.within(field, f64::from(series), 1.0, f64::from(MAX_SERIES));
            check.require(matches!(config.grouping, Grouping::Angle { .. }), field, || {
                "series of angular points need the grouping by angle; give a duration".to_owned()
            });
        }
    }
}

fn idle_run_up(check: &mut Check, idle: &IdleRunUp, config: &MonitoringConfig) {
    let speeds = &idle.spindle_rev_per_min;
    let field = "idle_run_up.spindle_rev_per_min";
    check.require(!speeds.is_empty() && speeds.len() <= MAX_IDLE_STEPS, field, || {
        format!("{} steps; between 1 and {MAX_IDLE_STEPS} are possible", speeds.len())
    });
    for &speed in speeds.iter().take(MAX_IDLE_STEPS) {
        check.within(field, speed, 1.0, MAX_RPM);
    }
    check.require(speeds.windows(2).all(|pair| pair[0] < pair[1]), field, || "the speeds do not rise".to_owned());
    check.within("idle_run_up.speed_tolerance", idle.speed_tolerance, 1e-6, 0.5);
    length(check, "idle_run_up.length", idle.length, config);
    check.within("idle_run_up.max_difference", idle.max_difference, f64::MIN_POSITIVE, 1e9);
}

fn spectrum(check: &mut Check, spectrum: &SpectrumConfig, config: &MonitoringConfig) {
    let [least, most] = SPECTRUM_SAMPLES;
    let samples = spectrum.samples;
    check.require(samples.is_power_of_two() && samples >= least && samples <= most, "spectrum.samples", || {
        format!("{samples} is not a power of two between {least} and {most}")
    });
    if let Length::Seconds(seconds) = config.window {
        let in_window = seconds * config.sample_rate_hz;
        check.require(in_window >= f64::from(samples), "spectrum.samples", || {
            format!("the window of {seconds} s holds only {in_window} samples")
        });
    }
    let nyquist_hz = config.sample_rate_hz / 2.0;
    check.require(
        spectrum.min_frequency_hz >= 0.0 && spectrum.min_frequency_hz < nyquist_hz,
        "spectrum.min_frequency_hz",
        || format!("{} Hz is not between 0 and half the sample rate, {nyquist_hz} Hz", spectrum.min_frequency_hz),
    );
    check.within("spectrum.noise_floor", spectrum.noise_floor, 0.0, 1e9);
    check.within("spectrum.harmonic_tolerance_hz", spectrum.harmonic_tolerance_hz, 1e-6, nyquist_hz);
    check.within("spectrum.edge_count", f64::from(spectrum.edges), 1.0, 1000.0);
}

fn quality(check: &mut Check, quality: &Quality, config: &MonitoringConfig) {
    if let Some(spikes) = quality.spikes {
        check.within("quality.max_step", spikes.max_step, f64::MIN_POSITIVE, 1e12);
        check.within("quality.max_step_run", f64::from(spikes.max_run), 1.0, 1000.0);
    }
    check.within("quality.min_valid_samples", f64::from(quality.min_valid_samples), 2.0, 1e9);
    check.within("quality.max_removed", quality.max_removed, 0.0, 0.5);
    check.within("quality.stuck_samples", f64::from(quality.stuck_samples), 2.0, 1e9);
    // A window without a single change must be noticed before it can be decided on.
    check.require(quality.stuck_samples <= quality.min_valid_samples, "quality.stuck_samples", || {
        format!(
            "{} is more than quality.min_valid_samples = {}: a stuck sensor could fill a window unnoticed",
            quality.stuck_samples, quality.min_valid_samples
        )
    });
    let period_s = 1.0 / config.sample_rate_hz;
    check.require(quality.max_gap_s >= period_s && quality.max_gap_s <= MAX_SECONDS, "quality.max_gap_s", || {
        format!("{} s is not between the sample period {period_s} s and {MAX_SECONDS} s", quality.max_gap_s)
    });
    check.require(
        quality.silence_s >= quality.max_gap_s && quality.silence_s <= MAX_SECONDS,
        "quality.silence_s",
        || {
            format!(
                "{} s is not between quality.max_gap_s = {} s and {MAX_SECONDS} s",
                quality.silence_s, quality.max_gap_s
            )
        },
    );
    check.within("quality.stale_s", quality.stale_s, 1e-3, MAX_SECONDS);
    check.within("quality.max_window_s", quality.max_window_s, 1e-3, MAX_SECONDS);
}

fn bounds(check: &mut Check, field: &str, bounds: Bounds) {
    let Bounds { lower, upper } = bounds;
    check.require(lower > 0.0 && lower <= 1.0 && (1.0..=10.0).contains(&upper), field, || {
        format!("{lower}..{upper} must be positive, hold 1 and end at 10 at most")
    });
}

fn rules(check: &mut Check, rules: &Rules, has_spectrum: bool) {
    check.require(rules.property == crate::Property::Deviation || has_spectrum, "rules.property", || {
        "amplitude and frequency of vibration need a spectrum; configure one".to_owned()
    });
    let feed = rules.feed;
    check.within("rules.feed.lower", feed.lower, 0.0, 1e9);
    check.within("rules.feed.upper", feed.upper, 0.0, 1e9);
    check.require(feed.lower < feed.upper, "rules.feed.lower", || {
        format!("the lower limit {} is not below the upper limit {}", feed.lower, feed.upper)
    });
    check.within("rules.feed.step", feed.step, 1e-6, 0.5);
    bounds(check, "rules.feed_bounds", rules.feed_bounds);
    bounds(check, "rules.spindle_bounds", rules.spindle_bounds);
    if let Some(escalation) = rules.escalation {
        check.within("rules.escalation.windows", f64::from(escalation.windows), 1.0, MAX_ESCALATION_WINDOWS);
    }
    match &rules.spindle {
        SpindleRule::None => {}
        SpindleRule::Turning { lower_deg, upper_deg, step, min_concentration } => {
            check.within("rules.spindle.turning.lower_deg", *lower_deg, -180.0, 180.0);
            check.within("rules.spindle.turning.upper_deg", *upper_deg, -180.0, 180.0);
            check.require(lower_deg < upper_deg, "rules.spindle.turning.lower_deg", || {
                format!("the lower limit {lower_deg}° is not below the upper limit {upper_deg}°")
            });
            check.within("rules.spindle.turning.step", *step, 1e-6, 0.5);
            check.within("rules.spindle.turning.min_concentration", *min_concentration, 1e-6, 1.0);
        }
        SpindleRule::Milling { limit, table } => {
            check.within("rules.spindle.milling.limit", *limit, f64::MIN_POSITIVE, 1e9);
            self::table(check, table);
        }
    }
}

fn table(check: &mut Check, table: &SpindleTable) {
    let rows = &table.rows;
    check.require(!rows.is_empty() && rows.len() <= MAX_TABLE_ROWS, "rules.spindle.milling.table", || {
        format!("{} rows; between 1 and {MAX_TABLE_ROWS} are possible", rows.len())
    });
    let mut end_rev_per_min = None;
    for (index, row) in rows.iter().take(MAX_TABLE_ROWS).enumerate() {
        let field = |name: &str| format!("rules.spindle.milling.table[{index}].{name}");
        check.within(&field("above_rev_per_min"), row.above_rev_per_min, 0.0, MAX_RPM);
        check.within(&field("up_to_rev_per_min"), row.up_to_rev_per_min, 0.0, MAX_RPM);
        check.within(&field("spindle_rev_per_min"), row.spindle_rev_per_min, 1.0, MAX_RPM);
        check.require(row.above_rev_per_min < row.up_to_rev_per_min, &field("up_to_rev_per_min"), || {
            format!("the band {}..{} rev/min is empty", row.above_rev_per_min, row.up_to_rev_per_min)
        });
        if let Some(end_rev_per_min) = end_rev_per_min {
            check.require(row.above_rev_per_min == end_rev_per_min, &field("above_rev_per_min"), || {
                let fault = if row.above_rev_per_min > end_rev_per_min { "leaves a gap after" } else { "overlaps" };
                format!(
                    "{} rev/min {fault} the row before, which ends at {end_rev_per_min} rev/min",
                    row.above_rev_per_min
                )
            });
        }
        end_rev_per_min = Some(row.up_to_rev_per_min);
    }
}
