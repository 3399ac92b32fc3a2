//! Cycles along a contour under compensation of the nose.

use super::*;

/// A lathe whose tool 1 is an outside one and tool 2 a boring bar, with a radius of 0.4 mm.
fn nose(program: &str) -> (Vec<String>, Vec<String>) {
    nose_on(a(), program)
}

fn nose_on(settings: LanguageSettings, program: &str) -> (Vec<String>, Vec<String>) {
    let tools = [(1, 3), (2, 2)].map(|(number, tip)| ToolOffset { tip, ..ToolOffset::new(number).with_radius(0.4) });
    let program = format!("T0101 M3 S1000\n{program}\nM30\n");
    let (operations, findings) = Interpreter::new(settings).with_tools(tools.to_vec()).read_all(program.as_bytes());
    let mut at = None;
    let mut ends = Vec::new();
    for operation in &operations {
        let OperationKind::Move(step) = &operation.kind else { continue };
        assert!(findings.has_errors() || at.is_none_or(|at| at == step.start), "the path is whole: {operation:?}");
        at = Some(step.end);
        let kind = if step.kind == MoveKind::Rapid { "r" } else { "f" };
        ends.push(format!("{kind} {} {}", number(step.end[0] * 2.0), number(step.end[2])));
    }
    // How near entries and exits come is not what is judged here.
    let codes = findings.findings().iter().map(|finding| finding.code.name()).filter(|code| *code != "PRG-COMP-GOUGE");
    (ends, codes.map(str::to_owned).collect())
}

const ROUGH: &str = "G71 U2. R1.\nG71 P10 Q20 U0.4 W0.1 F0.2";
const CONTOUR: &str = "N10 G0 X20.\nG1 Z-10. F0.1\nX30. Z-15.\nN20 X50.";

#[test]
fn roughing_ignores_what_is_on_before_it() {
    let (with, found) = nose(&format!("G0 X52. Z3.\nG42 X50. Z2.\n{ROUGH}\n{CONTOUR}\nG40 G0 X60."));
    let (without, none) = nose(&format!("G0 X52. Z3.\nX50. Z2.\n{ROUGH}\n{CONTOUR}\nG0 X60."));
    assert_eq!(found, ["PRG-TURNING-COMPENSATION"]);
    assert_eq!(none, [""; 0]);
    assert_eq!(with, without);
}

#[test]
fn finishing_switches_on_in_its_first_block_and_off_in_the_way_back() {
    let before = format!("G0 X52. Z3.\n{ROUGH}\n{CONTOUR}\n");
    let (rough, _) = nose(&before);
    let finish = |blocks: &str| {
        let (ends, found) = nose(&format!("{before}{blocks}"));
        assert_eq!(found, [""; 0], "{blocks}");
        ends[rough.len()..].to_vec()
    };
    // By hand: the cone of 45 degrees is reached by r tan(22.5 deg) = 0.165685 before its first corner and left as far before its last.
    let contour = ["r 20 1.6", "f 20 -10.234315", "f 29.531371 -15", "f 49.2 -15"];
    let expected = [["r 50 2"].as_slice(), &contour, &["r 50 2", "r 60 2"]].concat();
    assert_eq!(finish("G42 G0 X50. Z2.\nG70 P10 Q20\nG40 G0 X60."), expected);
    // On again with the next move.
    let again = finish("G42 G0 X50. Z2.\nG70 P10 Q20\nG0 X56.\nZ9.\nG40 X60.");
    assert_eq!(again[..6], expected[..6]);
    assert_ne!(again[6], "r 56 2");
    // The same with the code in the block of the cycle, and in the contour without G40 there.
    assert_eq!(finish("G0 X50. Z2.\nG42 G70 P10 Q20\nG40 G0 X60."), expected);
}

#[test]
fn what_is_on_after_a_contour_goes_on_after_the_cycle() {
    let program = "G0 X50. Z2.\nG70 P10 Q20\nG40 G0 X60.\nM30\nN10 G0 G42 X20.\nG1 Z-10. F0.1\nX30. Z-15.\nN20 X50.";
    let (ends, found) = nose(program);
    assert_eq!(found, [""; 0]);
    assert_eq!(ends, ["r 50 2", "r 20 1.6", "f 20 -10.234315", "f 29.531371 -15", "f 49.2 -15", "r 50 2", "r 60 2"]);
}

#[test]
fn other_cycles_and_linuxcnc_refuse_it() {
    let refused = |blocks: &str| nose(&format!("G0 X52. Z3.\nG42 X50. Z2.\n{blocks}\nG40 G0 X60.")).1;
    for blocks in ["G90 X45. Z-10. F0.2", "G75 R1.\nG75 X40. P1000 F0.1"] {
        assert!(refused(blocks).contains(&"PRG-COMP-BLOCK".to_owned()), "{blocks}: {:?}", refused(blocks));
    }
    let program = "G18 G8 G0 X25 Z2 F100\nG42.1 D0.8 L2 G1 X24 Z1\nG71 Q100 I2 R1 D0.5\nM2\no100 sub\nG0 X10\nG1 Z-10\nX25\no100 endsub";
    assert!(codes(&linuxcnc(), program).contains(&"PRG-COMP-BLOCK".to_owned()));
}

#[test]
fn the_side_of_the_stock_is_known_from_the_tool_or_the_roughing() {
    // A bore that narrows, finished from the X where it begins.
    let bore = "N10 G0 X40.\nG1 Z-10. F0.1\nX30. Z-15.\nN20 Z-20.";
    let finish = "G0 X40. Z2.\nG70 P10 Q20";
    let (_, alone) = nose(&format!("{finish}\nM30\n{bore}"));
    assert_eq!(alone, ["PRG-TURNING-START"]);
    let back = ["r 30 2", "r 40 2"];
    let (roughed, found) =
        nose(&format!("G0 X26. Z2.\nG71 U2. R1.\nG71 P10 Q20 U-0.4 W0.1 F0.2\n{bore}\nG0 Z9.\n{finish}"));
    assert_eq!(found, [""; 0]);
    assert_eq!(roughed[roughed.len() - 2..], back);
    let (compensated, found) = nose(&format!("T0202\nG0 X38. Z4.\nG41 X40. Z2.\nG70 P10 Q20\nG40 G0 Z9.\nM30\n{bore}"));
    assert_eq!(found, [""; 0]);
    assert_eq!(compensated[compensated.len() - 3..compensated.len() - 1], back);
    // Another contour says nothing.
    let (_, other) = nose(&format!(
        "G0 X26. Z2.\nG71 U2. R1.\nG71 P10 Q20 U-0.4 W0.1 F0.2\n{bore}\nG0 X40. Z2.\nG70 P30 Q40\nM30\nN30 G0 X40.\nN40 G1 X30. Z-20. F0.1"
    ));
    assert_eq!(other, ["PRG-TURNING-START"]);
}

#[test]
fn the_last_block_may_lead_back_on_haas_controls() {
    let haas = LanguageSettings {
        drilling: crate::DrillingSettings { style: crate::DrillingStyle::Haas, ..crate::DrillingSettings::default() },
        turning: crate::TurningSettings { escape_mm: Some(1.0), ..a().turning },
        ..a()
    };
    let program = |last: &str| {
        format!(
            "G0 X50. Z2.\nG71 P10 Q20 U0.4 W0.1 D2. F0.2\nN10 G42 G0 X20.\nG1 Z-10. F0.1\nX30. Z-15.\n{last}\nG70 P10 Q20\nG0 X60."
        )
    };
    let (expected, found) = nose_on(haas.clone(), &program("N20 G40 X50."));
    assert_eq!(found, ["PRG-TURNING-COMPENSATION"]);
    let (ends, found) = nose_on(haas.clone(), &program("X50.\nN20 G0 G40 Z2."));
    assert_eq!(found, ["PRG-TURNING-COMPENSATION"]);
    // The passes are the same; finishing goes back by the block.
    let rough = expected.len() - 7;
    assert_eq!(ends[..rough], expected[..rough]);
    assert_eq!(ends[ends.len() - 3..], ["f 49.2 -15", "r 50 2", "r 60 2"]);
    // Not through the contour, and not on FANUC controls.
    let (_, found) = nose_on(haas, &program("X50.\nG0 X25.\nN20 G0 G40 Z2."));
    assert!(found.contains(&"PRG-TURNING-MONOTONY".to_owned()), "{found:?}");
    let (_, found) = nose_on(a(), &program("X50.\nN20 G0 G40 Z2.").replace("D2.", "D2000"));
    assert!(found.contains(&"PRG-TURNING-MONOTONY".to_owned()), "{found:?}");
}
