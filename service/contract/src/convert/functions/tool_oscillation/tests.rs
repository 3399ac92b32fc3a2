use feedwave_cutting::tool_oscillation::{
    ConditionTable, DirectionOscillation, Engagement, Interpolation, LeadingEdge, NamedCondition, OscillationCondition,
    OscillationPeriod, RoleRotation, TableQuantity, Waveform, WorkSide,
};
use feedwave_program::FunctionCodes;

use super::*;
use crate::convert::profile::tests::from_proto;
use crate::convert::profile_to_proto;

/// A mill with every kind of waveform, period, rotation and table.
pub(in crate::convert) fn oscillating_mill() -> MachineProfile {
    let direction = |amplitude_mm, waveform, phase_deg| DirectionOscillation { amplitude_mm, waveform, phase_deg };
    let table = |quantity, interpolation| ConditionTable {
        quantity,
        interpolation,
        feed_mm_per_min: vec![300.0, 600.0, 900.0],
        spindle_rev_per_min: vec![500.0, 700.0],
        values: vec![vec![0.1, 0.2, 0.3], vec![0.2, 0.3, 0.4]],
    };
    let first = NamedCondition {
        name: "accuracy".to_owned(),
        number: 1,
        tools: vec![4, 7],
        condition: OscillationCondition {
            period: OscillationPeriod::PerRevolution(2),
            feed: direction(0.4, Waveform::Sine, 0.0),
            axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }, -12.5),
            cross: Some(direction(0.1, Waveform::Table { points: vec![[0.0, 0.5], [0.25, 1.0], [0.75, -1.0]] }, 3.0)),
            leading_edge: LeadingEdge { edge: 3, phase_deg: 30.0, rotation: RoleRotation::EveryParts(5) },
            ramp_periods: 4,
            may_overrun: true,
            engagement: Engagement::Width { width_mm: 12.5, side: WorkSide::Left },
        },
        tables: vec![
            table(TableQuantity::FeedAmplitude, Interpolation::Linear),
            table(TableQuantity::AxialAmplitude, Interpolation::Monotone),
            table(TableQuantity::CrossAmplitude, Interpolation::Linear),
            table(TableQuantity::AxialHoldShare, Interpolation::Monotone),
        ],
    };
    let mut second = NamedCondition { name: "speed".to_owned(), tools: Vec::new(), ..first.clone() };
    second.condition.period = OscillationPeriod::Seconds(0.05);
    second.condition.axial.waveform = Waveform::JerkLimitedHeldPeak { hold_share: 0.25 };
    second.condition.cross = None;
    second.condition.engagement = Engagement::Angles { entry_deg: -12.0, exit_deg: 90.0 };
    second.condition.leading_edge.rotation = RoleRotation::EverySeconds(600.0);
    second.tables.clear();
    let mut mill = MachineProfile::mill();
    mill.tool_oscillation = vec![first, second];
    mill.oscillation_floor =
        FloorSettings { simulate: false, revolutions: 3, resolution_mm: 0.05, max_cells: 5_000, trailing: false };
    mill.language.tool_oscillation = FunctionCodes { on: 302.1, off: 303.0 };
    mill
}

#[test]
fn oscillation_conditions_are_checked_with_their_fields() {
    let mut profile = profile_to_proto(&oscillating_mill());
    let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
    (first.period, first.axial) = (None, None);
    first.tables[2].quantity = 0;
    let width = proto::EngagementWidth { width_mm: 1.0, side: 0 };
    first.engagement = Some(proto::Engagement { kind: Some(proto::engagement::Kind::Width(width)) });
    second.name = "\n".to_owned();
    let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
    let field = |place: &str| format!("profile.tool_oscillation{place}");
    assert_eq!(
        fields,
        ["[0].period", "[0].axial", "[0].engagement.width.side", "[0].tables[2].quantity", "[1].name"].map(field)
    );

    let mut profile = profile_to_proto(&oscillating_mill());
    let [first, second] = profile.tool_oscillation.as_mut_slice() else { panic!("two conditions") };
    first.feed.as_mut().unwrap().amplitude_mm = f64::NAN;
    first.cross.as_mut().unwrap().waveform =
        Some(proto::Waveform { kind: Some(proto::waveform::Kind::HeldPeak(proto::HeldPeakWave { hold_share: 0.5 })) });
    first.ramp_periods = Some(0);
    first.tables[1].rows.pop();
    second.period = Some(proto::oscillation_condition::Period::PeriodS(-1.0));
    second.leading_edge.as_mut().unwrap().phase_deg = 400.0;
    second.leading_edge.as_mut().unwrap().rotation = Some(proto::leading_edge::Rotation::EveryParts(0));
    profile.language.as_mut().unwrap().tool_oscillation = Some(proto::FunctionCodes { on: 1.0, off: 203.0 });
    let found: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
    for place in [
        "[0].ramp_periods",
        "[0].feed.amplitude_mm",
        "[0].cross.waveform",
        "[0].tables[1]",
        "[1].period_s",
        "[1].leading_edge.phase_deg",
        "[1].leading_edge.every_parts",
    ] {
        assert!(found.contains(&field(place)), "{place} not in {found:?}");
    }
}
