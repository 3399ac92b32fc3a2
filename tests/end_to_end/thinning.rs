//! The fitted method of thinning through the built binary: every setpoint within both tolerances of the program at the same share
//! of the path length, both methods side by side in the report, and a stream that is the same from anywhere and after a kill.

use feedwave_contract::proto::{
    CreateMachineRequest, Frame, GetMachineRequest, JobState, ThinningMethod, ThinningReport, ThinningSettings,
};
use feedwave_tests::{Clients, Directions, Server, Setpoints};

use crate::FEEDWAVE;
use crate::five_axis::{
    TOLERANCE_MM, Vec3, dot, forward, freeform, norm, places, set_up, setpoints, sub, submit, unit,
};
use crate::status::violated_fields;

const ANGLE_DEG: f64 = 1.0;

/// Makes `machines/fitting`, which is the trunnion with the fitted method.
async fn make_fitting(clients: &mut Clients, settings: ThinningSettings) -> Result<(), tonic::Status> {
    let request = GetMachineRequest { name: "machines/trunnion".to_owned() };
    let mut machine = clients.machines.get_machine(request).await?.into_inner().machine.expect("a machine");
    machine.profile.as_mut().expect("a profile").thinning = Some(settings);
    let request = CreateMachineRequest { machine_id: "fitting".to_owned(), machine: Some(machine) };
    clients.machines.create_machine(request).await.map(|_| ())
}

fn settings() -> ThinningSettings {
    ThinningSettings {
        angle_tolerance_deg: Some(ANGLE_DEG),
        distance_tolerance_mm: Some(TOLERANCE_MM),
        group_blocks: Some(200),
        method: ThinningMethod::Fitted.into(),
        ..ThinningSettings::default()
    }
}

/// Angles of A and C, degrees, that the blocks say.
fn angles(program: &str) -> Vec<[f64; 2]> {
    let mut angles = [0.0; 2];
    let lines = program.lines().map(|line| {
        for word in line.split_whitespace() {
            let (letter, value) = word.split_at(1);
            if let (Some(place), Ok(value)) = ("AC".find(letter), value.parse()) {
                angles[place] = value;
            }
        }
        angles
    });
    lines.collect()
}

/// Largest distances, mm and rad, of the setpoints of cuts from the program at the same share of the path length between two
/// kept blocks.
fn farthest(program: &str, machine: &Setpoints, directions: Directions) -> (f64, f64) {
    let (places, angles) = (places(program), angles(program));
    let is_on = |line: usize| program.lines().nth(line - 1).is_some_and(|text| !text.starts_with('G'));
    let columns = ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"].map(|name| machine.column(name));
    let (mut before, mut line) = (0, 0);
    let (mut off_mm, mut off_rad) = (0.0_f64, 0.0_f64);
    for row in 0..machine.len() {
        let here = machine.lines[row] as usize;
        if here != line {
            (before, line) = (line, here);
        }
        if before == 0 || !is_on(line) || !is_on(before) {
            continue;
        }
        let (tip, direction) = forward(columns.map(|column| column[row]));
        let (from, to) = (places[before - 1].0, places[line - 1].0);
        let way = sub(to, from);
        let share = (dot(sub(tip, from), way) / dot(way, way)).clamp(0.0, 1.0);
        // The blocks of the program from one to the other.
        let length = |block: usize| norm(sub(places[block].0, places[block - 1].0));
        let mut rest = share * (before..line).map(length).sum::<f64>();
        let mut block = before;
        while block + 1 < line && rest > length(block) {
            rest -= length(block);
            block += 1;
        }
        let within = (rest / length(block)).min(1.0);
        let mix = |a: Vec3, b: Vec3| -> Vec3 { std::array::from_fn(|axis| a[axis] + within * (b[axis] - a[axis])) };
        let programmed = mix(places[block - 1].0, places[block].0);
        off_mm = off_mm.max(norm(sub(tip, programmed)));
        let wanted = match directions {
            // Within a block of a degree the great circle is its chord to 1e-6 rad.
            Directions::Vectors => unit(mix(unit(places[block - 1].1), unit(places[block].1))),
            Directions::Angles => {
                let [a, c] = [0, 1]
                    .map(|axis| angles[block - 1][axis] + within * (angles[block][axis] - angles[block - 1][axis]));
                forward([0.0, 0.0, 0.0, a, c]).1
            }
        };
        off_rad = off_rad.max(2.0 * (0.5 * norm(sub(direction, wanted))).asin());
    }
    (off_mm, off_rad)
}

fn reversals(axes: &[feedwave_contract::proto::ThinnedRotaryAxis]) -> u64 {
    axes.iter().map(|axis| axis.reversals_after).sum()
}

#[tokio::test]
async fn every_setpoint_is_within_both_tolerances_and_both_methods_are_side_by_side() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    make_fitting(&mut clients, settings()).await.expect("the machine is made");
    for directions in [Directions::Angles, Directions::Vectors] {
        let program = freeform(directions);
        let outcome = submit(&mut clients, "fitting", "ball", &program).await;
        assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
        let thinning: ThinningReport = outcome.report.thinning.clone().expect("it was on");
        assert_eq!(thinning.method(), ThinningMethod::Fitted);
        assert!(thinning.position_deviation_mm < TOLERANCE_MM);
        assert!(thinning.direction_deviation_deg <= thinning.direction_bound_deg);
        assert!(thinning.direction_bound_deg <= ANGLE_DEG, "{}", thinning.direction_bound_deg);
        let machine = setpoints(&mut clients, &outcome.job.name, Frame::Machine, 0).await;
        let (off_mm, off_rad) = farthest(&program, &machine, directions);
        assert!(off_mm < TOLERANCE_MM, "{off_mm} mm");
        assert!(off_rad < thinning.direction_bound_deg.to_radians() + 2e-6, "{off_rad} rad");
        // Something was done.
        assert!(off_mm > 1e-4 && off_rad > 1e-3, "{off_mm} mm, {off_rad} rad");

        // The other method, with the same tolerances, is what a machine with it reports.
        let published = submit(&mut clients, "trunnion", "ball", &program).await.report.thinning.expect("it was on");
        assert_eq!(published.method(), ThinningMethod::Published);
        let [of_published, of_fitted] = thinning.methods.as_slice() else { panic!("{:?}", thinning.methods) };
        assert_eq!(of_published.method(), ThinningMethod::Published);
        assert_eq!(of_fitted.method(), ThinningMethod::Fitted);
        assert_eq!((of_fitted.blocks_kept, of_fitted.time_s), (thinning.blocks_kept, thinning.time_after_s));
        assert!(of_published.position_deviation_mm < TOLERANCE_MM);
        assert_eq!(of_published.direction_bound_deg, 0.0);
        assert!(published.methods[0].blocks_kept == published.blocks_kept);
        assert_eq!(published.methods[0].time_s, published.time_after_s);
        assert!(reversals(&of_fitted.rotary_axes) <= reversals(&of_published.rotary_axes), "{:?}", thinning.methods);
        assert!(of_fitted.time_s < 0.5 * thinning.time_before_s, "{:?}", thinning.methods);
    }
}

#[tokio::test]
async fn a_fitted_stream_is_the_same_from_anywhere_and_after_a_kill() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    make_fitting(&mut clients, settings()).await.expect("the machine is made");
    let outcome = submit(&mut clients, "fitting", "ball", &freeform(Directions::Vectors)).await;
    let job = outcome.job.name;
    let whole = setpoints(&mut clients, &job, Frame::Machine, 0).await;
    let count = whole.len() as u64;
    for from in [1, count / 3, count / 2 + 7, count - 1] {
        let part = setpoints(&mut clients, &job, Frame::Machine, from).await;
        assert_eq!(part.bits_from(from), whole.bits_from(from), "from {from}");
    }
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for from in [0, count / 2] {
        let again = setpoints(&mut clients, &job, Frame::Machine, from).await;
        assert_eq!(again.bits_from(from), whole.bits_from(from), "from {from}");
    }
    assert_eq!(clients.validated(&job).await.report, outcome.report);
}

#[tokio::test]
async fn tolerances_that_the_method_cannot_keep_are_refused_by_field() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    let coarse = ThinningSettings { angle_tolerance_deg: Some(11.0), ..settings() };
    let status = make_fitting(&mut clients, coarse).await.expect_err("refused");
    assert_eq!(violated_fields(&status), ["machine.profile.thinning.angle_tolerance_deg"]);
    let unknown = ThinningSettings { method: 7, ..settings() };
    let status = make_fitting(&mut clients, unknown).await.expect_err("refused");
    assert_eq!(violated_fields(&status), ["machine.profile.thinning.method"]);
}
