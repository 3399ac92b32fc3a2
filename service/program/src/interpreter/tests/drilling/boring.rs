//! Boring, also with an oriented tool.

use super::*;

#[test]
fn boring() {
    drills(
        &mill(),
        "G85 X0 Z-8 R2 F100\nG89 X1 P100",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         line Z-8 -> Z2 @100/min
         rapid Z2 -> Z10
         rapid Z10 -> X1 Z10
         rapid X1 Z10 -> X1 Z2
         line X1 Z2 -> X1 Z-8 @100/min
         dwell 0.1
         line X1 Z-8 -> X1 Z2 @100/min
         rapid X1 Z2 -> X1 Z10",
    );
    drills(
        &linuxcnc(),
        "G98 G85 X0 Z-8 R2 F100\nG89 X0 Z-8 R2 P0.1",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         line Z-8 -> Z2 @100/min
         rapid Z2 -> Z10
         rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         dwell 0.1
         line Z-8 -> Z10 @100/min",
    );
    drills(
        &mill(),
        "G86 X0 Z-8 R2 P100 F100",
        "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         dwell 0.1
         spindle off 1000
         rapid Z-8 -> Z10
         spindle cw 1000",
    );
}

#[test]
fn boring_with_an_oriented_tool() {
    let fine = "rapid Z10 -> Z2
         line Z2 -> Z-8 @100/min
         spindle off 1000
         M19 Barrier
         rapid Z-8 -> X0.5 Z-8
         rapid X0.5 Z-8 -> X0.5 Z10
         rapid X0.5 Z10 -> Z10
         spindle cw 1000";
    drills(&stated(), "G76 X0 Z-8 R2 Q0.5 F100", fine);
    drills(&mill(), "G76 X0 Z-8 R2 I0.5 F100", fine);
    drills(&mill(), "G76 X0 Z-8 R2 Q0.5 F100", "! 3:1+23 PRG-CYCLE-SETTING");
    drills(
        &stated(),
        "G87 X0 Z-15 R-20 Q0.5 F100",
        "spindle off 1000
         M19 Barrier
         rapid Z10 -> X0.5 Z10
         rapid X0.5 Z10 -> X0.5 Z-20
         rapid X0.5 Z-20 -> Z-20
         spindle cw 1000
         line Z-20 -> Z-15 @100/min
         spindle off 1000
         M19 Barrier
         rapid Z-15 -> X0.5 Z-15
         rapid X0.5 Z-15 -> X0.5 Z10
         rapid X0.5 Z10 -> Z10
         spindle cw 1000",
    );
    drills(&stated(), "G99 G87 X0 Z-15 R-20 Q0.5 F100", "! 3:1+30 PRG-CYCLE-UNDEFINED");
}
