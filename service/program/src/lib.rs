//! The program language: bytes of a CAM post's output in, resolved [`Operation`]s and [`Finding`]s out.
//!
//! Invariants: parsing never fails and never panics; every finding carries its place; memory does not grow
//! with the program; no I/O, clock or global state; the same bytes and settings give the same operations.

#![forbid(unsafe_code)]

mod axis;
mod block;
pub mod code;
mod code_replacement;
mod compensation;
mod consequence;
mod coordinates;
mod dialect;
mod evidence;
mod expression;
mod finding;
mod foreign;
mod guided;
mod interpreter;
pub mod lexer;
mod lookalike;
mod machine_code;
mod number;
mod operation;
mod outline;
mod parameters;
mod path_move;
mod program_name;
mod reader;
mod settings;
mod source;
mod state;
mod title;
mod tool_table;

pub use axis::{AXIS_COUNT, Axis, Plane, Position, straight_length};
pub use code_replacement::{CodeReplacement, code_replacement_problems};
pub use compensation::{
    CompensationCommand, CompensationCorner, CompensationEntry, CompensationMode, CompensationRules, Compensator,
};
pub use coordinates::{InitialOffsets, UnknownWorkSystem, WorkOffset, WorkSystem};
pub use finding::{
    CodeEntry, CodeTable, Example, Explanation, Finding, FindingCode, FindingLog, NamedValue, Occurrence, RelatedPlace,
    Severity, SourceSpan, Suggestion,
};
pub use guided::{AxisSet, GuidedMove, TiltedPlane, ToolAxisSolution, ToolGuide};
pub use interpreter::{Interpreter, LineOutcome, interpret};
pub use machine_code::{
    MachineCode, MachineCommand, MachineEffect, MachineTiming, UnlistedMachineCodes, machine_code_problems,
};
pub use number::Number;
pub use operation::{
    ArcGeometry, Coolant, DwellTime, Feed, Function, FunctionCommand, FunctionWord, Move, MoveKind, Operation,
    OperationKind, PathControl, PullOut, Spindle, SpindleDirection, SpindleSpeed, SplineGeometry, ThreadAmplitudeWord,
    ThreadKind, ThreadMove, ThreadPlane,
};
pub use outline::{Outline, Stretch, StretchKind, Target, Vocabulary, WordRole};
pub use parameters::InitialParameters;
pub use program_name::ProgramName;
pub use reader::{Reader, Reading};
pub use settings::{
    AngleRange, BoringShift, CompensationSettings, CoordinateSettings, CoordinateStyle, DecimalPointRule, DialectName,
    DrillingSettings, DrillingStyle, DwellUnit, FeedMode, FunctionCodes, FunctionSwitch, GCodeSystem, InitialMotion,
    LanguageSettings, MAX_PATH_TOLERANCE_MM, PathControlMode, PeckReturn, ThreadEWord, TurningSettings, XWord,
};
pub use source::{Place, SourcePages};
pub use state::{DrillingCycle, InterpreterState};
pub use tool_table::ToolOffset;
