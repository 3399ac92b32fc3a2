//! The fitted method against brute force: at many places of every block, what is left is within both tolerances of the program,
//! and the flicker goes, around sharp turns as well.

use feedwave_cutting::thinning::{
    CutPoint, DirectionInterpolation, Kept, Thinner, ThinningMethod, ThinningReport, ThinningSettings,
};
use feedwave_motion::kinematics::GreatCircle;
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, angle, norm, sub, unit};
use proptest::prelude::*;

use super::{at, lines, thinned, trunnion, vector};

const SETTINGS: ThinningSettings = ThinningSettings {
    angle_tolerance_deg: 1.0,
    distance_tolerance_mm: 0.01,
    group_blocks: 200,
    interpolated_direction_tolerance_deg: None,
    method: ThinningMethod::Fitted,
};

/// Places at which a block is looked at.
const PLACES: u32 = 24;

fn between(from: &CutPoint, to: &CutPoint, by_angles: bool, share: f64) -> (Vec3, Vec3) {
    let tip_mm = add_scaled(from.tip_mm, sub(to.tip_mm, from.tip_mm), share);
    let direction = match (by_angles, from.rotary_rad, to.rotary_rad) {
        (true, Some(a), Some(b)) => trunnion().at([0, 1].map(|axis| a[axis] + (b[axis] - a[axis]) * share)),
        _ => GreatCircle::new(from.direction, to.direction).expect("not opposite").at(share),
    };
    (tip_mm, direction)
}

/// Largest distances, mm and rad, of what is left from the program at the same share of the path length between two kept
/// blocks.
fn farthest(points: &[CutPoint], kept: &[Kept<usize>], by_angles: bool) -> (f64, f64) {
    let (mut off_mm, mut off_rad) = (0.0_f64, 0.0_f64);
    for pair in kept.windows(2) {
        let (start, end) = (pair[0].payload, pair[1].payload);
        let mut lengths_mm = vec![0.0];
        for block in points[start..=end].windows(2) {
            lengths_mm.push(lengths_mm[lengths_mm.len() - 1] + norm(sub(block[1].tip_mm, block[0].tip_mm)));
        }
        let whole_mm = lengths_mm[end - start];
        for block in start..end {
            let (from_mm, to_mm) = (lengths_mm[block - start], lengths_mm[block - start + 1]);
            for place in 0..=PLACES {
                let share = f64::from(place) / f64::from(PLACES);
                let along = from_mm + (to_mm - from_mm) * share;
                // Where the tool centre point rests there is but one block.
                let left_share = if whole_mm > 1e-9 { along / whole_mm } else { share };
                let (tip_mm, direction) = between(&points[block], &points[block + 1], by_angles, share);
                let (left_mm, left) = between(&pair[0].point, &pair[1].point, by_angles, left_share);
                off_mm = off_mm.max(norm(sub(tip_mm, left_mm)));
                off_rad = off_rad.max(angle(direction, left));
            }
        }
    }
    (off_mm, off_rad)
}

fn check(points: &[CutPoint], settings: ThinningSettings, by_angles: bool) -> (Vec<Kept<usize>>, ThinningReport) {
    let interpolation =
        if by_angles { DirectionInterpolation::Angles(trunnion()) } else { DirectionInterpolation::GreatCircle };
    let (kept, report) = thinned(points, settings, interpolation);
    let (off_mm, off_rad) = farthest(points, &kept, by_angles);
    let tolerance_rad = settings.fitted_tolerance_deg().to_radians();
    assert!(off_mm < settings.distance_tolerance_mm, "{off_mm} mm");
    assert!(off_rad <= tolerance_rad * (1.0 + 1e-9) + 1e-12, "{off_rad} of {tolerance_rad} rad");
    // What is reported is what is found, and what is promised between blocks holds.
    let bound_rad = report.direction_bound_deg.to_radians();
    assert!(off_rad <= bound_rad + 1e-9 && bound_rad <= tolerance_rad * (1.0 + 1e-12), "{off_rad}, {bound_rad}");
    assert!(off_mm <= report.position_deviation_mm + 1e-9, "{off_mm}, {report:?}");
    assert!(report.direction_deviation_deg <= report.direction_bound_deg + 1e-9);
    // The tool centre points that are left are programmed ones, and both ends are as programmed to the bit.
    for block in &kept {
        assert_eq!(block.point.tip_mm, points[block.payload].tip_mm);
        if block.fitted.is_none() {
            assert_eq!(block.point.direction, points[block.payload].direction);
        }
    }
    if let (Some(first), Some(last)) = (kept.first(), kept.last()) {
        assert!(first.fitted.is_none() && last.fitted.is_none());
        assert_eq!((first.payload, last.payload), (0, points.len() - 1));
    }
    assert_eq!(kept.len() as u64, report.blocks_kept());
    (kept, report)
}

/// Times that an angle turns back, of those that are larger than rounding.
fn reversals(values: impl Iterator<Item = f64>) -> usize {
    let values: Vec<f64> = values.collect();
    let steps = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.abs() > 1e-9);
    let senses: Vec<bool> = steps.map(|step| step > 0.0).collect();
    senses.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// A straight pass whose direction flickers by ±0.3 degrees and turns by 50 degrees over four blocks.
fn sharp_turn() -> Vec<CutPoint> {
    let tilt_deg = |block: u32| {
        let flicker = if block.is_multiple_of(2) { 0.3 } else { -0.3 };
        let turn = 12.5 * (f64::from(block) - 100.0).clamp(0.0, 4.0);
        -20.0 - turn + flicker
    };
    (0..200).map(|block| at(block + 1, [0.2 * f64::from(block), 0.0, 0.0], tilt_deg(block))).collect()
}

#[test]
fn no_flicker_is_left_around_a_sharp_turn() {
    for by_angles in [true, false] {
        let points: Vec<_> =
            sharp_turn().into_iter().map(|point| if by_angles { point } else { vector(point) }).collect();
        let (kept, report) = check(&points, SETTINGS, by_angles);
        let published = ThinningSettings { method: ThinningMethod::Published, ..SETTINGS };
        let interpolation =
            if by_angles { DirectionInterpolation::Angles(trunnion()) } else { DirectionInterpolation::GreatCircle };
        let (as_published, _) = thinned(&points, published, interpolation);
        let tilt = |block: &Kept<usize>| angle(block.point.direction, [0.0, 0.0, 1.0]);
        let (fitted, as_published) = (reversals(kept.iter().map(tilt)), reversals(as_published.iter().map(tilt)));
        // It gathers way before the turn and comes to rest behind it: nothing else is left.
        assert!(fitted <= 4 && fitted <= as_published, "{fitted} and {as_published} reversals of {by_angles}");
        assert!(report.blocks_kept() * 4 < report.blocks_read, "{report:?}");
    }
}

#[test]
fn a_freeform_program_is_smooth_and_within_both_tolerances_everywhere() {
    let points = super::freeform::program(40, 205);
    for by_angles in [true, false] {
        let points: Vec<_> = points.iter().map(|point| if by_angles { *point } else { vector(*point) }).collect();
        let settings = ThinningSettings { group_blocks: 1_000, ..SETTINGS };
        let (kept, report) = check(&points, settings, by_angles);
        let published = ThinningSettings { method: ThinningMethod::Published, ..settings };
        let interpolation =
            if by_angles { DirectionInterpolation::Angles(trunnion()) } else { DirectionInterpolation::GreatCircle };
        let (as_published, _) = thinned(&points, published, interpolation);
        let count = |kept: &[Kept<usize>]| reversals(kept.iter().map(|block| block.point.direction[0]));
        assert!(count(&kept) <= count(&as_published), "{} and {}", count(&kept), count(&as_published));
        assert!(report.blocks_kept() * 5 < report.blocks_read, "{report:?}");
        if by_angles {
            let [before, after] = [report.rotary.reversals_before, report.rotary.reversals_after];
            assert!((after[0] + after[1]) * 20 < before[0] + before[1], "{before:?}, {after:?}");
        }
    }
}

#[test]
fn a_group_is_settled_by_three_quarters_and_what_is_carried_over_is_enough_to_go_on() {
    let points = sharp_turn();
    let settings = ThinningSettings { group_blocks: 40, ..SETTINGS };
    let interpolation = DirectionInterpolation::Angles(trunnion());
    let (whole, report) = check(&points, settings, true);
    let mut thinner = Thinner::new(settings, interpolation).expect("valid settings");
    let mut kept: Vec<Kept<usize>> = Vec::new();
    for (index, point) in points.iter().enumerate() {
        // Every state is one value, from which it goes on to the bit.
        let state = postcard::to_allocvec(&thinner).expect("a state");
        thinner = postcard::from_bytes(&state).expect("a state");
        thinner.push(*point, index, &mut |block| kept.push(block));
        let waiting = index + 1 - kept.last().map_or(0, |block| block.payload + 1);
        assert!(waiting < settings.group_blocks as usize, "{waiting} blocks wait at {index}");
    }
    thinner.flush(&mut |block| kept.push(block));
    assert_eq!(kept, whole);
    assert_eq!(thinner.report(), report);
    assert!(report.groups > 4, "{report:?}");
}

#[test]
fn blocks_where_the_tool_rests_or_turns_far_at_once_are_as_programmed() {
    let mut points: Vec<CutPoint> = (0..30)
        .map(|block| vector(at(block + 1, [0.5 * f64::from(block), 0.0, 0.0], -20.0 + 0.2 * f64::from(block % 2))))
        .collect();
    // At rest from block 10 to 11, and turned by 75 degrees in block 20.
    points[11].tip_mm = points[10].tip_mm;
    for point in &mut points[20..] {
        point.direction = trunnion().at([0.0, (-95.0_f64).to_radians()]);
    }
    let (kept, _) = check(&points, SETTINGS, false);
    for place in [0, 10, 11, 19, 20, 29] {
        let block = kept.iter().find(|block| block.payload == place).unwrap_or_else(|| panic!("{place} is kept"));
        assert!(block.fitted.is_none() && block.point.direction == points[place].direction);
    }
}

#[test]
fn the_feed_of_a_dropped_block_moves_on_as_in_the_published_method() {
    let straight = |line: u32, feed_word| CutPoint { feed_word, ..at(line, [f64::from(line), 0.0, 0.0], -20.0) };
    let feeds = [Some(100.0), None, Some(200.0), None];
    let points: Vec<_> = (1..).zip(feeds).map(|(line, feed)| straight(line, feed)).collect();
    let (kept, report) = check(&points, SETTINGS, true);
    assert_eq!(lines(&kept), [1, 4]);
    assert_eq!((kept[1].point.feed_word, kept[1].inherited_feed, report.feeds_inherited), (Some(200.0), true, 1));
}

#[test]
fn its_tolerance_is_a_small_angle() {
    let fields =
        |settings: ThinningSettings| settings.validate().into_iter().map(|problem| problem.field).collect::<Vec<_>>();
    assert_eq!(fields(ThinningSettings { angle_tolerance_deg: 11.0, ..SETTINGS }), ["angle_tolerance_deg"]);
    let stricter =
        ThinningSettings { angle_tolerance_deg: 11.0, interpolated_direction_tolerance_deg: Some(0.5), ..SETTINGS };
    assert_eq!(fields(stricter), [""; 0]);
    assert_eq!(stricter.fitted_tolerance_deg(), 0.5);
    // The other method of a coarse published one is the fitted one at what it permits.
    let coarse = ThinningSettings { angle_tolerance_deg: 30.0, method: ThinningMethod::Published, ..SETTINGS };
    assert_eq!(fields(coarse.with_other_method()), [""; 0]);
    assert_eq!(coarse.with_other_method().angle_tolerance_deg, 10.0);
}

#[test]
fn groups_of_ten_thousand_cost_near_linear() {
    let path = |tip: fn(f64) -> Vec3, direction: fn(f64) -> Vec3| -> Vec<CutPoint> {
        let point = |line: u32| {
            let direction = unit(direction(f64::from(line))).expect("a direction");
            CutPoint { line, tip_mm: tip(f64::from(line)), direction, rotary_rad: None, feed_word: None }
        };
        (0..10_000).map(point).collect()
    };
    let still: fn(f64) -> Vec3 = |_| [0.0, 0.0, 1.0];
    let programs = [
        ("straight", path(|t| [t, 0.3 * t, 0.1 * t], still)),
        ("zigzag", path(|t| [t, if t % 2.0 == 0.0 { 0.0 } else { 0.2 }, 0.0], still)),
        ("circle", path(|t| [100.0 * libm::cos(t * 1e-3), 100.0 * libm::sin(t * 1e-3), 0.0], still)),
        ("wave", path(|t| [t * 0.1, libm::sin(t * 0.01), 0.0], |t| [0.02 * libm::sin(t), 0.0, 1.0])),
    ];
    let looks_per_block = |points: &[CutPoint]| {
        let settings = ThinningSettings { group_blocks: 10_000, ..SETTINGS };
        let mut thinner = Thinner::new(settings, DirectionInterpolation::GreatCircle).expect("valid");
        points.iter().for_each(|point| thinner.push(*point, (), &mut |_| {}));
        thinner.flush(&mut |_| {});
        thinner.looks() as f64 / points.len() as f64
    };
    for (name, points) in &programs {
        let (looks, quarter) = (looks_per_block(points), looks_per_block(&points[..2_500]));
        assert!(looks < 60.0 && looks < 1.5 * quarter + 10.0, "{name}: {quarter:.1} to {looks:.1} looks per block");
    }
}

/// A block further on: how far, to the side, and by how much both rotary axes turn, degrees.
fn steps() -> impl Strategy<Value = Vec<(f64, f64, f64, f64)>> {
    let turn = prop_oneof![8 => -0.6..0.6f64, 2 => -4.0..4.0f64, 1 => -40.0..40.0f64];
    let step = prop_oneof![6 => 0.05..0.5f64, 1 => 1e-6..10.0f64, 1 => Just(0.0)];
    prop::collection::vec((step, -0.02..0.02f64, turn.clone(), turn), 2..120)
}

proptest! {
    #[test]
    fn what_is_left_is_within_both_tolerances_everywhere(
        steps in steps(),
        start_deg in -60.0..60.0f64,
        angle_tolerance_deg in prop_oneof![Just(0.05), 0.2..3.0f64, Just(10.0)],
        distance_tolerance_mm in prop_oneof![Just(1e-4), 0.002..0.1f64],
        group_blocks in 3u32..60,
        by_angles in any::<bool>(),
    ) {
        let (mut tip_mm, mut rotary_deg) = ([0.0; 3], [0.0, start_deg]);
        let mut points = Vec::new();
        for (line, (step, side, first, second)) in (1..).zip(steps) {
            tip_mm = [tip_mm[0] + step, side * f64::from(line % 7), tip_mm[2] + 0.3 * side];
            if step == 0.0 {
                // At rest: all of it, so that the path length does not change.
                tip_mm = points.last().map_or(tip_mm, |point: &CutPoint| point.tip_mm);
            }
            rotary_deg = [rotary_deg[0] + first, (rotary_deg[1] + second).clamp(-100.0, 100.0)];
            let rotary_rad = rotary_deg.map(f64::to_radians);
            let direction = unit(trunnion().at(rotary_rad)).expect("a direction");
            let rotary_rad = by_angles.then_some(rotary_rad);
            points.push(CutPoint { line, tip_mm, direction, rotary_rad, feed_word: None });
        }
        let settings = ThinningSettings {
            angle_tolerance_deg, distance_tolerance_mm, group_blocks, ..SETTINGS
        };
        check(&points, settings, by_angles);
    }
}
