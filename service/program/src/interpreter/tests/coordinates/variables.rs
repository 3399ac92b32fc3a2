//! Work offsets as variables of LinuxCNC: as its interpreter does, positions seen in experiments with it.

use super::*;

fn x(values: &[f64]) -> Vec<[f64; 3]> {
    values.iter().map(|x| [*x, 0.0, 0.0]).collect()
}

#[test]
fn variables_of_the_system_in_force_wait_for_another_system() {
    // Neither the next block nor the code of the same system looks at them.
    let program = "G0 X1\n#5221=10\nX2\nG54\nX3\nG55\nX4\nG54 X5";
    ends(&linuxcnc(), program, &x(&[1.0, 2.0, 3.0, 4.0, 15.0]));
    resumes(&linuxcnc(), program);
    ends(&linuxcnc(), "#5241=7\nG0 G55 X2\n#5241=9\nX3\nG53 X0\nX3", &x(&[9.0, 10.0, 0.0, 10.0]));
    ends(&linuxcnc(), "G0 X1\n#5230=30\nX10\nG54\nX11", &x(&[1.0, 10.0, 11.0]));
    // They are read as assigned.
    ends(&linuxcnc(), "G10 L2 P1 X5\n#1=#5221\nG0 X#1\n#5221=[#5221+1]\nG0 X[#5221]", &x(&[10.0, 11.0]));
    // G10 takes the axes that it does not name from them.
    ends(&linuxcnc(), "#5222=3\n#5221=4\nG0 X1 Y1\nG10 L2 P1 Z2\nG0 X1 Y1 Z0", &[[1.0, 1.0, 0.0], [5.0, 4.0, 2.0]]);
    // A shift does not.
    ends(&linuxcnc(), "G0 X1\n#5221=7\nG52 X1\nX2", &x(&[1.0, 3.0]));
}

#[test]
fn those_of_fanuc_hold_from_the_next_block_on() {
    ends(&mill(), "G0 X1\n#5221=10\nX2\n#5241=20\nX3\nG55 X4", &x(&[1.0, 12.0, 13.0, 24.0]));
}

#[test]
fn what_the_job_sets_holds_from_the_start() {
    let mut settings = linuxcnc();
    settings.parameters.numbered.insert(5_221, 10.0);
    ends(&settings, "G0 X1", &x(&[11.0]));
}

#[test]
fn tool_offsets_that_the_job_brings_act_as_g10_does() {
    let with = |settings: LanguageSettings, brought: &[(u32, f64)]| {
        let mut settings = settings;
        settings.parameters.numbered.extend(brought.iter().copied());
        settings
    };
    let settings = with(mill(), &[(10_001, 0.5), (11_001, 105.0), (11_030, 7.0), (12_021, -1.0), (13_021, 4.0)]);
    let program = "G43 H1 G0 Z0\nG43 H30 Z0\nG49 X10 Y20 Z0\nG41 D21 G1 Y0 F100\nX20\nG40 Y20";
    let expected =
        [[0.0, 0.0, 105.5], [0.0, 0.0, 7.0], [10.0, 20.0, 0.0], [10.0, 3.0, 0.0], [20.0, 3.0, 0.0], [20.0, 20.0, 0.0]];
    ends(&settings, program, &expected);
    resumes(&settings, program);
    // Beside what the row of the job has. X is a diameter.
    let rows = [ToolOffset::new(1).with_length(50.0)];
    ends_with(&with(lathe(), &[(2_001, 0.4)]), &rows, "T0101\nG0 X1 Z0", &[[0.7, 0.0, 50.0]]);
    // The system that is in force at the start.
    let settings = with(linuxcnc(), &[(5_220, 2.0), (5_241, 12.0)]);
    ends(&settings, "G0 X1\nX#5220\nG54 X1", &x(&[13.0, 14.0, 1.0]));
    resumes(&settings, "G0 X1");
    // What cannot act is refused.
    for (settings, number, value) in [
        (lathe(), 2_301, 12.0),
        (mill(), 5_224, 10.0),
        (lathe(), 5_243, 10.0),
        (mill(), 2_001, 0.4),
        (linuxcnc(), 5_220, 12.0),
        (linuxcnc(), 5_220, 1.5),
    ] {
        let settings = with(settings, &[(number, value)]);
        assert_eq!(run_with(&settings, &[], "G0 X1").findings, ["1:PRG-PARAMETER-READ-ONLY"], "#{number}");
    }
    assert_eq!(run_with(&with(mill(), &[(5_224, 0.0)]), &[], "G0 X1").findings, [""; 0]);
}

#[test]
fn an_offset_of_an_axis_whose_letter_is_the_machines_says_what_sets_it() {
    let (_, findings) = interpret(b"#5224=10.\nM30", mill());
    let [finding] = findings.findings() else { panic!("{findings:?}") };
    assert_eq!(finding.code.name(), "PRG-PARAMETER-READ-ONLY");
    assert!(finding.message.contains("axis 4"), "{finding:?}");
    assert!(finding.suggestions[0].message.contains("G10 L2"), "{finding:?}");
}

#[test]
fn a_loop_that_only_moves_an_offset_is_no_endless_one() {
    let program = "#1=0\nWHILE [#1 LT 1] DO1\nG10 L2 P1 X[#5221+1]\nIF [#5221 GE 3] THEN #1=1\nEND1\nG0 X0";
    ends(&mill(), program, &x(&[3.0]));
    let assigned = "N1 #5221=#5221+1\nIF [#5221 LT 3] GOTO 1\nG0 X1";
    ends(&mill(), assigned, &x(&[4.0]));
    let program = "o1 while [#5221 LT 3]\nG10 L2 P1 X[#5221 + 1]\no1 endwhile\nG0 X0";
    ends(&linuxcnc(), program, &x(&[3.0]));
    let shifted = "o1 while [#5211 LT 3]\nG52 X[#5211 + 1]\no1 endwhile\nG0 X0";
    ends(&linuxcnc(), shifted, &x(&[3.0]));
}

#[test]
fn small_memories_are_refused_with_what_all_controls_have() {
    for (program, code) in [("#1=#2001", "PRG-PARAMETER-UNAVAILABLE"), ("#2201=1.", "PRG-PARAMETER-READ-ONLY")] {
        let (_, findings) = interpret(format!("{program}\nM30").as_bytes(), mill());
        let [finding] = findings.findings() else { panic!("{findings:?}") };
        assert_eq!(finding.code.name(), code);
        assert!(finding.suggestions[0].message.contains("#11001"), "{finding:?}");
    }
}
