//! What streams carry: the numbers.

use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{ColumnKind, Encoding, GetPlanSummaryRequest, StreamSetpointsRequest};
use feedwave_tests::{Clients, SHAFT_CURED, SHAFT_END_X_MM, SHAFT_END_Z_MM, Server, Setpoints, stream};
use tonic::Code;

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

#[tokio::test]
async fn a_turning_program_comes_out_as_setpoints_that_end_where_it_says() {
    let (_server, mut clients, request) = ready_job().await;
    let setpoints = read(&mut clients, request.clone()).await;
    let header = &setpoints.header;
    assert_eq!((header.period_us, header.first_index), (1000.0, 0));
    assert_eq!(header.setpoint_count, Some(setpoints.len() as u64));
    let summary = GetPlanSummaryRequest { job: request.job };
    let summary = clients.setpoints.get_plan_summary(summary).await.unwrap().into_inner().plan_summary.unwrap();
    let counts = summary.summary.unwrap();
    assert_eq!(counts.setpoint_count, setpoints.len() as u64);
    assert!(summary.limit_use.iter().all(|axis| axis.velocity_share <= 1.0), "{:?}", summary.limit_use);

    // The end, to the last bit.
    let (x, z) = (setpoints.column("X_mm"), setpoints.column("Z_mm"));
    assert_eq!(x.last().copied().map(f64::to_bits), Some(SHAFT_END_X_MM.to_bits()));
    assert_eq!(z.last().copied().map(f64::to_bits), Some(SHAFT_END_Z_MM.to_bits()));

    // Lines of the program, in their order and each with its own motion.
    let mut lines = setpoints.lines.clone();
    lines.dedup();
    assert_eq!(lines, [0, 4, 6, 7], "where the machine is before the first block, the rapid, the line and the arc");
    let cut = setpoints.lines.iter().position(|line| *line == 6).expect("line 6");
    let arc = setpoints.lines.iter().position(|line| *line == 7).expect("line 7");
    assert!(x[..cut].iter().zip(&z[..cut]).all(|(x, z)| (0.0..=3.0).contains(x) && (0.0..=10.0).contains(z)));
    // Line 6 goes from (3, 10) to (5, 20): z = 10 + 5·(x − 3). Near its end the vibration reaches into the arc.
    for (x, z) in x[cut..arc].iter().zip(&z[cut..arc]).filter(|(_, z)| **z <= 20.0) {
        assert!((z - 10.0 - 5.0 * (x - 3.0)).abs() < 1e-8, "({x}, {z}) is not on line 6");
    }

    // The vibration: its amplitude, its frequency, and none outside the section.
    let vibration = setpoints.of_kind(ColumnKind::VibrationOffset);
    let peak = vibration.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    assert!(peak <= 0.03 + 1e-12 && peak > 0.03 * 0.99, "{peak}");
    assert!(vibration[..cut].iter().all(|value| *value == 0.0));
    // Blended in over the path length of two vibrations at 50 mm/min, which is more than 1.2 amplitudes.
    let ramp_mm = 2.0 * (50.0 / 60.0) / 41.667;
    let path = setpoints.of_kind(ColumnKind::PathPosition);
    for periods in [1_u32, 3, 5, 50, 100, 150, 200, 217, 1_000] {
        let time_s = f64::from(periods) * 1e-3;
        let index = cut + periods as usize - 1;
        let x = ((path[index] - path[cut - 1]) / ramp_mm).min(1.0);
        let envelope = x * x * x * (10.0 + x * (6.0 * x - 15.0));
        let expected = 0.03 * envelope * (2.0 * std::f64::consts::PI * 41.667 * time_s).sin();
        assert!((vibration[index] - expected).abs() < 1e-9, "{periods}: {} is not {expected}", vibration[index]);
    }
}

#[tokio::test]
async fn a_resumed_stream_is_the_original_to_the_last_bit() {
    let (_server, mut clients, request) = ready_job().await;
    let whole = read(&mut clients, request.clone()).await;
    let count = whole.len() as u64;
    for index in [0, 1, 8_191, 8_192, count / 3, count / 2 + 1, count - 1] {
        let resumed =
            read(&mut clients, StreamSetpointsRequest { start: Some(Start::StartIndex(index)), ..request.clone() })
                .await;
        assert_eq!(resumed.header.first_index, index);
        assert!(resumed.bits_from(index) == whole.bits_from(index), "from index {index}");
        assert_eq!(resumed.lines, whole.lines[whole.len() - resumed.len()..], "from index {index}");
    }
    // By time: the first setpoint at or after it. Setpoint `i` belongs to time `i` ms.
    for (time_s, index) in [(0.0, 0), (1.0, 1_000), (1.000_1, 1_001)] {
        let start = Some(Start::StartTimeS(time_s));
        let resumed = read(&mut clients, StreamSetpointsRequest { start, ..request.clone() }).await;
        assert_eq!(resumed.header.first_index, index, "{time_s} s");
        assert!(resumed.bits_from(index) == whole.bits_from(index), "from {time_s} s");
    }
}

#[tokio::test]
async fn values_do_not_depend_on_the_size_of_chunks() {
    let (_server, mut clients, request) = ready_job().await;
    let whole = read(&mut clients, request.clone()).await;
    for chunk_size in [1, 1_000, 131_072] {
        let other = read(&mut clients, StreamSetpointsRequest { chunk_size, ..request.clone() }).await;
        assert!(other.bits_from(0) == whole.bits_from(0), "chunks of {chunk_size}");
        assert_eq!(other.lines, whole.lines);
    }
}

#[tokio::test]
async fn raw_doubles_are_the_same_values() {
    let (_server, mut clients, request) = ready_job().await;
    let packed = read(&mut clients, request.clone()).await;
    let encoding = Encoding::RawDouble.into();
    let raw = read(&mut clients, StreamSetpointsRequest { encoding, ..request.clone() }).await;
    assert!(raw.bits_from(0) == packed.bits_from(0));
    assert_eq!(raw.lines, packed.lines);
    assert!(raw.header.columns.iter().all(|column| column.resolution == 0.0));
    let start = Some(Start::StartIndex(12_345));
    let resumed = read(&mut clients, StreamSetpointsRequest { start, encoding, chunk_size: 1_000, ..request }).await;
    assert!(resumed.bits_from(12_345) == packed.bits_from(12_345));
}

#[tokio::test]
async fn the_compact_encoding_keeps_its_stated_resolution_and_is_a_fraction_of_the_size() {
    let (_server, mut clients, request) = ready_job().await;
    let exact = read(&mut clients, request.clone()).await;
    let encoding = Encoding::FixedPointDelta.into();
    let compact = read(&mut clients, StreamSetpointsRequest { encoding, ..request.clone() }).await;
    assert_eq!(compact.len(), exact.len());
    assert_eq!(compact.lines, exact.lines);
    for ((exact, compact), column) in exact.columns.iter().zip(&compact.columns).zip(&compact.header.columns) {
        assert!(column.resolution > 0.0, "{column:?}");
        // Half a step, and the rounding of the decoded double itself.
        let scale = exact.iter().fold(0.0_f64, |scale, value| scale.max(value.abs()));
        let bound = column.resolution / 2.0 + scale * f64::EPSILON;
        let worst = exact.iter().zip(compact).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(worst <= bound, "{}: {worst} exceeds {bound}", column.name);
    }
    assert!(compact.bytes * 2 < exact.bytes, "{} of {} bytes", compact.bytes, exact.bytes);

    // Each chunk starts from nothing, so that a stream can be resumed in this encoding too.
    let start = Some(Start::StartIndex(12_345));
    let resumed = read(&mut clients, StreamSetpointsRequest { start, encoding, ..request }).await;
    assert!(resumed.bits_from(12_345) == compact.bits_from(12_345));
}

#[tokio::test]
async fn columns_can_be_chosen_and_another_period_asked_for() {
    let (_server, mut clients, request) = ready_job().await;
    let columns = vec![ColumnKind::AxisPosition.into()];
    let axes = read(&mut clients, StreamSetpointsRequest { columns, ..request.clone() }).await;
    let names: Vec<&str> = axes.header.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["X_mm", "Z_mm"]);
    let slow = read(&mut clients, StreamSetpointsRequest { interpolation_period_us: 2_000, ..request }).await;
    assert_eq!(slow.header.period_us, 2000.0);
    assert_eq!(slow.column("Z_mm").last().copied(), Some(SHAFT_END_Z_MM));
    assert!(slow.len().abs_diff(axes.len() / 2) < 100, "{} and {}", slow.len(), axes.len());
}

#[tokio::test]
async fn a_stream_that_cannot_be_is_refused_with_the_reason() {
    let (_server, mut clients, request) = ready_job().await;
    let count = read(&mut clients, request.clone()).await.len() as u64;
    let beyond = StreamSetpointsRequest { start: Some(Start::StartIndex(count + 1)), ..request.clone() };
    let status = stream(&mut clients, beyond).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange, "{status:?}");
    let wrong = StreamSetpointsRequest {
        start: Some(Start::StartTimeS(f64::NAN)),
        chunk_size: 131_073,
        interpolation_period_us: 49,
        encoding: 9,
        ..request.clone()
    };
    let fields = violated_fields(&stream(&mut clients, wrong).await.unwrap_err());
    assert_eq!(fields, ["chunk_size", "encoding", "interpolation_period_us", "start_time_s"]);
    let wrong = StreamSetpointsRequest { job: "jobs/none".to_owned(), ..request };
    let status = stream(&mut clients, wrong).await.unwrap_err();
    assert_error(&status, Code::InvalidArgument, "INVALID_FIELDS");
}
