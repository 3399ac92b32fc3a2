//! Seals: the SHA-256 of what never changes in a record, written with it and compared wherever it is read, so that one
//! bit that a disk lost never comes back as another motion, limit or decision.

use sha2::{Digest as _, Sha256};

use super::record::Record;
use crate::error::{Result, StoreError};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Integer,
    Real,
    Text,
    Bytes,
}

/// The value of a column; all but reals may be null.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Value<'a> {
    Integer(Option<i64>),
    Real(f64),
    Text(Option<&'a str>),
    Bytes(Option<&'a [u8]>),
}

impl<'a> Value<'a> {
    pub(crate) fn of(row: &'a impl Record, column: &str, kind: Kind) -> Result<Self> {
        Ok(match kind {
            Kind::Integer => Self::Integer(row.integer_option(column)?),
            Kind::Real => Self::Real(row.real(column)?),
            Kind::Text => Self::Text(row.text_option(column)?),
            Kind::Bytes => Self::Bytes(row.bytes_option(column)?),
        })
    }

    /// Adds it to a hash so that no two rows of different values have the same bytes.
    pub(crate) fn hash(&self, hash: &mut Sha256) {
        let mut part = |bytes: Option<&[u8]>| match bytes {
            Some(bytes) => {
                hash.update([1]);
                hash.update((bytes.len() as u64).to_le_bytes());
                hash.update(bytes);
            }
            None => hash.update([0]),
        };
        match self {
            Self::Integer(value) => part(value.map(i64::to_le_bytes).as_ref().map(<[u8; 8]>::as_slice)),
            Self::Real(value) => part(Some(&value.to_bits().to_le_bytes())),
            Self::Text(value) => part(value.map(str::as_bytes)),
            Self::Bytes(value) => part(*value),
        }
    }
}

impl From<i64> for Value<'_> {
    fn from(value: i64) -> Self {
        Self::Integer(Some(value))
    }
}

impl From<Option<i64>> for Value<'_> {
    fn from(value: Option<i64>) -> Self {
        Self::Integer(value)
    }
}

impl<'a> From<&'a str> for Value<'a> {
    fn from(value: &'a str) -> Self {
        Self::Text(Some(value))
    }
}

impl<'a> From<Option<&'a str>> for Value<'a> {
    fn from(value: Option<&'a str>) -> Self {
        Self::Text(value)
    }
}

impl<'a> From<&'a [u8]> for Value<'a> {
    fn from(value: &'a [u8]) -> Self {
        Self::Bytes(Some(value))
    }
}

/// The `N` sealed columns of a table, whose `seal` is their hash in this order.
#[derive(Debug)]
pub(crate) struct Sealed<const N: usize> {
    /// What a row is.
    record: &'static str,
    columns: [(&'static str, Kind); N],
}

pub(crate) const PROGRAM: Sealed<4> = Sealed {
    record: "program",
    columns: [
        ("id", Kind::Text),
        ("content_id", Kind::Integer),
        ("size_bytes", Kind::Integer),
        ("chunk_count", Kind::Integer),
    ],
};

/// Of a chunk; what is compressed has a checksum of its own.
pub(crate) const CHUNK: Sealed<3> = Sealed {
    record: "chunk of a program",
    columns: [("content_id", Kind::Integer), ("chunk_index", Kind::Integer), ("source_bytes", Kind::Integer)],
};

pub(crate) const JOB: Sealed<8> = Sealed {
    record: "job",
    columns: [
        ("id", Kind::Text),
        ("tenant", Kind::Text),
        ("request_id", Kind::Text),
        ("fingerprint", Kind::Bytes),
        ("program_id", Kind::Text),
        ("machine_id", Kind::Text),
        ("settings", Kind::Text),
        ("machine_snapshot", Kind::Text),
    ],
};

/// Of a report; what is compressed has a checksum of its own.
pub(crate) const REPORT: Sealed<5> = Sealed {
    record: "report",
    columns: [
        ("job_id", Kind::Text),
        ("error_count", Kind::Integer),
        ("warning_count", Kind::Integer),
        ("info_count", Kind::Integer),
        ("summary", Kind::Text),
    ],
};

pub(crate) const DOCUMENT: Sealed<4> = Sealed {
    record: "document",
    columns: [("collection", Kind::Text), ("id", Kind::Text), ("number", Kind::Integer), ("body", Kind::Text)],
};

pub(crate) const MONITORING: Sealed<2> =
    Sealed { record: "monitoring configuration", columns: [("job_id", Kind::Text), ("config", Kind::Text)] };

pub(crate) const RUN: Sealed<4> = Sealed {
    record: "run",
    columns: [("id", Kind::Text), ("job_id", Kind::Text), ("kind", Kind::Text), ("settings", Kind::Text)],
};

pub(crate) const CHANGE: Sealed<5> = Sealed {
    record: "change of the feed override",
    columns: [
        ("run_id", Kind::Text),
        ("number", Kind::Integer),
        ("setpoint_index", Kind::Integer),
        ("ratio", Kind::Real),
        ("cause", Kind::Text),
    ],
};

pub(crate) const DECISION: Sealed<7> = Sealed {
    record: "decision",
    columns: [
        ("tenant", Kind::Text),
        ("run_id", Kind::Text),
        ("job_id", Kind::Text),
        ("number", Kind::Integer),
        ("at_us", Kind::Integer),
        ("action", Kind::Text),
        ("body", Kind::Bytes),
    ],
};

pub(crate) const RECORDED_CUT: Sealed<3> = Sealed {
    record: "recorded cut",
    columns: [("run_id", Kind::Text), ("number", Kind::Integer), ("head", Kind::Bytes)],
};

impl<const N: usize> Sealed<N> {
    /// The seal of a row with these values, in the order of the columns.
    pub(crate) fn seal(&self, values: [Value<'_>; N]) -> Vec<u8> {
        let mut hash = Sha256::new();
        values.iter().for_each(|value| value.hash(&mut hash));
        hash.finalize().to_vec()
    }

    /// Refuses a row whose column `seal` is not that of these values, such as those by which it was looked up: an index that
    /// is damaged leads to another row.
    ///
    /// # Errors
    /// `Corrupt`.
    pub(crate) fn compare(&self, row: &impl Record, seal: &str, values: [Value<'_>; N]) -> Result<()> {
        match row.bytes_option(seal)? {
            Some(sealed) if self.seal(values) != sealed => Err(self.broken()),
            _ => Ok(()),
        }
    }

    fn broken(&self) -> StoreError {
        let columns = self.columns.map(|(column, _)| column).join(", ");
        let record = self.record;
        StoreError::corrupt(format!("a {record} is not as it was written: {columns} do not hash to its seal"))
    }

    /// Refuses a row whose column `seal` is not that of its values. Rows of versions before there were seals have none.
    ///
    /// # Errors
    /// `Corrupt`.
    pub(crate) fn verify(&self, row: &impl Record) -> Result<()> {
        self.verify_by(row, "seal")
    }

    /// As [`Self::verify`], where the seal is in another column.
    pub(crate) fn verify_by(&self, row: &impl Record, seal: &str) -> Result<()> {
        let Some(sealed) = row.bytes_option(seal)? else { return Ok(()) };
        let mut hash = Sha256::new();
        for (column, kind) in self.columns {
            Value::of(row, column, kind)?.hash(&mut hash);
        }
        if hash.finalize().as_slice() == sealed { Ok(()) } else { Err(self.broken()) }
    }
}
