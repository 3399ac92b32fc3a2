//! Impossible configurations are refused with one problem per field.

use crate::common::config;
use feedwave_monitoring::{
    Bounds, ContactSource, Grouping, IdleRunUp, Length, Monitor, MonitoringConfig, Property, Quantity, Sensors,
    SpectrumConfig, SpindlePlan, SpindleRule, SpindleTable, TableRow,
};

fn fields(change: impl FnOnce(&mut MonitoringConfig)) -> Vec<String> {
    let mut config = config();
    change(&mut config);
    let violations = Monitor::new(config).expect_err("an impossible configuration was accepted");
    violations.into_iter().map(|violation| violation.field).collect()
}

#[test]
fn the_defaults_are_possible() {
    assert_eq!(MonitoringConfig::default().violations(), []);
    assert_eq!(config().violations(), []);
}

#[test]
fn the_swapped_limits_of_the_source_are_refused_with_both_numbers() {
    let mut config = config();
    (config.rules.feed.lower, config.rules.feed.upper) = (0.01, 0.003);
    let violations = config.violations();
    assert_eq!(
        violations.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["rules.feed.lower: the lower limit 0.01 is not below the upper limit 0.003"]
    );
}

#[test]
fn table_gaps_and_overlaps_name_their_row() {
    let row = |above_rev_per_min, up_to_rev_per_min| TableRow {
        above_rev_per_min,
        up_to_rev_per_min,
        spindle_rev_per_min: 900.0,
    };
    let table = |rows: Vec<TableRow>| {
        fields(|config| config.rules.spindle = SpindleRule::Milling { limit: 0.02, table: SpindleTable { rows } })
    };
    assert_eq!(table(vec![row(0.0, 800.0), row(900.0, 1200.0)]), ["rules.spindle.milling.table[1].above_rev_per_min"]);
    assert_eq!(table(vec![row(0.0, 800.0), row(700.0, 1200.0)]), ["rules.spindle.milling.table[1].above_rev_per_min"]);
    assert_eq!(table(vec![row(800.0, 800.0)]), ["rules.spindle.milling.table[0].up_to_rev_per_min"]);
    assert_eq!(table(Vec::new()), ["rules.spindle.milling.table"]);
}

#[test]
fn impossible_windows() {
    assert_eq!(fields(|config| config.window = Length::Seconds(0.1)), ["window"]);
    assert_eq!(fields(|config| config.window = Length::Seconds(f64::NAN)), ["window"]);
    assert_eq!(fields(|config| config.window = Length::Series(0)), ["window"]);
    assert_eq!(
        fields(|config| config.grouping = Grouping::Time { samples_per_point: 10 }),
        ["baseline"],
        "series need an angle"
    );
    assert_eq!(fields(|config| config.quality.stuck_samples = 251), ["quality.stuck_samples"]);
}

#[test]
fn everything_wrong_is_said_at_once() {
    let found = fields(|config| {
        config.sample_rate_hz = f64::INFINITY;
        config.settling_s = -1.0;
        config.rules.feed.step = 0.0;
        config.rules.feed_bounds = Bounds { lower: 1.2, upper: 1.1 };
        config.rules.spindle =
            SpindleRule::Turning { lower_deg: 1.0, upper_deg: -1.0, step: 2.0, min_concentration: 0.1 };
        config.rules.property = Property::VibrationAmplitude;
        config.contact = ContactSource::Detected { threshold: f64::NAN, on_samples: 0, off_samples: 1 };
    });
    for field in [
        "sample_rate_hz",
        "contact.threshold",
        "contact.on_samples",
        "settling_s",
        "rules.property",
        "rules.feed.step",
        "rules.feed_bounds",
        "rules.spindle.turning.lower_deg",
        "rules.spindle.turning.step",
    ] {
        assert_eq!(found.iter().filter(|name| *name == field).count(), 1, "{field} in {found:?}");
    }
}

#[test]
fn sensors_that_do_not_fit_together() {
    assert_eq!(fields(|config| config.tool = None), ["tool"]);
    let acceleration = Sensors { quantity: Quantity::Acceleration, min: -1e6, max: 1e6 };
    assert_eq!(fields(|config| config.tool = Some(acceleration)), ["tool_check.max_ratio"]);
    assert_eq!(fields(|config| config.work = Some(acceleration)), ["work.quantity", "tool_check.max_ratio"]);
    let strain = Sensors { quantity: Quantity::Strain { mm_per_strain: 0.0 }, min: 1.0, max: -1.0 };
    assert_eq!(fields(|config| config.tool = Some(strain)), ["tool.min", "tool.mm_per_strain", "tool_check.max_ratio"]);
}

#[test]
fn run_ups_and_spectra() {
    let idle = |spindle_rev_per_min| IdleRunUp {
        spindle_rev_per_min,
        speed_tolerance: 0.02,
        length: Length::Series(3),
        max_difference: 0.001,
    };
    assert_eq!(fields(|config| config.idle_run_up = Some(idle(vec![]))), ["idle_run_up.spindle_rev_per_min"]);
    assert_eq!(
        fields(|config| config.idle_run_up = Some(idle(vec![900.0, 600.0]))),
        ["idle_run_up.spindle_rev_per_min"]
    );
    let spectrum = SpectrumConfig {
        samples: 2048,
        min_frequency_hz: 600.0,
        noise_floor: 0.0,
        harmonic_tolerance_hz: 2.0,
        edges: 0,
    };
    assert_eq!(
        fields(|config| config.spectrum = Some(spectrum)),
        ["spectrum.samples", "spectrum.min_frequency_hz", "spectrum.edge_count"]
    );
}

#[test]
fn a_snapshot_with_limits_in_radians_is_continued_in_degrees() {
    let with = |lower_deg, upper_deg| {
        let mut config = config();
        config.rules.spindle = SpindleRule::Turning { lower_deg, upper_deg, step: 0.05, min_concentration: 0.4 };
        Monitor::new(config).expect("a possible configuration")
    };
    // The layout has not changed with the unit, only the version that the bytes begin with; since then the plan of the spindle
    // speed has come behind it (no plan, no request, no refusal), and the requests that are in force at once (none).
    let mut bytes = with(-std::f64::consts::FRAC_PI_4, std::f64::consts::PI).snapshot().unwrap();
    assert_eq!(std::mem::replace(&mut bytes[0], 4), 7);
    assert_eq!(bytes.split_off(bytes.len() - 4), [0; 4]);
    let continued = Monitor::restore(&bytes).unwrap();
    assert_eq!(continued.config(), with(-45.0, 180.0).config());
    assert_eq!(continued.spindle(), SpindlePlan::default());
}

#[test]
fn a_snapshot_from_before_the_plan_of_the_spindle_speed_is_continued_without_one() {
    let monitor = Monitor::new(config()).expect("a possible configuration");
    let mut bytes = monitor.snapshot().unwrap();
    assert_eq!(std::mem::replace(&mut bytes[0], 5), 7);
    bytes.truncate(bytes.len() - 4);
    let continued = Monitor::restore(&bytes).unwrap();
    assert_eq!((continued.config(), continued.spindle()), (monitor.config(), SpindlePlan::default()));
    // The plan is part of what a continuation knows.
    let planning = Monitor::new(config()).expect("a possible configuration").planning_spindle();
    assert!(Monitor::restore(&planning.snapshot().unwrap()).unwrap().spindle().planned);
}
