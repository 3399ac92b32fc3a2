//! Offsets of a job: from a file of the command line through server and store to setpoints, actions and the report.

use std::process::Output;

use feedwave_contract::json;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::{
    Action, GetJobRequest, GetReportRequest, InterpretRequest, StreamSetpointsRequest, ValidationReport,
    interpret_request,
};
use feedwave_tests::{Clients, Home, Server, stream};
use tokio::process::Command;

use crate::FEEDWAVE;
use crate::status::violated_fields;

/// On the generic lathe, whose own offsets are zero.
const PROGRAM: &str = "G21 G99 G40\nG97 S1000 M3\nG0 X30. Z5.\nG55 G0 X20. Z2.\nG1 Z-10. F0.2\nG0 X#500\nM30\n";

/// G54 stays as the machine has it.
const OFFSETS: &str = "external = { z = -1.5 }\n[[work_offsets]]\nsystem = \"G55\"\noffset = { x = 2, z = 40 }\n\
                       [[parameters]]\nparameter = \"500\"\nvalue = 24\n";

/// Where the cut ends in the machine: X a radius, with the offsets and without.
const CUT_END: [f64; 2] = [12.0, 28.5];
const CUT_END_WITHOUT: [f64; 2] = [10.0, -10.0];

async fn feedwave(arguments: &[&str]) -> Output {
    Command::new(FEEDWAVE).args(arguments).output().await.expect("the command runs")
}

fn text(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8(output.stdout.clone()).expect("text")
}

/// Where the cuts of an interpretation end in the machine, X and Z.
fn cut_end(actions: &[Action]) -> [f64; 2] {
    let cut = actions.iter().find(|action| action.feed.is_some()).expect("a cut");
    let end = cut.machine_end.expect("its end");
    [end.x, end.z]
}

async fn interpreted(clients: &Clients, request: InterpretRequest) -> Vec<Action> {
    let mut client = ProgramsClient::new(clients.channel.clone());
    let mut messages = client.interpret(request).await.expect("it is interpreted").into_inner();
    let mut actions = Vec::new();
    while let Some(message) = messages.message().await.expect("it goes on") {
        actions.extend(message.actions);
    }
    actions
}

/// What a service says of the job: its report, where its cut ends, and the last setpoint.
async fn answers(server: &Server, job: &str) -> (ValidationReport, [f64; 2], [f64; 2]) {
    let mut clients = server.connect().await;
    let report = clients.jobs.get_report(GetReportRequest { job: job.to_owned() }).await.expect("its report");
    let of_job = InterpretRequest {
        source: Some(interpret_request::Source::Job(job.to_owned())),
        ..InterpretRequest::default()
    };
    let actions = interpreted(&clients, of_job).await;
    let request = StreamSetpointsRequest { job: job.to_owned(), ..StreamSetpointsRequest::default() };
    let setpoints = stream(&mut clients, request).await.expect("its setpoints");
    let last = ["X_mm", "Z_mm"].map(|column| *setpoints.column(column).last().expect("a setpoint"));
    (report.into_inner().report.expect("a report"), cut_end(&actions), last)
}

#[tokio::test]
async fn offsets_of_a_job_hold_everywhere_and_after_a_restart() {
    let home = Home::new(FEEDWAVE, "");
    let [program, offsets] = ["part.nc", "offsets.toml"].map(|name| home.path().join(name));
    std::fs::write(&program, PROGRAM).expect("the program is written");
    std::fs::write(&offsets, OFFSETS).expect("the offsets are written");
    let [program, offsets] = [&program, &offsets].map(|path| path.to_str().expect("a path"));
    let server = home.start().await;

    let url = format!("http://{}", server.grpc);
    let submitted =
        feedwave(&["submit", program, "--machine", "lathe", "--offsets", offsets, "--wait", "--server", &url]).await;
    let submitted = text(&submitted);
    assert!(submitted.contains("G55") && submitted.contains("X2 Z40"), "{submitted}");
    let job = submitted.lines().last().expect("the name of the job").to_owned();

    let (report, actions_end, last) = answers(&server, &job).await;
    assert_eq!(actions_end, CUT_END);
    assert_eq!(last, [14.0, 28.5], "X24 by the parameter of the job");
    let shown = report.offsets.clone().expect("offsets in force");
    assert_eq!(shown.external.expect("external").z, -1.5);
    let systems: Vec<_> = shown.work_offsets.iter().map(|place| (place.system.as_str(), place.offset)).collect();
    let [("G55", Some(place))] = systems[..] else { panic!("{systems:?}") };
    assert_eq!((place.x, place.z), (2.0, 40.0));

    // The command line alone comes to the same.
    let local = text(&feedwave(&["validate", program, "--offsets", offsets, "--format", "json"]).await);
    assert_eq!(json::from_str::<ValidationReport>(&local).expect("a report"), report);
    let actions = text(&feedwave(&["interpret", program, "--offsets", offsets, "--format", "jsonl"]).await);
    let actions: Vec<Action> = actions.lines().map(|line| json::from_str(line).expect("an action")).collect();
    assert_eq!(cut_end(&actions), CUT_END);

    // They are durable, as a part of the job.
    let server = server.kill().await.start().await;
    assert_eq!(answers(&server, &job).await, (report, CUT_END, last));
    let mut clients = server.connect().await;
    let stored = clients.jobs.get_job(GetJobRequest { name: job }).await.expect("the job").into_inner();
    let settings = stored.job.and_then(|job| job.settings).expect("settings");
    assert_eq!(settings.offsets.expect("offsets").parameters[0].value, 24.0);
}

#[tokio::test]
async fn an_interpretation_takes_offsets_of_its_own() {
    let server = Server::start(FEEDWAVE).await;
    let clients = server.connect().await;
    let program = PROGRAM.replace("#500", "24.");
    let plain = InterpretRequest {
        source: Some(interpret_request::Source::InlineProgram(program.into_bytes().into())),
        on: Some(interpret_request::On::Machine("machines/lathe".to_owned())),
        ..InterpretRequest::default()
    };
    assert_eq!(cut_end(&interpreted(&clients, plain.clone()).await), CUT_END_WITHOUT);
    let offsets = toml_offsets();
    let with = InterpretRequest { offsets: Some(offsets.clone()), ..plain.clone() };
    assert_eq!(cut_end(&interpreted(&clients, with.clone()).await), CUT_END);

    let mut bad = offsets;
    bad.work_offsets[0].system = "G53".to_owned();
    let refused = InterpretRequest { offsets: Some(bad), ..plain };
    let status = ProgramsClient::new(clients.channel.clone()).interpret(refused).await.expect_err("no system");
    assert_eq!(violated_fields(&status), ["offsets.work_offsets[0].system"]);
    let of_job = InterpretRequest { source: Some(interpret_request::Source::Job("jobs/x".to_owned())), ..with };
    let status = ProgramsClient::new(clients.channel.clone()).interpret(of_job).await.expect_err("the job has them");
    assert_eq!(violated_fields(&status), ["job"]);
}

/// [`OFFSETS`] as a message.
fn toml_offsets() -> feedwave_contract::proto::Offsets {
    use feedwave_contract::proto::{AxisPosition, Offsets, WorkOffset};
    let at = |x, z| Some(AxisPosition { x, z, ..Default::default() });
    let place = WorkOffset { system: "G55".to_owned(), offset: at(2.0, 40.0), rotation_deg: 0.0 };
    Offsets { external: at(0.0, -1.5), work_offsets: vec![place], ..Offsets::default() }
}
