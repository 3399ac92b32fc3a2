//! Codes of drilling, boring and tapping cycles.

crate::finding_codes! {
    /// Codes of drilling, boring and tapping cycles.
    pub CYCLE_CODES: "Drilling, boring and tapping";

    "PRG-CYCLE-WORD" [CYCLE_WORD: Error] {
        meaning: "a drilling cycle without a word it needs",
        cause: "The first block of a cycle lacks its bottom (Z), the Q of its pecks, or its R where that is a level (under `G90`, but on \
              Haas controls): some controls take 0 for it, others the last one. In LinuxCNC also the P of its dwell, even where the \
              cycle's code has changed or was left.",
        cure: "Add the words that the finding names.",
        explained_by: modal("XYZUVWRQPG"),
        example: mill("M3 S1000\nG0 Z10\nG81 X10 R2 F100"),
    }

    "PRG-CYCLE-NO-R" [CYCLE_NO_R: Info] {
        meaning: "a drilling cycle without R on a Haas control, or where R is a distance: the tool feeds from the level of its start",
        cause: "No block since `G80` has R, so that the R level is no distance below the level of the start.",
        cure: "Add R with the level to which the tool goes rapidly, so that it feeds through less air.",
        explained_by: block("R"),
        example: mill("M3 S1000\nG0 Z10\nG91 G81 X10 Z-15 F100"),
    }

    "PRG-CYCLE-VALUE" [CYCLE_VALUE: Error] {
        meaning: "a word of a drilling cycle that is out of range",
        cause: "A peck that is not positive, a dwell that is negative, no repeats in LinuxCNC, or so many pecks and repeats that \
              more than 10000 strokes follow.",
        cure: "Write a value in the range that the finding names, and check for a missing or an extra decimal point.",
        example: mill("M3 S1000\nG0 Z10\nG83 X10 Z-20 R2 Q0 F100"),
    }

    "PRG-CYCLE-LEVEL" [CYCLE_LEVEL: Error] {
        meaning: "levels of a drilling cycle in the wrong order",
        cause: "The R level is below the bottom, or the tool is below the R level where the cycle begins: a FANUC control \
              would go to the hole down there.",
        cure: "Check the signs of Z and R, and whether G91 makes them distances; move the tool above the R level before.",
        explained_by: modal("XYZUVWABCHIJKRG"),
        example: mill("M3 S1000\nG0 Z10\nG81 X10 Z-5 R-8 F100"),
    }

    "PRG-CYCLE-AXIS" [CYCLE_AXIS: Error] {
        meaning: "a drilling cycle with a word of an axis that it does not move",
        cause: "The block places a rotary or a parallel axis, which this control does not move within a cycle.",
        cure: "Move the axis in a block before it.",
        example: words("LinuxCNC: G81 X10 A90 Z-5 R2 F100"),
    }

    "PRG-CYCLE-FEED" [CYCLE_FEED: Error] {
        meaning: "a drilling cycle under inverse time feed",
        cause: "`G93` is in force: the strokes of a hole have no time of their own.",
        cure: "Switch to feed per minute (`G94`) or per revolution (`G95`) before the cycle; on lathes of G-code system A these are `G98` and `G99`.",
        example: mill("M3 S1000\nG0 Z10\nG93 G81 X10 Z-5 R2 F1"),
    }

    "PRG-CYCLE-SPINDLE" [CYCLE_SPINDLE: Error] {
        meaning: "a tapping or boring cycle whose spindle does not turn, or turns in the wrong direction",
        cause: "`G84` needs M3, `G74` M4; a rigid tap needs a speed; LinuxCNC's `G86` needs a turning spindle.",
        cure: "Start the spindle in the right direction before the cycle, such as `M3 S500`.",
        explained_by: modal("SMG"),
        example: mill("G0 Z10\nG84 X10 Z-5 R2 F100"),
    }

    "PRG-CYCLE-SETTING" [CYCLE_SETTING: Error] {
        meaning: "a cycle that controls carry out differently, and the machine profile does not say which",
        cause: "A setting of `language.drilling` is missing: the finding names it.",
        cure: "Set it as the manual of the machine says.",
        example: lathe("M3 S1000\nG0 X0 Z5\nG83 Z-20 R-3 Q5000 F0.1"),
    }

    "PRG-POCKET-WORD" [POCKET_WORD: Error] {
        meaning: "a circular pocket (`G12`, `G13`) with a word that is missing or out of range",
        cause: "`I` is the radius of the first circle, at least that of the tool (`D`); `K`, the radius of the last one, is larger \
              and goes with `Q`, the step from circle to circle; `L` repeats it.",
        cure: "Write the words that the finding names.",
        explained_by: block("IKQDFLZ"),
        example: on("mill, language.drilling.style = DRILLING_STYLE_HAAS", "M3 S1000\nG0 X0 Y0 Z2\nG13 D0 Z-2 F100"),
    }

    "PRG-POCKET-BLOCK" [POCKET_BLOCK: Error] {
        meaning: "a circular pocket (`G12`, `G13`) where controls do not carry it out",
        cause: "It is cut in the plane `G17`, in coordinates in which circles stay circles, with no drilling cycle in force.",
        cure: "End what the finding names before the block.",
        example: on("mill, language.drilling.style = DRILLING_STYLE_HAAS", "M3 S1000\nG18 G0 X0 Y0 Z2\nG13 D0 I5 Z-2 F100"),
    }

    "PRG-POCKET-PATH" [POCKET_PATH: Info] {
        meaning: "how the tool gets to the circles of a circular pocket (`G12`, `G13`) and from them is not documented",
        cause: "Half circles from the centre and back to it, and straight steps along X from circle to circle, are planned.",
        cure: "Leave room for it within the pocket; nothing is to be done where the pocket is cleared.",
        example: on("mill, language.drilling.style = DRILLING_STYLE_HAAS", "M3 S1000\nG0 X0 Y0 Z2\nG13 D0 I5 Z-2 F100"),
    }

    "PRG-CYCLE-UNDEFINED" [CYCLE_UNDEFINED: Error] {
        meaning: "a cycle whose path is not known",
        cause: "In `G88` the operator retracts the tool by hand; `G87` of LinuxCNC has no definite meaning; FANUC lathes have \
              no G81, G82 and G86; a FANUC `G87` never returns to the R level (`G99`).",
        cure: "Write the hole with a cycle that retracts by itself, such as `G86` or `G89`, or with G0 and G1.",
        example: mill("M3 S1000\nG0 Z10\nG88 X10 Z-5 R2 P100 F100"),
    }

    "PRG-CYCLE-RETURN" [CYCLE_RETURN: Warning] {
        meaning: "the return level changes from G99 to G98 while a drilling cycle is in force",
        cause: "The tool is at the R level. LinuxCNC moves it from there to the next hole and the level of the start at once, on \
              a slant; a FANUC control moves to the hole at the R level and returns higher behind it only.",
        cure: "End the cycle with `G80`, raise the tool with G0, and open the cycle again.",
        example: mill("M3 S1000\nG0 Z10\nG99 G81 X10 Z-5 R2 F100\nG98 X20"),
    }

    "PRG-CYCLE-DEFAULT" [CYCLE_DEFAULT: Info] {
        meaning: "a retract of pecks that the machine profile does not state",
        cause: "`language.drilling` lacks `chip_break_retract_mm` (`G73`, FANUC parameter 5114) or `peck_clearance_mm` (`G83`, \
              5115); Haas has both in setting 22.",
        cure: "Set it as the machine has it; 1 mm is taken meanwhile. The depths of the pecks do not depend on it.",
        example: mill("M3 S1000\nG0 Z10\nG83 X10 Z-20 R2 Q5 F100"),
    }
}
