//! Passes that were judged: like ones are judged once, and the floors of so many are simulated as one validation computes.

use feedwave_program::{Finding, SourceSpan};

use super::code;
use super::{
    FloorArea, FloorSettings, OscillationCondition, OscillationCut, OscillationJob, OscillationLimits,
    OscillationReport, judge,
};

/// Most passes whose judgement is kept.
const MAX_KNOWN: usize = 256;
/// Most floors that are simulated for one program.
const MAX_FLOORS: usize = 32;
/// Most cells that are lowered in all of them, each as often as it is lowered: some seconds.
const MAX_FLOOR_UPDATES: f64 = 2e9;

/// Passes that were judged, so that like ones are judged once; while validating only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Judgements {
    known: Vec<Judgement>,
    floors: usize,
    floor_updates: f64,
    floors_ended: bool,
}

#[derive(Clone, Debug)]
struct Judgement {
    tool: u32,
    condition: OscillationCondition,
    leading_edge: u32,
    cut: OscillationCut,
    limits: OscillationLimits,
    /// Whether the tool is guided: what the drives do to it depends on that.
    guided: bool,
    span: SourceSpan,
    report: Option<OscillationReport>,
    findings: Vec<Finding>,
}

impl Judgements {
    /// As [`judge`], with the floor as the profile says.
    pub(super) fn judge(
        &mut self,
        tool: u32,
        mut job: OscillationJob<'_>,
        floor: &FloorSettings,
        found: &mut Vec<Finding>,
    ) -> Option<OscillationReport> {
        let guided = job.drives.is_some_and(|drives| drives.guided);
        let like = self.known.iter().find(|known| {
            known.tool == tool
                && known.leading_edge == job.leading_edge
                && known.cut == job.cut
                && known.limits == job.limits
                && known.guided == guided
                && known.condition == *job.condition
        });
        if let Some(known) = like {
            let here = known.findings.iter().cloned().map(|mut finding| {
                if finding.span == known.span {
                    finding.span = job.span;
                }
                finding
            });
            found.extend(here);
            return known.report.clone();
        }
        job.floor = self.floor(&job, floor, found);
        let (report, findings) = judge(&job);
        found.extend(findings.iter().cloned());
        if self.known.len() < MAX_KNOWN {
            self.known.push(Judgement {
                tool,
                condition: job.condition.clone(),
                leading_edge: job.leading_edge,
                cut: job.cut,
                limits: job.limits,
                guided,
                span: job.span,
                report: report.clone(),
                findings,
            });
        }
        report
    }

    /// The part of the floor that is simulated for a cut; nothing once the most were, which is a finding once.
    fn floor(
        &mut self,
        job: &OscillationJob<'_>,
        settings: &FloorSettings,
        found: &mut Vec<Finding>,
    ) -> Option<FloorArea> {
        let area = settings.area(job.tool, &job.cut)?;
        if job.cut.incline_deg != 0.0 {
            // Refused before anything is computed.
            return Some(area);
        }
        // With the oscillation, and without it.
        let updates = 2.0 * area.updates(job.tool, &job.cut);
        let fits = self.floors < MAX_FLOORS && self.floor_updates + updates <= MAX_FLOOR_UPDATES;
        if fits && !self.floors_ended {
            self.floors += 1;
            self.floor_updates += updates;
            return Some(area);
        }
        if !std::mem::replace(&mut self.floors_ended, true) {
            let message = format!(
                "the floor of this and of further cuts is not simulated: {} different ones were, which is as much as one \
                 validation computes",
                self.floors
            );
            found.push(
                Finding::new(code::OSC_FLOOR, job.span, message)
                    .with_value("simulated", self.floors as f64, "")
                    .suggest("validate a part of the program to see its floor"),
            );
        }
        None
    }
}
