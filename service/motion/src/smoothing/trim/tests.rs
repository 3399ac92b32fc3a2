use core::f64::consts::TAU;

use proptest::prelude::*;

use crate::smoothing::test_path::{Shape, shapes};

#[test]
fn a_part_of_nothing_is_nothing() {
    let element = Shape::Line { by: [3.0, 4.0, 0.0] }.element([0.0; 3]);
    assert_eq!(element.part(2.0, 2.0), None);
}

#[test]
fn whole_elements_are_parts_of_themselves() {
    let line = Shape::Line { by: [3.0, 4.0, 12.0] }.element([1.0, 2.0, 3.0]);
    assert_eq!(line.part(0.0, line.length).as_ref(), Some(&line));
    let arc = Shape::Arc { radius: 7.0, direction: 1.0, sweep: 0.3 * TAU, rise: 2.0 }.element([1.0, 2.0, 3.0]);
    assert_eq!(arc.part(0.0, arc.length).as_ref(), Some(&arc));
}

proptest! {
    #[test]
    fn parts_run_along_the_whole(shape in shapes(), ends in (0.0..0.5_f64, 0.5..1.0_f64), share in 0.0..1.0_f64) {
        let whole = shape.element([3.0, -2.0, 1.0]);
        let [from, to] = [ends.0 * whole.length, ends.1 * whole.length];
        for (from, to) in [(from, to), (0.0, to), (from, whole.length)] {
            let part = whole.part(from, to).expect("it has a length");
            prop_assert!((part.length - (to - from)).abs() < 1e-12 * (1.0 + whole.length));
            let s = share * part.length;
            for (found, wanted) in part.position(s).iter().zip(whole.position(from + s)) {
                prop_assert!((found - wanted).abs() < 1e-12 * (1.0 + whole.length), "{found} for {wanted}");
            }
            for (found, wanted) in part.tangent(s).iter().zip(whole.tangent(from + s)) {
                prop_assert!((found - wanted).abs() < 1e-12 * (1.0 + 1.0 / part.length), "{found} for {wanted}");
            }
            if from == 0.0 {
                prop_assert_eq!(part.position(0.0), whole.start);
            }
            if to == whole.length {
                prop_assert_eq!(part.position(part.length), whole.end);
            }
        }
    }
}
