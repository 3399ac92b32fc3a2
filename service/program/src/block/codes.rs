//! Which code of the table a code word is, and the words that a profile has in its place.

use super::{Block, CodeWord, Rest};
use crate::FindingLog;
use crate::dialect::{Code, CodeTable, Meaning};
use crate::lexer::Token;

impl Block {
    #[inline]
    pub(super) fn add_code(&mut self, token: Token, table: &CodeTable, findings: &mut FindingLog) {
        let place = table.find(token.letter, token.number.value());
        if let Some(place) = place
            && let Meaning::Replaced(replaced) = table.code(place).meaning
        {
            return self.add_replacement(token, replaced, table, findings);
        }
        self.add_code_at(token, place, table, findings);
    }

    /// Adds the words that the profile has in the place of a code, each where the code stands.
    #[cold]
    fn add_replacement(&mut self, token: Token, replaced: u8, table: &CodeTable, findings: &mut FindingLog) {
        let replacement = table.replacement(replaced);
        if replacement.calls && self.keeps_codes {
            return self.add_code_at(token, replacement.original, table, findings);
        }
        self.calls_by_code |= replacement.calls;
        for &(letter, number) in &replacement.words {
            let word = Token { letter, number, ..token };
            match letter {
                b'G' | b'M' => {
                    let place = table.find_original(letter, number.value());
                    self.add_code_at(word, place, table, findings);
                }
                _ => self.add_word(word, table, findings),
            }
        }
    }

    /// Adds a code that is at this place of the table, if it is there.
    #[inline]
    fn add_code_at(&mut self, token: Token, place: Option<u8>, table: &CodeTable, findings: &mut FindingLog) {
        if token.letter == b'M' && self.add_machine_code(token, place, table, findings) {
            return;
        }
        let Some(place) = place else {
            return self.report_unknown_code(token, table, findings);
        };
        let &Code { group, meaning, .. } = table.code(place);
        if let Meaning::Unsupported(what) = meaning {
            self.report_unsupported_code(token, what, findings);
        } else if let Meaning::OfOtherSystem { what, systems, here } = meaning {
            return self.report_code_of_other_system(token, (what, systems, here), findings);
        } else if meaning == Meaning::VariableLead {
            self.report_variable_lead(token, findings);
        }
        let bit = 1 << group as u32;
        if let Meaning::MacroCall { modal } = meaning {
            self.rest = Some(Rest::Arguments { at: token.end, modal });
        }
        if self.has_group(group) {
            return self.report_second_code(token, group, findings);
        }
        self.groups |= bit;
        self.codes[group as usize] = CodeWord { place, start: token.start, end: token.end };
    }
}
