//! How surely a cut is stable when its spindle speed and depth are known within tolerances only.

/// Steps of the sum over the spindle speeds.
const SPEED_STEPS: u32 = 4_096;

/// What becomes of a cut within its tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StabilityRobustness {
    /// Least limit of the speeds within the tolerance, mm; `None` where nothing chatters at any.
    pub least_limit_mm: Option<f64>,
    /// Least limit over the largest depth: stable for all values within the tolerances above 1; `None` likewise.
    pub worst_margin: Option<f64>,
    /// Share of all values within the tolerances that are stable, 0 to 1, each as likely as any other; to 1e-3.
    pub share: f64,
}

/// How surely a depth is stable around a speed. `chart` are speeds in rev/min, ascending, with the limit in mm, straight between
/// neighbours (as [`chart`](super::Lobes::chart) makes them: on the exact limit or below), `None` where nothing chatters.
/// Tolerances are shares, 0 to below 1. `None` where the chart does not have all speeds of the tolerance, or for a depth or
/// tolerances that are impossible.
pub fn stability_robustness(
    chart: &[(f64, Option<f64>)],
    spindle_rev_per_min: f64,
    speed_tolerance: f64,
    depth_mm: f64,
    depth_tolerance: f64,
) -> Option<StabilityRobustness> {
    let possible = |share: f64| (0.0..1.0).contains(&share);
    if !possible(speed_tolerance) || !possible(depth_tolerance) || depth_mm <= 0.0 || !depth_mm.is_finite() {
        return None;
    }
    let [low, high] = [1.0 - speed_tolerance, 1.0 + speed_tolerance].map(|share| spindle_rev_per_min * share);
    let ends = [limit_at(chart, low)?, limit_at(chart, high)?];
    let inside = chart.iter().filter(|(speed, _)| (low..=high).contains(speed)).map(|(_, limit)| *limit);
    let least_limit_mm = inside.chain(ends).flatten().reduce(f64::min);
    let [shallow, deep] = [1.0 - depth_tolerance, 1.0 + depth_tolerance].map(|share| depth_mm * share);
    let stable = |limit: Option<f64>| match limit {
        None => 1.0,
        Some(limit) if deep > shallow => ((limit - shallow) / (deep - shallow)).clamp(0.0, 1.0),
        Some(limit) => f64::from(u8::from(limit >= depth_mm)),
    };
    let steps = if high > low { SPEED_STEPS } else { 1 };
    let speed = |step: u32| low + (high - low) * (f64::from(step) + 0.5) / f64::from(steps);
    let sum: f64 = (0..steps).filter_map(|step| limit_at(chart, speed(step))).map(stable).sum();
    Some(StabilityRobustness {
        least_limit_mm,
        worst_margin: least_limit_mm.map(|limit| limit / deep),
        share: sum / f64::from(steps),
    })
}

/// The limit at a speed: `None` outside of the chart, `Some(None)` where nothing chatters. Beside a speed at which nothing
/// chatters the limit of the other one holds.
fn limit_at(chart: &[(f64, Option<f64>)], spindle_rev_per_min: f64) -> Option<Option<f64>> {
    let behind = chart.partition_point(|(speed, _)| *speed < spindle_rev_per_min);
    let next = *chart.get(behind)?;
    if next.0 == spindle_rev_per_min {
        return Some(next.1);
    }
    let before = *chart.get(behind.checked_sub(1)?)?;
    Some(match (before.1, next.1) {
        (Some(low), Some(high)) => {
            let place = (spindle_rev_per_min - before.0) / (next.0 - before.0);
            Some(low + place * (high - low))
        }
        (one, other) => one.or(other),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHART: [(f64, Option<f64>); 4] =
        [(1_000.0, Some(2.0)), (1_100.0, Some(1.0)), (1_200.0, Some(3.0)), (1_300.0, None)];

    fn at(speed: f64, speed_tolerance: f64, depth_mm: f64, depth_tolerance: f64) -> Option<StabilityRobustness> {
        stability_robustness(&CHART, speed, speed_tolerance, depth_mm, depth_tolerance)
    }

    #[test]
    fn the_worst_speed_of_the_tolerance_counts() {
        let exact = at(1_050.0, 0.0, 1.2, 0.0).unwrap();
        assert_eq!((exact.least_limit_mm, exact.share), (Some(1.5), 1.0));
        let around = at(1_100.0, 0.05, 1.2, 0.25).unwrap();
        assert_eq!(around.least_limit_mm, Some(1.0));
        assert!((around.worst_margin.unwrap() - 1.0 / 1.5).abs() < 1e-12);
        // Depths 0.9 to 1.5: all are stable beyond 1.5, at 1045 to 1050 and 1125 to 1155 rev/min, and between them
        // (L − 0.9)/0.6 on the average of 1.0 and 1.5.
        let expected = (5.0 + 30.0 + 75.0 * (0.25 + 0.1) / 0.6) / 110.0;
        assert!((around.share - expected).abs() < 1e-3, "{} {expected}", around.share);
        // At one depth the share is that of the speeds.
        let share = at(1_100.0, 0.05, 1.5, 0.0).unwrap().share;
        assert!((share - 35.0 / 110.0).abs() < 1e-3, "{share}");
    }

    #[test]
    fn what_the_chart_does_not_have_is_not_judged() {
        assert_eq!(at(1_000.0, 0.01, 1.0, 0.0), None);
        assert_eq!(at(1_299.0, 0.01, 1.0, 0.0), None);
        assert_eq!(stability_robustness(&[], 1_000.0, 0.0, 1.0, 0.0), None);
        for (tolerance, depth, depth_tolerance) in
            [(1.0, 1.0, 0.0), (-0.1, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, f64::NAN)]
        {
            assert_eq!(at(1_100.0, tolerance, depth, depth_tolerance), None);
        }
        let free = stability_robustness(&[(900.0, None), (1_100.0, None)], 1_000.0, 0.05, 5.0, 0.1).unwrap();
        assert_eq!((free.least_limit_mm, free.worst_margin, free.share), (None, None, 1.0));
    }
}
