//! Comments: what is in them moves nothing.

use super::Block;
use crate::dialect::CodeTable;
use crate::lexer::{Lexer, Token, TokenKind};
use crate::{Finding, FindingLog, code};

impl Block {
    /// Strange bytes in a comment move nothing, but say that the file is not what it seems.
    #[inline(never)]
    pub(super) fn check_comment(&self, line: &[u8], token: Token, table: &CodeTable, findings: &mut FindingLog) {
        let comment = &line[token.start as usize..token.end as usize];
        if comment[0] == b';' && !table.dialect.is_linuxcnc {
            self.check_behind_block_end(comment, token.start, findings);
        }
        if !comment.is_ascii() || comment.contains(&0) {
            self.report_comment(comment, token.start, findings);
        }
    }

    /// Whether a comment holds another one, so that what is behind the inner one is outside both; it is then reported, and the rest
    /// of the line is not read. LinuxCNC takes no second parenthesis, others no comment that goes on behind the inner one.
    pub(super) fn is_nested_comment(
        &mut self,
        line: &[u8],
        token: Token,
        table: &CodeTable,
        findings: &mut FindingLog,
    ) -> bool {
        let (start, end) = (token.start as usize, token.end as usize);
        if line[start] != b'(' || !line[start + 1..end].contains(&b'(') {
            return false;
        }
        let outer = line[end..].iter().position(|byte| matches!(byte, b'(' | b')'));
        let outer = match outer.filter(|outer| line[end + outer] == b')') {
            Some(outer) => outer + 1,
            None if table.dialect.is_linuxcnc => 0,
            None => return false,
        };
        self.extent = (self.extent.0.min(token.start), self.extent.1.max(token.end));
        let outside = Token { end: (end + outer) as u32, letter: 0, ..token };
        self.defect(code::TEXT, outside, findings, |mut finding| {
            "comments do not nest: this one ends at its first )".clone_into(&mut finding.message);
            finding.suggest("remove the inner parentheses")
        });
        true
    }

    /// `;` ends a block on these controls, so that words behind it on the line are another block, which would be run. What is no
    /// series of words they would refuse: it can only be meant as a comment.
    #[cold]
    fn check_behind_block_end(&self, comment: &[u8], start: u32, findings: &mut FindingLog) {
        let Some(behind) = comment.iter().position(|byte| !matches!(byte, b';' | b' ' | b'\t' | b'\r')) else { return };
        let block = &comment[behind..];
        let block = &block[..block.iter().position(|&byte| byte == b';').unwrap_or(block.len())];
        let mut tokens = Lexer::new(block);
        let mut words = 0_u32;
        loop {
            let token = match tokens.next_word() {
                Some(token) => token,
                None => match tokens.next() {
                    Some(token) => token,
                    None => break,
                },
            };
            match token.kind {
                TokenKind::Word
                | TokenKind::Computed
                | TokenKind::Assignment
                | TokenKind::Corner
                | TokenKind::ComputedCorner => words += 1,
                // With numbers: `GOTO 10`, `IF [#1 EQ 2]`; without, it is prose.
                TokenKind::Statement if block[token.start as usize..].iter().any(u8::is_ascii_digit) => {
                    words += 1;
                    break;
                }
                TokenKind::Comment | TokenKind::BlockDelete => {}
                _ => return,
            }
        }
        if words == 0 {
            return;
        }
        let span = self.span_of(start + behind as u32, start + (behind + block.trim_ascii_end().len()) as u32);
        let text = String::from_utf8_lossy(block.trim_ascii_end()).into_owned();
        findings.push_with(code::BEHIND_BLOCK_END, |code| {
            let message = format!("`{text}` is behind `;`, which ends a block: it would be run as another one");
            let finding = Finding::new(code, span, message).suggest("on a line of its own, if it is to be run");
            match text.contains(['(', ')']) {
                true => finding.suggest("in parentheses, if it is a comment"),
                false => finding.suggest_replacement("in parentheses, if it is a comment", format!("({text})")),
            }
        });
    }

    #[cold]
    fn report_comment(&self, comment: &[u8], start: u32, findings: &mut FindingLog) {
        let mut column = 0;
        for chunk in comment.utf8_chunks() {
            column += chunk.valid().len();
            let invalid = chunk.invalid().len();
            if invalid > 0 {
                let from = start + column as u32;
                let span = self.span_of(from, from + invalid as u32);
                findings.push_with(code::NOT_UTF8_IN_COMMENT, |code| {
                    Finding::new(code, span, "the comment holds bytes that are not UTF-8 text")
                });
                break;
            }
        }
        if let Some(place) = comment.iter().position(|&byte| byte == 0) {
            let length = comment[place..].iter().take_while(|&&byte| byte == 0).count();
            let from = start + place as u32;
            let span = self.span_of(from, from + length as u32);
            findings.push_with(code::NUL_IN_COMMENT, |code| {
                Finding::new(code, span, format!("the comment holds {length} NUL bytes"))
            });
        }
    }
}
