//! Reads the program ahead of the pipeline, for what a function has to know of what follows.

use feedwave_program::{FindingLog, Operation, Reader, Reading, SourcePages};

use crate::functions::five_axis::{Ahead, Chosen};
use crate::functions::thinning::ThinningStage;

/// Most program text that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Reads a program ahead of the pipeline.
#[derive(Clone, Debug)]
pub(crate) struct Scout {
    reader: Reader,
    thinning: ThinningStage,
    operations: Vec<Operation>,
    /// Bytes read beyond those of the pipeline.
    read: u64,
    ahead: Ahead,
}

impl Scout {
    /// A look-ahead that starts where the pipeline is, with operations that wait there.
    pub(crate) fn new<'a>(
        ahead: Ahead,
        reader: &Reader,
        thinning: &ThinningStage,
        waiting: impl Iterator<Item = &'a Operation>,
    ) -> Self {
        let (reader, thinning) = (reader.clone(), thinning.beside());
        let mut scout = Self { reader, thinning, operations: Vec::new(), read: 0, ahead };
        waiting.for_each(|operation| scout.ahead.operation(operation));
        scout
    }

    /// Reads on where the pipeline has not been yet; nothing while bytes are missing.
    pub(crate) fn look(&mut self, pages: &mut SourcePages) -> Option<Chosen> {
        // Mistakes are found where they are carried out.
        let mut findings = FindingLog::with_limit(0);
        let Self { reader, thinning, operations, read, ahead } = self;
        while !ahead.is_settled() && *read < MAX_BYTES {
            let before = reader.interpreter.place();
            match reader.read_line(pages, operations, &mut findings) {
                Reading::More => *read += reader.interpreter.place().distance(before),
                Reading::NeedInput => return None,
                Reading::Ended => ahead.ended = true,
            }
            for operation in operations.drain(..) {
                thinning.operation(operation, &mut |operation| ahead.operation(&operation));
            }
        }
        Some(ahead.chosen())
    }
}
