//! Programs of expressions and control flow made from bytes: for the random tests here and the fuzz target `flow`.

use feedwave_program::{
    FindingLog, Interpreter, LanguageSettings, LineOutcome, Operation, OperationKind, Place, Position,
};

/// Bytes that decide what a program is; zeros when they are used up.
struct Decisions<'a> {
    bytes: std::slice::Iter<'a, u8>,
}

impl Decisions<'_> {
    fn next(&mut self) -> u8 {
        self.bytes.next().copied().unwrap_or(0)
    }

    fn of<'t>(&mut self, texts: &[&'t str]) -> &'t str {
        texts[self.next() as usize % texts.len()]
    }

    fn below(&mut self, limit: u8) -> u8 {
        self.next() % limit
    }
}

/// A program of Macro B or LinuxCNC's language. Most of its lines are right; some calls, loops and values are not.
#[must_use]
pub fn program(bytes: &[u8], linuxcnc: bool) -> String {
    let mut decisions = Decisions { bytes: bytes.iter() };
    let mut text = String::from("G21 G90 G1 F500\n");
    let lines = 4 + decisions.below(28);
    let mut open: Vec<String> = Vec::new();
    for line in 0..lines {
        let written = if linuxcnc {
            o_word_line(&mut decisions, &mut open, line)
        } else {
            macro_line(&mut decisions, &mut open, line)
        };
        text.push_str(&written);
        text.push('\n');
    }
    while let Some(end) = open.pop() {
        text.push_str(&end);
        text.push('\n');
    }
    let sub = if linuxcnc {
        "M2\n"
    } else {
        "M30\nO100\n#7=#7+1\nG91 G1 X#7\nG90\nIF [#7 GT 40] GOTO 9\nM98 P101\nN9 M99\nO101\nG1 Y#1\nM99\n"
    };
    text + sub
}

fn expression(decisions: &mut Decisions<'_>, linuxcnc: bool, depth: u8) -> String {
    let inner = |decisions: &mut Decisions<'_>| expression(decisions, linuxcnc, depth + 1);
    match if depth > 3 { decisions.below(4) } else { decisions.below(12) } {
        0 => format!("{}", decisions.below(10)),
        1 => format!("{}.{}", decisions.below(50), decisions.below(100)),
        2 => format!("#{}", 1 + decisions.below(8)),
        3 => format!("-{}", decisions.below(9)),
        4 => format!("#[{}]", inner(decisions)),
        5 | 6 => format!("[{}]", inner(decisions)),
        7 => {
            let name = decisions.of(&["SIN", "COS", "ABS", "SQRT", "ROUND", "FIX", "FUP", "EXP", "LN", "ASIN", "TAN"]);
            format!("{name}[{}]", inner(decisions))
        }
        8 => format!("ATAN[{}]/[{}]", inner(decisions), inner(decisions)),
        _ => {
            let operators: &[&str] = if linuxcnc {
                &["+", "-", "*", "/", "**", "MOD", "EQ", "LT", "AND", "OR", "XOR"]
            } else {
                &["+", "-", "*", "/", "MOD", "AND", "OR"]
            };
            let (left, operator, right) = (inner(decisions), decisions.of(operators), inner(decisions));
            if linuxcnc { format!("[{left} {operator} {right}]") } else { format!("{left} {operator} {right}") }
        }
    }
}

fn motion(decisions: &mut Decisions<'_>, linuxcnc: bool) -> String {
    match decisions.below(6) {
        0 => format!("G1 X[{}]", expression(decisions, linuxcnc, 1)),
        1 => format!("G0 Y{}", decisions.below(40)),
        2 => format!("G2 X{} Y0 R{}", decisions.below(20), 5 + decisions.below(30)),
        3 => format!("G3 I{} J{}", decisions.below(9), 1 + decisions.below(9)),
        4 => format!("G91 G1 Z-0.{}\nG90", decisions.below(10)),
        _ => format!("G4 P{}", decisions.below(3)),
    }
}

fn assignment(decisions: &mut Decisions<'_>, linuxcnc: bool) -> String {
    format!("#{}={}", 1 + decisions.below(8), expression(decisions, linuxcnc, 0))
}

fn macro_line(decisions: &mut Decisions<'_>, open: &mut Vec<String>, line: u8) -> String {
    let comparison = ["EQ", "NE", "GT", "GE", "LT", "LE"];
    match decisions.below(14) {
        0..=3 => assignment(decisions, false),
        4..=6 => motion(decisions, false),
        7 if open.len() < 3 => {
            let counter = 10 + open.len();
            let number = open.len() + 1;
            open.push(format!("#{counter}=#{counter}+1\nEND{number}"));
            format!("WHILE [#{counter} LT {}] DO{number}", decisions.below(6))
        }
        8 => open.pop().unwrap_or_default(),
        9 => format!("IF [#1 {} #2] THEN #3={}", decisions.of(&comparison), decisions.below(9)),
        10 => format!("N{} #5=#5+1", 100 + u32::from(line)),
        11 => {
            format!("IF [#5 {} {}] GOTO {}", decisions.of(&comparison), decisions.below(9), 100 + decisions.below(32))
        }
        12 => format!("G65 P100 A{} B#2", decisions.below(9)),
        _ => format!("M98 P{} L{}", 100 + u32::from(decisions.below(3)), decisions.below(3)),
    }
}

fn o_word_line(decisions: &mut Decisions<'_>, open: &mut Vec<String>, line: u8) -> String {
    match decisions.below(14) {
        0..=3 => assignment(decisions, true),
        4..=6 => motion(decisions, true),
        7 => {
            open.push(format!("#{0}=[#{0}+1]\no{line} endwhile", 10 + line));
            format!("o{line} while [#{} LT {}]", 10 + line, decisions.below(6))
        }
        8 => open.pop().unwrap_or_default(),
        9 => {
            open.push(format!("o{line} endif"));
            format!("o{line} if [{}]", expression(decisions, true, 1))
        }
        10 => {
            open.push(format!("o{line} endrepeat"));
            format!("o{line} repeat [{}]", expression(decisions, true, 2))
        }
        11 => {
            open.push(format!("o{line} endsub [#1]\no{line} call [{}]", decisions.below(9)));
            format!("o{line} sub")
        }
        12 => format!("o{} {}", decisions.below(line + 1), decisions.of(&["break", "continue", "else", "return"])),
        _ => format!("o{} call [{}] [#2]", decisions.below(line + 1), expression(decisions, true, 1)),
    }
}

/// Settings with bounds that a test reaches.
#[must_use]
pub fn bounded(settings: LanguageSettings) -> LanguageSettings {
    LanguageSettings { max_executed_blocks: 400, max_still_blocks: 200, ..settings }
}

/// Reads a program to its end, with the interpreter restored from its state every `restore` lines (0: never).
#[must_use]
pub fn interpreted(program: &[u8], settings: &LanguageSettings, restore: usize) -> (Vec<Operation>, FindingLog) {
    let mut interpreter = Interpreter::new(settings.clone());
    let (mut operations, mut findings) = (Vec::new(), FindingLog::default());
    for line in 1.. {
        let Place { program: file, offset } = interpreter.place();
        assert_eq!(file, 0, "there is one file");
        let rest = &program[program.len().min(offset as usize)..];
        match interpreter.read_line(rest, true, &mut operations, &mut findings) {
            LineOutcome::Consumed(_) | LineOutcome::Elsewhere => {}
            LineOutcome::NeedMore => panic!("all of the program is there"),
            LineOutcome::Ended => break,
        }
        if restore > 0 && line % restore == 0 {
            interpreter = Interpreter::restore(settings.clone(), interpreter.state().clone());
        }
    }
    (operations, findings)
}

/// What holds for every program: one end, finite coordinates, moves that continue each other, and the same after restoring.
pub fn check(program: &str, settings: &LanguageSettings) -> Vec<Operation> {
    let (operations, findings) = interpreted(program.as_bytes(), settings, 0);
    let ends = operations.iter().filter(|operation| operation.kind == OperationKind::End).count();
    assert_eq!(ends, 1, "{program}");
    assert!(operations.len() <= 5_000, "{program}");
    for operation in &operations {
        if let OperationKind::Move(step) = &operation.kind {
            let finite = |position: &Position| position.iter().all(|value| value.is_finite());
            assert!(finite(&step.start) && finite(&step.end), "{program}");
        }
    }
    for restore in [5, 31] {
        let (again, found) = interpreted(program.as_bytes(), settings, restore);
        assert_eq!(again, operations, "restored every {restore} lines: {program}");
        assert_eq!(found.findings(), findings.findings(), "restored every {restore} lines: {program}");
    }
    operations
}
