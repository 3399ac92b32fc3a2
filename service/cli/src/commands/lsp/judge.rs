//! Judging a version of a document as `feedwave validate` does, until it is superseded: findings, and when which line runs. What other
//! programs call is judged for what holds whatever calls it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use feedwave_contract::convert::report_to_proto;
use feedwave_contract::proto::Finding;
use feedwave_cutting::{SetpointBlock, Step, Validation};

use super::callers::Callers;
use super::document::Document;
use super::setup::Setup;

/// Most setpoints that are made for an editor: ten hours at 1 ms.
const MAX_SETPOINTS: u64 = 36_000_000;
/// Most steps, each of a block of setpoints or some thousand lines.
const MAX_STEPS: u32 = 100_000;

/// What was found out about one version of a document.
#[derive(Debug, Default)]
pub(super) struct Judgement {
    /// The version.
    pub(super) version: i32,
    /// Everything found, in the order of the source.
    pub(super) findings: Vec<Finding>,
    /// By line, counted from 0; empty where the program has errors, was not judged to its end, runs lines of other files, or is called.
    pub(super) times: Vec<LineTime>,
    /// Whole machining time, s; absent as the times are.
    pub(super) duration_s: Option<f64>,
    /// Why it was not judged, or not to its end.
    pub(super) problem: Option<String>,
}

/// When a line runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LineTime {
    /// When it begins first, s from the start of the program.
    pub(super) start_s: f64,
    /// When it ends last.
    pub(super) end_s: f64,
    /// How long it takes, all of its runs together; 0 for one that never moves.
    pub(super) takes_s: f64,
}

/// Judges a document that is at `path`; `None` once it is superseded.
pub(super) fn judge(
    document: &Document,
    path: Option<&Path>,
    setup: &mut Setup,
    superseded: &AtomicBool,
) -> Option<Judgement> {
    let version = document.version;
    if let Some(callers) = Callers::of(document, path, setup) {
        return Some(match callers.judge(document, &mut setup.further, superseded) {
            Ok(findings) => Judgement { version, findings: findings?, ..Judgement::default() },
            Err(error) => Judgement { version, problem: Some(error.message), ..Judgement::default() },
        });
    }
    let mut validation = Validation::new(setup.config.clone());
    let mut clock = LineClock::new(document.line_count(), setup.config.period_s());
    let mut runs_other_files = false;
    for _ in 0..MAX_STEPS {
        if superseded.load(Ordering::Relaxed) {
            return None;
        }
        match validation.step() {
            Step::NeedInput(place) if place.program == 0 => validation.supply(place, document.text().as_bytes()),
            Step::NeedInput(place) => {
                runs_other_files = true;
                match setup.further.read(place) {
                    Ok([]) => validation.finish_input(),
                    Ok(piece) => validation.push(piece),
                    Err(error) => {
                        return Some(Judgement { version, problem: Some(error.message), ..Judgement::default() });
                    }
                }
            }
            Step::Block => {
                clock.observe(validation.block());
                if clock.setpoints > MAX_SETPOINTS {
                    break;
                }
            }
            Step::Finished | Step::Refused => {
                let report = report_to_proto(&validation.finish());
                let summary = report.summary.unwrap_or_default();
                let (mut times, mut duration_s) = (Vec::new(), None);
                if summary.errors == 0 && !runs_other_files {
                    (times, duration_s) = (clock.finish(), Some(summary.duration_s));
                }
                return Some(Judgement { version, findings: report.findings, times, duration_s, problem: None });
            }
        }
    }
    let programs = &setup.config.programs;
    let line = clock.last_line;
    let log = validation.pipeline().findings().clone().into_sorted();
    let findings = log.iter().map(|finding| feedwave_contract::convert::finding_to_proto(finding, programs)).collect();
    let problem = format!("the program is too long to be judged while it is edited: judged up to line {line}");
    Some(Judgement { version, findings, problem: Some(problem), ..Judgement::default() })
}

/// When lines run, from the setpoints.
struct LineClock {
    /// First and last setpoint, and how many, by line from 1; 0 is what is before the first block.
    lines: Vec<(u64, u64, u64)>,
    period_s: f64,
    setpoints: u64,
    last_line: u32,
}

impl LineClock {
    fn new(lines: usize, period_s: f64) -> Self {
        Self { lines: vec![(0, 0, 0); lines + 1], period_s, setpoints: 0, last_line: 0 }
    }

    fn observe(&mut self, block: &SetpointBlock) {
        let mut index = block.first_index;
        for run in block.line.chunk_by(|one, next| one == next) {
            let (line, count) = (run[0], run.len() as u64);
            if let Some((first, last, all)) = self.lines.get_mut(line as usize) {
                if *all == 0 {
                    *first = index;
                }
                (*last, *all) = (index + count - 1, *all + count);
            }
            self.last_line = line;
            index += count;
        }
        self.setpoints += block.len() as u64;
    }

    /// A setpoint is the state at the end of its period: the line of the first began a period before it.
    fn finish(self) -> Vec<LineTime> {
        let time = |index: u64| index as f64 * self.period_s;
        let of = |&(first, last, all): &(u64, u64, u64)| match all {
            0 => LineTime::default(),
            _ => LineTime { start_s: time(first.saturating_sub(1)), end_s: time(last), takes_s: time(all) },
        };
        self.lines[1..].iter().map(of).collect()
    }
}
