//! A bounded collection of findings, in which what repeats itself is one.

use std::collections::BTreeMap;

use super::{Finding, FindingCode, Severity};

/// Findings that are known as having been met, for each one that is kept in full.
const KNOWN_PER_KEPT: usize = 16;

/// A bounded collection of findings: keeps the first ones in full and counts the rest, so that a program of
/// nothing but mistakes cannot exhaust memory.
///
/// A finding that is met again ([`Finding::ranked`]) is counted as an occurrence of the one that is there, which takes over
/// message, numbers and cures of the worst occurrence and stays where the first one was. Sixteen times as many as are kept are
/// told from new ones; beyond, an occurrence counts as a finding of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct FindingLog {
    findings: Vec<Finding>,
    limit: usize,
    /// What was met, by [`identity`], with its place among the findings where it is kept.
    known: BTreeMap<u64, Option<u32>>,
    /// The identities in the order in which they became known.
    order: Vec<u64>,
    /// Findings counted but not kept.
    dropped: u64,
    /// Errors pushed, every occurrence of one.
    error_occurrences: u64,
    /// How many findings of each severity there are, indexed info, warning, error.
    counts: [u64; 3],
    /// Nothing more is taken.
    is_closed: bool,
}

/// How far a [`FindingLog`] was filled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FindingMark {
    kept: usize,
    known: usize,
    dropped: u64,
    error_occurrences: u64,
    counts: [u64; 3],
}

impl FindingMark {
    /// How many findings were kept.
    pub(crate) const fn kept(self) -> usize {
        self.kept
    }
}

impl FindingLog {
    /// Findings kept in full by default.
    pub const DEFAULT_LIMIT: usize = 1_000;

    /// An empty log that keeps at most `limit` findings in full.
    #[must_use]
    pub const fn with_limit(limit: usize) -> Self {
        Self {
            findings: Vec::new(),
            limit,
            known: BTreeMap::new(),
            order: Vec::new(),
            dropped: 0,
            error_occurrences: 0,
            counts: [0; 3],
            is_closed: false,
        }
    }

    /// Adds a finding, or counts it as an occurrence of one that is there; see [`FindingLog`].
    pub fn push(&mut self, finding: Finding) {
        if self.is_closed {
            return;
        }
        let identity = identity(&finding);
        self.error_occurrences += u64::from(finding.severity == Severity::Error);
        match self.known.get(&identity) {
            Some(Some(place)) => return self.merge(*place as usize, finding),
            Some(None) => return,
            None => {}
        }
        self.counts[finding.severity as usize] += 1;
        let is_kept = self.findings.len() < self.limit;
        if is_kept || self.knows_more() {
            self.known.insert(identity, is_kept.then_some(self.findings.len() as u32));
            self.order.push(identity);
        }
        if is_kept {
            self.findings.push(finding);
        } else {
            self.dropped += 1;
        }
    }

    /// Adds a finding of this code, built only while it can be distinguished from others, so that a program of
    /// nothing but mistakes costs no formatting either.
    pub fn push_with(&mut self, code: FindingCode, build: impl FnOnce(FindingCode) -> Finding) {
        let severity = code.severity();
        if self.is_closed {
            return;
        }
        if self.findings.len() < self.limit || self.knows_more() {
            let finding = build(code);
            debug_assert_eq!((finding.code, finding.severity), (code, severity));
            self.push(finding);
        } else {
            self.error_occurrences += u64::from(severity == Severity::Error);
            self.counts[severity as usize] += 1;
            self.dropped += 1;
        }
    }

    /// A mark to withdraw from.
    #[inline]
    pub(crate) const fn mark(&self) -> FindingMark {
        FindingMark {
            kept: self.findings.len(),
            known: self.order.len(),
            dropped: self.dropped,
            error_occurrences: self.error_occurrences,
            counts: self.counts,
        }
    }

    /// Whether an error was pushed since the mark, be it a further occurrence of one from before.
    #[inline]
    pub(crate) const fn has_errors_since(&self, mark: &FindingMark) -> bool {
        self.error_occurrences > mark.error_occurrences
    }

    /// Takes back every finding since the mark; further occurrences of those from before stay counted.
    pub(crate) fn rewind(&mut self, mark: FindingMark) {
        self.findings.truncate(mark.kept);
        for identity in self.order.drain(mark.known.min(self.order.len())..) {
            self.known.remove(&identity);
        }
        (self.dropped, self.counts) = (mark.dropped, mark.counts);
        self.error_occurrences = mark.error_occurrences;
    }

    /// Whether findings were kept since the mark.
    #[inline]
    pub(crate) fn has_grown_since(&self, mark: FindingMark) -> bool {
        self.findings.len() > mark.kept
    }

    /// Changes the findings that were kept since the mark, which may make them occurrences of others.
    #[cold]
    pub(crate) fn change_since(&mut self, mark: FindingMark, change: impl Fn(&mut Finding)) {
        let FindingMark { known, .. } = mark;
        let changed = self.findings.split_off(mark.kept);
        for identity in self.order.drain(known.min(self.order.len())..) {
            self.known.remove(&identity);
        }
        for mut finding in changed {
            self.counts[finding.severity as usize] -= 1;
            self.error_occurrences -= u64::from(finding.severity == Severity::Error);
            change(&mut finding);
            self.push(finding);
        }
    }

    /// Takes back the findings from the `from`th on that `is_void` says; those that were only counted stay counted.
    pub(crate) fn withdraw(&mut self, from: usize, is_void: impl Fn(&Finding) -> bool) {
        let mut index = 0;
        let Self { findings, known, counts, .. } = self;
        findings.retain(|finding| {
            let goes = index >= from && is_void(finding);
            index += 1;
            if goes {
                counts[finding.severity as usize] -= 1;
                known.remove(&identity(finding));
            }
            !goes
        });
        for (place, finding) in (0..).zip(&*findings).skip(from) {
            known.entry(identity(finding)).and_modify(|known| *known = Some(place));
        }
    }

    /// Takes back every finding, and takes none after this one: it says all there is to say.
    pub(crate) fn close_with(&mut self, finding: Finding) {
        *self = Self::with_limit(self.limit);
        self.push(finding);
        self.is_closed = true;
    }

    /// Whether this occurrence is the one that is told of its finding: message, numbers and cures are its.
    #[must_use]
    pub fn tells(&self, finding: &Finding) -> bool {
        let place = self.known.get(&identity(finding)).copied().flatten();
        place.is_some_and(|place| self.findings[place as usize].is_same_occurrence(finding))
    }

    /// Changes the findings that are kept, which may make them occurrences of others.
    pub fn revise(&mut self, change: impl Fn(&mut Finding)) {
        self.change_since(FindingMark { kept: 0, known: 0, ..self.mark() }, change);
    }

    fn knows_more(&self) -> bool {
        self.order.len() < self.limit.saturating_mul(KNOWN_PER_KEPT)
    }

    fn merge(&mut self, place: usize, finding: Finding) {
        let kept = &mut self.findings[place];
        let occurrences = kept.occurrences.saturating_add(finding.occurrences);
        if excess(&finding) > excess(kept) {
            let related = core::mem::take(&mut kept.related);
            *kept = Finding { first: kept.first.take(), related, ..finding };
        }
        kept.occurrences = occurrences;
    }

    /// The findings kept, in the order of discovery.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// How many findings of this severity there are, kept or not; further occurrences of one do not count.
    #[must_use]
    pub const fn count(&self, severity: Severity) -> u64 {
        self.counts[severity as usize]
    }

    /// How many findings were counted but not kept.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Whether any error was pushed.
    #[must_use]
    pub const fn has_errors(&self) -> bool {
        self.count(Severity::Error) > 0
    }

    /// The findings kept, in the order of discovery.
    #[must_use]
    pub fn into_findings(self) -> Vec<Finding> {
        self.findings
    }

    /// The findings kept, ordered by place and then by discovery.
    #[must_use]
    pub fn into_sorted(mut self) -> Vec<Finding> {
        self.findings.sort_by_key(|finding| (finding.span.program, finding.span.line, finding.span.column));
        self.findings
    }
}

impl Default for FindingLog {
    fn default() -> Self {
        Self::with_limit(Self::DEFAULT_LIMIT)
    }
}

fn excess(finding: &Finding) -> f64 {
    finding.rank.as_ref().map_or(0.0, |rank| rank.excess)
}

/// What occurrences of one finding have in common, as a number: FNV-1a of code, place and what it is about, or of the whole
/// message where nothing says so. The severity is in the last two bits, so that no error is ever taken for a warning.
fn identity(finding: &Finding) -> u64 {
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let mut hash = BASIS;
    let mut add = |bytes: &[u8]| {
        for &byte in bytes {
            hash = (hash ^ u64::from(byte)).wrapping_mul(PRIME);
        }
    };
    add(finding.code.name().as_bytes());
    let span = finding.span;
    if finding.rank.as_ref().is_none_or(|rank| !rank.everywhere) {
        for number in [span.program, span.line, span.column, span.length] {
            add(&number.to_le_bytes());
        }
    }
    match &finding.rank {
        Some(rank) => add(rank.about.as_bytes()),
        None => add(finding.message.as_bytes()),
    }
    hash << 2 | finding.severity as u64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::SourceSpan;

    crate::finding_codes! {
        /// Codes of these tests.
        pub TEST_CODES: "Tests";

        "SHORT" [SHORT: Error] {
            meaning: "one",
            cause: "A test.",
            cure: "None.",
            example: words("none"),
        }

        "A" [A: Error, MILD_A: Warning] {
            meaning: "another",
            cause: "A test.",
            cure: "None.",
            example: words("none"),
        }

        "B" [B: Error] {
            meaning: "a third",
            cause: "A test.",
            cure: "None.",
            example: words("none"),
        }
    }

    const G76: SourceSpan = SourceSpan { program: 0, line: 7, column: 1, length: 20 };

    fn short(pass: u64, excess: f64) -> Finding {
        Finding::new(SHORT, G76, format!("pass {pass} is {excess} mm too short")).at("pass", pass).ranked("", excess)
    }

    fn occurrence(number: u64) -> Option<super::super::Occurrence> {
        Some(super::super::Occurrence { name: "pass".into(), number })
    }

    #[test]
    fn one_place_and_cause_is_one_finding_with_the_worst_case() {
        let mut log = FindingLog::default();
        for pass in 1..=35 {
            log.push(short(pass, 10.0 - (pass as f64 - 12.0).abs()));
            log.push(Finding::new(MILD_A, G76, "the same each time"));
        }
        assert_eq!((log.count(Severity::Error), log.count(Severity::Warning)), (1, 1));
        let [short, other] = log.findings() else { panic!("{:?}", log.findings()) };
        assert_eq!((short.occurrences, other.occurrences), (35, 35));
        assert_eq!(short.message, "pass 12 is 10 mm too short");
        assert_eq!((&short.first, &short.worst), (&occurrence(1), &occurrence(12)));
        assert_eq!(short.values[0].value, 12.0);
    }

    #[test]
    fn another_subject_severity_place_or_message_is_another_finding() {
        let at = |column| SourceSpan { column, ..G76 };
        let mut log = FindingLog::default();
        let findings = [
            Finding::new(A, G76, "").ranked("X", 1.0),
            Finding::new(A, G76, "").ranked("Y", 1.0),
            Finding::new(MILD_A, G76, "").ranked("X", 1.0),
            Finding::new(A, at(2), "").ranked("X", 1.0),
            Finding::new(B, G76, "one"),
            Finding::new(B, G76, "two"),
        ];
        for finding in &findings {
            log.push(finding.clone());
        }
        assert_eq!(log.findings(), findings);
    }

    #[test]
    fn what_has_one_cause_everywhere_is_one_finding_at_its_first_place() {
        let at = |line| SourceSpan { line, ..G76 };
        let mut log = FindingLog::default();
        for line in [3, 5, 9] {
            log.push(Finding::new(A, at(line), format!("in line {line}")).everywhere("C"));
        }
        log.push(Finding::new(A, at(3), "another").everywhere("B"));
        let found: Vec<_> =
            log.findings().iter().map(|it| (it.span.line, it.occurrences, it.message.as_str())).collect();
        assert_eq!(found, [(3, 3, "in line 3"), (3, 1, "another")]);
    }

    #[test]
    fn merged_findings_merge_again() {
        let mut passes = FindingLog::default();
        (1..=4).for_each(|pass| passes.push(short(pass, pass as f64)));
        let mut log = FindingLog::default();
        log.push(short(9, 2.5));
        passes.into_findings().into_iter().for_each(|finding| log.push(finding));
        let [found] = log.findings() else { panic!("{:?}", log.findings()) };
        assert_eq!((found.occurrences, &found.first, &found.worst), (5, &occurrence(9), &occurrence(4)));
    }

    #[test]
    fn an_occurrence_that_is_told_is_retold_and_what_was_counted_stays() {
        let at = |column| SourceSpan { column, ..G76 };
        let told = short(2, 5.0);
        let elsewhere = Finding { span: at(3), ..short(9, 4.0) };
        let mut log = FindingLog::with_limit(3);
        for finding in [short(1, 1.0), told.clone(), short(3, 2.0), elsewhere.clone(), Finding::new(B, G76, "other")] {
            log.push(finding);
        }
        (0..5).for_each(|column| log.push(Finding::new(B, at(column), "not kept")));
        assert!(log.tells(&told) && log.tells(&elsewhere) && !log.tells(&short(1, 1.0)));
        let cured = short(2, 5.0).suggest("begin earlier");
        let here = Finding { span: G76, ..elsewhere.clone() };
        log.revise(|finding| {
            finding.retell(&told, &cured);
            finding.retell(&elsewhere, &here);
        });
        let [short, other] = log.findings() else { panic!("{:#?}", log.findings()) };
        assert_eq!((&short.suggestions, short.occurrences), (&cured.suggestions, 4));
        assert_eq!((&short.first, &short.worst), (&occurrence(1), &occurrence(2)));
        assert_eq!((other.message.as_str(), log.count(Severity::Error), log.dropped()), ("other", 7, 5));
        log.push(cured.clone());
        assert!(log.tells(&cured) && log.findings()[0].occurrences == 5);
    }

    #[test]
    fn the_limit_counts_findings_and_memory_is_bounded() {
        let mut log = FindingLog::with_limit(4);
        let span = |line| SourceSpan { line, ..G76 };
        for _ in 0..100 {
            for line in 0..40 {
                log.push_with(MILD_A, |code| Finding::new(code, span(line), "same"));
            }
        }
        assert_eq!((log.findings().len(), log.dropped(), log.count(Severity::Warning)), (4, 36, 40));
        assert!(log.findings().iter().all(|finding| finding.occurrences == 100));
        for line in 0..1_000_000 {
            log.push_with(A, |code| Finding::new(code, span(line), "same"));
        }
        assert_eq!((log.known.len(), log.count(Severity::Error), log.dropped()), (64, 1_000_000, 1_000_036));
    }

    #[test]
    fn what_is_taken_back_may_come_again() {
        let mut log = FindingLog::with_limit(2);
        let finding = |line| Finding::new(A, SourceSpan { line, ..G76 }, "same");
        log.push(finding(1));
        let mark = log.mark();
        for _ in 0..2 {
            (2..6).for_each(|line| log.push(finding(line)));
            assert_eq!((log.count(Severity::Error), log.dropped(), log.has_errors_since(&mark)), (5, 3, true));
            log.rewind(mark);
            assert_eq!((log.count(Severity::Error), log.dropped(), log.has_errors_since(&mark)), (1, 0, false));
        }
        log.push(finding(1));
        assert!(log.has_errors_since(&mark), "a further occurrence is an error all the same");
        log.push(finding(2));
        log.withdraw(0, |finding| finding.span.line == 1);
        (1..3).for_each(|line| log.push(finding(line)));
        let counted: Vec<_> = log.findings().iter().map(|finding| (finding.span.line, finding.occurrences)).collect();
        assert_eq!((counted, log.count(Severity::Error)), (vec![(2, 2), (1, 1)], 2));
    }

    #[test]
    fn a_finding_that_says_all_is_the_only_one() {
        let mut log = FindingLog::with_limit(2);
        (1..5).for_each(|line| log.push(Finding::new(MILD_A, SourceSpan { line, ..G76 }, "before")));
        log.close_with(Finding::new(B, G76, "all"));
        let mark = log.mark();
        log.push(Finding::new(A, G76, "behind"));
        log.push_with(A, |code| Finding::new(code, G76, "behind"));
        assert_eq!((log.findings().len(), log.dropped(), log.count(Severity::Error)), (1, 0, 1));
        assert!(!log.has_errors_since(&mark) && log.count(Severity::Warning) == 0);
    }

    proptest! {
        /// Whatever comes in which order: each finding once, where it came first, with its count and its worst case.
        #[test]
        fn findings_are_grouped_as_a_plain_search_groups_them(
            pushed in prop::collection::vec((0u32..6, 0u8..4, prop::bool::ANY), 0..60),
        ) {
            let mut log = FindingLog::with_limit(8);
            let mut expected: Vec<Finding> = Vec::new();
            let mut distinct: Vec<(u32, bool)> = Vec::new();
            for (number, &(line, excess, about_x)) in (1..).zip(&pushed) {
                let span = SourceSpan { line, ..G76 };
                let about = if about_x { "X" } else { "Z" };
                let finding = Finding::new(A, span, format!("{number}")).at("pass", number);
                let finding = finding.ranked(about, f64::from(excess));
                log.push(finding.clone());
                match distinct.iter().position(|key| *key == (line, about_x)) {
                    None => {
                        distinct.push((line, about_x));
                        expected.push(finding);
                    }
                    Some(place) => {
                        let known = &mut expected[place];
                        let (occurrences, first) = (known.occurrences + 1, known.first.clone());
                        if super::excess(&finding) > super::excess(known) {
                            *known = finding;
                        }
                        (known.occurrences, known.first) = (occurrences, first);
                    }
                }
            }
            prop_assert_eq!(log.count(Severity::Error), expected.len() as u64);
            prop_assert_eq!(log.dropped(), expected.len().saturating_sub(8) as u64);
            expected.truncate(8);
            prop_assert_eq!(log.findings(), expected);
        }
    }
}
