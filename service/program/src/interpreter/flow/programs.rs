//! Where a call finds what it calls: in the file of the call, in further files by name or by number, and what is said where it is nowhere or
//! there twice.

use super::index::UnreadNumber;
use super::line::Statement;
use super::{CallTarget, Found, Interpreter, Mark, Pending, Progress};
use crate::code;
use crate::{Finding, FindingLog, ProgramName, SourceSpan};

/// Most further program files that a finding names.
const MOST_NAMED_FILES: usize = 50;

impl Interpreter {
    /// Where what is called begins, looked for at its first call from the file only.
    pub(super) fn find_once(
        &mut self,
        target: &CallTarget,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Result<Mark, Progress> {
        // Labels are many, and an index finds them by itself.
        if !matches!(target, CallTarget::Program { label: None, .. } | CallTarget::Sub(_)) {
            return self.find(target, pending, findings);
        }
        let call = (pending.from.place.program, target.clone());
        if let Some(mark) = self.called.get(&call) {
            return Ok(*mark);
        }
        let mark = self.find(target, pending, findings)?;
        self.called.insert(call, mark);
        Ok(mark)
    }

    /// Where what is called begins.
    fn find(&self, target: &CallTarget, pending: &Pending, findings: &mut FindingLog) -> Result<Mark, Progress> {
        let own = pending.from.place.program;
        match target {
            CallTarget::Label(number) => {
                let index = self.index(own).ok_or(Progress::NeedsIndex(own))?;
                match index.label(*number, pending.from.place.offset) {
                    Found::At(mark) => Ok(mark),
                    Found::Nowhere if self.reports_unread('N', *number, own, findings) => Err(Progress::Failed),
                    _ => Err(self.no_target(pending, findings, |finding| {
                        (format!("there is no single block N{number} to call"), finding)
                    })),
                }
            }
            CallTarget::Program { name, label } => {
                let start = self.find_program(name, own, pending, findings)?;
                if start.is_none()
                    && let ProgramName::Number(number) = name
                    && (0..=self.programs.len() as u32).any(|file| self.reports_unread('O', *number, file, findings))
                {
                    return Err(Progress::Failed);
                }
                let Some(start) = start else { return Err(self.missing(&name.to_string(), pending, findings)) };
                let Some(label) = label else { return Ok(start) };
                let index = self.index(start.place.program).ok_or(Progress::NeedsIndex(start.place.program))?;
                match index.label(*label, start.place.offset) {
                    Found::At(mark) => Ok(mark),
                    Found::Nowhere if self.reports_unread('N', *label, start.place.program, findings) => {
                        Err(Progress::Failed)
                    }
                    _ => Err(self.missing(&format!("block N{label} that is there once in {name}"), pending, findings)),
                }
            }
            CallTarget::Sub(name) => self.find_sub(name, own, pending, findings),
        }
    }

    /// A program: in the file of the call, in a file named after it, in any other, or a file that is the program by its
    /// name alone. Where the first of these that has it has it twice, nothing says which is meant.
    fn find_program(
        &self,
        name: &ProgramName,
        own: u32,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Result<Option<Mark>, Progress> {
        let is_named = |file: u32| file > 0 && self.is_file_of(file, name);
        let files = || (0..=self.programs.len() as u32).filter(|&file| file != own);
        let ranks: [&mut dyn Iterator<Item = u32>; 3] = [
            &mut core::iter::once(own),
            &mut files().filter(|&file| is_named(file)),
            &mut files().filter(|&file| !is_named(file)),
        ];
        for rank in ranks {
            let mut known = None;
            for file in rank {
                let index = self.index(file).ok_or(Progress::NeedsIndex(file))?;
                known = match (known, index.program(name)) {
                    (known, Found::Nowhere) => known,
                    (None, Found::At(mark)) => Some(mark),
                    (None, Found::Twice(first, second))
                    | (Some(first), Found::At(second) | Found::Twice(second, _)) => {
                        return Err(self.ambiguous_program(name, [first, second], pending, findings));
                    }
                };
            }
            if known.is_some() {
                return Ok(known);
            }
        }
        let mut by_name = (1..=self.programs.len() as u32).filter(|&file| is_named(file)).map(Mark::start_of);
        match (by_name.next(), by_name.next()) {
            (Some(first), Some(second)) => Err(self.ambiguous_program(name, [first, second], pending, findings)),
            (Some(known), None) => {
                let index = self.index(known.place.program);
                let sections = index.map(|index| index.sections.iter());
                match sections.into_iter().flatten().find_map(|section| section.name.as_ref()) {
                    Some(other) => Err(self.renamed_file(name, other, known, pending, findings)),
                    None => Ok(index.map(|index| index.blocks)),
                }
            }
            (None, _) => Ok(None),
        }
    }

    /// A file that is named after the program and holds another one: controls call by the one or by the other.
    #[cold]
    fn renamed_file(
        &self,
        wanted: &ProgramName,
        other: &ProgramName,
        file: Mark,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Progress {
        self.no_target(pending, findings, |finding| {
            let name = self.file_name(file.place.program);
            let message = format!("{name} is named after {wanted} and holds {other}: which is meant?");
            (message, finding.suggest(format!("call {other}, or write {wanted} in {name}")))
        })
    }

    #[cold]
    fn ambiguous_program(
        &self,
        name: &ProgramName,
        places: [Mark; 2],
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Progress {
        self.no_target(pending, findings, |finding| {
            let [first, second] =
                places.map(|mark| format!("on line {} of {}", mark.line(), self.file_name(mark.place.program)));
            let message = format!("{name} is {first} and {second}: which is meant?");
            (message, finding.suggest("give one of them another number or name, or leave it out"))
        })
    }

    /// How a finding names a program file.
    fn file_name(&self, program: u32) -> &str {
        program.checked_sub(1).map_or("the program", |file| &self.programs[file as usize])
    }

    /// Whether a further file is named after a program.
    fn is_file_of(&self, file: u32, name: &ProgramName) -> bool {
        name.is_of_file(&self.programs[file as usize - 1])
    }

    fn find_sub(&self, name: &str, own: u32, pending: &Pending, findings: &mut FindingLog) -> Result<Mark, Progress> {
        let bare = name.trim_matches(['<', '>']);
        let program = ProgramName::of_subprogram(name);
        let named = (1..=self.programs.len() as u32).filter(|&file| self.is_file_of(file, &program));
        let mut known: Option<Mark> = None;
        for file in core::iter::once(own).chain(core::iter::once(0)).chain(named) {
            if known.is_some_and(|mark| mark.place.program == own || mark.place.program == 0) {
                break;
            }
            let index = self.index(file).ok_or(Progress::NeedsIndex(file))?;
            let mut subs =
                index.controls.iter().filter(|control| control.what == Statement::Sub && &*control.name == name);
            match (subs.next(), subs.next()) {
                (Some(first), None) => match known {
                    None => known = Some(first.behind),
                    Some(other) if other.place == first.behind.place => {}
                    Some(other) => {
                        return Err(self.no_target(pending, findings, |finding| {
                            let [one, two] = [other, first.behind].map(|mark| self.file_name(mark.place.program));
                            let message = format!("o{name} is defined in {one} and in {two}: which is meant?");
                            (message, finding.suggest("leave one of both files out"))
                        }));
                    }
                },
                (Some(first), Some(second)) => {
                    return Err(self.no_target(pending, findings, |finding| {
                        let lines = (first.start.line(), second.start.line());
                        (format!("o{name} is defined on line {} and on line {}", lines.0, lines.1), finding)
                    }));
                }
                (None, _) => {}
            }
        }
        known.ok_or_else(|| self.missing(&format!("o{name} sub, nor a file {bare}.ngc of the job"), pending, findings))
    }

    /// Reports the line and program numbers of a program that only look like such and may be meant as this one, which is nowhere
    /// because of that; whether there is any.
    #[cold]
    pub(in crate::interpreter) fn reports_unread(
        &self,
        letter: char,
        number: u32,
        program: u32,
        findings: &mut FindingLog,
    ) -> bool {
        let mut unread = self.index(program).into_iter().flat_map(|index| index.unread(letter, number)).peekable();
        let is_any = unread.peek().is_some();
        for UnreadNumber { line, stretch, message } in unread {
            let (column, length) = (stretch.start as u32 + 1, (stretch.end - stretch.start) as u32);
            let span = SourceSpan { program, line: line.line(), column, length };
            findings.push_with(code::LOOKALIKE, |code| stretch.cured(Finding::new(code, span, message.clone())));
        }
        is_any
    }

    #[cold]
    fn missing(&self, what: &str, pending: &Pending, findings: &mut FindingLog) -> Progress {
        findings.push_with(code::SUBPROGRAM_MISSING, |code| {
            let files = match self.programs.len() {
                0 => "the job has no further program files".to_owned(),
                1..=MOST_NAMED_FILES => format!("the further program files are {}", self.programs.join(", ")),
                count => format!("none of the {count} further program files is or has it"),
            };
            Finding::new(code, pending.span, format!("there is no {what}; {files}"))
                .suggest("add the program to the file, or give the job the file that it is in")
        });
        Progress::Failed
    }
}
