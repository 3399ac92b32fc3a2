//! The HTTP port for dashboards, Prometheus, probes and the page, read-only but for what the page calls (`calls`). Bodies are the protobuf JSON mapping of the
//! contract's messages, errors that of `google.rpc.Status`. Every answer under `/v1` but the stream has a strong entity tag, so
//! that polling for what has not changed costs a 304.

mod bounds;
mod calls;
mod live;
mod page;
mod query;

use std::convert::Infallible;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use axum::Router;
use axum::extract::rejection::PathRejection;
use axum::extract::{FromRequestParts, Path, RawQuery, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get};
use bounds::{Bounds, Panicked, bounded};
use feedwave_contract::document::json_path;
use feedwave_contract::proto::{
    GetJobRequest, GetReportRequest, GetRunRequest, JobStateCount, ListAuditEntriesRequest, ListDecisionsRequest,
    ListJobEventsRequest, ListJobsRequest, ListRunsRequest, ListStatesRequest, ReadProgramRequest, ServerState,
};
use feedwave_contract::routes::{ROUTES, Route};
use feedwave_contract::{json, openapi};
use feedwave_store::{JobState, Page};
use futures_util::TryStreamExt as _;
use prometheus::proto::MetricFamily;
use prost::Name;
use prost_types::Timestamp;
use query::Query;
use tower_http::catch_panic::CatchPanicLayer;

use crate::access::{Access, of_route};
use crate::api;
use crate::api::Api;
use crate::audit::{AuditLog, asked};
use crate::conditional::{self, Tagged};
use crate::connections::{App, Connection, in_json};
use crate::error::{Error, Result, Violations};
use crate::floor::Shown;
use crate::observability::metrics::{Metrics, machines, open, text_of};
use crate::observability::{REVISION, VERSION};
use crate::readiness::Readiness;

/// The header with the id of a call.
pub(crate) const REQUEST_ID: &str = "x-request-id";

/// What the handlers work with.
#[derive(Clone, Debug)]
pub struct HttpState {
    /// The services.
    pub api: Api,
    /// Whether the service can do its work.
    pub readiness: Readiness,
    /// Who may do what.
    pub access: Access,
    /// Who was refused.
    pub(crate) audit: AuditLog,
    /// When the service was started.
    pub start_time: Timestamp,
    /// How long a stream of events says nothing at most.
    pub heartbeat: Duration,
}

/// The routes of the port; `calls` answers what the page calls, with bounds and checks of its own.
pub(crate) fn router(state: HttpState, calls: &App) -> Router {
    let bounds = from_fn_with_state(Bounds::new(&state), bounded);
    let panics = CatchPanicLayer::custom(Panicked(state.api.metrics.clone()));
    let routes = ROUTES.iter().fold(Router::new(), |router, entry| {
        let (access, audit) = (state.access.clone(), state.audit.clone());
        let guard = Guard { access, audit, route: entry.route, name: format!("GET {}", entry.path) };
        router.route(entry.path, handler(entry.route).layer(from_fn_with_state(guard, guarded)))
    });
    routes
        .merge(page::routes())
        .fallback(unknown_path)
        .method_not_allowed_fallback(wrong_method)
        .layer(panics)
        .layer(bounds)
        .merge(calls::routes(calls))
        .with_state(state)
}

/// What is around a route.
#[derive(Clone)]
struct Guard {
    access: Access,
    audit: AuditLog,
    route: Route,
    /// What the audit log calls it.
    name: String,
}

/// Answers who has the role that a route needs.
async fn guarded(State(guard): State<Guard>, mut request: Request, next: Next) -> Response {
    let connection = request.extensions().get::<Arc<Connection>>().cloned();
    let needs = of_route(guard.route);
    let named = guard.access.check_host(needs, &request, connection.as_ref());
    let (caller, verdict) = guard.access.authorize(needs, request.headers_mut(), connection.as_ref()).await;
    match named.and(verdict) {
        Ok(()) => {
            request.extensions_mut().insert(caller);
            next.run(request).await
        }
        Err(error) => {
            if matches!(error.code(), tonic::Code::Unauthenticated | tonic::Code::PermissionDenied) {
                let id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok()).unwrap_or_default();
                let asked = asked(&caller, &guard.name, id);
                guard.audit.denied(asked, &caller, &error).await;
            }
            HttpError(error).into_response()
        }
    }
}

/// The services as the caller of a request sees them.
impl FromRequestParts<HttpState> for Api {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, state: &HttpState) -> Result<Self, Infallible> {
        Ok(state.api.called_by(&parts.extensions))
    }
}

fn handler(route: Route) -> MethodRouter<HttpState> {
    match route {
        Route::ListJobs => get(list_jobs),
        Route::GetJob => get(get_job),
        Route::GetReport => get(get_report),
        Route::ListJobEvents => get(list_job_events),
        Route::ListRuns => get(list_runs),
        Route::GetRun => get(get_run),
        Route::ReadProgram => get(read_program),
        Route::ListStates => get(list_states),
        Route::GetMachineState => get(get_machine_state),
        Route::Follow => get(live::follow),
        Route::ListDecisions => get(list_decisions),
        Route::ListAuditEntries => get(list_audit_entries),
        Route::GetState => get(get_state),
        Route::GetOpenApi => get(get_open_api),
        Route::GetMetrics => get(get_metrics),
        Route::GetHealth => get(async || "ok\n"),
        Route::GetReadiness => get(get_ready),
    }
}

/// An error as an answer.
struct HttpError(Error);

/// Fields are called as in JSON here: the services call them as the contract does.
impl<E: Into<Error>> From<E> for HttpError {
    fn from(error: E) -> Self {
        Self(match error.into() {
            Error::Invalid(violations) => Error::Invalid(violations.with_fields(json_path)),
            error => error,
        })
    }
}

impl IntoResponse for HttpError {
    fn into_response(self) -> Response {
        in_json(&self.0)
    }
}

/// A message as an answer, or that it has not changed.
fn message<M: Name>(headers: &HeaderMap, message: &M) -> Response {
    conditional::response(headers, json::to_string(message))
}

type Answer = Result<Response, HttpError>;

async fn list_jobs(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListJobsRequest {
        page_size: query.number("pageSize"),
        page_token: query.text("pageToken"),
        states: query.states("states"),
        machine: query.text("machine"),
        created_from: query.time("createdFrom"),
        created_before: query.time("createdBefore"),
    };
    query.finish()?;
    Ok(message(&headers, &api.list_jobs(request).await?))
}

/// That nothing is asked for behind a question mark: a misspelt or an unknown parameter is refused, as where there are some.
struct NoParameters;

impl<S: Sync> FromRequestParts<S> for NoParameters {
    type Rejection = HttpError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, HttpError> {
        Query::parse(parts.uri.query()).finish()?;
        Ok(Self)
    }
}

/// What a path says in place of an id; an answer in our own words where it is not even text.
type Id = Result<Path<String>, PathRejection>;

/// The name of a resource of a collection.
fn name(collection: &str, id: Id) -> Result<String, HttpError> {
    let mut violations = Violations::default();
    let name = violations.check("name", id).map(|Path(id)| format!("{collection}/{id}"));
    violations.finish()?;
    Ok(name.unwrap_or_default())
}

async fn get_job(api: Api, id: Id, _: NoParameters, headers: HeaderMap) -> Answer {
    let response = api.get_job(GetJobRequest { name: name("jobs", id)? }).await?;
    Ok(message(&headers, &response.job.unwrap_or_default()))
}

async fn get_report(api: Api, id: Id, _: NoParameters, headers: HeaderMap) -> Answer {
    let response = api.get_report(GetReportRequest { job: name("jobs", id)? }).await?;
    Ok(message(&headers, &response.report.unwrap_or_default()))
}

async fn list_job_events(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListJobEventsRequest {
        after: query.number("after"),
        page_size: query.number("pageSize"),
        page_token: query.text("pageToken"),
        job: query.text("job"),
    };
    query.finish()?;
    Ok(message(&headers, &api.list_job_events(request).await?))
}

async fn list_runs(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListRunsRequest {
        job: query.text("job"),
        page_size: query.number("pageSize"),
        page_token: query.text("pageToken"),
    };
    query.finish()?;
    Ok(message(&headers, &api.list_runs(request).await?))
}

async fn get_run(api: Api, id: Id, _: NoParameters, headers: HeaderMap) -> Answer {
    let response = api.get_run(GetRunRequest { name: name("runs", id)? }).await?;
    Ok(message(&headers, &response.run.unwrap_or_default()))
}

async fn list_states(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListStatesRequest { page_size: query.number("pageSize"), page_token: query.text("pageToken") };
    query.finish()?;
    if request != ListStatesRequest::default() {
        return Ok(conditional::response(&headers, page_of_states(&api.list_shown(request)?)));
    }
    let body = api.floor().first_page(|| Ok(Tagged::new(page_of_states(&api.list_shown(request)?))))?;
    Ok(body.response(&headers))
}

/// A `ListStatesResponse` as JSON, put together from the texts of its states, which are written once for all readers.
fn page_of_states(page: &Page<Arc<Shown>>) -> Vec<u8> {
    let mut text = br#"{"states":["#.to_vec();
    for (place, shown) in page.items.iter().enumerate() {
        if place > 0 {
            text.push(b',');
        }
        text.extend_from_slice(shown.json());
    }
    let token = serde_json::Value::from(page.next_token.as_deref().unwrap_or_default());
    text.extend_from_slice(format!(r#"],"nextPageToken":{token}}}"#).as_bytes());
    text
}

async fn get_machine_state(api: Api, id: Id, _: NoParameters, headers: HeaderMap) -> Answer {
    Ok(api.shown(&name("machines", id)?)?.answer().response(&headers))
}

/// Most bytes of a program in one answer.
const MAX_PROGRAM_BYTES: u64 = 4 << 20;

async fn read_program(api: Api, id: Id, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let (offset, length): (u64, u64) = (query.number("offset"), query.number("length"));
    query.finish()?;
    let length = if length == 0 { MAX_PROGRAM_BYTES } else { length.min(MAX_PROGRAM_BYTES) };
    let request = ReadProgramRequest { name: name("programs", id)?, offset, length };
    let pieces: Vec<_> = api.read_program(request).await?.map_ok(|piece| piece.data).try_collect().await?;
    let body = Tagged::of_type(pieces.concat(), HeaderValue::from_static("text/plain"));
    let mut response = body.response(&headers);
    for (name, value) in [
        // Another program has another name.
        (header::CACHE_CONTROL, "private, max-age=86400, immutable"),
        // A program that one client may read another may not.
        (header::VARY, "authorization, x-feedwave-tenant"),
        // Whatever is in it, it is no page.
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    Ok(response)
}

async fn list_decisions(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListDecisionsRequest {
        after: query.number("after"),
        page_size: query.number("pageSize"),
        page_token: query.text("pageToken"),
        job: query.text("job"),
        run: query.text("run"),
    };
    query.finish()?;
    Ok(message(&headers, &api.list_decisions(request).await?))
}

async fn list_audit_entries(api: Api, RawQuery(raw): RawQuery, headers: HeaderMap) -> Answer {
    let mut query = Query::parse(raw.as_deref());
    let request = ListAuditEntriesRequest {
        after: query.number("after"),
        page_size: query.number("pageSize"),
        page_token: query.text("pageToken"),
        principal: query.text("principal"),
        changed_after: query.number_option("changedAfter"),
    };
    query.finish()?;
    Ok(message(&headers, &api.list_audit_entries(request).await?))
}

async fn get_state(State(state): State<HttpState>, api: Api, _: NoParameters, headers: HeaderMap) -> Answer {
    let jobs = api.store.count_jobs().await?;
    let active = active(&api, &jobs);
    let answer = ServerState {
        version: VERSION.to_owned(),
        revision: REVISION.to_owned(),
        start_time: Some(state.start_time),
        draining: api.engine.draining().is_cancelled(),
        jobs: jobs
            .into_iter()
            .map(|(state, count)| JobStateCount { state: api::state_to_proto(state).into(), count })
            .collect(),
        active_streams: active.streams.try_into().unwrap_or(u32::MAX),
        active_validations: active.validations.try_into().unwrap_or(u32::MAX),
        queued_validations: active.queued_validations.try_into().unwrap_or(u32::MAX),
        last_event: api.store.newest_event().await?.unsigned_abs(),
        open_conditions: api.store.count_open_conditions().await?.try_into().unwrap_or(u32::MAX),
        caller: Some(api.caller.described()),
        inline_program_bytes: api.limits.inline_program_bytes,
    };
    Ok(message(&headers, &answer))
}

async fn get_open_api(_: NoParameters, headers: HeaderMap) -> Response {
    static DOCUMENT: LazyLock<Tagged> = LazyLock::new(|| Tagged::new(openapi::document().to_string()));
    DOCUMENT.response(&headers)
}

/// What is being done.
struct Active {
    streams: u64,
    validations: u64,
    queued_validations: u64,
}

/// What is being done for those whom the caller may see, of whose jobs these are.
fn active(api: &Api, jobs: &[(JobState, u64)]) -> Active {
    let of = |wanted| jobs.iter().filter(|(state, _)| *state == wanted).map(|(_, count)| count).sum::<u64>();
    let (pending, validating) = (of(JobState::PendingValidation), of(JobState::Validating));
    match api.caller.confined_to() {
        Some(tenant) => Active {
            streams: api.metrics.streams_by_tenant.of(tenant),
            validations: validating,
            queued_validations: pending,
        },
        None => {
            let count = |gauge: &prometheus::IntGauge| u64::try_from(gauge.get()).unwrap_or(0);
            // A job that is marked as being validated may still wait for its next turn.
            let queued_validations = (pending + validating).saturating_sub(api.engine.jobs_under_way());
            let (streams, validations) = (&api.metrics.active_streams, &api.metrics.active_validations);
            Active { streams: count(streams), validations: count(validations), queued_validations }
        }
    }
}

/// The figures of the process and of all machines, or of the one tenant that the caller may see and of the machines as it
/// sees them.
async fn get_metrics(api: Api, headers: HeaderMap) -> Answer {
    let families = match api.caller.confined_to() {
        Some(_) => figures_of_tenant(&api).await?,
        None => figures_of_process(&api).await,
    };
    let (content_type, text) = if open::is_preferred(&headers) {
        (open::CONTENT_TYPE, open::write(&families))
    } else {
        (prometheus::TEXT_FORMAT, text_of(&families))
    };
    // One path has two forms.
    let headers = [(header::CONTENT_TYPE, content_type), (header::VARY, "accept")];
    Ok((headers, text).into_response())
}

async fn figures_of_tenant(api: &Api) -> Result<Vec<MetricFamily>> {
    let jobs = api.store.count_jobs().await?;
    let active = active(api, &jobs);
    let jobs = jobs.iter().map(|(state, count)| (state.as_str(), *count));
    let open = api.store.count_open_conditions().await?;
    let machines = api.floor().states(None, machines::MAX_MACHINES);
    let machines = machines::gather(machines.iter().map(|shown| &shown.state));
    let Active { streams, validations, queued_validations } = active;
    Ok(Metrics::families_of_tenant(jobs, streams, validations, queued_validations, open, machines))
}

async fn figures_of_process(api: &Api) -> Vec<MetricFamily> {
    let stats = api.store.of_all_tenants().stats();
    api.metrics.store_write_queue.set(stats.write_queue_depth.try_into().unwrap_or(i64::MAX));
    api.metrics.store_bytes.set(stats.database_bytes.try_into().unwrap_or(i64::MAX));
    api.metrics.jobs.reset();
    // Without an answer the other figures are still worth having.
    if let Ok(open) = api.store.count_open_conditions().await {
        api.metrics.open_conditions.set(open.try_into().unwrap_or(i64::MAX));
    }
    let jobs = api.store.count_jobs().await.unwrap_or_default();
    let queued = active(api, &jobs).queued_validations;
    api.metrics.validation_queue.set(queued.try_into().unwrap_or(i64::MAX));
    for (state, count) in jobs {
        api.metrics.jobs.with_label_values(&[state.as_str()]).set(count.try_into().unwrap_or(i64::MAX));
    }
    let machines = api.floors.of_all_tenants(machines::MAX_MACHINES);
    api.metrics.families(machines::gather(machines.iter()))
}

async fn get_ready(State(state): State<HttpState>) -> Answer {
    if state.api.engine.draining().is_cancelled() {
        return Err(Error::Draining.into());
    }
    state.readiness.check()?;
    Ok("ok\n".into_response())
}

async fn unknown_path(request: Request) -> HttpError {
    let name: String = request.uri().path().chars().take(200).collect();
    HttpError(Error::NotFound { kind: "path".to_owned(), name })
}

async fn wrong_method() -> Response {
    let mut response = HttpError(Error::OnlyRead).into_response();
    response.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET,HEAD"));
    response
}
