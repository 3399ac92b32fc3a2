//! The offsets that a program finds set.

use std::path::{Path, PathBuf};

use feedwave_contract::convert::check_offsets;
use feedwave_contract::proto::Offsets;
use feedwave_contract::violations::Violations;

use super::{CliError, data_file};

/// Options that say which offsets a program finds set.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct OffsetArgs {
    /// Offsets in place of the machine's, TOML or JSON: the contract's `Offsets` with external, work_offsets (system, offset),
    /// reference_positions (number, position) and parameters
    #[arg(long, value_name = "FILE")]
    offsets: Option<PathBuf>,
}

impl OffsetArgs {
    /// The file of offsets.
    pub(super) fn file(&self) -> Option<&Path> {
        self.offsets.as_deref()
    }

    /// The offsets of the file, checked as the service checks them; nothing without one.
    pub(super) fn read(&self) -> Result<Option<Offsets>, CliError> {
        let Some(path) = &self.offsets else { return Ok(None) };
        let document = data_file::read(path)?;
        let offsets: Offsets = data_file::message(path, &document)?;
        let mut violations = Violations::default();
        check_offsets(&mut violations, "", &offsets);
        if violations.is_empty() { Ok(Some(offsets)) } else { Err(data_file::refused(path, &violations)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<Offsets>, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("o.toml");
        std::fs::write(&path, text).unwrap();
        let read = OffsetArgs { offsets: Some(path.clone()) }.read();
        read.map_err(|error| error.message.replace(&path.display().to_string(), "o.toml"))
    }

    #[test]
    fn a_file_states_offsets() {
        assert_eq!(OffsetArgs::default().read().unwrap(), None);
        let text = "external = { z = -2.5 }\n[[work_offsets]]\nsystem = \"G54.1 P7\"\noffset = { x = 10 }\n\
                    [[reference_positions]]\nnumber = 2\nposition = { z = 100 }\n";
        let offsets = read(text).unwrap().unwrap();
        assert_eq!((offsets.external.unwrap().z, offsets.work_offsets[0].offset.unwrap().x), (-2.5, 10.0));
        assert_eq!(offsets.reference_positions[0].number, 2);
        let error = read("[[work_offsets]]\nsystem = \"G53\"\n").unwrap_err();
        let expected = "o.toml: work_offsets[0].system: must be G54 to G59, G59.1 to G59.3, or G54.1 P1 to P300";
        assert_eq!(error, expected);
    }
}
