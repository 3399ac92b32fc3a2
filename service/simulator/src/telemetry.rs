//! Columns of a batch on their path to the monitor, and the faults applied to them.

use std::f64::consts::PI;

use feedwave_monitoring::{Batch, Pair};

/// Faults that hold at one sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Faulty {
    /// Tool and work pair.
    pub lost: [bool; 2],
    pub not_a_number: [bool; 2],
    pub stuck: [bool; 2],
    pub clock_offset_ns: i64,
    pub duplicate: bool,
    pub swap: bool,
    pub lose_batch: bool,
    pub silence: bool,
}

/// One sample as it is sent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reading {
    pub time_ns: u64,
    /// Tool and work pair.
    pub pairs: [[f64; 2]; 2],
    pub commanded: [f64; 2],
    /// Commanded velocity, mm/s.
    pub velocity: [f64; 2],
    pub angle_rad: f64,
    pub rev_per_min: f64,
    pub contact: bool,
    pub line: u32,
}

/// Which optional columns the machine has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Has {
    pub pairs: [bool; 2],
    pub commanded: bool,
}

#[derive(Debug, Clone)]
struct Columns {
    sequence: u64,
    time_ns: Vec<u64>,
    pairs: [[Vec<f64>; 2]; 2],
    commanded: [Vec<f64>; 2],
    velocity: [Vec<f64>; 2],
    angle_deg: Vec<f64>,
    rev_per_min: Vec<f64>,
    contact: Vec<bool>,
    line: Vec<u32>,
    lost: [bool; 2],
    duplicate: bool,
    swap: bool,
    lose: bool,
}

impl Columns {
    fn new(capacity: usize) -> Self {
        let column = || Vec::with_capacity(capacity);
        Self {
            sequence: 0,
            time_ns: Vec::with_capacity(capacity),
            pairs: [[column(), column()], [column(), column()]],
            commanded: [column(), column()],
            velocity: [column(), column()],
            angle_deg: column(),
            rev_per_min: column(),
            contact: Vec::with_capacity(capacity),
            line: Vec::with_capacity(capacity),
            lost: [false; 2],
            duplicate: false,
            swap: false,
            lose: false,
        }
    }

    fn clear(&mut self) {
        self.time_ns.clear();
        let pairs = self.pairs.as_flattened_mut().iter_mut();
        let columns = pairs.chain(&mut self.commanded).chain(&mut self.velocity);
        columns.chain([&mut self.angle_deg, &mut self.rev_per_min]).for_each(Vec::clear);
        self.contact.clear();
        self.line.clear();
        self.lost = [false; 2];
        (self.duplicate, self.swap, self.lose) = (false, false, false);
    }

    fn push(&mut self, reading: &Reading, faulty: &Faulty) {
        self.time_ns.push(reading.time_ns);
        let values = reading.pairs.as_flattened().iter().chain(&reading.commanded).chain(&reading.velocity);
        let columns = self.pairs.as_flattened_mut().iter_mut().chain(&mut self.commanded).chain(&mut self.velocity);
        columns.zip(values).for_each(|(column, &value)| column.push(value));
        self.angle_deg.push(reading.angle_rad * (180.0 / PI));
        self.rev_per_min.push(reading.rev_per_min);
        self.contact.push(reading.contact);
        self.line.push(reading.line);
        for (lost, now) in self.lost.iter_mut().zip(faulty.lost) {
            *lost |= now;
        }
        self.duplicate |= faulty.duplicate;
        self.swap |= faulty.swap;
        self.lose |= faulty.lose_batch;
    }

    fn batch(&self, has: Has) -> Batch<'_> {
        let pair = |which: usize| {
            let [x, y] = &self.pairs[which];
            (has.pairs[which] && !self.lost[which]).then_some(Pair { x, y })
        };
        Batch {
            sequence: self.sequence,
            time_ns: &self.time_ns,
            tool: pair(0),
            work: pair(1),
            commanded: has.commanded.then_some(Pair { x: &self.commanded[0], y: &self.commanded[1] }),
            velocity_mm_per_s: Some(Pair { x: &self.velocity[0], y: &self.velocity[1] }),
            spindle_angle_deg: Some(&self.angle_deg),
            spindle_rev_per_min: Some(&self.rev_per_min),
            contact: Some(&self.contact),
            line: Some(&self.line),
        }
    }
}

/// Fills batches and sends them.
#[derive(Debug, Clone)]
pub(crate) struct Telemetry {
    has: Has,
    capacity: usize,
    filling: Columns,
    /// A batch that waits until the next one was sent, while `holding`.
    held: Columns,
    holding: bool,
}

impl Telemetry {
    pub fn new(capacity: usize, has: Has) -> Self {
        Self { has, capacity, filling: Columns::new(capacity), held: Columns::new(capacity), holding: false }
    }

    #[inline]
    pub fn record(&mut self, reading: &Reading, faulty: &Faulty, sink: &mut dyn FnMut(&Batch<'_>)) {
        if faulty.silence {
            self.send(sink);
            return;
        }
        self.filling.push(reading, faulty);
        if self.filling.time_ns.len() >= self.capacity {
            self.send(sink);
        }
    }

    /// Sends what is being filled.
    fn send(&mut self, sink: &mut dyn FnMut(&Batch<'_>)) {
        if self.filling.time_ns.is_empty() {
            return;
        }
        let next = self.filling.sequence + 1;
        if self.filling.swap && !self.holding {
            std::mem::swap(&mut self.filling, &mut self.held);
            self.holding = true;
        } else {
            if !self.filling.lose {
                sink(&self.filling.batch(self.has));
                if self.filling.duplicate {
                    sink(&self.filling.batch(self.has));
                }
            }
            self.send_held(sink);
        }
        self.filling.clear();
        self.filling.sequence = next;
    }

    fn send_held(&mut self, sink: &mut dyn FnMut(&Batch<'_>)) {
        if std::mem::take(&mut self.holding) {
            sink(&self.held.batch(self.has));
        }
    }

    /// Sends all that is left.
    pub fn flush(&mut self, sink: &mut dyn FnMut(&Batch<'_>)) {
        self.send(sink);
        self.send_held(sink);
    }
}
