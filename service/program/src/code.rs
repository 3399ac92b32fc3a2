//! The stable codes of this crate's findings, each with one line on what it says.

/// Declares every code once: a constant to emit it and a line in [`FINDING_CODES`].
macro_rules! finding_codes {
    ($($name:ident = $code:literal: $meaning:literal;)+) => {
        $(#[doc = $meaning] pub(crate) const $name: &str = $code;)+

        /// Every finding code of the program language and what it means.
        pub const FINDING_CODES: &[(&str, &str)] = &[$(($code, $meaning)),+];
    };
}

finding_codes! {
    NOT_A_PROGRAM = "PRG-NOT-A-PROGRAM": "the file is no program of this language; nothing else of it is reported";
    LINE_TOO_LONG = "PRG-LINE-TOO-LONG": "a line is longer than the profile allows and was skipped";
    NUL = "PRG-NUL": "a run of NUL bytes";
    NOT_UTF8 = "PRG-NOT-UTF8": "a run of bytes that are not UTF-8 text";
    CHARACTER = "PRG-CHARACTER": "a character that has no meaning in a program, or not at this place";
    LOOKALIKE = "PRG-LOOKALIKE": "characters that only look like those of a program, such as a minus sign of typesetting";
    COMMENT_UNCLOSED = "PRG-COMMENT-UNCLOSED": "a comment is opened with ( and not closed on its line";
    TEXT = "PRG-TEXT": "letters without numbers outside a comment";
    EXPRESSION = "PRG-EXPRESSION": "variables, expressions and control flow are known, but not supported yet";
    NUMBER_MISSING = "PRG-NUMBER-MISSING": "an address letter without a number";
    NUMBER_STRAY = "PRG-NUMBER-STRAY": "a number without an address letter";
    NUMBER_INVALID = "PRG-NUMBER-INVALID": "a number that cannot be read";
    NUMBER_RANGE = "PRG-NUMBER-RANGE": "a number that is too large to mean anything";
    NUMBER_NOT_WHOLE = "PRG-NUMBER-NOT-WHOLE": "a number that has to be whole and not negative";
    NUMBER_SPACED = "PRG-NUMBER-SPACED": "a number written with spaces inside, read as one number";
    WORD_DUPLICATE = "PRG-WORD-DUPLICATE": "an address letter occurs twice in a block";
    WORD_UNKNOWN = "PRG-WORD-UNKNOWN": "an address letter the dialect does not know";
    WORD_UNUSED = "PRG-WORD-UNUSED": "a word no code of its block uses";
    WORD_CONFLICT = "PRG-WORD-CONFLICT": "two words of a block contradict each other";
    FUNCTION_WORD = "PRG-FUNCTION-WORD": "a word that the machining function of its block does not take";
    FUNCTION_WORD_MISSING = "PRG-FUNCTION-WORD-MISSING": "a machining function without a word it needs";
    FUNCTION_SWITCH = "PRG-FUNCTION-SWITCH": "a machining function whose P says neither on nor off";
    UNKNOWN_CODE = "PRG-UNKNOWN-CODE": "a G or M code the dialect does not know";
    UNSUPPORTED_CODE = "PRG-UNSUPPORTED-CODE": "a known code that is not supported yet";
    GROUP_CONFLICT = "PRG-GROUP-CONFLICT": "two codes of one modal group in a block";
    CODE_AMBIGUOUS = "PRG-CODE-AMBIGUOUS": "a code that controls read differently with these words, so that nothing moves on a guess";
    UNIT_WITH_FEED = "PRG-UNIT-WITH-FEED": "a feed in the block that changes the unit, which controls read in different units";
    MOTION_MISSING = "PRG-MOTION-MISSING": "axis words, but no motion code in force";
    FEED_MISSING = "PRG-FEED-MISSING": "a cutting move without a valid feed; the F of a thread is none";
    FEED_NOT_POSITIVE = "PRG-FEED-NOT-POSITIVE": "a feed that is zero, negative or too small to mean anything";
    SPINDLE_STOPPED = "PRG-SPINDLE-STOPPED": "feed per revolution or a thread with a spindle that does not turn";
    SPEED_INVALID = "PRG-SPEED-INVALID": "a spindle speed that is negative or too small to mean anything, or a speed clamp that is not positive";
    SPEED_MISSING = "PRG-SPEED-MISSING": "a speed mode or clamp without its S word";
    SPEED_CLAMP_MISSING = "PRG-SPEED-CLAMP-MISSING": "constant surface speed without a speed clamp";
    DWELL_TIME = "PRG-DWELL-TIME": "a dwell without a valid time";
    ARC_CENTRE_MISSING = "PRG-ARC-CENTRE-MISSING": "an arc with neither a centre nor a radius";
    ARC_CENTRE_AMBIGUOUS = "PRG-ARC-CENTRE-AMBIGUOUS": "an arc with both a centre and a radius";
    ARC_RADIUS_MISMATCH = "PRG-ARC-RADIUS-MISMATCH": "start and end of an arc are not equally far from its centre";
    ARC_RADIUS_ZERO = "PRG-ARC-RADIUS-ZERO": "an arc that starts or ends at its own centre";
    ARC_RADIUS_TOO_SMALL = "PRG-ARC-RADIUS-TOO-SMALL": "a radius that cannot reach from start to end";
    ARC_FULL_BY_RADIUS = "PRG-ARC-FULL-BY-RADIUS": "an arc by radius whose end is its start has no definite centre";
    PATH_TOLERANCE = "PRG-PATH-TOLERANCE": "a tolerance of G64 that is negative or too large, or a Q without a P or beyond it";
    SPLINE_POINT_MISSING = "PRG-SPLINE-POINT-MISSING": "a spline without the words of one of its control points";
    SPLINE_AXIS = "PRG-SPLINE-AXIS": "a spline block with a word of an axis outside its plane";
    NURBS_POINT = "PRG-NURBS-POINT": "a control point of a NURBS without both of its coordinates";
    NURBS_WEIGHT = "PRG-NURBS-WEIGHT": "a weight of a control point that is not positive or out of range";
    NURBS_ORDER = "PRG-NURBS-ORDER": "an order of a NURBS that is out of range or larger than the number of its control points";
    NURBS_TOO_LONG = "PRG-NURBS-TOO-LONG": "a NURBS with more control points than are supported";
    NURBS_UNFINISHED = "PRG-NURBS-UNFINISHED": "something other than control points between G5.2 and G5.3";
    NURBS_NOT_OPEN = "PRG-NURBS-NOT-OPEN": "G5.3 without G5.2";
    THREAD_LEAD = "PRG-THREAD-LEAD": "a lead of a thread, or a number of threads per inch, that is out of range";
    THREAD_LEAD_MISSING = "PRG-THREAD-LEAD-MISSING": "a thread without a lead";
    THREAD_TRAVEL = "PRG-THREAD-TRAVEL": "a thread that goes nowhere";
    THREAD_AXIS = "PRG-THREAD-AXIS": "a thread with a word of an axis other than X and Z";
    THREAD_ANGLE = "PRG-THREAD-ANGLE": "a start angle or a phase shift of a thread outside 0 to 360 degrees";
    THREAD_AMPLITUDE = "PRG-THREAD-AMPLITUDE": "a negative vibration amplitude of a thread";
    THREAD_SURFACE_SPEED = "PRG-THREAD-SURFACE-SPEED": "a thread under constant surface speed";
    THREAD_CYCLE_FORM = "PRG-THREAD-CYCLE-FORM": "a threading cycle whose words belong to none or several of its forms";
    THREAD_CYCLE_WORD = "PRG-THREAD-CYCLE-WORD": "a threading cycle without a word it needs";
    THREAD_CYCLE_VALUE = "PRG-THREAD-CYCLE-VALUE": "a word of a threading cycle that is out of range";
    THREAD_CYCLE_START = "PRG-THREAD-CYCLE-START": "a threading cycle that starts within the thread";
    THREAD_CYCLE_PASSES = "PRG-THREAD-CYCLE-PASSES": "a threading cycle of too many passes";
    MACHINE_MOTION = "PRG-MACHINE-MOTION": "G53 without straight motion or with incremental words";
    REFERENCE_AXIS = "PRG-REFERENCE-AXIS": "G28 without an axis";
    LENGTH_NUMBER = "PRG-LENGTH-NUMBER": "tool length compensation without the number of a tool length";
    LENGTH_OTHER_TOOL = "PRG-LENGTH-OTHER-TOOL": "the length of another tool than the one in the spindle";
    LENGTH_WHILE_CUTTING = "PRG-LENGTH-WHILE-CUTTING": "a cutting block that changes the tool length";
    TOOL_LENGTH = "PRG-TOOL-LENGTH": "the number of a tool length that is not known";
    TOOL_CONTROL_LENGTH = "PRG-TOOL-CONTROL-LENGTH": "tool centre point control without the number of a tool length";
    TOOL_CONTROL_NESTED = "PRG-TOOL-CONTROL-NESTED": "tool centre point control is switched on while it is on";
    TOOL_CONTROL_OFF = "PRG-TOOL-CONTROL-OFF": "thinning without tool centre point control";
    TOOL_CONTROL_BLOCK = "PRG-TOOL-CONTROL-BLOCK": "something that tool centre point control does not permit";
    TOOL_CONTROL_HELD = "PRG-TOOL-CONTROL-HELD": "motion that needs an axis position which only the machine knows";
    TOOL_DIRECTION = "PRG-TOOL-DIRECTION": "a tool direction that is a zero vector, or in the form of the other mode";
    PLANE_NESTED = "PRG-PLANE-NESTED": "a tilted plane while one is on";
    PLANE_OFF = "PRG-PLANE-OFF": "the tool axis is to be turned onto a plane, but none is tilted";
    PLANE_BLOCK = "PRG-PLANE-BLOCK": "something that a tilted plane does not permit";
    TOOL_MISSING = "PRG-TOOL-MISSING": "a tool change before any T word";
    NO_END = "PRG-NO-END": "the program just stops, without M2, M30 or a closing %";
    TRAILING = "PRG-TRAILING": "text after the end of the program";
}

#[cfg(test)]
mod tests {
    use super::FINDING_CODES;

    #[test]
    fn codes_are_unique_and_well_formed() {
        for (index, (code, meaning)) in FINDING_CODES.iter().enumerate() {
            assert!(code.starts_with("PRG-") && !meaning.is_empty(), "{code}");
            assert!(FINDING_CODES[..index].iter().all(|(other, _)| other != code), "{code} twice");
        }
    }
}
