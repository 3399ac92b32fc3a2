//! The codes of one interpreter: those of its dialect with those of the machine profile, found by their numbers.

#[cfg(test)]
mod tests;

use std::sync::OnceLock;

use super::lathe::{haas_codes, system_codes};
use super::tables::{HAAS_LATHE_M_CODES, HAAS_M_CODES, HAAS_MILL_M_CODES, code};
use super::{Code, Dialect, Group, MachineRule, Meaning, letter_bit, machine_codes};
use crate::code_replacement::Replacement;
use crate::{DialectName, Function, FunctionCodes, LanguageSettings, expression};

/// Codes from this number of tenths on are unknown: controls call macros by codes up to 9999.
const CODE_TENTHS: usize = 100_000;

/// Codes below this number of tenths are found by index; above it are those that a profile chose, which are few.
const INDEXED_TENTHS: usize = 2_000;

/// Marks a number without a code.
const NO_CODE: u8 = u8::MAX;

/// The codes of one interpreter: its dialect's, with the profile's function codes merged in, found by index.
#[derive(Clone, Debug)]
pub(crate) struct CodeTable {
    pub(crate) dialect: &'static Dialect,
    /// How its expressions are read.
    pub(crate) expressions: &'static expression::Rules,
    /// Mask of the letters that name an axis.
    pub(crate) axis_letters: u32,
    /// Those of them of linear axes.
    pub(crate) linear_letters: u32,
    /// Mask of the letters whose words are a number and no more, line numbers among them.
    pub(crate) value_letters: u32,
    codes: Vec<Code>,
    /// M codes of the machine, ascending.
    machine: Vec<MachineRule>,
    /// Codes that the profile replaces by other words.
    replacements: Vec<Replacement>,
    /// Place in `codes` by number in tenths, G codes first, then M codes.
    index: Box<[u8; 2 * INDEXED_TENTHS]>,
    /// Letter, number in tenths and place of the codes above the index; of several with one number the last counts.
    above_index: Vec<(u8, u32, u8)>,
    /// The known G codes and M codes for suggestions, written once: a loop may ask for them at every round.
    known: [OnceLock<String>; 2],
}

impl CodeTable {
    pub(crate) fn new(settings: &LanguageSettings) -> Self {
        let dialect = Dialect::of(settings);
        let thread_vibration = Meaning::FunctionSwitch(Function::ThreadVibration);
        let functions = function_codes(Function::PathVibration, settings.path_vibration)
            .chain(function_codes(Function::ToolOscillation, settings.tool_oscillation))
            .chain(function_code(settings.thread_vibration.code, thread_vibration));
        let switches = settings.thinning.into_iter().flat_map(|codes| function_codes(Function::Thinning, codes));
        let angles = if settings.plain_drawing_words { letter_bit(b'A') | letter_bit(b'C') } else { 0 };
        let mut table = Self {
            dialect,
            expressions: if settings.is_haas() { &expression::HAAS } else { dialect.expressions },
            axis_letters: dialect.axis_letters() & !angles,
            linear_letters: dialect.linear_letters(),
            value_letters: dialect.value_letters(),
            codes: Vec::with_capacity(usize::from(NO_CODE)),
            machine: machine_codes::rules(settings),
            replacements: Vec::new(),
            index: Box::new([NO_CODE; 2 * INDEXED_TENTHS]),
            above_index: Vec::new(),
            known: Default::default(),
        };
        // The profile's own codes come last, so that they win over a dialect's.
        table.add(b'G', g_codes(settings).copied().chain(functions));
        table.add(b'M', m_codes(settings).copied().chain(switches));
        table.replace(settings);
        table
    }

    /// Puts the profile's replacements in the place of their codes, once all other codes are there.
    fn replace(&mut self, settings: &LanguageSettings) {
        let replaced = settings.code_replacements.iter().filter_map(|given| {
            let (letter, number) = given.replaced()?;
            let words = given.written()?;
            let calls = |place| matches!(self.code(place).group, Group::Subprogram | Group::MacroCall);
            let calls = words.iter().any(|(letter, number)| self.find(*letter, number.value()).is_some_and(calls));
            let original = self.find(letter, number);
            Some((letter, tenths(number)?, Replacement { words, original, calls }))
        });
        for (place, (letter, tenths, replacement)) in replaced.collect::<Vec<_>>().into_iter().enumerate() {
            self.replacements.push(replacement);
            let code = code(tenths as u32, Group::NonModal, Meaning::Replaced(place as u8));
            self.add(letter, core::iter::once(code));
        }
    }

    /// Whether the profile replaces any code.
    #[inline]
    pub(crate) const fn has_replacements(&self) -> bool {
        !self.replacements.is_empty()
    }

    /// The replacement that [`Meaning::Replaced`] names.
    pub(crate) fn replacement(&self, place: u8) -> &Replacement {
        &self.replacements[usize::from(place)]
    }

    /// As [`CodeTable::find`], of a code without the profile's replacement.
    pub(crate) fn find_original(&self, letter: u8, number: f64) -> Option<u8> {
        let place = self.find(letter, number)?;
        match self.code(place).meaning {
            Meaning::Replaced(replaced) => self.replacement(replaced).original,
            _ => Some(place),
        }
    }

    /// Whether the table has a place for the code of this letter and number.
    pub(crate) fn has_place_for(letter: u8, number: f64) -> bool {
        tenths(number).is_some_and(|tenths| letter == b'G' || tenths % 10 == 0)
    }

    fn add(&mut self, letter: u8, codes: impl Iterator<Item = Code>) {
        codes.for_each(|code| {
            let place = self.codes.len() as u8;
            match code.tenths as usize {
                tenths @ ..INDEXED_TENTHS => self.index[first_index(letter) + tenths] = place,
                _ => self.above_index.push((letter, code.tenths, place)),
            }
            self.codes.push(code);
        });
    }

    /// Place of the code `G` or `M` with this number, for [`CodeTable::code`].
    #[inline]
    pub(crate) fn find(&self, letter: u8, number: f64) -> Option<u8> {
        self.find_tenths(letter, tenths(number)?)
    }

    #[inline]
    fn find_tenths(&self, letter: u8, tenths: usize) -> Option<u8> {
        if tenths < INDEXED_TENTHS {
            let place = self.index[first_index(letter) + tenths];
            return (place != NO_CODE).then_some(place);
        }
        let is_meant = |it: &&(u8, u32, u8)| it.0 == letter && it.1 as usize == tenths;
        self.above_index.iter().rev().find(is_meant).map(|it| it.2)
    }

    /// The code at a place that [`CodeTable::find`] gave.
    #[inline]
    pub(crate) fn code(&self, place: u8) -> &Code {
        &self.codes[usize::from(place)]
    }

    /// The M code of the machine with this number.
    pub(crate) fn machine_rule(&self, number: f64) -> Option<&MachineRule> {
        let place = self.machine.binary_search_by(|rule| f64::from(rule.number).total_cmp(&number)).ok()?;
        Some(&self.machine[place])
    }

    /// A code of a group as it is written, such as `G28`.
    pub(crate) fn name(&self, group: Group, place: u8) -> String {
        let number = f64::from(self.code(place).tenths) / 10.0;
        let letter = if matches!(group, Group::ToolChange | Group::Overrides | Group::Subprogram) { 'M' } else { 'G' };
        format!("{letter}{number}")
    }

    /// The codes of this letter that are carried out, ascending, for suggestions.
    pub(crate) fn supported(&self, letter: u8) -> &str {
        self.known[usize::from(letter == b'M')].get_or_init(|| self.list(letter))
    }

    fn list(&self, letter: u8) -> String {
        let is_carried_out =
            |tenths| self.find_tenths(letter, tenths).is_some_and(|place| self.code(place).meaning.is_carried_out());
        let known = (0..CODE_TENTHS).filter(|tenths| is_carried_out(*tenths)).map(|tenths| tenths as u32);
        let of_machine = self.machine.iter().filter(|_| letter == b'M').map(|rule| rule.number.saturating_mul(10));
        let mut numbers: Vec<_> = known.chain(of_machine).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let name = |tenths: u32| format!("{}{}", char::from(letter), f64::from(tenths) / 10.0);
        let runs = numbers.chunk_by(|code, next| next - code == 10).flat_map(|run| match run {
            [first, _, _, .., last] => vec![format!("{} to {}", name(*first), name(*last))],
            few => few.iter().map(|code| name(*code)).collect(),
        });
        runs.collect::<Vec<_>>().join(", ")
    }
}

/// The G codes of a control; of several with one number the last counts.
fn g_codes(settings: &LanguageSettings) -> impl Iterator<Item = &'static Code> {
    Dialect::of(settings).g_codes().chain(system_codes(settings)).chain(haas_codes(settings))
}

/// The M codes that a control carries out itself, as [`g_codes`].
fn m_codes(settings: &LanguageSettings) -> impl Iterator<Item = &'static Code> {
    let haas: [&[Code]; 2] = match (settings.is_haas(), settings.dialect) {
        (true, DialectName::Mill) => [HAAS_M_CODES, HAAS_MILL_M_CODES],
        (true, _) => [HAAS_M_CODES, HAAS_LATHE_M_CODES],
        (false, _) => [&[], &[]],
    };
    Dialect::of(settings).m_codes().chain(haas.into_iter().flatten())
}

/// Whether a dialect, apart from the profile's function codes, carries out the G code of this number.
pub(crate) fn carries_out_g_code(settings: &LanguageSettings, number: f64) -> bool {
    let Some(number) = tenths(number) else { return false };
    let last = g_codes(settings).filter(|code| code.tenths as usize == number).last();
    last.is_some_and(|code| code.meaning.is_carried_out())
}

/// The codes by which a profile switches a machining function.
fn function_codes(function: Function, codes: FunctionCodes) -> impl Iterator<Item = Code> {
    [(codes.on, true), (codes.off, false)]
        .into_iter()
        .filter_map(move |(number, on)| function_code(number, Meaning::Function { function, on }))
}

/// A profile's code, which may have come through arithmetic; the nearest tenth is meant.
fn function_code(number: f64, meaning: Meaning) -> Option<Code> {
    let number = (number * 10.0).round() / 10.0;
    tenths(number).map(|tenths| code(tenths as u32, Group::Function, meaning))
}

/// Whether a dialect, apart from any profile's function codes, knows the M code of this number.
pub(crate) fn knows_m_code(dialect: DialectName, number: f64) -> bool {
    let mut codes = Dialect::of(&LanguageSettings { dialect, ..LanguageSettings::default() }).m_codes();
    tenths(number).is_some_and(|number| codes.any(|code| code.tenths as usize == number))
}

/// Where the codes of a letter begin in the index.
#[inline]
const fn first_index(letter: u8) -> usize {
    if letter == b'G' { 0 } else { INDEXED_TENTHS }
}

/// A code number in tenths, if it has at most one decimal place and is in range.
#[inline]
fn tenths(number: f64) -> Option<usize> {
    // (k/10)·10 = k exactly for every whole k, as 10 is a sum of two powers of two.
    let scaled = number * 10.0;
    let whole = scaled as u32;
    let index = whole as usize;
    (f64::from(whole) == scaled && index < CODE_TENTHS).then_some(index)
}
