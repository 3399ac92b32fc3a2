use super::*;
use crate::smoothing::test_path::at;

#[test]
fn largest_distance_counts() {
    let between = [[1.0, 0.01, 0.0], [2.0, 0.0, -0.02], [3.0, 0.003, 0.004]];
    let used = deviation(&at([0.0; 3]), &between, &at([4.0, 0.0, 0.0]), 0.02).expect("within");
    assert!((used.largest_mm - 0.02).abs() < 1e-15 && used.at_mm == 2.0, "{used:?}");
    assert_eq!(deviation(&at([0.0; 3]), &between, &at([4.0, 0.0, 0.0]), 0.019), None);
}

#[test]
fn points_out_of_order_are_no_line() {
    let [start, end] = [at([0.0; 3]), at([4.0, 0.0, 0.0])];
    assert_eq!(deviation(&start, &[[2.0, 0.0, 0.0], [1.9, 0.0, 0.0]], &end, 1.0), None, "turns back");
    assert_eq!(deviation(&start, &[[4.1, 0.0, 0.0]], &end, 1.0), None, "beyond the end");
    assert_eq!(deviation(&start, &[[-0.1, 0.0, 0.0]], &end, 1.0), None, "before the start");
    assert_eq!(deviation(&start, &[[1.0, 0.0, 0.0]], &start, 1.0), None, "comes back to where it began");
}
