//! Hostile programs and requests.

use bytes::Bytes;
use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::validate_program_request::On;
use feedwave_contract::proto::{JobState, Severity, ValidateProgramRequest, ValidationReport};
use feedwave_tests::{Clients, SHAFT, Server, upload};
use tonic::Code;

use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

async fn validate(clients: &mut Clients, program: Vec<u8>) -> ValidationReport {
    let request = ValidateProgramRequest {
        inline_program: program.into(),
        on: Some(On::Machine("machines/lathe".to_owned())),
        ..ValidateProgramRequest::default()
    };
    clients.jobs.validate_program(request).await.expect("findings are data").into_inner().report.expect("a report")
}

#[tokio::test]
async fn bytes_that_are_no_program_get_findings() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let hostile: [(&str, Vec<u8>); 8] = [
        ("NUL", b"G0 X1.\0 Z2.\nM30\n".to_vec()),
        ("not UTF-8", b"G0 X1. \xff\xfe\nM30\n".to_vec()),
        ("a million opening brackets", vec![b'['; 1_000_000]),
        ("a million opening parentheses", vec![b'('; 1_000_000]),
        ("an unclosed comment", b"G0 X1. (never closed\nM30\n".to_vec()),
        ("numbers beyond every number", b"G0 X1e999 Z99999999999999999999999999999999999999999.\nM30\n".to_vec()),
        ("the bytes of a picture", (0..=255_u8).cycle().take(100_000).collect()),
        ("one long line", vec![b'X'; 1_000_000]),
    ];
    for (what, program) in hostile {
        let report = validate(&mut clients, program).await;
        let finding = report.findings.iter().find(|finding| finding.severity() == Severity::Error);
        let finding = finding.unwrap_or_else(|| panic!("{what}: {:?}", report.findings));
        assert!(finding.line >= 1 && finding.column >= 1, "{what}: {finding:?}");
        // However much is wrong, the answer stays small.
        assert!(report.findings.len() <= 10_000, "{what}: {}", report.findings.len());
    }
    // And harmless oddities are harmless.
    let odd = format!("\u{feff}{}", SHAFT.replace('\n', "\r\n"));
    let report = validate(&mut clients, odd.into_bytes()).await;
    assert!(report.findings.iter().all(|finding| finding.severity() != Severity::Error), "{:?}", report.findings);
}

#[tokio::test]
async fn fifty_megabytes_in_one_line_are_rejected_in_bounded_memory() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    clients.submit("M30\n").await;
    // Most of that are pages of the binary, whose size is its build's.
    let before = server.peak_resident_bytes();
    let program = Bytes::from(vec![b'X'; 50_000_000]);
    let name = upload(&mut clients, &program).await.unwrap();
    let job = clients.create_from(Source::Program(name), "").await.unwrap();
    let outcome = clients.validated(&job.name).await;
    assert_eq!(outcome.job.state(), JobState::Rejected);
    let findings = &outcome.report.findings;
    assert!(findings.iter().any(|f| f.severity() == Severity::Error && f.line == 1), "{findings:?}");
    let grown = server.peak_resident_bytes() - before;
    assert!(grown < 35_000_000, "{grown} bytes more resident for a line of 50 MB");
}

#[tokio::test]
async fn messages_and_programs_beyond_the_limits_are_refused() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let oversize = clients.create(vec![b' '; 5 << 20]).await.unwrap_err();
    assert_error(&oversize, Code::ResourceExhausted, "MESSAGE_TOO_LARGE");
    let inline = clients.create(vec![b' '; 2 << 20]).await.unwrap_err();
    assert_eq!(violated_fields(&inline), ["inline_program"]);
    // The connection is as good as before.
    clients.submit("M30\n").await;
}
