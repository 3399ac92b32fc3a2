//! Five axes through the built binary: programs with angles and with vectors, thinned, streamed in machine and work
//! coordinates, and judged by forward kinematics written down here once more.

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::stream_setpoints_request::Start;
use feedwave_contract::proto::{
    AxisLetter, AxisRange, ChainAxis, CreateJobRequest, CreateMachineRequest, CreateToolRequest, Frame,
    GetMachineRequest, JobState, Kinematics, MachineAxis, StreamSetpointsRequest, ThinningReport, ThinningSettings,
    Tool, Vector,
};
use feedwave_tests::{Clients, Directions, Freeform, Outcome, Server, Setpoints, stream};
use tonic::Code;

use crate::FEEDWAVE;
use crate::status::assert_error;

pub(crate) type Vec3 = [f64; 3];

/// Tool length, the line of A, and the origin of G54 in machine coordinates, mm.
pub(crate) const LENGTH_MM: f64 = 120.0;
const A_POINT_MM: Vec3 = [0.0, 0.3, -560.0];
pub(crate) const ORIGIN_MM: Vec3 = [-10.0, -5.0, -500.0];
pub(crate) const TOLERANCE_MM: f64 = 0.01;

fn vector([x, y, z]: Vec3) -> Option<Vector> {
    Some(Vector { x, y, z })
}

pub(crate) fn chain_axis(axis: AxisLetter, direction: Vec3, point_mm: Vec3, range: Option<AxisRange>) -> ChainAxis {
    let (direction, point_mm) = (vector(direction), vector(point_mm));
    ChainAxis { axis: axis.into(), direction, point_mm, range, ..ChainAxis::default() }
}

/// Makes `machines/trunnion`, an A/C table under a mill's spindle, and `tools/ball` and `tools/unmeasured`.
pub(crate) async fn set_up(clients: &mut Clients) {
    let request = GetMachineRequest { name: "machines/mill".to_owned() };
    let response = clients.machines.get_machine(request).await.expect("the mill").into_inner();
    let mut machine = response.machine.expect("a machine");
    let profile = machine.profile.as_mut().expect("a profile");
    for (name, letter) in [("A", AxisLetter::A), ("C", AxisLetter::C)] {
        profile.machine.as_mut().expect("axes").axes.push(MachineAxis {
            name: name.to_owned(),
            axis: letter.into(),
            max_velocity_per_s: 120.0,
            max_acceleration_per_s2: 600.0,
            max_jerk_per_s3: 20_000.0,
            max_velocity_step_per_s: 2.0,
            ..MachineAxis::default()
        });
    }
    let language = profile.language.as_mut().expect("a language");
    let origin = language.work_offsets.first_mut().expect("G54");
    [origin.x, origin.y, origin.z] = ORIGIN_MM;
    let (x, y, z, none) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]);
    profile.kinematics = Some(Kinematics {
        chain: vec![
            chain_axis(AxisLetter::C, z, none, None),
            chain_axis(AxisLetter::A, x, A_POINT_MM, Some(AxisRange { min: -120.0, max: 30.0 })),
            chain_axis(AxisLetter::Y, y, none, None),
            chain_axis(AxisLetter::X, x, none, None),
            chain_axis(AxisLetter::Z, z, none, None),
        ],
        gauge_point_mm: vector(none),
        ..Kinematics::default()
    });
    let distance_tolerance_mm = Some(TOLERANCE_MM);
    profile.thinning = Some(ThinningSettings { distance_tolerance_mm, ..ThinningSettings::default() });
    let request = CreateMachineRequest { machine_id: "trunnion".to_owned(), machine: Some(machine) };
    clients.machines.create_machine(request).await.expect("the machine is made");
    for (id, length_mm) in [("ball", Some(LENGTH_MM)), ("unmeasured", None)] {
        let tool = Tool { number: 1, length_mm, ..Tool::default() };
        let request = CreateToolRequest { tool_id: id.to_owned(), tool: Some(tool) };
        clients.tools.create_tool(request).await.expect("the tool is made");
    }
}

pub(crate) async fn submit(clients: &mut Clients, machine: &str, tool: &str, program: &str) -> Outcome {
    let request = CreateJobRequest {
        machine: format!("machines/{machine}"),
        tools: vec![format!("tools/{tool}")],
        source: Some(Source::InlineProgram(program.as_bytes().to_vec().into())),
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job.expect("a job");
    clients.validated(&job.name).await
}

pub(crate) async fn setpoints(clients: &mut Clients, job: &str, frame: Frame, from: u64) -> Setpoints {
    let start = Some(Start::StartIndex(from));
    let request = StreamSetpointsRequest { job: job.to_owned(), frame: frame.into(), start, ..Default::default() };
    stream(clients, request).await.unwrap_or_else(|status| panic!("{status:?}"))
}

pub(crate) fn freeform(directions: Directions) -> String {
    let surface = Freeform { length_mm: 20.0, width_mm: 10.0, mesh_mm: 0.5, passes: 4, directions };
    surface.lines().collect()
}

pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Tool centre point and direction in work coordinates of the axes X Y Z A C.
pub(crate) fn forward([x, y, z, a_deg, c_deg]: [f64; 5]) -> (Vec3, Vec3) {
    let ((a_sine, a_cosine), (c_sine, c_cosine)) = (a_deg.to_radians().sin_cos(), c_deg.to_radians().sin_cos());
    let turn = |[x, y, z]: Vec3| {
        let (y, z) = (a_cosine * y - a_sine * z, a_sine * y + a_cosine * z);
        (x, y, z)
    };
    let about_c = |(x, y, z): (f64, f64, f64)| [c_cosine * x - c_sine * y, c_sine * x + c_cosine * y, z];
    let (tx, ty, tz) = turn(sub([x, y, z - LENGTH_MM], A_POINT_MM));
    let [px, py, pz] = A_POINT_MM;
    (sub(about_c((tx + px, ty + py, tz + pz)), ORIGIN_MM), about_c(turn([0.0, 0.0, 1.0])))
}

/// What the blocks of a program say of each line: the modal place, and the direction words.
pub(crate) fn places(program: &str) -> Vec<(Vec3, Vec3)> {
    let (mut place, mut direction) = ([0.0; 3], [0.0; 3]);
    let lines = program.lines().map(|line| {
        for word in line.split_whitespace() {
            let (letter, value) = word.split_at(1);
            let Ok(value) = value.parse() else { continue };
            if let Some(axis) = "XYZ".find(letter) {
                place[axis] = value;
            } else if let Some(axis) = "IJK".find(letter) {
                direction[axis] = value;
            }
        }
        (place, direction)
    });
    lines.collect()
}

pub(crate) fn unit(a: Vec3) -> Vec3 {
    a.map(|value| value / norm(a))
}

/// Largest distances of all setpoints of thinned cuts: the tool centre point from its segment, mm, and its direction from what
/// is interpolated, rad.
fn farthest(program: &str, machine: &Setpoints, directions: Directions) -> (f64, f64) {
    let places = places(program);
    let is_on = |line: usize| program.lines().nth(line - 1).is_some_and(|text| !text.starts_with('G'));
    let columns = ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"].map(|name| machine.column(name));
    let (mut before, mut line, mut start) = (0, 0, 0);
    let (mut off_mm, mut off_rad) = (0.0_f64, 0.0_f64);
    for row in 0..machine.len() {
        let here = machine.lines[row] as usize;
        if here != line {
            (before, line, start) = (line, here, row);
        }
        // Blocks of words alone are the cuts, and follow each other.
        if before == 0 || !is_on(line) || !is_on(before) || start == 0 {
            continue;
        }
        let axes = columns.map(|column| column[row]);
        let (tip, direction) = forward(axes);
        let ((from, from_direction), (to, to_direction)) = (places[before - 1], places[line - 1]);
        let way = sub(to, from);
        let share = dot(sub(tip, from), way) / dot(way, way);
        assert!((-1e-9..=1.0 + 1e-9).contains(&share), "line {line}: {share}");
        let nearest: Vec3 = std::array::from_fn(|axis| from[axis] + share * way[axis]);
        off_mm = off_mm.max(norm(sub(tip, nearest)));
        if directions == Directions::Vectors {
            let (from, to) = (unit(from_direction), unit(to_direction));
            let angle_rad = norm(sub(to, from));
            // Small angles: the great circle is the chord, made a unit vector.
            let chord: Vec3 = std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis]));
            off_rad = off_rad.max(norm(sub(direction, unit(chord))) / angle_rad.max(1e-3));
        }
    }
    (off_mm, off_rad)
}

#[tokio::test]
async fn angles_and_vectors_are_thinned_and_lead_the_tool_along_the_path() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    for directions in [Directions::Angles, Directions::Vectors] {
        let program = freeform(directions);
        let outcome = submit(&mut clients, "trunnion", "ball", &program).await;
        assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
        let thinning: ThinningReport = outcome.report.thinning.clone().expect("it was on");
        assert_eq!(thinning.blocks_read, thinning.blocks_dropped + thinning.blocks_kept);
        assert!(thinning.blocks_dropped > 4 * thinning.blocks_kept, "{thinning:?}");
        assert!(thinning.position_deviation_mm > 0.0 && thinning.position_deviation_mm < TOLERANCE_MM);
        assert!(thinning.time_after_s < 0.5 * thinning.time_before_s);
        let axes: Vec<_> = thinning.rotary_axes.iter().map(|axis| axis.axis.as_str()).collect();
        assert_eq!(axes, ["C", "A"]);
        for axis in &thinning.rotary_axes {
            assert!(5 * axis.reversals_after < axis.reversals_before, "{axis:?}");
        }

        let machine = setpoints(&mut clients, &outcome.job.name, Frame::Machine, 0).await;
        let (off_mm, off_rad) = farthest(&program, &machine, directions);
        assert!(off_mm < 1e-9, "{off_mm} mm");
        assert!(off_rad < 1e-4, "{off_rad}");

        // Work coordinates are those of the same setpoints.
        let work = setpoints(&mut clients, &outcome.job.name, Frame::Work, 0).await;
        assert_eq!(work.lines, machine.lines);
        let of = |setpoints: &Setpoints, names: [&str; 3], row: usize| names.map(|name| setpoints.column(name)[row]);
        let guided = |row: &usize| (8..=program.lines().count() as u32 - 5).contains(&machine.lines[*row]);
        for row in (0..machine.len()).filter(guided) {
            let axes = ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"].map(|name| machine.column(name)[row]);
            let (tip, direction) = forward(axes);
            let (shown, shown_direction) = (
                of(&work, ["X_mm", "Y_mm", "Z_mm"], row),
                of(&work, ["tool_direction_X", "tool_direction_Y", "tool_direction_Z"], row),
            );
            assert!(norm(sub(tip, shown)) < 1e-9, "setpoint {row}: {tip:?}, {shown:?}");
            assert!(norm(sub(direction, shown_direction)) < 1e-12, "setpoint {row}");
        }
    }
}

#[tokio::test]
async fn a_stream_is_the_same_from_anywhere_and_after_a_kill() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    let outcome = submit(&mut clients, "trunnion", "ball", &freeform(Directions::Vectors)).await;
    let job = outcome.job.name;
    let frames = [Frame::Machine, Frame::Work];
    let mut whole = Vec::new();
    for frame in frames {
        whole.push(setpoints(&mut clients, &job, frame, 0).await);
    }
    let count = whole[0].len() as u64;
    let places = [1, count / 3, count / 2 + 7, count - 1];
    for (frame, whole) in frames.into_iter().zip(&whole) {
        for from in places {
            let part = setpoints(&mut clients, &job, frame, from).await;
            assert_eq!(part.bits_from(from), whole.bits_from(from), "{frame:?} from {from}");
        }
    }
    let server = server.kill().await.start().await;
    let mut clients = server.connect().await;
    for (frame, whole) in frames.into_iter().zip(&whole) {
        for from in [0, count / 2] {
            let again = setpoints(&mut clients, &job, frame, from).await;
            assert_eq!(again.bits_from(from), whole.bits_from(from), "{frame:?} from {from}");
        }
    }
    assert_eq!(clients.validated(&job).await.report, outcome.report);
}

#[tokio::test]
async fn what_cannot_be_is_refused_with_numbers_and_a_cure() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    set_up(&mut clients).await;
    let guided = |block: &str| format!("G0 A-20\nG43.5 H1\nG0 X0 Y0 Z20 I0 J0.3 K1\n{block} F1000\nM30\n");
    let valid = guided("G1 X5 I0 J0.4 K1");
    for (machine, tool, program, code, line) in [
        ("mill", "ball", "G43.4 H1\nG0 X0 Y0 Z20\nM30\n".to_owned(), "FIVE-AXIS-KINEMATICS", 2),
        ("trunnion", "unmeasured", valid.clone(), "PRG-TOOL-LENGTH", 2),
        ("trunnion", "ball", guided("G1 X5 I0 J0 K0"), "PRG-TOOL-DIRECTION", 4),
        ("trunnion", "ball", guided("G1 X5 I0 J-1 K-1"), "FIVE-AXIS-RANGE", 4),
    ] {
        let outcome = submit(&mut clients, machine, tool, &program).await;
        assert_eq!(outcome.job.state(), JobState::Rejected, "{code}");
        let finding = outcome.report.findings.iter().find(|finding| finding.code == code);
        let finding = finding.unwrap_or_else(|| panic!("{code} is not in {:?}", outcome.report.findings));
        assert_eq!(finding.line, line, "{finding:?}");
        assert!(!finding.suggestions.is_empty(), "{finding:?}");
        let request = StreamSetpointsRequest { job: outcome.job.name, ..StreamSetpointsRequest::default() };
        let status = stream(&mut clients, request).await.expect_err("nothing moves");
        assert_error(&status, Code::FailedPrecondition, "JOB_NOT_READY");
    }
    let outcome = submit(&mut clients, "trunnion", "ball", &valid).await;
    assert_eq!(outcome.job.state(), JobState::Ready, "{:?}", outcome.report.findings);
}
