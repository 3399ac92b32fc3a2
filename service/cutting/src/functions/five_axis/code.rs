//! Codes of five-axis motion: tool centre point control and tilted planes on the machine.

feedwave_program::finding_codes! {
    /// Codes of five-axis motion.
    pub FIVE_AXIS_CODES: "Five-axis motion";

    "FIVE-AXIS-KINEMATICS" [FIVE_AXIS_KINEMATICS: Error] {
        meaning: "tool centre point control or a tilted plane on a machine whose profile has no kinematics",
        cause: "The profile does not say how the five axes lie to each other.",
        cure: "Describe the five axes in `kinematics` of the machine profile.",
        example: mill("G43.4 H1 G0 Z100\nM30"),
    }

    "FIVE-AXIS-RANGE" [FIVE_AXIS_RANGE: Error] {
        meaning: "a rotary axis that would leave its range",
        cause: "The programmed angle is outside the range, or the tool direction can only be reached outside it from \
              where the cut begins.",
        cure: "Use the angles that the finding names, divide the cut and approach it anew, or clamp the work in \
              another position.",
        example: five_axis("G43.4 H1 G0 Z100 A40\nM30"),
    }

    "FIVE-AXIS-UNREACHABLE" [FIVE_AXIS_UNREACHABLE: Error] {
        meaning: "a tool direction that the rotary axes cannot reach, whatever their ranges",
        cause: "The axes do not lie at right angles to each other or to the tool, and leave a cone of directions out.",
        cure: "Clamp the work in another position.",
        example: words("a direction along -Z on a nutating head with an axis at 45 degrees"),
    }

    "FIVE-AXIS-POSE" [FIVE_AXIS_POSE: Error] {
        meaning: "a place of the tool that the machine's kinematics cannot be solved for",
        cause: "The kinematics of the profile are degenerate there, or a number of the block or of the work offset is \
              out of range.",
        cure: "Check the kinematics in the machine profile, the block and the work offset.",
        example: words("work offsets near the largest number of the format"),
    }

    "FIVE-AXIS-OPPOSITE" [FIVE_AXIS_OPPOSITE: Error] {
        meaning: "a move from one tool direction to the opposite one: over which side the tool turns is not said",
        cause: "Two vectors that follow each other point exactly against each other, or an angle is half a turn away on an axis that \
              rolls over.",
        cure: "Write a direction in between.",
        example: five_axis("G43.5 H1 G0 X0 Y0 Z100 I0 J1 K0\nI0 J-1 K0\nM30"),
    }

    "FIVE-AXIS-START" [FIVE_AXIS_START: Error] {
        meaning: "a cut that does not start where the tool is",
        cause: "The axes were moved without tool centre point control, so the tool is elsewhere than the coordinates \
              of the program say.",
        cure: "Move to the start of the cut with G0 first.",
        example: words("a cut that begins while the tool is not at its start"),
    }

    "FIVE-AXIS-TOO-SHARP" [FIVE_AXIS_TOO_SHARP: Error] {
        meaning: "the axes would have to bend too sharply to follow the tool direction",
        cause: "The direction runs along the edge of what the rotary axes can reach.",
        cure: "Keep off the edge of what the rotary axes can reach.",
        example: words("directions along the edge of the cone that a nutating head reaches"),
    }

    "FIVE-AXIS-SINGULAR" [FIVE_AXIS_SINGULAR: Warning] {
        meaning: "the tool is nearly parallel to the first rotary axis, which turns far in a short block",
        cause: "The tool direction passes the pole, where a small change of direction is a large turn; velocity and \
              acceleration of the axis limit the feed.",
        cure: "Tilt the work, so that the tool keeps away from the axis, or allow `pole_tolerance_deg` in the machine \
              profile.",
        example: five_axis("G43.5 H1 G0 X0 Y0 Z20 I0 J-.2 K1\nG1 X5 I0 J0 K1 F1000\nX10 I.2 J0 K1\nM30"),
    }

    "FIVE-AXIS-SOLUTION" [FIVE_AXIS_SOLUTION: Info] {
        meaning: "the rotary axes go to another solution before a cut, because the nearer one would leave a range later",
        cause: "Of two positions of the rotary axes for one tool direction only the other one gets through the cut \
              that begins.",
        cure: "Retract before this block so far that the work may turn.",
        example: words("an approach after which the cut would turn an axis out of its range in the nearer solution"),
    }

    "FIVE-AXIS-NOT-NORMAL" [FIVE_AXIS_NOT_NORMAL: Warning] {
        meaning: "a cut in a tilted plane with a tool axis that is not its normal",
        cause: "`G53.1` is missing after `G68.2`, or the rotary axes were positioned otherwise before.",
        cure: "Turn the tool axis onto the plane with `G53.1`, in the block after `G68.2`.",
        example: five_axis("G43 H1 G0 X0 Y0 Z60\nG68.2 X0 Y0 Z0 I0 J-20 K0\nG0 X0 Y0 Z30\nG1 X10 F500\nG69\nM30"),
    }
}
