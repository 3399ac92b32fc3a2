//! Codes of characters, lines and numbers.

crate::finding_codes! {
    /// Codes of characters, lines and numbers.
    pub TEXT_CODES: "Program text";

    "PRG-NOT-A-PROGRAM" [NOT_A_PROGRAM: Error] {
        meaning: "the file is no program of this language; nothing else of it is reported",
        cause: "A picture, an archive, a model, a drawing, a table, text (also in UTF-16) or a program for another control (SINUMERIK, \
              HEIDENHAIN) was sent, or a file with nothing but comments or NUL bytes. Text is told from a program with mistakes by \
              what its beginning holds: next to no words of the language.",
        cure: "Let the CAM post write the program for the dialect of the machine profile, and send it as plain text in \
              UTF-8 or ASCII.",
        example: lathe("{\"program\": \"O1\"}"),
    }

    "PRG-LINE-TOO-LONG" [LINE_TOO_LONG: Error] {
        meaning: "a line is longer than the profile allows and was skipped",
        cause: "Line ends were lost in the transfer, or the file is no program. The content of the line is unknown \
              from here on.",
        cure: "Break the line into blocks, or raise `max_line_bytes` of the profile's language.",
        example: words("a line of 5000 characters where the profile allows 4096"),
    }

    "PRG-NUL" [NUL: Error, NUL_IN_COMMENT: Warning] {
        meaning: "a run of NUL bytes: an error between words, a warning in a comment",
        cause: "A punched-tape leader in the middle of a line, a file written only in part, or text in UTF-16.",
        cure: "Transfer the program again; where the bytes are inside a word, write the word again and check its number.",
        example: lathe("G0 X10 \0 Z5"),
    }

    "PRG-NOT-UTF8" [NOT_UTF8: Error, NOT_UTF8_IN_COMMENT: Warning] {
        meaning: "bytes that are not UTF-8 text: an error between words, a warning in a comment",
        cause: "The program was saved in another encoding (Windows-1252, Shift JIS), or was damaged in the transfer.",
        cure: "Save it in UTF-8 or ASCII; where the bytes are inside a word, write the word again and check its number.",
        example: words("the byte FC, an ü of Windows-1252, in a comment"),
    }

    "PRG-CHARACTER" [CHARACTER: Error] {
        meaning: "a character that has no meaning in a program, or not at this place",
        cause: "A typing error, or an operator of a macro language outside an expression.",
        cure: "Remove it; where it is inside a word, write the word again and check its number.",
        example: lathe("G0 X10 ! Z5"),
    }

    "PRG-LOOKALIKE" [LOOKALIKE: Error] {
        meaning: "characters that only look like those of a program, such as a minus sign of typesetting",
        cause: "The program was pasted from a document or typed with another keyboard: `−` for `-`, a Cyrillic `Х` for \
              `X`, a decimal comma.",
        cure: "Replace the word by the suggested one. Removing the character alone would change the number.",
        example: lathe("G0 X−5"),
    }

    "PRG-COMMENT-UNCLOSED" [COMMENT_UNCLOSED: Error] {
        meaning: "a comment is opened with ( and not closed on its line",
        cause: "The closing parenthesis is missing, or the comment was meant to run over several lines.",
        cure: "Close every comment on its own line.",
        example: lathe("G0 X10 (rough the face"),
    }

    "PRG-BLOCK-END" [BEHIND_BLOCK_END: Error] {
        meaning: "words behind `;` on the same line",
        cause: "`;` is the end of a block on these controls, and the words behind it are another block, which would be run; other \
              controls take them for a comment. Text that is no words is taken for a comment.",
        cure: "Write what is to be run on a line of its own, and what is a comment in ( ).",
        example: lathe("G0 X40. Z2.; G1 X30. F0.1"),
    }

    "PRG-TEXT" [TEXT: Error] {
        meaning: "letters without numbers outside a comment",
        cause: "A comment without parentheses, or a letter O where a zero is meant, as in `GO`.",
        cure: "Write comments in ( ), and check the code for a letter in place of a digit.",
        example: lathe("ROUGHING"),
    }

    "PRG-EXPRESSION" [EXPRESSION: Error] {
        meaning: "an expression or a statement where none can stand",
        cause: "Brackets without an address letter, or `IF`, `GOTO`, `WHILE` behind other words of the block.",
        cure: "Write the address letter before the brackets, and a statement as the first of a block of its own.",
        example: mill("G0 X1 GOTO 10"),
    }

    "PRG-NUMBER-MISSING" [NUMBER_MISSING: Error] {
        meaning: "an address letter without a number, or a name that no program can have here",
        cause: "The number was forgotten, or is in front of its letter. Names of programs in `< >` are those of FANUC controls: 1 to 32 letters, digits \
              and `+ - _ .`, first in a line or behind `M98`, `G65` or `G66`.",
        cure: "Write the number behind its letter, and call a program by its number or by such a name.",
        example: lathe("G0 X Z5"),
    }

    "PRG-NUMBER-STRAY" [NUMBER_STRAY: Error] {
        meaning: "a number without an address letter",
        cause: "The letter was forgotten, or there is a separator between letter and number.",
        cure: "Write the letter in front of the number, or remove the number.",
        example: lathe("25.5 G0 X10"),
    }

    "PRG-NUMBER-INVALID" [NUMBER_INVALID: Error] {
        meaning: "a number that cannot be read",
        cause: "Two decimal points, two signs or a sign behind the digits.",
        cure: "Write an optional sign, digits and at most one decimal point.",
        example: lathe("G0 X1.2.3"),
    }

    "PRG-NUMBER-RANGE" [NUMBER_RANGE: Error] {
        meaning: "a number beyond the permitted range",
        cause: "A value beyond ±1e9, or a line or program number beyond 99999999: a decimal point or a blank is missing.",
        cure: "Check the number. A line or program number can also be removed; it moves nothing.",
        example: lathe("G0 X10000000000"),
    }

    "PRG-NUMBER-NOT-WHOLE" [NUMBER_NOT_WHOLE: Error] {
        meaning: "a number that has to be whole and not negative",
        cause: "A tool, an offset, a line, a program or a count with decimals or a sign.",
        cure: "Write a whole number from 0 on.",
        example: lathe("T1.5"),
    }

    "PRG-LINE-NUMBER-LATE" [LINE_NUMBER_LATE: Error] {
        meaning: "a line number behind other words of its block",
        cause: "LinuxCNC reads a line number only as the first word of a block, and refuses `N` anywhere else. FANUC and Haas controls take \
              it anywhere.",
        cure: "Write it at the start of the block, or remove it.",
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "G0 X1 N5"),
    }

    "PRG-NUMBER-SPACED" [NUMBER_SPACED: Warning] {
        meaning: "a number written with spaces inside, read as one number",
        cause: "Some controls ignore blanks, so `X1 0` is X10 there; a reader may take it for two numbers.",
        cure: "Write the number without spaces.",
        example: lathe("G0 X1 0"),
    }

    "PRG-NO-END" [NO_END_REFUSED: Error, NO_END: Warning] {
        meaning: "the program just stops, without M2, M30 or a closing %: an error in LinuxCNC",
        cause: "The end was forgotten, or the transfer broke off and blocks are missing. LinuxCNC does not run a program \
              without M2, M30 or a pair of %. A file that has nothing but subprograms for others to call is a warning there.",
        cure: "Check that the program is complete, and end it with M30 (or M2) and %. Name a file of subprograms as a further file of \
               the program that calls them.",
        example: lathe("G0 X10"),
    }

    "PRG-TITLE-WORDS" [TITLE_WORDS: Error] {
        meaning: "words behind the % that begins the file",
        cause: "FANUC controls skip what stands between the first % and the end of its line: a title, or words that would not be \
                carried out. LinuxCNC refuses it.",
        cure: "Write the words in the line below, and a title in ( ).",
        example: lathe("%G20\nG0 X10\nM30\n%"),
    }

    "PRG-TRAILING" [TRAILING: Warning] {
        meaning: "text after the end of the program, which is not read",
        cause: "Two programs in one file, subprograms behind the main program, or notes of the post.",
        cure: "Remove what follows M2, M30 or the closing %, or send it as a program of its own.",
        example: lathe("G0 X10\nM30\n%\nG0 X20"),
    }
}
