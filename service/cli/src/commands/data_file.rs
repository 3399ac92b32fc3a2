//! Files of machines and tools: messages of the contract, TOML or JSON.

use std::path::Path;

use feedwave_contract::document::{Document, FormerField, Syntax};
use feedwave_contract::violations::{Violations, more};
use prost::Name;

use super::CliError;

/// What files had before they were messages of the contract. Lists in the place of tables, and names of values without that
/// of their enumeration, need no line: the refusal says how they are written.
const FORMER: &[FormerField] = &[
    former("OscillationCondition", "period", "periods_per_rev = 1 or period_s = 0.1 beside feed and axial"),
    former(
        "Waveform",
        "kind",
        "sine = {}, held_peak = { hold_share = 0.3 }, jerk_limited_held_peak = { … } or table = { … }",
    ),
    former("Waveform", "hold_share", "it inside: held_peak = { hold_share = 0.3 } or jerk_limited_held_peak = { … }"),
    former("Waveform", "points", "it inside: table = { points = [{ phase_turns = 0.25, value = 1 }, …] }"),
    former("LeadingEdge", "rotation", "every_parts = 50 or every_s = 600 beside edge"),
    former(
        "Engagement",
        "kind",
        "angles = { entry_deg = -90, exit_deg = 90 } or width = { … }; neither for a full slot",
    ),
    former("ConditionTable", "values", "rows = [{ values = [0.2, 0.6] }], one for each spindle speed"),
    FormerField {
        message: "OscillationCondition",
        field: "condition",
        now: "what is in it beside name and number",
        flattened: true,
    },
];

const fn former(message: &'static str, field: &'static str, now: &'static str) -> FormerField {
    FormerField { message, field, now, flattened: false }
}

/// What a file states: JSON where its name ends so, else TOML.
pub(super) fn read(path: &Path) -> Result<Document, CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| CliError::file(path, &error))?;
    let is_json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let syntax = if is_json { Syntax::Json } else { Syntax::Toml };
    Document::parse(&text, syntax).map_err(|error| CliError::trouble(format!("{}: {error}", path.display())))
}

/// A file as a message.
pub(super) fn message<M: Name + Default>(path: &Path, document: &Document) -> Result<M, CliError> {
    document.message(FORMER).map_err(|violations| refused(path, &violations))
}

/// Every violation of a file, one a line, with the path of the field.
pub(super) fn refused(path: &Path, violations: &Violations) -> CliError {
    let name = path.display();
    let mut lines: Vec<String> = violations
        .as_slice()
        .iter()
        .map(|violation| match violation.field.as_str() {
            "" => format!("{name}: {}", violation.description),
            _ => format!("{name}: {violation}"),
        })
        .collect();
    if violations.not_listed() > 0 {
        lines.push(format!("{name}: {}", more(violations.not_listed())));
    }
    CliError::trouble(lines.join("\n"))
}
