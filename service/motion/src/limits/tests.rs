use core::f64::consts::TAU;

use feedwave_program::{ArcGeometry, Feed, Move, MoveKind, PathControl, Plane, SourceSpan, Spindle};
use proptest::prelude::*;

use super::*;

/// A helix, or an arc whose radius grows by `error` along it.
fn arc(radius: f64, angle: f64, sweep_rad: f64, rise: f64, error: f64) -> Element {
    let at = |angle: f64, radius: f64, z: f64| -> Position {
        [radius * libm::cos(angle), radius * libm::sin(angle), z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    };
    let mv = Move {
        kind: MoveKind::Cutting,
        start: at(angle, radius, 0.0),
        end: at(angle + sweep_rad, radius + error, rise),
        work_offset: [0.0; 9],
        arc: Some(ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: sweep_rad < 0.0, sweep_rad }),
        feed: Feed::PerMinute(1.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        leads_xyz: false,
        cycle: None,
    };
    Element::from_move(&mv, SourceSpan::default()).expect("it moves")
}

fn machine(axes: [(f64, f64, f64); 3]) -> Machine {
    let axis = |(axis, (velocity, acceleration, jerk))| MachineAxis::new(axis, velocity, acceleration, jerk);
    Machine { axes: [Axis::X, Axis::Y, Axis::Z].into_iter().zip(axes).map(axis).collect(), ..Machine::mill() }
}

fn axes() -> impl Strategy<Value = [(f64, f64, f64); 3]> {
    let power = |exponent: f64| 10.0_f64.powf(exponent);
    let axis =
        move || (1.0..3.0_f64, 2.0..5.0_f64, 3.0..8.0_f64).prop_map(move |(v, a, j)| (power(v), power(a), power(j)));
    [axis(), axis(), axis()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// Not what a profile happens to do, but the worst that the limits allow, everywhere on the curve.
    #[test]
    fn no_mixture_of_speed_acceleration_and_jerk_within_the_limits_exceeds_an_axis(
        radius_exponent in -2.0..3.0_f64, angle in 0.0..TAU, sweep in prop_oneof![0.05..2.0 * TAU, -2.0 * TAU..-0.05],
        pitch in prop_oneof![Just(0.0), -2.0..2.0_f64], error in prop_oneof![Just(0.0), -0.9..0.9_f64], axes in axes(),
        superposed in prop::array::uniform3(prop_oneof![Just(0.0), 0.0..0.5_f64]),
    ) {
        let radius = 10.0_f64.powf(radius_exponent);
        let element = arc(radius, angle, sweep, pitch * radius * sweep.abs(), error * radius);
        let machine = machine(axes);
        let alone = path_limits(&element, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let peaks = PathMotion {
            velocity: superposed[0] * alone.velocity,
            acceleration: superposed[1] * alone.acceleration,
            jerk: superposed[2] * alone.jerk,
        };
        let Ok(limits) = path_limits(&element, &machine, peaks) else { return Ok(()) };
        prop_assert!(limits.velocity > 0.0 && limits.acceleration > 0.0 && limits.jerk > 0.0);
        let (v, a, j) = (limits.velocity + peaks.velocity, limits.acceleration + peaks.acceleration, limits.jerk + peaks.jerk);
        for k in 0..=200 {
            let s = element.length * f64::from(k) / 200.0;
            let [first, second, third] = element.derivatives(s);
            for (column, axis) in machine.axes.iter().enumerate() {
                let (first, second, third) = (first[column], second[column], third[column]);
                prop_assert!((v * first).abs() <= axis.max_velocity_per_s * (1.0 + 1e-9));
                for a in [-a, a] {
                    let acceleration = a * first + v * v * second;
                    prop_assert!(acceleration.abs() <= axis.max_acceleration_per_s2 * (1.0 + 1e-9), "{acceleration}");
                    for j in [-j, j] {
                        let jerk = j * first + 3.0 * v * a * second + v * v * v * third;
                        prop_assert!(jerk.abs() <= axis.max_jerk_per_s3 * (1.0 + 1e-9), "{jerk} of {}", axis.max_jerk_per_s3);
                    }
                }
            }
        }
    }
}

#[test]
fn a_circle_leaves_what_its_formulas_say() {
    // r 10 mm, a 1000, j 1e9: v = √(0.8·1000·10) = 89.44 mm/s, a = 0.6·1000; jerk is far away.
    let circle = arc(10.0, 0.0, TAU, 0.0, 0.0);
    let limits = path_limits(&circle, &machine([(1e3, 1_000.0, 1e9); 3]), PathMotion::ZERO).expect("alone");
    assert!((limits.velocity - 8_000.0_f64.sqrt()).abs() < 1e-9);
    assert!((limits.acceleration - 600.0).abs() < 1e-9);
    // a 1e6, j 20 000: turning may use 0.4·j: v = ∛(0.4·20 000·100) = 92.83 mm/s; 0.4·j is left for the feed, and
    // a = 0.6·j·r/(3·v) = 430.9.
    let limits = path_limits(&circle, &machine([(1e3, 1e6, 20_000.0); 3]), PathMotion::ZERO).expect("alone");
    assert!((limits.velocity - libm::cbrt(800_000.0)).abs() < 1e-9);
    assert!((limits.jerk - 8_000.0).abs() < 1e-6);
    assert!((limits.acceleration - 40_000.0 / limits.velocity).abs() < 1e-9);
}
