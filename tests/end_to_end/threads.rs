//! Threads turned with vibration: planned, judged, streamed and followed, all through the built binary.

use feedwave::proto::plan_thread_request::{Advance, On};
use feedwave::proto::{InfeedPattern, PassMethod, PlanThreadRequest, PlanThreadResponse, ThreadHand};
use feedwave_tests::{Clients, Server};
use tonic::Code;

use crate::status::{assert_error, violated_fields};

/// The thread of program A of the thread vibration page.
fn thread_of_program_a() -> PlanThreadRequest {
    PlanThreadRequest {
        on: Some(On::Machine("machines/lathe".to_owned())),
        work_diameter_mm: 10.0,
        advance: Some(Advance::LeadMm(2.5)),
        start_z_mm: 100.0,
        end_z_mm: 60.0,
        approach_mm: Some(10.0),
        depth_mm: 1.75,
        finishing_allowance_mm: Some(0.018),
        first_depth_mm: 1.0,
        finishing_thickness_mm: Some(0.1),
        infeed: InfeedPattern::Flank.into(),
        spindle_rev_per_min: 300.0,
        ..PlanThreadRequest::default()
    }
}

async fn plan(clients: &mut Clients, request: PlanThreadRequest) -> PlanThreadResponse {
    clients.threads.plan_thread(request).await.unwrap_or_else(|status| panic!("{status:?}")).into_inner()
}

#[tokio::test]
async fn a_planned_thread_breaks_its_chip_in_both_models() {
    let server = Server::start().await;
    let mut clients = server.connect().await;
    for method in [PassMethod::StartAngle, PassMethod::StartPosition] {
        let request = PlanThreadRequest { method: method.into(), ..thread_of_program_a() };
        let answer = plan(&mut clients, request).await;
        let (thread, report) = (answer.thread.expect("a thread"), answer.report.expect("a report"));
        let depths: Vec<f64> = thread.passes.iter().map(|pass| pass.depth_mm).collect();
        assert_eq!(depths, [1.0, 1.414, 1.732, 1.732, 1.75]);
        let places: Vec<f64> = match method {
            PassMethod::StartPosition => thread.passes.iter().map(|pass| pass.start_travel_mm).collect(),
            _ => thread.passes.iter().map(|pass| pass.start_angle_deg).collect(),
        };
        match method {
            PassMethod::StartPosition => assert_eq!(places, [0.0, 0.239, 0.423, 0.423, 0.433]),
            _ => assert_eq!(places, [0.0, 325.584, 299.088, 299.088, 297.648]),
        }
        for pass in &report.passes[..4] {
            let (depth, section) = (pass.depth.expect("depth"), pass.section.expect("section"));
            assert!(depth.broken && section.broken && section.breaks_per_rev >= 2.0, "{pass:?}");
        }
        assert!(report.feasible && report.run_up_travel_mm > 0.0);
        assert!(report.crests.expect("crests").finishing_thickness_mm <= 0.1);
        assert!(answer.findings.iter().all(|finding| finding.severity() == feedwave::proto::Severity::Info));
        assert_eq!(answer.program.lines().filter(|line| line.starts_with("G32 ")).count(), 5);
    }
}

#[tokio::test]
async fn what_cannot_be_planned_is_answered_with_findings() {
    let server = Server::start().await;
    let mut clients = server.connect().await;
    for (request, code) in [
        // Even the run-up of a lead of 2.5 mm takes more than that.
        (PlanThreadRequest { approach_mm: Some(0.001), ..thread_of_program_a() }, "THREAD-APPROACH-SHORT"),
        // Nothing is left for crests.
        (PlanThreadRequest { finishing_thickness_mm: Some(0.018), ..thread_of_program_a() }, "THREAD-PLAN-CRESTS"),
        // A groove wider than the pitch.
        (PlanThreadRequest { depth_mm: 2.4, ..thread_of_program_a() }, "THREAD-PROFILE-WIDE"),
        (PlanThreadRequest { max_thickness_mm: Some(0.001), ..thread_of_program_a() }, "THREAD-PLAN-PASSES"),
        (PlanThreadRequest { hand: ThreadHand::Left.into(), rotation: 1, ..thread_of_program_a() }, "THREAD-HAND"),
    ] {
        let answer = plan(&mut clients, request).await;
        let finding = &answer.findings[0];
        assert_eq!(finding.code, code);
        assert!(!finding.values.is_empty() && !finding.suggestions.is_empty(), "{finding:?}");
        assert!(answer.thread.is_none() && answer.report.is_none() && answer.program.is_empty());
    }
}

#[tokio::test]
async fn every_wrong_field_of_a_thread_is_named_at_once() {
    let server = Server::start().await;
    let mut clients = server.connect().await;
    let wrong = PlanThreadRequest {
        on: Some(On::Machine("lathe".to_owned())),
        advance: None,
        depth_mm: f64::NAN,
        spindle_rev_per_min: f64::INFINITY,
        infeed: 42,
        ..thread_of_program_a()
    };
    let status = clients.threads.plan_thread(wrong).await.unwrap_err();
    assert_eq!(violated_fields(&status), ["advance", "depth_mm", "infeed", "machine", "spindle_rev_per_min"]);
    let nowhere = PlanThreadRequest { on: Some(On::Machine("machines/nowhere".to_owned())), ..thread_of_program_a() };
    let status = clients.threads.plan_thread(nowhere).await.unwrap_err();
    assert_error(&status, Code::NotFound, "RESOURCE_NOT_FOUND");
    let mill = PlanThreadRequest { on: Some(On::Machine("machines/mill".to_owned())), ..thread_of_program_a() };
    assert_eq!(violated_fields(&clients.threads.plan_thread(mill).await.unwrap_err()), ["machine"]);
    let status = clients.threads.plan_thread(PlanThreadRequest::default()).await.unwrap_err();
    let fields = violated_fields(&status);
    assert!(["on", "advance", "depth_mm", "first_depth_mm"].iter().all(|field| fields.contains(&(*field).to_owned())));
}
