//! X over the spindle angle: the paths of all passes at the same place on the work, what each of them cuts, and where
//! it cuts air.

use super::super::figure::{Axis, Beside, DEGREES, Figure, MM, Panel, Place, extent, padded};
use super::super::theme::{self, Ink};
use super::{Groove, cut_through, stretches};

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
    path: Vec<Place>,
    /// Where the groove's ground was before and is after the pass, depth in mm.
    before: Vec<f64>,
    after: Vec<f64>,
    /// In the air by depth only, and with the full section.
    air: [Vec<bool>; 2],
}

impl PositionPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let groove = self.groove;
        let axis = groove.job.geometry.lead_axis.across().letter();
        let title = format!("{axis} over the spindle angle, at the same place on the work");
        Figure::new(format!("{}-position", groove.name), title, groove.subtitle(), self.panel())
    }

    fn across_mm(&self, depth_mm: f64) -> f64 {
        self.groove.job.geometry.across_mm(depth_mm, 0.0)
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
            let path = angles.iter().zip(&tips).map(|(angle, tip)| (*angle, self.across_mm(*tip))).collect();
            let before = std::mem::replace(&mut ground, after.clone());
            curves.push(Curve { place, path, before, after, air });
        }
        curves
    }

    fn panel(&self) -> Panel {
        let groove = self.groove;
        let curves = self.curves();
        let surface_mm = self.across_mm(0.0);
        let values = curves.iter().flat_map(|curve| &curve.path).map(|point| point.1).chain([surface_mm]);
        let range = extent(values).map_or(0.0..1.0, |(low, high)| padded(low, high, 0.06));
        let shown_deg = groove.shown_deg();
        let x = Axis::new("spindle angle", DEGREES, 0.0..shown_deg * 1.07);
        let title = "filled: what each pass cuts, by its depth only; an island is a chip";
        let mut panel = Panel::new(title, x, Axis::new(groove.across_name(), MM, range));
        for curve in &curves {
            let cuts = |index: usize| curve.after[index] > curve.before[index];
            let tops: Vec<Place> =
                curve.path.iter().zip(&curve.before).map(|(point, depth)| (point.0, self.across_mm(*depth))).collect();
            // One polygon for each chip: a single one with parts of no height confuses rasterizers.
            for (top, ground) in stretches(&tops, cuts).into_iter().zip(stretches(&self.grounds(curve), cuts)) {
                panel.area(&groove.fill(curve.place), top.into_iter().chain(ground.into_iter().rev()).collect());
            }
        }
        let surface = Ink::dashed("surface of the work", theme::INK, 1.4);
        panel.endless(&surface, vec![(0.0, surface_mm), (shown_deg, surface_mm)]);
        let ribbon =
            Ink::dashed("tip in the air, flank still cutting: a ribbon holds the chip together", theme::BAD, 4.5);
        for curve in &curves {
            let path = Ink::line(groove.pass_name(curve.place), groove.color(curve.place), 2.2);
            panel.path(&path, curve.path.clone());
            let [depth, section] = &curve.air;
            for held in stretches(&curve.path, |index| depth[index] && !section[index]) {
                panel.path(&ribbon, held);
            }
            for air in stretches(&curve.path, |index| section[index]) {
                panel.path(&cut_through(), air);
            }
        }
        self.label(&mut panel, &curves);
        panel
    }

    /// The ground after a pass.
    fn grounds(&self, curve: &Curve) -> Vec<Place> {
        curve.path.iter().zip(&curve.after).map(|(point, depth)| (point.0, self.across_mm(*depth))).collect()
    }

    /// Numbers of the passes at the right ends of their paths, apart from each other.
    fn label(&self, panel: &mut Panel, curves: &[Curve]) {
        let step_mm = (panel.y.range.end - panel.y.range.start) * 0.036;
        let mut ends: Vec<(f64, f64, usize)> =
            curves.iter().filter_map(|curve| curve.path.last().map(|end| (end.1, end.0, curve.place))).collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lowest = f64::NEG_INFINITY;
        for (end_mm, angle_deg, place) in ends {
            let at_mm = end_mm.max(lowest);
            lowest = at_mm + step_mm;
            let text = format!("pass {}", self.groove.passes[place] + 1);
            panel.label((angle_deg, at_mm), text, theme::INK, Beside::RIGHT);
        }
    }
}
