//! Codes of expressions and parameters.

crate::finding_codes! {
    /// Codes of expressions and parameters.
    pub EXPRESSION_CODES: "Expressions and parameters";

    "PRG-EXPRESSION-MALFORMED" [EXPRESSION_MALFORMED: Error] {
        meaning: "an expression or an assignment that is not written as the dialect has it",
        cause: "A bracket, an operator or a value is missing, or the form is another dialect's, such as `##1` or `#<name>` in Macro B.",
        cure: "Check the brackets, and that there is an operator between two values; execution ends at this block.",
        example: lathe("G0 X[#1+]"),
    }

    "PRG-VACANT-WORD" [VACANT_WORD_REFUSED: Error, VACANT_WORD: Warning] {
        meaning: "a word whose value is vacant, so that it is not there; an error for the first feed or speed",
        cause: "The parameter was never assigned, or is #0: in Macro B a word of a vacant value is ignored. F, G, M, S and T are named, \
              since what they switch stays as it was; axis words are left out so on purpose.",
        cure: "Assign the parameter before, or remove the word.",
        example: lathe("T#101"),
    }

    "PRG-EXPRESSION-DEPTH" [EXPRESSION_DEPTH: Error] {
        meaning: "an expression with more brackets and functions within each other than the dialect takes",
        cause: "Macro B takes 5 levels, functions included; 32 are read in LinuxCNC.",
        cure: "Compute a part of it before, in a parameter of its own.",
        example: lathe("#1=[[[[[[1]]]]]]"),
    }

    "PRG-EXPRESSION-ARITHMETIC" [EXPRESSION_ARITHMETIC: Error] {
        meaning: "an operation without a result",
        cause: "A division by zero, SQRT of a negative number, ASIN or ACOS beyond ±1, LN of 0, a result too large for a number. \
              Often a parameter was never assigned and counts as 0.",
        cure: "Check the values that it is computed from; execution ends at this block.",
        example: lathe("#1=1/#2"),
    }

    "PRG-EXPRESSION-FUNCTION" [EXPRESSION_FUNCTION: Error] {
        meaning: "a function that the dialect does not have",
        cause: "A typing error, or a function of another control, such as `POW` in LinuxCNC.",
        cure: "Check its spelling, and the dialect of the machine profile.",
        example: lathe("G0 X[SINE[30]]"),
    }

    "PRG-EXPRESSION-DIFFERS" [EXPRESSION_DIFFERS: Error] {
        meaning: "an operation that controls carry out differently with these values, so that nothing is guessed",
        cause: "In Macro B MOD of negative numbers, AND, OR and XOR of numbers that are not whole, and ADP.",
        cure: "Write it with operations that all controls agree on, as the finding suggests.",
        example: lathe("#1=-7 MOD 3"),
    }

    "PRG-EXPRESSION-TRUTH" [EXPRESSION_TRUTH: Error] {
        meaning: "a condition where a number is needed, or a number where a condition is",
        cause: "In Macro B a comparison cannot be stored, and a number is no condition; AND and OR between comparisons need brackets.",
        cure: "Put each condition in brackets of its own: `[[#1 GT 0] AND [#2 LT 5]]`; assign 1 or 0 behind `IF [...] THEN`.",
        example: lathe("#1=[#2 GT 5]"),
    }

    "PRG-EXPRESSION-EQUALITY" [EXPRESSION_EQUALITY: Info] {
        meaning: "numbers that are not whole are compared for equality",
        cause: "A control compares about eight digits; here numbers are equal where they differ by at most 1e-9 of their size.",
        cure: "Compare the difference with a tolerance, such as `ABS[#1-2.5] LT 0.001`.",
        example: words("`IF [#1 EQ 0.1] GOTO 10`"),
    }

    "PRG-PARAMETER-NUMBER" [PARAMETER_NUMBER: Error] {
        meaning: "a parameter that does not exist",
        cause: "Its number is computed and not whole, negative, vacant or beyond those of the control.",
        cure: "Check the number, and what it is computed from.",
        example: lathe("#[0.5]=1"),
    }

    "PRG-PARAMETER-NAME" [PARAMETER_NAME: Error] {
        meaning: "a name of a parameter that cannot be one",
        cause: "It is empty, longer than 63 characters, or holds characters beyond ASCII.",
        cure: "Choose a shorter name of letters, digits and underscores.",
        example: words("`#<>=1`"),
    }

    "PRG-PARAMETER-UNSET" [PARAMETER_UNSET: Error] {
        meaning: "a named parameter is read before anything is assigned to it",
        cause: "A typing error in the name, or an assignment that is made in another subprogram, where the name is another one.",
        cure: "Assign it before, start the name with _ to know it everywhere, or ask with EXISTS.",
        example: words("`X#<width>` with nothing assigned to `#<width>`"),
    }

    "PRG-PARAMETER-PROBED" [PARAMETER_PROBED: Warning] {
        meaning: "the result of a probing move is used, which is not known before it is made",
        cause: "The program computes with #5061 and its neighbours, or with #5070.",
        cure: "Check what depends on it; here the result is the programmed end of the probing move.",
        example: words("`#1=#5063` behind `G31 Z-10 F100`"),
    }

    "PRG-PARAMETER-LIMIT" [PARAMETER_LIMIT: Error] {
        meaning: "more named parameters than are kept",
        cause: "A program makes names in a recursion that does not end, or a post names every value.",
        cure: "Use numbered parameters for what needs no name.",
        example: words("a program that assigns 1001 names"),
    }

    "PRG-PARAMETER-READ-ONLY" [PARAMETER_READ_ONLY: Error] {
        meaning: "an assignment to a value of the control that cannot be assigned",
        cause: "Positions, modes and `#0` are read only. An offset cannot be assigned while what depends on it is in force.",
        cure: "Assign a variable of the program, or use the code that sets the value; assign an offset before it is in force.",
        example: lathe("#5001=10"),
    }

    "PRG-PARAMETER-UNAVAILABLE" [PARAMETER_UNAVAILABLE: Error] {
        meaning: "a value of the control that is not known here",
        cause: "The program reads inputs of the machine, values of its configuration or of a rarely used group of codes.",
        cure: "Let the profile bring its value (`[[language.parameters]]`), or the job (`[[parameters]]` of its offsets); of a tool in \
               the spindle of LinuxCNC (`#5401` to `#5413`) the tool of the job.",
        example: lathe("#1=#1000"),
    }

    "PRG-PARAMETER-CLOCK" [PARAMETER_CLOCK: Error] {
        meaning: "a clock or a counter of the control is read, so that the program would not run twice alike",
        cause: "`#3001`, `#3002`, `#3011`, `#3012` or `#3901` is part of an expression.",
        cure: "Take it out, or let the profile bring a value for it (`[[language.parameters]]`), or the job (`[[parameters]]` of its \
               offsets).",
        example: lathe("#1=#3011"),
    }

    "PRG-PARAMETER-IGNORED" [PARAMETER_IGNORED: Info] {
        meaning: "an assignment to a clock, an inhibition, a counter or an output of the control, which changes no path",
        cause: "`#3001` to `#3004` or `#3901` is assigned, mostly around tapping, or an output to the machine, `#1100` to `#1139`.",
        cure: "Nothing needs to be done.",
        example: lathe("#3004=7"),
    }

    "PRG-OUTPUT" [OUTPUT: Info] {
        meaning: "a statement that writes to a file, a printer or the screen of the control, which does nothing here",
        cause: "`DPRNT`, `BPRNT`, `POPEN` or `PCLOS` of Macro B, `(PRINT,...)`, `(LOG,...)` or `(DEBUG,...)` of LinuxCNC.",
        cure: "Nothing needs to be done.",
        example: lathe("DPRNT[X#101[53]]"),
    }

    "PRG-ALARM" [ALARM: Error] {
        meaning: "the program stops itself with an error of its own",
        cause: "`#3000` is assigned, or a comment of LinuxCNC begins with `ABORT,`: the program has checked something and found it wrong.",
        cure: "Read its message, and see what leads to this block; often an argument is missing.",
        example: lathe("#3000=21(NO DEPTH GIVEN)"),
    }
}
