//! `feedwave interpret`: the actions of a program, fully resolved.

use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use feedwave_contract::convert::{action_to_proto, finding_to_proto};
use feedwave_contract::json;
use feedwave_contract::proto::{
    Action, ActionFeed, ActionFeedMode, ActionKind, ActionPlane, ActionSpindle, ActionSpindleDirection, AxisPosition,
};
use feedwave_cutting::{Frame, Interpretation, InterpretationStep};
use feedwave_program::Severity;

use super::machine::MachineArgs;
use super::source::IncludeArgs;
use super::terminal::{Style, tell};
use super::{CliError, EXIT_REFUSED, findings};

/// Arguments of `feedwave interpret`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "Exit codes: 0 read to its end, 1 errors found, 2 wrong usage or unreadable file.

Examples:
  feedwave interpret shaft.nc
      One line for each action; findings on standard error.
  feedwave interpret --machine-kind mill pocket.ngc --include subs --format jsonl | jq -c '[.line, .end]'
      For scripts: one feedwave.v1.Action of the contract on each line, as Programs.Interpret answers it.
      Lengths are mm and X is a radius, whatever the program writes.")]
pub struct Args {
    /// The program; `-` reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    include: IncludeArgs,
    #[command(flatten)]
    machine: MachineArgs,
    /// Form of the actions
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

/// Form of the actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people
    Text,
    /// One JSON object on each line: the message of the service's contract
    Jsonl,
}

/// Bytes written at once: few enough for the caches, so that nothing waits for memory.
const WRITTEN_AT_ONCE: usize = 64 << 10;

/// Shows them.
///
/// # Errors
/// [`CliError`] when the program or the profile cannot be read.
pub(super) fn run(args: Args) -> Result<ExitCode, CliError> {
    let mut source = args.include.open(&args.file)?;
    let config = args.machine.config(Frame::Work, source.further_names())?;
    let mut interpretation = Interpretation::new(&config);
    let mut output = io::stdout().lock();
    let failed = |error: io::Error| CliError::written("standard output", &error);
    let (mut lines, mut actions) = (Vec::new(), json::Actions::default());
    loop {
        let step = interpretation.step();
        for operation in interpretation.take_operations() {
            let action = action_to_proto(&operation, &config.programs);
            match args.format {
                Format::Text => lines.extend_from_slice(text(&action).as_bytes()),
                Format::Jsonl => actions.append(action, &mut lines),
            }
            lines.push(b'\n');
            if lines.len() >= WRITTEN_AT_ONCE {
                output.write_all(&lines).map_err(failed)?;
                lines.clear();
            }
        }
        output.write_all(&lines).map_err(failed)?;
        lines.clear();
        match step {
            InterpretationStep::More => {}
            InterpretationStep::Ended => break,
            InterpretationStep::NeedInput(place) => match source.read(place)? {
                [] => interpretation.finish_input(),
                piece => interpretation.push(piece),
            },
        }
    }
    output.flush().map_err(failed)?;
    drop(output);
    let log = interpretation.into_findings();
    let (refused, dropped) = (log.count(Severity::Error) > 0, log.dropped());
    let found: Vec<_> = log.into_sorted().iter().map(|finding| finding_to_proto(finding, &config.programs)).collect();
    tell(&findings::text(&found, &mut source, Style::stderr())?);
    if dropped > 0 {
        tell(&format!("{dropped} further findings are not listed\n"));
    }
    Ok(if refused { ExitCode::from(EXIT_REFUSED) } else { ExitCode::SUCCESS })
}

/// An action for people.
pub(super) fn text(action: &Action) -> String {
    let place =
        if action.file.is_empty() { action.line.to_string() } else { format!("{}:{}", action.file, action.line) };
    let kind = action.kind().as_str_name().trim_start_matches("ACTION_KIND_").to_lowercase().replace('_', " ");
    let mut line = format!("{place:>6}  {kind:<13}");
    if let (Some(end), Some(start)) = (&action.end, &action.start) {
        line.push_str(&axes(end, start));
    }
    if let Some(arc) = &action.arc {
        let names = match action.plane() {
            ActionPlane::Zx => ['z', 'x'],
            ActionPlane::Yz => ['y', 'z'],
            _ => ['x', 'y'],
        };
        let sense = if arc.clockwise { "clockwise" } else { "counter-clockwise" };
        let [first, second] = names;
        line.push_str(&format!(
            "  centre {first}{} {second}{}, {sense} {} deg",
            number(arc.center_first),
            number(arc.center_second),
            number(arc.sweep_deg.abs())
        ));
    }
    if let Some(spline) = &action.spline {
        line.push_str(&format!("  order {} with {} points", spline.order, spline.first.len()));
    }
    if let Some(thread) = &action.thread {
        line.push_str(&format!("  lead {} mm", number(thread.lead_mm)));
    }
    if let Some(feed) = &action.feed {
        line.push_str(&format!("  {}", feed_text(feed)));
    }
    if let Some(spindle) = action.spindle.as_ref().filter(|_| action.kind() != ActionKind::Rapid) {
        line.push_str(&format!("  {}", spindle_text(spindle)));
    }
    if action.tool > 0 {
        line.push_str(&format!("  T{}", action.tool));
    }
    rest(action, &mut line);
    line.trim_end().to_owned()
}

/// What is no motion.
fn rest(action: &Action, line: &mut String) {
    if let Some(seconds) = action.dwell_s {
        line.push_str(&format!("{} s", number(seconds)));
    }
    if let Some(revolutions) = action.dwell_rev {
        line.push_str(&format!("{} rev", number(revolutions)));
    }
    if let Some(coolant) = &action.coolant {
        let on = |name: &str, on: bool| format!("{name} {}", if on { "on" } else { "off" });
        line.push_str(&format!("{}, {}", on("mist", coolant.mist), on("flood", coolant.flood)));
    }
    if let Some(function) = &action.function {
        line.push_str(&format!("{} {}", function.name, if function.on { "on" } else { "off" }));
    }
    if let Some(code) = &action.machine_code {
        // Behind how long it takes, where it does.
        let between = if line.ends_with(' ') { "" } else { "  " };
        line.push_str(&format!("{between}M{}", code.number));
    }
    let words = action.function.as_ref().map(|function| &function.words);
    for word in words.or(action.machine_code.as_ref().map(|code| &code.words)).into_iter().flatten() {
        line.push_str(&format!(" {}{}", word.letter, number(word.value)));
    }
}

/// A feed as a program writes it, with its unit.
pub(super) fn feed_text(feed: &ActionFeed) -> String {
    let unit = match feed.mode() {
        ActionFeedMode::PerRevolution => "/rev",
        ActionFeedMode::InverseTime => " 1/min",
        _ => "/min",
    };
    format!("F{}{unit}", number(feed.value))
}

/// A spindle as a program writes it.
pub(super) fn spindle_text(spindle: &ActionSpindle) -> String {
    let sense = match spindle.direction() {
        ActionSpindleDirection::Clockwise => "M3",
        ActionSpindleDirection::CounterClockwise => "M4",
        _ => return "M5".to_owned(),
    };
    match (spindle.rev_per_min, spindle.surface_m_per_min) {
        (Some(speed), _) => format!("{sense} S{}", number(speed)),
        (None, Some(speed)) => format!("{sense} {} m/min", number(speed)),
        (None, None) => sense.to_owned(),
    }
}

/// The letters of the axes, in the order of [`values`].
const LETTERS: &str = "xyzabcuvw";

const fn values(at: &AxisPosition) -> [f64; 9] {
    [at.x, at.y, at.z, at.a, at.b, at.c, at.u, at.v, at.w]
}

/// Those of some axes that are at the same place in both positions.
pub(super) fn axes_in_common([one, other]: &[AxisPosition; 2], axes: &str) -> String {
    let places = LETTERS.chars().zip(values(one)).zip(values(other));
    let shown = places.filter(|((letter, one), other)| one == other && axes.contains(*letter));
    shown.map(|((letter, at), _)| format!("{letter}{}", number(at))).collect::<Vec<_>>().join(" ")
}

/// X, Y and Z of the end, and the other axes where they move or are away from 0.
pub(super) fn axes(end: &AxisPosition, start: &AxisPosition) -> String {
    let places = LETTERS.chars().zip(values(end)).zip(values(start)).enumerate();
    let shown = places.filter(|(index, ((_, end), start))| *index < 3 || *end != 0.0 || *start != 0.0);
    let shown: Vec<_> = shown.map(|(_, ((letter, end), _))| format!("{letter}{}", number(end))).collect();
    shown.join(" ")
}

/// A number for people: no more than a millionth, without trailing zeros.
fn number(value: f64) -> f64 {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 { 0.0 } else { rounded }
}
