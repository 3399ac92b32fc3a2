//! Streams with changes of the feed override.

use feedwave_contract::proto::feed_override_change::At;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{
    ColumnKind, FeedOverrideChange, ServoOutput, StreamSetpointsRequest, ValidateProgramRequest,
    validate_program_request::On,
};
use feedwave_tests::{Clients, SHAFT_CURED, SHAFT_END_X_MM, SHAFT_END_Z_MM, Server, Setpoints, stream};
use tonic::Code;
use tonic_types::StatusExt;

use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

/// A server with one valid job.
async fn ready_job() -> (Server, Clients, StreamSetpointsRequest) {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(SHAFT_CURED).await;
    let request = StreamSetpointsRequest { job: outcome.job.name, ..StreamSetpointsRequest::default() };
    (server, clients, request)
}

async fn read(clients: &mut Clients, request: StreamSetpointsRequest) -> Setpoints {
    stream(clients, request).await.unwrap_or_else(|status| panic!("{status:?}"))
}

fn at_time(time_s: f64, ratio: f64) -> FeedOverrideChange {
    FeedOverrideChange { at: Some(At::TimeS(time_s)), ratio: Some(ratio) }
}

fn at_index(index: u64, ratio: f64) -> FeedOverrideChange {
    FeedOverrideChange { at: Some(At::SetpointIndex(index)), ratio: Some(ratio) }
}

/// Half the feed, feed hold of two seconds, double feed.
fn changes() -> Vec<FeedOverrideChange> {
    vec![at_time(9.999_5, 0.5), at_time(20.0, 0.0), at_index(22_000, 2.0)]
}

#[tokio::test]
async fn the_feed_follows_the_override_and_the_path_does_not() {
    let (_server, mut clients, request) = ready_job().await;
    let plain = read(&mut clients, request.clone()).await;
    let changed = read(&mut clients, StreamSetpointsRequest { overrides: changes(), ..request.clone() }).await;
    assert_eq!(changed.header.setpoint_count, None, "it was not validated this way");

    // Up to the setpoint at whose instant it changes, not a bit differs; from the next one on, the feed does.
    let bits = |setpoints: &Setpoints, count: usize| -> Vec<Vec<u64>> {
        setpoints.columns.iter().map(|column| column[..count].iter().map(|value| value.to_bits()).collect()).collect()
    };
    assert!(bits(&changed, 10_001) == bits(&plain, 10_001));
    assert_eq!(changed.lines[..10_001], plain.lines[..10_001]);
    assert!(bits(&changed, 10_100) != bits(&plain, 10_100));

    // The feed is as commanded, once it had the time to get there.
    let feed = changed.of_kind(ColumnKind::Feed);
    let programmed = plain.of_kind(ColumnKind::Feed)[9_000];
    for (rows, ratio) in [(10_100..14_000, 0.5), (20_100..22_000, 0.0), (22_100..23_100, 2.0)] {
        let wanted = programmed * ratio;
        assert!(feed[rows.clone()].iter().all(|feed| (feed - wanted).abs() <= 1e-9 * programmed), "{rows:?}");
    }
    // Held, the path is at rest while the vibration goes on.
    let path = changed.of_kind(ColumnKind::PathPosition);
    assert!(path[20_100..22_000].iter().all(|position| position.to_bits() == path[20_100].to_bits()));
    let vibration = changed.of_kind(ColumnKind::VibrationOffset);
    assert!(vibration[20_100..22_000].iter().any(|offset| *offset > 0.029));

    // It ends where the program says, to the last bit, and along the same path: z = 10 + 5·(x − 3) on line 6.
    let (x, z) = (changed.column("X_mm"), changed.column("Z_mm"));
    assert_eq!(x.last().copied().map(f64::to_bits), Some(SHAFT_END_X_MM.to_bits()));
    assert_eq!(z.last().copied().map(f64::to_bits), Some(SHAFT_END_Z_MM.to_bits()));
    assert_eq!(path.last(), plain.of_kind(ColumnKind::PathPosition).last());
    for ((x, z), line) in x.iter().zip(z).zip(&changed.lines).filter(|((_, z), _)| **z <= 20.0) {
        assert!(*line != 6 || (z - 10.0 - 5.0 * (x - 3.0)).abs() < 1e-8, "({x}, {z}) is not on line 6");
    }
}

#[tokio::test]
async fn a_resumed_stream_with_overrides_is_the_original_to_the_last_bit() {
    let (_server, mut clients, request) = ready_job().await;
    let request = StreamSetpointsRequest { overrides: changes(), ..request };
    let whole = read(&mut clients, request.clone()).await;
    let count = whole.len() as u64;
    for index in [1, 8_192, 9_999, 10_000, 10_001, 20_010, 21_999, 22_000, 22_001, count / 2, count - 1] {
        let start = Some(Start::StartIndex(index));
        let resumed = read(&mut clients, StreamSetpointsRequest { start, ..request.clone() }).await;
        assert_eq!(resumed.header.first_index, index);
        assert!(resumed.bits_from(index) == whole.bits_from(index), "from index {index}");
        assert_eq!(resumed.lines, whole.lines[whole.len() - resumed.len()..], "from index {index}");
    }
    let beyond = StreamSetpointsRequest { start: Some(Start::StartIndex(count + 1)), ..request };
    assert_eq!(stream(&mut clients, beyond).await.unwrap_err().code(), Code::OutOfRange);
}

#[tokio::test]
async fn places_where_a_plain_stream_may_begin_are_not_those_of_one_with_overrides() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    // Long enough for the service to keep a place to begin from in its middle: after 2^17 setpoints.
    let program = "G21 G98 G97 S1000 M3\nG0 X10. Z0.\nG1 Z30. F9.\nX14. Z33.\nM30\n";
    let job = clients.submit(program).await.job.name;
    let request = StreamSetpointsRequest {
        job,
        overrides: vec![at_time(10.0, 0.8), at_time(20.0, 1.0)],
        columns: vec![ColumnKind::PathPosition.into()],
        ..StreamSetpointsRequest::default()
    };
    let whole = read(&mut clients, request.clone()).await;
    assert!(whole.len() > 200_000, "{}", whole.len());
    let start = Some(Start::StartIndex(150_000));
    let resumed = read(&mut clients, StreamSetpointsRequest { start, ..request.clone() }).await;
    assert!(resumed.bits_from(150_000) == whole.bits_from(150_000));
    let plain = StreamSetpointsRequest { start, overrides: Vec::new(), ..request };
    assert!(read(&mut clients, plain).await.bits_from(150_000) != whole.bits_from(150_000));
}

#[tokio::test]
async fn a_change_counts_interpolation_periods_in_every_mode_and_at_every_period() {
    let (_server, mut clients, request) = ready_job().await;
    let request = StreamSetpointsRequest {
        generation_mode: feedwave_contract::proto::GenerationMode::ServoSide.into(),
        interpolation_period_us: 2_000,
        ..request
    };
    let expanded = ServoOutput::Expanded.into();
    let by_index = StreamSetpointsRequest { overrides: vec![at_index(5_000, 0.4)], ..request.clone() };
    let by_time = StreamSetpointsRequest { overrides: vec![at_time(10.0, 0.4)], ..request };
    let conditions = read(&mut clients, by_index.clone()).await;
    assert!(read(&mut clients, by_time.clone()).await.bits_from(0) == conditions.bits_from(0));
    let by_index = read(&mut clients, StreamSetpointsRequest { servo_output: expanded, ..by_index }).await;
    let by_time = read(&mut clients, StreamSetpointsRequest { servo_output: expanded, ..by_time }).await;
    assert!(by_time.bits_from(0) == by_index.bits_from(0));
    // Eight servo periods in each.
    assert_eq!(by_index.len(), (conditions.len() - 1) * 8 + 1);
    let feed = by_index.of_kind(ColumnKind::Feed);
    assert!((feed[5_100 * 8] / feed[4_900 * 8] - 0.4).abs() < 1e-9);
}

#[tokio::test]
async fn an_override_of_1_changes_nothing() {
    let (_server, mut clients, request) = ready_job().await;
    let plain = read(&mut clients, request.clone()).await;
    let late = vec![at_index(plain.len() as u64 + 7, 0.3)];
    let late = read(&mut clients, StreamSetpointsRequest { overrides: late, ..request.clone() }).await;
    assert!(late.bits_from(0) == plain.bits_from(0), "a change after the end has no effect");
    let start = read(&mut clients, StreamSetpointsRequest { overrides: vec![at_index(0, 1.0)], ..request }).await;
    assert_eq!(start.len(), plain.len());
}

#[tokio::test]
async fn overrides_that_cannot_be_are_refused_with_every_reason() {
    let (_server, mut clients, request) = ready_job().await;
    let overrides = vec![
        FeedOverrideChange { at: None, ratio: Some(0.5) },
        at_time(f64::NAN, 0.5),
        at_time(5.0, 2.005),
        at_index(4_999, 1.0),
        at_time(6.0, f64::NAN),
        at_index((1 << 32) + 1, 0.1),
        FeedOverrideChange { at: Some(At::TimeS(6.5)), ratio: None },
        at_time(7.0, 0.0),
    ];
    let status = stream(&mut clients, StreamSetpointsRequest { overrides, ..request.clone() }).await.unwrap_err();
    assert_error(&status, Code::InvalidArgument, "INVALID_FIELDS");
    let expected = [
        "overrides[0].at",
        "overrides[1].time_s",
        "overrides[2].ratio",
        "overrides[3].setpoint_index",
        "overrides[4].ratio",
        "overrides[5].setpoint_index",
        "overrides[6].ratio",
        "overrides[7].ratio",
    ];
    assert_eq!(violated_fields(&status), expected);

    // More than an answer can list, and more than a request may have.
    let overrides = vec![at_time(0.0, -1.0); 10_000];
    let status = stream(&mut clients, StreamSetpointsRequest { overrides, ..request.clone() }).await.unwrap_err();
    let info = status.get_error_details().error_info().cloned().expect("a reason");
    let not_listed: usize = info.metadata["violations_not_listed"].parse().expect("a number");
    let listed = violated_fields(&status).len();
    assert!(listed > 0 && listed + not_listed == 10_000, "{status:?}");
    let overrides = vec![at_time(0.0, 1.0); 10_001];
    let status = stream(&mut clients, StreamSetpointsRequest { overrides, ..request }).await.unwrap_err();
    assert_eq!(violated_fields(&status), ["overrides"]);
}

#[tokio::test]
async fn a_validation_with_overrides_gives_the_times_with_them() {
    let (_server, mut clients, _) = ready_job().await;
    let request = |overrides| ValidateProgramRequest {
        inline_program: SHAFT_CURED.into(),
        on: Some(On::Machine("machines/lathe".to_owned())),
        overrides,
        ..ValidateProgramRequest::default()
    };
    let mut summaries = Vec::new();
    for overrides in [vec![], vec![at_index(0, 0.5)]] {
        let response = clients.jobs.validate_program(request(overrides)).await.unwrap().into_inner();
        summaries.push(response.report.unwrap().summary.unwrap());
    }
    let ratio = summaries[1].cutting_time_s / summaries[0].cutting_time_s;
    assert!((ratio - 2.0).abs() < 1e-3, "{ratio}");
    for summary in summaries {
        let times = summary.limit_times.unwrap();
        // Nearly all of it at the programmed feed, whatever the override.
        assert!(times.feed_s > 0.99 * summary.duration_s, "{times:?}");
        let jerk = summary.axes[0].peak_jerk_at.unwrap();
        assert!((jerk.time_s - jerk.setpoint_index as f64 * 1e-3).abs() < 1e-9 && jerk.line > 0, "{jerk:?}");
    }
    let wrong = clients.jobs.validate_program(request(vec![at_time(1.0, 0.0)])).await.unwrap_err();
    assert_eq!(violated_fields(&wrong), ["overrides[0].ratio"]);
}
