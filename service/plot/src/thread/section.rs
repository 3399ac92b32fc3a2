//! Section of the groove: what each pass removes with the tool at its deepest, and at the spindle phase at which most
//! is left for the finishing pass.

use std::ops::Range;

use plotters::style::RGBColor;

use super::super::figure::{Axis, Beside, Figure, Layout, MM, Panel, Place};
use super::super::theme::{self, Ink};
use super::{Groove, stretches};

/// Places across the groove.
const PLACES: u32 = 1_200;
/// Phases examined to find the worst one.
const PHASES: u32 = 720;

/// Section of the groove.
pub(super) struct SectionPicture<'a> {
    pub(super) groove: &'a Groove<'a>,
}

/// What one pass removes: its place among the passes, and the ground before and after, depth in mm over the places.
struct Removed {
    place: usize,
    before: Vec<f64>,
    after: Vec<f64>,
}

impl SectionPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let groove = self.groove;
        let title = "Section of the groove: what each pass removes";
        let subtitle = format!("{} \u{b7} both axes to the same scale", groove.subtitle());
        let body = Layout::row(vec![self.nominal(), self.worst()]);
        Figure::new(format!("{}-section", groove.name), title, subtitle, body)
    }

    /// Place across the groove of a pass' tip, mm along the lead from the first pass.
    fn tip_along_mm(&self, index: usize) -> f64 {
        self.groove.job.geometry.direction() * self.groove.report.passes[index].place.axial_offset_mm
    }

    fn depth_at_mm(&self, index: usize, tip_mm: f64, along_mm: f64) -> f64 {
        self.groove.job.profile.depth_at_mm(tip_mm, along_mm - self.tip_along_mm(index))
    }

    /// What is shown along the lead: the widest groove with a margin.
    fn range_along(&self) -> Range<f64> {
        let edges = self.groove.passes.iter().map(|&index| {
            let half_mm = 0.5 * self.groove.job.profile.width_mm(self.groove.pass(index).depth_mm);
            let tip_mm = self.tip_along_mm(index);
            (tip_mm - half_mm, tip_mm + half_mm)
        });
        let (low, high) =
            edges.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), edge| (low.min(edge.0), high.max(edge.1)));
        let room_mm = 0.12 * (high - low);
        low - room_mm..high + room_mm
    }

    fn places(&self) -> Vec<f64> {
        let range = self.range_along();
        let step = |step: u32| range.start + (range.end - range.start) * f64::from(step) / f64::from(PLACES);
        (0..=PLACES).map(step).collect()
    }

    /// What each pass removes when its tip goes to a depth.
    fn removed(&self, places: &[f64], tip_mm: impl Fn(usize) -> f64) -> Vec<Removed> {
        let mut ground = vec![0.0_f64; places.len()];
        let mut removed = Vec::with_capacity(self.groove.passes.len());
        for (place, &index) in self.groove.passes.iter().enumerate() {
            let tip_mm = tip_mm(index);
            let deepened =
                places.iter().zip(&ground).map(|(z, ground)| ground.max(self.depth_at_mm(index, tip_mm, *z)));
            let after: Vec<f64> = deepened.collect();
            let before = std::mem::replace(&mut ground, after.clone());
            removed.push(Removed { place, before, after });
        }
        removed
    }

    /// Spindle angle, degrees, at which the pass after the last vibrating one finds the most.
    fn worst_angle_deg(&self) -> f64 {
        let Some(last) = self.groove.passes.iter().rposition(|index| self.groove.pass(*index).vibrates()) else {
            return 0.0;
        };
        let deepest_mm = |angle_deg: f64| {
            let tips = self.groove.passes[..=last].iter().map(|index| self.groove.tip_mm(*index, angle_deg));
            tips.fold(0.0, f64::max)
        };
        let period_deg = 360.0 / self.groove.job.vibrations_per_rev;
        let angles = (0..PHASES).map(|step| period_deg * f64::from(step) / f64::from(PHASES));
        let depths = angles.map(|angle_deg| (angle_deg, deepest_mm(angle_deg)));
        depths.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |worst| worst.0)
    }

    fn nominal(&self) -> Panel {
        let places = self.places();
        let removed = self.removed(&places, |index| self.groove.pass(index).depth_mm);
        let mut panel = self.panel("tool at its deepest in every pass");
        self.fill_removed(&mut panel, &places, &removed);
        let highest = Ink::dashed("tool of a vibrating pass at its highest", theme::INK, 1.4);
        for &index in &self.groove.passes {
            let pass = self.groove.pass(index);
            let outline = self.outline(index, pass.depth_mm - pass.amplitude_mm);
            if pass.vibrates() && outline.len() > 1 {
                panel.path(&highest, outline);
            }
        }
        self.finished(&mut panel, &places, &removed);
        self.number(&mut panel, &places, &removed);
        panel
    }

    fn worst(&self) -> Panel {
        let groove = self.groove;
        let places = self.places();
        let angle_deg = self.worst_angle_deg();
        let removed = self.removed(&places, |index| groove.tip_mm(index, angle_deg));
        let left = groove.report.crests.map(|crests| {
            format!(
                ": crests {} mm, with flanks {} mm",
                super::short(crests.crest_mm),
                super::short(crests.section_crest_mm)
            )
        });
        let title = format!("most is left at {angle_deg:.0} degrees{}", left.unwrap_or_default());
        let mut panel = self.panel(&title);
        self.fill_removed(&mut panel, &places, &removed);
        let nominal = self.removed(&places, |index| groove.pass(index).depth_mm);
        self.finished(&mut panel, &places, &nominal);
        if let Some(last) = removed.iter().rposition(|one| groove.pass(groove.passes[one.place]).vibrates()) {
            let ground: Vec<_> =
                places.iter().zip(&removed[last].after).map(|(z, depth)| self.at(*z, *depth)).collect();
            let ink = Ink::line("left by the vibrating passes for the finishing pass", theme::BAD, 3.4);
            for line in stretches(&ground, |place| removed[last].after[place] > 0.0) {
                panel.path(&ink, line);
            }
        }
        self.number(&mut panel, &places, &removed);
        panel
    }

    /// A point of the section: along the lead from the tip of the first pass, and across it.
    fn at(&self, along_mm: f64, depth_mm: f64) -> Place {
        (along_mm, self.groove.job.geometry.across_mm(depth_mm, 0.0))
    }

    fn panel(&self, title: &str) -> Panel {
        let deepest_mm = self.groove.deepest_mm();
        let edges = [self.at(0.0, -0.08 * deepest_mm).1, self.at(0.0, 1.08 * deepest_mm).1];
        let y = edges[0].min(edges[1])..edges[0].max(edges[1]);
        let along = self.groove.job.geometry.lead_axis.along().letter();
        let z = Axis::new(format!("along {along} from the tip of the first pass"), MM, self.range_along());
        let mut panel = Panel::new(title, z, Axis::new(self.groove.across_name(), MM, y)).in_proportion();
        // The work, where nothing was cut.
        let surface_mm = self.at(0.0, 0.0).1;
        let inside = if self.at(0.0, 1.0).1 < surface_mm { f64::NEG_INFINITY } else { f64::INFINITY };
        let work = Ink::fill("work", theme::RAPID, 0.3);
        let (left, right) = (f64::NEG_INFINITY, f64::INFINITY);
        panel.area(&work, vec![(left, surface_mm), (right, surface_mm), (right, inside), (left, inside)]);
        panel
    }

    fn fill_removed(&self, panel: &mut Panel, places: &[f64], removed: &[Removed]) {
        let paper = Ink::fill("", WHITE, 1.0);
        let least_mm = LEAST_SEEN * self.groove.deepest_mm();
        for one in removed {
            let cuts = |place: usize| one.after[place] > one.before[place] + least_mm;
            let line = |depths: &[f64]| -> Vec<Place> {
                places.iter().zip(depths).map(|(z, depth)| self.at(*z, *depth)).collect()
            };
            let (tops, grounds) = (stretches(&line(&one.before), cuts), stretches(&line(&one.after), cuts));
            for (top, ground) in tops.into_iter().zip(grounds) {
                let outline: Vec<_> = top.into_iter().chain(ground.into_iter().rev()).collect();
                panel.area(&paper, outline.clone());
                panel.area(&self.groove.fill(one.place), outline);
            }
        }
    }

    fn finished(&self, panel: &mut Panel, places: &[f64], nominal: &[Removed]) {
        let Some(last) = nominal.last() else { return };
        let line: Vec<_> = places.iter().zip(&last.after).map(|(z, depth)| self.at(*z, *depth)).collect();
        panel.endless(&Ink::line("finished groove", theme::INK, 2.0), line);
    }

    /// Outline of the tool at a depth, from surface to surface.
    fn outline(&self, index: usize, tip_mm: f64) -> Vec<Place> {
        if tip_mm <= 0.0 {
            return Vec::new();
        }
        let (tip_along_mm, flat_mm) = (self.tip_along_mm(index), 0.5 * self.groove.job.profile.root_flat_mm);
        let half_mm = 0.5 * self.groove.job.profile.width_mm(tip_mm);
        let corners = [(-half_mm, 0.0), (-flat_mm, tip_mm), (flat_mm, tip_mm), (half_mm, 0.0)];
        corners.map(|(along_mm, depth_mm)| self.at(tip_along_mm + along_mm, depth_mm)).to_vec()
    }

    /// The number of each pass in what it removes, where there is space.
    fn number(&self, panel: &mut Panel, places: &[f64], removed: &[Removed]) {
        let deepest_mm = self.groove.deepest_mm();
        // What lies along a flank is thinner than it is high.
        let slender = (0.5 * self.groove.job.profile.included_angle_deg).to_radians().sin();
        for one in removed {
            let heights = one.after.iter().zip(&one.before).map(|(after, before)| after - before);
            let Some((thickest, height_mm)) = heights.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            if height_mm * slender < 0.07 * deepest_mm {
                continue;
            }
            let middle_mm = 0.5 * (one.after[thickest] + one.before[thickest]);
            let text = (self.groove.passes[one.place] + 1).to_string();
            panel.label(self.at(places[thickest], middle_mm), text, theme::INK, Beside::CENTER);
        }
    }
}

/// Least thickness that is drawn, as a share of the deepest pass.
const LEAST_SEEN: f64 = 1e-3;
const WHITE: RGBColor = RGBColor(255, 255, 255);
