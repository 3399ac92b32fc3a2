//! What is wrong with a word or with what is between words: errors that leave the block unclear.

use super::{Block, LARGEST_LABEL, LARGEST_NUMBER, Rest, Word};
use crate::code;
use crate::dialect::{CodeTable, Group, Meaning, letter_bit};
use crate::interpreter::System;
use crate::lexer::{Lexer, REMOVED, Token, TokenKind};
use crate::lookalike::Stretch;
use crate::number::Number;
use crate::{Finding, FindingCode, FindingLog, GCodeSystem, ProgramName};

/// Most bytes of a name of a program in `< >`, and of a call with the spaces behind it.
const LONGEST_NAME: usize = 100;
const LONGEST_CALL: usize = 8;

/// The cure for something inside a word.
const AGAIN: &str = "write this word again, and check its number: without it, another number would be left";

/// The finding that a text is no name of a program.
pub(crate) fn no_program_name(mut finding: Finding, text: &[u8], is_haas: bool) -> Finding {
    let text = quote(text);
    let number = "give the program a number, such as O1000, and call it by that, such as M98 P1000";
    if is_haas {
        finding.message = format!("{text} would be the name of a program, but programs have numbers on this control");
        return finding.suggest(number);
    }
    finding.message = format!("{text} is no name of a program that can stand here");
    finding.suggest(number).suggest(
        "or a name of 1 to 32 letters, digits and + - _ . in < >, first in its line, and directly behind M98, G65 or G66",
    )
}

/// A word as it is written: its letter and the shortest form of its number.
fn name(token: Token) -> String {
    format!("{}{}", char::from(token.letter), token.number.value())
}

/// Mask of the letters that occur in a text.
fn letters_in(text: &[u8]) -> u32 {
    let letters = text.iter().filter(|byte| byte.is_ascii_alphabetic());
    letters.fold(0, |mask, byte| mask | letter_bit(byte.to_ascii_uppercase()))
}

impl Block {
    #[cold]
    pub(super) fn report_unknown_code(&mut self, token: Token, table: &CodeTable, findings: &mut FindingLog) {
        self.defect(code::UNKNOWN_CODE, token, findings, |mut finding| {
            finding.message = format!("{} is not a code of this dialect", name(token));
            let letter = token.letter;
            finding.suggest(format!("known {} codes: {}", char::from(letter), table.supported(letter)))
        });
    }

    #[cold]
    pub(super) fn report_unsupported_code(&mut self, token: Token, what: &str, findings: &mut FindingLog) {
        self.defect(code::UNSUPPORTED_CODE, token, findings, |mut finding| {
            finding.message = format!("{} ({what}) is not supported yet", name(token));
            finding
        });
    }

    #[cold]
    pub(super) fn report_variable_lead(&mut self, token: Token, findings: &mut FindingLog) {
        self.defect(code::THREAD_VARIABLE_LEAD, token, findings, |mut finding| {
            finding.message = format!("{} cuts a thread whose lead changes, which is not carried out", name(token));
            finding.suggest("write it as passes of constant lead behind each other (G32, G33), each with its own F")
        });
    }

    #[cold]
    pub(super) fn report_code_of_other_system(
        &mut self,
        token: Token,
        (what, systems, here): (&str, &[GCodeSystem], &str),
        findings: &mut FindingLog,
    ) {
        // What follows would be read as the codes of a system that the program is not written in.
        self.has_failed = true;
        let names: Vec<_> = systems.iter().map(|system| format!("{system:?}")).collect();
        let plural = if names.len() > 1 { "s" } else { "" };
        self.defect(code::UNKNOWN_CODE, token, findings, |mut finding| {
            finding.message = format!(
                "{} is {what} of G-code system{plural} {} (in {here}): what follows is not read",
                name(token),
                names.join(" and ")
            );
            finding
                .suggest(format!(
                    "where the program is written in that system, set language.g_code_system of the machine profile to G_CODE_SYSTEM_{}",
                    names.join(" or G_CODE_SYSTEM_")
                ))
                .suggest("where it is not, write the code of the system that the machine profile names")
        });
    }

    #[cold]
    pub(super) fn report_second_code(&mut self, token: Token, group: Group, findings: &mut FindingLog) {
        self.defect(code::GROUP_CONFLICT, token, findings, |mut finding| {
            finding.message = format!("{} is the second {} code of the block", name(token), group.name());
            finding.suggest("keep one of them, or write them in two blocks")
        });
    }

    /// Pushes an error on a token that leaves the block unclear; `fill` adds the message.
    #[cold]
    pub(super) fn defect(
        &mut self,
        code: FindingCode,
        token: Token,
        findings: &mut FindingLog,
        fill: impl FnOnce(Finding) -> Finding,
    ) {
        self.unclear = true;
        if token.letter != 0 {
            self.unread |= letter_bit(token.letter);
        }
        let span = self.span_of(token.start, token.end);
        findings.push_with(code, |code| fill(Finding::new(code, span, "")));
    }

    #[cold]
    pub(super) fn report_spaces(&self, token: Token, findings: &mut FindingLog) {
        let span = self.span_of(token.start, token.end);
        findings.push_with(code::NUMBER_SPACED, |code| {
            let mut text = name(token);
            // Without its point the number may be another one.
            if token.number.has_point() && !text.contains('.') {
                text.push('.');
            }
            Finding::new(code, span, format!("the number has spaces inside and is read as {text}"))
                .suggest_replacement("write it without spaces", text)
        });
    }

    #[cold]
    pub(super) fn report_huge_number(&mut self, token: Token, findings: &mut FindingLog) {
        self.defect(code::NUMBER_RANGE, token, findings, |mut finding| {
            finding.message = format!("the number of {} is beyond ±{LARGEST_NUMBER:e}", char::from(token.letter));
            finding.with_value("limit", LARGEST_NUMBER, "")
        });
    }

    /// A line or program number that is none; it moves nothing, so that the block without it does the same.
    #[cold]
    pub(super) fn report_label(&mut self, token: Token, findings: &mut FindingLog) {
        let value = token.number.value();
        let code = if value > LARGEST_LABEL { code::NUMBER_RANGE } else { code::NUMBER_NOT_WHOLE };
        self.defect(code, token, findings, |mut finding| {
            let (name, letter) = if token.letter == b'N' { ("line", 'N') } else { ("program", 'O') };
            finding.message = format!("{letter}{value} is no {name} number: it must be whole, 0 to {LARGEST_LABEL}");
            let finding = finding.with_value("number", value, "").with_value("limit", LARGEST_LABEL, "");
            finding.suggest_replacement(format!("remove it: a {name} number moves nothing"), "")
        });
    }

    /// A line number of LinuxCNC behind something else of its block, which its interpreter does not read.
    #[cold]
    pub(super) fn report_late_label(&mut self, token: Token, findings: &mut FindingLog) {
        self.defect(code::LINE_NUMBER_LATE, token, findings, |mut finding| {
            let number = token.number.value();
            finding.message = format!("N{number} is not the first word of its block: LinuxCNC refuses it there");
            let finding = finding.with_value("number", number, "");
            finding.suggest_replacement(
                "write it at the start of the block, or remove it: a line number moves nothing",
                "",
            )
        });
    }

    /// Whether a token begins the name of a program in `< >`, or what is meant as one: first in its line, behind `O`, or in a call.
    pub(super) fn is_program_name(&self, line: &[u8], token: Token) -> bool {
        let is_letter = token.kind == TokenKind::LoneLetter;
        let opens = if is_letter { token.end } else { token.start } as usize;
        let name = line.get(opens..).unwrap_or_default();
        let name = &name[..name.len().min(LONGEST_NAME)];
        if name.first() != Some(&b'<') || !name.contains(&b'>') {
            return false;
        }
        let before = line[opens.saturating_sub(LONGEST_CALL)..opens].trim_ascii_end();
        match is_letter {
            true => matches!(token.letter, b'O' | b'P'),
            false => self.is_at_start() || before.ends_with(b"98") || ProgramName::read(name).is_some(),
        }
    }

    /// Takes the name of a program that begins here or is called by `M98`, and says where it ends; nothing where the control has no names,
    /// or this is none.
    #[cold]
    pub(super) fn read_program_name(
        &mut self,
        line: &[u8],
        token: Token,
        table: &CodeTable,
        system: System<'_>,
    ) -> Option<usize> {
        let opens = if token.letter == 0 { token.start } else { token.end };
        let begins = self.is_at_start() && token.letter != b'P';
        let is_behind_call = line[..token.start as usize].trim_ascii_end().ends_with(b"98")
            && self.code(Group::Subprogram).is_some_and(|code| table.code(code.place).meaning == Meaning::Call);
        let is_called = token.letter == 0 && is_behind_call && self.rest.is_none();
        if system.settings.is_haas() || !(begins || is_called) {
            return None;
        }
        let (name, length) = ProgramName::read(&line[opens as usize..])?;
        let end = opens + length as u32;
        self.extent = (self.extent.0.min(token.start), end);
        if begins {
            // As the letter O with its number, wherever that may not stand.
            self.letters |= letter_bit(b'O');
            self.words[usize::from(b'O' - b'A')] = Word { number: Number::ZERO, start: token.start, end };
            self.named_program = Some(name.number());
        } else {
            self.rest = Some(Rest::CalledName(opens));
        }
        Some(end as usize)
    }

    /// A program or a call by name that is none; the rest of the line is not read.
    #[cold]
    pub(super) fn report_program_name(
        &mut self,
        line: &[u8],
        token: Token,
        system: System<'_>,
        findings: &mut FindingLog,
    ) {
        self.extent = (self.extent.0.min(token.start), self.extent.1.max(token.end));
        self.has_failed = true;
        let (start, length) =
            (token.start as usize, line[token.start as usize..].iter().position(|&byte| byte == b'>'));
        let end = start + length.map_or(1, |length| length + 1);
        let token = Token { end: end as u32, ..token };
        self.defect(code::NUMBER_MISSING, token, findings, |finding| {
            no_program_name(finding, &line[start..end], system.settings.is_haas())
        });
    }

    #[cold]
    pub(super) fn report_lookalike(&mut self, line: &[u8], stretch: &Stretch, findings: &mut FindingLog) {
        let (start, end) = (stretch.start as u32, stretch.end as u32);
        self.unclear = true;
        self.unread |= letters_in(stretch.text.as_bytes());
        self.extent = (self.extent.0.min(start), self.extent.1.max(end));
        let span = self.span_of(start, end);
        findings.push_with(code::LOOKALIKE, |code| stretch.cured(Finding::new(code, span, stretch.message(line))));
    }

    /// The word that an O directly behind its digits belongs to, with a zero in its place.
    fn zero_written_as_o(line: &[u8], token: Token) -> Option<Stretch> {
        let (at, end) = (token.start as usize, token.end as usize);
        let number = line[..at].iter().rev().take_while(|byte| byte.is_ascii_digit() || b".+-".contains(byte)).count();
        let letter = (at - number).checked_sub(1).filter(|&letter| line[letter].is_ascii_alphabetic());
        let start = letter.filter(|_| number > 0 && line[at].eq_ignore_ascii_case(&b'O'))?;
        let mut text = String::from_utf8_lossy(&line[start..end]).into_owned();
        text.replace_range(at - start..=at - start, "0");
        Some(Stretch { start, end, text, is_certain: true, reads: true })
    }

    /// An O behind other words: a program number is the first word of its block. Directly behind a digit it is a zero.
    #[cold]
    pub(super) fn report_misplaced_o(&mut self, line: &[u8], token: Token, findings: &mut FindingLog) {
        if let Some(stretch) = Self::zero_written_as_o(line, token) {
            return self.report_lookalike(line, &stretch, findings);
        }
        if self.is_labelled_only() {
            return self.defect(code::CHARACTER, token, findings, |mut finding| {
                "O is behind a comment: an O-word is the first of its line".clone_into(&mut finding.message);
                finding.suggest("write the comment behind it")
            });
        }
        self.defect(code::CHARACTER, token, findings, |mut finding| {
            "O is behind other words: a program number is the first word of its block".clone_into(&mut finding.message);
            finding.suggest("write 0, if a zero is meant, or the program number in a block of its own")
        });
    }

    /// Whether something was taken out of a token, which is reported with that.
    #[cold]
    pub(super) fn has_removed(&mut self, line: &[u8], token: Token) -> bool {
        let text = &line[token.start as usize..token.end as usize];
        let has_removed = text.contains(&REMOVED);
        if has_removed {
            self.unclear = true;
            self.unread |= letters_in(text);
        }
        has_removed
    }

    /// Everything that is neither a word nor a comment.
    #[cold]
    pub(super) fn report_defect(&mut self, line: &[u8], token: Token, findings: &mut FindingLog) {
        if let TokenKind::LoneLetter = token.kind
            && let Some(stretch) = Self::zero_written_as_o(line, token)
        {
            return self.report_lookalike(line, &stretch, findings);
        }
        if self.has_removed(line, token) {
            return;
        }
        let is_text = token.kind == TokenKind::Text;
        if is_text && token.start < self.text_end {
            return;
        }
        let (start, end) = (token.start as usize, token.end as usize);
        // A few letters may be a code that is misspelt, as in GO; more are text.
        let is_typing_error = is_text && end - start <= 3;
        let token =
            if is_text && !is_typing_error { Token { end: end_of_text(line, token.end), ..token } } else { token };
        self.text_end = if is_text { token.end } else { self.text_end };
        if matches!(token.kind, TokenKind::Expression | TokenKind::Statement) || is_typing_error {
            self.unread |= letters_in(&line[start..end]);
        }
        let in_a_word = |at: Option<&u8>| at.is_some_and(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(byte));
        // Taking something out of the middle of a word makes another number of it.
        let within = in_a_word(start.checked_sub(1).map(|before| &line[before])) || in_a_word(line.get(end));
        let code = match token.kind {
            TokenKind::HugeNumber => return self.report_huge_number(token, findings),
            TokenKind::MalformedNumber => code::NUMBER_INVALID,
            TokenKind::UnclosedComment => code::COMMENT_UNCLOSED,
            TokenKind::LoneLetter => code::NUMBER_MISSING,
            TokenKind::StrayNumber => code::NUMBER_STRAY,
            TokenKind::Text => code::TEXT,
            TokenKind::Expression | TokenKind::Statement | TokenKind::Output => code::EXPRESSION,
            TokenKind::Nul => code::NUL,
            TokenKind::NotUtf8 => code::NOT_UTF8,
            _ => code::CHARACTER,
        };
        self.defect(code, token, findings, |mut finding| {
            let text = quote(&line[token.start as usize..token.end as usize]);
            let letter = char::from(token.letter);
            let length = token.end - token.start;
            let (message, cure) = match token.kind {
                TokenKind::UnclosedComment => ("the comment is not closed on its line".to_owned(), "close it with )"),
                TokenKind::LoneLetter => (format!("{letter} has no number"), "write its number behind it"),
                TokenKind::MalformedNumber => (
                    format!("the number of {letter} cannot be read"),
                    "write an optional sign, digits and at most one decimal point",
                ),
                TokenKind::StrayNumber => {
                    (format!("the number {text} has no address letter"), "write its letter before it, or remove it")
                }
                TokenKind::Text => (format!("{text} is text outside a comment"), "write comments in ( )"),
                TokenKind::Expression | TokenKind::Statement | TokenKind::Output => (
                    format!("this is no statement that can stand here: {text}"),
                    "write it as the first of its block, or the blocks themselves",
                ),
                TokenKind::Nul => (format!("{length} NUL bytes"), if within { AGAIN } else { "remove them" }),
                TokenKind::NotUtf8 => {
                    (format!("{length} bytes that are not UTF-8 text"), if within { AGAIN } else { "remove them" })
                }
                TokenKind::BlockDelete if !is_label(&line[..start]) => (
                    "/ inside a block skips the rest of it on some controls only".to_owned(),
                    "write what may be skipped in a block of its own that begins with /",
                ),
                TokenKind::BlockDelete => (
                    "/ skips a block where it is the first of it".to_owned(),
                    "write it at the start of the block, before a line number",
                ),
                _ => (format!("{text} has no meaning here"), if within { AGAIN } else { "remove it" }),
            };
            finding.message = message;
            finding.suggest(cure)
        });
    }
}

/// Whether a text is a line number and no more.
fn is_label(text: &[u8]) -> bool {
    text.iter().all(|byte| matches!(byte, b'N' | b'n' | b' ' | b'0'..=b'9'))
}

/// End of a text whose first word ends here: further words of letters alone belong to it.
fn end_of_text(line: &[u8], end: u32) -> u32 {
    let words = Lexer::from(line, end as usize).take_while(|token| token.kind == TokenKind::Text);
    words.last().map_or(end, |last| last.end)
}

/// The text of a token for a message: readable and short whatever it holds.
pub(crate) fn quote(text: &[u8]) -> String {
    const LONGEST: usize = 40;
    let shown = String::from_utf8_lossy(&text[..text.len().min(LONGEST)]);
    let more = if text.len() > LONGEST { "…" } else { "" };
    format!("{shown:?}{more}")
}
