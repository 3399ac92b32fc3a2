//! Codes of the thinning of five-axis blocks.

feedwave_program::finding_codes! {
    /// Codes of the thinning of five-axis blocks.
    pub THINNING_CODES: "Thinning of five-axis blocks";

    "THIN-ROTARY" [THIN_ROTARY: Warning] {
        meaning: "dropped blocks turn a rotary axis by more than the angle tolerance from what is interpolated",
        cause: "Thinning compares tool directions; near the pole an axis turns far while the direction hardly changes.",
        cure: "Switch thinning off where the axis has to turn.",
        example: five_axis("G43.4 H1 G0 X0 Y0 Z20 A0 C0\nM33\nG1 X1 F1000\nX2 C90\nX3 C0\nM34\nM30"),
    }

    "THIN-DIRECTION" [THIN_DIRECTION: Info] {
        meaning: "the interpolated tool direction is further from that of a dropped block than the angle tolerance",
        cause: "The tolerance compares a block with the last kept one only; between kept blocks the direction is \
              interpolated.",
        cure: "Set a tolerance on the interpolated direction in `thinning` of the machine profile.",
        example: on("five-axis mill, thinning.angle_tolerance_deg = 3", "G43.4 H1 G0 X0 Y0 Z20 A0 C0\nM33\nG1 X1 F1000\nX2 A-1\nX3 A-2\nX4 A-60\nM34\nM30"),
    }

    "THIN-FEED" [THIN_FEED: Info] {
        meaning: "feeds of dropped blocks that are never run",
        cause: "A dropped block has an F, and another F follows before the next block that is kept.",
        cure: "Nothing to do where the feeds are alike; else switch thinning off there.",
        example: five_axis("G43.4 H1 G0 X0 Y0 Z20 A-20 C0\nM33\nG1 X1 F1000\nX2 F900\nX3 F800\nX4 F700\nX5 F600\nM34\nM30"),
    }
}
