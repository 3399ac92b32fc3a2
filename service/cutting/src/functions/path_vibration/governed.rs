//! Sections that one block switches on: its words govern them all, so what replaces a word has to serve them all.
//!
//! A loop or a call may come back to the block at any time, so cures are settled when the program has been read. Until then
//! findings tell what cures the section that they are about.
//!
//! Invariant: memory does not grow with the program. Where more is governed than is kept, no word is replaced.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use feedwave_program::{Finding, FindingLog};

use super::SectionReport;
use super::findings::Evidence;
use super::trial::Trial;

/// Blocks whose sections are kept.
const MAX_BLOCKS: usize = 4_000;
/// Cuts, lines and curves that are kept of all of them.
const MAX_KEPT: usize = 16_000;

/// The sections of a program by the block that switched them on.
#[derive(Clone, Debug, Default)]
pub(super) struct GovernedSections {
    /// By program, line and column.
    blocks: BTreeMap<[u32; 3], Governed>,
    kept: usize,
}

/// The sections of one block.
#[derive(Clone, Debug)]
struct Governed {
    /// All of them as one.
    trial: Trial,
    has_several: bool,
    /// Whether the trial has all of them.
    is_whole: bool,
    told: Vec<Told>,
}

/// A section of which a finding is told.
#[derive(Clone, Debug)]
struct Told {
    evidence: Evidence,
    findings: Vec<Finding>,
}

impl GovernedSections {
    /// Judges a section by itself: pushes its findings, and completes its report.
    pub(super) fn judge(&mut self, evidence: Evidence, log: &mut FindingLog) -> SectionReport {
        let mut findings = evidence.findings();
        let report = evidence.report(&findings);
        let span = evidence.on_span;
        let block = [span.program, span.line, span.column];
        let is_kept = self.blocks.contains_key(&block) || self.blocks.len() < MAX_BLOCKS;
        if !is_kept {
            findings.iter_mut().for_each(Finding::replace_nothing);
        }
        for finding in &findings {
            log.push(finding.clone());
        }
        if is_kept {
            self.keep(block, evidence, findings, log);
        }
        report
    }

    fn keep(&mut self, block: [u32; 3], evidence: Evidence, findings: Vec<Finding>, log: &FindingLog) {
        let governed = match self.blocks.entry(block) {
            Entry::Vacant(vacant) => {
                self.kept += evidence.trial.kept();
                let trial = evidence.trial.clone();
                vacant.insert(Governed { trial, has_several: false, is_whole: true, told: Vec::new() })
            }
            Entry::Occupied(occupied) => {
                let governed = occupied.into_mut();
                self.kept -= governed.trial.kept();
                governed.join(&evidence.trial);
                self.kept += governed.trial.kept();
                governed
            }
        };
        if self.kept > MAX_KEPT {
            self.kept -= governed.trial.kept();
            governed.forget();
        }
        governed.keep_told(Told { evidence, findings }, log);
    }

    /// Judges what cures the findings that are told for all sections of their blocks.
    pub(super) fn settle_cures(self, log: &mut FindingLog) {
        let mut revised = Vec::new();
        for Governed { trial, is_whole, told, .. } in self.blocks.into_values().filter(Governed::is_more_than_told) {
            for Told { evidence, findings } in told {
                let mut settled = Evidence { trial: trial.clone(), ..evidence }.findings();
                if !is_whole {
                    settled.iter_mut().for_each(Finding::replace_nothing);
                }
                revised.extend(findings.into_iter().zip(settled).filter(|(was, now)| was != now));
            }
        }
        if !revised.is_empty() {
            log.revise(|finding| revised.iter().for_each(|(was, now)| finding.retell(was, now)));
        }
    }
}

impl Governed {
    fn join(&mut self, trial: &Trial) {
        self.has_several = true;
        // Words may be computed, and other values each time.
        if self.trial.condition != trial.condition {
            self.forget();
        }
        if self.is_whole {
            self.trial.join(trial);
        }
    }

    fn forget(&mut self) {
        self.is_whole = false;
        self.trial.forget();
    }

    fn is_more_than_told(&self) -> bool {
        self.has_several || !self.is_whole
    }

    /// Keeps a section as long as one of its findings is told.
    fn keep_told(&mut self, new: Told, log: &FindingLog) {
        let is_told = |told: &Told| told.findings.iter().any(|finding| log.tells(finding));
        if !new.findings.is_empty() && is_told(&new) && self.told.iter().all(|told| told.findings != new.findings) {
            self.told.retain(is_told);
            self.told.push(new);
        }
    }
}
