//! What Haas controls add to Macro B: blocks behind `THEN`, conditions as numbers, `WH`.

use super::*;

fn haas_xs(program: &str) -> Vec<f64> {
    xs(&format!("{program}\nM30\n"), &haas_mill())
}

#[test]
fn a_block_may_stand_behind_then() {
    assert_eq!(haas_xs("#1=1\nIF [#1 EQ 1] THEN G0 X5.\nIF [#1 EQ 2] THEN X9.\nX1."), [5.0, 1.0]);
    assert_eq!(haas_xs("IF [1 EQ 1] THEN #1=7. #2=8.\nG0 X#1\nX#2"), [7.0, 8.0]);
    assert_eq!(haas_xs("M98 P1\nX5.\nM30\nO1\nG0 X1.\nIF [1 EQ 1] THEN #1=0.0 M99\nX9.\nM99"), [1.0, 5.0]);
    assert_eq!(haas_xs("G0 X1.\nIF [1 EQ 1] THEN M98 P1\nX5.\nM30\nO1\nX2.\nM99"), [1.0, 2.0, 5.0]);
    assert_eq!(haas_xs("IF [1 EQ 1] THEN G65 P1 A3.\nX5.\nM30\nO1\nG0 X#1\nM99"), [3.0, 5.0]);
    assert_eq!(haas_xs("G0 X1.\nIF [1 EQ 1] THEN M30\nX9."), [1.0]);
    assert_eq!(haas_xs("IF [1 EQ 1] THEN GOTO 5\nG0 X9.\nN5 X1."), [1.0]);
    assert_eq!(haas_xs("N7 IF [1 EQ 1] THEN (NOW) G0 X1.\nIF [#2 EQ #0] GOTO 8\nGOTO 7\nN8 X2."), [1.0, 2.0]);
    assert_eq!(haas_xs("G0 X1.\nIF[1EQ1]THENX2.\nIF [1 EQ 1] THENM30"), [1.0, 2.0]);
    assert_eq!(haas_xs("N5 G0 X1.\nN7 IF [1 EQ 1] THEN X2.\n#101=#4114\nX#101"), [1.0, 2.0, 7.0]);
    // What can be no block is refused, whether the condition holds or not.
    for condition in ["1 EQ 1", "1 EQ 2"] {
        for rest in ["", "(A)", "%", "IF [1 EQ 1] THEN X1.", "G0 X1. ELSE X2.", "X2. GOTO 5", "N5 G0 X1.", "O5"] {
            let program = format!("IF [{condition}] THEN {rest}\nM30\n");
            assert_eq!(codes(&program, &haas_mill()), ["PRG-STATEMENT"], "{program}");
        }
    }
    assert_eq!(codes("IF [1 EQ 2] THEN bla ble\nM30\n", &haas_mill()), ["PRG-STATEMENT"]);
    // Which of both comes first is not said.
    assert_eq!(codes("IF [1 EQ 1] THEN #1=7. G0 X#1\nM30\n", &haas_mill()), ["PRG-EXPRESSION-MALFORMED"]);
    assert_eq!(codes("IF [1 EQ 1] THEN 5 G0 X1.\nM30\n", &haas_mill()), ["PRG-NUMBER-STRAY"]);
    assert_eq!(mill_codes("IF [1 EQ 1] THEN G0 X5.\nM30"), ["PRG-STATEMENT"]);
}

/// The same operations as of the blocks alone, or none.
#[test]
fn a_condition_before_a_block_changes_nothing_else_of_it() {
    let blocks = [
        "G21 G17 G90 G94 G54",
        "T1 M6",
        "S1000 M3",
        "G10 L2 P1 X1. Y2. Z3.",
        "G10 L2 P2 X100. Y0. Z0.",
        "G0 X1. Y2.",
        "G1 X3. F100.",
        "G1 X4.",
        "G2 X6. Y2. I1. J0.",
        "G55",
        "G1 X5.",
        "X6.",
        "G91",
        "X1. Y1.",
        "G90",
        "G4 P100",
        "G0 Z10.",
        "G81 Z5. R7. F50.",
        "X20.",
        "G80",
        "M8",
        "G1 X30. F120.",
        "G51 X0. Y0. P2.",
        "X31.",
        "G50",
        "M5",
    ];
    let kinds = |program: &str| {
        let (operations, findings) = interpret(program.as_bytes(), haas_mill());
        let found: Vec<_> = findings.findings().iter().map(|it| (it.code.name(), it.span.line)).collect();
        (operations.into_iter().map(|operation| operation.kind).collect::<Vec<_>>(), found)
    };
    let (all, found) = kinds(&(blocks.join("\n") + "\nM30\n"));
    assert!(all.len() > 20 && found.is_empty(), "{} {found:?}", all.len());
    let under = |condition: &str| blocks.map(|block| format!("IF [{condition}] THEN {block}")).join("\n") + "\nM30\n";
    assert_eq!(kinds(&under("1 EQ 1")), (all, found));
    assert_eq!(kinds(&under("1 EQ 2")).0, [OperationKind::End]);
    // One block alone may be under a condition as well.
    for place in 0..blocks.len() {
        let mut lines = blocks.map(str::to_owned);
        lines[place] = format!("N{} IF [#33 EQ #0] THEN {}", place + 1, lines[place]);
        assert_eq!(kinds(&(lines.join("\n") + "\nM30\n")), kinds(&(blocks.join("\n") + "\nM30\n")), "{}", lines[place]);
    }
}

#[test]
fn conditions_are_numbers() {
    assert_eq!(haas_xs("#1=2\n#10=[#1 EQ 2]\n#11=#1 GT 5\nG0 X#10\nX#11\nX[5*[#1 LT 3]+1]"), [1.0, 0.0, 6.0]);
    assert_eq!(haas_xs("#1=2\n#10=[[#1 EQ 2] AND [#1 GT 0]]\nIF [#10] THEN G0 X#10"), [1.0]);
    assert_eq!(haas_xs("#1=1\nWH [#1 LE 3] DO1\nG0 X#1\n#1=#1+1\nEND1\nX9."), [1.0, 2.0, 3.0, 9.0]);
    assert_eq!(haas_xs("#10=-[2 GT 1]\n#[1 EQ 1]=4\nG0 X#10\nX#1"), [-1.0, 4.0]);
    for (program, code) in [
        // What AND joins is plain with brackets only.
        ("IF [[#1 EQ 2] AND #2 LT 5] GOTO 9\nN9\nM30", "PRG-EXPRESSION-TRUTH"),
        ("IF [#1 EQ 2 AND #2 LT 5] GOTO 9\nN9\nM30", "PRG-EXPRESSION-TRUTH"),
        ("IF [#1] GOTO 9\nN9\nM30", "PRG-EXPRESSION-TRUTH"),
    ] {
        assert_eq!(codes(program, &haas_mill()), [code], "{program}");
    }
    assert_eq!(mill_codes("#1=[1 EQ 1]\nM30"), ["PRG-EXPRESSION-TRUTH"]);
    assert_eq!(mill_codes("WH [1 EQ 2] DO1\nEND1\nM30"), ["PRG-STATEMENT"]);
}
