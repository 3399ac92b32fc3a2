//! The transfer function against its differential equation, integrated step by step.

use core::f64::consts::{PI, TAU};

use proptest::prelude::*;

use super::*;

/// A drive as it is written in this file.
fn drive(filter_length_s: f64, gain_per_s: f64, velocity_loop: Option<(f64, Option<f64>)>, forward: f64) -> DriveModel {
    DriveModel {
        filter_length_s: (filter_length_s > 0.0).then_some(filter_length_s),
        position_loop_gain_per_s: (gain_per_s > 0.0).then_some(gain_per_s),
        velocity_loop_frequency_hz: velocity_loop.map(|(frequency_hz, _)| frequency_hz),
        velocity_loop_damping: velocity_loop.and_then(|(_, damping)| damping),
        velocity_feed_forward: forward,
    }
}

/// Drives of every order, with and without filter and feed-forward.
fn drives() -> Vec<DriveModel> {
    vec![
        drive(0.0, 60.0, None, 0.0),
        drive(0.0, 60.0, None, 0.7),
        drive(0.004, 120.0, None, 0.4),
        drive(0.0, 150.0, Some((40.0, None)), 0.0),
        drive(0.003, 150.0, Some((40.0, None)), 0.9),
        drive(0.0, 200.0, Some((25.0, None)), 0.0),
        drive(0.0, 80.0, Some((60.0, Some(0.7))), 0.0),
        drive(0.002, 80.0, Some((60.0, Some(0.7))), 1.0),
        drive(0.0, 30.0, Some((15.0, Some(0.4))), 0.5),
    ]
}

/// v·t + A·sin(ωt + φ).
#[derive(Clone, Copy)]
struct Command {
    velocity: f64,
    amplitude: f64,
    rad_per_s: f64,
    phase_rad: f64,
}

impl Command {
    /// Value and derivative of the command behind a moving average, by the integral in closed form.
    fn filtered(&self, time_s: f64, length_s: Option<f64>) -> (f64, f64) {
        let angle = |time_s: f64| self.rad_per_s * time_s + self.phase_rad;
        match length_s {
            None => (
                self.velocity * time_s + self.amplitude * angle(time_s).sin(),
                self.velocity + self.amplitude * self.rad_per_s * angle(time_s).cos(),
            ),
            Some(length_s) => (
                self.velocity * (time_s - 0.5 * length_s)
                    + self.amplitude * (angle(time_s - length_s).cos() - angle(time_s).cos())
                        / (self.rad_per_s * length_s),
                self.velocity + self.amplitude * (angle(time_s).sin() - angle(time_s - length_s).sin()) / length_s,
            ),
        }
    }
}

/// Derivatives of position, velocity and acceleration of a drive: a₂·v̈ + a₁·v̇ + v = K·(r − x) + k·ṙ.
fn rates(drive: &DriveModel, [x, v, a]: [f64; 3], (r, r_rate): (f64, f64)) -> [f64; 3] {
    let wanted = drive.position_loop_gain_per_s.expect("a loop") * (r - x) + drive.velocity_feed_forward * r_rate;
    let rad_per_s = drive.velocity_loop_frequency_hz.map(|frequency_hz| TAU * frequency_hz);
    match (rad_per_s, drive.velocity_loop_damping) {
        (None, _) => [wanted, 0.0, 0.0],
        (Some(rad_per_s), None) => [v, (wanted - v) * rad_per_s, 0.0],
        (Some(rad_per_s), Some(damping)) => [v, a, rad_per_s * (rad_per_s * (wanted - v) - 2.0 * damping * a)],
    }
}

/// Positions of a drive at every step from `from` to `steps` of a simulation by Runge and Kutta's method of fourth order.
fn simulate(
    drive: &DriveModel,
    command: impl Fn(f64) -> (f64, f64),
    step_s: f64,
    from: usize,
    steps: usize,
) -> Vec<f64> {
    let mut state = [0.0; 3];
    let mut positions = Vec::with_capacity(steps - from);
    for step in 0..steps {
        if step >= from {
            positions.push(state[0]);
        }
        let time_s = step as f64 * step_s;
        let ahead = |rates: [f64; 3], share: f64| core::array::from_fn(|i| state[i] + share * step_s * rates[i]);
        let (start, middle, end) = (command(time_s), command(time_s + 0.5 * step_s), command(time_s + step_s));
        let one = rates(drive, state, start);
        let two = rates(drive, ahead(one, 0.5), middle);
        let three = rates(drive, ahead(two, 0.5), middle);
        let four = rates(drive, ahead(three, 1.0), end);
        for i in 0..3 {
            state[i] += step_s / 6.0 * (one[i] + 2.0 * (two[i] + three[i]) + four[i]);
        }
    }
    positions
}

/// Steps in a period, and periods until the start is forgotten: e⁻²⁰ of the slowest drive here at the lowest frequency.
const STEPS: usize = 2_000;

fn periods(frequency_hz: f64) -> usize {
    (1.5 * frequency_hz).ceil() as usize + 1
}

/// One period of a drive's steady state.
fn steady(drive: &DriveModel, command: Command, step_s: f64, steps_before: usize) -> Vec<f64> {
    let at = |time_s| command.filtered(time_s, drive.filter_length_s);
    simulate(drive, at, step_s, steps_before, steps_before + STEPS)
}

#[test]
fn gain_and_lag_are_those_of_the_differential_equation() {
    for drive in drives() {
        assert_eq!(drive.problems(), [], "{drive:?}");
        for frequency_hz in [5.0, 23.0, 61.0] {
            let step_s = 1.0 / (frequency_hz * STEPS as f64);
            let command = Command { velocity: 0.0, amplitude: 1.0, rad_per_s: TAU * frequency_hz, phase_rad: 0.0 };
            let arriving = steady(&drive, command, step_s, periods(frequency_hz) * STEPS);
            let (mut sine, mut cosine) = (0.0, 0.0);
            for (step, x) in arriving.iter().enumerate() {
                let angle = TAU * step as f64 / STEPS as f64;
                sine += 2.0 / STEPS as f64 * x * angle.sin();
                cosine += 2.0 / STEPS as f64 * x * angle.cos();
            }
            let response = drive.response(frequency_hz);
            assert!((sine - response.re).abs() < 1e-6, "{drive:?} at {frequency_hz} Hz: {sine} and {response:?}");
            assert!((cosine - response.im).abs() < 1e-6, "{drive:?} at {frequency_hz} Hz: {cosine} and {response:?}");
            assert!((response.magnitude() - drive.gain(frequency_hz)).abs() < 1e-12);
            // What is commanded instead arrives as it was wanted.
            let command_mm = DriveModel::command_for(0.3, drive.gain(frequency_hz)).unwrap();
            assert!((command_mm * response.magnitude() - 0.3).abs() < 1e-12);
            assert!((response.lag_rad() - drive.lag_rad(frequency_hz)).abs() < 1e-9);
        }
    }
}

#[test]
fn the_error_keeps_its_digits_at_low_frequencies() {
    for drive in drives() {
        for rad_per_s in [1e-6, 1e-3, 1.0, 300.0] {
            let (error, response) = (drive.error(rad_per_s), drive.response(rad_per_s / TAU));
            assert!((error.re - (response.re - 1.0)).abs() < 1e-12, "{drive:?} at {rad_per_s}");
            assert!((error.im - response.im).abs() < 1e-12, "{drive:?} at {rad_per_s}");
            if rad_per_s <= 1e-3 {
                // To first order a steady lag, without which the axis would be ahead.
                let lag = -rad_per_s * drive.steady_lag_s();
                assert!((error.im - lag).abs() < 1e-4 * lag.abs() + 1e-15, "{drive:?}: {} and {lag}", error.im);
            }
        }
    }
}

#[test]
fn axes_that_lag_differently_leave_a_taper_by_what_a_simulation_says() {
    let model = model([drive(0.0, 40.0, None, 0.0), drive(0.003, 150.0, Some((40.0, None)), 0.2)]);
    let (speed, amplitude_mm, frequency_hz) = (25.0, 0.05, 31.0);
    let tangent = [0.6, 0.0, 0.8];
    let place = PathPlace { tangent, curvature: [0.0; 3] };
    let step_s = 1.0 / (frequency_hz * STEPS as f64);
    let before = periods(frequency_hz) * STEPS;
    let simulated = |amplitude: f64| {
        let axis = |at: usize, axis: Axis| {
            let command = Command {
                velocity: speed * tangent[at],
                amplitude: amplitude * tangent[at],
                rad_per_s: TAU * frequency_hz,
                phase_rad: 0.0,
            };
            steady(&model.of(axis), command, step_s, before)
        };
        // Across the path (0.6, 0.8).
        let across = axis(0, Axis::X).into_iter().zip(axis(2, Axis::Z)).map(|(x, z)| (0.8 * x - 0.6 * z).abs());
        across.fold(0.0, f64::max)
    };
    let (feed_mm, vibration_mm) =
        (place.feed_error(&model, speed), amplitude_mm * place.vibration_error(&model, frequency_hz));
    assert!(feed_mm > 0.01 && vibration_mm > 0.001, "{feed_mm}, {vibration_mm}");
    assert!((simulated(0.0) - feed_mm).abs() < 1e-6, "{} and {feed_mm}", simulated(0.0));
    let together = simulated(amplitude_mm);
    assert!((together - feed_mm - vibration_mm).abs() < 1e-6, "{together} and {feed_mm} + {vibration_mm}");
}

#[test]
fn a_circle_shrinks_and_leans_by_what_a_simulation_says() {
    let (radius_mm, speed) = (12.0, 40.0);
    let rad_per_s = speed / radius_mm;
    let frequency_hz = rad_per_s / TAU;
    let step_s = 1.0 / (frequency_hz * STEPS as f64);
    let same = drive(0.002, 30.0, None, 0.0);
    for drives in [[same, same], [drive(0.0, 20.0, None, 0.3), drive(0.004, 90.0, Some((30.0, Some(0.8))), 0.0)]] {
        let model = model(drives);
        let axis = |axis: Axis, phase_rad| {
            let command = Command { velocity: 0.0, amplitude: radius_mm, rad_per_s, phase_rad };
            steady(&model.of(axis), command, step_s, 6 * STEPS)
        };
        let points = axis(Axis::X, 0.5 * PI).into_iter().zip(axis(Axis::Z, 0.0));
        let simulated = points.map(|(x, z)| (x.hypot(z) - radius_mm).abs()).fold(0.0, f64::max);
        let place = |angle: f64| PathPlace {
            tangent: [-angle.sin(), 0.0, angle.cos()],
            curvature: [-angle.cos() / radius_mm, 0.0, -angle.sin() / radius_mm],
        };
        let (most, _) = largest_between(TAU, |angle| place(angle).feed_error(&model, speed));
        assert!(most > 0.01, "{most}");
        assert!((most - simulated).abs() < 1e-6 * radius_mm, "{most} and {simulated}");
    }
}

#[test]
fn a_helix_of_no_curvature_is_a_line() {
    let model = model([drive(0.0, 40.0, None, 0.0), drive(0.0, 90.0, None, 0.0)]);
    let tangent = [0.6, 0.0, 0.8];
    let line = PathPlace { tangent, curvature: [0.0; 3] }.feed_error(&model, 20.0);
    let wide = PathPlace { tangent, curvature: [0.8e-11, 0.0, -0.6e-11] }.feed_error(&model, 20.0);
    assert!((line - wide).abs() < 1e-7, "{line} and {wide}");
}

#[test]
fn a_wave_with_holds_arrives_as_a_simulation_says() {
    // Held for 0.3 of the period at each end, with ramps of a sine.
    let wave = |turns: f64| {
        let turns = turns - turns.round();
        let quarter = turns.abs().min(0.5 - turns.abs());
        (TAU * (quarter / 0.4).min(0.25)).sin().copysign(turns)
    };
    let harmonics = Harmonics::of(wave);
    for drive in [drive(0.0, 60.0, None, 0.0), drive(0.0, 150.0, Some((40.0, None)), 0.0)] {
        let frequency_hz = 10.0;
        let step_s = 1.0 / (frequency_hz * STEPS as f64);
        let command = |time_s: f64| (wave(frequency_hz * time_s), 0.0);
        let arriving = simulate(&drive, command, step_s, 20 * STEPS, 21 * STEPS);
        let most = arriving.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = arriving.iter().copied().fold(f64::INFINITY, f64::min);
        let (simulated, predicted) = (0.5 * (most - least), harmonics.through(&drive, frequency_hz).amplitude);
        assert!((simulated - predicted).abs() < 1e-5, "{simulated} and {predicted}");
    }
    // A sine has one harmonic.
    let sine = Harmonics::of(|turns: f64| 0.4 * (TAU * turns).sin());
    let drive = drive(0.004, 60.0, None, 0.0);
    let arriving = sine.through(&drive, 10.0);
    assert!((arriving.amplitude - 0.4 * drive.gain(10.0)).abs() < 1e-5, "{arriving:?}");
}

/// Drives of X and Z; Y has that of X.
fn model([x, z]: [DriveModel; 2]) -> FollowingModel {
    FollowingModel { common: x, axes: vec![AxisDrive { axis: Axis::Z, drive: z }] }
}

#[test]
fn what_is_not_stated_passes_everything() {
    let model = FollowingModel::default();
    assert!(!model.is_stated());
    let axis = model.axis(Axis::X, 500.0);
    assert_eq!((axis.gain, axis.lag_rad), (1.0, 0.0));
    assert_eq!(model.common.error(300.0), Response::default());
    let place = PathPlace { tangent: [0.6, 0.0, 0.8], curvature: [0.1, 0.0, -0.075] };
    assert_eq!((place.feed_error(&model, 100.0), place.vibration_error(&model, 50.0)), (0.0, 0.0));
}

#[test]
fn a_twenty_millisecond_filter_erases_fifty_hertz() {
    let filter = drive(0.02, 0.0, None, 0.0);
    assert!(filter.gain(50.0) < 1e-15, "gain {}", filter.gain(50.0));
    assert_eq!(DriveModel::command_for(0.03, filter.gain(50.0)), None);
    assert!((filter.gain(25.0) - 2.0 / PI).abs() < 1e-15);
    assert!((filter.lag_rad(25.0) - 0.5 * PI).abs() < 1e-15);
    // Beyond its first zero the gain has the other sign: half a turn.
    assert!((filter.lag_rad(75.0) - 0.5 * PI).abs() < 1e-12);
}

#[test]
fn the_position_loop_halves_the_power_at_its_corner() {
    let first_order = drive(0.0, 100.0, None, 0.0);
    let corner_hz = 100.0 / TAU;
    assert!((first_order.loop_gain(corner_hz) - 0.5f64.sqrt()).abs() < 1e-15);
    assert!((first_order.loop_lag_rad(corner_hz) - PI / 4.0).abs() < 1e-15);
    assert_eq!(first_order.filter_gain(corner_hz), 1.0);
    // With its velocity fed forward whole, an axis without inertia is where it is commanded.
    assert!((drive(0.0, 100.0, None, 1.0).gain(corner_hz) - 1.0).abs() < 1e-15);
}

#[test]
fn every_problem_is_named_with_its_field() {
    let unstable = drive(0.0, 2.0 * 0.4 * TAU * 15.0, Some((15.0, Some(0.4))), 0.0);
    let model = FollowingModel {
        common: drive(0.0, 0.0, Some((40.0, Some(f64::NAN))), 1.5),
        axes: vec![
            AxisDrive { axis: Axis::X, drive: unstable },
            AxisDrive { axis: Axis::X, drive: drive(-1.0, 0.0, None, 0.0) },
            AxisDrive {
                axis: Axis::C,
                drive: DriveModel { velocity_loop_damping: Some(0.7), ..drive(0.0, 50.0, None, 0.0) },
            },
        ],
    };
    let fields = |axes: &[Axis]| model.problems(axes).into_iter().map(|problem| problem.field).collect::<Vec<_>>();
    let expected = [
        "velocity_loop_damping",
        "velocity_feed_forward",
        "velocity_loop_frequency_hz",
        "velocity_feed_forward",
        "axes[0].position_loop_gain_per_s",
        "axes[1].axis",
        "axes[2].axis",
        "axes[2].velocity_loop_damping",
    ];
    assert_eq!(fields(&[Axis::X, Axis::Y, Axis::Z]), expected);
    assert_eq!(fields(&[Axis::X, Axis::Z])[4..], ["axes"]);
}

proptest! {
    /// A loop that is refused would swing up, and one that is not calms down.
    #[test]
    fn the_bound_of_stability_is_that_of_the_simulation(
        frequency_hz in 5.0..80.0f64, damping in 0.1..1.5f64, below in 0.3..0.95f64,
    ) {
        let critical = 2.0 * damping * TAU * frequency_hz;
        let at = |share: f64| drive(0.0, share * critical, Some((frequency_hz, Some(damping))), 0.0);
        prop_assert_eq!(at(below).problems(), []);
        prop_assert_eq!(at(1.0 / below).problems().len(), 1);
        let step_s = 1.0 / (400.0 * frequency_hz * (1.0 + damping));
        let swing = |drive: &DriveModel| {
            let positions = simulate(drive, |_| (1.0, 0.0), step_s, 0, 40_000);
            let largest = |part: &[f64]| part.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max);
            (largest(&positions[..8_000]), largest(&positions[32_000..]))
        };
        let (early, late) = swing(&at(below));
        prop_assert!(late < early, "{} and {}", early, late);
        let (early, late) = swing(&at(1.0 / below));
        prop_assert!(late > early, "{} and {}", early, late);
    }
}
