//! Which columns a setpoint file has: data, read by every format.

use feedwave_contract::columns;
use feedwave_contract::columns::Extras;
use feedwave_cutting::SetpointBlock;
use feedwave_motion::Machine;

/// Where the values of a column come from.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Source {
    Index,
    Time,
    Line,
    /// A column of the stream.
    Doubles(columns::Column),
}

impl Source {
    /// The column of the block, for columns of doubles that are stored as such.
    pub(super) fn doubles<'a>(&self, block: &'a SetpointBlock) -> Option<&'a [f64]> {
        match self {
            Self::Index | Self::Time | Self::Line => None,
            Self::Doubles(column) => column.values(block),
        }
    }
}

/// One column of a setpoint file.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name with the unit at its end, as in `X_mm`.
    pub name: String,
    /// Unit, empty for a pure number.
    pub unit: String,
    pub(super) source: Source,
}

impl Column {
    fn new(name: &str, unit: &str, source: Source) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), source }
    }
}

/// The columns of a setpoint file and the clock behind its indices.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    columns: Vec<Column>,
    period_us: f64,
}

impl Layout {
    /// Index, time, the columns of a stream, source line; setpoint `i` belongs to time `i · period_us`.
    #[must_use]
    pub fn new(stream: Vec<columns::Column>, period_us: f64) -> Self {
        let mut columns = Vec::with_capacity(stream.len() + 3);
        columns.push(Column::new("index", "", Source::Index));
        columns.push(Column::new("time_s", "s", Source::Time));
        columns.extend(stream.into_iter().map(|column| {
            let (name, unit) = (column.name.clone(), column.unit.clone());
            Column { name, unit, source: Source::Doubles(column) }
        }));
        columns.push(Column::new("source_line", "", Source::Line));
        Self { columns, period_us }
    }

    /// The layout of a machine's setpoints.
    #[must_use]
    pub fn of_machine(machine: &Machine, extras: Extras, period_us: f64) -> Self {
        Self::new(columns::of_machine(machine, extras), period_us)
    }

    /// The columns, in order.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Time of a setpoint, s: the decimal that a person would write, rounded once.
    #[must_use]
    pub fn time_s(&self, index: u64) -> f64 {
        index as f64 * self.period_us / 1e6
    }

    /// The first setpoint at or after a time, s.
    #[must_use]
    pub fn index_at(&self, time_s: f64) -> u64 {
        let estimate = (time_s * 1e6 / self.period_us).ceil() as u64;
        if estimate > 0 && self.time_s(estimate - 1) >= time_s { estimate - 1 } else { estimate }
    }
}
