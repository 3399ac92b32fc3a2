//! Acknowledged job creations per second, by one writer at a time and by 64 at once: what group
//! commit is worth. Program chunks read per second beside the decompression alone.

mod common;

use std::hint::black_box;

use common::new_job;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_store::{CHUNK_BYTES, ProgramId, Store, StoreSettings, StoreUri, Tenant};
use tokio::runtime::Runtime;

const JOBS: u64 = 256;

async fn create(store: Store, program_id: ProgramId, jobs: u64) {
    for _ in 0..jobs {
        store.create_job(new_job(program_id)).await.expect("creates a job");
    }
}

fn benchmarks(criterion: &mut Criterion) {
    let runtime = Runtime::new().expect("a runtime");
    let folder = tempfile::TempDir::new().expect("a temporary folder");
    let uri = StoreUri::of_file(&folder.path().join("feedwave.db")).expect("a path");
    let opened = Store::open(&uri, StoreSettings::default());
    let store = runtime.block_on(opened).expect("opens");
    let source: Vec<u8> =
        (0..CHUNK_BYTES / 16).flat_map(|line| format!("G1 X{:011}\n", line * 977).into_bytes()).collect();
    let program = runtime
        .block_on(store.put_program(Tenant::DEFAULT, source[..CHUNK_BYTES as usize - 7].to_vec().into()))
        .expect("puts")
        .id;

    let mut group = criterion.benchmark_group("acknowledged job creations");
    group.sample_size(10).throughput(Throughput::Elements(JOBS));
    for writers in [1, 64] {
        group.bench_function(format!("{writers} at once"), |bencher| {
            bencher.iter(|| {
                runtime.block_on(async {
                    let mut tasks = tokio::task::JoinSet::new();
                    for _ in 0..writers {
                        tasks.spawn(create(store.clone(), program, JOBS / writers));
                    }
                    tasks.join_all().await;
                });
            });
        });
    }
    group.finish();

    let mut group = criterion.benchmark_group("program chunk");
    group.throughput(Throughput::Bytes(CHUNK_BYTES));
    group.bench_function("read from the store", |bencher| {
        bencher.iter(|| runtime.block_on(store.program_chunk(program, 0)).expect("reads"));
    });
    let packed = zstd::bulk::compress(&source, 3).expect("compresses");
    group.bench_function("decompressed only", |bencher| {
        bencher.iter(|| zstd::bulk::decompress(black_box(&packed), source.len()).expect("restores"));
    });
    group.finish();
    runtime.block_on(store.close());
}

criterion_group!(benches, benchmarks);
criterion_main!(benches);
