//! `feedwave robustness`: how surely chips break and cuts are stable, with values known within tolerances only.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use feedwave_contract::convert::{report_to_proto, stability_chart};
use feedwave_cutting::{
    ChipRobustness, CutCondition, CutTolerances, FeedCoupling, Frame, SectionReport, chip_robustness,
};
use feedwave_monitoring::{StabilityRobustness, stability_robustness};
use feedwave_plot::{RobustnessPicture, write_robustness};

use super::machine::MachineArgs;
use super::source::IncludeArgs;
use super::stability::{StabilityArgs, percent};
use super::terminal::{Style, number, print, tell};
use super::{CliError, EXIT_REFUSED, local, report};
use crate::output::OutputFile;

/// Speeds and feeds of a map.
const MAP_SPEEDS: u32 = 401;
const MAP_FEEDS: u32 = 100;
/// By which share the speeds of a map differ from the programmed one.
const MAP_SPEED_SHARE: f64 = 0.25;
/// Largest feed of a map, as a multiple of the programmed one.
const MAP_FEED_RATIO: f64 = 2.0;

/// Spindle speeds in rev/min, ascending, with the limit of stability in mm, `None` where nothing chatters.
type Chart = Vec<(f64, Option<f64>)>;

/// Arguments of `feedwave robustness`.
#[derive(Debug, clap::Args)]
#[command(
    after_long_help = "Exit codes: 0 every chip breaks, and every cut is stable, for all values within the tolerances, but for the ends of a vibration and
corners on at most a hundredth of its length; 1 errors found, or not so; 2 wrong usage or unreadable file.

Examples:
  feedwave robustness shaft.nc
  feedwave robustness shaft.nc --speed-tolerance 3 --feed-tolerance 20 --out maps
      With a map of speed and feed for each section, as picture and CSV.
  feedwave lobes --turning --mode-normal 250,0.04,8000 --specific 2000 --lowest-rev-per-min 500 \\
      --highest-rev-per-min 4000 --format json > lobes.json
  feedwave robustness shaft.nc --lobes lobes.json --depth 1.5"
)]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    machine: MachineArgs,
    #[command(flatten)]
    include: IncludeArgs,
    /// By how many per cent the spindle may be slower or faster than programmed
    #[arg(long, value_name = "PERCENT", default_value = "2", value_parser = percent)]
    speed_tolerance: f64,
    /// By how many per cent the feed of a revolution may be smaller or larger
    #[arg(long, value_name = "PERCENT", default_value = "5", value_parser = percent)]
    feed_tolerance: f64,
    /// By how many per cent the amplitude that arrives may be smaller or larger
    #[arg(long, value_name = "PERCENT", default_value = "10", value_parser = percent)]
    amplitude_tolerance: f64,
    #[command(flatten)]
    stability: StabilityArgs,
    /// Directory for a map of each section: a picture, and its values as CSV
    #[arg(long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
}

impl Args {
    const fn tolerances(&self) -> CutTolerances {
        CutTolerances { speed: self.speed_tolerance, feed: self.feed_tolerance, amplitude: self.amplitude_tolerance }
    }

    /// Limits of stability over the speed.
    fn chart(&self) -> Result<Option<Chart>, CliError> {
        Ok(self.stability.read()?.map(|lobes| stability_chart(&lobes).collect()))
    }
}

/// What is said of one section.
struct Judged {
    first_line: u32,
    last_line: u32,
    /// As programmed.
    amplitude_mm: f64,
    /// What keeps a part of it from the chip.
    lost_to: &'static str,
    /// Its worst cut; `None` where nothing of it can be judged so.
    cut: Option<(CutCondition, ChipRobustness)>,
    /// Why it is not judged, or not as a whole.
    gap: Option<String>,
    /// What its corners leave whole on so little of the length that it is no fault.
    corners: Option<String>,
    stability: Option<StabilityRobustness>,
    /// Lobes are given, and do not have its speeds.
    beyond_lobes: bool,
}

impl Judged {
    fn holds(&self) -> bool {
        let chip = self.gap.is_none() && self.cut.is_some_and(|(_, chip)| chip.worst_margin >= 1.0);
        let stable = self.stability.is_none_or(|it| it.worst_margin.is_none_or(|margin| margin >= 1.0));
        chip && stable && !self.beyond_lobes
    }
}

/// Judges it.
///
/// # Errors
/// [`CliError`] when a file cannot be read or written.
pub(super) fn run(args: &Args) -> Result<ExitCode, CliError> {
    let chart = args.chart()?;
    let mut source = args.include.open(&args.file)?;
    let config = args.machine.config(Frame::Machine, source.further_names())?;
    let validated = local::validate(&mut source, Arc::clone(&config), |_| {})?;
    if !validated.is_accepted() {
        print(&report::text(&report_to_proto(&validated), &mut source, Style::stdout())?)?;
        return Ok(ExitCode::from(EXIT_REFUSED));
    }
    let judged: Vec<Judged> = validated.sections.iter().map(|section| judge(section, args, chart.as_deref())).collect();
    let not_listed = validated.summary.section_count.saturating_sub(judged.len() as u64);
    print(&text(&judged, not_listed, args))?;
    if let Some(directory) = &args.out {
        let mut files = 0;
        for section in &judged {
            files += write_map(section, args, chart.as_deref(), directory)?;
        }
        tell(&format!("wrote {files} files into {}\n", directory.display()));
    }
    let holds = not_listed == 0 && judged.iter().all(Judged::holds);
    Ok(if holds { ExitCode::SUCCESS } else { ExitCode::from(EXIT_REFUSED) })
}

fn judge(section: &SectionReport, args: &Args, chart: Option<&[(f64, Option<f64>)]>) -> Judged {
    let arriving = section.reached_share(1.0) * section.followed_share();
    let coupling = section.chip.as_ref().map_or(FeedCoupling::PerRevolution, |chip| chip.condition.feed_coupling);
    let cuts = section.chip_spans.iter().map(|span| CutCondition {
        feed_per_rev_mm: span.feed_per_rev_mm,
        amplitude_mm: section.condition.amplitude_mm * arriving,
        frequency_hz: section.condition.frequency_hz,
        spindle_rev_per_min: span.spindle_rev_per_min,
        diameter_mm: 0.0,
        feed_coupling: coupling,
    });
    let robust = cuts.map(|cut| (cut, chip_robustness(&cut, &args.tolerances())));
    let worst =
        robust.min_by(|(_, a), (_, b)| a.worst_margin.total_cmp(&b.worst_margin).then(a.share.total_cmp(&b.share)));
    let gap = gap(section, worst.is_none());
    let corners = section.longest_between_blends().filter(|_| gap.is_none()).map(|(line, revolutions)| {
        format!(
            "but at corners, on at most a hundredth of the length: whole for up to {} revolutions, from line {line} on",
            number(revolutions, 3)
        )
    });
    let depth = args.stability.depth.unwrap_or_default();
    let stable = |chart: &[(f64, Option<f64>)]| {
        let of = section.chip_spans.iter().map(|span| {
            stability_robustness(
                chart,
                span.spindle_rev_per_min,
                args.speed_tolerance,
                depth,
                args.stability.depth_tolerance,
            )
        });
        of.collect::<Option<Vec<_>>>()
    };
    let stability = chart.map(stable);
    let margin = |it: &StabilityRobustness| it.worst_margin.unwrap_or(f64::INFINITY);
    Judged {
        first_line: section.first_line,
        last_line: section.last_line,
        amplitude_mm: section.condition.amplitude_mm,
        lost_to: match (section.reached_share(1.0) < 1.0, section.followed_share() < 1.0) {
            (true, true) => "its blends and the drives",
            (false, true) => "the drives",
            _ => "its blends",
        },
        cut: worst,
        gap,
        corners,
        beyond_lobes: stability == Some(None),
        stability: stability.flatten().and_then(|all| all.into_iter().min_by(|a, b| margin(a).total_cmp(&margin(b)))),
    }
}

/// Why a section is not judged, or not as a whole.
fn gap(section: &SectionReport, nothing_is_cut: bool) -> Option<String> {
    let changing = section.surface_speed.as_ref().filter(|it| it.length_mm > 0.0);
    if let Some(surface) = changing {
        let [slowest, fastest] = surface.spindle_rev_per_min.map(|speed| number(speed, 5));
        return Some(format!(
            "parts at constant surface speed are not judged on which the spindle turns at {slowest} to {fastest} rev/min: D changes along \
             the path"
        ));
    }
    match () {
        () if section.chip_spans_not_listed > 0 => {
            Some("it has more cuts than are listed; further ones are not judged".to_owned())
        }
        () if section.unbroken_between_blends().is_some() => Some(
            "where the vibration is blended out and in at corners, the chip stays whole for a revolution or more"
                .to_owned(),
        ),
        () if nothing_is_cut => Some("nothing is cut with a turning spindle".to_owned()),
        () => None,
    }
}

fn text(judged: &[Judged], not_listed: u64, args: &Args) -> String {
    let share = |share: f64| format!("{} %", number((1e5 * share).floor() / 1e3, 5));
    let mut text = format!(
        "tolerances: spindle speed {} %, feed {} %, amplitude {} %\n",
        number(100.0 * args.speed_tolerance, 3),
        number(100.0 * args.feed_tolerance, 3),
        number(100.0 * args.amplitude_tolerance, 3)
    );
    if judged.is_empty() {
        text.push_str("no section vibrates along the path: there is nothing to judge\n");
    }
    for section in judged {
        let _ = writeln!(text, "\nlines {} to {}", section.first_line, section.last_line);
        if let Some((cut, chip)) = &section.cut {
            let blended = if cut.amplitude_mm < section.amplitude_mm {
                format!(" of {} mm, which {} let through", number(section.amplitude_mm, 4), section.lost_to)
            } else {
                String::new()
            };
            let _ = writeln!(
                text,
                "  worst cut: {} rev/min, {} mm/rev, {} Hz, {} mm{blended}: D = {}",
                number(cut.spindle_rev_per_min, 6),
                number(cut.feed_per_rev_mm, 4),
                number(cut.frequency_hz, 6),
                number(cut.amplitude_mm, 4),
                number(cut.vibrations_per_rev(), 6)
            );
            let verdict =
                if chip.worst_margin >= 1.0 { "breaks for all values" } else { "does not break for all values" };
            let _ = writeln!(
                text,
                "  chip: {verdict}: margin {} as programmed, {} at worst; it breaks for {} of the values, and for all up to {} mm/rev",
                number(chip.margin, 4),
                number(chip.worst_margin, 4),
                share(chip.share),
                number(chip.largest_feed_per_rev_mm, 4)
            );
        }
        for said in section.gap.iter().chain(&section.corners) {
            let _ = writeln!(text, "  {said}");
        }
        if section.beyond_lobes {
            text.push_str("  stability: not judged, as the lobes do not have all speeds within the tolerance\n");
        }
        if let Some(stability) = &section.stability {
            let _ = match (stability.least_limit_mm, stability.worst_margin) {
                (Some(limit), Some(margin)) => writeln!(
                    text,
                    "  stability: limit {} mm at worst, {} times the largest depth; stable for {} of the values",
                    number(limit, 4),
                    number(margin, 4),
                    share(stability.share)
                ),
                _ => writeln!(text, "  stability: nothing chatters at any speed within the tolerance"),
            };
        }
    }
    if not_listed > 0 {
        let _ = writeln!(text, "\n{not_listed} further sections are not judged");
    }
    text
}

/// The stability limit at worst by the largest depth, at a spindle speed; infinite where nothing chatters, `None` where the lobes do not
/// have all speeds within the tolerance.
fn stability_margin(chart: &[(f64, Option<f64>)], spindle_rev_per_min: f64, args: &Args) -> Option<f64> {
    let depth = args.stability.depth.unwrap_or_default();
    let judged =
        stability_robustness(chart, spindle_rev_per_min, args.speed_tolerance, depth, args.stability.depth_tolerance)?;
    Some(judged.worst_margin.unwrap_or(f64::INFINITY))
}

/// The map of a section as CSV and pictures; how many files were written.
fn write_map(
    section: &Judged,
    args: &Args,
    chart: Option<&[(f64, Option<f64>)]>,
    directory: &Path,
) -> Result<u32, CliError> {
    let Some((cut, _)) = &section.cut else { return Ok(0) };
    std::fs::create_dir_all(directory).map_err(|error| CliError::file(directory, &error))?;
    let tolerances = args.tolerances();
    let speeds = (0..MAP_SPEEDS).map(|step| {
        let place = f64::from(step) / f64::from(MAP_SPEEDS - 1);
        cut.spindle_rev_per_min * (1.0 - MAP_SPEED_SHARE + 2.0 * MAP_SPEED_SHARE * place)
    });
    let largest_feed_mm = MAP_FEED_RATIO * cut.feed_per_rev_mm;
    let (mut limit, mut safe) = (Vec::new(), Vec::new());
    let mut csv = String::from("spindle_rev_per_min,feed_mm_per_rev,margin,worst_margin,stability_margin,safe\n");
    for spindle_rev_per_min in speeds {
        let at = CutCondition { spindle_rev_per_min, ..*cut };
        let figures = worst_and_margin(&at, &tolerances);
        limit.push((spindle_rev_per_min, figures[0] * cut.feed_per_rev_mm));
        safe.push((spindle_rev_per_min, figures[1] * cut.feed_per_rev_mm));
        let stability_margin = chart.map(|chart| stability_margin(chart, spindle_rev_per_min, args));
        // What is not judged is not safe.
        let is_stable = stability_margin.is_none_or(|margin| margin.is_some_and(|margin| margin >= 1.0));
        let may_be_safe = is_stable && section.gap.is_none();
        let stability = stability_margin.flatten().map_or_else(String::new, |margin| margin.to_string());
        for step in 1..=MAP_FEEDS {
            let feed_mm = largest_feed_mm * f64::from(step) / f64::from(MAP_FEEDS);
            let [margin, worst] = figures.map(|figure| figure * cut.feed_per_rev_mm / feed_mm);
            let is_safe = u8::from(may_be_safe && worst >= 1.0);
            let _ = writeln!(csv, "{spindle_rev_per_min},{feed_mm},{margin},{worst},{stability},{is_safe}");
        }
    }
    let name = format!("robustness-line-{}", section.first_line);
    let path = directory.join(format!("{name}.csv"));
    OutputFile::write_whole(&path, csv.as_bytes()).map_err(|error| CliError::file(&path, &error))?;
    let stability = chart.zip(args.stability.depth).map(|(chart, depth)| {
        let [first, last] = [limit[0].0, limit[limit.len() - 1].0];
        let inside = chart.iter().filter(|(speed, _)| (first..=last).contains(speed));
        let curve = inside.map(|(speed, limit)| (*speed, limit.unwrap_or(f64::NAN))).collect();
        (curve, [depth * (1.0 - args.stability.depth_tolerance), depth * (1.0 + args.stability.depth_tolerance)])
    });
    let picture = RobustnessPicture {
        subtitle: format!(
            "lines {} to {} \u{b7} {} Hz, amplitude {} mm \u{b7} speed \u{b1} {} %, feed \u{b1} {} %, amplitude \u{b1} {} %",
            section.first_line,
            section.last_line,
            number(cut.frequency_hz, 6),
            number(cut.amplitude_mm, 4),
            number(100.0 * tolerances.speed, 3),
            number(100.0 * tolerances.feed, 3),
            number(100.0 * tolerances.amplitude, 3)
        ),
        name,
        limit,
        safe,
        programmed: (cut.spindle_rev_per_min, cut.feed_per_rev_mm),
        largest_feed_mm,
        stability,
    };
    let files = write_robustness(&picture, directory).map_err(CliError::trouble)?;
    Ok(1 + files.len() as u32)
}

/// The margin as programmed, and the least within the tolerances.
fn worst_and_margin(cut: &CutCondition, tolerances: &CutTolerances) -> [f64; 2] {
    let chip = chip_robustness(cut, tolerances);
    [chip.margin, chip.worst_margin]
}
