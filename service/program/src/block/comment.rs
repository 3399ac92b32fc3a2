//! Comments: what is in them moves nothing.

use super::Block;
use crate::lexer::Token;
use crate::{Finding, FindingLog, code};

impl Block {
    /// Strange bytes in a comment move nothing, but say that the file is not what it seems.
    #[inline(never)]
    pub(super) fn check_comment(&self, line: &[u8], token: Token, findings: &mut FindingLog) {
        let comment = &line[token.start as usize..token.end as usize];
        if !comment.is_ascii() || comment.contains(&0) {
            self.report_comment(comment, token.start, findings);
        }
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
