use feedwave_program::PathControl;

use super::super::tests::{Block, Cut, blocks, polyline, within};
use super::*;

const SPEEDS: [CornerSpeed; 2] = [CornerSpeed::Steady, CornerSpeed::Changing];

/// Passes of 10 mm, 0.2 mm apart.
fn raster(passes: usize, control: PathControl) -> Vec<Block> {
    let mut points = vec![[0.0; 3]];
    for pass in 0..passes {
        let [x, y] = [if pass % 2 == 0 { 10.0 } else { 0.0 }, 0.2 * pass as f64];
        points.extend([[x, y, 0.0], [x, y + 0.2, 0.0]]);
    }
    blocks(polyline(&points), control)
}

fn joining(machine: &Machine, corner_speed: CornerSpeed) -> Joining<'_> {
    Joining { machine, many_blocks: true, corner_speed, corners: None }
}

/// What becomes of a path; `before_each` sees the smoother before every block.
fn smooth<T: Carried>(
    smoother: &mut PathSmoother<T>,
    path: impl IntoIterator<Item = (Element, PathControl, T)>,
    joining: Joining<'_>,
    before_each: impl Fn(&mut PathSmoother<T>),
) -> Vec<Smoothed<T>> {
    let mut smoothed = Vec::new();
    for (element, control, carried) in path {
        before_each(smoother);
        smoother.push(element, control, carried, joining, &mut |piece| smoothed.push(piece));
    }
    before_each(smoother);
    smoother.flush(joining, &mut |piece| smoothed.push(piece));
    smoothed
}

#[test]
fn turns_that_are_alike_are_tried_once() {
    let machine = Machine::mill();
    for corner_speed in SPEEDS {
        let [few, many] = [24, 60].map(|passes| {
            let mut smoother = PathSmoother::default();
            smooth(&mut smoother, raster(passes, within(0.05, 0.0)), joining(&machine, corner_speed), |_| {});
            smoother.answers.known.len()
        });
        // On both sides, with the first and the last ones.
        assert!((1..MOST_ANSWERS).contains(&few) && few == many, "{corner_speed:?}: {few} and {many}");
    }
}

#[test]
fn corners_by_themselves_that_are_alike_are_planned_once() {
    let machine = Machine::mill();
    let [few, many] = [100, 300].map(|count| {
        let points: Vec<_> = (0..count).map(|n| [0.1 * f64::from(n), f64::from(n % 2), 0.0]).collect();
        let mut smoother = PathSmoother::default();
        let path = blocks(polyline(&points), within(0.05, 0.0));
        smooth(&mut smoother, path, joining(&machine, CornerSpeed::Changing), |_| {});
        smoother.corners.known.len()
    });
    // On both sides, with the first and the last one.
    assert!((1..=4).contains(&few) && few == many, "{few} and {many}");
}

#[test]
fn the_path_does_not_depend_on_what_is_remembered() {
    let machine = Machine::mill();
    for corner_speed in SPEEDS {
        for tolerance_mm in [0.05, 0.2] {
            let smoothed = |before_each: fn(&mut PathSmoother<Cut>)| {
                // Behind turns that are tried together, corners by themselves.
                let mut path = raster(24, within(tolerance_mm, 0.0));
                let points: Vec<_> = (0..24).map(|n| [0.1 * f64::from(n), 5.0 + f64::from(n % 2), 0.0]).collect();
                path.extend(blocks(polyline(&points), within(tolerance_mm, 0.0)));
                smooth(&mut PathSmoother::default(), path, joining(&machine, corner_speed), before_each)
            };
            assert_eq!(smoothed(|_| {}), smoothed(|smoother| *smoother = smoother.clone()), "{corner_speed:?}");
        }
    }
}

#[test]
fn answers_are_those_of_one_machine_and_stay_few() {
    let machine = Machine::mill();
    let mut slower = Machine::mill();
    for axis in &mut slower.axes {
        axis.max_jerk_per_s3 *= 1e-3;
    }
    let path = || raster(8, within(0.02, 0.0));
    for corner_speed in SPEEDS {
        let mut used = PathSmoother::default();
        for length in 1..=MOST_ANSWERS {
            let points = [[0.0; 3], [length as f64, 0.0, 0.0], [length as f64, 0.1, 0.0], [0.0, 0.1, 0.0]];
            let turn = blocks(polyline(&points), within(0.02, 0.0));
            smooth(&mut used, turn, joining(&machine, corner_speed), |_| {});
        }
        smooth(&mut used, path(), joining(&machine, corner_speed), |_| {});
        assert_eq!(used.answers.known.len(), MOST_ANSWERS);
        let on_slower = smooth(&mut used, path(), joining(&slower, corner_speed), |_| {});
        assert!(used.answers.known.len() < MOST_ANSWERS);
        assert_eq!(on_slower, smooth(&mut PathSmoother::default(), path(), joining(&slower, corner_speed), |_| {}));
    }
}

/// Its speed depends on where it lies, for all that is known.
#[derive(Clone, Debug, PartialEq)]
struct Placed;

impl Carried for Placed {
    fn at_corner(&self, _: &Self) -> Option<Self> {
        Some(Self)
    }
}

#[test]
fn nothing_is_remembered_where_the_speed_depends_on_the_place() {
    let machine = Machine::mill();
    let mut smoother = PathSmoother::default();
    let path = raster(8, within(0.05, 0.0)).into_iter().map(|(element, control, _)| (element, control, Placed));
    smooth(&mut smoother, path, joining(&machine, CornerSpeed::Changing), |_| {});
    assert!(smoother.answers.known.is_empty());
}

#[test]
fn elements_stay_where_they_are_within_the_grid() {
    let span = [[5.0, 7.0, 0.3], [5.1, 7.0, 0.3], [5.2, 7.005, 0.3], [5.3, 7.02, 0.3]];
    let spline = Spline::from_cubic_spans(&[span]).expect("it is one");
    let place = Place { origin: [1.0 / 3.0; 9], work_offset: Position::default() };
    let [mut start, mut end] = [Position::default(); 2];
    start[..3].copy_from_slice(&span[0]);
    end[..3].copy_from_slice(&span[3]);
    let source = SourceSpan::default();
    let own = Element::from_spline(start, end, spline, Position::default(), source, false).expect("it hangs together");
    let placed = place.element(&own).expect("it is short");
    assert!((placed.length - own.length).abs() < 1e-8);
    for share in [0.0, 0.3, 0.6, 1.0] {
        let [there, here] = [placed.position(share * placed.length), own.position(share * own.length)];
        for axis in 0..3 {
            assert!((there[axis] + place.origin[axis] - here[axis]).abs() < 1e-8, "axis {axis} at {share}");
        }
    }
}
