//! What all edges remove in one revolution: the layers in the plane of feed and axis, the chip over the engagement, and
//! the shares of the volume.

use feedwave_cutting::tool_oscillation::{EdgeReport, plane_section};
use plotters::style::text_anchor::{HPos, VPos};

use super::super::figure::{Axis, Beside, COUNT, DEGREES, Figure, Layout, MM, PERCENT, Panel, short};
use super::super::theme::{self, Ink};
use super::OscillationPictures;
use super::section::Section;

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

impl LayersPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let pass = self.pass;
        let right = Layout::Column(vec![(0.55, self.chip().into()), (0.45, self.shares().into())]);
        let body = Layout::Row(vec![(0.52, self.layers().into()), (0.48, right)]);
        let title = "Which edge removes which layer in one revolution";
        Figure::new(format!("{}-layers", pass.name), title, pass.subtitle(), body)
    }

    fn layers(&self) -> Panel {
        let section = Section::new(self.pass);
        let total_mm2: f64 = self.pass.section.report.edges.iter().map(|edge| edge.area_mm2).sum();
        let title = format!("plane through the tool axis: {} mm² per revolution", short(total_mm2, 4));
        let mut panel = section.panel(title);
        let count = section.passes.len();
        section.add_work(&mut panel, count);
        for edge in 0..count {
            section.add_removed(&mut panel, edge);
        }
        let ink = Ink::line("surface before and after the revolution", theme::INK, 1.8);
        section.add_profile(&mut panel, &ink, 0);
        section.add_profile(&mut panel, &ink, count);
        for edge in 0..count {
            section.write(&mut panel, edge, (590.0, 600.0), |_| [format!("E{}", edge + 1), String::new()]);
        }
        panel
    }

    fn chip(&self) -> Panel {
        let edges = &self.pass.section.report.edges;
        let plain = self.plain_chip.iter().map(|point| point.1);
        let most_mm = edges.iter().map(|edge| edge.max_chip_mm).chain(plain).fold(1e-6, f64::max);
        let [from, to] = self.pass.section.cut.engagement_deg;
        let x = Axis::new("azimuth from the feed direction", DEGREES, from..to.max(from + 1e-3));
        let y = Axis::new("chip thickness", MM, 0.0..1.1 * most_mm);
        let mut panel = Panel::new("largest chip thickness over the engagement", x, y);
        for (index, edge) in edges.iter().enumerate() {
            let curve: Vec<_> = edge.chip_over_angle.iter().map(|[azimuth, chip]| (*azimuth, *chip)).collect();
            panel.path(&self.pass.line(index, 2.6), curve);
        }
        panel.path(&plain_ink(), self.plain_chip.clone());
        panel
    }

    /// Bars of the shares of the volume, with the duty and what finishes.
    fn shares(&self) -> Panel {
        let report = &self.pass.section.report;
        let shown: Vec<&EdgeReport> = report.edges.iter().take(SHOWN_EDGES).collect();
        let percent = |share: f64| 100.0 * share;
        let plain = |index: usize| percent(report.plain.get(index).map_or(0.0, |plain| plain.volume_share));
        let most = shown.iter().enumerate().map(|(index, edge)| percent(edge.volume_share).max(plain(index)));
        let most = most.fold(1e-9, f64::max);
        let title = format!(
            "shares of {} mm³ per revolution, {} mm³ without oscillation",
            short(report.volume_mm3_per_rev, 2),
            short(report.plain_volume_mm3_per_rev, 2)
        );
        // On the right there is space for the text of the longest bar.
        let x = Axis::new("share of the volume", PERCENT, 0.0..2.1 * most);
        let y = Axis::new("edge", COUNT, -(shown.len() as f64) + 0.4..0.6);
        let mut panel = Panel { y_numbers: false, ..Panel::new(title, x, y) };
        if report.edges.len() > shown.len() {
            panel.note(format!("the first {} of {} edges", shown.len(), report.edges.len()));
        }
        for (index, edge) in shown.iter().enumerate() {
            let middle = -(index as f64);
            let share = percent(edge.volume_share);
            panel.rectangle(&self.pass.fill(index), 0.0..share, middle - 0.3..middle + 0.3);
            let tick = vec![(plain(index), middle - 0.4), (plain(index), middle + 0.4)];
            panel.path(&plain_ink(), tick);
            let text = format!(
                "{} %, cuts {} % of the turn{}",
                short(share, 1),
                short(percent(edge.duty), 0),
                if edge.finishes { ", finishes" } else { "" }
            );
            panel.label((share.max(plain(index)), middle), text, theme::INK, Beside::RIGHT);
            let beside = Beside { x: HPos::Right, y: VPos::Center, by: (-10.0, 0.0) };
            panel.label((0.0, middle), format!("E{}", edge.edge), theme::INK, beside);
        }
        panel
    }
}

/// The same without oscillation: the largest chip of all edges, and the share of each.
fn plain_ink() -> Ink {
    Ink::dashed("the same without oscillation", theme::INK, 2.4)
}
