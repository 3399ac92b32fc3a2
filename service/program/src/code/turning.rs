//! Codes of turning, facing and grooving cycles.

crate::finding_codes! {
    /// Codes of turning, facing and grooving cycles.
    pub TURNING_CODES: "Turning cycles";

    "PRG-TURNING-WORD" [TURNING_WORD: Error] {
        meaning: "a turning cycle without a word it needs",
        cause: "The end point of a single cycle, the depth or the passes of a roughing cycle, its contour (P and Q) or the peck of a \
              groove is missing, in its block and in those before it.",
        cure: "Add the words that the finding names.",
        explained_by: modal("UWRPQXZDIKF"),
        example: lathe("M3 S1000\nG0 X50 Z2\nG71 P10 Q20 U0.4 W0.1 F0.2\nN10 G0 X20\nN20 G1 Z-20"),
    }

    "PRG-TURNING-IDLE" [TURNING_IDLE: Warning] {
        meaning: "the code of a single turning or facing cycle without any word of it, which moves nothing",
        cause: "On a lathe of G-code system A `G90` is the turning cycle and `G94` the facing cycle; programs of other controls write them for \
              absolute coordinates and the feed per minute. Axis words in a block behind it would be cut as the cycle; without a motion \
              code they are refused.",
        cure: "Leave the code out.",
        explained_by: block("XZUWR"),
        example: on("lathe, language.g_code_system = G_CODE_SYSTEM_A", "M3 S1000\nG21 G90 G40\nG0 X50 Z2"),
    }

    "PRG-TURNING-VALUE" [TURNING_VALUE: Error] {
        meaning: "a word of a turning cycle that is out of range",
        cause: "A depth or a peck that is not positive, a number of passes below 1, a taper that leads beyond the start, or a decimal \
              point that is missing.",
        cure: "Write a value in the range that the finding names, and check for a missing or an extra decimal point.",
        example: lathe("M3 S1000\nG0 X50 Z2\nG71 U0 R1"),
    }

    "PRG-TURNING-FORM" [TURNING_FORM: Error] {
        meaning: "a turning cycle whose words belong to none or several of its forms, or one that is not possible here",
        cause: "Roughing cycles are written in two lines (depth and escape, then contour and allowances), in one line with D, or as in \
              LinuxCNC; the block mixes them, has the pre-finishing allowances I and K of older controls, or the plane is not G18.",
        cure: "Write the cycle in one of the forms that the finding names.",
        example: lathe("M3 S1000\nG0 X50 Z2\nG71 P10 Q20 U0.4 W0.1 D1.5 I0.5 F0.2"),
    }

    "PRG-TURNING-CONTOUR" [TURNING_CONTOUR: Error] {
        meaning: "the contour of a turning cycle that is missing, or has blocks that no contour has",
        cause: "The first or the last block (P, Q) is not there or is there twice, the last one comes first, the subprogram of LinuxCNC is \
              missing, or a block between them is no line or arc in X and Z: a call, a cycle, a stop or the end of the program.",
        cure: "Give the first and the last block of the contour numbers of their own, and put nothing but G0 to G3, G4, G96, G97, \
              feeds and speeds between them.",
        explained_by: block("PQ"),
        example: lathe("M3 S1000\nG0 X50 Z2\nG71 U2 R1\nG71 P10 Q20 U0.4 W0.1 F0.2\nN10 G0 X20\nG1 Z-20"),
    }

    "PRG-TURNING-MONOTONY" [TURNING_MONOTONY: Error] {
        meaning: "a contour that turns back where its roughing cycle does not permit it",
        cause: "A contour whose first block moves along one axis only (type I) must grow in X and keep one direction in Z throughout; one whose \
              first block moves both (type II) may have pockets, but keeps one direction along the passes. A thousandth of a millimetre is \
              permitted.",
        cure: "Write Z in the first block as well, W0 at least, for pockets; otherwise correct the block that the finding names.",
        example: lathe(
            "M3 S1000\nG0 X50 Z2\nG71 U2 R1\nG71 P10 Q20 U0.4 W0.1 F0.2\nN10 G0 X20\nG1 Z-20\nX16 Z-25\nN20 X50"
        ),
    }

    "PRG-TURNING-START" [TURNING_START: Error] {
        meaning: "a turning cycle that starts where it cannot",
        cause: "The contour of a roughing cycle goes beyond the start, in X or in Z: FANUC controls stop. A rapid move to or from a \
              contour that is followed passes through the finished part. The tool is at the level where the contour starts, so that the \
              side of the stock is not known, or a cycle ends where it starts. In LinuxCNC: the cycle starts where its contour begins, or \
              from where it starts a move would cut into the contour, leave it or never meet it.",
        cure: "Start the cycle where the finding says: the corner of the stock, at or beyond the largest X of the contour (in a bore the \
              smallest) and the Z where it begins.",
        example: lathe("M3 S1000\nG0 X20 Z2\nG71 U2 R1\nG71 P10 Q20 U0.4 W0.1 F0.2\nN10 G0 X20\nN20 G1 Z-20"),
    }

    "PRG-TURNING-LIMIT" [TURNING_LIMIT: Error] {
        meaning: "a turning cycle with more blocks, passes or strokes than are carried out",
        cause: "The contour has more than 2000 blocks, or the depth of a pass is so small that more than 100000 moves follow.",
        cure: "Divide the contour, or write a larger depth; a decimal point may be missing.",
        example: lathe("M3 S1000\nG0 X50 Z2\nG75 R0\nG75 X10 Z-100 P1 Q1000 F0.1"),
    }

    "PRG-TURNING-ALLOWANCE" [TURNING_ALLOWANCE: Warning] {
        meaning: "an allowance whose sign points into the finished part",
        cause: "U and W of a roughing cycle point from the finished part to the stock: outside U is positive, in a bore negative, and W is \
              positive where the passes go toward negative Z. The control cuts as it is written.",
        cure: "Change the sign, unless the roughing is to cut deeper than the contour.",
        example: lathe("M3 S1000\nG0 X50 Z2\nG71 U2 R1\nG71 P10 Q20 U-0.4 W0.1 F0.2\nN10 G0 X20\nG1 Z-20\nN20 X50"),
    }

    "PRG-TURNING-POCKETS" [TURNING_POCKETS: Info] {
        meaning: "a contour with pockets, which controls rough in different orders",
        cause: "The first block moves both axes (type II) and the contour has pockets: the order of the pieces of a level, and how the tool \
              gets from one to the next, differ by the model of the control. The material that is removed is the same.",
        cure: "Nothing has to be done; compare with the control where the order matters.",
        example: lathe(
            "M3 S1000\nG0 X50 Z2\nG71 U2 R1\nG71 P10 Q20 U0.4 W0 F0.2\nN10 G0 X20 W0\nG1 Z-20\nX16 Z-25\nN20 X50 Z-40"
        ),
    }

    "PRG-TURNING-COMPENSATION" [TURNING_COMPENSATION: Info] {
        meaning: "a roughing cycle that ignores the compensation of the nose",
        cause: "`G41` or `G42` is in the contour, or on before the cycle: it acts in the finishing cycle. The passes of the roughing cycle \
              are not compensated, as on FANUC controls; newer series offset their contour as well, which leaves more or less on cones \
              and arcs only.",
        cure: "Choose the allowances such that the nose leaves enough on cones and arcs.",
        example: words("G42 in the first block of a contour that G71 roughs"),
    }

    "PRG-TURNING-DETACHED" [TURNING_DETACHED: Warning] {
        meaning: "a roughing cycle whose contour does not follow it",
        cause: "The contour is elsewhere in the program. The program goes on behind the block of the cycle; behind a contour that follows at \
              once, it goes on behind the contour.",
        cure: "Put the contour directly behind the cycle, unless this is meant.",
        example: lathe(
            "M3 S1000\nG0 X50 Z2\nGOTO 30\nN10 G0 X20\nG1 Z-20\nN20 X50\nN30 G71 U2 R1\nG71 P10 Q20 U0.4 W0.1 F0.2"
        ),
    }

    "PRG-TURNING-DEFAULT" [TURNING_DEFAULT: Info] {
        meaning: "a value of turning cycles that neither the program nor the machine profile states",
        cause: "`language.turning` lacks the escape of roughing passes (`escape_mm`, FANUC parameter 5133, Haas setting 73) or the return of \
              pecks (`groove_return_mm`, 5139, Haas setting 22).",
        cure: "Set it as the machine has it, or write R; 1 mm is taken meanwhile. What is cut does not depend on it.",
        example: lathe("M3 S1000\nG0 X50 Z2\nG75 X30 I2 F0.1"),
    }
}
