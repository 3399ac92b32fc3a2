//! Changes of the feed override: from the contract to the pipeline.

use feedwave_cutting::{
    MAX_HOLD_S, MAX_OVERRIDE_RATIO, MAX_SETPOINTS, MIN_OVERRIDE_RATIO, OverrideChange, is_override_ratio,
    setpoint_index_at,
};

use crate::proto::FeedOverrideChange;
use crate::proto::feed_override_change::At;
use crate::violations::Violations;

/// Changes of the feed override in one request.
pub const MAX_OVERRIDES: usize = 10_000;

/// The changes as the pipeline needs them at this interpolation period; a violation for each field that is wrong. A
/// time becomes the first setpoint at or after it.
pub fn overrides_from_proto(
    violations: &mut Violations,
    field: &str,
    changes: &[FeedOverrideChange],
    period_us: u32,
) -> Vec<OverrideChange> {
    if changes.len() > MAX_OVERRIDES {
        violations.add(field, format!("must list at most {MAX_OVERRIDES} changes, lists {}", changes.len()));
        return Vec::new();
    }
    let mut converted: Vec<OverrideChange> = Vec::with_capacity(changes.len());
    for (number, change) in changes.iter().enumerate() {
        let name = |part: &str| format!("{field}[{number}].{part}");
        // Absent is not 0: that would hold the feed.
        let ratio = change.ratio.unwrap_or(f64::NAN);
        if change.ratio.is_none() {
            violations.add(name("ratio"), "must be set");
        } else if !is_override_ratio(ratio) {
            let permitted = format!("0 (feed hold), or {MIN_OVERRIDE_RATIO} to {MAX_OVERRIDE_RATIO}");
            violations.add(name("ratio"), format!("must be {permitted}, is {ratio}"));
        }
        let index = match change.at {
            None => Err(("at", "time_s or setpoint_index must be set".to_owned())),
            Some(At::TimeS(time_s)) if !(time_s.is_finite() && time_s >= 0.0) => {
                Err(("time_s", format!("must be a finite number, not negative, is {time_s}")))
            }
            Some(At::TimeS(time_s)) => Ok(("time_s", setpoint_index_at(time_s, f64::from(period_us)))),
            Some(At::SetpointIndex(index)) => Ok(("setpoint_index", index)),
        };
        let index = index.and_then(|(part, index)| {
            let before = converted.last().map_or(0, |before| before.index);
            if index > MAX_SETPOINTS {
                Err((part, format!("must be at most setpoint {MAX_SETPOINTS}, is setpoint {index}")))
            } else if index < before {
                Err((part, format!("must not lie before the change above it, at setpoint {before}")))
            } else {
                Ok(index)
            }
        });
        match index {
            Ok(index) => converted.push(OverrideChange { index, ratio }),
            Err((part, description)) => violations.add(name(part), description),
        }
    }
    if changes.last().is_some_and(|last| last.ratio == Some(0.0)) {
        let name = format!("{field}[{}].ratio", changes.len() - 1);
        violations.add(name, "must be above 0 in the last change: held for ever, the program would not end");
    }
    converted
}

/// A violation for each change behind a hold of the feed that is longer than a plan is validated for. What a run was held for may be
/// longer, and is streamed again all the same.
pub fn check_holds(violations: &mut Violations, field: &str, changes: &[OverrideChange], period_us: u32) {
    let most = (1e6 * MAX_HOLD_S / f64::from(period_us.max(1))) as u64;
    let mut held_from = None;
    for (number, change) in changes.iter().enumerate() {
        if held_from.is_some_and(|from| change.index.saturating_sub(from) > most) {
            let description =
                format!("must lie within {MAX_HOLD_S} s of where the feed is held: no hold is planned longer");
            violations.add(format!("{field}[{number}].at"), description);
        }
        held_from = if change.ratio == 0.0 { held_from.or(Some(change.index)) } else { None };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_time(time_s: f64, ratio: f64) -> FeedOverrideChange {
        FeedOverrideChange { at: Some(At::TimeS(time_s)), ratio: Some(ratio) }
    }

    fn at_index(index: u64, ratio: f64) -> FeedOverrideChange {
        FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) }
    }

    fn convert(changes: &[FeedOverrideChange], period_us: u32) -> Result<Vec<OverrideChange>, Vec<String>> {
        let mut violations = Violations::default();
        let converted = overrides_from_proto(&mut violations, "overrides", changes, period_us);
        let fields = violations.as_slice().iter().map(|violation| violation.field.clone()).collect();
        if violations.is_empty() { Ok(converted) } else { Err(fields) }
    }

    #[test]
    fn times_become_the_first_setpoint_at_or_after_them() {
        let changes = [at_time(0.0, 0.5), at_time(0.1, 0.0), at_time(0.100_1, 1.0), at_index(401, 2.0)];
        let converted: Vec<_> = convert(&changes, 250).unwrap().iter().map(|c| (c.index, c.ratio)).collect();
        assert_eq!(converted, [(0, 0.5), (400, 0.0), (401, 1.0), (401, 2.0)]);
        let converted: Vec<_> = convert(&changes[..3], 20_000).unwrap().iter().map(|c| c.index).collect();
        assert_eq!(converted, [0, 5, 6]);
        assert_eq!(convert(&[], 1_000), Ok(Vec::new()));
    }

    #[test]
    fn everything_wrong_is_reported_with_its_field() {
        let changes = [
            FeedOverrideChange { at: None, ratio: Some(0.5) },
            at_time(f64::NAN, 0.5),
            at_time(f64::INFINITY, f64::NAN),
            at_time(-1.0, -0.1),
            at_time(2.0, 2.001),
            at_time(1.0, 1.0),
            at_index(1_999, 1.0),
            at_index(MAX_SETPOINTS + 1, 1.0),
            at_time(1e300, 1.0),
            FeedOverrideChange { at: Some(At::SetpointIndex(2_000)), ratio: None },
            at_index(2_000, 0.0),
        ];
        let expected = [
            "overrides[0].at",
            "overrides[1].time_s",
            "overrides[2].ratio",
            "overrides[2].time_s",
            "overrides[3].ratio",
            "overrides[3].time_s",
            "overrides[4].ratio",
            "overrides[5].time_s",
            "overrides[6].setpoint_index",
            "overrides[7].setpoint_index",
            "overrides[8].time_s",
            "overrides[9].ratio",
            "overrides[10].ratio",
        ];
        assert_eq!(convert(&changes, 1_000).unwrap_err(), expected);
    }

    #[test]
    fn ratios_and_holds_that_would_plan_for_ever_are_refused() {
        for (ratio, refused) in [(1e-11, true), (f64::MIN_POSITIVE, true), (0.009_9, true), (0.01, false), (2.0, false)]
        {
            let fields = if refused { Err(vec!["overrides[0].ratio".to_owned()]) } else { Ok(1) };
            assert_eq!(convert(&[at_time(0.0, ratio)], 1_000).map(|changes| changes.len()), fields, "{ratio}");
        }
        let held = |changes: &[(f64, f64)]| {
            let changes: Vec<_> = changes.iter().map(|&(time_s, ratio)| at_time(time_s, ratio)).collect();
            let mut violations = Violations::default();
            let converted = overrides_from_proto(&mut violations, "overrides", &changes, 1_000);
            assert!(violations.is_empty());
            check_holds(&mut violations, "overrides", &converted, 1_000);
            violations.as_slice().iter().map(|violation| violation.field.clone()).collect::<Vec<_>>()
        };
        assert_eq!(held(&[(10.0, 0.0), (86_410.0, 1.0)]), [""; 0]);
        assert_eq!(held(&[(10.0, 0.0), (86_410.1, 1.0)]), ["overrides[1].at"]);
        // Held once more is held on.
        assert_eq!(held(&[(0.0, 0.0), (80_000.0, 0.0), (90_000.0, 1.0)]), ["overrides[2].at"]);
        assert_eq!(held(&[(0.0, 0.0), (80_000.0, 0.5), (80_001.0, 0.0), (90_000.0, 1.0)]), [""; 0]);
    }

    #[test]
    fn a_list_without_end_is_refused() {
        let many: Vec<_> = (0..=MAX_OVERRIDES as u64).map(|index| at_index(index, 1.0)).collect();
        assert_eq!(convert(&many, 1_000), Err(vec!["overrides".to_owned()]));
        assert_eq!(convert(&many[1..], 1_000).unwrap().len(), MAX_OVERRIDES);
    }
}
