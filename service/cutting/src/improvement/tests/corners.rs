use super::*;
use crate::{SectionCorners, VibrationCondition};

/// A shoulder: along Z, out along X, and along Z again, for so many revolutions.
fn shoulder(words: &str, rev_per_min: f64, feed_mm: f64, legs_rev: [f64; 3]) -> String {
    let [first, second, third] = legs_rev.map(|turns| turns * feed_mm);
    format!(
        "G21 G97 G99 S{rev_per_min} M3\nG0 X40. Z2.\nG200 {words}\nG1 Z{:.4} F{feed_mm}\nG1 X{:.4}\nG1 Z{:.4}\nG201\nG0 X60.\nM30\n",
        2.0 - first,
        40.0 + 2.0 * second,
        2.0 - first - third
    )
}

fn whole_at_corners(report: &ValidationReport) -> bool {
    report.sections.iter().any(|section| section.unbroken_between_blends().is_some())
}

#[test]
fn the_trial_of_corners_is_the_verdict_of_validation() {
    let config = lathe();
    let mut alone = Alone;
    let goals = goals();
    let mut work = Work::new(b"", &config, &goals, &mut alone);
    let mut both = [0, 0];
    for (frequency_hz, amplitude_mm) in [
        (41.65, 0.04),
        (41.65, 0.08),
        (58.3, 0.05),
        (58.3, 0.07),
        (75.0, 0.04),
        (91.7, 0.03),
        (58.3, 0.03),
        (75.0, 0.03),
    ] {
        let program = shoulder("F41.65 A0.04", 1_000.0, 0.05, [100.0, 60.0, 100.0]);
        let other = program.replace("F41.65 A0.04", &format!("F{frequency_hz} A{amplitude_mm}"));
        let [known, judged] = [&program, &other].map(|text| work.validate(text.as_bytes()).unwrap());
        let condition = VibrationCondition { frequency_hz, amplitude_mm };
        assert_eq!(judged.sections[0].condition, condition);
        let sections: Vec<&crate::SectionReport> = known.sections.iter().collect();
        let corners = SectionCorners::of(&sections, &config.vibration()).unwrap().expect("it has corners");
        let is_broken = corners.break_with(FoundVibration { frequency_hz, amplitude_mm });
        assert_eq!(is_broken, !whole_at_corners(&judged), "{frequency_hz} Hz, {amplitude_mm} mm");
        both[usize::from(is_broken)] += 1;
    }
    assert!(both.iter().all(|count| *count > 0), "{both:?}");
}

#[test]
fn a_vibration_that_breaks_the_chip_at_shoulders_is_found_and_none_better() {
    let mut state = 20_261_128_u64;
    let mut random = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let config = lathe();
    let (mut found, mut none, mut plain) = (0, 0, 0);
    for case in 0..20 {
        let cut = RandomCut::new(&mut random);
        let legs = [random(60.0, 140.0), random(40.0, 90.0), random(60.0, 140.0)].map(f64::round);
        let words = format!("F{} A{:.4}", cut.frequency_hz, 0.7 * cut.feed_mm);
        let program = shoulder(&words, cut.rev_per_min, cut.feed_mm, legs);
        let improvement = improved(&program, &config, &ImprovementGoals { least_amplitude: true, ..goals() });
        if improvement.steps.is_empty() {
            continue;
        }
        let case = format!("case {case}: {:?}\n{program}", improvement.steps);
        if improvement.holds() {
            is_consistent(&program, &config, &improvement);
            assert!(!whole_at_corners(&improvement.after), "{case}");
        }
        // By brute force, over what a plain cut needs at 61 frequencies, and more of it.
        let reports: Vec<&crate::SectionReport> = improvement.before.sections.iter().collect();
        let Ok(Some(corners)) = SectionCorners::of(&reports, &config.vibration()) else { continue };
        let mut best: Option<FoundVibration> = None;
        let frequencies: Vec<f64> = cut.frequencies_hz(&config).step_by(33).collect();
        for frequency_hz in frequencies {
            for share in 0..24 {
                let amplitude_mm = cut.needed_mm(frequency_hz) * (1.0 + 0.05 * f64::from(share));
                let tried = FoundVibration { frequency_hz, amplitude_mm };
                if best.is_some_and(|best| best.amplitude_mm <= amplitude_mm) || !corners.break_with(tried) {
                    continue;
                }
                let words_of = format!("F{frequency_hz:.3} A{amplitude_mm:.4}");
                let load = |report: &ValidationReport| {
                    let axes = report.sections.iter().flat_map(|section| &section.axes);
                    axes.map(|axis| axis.utilisation).fold(0.0, f64::max)
                };
                let text = program.replace(&words, &words_of);
                let (mut alone, goals) = (Alone, goals());
                let report = Work::new(text.as_bytes(), &config, &goals, &mut alone).validate(text.as_bytes()).unwrap();
                if report.is_accepted() && !whole_at_corners(&report) && load(&report) < 0.85 {
                    best = Some(tried);
                }
            }
        }
        match (improvement.holds(), best) {
            (true, Some(best)) => {
                let got_mm = improvement.after.sections[0].condition.amplitude_mm;
                assert!(got_mm - 2e-4 <= best.amplitude_mm * (1.0 + 1e-3), "{got_mm} mm and {best:?}, {case}");
                found += 1;
            }
            (true, None) => plain += 1,
            (false, best) => {
                assert_eq!(best, None, "{case}");
                none += 1;
            }
        }
    }
    assert!(found >= 8, "{found} found, {plain} beyond what was tried, {none} with none");
}
