//! Setpoints as a client receives them.

use std::f64::consts::PI;
use thiserror::Error;

/// Columns of equal length, one value per interpolation period.
#[derive(Debug, Clone, Copy)]
pub struct Setpoints<'a> {
    /// Index of the first setpoint; the one after the last pushed.
    pub first_index: u64,
    /// Positions of the two axes along the sensors' X and Y, mm; without them the feed goes along X.
    pub axes_mm: Option<[&'a [f64]; 2]>,
    /// Path position, mm.
    pub path_position_mm: &'a [f64],
    /// Feed along the path, mm/min, override included.
    pub feed_mm_per_min: &'a [f64],
    /// Spindle angle, degrees, unwrapped; counts down when the spindle turns backwards.
    pub spindle_angle_deg: &'a [f64],
    /// Source line.
    pub line: &'a [u32],
}

/// Setpoints that cannot be followed; the simulator is as it was.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SetpointError {
    /// A column is shorter or longer than the others.
    #[error("column {column} has {length} values, the path position has {setpoints}")]
    ColumnLength {
        /// Name of the column.
        column: &'static str,
        /// Its length.
        length: usize,
        /// Length of the path position's.
        setpoints: usize,
    },
    /// The block does not follow the last one.
    #[error("setpoint {found} does not follow: {expected} is next")]
    Index {
        /// First index of the block.
        found: u64,
        /// Index that was expected.
        expected: u64,
    },
    /// A value is not a number of reasonable size.
    #[error("setpoint {index}: {column} is {value}")]
    Value {
        /// Index of the setpoint.
        index: u64,
        /// Name of the column.
        column: &'static str,
        /// The value.
        value: f64,
    },
    /// The spindle turns faster than 10⁶ rev/min or the override is not between 0 and 10.
    #[error("spindle: {0} is not possible")]
    Spindle(f64),
}

/// Largest position, mm, or feed, mm/min.
const LARGE: f64 = 1e9;
/// Largest spindle angle, degrees: beyond it less than 10⁻³° is left of a double.
const MAX_ANGLE_DEG: f64 = 1e12;

/// One setpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Setpoint {
    pub axes_mm: [f64; 2],
    pub path_mm: f64,
    pub feed_mm_per_min: f64,
    pub angle_rad: f64,
    pub line: u32,
}

impl Setpoints<'_> {
    /// Number of setpoints.
    pub fn len(&self) -> usize {
        self.path_position_mm.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.path_position_mm.is_empty()
    }

    pub(crate) fn check(&self, expected: u64) -> Result<(), SetpointError> {
        if self.first_index != expected {
            return Err(SetpointError::Index { found: self.first_index, expected });
        }
        let [x, y] = self.axes_mm.unwrap_or([&[], &[]]);
        let columns: [(&'static str, &[f64], f64); 5] = [
            ("path_position_mm", self.path_position_mm, LARGE),
            ("feed_mm_per_min", self.feed_mm_per_min, LARGE),
            ("spindle_angle_deg", self.spindle_angle_deg, MAX_ANGLE_DEG),
            ("axes_mm[0]", x, LARGE),
            ("axes_mm[1]", y, LARGE),
        ];
        let setpoints = self.len();
        for (column, values, _) in &columns[..if self.axes_mm.is_some() { 5 } else { 3 }] {
            if values.len() != setpoints {
                return Err(SetpointError::ColumnLength { column, length: values.len(), setpoints });
            }
        }
        if self.line.len() != setpoints {
            return Err(SetpointError::ColumnLength { column: "line", length: self.line.len(), setpoints });
        }
        for (column, values, most) in columns {
            // Not being smaller also catches what is no number.
            if let Some(at) = values.iter().position(|value| !matches!(value.abs(), size if size <= most)) {
                return Err(SetpointError::Value { index: expected + at as u64, column, value: values[at] });
            }
        }
        Ok(())
    }

    pub(crate) fn get(&self, at: usize) -> Setpoint {
        Setpoint {
            axes_mm: self.axes_mm.map_or([0.0; 2], |axes| axes.map(|axis| axis[at])),
            path_mm: self.path_position_mm[at],
            feed_mm_per_min: self.feed_mm_per_min[at],
            angle_rad: self.spindle_angle_deg[at] * (PI / 180.0),
            line: self.line[at],
        }
    }
}
