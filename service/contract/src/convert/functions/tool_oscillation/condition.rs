//! Named conditions of tool oscillation, to and from the contract.

use feedwave_cutting::tool_oscillation::{
    ConditionTable, DirectionOscillation, Engagement, Interpolation, LeadingEdge, NamedCondition, OscillationCondition,
    OscillationPeriod, RoleRotation, TableQuantity, Waveform, WorkSide,
};

use crate::convert::{check_display_name, enumeration};
use crate::proto;
use crate::violations::Violations;

/// The conditions as the pipeline needs them; `None` with violations. Ranges are the profile's own to check.
pub(super) fn conditions_from_proto(
    violations: &mut Violations,
    conditions: &[proto::OscillationCondition],
) -> Option<Vec<NamedCondition>> {
    let converted: Vec<Option<NamedCondition>> = conditions
        .iter()
        .enumerate()
        .map(|(index, condition)| condition_from_proto(violations, &format!("tool_oscillation[{index}]"), condition))
        .collect();
    converted.into_iter().collect()
}

fn condition_from_proto(
    violations: &mut Violations,
    field: &str,
    condition: &proto::OscillationCondition,
) -> Option<NamedCondition> {
    check_display_name(violations, &format!("{field}.name"), &condition.name);
    let period = match condition.period {
        Some(proto::oscillation_condition::Period::PeriodsPerRev(periods)) => {
            Some(OscillationPeriod::PerRevolution(periods))
        }
        Some(proto::oscillation_condition::Period::PeriodS(seconds)) => Some(OscillationPeriod::Seconds(seconds)),
        None => {
            violations.add(format!("{field}.period"), "must be set");
            None
        }
    };
    let mut required = |name: &str, direction: &Option<proto::DirectionOscillation>| {
        if direction.is_none() {
            violations.add(format!("{field}.{name}"), "must be set");
        }
        direction.as_ref().map(direction_from_proto)
    };
    let feed = required("feed", &condition.feed);
    let axial = required("axial", &condition.axial);
    let engagement = engagement_from_proto(violations, &format!("{field}.engagement"), condition.engagement);
    let tables: Vec<Option<ConditionTable>> = condition
        .tables
        .iter()
        .enumerate()
        .map(|(index, table)| table_from_proto(violations, &format!("{field}.tables[{index}]"), table))
        .collect();
    Some(NamedCondition {
        name: condition.name.clone(),
        number: condition.number,
        tools: condition.tools.clone(),
        condition: OscillationCondition {
            period: period?,
            feed: feed?,
            axial: axial?,
            cross: condition.cross.as_ref().map(direction_from_proto),
            leading_edge: condition.leading_edge.map_or_else(LeadingEdge::default, leading_edge_from_proto),
            ramp_periods: condition.ramp_periods.unwrap_or(OscillationCondition::RAMP_PERIODS),
            may_overrun: condition.may_overrun,
            engagement: engagement?,
        },
        tables: tables.into_iter().collect::<Option<_>>()?,
    })
}

fn engagement_from_proto(
    violations: &mut Violations,
    field: &str,
    engagement: Option<proto::Engagement>,
) -> Option<Engagement> {
    use proto::engagement::Kind;
    match engagement.and_then(|engagement| engagement.kind) {
        None => Some(Engagement::Slot),
        Some(Kind::Angles(angles)) => {
            Some(Engagement::Angles { entry_deg: angles.entry_deg, exit_deg: angles.exit_deg })
        }
        Some(Kind::Width(width)) => {
            let side = match enumeration(violations, &format!("{field}.width.side"), width.side)? {
                proto::WorkSide::Unspecified => {
                    violations.add(format!("{field}.width.side"), "must be set");
                    return None;
                }
                proto::WorkSide::Left => WorkSide::Left,
                proto::WorkSide::Right => WorkSide::Right,
            };
            Some(Engagement::Width { width_mm: width.width_mm, side })
        }
    }
}

fn engagement_to_proto(engagement: &Engagement) -> Option<proto::Engagement> {
    use proto::engagement::Kind;
    let kind = match *engagement {
        Engagement::Slot => return None,
        Engagement::Angles { entry_deg, exit_deg } => Kind::Angles(proto::EngagementAngles { entry_deg, exit_deg }),
        Engagement::Width { width_mm, side } => {
            let side = match side {
                WorkSide::Left => proto::WorkSide::Left,
                WorkSide::Right => proto::WorkSide::Right,
            };
            Kind::Width(proto::EngagementWidth { width_mm, side: side.into() })
        }
    };
    Some(proto::Engagement { kind: Some(kind) })
}

fn direction_from_proto(direction: &proto::DirectionOscillation) -> DirectionOscillation {
    use proto::waveform::Kind;
    let waveform = match direction.waveform.as_ref().and_then(|waveform| waveform.kind.as_ref()) {
        None | Some(Kind::Sine(_)) => Waveform::Sine,
        Some(Kind::HeldPeak(held)) => Waveform::HeldPeak { hold_share: held.hold_share },
        Some(Kind::JerkLimitedHeldPeak(held)) => Waveform::JerkLimitedHeldPeak { hold_share: held.hold_share },
        Some(Kind::Table(table)) => {
            Waveform::Table { points: table.points.iter().map(|point| [point.phase_turns, point.value]).collect() }
        }
    };
    DirectionOscillation { amplitude_mm: direction.amplitude_mm, waveform, phase_deg: direction.phase_deg }
}

fn leading_edge_from_proto(leading: proto::LeadingEdge) -> LeadingEdge {
    LeadingEdge {
        edge: leading.edge.max(1),
        phase_deg: leading.phase_deg,
        rotation: match leading.rotation {
            None => RoleRotation::Fixed,
            Some(proto::leading_edge::Rotation::EveryParts(parts)) => RoleRotation::EveryParts(parts),
            Some(proto::leading_edge::Rotation::EveryS(seconds)) => RoleRotation::EverySeconds(seconds),
        },
    }
}

fn table_from_proto(violations: &mut Violations, field: &str, table: &proto::ConditionTable) -> Option<ConditionTable> {
    let quantity = enumeration(violations, &format!("{field}.quantity"), table.quantity);
    if quantity == Some(proto::TableQuantity::Unspecified) {
        violations.add(format!("{field}.quantity"), "must be set");
    }
    let interpolation = enumeration(violations, &format!("{field}.interpolation"), table.interpolation);
    Some(ConditionTable {
        quantity: match quantity? {
            proto::TableQuantity::Unspecified => return None,
            proto::TableQuantity::FeedAmplitude => TableQuantity::FeedAmplitude,
            proto::TableQuantity::AxialAmplitude => TableQuantity::AxialAmplitude,
            proto::TableQuantity::CrossAmplitude => TableQuantity::CrossAmplitude,
            proto::TableQuantity::AxialHoldShare => TableQuantity::AxialHoldShare,
        },
        interpolation: match interpolation? {
            proto::TableInterpolation::Unspecified | proto::TableInterpolation::Linear => Interpolation::Linear,
            proto::TableInterpolation::Monotone => Interpolation::Monotone,
        },
        feed_mm_per_min: table.feed_mm_per_min.clone(),
        spindle_rev_per_min: table.spindle_rev_per_min.clone(),
        values: table.rows.iter().map(|row| row.values.clone()).collect(),
    })
}

/// A condition as the contract has it, with every value stated.
pub(super) fn condition_to_proto(named: &NamedCondition) -> proto::OscillationCondition {
    let condition = &named.condition;
    proto::OscillationCondition {
        name: named.name.clone(),
        number: named.number,
        tools: named.tools.clone(),
        period: Some(match condition.period {
            OscillationPeriod::PerRevolution(periods) => proto::oscillation_condition::Period::PeriodsPerRev(periods),
            OscillationPeriod::Seconds(seconds) => proto::oscillation_condition::Period::PeriodS(seconds),
        }),
        feed: Some(direction_to_proto(&condition.feed)),
        axial: Some(direction_to_proto(&condition.axial)),
        cross: condition.cross.as_ref().map(direction_to_proto),
        leading_edge: Some(proto::LeadingEdge {
            edge: condition.leading_edge.edge,
            phase_deg: condition.leading_edge.phase_deg,
            rotation: match condition.leading_edge.rotation {
                RoleRotation::Fixed => None,
                RoleRotation::EveryParts(parts) => Some(proto::leading_edge::Rotation::EveryParts(parts)),
                RoleRotation::EverySeconds(seconds) => Some(proto::leading_edge::Rotation::EveryS(seconds)),
            },
        }),
        ramp_periods: Some(condition.ramp_periods),
        may_overrun: condition.may_overrun,
        tables: named.tables.iter().map(table_to_proto).collect(),
        engagement: engagement_to_proto(&condition.engagement),
    }
}

fn direction_to_proto(direction: &DirectionOscillation) -> proto::DirectionOscillation {
    use proto::waveform::Kind;
    let kind = match &direction.waveform {
        Waveform::Sine => Kind::Sine(proto::SineWave {}),
        Waveform::HeldPeak { hold_share } => Kind::HeldPeak(proto::HeldPeakWave { hold_share: *hold_share }),
        Waveform::JerkLimitedHeldPeak { hold_share } => {
            Kind::JerkLimitedHeldPeak(proto::HeldPeakWave { hold_share: *hold_share })
        }
        Waveform::Table { points } => Kind::Table(proto::TableWave {
            points: points.iter().map(|&[phase_turns, value]| proto::WavePoint { phase_turns, value }).collect(),
        }),
    };
    proto::DirectionOscillation {
        amplitude_mm: direction.amplitude_mm,
        waveform: Some(proto::Waveform { kind: Some(kind) }),
        phase_deg: direction.phase_deg,
    }
}

fn table_to_proto(table: &ConditionTable) -> proto::ConditionTable {
    let quantity = match table.quantity {
        TableQuantity::FeedAmplitude => proto::TableQuantity::FeedAmplitude,
        TableQuantity::AxialAmplitude => proto::TableQuantity::AxialAmplitude,
        TableQuantity::CrossAmplitude => proto::TableQuantity::CrossAmplitude,
        TableQuantity::AxialHoldShare => proto::TableQuantity::AxialHoldShare,
    };
    let interpolation = match table.interpolation {
        Interpolation::Linear => proto::TableInterpolation::Linear,
        Interpolation::Monotone => proto::TableInterpolation::Monotone,
    };
    proto::ConditionTable {
        quantity: quantity.into(),
        interpolation: interpolation.into(),
        feed_mm_per_min: table.feed_mm_per_min.clone(),
        spindle_rev_per_min: table.spindle_rev_per_min.clone(),
        rows: table.values.iter().map(|values| proto::ConditionTableRow { values: values.clone() }).collect(),
    }
}
