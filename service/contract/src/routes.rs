//! The routes of the HTTP port that are only read: one table for the router of the service and for the page of reference.

/// What a route is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    /// Jobs, newest first.
    ListJobs,
    /// One job.
    GetJob,
    /// The validation report of a job.
    GetReport,
    /// State changes of jobs.
    ListJobEvents,
    /// Runs.
    ListRuns,
    /// One run, with what it does now.
    GetRun,
    /// Decisions of runs.
    ListDecisions,
    /// The audit log.
    ListAuditEntries,
    /// The bytes of a program.
    ReadProgram,
    /// What machines do now.
    ListStates,
    /// What one machine does now.
    GetMachineState,
    /// States, events and decisions as they happen.
    Follow,
    /// The service about itself.
    GetState,
    /// What this port answers, as a document for machines.
    GetOpenApi,
    /// Figures for Prometheus.
    GetMetrics,
    /// Whether the process lives.
    GetHealth,
    /// Whether requests are welcome.
    GetReadiness,
}

/// What a route answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// A message of the contract, by its name, in its JSON mapping.
    Message(&'static str),
    /// A text.
    Text {
        /// Its media type.
        media_type: &'static str,
        /// What it is, for the page of reference.
        what: &'static str,
    },
    /// JSON that is no message of the contract; what it is.
    Json(&'static str),
}

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RouteEntry {
    /// Which it is.
    pub route: Route,
    /// Its path, with what varies in braces.
    pub path: &'static str,
    /// The request whose fields are the parameters of its query, by their names in JSON; `None` where it has none.
    pub parameters: Option<&'static str>,
    /// What it answers.
    pub body: Body,
    /// What it is for.
    pub purpose: &'static str,
}

const fn messages(
    route: Route,
    path: &'static str,
    parameters: Option<&'static str>,
    answer: &'static str,
    purpose: &'static str,
) -> RouteEntry {
    RouteEntry { route, path, parameters, body: Body::Message(answer), purpose }
}

const fn text(
    route: Route,
    path: &'static str,
    media_type: &'static str,
    what: &'static str,
    purpose: &'static str,
) -> RouteEntry {
    RouteEntry { route, path, parameters: None, body: Body::Text { media_type, what }, purpose }
}

/// Every route; each answers GET and HEAD.
pub const ROUTES: [RouteEntry; 17] = [
    messages(
        Route::ListJobs,
        "/v1/jobs",
        Some("ListJobsRequest"),
        "ListJobsResponse",
        "Jobs, newest first. A state is named with or without `JOB_STATE_`, and `states` may be given more than once.",
    ),
    messages(Route::GetJob, "/v1/jobs/{id}", None, "Job", "The job `jobs/{id}`."),
    messages(
        Route::GetReport,
        "/v1/jobs/{id}/report",
        None,
        "ValidationReport",
        "The validation report of the job `jobs/{id}`.",
    ),
    messages(
        Route::ListJobEvents,
        "/v1/events",
        Some("ListJobEventsRequest"),
        "ListJobEventsResponse",
        "State changes of jobs, oldest first.",
    ),
    messages(Route::ListRuns, "/v1/runs", Some("ListRunsRequest"), "ListRunsResponse", "Runs, newest first."),
    messages(Route::GetRun, "/v1/runs/{id}", None, "Run", "The run `runs/{id}`, with what it does now."),
    messages(
        Route::ListDecisions,
        "/v1/decisions",
        Some("ListDecisionsRequest"),
        "ListDecisionsResponse",
        "Decisions of runs, oldest first.",
    ),
    messages(
        Route::ListAuditEntries,
        "/v1/audit",
        Some("ListAuditEntriesRequest"),
        "ListAuditEntriesResponse",
        "The audit log, oldest first. Needs the role admin.",
    ),
    messages(
        Route::ListStates,
        "/v1/machines",
        Some("ListStatesRequest"),
        "ListStatesResponse",
        "What machines do now, in the order of their names.",
    ),
    messages(
        Route::GetMachineState,
        "/v1/machines/{id}/state",
        None,
        "MachineState",
        "What the machine `machines/{id}` does now.",
    ),
    text(
        Route::Follow,
        "/v1/stream",
        "text/event-stream",
        "`text/event-stream`",
        "What happens, as server-sent events whose data is a message as JSON: `state` (MachineState; at first of every \
         machine, then of each that changes, twice a second at most), `gone` (of a machine that was deleted, its name), \
         `job` (JobEvent), `decision` (Decision). An `id` names the store, the tenant and the records of both logs \
         that were told last; `Last-Event-ID` goes on behind it, and where it is of another store, too far behind or from before \
         records that were removed, `reset` says that the lists are to be read anew. A comment comes where there is nothing to say for `http.heartbeat_s`.",
    ),
    RouteEntry {
        parameters: Some("ReadProgramRequest"),
        ..text(
            Route::ReadProgram,
            "/v1/programs/{id}",
            "text/plain",
            "`text/plain`",
            "The bytes of the program `programs/{id}`; never more than 4 MiB.",
        )
    },
    messages(Route::GetState, "/v1/state", None, "ServerState", "The service about itself."),
    RouteEntry {
        route: Route::GetOpenApi,
        path: "/v1/openapi.json",
        parameters: None,
        body: Body::Json("an OpenAPI 3.1 document"),
        purpose: "This table with the schemas of all answers, for generators of clients.",
    },
    text(
        Route::GetMetrics,
        "/metrics",
        "text/plain",
        "Prometheus text format",
        "Figures of the service and of machines; OpenMetrics where `Accept` prefers it.",
    ),
    text(Route::GetHealth, "/healthz", "text/plain", "`ok`", "Whether the process lives."),
    text(
        Route::GetReadiness,
        "/readyz",
        "text/plain",
        "`ok`",
        "Whether requests are welcome: 503 while the service drains or cannot reach its store.",
    ),
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::proto::DESCRIPTORS;

    #[test]
    fn every_message_of_the_table_is_of_the_contract_and_every_path_there_once() {
        let known = |name: &str| DESCRIPTORS.get_message_by_name(&format!("feedwave.v1.{name}")).is_some();
        let mut paths = BTreeSet::new();
        for entry in &ROUTES {
            assert!(paths.insert(entry.path), "{} twice", entry.path);
            assert!(entry.parameters.is_none_or(known), "{entry:?}");
            if let Body::Message(name) = entry.body {
                assert!(known(name), "{entry:?}");
            }
        }
    }
}
