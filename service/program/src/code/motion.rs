//! Codes of motion, feed and spindle.

crate::finding_codes! {
    /// Codes of motion, feed and spindle.
    pub MOTION_CODES: "Motion, feed and spindle";

    "PRG-MOTION-MISSING" [MOTION_MISSING: Error] {
        meaning: "axis words, but no motion code in force",
        cause: "The program starts without G0 or G1, of which a parameter of FANUC controls says which one is in force then, and the \
              machine profile does not; or it goes on after `G5.3` without one.",
        cure: "Add the motion code to the block, or state `language.initial_motion` in the profile.",
        explained_by: modal("G"),
        example: lathe("X10 Z5"),
    }

    "PRG-FEED-MISSING" [FEED_MISSING: Error] {
        meaning: "a cutting move without a valid feed; the F of a thread is none",
        cause: "No F was programmed in this feed mode, the mode was changed after it, a thread took its place, or \
              inverse time (`G93`) has none in the block.",
        cure: "Add F to the block.",
        explained_by: modal("FG"),
        example: lathe("M3 S1000\nG1 X10"),
    }

    "PRG-FEED-NOT-POSITIVE" [FEED_NOT_POSITIVE: Error] {
        meaning: "a feed that is zero, negative or too small to be valid",
        cause: "An F0 of the post, a sign, or a number far below what a machine can do (under 1e-9).",
        cure: "Write the feed that is meant; the feed override stops a machine, not F0.",
        example: lathe("G1 X10 F0"),
    }

    "PRG-FEED-WITHOUT-POINT" [FEED_WITHOUT_POINT: Error] {
        meaning: "a feed or lead per revolution without a decimal point where such numbers are increments",
        cause: "With `decimal_point` as least increments, F20 is 0.20, 0.020 or 0.0020 per revolution by the control, or 20.",
        cure: "Write the feed with a decimal point.",
        explained_by: block("F"),
        example: on("lathe, language.decimal_point = DECIMAL_POINT_RULE_LEAST_INCREMENT", "S500 M3\nG1 X10000 F20"),
    }

    "PRG-SPINDLE-STOPPED" [SPINDLE_STOPPED: Error] {
        meaning: "feed per revolution or a thread with a spindle that does not turn",
        cause: "No M3 or M4 with an S comes before it, or M5 stopped the spindle: the move would never advance.",
        cure: "Start the spindle before, such as `M3 S1000`, or program the feed per minute.",
        explained_by: modal("SMG"),
        example: lathe("G1 X10 F0.2"),
    }

    "PRG-SPEED-INVALID" [SPEED_INVALID: Error] {
        meaning: "a spindle speed that is negative or too small to be valid, or a speed clamp that is not positive",
        cause: "S is negative, or the S of a clamp (`G50`, `G92`) is 0; the direction is that of M3 and M4.",
        cure: "Write a positive speed, and M4 for the other direction.",
        example: lathe("M3 S-500"),
    }

    "PRG-SPEED-MISSING" [SPEED_MISSING: Error, SPEED_IN_FORCE: Warning] {
        meaning: "a speed mode or clamp without its S word: an error where no speed is known, a warning where the \
              present one stays",
        cause: "`G96` has no surface speed, `G50` or `G92` no clamp; or `G97` without S goes on at the speed of the \
              present radius, which the program's clamp and the machine's limit bound.",
        cure: "Add S to the block.",
        explained_by: modal("S"),
        example: lathe("G96 M3"),
    }

    "PRG-SPEED-CLAMP-MISSING" [SPEED_CLAMP_MISSING: Warning] {
        meaning: "constant surface speed without a speed clamp",
        cause: "`G96` is in force, and no `G50 S` or `G92 S` limits the speed, which grows without limit towards X0.",
        cure: "Program the highest speed of chuck and work before it, such as `G50 S3000`.",
        explained_by: modal("SG"),
        example: lathe("G96 S200 M3"),
    }

    "PRG-DWELL-TIME" [DWELL_TIME: Error] {
        meaning: "a dwell without a valid time",
        cause: "`G4` has no P or X (on lathes U), or a negative one.",
        cure: "Add the time: P in milliseconds or seconds as the profile says, X and U in seconds.",
        explained_by: block("PXU"),
        example: lathe("G4"),
    }

    "PRG-ARC-INVERSE-TIME" [ARC_INVERSE_TIME: Error] {
        meaning: "an arc under inverse time (`G93`), whose F controls read differently",
        cause: "FANUC controls have F of a line as its speed over its length, but F of an arc as its speed over its radius; Haas and \
              LinuxCNC have one over the time for both.",
        cure: "Write the arc under `G94` with its feed; on a Haas control say so in the profile \
              (`language.drilling.style` or `language.coordinates.style`).",
        explained_by: modal("FG"),
        example: mill("M3 S1000\nG93 G2 X10 Y10 R10 F5"),
    }

    "PRG-ARC-CENTRE-MISSING" [ARC_CENTRE_MISSING: Error] {
        meaning: "an arc with neither a centre nor a radius",
        cause: "I, J, K and R are missing, or belong to axes outside the plane in force.",
        cure: "Add the centre in the words of the plane (G17: I J, G18: I K, G19: J K) or the radius R.",
        explained_by: block("IJKR"),
        example: lathe("M3 S1000\nG2 X20 Z-5 F0.2"),
    }

    "PRG-ARC-CENTRE-AMBIGUOUS" [ARC_CENTRE_AMBIGUOUS: Error] {
        meaning: "an arc with both a centre and a radius",
        cause: "The block has R beside I, J or K, and they may say different circles.",
        cure: "Keep one of them.",
        example: mill("G2 X10 Y0 I5 J0 R5 F100"),
    }

    "PRG-ARC-RADIUS-MISMATCH" [ARC_RADIUS_MISMATCH: Error] {
        meaning: "start and end of an arc are not equally far from its centre",
        cause: "A wrong end point, an absolute centre where the incremental one is meant, a diameter for a radius, or \
              too few decimals.",
        cure: "Check end point and centre; `arc_radius_tolerance_mm` of the profile's language says which rounding is \
              accepted.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: mill("G2 X10 Y0 I4 J0 F100"),
    }

    "PRG-ARC-RADIUS-ZERO" [ARC_RADIUS_ZERO: Error] {
        meaning: "an arc that starts or ends at its own centre",
        cause: "The centre words are zero, or are those of the end point.",
        cure: "Check the centre and the end point.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: mill("G2 X10 Y0 I0 J0 F100"),
    }

    "PRG-ARC-RADIUS-TOO-SMALL" [ARC_RADIUS_TOO_SMALL: Error] {
        meaning: "a radius that cannot reach from start to end",
        cause: "R is less than half of the distance from start to end.",
        cure: "Use the least radius that the finding names or a larger one, or check the end point.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: mill("G2 X10 Y0 R4 F100"),
    }

    "PRG-ARC-FULL-BY-RADIUS" [ARC_FULL_BY_RADIUS: Error] {
        meaning: "an arc by radius whose end is its start has no definite centre",
        cause: "A full circle was programmed with R.",
        cure: "Write a full circle with its centre (I, J, K).",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: mill("G2 X0 Y0 R5 F100"),
    }

    "PRG-ARC-TURNS" [ARC_TURNS: Error] {
        meaning: "an arc whose number of turns is no whole number from 1 on",
        cause: "P of an arc of LinuxCNC says how often it passes its end; it is 0, negative, broken or beyond 10000.",
        cure: "Write P as a whole number, or leave it out for one turn at most.",
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "G2 X0 Y0 I5 P0 F100"),
    }

    "PRG-PATH-TOLERANCE" [PATH_TOLERANCE: Error, PATH_TOLERANCE_LIMITED: Warning] {
        meaning: "a tolerance of a path control that is negative or too large; a Q of G64 beyond its P is a warning, and P holds",
        cause: "P or Q of `G64`, or E of `G187`, is outside 0 to 10 mm, often for a missing decimal point; Q, which merges \
              lines, is part of P.",
        cure: "Write how far the path may leave the programmed one, such as `G64 P0.01`, and Q at most as large.",
        example: mill("G64 P50"),
    }

    "PRG-MACHINE-MOTION" [MACHINE_MOTION: Error] {
        meaning: "G53 without straight motion or with incremental words",
        cause: "`G53` is programmed with an arc, a spline or a thread, with U or W, or without axis words.",
        cure: "Write `G53` with G0 or G1 and absolute axis words.",
        explained_by: block("XYZUVWABCHIJKR"),
        example: lathe("G53 G0 U5"),
    }

    "PRG-REFERENCE-AXIS" [REFERENCE_AXIS: Error] {
        meaning: "G28 without an axis",
        cause: "The return to the reference position names no axis, so none would move.",
        cure: "Name the axes with their intermediate point, such as `G28 U0 W0`.",
        explained_by: block("XYZUVWABCHIJKR"),
        example: lathe("G28"),
    }

    "PRG-SPLINE-POINT-MISSING" [SPLINE_POINT_MISSING: Error] {
        meaning: "a spline without the words of one of its control points",
        cause: "`G5` lacks P or Q, the first of a series I and J; or the control point of `G5.1` is its start.",
        cure: "Add the missing words; in `G5.1` give a control point other than the start, or use G1.",
        explained_by: block("XYZIJKPQ"),
        example: mill("G5 X10 Y10 I2 J2 P-2 F100"),
    }

    "PRG-SPLINE-AXIS" [SPLINE_AXIS: Error] {
        meaning: "a spline block with a word of an axis outside its plane",
        cause: "A spline runs in the plane in force, and the block moves a third axis.",
        cure: "Move the other axes in a block of their own, or select the plane before.",
        example: mill("G5.1 X10 Y0 Z5 I5 J5 F100"),
    }

    "PRG-NURBS-POINT" [NURBS_POINT: Error] {
        meaning: "a control point of a NURBS without both of its coordinates",
        cause: "One coordinate was left out as for a line, or a weight P comes without a point after the first one.",
        cure: "Write both coordinates of every control point, also the one that does not change.",
        explained_by: block("XYZIJKPQ"),
        example: mill("G5.2 X5 F100\nG5.3"),
    }

    "PRG-NURBS-WEIGHT" [NURBS_WEIGHT: Error] {
        meaning: "a weight of a control point that is not positive or out of range, or is missing in LinuxCNC",
        cause: "P of a control point is outside 0.000001 to 1000000; LinuxCNC takes no point without P, other controls \
                weigh it as 1.",
        cure: "Use P1 for an ordinary control point.",
        explained_by: block("P"),
        example: mill("G5.2 X5 Y5 P0 F100\nG5.3"),
    }

    "PRG-NURBS-ORDER" [NURBS_ORDER: Error] {
        meaning: "an order of a NURBS that is out of range or larger than the number of its control points",
        cause: "L is outside 3 to 10, or there are fewer control points than L before `G5.3`, the start included.",
        cure: "Use L3 or L4, or add control points.",
        example: mill("G5.2 X5 Y5 L12 F100\nG5.3"),
    }

    "PRG-NURBS-TOO-LONG" [NURBS_TOO_LONG: Error] {
        meaning: "a NURBS with more control points than are supported",
        cause: "There are more than 10000 control points between `G5.2` and `G5.3`.",
        cure: "Close it with `G5.3` and open another one.",
        example: words("10001 control points between G5.2 and G5.3"),
    }

    "PRG-NURBS-UNFINISHED" [NURBS_UNFINISHED: Error] {
        meaning: "something other than control points between G5.2 and G5.3",
        cause: "Another code, F, S or T, or the end of the program comes before `G5.3`.",
        cure: "Close the NURBS with `G5.3` first, and write F in its first block.",
        example: mill("G5.2 X5 Y5 F100\nX10 Y0\nG1 X20"),
    }

    "PRG-NURBS-NOT-OPEN" [NURBS_NOT_OPEN: Error] {
        meaning: "G5.3 without G5.2",
        cause: "A NURBS is closed that was never opened, or that another code has ended.",
        cure: "Open it with `G5.2`, or remove `G5.3`.",
        explained_by: modal("G"),
        example: mill("G5.3"),
    }

    "PRG-PATH-REQUEST" [PATH_REQUEST: Error, PATH_REQUEST_NOTED: Info] {
        meaning: "a request of path control with a word that it does not know: an error; one that changes nothing here is noted",
        cause: "`G5.1` takes Q0 and Q1 with R1 to R10, `G5` P0 and P10000, `G8` P0 and P1, `G187` P1 to P3. `G62` and \
              `G63` ask for overrides at corners and while tapping, which are the machine's.",
        cure: "Write the word as the control knows it; which tolerance a level stands for is in `contour_tolerances_mm` of \
              the profile's language.",
        example: mill("G8 P2"),
    }

    "PRG-PROBE" [PROBE: Error, PROBE_UNKNOWN: Warning] {
        meaning: "a probing move: a warning, as where it ends is not known; an error where it cannot be one",
        cause: "`G31`, `G36`, `G37` or `G38.2` to `G38.5` ends at a contact that only the machine finds. The whole travel is \
              taken as the path, at the feed. A move of rotary axes, under `G93` or without travel cannot probe, but `G38.3` and \
              `G38.5` of LinuxCNC, which raise no alarm, need no travel.",
        cure: "Check what the program does with the result; no part of it is judged by what the probe would find. The profile brings a \
               result (`[[language.parameters]]`, `#5061` and on, of LinuxCNC `#5070` as well), or the job (`[[parameters]]` of its \
               offsets).",
        example: mill("G31 Z-10 F100"),
    }

    "PRG-CORNER" [CORNER: Error, CORNER_STRAIGHT: Info] {
        meaning: "a chamfer, a rounding or a line with an angle that cannot be made; noted where there is no corner",
        cause: "The next block is no move with G1, G2 or G3 in the plane, the corner is larger than one of the moves, a sign \
              says the wrong side, or two lines with angles are parallel. Where the path goes straight on there is nothing to cut or \
              to round.",
        cure: "Let the move that the corner leads to follow at once, make the corner smaller, or write it as a block of its own.",
        example: mill("G1 X10 ,R5 F100\nY2\nX0"),
    }
}
