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

/// What a call of a method does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// It reads, or computes something that is not kept.
    Reads,
    /// It changes what is kept, or moves a machine: the audit log has it.
    Changes,
}

const READS: Effect = Effect::Reads;
const CHANGES: Effect = Effect::Changes;
const VIEWER: Needs = Needs::Role(Role::Viewer);
const PLANNER: Needs = Needs::Role(Role::Planner);
const MACHINE: Needs = Needs::Role(Role::Machine);
const ADMIN: Needs = Needs::Role(Role::Admin);

/// Every method of the contract, and of health and reflection.
const METHODS: [(&str, Needs, Effect); 54] = [
    ("/feedwave.v1.Jobs/CreateJob", PLANNER, CHANGES),
    ("/feedwave.v1.Jobs/UploadProgram", PLANNER, CHANGES),
    ("/feedwave.v1.Jobs/GetUpload", PLANNER, READS),
    ("/feedwave.v1.Jobs/ValidateProgram", PLANNER, READS),
    ("/feedwave.v1.Jobs/GetJob", VIEWER, READS),
    ("/feedwave.v1.Jobs/GetReport", VIEWER, READS),
    ("/feedwave.v1.Jobs/ListJobs", VIEWER, READS),
    ("/feedwave.v1.Jobs/ListJobEvents", VIEWER, READS),
    ("/feedwave.v1.Jobs/WatchJobs", VIEWER, READS),
    ("/feedwave.v1.Jobs/CancelJob", PLANNER, CHANGES),
    ("/feedwave.v1.Jobs/DeleteJob", PLANNER, CHANGES),
    ("/feedwave.v1.Jobs/DeleteProgram", PLANNER, CHANGES),
    ("/feedwave.v1.Programs/ListPrograms", VIEWER, READS),
    ("/feedwave.v1.Programs/GetProgram", VIEWER, READS),
    ("/feedwave.v1.Programs/ListUploads", VIEWER, READS),
    ("/feedwave.v1.Programs/ReadProgram", VIEWER, READS),
    ("/feedwave.v1.Programs/DeleteProgram", PLANNER, CHANGES),
    ("/feedwave.v1.Programs/Interpret", VIEWER, READS),
    ("/feedwave.v1.Programs/Improve", PLANNER, READS),
    ("/feedwave.v1.Setpoints/StreamSetpoints", VIEWER, READS),
    ("/feedwave.v1.Setpoints/GetPlanSummary", VIEWER, READS),
    ("/feedwave.v1.Threads/PlanThread", PLANNER, READS),
    ("/feedwave.v1.Threads/FollowSpindle", MACHINE, CHANGES),
    ("/feedwave.v1.Runs/Run", MACHINE, CHANGES),
    ("/feedwave.v1.Runs/ReplayRun", VIEWER, READS),
    ("/feedwave.v1.Telemetry/SetMonitoring", PLANNER, CHANGES),
    ("/feedwave.v1.Telemetry/GetMonitoring", VIEWER, READS),
    ("/feedwave.v1.Telemetry/Ingest", MACHINE, CHANGES),
    ("/feedwave.v1.Telemetry/AcknowledgeCondition", MACHINE, CHANGES),
    ("/feedwave.v1.Telemetry/GetRun", VIEWER, READS),
    ("/feedwave.v1.Telemetry/ListRuns", VIEWER, READS),
    ("/feedwave.v1.Telemetry/ListDecisions", VIEWER, READS),
    ("/feedwave.v1.Telemetry/WatchDecisions", VIEWER, READS),
    ("/feedwave.v1.Machines/CreateMachine", ADMIN, CHANGES),
    ("/feedwave.v1.Machines/GetMachine", VIEWER, READS),
    ("/feedwave.v1.Machines/ListMachines", VIEWER, READS),
    ("/feedwave.v1.Machines/UpdateMachine", ADMIN, CHANGES),
    ("/feedwave.v1.Machines/DeleteMachine", ADMIN, CHANGES),
    ("/feedwave.v1.Machines/GetState", VIEWER, READS),
    ("/feedwave.v1.Machines/ListStates", VIEWER, READS),
    ("/feedwave.v1.Machines/WatchState", VIEWER, READS),
    ("/feedwave.v1.Tools/CreateTool", ADMIN, CHANGES),
    ("/feedwave.v1.Tools/GetTool", VIEWER, READS),
    ("/feedwave.v1.Tools/ListTools", VIEWER, READS),
    ("/feedwave.v1.Tools/UpdateTool", ADMIN, CHANGES),
    ("/feedwave.v1.Tools/DeleteTool", ADMIN, CHANGES),
    ("/feedwave.v1.Tools/ComputeStabilityLobes", VIEWER, READS),
    ("/feedwave.v1.Tools/ComputeToolProposal", VIEWER, READS),
    ("/feedwave.v1.Tools/AdoptToolProposal", ADMIN, CHANGES),
    ("/feedwave.v1.Audit/ListAuditEntries", ADMIN, READS),
    ("/grpc.health.v1.Health/Check", Needs::Nobody, READS),
    ("/grpc.health.v1.Health/Watch", Needs::Nobody, READS),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", Needs::Nobody, READS),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", Needs::Nobody, READS),
];

static BY_PATH: LazyLock<HashMap<&'static str, (Needs, Effect)>> =
    LazyLock::new(|| METHODS.into_iter().map(|(path, needs, effect)| (path, (needs, effect))).collect());

/// What a method needs, and what it does. One that does not exist needs a role as well, so that nobody unknown can look for
/// methods.
pub(crate) fn of_method(path: &str) -> (Needs, Effect) {
    BY_PATH.get(path).copied().unwrap_or((VIEWER, READS))
}

/// What a route needs.
pub(crate) const fn of_route(route: Route) -> Needs {
    match route {
        Route::ListJobs
        | Route::GetJob
        | Route::GetReport
        | Route::ListJobEvents
        | Route::ListRuns
        | Route::GetRun
        | Route::ReadProgram
        | Route::ListStates
        | Route::GetMachineState
        | Route::Follow
        | Route::ListDecisions
        | Route::GetState
        | Route::GetOpenApi
        | Route::GetMetrics => VIEWER,
        Route::ListAuditEntries => ADMIN,
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
        let in_table: BTreeSet<String> = METHODS.iter().map(|(path, ..)| (*path).to_owned()).collect();
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
        assert_eq!(of_method("/feedwave.v1.Jobs/Nothing"), (VIEWER, READS));
    }

    #[test]
    fn what_only_reads_is_called_so() {
        let verbs = [
            "Get",
            "List",
            "Watch",
            "Read",
            "Stream",
            "Replay",
            "Interpret",
            "Compute",
            "Validate",
            "Plan",
            "Check",
            "Improve",
        ];
        for (path, _, effect) in METHODS {
            let name = path.rsplit('/').next().unwrap();
            let reads = verbs.iter().any(|verb| name.starts_with(verb)) || name == "ServerReflectionInfo";
            assert_eq!(effect == READS, reads, "{path}");
        }
    }
}
