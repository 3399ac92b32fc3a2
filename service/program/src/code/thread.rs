//! Codes of threads and threading cycles as they are programmed.

crate::finding_codes! {
    /// Codes of threads and threading cycles as they are programmed.
    pub THREAD_CODES: "Words of threads";

    "PRG-THREAD-LEAD" [THREAD_LEAD: Error] {
        meaning: "a lead of a thread, or a number of threads per inch, that is out of range or no lead on this control",
        cause: "F, E or K gives a lead outside 0.0001 to 500 mm, or is not positive; E is threads per inch or a lead \
              as the profile says. K is a lead in LinuxCNC only: FANUC and Haas controls have F, and change the lead by K with G34.",
        cure: "Write the travel per revolution as F, such as F1.5.",
        example: lathe("M3 S500\nG32 Z-20 F0"),
    }

    "PRG-THREAD-PER-INCH" [THREAD_FEW_PER_INCH: Warning] {
        meaning: "fewer than four threads per inch by E, whose number may be meant as the lead",
        cause: "The profile says that `E` is threads per inch, or says nothing; other controls have it as the lead: `E1.5` is a lead of 16.933 mm or \
              of 1.5 mm.",
        cure: "Write the lead as F, or set `language.thread_e_word` of the machine profile as the control has it.",
        example: lathe("M3 S500\nG0 X30 Z5\nG32 Z-20 E1.5"),
    }

    "PRG-THREAD-LEAD-MISSING" [THREAD_LEAD_MISSING: Error] {
        meaning: "a thread without a lead",
        cause: "Neither the thread nor one before it has F or E; the feed of a cut is not used as a lead.",
        cure: "Add F with the travel per revolution.",
        explained_by: modal("FEG"),
        example: lathe("M3 S500\nG32 Z-20"),
    }

    "PRG-THREAD-TRAVEL" [THREAD_TRAVEL: Error] {
        meaning: "a thread that goes nowhere",
        cause: "It ends where it starts, or infeed along the flank and chamfer take all of its length.",
        cure: "Check the end point and the position before it, or use a shorter chamfer.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: lathe("M3 S500\nG0 X20 Z5\nG32 X20 Z5 F1.5"),
    }

    "PRG-THREAD-AXIS" [THREAD_AXIS: Error] {
        meaning: "a thread with a word of an axis other than X and Z",
        cause: "The block moves a third axis, which would not follow the spindle.",
        cure: "Move the other axes in a block before it.",
        example: lathe("M3 S500\nG32 Z-20 Y1 F1.5"),
    }

    "PRG-THREAD-ANGLE" [THREAD_ANGLE: Error] {
        meaning: "a start angle or a phase shift of a thread outside 0 to 360 degrees",
        cause: "A negative angle, one beyond a whole turn, or a number without a decimal point that is neither degrees nor thousandths.",
        cure: "Write the angle that the finding suggests.",
        example: lathe("M3 S500\nG32 Z-20 F1.5 Q400."),
    }

    "PRG-THREAD-ANGLE-UNIT" [THREAD_ANGLE_UNIT: Warning] {
        meaning: "a start angle within a turn and with no decimal point, which may be degrees or thousandths of a degree",
        cause: "FANUC and Haas lathes count `Q` in thousandths of a degree: `Q180` is 0.18 degrees there, and so it is in `G92` and `G76`. \
              Passes that vibrate (`G165`) have degrees.",
        cure: "Write thousandths, `Q180000` for half a turn.",
        example: lathe("M3 S500\nG0 X40 Z2\nG92 X29 Z-20 F2 Q180"),
    }

    "PRG-THREAD-VARIABLE-LEAD" [THREAD_VARIABLE_LEAD: Error] {
        meaning: "a thread whose lead changes along it",
        cause: "`G34` changes the lead by `K` in every revolution; threads have one lead here.",
        cure: "Write it as threads of constant lead behind each other, `G32` or `G33` with an `F` each, where the part permits it.",
        example: lathe("M3 S500\nG34 Z-20 F1.5 K0.1"),
    }

    "PRG-THREAD-FLANK" [THREAD_FLANK: Info] {
        meaning: "the passes of a threading cycle begin beside each other, along the flank of the tool",
        cause: "Pass by pass the start moves by what the depth lacks of the height times the tangent of half the tool angle, away from \
                the end of the thread, so that the last pass begins where the cycle does. Some controls move it in the other direction.",
        cure: "Start far enough from the work on both sides; the thread itself is the same.",
        example: lathe("M3 S500\nG0 X24 Z5\nG76 P010060 Q100 R0.05\nG76 X18.16 Z-20 P920 Q300 F1.5"),
    }

    "PRG-THREAD-CHAMFER" [THREAD_CHAMFER: Info] {
        meaning: "a threading cycle without a chamfer at its end, as nothing states one",
        cause: "Controls leave the thread at 45 degrees over some tenths of a lead, which a parameter or a setting says; neither the machine \
                profile nor the program does.",
        cure: "Set language.turning.thread_chamfer_tenths of the machine profile as the control has it, 0 for none.",
        example: lathe("M3 S500\nG0 X24 Z5\nG92 X19.2 Z-20 F1.5"),
    }

    "PRG-THREAD-AMPLITUDE" [THREAD_AMPLITUDE: Error] {
        meaning: "a negative vibration amplitude of a thread",
        cause: "A has a sign: the amplitude is a peak-to-peak travel and has none.",
        cure: "Write it without a sign, or A0 for a pass without vibration.",
        example: lathe("M3 S500\nG32 Z-20 F1.5 A-0.2"),
    }

    "PRG-THREAD-PLANE-WORK" [THREAD_PLANE_WORK: Error] {
        meaning: "a vibrating thread whose work was stated in other coordinates",
        cause: "The vibration of threads was switched on before a plane was tilted (`G68.2`) or cancelled (`G69`): the diameter or the face of the work \
              that it states is one of the coordinates before.",
        cure: "Switch it off, and on again in the coordinates of the thread; or write A0.0 for a pass without vibration.",
        example: mill("M3 S300\nG165 P3 X10. Q1.2\nG68.2 X0 Y0 Z0 I0 J30 K0\nG0 X8 Y0 Z10\nG33 Z-5 F1.5\nG165 P0\nM30"),
    }

    "PRG-THREAD-SURFACE-SPEED" [THREAD_SURFACE_SPEED: Error] {
        meaning: "a thread under constant surface speed",
        cause: "`G96` is in force: the speed would change with X, and passes would not meet in one groove.",
        cure: "Switch to a constant speed before it, such as `G97 S500`.",
        example: lathe("G50 S2000\nG96 S150 M3\nG0 X30 Z5\nG32 Z-20 F1.5"),
    }

    "PRG-THREAD-CYCLE-FORM" [THREAD_CYCLE_FORM: Error] {
        meaning: "a threading cycle whose words belong to none or several of its forms, or in another plane than that \
              of Z and X",
        cause: "`G76` is written in two lines, in one line or as in LinuxCNC (J); the block mixes their words.",
        cure: "Write one form: `G76 P Q R` and `G76 X Z R P Q F`; or `G76 X Z I K D F A P`; or `G76 P Z I J K`. The \
              last needs G18.",
        example: lathe("M3 S500\nG0 X30 Z5\nG76 X27 Z-20 D300 R0.1 F1.5"),
    }

    "PRG-THREAD-CYCLE-WORD" [THREAD_CYCLE_WORD: Error] {
        meaning: "a threading cycle without a word it needs",
        cause: "End point, height, first depth or the whole first line of `G76` is missing.",
        cure: "Add the missing words.",
        explained_by: modal("PQRXZUWFIJKABDEH"),
        example: lathe("M3 S500\nG0 X30 Z5\nG76 P021060 Q50 R0.05\nG76 X27 Z-20 P1000 F1.5"),
    }

    "PRG-THREAD-CYCLE-VALUE" [THREAD_CYCLE_VALUE: Error] {
        meaning: "a word of a threading cycle that is out of range",
        cause: "A depth, an angle or a count makes no thread; P and Q of `G76` are often thousandths of a millimetre \
              without a decimal point.",
        cure: "Write a value in the range that the finding names, and check for a missing or an extra decimal point.",
        example: lathe("M3 S500\nG76 P021061 Q50 R0.05"),
    }

    "PRG-THREAD-CYCLE-START" [THREAD_CYCLE_START: Error] {
        meaning: "a threading cycle that starts within the thread",
        cause: "X is at or inside the crest where the cycle begins: its rapids would cut the work.",
        cure: "Move X clear of the work before the cycle.",
        explained_by: modal("XYZUVWABCHIJKR"),
        example: lathe("M3 S500\nG0 X27 Z5\nG76 P021060 Q50 R0.05\nG76 X27 Z-20 P1000 Q300 F1.5"),
    }

    "PRG-THREAD-CYCLE-SIDE" [THREAD_CYCLE_SIDE: Error] {
        meaning: "a vibrating threading cycle along X whose work is on the side of larger Z",
        cause: "The taper is steeper than 45°, so that the lead is along X and the vibration along Z, away from a face towards larger Z: here that is into the work.",
        cure: "Switch the vibration off for this cycle.",
        example: lathe("M3 S300\nG0 X70 Z5\nG165 P3 Z5.5 Q1.3\nG92 X20 Z-2 R20 F2\nG165 P0\nM30"),
    }

    "PRG-THREAD-CYCLE-PASSES" [THREAD_CYCLE_PASSES: Error] {
        meaning: "a threading cycle of too many passes",
        cause: "The first depth is so small against the height that more than 100 passes follow.",
        cure: "Use the first depth that the finding names.",
        example: lathe("M3 S500\nG0 X30 Z5\nG76 P021060 Q0 R0.01\nG76 X27 Z-20 P1000 Q10 F1.5"),
    }
}
