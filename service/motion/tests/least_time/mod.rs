//! Plans for the least time: within every limit, never slower than plans of runs, and the same whatever the window.

mod optimum;

use crate::common::{PERIOD_S, machine, programs, request, smoothed, within};
use feedwave_motion::{
    CornerSpeed, Machine, MotionRequest, PathMotion, Planned, PlannedMotion, Planner, PlannerSettings, Smoothed,
    StretchProfile, limit_pieces, stretches,
};
use feedwave_program::{Feed, PathControl, Spindle};

fn plan(
    program: &crate::common::Program,
    control: PathControl,
    machine: &Machine,
    (settings, speed): (PlannerSettings, CornerSpeed),
) -> Vec<PlannedMotion> {
    let mut planner = Planner::<()>::new(settings);
    for Smoothed { element, rest_at_end, .. } in smoothed(program, control, speed) {
        planner.push_motion(request(element, rest_at_end, machine));
    }
    planner.finish();
    let motion = |item| match item {
        Planned::Motion(motion) => motion,
        Planned::Barrier(()) => unreachable!("none was pushed"),
    };
    std::iter::from_fn(|| planner.pop()).map(motion).collect()
}

fn seconds(motions: &[PlannedMotion]) -> f64 {
    motions.iter().flat_map(|motion| &motion.stretches).map(|stretch| stretch.profile.duration()).sum()
}

/// Part of the time on courses.
fn course_share(motions: &[PlannedMotion]) -> f64 {
    let own = |stretch: &&feedwave_motion::PlannedStretch| matches!(stretch.profile, StretchProfile::Course(_));
    let on: f64 =
        motions.iter().flat_map(|motion| &motion.stretches).filter(own).map(|stretch| stretch.profile.duration()).sum();
    on / seconds(motions)
}

/// Largest velocity, acceleration and jerk of the axes, as shares of their limits, in differences of setpoints.
fn differences(motions: &[PlannedMotion], machine: &Machine, period_s: f64) -> [f64; 3] {
    let mut points = Vec::new();
    // Times on the grid as whole periods and a remainder.
    let (mut lead_s, mut next) = (0.0, 0_u64);
    for motion in motions {
        for stretch in &motion.stretches {
            let duration_s = stretch.profile.duration();
            let count = ((duration_s - lead_s) / period_s).ceil().max(0.0) as u64;
            let mut s = vec![0.0; count as usize];
            let mut v = vec![0.0; count as usize];
            stretch.profile.fill(0, period_s, -lead_s, &mut s, &mut v);
            for s in s {
                points.push(motion.element.position(stretch.start + s));
            }
            next += count;
            lead_s = lead_s + count as f64 * period_s - duration_s;
        }
    }
    assert!(next > 0);
    let end = motions.last().expect("motions").element.end;
    let start = motions[0].element.start;
    let mut padded = vec![start; 3];
    padded.extend(points);
    padded.extend([end; 4]);
    let mut largest = [0.0_f64; 3];
    for axis in &machine.axes {
        let k = axis.axis.index();
        for w in padded.windows(4) {
            let [a, b, c, d] = [w[0][k], w[1][k], w[2][k], w[3][k]];
            largest[0] = largest[0].max((b - a).abs() / period_s / axis.max_velocity_per_s);
            largest[1] = largest[1].max((c - 2.0 * b + a).abs() / (period_s * period_s) / axis.max_acceleration_per_s2);
            let jerk = (d - 3.0 * c + 3.0 * b - a).abs() / (period_s * period_s * period_s);
            largest[2] = largest[2].max(jerk / axis.max_jerk_per_s3);
        }
    }
    largest
}

/// Times of the plan of runs and of the least time, s.
fn times(program: &crate::common::Program, control: PathControl, machine: &Machine, period_s: f64) -> [f64; 2] {
    let settings = PlannerSettings::new(machine, 5_000, period_s);
    let runs = plan(program, control, machine, (settings.clone(), CornerSpeed::Steady));
    let least = plan(program, control, machine, (settings.for_least_time(machine), CornerSpeed::Changing));
    let times = [seconds(&runs), seconds(&least)];
    assert!(times[1] <= times[0] * (1.0 + 1e-9), "{}: {times:?} s", program.name);
    let shares = differences(&least, machine, period_s);
    assert!(shares.iter().all(|&share| share <= 1.0 + 1e-6), "{}: {shares:?} at {period_s} s", program.name);
    times
}

#[test]
fn every_program_is_never_slower_and_keeps_every_limit() {
    let machine = machine();
    for program in programs() {
        let control = within(0.05);
        let [runs, least] = times(&program, control, &machine, PERIOD_S);
        println!("| {} | {runs:.3} s | {least:.3} s |", program.name);
    }
}

#[test]
fn the_time_is_close_to_the_optimum_on_the_same_path() {
    let machine = machine();
    let mut ratios = Vec::new();
    for program in programs() {
        for tolerance_mm in [0.01, 0.05] {
            let settings = PlannerSettings::new(&machine, 5_000, PERIOD_S).for_least_time(&machine);
            let motions = plan(&program, within(tolerance_mm), &machine, (settings, CornerSpeed::Changing));
            let [planned, optimum] = optimum::times(&motions, &machine);
            assert!((planned / seconds(&motions) - 1.0).abs() < 1e-9, "{planned} of {} s", seconds(&motions));
            let ratio = planned / optimum;
            println!("| {} | {tolerance_mm} mm | {planned:.3} s | {optimum:.3} s | {ratio:.3} |", program.name);
            assert!((0.99..=1.10).contains(&ratio), "{} within {tolerance_mm} mm: {ratio}", program.name);
            ratios.push(ratio);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    assert!(median <= 1.05, "{median}");
}

#[test]
fn a_tolerance_never_costs_time() {
    let machine = machine();
    for program in programs() {
        let [_, stop] = times(&program, PathControl::ExactStop, &machine, PERIOD_S);
        // From the smallest tolerance to the largest; the curve within another one is another curve, and need not be better.
        let mut before = stop;
        for tolerance_mm in [0.005, 0.02, 0.1] {
            let [_, least] = times(&program, within(tolerance_mm), &machine, PERIOD_S);
            assert!(least <= before * 1.03, "{} within {tolerance_mm} mm: {least} after {before} s", program.name);
            assert!(least <= stop * 1.001, "{} within {tolerance_mm} mm: {least} of {stop} s", program.name);
            before = least;
        }
    }
}

#[test]
fn within_a_tolerance_the_time_does_not_depend_on_the_period() {
    let machine = machine();
    for program in programs() {
        let [_, at_default] = times(&program, within(0.05), &machine, PERIOD_S);
        for period_s in [250e-6, 4e-3] {
            let [_, least] = times(&program, within(0.05), &machine, period_s);
            assert!(
                (least / at_default - 1.0).abs() < 0.01,
                "{} at {period_s} s: {least} of {at_default} s",
                program.name
            );
        }
    }
}

#[test]
fn a_circle_of_chords_runs_like_the_arc() {
    let machine = machine();
    for tolerance_mm in [0.02, 0.05, 0.1] {
        let [_, chords] = times(&crate::common::chord_circle(), within(tolerance_mm), &machine, PERIOD_S);
        let [_, arc] = times(&crate::common::one_circle(), within(tolerance_mm), &machine, PERIOD_S);
        assert!(chords <= 1.05 * arc, "{chords} of {arc} s within {tolerance_mm} mm");
    }
}

#[test]
fn limits_hold_at_every_period_on_the_exact_path_and_within_a_tolerance() {
    let machine = machine();
    let programs = programs();
    let short = programs.iter().filter(|program| ["pocket", "freeform", "line-arc-line"].contains(&program.name));
    for program in short {
        for period_s in [250e-6, 4e-3] {
            for control in [within(0.01), PathControl::ExactPath] {
                if program.blocks.len() < 100 || control != PathControl::ExactPath {
                    times(program, control, &machine, period_s);
                }
            }
        }
    }
}

#[test]
fn a_tangent_arc_within_a_tolerance_gains_most_of_a_third() {
    let machine = machine();
    let programs = programs();
    let program = programs.iter().find(|program| program.name == "line-arc-line").expect("one of the seven");
    let [runs, least] = times(program, within(0.05), &machine, PERIOD_S);
    assert!(least < 0.8 * runs, "{least} of {runs} s");
    let [runs, least] = times(program, PathControl::ExactPath, &machine, PERIOD_S);
    assert!(least < 0.85 * runs, "{least} of {runs} s");
}

/// What comes out where it is taken as soon as it is there and the planner is stored and read back now and then, and after how many
/// elements the first of it came.
fn plan_step_by_step(requests: &[MotionRequest], settings: PlannerSettings) -> (Vec<PlannedMotion>, usize) {
    let mut planner = Planner::<()>::new(settings);
    let mut motions = Vec::new();
    let mut first = None;
    for (index, request) in requests.iter().enumerate() {
        planner.push_motion(request.clone());
        while let Some(Planned::Motion(motion)) = planner.pop() {
            first.get_or_insert(index + 1);
            motions.push(motion);
        }
        if index % 61 == 0 {
            let stored = postcard::to_stdvec(&planner).expect("a planner is plain data");
            planner = postcard::from_bytes(&stored).expect("its own bytes");
        }
    }
    planner.finish();
    motions.extend(std::iter::from_fn(|| planner.pop()).filter_map(|item| match item {
        Planned::Motion(motion) => Some(motion),
        Planned::Barrier(()) => None,
    }));
    (motions, first.unwrap_or(requests.len()))
}

#[test]
fn windows_lead_over_what_is_released_together_and_it_does_not_matter_when_it_is_taken() {
    let machine = machine();
    for program in [crate::common::raster(), crate::common::freeform()] {
        let requests: Vec<_> = smoothed(&program, within(0.05), CornerSpeed::Changing)
            .into_iter()
            .map(|Smoothed { element, rest_at_end, .. }| request(element, rest_at_end, &machine))
            .collect();
        let settings = |window| PlannerSettings::new(&machine, window, PERIOD_S).for_least_time(&machine);
        let plan = |window| plan(&program, within(0.05), &machine, (settings(window), CornerSpeed::Changing));
        let whole = plan(50_000);
        for window in [200, 1_000] {
            let motions = plan(window);
            let (one_by_one, first) = plan_step_by_step(&requests, settings(window));
            assert_eq!(one_by_one, motions, "{}", program.name);
            let ratio = seconds(&motions) / seconds(&whole);
            println!("{}, {window} elements: {ratio}, the first after {first} of {}", program.name, requests.len());
            assert!(ratio <= 1.002, "{}: {ratio}", program.name);
            assert!(first <= requests.len() / 2, "{}: {first} elements", program.name);
        }
    }
}

#[test]
fn a_straight_move_keeps_its_seven_phases() {
    let machine = machine();
    let programs = programs();
    let program = programs.iter().find(|program| program.name == "zigzag").expect("one of the seven");
    let settings = PlannerSettings::new(&machine, 5_000, PERIOD_S).for_least_time(&machine);
    assert_eq!(course_share(&plan(program, PathControl::ExactStop, &machine, (settings, CornerSpeed::Changing))), 0.0);
}

/// The motions of a program at this feed, mm/min, on the generic mill.
fn at_feed(
    program: &crate::common::Program,
    feed: f64,
    settings: impl Fn(&Machine) -> PlannerSettings,
) -> Vec<PlannedMotion> {
    let machine = Machine::mill();
    let mut planner = Planner::<()>::new(settings(&machine));
    for Smoothed { element, rest_at_end, .. } in smoothed(program, within(0.05), CornerSpeed::Changing) {
        let pieces = limit_pieces(&element, &machine, PathMotion::ZERO, feed / 30.0).expect("nothing else moves");
        let stretches = stretches(&element, Feed::PerMinute(feed), &Spindle::STOPPED, &machine, &pieces);
        let mut request = MotionRequest::new(element, stretches);
        request.rest_at_end = rest_at_end;
        planner.push_motion(request);
    }
    planner.finish();
    let motion = |item| match item {
        Planned::Motion(motion) => motion,
        Planned::Barrier(()) => unreachable!("none was pushed"),
    };
    std::iter::from_fn(|| planner.pop()).map(motion).collect()
}

fn for_least_time(machine: &Machine) -> PlannerSettings {
    PlannerSettings::new(machine, 5_000, PERIOD_S).for_least_time(machine)
}

/// Speeds every fifth of a millisecond at this feed, mm/min, by the commanded one.
fn shares_of_feed(program: &crate::common::Program, feed: f64) -> Vec<f64> {
    let mut shares = Vec::new();
    for motion in at_feed(program, feed, for_least_time) {
        for stretch in &motion.stretches {
            let count = (stretch.profile.duration() / 2e-4).ceil() as usize;
            let time_s = |k: usize| stretch.profile.duration() * (k as f64 + 0.5) / count as f64;
            shares.extend((0..count).map(|k| stretch.profile.state(time_s(k)).1 * 60.0 / feed));
        }
    }
    shares
}

#[test]
fn the_commanded_speed_is_never_exceeded_and_hardly_ever_just_missed() {
    // It was exceeded by 2e-6 and 6e-5, and 0.01 and 0.04 of the time the path was slower than it by no more than 1e-4.
    for (program, feed) in [(crate::common::pocket(), 2_000.0), (crate::common::ripples(1_000), 6_000.0)] {
        let shares = shares_of_feed(&program, feed);
        let most = shares.iter().copied().fold(0.0, f64::max);
        assert!(most <= 1.0 + 1e-9, "{}: {most}", program.name);
        let missed = shares.iter().filter(|&&share| share < 1.0 - 1e-9 && share > 1.0 - 1e-4).count();
        assert!(missed * 150 <= shares.len(), "{}: {missed} of {}", program.name, shares.len());
    }
}

#[test]
fn a_long_cruise_at_the_commanded_feed_is_not_planned_anew() {
    let circle = crate::common::one_circle();
    let fast = at_feed(&circle, 800.0, |machine| PlannerSettings::new(machine, 5_000, PERIOD_S));
    let least = at_feed(&circle, 800.0, for_least_time);
    let [motion] = &least[..] else { panic!("{} motions", least.len()) };
    let kinds: Vec<_> = motion.stretches.iter().map(|stretch| stretch.profile.phases().is_some()).collect();
    assert_eq!(kinds, [false, true, false], "courses before and behind it");
    let shares: Vec<f64> = motion.stretches.iter().map(|own| own.profile.duration() / seconds(&least)).collect();
    assert!(shares[1] > 0.98, "{shares:?}");
    assert!(seconds(&least) < seconds(&fast), "{} {}", seconds(&least), seconds(&fast));
    // Asked for again it is whole.
    assert_eq!(motion.request().stretches, fast[0].request().stretches);
    // Where the axes are the limit nothing is left out.
    let [motion] = &at_feed(&circle, 60_000.0, for_least_time)[..] else { panic!() };
    assert_eq!(motion.stretches.len(), 1);
}
