//! What was improved is as good as it becomes: improved again, it stays.

use std::borrow::Cow;
use std::convert::Infallible;
use std::fmt::Write;
use std::sync::Arc;

use feedwave_cutting::{
    Improvement, ImprovementGoals, ImprovementOutcome, MachineProfile, PipelineConfig, SearchGoals, Surroundings,
    improve,
};
use feedwave_program::Place;
use proptest::prelude::*;

/// A program alone.
struct Alone;

impl Surroundings for Alone {
    type Error = Infallible;

    fn further(&mut self, _: Place) -> Result<Cow<'_, [u8]>, Infallible> {
        Ok(Cow::Borrowed(&[]))
    }

    fn step(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn improved(program: &[u8], profile: &MachineProfile, goals: &ImprovementGoals) -> Improvement {
    let config = PipelineConfig { interpolation_period_us: 2_000, ..PipelineConfig::new(profile.clone()) };
    match improve(program, &Arc::new(config), goals, &mut Alone) {
        Ok(improvement) => improvement,
        Err(never) => match never {},
    }
}

fn goals() -> [ImprovementGoals; 4] {
    let vibration = SearchGoals { margin: 1.1, speed_tolerance: 0.02, max_feed_override: 1.2, frequency_hz: None };
    let [speeds, stay] = [Some([300.0, 2_500.0]), None];
    [(false, stay), (false, speeds), (true, stay), (true, speeds)].map(|(least_amplitude, spindle_rev_per_min)| {
        ImprovementGoals {
            vibration,
            least_amplitude,
            spindle_rev_per_min,
            max_feed_per_rev_mm: None,
            max_tolerance_mm: None,
            stability: None,
        }
    })
}

/// What is wrong with improving a program once and again.
fn fault(program: &[u8], profile: &MachineProfile, goals: &ImprovementGoals) -> Option<String> {
    let once = improved(program, profile, goals);
    let again = improved(&once.program, profile, goals);
    if again.program != once.program {
        let [from, once, again] = [program, &once.program, &again.program].map(String::from_utf8_lossy);
        return Some(format!("{goals:?}\n{from}\n->\n{once}\n->\n{again}"));
    }
    let mut lines: Vec<String> = String::from_utf8_lossy(program).split('\n').map(str::to_owned).collect();
    for change in once.changes.iter().rev() {
        let start = change.span.column as usize - 1;
        let place = start..start + change.span.length as usize;
        let line = &mut lines[change.span.line as usize - 1];
        if line.get(place.clone()) != Some(&change.old) {
            return Some(format!("{change:?} is not in {line}"));
        }
        line.replace_range(place, &change.new);
    }
    if lines.join("\n").as_bytes() != once.program {
        return Some(format!("{:?} are not all that is different", once.changes));
    }
    let says_so = |step: &&feedwave_cutting::ImprovementStep| {
        (step.outcome == ImprovementOutcome::Changed) == step.changes.is_empty()
    };
    once.steps.iter().find(says_so).map(|step| format!("{step:?}"))
}

#[test]
fn sections_are_planned_at_the_speed_that_another_one_asked_for() {
    let program = "G21 G18 G99 G97 S800 M3\nG0 X30. Z2.\nG200 F70. A0.03137\nG1 Z-11. F0.0127\nG201\nG0 X32.\n\
                   G200 F66. A0.035\nG1 Z-35. F0.0886\nG201\nM30\n";
    for goals in goals() {
        assert_eq!(fault(program.as_bytes(), &MachineProfile::lathe(), &goals), None);
    }
}

#[test]
fn letters_stay_in_the_case_that_they_are_written_in() {
    let program = "g21 g18 g99 g97 s1000 m3\ng0 x30. z2.\ng200 f50. A0.03\ng1 z-11. f0.02\ng201\nm30\n";
    let improvement = improved(program.as_bytes(), &MachineProfile::lathe(), &goals()[0]);
    assert!(!improvement.changes.is_empty(), "{:#?} {:#?}", improvement.steps, improvement.before.findings);
    for change in &improvement.changes {
        assert_eq!(change.new[..1], change.old[..1], "{change:?}");
    }
    let told = improvement.steps.iter().flat_map(|step| &step.changes);
    assert!(told.cloned().eq(improvement.changes.iter().cloned()));
    assert_eq!(fault(program.as_bytes(), &MachineProfile::lathe(), &goals()[0]), None);
}

#[test]
fn every_program_of_the_fixtures_is_improved_once_and_for_all() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures");
    let mut changed = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let program = match path.extension() {
            Some(extension) if extension == "nc" => std::fs::read(&path).unwrap(),
            _ => continue,
        };
        if program.len() > 4_096 {
            continue;
        }
        for goals in goals() {
            assert_eq!(fault(&program, &MachineProfile::lathe(), &goals), None, "{}", path.display());
            changed += usize::from(!improved(&program, &MachineProfile::lathe(), &goals).changes.is_empty());
        }
    }
    assert!(changed >= 2, "{changed}");
}

/// Frequency, amplitude, feed and length of a section, and the spindle speed that is written before it.
type Section = (f64, f64, f64, f64, Option<f64>);

fn text(sections: &[Section]) -> String {
    let mut text = "G21 G18 G99 G97 S800 M3\nG0 X30. Z2.\n".to_owned();
    for (frequency_hz, amplitude_mm, feed_mm, length_mm, speed) in sections {
        if let Some(speed) = speed {
            writeln!(text, "S{speed}").unwrap();
        }
        writeln!(text, "G200 F{frequency_hz} A{amplitude_mm}\nG1 W-{length_mm} F{feed_mm}\nG201\nG0 U2.\nG0 Z2.")
            .unwrap();
    }
    text + "M30\n"
}

fn sections() -> impl Strategy<Value = Vec<Section>> {
    let rounded = |range: std::ops::Range<f64>| range.prop_map(|value| (1e4 * value).round() / 1e4);
    let speed = prop::option::weighted(0.4, (500..1_500_u32).prop_map(f64::from));
    let frequency = (20.0..60.0_f64).prop_map(f64::round);
    prop::collection::vec((frequency, rounded(0.005..0.06), rounded(0.005..0.06), rounded(1.0..20.0), speed), 1..4)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn improving_twice_is_improving_once(sections in sections(), which in 0..4_usize) {
        let fault = fault(text(&sections).as_bytes(), &MachineProfile::lathe(), &goals()[which]);
        prop_assert!(fault.is_none(), "{}", fault.unwrap_or_default());
    }
}
