//! One machine: sends at its own pace and receives decisions.

use std::f64::consts::TAU;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use feedwave_contract::proto::ingest_request::Message as Request;
use feedwave_contract::proto::ingest_response::Message;
use feedwave_contract::proto::ingest_start::Target;
use feedwave_contract::proto::machine_event::Event;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::window_length::Length;
use feedwave_contract::proto::{
    ChannelPair, DataQuality, DecisionRules, FeedRule, IngestEnd, IngestRequest, IngestStart, MachineEvent,
    MonitoringConfig, SensorQuantity, Sensors, TelemetryBatch, WindowLength,
};
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;
use tokio_stream::wrappers::UnboundedReceiverStream;
use tonic::transport::Channel;

use super::Options;

/// Time stamp of the first sample, ns.
pub const FIRST_NS: u64 = 1_000_000_000;
/// Revolutions of the spindle per second.
const SPINDLE_HZ: f64 = 100.0;
/// Windows without contact, for the baseline.
const IDLE_WINDOWS: u64 = 2;

/// The default grouping and baseline; windows are shorter than by default, so that there are decisions to count.
pub fn config(options: &Options) -> MonitoringConfig {
    MonitoringConfig {
        sample_rate_hz: Some(options.rate_hz as f64),
        tool: Some(Sensors { quantity: SensorQuantity::Displacement.into(), max: 10.0, ..Default::default() }),
        window: Some(WindowLength { length: Some(Length::DurationS(options.window_ms as f64 / 1e3)) }),
        settling_s: Some(0.0),
        // A busy computer must not look like a broken sensor.
        quality: Some(DataQuality { silence_s: Some(60.0), stale_s: Some(60.0), ..Default::default() }),
        rules: Some(DecisionRules {
            feed: Some(FeedRule { lower: 0.003, upper: 0.01, step: Some(0.05) }),
            ..Default::default()
        }),
        ..Default::default()
    }
}

/// Batch `sequence` with the samples of `length` periods.
fn batch(sequence: u64, length: u64, options: &Options) -> TelemetryBatch {
    let samples = sequence * length..(sequence + 1) * length;
    let idle = IDLE_WINDOWS * options.window_ms * options.rate_hz / 1_000;
    let turn = |sample: u64| sample as f64 * SPINDLE_HZ / options.rate_hz as f64 * TAU;
    // Run-out once per turn, noise that never repeats, and a deflection that changes from window to window.
    let noise = |sample: u64| 1e-5 * (sample.wrapping_mul(2_654_435_761) % 1_009) as f64 / 1_009.0;
    let deflection = |sample: u64| if sample < idle { 0.0 } else { 0.002 + 0.01 * ((sample / idle) % 2) as f64 };
    TelemetryBatch {
        sequence,
        events: if sequence == 0 {
            vec![MachineEvent { event: Some(Event::ProgrammedRevPerMin(60.0 * SPINDLE_HZ)) }]
        } else {
            Vec::new()
        },
        time_ns: samples.clone().map(|sample| FIRST_NS + sample * 1_000_000_000 / options.rate_hz).collect(),
        tool: Some(ChannelPair {
            x: samples
                .clone()
                .map(|sample| 1.0 + deflection(sample) + 0.001 * turn(sample).cos() + noise(sample))
                .collect(),
            y: samples.clone().map(|sample| 1.5 + 0.001 * turn(sample).sin() + noise(sample + 500)).collect(),
        }),
        spindle_angle_deg: samples.clone().map(turn).collect(),
        contact: samples.map(|sample| sample >= idle).collect(),
        ..Default::default()
    }
}

/// How long a decision took.
#[derive(Clone, Copy, Debug)]
pub struct Latency {
    /// When the batch that caused it was sent.
    pub sent: Instant,
    pub received: Instant,
}

/// Sends batches at their pace and waits for the decisions.
pub async fn run(
    mut client: TelemetryClient<Channel>,
    job: String,
    number: u64,
    batch_ms: u64,
    options: Options,
) -> Vec<Latency> {
    // Never full: a machine does not wait for the service.
    let (requests, messages) = mpsc::unbounded_channel();
    let send = |message| requests.send(IngestRequest { message: Some(message) }).expect("a service that listens");
    send(Request::Start(IngestStart { target: Some(Target::Job(job)), sensor_time_ns: None, recording: None }));
    let responses = client.ingest(UnboundedReceiverStream::new(messages)).await.expect("a stream");
    let mut responses = responses.into_inner();
    let length = batch_ms * options.rate_hz / 1_000;
    let batches = options.seconds * 1_000 / batch_ms;
    let sent = Mutex::new(Vec::with_capacity(batches as usize));

    let sending = async {
        let stagger = Duration::from_millis(options.window_ms) * number as u32 / options.machines as u32;
        let mut pace =
            tokio::time::interval_at(tokio::time::Instant::now() + stagger, Duration::from_micros(1_000 * batch_ms));
        pace.set_missed_tick_behavior(MissedTickBehavior::Burst);
        for sequence in 0..batches {
            let batch = batch(sequence, length, &options);
            pace.tick().await;
            sent.lock().expect("whole").push(Instant::now());
            send(Request::Batch(batch));
        }
        send(Request::End(IngestEnd {}));
    };
    let hearing = async {
        let mut latencies = Vec::new();
        while let Some(response) = responses.message().await.expect("a stream without errors") {
            let received = Instant::now();
            if let Some(Message::Decision(decision)) = response.message {
                let sample = (decision.sensor_time_ns - FIRST_NS) * options.rate_hz / 1_000_000_000;
                let sent = sent.lock().expect("whole")[(sample / length) as usize];
                latencies.push(Latency { sent, received });
            }
        }
        latencies
    };
    // Both halves in tasks of their own would only add a hop: the sender is idle between two ticks.
    let ((), latencies) = tokio::join!(sending, hearing);
    latencies
}
