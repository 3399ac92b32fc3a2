//! Cycles of FANUC lathes whose contour goes beyond their start: a control stops, and a cure ends the finding.

use super::*;

/// The contour of the example: from X30 to X90.
const CONTOUR: &str = "N10 G0 X30.\nG1 Z-10.\nX80.\nZ-20.\nN20 X90.";

/// The one finding of a program: its message and its cures.
#[track_caller]
fn only(settings: &LanguageSettings, program: &str) -> (String, Vec<String>) {
    let (operations, findings) = interpret(format!("{program}\nM30\n").as_bytes(), settings.clone());
    let [finding] = findings.findings() else { panic!("{program}\n{:?}", findings.findings()) };
    assert_eq!(finding.code, "PRG-TURNING-START", "{program}");
    assert!(operations.iter().all(|operation| operation.span.line != finding.span.line), "nothing of the cycle moves");
    let cures = finding.suggestions.iter().map(|cure| cure.message.clone()).collect();
    (finding.message.clone(), cures)
}

/// The place that a cure names.
#[track_caller]
fn place(cure: &str) -> &str {
    let from = cure.find(" at X").unwrap_or_else(|| panic!("{cure}")) + 4;
    let end = cure[from..].find(" or ").map_or(cure.len(), |length| from + length);
    &cure[from..end]
}

/// The program is refused with one finding, and accepted from the start that its cure names.
#[track_caller]
fn refused(settings: &LanguageSettings, start: &str, cycle: &str, message: &str, serves: &str) {
    let program = |start: &str| format!("M3 S1000\nG0 {start}\n{cycle}");
    let (found, cures) = only(settings, &program(start));
    assert_eq!(found, message);
    assert_eq!(place(&cures[0]), serves, "{cures:?}");
    for cure in &cures {
        let cured = codes(settings, &program(place(cure)));
        let wrong = |code: &String| !matches!(code.as_str(), "PRG-TURNING-POCKETS" | "PRG-TURNING-DETACHED");
        assert!(!cured.iter().any(wrong), "{cure}: {cured:?}");
    }
}

#[test]
fn a_contour_wider_than_the_start() {
    let message = "the cycle starts at X40. Z5., but its contour reaches X90. Z-20. on line 9, beyond the start";
    for (settings, code) in [(a(), "G71"), (system(GCodeSystem::B), "G71"), (system(GCodeSystem::C), "G73")] {
        let cycle = format!("{code} U3. R.5\n{code} P10 Q20 U0 W0 F.2\n{CONTOUR}");
        refused(&settings, "X40. Z5.", &cycle, message, "X90. Z5.");
        // Allowances move the contour and where it is counted from: they change nothing.
        let cycle = cycle.replace("U0 W0", "U.8 W.2");
        refused(&settings, "X40. Z5.", &cycle, message, "X90. Z5.");
    }
    let mut one = a();
    one.drilling.style = crate::DrillingStyle::Haas;
    one.turning.escape_mm = Some(0.5);
    let one_line = format!("G71 P10 Q20 U0 W0 D3. F.2\n{CONTOUR}");
    refused(&one, "X40. Z5.", &one_line, &message.replace("line 9", "line 8"), "X90. Z5.");
    one.drilling.style = crate::DrillingStyle::Fanuc;
    refused(&one, "X40. Z5.", &one_line.replace("D3.", "D3000"), &message.replace("line 9", "line 8"), "X90. Z5.");
}

#[test]
fn a_contour_that_begins_before_the_start() {
    let message = "the cycle starts at X50. Z-5., but its contour reaches X20. Z2. on line 5, beyond the start";
    let cycle = "G71 U2. R.5\nG71 P10 Q20 U.4 F.2\nN10 G0 X20. Z2.\nG1 Z-10.\nX30. Z-15.\nN20 X50.";
    refused(&a(), "X50. Z-5.", cycle, message, "X50. Z2.");
    // Without Z in the first block the contour goes back behind it.
    let cycle = cycle.replace("X20. Z2.\nG1", "X20.\nG1 Z2.\n");
    refused(&a(), "X50. Z-5.", &cycle, &message.replace("line 5", "line 6"), "X50. Z2.");
    // Both at once are one finding.
    let cycle = "G71 U2. R.5\nG71 P10 Q20 U.4 F.2\nN10 G0 X20. Z2.\nG1 Z-10.\nX30. Z-15.\nN20 X50.";
    let message = "the cycle starts at X45. Z-5., but its contour reaches X50. Z-15. on line 8, beyond the start";
    refused(&a(), "X45. Z-5.", cycle, message, "X50. Z2.");
}

#[test]
fn bores_faces_and_arcs() {
    let bore = "G71 U2. R.5\nG71 P10 Q20 U-.4 W.1 F.2\nN10 G0 X40.\nG1 Z-10.\nX30. Z-15.\nN20 X18.";
    let message = "the cycle starts at X20. Z2., but its contour reaches X18. Z-15. on line 8, beyond the start";
    refused(&a(), "X20. Z2.", bore, message, "X18. Z2.");
    let face = "G72 W2. R.5\nG72 P10 Q20 U.4 W.2 F.2\nN10 G0 Z-10.\nG1 X60.\nX40. Z-4.\nX20. Z0\nN20 Z2.";
    let message = "the cycle starts at X64. Z1., but its contour reaches X20. Z2. on line 9, beyond the start";
    refused(&a(), "X64. Z1.", face, message, "X64. Z2.");
    let in_c = face.replace("G72", "G74");
    refused(&system(GCodeSystem::C), "X64. Z1.", &in_c, message, "X64. Z2.");
    // An arc that goes further out than its ends: radius 10 about X40, Z-10.
    let arc =
        "G71 U2. R.5\nG71 P10 Q20 U.4 F.2\nN10 G0 X20. W0\nG1 Z-4.\nX56.\nG3 X56. Z-16. I-8. K-6.\nN20 G1 X56. Z-20.";
    let message = "the cycle starts at X57. Z2., but its contour reaches X60. Z-10. on line 8, beyond the start";
    refused(&a(), "X57. Z2.", arc, message, "X60. Z2.");
}

#[test]
fn cures_are_written_as_the_program_is() {
    // In inches, with more places than a control has.
    let cycle = "G71 U.1 R.02\nG71 P10 Q20 U.02 F.01\nN10 G0 X.5\nG1 Z-.5\nN20 X[10./3.]";
    let message = "the cycle starts at X2. Z0.1, but its contour reaches X3.3333 Z-0.5 on line 8, beyond the start";
    let program = |start: &str| format!("G20\nM3 S1000\nG0 {start}\n{cycle}");
    let (found, cures) = only(&a(), &program("X2. Z.1"));
    assert_eq!(found, message);
    assert_eq!(place(&cures[0]), "X3.3333 Z0.1");
    assert!(codes(&a(), &program(place(&cures[0]))).is_empty());
    // Incremental words go along with the start.
    let (_, cures) =
        only(&a(), "M3 S1000\nG0 X40. Z5.\nG71 U3. R.5\nG71 P10 Q20 F.2\nN10 G0 U-10.\nG1 W-15.\nN20 U60.");
    assert_eq!(
        cures,
        ["start the cycle at X90. Z5. or further away from the part and write the contour with absolute words: \
          incremental ones move along with the start"]
    );
}

#[test]
fn a_pocketed_contour_on_both_sides_of_the_start_has_two_cures() {
    let program =
        "M3 S1000\nG0 X40. Z5.\nG71 U3. R.5\nG71 P10 Q20 F.2\nN10 G0 X30. W0\nG1 Z-10.\nX20. Z-15.\nN20 X60. Z-30.";
    let (_, cures) = only(&a(), program);
    assert_eq!(cures.len(), 2, "{cures:?}");
    assert_eq!((place(&cures[0]), place(&cures[1])), ("X60. Z5.", "X20. Z5."));
    for cure in &cures {
        let cured = program.replace("G0 X40. Z5.", &format!("G0 {}", place(cure)));
        assert_eq!(codes(&a(), &cured), ["PRG-TURNING-POCKETS"], "{cure}");
    }
}

#[test]
fn starts_that_serve() {
    let go = |start: &str, cycle: &str| codes(&a(), &format!("M3 S1000\nG0 {start}\n{cycle}"));
    // At the largest X itself, with allowances, and a thousandth below it.
    for start in ["X90. Z5.", "X89.999 Z5.", "X100. Z5."] {
        assert!(
            go(start, &format!("G71 U3. R.5\nG71 P10 Q20 U.8 W.2 F.2\n{CONTOUR}\nG70 P10 Q20")).is_empty(),
            "{start}"
        );
    }
    let contour = "N10 G0 X20. Z2.\nG1 Z-10.\nN20 X50.";
    for start in ["X50. Z2.", "X50. Z5.", "X60. Z2."] {
        assert!(
            go(start, &format!("G71 U3. R.5\nG71 P10 Q20 U.8 W.2 F.2\n{contour}\nG70 P10 Q20")).is_empty(),
            "{start}"
        );
    }
}

#[test]
fn rapids_of_the_finishing_and_the_pattern_stay_off_the_part() {
    // A ridge at X60: the way back at X50 passes through it.
    let contour = "N10 G0 X30.\nG1 Z-10.\nX60. Z-15.\nX40. Z-20.\nN20 Z-30.";
    let message = |line| {
        format!(
            "from the start X50. Z2. or back to it, a rapid move passes 5.000 mm through the finished contour, which reaches \
             X60. Z-15. on line {line}"
        )
    };
    let finish = format!("G70 P10 Q20 F.1\nM30\n{contour}");
    let (found, cures) = only(&a(), &format!("M3 S1000\nG0 X50. Z2.\n{finish}"));
    assert_eq!((found, place(&cures[0])), (message(7), "X60. Z2."));
    assert!(codes(&a(), &format!("M3 S1000\nG0 X60. Z2.\n{finish}")).is_empty());
    let pattern = format!("G73 U0 W0 R1\nG73 P10 Q20 F.2\n{contour}");
    refused(&a(), "X50. Z2.", &pattern, &message(7), "X60. Z2.");
    // A contour that ends higher than it is anywhere else leaves a way back from any start.
    let rising = "N10 G0 X30.\nG1 Z-10.\nN20 X60.";
    assert!(codes(&a(), &format!("M3 S1000\nG0 X50. Z2.\nG73 U0 W0 R1\nG73 P10 Q20 F.2\n{rising}")).is_empty());
    // From the level of the first point, a contour that falls may be one in a bore, with another way back.
    let bore = "N10 G0 X40. Z0\nG1 Z-10.\nN20 X30. Z-15.";
    let (found, _) = only(&a(), &format!("M3 S1000\nG0 X40. Z2.\nG70 P10 Q20 F.1\nM30\n{bore}"));
    assert!(found.ends_with("so that the side of the stock is not known"), "{found}");
    assert!(codes(&a(), &format!("M3 S1000\nG0 X29. Z2.\nG70 P10 Q20 F.1\nM30\n{bore}")).is_empty());
    // From over the part, the way to the first point passes through a shoulder.
    let contour = "N10 G0 X20. Z2.\nG1 Z0\nX50.\nZ-20.\nN20 X60.";
    let pattern = format!("G73 U0 W0 R1\nG73 P10 Q20 F.2\n{contour}");
    let (found, cures) = only(&a(), &format!("M3 S1000\nG0 X62. Z-10.\n{pattern}"));
    assert!(found.starts_with("from the start X62. Z-10. or back to it, a rapid move passes "), "{found}");
    assert_eq!(place(&cures[0]), "X62. Z2.");
    assert!(codes(&a(), &format!("M3 S1000\nG0 X62. Z2.\n{pattern}")).is_empty());
    assert!(codes(&a(), &format!("M3 S1000\nG0 X200. Z-2.\n{pattern}")).is_empty());
}
