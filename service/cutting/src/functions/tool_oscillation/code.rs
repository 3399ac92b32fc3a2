//! Codes of the oscillation of a rotary tool.

feedwave_program::finding_codes! {
    /// Codes of the oscillation of a rotary tool.
    pub TOOL_OSCILLATION_CODES: "Oscillation of a rotary tool";

    "OSC-WORD" [OSC_WORD: Error] {
        meaning: "a word of the oscillation that is missing or no whole number",
        cause: "P, the number of the condition, is missing where the job names none, or P or L has decimals.",
        cure: "Write the number of a condition of the machine profile, such as P1, and of an edge, such as L1.",
        example: oscillation("T4 M6\nG202 P1.5\nG203\nM30"),
    }

    "OSC-OFF-WITHOUT-ON" [OSC_OFF_WITHOUT_ON: Error] {
        meaning: "the oscillation is switched off but was not on",
        cause: "The block that switches it on is missing, or it was switched off twice.",
        cure: "Remove the block, or switch the oscillation on before it.",
        example: oscillation("G203\nM30"),
    }

    "OSC-NESTED" [OSC_NESTED: Error] {
        meaning: "the oscillation is switched on while it is on",
        cause: "Another condition was meant to begin, and the one before was not switched off.",
        cure: "Switch the oscillation off before it is switched on with other values.",
        example: oscillation("T4 M6\nG202 P1\nG202 P2\nG203\nM30"),
    }

    "OSC-UNCLOSED" [OSC_UNCLOSED: Warning] {
        meaning: "the program ends while the oscillation is on",
        cause: "The block that switches it off is missing.",
        cure: "Switch the oscillation off before the end of the program.",
        example: oscillation("T4 M6\nG202 P1\nM30"),
    }

    "OSC-CONDITION-UNKNOWN" [OSC_CONDITION_UNKNOWN: Error] {
        meaning: "the machine has no such condition for this tool",
        cause: "The machine profile lists no oscillation condition of this number or name, or only for other tools.",
        cure: "Choose one of the conditions that the finding names, or add it to the machine profile.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P7 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-CONDITION-OVERRIDDEN" [OSC_CONDITION_OVERRIDDEN: Warning] {
        meaning: "job and program choose different conditions; the job's is run",
        cause: "The request for this part names a condition, and P of the program another one.",
        cure: "Leave P out of the program, or the condition out of the job.",
        example: on("oscillation mill, oscillation.condition = smooth", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-TOOL-UNKNOWN" [OSC_TOOL_UNKNOWN: Error] {
        meaning: "nothing is known of the cutting edges of the tool",
        cause: "The tool is not among the job's tools, or has no geometry in the tool library.",
        cure: "Give edges, radius, edge length and edge height in the tool library.",
        example: oscillation("T6 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-TOOL" [OSC_TOOL: Error] {
        meaning: "a tool whose geometry is impossible",
        cause: "The tool library has no edges for it, edges at one place, or a size that is not positive.",
        cure: "Correct the tool in the tool library.",
        example: words("a tool whose two edges are both at 0 degrees"),
    }

    "OSC-VALUE" [OSC_VALUE: Error] {
        meaning: "a quantity of the oscillation that is out of its range",
        cause: "An amplitude, a phase, a depth, a period or the engagement of condition or program is impossible by \
              itself.",
        cure: "Use a value within the range that the finding names.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 A50 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-LEADING-EDGE" [OSC_LEADING_EDGE: Error] {
        meaning: "an edge that is to lead and that the tool does not have",
        cause: "L of the program or the leading edge of the condition is 0 or above the number of edges.",
        cure: "Name one of the tool's edges, counted from 1.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1 L9\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-WAVEFORM" [OSC_WAVEFORM: Error] {
        meaning: "a waveform that is impossible",
        cause: "The hold share is out of range, or a table has too few points, phases out of order or a peak above 1.",
        cure: "Correct the waveform of the condition; values of a table are shares of the amplitude.",
        example: words("a condition with a held peak whose hold share is 0.9, which a machine profile cannot have"),
    }

    "OSC-PERIOD-FRACTION" [OSC_PERIOD_FRACTION: Error] {
        meaning: "a period that is no whole part of a revolution",
        cause: "The condition states its period in seconds, and the programmed spindle speed does not fit it: the \
              edges would meet other places in every revolution.",
        cure: "State the period in periods per revolution, or use the time that the finding names.",
        example: on("oscillation mill, tool_oscillation.0.periods_per_rev = null, tool_oscillation.0.period_s = 0.03", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-EDGES-PERIOD" [OSC_EDGES_PERIOD: Error] {
        meaning: "periods per revolution that do not divide the number of edges: no edge leads in every period",
        cause: "The condition was made for a tool with another number of edges.",
        cure: "Use the number of periods that the finding names, or a tool whose edges it divides.",
        example: on("oscillation mill, tool_oscillation.0.periods_per_rev = 3", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-HOLD-SHORT" [OSC_HOLD_SHORT: Warning] {
        meaning: "the largest protrusion is held too briefly: the edges close no circle and the floor is not smooth",
        cause: "The share of the period for which the tool protrudes is shorter than the time until the next edge comes.",
        cure: "Use the hold share, the number of periods or the table that the finding names.",
        example: on("oscillation mill, tool_oscillation.0.axial.waveform.held_peak.hold_share = 0.1", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-STEP-LONG" [OSC_STEP_LONG: Error] {
        meaning: "the feed goes further in one period than an edge cuts at its end",
        cause: "The feed is too high for the spindle speed and the radial length of the edge: a part of the floor \
              would be left.",
        cure: "Feed at most, or turn at least, what the finding names.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F1200\nG203\nM30"),
    }

    "OSC-OVERRIDE" [OSC_OVERRIDE: Warning] {
        meaning: "a feed override that is permitted, but at which a condition of the oscillation no longer holds",
        cause: "At the largest override of the machine profile the feed goes further in one period than an edge cuts at its \
              end, or the stages of the removal leave material above an edge that they do not at the programmed feed.",
        cure: "Feed at most what the finding names, or permit no higher override than it names.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F800\nG203\nM30"),
    }

    "OSC-PHASE" [OSC_PHASE: Error, OSC_PHASE_OFF: Warning] {
        meaning: "the largest protrusion does not come with the largest retreat along the feed: a warning from one \
              degree on, an error beyond a quarter of a period",
        cause: "The phases of the axial and of the feed oscillation do not fit; beyond a quarter the tool would finish \
              before it roughs.",
        cure: "Use the axial phase that the finding names.",
        example: on("oscillation mill, tool_oscillation.0.axial.phase_deg = 45", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-ROLES" [OSC_ROLES: Info] {
        meaning: "which edge leads and which edges finish",
        cause: "Said of every judged pass.",
        cure: "Nothing to do.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-ROLES-TURNED" [OSC_ROLES_TURNED: Info] {
        meaning: "which edge leads this part, where the lead moves on with parts or cutting time",
        cause: "The condition rotates the roles, so that all edges wear alike; the job says how many parts or how much \
              cutting time came before.",
        cure: "Nothing to do; check the count that the job brings.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P3 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-FINISHING-EDGE" [OSC_FINISHING_EDGE: Warning] {
        meaning: "another edge finishes than the one that is meant for it",
        cause: "The leading edge decides which edge finishes, and the tool marks other edges as finishing ones.",
        cure: "Let the edge lead that the finding names.",
        example: oscillation("T5 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1 L2\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-AXIS-VELOCITY" [OSC_AXIS_VELOCITY: Error] {
        meaning: "the oscillation takes more velocity than the axes have",
        cause: "Its peak, with the feed in the plane, exceeds the velocity limit of the weakest axis.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: oscillation("T4 M6\nM3 S24000\nG0 X0 Y0 Z-1\nG202 P2 A1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-AXIS-ACCELERATION" [OSC_AXIS_ACCELERATION: Error] {
        meaning: "the oscillation takes more acceleration than the axes have",
        cause: "Its peak exceeds the acceleration limit of the weakest axis; it grows with the square of the spindle \
              speed.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: oscillation("T4 M6\nM3 S6000\nG0 X0 Y0 Z-1\nG202 P2 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-AXIS-JERK" [OSC_AXIS_JERK: Error] {
        meaning: "the oscillation takes more jerk than the axes have",
        cause: "Its peak exceeds the jerk limit of the weakest axis; it grows with the cube of the spindle speed.",
        cure: "Use the amplitude or the spindle speed that the finding names.",
        example: oscillation("T4 M6\nM3 S6000\nG0 X0 Y0 Z-1\nG202 P2 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-AXIS-LIMIT" [OSC_AXIS_LIMIT: Error] {
        meaning: "the oscillation and its blend leave nothing of an axis' limit for the feed",
        cause: "The peaks fit by themselves, but what blending in and out adds, or the turning of the path, takes the \
              rest.",
        cure: "Use the amplitudes that the finding names, a lower spindle speed, or blend over more periods.",
        example: oscillation("T4 M6\nM3 S6000\nG0 X0 Y0 Z-1\nG202 P2 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-JERK-STEP" [OSC_JERK_STEP: Warning] {
        meaning: "the waveform steps the acceleration: its jerk is unbounded there",
        cause: "A held peak with plain ramps, or a table with kinks of the velocity.",
        cure: "Use a sine or the jerk-limited held peak with the same holds.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-DEPTH" [OSC_DEPTH: Error, OSC_DEPTH_COVERED: Info] {
        meaning: "depth and axial travel together are more than the edges are high: an error where material meets the \
              tool above an edge",
        cause: "The cut is deep, or the axial amplitude large, against the height of the edges.",
        cure: "Cut less deep or use a smaller axial amplitude, as the finding says.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-6\nG202 P1 D6\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-FLOOR" [OSC_FLOOR: Info] {
        meaning: "the roughness of the floor is not simulated",
        cause: "The area or its resolution cannot be simulated, the path climbs or descends so that the end of the tool is tilted to the \
              floor, or so many different cuts were simulated already that the rest is left out.",
        cure: "Check `oscillation_floor` of the machine profile, or validate a part of the program.",
        example: words("a program with very many different oscillating cuts"),
    }

    "OSC-SECTION-SHORT" [OSC_SECTION_SHORT: Warning] {
        meaning: "a part of the path without corners is shorter than the blend in and out of the oscillation",
        cause: "At a corner the offsets have to be 0; between two of them the path is too short for the whole amplitude.",
        cure: "Round corners with `G64`, or blend over fewer periods.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X1 F600\nG203\nM30"),
    }

    "OSC-TURNING" [OSC_TURNING: Error] {
        meaning: "the feed direction turns too fast for the oscillation to follow it",
        cause: "The path bends so sharply at this feed that the direction changes too much within a revolution.",
        cure: "Feed at most what the finding names on this curve.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG2 X1 R0.5 F900\nG203\nM30"),
    }

    "OSC-PLUNGE" [OSC_PLUNGE: Error] {
        meaning: "the path goes along the tool axis: there is no feed direction to oscillate in",
        cause: "The tool plunges or retracts with G1 while the oscillation is on.",
        cure: "Switch the oscillation off for this block.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z1\nG202 P1 D1\nG1 Z-1 F600\nG203\nM30"),
    }

    "OSC-FOLLOWING" [OSC_FOLLOWING: Warning, OSC_FOLLOWING_NOTED: Info] {
        meaning: "the drives change the oscillation between setpoints and tool: a warning where its directions come apart",
        cause: "Of an amplitude less than nine or more than eleven tenths arrive, or the axes lag so differently that the tool does \
              not protrude where it is retracted most in the feed direction. The profile's `following` states the drives.",
        cure: "Use the axial phase that the finding names. Of the amplitude the same share arrives whatever is commanded: nothing has \
              to be changed where that is wanted; a slower spindle or a drive with less lag lets more arrive.",
        example: on("oscillation mill, following.position_loop_gain_per_s = 60", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }

    "OSC-ROTARY" [OSC_ROTARY: Error] {
        meaning: "a rotary axis moves while the tool oscillates",
        cause: "A block of the section turns the work without tool centre point control, or while the tool centre \
              point rests.",
        cure: "Switch the oscillation off before.",
        example: on("five-axis mill with the conditions and tools of the oscillation mill", "T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 C10 F600\nG203\nM30"),
    }

    "OSC-FIVE-AXIS" [OSC_FIVE_AXIS: Error] {
        meaning: "the tool oscillates where the axes that move it are not along its own directions",
        cause: "Without tool centre point control the oscillation is along X, Y and Z, and the tool is tilted, lies or has axes \
              that are not square; with it, the linear axes together cannot move the tool in every direction.",
        cure: "Switch tool centre point control on, or tilt the plane with `G68.2` and `G53.1`.",
        example: words("`G202` behind `G0 B30` on a mill with a swivelling head"),
    }

    "OSC-WITH-VIBRATION" [OSC_WITH_VIBRATION: Error] {
        meaning: "the tool oscillates while the vibration along the path is on",
        cause: "Both functions were switched on.",
        cure: "Switch one of them off.",
        example: oscillation("T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG200 F20 A0.05\nG202 P1 D1\nG1 X30 F600\nG203\nG201\nM30"),
    }

    "OSC-SURFACE-SPEED" [OSC_SURFACE_SPEED: Error] {
        meaning: "the tool oscillates under constant surface speed",
        cause: "`G96` is in force: the oscillation is in step with a constant spindle speed only.",
        cure: "Program a spindle speed with `G97`.",
        example: oscillation("T4 M6\nG92 S2000\nG96 S100 M3\nG0 X50 Y0 Z-1\nG202 P1 D1\nG1 X80 F600\nG203\nM30"),
    }

    "OSC-SPINDLE-STOPPED" [OSC_SPINDLE_STOPPED: Error] {
        meaning: "the tool oscillates with a spindle that does not turn",
        cause: "No M3 or M4 with an S comes before the cut; the oscillation is driven by the spindle angle.",
        cure: "Start the spindle before.",
        example: oscillation("T4 M6\nG0 X0 Y0 Z-1\nG202 P1 D1\nG1 X30 F600\nG203\nM30"),
    }
}
