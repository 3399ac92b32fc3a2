//! Reads the program ahead of the pipeline, for what a function has to know of what follows.

use feedwave_program::{FindingLog, Interpreter, LineOutcome, Operation};

use crate::functions::five_axis::{Ahead, Chosen};
use crate::functions::thinning::ThinningStage;

/// Most program text that is read, bytes.
const MAX_BYTES: usize = 1 << 20;

/// Reads a program ahead of the pipeline.
#[derive(Clone, Debug)]
pub(crate) struct Scout {
    interpreter: Interpreter,
    thinning: ThinningStage,
    operations: Vec<Operation>,
    /// Bytes read beyond those of the pipeline.
    read: usize,
    ahead: Ahead,
}

impl Scout {
    /// A look-ahead that starts where the pipeline is, with operations that wait there.
    pub(crate) fn new<'a>(
        ahead: Ahead,
        interpreter: &Interpreter,
        thinning: &ThinningStage,
        waiting: impl Iterator<Item = &'a Operation>,
    ) -> Self {
        let (interpreter, thinning) = (interpreter.clone(), thinning.beside());
        let mut scout = Self { interpreter, thinning, operations: Vec::new(), read: 0, ahead };
        waiting.for_each(|operation| scout.ahead.operation(operation));
        scout
    }

    /// Reads on in what the pipeline has not read yet; nothing while there is not enough of it.
    pub(crate) fn look(&mut self, unread: &[u8], input_finished: bool) -> Option<Chosen> {
        // Mistakes are found where they are carried out.
        let mut findings = FindingLog::with_limit(0);
        let Self { interpreter, thinning, operations, read, ahead } = self;
        while !ahead.is_settled() && *read < MAX_BYTES {
            match interpreter.read_line(&unread[*read..], input_finished, operations, &mut findings) {
                LineOutcome::Consumed(bytes) => *read += bytes,
                LineOutcome::NeedMore => return None,
                LineOutcome::Ended => ahead.ended = true,
            }
            for operation in operations.drain(..) {
                thinning.operation(operation, &mut |operation| ahead.operation(&operation));
            }
        }
        Some(ahead.chosen())
    }
}
