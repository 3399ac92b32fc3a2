//! Runs of the pipeline on this machine, without a server.

use std::sync::Arc;

use feedwave_cutting::{Pipeline, PipelineConfig, SetpointBlock, Step, Validation, ValidationReport};

use super::CliError;
use super::source::Source;
use super::terminal::{Unit, progress};

/// Validates a program; `observe` sees every block of setpoints.
pub(super) fn validate(
    source: &mut Source,
    config: Arc<PipelineConfig>,
    mut observe: impl FnMut(&SetpointBlock),
) -> Result<ValidationReport, CliError> {
    let bar = progress("validating", Unit::Bytes, source.size);
    let mut validation = Validation::new(config);
    loop {
        match validation.step() {
            Step::NeedInput(place) => {
                bar.set_position(place.offset);
                match source.read(place)? {
                    [] => validation.finish_input(),
                    piece => validation.push(piece),
                }
            }
            Step::Block => observe(validation.block()),
            Step::Finished | Step::Refused => break,
        }
    }
    bar.finish_and_clear();
    Ok(validation.finish())
}

/// Generates the setpoints of a program that was found valid, until `take` has had enough.
pub(super) fn generate(
    source: &mut Source,
    config: Arc<PipelineConfig>,
    take: impl FnMut(&SetpointBlock) -> Result<Progress, CliError>,
) -> Result<(), CliError> {
    if run_plan(source, config, take)? {
        return Ok(());
    }
    Err(CliError::trouble(format!("{}: the program changed while it was read", source.name)))
}

/// Generates the setpoints of a program until `take` has had enough; whether it had no error.
pub(super) fn run_plan(
    source: &mut Source,
    config: Arc<PipelineConfig>,
    mut take: impl FnMut(&SetpointBlock) -> Result<Progress, CliError>,
) -> Result<bool, CliError> {
    let mut pipeline = Pipeline::new(config);
    let mut block = pipeline.new_block();
    loop {
        match pipeline.next_block(&mut block) {
            Step::NeedInput(place) => match source.read(place)? {
                [] => pipeline.finish_input(),
                piece => pipeline.push(piece),
            },
            Step::Block => {
                if take(&block)? == Progress::Enough {
                    return Ok(true);
                }
            }
            Step::Finished => return Ok(true),
            Step::Refused => return Ok(false),
        }
    }
}

/// Whether more setpoints are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    Continue,
    Enough,
}
