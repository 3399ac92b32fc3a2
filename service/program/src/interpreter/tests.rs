//! Tests of the interpreter through one [`check`]: program text in, one line per operation and finding out.

mod arcs;
mod arcs_of_linuxcnc;
mod code_replacements;
mod consequences;
mod controls;
mod coordinates;
mod corners;
mod doubt;
mod drilling;
mod dwell;
mod flow;
mod foreign_files;
mod framing;
mod hostile;
mod language;
mod length;
mod lines_of_linuxcnc;
mod machine_codes;
mod misread;
mod one_cause;
mod order;
mod parameters;
mod path_control;
mod polar_words;
mod refused_words;
mod requests;
mod splines;
mod straight;
mod thread_cycles;
mod threads;
mod tilted;
mod tilted_contours;
mod tool_control;
mod turning;

use super::*;
use crate::code;
use crate::{
    Axis, DwellTime, Feed, GuidedMove, Move, MoveKind, Position, Severity, SpindleDirection, SpindleSpeed, ThreadKind,
    ThreadMove, ToolGuide,
};

/// Up to six decimals, without trailing zeros.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// The axes of `position` that are not zero, or `0`.
fn place(position: &Position) -> String {
    let axes = Axis::ALL.iter().filter(|axis| position[axis.index()] != 0.0);
    let words: Vec<_> = axes.map(|axis| format!("{}{}", axis.letter(), number(position[axis.index()]))).collect();
    if words.is_empty() { "0".to_owned() } else { words.join(" ") }
}

fn feed(feed: Feed) -> String {
    match feed {
        Feed::PerMinute(value) => format!("{}/min", number(value)),
        Feed::PerRevolution(value) => format!("{}/rev", number(value)),
        Feed::InverseTime(value) => format!("1/{}", number(value)),
    }
}

/// The path and the lead, then whatever differs from the default.
fn thread(step: &ThreadMove) -> String {
    if step.kind == ThreadKind::Tapped {
        let sense = if step.spindle.direction == SpindleDirection::Clockwise { "cw" } else { "ccw" };
        let speed = number(step.spindle.rev_per_s(0.0) * 60.0);
        let plane = step.plane.as_ref().map_or(String::new(), |it| format!(" plane H{}", it.length_offset));
        let ends = format!("{} -> {}", place(&step.start), place(&step.end));
        return format!("tap {ends} @{} {sense} {speed}{plane}", number(step.lead_mm));
    }
    let mut text = format!("thread {} -> {} @{}", place(&step.start), place(&step.end), number(step.lead_mm));
    if let Some(plane) = &step.plane {
        text.push_str(&format!(" plane H{}", plane.length_offset));
    }
    let mut add = |name: &str, value: Option<f64>| {
        if let Some(value) = value {
            text.push_str(&format!(" {name}{}", number(value)));
        }
    };
    add("from ", Some(step.start_angle_deg).filter(|angle| *angle != 0.0));
    add("amplitude ", step.amplitude_mm);
    add("shift ", step.phase_shift_deg);
    add("out over ", step.pull_out.map(|pull_out| pull_out.travel_mm));
    add("by ", step.pull_out.map(|pull_out| pull_out.retreat_mm));
    add("tool ", step.included_angle_deg);
    text
}

fn plain_move(step: &Move) -> String {
    let ends = format!("{} -> {}", place(&step.start), place(&step.end));
    match (step.kind, step.arc) {
        (MoveKind::Rapid, _) => format!("rapid {ends}"),
        (MoveKind::Cutting, None) if step.spline.is_some() => {
            let spline = step.spline.as_deref().expect("it is there");
            let points = spline.points.iter().zip(&spline.weights).map(|([first, second], weight)| {
                let weight = if *weight == 1.0 { String::new() } else { format!("*{}", number(*weight)) };
                format!(" {},{}{weight}", number(*first), number(*second))
            });
            format!("spline {ends} order {}{} @{}", spline.order, points.collect::<String>(), feed(step.feed))
        }
        (MoveKind::Cutting, None) => format!("line {ends} @{}", feed(step.feed)),
        (MoveKind::Cutting, Some(arc)) => {
            let [first, second] = arc.center.map(number);
            let turn = number(arc.sweep_rad.to_degrees());
            format!("arc {ends} about {first},{second} by {turn} @{}", feed(step.feed))
        }
    }
}

fn guided_move(guided: &GuidedMove) -> String {
    let step = &guided.step;
    let vector = |vector: Option<[f64; 3]>| vector.map_or("-".to_owned(), |v| v.map(number).join(","));
    let guide = match guided.guide {
        ToolGuide::Axes => "axes".to_owned(),
        ToolGuide::Angles => "angles".to_owned(),
        ToolGuide::Plane => "plane".to_owned(),
        ToolGuide::Align { solution, about_tip: false } => format!("align {solution:?}"),
        ToolGuide::Align { solution, about_tip: true } => format!("align about tip {solution:?}"),
        ToolGuide::Vector { start, end } => format!("vector {} {}", vector(start), vector(end)),
    };
    let kind = match step.kind {
        MoveKind::Rapid => "rapid",
        MoveKind::Cutting => "cut",
    };
    let held = Axis::ALL.into_iter().filter(|&axis| guided.held.contains(axis));
    let held: String = held.map(Axis::letter).collect();
    let held = if held.is_empty() { held } else { format!(" ~{held}") };
    let feed = if step.kind == MoveKind::Cutting { format!(" @{}", feed(step.feed)) } else { String::new() };
    let arc = guided.step.arc.map_or(String::new(), |arc| {
        let [first, second] = arc.center.map(number);
        format!(" about {first},{second} by {}", number(arc.sweep_rad.to_degrees()))
    });
    let spline = guided.step.spline.as_deref().map_or(String::new(), |spline| {
        let points = spline.points.iter().map(|point| format!(" {}", point.map(number).join(",")));
        format!(" spline order {}{}", spline.order, points.collect::<String>())
    });
    let arc = format!("{arc}{spline}");
    let pure = if guided.is_pure_cut { " pure" } else { "" };
    format!("guided {guide} H{} {kind} -> {}{held}{arc}{feed}{pure}", guided.length_offset, place(&step.end))
}

fn render_operation(operation: &Operation) -> String {
    match &operation.kind {
        OperationKind::Thread(step) => thread(step),
        OperationKind::Move(step) => plain_move(step),
        OperationKind::Guided(guided) => guided_move(guided),
        OperationKind::Dwell { time: DwellTime::Seconds(time), .. } => format!("dwell {}", number(*time)),
        OperationKind::Dwell { time: DwellTime::Revolutions(turns), .. } => format!("dwell {} rev", number(*turns)),
        OperationKind::Spindle(spindle) => {
            let sense = match spindle.direction {
                SpindleDirection::Stopped => "off",
                SpindleDirection::Clockwise => "cw",
                SpindleDirection::CounterClockwise => "ccw",
            };
            match spindle.speed {
                SpindleSpeed::Constant { rev_per_min } => format!("spindle {sense} {}", number(rev_per_min)),
                SpindleSpeed::Surface { m_per_min, max_rev_per_min } => {
                    format!("spindle {sense} {} m/min max {max_rev_per_min}", number(m_per_min))
                }
            }
        }
        OperationKind::Tool { number, offset } => format!("tool {number}.{offset}"),
        OperationKind::Coolant(coolant) => format!("coolant mist {} flood {}", coolant.mist, coolant.flood),
        OperationKind::Function(command) => {
            let words = command.words.iter().map(|word| format!(" {}{}", word.letter, number(word.value)));
            let words: String = words.collect();
            format!("{:?} {}{words}", command.function, if command.on { "on" } else { "off" })
        }
        OperationKind::MachineCode(command) => {
            let words: String =
                command.words.iter().map(|word| format!(" {}{}", word.letter, number(word.value))).collect();
            format!("M{}{words} {:?}", command.number, command.effect)
        }
        OperationKind::Stop { optional } => format!("stop {optional}"),
        OperationKind::Compensation(_) => unreachable!("the stage takes it out"),
        OperationKind::End => "end".to_owned(),
    }
}

fn render_finding(finding: &Finding) -> String {
    let SourceSpan { line, column, length, .. } = finding.span;
    let mark = match finding.severity {
        Severity::Info => 'i',
        Severity::Warning => 'w',
        Severity::Error => '!',
    };
    format!("{mark} {line}:{column}+{length} {}", finding.code)
}

/// The tools of the tests: T1 to T9, the first one 100 mm long and each of the others half as long as the one before.
fn tools() -> Vec<ToolOffset> {
    (1..10).map(|number| ToolOffset::new(number).with_length(200.0 / f64::from(1_u32 << number))).collect()
}

/// Operations, then findings, one per line. Every finding is held to what all findings promise.
fn render(program: impl AsRef<[u8]>, settings: &LanguageSettings) -> String {
    // On a lathe every T word would bring its offset.
    let tools = if settings.dialect == crate::DialectName::Lathe { Vec::new() } else { tools() };
    let (operations, findings) = Interpreter::new(settings.clone()).with_tools(tools).read_all(program.as_ref());
    let ends = operations.iter().filter(|operation| operation.kind == OperationKind::End).count();
    assert_eq!(ends, 1, "exactly one end");
    assert_eq!(operations.last().map(|operation| &operation.kind), Some(&OperationKind::End));
    for finding in findings.findings() {
        assert!(code::is_of_language(finding.code), "{} is listed", finding.code);
        assert!(!finding.message.is_empty() && finding.span.line > 0 && finding.span.column > 0, "{finding:?}");
    }
    let lines = operations.iter().map(render_operation);
    lines.chain(findings.findings().iter().map(render_finding)).collect::<Vec<_>>().join("\n")
}

/// Runs `program` and compares with `expected`, whose lines may be indented. A program without an `M30` gets one
/// on its last line, and its `end` need not be listed.
#[track_caller]
fn check(settings: &LanguageSettings, program: &str, expected: &str) {
    let implicit_end = !program.contains("M30");
    let program = if implicit_end { format!("{program}\nM30\n") } else { program.to_owned() };
    let rendered = render(&program, settings);
    let lines = rendered.lines().filter(|line| !(implicit_end && *line == "end"));
    let found: Vec<_> = lines.collect();
    let expected: Vec<_> = expected.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(found, expected, "program:\n{program}");
}

/// A lathe whose threads have no chamfer at their end unless a program says so.
fn lathe() -> LanguageSettings {
    let mut settings = LanguageSettings::default();
    settings.turning.thread_chamfer_tenths = Some(0);
    settings
}

fn mill() -> LanguageSettings {
    LanguageSettings::mill()
}

fn linuxcnc() -> LanguageSettings {
    LanguageSettings::linuxcnc()
}
