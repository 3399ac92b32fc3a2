//! How large a report becomes as a message.

use prost::Message;
use prost::encoding::{encoded_len_varint, key_len};

use crate::proto::ValidationReport;

/// Most bytes of a report that is an answer of its own: with what surrounds it, within the 4 MiB that a gRPC client takes
/// where it sets nothing.
pub(super) const MAX_REPORT_BYTES: usize = 4_000_000;
/// Most bytes of a report of which an answer has two.
pub(super) const MAX_PAIRED_REPORT_BYTES: usize = 1_250_000;

/// Leaves the last findings, sections, threads and oscillations out of a report that is larger than `max_bytes`. Each of the
/// four lists may have a quarter of the space, and what others do not need. The summary counts all, listed or not.
pub(super) fn bound(report: &mut ValidationReport, max_bytes: usize) {
    if report.encoded_len() <= max_bytes {
        return;
    }
    let lists = [
        sizes(1, &report.findings),
        sizes(2, &report.sections),
        sizes(4, &report.threads),
        sizes(6, &report.oscillations),
    ];
    let listed_bytes: usize = lists.iter().flatten().sum();
    let other_bytes = report.encoded_len() - listed_bytes;
    let [findings, sections, threads, oscillations] = kept(&lists, max_bytes.saturating_sub(other_bytes));
    let not_listed = (report.findings.len() - findings) as u64;
    report.findings.truncate(findings);
    report.sections.truncate(sections);
    report.threads.truncate(threads);
    report.oscillations.truncate(oscillations);
    if let Some(summary) = &mut report.summary {
        summary.findings_not_listed += not_listed;
    }
}

/// Bytes of each message of a repeated field.
fn sizes<M: Message>(field: u32, messages: &[M]) -> Vec<usize> {
    let of = |message: &M| {
        let bytes = message.encoded_len();
        key_len(field) + encoded_len_varint(bytes as u64) + bytes
    };
    messages.iter().map(of).collect()
}

/// How many of the first messages of each list fit.
fn kept<const LISTS: usize>(lists: &[Vec<usize>; LISTS], mut space: usize) -> [usize; LISTS] {
    // The shortest list first: it leaves most of its share to the others.
    let total = |list: &usize| lists[*list].iter().sum::<usize>();
    let mut order: [usize; LISTS] = std::array::from_fn(|list| list);
    order.sort_by_key(total);
    let mut kept = [0; LISTS];
    for (done, list) in order.into_iter().enumerate() {
        let mut share = space / (LISTS - done);
        for bytes in &lists[list] {
            let Some(left) = share.checked_sub(*bytes) else { break };
            share = left;
            space -= bytes;
            kept[list] += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto::{Finding, OscillationSectionReport, ProgramSummary, SectionReport};

    fn report(findings: usize, sections: usize, oscillations: usize) -> ValidationReport {
        let finding = Finding { message: "x".repeat(90), ..Finding::default() };
        let section = SectionReport { first_line: 7, ..SectionReport::default() };
        let oscillation =
            OscillationSectionReport { condition: "c".repeat(490), ..OscillationSectionReport::default() };
        ValidationReport {
            findings: vec![finding; findings],
            sections: vec![section; sections],
            oscillations: vec![oscillation; oscillations],
            summary: Some(ProgramSummary { findings_not_listed: 3, ..ProgramSummary::default() }),
            ..ValidationReport::default()
        }
    }

    #[test]
    fn a_report_that_fits_stays() {
        let whole = report(100, 100, 100);
        let mut bounded = whole.clone();
        bound(&mut bounded, whole.encoded_len());
        assert_eq!(bounded, whole);
        bound(&mut bounded, whole.encoded_len() - 1);
        assert_ne!(bounded, whole);
    }

    #[test]
    fn what_is_left_out_is_counted_and_short_lists_stay_whole() {
        let mut bounded = report(1_000, 10, 1_000);
        bound(&mut bounded, 100_000);
        assert!(bounded.encoded_len() <= 100_000 && bounded.encoded_len() > 99_000, "{}", bounded.encoded_len());
        assert_eq!(bounded.sections.len(), 10);
        assert!((500..600).contains(&bounded.findings.len()), "{}", bounded.findings.len());
        assert!((90..110).contains(&bounded.oscillations.len()), "{}", bounded.oscillations.len());
        let not_listed = bounded.summary.unwrap().findings_not_listed;
        assert_eq!(not_listed, 3 + 1_000 - bounded.findings.len() as u64);
    }

    #[test]
    fn no_space_lists_nothing() {
        let mut bounded = report(10, 10, 10);
        bound(&mut bounded, 0);
        assert_eq!((bounded.findings.len(), bounded.sections.len(), bounded.oscillations.len()), (0, 0, 0));
    }
}
