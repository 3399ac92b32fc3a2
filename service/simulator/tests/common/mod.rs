//! A straight cut along X as setpoints, and telemetry as it came.
#![allow(dead_code, reason = "every test file uses its part")]

use feedwave_monitoring::Batch;
use feedwave_simulator::{Contact, Description, Setpoints, Simulator, Where};

/// Contact with this depth wherever the tool is.
pub fn everywhere(depth_mm: f64) -> Vec<Contact> {
    vec![Contact { at: Where::Path { from_mm: -1e9, to_mm: 1e9 }, depth_mm }]
}

pub fn machine(description: Description) -> Simulator {
    Simulator::new(description).unwrap_or_else(|violations| panic!("{violations:?}"))
}

/// Setpoints at 1 ms that grow period by period.
#[derive(Debug, Clone, Default)]
pub struct Path {
    pub axes: [Vec<f64>; 2],
    pub path: Vec<f64>,
    pub feed: Vec<f64>,
    pub angle_deg: Vec<f64>,
    pub line: Vec<u32>,
}

impl Path {
    /// Adds periods at a steady feed along a direction and a steady speed.
    pub fn add(&mut self, periods: usize, feed: f64, rev_per_min: f64, direction: [f64; 2]) -> &mut Self {
        for _ in 0..periods {
            let step = feed / 60_000.0;
            for (axis, component) in self.axes.iter_mut().zip(direction) {
                axis.push(axis.last().map_or(0.0, |last| last + step * component));
            }
            self.path.push(self.path.last().map_or(0.0, |last| last + step));
            self.feed.push(feed);
            self.angle_deg.push(self.angle_deg.last().map_or(0.0, |last| last + rev_per_min * 0.006));
            self.line.push(1);
        }
        self
    }

    pub fn block(&self, from: usize, to: usize) -> Setpoints<'_> {
        Setpoints {
            first_index: from as u64,
            axes_mm: Some([&self.axes[0][from..to], &self.axes[1][from..to]]),
            path_position_mm: &self.path[from..to],
            feed_mm_per_min: &self.feed[from..to],
            spindle_angle_deg: &self.angle_deg[from..to],
            line: &self.line[from..to],
        }
    }

    pub fn all(&self) -> Setpoints<'_> {
        self.block(0, self.path.len())
    }
}

/// Telemetry of all batches, one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Log {
    pub sequence: Vec<u64>,
    pub lengths: Vec<usize>,
    pub time_ns: Vec<u64>,
    pub tool: [Vec<f64>; 2],
    pub work: [Vec<f64>; 2],
    pub commanded: [Vec<f64>; 2],
    pub spindle_angle_deg: Vec<f64>,
    pub rev_per_min: Vec<f64>,
    pub contact: Vec<bool>,
}

impl Log {
    pub fn take(&mut self, batch: &Batch<'_>) {
        self.sequence.push(batch.sequence);
        self.lengths.push(batch.time_ns.len());
        self.time_ns.extend(batch.time_ns);
        for (to, from) in
            [(&mut self.tool, batch.tool), (&mut self.work, batch.work), (&mut self.commanded, batch.commanded)]
        {
            if let Some(pair) = from {
                to[0].extend(pair.x);
                to[1].extend(pair.y);
            }
        }
        self.spindle_angle_deg.extend(batch.spindle_angle_deg.unwrap());
        self.rev_per_min.extend(batch.spindle_rev_per_min.unwrap());
        self.contact.extend(batch.contact.unwrap());
    }

    /// Every number as its bits: equal means identical.
    pub fn bits(&self) -> Vec<u64> {
        let pairs = self.tool.iter().chain(&self.work).chain(&self.commanded);
        let columns = pairs.chain([&self.spindle_angle_deg, &self.rev_per_min]);
        let mut bits: Vec<u64> = columns.flatten().map(|value| value.to_bits()).collect();
        bits.extend(self.sequence.iter().chain(&self.time_ns));
        bits.extend(self.contact.iter().map(|&contact| u64::from(contact)));
        bits
    }
}

/// Follows the path as a whole.
pub fn follow(description: Description, path: &Path) -> Log {
    let mut machine = machine(description);
    let mut log = Log::default();
    machine.push(&path.all(), &mut |batch| log.take(batch)).unwrap();
    machine.flush(&mut |batch| log.take(batch));
    log
}
