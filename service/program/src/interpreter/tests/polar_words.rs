//! Polar words of LinuxCNC, `@` and `^`, checked with rs274.

use super::*;

#[test]
fn a_word_that_is_not_written_is_that_of_the_start() {
    check(
        &linuxcnc(),
        "G1 F100 @10 ^45\n^90\n@20\n@5 ^0 Z3\nG0 @-5 ^180",
        "line 0 -> X7.071068 Y7.071068 @100/min
         line X7.071068 Y7.071068 -> Y10 @100/min
         line Y10 -> Y20 @100/min
         line Y20 -> X5 Z3 @100/min",
    );
    check(&linuxcnc(), "G0 @[1+2] ^-[45*2]", "rapid 0 -> Y-3");
}

#[test]
fn incremental_words_add_to_those_of_the_start() {
    check(
        &linuxcnc(),
        "G0 X1 Y1\nG91 @1 ^45\n^90",
        "rapid 0 -> X1 Y1\nrapid X1 Y1 -> Y2.414214\nrapid Y2.414214 -> X-2.414214",
    );
}

#[test]
fn units_scale_them_and_diameters_do_not() {
    check(&linuxcnc(), "G20 G0 @1 ^90", "rapid 0 -> Y25.4");
    check(&linuxcnc(), "G7 G0 X10\n@10", "rapid 0 -> X5\nrapid X5 -> X10");
}

#[test]
fn every_motion_takes_them() {
    check(&linuxcnc(), "G0 X10\nG3 F10 ^90 I-10", "rapid 0 -> X10\narc X10 -> Y10 about 0,0 by 90 @10/min");
    check(&linuxcnc(), "G0 X3 Y4\nG38.3 @10 F10", "rapid 0 -> X3 Y4\nline X3 Y4 -> X6 Y8 @10/min\nw 2:1+13 PRG-PROBE");
    check(&linuxcnc(), "G0 @10 ^0 G4 P1", "dwell 1\nrapid 0 -> X10");
    check(&linuxcnc(), "G92 X1 Y1\nG0 @10 ^90", "rapid X1 Y1 -> Y10");
}

#[test]
fn repeated_holes_go_on_from_each_other() {
    let (operations, findings) = Interpreter::new(linuxcnc()).read_all(b"G81 @10 ^0 Z-5 R2 F100\nG91 ^45 L2\nM2\n");
    assert!(findings.findings().is_empty(), "{:?}", findings.findings());
    let bottoms: Vec<_> = operations.iter().map(render_operation).filter(|line| line.starts_with("line")).collect();
    assert_eq!(
        bottoms,
        [
            "line X10 Z2 -> X10 Z-5 @100/min",
            "line X7.071068 Y7.071068 Z2 -> X7.071068 Y7.071068 Z-3 @100/min",
            "line Y10 Z2 -> Y10 Z-3 @100/min",
        ]
    );
}
