//! Setpoint streams, read to the end and decoded as a client would: from the contract alone.

use feedwave_contract::proto::stream_setpoints_response::Message;
use feedwave_contract::proto::{
    ColumnKind, Encoding, SetpointChunk, StreamHeader, StreamSetpointsRequest, StreamSetpointsResponse,
};
use tonic::{Status, Streaming};

use crate::Clients;

/// A decoded stream.
#[derive(Clone, Debug)]
pub struct Setpoints {
    /// The header.
    pub header: StreamHeader,
    /// Values by column, in the header's order.
    pub columns: Vec<Vec<f64>>,
    /// Source line of every setpoint.
    pub lines: Vec<u32>,
    /// Bytes of all chunks.
    pub bytes: usize,
}

impl Setpoints {
    /// A stream of which nothing but the header has arrived.
    #[must_use]
    pub fn new(header: StreamHeader) -> Self {
        let columns = vec![Vec::new(); header.columns.len()];
        Self { header, columns, lines: Vec::new(), bytes: 0 }
    }

    /// Number of setpoints received.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether no setpoint was received.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Values of the column with this name.
    ///
    /// # Panics
    /// When there is no such column.
    #[must_use]
    pub fn column(&self, name: &str) -> &[f64] {
        let index = self.header.columns.iter().position(|column| column.name == name);
        &self.columns[index.unwrap_or_else(|| panic!("no {name} in {:?}", self.header.columns))]
    }

    /// Values of the only column of this kind.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn of_kind(&self, kind: ColumnKind) -> &[f64] {
        let index = self.header.columns.iter().position(|column| column.kind() == kind);
        &self.columns[index.unwrap_or_else(|| panic!("no {kind:?} in {:?}", self.header.columns))]
    }

    /// The bits of every value from `index` (of the program, not of the stream) on.
    ///
    /// # Panics
    /// When the stream starts later.
    #[must_use]
    pub fn bits_from(&self, index: u64) -> Vec<Vec<u64>> {
        let skip = usize::try_from(index - self.header.first_index).expect("an index in memory");
        self.columns.iter().map(|column| column[skip..].iter().map(|value| value.to_bits()).collect()).collect()
    }

    /// Adds a chunk after checking that it continues the stream and is what the header announced.
    ///
    /// # Panics
    /// When the chunk breaks the contract.
    pub fn add(&mut self, chunk: &SetpointChunk) {
        let count = chunk.count as usize;
        assert!(count > 0, "an empty chunk");
        assert_eq!(chunk.first_index, self.header.first_index + self.len() as u64, "chunks are consecutive");
        assert_eq!(chunk.columns.len(), self.columns.len());
        for ((values, info), column) in self.columns.iter_mut().zip(&self.header.columns).zip(&chunk.columns) {
            match self.header.encoding() {
                Encoding::FixedPointDelta => {
                    assert!(column.values.is_empty());
                    assert_eq!(column.deltas.len(), count);
                    let mut steps = 0_i64;
                    values.extend(column.deltas.iter().map(|delta| {
                        steps = steps.wrapping_add(*delta);
                        match steps {
                            i64::MIN => f64::NEG_INFINITY,
                            i64::MAX => f64::INFINITY,
                            steps => steps as f64 * info.resolution,
                        }
                    }));
                }
                Encoding::RawDouble => {
                    assert!(column.values.is_empty() && column.deltas.is_empty());
                    assert_eq!(column.raw.len(), 8 * count);
                    let value = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().expect("8 bytes"));
                    values.extend(column.raw.chunks(8).map(value));
                }
                _ => {
                    assert!(column.deltas.is_empty() && column.raw.is_empty());
                    assert_eq!(column.values.len(), count);
                    values.extend_from_slice(&column.values);
                }
            }
        }
        for run in &chunk.line_runs {
            assert!(run.count > 0, "an empty run of lines");
            self.lines.extend(std::iter::repeat_n(run.line, run.count as usize));
        }
        assert_eq!(self.len(), self.columns[0].len(), "every setpoint belongs to a line");
        self.bytes += prost::Message::encoded_len(chunk);
    }
}

/// The header of a stream that was just opened.
///
/// # Errors
/// As the service answers.
///
/// # Panics
/// When the first message is something else.
pub async fn header_of(messages: &mut Streaming<StreamSetpointsResponse>) -> Result<StreamHeader, Status> {
    match messages.message().await?.and_then(|first| first.message) {
        Some(Message::Header(header)) => Ok(header),
        other => panic!("a stream starts with its header, not with {other:?}"),
    }
}

/// Reads a stream to its end.
///
/// # Errors
/// As the service answers.
///
/// # Panics
/// When the stream breaks the contract.
pub async fn stream(clients: &mut Clients, request: StreamSetpointsRequest) -> Result<Setpoints, Status> {
    let mut messages = clients.setpoints.stream_setpoints(request).await?.into_inner();
    let mut setpoints = Setpoints::new(header_of(&mut messages).await?);
    while let Some(message) = messages.message().await? {
        match message.message {
            Some(Message::Chunk(chunk)) => setpoints.add(&chunk),
            other => panic!("after the header come chunks, not {other:?}"),
        }
    }
    Ok(setpoints)
}
