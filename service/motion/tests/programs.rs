//! The seven programs of [`common`]: what path control makes of their times.

use crate::common::{machine, planned, programs, seconds, within};
use feedwave_program::PathControl;

#[test]
fn every_program_hangs_together() {
    for program in programs() {
        let elements = program.elements();
        assert_eq!(elements.len(), program.blocks.len(), "{}: every block moves", program.name);
        for pair in elements.windows(2) {
            assert_eq!(pair[0].end, pair[1].start, "{}", program.name);
        }
        assert!(program.text("G64 P0.05").lines().count() > program.blocks.len());
    }
}

#[test]
fn short_blocks_run_more_than_twice_as_fast_as_corner_by_corner() {
    // Seconds within 0.01 mm and 0.05 mm when each corner was rounded by itself.
    let before = [
        (crate::common::chord_circle(), [7.718, 7.718]),
        (crate::common::raster(), [25.768, 25.878]),
        (crate::common::freeform(), [12.632, 12.632]),
    ];
    let machine = machine();
    for (program, before) in before {
        for (tolerance_mm, before) in [0.01, 0.05].into_iter().zip(before) {
            let now = seconds(&program, within(tolerance_mm), &machine);
            assert!(now * 2.2 <= before, "{} within {tolerance_mm} mm: {now} s", program.name);
        }
    }
}

#[test]
fn rounding_never_costs_time() {
    let machine = machine();
    for program in programs() {
        let stop = seconds(&program, PathControl::ExactStop, &machine);
        for tolerance_mm in [0.002, 0.01, 0.05, 0.1, 0.3] {
            let now = seconds(&program, within(tolerance_mm), &machine);
            println!("| {} | {tolerance_mm} mm | {now:.3} s | {stop:.3} s |", program.name);
            assert!(now <= stop * 1.001, "{} within {tolerance_mm} mm: {now} s of {stop} s", program.name);
        }
    }
}

#[test]
fn a_circle_in_chords_does_not_stop_on_its_way() {
    // From a speed from which the path can just stop before its last blocks, it cannot reach the low speed that they want.
    let machine = machine();
    for tolerance_mm in [0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.05, 0.1] {
        let stretches = planned(&crate::common::chord_circle(), within(tolerance_mm), &machine);
        let inside = &stretches[..stretches.len() - 1];
        let lowest = inside.iter().map(|&(_, speed)| speed).fold(f64::INFINITY, f64::min);
        assert!(lowest > 5.0, "{lowest} mm/s within {tolerance_mm} mm");
    }
}

#[test]
fn a_larger_tolerance_hardly_costs_time() {
    let machine = machine();
    for program in programs() {
        // Where short blocks become one curve, another tolerance brings another curve, which is gathered into other runs.
        let is_curve = ["chord circle", "raster", "freeform"].contains(&program.name);
        let most = if is_curve { 1.03 } else { 1.001 };
        let mut best = seconds(&program, PathControl::ExactStop, &machine);
        for tolerance_mm in [0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3]
        {
            let now = seconds(&program, within(tolerance_mm), &machine);
            assert!(now <= best * most, "{} within {tolerance_mm} mm: {now} after {best} s", program.name);
            best = best.min(now);
        }
    }
}

#[test]
fn merging_costs_no_time() {
    // G64 P without Q merges within P, as far as merging may use it.
    let machine = machine();
    for program in [crate::common::chord_circle(), crate::common::raster(), crate::common::freeform()] {
        for tolerance_mm in [0.002_5, 0.01, 0.05, 0.2] {
            let merged = PathControl::Continuous { tolerance_mm, merge_tolerance_mm: tolerance_mm };
            let [with, without] = [merged, within(tolerance_mm)].map(|control| seconds(&program, control, &machine));
            assert!(with <= 1.02 * without, "{} within {tolerance_mm} mm: {with} of {without} s", program.name);
        }
    }
}

#[test]
fn a_sharp_corner_among_short_blocks_is_no_slower_than_a_stop_in_it() {
    // Legs in blocks of 0.2 mm that meet at right angles: as fast as the legs in one block each, which stop in their corners.
    let machine = machine();
    let legs = |per_leg: u32| {
        let mut at = [0.0; 3];
        let mut blocks = Vec::new();
        for leg in 0..8 {
            let from = at[leg % 2];
            for k in 1..=per_leg {
                at[leg % 2] = from + 8.0 * f64::from(k) / f64::from(per_leg);
                blocks.push(crate::common::Block::Line(at));
            }
        }
        crate::common::Program { name: "legs", start: [0.0; 3], blocks }
    };
    let whole = seconds(&legs(1), PathControl::ExactStop, &machine);
    for tolerance_mm in [0.01, 0.05, 0.2] {
        let short = seconds(&legs(40), within(tolerance_mm), &machine);
        assert!(short <= 1.001 * whole, "{short} of {whole} s within {tolerance_mm} mm");
    }
}

#[test]
fn tangent_arcs_cost_less_than_stopping() {
    let machine = machine();
    for program in [crate::common::pocket(), crate::common::lines_and_arcs(), crate::common::line_arc_line()] {
        let stop = seconds(&program, PathControl::ExactStop, &machine);
        for tolerance_mm in [0.01, 0.05] {
            let now = seconds(&program, within(tolerance_mm), &machine);
            assert!(now < 0.9 * stop, "{} within {tolerance_mm} mm: {now} s against {stop} s", program.name);
        }
    }
}

#[test]
#[ignore = "prints the table of docs/performance.md"]
fn table() {
    let machine = machine();
    for program in programs() {
        let stop = seconds(&program, PathControl::ExactStop, &machine);
        let [fine, coarse] = [0.01, 0.05].map(|tolerance_mm| seconds(&program, within(tolerance_mm), &machine));
        println!("| {} | {stop:.3} s | {fine:.3} s | {coarse:.3} s |", program.name);
    }
}
