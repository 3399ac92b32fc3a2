//! What a line has for control flow: its label, its program number, its statement.

use serde::{Deserialize, Serialize};

use crate::ProgramName;
use crate::dialect::Flow;
use crate::lookalike::{self, Stretch};

/// A control statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Statement {
    /// `WHILE […] DOm` or `DOm`.
    Do,
    /// `ENDm`
    EndDo,
    Sub,
    EndSub,
    Return,
    Call,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    DoWhile,
    Repeat,
    EndRepeat,
    Break,
    Continue,
}

/// The words of O-word statements.
const O_WORDS: [(&[u8], Statement); 15] = [
    (b"SUB", Statement::Sub),
    (b"ENDSUB", Statement::EndSub),
    (b"RETURN", Statement::Return),
    (b"CALL", Statement::Call),
    (b"IF", Statement::If),
    (b"ELSEIF", Statement::ElseIf),
    (b"ELSE", Statement::Else),
    (b"ENDIF", Statement::EndIf),
    (b"WHILE", Statement::While),
    (b"ENDWHILE", Statement::EndWhile),
    (b"DO", Statement::DoWhile),
    (b"REPEAT", Statement::Repeat),
    (b"ENDREPEAT", Statement::EndRepeat),
    (b"BREAK", Statement::Break),
    (b"CONTINUE", Statement::Continue),
];

impl Statement {
    /// The statement as it is written.
    pub(crate) fn word(self) -> String {
        let of = |(word, statement): &(&[u8], Self)| {
            (*statement == self).then(|| String::from_utf8_lossy(word).to_ascii_lowercase())
        };
        match self {
            Self::Do => "DO".to_owned(),
            Self::EndDo => "END".to_owned(),
            _ => O_WORDS.iter().find_map(of).unwrap_or_default(),
        }
    }
}

/// What [`classify`] finds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Line {
    /// `N`
    pub(crate) label: Option<u32>,
    /// The program that begins here.
    pub(crate) program: Option<ProgramName>,
    /// With the number or the name of it.
    pub(crate) statement: Option<(Statement, String)>,
    /// A line or program number with characters that only look like those of one.
    pub(crate) unread: Option<Stretch>,
}

impl Line {
    /// Whether a program or a subprogram begins here.
    pub(crate) fn begins_program(&self) -> bool {
        self.program.is_some() || matches!(self.statement, Some((Statement::Sub, _)))
    }
}

/// First place from `at` on that is not blank.
pub(super) fn skip_blanks(line: &[u8], mut at: usize) -> usize {
    while matches!(line.get(at), Some(b' ' | b'\t')) {
        at += 1;
    }
    at
}

/// The letters from `at` on, blanks and comments before them left out: where they begin and end.
pub(super) fn letters(line: &[u8], at: usize) -> (usize, usize) {
    let mut start = skip_blanks(line, at);
    while line.get(start) == Some(&b'(')
        && let Some(length) = line[start..].iter().position(|&byte| byte == b')')
    {
        start = skip_blanks(line, start + length + 1);
    }
    let length = line[start..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    (start, start + length)
}

/// The digits from `at` on as a number of at most eight of them, and where they end.
pub(crate) fn digits(line: &[u8], at: usize) -> Option<(u32, usize)> {
    let start = skip_blanks(line, at);
    let length = line[start..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let text = core::str::from_utf8(&line[start..start + length]).ok()?;
    let trimmed = text.trim_start_matches('0');
    if length == 0 || trimmed.len() > 8 {
        return None;
    }
    Some((trimmed.parse().unwrap_or(0), start + length))
}

/// Bytes within which a line or program number is looked at.
const LONGEST_NUMBER_WORD: usize = 40;

/// The stretch at the beginning of a line that looks like a line or program number.
#[cold]
fn unread_number(line: &[u8], at: usize) -> Option<Stretch> {
    let first = lookalike::find(line).into_iter().next()?;
    (first.start <= at && first.text.starts_with(['N', 'n', 'O'])).then_some(first)
}

/// The number that a stretch may be meant as: a letter O among its digits may be a zero.
pub(super) fn number_meant(stretch: &Stretch) -> Option<u32> {
    let digit = |letter: char| if letter == 'O' { Some('0') } else { letter.is_ascii_digit().then_some(letter) };
    let digits = stretch.text.chars().skip(1).take_while(|letter| !letter.is_whitespace()).filter_map(digit);
    digits.collect::<String>().parse().ok()
}

/// What a line has for control flow. Lines that block delete leaves out have nothing.
pub(crate) fn classify(line: &[u8], flow: Flow, block_delete: bool) -> Line {
    let mut found = Line::default();
    let mut at = skip_blanks(line, 0);
    if line[at..].starts_with(b"\xef\xbb\xbf") {
        at = skip_blanks(line, at + 3);
    }
    if line.get(at) == Some(&b'/') {
        if block_delete {
            return found;
        }
        at = skip_blanks(line, at + 1);
        if line.get(at).is_some_and(u8::is_ascii_digit) {
            at = skip_blanks(line, at + 1);
        }
    }
    let word = line[at..].iter().take_while(|byte| !matches!(byte, b' ' | b'\t'));
    if word.take(LONGEST_NUMBER_WORD).any(|byte| !byte.is_ascii()) {
        found.unread = unread_number(line, at);
        if found.unread.is_some() {
            return found;
        }
    }
    if let Some(b'N' | b'n') = line.get(at)
        && let Some((label, end)) = digits(line, at + 1)
    {
        found.label = Some(label);
        at = skip_blanks(line, end);
    }
    match (line.get(at).map(u8::to_ascii_uppercase), flow) {
        (Some(b'O'), Flow::OWords) => o_word(line, at, &mut found),
        (Some(b'<'), Flow::MacroB) => found.program = ProgramName::read(&line[at..]).map(|(name, _)| name),
        (Some(b'O' | b':'), Flow::MacroB) => {
            let number = digits(line, at + 1).map(|(number, _)| ProgramName::Number(number));
            found.program = number.or_else(|| ProgramName::read(&line[at + 1..]).map(|(name, _)| name));
        }
        (Some(b'W' | b'D' | b'E'), Flow::MacroB) => found.statement = loop_statement(line, at),
        _ => {}
    }
    found
}

/// `WHILE […] DOm`, `DOm` or `ENDm`.
fn loop_statement(line: &[u8], at: usize) -> Option<(Statement, String)> {
    let (start, end) = letters(line, at);
    let word = line[start..end].to_ascii_uppercase();
    let (what, at) = match word.as_slice() {
        b"DO" => (Statement::Do, end),
        b"END" => (Statement::EndDo, end),
        b"WHILE" | b"WH" => {
            let behind = behind_brackets(line, end)?;
            let (start, end) = letters(line, behind);
            if !line[start..end].eq_ignore_ascii_case(b"DO") {
                return None;
            }
            (Statement::Do, end)
        }
        _ => return None,
    };
    digits(line, at).map(|(number, _)| (what, number.to_string()))
}

/// Behind the bracket that closes the one at `at`.
fn behind_brackets(line: &[u8], at: usize) -> Option<usize> {
    let start = skip_blanks(line, at);
    if line.get(start) != Some(&b'[') {
        return None;
    }
    let mut depth = 0;
    for (index, byte) in line.iter().enumerate().skip(start) {
        match byte {
            b'[' => depth += 1,
            b']' => {
                depth -= 1;
                if depth == 0 {
                    return Some(index + 1);
                }
            }
            _ => {}
        }
    }
    None
}

/// Whether a condition in brackets and `M99` stand at `at`: a Haas control jumps or returns where it holds.
pub(crate) fn is_conditional_return(line: &[u8], at: usize) -> bool {
    behind_brackets(line, at).is_some_and(|behind| return_code(line, behind).is_some())
}

/// Behind `M99`, where that stands at `at`.
pub(super) fn return_code(line: &[u8], at: usize) -> Option<usize> {
    let (start, end) = letters(line, at);
    let (number, behind) = digits(line, end)?;
    (line[start..end].eq_ignore_ascii_case(b"M") && number == 99).then_some(behind)
}

/// An O-word whose number or name is written out, or the number of a program.
fn o_word(line: &[u8], at: usize, found: &mut Line) {
    let Some((name, end)) = name(line, at + 1) else { return };
    let (start, end) = letters(line, end);
    match statement(&line[start..end]) {
        Some(what) => found.statement = Some((what, name)),
        None if start == end && is_blank_or_comment(line, end) => {
            found.program = name.parse().ok().map(ProgramName::Number);
        }
        None => {}
    }
}

/// Whether nothing but a comment follows.
pub(super) fn is_blank_or_comment(line: &[u8], at: usize) -> bool {
    matches!(line.get(skip_blanks(line, at)), None | Some(b'(' | b';' | b'\r' | b'%'))
}

/// The statement of these letters.
pub(super) fn statement(letters: &[u8]) -> Option<Statement> {
    O_WORDS.iter().find(|(word, _)| word.eq_ignore_ascii_case(letters)).map(|(_, statement)| *statement)
}

/// The number or `<name>` of an O-word from `at` on, and where it ends: names in lower case and without blanks, in `<>` where they are
/// no numbers, numbers without leading zeros.
pub(crate) fn name(line: &[u8], at: usize) -> Option<(String, usize)> {
    let start = skip_blanks(line, at);
    if line.get(start) != Some(&b'<') {
        return digits(line, start).map(|(number, end)| (number.to_string(), end));
    }
    let length = line[start..].iter().position(|&byte| byte == b'>')?;
    let text = core::str::from_utf8(&line[start..=start + length]).ok()?;
    let mut name: String =
        text.chars().filter(|it| !matches!(it, ' ' | '\t')).map(|it| it.to_ascii_lowercase()).collect();
    // A number is the same with and without.
    let inner = &name[1..name.len() - 1];
    if digits(inner.as_bytes(), 0).is_some_and(|(number, _)| number.to_string() == inner) {
        name = inner.to_owned();
    }
    Some((name, start + length + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(line: &str, flow: Flow) -> (Option<u32>, Option<u32>, Option<(Statement, String)>) {
        let Line { label, program, statement, .. } = classify(line.as_bytes(), flow, false);
        let number = program.map(|program| match program {
            ProgramName::Number(number) => number,
            ProgramName::Text(_) => unreachable!("{line}"),
        });
        (label, number, statement)
    }

    #[test]
    fn programs_may_have_names() {
        let of = |line: &str, flow| classify(line.as_bytes(), flow, false).program.map(|name| name.to_string());
        for line in ["<SHAFT-2>", "O<SHAFT-2> (A SHAFT)", " <SHAFT-2>"] {
            assert_eq!(of(line, Flow::MacroB).as_deref(), Some("<SHAFT-2>"), "{line}");
        }
        assert_eq!(of("<O0012>", Flow::MacroB).as_deref(), Some("O12"));
        assert_eq!(of("<html lang=en>", Flow::MacroB), None);
        assert_eq!(of("<SHAFT-2>", Flow::OWords), None);
    }

    #[test]
    fn macro_b_lines() {
        let of = |line| found(line, Flow::MacroB);
        assert_eq!(of("N10 G1 X5"), (Some(10), None, None));
        assert_eq!(of(" /2 n 0020"), (Some(20), None, None));
        assert_eq!(of("O1234 (SUB)"), (None, Some(1234), None));
        assert_eq!(of(":77"), (None, Some(77), None));
        assert_eq!(of("N5 WHILE [#1 LT [2+#3]] DO 2"), (Some(5), None, Some((Statement::Do, "2".into()))));
        assert_eq!(of("do1"), (None, None, Some((Statement::Do, "1".into()))));
        assert_eq!(of("END3"), (None, None, Some((Statement::EndDo, "3".into()))));
        assert_eq!(of("(WHILE [1] DO1)"), (None, None, None));
        assert_eq!(of("G1 X1"), (None, None, None));
    }

    #[test]
    fn o_word_lines() {
        let of = |line| found(line, Flow::OWords);
        assert_eq!(of("o100 sub"), (None, None, Some((Statement::Sub, "100".into()))));
        assert_eq!(of("O <My Sub> CALL [1]"), (None, None, Some((Statement::Call, "<mysub>".into()))));
        assert_eq!(of("o0012 endwhile ; end"), (None, None, Some((Statement::EndWhile, "12".into()))));
        assert_eq!(of("o200 (a program)"), (None, Some(200), None));
        assert_eq!(of("o200 G1"), (None, None, None));
        assert_eq!(of("o[#1] call"), (None, None, None));
    }

    #[test]
    fn deleted_lines_have_nothing() {
        assert_eq!(classify(b"/N10", Flow::MacroB, true), Line::default());
    }
}
