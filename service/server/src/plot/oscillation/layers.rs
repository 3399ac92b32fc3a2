//! What all edges remove in one revolution: the layers in the plane of feed and axis, the chip over the engagement, and
//! the shares of the volume.

use feedwave_cutting::tool_oscillation::{EdgeReport, plane_section};
use plotters::coord::Shift;
use plotters::element::{Rectangle, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::section::Section;
use super::{OscillationPictures, short};

/// Edges whose shares are shown.
const SHOWN_EDGES: usize = 12;

/// What all edges remove.
pub(super) struct LayersPicture<'a> {
    pass: &'a OscillationPictures<'a>,
    /// Azimuth (degrees) and largest chip thickness (mm) without oscillation.
    plain_chip: Vec<(f64, f64)>,
}

impl<'a> LayersPicture<'a> {
    pub(super) fn new(pass: &'a OscillationPictures<'a>) -> Self {
        let plain = pass.plain();
        let azimuths = pass.section.report.edges.first().map(|edge| edge.chip_over_angle.as_slice());
        let chip = |azimuth_deg: f64| {
            let passes = plane_section(pass.tool, &plain, &pass.section.cut, azimuth_deg);
            let layers = passes.iter().flat_map(|pass| &pass.layers);
            (azimuth_deg, layers.map(|layer| layer.to_mm - layer.from_mm).fold(0.0, f64::max))
        };
        Self { pass, plain_chip: azimuths.unwrap_or_default().iter().map(|[azimuth, _]| chip(*azimuth)).collect() }
    }
}

impl Picture for LayersPicture<'_> {
    fn name(&self) -> String {
        format!("{}-layers", self.pass.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let pass = self.pass;
        let title = "Which edge removes which layer in one revolution";
        let body = theme::headline(area, scale, title, &pass.subtitle())?;
        let mut entries = pass.legend(Swatch::Fill);
        entries.push((Swatch::Dashed, theme::MUTED, "every edge without oscillation".to_owned()));
        let entries: Vec<_> = entries.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let (left, right) = body.split_horizontally(body.dim_in_pixel().0 * 54 / 100);
        self.draw_layers(&left, scale)?;
        let (chip, shares) = right.split_vertically(right.dim_in_pixel().1 * 55 / 100);
        self.draw_chip(&chip, scale)?;
        self.draw_shares(&shares, scale)
    }
}

impl LayersPicture<'_> {
    fn draw_layers<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let section = Section::new(self.pass);
        let (x, y) = section.axes();
        let total_mm2: f64 = self.pass.section.report.edges.iter().map(|edge| edge.area_mm2).sum();
        let title = format!("plane through the tool axis: {} mm² per revolution", short(total_mm2, 4));
        let mut chart = theme::panel(area, scale, &title, &x, &y)?;
        let count = section.passes.len();
        section.draw_work(&mut chart, scale, count)?;
        for edge in 0..count {
            section.draw_removed(&mut chart, edge)?;
        }
        section.draw_profile(&mut chart, scale, 0)?;
        section.draw_profile(&mut chart, scale, count)?;
        for edge in 0..count {
            section.write_sizes(&mut chart, scale, edge, |_| format!("E{}", edge + 1))?;
        }
        Ok(())
    }

    fn draw_chip<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let edges = &self.pass.section.report.edges;
        let plain = self.plain_chip.iter().map(|point| point.1);
        let most_mm = edges.iter().map(|edge| edge.max_chip_mm).chain(plain).fold(1e-6, f64::max);
        let [from, to] = self.pass.section.cut.engagement_deg;
        let x = AxisSpec::new("azimuth from the feed direction, degrees", from..to.max(from + 1e-3));
        let y = AxisSpec::new("chip thickness, mm", 0.0..1.1 * most_mm);
        let mut chart = theme::panel(area, scale, "largest chip thickness over the engagement", &x, &y)?;
        for piece in self.plain_chip.chunks(6) {
            theme::curve(&mut chart, &piece[..piece.len().min(4)], scale.stroke(theme::MUTED, 2.2))?;
        }
        for (index, edge) in edges.iter().enumerate() {
            let curve: Vec<_> = edge.chip_over_angle.iter().map(|[azimuth, chip]| (*azimuth, *chip)).collect();
            theme::curve(&mut chart, &curve, scale.stroke(self.pass.color(index), 2.6))?;
        }
        Ok(())
    }

    /// Bars of the shares of the volume, with the duty and what finishes.
    fn draw_shares<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let report = &self.pass.section.report;
        let left = Pos::new(HPos::Left, VPos::Top);
        let title = format!(
            "shares of {} mm³ per revolution, {} mm³ without oscillation",
            short(report.volume_mm3_per_rev, 2),
            short(report.plain_volume_mm3_per_rev, 2)
        );
        let x = scale.px(theme::PANEL_LEFT);
        area.draw(&Text::new(title, (x, scale.px(9.0)), scale.text(17.0, theme::INK).pos(left)))?;
        let shown: Vec<&EdgeReport> = report.edges.iter().take(SHOWN_EDGES).collect();
        let (width, height) = area.dim_in_pixel();
        let top = f64::from(scale.px(44.0));
        let row = ((f64::from(height) - top) / shown.len().max(1) as f64).min(f64::from(scale.px(62.0)));
        let full = f64::from(width) - f64::from(x) - f64::from(scale.px(240.0));
        let most = shown.iter().map(|edge| edge.volume_share).fold(1e-9, f64::max);
        for (index, edge) in shown.iter().enumerate() {
            let middle = top + row * (index as f64 + 0.45);
            let length = full * edge.volume_share / most;
            let (upper, lower) = (middle - 0.3 * row, middle + 0.3 * row);
            let corners = [(x, upper as i32), (x + length as i32, lower as i32)];
            area.draw(&Rectangle::new(corners, self.pass.color(index).mix(0.55).filled()))?;
            let plain = report.plain.get(index).map_or(0.0, |plain| plain.volume_share);
            let at = x + (full * plain / most) as i32;
            let tick = [(at, (upper - 0.1 * row) as i32), (at, (lower + 0.1 * row) as i32)];
            area.draw(&plotters::element::PathElement::new(tick.to_vec(), scale.stroke(theme::MUTED, 2.2)))?;
            let name = scale.text(15.0, self.pass.color(index)).pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(format!("E{}", edge.edge), (x - scale.px(10.0), middle as i32), name))?;
            let text = format!(
                "{} %, cuts {} % of the turn{}",
                short(100.0 * edge.volume_share, 1),
                short(100.0 * edge.duty, 0),
                if edge.finishes { ", finishes" } else { "" }
            );
            let style = scale.text(15.0, theme::INK).pos(Pos::new(HPos::Left, VPos::Center));
            let end = (x + length as i32).max(at) + scale.px(9.0);
            area.draw(&Text::new(text, (end, middle as i32), style))?;
        }
        Ok(())
    }
}
