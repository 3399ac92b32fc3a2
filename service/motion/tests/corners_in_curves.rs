//! Sharp corners and tight fillets among blocks that are smoothed out together: chords of curves, and lines with small radii between them.

use crate::common::{Path, Program, machine, within};
use crate::sharp_corners::{Numbers, seconds, times_s, walk, worst_of_larger};
use feedwave_motion::CornerSpeed;

/// Edges of an arc in chords, with a corner between two edges.
fn edges(count: usize, chords: usize, chord_mm: f64, radius_mm: f64, turn_rad: f64) -> Program {
    let leg = |index: usize| {
        let is_last = index % chords == chords - 1;
        [chord_mm, if is_last { turn_rad } else { chord_mm / radius_mm }]
    };
    walk("edges", (0..count * chords).map(leg).collect::<Vec<_>>())
}

/// Lines with a tangent arc between two of them, which turns to one side or to both in turn.
fn fillets(count: usize, line_mm: f64, radius_mm: f64, turn_rad: f64, is_one_sided: bool) -> Program {
    let (mut path, mut heading_rad) = (Path::at([0.0; 3]), 0.0);
    for index in 0..count {
        let sweep_rad = if is_one_sided || index % 2 == 0 { turn_rad } else { -turn_rad };
        path.ahead(heading_rad, line_mm);
        path.turn(heading_rad, radius_mm, sweep_rad);
        heading_rad += sweep_rad;
    }
    path.ahead(heading_rad, line_mm);
    path.named("fillets")
}

/// Lines and tangent arcs.
fn arcs(n: &mut Numbers, count: usize) -> Program {
    let (mut path, mut heading_rad) = (Path::at([0.0; 3]), 0.0);
    for _ in 0..count {
        path.ahead(heading_rad, n.scale(0.3, 10.0));
        let (radius_mm, turn_rad) = (n.scale(0.1, 15.0), n.within(0.1, 2.5));
        let sweep_rad = if n.next() < 0.5 { turn_rad } else { -turn_rad };
        path.turn(heading_rad, radius_mm, sweep_rad);
        heading_rad += sweep_rad;
    }
    path.named("arcs")
}

pub(crate) fn all_edges(seed: u64) -> [Program; 2] {
    let n = &mut Numbers(seed);
    [0, 1].map(|_| {
        let chords = n.scale(4.0, 41.0) as usize;
        edges(4, chords, n.scale(0.1, 1.0), n.scale(1.0, 30.0), n.within(0.5, 2.8))
    })
}

pub(crate) fn all_fillets(seed: u64) -> [Program; 3] {
    let n = &mut Numbers(seed);
    let [one, both] = [true, false]
        .map(|is_one_sided| fillets(6, n.scale(0.5, 20.0), n.scale(0.01, 0.3), n.within(0.4, 3.0), is_one_sided));
    [one, both, arcs(n, 8)]
}

#[test]
fn fast_plans_past_fillets_are_no_slower_than_exact_stops() {
    // In one curve with the lines beside them, they took up to 1.61 of the time.
    for seed in 0..5 {
        for program in all_fillets(seed as u64) {
            let (stop_s, within_s) = times_s(&program, seed, CornerSpeed::Steady);
            let worst_s = within_s.iter().copied().fold(0.0, f64::max);
            assert!(worst_s <= 1.001 * stop_s, "{} {seed}: {within_s:?} s, {stop_s} s with stops", program.name);
        }
    }
}

#[test]
fn in_plans_for_the_least_time_corners_among_chords_are_no_slower_with_a_larger_tolerance() {
    // In one curve with the chords beside them, they took up to 17 % longer.
    for seed in 0..5 {
        for program in all_edges(seed as u64) {
            let (stop_s, within_s) = times_s(&program, seed, CornerSpeed::Changing);
            let worst = worst_of_larger(stop_s, &within_s);
            assert!(worst <= 1.055, "{} {seed}: {within_s:?} s, {stop_s} s with stops", program.name);
        }
    }
}

/// The corner is quicker alone, though within what the chords leave of the tolerance.
#[test]
fn in_plans_for_the_least_time_a_corner_among_chords_is_rounded_alone() {
    // In one curve it took 1.00 s, and with a stop 0.932 s.
    let (program, machine) = (edges(4, 40, 0.3, 20.0, 2.0), machine());
    for (tolerance_mm, most_s) in [(0.002, 0.905), (0.005, 0.895), (0.01, 0.88), (0.02, 0.865), (0.05, 0.86)] {
        let time_s = seconds(&program, within(tolerance_mm), 12_000.0, &machine, CornerSpeed::Changing);
        assert!(time_s <= most_s, "P{tolerance_mm}: {time_s} s");
    }
}
