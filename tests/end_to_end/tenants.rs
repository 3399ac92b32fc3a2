//! Tenants: nothing of one is shown to another, and the same program of two is told to neither.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::interpret_request::{On, Source as InterpretSource};
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    CancelJobRequest, CreateJobRequest, DeleteJobRequest, GetJobRequest, GetMonitoringRequest, GetPlanSummaryRequest,
    GetProgramRequest, GetReportRequest, GetUploadRequest, InterpretRequest, Job, JobState, ListDecisionsRequest,
    ListJobEventsRequest, ListJobsRequest, ListProgramsRequest, ListRunsRequest, ListUploadsRequest, ProgramFile,
    ProgramsDeleteProgramRequest, ReadProgramRequest, SetMonitoringRequest, StreamSetpointsRequest,
    UploadProgramRequest, WatchJobsRequest, program_file,
};
use feedwave_tests::{Clients, Home, Server, patiently, sha256_hex, upload_messages};
use tonic::{Code, Request, Status};

use crate::FEEDWAVE;
use crate::access::{bearer, feedwave, token};
use crate::live_runs::config;
use crate::status::assert_error;

const PROGRAM: &[u8] = b"G21 G94 G97 S1000 M3\nG0 X30. Z2.\nG1 Z-20. F200\nM30\n";

/// A client with its token.
struct Member {
    token: String,
    clients: Clients,
}

impl Member {
    async fn new(server: &Server, token: &str) -> Self {
        Self { token: token.to_owned(), clients: server.connect().await }
    }

    fn says<T>(&self, message: T) -> Request<T> {
        bearer(message, &self.token)
    }

    fn programs(&self) -> ProgramsClient<tonic::transport::Channel> {
        ProgramsClient::new(self.clients.channel.clone())
    }

    fn telemetry(&self) -> TelemetryClient<tonic::transport::Channel> {
        TelemetryClient::new(self.clients.channel.clone())
    }

    /// How much of the program the service says that it has, and whether all of it.
    async fn received(&mut self) -> (u64, bool) {
        let request = self.says(GetUploadRequest { program: program() });
        let upload = self.clients.jobs.get_upload(request).await.unwrap().into_inner();
        (upload.received_bytes, upload.complete)
    }

    async fn upload(&mut self, messages: Vec<UploadProgramRequest>) -> Result<u64, Status> {
        let request = self.says(tokio_stream::iter(messages));
        Ok(self.clients.jobs.upload_program(request).await?.into_inner().received_bytes)
    }

    async fn create(&mut self, request_id: &str) -> Result<Job, Status> {
        let request = CreateJobRequest {
            machine: "machines/lathe".to_owned(),
            request_id: request_id.to_owned(),
            source: Some(Source::Program(program())),
            ..CreateJobRequest::default()
        };
        let request = self.says(request);
        Ok(self.clients.jobs.create_job(request).await?.into_inner().job.unwrap())
    }

    async fn is_ready(&mut self, job: &str) {
        patiently(async {
            loop {
                let request = self.says(GetJobRequest { name: job.to_owned() });
                let job = self.clients.jobs.get_job(request).await.unwrap().into_inner().job.unwrap();
                match job.state() {
                    JobState::Ready => return,
                    JobState::Rejected | JobState::Failed => panic!("{job:?}"),
                    _ => tokio::task::yield_now().await,
                }
            }
        })
        .await;
    }

    /// What lists show, by their lengths: jobs, events, runs, decisions, programs, uploads.
    async fn listed(&mut self) -> [usize; 6] {
        let jobs = self.clients.jobs.list_jobs(self.says(ListJobsRequest::default())).await.unwrap().into_inner().jobs;
        let request = self.says(ListJobEventsRequest::default());
        let events = self.clients.jobs.list_job_events(request).await.unwrap().into_inner().events;
        let runs = self.telemetry().list_runs(self.says(ListRunsRequest::default())).await.unwrap().into_inner().runs;
        let request = self.says(ListDecisionsRequest::default());
        let decisions = self.telemetry().list_decisions(request).await.unwrap().into_inner().decisions;
        let request = self.says(ListProgramsRequest::default());
        let programs = self.programs().list_programs(request).await.unwrap().into_inner().programs;
        let request = self.says(ListUploadsRequest::default());
        let uploads = self.programs().list_uploads(request).await.unwrap().into_inner().uploads;
        [jobs.len(), events.len(), runs.len(), decisions.len(), programs.len(), uploads.len()]
    }
}

fn program() -> String {
    format!("programs/{}", sha256_hex(PROGRAM))
}

/// Everything that a client can ask about a job or a program, and how each of it is refused.
async fn refusals(of: &mut Member, job: &str, program: &str) -> Vec<Status> {
    let name = || job.to_owned();
    let mut refused = Vec::new();
    let jobs = &mut of.clients.jobs.clone();
    refused.push(jobs.get_job(of.says(GetJobRequest { name: name() })).await.unwrap_err());
    refused.push(jobs.get_report(of.says(GetReportRequest { job: name() })).await.unwrap_err());
    refused.push(jobs.cancel_job(of.says(CancelJobRequest { name: name() })).await.unwrap_err());
    let delete = DeleteJobRequest { name: name(), ..DeleteJobRequest::default() };
    refused.push(jobs.delete_job(of.says(delete)).await.unwrap_err());
    let setpoints = &mut of.clients.setpoints.clone();
    refused.push(setpoints.get_plan_summary(of.says(GetPlanSummaryRequest { job: name() })).await.unwrap_err());
    let stream = StreamSetpointsRequest { job: name(), ..StreamSetpointsRequest::default() };
    refused.push(setpoints.stream_setpoints(of.says(stream)).await.unwrap_err());
    let set = SetMonitoringRequest { job: name(), config: Some(config()) };
    refused.push(of.telemetry().set_monitoring(of.says(set)).await.unwrap_err());
    refused.push(of.telemetry().get_monitoring(of.says(GetMonitoringRequest { job: name() })).await.unwrap_err());
    let interpret = |source| InterpretRequest { source: Some(source), ..InterpretRequest::default() };
    let of_job = interpret(InterpretSource::Job(name()));
    refused.push(of.programs().interpret(of.says(of_job)).await.unwrap_err());
    let program = || program.to_owned();
    let on = Some(On::Machine("machines/lathe".to_owned()));
    let stored = InterpretRequest { on: on.clone(), ..interpret(InterpretSource::Program(program())) };
    refused.push(of.programs().interpret(of.says(stored)).await.unwrap_err());
    let source = Some(program_file::Source::Program(program()));
    let further = ProgramFile { name: "sub.nc".to_owned(), source };
    let inline = interpret(InterpretSource::InlineProgram(Bytes::from_static(b"M30\n")));
    let calling = InterpretRequest { on, programs: vec![further], ..inline };
    refused.push(of.programs().interpret(of.says(calling)).await.unwrap_err());
    refused.push(of.programs().get_program(of.says(GetProgramRequest { name: program() })).await.unwrap_err());
    let read = ReadProgramRequest { name: program(), ..ReadProgramRequest::default() };
    refused.push(of.programs().read_program(of.says(read)).await.unwrap_err());
    refused.push(
        of.programs().delete_program(of.says(ProgramsDeleteProgramRequest { name: program() })).await.unwrap_err(),
    );
    let create = CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        source: Some(Source::Program(program())),
        ..CreateJobRequest::default()
    };
    refused.push(jobs.create_job(of.says(create)).await.unwrap_err());
    refused
}

// One history, looked at by the others after each of its steps.
#[tokio::test]
async fn nothing_of_a_tenant_is_shown_to_another() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clients.toml");
    let of = async |name, more: &[&str]| token(&file, name, more).await;
    let token_a =
        of("planner of a", &["--role", "planner", "--role", "machine", "--machine", "*", "--tenant", "a"]).await;
    let token_b = of("planner of b", &["--role", "planner", "--tenant", "b"]).await;
    let token_none = of("planner", &["--role", "planner"]).await;
    let admin_b = of("admin of b", &["--role", "admin", "--tenant", "b"]).await;
    let operator = of("operator", &["--role", "admin", "--tenant", "*"]).await;
    let server = Home::new(FEEDWAVE, &format!("[auth]\nclients = '{}'", file.display())).start().await;
    let mut a = Member::new(&server, &token_a).await;
    let mut others = [Member::new(&server, &token_b).await, Member::new(&server, &token_none).await];

    // Half a program, the whole of it, a job, a run.
    let bytes = Bytes::from_static(PROGRAM);
    let messages = upload_messages(&bytes, 0, 8);
    a.upload(messages[..3].to_vec()).await.unwrap();
    assert_eq!(a.received().await, (16, false));
    for other in &mut others {
        assert_eq!(other.received().await, (0, false));
        assert_eq!(other.listed().await, [0; 6]);
    }
    a.upload(upload_messages(&bytes, 16, 8)).await.unwrap();
    let job = a.create("the-same").await.unwrap();
    a.is_ready(&job.name).await;
    assert_eq!(job.owner, "planner of a");
    let request = a.says(SetMonitoringRequest { job: job.name.clone(), config: Some(config()) });
    a.telemetry().set_monitoring(request).await.unwrap();

    // To another tenant all of it is as if it had never been.
    let never = "jobs/01900000-0000-7000-8000-000000000000";
    let unknown = format!("programs/{}", sha256_hex(b"never uploaded"));
    for other in &mut others {
        assert_eq!(other.listed().await, [0; 6]);
        let of_a = refusals(other, &job.name, &program()).await;
        let of_nobody = refusals(other, never, &unknown).await;
        for (of_a, of_nobody) in of_a.iter().zip(&of_nobody) {
            assert_error(of_a, Code::NotFound, "RESOURCE_NOT_FOUND");
            let told = of_nobody.message().replace(never, &job.name).replace(&unknown, &program());
            assert_eq!(of_a.message(), told.replace(&unknown[9..], &program()[9..]));
        }
        // A header alone would be answered at once if the program were known.
        let header = upload_messages(&bytes, 0, 8)[..1].to_vec();
        assert_eq!(other.upload(header).await.unwrap(), 0);
        assert_eq!(other.upload(upload_messages(&bytes, 0, 8)).await.unwrap(), PROGRAM.len() as u64);
        let own = other.create("the-same").await.unwrap();
        assert_ne!(own.name, job.name);
        assert_eq!(other.listed().await[0], 1);
        let entry = other.programs().get_program(other.says(GetProgramRequest { name: program() })).await.unwrap();
        assert_eq!(entry.into_inner().program.unwrap().job_count, 1);
    }
    assert_eq!(a.listed().await[0], 1);

    // Who watches everything from the beginning hears of the own job alone.
    let watch = WatchJobsRequest { after: Some(0), job: String::new() };
    let request = others[0].says(watch);
    let mut events = others[0].clients.jobs.watch_jobs(request).await.unwrap().into_inner();
    let first = events.message().await.unwrap().unwrap().event.unwrap();
    assert_ne!(first.job, job.name);

    // Deleting the own copy leaves the other's.
    let request = others[1].says(ListJobsRequest::default());
    let own = others[1].clients.jobs.list_jobs(request).await.unwrap().into_inner().jobs.remove(0);
    let request = others[1].says(DeleteJobRequest { name: own.name, ..DeleteJobRequest::default() });
    others[1].clients.jobs.delete_job(request).await.unwrap();
    let request = others[1].says(ProgramsDeleteProgramRequest { name: program() });
    others[1].clients.programs.delete_program(request).await.unwrap();
    assert_eq!(a.received().await, (PROGRAM.len() as u64, true));

    figures_and_operators(&server, &mut a, &job, [&token_b, &admin_b, &operator]).await;
    let admin = of("admin", &["--role", "admin"]).await;
    let server = server.kill().await.start().await;
    let mut a = Member::new(&server, &token_a).await;
    assert_eq!(a.listed().await[0], 1);
    assert_eq!(Member::new(&server, &token_none).await.listed().await[0], 0);

    // A file that names no tenant any more does not make records of tenants everybody's.
    let home = server.kill().await;
    let text = std::fs::read_to_string(&file).unwrap();
    let kept: Vec<_> = text.split("\n[[client]]").filter(|client| !client.contains("tenant = ")).collect();
    std::fs::write(&file, kept.join("\n[[client]]")).unwrap();
    let server = home.start().await;
    let value = format!("Bearer {admin}");
    let headers = [("authorization", value.as_str())];
    let log = server.web().send("GET", "/v1/audit?pageSize=1000", &headers, Bytes::new()).await;
    assert!(log.status.is_success() && !log.text().contains("planner of a"), "{}", log.text());
    assert!(log.text().contains("\"planner\""), "{}", log.text());
    let state = server.web().send("GET", "/v1/state", &headers, Bytes::new()).await.json();
    assert_eq!(state["caller"]["hasTenants"], true, "{state}");
}

/// Figures, the audit log, and clients that act for any tenant.
async fn figures_and_operators(server: &Server, a: &mut Member, job: &Job, [b, admin_b, operator]: [&String; 3]) {
    let web = server.web();
    let get = async |path: &str, token: &str, tenant: Option<&str>| {
        let value = format!("Bearer {token}");
        let mut headers = vec![("authorization", value.as_str())];
        headers.extend(tenant.map(|tenant| ("x-feedwave-tenant", tenant)));
        web.send("GET", path, &headers, Bytes::new()).await
    };
    let figures = get("/metrics", b, None).await;
    let figures = figures.text();
    let jobs: f64 = figures
        .lines()
        .filter(|line| line.starts_with("feedwave_jobs{"))
        .map(|line| line.rsplit(' ').next().unwrap().parse::<f64>().unwrap())
        .sum();
    assert!(jobs == 1.0 && !figures.contains("feedwave_grpc_requests_total"), "{figures}");
    assert!(get("/metrics", operator, None).await.text().contains("feedwave_grpc_requests_total"));
    let count = |state: &serde_json::Value| -> u64 {
        let jobs = state["jobs"].as_array().cloned().unwrap_or_default();
        jobs.iter().map(|job| job["count"].as_str().unwrap().parse::<u64>().unwrap()).sum()
    };
    assert_eq!(count(&get("/v1/state", b, None).await.json()), 1);
    assert_eq!(count(&get("/v1/state", operator, None).await.json()), 2);
    let path = format!("/v1/{}", job.name);
    assert_eq!(get(&path, b, None).await.status, 404);
    assert_eq!(get(&format!("{path}/report"), b, None).await.status, 404);

    // An admin sees what was asked for in its own tenant, an operator all of it or that of one.
    let tenants_in = |answer: &feedwave_tests::Answer| {
        let entries = answer.json()["entries"].as_array().cloned().unwrap_or_default();
        let mut tenants: Vec<String> =
            entries.iter().map(|entry| entry["tenant"].as_str().unwrap_or_default().to_owned()).collect();
        tenants.sort();
        tenants.dedup();
        tenants
    };
    assert_eq!(tenants_in(&get("/v1/audit?pageSize=500", admin_b, None).await), ["b"]);
    assert_eq!(tenants_in(&get("/v1/audit?pageSize=500", operator, None).await), ["", "a", "b"]);
    assert_eq!(tenants_in(&get("/v1/audit?pageSize=500", operator, Some("a")).await), ["a"]);

    // An operator acts in the tenant that it names, and others in their own alone.
    assert_eq!(get(&path, operator, None).await.status, 404);
    assert_eq!(get(&path, operator, Some("a")).await.status, 200);
    assert_eq!(get(&path, operator, Some("A!")).await.status, 400);
    assert_eq!(get(&path, &a.token, Some("a")).await.status, 200);
    let refused = get(&path, b, Some("a")).await;
    assert_eq!((refused.status.as_u16(), refused.text().contains("TENANT_DENIED")), (403, true));
    let url = format!("http://{}", server.grpc);
    let shown = ["job", "get", job.name.as_str(), "--server", url.as_str(), "--tenant", "a", "--format", "json"];
    let shown = feedwave(&shown, &[("FEEDWAVE_TOKEN", operator.as_str())]).await;
    assert!(shown.status.success(), "{shown:?}");
    assert!(String::from_utf8_lossy(&shown.stdout).contains("planner of a"));
    let mut refused = a.says(GetJobRequest { name: job.name.clone() });
    refused.metadata_mut().insert("x-feedwave-tenant", "b".parse().unwrap());
    let status = a.clients.jobs.get_job(refused).await.unwrap_err();
    assert_error(&status, Code::PermissionDenied, "TENANT_DENIED");
}
