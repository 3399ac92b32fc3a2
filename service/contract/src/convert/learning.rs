//! Learning from runs: what is kept of telemetry, what is learnt from, and the proposal for the tool library.

use std::f64::consts::PI;

use feedwave_monitoring::{
    CutConditions, CutRecord, Estimate, LearningError, LearningModel, Learnt, MAX_RECORDS, MIN_RECORD_SAMPLES, Mode,
    Pair, PocketRequest, RecordedCut, RecordingLimits, learn, settling_samples,
};

use super::lobes::{check_arc, check_dynamics, modes_of, pocket_search_from_proto, stability_model_from_proto};
use crate::names;
use crate::proto;
use crate::violations::Violations;
use proto::LeftOut;
use proto::stability_model::Cut;

/// Most runs that are learnt from at once.
pub const MAX_LEARNING_RUNS: usize = 16;
/// Most stretches of lines with a depth.
const MAX_CUTS: usize = 64;
/// Most samples that are learnt from at once: more make the intervals little narrower, and take long.
const MAX_SAMPLES: usize = 60_000;
/// Least bytes that a run may be bounded to.
const MIN_RECORDING_BYTES: u64 = 100_000;
/// Shortest stretch, s.
const MIN_CUT_S: f64 = 0.05;

/// What of a run's telemetry is kept, with its defaults; a violation for each impossible value.
pub fn recording_from_proto(
    violations: &mut Violations,
    field: &str,
    settings: &proto::RecordingSettings,
) -> Option<RecordingLimits> {
    let limits = RecordingLimits {
        max_bytes: settings.max_bytes.unwrap_or(RecordingLimits::MAX_BYTES),
        cut_s: settings.cut_s.unwrap_or(RecordingLimits::CUT_S),
    };
    let mut found = Violations::default();
    let most = RecordingLimits::MOST_BYTES;
    if !(MIN_RECORDING_BYTES..=most).contains(&limits.max_bytes) {
        found.add("max_bytes", format!("must be {MIN_RECORDING_BYTES} to {most}, is {}", limits.max_bytes));
    }
    let most = RecordingLimits::MOST_CUT_S;
    if !(MIN_CUT_S..=most).contains(&limits.cut_s) {
        found.add("cut_s", format!("must be {MIN_CUT_S} to {most}, is {}", limits.cut_s));
    }
    let valid = found.is_empty();
    violations.extend(field, found);
    valid.then_some(limits)
}

/// What of a run's telemetry is kept, with every default filled in.
#[must_use]
pub const fn recording_to_proto(limits: &RecordingLimits) -> proto::RecordingSettings {
    proto::RecordingSettings { max_bytes: Some(limits.max_bytes), cut_s: Some(limits.cut_s) }
}

/// A stretch as it is stored.
#[must_use]
pub fn recorded_cut_to_proto(cut: &RecordedCut) -> proto::RecordedCut {
    let [x, y] = cut.conditions.feed_direction;
    proto::RecordedCut {
        line: cut.conditions.line,
        feed_mm_per_min: cut.conditions.feed_mm_per_min,
        feed_direction_x: x,
        feed_direction_y: y,
        spindle_rev_per_min: cut.conditions.spindle_rev_per_min,
        sample_rate_hz: cut.sample_rate_hz,
        first_ns: cut.first_ns,
        deflection_x_mm: cut.deflection_mm[0].clone(),
        deflection_y_mm: cut.deflection_mm[1].clone(),
        spindle_angle_deg: cut.spindle_angle_deg.clone(),
        missing: cut.missing.clone(),
    }
}

/// What lists say of a stretch.
#[must_use]
pub fn learning_record_of(cut: &RecordedCut, number: u32) -> proto::LearningRecord {
    let [x, y] = cut.conditions.feed_direction;
    proto::LearningRecord {
        run: String::new(),
        number,
        line: cut.conditions.line,
        feed_mm_per_min: cut.conditions.feed_mm_per_min,
        feed_direction_deg: y.atan2(x).to_degrees(),
        spindle_rev_per_min: cut.conditions.spindle_rev_per_min,
        depth_mm: 0.0,
        samples: u32::try_from(cut.spindle_angle_deg.len()).unwrap_or(u32::MAX),
        missing_samples: u32::try_from(cut.missing.len()).unwrap_or(u32::MAX),
        left_out: LeftOut::Unspecified.into(),
        sample_rate_hz: cut.sample_rate_hz,
    }
}

/// What was constant in a stretch, and what it counts against the bound in bytes.
#[must_use]
pub fn conditions_of(record: &proto::LearningRecord) -> (CutConditions, u64) {
    let (y, x) = record.feed_direction_deg.to_radians().sin_cos();
    let conditions = CutConditions {
        line: record.line,
        feed_mm_per_min: record.feed_mm_per_min,
        feed_direction: [x, y],
        spindle_rev_per_min: record.spindle_rev_per_min,
    };
    (conditions, RecordedCut::bytes_of(record.samples as usize, record.missing_samples as usize))
}

/// What is learnt from, checked.
#[derive(Clone, Debug)]
pub struct LearningPlan {
    source: proto::LearningSource,
    /// The tool as it is.
    tool: proto::Tool,
    model: LearningModel,
    search: Option<PocketRequest>,
}

/// The tool and the runs that a source names; a violation for each that it does not name rightly.
pub fn learning_names(
    violations: &mut Violations,
    field: &str,
    source: &proto::LearningSource,
) -> Option<(String, Vec<uuid::Uuid>)> {
    let mut found = Violations::default();
    let tool = found.check("tool", names::parse_tool(&source.tool)).map(str::to_owned);
    if !(1..=MAX_LEARNING_RUNS).contains(&source.runs.len()) {
        found.add("runs", format!("must name 1 to {MAX_LEARNING_RUNS} runs, names {}", source.runs.len()));
    }
    let mut runs = Vec::new();
    for (index, name) in source.runs.iter().take(MAX_LEARNING_RUNS).enumerate() {
        let Some(run) = found.check(format!("runs[{index}]"), names::parse_run(name)) else { continue };
        if runs.contains(&run) {
            found.add(format!("runs[{index}]"), "is named already");
        }
        runs.push(run);
    }
    let valid = found.is_empty();
    violations.extend(field, found);
    tool.filter(|_| valid).map(|tool| (tool, runs))
}

impl LearningPlan {
    /// What is learnt for a tool; a violation for each value that is impossible, or that neither the source nor the tool states.
    pub fn new(
        violations: &mut Violations,
        field: &str,
        source: &proto::LearningSource,
        tool: proto::Tool,
    ) -> Option<Self> {
        let mut found = Violations::default();
        let own = source.dynamics.clone().unwrap_or_default();
        check_dynamics(&mut found, "dynamics", &own);
        let present = tool.dynamics.clone().unwrap_or_default();
        let mode_x = one_mode(&mut found, "dynamics.modes_x", &own.modes_x, &present.modes_x, &source.tool);
        let mode_y = one_mode(&mut found, "dynamics.modes_y", &own.modes_y, &present.modes_y, &source.tool);
        let milling = source.milling.unwrap_or_default();
        if source.milling.is_none() {
            found.add("milling", "must be set");
        } else {
            check_arc(&mut found, &milling);
        }
        let edges = milling.edge_count.or(tool.edge_count);
        match edges {
            None => found.add("milling.edge_count", format!("must be set: {} does not state it", source.tool)),
            Some(edges) if !(1..=64).contains(&edges) => {
                found.add("milling.edge_count", format!("must be 1 to 64, is {edges}"));
            }
            Some(_) => {}
        }
        check_cuts(&mut found, &source.cuts);
        let search =
            source.search.as_ref().and_then(|search| pocket_search_from_proto(&mut found, "search", Some(search)));
        let valid = found.is_empty();
        violations.extend(field, found);
        let model = LearningModel {
            sample_rate_hz: 0.0,
            edges: edges?,
            entry_rad: milling.entry_deg.to_radians(),
            exit_rad: milling.exit_deg.to_radians().min(PI),
            mode_x: mode_x?,
            mode_y: mode_y?,
        };
        valid.then(|| Self { source: source.clone(), tool, model, search })
    }

    fn cut_of(&self, line: u32) -> Option<&proto::LearningCut> {
        self.source
            .cuts
            .iter()
            .find(|cut| (cut.first_line == 0 && cut.last_line == 0) || (cut.first_line..=cut.last_line).contains(&line))
    }

    /// Says of every stretch of the runs whether it is learnt from, and how deep it is.
    pub fn choose(&self, records: &mut [proto::LearningRecord]) {
        let rate_hz = records.iter().find(|record| self.cut_of(record.line).is_some()).map(|it| it.sample_rate_hz);
        let mut taken: Vec<usize> = Vec::new();
        for (place, record) in records.iter_mut().enumerate() {
            let cut = self.cut_of(record.line);
            record.depth_mm = cut.map_or(0.0, |cut| cut.depth_mm);
            let settling = settling_samples(&LearningModel { sample_rate_hz: record.sample_rate_hz, ..self.model });
            let judged = (record.samples.saturating_sub(record.missing_samples) as usize).saturating_sub(settling);
            let left_out = if cut.is_none() {
                LeftOut::OtherLine
            } else if Some(record.sample_rate_hz) != rate_hz {
                LeftOut::OtherSampleRate
            } else if judged < MIN_RECORD_SAMPLES {
                LeftOut::TooShort
            } else {
                taken.push(place);
                LeftOut::Unspecified
            };
            record.left_out = left_out.into();
        }
        // The first of each condition, then the second of each, as far as there is room.
        let turn = |place: usize| {
            let of = &records[place];
            let is_like = |other: &proto::LearningRecord| {
                other.run == of.run
                    && other.line == of.line
                    && (other.feed_mm_per_min / of.feed_mm_per_min - 1.0).abs() < 0.02
            };
            taken.iter().filter(|other| **other < place && is_like(&records[**other])).count()
        };
        let mut order: Vec<_> = taken.iter().map(|place| (turn(*place), *place)).collect();
        order.sort_unstable();
        let (mut samples, mut count) = (0, 0);
        for (_, place) in order {
            let more = records[place].samples as usize;
            if samples + more > MAX_SAMPLES.max(more) || count == MAX_RECORDS {
                records[place].left_out = LeftOut::Enough.into();
            } else {
                (samples, count) = (samples + more, count + 1);
            }
        }
    }

    /// Learns from the stretches that were chosen, in their order among `records`; the proposal without its digest.
    ///
    /// # Errors
    /// Why nothing is learnt, for people.
    pub fn propose(
        &self,
        records: Vec<proto::LearningRecord>,
        cuts: &[proto::RecordedCut],
    ) -> Result<proto::ToolProposal, String> {
        let used: Vec<_> = records.iter().filter(|record| record.left_out() == LeftOut::Unspecified).collect();
        if used.len() != cuts.len() {
            return Err("stretches of the runs were removed meanwhile".to_owned());
        }
        let rate_hz = cuts.first().map(|cut| cut.sample_rate_hz).ok_or("no stretch of the runs can be learnt from")?;
        let model = LearningModel { sample_rate_hz: rate_hz, ..self.model };
        let cut_records: Vec<_> = used.iter().zip(cuts).map(|(record, cut)| self.cut_record(record, cut)).collect();
        let learnt = learn(&model, &cut_records).map_err(|error| told(&error, &used))?;
        let present = self.tool.dynamics.clone().unwrap_or_default();
        let dynamics = self.dynamics(&present, &learnt);
        let mut problems = Violations::default();
        check_dynamics(&mut problems, "dynamics", &dynamics);
        if let Some(problem) = problems.as_slice().first() {
            return Err(format!(
                "no tool has what explains the records best: {} {}",
                problem.field, problem.description
            ));
        }
        let lobes = self.lobes(&dynamics)?;
        let present_pockets = self.lobes(&present).ok().flatten().map(|lobes| lobes.pockets).unwrap_or_default();
        Ok(proto::ToolProposal {
            tool: self.source.tool.clone(),
            tool_etag: self.tool.etag.clone(),
            tangential_n_per_mm2: Some(estimate(&learnt.tangential_n_per_mm2)),
            edge_tangential_n_per_mm: Some(estimate(&learnt.edge_tangential_n_per_mm)),
            radial_n_per_mm2: Some(estimate(&learnt.radial_n_per_mm2)),
            edge_radial_n_per_mm: Some(estimate(&learnt.edge_radial_n_per_mm)),
            edge_run_out_mm: learnt.edge_run_out_mm.as_ref().map(estimate),
            run_out_mm: Some(estimate(&learnt.run_out_mm)),
            mode_x: Some(mode(&learnt.mode_x)),
            mode_y: Some(mode(&learnt.mode_y)),
            is_x_dominant: learnt.dominant(&model) == learnt.mode_x,
            residual_mm: learnt.residual_mm,
            correlation_factor: learnt.correlation_factor,
            samples: learnt.samples as u64,
            records,
            dynamics: Some(dynamics),
            present_dynamics: self.tool.dynamics.clone(),
            lobes,
            present_pockets,
            digest: String::new(),
        })
    }

    fn cut_record<'a>(&self, record: &proto::LearningRecord, cut: &'a proto::RecordedCut) -> CutRecord<'a> {
        CutRecord {
            deflection_mm: Pair { x: &cut.deflection_x_mm, y: &cut.deflection_y_mm },
            spindle_angle_deg: &cut.spindle_angle_deg,
            feed_mm_per_min: cut.feed_mm_per_min,
            depth_mm: record.depth_mm,
            feed_direction: [cut.feed_direction_x, cut.feed_direction_y],
            first_edge_deg: self.cut_of(cut.line).map_or(0.0, |cut| cut.first_edge_deg),
            missing: &cut.missing,
        }
    }

    /// The tool's dynamics as they would be.
    fn dynamics(&self, present: &proto::ToolDynamics, learnt: &Learnt) -> proto::ToolDynamics {
        let mode = |learnt: &feedwave_monitoring::LearntMode, model: &Mode| proto::VibrationMode {
            frequency_hz: learnt.frequency_hz.value,
            damping_ratio: learnt.damping_ratio.value,
            stiffness_n_per_mm: model.stiffness_n_per_mm,
        };
        let certain = |estimate: &Estimate| if estimate.is_positive() { estimate.value } else { 0.0 };
        let tangential = learnt.tangential_n_per_mm2.value;
        proto::ToolDynamics {
            modes_x: vec![mode(&learnt.mode_x, &self.model.mode_x)],
            modes_y: vec![mode(&learnt.mode_y, &self.model.mode_y)],
            tangential_n_per_mm2: Some(tangential),
            radial_ratio: Some(certain(&learnt.radial_n_per_mm2) / tangential),
            edge_tangential_n_per_mm: Some(certain(&learnt.edge_tangential_n_per_mm)),
            edge_radial_n_per_mm: Some(certain(&learnt.edge_radial_n_per_mm)),
            edge_run_out_mm: learnt.edge_run_out_mm.as_ref().map(certain).or(present.edge_run_out_mm),
            ..present.clone()
        }
    }

    /// Lobes and table with these dynamics, where they are asked for.
    fn lobes(&self, dynamics: &proto::ToolDynamics) -> Result<Option<proto::StabilityLobes>, String> {
        let Some(search) = &self.search else { return Ok(None) };
        let milling =
            self.source.milling.map(|milling| proto::MillingCut { edge_count: Some(self.model.edges), ..milling });
        let given = proto::StabilityModel {
            tool: String::new(),
            dynamics: Some(dynamics.clone()),
            cut: milling.map(Cut::Milling),
        };
        let mut found = Violations::default();
        let lobes = match stability_model_from_proto(&mut found, "model", &given, None) {
            Some(model) => model.stability_lobes(search, None),
            None => Err(found),
        };
        let first = |found: Violations| {
            let first = found.as_slice().first().map(|it| format!("{} {}", it.field, it.description));
            format!("no spindle table follows: {}", first.unwrap_or_default())
        };
        lobes.map(Some).map_err(first)
    }
}

/// The one mode of a direction.
fn one_mode(
    found: &mut Violations,
    field: &str,
    own: &[proto::VibrationMode],
    tools: &[proto::VibrationMode],
    tool: &str,
) -> Option<Mode> {
    let modes = modes_of(if own.is_empty() { tools } else { own });
    match modes.as_slice() {
        [mode] => Some(*mode),
        [] => {
            found
                .add(field, format!("must be set: {tool} does not state it, and forces alone do not tell a stiffness"));
            None
        }
        more => {
            found.add(field, format!("must be one mode, the dominant one, to be learnt; there are {}", more.len()));
            None
        }
    }
}

fn check_cuts(found: &mut Violations, cuts: &[proto::LearningCut]) {
    if !(1..=MAX_CUTS).contains(&cuts.len()) {
        found.add("cuts", format!("must be 1 to {MAX_CUTS}, are {}", cuts.len()));
    }
    for (index, cut) in cuts.iter().take(MAX_CUTS).enumerate() {
        let field = |name: &str| format!("cuts[{index}].{name}");
        if (cut.first_line == 0) != (cut.last_line == 0) || cut.last_line < cut.first_line {
            let (first, last) = (cut.first_line, cut.last_line);
            found.add(
                field("last_line"),
                format!("must not be before first_line, both 0 for every line; are {first} and {last}"),
            );
        }
        if !(1e-6..=1e3).contains(&cut.depth_mm) {
            found.add(field("depth_mm"), format!("must be 0.000001 to 1000, is {}", cut.depth_mm));
        }
        if !(-360.0..=360.0).contains(&cut.first_edge_deg) {
            found.add(field("first_edge_deg"), format!("must be -360 to 360, is {}", cut.first_edge_deg));
        }
    }
}

/// Why nothing was learnt, with the names of the stretches.
fn told(error: &LearningError, used: &[&proto::LearningRecord]) -> String {
    let feeds: std::collections::BTreeSet<_> =
        used.iter().map(|record| record.feed_mm_per_min.round() as i64).collect();
    let more = if feeds.len() < 2 {
        "; all stretches have one feed: cuts at two feeds tell the forces of the edge from those of the chip"
    } else {
        ""
    };
    format!("{error}{more}")
}

const fn estimate(estimate: &Estimate) -> proto::Estimate {
    proto::Estimate {
        value: estimate.value,
        standard_error: estimate.standard_error,
        lower: estimate.lower,
        upper: estimate.upper,
    }
}

const fn mode(mode: &feedwave_monitoring::LearntMode) -> proto::LearntMode {
    proto::LearntMode {
        frequency_hz: Some(estimate(&mode.frequency_hz)),
        damping_ratio: Some(estimate(&mode.damping_ratio)),
    }
}
