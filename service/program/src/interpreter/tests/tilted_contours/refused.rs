//! Where a contour in a tilted plane is refused, and that each cure is right as it is written.

use super::*;

/// Lines and codes of the errors of a program.
fn errors(text: &str) -> Vec<(u32, &'static str)> {
    let (_, findings) = read(&mill(), text);
    let errors = findings.iter().filter(|found| found.severity == Severity::Error);
    errors.map(|found| (found.span.line, found.code.name())).collect()
}

/// The cures of the only error of a program.
#[track_caller]
fn refused(text: &str, line: u32, code: &str) -> Vec<String> {
    let (_, findings) = read(&mill(), text);
    let found: Vec<_> = findings.iter().filter(|found| found.severity == Severity::Error).collect();
    let [found] = found[..] else { panic!("{text}: {findings:#?}") };
    assert_eq!((found.span.line, found.code.name()), (line, code), "{text}: {found:#?}");
    assert!(!found.suggestions.is_empty(), "{found:#?}");
    found.suggestions.iter().map(|cure| cure.message.to_string()).collect()
}

/// What follows the entry of a contour.
const REST: &str = "G41 D1 G1 X0 Y-10. F300\nY20.\nX30.\nG40 G1 X50. Y-10.\nM30\n";

#[test]
fn a_tool_that_is_not_on_the_normal_is_refused() {
    let place = "G0 X-30. Y-20. Z30.\n";
    let cures = refused(&format!("G68.2 J30.\n{place}{REST}"), 3, "PRG-COMP-PLANE");
    assert_eq!(cures, ["turn the tool axis with G53.1 in a block before it, and place X, Y and Z with G0 behind that"]);
    assert_eq!(errors(&format!("G68.2 J30.\n{place}G53.1\n{place}{REST}")), []);
    assert_eq!(errors(&format!("G68.2 J30.\nG43 H1\nG53.6\n{place}{REST}")), []);
    // Rotary axes that were turned away from it again.
    refused(&format!("G68.2 J30.\nG53.1\nG53 G0 C0\n{place}{REST}"), 5, "PRG-COMP-PLANE");
    assert_eq!(errors(&format!("G68.2 J30.\nG53.1\nG53 G0 C0\n{place}G53.1\n{place}{REST}")), []);
    // Another plane than the one that it was turned onto.
    refused(&format!("G68.2 J30.\nG53.1\nG69\nG68.2 J40.\n{place}{REST}"), 6, "PRG-COMP-PLANE");
}

#[test]
fn a_place_that_only_the_machine_knows_is_refused() {
    let place = "G0 X-30. Y-20. Z30.\n";
    for before in ["", "G0 X-30. Y-20.\n", "G0 Z30.\n", "G0 X-30. Z30.\n"] {
        let line = if before.is_empty() { 3 } else { 4 };
        let cures = refused(&format!("G68.2 J30.\nG53.1\n{before}{REST}"), line, "PRG-TOOL-CONTROL-HELD");
        assert_eq!(cures, ["place X, Y and Z with G0 before it"]);
        assert_eq!(errors(&format!("G68.2 J30.\nG53.1\n{before}{place}{REST}")), [], "{before}");
    }
    // Behind the plane, and behind tool centre point control.
    refused(&format!("G68.2 J30.\nG53.1\n{place}G69\n{REST}"), 5, "PRG-TOOL-CONTROL-HELD");
    assert_eq!(errors(&format!("G68.2 J30.\nG53.1\n{place}G69\n{place}{REST}")), []);
    refused(&format!("G43.4 H1\n{place}G49\n{REST}"), 4, "PRG-TOOL-CONTROL-HELD");
    // The length moves Z, be it in the block of the contour's start.
    refused(&format!("G68.2 J30.\nG53.1\n{place}G43 H1\n{REST}"), 5, "PRG-TOOL-CONTROL-HELD");
    assert_eq!(errors(&format!("G68.2 J30.\nG53.1\n{place}G43 H1 Z30.\n{REST}")), []);
}

#[test]
fn under_tool_centre_point_control_the_cures_can_be_followed() {
    let place = "G0 X-30. Y-20. Z30.\n";
    for control in ["G43.4 H2", "G43.5 H2"] {
        let cures = refused(&format!("{control}\n{place}{REST}"), 3, "PRG-COMP-BLOCK");
        assert_eq!(
            cures,
            [
                "write the path of the tool's centre, without G41, G42 and G40",
                "switch tool centre point control off with G49, call the length with G43 H2 and place X, Y and Z with G0, all before it"
            ]
        );
        let without = REST.replace("G41 D1 ", "").replace("G40 ", "");
        assert_eq!(errors(&format!("{control}\n{place}{without}")), []);
        let axes = if control == "G43.5 H2" { "A0 B0 C0" } else { "" };
        assert_eq!(errors(&format!("{control}\n{place}G49\nG43 H2\nG0 X-30. Y-20. Z30. {axes}\n{REST}")), []);
        assert_eq!(errors(&format!("{control}\n{place}G49\nG43 H2\n{place}{REST}")), []);
        // Switched on along a contour.
        let on = format!("{place}{}", REST.replace("X30.\n", &format!("X30.\n{control}\n")));
        assert_eq!(refused(&on, 5, "PRG-COMP-BLOCK"), ["leave the contour with G40 and a straight move first"]);
    }
}

/// A contour in a plane with a block on it, behind its third move, or behind its `G40` without a move away.
fn on_contour(block: &str) -> [String; 2] {
    let start = "G68.2 J30.\nG53.1\nG43 H1\nG0 X-30. Y-20. Z30.\nG41 D1 G1 X0 Y-10. F300\nY20.\nX30.\n";
    [
        format!("{start}{block}\nG1 X40. Y-5.\nG40 G1 X50. Y-10.\nM30\n"),
        format!("{start}G40\n{block}\nG1 X40. Y-5.\nM30\n"),
    ]
}

#[test]
fn nothing_gives_a_contour_other_coordinates() {
    let leave = "leave the contour with G40 and a straight move first";
    let beside = "move in the plane with the G40, straight and away from the part, before it";
    for block in ["G69", "G68.2 J40.", "G68.2 P1 I40.", "G53.1", "G53.6 H1", "G49", "G43 H2", "G69 G49"] {
        let [on, behind] = on_contour(block);
        assert_eq!(refused(&on, 8, "PRG-COMP-BLOCK"), [leave], "{block}");
        assert_eq!(refused(&behind, 9, "PRG-COMP-BLOCK"), [beside], "{block}");
    }
    // In the block of the G40 itself, and with the cures.
    for block in ["G40 G69", "G40 G49", "G40 G43 H2", "G40 G53.1"] {
        assert_eq!(refused(&on_contour(block)[0], 8, "PRG-COMP-BLOCK"), [beside], "{block}");
    }
    for block in ["G69", "G49", "G53.1", "G43 H2 Z40."] {
        let place = "G0 X-30. Y-20. Z30.";
        let [on, _] = on_contour(&format!("G40 G0 X40. Y40.\n{block}\n{place}"));
        assert_eq!(errors(&on), [], "{block}");
    }
    // In the block that begins the contour.
    for block in ["G43 H2", "G69"] {
        let text = on_contour("").map(|text| text.replace("G41 D1 G1", &format!("{block} G41 D1 G1")));
        assert_eq!(refused(&text[0], 5, "PRG-COMP-BLOCK"), ["write it in a block before"], "{block}");
    }
    // The same length moves nothing.
    assert_eq!(errors(&on_contour("G43 H1")[0]), []);
    // A plane that is tilted on a contour of the plain plane, or beside it.
    let start = "G0 X-30. Y-20. Z30.\nG41 D1 G1 X0 Y-10. F300\nY20.\nX30.\n";
    assert_eq!(refused(&format!("{start}G68.2 J30.\nM30\n"), 5, "PRG-COMP-BLOCK"), [leave]);
    assert_eq!(refused(&format!("{start}G40\nG68.2 J30.\nM30\n"), 6, "PRG-COMP-BLOCK"), [beside]);
    assert_eq!(refused(&format!("{start}G40 G68.2 J30.\nM30\n"), 5, "PRG-COMP-BLOCK"), [beside]);
    assert_eq!(errors(&format!("{start}G40 G0 X50.\nG68.2 J30.\nM30\n")), []);
}

#[test]
fn each_missing_g40_is_one_finding() {
    let contour = "G53.1\nG0 X-30. Y-20. Z30.\nG41 D1 G1 X0 Y-10. F300\nY20.\nX30.\nG0 Z30.\nG69\n";
    let text = format!("G68.2 J30.\n{contour}G68.2 J40.\n{contour}M30\n");
    assert_eq!(errors(&text), [(8, "PRG-COMP-BLOCK"), (16, "PRG-COMP-BLOCK")]);
}

#[test]
fn what_a_plane_does_not_permit_is_one_finding_with_both_ways_out() {
    for (block, code) in [("G55", "PRG-PLANE-BLOCK"), ("T2 M6", "PRG-PLANE-BLOCK"), ("G43.4 H1", "PRG-PLANE-BLOCK")] {
        for (text, line) in on_contour(block).into_iter().zip([8, 9]) {
            assert_eq!(
                refused(&text, line, code),
                ["leave the contour with G40 and a straight move, and cancel the plane with G69 behind that"],
                "{block}"
            );
        }
        let [on, _] = on_contour(&format!("G40 G0 X40. Y40.\nG69\n{}\nG0 X0 Y0 Z30.", block.replace("H1", "H1 (on)")));
        let found = errors(&on);
        assert!(found.iter().all(|(_, code)| *code == "PRG-TOOL-CONTROL-NESTED"), "{block}: {found:?}");
    }
    // An angle of a rotary axis.
    let [on, _] = on_contour("X35. A5.");
    assert_eq!(
        refused(&on, 8, "PRG-PLANE-BLOCK"),
        ["take it out of the contour: position the rotary axes before G68.2"]
    );
}

#[test]
fn a_refused_plane_says_nothing_of_its_contours() {
    let text = format!("G68.2 P5\nG53.1\nG0 X-30. Y-20. Z30.\n{}", REST.replace("M30", "G69\nM30"));
    assert_eq!(errors(&text), [(1, "PRG-PLANE-WORDS")]);
}

#[test]
fn what_a_contour_does_not_permit_is_the_same_in_a_plane() {
    for block in ["G18", "G28 Z0", "G53 G0 Z0", "G81 X40. Y0 Z-5. R2.", "D2", "G41 D2", "G42 D1", "G33 Z0 F1.", "M30"] {
        let [on, _] = on_contour(block);
        let plain = on.replace("G68.2 J30.\nG53.1", "(none)\n(none)");
        let [found, expected] = [on.as_str(), &plain].map(errors);
        assert!(!expected.is_empty(), "{block}");
        assert_eq!(found, expected, "{block}");
    }
}

#[test]
fn a_corner_in_a_plane_starts_from_a_known_place() {
    let corner = "G1 X10. ,R2. F300\nY20.\nM30\n";
    assert_eq!(
        refused(&format!("G68.2 J30.\nG53.1\n{corner}"), 3, "PRG-TOOL-CONTROL-HELD"),
        ["place every axis with G0 or G1 first"]
    );
    let rounded = format!("G68.2 J30.\nG53.1\nG0 X0 Y0 Z0\n{corner}");
    assert_eq!(errors(&rounded), []);
    check(
        &mill(),
        &rounded.replace("M30\n", ""),
        "guided align Preferred H0 rapid -> 0 ~XYZABC
         guided plane H0 rapid -> 0 ~ABC
         guided plane H0 cut -> X8 ~ABC @300/min
         guided plane H0 cut -> X10 Y2 ~ABC about 8,2 by 90 @300/min
         guided plane H0 cut -> X10 Y20 ~ABC @300/min",
    );
    // A length behind it, and words that belong to no cut.
    assert_eq!(errors("G68.2 J30.\nG53.1\nG0 X0 Y0 Z0\nG1 X10. ,R2. F300\nG43 H1 Y20.\nM30\n"), [(4, "PRG-CORNER")]);
    assert_eq!(errors("G68.2 J30.\nG53.1\nG0 X0 Y0 Z0\nG0 X10. ,R2.\nY20.\nM30\n"), [(4, "PRG-CORNER")]);
    // The angle of a line has a cure of its own.
    let (_, found) = read(&mill(), "G68.2 J30.\nG53.1\nG0 X0 Y0 Z0\nG1 X10. ,A30. F300\nM30\n");
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(
        found[0].message.starts_with("the angle of a line")
            && found[0].suggestions[0].message.contains("in place of its angle")
    );
}
