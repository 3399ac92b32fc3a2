//! What is where in a program, for editors: programs, labels, loops, and what calls and jumps mean. Nothing is executed,
//! so a program with errors has an outline as well.

use self::framing::Framing;
use crate::dialect::{CodeTable, Flow, Letter, Meaning};
use crate::interpreter::{Statement, called_program, classify, digits, find_line_end, name};
use crate::lexer::{Lexer, Token, TokenKind, behind_blanks};
use crate::number::Number;
use crate::state::TurningCycle;
use crate::{Function, LanguageSettings, ProgramName, SourceSpan};

mod framing;
#[cfg(test)]
mod tests;

/// Most entries of each kind that are kept.
const MAX_ENTRIES: usize = 1 << 18;

/// A stretch of lines that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// What it is.
    pub kind: StretchKind,
    /// As it is written: `O1000`, `<SHAFT>`, `o<rect> sub`, `WHILE DO1`; the comment or the function's name of others.
    pub name: String,
    /// The first line, counted from 1.
    pub first_line: u32,
    /// The last line; the same where it is not closed.
    pub last_line: u32,
}

/// What a [`Stretch`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StretchKind {
    /// A program by its number or name, up to the next one.
    Program,
    /// `o… sub` to `endsub`.
    Subprogram,
    /// A loop, or a branch of an O-word.
    Block,
    /// A machining function, from its code to the one that ends it.
    Function,
    /// Lines with nothing but comments.
    Comment,
}

/// What a call or a jump names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// A program, and a label in it.
    Program {
        /// `O1000`, `<SHAFT>`
        name: ProgramName,
        /// `N`
        label: Option<u32>,
    },
    /// A label of the same program.
    Label(u32),
    /// A subprogram of the O-word language by its number or `<name>`.
    Subprogram(String),
}

/// The outline of one program file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// Stretches, ascending by their first line.
    pub stretches: Vec<Stretch>,
    /// `N` with its line, in the order of the lines.
    labels: Vec<(u32, u32)>,
    /// Programs with their first lines.
    programs: Vec<(ProgramName, u32)>,
    /// Subprograms by name, with their lines.
    subprograms: Vec<(String, u32)>,
    /// How the file begins and ends.
    framing: Framing,
    /// Lines, empty ones included.
    pub lines: u32,
}

impl Outline {
    /// What its programs are called by, in their order.
    pub fn program_names(&self) -> impl Iterator<Item = &ProgramName> {
        self.programs.iter().map(|(name, _)| name)
    }

    /// The names of its subprograms in the O-word language, as they are written, in their order.
    pub fn subprogram_names(&self) -> impl Iterator<Item = &str> {
        self.subprograms.iter().map(|(name, _)| name.as_str())
    }

    /// Reads a program. Lines are counted as the interpreter counts them; more than a quarter million of one kind are left
    /// out.
    #[must_use]
    pub fn read(program: &[u8], settings: &LanguageSettings) -> Self {
        let mut reading = OutlineReading {
            outline: Self::default(),
            open: Vec::new(),
            functions: Vec::new(),
            comment: None,
            vocabulary: Vocabulary::new(settings),
        };
        for line in lines(program) {
            reading.line(line);
        }
        reading.finish()
    }

    /// The lines, counted from 1, that a target named on `line` means: none, one, or several where it is not unique.
    #[must_use]
    pub fn find(&self, target: &Target, line: u32) -> Vec<u32> {
        match target {
            Target::Label(label) => self.labels_near(*label, line),
            Target::Program { name, label: None } => self.starts_of(name).collect(),
            Target::Program { name, label: Some(label) } => {
                self.starts_of(name).flat_map(|line| self.labels_near(*label, line)).collect()
            }
            Target::Subprogram(name) => {
                self.subprograms.iter().filter(|(known, _)| known == name).map(|(_, line)| *line).collect()
            }
        }
    }

    /// The first lines of the programs of this name.
    fn starts_of<'a>(&'a self, wanted: &'a ProgramName) -> impl Iterator<Item = u32> + 'a {
        self.programs.iter().filter(move |(name, _)| name == wanted).map(|(_, line)| *line)
    }

    /// Labels within the program that holds `line`.
    fn labels_near(&self, label: u32, line: u32) -> Vec<u32> {
        let behind = self.programs.partition_point(|(_, start)| *start <= line);
        let start = behind.checked_sub(1).map_or(1, |place| self.programs[place].1);
        let end = self.programs.get(behind).map_or(u32::MAX, |(_, start)| *start);
        let here = self.labels.iter().filter(|(number, line)| *number == label && (start..end).contains(line));
        here.map(|(_, line)| *line).collect()
    }
}

/// The lines of a program without their ends.
fn lines(program: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = program.strip_prefix(b"\xef\xbb\xbf").unwrap_or(program);
    core::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let length = find_line_end(rest).unwrap_or(rest.len());
        let (line, behind) = rest.split_at(length);
        let end = if behind.starts_with(b"\r\n") { 2 } else { usize::from(!behind.is_empty()) };
        rest = &behind[end..];
        Some(line)
    })
}

/// An outline while it is made.
struct OutlineReading {
    outline: Outline,
    /// Places of the stretches of statements that are open, with their names.
    open: Vec<(Statement, String, usize)>,
    /// Places of the functions that are on.
    functions: Vec<(Function, usize)>,
    /// Place of the run of comments that may go on.
    comment: Option<usize>,
    vocabulary: Vocabulary,
}

impl OutlineReading {
    fn line(&mut self, text: &[u8]) {
        self.outline.lines = self.outline.lines.saturating_add(1);
        let line = self.outline.lines;
        let flow = self.vocabulary.table.dialect.flow;
        let found = classify(text, flow, false);
        let room = |count: usize| count < MAX_ENTRIES;
        if let Some(label) = found.label.filter(|_| room(self.outline.labels.len())) {
            self.outline.labels.push((label, line));
        }
        if let Some(name) = found.program.filter(|_| room(self.outline.programs.len())) {
            self.end_program(line - 1);
            self.begin(StretchKind::Program, name.to_string(), line);
            self.outline.programs.push((name, line));
        }
        let frames = matches!(found.statement, Some((Statement::Sub | Statement::EndSub, _)));
        if let Some((what, name)) = found.statement {
            self.statement(what, name, line);
        }
        if may_have_codes(text) {
            self.functions(text, line);
        }
        let is_within = frames || self.open.iter().any(|(what, ..)| *what == Statement::Sub);
        self.outline.framing.read(text, is_within, &self.vocabulary);
        self.comment(text, line);
    }

    fn begin(&mut self, kind: StretchKind, name: String, line: u32) -> Option<usize> {
        let place = self.outline.stretches.len();
        (place < MAX_ENTRIES).then(|| {
            self.outline.stretches.push(Stretch { kind, name, first_line: line, last_line: line });
            place
        })
    }

    /// The program that is open ends with this line, and so does what it left open.
    fn end_program(&mut self, line: u32) {
        self.open.clear();
        let mut programs = self.outline.stretches.iter_mut().rev();
        if let Some(last) = programs.find(|stretch| stretch.kind == StretchKind::Program) {
            last.last_line = line;
        }
    }

    fn statement(&mut self, what: Statement, name: String, line: u32) {
        // `while` closes a `do` of its name.
        let closes = |open: &(Statement, String, usize)| {
            open.1 == name
                && match what {
                    Statement::EndDo => open.0 == Statement::Do,
                    Statement::EndSub => open.0 == Statement::Sub,
                    Statement::EndIf => open.0 == Statement::If,
                    Statement::EndWhile => open.0 == Statement::While,
                    Statement::While => open.0 == Statement::DoWhile,
                    Statement::EndRepeat => open.0 == Statement::Repeat,
                    _ => false,
                }
        };
        if let Some(depth) = self.open.iter().rposition(closes) {
            let place = self.open[depth].2;
            self.outline.stretches[place].last_line = line;
            self.open.truncate(depth);
            return;
        }
        let kind = match what {
            Statement::Sub => StretchKind::Subprogram,
            Statement::Do | Statement::If | Statement::While | Statement::DoWhile | Statement::Repeat => {
                StretchKind::Block
            }
            _ => return,
        };
        if what == Statement::Sub && self.outline.subprograms.len() < MAX_ENTRIES {
            self.outline.subprograms.push((name.clone(), line));
        }
        let shown = if what == Statement::Do { format!("DO{name}") } else { format!("o{name} {}", what.word()) };
        if let Some(place) = self.begin(kind, shown, line) {
            self.open.push((what, name, place));
        }
    }

    fn functions(&mut self, text: &[u8], line: u32) {
        let block = Block::of(text);
        for token in block.codes() {
            let Some((function, on)) = self.vocabulary.switches(token, &block) else { continue };
            let open = self.functions.iter().position(|(known, _)| *known == function);
            if let Some(open) = open {
                let (_, place) = self.functions.remove(open);
                self.outline.stretches[place].last_line = if on { line.saturating_sub(1) } else { line };
            }
            if on && let Some(place) = self.begin(StretchKind::Function, function_name(function).to_owned(), line) {
                self.functions.push((function, place));
            }
        }
    }

    fn comment(&mut self, text: &[u8], line: u32) {
        let mut tokens = Lexer::new(text).peekable();
        let only = tokens.peek().is_some() && tokens.all(|token| token.kind == TokenKind::Comment);
        match (self.comment, only) {
            (Some(place), true) => self.outline.stretches[place].last_line = line,
            (None, true) => {
                let shown = String::from_utf8_lossy(text.trim_ascii()).into_owned();
                self.comment = self.begin(StretchKind::Comment, shown, line);
            }
            (_, false) => self.comment = None,
        }
    }

    fn finish(mut self) -> Outline {
        let last = self.outline.lines;
        self.end_program(last);
        for (_, place) in core::mem::take(&mut self.functions) {
            self.outline.stretches[place].last_line = last;
        }
        // Comments of one line are none worth folding.
        self.outline.stretches.retain(|it| it.kind != StretchKind::Comment || it.last_line > it.first_line);
        self.outline
    }
}

/// Whether a line may have a code at all: a quick look before it is read.
fn may_have_codes(text: &[u8]) -> bool {
    text.iter().any(|byte| matches!(byte, b'G' | b'g' | b'M' | b'm'))
}

const fn function_name(function: Function) -> &'static str {
    match function {
        Function::PathVibration => "vibration along the path",
        Function::ThreadVibration => "vibration of threads",
        Function::Thinning => "thinning",
        Function::ToolOscillation => "tool oscillation",
    }
}

/// The plain words of a line.
struct Block {
    words: Vec<Token>,
}

impl Block {
    fn of(line: &[u8]) -> Self {
        Self { words: Lexer::new(line).filter(|token| token.kind == TokenKind::Word).collect() }
    }

    fn codes(&self) -> impl Iterator<Item = &Token> {
        self.words.iter().filter(|token| matches!(token.letter, b'G' | b'M'))
    }

    fn word(&self, letter: u8) -> Option<&Token> {
        self.words.iter().find(|token| token.letter == letter)
    }

    /// A word that is a whole number of at most eight digits.
    fn whole(&self, letter: u8) -> Option<(u32, &Token)> {
        let token = self.word(letter)?;
        let value = token.number.value();
        ((0.0..=99_999_999.0).contains(&value) && libm::rint(value) == value).then_some((value as u32, token))
    }
}

/// What a word is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordRole {
    /// A code that moves: `G0` to `G3`, cycles, threads.
    Motion,
    /// A code of a machining function.
    Function,
    /// A call, a jump or a return.
    Call,
    /// Any other code that the machine knows.
    Code,
    /// A code that it does not know.
    UnknownCode,
    /// `N`, `O`
    Label,
    /// An axis.
    Axis,
    /// `I`, `J`, `K`, `R`
    Centre,
    /// `F`
    Feed,
    /// `S`
    Speed,
    /// `T`
    Tool,
    /// A parameter of a code.
    Parameter,
    /// A letter without a meaning.
    Unknown,
}

/// What letters and codes mean on a machine, whatever is around them.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    table: CodeTable,
    settings: LanguageSettings,
}

impl Vocabulary {
    /// That of a machine.
    #[must_use]
    pub fn new(settings: &LanguageSettings) -> Self {
        Self { table: CodeTable::new(settings), settings: settings.clone() }
    }

    /// What a plain word is for.
    #[must_use]
    pub fn role(&self, word: &Token) -> WordRole {
        if matches!(word.letter, b'G' | b'M') {
            return self.code_role(word);
        }
        let Some(place) = word.letter.checked_sub(b'A').filter(|place| *place < 26) else { return WordRole::Unknown };
        match self.table.dialect.letters[usize::from(place)] {
            Letter::Unknown => WordRole::Unknown,
            Letter::Code => WordRole::Code,
            Letter::Label => WordRole::Label,
            Letter::Axis(_) | Letter::Increment(_) => WordRole::Axis,
            Letter::Centre(_) | Letter::Radius => WordRole::Centre,
            Letter::Feed => WordRole::Feed,
            Letter::Speed => WordRole::Speed,
            Letter::Tool => WordRole::Tool,
            Letter::Parameter => WordRole::Parameter,
        }
    }

    fn code_role(&self, word: &Token) -> WordRole {
        let number = word.number.value();
        let Some(meaning) = self.meaning(word) else {
            let machine = word.letter == b'M' && self.table.machine_rule(number).is_some();
            return if machine { WordRole::Code } else { WordRole::UnknownCode };
        };
        match meaning {
            Meaning::Function { .. } | Meaning::FunctionSwitch(_) => WordRole::Function,
            Meaning::Call | Meaning::LocalCall | Meaning::MacroCall { .. } | Meaning::Return => WordRole::Call,
            Meaning::Replaced(place) if self.table.replacement(place).calls => WordRole::Call,
            Meaning::Rapid | Meaning::Linear | Meaning::Arc { .. } | Meaning::Turning(_) => WordRole::Motion,
            _ => WordRole::Code,
        }
    }

    fn meaning(&self, word: &Token) -> Option<Meaning> {
        self.table.find(word.letter, word.number.value()).map(|place| self.table.code(place).meaning)
    }

    /// The machining function that a code switches, and whether on.
    fn switches(&self, code: &Token, block: &Block) -> Option<(Function, bool)> {
        match self.meaning(code)? {
            Meaning::Function { function, on } => Some((function, on)),
            Meaning::FunctionSwitch(function) => {
                let switch = self.settings.thread_vibration;
                let (p, _) = block.whole(b'P')?;
                (p == switch.on_p || p == switch.off_p).then_some((function, p == switch.on_p))
            }
            _ => None,
        }
    }

    /// What the calls and jumps of a line name, each with its place: `program` and `line` of the span are 0.
    #[must_use]
    pub fn targets(&self, line: &[u8]) -> Vec<(SourceSpan, Target)> {
        let mut targets = Vec::new();
        let flow = self.table.dialect.flow;
        if flow == Flow::OWords
            && let Some((Statement::Call, called)) = classify(line, flow, false).statement
            && let Some(start) = line.iter().position(|byte| matches!(byte, b'O' | b'o'))
            && let Some((_, end)) = name(line, start + 1)
        {
            targets.push((span(start, end), Target::Subprogram(called)));
        }
        for token in Lexer::new(line).filter(|token| flow == Flow::MacroB && token.kind == TokenKind::Statement) {
            targets.extend(go_to(line, token.start as usize));
        }
        let block = Block::of(line);
        for code in block.codes() {
            self.targets_of(code, &block, line, &mut targets);
        }
        targets
    }

    /// The name in `< >` that a call has directly behind its code.
    fn called_name(&self, line: &[u8], at: usize) -> Option<(SourceSpan, ProgramName)> {
        if self.table.dialect.flow != Flow::MacroB || self.settings.is_haas() {
            return None;
        }
        let start = behind_blanks(line, at);
        let (name, length) = ProgramName::read(line.get(start..)?)?;
        Some((span(start, start + length), name))
    }

    fn targets_of(&self, code: &Token, block: &Block, line: &[u8], targets: &mut Vec<(SourceSpan, Target)>) {
        let place = |token: &Token| span(token.start as usize, token.end as usize);
        let mut add = |letter: u8, target: &dyn Fn(u32) -> Target| {
            if let Some((number, token)) = block.whole(letter) {
                targets.push((place(token), target(number)));
            }
        };
        match self.meaning(code) {
            Some(Meaning::Replaced(replaced)) => {
                let words = self.table.replacement(replaced).words.iter();
                let token = |&(letter, number): &(u8, Number)| Token { letter, number, ..*code };
                let within = Block { words: words.map(token).collect() };
                let calls = within.codes().filter(|code| !matches!(self.meaning(code), Some(Meaning::Replaced(_))));
                calls.for_each(|call| self.targets_of(call, &within, &[], targets));
            }
            Some(Meaning::LocalCall) => add(b'P', &Target::Label),
            Some(Meaning::MacroCall { .. }) => match self.called_name(line, code.end as usize) {
                Some((span, name)) => targets.push((span, Target::Program { name, label: None })),
                None => {
                    add(b'P', &|number| Target::Program { name: ProgramName::Number(number), label: None });
                }
            },
            Some(Meaning::Call) => {
                let label = block.whole(b'Q').map(|(label, _)| label);
                if let Some((span, name)) = self.called_name(line, code.end as usize) {
                    return targets.push((span, Target::Program { name, label }));
                }
                let digits = block.word(b'P').map_or(0, |word| word.number.integer_digits());
                if block.word(b'P').is_none() {
                    add(b'Q', &Target::Label);
                }
                add(b'P', &|written| {
                    let has_l = block.word(b'L').is_some();
                    let (number, _) = called_program(&self.table, &self.settings, written, digits, has_l);
                    Target::Program { name: ProgramName::Number(number), label }
                });
            }
            Some(Meaning::Turning(
                TurningCycle::Finish | TurningCycle::Turn(_) | TurningCycle::Face(_) | TurningCycle::Pattern,
            )) if self.table.dialect.is_linuxcnc => add(b'Q', &|number| Target::Subprogram(number.to_string())),
            Some(Meaning::Turning(
                TurningCycle::Finish | TurningCycle::Turn(_) | TurningCycle::Face(_) | TurningCycle::Pattern,
            )) if block.word(b'P').is_some() => {
                add(b'P', &Target::Label);
                add(b'Q', &Target::Label);
            }
            _ => {}
        }
    }
}

const fn span(start: usize, end: usize) -> SourceSpan {
    SourceSpan { program: 0, line: 0, column: start as u32 + 1, length: (end - start) as u32 }
}

/// `GOTO n` in a statement.
fn go_to(line: &[u8], from: usize) -> Option<(SourceSpan, Target)> {
    const WORD: &[u8] = b"GOTO";
    let start = from + line[from..].windows(WORD.len()).position(|text| text.eq_ignore_ascii_case(WORD))?;
    let (number, end) = digits(line, start + WORD.len())?;
    Some((span(start, end), Target::Label(number)))
}
