//! What one validation takes of memory, counted at the allocator, for programs that want much of it
//! (docs/operations.md, "Memory of a validation").

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, Engagement, LeadingEdge, NamedCondition, OscillationCondition, OscillationPeriod,
    ToolGeometry, Waveform,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, Step, Tool, Validation, ValidationReport};

/// Bytes that this thread holds, and the most that it ever held: the test harness has threads of its own.
#[derive(Clone, Copy)]
struct Held {
    now: isize,
    most: isize,
}

thread_local! {
    static HELD: Cell<Held> = const { Cell::new(Held { now: 0, most: 0 }) };
}

fn count(bytes: isize) {
    HELD.with(|held| {
        let now = held.get().now + bytes;
        held.set(Held { now, most: held.get().most.max(now) });
    });
}

struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator; counting touches only a constant-initialised cell.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size().cast_signed());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-layout.size().cast_signed());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const MIB: usize = 1 << 20;

/// The most that one validation takes (docs/operations.md): a window that brakes all along, a group of thinned blocks, and
/// everything else.
const MOST: usize = 512 * MIB;

/// What a validation took, and found.
struct Taken {
    /// Most bytes that it held at a time, the program not counted.
    most: usize,
    /// Bytes of its report.
    report: usize,
    found: ValidationReport,
}

/// Validates a program that is read in pieces, as the service does.
fn take(program: &str, config: &PipelineConfig) -> Taken {
    const PIECE: usize = 1 << 20;
    let config = Arc::new(config.clone());
    let before = HELD.with(Cell::get).now;
    HELD.with(|held| held.set(Held { now: before, most: before }));
    let mut validation = Validation::new(Arc::clone(&config));
    loop {
        match validation.step() {
            Step::Block => {}
            Step::NeedInput(place) => {
                let from = (place.offset as usize).min(program.len());
                match &program.as_bytes()[from..(from + PIECE).min(program.len())] {
                    [] => validation.finish_input(),
                    piece => validation.push(piece),
                }
            }
            Step::Finished => break,
            Step::Refused => panic!("a validation reads to the end"),
        }
    }
    let found = validation.finish();
    let Held { now, most } = HELD.with(Cell::get);
    drop(config);
    let taken = |bytes: isize| usize::try_from(bytes - before).expect("nothing from before was freed");
    Taken { most: taken(most), report: taken(now), found }
}

/// Takes at most so much, its report at most so much.
#[track_caller]
fn assert_bounded(program: &str, config: &PipelineConfig, most: usize, report: usize) -> ValidationReport {
    let taken = take(program, config);
    println!("{:.1} MB, of which the report {:.1} MB", taken.most as f64 / 1e6, taken.report as f64 / 1e6);
    assert!(taken.most <= most && most <= MOST, "{} bytes", taken.most);
    assert!(taken.report <= report, "{} bytes of report", taken.report);
    taken.found
}

fn lines(count: usize, line: impl Fn(usize) -> String) -> String {
    (0..count).map(|index| line(index) + "\n").collect()
}

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

fn has(report: &ValidationReport, code: &str) -> bool {
    report.findings.iter().any(|finding| finding.code == code)
}

#[test]
fn a_window_that_brakes_all_along_is_bounded() {
    let mut config = mill();
    config.profile.look_ahead_blocks = 100_000;
    config.interpolation_period_us = 20_000;
    let head = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG0 X0 Y0 Z5\n";
    let path = lines(300_000, |n| format!("G1 X{}.{:04} F9000", n / 10_000, n % 10_000));
    let report = assert_bounded(&format!("{head}{path}M30\n"), &config, 272 * MIB, MIB);
    assert!(report.is_accepted(), "{:?}", report.findings);
}

#[test]
fn labels_and_jumps_are_bounded() {
    let labels = lines(1_200_000, |n| format!("N{} G1", n + 2));
    let report = assert_bounded(&format!("{labels}GOTO 1500000\nM30\n"), &mill(), 72 * MIB, MIB);
    assert!(has(&report, "PRG-JUMP-TARGET"), "{:?}", report.findings);
}

#[test]
fn what_a_vibration_holds_of_its_path_is_bounded_in_bytes() {
    let lines_of_a_nanometre =
        format!("G21 G91 M3 S1000 F60.\nG200 F2. A1.0\nG1\n{}G201\nM30\n", "X0.000001\n".repeat(20_000));
    let report = assert_bounded(&lines_of_a_nanometre, &mill(), 80 * MIB, MIB);
    assert!(has(&report, "VIB-BLOCKS-TOO-SHORT"), "{:?}", report.findings);

    // Far fewer blocks, of thousands of points each.
    let curves = lines(12, |curve| {
        let point = |n: usize| {
            let x = (curve * 9_900 + n + 1) as f64 * 4e-6;
            format!("X{x:.6} Y{:.12}", 0.001 * x * x)
        };
        let points: Vec<_> = (0..9_900).map(point).collect();
        format!("G5.2 {} P1 L4\n{}\nG5.3", points[0], points[1..].join("\n"))
    });
    let program = format!("G21 G90 M3 S1000 F60.\nG200 F2. A1.0\n{curves}G201\nM30\n");
    let report = assert_bounded(&program, &mill(), 192 * MIB, MIB);
    let found = report.findings.iter().find(|finding| finding.code == "VIB-BLOCKS-TOO-SHORT");
    let found = found.unwrap_or_else(|| panic!("{:?}", report.findings));
    assert!(found.message.contains("take more than 40 MiB") && found.values[0].value < 12.0, "{found:?}");
}

#[test]
fn findings_and_texts_are_bounded() {
    let errors = lines(30_000, |n| format!("G1 X[{n} QQ@ {}", "y".repeat(200)));
    assert_bounded(&errors, &mill(), 16 * MIB, 8 * MIB);
    for endless in ["X1 ", "(", "[", "1", "#<a"] {
        let program = format!("G1 X{}", endless.repeat((8 << 20) / endless.len()));
        assert_bounded(&program, &mill(), 64 * MIB, MIB);
    }
}

#[test]
fn floors_and_reports_of_oscillations_are_bounded() {
    let direction = |amplitude_mm| DirectionOscillation { amplitude_mm, waveform: Waveform::Sine, phase_deg: 0.0 };
    let mut config = mill();
    let floor = &mut config.profile.oscillation_floor;
    (floor.max_cells, floor.resolution_mm, floor.revolutions) = (32_000_000, 0.001, 100);
    config.profile.tool_oscillation = vec![NamedCondition {
        name: "n".to_owned(),
        number: 1,
        tools: Vec::new(),
        tables: Vec::new(),
        condition: OscillationCondition {
            period: OscillationPeriod::PerRevolution(1),
            feed: direction(0.4),
            axial: direction(0.03),
            cross: None,
            leading_edge: LeadingEdge::default(),
            ramp_periods: 2,
            may_overrun: false,
            engagement: Engagement::Slot,
        },
    }];
    config.tools = vec![Tool { number: 1, geometry: Some(ToolGeometry::even(64, 60.0, 30.0, 5.0)), ..Tool::default() }];
    let cuts = lines(60, |n| format!("S{} M3\nG202 P1 D1.\nG1 X{} F{}\nG203", 300 + n, 10 * ((n + 1) % 2), 100 + n));
    let program = format!("G21 G90 G94 G17\nT1 M6\nG0 X0 Y0 Z0\n{cuts}M30\n");
    let report = assert_bounded(&program, &config, 64 * MIB, 16 * MIB);
    assert_eq!(report.summary.oscillation_count, 60);
}

#[test]
fn reports_of_sections_are_bounded() {
    let sections = lines(3_000, |n| format!("G200 F{}. A0.01\nG1 X{}.\nG201", 2 + n % 40, 1 + n % 2));
    let report = assert_bounded(&format!("G21 G90 M3 S1000 F6000.\n{sections}M30\n"), &mill(), 64 * MIB, 32 * MIB);
    assert!(report.sections.len() <= 1_000, "{}", report.sections.len());
    let speeds = lines(3_000, |n| format!("X0.0{} S{}", 1 + n % 9, 500 + n));
    let program = format!("G21 G91 M3 S1000 F60.\nG200 F20. A0.01\nG1\n{speeds}G201\nM30\n");
    assert_bounded(&program, &mill(), 64 * MIB, 32 * MIB);
}
