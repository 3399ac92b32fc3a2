//! How telemetry is judged: from the contract to the monitor and back, with every default filled in.

use feedwave_monitoring as monitoring;
use feedwave_monitoring::{
    Bounds, ContactSource, Escalation, EscalationAction, Fallback, FeedRule, IdleRunUp, Length, MonitoringConfig,
    Property, Quality, Quantity, Rules, SpectrumConfig, SpikeFilter, SpindleRule, SpindleTable, TableRow, ToolCheck,
};

use super::enumeration;
use crate::proto;
use crate::violations::Violations;
use proto::grouping::By;
use proto::spindle_rule::Rule;
use proto::window_length::Length as ProtoLength;

/// The configuration with its defaults; a violation for each field under which no valid decision could be made.
pub fn monitoring_from_proto(
    violations: &mut Violations,
    field: &str,
    config: &proto::MonitoringConfig,
) -> Option<MonitoringConfig> {
    let mut found = Violations::default();
    let default = MonitoringConfig::default();
    let tool = config.tool.as_ref().map(|tool| sensors(&mut found, "tool", tool));
    let work = config.work.as_ref().map(|work| sensors(&mut found, "work", work));
    let grouping = grouping(&mut found, config.grouping.as_ref(), default.grouping);
    let baseline = length(&mut found, "baseline", config.baseline.as_ref(), default.baseline);
    let window = length(&mut found, "window", config.window.as_ref(), default.window);
    let idle_run_up = config.idle_run_up.as_ref().map(|idle| idle_run_up(&mut found, idle));
    let contact = config.contact.as_ref().map_or(ContactSource::Flag, |contact| ContactSource::Detected {
        threshold: contact.threshold,
        on_samples: contact.on_samples.unwrap_or(ContactSource::ON_SAMPLES),
        off_samples: contact.off_samples.unwrap_or(ContactSource::OFF_SAMPLES),
    });
    if config.rules.is_none() {
        found.add("rules", "must be set: without limits nothing can be decided");
    }
    let rules = rules_from_proto(&mut found, &config.rules.clone().unwrap_or_default());
    let converted = MonitoringConfig {
        sample_rate_hz: config.sample_rate_hz.unwrap_or(default.sample_rate_hz),
        tool,
        work,
        grouping,
        baseline,
        tool_check: config.tool_check.map_or(default.tool_check, |check| ToolCheck {
            max_ratio: check.max_ratio,
            max_run_out: check.max_run_out,
        }),
        idle_run_up,
        contact,
        settling_s: config.settling_s.unwrap_or(default.settling_s),
        window,
        spectrum: config.spectrum.map(spectrum),
        quality: quality(&config.quality.unwrap_or_default(), default.quality),
        rules,
    };
    for violation in converted.violations() {
        found.add(violation.field, violation.problem);
    }
    let valid = found.is_empty();
    violations.extend(field, found);
    valid.then_some(converted)
}

fn grouping(
    found: &mut Violations,
    given: Option<&proto::Grouping>,
    default: monitoring::Grouping,
) -> monitoring::Grouping {
    match given.map(|grouping| grouping.by) {
        None => default,
        Some(Some(By::AngularPoints(points))) => monitoring::Grouping::Angle { points },
        Some(Some(By::SamplesPerPoint(samples_per_point))) => monitoring::Grouping::Time { samples_per_point },
        Some(None) => {
            found.add("grouping", "angular_points or samples_per_point must be set");
            default
        }
    }
}

fn idle_run_up(found: &mut Violations, idle: &proto::IdleRunUp) -> IdleRunUp {
    let default = IdleRunUp::over(idle.spindle_rev_per_min.clone());
    IdleRunUp {
        speed_tolerance: idle.speed_tolerance.unwrap_or(default.speed_tolerance),
        length: length(found, "idle_run_up.length", idle.length.as_ref(), default.length),
        max_difference: idle.max_difference.unwrap_or(default.max_difference),
        ..default
    }
}

fn spectrum(spectrum: proto::SpectrumSettings) -> SpectrumConfig {
    let default = SpectrumConfig::default();
    SpectrumConfig {
        samples: spectrum.samples.unwrap_or(default.samples),
        min_frequency_hz: spectrum.min_frequency_hz.unwrap_or(default.min_frequency_hz),
        noise_floor: spectrum.noise_floor.unwrap_or(default.noise_floor),
        harmonic_tolerance_hz: spectrum.harmonic_tolerance_hz.unwrap_or(default.harmonic_tolerance_hz),
        edges: spectrum.edge_count.unwrap_or(default.edges),
    }
}

fn sensors(found: &mut Violations, field: &str, sensors: &proto::Sensors) -> monitoring::Sensors {
    let name = format!("{field}.quantity");
    let quantity = match enumeration(found, &name, sensors.quantity) {
        Some(proto::SensorQuantity::Displacement) => Quantity::Displacement,
        Some(proto::SensorQuantity::Strain) => Quantity::Strain { mm_per_strain: sensors.mm_per_strain },
        Some(proto::SensorQuantity::Acceleration) => Quantity::Acceleration,
        Some(proto::SensorQuantity::Unspecified) => {
            found.add(name, "must be set");
            Quantity::Displacement
        }
        None => Quantity::Displacement,
    };
    monitoring::Sensors { quantity, min: sensors.min, max: sensors.max }
}

fn length(found: &mut Violations, field: &str, length: Option<&proto::WindowLength>, default: Length) -> Length {
    match length.map(|length| length.length) {
        None => default,
        Some(Some(ProtoLength::DurationS(seconds))) => Length::Seconds(seconds),
        Some(Some(ProtoLength::Series(series))) => Length::Series(series),
        Some(None) => {
            found.add(field, "duration_s or series must be set");
            default
        }
    }
}

fn quality(quality: &proto::DataQuality, default: Quality) -> Quality {
    Quality {
        spikes: quality
            .max_step
            .map(|max_step| SpikeFilter { max_step, max_run: quality.max_step_run.unwrap_or(SpikeFilter::MAX_RUN) }),
        min_valid_samples: quality.min_valid_samples.unwrap_or(default.min_valid_samples),
        max_removed: quality.max_removed.unwrap_or(default.max_removed),
        stuck_samples: quality.stuck_samples.unwrap_or(default.stuck_samples),
        max_gap_s: quality.max_gap_s.unwrap_or(default.max_gap_s),
        silence_s: quality.silence_s.unwrap_or(default.silence_s),
        stale_s: quality.stale_s.unwrap_or(default.stale_s),
        max_window_s: quality.max_window_s.unwrap_or(default.max_window_s),
    }
}

/// Limits and steps; their sense is judged with the whole configuration.
pub(super) fn rules_from_proto(found: &mut Violations, rules: &proto::DecisionRules) -> Rules {
    let default = Rules::default();
    let property = match enumeration(found, "rules.property", rules.property) {
        Some(proto::ProcessProperty::VibrationAmplitude) => Property::VibrationAmplitude,
        Some(proto::ProcessProperty::VibrationFrequency) => Property::VibrationFrequency,
        Some(proto::ProcessProperty::Unspecified | proto::ProcessProperty::Deviation) | None => Property::Deviation,
    };
    let fallback = match enumeration(found, "rules.fallback", rules.fallback) {
        Some(proto::SilenceFallback::Full) => Fallback::Full,
        Some(proto::SilenceFallback::Stop) => Fallback::Stop,
        Some(proto::SilenceFallback::Unspecified | proto::SilenceFallback::Hold) | None => Fallback::Hold,
    };
    let feed = match rules.feed {
        Some(feed) => FeedRule { lower: feed.lower, upper: feed.upper, step: feed.step.unwrap_or(FeedRule::STEP) },
        None => {
            found.add("rules.feed", "must be set");
            default.feed
        }
    };
    let spindle = match rules.spindle.as_ref().map(|spindle| &spindle.rule) {
        None => SpindleRule::None,
        Some(Some(Rule::Turning(rule))) => SpindleRule::Turning {
            lower_deg: rule.lower_deg,
            upper_deg: rule.upper_deg,
            step: rule.step.unwrap_or(SpindleRule::STEP),
            min_concentration: rule.min_concentration.unwrap_or(SpindleRule::MIN_CONCENTRATION),
        },
        Some(Some(Rule::Milling(rule))) => {
            let row = |band: &proto::SpindleBand| TableRow {
                above_rev_per_min: band.above_rev_per_min,
                up_to_rev_per_min: band.up_to_rev_per_min,
                spindle_rev_per_min: band.spindle_rev_per_min,
            };
            let table = SpindleTable { rows: rule.table.iter().map(row).collect() };
            SpindleRule::Milling { limit: rule.limit, table }
        }
        Some(None) => {
            found.add("rules.spindle", "turning or milling must be set");
            SpindleRule::None
        }
    };
    let bounds = |bounds: Option<proto::OverrideBounds>, default: Bounds| {
        bounds.map_or(default, |bounds| Bounds { lower: bounds.lower, upper: bounds.upper })
    };
    let escalation = escalation(found, rules.escalation.unwrap_or_default());
    Rules {
        property,
        feed,
        spindle,
        feed_bounds: bounds(rules.feed_bounds, default.feed_bounds),
        spindle_bounds: bounds(rules.spindle_bounds, default.spindle_bounds),
        fallback,
        escalation,
    }
}

fn escalation(found: &mut Violations, escalation: proto::Escalation) -> Option<Escalation> {
    let default = Escalation::default();
    let action = match enumeration(found, "rules.escalation.action", escalation.action) {
        Some(proto::EscalationAction::Off) => return None,
        Some(proto::EscalationAction::Stop) => EscalationAction::Stop,
        Some(proto::EscalationAction::Hold) => EscalationAction::Hold,
        Some(proto::EscalationAction::Unspecified) | None => default.action,
    };
    Some(Escalation { windows: escalation.windows.unwrap_or(default.windows), action })
}

/// The message of a configuration, every default written out.
#[must_use]
pub fn monitoring_to_proto(config: &MonitoringConfig) -> proto::MonitoringConfig {
    let by = match config.grouping {
        monitoring::Grouping::Angle { points } => By::AngularPoints(points),
        monitoring::Grouping::Time { samples_per_point } => By::SamplesPerPoint(samples_per_point),
    };
    let contact = match config.contact {
        ContactSource::Flag => None,
        ContactSource::Detected { threshold, on_samples, off_samples } => {
            Some(proto::ContactDetection { threshold, on_samples: Some(on_samples), off_samples: Some(off_samples) })
        }
    };
    let quality = config.quality;
    proto::MonitoringConfig {
        sample_rate_hz: Some(config.sample_rate_hz),
        tool: config.tool.as_ref().map(sensors_to_proto),
        work: config.work.as_ref().map(sensors_to_proto),
        grouping: Some(proto::Grouping { by: Some(by) }),
        baseline: Some(length_to_proto(config.baseline)),
        tool_check: Some(proto::ToolCheck {
            max_ratio: config.tool_check.max_ratio,
            max_run_out: config.tool_check.max_run_out,
        }),
        idle_run_up: config.idle_run_up.as_ref().map(|idle| proto::IdleRunUp {
            spindle_rev_per_min: idle.spindle_rev_per_min.clone(),
            speed_tolerance: Some(idle.speed_tolerance),
            length: Some(length_to_proto(idle.length)),
            max_difference: Some(idle.max_difference),
        }),
        contact,
        settling_s: Some(config.settling_s),
        window: Some(length_to_proto(config.window)),
        spectrum: config.spectrum.map(|spectrum| proto::SpectrumSettings {
            samples: Some(spectrum.samples),
            min_frequency_hz: Some(spectrum.min_frequency_hz),
            noise_floor: Some(spectrum.noise_floor),
            harmonic_tolerance_hz: Some(spectrum.harmonic_tolerance_hz),
            edge_count: Some(spectrum.edges),
        }),
        quality: Some(proto::DataQuality {
            max_step: quality.spikes.map(|spikes| spikes.max_step),
            max_step_run: quality.spikes.map(|spikes| spikes.max_run),
            min_valid_samples: Some(quality.min_valid_samples),
            max_removed: Some(quality.max_removed),
            stuck_samples: Some(quality.stuck_samples),
            max_gap_s: Some(quality.max_gap_s),
            silence_s: Some(quality.silence_s),
            stale_s: Some(quality.stale_s),
            max_window_s: Some(quality.max_window_s),
        }),
        rules: Some(rules_to_proto(&config.rules)),
    }
}

fn sensors_to_proto(sensors: &monitoring::Sensors) -> proto::Sensors {
    let (quantity, mm_per_strain) = match sensors.quantity {
        Quantity::Displacement => (proto::SensorQuantity::Displacement, 0.0),
        Quantity::Strain { mm_per_strain } => (proto::SensorQuantity::Strain, mm_per_strain),
        Quantity::Acceleration => (proto::SensorQuantity::Acceleration, 0.0),
    };
    proto::Sensors { quantity: quantity.into(), mm_per_strain, min: sensors.min, max: sensors.max }
}

const fn length_to_proto(length: Length) -> proto::WindowLength {
    let length = match length {
        Length::Seconds(seconds) => ProtoLength::DurationS(seconds),
        Length::Series(series) => ProtoLength::Series(series),
    };
    proto::WindowLength { length: Some(length) }
}

pub(super) fn rules_to_proto(rules: &Rules) -> proto::DecisionRules {
    let rule = match &rules.spindle {
        SpindleRule::None => None,
        SpindleRule::Turning { lower_deg, upper_deg, step, min_concentration } => {
            Some(Rule::Turning(proto::TurningRule {
                lower_deg: *lower_deg,
                upper_deg: *upper_deg,
                step: Some(*step),
                min_concentration: Some(*min_concentration),
            }))
        }
        SpindleRule::Milling { limit, table } => {
            let band = |row: &TableRow| proto::SpindleBand {
                above_rev_per_min: row.above_rev_per_min,
                up_to_rev_per_min: row.up_to_rev_per_min,
                spindle_rev_per_min: row.spindle_rev_per_min,
            };
            let table = table.rows.iter().map(band).collect();
            Some(Rule::Milling(proto::MillingRule { limit: *limit, table, table_from: None }))
        }
    };
    let bounds = |bounds: Bounds| proto::OverrideBounds { lower: bounds.lower, upper: bounds.upper };
    proto::DecisionRules {
        property: match rules.property {
            Property::Deviation => proto::ProcessProperty::Deviation,
            Property::VibrationAmplitude => proto::ProcessProperty::VibrationAmplitude,
            Property::VibrationFrequency => proto::ProcessProperty::VibrationFrequency,
        }
        .into(),
        feed: Some(proto::FeedRule { lower: rules.feed.lower, upper: rules.feed.upper, step: Some(rules.feed.step) }),
        spindle: rule.map(|rule| proto::SpindleRule { rule: Some(rule) }),
        feed_bounds: Some(bounds(rules.feed_bounds)),
        spindle_bounds: Some(bounds(rules.spindle_bounds)),
        fallback: match rules.fallback {
            Fallback::Hold => proto::SilenceFallback::Hold,
            Fallback::Full => proto::SilenceFallback::Full,
            Fallback::Stop => proto::SilenceFallback::Stop,
        }
        .into(),
        // Off is said, too.
        escalation: Some(match rules.escalation {
            None => proto::Escalation { windows: None, action: proto::EscalationAction::Off.into() },
            Some(Escalation { windows, action }) => proto::Escalation {
                windows: Some(windows),
                action: match action {
                    EscalationAction::Hold => proto::EscalationAction::Hold,
                    EscalationAction::Stop => proto::EscalationAction::Stop,
                }
                .into(),
            },
        }),
    }
}

#[cfg(test)]
pub(super) mod tests;
