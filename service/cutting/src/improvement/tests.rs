use std::convert::Infallible;

use super::*;

mod corners;
mod limits;
mod stability;
mod surface_speed;
use crate::{FoundVibration, MachineProfile, PipelineConfig};

/// A program alone.
struct Alone;

impl Surroundings for Alone {
    type Error = Infallible;

    fn further(&mut self, place: Place) -> Result<Cow<'_, [u8]>, Infallible> {
        panic!("{place:?} is asked for");
    }

    fn step(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn goals() -> ImprovementGoals {
    ImprovementGoals {
        vibration: SearchGoals { margin: 1.1, speed_tolerance: 0.02, max_feed_override: 1.2, frequency_hz: None },
        least_amplitude: false,
        spindle_rev_per_min: None,
        max_feed_per_rev_mm: None,
        max_tolerance_mm: None,
        stability: None,
    }
}

fn on(profile: MachineProfile) -> Arc<PipelineConfig> {
    Arc::new(PipelineConfig { interpolation_period_us: 2_000, ..PipelineConfig::new(profile) })
}

fn lathe() -> Arc<PipelineConfig> {
    on(MachineProfile::lathe())
}

fn improved(program: &str, config: &Arc<PipelineConfig>, goals: &ImprovementGoals) -> Improvement {
    let result = improve(program.as_bytes(), config, goals, &mut Alone);
    match result {
        Ok(improvement) => improvement,
        Err(never) => match never {},
    }
}

fn text(improvement: &Improvement) -> &str {
    core::str::from_utf8(&improvement.program).unwrap()
}

/// What every improvement has to be, whatever came of it.
fn is_consistent(program: &str, config: &Arc<PipelineConfig>, improvement: &Improvement) {
    let mut lines: Vec<String> = program.lines().map(str::to_owned).collect();
    // From the last to the first, so that columns stay.
    for change in improvement.changes.iter().rev() {
        let line = &mut lines[change.span.line as usize - 1];
        let start = change.span.column as usize - 1;
        let place = start..start + change.span.length as usize;
        assert_eq!(line[place.clone()], change.old);
        line.replace_range(place, &change.new);
    }
    assert_eq!(lines.join("\n") + "\n", text(improvement), "the changes are all that is different");
    let mut work = Alone;
    let again = Work::new(&improvement.program, config, &goals(), &mut work).validate(&improvement.program).unwrap();
    assert!(again == improvement.after && again.is_accepted(), "the report is that of what came out");
    for step in &improvement.steps {
        assert!(!step.reason.is_empty(), "{step:?}");
        assert_eq!(step.outcome == ImprovementOutcome::Changed, !step.changes.is_empty(), "{step:?}");
        assert_eq!(step.changes.is_empty(), step.figures.is_empty(), "{step:?}");
    }
}

fn step(improvement: &Improvement, kind: ImprovementKind) -> &ImprovementStep {
    improvement.steps.iter().find(|step| step.kind == kind).expect("a step of this kind")
}

fn figure<'a>(step: &'a ImprovementStep, name: &str) -> &'a ImprovementFigure {
    step.figures.iter().find(|figure| figure.name == name).expect("the figure")
}

fn turning(words: &str, rev_per_min: f64, feed: &str, length: f64) -> String {
    format!(
        "G21 G97 G99 S{rev_per_min} M3\nG0 X40. Z2.\nG200 {words}\nG1 Z{:.3} {feed}\nG201\nG0 X60.\nM30\n",
        2.0 - length
    )
}

/// A vibrating cut of the random ones: the program and what the search is bounded by.
struct RandomCut {
    program: String,
    rev_per_min: f64,
    feed_mm: f64,
    frequency_hz: f64,
}

impl RandomCut {
    fn new(random: &mut impl FnMut(f64, f64) -> f64) -> Self {
        let (rev_per_min, feed_mm) = (random(400.0, 1_600.0).round(), (random(0.02, 0.15) * 1e4).round() / 1e4);
        let frequency_hz = (random(1.2, 3.8) * rev_per_min / 60.0 * 1e3).round() / 1e3;
        let amplitude_mm = (random(0.3, 2.0) * feed_mm * 1e4).round() / 1e4;
        let words = format!("F{frequency_hz} A{amplitude_mm}");
        let program = turning(&words, rev_per_min, &format!("F{feed_mm}"), 20.0 * feed_mm);
        Self { program, rev_per_min, feed_mm, frequency_hz }
    }

    /// The amplitude that a frequency needs, by its definition.
    fn needed_mm(&self, frequency_hz: f64) -> f64 {
        let shares = (-20..=20).map(|at| 1.0 + 0.02 * f64::from(at) / 20.0);
        let turns = shares.map(|share| 60.0 * frequency_hz / (self.rev_per_min * share));
        let sines = turns.map(|turns| (core::f64::consts::PI * turns).sin().abs());
        1.1 * 1.2 * self.feed_mm / (2.0 * sines.fold(f64::INFINITY, f64::min))
    }

    /// The frequencies within the bounds that are documented: a quarter or 0.6 vibrations of a revolution around the programmed
    /// one, or around the highest that the machine and eight samples of a vibration permit where that is lower.
    fn frequencies_hz(&self, config: &PipelineConfig) -> impl Iterator<Item = f64> + use<> {
        let sampled_hz = 1e6 / (8.0 * f64::from(config.interpolation_period_us));
        let highest_hz = config.profile.vibration.max_frequency_hz.min(sampled_hz);
        let nearest_hz = self.frequency_hz.min(highest_hz);
        let around_hz = (0.25 * nearest_hz).max(0.6 * self.rev_per_min / 60.0);
        let low_hz = (nearest_hz - around_hz).max(0.1);
        let high_hz = (nearest_hz + around_hz).min(highest_hz);
        (0..=2_000).map(move |at| low_hz + (high_hz - low_hz) * f64::from(at) / 2_000.0)
    }

    /// The least amplitude of 2 001 frequencies that leaves every axis a tenth of its limits with the blend as it is, and 1 % for the
    /// decimals of words.
    fn least_mm(&self, config: &PipelineConfig) -> Option<FoundVibration> {
        let axis = config.profile.machine.axes.iter().find(|axis| axis.axis == feedwave_program::Axis::Z).expect("Z");
        let feed_mm_per_s = self.feed_mm * self.rev_per_min / 60.0;
        let fits = |it: &FoundVibration| {
            let rad_per_s = core::f64::consts::TAU * it.frequency_hz;
            let ramp_mm = (1.2 * it.amplitude_mm).max(2.0 * feed_mm_per_s / it.frequency_hz);
            let r = feed_mm_per_s / (rad_per_s * ramp_mm);
            let [b1, b2, b3] = [1.875, 5.774, 60.0];
            let growth = [
                (b1 * r).hypot(1.0),
                (1.0 + b2 * r * r).hypot(2.0 * b1 * r),
                (1.0 + 3.0 * b2 * r * r).hypot(3.0 * b1 * r + b3 * r * r * r),
            ];
            let peaks = [0, 1, 2].map(|at| 1.01 * it.amplitude_mm * rad_per_s.powi(at + 1) * growth[at as usize]);
            1.01 * it.amplitude_mm < config.profile.vibration.max_amplitude_mm
                && peaks[0] < axis.max_velocity_per_s - feed_mm_per_s
                && peaks[1] < 0.9 * axis.max_acceleration_per_s2
                && peaks[2] < 0.9 * axis.max_jerk_per_s3
        };
        let all = self
            .frequencies_hz(config)
            .map(|frequency_hz| FoundVibration { frequency_hz, amplitude_mm: self.needed_mm(frequency_hz) });
        all.filter(fits).min_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))
    }
}

/// Holds what is found in so many random sections against every frequency within the bounds.
fn hold_against_all_frequencies(
    config: &Arc<PipelineConfig>,
    seed: u64,
    cases: u32,
    change: impl Fn(RandomCut) -> RandomCut,
) {
    let goals = ImprovementGoals { least_amplitude: true, ..goals() };
    let mut state = seed;
    let mut random = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut compared, mut impossible, mut refused, mut beyond) = (0, 0, 0, 0);
    for case in 0..cases {
        let cut = change(RandomCut::new(&mut random));
        let program = &cut.program;
        let improvement = improved(program, config, &goals);
        if improvement.steps.is_empty() {
            assert!(improvement.changes.is_empty() && !improvement.before.is_accepted());
            refused += 1;
            continue;
        }
        beyond += u32::from(!improvement.before.is_accepted());
        if improvement.after.is_accepted() {
            is_consistent(program, config, &improvement);
        }
        let [step] = &improvement.steps[..] else { panic!("one step: {:?}", improvement.steps) };
        let best = cut.least_mm(config);
        let case = format!("seed {seed}, case {case}: {best:?}, {step:?}\n{program}");
        if step.outcome == ImprovementOutcome::NotPossible {
            assert_eq!(best, None, "{case}");
            impossible += 1;
            continue;
        }
        let section = improvement.after.sections.first().expect("it vibrates");
        assert!(improvement.holds() && section.broken_share == Some(1.0), "{case}");
        let Some(best) = best else { continue };
        compared += 1;
        // A word has four decimals.
        let got_mm = section.condition.amplitude_mm;
        assert!(got_mm - 1e-4 <= best.amplitude_mm * (1.0 + 1e-3), "{got_mm} mm, {case}");
    }
    assert!(beyond >= cases / 100, "{beyond} are beyond the limits of an axis as programmed");
    assert!(compared >= cases * 2 / 5, "{compared} compared, {impossible} impossible, {refused} refused");
}

#[test]
fn a_chip_that_breaks_as_programmed_and_lacks_a_margin_only_is_said_to() {
    // 2A/f_r is 1.1 at 100 % of the feed: at 120 % the chip does not break any more.
    let said = |amplitude: &str, whole: bool| {
        let program =
            format!("G21 G97 S1000 M3\nG0 X6. Z2.\nG200 F41.66666667 A{amplitude}\nG1 Z40. F0.05\nG201\nM30\n");
        let improvement = improved(&program, &lathe(), &goals());
        let [step] = &improvement.steps[..] else { panic!("one step: {:?}", improvement.steps) };
        let share = improvement.before.sections[0].broken_share.expect("it is judged");
        assert_eq!((step.outcome, share == 1.0), (ImprovementOutcome::Changed, whole), "{share}");
        step.reason.clone()
    };
    let lacks = "the chip breaks as programmed, but not at every spindle speed within 2 % and every feed up to 120 %";
    assert_eq!(said("0.0275", true), format!("at 41.6667 Hz, 0.0275 mm {lacks}"));
    assert_eq!(said("0.0245", false), "at 41.6667 Hz, 0.0245 mm the chip does not break everywhere");
}

#[test]
fn no_frequency_of_2_000_random_sections_is_better_than_the_one_found() {
    // At the finer period more of the vibrations have eight samples.
    let fine = Arc::new(PipelineConfig { interpolation_period_us: 1_000, ..PipelineConfig::clone(&lathe()) });
    for seed in 0..5 {
        hold_against_all_frequencies(&lathe(), 20_261_125 + seed, 200, |cut| cut);
        hold_against_all_frequencies(&fine, 20_271_125 + seed, 200, |cut| cut);
    }
}

#[test]
fn feeds_rise_to_the_chip_thickness_with_a_vibration_that_still_breaks() {
    let program = turning("F41.65 A0.1", 1_000.0, "F0.1", 6.0);
    let config = lathe();
    let stays = improved(&program, &config, &goals());
    assert!(stays.changes.is_empty() && stays.holds(), "{:?}", stays.steps);
    let thicker = ImprovementGoals { max_feed_per_rev_mm: Some(0.18), ..goals() };
    let improvement = improved(&program, &config, &thicker);
    is_consistent(&program, &config, &improvement);
    // 0.18 at the largest override of 1.2 is 0.15 programmed.
    assert!(text(&improvement).contains("G1 Z-4.000 F0.15\n"), "{}{:?}", text(&improvement), improvement.steps);
    let step = step(&improvement, ImprovementKind::Feed);
    let time = figure(step, "machining time");
    assert!(time.after < time.before && improvement.after.summary.duration_s == time.after);
    // The report judges at the 150 % of the machine, where 0.225 mm are more than 2A: the goal is that of 120 %.
    let worst = improvement.after.sections[0].at_max_feed_override.unwrap();
    assert_eq!(worst.max_feed_override, 1.5);
    assert!(worst.breaking_margin < 1.0, "{worst:?}");
    let margin = worst.breaking_margin * 1.5 / 1.2;
    assert!((1.1..1.13).contains(&margin), "{margin}");
    let whole = SearchGoals { max_feed_override: 1.5, ..thicker.vibration };
    let whole = improved(&program, &config, &ImprovementGoals { vibration: whole, ..thicker.clone() });
    assert!(text(&whole).contains("G1 Z-4.000 F0.12\n"), "{}{:?}", text(&whole), whole.steps);
    assert!(whole.after.sections[0].at_max_feed_override.unwrap().breaking_margin >= 1.1);
    // At the limit nothing more is to be had.
    let again = improved(text(&improvement), &config, &thicker);
    assert!(again.changes.is_empty() && again.holds(), "{:?}", again.steps);
}

#[test]
fn a_feed_that_other_cuts_have_as_well_stays() {
    let program =
        "G21 G97 G99 S1000 M3\nG0 X40. Z2.\nG1 Z1. F0.1\nG200 F41.65 A0.1\nG1 Z-4.\nG201\nG1 Z-6.\nG0 X60.\nM30\n";
    let improvement = improved(program, &lathe(), &ImprovementGoals { max_feed_per_rev_mm: Some(0.24), ..goals() });
    is_consistent(program, &lathe(), &improvement);
    let step = step(&improvement, ImprovementKind::Feed);
    assert_eq!(step.outcome, ImprovementOutcome::Stays);
    assert!(step.reason.contains("other cuts"), "{}", step.reason);
}

#[test]
fn axes_without_headroom_keep_the_feed_lower() {
    let mut profile = MachineProfile::lathe();
    for axis in &mut profile.machine.axes {
        axis.max_acceleration_per_s2 = 2_000.0;
    }
    let config = on(profile);
    let program = turning("F41.65 A0.0135", 1_000.0, "F0.02", 2.0);
    let improvement = improved(&program, &config, &ImprovementGoals { max_feed_per_rev_mm: Some(0.24), ..goals() });
    is_consistent(&program, &config, &improvement);
    let step = step(&improvement, ImprovementKind::Feed);
    assert_eq!(step.outcome, ImprovementOutcome::Changed, "{step:?}");
    let feed = figure(step, "feed");
    // A ≤ 0.9·2000/(2π·41.65)² = 0.0263 mm, 2A·sin πD/(1.1·1.2) = 0.0393 mm/rev with D within 2 % of 2.5; lower frequencies permit more.
    assert!((0.035..0.1).contains(&feed.after), "{feed:?}");
}

#[test]
fn another_spindle_speed_is_tried_where_it_may_change() {
    let program = turning("F50 A0.07", 1_000.0, "F0.1", 6.0);
    let one = SearchGoals { frequency_hz: Some([50.0, 50.0]), ..goals().vibration };
    let fixed = ImprovementGoals { vibration: one, ..goals() };
    let config = lathe();
    let improvement = improved(&program, &config, &fixed);
    assert!(!improvement.holds() && improvement.changes.is_empty());
    let free = ImprovementGoals { spindle_rev_per_min: Some([800.0, 1_300.0]), ..fixed };
    let improvement = improved(&program, &config, &free);
    is_consistent(&program, &config, &improvement);
    assert!(improvement.holds(), "{:?}", improvement.steps);
    let speed = figure(step(&improvement, ImprovementKind::SpindleSpeed), "spindle speed");
    assert!((800.0..=1_300.0).contains(&speed.after) && speed.before == 1_000.0, "{speed:?}");
    assert!(text(&improvement).starts_with(&format!("G21 G97 G99 S{} M3\n", speed.after)), "{}", text(&improvement));
    assert_eq!(improvement.after.sections[0].broken_share, Some(1.0));
}

#[test]
fn a_speed_whose_change_would_leave_other_chips_unbroken_stays() {
    // D = 3 and no other frequency; at the same speed the second section breaks with D = 2.5, which is whole at 833 rev/min.
    let program = "G21 G97 G99 S1000 M3\nG0 X40. Z2.\nG200 F50 A0.07\nG1 Z-4. F0.1\nG201\nG0 X38. Z2.\nG200 F41.65 A0.09\nG1 Z-4.\nG201\n\
                   G0 X60.\nM30\n";
    let fixed = SearchGoals { frequency_hz: Some([50.0, 50.0]), ..goals().vibration };
    let speeds = Some([820.0, 850.0]);
    let improvement =
        improved(program, &lathe(), &ImprovementGoals { vibration: fixed, spindle_rev_per_min: speeds, ..goals() });
    is_consistent(program, &lathe(), &improvement);
    let first = step(&improvement, ImprovementKind::Vibration);
    assert_eq!(first.outcome, ImprovementOutcome::NotPossible, "{:?}", improvement.steps);
    assert!(first.reason.contains("other sections"), "{}", first.reason);
    assert!(improvement.changes.is_empty(), "{:?}", improvement.changes);
}

#[test]
fn a_section_whose_own_change_is_taken_back_is_not_left_worse_by_a_speed() {
    // The first section breaks, and a smaller amplitude of it does not hold; the second one asks for another speed, which would be that
    // of both.
    let program = "G21 G18 G99 G97 S800 M3\nG0 X30. Z2.\nG200 F70. A0.03137\nG1 Z-11. F0.0127\nG201\nG0 X32.\n\
                   G200 F66. A0.035\nG1 Z-35. F0.0886\nG201\nM30\n";
    let goals = ImprovementGoals { least_amplitude: true, spindle_rev_per_min: Some([600.0, 2_500.0]), ..goals() };
    let improvement = improved(program, &lathe(), &goals);
    is_consistent(program, &lathe(), &improvement);
    let broken = |report: &ValidationReport| -> Vec<bool> {
        report.sections.iter().map(|section| section.chip_spans.iter().all(|span| span.broken)).collect()
    };
    let [before, after] = [broken(&improvement.before), broken(&improvement.after)];
    assert_eq!(before, [true, false]);
    assert!(after[0], "{}", text(&improvement));
}

#[test]
fn a_frequency_far_beyond_eight_samples_comes_down_to_them() {
    // Eight periods of 2 ms are 62.5 Hz.
    for frequency in ["70", "100", "200", "249"] {
        let program = turning(&format!("F{frequency} A0.061"), 3_000.0, "F0.006", 3.0);
        let improvement = improved(&program, &lathe(), &goals());
        assert!(improvement.holds(), "{frequency}: {:?}", improvement.steps);
        let line = text(&improvement).lines().nth(2).expect("the vibration").to_owned();
        let hertz: f64 = line.trim_start_matches("G200 F").split(' ').next().unwrap().parse().unwrap();
        assert!(hertz > 30.0 && hertz <= 62.5, "{frequency}: {line}");
        is_consistent(&program, &lathe(), &improvement);
    }
}

#[test]
fn a_stated_frequency_is_kept_to_the_digit() {
    let program = turning("F45 A0.06", 1_000.0, "F0.1", 6.0);
    let one = SearchGoals { frequency_hz: Some([45.0, 45.0]), ..goals().vibration };
    let improvement = improved(&program, &lathe(), &ImprovementGoals { vibration: one, ..goals() });
    assert!(improvement.holds(), "{:?}", improvement.steps);
    assert!(text(&improvement).contains("G200 F45 A0.") && improvement.changes.len() == 1, "{:?}", improvement.changes);
}

#[test]
fn tolerances_rise_where_that_saves_time() {
    let chord = |at: u32| (core::f64::consts::TAU * f64::from(at) / 36.0).sin_cos();
    let chords: String =
        (1..=36).map(|at| format!("G1 X{:.4} Y{:.4}\n", 10.0 * chord(at).1, 10.0 * chord(at).0)).collect();
    let program = format!("G21 G90 G17 G94\nS3000 M3\nG64 P0.005\nG0 X0 Y0\nG1 X10 Y0 F6000\n{chords}M30\n");
    let config = on(MachineProfile::mill());
    let goals = ImprovementGoals { max_tolerance_mm: Some(0.05), ..goals() };
    let improvement = improved(&program, &config, &goals);
    is_consistent(&program, &config, &improvement);
    assert!(text(&improvement).contains("\nG64 P0.05\n"), "{:?}", improvement.steps);
    let time = figure(step(&improvement, ImprovementKind::Tolerance), "machining time");
    assert!(time.after < 0.95 * time.before, "{time:?}");
    let deviation = improvement.after.summary.path_deviation.as_ref().unwrap().largest_mm;
    assert!(deviation <= 0.05, "{deviation}");
    // Straight on nothing is saved.
    let straight = "G21 G90 G17 G94\nS3000 M3\nG64 P0.01\nG0 X0 Y0\nG1 X50 F3000\nM30\n";
    let improvement = improved(straight, &config, &goals);
    assert_eq!(step(&improvement, ImprovementKind::Tolerance).outcome, ImprovementOutcome::Stays);
    assert!(improvement.changes.is_empty() && improvement.holds());
}

#[test]
fn a_threading_pass_gets_the_amplitude_that_cuts_its_chip() {
    let pass = |x: f64, words: &str| format!("G0 X14. Z10.\nG0 X{x}\nG32 Z-10. {words}\nG0 X14.\n");
    let config = lathe();
    // The word becomes longer or shorter than it was, behind others of the block.
    for words in ["F2.5 A0.1", "R0 F2.5 A0.1", "F2.5 A0.1234567"] {
        let program = format!(
            "G21 G97 G99 S300 M3\nG0 X14. Z10.\nG165 P3 X10. Q1.2\n{}{}{}{}G165 P0\nM30\n",
            pass(9.8, words),
            pass(9.6, "F2.5"),
            pass(9.4, "F2.5"),
            pass(9.0, "F2.5 A0.0"),
        );
        let improvement = improved(&program, &config, &goals());
        is_consistent(&program, &config, &improvement);
        assert!(text(&improvement).contains(" A0.2002\n"), "{words}: {:?}", improvement.steps);
        assert_eq!(improvement.after.summary.warnings, 0);
    }
}

#[test]
fn a_threading_pass_gets_the_phase_that_cuts_its_chip() {
    let pass = |x: f64, words: &str| format!("G0 X14. Z10.\nG0 X{x}\nG32 Z-10. F2.5 {words}\nG0 X14.\n");
    let program = format!(
        "G21 G97 G99 S300 M3\nG0 X14. Z10.\nG165 P3 X10. Q1.2\n{}{}{}{}G165 P0\nM30\n",
        pass(9.8, "R0"),
        pass(9.6, "R10"),
        pass(9.4, "R180"),
        pass(9.0, "A0.0"),
    );
    let config = lathe();
    let improvement = improved(&program, &config, &goals());
    is_consistent(&program, &config, &improvement);
    let changed: Vec<_> = improvement.steps.iter().filter(|step| step.outcome == ImprovementOutcome::Changed).collect();
    assert!(!changed.is_empty(), "{:?}\n{:?}", improvement.steps, improvement.before.findings);
    assert!(changed.iter().all(|step| step.kind == ImprovementKind::ThreadPass));
    assert!(improvement.after.summary.warnings < improvement.before.summary.warnings);
}

#[test]
fn blends_count_for_the_vibration_that_is_looked_for() {
    let config = on(MachineProfile { max_feed_override: 1.2, ..MachineProfile::lathe() });
    let reason = |program: &str| {
        let improvement = improved(program, &config, &goals());
        is_consistent(program, &config, &improvement);
        let step = step(&improvement, ImprovementKind::Vibration);
        assert_eq!(step.outcome, ImprovementOutcome::NotPossible, "{step:?}");
        step.reason.clone()
    };
    // The whole amplitude has a margin of 2, and little of it arrives.
    let short = turning("F40.417 A0.05", 970.0, "F0.05", 0.1);
    assert!(reason(&short).contains("blends"), "{}", reason(&short));
    // Blocks long enough for the chip to break in each, with corners between them.
    let blocks: String = (1..=20)
        .map(|block| format!("G1 X{} Z{:.3} F0.05\n", 20.0 + 0.4 * f64::from(block % 2), -0.4 * f64::from(block)))
        .collect();
    let head = "G21 G97 G99 S970 M3\nG0 X20. Z0\n";
    let corners = format!("{head}G200 F40.417 A0.05\n{blocks}G201\nG0 X60.\nM30\n");
    assert!(reason(&corners).contains("corners"), "{}", reason(&corners));
    // Where nothing breaks, more than nothing is better.
    let none = format!("{head}G200 F48.5 A0.05\n{blocks}G201\nG0 X60.\nM30\n");
    let improvement = improved(&none, &config, &goals());
    is_consistent(&none, &config, &improvement);
    assert_eq!(step(&improvement, ImprovementKind::Vibration).outcome, ImprovementOutcome::Changed);
    let [before, after] = [&improvement.before, &improvement.after].map(|it| it.sections[0].broken_share.unwrap());
    assert!(before == 0.0 && after > 0.6 && after < 1.0, "{before} {after}");
}

/// At the limit of an axis the best amplitude has no room for being rounded up: another frequency has.
#[test]
fn a_vibration_at_a_limit_is_written_at_a_frequency_with_room() {
    let goals = ImprovementGoals {
        vibration: SearchGoals { margin: 1.6, speed_tolerance: 0.0, max_feed_override: 1.0, frequency_hz: None },
        ..goals()
    };
    let config =
        Arc::new(PipelineConfig { interpolation_period_us: 1_000, ..PipelineConfig::new(MachineProfile::lathe()) });
    let program = "G21 G18 G97 G99 S2460 M3\nG0 X30. Z2.\nG200 F54.0 A0.0454\nG1 Z-15. F0.0723\nG201\nG0 X32.\nM30\n";
    let result = improved(program, &config, &goals);
    assert!(result.holds() && !result.changes.is_empty(), "{:?}", result.steps);
}
