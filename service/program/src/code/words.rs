//! Codes of words and codes of a block.

crate::finding_codes! {
    /// Codes of words and codes of a block.
    pub WORDS_CODES: "Words and codes";

    "PRG-WORD-UNKNOWN" [WORD_UNKNOWN: Error] {
        meaning: "an address letter the dialect does not know",
        cause: "An axis or a parameter of another control, or a typing error.",
        cure: "Remove the word, or choose the dialect of the control in the machine profile.",
        example: mill("G0 X10 E5"),
    }

    "PRG-WORD-DUPLICATE" [WORD_DUPLICATE: Error] {
        meaning: "an address letter occurs twice in a block",
        cause: "Two blocks were run together on one line, or a word was copied.",
        cure: "Keep one of the words, or write two blocks.",
        example: lathe("G0 X10 X20"),
    }

    "PRG-WORD-UNUSED" [WORD_UNUSED: Error] {
        meaning: "a word no code of its block uses",
        cause: "The code that takes the word is missing, or the word is left over from another block.",
        cure: "Add the code that the word belongs to, or remove it if it does nothing on the machine either.",
        example: lathe("G0 X10 K5"),
    }

    "PRG-SPINDLE-NUMBER" [SPINDLE_NUMBER: Error] {
        meaning: "`$` of LinuxCNC that names no spindle of the machine, or stands in a block that is of none",
        cause: "The machine has one spindle, number 0; -1 is all of them. `$` belongs to `S`, `M3`, `M4`, `M5`, `M19`, `M51`, `G33`, \
                `G33.1`, `G76`, `G95`, `G96` and `G97`.",
        cure: "Write `$0`, or leave it out.",
        example: linuxcnc("M3 S500 $1"),
    }

    "PRG-WORD-CONFLICT" [WORD_CONFLICT: Error] {
        meaning: "two words of a block contradict each other, or a word chooses between cases and names none",
        cause: "An absolute and an incremental word for one axis, two leads of a thread, two times of a dwell, or a P \
              out of its choices.",
        cure: "Keep the word that is meant.",
        example: lathe("G0 X10 U5"),
    }

    "PRG-UNKNOWN-CODE" [UNKNOWN_CODE: Error] {
        meaning: "a G or M code the dialect does not know",
        cause: "A code of the machine builder or of another control, or a machining function whose code the profile \
              does not assign.",
        cure: "Use one of the codes listed with the finding, or assign the code in the language settings of the \
              machine profile.",
        example: lathe("G223 X10"),
    }

    "PRG-UNSUPPORTED-CODE" [UNSUPPORTED_CODE: Error] {
        meaning: "a known code that is not supported yet",
        cause: "The reference position check, pocket and bolt hole cycles of Haas controls, polar and cylindrical interpolation are \
              known, but nothing carries them out.",
        cure: "Let the CAM post write the moves themselves (G0, G1, G2, G3).",
        example: mill("G27 Z5"),
    }

    "PRG-GROUP-CONFLICT" [GROUP_CONFLICT: Error] {
        meaning: "two codes of one modal group in a block",
        cause: "Two motions, two planes or two units on one line: which one holds differs between controls.",
        cure: "Keep one of them, or write them in two blocks.",
        example: lathe("G0 G1 X10 F0.2"),
    }

    "PRG-CODE-AMBIGUOUS" [CODE_AMBIGUOUS: Error] {
        meaning: "a code that controls read differently with these words, so that nothing moves on a guess",
        cause: "On a lathe `G90 X45 Z-30` is a turning cycle in G-code system A and a move in the others; `G94`, \
              `G92`, `G20`, `G21`, `G72` to `G79` and `G80` are alike, and so is `R` of drilling cycles. Or the program has codes \
              of system A and of the others (`U` and `G91`).",
        cure: "Set `g_code_system` of the machine profile's language. Or for a move, write its motion code behind the code \
              (`G90 G1 X45`), or the code in a block of its own; for a cycle, write its passes.",
        example: lathe("G90 X45 Z-30 F0.2"),
    }

    "PRG-UNIT-WITH-FEED" [UNIT_WITH_FEED: Warning] {
        meaning: "a feed in the block that changes the unit, which controls read in different units",
        cause: "`G20` or `G21` is in one block with `F`: LinuxCNC reads the feed in the old unit, other controls in \
              the new one.",
        cure: "Change the unit in a block of its own before the feed.",
        example: mill("G20 G1 X1 F10"),
    }

    "PRG-FUNCTION-WORD" [FUNCTION_WORD: Error] {
        meaning: "a word that the machining function of its block does not take",
        cause: "A move or another function's word is in the block that switches a machining function.",
        cure: "Write the word in a block of its own.",
        example: lathe("G200 F25 A0.1 Z-5"),
    }

    "PRG-FUNCTION-WORD-MISSING" [FUNCTION_WORD_MISSING: Error] {
        meaning: "a machining function without a word it needs",
        cause: "The block that switches the function lacks a word without which it says nothing, such as X or Q of \
              `G165`.",
        cure: "Add the word to the block of the function.",
        explained_by: block("ABCDEFGHIJKLMNOPQRSTUVWXYZ"),
        example: lathe("G165 P3 X30"),
    }

    "PRG-FUNCTION-SWITCH" [FUNCTION_SWITCH: Error] {
        meaning: "a machining function whose P says neither on nor off",
        cause: "The P word is missing, or is not one of the two that the machine profile assigns.",
        cure: "Write the P that switches it on or off; as delivered `G165 P3` and `G165 P0`.",
        explained_by: block("P"),
        example: lathe("G165 P7"),
    }

    "PRG-TOOL-MISSING" [TOOL_MISSING: Error, TOOL_NONE: Warning] {
        meaning: "a tool change before any T word: an error, and in LinuxCNC, where the spindle is left empty, a warning",
        cause: "No T word since the tool change before this `M6` (in LinuxCNC: none at all) names the next tool.",
        cure: "Write the tool number in the block of `M6` or before it.",
        explained_by: modal("T"),
        example: mill("M6"),
    }

    "PRG-MACHINE-CODE" [MACHINE_CODE_REFUSED: Error, MACHINE_CODE_UNLISTED: Info] {
        meaning: "an M code of the machine that nobody has listed: what it does is not known",
        cause: "Clamps, chucks, conveyors and the like have M codes of the machine's builder. Without an entry the code \
              is handed on without an effect on the path, or refused where the profile says so.",
        cure: "List the code in `machine_codes` of the profile's language: whether it does nothing to the path, stops \
              for the operator, takes a time, or lets the path rest.",
        example: lathe("M10"),
    }

    "PRG-MACHINE-SPEED" [MACHINE_CODE_SPEED: Warning] {
        meaning: "an S beside an M code that nobody has listed, read as the speed of the main spindle",
        cause: "M codes of machine builders start live tools and second spindles, and take the S of their block; others, such as `M13`, \
              start the main spindle.",
        cure: "List the M code in `machine_codes` of the profile's language with its word S, or in `code_replacements` with the codes that it \
              stands for; or write the S of the main spindle in a block of its own.",
        example: lathe("M133 S300"),
    }

    "PRG-MACHINE-WORD" [MACHINE_WORD: Error] {
        meaning: "an M code without a word that it needs, or with one out of its range",
        cause: "An output without its number or its value, a wait without its time, a spindle angle beyond 360 degrees.",
        cure: "Write the word that the finding names.",
        explained_by: block("ABCDEFGHIJKLMNOPQRSTUVWXYZ"),
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "M62"),
    }

    "PRG-MODES-NOT-SAVED" [MODES_NOT_SAVED: Error] {
        meaning: "saved modes are to be restored, but none are saved",
        cause: "`M72` comes without `M70` or `M73` before it, or `M71` has made the saved modes invalid.",
        cure: "Save the modes with `M70` first.",
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "M72"),
    }

    "PRG-INPUT-UNKNOWN" [INPUT_UNKNOWN: Info] {
        meaning: "the program reads an input of the machine, whose state is not known",
        cause: "`M66` waits for an input. The path rests; its result (#5399) is what the profile says, as delivered -1.",
        cure: "Say in `input_result` of the profile's language which result the program is to be judged with.",
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "M66 P1 L0"),
    }
}
