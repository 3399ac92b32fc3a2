//! M codes of the machine: section 9 of the page on the program language.

use super::*;
use crate::{DwellUnit, MachineCode, MachineEffect, MachineTiming, UnlistedMachineCodes};

fn code(number: u32, effect: MachineEffect, timing: MachineTiming, words: &str) -> MachineCode {
    MachineCode { number, effect, timing, words: words.to_owned() }
}

#[test]
fn an_unlisted_code_is_handed_on_and_noted_once() {
    for settings in [lathe(), mill()] {
        check(
            &settings,
            "M10\nM11\nG0 X2 M10\nM1234",
            &format!(
                "M10 None\nM11 None\nM10 None\nrapid 0 -> X{}\nM1234 None\n\
                 i 1:1+3 PRG-MACHINE-CODE\ni 2:1+3 PRG-MACHINE-CODE\ni 4:1+5 PRG-MACHINE-CODE",
                if settings.x_word == crate::XWord::Diameter { 1 } else { 2 }
            ),
        );
    }
    let strict = LanguageSettings { unlisted_machine_codes: UnlistedMachineCodes::Error, ..mill() };
    check(&strict, "M10\nM10", "! 1:1+3 PRG-MACHINE-CODE\n! 2:1+3 PRG-MACHINE-CODE");
    // LinuxCNC knows every code of its own and of its users, so that others are none.
    check(&linuxcnc(), "M10", "! 1:1+3 PRG-UNKNOWN-CODE");
    check(&linuxcnc(), "M200", "! 1:1+4 PRG-UNKNOWN-CODE");
    for settings in [mill(), linuxcnc()] {
        check(&settings, "M3.5", "! 1:1+4 PRG-UNKNOWN-CODE");
        check(&settings, "M-4", "! 1:1+3 PRG-UNKNOWN-CODE");
    }
}

#[test]
fn at_most_256_unlisted_codes_are_noted() {
    let program: String = (400..700).map(|number| format!("M{number}\n")).collect();
    let (operations, findings) = interpret(format!("{program}M30").as_bytes(), mill());
    assert_eq!(operations.len(), 301);
    assert_eq!(findings.findings().len(), 256);
}

#[test]
fn the_profile_lists_codes_with_effect_timing_and_words() {
    let machine_codes = vec![
        code(10, MachineEffect::Dwell { seconds: 1.5 }, MachineTiming::Before, ""),
        code(11, MachineEffect::Barrier, MachineTiming::After, ""),
        code(88, MachineEffect::Stop, MachineTiming::After, "PQ"),
        // In place of the dialect's own.
        code(19, MachineEffect::None, MachineTiming::Before, ""),
    ];
    for settings in [mill(), LanguageSettings { dwell_p_unit: DwellUnit::Milliseconds, ..linuxcnc() }] {
        let settings = LanguageSettings { machine_codes: machine_codes.clone(), ..settings };
        check(
            &settings,
            "G0 X1 M11 M10\nM88 P3 Q.5\nM19\nM88 R1",
            "M10 Dwell { seconds: 1.5 }\nrapid 0 -> X1\nM11 Barrier\nM88 P3 Q0.5 Stop\nM19 None\n! 4:5+2 PRG-WORD-UNUSED",
        );
    }
}

#[test]
fn how_many_codes_a_block_takes() {
    // FANUC: up to three. LinuxCNC: four, each of another group.
    let listed = (10..17).map(|number| code(number, MachineEffect::None, MachineTiming::Before, "")).collect();
    let listed = LanguageSettings { machine_codes: listed, ..mill() };
    check(&listed, "M10 M11 M12\nM13 M14 M15 M16", "M10 None\nM11 None\nM12 None\n! 2:13+3 PRG-GROUP-CONFLICT");
    check(&linuxcnc(), "M8 M3 S100 M62 P1 M48", "M62 P1 None\nspindle cw 100\ncoolant mist false flood true\nM48 None");
    check(&linuxcnc(), "M62 P1 M6 T1 M3 M8 M48", "! 1:20+3 PRG-GROUP-CONFLICT");
    for (pair, place) in
        [("M7 M8", "4+2"), ("M3 M19", "4+3"), ("M70 M3", "5+2"), ("M62 M65 P1", "5+3"), ("M48 M50", "5+3")]
    {
        check(&linuxcnc(), pair, &format!("! 1:{place} PRG-GROUP-CONFLICT"));
    }
    // A repeated code of the machine is no code of one group with itself on FANUC controls.
    check(&mill(), "M3 M5", "! 1:4+2 PRG-GROUP-CONFLICT");
}

#[test]
fn codes_of_linuxcnc() {
    check(
        &linuxcnc(),
        "M48\nM49\nM50\nM51 P0\nM52 P1\nM53 P0\nM62 P1\nM63 P2\nM64 P3\nM65 P4\nM67 E1 Q2.5\nM68 E0 Q-1\nM100 P3 Q4\nM199\nM60",
        "M48 None\nM49 None\nM50 None\nM51 P0 None\nM52 P1 None\nM53 P0 None\nM62 P1 None\nM63 P2 None\nM64 P3 None\nM65 P4 None\n\
         M67 E1 Q2.5 None\nM68 E0 Q-1 None\nM100 P3 Q4 Barrier\nM199 Barrier\nM60 Stop",
    );
    check(&linuxcnc(), "M66 P1 L3 Q2", "M66 L3 P1 Q2 Barrier\ni 1:1+3 PRG-INPUT-UNKNOWN");
    check(&linuxcnc(), "M61 Q5\nG0 X1", "tool 5.0\nrapid 0 -> X1");
    // Words that are missing or out of range, as the interpreter of LinuxCNC refuses them.
    for program in [
        "M62",
        "M66 L0",
        "M66 P1 E1 L0",
        "M66 E1 L1 Q1",
        "M66 P1 L3",
        "M67 Q1",
        "M61",
        "M61 Q-1",
        "M19 R400",
        "M19 R-1",
        "M19 R10 P3",
        "M19 R10 Q0",
    ] {
        let length = program.split(' ').next().map_or(0, str::len);
        check(&linuxcnc(), program, &format!("! 1:1+{length} PRG-MACHINE-WORD"));
    }
    check(&linuxcnc(), "M48 P1", "! 1:5+2 PRG-WORD-UNUSED");
    check(&linuxcnc(), "M8 P1", "! 1:4+2 PRG-WORD-UNUSED");
}

#[test]
fn a_tool_change_in_linuxcnc_stops_the_spindle_and_leaves_the_tool_selected() {
    check(&linuxcnc(), "M3 S100\nT2 M6\nM6", "spindle cw 100\nspindle off 100\ntool 2.0\ntool 2.0");
    check(&linuxcnc(), "M6", "tool 0.0\nw 1:1+2 PRG-TOOL-MISSING");
    check(&mill(), "M3 S100\nT2 M6\nM6", "spindle cw 100\ntool 2.0\n! 3:1+2 PRG-TOOL-MISSING");
}

#[test]
fn orientation_stops_the_spindle() {
    check(
        &linuxcnc(),
        "M3 S100\nM19 R30 P1 Q2\nG95 F1 G1 X1",
        "spindle cw 100\nspindle off 100\nM19 P1 Q2 R30 Barrier\n! 3:1+12 PRG-SPINDLE-STOPPED",
    );
    // On FANUC controls S may say the angle; it is no speed then.
    check(&mill(), "M3 S100\nM19 S90\nM3", "spindle cw 100\nspindle off 100\nM19 S90 Barrier\nspindle cw 100");
}

#[test]
fn rigid_tapping_lasts_until_the_end_of_the_cycles() {
    let state_after = |program: &str| {
        let mut interpreter = Interpreter::new(mill());
        let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
        for line in program.lines() {
            let _ = interpreter.read_line(format!("{line}\n").as_bytes(), false, &mut operations, &mut findings);
        }
        assert!(findings.findings().is_empty(), "{findings:?}");
        interpreter.state.machine.rigid_tapping
    };
    assert!(state_after("M29 S500"));
    assert!(!state_after("M29 S500\nG80"));
    check(&mill(), "M3 S100\nM29 S500", "spindle cw 100\nspindle cw 500\nM29 Barrier");
}

#[test]
fn saved_modes_come_back() {
    // Motion mode and position are not among them (LinuxCNC, section 1).
    check(
        &linuxcnc(),
        "G1 F100 M7\nM70\nG20 G91 G18 M9\nG0 X1\nM72\nX5\nG1 X7",
        "coolant mist true flood false\ncoolant mist false flood false\nrapid 0 -> X25.4\n\
         coolant mist true flood false\nrapid X25.4 -> X5\nline X5 -> X7 @100/min",
    );
    check(&linuxcnc(), "M3 S10\nM70\nM5 S20\nM72\nM73", "spindle cw 10\nspindle cw 20\nspindle off 20\nspindle cw 10");
    // The modes are those behind F and S of their block.
    check(&linuxcnc(), "M70 F200\nF100\nM72\nG1 X1", "line 0 -> X1 @200/min");
    check(&linuxcnc(), "F100\nM70\nF200\nG93\nM72\nG1 X5", "line 0 -> X5 @100/min");
    check(&linuxcnc(), "M72", "! 1:1+3 PRG-MODES-NOT-SAVED");
    check(&linuxcnc(), "M70\nM71\nM72", "! 3:1+3 PRG-MODES-NOT-SAVED");
    let offsets =
        LanguageSettings { work_offsets: [[0.0; 9], [5.0; 9], [0.0; 9], [0.0; 9], [0.0; 9], [0.0; 9]], ..linuxcnc() };
    check(
        &offsets,
        "G55\nM70\nG54\nM72\nG0 X1",
        "rapid X-5 Y-5 Z-5 A-5 B-5 C-5 U-5 V-5 W-5 -> X1 Y-5 Z-5 A-5 B-5 C-5 U-5 V-5 W-5",
    );
}

#[test]
fn each_called_program_has_saved_modes_of_its_own() {
    let sub = "o1 sub\nM73\nG91 G20 S50\nG0 X1\no1 endsub\n";
    check(
        &linuxcnc(),
        &format!("{sub}M3 S10\no1 call\nG0 X5"),
        "spindle cw 10\nspindle cw 50\nrapid 0 -> X25.4\nspindle cw 10\nrapid X25.4 -> X5",
    );
    // What the caller has saved is its own, and comes back to it.
    check(&linuxcnc(), "o1 sub\nM72\no1 endsub\nM70\no1 call", "! 2:1+3 PRG-MODES-NOT-SAVED");
    check(
        &linuxcnc(),
        "o1 sub\nM70\nG91\no1 endsub\nM70\no1 call\nG0 X1\nX1\nM72\nX1",
        "rapid 0 -> X1\nrapid X1 -> X2\nrapid X2 -> X1",
    );
    check(&linuxcnc(), "o1 sub\nM73\nG91\nM71\no1 endsub\no1 call\nG0 X1\nX1", "rapid 0 -> X1\nrapid X1 -> X2");
}

#[test]
fn what_makes_a_profile_unusable() {
    let fields = |codes: Vec<MachineCode>| {
        let settings = LanguageSettings { machine_codes: codes, ..mill() };
        crate::machine_code_problems(&settings).into_iter().map(|(field, _)| field).collect::<Vec<_>>()
    };
    let plain = |number| code(number, MachineEffect::None, MachineTiming::Before, "");
    assert!(fields(vec![plain(10), plain(48), plain(99_999_999)]).is_empty());
    assert_eq!(fields(vec![plain(3)]), ["machine_codes[0].number"]);
    assert_eq!(fields(vec![plain(33)]), ["machine_codes[0].number"], "thinning");
    assert_eq!(fields(vec![plain(10), plain(10)]), ["machine_codes[1].number"]);
    assert_eq!(fields(vec![plain(100_000_000)]), ["machine_codes[0].number"]);
    let dwell = code(10, MachineEffect::Dwell { seconds: -1.0 }, MachineTiming::Before, "");
    assert_eq!(fields(vec![dwell]), ["machine_codes[0].dwell_s"]);
    assert_eq!(fields(vec![code(10, MachineEffect::None, MachineTiming::Before, "Pm")]), ["machine_codes[0].words"]);
    assert_eq!(fields((0..257).map(|number| plain(1_000 + number)).collect()), ["machine_codes"]);
}

#[test]
fn the_words_of_an_unlisted_code_are_its_own() {
    let (operations, findings) = interpret(b"M133 P1000\nG0 X1\nM35 P2 Q3\nM30\n", LanguageSettings::mill());
    let findings = findings.into_findings();
    let codes: Vec<_> = findings.iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes, ["PRG-MACHINE-CODE", "PRG-MACHINE-CODE"], "{findings:?}");
    assert!(findings[1].suggestions[0].message.ends_with("its words PQ"), "{findings:?}");
    let words = operations.iter().find_map(|operation| match &operation.kind {
        OperationKind::MachineCode(command) => {
            Some(command.words.iter().map(|word| (word.letter, word.value)).collect())
        }
        _ => None,
    });
    assert_eq!(words, Some(vec![('P', 1000.0)]));
    // Beside a code of the control a word may be that code's.
    let (_, findings) = interpret(b"G4 P10 M133\nM30\n", LanguageSettings::mill());
    assert_eq!(findings.into_findings().len(), 1);
}
