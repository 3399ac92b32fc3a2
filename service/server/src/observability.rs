//! How the service shows what it does: the log, traces, metrics.

pub mod metrics;

use std::io::IsTerminal as _;

use opentelemetry::trace::TracerProvider as _;
use opentelemetry_otlp::WithExportConfig as _;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing_subscriber::Layer as _;
use tracing_subscriber::filter::{ParseError, Targets};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use crate::config::{Config, LogFormat};

/// Version of the service.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Source revision it was built from; empty where the build did not say (`FEEDWAVE_REVISION` at build time).
pub const REVISION: &str = match option_env!("FEEDWAVE_REVISION") {
    Some(revision) => revision,
    None => "",
};

/// Keeps the export of traces alive; what is still waiting is sent when it is shut down.
#[derive(Debug)]
pub struct LogGuard {
    traces: Option<SdkTracerProvider>,
}

impl LogGuard {
    /// Sends what is still waiting. Blocks for a few seconds at most.
    pub fn shutdown(self) {
        if let Some(traces) = self.traces
            && let Err(error) = traces.shutdown()
        {
            tracing::warn!(%error, "the last traces could not be exported");
        }
    }
}

/// Sets up the process' log and, where configured, the export of traces. Call once, inside the runtime.
///
/// # Errors
/// A text for the operator where the exporter cannot be built or a log is set up already.
pub fn init(config: &Config) -> Result<LogGuard, String> {
    std::panic::set_hook(Box::new(log_panic));
    let filter: Targets = config.log.level.parse().map_err(|error: ParseError| error.to_string())?;
    let lines =
        tracing_subscriber::fmt::layer().with_ansi(std::io::stderr().is_terminal()).with_writer(std::io::stderr);
    let lines = match config.log.format {
        LogFormat::Text => lines.boxed(),
        LogFormat::Json => lines.json().flatten_event(true).boxed(),
    };
    let traces = config.telemetry.otlp_endpoint.as_deref().map(exporter).transpose()?;
    let spans = traces.as_ref().map(|traces| tracing_opentelemetry::layer().with_tracer(traces.tracer("feedwave")));
    tracing_subscriber::registry()
        .with(filter)
        .with(lines)
        .with(spans)
        .try_init()
        .map_err(|error| error.to_string())?;
    Ok(LogGuard { traces })
}

/// Longest text of a panic in the log, characters.
const MAX_PANIC_CHARACTERS: usize = 200;

/// Logs a panic as everything else is logged: where it happened, and the beginning of what it says.
fn log_panic(panic: &std::panic::PanicHookInfo<'_>) {
    let text: String = panic.payload_as_str().unwrap_or_default().chars().take(MAX_PANIC_CHARACTERS).collect();
    let place = panic.location().map(ToString::to_string).unwrap_or_default();
    tracing::error!(%place, ?text, "panic");
}

fn exporter(endpoint: &str) -> Result<SdkTracerProvider, String> {
    let exporter = opentelemetry_otlp::SpanExporter::builder()
        .with_tonic()
        .with_endpoint(endpoint)
        .build()
        .map_err(|error| format!("telemetry.otlp_endpoint: {error}"))?;
    let resource = opentelemetry_sdk::Resource::builder()
        .with_service_name("feedwave")
        .with_attribute(opentelemetry::KeyValue::new("service.version", VERSION))
        .build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build())
}
