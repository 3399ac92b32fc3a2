//! What goes into the monitor: batches of columns, and events between them.

use crate::decision::SpindleAnswer;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest number of samples in one batch: ten seconds at 100 kHz.
pub const MAX_BATCH_SAMPLES: usize = 1_000_000;

/// Two equal sensors at 90°, same height (docs/functions/adaptive-feed.md, "Signals").
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// X channel: mm, strain, or mm/s², as configured.
    pub x: &'a [f64],
    /// Y channel, same unit.
    pub y: &'a [f64],
}

/// Columns of equal length. A column that a sensor did not deliver is `None`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Batch<'a> {
    /// Number of the batch; the sender counts up by one. Any first number is accepted.
    pub sequence: u64,
    /// Time stamps in ns on the clock of the sensors, rising.
    pub time_ns: &'a [u64],
    /// Sensors of the tool.
    pub tool: Option<Pair<'a>>,
    /// Sensors of the workpiece.
    pub work: Option<Pair<'a>>,
    /// Acceleration of the commanded motion in the sensors' axes, mm/s²; subtracted from accelerations.
    pub commanded: Option<Pair<'a>>,
    /// Velocity of the commanded motion in the sensors' axes, mm/s; says which stretches are steady cuts.
    pub velocity_mm_per_s: Option<Pair<'a>>,
    /// Spindle angle in degrees, any number of turns.
    pub spindle_angle_deg: Option<&'a [f64]>,
    /// Independently measured spindle speed in rev/min.
    pub spindle_rev_per_min: Option<&'a [f64]>,
    /// Whether tool and work touch.
    pub contact: Option<&'a [bool]>,
    /// Source line of the program that is being cut.
    pub line: Option<&'a [u32]>,
}

impl Batch<'_> {
    /// Refuses columns of different lengths and oversized batches.
    pub(crate) fn check(&self) -> Result<(), BatchError> {
        let samples = self.time_ns.len();
        if samples > MAX_BATCH_SAMPLES {
            return Err(BatchError::TooLarge { samples, limit: MAX_BATCH_SAMPLES });
        }
        let pairs = [
            (["tool.x", "tool.y"], self.tool),
            (["work.x", "work.y"], self.work),
            (["commanded.x", "commanded.y"], self.commanded),
            (["velocity.x", "velocity.y"], self.velocity_mm_per_s),
        ];
        let pairs = pairs.into_iter().filter_map(|(names, pair)| pair.map(|pair| (names, pair)));
        let lengths = pairs
            .flat_map(|([x, y], pair)| [(x, pair.x.len()), (y, pair.y.len())])
            .chain(self.spindle_angle_deg.map(|column| ("spindle_angle_deg", column.len())))
            .chain(self.spindle_rev_per_min.map(|column| ("spindle_rev_per_min", column.len())))
            .chain(self.contact.map(|column| ("contact", column.len())))
            .chain(self.line.map(|column| ("line", column.len())));
        for (column, length) in lengths {
            if length != samples {
                return Err(BatchError::ColumnLength { column, length, samples });
            }
        }
        Ok(())
    }
}

/// A batch that cannot be read; the monitor is as it was.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum BatchError {
    /// A column is shorter or longer than the time stamps.
    #[error("column {column} has {length} values for {samples} time stamps")]
    ColumnLength {
        /// Name of the column.
        column: &'static str,
        /// Its length.
        length: usize,
        /// Number of time stamps.
        samples: usize,
    },
    /// More samples than a batch may have.
    #[error("{samples} samples in a batch, at most {limit} are allowed")]
    TooLarge {
        /// Samples in the batch.
        samples: usize,
        /// Largest number.
        limit: usize,
    },
}

/// What became of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Receipt {
    /// Taken in.
    Accepted,
    /// Taken in, but batches before it never came: `first..=last` are missing, and the window in progress is void.
    AcceptedAfterGap {
        /// First missing number.
        first: u64,
        /// Last missing number.
        last: u64,
    },
    /// Dropped: its number has been taken or passed over before.
    Dropped {
        /// Number of the last batch taken.
        newest: u64,
    },
}

/// What happens on the machine between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// The programmed spindle speed, before any override, is now this.
    ProgrammedSpindle {
        /// rev/min, 0 when the spindle is stopped.
        rev_per_min: f64,
    },
    /// The overrides in force are now these, for instance because the operator set them.
    Overrides {
        /// Feed factor.
        feed: f64,
        /// Spindle factor.
        spindle: f64,
    },
    /// A thread begins (`true`) or ends.
    Threading(bool),
    /// This tool is in the spindle; decisions hold while the baseline is another's.
    Tool(u32),
    /// Start over with the baseline, for the tool in the spindle; only this ends a stop.
    Rebaseline,
    /// The operator resumes the cut whose feed an escalation holds: it goes on with the lower feed bound, or what the
    /// operator has set since. Without effect where nothing is held.
    Resume,
    /// The machine answers a decision on the spindle speed.
    SpindleAnswer {
        /// Number of the decision.
        decision: u64,
        /// What it answers.
        answer: SpindleAnswer,
    },
    /// A planned change of the spindle speed has come to its place, where it may be: the machine is asked now. Without effect
    /// where none is planned.
    SpindlePlace {
        /// First setpoint at the speed; `None`: the place is not reached after all.
        setpoint_index: Option<u64>,
        /// The speed there, rev/min, where it is one.
        rev_per_min: Option<f64>,
    },
    /// What follows cannot be cut at a spindle speed, the planned one or the present one.
    SpindleUnfit {
        /// The override that was judged.
        spindle: f64,
        /// First setpoint of what was judged.
        setpoint_index: u64,
    },
    /// The clock of the sensors shows this time in ns: notices silence, and stamps that are stale or far ahead.
    Clock(u64),
    /// What the clock of the sensors shows is not known, as behind a new connection.
    ClockUnknown,
    /// The clock of the sensors was set to this time in ns: what was stamped before says nothing of silence.
    ClockSet(u64),
}

/// An event that is impossible; the monitor is as it was.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EventError {
    /// Spindle speed negative, not finite, or beyond 10⁶ rev/min.
    #[error("programmed spindle speed {0} rev/min is not between 0 and 1000000")]
    SpindleSpeed(f64),
    /// An override outside the configured bounds.
    #[error("{which} override {value} is not between {lower} and {upper}")]
    Override {
        /// `feed` or `spindle`.
        which: &'static str,
        /// The refused factor.
        value: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}
