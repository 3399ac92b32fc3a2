//! Streams a generated program of any size through the service and judges the service's peak of resident memory, as
//! accounted by the operating system: `cargo bench -p feedwave --bench memory -- --bytes 1000000000`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use feedwave_tests::measure_memory;

/// Streams a generated program through the service; fails when the service was ever resident with more than the bar.
#[derive(Parser)]
struct Arguments {
    /// Size of the program, bytes.
    #[arg(long, default_value_t = 1_000_000_000)]
    bytes: u64,
    /// The bar, bytes.
    #[arg(long, default_value_t = 100_000_000)]
    bar: u64,
    /// Service to measure in place of the one that was built along.
    #[arg(long, default_value = env!("CARGO_BIN_EXE_feedwave"), hide_default_value = true)]
    service: PathBuf,
    /// Passed by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

#[tokio::main]
async fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let start = Instant::now();
    let used = measure_memory(&arguments.service, arguments.bytes).await;
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    println!("program            {:>10.1} MB", megabytes(used.program_bytes));
    println!("setpoints streamed {:>10.1} million", used.setpoints as f64 / 1e6);
    println!("first setpoints    {:>10.1} ms after the request", used.first_setpoints.as_secs_f64() * 1e3);
    println!("time in all        {:>10.1} s", start.elapsed().as_secs_f64());
    println!("peak of the service's resident memory (VmHWM):");
    println!("  idle             {:>10.1} MB", megabytes(used.idle_bytes));
    println!("  after upload     {:>10.1} MB", megabytes(used.uploaded_bytes));
    println!("  after validation {:>10.1} MB", megabytes(used.validated_bytes));
    println!("  after streaming  {:>10.1} MB, bar {:.1} MB", megabytes(used.streamed_bytes), megabytes(arguments.bar));
    if used.streamed_bytes <= arguments.bar { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
