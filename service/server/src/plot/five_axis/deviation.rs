//! What thinning deviates, along the program: position and direction of every dropped block against the tolerances.

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, Polygon};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::Color;

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{AS_RUN, ThinningShown};

/// Room above the highest value.
const HEADROOM: f64 = 1.18;

pub(super) struct DeviationPicture<'a> {
    pub(super) program: &'a str,
    pub(super) thinning: &'a ThinningShown,
}

impl Picture for DeviationPicture<'_> {
    fn name(&self) -> String {
        "thinning-deviation".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let ThinningShown { settings, deviations, blocks: [read, dropped], .. } = self.thinning;
        let subtitle = format!("{} \u{b7} {dropped} of {read} blocks dropped", self.program);
        let body = theme::headline(area, scale, "What thinning deviates along the program", &subtitle)?;
        let entries = [
            (Swatch::Fill, AS_RUN, "dropped blocks; kept ones, between them, have no deviation"),
            (Swatch::Dashed, theme::BAD, "tolerance"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        let areas = body.split_evenly((2, 1));
        let position: Vec<_> =
            deviations.stretches().map(|(line, of)| (f64::from(line), of.position_mm * 1e3)).collect();
        let tolerance_um = settings.distance_tolerance_mm * 1e3;
        let title = "distance of the tool centre point from the path that is left";
        self.panel(&areas[0], scale, (title, "distance, µm"), &position, Some(tolerance_um))?;
        let direction: Vec<_> = deviations.stretches().map(|(line, of)| (f64::from(line), of.direction_deg)).collect();
        let title = match settings.interpolated_direction_tolerance_deg {
            Some(_) => "angle between the tool direction and the interpolated one",
            None => {
                "angle between the tool direction and the interpolated one (the tolerance compares with the last kept block)"
            }
        };
        let tolerance_deg = settings.interpolated_direction_tolerance_deg.unwrap_or(settings.angle_tolerance_deg);
        self.panel(&areas[1], scale, (title, "angle, degrees"), &direction, Some(tolerance_deg))
    }
}

impl DeviationPicture<'_> {
    fn panel<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        (title, label): (&str, &str),
        points: &[(f64, f64)],
        tolerance: Option<f64>,
    ) -> DrawResult<(), DB> {
        let highest = points.iter().map(|point| point.1).fold(tolerance.unwrap_or_default(), f64::max);
        let (first, last) = (points.first().map_or(0.0, |point| point.0), points.last().map_or(1.0, |point| point.0));
        let x = AxisSpec::new("line of the program", first - 1.0..last + 1.0);
        let y = AxisSpec::new(label, 0.0..(HEADROOM * highest).max(1e-6));
        let mut chart = theme::panel(area, scale, title, &x, &y)?;
        // Hills between kept blocks.
        for hill in points.split(|point| point.1 == 0.0).filter(|hill| !hill.is_empty()) {
            let half = 0.5 * f64::from(self.thinning.deviations.lines_per_stretch());
            let (start, end) = (hill[0].0 - half, hill[hill.len() - 1].0 + half);
            let outline: Vec<_> =
                std::iter::once((start, 0.0)).chain(hill.iter().copied()).chain([(end, 0.0)]).collect();
            chart.draw_series([Polygon::new(outline.clone(), AS_RUN.mix(0.25).filled())])?;
            theme::curve(&mut chart, &outline, scale.stroke(AS_RUN, 1.0))?;
        }
        if let Some(tolerance) = tolerance {
            let line = [(x.range.start, tolerance), (x.range.end, tolerance)];
            let style = scale.stroke(theme::BAD, 1.8);
            chart.draw_series([DashedPathElement::new(line, scale.px(7.0), scale.px(5.0), style)])?;
        }
        Ok(())
    }
}
