//! The shop floor with tenants: machines are everybody's, and a run is shown to its tenant alone, wherever runs are shown.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::jobs_client::JobsClient;
use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    CreateJobRequest, CreateMachineRequest, Execution, GetMachineRequest, GetRunRequest, GetStateRequest, JobState,
    ListStatesRequest, MachineState, SetMonitoringRequest, UpdateMachineRequest, WatchJobsRequest, WatchStateRequest,
};
use feedwave_tests::{Answer, Home, Server, Web, patiently};
use http::StatusCode;
use serde_json::Value;
use tonic::Code;

use crate::FEEDWAVE;
use crate::live_runs::{PART, config};
use crate::mtconnect::observed;
use crate::shop_floor::{Live, in_tenant};
use crate::status::assert_error;

const NAME: &str = "Secret shaft of north";

/// A job of a tenant that can be run: its name, and that of its program.
async fn job_in(server: &Server, tenant: &str) -> (String, String) {
    let channel = server.connect().await.channel;
    let mut jobs = JobsClient::new(channel.clone());
    let request = CreateJobRequest {
        machine: "machines/lathe".to_owned(),
        display_name: NAME.to_owned(),
        source: Some(Source::InlineProgram(Bytes::from_static(PART.as_bytes()))),
        ..CreateJobRequest::default()
    };
    let job = jobs.create_job(in_tenant(request, tenant)).await.unwrap().into_inner().job.unwrap();
    let request = WatchJobsRequest { after: Some(0), job: job.name.clone() };
    let mut events = jobs.watch_jobs(in_tenant(request, tenant)).await.unwrap().into_inner();
    while patiently(events.message()).await.unwrap().unwrap().event.unwrap().state() != JobState::Ready {}
    let request = SetMonitoringRequest { job: job.name.clone(), config: Some(config()) };
    TelemetryClient::new(channel).set_monitoring(in_tenant(request, tenant)).await.unwrap();
    (job.name, job.program)
}

async fn get(web: &Web, path: &str, tenant: &str) -> Answer {
    let named = [("x-feedwave-tenant", tenant)];
    web.send("GET", path, if tenant.is_empty() { &[] } else { &named }, Bytes::new()).await
}

/// The lathe as a tenant sees it.
async fn lathe(web: &Web, tenant: &str) -> Value {
    get(web, "/v1/machines/lathe/state", tenant).await.json()
}

/// Waits until the run is seen where it may be.
async fn until(web: &Web, tenant: &str, execution: &str) -> Value {
    let seen = async {
        loop {
            let state = lathe(web, tenant).await;
            if state["execution"] == execution {
                return state;
            }
        }
    };
    patiently(seen).await
}

// One run, and every place where another tenant might see it.
#[tokio::test]
async fn another_tenants_run_is_seen_nowhere() {
    let server = Server::start(FEEDWAVE).await;
    let web = server.web();
    let mut machines = MachinesClient::new(server.connect().await.channel);
    // Who looks before the run begins must not hear of it either.
    let watch = WatchStateRequest { name: "machines/lathe".to_owned() };
    let mut watch = machines.watch_state(in_tenant(watch, "south")).await.unwrap().into_inner();
    let mut stream = web.open("/v1/stream", &[("x-feedwave-tenant", "south")]).await;
    let mut default = web.open("/v1/stream", &[]).await;

    let (job, program) = job_in(&server, "north").await;
    let mut live = Live::open_in(&server, "north", Target::Job(job.clone()), 0).await;
    live.reach(600).await;
    live.take(500).await;
    live.measure(0..25).await;
    let seen = until(&web, "north", "EXECUTION_RUNNING").await;
    assert_eq!((&seen["run"]["run"], &seen["run"]["jobDisplayName"]), (&live.run.clone().into(), &NAME.into()));
    let secrets = [NAME, &job[5..], &live.run[5..], &program[9..]];

    for other in ["south", ""] {
        for path in ["/v1/machines", "/v1/machines/lathe/state", "/v1/runs", "/v1/jobs", "/v1/decisions", "/v1/events"]
        {
            let answer = get(&web, path, other).await;
            assert!(matches!(answer.status, StatusCode::OK | StatusCode::NOT_FOUND), "{path}: {answer:?}");
            for secret in secrets {
                assert!(!answer.text().contains(secret), "{path} shows {secret}: {}", answer.text());
            }
        }
        assert_eq!(lathe(&web, other).await["execution"], "EXECUTION_IDLE");
        for path in [format!("/v1/{}", live.run), format!("/v1/{job}"), format!("/v1/{program}")] {
            assert_eq!(get(&web, &path, other).await.status, StatusCode::NOT_FOUND, "{path}");
        }
        let request = GetStateRequest { name: "machines/lathe".to_owned() };
        let state = machines.get_state(in_tenant(request, other)).await.unwrap().into_inner().state.unwrap();
        assert_idle(&state);
        let list = machines.list_states(in_tenant(ListStatesRequest::default(), other)).await.unwrap();
        list.into_inner().states.iter().for_each(assert_idle);
        let mut telemetry = TelemetryClient::new(server.connect().await.channel);
        let request = GetRunRequest { name: live.run.clone() };
        let status = telemetry.get_run(in_tenant(request, other)).await.unwrap_err();
        assert_error(&status, Code::NotFound, "RESOURCE_NOT_FOUND");
    }
    figures(&web).await;

    // A change that everybody sees: what came before it is all that there was to see.
    rename(&mut machines, "Turning centre").await;
    let mut seen = patiently(watch.message()).await.unwrap().unwrap().state.unwrap();
    while seen.display_name != "Turning centre" {
        assert_idle(&seen);
        seen = patiently(watch.message()).await.unwrap().unwrap().state.unwrap();
    }
    assert_idle(&seen);
    for stream in [&mut stream, &mut default] {
        loop {
            let event = patiently(stream.next_event()).await.expect("the stream goes on");
            let text = event.data.to_string();
            assert!(matches!(event.event.as_str(), "" | "state"), "{event:?}");
            assert!(secrets.iter().all(|secret| !text.contains(secret)), "{text}");
            if event.data["displayName"] == "Turning centre" {
                assert_eq!(event.data["execution"], "EXECUTION_IDLE");
                break;
            }
        }
    }

    // The log has it as it was.
    drop(live);
    let server = server.kill().await.start().await;
    let web = server.web();
    assert_eq!(lathe(&web, "north").await["execution"], "EXECUTION_INTERRUPTED");
    for other in ["south", ""] {
        assert_eq!(lathe(&web, other).await["execution"], "EXECUTION_IDLE");
    }
}

fn assert_idle(state: &MachineState) {
    assert_eq!((state.execution(), &state.run, state.conditions.len()), (Execution::Idle, &None, 0), "{state:?}");
}

async fn rename(machines: &mut MachinesClient<tonic::transport::Channel>, name: &str) {
    let request = GetMachineRequest { name: "machines/lathe".to_owned() };
    let mut machine = machines.get_machine(request).await.unwrap().into_inner().machine.unwrap();
    name.clone_into(&mut machine.display_name);
    let update = UpdateMachineRequest { machine: Some(machine), ..UpdateMachineRequest::default() };
    machines.update_machine(update).await.unwrap();
}

/// Who asks for a tenant has its figures, who may see all those of all.
async fn figures(web: &Web) {
    let running = "feedwave_machine_state{machine=\"lathe\",state=\"running\"}";
    let progress = "feedwave_machine_progress_ratio{machine=\"lathe\"}";
    for (tenant, expected) in [("north", true), ("", true), ("south", false)] {
        let figures = get(web, "/metrics", tenant).await;
        let line = format!("{running} {}", u8::from(expected));
        assert!(figures.text().lines().any(|shown| shown == line), "{tenant}: {}", figures.text());
        assert_eq!(figures.text().contains(progress), expected, "{tenant}");
    }
}

#[tokio::test]
async fn the_mtconnect_agent_shows_the_runs_of_one_tenant() {
    for (tenant, execution) in [("north", "ACTIVE"), ("south", "UNAVAILABLE"), ("", "UNAVAILABLE")] {
        let config = format!("[mtconnect]\nlisten = '127.0.0.1:0'\ntenant = '{tenant}'\n");
        let server = Home::new(FEEDWAVE, &config).start().await;
        let agent = Web::new(server.mtconnect.expect("an agent"));
        let (job, _) = job_in(&server, "north").await;
        let mut live = Live::open_in(&server, "north", Target::Job(job), 0).await;
        live.reach(600).await;
        live.take(500).await;
        until(&server.web(), "north", "EXECUTION_RUNNING").await;
        let mut machines = MachinesClient::new(server.connect().await.channel);
        let shown = async {
            loop {
                let current = agent.get("/current?format=json").await.json();
                if observed(&current, "lathe_exec") == [execution] {
                    return current;
                }
            }
        };
        let current = patiently(shown).await;
        assert_eq!(current.to_string().contains(NAME), execution == "ACTIVE", "{current}");
        // Another machine: once it is there, the agent has read all that came before.
        let request = GetMachineRequest { name: "machines/lathe".to_owned() };
        let machine = machines.get_machine(request).await.unwrap().into_inner().machine;
        let create = CreateMachineRequest { machine_id: "saw".to_owned(), machine };
        machines.create_machine(create).await.unwrap();
        patiently(async { while !agent.get("/probe").await.text().contains("feedwave.saw") {} }).await;
        let all = agent.get("/sample?count=10000&format=json").await.json();
        assert_eq!(all.to_string().contains(NAME), execution == "ACTIVE", "{all}");
    }
}
