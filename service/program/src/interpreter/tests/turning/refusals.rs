//! What turning cycles refuse.

use super::*;

const GO: &str = "M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 U0.4 W0.1 F0.2\n";

#[track_caller]
fn refused(program: &str, expected: &[&str]) {
    assert_eq!(codes(&a(), program), expected, "{program}");
}

#[test]
fn contours_that_are_not_there() {
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-20."), &["PRG-TURNING-CONTOUR"]);
    refused(&format!("{GO}N20 G0 X20.\nN10 G1 Z-20."), &["PRG-TURNING-CONTOUR"]);
    refused(&format!("{GO}N10 G0 X20.\nN10 G1 Z-20.\nN20 X50."), &["PRG-TURNING-CONTOUR"]);
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-20.\nM30\nN20 X50."), &["PRG-TURNING-CONTOUR"]);
    refused("G70 P10 Q20", &["PRG-TURNING-CONTOUR"]);
    refused("M3 S1000\nG0 X50. Z2.\nG70 P10", &["PRG-TURNING-WORD"]);
}

#[test]
fn blocks_that_no_contour_has() {
    for block in [
        "G28 U0",
        "M98 P100",
        "G90 X30. Z-5.",
        "M0",
        "G32 Z-5. F1.",
        "G75 X10. P1000",
        "G71 P30 Q40",
        "G1 C5.",
        "G54 G1 X5.",
    ] {
        let found = codes(&a(), &format!("{GO}N10 G0 X20.\n{block}\nN20 G1 X50. Z-20.\nM30\nO100\nM99"));
        assert!(found.iter().any(|code| code == "PRG-TURNING-CONTOUR"), "{block}: {found:?}");
    }
}

#[test]
fn contours_that_turn_back() {
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-10.\nX30. Z-15.\nX28. Z-20.\nN20 X50."), &["PRG-TURNING-MONOTONY"]);
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-10.\nX30. Z-8.\nN20 X50."), &["PRG-TURNING-MONOTONY"]);
    refused(&format!("{GO}N10 G0 X20. Z0\nG1 Z-10.\nX30. Z-8.\nN20 X50."), &["PRG-TURNING-MONOTONY"]);
    // An arc that goes below its ends.
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-10.\nG2 X20. Z-20. R20.\nN20 G1 X50."), &["PRG-TURNING-MONOTONY"]);
    // A thousandth is nothing.
    refused(&format!("{GO}N10 G0 X20.\nG1 Z-10.\nX30. Z-15.\nX29.999 Z-20.\nN20 X50."), &[]);
}

#[test]
fn starts_words_and_limits() {
    refused(
        "M3 S1000\nG0 X20. Z2.\nG71 U2. R1.\nG71 P10 Q20 F0.2\nN10 G0 X20. W0\nN20 G1 Z-20.",
        &["PRG-TURNING-START"],
    );
    refused(
        "M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 F0.2\nN10 G0 Z0\nN20 G1 X20. Z-20.",
        &["PRG-TURNING-CONTOUR"],
    );
    refused(
        "M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 F0.2\nN10 G2 X20. Z-10. R40.\nN20 G1 Z-20.",
        &["PRG-TURNING-CONTOUR"],
    );
    refused("M3 S1000\nG0 X50. Z2.\nG71 U0 R1.", &["PRG-TURNING-VALUE"]);
    refused("M3 S1000\nG0 X50. Z2.\nG71 P10 Q20 F0.2\nN10 G0 X20.\nN20 G1 Z-20.", &["PRG-TURNING-WORD"]);
    refused("M3 S1000\nG0 X50. Z2.\nG71 P10 Q20 D1000 I0.5 F0.2\nN10 G0 X20.\nN20 G1 Z-20.", &["PRG-TURNING-FORM"]);
    refused(
        "M3 S1000\nG0 X50. Z2.\nG71 U0.0001 R1.\nG71 P10 Q20 F0.2\nN10 G0 X20.\nN20 G1 Z-20.",
        &["PRG-TURNING-LIMIT"],
    );
    refused("M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20\nN10 G0 X20.\nN20 G1 Z-20. F0.1", &["PRG-FEED-MISSING"]);
    refused("M3 S1000\nG0 X50. Z2.\nG17\nG71 U2. R1.", &["PRG-TURNING-FORM"]);
    refused("M3 S1000\nG0 X50. Z2.\nG73 P10 Q20 U0.4 F0.2\nN10 G0 X20.\nN20 G1 Z-20.", &["PRG-TURNING-WORD"]);
    let many = "G1 Z-.01\nW-.01\n".repeat(1_100);
    refused(&format!("{GO}N10 G0 X20.\n{many}N20 X50."), &["PRG-TURNING-LIMIT"]);
}

#[test]
fn units_of_other_controls_are_told_from_cycles() {
    let cure = |program: &str| {
        let (_, findings) = interpret(program.as_bytes(), linuxcnc());
        let finding = &findings.findings()[0];
        assert_eq!(finding.code, "PRG-TURNING-FORM", "{program}");
        finding.suggestions[0].message.clone()
    };
    assert!(cure("G17 G90 G71\nM2").starts_with("for millimetres write G21;"));
    assert!(cure("G17 G70\nM2").starts_with("for inches write G20;"));
    assert_eq!(cure("G17\nG71 Q100 I2\nM2"), "select it before, G18");
}

#[test]
fn pockets_leave_no_allowance_along_the_passes() {
    let contour = "N10 G0 X20. W0\nG1 Z-10.\nX16. Z-15.\nN20 X50. Z-30.";
    refused(
        &format!("M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 U0.4 W0.1 F0.2\n{contour}"),
        &["PRG-TURNING-VALUE"],
    );
    refused(&format!("M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 U0.4 F0.2\n{contour}"), &["PRG-TURNING-POCKETS"]);
    refused(
        "M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 U-0.4 W0.1 F0.2\nN10 G0 X20.\nG1 Z-20.\nN20 X50.",
        &["PRG-TURNING-ALLOWANCE"],
    );
}

#[test]
fn a_cycle_with_an_error_passes_its_contour_over() {
    // Nothing of the contour is reported or moved, and the program goes on behind it.
    let program =
        "M3 S1000\nG0 X50. Z2.\nG71 U2. R1.\nG71 P10 Q20 U0.4 W5000. F0.2\nN10 G0 X20.\nN20 G1 Z-20.\nG0 X60.";
    moves(&a(), program, 1, "r 60 2; ! 4:18+6 PRG-TURNING-VALUE");
}

#[test]
fn linuxcnc_names_what_is_missing() {
    let go = "G18 F100 M3 S100\nG0 X25 Z2\n";
    assert_eq!(codes(&linuxcnc(), &format!("{go}G71 Q100 I2")), ["PRG-SUBPROGRAM-MISSING"]);
    assert_eq!(codes(&linuxcnc(), &format!("{go}G71 I2")), ["PRG-TURNING-WORD"]);
    let sub = "o100 sub\nG0 X10\nG1 Z-10\nX15 Z-8\no100 endsub\n";
    assert_eq!(codes(&linuxcnc(), &format!("{sub}{go}G71 Q100 I2")), ["PRG-TURNING-MONOTONY"]);
    assert_eq!(codes(&linuxcnc(), &format!("{sub}{go}G91 G71 Q100 I2")), ["PRG-TURNING-FORM"]);
}

#[test]
fn a_block_leads_to_one_place_only() {
    // With a return in its block, the contour was looked for behind the end of the program.
    let sub = "G18 G8 F100 M3 S100\no100 sub\nG0 X10\nG1 Z-5\nX20 Z-10\no100 endsub\n";
    for code in ["M99", "M98 P1"] {
        let program = format!("{sub}G0 X28 Z2\nG71 Q100 I2.5 R0.7 {code}\nG0 X30\nM2\n");
        let (operations, findings) = interpret(program.as_bytes(), linuxcnc());
        assert!(findings.has_errors(), "{code}");
        let found = findings.findings().iter().any(|finding| finding.code == "PRG-TURNING-CONTOUR");
        assert!(found, "{code}: {:?}", findings.findings());
        let ends = operations.iter().filter(|operation| operation.kind == OperationKind::End).count();
        assert_eq!(ends, 1, "{code}");
    }
}
