//! Single cycles: turning, facing and threading.

use super::*;

#[test]
fn the_code_alone_moves_nothing() {
    let expected = "r 50 2\nf 50 -10";
    for header in ["G21 G90 G40", "G94"] {
        let found = path(&a(), &format!("{header}\nM3 S1000\nG0 X50. Z2.\nG1 Z-10. F0.1"));
        assert_eq!(found.lines().take(2).collect::<Vec<_>>().join("\n"), expected);
        assert!(
            found.lines().skip(2).all(|line| line.starts_with("w 1:") && line.ends_with("PRG-TURNING-IDLE")),
            "{found}"
        );
        assert_eq!(found.lines().count(), 3);
    }
    // What follows without a motion code may be meant as the cycle or as a move.
    let program = "M3 S1000\nG0 X50. Z2. F0.1\nG90\nX45. Z-10.";
    assert_eq!(codes(&a(), program), ["PRG-TURNING-IDLE", "PRG-CODE-AMBIGUOUS"]);
    let (_, findings) = interpret(format!("{program}\nM30\n").as_bytes(), a());
    let cures = &findings.findings()[1].suggestions;
    assert!(cures.iter().all(|cure| !cure.message.contains("g_code_system")), "{cures:?}");
}

const GO: &str = "M3 S500\nG0 X60. Z5.\n";

#[test]
fn a_cylinder_repeats_with_a_new_x() {
    let passes = "r 55 5; f 55 -30; f 60 -30; r 60 5; r 50 5; f 50 -30; f 60 -30; r 60 5; r 45 5; f 45 -20; f 60 -20; r 60 5; r 70 5";
    for (settings, code, third) in [
        (a(), "G90", "U-15. W-25."),
        (system(GCodeSystem::B), "G77", "X45. Z-20."),
        (system(GCodeSystem::C), "G20", "X45. Z-20."),
    ] {
        moves(&settings, &format!("{GO}{code} X55. Z-30. F0.2\nX50.\n{third}\nG0 X70."), 1, passes);
    }
}

#[test]
fn a_taper_is_the_start_less_the_end() {
    // R −5: the cut starts 10 mm of diameter below its end.
    moves(
        &a(),
        &format!("{GO}G90 X50. Z-30. R-5. F0.2\nX46."),
        1,
        "r 40 5; f 50 -30; f 60 -30; r 60 5; r 36 5; f 46 -30; f 60 -30; r 60 5",
    );
    // The older word, and inch: 1.5 inch are 38.1 mm, 0.1 inch 2.54 mm.
    moves(
        &a(),
        "G20\nM3 S500\nG0 X2. Z.2\nG90 X1.5 Z-1. I-.1 F.01",
        1,
        "r 33.02 5.08; f 38.1 -25.4; f 50.8 -25.4; r 50.8 5.08",
    );
    // R0 of a further block makes a cylinder of it.
    moves(&a(), &format!("{GO}G90 X50. Z-30. R-5. F0.2\nX46. R0"), 5, "r 46 5; f 46 -30; f 60 -30; r 60 5");
    // Inside, from the smaller to the larger diameter.
    moves(&a(), "M3 S500\nG0 X20. Z2.\nG90 X24. Z-15. R1. F0.1", 1, "r 26 2; f 24 -15; f 20 -15; r 20 2");
}

#[test]
fn a_face_to_below_the_centre() {
    let passes = "r 60 -1; f -1.6 -1; f -1.6 5; r 60 5; r 60 -2; f -1.6 -2; f -1.6 5; r 60 5";
    for (settings, code) in [(a(), "G94"), (system(GCodeSystem::B), "G79"), (system(GCodeSystem::C), "G24")] {
        moves(&settings, &format!("{GO}{code} X-1.6 Z-1. F0.2\nZ-2."), 1, passes);
    }
    moves(&a(), &format!("{GO}G94 X20. Z0. R-4. F0.2"), 1, "r 60 -4; f 20 0; f 20 5; r 60 5");
    moves(&a(), &format!("{GO}G94 U-40. W-5. K-4. F0.2"), 1, "r 60 -4; f 20 0; f 20 5; r 60 5");
}

#[test]
fn tapers_beyond_the_start_are_refused() {
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. Z-30. R6. F0.2")), ["PRG-TURNING-VALUE"]);
    assert_eq!(codes(&a(), &format!("{GO}G94 X20. Z0. R6. F0.2")), ["PRG-TURNING-VALUE"]);
    // Up to it they are not.
    moves(&a(), &format!("{GO}G90 X50. Z-30. R5. F0.2"), 1, "f 50 -30; f 60 -30; r 60 5");
}

#[test]
fn what_a_single_cycle_lacks() {
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. F0.2\nX48.")), ["PRG-TURNING-WORD"]);
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. Z5. F0.2")), ["PRG-TURNING-START"]);
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. Z-30.")), ["PRG-FEED-MISSING"]);
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. U-10. Z-30. F0.2")), ["PRG-WORD-CONFLICT"]);
    assert_eq!(codes(&a(), &format!("{GO}G90 X50. Z-30. C5. F0.2")), ["PRG-TURNING-FORM"]);
}

#[test]
fn the_worked_thread() {
    let passes = "r 19.2 5; t 19.2 -20; r 24 -20; r 24 5; r 18.7 5; t 18.7 -20; r 24 -20; r 24 5; r 18.16 5; t 18.16 -20; r 24 -20; r 24 5";
    for (settings, code) in
        [(a(), "G92"), (lathe(), "G92"), (system(GCodeSystem::B), "G78"), (system(GCodeSystem::C), "G21")]
    {
        moves(&settings, &format!("M3 S500\nG0 X24. Z5.\n{code} X19.2 Z-20. F1.5\nX18.7\nX18.16"), 1, passes);
    }
    // In system A nothing but a thread has axis words, so that the lead may be modal.
    moves(
        &a(),
        "M3 S500\nG0 X24. Z5.\nG32 Z-10. F1.5\nG0 X24. Z5.\nG92 X19.2 Z-20.",
        3,
        "r 19.2 5; t 19.2 -20; r 24 -20; r 24 5",
    );
}

#[test]
fn a_chamfer_of_the_profile() {
    let mut settings = a();
    settings.turning.thread_chamfer_tenths = Some(10);
    let (operations, findings) = interpret(b"M3 S500\nG0 X24. Z5.\nG92 X19.2 Z-20. F1.5\nM30", settings);
    assert!(!findings.has_errors());
    let out = operations.iter().find_map(|operation| match &operation.kind {
        OperationKind::Thread(step) => step.pull_out,
        _ => None,
    });
    assert_eq!(out.map(|out| (number(out.travel_mm), number(out.retreat_mm))), Some(("1.5".into(), "1.5".into())));
}
