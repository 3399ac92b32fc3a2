//! The sections of a program while it is validated: the one in progress, those whose setpoints are still to come, and
//! the reports.

use std::collections::VecDeque;

use feedwave_program::FindingLog;

use super::governed::GovernedSections;
use super::{SectionAnalyzer, SectionReport, SectionSamples};
use crate::shared::listed::Listed;

/// Section reports kept in full; further sections are counted.
const MAX_SECTION_REPORTS: usize = 1_000;

/// The sections of a program, gathered while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct VibrationAnalysis {
    pub(super) open: Option<SectionAnalyzer>,
    /// Sections whose setpoints are still to come.
    pub(super) awaiting: VecDeque<SectionAnalyzer>,
    /// Feed override in force; `None` before the first change.
    feed_override: Option<f64>,
    pub(crate) sections: Listed<SectionReport>,
    governed: GovernedSections,
}

impl VibrationAnalysis {
    /// The section that elements are planned in.
    pub(crate) const fn open_mut(&mut self) -> Option<&mut SectionAnalyzer> {
        self.open.as_mut()
    }

    /// A section's setpoints have all been generated.
    pub(crate) fn finish_section(&mut self, samples: SectionSamples, findings: &mut FindingLog) {
        self.is_cut(f64::INFINITY);
        if let Some(analyzer) = self.awaiting.pop_front() {
            let evidence = analyzer.into_evidence(samples.clamped, samples.total);
            let report = self.governed.judge(evidence, findings);
            self.sections.push(report, MAX_SECTION_REPORTS);
        }
    }

    /// The section in progress has been cut up to a place, mm from its start, at the feed override in force.
    pub(crate) fn is_cut(&mut self, up_to_mm: f64) {
        let feed_override = self.feed_override.unwrap_or(1.0);
        if let Some(in_progress) = self.awaiting.front_mut().or(self.open.as_mut()) {
            in_progress.is_cut(up_to_mm, feed_override);
        }
    }

    /// The feed override changes, in a section at a place of it.
    pub(crate) fn changes_override(&mut self, place_mm: Option<f64>, feed_override: f64) {
        if let Some(place_mm) = place_mm {
            self.is_cut(place_mm);
        }
        // What is cut while the path comes to rest is cut at the override before.
        if feed_override > 0.0 {
            self.feed_override = Some(feed_override);
        }
    }

    /// No more setpoints will be generated: finish what waits for them.
    pub(crate) fn finish_waiting(&mut self, findings: &mut FindingLog) {
        while !self.awaiting.is_empty() {
            self.finish_section(SectionSamples::default(), findings);
        }
    }

    /// The program has been read: cures are those of all sections that a word governs.
    pub(crate) fn settle_cures(&mut self, findings: &mut FindingLog) {
        core::mem::take(&mut self.governed).settle_cures(findings);
    }
}
