//! The clock of the sensors, as the arrival of their time stamps shows it.
//!
//! Stamps far ahead of it, or of a time that has been before, are not believed at once: one wrong stamp would make everything behind
//! it stale. A clock that was really set shows in the next batch, too. Telemetry that is late has no time twice.

use std::time::{Duration, Instant};

use feedwave_monitoring::Event;

/// How much faster than the sensors' clock ours may run before telemetry seems to fall behind: drift of cheap clocks.
const MAX_DRIFT: f64 = 2e-4;

/// A time of the sensors, and when it was theirs.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// Time of the sensors at `since`, ns: the latest that any batch has shown, less the drift since then.
    at_ns: u64,
    since: Instant,
}

impl Shown {
    fn now_ns(&self, now: Instant) -> u64 {
        let elapsed_ns = now.saturating_duration_since(self.since).as_nanos() as f64 * (1.0 - MAX_DRIFT);
        self.at_ns.saturating_add(elapsed_ns as u64)
    }
}

/// Follows the clock of the sensors from batch to batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorClock {
    shown: Option<Shown>,
    /// The newest stamp that is believed, ns.
    newest_ns: Option<u64>,
    /// What the batch before showed, where nothing of it was believed.
    doubtful: Option<Shown>,
    /// How far ahead of the clock a stamp may be, ns: what came before may have been on its way for longer.
    tolerance_ns: u64,
    /// How far behind the one before a stamp may be wherever the clock is, ns: telemetry may come sooner than it is measured, as from a
    /// record.
    step_ns: u64,
}

impl SensorClock {
    /// A clock that shows `now_ns` at `since`, where the client has said so.
    pub(super) fn new(now_ns: Option<u64>, since: Instant, tolerance: Duration, step: Duration) -> Self {
        let [tolerance_ns, step_ns] = [tolerance, step].map(|time| time.as_nanos() as u64);
        let shown = now_ns.map(|at_ns| Shown { at_ns, since });
        Self { shown, newest_ns: None, doubtful: None, tolerance_ns, step_ns }
    }

    /// The newest stamp that is believed, ns; 0 before any.
    pub(super) fn newest_ns(&self) -> u64 {
        self.newest_ns.unwrap_or(0)
    }

    /// Takes the time stamps of a batch that comes `now`: what the monitor has to know before it judges them.
    pub(super) fn follow(&mut self, time_ns: &[u64], now: Instant) -> Option<Event> {
        let &last_ns = time_ns.last()?;
        let now_ns = self.shown.map(|shown| shown.now_ns(now));
        let has_been = self.newest_ns.is_some_and(|newest_ns| last_ns.saturating_add(self.tolerance_ns) < newest_ns);
        if let Some(newest_ns) = self.newest_of(time_ns, now_ns).filter(|_| !has_been) {
            (self.newest_ns, self.doubtful) = (Some(newest_ns), None);
            if now_ns.is_none_or(|now_ns| newest_ns > now_ns) {
                self.shown = Some(Shown { at_ns: newest_ns, since: now });
            }
            return now_ns.map(Event::Clock);
        }
        let there = Shown { at_ns: last_ns, since: now };
        let was_set = |before: Shown| before.now_ns(now).abs_diff(last_ns) <= self.tolerance_ns;
        if self.doubtful.take().is_some_and(was_set) {
            (self.shown, self.newest_ns) = (Some(there), Some(last_ns));
            return Some(Event::ClockSet(last_ns));
        }
        self.doubtful = Some(there);
        now_ns.map(Event::Clock)
    }

    /// The newest of these stamps and those before that is believed; nothing where none of these is.
    fn newest_of(&self, time_ns: &[u64], now_ns: Option<u64>) -> Option<u64> {
        let latest_ns = now_ns.map(|now_ns| now_ns.saturating_add(self.tolerance_ns));
        let mut newest_ns = self.newest_ns;
        let mut is_any = false;
        for &stamp_ns in time_ns {
            let follows =
                newest_ns.map_or(latest_ns.is_none(), |newest| stamp_ns.saturating_sub(newest) <= self.step_ns);
            if follows || latest_ns.is_some_and(|latest_ns| stamp_ns <= latest_ns) {
                newest_ns = newest_ns.max(Some(stamp_ns));
                is_any = true;
            }
        }
        newest_ns.filter(|_| is_any)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// A clock with a second of tolerance and steps of 0.1 s, and batches that come every 100 ms.
    fn clock(now_ns: Option<u64>) -> (SensorClock, impl FnMut() -> Instant) {
        let start = Instant::now();
        let mut batches = 0;
        let clock = SensorClock::new(now_ns, start, Duration::from_secs(1), Duration::from_millis(100));
        let next = move || {
            batches += 1;
            start + Duration::from_millis(100 * batches)
        };
        (clock, next)
    }

    fn told(event: Option<Event>) -> f64 {
        match event {
            Some(Event::Clock(now_ns)) => now_ns as f64 * 1e-9,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn one_stamp_ahead_is_no_other_time() {
        for now_ns in [None, Some(10 * SECOND)] {
            let (mut clock, mut next) = clock(now_ns);
            let at = |tenths: u64| 10 * SECOND + tenths * SECOND / 10;
            clock.follow(&[at(0), at(1)], next());
            assert_eq!(clock.newest_ns(), at(1));
            let event = clock.follow(&[at(2), 3_600 * SECOND], next());
            assert!((told(event) - 10.2).abs() < 0.11, "{event:?}");
            assert_eq!(clock.newest_ns(), at(2));
            let event = clock.follow(&[3_600 * SECOND], next());
            assert!(told(event) < 10.5);
            assert_eq!(clock.newest_ns(), at(2), "nothing in it is believed");
            let event = clock.follow(&[at(4), at(5)], next());
            assert!(told(event) < 10.6);
            assert_eq!(clock.newest_ns(), at(5));
        }
        // Nor is it the first time that is seen.
        let (mut clock, mut next) = clock(None);
        assert_eq!(clock.follow(&[SECOND, SECOND + SECOND / 10, 3_600 * SECOND], next()), None);
        assert_eq!(clock.newest_ns(), SECOND + SECOND / 10);
    }

    #[test]
    fn a_clock_that_was_set_is_followed() {
        let (mut clock, mut next) = clock(Some(5_000 * SECOND));
        clock.follow(&[5_000 * SECOND], next());
        let mut before_s = 5_000.0;
        for set_s in [9_000, 1_000] {
            let set_ns = set_s * SECOND;
            assert!((told(clock.follow(&[set_ns], next())) - before_s).abs() < 1.0);
            assert_eq!(clock.follow(&[set_ns + SECOND / 10], next()), Some(Event::ClockSet(set_ns + SECOND / 10)));
            let event = clock.follow(&[set_ns + SECOND / 5], next());
            before_s = set_s as f64 + 0.2;
            assert!((told(event) - before_s).abs() < 1e-3);
            assert_eq!(clock.newest_ns(), set_ns + SECOND / 5);
        }
        // Two wrong stamps that do not go together set nothing.
        for wrong_s in [9_000, 12_000, 10, 100] {
            assert!((told(clock.follow(&[wrong_s * SECOND], next())) - before_s).abs() < 1.0);
        }
    }

    #[test]
    fn telemetry_that_falls_behind_sets_no_clock() {
        let (mut clock, mut next) = clock(Some(SECOND));
        for batch in 1..100 {
            // A tenth of what is measured comes in time.
            let stamp_ns = SECOND + batch * SECOND / 100;
            assert!((told(clock.follow(&[stamp_ns], next())) - (1.0 + 0.1 * batch as f64)).abs() < 0.01);
        }
    }

    #[test]
    fn telemetry_that_comes_sooner_than_it_is_measured_is_followed() {
        let (mut clock, mut next) = clock(Some(SECOND));
        for batch in 0..100 {
            let stamps: Vec<_> = (0..20).map(|tenth| SECOND + (batch * 20 + tenth) * SECOND / 10).collect();
            clock.follow(&stamps, next());
            assert_eq!(clock.newest_ns(), stamps[19]);
        }
    }
}
