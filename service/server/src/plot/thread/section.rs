//! Section of the groove: what each pass removes with the tool at its deepest, and at the spindle phase at which most
//! is left for the finishing pass.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::element::{DashedPathElement, EmptyElement, PathElement, Polygon, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::super::tool_path::same_scale;
use super::{Groove, stretches};

/// Places across the groove.
const PLACES: u32 = 1_200;
/// Phases looked at to find the worst one.
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

impl Picture for SectionPicture<'_> {
    fn name(&self) -> String {
        format!("{}-section", self.groove.name)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let groove = self.groove;
        let title = "Section of the groove: what each pass removes";
        let body = theme::headline(area, scale, title, &groove.subtitle())?;
        let passes = groove.legend();
        let entries: Vec<_> = passes.iter().map(|(swatch, color, label)| (*swatch, *color, label.as_str())).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let entries = [
            (Swatch::Line, theme::INK, "finished groove"),
            (Swatch::Dashed, theme::MUTED, "tool of a pass at its highest, with all of its retreat"),
            (Swatch::Line, theme::BAD, "left by the vibrating passes for the finishing pass"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        let (left, right) = body.split_horizontally(body.dim_in_pixel().0 / 2);
        self.draw_nominal(&left, scale)?;
        self.draw_worst(&right, scale)
    }
}

impl SectionPicture<'_> {
    /// Place across the groove of a pass' tip, mm along Z from the first pass.
    fn tip_z_mm(&self, index: usize) -> f64 {
        self.groove.job.geometry.direction() * self.groove.report.passes[index].place.axial_offset_mm
    }

    fn depth_at_mm(&self, index: usize, tip_mm: f64, z_mm: f64) -> f64 {
        self.groove.job.profile.depth_at_mm(tip_mm, z_mm - self.tip_z_mm(index))
    }

    /// What is shown along Z: the widest groove with some room.
    fn range_z(&self) -> Range<f64> {
        let edges = self.groove.passes.iter().map(|&index| {
            let half_mm = 0.5 * self.groove.job.profile.width_mm(self.groove.pass(index).depth_mm);
            let tip_mm = self.tip_z_mm(index);
            (tip_mm - half_mm, tip_mm + half_mm)
        });
        let (low, high) =
            edges.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), edge| (low.min(edge.0), high.max(edge.1)));
        let room_mm = 0.12 * (high - low);
        low - room_mm..high + room_mm
    }

    fn places(&self) -> Vec<f64> {
        let range = self.range_z();
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

    fn draw_nominal<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let places = self.places();
        let removed = self.removed(&places, |index| self.groove.pass(index).depth_mm);
        let mut chart = self.panel(area, scale, "tool at its deepest in every pass")?;
        self.draw_removed(&mut chart, &places, &removed)?;
        for &index in &self.groove.passes {
            let pass = self.groove.pass(index);
            if !pass.vibrates() {
                continue;
            }
            let highest = self.outline(index, pass.depth_mm - pass.amplitude_mm);
            let style = scale.stroke(theme::MUTED, 1.2);
            if highest.len() > 1 {
                chart.draw_series([DashedPathElement::new(highest, scale.px(6.0), scale.px(5.0), style)])?;
            }
        }
        self.draw_finished(&mut chart, scale, &places, &removed)?;
        self.draw_numbers(&mut chart, scale, &removed)
    }

    fn draw_worst<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let groove = self.groove;
        let places = self.places();
        let angle_deg = self.worst_angle_deg();
        let removed = self.removed(&places, |index| groove.tip_mm(index, angle_deg));
        let left = groove
            .report
            .crests
            .map(|crests| format!(": crests {:.3} mm, with flanks {:.3} mm", crests.crest_mm, crests.section_crest_mm));
        let title = format!("most is left at {angle_deg:.0} degrees{}", left.unwrap_or_default());
        let mut chart = self.panel(area, scale, &title)?;
        self.draw_removed(&mut chart, &places, &removed)?;
        let nominal = self.removed(&places, |index| groove.pass(index).depth_mm);
        self.draw_finished(&mut chart, scale, &places, &nominal)?;
        if let Some(last) = removed.iter().rposition(|one| groove.pass(groove.passes[one.place]).vibrates()) {
            let ground: Vec<_> =
                places.iter().zip(&removed[last].after).map(|(z, depth)| self.at(*z, *depth)).collect();
            for line in stretches(&ground, |place| removed[last].after[place] > 0.0) {
                theme::curve(&mut chart, &line, scale.stroke(theme::BAD, 3.0))?;
            }
        }
        self.draw_numbers(&mut chart, scale, &removed)
    }

    /// A point of the section: Z from the tip of the first pass, X on the radius.
    fn at(&self, z_mm: f64, depth_mm: f64) -> (f64, f64) {
        (z_mm, self.groove.job.geometry.radius_mm(depth_mm, 0.0))
    }

    fn panel<'a, DB: DrawingBackend + 'a>(
        &self,
        area: &'a DrawingArea<DB, Shift>,
        scale: Scale,
        title: &str,
    ) -> DrawResult<theme::Panel<'a, DB>, DB> {
        let deepest_mm = self.groove.passes.iter().map(|index| self.groove.pass(*index).depth_mm).fold(0.0, f64::max);
        let edges = [self.at(0.0, -0.08 * deepest_mm).1, self.at(0.0, 1.08 * deepest_mm).1];
        let y = edges[0].min(edges[1])..edges[0].max(edges[1]);
        let (z, y) = same_scale(area.dim_in_pixel(), scale, self.range_z(), y);
        let z = AxisSpec::new("along Z from the tip of the first pass, mm", z);
        let chart = theme::panel(area, scale, title, &z, &AxisSpec::new("X (radius), mm", y.clone()))?;
        // The work, where nothing was cut.
        let body = [
            (z.range.start, self.at(0.0, 0.0).1),
            (z.range.end, self.at(0.0, 0.0).1),
            (z.range.end, self.inside(&y)),
            (z.range.start, self.inside(&y)),
        ];
        let mut chart = chart;
        chart.draw_series([Polygon::new(body.to_vec(), theme::RAPID.mix(0.28).filled())])?;
        Ok(chart)
    }

    /// The edge of the panel that lies in the work.
    fn inside(&self, y: &Range<f64>) -> f64 {
        if self.at(0.0, 1.0).1 < self.at(0.0, 0.0).1 { y.start } else { y.end }
    }

    fn draw_removed<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        places: &[f64],
        removed: &[Removed],
    ) -> DrawResult<(), DB> {
        for one in removed {
            let cuts = |place: usize| one.after[place] > one.before[place] + 1e-9;
            let line = |depths: &[f64]| -> Vec<(f64, f64)> {
                places.iter().zip(depths).map(|(z, depth)| self.at(*z, *depth)).collect()
            };
            let color: RGBColor = self.groove.color(one.place);
            let (tops, grounds) = (stretches(&line(&one.before), cuts), stretches(&line(&one.after), cuts));
            for (top, ground) in tops.into_iter().zip(grounds) {
                let outline: Vec<_> = top.into_iter().chain(ground.into_iter().rev()).collect();
                chart.draw_series([Polygon::new(outline.clone(), WHITE.filled())])?;
                chart.draw_series([Polygon::new(outline, color.mix(0.5).filled())])?;
            }
        }
        Ok(())
    }

    fn draw_finished<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        scale: Scale,
        places: &[f64],
        nominal: &[Removed],
    ) -> DrawResult<(), DB> {
        let Some(last) = nominal.last() else { return Ok(()) };
        let line: Vec<_> = places.iter().zip(&last.after).map(|(z, depth)| self.at(*z, *depth)).collect();
        chart.draw_series([PathElement::new(line, scale.stroke(theme::INK, 1.8))])?;
        Ok(())
    }

    /// Outline of the tool at a depth, from surface to surface.
    fn outline(&self, index: usize, tip_mm: f64) -> Vec<(f64, f64)> {
        if tip_mm <= 0.0 {
            return Vec::new();
        }
        let (tip_z_mm, flat_mm) = (self.tip_z_mm(index), 0.5 * self.groove.job.profile.root_flat_mm);
        let half_mm = 0.5 * self.groove.job.profile.width_mm(tip_mm);
        let corners = [(-half_mm, 0.0), (-flat_mm, tip_mm), (flat_mm, tip_mm), (half_mm, 0.0)];
        corners.map(|(z_mm, depth_mm)| self.at(tip_z_mm + z_mm, depth_mm)).to_vec()
    }

    /// The number of each pass in what it removes, where there is room.
    fn draw_numbers<'a, DB: DrawingBackend + 'a>(
        &self,
        chart: &mut theme::Panel<'a, DB>,
        scale: Scale,
        removed: &[Removed],
    ) -> DrawResult<(), DB> {
        let places = self.places();
        let deepest_mm = self.groove.passes.iter().map(|index| self.groove.pass(*index).depth_mm).fold(0.0, f64::max);
        // What lies along a flank is thinner than it is high.
        let slender = (0.5 * self.groove.job.profile.included_angle_deg).to_radians().sin();
        for one in removed {
            let heights = one.after.iter().zip(&one.before).map(|(after, before)| after - before);
            let Some((thickest, height_mm)) = heights.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            if height_mm * slender < 0.07 * deepest_mm {
                continue;
            }
            let middle_mm = 0.5 * (one.after[thickest] + one.before[thickest]);
            let style = scale.text(16.0, theme::INK).pos(Pos::new(HPos::Center, VPos::Center));
            let text = Text::new((self.groove.passes[one.place] + 1).to_string(), (0, 0), style);
            chart.draw_series([EmptyElement::at(self.at(places[thickest], middle_mm)) + text])?;
        }
        Ok(())
    }
}

const WHITE: RGBColor = RGBColor(255, 255, 255);
