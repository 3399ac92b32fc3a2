//! Which further program files a job needs where a directory has more than a job takes.

use std::collections::BTreeSet;

use feedwave_contract::convert::MAX_PROGRAM_FILES;
use feedwave_program::{LanguageSettings, ProgramName, Target, Vocabulary};

use super::CliError;
use super::source::Source;

/// Keeps of the further files those that the program calls by the names of the files, and those that these call in turn, where there are
/// more than a job takes. The dialect is the service's to know: calls of all of them count.
///
/// # Errors
/// [`CliError`] where a file cannot be read, or more are called than a job takes.
pub(super) fn keep_called(source: &mut Source) -> Result<(), CliError> {
    if source.further_count() <= MAX_PROGRAM_FILES {
        return Ok(());
    }
    let names = source.further_names();
    let vocabularies =
        [LanguageSettings::mill(), LanguageSettings::linuxcnc()].map(|settings| Vocabulary::new(&settings));
    let (mut called, mut needed) = (BTreeSet::new(), BTreeSet::new());
    // The program itself, then what was found in it.
    let mut unread = vec![None];
    while let Some(place) = unread.pop() {
        let text = match place {
            None => source.whole()?,
            Some(place) => source.further_file(place)?.1.whole()?,
        };
        for name in calls(&text, &vocabularies) {
            if !called.insert(name.clone()) {
                continue;
            }
            let files = names.iter().enumerate().filter(|(_, file)| name.is_of_file(file));
            unread.extend(files.filter(|(place, _)| needed.insert(*place)).map(|(place, _)| Some(place)));
        }
        if needed.len() > MAX_PROGRAM_FILES {
            let message =
                format!("--include: the program calls more than {MAX_PROGRAM_FILES} files, which a job takes");
            return Err(CliError::trouble(message));
        }
    }
    source.keep_further(&needed.into_iter().collect::<Vec<_>>());
    Ok(())
}

/// What a program calls others by.
fn calls(text: &[u8], vocabularies: &[Vocabulary]) -> BTreeSet<ProgramName> {
    let lines = text.split(|byte| matches!(byte, b'\n' | b'\r'));
    let targets = lines.flat_map(|line| vocabularies.iter().flat_map(move |it| it.targets(line)));
    let named = targets.filter_map(|(_, target)| match target {
        Target::Program { name, .. } => Some(name),
        Target::Subprogram(name) => Some(ProgramName::of_subprogram(&name)),
        Target::Label(_) => None,
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::source::IncludeArgs;

    #[test]
    fn of_a_large_directory_the_called_files_are_kept() {
        let directory = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
        (1..=MAX_PROGRAM_FILES).for_each(|number| write(&format!("O{number}.nc"), "M99\n"));
        write("O5000.nc", "O5000\nM98 P0007\nM99\n");
        write("main.nc", "M98 P5000\nG65 P5000 A1.\nM30\n");
        let include = IncludeArgs::of(directory.path());
        let mut source = include.open(&directory.path().join("main.nc")).unwrap();
        assert!(source.further_count() > MAX_PROGRAM_FILES);
        keep_called(&mut source).unwrap();
        assert_eq!(source.further_names()[..], ["O5000.nc".to_owned(), "O7.nc".to_owned()]);
    }

    #[test]
    fn calls_of_every_dialect_are_found() {
        let vocabularies =
            [LanguageSettings::mill(), LanguageSettings::linuxcnc()].map(|settings| Vocabulary::new(&settings));
        let text = b"O1\nM98 P1050 L2\nG65 P9001 A1.\r\no<Rect> call [1]\no7 call\nGOTO 10\nM30\n";
        let found = calls(text, &vocabularies);
        let rect = ProgramName::Text("rect".into());
        for name in [ProgramName::Number(1_050), ProgramName::Number(9_001), rect, ProgramName::Number(7)] {
            assert!(found.contains(&name), "{name}: {found:?}");
        }
    }
}
