//! Which O-words have begun something: in LinuxCNC a number begins one thing in a program or subprogram, and what ends or divides
//! that thing has to come behind it.
//!
//! What counts is what was executed: the same number in both branches of an `if` is no mistake.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::index::Control;
use super::line::Statement;
use super::{Interpreter, Mark, Pending, Progress};
use crate::code;
use crate::{Finding, FindingLog};

/// The statements that were executed of those that begin something: one bit for each statement of a program file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Labels {
    programs: BTreeMap<u32, Vec<u64>>,
}

impl Labels {
    fn contains(&self, program: u32, place: u32) -> bool {
        let word = self.programs.get(&program).and_then(|words| words.get(place as usize / 64));
        word.is_some_and(|word| word >> (place % 64) & 1 != 0)
    }

    fn insert(&mut self, program: u32, place: u32) {
        let words = self.programs.entry(program).or_default();
        let word = place as usize / 64;
        if words.len() <= word {
            words.resize(word + 1, 0);
        }
        words[word] |= 1 << (place % 64);
    }
}

impl Statement {
    /// Whether a stretch of lines begins with it.
    const fn begins(self) -> bool {
        matches!(self, Self::If | Self::While | Self::DoWhile | Self::Repeat | Self::Sub)
    }

    /// What it ends, divides or leaves.
    const fn belongs_to(self) -> &'static [Self] {
        match self {
            Self::ElseIf | Self::Else | Self::EndIf => &[Self::If],
            Self::EndWhile => &[Self::While],
            Self::EndRepeat => &[Self::Repeat],
            Self::Break | Self::Continue => &[Self::While, Self::DoWhile],
            _ => &[],
        }
    }
}

impl Interpreter {
    /// Notes that a statement begins something; an error where another one of its name has.
    pub(super) fn begin_label(&mut self, pending: &Pending, findings: &mut FindingLog) -> Result<(), Progress> {
        let place = pending.from.place;
        let Some(index) = self.index(place.program) else { return Err(Progress::NeedsIndex(place.program)) };
        let Some(own) = index.place_of(place.offset) else { return Ok(()) };
        let labels = &self.state.flow.labels;
        let other = index.namesakes(own).find(|(at, it)| it.what.begins() && labels.contains(place.program, *at));
        if let Some((_, other)) = other {
            let (name, line, what) = (other.name.clone(), other.start.line(), other.what.word());
            return Err(self.bad_label(pending, findings, |finding| {
                let message = format!("o{name} is that of the {what} on line {line} already");
                (message, finding.suggest(format!("give this one, and what belongs to it, a number other than {name}")))
            }));
        }
        self.state.flow.labels.insert(place.program, own);
        Ok(())
    }

    /// An error where what a statement belongs to has not been executed before it.
    pub(super) fn find_label(
        &self,
        what: Statement,
        pending: &Pending,
        findings: &mut FindingLog,
    ) -> Result<(), Progress> {
        let place = pending.from.place;
        let Some(index) = self.index(place.program) else { return Err(Progress::NeedsIndex(place.program)) };
        let Some(own) = index.place_of(place.offset) else { return Ok(()) };
        let (wanted, name) = (what.belongs_to(), &index.controls[own as usize].name);
        let labels = &self.state.flow.labels;
        let begun = index.namesakes(own).find(|(at, it)| it.what.begins() && labels.contains(place.program, *at));
        let word = what.word();
        match begun {
            Some((_, begun)) if wanted.contains(&begun.what) => Ok(()),
            Some((_, begun)) if begun.what == Statement::Repeat && wanted.contains(&Statement::While) => Err(self
                .bad_label(pending, findings, |finding| {
                    let message =
                        format!("{word} leaves while and do, but o{name} is the repeat on line {}", begun.start.line());
                    let cure =
                        format!("count the rounds with a parameter and write o{name} while […] … o{name} endwhile");
                    (message, finding.suggest(cure))
                })),
            Some((_, begun)) => Err(self.bad_label(pending, findings, |finding| {
                let message =
                    format!("o{name} {word}, but o{name} is the {} on line {}", begun.what.word(), begun.start.line());
                (message, finding.suggest(format!("write the number of its {}", wanted[0].word())))
            })),
            None => Err(self.bad_label(pending, findings, |finding| {
                let message =
                    format!("o{name} {word} without an o{name} {} that was executed before it", wanted[0].word());
                (message, finding.suggest(format!("write o{name} {} before it, or remove this line", wanted[0].word())))
            })),
        }
    }

    /// Notes that a subprogram is defined, where it is passed: an error where it was called before, or where it is not alone.
    pub(super) fn define_sub(&mut self, pending: &Pending, findings: &mut FindingLog) -> Result<(), Progress> {
        let place = pending.from.place;
        let Some(index) = self.index(place.program) else { return Err(Progress::NeedsIndex(place.program)) };
        let Some(own) = index.place_of(place.offset) else { return Ok(()) };
        let name = &index.controls[own as usize].name;
        if self.state.flow.labels.contains(place.program, own) {
            return Err(self.bad_label(pending, findings, |finding| {
                let message = format!("o{name} sub is passed although it was called or passed before");
                let cure = "define a subprogram before its first call and outside loops, or behind the end of the program (M2)";
                (message, finding.suggest(cure))
            }));
        }
        let of_name = |control: &Control| control.what == Statement::EndSub && control.name == *name;
        let inner = index.next(place.offset, |control| control.what == Statement::Sub || of_name(control));
        if let Some(inner) = inner.filter(|control| control.what == Statement::Sub) {
            return Err(self.bad_label(pending, findings, |finding| {
                let message = format!("o{} sub begins on line {}, within o{name} sub", inner.name, inner.start.line());
                (message, finding.suggest("define subprograms one behind the other"))
            }));
        }
        self.begin_label(pending, findings)
    }

    /// Notes that a subprogram was called whose first line is this.
    pub(super) fn call_label(&mut self, behind: Mark) {
        let program = behind.place.program;
        let Some(index) = self.index(program) else { return };
        let place = index.controls.partition_point(|control| control.behind.place.offset < behind.place.offset);
        self.state.flow.labels.insert(program, place as u32);
    }

    #[cold]
    fn bad_label(
        &self,
        pending: &Pending,
        findings: &mut FindingLog,
        fill: impl FnOnce(Finding) -> (String, Finding),
    ) -> Progress {
        self.refuse(code::LOOP, pending, findings, fill)
    }
}
