//! Where a program's labels, loops, branches and subprograms are: found in one pass over its bytes when the first jump needs
//! them, so that programs without jumps pay nothing.

use std::collections::HashMap;

use super::line::{self, Statement};
use super::{Found, Mark};
use crate::dialect::Flow;
use crate::interpreter::BYTE_ORDER_MARK;
use crate::lookalike::Stretch;
use crate::title::Title;
use crate::{LanguageSettings, ProgramName};

/// Most labels and statements that are kept of one program, so that its index stays within a few tens of megabytes.
pub(super) const MAX_ENTRIES: usize = 1 << 20;

/// Part of a file: from where one program begins to the next.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::interpreter) struct Section {
    /// What its program is called by, `None` before the first one.
    pub(in crate::interpreter) name: Option<ProgramName>,
    /// The line that begins it.
    pub(in crate::interpreter) start: Mark,
    /// Offset behind its last line.
    pub(in crate::interpreter) end: u64,
}

/// A statement that begins or ends a stretch of lines, or divides it.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::interpreter) struct Control {
    /// Its line.
    pub(in crate::interpreter) start: Mark,
    /// The line behind it.
    pub(in crate::interpreter) behind: Mark,
    pub(in crate::interpreter) what: Statement,
    /// Number or name of it, as [`line::name`] writes it.
    pub(in crate::interpreter) name: Box<str>,
    /// Place among the statements of the next one of this name in the same program or subprogram; the last one's is the first.
    next_of_name: u32,
}

/// What is where in one program file.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::interpreter) struct Index {
    program: u32,
    /// Where the blocks of the file begin: behind the `%` of its first line.
    pub(super) blocks: Mark,
    /// Ascending; the first begins with the file.
    pub(in crate::interpreter) sections: Vec<Section>,
    /// `N` with the line that has it, ascending by number and then by place.
    labels: Vec<(u32, Mark)>,
    /// Ascending by place.
    pub(in crate::interpreter) controls: Vec<Control>,
    /// Line and program numbers that only look like such.
    unread: Vec<UnreadNumber>,
    /// There were more entries than are kept.
    pub(in crate::interpreter) is_cut: bool,
}

/// Most numbers that only look like such which are kept of one program.
const MAX_UNREAD: usize = 100;

/// A line or program number with characters that only look like those of one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct UnreadNumber {
    /// Its line.
    pub(super) line: Mark,
    pub(super) stretch: Stretch,
    /// What is wrong with it.
    pub(super) message: String,
}

impl Index {
    /// The label `N` within the section that holds `place`.
    pub(in crate::interpreter) fn label(&self, number: u32, place: u64) -> Found {
        let section = self.section_at(place);
        let first = self.labels.partition_point(|(label, _)| *label < number);
        let range = section.start.place.offset..section.end;
        let of_number = self.labels[first..].iter().take_while(|(label, _)| *label == number);
        let mut within = of_number.filter(|(_, mark)| range.contains(&mark.place.offset)).map(|(_, mark)| *mark);
        match (within.next(), within.next()) {
            (None, _) => Found::Nowhere,
            (Some(mark), None) => Found::At(mark),
            (Some(first), Some(second)) => Found::Twice(first, second),
        }
    }

    /// The first and the last block of a contour within the section that holds `place`; a message where they are not there.
    pub(in crate::interpreter) fn contour(&self, first: u32, last: u32, place: u64) -> Result<(Mark, Mark), String> {
        let block = |number: u32| match self.label(number, place) {
            Found::At(mark) => Ok(mark),
            Found::Nowhere if self.is_cut => {
                Err(format!("N{number} is not among the first {MAX_ENTRIES} labels of the program"))
            }
            Found::Nowhere => Err(format!("there is no block N{number} in this program")),
            Found::Twice(one, other) => {
                Err(format!("N{number} is on line {} and on line {}: which is meant?", one.line(), other.line()))
            }
        };
        let (start, end) = (block(first)?, block(last)?);
        if end.place < start.place {
            return Err(format!(
                "the last block N{last} of the contour, on line {}, is before its first block N{first}, on line {}",
                end.line(),
                start.line()
            ));
        }
        Ok((start, end))
    }

    /// The numbers that only look like such and may be meant as this one.
    pub(super) fn unread(&self, letter: char, number: u32) -> impl Iterator<Item = &UnreadNumber> {
        let is_meant = move |stretch: &Stretch| {
            stretch.text[..1].eq_ignore_ascii_case(letter.encode_utf8(&mut [0; 4]))
                && line::number_meant(stretch) == Some(number)
        };
        self.unread.iter().filter(move |unread| is_meant(&unread.stretch))
    }

    /// The section that holds an offset.
    pub(in crate::interpreter) fn section_at(&self, offset: u64) -> &Section {
        let behind = self.sections.partition_point(|section| section.start.place.offset <= offset);
        &self.sections[behind.saturating_sub(1)]
    }

    /// The section of a program.
    pub(super) fn program(&self, name: &ProgramName) -> Found {
        let mut found = self.sections.iter().filter(|section| section.name.as_ref() == Some(name)).map(|it| it.start);
        match (found.next(), found.next()) {
            (None, _) => Found::Nowhere,
            (Some(mark), None) => Found::At(mark),
            (Some(first), Some(second)) => Found::Twice(first, second),
        }
    }

    /// The first statement behind `offset` that `wanted` takes, within the section.
    pub(super) fn next(&self, offset: u64, mut wanted: impl FnMut(&Control) -> bool) -> Option<&Control> {
        let end = self.section_at(offset).end;
        let from = self.controls.partition_point(|control| control.start.place.offset <= offset);
        let behind = self.controls[from..].iter().take_while(|control| control.start.place.offset < end);
        behind.into_iter().find(|control| wanted(control))
    }

    /// Links the statements of one name: those of a subprogram and those of a program are apart, names of subprograms are the file's.
    fn link_names(&mut self) {
        let mut ends: HashMap<(u32, u32, &str), (u32, u32)> = HashMap::new();
        let mut next: Vec<u32> = (0..self.controls.len() as u32).collect();
        let (mut section, mut sub) = (0, 0);
        for (place, control) in (0..).zip(&self.controls) {
            let at = control.start.place.offset;
            while self.sections.get(section + 1).is_some_and(|next| next.start.place.offset <= at) {
                (section, sub) = (section + 1, 0);
            }
            let scope = match control.what {
                Statement::Sub => {
                    sub = place + 1;
                    (u32::MAX, 0)
                }
                Statement::EndSub => {
                    sub = 0;
                    (u32::MAX, 0)
                }
                Statement::Return | Statement::Call => (u32::MAX, 0),
                _ => (section as u32, sub),
            };
            let (first, last) = ends.entry((scope.0, scope.1, &control.name)).or_insert((place, place));
            next[*last as usize] = place;
            next[place as usize] = *first;
            *last = place;
        }
        for (control, next) in self.controls.iter_mut().zip(next) {
            control.next_of_name = next;
        }
    }

    /// Place among the statements of the one on the line at `offset`.
    pub(super) fn place_of(&self, offset: u64) -> Option<u32> {
        let place = self.controls.binary_search_by_key(&offset, |control| control.start.place.offset).ok()?;
        Some(place as u32)
    }

    /// The others of its name in the same program or subprogram, with their places among the statements.
    pub(super) fn namesakes(&self, place: u32) -> impl Iterator<Item = (u32, &Control)> {
        let next = |at: u32| self.controls.get(at as usize).map(|control| control.next_of_name);
        core::iter::successors(next(place), move |at| next(*at))
            .take_while(move |at| *at != place)
            .map(|at| (at, &self.controls[at as usize]))
    }

    /// The statement on the line at `offset`.
    pub(super) fn at(&self, offset: u64) -> Option<&Control> {
        let place = self.controls.binary_search_by_key(&offset, |control| control.start.place.offset).ok()?;
        Some(&self.controls[place])
    }
}

/// Makes an [`Index`] line by line.
#[derive(Clone, Debug)]
pub(in crate::interpreter) struct Indexer {
    index: Index,
    flow: Flow,
    at: Mark,
    block_delete: bool,
    /// Bytes of the longest line that is read.
    longest: usize,
    /// The line here is longer: nothing of it counts.
    skipping: bool,
    /// A line with something in it was read.
    has_content: bool,
    skips_titles: bool,
}

impl Indexer {
    pub(in crate::interpreter) fn new(program: u32, flow: Flow, settings: &LanguageSettings) -> Self {
        let at = Mark::start_of(program);
        let whole = Section { name: None, start: at, end: u64::MAX };
        let index = Index {
            program,
            blocks: at,
            sections: vec![whole],
            labels: Vec::new(),
            controls: Vec::new(),
            unread: Vec::new(),
            is_cut: false,
        };
        let longest = settings.max_line_bytes as usize;
        Self {
            index,
            flow,
            at,
            block_delete: settings.block_delete,
            longest,
            skipping: false,
            has_content: false,
            skips_titles: settings.skips_titles(),
        }
    }

    /// Where the next bytes begin that it needs.
    pub(in crate::interpreter) const fn place(&self) -> crate::Place {
        self.at.place
    }

    /// Takes the lines of `input` that are whole, or all of it where nothing follows, and parts of lines that are too long to be
    /// read; `false` where it holds none. How a program is cut into inputs makes no difference to its index.
    pub(in crate::interpreter) fn read(&mut self, input: &[u8], end_of_input: bool) -> bool {
        let mut read = 0;
        while read < input.len() {
            let rest = &input[read..];
            let end = crate::interpreter::lines::find_line_end(rest);
            let length = end.unwrap_or(rest.len());
            let may_go_on = match end {
                None => true,
                // A line feed may follow.
                Some(length) => rest[length] == b'\r' && length + 1 == rest.len(),
            };
            self.skipping |= length > self.longest;
            if may_go_on && !end_of_input {
                if self.skipping {
                    self.at.place.offset += length as u64;
                    read += length;
                }
                break;
            }
            let pair = end.is_some() && rest[length] == b'\r' && rest.get(length + 1) == Some(&b'\n');
            let whole = length + usize::from(end.is_some()) + usize::from(pair);
            let is_read = !std::mem::take(&mut self.skipping);
            self.line(if is_read { &rest[..length] } else { b"" }, whole);
            read += whole;
        }
        read > 0
    }

    fn line(&mut self, text: &[u8], whole: usize) {
        let start = self.at;
        self.at.place.offset += whole as u64;
        self.at.lines += 1;
        if !self.has_content {
            self.begin(text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text));
        }
        let found = line::classify(text, self.flow, self.block_delete);
        if let Some(stretch) = found.unread
            && self.index.unread.len() < MAX_UNREAD
        {
            let message = stretch.message(text);
            self.index.unread.push(UnreadNumber { line: start, stretch, message });
        }
        if let Some(name) = found.program {
            if let Some(last) = self.index.sections.last_mut() {
                last.end = start.place.offset;
            }
            self.index.sections.push(Section { name: Some(name), start, end: u64::MAX });
        }
        let entries = self.index.labels.len() + self.index.controls.len() + self.index.sections.len();
        if entries >= MAX_ENTRIES {
            self.index.is_cut |= found.label.is_some() || found.statement.is_some();
            return;
        }
        if let Some(label) = found.label {
            self.index.labels.push((label, start));
        }
        if let Some((what, name)) = found.statement {
            self.index.controls.push(Control { start, behind: self.at, what, name: name.into(), next_of_name: 0 });
        }
    }

    /// Looks for the `%` that begins the file in front of everything else. The line here is the one behind.
    fn begin(&mut self, text: &[u8]) {
        let text = text.trim_ascii();
        self.has_content = !text.is_empty();
        if text.starts_with(b"%") && matches!(Title::of(text, self.skips_titles), Title::None | Title::Skipped) {
            self.index.blocks = self.at;
        }
    }

    /// The index of the whole program.
    pub(in crate::interpreter) fn finish(mut self) -> Index {
        self.index.labels.sort_by_key(|(label, mark)| (*label, mark.place.offset));
        if self.flow == Flow::OWords {
            self.index.link_names();
        }
        self.index
    }

    pub(in crate::interpreter) const fn program(&self) -> u32 {
        self.index.program
    }
}
