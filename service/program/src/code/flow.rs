//! Codes of control flow: jumps, loops, subprograms.

crate::finding_codes! {
    /// Codes of control flow.
    pub FLOW_CODES: "Control flow and subprograms";

    "PRG-STATEMENT" [STATEMENT: Error] {
        meaning: "a control statement that cannot be read, or that is not possible here",
        cause: "A part of the statement is missing or too much, such as a number behind `GOTO`, an assignment (on Haas controls a block) \
              behind `THEN`, or a move behind an O-word.",
        cure: "Write the statement as the control knows it, alone in its block.",
        example: mill("IF [1 EQ 1] G1 X5\nM30"),
    }

    "PRG-JUMP-TARGET" [JUMP_TARGET: Error] {
        meaning: "a jump whose target is missing, is there twice, or lies within a loop",
        cause: "`GOTO`, `M99 P` or `M97 P` names a block number that its program does not have once, or a `GOTO` leads into a loop.",
        cure: "Give the block that is meant the number, and no other.",
        example: mill("GOTO 10\nM30"),
    }

    "PRG-LOOP" [LOOP: Error] {
        meaning: "a loop or a branch without its beginning or its end, or two that cross",
        cause: "`END`, `endwhile`, `endif` and the like are missing, have another number, or come in another order.",
        cure: "Close every loop and branch with its own number, the inner ones first; at most three loops of Macro B are open at once.",
        example: mill("WHILE [1 EQ 1] DO1\nM30"),
    }

    "PRG-SUBPROGRAM-MISSING" [SUBPROGRAM_MISSING: Error] {
        meaning: "a program that is called and is not there",
        cause: "Neither the program file nor the further files of the job have the program.",
        cure: "Add the program to the file, or give the job the file that it is in.",
        explained_by: block("P"),
        example: mill("M98 P1000\nM30"),
    }

    "PRG-SUBPROGRAM-END" [SUBPROGRAM_END: Error] {
        meaning: "a called program that does not return to its caller",
        cause: "The file ends, its closing `%` comes, or the next program in it begins before `M99` or `endsub`.",
        cure: "End the called program with `M99`, or with `endsub` where it began with `sub`.",
        example: mill("M98 P1000\nM30\nO1000\nG4 P100"),
    }

    "PRG-CALL-DEPTH" [CALL_DEPTH: Error] {
        meaning: "too many calls within each other",
        cause: "A program calls itself without an end, or programs call each other more than ten deep, macros more than four deep.",
        cure: "Let the recursion end, or call fewer programs within each other.",
        example: mill("M98 P1000\nM30\nO1000\nM98 P1000\nM99"),
    }

    "PRG-ARGUMENT-POINT" [ARGUMENT_WITHOUT_POINT: Warning] {
        meaning: "an argument of a macro without a decimal point, which controls read in least increments",
        cause: "`G65` passes a number without a decimal point in the least increments of its letter on some controls.",
        cure: "Write the decimal point.",
        example: mill("G65 P1000 A5\nM30\nO1000\nM99"),
    }

    "PRG-ENDLESS" [ENDLESS: Error] {
        meaning: "a loop that never ends, or a program of too many blocks",
        cause: "Every further round of the loop is decided as the one before: no variable changes, and no position or mode is asked for, or all is as it was. \
              Or the limits of executed blocks are reached.",
        cure: "Change in the loop what its condition asks for, or raise the limit in the language settings of the machine profile.",
        example: mill("#1=0\nWHILE [#1 LT 5] DO1\nEND1\nM30"),
    }

    "PRG-MAIN-UNCLEAR" [MAIN_UNCLEAR: Error] {
        meaning: "the first program of the file ends with `M99` and calls nothing, and another one stands behind it",
        cause: "Files from the memory of a control have their programs by number, so that a subprogram may come first. Here the first one is the main program.",
        cure: "Write the main program first, or end it with M30.",
        example: mill("O9001\nG91 G0 X1\nM99\nO1\nM98 P9001\nM30"),
    }

    "PRG-MAIN-RETURN" [MAIN_RETURN: Info] {
        meaning: "the main program ends with `M99`, or goes back to a block by `M99 P` without any condition, which runs it again and again on the control",
        cause: "Bar feeders and pallet machines run a program again and again by `M99`; or the file is a subprogram, which returns by it.",
        cure: "Nothing has to be done: one pass is planned. A subprogram is judged as a part of the program that calls it.",
        example: mill("G0 X1\nM99"),
    }
}
