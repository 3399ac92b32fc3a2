//! Radius compensation in a tilted plane (`G68.2`, `G53.1`, `G41`): the contour of the plain plane, move by move; and where it is
//! refused.

mod refused;

use super::*;
use crate::{AxisSet, CompensationCorner, CompensationEntry, CompensationSettings};

/// The radii of the tools T1 and T2, mm.
const RADII_MM: [f64; 2] = [3.0, 2.0];

fn with_rules(entry: CompensationEntry, corner: CompensationCorner) -> LanguageSettings {
    LanguageSettings { compensation: CompensationSettings { entry, corner }, ..mill() }
}

fn every_rule() -> Vec<LanguageSettings> {
    let corners = [CompensationCorner::Linear, CompensationCorner::Circular];
    let entries = [CompensationEntry::A, CompensationEntry::B, CompensationEntry::C];
    entries.into_iter().flat_map(|entry| corners.map(|corner| with_rules(entry, corner))).collect()
}

fn interpreter(settings: &LanguageSettings) -> Interpreter {
    let tool = |number: u32| {
        let radius_mm = RADII_MM[number as usize - 1];
        ToolOffset::new(number).with_length(100.0 / f64::from(number)).with_radius(radius_mm)
    };
    Interpreter::new(settings.clone()).with_tools(vec![tool(1), tool(2)])
}

fn read(settings: &LanguageSettings, program: &str) -> (Vec<Operation>, Vec<Finding>) {
    let (operations, findings) = interpreter(settings).read_all(program.as_bytes());
    assert!(!operations.iter().any(|operation| matches!(operation.kind, OperationKind::Compensation(_))));
    (operations, findings.findings().to_vec())
}

/// A program in the plane that its second and third line tilt; both are comments for the plain plane.
fn program(plane: &str, contour: &str) -> String {
    format!("G21 G17 G90 G94 F300\n{plane}\nG0 X-30. Y-20. Z30.\n{contour}\nM30\n")
}

const NO_PLANE: &str = "(no plane)\n(none)";

/// The operations with the step of each move alone, to the last bit.
fn to_the_bit(operations: &[Operation]) -> Vec<Vec<u8>> {
    let is_align = |kind: &OperationKind| matches!(kind, OperationKind::Guided(guided) if matches!(guided.guide, ToolGuide::Align { .. }));
    let others = operations.iter().filter(|operation| !is_align(&operation.kind));
    let alone = others.map(|operation| match &operation.kind {
        OperationKind::Guided(guided) => {
            Operation { span: operation.span, kind: OperationKind::Move(guided.step.clone()) }
        }
        _ => operation.clone(),
    });
    alone.map(|operation| postcard::to_stdvec(&operation).expect("plain data")).collect()
}

/// Origin and Euler angles of planes.
const PLANES: [&str; 4] =
    ["G68.2 X0 Y0 Z0 I0 J30. K0", "G68.2 X12.5 Y-7. Z3. I40. J-65. K110.", "G68.2 X1. I90. J90.", "G68.2 K25."];

/// Entries, contours and exits; `G41` is `G42` for the other side.
const CONTOURS: [&str; 14] = [
    // Outside and inside corners of lines, right, obtuse and acute.
    "G1 Z-2.\nG41 D1 X0 Y-10.\nY20.\nX30.\nX12. Y5.\nX45. Y0.\nG40 X50. Y-20.\nG0 Z30.",
    // Lines and arcs, tangent and with corners, inside and outside.
    "G41 D1 G1 X0 Y-10.\nY20.\nG2 X20. I10.\nG1 Y5.\nG3 X40. I10.\nG1 Y25.\nX60.\nG40 X70.",
    // Leads of a quarter circle, and a full circle between them.
    "G41 D1 G1 X-25. Y-15.\nG3 X-15. Y-5. J10.\nG3 I-15. J0\nG3 X-25. Y5. I-10.\nG40 G1 X-35.",
    // Helices, down and up.
    "G41 D1 G1 X0 Y-10.\nY20.\nG2 X20. I10. Z-2.\nG1 Y0\nG3 X40. I10. Z4.\nG1 Y30.\nG40 X60.",
    // Blocks without motion in the plane, and moves across it.
    "G41 D1\nG1 X0 Y-10.\nY20.\nM8\nZ-3.\nX30.\nG4 P100\nM9\nY0\nG40\nX50. Y-10.",
    // Rapids, and blocks that move nothing.
    "G0 G41 D1 X0 Y-10.\nG1 Y20.\nY20.\nX0\nG0 X30.\nG1 Y0\nG91 X0\nG90 Z30.\nG40 G0 X50.",
    // Increments, inverse time, exact stop, the other radius, and spindle and feed between blocks.
    "G41 D2 G91 G1 X30. Y10.\nG93 Y30. F5\nX30. F4\nG94 F500 S900 M3\nG61 Y-40.\nG64 X5. Y-5.\nG40 X20.",
    // Straight on behind the contour, from beside it to the programmed point and down.
    "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40 X30. Y20.\nZ-5.",
    "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40\nG0 Y20.\nZ-5.",
    // Nothing names a place in the plane.
    "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40 Z-5.\nZ5.\nX40.",
    // Holes behind the contour.
    "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40\nG81 X30. Y20. Z-5. R2. F100\nX40.\nG80",
    // Two contours, the second one right behind the first.
    "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40\nG42 D2\nX40. Y-5.\nX20. Y-15.\nX0\nG40 X-20.",
    // Chamfers and roundings on the contour.
    "G41 D1 G1 X0 Y-10.\nY20. ,R4.\nX30. ,C5.\nY0 ,R3.5\nG3 X60. I15.\nG1 Y20.\nG40 X70.",
    // A subprogram, twice.
    "M98 P1000\nG91 G0 X50.\nG90 M98 P1000\nG0 Z40.\nM30\nO1000\nG91 G41 D1 G1 X20. Y5.\nY20.\nX10.\nG40 X10. Y-9.\nG90\nM99",
];

fn sides(contour: &str) -> [String; 2] {
    [contour.to_owned(), contour.replace("G42", "G4x").replace("G41", "G42").replace("G4x", "G41")]
}

#[test]
fn a_contour_in_a_tilted_plane_is_that_of_the_plain_plane_to_the_bit() {
    let mut compensated = 0;
    for settings in every_rule() {
        for contour in CONTOURS.into_iter().flat_map(sides) {
            let (plain, said) = read(&settings, &program(NO_PLANE, &contour));
            assert!(said.iter().all(|found| found.severity != Severity::Error), "{contour}: {said:#?}");
            let off = contour.replace("G41", "").replace("G42", "").replace("D1", "").replace("D2", "");
            let (programmed, _) = read(&settings, &program(NO_PLANE, &off));
            compensated += u32::from(to_the_bit(&programmed) != to_the_bit(&plain));
            for plane in PLANES {
                let (tilted, found) = read(&settings, &program(&format!("{plane}\nG53.1"), &contour));
                assert_eq!(to_the_bit(&tilted), to_the_bit(&plain), "{plane}: {contour}");
                let brief = |found: &[Finding]| {
                    found.iter().map(|it| (it.code, it.severity, it.span, it.message.clone())).collect::<Vec<_>>()
                };
                assert_eq!(brief(&found), brief(&said), "{plane}: {contour}");
            }
        }
    }
    assert_eq!(compensated, 6 * 2 * 14);
}

#[test]
fn other_planes_than_that_of_x_and_y_are_compensated_in_the_plane_as_well() {
    let zx = "G18 G41 D1 G1 X0 Z-10.\nZ20.\nX30. R4.\nG2 X50. Z20. I10.\nG1 Z0\nG40 X60. Z-20.".replace(" R4.", "");
    let yz = "G19 G41 D1 G1 Y0 Z-10.\nZ20.\nY30.\nG3 Y50. Z20. J10.\nG1 Z40.\nX5.\nY70.\nG40 Y80.";
    for settings in every_rule() {
        for contour in [zx.as_str(), yz].into_iter().flat_map(sides) {
            let (plain, said) = read(&settings, &program(NO_PLANE, &contour));
            assert!(said.iter().all(|found| found.severity != Severity::Error), "{contour}: {said:#?}");
            let (tilted, _) = read(&settings, &program("G68.2 X3. I20. J40. K-15.\nG53.1", &contour));
            assert_eq!(to_the_bit(&tilted), to_the_bit(&plain), "{contour}");
        }
    }
}

#[test]
fn what_a_guided_move_holds_beside_its_step_is_kept() {
    // Pieces at outside corners and the way beside the start of type C as well.
    let contour = "G43 H2 G0 Z20.\nG41 D1\nG1 X0 Y-10.\nY20.\nX30.\nX5. Y-5.\nG40 X50. Y-10.";
    let settings = with_rules(CompensationEntry::C, CompensationCorner::Circular);
    let (operations, findings) = read(&settings, &program("G68.2 X5. J30.\nG53.1", contour));
    assert_eq!(findings.len(), 0, "{findings:#?}");
    let guided = operations.iter().filter_map(|operation| match &operation.kind {
        OperationKind::Guided(guided) if guided.guide == ToolGuide::Plane => Some((operation.span.line, guided)),
        _ => None,
    });
    let guided: Vec<_> = guided.collect();
    // The placing in two blocks, the way beside the start, the entry, two blocks with an arc before the second, one with an arc
    // before it, and the exit.
    assert_eq!(guided.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [4, 5, 7, 7, 8, 9, 9, 10, 10, 11]);
    for (line, it) in &guided[1..] {
        assert_eq!(it.plane, Some(crate::TiltedPlane::by_euler_angles([5.0, 0.0, 0.0], [0.0, 30.0, 0.0], 2)), "{line}");
        assert_eq!((it.held, it.turned), (AxisSet::ROTARY, AxisSet::NONE), "{line}");
        assert_eq!((it.length_offset, it.tool_length_mm), (2, Some(50.0)), "{line}");
    }
    // The corner at X0 Y20 is gone around at the radius of the tool.
    let arc = guided[5].1.step.arc.expect("an arc about the corner");
    assert_eq!((arc.center, arc.clockwise), ([0.0, 20.0], true));
    assert_eq!(guided[5].1.step.start[..3], [-3.0, 20.0, 20.0]);
    assert_eq!(guided[5].1.step.end[..3], [0.0, 23.0, 20.0]);
}

/// Operations with the state stored and taken up again before every line.
fn resumed(settings: &LanguageSettings, program: &str) -> Vec<Operation> {
    let tools = interpreter(settings).tools;
    let mut state = Interpreter::new(settings.clone()).state().clone();
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for line in program.split_inclusive('\n') {
        let bytes = postcard::to_stdvec(&state).expect("plain data");
        let stored: InterpreterState = postcard::from_bytes(&bytes).expect("its own bytes");
        assert_eq!(stored, state);
        let mut again = Interpreter::restore(settings.clone(), stored).with_tools(tools.clone());
        let _ = again.read_line(line.as_bytes(), false, &mut operations, &mut findings);
        state = again.state().clone();
    }
    operations
}

#[test]
fn a_contour_in_a_tilted_plane_goes_on_from_a_stored_state() {
    for settings in every_rule() {
        for contour in CONTOURS.iter().filter(|contour| !contour.contains("M98")) {
            let text = program("G68.2 X5. I10. J30. K20.\nG53.1", contour);
            let (whole, _) = read(&settings, &text);
            assert_eq!(resumed(&settings, &text), whole, "{contour}");
        }
    }
}

/// Behind `G69` the rotary axes stay where the plane had them, until words place them: moves of the linear axes are guided ones.
#[test]
fn a_contour_behind_the_plane_is_that_of_plain_axes() {
    for settings in every_rule() {
        for contour in CONTOURS.into_iter().flat_map(sides) {
            let (plain, said) = read(&settings, &program(NO_PLANE, &contour));
            let (behind, found) =
                read(&settings, &program("G68.2 J30.\nG53.1 (on)\nG69", &contour).replacen('\n', " ", 1));
            let held = behind
                .iter()
                .any(|operation| matches!(&operation.kind, OperationKind::Guided(it) if it.guide == ToolGuide::Axes));
            assert!(held, "{contour}");
            assert_eq!(to_the_bit(&behind), to_the_bit(&plain), "{contour}");
            assert_eq!(found.len(), said.len(), "{contour}: {found:#?}");
        }
    }
}

#[test]
fn rotary_words_between_the_blocks_behind_a_plane_turn_nothing_at_corners() {
    let contour = "G41 D1 G1 X0 Y-10.\nY20.\nX30. C45.\nY0\nG40 X50.";
    let settings = with_rules(CompensationEntry::A, CompensationCorner::Circular);
    let (operations, findings) = read(&settings, &program("G68.2 J30.\nG53.1\nG69", contour));
    assert!(findings.iter().all(|found| found.severity != Severity::Error), "{findings:#?}");
    let at_corner: Vec<_> = operations
        .iter()
        .filter_map(|operation| match &operation.kind {
            OperationKind::Guided(guided) if operation.span.line == 8 => Some(guided.as_ref()),
            _ => None,
        })
        .collect();
    let [around, along] = at_corner[..] else { panic!("{at_corner:#?}") };
    assert!(around.step.arc.is_some() && around.held.contains(Axis::C), "{around:#?}");
    assert!(!along.held.contains(Axis::C) && along.step.end[Axis::C.index()] == 45.0, "{along:#?}");
}

#[test]
fn places_of_the_machine_are_gone_to_from_beside_a_contour() {
    let contour = "G41 D1 G1 X0 Y-10.\nY20.\nX30.\nG40\n";
    for (behind, codes) in [
        ("G91 G28 Z0", vec!["PRG-COMP-EXIT-ASIDE"]),
        ("G53 G0 Z0", vec!["PRG-COMP-EXIT-ASIDE"]),
        ("G53 G0 X0 Y0 Z0", vec![]),
        // Over the programmed point, along the contour.
        ("G91 G28 X0 Y0 Z0", vec!["PRG-COMP-GOUGE"]),
        ("G0 X40. Y40.\nG53 G0 Z0", vec![]),
    ] {
        let text = program("G68.2 J30.\nG53.1", &format!("{contour}{behind}\nG90 G69\nG0 X0 Y0 Z0"));
        let (operations, findings) = read(&mill(), &text);
        assert_eq!(findings.iter().map(|it| it.code.name()).collect::<Vec<_>>(), codes, "{behind}: {findings:#?}");
        let last = operations.iter().rev().find_map(|operation| match &operation.kind {
            OperationKind::Guided(guided) if guided.guide == ToolGuide::Axes => Some(guided.held),
            _ => None,
        });
        assert_eq!(last, Some(AxisSet::ROTARY), "{behind}");
    }
}
