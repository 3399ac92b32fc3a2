//! `feedwave learn`: what runs say about tool and material, and what the tool library and the spindle table would become.

use std::fmt::Write as _;
use std::process::ExitCode;

use feedwave_contract::proto::{
    AdoptToolProposalRequest, ComputeToolProposalRequest, Estimate, LearningCut, LearningRecord, LearningSource,
    LeftOut, MillingCut, PocketSearch, StabilityPocket, ToolDynamics, ToolProposal, VibrationMode,
};
use feedwave_monitoring::PocketRequest;
use tonic::Code;

use super::client::ServerArgs;
use super::lobes::{mode, rounded_down};
use super::terminal::{Style, counted, number, print, print_json, tell};
use super::validate::Format;
use super::{CliError, EXIT_REFUSED};

/// Arguments of `feedwave learn`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 learnt, 1 the runs do not tell (and why), 2 wrong usage or no answer.

Examples:
  feedwave run \"$job\" --simulate --cut 3-6:1.5 --record
      A run that keeps steady cuts to learn from.
  feedwave learn runs/0197b3c2-… --tool tools/em12 --depth 1.5 --entry 90 --exit 180
      What it says, and what the tool would become. Nothing is changed.
  feedwave learn runs/0197b3c2-… --tool tools/em12 --cut 3-4:1.5 --cut 6:0.8 --entry 90 --exit 180 \\
      --lowest-rev-per-min 3000 --highest-rev-per-min 12000 --bands 6
      With the spindle table that would follow, beside the present one.
  feedwave learn runs/0197b3c2-… --tool tools/em12 --depth 1.5 --entry 90 --exit 180 --adopt
      Writes it into the tool; the audit log tells of it.")]
pub struct Args {
    /// Runs that kept cuts (`feedwave run --record`), `runs/{run}` or the part after the slash; 1 to 16
    #[arg(value_name = "RUN", required = true)]
    runs: Vec<String>,
    /// Tool of the library that they were cut with, `tools/{tool}`
    #[arg(long, value_name = "TOOL", help_heading = "Tool")]
    tool: String,
    /// Mode in X, in place of the tool's: its stiffness is taken as it is, the search starts at its frequency
    #[arg(long, value_name = "HZ,DAMPING,N/MM", value_parser = mode, help_heading = "Tool")]
    mode_x: Option<VibrationMode>,
    /// Mode in Y, in place of the tool's
    #[arg(long, value_name = "HZ,DAMPING,N/MM", value_parser = mode, help_heading = "Tool")]
    mode_y: Option<VibrationMode>,
    /// Cutting edges, in place of the tool's
    #[arg(long, value_name = "COUNT", help_heading = "Tool")]
    edges: Option<u32>,
    /// Depth of every cut
    #[arg(long, value_name = "MM", required_unless_present = "cut", help_heading = "Cut")]
    depth: Option<f64>,
    /// Lines and how deep the tool cuts there, before --depth; may be repeated
    #[arg(long, value_name = "FIRST-LAST:DEPTH", value_parser = cut, help_heading = "Cut")]
    cut: Vec<LearningCut>,
    /// Angle from the normal of the feed direction at which an edge enters
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, help_heading = "Cut")]
    entry: f64,
    /// Angle at which it leaves
    #[arg(long, value_name = "DEGREES", default_value_t = 180.0, help_heading = "Cut")]
    exit: f64,
    /// Spindle angle at which the first edge is on the normal of the feed direction
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, help_heading = "Cut")]
    first_edge: f64,
    /// Lowest spindle speed of the table that would follow
    #[arg(long, value_name = "REV/MIN", requires = "highest_rev_per_min", help_heading = "Spindle table")]
    lowest_rev_per_min: Option<f64>,
    /// Highest spindle speed of it
    #[arg(long, value_name = "REV/MIN", requires = "lowest_rev_per_min", help_heading = "Spindle table")]
    highest_rev_per_min: Option<f64>,
    /// Bands of equal width, each with its best speed
    #[arg(long, value_name = "COUNT", default_value_t = PocketRequest::BANDS, help_heading = "Spindle table")]
    bands: u32,
    /// Fraction taken off every limit
    #[arg(long, value_name = "FRACTION", default_value_t = PocketRequest::MARGIN, help_heading = "Spindle table")]
    margin: f64,
    /// Write the proposal into the tool; without this nothing is changed
    #[arg(long)]
    adopt: bool,
    /// Form of the answer on standard output
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text, help_heading = "Output")]
    format: Format,
    #[command(flatten)]
    server: ServerArgs,
}

/// Lines and a depth as the command line writes them.
fn cut(text: &str) -> Result<LearningCut, String> {
    let wrong = || "must be lines and a depth in mm, such as 3:1.5 or 3-7:0.5".to_owned();
    let (lines, depth) = text.split_once(':').ok_or_else(wrong)?;
    let (first, last) = lines.split_once('-').unwrap_or((lines, lines));
    let line = |text: &str| text.parse::<u32>().ok().filter(|line| *line > 0).ok_or_else(wrong);
    let depth_mm = depth.parse().map_err(|_| wrong())?;
    Ok(LearningCut { first_line: line(first)?, last_line: line(last)?, depth_mm, first_edge_deg: 0.0 })
}

impl Args {
    fn source(&self) -> LearningSource {
        let all = self.depth.map(|depth_mm| LearningCut { depth_mm, ..LearningCut::default() });
        let cuts = self.cut.iter().copied().chain(all);
        let run = |run: &String| if run.contains('/') { run.clone() } else { format!("runs/{run}") };
        let speeds = self.lowest_rev_per_min.zip(self.highest_rev_per_min);
        LearningSource {
            tool: self.tool.clone(),
            runs: self.runs.iter().map(run).collect(),
            milling: Some(MillingCut { entry_deg: self.entry, exit_deg: self.exit, edge_count: self.edges }),
            cuts: cuts.map(|cut| LearningCut { first_edge_deg: self.first_edge, ..cut }).collect(),
            dynamics: Some(ToolDynamics {
                modes_x: self.mode_x.into_iter().collect(),
                modes_y: self.mode_y.into_iter().collect(),
                ..ToolDynamics::default()
            }),
            search: speeds.map(|(lowest_rev_per_min, highest_rev_per_min)| PocketSearch {
                lowest_rev_per_min,
                highest_rev_per_min,
                bands: Some(self.bands),
                margin: Some(self.margin),
                ..PocketSearch::default()
            }),
        }
    }
}

/// Learns, and adopts where that was asked for.
///
/// # Errors
/// [`CliError`] when an option is wrong or the service does not answer.
pub(super) async fn run(args: Args) -> Result<ExitCode, CliError> {
    let client = args.server.connect().await?;
    let source = args.source();
    let request = ComputeToolProposalRequest { source: Some(source.clone()) };
    let proposal = match client.tools().compute_tool_proposal(request).await {
        Ok(answer) => answer.into_inner().proposal.unwrap_or_default(),
        Err(status) if status.code() == Code::FailedPrecondition => {
            tell(&format!("{}: {}\n", Style::stderr().bad("nothing learnt"), status.message()));
            return Ok(ExitCode::from(EXIT_REFUSED));
        }
        Err(status) => return Err(client.failed(&status)),
    };
    match args.format {
        Format::Json => print_json(&proposal)?,
        Format::Text => print(&text(&proposal, Style::stdout()))?,
    }
    if !args.adopt {
        if matches!(args.format, Format::Text) {
            tell(&format!("nothing was changed; --adopt writes this into {}\n", proposal.tool));
        }
        return Ok(ExitCode::SUCCESS);
    }
    let request = AdoptToolProposalRequest { source: Some(source), digest: proposal.digest };
    let adopted = client.tools().adopt_tool_proposal(request).await.map_err(|status| client.failed(&status))?;
    let tool = adopted.into_inner().tool.unwrap_or_default();
    tell(&format!("adopted: {} has what was learnt, etag {}\n", tool.name, tool.etag));
    Ok(ExitCode::SUCCESS)
}

/// The proposal for people.
fn text(proposal: &ToolProposal, style: Style) -> String {
    let mut text = format!("{}\n", style.bold(&format!("Learnt for {}", proposal.tool)));
    let _ = writeln!(text, "{:<34}  {:>12}  {:>12}  {:>27}", "", "value", "standard error", "95 % interval");
    let mut row = |name: &str, estimate: Option<&Estimate>| {
        let Some(Estimate { value, standard_error, lower, upper }) = estimate.copied() else { return };
        let [value, error, lower, upper] = [value, standard_error, lower, upper].map(|it| number(it, 5));
        // Writing into a string does not fail.
        let _ = writeln!(text, "{name:<34}  {value:>12}  {error:>14}  {:>27}", format!("{lower} to {upper}"));
    };
    row("K_tc tangential, N/mm²", proposal.tangential_n_per_mm2.as_ref());
    row("K_te tangential of the edge, N/mm", proposal.edge_tangential_n_per_mm.as_ref());
    row("K_rc radial, N/mm²", proposal.radial_n_per_mm2.as_ref());
    row("K_re radial of the edge, N/mm", proposal.edge_radial_n_per_mm.as_ref());
    row("run-out of the edges, mm", proposal.edge_run_out_mm.as_ref());
    row("run-out of the surface, mm", proposal.run_out_mm.as_ref());
    for (name, learnt, is_dominant) in
        [("X", proposal.mode_x, proposal.is_x_dominant), ("Y", proposal.mode_y, !proposal.is_x_dominant)]
    {
        let learnt = learnt.unwrap_or_default();
        let dominant = if is_dominant { " (dominant)" } else { "" };
        row(&format!("frequency in {name}{dominant}, Hz"), learnt.frequency_hz.as_ref());
        row(&format!("damping ratio in {name}"), learnt.damping_ratio.as_ref());
    }
    let (residual, factor) = (number(1e3 * proposal.residual_mm, 4), number(proposal.correlation_factor, 3));
    let _ = writeln!(
        text,
        "\n{} judged; what is left of the deflection: {residual} µm; standard errors widened {factor} times for its correlation",
        counted(proposal.samples, "sample")
    );
    records(&mut text, &proposal.records);
    dynamics(&mut text, proposal, style);
    if let Some(lobes) = &proposal.lobes {
        table(&mut text, &lobes.pockets, &proposal.present_pockets, style);
    }
    let _ = writeln!(text, "\nproposal {}", proposal.digest);
    text
}

fn records(text: &mut String, records: &[LearningRecord]) {
    let is_used = |record: &&LearningRecord| record.left_out() == LeftOut::Unspecified;
    let used = records.iter().filter(is_used).count();
    let _ = writeln!(text, "learnt from {} of {}:", used, counted(records.len() as u64, "recorded cut"));
    for record in records {
        let why = match record.left_out() {
            LeftOut::Unspecified => format!("{} mm deep", number(record.depth_mm, 5)),
            LeftOut::OtherLine => "left out: no depth was given for its line".to_owned(),
            LeftOut::TooShort => "left out: too short".to_owned(),
            LeftOut::Enough => "left out: others say as much".to_owned(),
            LeftOut::OtherSampleRate => "left out: another sample rate".to_owned(),
        };
        let missing = match record.missing_samples {
            0 => String::new(),
            missing => format!(" ({missing} missing)"),
        };
        let line = if record.line == 0 { "line unknown".to_owned() } else { format!("line {}", record.line) };
        let _ = writeln!(
            text,
            "  {} {}, {line}: {} mm/min, {} rev/min, {} samples{missing}; {why}",
            record.run,
            record.number,
            number(record.feed_mm_per_min, 5),
            number(record.spindle_rev_per_min, 5),
            record.samples,
        );
    }
}

/// The tool's dynamics as they are and as they would be.
fn dynamics(text: &mut String, proposal: &ToolProposal, style: Style) {
    let present = proposal.present_dynamics.clone().unwrap_or_default();
    let proposed = proposal.dynamics.clone().unwrap_or_default();
    let _ = writeln!(text, "\n{}", style.bold(&format!("Proposed for {}", proposal.tool)));
    let _ = writeln!(text, "{:<28}  {:>14}  {:>14}", "", "present", "proposed");
    let mut row = |name: &str, present: Option<f64>, proposed: Option<f64>| {
        let [present, proposed] = [present, proposed].map(|it| it.map_or_else(|| "-".to_owned(), |it| number(it, 5)));
        let _ = writeln!(text, "{name:<28}  {present:>14}  {proposed:>14}");
    };
    row("tangentialNPerMm2", present.tangential_n_per_mm2, proposed.tangential_n_per_mm2);
    row("radialRatio", present.radial_ratio, proposed.radial_ratio);
    row("edgeTangentialNPerMm", present.edge_tangential_n_per_mm, proposed.edge_tangential_n_per_mm);
    row("edgeRadialNPerMm", present.edge_radial_n_per_mm, proposed.edge_radial_n_per_mm);
    row("edgeRunOutMm", present.edge_run_out_mm, proposed.edge_run_out_mm);
    let modes = [("modesX", &present.modes_x, &proposed.modes_x), ("modesY", &present.modes_y, &proposed.modes_y)];
    for (name, present, proposed) in modes {
        let [present, proposed] = [present.first(), proposed.first()];
        let of = |of: fn(&VibrationMode) -> f64| [present.map(of), proposed.map(of)];
        let [a, b] = of(|mode| mode.frequency_hz);
        row(&format!("{name}.frequencyHz"), a, b);
        let [a, b] = of(|mode| mode.damping_ratio);
        row(&format!("{name}.dampingRatio"), a, b);
    }
}

/// The spindle table that would follow, beside the present one.
fn table(text: &mut String, proposed: &[StabilityPocket], present: &[StabilityPocket], style: Style) {
    let _ = writeln!(text, "\n{}", style.bold("Spindle table that would follow"));
    let head = ["current speed, rev/min", "new speed", "stable mm", "now new speed", "stable mm"];
    let _ = writeln!(text, "{:>24}  {:>12}  {:>10}  {:>13}  {:>10}", head[0], head[1], head[2], head[3], head[4]);
    let depth = |pocket: &StabilityPocket| pocket.stable_mm.map_or_else(|| "any".to_owned(), rounded_down);
    for (place, pocket) in proposed.iter().enumerate() {
        let band = pocket.band.unwrap_or_default();
        let range = format!("{:.1} to {:.1}", band.above_rev_per_min, band.up_to_rev_per_min);
        let now = present.get(place);
        let (speed, stable) = now.map_or_else(
            || ("-".to_owned(), "-".to_owned()),
            |now| (format!("{:.1}", now.band.unwrap_or_default().spindle_rev_per_min), depth(now)),
        );
        let _ = writeln!(
            text,
            "{range:>24}  {:>12.1}  {:>10}  {speed:>13}  {stable:>10}",
            band.spindle_rev_per_min,
            depth(pocket)
        );
    }
    let _ = writeln!(text, "monitoring keeps its table until it is set again (rules.spindle.milling.table_from)");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_are_lines_and_a_depth() {
        let cut_of = cut("3-7:0.5").unwrap();
        assert_eq!((cut_of.first_line, cut_of.last_line, cut_of.depth_mm), (3, 7, 0.5));
        assert_eq!(cut("4:2").unwrap().last_line, 4);
        for wrong in ["3", "3:", "0:1", "a:1", "3-:1"] {
            assert!(cut(wrong).is_err(), "{wrong}");
        }
    }
}
