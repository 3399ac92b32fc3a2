//! What a five-axis program may not ask for, with numbers.

use feedwave_cutting::{GenerationMode, PipelineConfig};
use feedwave_program::{Axis, Finding};

use super::machine::config;
use crate::common::validate;

fn findings(program: &str, config: &PipelineConfig) -> Vec<Finding> {
    validate(&format!("{program}\nM30\n"), config).findings
}

/// The only finding of a program that is refused.
#[track_caller]
fn refusal(program: &str, config: &PipelineConfig) -> Finding {
    let report = validate(&format!("{program}\nM30\n"), config);
    assert!(!report.is_accepted() && report.findings.len() == 1, "{:#?}", report.findings);
    let finding = report.findings.into_iter().next().expect("one");
    assert!(!finding.suggestions.is_empty(), "{finding:?}");
    finding
}

fn value(finding: &Finding, name: &str) -> f64 {
    finding.values.iter().find(|value| value.name == name).unwrap_or_else(|| panic!("{name}: {finding:?}")).value
}

#[test]
fn missing_data() {
    let mut without = config();
    without.profile.kinematics = None;
    assert_eq!(refusal("G43.4 H1 G0 Z100", &without).code, "FIVE-AXIS-KINEMATICS");
    let finding = refusal("G43.4 H7 G0 Z100", &config());
    assert_eq!((finding.code.name(), value(&finding, "length_offset")), ("PRG-TOOL-LENGTH", 7.0));
    let mut no_length = config();
    no_length.tools[0].offset.geometry = None;
    // Once, not in every block.
    assert_eq!(refusal("G43.4 H1 G0 Z100\nZ90\nZ80", &no_length).code, "PRG-TOOL-LENGTH");
}

#[test]
fn directions_that_cannot_be() {
    let finding = refusal("G43.4 H1 G0 Z100 A40", &config());
    assert_eq!(finding.code, "FIVE-AXIS-RANGE");
    assert!((value(&finding, "excess") - 10.0).abs() < 1e-9);
    let cures = |finding: &Finding| finding.suggestions.iter().map(|it| it.message.clone()).collect::<Vec<_>>();
    let [other, keep, clamp] = [
        "turn to C 180.000 and A -40.000 degrees, which give the same tool direction within the ranges",
        "keep A from -120.000 to 30.000 degrees",
        "clamp the work in another position",
    ];
    assert_eq!(cures(&finding), [other, keep, clamp]);
    let angle = finding.suggestions[1].value.as_ref().expect("an angle");
    assert!((angle.value - 30.0).abs() < 1e-9);
    // Neither solution, where the other one has A -150.
    assert_eq!(cures(&refusal("G43.4 H1 G0 Z100 A150", &config())), [keep, clamp]);
    // In the numbers of the program where it counts from elsewhere.
    let mut offset = config();
    offset.profile.language.work_offsets[0][3] = 10.0;
    assert_eq!(cures(&refusal("G43.4 H1 G0 Z100 A40", &offset))[1], "keep A from -130.000 to 20.000 degrees");
    assert_eq!(refusal("G43.4 H1 G0 Z100 B5", &config()).code, "AXIS-MISSING");
    let opposite = "G43.5 H1 G0 X0 Y0 Z100 I0 J1 K0\nI0 J-1 K0";
    assert_eq!(refusal(opposite, &config()).code, "FIVE-AXIS-OPPOSITE");
}

#[test]
fn axes_that_would_leave_their_travel() {
    let mut config = config();
    config.profile.machine.axes[1].travel_min = Some(-100.0);
    // The work swings away from under the spindle.
    let program = "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nG1 Y-60 F1000\nA-90";
    let found = findings(program, &config);
    let finding = found.iter().find(|finding| finding.code == "AXIS-TRAVEL").unwrap_or_else(|| panic!("{found:#?}"));
    assert_eq!(finding.span.line, 3);
    assert!(value(finding, "position") < -100.0);
}

#[test]
fn axes_that_would_leave_their_range_without_tool_centre_point_control() {
    // A goes from -120 to 30 degrees.
    let config = config();
    for (program, position) in [
        ("G0 A90", 90.0),
        ("G1 A-179 F500", -179.0),
        ("G53 G0 A45", 45.0),
        ("G10 L2 P1 A20\nG0 A20", 40.0),
        ("G93 G1 A40 F1", 40.0),
        ("G91 G28 A45", 45.0),
    ] {
        let finding = refusal(program, &config);
        assert_eq!((finding.code.name(), value(&finding, "position")), ("AXIS-TRAVEL", position), "{program}");
    }
    for program in ["G0 A30\nG1 A-120 F500", "G0 C720", "G43.4 H1 G0 X0 Y0 Z20 A-120 C0\nG1 X10 A30 F1000"] {
        let found = findings(program, &config);
        assert!(found.iter().all(|finding| finding.code != "AXIS-TRAVEL"), "{program}: {found:#?}");
    }
    // A linear one, also where the work swings.
    let mut short = config;
    let chain = &mut short.profile.kinematics.as_mut().expect("kinematics").chain;
    let x = chain.iter_mut().find(|link| link.axis == Axis::X).expect("X");
    x.range = Some([-20.0, 20.0]);
    for program in ["G0 X30", "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nG1 X30 F1000", "G43.4 H1 G0 X0 Y30 Z20 A0 C0\nG1 C90 F1000"]
    {
        assert!(findings(program, &short).iter().any(|finding| finding.code == "AXIS-TRAVEL"), "{program}");
    }
}

#[test]
fn vibration_goes_along_the_path_only() {
    let program = "G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nG200 F50 A0.05\nG1 X20 A-25 F1000\nG201";
    let mut config = config();
    let found = findings(program, &config);
    assert!(found.iter().all(|finding| !finding.code.name().starts_with("VIB-FIVE")), "{found:#?}");
    config.generation_mode = GenerationMode::Tangential;
    let found = findings(program, &config);
    assert!(found.iter().any(|finding| finding.code == "VIB-FIVE-AXIS"), "{found:#?}");
    let still = "G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nG200 F50 A0.05\nG1 A-25 F1000\nG201";
    config.generation_mode = GenerationMode::AlongPath;
    let found = findings(still, &config);
    assert!(found.iter().any(|finding| finding.code == "VIB-ROTARY-ONLY"), "{found:#?}");
}

#[test]
fn a_pole_is_named_with_its_block() {
    let program = "G43.5 H1 G0 X0 Y0 Z20 I0 J-.2 K1\nG1 X5 I0 J0 K1 F1000\nX10 I.2 J0 K1";
    let found = findings(program, &config());
    let finding =
        found.iter().find(|finding| finding.code == "FIVE-AXIS-SINGULAR").unwrap_or_else(|| panic!("{found:#?}"));
    assert_eq!(finding.span.line, 3);
    assert!((value(finding, "turn") - 90.0).abs() < 1e-6, "{finding:?}");
    assert!(value(finding, "pole_distance") < 1e-6);
    // A rapid has no feed to limit; a cut through the pole after it has.
    let approach = "G43.5 H1 G0 X0 Y0 Z20 I0 J0 K1\nG0 X5 I.2 J0 K1\nG0 X0 I0 J0 K1";
    let cut = "G0 X0 I0 J-.2 K1\nG1 X5 I0 J0 K1 F1000\nX10 I.2 J0 K1";
    let singular = |program: &str| {
        let found = findings(program, &config());
        found.iter().filter(|finding| finding.code == "FIVE-AXIS-SINGULAR").map(|it| it.span.line).collect::<Vec<_>>()
    };
    assert_eq!(singular(approach), []);
    assert_eq!(singular(&format!("{approach}\n{cut}")), [6]);
}

#[test]
fn what_thinning_did_is_said() {
    // Equal directions, other angles: the tool lies along C.
    let program = "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nM33\nG1 X1 F1000\nX2 C90\nX3 C0\nM34";
    let found = findings(program, &config());
    let finding = found.iter().find(|finding| finding.code == "THIN-ROTARY").unwrap_or_else(|| panic!("{found:#?}"));
    assert_eq!((finding.span.line, value(finding, "blocks")), (4, 1.0));
    assert!((value(finding, "deviation") - 90.0).abs() < 1e-9);
    assert!(finding.message.contains("within it of the kept block before"), "{}", finding.message);
    // 0°, 1°, 2°, 60° at θ = 3°.
    let mut config = config();
    config.profile.thinning.angle_tolerance_deg = 3.0;
    let program = "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nM33\nG1 X1 F1000\nX2 A-1\nX3 A-2\nX4 A-60\nM34";
    let found = findings(program, &config);
    let finding = found.iter().find(|finding| finding.code == "THIN-DIRECTION").unwrap_or_else(|| panic!("{found:#?}"));
    assert_eq!(finding.span.line, 5);
    assert!((value(finding, "deviation") - 38.0).abs() < 1e-9);
}
