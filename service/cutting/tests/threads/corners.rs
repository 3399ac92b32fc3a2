//! Corners between the blocks of one thread, against the setpoints.

use super::{codes, lathe};
use crate::common::{run, validate};

use feedwave_cutting::PipelineConfig;
use feedwave_program::Finding;

fn value(finding: &Finding, name: &str) -> f64 {
    finding.values.iter().find(|value| value.name == name).map_or(f64::NAN, |value| value.value)
}

/// The corners that are named: line, deviation along X on the radius and Z, and the speed of the spindle that is advised.
fn named(program: &str) -> Vec<(u32, [f64; 2], f64)> {
    let report = validate(program, &lathe());
    let corners = report.findings.iter().filter(|finding| finding.code.name() == "THREAD-CORNER");
    let advised = |finding: &Finding| {
        finding.suggestions.iter().find_map(|suggestion| suggestion.value.as_ref().map(|value| value.value))
    };
    corners
        .map(|finding| {
            let off = [value(finding, "deviation_x"), value(finding, "deviation_z")];
            (finding.span.line, off, advised(finding).unwrap_or(f64::NAN))
        })
        .collect()
}

/// Setpoint that is nearest to a corner, from there, X on the radius and Z.
fn nearest(program: &str, corner: [f64; 2]) -> [f64; 2] {
    let setpoints = run(program, &PipelineConfig { interpolation_period_us: 100, ..lathe() });
    let apart = |k: usize| [setpoints.axes[0][k] - corner[0], setpoints.axes[1][k] - corner[1]];
    let length = |k: &usize| apart(*k)[0].hypot(apart(*k)[1]);
    (0..setpoints.len()).map(|k| (length(&k), k)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| apart(k)).unwrap()
}

#[test]
fn a_corner_that_is_cut_is_named_with_its_deviation_and_the_speed_that_keeps_it() {
    let program = |speed: f64| format!("G97 S{speed} M3\nG0 X20 Z5\nG32 X40 Z-15 F3\nG32 Z-40 F3\nG0 X62\nM30\n");
    let [(line, off, advised)] = named(&program(2_000.0))[..] else { panic!() };
    assert_eq!(line, 4);
    // Into the work: the axis is on the inner side.
    let found = nearest(&program(2_000.0), [20.0, -15.0]);
    let apart = off[0].hypot(off[1]) - found[0].hypot(found[1]);
    assert!(off[0] < -0.15 && apart.abs() < 0.001, "{off:?} {found:?}");
    assert!(named(&program(advised)).is_empty() && !named(&program(2.0 * advised)).is_empty(), "{advised}");
    let kept = nearest(&program(advised), [20.0, -15.0]);
    assert!(kept[0].hypot(kept[1]) < 0.02, "{kept:?}");
}

#[test]
fn threads_on_one_line_have_no_corner() {
    for program in [
        "G97 S2000 M3\nG0 X40 Z5\nG32 Z-15 F2\nG32 Z-40 F2\nG0 X62\nM30\n",
        // Slow enough.
        "G97 S200 M3\nG0 X20 Z5\nG32 Z-20 F2\nG32 X22 Z-40 F2\nG0 X30\nM30\n",
        // It is pulled out.
        "G97 S600 M3\nG0 X24 Z5\nG92 X19.3 Z-30 F2\nG0 X30\nM30\n",
    ] {
        assert!(named(program).is_empty(), "{program}: {:?}", codes(&validate(program, &lathe())));
    }
}
