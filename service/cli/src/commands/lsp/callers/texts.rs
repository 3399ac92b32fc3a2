//! The programs that call a document, each in another state.

use std::fmt::Write as _;

use feedwave_cutting::MachineProfile;
use feedwave_program::lexer::{Lexer, TokenKind};
use feedwave_program::{Axis, DialectName, GCodeSystem, LanguageSettings, Outline, ProgramName, Vocabulary, WordRole};

use crate::commands::lsp::document::Document;

/// Number of a file that has none in its name and its text.
const UNNAMED: u32 = 9_999;
/// Letters of the arguments of a macro call.
const ARGUMENTS: &str = "ABCDEFHIJKMQRSTUVWXYZ";
/// Arguments of a call in the O-word language.
const O_ARGUMENTS: usize = 30;
/// Most names of variables that are given values.
const MAX_NAMES: usize = 1_000;

/// What of a document is called.
pub(super) enum Calls {
    /// Programs by their numbers and names.
    Programs(Vec<ProgramName>),
    /// Subprograms of the O-word language, by their names as they are written.
    Subprograms(Vec<String>),
}

impl Calls {
    /// What a document offers, by its outline and the name of its file without the extension.
    pub(super) fn of(outline: &Outline, stem: Option<&str>, language: &LanguageSettings) -> Option<Self> {
        if language.dialect == DialectName::LinuxCnc {
            let names: Vec<_> = outline.subprogram_names().map(str::to_owned).collect();
            return (!names.is_empty()).then_some(Self::Subprograms(names));
        }
        let mut names: Vec<_> = outline.program_names().cloned().collect();
        if names.is_empty() {
            let number = stem.and_then(|stem| stem.trim_start_matches(['O', 'o']).parse().ok());
            names.push(ProgramName::Number(number.unwrap_or(UNNAMED)));
        }
        Some(Self::Programs(names))
    }

    /// A name of the document by which calls find it.
    pub(super) fn file_name(&self) -> String {
        match self {
            Self::Programs(names) => match &names[0] {
                name @ ProgramName::Number(_) => format!("{name}.nc"),
                ProgramName::Text(name) => format!("{name}.nc"),
            },
            Self::Subprograms(names) => format!("{}.ngc", names[0].trim_matches(['<', '>'])),
        }
    }

    /// The calls, each behind the lines that make the caller's state; `argument` is what the first argument is.
    fn text(&self, state: &str, argument: Option<f64>) -> String {
        let mut text = String::new();
        let values = |count: usize, first: f64| (0..count).map(move |place| first * (1.0 + 0.25 * place as f64));
        match self {
            Self::Programs(names) => {
                for name in names.iter().map(ProgramName::in_call) {
                    text.push_str(state);
                    let Some(first) = argument else {
                        let _ = writeln!(text, "M98 {name} L1");
                        continue;
                    };
                    let _ = write!(text, "G65 {name} L1");
                    for (letter, value) in ARGUMENTS.chars().zip(values(ARGUMENTS.len(), first)) {
                        let _ = write!(text, " {letter}{value:.4}");
                    }
                    text.push('\n');
                }
            }
            Self::Subprograms(names) => {
                for name in names {
                    let _ = write!(text, "{state}o{name} call");
                    for value in argument.into_iter().flat_map(|first| values(O_ARGUMENTS, first)) {
                        let _ = write!(text, " [{value:.4}]");
                    }
                    text.push('\n');
                }
            }
        }
        text
    }
}

/// The programs that call a document. The states of the first two are valid, and differ in all that hovers tell. What a control refuses
/// of the states of the others is no matter: only what is found in the document is looked at.
pub(super) fn callers(calls: &Calls, document: &str, profile: &MachineProfile) -> Vec<String> {
    let axes: Vec<Axis> = profile.machine.axes.iter().map(|axis| axis.axis).collect();
    let states = match profile.language.dialect {
        DialectName::Lathe => lathe(&axes, profile.language.g_code_system),
        DialectName::Mill | DialectName::LinuxCnc => mill(&axes),
    };
    let arguments = [None, Some(1.25), Some(7.5), Some(-2.0)];
    let off = switches(&profile.language, false);
    let mut texts = Vec::new();
    for (place, (state, argument)) in states.into_iter().zip(arguments).enumerate() {
        let mut text = argument.map_or_else(String::new, |first| variables(document, profile.language.dialect, first));
        let is_switched = place == 3;
        let state = if is_switched { state + &switches(&profile.language, true) } else { state };
        text.push_str(&calls.text(&state, argument));
        if is_switched {
            text.push_str(&off);
        }
        text.push_str("M30\n");
        texts.push(text);
    }
    texts
}

/// Moves all axes by other lengths, from wherever they are.
fn moves(code: &str, axes: &[Axis], length: f64, letter: impl Fn(Axis) -> char) -> String {
    let mut text = code.to_owned();
    for (place, axis) in axes.iter().enumerate() {
        let _ = write!(text, " {}{:.4}", letter(*axis), length * (1.0 + 0.125 * place as f64));
    }
    text + "\n"
}

fn mill(axes: &[Axis]) -> Vec<String> {
    let go = |length: f64| moves("G91 G0", axes, length, Axis::letter);
    vec![
        format!("T1 M6\nG17 G94 F300. S1200 M3\n{}G90\n", go(0.5)),
        format!("T2 M6\nG18 G95 F0.07 S340 M4\n{}G91 G1\n", go(1.5)),
        format!("T3 M6\nG17 G94 F150. S800 M3\n{}G90 G99 G81 Z-3. R1.\nG80\nG81 Z-3. R1. F90.\n", go(2.5)),
        format!("T4 M6\nG19 G94 M5\n{}G43 H4\nG90 G2\n", go(3.5)),
    ]
}

fn lathe(axes: &[Axis], system: Option<GCodeSystem>) -> Vec<String> {
    let has_modes = matches!(system, Some(GCodeSystem::B | GCodeSystem::C));
    let increment = |axis: Axis| match axis {
        Axis::X => 'U',
        Axis::Y => 'V',
        Axis::Z => 'W',
        Axis::C => 'H',
        other => other.letter(),
    };
    let go = |length: f64| match has_modes {
        true => moves("G91 G0", axes, length, Axis::letter) + "G90\n",
        false => moves("G0", axes, length, increment),
    };
    // Where the system is not known, no caller settles it.
    let (per_rev, per_minute, absolute, incremental) = match system {
        None => ("", "", "", ""),
        Some(GCodeSystem::A) => ("G99", "G98", "", ""),
        Some(_) => ("G95", "G94", "G90", "G91"),
    };
    let cycle = if has_modes { "G77" } else { "G92" };
    vec![
        format!("T0100\nG18 {per_rev} G97 F0.2 S1200 M3\n{}{absolute}\n", go(0.5)),
        format!("T0200\nG17 {per_minute} G97 F90. S340 M4\n{}{incremental} G1\n", go(1.5)),
        format!("T0300\nG18 {per_rev} G50 S2000\nG96 S150 M3 F0.1\n{}{absolute} {cycle} U-1. W-2. F1.5\n", go(2.5)),
        format!("T0400\nG18 {per_rev} M5\n{}{absolute} G2\n", go(3.5)),
    ]
}

/// Codes that switch machining functions.
fn switches(language: &LanguageSettings, on: bool) -> String {
    let mut text = String::new();
    let of = |codes: &feedwave_program::FunctionCodes| if on { codes.on } else { codes.off };
    for (codes, words) in [(&language.path_vibration, " F40. A0.01"), (&language.tool_oscillation, " P1")] {
        let _ = writeln!(text, "G{}{}", of(codes), if on { words } else { "" });
    }
    if let Some(codes) = &language.thinning {
        let _ = writeln!(text, "M{}", of(codes));
    }
    let switch = language.thread_vibration;
    let (p, words) = if on { (switch.on_p, " X20. Q1.3") } else { (switch.off_p, "") };
    let _ = writeln!(text, "G{} P{p}{words}", switch.code);
    text
}

/// Values for the variables that callers share with what they call.
fn variables(document: &str, dialect: DialectName, value: f64) -> String {
    let mut text = String::new();
    for number in (100..200).chain(500..1_000) {
        let _ = writeln!(text, "#{number}={value}");
    }
    if dialect == DialectName::LinuxCnc {
        let names = document.match_indices("#<_").filter_map(|(start, _)| document[start..].split_once('>'));
        for (name, _) in names.take(MAX_NAMES) {
            let _ = writeln!(text, "{name}>={value}");
        }
    }
    text
}

/// A document without its calls, jumps, loops and ends: every other line one after the other.
pub(super) fn straight(document: &Document, language: &LanguageSettings) -> String {
    let vocabulary = Vocabulary::new(language);
    let mut text = String::new();
    for line in 0..document.line_count() {
        let line = document.counted_line(line);
        let leads_away = Lexer::new(line.as_bytes()).any(|token| match token.kind {
            TokenKind::Statement | TokenKind::Expression => true,
            TokenKind::Word => {
                matches!(vocabulary.role(&token), WordRole::Call) || token.letter == b'O' || ends(&token)
            }
            TokenKind::Computed | TokenKind::LoneLetter | TokenKind::MalformedNumber => token.letter == b'O',
            _ => false,
        });
        // A name in < > begins the next program, as an O.
        let begins = language.dialect != DialectName::LinuxCnc && line.trim_start().starts_with('<');
        text.push_str(if leads_away || begins { "" } else { line });
        text.push('\n');
    }
    text
}

fn ends(token: &feedwave_program::lexer::Token) -> bool {
    token.letter == b'M' && [2.0, 30.0].contains(&token.number.value())
}
