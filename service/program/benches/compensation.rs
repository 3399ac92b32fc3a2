//! Blocks per second through the compensation of the tool radius alone, without reading: contours of lines and arcs, and a
//! contour of short lines as CAM posts write free-form pockets. Bar: one million blocks per second on one core.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use feedwave_program::{
    CompensationCommand, CompensationCorner, CompensationEntry, CompensationMode, CompensationRules, Compensator,
    FindingLog, LanguageSettings, Operation, OperationKind, Plane, SourceSpan, interpret,
};

/// Blocks of a program.
const BLOCKS: usize = 100_000;

/// Rectangles with rounded corners, one beside the other: four lines and four arcs each, entered and left.
fn rounded(program: &mut Vec<String>) {
    let mut at = 0;
    while program.len() < BLOCKS {
        let x = at % 2_000;
        at += 50;
        program.push(format!("G0 X{} Y-20", x - 10));
        program.push(format!("G1 X{x} Y0"));
        for block in [
            "Y20".to_owned(),
            format!("G2 X{} Y25 I5", x + 5),
            format!("G1 X{}", x + 25),
            format!("G2 X{} Y20 J-5", x + 30),
            "G1 Y5".to_owned(),
            format!("G2 X{} Y0 I-5", x + 25),
            format!("G1 X{}", x + 5),
            format!("G2 X{x} Y5 J5"),
            "G1 Y10".to_owned(),
        ] {
            program.push(block);
        }
        program.push(format!("G1 X{} Y12", x - 12));
    }
    program.push("G0 X0 Y-20".to_owned());
}

/// A wavy line of blocks of a tenth of a millimetre, whose bends the tool just fits into.
fn wavy(program: &mut Vec<String>) {
    program.push("G0 X-20 Y0".to_owned());
    program.push("G1 X-10".to_owned());
    while program.len() < BLOCKS {
        let along = (program.len() - 1) as f64 * 0.1;
        program.push(format!("X{:.3} Y{:.5}", along - 10.0, 4.0 - 4.0 * (along / 5.0).cos()));
    }
    program.push("Y40".to_owned());
    program.push("G0 X0 Y-20".to_owned());
}

/// The operations of a program, with the compensation switched on before every line that begins with `G1` behind a rapid, and
/// off before the move in front of the next rapid.
fn operations(blocks: &[String], rules: CompensationRules) -> Vec<Operation> {
    let settings = LanguageSettings { arc_radius_tolerance_mm: 0.01, ..LanguageSettings::linuxcnc() };
    let text = format!("G21 F1000\n{}\nM2\n", blocks.join("\n"));
    let (programmed, findings) = interpret(text.as_bytes(), settings);
    assert!(!findings.has_errors(), "{:?}", findings.findings().first());
    let is_rapid = |block: &str| block.starts_with("G0");
    let mode =
        CompensationMode { left: true, plane: Plane::Xy, tilted: false, radius_mm: 3.0, reference_mm: [0.0; 2], rules };
    let mut operations = Vec::with_capacity(programmed.len());
    for operation in programmed {
        let SourceSpan { line, .. } = operation.span;
        let before = (line as usize).checked_sub(3).and_then(|line| blocks.get(line));
        let after = blocks.get(line as usize - 1);
        let command = match (before, after) {
            _ if operation.kind == OperationKind::End => None,
            (Some(before), _) if is_rapid(before) => Some(CompensationCommand::On(mode)),
            (_, Some(after)) if is_rapid(after) => Some(CompensationCommand::Off),
            _ => None,
        };
        if let Some(command) = command {
            operations.push(Operation { span: operation.span, kind: OperationKind::Compensation(command) });
        }
        operations.push(operation);
    }
    operations
}

fn benchmark(criterion: &mut Criterion) {
    let fanuc = CompensationRules::Fanuc { entry: CompensationEntry::A, corner: CompensationCorner::Linear };
    type Write = fn(&mut Vec<String>);
    let programs: [(&str, Write, CompensationRules); 3] = [
        ("rounded linuxcnc", rounded, CompensationRules::LinuxCnc),
        ("rounded fanuc", rounded, fanuc),
        ("wavy fanuc", wavy, fanuc),
    ];
    let mut group = criterion.benchmark_group("compensation");
    for (name, write, rules) in programs {
        let mut blocks = Vec::new();
        write(&mut blocks);
        let operations = operations(&blocks, rules);
        let run = |operations: Vec<Operation>| {
            let (mut stage, mut findings) = (Compensator::default(), FindingLog::default());
            let mut out = Vec::with_capacity(256);
            let mut count = 0;
            for operation in operations {
                stage.push(operation, &mut out, &mut findings);
                if out.len() > 200 {
                    count += black_box(&out).len();
                    out.clear();
                }
            }
            (count, findings)
        };
        let (count, findings) = run(operations.clone());
        assert!(count >= BLOCKS - 1_000 && !findings.has_errors(), "{count}, {:?}", findings.findings().first());
        group.throughput(Throughput::Elements(blocks.len() as u64)).sample_size(20);
        group.bench_function(name, |bencher| {
            bencher.iter_batched(|| operations.clone(), &run, BatchSize::LargeInput);
        });
    }
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
