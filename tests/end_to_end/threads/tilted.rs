//! Threads in a tilted plane, by forward kinematics written down once more.

use feedwave_contract::proto::follow_spindle_request::Message as Follow;
use feedwave_contract::proto::{
    ColumnKind, FollowSpindleRequest, FollowSpindleStart, Frame, JobState, SpindleAngleKind,
};
use feedwave_tests::Server;
use tonic::Code;

use crate::FEEDWAVE;
use crate::five_axis::{Vec3, dot, forward, norm, set_up, setpoints, sub, submit};
use crate::status::assert_error;

const PROGRAM: &str = include_str!("../../fixtures/thread-tilted.nc");
const ORIGIN_MM: Vec3 = [10.0, 5.0, 30.0];

/// X, Y and Z of the plane I20 J25 K-35, turned about Z, the new X and the new Z.
fn axes() -> [Vec3; 3] {
    let [(si, ci), (sj, cj), (sk, ck)] = [20.0_f64, 25.0, -35.0].map(|angle_deg| angle_deg.to_radians().sin_cos());
    let about_z = |[x, y, z]: Vec3| [ci * x - si * y, si * x + ci * y, z];
    let about_x = |[x, y, z]: Vec3| [x, cj * y - sj * z, sj * y + cj * z];
    let first = |[x, y, z]: Vec3| [ck * x - sk * y, sk * x + ck * y, z];
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| about_z(about_x(first(axis))))
}

#[tokio::test]
async fn threads_in_a_tilted_plane_are_in_step_with_the_spindle() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    let outcome = submit(&mut clients, "trunnion", "ball", PROGRAM).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
    let job = outcome.job.name.clone();
    let streamed = setpoints(&mut clients, &job, Frame::Machine, 0).await;
    let columns = ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"].map(|name| streamed.column(name));
    let axes = axes();
    let tips: Vec<(Vec3, Vec3)> = (0..streamed.len())
        .map(|row| {
            let (tip, direction) = forward(columns.map(|column| column[row]));
            (axes.map(|axis| dot(axis, sub(tip, ORIGIN_MM))), direction)
        })
        .collect();
    let spindle = streamed.of_kind(ColumnKind::SpindleAngle);
    let lines: Vec<&str> = PROGRAM.lines().collect();
    let rows_of = |words: &str| -> Vec<usize> {
        let line = 1 + lines.iter().position(|line| line.starts_with(words)).expect("it is in the program");
        (0..streamed.len()).filter(|&row| streamed.lines[row] as usize == line).collect()
    };
    // The passes at 11.6, 11.3 and 11.2: they vibrate by 1.2 times the infeed in the X of the plane, and by nothing.
    let passes: Vec<usize> = (1..=lines.len()).filter(|line| lines[line - 1].starts_with("G33 Z-5.0")).collect();
    for (line, (x, amplitude_mm)) in passes.into_iter().zip([(11.6, 0.48), (11.3, 0.36), (11.2, 0.0)]) {
        let rows: Vec<usize> = (0..streamed.len()).filter(|&row| streamed.lines[row] as usize == line).collect();
        assert!(rows.len() > 5_000, "{}", rows.len());
        let mut largest_mm = 0.0_f64;
        for pair in rows.windows(2) {
            let ([tip_x, tip_y, tip_z], direction) = tips[pair[1]];
            assert!(tip_y.abs() < 1e-9 && norm(sub(direction, axes[2])) < 1e-9, "line {line}: {tip_y:e}");
            assert!((-1e-9..=amplitude_mm + 1e-9).contains(&(tip_x - x)), "line {line}: {tip_x}");
            largest_mm = largest_mm.max(tip_x - x);
            if (0.0..15.0).contains(&tip_z) {
                let turned = (spindle[pair[1]] - spindle[pair[0]]) / 360.0;
                let travel = tips[pair[0]].0[2] - tip_z;
                assert!((travel - 1.5 * turned).abs() < 2e-9, "line {line}: {travel} in {turned} turns");
            }
        }
        assert!((largest_mm - amplitude_mm).abs() < 1e-3, "line {line}: {largest_mm}");
        // The retreat behind it is at its very end.
        let behind: Vec<usize> = (0..streamed.len()).filter(|&row| streamed.lines[row] as usize == line + 1).collect();
        assert!(behind.len() > 10);
        assert!(behind.into_iter().all(|row| (tips[row].0[2] + 5.0).abs() < 1e-9), "line {line} ends beside its end");
    }
    // The taper: X follows Z, and the lead is along Z.
    let taper = rows_of("G33 X10.0 Z12.0");
    let on_taper: Vec<Vec3> =
        taper.iter().map(|&row| tips[row].0).filter(|tip| (15.0..22.0).contains(&tip[2])).collect();
    assert!(on_taper.len() > 500, "{}", on_taper.len());
    for [x, y, z] in on_taper {
        assert!((x - 9.0 - (25.0 - z) / 13.0).abs() < 1e-9 && y.abs() < 1e-9, "{x} {y} {z}");
    }
    // From the middle of a pass the same bits.
    let middle = rows_of("G33 X10.0 Z12.0")[500] as u64;
    let rest = setpoints(&mut clients, &job, Frame::Machine, middle).await;
    assert_eq!(rest.bits_from(middle), streamed.bits_from(middle));
    // In work coordinates the tip itself.
    let work = setpoints(&mut clients, &job, Frame::Work, 0).await;
    let tip = ["X_mm", "Y_mm", "Z_mm"].map(|name| work.column(name));
    for &row in &taper {
        let tip = axes.map(|axis| dot(axis, sub(tip.map(|column| column[row]), ORIGIN_MM)));
        assert!(norm(sub(tip, tips[row].0)) < 1e-9, "{tip:?}");
    }
    // A spindle cannot lead it: positions of X and Z alone would be those of other axes.
    let angle_kind = SpindleAngleKind::Unwrapped.into();
    let start = FollowSpindleStart { job, angle_kind, ..FollowSpindleStart::default() };
    let message = FollowSpindleRequest { message: Some(Follow::Start(start)) };
    let status = clients.threads.follow_spindle(futures_util::stream::iter([message])).await.expect_err("refused");
    assert_error(&status, Code::FailedPrecondition, "THREAD_IN_PLANE");
}
