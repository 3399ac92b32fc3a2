use proptest::prelude::*;

use super::*;

fn limits(velocity: f64, acceleration: f64, jerk: f64) -> PathLimits {
    PathLimits { velocity, acceleration, jerk }
}

#[track_caller]
fn assert_close(found: f64, wanted: f64) {
    assert!((found - wanted).abs() <= 1e-12 * wanted.abs().max(1e-3), "{found} for {wanted}");
}

#[test]
fn rest_to_rest_with_every_phase() {
    // v 100 mm/s, a 1000 mm/s², j 10 000 mm/s³: ramps of a/j = 0.1 s that change the speed by a²/(2j) = 50 mm/s each,
    // so that no time is held at full acceleration. A change of speed takes 0.2 s and 100/2·0.2 = 10 mm. With a
    // 500 mm/s²: ramps of 0.05 s and 12.5 mm/s, hold of (100 − 25)/500 = 0.15 s, 0.25 s and 12.5 mm in all.
    let profile = Profile::solve(100.0, 0.0, 0.0, limits(100.0, 500.0, 10_000.0)).expect("fits");
    assert_close(profile.duration(), 2.0 * 0.25 + 75.0 / 100.0);
    // End of the first ramp: v = j·t²/2, s = j·t³/6.
    let (s, v, a, j) = profile.state(0.05);
    assert_close(v, 12.5);
    assert_close(s, 10_000.0 * 0.05 * 0.05 * 0.05 / 6.0);
    assert_close(a, 500.0);
    assert_eq!(j, 0.0);
    // Half-way up, by symmetry: half the speed, full acceleration.
    assert_close(profile.state(0.125).1, 50.0);
    // Cruise.
    let (s, v, a, j) = profile.state(0.5);
    assert_close(s, 12.5 + 100.0 * 0.25);
    assert_eq!((v, a, j), (100.0, 0.0, 0.0));
    // The descent mirrors the ascent.
    let (s, v, a, _) = profile.state(profile.duration() - 0.05);
    assert_close(100.0 - s, 10_000.0 * 0.05 * 0.05 * 0.05 / 6.0);
    assert_close(v, 12.5);
    assert_close(a, -500.0);
    assert_eq!((profile.start_velocity(), profile.peak_velocity(), profile.end_velocity()), (0.0, 100.0, 0.0));
}

#[test]
fn too_short_for_full_acceleration() {
    // Four ramps of T/4: the speed peaks at j·(T/4)², the length is that times T/2: L = 2·j·(T/4)³.
    // With T = 0.4 s and j = 1000: L = 2 mm, peak 10 mm/s, largest acceleration 100.
    let profile = Profile::solve(2.0, 0.0, 0.0, limits(1e3, 1e3, 1e3)).expect("fits");
    assert_close(profile.duration(), 0.4);
    assert_close(profile.peak_velocity(), 10.0);
    assert_close(profile.state(0.1).2, 100.0);
}

#[test]
fn too_short_for_full_speed() {
    // Full acceleration is held but the wanted speed is not reached: with ramps of a/j = 0.1 s and a peak of 400 mm/s
    // each change takes 400/1000 + 0.1 = 0.5 s and 100 mm.
    let profile = Profile::solve(200.0, 0.0, 0.0, limits(1e4, 1_000.0, 10_000.0)).expect("fits");
    assert_close(profile.duration(), 1.0);
    assert_close(profile.peak_velocity(), 400.0);
}

#[test]
fn between_two_speeds() {
    // From 20 to 60 mm/s with a 100, j 1000: ramps 0.1 s, 40/100 + 0.1 = 0.5 s, mean 40 mm/s: 20 mm exactly.
    let profile = Profile::solve(20.0, 20.0, 60.0, limits(60.0, 100.0, 1_000.0)).expect("fits to the bit or nearly");
    assert_close(profile.duration(), 0.5);
    assert_close(profile.state(0.25).1, 40.0);
    // In the other direction it takes the same.
    let profile = Profile::solve(20.0, 60.0, 20.0, limits(60.0, 100.0, 1_000.0)).expect("fits to the bit or nearly");
    assert_close(profile.duration(), 0.5);
    assert!(Profile::solve(19.99, 60.0, 20.0, limits(60.0, 100.0, 1_000.0)).is_none());
    assert!(Profile::solve(19.99, 20.0, 60.0, limits(60.0, 100.0, 1_000.0)).is_none());
}

#[test]
fn braking_takes_longer_to_a_small_speed_than_to_rest() {
    // (v + u)·√((v − u)/j): 1 to 0 takes 1, 1 to 1/3 takes 4/3·√(2/3) = 1.089, 1 to 1 takes nothing.
    let limits = limits(10.0, 1e6, 1.0);
    assert_close(change_length(1.0, 0.0, &limits), 1.0);
    assert_close(change_length(1.0, 1.0 / 3.0, &limits), 4.0 / 3.0 * (2.0_f64 / 3.0).sqrt());
    // A speed from which only rest is within reach stays within reach of what lies below the hump.
    let exit = reachable_exit(1.0, 0.4, 1.02, &limits);
    assert!(exit > 0.0 && exit < 1.0 / 3.0 && change_length(1.0, exit, &limits) <= 1.02, "{exit}");
    // Where rest just fits it is the answer, also where rounding makes the length miss it, and not the speed beyond the
    // hump to which braking is as long: (1 + u)²·(1 − u) = 1 at u = (√5 − 1)/2 = 0.618.
    for rounding in [0.0, 1e-15, 1e-12, 0.9 * SOLVER_SLACK] {
        let exit = reachable_exit(1.0, 0.4, 1.0 - rounding, &limits);
        assert!(exit < 1e-9, "{exit} with {rounding} less than a stop takes");
    }
    // What cannot stop brakes as far as it goes.
    let exit = reachable_exit(1.0, 0.4, 1.0 - 1e-8, &limits);
    assert!((exit - 0.5 * (5.0_f64.sqrt() - 1.0)).abs() < 1e-7, "{exit}");
    // Beyond it nothing keeps from the wanted speed.
    assert_eq!(reachable_exit(1.0, 0.9, 1.02, &limits), 0.9);
}

/// Length 1e-9 to 1e6 mm, start and end speed, limits.
fn problems() -> impl Strategy<Value = (f64, f64, f64, PathLimits)> {
    let power = |exponent: f64| 10.0_f64.powf(exponent);
    let speed = prop_oneof![Just(0.0), 0.0..1.0_f64];
    (-9.0..6.0_f64, speed.clone(), speed, -2.0..3.0_f64, 0.0..6.0_f64, 0.0..9.0_f64).prop_map(
        move |(length, start, end, velocity, acceleration, jerk)| {
            let limits = limits(power(velocity), power(acceleration), power(jerk));
            (power(length), start * limits.velocity, end * limits.velocity, limits)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn phases_add_up_exactly((length, start, end, limits) in problems()) {
        let Some(profile) = Profile::solve(length, start, end, limits) else {
            // Refused only where even the direct change of speed is too long.
            prop_assert!(change_length(start, end, &limits) > length);
            return Ok(());
        };
        // Integrated phase by phase with the exact polynomials: every state is continuous and the end is the end.
        let phases = profile.phases();
        let mut end_times: Vec<f64> = phases[1..].iter().map(|phase| phase.start_s).collect();
        end_times.push(profile.duration());
        for (index, (phase, &end_s)) in phases.iter().zip(&end_times).enumerate() {
            let after = phase.at(end_s - phase.start_s);
            prop_assert!(phase.acceleration.abs() <= limits.acceleration * (1.0 + 1e-12));
            prop_assert!(phase.jerk.abs() <= limits.jerk);
            prop_assert!(phase.speed <= limits.velocity.max(start).max(end) * (1.0 + 1e-12));
            prop_assert!(end_s >= phase.start_s);
            let (s, speed, acceleration) = match phases.get(index + 1) {
                Some(next) => (next.s, next.speed, next.acceleration),
                None => (length, end, 0.0),
            };
            prop_assert!((after.s - s).abs() <= 1e-12 * length, "{} is not {s} after phase {index}", after.s);
            let rounding = limits.acceleration * 4.0 * f64::EPSILON * profile.duration();
            prop_assert!((after.speed - speed).abs() <= 1e-12 * profile.peak_velocity() + rounding);
            // The phases' times round to an ulp of the duration, which may be years at a crawl.
            let rounding_s = 4.0 * f64::EPSILON * profile.duration();
            prop_assert!(
                (after.acceleration - acceleration).abs() <= 1e-9 * limits.acceleration + limits.jerk * rounding_s
            );
        }
    }

    #[test]
    fn a_fill_is_the_state_bit_for_bit_wherever_it_starts(
        (length, start, end, limits) in problems(), lead in -1.5..1.5_f64, cut in 0..64_usize, far in 0.0..1.2_f64,
    ) {
        const COUNT: usize = 64;
        let Some(profile) = Profile::solve(length, start, end, limits) else { return Ok(()) };
        // Long profiles are examined in a window, short ones whole.
        let period_s = (profile.duration() / 40.0).max(50e-6);
        let offset_s = lead * period_s;
        let first = (far * profile.duration() / period_s) as u64 / 2;
        let (mut s, mut v) = ([0.0; COUNT], [0.0; COUNT]);
        profile.fill(first, period_s, offset_s, &mut s, &mut v);
        let (mut s_cut, mut v_cut) = ([0.0; COUNT], [0.0; COUNT]);
        profile.fill(first + cut as u64, period_s, offset_s, &mut s_cut[cut..], &mut v_cut[cut..]);
        for k in 0..COUNT {
            let state = profile.state((first + k as u64) as f64 * period_s - offset_s);
            prop_assert_eq!((s[k].to_bits(), v[k].to_bits()), (state.0.to_bits(), state.1.to_bits()), "at {}", k);
            if k >= cut {
                prop_assert_eq!((s[k].to_bits(), v[k].to_bits()), (s_cut[k].to_bits(), v_cut[k].to_bits()));
            }
            prop_assert!(s[k] >= 0.0 && s[k] <= length && v[k] >= 0.0);
        }
    }

    #[test]
    fn no_other_cruise_speed_of_the_same_shape_is_faster(
        (length, start, end, limits) in problems(), share in 0.0..1.0_f64,
    ) {
        let Some(profile) = Profile::solve(length, start, end, limits) else { return Ok(()) };
        let lowest = start.max(end);
        let fits = |cruise: f64| change_length(start, cruise, &limits) + change_length(cruise, end, &limits) <= length;
        let other = lowest + share * (limits.velocity.max(lowest) - lowest);
        if other > 0.0 && fits(other) {
            let other = Profile::with_cruise(length, start, other, end, &limits);
            prop_assert!(profile.duration() <= other.duration() * (1.0 + 1e-9));
        }
        // Nor does a higher one fit, unless the limit forbids it.
        let higher = profile.peak_velocity() * (1.0 + 1e-9);
        prop_assert!(higher > limits.velocity || higher <= lowest * (1.0 + 1e-8) || !fits(higher));
    }

    #[test]
    fn solved_speeds_are_reachable_and_highest(
        (length, from, wanted, limits) in problems(),
    ) {
        let reached = reachable_exit(from, wanted, length, &limits);
        let needed = change_length(from, reached, &limits);
        prop_assert!(needed <= length * (1.0 + SOLVER_SLACK), "{needed} of {length}");
        prop_assert!(reached <= wanted || change_length(from, 0.0, &limits) > length);
        let entered = highest_entry(from, wanted, length, &limits);
        prop_assert!(entered <= wanted);
        prop_assert!(
            entered <= from || change_length(entered, from, &limits).min(change_length(entered, 0.0, &limits)) <= length
        );
    }
}

#[test]
fn times_outside_give_the_ends() {
    let profile = Profile::solve(20.0, 20.0, 60.0, limits(80.0, 100.0, 1_000.0)).expect("fits");
    assert_eq!((profile.state(-1.0).0, profile.state(-1.0).1), (0.0, 20.0));
    let (mut s, mut v) = ([0.0; 3], [0.0; 3]);
    // The setpoints 0 and 1 lie before the start when the offset is 1.5 periods.
    profile.fill(0, 1e-3, 1.5e-3, &mut s, &mut v);
    assert_eq!((s[0], s[1], v[0], v[1]), (0.0, 0.0, 20.0, 20.0));
    assert!(s[2] > 0.0);
    profile.fill(1_000_000_000_000, 1e-3, 0.0, &mut s, &mut v);
    assert_eq!((s, v), ([20.0; 3], [60.0; 3]));
}

#[test]
fn the_phases_of_a_part_take_its_time() {
    // Ramps of 0.1 s, a hold of 0.1 s and a cruise of 0.5 s: 1 000 mm/s² at 10 000 mm/s³ up to 200 mm/s.
    let profile = Profile::solve(160.0, 0.0, 0.0, limits(200.0, 1e3, 1e4)).expect("fits");
    let PhaseTimes { jerk_s, acceleration_s, cruise_s } = ProfilePart::new(profile, 0.0, 160.0).phase_times();
    assert_close(jerk_s, 0.4);
    assert_close(acceleration_s, 0.2);
    assert_close(cruise_s, 0.5);

    // Of a part, what its own states show.
    for (start, end) in [(0.0, 10.0), (1.0, 40.0), (25.0, 130.0), (35.0, 36.0), (140.0, 160.0)] {
        let part = ProfilePart::new(profile, start, end);
        let times = part.phase_times();
        let steps = 100_000;
        let mut counted = PhaseTimes::default();
        for k in 0..steps {
            let (_, _, acceleration, jerk) = part.state((f64::from(k) + 0.5) / f64::from(steps) * part.duration());
            *match () {
                () if jerk != 0.0 => &mut counted.jerk_s,
                () if acceleration.abs() > 1e-6 => &mut counted.acceleration_s,
                () => &mut counted.cruise_s,
            } += part.duration() / f64::from(steps);
        }
        let pairs = [
            (times.jerk_s, counted.jerk_s),
            (times.acceleration_s, counted.acceleration_s),
            (times.cruise_s, counted.cruise_s),
        ];
        for (time_s, counted_s) in pairs {
            assert!((time_s - counted_s).abs() <= 8.0 * part.duration() / f64::from(steps), "{times:?} {counted:?}");
        }
        assert_close(times.jerk_s + times.acceleration_s + times.cruise_s, part.duration());
    }
}
