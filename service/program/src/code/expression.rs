//! Codes of expressions and parameters.

crate::finding_codes! {
    /// Codes of expressions and parameters.
    pub EXPRESSION_CODES: "Expressions and parameters";

    "PRG-EXPRESSION-MALFORMED" [EXPRESSION_MALFORMED: Error] {
        meaning: "an expression or an assignment that is not written as the dialect has it",
        cause: "A bracket, an operator or a value is missing, or the form is another dialect's, such as `##1` or `#<name>` in Macro B.",
        cure: "Check the brackets, and that there is an operator between two values; execution ends at this block.",
        example: words("`X[#1+]`"),
    }

    "PRG-EXPRESSION-DEPTH" [EXPRESSION_DEPTH: Error] {
        meaning: "an expression with more brackets and functions within each other than the dialect takes",
        cause: "Macro B takes 5 levels, functions included; 32 are read in LinuxCNC.",
        cure: "Compute a part of it before, in a parameter of its own.",
        example: words("`#1=[[[[[[1]]]]]]` in Macro B"),
    }

    "PRG-EXPRESSION-ARITHMETIC" [EXPRESSION_ARITHMETIC: Error] {
        meaning: "an operation without a result",
        cause: "A division by zero, SQRT of a negative number, ASIN or ACOS beyond ±1, LN of 0, a result too large for a number. \
              Often a parameter was never assigned and counts as 0.",
        cure: "Check the values that it is computed from; execution ends at this block.",
        example: words("`#1=1/#2` with #2 never assigned"),
    }

    "PRG-EXPRESSION-FUNCTION" [EXPRESSION_FUNCTION: Error] {
        meaning: "a function that the dialect does not have",
        cause: "A typing error, or a function of another control, such as `POW` in LinuxCNC.",
        cure: "Check its spelling, and the dialect of the machine profile.",
        example: words("`X[SINE[30]]`"),
    }

    "PRG-EXPRESSION-DIFFERS" [EXPRESSION_DIFFERS: Error] {
        meaning: "an operation that controls carry out differently with these values, so that nothing is guessed",
        cause: "In Macro B MOD of negative numbers, AND, OR and XOR of numbers that are not whole, and ADP.",
        cure: "Write it with operations that all controls agree on, as the finding suggests.",
        example: words("`#1=-7 MOD 3` in Macro B"),
    }

    "PRG-EXPRESSION-TRUTH" [EXPRESSION_TRUTH: Error] {
        meaning: "a condition where a number is needed, or the other way round",
        cause: "In Macro B a comparison cannot be stored, and a number is no condition; AND and OR between comparisons need brackets.",
        cure: "Put each condition in brackets of its own: `[[#1 GT 0] AND [#2 LT 5]]`; assign 1 or 0 behind `IF [...] THEN`.",
        example: words("`#1=[#2 GT 5]` in Macro B"),
    }

    "PRG-EXPRESSION-EQUALITY" [EXPRESSION_EQUALITY: Info] {
        meaning: "numbers that are not whole are compared for equality",
        cause: "A control compares about eight digits; here numbers are equal where they differ by at most 1e-9 of their size.",
        cure: "Compare the difference with a tolerance, or compare with GE or LE.",
        example: words("`IF [#1 EQ 0.1] GOTO 10`"),
    }

    "PRG-PARAMETER-NUMBER" [PARAMETER_NUMBER: Error] {
        meaning: "a parameter that does not exist",
        cause: "Its number is computed and not whole, negative, vacant or beyond those of the control.",
        cure: "Check the number, and what it is computed from.",
        example: words("`#[0.5]=1`"),
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
        example: words("`X#<width>` with nothing assigned to #<width>"),
    }

    "PRG-PARAMETER-PROBED" [PARAMETER_PROBED: Warning] {
        meaning: "the result of a probing move is used, which is not known before it is made",
        cause: "The program computes with #5061 and its neighbours, or with #5070.",
        cure: "Check what depends on it; here the result is the programmed end of the probing move.",
        example: words("`#1=#5063` behind `G31 Z-10 F100`"),
    }
}
