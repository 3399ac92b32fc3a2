//! Better programs by the service: those of the command, in bounded work that ends with its client.

use bytes::Bytes;
use feedwave_contract::json;
use feedwave_contract::proto::improve_request::{On, Source};
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::{ImproveRequest, Improvement, ImprovementGoals, ImprovementOutcome};
use feedwave_tests::{Server, patiently, upload};
use tokio::process::Command;
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;

/// Two vibrations, one of which breaks no chip and one of which lies on a whole number of revolutions, and feeds that could rise.
const PART: &str = "G21 G97 G99 S1000 M3\nG0 X40. Z2.\nG200 F50 A0.08\nG1 Z-4. F0.08\nG201\nG0 Z2.\nG200 F41.65 A0.1\nG1 Z-3. F0.1\nG201\n\
                    G0 X60.\nM30\n";

fn goals() -> ImprovementGoals {
    ImprovementGoals { max_feed_per_rev_mm: Some(0.15), least_amplitude: true, ..ImprovementGoals::default() }
}

async fn improve(server: &Server, request: ImproveRequest) -> Result<(Improvement, Vec<u8>), tonic::Status> {
    let mut programs = ProgramsClient::new(server.connect().await.channel);
    let mut messages = programs.improve(request).await?.into_inner();
    let first = messages.message().await?.expect("the improvement first");
    let (improvement, mut program) = (first.improvement.expect("in the first message"), first.data.to_vec());
    while let Some(message) = messages.message().await? {
        assert!(message.improvement.is_none() && message.offset == program.len() as u64);
        program.extend_from_slice(&message.data);
    }
    assert_eq!(improvement.program_bytes, program.len() as u64);
    Ok((improvement, program))
}

#[tokio::test]
async fn the_service_improves_as_the_command_does() {
    let server = Server::start(FEEDWAVE).await;
    let request = |source| ImproveRequest {
        source: Some(source),
        on: Some(On::Machine("machines/lathe".to_owned())),
        goals: Some(goals()),
        ..ImproveRequest::default()
    };
    let (improvement, program) =
        improve(&server, request(Source::InlineProgram(Bytes::from(PART)))).await.expect("it is improved");
    assert!(improvement.holds, "{improvement:?}");
    let changed = improvement.steps.iter().filter(|step| step.outcome() == ImprovementOutcome::Changed);
    assert!(changed.count() >= 2 && improvement.changes.len() >= 3, "{:?}", improvement.steps);

    // The command, to the last digit.
    let file = server.home().path().join("part.nc");
    let out = server.home().path().join("better.nc");
    std::fs::write(&file, PART).expect("the part");
    let mut command = Command::new(FEEDWAVE);
    command
        .args(["improve", "--format", "json", "--max-feed", "0.15", "--least-amplitude", "--out"])
        .arg(&out)
        .arg(&file);
    let output = patiently(command.output()).await.expect("the command runs");
    let text = String::from_utf8(output.stdout).expect("text");
    assert_eq!(json::from_str::<Improvement>(&text).expect("the message"), improvement);
    assert_eq!(std::fs::read(&out).expect("the program"), program);

    // Stored programs and those of jobs, which bring their machine.
    let mut clients = server.connect().await;
    let stored = upload(&mut clients, &Bytes::from(PART)).await.expect("the upload is taken");
    let by_name = improve(&server, request(Source::Program(stored))).await.expect("it is improved");
    assert_eq!(by_name, (improvement.clone(), program.clone()));
    let job = clients.submit(PART).await.job.name;
    let of_job = ImproveRequest { source: Some(Source::Job(job)), goals: Some(goals()), ..ImproveRequest::default() };
    assert_eq!(improve(&server, of_job).await.expect("it is improved"), (improvement, program));
}

#[tokio::test]
async fn wrong_goals_are_named_and_a_client_that_leaves_ends_the_work() {
    let server = Server::start(FEEDWAVE).await;
    let wrong = ImproveRequest {
        source: Some(Source::InlineProgram(Bytes::from(PART))),
        goals: Some(ImprovementGoals { margin: Some(0.1), min_frequency_hz: Some(9.0), ..ImprovementGoals::default() }),
        ..ImproveRequest::default()
    };
    let status = improve(&server, wrong).await.expect_err("it is refused");
    assert_eq!(status.code(), Code::InvalidArgument);
    let details = status.get_details_bad_request().expect("the fields");
    let fields: Vec<_> = details.field_violations.iter().map(|violation| violation.field.as_str()).collect();
    assert_eq!(fields, ["goals.margin", "goals.max_frequency_hz", "on"]);

    // Hours of machining.
    let long = format!(
        "G21 G97 G99 S1000 M3\nG0 X40. Z2.\nG200 F50 A0.03\n{}G201\nM30\n",
        "G1 Z-900. F0.01\nG1 Z2.\n".repeat(2_000)
    );
    let request = ImproveRequest {
        source: Some(Source::InlineProgram(Bytes::from(long))),
        on: Some(On::Machine("machines/lathe".to_owned())),
        ..ImproveRequest::default()
    };
    let mut programs = ProgramsClient::new(server.connect().await.channel);
    let mut messages = programs.improve(request).await.expect("it begins").into_inner();
    let web = server.web();
    let is_active =
        async || web.get("/metrics").await.text().lines().any(|line| line == "feedwave_active_validations 1");
    let until = async |wanted: bool| {
        while is_active().await != wanted {
            tokio::task::yield_now().await;
        }
    };
    tokio::select! {
        () = patiently(until(true)) => {}
        message = messages.message() => panic!("it ends before it begins: {message:?}"),
    }
    drop(messages);
    drop(programs);
    patiently(until(false)).await;
}
