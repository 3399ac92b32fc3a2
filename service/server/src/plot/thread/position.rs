//! X over the spindle angle: the paths of all passes at the same place on the work, what each of them cuts, and where
//! it cuts air.

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, EmptyElement, Polygon, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::{Groove, stretches};

/// Points of a curve: enough for two dozen vibrations.
const POINTS: u32 = 1_440;

/// X over the spindle angle.
pub(super) struct PositionPicture<'a> {
    pub(super) groove: &'a Groove<'a>,
}

/// One pass, sampled.
struct Curve {
    place: usize,
    /// Tool path: angle in degrees, X on the radius in mm.
    path: Vec<(f64, f64)>,
    /// Where the groove's ground was before and is after the pass, depth in mm.
    before: Vec<f64>,
    after: Vec<f64>,
    /// In the air by depth only, and with the full section.
    air: [Vec<bool>; 2],
}

impl Picture for PositionPicture<'_> {
    fn name(&self) -> String {
        format!("{}-position", self.groove.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let groove = self.groove;
        let title = "X over the spindle angle, at the same place on the work";
        let body = theme::headline(area, scale, title, &groove.subtitle())?;
        let passes = groove.legend();
        let entries: Vec<_> = passes.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let entries = [
            (Swatch::Line, theme::GOOD, "in the air with the full section: the chip is cut through"),
            (Swatch::Line, theme::BAD, "tip in the air, flank still cutting: a ribbon holds the chip together"),
            (Swatch::Dashed, theme::MUTED, "surface of the work"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        self.draw_panel(&body, scale)
    }
}

impl PositionPicture<'_> {
    fn radius_mm(&self, depth_mm: f64) -> f64 {
        self.groove.job.geometry.radius_mm(depth_mm, 0.0)
    }

    fn curves(&self) -> Vec<Curve> {
        let groove = self.groove;
        let angles: Vec<f64> =
            (0..=POINTS).map(|step| groove.shown_deg() * f64::from(step) / f64::from(POINTS)).collect();
        let mut ground = vec![0.0; angles.len()];
        let mut curves = Vec::with_capacity(groove.passes.len());
        for (place, &index) in groove.passes.iter().enumerate() {
            let tips: Vec<f64> = angles.iter().map(|angle| groove.tip_mm(index, *angle)).collect();
            let after: Vec<f64> =
                ground.iter().zip(&tips).map(|(ground, tip): (&f64, &f64)| ground.max(*tip)).collect();
            let air = groove.clearances(index).map(|clearance| {
                let in_air = |angle: &f64| clearance.at_mm(groove.phase_deg(*angle)) >= 0.0;
                angles.iter().map(in_air).collect()
            });
            let path = angles.iter().zip(&tips).map(|(angle, tip)| (*angle, self.radius_mm(*tip))).collect();
            let before = std::mem::replace(&mut ground, after.clone());
            curves.push(Curve { place, path, before, after, air });
        }
        curves
    }

    fn draw_panel<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let curves = self.curves();
        let surface_mm = self.radius_mm(0.0);
        let values = || curves.iter().flat_map(|curve| &curve.path).map(|point| point.1).chain([surface_mm]);
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let shown_deg = self.groove.shown_deg();
        let x = AxisSpec::new("spindle angle, degrees", 0.0..shown_deg * 1.06);
        let y = AxisSpec::new("X (radius), mm", theme::padded(low, high, 0.06));
        let title = "filled: what each pass cuts, depth only; an island is a chip";
        let mut chart = theme::panel(area, scale, title, &x, &y)?;
        for curve in &curves {
            let fill = self.groove.color(curve.place).mix(0.45).filled();
            let cuts = |index: usize| curve.after[index] > curve.before[index];
            let tops: Vec<(f64, f64)> =
                curve.path.iter().zip(&curve.before).map(|(point, depth)| (point.0, self.radius_mm(*depth))).collect();
            // One polygon for each chip: a single one with parts of no height confuses rasterizers.
            for (top, ground) in stretches(&tops, cuts).into_iter().zip(stretches(&self.grounds(curve), cuts)) {
                let outline: Vec<_> = top.into_iter().chain(ground.into_iter().rev()).collect();
                chart.draw_series([Polygon::new(outline, fill)])?;
            }
        }
        let surface = [(0.0, surface_mm), (shown_deg, surface_mm)];
        let dashes = DashedPathElement::new(surface, scale.px(10.0), scale.px(6.0), scale.stroke(theme::MUTED, 1.4));
        chart.draw_series([dashes])?;
        for curve in &curves {
            theme::curve(&mut chart, &curve.path, scale.stroke(self.groove.color(curve.place), 2.0))?;
            let [depth, section] = &curve.air;
            for ribbon in stretches(&curve.path, |index| depth[index] && !section[index]) {
                theme::curve(&mut chart, &ribbon, scale.stroke(theme::BAD, 4.0))?;
            }
            for air in stretches(&curve.path, |index| section[index]) {
                theme::curve(&mut chart, &air, scale.stroke(theme::GOOD, 4.0))?;
            }
        }
        self.draw_labels(&mut chart, scale, &curves, &y)
    }

    /// The ground after a pass.
    fn grounds(&self, curve: &Curve) -> Vec<(f64, f64)> {
        curve.path.iter().zip(&curve.after).map(|(point, depth)| (point.0, self.radius_mm(*depth))).collect()
    }

    /// Numbers of the passes at the right ends of their paths, apart from each other.
    fn draw_labels<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        scale: Scale,
        curves: &[Curve],
        y: &AxisSpec,
    ) -> DrawResult<(), DB> {
        let step_mm = (y.range.end - y.range.start) * 0.032;
        let mut labels: Vec<(f64, f64, usize)> =
            curves.iter().filter_map(|curve| curve.path.last().map(|end| (end.1, end.0, curve.place))).collect();
        labels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lowest = f64::NEG_INFINITY;
        for (end_mm, angle_deg, place) in labels {
            let at_mm = end_mm.max(lowest);
            lowest = at_mm + step_mm;
            if !y.range.contains(&at_mm) {
                continue;
            }
            let style = scale.text(15.0, self.groove.color(place)).pos(Pos::new(HPos::Left, VPos::Center));
            let text = Text::new(format!("pass {}", self.groove.passes[place] + 1), (scale.px(8.0), 0), style);
            chart.draw_series([EmptyElement::at((angle_deg, at_mm)) + text])?;
        }
        Ok(())
    }
}
