//! Chip breaking along a section at constant spindle speed: stretches of equal cutting conditions.

use super::chip::CutCondition;
use super::chip_course::WorstCut;
use super::{ChipSpan, SurfaceCut};

/// Stretches listed in a report.
const MAX_LISTED_SPANS: usize = 64;

/// What one block contributes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChipBlock {
    pub(super) line: u32,
    pub(super) start_mm: f64,
    pub(super) length_mm: f64,
    pub(super) cut: CutCondition,
    /// What its spindle speed follows from; `None` where it is programmed itself.
    pub(super) surface: Option<SurfaceCut>,
    /// The feed override that the cut is at.
    pub(super) feed_override: f64,
}

/// Gathers the stretches; bounded memory.
#[derive(Clone, Debug, Default)]
pub(super) struct ChipStretches {
    spans: Vec<ChipSpan>,
    not_listed: u64,
    /// The cut of the last block, listed or not.
    last: Option<(CutCondition, Option<SurfaceCut>)>,
    /// The cut that is furthest from breaking, and its margin.
    worst: Option<(f64, WorstCut)>,
    length_mm: f64,
    broken_mm: f64,
}

impl ChipStretches {
    pub(super) fn add(&mut self, block: &ChipBlock) {
        let ChipBlock { line, start_mm, length_mm, cut, surface, feed_override } = *block;
        let is_same = |(last, known)| (CutCondition { diameter_mm: cut.diameter_mm, ..last }, known) == (cut, surface);
        let continues = self.last.is_some_and(is_same);
        self.last = Some((cut, surface));
        let breaking_margin = cut.breaking_margin();
        let broken = cut.breaks_chip();
        self.length_mm += length_mm;
        self.broken_mm += if broken { length_mm } else { 0.0 };
        match &mut self.worst {
            // At a whole D the margin is 0 whatever the feed: the largest one needs most. Of equal cuts the one at the largest
            // diameter has the longest chips.
            Some((margin, worst)) if *margin == breaking_margin && cut.feed_per_rev_mm <= worst.cut.feed_per_rev_mm => {
                if cut.feed_per_rev_mm == worst.cut.feed_per_rev_mm {
                    worst.cut.diameter_mm = worst.cut.diameter_mm.max(cut.diameter_mm);
                }
            }
            Some((margin, _)) if *margin < breaking_margin => {}
            worst => *worst = Some((breaking_margin, WorstCut { cut, line, feed_override })),
        }
        if continues {
            // The stretch that continues may be one of those not listed.
            if let Some(span) = self.spans.last_mut().filter(|_| self.not_listed == 0) {
                span.last_line = line;
                span.length_mm = start_mm + length_mm - span.start_mm;
            }
        } else if self.spans.len() < MAX_LISTED_SPANS {
            self.spans.push(ChipSpan {
                first_line: line,
                last_line: line,
                start_mm,
                length_mm,
                share: 0.0,
                feed_override,
                feed_per_rev_mm: cut.feed_per_rev_mm,
                spindle_rev_per_min: cut.spindle_rev_per_min,
                surface,
                vibrations_per_rev: cut.vibrations_per_rev(),
                breaking_margin,
                broken,
            });
        } else {
            self.not_listed += 1;
        }
    }

    /// A stretch with stopped spindle or constant surface speed comes between.
    pub(super) fn interrupt(&mut self) {
        self.last = None;
    }

    /// The cut that is furthest from breaking, with the line of its first block.
    pub(super) fn worst(&self) -> Option<WorstCut> {
        self.worst.map(|(_, worst)| worst)
    }

    pub(super) fn length_mm(&self) -> f64 {
        self.length_mm
    }

    pub(super) fn broken_mm(&self) -> f64 {
        self.broken_mm
    }

    /// The stretches of a section of `section_mm`, and how many more there are.
    pub(super) fn into_spans(mut self, section_mm: f64) -> (Vec<ChipSpan>, u64) {
        for span in &mut self.spans {
            span.share = span.length_mm / section_mm;
        }
        (self.spans, self.not_listed)
    }
}
