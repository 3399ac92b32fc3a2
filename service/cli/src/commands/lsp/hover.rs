//! What is in force at a line: its actions as `feedwave interpret` shows them, then position, offset, feed, spindle and tool, and
//! when it runs.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};

use feedwave_contract::convert::action_to_proto;
use feedwave_contract::proto::{Action, ActionFeed, ActionSpindle};
use feedwave_cutting::{Interpretation, InterpretationStep, PipelineConfig};
use feedwave_program::{Outline, StretchKind};

use super::callers::{Callers, OWN_PROGRAM};
use super::document::Document;
use super::input::Input;
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
    let input = Input::of_main(document.text(), &mut setup.further);
    let place = Place::new(0, line + 1, document, &setup.config);
    let found = find(input, &setup.config, &place, withdrawn)?;
    let mut text = found.actions_text();
    text.push_str(&found.state.text(line + 1));
    let time = judged.filter(|judged| judged.version == document.version).and_then(|judged| {
        let time = judged.times.get(line as usize).filter(|time| time.takes_s > 0.0)?;
        let (start, takes, end) = (number(time.start_s, 6), number(time.takes_s, 4), number(time.end_s, 6));
        Some(format!("- time: from {start} s, takes {takes} s, until {end} s\n"))
    });
    text.push_str(&time.unwrap_or_default());
    (!text.is_empty()).then_some(text)
}

/// The same of a program that others call: what it does whatever calls it, and what is in force then.
pub(super) fn text_of_called(
    callers: &Callers,
    document: &Document,
    setup: &mut Setup,
    line: u32,
    withdrawn: &AtomicBool,
) -> Option<String> {
    let [one, other] = [0, 1].map(|caller| {
        let input = callers.inputs(document, &mut setup.further, caller);
        let place = Place::new(OWN_PROGRAM, line + 1, document, &callers.config);
        let mut found = find(input, &callers.config, &place, withdrawn)?;
        let own = &callers.config.programs[OWN_PROGRAM as usize - 1];
        let motion = found.state.motion.iter_mut();
        found.actions.iter_mut().chain(motion).filter(|action| action.file == *own).for_each(|it| it.file.clear());
        Some(found)
    });
    let (one, other) = (one?, other?);
    // Behind an error nothing is carried out, and so nothing is known.
    if one.is_broken || other.is_broken {
        return None;
    }
    let actions = Some(one.actions_text()).filter(|text| *text == other.actions_text());
    let depends = actions.is_none() || one.count > 0;
    let mut text = actions.unwrap_or_default();
    let axes = callers.config.profile.machine.axes.iter().map(|axis| axis.axis.letter().to_ascii_lowercase());
    text.push_str(&one.state.text_in_common(&other.state, line + 1, &axes.collect::<String>()));
    if depends {
        text.push_str("- all else depends on the program that calls this one\n");
    }
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

    /// What is the same in both, as Markdown, for a line counted from 1 and a machine with these axes.
    fn text_in_common(&self, other: &Self, line: u32, axes: &str) -> String {
        let mut text = String::new();
        if let (Some(motion), Some(also)) = (&self.motion, &other.motion) {
            let ends = [motion, also].map(|motion| motion.end.unwrap_or_default());
            let axes = interpret::axes_in_common(&ends, axes);
            if !axes.is_empty() {
                let is_same = (&motion.file, motion.line) == (&also.file, also.line);
                let since = if is_same { since(motion, line) } else { String::new() };
                let _ = writeln!(text, "- position{since}: {axes} mm, X a radius");
            }
        }
        if let Some(feed) = self.feed.as_ref().filter(|feed| Some(*feed) == other.feed.as_ref()) {
            let _ = writeln!(text, "- feed: {}", interpret::feed_text(feed));
        }
        if let Some(spindle) = self.spindle.as_ref().filter(|spindle| Some(*spindle) == other.spindle.as_ref()) {
            let _ = writeln!(text, "- spindle: {}", interpret::spindle_text(spindle));
        }
        if self.tool > 0 && self.tool == other.tool {
            let _ = writeln!(text, "- tool: T{}", self.tool);
        }
        text
    }

    /// As Markdown, for a line counted from 1.
    fn text(&self, line: u32) -> String {
        let mut text = String::new();
        if let Some(motion) = &self.motion {
            let place = since(motion, line);
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

/// Where a position comes from, when that is not the line itself.
fn since(motion: &Action, line: u32) -> String {
    match (motion.file.as_str(), motion.line) {
        ("", own) if own == line => String::new(),
        ("", other) => format!(" (since line {other})"),
        (file, other) => format!(" (since line {other} of {file})"),
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
    /// It has none, and the program has an error.
    is_broken: bool,
    /// What is in force behind it.
    state: State,
}

impl Found {
    /// The actions as Markdown.
    fn actions_text(&self) -> String {
        let mut text = String::new();
        if self.actions.is_empty() {
            return text;
        }
        text.push_str("```text\n");
        for action in self.actions.iter().take(MAX_SHOWN) {
            let _ = writeln!(text, "{}", interpret::text(action).trim_start());
        }
        text.push_str("```\n");
        let more = self.count.saturating_sub(MAX_SHOWN);
        if more > 0 {
            let _ = writeln!(text, "and {more}{} further actions\n", if self.is_cut { " or more" } else { "" });
        }
        text
    }
}

/// The line that is asked about.
struct Place {
    /// The program that it is in.
    program: u32,
    /// Counted from 1.
    line: u32,
    /// First and last line of the numbered program or subprogram around it: other lines are not next to it.
    within: [u32; 2],
    /// First and last lines of the loops that it is not in.
    other_loops: Vec<[u32; 2]>,
}

impl Place {
    fn new(program: u32, line: u32, document: &Document, config: &PipelineConfig) -> Self {
        let outline = Outline::read(document.text().as_bytes(), &config.profile.language);
        let programs = outline.stretches.iter().filter(|stretch| {
            matches!(stretch.kind, StretchKind::Program | StretchKind::Subprogram)
                && stretch.first_line <= stretch.last_line
        });
        let mut within = [1, u32::MAX];
        for stretch in programs {
            let [first, last] = [stretch.first_line, stretch.last_line];
            // Ascending by their first lines, so that the last one around the line is the innermost.
            if (first..=last).contains(&line) {
                within = [first, last];
            } else if first > line {
                within[1] = within[1].min(first - 1);
            } else if last >= within[0] {
                within[0] = last + 1;
            }
        }
        let loops = outline.stretches.iter().filter(|stretch| stretch.kind == StretchKind::Block);
        let loops = loops.map(|stretch| [stretch.first_line, stretch.last_line]);
        let other_loops = loops.filter(|[first, last]| !(*first..=*last).contains(&line)).collect();
        Self { program, line, within, other_loops }
    }
}

/// A run of a line that is over.
struct Run {
    /// What is in force behind it.
    state: State,
    /// The line that is carried out behind it, if it is of the same program.
    next: Option<u32>,
}

/// What is in force next to a line without actions, by the lines around it that have some.
#[derive(Default)]
struct Neighbours {
    /// The nearest line before it, and its first run; `None` while that lasts.
    before: Option<(u32, Option<Run>)>,
    /// The nearest line behind it, and what is in force before its first run.
    behind: Option<(u32, State)>,
    /// The line behind it was run before any other.
    is_behind_first: bool,
}

impl Neighbours {
    /// Takes the line of the next action, if it is of the same program, with what is in force before that.
    fn follow(&mut self, place: &Place, own: Option<u32>, state: &State) {
        if let Some((line, run @ None)) = &mut self.before
            && own != Some(*line)
        {
            *run = Some(Run { state: state.clone(), next: own });
        }
        let Some(own) = own.filter(|own| (place.within[0]..=place.within[1]).contains(own)) else { return };
        if let Some((line, run @ Some(_))) = &mut self.before
            && *line == own
            && self.behind.is_none()
            && place.other_loops.iter().any(|[first, last]| (*first..=*last).contains(&own))
        {
            // The line comes behind the last run of a loop before it.
            *run = None;
        }
        if own < place.line && self.before.as_ref().is_none_or(|&(nearest, _)| own > nearest) {
            self.is_behind_first = self.behind.is_some();
            self.before = Some((own, None));
        }
        if own > place.line && self.behind.as_ref().is_none_or(|&(nearest, _)| own < nearest) {
            self.behind = Some((own, state.clone()));
        }
    }

    /// What is in force at the line: behind the line before it, unless the program came to the line behind it another way, jumped
    /// over both or called another one.
    fn state(self, end: State) -> State {
        let Self { before, behind, is_behind_first } = self;
        let before = before.map(|(_, run)| run.unwrap_or_else(|| Run { state: end.clone(), next: None }));
        match (before, behind) {
            (Some(run), None) => run.state,
            (Some(run), Some((nearest, _))) if !is_behind_first && run.next.is_some_and(|next| next <= nearest) => {
                run.state
            }
            (_, Some((_, state))) => state,
            (None, None) => end,
        }
    }
}

/// Reads a program up to the first run of a line.
fn find(mut input: Input<'_>, config: &PipelineConfig, place: &Place, withdrawn: &AtomicBool) -> Option<Found> {
    let mut interpretation = Interpretation::new(config);
    let mut found = Found::default();
    let mut neighbours = Neighbours::default();
    for _ in 0..MAX_STEPS {
        if withdrawn.load(Ordering::Relaxed) {
            return None;
        }
        let step = input.step(&mut interpretation);
        for operation in interpretation.take_operations() {
            let own_line = Some(operation.span.line).filter(|_| operation.span.program == place.program);
            let is_here = own_line == Some(place.line);
            if !is_here && found.count > 0 {
                return Some(found);
            }
            let action = action_to_proto(&operation, &config.programs);
            if is_here {
                found.count += 1;
                if found.actions.len() < MAX_SHOWN {
                    found.actions.push(action.clone());
                }
                if found.count >= MAX_COUNTED {
                    found.is_cut = true;
                    return Some(found);
                }
            } else {
                neighbours.follow(place, own_line, &found.state);
            }
            found.state.follow(&action);
        }
        if matches!(step, None | Some(InterpretationStep::Ended)) {
            break;
        }
    }
    found.is_broken = found.count == 0 && interpretation.findings().has_errors();
    if found.count == 0 {
        found.state = neighbours.state(found.state);
    }
    Some(found)
}
