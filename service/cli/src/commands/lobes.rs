//! `feedwave lobes`: stability lobes of a tool and the spindle table that they give.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use feedwave_contract::convert::{pocket_search_from_proto, stability_model_from_proto};
use feedwave_contract::proto::stability_model::Cut;
use feedwave_contract::proto::{
    GetToolRequest, MillingCut, PocketSearch, StabilityLobes, StabilityModel, Tool, ToolDynamics, TurningCut,
    VibrationMode,
};
use feedwave_contract::violations::{Violation, Violations};
use feedwave_monitoring::{Lobes, PocketRequest};
use feedwave_plot::{LobesPicture, write_lobes};
use tonic::Code;

use super::client::ServerArgs;
use super::source::Source;
use super::terminal::{Style, print, print_json, tell};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED, findings};

/// What findings call the lobes: they have no place in a program.
const NAME: &str = "lobes";

/// Arguments of `feedwave lobes`.
#[derive(Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 computed, 1 no such table (the depth is not stable), 2 wrong usage or no answer.

Examples:
  feedwave lobes --mode-x 600,0.03,10000 --mode-y 660,0.03,10000 --tangential 700 --radial-ratio 0.3 --edges 4 \\
      --entry 90 --exit 180 --lowest-rev-per-min 2000 --highest-rev-per-min 12000 --bands 5 --plots pictures
      Half-immersion climb milling with a tool that is compliant in both directions.
  feedwave lobes --tool tools/em12 --entry 0 --exit 180 --lowest-rev-per-min 3000 --highest-rev-per-min 15000 --required 1.5
      A slot with a tool of the library of a running service; refused where 1.5 mm cannot be had in every band.
  feedwave lobes --turning --mode-normal 250,0.04,8000 --specific 2000 --lowest-rev-per-min 500 --highest-rev-per-min 4000 \\
      --format json | jq .leastLimitMm"
)]
pub struct Args {
    /// Tool of the library, `tools/{tool}`; what the options below say takes the place of what it says
    #[arg(long, value_name = "TOOL", help_heading = "Tool")]
    tool: Option<String>,
    /// Mode in the feed direction; may be repeated
    #[arg(long, value_name = "HZ,DAMPING,N/MM", value_parser = mode, help_heading = "Tool")]
    mode_x: Vec<VibrationMode>,
    /// Mode across the feed direction; may be repeated
    #[arg(long, value_name = "HZ,DAMPING,N/MM", value_parser = mode, help_heading = "Tool")]
    mode_y: Vec<VibrationMode>,
    /// Mode normal to the cut surface, in turning; may be repeated
    #[arg(long, value_name = "HZ,DAMPING,N/MM", value_parser = mode, requires = "turning", help_heading = "Tool")]
    mode_normal: Vec<VibrationMode>,
    /// Cutting edges
    #[arg(long, value_name = "COUNT", help_heading = "Tool")]
    edges: Option<u32>,
    /// Tangential cutting coefficient of the material
    #[arg(long, value_name = "N/MM²", help_heading = "Cut")]
    tangential: Option<f64>,
    /// Radial over tangential cutting coefficient
    #[arg(long, value_name = "RATIO", help_heading = "Cut")]
    radial_ratio: Option<f64>,
    /// Specific cutting coefficient, in turning
    #[arg(long, value_name = "N/MM²", requires = "turning", help_heading = "Cut")]
    specific: Option<f64>,
    /// The workpiece rotates, not the tool
    #[arg(long, conflicts_with_all = ["entry", "exit", "edges"], help_heading = "Cut")]
    turning: bool,
    /// Angle from the normal of the feed direction at which an edge enters
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, help_heading = "Cut")]
    entry: f64,
    /// Angle at which it leaves
    #[arg(long, value_name = "DEGREES", default_value_t = 180.0, help_heading = "Cut")]
    exit: f64,
    /// Lowest spindle speed
    #[arg(long, value_name = "REV/MIN", help_heading = "Spindle table")]
    lowest_rev_per_min: f64,
    /// Highest spindle speed
    #[arg(long, value_name = "REV/MIN", help_heading = "Spindle table")]
    highest_rev_per_min: f64,
    /// Bands of equal width, each with its best speed
    #[arg(long, value_name = "COUNT", default_value_t = PocketRequest::BANDS, help_heading = "Spindle table")]
    bands: u32,
    /// Fraction taken off every limit
    #[arg(long, value_name = "FRACTION", default_value_t = PocketRequest::MARGIN, help_heading = "Spindle table")]
    margin: f64,
    /// How far the true speed may be off, as a fraction
    #[arg(long, value_name = "FRACTION", default_value_t = PocketRequest::SPEED_TOLERANCE, help_heading = "Spindle table")]
    speed_tolerance: f64,
    /// Depth or width that must be stable in every band, margin included
    #[arg(long, value_name = "MM", help_heading = "Spindle table")]
    required: Option<f64>,
    /// Evenly spaced speeds of chart and picture; more are added where the limit bends
    #[arg(long, value_name = "COUNT", default_value_t = Lobes::CHART_SPEEDS, help_heading = "Output")]
    chart_speeds: u32,
    /// Directory to draw a picture into
    #[arg(long, value_name = "DIRECTORY", help_heading = "Output")]
    plots: Option<PathBuf>,
    /// Form of the answer on standard output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text, help_heading = "Output")]
    format: Format,
    #[command(flatten)]
    server: ServerArgs,
}

/// A mode as the command line writes it.
pub(super) fn mode(text: &str) -> Result<VibrationMode, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[frequency_hz, damping_ratio, stiffness_n_per_mm]) => {
            Ok(VibrationMode { frequency_hz, damping_ratio, stiffness_n_per_mm })
        }
        _ => Err("write natural frequency, damping ratio and modal stiffness, such as 600,0.03,10000".to_owned()),
    }
}

impl Args {
    fn model(&self) -> StabilityModel {
        let milling = MillingCut { entry_deg: self.entry, exit_deg: self.exit, edge_count: self.edges };
        StabilityModel {
            tool: self.tool.clone().unwrap_or_default(),
            dynamics: Some(ToolDynamics {
                modes_x: self.mode_x.clone(),
                modes_y: self.mode_y.clone(),
                modes_normal: self.mode_normal.clone(),
                tangential_n_per_mm2: self.tangential,
                radial_ratio: self.radial_ratio,
                specific_n_per_mm2: self.specific,
                ..ToolDynamics::default()
            }),
            cut: Some(if self.turning { Cut::Turning(TurningCut {}) } else { Cut::Milling(milling) }),
        }
    }

    const fn search(&self) -> PocketSearch {
        PocketSearch {
            lowest_rev_per_min: self.lowest_rev_per_min,
            highest_rev_per_min: self.highest_rev_per_min,
            bands: Some(self.bands),
            margin: Some(self.margin),
            speed_tolerance: Some(self.speed_tolerance),
            required_mm: self.required,
        }
    }

    /// The tool of the library.
    async fn stored_tool(&self) -> Result<Option<Tool>, CliError> {
        let Some(name) = &self.tool else { return Ok(None) };
        let client = self.server.connect().await?;
        let request = GetToolRequest { name: name.clone() };
        let answer = client.tools().get_tool(request).await;
        match answer {
            Ok(answer) => Ok(answer.into_inner().tool),
            Err(status) if status.code() == Code::InvalidArgument => {
                Err(CliError::trouble(format!("--tool {name}: write it as tools/em12")))
            }
            Err(status) => Err(client.failed(&status)),
        }
    }
}

/// Computes them.
///
/// # Errors
/// [`CliError`] when an option is wrong or the library does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let tool = args.stored_tool().await?;
    let mut violations = Violations::default();
    let given = args.model();
    let model = stability_model_from_proto(&mut violations, "model", &given, tool.as_ref());
    let search = pocket_search_from_proto(&mut violations, "search", Some(&args.search()));
    let (Some(model), Some(search)) = (model, search) else {
        return Err(CliError::trouble(told(violations.as_slice())));
    };
    let lobes = match model.stability_lobes(&search, Some(args.chart_speeds)) {
        Ok(lobes) => lobes,
        Err(refused) if refused.as_slice().iter().any(|violation| violation.field.starts_with("chart")) => {
            return Err(CliError::trouble(told(refused.as_slice())));
        }
        Err(refused) => {
            tell(&format!("{}\n{}: no table\n", told(refused.as_slice()), Style::stderr().bad("refused")));
            return Ok(ExitCode::from(EXIT_REFUSED));
        }
    };
    match args.format {
        Format::Json => print_json(&lobes)?,
        Format::Text => print(&text(&args.heading(&lobes), &lobes, Style::stdout())?)?,
    }
    if let Some(directory) = &args.plots {
        let picture = LobesPicture { subtitle: args.heading(&lobes), lobes: &lobes };
        let files = write_lobes(&picture, directory).map_err(CliError::trouble)?;
        tell(&format!("drew {} pictures into {}\n", files.len(), directory.display()));
    }
    Ok(ExitCode::SUCCESS)
}

impl Args {
    /// What the lobes are of, in one line.
    fn heading(&self, lobes: &StabilityLobes) -> String {
        let of = self.tool.as_ref().map_or_else(String::new, |tool| format!("{tool}, "));
        match lobes.radial_immersion {
            Some(immersion) => format!(
                "{of}milling from {}° to {}°, radial immersion {:.1} %",
                self.entry,
                self.exit,
                100.0 * immersion
            ),
            None => format!("{of}turning"),
        }
    }
}

/// Limits, table and notes for people.
fn text(heading: &str, lobes: &StabilityLobes, style: Style) -> Result<String, CliError> {
    let mut text = format!("{}\n", style.bold(&format!("Stability lobes: {heading}")));
    let all_speeds = lobes.least_limit_mm.map_or_else(
        || "nothing chatters".to_owned(),
        |limit| format!("up to {} mm nothing chatters at any speed", rounded_down(limit)),
    );
    let margin = lobes.search.and_then(|search| search.margin).unwrap_or_default();
    // Writing into a string does not fail.
    let _ = writeln!(text, "{all_speeds}, without margin\n");
    let _ = writeln!(text, "Spindle table with a margin of {:.1} %", 100.0 * margin);
    let _ = writeln!(text, "{:>24}  {:>12}  {:>10}", "current speed, rev/min", "new speed", "stable mm");
    for pocket in &lobes.pockets {
        let band = pocket.band.unwrap_or_default();
        let stable = pocket.stable_mm.map_or_else(|| "any".to_owned(), rounded_down);
        let range = format!("{:.1} to {:.1}", band.above_rev_per_min, band.up_to_rev_per_min);
        let _ = writeln!(text, "{range:>24}  {:>12.1}  {stable:>10}", band.spindle_rev_per_min);
    }
    if !lobes.findings.is_empty() {
        text.push('\n');
        text.push_str(&findings::text(&lobes.findings, &mut Source::of_text(NAME, "")?, style)?);
    }
    Ok(text)
}

/// A depth with at least four digits, rounded down: what is printed holds.
pub(super) fn rounded_down(depth_mm: f64) -> String {
    let leading = depth_mm.log10().floor().clamp(-300.0, 0.0);
    let places = 4.0 - leading.min(0.0) - f64::from(leading < 0.0);
    let unit = 10_f64.powf(places);
    format!("{:.*}", places as usize, (depth_mm * unit).floor() / unit)
}

/// The option that says a field of the model or of the search.
const OPTIONS: [(&str, &str); 16] = [
    ("model.dynamics.modes_x", "--mode-x"),
    ("model.dynamics.modes_y", "--mode-y"),
    ("model.dynamics.modes_normal", "--mode-normal"),
    ("model.dynamics.tangential_n_per_mm2", "--tangential"),
    ("model.dynamics.radial_ratio", "--radial-ratio"),
    ("model.dynamics.specific_n_per_mm2", "--specific"),
    ("model.milling.entry_deg", "--entry"),
    ("model.milling.exit_deg", "--exit"),
    ("model.milling.edge_count", "--edges"),
    ("search.lowest_rev_per_min", "--lowest-rev-per-min"),
    ("search.highest_rev_per_min", "--highest-rev-per-min"),
    ("search.bands", "--bands"),
    ("search.margin", "--margin"),
    ("search.speed_tolerance", "--speed-tolerance"),
    ("search.required_mm", "--required"),
    ("chart_speeds", "--chart-speeds"),
];

/// Violations by the options that they are about; of one mode among several, with its field.
fn told(violations: &[Violation]) -> String {
    let line = |Violation { field, description }: &Violation| {
        let option = OPTIONS.iter().find_map(|(path, option)| match field.strip_prefix(path)?.split_once('.') {
            Some((_, part)) => Some(format!("{option}: {part}")),
            None => Some(format!("{option}:")),
        });
        format!("{} {description}", option.unwrap_or_else(|| format!("{field}:")))
    };
    violations.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn violations_are_told_by_their_options() {
        let mut violations = Violations::default();
        for field in [
            "model.dynamics.modes_x[1].damping_ratio",
            "model.dynamics.modes_y",
            "model.milling.exit_deg",
            "search.required_mm",
            "model.cut",
        ] {
            violations.add(field, "must be otherwise");
        }
        let lines = "--mode-x: damping_ratio must be otherwise\n--mode-y: must be otherwise\n--exit: must be otherwise\n\
                     --required: must be otherwise\nmodel.cut: must be otherwise";
        assert_eq!(told(violations.as_slice()), lines);
    }

    #[test]
    fn depths_are_rounded_down() {
        let expected = [(1.999_99, "1.9999"), (0.309, "0.3090"), (0.012_349, "0.01234"), (0.000_199_99, "0.0001999")];
        for (depth_mm, text) in expected {
            assert_eq!(rounded_down(depth_mm), text);
        }
    }

    #[test]
    fn modes_are_three_numbers() {
        let mode_of = mode("600, 0.03,1e4").unwrap();
        assert_eq!((mode_of.frequency_hz, mode_of.damping_ratio, mode_of.stiffness_n_per_mm), (600.0, 0.03, 1e4));
        for wrong in ["600", "600,0.03", "600,0.03,", "600,x,1", "1,2,3,4"] {
            assert!(mode(wrong).is_err(), "{wrong}");
        }
    }
}
