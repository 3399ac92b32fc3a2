//! Codes of what every program is checked for: tools, axes, spindle, feed, path and length.

feedwave_program::finding_codes! {
    /// Codes of what every program is checked for.
    pub MACHINE_CODES: "Machine and path";

    "TOOL-UNKNOWN" [TOOL_UNKNOWN: Error] {
        meaning: "a tool that is not among the job's tools",
        cause: "The T word names a number that the job's tool list does not have. Without a list nothing is checked.",
        cure: "Add the tool to the job, or correct the number.",
        example: on("lathe, tools = [1]", "T0202\nM30"),
    }

    "SPINDLE-SPEED" [SPINDLE_SPEED: Error] {
        meaning: "a spindle speed beyond the limit of the machine or of the tool",
        cause: "A constant speed is above `max_spindle_rev_per_min` of the machine or of the tool. Constant surface \
              speed is clamped by the machine and by the program (`G50 S`, `G92 S`, in LinuxCNC `D`): it is found where it \
              exceeds the limit of the tool even so.",
        cure: "Lower the speed, or clamp it, to the limit that the finding names.",
        example: lathe("M3 S9000\nG1 X10 F0.1\nM30"),
    }

    "OVERRIDE-FORBIDDEN" [OVERRIDE_FORBIDDEN: Warning, OVERRIDE_FORBIDDEN_LIVE: Info] {
        meaning: "a cut where the program forbids feed overrides: a warning where overrides other than 0 and 100 % are planned",
        cause: "`M49`, or `M50 P0` of LinuxCNC, forbids the operator to change the feed. Planned and live feed overrides \
              act all the same; the machine that plays the setpoints knows nothing of the code.",
        cure: "Plan overrides that are back at 100 % there, or take the code out where the feed may be changed.",
        example: on("mill, language.dialect = DIALECT_LINUXCNC", "M49\nG1 X10 F600\nM2"),
    }

    "FEED-LIMITED" [FEED_LIMITED: Info] {
        meaning: "a programmed feed that the axes cannot follow and that is run slower",
        cause: "The feed is above what the velocity limits of the axes leave in the direction of the cut, with the \
              vibration where one is on. The first place is named.",
        cure: "Program the feed that the finding names, or leave it: the path is the same.",
        example: lathe("G94\nG1 Z-100 F90000\nM30"),
    }

    "AXIS-MISSING" [AXIS_MISSING: Error] {
        meaning: "motion of an axis that the machine does not have, or that is not among its five axes",
        cause: "The program is for another machine, the axis is missing in the machine profile, or it moves under tool \
              centre point control without being part of the kinematics.",
        cure: "Remove the word, or add the axis to the machine profile.",
        example: lathe("G0 Y10\nM30"),
    }

    "AXIS-TRAVEL" [AXIS_TRAVEL: Error] {
        meaning: "an axis that would leave its travel",
        cause: "The work offset, a coordinate or the swing of a rotary axis leads beyond `travel_min` or `travel_max`, \
              or beyond the axis' range in the kinematics, in machine coordinates. The curve at a smoothed corner and the \
              amplitudes of a tool oscillation count too.",
        cure: "Check the work offset and the programmed coordinate, or clamp the work in another place.",
        example: on("lathe, machine.axes.0.travel_max = 100", "G0 X300\nM30"),
    }

    "AXIS-LIMIT" [AXIS_LIMIT: Error] {
        meaning: "a block that takes more of an axis' velocity, acceleration or jerk than it has, however slowly it is \
              run",
        cause: "A vibration is superposed on a curve, and turning takes the rest of a limit. Vibrating sections that \
              are reported say it with VIB-AXIS codes.",
        cure: "Use a smaller amplitude or a lower frequency.",
        example: words("a program that is streamed without validation, with a vibration beyond the limits of the axes"),
    }

    "PLAN-TOO-LONG" [PLAN_TOO_LONG: Error] {
        meaning: "a block that would take longer than a day",
        cause: "A decimal point is missing or misplaced in the feed or in the time of a dwell.",
        cure: "Check the decimal point.",
        example: lathe("G94\nG1 Z-100 F0.001\nM30"),
    }

    "PLAN-TOO-MANY-SETPOINTS" [PLAN_TOO_MANY_SETPOINTS: Error] {
        meaning: "a program of more setpoints than the service gives: 4294967296, which are 49 days at 1 ms",
        cause: "The program runs for weeks, or the interpolation period is very short.",
        cure: "Use a longer interpolation period, or split the program.",
        example: words("50 blocks `G4 X86000` at an interpolation period of 1 ms"),
    }

    "PATH-SPLINE-CUSP" [PATH_SPLINE_CUSP: Error] {
        meaning: "a spline with a place that has no direction",
        cause: "A cusp, a handle of length 0 or control points that turn back: the tool would have to stop and turn \
              within the curve.",
        cure: "Move the control points apart, or divide the spline at the cusp.",
        example: mill("G5 X10 Y0 I20 J0 P10 Q0 F100\nM30"),
    }
}
