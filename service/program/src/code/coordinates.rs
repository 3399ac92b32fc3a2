//! Codes of coordinates and offsets.

crate::finding_codes! {
    /// Codes of coordinates and offsets.
    pub COORDINATE_CODES: "Coordinates and offsets";

    "PRG-COORD-WORD" [COORD_WORD: Error] {
        meaning: "a code of coordinates or offsets lacks a word, or has one that it cannot take",
        cause: "An axis word, a number `P` or a value is missing, or the number names nothing that there is.",
        cure: "Write the words as the finding says.",
        example: mill("G10 L2 P7 X10"),
    }

    "PRG-COORD-SETTING" [COORD_SETTING: Error] {
        meaning: "a code whose meaning depends on a setting that neither the profile nor the job states",
        cause: "Controls do different things for the code, or move to a place that only the machine knows.",
        cure: "Set what the finding names in the machine profile or the offsets of the job.",
        explained_by: block("ABCDEFGHIJKLMNOPQRSTUVWXYZ"),
        example: mill("G91 G30 P3 Z0"),
    }

    "PRG-COORD-AMBIGUOUS" [COORD_AMBIGUOUS: Error] {
        meaning: "words of coordinates that controls read differently",
        cause: "The sources of the control's makers do not agree on what these words do together, so that nothing moves by a guess.",
        cure: "Write it in the form that the finding names, which all read alike.",
        example: mill("G91 G52 X10"),
    }

    "PRG-COORD-ORDER" [COORD_ORDER: Error] {
        meaning: "mirror image, scaling and rotation in another order than the control takes them",
        cause: "They are switched on in the order `G51.1`, `G51`, `G68`, radius compensation, and off in the reverse order.",
        cure: "Switch off what was switched on later first.",
        example: mill("G68 X0 Y0 R30\nG51 X0 Y0 P2."),
    }

    "PRG-COORD-BLOCK" [COORD_BLOCK: Error] {
        meaning: "something that polar coordinates, mirror image, scaling or rotation do not permit",
        cause: "Another plane, work offset or reference position, a thread, tool centre point control or a tilted plane while one of them is on.",
        cure: "Switch it off first.",
        example: mill("G68 X0 Y0 R30\nG18"),
    }

    "PRG-COORD-SHAPE" [COORD_SHAPE: Error] {
        meaning: "a curve or a cycle that the coordinates would turn into something else",
        cause: "A circle with different factors along its two axes is an ellipse, and one in another plane than that of the rotation leaves its plane; \
                a scaled or mirrored drilling axis has no agreed meaning for levels; an oriented spindle does not turn with a tilted plane.",
        cure: "Scale both axes alike, or write the path as lines.",
        example: mill("G51 X0 Y0 I2. J3. K1.\nG2 X10 R10 F100"),
    }

    "PRG-COORD-TURNED-UNDER-SHIFT" [COORD_TURNED_UNDER_SHIFT: Error] {
        meaning: "the work system in force is turned while it is shifted",
        cause: "`G10 L2 R` turns the system in force under a shift of `G52` or `G92`. LinuxCNC 2.9 counts the present position anew \
              without the shift, so that an axis which the next move does not name goes to another place than the one where it stands; \
              by its description the machine would stay.",
        cure: "Clear the shift before the turn, and set it again behind it.",
        example: linuxcnc("G52 X5\nG0 X10 Y0\nG10 L2 P1 R45\nX10\nM2"),
    }

    "PRG-COORD-INCREMENT" [COORD_INCREMENT: Warning] {
        meaning: "an incremental move, or one of a single axis of the plane, directly behind the start or the end of a rotation",
        cause: "Controls count it from the rotated or from the plain coordinates of the present position.",
        cure: "Let an absolute move with both axes of the plane come first.",
        example: mill("G0 X10 Y0\nG68 X0 Y0 R90\nG91 X5"),
    }

    "PRG-POLAR-WORD" [POLAR_WORD: Error] {
        meaning: "a polar word of LinuxCNC, `@` or `^`, that places nothing",
        cause: "Polar words place the end of a move in the plane XY. They stand beside X or Y, in another plane or with a \
                one-block code, or a radius or an increment is counted from the origin, which has no angle.",
        cure: "Write `@` and `^`, or X and Y, in a block with a move and no such code.",
        example: linuxcnc("G0 @10 ^30 X5"),
    }

    "PRG-OFFSET-IN-FORCE" [OFFSET_IN_FORCE: Error] {
        meaning: "the program changes a tool offset that is in force",
        cause: "Controls apply the new value at once, or when the offset is called the next time.",
        cure: "Cancel the offset before it is changed, and call it again.",
        example: mill("G43 H1 Z100\nG10 L11 P1 R0.1"),
    }

    "PRG-OFFSET-UNKNOWN" [OFFSET_UNKNOWN: Error] {
        meaning: "a tool offset that the job's table of tools does not have",
        cause: "The word names an offset without a row, or one whose geometry is not known while others are.",
        cure: "Give the tool its offset, and the job the tool.",
        example: linuxcnc("G10 L1 P9 Z100"),
    }

    "PRG-DATA-SKIPPED" [DATA_SKIPPED: Warning] {
        meaning: "data for the control that is not read",
        cause: "`G10 L50` sets parameters and `G10 L3` tool life up to `G11`; neither changes the path here.",
        cure: "Make sure that the machine profile says what these parameters change.",
        example: mill("G10 L50\nN1020 P1 R88\nG11"),
    }

    "PRG-DATA-OPEN" [DATA_OPEN: Error] {
        meaning: "data for the control without its end",
        cause: "The program ends, or has a code of the machine, before the `G11` behind `G10 L50` or `G10 L3`.",
        cure: "Add G11 behind the data.",
        example: mill("G10 L50\nN1020 P1 R88"),
    }

    "PRG-ROLL-OVER" [ROLL_OVER: Error] {
        meaning: "an angle of an axis that rolls over with two equally short turns to it, or none",
        cause: "The angle is half a turn away, so that both directions are equally short; in LinuxCNC it is a full turn or more, or a \
              machine position (`G53`) under an offset of the axis, where LinuxCNC ends at another angle. Or only the machine knows \
              where the axis is, after tool centre point control or a tilted plane has turned it.",
        cure: "Go there in two moves, or by an incremental one; before `G53`, take the offset of the axis away; where only the machine \
              knows the place, by its reference position first.",
        example: on("mill, language.coordinates.roll_over_axes = C", "G0 C0\nC180"),
    }
}
