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
