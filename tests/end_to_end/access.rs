//! Who may do what: tokens, certificates, roles, and certificates that change under a running service.

use std::path::Path;
use std::process::Output;

use feedwave_contract::proto::machines_client::MachinesClient;
use feedwave_contract::proto::run_request::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::{DeleteMachineRequest, GetJobRequest, ListMachinesRequest, RunRequest, RunStart};
use feedwave_tests::{Home, Server, patiently};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair};
use rustix::process::Signal;
use tokio::process::Command;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::FEEDWAVE;
use crate::status::assert_error;

pub(crate) async fn feedwave(arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    let mut command = Command::new(FEEDWAVE);
    command.args(arguments).envs(environment.iter().copied()).kill_on_drop(true);
    command.output().await.expect("the binary is started")
}

/// A token of a new client, added to the file.
pub(crate) async fn token(clients: &Path, name: &str, roles: &[&str]) -> String {
    let mut arguments = vec!["token", name, "--clients", clients.to_str().unwrap()];
    roles.iter().for_each(|argument| arguments.push(argument));
    let made = feedwave(&arguments, &[]).await;
    assert!(made.status.success(), "{made:?}");
    String::from_utf8(made.stdout).unwrap().trim().to_owned()
}

pub(crate) fn bearer<T>(message: T, token: &str) -> tonic::Request<T> {
    let mut request = tonic::Request::new(message);
    request.metadata_mut().insert("authorization", format!("Bearer {token}").parse().unwrap());
    request
}

fn role_needed(status: &Status) -> String {
    assert_error(status, Code::PermissionDenied, "ROLE_NEEDED");
    status.get_error_details().error_info().unwrap().metadata["role"].clone()
}

/// Nobody is known by a token that nobody has seen.
#[tokio::test]
async fn a_token_that_cannot_be_told_is_no_entry() {
    let folder = tempfile::tempdir().unwrap();
    let clients = folder.path().join("clients.toml");
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(FEEDWAVE);
    command.args(["token", "lost", "--role", "viewer", "--clients"]).arg(&clients).stdout(full);
    assert_eq!(command.kill_on_drop(true).status().await.unwrap().code(), Some(2));
    assert_eq!(std::fs::read_to_string(&clients).unwrap_or_default(), "");
    let refused = feedwave(&["token", "lost", "--role", "viewer", "--clients", "/dev/zero"], &[]).await;
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && why.contains("/dev/zero: is no file"), "{why}");
}

// One service, which all roles and the changes of their file meet.
#[tokio::test]
async fn tokens_say_who_asks_and_roles_what_may_be_done() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clients.toml");
    let viewer = token(&file, "dashboard", &["--role", "viewer"]).await;
    let planner = token(&file, "planning", &["--role", "planner"]).await;
    let machine = token(&file, "mill-3", &["--role", "machine", "--machine", "machines/mill"]).await;
    let admin = token(&file, "chief", &["--role", "admin"]).await;
    // What is kept is no token.
    let kept = std::fs::read_to_string(&file).unwrap();
    assert!([&viewer, &planner, &machine, &admin].iter().all(|token| !kept.contains(*token)));
    let config = format!("[auth]\nclients = '{}'\n[log]\nlevel = 'debug'", file.display());
    let server = Home::new(FEEDWAVE, &config).start().await;

    // Nobody, and somebody unknown.
    let url = format!("http://{}", server.grpc);
    let channel = Endpoint::from_shared(url.clone()).unwrap().connect().await.unwrap();
    let mut machines = MachinesClient::new(channel);
    let status = machines.list_machines(ListMachinesRequest::default()).await.unwrap_err();
    assert_error(&status, Code::Unauthenticated, "UNAUTHENTICATED");
    let status = machines.list_machines(bearer(ListMachinesRequest::default(), "feedwave_00")).await.unwrap_err();
    assert_error(&status, Code::Unauthenticated, "UNAUTHENTICATED");

    // A viewer reads, a planner plans, an admin does everything.
    machines.list_machines(bearer(ListMachinesRequest::default(), &viewer)).await.unwrap();
    let delete = || DeleteMachineRequest { name: "machines/mill".to_owned(), ..DeleteMachineRequest::default() };
    let status = machines.delete_machine(bearer(delete(), &planner)).await.unwrap_err();
    assert_eq!(role_needed(&status), "admin");
    let program = folder.path().join("part.nc");
    std::fs::write(&program, "M30\n").unwrap();
    let program = program.to_str().unwrap();
    let submit = ["submit", program, "--server", url.as_str(), "--wait"];
    let refused = feedwave(&submit, &[("FEEDWAVE_TOKEN", viewer.as_str())]).await;
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && why.contains("the role planner"), "{why}");
    let token_file = folder.path().join("token");
    std::fs::write(&token_file, &planner).unwrap();
    let submitted = feedwave(&submit, &[("FEEDWAVE_TOKEN_FILE", token_file.to_str().unwrap())]).await;
    assert!(submitted.status.success(), "{submitted:?}");

    // A machine runs jobs of its own machines alone.
    let job = feedwave(&submit[..4], &[("FEEDWAVE_TOKEN", planner.as_str())]).await;
    let job = String::from_utf8(job.stdout).unwrap().trim().to_owned();
    let start = RunStart { target: Some(Target::Job(job)), ..RunStart::default() };
    let start = RunRequest { message: Some(Message::Start(start)) };
    let mut runs = RunsClient::new(Endpoint::from_shared(url.clone()).unwrap().connect().await.unwrap());
    for (token, why) in [(&machine, "the role machine for machines/lathe"), (&planner, "the role machine")] {
        let status = runs.run(bearer(tokio_stream::iter([start.clone()]), token)).await.unwrap_err();
        assert_eq!(role_needed(&status), "machine");
        assert!(status.message().ends_with(why), "{status:?}");
    }
    machines.delete_machine(bearer(delete(), &admin)).await.unwrap();

    // The same over HTTP; probes need nobody.
    let web = server.web();
    let get = async |path: &str, token: &str| {
        let value = format!("Bearer {token}");
        web.send("GET", path, &[("authorization", value.as_str())], bytes::Bytes::new()).await
    };
    let answer = web.get("/v1/jobs").await;
    assert_eq!((answer.status.as_u16(), answer.header("www-authenticate")), (401, "Bearer realm=\"feedwave\""));
    assert_eq!(get("/v1/jobs", &viewer).await.status, 200);
    assert_eq!(get("/metrics", "feedwave_00").await.status, 401);
    assert_eq!(get("/v1/audit", &planner).await.status, 403);
    assert_eq!(get("/v1/audit", &admin).await.status, 200);
    assert_eq!(web.get("/readyz").await.status, 200);
    let healthy = feedwave(&["healthcheck", "--server", &url], &[]).await;
    assert!(healthy.status.success(), "{healthy:?}");

    // Whoever is taken out of the file is nobody from then on.
    std::fs::write(&file, "").unwrap();
    server.signal(Signal::HUP);
    patiently(async { while get("/v1/jobs", &viewer).await.status != 401 {} }).await;
    let log = server.log();
    for token in [&viewer, &planner, &machine, &admin] {
        assert!(!log.contains(token.as_str()) && !log.contains(&token[9..]), "a token is in the log");
    }
}

#[tokio::test]
async fn a_port_open_to_a_network_needs_encryption_and_clients_or_permission() {
    let folder = tempfile::tempdir().unwrap();
    let store = format!("sqlite://{}/feedwave.db", folder.path().display());
    let serve = ["serve", "--http-listen", "127.0.0.1:0", "--store", store.as_str(), "--grpc-listen", "0.0.0.0:0"];
    let refused = feedwave(&serve, &[]).await;
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(78), "{why}");
    for part in ["grpc.listen", "without encryption", "auth.clients", "auth.allow_insecure_network = true"] {
        assert!(why.contains(part), "{part} is not in {why}");
    }
    let ready = folder.path().join("ready.json");
    let mut permitted = Command::new(FEEDWAVE);
    permitted.args(serve).arg("--ready-file").arg(&ready).env("FEEDWAVE_AUTH__ALLOW_INSECURE_NETWORK", "true");
    let mut child = permitted.kill_on_drop(true).spawn().unwrap();
    patiently(async {
        while !ready.exists() {
            assert!(child.try_wait().unwrap().is_none(), "it ended");
            tokio::task::yield_now().await;
        }
    })
    .await;
}

/// An authority that signs certificates.
struct Authority(CertifiedIssuer<'static, KeyPair>);

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        Self(CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap())
    }

    fn pem(&self) -> String {
        self.0.pem()
    }

    /// A certificate and its key.
    fn sign(&self, common_name: &str) -> (String, String) {
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(vec!["feedwave.test".to_owned()]).unwrap();
        params.distinguished_name.push(DnType::CommonName, common_name);
        let certificate = params.signed_by(&key, &self.0).unwrap();
        (certificate.pem(), key.serialize_pem())
    }
}

async fn connect(server: &Server, authority: &Authority, own: Option<&(String, String)>) -> Result<Channel, String> {
    let mut tls =
        ClientTlsConfig::new().ca_certificate(Certificate::from_pem(authority.pem())).domain_name("feedwave.test");
    if let Some((certificate, key)) = own {
        tls = tls.identity(Identity::from_pem(certificate, key));
    }
    let endpoint = Endpoint::from_shared(format!("https://{}", server.grpc)).unwrap().tls_config(tls).unwrap();
    let channel = endpoint.connect().await.map_err(|error| format!("{error:?}"))?;
    // A certificate that is missing is told with the first call.
    let mut machines = MachinesClient::new(channel.clone());
    match machines.list_machines(ListMachinesRequest::default()).await {
        Err(status) if status.get_error_details().error_info().is_none() => Err(format!("{status:?}")),
        _ => Ok(channel),
    }
}

// One service, whose certificates are replaced one after the other.
#[tokio::test]
async fn certificates_say_who_asks_and_are_replaced_under_a_running_service() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let authority = Authority::new();
    let (certificate, key) = authority.sign("service");
    write("cert.pem", &certificate);
    write("key.pem", &key);
    write("ca.pem", &authority.pem());
    let planner = authority.sign("planning");
    let stranger = authority.sign("stranger");
    write("clients.toml", "[[client]]\nname = 'planning'\ncertificate = 'planning'\nroles = ['planner']\n");
    let config = format!(
        "[tls]\ncert = '{}'\nkey = '{}'\nclient_ca = '{}'\n[auth]\nclients = '{}'\n",
        path("cert.pem").display(),
        path("key.pem").display(),
        path("ca.pem").display(),
        path("clients.toml").display()
    );
    let server = Home::new(FEEDWAVE, &config).start().await;
    connect(&server, &authority, None).await.unwrap_err();
    let channel = connect(&server, &authority, Some(&planner)).await.unwrap();
    let mut jobs = feedwave_contract::proto::jobs_client::JobsClient::new(channel.clone());
    let unknown = GetJobRequest { name: "jobs/01900000-0000-7000-8000-000000000000".to_owned() };
    assert_eq!(jobs.get_job(unknown.clone()).await.unwrap_err().code(), Code::NotFound);
    let status = MachinesClient::new(channel).delete_machine(DeleteMachineRequest::default()).await.unwrap_err();
    assert_eq!(role_needed(&status), "admin");
    let channel = connect(&server, &authority, Some(&stranger)).await.unwrap();
    let status = MachinesClient::new(channel).list_machines(ListMachinesRequest::default()).await.unwrap_err();
    assert_error(&status, Code::Unauthenticated, "UNAUTHENTICATED");

    // The HTTP port is encrypted by the same section.
    let plain = format!("GET /readyz HTTP/1.1\r\nhost: {}\r\n\r\n", server.http);
    let mut connection = tokio::net::TcpStream::connect(server.http).await.unwrap();
    tokio::io::AsyncWriteExt::write_all(&mut connection, plain.as_bytes()).await.unwrap();
    let mut heard = Vec::new();
    let _ = patiently(tokio::io::AsyncReadExt::read_to_end(&mut connection, &mut heard)).await;
    assert!(!heard.starts_with(b"HTTP/1.1 200"), "{heard:?}");

    // What cannot be used changes nothing.
    write("cert.pem", "half a file");
    server.signal(Signal::HUP);
    patiently(async {
        while !server.log().contains("changed certificates cannot be used") {
            tokio::task::yield_now().await;
        }
    })
    .await;
    connect(&server, &authority, Some(&planner)).await.unwrap();

    // Another authority from now on; open connections go on.
    let other = Authority::new();
    let (certificate, key) = other.sign("service");
    write("key.pem", &key);
    write("ca.pem", &other.pem());
    write("cert.pem", &certificate);
    server.signal(Signal::HUP);
    patiently(async {
        while !server.log().contains("changed certificates are used from now on") {
            tokio::task::yield_now().await;
        }
    })
    .await;
    connect(&server, &authority, Some(&planner)).await.unwrap_err();
    connect(&server, &other, Some(&other.sign("planning"))).await.unwrap();
    assert_eq!(jobs.get_job(unknown).await.unwrap_err().code(), Code::NotFound);
}
