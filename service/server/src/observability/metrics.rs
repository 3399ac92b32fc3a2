//! What `/metrics` shows. Each server has its own registry: nothing is global.

mod connections;
pub(crate) mod machines;
mod mqtt;
pub(crate) mod open;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub use connections::ConnectionMetrics;
use feedwave_store::{Observer, Tenant};
pub use mqtt::MqttMetrics;
use prometheus::proto::MetricFamily;
use prometheus::{
    Counter, Encoder, Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge, IntGaugeVec, Opts,
    Registry, TextEncoder,
};

/// The figures of one server.
#[derive(Clone, Debug)]
pub struct Metrics {
    registry: Registry,
    /// gRPC calls ended, by method and status code.
    pub requests: IntCounterVec,
    /// Time from a gRPC call to its end, by method, s.
    pub request_seconds: HistogramVec,
    /// gRPC calls in progress.
    pub active_requests: IntGauge,
    /// Setpoint streams open.
    pub active_streams: IntGauge,
    /// Setpoint streams open, by tenant; not shown.
    pub streams_by_tenant: OpenByTenant,
    /// Setpoints sent.
    pub setpoints: IntCounter,
    /// Setpoints that were generated only to reach the one that was asked for.
    pub regenerated_setpoints: IntCounter,
    /// Runs in progress.
    pub active_runs: IntGauge,
    /// Time that runs spent on what machines are shown to do, s.
    pub floor_seconds: Counter,
    /// Telemetry samples taken in.
    pub telemetry_samples: IntCounter,
    /// Decisions made durable, by action.
    pub decisions: IntCounterVec,
    /// Unacknowledged conditions of runs.
    pub open_conditions: IntGauge,
    /// Time from the arrival of the batch that causes a decision until the decision is durable and handed to the
    /// connection, s.
    pub decision_seconds: Histogram,
    /// Bytes of response messages sent, by method.
    pub sent_bytes: IntCounterVec,
    /// Jobs waiting for validation.
    pub validation_queue: IntGauge,
    /// Validations running.
    pub active_validations: IntGauge,
    /// Validations between their first turn and their end.
    pub begun_validations: IntGauge,
    /// Turns given to validations.
    pub validation_turns: IntCounter,
    /// Validations that had to begin again, since as many as permitted were begun.
    pub validations_set_aside: IntCounter,
    /// Validations ended, by the outcome of the job.
    pub validations: IntCounterVec,
    /// Time of a read of the store, s.
    pub store_read_seconds: Histogram,
    /// Time of a transaction that writes, to its durable end, s.
    pub store_commit_seconds: Histogram,
    /// Writes committed.
    pub store_writes: IntCounter,
    /// Writes waiting for the writer.
    pub store_write_queue: IntGauge,
    /// Records of logs that could not be read, and were passed over.
    pub unreadable_records: IntCounter,
    /// Bytes that the store takes, free space within it included.
    pub store_bytes: IntGauge,
    /// Records removed since they were kept no longer, by kind.
    pub retention_removed: IntCounterVec,
    /// Records that are kept no longer but not removed yet, by kind; what a dry run would remove.
    pub retention_expired: IntGaugeVec,
    /// 1 while the store can be written, 0 while it cannot.
    pub store_writable: IntGauge,
    /// Jobs stored, by state.
    pub jobs: IntGaugeVec,
    /// Connections, and what clients take up.
    pub connections: ConnectionMetrics,
    /// What is published by MQTT.
    pub mqtt: MqttMetrics,
}

/// Bounds of the time histograms, s: from what a read of the store takes to what a long stream does.
const SECONDS: [f64; 12] = [0.000_1, 0.000_5, 0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 1.0, 5.0, 30.0, 300.0];

/// Registers metrics; names and options are constants, so registration cannot fail.
struct Registrar(Registry);

impl Registrar {
    fn add<T: prometheus::core::Collector + Clone + 'static>(&self, metric: prometheus::Result<T>) -> T {
        let metric = metric.expect("names and labels of metrics are valid");
        self.0.register(Box::new(metric.clone())).expect("every metric is registered once");
        metric
    }

    fn counter(&self, name: &str, help: &str) -> IntCounter {
        self.add(IntCounter::new(name, help))
    }

    fn counters(&self, name: &str, help: &str, labels: &[&str]) -> IntCounterVec {
        self.add(IntCounterVec::new(Opts::new(name, help), labels))
    }

    fn gauge(&self, name: &str, help: &str) -> IntGauge {
        self.add(IntGauge::new(name, help))
    }

    fn gauges(&self, name: &str, help: &str, labels: &[&str]) -> IntGaugeVec {
        self.add(IntGaugeVec::new(Opts::new(name, help), labels))
    }

    fn seconds(&self, name: &str, help: &str) -> Histogram {
        self.add(Histogram::with_opts(HistogramOpts::new(name, help).buckets(SECONDS.to_vec())))
    }
}

impl Metrics {
    /// Figures at zero.
    // As long as the list of figures.
    #[must_use]
    pub fn new() -> Self {
        let registrar = Registrar(Registry::new());
        let build =
            registrar.gauges("feedwave_build_info", "Always 1; the labels say what runs.", &["version", "revision"]);
        build.with_label_values(&[super::VERSION, super::REVISION]).set(1);
        let request_seconds = HistogramOpts::new("feedwave_grpc_request_seconds", "Time from a gRPC call to its end.")
            .buckets(SECONDS.to_vec());
        Self {
            requests: registrar.counters("feedwave_grpc_requests_total", "gRPC calls ended.", &["method", "code"]),
            request_seconds: registrar.add(HistogramVec::new(request_seconds, &["method"])),
            active_requests: registrar.gauge("feedwave_grpc_active_requests", "gRPC calls in progress."),
            active_streams: registrar.gauge("feedwave_active_streams", "Setpoint streams open."),
            streams_by_tenant: OpenByTenant::default(),
            setpoints: registrar.counter("feedwave_setpoints_total", "Setpoints sent."),
            regenerated_setpoints: registrar.counter(
                "feedwave_setpoints_regenerated_total",
                "Setpoints generated only to reach the one that was asked for.",
            ),
            active_runs: registrar.gauge("feedwave_active_runs", "Runs in progress."),
            floor_seconds: registrar.add(Counter::new(
                "feedwave_floor_seconds_total",
                "Time that runs spent on what machines are shown to do, in seconds.",
            )),
            telemetry_samples: registrar.counter("feedwave_telemetry_samples_total", "Telemetry samples taken in."),
            decisions: registrar.counters("feedwave_decisions_total", "Decisions made durable.", &["action"]),
            open_conditions: registrar.gauge("feedwave_open_conditions", "Unacknowledged conditions of runs."),
            decision_seconds: registrar
                .seconds("feedwave_decision_seconds", "Time from a batch to its decision, durable and sent."),
            sent_bytes: registrar.counters("feedwave_grpc_sent_bytes_total", "Bytes of responses sent.", &["method"]),
            validation_queue: registrar.gauge("feedwave_validation_queue", "Jobs waiting for validation."),
            active_validations: registrar.gauge("feedwave_active_validations", "Validations running."),
            begun_validations: registrar
                .gauge("feedwave_begun_validations", "Validations between their first turn and their end."),
            validation_turns: registrar.counter("feedwave_validation_turns_total", "Turns given to validations."),
            validations_set_aside: registrar
                .counter("feedwave_validations_set_aside_total", "Validations that had to begin again."),
            validations: registrar.counters("feedwave_validations_total", "Validations of jobs ended.", &["outcome"]),
            store_read_seconds: registrar.seconds("feedwave_store_read_seconds", "Time of a read of the store."),
            store_commit_seconds: registrar
                .seconds("feedwave_store_commit_seconds", "Time of a writing transaction to its durable end."),
            store_writes: registrar.counter("feedwave_store_writes_total", "Writes committed."),
            unreadable_records: registrar.counter(
                "feedwave_unreadable_records_total",
                "Records of logs that could not be read, and were passed over.",
            ),
            store_write_queue: registrar.gauge("feedwave_store_write_queue", "Writes waiting for the writer."),
            store_bytes: registrar
                .gauge("feedwave_store_bytes", "Bytes that the store takes, free space within it included."),
            retention_removed: registrar.counters(
                "feedwave_retention_removed_total",
                "Records removed since they were kept no longer.",
                &["kind"],
            ),
            retention_expired: registrar.gauges(
                "feedwave_retention_expired",
                "Records that are kept no longer but not removed yet.",
                &["kind"],
            ),
            store_writable: registrar.gauge("feedwave_store_writable", "1 while the store can be written."),
            jobs: registrar.gauges("feedwave_jobs", "Jobs stored.", &["state"]),
            connections: ConnectionMetrics::new(&registrar),
            mqtt: MqttMetrics::new(&registrar),
            registry: registrar.0,
        }
    }

    /// The figures of one tenant: jobs by state, streams and validations, conditions that nobody has acknowledged; and others,
    /// by name.
    pub(crate) fn families_of_tenant<'a>(
        jobs: impl IntoIterator<Item = (&'a str, u64)>,
        streams: u64,
        validations: u64,
        queued_validations: u64,
        open_conditions: u64,
        others: Vec<MetricFamily>,
    ) -> Vec<MetricFamily> {
        let own = Self::new();
        let signed = |count: u64| i64::try_from(count).unwrap_or(i64::MAX);
        for (state, count) in jobs {
            own.jobs.with_label_values(&[state]).set(signed(count));
        }
        own.active_streams.set(signed(streams));
        own.active_validations.set(signed(validations));
        own.validation_queue.set(signed(queued_validations));
        own.open_conditions.set(signed(open_conditions));
        let shown = Registry::new();
        let gauges = [own.active_streams, own.active_validations, own.validation_queue, own.open_conditions];
        let gauges = gauges.into_iter().map(|gauge| Box::new(gauge) as Box<dyn prometheus::core::Collector>);
        for collector in gauges.chain([Box::new(own.jobs) as Box<dyn prometheus::core::Collector>]) {
            // Their names differ, as those of all metrics do.
            let _ = shown.register(collector);
        }
        gathered(&shown, others)
    }

    /// The text form that Prometheus reads.
    #[must_use]
    pub fn to_text(&self) -> String {
        text_of(&self.families(Vec::new()))
    }

    /// Does a part of what a run does for those who look on, and counts its time.
    pub(crate) fn showing<R>(&self, work: impl FnOnce() -> R) -> R {
        let begun = Instant::now();
        let done = work();
        self.floor_seconds.inc_by(begun.elapsed().as_secs_f64());
        done
    }

    /// The figures, those of the process, and others, by name.
    pub(crate) fn families(&self, mut others: Vec<MetricFamily>) -> Vec<MetricFamily> {
        others.extend(process());
        gathered(&self.registry, others)
    }
}

/// Processor time, memory, descriptors, threads and start of the process, by the names that Prometheus has for them; none where
/// the system does not tell.
#[cfg(target_os = "linux")]
fn process() -> Vec<MetricFamily> {
    prometheus::core::Collector::collect(&prometheus::process_collector::ProcessCollector::for_self())
}

#[cfg(not(target_os = "linux"))]
const fn process() -> Vec<MetricFamily> {
    Vec::new()
}

fn gathered(registry: &Registry, others: Vec<MetricFamily>) -> Vec<MetricFamily> {
    let mut families = registry.gather();
    families.extend(others);
    families.sort_by(|one, other| one.name().cmp(other.name()));
    families
}

/// Families of metrics in the text form that Prometheus reads.
pub(crate) fn text_of(families: &[MetricFamily]) -> String {
    let mut text = Vec::new();
    // Writing into memory does not fail, and label values are valid: nothing to report.
    let _ = TextEncoder::new().encode(families, &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

/// Counts what is open for each tenant. Cloning is cheap; clones count together.
#[derive(Clone, Debug, Default)]
pub struct OpenByTenant(Arc<Mutex<HashMap<Tenant, u64>>>);

impl OpenByTenant {
    fn open(&self) -> MutexGuard<'_, HashMap<Tenant, u64>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many are open.
    #[must_use]
    pub fn of(&self, tenant: Tenant) -> u64 {
        self.open().get(&tenant).copied().unwrap_or(0)
    }

    /// Counts one until what is returned is dropped.
    #[must_use]
    pub fn enter(&self, tenant: Tenant) -> TenantGuard {
        *self.open().entry(tenant).or_default() += 1;
        TenantGuard { all: self.clone(), tenant }
    }
}

/// Something that is open for a tenant, until it is dropped.
#[derive(Debug)]
pub struct TenantGuard {
    all: OpenByTenant,
    tenant: Tenant,
}

impl Drop for TenantGuard {
    fn drop(&mut self) {
        let mut open = self.all.open();
        if let Some(count) = open.get_mut(&self.tenant) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.tenant);
            }
        }
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

impl Observer for Metrics {
    fn write_committed(&self, operations: usize, latency: Duration) {
        self.store_writes.inc_by(operations as u64);
        self.store_commit_seconds.observe(latency.as_secs_f64());
    }

    fn read_done(&self, latency: Duration) {
        self.store_read_seconds.observe(latency.as_secs_f64());
    }
}

/// Adds one to a gauge until it is dropped.
#[derive(Debug)]
pub struct GaugeGuard(IntGauge);

impl GaugeGuard {
    /// Counts something that begins.
    #[must_use]
    pub fn new(gauge: &IntGauge) -> Self {
        gauge.inc();
        Self(gauge.clone())
    }
}

impl Drop for GaugeGuard {
    fn drop(&mut self) {
        self.0.dec();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_shows_build_and_observations() {
        let metrics = Metrics::new();
        metrics.requests.with_label_values(&["/feedwave.v1.Jobs/GetJob", "NOT_FOUND"]).inc();
        metrics.write_committed(3, Duration::from_millis(2));
        let guard = GaugeGuard::new(&metrics.active_streams);
        let text = metrics.to_text();
        assert!(text.contains(&format!("feedwave_build_info{{revision=\"{}\",version=", super::super::REVISION)));
        assert!(
            text.contains("feedwave_grpc_requests_total{code=\"NOT_FOUND\",method=\"/feedwave.v1.Jobs/GetJob\"} 1")
        );
        assert!(text.contains("feedwave_store_writes_total 3"));
        assert!(text.contains("feedwave_active_streams 1"));
        drop(guard);
        assert!(metrics.to_text().contains("feedwave_active_streams 0"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_process_tells_of_itself_in_the_whole_and_not_to_one_tenant() {
        let names =
            |families: &[MetricFamily]| families.iter().map(|family| family.name().to_owned()).collect::<Vec<_>>();
        let whole = names(&Metrics::new().families(Vec::new()));
        for name in
            ["cpu_seconds_total", "resident_memory_bytes", "open_fds", "max_fds", "start_time_seconds", "threads"]
        {
            assert!(whole.contains(&format!("process_{name}")), "{name} is not in {whole:?}");
        }
        let of_tenant = names(&Metrics::families_of_tenant([("READY", 1)], 0, 0, 0, 0, Vec::new()));
        assert!(!of_tenant.iter().any(|name| name.starts_with("process_")), "{of_tenant:?}");
    }
}
