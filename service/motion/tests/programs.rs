//! The seven programs of [`common`]: what path control makes of their times.

mod common;

use common::{machine, programs, seconds, within};
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
#[ignore = "prints the table of docs/performance.md"]
fn table() {
    let machine = machine();
    for program in programs() {
        let stop = seconds(&program, PathControl::ExactStop, &machine);
        let [fine, coarse] = [0.01, 0.05].map(|tolerance_mm| seconds(&program, within(tolerance_mm), &machine));
        println!("| {} | {stop:.3} s | {fine:.3} s | {coarse:.3} s |", program.name);
    }
}
