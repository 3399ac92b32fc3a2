//! Throughput of lexing and interpreting, in bytes of program per second, on generated programs of the kind CAM
//! posts write. Bar: 100 MB/s on one core. The crate `gcode` reads the same bytes in the same run; note that it only
//! parses (to `f32`, without modal state, arcs or checks), so that the comparison favours it.

use std::fmt::Write as _;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use feedwave_program::lexer::{Lexer, TokenKind};
use feedwave_program::{FindingLog, Interpreter, LanguageSettings, LineOutcome, Operation};
use gcode::core::{BlockVisitor, ControlFlow, Diagnostics, HasDiagnostics, Noop, ProgramVisitor, Span, Value};

/// Size of the generated programs: beyond the caches, short enough for many samples.
const PROGRAM_BYTES: usize = 8 << 20;

/// Operations kept before they are handed on, as the pipeline does.
const BATCH: usize = 256;

/// A finishing pass over a free-form surface: short lines, most words modal.
fn mill_program() -> String {
    let mut program = String::from("%\nO1000 (FINISH)\nN10 G0 G17 G21 G40 G49 G80 G90\nN20 T5 M6\nN30 S12000 M3\n");
    program.push_str("N40 G0 G54 X0. Y0. M8\nN50 Z5.\nN60 G1 Z0. F500.\n");
    let mut number = 70u64;
    while program.len() < PROGRAM_BYTES {
        let step = number / 10;
        // Thousandths of a millimetre, moving slowly as along a surface.
        let x = (step * 137) % 200_000;
        let y = (step / 1_400) * 250;
        let z = 4_000 + (step * step / 7) % 900;
        let _ = write!(program, "N{number} X{}.{:03}", x / 1_000, x % 1_000);
        if step.is_multiple_of(1_400) {
            let _ = write!(program, " Y{}.{:03}", y / 1_000, y % 1_000);
        }
        let _ = writeln!(program, " Z-{}.{:03}", z / 1_000, z % 1_000);
        number += 10;
    }
    program.push_str("M5\nM9\nM30\n%\n");
    program
}

/// Roughing and finishing passes on a lathe: lines and arcs, feeds in most blocks, vibrating sections.
fn lathe_program() -> String {
    let mut program = String::from("%\nO2000 (TURN)\nN10 G21 G18 G40 G99\nN20 T0101\nN30 G50 S2500\n");
    program.push_str("N40 G96 S180 M3\nN50 M8\n");
    let mut number = 60u64;
    while program.len() < PROGRAM_BYTES {
        let depth = number % 97;
        let (x, small) = (60 + depth / 10, depth % 10);
        let _ = write!(
            program,
            "N{number} G0 X{x}.{small} Z2.\nN{} G200 F50 A0.03\nN{} G1 Z-20.{small}05 F.15\n",
            number + 1,
            number + 2
        );
        let _ = write!(
            program,
            "N{} G2 X{}.{small} Z-25.{small}05 R5.\nN{} G3 X{}.{small} Z-30.{small}05 I0. K-5.\n",
            number + 3,
            x + 10,
            number + 4,
            x + 20
        );
        let _ = write!(program, "N{} G201\nN{} G1 U2. W1. F.3\n", number + 5, number + 6);
        number += 10;
    }
    program.push_str("N1 M5\nM9\nM30\n%\n");
    program
}

/// A pocket in rows by Macro B: conditions, assignments, expressions in words.
fn macro_program(rounds: u32) -> String {
    format!(
        "G21 G90 G17 G94\nS8000 M3\nG0 X0 Y0 Z5.\n#1=0\nG1 Z-1. F200\nWHILE[#1LT{rounds}]DO1\n#1=#1+1\n#2=[#1MOD50]*0.5\n\
         IF[#2GT20]THEN#2=20\nG1X[10+8*COS[#1]]Y[#2+SIN[#1]]F[400+#2]\nEND1\nG0 Z5.\nM30\n"
    )
}

/// The same by O-words.
fn o_word_program(rounds: u32) -> String {
    format!(
        "G21 G90 G17 G94\nS8000 M3\nG0 X0 Y0 Z5\n#1=0\nG1 Z-1 F200\no1 while [#1 LT {rounds}]\n#1=[#1+1]\n\
         #<row>=[[#1 MOD 50]*0.5]\no2 if [#<row> GT 20]\n#<row>=20\no2 endif\nG1 X[10+8*COS[#1]] Y[#<row>+SIN[#1]] F[400+#<row>]\n\
         o1 endwhile\nG0 Z5\nM2\n"
    )
}

fn interpret(program: &[u8], settings: &LanguageSettings, operations: &mut Vec<Operation>) -> (usize, FindingLog) {
    let mut interpreter = Interpreter::new(settings.clone());
    let mut findings = FindingLog::default();
    let mut count = 0;
    let mut rest = program;
    loop {
        let outcome = interpreter.read_line(rest, true, operations, &mut findings);
        if operations.len() >= BATCH || outcome == LineOutcome::Ended {
            count += black_box(&*operations).len();
            operations.clear();
        }
        match outcome {
            LineOutcome::Consumed(length) => rest = &rest[length..],
            LineOutcome::Elsewhere => rest = &program[interpreter.place().offset as usize..],
            LineOutcome::NeedMore | LineOutcome::Ended => return (count, findings),
        }
    }
}

/// The same for a program that jumps: the next line is where the interpreter says.
fn execute(program: &[u8], settings: &LanguageSettings, operations: &mut Vec<Operation>) -> (usize, FindingLog) {
    let mut interpreter = Interpreter::new(settings.clone());
    let mut findings = FindingLog::default();
    let mut count = 0;
    loop {
        let rest = &program[interpreter.place().offset as usize..];
        let outcome = interpreter.read_line(rest, true, operations, &mut findings);
        if operations.len() >= BATCH || outcome == LineOutcome::Ended {
            count += black_box(&*operations).len();
            operations.clear();
        }
        if outcome == LineOutcome::Ended {
            return (count, findings);
        }
    }
}

/// Programs that compute: blocks executed per second. Bar: one million on one core.
fn computing(criterion: &mut Criterion) {
    const ROUNDS: u32 = 20_000;
    // Blocks of a round, of which the body of the O-words' condition is executed in one of five.
    let programs = [
        ("macro_b", macro_program(ROUNDS), 6, LanguageSettings::mill()),
        ("o_words", o_word_program(ROUNDS), 7, LanguageSettings::linuxcnc()),
    ];
    let mut group = criterion.benchmark_group("computing");
    for (name, program, blocks, settings) in &programs {
        let mut operations = Vec::with_capacity(2 * BATCH);
        let (count, findings) = execute(program.as_bytes(), settings, &mut operations);
        assert!(!findings.has_errors() && count as u32 > ROUNDS, "{count}, {:?}", findings.findings().first());
        group.throughput(Throughput::Elements(u64::from(ROUNDS * blocks))).sample_size(20);
        group.bench_function(*name, |bencher| {
            bencher.iter(|| execute(black_box(program.as_bytes()), settings, &mut operations).0);
        });
    }
    group.finish();
}

/// The lexer alone: the sum of all numbers, so that none is optimised away.
fn lex(program: &[u8]) -> f64 {
    let tokens = program.split(|&byte| byte == b'\n').flat_map(Lexer::new);
    tokens.map(|token| if token.kind == TokenKind::Word { token.number.value() } else { 0.0 }).sum()
}

/// The peer's zero-allocation interface, summing the numbers as [`lex`] does.
#[derive(Default)]
struct Sum(f64);

impl Diagnostics for Sum {}

struct SumBlock<'a>(&'a mut Sum);

impl HasDiagnostics for SumBlock<'_> {
    fn diagnostics(&mut self) -> &mut dyn Diagnostics {
        self.0
    }
}

impl ProgramVisitor for Sum {
    fn start_block(&mut self) -> ControlFlow<impl BlockVisitor + '_> {
        ControlFlow::Continue(SumBlock(self))
    }
}

impl BlockVisitor for SumBlock<'_> {
    fn word_address(&mut self, _letter: char, value: Value<'_>, _span: Span) {
        if let Value::Literal(number) = value {
            self.0.0 += f64::from(number);
        }
    }

    fn start_general_code(
        &mut self,
        _number: gcode::core::Number,
    ) -> ControlFlow<impl gcode::core::CommandVisitor + '_> {
        ControlFlow::Continue(Noop)
    }
}

fn benchmark(criterion: &mut Criterion) {
    let programs =
        [("mill", mill_program(), LanguageSettings::mill()), ("lathe", lathe_program(), LanguageSettings::default())];
    for (name, program, settings) in &programs {
        let mut operations = Vec::with_capacity(2 * BATCH);
        let (count, findings) = interpret(program.as_bytes(), settings, &mut operations);
        assert!(!findings.has_errors(), "{:?}", findings.findings().first());
        assert!(count > program.lines().count() / 2, "{count} operations");

        let mut group = criterion.benchmark_group(*name);
        group.throughput(Throughput::Bytes(program.len() as u64)).sample_size(20);
        group.bench_function("interpret", |bencher| {
            bencher.iter(|| interpret(black_box(program.as_bytes()), settings, &mut operations).0);
        });
        group.bench_function("lex", |bencher| bencher.iter(|| lex(black_box(program.as_bytes()))));
        group.bench_function("gcode_visitor", |bencher| {
            bencher.iter(|| {
                let mut sum = Sum::default();
                gcode::core::parse(black_box(program), &mut sum);
                sum.0
            });
        });
        group.bench_function("gcode_tree", |bencher| bencher.iter(|| gcode::parse(black_box(program)).is_ok()));
        group.finish();
    }
}

criterion_group!(benches, benchmark, computing);
criterion_main!(benches);
