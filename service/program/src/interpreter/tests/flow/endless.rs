//! Bounds of executed blocks, and loops that never end: each finding names its loop.

use super::*;

/// The one finding of a program that comes to a bound.
#[track_caller]
fn bounded(program: &str, settings: &LanguageSettings) -> Finding {
    let settings = LanguageSettings { max_still_blocks: 1_000, max_executed_blocks: 5_000, ..settings.clone() };
    let (_, findings) = ends(&format!("{program}\n"), &settings);
    let [finding] = &findings.into_findings()[..] else { panic!("{program}") };
    assert_eq!(finding.code.name(), "PRG-ENDLESS", "{program}");
    finding.clone()
}

fn value(finding: &Finding, name: &str) -> f64 {
    finding.values.iter().find(|value| value.name == name).map_or(f64::NAN, |value| value.value)
}

#[test]
fn a_loop_is_bounded_by_blocks_and_by_blocks_without_motion() {
    let settings = LanguageSettings { max_still_blocks: 1_000, max_executed_blocks: 5_000, ..LanguageSettings::mill() };
    let (_, findings) = ends("#1=0\nWHILE [#1 LT 1] DO1\n#2=#2+1\nEND1\nM30\n", &settings);
    let finding = &findings.into_findings()[0];
    assert_eq!((finding.code.name(), finding.span.line), ("PRG-ENDLESS", 2), "the loop is named");
    assert!(finding.message.contains("without any motion"), "{}", finding.message);
    let (points, findings) = ends("#1=0\nWHILE [#1 GE 0] DO1\nG91 G0 X1\n#1=#1+1\nEND1\nM30\n", &settings);
    assert!(points.len() > 1_000 && points.len() <= 5_000, "{}", points.len());
    assert_eq!(findings.into_findings()[0].code, "PRG-ENDLESS");
}

// As long as its table of loops.
#[test]
fn the_loop_in_which_a_bound_is_reached_is_named_with_its_first_block() {
    let linuxcnc = LanguageSettings::linuxcnc();
    let mill = LanguageSettings::mill();
    for (settings, program, place, first, name) in [
        (
            &mill,
            "G0 X1\nN10 #1=#1+1\nIF [#1 LT 9999] GOTO 10\nM30",
            3,
            2,
            "the loop that the jump on line 3 makes, back to line 2",
        ),
        // The inner loop ends every time: it is the outer one that goes on.
        (
            &mill,
            "N10 #2=0\nN20 #2=#2+1\nIF [#2 LT 5] GOTO 20\n#3=#3+1\nGOTO 10\nM30",
            5,
            1,
            "the loop that the jump on line 5 makes, back to line 1",
        ),
        (
            &mill,
            "DO1\n#2=0\nWHILE [#2 LT 5] DO2\n#2=#2+1\nEND2\n#3=#3+1\nEND1\nM30",
            1,
            1,
            "the loop DO1 … END1 from line 1 to line 7",
        ),
        (
            &mill,
            "#1=1\nDO1\nN10 #2=0\nN20 #2=#2+1\nIF [#2 LT 5] GOTO 20\n#3=#3+1\nEND1\nM30",
            2,
            2,
            "the loop DO1 … END1 from line 2 to line 7",
        ),
        (&mill, "M98 P100 L99999\nM30\nO100\n#1=#1+1\nM99", 1, 3, "the program from line 3 on that line 1 calls"),
        (&mill, "N10 #1=#1+1\nM98 P100\nM30\nO100\nM99 P10", 2, 1, "the jump on line 2 makes, back to line 1"),
        (
            &linuxcnc,
            "o7 while [1]\n#1=[#1+1]\no7 endwhile\nM2",
            1,
            1,
            "the loop o7 while … endwhile from line 1 to line 3",
        ),
        (&linuxcnc, "o7 do\n#1=[#1+1]\no7 while [1]\nM2", 1, 1, "the loop o7 do … while from line 1 to line 3"),
        (
            &linuxcnc,
            "o<many> repeat [100000]\n#1=[#1+1]\no<many> endrepeat\nM2",
            1,
            1,
            "the loop o<many> repeat … endrepeat from line 1 to line 3",
        ),
    ] {
        let finding = bounded(program, settings);
        assert!(finding.message.contains("without any motion in "), "{program}: {}", finding.message);
        assert!(finding.message.contains(name), "{program}: {}", finding.message);
        assert_eq!((finding.span.line, value(&finding, "first_line")), (place, f64::from(first)), "{program}");
        assert_eq!(value(&finding, "limit"), 1_000.0, "{program}");
        let round = value(&finding, "iteration");
        assert!((50.0..=1_001.0).contains(&round), "{program}: round {round}");
        assert!(finding.message.contains(&format!("{name}, round {round}, ")), "{program}: {}", finding.message);
        assert_eq!(finding.first.as_ref().map(|first| first.number as f64), Some(round), "{program}");
        let related: Vec<_> = finding.related.iter().filter(|place| !place.is_call).map(|it| it.span.line).collect();
        assert_eq!(related.contains(&first), first != place, "{program}: {related:?}");
    }
}

#[test]
fn jumps_whose_lines_cross_are_one_loop() {
    let finding = bounded("N10 #1=#1+1\nN20 #2=#2+1\nIF [#2 MOD 2 EQ 0] GOTO 10\nGOTO 20\nM30", &mill());
    assert!(finding.message.contains("back to line 1"), "{}", finding.message);
    assert!((150.0..=500.0).contains(&value(&finding, "iteration")), "{finding:?}");
}

#[test]
fn the_bound_of_all_blocks_names_the_loop_that_took_most_of_them() {
    let finding = bounded("G91\nN10 G0 X1\n#2=0\nDO1\n#2=#2+1\nIF [#2 EQ 3] GOTO 20\nEND1\nN20 GOTO 10\nM30", &mill());
    assert!(
        finding.message.contains("5001 blocks were executed in the loop that the jump on line 8"),
        "{}",
        finding.message
    );
    assert_eq!(value(&finding, "first_line"), 2.0);
}

#[test]
fn a_loop_in_a_called_program_is_named_with_the_calls_that_led_there() {
    let finding = bounded("G0 X1\nM98 P100\nM30\nO100\nN10 #1=#1+1\nGOTO 10", &mill());
    assert_eq!((finding.span.line, value(&finding, "first_line")), (6, 5.0));
    let calls: Vec<_> = finding.related.iter().filter(|place| place.is_call).map(|place| place.span.line).collect();
    assert_eq!(calls, [2]);
}

#[test]
fn blocks_without_motion_are_bounded_in_loops_only() {
    let settings = LanguageSettings { max_still_blocks: 10, ..LanguageSettings::mill() };
    let long = "#1=#1+1\n".repeat(50);
    let (points, findings) = ends(&format!("M98 P100\nG0 X#1\nM30\nO100\n{long}M99\n"), &settings);
    assert!(findings.findings().is_empty(), "{findings:?}");
    assert_eq!(points[0][0], 50.0);
}

#[test]
fn a_jump_back_in_every_run_of_a_program_is_no_loop() {
    let jumps = "O100\nGOTO 20\nN10 GOTO 30\nN20 GOTO 10\nN30 M99";
    assert_eq!(mill_xs(&format!("M98 P100 L3\nM98 P100\nG0 X7\nM30\n{jumps}")), [7.0]);
    // A jump into the caller is one where it comes to the same state again.
    assert_eq!(mill_xs("N10 #1=#1+1\nM98 P100\nG0 X#1\nM30\nO100\nIF [#1 LT 3] M99 P10\nM99"), [3.0]);
    let finding = bounded("N10 M98 P100\nM30\nO100\nM99 P10", &mill());
    assert!(finding.message.starts_with("no variable has changed since the last round of"), "{}", finding.message);
    // On to the block behind the call is no jump back.
    assert_eq!(mill_xs("M98 P100 L2\nN10 G0 X1\nM30\nO100\nM99 P10"), [1.0]);
}

#[test]
fn a_loop_of_codes_that_change_nothing_is_endless_at_once() {
    let mill = LanguageSettings { max_executed_blocks: 30, ..LanguageSettings::mill() };
    let linuxcnc = LanguageSettings { max_executed_blocks: 30, ..LanguageSettings::linuxcnc() };
    for (settings, program, line) in [
        (&mill, "G0 X1\nWHILE [1 EQ 1] DO1\nG10 L2 P1 X5\nEND1\nM30", 2),
        (&mill, "DO1\nM8\nG90 G4 P10\nM9\nEND1\nM30", 1),
        (&mill, "N1 G10 L2 P1 X5\nG92 X0\nGOTO 1\nM30", 3),
        (&linuxcnc, "o1 while [1]\nG10 L2 P1 X5\no1 endwhile\nM2", 1),
        (&linuxcnc, "o1 do\nM7\no1 while [1]\nM2", 1),
    ] {
        let (_, findings) = ends(&format!("{program}\n"), settings);
        let findings = findings.into_findings();
        let found: Vec<_> = findings.iter().map(|it| (it.code.name(), it.span.line)).collect();
        assert_eq!(found, [("PRG-ENDLESS", line)], "{program}");
        let message = &findings[0].message;
        let starts = ["nothing has changed", "no variable has changed"].iter().any(|it| message.starts_with(it));
        assert!(starts, "{program}: {message}");
    }
    // What changes something with every round ends by itself, or at the bound of blocks without motion.
    let counts = "WHILE [#5221 LT 3] DO1\nG91 G10 L2 P1 X1\nEND1\nG90 G0 X7";
    assert_eq!(mill_xs(counts), [7.0]);
    let still = LanguageSettings { max_still_blocks: 1_000, ..LanguageSettings::mill() };
    let (_, findings) = ends("DO1\nG91 G10 L2 P1 X1\nEND1\nM30\n", &still);
    let finding = &findings.into_findings()[0];
    assert_eq!((finding.code.name(), finding.span.line), ("PRG-ENDLESS", 1));
    assert!(finding.message.contains("without any motion"), "{}", finding.message);
}

#[test]
fn a_loop_that_moves_on_and_decides_nothing_is_endless_at_once() {
    let mill = LanguageSettings { max_executed_blocks: 2_000, ..LanguageSettings::mill() };
    let linuxcnc = LanguageSettings { max_executed_blocks: 2_000, ..LanguageSettings::linuxcnc() };
    for (settings, program, line) in [
        (&mill, "G91\nN1 G0 X1\nGOTO 1\nM30", 3),
        (&mill, "G91\nDO1\nG0 X1\nEND1\nM30", 2),
        (&mill, "#1=3\nWHILE [#1 LT 5] DO1\nG91 G0 X#1\nEND1\nM30", 2),
        (&mill, "G91\nN1 M98 P100\nGOTO 1\nM30\nO100\nG0 X1\nM99", 3),
        (&linuxcnc, "G91\no1 while [1]\nG0 X1\no1 endwhile\nM2", 2),
    ] {
        let (points, findings) = ends(&format!("{program}\n"), settings);
        let findings = findings.into_findings();
        let found: Vec<_> = findings.iter().map(|it| (it.code.name(), it.span.line)).collect();
        assert_eq!(found, [("PRG-ENDLESS", line)], "{program}\n{findings:#?}");
        assert!(points.len() <= 3, "{program}: {} moves", points.len());
    }
    // What asks where the tool is, or what the loop sets, may end.
    for program in [
        "G91\nN1 G0 X1\nIF [#5001 LT 7] GOTO 1\nG90 X9\nM30",
        "G91\n#1=0\nN1 G0 X1\n#1=#5001\nIF [#1 LT 7] GOTO 1\nG90 X9\nM30",
        "G91\nWHILE [#5001 LT 7] DO1\nG0 X1\nEND1\nG90 X9\nM30",
    ] {
        assert_eq!(mill_xs(program), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 9.0], "{program}");
    }
    let (points, findings) = ends("G91\no1 while [#<_x> LT 2]\nG0 X1\no1 endwhile\nM2\n", &linuxcnc);
    assert_eq!((points.len(), findings.into_findings()), (2, vec![]));
}

#[test]
fn a_loop_that_moves_and_comes_to_a_state_again_is_endless_at_once() {
    let mill = LanguageSettings { max_executed_blocks: 2_000, ..LanguageSettings::mill() };
    let linuxcnc = LanguageSettings { max_executed_blocks: 2_000, ..LanguageSettings::linuxcnc() };
    for (settings, program, line, most) in [
        (&mill, "N10 G0 X1\nX2\nGOTO 10", 3, 6),
        (&mill, "WHILE [1 EQ 1] DO1\nG0 X1\nX2\nEND1\nM30", 1, 6),
        (&mill, "G0 X9\nN1 X1\nM98 P100\nGOTO 1\nM30\nO100\nG91 X1\nG90\nM99", 4, 7),
        (&linuxcnc, "o1 while [1]\nG0 X1\nX2\no1 endwhile\nM2", 1, 6),
        (&linuxcnc, "o1 do\nG0 X1\nX2\no1 while [1]\nM2", 1, 6),
        (&linuxcnc, "o1 while [1]\nG0 X1\nX2\no1 continue\no1 endwhile\nM2", 1, 6),
        // An inner loop counts in every round of it.
        (&mill, "DO1\n#1=0\nWHILE [#1 LT 3] DO2\nG0 X#1\n#1=#1+1\nEND2\nEND1\nM30", 1, 30),
        // The state alternates: X1 and X2, then rounds of three.
        (&mill, "#1=1\nDO1\nG0 X#1\n#1=3-#1\nEND1\nM30", 2, 20),
        (&mill, "#1=0\nDO1\nG0 X#1\n#1=#1+1\nIF [#1 LT 3] GOTO 5\n#1=0\nN5\nEND1\nM30", 2, 40),
        // Two jumps in turn.
        (&mill, "N1 #1=1-#1\nG0 X#1\nIF [#1 EQ 1] GOTO 1\nGOTO 1\nM30", 4, 40),
    ] {
        let (points, findings) = ends(&format!("{program}\n"), settings);
        let findings = findings.into_findings();
        let found: Vec<_> = findings.iter().map(|it| (it.code.name(), it.span.line)).collect();
        assert_eq!(found, [("PRG-ENDLESS", line)], "{program}\n{findings:#?}");
        assert!(findings[0].message.ends_with("It never ends"), "{program}: {}", findings[0].message);
        assert!(points.len() <= most, "{program}: {} moves", points.len());
    }
}

#[test]
fn a_loop_that_ends_is_none_however_often_it_comes_to_a_place() {
    // The position is the same in every round, a variable, an offset or a tool is not.
    assert_eq!(mill_xs("#1=0\nWHILE [#1 LT 90] DO1\nG0 X1\nX0\n#1=#1+1\nEND1").len(), 180);
    assert_eq!(mill_xs("WHILE [#5221 LT 20] DO1\nG0 X50\nG53 X0\nG91 G10 L2 P1 X1\nG90\nEND1").len(), 40);
    assert_eq!(mill_xs("G91\nWHILE [#5041 LT 40] DO1\nG0 X1\nEND1").len(), 40, "no variable changes");
    let nested =
        "G91\no1 while [#1 LT 5]\n#1=[#1+1]\n#2=0\no2 while [#2 LT 20]\nG0 X1\n#2=[#2+1]\no2 endwhile\no1 endwhile";
    assert_eq!(linuxcnc_xs(nested).len(), 100);
    // A macro that is in force for some rounds only: the state but for it is the same.
    let modal = "#1=0\nN1 G0 X1\nX0\n#1=#1+1\nIF [#1 LT 30] GOTO 1";
    assert_eq!(mill_xs(modal).len(), 60);
}
