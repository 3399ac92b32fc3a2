//! Codes of the vibration along the path.

feedwave_program::finding_codes! {
    /// Codes of the vibration along the path.
    pub PATH_VIBRATION_CODES: "Vibration along the path";

    "VIB-FREQUENCY-INVALID" [VIB_FREQUENCY_INVALID: Error] {
        meaning: "a vibration whose frequency is missing, not positive or below the permitted range",
        cause: "The F word of the block that switches the vibration on is missing, zero, negative or below 0.001 Hz.",
        cure: "Write the frequency in hertz, such as F50.",
        example: lathe("G200 A0.03\nM30"),
    }

    "VIB-FREQUENCY-LIMIT" [VIB_FREQUENCY_LIMIT: Error] {
        meaning: "a vibration frequency beyond the machine's limit",
        cause: "F is above `vibration.max_frequency_hz` of the machine profile.",
        cure: "Use at most the frequency that the finding names.",
        example: lathe("G200 F600 A0.03\nM30"),
    }

    "VIB-AMPLITUDE-INVALID" [VIB_AMPLITUDE_INVALID: Error] {
        meaning: "a vibration whose amplitude is missing or not positive",
        cause: "The A word of the block that switches the vibration on is missing, zero or negative.",
        cure: "Write the amplitude, half of the travel from peak to peak, such as A0.03.",
        example: lathe("G200 F50\nM30"),
    }

    "VIB-AMPLITUDE-LIMIT" [VIB_AMPLITUDE_LIMIT: Error] {
        meaning: "a vibration amplitude beyond the machine's limit",
        cause: "A is above `vibration.max_amplitude_mm` of the machine profile.",
        cure: "Use at most the amplitude that the finding names.",
        example: lathe("G200 F50 A2\nM30"),
    }

    "VIB-OFF-WITHOUT-ON" [VIB_OFF_WITHOUT_ON: Error] {
        meaning: "the vibration is switched off but was not on",
        cause: "The block that switches it on is missing, or it was switched off twice.",
        cure: "Remove the block, or switch the vibration on before it.",
        example: lathe("G201\nM30"),
    }

    "VIB-NESTED" [VIB_NESTED: Error] {
        meaning: "the vibration is switched on while it is on",
        cause: "Another condition was meant to begin, and the one before was not switched off.",
        cure: "Switch the vibration off before it is switched on with other values.",
        example: lathe("G200 F50 A0.03\nG200 F60 A0.03\nM30"),
    }

    "VIB-UNCLOSED" [VIB_UNCLOSED: Warning] {
        meaning: "the program ends while the vibration is on",
        cause: "The block that switches it off is missing.",
        cure: "Switch the vibration off before the end of the program.",
        example: lathe("G200 F50 A0.03\nM30"),
    }

    "VIB-SAMPLING-NYQUIST" [VIB_SAMPLING_NYQUIST: Error] {
        meaning: "fewer than two setpoints per vibration: another, slower wave would be cut",
        cause: "The frequency is more than half of the rate of setpoints.",
        cure: "Use a shorter interpolation period, the servo-side mode or a lower frequency.",
        example: on("lathe, interpolation_period_us = 20000", "M3 S1000\nG0 X20 Z5\nG200 F50 A0.03\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-SAMPLING-COARSE" [VIB_SAMPLING_COARSE: Warning] {
        meaning: "fewer than eight setpoints per vibration: part of its peak is lost between them",
        cause: "The interpolation period is long against the vibration.",
        cure: "Use the period that the finding names, or the servo-side mode.",
        example: on("lathe, interpolation_period_us = 4000", "M3 S1000\nG0 X20 Z5\nG200 F50 A0.03\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-AXIS-VELOCITY" [VIB_AXIS_VELOCITY: Error] {
        meaning: "feed and vibration together take more velocity than an axis has",
        cause: "The peak 2πf·A beside the feed exceeds the velocity limit of an axis in the direction of the cut.",
        cure: "Lower amplitude, frequency or feed to what the finding names.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F400 A0.5\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-AXIS-ACCELERATION" [VIB_AXIS_ACCELERATION: Error] {
        meaning: "the vibration takes more acceleration than an axis has",
        cause: "The peak (2πf)²·A, with its blend in and out, exceeds what the acceleration limit of an axis leaves in the \
              direction of the cut: a fiftieth is for the feed, and a curve takes its part.",
        cure: "Lower amplitude or frequency to what the finding names.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F200 A0.1\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-AXIS-JERK" [VIB_AXIS_JERK: Error] {
        meaning: "the vibration takes more jerk than an axis has",
        cause: "The peak (2πf)³·A, with its blend in and out, exceeds the jerk limit of an axis in the direction of \
              the cut.",
        cure: "Lower amplitude or frequency to what the finding names.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F200 A0.1\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-TRAVEL-SHORT" [VIB_TRAVEL_SHORT: Warning] {
        meaning: "a section too short for its vibration: it never reaches the amplitude, or is clamped at its ends",
        cause: "The blend in and out takes more than the section, or a published vibration travels further than the \
              section is long.",
        cure: "Use a longer section, or a smaller amplitude and a higher frequency.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F25 A0.1\nG1 Z4.9 F0.05\nG201\nM30"),
    }

    "VIB-CONTOUR" [VIB_CONTOUR: Error] {
        meaning: "in a tangential mode the tool leaves the contour by more than its tolerance",
        cause: "The offset along the tangent of an arc of radius r leaves it by about A²/2r, and goes straight on at a junction that \
              turns by less than 0.001; `vibration.contour_tolerance_mm` permits less.",
        cure: "Generate the vibration along the path, which never leaves the contour, or use the amplitude that the \
              finding names.",
        example: on("lathe, vibration.generation_mode = GENERATION_MODE_TANGENTIAL", "M3 S1000\nG0 X20 Z5\nG200 F25 A0.2\nG2 X24 Z3 R2 F0.1\nG201\nM30"),
    }

    "VIB-JUNCTION-JUMP" [VIB_JUNCTION_JUMP: Warning] {
        meaning: "at a corner the offset of a published vibration would jump; the command rests there until it passes \
              zero",
        cause: "A tangential or servo-side vibration in the published form runs over a corner that is not tangent.",
        cure: "Generate the vibration along the path, or round the corner with a tangent arc.",
        example: on("lathe, vibration.generation_mode = GENERATION_MODE_TANGENTIAL, vibration.envelope = VIBRATION_ENVELOPE_PUBLISHED", "M3 S1000\nG0 X20 Z5\nG200 F25 A0.05\nG1 Z0 F0.1\nX30\nG201\nM30"),
    }

    "VIB-PUBLISHED-ENDS" [VIB_PUBLISHED_ENDS: Error, VIB_PUBLISHED_ENDS_PERMITTED: Warning] {
        meaning: "the published form of a vibration steps the velocity at its ends by more than an axis can \
              follow: an error where the profile lets limits bind",
        cause: "The whole sine starts and ends at once, and is clamped at the ends of the section.",
        cure: "Blend the vibration in and out. `vibration.published_limits_bind` says whether this is an error; the report says \
              that the axes cannot follow in both cases.",
        example: on("lathe, vibration.envelope = VIBRATION_ENVELOPE_PUBLISHED", "M3 S1000\nG0 X20 Z5\nG200 F100 A0.1\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-SPINDLE-STOPPED" [VIB_SPINDLE_STOPPED: Warning] {
        meaning: "the spindle does not turn in a vibrating section, so that chip breaking cannot be judged",
        cause: "No M3 or M4 came before the section.",
        cure: "Start the spindle before the section.",
        example: lathe("G94\nG0 X20 Z5\nG200 F25 A0.05\nG1 Z-20 F50\nG201\nM30"),
    }

    "VIB-CHIP-UNBROKEN" [VIB_CHIP_UNBROKEN: Warning] {
        meaning: "the vibration does not break the chip",
        cause: "The number of vibrations per revolution is whole, so that every revolution repeats the one before, or \
              the amplitude is too small for this number and the feed per revolution, or a short section lets no more of it \
              through between its blends.",
        cure: "Use the frequency, spindle speed or amplitude that the finding names: each was judged as it is written. Where none is \
              named, the message says why; a number of vibrations with one half, such as 1.5 or 2.5, needs the \
              smallest amplitude.",
        example: lathe("M3 S1000\nG0 X6 Z10\nG200 F50 A0.03\nG1 X10 Z20 F0.01\nG201\nM30"),
    }

    "VIB-CHIP-MARGINAL" [VIB_CHIP_MARGINAL: Warning] {
        meaning: "the chip breaks only while the spindle holds its speed within two per cent",
        cause: "The number of vibrations per revolution is close to one where the amplitude no longer suffices.",
        cure: "Use a frequency in the middle between two whole numbers of vibrations per revolution, or a larger \
              amplitude.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F18.333 A0.085\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-CHIP-OVERRIDE" [VIB_CHIP_OVERRIDE: Warning] {
        meaning: "the chip breaks at the feed of the plan, but not at the largest feed override that the machine permits",
        cause: "A higher feed per revolution needs a larger amplitude, and operators or monitoring may raise the feed \
              up to `max_feed_override`.",
        cure: "Use the amplitude that the finding names, let it follow the feed \
              (`vibration.amplitude_follows_feed_up_to`), or permit less override.",
        example: lathe("M3 S1000\nG0 X20 Z5\nG200 F25 A0.03\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-PARTLY-UNBROKEN" [VIB_PARTLY_UNBROKEN: Warning] {
        meaning: "the chip does not break on part of the path, at constant surface speed or at junctions that the vibration is \
              blended at",
        cause: "At constant surface speed the spindle speed changes with the diameter and leads the number of vibrations per \
              revolution through whole numbers. At a junction that the vibration cannot go over it is blended out and in, and \
              the chip stays whole for a revolution or more.",
        cure: "Turn the section at a constant spindle speed (`G97`), or raise the amplitude: the unbroken stretches \
              become narrower. At junctions, program tangent arcs or longer blocks.",
        example: lathe("G50 S3000\nG96 S150 M3\nG0 X60 Z0\nG200 F30 A0.06\nG1 X20 F0.1\nG201\nM30"),
    }

    "VIB-FOLLOWING-LOSS" [VIB_FOLLOWING_LOSS: Warning, VIB_FOLLOWING_LOSS_NOTED: Info] {
        meaning: "less of the vibration arrives at the tool than is commanded: a warning where that is too little to break the \
              chip",
        cause: "The filter behind interpolation or the position loop, as the profile's `following` states them, passes \
              less than nine tenths of the amplitude, or too little to break the chip. The share is the same of every \
              amplitude.",
        cure: "Use the amplitude, frequency or spindle speed that the finding names: what arrives then breaks the chip. Where it \
              does already, nothing has to be changed; the lower frequency that is named, a shorter filter or a stiffer loop lets more \
              through.",
        example: on("lathe, following.filter_length_s = 0.02", "M3 S1000\nG0 X20 Z5\nG200 F25 A0.05\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-FOLLOWING-EXCESS" [VIB_FOLLOWING_EXCESS: Warning, VIB_FOLLOWING_EXCESS_NOTED: Info] {
        meaning: "more of the vibration arrives at the tool than is commanded: a warning where that is more than the machine's \
              largest amplitude",
        cause: "The drives resonate near its frequency, as the profile's `following` states them: more than eleven tenths of \
              the amplitude arrive. The share is the same of every amplitude.",
        cure: "Command the amplitude that the finding names, or choose a frequency further below the resonance. Where the machine \
              permits what arrives, nothing has to be changed.",
        example: on("lathe, following.position_loop_gain_per_s = 200, following.velocity_loop_frequency_hz = 25", "M3 S1000\nG0 X20 Z5\nG200 F25 A0.05\nG1 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-FOLLOWING-CONTOUR" [VIB_FOLLOWING_CONTOUR: Warning] {
        meaning: "the lag of the drives leaves the contour",
        cause: "On a slope axes with different drives lag by different distances, and on a curve all of them cut inside it, by \
              more than `vibration.contour_tolerance_mm`.",
        cure: "Feed slower, give the axes the same position loop, or feed their velocity forward.",
        example: on("lathe, following.axes = [{\"axis\":\"AXIS_LETTER_X\",\"positionLoopGainPerS\":100}]", "M3 S1000\nG0 X20 Z5\nG200 F25 A0.05\nG1 X40 Z-20 F0.05\nG201\nM30"),
    }

    "VIB-ROTARY-ONLY" [VIB_ROTARY_ONLY: Error] {
        meaning: "only rotary axes move: there is no path to vibrate along",
        cause: "A block of a vibrating section turns the work or the tool while the tool centre point rests.",
        cure: "Switch the vibration off for this block.",
        example: five_axis("G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nG200 F50 A0.05\nG1 A-25 F1000\nG201\nM30"),
    }

    "VIB-FIVE-AXIS" [VIB_FIVE_AXIS: Error] {
        meaning: "under tool centre point control the tool vibrates along the path only",
        cause: "The job or the profile chooses a tangential or servo-side generation mode, which would leave the path \
              of the tool centre point.",
        cure: "Choose the generation mode along the path.",
        example: on("five-axis mill, vibration.generation_mode = GENERATION_MODE_TANGENTIAL", "G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nG200 F50 A0.05\nG1 X20 A-25 F1000\nG201\nM30"),
    }

    "VIB-THREAD" [VIB_THREAD: Error] {
        meaning: "a thread while the vibration along the path is on",
        cause: "The block that switches the vibration off is missing before the thread.",
        cure: "Switch it off before the thread; threads have a vibration of their own.",
        example: lathe("M3 S500\nG0 X20 Z10\nG200 F25 A0.05\nG32 Z-40 F1.5\nG201\nM30"),
    }

    "VIB-BLOCKS-TOO-SHORT" [VIB_BLOCKS_TOO_SHORT: Error] {
        meaning: "too many blocks within one amplitude of a vibration, or one blend of an oscillation",
        cause: "The blocks of the path are extremely short against the amplitude, and all that lie within it have to \
              be held at once.",
        cure: "Use a smaller amplitude, or longer blocks; `G64 P Q` merges short lines.",
        example: words("many thousand blocks of a nanometre each under a vibration of 1 mm"),
    }
}
