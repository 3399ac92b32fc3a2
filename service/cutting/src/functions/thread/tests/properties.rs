//! What holds for every pass.

use proptest::prelude::*;

use super::*;

fn any_pass() -> impl Strategy<Value = ThreadPass> {
    (0.0..2.0_f64, -5.0..5.0_f64, 0.0..360.0_f64, 0.0..3.0_f64, -720.0..720.0_f64).prop_map(
        |(depth_mm, start_travel_mm, start_angle_deg, amplitude_mm, phase_shift_deg)| ThreadPass {
            depth_mm,
            start_travel_mm,
            start_angle_deg,
            amplitude_mm,
            phase_shift_deg,
            ..ThreadPass::default()
        },
    )
}

proptest! {
    #[test]
    fn the_tool_is_never_deeper_than_programmed(
        pass in any_pass(),
        angle_deg in -720.0..20_000.0_f64,
        vibrations_per_rev in 0.1..20.0_f64,
        taper in -0.3..0.3_f64,
        internal in any::<bool>(),
        delayed in any::<bool>(),
    ) {
        let mut job = job(vec![pass]);
        job.vibrations_per_rev = vibrations_per_rev;
        job.geometry.taper = taper;
        job.start_up = if delayed { StartUp::Delayed } else { StartUp::Preparatory };
        if internal {
            job.geometry.side = ThreadSide::Internal;
        }
        let tool = job.position(&pass, angle_deg);
        prop_assert!((0.0..=pass.amplitude_mm).contains(&tool.retreat_mm));
        let programmed_mm = job.geometry.across_mm(pass.depth_mm, tool.travel_mm);
        if internal {
            prop_assert!(tool.radius_mm <= programmed_mm);
        } else {
            prop_assert!(tool.radius_mm >= programmed_mm);
        }
    }

    #[test]
    fn the_phase_belongs_to_the_spindle_angle_alone(
        pass in any_pass(),
        other_start in any_pass(),
        angle_deg in 720.0..20_000.0_f64,
        other_speed in 1.0..5_000.0_f64,
    ) {
        // Another start angle, start position, start-up and speed: the same retreat after the start.
        let one = job(vec![pass]);
        let mut two = ThreadJob { spindle_rev_per_min: other_speed, start_up: StartUp::Delayed, ..one.clone() };
        two.run_up.angle_deg = 90.0;
        let moved = ThreadPass {
            start_angle_deg: other_start.start_angle_deg,
            start_travel_mm: other_start.start_travel_mm,
            ..pass
        };
        prop_assert_eq!(one.position(&pass, angle_deg).retreat_mm, two.position(&moved, angle_deg).retreat_mm);
    }

    #[test]
    fn both_start_ups_agree_after_the_start(mut pass in any_pass(), turning in any::<bool>(), after_deg in 0.0..5_000.0_f64) {
        // At a turning point of the wave start-up A is in phase from the reference point on.
        if turning {
            pass.phase_shift_deg = 180.0 * (pass.phase_shift_deg / 180.0).round();
        }
        let prepared = job(vec![pass]);
        let delayed = ThreadJob { start_up: StartUp::Delayed, ..prepared.clone() };
        let wave = prepared.wave(&pass);
        let start_deg = wave.start_deg(StartUp::Delayed);
        prop_assert!((0.0..360.0 / prepared.vibrations_per_rev).contains(&start_deg));
        let prepared_deg = wave.in_phase_deg(StartUp::Preparatory);
        prop_assert_eq!(prepared_deg, if wave.starts_within() { 720.0 / prepared.vibrations_per_rev } else { 0.0 });
        let angle_deg = start_deg.max(prepared_deg) + after_deg;
        prop_assert_eq!(prepared.position(&pass, angle_deg), delayed.position(&pass, angle_deg));
        // And it starts from phase 0, without a step.
        prop_assert!(wave.retreat_mm(StartUp::Delayed, start_deg + 1e-6) < 1e-6);
        // The prepared position is where the vibration starts.
        let before_mm = wave.retreat_mm(StartUp::Preparatory, -1.0);
        prop_assert_eq!(before_mm, wave.retreat_mm(StartUp::Preparatory, 0.0));
    }

    #[test]
    fn a_vibration_starts_from_rest_whatever_its_shift(
        amplitude_mm in 0.01..3.0_f64,
        vibrations_per_rev in 0.3..8.0_f64,
        phase_shift_deg in -720.0..720.0_f64,
        delayed in any::<bool>(),
    ) {
        let start_up = if delayed { StartUp::Delayed } else { StartUp::Preparatory };
        let wave = RetreatWave { amplitude_mm, vibrations_per_rev, phase_shift_deg };
        // Peaks of the vibration for one radian of the spindle, and differences over a thousandth of a vibration.
        let rate = vibrations_per_rev;
        let step_deg = 0.36 / vibrations_per_rev;
        let step = step_deg.to_radians();
        let (velocity, acceleration) = (0.5 * amplitude_mm * rate, 0.5 * amplitude_mm * rate * rate);
        let at = |k: i32| wave.retreat_mm(start_up, f64::from(k) * step_deg);
        for k in -20..3_000 {
            let [p0, p1, p2] = [at(k), at(k + 1), at(k + 2)];
            prop_assert!((0.0..=amplitude_mm).contains(&p0));
            prop_assert!((p1 - p0).abs() <= velocity * step * (1.0 + 1e-9) + 1e-13, "velocity at {k}");
            let bend = (p2 - 2.0 * p1 + p0).abs();
            prop_assert!(bend <= acceleration * step * step * (1.0 + 1e-9) + 1e-13, "acceleration at {k}");
        }
    }

    #[test]
    fn a_start_in_the_middle_of_the_wave_takes_little_more_jerk(
        vibrations_per_rev in 0.3..8.0_f64,
        phase_shift_deg in 1.0..179.0_f64,
    ) {
        let wave = RetreatWave { amplitude_mm: 1.0, vibrations_per_rev, phase_shift_deg };
        let step_deg = 3.6 / vibrations_per_rev;
        let jerk = 0.5 * (vibrations_per_rev * step_deg.to_radians()).powi(3);
        let at = |k: i32| wave.retreat_mm(StartUp::Preparatory, f64::from(k) * step_deg);
        for k in -5..300 {
            let found = (at(k + 3) - 3.0 * at(k + 2) + 3.0 * at(k + 1) - at(k)).abs();
            prop_assert!(found <= jerk * (1.0 + START_JERK), "{} of {jerk} at {k}", found);
        }
    }

    #[test]
    fn a_thread_played_by_a_wandering_spindle_is_the_same_thread(
        pass in any_pass(),
        speeds in prop::collection::vec(50.0..3_000.0_f64, 20),
    ) {
        // Angle instead of time is what the generator is asked for; X over Z is then independent of the speeds.
        let job = job(vec![pass]);
        let mut angle_deg = 0.0;
        for speed in speeds {
            angle_deg += 6.0 * speed * 0.01;
            let tool = job.position(&pass, angle_deg);
            let travel_mm = tool.travel_mm - pass.start_travel_mm;
            // Until then it is starting up.
            let is_in_phase = angle_deg >= job.wave(&pass).in_phase_deg(job.start_up);
            if travel_mm > 0.0 && tool.travel_mm < job.geometry.length_mm() && is_in_phase {
                let by_lead_deg = pass.start_angle_deg + 360.0 * travel_mm / job.geometry.lead_mm;
                prop_assert!((by_lead_deg - angle_deg).abs() < 1e-6);
                let phase_deg = 2.0 * by_lead_deg - pass.phase_shift_deg;
                let expected_mm = 0.5 * pass.amplitude_mm * (1.0 - libm::cos(phase_deg.to_radians()));
                prop_assert!((tool.retreat_mm - expected_mm).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_thread_along_x_is_one_along_z_with_the_axes_exchanged(
        pass in any_pass(),
        angle_deg in -720.0..20_000.0_f64,
        taper in -0.9..0.9_f64,
        internal in any::<bool>(),
    ) {
        let mut job = job(vec![pass]);
        job.geometry.taper = taper;
        job.geometry.side = if internal { ThreadSide::Internal } else { ThreadSide::External };
        let face = ThreadJob { geometry: ThreadGeometry { lead_axis: LeadAxis::X, ..job.geometry }, ..job.clone() };
        let (along_z, along_x) = (job.position(&pass, angle_deg), face.position(&pass, angle_deg));
        prop_assert_eq!([along_z.radius_mm, along_z.z_mm], [along_x.z_mm, along_x.radius_mm]);
        prop_assert_eq!(along_z.retreat_mm, along_x.retreat_mm);
        let [by_z, by_x] = [&job, &face].map(|job| ThreadPath::of_pass(job, &pass).at(angle_deg));
        prop_assert_eq!([by_z.radius_mm, by_z.z_mm, by_z.path_mm], [by_x.z_mm, by_x.radius_mm, by_x.path_mm]);
    }

    #[test]
    fn both_methods_cut_the_same_thread(
        offset_mm in 0.0..1.2_f64,
        shift_deg in 0.0..360.0_f64,
        vibrations_per_rev in 0.5..6.0_f64,
    ) {
        let first = ThreadPass { depth_mm: 0.4, amplitude_mm: 0.6, ..ThreadPass::default() };
        let second = ThreadPass { depth_mm: 0.7, amplitude_mm: 0.6, ..ThreadPass::default() };
        let by_place = ThreadPass { start_travel_mm: offset_mm, phase_shift_deg: shift_deg, ..second };
        let start_angle_deg = reduce_deg(-360.0 * offset_mm / 2.5);
        let mut one = job(vec![first, by_place]);
        one.vibrations_per_rev = vibrations_per_rev;
        let turns = if start_angle_deg > 0.0 { 1.0 } else { 0.0 };
        // The revolution in between is compensated where D is not whole.
        let by_angle = ThreadPass {
            start_angle_deg,
            phase_shift_deg: reduce_deg(shift_deg + 360.0 * vibrations_per_rev * turns),
            ..second
        };
        let two = ThreadJob { passes: vec![first, by_angle], ..one.clone() };
        let (a, b) = (one.place(1), two.place(1));
        prop_assert!((a.axial_offset_mm - b.axial_offset_mm).abs() < 1e-9);
        let apart_deg = reduce_deg(a.phase_shift_deg - b.phase_shift_deg);
        prop_assert!(apart_deg.min(360.0 - apart_deg) < 1e-6);
        // At half a vibration per revolution the start-up takes four revolutions.
        let angle_deg = 2_000.0;
        let (x, y) = (one.position(&by_place, angle_deg), two.position(&by_angle, angle_deg + 360.0 * turns));
        prop_assert!((x.travel_mm - y.travel_mm).abs() < 1e-9 && (x.radius_mm - y.radius_mm).abs() < 1e-9);
    }

    #[test]
    fn the_run_up_is_smooth_and_then_exact(angle_deg in 0.0..720.0_f64, turned_deg in 0.0..2_000.0_f64) {
        let run_up = RunUp { angle_deg };
        let step = run_up.synchronous_deg(turned_deg + 0.5) - run_up.synchronous_deg(turned_deg);
        prop_assert!((-1e-12..=0.5 + 1e-9).contains(&step));
        if turned_deg >= angle_deg {
            prop_assert!((turned_deg - run_up.synchronous_deg(turned_deg) - run_up.lag_deg()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_pass_ends_at_rest_on_its_end_whatever_its_length(
        run_up_deg in 0.0..720.0_f64,
        length_mm in 0.01..40.0_f64,
        before_deg in 0.0..400.0_f64,
    ) {
        let mut job = job(vec![pass(8.0, 0.0, 0.0)]);
        job.geometry.end_mm = 100.0 - length_mm;
        job.run_up.angle_deg = run_up_deg;
        let pass = job.passes[0];
        let end_deg = job.end_angle_deg(&pass);
        let at = |angle_deg: f64| job.position(&pass, angle_deg).travel_mm;
        prop_assert!((at(end_deg) - length_mm).abs() < 1e-9);
        prop_assert_eq!(at(end_deg + 1.0), at(end_deg + 500.0));
        // Backwards from the end it is a run-up, and the middle has the exact lead.
        let angle_deg = end_deg - before_deg;
        let step_mm = at(angle_deg + 0.5) - at(angle_deg);
        prop_assert!((-1e-12..=2.5 * 0.5 / 360.0 + 1e-9).contains(&step_mm));
        let is_exact = angle_deg > run_up_deg && before_deg > run_up_deg + 0.5;
        if is_exact && job.exact_length_mm(&pass) > 0.0 {
            prop_assert!((step_mm - 2.5 * 0.5 / 360.0).abs() < 1e-9);
        }
    }
}

/// A pass over 38 mm whose vibration takes most of what X can do.
fn watched() -> (ThreadPath, SpindleWatch) {
    let mut job = job(vec![ThreadPass { depth_mm: 0.5, amplitude_mm: 0.6, ..ThreadPass::default() }]);
    let machine = feedwave_motion::Machine::lathe();
    job.run_up = RunUp { angle_deg: 30.0 };
    (ThreadPath::of_pass(&job, &job.passes[0]), SpindleWatch::new(&machine))
}

#[test]
fn the_fastest_spindle_is_where_one_limit_is_reached() {
    let (path, _) = watched();
    let free =
        feedwave_motion::PathLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
    let middle = [2_000.0, 2_001.0];
    // Z: 2.5 mm per revolution. X: half an amplitude of 0.3 mm at two vibrations per revolution.
    let rad = 2.0 * core::f64::consts::TAU;
    for (x, z, expected) in [
        (free, feedwave_motion::PathLimits { velocity: 50.0, ..free }, 20.0),
        (feedwave_motion::PathLimits { velocity: 0.3 * rad, ..free }, free, 1.0),
        (feedwave_motion::PathLimits { acceleration: 0.3 * rad * rad * 4.0, ..free }, free, 2.0),
        (feedwave_motion::PathLimits { jerk: 0.3 * rad * rad * rad * (1.0 + START_JERK) * 27.0, ..free }, free, 3.0),
    ] {
        assert_near(path.fastest_rev_per_s(middle, [x, z]), expected, 1e-9);
    }
    // In the run-up of 30 degrees Z takes 1.5·2.5·u²·12 mm/s².
    let z = feedwave_motion::PathLimits { acceleration: 1.5 * 2.5 * 12.0 * 4.0, ..free };
    assert_near(path.fastest_rev_per_s([10.0, 11.0], [free, z]), 2.0, 1e-9);
    assert_eq!(path.fastest_rev_per_s([-200.0, -100.0], [free, z]), f64::INFINITY, "it rests before");
}

#[test]
fn a_spindle_that_shakes_is_none_that_turns_back() {
    let (path, mut watch) = watched();
    let mut told = Vec::new();
    for k in 0..2_000 {
        let angle_deg = -30.0 + 0.9 * f64::from(k) + if k % 2 == 0 { 2.4 } else { -2.4 };
        told.extend(watch.observe(&path, angle_deg, Some(f64::from(k) * 0.000_5)));
    }
    assert_eq!(told, []);
    let last_deg = 1_770.0;
    assert_eq!(watch.observe(&path, last_deg, None), None);
    let back = watch.observe(&path, last_deg - 5.5, None);
    assert!(matches!(back, Some(SpindleEvent::Reversed { back_deg }) if back_deg > REVERSAL_DEG), "{back:?}");
    assert_eq!(watch.observe(&path, last_deg - 50.0, None), None, "once");
    assert_eq!(watch.observe(&path, last_deg + 1.0, None), Some(SpindleEvent::Regular));
    // Behind the pass it may do what it wants.
    assert_eq!(watch.observe(&path, path.rest_deg() + 1.0, None), None);
    assert_eq!(watch.observe(&path, 0.0, None), None);
}

#[test]
fn a_stop_is_over_only_when_the_spindle_turns_forwards() {
    // How far it turns from the stop, and what is told.
    for (turned_deg, last) in [(-3.0, "Stopped"), (-30.0, "Reversed"), (40.0, "Regular")] {
        let (path, mut watch) = watched();
        let mut told = Vec::new();
        let mut at = |angle_deg: f64, time_s: f64| told.extend(watch.observe(&path, angle_deg, Some(time_s)));
        (0..1_000).for_each(|k| at(f64::from(k), f64::from(k) * 0.001));
        (0..800).for_each(|k| at(1_000.0, 1.0 + f64::from(k) * 0.001));
        (0..100).for_each(|k| at(1_000.0 + turned_deg * f64::from(k) / 100.0, 1.8 + f64::from(k) * 0.001));
        let told: Vec<_> = told.iter().map(|event| format!("{event:?}")).collect();
        assert!(told[0] == "Stopped" && told.len() <= 2, "{told:?}");
        assert!(told[told.len() - 1].starts_with(last), "{turned_deg}: {told:?}");
    }
}

#[test]
fn a_spindle_is_too_fast_for_a_vibration_before_the_lead_as_well() {
    let machine = feedwave_motion::Machine::lathe();
    let late = ThreadPass { depth_mm: 0.5, amplitude_mm: 0.6, start_angle_deg: 300.0, ..ThreadPass::default() };
    let job = job(vec![late]);
    let path = ThreadPath::of_pass(&job, &job.passes[0]);
    let limits = [feedwave_program::Axis::X, feedwave_program::Axis::Z].map(|axis| pass::axis_limits(&machine, axis));
    let fastest = path.fastest_rev_per_s([20.0, 280.0], limits);
    assert!(path.lead_start_deg() >= 300.0 && fastest < 20.0, "{fastest}");
    for (share, is_told) in [(0.9, false), (1.5, true)] {
        let mut watch = SpindleWatch::new(&machine);
        let told: Vec<_> = (-30..290)
            .filter_map(|deg| {
                let angle_deg = f64::from(deg);
                watch.observe(&path, angle_deg, Some(angle_deg / 360.0 / (share * fastest)))
            })
            .collect();
        let is_too_fast = matches!(told.as_slice(), [SpindleEvent::TooFast { .. }]);
        assert_eq!((is_too_fast, told.is_empty()), (is_told, !is_told), "{told:?}");
    }
    // It may stop there, and turn back: there is no groove yet.
    let mut watch = SpindleWatch::new(&machine);
    assert!((0..200).all(|k| watch.observe(&path, 100.0, Some(0.01 * f64::from(k))).is_none()));
    assert_eq!(watch.observe(&path, 50.0, Some(3.0)), None);
}
