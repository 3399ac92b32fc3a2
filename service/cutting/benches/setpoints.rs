//! Setpoints per second and core of the whole pipeline for three axes, beside a plain loop that computes one sine
//! a setpoint and copies it into three columns; and validation of a program of short blocks.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use feedwave_cutting::{BLOCK_LENGTH, GenerationMode, MachineProfile, Pipeline, PipelineConfig, Step, Validation};

/// Blocks drawn per iteration.
const BLOCKS: usize = 256;

/// A pipeline in the middle of the program's long block.
fn running(program: &str, profile: MachineProfile, mode: GenerationMode) -> Pipeline {
    let config = PipelineConfig { generation_mode: mode, ..PipelineConfig::new(profile) };
    let mut pipeline = Pipeline::new(Arc::new(config));
    pipeline.push(program.as_bytes());
    pipeline.finish_input();
    let mut block = pipeline.new_block();
    for _ in 0..16 {
        assert_eq!(pipeline.next_block(&mut block), Step::Block);
    }
    pipeline
}

fn interpolation(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("setpoints");
    group.throughput(Throughput::Elements((BLOCKS * BLOCK_LENGTH) as u64));

    group.bench_function("plain sin and copy", |bencher| {
        let mut columns = vec![vec![0.0_f64; BLOCK_LENGTH]; 3];
        bencher.iter(|| {
            for block in 0..BLOCKS {
                let [first, rest @ ..] = columns.as_mut_slice() else { return };
                for (k, value) in first.iter_mut().enumerate() {
                    *value = (0.01 * (block * BLOCK_LENGTH + k) as f64).sin();
                }
                for column in rest {
                    column.copy_from_slice(first);
                }
                black_box(&mut columns);
            }
        });
    });

    let line = "G21 G90 G1 X1000 Y2000 Z-500 F10\nM30\n";
    let vibrating_line = "G21 G90 M3 S1000\nG200 F41.667 A0.03\nG1 X1000 Y2000 Z-500 F10\nG201\nM30\n";
    let arc = "G21 G90 G17 G2 X0 Y0 I500 J0 Z-300 F10\nM30\n";
    let vibrating_arc = "G21 G90 M3 S1000\nG200 F41.667 A0.03\nG2 X0 Y0 I500 J0 Z-300 F10\nG201\nM30\n";
    let cases = [
        ("line", line, GenerationMode::AlongPath),
        ("line, vibrating along the path", vibrating_line, GenerationMode::AlongPath),
        ("arc", arc, GenerationMode::AlongPath),
        ("arc, vibrating along the path", vibrating_arc, GenerationMode::AlongPath),
        ("line, vibrating tangentially", vibrating_line, GenerationMode::Tangential),
        ("arc, vibrating tangentially", vibrating_arc, GenerationMode::Tangential),
    ];
    for (name, program, mode) in cases {
        let start = running(program, MachineProfile::mill(), mode);
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter_batched_ref(
                || (start.clone(), start.new_block()),
                |(pipeline, block)| {
                    for _ in 0..BLOCKS {
                        assert_eq!(pipeline.next_block(block), Step::Block);
                        black_box(&block);
                    }
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

/// Threading passes: X and Z over the spindle angle.
fn threads(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("setpoints of a thread");
    group.throughput(Throughput::Elements((BLOCKS * BLOCK_LENGTH) as u64));
    let plain = "G97 S60 M3\nG0 X20 Z0\nG32 Z-2000 F1.5\nM30\n";
    let vibrating = "G97 S60 M3\nG165 P3 X20.2 Q1.2\nG0 X20 Z0\nG32 Z-2000 F1.5\nG165 P0\nM30\n";
    for (name, program) in [("plain", plain), ("vibrating", vibrating)] {
        let start = running(program, MachineProfile::lathe(), GenerationMode::AlongPath);
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter_batched_ref(
                || (start.clone(), start.new_block()),
                |(pipeline, block)| {
                    for _ in 0..BLOCKS {
                        assert_eq!(pipeline.next_block(block), Step::Block);
                        black_box(&block);
                    }
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

/// A circle of 100 mm in lines of 0.1 mm, over and over.
fn short_blocks(count: u32, path_control: &str) -> String {
    let mut program = format!("G21 G90 G17 {path_control} F3000\n");
    for index in 0..count {
        let (sin, cos) = (f64::from(index) * 1e-3).sin_cos();
        program += &format!("N{index} X{:.4} Y{:.4}\n", 100.0 * cos, 100.0 * sin);
    }
    program.replacen("N0 ", "N0 G1 ", 1) + "M30\n"
}

/// From the first byte of a program to its first block of setpoints: the look-ahead has to be filled first, however
/// long the program is.
fn first_block(criterion: &mut Criterion) {
    let config = Arc::new(PipelineConfig::new(MachineProfile::mill()));
    let mut group = criterion.benchmark_group("first block of setpoints");
    for (count, path_control) in [(20_000, "G61"), (200_000, "G61"), (20_000, "G64 P0.01")] {
        let program = short_blocks(count, path_control);
        group.bench_function(format!("{count} blocks, {path_control}"), |bencher| {
            bencher.iter(|| {
                let mut pipeline = Pipeline::new(Arc::clone(&config));
                let mut block = pipeline.new_block();
                while let Step::NeedInput(place) = pipeline.next_block(&mut block) {
                    pipeline.supply(place, &program.as_bytes()[..program.len().min(place.offset as usize + (1 << 16))]);
                }
                black_box(block)
            });
        });
    }
    group.finish();
}

/// Validation reads, plans, interpolates and judges every block.
fn validation(criterion: &mut Criterion) {
    let blocks = 20_000;
    let program = short_blocks(blocks, "G61");
    let config = Arc::new(PipelineConfig::new(MachineProfile::mill()));
    let mut group = criterion.benchmark_group("validation");
    group.throughput(Throughput::Elements(u64::from(blocks)));
    group.sample_size(10);
    group.bench_function("short blocks, 0.1 mm", |bencher| {
        bencher.iter(|| {
            let mut validation = Validation::new(Arc::clone(&config));
            validation.push(program.as_bytes());
            validation.finish_input();
            while validation.step() != Step::Finished {}
            black_box(validation.finish())
        });
    });
    group.finish();
}

criterion_group!(benches, interpolation, threads, first_block, validation);
criterion_main!(benches);
