//! Codes of tool length, tool centre point control and tilted planes as they are programmed.

crate::finding_codes! {
    /// Codes of tool length, tool centre point control and tilted planes as they are programmed.
    pub TOOL_CODES: "Tool length, tool centre point control and tilted planes";

    "PRG-LENGTH-NUMBER" [LENGTH_NUMBER: Error] {
        meaning: "tool length compensation without the number of a tool length",
        cause: "`G43` or `G44` has no H, and no length was in force before.",
        cure: "Add H with the number of the tool, or switch the compensation off with G49.",
        explained_by: block("H"),
        example: mill("G43 Z100"),
    }

    "PRG-LENGTH-NONE" [LENGTH_NONE: Warning] {
        meaning: "tool length compensation by `H0`, which is no length",
        cause: "The offset 0 of FANUC and Haas controls is always 0: Z is that of the machine's control point behind it, as behind `G49`.",
        cure: "Write G49 where no length is meant, else the number of the tool's length.",
        example: mill("G43 H0 Z100"),
    }

    "PRG-LENGTH-OTHER-TOOL" [LENGTH_OTHER_TOOL: Warning] {
        meaning: "the length of another tool than the one in the spindle",
        cause: "H and T differ, or Z moves behind a tool change with the length of the tool before still in force: the tip will be \
              higher or lower than programmed by the difference of both lengths.",
        cure: "Use the length of the tool in the spindle.",
        example: mill("T1 M6\nG43 H2 Z100"),
    }

    "PRG-LENGTH-WHILE-CUTTING" [LENGTH_WHILE_CUTTING: Error, LENGTH_WHILE_CUTTING_STRAIGHT: Warning] {
        meaning: "a cutting block that changes the tool length: an error for arcs and other curves, a warning for a line",
        cause: "`G43`, `G44` or `G49` is in a block with a cut, which then moves by the change of the length as well.",
        cure: "Change the length in a block of its own, or with G0.",
        example: mill("G0 Z200\nG1 G43 H1 Z190 F100"),
    }

    "PRG-LENGTH-INCREMENT" [LENGTH_INCREMENT: Error] {
        meaning: "an incremental word is the first of its axis since the tool offset changed",
        cause: "FANUC mills add the change of a length to the next move of its axis, incremental ones as well. Lathes that shift the                 coordinates by the offset move by the word alone, and so may other controls.",
        cure: "Let an absolute word of the axis come first.",
        example: on("mill, language.coordinates.style = COORDINATE_STYLE_HAAS", "G43 H1\nG91 G0 Z10"),
    }

    "PRG-LENGTH-RETURN" [LENGTH_RETURN: Error] {
        meaning: "a place along Z behind a return to the reference position that may have cancelled the tool length",
        cause: "Some Haas mills cancel the length with G28, others keep it, so that Z goes to different places.",
        cure: "Call the length again with G43 and its H, or write G49, before Z is named.",
        example: on("mill, language.coordinates.style = COORDINATE_STYLE_HAAS", "G43 H1\nG91 G28 Z0\nG90 G0 Z10"),
    }

    "PRG-LENGTH-UNIT" [LENGTH_UNIT: Warning] {
        meaning: "another unit while a tool offset is in force in LinuxCNC",
        cause: "LinuxCNC keeps the number of the offset without converting it to the new unit: where the offset changes next, an axis \
              that is not named moves by the difference. Here the offset stays the length that it is.",
        cure: "Change the unit before G43 or behind G49.",
        example: linuxcnc("G43.1 Z10\nG20"),
    }

    "PRG-TOOL-LENGTH" [TOOL_LENGTH: Error] {
        meaning: "the number of a tool length that is not known",
        cause: "No tool of the job has this number and a length, and the program has not set one (`G10`).",
        cure: "Give the tool its length, and the job the tool.",
        example: mill("G43 H99 Z100"),
    }

    "PRG-TOOL-CONTROL-LENGTH" [TOOL_CONTROL_LENGTH: Error] {
        meaning: "tool centre point control without the number of a tool length",
        cause: "`G43.4` or `G43.5` has no H, or `G53.6` none while no length is in force: the tool centre point is not known without a length.",
        cure: "Add H with the number of the tool, such as H1.",
        explained_by: block("H"),
        example: mill("G43.4"),
    }

    "PRG-TOOL-CONTROL-NESTED" [TOOL_CONTROL_NESTED: Error] {
        meaning: "tool centre point control is switched on while it or a tool length is on",
        cause: "A `G49` is missing between two operations, or `G43` is in force before `G43.4`.",
        cure: "Switch off with G49 first.",
        example: mill("G43.4 H1\nG43.5 H1"),
    }

    "PRG-TOOL-CONTROL-OFF" [TOOL_CONTROL_OFF: Error] {
        meaning: "thinning without tool centre point control",
        cause: "Thinning of five-axis blocks is switched on, but neither `G43.4` nor `G43.5` is in force.",
        cure: "Switch tool centre point control on first.",
        explained_by: modal("G"),
        example: five_axis("M33"),
    }

    "PRG-TOOL-CONTROL-BLOCK" [TOOL_CONTROL_BLOCK: Error] {
        meaning: "something that tool centre point control does not permit",
        cause: "A thread, a drilling cycle, `G28`, `G53`, a tilted plane, another work offset or a tool change while it \
              is on; under `G43.5` a spline, whose I J K would be the tool direction.",
        cure: "Switch it off with G49 first, or write the path as lines.",
        example: mill("G43.4 H1\nG28 Z0"),
    }

    "PRG-TOOL-CONTROL-HELD" [TOOL_CONTROL_HELD: Error] {
        meaning: "motion that needs an axis position which only the machine knows",
        cause: "After tool centre point control or a tilted plane was switched, the program has other coordinates for \
              the same place; an increment, an arc, a corner or a compensated contour starts from there.",
        cure: "Place every axis with an absolute word of G0 or G1 first.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: mill("G43.4 H1\nG0 X0 Y0 Z50\nG49\nG91 G0 Z10"),
    }

    "PRG-TOOL-DIRECTION" [TOOL_DIRECTION: Error] {
        meaning: "a tool direction that is a zero vector, or in the form of the other mode",
        cause: "`G43.4` takes the angles A B C, `G43.5` a vector I J K from the tip to the spindle; the block has the \
              other form or I0 J0 K0.",
        cure: "Write one form throughout.",
        example: mill("G43.5 H1\nG0 X0 Y0 Z50 I0 J0 K0"),
    }

    "PRG-PLANE-NESTED" [PLANE_NESTED: Error] {
        meaning: "a tilted plane while one is on",
        cause: "A `G69` is missing between two planes.",
        cure: "Cancel the plane with G69 first.",
        example: mill("G68.2 X0 Y0 Z0 I0 J30 K0\nG68.2 X0 Y0 Z0 I0 J45 K0"),
    }

    "PRG-PLANE-WORDS" [PLANE_WORDS: Error] {
        meaning: "words that make no plane",
        cause: "`G68.2` with a P other than 0 to 4, a wrong order Q, points on one line, vectors without length or not \
              perpendicular, or blocks of P2 or P3 in a wrong order.",
        cure: "Correct the words, or write the origin X Y Z and the Euler angles I J K, without P.",
        explained_by: block("IJKXYZRQPABC"),
        example: mill("G68.2 P2 Q1 X0 Y0 Z0\nG68.2 P2 Q2 X10 Y0 Z0\nG68.2 P2 Q3 X20 Y0 Z0"),
    }

    "PRG-PLANE-DOUBT" [PLANE_DOUBT: Error] {
        meaning: "a plane whose words controls read differently",
        cause: "`G68.2 P1` with more than one angle (about fixed or about turned axes), `P2 Q0` with a shift or R, `P2` with R but without `Q0`, `P3` with R, \
              or `P4` with an angle I mean different planes on different controls.",
        cure: "Write the plane that your control makes of them with Euler angles, as the finding states it for each.",
        example: mill("G68.2 P1 X0 Y0 Z0 I10 J20 K0"),
    }

    "PRG-PLANE-INCOMPLETE" [PLANE_INCOMPLETE: Error] {
        meaning: "a plane whose blocks do not follow each other",
        cause: "Another block comes between those of `G68.2 P2` (three points) or `P3` (two vectors), or one is missing.",
        cure: "Write the missing block directly behind the one before it.",
        example: mill("G68.2 P3 Q1 X0 Y0 Z0 I1 J0 K0\nG0 X0"),
    }

    "PRG-PLANE-OFF" [PLANE_OFF: Error] {
        meaning: "the tool axis is to be turned onto a plane, but none is tilted",
        cause: "`G53.1` or `G53.6` comes without `G68.2`, or after `G69`.",
        cure: "Tilt the plane first, such as `G68.2 X0 Y0 Z0 I0 J30. K0`.",
        explained_by: modal("G"),
        example: mill("G53.1"),
    }

    "PRG-PLANE-LENGTH" [PLANE_LENGTH: Error] {
        meaning: "a cut in a tilted plane without the tool length about whose tip the tool axis was turned",
        cause: "`G53.6 H` turns about the tip of that tool, but switches no length on: the coordinates of the plane are those of the gauge point of the spindle, and the tip is the length deeper.",
        cure: "Switch the length on with G43 behind `G53.6`, before the tool comes near the work.",
        explained_by: modal("HGT"),
        example: on("five-axis mill", "G68.2 X0 Y0 Z0 I0 J30. K0\nG53.6 H1\nG0 X0 Y0 Z5\nG1 Z-1 F100"),
    }

    "PRG-PLANE-BLOCK" [PLANE_BLOCK: Error] {
        meaning: "something that a tilted plane does not permit",
        cause: "A word of a rotary axis without `G53`, `G44`, another work offset or a tool change in the plane; \
              a length of `G53.6` other than the one in force; a drilling cycle that is in force at `G68.2` or `G69`; `G53.1` in the block of `G68.2`.",
        cure: "Turn the tool axis with `G53.1` in a block of its own, and cancel the plane with `G69` before anything \
              else.",
        example: mill("G68.2 X0 Y0 Z0 I0 J30 K0\nG0 B30"),
    }
}
