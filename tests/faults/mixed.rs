//! Everything at once: jobs, uploads, tools, telemetry and readers, and `kill -9` at random moments, with a ledger of what was
//! acknowledged. `FEEDWAVE_MIXED_KILLS` says how often.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use feedwave_contract::proto::audit_client::AuditClient;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::{
    CreateToolRequest, DeleteJobRequest, DeleteToolRequest, GetJobRequest, GetProgramRequest, GetToolRequest,
    ListAuditEntriesRequest, ListJobEventsRequest, ListJobsRequest, Tool, UpdateToolRequest,
};
use feedwave_tests::{Chance, Clients, Home, Server, upload};
use tokio::sync::Notify;
use tokio::task::JoinSet;
use tonic::{Code, Status};

use crate::FEEDWAVE;

/// Kills where nothing else is asked for; `tests/faults/long.sh` asks for more.
const KILLS: u64 = 2;
/// Clients of each kind.
const OF_EACH: u64 = 2;

/// What was acknowledged about one record last.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Known {
    /// It is there, and says this.
    Is(String),
    /// It is gone.
    Gone,
    /// A change of it was asked for and not answered: it may be either.
    OneOf(Box<Known>, Box<Known>),
}

/// By the names of records.
type Ledger = BTreeMap<String, Known>;

/// What all clients of a round share.
struct Round {
    /// Numbers that no record has had.
    next: AtomicU64,
    /// Calls that were answered.
    answered: AtomicU64,
    kill_at: u64,
    enough: Notify,
}

impl Round {
    fn number(&self) -> u64 {
        self.next.fetch_add(1, Ordering::Relaxed)
    }

    fn answered(&self) {
        if self.answered.fetch_add(1, Ordering::Relaxed) + 1 == self.kill_at {
            self.enough.notify_one();
        }
    }
}

/// Notes what came of a change from one state of a record to another; whether to go on.
fn note<T>(ledger: &mut Ledger, name: &str, after: Known, answer: &Result<T, Status>, round: &Round) -> bool {
    match answer {
        Ok(_) => {
            ledger.insert(name.to_owned(), after);
            round.answered();
            true
        }
        Err(_) => {
            let before = ledger.remove(name).unwrap_or(Known::Gone);
            ledger.insert(name.to_owned(), Known::OneOf(Box::new(before), Box::new(after)));
            false
        }
    }
}

/// Creates jobs, and deletes some of them.
async fn jobs(mut clients: Clients, round: Arc<Round>) -> Ledger {
    let mut ledger = Ledger::new();
    loop {
        let number = round.number();
        let source = Source::InlineProgram(Bytes::from(format!("G0 X{number}.\nM30\n")));
        // Without an answer its name is not known: nothing can be said about it.
        let Ok(job) = clients.create_from(source, &format!("mixed-{number}")).await else { return ledger };
        ledger.insert(job.name.clone(), Known::Is(job.program));
        round.answered();
        if number.is_multiple_of(3) {
            let request = DeleteJobRequest { name: job.name.clone(), ..DeleteJobRequest::default() };
            let answer = clients.jobs.delete_job(request).await;
            if !note(&mut ledger, &job.name, Known::Gone, &answer, &round) {
                return ledger;
            }
        }
    }
}

/// Uploads programs in pieces.
async fn uploads(mut clients: Clients, round: Arc<Round>) -> Ledger {
    let mut ledger = Ledger::new();
    loop {
        let number = round.number();
        let program = Bytes::from(format!("(program {number})\nG1 X{number}. F100\n").repeat(20_000));
        let Ok(name) = upload(&mut clients, &program).await else { return ledger };
        ledger.insert(name, Known::Is(program.len().to_string()));
        round.answered();
    }
}

/// Makes tools, changes them and deletes some.
async fn tools(mut clients: Clients, round: Arc<Round>) -> Ledger {
    let mut ledger = Ledger::new();
    loop {
        let number = round.number();
        let (id, name) = (format!("t{number}"), format!("tools/t{number}"));
        let tool = |display_name: &str| Tool {
            name: name.clone(),
            display_name: display_name.to_owned(),
            number: u32::try_from(number % 1_000).unwrap_or(0) + 1,
            ..Tool::default()
        };
        let request = CreateToolRequest { tool_id: id, tool: Some(tool("first")) };
        let answer = clients.tools.create_tool(request).await;
        if !note(&mut ledger, &name, Known::Is("first".to_owned()), &answer, &round) {
            return ledger;
        }
        let request = UpdateToolRequest { tool: Some(tool("second")), ..UpdateToolRequest::default() };
        let answer = clients.tools.update_tool(request).await;
        if !note(&mut ledger, &name, Known::Is("second".to_owned()), &answer, &round) {
            return ledger;
        }
        if number.is_multiple_of(2) {
            let request = DeleteToolRequest { name: name.clone(), ..DeleteToolRequest::default() };
            let answer = clients.tools.delete_tool(request).await;
            if !note(&mut ledger, &name, Known::Gone, &answer, &round) {
                return ledger;
            }
        }
    }
}

/// Reads what there is, so that writes are not alone.
async fn readers(mut clients: Clients) -> Ledger {
    loop {
        let jobs = clients.jobs.list_jobs(ListJobsRequest { page_size: 500, ..ListJobsRequest::default() }).await;
        let events = clients.jobs.list_job_events(ListJobEventsRequest::default()).await;
        if jobs.is_err() || events.is_err() {
            return Ledger::new();
        }
    }
}

/// Works with all clients until so many calls are answered, and kills the service.
async fn work(server: Server, first_number: u64, kill_at: u64) -> (Ledger, Home) {
    let round = Arc::new(Round {
        next: AtomicU64::new(first_number),
        answered: AtomicU64::new(0),
        kill_at,
        enough: Notify::new(),
    });
    let mut all = JoinSet::new();
    for _ in 0..OF_EACH {
        all.spawn(jobs(server.connect().await, round.clone()));
        all.spawn(uploads(server.connect().await, round.clone()));
        all.spawn(tools(server.connect().await, round.clone()));
        all.spawn(readers(server.connect().await));
    }
    round.enough.notified().await;
    let home = server.kill().await;
    (all.join_all().await.into_iter().flatten().collect(), home)
}

/// What the service says of a record now.
async fn now(clients: &mut Clients, name: &str) -> Known {
    let found = match name.split('/').next() {
        Some("jobs") => {
            let answer = clients.jobs.get_job(GetJobRequest { name: name.to_owned() }).await;
            answer.map(|job| job.into_inner().job.expect("a job").program)
        }
        Some("programs") => {
            let mut programs = ProgramsClient::new(clients.channel.clone());
            let answer = programs.get_program(GetProgramRequest { name: name.to_owned() }).await;
            answer.map(|program| program.into_inner().program.expect("a program").size_bytes.to_string())
        }
        _ => {
            let answer = clients.tools.get_tool(GetToolRequest { name: name.to_owned() }).await;
            answer.map(|tool| tool.into_inner().tool.expect("a tool").display_name)
        }
    };
    match found {
        Ok(text) => Known::Is(text),
        Err(status) if status.code() == Code::NotFound => Known::Gone,
        Err(status) => panic!("{name}: {status:?}"),
    }
}

fn fits(known: &Known, now: &Known) -> bool {
    match known {
        Known::OneOf(one, other) => fits(one, now) || fits(other, now),
        known => known == now,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_under_mixed_load() {
    let kills = std::env::var("FEEDWAVE_MIXED_KILLS").map_or(KILLS, |count| count.parse().expect("a number"));
    let mut chance = Chance::new();
    let seed = chance.seed();
    let mut home = Home::new(FEEDWAVE, "");
    let mut ledger = Ledger::new();
    for round in 0..kills {
        let kill_at = 20 + chance.up_to(200);
        let (told, left) = work(home.start().await, 1 + round * 1_000_000, kill_at).await;
        ledger.extend(told);
        home = left;
    }
    let server = home.start().await;
    let mut clients = server.connect().await;
    let mut changed = 0;
    for (name, known) in &ledger {
        let now = now(&mut clients, name).await;
        assert!(fits(known, &now), "{name}: acknowledged {known:?}, found {now:?}; seed {seed}");
        changed += u64::from(!matches!(known, Known::OneOf(..)));
    }
    // The audit log has at least what the ledger has.
    let mut audit = AuditClient::new(clients.channel.clone());
    let (mut after, mut entries) = (0, 0);
    loop {
        let request = ListAuditEntriesRequest { after, page_size: 500, ..ListAuditEntriesRequest::default() };
        let page = audit.list_audit_entries(request).await.expect("the audit log").into_inner();
        entries += page.entries.iter().filter(|entry| entry.result == "OK").count() as u64;
        match page.entries.last() {
            Some(last) if !page.next_page_token.is_empty() => after = last.sequence,
            _ => break,
        }
    }
    assert!(entries >= changed, "{entries} entries, {changed} records; seed {seed}");
    println!("{kills} kills, {} records, {entries} calls, seed {seed}: nothing lost", ledger.len());
}
