//! M codes of the machine in a block: any M code that the tables of the dialect do not carry out themselves.

use super::Block;
use crate::code;
use crate::dialect::{CodeTable, Group, MachineRule};
use crate::lexer::Token;
use crate::{Finding, FindingLog, SourceSpan};

/// Most M codes of the machine in a block, as many as a block has M codes in any dialect.
const MOST: usize = 4;

/// Largest number of an M code: eight digits, as long as controls take them.
const LARGEST: f64 = 99_999_999.0;

/// The M codes of the machine in one block.
#[derive(Clone, Copy, Debug)]
pub(super) struct MachineWords {
    /// M codes of any kind.
    m_codes: u8,
    count: u8,
    /// The last of them all, 0 for none.
    last: f64,
    /// Their modal groups, one bit each.
    groups: u32,
    words: [MachineWord; MOST],
}

/// An M code of the machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MachineWord {
    pub(crate) rule: MachineRule,
    /// Neither the dialect nor the profile has it.
    pub(crate) is_unlisted: bool,
    pub(crate) span: SourceSpan,
}

impl Default for MachineWords {
    fn default() -> Self {
        let span = SourceSpan::default();
        let word = MachineWord { rule: MachineRule::unlisted(0), is_unlisted: true, span };
        Self { m_codes: 0, count: 0, last: 0.0, groups: 0, words: [word; MOST] }
    }
}

impl MachineWords {
    #[inline]
    pub(super) const fn clear(&mut self) {
        (self.m_codes, self.count, self.groups) = (0, 0, 0);
    }

    #[inline]
    pub(super) const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether a code of this group is among them.
    #[inline]
    pub(super) const fn has_group(&self, group: Group) -> bool {
        self.groups & (1 << group as u32) != 0
    }
}

impl Block {
    /// The M codes of the machine, in the order of the line.
    pub(crate) fn machine_codes(&self) -> &[MachineWord] {
        &self.machine.words[..usize::from(self.machine.count)]
    }

    /// The number of the last M code of the block, of whatever kind.
    pub(crate) fn last_m_code(&self) -> Option<u32> {
        (self.machine.m_codes > 0).then_some(self.machine.last as u32)
    }

    /// Takes an M code of the machine; `false` where the tables of the dialect have it, at `place`, or where it is none at all.
    pub(super) fn add_machine_code(
        &mut self,
        token: Token,
        place: Option<u8>,
        table: &CodeTable,
        findings: &mut FindingLog,
    ) -> bool {
        let number = token.number.value();
        self.machine.m_codes = self.machine.m_codes.saturating_add(1);
        self.machine.last = number;
        if self.machine.m_codes > table.dialect.max_m_codes {
            let most = table.dialect.max_m_codes;
            self.defect(code::GROUP_CONFLICT, token, findings, |mut finding| {
                finding.message = format!("M{number} is one M code too many: a block takes at most {most}");
                finding.suggest("write it in a block of its own").with_value("max_m_codes", f64::from(most), "")
            });
            return true;
        }
        let listed = table.machine_rule(number);
        if listed.is_none() && place.is_some() {
            return false;
        }
        let is_number = (0.0..=LARGEST).contains(&number) && f64::from(number as u32) == number;
        let rule = match listed {
            Some(rule) => *rule,
            None if is_number && !table.dialect.m_codes_closed => MachineRule::unlisted(number as u32),
            None => return false,
        };
        if rule.group.is_some_and(|group| self.has_group(group)) {
            self.report_group(token, rule.group, findings);
            return true;
        }
        self.machine.groups |= rule.group.map_or(0, |group| 1 << group as u32);
        let span = self.span_of(token.start, token.end);
        let place = usize::from(self.machine.count);
        self.machine.words[place] = MachineWord { rule, is_unlisted: listed.is_none(), span };
        self.machine.count += 1;
        true
    }

    /// Whether the block has a code of this group, carried out by the control or by the machine.
    pub(super) const fn has_group(&self, group: Group) -> bool {
        self.groups & (1 << group as u32) != 0 || self.machine.has_group(group)
    }

    #[cold]
    fn report_group(&mut self, token: Token, group: Option<Group>, findings: &mut FindingLog) {
        let group = group.map_or("", Group::name);
        self.defect(code::GROUP_CONFLICT, token, findings, |mut finding: Finding| {
            finding.message = format!("M{} is the second {group} code of the block", token.number.value());
            finding.suggest("keep one of them, or write them in two blocks")
        });
    }
}
