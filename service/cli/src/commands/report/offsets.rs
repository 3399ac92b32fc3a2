//! Offsets that a program found set, for people.

use feedwave_contract::proto::{AxisPosition, Offsets, ValidationReport};

use super::Rows;
use crate::commands::terminal::{Style, number};

/// The offsets; nothing where all are zero.
pub(super) fn text(report: &ValidationReport, style: Style) -> String {
    let Some(Offsets { external, work_offsets, reference_positions, .. }) = &report.offsets else {
        return String::new();
    };
    let mut rows = Rows::new(style);
    rows.heading("Offsets at the start, machine coordinates, X a radius");
    if let Some(external) = external {
        rows.row("external", position(external));
    }
    for place in work_offsets {
        let mut shown = place.offset.as_ref().map(position).unwrap_or_default();
        if place.rotation_deg != 0.0 {
            shown.push_str(&format!(" turned by {}°", number(place.rotation_deg, 7)));
        }
        rows.row(&place.system, shown.trim_start());
    }
    for place in reference_positions {
        let name = if place.number == 1 { "G28".to_owned() } else { format!("G30 P{}", place.number) };
        rows.row(&name, place.position.as_ref().map(position).unwrap_or_default());
    }
    rows.text.push('\n');
    rows.text
}

/// The axes that are not zero.
fn position(at: &AxisPosition) -> String {
    let values = [at.x, at.y, at.z, at.a, at.b, at.c, at.u, at.v, at.w];
    let shown = "XYZABCUVW".chars().zip(values).filter(|(_, value)| *value != 0.0);
    shown.map(|(letter, value)| format!("{letter}{}", number(value, 7))).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use feedwave_contract::proto::{ReferencePosition, WorkOffset};

    use super::*;

    #[test]
    fn every_offset_is_a_row() {
        assert_eq!(text(&ValidationReport::default(), Style::plain()), "");
        let at = |x, z| Some(AxisPosition { x, z, ..Default::default() });
        let offsets = Offsets {
            external: at(0.0, -2.5),
            work_offsets: vec![
                WorkOffset { system: "G54".to_owned(), offset: at(120.25, 0.0), rotation_deg: 0.0 },
                WorkOffset { system: "G59.3".to_owned(), offset: at(0.0, 0.0), rotation_deg: 30.0 },
            ],
            reference_positions: vec![ReferencePosition { number: 2, position: at(0.0, 100.0) }],
            parameters: Vec::new(),
        };
        let report = ValidationReport { offsets: Some(offsets), ..Default::default() };
        let expected = "Offsets at the start, machine coordinates, X a radius\n  external      Z-2.5\n  G54           X120.25\n  \
                        G59.3         turned by 30°\n  G30 P2        Z100\n\n";
        assert_eq!(text(&report, Style::plain()), expected);
    }
}
