//! How fast the computer is while it measures.
//!
//! A virtual machine that shares its host may be slowed for some ten milliseconds at a time, all of it alike. What is late
//! then says nothing of the service. Work of a fixed length tells: it takes longer only where the processor is slower, for
//! the quickest of several tries in a row is not one that had to share it.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::machine::Latency;

/// Threads that look: the two cores of the bar.
const THREADS: usize = 2;
/// Time between two looks.
const PACE: Duration = Duration::from_millis(2);
/// Tries of a look, of which the quickest counts.
const TRIES: usize = 4;
/// Steps of a try: some 20 µs.
const STEPS: u64 = 20_000;
/// Slower than usual by this factor is slowed.
const SLOWED: f64 = 2.0;
/// What came up meanwhile is caught up with by then.
const CATCHING_UP: Duration = Duration::from_millis(50);

/// A look: when it began, and how long its quickest try took.
type Look = (Instant, Duration);

/// Looks at the computer's speed until it is asked for what it saw.
pub struct Watch {
    threads: Vec<JoinHandle<Vec<Look>>>,
    is_over: Arc<AtomicBool>,
}

impl Watch {
    pub fn start() -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let threads = (0..THREADS).map(|_| {
            let is_over = is_over.clone();
            std::thread::spawn(move || looks(&is_over))
        });
        Self { threads: threads.collect(), is_over }
    }

    /// The latencies of decisions that the computer did its usual speed for, in their order.
    pub fn undisturbed(self, latencies: &[Latency]) -> Vec<Latency> {
        self.is_over.store(true, Ordering::Relaxed);
        let slowed: Vec<_> =
            self.threads.into_iter().flat_map(|thread| slowed(&thread.join().expect("looks"))).collect();
        let is_undisturbed = |latency: &&Latency| {
            slowed.iter().all(|(from, to)| latency.received < *from || latency.sent > *to + CATCHING_UP)
        };
        latencies.iter().filter(is_undisturbed).copied().collect()
    }
}

fn looks(is_over: &AtomicBool) -> Vec<Look> {
    let mut looks = Vec::new();
    while !is_over.load(Ordering::Relaxed) {
        let begun = Instant::now();
        let quickest = (0..TRIES).map(|_| {
            let begun = Instant::now();
            let work =
                (0..STEPS).fold(1_u64, |value, step| black_box(value.wrapping_mul(6_364_136_223_846_793_005) ^ step));
            black_box(work);
            begun.elapsed()
        });
        looks.push((begun, quickest.min().expect("tries")));
        std::thread::sleep(PACE);
    }
    looks
}

/// From when to when the computer was slowed: from the look before the first slow one to the next one that is not.
fn slowed(looks: &[Look]) -> Vec<(Instant, Instant)> {
    let mut lengths: Vec<_> = looks.iter().map(|(_, length)| *length).collect();
    lengths.sort();
    let Some(usual) = lengths.get(lengths.len() / 2) else { return Vec::new() };
    let most = usual.mul_f64(SLOWED);
    looks.windows(3).filter(|three| three[1].1 > most).map(|three| (three[0].0, three[2].0)).collect()
}
