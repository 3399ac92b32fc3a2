//! Stability lobes of `feedwave.v1.Tools`, and the spindle tables that monitoring takes from them.

use feedwave_contract::convert::{pocket_search_from_proto, stability_model_from_proto};
use feedwave_contract::names;
use feedwave_contract::proto::spindle_rule::Rule;
use feedwave_contract::proto::stability_model::Cut;
use feedwave_contract::proto::{
    ComputeStabilityLobesRequest, ComputeStabilityLobesResponse, MonitoringConfig, SpindleBand, StabilityModel,
    TableFromLobes, Tool,
};

use super::{Api, tools};
use crate::error::{Error, Result, Violations};

impl Api {
    /// Computes the stability lobes of a tool.
    ///
    /// # Errors
    /// As the contract says.
    pub async fn compute_stability_lobes(
        &self,
        request: ComputeStabilityLobesRequest,
    ) -> Result<ComputeStabilityLobesResponse> {
        let mut violations = Violations::default();
        let given = request.model.unwrap_or_default();
        let tool = self.tool_of(&mut violations, "model", &given).await;
        // What is wrong with the request itself is said first, whatever became of the tool.
        let known = tool.as_ref().ok().and_then(Option::as_ref);
        let model = stability_model_from_proto(&mut violations, "model", &given, known);
        let search = pocket_search_from_proto(&mut violations, "search", request.search.as_ref());
        let missing_tool = tool.err();
        if let Some(error) = missing_tool {
            return Err(error);
        }
        violations.finish()?;
        let (Some(model), Some(search)) = (model, search) else { return Err(undecided()) };
        let computed = self.engine.compute(move || model.stability_lobes(&search, request.chart_speeds)).await?;
        match computed {
            Ok(lobes) => Ok(ComputeStabilityLobesResponse { lobes: Some(lobes) }),
            Err(violations) => Err(violations.finish().err().map_or_else(undecided, Error::from)),
        }
    }

    /// The tool that a model is about; `None` where it names none.
    async fn tool_of(&self, violations: &mut Violations, field: &str, model: &StabilityModel) -> Result<Option<Tool>> {
        if model.tool.is_empty() {
            return Ok(None);
        }
        match violations.check(format!("{field}.tool"), names::parse_tool(&model.tool)) {
            Some(id) => Ok(Some(tools::from_record(&self.store.tool(id).await?)?)),
            None => Ok(None),
        }
    }

    /// Fills the spindle table that a configuration takes from stability lobes; what it took it from.
    pub(super) async fn fill_table(
        &self,
        violations: &mut Violations,
        config: &mut MonitoringConfig,
    ) -> Result<Option<TableFromLobes>> {
        const FIELD: &str = "config.rules.spindle.milling.table_from";
        let spindle = config.rules.as_mut().and_then(|rules| rules.spindle.as_mut());
        let Some(Rule::Milling(rule)) = spindle.and_then(|spindle| spindle.rule.as_mut()) else { return Ok(None) };
        let Some(from) = &rule.table_from else { return Ok(None) };
        let mut found = Violations::default();
        let given = from.model.clone().unwrap_or_default();
        let tool = self.tool_of(&mut found, "model", &given).await?;
        if matches!(given.cut, Some(Cut::Turning(_))) {
            found.add("model.turning", "the rule of milling needs the lobes of milling");
        }
        let model = stability_model_from_proto(&mut found, "model", &given, tool.as_ref());
        let search = pocket_search_from_proto(&mut found, "search", from.search.as_ref());
        let table = match (model.filter(|_| found.is_empty()), search) {
            (Some(model), Some(search)) => self.engine.compute(move || model.table("search.", &search)).await?,
            _ => Err(found),
        };
        match table {
            Ok(table) => rule.table = table,
            Err(found) => {
                violations.extend(FIELD, found);
                // In place of the table, so that only its cause is reported.
                rule.table =
                    vec![SpindleBand { above_rev_per_min: 0.0, up_to_rev_per_min: 1.0, spindle_rev_per_min: 1.0 }];
            }
        }
        Ok(Some(from.clone()))
    }
}

fn undecided() -> Error {
    Error::internal("a request was neither accepted nor refused")
}
