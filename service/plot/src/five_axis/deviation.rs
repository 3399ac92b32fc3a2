//! What thinning deviates, along the program: position and direction of every dropped block against the tolerances.

use super::super::figure::{Axis, COUNT, DEGREES, Figure, Layout, Panel, Place, UM, Unit};
use super::super::theme::{self, Ink};
use super::{ThinningShown, named};
use feedwave_cutting::thinning::ThinningMethod;

/// Space above the highest value.
const HEADROOM: f64 = 1.18;

pub(super) struct DeviationPicture<'a> {
    pub(super) program: &'a str,
    pub(super) thinning: &'a ThinningShown,
}

impl DeviationPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let ThinningShown { settings, deviations, blocks: [read, dropped], .. } = self.thinning;
        let subtitle =
            format!("{} \u{b7} {} \u{b7} {dropped} of {read} blocks dropped", self.program, named(settings.method));
        let position: Vec<_> =
            deviations.stretches().map(|(line, of)| (f64::from(line), of.position_mm * 1e3)).collect();
        let title = "distance of the tool centre point from the path that is left";
        let tolerance_um = Some(settings.distance_tolerance_mm * 1e3);
        let distance = self.panel(title, ("distance", UM.along_a_path()), &position, tolerance_um);
        let direction: Vec<_> = deviations.stretches().map(|(line, of)| (f64::from(line), of.direction_deg)).collect();
        let title = "angle between the tool direction and the interpolated one";
        let is_fitted = settings.method == ThinningMethod::Fitted;
        let tolerance_deg = match is_fitted {
            true => Some(settings.fitted_tolerance_deg()),
            false => settings.interpolated_direction_tolerance_deg,
        };
        let mut angle = self.panel(title, ("angle", DEGREES), &direction, tolerance_deg);
        if tolerance_deg.is_none() {
            angle.note(format!(
                "not bounded: the angle tolerance of {} degrees compares with the last kept block, not with the interpolated \
                 direction",
                settings.angle_tolerance_deg
            ));
        }
        distance_above(distance, angle, subtitle)
    }

    fn panel(&self, title: &str, (label, unit): (&str, Unit), points: &[Place], tolerance: Option<f64>) -> Panel {
        let highest = points.iter().map(|point| point.1).fold(tolerance.unwrap_or_default(), f64::max);
        let (first, last) = (points.first().map_or(0.0, |point| point.0), points.last().map_or(1.0, |point| point.0));
        let x = Axis::new("line of the program", COUNT, first - 1.0..last + 1.0);
        let y = Axis::new(label, unit, 0.0..(HEADROOM * highest).max(1e-6));
        let mut panel = Panel::new(title, x, y);
        let name = match self.thinning.settings.method {
            ThinningMethod::Published => "dropped blocks; kept ones, between them, have no deviation",
            ThinningMethod::Fitted => "every block, dropped or kept",
        };
        // Hills between kept blocks.
        for hill in points.split(|point| point.1 == 0.0).filter(|hill| !hill.is_empty()) {
            let half = 0.5 * f64::from(self.thinning.deviations.lines_per_stretch());
            let (start, end) = (hill[0].0 - half, hill[hill.len() - 1].0 + half);
            let outline: Vec<_> =
                std::iter::once((start, 0.0)).chain(hill.iter().copied()).chain([(end, 0.0)]).collect();
            panel.area(&Ink::fill(name, theme::COMMAND, 0.25), outline.clone());
            panel.path(&Ink::line(name, theme::COMMAND, 1.2), outline);
        }
        if let Some(tolerance) = tolerance {
            panel.limit(&Ink::limit("tolerance"), tolerance, "tolerance");
        }
        panel
    }
}

fn distance_above(mut distance: Panel, angle: Panel, subtitle: String) -> Figure {
    distance.x.labelled = false;
    let title = "What thinning deviates along the program";
    Figure::new("thinning-deviation", title, subtitle, Layout::column(vec![distance, angle]))
}
