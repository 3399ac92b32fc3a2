//! The threads of a program, gathered while validating only.

use std::collections::BTreeMap;

use feedwave_program::{FindingLog, SourceSpan};

use super::ThreadSectionReport;
use crate::shared::listed::Listed;

/// Reports kept in full; further threads are counted.
const MAX_THREAD_REPORTS: usize = 100;
/// Amplitude words that are known again; no other one is replaced.
const MAX_WORDS: usize = 4_000;

/// What is found out about the threads of a program.
#[derive(Clone, Debug, Default)]
pub(crate) struct ThreadAnalysis {
    pub(crate) reports: Listed<ThreadSectionReport>,
    pub(crate) passes: u64,
    /// Whether several passes were cut with an amplitude word, in a loop or by calls: another one was judged for one of them.
    words: BTreeMap<[u32; 3], bool>,
}

fn place(word: SourceSpan) -> [u32; 3] {
    [word.program, word.line, word.column]
}

impl ThreadAnalysis {
    /// A thread has ended: pushes what is found about it.
    pub(super) fn judged(&mut self, report: ThreadSectionReport, log: &mut FindingLog) {
        let words = report.job.passes.iter().filter_map(|pass| pass.amplitude_word?.span);
        for word in words {
            if self.words.len() < MAX_WORDS || self.words.contains_key(&place(word)) {
                self.words.entry(place(word)).and_modify(|is_of_several| *is_of_several = true).or_insert(false);
            }
        }
        for finding in &report.report.findings {
            let mut finding = finding.clone();
            if !self.words.contains_key(&place(finding.span)) {
                finding.replace_nothing();
            }
            log.push(finding);
        }
        self.reports.push(report, MAX_THREAD_REPORTS);
    }

    /// The program has been read: a word that governs several passes is not replaced.
    pub(crate) fn settle_cures(&self, log: &mut FindingLog) {
        let governs_several = |word: SourceSpan| self.words.get(&place(word)) == Some(&true);
        if self.words.values().any(|is_of_several| *is_of_several) {
            log.revise(|finding| {
                if finding.code.name().starts_with("THREAD-") && governs_several(finding.span) {
                    finding.replace_nothing();
                }
            });
        }
    }
}
