//! Five axes through the service: a machine with kinematics, a tool with its length, a thinned job, its report and setpoints.

use std::collections::BTreeSet;

use feedwave_contract::proto::{
    AxisLetter, AxisRange, ChainAxis, CreateJobRequest, CreateMachineRequest, CreateToolRequest, GetMachineRequest,
    GetReportRequest, JobState, Kinematics, MachineAxis, ThinningSettings, Tool, Vector,
};

use crate::support::{TestServer, lathe_job, stream_of};

/// The groups of docs/functions/five-axis-thinning.md ("Worked examples"): N1 to N11, groups of four and three.
const PROGRAM: &str = "N1 G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nN2 M33\nN3 G1 X1 A-20.1 F1000\nN4 X2 A-20.2\nN5 X3 A-20.1
N6 X4 A-20.2\nN7 X5 A-20.1\nN8 X6 A-20.2\nN9 X7 A-20.1\nN10 M34\nN11 X8 A-20\nN12 M30\n";

fn chain_axis(axis: AxisLetter, [x, y, z]: [f64; 3], range: Option<AxisRange>) -> ChainAxis {
    ChainAxis { axis: axis.into(), direction: Some(Vector { x, y, z }), range, ..Default::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_five_axis_job_is_thinned_and_streamed() {
    let test = TestServer::start().await;
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let mut machine = test.machines().get_machine(request).await.unwrap().into_inner().machine.unwrap();
    let profile = machine.profile.as_mut().unwrap();
    for letter in [AxisLetter::A, AxisLetter::C] {
        profile.machine.as_mut().unwrap().axes.push(MachineAxis {
            name: letter.as_str_name().trim_start_matches("AXIS_LETTER_").to_owned(),
            axis: letter.into(),
            max_velocity_per_s: 120.0,
            max_acceleration_per_s2: 600.0,
            max_jerk_per_s3: 20_000.0,
            ..Default::default()
        });
    }
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    profile.kinematics = Some(Kinematics {
        chain: vec![
            chain_axis(AxisLetter::C, z, None),
            chain_axis(AxisLetter::A, x, Some(AxisRange { min: -120.0, max: 30.0 })),
            chain_axis(AxisLetter::X, x, None),
            chain_axis(AxisLetter::Y, y, None),
            chain_axis(AxisLetter::Z, z, None),
        ],
        gauge_point_mm: Some(Vector { x: 0.0, y: 0.0, z: 500.0 }),
        ..Default::default()
    });
    profile.thinning = Some(ThinningSettings { group_blocks: Some(4), ..Default::default() });
    let request = CreateMachineRequest { machine_id: "trunnion".to_owned(), machine: Some(machine) };
    test.machines().create_machine(request).await.unwrap();
    let tool = Tool { number: 1, length_mm: Some(120.0), ..Default::default() };
    let request = CreateToolRequest { tool_id: "ball".to_owned(), tool: Some(tool) };
    test.tools().create_tool(request).await.unwrap();

    let on_trunnion = || CreateJobRequest { machine: "machines/trunnion".to_owned(), ..lathe_job(PROGRAM) };
    let job = test.ready(CreateJobRequest { tools: vec!["tools/ball".to_owned()], ..on_trunnion() }).await;
    let report = test.jobs().get_report(GetReportRequest { job: job.name.clone() }).await.unwrap().into_inner();
    let thinning = report.report.unwrap().thinning.expect("it was on");
    assert_eq!((thinning.blocks_read, thinning.blocks_dropped, thinning.blocks_kept), (8, 3, 5));
    let axes: Vec<_> = thinning
        .rotary_axes
        .iter()
        .map(|axis| (axis.axis.as_str(), axis.reversals_before, axis.reversals_after))
        .collect();
    assert_eq!(axes, [("C", 0, 0), ("A", 5, 1)]);
    let runs: Vec<_> = thinning.dropped.iter().map(|run| (run.first_line, run.last_line, run.kept_line)).collect();
    assert_eq!(runs, [(4, 5, 6), (8, 8, 9)]);
    assert!(thinning.time_after_s < thinning.time_before_s);

    let (_, chunks) = test.collect(stream_of(&job)).await;
    let runs = chunks.iter().flat_map(|chunk| &chunk.line_runs);
    let lines: BTreeSet<u32> = runs.map(|run| run.line).filter(|&line| line > 0).collect();
    assert_eq!(lines.into_iter().collect::<Vec<_>>(), [1, 3, 6, 7, 9, 11]);

    // Without the tool nothing moves, and the report says why.
    let job = test.validated(on_trunnion()).await;
    assert_eq!(job.state(), JobState::Rejected);
    let report = test.jobs().get_report(GetReportRequest { job: job.name }).await.unwrap().into_inner().report.unwrap();
    assert_eq!(report.findings[0].code, "PRG-TOOL-LENGTH");
}
