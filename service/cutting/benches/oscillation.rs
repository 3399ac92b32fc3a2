//! Oscillated setpoints and cells of the floor per second and core, on the worked example of
//! docs/functions/tool-oscillation.md.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, Engagement, FloorArea, HeightField, LeadingEdge, NamedCondition, OscillationCondition,
    OscillationCut, OscillationPeriod, ToolGeometry, ToolOscillation, Wave, Waveform,
};
use feedwave_cutting::{BLOCK_LENGTH, MachineProfile, Pipeline, PipelineConfig, Step, Tool};

const SETPOINTS: usize = 10_000;

fn condition() -> OscillationCondition {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    OscillationCondition {
        period: OscillationPeriod::PerRevolution(1),
        feed: direction(0.4, Waveform::Sine),
        axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }),
        cross: None,
        leading_edge: LeadingEdge::default(),
        ramp_periods: 2,
        may_overrun: false,
        engagement: Engagement::Slot,
    }
}

fn waves(criterion: &mut Criterion) {
    let turns: Vec<f64> = (0..SETPOINTS).map(|index| index as f64 * 0.01).collect();
    let mut values = vec![0.0; SETPOINTS];
    let points = (0..32).map(|index| f64::from(index) / 32.0);
    let points = points.map(|phase| [phase, feedwave_cutting::sin_turns(phase)]).collect();
    let mut group = criterion.benchmark_group("tool oscillation waves");
    group.throughput(Throughput::Elements(SETPOINTS as u64));
    for (name, waveform) in [
        ("sine", Waveform::Sine),
        ("held peak", Waveform::HeldPeak { hold_share: 0.3 }),
        ("jerk-limited held peak", Waveform::JerkLimitedHeldPeak { hold_share: 0.3 }),
        ("table of 32", Waveform::Table { points }),
    ] {
        let Ok(wave) = waveform.compile() else { continue };
        let wave: Wave = wave;
        group.bench_function(name, |bencher| bencher.iter(|| wave.fill(black_box(&turns), &mut values)));
    }
    group.finish();
}

fn floor(criterion: &mut Criterion) {
    let tool = ToolGeometry::even(4, 60.0, 1.5, 5.0);
    let cut = OscillationCut {
        feed_mm_per_min: 600.0,
        spindle_rev_per_min: 600.0,
        clockwise: true,
        depth_mm: 1.0,
        engagement_deg: [-90.0, 90.0],
        incline_deg: 0.0,
    };
    let Some(oscillation) = ToolOscillation::new(&tool, &condition(), 1, 1) else { return };
    // One second of cutting: 10 mm of feed over the whole width of the tool, by the front and the trailing half.
    let area = FloorArea { length_mm: 10.0, width_mm: 120.0, across_mm: 0.0, resolution_mm: 0.01, trailing: true };
    let mut group = criterion.benchmark_group("tool oscillation floor");
    group.sample_size(10);
    group.throughput(Throughput::Elements(12_000_000));
    for (name, radial_edge_length_mm) in [("one second, 1.5 mm edges", 1.5), ("one second, 5 mm edges", 5.0)] {
        let tool = ToolGeometry { radial_edge_length_mm, ..tool.clone() };
        group.bench_function(name, |bencher| {
            bencher.iter(|| HeightField::simulate(&tool, &oscillation, black_box(&cut), &area).map(|field| field.rows));
        });
    }
    group.finish();
}

/// Oscillated setpoints of the whole pipeline, three axes, in the middle of a long block.
fn setpoints(criterion: &mut Criterion) {
    const BLOCKS: usize = 256;
    let mut group = criterion.benchmark_group("oscillated setpoints");
    group.throughput(Throughput::Elements((BLOCKS * BLOCK_LENGTH) as u64));
    for (name, path) in
        [("line", "G1 X90000 Y40000 F600"), ("arc", "G2 X0 Y0 I5000 J0 F600"), ("huge arc", "G2 X0 Y0 I50000 J0 F600")]
    {
        let mut profile = MachineProfile::mill();
        profile.tool_oscillation = vec![NamedCondition {
            name: "accuracy".to_owned(),
            number: 1,
            tools: Vec::new(),
            condition: condition(),
            tables: Vec::new(),
        }];
        let geometry = Some(ToolGeometry::even(4, 60.0, 1.5, 5.0));
        let tool = Tool { number: 4, geometry, ..Tool::default() };
        let config = PipelineConfig { tools: vec![tool], ..PipelineConfig::new(profile) };
        let mut start = Pipeline::new(Arc::new(config));
        start.push(format!("G21 G90 G17 G94 T4 M6\nM3 S600\nG202 P1 D1\n{path}\nG203\nM30\n").as_bytes());
        start.finish_input();
        let mut block = start.new_block();
        for _ in 0..16 {
            assert_eq!(start.next_block(&mut block), Step::Block);
        }
        group.bench_function(name, |bencher| {
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

criterion_group!(benches, waves, setpoints, floor);
criterion_main!(benches);
