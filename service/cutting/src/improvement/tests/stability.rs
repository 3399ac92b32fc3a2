use super::*;

/// Limits over the speed: up to 1050 rev/min and from 1150 to 1250 there is a pocket, between and beyond 1.2 mm.
fn chart() -> Arc<[(f64, Option<f64>)]> {
    let points = [(500.0, 1.2), (800.0, 1.2), (860.0, 2.4), (940.0, 2.4), (970.0, 1.2), (1_080.0, 1.2), (1_120.0, 3.0)];
    let more = [(1_240.0, 3.0), (1_280.0, 1.2), (2_000.0, 1.2)];
    points.into_iter().chain(more).map(|(speed, limit)| (speed, Some(limit))).collect()
}

fn stable(depth_mm: f64) -> ImprovementGoals {
    ImprovementGoals { stability: Some(StabilityGoal { chart: chart(), depth_mm, depth_tolerance: 0.1 }), ..goals() }
}

/// The least limit within the tolerance of a speed over the largest depth, straight from the chart.
fn margin_at(speed: f64, depth_mm: f64) -> f64 {
    let limits = (-200..=200).map(|step| {
        let at = speed * (1.0 + 0.02 * f64::from(step) / 200.0);
        let chart = chart();
        let chord = chart.windows(2).find(|chord| (chord[0].0..=chord[1].0).contains(&at)).expect("in the chart");
        let [(from, low), (to, high)] = [chord[0], chord[1]].map(|(speed, limit)| (speed, limit.expect("a limit")));
        low + (high - low) * (at - from) / (to - from)
    });
    limits.fold(f64::INFINITY, f64::min) / (1.1 * depth_mm)
}

#[test]
fn a_stable_section_says_its_margin_and_without_lobes_nothing_is_said() {
    let program = turning("F41.65 A0.08", 1_000.0, "F0.1", 6.0);
    let without = improved(&program, &lathe(), &goals());
    let with = improved(&program, &lathe(), &stable(1.0));
    assert!(with.holds() && with.changes == without.changes, "{:?}", with.steps);
    let reason = &step(&with, ImprovementKind::Vibration).reason;
    // 1.2 mm over 1.1 mm.
    assert!(reason.contains("at 1000 rev/min stable with a margin of 1.09, 1.2 mm at worst"), "{reason}");
    assert!(!step(&without, ImprovementKind::Vibration).reason.contains("stable"));
}

#[test]
fn an_unstable_section_gets_the_nearest_stable_speed_that_is_permitted() {
    // It breaks every chip as it is.
    let program = turning("F41.65 A0.08", 1_000.0, "F0.1", 6.0);
    let kept = improved(&program, &lathe(), &stable(1.5));
    is_consistent(&program, &lathe(), &kept);
    assert!(!kept.holds() && kept.changes.is_empty());
    let reason = &step(&kept, ImprovementKind::Vibration).reason;
    for said in [
        "speeds stay, as none are permitted",
        "stable with a margin of 1.",
        "at 1000 rev/min not stable: 1.2 mm at worst",
    ] {
        assert!(reason.contains(said), "{said} is not in {reason}");
    }
    let free = ImprovementGoals { spindle_rev_per_min: Some([700.0, 1_400.0]), ..stable(1.5) };
    let improvement = improved(&program, &lathe(), &free);
    is_consistent(&program, &lathe(), &improvement);
    assert!(improvement.holds(), "{:?}", improvement.steps);
    let changed = step(&improvement, ImprovementKind::SpindleSpeed);
    let speed = figure(changed, "spindle speed").after;
    // Nothing nearer is stable, whatever the vibration.
    let nearer = (700..=1_400).map(f64::from).filter(|it| (it - 1_000.0).abs() < (speed - 1_000.0).abs());
    nearer.for_each(|it| assert!(margin_at(it, 1.5) < 1.0, "{it} is nearer than {speed}"));
    let found = figure(changed, "stability margin");
    assert!((found.after - margin_at(speed, 1.5)).abs() < 1e-3 && found.after >= 1.0, "{found:?}");
    assert!(found.before < 1.0 && changed.reason.contains("not stable"), "{}", changed.reason);
    assert_eq!(improvement.after.sections[0].broken_share, Some(1.0));
    // What came out has nothing left to change.
    let again = improved(text(&improvement), &lathe(), &free);
    assert!(again.changes.is_empty() && again.holds(), "{:?}", again.steps);
}

#[test]
fn where_no_speed_is_stable_the_best_one_is_said_with_its_figures() {
    let program = turning("F41.65 A0.08", 1_000.0, "F0.1", 6.0);
    let free = ImprovementGoals { spindle_rev_per_min: Some([700.0, 1_050.0]), ..stable(2.5) };
    let improvement = improved(&program, &lathe(), &free);
    assert!(!improvement.holds() && improvement.changes.is_empty());
    let reason = &step(&improvement, ImprovementKind::Vibration).reason;
    // 860/0.98 = 877.6 is the slowest of those at 2.4 mm; of 2.75 mm.
    let said = "no speed from 700 to 1050 rev/min is stable: at the best one, 878 rev/min, the limit is 2.4 mm at worst, 0.872 of the";
    assert!(reason.contains(said), "{reason}");
    // The lobes do not have the speeds.
    let elsewhere = turning("F70 A0.01", 3_000.0, "F0.01", 2.0);
    let improvement = improved(&elsewhere, &lathe(), &stable(1.0));
    let reason = &step(&improvement, ImprovementKind::Vibration).reason;
    assert!(!improvement.holds() && reason.contains("the lobes do not have all speeds from 2940 to 3060"), "{reason}");
}

#[test]
fn no_proposal_of_random_sections_is_unstable_and_none_is_missed() {
    let mut state = 20_261_127_u64;
    let mut random = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let config = lathe();
    let (mut sped, mut stayed, mut impossible) = (0, 0, 0);
    for case in 0..200 {
        let mut cut = RandomCut::new(&mut random);
        while !(510.0..1_400.0).contains(&cut.rev_per_min) {
            cut = RandomCut::new(&mut random);
        }
        let depth_mm = (random(0.8, 2.6) * 100.0).round() / 100.0;
        let range = [cut.rev_per_min * 0.8, cut.rev_per_min * 1.2];
        let goals = ImprovementGoals { spindle_rev_per_min: Some(range), ..stable(depth_mm) };
        let improvement = improved(&cut.program, &config, &goals);
        if !improvement.before.is_accepted() {
            continue;
        }
        is_consistent(&cut.program, &config, &improvement);
        let case = format!("case {case}, {depth_mm} mm: {:?}\n{}", improvement.steps, cut.program);
        let speed = improvement.after.sections[0].chip_spans[0].spindle_rev_per_min;
        if improvement.holds() {
            assert!(margin_at(speed, depth_mm) >= 1.0 - 1e-9, "{case}");
            *if speed == cut.rev_per_min { &mut stayed } else { &mut sped } += 1;
            continue;
        }
        impossible += 1;
        assert!(improvement.changes.is_empty(), "{case}");
        // By brute force: at no stable speed, in whole rev/min, does an easy vibration around the programmed one break the chip.
        for at in (range[0].max(511.0).ceil() as u32)..=(range[1] as u32) {
            let speed = f64::from(at);
            if margin_at(speed, depth_mm) < 1.0 + 1e-6 || (speed - cut.rev_per_min).abs() < 0.5 {
                continue;
            }
            let there = RandomCut { rev_per_min: speed, ..RandomCut::new(&mut |low, _| low) };
            let there = RandomCut { feed_mm: cut.feed_mm, frequency_hz: cut.frequency_hz, ..there };
            assert_eq!(there.least_mm(&config), None, "{at} rev/min, {case}");
        }
    }
    assert!(sped >= 20 && stayed >= 20 && impossible >= 20, "{sped} sped, {stayed} stayed, {impossible} impossible");
}

#[test]
fn a_speed_that_breaks_the_chip_and_is_not_stable_is_not_proposed() {
    // The chip breaks at no other frequency, and the depth is stable near this speed only.
    let program = "G21 G97 G99 S1170 M3\nG0 X40. Z2.\nG200 F58.5 A0.04\nG1 Z-1. F0.05\nG201\nG0 X60.\nM30\n";
    let one = SearchGoals { frequency_hz: Some([58.5, 58.5]), ..goals().vibration };
    let free = ImprovementGoals { vibration: one, spindle_rev_per_min: Some([1_000.0, 1_400.0]), ..stable(2.0) };
    let improvement = improved(program, &lathe(), &free);
    is_consistent(program, &lathe(), &improvement);
    // Stable speeds are 1135/0.98 to 1257/1.02 only, within which D = 3 goes to 2.85: too near for the tolerance.
    for section in &improvement.after.sections {
        let speed = section.chip_spans[0].spindle_rev_per_min;
        assert!(margin_at(speed, 2.0) >= 1.0, "{:?}", improvement.steps);
    }
    let without = improved(program, &lathe(), &ImprovementGoals { stability: None, ..free });
    let speed = without.after.sections[0].chip_spans[0].spindle_rev_per_min;
    assert!(without.holds() && margin_at(speed, 2.0) < 1.0, "{speed}: {:?}", without.steps);
}
