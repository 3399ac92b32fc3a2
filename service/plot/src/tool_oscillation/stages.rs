//! The work stage by stage, as the edges pass the plane of feed and tool axis one after another.

use feedwave_cutting::tool_oscillation::RemovedLayer;

use super::super::figure::{Figure, Layout, Panel, SIZE, short};
use super::super::theme::{self, Ink};
use super::OscillationPictures;
use super::section::Section;

/// Edges that are shown at most.
const SHOWN_EDGES: usize = 9;
/// What around the panels and inside them is not plotted, design units.
const AROUND: f64 = 150.0;
const MARGINS: (f64, f64) = (134.0, 170.0);

/// The stages of one revolution.
pub(super) struct StagesPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl StagesPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let pass = self.pass;
        let section = Section::new(pass);
        let shown = section.passes.len().min(SHOWN_EDGES);
        let columns = if shown > 4 { 3 } else { shown.clamp(1, 2) };
        let rows = shown.div_ceil(columns).max(1);
        let height = SIZE.1 + 60 * u32::try_from(rows).unwrap_or(1);
        let space =
            (f64::from(SIZE.0) / columns as f64 - MARGINS.0, (f64::from(height) - AROUND) / rows as f64 - MARGINS.1);
        let stage = |edge: usize| {
            let mut panel = stage(&section, edge, space);
            panel.x.labelled = edge + columns >= shown;
            (1.0, panel.into())
        };
        let row = |row: usize| {
            let mut stages: Vec<(f64, Layout)> = (row * columns..((row + 1) * columns).min(shown)).map(stage).collect();
            // The last row has panels as wide as the others.
            let missing = columns - stages.len();
            stages.extend((0..missing).map(|_| (1.0, Layout::Row(Vec::new()))));
            (1.0, Layout::Row(stages))
        };
        let mut subtitle = pass.subtitle();
        subtitle.push_str(" \u{b7} outlined: where the edge is, filled: what it removes");
        if section.passes.len() > shown {
            subtitle.push_str(&format!(" \u{b7} the first {shown} edges"));
        }
        let title = "Stages of one revolution: what each edge removes";
        let body = Layout::Column((0..rows).map(row).collect());
        Figure::new(format!("{}-stages", pass.name), title, subtitle, body).with_height(height)
    }
}

fn stage(section: &Section<'_>, edge: usize, space: (f64, f64)) -> Panel {
    let one = &section.passes[edge];
    let place = |value: f64, above: &str, below: &str| match short(value.abs(), 4) {
        zero if zero == "0" => format!("0 mm {above}"),
        length => format!("{length} mm {}", if value > 0.0 { above } else { below }),
    };
    let area_mm2: f64 = one.layers.iter().map(RemovedLayer::area_mm2).sum();
    let title = format!(
        "E{}: {}, {}: removes {} mm²",
        edge + 1,
        place(one.offset.feed_mm, "forwards", "back"),
        place(one.end_mm, "up", "down"),
        short(area_mm2, 4)
    );
    let mut panel = section.panel(title);
    section.add_work(&mut panel, edge + 1);
    section.add_removed(&mut panel, edge);
    section.add_profile(&mut panel, &Ink::line("surface after the pass", theme::INK, 1.8), edge + 1);
    section.add_edge(&mut panel, edge);
    let left_out = section.write(&mut panel, edge, space, |layer| {
        let (wide, high) = (layer.to_mm - layer.from_mm, layer.high_mm - layer.low_mm);
        [format!("{} × ", short(wide, 3)), format!("{} mm", short(high, 3))]
    });
    if !left_out.is_empty() {
        panel.note(format!("too small to label: {}", left_out.join(", ")));
    }
    panel
}
