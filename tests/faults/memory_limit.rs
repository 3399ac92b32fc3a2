//! A limit of memory that one job exceeds: it takes the service down three times and no more, and nobody else's job with it.

use std::os::unix::process::ExitStatusExt as _;

use feedwave_contract::proto::{GetJobRequest, Job, JobState, Machine, MachineProfile, UpdateMachineRequest};
use feedwave_tests::{Clients, Home, Server, patiently};
use rustix::process::{Pid, Resource, Rlimit, prlimit};

use crate::FEEDWAVE;
use crate::data::jobs;

/// How much more a validation must take than the service otherwise does to be told from it, bytes.
const APART: u64 = 24 << 20;

/// Short lines at a high feed: very many of them are planned at once on a machine that looks far ahead.
fn heavy() -> String {
    format!("G21 G91 G94\nG1 F6000\n{}M30\n", "X.001\n".repeat(130_000))
}

/// Lets the machine look as far ahead as machines may.
async fn look_far_ahead(clients: &mut Clients) {
    let profile = MachineProfile { look_ahead_blocks: Some(100_000), ..MachineProfile::default() };
    let machine = Machine { name: "machines/lathe".to_owned(), profile: Some(profile), ..Machine::default() };
    let request = UpdateMachineRequest { machine: Some(machine), update_mask: None };
    clients.machines.update_machine(request).await.expect("the machine is changed");
}

/// What the limit counts: private memory that can be written, bytes.
fn data_bytes(server: &Server) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.pid())).expect("the process is accounted");
    let kibibytes = status.lines().find_map(|line| line.strip_prefix("VmData:")?.trim().strip_suffix(" kB"));
    kibibytes.expect("VmData").trim().parse::<u64>().expect("a number") * 1024
}

fn limit(server: &Server, bytes: u64) {
    let pid = i32::try_from(server.pid()).ok().and_then(Pid::from_raw);
    let limit = Rlimit { current: Some(bytes), maximum: Some(bytes) };
    prlimit(pid, Resource::Data, limit).expect("the limit is set");
}

async fn get(clients: &mut Clients, name: &str) -> Job {
    let request = GetJobRequest { name: name.to_owned() };
    clients.jobs.get_job(request).await.expect("the job is read").into_inner().job.expect("a job")
}

#[tokio::test]
async fn a_job_beyond_the_limit_of_memory_takes_nobody_with_it() {
    let home = || Home::new(FEEDWAVE, "[limits]\nvalidation_workers = 1");
    // What it takes with room enough, on this machine.
    let free = home().start().await;
    let mut clients = free.connect().await;
    clients.submit("G21\nG0 X10. Z1.\nM30\n").await;
    look_far_ahead(&mut clients).await;
    let before = data_bytes(&free);
    clients.create(heavy()).await.expect("the job is created");
    patiently(async {
        while data_bytes(&free) < before + APART {
            tokio::task::yield_now().await;
        }
    })
    .await;
    drop(free);

    let mut server = home().start().await;
    let mut clients = server.connect().await;
    let light = clients.submit("G21\nG0 X10. Z1.\nM30\n").await.job;
    look_far_ahead(&mut clients).await;
    let heavy = clients.create(heavy()).await.expect("the job is created").name;
    for attempt in 1..=3 {
        limit(&server, before + APART / 2);
        let (status, home) = patiently(server.ended()).await;
        assert_eq!(status.signal(), Some(6), "out of memory: {status:?}");
        server = home.start().await;
        assert_eq!(get(&mut server.connect().await, &light.name).await.state(), JobState::Ready, "{attempt}");
    }
    limit(&server, before + APART / 2);
    let mut clients = server.connect().await;
    let given_up = async {
        loop {
            let listed = jobs(&mut clients).await;
            let job = listed.into_iter().find(|job| job.name == heavy).expect("the job is listed");
            if job.state() == JobState::Failed {
                return job;
            }
        }
    };
    let job = patiently(given_up).await;
    assert!(job.state_message.contains("ended with the service 3 time(s)"), "{job:?}");
    let other = clients.submit("G21\nG0 X11. Z1.\nM30\n").await.job;
    assert_eq!(other.state(), JobState::Ready);
}
