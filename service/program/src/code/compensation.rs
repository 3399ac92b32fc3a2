//! Codes of the compensation of tool radius and nose.

crate::finding_codes! {
    /// Codes of the compensation of tool radius and nose.
    pub COMPENSATION_CODES: "Compensation of tool radius and nose";

    "PRG-COMP-NUMBER" [COMP_NUMBER: Error] {
        meaning: "radius compensation without the number of a tool offset, or with one that has no radius",
        cause: "`G41` or `G42` has no D and none was in force (on a lathe no T with an offset), or no tool of the job has this \
              number and a radius.",
        cure: "Write the number of the tool offset, and give the tool its radius.",
        explained_by: modal("DT"),
        example: mill("G0 X0 Y0\nG41 G1 X20 Y0 F100\nY20\nG40 G0 X0 Y40\nM30"),
    }

    "PRG-COMP-RADIUS-ZERO" [COMP_RADIUS_ZERO: Info] {
        meaning: "radius compensation with a radius of zero, which compensates nothing",
        cause: "D0, the offset number 0 of a lathe's T word, or a tool offset with radius 0.",
        cure: "Write the number of the tool offset, unless the program has the path of the tool's centre.",
        example: mill("G0 X0 Y0\nG41 D0 G1 X20 Y0 F100\nY20\nG40 G0 X0 Y40\nM30"),
    }

    "PRG-COMP-NESTED" [COMP_NESTED: Error] {
        meaning: "radius compensation is switched on, or to the other side, while it is on",
        cause: "A `G40` is missing between two contours, or the side or the radius changes on the contour.",
        cure: "Leave the contour with G40 and a straight move first.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X20 Y0 F100\nY20\nG42.1 D6 X40\nG40 G0 X0 Y40\nM2"),
    }

    "PRG-COMP-PLANE" [COMP_PLANE: Error] {
        meaning: "radius compensation in a plane that it is not made for",
        cause: "The nose of a turning tool is compensated in `G18` only; LinuxCNC compensates in `G17` and `G18` only; in a tilted \
              plane the tool axis has to be on the normal.",
        cure: "Select the plane before; turn the tool axis onto a tilted plane with G53.1 before.",
        example: linuxcnc("G19 G0 Y0 Z0\nG41.1 D6 G1 Y20 F100\nZ20\nG40 G0 Y40\nM2"),
    }

    "PRG-COMP-TIP" [COMP_TIP: Error] {
        meaning: "an orientation of a turning tool that is not 0 to 9",
        cause: "L of `G41.1` or `G42.1` says where the nose is, from 0 to 9.",
        cure: "Write the orientation of the tool, such as L2 for turning toward the chuck outside.",
        example: linuxcnc("G18 G8 G0 X30 Z10\nG42.1 D0.8 L12 G1 X10 Z5 F100\nZ-10\nG40 G0 X40\nM2"),
    }

    "PRG-COMP-BLOCK" [COMP_BLOCK: Error] {
        meaning: "something that radius compensation does not permit",
        cause: "Another plane or work offset, `G28`, `G53`, a cycle, a spline, a thread, a tool change, another `D` or the \
              like on a compensated contour; tool centre point control; in a tilted plane `G69`, `G53.1` or another tool length, also \
              while the tool still stands beside the contour behind `G40`.",
        cure: "Leave the contour with G40 and a straight move first; under tool centre point control, write the path of the tool's \
              centre.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X20 Y0 F100\nY20\nG28 Z0\nG40 G0 X0 Y40\nM2"),
    }

    "PRG-COMP-RETURN" [COMP_RETURN: Info] {
        meaning: "a subprogram that returns with radius compensation on, on a FANUC or Haas control",
        cause: "`M99` comes before `G40`: the contour goes on with the blocks behind the call. FANUC and Haas controls do so; some others \
              stop there.",
        cure: "Nothing has to be done where the control goes on; otherwise leave the contour with G40 and a straight move before M99.",
        example: mill("G0 X0 Y0\nG41 D0 G1 X20 Y0 F100\nM98 P1\nG40 G0 X0 Y40\nM30\nO1\nY20\nM99"),
    }

    "PRG-COMP-UNFINISHED" [COMP_UNFINISHED: Error] {
        meaning: "the end of the program with radius compensation on",
        cause: "A `G40` is missing behind the last contour.",
        cure: "Leave the contour with G40 and a straight move.",
        example: words("G41 D1 without a G40 before M30 on a mill"),
    }

    "PRG-COMP-ENTRY" [COMP_ENTRY: Error] {
        meaning: "a first move with radius compensation that is too short (LinuxCNC) or an arc (FANUC)",
        cause: "The tool has to get beside the contour within this move: LinuxCNC asks for more than the radius, FANUC for a \
              straight move.",
        cure: "Start further away from the contour, or put a straight move before the arc.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X2 Y0 F100\nY20\nG40 G0 X0 Y40\nM2"),
    }

    "PRG-COMP-EXIT" [COMP_EXIT: Error] {
        meaning: "an arc as the move away from a compensated contour",
        cause: "The move behind `G40` goes from beside the contour to the programmed point, which no arc can.",
        cure: "Leave the contour with G0 or G1, and go on with the arc behind it.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X20 Y0 F100\nY20\nG40 G2 X30 Y30 R10\nM2"),
    }

    "PRG-COMP-EXIT-ASIDE" [COMP_EXIT_ASIDE: Warning] {
        meaning: "a move behind G40 that names no place in the plane of the contour",
        cause: "LinuxCNC moves to the programmed point in the plane together with this move; FANUC controls stay beside it \
              until the next move that names an axis of the plane.",
        cure: "Move in the plane with the `G40`, away from the part.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X20 Y0 F100\nY20\nG40\nG0 Z20\nM2"),
    }

    "PRG-COMP-IDLE" [COMP_IDLE: Error] {
        meaning: "too many blocks without motion in the plane on a compensated contour",
        cause: "The tool can only go to a corner that is known, and a FANUC control looks over two blocks; LinuxCNC over any, \
              here over 1000.",
        cure: "Leave the contour with G40 first, or move these blocks to another place.",
        example: words("G41 D1, and on the contour three blocks with M codes, dwells or Z moves between two moves"),
    }

    "PRG-COMP-ARC" [COMP_ARC: Error] {
        meaning: "an arc that the tool is too large for",
        cause: "The tool is inside the arc, and its radius is not smaller than that of the arc.",
        cure: "Use a tool with a smaller radius.",
        example: linuxcnc("G0 X0 Y0\nG41.1 D6 G1 X20 Y0 F100\nY20\nG3 X16 Y20 R2\nG40 G0 X0 Y40\nM2"),
    }

    "PRG-COMP-CORNER" [COMP_CORNER: Error] {
        meaning: "an inside corner that the tool does not fit into",
        cause: "The path of the tool along one block does not meet the one along the next: the corner is narrower than the \
              tool.",
        cure: "Use a smaller tool, or round the corner.",
        example: words("An arc and a line whose paths beside the tool pass each other"),
    }

    "PRG-COMP-BACKWARDS" [COMP_BACKWARDS: Error] {
        meaning: "a block that the compensated tool would pass backwards",
        cause: "A step or a slot is narrower than the tool: beside it the tool would cut into the neighbours.",
        cure: "Use a smaller tool, or take the block out of the contour that this tool cuts.",
        example: linuxcnc("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10 F100\nY20\nX2\nY0\nG40 X50 Y-10\nM2"),
    }

    "PRG-COMP-GOUGE" [COMP_GOUGE: Warning, COMP_GOUGE_LINK: Info] {
        meaning: "the compensated tool cuts into another block of the contour: a warning on the contour, an information on \
              its entry and exit, and over arcs there that are tangent to it",
        cause: "The contour comes back to itself nearer than the tool is wide, within the last 64 blocks; or the tool starts or \
              ends too near to it.",
        cure: "Use a smaller tool, or start and end beside the contour, at right angles to it.",
        example: linuxcnc("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10 F100\nY20\nX10 Y30\nX14\nX4 Y20\nY-10\nG40 X50 Y-10\nM2"),
    }

    "PRG-COMP-STRAIGHT" [COMP_STRAIGHT: Info] {
        meaning: "corners of a compensated contour that LinuxCNC takes as none, with the depth of the cut into the contour",
        cause: "LinuxCNC goes straight on at corners of less than 0.05 rad (2.9 degrees).",
        cure: "Write more decimals, so that curves meet without a corner.",
        example: linuxcnc("G0 X-20 Y-20\nG42.1 D6 G1 X0 Y-10 F100\nY20\nX-0.5 Y40\nG40 X50\nM2"),
    }
}
