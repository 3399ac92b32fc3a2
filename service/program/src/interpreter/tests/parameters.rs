//! Parameters and expressions in programs: sections 1 and 2 of the page on the language.

use super::*;

#[test]
fn section_2_words_of_macro_b() {
    check(
        &mill(),
        "#1=10\n#2=-2.5\nG0 X#1 Y-#1 Z[#1+2]\nX[#1*#2] Y#[3-1]\nG#0 X[SIN[30]] Y-SQRT[4]",
        "rapid 0 -> X10 Y-10 Z12
         rapid X10 Y-10 Z12 -> X-25 Y-2.5 Z12
         rapid X-25 Y-2.5 Z12 -> X0.5 Y-2 Z12
         w 5:1+3 PRG-VACANT-WORD",
    );
    check(&mill(), "N10 #500=1\n#500=#500+1\nG#500 X1 Y1 R1 F100", "arc 0 -> X1 Y1 about 1,0 by -90 @100/min");
    check(&lathe(), "#5=40\nG0 X#5 Z#5", "rapid 0 -> X20 Z40");
}

#[test]
fn section_10_example_6_vacant_values_are_words_that_are_not_there() {
    // The locals of the example: #1=5, #2=10, #4=1, #7=2, #9=3; #3, #5, #6 and #8 are vacant.
    let locals = "#1=5\n#2=10\n#4=1\n#7=2\n#9=3\n";
    check(&mill(), &format!("{locals}G0 X#1 Y#3"), "rapid 0 -> X5");
    check(&mill(), &format!("{locals}G0 X#1 Y-#3 Z[#5]\nX#3"), "rapid 0 -> X5");
    check(&mill(), &format!("{locals}#5=#3+0\nG0 X#1 Y1\nY#5"), "rapid 0 -> X5 Y1\nrapid X5 Y1 -> X5");
    check(&mill(), &format!("{locals}G0 X1\n#1=#0\nX#1 Y2"), "rapid 0 -> X1\nrapid X1 -> X1 Y2");
}

#[test]
fn section_2_values_are_rounded_to_the_least_increment_of_their_address() {
    check(&mill(), "#1=1.23456\nG0 X#1 Y1.23456", "rapid 0 -> X1.235 Y1.23456");
    check(&mill(), "G20\n#1=1.23456\nG0 X#1", "rapid 0 -> X31.35884");
    check(&mill(), "#1=1.23456\nG0 X[ROUND[#1]]", "rapid 0 -> X1.235");
    check(&mill(), "#1=2.6\nT#1\nM#[1+1]\nM6", "tool 3.0\nw 3:1+7 PRG-VACANT-WORD");
    check(&mill(), "#1=2.6\nT#1 M6\nS[99.5] M3", "tool 3.0\nspindle cw 100");
    check(&linuxcnc(), "#1=1.23456\nG0 X#1", "rapid 0 -> X1.23456");
}

#[test]
fn section_1_linuxcnc_reads_everything_with_the_old_values() {
    check(&linuxcnc(), "#3=15\n#3=6 G1 X#3 F100\nX#3", "line 0 -> X15 @100/min\nline X15 -> X6 @100/min");
    check(&linuxcnc(), "#1=1 #2=2\n#1=#2 #2=#1\nG0 X#1 Y#2", "rapid 0 -> X2 Y1");
}

#[test]
fn section_1_macro_b_assigns_in_blocks_of_their_own_and_in_sequence() {
    check(&mill(), "#1=1 #2=#1+1\nG0 X#1 Y#2", "rapid 0 -> X1 Y2");
    check(&mill(), "#1=1 G0 X#1\nX5", "! 1:1+4 PRG-EXPRESSION-MALFORMED");
    check(&mill(), "N5 #1=1\nG0 X#1", "rapid 0 -> X1");
}

#[test]
fn section_2_names_and_indirect_numbers_of_linuxcnc() {
    check(
        &linuxcnc(),
        "#<depth of cut>=2\n#<_Global>=[#<DepthOfCut>*3]\n#1=2 #2=7\nG0 X##1 Y#<_global> Z-#<depthofcut>",
        "rapid 0 -> X7 Y6 Z-2",
    );
    check(&linuxcnc(), "G0 X1\nX#<nothing>\nX3", "rapid 0 -> X1\n! 2:2+10 PRG-PARAMETER-UNSET");
    check(&linuxcnc(), "#5=[1 GT 0]\nG0 X#5 Y#6", "rapid 0 -> X1");
    check(&linuxcnc(), "G0 X1 Y2\nX[#5421+#<_x>]", "rapid 0 -> X1 Y2\nrapid X1 Y2 -> X3 Y2");
}

#[test]
fn section_2_whole_numbers_may_differ_by_a_little() {
    check(&linuxcnc(), "#1=[2.00004]\nT#1 M6", "tool 2.0");
    check(&linuxcnc(), "G[1.00005/1.00005] X1 F10", "line 0 -> X1 @10/min");
    check(&linuxcnc(), "G[0.1*30/10*10-3] X1\nG[4.3*10+0.00001]H1", "rapid 0 -> X1");
    check(&linuxcnc(), "T[1.001] M6", "! 1:1+8 PRG-NUMBER-NOT-WHOLE\nw 1:10+2 PRG-TOOL-MISSING");
}

#[test]
fn a_program_ends_where_an_expression_has_no_value() {
    check(&mill(), "G0 X1\nX[1/#0] Y[\nX3\nTHIS IS NOT READ", "rapid 0 -> X1\n! 2:3+4 PRG-EXPRESSION-ARITHMETIC");
    check(&mill(), "G0 X#34\nX1", "! 1:5+3 PRG-PARAMETER-NUMBER");
    check(&mill(), "#5001=1\nG0 X1", "! 1:1+7 PRG-PARAMETER-READ-ONLY");
    check(&mill(), "G0 X1\nN#1\nX3", "rapid 0 -> X1\n! 2:1+3 PRG-EXPRESSION-MALFORMED");
    check(&mill(), "G0 X#1+2\nX3", "rapid 0 -> X3\n! 1:7+2 PRG-NUMBER-STRAY");
}

#[test]
fn operations_of_linuxcnc_stand_in_brackets() {
    // Reading the first value only would be another number in silence; LinuxCNC says "Bad character '-' used".
    for assigned in ["#1-0.4", "2*3", "#1 +1", "SIN[30]/2", "#<_x> MOD 2"] {
        let program = format!("#1=5\nG0 X1\n#1={assigned}\nX#1");
        let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
        let codes: Vec<_> = findings.findings().iter().map(|finding| finding.code.name()).collect();
        assert_eq!((codes.as_slice(), operations.len()), (&["PRG-EXPRESSION-MALFORMED"][..], 2), "{assigned}");
    }
    check(&linuxcnc(), "#1=5\nG0 X1\n#1=#1-0.4\nX#1", "rapid 0 -> X1\n! 3:6+4 PRG-EXPRESSION-MALFORMED");
    check(&linuxcnc(), "#1=5\n#2=[#1-0.4] (less)\nG0 X#2", "rapid 0 -> X4.6");
}

#[test]
fn section_2_alarms_stops_and_what_does_nothing() {
    check(&mill(), "G0 X1\n#3000=21(NO DEPTH)\nX3", "rapid 0 -> X1\n! 2:1+8 PRG-ALARM");
    check(&mill(), "G0 X1\n#3006=1(TURN THE PART)\nX3", "rapid 0 -> X1\nstop false\nrapid X1 -> X3");
    check(
        &mill(),
        "#3004=7\nDPRNT[X#1[53]]\nG0 X3",
        "rapid 0 -> X3\ni 1:1+7 PRG-PARAMETER-IGNORED\ni 2:1+14 PRG-OUTPUT",
    );
    check(
        &linuxcnc(),
        "(PRINT,#1)\n(MSG,hello)\n(debug, x)\nG0 X3\n(abort, no tool)\nX4",
        "rapid 0 -> X3\ni 1:1+10 PRG-OUTPUT\ni 3:1+10 PRG-OUTPUT\n! 5:1+16 PRG-ALARM",
    );
    check(&mill(), "G0 X3 (ABORT, it is a word)\nX4", "rapid 0 -> X3\nrapid X3 -> X4");
}

#[test]
fn the_message_of_an_alarm_is_said() {
    let (_, findings) = interpret(b"#3000=21(NO DEPTH GIVEN)\n", mill());
    assert_eq!(findings.findings()[0].message, "the program stops itself with alarm 21: NO DEPTH GIVEN");
}

#[test]
fn initial_values_come_with_the_settings() {
    let mut settings = mill();
    settings.parameters.numbered.insert(500, 12.5);
    check(&settings, "G0 X#500\n#500=#500+1\nX#500", "rapid 0 -> X12.5\nrapid X12.5 -> X13.5");
}
