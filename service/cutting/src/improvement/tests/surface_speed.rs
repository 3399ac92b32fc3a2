use core::f64::consts::PI;

use super::*;

/// The spindle speed at a surface speed, rev/min.
fn speed_at(m_per_min: f64, diameter_mm: f64) -> f64 {
    m_per_min * 1_000.0 / (PI * diameter_mm)
}

impl RandomCut {
    /// The same at constant surface speed along Z, at a diameter of 40 mm, with the nearest spindle speed that a word says.
    fn at_surface_speed(self) -> Self {
        let m_per_min = (self.rev_per_min * PI * 40.0 / 1_000.0 * 10.0).round() / 10.0;
        let programmed = format!("G97 G99 S{} M3", self.rev_per_min);
        let program = self.program.replace(&programmed, &format!("G50 S3000\nG96 G99 S{m_per_min} M3"));
        Self { program, rev_per_min: speed_at(m_per_min, 40.0), ..self }
    }
}

#[test]
fn no_frequency_at_constant_surface_speed_is_better_than_the_one_found() {
    for seed in 0..2 {
        hold_against_all_frequencies(&lathe(), 20_281_127 + seed, 200, RandomCut::at_surface_speed);
    }
}

#[test]
fn at_the_clamp_the_search_is_that_of_the_largest_speed() {
    let constant = turning("F30 A0.07", 600.0, "F0.1", 6.0);
    let clamped = constant.replace("G97 G99 S600 M3", "G50 S600 G99\nG96 S100 M3");
    let [constant, improvement] = [&constant, &clamped].map(|program| improved(program, &lathe(), &goals()));
    is_consistent(&clamped, &lathe(), &improvement);
    assert!(improvement.holds() && !improvement.changes.is_empty());
    let words = |it: &Improvement| it.changes.iter().map(|change| change.new.clone()).collect::<Vec<_>>();
    assert_eq!(words(&improvement), words(&constant));
    let span = &improvement.after.sections[0].chip_spans[0];
    assert_eq!((span.spindle_rev_per_min, span.surface.and_then(|it| it.diameter_mm)), (600.0, None));
    // Along X, as long as the clamp holds all along.
    let facing = "G21 G50 S600\nG96 G99 S100 M3\nG0 X40. Z2.\nG200 F30 A0.07\nG1 X20. F0.1\nG201\nG0 Z10.\nM30\n";
    let improvement = improved(facing, &lathe(), &goals());
    is_consistent(facing, &lathe(), &improvement);
    assert_eq!(words(&improvement), words(&constant));
}

#[test]
fn where_the_speed_changes_along_the_path_its_range_is_said() {
    let taper = "G21 G50 S3000\nG96 G99 S100 M3\nG0 X40. Z2.\nG200 F30 A0.07\nG1 X50. Z-4. F0.1\nG201\nG0 X60.\nM30\n";
    let improvement = improved(taper, &lathe(), &goals());
    assert!(!improvement.holds() && improvement.changes.is_empty());
    let reason = &step(&improvement, ImprovementKind::Vibration).reason;
    // 100 m/min at 50 and at 40 mm.
    let said = "its spindle turns at 637 to 796 rev/min, and a revolution has 2.26 to 2.83 vibrations along the path";
    assert!(reason.contains(said), "{reason}");
}

#[test]
fn a_speed_is_proposed_in_metres_per_minute_and_holds_to_the_letter() {
    // 125.7 m/min at 40 mm are 1000 rev/min, with D = 3 and no other frequency.
    let program = turning("F50 A0.07", 1_000.0, "F0.1", 6.0)
        .replace("G97 G99 S1000 M3", "G50 S3000\nG96 G99 S125.7 M3 (S IS A SURFACE SPEED)");
    let before = improved(&program, &lathe(), &goals()).before;
    let finding = before.findings.iter().find(|it| it.code.name() == "VIB-CHIP-UNBROKEN").expect("a whole number");
    let of_speed =
        |cure: &&feedwave_program::Suggestion| cure.value.as_ref().is_some_and(|it| it.name == "spindle_speed");
    assert_eq!(finding.suggestions.iter().find(of_speed), None, "no S in rev/min is a word of this program");
    let one = SearchGoals { frequency_hz: Some([50.0, 50.0]), ..goals().vibration };
    let free = ImprovementGoals { vibration: one, spindle_rev_per_min: Some([800.0, 1_300.0]), ..goals() };
    let improvement = improved(&program, &lathe(), &free);
    is_consistent(&program, &lathe(), &improvement);
    assert!(improvement.holds(), "{:?}", improvement.steps);
    let speed = figure(step(&improvement, ImprovementKind::SpindleSpeed), "spindle speed");
    let word = text(&improvement).split(" S").nth(2).and_then(|rest| rest.split(' ').next()).expect("the word");
    let written = speed_at(word.parse().expect("a number"), 40.0);
    assert!((written - speed.after).abs() < 1e-6 && (800.0..=1_300.0).contains(&written), "{word}: {speed:?}");
    let section = &improvement.after.sections[0];
    assert!((section.chip_spans[0].spindle_rev_per_min - written).abs() < 1e-6);
    assert_eq!(section.broken_share, Some(1.0));
    // A clamp below leaves nothing to propose.
    let clamped = program.replace("G50 S3000", "G50 S1005");
    let higher = ImprovementGoals { spindle_rev_per_min: Some([1_010.0, 1_300.0]), ..free };
    let improvement = improved(&clamped, &lathe(), &higher);
    assert!(!improvement.holds() && improvement.changes.is_empty(), "{:?}", improvement.steps);
}
