//! Setpoint streams: from anywhere, in every encoding, and how they end.

use feedwave_contract::delta;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{
    CancelJobRequest, ColumnKind, CreateJobRequest, Encoding, Frame, GenerationMode, GetPlanSummaryRequest,
    ServoOutput, StreamSetpointsRequest,
};
use feedwave_server::config::Limits;
use tonic::{Code, Request};

use crate::support::{
    TURNING, TestServer, column, eventually, header, lathe_job, patiently, resting, stream_of, told, within_a_deadline,
};

/// Columns as streamed, to the bit.
fn bits(columns: &[f64]) -> Vec<u64> {
    columns.iter().map(|value| value.to_bits()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_stream_ends_on_the_programmed_end_point_and_tells_lines() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let (header, chunks) = test.collect(stream_of(&job)).await;
    let names: Vec<_> = header.columns.iter().map(|column| column.name.as_str()).collect();
    let expected = ["X_mm", "Z_mm", "path_position_mm", "feed_mm_per_min", "vibration_offset_mm", "spindle_angle_deg"];
    assert_eq!(names, expected);
    let count: u64 = chunks.iter().map(|chunk| u64::from(chunk.count)).sum();
    assert_eq!(header.setpoint_count, Some(count));
    assert_eq!(Some(count), job.summary.map(|summary| summary.setpoint_count));
    let (x, z) = (column(&chunks, 0), column(&chunks, 1));
    assert_eq!((x.last(), z.last()), (Some(&30.0), Some(&20.0)));
    assert!(column(&chunks, 4).iter().any(|offset| *offset > 0.05));
    let lines: Vec<u32> = chunks.iter().flat_map(|chunk| chunk.line_runs.iter().map(|run| run.line)).collect();
    assert!(lines.contains(&9) && lines.contains(&10), "{lines:?}");
    for chunk in &chunks {
        assert_eq!(chunk.line_runs.iter().map(|run| run.count).sum::<u32>(), chunk.count);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_from_any_index_equals_the_whole_one_bit_for_bit() {
    let test = TestServer::start().await;
    // 50 µs: enough setpoints for several checkpoints.
    let slowly = TURNING.replace("F0.1", "F0.05");
    let job = test.ready(CreateJobRequest { interpolation_period_us: 50, ..lathe_job(&slowly) }).await;
    let (header, whole) = test.collect(stream_of(&job)).await;
    let count = header.setpoint_count.unwrap();
    assert!(count > 300_000, "{count} setpoints reach no second checkpoint");
    let whole: Vec<_> = (0..header.columns.len()).map(|index| column(&whole, index)).collect();
    for first in [1, 1_023, 1_024, 131_071, 131_072, 131_073, 200_000, 299_999, count - 1, count] {
        let request = StreamSetpointsRequest { start: Some(Start::StartIndex(first)), ..stream_of(&job) };
        let (header, chunks) = test.collect(request).await;
        assert_eq!(header.first_index, first);
        assert_eq!(chunks.first().map_or(first, |chunk| chunk.first_index), first);
        for (index, values) in whole.iter().enumerate() {
            let resumed = column(&chunks, index);
            assert!(bits(&resumed) == bits(&values[first as usize..]), "column {index} from {first} on");
        }
    }
    let beyond = StreamSetpointsRequest { start: Some(Start::StartIndex(count + 1)), ..stream_of(&job) };
    let status = test.stream(beyond).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::OutOfRange, "START_BEYOND_END"));
}

#[tokio::test(flavor = "multi_thread")]
async fn other_periods_and_modes_start_anywhere_too() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let request = StreamSetpointsRequest {
        interpolation_period_us: 500,
        generation_mode: GenerationMode::Tangential.into(),
        ..stream_of(&job)
    };
    let (header, whole) = test.collect(request.clone()).await;
    assert_eq!((header.period_us, header.setpoint_count), (500.0, None));
    let from_time = StreamSetpointsRequest { start: Some(Start::StartTimeS(1.5)), ..request.clone() };
    let (header, resumed) = test.collect(from_time).await;
    assert_eq!(header.first_index, 3_000);
    assert_eq!(bits(&column(&resumed, 0)), bits(&column(&whole, 0)[3_000..]));

    let count = column(&whole, 0).len() as u64;
    let beyond = StreamSetpointsRequest { start: Some(Start::StartIndex(count + 1)), ..request };
    let mut messages = test.stream(beyond).await.unwrap();
    crate::support::header(&mut messages).await;
    let status = messages.message().await.unwrap_err();
    assert_eq!(told(&status).1, "START_BEYOND_END");
}

#[tokio::test(flavor = "multi_thread")]
async fn fixed_point_deltas_decode_within_half_a_step() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let (_, exact) = test.collect(stream_of(&job)).await;
    let request =
        StreamSetpointsRequest { encoding: Encoding::FixedPointDelta.into(), chunk_size: 777, ..stream_of(&job) };
    let (header, compact) = test.collect(request).await;
    for (index, info) in header.columns.iter().enumerate() {
        assert!(info.resolution > 0.0);
        let decoded: Vec<f64> =
            compact.iter().flat_map(|chunk| delta::decode(&chunk.columns[index].deltas, info.resolution)).collect();
        let exact = column(&exact, index);
        assert_eq!(decoded.len(), exact.len());
        for (decoded, exact) in decoded.iter().zip(&exact) {
            let rounding = 2.0 * f64::EPSILON * exact.abs();
            assert!((decoded - exact).abs() <= info.resolution / 2.0 + rounding, "{}: {exact}", info.name);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_the_columns_wanted_are_sent() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let columns = vec![ColumnKind::Feed.into(), ColumnKind::AxisPosition.into()];
    let request = StreamSetpointsRequest { columns, frame: Frame::Work.into(), ..stream_of(&job) };
    let (header, chunks) = test.collect(request).await;
    let names: Vec<_> = header.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["X_mm", "Z_mm", "feed_mm_per_min"]);
    assert!(chunks.iter().all(|chunk| chunk.columns.len() == 3));
}

#[tokio::test(flavor = "multi_thread")]
async fn servo_side_streams_conditions_or_what_the_drives_make_of_them() {
    let test = TestServer::start().await;
    let request = CreateJobRequest { generation_mode: GenerationMode::ServoSide.into(), ..lathe_job(TURNING) };
    let job = test.ready(request).await;
    let (header, conditions) = test.collect(stream_of(&job)).await;
    let place = |name: &str| header.columns.iter().position(|column| column.name == name).unwrap();
    let frequency = column(&conditions, place("vibration_frequency_hz"));
    assert!(frequency.contains(&41.667) && frequency.contains(&0.0));

    let expanded_request = StreamSetpointsRequest { servo_output: ServoOutput::Expanded.into(), ..stream_of(&job) };
    let (expanded_header, expanded) = test.collect(expanded_request.clone()).await;
    assert_eq!(expanded_header.period_us, 125.0);
    let z = column(&expanded, 1);
    assert_eq!(Some(z.len() as u64), expanded_header.setpoint_count);
    // At the ends of the interpolation periods it is the tangential mode.
    let tangential = StreamSetpointsRequest { generation_mode: GenerationMode::Tangential.into(), ..stream_of(&job) };
    let (_, tangential) = test.collect(tangential).await;
    let every_eighth: Vec<f64> = z.iter().step_by(8).copied().collect();
    assert_eq!(bits(&every_eighth), bits(&column(&tangential, 1)));
    for first in [1, 8, 9, 5_003] {
        let request = StreamSetpointsRequest { start: Some(Start::StartIndex(first)), ..expanded_request.clone() };
        let (_, resumed) = test.collect(request).await;
        assert_eq!(bits(&column(&resumed, 1)), bits(&z[first as usize..]), "from {first} on");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_requests_name_every_field() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let request = StreamSetpointsRequest {
        start: Some(Start::StartTimeS(f64::NAN)),
        encoding: 9,
        frame: 9,
        chunk_size: 1 << 20,
        interpolation_period_us: 1,
        generation_mode: 9,
        servo_output: 9,
        columns: vec![ColumnKind::ServoPhase.into()],
        ..stream_of(&job)
    };
    let status = test.stream(request).await.unwrap_err();
    let expected = [
        "start_time_s",
        "encoding",
        "frame",
        "chunk_size",
        "generation_mode",
        "servo_output",
        "interpolation_period_us",
        "columns[0]",
    ];
    assert_eq!(told(&status).2, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_plan_summary_shows_how_close_the_limits_are() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(TURNING)).await;
    let request = GetPlanSummaryRequest { job: job.name.clone() };
    let summary = test.setpoints().get_plan_summary(request).await.unwrap().into_inner().plan_summary.unwrap();
    assert_eq!(summary.summary, job.summary);
    assert_eq!(summary.limit_use.len(), 2);
    assert!(
        summary.limit_use.iter().all(|axis| axis.velocity_share > 0.0 && axis.velocity_share < 1.0 + 1e-9),
        "{summary:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_not_ready_has_no_stream() {
    let test = TestServer::start().await;
    let job = test.validated(lathe_job("G777\n")).await;
    let status = test.stream(stream_of(&job)).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::FailedPrecondition, "JOB_NOT_READY"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_deadline_of_the_call_ends_the_stream_and_its_generator() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(&resting(4_000))).await;
    let mut messages = within_a_deadline(async |deadline| {
        let mut request = Request::new(stream_of(&job));
        request.set_timeout(deadline);
        let mut messages = test.setpoints().stream_setpoints(request).await?.into_inner();
        messages.message().await?;
        Ok(messages)
    })
    .await;
    // Nothing is read meanwhile: the generator waits for the reader when its deadline comes.
    eventually(|| test.server.metrics().active_streams.get() == 0).await;
    let status = patiently(async {
        loop {
            match messages.message().await {
                Ok(Some(_)) => {}
                Ok(None) => panic!("the stream ended as if it were complete"),
                Err(status) => break status,
            }
        }
    })
    .await;
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::DeadlineExceeded, "DEADLINE_EXCEEDED"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_that_leaves_frees_its_generator() {
    let limits = Limits { concurrent_streams: 1, ..Limits::default() };
    let test = TestServer::with_limits(limits).await;
    let job = test.ready(lathe_job(&resting(4_000))).await;
    let mut messages = test.stream(stream_of(&job)).await.unwrap();
    header(&mut messages).await;
    let status = test.stream(stream_of(&job)).await.unwrap_err();
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::ResourceExhausted, "OVERLOADED"));
    drop(messages);
    eventually(|| test.server.metrics().active_streams.get() == 0).await;
    test.stream(stream_of(&job)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn cancelling_the_job_ends_its_streams() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(&resting(4_000))).await;
    let mut messages = test.stream(stream_of(&job)).await.unwrap();
    header(&mut messages).await;
    test.jobs().cancel_job(CancelJobRequest { name: job.name.clone() }).await.unwrap();
    let status = patiently(async {
        loop {
            if let Err(status) = messages.message().await {
                break status;
            }
        }
    })
    .await;
    assert_eq!((told(&status).0, told(&status).1.as_str()), (Code::Aborted, "JOB_CANCELLED"));
    eventually(|| test.server.metrics().active_streams.get() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_reader_holds_up_nobody_else() {
    let test = TestServer::start().await;
    let job = test.ready(lathe_job(&resting(4_000))).await;
    let mut slow = test.stream(stream_of(&job)).await.unwrap();
    header(&mut slow).await;
    let quick = test.ready(lathe_job(TURNING)).await;
    let (_, chunks) = patiently(test.collect(stream_of(&quick))).await;
    assert!(!chunks.is_empty());
    assert_eq!(test.server.metrics().active_streams.get(), 1);
}
