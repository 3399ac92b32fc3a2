//! Tool oscillations for people: how they are in step, what they ask of the axes, what every edge removes, the floor.

use feedwave_contract::proto::oscillation_roles::Rotation;
use feedwave_contract::proto::{
    OscillationDirection, OscillationEdge, OscillationFloor, OscillationFollowing, OscillationLoad, OscillationRoles,
    OscillationSectionReport, RemovedLayer, ValidationReport,
};

use super::super::terminal::{Style, number};
use super::{Rows, percent, sections};

/// Edges listed; the JSON has all.
const LISTED_EDGES: usize = 16;

pub(super) fn text(report: &ValidationReport, style: Style) -> String {
    let count = report.summary.as_ref().map(|summary| summary.oscillation_count);
    sections(&report.oscillations, count, "oscillation", |number, section| section_text(number, section, style))
}

fn section_text(position: usize, section: &OscillationSectionReport, style: Style) -> String {
    let mut rows = Rows::new(style);
    let (on_line, line) = (section.on_line, section.line);
    let condition = &section.condition;
    rows.heading(&format!("Oscillation {position}: {condition}, on in line {on_line}, from line {line}"));
    cut_rows(&mut rows, section);
    step_rows(&mut rows, section);
    rows.row("blend", format!("over {} mm of path at both ends", number(section.ramp_mm, 4)));
    rows.row(
        "volume",
        format!(
            "{} mm³ per revolution, {} without oscillation",
            number(section.volume_mm3_per_rev, 4),
            number(section.plain_volume_mm3_per_rev, 4)
        ),
    );
    load_table(&mut rows, &section.loads);
    if let Some(following) = &section.following {
        following_rows(&mut rows, following);
    }
    rows.text.push('\n');
    edge_table(&mut rows, section);
    if let Some(floor) = &section.floor {
        floor_row(&mut rows, floor);
    }
    rows.text
}

/// What is cut.
fn cut_rows(rows: &mut Rows, section: &OscillationSectionReport) {
    let cut = section.cut.unwrap_or_default();
    rows.row(
        "cut",
        format!(
            "tool {}, {} mm/min at {} rev/min ({}), {} mm deep",
            section.tool,
            number(cut.feed_mm_per_min, 5),
            number(cut.spindle_rev_per_min, 5),
            if cut.clockwise { "M3" } else { "M4" },
            number(cut.depth_mm, 4)
        ),
    );
    if (cut.engagement_start_deg, cut.engagement_end_deg) != (-90.0, 90.0) {
        rows.row(
            "engagement",
            format!(
                "from {} to {} degrees; the layers are those at {} degrees",
                number(cut.engagement_start_deg, 4),
                number(cut.engagement_end_deg, 4),
                number(section.plane_deg, 4)
            ),
        );
    }
}

/// How the oscillation is in step with the edges.
fn step_rows(rows: &mut Rows, section: &OscillationSectionReport) {
    rows.row(
        "period",
        format!(
            "{} ms: M = {} per revolution, N = {} edges per period; {} mm of feed",
            number(section.period_s * 1e3, 5),
            section.periods_per_rev,
            number(section.edges_per_period, 4),
            number(section.feed_mm_per_period, 4)
        ),
    );
    if section.max_feed_mm_per_min > 0.0 {
        rows.row(
            "feed",
            format!(
                "the conditions hold from {} to {} mm/min",
                number(section.min_feed_mm_per_min, 5),
                number(section.max_feed_mm_per_min, 5)
            ),
        );
    }
    rows.row(
        "protrusion",
        format!(
            "held for {} of the period, {} needed; {} degrees after the largest retreat",
            number(section.hold_share, 4),
            number(section.required_hold_share, 4),
            // Rounding leaves far less than anyone can set.
            number((section.phase_error_deg * 1e6).round() / 1e6, 4)
        ),
    );
    let finishing: Vec<String> = section.finishing_edges.iter().map(u32::to_string).collect();
    let (edges, finish) = if finishing.len() == 1 { ("edge", "finishes") } else { ("edges", "finish") };
    rows.row("roles", format!("edge {} leads, {edges} {} {finish}", section.leading_edge, finishing.join(", ")));
    if let Some(moved) = section.roles.as_ref().and_then(moved_text) {
        rows.row("", moved);
    }
}

/// How the lead came to its edge, where it moves on.
fn moved_text(roles: &OscillationRoles) -> Option<String> {
    let (interval, before) = match roles.rotation? {
        Rotation::EveryParts(parts) => (format!("{parts} parts"), format!("{} parts", roles.parts_before)),
        Rotation::EveryS(seconds) => {
            (format!("{} s", number(seconds, 5)), format!("{} s", number(roles.cutting_time_before_s, 5)))
        }
    };
    let (first, changes) = (roles.first_edge, roles.changes);
    Some(format!("the lead moves on from edge {first} every {interval}: {changes} times in the {before} before"))
}

const fn direction_text(direction: OscillationDirection) -> &'static str {
    match direction {
        OscillationDirection::Axial => "axial",
        OscillationDirection::Cross => "across",
        OscillationDirection::Feed | OscillationDirection::Unspecified => "feed",
    }
}

/// What arrives at the tool.
fn following_rows(rows: &mut Rows, following: &OscillationFollowing) {
    let head = ["at the tool", "axis", "gain", "lag, deg", "arrives, mm", "command, mm", "phase, deg"];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    table.extend(following.directions.iter().map(|own| {
        vec![
            direction_text(own.direction()).to_owned(),
            own.axis.clone(),
            percent(own.gain),
            number(own.lag_deg, 4),
            number(own.arriving_amplitude_mm, 4),
            own.amplitude_to_command_mm.map_or_else(|| "none".to_owned(), |command| number(command, 4)),
            number(own.phase_to_command_deg, 4),
        ]
    }));
    rows.table(&table);
    let contour = following.contour_error_mm.map_or_else(
        || "; how far it leaves its path is not judged: the axes differ, and the guided tool mixes them".to_owned(),
        |error_mm| match error_mm {
            0.0 => String::new(),
            error_mm => format!("; at most {} mm across the feed, as the axes differ", number(error_mm, 4)),
        },
    );
    let phase = number((following.phase_error_deg * 1e6).round() / 1e6, 4);
    rows.row("tool", format!("protrudes {phase} degrees after the largest retreat{contour}"));
}

fn load_table(rows: &mut Rows, loads: &[OscillationLoad]) {
    let head = ["direction", "amplitude, mm", "mm/s", "mm/s²", "mm/s³", "step, mm/s²", "of the limit"];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    table.extend(loads.iter().map(|load| {
        vec![
            direction_text(load.direction()).to_owned(),
            number(load.amplitude_mm, 4),
            number(load.velocity_with_feed_mm_per_s, 4),
            number(load.acceleration_mm_per_s2, 4),
            number(load.jerk_mm_per_s3, 4),
            number(load.acceleration_step_mm_per_s2, 4),
            percent(load.utilisation),
        ]
    }));
    rows.table(&table);
}

/// What every edge removes while it points in the feed direction.
fn edge_table(rows: &mut Rows, section: &OscillationSectionReport) {
    let head = ["edge", "feed, mm", "axial, mm", "layers, mm", "area, mm²", "chip, mm", "share", "duty", "plain", ""];
    let mut table = vec![head.map(str::to_owned).to_vec()];
    let row = |(index, edge): (usize, &OscillationEdge)| {
        let plain = section.plain_edges.get(index);
        let layers: Vec<String> = edge.layers.iter().map(layer_text).collect();
        vec![
            edge.edge.to_string(),
            number(edge.feed_offset_mm, 4),
            number(edge.retraction_mm, 4),
            if layers.is_empty() { "none".to_owned() } else { layers.join(", ") },
            number(edge.area_mm2, 4),
            number(edge.max_chip_mm, 3),
            percent(edge.volume_share),
            percent(edge.duty),
            plain.map_or_else(String::new, |plain| percent(plain.volume_share)),
            if edge.finishes { "finishes" } else { "" }.to_owned(),
        ]
    };
    table.extend(section.edges.iter().enumerate().take(LISTED_EDGES).map(row));
    rows.table(&table);
    rows.more(section.edges.len().saturating_sub(LISTED_EDGES) as u64);
}

fn layer_text(layer: &RemovedLayer) -> String {
    let reach = number(layer.to_mm - layer.from_mm, 4);
    format!("{} to {} × {reach}", number(layer.low_mm, 4), number(layer.high_mm, 4))
}

fn floor_row(rows: &mut Rows, floor: &OscillationFloor) {
    let (with, without) = (floor.oscillating.unwrap_or_default(), floor.plain.unwrap_or_default());
    rows.row(
        "floor",
        format!(
            "{} mm peak to valley, {} mm mean; {} and {} mm without oscillation",
            // Cells are single precision.
            number(floor_mm(with.peak_to_valley_mm), 3),
            number(floor_mm(with.mean_mm), 3),
            number(floor_mm(without.peak_to_valley_mm), 3),
            number(floor_mm(without.mean_mm), 3)
        ),
    );
    rows.row(
        "",
        format!(
            "{} mm above the commanded end of the tool, {} mm without; on {} × {} mm of it in cells of {} mm",
            number(floor_mm(with.height_mm), 3),
            number(floor_mm(without.height_mm), 3),
            number(floor.length_mm, 4),
            number(floor.width_mm, 4),
            number(floor.resolution_mm, 3)
        ),
    );
    let unswept = with.unswept_share.max(without.unswept_share);
    if unswept > 0.0 {
        rows.row("", format!("no end of an edge sweeps {} of it", percent(unswept)));
    }
}

/// A height to the nanometre.
fn floor_mm(height_mm: f64) -> f64 {
    let nanometres = (height_mm * 1e6).round();
    // Not a negative zero.
    if nanometres == 0.0 { 0.0 } else { nanometres / 1e6 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use feedwave_contract::proto::{FloorRoughness, OscillationCut, PlainEdge};

    fn section() -> OscillationSectionReport {
        let edge = |edge, retraction_mm, finishes| OscillationEdge {
            edge,
            retraction_mm,
            layers: vec![RemovedLayer { low_mm: retraction_mm, high_mm: 1.0, from_mm: -0.65, to_mm: 0.35 }],
            volume_share: 0.5,
            finishes,
            ..Default::default()
        };
        OscillationSectionReport {
            on_line: 4,
            line: 5,
            tool: 7,
            condition: "accuracy".to_owned(),
            cut: Some(OscillationCut {
                feed_mm_per_min: 600.0,
                clockwise: true,
                engagement_start_deg: 30.0,
                engagement_end_deg: 90.0,
                ..Default::default()
            }),
            plane_deg: 30.0,
            max_feed_mm_per_min: 900.0,
            roles: Some(OscillationRoles {
                first_edge: 2,
                changes: 3,
                rotation: Some(Rotation::EveryParts(20)),
                parts_before: 71,
                ..Default::default()
            }),
            periods_per_rev: 1,
            edges_per_period: 2.0,
            hold_share: 0.3,
            required_hold_share: 0.25,
            phase_error_deg: -1e-13,
            leading_edge: 1,
            finishing_edges: vec![2],
            loads: vec![OscillationLoad {
                direction: OscillationDirection::Axial.into(),
                acceleration_step_mm_per_s2: 740.22,
                utilisation: 0.25,
                ..Default::default()
            }],
            edges: vec![edge(1, 0.03, false), edge(2, -0.03, true)],
            plain_edges: vec![PlainEdge { volume_share: 0.25, ..Default::default() }],
            floor: Some(OscillationFloor {
                oscillating: Some(FloorRoughness { peak_to_valley_mm: 0.0088, height_mm: -0.03, ..Default::default() }),
                plain: Some(FloorRoughness { mean_mm: -1e-10, unswept_share: 0.25, ..Default::default() }),
                length_mm: 2.0,
                width_mm: 80.0,
                resolution_mm: 0.02,
                ..Default::default()
            }),
            ..Default::default()
        }
    }

    #[test]
    fn every_edge_has_its_row() {
        let text = section_text(1, &section(), Style::plain());
        let squeezed = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for expected in [
            "Oscillation 1: accuracy, on in line 4, from line 5",
            "M = 1 per revolution, N = 2 edges per period",
            "held for 0.3 of the period, 0.25 needed; 0 degrees after",
            "the conditions hold from 0 to 900 mm/min",
            "edge 1 leads, edge 2 finishes",
            "740.2 25 %",
            "0.03 to 1 × 1",
            "-0.03 to 1 × 1",
            "50 % 0 % 25 %",
            "engagement from 30 to 90 degrees; the layers are those at 30 degrees",
            "the lead moves on from edge 2 every 20 parts: 3 times in the 71 parts before",
            "0.0088 mm peak to valley, 0 mm mean; 0 and 0 mm without oscillation",
            "-0.03 mm above the commanded end of the tool, 0 mm without; on 2 × 80 mm of it in cells of 0.02 mm",
            "no end of an edge sweeps 25 % of it",
        ] {
            assert!(squeezed.contains(expected), "no {expected:?} in\n{text}");
        }
        assert_eq!(text.matches("finishes").count(), 2);
    }
}
