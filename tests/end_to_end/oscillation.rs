//! Tool oscillation through the built binary and its database: judged, streamed, taken up, refused, and all the same
//! after the service was killed.

use std::f64::consts::TAU;

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::oscillation_condition::Period;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::waveform::Kind;
use feedwave_contract::proto::{
    ColumnKind, ConditionTable, ConditionTableRow, CreateJobRequest, CreateMachineRequest, CreateToolRequest,
    CuttingEdge, DirectionOscillation, FeedOverrideChange, GetMachineRequest, GetReportRequest, GetToolRequest,
    HeldPeakWave, JobState, ListMachinesRequest, OscillationCondition, StreamSetpointsRequest, TableQuantity, Tool,
    ToolGeometry, Waveform,
};
use feedwave_tests::{Clients, Outcome, Server, Setpoints, stream};
use prost::Message as _;

use crate::FEEDWAVE;

/// The worked example of docs/functions/tool-oscillation.md.
pub(crate) const PROGRAM: &str = "G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30\n";
/// Name of its tool.
pub(crate) const CUTTER: &str = "cutter";
/// Length of the cut, and over how much of it the oscillation is blended in and out, mm.
const LENGTH_MM: f64 = 30.0;
const RAMP_MM: f64 = 2.0;

fn condition(number: u32, name: &str, periods_per_rev: u32) -> OscillationCondition {
    let direction = |amplitude_mm, waveform: Option<Kind>| {
        let waveform = waveform.map(|kind| Waveform { kind: Some(kind) });
        Some(DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 })
    };
    OscillationCondition {
        name: name.to_owned(),
        number,
        period: Some(Period::PeriodsPerRev(periods_per_rev)),
        feed: direction(0.4, None),
        axial: direction(0.03, Some(Kind::HeldPeak(HeldPeakWave { hold_share: 0.3 }))),
        ..OscillationCondition::default()
    }
}

/// Makes the machine and the tool of the worked example.
pub(crate) async fn equip(clients: &mut Clients) {
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let mill = clients.machines.get_machine(request).await.expect("the mill is there").into_inner().machine;
    let mut machine = mill.expect("a machine");
    let profile = machine.profile.as_mut().expect("a profile");
    profile.tool_oscillation = vec![condition(1, "accuracy", 1), condition(3, "thirds", 3)];
    let request = CreateMachineRequest { machine_id: "oscillating".to_owned(), machine: Some(machine) };
    clients.machines.create_machine(request).await.expect("the machine is made");
    let edge = |angle_deg| CuttingEdge { angle_deg, ..CuttingEdge::default() };
    let geometry = ToolGeometry {
        edges: [0.0, 90.0, 180.0, 270.0].map(edge).to_vec(),
        radius_mm: 60.0,
        radial_edge_length_mm: 1.5,
        axial_edge_height_mm: 5.0,
        end_relief_deg: 0.0,
    };
    let tool = Tool { number: 4, geometry: Some(geometry), ..Tool::default() };
    let request = CreateToolRequest { tool_id: CUTTER.to_owned(), tool: Some(tool) };
    clients.tools.create_tool(request).await.expect("the tool is made");
}

async fn submit(clients: &mut Clients, program: &str, tools: &[&str]) -> Outcome {
    let request = CreateJobRequest {
        machine: "machines/oscillating".to_owned(),
        tools: tools.iter().map(|tool| format!("tools/{tool}")).collect(),
        source: Some(Source::InlineProgram(Bytes::from(program.to_owned()))),
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job;
    clients.validated(&job.expect("a job").name).await
}

fn whole(job: &str) -> StreamSetpointsRequest {
    StreamSetpointsRequest { job: job.to_owned(), ..StreamSetpointsRequest::default() }
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

/// The axial waveform of docs/functions/tool-oscillation.md, "Worked example", mm away from the work.
pub(crate) fn retraction_mm(turns: f64) -> f64 {
    match turns - turns.floor() {
        part if part < 0.1 => 0.03 * (TAU * part / 0.4).sin(),
        part if part < 0.4 => 0.03,
        part if part < 0.6 => 0.03 * (TAU * (part - 0.4) / 0.4).cos(),
        part if part < 0.9 => -0.03,
        part => -0.03 * (TAU * (part - 0.9) / 0.4).cos(),
    }
}

/// Every setpoint with the whole oscillation is where docs/functions/tool-oscillation.md ("Motion") puts it at its own
/// spindle angle; returns how many there are.
#[track_caller]
fn assert_in_step(setpoints: &Setpoints) -> usize {
    let (x, z) = (setpoints.column("X_mm"), setpoints.column("Z_mm"));
    let path = setpoints.of_kind(ColumnKind::PathPosition);
    let spindle = setpoints.of_kind(ColumnKind::SpindleAngle);
    let start_mm = path.last().expect("setpoints") - LENGTH_MM;
    let mut count = 0;
    for index in 0..setpoints.len() {
        let along_mm = path[index] - start_mm;
        assert!((-1e-9..=LENGTH_MM + 1e-9).contains(&x[index]), "setpoint {index} is at X{}", x[index]);
        if !(RAMP_MM..=LENGTH_MM - RAMP_MM).contains(&along_mm) {
            continue;
        }
        let turns = spindle[index] / 360.0;
        assert_near(x[index], along_mm + 0.4 * (TAU * turns).sin(), 1e-8);
        assert_near(z[index], -1.0 + retraction_mm(turns), 1e-8);
        count += 1;
    }
    count
}

#[tokio::test]
async fn the_worked_example_is_judged_streamed_and_the_same_after_a_kill() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    equip(&mut clients).await;
    let outcome = submit(&mut clients, PROGRAM, &["cutter"]).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let [section] = outcome.report.oscillations.as_slice() else { panic!("{:?}", outcome.report.oscillations) };
    let areas: Vec<f64> = section.edges.iter().map(|edge| edge.area_mm2).collect();
    for (area, expected) in areas.iter().zip([0.3545, 0.6305, 0.015, 0.03]) {
        assert_near(*area, expected, 1e-12);
    }
    assert_eq!((section.periods_per_rev, section.leading_edge), (1, 1));
    assert_eq!(section.finishing_edges, [4]);
    assert!(outcome.codes().contains(&"OSC-JERK-STEP"));

    let setpoints = stream(&mut clients, whole(&outcome.job.name)).await.expect("a stream");
    assert!(assert_in_step(&setpoints) > 2_500);
    let seek = |index| StreamSetpointsRequest { start: Some(Start::StartIndex(index)), ..whole(&outcome.job.name) };
    // Within the blend, in the middle of a hold, and in the last blend.
    let count = setpoints.len() as u64;
    for index in [170, 1_234, count - 150, count - 1] {
        let part = stream(&mut clients, seek(index)).await.expect("a part of it");
        assert!(part.bits_from(index) == setpoints.bits_from(index), "from {index} on");
    }

    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    let again = stream(&mut clients, whole(&outcome.job.name)).await.expect("the stream again");
    assert!(again.bits_from(0) == setpoints.bits_from(0));
    let part = stream(&mut clients, seek(1_234)).await.expect("a part of it again");
    assert!(part.bits_from(1_234) == setpoints.bits_from(1_234));
    let request = GetReportRequest { job: outcome.job.name.clone() };
    let report = clients.jobs.get_report(request).await.expect("the report again").into_inner().report;
    assert_eq!(report.as_ref(), Some(&outcome.report));
    let request = GetToolRequest { name: "tools/cutter".to_owned() };
    let tool = clients.tools.get_tool(request).await.expect("the tool again").into_inner().tool;
    assert_eq!(tool.and_then(|tool| tool.geometry).map(|geometry| geometry.edges.len()), Some(4));
}

#[tokio::test]
async fn a_moved_override_keeps_the_step_with_the_spindle() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    equip(&mut clients).await;
    let job = submit(&mut clients, PROGRAM, &["cutter"]).await.job;
    let plain = stream(&mut clients, whole(&job.name)).await.expect("a stream");
    let change = |(index, ratio)| FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) };
    let overrides: Vec<_> = [(900, 0.4), (1_700, 0.0), (2_150, 1.3), (2_600, 1.0)].map(change).into();
    let request = StreamSetpointsRequest { overrides, ..whole(&job.name) };
    let moved = stream(&mut clients, request.clone()).await.expect("a stream with changes");
    assert!(assert_in_step(&moved) > 2_500 && moved.len() != plain.len());
    // The feed is held, the spindle and with it the oscillation go on.
    let (feed, offset) = (moved.of_kind(ColumnKind::Feed), moved.of_kind(ColumnKind::VibrationOffset));
    let held: Vec<usize> = (1_800..2_100).filter(|&index| feed[index] == 0.0).collect();
    assert!(held.len() > 250 && held.iter().any(|&index| offset[index] > 0.39), "{} held", held.len());
    let seek = StreamSetpointsRequest { start: Some(Start::StartIndex(1_950)), ..request };
    let part = stream(&mut clients, seek).await.expect("a part of it");
    assert!(part.bits_from(1_950) == moved.bits_from(1_950));
}

#[tokio::test]
async fn what_is_impossible_is_refused_with_numbers_and_stays_stored() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    equip(&mut clients).await;
    let mut refused = Vec::new();
    for (program, tools, code) in [
        (PROGRAM.replace("P1", "P3"), &["cutter"][..], "OSC-EDGES-PERIOD"),
        (PROGRAM.replace("F600", "F1200"), &["cutter"], "OSC-STEP-LONG"),
        (PROGRAM.replace("P1", "P1 L5"), &["cutter"], "OSC-LEADING-EDGE"),
        (PROGRAM.to_owned(), &[], "OSC-TOOL-UNKNOWN"),
        (PROGRAM.replace("G1 X30", "G1 Z-5"), &["cutter"], "OSC-PLUNGE"),
    ] {
        let outcome = submit(&mut clients, &program, tools).await;
        assert_eq!(outcome.job.state(), JobState::Rejected, "{code}");
        let finding = outcome.report.findings.iter().find(|finding| finding.code == code);
        let finding = finding.unwrap_or_else(|| panic!("no {code} in {:?}", outcome.codes()));
        assert!(!finding.suggestions.is_empty(), "{finding:?}");
        assert!(stream(&mut clients, whole(&outcome.job.name)).await.is_err(), "{code} is streamed");
        refused.push(outcome);
    }
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for outcome in refused {
        let request = GetReportRequest { job: outcome.job.name };
        let report = clients.jobs.get_report(request).await.expect("the report is stored").into_inner().report;
        assert_eq!(report, Some(outcome.report));
    }
}

/// What a gRPC client takes where it sets nothing, bytes.
const CLIENT_LIMIT: usize = 4 << 20;

#[tokio::test]
async fn a_long_report_and_a_page_of_long_machines_are_no_larger_than_a_client_takes() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    equip(&mut clients).await;
    // Another feed in each block: each has a report of its own.
    let blocks: String = (1..=300).map(|block| format!("G1 X{block} F{}\n", 400 + block)).collect();
    let outcome = submit(&mut clients, &PROGRAM.replace("G1 X30 F600\n", &blocks), &[CUTTER]).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.codes());
    let summary = outcome.report.summary.clone().expect("a summary");
    let bytes = outcome.report.encoded_len();
    assert!(summary.oscillation_count == 300 && bytes < CLIENT_LIMIT, "{} in {bytes} bytes", summary.oscillation_count);
    let listed = outcome.report.oscillations.len();
    assert!(listed < 300 && bytes > CLIENT_LIMIT * 9 / 10, "{listed} in {bytes} bytes");

    let request = GetMachineRequest { name: "machines/oscillating".to_owned() };
    let mut machine = clients.machines.get_machine(request).await.expect("the machine").into_inner().machine.unwrap();
    let profile = machine.profile.as_mut().expect("a profile");
    profile.tool_oscillation = (1..=64)
        .map(|number| {
            let mut condition = condition(number, &format!("c{number}"), 1);
            let row = |row: u32| ConditionTableRow {
                values: (0..32).map(|at| 0.3 + f64::from(row * 32 + at) / 7e4).collect(),
            };
            condition.tables = vec![ConditionTable {
                quantity: TableQuantity::FeedAmplitude.into(),
                feed_mm_per_min: (0..32).map(|at| 100.0 + f64::from(at)).collect(),
                spindle_rev_per_min: (0..32).map(|at| 300.0 + f64::from(at)).collect(),
                rows: (0..32).map(row).collect(),
                ..ConditionTable::default()
            }];
            condition
        })
        .collect();
    for index in 0..8 {
        let request = CreateMachineRequest { machine_id: format!("long-{index}"), machine: Some(machine.clone()) };
        clients.machines.create_machine(request).await.expect("the machine is made");
    }
    let (mut names, mut pages, mut page_token) = (Vec::new(), 0, String::new());
    loop {
        let request = ListMachinesRequest { page_size: 500, page_token };
        let page = clients.machines.list_machines(request).await.expect("a page").into_inner();
        assert!(page.encoded_len() < CLIENT_LIMIT, "{}", page.encoded_len());
        names.extend(page.machines.into_iter().map(|machine| machine.name));
        pages += 1;
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    names.dedup();
    assert!(names.len() == 8 + 3 && pages > 2, "{pages} pages of {names:?}");
}
