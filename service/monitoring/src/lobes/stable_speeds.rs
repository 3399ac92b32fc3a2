//! The spindle speeds at which a depth is stable for all values within its tolerances: to rounding, without a grid.
//!
//! Along a chart the limit is straight between neighbours, so the speeds with at least some limit are intervals with known ends.
//! A speed S is stable where all of S·(1 − t) to S·(1 + t) lies in one of them: [a, b] leaves a/(1 − t) to b/(1 + t).

/// Steps of a bisection of the largest limit.
const BISECTION_STEPS: u32 = 60;

/// The speeds between two, rev/min, at which all limits within the tolerance of the speed are `limit_mm` at least, as intervals that
/// ascend. `chart` and `speed_tolerance` are those of [`stability_robustness`](super::stability_robustness).
pub fn stable_speeds(
    chart: &[(f64, Option<f64>)],
    speed_tolerance: f64,
    limit_mm: f64,
    [low, high]: [f64; 2],
) -> Vec<[f64; 2]> {
    if !(0.0..1.0).contains(&speed_tolerance) {
        return Vec::new();
    }
    let within =
        |[from, to]: [f64; 2]| [(from / (1.0 - speed_tolerance)).max(low), (to / (1.0 + speed_tolerance)).min(high)];
    stable_stretches(chart, limit_mm).into_iter().map(within).filter(|[from, to]| from <= to).collect()
}

/// The speed between two, rev/min, at which the least limit within the tolerance of the speed is largest, with that limit in mm,
/// `None` where nothing chatters; of several the slowest. `None` where the chart has none of these speeds with its tolerance.
pub fn most_stable_speed(
    chart: &[(f64, Option<f64>)],
    speed_tolerance: f64,
    range: [f64; 2],
) -> Option<(f64, Option<f64>)> {
    let first = |limit_mm: f64| stable_speeds(chart, speed_tolerance, limit_mm, range).first().map(|it| it[0]);
    if let Some(speed) = first(f64::INFINITY) {
        return Some((speed, None));
    }
    let mut outside = chart.iter().filter_map(|(_, limit)| *limit).fold(0.0, f64::max);
    let (mut inside, mut best) = (0.0, first(0.0)?);
    if let Some(speed) = first(outside) {
        return Some((speed, Some(outside)));
    }
    for _ in 0..BISECTION_STEPS {
        let middle = 0.5 * (inside + outside);
        match first(middle) {
            Some(speed) => (inside, best) = (middle, speed),
            None => outside = middle,
        }
    }
    Some((best, Some(inside)))
}

/// The stretches of a chart with at least some limit.
fn stable_stretches(chart: &[(f64, Option<f64>)], limit_mm: f64) -> Vec<[f64; 2]> {
    let mut stretches: Vec<[f64; 2]> = Vec::new();
    // Whether the last one goes on up to the point where the next chord begins.
    let mut is_open = false;
    for chord in chart.windows(2) {
        let [(from, at_from), (to, at_to)] = [chord[0], chord[1]];
        // Beside a speed at which nothing chatters the limit of the other one holds.
        let [first, last] =
            [at_from.or(at_to), at_to.or(at_from)].map(|limit| limit.map_or(f64::INFINITY, |limit| limit));
        let crossing = || from + (to - from) * ((limit_mm - first) / (last - first)).clamp(0.0, 1.0);
        let stretch = match (first >= limit_mm, last >= limit_mm) {
            (true, true) => Some([from, to]),
            (true, false) => Some([from, crossing()]),
            (false, true) => Some([crossing(), to]),
            (false, false) => None,
        };
        match (stretch, stretches.last_mut()) {
            (Some([start, end]), Some(open)) if is_open && start == from => open[1] = end,
            (Some(stretch), _) => stretches.push(stretch),
            (None, _) => {}
        }
        is_open = last >= limit_mm;
    }
    stretches
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::stability_robustness;
    use super::*;

    const CHART: [(f64, Option<f64>); 5] =
        [(1_000.0, Some(2.0)), (1_100.0, Some(1.0)), (1_200.0, Some(3.0)), (1_300.0, None), (1_400.0, Some(0.5))];

    #[test]
    fn stretches_lose_the_tolerance_of_the_speed_at_both_ends() {
        let all = [0.0, f64::INFINITY];
        // At least 1.5 mm up to 1050 and from 1125 to 1300 rev/min; beyond, the 0.5 mm of the last point hold.
        assert_eq!(stable_speeds(&CHART, 0.0, 1.5, all), [[1_000.0, 1_050.0], [1_125.0, 1_300.0]]);
        let wide = stable_speeds(&CHART, 0.04, 1.5, all);
        assert_eq!(wide, [[1_125.0 / 0.96, 1_300.0 / 1.04]]);
        assert_eq!(stable_speeds(&CHART, 0.04, 1.5, [1_180.0, 1_200.0]), [[1_180.0, 1_200.0]]);
        assert_eq!(stable_speeds(&CHART, 0.04, 1.5, [1_000.0, 1_100.0]), [[0.0; 2]; 0]);
        assert_eq!(stable_speeds(&CHART, 1.0, 1.5, all), [[0.0; 2]; 0]);
    }

    #[test]
    fn the_largest_limit_is_found() {
        let (speed, limit) = most_stable_speed(&CHART, 0.0, [1_000.0, 1_140.0]).unwrap();
        assert!((speed - 1_000.0).abs() < 1e-6 && (limit.unwrap() - 2.0).abs() < 1e-9, "{speed} {limit:?}");
        assert_eq!(most_stable_speed(&CHART, 0.0, [500.0, 900.0]), None);
        let free = [(900.0, None), (1_100.0, None)];
        assert_eq!(most_stable_speed(&free, 0.05, [0.0, 2_000.0]), Some((900.0 / 0.95, None)));
    }

    proptest! {
        /// Each speed of an interval is stable by its definition, and each other one is not.
        #[test]
        fn intervals_are_what_the_robustness_says(
            limits in proptest::collection::vec(proptest::option::weighted(0.9, 0.5_f64..4.0), 2..12),
            tolerance in 0.0_f64..0.06,
            limit_mm in 0.6_f64..3.5,
        ) {
            let chart: Vec<_> =
                limits.iter().enumerate().map(|(at, limit)| (1_000.0 + 80.0 * at as f64, *limit)).collect();
            let last = chart[chart.len() - 1].0;
            let stable = stable_speeds(&chart, tolerance, limit_mm, [0.0, f64::INFINITY]);
            let mut best: f64 = 0.0;
            for step in 0..=500 {
                let speed = 950.0 + (last - 900.0) * f64::from(step) / 500.0;
                let near = stable.iter().flatten().any(|end| (end - speed).abs() < 1e-6);
                let Some(judged) = stability_robustness(&chart, speed, tolerance, limit_mm, 0.0) else {
                    prop_assert!(near || !stable.iter().any(|[from, to]| (*from..=*to).contains(&speed)));
                    continue;
                };
                best = best.max(judged.least_limit_mm.unwrap_or(f64::INFINITY));
                let is_stable = judged.worst_margin.is_none_or(|margin| margin >= 1.0);
                let found = stable.iter().any(|[from, to]| (*from..=*to).contains(&speed));
                prop_assert!(near || found == is_stable, "{speed} in {stable:?}: {judged:?}");
            }
            let found = most_stable_speed(&chart, tolerance, [950.0, last + 50.0]);
            if best > 0.0 {
                let (speed, limit) = found.expect("there is one");
                prop_assert!(limit.is_none_or(|limit| limit >= best * (1.0 - 1e-9)), "{limit:?} and {best}");
                let judged = stability_robustness(&chart, speed, tolerance * (1.0 - 1e-9), 1.0, 0.0);
                prop_assert!(judged.is_some(), "{speed}");
            }
        }
    }
}
