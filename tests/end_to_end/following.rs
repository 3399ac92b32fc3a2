//! What the drives leave of the vibrating functions, through the built binary: a profile with a drive of its own for each axis,
//! every figure of the reports against the differential equation of the drives, and refusals by field.

use std::f64::consts::TAU;

use feedwave_contract::proto::create_job_request::Source;
use feedwave_contract::proto::{
    AxisFollowingModel, AxisLetter, CreateJobRequest, CreateMachineRequest, FollowingModel, GetMachineRequest, Machine,
    OscillationDirection,
};
use feedwave_tests::{Clients, Outcome, Server};
use tonic::Status;

use crate::FEEDWAVE;
use crate::oscillation::{CUTTER, PROGRAM, equip, retraction_mm};
use crate::status::violated_fields;

/// The program of `tests/fixtures/following.nc`.
const LATHE_PROGRAM: &str = include_str!("../fixtures/following.nc");

/// Steps of a period in a simulation, and seconds until it has settled.
const STEPS: usize = 4_000;
const SETTLED_S: f64 = 1.0;

/// The drives of `tests/fixtures/following-lathe.toml`.
fn drives() -> FollowingModel {
    FollowingModel {
        position_loop_gain_per_s: Some(120.0),
        velocity_loop_frequency_hz: Some(60.0),
        velocity_feed_forward: 0.5,
        axes: vec![AxisFollowingModel {
            axis: AxisLetter::Z.into(),
            filter_length_s: Some(0.004),
            position_loop_gain_per_s: Some(80.0),
            velocity_loop_frequency_hz: Some(40.0),
            velocity_loop_damping: Some(0.7),
            ..AxisFollowingModel::default()
        }],
        ..FollowingModel::default()
    }
}

/// Gain and lag, rad, of X (or what has no drive of its own) or Z at a frequency: the differential equation
/// a₂·v̈ + a₁·v̇ + v = K·(r − x) + k·ṙ with r a sine behind a moving average, stepped until it has settled.
fn simulated(is_z: bool, frequency_hz: f64) -> (f64, f64) {
    let (filter_s, gain, loop_hz, forward) = if is_z { (0.004, 80.0, 40.0, 0.0) } else { (0.0, 120.0, 60.0, 0.5) };
    let (omega, loop_rad) = (TAU * frequency_hz, TAU * loop_hz);
    let command = |time: f64| {
        if filter_s == 0.0 {
            return ((omega * time).sin(), omega * (omega * time).cos());
        }
        let (now, before) = (omega * time, omega * (time - filter_s));
        ((before.cos() - now.cos()) / (omega * filter_s), (now.sin() - before.sin()) / filter_s)
    };
    let rates = |[x, v, a]: [f64; 3], time: f64| {
        let (r, r_rate) = command(time);
        let wanted = gain * (r - x) + forward * r_rate;
        match is_z {
            true => [v, a, loop_rad * (loop_rad * (wanted - v) - 1.4 * a)],
            false => [v, loop_rad * (wanted - v), 0.0],
        }
    };
    let step = 1.0 / (frequency_hz * STEPS as f64);
    let periods = (SETTLED_S * frequency_hz).ceil() as usize;
    let mut state = [0.0; 3];
    let (mut sine, mut cosine) = (0.0, 0.0);
    for count in 0..(periods + 1) * STEPS {
        let time = count as f64 * step;
        if count >= periods * STEPS {
            let angle = TAU * (count % STEPS) as f64 / STEPS as f64;
            sine += 2.0 / STEPS as f64 * state[0] * angle.sin();
            cosine += 2.0 / STEPS as f64 * state[0] * angle.cos();
        }
        let ahead = |rates: [f64; 3], share: f64| std::array::from_fn(|i| state[i] + share * step * rates[i]);
        let one = rates(state, time);
        let two = rates(ahead(one, 0.5), time + 0.5 * step);
        let three = rates(ahead(two, 0.5), time + 0.5 * step);
        let four = rates(ahead(three, 1.0), time + step);
        state = std::array::from_fn(|i| state[i] + step / 6.0 * (one[i] + 2.0 * (two[i] + three[i]) + four[i]));
    }
    (sine.hypot(cosine), (-cosine).atan2(sine).rem_euclid(TAU))
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

/// Makes a machine like one that is there, with drives.
async fn with_drives(clients: &mut Clients, like: &str, id: &str, following: FollowingModel) -> Result<(), Status> {
    let request = GetMachineRequest { name: format!("machines/{like}") };
    let machine = clients.machines.get_machine(request).await?.into_inner().machine.expect("a machine");
    let mut profile = machine.profile.expect("a profile");
    profile.following = Some(following);
    let machine = Machine { profile: Some(profile), ..Machine::default() };
    let request = CreateMachineRequest { machine_id: id.to_owned(), machine: Some(machine) };
    clients.machines.create_machine(request).await.map(|_| ())
}

async fn submit(clients: &mut Clients, machine: &str, tools: &[&str], program: &str) -> Outcome {
    let request = CreateJobRequest {
        machine: format!("machines/{machine}"),
        tools: tools.iter().map(|tool| format!("tools/{tool}")).collect(),
        source: Some(Source::InlineProgram(program.as_bytes().to_vec().into())),
        ..CreateJobRequest::default()
    };
    let job = clients.jobs.create_job(request).await.expect("the job is created").into_inner().job.expect("a job");
    clients.validated(&job.name).await
}

#[tokio::test]
async fn a_taper_an_arc_and_a_thread_arrive_as_the_differential_equation_says() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    with_drives(&mut clients, "lathe", "driven", drives()).await.expect("the machine is made");
    let report = submit(&mut clients, "driven", &[], LATHE_PROGRAM).await.report;

    // Vibration along a taper, an arc and along Z, at 25 Hz with 0.04 mm.
    let following = report.sections[0].following.clone().expect("a prediction");
    let ((x_gain, x_lag), (z_gain, z_lag)) = (simulated(false, 25.0), simulated(true, 25.0));
    let axes: Vec<_> = following.axes.iter().map(|axis| (axis.axis(), axis.gain, axis.lag_deg.to_radians())).collect();
    assert_eq!((axes[0].0, axes[1].0, axes.len()), (AxisLetter::X, AxisLetter::Z, 2));
    for (axis, gain, lag) in [(axes[0], x_gain, x_lag), (axes[1], z_gain, z_lag)] {
        assert_near(axis.1, gain, 1e-6);
        assert_near(axis.2, lag, 1e-6);
    }
    // Least arrives where Z moves alone, or where both lags work against each other on the slopes.
    assert!(following.arriving_amplitude_mm <= 0.04 * z_gain + 1e-9);
    let command_mm = following.amplitude_to_command_mm.expect("some of it arrives");
    assert_near(command_mm * following.arriving_amplitude_mm, 0.04 * 0.04, 1e-12);
    assert!(following.largest_arriving_amplitude_mm > following.arriving_amplitude_mm);
    // The arc in line 8 passes the slope of 45 degrees, where the axes differ most.
    let contour = following.contour.expect("judged");
    let apart = (x_gain * x_lag.cos() - z_gain * z_lag.cos()).hypot(x_gain * x_lag.sin() - z_gain * z_lag.sin());
    assert_eq!((contour.vibration_line, contour.feed_line, contour.unjudged_mm), (8, 8, 0.0));
    assert_near(contour.vibration_mm, 0.5 * 0.04 * apart, 1e-6);
    let feed_mm_per_s = 0.02 * 1_000.0 / 60.0;
    let lag_s: f64 = 0.5 / 120.0 - (0.002 + 1.0 / 80.0);
    assert_near(contour.feed_mm, 0.5 * feed_mm_per_s * lag_s.abs(), 1e-5);
    assert_near(contour.together_mm, contour.feed_mm + contour.vibration_mm, 1e-6);
    let codes: Vec<&str> = report.findings.iter().map(|finding| finding.code.as_str()).collect();
    for code in ["VIB-FOLLOWING-LOSS", "VIB-FOLLOWING-CONTOUR"] {
        assert!(codes.contains(&code), "{codes:?}");
    }

    // The thread vibrates twice in each of five revolutions a second, in X.
    let thread = &report.threads[0];
    let passes = &thread.thread.as_ref().expect("a thread").passes;
    let arriving = thread.report.as_ref().expect("a report").following.clone().expect("a prediction");
    let (gain, lag) = simulated(false, 10.0);
    assert_near(arriving.gain, gain, 1e-6);
    assert_near(arriving.lag_deg.to_radians(), lag, 1e-6);
    for (pass, arriving) in passes.iter().zip(&arriving.passes) {
        let amplitude_mm = pass.amplitude_mm;
        assert_near(arriving.arriving_amplitude_mm, gain * amplitude_mm, 1e-6);
        assert_near(arriving.above_depth_mm, 0.5 * amplitude_mm * (1.0 - gain), 1e-6);
        assert_near(arriving.amplitude_to_command_mm.expect("it arrives"), amplitude_mm / gain, 1e-6);
        let depth_mm = pass.depth_mm + 0.5 * amplitude_mm * (1.0 / gain - 1.0);
        assert_near(arriving.depth_to_command_mm.expect("it arrives"), depth_mm, 1e-6);
        let shift_deg = (pass.phase_shift_deg - lag.to_degrees()).rem_euclid(360.0);
        assert_near(arriving.phase_shift_to_command_deg, shift_deg, 1e-4);
    }
    // A taper of 1 mm on 30 mm at 10 mm/s along Z.
    let taper: f64 = 1.0 / 30.0;
    let lead_mm_per_s = 2.0 * 5.0;
    assert_near(arriving.contour_error_mm, lag_s.abs() * taper * lead_mm_per_s / (1.0 + taper * taper).sqrt(), 1e-9);
    assert_near(arriving.lead_lag_mm, (0.002 + 1.0 / 80.0) * lead_mm_per_s, 1e-9);
}

#[tokio::test]
async fn what_is_commanded_instead_arrives_as_it_was_wanted() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    with_drives(&mut clients, "lathe", "driven", drives()).await.expect("the machine is made");
    let program = |amplitude: f64| format!("M3 S1000\nG0 X20 Z5\nG200 F25 A{amplitude:.9}\nG1 Z-20 F0.02\nG201\nM30\n");
    let following = |outcome: Outcome| outcome.report.sections[0].following.clone().expect("a prediction");
    let wanted_mm = 0.04;
    let first = following(submit(&mut clients, "driven", &[], &program(wanted_mm)).await);
    let command_mm = first.amplitude_to_command_mm.expect("some of it arrives");
    let second = following(submit(&mut clients, "driven", &[], &program(command_mm)).await);
    assert_near(second.arriving_amplitude_mm, wanted_mm, 1e-8);
    // Along one axis the tool is late and on its path.
    assert_eq!(second.contour.expect("judged").together_mm, 0.0);
}

#[tokio::test]
async fn an_oscillation_arrives_with_all_its_harmonics() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    equip(&mut clients).await;
    with_drives(&mut clients, "oscillating", "driven-mill", drives()).await.expect("the machine is made");
    let report = submit(&mut clients, "driven-mill", &[CUTTER], PROGRAM).await.report;
    let following = report.oscillations[0].following.clone().expect("a prediction");
    let ((plane_gain, plane_lag), (axial_gain, axial_lag)) = (simulated(false, 10.0), simulated(true, 10.0));
    let rows: Vec<_> = following.directions.iter().map(|own| (own.direction(), own.axis.as_str())).collect();
    let feed = OscillationDirection::Feed;
    assert_eq!(rows, [(feed, "X"), (feed, "Y"), (OscillationDirection::Axial, "Z")]);
    for own in &following.directions {
        let (gain, lag) = if own.axis == "Z" { (axial_gain, axial_lag) } else { (plane_gain, plane_lag) };
        assert_near(own.gain, gain, 1e-6);
        assert_near(own.lag_deg.to_radians(), lag, 1e-6);
    }
    // The feed oscillates in a sine; the protrusion is held, and its harmonics arrive each in its own way.
    assert_near(following.directions[0].arriving_amplitude_mm, 0.4 * plane_gain, 1e-5);
    let samples = 4_096;
    let harmonics: Vec<_> = (1..=40)
        .map(|harmonic| {
            let mut sum = (0.0, 0.0);
            for sample in 0..samples {
                let turns = f64::from(sample) / f64::from(samples);
                let angle = TAU * f64::from(harmonic) * turns;
                sum.0 += 2.0 / f64::from(samples) * retraction_mm(turns) * angle.cos();
                sum.1 += 2.0 / f64::from(samples) * retraction_mm(turns) * angle.sin();
            }
            (
                f64::from(harmonic),
                sum,
                if sum.0.hypot(sum.1) > 1e-7 { simulated(true, 10.0 * f64::from(harmonic)) } else { (0.0, 0.0) },
            )
        })
        .collect();
    let arriving = (0..2_000).map(|place| {
        let turns = f64::from(place) / 2_000.0;
        let terms = harmonics.iter().map(|&(harmonic, (cosine, sine), (gain, lag))| {
            let angle = TAU * harmonic * turns - lag;
            gain * (cosine * angle.cos() + sine * angle.sin())
        });
        terms.sum::<f64>()
    });
    let (least, most) =
        arriving.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (value.min(least), value.max(most)));
    assert_near(following.directions[2].arriving_amplitude_mm, 0.5 * (most - least), 1e-5);
    let error_deg = (axial_lag - plane_lag).to_degrees();
    assert_near(following.phase_error_deg, error_deg, 1e-4);
    // X and Y have the same drive.
    assert_eq!(following.contour_error_mm, Some(0.0));
    let found = report.findings.iter().find(|finding| finding.code == "OSC-FOLLOWING").expect("a warning");
    assert!(!found.suggestions.is_empty(), "{found:?}");
}

#[tokio::test]
async fn drives_that_cannot_be_are_refused_by_field() {
    let server = Server::start(FEEDWAVE).await;
    let mut clients = server.connect().await;
    let drive = |axis: AxisLetter| AxisFollowingModel { axis: axis.into(), ..AxisFollowingModel::default() };
    let model = FollowingModel {
        position_loop_gain_per_s: Some(-1.0),
        velocity_feed_forward: 1.5,
        axes: vec![
            // 2·0.4·2π·15 = 75.4 is where it begins to swing up.
            AxisFollowingModel {
                position_loop_gain_per_s: Some(76.0),
                velocity_loop_frequency_hz: Some(15.0),
                velocity_loop_damping: Some(0.4),
                ..drive(AxisLetter::X)
            },
            AxisFollowingModel { velocity_loop_damping: Some(0.7), ..drive(AxisLetter::X) },
        ],
        ..FollowingModel::default()
    };
    let status = with_drives(&mut clients, "lathe", "wrong", model).await.expect_err("refused");
    let field = |name: &str| format!("machine.profile.following.{name}");
    let expected = [
        "axes[0].position_loop_gain_per_s",
        "axes[1].axis",
        "axes[1].velocity_loop_damping",
        "position_loop_gain_per_s",
        "velocity_feed_forward",
    ];
    assert_eq!(violated_fields(&status), expected.map(field));
    let foreign = FollowingModel { axes: vec![drive(AxisLetter::C)], ..FollowingModel::default() };
    let status = with_drives(&mut clients, "lathe", "wrong", foreign).await.expect_err("refused");
    assert_eq!(violated_fields(&status), [field("axes[0].axis")]);
    // Just stable is stable.
    let stable = AxisFollowingModel {
        position_loop_gain_per_s: Some(75.0),
        velocity_loop_frequency_hz: Some(15.0),
        velocity_loop_damping: Some(0.4),
        ..drive(AxisLetter::X)
    };
    let model = FollowingModel { axes: vec![stable], ..FollowingModel::default() };
    with_drives(&mut clients, "lathe", "right", model).await.expect("the machine is made");
}
