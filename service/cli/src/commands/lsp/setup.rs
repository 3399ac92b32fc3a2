//! What a document is judged with: the options of `feedwave validate`, from a file `feedwave.toml` beside the program or from the
//! editor, and the further program files they name.

use std::any::TypeId;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{CommandFactory as _, Parser};
use feedwave_cutting::{Frame, PipelineConfig};
use serde_json::{Map, Value};

use crate::commands::machine::MachineArgs;
use crate::commands::source::{IncludeArgs, Source};

/// The file beside a program.
const FILE_NAME: &str = "feedwave.toml";
/// The table of it that this is about; others belong to the service.
const TABLE: &str = "validate";
/// Longest file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Options by their names, as the command line has them.
#[derive(Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Options {
    #[command(flatten)]
    machine: MachineArgs,
    #[command(flatten)]
    include: IncludeArgs,
}

/// Where options come from when there is no file: the editor, with the directory that paths in them are relative to.
#[derive(Clone, Debug, Default)]
pub(super) struct EditorSettings {
    /// Options by their names.
    pub(super) options: Map<String, Value>,
    /// The directory of the workspace.
    pub(super) root: Option<PathBuf>,
}

/// What one document is judged with.
#[derive(Debug)]
pub(super) struct Setup {
    /// The machine and all else.
    pub(super) config: Arc<PipelineConfig>,
    /// The further program files; its own text is empty.
    pub(super) further: Source,
}

impl Setup {
    /// Finds the options of a document and reads the files that they name; in case of failure, the reason for people.
    pub(super) fn read(document: Option<&Path>, editor: &EditorSettings) -> Result<Self, String> {
        let found = document.and_then(|path| find(path, editor.root.as_deref()));
        let options = match &found {
            Some(file) => {
                let directory = file.parent().unwrap_or(Path::new(""));
                let options = read_file(file)?;
                parse(&options, directory).map_err(|error| format!("{}: {error}", file.display()))?
            }
            None => {
                let root = editor.root.clone().or_else(|| document?.parent().map(Path::to_owned));
                parse(&editor.options, root.as_deref().unwrap_or(Path::new("")))?
            }
        };
        let empty = Source::of_text("", "").map_err(|error| error.message)?;
        let further = options.include.around(empty).map_err(|error| error.message)?;
        let config = options.machine.config(Frame::Machine, further.further_names()).map_err(|error| error.message)?;
        Ok(Self { config, further })
    }
}

/// The nearest file from the document's directory up to that of the workspace; without one, beside the document only.
fn find(document: &Path, root: Option<&Path>) -> Option<PathBuf> {
    let beside = document.parent()?;
    let within = |directory: &&Path| *directory == beside || root.is_some_and(|root| directory.starts_with(root));
    let files = beside.ancestors().take_while(within).map(|directory| directory.join(FILE_NAME));
    // One without the table is the configuration of a service.
    files.into_iter().find(|file| read_file(file).map_or_else(|_| file.is_file(), |options| !options.is_empty()))
}

/// The options of a file; none where it has no table of them.
fn read_file(file: &Path) -> Result<Map<String, Value>, String> {
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let size = std::fs::metadata(file).map_err(|error| failed(&error))?.len();
    if size > MAX_FILE_BYTES {
        return Err(failed(&format!("has more than {MAX_FILE_BYTES} bytes")));
    }
    let text = std::fs::read_to_string(file).map_err(|error| failed(&error))?;
    let mut tables: Map<String, Value> = toml::from_str(&text).map_err(|error| failed(&error))?;
    match tables.remove(TABLE) {
        None => Ok(Map::new()),
        Some(Value::Object(options)) => Ok(options),
        Some(_) => Err(failed(&format!("{TABLE} is no table"))),
    }
}

/// Options as the command line reads them: `machine_kind = "mill"` is `--machine-kind=mill`, a list is the option repeated, `true`
/// the bare option. Paths are relative to `directory`.
fn parse(options: &Map<String, Value>, directory: &Path) -> Result<Options, String> {
    let command = Options::command();
    let mut words: Vec<OsString> = Vec::new();
    for (key, value) in options {
        let name = key.replace('_', "-");
        let argument = command.get_arguments().find(|argument| argument.get_long() == Some(&name));
        let argument = argument.ok_or_else(|| format!("{key}: no option of feedwave validate"))?;
        let is_path = argument.get_value_parser().type_id() == TypeId::of::<PathBuf>();
        let values = match value {
            Value::Array(values) => values.as_slice(),
            value => std::slice::from_ref(value),
        };
        for value in values {
            let mut word = OsString::from(format!("--{name}"));
            match value {
                Value::Bool(true) if !argument.get_action().takes_values() => {}
                Value::Bool(false) if !argument.get_action().takes_values() => continue,
                Value::String(text) if is_path => {
                    word.push("=");
                    word.push(directory.join(text));
                }
                Value::String(text) => word.push(format!("={text}")),
                Value::Number(number) => word.push(format!("={number}")),
                _ => return Err(format!("{key}: must be a text, a number or a list of them")),
            }
            words.push(word);
        }
    }
    Options::try_parse_from(words).map_err(|error| {
        let text = error.to_string();
        text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned()
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use feedwave_motion::MachineKind;
    use serde_json::json;

    use super::*;

    fn editor(options: Value, root: &Path) -> EditorSettings {
        let Value::Object(options) = options else { panic!("an object") };
        EditorSettings { options, root: Some(root.to_owned()) }
    }

    #[test]
    fn the_nearest_file_counts_and_else_the_editor() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path();
        let parts = root.join("parts/deep");
        fs::create_dir_all(parts.join("subs")).unwrap();
        fs::write(parts.join("subs/O5.nc"), "M99\n").unwrap();
        let program = parts.join("a.nc");
        let mill = editor(json!({ "machine_kind": "mill", "period-us": 500, "include": ["parts/deep/subs"] }), root);
        let setup = Setup::read(Some(&program), &mill).unwrap();
        assert_eq!((setup.config.profile.machine.kind, setup.config.interpolation_period_us), (MachineKind::Mill, 500));
        assert_eq!(&*setup.config.programs, ["O5.nc".to_owned()]);
        // A service's configuration beside it is not meant; the table further up is.
        fs::write(parts.join(FILE_NAME), "[grpc]\nlisten = \"[::]:1\"\n").unwrap();
        fs::write(
            root.join("parts").join(FILE_NAME),
            "[validate]\ninclude = \"deep/subs\"\ntool = [\"1=80\", \"2=90\"]\n",
        )
        .unwrap();
        let setup = Setup::read(Some(&program), &mill).unwrap();
        assert_eq!((setup.config.profile.machine.kind, setup.config.tools.len()), (MachineKind::Lathe, 2));
        assert_eq!(&*setup.config.programs, ["O5.nc".to_owned()]);
        // Outside of the workspace only what is beside the program counts.
        let elsewhere = EditorSettings { root: Some(parts.join("subs")), ..EditorSettings::default() };
        assert_eq!(Setup::read(Some(&program), &elsewhere).unwrap().config.tools.len(), 0);
        assert_eq!(Setup::read(None, &EditorSettings::default()).unwrap().config.programs.len(), 0);
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        let directory = tempfile::tempdir().unwrap();
        let root = directory.path();
        let program = root.join("a.nc");
        for (options, reason) in [
            (json!({ "machine-kin": "mill" }), "machine-kin: no option of feedwave validate"),
            (json!({ "machine-kind": "drill" }), "invalid value 'drill' for '--machine-kind <KIND>'"),
            (json!({ "profile": { "a": 1 } }), "profile: must be a text, a number or a list of them"),
            (json!({ "profile": "none.toml" }), "no such file or directory"),
            (json!({ "period-us": 1 }), "invalid value '1' for '--period-us <MICROSECONDS>'"),
        ] {
            let error = Setup::read(Some(&program), &editor(options, root)).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
        for (text, reason) in [("[validate", "expected"), ("validate = 3", "validate is no table")] {
            fs::write(root.join(FILE_NAME), text).unwrap();
            let error = Setup::read(Some(&program), &EditorSettings::default()).unwrap_err();
            assert!(error.contains(FILE_NAME) && error.contains(reason), "{error}");
        }
    }
}
