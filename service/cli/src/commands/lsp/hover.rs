//! What is in force at a line: its actions as `feedwave interpret` shows them, then position, offset, feed, spindle and tool, and
//! when it runs.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};

use feedwave_contract::convert::action_to_proto;
use feedwave_contract::proto::{Action, ActionFeed, ActionSpindle};
use feedwave_cutting::{Interpretation, InterpretationStep};

use super::document::Document;
use super::judge::Judgement;
use super::setup::Setup;
use crate::commands::interpret;
use crate::commands::terminal::number;

/// Most actions of a line that are shown.
const MAX_SHOWN: usize = 8;
/// Most actions of a line that are counted.
const MAX_COUNTED: usize = 10_000;
/// Most steps of the interpreter for one answer, each of some thousand lines.
const MAX_STEPS: u32 = 2_000;

/// What a line does, as Markdown; `line` is counted from 0. `None` where it does nothing and nothing is in force, or once the
/// question is withdrawn.
pub(super) fn text(
    document: &Document,
    setup: &mut Setup,
    judged: Option<&Judgement>,
    line: u32,
    withdrawn: &AtomicBool,
) -> Option<String> {
    let found = find(document, setup, line + 1, withdrawn)?;
    let mut text = String::new();
    if !found.actions.is_empty() {
        text.push_str("```text\n");
        for action in found.actions.iter().take(MAX_SHOWN) {
            let _ = writeln!(text, "{}", interpret::text(action).trim_start());
        }
        text.push_str("```\n");
        let more = found.count.saturating_sub(MAX_SHOWN);
        if more > 0 {
            let _ = writeln!(text, "and {more}{} further actions\n", if found.is_cut { " or more" } else { "" });
        }
    }
    text.push_str(&found.state.text(line + 1));
    let time = judged.filter(|judged| judged.version == document.version).and_then(|judged| {
        let time = judged.times.get(line as usize).filter(|time| time.takes_s > 0.0)?;
        let (start, takes, end) = (number(time.start_s, 6), number(time.takes_s, 4), number(time.end_s, 6));
        Some(format!("- time: from {start} s, takes {takes} s, until {end} s\n"))
    });
    text.push_str(&time.unwrap_or_default());
    (!text.is_empty()).then_some(text)
}

/// What is in force behind the actions so far.
#[derive(Clone, Default)]
struct State {
    /// The last motion.
    motion: Option<Action>,
    feed: Option<ActionFeed>,
    spindle: Option<ActionSpindle>,
    tool: u32,
}

impl State {
    fn follow(&mut self, action: &Action) {
        if action.end.is_some() {
            self.motion = Some(action.clone());
        }
        if action.feed.is_some() {
            self.feed.clone_from(&action.feed);
        }
        if action.spindle.is_some() {
            self.spindle.clone_from(&action.spindle);
        }
        if action.tool > 0 {
            self.tool = action.tool;
        }
    }

    /// As Markdown, for a line counted from 1.
    fn text(&self, line: u32) -> String {
        let mut text = String::new();
        if let Some(motion) = &self.motion {
            let place = match (motion.file.as_str(), motion.line) {
                ("", own) if own == line => String::new(),
                ("", other) => format!(" (since line {other})"),
                (file, other) => format!(" (since line {other} of {file})"),
            };
            let end = motion.end.unwrap_or_default();
            let _ = writeln!(text, "- position{place}: {} mm, X a radius", interpret::axes(&end, &end));
            if let (Some(machine), Some(offset)) = (&motion.machine_end, &motion.offset) {
                let _ = writeln!(text, "- machine: {}", interpret::axes(machine, machine));
                let _ = writeln!(text, "- offset: {}", interpret::axes(offset, offset));
            }
        }
        if let Some(feed) = &self.feed {
            let _ = writeln!(text, "- feed: {}", interpret::feed_text(feed));
        }
        if let Some(spindle) = &self.spindle {
            let _ = writeln!(text, "- spindle: {}", interpret::spindle_text(spindle));
        }
        if self.tool > 0 {
            let _ = writeln!(text, "- tool: T{}", self.tool);
        }
        text
    }
}

/// What was found of a line.
#[derive(Default)]
struct Found {
    /// The first actions of the line.
    actions: Vec<Action>,
    /// How many it has.
    count: usize,
    /// There are more than are counted.
    is_cut: bool,
    /// What is in force behind it.
    state: State,
}

/// Reads the program up to the first run of a line, counted from 1.
fn find(document: &Document, setup: &mut Setup, line: u32, withdrawn: &AtomicBool) -> Option<Found> {
    let mut interpretation = Interpretation::new(&setup.config);
    let mut found = Found::default();
    // Of a line without actions: what is in force before the first run of the nearest line behind it that has some.
    let mut behind: Option<(u32, State)> = None;
    for _ in 0..MAX_STEPS {
        if withdrawn.load(Ordering::Relaxed) {
            return None;
        }
        let step = interpretation.step();
        for operation in interpretation.take_operations() {
            let own_line = Some(operation.span.line).filter(|_| operation.span.program == 0);
            let is_here = own_line == Some(line);
            if !is_here && found.count > 0 {
                return Some(found);
            }
            let action = action_to_proto(&operation, &setup.config.programs);
            if is_here {
                found.count += 1;
                if found.actions.len() < MAX_SHOWN {
                    found.actions.push(action.clone());
                }
                if found.count >= MAX_COUNTED {
                    found.is_cut = true;
                    return Some(found);
                }
            } else if let Some(own) = own_line.filter(|&own| own > line)
                && behind.as_ref().is_none_or(|&(nearest, _)| own < nearest)
            {
                behind = Some((own, found.state.clone()));
            }
            found.state.follow(&action);
        }
        match step {
            InterpretationStep::More => {}
            InterpretationStep::Ended => break,
            InterpretationStep::NeedInput(place) if place.program == 0 => {
                interpretation.supply(place, document.text().as_bytes());
            }
            InterpretationStep::NeedInput(place) => match setup.further.read(place) {
                Ok([]) => interpretation.finish_input(),
                Ok(piece) => interpretation.push(piece),
                Err(_) => break,
            },
        }
    }
    if let Some((_, state)) = behind.filter(|_| found.count == 0) {
        found.state = state;
    }
    Some(found)
}
