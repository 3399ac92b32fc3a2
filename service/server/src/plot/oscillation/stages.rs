//! The work stage by stage, as the edges pass the plane of feed and tool axis one after another.

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, DrawingBackend};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, Scale, Swatch};
use super::section::Section;
use super::{OscillationPictures, short};

/// Edges that are shown at most.
const SHOWN_EDGES: usize = 9;

/// The stages of one revolution.
pub(super) struct StagesPicture<'a> {
    pub(super) pass: &'a OscillationPictures<'a>,
}

impl Picture for StagesPicture<'_> {
    fn name(&self) -> String {
        format!("{}-stages", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let pass = self.pass;
        let title = "Stages of one revolution: what each edge removes";
        let body = theme::headline(area, scale, title, &pass.subtitle())?;
        let mut entries = pass.legend(Swatch::Fill);
        entries.push((Swatch::Line, theme::INK, "surface after the pass".to_owned()));
        entries.push((Swatch::Fill, theme::INK, "work".to_owned()));
        let entries: Vec<_> = entries.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let section = Section::new(pass);
        let shown = section.passes.len().min(SHOWN_EDGES);
        let columns = if shown > 4 { 3 } else { shown.clamp(1, 2) };
        let areas = body.split_evenly((shown.div_ceil(columns).max(1), columns));
        for (edge, area) in areas.iter().enumerate().take(shown) {
            draw_stage(&section, area, scale, edge, edge + columns >= shown)?;
        }
        Ok(())
    }
}

fn draw_stage<DB: DrawingBackend>(
    section: &Section<'_>,
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    edge: usize,
    labelled: bool,
) -> DrawResult<(), DB> {
    let one = &section.passes[edge];
    let place = |value: f64, above: &str, below: &str| match short(value.abs(), 4) {
        zero if zero == "0" => format!("0 mm {above}"),
        length => format!("{length} mm {}", if value > 0.0 { above } else { below }),
    };
    let area_mm2: f64 = one.layers.iter().map(feedwave_cutting::tool_oscillation::RemovedLayer::area_mm2).sum();
    let title = format!(
        "E{}: {}, {}: removes {} mm²",
        edge + 1,
        place(one.offset.feed_mm, "forwards", "back"),
        place(one.end_mm, "up", "down"),
        short(area_mm2, 4)
    );
    let (mut x, y) = section.axes();
    if !labelled {
        x.label.clear();
    }
    let mut chart = theme::panel(area, scale, &title, &x, &y)?;
    section.draw_work(&mut chart, scale, edge + 1)?;
    section.draw_removed(&mut chart, edge)?;
    section.draw_profile(&mut chart, scale, edge + 1)?;
    section.draw_edge(&mut chart, scale, edge, 3.0)?;
    section.write_sizes(&mut chart, scale, edge, |layer| {
        format!("{} × {} mm", short(layer.to_mm - layer.from_mm, 3), short(layer.high_mm - layer.low_mm, 3))
    })
}
