//! Stability lobes: from a tool and a cut to the model, and from the lobes to the contract.

use std::f64::consts::PI;

use feedwave_monitoring::{
    LOW_IMMERSION, LOW_IMMERSION_ERROR, LobeError, Lobes, MillingModel, Mode, Pocket, PocketRequest, TableRow,
    TurningModel, dynamics_problems,
};
use feedwave_program::{Finding, SourceSpan};

use super::finding_to_proto;
use crate::code;
use crate::proto;
use crate::violations::Violations;
use proto::stability_model::Cut;

/// Smallest arc in which an edge cuts, degrees.
const MIN_ARC_DEG: f64 = 0.001;

/// Largest force of an edge, N/mm.
const MAX_EDGE_FORCE_N_PER_MM: f64 = 1e6;
/// Largest run-out of the edges, mm.
const MAX_RUN_OUT_MM: f64 = 100.0;

/// What is cut, with everything that is known of the tool.
#[derive(Clone, Debug, PartialEq)]
pub enum StabilityModel {
    /// The tool rotates.
    Milling(MillingModel),
    /// The workpiece rotates.
    Turning(TurningModel),
}

/// What is wrong with modal and cutting data to be kept.
pub(super) fn check_dynamics(violations: &mut Violations, field: &str, dynamics: &proto::ToolDynamics) {
    let [x, y, normal] = [&dynamics.modes_x, &dynamics.modes_y, &dynamics.modes_normal].map(|modes| modes_of(modes));
    let lists = [("modes_x", &*x), ("modes_y", &*y), ("modes_normal", &*normal)];
    let coefficients =
        [("tangential_n_per_mm2", dynamics.tangential_n_per_mm2), ("specific_n_per_mm2", dynamics.specific_n_per_mm2)];
    for problem in dynamics_problems(&lists, &coefficients, dynamics.radial_ratio) {
        add(violations, &format!("{field}."), &problem);
    }
    let others = [
        ("edge_tangential_n_per_mm", dynamics.edge_tangential_n_per_mm, MAX_EDGE_FORCE_N_PER_MM),
        ("edge_radial_n_per_mm", dynamics.edge_radial_n_per_mm, MAX_EDGE_FORCE_N_PER_MM),
        ("edge_run_out_mm", dynamics.edge_run_out_mm, MAX_RUN_OUT_MM),
    ];
    for (name, value, most) in others {
        if let Some(value) = value.filter(|value| !(0.0..=most).contains(value)) {
            violations.add(format!("{field}.{name}"), format!("must be 0 to {most}, is {value}"));
        }
    }
}

pub(super) fn modes_of(modes: &[proto::VibrationMode]) -> Vec<Mode> {
    let mode = |mode: &proto::VibrationMode| Mode {
        frequency_hz: mode.frequency_hz,
        damping_ratio: mode.damping_ratio,
        stiffness_n_per_mm: mode.stiffness_n_per_mm,
    };
    modes.iter().map(mode).collect()
}

/// Adds a problem; a value's field follows the prefix.
fn add(violations: &mut Violations, prefix: &str, problem: &LobeError) {
    match problem {
        LobeError::Value { field, value, least, most } if field.starts_with("modes") && !field.contains('[') => {
            violations.add(format!("{prefix}{field}"), format!("must list {least} to {most} modes, lists {value}"));
        }
        LobeError::Value { field, value, least, most } => {
            violations.add(format!("{prefix}{field}"), format!("must be {least} to {most}, is {value}"));
        }
        LobeError::TooManyLobes { .. } => violations.add(format!("{prefix}lowest_rev_per_min"), problem.to_string()),
        LobeError::BandTooNarrow { .. } => violations.add(format!("{prefix}bands"), problem.to_string()),
        LobeError::TooDeep { .. } => violations.add(format!("{prefix}required_mm"), problem.to_string()),
    }
}

/// The model; a violation for each value that is impossible or that neither the request nor the tool states.
pub fn stability_model_from_proto(
    violations: &mut Violations,
    field: &str,
    model: &proto::StabilityModel,
    tool: Option<&proto::Tool>,
) -> Option<StabilityModel> {
    let mut found = Violations::default();
    let own = model.dynamics.clone().unwrap_or_default();
    check_dynamics(&mut found, "dynamics", &own);
    let tools = tool.and_then(|tool| tool.dynamics.clone()).unwrap_or_default();
    let modes = |own: &[proto::VibrationMode], tools: &[proto::VibrationMode]| {
        modes_of(if own.is_empty() { tools } else { own })
    };
    let mut needed = |field: &str, value: Option<f64>| {
        value.unwrap_or_else(|| {
            found.add(field, missing(model));
            1.0
        })
    };
    let cut = match &model.cut {
        Some(Cut::Milling(cut)) => {
            let tangential = own.tangential_n_per_mm2.or(tools.tangential_n_per_mm2);
            let tangential_n_per_mm2 = needed("dynamics.tangential_n_per_mm2", tangential);
            let radial_ratio = needed("dynamics.radial_ratio", own.radial_ratio.or(tools.radial_ratio));
            let edges = cut.edge_count.or_else(|| tool.and_then(|tool| tool.edge_count));
            needed("milling.edge_count", edges.map(f64::from));
            Some(StabilityModel::Milling(MillingModel {
                modes_x: modes(&own.modes_x, &tools.modes_x),
                modes_y: modes(&own.modes_y, &tools.modes_y),
                edges: edges.unwrap_or(1),
                entry_rad: cut.entry_deg.to_radians().min(PI),
                exit_rad: cut.exit_deg.to_radians().min(PI),
                tangential_n_per_mm2,
                radial_ratio,
            }))
        }
        Some(Cut::Turning(proto::TurningCut {})) => {
            let specific = own.specific_n_per_mm2.or(tools.specific_n_per_mm2);
            Some(StabilityModel::Turning(TurningModel {
                specific_n_per_mm2: needed("dynamics.specific_n_per_mm2", specific),
                modes: modes(&own.modes_normal, &tools.modes_normal),
            }))
        }
        None => {
            found.add("cut", "milling or turning must be set");
            None
        }
    };
    if let Some(Cut::Milling(cut)) = &model.cut {
        check_arc(&mut found, cut);
    }
    check_model(&mut found, model, cut.as_ref());
    let valid = found.is_empty();
    violations.extend(field, found);
    cut.filter(|_| valid)
}

/// What is wrong with a model whose parts are known.
fn check_model(found: &mut Violations, given: &proto::StabilityModel, model: Option<&StabilityModel>) {
    match model {
        Some(StabilityModel::Milling(milling)) if milling.modes_x.is_empty() && milling.modes_y.is_empty() => {
            found.add("dynamics.modes_x", missing(given));
        }
        Some(StabilityModel::Turning(turning)) if turning.modes.is_empty() => {
            found.add("dynamics.modes_normal", missing(given));
        }
        // What the request's own data or the arc has wrong is reported already, in their own words and units.
        Some(StabilityModel::Milling(milling)) if found.is_empty() => {
            for problem in milling.problems() {
                add(found, "milling.", &problem);
            }
        }
        _ => {}
    }
}

fn missing(model: &proto::StabilityModel) -> String {
    match model.tool.as_str() {
        "" => "must be set, or a tool that states it".to_owned(),
        tool => format!("must be set: {tool} does not state it"),
    }
}

pub(super) fn check_arc(found: &mut Violations, cut: &proto::MillingCut) {
    let (entry, exit) = (cut.entry_deg, cut.exit_deg);
    if !(0.0..180.0).contains(&entry) {
        found.add("milling.entry_deg", format!("must be 0 to below 180, is {entry}"));
    } else if !(exit > entry + MIN_ARC_DEG && exit <= 180.0) {
        found.add("milling.exit_deg", format!("must be above the entry angle of {entry}, at most 180, is {exit}"));
    }
}

/// The search with its defaults; a violation for each impossible value.
pub fn pocket_search_from_proto(
    violations: &mut Violations,
    field: &str,
    search: Option<&proto::PocketSearch>,
) -> Option<PocketRequest> {
    let Some(search) = search else {
        violations.add(field, "must be set");
        return None;
    };
    let request = PocketRequest {
        lowest_rev_per_min: search.lowest_rev_per_min,
        highest_rev_per_min: search.highest_rev_per_min,
        bands: search.bands.unwrap_or(PocketRequest::BANDS),
        margin: search.margin.unwrap_or(PocketRequest::MARGIN),
        speed_tolerance: search.speed_tolerance.unwrap_or(PocketRequest::SPEED_TOLERANCE),
        required_mm: search.required_mm,
    };
    let problems = request.problems();
    for problem in &problems {
        add(violations, &format!("{field}."), problem);
    }
    problems.is_empty().then_some(request)
}

impl StabilityModel {
    fn lobes(&self) -> Result<Lobes, LobeError> {
        match self {
            Self::Milling(model) => model.lobes(),
            Self::Turning(model) => model.lobes(),
        }
    }

    /// The spindle table of the best speeds.
    ///
    /// # Errors
    /// A violation, below the field of the search, where there is no such table.
    pub fn table(&self, field: &str, search: &PocketRequest) -> Result<Vec<proto::SpindleBand>, Violations> {
        let pockets = self.lobes().and_then(|lobes| lobes.pockets(search));
        let pockets = pockets.map_err(|problem| refused(field, &problem))?;
        Ok(pockets.iter().map(|pocket| band(&pocket.row)).collect())
    }

    /// Chart and table.
    ///
    /// # Errors
    /// As [`StabilityModel::table`]; `chart_speeds` has a field of its own.
    pub fn stability_lobes(
        &self,
        search: &PocketRequest,
        chart_speeds: Option<u32>,
    ) -> Result<proto::StabilityLobes, Violations> {
        let lobes = self.lobes().map_err(|problem| refused("model.", &problem))?;
        let chart = lobes.chart(
            search.lowest_rev_per_min,
            search.highest_rev_per_min,
            chart_speeds.unwrap_or(Lobes::CHART_SPEEDS),
        );
        let chart = chart.map_err(|problem| match &problem {
            LobeError::Value { .. } => refused("chart_", &problem),
            _ => refused("search.", &problem),
        })?;
        let pockets = lobes.pockets(search).map_err(|problem| refused("search.", &problem))?;
        let point = |point: &feedwave_monitoring::ChartPoint| proto::StabilityPoint {
            spindle_rev_per_min: point.spindle_rev_per_min,
            limit_mm: point.limit.map(|limit| limit.limit_mm),
            chatter_hz: point.limit.map_or(0.0, |limit| limit.frequency_hz),
            lobe: point.limit.map_or(0, |limit| limit.lobe),
        };
        let pocket =
            |pocket: &Pocket| proto::StabilityPocket { band: Some(band(&pocket.row)), stable_mm: pocket.stable_mm };
        let immersion = match self {
            Self::Milling(model) => Some(model.radial_immersion()),
            Self::Turning(_) => None,
        };
        Ok(proto::StabilityLobes {
            chart: chart.iter().map(point).collect(),
            least_limit_mm: lobes.least_limit_mm(),
            radial_immersion: immersion,
            pockets: pockets.iter().map(pocket).collect(),
            search: Some(proto::PocketSearch {
                lowest_rev_per_min: search.lowest_rev_per_min,
                highest_rev_per_min: search.highest_rev_per_min,
                bands: Some(search.bands),
                margin: Some(search.margin),
                speed_tolerance: Some(search.speed_tolerance),
                required_mm: search.required_mm,
            }),
            findings: immersion
                .and_then(|immersion| low_immersion(immersion, search.margin))
                .iter()
                .map(|finding| finding_to_proto(finding, &[]))
                .collect(),
        })
    }
}

fn refused(prefix: &str, problem: &LobeError) -> Violations {
    let mut violations = Violations::default();
    add(&mut violations, prefix, problem);
    violations
}

const fn band(row: &TableRow) -> proto::SpindleBand {
    proto::SpindleBand {
        above_rev_per_min: row.above_rev_per_min,
        up_to_rev_per_min: row.up_to_rev_per_min,
        spindle_rev_per_min: row.spindle_rev_per_min,
    }
}

/// Warning about a cut that is much interrupted (docs/functions/adaptive-feed.md, "Spindle table from
/// stability lobes": the zeroth order errs on the unsafe side).
fn low_immersion(immersion: f64, margin: f64) -> Option<Finding> {
    if immersion >= LOW_IMMERSION {
        return None;
    }
    let error = LOW_IMMERSION_ERROR;
    let told = format!(
        "the radial immersion of {:.1} % is low: the true limits may be up to {:.0} % below the computed ones",
        100.0 * immersion,
        100.0 * error
    );
    let finding = if margin < error {
        let message = format!("{told}, and the margin is only {:.1} %", 100.0 * margin);
        let cure = format!("Take a margin of at least {error}.");
        Finding::new(code::LOBES_LOW_IMMERSION, SourceSpan::default(), message)
            .suggest_value(cure, None, "margin", error, "")
    } else {
        let message = format!("{told}, which the margin of {:.1} % covers", 100.0 * margin);
        Finding::new(code::LOBES_LOW_IMMERSION_COVERED, SourceSpan::default(), message)
    };
    Some(finding.with_value("radial_immersion", immersion, "").with_value("margin", margin, "").with_value(
        "largest_error",
        error,
        "",
    ))
}
