//! Curves, tilted planes, rigid taps and oscillation of a guided tool through the built binary, judged by forward kinematics written
//! down here once more.

use feedwave_contract::proto::oscillation_condition::Period;
use feedwave_contract::proto::waveform::Kind;
use feedwave_contract::proto::{
    AxisLetter, CreateMachineRequest, CreateToolRequest, CuttingEdge, DirectionOscillation, Frame, GetMachineRequest,
    HeldPeakWave, JobState, OscillationCondition, Tool, ToolGeometry, Waveform,
};
use feedwave_tests::{Clients, Server, Setpoints};

use crate::FEEDWAVE;
use crate::five_axis::{LENGTH_MM, ORIGIN_MM, Vec3, chain_axis, dot, forward, norm, set_up, setpoints, sub, submit};

/// Rows of a line with their machine axes X Y Z A C.
fn rows(setpoints: &Setpoints, line: u32) -> Vec<[f64; 5]> {
    let columns = ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"].map(|name| setpoints.column(name));
    let rows = (0..setpoints.len()).filter(|&row| setpoints.lines[row] == line);
    rows.map(|row| columns.map(|column| column[row])).collect()
}

/// Lines 4 (arc), 9 (turn about the tip), 12 (spline), 15 (rigid tap).
const PROGRAM: &str = "G43.5 H1
G0 X0 Y0 Z40 I0 J0.2 K1
G1 X1 F1500
G3 X41 R20 I0 J0.3 K1
G49
G68.2 P2 Q1 X5 Y-3 Z30
G68.2 P2 Q2 X15 Y-3 Z30
G68.2 P2 Q3 X5 Y7 Z25
G53.6 H1
G43 H1
G0 X0 Y0 Z20
G5.1 X30 Y10 I20 J-5
M29 S600
G0 X5 Y3 Z10
G95 G84 X5 Y3 Z-2 R4 P100 F1.25
G80
G69
M30
";

#[tokio::test]
async fn curves_planes_and_taps_of_a_guided_tool_are_where_the_program_says() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    let outcome = submit(&mut clients, "trunnion", "ball", PROGRAM).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let streamed = setpoints(&mut clients, &outcome.job.name, Frame::Machine, 0).await;

    let arc = rows(&streamed, 4);
    assert!(arc.len() > 500, "{}", arc.len());
    for axes in arc {
        let ([x, y, z], _) = forward(axes);
        assert!(((x - 21.0).hypot(y) - 20.0).hypot(z - 40.0) < 1e-9, "{x} {y} {z}");
    }
    // X of the plane is X, its normal leans by half as much as it rises.
    let (half, one) = (1.0 / 5.0_f64.sqrt(), 2.0 / 5.0_f64.sqrt());
    let axes = [[1.0, 0.0, 0.0], [0.0, one, -half], [0.0, half, one]];
    let in_plane = |point: Vec3| axes.map(|axis| dot(axis, sub(point, [5.0, -3.0, 30.0])));
    let turn = rows(&streamed, 9);
    let (rest, _) = forward(turn[0]);
    for axes in &turn {
        assert!(norm(sub(forward(*axes).0, rest)) < 1e-9, "the tip has moved");
    }
    let spline = rows(&streamed, 12);
    assert!(spline.len() > 500, "{}", spline.len());
    for axes_here in &spline {
        let (tip, direction) = forward(*axes_here);
        let [x, y, z] = in_plane(tip);
        // x = 40·t(1 − t) + 30·t², so that t follows, and y from it.
        let t = (40.0 - (1600.0 - 40.0 * x).max(0.0).sqrt()) / 20.0;
        let expected = -10.0 * t * (1.0 - t) + 10.0 * t * t;
        assert!((y - expected).abs() < 1e-8 && (z - 20.0).abs() < 1e-9, "{x} {y} {z}");
        assert!(norm(sub(direction, axes[2])) < 1e-9, "{direction:?}");
    }
    let tap = rows(&streamed, 15);
    let deepest = tap.iter().map(|axes| in_plane(forward(*axes).0)).inspect(|[x, y, z]| {
        assert!(*z > 4.0 || (x - 5.0).hypot(y - 3.0) < 1e-9, "{x} {y} {z}");
    });
    let deepest = deepest.map(|[.., z]| z).fold(f64::INFINITY, f64::min);
    assert!((deepest + 2.0).abs() < 1e-9, "{deepest}");
    // What controls read differently is refused with a cure.
    let refused = submit(&mut clients, "trunnion", "ball", "G68.2 P1 I10 J20\nM30\n").await;
    assert_eq!(refused.job.state(), JobState::Rejected);
    let finding = refused.report.findings.iter().find(|finding| finding.code == "PRG-PLANE-DOUBT");
    assert_eq!(finding.expect("a finding").suggestions.len(), 2);
}

/// The line of A in the head.
const PIVOT_MM: Vec3 = [0.0, 2.0, 100.0];

/// Tool centre point and direction of a head that swivels about A over a table that turns about C.
fn below_head([x, y, z, a_deg, c_deg]: [f64; 5]) -> (Vec3, Vec3) {
    let ((a_sine, a_cosine), (c_sine, c_cosine)) = (a_deg.to_radians().sin_cos(), c_deg.to_radians().sin_cos());
    let swivel = |[x, y, z]: Vec3| [x, a_cosine * y - a_sine * z, a_sine * y + a_cosine * z];
    let table = |[x, y, z]: Vec3| [c_cosine * x - c_sine * y, c_sine * x + c_cosine * y, z];
    let tip = swivel(sub([0.0, 0.0, -LENGTH_MM], PIVOT_MM));
    let tip = [tip[0] + PIVOT_MM[0] + x, tip[1] + PIVOT_MM[1] + y, tip[2] + PIVOT_MM[2] + z];
    (sub(table(tip), ORIGIN_MM), table(swivel([0.0, 0.0, 1.0])))
}

/// Makes `machines/head`, whose tool oscillates by condition 1, and `tools/cutter`.
async fn add_head(clients: &mut Clients) {
    let request = GetMachineRequest { name: "machines/trunnion".to_owned() };
    let response = clients.machines.get_machine(request).await.expect("the trunnion").into_inner();
    let mut machine = response.machine.expect("a machine");
    let profile = machine.profile.as_mut().expect("a profile");
    let (x, y, z, none) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]);
    profile.kinematics.as_mut().expect("five axes").chain = vec![
        chain_axis(AxisLetter::C, z, none, None),
        chain_axis(AxisLetter::X, x, none, None),
        chain_axis(AxisLetter::Y, y, none, None),
        chain_axis(AxisLetter::Z, z, none, None),
        chain_axis(AxisLetter::A, x, PIVOT_MM, None),
    ];
    let direction = |amplitude_mm, waveform: Option<Kind>| {
        let waveform = waveform.map(|kind| Waveform { kind: Some(kind) });
        Some(DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 })
    };
    profile.tool_oscillation = vec![OscillationCondition {
        name: "face".to_owned(),
        number: 1,
        period: Some(Period::PeriodsPerRev(1)),
        feed: direction(0.4, None),
        axial: direction(0.03, Some(Kind::HeldPeak(HeldPeakWave { hold_share: 0.3 }))),
        ..OscillationCondition::default()
    }];
    let request = CreateMachineRequest { machine_id: "head".to_owned(), machine: Some(machine) };
    clients.machines.create_machine(request).await.expect("the machine is made");
    let edge = |angle_deg| CuttingEdge { angle_deg, ..CuttingEdge::default() };
    let geometry = ToolGeometry {
        edges: [0.0, 90.0, 180.0, 270.0].map(edge).to_vec(),
        radius_mm: 60.0,
        radial_edge_length_mm: 1.5,
        axial_edge_height_mm: 5.0,
        end_relief_deg: 0.0,
    };
    let tool = Tool { number: 1, length_mm: Some(LENGTH_MM), geometry: Some(geometry), ..Tool::default() };
    let request = CreateToolRequest { tool_id: "cutter".to_owned(), tool: Some(tool) };
    clients.tools.create_tool(request).await.expect("the tool is made");
}

#[tokio::test]
async fn a_head_oscillates_along_its_own_axis_and_the_feed() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    add_head(&mut clients).await;
    let program =
        "T1 M6\nM3 S600\nG43.4 H1\nG0 X0 Y0 Z20 A-20 C0\nG202 P1 D1\nG1 X30 Y4 A-26 C5 F600\nG203\nG49\nM30\n";
    let outcome = submit(&mut clients, "head", "cutter", program).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let section = outcome.report.oscillations.first().expect("it oscillates");
    assert_eq!((section.min_feed_mm_per_min, section.max_feed_mm_per_min), (0.0, 900.0));
    let streamed = setpoints(&mut clients, &outcome.job.name, Frame::Machine, 0).await;
    let length_mm = 30.0_f64.hypot(4.0);
    let along = [30.0 / length_mm, 4.0 / length_mm, 0.0];
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for axes in rows(&streamed, 6) {
        let (tip, tool) = below_head(axes);
        let off = sub(tip, [0.0, 0.0, 20.0]);
        // Across feed and tool there is no offset; along the tool there is that of the condition.
        let beside = [
            along[1] * tool[2] - along[2] * tool[1],
            along[2] * tool[0] - along[0] * tool[2],
            along[0] * tool[1] - along[1] * tool[0],
        ];
        assert!(dot(off, beside).abs() < 1e-9, "{:e}", dot(off, beside));
        let across: Vec3 = std::array::from_fn(|k| off[k] - dot(off, along) * along[k]);
        let leaning: Vec3 = std::array::from_fn(|k| tool[k] - dot(tool, along) * along[k]);
        let retracted_mm = dot(across, leaning) / dot(leaning, leaning);
        (least, most) = (least.min(retracted_mm), most.max(retracted_mm));
    }
    // The feed's own offset is across the tool, and so a little along it as seen across the path.
    assert!(most > 0.02 && least < -0.02 && most < 0.3 && least > -0.3, "{least} {most}");
}
