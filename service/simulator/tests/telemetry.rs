//! Same seed same bits however the setpoints are cut; every fault shows in the batches; nothing is allocated or believed.

mod common;

use common::{Log, Path, everywhere, follow, machine};
use feedwave_monitoring::Quantity;
use feedwave_simulator::{
    Chatter, Contact, Description, Fault, FaultKind, Material, Mounting, Process, Ripple, SensorPair, SetpointError,
    Setpoints, Simulator, Sway, Where,
};
use proptest::prelude::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    /// Allocations of this thread: the test harness has threads of its own.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator; counting touches only a constant-initialised cell.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SOME: Where = Where::Time { from_s: 0.1, to_s: 0.2 };

/// Everything switched on.
fn busy(seed: u64) -> Description {
    Description {
        seed,
        process: Process::Milling { entry_deg: 0.5_f64.to_degrees(), exit_deg: 180.0 },
        material: Material { edge_radial_n_per_mm: 3.0, radial_speed_exponent: 0.2, ..Material::default() },
        regenerative: true,
        contacts: vec![Contact { at: Where::Path { from_mm: 0.05, to_mm: 0.9 }, depth_mm: 0.8 }],
        ripple: Ripple { fraction: 0.01, frequency_hz: 3.0 },
        sway: Some(Sway { amplitude_mm: 0.001, frequency_hz: 30.0 }),
        chatter: vec![Chatter {
            at: SOME,
            frequency_hz: 777.0,
            amplitude_mm: 0.002,
            direction_deg: 0.3_f64.to_degrees(),
        }],
        sample_rate_hz: 10_001,
        batch_samples: 97,
        drop_rate: 0.01,
        tool_sensors: Some(SensorPair { outlier_rate: 0.01, outlier_size: 0.3, ..SensorPair::default() }),
        work_sensors: Some(SensorPair { quantity: Quantity::Acceleration, noise: 5.0, ..SensorPair::default() }),
        faults: [FaultKind::DuplicateBatches, FaultKind::SwappedBatches, FaultKind::Stuck(Mounting::Work)]
            .map(|kind| Fault { at: SOME, kind })
            .to_vec(),
        ..Description::default()
    }
}

fn path() -> Path {
    let mut path = Path::default();
    path.add(60, 300.0, 3000.0, [0.6, 0.8]).add(240, 200.0, 2500.0, [0.0, -1.0]);
    path
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn any_split_gives_the_same_bits(seed in any::<u64>(), cuts in prop::collection::vec(0usize..300, 0..40)) {
        let path = path();
        let whole = follow(busy(seed), &path);
        let mut machine = machine(busy(seed));
        let mut log = Log::default();
        let mut cuts = cuts;
        cuts.extend([0, path.path.len()]);
        cuts.sort_unstable();
        for part in cuts.windows(2) {
            machine.push(&path.block(part[0], part[1]), &mut |batch| log.take(batch)).unwrap();
        }
        machine.flush(&mut |batch| log.take(batch));
        prop_assert_eq!(log.bits(), whole.bits());
    }

    #[test]
    fn any_possible_description_gives_finite_readings(
        seed in any::<u64>(),
        edges in 1u32..9,
        depth in 0.0..100.0f64,
        feed in 0.0..20_000.0f64,
        rev_per_min in -30_000.0..30_000.0f64,
        damping in 1e-4..0.7f64,
        frequency in 1.0..20_000.0f64,
    ) {
        let mut description = busy(seed);
        description.contacts = everywhere(depth);
        description.tool.edge_count = edges;
        (description.tool.mode_x.damping_ratio, description.tool.mode_y.frequency_hz) = (damping, frequency);
        let mut path = Path::default();
        path.add(100, feed, rev_per_min, [1.0, 0.0]);
        let log = follow(description, &path);
        prop_assert!(log.tool.iter().chain(&log.work).flatten().all(|value| value.is_finite()));
    }
}

#[test]
fn another_seed_is_other_noise_and_more_outliers_leave_the_noise_alone() {
    let path = path();
    assert_ne!(follow(busy(1), &path).bits(), follow(busy(2), &path).bits());
    let mut more = busy(1);
    more.tool_sensors = more.tool_sensors.map(|pair| SensorPair { outlier_rate: 0.02, ..pair });
    let (few, many) = (follow(busy(1), &path), follow(more, &path));
    let different = few.tool[0].iter().zip(&many.tool[0]).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert!(different > 0 && different < 150, "{different}");
    // The bits of this seed, on every platform and for good.
    let sum = few.bits().iter().fold(0u64, |sum, &bits| sum.rotate_left(5) ^ bits.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    assert_eq!(sum, GOLDEN, "{sum:#x}");
}

const GOLDEN: u64 = 0xffea_0e34_9490_0f00;

/// The plain run with one fault from 100 ms to 200 ms; batches of 10 ms.
fn with_fault(kind: FaultKind) -> (Log, Vec<(u64, bool, bool)>) {
    let description = Description {
        contacts: everywhere(0.5),
        work_sensors: Some(SensorPair::default()),
        faults: vec![Fault { at: SOME, kind }],
        ..Description::default()
    };
    let mut machine = machine(description);
    let (mut log, mut batches) = (Log::default(), Vec::new());
    machine
        .push(&path().all(), &mut |batch| {
            log.take(batch);
            batches.push((batch.sequence, batch.tool.is_some(), batch.work.is_some()));
        })
        .unwrap();
    (log, batches)
}

#[test]
fn every_fault_shows_where_it_is_and_nowhere_else() {
    let sequences = |batches: &[(u64, bool, bool)]| batches.iter().map(|batch| batch.0).collect::<Vec<_>>();
    let all: Vec<u64> = (0..29).collect();
    let (plain, batches) = with_fault(FaultKind::ClockJump(0));
    assert_eq!(sequences(&batches), all);
    let (_, batches) = with_fault(FaultKind::SensorLost(Mounting::Work));
    assert!(batches.iter().all(|&(sequence, tool, work)| tool && work != (10..20).contains(&sequence)));
    let (log, _) = with_fault(FaultKind::NotANumber(Mounting::Tool));
    for (at, value) in log.tool[1].iter().enumerate() {
        assert_eq!(value.is_nan(), (2000..4000).contains(&at));
    }
    assert_eq!(log.tool[0][..2000], plain.tool[0][..2000]);
    assert_eq!(log.tool[0][4000..], plain.tool[0][4000..], "the noise goes on underneath");
    let (log, _) = with_fault(FaultKind::Stuck(Mounting::Work));
    assert!(log.work[0][1999..4000].windows(2).all(|pair| pair[0] == pair[1]));
    assert!(log.work[0][3999] != log.work[0][4000] && log.tool[0] == plain.tool[0]);
    let (log, _) = with_fault(FaultKind::ClockJump(-5_000_000));
    assert_eq!((log.time_ns[1999], log.time_ns[2000], log.time_ns[4000]), (99_950_000, 95_000_000, 200_000_000));
    let (_, batches) = with_fault(FaultKind::DuplicateBatches);
    assert_eq!(sequences(&batches)[9..14], [9, 10, 10, 11, 11]);
    let (_, batches) = with_fault(FaultKind::SwappedBatches);
    assert_eq!(sequences(&batches)[9..14], [9, 11, 10, 13, 12]);
    let (_, batches) = with_fault(FaultKind::LostBatches);
    assert_eq!(sequences(&batches)[9..12], [9, 20, 21]);
    let (log, batches) = with_fault(FaultKind::Silence);
    assert_eq!(sequences(&batches), (0..19).collect::<Vec<_>>(), "what is silent is not counted");
    assert_eq!((log.time_ns[1999], log.time_ns[2000]), (99_950_000, 200_000_000));
}

#[test]
fn idling_turns_the_spindle_and_the_program_starts_afterwards() {
    let mut machine = machine(Description { contacts: everywhere(1.0), ..Description::default() });
    let mut log = Log::default();
    machine.idle(0.25, 600.0, &mut |batch| log.take(batch)).unwrap();
    assert_eq!(machine.clock_ns(), 250_000_000);
    machine.push(&path().block(0, 100), &mut |batch| log.take(batch)).unwrap();
    machine.flush(&mut |batch| log.take(batch));
    assert_eq!((machine.next_index(), machine.clock_ns()), (Some(100), 349_000_000));
    assert!(!log.contact[..5000].iter().any(|&contact| contact) && log.contact[5000..].iter().all(|&contact| contact));
    assert!((log.spindle_angle_deg[4999] - 360.0 * 2.5 * 4999.0 / 5000.0).abs() < 1e-9);
    assert_eq!(log.spindle_angle_deg[5000], 0.0, "the setpoints' angle counts from the program's start");
    assert!((log.rev_per_min[100] - 600.0).abs() < 1e-9 && (log.rev_per_min[5100] - 3000.0).abs() < 1e-9);
    assert!(machine.take_peak_deflection_mm() > 1e-4 && machine.take_peak_deflection_mm() == 0.0);
    machine.set_spindle_override(0.5).unwrap();
    let from = log.rev_per_min.len();
    machine.push(&path().block(100, 200), &mut |batch| log.take(batch)).unwrap();
    assert!((log.rev_per_min[from + 100] - 1250.0).abs() < 1e-9);
}

#[test]
fn samples_allocate_nothing() {
    let path = path();
    let mut machine = machine(busy(3));
    let mut samples = 0;
    let before = ALLOCATIONS.with(Cell::get);
    machine.idle(0.1, 3000.0, &mut |batch| samples += batch.time_ns.len()).unwrap();
    machine.push(&path.all(), &mut |batch| samples += batch.time_ns.len()).unwrap();
    machine.flush(&mut |batch| samples += batch.time_ns.len());
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
    assert!(samples > 3900);
}

#[test]
fn setpoints_that_cannot_be_followed_change_nothing() {
    let path = path();
    let mut machine = machine(Description::default());
    machine.push(&path.block(0, 100), &mut |_| {}).unwrap();
    let mut refuse = |setpoints: Setpoints<'_>| machine.push(&setpoints, &mut |_| panic!("moved")).unwrap_err();
    assert_eq!(refuse(path.block(101, 120)), SetpointError::Index { found: 101, expected: 100 });
    let good = path.block(100, 110);
    assert_eq!(
        refuse(Setpoints { feed_mm_per_min: &path.feed[100..109], ..good }),
        SetpointError::ColumnLength { column: "feed_mm_per_min", length: 9, setpoints: 10 }
    );
    assert!(matches!(
        refuse(Setpoints { line: &path.line[..1], ..good }),
        SetpointError::ColumnLength { column: "line", .. }
    ));
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let mut feed = path.feed[100..110].to_vec();
        feed[3] = bad;
        assert!(matches!(
            refuse(Setpoints { feed_mm_per_min: &feed, ..good }),
            SetpointError::Value { index: 103, column: "feed_mm_per_min", .. }
        ));
    }
    let mut angle = path.angle_deg[100..110].to_vec();
    angle[5] += 1e5;
    assert!(matches!(refuse(Setpoints { spindle_angle_deg: &angle, ..good }), SetpointError::Spindle(_)));
    assert_eq!(machine.next_index(), Some(100));
    assert!(machine.idle(f64::NAN, 100.0, &mut |_| {}).is_err() && machine.idle(1.0, 1e7, &mut |_| {}).is_err());
    assert!(machine.set_spindle_override(-0.1).is_err() && machine.set_spindle_override(f64::NAN).is_err());
    machine.push(&good, &mut |_| {}).unwrap();
}

#[test]
fn impossible_descriptions_are_refused_field_by_field() {
    let fields = |change: fn(&mut Description)| {
        let mut description = busy(0);
        change(&mut description);
        let violations = Simulator::new(description).err().unwrap_or_default();
        violations.into_iter().map(|violation| violation.field).collect::<Vec<_>>()
    };
    assert_eq!(fields(|_| {}), Vec::<String>::new());
    assert_eq!(fields(|d| d.sample_rate_hz = 100_001), ["sample_rate_hz"]);
    assert_eq!(fields(|d| d.interpolation_period_us = 0), ["interpolation_period_us"]);
    assert_eq!(fields(|d| d.tool.edge_count = 0), ["tool.edge_count"]);
    assert_eq!(fields(|d| d.tool.mode_x.damping_ratio = 0.0), ["tool.mode_x.damping_ratio"]);
    assert_eq!(fields(|d| d.tool.mode_y.stiffness_n_per_mm = f64::NAN), ["tool.mode_y.stiffness_n_per_mm"]);
    assert_eq!(fields(|d| d.process = Process::Milling { entry_deg: 120.0, exit_deg: 60.0 }), ["process.exit_deg"]);
    assert_eq!(fields(|d| d.ripple.frequency_hz = 0.0), ["ripple.frequency_hz"]);
    assert_eq!(fields(|d| (d.tool_sensors, d.work_sensors) = (None, None)), ["tool_sensors"]);
    assert_eq!(fields(|d| d.contacts[0].depth_mm = -1.0), ["contacts[0].depth_mm"]);
    assert_eq!(fields(|d| d.faults[1].at = Where::Lines { first: 3, last: 2 }), ["faults[1].at"]);
    assert_eq!(fields(|d| d.chatter = vec![d.chatter[0]; 257]), ["chatter"]);
    assert_eq!(fields(|d| d.drop_rate = 1.5), ["drop_rate"]);
}
