//! What a program asks for, resolved and not planned: the operations of the interpreter in their order.

use feedwave_motion::{Element, Machine, missing_axis};
use feedwave_program::{
    Axis, DialectName, FindingLog, Move, Operation, OperationKind, Place, Reader, Reading, SourcePages, SourceSpan,
};

use crate::PipelineConfig;
use crate::frame::pipeline::supply;
use crate::shared::checks::{may_be_drawn, missing};

/// Most operations handed out at once.
const BATCH: usize = 1_000;
/// Most lines read before the caller is asked again, so that a loop without motion can be cancelled.
const LINES_PER_STEP: usize = 4_096;

/// What [`Interpretation::step`] brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InterpretationStep {
    /// Bytes from this place on are needed first.
    NeedInput(Place),
    /// It got on: operations may have come.
    More,
    /// The program has ended.
    Ended,
}

/// Reads a program for its operations. Memory does not grow with the program.
///
/// As setpoints do, operations stop at the first error; the rest is read for its findings.
#[derive(Debug)]
pub struct Interpretation {
    reader: Reader,
    pages: SourcePages,
    operations: Vec<Operation>,
    findings: FindingLog,
    /// A lathe whose programs may have words of the drawing.
    lathe: Option<Machine>,
}

impl Interpretation {
    /// At the start of a program, for this machine and with what the job brings.
    #[must_use]
    pub fn new(config: &PipelineConfig) -> Self {
        Self {
            reader: Reader::new(config.interpreter()),
            pages: SourcePages::default(),
            operations: Vec::new(),
            findings: FindingLog::default(),
            lathe: (config.profile.language.dialect == DialectName::Lathe).then(|| config.profile.machine.clone()),
        }
    }

    /// Reads on, some thousand lines at most.
    pub fn step(&mut self) -> InterpretationStep {
        let Self { reader, pages, operations, findings, lathe } = self;
        for _ in 0..LINES_PER_STEP {
            let before = operations.len();
            let reading = reader.read_line(pages, operations, findings);
            if let Some(lathe) = lathe {
                for operation in &operations[before..] {
                    if let OperationKind::Move(mv) = &operation.kind {
                        check_drawn(mv, operation.span, lathe, findings);
                    }
                }
            }
            if findings.has_errors() {
                operations.truncate(before);
            }
            match reading {
                Reading::NeedInput => return InterpretationStep::NeedInput(pages.wanted()),
                Reading::Ended => return InterpretationStep::Ended,
                Reading::More if operations.len() >= BATCH => break,
                Reading::More => {}
            }
        }
        InterpretationStep::More
    }

    /// The operations since they were taken last.
    pub fn take_operations(&mut self) -> std::vec::Drain<'_, Operation> {
        self.operations.drain(..)
    }

    /// What was found so far.
    #[must_use]
    pub const fn findings(&self) -> &FindingLog {
        &self.findings
    }

    /// See [`Pipeline::push`](crate::Pipeline::push).
    pub fn push(&mut self, bytes: &[u8]) {
        self.pages.push(bytes);
    }

    /// See [`Pipeline::finish_input`](crate::Pipeline::finish_input).
    pub fn finish_input(&mut self) {
        self.pages.finish();
    }

    /// See [`Pipeline::supply`](crate::Pipeline::supply).
    pub fn supply(&mut self, place: Place, program: &[u8]) {
        supply(&mut self.pages, place, program);
    }

    /// Everything found.
    #[must_use]
    pub fn into_findings(self) -> FindingLog {
        self.findings
    }
}

/// Reports A and C of a cut on a lathe that has no such axis: they may be an angle and a chamfer of the drawing, so that the block may
/// mean another path. Other axes that the machine lacks are for validation.
fn check_drawn(mv: &Move, span: SourceSpan, machine: &Machine, findings: &mut FindingLog) {
    let Some(element) = Element::from_move(mv, span) else { return };
    if let Some(axis @ (Axis::A | Axis::C)) = missing_axis(&element, machine)
        && may_be_drawn(mv, &element)
    {
        findings.push(missing(axis, span, machine, true));
    }
}
