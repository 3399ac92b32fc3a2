//! Codes of threads and their vibration.

feedwave_program::finding_codes! {
    /// Codes of threads and their vibration.
    pub THREAD_VIBRATION_CODES: "Threads and their vibration";

    "THREAD-MODE-WORD" [THREAD_MODE_WORD: Error] {
        meaning: "the vibration of threads without its work diameter or its ratio, or with one out of range",
        cause: "X is not positive, or Q, the ratio of amplitude to infeed, is not above 1: the amplitude has to exceed \
              the infeed.",
        cure: "Write the diameter of the work as X and a ratio above 1 as Q, such as `G165 P3 X10.0 Q1.2`.",
        example: lathe("G165 P3 X10 Q0.8\nG165 P0\nM30"),
    }

    "THREAD-OFF-WITHOUT-ON" [THREAD_OFF_WITHOUT_ON: Error] {
        meaning: "the vibration of threads is switched off but was not on",
        cause: "The block that switches it on is missing, or it was switched off twice.",
        cure: "Remove the block, or switch the vibration on before it.",
        example: lathe("G165 P0\nM30"),
    }

    "THREAD-NESTED" [THREAD_NESTED: Error] {
        meaning: "the vibration of threads is switched on while it is on",
        cause: "Another thread was meant to begin, and the one before was not switched off.",
        cure: "Switch it off before it is switched on with other values.",
        example: lathe("G165 P3 X10 Q1.2\nG165 P3 X20 Q1.2\nG165 P0\nM30"),
    }

    "THREAD-UNCLOSED" [THREAD_UNCLOSED: Warning] {
        meaning: "the program ends while the vibration of threads is on",
        cause: "The block that switches it off is missing.",
        cure: "Switch it off after the last pass.",
        example: lathe("G165 P3 X10 Q1.2\nM30"),
    }

    "THREAD-VIBRATION-OFF" [THREAD_VIBRATION_OFF: Error] {
        meaning: "a pass has an amplitude or a phase shift, but the vibration of threads is off",
        cause: "The A or R word is in a thread before the vibration is switched on, or after it is switched off.",
        cure: "Switch the vibration on before the first pass, or leave the word out.",
        example: lathe("M3 S300\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5 A2\nM30"),
    }

    "THREAD-LEAD-X" [THREAD_LEAD_X: Error] {
        meaning: "a thread vibrates along its lead",
        cause: "A thread along X is cut while the work diameter (X) of `G165` lets X vibrate, or one along Z while its face (Z) lets Z vibrate.",
        cure: "State the surface across the lead: X for threads along Z, Z for threads along X. Or switch the vibration off for this thread, or write A0.0.",
        example: lathe("M3 S300\nG165 P3 X60 Q1.2\nG0 X60 Z0\nG32 X20 F2.5\nG165 P0\nM30"),
    }

    "THREAD-FACE-SIDE" [THREAD_FACE_SIDE: Error] {
        meaning: "a vibrating pass of a thread on a face starts above the face",
        cause: "The face (Z of `G165`) is stated too low, or it is the one on the other side of the work: the vibration would retreat into it.",
        cure: "State the face where it is, and start every pass at it or below it.",
        example: lathe("M3 S300\nG165 P3 Z0 Q1.3\nG0 X80 Z5\nG0 Z0.3\nG32 X20 F4\nG0 Z5\nG165 P0\nM30"),
    }

    "THREAD-PARTS" [THREAD_PARTS: Error] {
        meaning: "a thread of too many parts",
        cause: "More than 100 threading blocks follow each other without a move between them.",
        cure: "Cut the thread in longer blocks.",
        example: words("101 blocks of G32 one behind the other"),
    }

    "THREAD-PART-VIBRATION" [THREAD_PART_VIBRATION: Error] {
        meaning: "a further part of a thread states another vibration than its first block",
        cause: "A or R is in a second threading block that goes on from the first; the vibration of a pass is one.",
        cure: "Write A and R in the first block of the thread only.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X8\nG32 Z80 F2.5 A2\nG32 Z60 F2.5 A1\nG165 P0\nM30"),
    }

    "THREAD-PASSES" [THREAD_PASSES: Error] {
        meaning: "a vibrating thread of more than 100 passes",
        cause: "The passes go very little deeper each, or several threads at one place are counted as one.",
        cure: "Let every pass go deeper, or switch the vibration off and on between two threads.",
        example: words("101 passes of one thread under `G165`"),
    }

    "THREAD-NO-INFEED" [THREAD_NO_INFEED: Warning] {
        meaning: "a pass goes no deeper than the one before, so that the ratio gives it no vibration",
        cause: "A spring pass, or a finishing pass at the same depth, under `G165`.",
        cure: "Write its amplitude as A; A0.0 for a pass without vibration. A cycle has no such word: cut the pass with `G32`.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG0 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-SPEED-CHANGED" [THREAD_SPEED_CHANGED: Warning] {
        meaning: "two passes of one thread at different spindle speeds",
        cause: "At another speed the lead axis comes into step at another place, so the pass runs beside the groove.",
        cure: "Cut all passes of a thread at one spindle speed.",
        example: lathe("M3 S300\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG0 Z100\nM3 S400\nG0 X7.5\nG32 Z60 F2.5\nG0 X14\nM30"),
    }

    "THREAD-STOPS" [THREAD_STOPS: Warning] {
        meaning: "something between the blocks of a thread stops the tool in the work",
        cause: "Threading blocks that follow each other are one thread. A spindle speed, a dwell or an M code between them ends it: the tool \
              stops, and waits for the spindle before it goes on, at another speed in another place than the groove.",
        cure: "Write it before the first block of the thread, or behind the last one.",
        example: on("lathe, language.dialect = DIALECT_LINUXCNC", "M3 S300\nG0 X4 Z100\nG33 Z80 K2.5\nS400\nG33 Z60 K2.5\nG0 X7\nM30"),
    }

    "SPINDLE-STOPPED" [THREAD_SPINDLE_STOPPED: Error] {
        meaning: "a thread follows the spindle, which does not turn at a constant speed",
        cause: "The machine's limit leaves the spindle no speed, or the speed is unlimited at X0.",
        cure: "Start the spindle before, such as `G97 M3 S500`.",
        example: words("a machine profile whose `max_spindle_rev_per_min` leaves no speed"),
    }

    "THREAD-TRAVEL" [THREAD_TRAVEL: Error] {
        meaning: "a thread with a part that has no travel or no lead",
        cause: "Two threading blocks end at the same place, or the number of turns is out of range.",
        cure: "Check the end point, the position before it and the lead.",
        example: words("a threading block of 1 mm with a lead of a picometre"),
    }

    "THREAD-TAP-OVERRIDE" [THREAD_TAP_OVERRIDE: Info] {
        meaning: "rigid taps, on which the feed override does not act",
        cause: "`M29` with `G84` or `G74`, a profile with rigid tapping, or `G33.1`: the tool is bound to the spindle; feed hold \
              acts before and behind a stroke.",
        cure: "Nothing is needed; change the speed of the spindle where the tap is to run slower.",
        example: mill("M29 S500\nG0 Z10\nG84 X0 Y0 Z-8 R2 F500\nG80\nM30"),
    }

    "THREAD-TAP-SPEED" [THREAD_TAP_SPEED: Info] {
        meaning: "a stroke of a rigid tap that is too short for its spindle speed",
        cause: "The limits of the axis let spindle and tool reach only a part of the speed before they have to slow down.",
        cure: "Nothing is needed for the thread; write a lower speed where the cutting speed is to be as programmed.",
        example: words("a tap of M3 that goes 1 mm deep at 5000 rev/min"),
    }

    "THREAD-PULL-OUT" [THREAD_PULL_OUT: Error] {
        meaning: "the tool is pulled out over all of the thread",
        cause: "The chamfer of a cycle is as long as the thread, or the thread does not move along Z.",
        cure: "Pull the tool out over a shorter length, or cut a longer thread.",
        example: words("a cycle whose exit taper takes the whole pass"),
    }

    "THREAD-PARAMETER" [THREAD_PARAMETER: Error] {
        meaning: "a quantity of a thread that is impossible",
        cause: "A lead, a depth, an angle, a number of starts or a limit of the request, or what the program makes of \
              it, is out of its range.",
        cure: "State a value in the range that the finding names.",
        example: words("a request to plan a thread of depth 0"),
    }

    "THREAD-HAND" [THREAD_HAND: Error] {
        meaning: "direction of cut and spindle make a thread of the other hand than the one asked for",
        cause: "Start and end are exchanged, or the spindle turns in the other direction.",
        cure: "Exchange start and end of the thread, or reverse the spindle.",
        example: words("a request to plan a right-hand thread that is cut away from the chuck with the spindle forward"),
    }

    "THREAD-LEAD-SPEED" [THREAD_LEAD_SPEED: Error] {
        meaning: "the lead at this spindle speed is faster than its axis",
        cause: "Lead times spindle speed exceeds the velocity limit of Z (of X on a face).",
        cure: "Turn at most at the speed that the finding names.",
        example: lathe("M3 S5000\nG0 X14 Z400\nG0 X8\nG32 Z60 F100\nG0 X14\nM30"),
    }

    "THREAD-AXIS-SPEED" [THREAD_AXIS_SPEED: Error] {
        meaning: "a part of a thread moves an axis faster than it can",
        cause: "A further part, a taper or a pull-out is faster than the velocity limit, with the vibration in X.",
        cure: "Turn at most at the speed that the finding names.",
        example: lathe("M3 S300\nG0 X20 Z100\nG32 Z60 F2.5\nG32 X300 Z50 F200\nG0 Z120\nM30"),
    }

    "THREAD-RUN-UP" [THREAD_RUN_UP: Error] {
        meaning: "the lead axis needs a longer run-up than the one that is stated",
        cause: "Acceleration and jerk of the axis do not reach the speed of the lead over this angle of the spindle.",
        cure: "Accelerate over the angle that the finding names, or turn slower.",
        example: words("a request to plan a thread with a run-up of 1 degree"),
    }

    "THREAD-APPROACH-SHORT" [THREAD_APPROACH_SHORT: Error] {
        meaning: "a pass starts too close to the work for the lead axis to come into step before it",
        cause: "The run-up at this spindle speed is longer than the approach that `thread_vibration.approach_mm` or \
              the request states.",
        cure: "Start the thread further before the work, or turn slower.",
        example: on("lathe, thread_vibration.approach_mm = 0.5", "M3 S2000\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nM30"),
    }

    "THREAD-LENGTH-SHORT" [THREAD_LENGTH_SHORT: Error] {
        meaning: "a thread too short to have its lead: changing the speed at both ends takes all of it",
        cause: "The pass or a part of it is shorter than run-up and run-out at this spindle speed.",
        cure: "Turn slower, or start further before the work and end further behind it.",
        example: lathe("M3 S3000\nG0 X14 Z61\nG0 X8\nG32 Z60 F2.5\nG0 X14\nM30"),
    }

    "THREAD-CORNER" [THREAD_CORNER: Warning] {
        meaning: "the tool passes a corner between two blocks of a thread at a distance",
        cause: "The blocks of a thread follow each other without a stop. The tool changes its direction as fast as the axes permit, from \
              before the corner to behind it, and cuts the corner on its inner side. More than 0.01 mm is named.",
        cure: "Turn slower, or begin and end the thread on one line, outside of the work.",
        example: lathe("M3 S2000\nG0 X20 Z5\nG32 X40 Z-15 F3\nG32 Z-40 F3\nG0 X62\nM30"),
    }

    "THREAD-START-ANGLE" [THREAD_START_ANGLE: Error] {
        meaning: "the start angle of a pass is outside 0 to 360 degrees",
        cause: "An angle of 360 or more, or a negative one.",
        cure: "Use the same place on the spindle within 0 to below 360, which the finding names.",
        example: lathe("M3 S300\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5 Q360\nG0 X14\nM30"),
    }

    "THREAD-PROFILE-WIDE" [THREAD_PROFILE_WIDE: Error, THREAD_PROFILE_WIDE_ASSUMED: Warning] {
        meaning: "the groove is wider than the pitch and takes the crests of its neighbours: an error where the diameter of the work \
              is stated, a warning where it is assumed",
        cause: "The thread is too deep for the angle of the tool and the pitch, often a diameter for a radius. Without vibration no \
              word states the diameter of the work: the first infeed is taken to be the largest of the later ones, and may be less.",
        cure: "Cut at most as deep as the finding names; where the diameter is assumed, check it.",
        example: lathe("M3 S300\nG165 P3 X20 Q1.2\nG0 X24 Z100\nG0 X12\nG32 Z60 F2.5\nG0 X24\nG165 P0\nM30"),
    }

    "THREAD-SAMPLING-NYQUIST" [THREAD_SAMPLING_NYQUIST: Error] {
        meaning: "fewer than two setpoints per vibration of a thread",
        cause: "Vibrations per revolution times spindle speed is more than half of the rate of setpoints.",
        cure: "Use the period or the spindle speed that the finding names.",
        example: on("lathe, interpolation_period_us = 20000", "M3 S3000\nG165 P3 X10 Q1.2\nG0 X14 Z200\nG0 X9.6\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-SAMPLING-COARSE" [THREAD_SAMPLING_COARSE: Warning] {
        meaning: "fewer than eight setpoints per vibration of a thread: part of its peak is lost between them",
        cause: "The interpolation period is long against the vibration.",
        cure: "Use the period or the spindle speed that the finding names.",
        example: on("lathe, interpolation_period_us = 20000", "M3 S400\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9.6\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-VIBRATION-VELOCITY" [THREAD_VIBRATION_VELOCITY: Error] {
        meaning: "the vibration of a pass takes more velocity than X has",
        cause: "Half the amplitude times 2π times its frequency, with the taper, exceeds the limit.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: on("lathe, thread_vibration.vibrations_per_rev = 9.5", "M3 S3000\nG165 P3 X10 Q1.2\nG0 X14 Z200\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-VIBRATION-ACCELERATION" [THREAD_VIBRATION_ACCELERATION: Error] {
        meaning: "the vibration of a pass takes more acceleration than X has",
        cause: "It grows with the square of spindle speed and vibrations per revolution.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: lathe("M3 S2000\nG165 P3 X10 Q1.2\nG0 X14 Z200\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-VIBRATION-JERK" [THREAD_VIBRATION_JERK: Error] {
        meaning: "the vibration of a pass takes more jerk than X has",
        cause: "It grows with the cube of spindle speed and vibrations per revolution.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: lathe("M3 S2000\nG165 P3 X10 Q1.2\nG0 X14 Z200\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-VIBRATION-STEP" [THREAD_VIBRATION_STEP: Warning] {
        meaning: "the start or end of the vibration of a pass takes more jerk than X has at this interpolation period",
        cause: "The vibration starts from rest, and comes to rest, where it turns back, with its whole acceleration: setpoints \
              spread that step over their period.",
        cure: "Use the amplitude or the spindle speed that the finding names, or a drive that smooths such a step.",
        example: on("lathe, interpolation_period_us = 250", "M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-VIBRATION-LATE" [THREAD_VIBRATION_LATE: Warning] {
        meaning: "the vibration of a pass comes into its phase in the work already",
        cause: "The delay of the vibration, or its start from rest in the middle of the wave over two vibrations, takes longer than the approach to the work.",
        cure: "Start further before the work, or use the start-up with preparatory movement and a phase shift of 0 or 180 degrees.",
        example: on("lathe, thread_vibration.start_up = THREAD_START_UP_DELAYED, thread_vibration.approach_mm = 0.6", "M3 S100\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9.6\nG32 Z60 F2.5 R270\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-FIRST-PASS" [THREAD_FIRST_PASS: Warning] {
        meaning: "the vibration of the first pass does not leave the work, so that its chip is not cut through",
        cause: "Its amplitude is no larger than its infeed.",
        cure: "Vibrate with more than the amplitude that the finding names.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5 A0.6\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-AMPLITUDE-SMALL" [THREAD_AMPLITUDE_SMALL: Warning] {
        meaning: "the vibration of a pass does not reach beyond its infeed, so that its chip is not cut through",
        cause: "The A word is smaller than the infeed of the pass.",
        cure: "Vibrate with more than the amplitude that the finding names.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5\nG0 X14\nG0 Z100\nG0 X8\nG32 Z60 F2.5 A0.4\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-PHASE-EQUAL" [THREAD_PHASE_EQUAL: Warning] {
        meaning: "two passes vibrate with one phase at the same place on the work: the second follows the first",
        cause: "Both have the same phase shift R, or a start that comes a revolution later turns it back.",
        cure: "Shift the phase to what the finding names, half a vibration from the pass before.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5 R0\nG0 X14\nG0 Z100\nG0 X8\nG32 Z60 F2.5 R0\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-PHASE-UNBROKEN" [THREAD_PHASE_UNBROKEN: Warning] {
        meaning: "the phases of two passes are too close: the chip is not cut through",
        cause: "The amplitude breaks the chip with opposite phase only, and the phases differ by less.",
        cure: "Shift the phase to what the finding names, or use a larger amplitude.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5 R0\nG0 X14\nG0 Z100\nG0 X8\nG32 Z60 F2.5 R40\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-TURN-PHASE" [THREAD_TURN_PHASE: Info] {
        meaning: "a pass comes to its place on the work a revolution later, so that its phase there is another one",
        cause: "Start angle or start position moves the pass beyond a whole turn, and the vibrations per revolution \
              are not whole.",
        cure: "Program the shift that the finding names where the programmed one is meant at the work. It names none where the chip breaks because of \
              the turn.",
        example: on("lathe, thread_vibration.vibrations_per_rev = 2.5", "M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5 Q0\nG0 X14\nG0 Z100\nG0 X8\nG32 Z60 F2.5 Q320\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-CHIP-RIBBON" [THREAD_CHIP_RIBBON: Warning] {
        meaning: "the chip is cut through in depth, but a ribbon holds together at the flank",
        cause: "With infeed along the flank the chip is thicker there than in the middle.",
        cure: "Use the amplitude or the ratio that the finding names, or come straight in.",
        example: lathe("G97 S300 M3\nG0 X14 Z100\nG165 P3 X10 Q1.05\nG0 X8\nG32 Z60 F2.5 Q0\nG0 X14\nG0 Z100\nG0 X7.172\nG32 Z60 F2.5 Q325.584\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-THICKNESS" [THREAD_THICKNESS: Warning] {
        meaning: "a pass cuts a thicker chip than the tool permits",
        cause: "Infeed and amplitude, with what the passes before left, exceed `thread_vibration.max_thickness_mm`.",
        cure: "Cut the thread in more passes, or with smaller amplitudes.",
        example: on("lathe, thread_vibration.max_thickness_mm = 0.2", "M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-PASS-AIR" [THREAD_PASS_AIR: Info] {
        meaning: "a pass cuts nothing that earlier passes left",
        cause: "A spring pass without infeed, or a pass beside the groove.",
        cure: "Leave the pass out, unless it is meant to take up deflection.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5 A0\nG0 X14\nG0 Z100\nG0 X9\nG32 Z60 F2.5 A0\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-CRESTS" [THREAD_CRESTS: Warning] {
        meaning: "the vibrating passes leave crests that are too much for the finishing pass",
        cause: "What the last vibrating pass leaves, together with the finishing infeed, exceeds twice that infeed or \
              `thread_vibration.max_finishing_thickness_mm`.",
        cure: "Add a vibrating pass at the same depth with opposite phase, or a smaller last amplitude, as the finding \
              says; it also says where that does not suffice.",
        example: lathe("M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X8\nG32 Z60 F2.5\nG0 X14\nG0 Z100\nG0 X7.9\nG32 Z60 F2.5 A0\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-FOLLOWING-LOSS" [THREAD_FOLLOWING_LOSS: Warning, THREAD_FOLLOWING_LOSS_NOTED: Info] {
        meaning: "less of the vibration of a pass arrives at the tool than is commanded: a warning where that is too little to break \
              the chip",
        cause: "The drive of the vibrating axis, as the profile's `following` states it, passes less than nine tenths of the \
              amplitude, or too little to break the chip; the tool then stays above the depth, too. The share is the same of every \
              amplitude.",
        cure: "Use the ratio, amplitude or spindle speed that the finding names: what arrives then breaks the chip. Where it does \
              already, nothing has to be changed.",
        example: on("lathe, following.position_loop_gain_per_s = 60", "M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-FOLLOWING-DEEP" [THREAD_FOLLOWING_DEEP: Warning] {
        meaning: "the drives make the vibration of a pass larger, so that it cuts too deep",
        cause: "The drive of the vibrating axis, as the profile's `following` states it, resonates near the frequency of the \
              vibration: the retreat is larger than commanded, and swings beyond the depth as well.",
        cure: "Turn at the spindle speed that the finding names. No amplitude ends it, since the share that arrives is the same of \
              every one; the finding says which amplitude, depth and phase shift make the thread that is programmed.",
        example: on("lathe, following.position_loop_gain_per_s = 100, following.velocity_loop_frequency_hz = 10", "M3 S300\nG165 P3 X10 Q1.2\nG0 X14 Z100\nG0 X9\nG32 Z60 F2.5\nG0 X14\nG165 P0\nM30"),
    }

    "THREAD-PLAN-PASSES" [THREAD_PLAN_PASSES: Error] {
        meaning: "no plan of a thread with a permitted number of passes keeps all limits",
        cause: "The first depth is too small for the depth, or the limits of axes and tool are so low that more passes \
              do not help.",
        cure: "Allow a deeper first pass, turn slower, use fewer vibrations per revolution, or come straight in.",
        example: words("a request to plan a thread of depth 3 mm with a first depth of 0.001 mm"),
    }

    "THREAD-PLAN-CRESTS" [THREAD_PLAN_CRESTS: Error] {
        meaning: "the thickness permitted for the finishing pass leaves nothing for crests above its allowance",
        cause: "`finishing_thickness_mm` of the request is not above the finishing allowance.",
        cure: "Permit at least the thickness that the finding names.",
        example: words("a request to plan a thread with a finishing allowance of 0.05 mm and a permitted thickness of 0.05 mm"),
    }
}
