//! Between decisions nothing is allocated, and memory does not grow with the run.

mod common;

use common::{Columns, config, monitor};
use feedwave_monitoring::{SpectrumConfig, State};
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

#[test]
fn samples_into_decisions_allocate_nothing() {
    let mut config = config();
    config.spectrum = Some(SpectrumConfig {
        samples: 512,
        min_frequency_hz: 5.0,
        noise_floor: 1e-5,
        harmonic_tolerance_hz: 2.0,
        edges: 2,
    });
    let mut monitor = monitor(config);
    let mut columns = Columns::default();
    columns.add(400, [0.0; 2], false).add(10_000, [0.005, 0.0], true);
    columns.x[5000] = f64::NAN;
    let snapshot_length = |monitor: &feedwave_monitoring::Monitor| monitor.snapshot().unwrap().len();
    let fresh = snapshot_length(&monitor);
    let mut decisions = 0;
    let before = ALLOCATIONS.with(Cell::get);
    for sequence in 0..104 {
        let from = sequence as usize * 100;
        monitor.push(&columns.batch(sequence, from, from + 100), &mut |_| decisions += 1).unwrap();
    }
    // The spindle rule of this configuration holds no table; one with a table is copied into each record.
    assert_eq!(ALLOCATIONS.with(Cell::get) - before, 0);
    assert_eq!((monitor.state(), decisions), (State::Measuring, 9));
    // Numbers are encoded in as many bytes as they need, so the length varies a little, but not with the run.
    assert!(snapshot_length(&monitor) < fresh + 1000);
}
