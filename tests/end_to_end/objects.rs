//! Large programs in an object store, through the service: uploaded, streamed, sought in, deleted, damaged, killed in
//! between, backed up and copied. The object store is a folder, or that of `FEEDWAVE_TEST_OBJECTS`: the URI of one with `{}` where the
//! name of an empty prefix goes (`tests/objects/run.sh`).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::programs_client::ProgramsClient;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{
    DeleteJobRequest, GetJobRequest, GetUploadRequest, Job, JobState, ProgramsDeleteProgramRequest, ReadProgramRequest,
    StreamSetpointsRequest,
};
use feedwave_tests::{
    Chance, Clients, Database, Home, SHAFT_CURED, Server, Setpoints, patiently, sha256_hex, shared_store, stream,
    upload, upload_messages,
};
use futures_util::TryStreamExt as _;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt as _};
use rustix::process::Signal;
use tempfile::TempDir;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::access::feedwave;
use crate::status::assert_error;

/// Variables of the environment that hold what nobody may be told.
const SECRETS: [&str; 2] = ["AWS_SECRET_ACCESS_KEY", "AZURE_STORAGE_ACCOUNT_KEY"];

/// Where the objects of one test are, as somebody beside the service sees them.
struct Objects {
    uri: String,
    store: Arc<dyn ObjectStore>,
    prefix: Option<Key>,
    folder: TempDir,
}

impl Objects {
    fn new() -> Self {
        match std::env::var("FEEDWAVE_TEST_OBJECTS") {
            Ok(pattern) => Self::at(&pattern),
            Err(_) => Self::in_folder(),
        }
    }

    fn in_folder() -> Self {
        let folder = TempDir::new().expect("a temporary directory");
        std::fs::create_dir(folder.path().join("objects")).expect("a folder");
        let store = LocalFileSystem::new_with_prefix(folder.path().join("objects")).expect("a folder");
        let uri = format!("file://{}/objects", folder.path().display());
        Self { uri, store: Arc::new(store), prefix: None, folder }
    }

    fn at(pattern: &str) -> Self {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let folder = TempDir::new().expect("a temporary directory");
        let name = folder.path().file_name().expect("a name").to_string_lossy().trim_start_matches('.').to_owned();
        let uri = pattern.replace("{}", &name);
        let url: url::Url = uri.parse().expect("FEEDWAVE_TEST_OBJECTS is a URI");
        let options: Vec<(String, String)> = url.query_pairs().into_owned().collect();
        let environment = std::env::vars().map(|(name, value)| (name.to_ascii_lowercase(), value));
        let environment = environment
            .filter(|(name, _)| ["aws_", "azure_", "google_"].iter().any(|of_a_store| name.starts_with(of_a_store)));
        let mut place = url.clone();
        place.set_query(None);
        let (store, prefix) =
            object_store::parse_url_opts(&place, environment.chain(options)).expect("an object store");
        Self { uri, store: store.into(), prefix: Some(prefix), folder }
    }

    /// A service that keeps programs of more than a megabyte here.
    fn settings(&self) -> String {
        format!("[store.objects]\nuri = '{}'\nabove_bytes = 1000000\n", self.uri)
    }

    fn home(&self) -> Home {
        Home::new(FEEDWAVE, &self.settings())
    }

    /// With its database in a file, whatever the others have.
    fn home_with_file(&self) -> (Home, PathBuf) {
        let pattern = format!("sqlite://{}/{{}}", self.folder.path().display());
        let home = Home::on(FEEDWAVE, &Database::new(&pattern, "feedwave.db"), &self.settings());
        (home, self.folder.path().join("feedwave.db"))
    }

    /// All but the one that is there before any other.
    async fn names(&self) -> Vec<Key> {
        let list = self.store.list(self.prefix.as_ref()).map_ok(|object| object.location);
        let all: Vec<Key> = list.try_collect().await.expect("objects are listed");
        all.into_iter().filter(|name| name.filename() != Some("feedwave")).collect()
    }

    /// Waits until there are so many.
    async fn until(&self, count: usize) {
        patiently(async { while self.names().await.len() != count {} }).await;
    }

    async fn get(&self, name: &Key) -> Bytes {
        self.store.get(name).await.expect("the object").bytes().await.expect("its bytes")
    }

    async fn put(&self, name: &Key, bytes: Bytes) {
        self.store.put(name, bytes.into()).await.expect("it is written");
    }
}

/// Above the size, and of several chunks: comments that hardly compress, with few blocks between them.
fn program(marker: u64) -> Bytes {
    let mut text = String::from("G21 G97 S1000 M3\nG0 X10. Z0.\nG1 F6000.\n");
    let mut state = 0x9E37_79B9_7F4A_7C15_u64 ^ marker;
    for block in 0..640 {
        text.push('(');
        for _ in 0..250 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            write!(text, "{state:016x}").expect("text grows");
        }
        writeln!(text, ")\nG1 X{}. Z0.{block:03}", 10 + block % 2).expect("text grows");
    }
    text.push_str("M30\n");
    text.into()
}

async fn delete(server: &Server, name: &str) -> Result<(), Status> {
    let mut programs = ProgramsClient::new(server.connect().await.channel);
    let request = ProgramsDeleteProgramRequest { name: name.to_owned() };
    programs.delete_program(request).await.map(drop)
}

/// What the service has of a program.
async fn read(server: &Server, name: &str) -> Result<Vec<u8>, Status> {
    let request = ReadProgramRequest { name: name.to_owned(), ..ReadProgramRequest::default() };
    let mut pieces = ProgramsClient::new(server.connect().await.channel).read_program(request).await?.into_inner();
    let mut source = Vec::new();
    while let Some(piece) = pieces.message().await? {
        source.extend_from_slice(&piece.data);
    }
    Ok(source)
}

async fn created(clients: &mut Clients, name: &str) -> Job {
    clients.create_from(Source::Program(name.to_owned()), "").await.expect("a job")
}

/// Uploads what the service does not have of a program yet.
async fn go_on(clients: &mut Clients, program: &Bytes) -> Result<String, Status> {
    let name = format!("programs/{}", sha256_hex(program));
    let known = clients.jobs.get_upload(GetUploadRequest { program: name }).await;
    let received = known.map_or(0, |upload| upload.into_inner().received_bytes);
    let messages = upload_messages(program, usize::try_from(received).expect("a size"), 256 << 10);
    Ok(clients.jobs.upload_program(futures_util::stream::iter(messages)).await?.into_inner().program)
}

/// Waits until a job has failed.
async fn failed(clients: &mut Clients, name: &str) -> Job {
    patiently(async {
        loop {
            let job = job_of(clients, name).await;
            match job.state() {
                JobState::Pending | JobState::Validating => {}
                state => {
                    assert_eq!(state, JobState::Failed, "{job:?}");
                    return job;
                }
            }
        }
    })
    .await
}

async fn job_of(clients: &mut Clients, name: &str) -> Job {
    let request = GetJobRequest { name: name.to_owned() };
    clients.jobs.get_job(request).await.expect("the job").into_inner().job.expect("a job")
}

async fn ready(clients: &mut Clients, name: &str) -> String {
    let job = created(clients, name).await.name;
    assert_eq!(clients.validated(&job).await.job.state(), JobState::Ready);
    job
}

async fn streamed(clients: &mut Clients, job: &str, from: u64) -> Result<Setpoints, Status> {
    let start = Some(Start::StartIndex(from));
    stream(clients, StreamSetpointsRequest { job: job.to_owned(), start, ..StreamSetpointsRequest::default() }).await
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn told(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// A command of the binary, its exit code and what it said.
async fn exits(arguments: &[&str], code: i32, words: &str) {
    let output = patiently(feedwave(arguments, &[])).await;
    let text = told(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(text.contains(words), "{words:?} is not in: {text}");
}

#[tokio::test]
async fn a_large_program_is_streamed_from_its_object_and_goes_with_it() {
    let objects = Objects::new();
    let settings = objects.settings()
        + "[log]\nlevel = 'info,object_store=trace,reqwest=trace,hyper_util=trace,hyper=trace,h2=trace'\n";
    let server = Home::new(FEEDWAVE, &settings).start().await;
    let mut clients = server.connect().await;
    let name = upload(&mut clients, &program(0)).await.unwrap();
    assert_eq!(objects.names().await.len(), 1);
    let job = ready(&mut clients, &name).await;
    let whole = streamed(&mut clients, &job, 0).await.unwrap();
    let index = whole.len() * 2 / 3;
    let sought = streamed(&mut clients, &job, index as u64).await.unwrap();
    assert_eq!(bits(sought.column("X_mm")), bits(&whole.column("X_mm")[index..]));
    let again = upload(&mut clients, &program(0)).await.unwrap();
    assert_eq!((again, objects.names().await.len()), (name.clone(), 1));

    clients.jobs.delete_job(DeleteJobRequest { name: job, ..DeleteJobRequest::default() }).await.unwrap();
    delete(&server, &name).await.unwrap();
    assert!(objects.names().await.is_empty());
    for secret in SECRETS {
        if let Ok(secret) = std::env::var(secret) {
            assert!(!server.log().contains(&secret), "a secret is in the log");
        }
    }
}

#[tokio::test]
async fn while_its_object_store_is_away_the_rest_goes_on() {
    let objects = Objects::in_folder();
    let (there, away) = (objects.folder.path().join("objects"), objects.folder.path().join("away"));
    let server = objects.home().start().await;
    let mut clients = server.connect().await;
    let name = upload(&mut clients, &program(0)).await.unwrap();
    let job = ready(&mut clients, &name).await;
    let whole = streamed(&mut clients, &job, 0).await.unwrap();

    let home = server.kill().await;
    std::fs::rename(&there, &away).unwrap();
    // It may only not be mounted yet.
    let server = home.start().await;
    let mut clients = server.connect().await;
    let refused = streamed(&mut clients, &job, 0).await.expect_err("its program cannot be read");
    assert_error(&refused, Code::Unavailable, "STORE_UNAVAILABLE");
    assert!(refused.get_error_details().retry_info().is_some(), "{refused:?}");
    let refused = upload(&mut clients, &program(1)).await.expect_err("it cannot be written");
    assert_error(&refused, Code::Unavailable, "STORE_UNAVAILABLE");
    assert_eq!(server.web().get("/readyz").await.status, 200);
    let waiting = created(&mut clients, &name).await.name;
    assert_eq!(clients.submit(SHAFT_CURED).await.job.state(), JobState::Ready);
    let state = job_of(&mut clients, &waiting).await.state();
    assert!(matches!(state, JobState::Pending | JobState::Validating), "{state:?}");

    std::fs::rename(&away, &there).unwrap();
    assert_eq!(clients.validated(&waiting).await.job.state(), JobState::Ready);
    let again = streamed(&mut clients, &job, 0).await.unwrap();
    assert_eq!(bits(again.column("X_mm")), bits(whole.column("X_mm")));
    // All of it is there already.
    go_on(&mut clients, &program(1)).await.unwrap();
    assert_eq!(objects.names().await.len(), 2);
}

#[tokio::test]
async fn an_object_that_was_lost_cut_or_changed_fails_its_jobs_and_is_found() {
    let objects = Objects::new();
    let (home, file) = objects.home_with_file();
    let server = home.start().await;
    let store = format!("sqlite://{}", file.display());
    let mut clients = server.connect().await;
    let name = upload(&mut clients, &program(0)).await.unwrap();
    exits(&["check", "--store", &store], 0, "intact").await;
    let object = objects.names().await.remove(0);
    let whole = objects.get(&object).await;
    let mut changed = whole.to_vec();
    changed[whole.len() / 2] ^= 1;
    let cut = whole.slice(..whole.len() - 1);
    for (bytes, says) in
        [(Some(changed.into()), "other bytes"), (Some(cut), "shorter"), (None, "is not there any more")]
    {
        objects.put(&object, whole.clone()).await;
        let made_before = ready(&mut clients, &name).await;
        match bytes {
            Some(bytes) => objects.put(&object, bytes).await,
            None => objects.store.delete(&object).await.expect("it is removed"),
        }
        let made_after = created(&mut clients, &name).await.name;
        let failed = failed(&mut clients, &made_after).await;
        assert!(failed.state_message.contains(says), "{failed:?}");
        let refused = streamed(&mut clients, &made_before, 0).await.expect_err("not all of its program is there");
        assert_error(&refused, Code::DataLoss, "STORE_DAMAGED");
        assert_eq!(job_of(&mut clients, &made_before).await.state(), JobState::Failed);
        exits(&["check", "--store", &store], 1, says).await;
    }
    // Nothing else is lost, and what was there before is good again.
    objects.put(&object, whole).await;
    exits(&["check", "--store", &store], 0, "intact").await;
    ready(&mut clients, &name).await;
}

#[tokio::test]
async fn a_service_that_is_killed_while_it_writes_objects_loses_no_program_and_leaves_none() {
    const KILLS: usize = 4;
    let mut chance = Chance::new();
    let objects = Objects::new();
    let (home, _) = objects.home_with_file();
    let mut server = home.start().await;
    let mut names = Vec::new();
    for kill in 0..KILLS {
        let program = program(kill as u64);
        let (mut clients, sent) = (server.connect().await, program.clone());
        let begun = tokio::spawn(async move { upload(&mut clients, &sent).await });
        if kill % 2 == 0 {
            // Somewhere between its first byte and its end.
            for _ in 0..chance.up_to(100) {
                server.web().get("/healthz").await;
            }
        } else {
            // Between the object and the row that says that it is whole, or soon after it.
            patiently(async { while objects.names().await.len() <= kill && !begun.is_finished() {} }).await;
        }
        server = server.kill().await.start().await;
        let acknowledged = begun.await.expect("the caller goes on");
        if let Ok(name) = acknowledged {
            assert!(read(&server, &name).await.unwrap() == program, "what was acknowledged is there");
        }
        // Whatever came of it, it goes on from there.
        let name = go_on(&mut server.connect().await, &program).await.unwrap();
        assert!(read(&server, &name).await.unwrap() == program);
        names.push(name);
    }
    // What was being written goes with the next start.
    server = server.kill().await.start().await;
    objects.until(KILLS).await;
    for name in names {
        let channel = server.connect().await.channel;
        let request = ProgramsDeleteProgramRequest { name: name.clone() };
        let begun = tokio::spawn(async move { ProgramsClient::new(channel).delete_program(request).await });
        for _ in 0..chance.up_to(8) {
            server.web().get("/healthz").await;
        }
        server = server.kill().await.start().await;
        let acknowledged = begun.await.expect("the caller goes on").is_ok();
        match read(&server, &name).await {
            Ok(_) => {
                assert!(!acknowledged, "what was deleted is there; seed {}", chance.seed());
                delete(&server, &name).await.unwrap();
            }
            Err(status) => assert_eq!(status.code(), Code::NotFound, "{status:?}; seed {}", chance.seed()),
        }
    }
    objects.until(0).await;
}

#[tokio::test]
async fn a_backup_says_what_is_not_in_it_and_is_restored_beside_its_objects() {
    let objects = Objects::new();
    let (home, file) = objects.home_with_file();
    let server = home.start().await;
    let mut clients = server.connect().await;
    let name = upload(&mut clients, &program(0)).await.unwrap();
    let job = ready(&mut clients, &name).await;
    let whole = streamed(&mut clients, &job, 0).await.unwrap();
    let store = format!("sqlite://{}", file.display());
    let copy = objects.folder.path().join("copy.db");
    let copy = copy.to_str().expect("text");
    exits(&["backup", "--store", &store, copy], 0, "1 program(s) are in an object store and not in the copy").await;

    server.signal(Signal::TERM);
    let (_, home) = patiently(server.ended()).await;
    std::fs::remove_file(&file).unwrap();
    let object = objects.names().await.remove(0);
    let bytes = objects.get(&object).await;
    objects.store.delete(&object).await.unwrap();
    exits(&["restore", "--store", &store, copy], 1, "--accept-damage").await;
    objects.put(&object, bytes).await;
    exits(&["restore", "--store", &store, copy], 0, "restored").await;
    let server = home.start().await;
    let again = streamed(&mut server.connect().await, &job, 0).await.unwrap();
    assert_eq!(bits(again.column("X_mm")), bits(whole.column("X_mm")));
}

#[tokio::test]
async fn an_object_store_that_cannot_be_is_refused_at_start() {
    let folder = TempDir::new().unwrap();
    let start = async |uri: &str| {
        let store = format!("sqlite://{}/feedwave.db", folder.path().display());
        let arguments = ["serve", "--store", &store, "--grpc-listen", "127.0.0.1:0", "--http-listen", "127.0.0.1:0"];
        patiently(feedwave(&arguments, &[("FEEDWAVE_STORE__OBJECTS__URI", uri)])).await
    };
    for (uri, says) in [
        ("s3://bucket?secret_access_key=hush", "none of endpoint"),
        ("s3://key:hush@bucket", "credentials are not part of it"),
        ("s3://bucket?allow_http=perhaps", "names no object store that can be used"),
        ("az://container", "names no object store that can be used"),
    ] {
        let output = start(uri).await;
        let text = told(&output);
        assert!(!output.status.success() && text.contains(says), "{uri}: {text}");
        assert!(!text.contains("hush"), "{text}");
    }
}

/// All replicas read the objects of each other.
#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn replicas_share_objects() {
    let (objects, store) = (Objects::new(), shared_store());
    let first = Home::on(FEEDWAVE, &store, &objects.settings()).start().await;
    let second = Home::on(FEEDWAVE, &store, &objects.settings()).start().await;
    let name = upload(&mut first.connect().await, &program(0)).await.unwrap();
    let mut clients = second.connect().await;
    let job = ready(&mut clients, &name).await;
    let whole = streamed(&mut clients, &job, 0).await.unwrap();
    drop(first.kill().await);
    let again = streamed(&mut clients, &job, 0).await.unwrap();
    assert_eq!(bits(again.column("X_mm")), bits(whole.column("X_mm")));
    exits(&["check", "--store", &store.uri], 0, "intact").await;
    clients.jobs.delete_job(DeleteJobRequest { name: job, ..DeleteJobRequest::default() }).await.unwrap();
    delete(&second, &name).await.unwrap();
    assert!(objects.names().await.is_empty());
}

/// What was in objects is in the database of the server, which no longer needs them.
#[tokio::test]
#[ignore = "needs a PostgreSQL server: tests/postgres/run.sh"]
async fn a_copy_to_a_server_holds_what_was_in_objects() {
    let (objects, database) = (Objects::new(), shared_store());
    let (home, file) = objects.home_with_file();
    let server = home.start().await;
    let mut clients = server.connect().await;
    let name = upload(&mut clients, &program(0)).await.unwrap();
    let job = ready(&mut clients, &name).await;
    let whole = streamed(&mut clients, &job, 0).await.unwrap();
    server.signal(Signal::TERM);
    patiently(server.ended()).await;
    let from = format!("sqlite://{}", file.display());
    exits(&["copy", &from, &database.uri], 0, "object_chunks").await;
    for object in objects.names().await {
        objects.store.delete(&object).await.unwrap();
    }
    exits(&["check", "--store", &database.uri], 0, "intact").await;
    let server = Home::on(FEEDWAVE, &database, "").start().await;
    let again = streamed(&mut server.connect().await, &job, 0).await.unwrap();
    assert_eq!(bits(again.column("X_mm")), bits(whole.column("X_mm")));
}

/// Kept for the folder's own faults: what is no folder any more.
#[tokio::test]
async fn a_folder_is_not_made_anew() {
    let objects = Objects::in_folder();
    let server = objects.home().start().await;
    let there: &Path = &objects.folder.path().join("objects");
    std::fs::remove_dir(there).unwrap();
    let refused = upload(&mut server.connect().await, &program(0)).await.expect_err("the folder is not there");
    assert_error(&refused, Code::Unavailable, "STORE_UNAVAILABLE");
    assert!(!there.exists());
}
