//! The machining functions, one file or folder each: its words in the language settings, its settings in a machine
//! profile, what a job asks of it, its report. [`FUNCTIONS`] lists them.

pub(super) mod five_axis;
pub(super) mod path_vibration;
pub(super) mod thinning;
pub(super) mod thread;
pub(super) mod tool_oscillation;

use feedwave_cutting::{MachineProfile, PipelineConfig, ValidationReport};
use feedwave_program::{FunctionCodes, LanguageSettings};

use crate::proto;
use crate::violations::Violations;

/// What the contract says of a machining function: its part of each message, read into and written from the types of the
/// pipeline. What a message leaves open stays as it is.
struct Function {
    words_from_proto: fn(&proto::LanguageSettings, &mut LanguageSettings),
    words_to_proto: fn(&LanguageSettings, &mut proto::LanguageSettings),
    /// Adds a violation for each field that cannot be read.
    settings_from_proto: fn(&mut Violations, &proto::MachineProfile, &mut MachineProfile),
    settings_to_proto: fn(&MachineProfile, &mut proto::MachineProfile),
    job_from_proto: fn(&proto::JobSettings, &mut PipelineConfig),
    report_to_proto: fn(&ValidationReport, &mut proto::ValidationReport),
}

/// All of them, in the order in which violations of a profile are reported.
const FUNCTIONS: [Function; 5] =
    [path_vibration::FUNCTION, thread::FUNCTION, five_axis::FUNCTION, thinning::FUNCTION, tool_oscillation::FUNCTION];

pub(super) fn words_from_proto(given: &proto::LanguageSettings, language: &mut LanguageSettings) {
    FUNCTIONS.iter().for_each(|function| (function.words_from_proto)(given, language));
}

pub(super) fn words_to_proto(language: &LanguageSettings, shown: &mut proto::LanguageSettings) {
    FUNCTIONS.iter().for_each(|function| (function.words_to_proto)(language, shown));
}

pub(super) fn settings_from_proto(
    violations: &mut Violations,
    given: &proto::MachineProfile,
    profile: &mut MachineProfile,
) {
    FUNCTIONS.iter().for_each(|function| (function.settings_from_proto)(violations, given, profile));
}

pub(super) fn settings_to_proto(profile: &MachineProfile, shown: &mut proto::MachineProfile) {
    FUNCTIONS.iter().for_each(|function| (function.settings_to_proto)(profile, shown));
}

pub(super) fn job_from_proto(settings: &proto::JobSettings, config: &mut PipelineConfig) {
    FUNCTIONS.iter().for_each(|function| (function.job_from_proto)(settings, config));
}

pub(super) fn report_to_proto(report: &ValidationReport, shown: &mut proto::ValidationReport) {
    FUNCTIONS.iter().for_each(|function| (function.report_to_proto)(report, shown));
}

/// The words that switch a function on and off; the given ones are those of the dialect where the message has none.
fn codes_from_proto(given: Option<proto::FunctionCodes>, dialect: FunctionCodes) -> FunctionCodes {
    given.map_or(dialect, |codes| FunctionCodes { on: codes.on, off: codes.off })
}

const fn codes_to_proto(codes: FunctionCodes) -> proto::FunctionCodes {
    proto::FunctionCodes { on: codes.on, off: codes.off }
}
