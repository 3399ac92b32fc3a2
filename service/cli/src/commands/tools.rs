//! Which tools a program may use.

use std::path::{Path, PathBuf};

use feedwave_contract::convert::{check_named_tool, check_tools};
use feedwave_contract::proto::{ListToolsResponse, Tool};
use feedwave_contract::violations::Violations;

use super::{CliError, data_file};

/// Options that say which tools there are. Without any of them every tool is taken for known.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ToolArgs {
    /// Tool library, TOML or JSON: `tools`, each the contract's `Tool` with number, length_mm, geometry (its cutting edges,
    /// which G202 needs) and so on; with any tool stated, others are unknown
    #[arg(long = "tools", value_name = "FILE")]
    tool_file: Option<PathBuf>,
    /// A tool and its length from the gauge point, such as 1=120.5; may be repeated, for tools that are not in the tool
    /// library. H of G43.4 and G43.5 means these lengths
    #[arg(long = "tool", value_name = "NUMBER=MM", value_parser = tool)]
    lengths: Vec<Tool>,
}

impl ToolArgs {
    /// The library's file.
    pub(super) fn file(&self) -> Option<&Path> {
        self.tool_file.as_deref()
    }

    /// The tools of the library and of the command line.
    pub(super) fn read(&self) -> Result<Vec<Tool>, CliError> {
        let mut tools = match &self.tool_file {
            Some(path) => read_library(path)?,
            None => Vec::new(),
        };
        for tool in &self.lengths {
            // Which of two statements holds is for the user to say: the length may belong to another tool.
            if tools.iter().any(|known| known.number == tool.number) {
                let message = format!("--tool {}: that tool is stated already, state it once", tool.number);
                return Err(CliError::trouble(message));
            }
            tools.push(tool.clone());
        }
        Ok(tools)
    }
}

/// The tools of a file, checked as the service checks them: a list of them in `tools`, as `ListTools` answers it, or one.
pub(super) fn read_library(path: &Path) -> Result<Vec<Tool>, CliError> {
    let document = data_file::read(path)?;
    let mut violations = Violations::default();
    if !document.states(&["tools"]) {
        let tool: Tool = data_file::message(path, &document)?;
        violations.extend("", check_named_tool(&tool));
        return if violations.is_empty() { Ok(vec![tool]) } else { Err(data_file::refused(path, &violations)) };
    }
    let library: ListToolsResponse = data_file::message(path, &document)?;
    if !library.next_page_token.is_empty() {
        violations.add("next_page_token", "must be empty: the list has further pages, and would not be whole");
    }
    let tools = library.tools;
    check_tools(&mut violations, "tools", &tools);
    if violations.is_empty() { Ok(tools) } else { Err(data_file::refused(path, &violations)) }
}

/// A tool with its length, as the command line writes it.
fn tool(text: &str) -> Result<Tool, String> {
    let (number, length) = text.split_once('=').ok_or("write it as NUMBER=MM, such as 1=120.5")?;
    let number = number.trim().parse::<u32>().ok().filter(|number| (1..=9_999).contains(number));
    let number = number.ok_or("the number must be 1 to 9999")?;
    let length_mm = length.trim().parse::<f64>().ok().filter(|length| length.is_finite() && *length > 0.0);
    let length_mm = Some(length_mm.ok_or("the length must be a positive number of millimetres")?);
    Ok(Tool { number, length_mm, ..Tool::default() })
}

#[cfg(test)]
mod tests {
    use feedwave_contract::json;

    use super::*;

    fn read(name: &str, text: &str, lengths: &[&str]) -> Result<Vec<Tool>, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        let lengths = lengths.iter().map(|text| tool(text).unwrap()).collect();
        let tools = ToolArgs { tool_file: Some(path.clone()), lengths }.read();
        tools.map_err(|error| error.message.replace(&path.display().to_string(), name))
    }

    #[test]
    fn tools_are_numbers_with_lengths() {
        let one = tool("1=120.5").unwrap();
        assert_eq!((one.number, one.length_mm), (1, Some(120.5)));
        for wrong in ["1", "=5", "0=5", "10000=5", "1=", "1=0", "1=-2", "1=nan", "x=1"] {
            assert!(tool(wrong).is_err(), "{wrong}");
        }
    }

    const CUTTER: &str = "[[tools]]\nnumber = 4\ndisplay_name = \"face mill\"\nlength_mm = 80.5\nmax_spindle_rev_per_min = 4000\n\
                          [tools.geometry]\nradius_mm = 60\nradial_edge_length_mm = 1.5\naxial_edge_height_mm = 5\n\
                          edges = [{angle_deg = 0, finishing = true}, {angle_deg = 180, axial_set_over_mm = 0.02}]\n";

    #[test]
    fn a_library_states_everything_that_a_tool_has() {
        let tools = read("t.toml", &format!("{CUTTER}[[tools]]\nnumber = 5\n"), &["7=100"]).unwrap();
        assert_eq!(tools.iter().map(|tool| tool.number).collect::<Vec<_>>(), [4, 5, 7]);
        assert_eq!((tools[0].display_name.as_str(), tools[0].length_mm), ("face mill", Some(80.5)));
        assert_eq!((tools[0].max_spindle_rev_per_min, tools[2].length_mm), (Some(4_000.0), Some(100.0)));
        let geometry = tools[0].geometry.as_ref().unwrap();
        assert_eq!((geometry.edges.len(), geometry.radius_mm), (2, 60.0));
        assert!(geometry.edges[0].finishing && geometry.edges[1].axial_set_over_mm == 0.02);
        // What the service answers, to a list or to a tool, is a file.
        let list = ListToolsResponse { tools: tools[..2].to_vec(), ..Default::default() };
        assert_eq!(read("t.json", &json::to_string(&list), &[]).unwrap(), tools[..2]);
        assert_eq!(read("t.json", &json::to_string(&tools[0]), &[]).unwrap(), tools[..1]);
        let list = ListToolsResponse { next_page_token: "more".to_owned(), ..list };
        assert!(read("t.json", &json::to_string(&list), &[]).unwrap_err().contains("next_page_token: must be empty"));
    }

    #[test]
    fn every_problem_is_named_with_its_key() {
        let text = CUTTER.replace("radius_mm = 60", "radius_mm = -1").replace("angle_deg = 180", "angle_deg = 400");
        let error =
            read("t.toml", &format!("{text}[[tools]]\nnumber = 4\nlength_mm = 0\ndisplay_name = \"a\\tb\"\n"), &[]);
        let error = error.unwrap_err();
        for key in ["geometry.radius_mm", "geometry.radial_edge_length_mm", "geometry.edges[1].angle_deg"] {
            assert!(error.contains(&format!("t.toml: tools[0].{key}: ")), "{key} not in {error}");
        }
        for key in ["display_name", "length_mm", "number"] {
            assert!(error.contains(&format!("t.toml: tools[1].{key}: ")), "{key} not in {error}");
        }
        let error = read("t.toml", &CUTTER.replace("length_mm = 80.5", "lenght_mm = 80.5"), &[]).unwrap_err();
        assert!(error.starts_with("t.toml: tools[0].lenght_mm: ") && error.contains("is length_mm meant?"), "{error}");
        let former = read("t.toml", &CUTTER.replace("display_name", "name"), &[]).unwrap_err();
        assert!(
            former.starts_with("t.toml: tools[0].name: ") && former.contains("for people is display_name"),
            "{former}"
        );
        let error = read("t.toml", &CUTTER.replace("number = 4", "number = \"four\""), &[]).unwrap_err();
        assert!(error.starts_with("t.toml: tools") && error.contains("number"), "{error}");
        assert!(read("t.toml", "", &[]).unwrap_err().contains("number: must be 1 to 9999"));
        assert!(read("t.json", "{", &[]).is_err());
        let error = read("t.toml", CUTTER, &["4=80.5"]).unwrap_err();
        assert!(error.contains("--tool 4"), "{error}");
    }
}
