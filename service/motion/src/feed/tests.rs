use feedwave_program::{
    ArcGeometry, Move, MoveKind, PathControl, Plane, Position, SourceSpan, SpindleDirection, SplineGeometry,
};
use proptest::prelude::*;

use super::commanded as stretches;
use super::*;

const FEED_MM_PER_REV: f64 = 0.2;

fn element(kind: MoveKind, start: [f64; 3], end: [f64; 3], arc: Option<ArcGeometry>) -> Element {
    let position = |[x, y, z]: [f64; 3]| -> Position { [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let mv = Move {
        kind,
        start: position(start),
        end: position(end),
        work_offset: [0.0; 9],
        arc,
        feed: Feed::PerRevolution(FEED_MM_PER_REV),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        cycle: None,
        leads_xyz: false,
    };
    Element::from_move(&mv, SourceSpan::default()).expect("it moves")
}

/// An arc in the turning plane about X = `center_x`, Z = 0.
fn arc(center_x: f64, radius: f64, start_angle: f64, sweep: f64) -> Element {
    let at = |angle: f64| [center_x + radius * angle.sin(), 0.0, radius * angle.cos()];
    let geometry = ArcGeometry { plane: Plane::Zx, center: [0.0, center_x], clockwise: sweep < 0.0, sweep_rad: sweep };
    element(MoveKind::Cutting, at(start_angle), at(start_angle + sweep), Some(geometry))
}

fn surface(m_per_min: f64, max_rev_per_min: f64) -> Spindle {
    Spindle { direction: SpindleDirection::Clockwise, speed: SpindleSpeed::Surface { m_per_min, max_rev_per_min } }
}

fn constant(rev_per_min: f64) -> Spindle {
    Spindle { direction: SpindleDirection::Clockwise, speed: SpindleSpeed::Constant { rev_per_min } }
}

/// Every promise about stretches under constant surface speed, at `samples` places of each stretch.
fn check(element: &Element, spindle: &Spindle, samples: u32) -> Result<usize, TestCaseError> {
    let machine = Machine::lathe();
    let parts = stretches(element, Feed::PerRevolution(FEED_MM_PER_REV), spindle, &machine);
    prop_assert!((1..=MAX_STRETCHES).contains(&parts.len()));
    prop_assert_eq!(parts.last().expect("one at least").end.to_bits(), element.length.to_bits());
    let mut start = 0.0;
    for part in &parts {
        prop_assert!(part.end > start, "{} after {start}", part.end);
        prop_assert_eq!(part.speed_mm_per_s.to_bits(), (FEED_MM_PER_REV * part.spindle_rev_per_s).to_bits());
        for k in 0..=samples {
            let s = start + (part.end - start) * f64::from(k) / f64::from(samples);
            let radius_mm = element.position(s)[0].abs();
            let wanted = spindle.rev_per_s(radius_mm).min(machine.max_spindle_rev_per_min / 60.0);
            // Places are resolved to a rounding of the length, which a radius beside X0 sees magnified.
            let slack = 1.0 + 1e-9;
            prop_assert!(part.spindle_rev_per_s <= wanted * slack, "{} above {wanted}", part.spindle_rev_per_s);
            prop_assert!(part.spindle_rev_per_s * 1.01 * slack >= wanted, "{} below {wanted}", part.spindle_rev_per_s);
        }
        start = part.end;
    }
    Ok(parts.len())
}

proptest! {
    #[test]
    fn surface_speed_on_lines_is_never_above_and_within_one_per_cent(
        from in -200.0..200.0_f64, to in -200.0..200.0_f64, along in -50.0..50.0_f64,
        m_per_min in 1.0..400.0_f64, clamp in prop_oneof![500.0..6_000.0_f64, Just(f64::INFINITY)],
    ) {
        let element = element(MoveKind::Cutting, [from, 0.0, 0.0], [to, 0.0, along], None);
        check(&element, &surface(m_per_min, clamp), 20)?;
    }

    #[test]
    fn surface_speed_on_arcs_is_never_above_and_within_one_per_cent(
        center in -60.0..60.0_f64, radius in 0.05..50.0_f64, angle in 0.0..TAU,
        sweep in prop_oneof![0.01..TAU, -TAU..-0.01], m_per_min in 20.0..400.0_f64,
    ) {
        check(&arc(center, radius, angle, sweep), &surface(m_per_min, f64::INFINITY), 20)?;
    }
}

#[test]
fn a_dip_between_equal_radii_is_seen() {
    // Starts and turns round at nearly the same |X|, with X0 passed in between: only the path in between differs.
    let passing = element(MoveKind::Cutting, [-20.0, 0.0, 0.0], [20.0, 0.0, 0.0], None);
    assert!(check(&passing, &surface(100.0, f64::INFINITY), 50).expect("holds") > 100);
    // A circle that comes within 0.5 mm of the axis and leaves again.
    assert!(check(&arc(10.5, 10.0, 0.0, TAU), &surface(5.0, f64::INFINITY), 50).expect("holds") > 100);
}

#[test]
fn a_clamped_radius_needs_no_division() {
    // 100 m/min asks for the clamp of 1000 rev/min at r = 100000/(2π·1000) = 15.9 mm: below, nothing changes.
    let inside = element(MoveKind::Cutting, [15.9, 0.0, 0.0], [-15.9, 0.0, 0.0], None);
    let parts = stretches(&inside, Feed::PerRevolution(0.2), &surface(100.0, 1_000.0), &Machine::lathe());
    assert_eq!(
        parts.as_slice(),
        [Stretch {
            end: 31.8,
            speed_mm_per_s: 0.2 * (1_000.0 / 60.0),
            spindle_rev_per_s: 1_000.0 / 60.0,
            limits: UNLIMITED
        }]
    );
    // The machine's own 5000 rev/min clamps where the program does not: r = 3.18 mm.
    let centre = element(MoveKind::Cutting, [3.1, 0.0, 0.0], [0.0, 0.0, 0.0], None);
    let parts = stretches(&centre, Feed::PerRevolution(0.2), &surface(100.0, f64::INFINITY), &Machine::lathe());
    assert_eq!((parts.len(), parts[0].spindle_rev_per_s), (1, 5_000.0 / 60.0));
}

#[test]
fn the_number_of_stretches_is_that_of_one_per_cent_steps() {
    // From r = 100 to 50 mm the speed doubles: ln 2 / ln 1.01 = 69.7 steps.
    let facing = element(MoveKind::Cutting, [100.0, 0.0, 0.0], [50.0, 0.0, 0.0], None);
    assert_eq!(check(&facing, &surface(200.0, f64::INFINITY), 20).expect("holds"), 70);
}

#[test]
fn a_spiral_of_any_number_of_turns_stays_bounded() {
    let turns = 100_000.0;
    let spiral = arc(12.0, 10.0, 0.3, turns * TAU);
    let parts = stretches(&spiral, Feed::PerRevolution(0.2), &surface(20.0, f64::INFINITY), &Machine::lathe());
    assert_eq!(parts.len(), MAX_STRETCHES);
    assert_eq!(parts.last().expect("one at least").end, spiral.length);
    // What is beyond the bound runs at the speed of its largest radius, 22 mm.
    let slowest = 20_000.0 / (TAU * 22.0) / 60.0;
    assert!((parts.last().expect("one at least").spindle_rev_per_s - slowest).abs() < 1e-9);
}

#[test]
fn without_radius_or_surface_speed_there_is_one_stretch() {
    let machine = Machine::lathe();
    let turning = element(MoveKind::Cutting, [10.0, 0.0, 0.0], [10.0, 0.0, -50.0], None);
    let parts = stretches(&turning, Feed::PerRevolution(0.25), &surface(200.0, f64::INFINITY), &machine);
    // n = 200000/(2π·10) = 3183.1 rev/min.
    assert_eq!(parts.len(), 1);
    assert!((parts[0].spindle_rev_per_s - 200_000.0 / (TAU * 10.0) / 60.0).abs() < 1e-12);
    assert!((parts[0].speed_mm_per_s - 13.262_911_924).abs() < 1e-9);

    let facing = element(MoveKind::Cutting, [50.0, 0.0, 0.0], [0.0, 0.0, 0.0], None);
    let parts = stretches(&facing, Feed::PerRevolution(0.3), &constant(1_200.0), &machine);
    assert_eq!(
        parts.as_slice(),
        [Stretch { end: 50.0, speed_mm_per_s: 0.3 * 20.0, spindle_rev_per_s: 20.0, limits: UNLIMITED }]
    );
    // The machine's top speed clamps a constant speed too, and the feed with it.
    let parts = stretches(&facing, Feed::PerRevolution(0.3), &constant(60_000.0), &machine);
    assert_eq!(parts[0].spindle_rev_per_s, 5_000.0 / 60.0);
}

#[test]
fn a_rapid_has_no_commanded_speed_and_the_spindle_of_its_end() {
    let rapid = element(MoveKind::Rapid, [5.0, 0.0, 0.0], [-40.0, 0.0, 0.0], None);
    let parts = stretches(&rapid, Feed::PerRevolution(0.2), &surface(100.0, f64::INFINITY), &Machine::lathe());
    assert_eq!((parts.len(), parts[0].speed_mm_per_s), (1, f64::INFINITY));
    assert_eq!(parts[0].spindle_rev_per_s, surface(100.0, f64::INFINITY).rev_per_s(40.0));
    let inwards = element(MoveKind::Rapid, [50.0, 0.0, 0.0], [10.0, 0.0, 5.0], None);
    let parts = stretches(&inwards, Feed::PerRevolution(0.2), &surface(100.0, f64::INFINITY), &Machine::lathe());
    assert_eq!(parts[0].spindle_rev_per_s, surface(100.0, f64::INFINITY).rev_per_s(10.0));
}

#[test]
fn feeds_per_minute_and_inverse_time_do_not_follow_the_spindle() {
    let machine = Machine::mill();
    let line = element(MoveKind::Cutting, [0.0, 0.0, 0.0], [3.0, 4.0, 12.0], None);
    assert_eq!(stretches(&line, Feed::PerMinute(600.0), &Spindle::STOPPED, &machine)[0].speed_mm_per_s, 10.0);
    // F4: a quarter of a minute for 13 mm.
    assert_eq!(stretches(&line, Feed::InverseTime(4.0), &Spindle::STOPPED, &machine)[0].speed_mm_per_s, 13.0 / 15.0);
    assert_eq!(stretches(&line, Feed::PerRevolution(0.2), &Spindle::STOPPED, &machine)[0].speed_mm_per_s, 0.0);

    // A helix of radius 3 and pitch 8π per turn is 10π long: feeds are along the helix, not its circle.
    let geometry = ArcGeometry { plane: Plane::Xy, center: [0.0, 0.0], clockwise: false, sweep_rad: TAU };
    let pitch = 4.0 * TAU;
    let helix = element(MoveKind::Cutting, [3.0, 0.0, 0.0], [3.0, 0.0, pitch], Some(geometry));
    assert!((helix.length - 5.0 * TAU).abs() < 1e-12);
    assert_eq!(stretches(&helix, Feed::PerMinute(600.0), &constant(500.0), &machine)[0].speed_mm_per_s, 10.0);
    let inverse = stretches(&helix, Feed::InverseTime(30.0), &constant(500.0), &machine)[0].speed_mm_per_s;
    assert!((inverse - 5.0 * TAU / 2.0).abs() < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn surface_speed_on_splines_is_never_above_and_within_one_per_cent(
        points in prop::array::uniform4(prop::array::uniform2(-30.0..30.0_f64)),
        m_per_min in 20.0..400.0_f64, max_rev_per_min in prop_oneof![Just(1_000.0), Just(4_000.0)],
    ) {
        let [start, end] = [points[0], points[3]].map(|[z, x]| [x, 0.0, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let spline = SplineGeometry { plane: Plane::Zx, order: 4, points: points.to_vec(), weights: vec![1.0; 4] };
        let Some(spline) = crate::Spline::from_geometry(&spline, &start, &end) else { return Ok(()) };
        let element = Element::from_spline(start, end, spline, [0.0; 9], SourceSpan::default(), false);
        check(&element.expect("it moves"), &surface(m_per_min, max_rev_per_min), 7)?;
    }
}
