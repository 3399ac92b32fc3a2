//! Parser: one line in, one [`Block`] of words out, recovering from whatever is wrong with it.

mod codes;
mod comment;
mod computed;
mod corner;
mod defect;
mod machine;
mod plain;
mod polar;
mod spindle_number;

use crate::code;
use crate::dialect::{CodeTable, Flow, GROUP_COUNT, Group, Letter, Meaning, letter_bit};
use crate::expression::Assignment;
use crate::finding::FindingMark;
use crate::interpreter::{System, is_conditional_return};
use crate::lexer::{Lexer, REMOVED, Token, TokenKind};
use crate::lookalike::{self, Stretch};
use crate::number::Number;
use crate::{FindingLog, SourceSpan};

use corner::CommaWords;
use machine::MachineWords;

pub(crate) use defect::{no_program_name, quote};
pub(crate) use machine::MachineWord;
pub(crate) use polar::PolarWords;

/// Numbers beyond this are mistakes: a thousand kilometres. It keeps all later arithmetic finite.
const LARGEST_NUMBER: f64 = 1e9;

/// Largest line or program number: eight digits, as long as controls take them.
const LARGEST_LABEL: f64 = 99_999_999.0;

/// Whether a number can be a line or a program number.
#[inline]
fn is_label(number: Number) -> bool {
    // A number that is not whole, negative, or beyond `u32` is another one as `u32`.
    let whole = number.value() as u32;
    f64::from(whole) == number.value() && whole <= LARGEST_LABEL as u32
}

/// Whether a number is a line number of LinuxCNC with a fraction (`N10.5`), which only tells lines apart.
fn is_divided_label(number: Number) -> bool {
    let has_whole_part = number.has_point() && number.integer_digits() > 0;
    has_whole_part && (0.0..=LARGEST_LABEL).contains(&number.value())
}

/// Whether this is a number behind two or more signs.
fn is_number_of_signs(text: &[u8]) -> bool {
    let text = text.trim_ascii();
    let signs = text.iter().take_while(|byte| matches!(byte, b'+' | b'-')).count();
    let number = &text[signs..];
    let points = number.iter().filter(|byte| **byte == b'.').count();
    let digits = number.iter().filter(|byte| byte.is_ascii_digit()).count();
    signs >= 2 && points <= 1 && digits > 0 && points + digits == number.len()
}

/// A word: its place and its value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Word {
    pub(crate) number: Number,
    start: u32,
    end: u32,
}

/// A code word: the code and its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CodeWord {
    /// Place in the code table.
    pub(crate) place: u8,
    start: u32,
    end: u32,
}

/// An assignment of a line, with its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    pub(crate) assignment: Assignment,
    pub(crate) span: SourceSpan,
}

/// What of a line is no word, and where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rest {
    /// A statement of Macro B.
    Statement(u32),
    /// An O-word.
    OWord(u32),
    /// The arguments of a macro call, for every block that moves where it is modal.
    Arguments { at: u32, modal: bool },
    /// The name in `< >` of the program that a call names so; words may follow.
    CalledName(u32),
}

/// The words of one line. Storage is fixed and reused: masks say which slots hold words of the present line.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Which program it is of.
    program: u32,
    /// Line number, from 1.
    line: u32,
    /// First byte of the first word and end of the last.
    extent: (u32, u32),
    /// Letters present, one bit each; `G` and `M` words are in `groups`.
    pub(crate) letters: u32,
    words: [Word; 26],
    /// Groups present, one bit each.
    groups: u32,
    codes: [CodeWord; GROUP_COUNT],
    /// M codes of the machine.
    machine: MachineWords,
    /// What of the line is no word: a control statement, or the arguments of a macro.
    pub(crate) rest: Option<Rest>,
    commas: CommaWords,
    polar: Option<PolarWords>,
    /// Offsets of start and end of `$` with its number, and whether that is all spindles.
    spindle_number: Option<(u32, u32, bool)>,
    /// A program begins here by a name in `< >`, which stands in the place of its `O`: the number that the name means, where it is one.
    pub(crate) named_program: Option<Option<u32>>,
    /// A leading `%`.
    pub(crate) percent: Option<SourceSpan>,
    /// Something in the block could not be understood, so that what its words mean together is unknown.
    pub(crate) unclear: bool,
    /// Letters of words that could not be read, one bit each; `G` and `M` too.
    pub(crate) unread: u32,
    /// The assignments of the line, in order.
    pub(crate) assignments: Vec<Made>,
    /// Offsets of the last comment's start and end.
    pub(crate) comment: (u32, u32),
    /// An expression could not be evaluated, so that the program cannot go on.
    pub(crate) has_failed: bool,
    /// End of the last text, which is one finding.
    text_end: u32,
    /// Codes that the profile replaces by a call are what they are without it, as the program was called by such a code.
    keeps_codes: bool,
    /// What calls a program stands in the place of a code.
    pub(crate) calls_by_code: bool,
}

impl Default for Block {
    fn default() -> Self {
        let word = Word { number: Number::ZERO, start: 0, end: 0 };
        let code = CodeWord { place: 0, start: 0, end: 0 };
        Self {
            program: 0,
            line: 0,
            extent: (0, 0),
            letters: 0,
            words: [word; 26],
            groups: 0,
            codes: [code; GROUP_COUNT],
            machine: MachineWords::default(),
            rest: None,
            commas: CommaWords::default(),
            polar: None,
            spindle_number: None,
            named_program: None,
            percent: None,
            unclear: false,
            unread: 0,
            assignments: Vec::new(),
            comment: (0, 0),
            has_failed: false,
            text_end: 0,
            keeps_codes: false,
            calls_by_code: false,
        }
    }
}

impl Block {
    /// Reads a line (without its terminator) into this block, replacing the block before. `mark` is how far `findings` was
    /// filled before.
    #[allow(clippy::too_many_arguments, reason = "each is borrowed from another part of the interpreter")]
    #[inline]
    pub(crate) fn parse(
        &mut self,
        line: &[u8],
        (program, line_number): (u32, u32),
        table: &CodeTable,
        block_delete: bool,
        system: System<'_>,
        findings: &mut FindingLog,
        mark: &FindingMark,
    ) {
        (self.program, self.line) = (program, line_number);
        self.clear();
        self.keeps_codes = table.has_replacements() && system.state.flow.is_called_by_code();
        let at = self.parse_words(line, table, findings);
        if at < line.len() {
            self.parse_others(at, line, table, block_delete, system, findings, mark);
        }
    }

    /// Reads a line from its first token on that is no plain word.
    // As long as the kinds of tokens.
    #[allow(clippy::too_many_arguments, reason = "those of `parse`")]
    #[inline(never)]
    fn parse_others(
        &mut self,
        at: usize,
        line: &[u8],
        table: &CodeTable,
        block_delete: bool,
        system: System<'_>,
        findings: &mut FindingLog,
        mark: &FindingMark,
    ) {
        let mut slash_seen = false;
        let mut looked = false;
        let mut removed_to = 0;
        let mut tokens = Lexer::from(line, at);
        let o_words = || table.dialect.flow == Flow::OWords;
        loop {
            if let Some(token) = tokens.next_word() {
                if token.letter == b'O' {
                    let is_first = self.is_labelled_only();
                    if !is_first || o_words() && self.comment.1 != 0 {
                        self.report_misplaced_o(line, token, findings);
                        // A statement that is not carried out: what follows is not known.
                        if is_first {
                            (self.extent, self.has_failed) = ((token.start, token.end), true);
                            return;
                        }
                        continue;
                    }
                    if o_words() {
                        return self.begin_rest(Rest::OWord(token.start));
                    }
                }
                self.add_word(token, table, findings);
                if self.has_no_more_words() {
                    return;
                }
                continue;
            }
            if tokens.is_at_end() {
                break;
            }
            let Some(token) = tokens.next() else { break };
            match token.kind {
                TokenKind::LoneLetter | TokenKind::Unexpected
                    if !table.dialect.is_linuxcnc && self.is_program_name(line, token) =>
                {
                    let Some(end) = self.read_program_name(line, token, table, system) else {
                        return self.report_program_name(line, token, system, findings);
                    };
                    tokens = Lexer::from(line, end);
                }
                TokenKind::Unexpected if table.dialect.is_linuxcnc && line[token.start as usize] == b'$' => {
                    let end = self.read_spindle_number(line, token, table, system, findings);
                    if self.has_failed {
                        return;
                    }
                    tokens = Lexer::from(line, end);
                }
                // Words with characters that only look like others are read again as a whole, the rest without them.
                TokenKind::Unexpected | TokenKind::NotUtf8 if !looked => {
                    looked = true;
                    let stretches = lookalike::find(line);
                    if !stretches.is_empty() {
                        findings.rewind(*mark);
                        return self.parse_without(&stretches, line, table, block_delete, system, findings, mark);
                    }
                    self.report_defect(line, token, findings);
                }
                TokenKind::LoneLetter | TokenKind::Computed | TokenKind::Expression
                    if token.letter == b'O' && o_words() && self.is_labelled_only() && self.comment.1 == 0 =>
                {
                    return self.begin_rest(Rest::OWord(token.start));
                }
                TokenKind::Corner => self.add_comma_word(line, token, table, findings),
                TokenKind::Statement if self.is_labelled_only() => {
                    return self.begin_rest(Rest::Statement(token.start));
                }
                // A condition without IF.
                TokenKind::Expression
                    if token.letter != b'O'
                        && !o_words()
                        && is_conditional_return(line, token.start as usize)
                        && self.is_labelled_only() =>
                {
                    return self.begin_rest(Rest::Statement(token.start));
                }
                TokenKind::Comment => {
                    self.comment = (token.start, token.end);
                    self.check_comment(line, token, table, findings);
                    if self.is_nested_comment(line, token, table, findings) {
                        return;
                    }
                }
                TokenKind::Computed | TokenKind::ComputedCorner | TokenKind::Assignment => {
                    self.read_computed(line, token, table, system, findings);
                    if self.has_failed {
                        return;
                    }
                }
                // Any number of signs is read there.
                TokenKind::MalformedNumber
                    if table.dialect.is_linuxcnc
                        && is_number_of_signs(&line[token.start as usize + 1..token.end as usize]) =>
                {
                    self.read_computed(line, Token { kind: TokenKind::Computed, ..token }, table, system, findings);
                    if self.has_failed {
                        return;
                    }
                }
                TokenKind::Output if table.expressions.has_output => {
                    self.note_output(token.start, token.end, findings);
                }
                // LinuxCNC knows it before the line number only.
                TokenKind::BlockDelete
                    if !slash_seen && self.is_labelled_only() && (self.is_at_start() || !table.dialect.is_linuxcnc) =>
                {
                    slash_seen = true;
                    if block_delete {
                        break;
                    }
                }
                TokenKind::Percent if self.extent.0 == u32::MAX && self.percent.is_none() => {
                    self.percent = Some(self.span_of(token.start, token.end));
                }
                TokenKind::Polar if table.dialect.is_linuxcnc => {
                    self.read_polar(line, token, table, system, findings);
                    if self.has_failed {
                        return;
                    }
                }
                TokenKind::UnclosedComment => {
                    self.report_defect(line, token, findings);
                    self.check_comment(line, token, table, findings);
                }
                // It is reported with what was taken out, and so is a number directly behind.
                TokenKind::Removed => removed_to = token.end as usize,
                TokenKind::StrayNumber
                    if removed_to > 0 && line[removed_to..token.start as usize].trim_ascii().is_empty() => {}
                _ => self.report_defect(line, token, findings),
            }
        }
        if !self.assignments.is_empty() {
            self.check_assignments(table, findings);
        }
        if self.spindle_number.is_some() {
            self.check_spindle_number(table, findings);
        }
        if self.polar.is_some() {
            self.take_polar(table, system.state.plane, findings);
        }
    }

    /// Reads what is left of a line without words that only look like such, and reports those.
    #[cold]
    #[allow(clippy::too_many_arguments, reason = "those of `parse`")]
    fn parse_without(
        &mut self,
        stretches: &[Stretch],
        line: &[u8],
        table: &CodeTable,
        block_delete: bool,
        system: System<'_>,
        findings: &mut FindingLog,
        mark: &FindingMark,
    ) {
        let mut rest = line.to_vec();
        for stretch in stretches {
            rest[stretch.start..stretch.end].fill(REMOVED);
        }
        self.parse(&rest, (self.program, self.line), table, block_delete, system, findings, mark);
        for stretch in stretches {
            self.report_lookalike(line, stretch, findings);
        }
    }

    #[cold]
    fn begin_rest(&mut self, rest: Rest) {
        self.rest = Some(rest);
    }

    fn clear(&mut self) {
        self.extent = (u32::MAX, 0);
        self.letters = 0;
        self.groups = 0;
        self.machine.clear();
        self.rest = None;
        self.commas.clear();
        self.polar = None;
        self.spindle_number = None;
        self.named_program = None;
        self.percent = None;
        self.unclear = false;
        self.unread = 0;
        self.assignments.clear();
        self.comment = (0, 0);
        self.has_failed = false;
        self.text_end = 0;
        self.calls_by_code = false;
    }

    /// Whether there is more than words: an assignment, a comment that may be active, or a failure.
    #[inline]
    pub(crate) const fn needs_assigning(&self) -> bool {
        self.comment.1 != 0 || self.has_failed || !self.assignments.is_empty()
    }

    /// Whether what is left of the line is not read as words.
    const fn has_no_more_words(&self) -> bool {
        self.has_failed || !matches!(self.rest, None | Some(Rest::CalledName(_)))
    }

    /// Whether no word was read but a line number.
    const fn is_labelled_only(&self) -> bool {
        self.letters & !letter_bit(b'N') == 0 && !self.has_codes()
    }

    /// Whether nothing of the line but blanks, and what skips it, has been read.
    #[inline(always)]
    fn is_at_start(&self) -> bool {
        self.extent.0 == u32::MAX && self.comment.1 == 0 && self.assignments.is_empty()
    }

    /// Whether a block with a macro call has words or other codes before it, beside a line number.
    pub(crate) fn has_words_before_call(&self) -> bool {
        let of_replacement = if self.calls_by_code { letter_bit(b'P') | letter_bit(b'L') } else { 0 };
        self.letters & !(letter_bit(b'N') | of_replacement) != 0 || !self.has_only(Group::MacroCall)
    }

    /// Whether there is any word at all.
    pub(crate) const fn is_empty(&self) -> bool {
        self.extent.0 == u32::MAX
    }

    /// Whether the line has nothing that could be executed: it is empty, or a comment.
    pub(crate) const fn is_nothing(&self) -> bool {
        self.is_empty()
            && self.percent.is_none()
            && self.rest.is_none()
            && self.assignments.is_empty()
            && !self.has_failed
    }

    /// Its words and assignments, without a line number.
    pub(crate) fn word_count(&self) -> u32 {
        let words = (self.letters & !letter_bit(b'N')).count_ones() + self.groups.count_ones();
        words + u32::from(!self.machine.is_empty()) + self.assignments.len() as u32
    }

    /// From the first word to the last.
    #[inline]
    pub(crate) const fn span(&self) -> SourceSpan {
        self.span_of(self.extent.0, self.extent.1)
    }

    #[inline]
    const fn span_of(&self, start: u32, end: u32) -> SourceSpan {
        SourceSpan { program: self.program, line: self.line, column: start + 1, length: end - start }
    }

    /// `N`, a whole number that was looked at as it was read.
    #[inline]
    pub(crate) fn sequence_number(&self) -> Option<u32> {
        self.word(b'N').map(|word| word.number.value() as u32)
    }

    /// The word with this letter.
    #[inline]
    pub(crate) const fn word(&self, letter: u8) -> Option<&Word> {
        if self.letters & letter_bit(letter) == 0 { None } else { Some(&self.words[(letter - b'A') as usize]) }
    }

    /// The word of the letter at this place in the alphabet; only meaningful where its bit in `letters` is set.
    #[inline]
    pub(crate) const fn slot(&self, place: usize) -> &Word {
        &self.words[place]
    }

    #[inline]
    pub(crate) const fn word_span(&self, word: &Word) -> SourceSpan {
        self.span_of(word.start, word.end)
    }

    /// The code of this group.
    #[inline]
    pub(crate) const fn code(&self, group: Group) -> Option<&CodeWord> {
        if self.groups & (1 << group as u32) == 0 { None } else { Some(&self.codes[group as usize]) }
    }

    #[inline]
    pub(crate) const fn code_span(&self, code: &CodeWord) -> SourceSpan {
        self.span_of(code.start, code.end)
    }

    /// Whether there is any code.
    #[inline]
    pub(crate) const fn has_codes(&self) -> bool {
        self.groups != 0 || !self.machine.is_empty()
    }

    /// Whether it has no code but M codes of the machine.
    #[inline]
    pub(crate) const fn has_only_machine_codes(&self) -> bool {
        self.groups == 0
    }

    /// Whether there is a code of this group, and no other.
    #[inline]
    pub(crate) const fn has_only(&self, group: Group) -> bool {
        self.groups == 1 << group as u32 && self.machine.is_empty()
    }

    /// Whether there is any code but one of motion.
    #[inline]
    pub(crate) const fn has_codes_besides_motion(&self) -> bool {
        self.groups & !(1 << Group::Motion as u32) != 0 || !self.machine.is_empty()
    }

    /// Whether the block is nothing but words of these letters and perhaps a line number and a code of motion.
    #[inline]
    pub(crate) const fn is_motion_of(&self, letters: u32) -> bool {
        self.letters & !(letters | letter_bit(b'N')) == 0
            && !self.has_codes_besides_motion()
            && !self.needs_assigning()
            && self.unread == 0
            && !self.unclear
            && !self.has_comma_words()
            && self.percent.is_none()
    }

    /// Adds a word, or says what is wrong with it.
    fn add_word(&mut self, token: Token, table: &CodeTable, findings: &mut FindingLog) {
        let Token { letter, number, start, end, .. } = token;
        if number.is_spaced() || !self.take_value(usize::from(letter - b'A'), number, (start, end), table) {
            self.add_other_word(token, table, findings);
        }
    }

    /// Takes a word that is a number and no more and the first of its letter, as most are: it needs nothing but its place. `false` where
    /// there is something to say of it.
    #[inline(always)]
    fn take_value(&mut self, place: usize, number: Number, (start, end): (u32, u32), table: &CodeTable) -> bool {
        let bit = 1 << place;
        let fits = match bit == letter_bit(b'N') {
            true => is_label(number) && (self.is_at_start() || !table.dialect.is_linuxcnc),
            false => number.value().abs() <= LARGEST_NUMBER,
        };
        if bit & table.value_letters & !self.letters == 0 || !fits {
            return false;
        }
        self.extent = (self.extent.0.min(start), end);
        self.letters |= bit;
        self.words[place] = Word { number, start, end };
        true
    }

    /// A code, or a word that may be refused.
    #[inline(never)]
    fn add_other_word(&mut self, token: Token, table: &CodeTable, findings: &mut FindingLog) {
        let Token { letter, number, .. } = token;
        let is_first = self.is_at_start();
        self.extent.0 = self.extent.0.min(token.start);
        self.extent.1 = token.end;
        let place = usize::from(letter - b'A');
        let meaning = table.dialect.letters[place];
        if number.is_spaced() {
            self.report_spaces(token, findings);
        }
        match meaning {
            Letter::Code => return self.add_code(token, table, findings),
            // G187 is the one code of a mill that takes E.
            Letter::Unknown if letter == b'E' && self.has_smoothness(table) => {}
            Letter::Unknown => {
                return self.defect(code::WORD_UNKNOWN, token, findings, move |mut finding| {
                    finding.message = format!("address letter {} is not known", char::from(letter));
                    finding
                });
            }
            // Two of them are one finding, that they are.
            Letter::Label
                if letter == b'N' && table.dialect.is_linuxcnc && !is_first && self.letters & letter_bit(b'N') == 0 =>
            {
                return self.report_late_label(token, findings);
            }
            Letter::Label if letter == b'N' && table.dialect.is_linuxcnc && is_divided_label(number) => {}
            Letter::Label if !is_label(number) => return self.report_label(token, findings),
            Letter::Label => {}
            _ if number.value().abs() > LARGEST_NUMBER => {
                return self.report_huge_number(token, findings);
            }
            _ => {}
        }
        let bit = letter_bit(letter);
        if self.letters & bit != 0 {
            let first = self.words[place].number.value();
            return self.defect(code::WORD_DUPLICATE, token, findings, move |mut finding| {
                let letter = char::from(letter);
                finding.message = format!("{letter} occurs twice in the block: first {first}, then {}", number.value());
                finding.with_value("first", first, "").with_value("second", number.value(), "")
            });
        }
        self.letters |= bit;
        self.words[place] = Word { number, start: token.start, end: token.end };
    }

    fn has_smoothness(&self, table: &CodeTable) -> bool {
        self.code(Group::NonModal).is_some_and(|code| table.code(code.place).meaning == Meaning::Smoothness)
    }
}
