//! The promise of `path_limits`: a feed within them and a superposed motion within its peaks keep every axis within its
//! limits, on lines, arcs, inexact arcs and helices in any direction.

use std::f64::consts::TAU;

use feedwave_motion::{Element, Machine, MachineAxis, PathMotion, Profile, Quantity, path_limits};
use feedwave_program::{ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle};
use proptest::prelude::*;

fn element(start: Position, end: Position, arc: Option<ArcGeometry>) -> Element {
    let mv = Move {
        kind: MoveKind::Cutting,
        start,
        end,
        work_offset: [0.0; 9],
        arc,
        feed: Feed::PerMinute(1.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        cycle: None,
        leads_xyz: false,
    };
    Element::from_move(&mv, SourceSpan::default()).expect("it moves")
}

fn position(x: f64, y: f64, z: f64) -> Position {
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn elements() -> impl Strategy<Value = Element> {
    let line = prop::array::uniform3(-40.0..40.0_f64).prop_map(|[x, y, z]| element([0.0; 9], position(x, y, z), None));
    let sweep = prop_oneof![0.05..2.0 * TAU, -2.0 * TAU..-0.05];
    let rise = prop_oneof![Just(0.0), -30.0..30.0_f64];
    let error = prop_oneof![Just(0.0), -0.01..0.01_f64];
    let arc = (0.05..60.0_f64, 0.0..TAU, sweep, rise, error).prop_map(|(radius, angle, sweep_rad, rise, error)| {
        let at = |angle: f64, radius: f64, z: f64| position(radius * angle.cos(), radius * angle.sin(), z);
        let clockwise = sweep_rad < 0.0;
        let arc = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise, sweep_rad };
        element(at(angle, radius, 0.0), at(angle + sweep_rad, radius + error, rise), Some(arc))
    });
    prop_oneof![1 => line.prop_filter("it moves", |line| line.length > 1.0), 3 => arc]
}

/// Unlike axes: 50 to 1000 mm/s, 500 to 20 000 mm/s², and a jerk that takes 5 to 50 ms to full acceleration.
fn machines() -> impl Strategy<Value = Machine> {
    let axis = || (50.0..1_000.0_f64, 500.0..20_000.0_f64, 0.005..0.05_f64);
    [axis(), axis(), axis()].prop_map(|axes| {
        let axis = |(axis, (velocity, acceleration, ramp_s)): (Axis, (f64, f64, f64))| {
            MachineAxis::new(axis, velocity, acceleration, acceleration / ramp_s)
        };
        let axes = [Axis::X, Axis::Y, Axis::Z].into_iter().zip(axes).map(axis).collect();
        Machine { axes, ..Machine::mill() }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn feed_and_vibration_together_keep_every_axis_within_its_limits(
        element in elements(), machine in machines(), frequency_hz in 2.0..80.0_f64,
        share in prop_oneof![Just(0.0), 0.01..0.9_f64], phase in 0.0..TAU,
    ) {
        // A sine that takes the share of what is there without it.
        let rad_per_s = TAU * frequency_hz;
        let alone = path_limits(&element, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let amplitude_mm = share * (alone.velocity / rad_per_s)
            .min(alone.acceleration / (rad_per_s * rad_per_s))
            .min(alone.jerk / (rad_per_s * rad_per_s * rad_per_s));
        let peaks = PathMotion {
            velocity: rad_per_s * amplitude_mm,
            acceleration: rad_per_s * rad_per_s * amplitude_mm,
            jerk: rad_per_s * rad_per_s * rad_per_s * amplitude_mm,
        };
        let Ok(limits) = path_limits(&element, &machine, peaks) else {
            // Only a real vibration is refused.
            prop_assert!(share > 0.0);
            return Ok(());
        };
        prop_assert!(limits.velocity > 0.0 && limits.acceleration > 0.0 && limits.jerk > 0.0);
        let margin_mm = amplitude_mm;
        prop_assume!(element.length > 4.0 * margin_mm);
        let profile = Profile::solve(element.length - 2.0 * margin_mm, 0.0, 0.0, limits).expect("rest to rest");

        // Differences over h average the derivative over 3·h, which never exceeds its bound, whatever h. Positions up
        // to 100 mm round to 2e-14 mm, an arc's angle (up to 19 rad) and the length to 4e-15 of 100 mm: with 1e-12 mm
        // for each position the third difference is off by 8e-12/h³.
        let h = (profile.duration() / 1_500.0).max(2e-4);
        let noise_mm = 1e-12;
        let samples = (profile.duration() / h) as usize;
        let at = |k: usize| {
            let t = k as f64 * h;
            element.position(margin_mm + profile.state(t).0 + amplitude_mm * (rad_per_s * t + phase).sin())
        };
        for k in 3..=samples {
            let p = [at(k - 3), at(k - 2), at(k - 1), at(k)];
            for (column, axis) in machine.axes.iter().enumerate() {
                let [p0, p1, p2, p3] = p.map(|position| position[column]);
                let found = [
                    (Quantity::Velocity, (p3 - p2) / h, axis.max_velocity_per_s, 2.0 * noise_mm / h),
                    (Quantity::Acceleration, (p3 - 2.0 * p2 + p1) / (h * h), axis.max_acceleration_per_s2, 4.0 * noise_mm / (h * h)),
                    (Quantity::Jerk, (p3 - 3.0 * p2 + 3.0 * p1 - p0) / (h * h * h), axis.max_jerk_per_s3, 8.0 * noise_mm / (h * h * h)),
                ];
                for (quantity, value, limit, noise) in found {
                    prop_assert!(
                        value.abs() <= limit * (1.0 + 1e-6) + noise,
                        "{quantity} {value} of {} exceeds {limit}", axis.name
                    );
                }
            }
        }
    }

    #[test]
    fn without_vibration_a_line_gets_all_that_its_axes_give(
        by in prop::array::uniform3(-40.0..40.0_f64), machine in machines(),
    ) {
        prop_assume!(by.iter().any(|delta| delta.abs() > 1e-3));
        let line = element([0.0; 9], position(by[0], by[1], by[2]), None);
        let limits = path_limits(&line, &machine, PathMotion::ZERO).expect("nothing is superposed");
        let tangent = line.tangent(0.0);
        // Each limit is reached by one axis exactly and exceeded by none.
        for (path, of) in [
            (limits.velocity, (|axis| axis.max_velocity_per_s) as fn(&MachineAxis) -> f64),
            (limits.acceleration, |axis| axis.max_acceleration_per_s2),
            (limits.jerk, |axis| axis.max_jerk_per_s3),
        ] {
            let used = machine.axes.iter().enumerate().map(|(k, axis)| tangent[k].abs() * path / of(axis)).fold(0.0, f64::max);
            prop_assert!((used - 1.0).abs() < 1e-12, "{used}");
        }
    }
}

#[test]
fn a_vibration_that_leaves_no_fiftieth_is_refused_with_axis_and_figures() {
    let machine = Machine { axes: vec![MachineAxis::new(Axis::X, 100.0, 1_000.0, 50_000.0)], ..Machine::lathe() };
    let line = element([0.0; 9], position(50.0, 0.0, 0.0), None);
    let with = |velocity: f64, acceleration: f64, jerk: f64| {
        path_limits(&line, &machine, PathMotion { velocity, acceleration, jerk })
    };
    let limits = with(98.0, 980.0, 49_000.0).expect("a fiftieth is left");
    assert!((limits.velocity - 2.0).abs() < 1e-12 && (limits.acceleration - 20.0).abs() < 1e-12);
    for (refused, quantity, demanded, limit) in [
        (with(98.1, 0.0, 0.0), Quantity::Velocity, 98.1, 100.0),
        (with(0.0, 981.0, 0.0), Quantity::Acceleration, 981.0, 1_000.0),
        (with(0.0, 0.0, 60_000.0), Quantity::Jerk, 60_000.0, 50_000.0),
    ] {
        let refused = refused.expect_err("too little is left");
        assert_eq!(
            (refused.axis, refused.quantity, refused.demanded, refused.limit),
            (Axis::X, quantity, demanded, limit)
        );
    }
    let message = with(0.0, 981.0, 0.0).expect_err("too little is left").to_string();
    assert!(message.contains("981.0 mm/s²") && message.contains("the X axis' acceleration"), "{message}");
}

#[test]
fn travel_is_checked_over_the_whole_curve_in_machine_coordinates() {
    use feedwave_motion::{CarriedBy, missing_axis, travel_exceeded};
    let mut machine = Machine::mill();
    machine.axes[1].travel_max = Some(9.0);
    let arc = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: TAU / 2.0 };
    // Both ends lie at Y0, the top of the arc at Y10.
    let mut half = element(position(10.0, 0.0, 0.0), position(-10.0, 0.0, 0.0), Some(arc));
    let exceeded = travel_exceeded(&half, &machine).expect("the top lies beyond");
    assert_eq!((exceeded.axis, exceeded.limit), (Axis::Y, 9.0));
    assert!((exceeded.value - 10.0).abs() < 1e-12);
    half.work_offset[1] = -1.5;
    assert_eq!(travel_exceeded(&half, &machine), None);
    // An axis that carries the workpiece moves in the opposite direction: −(10 − 1.5).
    machine.axes[1].carried_by = CarriedBy::Workpiece;
    machine.axes[1].travel_min = Some(-8.0);
    assert!((travel_exceeded(&half, &machine).expect("below").value + 8.5).abs() < 1e-12);

    assert_eq!(missing_axis(&half, &machine), None);
    machine.axes.remove(1);
    assert_eq!(missing_axis(&half, &machine), Some(Axis::Y));
    assert_eq!(missing_axis(&element([0.0; 9], position(1.0, 0.0, 0.0), None), &machine), None);
}
