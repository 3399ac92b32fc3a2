//! Configurations as messages: defaults filled in, everything impossible named by its field.

use prost_reflect::MessageDescriptor;

use super::*;

/// A configuration with everything in it.
pub(in crate::convert) fn full() -> proto::MonitoringConfig {
    let length = ProtoLength::DurationS(0.5);
    proto::MonitoringConfig {
        tool: Some(proto::Sensors { quantity: 1, max: 10.0, ..Default::default() }),
        work: Some(proto::Sensors { quantity: 2, mm_per_strain: 400.0, min: -1.0, max: 1.0 }),
        tool_check: Some(proto::ToolCheck { max_ratio: None, max_run_out: Some(0.05) }),
        idle_run_up: Some(proto::IdleRunUp { spindle_rev_per_min: vec![1_000.0, 2_000.0], ..Default::default() }),
        contact: Some(proto::ContactDetection { threshold: 0.002, ..Default::default() }),
        window: Some(proto::WindowLength { length: Some(length) }),
        spectrum: Some(proto::SpectrumSettings::default()),
        quality: Some(proto::DataQuality { max_step: Some(0.5), ..Default::default() }),
        rules: Some(proto::DecisionRules {
            property: proto::ProcessProperty::VibrationAmplitude.into(),
            feed: Some(proto::FeedRule { lower: 0.003, upper: 0.01, step: None }),
            spindle: Some(proto::SpindleRule {
                rule: Some(Rule::Milling(proto::MillingRule {
                    limit: 0.02,
                    table_from: None,
                    table: vec![
                        proto::SpindleBand {
                            above_rev_per_min: 0.0,
                            up_to_rev_per_min: 3_000.0,
                            spindle_rev_per_min: 2_800.0,
                        },
                        proto::SpindleBand {
                            above_rev_per_min: 3_000.0,
                            up_to_rev_per_min: 9_000.0,
                            spindle_rev_per_min: 7_000.0,
                        },
                    ],
                })),
            }),
            ..Default::default()
        }),
        ..Default::default()
    }
}

fn fields(config: &proto::MonitoringConfig) -> Vec<String> {
    let mut violations = Violations::default();
    let converted = monitoring_from_proto(&mut violations, "config", config);
    assert_eq!(converted.is_some(), violations.is_empty());
    violations.as_slice().iter().map(|violation| violation.field.clone()).collect()
}

#[test]
fn a_configuration_comes_back_with_its_defaults() {
    let mut violations = Violations::default();
    let config = monitoring_from_proto(&mut violations, "config", &full());
    assert!(violations.is_empty(), "{violations:?}");
    let config = config.unwrap();
    assert_eq!((config.sample_rate_hz, config.settling_s, config.quality.silence_s), (20_000.0, 10.0, 0.5));
    assert_eq!(config.rules.feed.step, 0.05);
    let filled_in = monitoring_to_proto(&config);
    assert_eq!(filled_in.grouping, Some(proto::Grouping { by: Some(By::AngularPoints(36)) }));
    assert_eq!(monitoring_from_proto(&mut violations, "config", &filled_in), Some(config));
}

#[test]
fn everything_impossible_is_named_by_its_path_in_the_message() {
    let mut config = full();
    config.sample_rate_hz = Some(2e5);
    config.tool = Some(proto::Sensors { quantity: 0, min: 1.0, max: 0.0, ..Default::default() });
    config.work = Some(proto::Sensors { quantity: 2, min: -1.0, max: 1.0, ..Default::default() });
    config.grouping = Some(proto::Grouping { by: Some(By::AngularPoints(2)) });
    config.quality = Some(proto::DataQuality { max_step: Some(-1.0), ..Default::default() });
    let rules = config.rules.as_mut().unwrap();
    rules.feed = Some(proto::FeedRule { lower: 0.01, upper: 0.003, step: None });
    let Some(Rule::Milling(rule)) = rules.spindle.as_mut().and_then(|spindle| spindle.rule.as_mut()) else {
        panic!("milling")
    };
    rule.table[1].above_rev_per_min = 3_500.0;
    let found = fields(&config);
    for expected in [
        "config.sample_rate_hz",
        "config.tool.quantity",
        "config.tool.min",
        "config.work.mm_per_strain",
        "config.grouping.angular_points",
        "config.quality.max_step",
        "config.rules.feed.lower",
        "config.rules.spindle.milling.table[1].above_rev_per_min",
    ] {
        assert!(found.iter().any(|field| field == expected), "{expected} is not in {found:?}");
    }
    let nothing = fields(&proto::MonitoringConfig::default());
    for expected in ["config.tool", "config.rules"] {
        assert!(nothing.iter().any(|field| field == expected), "{expected} is not in {nothing:?}");
    }
}

/// Whether a path leads to a field of a message.
fn leads_to_a_field(path: &str, message: &MessageDescriptor) -> bool {
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    let (name, is_item) = name.split_once('[').map_or((name, false), |(name, _)| (name, true));
    message.get_field_by_name(name).is_some_and(|field| {
        is_item <= field.is_list()
            && rest.is_none_or(|rest| field.kind().as_message().is_some_and(|message| leads_to_a_field(rest, message)))
    })
}

#[test]
fn every_field_that_a_violation_names_is_one_of_the_message() {
    let impossible_length = || Some(proto::WindowLength { length: Some(ProtoLength::DurationS(0.0)) });
    let no_sensors = || Some(proto::Sensors { quantity: 2, ..Default::default() });
    let turning =
        proto::TurningRule { lower_deg: 900.0, upper_deg: 800.0, step: Some(2.0), min_concentration: Some(2.0) };
    let band = proto::SpindleBand { above_rev_per_min: -1.0, up_to_rev_per_min: -2.0, spindle_rev_per_min: -1.0 };
    let milling = proto::MillingRule { limit: -1.0, table: vec![band, band], table_from: None };
    let no_bounds = || Some(proto::OverrideBounds { lower: 3.0, upper: 0.5 });
    let mut all = std::collections::BTreeSet::new();
    for rule in [Rule::Turning(turning), Rule::Milling(milling), Rule::Milling(proto::MillingRule::default())] {
        all.extend(fields(&proto::MonitoringConfig {
            sample_rate_hz: Some(0.0),
            tool: no_sensors(),
            work: no_sensors(),
            grouping: Some(proto::Grouping { by: Some(By::AngularPoints(1)) }),
            baseline: impossible_length(),
            tool_check: Some(proto::ToolCheck { max_ratio: Some(-1.0), max_run_out: Some(-1.0) }),
            idle_run_up: Some(proto::IdleRunUp {
                spindle_rev_per_min: vec![],
                speed_tolerance: Some(2.0),
                length: impossible_length(),
                max_difference: Some(-1.0),
            }),
            contact: Some(proto::ContactDetection { threshold: -1.0, on_samples: Some(0), off_samples: Some(0) }),
            settling_s: Some(-1.0),
            window: impossible_length(),
            spectrum: Some(proto::SpectrumSettings {
                samples: Some(3),
                min_frequency_hz: Some(-1.0),
                noise_floor: Some(-1.0),
                harmonic_tolerance_hz: Some(-1.0),
                edge_count: Some(0),
            }),
            quality: Some(proto::DataQuality {
                max_step: Some(-1.0),
                max_step_run: Some(0),
                min_valid_samples: Some(0),
                max_removed: Some(2.0),
                stuck_samples: Some(0),
                max_gap_s: Some(-1.0),
                silence_s: Some(-2.0),
                stale_s: Some(-1.0),
                max_window_s: Some(-1.0),
            }),
            rules: Some(proto::DecisionRules {
                feed: Some(proto::FeedRule { lower: -1.0, upper: -2.0, step: Some(2.0) }),
                spindle: Some(proto::SpindleRule { rule: Some(rule) }),
                feed_bounds: no_bounds(),
                spindle_bounds: no_bounds(),
                escalation: Some(proto::Escalation { windows: Some(0), ..Default::default() }),
                ..Default::default()
            }),
        }));
    }
    assert!(all.len() >= 45, "{}: {all:?}", all.len());
    let message = proto::DESCRIPTORS.get_message_by_name("feedwave.v1.MonitoringConfig").unwrap();
    for field in &all {
        let path = field.strip_prefix("config.").unwrap();
        assert!(leads_to_a_field(path, &message), "{field}");
    }
}
