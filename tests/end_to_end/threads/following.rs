//! A pass that is played against a spindle.

use feedwave_contract::proto::follow_spindle_request::Message as Follow;
use feedwave_contract::proto::follow_spindle_response::Message as Followed;
use feedwave_contract::proto::{
    FollowSpindleRequest, FollowSpindleStart, FollowedPass, FollowedPositions, JobState, SpindleAngleKind,
    SpindleAngles, SpindleEventKind,
};
use feedwave_tests::{Clients, Server};
use tonic::{Code, Status};

use super::{PROGRAM_A, assert_near, of_line, work_setpoints};
use crate::FEEDWAVE;
use crate::status::{assert_error, violated_fields};

async fn follow(
    clients: &mut Clients,
    messages: Vec<Follow>,
) -> Result<(FollowedPass, Vec<FollowedPositions>), Status> {
    let messages: Vec<_> =
        messages.into_iter().map(|message| FollowSpindleRequest { message: Some(message) }).collect();
    let mut answers = clients.threads.follow_spindle(futures_util::stream::iter(messages)).await?.into_inner();
    let Some(Followed::FollowedPass(pass)) = answers.message().await?.and_then(|first| first.message) else {
        panic!("the first message is the pass")
    };
    let mut batches = Vec::new();
    while let Some(message) = answers.message().await? {
        match message.message {
            Some(Followed::Positions(positions)) => batches.push(positions),
            other => panic!("after the pass come positions, not {other:?}"),
        }
    }
    Ok((pass, batches))
}

#[tokio::test]
async fn a_pass_is_followed_from_the_checkpoint_before_it() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let near = clients.submit(PROGRAM_A).await;
    let (start, wait) = ("G0 X14.0 Z100.0 M8\n", "G0 X14.0 Z100.0 M8\nG4 P300000\n");
    assert!(PROGRAM_A.contains(start));
    let far = clients.submit(&PROGRAM_A.replace(start, wait)).await;
    assert_eq!(far.job.state(), JobState::Ready, "{:?}", far.codes());
    let regenerated = async || -> u64 {
        let answer = server.web().get("/metrics").await;
        let line = answer.text().lines().find_map(|line| line.strip_prefix("feedwave_setpoints_regenerated_total "));
        line.expect("the figure is shown").parse().expect("a number")
    };
    let angles_deg: Vec<f64> = (-50..700).map(|step| 7.3 * f64::from(step)).collect();
    for pass in 0..4 {
        let followed = async |clients: &mut Clients, job: &str| {
            let angle_kind = SpindleAngleKind::Unwrapped.into();
            let start = FollowSpindleStart { job: job.to_owned(), pass, angle_kind, ..FollowSpindleStart::default() };
            let angles = SpindleAngles { angles_deg: angles_deg.clone(), time_ns: Vec::new() };
            follow(clients, vec![Follow::Start(start), Follow::Angles(angles)]).await.expect("it is followed").1
        };
        let expected = followed(&mut clients, &near.job.name).await;
        let before = regenerated().await;
        assert_eq!(followed(&mut clients, &far.job.name).await, expected, "to the last bit");
        // Of more than 300 000 setpoints only those behind the second checkpoint are made again.
        let again = regenerated().await - before;
        assert!((30_000..70_000).contains(&again), "{again} for pass {pass}");
    }
}

// One pass from the stream through a spindle of its own back to the stream.
#[tokio::test]
async fn a_pass_followed_by_a_spindle_that_is_not_constant_is_the_pass_of_the_stream() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    // The finishing pass goes on in a second part, which makes it a thread of its own.
    let (whole, parts) = ("G32 Z60.0 F2.5 Q297.648 A0.0", "G32 Z70.0 F2.5 Q297.648 A0.0\nG32 X7.5 Z60.0 F2.5");
    assert!(PROGRAM_A.contains(whole));
    let outcome = clients.submit(&PROGRAM_A.replace(whole, parts)).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let setpoints = work_setpoints(&mut clients, &outcome.job.name).await;
    let threads = (0_u32..).zip(&outcome.report.threads);
    let passes: Vec<_> = threads
        .flat_map(|(number, section)| {
            let passes = section.thread.as_ref().expect("a thread").passes.iter();
            (0_u32..).zip(passes).map(move |(index, pass)| (number, index, pass))
        })
        .collect();
    assert_eq!(passes.len(), 4);
    for (thread, index, pass) in passes {
        let streamed: Vec<[f64; 3]> =
            of_line(&setpoints, pass.line).into_iter().filter(|point| point[2] < 100.0).collect();
        // The turn in which the pass started: Z began to move Q after its reference point, within one turn.
        let reference_deg = 360.0 * ((streamed[0][0] - pass.start_angle_deg) / 360.0).round();
        // Every angle of the stream, and between each two of them the spindle runs on, stops, and turns back a little.
        let angles: Vec<f64> = streamed
            .windows(2)
            .flat_map(|pair| {
                let step_deg = pair[1][0] - pair[0][0];
                [0.0, 0.9, 0.9, 0.3].map(|share| pair[0][0] + share * step_deg)
            })
            .collect();
        let encoder: Vec<f64> = std::iter::once(reference_deg - 1.0)
            .chain((0..3).map(|step| reference_deg + pass.start_angle_deg * f64::from(step) / 3.0))
            .chain(angles.iter().copied())
            .map(|angle_deg| angle_deg.rem_euclid(360.0))
            .collect();
        let start = FollowSpindleStart {
            job: outcome.job.name.clone(),
            thread,
            pass: index,
            angle_kind: SpindleAngleKind::Unwrapped.into(),
            reference_angle_deg: Some(reference_deg),
        };
        let mut messages = vec![Follow::Start(start.clone())];
        messages.extend(
            angles
                .chunks(777)
                .map(|angles| Follow::Angles(SpindleAngles { angles_deg: angles.to_vec(), time_ns: Vec::new() })),
        );
        let (followed, batches) = follow(&mut clients, messages).await.unwrap();
        assert_eq!((followed.line, followed.reference_angle_deg), (pass.line, reference_deg));
        assert!(followed.lead_start_deg <= pass.start_angle_deg && followed.lead_end_deg <= followed.rest_deg);
        let x: Vec<f64> = batches.iter().flat_map(|batch| batch.x_mm.iter().copied()).collect();
        let z: Vec<f64> = batches.iter().flat_map(|batch| batch.z_mm.iter().copied()).collect();
        assert_eq!((x.len(), z.len()), (angles.len(), angles.len()));
        for (row, [_, streamed_x, streamed_z]) in streamed[..streamed.len() - 1].iter().enumerate() {
            assert_near(x[4 * row], *streamed_x, 1e-9);
            assert_near(z[4 * row], *streamed_z, 1e-9);
        }
        // The encoder, which counts its turns from the passage of the reference point, gives the same.
        let start =
            FollowSpindleStart { angle_kind: SpindleAngleKind::Encoder.into(), reference_angle_deg: None, ..start };
        let message = Follow::Angles(SpindleAngles { angles_deg: encoder.clone(), time_ns: Vec::new() });
        let (_, batches) = follow(&mut clients, vec![Follow::Start(start), message]).await.unwrap();
        let [batch] = batches.as_slice() else { panic!("{} batches", batches.len()) };
        for (own, other) in batch.x_mm[4..].iter().zip(&x).chain(batch.z_mm[4..].iter().zip(&z)) {
            assert_near(*own, *other, 1e-7);
        }
    }
}

#[tokio::test]
async fn a_spindle_that_stops_turns_back_or_is_too_fast_is_told_and_the_tool_stays_in_its_groove() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(PROGRAM_A).await;
    // 300 rev/min in readings of 5 ms: 9 degrees. Five turns, a stop of a second, a quarter of a turn back, and then thirty
    // times as fast, at which X would vibrate with 300 Hz.
    let turn = |from: f64, step: f64, count: u32| (1..=count).map(move |k| from + step * f64::from(k));
    let mut angles_deg: Vec<f64> = turn(-90.0, 9.0, 210).collect();
    let stops_at = angles_deg.len();
    angles_deg.extend(turn(1_800.0, 0.0, 200));
    let returns_at = angles_deg.len();
    angles_deg.extend(turn(1_800.0, -9.0, 10));
    angles_deg.extend(turn(1_710.0, 9.0, 30));
    let fast_at = angles_deg.len();
    angles_deg.extend(turn(1_980.0, 270.0, 6));
    let time_ns: Vec<u64> = (1..=angles_deg.len() as u64).map(|k| k * 5_000_000).collect();
    let angle_kind = SpindleAngleKind::Unwrapped.into();
    let start = FollowSpindleStart { job: outcome.job.name.clone(), angle_kind, ..FollowSpindleStart::default() };
    // Events do not depend on where batches end.
    let batches = angles_deg.chunks(37).zip(time_ns.chunks(37));
    let messages = batches.map(|(angles_deg, time_ns)| {
        Follow::Angles(SpindleAngles { angles_deg: angles_deg.to_vec(), time_ns: time_ns.to_vec() })
    });
    let messages = std::iter::once(Follow::Start(start.clone())).chain(messages).collect();
    let (pass, batches) = follow(&mut clients, messages).await.expect("it is followed");
    assert_eq!(pass.programmed_rev_per_min, 300.0);
    let events: Vec<_> = batches.iter().flat_map(|batch| &batch.events).collect();
    let kinds: Vec<_> = events.iter().map(|event| event.kind()).collect();
    let (stopped, regular) = (SpindleEventKind::Stopped, SpindleEventKind::Regular);
    assert_eq!(kinds, [stopped, SpindleEventKind::Reversed, regular, SpindleEventKind::TooFast], "{events:?}");
    let places: Vec<usize> = events.iter().map(|event| usize::try_from(event.index).expect("small")).collect();
    assert!((stops_at + 99..=stops_at + 100).contains(&places[0]), "{places:?}");
    assert!(places[1] == returns_at && places[2] < fast_at && places[3] >= fast_at, "{places:?}");
    assert_near(events[1].back_deg, 9.0, 1e-9);
    let too_fast = events[3];
    assert!(too_fast.spindle_rev_per_min > 1.01 * too_fast.limit_rev_per_min, "{too_fast:?}");
    assert!(too_fast.limit_rev_per_min > 300.0, "the programmed speed is none: {too_fast:?}");
    // In step with the spindle all along: the same angle is the same place, whatever came before.
    let column = |of: fn(&FollowedPositions) -> &Vec<f64>| batches.iter().flat_map(of).copied().collect::<Vec<f64>>();
    let [x, z] = [column(|batch| &batch.x_mm), column(|batch| &batch.z_mm)];
    for (k, angle_deg) in angles_deg.iter().enumerate() {
        let first = angles_deg.iter().position(|other| other == angle_deg).expect("it is there");
        assert_eq!((x[k], z[k]), (x[first], z[first]));
    }
    // Without times only the reversal is seen.
    let messages =
        vec![Follow::Start(start.clone()), Follow::Angles(SpindleAngles { angles_deg, time_ns: Vec::new() })];
    let (_, batches) = follow(&mut clients, messages).await.expect("it is followed");
    let kinds: Vec<_> =
        batches.iter().flat_map(|batch| &batch.events).map(feedwave_contract::proto::SpindleEvent::kind).collect();
    assert_eq!(kinds, [SpindleEventKind::Reversed, regular]);
    for (angles_deg, time_ns, field) in
        [(vec![0.0, 1.0], vec![5], "angles.time_ns"), (vec![0.0, 1.0], vec![5, 5], "angles.time_ns[1]")]
    {
        let messages = vec![Follow::Start(start.clone()), Follow::Angles(SpindleAngles { angles_deg, time_ns })];
        assert_eq!(violated_fields(&follow(&mut clients, messages).await.unwrap_err()), [field]);
    }
}

#[tokio::test]
async fn following_is_refused_with_the_field_that_is_wrong() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let outcome = clients.submit(PROGRAM_A).await;
    let start = FollowSpindleStart { job: outcome.job.name.clone(), ..FollowSpindleStart::default() };
    let angles = |angles_deg: Vec<f64>| Follow::Angles(SpindleAngles { angles_deg, time_ns: Vec::new() });
    for (messages, field) in [
        (vec![angles(vec![0.0])], "message"),
        (vec![Follow::Start(FollowSpindleStart { job: "thread".to_owned(), ..start.clone() })], "start.job"),
        (vec![Follow::Start(FollowSpindleStart { thread: 1, ..start.clone() })], "start.thread"),
        (vec![Follow::Start(FollowSpindleStart { pass: 4, ..start.clone() })], "start.pass"),
        (vec![Follow::Start(FollowSpindleStart { angle_kind: 9, ..start.clone() })], "start.angle_kind"),
        (vec![Follow::Start(start.clone()), angles(Vec::new())], "angles.angles_deg"),
        (vec![Follow::Start(start.clone()), angles(vec![0.0; 65_537])], "angles.angles_deg"),
        (vec![Follow::Start(start.clone()), angles(vec![0.0, f64::NAN])], "angles.angles_deg[1]"),
        (vec![Follow::Start(start.clone()), Follow::Start(start.clone())], "message"),
    ] {
        let status = follow(&mut clients, messages).await.unwrap_err();
        assert_eq!(violated_fields(&status), [field]);
    }
    let rejected = clients.submit(&PROGRAM_A.replace("Q325.584", "Q400.0")).await;
    let start = FollowSpindleStart { job: rejected.job.name, ..FollowSpindleStart::default() };
    let status = follow(&mut clients, vec![Follow::Start(start)]).await.unwrap_err();
    assert_error(&status, Code::FailedPrecondition, "JOB_NOT_READY");
}
