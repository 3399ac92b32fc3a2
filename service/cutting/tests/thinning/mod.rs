//! Block thinning (docs/functions/five-axis-thinning.md): the worked numbers, the result against a literal
//! implementation of the algorithm, the cost in looks, the report, and a freeform program whose flicker goes.

mod fitted;
mod freeform;
mod literal;

use feedwave_cutting::thinning::{
    CutPoint, DirectionInterpolation, Kept, MAX_GROUP_BLOCKS, Thinner, ThinningMethod, ThinningReport, ThinningSettings,
};
use feedwave_motion::kinematics::vector::{Vec3, unit};
use feedwave_motion::kinematics::{ChainAxis, Kinematics, KinematicsDescription, RotaryDirections, Wrap};
use feedwave_program::Axis;
use proptest::prelude::*;

const SETTINGS: ThinningSettings = ThinningSettings {
    angle_tolerance_deg: 3.0,
    distance_tolerance_mm: 0.01,
    group_blocks: 100,
    interpolated_direction_tolerance_deg: None,
    method: ThinningMethod::Published,
};

/// An A/C trunnion's rotary axes: A tilts, C turns.
fn trunnion() -> RotaryDirections {
    let axis = |axis: Axis, direction: Vec3| ChainAxis {
        axis,
        direction,
        point_mm: [0.0; 3],
        range: None,
        wrap: Wrap::Counting,
    };
    let chain = vec![
        axis(Axis::C, [0.0, 0.0, 1.0]),
        axis(Axis::A, [1.0, 0.0, 0.0]),
        axis(Axis::X, [1.0, 0.0, 0.0]),
        axis(Axis::Y, [0.0, 1.0, 0.0]),
        axis(Axis::Z, [0.0, 0.0, 1.0]),
    ];
    let description = KinematicsDescription {
        chain,
        gauge_point_mm: [0.0; 3],
        tool_direction: [0.0, 0.0, 1.0],
        preferred_branch: Default::default(),
    };
    Kinematics::new(&description).expect("valid").rotary_directions()
}

/// A block with the tool tilted by A, as a program with angles gives it.
fn at(line: u32, tip_mm: Vec3, a_deg: f64) -> CutPoint {
    let rotary = [0.0, a_deg.to_radians()];
    CutPoint { line, tip_mm, direction: trunnion().at(rotary), rotary_rad: Some(rotary), feed_word: None }
}

fn vector(point: CutPoint) -> CutPoint {
    CutPoint { rotary_rad: None, ..point }
}

fn thinned(
    points: &[CutPoint],
    settings: ThinningSettings,
    interpolation: DirectionInterpolation,
) -> (Vec<Kept<usize>>, ThinningReport) {
    let mut thinner = Thinner::new(settings, interpolation).expect("valid settings");
    let mut kept = Vec::new();
    for (index, point) in points.iter().enumerate() {
        thinner.push(*point, index, &mut |block| kept.push(block));
    }
    thinner.flush(&mut |block| kept.push(block));
    (kept, thinner.report())
}

fn lines(kept: &[Kept<usize>]) -> Vec<u32> {
    kept.iter().map(|block| block.point.line).collect()
}

#[test]
fn figures_7_and_8_drop_two_blocks_or_one() {
    // V2 and V3 within θ of V1, V4 not; P2 and P3 within D of P1–P4.
    let mut points = [
        at(1, [0.0; 3], 0.0),
        at(2, [1.0, 0.004, 0.0], 1.0),
        at(3, [2.0, 0.006, 0.0], 2.0),
        at(4, [3.0, 0.0, 0.0], 9.0),
    ];
    let (kept, report) = thinned(&points, SETTINGS, DirectionInterpolation::GreatCircle);
    assert_eq!(lines(&kept), [1, 4]);
    assert_eq!((kept[1].dropped, kept[1].dropped_lines), (2, Some([2, 3])));
    assert_eq!((report.blocks_read, report.blocks_dropped, report.blocks_kept()), (4, 2, 2));
    assert!((report.position_deviation_mm - 0.006).abs() < 1e-12);
    assert_eq!(report.position_deviation_line, 3);
    // P3 at D or more: e becomes 3, P2 is tested against P1–P3 and dropped, P3 starts the next span.
    points[2].tip_mm[1] = 0.01;
    assert_eq!(lines(&thinned(&points, SETTINGS, DirectionInterpolation::GreatCircle).0), [1, 3, 4]);
}

#[test]
fn figure_13_thins_groups_of_four_then_three() {
    // N2 and N10 switch the mode; N11 is not the thinner's. N4, N5 and N8 go.
    let settings = ThinningSettings { group_blocks: 4, ..SETTINGS };
    let mut thinner = Thinner::new(settings, DirectionInterpolation::GreatCircle).expect("valid");
    let mut seen = Vec::new();
    for line in 3..=9 {
        thinner.push(at(line, [f64::from(line), 0.0, 0.0], 0.1 * f64::from(line)), line, &mut |block| {
            seen.push(block.payload);
        });
        // The first group comes out as soon as it is full.
        assert_eq!(seen.len(), if line < 6 { 0 } else { 2 });
    }
    thinner.push_other(&mut |block| seen.push(block.payload));
    assert_eq!(seen, [3, 6, 7, 9]);
    let report = thinner.report();
    assert_eq!((report.groups, report.blocks_dropped, report.other_blocks, report.blocks_read), (2, 3, 1, 8));
}

#[test]
fn the_feed_of_a_dropped_block_moves_on() {
    let straight =
        |line: u32, feed_word: Option<f64>| CutPoint { feed_word, ..at(line, [f64::from(line), 0.0, 0.0], 0.0) };
    let run = |feeds: [Option<f64>; 4]| {
        let points: Vec<CutPoint> =
            feeds.into_iter().enumerate().map(|(index, feed)| straight(index as u32 + 1, feed)).collect();
        let (kept, report) = thinned(&points, SETTINGS, DirectionInterpolation::GreatCircle);
        assert_eq!(lines(&kept), [1, 4]);
        (kept[1].point.feed_word, kept[1].inherited_feed, report.feeds_inherited, report.feeds_lost)
    };
    // The F200 block P3 is dropped, P4 runs at F200.
    assert_eq!(run([Some(100.0), None, Some(200.0), None]), (Some(200.0), true, 1, 0));
    // Several: the last one is inherited, and the report says that one is lost.
    assert_eq!(run([None, Some(150.0), Some(200.0), None]), (Some(200.0), true, 1, 1));
    assert_eq!(run([None, None, Some(200.0), Some(300.0)]), (Some(300.0), false, 0, 1));
}

#[test]
fn the_angle_tolerance_does_not_bound_the_interpolated_direction() {
    // 0°, 1°, 2°, 60° at θ = 3°: two blocks go, and the error is 38°.
    let points = [0.0, 1.0, 2.0, 60.0].map(|a: f64| at(a as u32 + 1, [a.min(3.0), 0.0, 0.0], a));
    for (points, interpolation) in [
        (points.map(vector), DirectionInterpolation::GreatCircle),
        (points, DirectionInterpolation::Angles(trunnion())),
    ] {
        let (kept, report) = thinned(&points, SETTINGS, interpolation);
        assert_eq!(lines(&kept), [1, 61]);
        assert!((report.direction_deviation_deg - 38.0).abs() < 1e-9, "{report:?}");
        assert_eq!(report.direction_deviation_line, 3);
        // A tolerance on it shrinks the span to the first block that is off, 1° against 20°, then again 2° against 30.5°.
        let bounded = ThinningSettings { interpolated_direction_tolerance_deg: Some(1.0), ..SETTINGS };
        let (kept, report) = thinned(&points, bounded, interpolation);
        assert_eq!(lines(&kept), [1, 2, 3, 61]);
        assert!(report.direction_deviation_deg < 1e-9);
    }
}

#[test]
fn equal_directions_with_other_angles_are_reported() {
    // The tool along the C axis: C turns by 90° while the direction stays.
    let turned = |line: u32, c_deg: f64| CutPoint {
        rotary_rad: Some([c_deg.to_radians(), 0.0]),
        ..at(line, [f64::from(line), 0.0, 0.0], 0.0)
    };
    let points = [turned(1, 0.0), turned(2, 90.0), turned(3, 0.0), turned(4, 0.0)];
    let (kept, report) = thinned(&points, SETTINGS, DirectionInterpolation::Angles(trunnion()));
    assert_eq!(lines(&kept), [1, 4]);
    assert_eq!((report.rotary.off_blocks, report.rotary.largest_deviation_line), (1, 2));
    assert!((report.rotary.largest_deviation_deg - 90.0).abs() < 1e-9);
    assert_eq!(report.rotary.reversals_before, [1, 0]);
    assert_eq!(report.rotary.reversals_after, [0, 0]);
}

#[test]
fn distances_are_to_the_segment() {
    // Out to 5 and back to 1: on the infinite line, but 4 beyond the segment 0–1.
    let points = [at(1, [0.0; 3], 0.0), at(2, [5.0, 0.0, 0.0], 0.0), at(3, [1.0, 0.0, 0.0], 0.0)];
    assert_eq!(lines(&thinned(&points, SETTINGS, DirectionInterpolation::GreatCircle).0), [1, 2, 3]);
}

#[test]
fn invalid_settings_are_refused_by_field() {
    let settings = ThinningSettings {
        angle_tolerance_deg: f64::NAN,
        distance_tolerance_mm: 0.0,
        group_blocks: MAX_GROUP_BLOCKS + 1,
        interpolated_direction_tolerance_deg: Some(91.0),
        method: ThinningMethod::Published,
    };
    let problems = Thinner::<()>::new(settings, DirectionInterpolation::GreatCircle).expect_err("invalid");
    let fields: Vec<&str> = problems.iter().map(|problem| problem.field.as_str()).collect();
    assert_eq!(
        fields,
        ["angle_tolerance_deg", "distance_tolerance_mm", "group_blocks", "interpolated_direction_tolerance_deg"]
    );
}

#[test]
fn blocks_that_are_no_numbers_are_kept() {
    let mut points: Vec<CutPoint> = (0..9).map(|index| at(index, [f64::from(index), 0.0, 0.0], 0.0)).collect();
    points[4].tip_mm[1] = f64::NAN;
    assert_eq!(lines(&thinned(&points, SETTINGS, DirectionInterpolation::GreatCircle).0), [0, 3, 4, 5, 8]);
}

#[test]
fn a_restored_stage_continues_exactly() {
    let points: Vec<CutPoint> = freeform::program(12, 40).into_iter().take(400).collect();
    let (whole, report) = thinned(&points, SETTINGS, DirectionInterpolation::Angles(trunnion()));
    let mut thinner = Thinner::new(SETTINGS, DirectionInterpolation::Angles(trunnion())).expect("valid");
    let mut kept = Vec::new();
    for (index, point) in points.iter().enumerate() {
        if index % 37 == 0 {
            let stored = postcard::to_stdvec(&thinner).expect("stored");
            thinner = postcard::from_bytes(&stored).expect("restored");
        }
        thinner.push(*point, index, &mut |block| kept.push(block));
    }
    thinner.flush(&mut |block| kept.push(block));
    assert_eq!((kept, thinner.report()), (whole, report));
}

/// The looks per block that a group costs.
fn looks_per_block(points: &[CutPoint], settings: ThinningSettings) -> f64 {
    let settings = ThinningSettings { group_blocks: 10_000, ..settings };
    let mut thinner = Thinner::new(settings, DirectionInterpolation::GreatCircle).expect("valid");
    for point in points {
        thinner.push(*point, (), &mut |_| {});
    }
    thinner.flush(&mut |_| {});
    thinner.looks() as f64 / points.len() as f64
}

#[test]
fn groups_of_ten_thousand_cost_near_linear() {
    let path = |tip: fn(f64) -> Vec3, direction: fn(f64) -> Vec3| -> Vec<CutPoint> {
        (0..10_000_u32)
            .map(|index| {
                let t = f64::from(index);
                let direction = unit(direction(t)).expect("a direction");
                CutPoint { line: index, tip_mm: tip(t), direction, rotary_rad: None, feed_word: None }
            })
            .collect()
    };
    let still: fn(f64) -> Vec3 = |_| [0.0, 0.0, 1.0];
    let programs = [
        ("straight", path(|t| [t, 0.3 * t, 0.1 * t], still)),
        ("zigzag", path(|t| [t, if t % 2.0 == 0.0 { 0.0 } else { 0.2 }, 0.0], still)),
        ("narrow zigzag", path(|t| [t, if t % 2.0 == 0.0 { 0.0 } else { 0.009_9 }, 0.0], still)),
        ("circle", path(|t| [100.0 * libm::cos(t * 1e-3), 100.0 * libm::sin(t * 1e-3), 0.0], still)),
        ("spiral", path(|t| [t * libm::cos(t * 0.05), t * libm::sin(t * 0.05), 0.01 * t], still)),
        ("parabola", path(|t| [t * 0.1, 1e-6 * t * t, 0.0], still)),
        ("fan", path(|t| [t, 0.0, 0.0], |t| [libm::sin(t * 1e-4), 0.0, libm::cos(t * 1e-4)])),
        ("wave", path(|t| [t * 0.1, libm::sin(t * 0.01), 0.0], |t| [0.02 * libm::sin(t), 0.0, 1.0])),
        ("on the spot", path(|_| [1.0, 2.0, 3.0], |t| [libm::sin(t * 1e-4), 0.0, libm::cos(t * 1e-4)])),
    ];
    let bounded = ThinningSettings { interpolated_direction_tolerance_deg: Some(0.5), ..SETTINGS };
    for (name, points) in &programs {
        for settings in [SETTINGS, bounded] {
            // The literal flow chart takes up to some 10 000 looks per block.
            let looks = looks_per_block(points, settings);
            assert!(looks < 300.0, "{name}: {looks:.1} looks per block with {settings:?}");
            // Four times the group costs hardly more per block.
            let quarter = looks_per_block(&points[..2_500], settings);
            assert!(looks < 1.5 * quarter + 10.0, "{name}: {quarter:.1} to {looks:.1} with {settings:?}");
        }
    }
}

/// Random groups: paths with runs of straight, curved and still points, directions that flicker and turn.
fn a_group() -> impl Strategy<Value = Vec<CutPoint>> {
    let step = (0.0..1.0_f64, -0.02..0.02_f64, -0.02..0.02_f64, -2.0..2.0_f64, -2.0..2.0_f64, 0_u8..20);
    prop::collection::vec(step, 1..400).prop_map(|steps| {
        let (mut tip, mut rotary) = ([0.0; 3], [0.0, 0.3]);
        let axes = trunnion();
        let mut heading = 0.0_f64;
        steps
            .into_iter()
            .enumerate()
            .map(|(index, (length, aside, up, turn, tilt, kind))| {
                match kind {
                    0 => heading += turn,
                    1 => tip[2] += up,
                    2 => rotary[0] += 10.0 * turn.to_radians(),
                    3..6 => rotary = [rotary[0] + turn.to_radians(), rotary[1] + tilt.to_radians()],
                    _ => {
                        tip[0] += length * libm::cos(heading) + aside * 0.1;
                        tip[1] += length * libm::sin(heading) + up * 0.1;
                        heading += aside * 0.5;
                    }
                }
                let direction = axes.at(rotary);
                CutPoint { line: index as u32 + 1, tip_mm: tip, direction, rotary_rad: Some(rotary), feed_word: None }
            })
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn results_are_those_of_the_flow_chart(
        points in a_group(),
        angle_tolerance_deg in 0.2..20.0_f64,
        distance_tolerance_mm in 0.001..0.5_f64,
        tolerance in prop::option::of(0.05..5.0_f64),
        by_angle in any::<bool>(),
        group_blocks in 3..400_u32,
    ) {
        let settings = ThinningSettings {
            angle_tolerance_deg,
            distance_tolerance_mm,
            group_blocks,
            interpolated_direction_tolerance_deg: tolerance,
            method: ThinningMethod::Published,
        };
        let axes = trunnion();
        let interpolation =
            if by_angle { DirectionInterpolation::Angles(axes) } else { DirectionInterpolation::GreatCircle };
        let (kept, report) = thinned(&points, settings, interpolation);
        let expected: Vec<u32> = points
            .chunks(group_blocks as usize)
            .flat_map(|group| {
                let kept = literal::kept(group, &settings, by_angle.then_some(&axes));
                kept.into_iter().map(|index| group[index].line).collect::<Vec<_>>()
            })
            .collect();
        prop_assert_eq!(lines(&kept), expected);
        prop_assert!(report.position_deviation_mm < distance_tolerance_mm);
        if let Some(tolerance) = tolerance {
            prop_assert!(report.direction_deviation_deg < tolerance * (1.0 + 1e-12));
        }
        let dropped: u64 = kept.iter().map(|block| u64::from(block.dropped)).sum();
        prop_assert_eq!(dropped, report.blocks_dropped);
        prop_assert_eq!(kept.len() as u64, report.blocks_kept());
        prop_assert!(kept.iter().all(|block| points[block.payload].line == block.point.line));
    }
}
