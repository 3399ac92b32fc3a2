//! Drilling on lathes, along Z and along X.

use super::*;

#[test]
fn fanuc_lathe_along_z_and_along_x() {
    // R is a distance from the level of the start.
    check(
        &turning(Some(PeckReturn::RLevel)),
        "M3 S1000\nG0 X0 Z5.\nG83 Z-12. R-3. Q5000 F0.1\nG80\nG0 X20.",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z2
         rapid Z2 -> Z-2
         line Z-2 -> Z-8 @0.1/rev
         rapid Z-8 -> Z2
         rapid Z2 -> Z-7
         line Z-7 -> Z-12 @0.1/rev
         rapid Z-12 -> Z5
         rapid Z5 -> X10 Z5",
    );
    check(
        &turning(Some(PeckReturn::Back)),
        "M3 S1000\nG0 X0 Z5.\nG83 W-10. R-3. Q5000 F0.1",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z-2
         line Z-2 -> Z-8 @0.1/rev
         rapid Z-8 -> Z5",
    );
    check(
        &turning(None),
        "M3 S1000\nG0 X50. Z-20.\nG89 X30. R-5. P100 F0.1\nG87 Z-30. C90.",
        "spindle cw 1000
         rapid 0 -> X25 Z-20
         rapid X25 Z-20 -> X20 Z-20
         line X20 Z-20 -> X15 Z-20 @0.1/rev
         dwell 0.1
         line X15 Z-20 -> X20 Z-20 @0.1/rev
         rapid X20 Z-20 -> X25 Z-20
         rapid X25 Z-20 -> X25 Z-30 C90
         rapid X25 Z-30 C90 -> X20 Z-30 C90
         line X20 Z-30 C90 -> X15 Z-30 C90 @0.1/rev
         dwell 0.1
         rapid X15 Z-30 C90 -> X25 Z-30 C90",
    );
    let go = "M3 S1000\nG0 X0 Z5.\n";
    let went = "spindle cw 1000\nrapid 0 -> Z5\n";
    for (program, expected) in [
        ("G83 Z-12. R-3. Q5000 F0.1", "! 3:1+25 PRG-CYCLE-SETTING"),
        ("G81 Z-12. R-3. F0.1", "! 3:1+19 PRG-CYCLE-UNDEFINED"),
    ] {
        check(&turning(None), &format!("{go}{program}"), &format!("{went}{expected}"));
    }
}

#[test]
fn a_haas_lathe_drills_as_a_mill() {
    let settings = LanguageSettings { drilling: haas().drilling, ..lathe() };
    check(
        &settings,
        "M3 S1000\nG0 X0 Z5.\nG83 Z-6. R2. Q5. F0.1\nG81 Z-5. R2.",
        "spindle cw 1000
         rapid 0 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-3 @0.1/rev
         rapid Z-3 -> Z2
         rapid Z2 -> Z-2
         line Z-2 -> Z-6 @0.1/rev
         rapid Z-6 -> Z5
         rapid Z5 -> Z2
         line Z2 -> Z-5 @0.1/rev
         rapid Z-5 -> Z5",
    );
}

#[test]
fn the_bottom_may_come_in_a_later_block() {
    let a = turning(Some(PeckReturn::RLevel));
    let path = |program: &str| render(format!("G98 M3 S500\nG0 Z5.\n{program}\nM30\n"), &a);
    let one = path("G83 Z-10. R-3. Q5000 F50\nG80");
    assert!(!one.contains("PRG-CYCLE") && one.contains("line Z2 -> Z-3 @50/min"), "{one}");
    for two in ["G83 R-3. Q5000 F50\nZ-10.\nG80", "G83 R-3. F50\nG83 Z-10. Q5000\nG80"] {
        assert_eq!(path(two), one, "{two}");
    }
    // Without R from the level of the start.
    let found = path("G83 Z-10. Q5000 F50\nG80");
    assert!(found.contains("line Z5 -> 0 @50/min") && found.contains("i 3:1+19 PRG-CYCLE-NO-R"), "{found}");
}

#[test]
fn r_that_is_meant_as_a_level_is_told_as_a_distance() {
    let a = turning(Some(PeckReturn::RLevel));
    let cure = |program: &str, settings: &LanguageSettings| {
        let (_, findings) = interpret(format!("{program}\nM30\n").as_bytes(), settings.clone());
        let found = findings.findings().iter().find(|it| it.code.name() == "PRG-CYCLE-LEVEL");
        found.expect(program).suggestions[0].message.clone()
    };
    let said = "R counts from the level of the start here: where it is meant as a level, write R";
    let is_said = |program: &str, distance: &str| cure(program, &a).starts_with(&format!("{said}{distance}, or set"));
    assert!(is_said("M3 S500\nG0 Z5.\nG83 Z-10. R2. Q5000 F.1", "-3.0"));
    assert!(is_said("G20 M3 S500\nG0 Z.5\nG83 Z-1. R.1 Q500 F.01", "-0.4"));
    let levels = LanguageSettings { drilling: DrillingSettings { lathe_r_is_level: true, ..a.drilling }, ..a.clone() };
    let path = |settings: &LanguageSettings, r: &str| {
        render(format!("M3 S500\nG0 Z5.\nG83 Z-10. {r} Q5000 F.1\nG80\nM30\n"), settings)
    };
    let distance = path(&a, "R-3.");
    assert!(!distance.contains("PRG"), "{distance}");
    assert_eq!(path(&levels, "R2."), distance.replace(" R-3.", " R2."));
    // R7 is no level that the tool is above.
    assert!(!cure("M3 S500\nG0 Z5.\nG83 Z-10. R7. Q5000 F.1", &a).contains("counts"));
}

#[test]
fn a_tool_between_r_and_bottom_is_told_so() {
    let (_, findings) = interpret(b"M3 S500\nG0 X0 Z2.\nG83 Z10. R-1. F.1\nM30\n", turning(None));
    let message = &findings.findings()[0].message;
    assert_eq!(message, "the R level 1 and the bottom 10 of G83 are on different sides of the tool, which is at 2");
}

/// The M code of a cycle clamps the C axis, which turns to the hole first.
#[test]
fn an_m_code_of_a_cycle_clamps_behind_the_positioning_of_each_hole() {
    let clamp = crate::MachineCode {
        number: 31,
        effect: crate::MachineEffect::None,
        timing: crate::MachineTiming::default(),
        words: String::new(),
    };
    let settings = LanguageSettings { machine_codes: vec![clamp], ..turning(None) };
    let found = render(
        "M3 S500\nG0 X50. Z2.\nG85 X20. C30. Z-20. R-1. F.1 M31\nC90. M31\nH30. K2 M31\nG80 M31\nM30\n",
        &settings,
    );
    assert!(!found.contains("PRG"), "{found}");
    let lines: Vec<_> = found.lines().collect();
    let clamps: Vec<_> = lines.iter().enumerate().filter(|(_, line)| line.contains("31")).map(|(at, _)| at).collect();
    assert_eq!(clamps.len(), 5, "{found}");
    for (at, angle) in clamps.iter().zip(["C30", "C90", "C120", "C150"]) {
        assert!(lines[at - 1].starts_with("rapid") && lines[at - 1].ends_with(angle), "{found}");
        assert!(lines[at + 1].contains("-> X10 Z1 "), "{found}");
    }
}
