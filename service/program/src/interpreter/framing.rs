//! Where a program begins and ends: files that are none, the end, and what is behind it.

use super::{Interpreter, angle, classify, corner};
use crate::block::quote;
use crate::code;
use crate::evidence;
use crate::foreign::{self, Foreign};
use crate::lexer::{Lexer, TokenKind};
use crate::state::Phase;
use crate::title::Title;
use crate::{Finding, FindingLog, Operation, OperationKind, SourceSpan};

impl Interpreter {
    /// Whether the first line with something in it is that of a file which is no program; that is then reported.
    pub(super) fn is_foreign_start(
        &mut self,
        line: &[u8],
        number: u32,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> bool {
        if line.iter().all(u8::is_ascii_whitespace) {
            return false;
        }
        self.state.first_line = number;
        let Some(foreign) = self.recognise_foreign(line, true) else {
            return false;
        };
        self.refuse_file(foreign, line.len(), number, operations, findings);
        true
    }

    /// Whether the line begins with the `%` that begins a file.
    #[inline]
    pub(super) fn may_be_title(&self, line: &[u8]) -> bool {
        self.state.phase == Phase::Start && !self.state.percent_seen && line.trim_ascii_start().starts_with(b"%")
    }

    /// Whether what stands behind the first `%` is not read: the title of the file, or words that are no part of a program,
    /// which is then reported.
    #[cold]
    pub(super) fn is_title(&mut self, line: &[u8], number: u32, findings: &mut FindingLog) -> bool {
        match Title::of(line, self.settings.skips_titles()) {
            Title::None | Title::Unclear => return false,
            Title::Skipped => self.state.evidence.add_comment(),
            Title::Words(from) => {
                self.state.evidence.add(number, line);
                let words = line[from as usize..].trim_ascii_end();
                let (program, length) = (self.state.place.program, words.len() as u32);
                let span = SourceSpan { program, line: number, column: from + 1, length };
                findings.push_with(code::TITLE_WORDS, |code| {
                    let words = quote(words);
                    let message = format!(
                        "{words} stands behind the % that begins the file: some controls skip the rest of this line, \
                         others refuse it"
                    );
                    Finding::new(code, span, message)
                        .suggest("write these words in the line below")
                        .suggest("write a title in ( )")
                });
            }
        }
        self.state.percent_seen = true;
        true
    }

    /// Reports a `%` where LinuxCNC reads none: it stands alone in the first line with something in it, and then in the last.
    #[cold]
    pub(super) fn check_percent(&self, line: &[u8], span: SourceSpan, findings: &mut FindingLog) {
        let is_first = self.state.first_line == span.line;
        let cures: &[&str] = if !is_first && !self.state.percent_seen {
            if self.state.phase == Phase::Start {
                &["move % to the first line of the file, alone"]
            } else {
                &["write M2 in its place", "write % alone in the first line of the file too"]
            }
        } else if line.trim_ascii() != b"%" {
            &["write % alone on its line"]
        } else {
            return;
        };
        findings.push_with(code::CHARACTER, |code| {
            let message = "LinuxCNC reads % alone in the first line of a file, and then alone in its last line";
            let finding = Finding::new(code, span, message);
            cures.iter().fold(finding, |finding, cure| finding.suggest(*cure))
        });
    }

    /// What the file with this line is, if it is no program; `is_first` while no line before it could be read.
    pub(super) fn recognise_foreign(&self, line: &[u8], is_first: bool) -> Option<Foreign> {
        let foreign = foreign::recognise(line, is_first)?;
        // `<SHAFT>` may be the name of a program as well as begin a document: what follows tells.
        let may_be_name = foreign == Foreign::XML
            && !self.settings.is_haas()
            && !line.windows(2).any(|pair| matches!(pair, b"><" | b"</"))
            && classify(line, self.table.dialect.flow, false).program.is_some();
        (!may_be_name).then_some(foreign)
    }

    /// Counts what the present block says of the file; whether that is enough to refuse it, which is then reported.
    #[cold]
    pub(super) fn is_evidently_foreign(
        &mut self,
        line: &[u8],
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) -> bool {
        let (block, evidence, number) = (&self.block, &mut self.state.evidence, self.state.lines);
        if let Some(fields) = evidence::fields(line) {
            evidence.add_row(number, line.len(), fields);
        } else if block.unclear || block.rest.is_some() || block.is_empty() && block.assignments.is_empty() {
            evidence.add(number, line);
        } else if block.named_program.is_none() || block.word_count() > 1 {
            evidence.add_block(number, line.len(), block.word_count());
        }
        let verdict = evidence.verdict();
        verdict.map(|foreign| self.refuse_text(foreign, operations, findings)).is_some()
    }

    /// Counts what a line says of the file behind the place where the program was given up.
    #[cold]
    pub(super) fn look_on(
        &mut self,
        line: &[u8],
        number: u32,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        self.state.evidence.add(number, line);
        if let Some(foreign) = self.state.evidence.verdict() {
            self.refuse_text(foreign, operations, findings);
        }
    }

    /// Reports that the file does not read as a program.
    #[cold]
    fn refuse_text(&mut self, foreign: Foreign, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        let (line, length) = self.state.evidence.first;
        self.refuse_file(foreign, length as usize, line.max(1), operations, findings);
    }

    /// Reports that the file is no program, in place of everything found in it before, and ends it.
    #[cold]
    pub(super) fn refuse_file(
        &mut self,
        Foreign { what, cure }: Foreign,
        length: usize,
        line: u32,
        operations: &mut Vec<Operation>,
        findings: &mut FindingLog,
    ) {
        self.state.evidence.settle();
        let span = SourceSpan { program: self.state.place.program, line, column: 1, length: length as u32 };
        let message = format!("this is {what}, not a program of this language; nothing else of it is reported");
        findings.close_with(Finding::new(code::NOT_A_PROGRAM, span, message).suggest(cure));
        self.state.nurbs = None;
        self.state.reported.trailing = true;
        if !self.state.has_ended() {
            self.close(span, operations, findings);
        }
    }

    /// Ends the program at this place.
    pub(super) fn end(&mut self, span: SourceSpan, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        match self.state.evidence.verdict_at_end() {
            Some(foreign) => self.refuse_text(foreign, operations, findings),
            None => self.close(span, operations, findings),
        }
    }

    /// Ends the program at this place, whatever the file is.
    pub(super) fn close(&mut self, span: SourceSpan, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        if let Some(nurbs) = self.state.nurbs.take() {
            findings.push_with(code::NURBS_UNFINISHED, |code| {
                Finding::new(code, nurbs.span, "the program ends before this NURBS is closed")
                    .suggest("close it with G5.3")
            });
        }
        if self.state.skipping_data.take().is_some() {
            findings.push_with(code::DATA_OPEN, |code| {
                Finding::new(code, span, "the data of the control has no G11 at its end")
                    .suggest("add G11 behind the data")
            });
        }
        corner::interrupted(&mut self.state, span, operations, findings);
        if let Some(line) = self.state.angle_line.take() {
            angle::unfinished(&line, findings);
        }
        self.state.phase = Phase::Ended;
        operations.push(Operation { span, kind: OperationKind::End });
    }

    /// Ends the program where its input ends.
    pub(super) fn finish(&mut self, operations: &mut Vec<Operation>, findings: &mut FindingLog) {
        if self.state.has_ended() {
            if self.state.evidence.goes_on()
                && let Some(foreign) = self.state.evidence.verdict_at_end()
            {
                self.refuse_text(foreign, operations, findings);
            }
            return;
        }
        if self.ends_called_file(operations, findings) {
            return;
        }
        // A line that is too long and has no end has not been counted yet.
        self.state.lines = self.state.lines.saturating_add(u32::from(self.state.skipping_line));
        let line = self.state.lines.saturating_sub(self.state.blank_lines).max(1);
        let column = self.state.last_line_bytes.saturating_add(1);
        let span = SourceSpan { program: self.state.place.program, line, column, length: 0 };
        let is_called = self.state.flow.has_only_passed_subprograms();
        let is_refused = self.table.dialect.is_linuxcnc && !is_called;
        let code = if is_refused { code::NO_END_REFUSED } else { code::NO_END };
        findings.push_with(code, |code| match is_called {
            true => {
                let message = "the file has no end and does nothing but define subprograms, which other programs call";
                Finding::new(code, span, message).suggest(
                    "name it as a further file of the program that calls them, or end it with M2 if it is run itself",
                )
            }
            false => Finding::new(code, span, "the program just stops here").suggest("end it with M30 (or M2) and %"),
        });
        self.state.skipping_line = false;
        self.end(span, operations, findings);
    }

    /// Says once that there is text after the end; blanks and a closing `%` belong there.
    pub(super) fn report_trailing(&mut self, line: &[u8], number: u32, findings: &mut FindingLog) {
        if self.state.reported.trailing {
            return;
        }
        let begins = self.begins_program(line);
        if self.state.flow.may_be_subprogram {
            if begins {
                self.state.reported.trailing = true;
                self.report_unclear_main(line, number, findings);
            }
            return;
        }
        if self.state.flow.has_jumped() || begins {
            // Further programs and blocks, which are read where they are called.
            self.state.reported.trailing = true;
            return;
        }
        let text = |byte: &u8| !byte.is_ascii_whitespace() && !matches!(byte, b'%' | 0);
        if Lexer::new(line).all(|token| matches!(token.kind, TokenKind::Comment | TokenKind::Percent | TokenKind::Nul))
        {
            return;
        }
        let (Some(first), Some(last)) = (line.iter().position(text), line.iter().rposition(text)) else {
            return;
        };
        let span = SourceSpan {
            program: self.state.place.program,
            line: number,
            column: first as u32 + 1,
            length: (last - first) as u32 + 1,
        };
        self.push_trailing(span, findings);
    }

    /// The program that was read returns by `M99` and calls nothing, and another one stands behind it.
    #[cold]
    fn report_unclear_main(&self, line: &[u8], number: u32, findings: &mut FindingLog) {
        let text = String::from_utf8_lossy(line.trim_ascii()).into_owned();
        let column = line.iter().take_while(|byte| byte.is_ascii_whitespace()).count() as u32 + 1;
        let span = SourceSpan { program: self.state.place.program, line: number, column, length: text.len() as u32 };
        let name = self.state.program_number.map_or("the program before".to_owned(), |number| format!("O{number}"));
        findings.push_with(code::MAIN_UNCLEAR, |code| {
            let message = format!(
                "{name} ends with M99 as a subprogram does, and {text} begins here: which is the main program?"
            );
            Finding::new(code, span, message)
                .suggest("write the main program first, and its subprograms behind it")
                .suggest("end the main program with M30 where it is the first one")
        });
    }

    pub(super) fn push_trailing(&mut self, span: SourceSpan, findings: &mut FindingLog) {
        self.state.reported.trailing = true;
        findings.push_with(code::TRAILING, |code| {
            Finding::new(code, span, "text after the end of the program is not read")
        });
    }
}
