//! Codes that a machine profile replaces by other words: a macro behind a code, or one code for several.

use serde::{Deserialize, Serialize};

use crate::block::{Block, Rest};
use crate::dialect::{CodeTable, Group, Meaning};
use crate::interpreter::System;
use crate::lexer::{Lexer, TokenKind};
use crate::number::Number;
use crate::{FindingLog, InterpreterState, LanguageSettings};

/// Most codes that a profile replaces, so that the table of codes holds them beside those of any dialect.
const MOST_REPLACEMENTS: usize = 32;

/// Most words in the place of one code.
const MOST_WORDS: usize = 8;

/// A code, and the words that the machine executes in its place.
///
/// A custom code of FANUC's parameters 6050 to 6089 is `G65` or `M98` with the program that it calls; a code of the builder that does
/// what several others do is those. Words that call a program stand for their code only outside of programs that such a code has
/// called, so that the macro of a tool change can write `M6`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeReplacement {
    /// The code, such as `M6` or `G120`.
    pub code: String,
    /// The words, such as `G65 P9001` or `M3 M8`.
    pub words: String,
}

impl CodeReplacement {
    /// Letter and number of the code; `None` where the text is no G or M code.
    pub(crate) fn replaced(&self) -> Option<(u8, f64)> {
        let mut tokens = Lexer::new(self.code.as_bytes());
        let code =
            tokens.next().filter(|token| token.kind == TokenKind::Word && matches!(token.letter, b'G' | b'M'))?;
        tokens.next().is_none().then_some((code.letter, code.number.value()))
    }

    /// Letters and numbers of the words; `None` where the text has anything else.
    pub(crate) fn written(&self) -> Option<Vec<(u8, Number)>> {
        let word = |token: crate::lexer::Token| {
            (token.kind == TokenKind::Word && !token.number.is_spaced()).then_some((token.letter, token.number))
        };
        Lexer::new(self.words.as_bytes()).take(MOST_WORDS + 1).map(word).collect()
    }
}

/// What makes the replaced codes of a profile unusable: the field and why.
#[must_use]
pub fn code_replacement_problems(language: &LanguageSettings) -> Vec<(String, String)> {
    let replacements = &language.code_replacements;
    if replacements.len() > MOST_REPLACEMENTS {
        let message = format!("must list at most {MOST_REPLACEMENTS}, lists {}", replacements.len());
        return vec![("code_replacements".to_owned(), message)];
    }
    if replacements.is_empty() {
        return Vec::new();
    }
    let mut problems = Vec::new();
    let plain = LanguageSettings { code_replacements: Vec::new(), ..language.clone() };
    let table = CodeTable::new(&plain);
    for (index, replacement) in replacements.iter().enumerate() {
        let mut add =
            |field: &str, message: String| problems.push((format!("code_replacements[{index}].{field}"), message));
        match code_problem(replacement, &replacements[..index], &table) {
            Some(message) => add("code", message),
            None => words_problem(replacement, &plain, &table).into_iter().for_each(|message| add("words", message)),
        }
    }
    problems
}

fn code_problem(given: &CodeReplacement, earlier: &[CodeReplacement], table: &CodeTable) -> Option<String> {
    let shown = &given.code;
    let Some((letter, number)) = given.replaced() else {
        return Some(format!("must be a G or M code, such as M6, is {shown:?}"));
    };
    if !CodeTable::has_place_for(letter, number) {
        return Some(format!("must be G0 to G9999.9, or M0 to M9999, is {shown}"));
    }
    if earlier.iter().any(|other| other.replaced() == Some((letter, number))) {
        return Some(format!("{shown} is listed twice"));
    }
    let code = table.code(table.find(letter, number)?);
    let what = match (code.group, code.meaning) {
        (Group::Subprogram | Group::MacroCall, _) => "calls programs or returns from them",
        (Group::Function, _) => "switches a machining function; the profile names its code where it sets the function",
        (_, Meaning::End) => "ends a program",
        _ => return None,
    };
    Some(format!("{shown} {what}, so that it cannot be replaced"))
}

fn words_problem(given: &CodeReplacement, plain: &LanguageSettings, table: &CodeTable) -> Option<String> {
    let shown = &given.words;
    let words = given.written().unwrap_or_default();
    if words.is_empty() || words.len() > MOST_WORDS {
        return Some(format!("must be 1 to {MOST_WORDS} words with numbers, such as G65 P9001, is {shown:?}"));
    }
    if let Some((letter, _)) = words.iter().find(|(letter, _)| matches!(letter, b'N' | b'O')) {
        return Some(format!("must not name a block or a program, has {}", char::from(*letter)));
    }
    let state = InterpreterState::new(plain);
    let system = System { state: &state, settings: plain, dialect: table.dialect, tools: &[] };
    let (mut block, mut findings) = (Block::default(), FindingLog::default());
    let mark = findings.mark();
    block.parse(shown.as_bytes(), (0, 1), table, false, system, &mut findings, &mark);
    if let Some(finding) = findings.findings().iter().find(|finding| finding.severity == crate::Severity::Error) {
        return Some(format!("{shown} cannot be read: {}", finding.message));
    }
    if !block.has_codes() {
        return Some(format!("must have a code, is {shown}"));
    }
    let arguments: Vec<u8> = words.iter().map(|(letter, _)| *letter).skip_while(|letter| *letter == b'G').collect();
    match block.rest {
        None => None,
        Some(Rest::Arguments { modal: false, .. }) if matches!(arguments[..], [b'P'] | [b'P', b'L'] | [b'L', b'P']) => {
            None
        }
        Some(_) => Some(format!("a macro is called by G65 with P, and L for repetitions, is {shown}")),
    }
}

/// A replaced code as the table of codes has it.
#[derive(Clone, Debug)]
pub(crate) struct Replacement {
    pub(crate) words: Vec<(u8, Number)>,
    /// Place of what the code is without the profile.
    pub(crate) original: Option<u8>,
    /// Whether the words call a program.
    pub(crate) calls: bool,
}
