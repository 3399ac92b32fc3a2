//! Which role every method and every route needs: the one table.

use std::collections::HashMap;
use std::sync::LazyLock;

use feedwave_contract::routes::Route;

use super::Role;

/// What one has to be to be answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Needs {
    /// Nothing: probes and the description of the service.
    Nobody,
    /// A role.
    Role(Role),
}

const VIEWER: Needs = Needs::Role(Role::Viewer);
const PLANNER: Needs = Needs::Role(Role::Planner);
const MACHINE: Needs = Needs::Role(Role::Machine);
const ADMIN: Needs = Needs::Role(Role::Admin);

/// Every method of the contract, and of health and reflection.
const METHODS: [(&str, Needs); 47] = [
    ("/feedwave.v1.Jobs/CreateJob", PLANNER),
    ("/feedwave.v1.Jobs/UploadProgram", PLANNER),
    ("/feedwave.v1.Jobs/GetUpload", PLANNER),
    ("/feedwave.v1.Jobs/ValidateProgram", PLANNER),
    ("/feedwave.v1.Jobs/GetJob", VIEWER),
    ("/feedwave.v1.Jobs/GetReport", VIEWER),
    ("/feedwave.v1.Jobs/ListJobs", VIEWER),
    ("/feedwave.v1.Jobs/ListJobEvents", VIEWER),
    ("/feedwave.v1.Jobs/WatchJobs", VIEWER),
    ("/feedwave.v1.Jobs/CancelJob", PLANNER),
    ("/feedwave.v1.Jobs/DeleteJob", PLANNER),
    ("/feedwave.v1.Jobs/DeleteProgram", PLANNER),
    ("/feedwave.v1.Programs/ListPrograms", VIEWER),
    ("/feedwave.v1.Programs/GetProgram", VIEWER),
    ("/feedwave.v1.Programs/ListUploads", VIEWER),
    ("/feedwave.v1.Programs/ReadProgram", VIEWER),
    ("/feedwave.v1.Programs/DeleteProgram", PLANNER),
    ("/feedwave.v1.Programs/Interpret", VIEWER),
    ("/feedwave.v1.Setpoints/StreamSetpoints", VIEWER),
    ("/feedwave.v1.Setpoints/GetPlanSummary", VIEWER),
    ("/feedwave.v1.Threads/PlanThread", PLANNER),
    ("/feedwave.v1.Threads/FollowSpindle", MACHINE),
    ("/feedwave.v1.Runs/Run", MACHINE),
    ("/feedwave.v1.Runs/ReplayRun", VIEWER),
    ("/feedwave.v1.Telemetry/SetMonitoring", PLANNER),
    ("/feedwave.v1.Telemetry/GetMonitoring", VIEWER),
    ("/feedwave.v1.Telemetry/Ingest", MACHINE),
    ("/feedwave.v1.Telemetry/AcknowledgeCondition", MACHINE),
    ("/feedwave.v1.Telemetry/GetRun", VIEWER),
    ("/feedwave.v1.Telemetry/ListRuns", VIEWER),
    ("/feedwave.v1.Telemetry/ListDecisions", VIEWER),
    ("/feedwave.v1.Telemetry/WatchDecisions", VIEWER),
    ("/feedwave.v1.Machines/CreateMachine", ADMIN),
    ("/feedwave.v1.Machines/GetMachine", VIEWER),
    ("/feedwave.v1.Machines/ListMachines", VIEWER),
    ("/feedwave.v1.Machines/UpdateMachine", ADMIN),
    ("/feedwave.v1.Machines/DeleteMachine", ADMIN),
    ("/feedwave.v1.Tools/CreateTool", ADMIN),
    ("/feedwave.v1.Tools/GetTool", VIEWER),
    ("/feedwave.v1.Tools/ListTools", VIEWER),
    ("/feedwave.v1.Tools/UpdateTool", ADMIN),
    ("/feedwave.v1.Tools/DeleteTool", ADMIN),
    ("/feedwave.v1.Tools/ComputeStabilityLobes", VIEWER),
    ("/grpc.health.v1.Health/Check", Needs::Nobody),
    ("/grpc.health.v1.Health/Watch", Needs::Nobody),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", Needs::Nobody),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", Needs::Nobody),
];

static BY_PATH: LazyLock<HashMap<&'static str, Needs>> = LazyLock::new(|| METHODS.into_iter().collect());

/// What a method needs. One that does not exist needs a role as well, so that nobody unknown can look for methods.
pub(crate) fn of_method(path: &str) -> Needs {
    BY_PATH.get(path).copied().unwrap_or(VIEWER)
}

/// What a route needs.
pub(crate) const fn of_route(route: Route) -> Needs {
    match route {
        Route::ListJobs
        | Route::GetJob
        | Route::GetReport
        | Route::ListJobEvents
        | Route::ListRuns
        | Route::ListDecisions
        | Route::GetState
        | Route::GetMetrics => VIEWER,
        Route::GetHealth | Route::GetReadiness => Needs::Nobody,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use feedwave_contract::proto::DESCRIPTORS;

    use super::*;

    #[test]
    fn every_method_of_the_contract_is_in_the_table_once_and_no_other() {
        let in_table: BTreeSet<String> = METHODS.iter().map(|(path, _)| (*path).to_owned()).collect();
        assert_eq!(in_table.len(), METHODS.len(), "a method is there twice");
        let of_others = |path: &String| path.starts_with("/grpc.");
        let of_contract: BTreeSet<String> = DESCRIPTORS
            .services()
            .flat_map(|service| {
                let path =
                    |method: prost_reflect::MethodDescriptor| format!("/{}/{}", service.full_name(), method.name());
                service.methods().map(path).collect::<Vec<_>>()
            })
            .collect();
        let listed: BTreeSet<String> = in_table.into_iter().filter(|path| !of_others(path)).collect();
        assert_eq!(listed, of_contract.into_iter().filter(|path| !of_others(path)).collect());
        assert_eq!(of_method("/feedwave.v1.Jobs/Nothing"), VIEWER);
    }
}
