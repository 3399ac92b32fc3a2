//! Coordinates that are shifted between the passes of a thread: the work and the groove stay where they are.

use super::{lathe, near};
use crate::common::{run, validate};
use feedwave_cutting::thread::{ThreadSectionReport, ThreadSide};

/// A pass of X 9, what comes between, and the pass that follows.
fn program(between: &str, second: &str) -> String {
    format!(
        "G21 G18 G40\nG10 P1 X0 Z0\nG10 P2 X0.02 Z0\nG97 S300 M3\nT0101\nG0 X14 Z5\nG165 P3 X10 Q1.6\nG0 X9\nG32 Z-20 F1.5\n\
         G0 X14\nZ5\n{between}\n{second}\nG0 X16\nG165 P0\nM30\n"
    )
}

fn only_thread(text: &str) -> ThreadSectionReport {
    let report = validate(text, &lathe());
    let [section] =
        <[_; 1]>::try_from(report.threads).unwrap_or_else(|threads| panic!("{} threads: {text}", threads.len()));
    section
}

#[test]
fn the_work_stays_where_it_is_when_coordinates_shift_behind_its_statement() {
    for (between, second) in [
        ("", "G0 X8.6"),
        ("G50 U2", "G0 X10.6"),
        ("G50 X16", "G0 X10.6"),
        ("G52 X-2", "G0 X10.6"),
        ("G10 L2 P1 X-2", "G0 X10.6"),
        ("G10 L2 P2 X-2\nG55", "G0 X10.6"),
        ("G10 P0 X-2 Z0", "G0 X10.6"),
        ("#5221=-2.", "G0 X10.6"),
        ("#5201=-2.", "G0 X10.6"),
    ] {
        let text = program(between, &format!("{second}\nG32 Z-20 F1.5"));
        let section = only_thread(&text);
        assert_eq!(section.job.geometry.side, ThreadSide::External, "{between}");
        let [_, pass] = &section.job.passes[..] else { panic!("{between}: {:?}", section.job.passes) };
        assert!(near(pass.depth_mm, 0.7, 1e-9) && near(pass.amplitude_mm, 0.32, 1e-9), "{between}: {pass:?}");
        assert_eq!(pass.phase_shift_deg, 180.0, "{between}");
        // On the machine it retreats from the work, and is never deeper than programmed.
        let setpoints = run(&text, &lathe());
        let line = pass.span.line;
        let x: Vec<f64> =
            (0..setpoints.len()).filter(|&k| setpoints.line[k] == line).map(|k| setpoints.axes[0][k]).collect();
        let [least, most] = [f64::min, f64::max].map(|pick| x.iter().copied().reduce(pick).expect("a pass"));
        assert!(near(least, 4.3, 1e-9) && near(most, 4.62, 1e-3), "{between}: {least} {most}");
    }
}

#[test]
fn another_offset_of_the_tool_goes_on_with_the_thread() {
    // The wear of 0.02 on the diameter leads the tool 0.01 less deep.
    let section = only_thread(&program("T0102", "G0 X14 Z5\nG0 X8.6\nG32 Z-20 F1.5"));
    let [_, pass] = &section.job.passes[..] else { panic!("{:?}", section.job.passes) };
    assert!(near(pass.depth_mm, 0.69, 1e-9) && near(pass.amplitude_mm, 1.6 * 0.19, 1e-9), "{pass:?}");
    assert_eq!(pass.phase_shift_deg, 180.0);
    // An offset called behind the statement of the work moves tool and work.
    let section =
        only_thread("G10 P1 X-60 Z-30\nG97 S300 M3\nG165 P3 X10 Q1.6\nT0101\nG0 X9 Z5\nG32 Z-20 F1.5\nG165 P0\nM30\n");
    assert!(near(section.job.passes[0].depth_mm, 0.5, 1e-9));
}

#[test]
fn a_start_that_is_cut_under_a_shift_is_one_of_the_thread() {
    let shifted = only_thread(&program(
        "G52 Z0.75",
        "G0 Z5\nG0 X9\nG32 Z-20 F1.5\nG0 X14\nZ5\nG52 Z0\nG0 Z5\nG0 X8.6\nG32 Z-20 F1.5",
    ));
    let written =
        only_thread(&program("", "G0 Z5.75\nG0 X9\nG32 Z-19.25 F1.5\nG0 X14\nZ5.75\nG0 Z5\nG0 X8.6\nG32 Z-20 F1.5"));
    let passes = |section: &ThreadSectionReport| {
        let passes = section.job.passes.iter();
        passes
            .map(|pass| (pass.start, pass.amplitude_mm, pass.phase_shift_deg, pass.start_travel_mm))
            .collect::<Vec<_>>()
    };
    assert_eq!(passes(&shifted), passes(&written));
    let last = passes(&shifted)[2];
    assert!(last.0 == 0 && near(last.1, 0.32, 1e-9) && last.2 == 180.0, "{last:?}");
}
