//! Every finding code of the service. The core's tables are with what makes the findings; those made of a call's own
//! arguments are here.

use feedwave_program::CodeTable;

feedwave_program::finding_codes! {
    /// Codes of stability lobes.
    pub LOBES_CODES: "Stability lobes";

    "LOBES-LOW-IMMERSION" [LOBES_LOW_IMMERSION: Warning, LOBES_LOW_IMMERSION_COVERED: Info] {
        meaning: "a radial immersion so low that the true limits may be below the computed ones: information where the \
              margin covers it",
        cause: "The limits are computed with the mean of the cutting force over a revolution, which errs on the unsafe \
              side where the edges cut for a small part of it.",
        cure: "Use the margin that the finding names.",
        example: words("a request for lobes with a radial immersion of 5 % and no margin"),
    }
}

/// The tables of all crates, in the order of the page.
pub fn finding_codes() -> impl Iterator<Item = &'static CodeTable> {
    const OWN: &[CodeTable] = &[LOBES_CODES];
    feedwave_program::code::TABLES.iter().chain(&feedwave_cutting::code::TABLES).chain(OWN)
}
