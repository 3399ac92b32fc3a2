//! Tool oscillation through the service: a machine with conditions, a tool with its edges, the worked example as a job.

use feedwave_contract::proto::leading_edge::Rotation;
use feedwave_contract::proto::oscillation_condition::Period;
use feedwave_contract::proto::oscillation_roles as report;
use feedwave_contract::proto::validate_program_request::On;
use feedwave_contract::proto::waveform::Kind;
use feedwave_contract::proto::{
    CreateJobRequest, CreateMachineRequest, CreateToolRequest, CuttingEdge, DirectionOscillation, Engagement,
    EngagementWidth, GetMachineRequest, GetReportRequest, GetToolRequest, HeldPeakWave, JobState, LeadingEdge, Machine,
    OscillationCondition, OscillationDirection, OscillationFloorSettings, OscillationRequest, OscillationSectionReport,
    Tool, ToolGeometry, ValidateProgramRequest, ValidationReport, Waveform, WorkSide, engagement,
};

use crate::support::{TestServer, lathe_job, stream_of, told};

/// The worked example of docs/functions/tool-oscillation.md: 600 rev/min, 600 mm/min, 1 mm deep.
const PROGRAM: &str = "G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30\n";

fn direction(amplitude_mm: f64, waveform: Option<Kind>) -> Option<DirectionOscillation> {
    let waveform = waveform.map(|kind| Waveform { kind: Some(kind) });
    Some(DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 })
}

fn condition() -> OscillationCondition {
    OscillationCondition {
        name: "accuracy".to_owned(),
        number: 1,
        period: Some(Period::PeriodsPerRev(1)),
        feed: direction(0.4, None),
        axial: direction(0.03, Some(Kind::HeldPeak(HeldPeakWave { hold_share: 0.3 }))),
        ..Default::default()
    }
}

fn tool() -> Tool {
    let edge = |angle_deg| CuttingEdge { angle_deg, ..Default::default() };
    Tool {
        number: 4,
        geometry: Some(ToolGeometry {
            edges: [0.0, 90.0, 180.0, 270.0].map(edge).to_vec(),
            radius_mm: 60.0,
            radial_edge_length_mm: 1.5,
            axial_edge_height_mm: 5.0,
            end_relief_deg: 0.0,
        }),
        ..Default::default()
    }
}

async fn report_of(test: &TestServer, job: String) -> ValidationReport {
    test.jobs().get_report(GetReportRequest { job }).await.unwrap().into_inner().report.unwrap()
}

fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
}

/// The condition that three periods per revolution cannot keep with four edges.
fn odd() -> OscillationCondition {
    OscillationCondition { name: "odd".to_owned(), number: 3, period: Some(Period::PeriodsPerRev(3)), ..condition() }
}

/// The mill of the service with these conditions.
async fn mill_with(test: &TestServer, conditions: Vec<OscillationCondition>) -> Machine {
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let mut machine = test.machines().get_machine(request).await.unwrap().into_inner().machine.unwrap();
    let profile = machine.profile.as_mut().unwrap();
    let codes = profile.language.as_ref().unwrap().tool_oscillation.unwrap();
    assert_eq!((codes.on, codes.off), (202.0, 203.0));
    profile.tool_oscillation = conditions;
    machine
}

/// A service with the oscillating mill and its cutter.
async fn oscillating() -> TestServer {
    let test = TestServer::start().await;
    let machine = mill_with(&test, vec![condition(), odd()]).await;
    let create = CreateMachineRequest { machine_id: "oscillating".to_owned(), machine: Some(machine) };
    let stored = test.machines().create_machine(create).await.unwrap().into_inner().machine.unwrap();
    assert_eq!(stored.profile.unwrap().tool_oscillation.len(), 2);
    let create = CreateToolRequest { tool_id: "cutter".to_owned(), tool: Some(tool()) };
    test.tools().create_tool(create).await.unwrap();
    let request = GetToolRequest { name: "tools/cutter".to_owned() };
    let stored = test.tools().get_tool(request).await.unwrap().into_inner().tool.unwrap();
    assert_eq!(stored.geometry, tool().geometry);
    test
}

/// A job on that mill with its cutter.
fn on_mill(program: &str) -> CreateJobRequest {
    CreateJobRequest {
        machine: "machines/oscillating".to_owned(),
        tools: vec!["tools/cutter".to_owned()],
        ..lathe_job(program)
    }
}

/// Every edge cuts the layers of the worked example.
fn assert_layers(section: &OscillationSectionReport) {
    // Lower and upper end of every layer, where its edge meets it and where it leaves it.
    let expected: [&[[f64; 4]]; 4] = [
        &[[0.0, 0.03, -0.5, 0.0], [0.03, 1.0, -0.35, 0.0]],
        &[[0.03, 1.0, 0.0, 0.65]],
        &[[0.0, 0.03, 0.0, 0.5]],
        &[[-0.03, 0.0, -0.65, 0.35]],
    ];
    for (edge, expected) in section.edges.iter().zip(expected) {
        let found: Vec<_> = edge.layers.iter().map(|l| [l.low_mm, l.high_mm, l.from_mm, l.to_mm]).collect();
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (value, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert_near(*value, *expected, 1e-12);
        }
    }
    assert_near(section.edges.iter().map(|edge| edge.area_mm2).sum(), 1.03, 1e-12);
    assert_near(section.edges.iter().map(|edge| edge.volume_share).sum(), 1.0, 1e-12);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_worked_example_is_judged_edge_by_edge_and_streamed() {
    let test = oscillating().await;
    let job = test.ready(on_mill(PROGRAM)).await;
    let report = report_of(&test, job.name.clone()).await;
    assert_eq!(report.summary.unwrap().oscillation_count, 1);
    let [section] = report.oscillations.as_slice() else { panic!("{} oscillations", report.oscillations.len()) };
    assert_eq!((section.on_line, section.line, section.tool), (4, 5, 4));
    assert_eq!((section.condition.as_str(), section.periods_per_rev, section.edges_per_period), ("accuracy", 1, 4.0));
    assert!(section.feasible);
    assert_near(section.hold_share, 0.3, 1e-12);
    assert_near(section.required_hold_share, 0.25, 1e-12);
    assert_eq!((section.leading_edge, section.finishing_edges.as_slice()), (1, &[4][..]));
    let axial = section.loads.iter().find(|load| load.direction() == OscillationDirection::Axial).unwrap();
    assert_near(axial.acceleration_step_mm_per_s2, 740.22, 0.01);
    assert_near(section.feed_mm_per_period, 1.0, 1e-12);
    assert_layers(section);

    // The tool axis goes by the amplitude to both sides of the depth, and ends on it.
    let (_, chunks) = test.collect(stream_of(&job)).await;
    let z = crate::support::column(&chunks, 2);
    let (low, high) = z[z.len() / 3..2 * z.len() / 3].iter().fold((0.0f64, -9.0f64), |(a, b), &z| (a.min(z), b.max(z)));
    assert_near(low, -1.03, 1e-9);
    assert_near(high, -0.97, 1e-9);
    assert_eq!(*z.last().unwrap(), -1.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_of_oscillations_say_what_with_numbers_and_a_cure() {
    let test = oscillating().await;
    for (program, tools, code, value) in [
        (PROGRAM.replace("P1", "P3"), true, "OSC-EDGES-PERIOD", ("periods_per_rev", 3.0, "periods_per_rev")),
        (PROGRAM.replace("F600", "F1200"), true, "OSC-STEP-LONG", ("feed_per_period", 2.0, "feed")),
        (PROGRAM.replace("P1", "P9"), true, "OSC-CONDITION-UNKNOWN", ("condition", 9.0, "")),
        (PROGRAM.to_owned(), false, "OSC-TOOL-UNKNOWN", ("tool", 4.0, "")),
    ] {
        let mut request = on_mill(&program);
        if !tools {
            request.tools.clear();
        }
        let job = test.validated(request).await;
        assert_eq!(job.state(), JobState::Rejected, "{code}");
        let report = report_of(&test, job.name).await;
        let finding = report.findings.iter().find(|finding| finding.code == code);
        let finding = finding.unwrap_or_else(|| panic!("no {code} among {:?}", report.findings));
        let (name, number, cure) = value;
        let stated = finding.values.iter().find(|value| value.name == name).unwrap();
        assert_near(stated.value, number, 1e-9);
        let suggested = finding.suggestions[0].value.as_ref().map_or("", |value| value.name.as_str());
        assert_eq!(suggested, cure);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn impossible_conditions_and_edges_are_not_stored_at_all() {
    let test = TestServer::start().await;
    let impossible = OscillationCondition { axial: None, ramp_periods: Some(101), ..odd() };
    let machine = mill_with(&test, vec![condition(), impossible]).await;
    let create = CreateMachineRequest { machine_id: "broken".to_owned(), machine: Some(machine) };
    let (_, _, fields) = told(&test.machines().create_machine(create).await.unwrap_err());
    assert_eq!(fields, ["machine.profile.tool_oscillation[1].axial"]);
    let mut broken = tool();
    broken.geometry.as_mut().unwrap().radius_mm = 0.0;
    broken.geometry.as_mut().unwrap().edges[3].angle_deg = 180.0;
    let create = CreateToolRequest { tool_id: "broken".to_owned(), tool: Some(broken) };
    let (_, _, fields) = told(&test.tools().create_tool(create).await.unwrap_err());
    assert!(fields.contains(&"tool.geometry.radius_mm".to_owned()), "{fields:?}");
    assert!(fields.contains(&"tool.geometry.edges[3].angle_deg".to_owned()), "{fields:?}");
}

/// A machine with the conditions "accuracy" (1) and "speed" (2), in which the lead moves on every ten parts.
async fn rotating_machine(test: &TestServer) {
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let mut machine = test.machines().get_machine(request).await.unwrap().into_inner().machine.unwrap();
    let profile = machine.profile.as_mut().unwrap();
    // Every value is stated.
    let floor = profile.oscillation_floor.unwrap();
    assert_eq!((floor.simulate, floor.resolution_mm, floor.max_cells), (Some(true), Some(0.02), Some(400_000)));
    profile.oscillation_floor = Some(OscillationFloorSettings { revolutions: Some(1), ..Default::default() });
    let leading = LeadingEdge { rotation: Some(Rotation::EveryParts(10)), ..Default::default() };
    let accuracy = OscillationCondition { leading_edge: Some(leading), ..condition() };
    let speed = OscillationCondition {
        name: "speed".to_owned(),
        number: 2,
        feed: direction(0.2, None),
        engagement: Some(Engagement {
            kind: Some(engagement::Kind::Width(EngagementWidth { width_mm: 30.0, side: WorkSide::Right.into() })),
        }),
        ..condition()
    };
    profile.tool_oscillation = vec![accuracy, speed];
    let create = CreateMachineRequest { machine_id: "rotating".to_owned(), machine: Some(machine) };
    test.machines().create_machine(create).await.unwrap();
    let mut tool = tool();
    tool.geometry.as_mut().unwrap().end_relief_deg = 1.0;
    let create = CreateToolRequest { tool_id: "cutter".to_owned(), tool: Some(tool) };
    test.tools().create_tool(create).await.unwrap();
}

fn asking(program: &str, oscillation: OscillationRequest) -> CreateJobRequest {
    CreateJobRequest {
        machine: "machines/rotating".to_owned(),
        tools: vec!["tools/cutter".to_owned()],
        oscillation: Some(oscillation),
        ..lathe_job(program)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_says_which_part_it_is_and_the_lead_moves_on() {
    let test = TestServer::start().await;
    rotating_machine(&test).await;
    let mut streams = Vec::new();
    for (parts_before, edge) in [(0, 1), (25, 3), (42, 1)] {
        let asked = OscillationRequest { parts_before, ..Default::default() };
        let job = test.ready(asking(PROGRAM, asked.clone())).await;
        assert_eq!(job.settings.as_ref().unwrap().oscillation, Some(asked));
        let report = report_of(&test, job.name.clone()).await;
        let section = &report.oscillations[0];
        let roles = section.roles.unwrap();
        assert_eq!((section.leading_edge, roles.first_edge, roles.changes), (edge, 1, parts_before / 10));
        assert_eq!((roles.parts_before, roles.rotation), (parts_before, Some(report::Rotation::EveryParts(10))));
        assert!(report.findings.iter().any(|finding| finding.code == "OSC-ROLES-TURNED"));
        assert_near(report.summary.unwrap().oscillating_cutting_time_s, 3.0, 1e-9);
        let (_, chunks) = test.collect(stream_of(&job)).await;
        streams.push(crate::support::column(&chunks, 0));
    }
    assert_ne!(streams[0], streams[1]);
    assert_eq!(streams[0], streams[2]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_chooses_the_condition_and_the_report_has_the_floor() {
    let test = TestServer::start().await;
    rotating_machine(&test).await;
    let named = |name: &str| OscillationRequest { condition: name.to_owned(), ..Default::default() };
    let job = test.ready(asking(&PROGRAM.replace("P1 ", ""), named("speed"))).await;
    let report = report_of(&test, job.name).await;
    let section = &report.oscillations[0];
    assert_eq!((section.condition.as_str(), section.loads[0].amplitude_mm), ("speed", 0.2));
    let cut = section.cut.unwrap();
    assert_near(cut.engagement_start_deg, 30.0, 1e-9);
    assert_near(section.plane_deg, 30.0, 1e-9);
    let floor = section.floor.unwrap();
    assert_eq!((floor.length_mm, floor.resolution_mm, floor.trailing), (1.0, 0.02, true));
    assert_near(floor.across_mm, 45.0, 1e-9);
    let (oscillating, plain) = (floor.oscillating.unwrap(), floor.plain.unwrap());
    assert!(oscillating.peak_to_valley_mm > plain.peak_to_valley_mm && plain.peak_to_valley_mm > 0.0);
    assert!(oscillating.mean_mm > plain.mean_mm && plain.mean_mm > 0.0, "{floor:?}");
    assert_near(oscillating.height_mm, -0.022, 0.008);

    // Another one than the program's is said.
    let job = test.ready(asking(PROGRAM, named("speed"))).await;
    let report = report_of(&test, job.name).await;
    assert_eq!(report.oscillations[0].condition, "speed");
    assert!(report.findings.iter().any(|finding| finding.code == "OSC-CONDITION-OVERRIDDEN"));

    // What the machine does not have, and what cannot be, is refused before anything is stored.
    let odd = OscillationRequest { cutting_time_before_s: f64::NAN, ..named("fast") };
    let refused = test.jobs().create_job(asking(PROGRAM, odd.clone())).await.unwrap_err();
    let (_, _, fields) = told(&refused);
    assert_eq!(fields, ["oscillation.condition", "oscillation.cutting_time_before_s"]);
    let validate = ValidateProgramRequest {
        inline_program: PROGRAM.as_bytes().to_vec().into(),
        on: Some(On::Machine("machines/rotating".to_owned())),
        tools: vec!["tools/cutter".to_owned()],
        oscillation: Some(odd),
        ..Default::default()
    };
    let (_, _, fields) = told(&test.jobs().validate_program(validate.clone()).await.unwrap_err());
    assert_eq!(fields, ["oscillation.condition", "oscillation.cutting_time_before_s"]);
    let validate = ValidateProgramRequest { oscillation: Some(named("accuracy")), ..validate };
    let report = test.jobs().validate_program(validate).await.unwrap().into_inner().report.unwrap();
    assert_eq!(report.oscillations[0].condition, "accuracy");
}
