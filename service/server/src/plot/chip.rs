//! Picture of the chip: how thick it is around the revolution, and the tracks of the tool that make it so.

use feedwave_cutting::{CutCondition, thickness};
use plotters::coord::Shift;
use plotters::element::{PathElement, Polygon, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::DrawResult;
use super::canvas::Picture;
use super::theme::{self, AxisSpec, Scale, Swatch};

/// Revolutions shown.
const REVOLUTIONS: u32 = 4;
/// Points of a curve per revolution: enough for a hundred vibrations.
const POINTS_PER_REVOLUTION: u32 = 1_440;

/// One cut, with the words above its panels.
#[derive(Clone, Debug)]
pub struct Cut {
    /// What the cut is, as in "programmed: 50 Hz at 1000 rev/min".
    pub heading: String,
    /// What becomes of the chip, in one line.
    pub verdict: String,
    /// Whether the chip is cut through.
    pub broken: bool,
    /// The cut.
    pub condition: CutCondition,
}

/// Chip thickness of the programmed cut and, where that does not break the chip, of the suggested one beside it.
#[derive(Clone, Debug)]
pub(super) struct ChipPicture {
    pub(super) name: String,
    pub(super) subtitle: String,
    pub(super) cuts: Vec<Cut>,
}

impl Picture for ChipPicture {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let title = "Chip thickness around the revolution";
        let body = theme::headline(area, scale, title, &self.subtitle)?;
        let entries = [
            (Swatch::Line, theme::COMMAND, "chip thickness"),
            (Swatch::Fill, theme::COMMAND, "material cut"),
            (Swatch::Fill, theme::BAD, "air: the chip is cut through"),
        ];
        let body = theme::legend(&body, scale, &entries)?;
        // One scale for all, so that the cuts can be compared.
        let curves: Vec<_> = self.cuts.iter().map(|cut| thickness_curve(&cut.condition)).collect();
        let values = || curves.iter().flatten().map(|point| point.1);
        let low = values().fold(0.0, f64::min);
        let high = values().fold(0.0, f64::max);
        let y = AxisSpec::new("chip thickness h, mm", theme::padded(low, high, 0.1));
        let columns = body.split_evenly((1, self.cuts.len().max(1)));
        for ((area, cut), curve) in columns.iter().zip(&self.cuts).zip(curves) {
            draw_cut(area, scale, cut, curve, &y)?;
        }
        Ok(())
    }
}

fn draw_cut<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    cut: &Cut,
    curve: Vec<(f64, f64)>,
    y: &AxisSpec,
) -> DrawResult<(), DB> {
    let anchor = Pos::new(HPos::Left, VPos::Top);
    let left = scale.px(theme::PANEL_LEFT);
    let color = if cut.broken { theme::GOOD } else { theme::BAD };
    area.draw(&Text::new(cut.heading.clone(), (left, scale.px(12.0)), scale.text(18.0, theme::INK).pos(anchor)))?;
    area.draw(&Text::new(cut.verdict.clone(), (left, scale.px(36.0)), scale.text(16.0, color).pos(anchor)))?;
    let (_, area) = area.split_vertically(scale.px(54.0));
    let (upper, lower) = area.split_vertically(area.dim_in_pixel().1 * 52 / 100);

    let x = AxisSpec::new("spindle angle, revolutions", 0.0..f64::from(REVOLUTIONS));
    let mut chart = theme::panel(&upper, scale, "thickness over several revolutions", &x, y)?;
    fill_to_zero(&mut chart, &curve, theme::COMMAND, |value| value.max(0.0))?;
    fill_to_zero(&mut chart, &curve, theme::BAD, |value| value.min(0.0))?;
    let zero = vec![(x.range.start, 0.0), (x.range.end, 0.0)];
    chart.draw_series([PathElement::new(zero, scale.stroke(theme::INK, 1.2))])?;
    theme::curve(&mut chart, &curve, scale.stroke(theme::COMMAND, 2.0))?;

    draw_tracks(&lower, scale, &cut.condition)
}

/// Fills between the curve and zero, one side of zero at a time.
fn fill_to_zero<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    curve: &[(f64, f64)],
    color: RGBColor,
    side: impl Fn(f64) -> f64,
) -> DrawResult<(), DB> {
    let fill = color.mix(0.25).filled();
    // One polygon per stretch: a single one with parts of no height confuses rasterizers.
    for stretch in curve.split(|point| side(point.1) == 0.0).filter(|stretch| stretch.len() > 1) {
        let (first, last) = (stretch[0].0, stretch[stretch.len() - 1].0);
        let outline = std::iter::once((first, 0.0)).chain(stretch.iter().copied()).chain([(last, 0.0)]);
        chart.draw_series([Polygon::new(outline.collect::<Vec<_>>(), fill)])?;
    }
    Ok(())
}

fn draw_tracks<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    scale: Scale,
    condition: &CutCondition,
) -> DrawResult<(), DB> {
    let tracks: Vec<Vec<(f64, f64)>> = (0..REVOLUTIONS).map(|revolution| track(condition, revolution)).collect();
    let values = || tracks.iter().flatten().map(|point| point.1);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let x = AxisSpec::new("spindle angle within the revolution, degrees", 0.0..360.0);
    let y = AxisSpec::new("tool position, mm", theme::padded(low, high, 0.08));
    let title = "tracks of successive revolutions (the latest darkest): where they meet, the chip breaks";
    let mut chart = theme::panel(area, scale, title, &x, &y)?;
    for (revolution, track) in (0_u32..).zip(tracks) {
        // The newest track stands out, earlier ones fade.
        let strength = 0.3 + 0.7 * f64::from(revolution + 1) / f64::from(REVOLUTIONS);
        let style = scale.stroke(theme::VIBRATION.mix(strength), 2.0);
        chart.draw_series([PathElement::new(track, style)])?;
    }
    Ok(())
}

/// h over the spindle angle in revolutions.
fn thickness_curve(condition: &CutCondition) -> Vec<(f64, f64)> {
    let vibrations_per_rev = condition.vibrations_per_rev();
    (0..=REVOLUTIONS * POINTS_PER_REVOLUTION)
        .map(|step| {
            let revolutions = f64::from(step) / f64::from(POINTS_PER_REVOLUTION);
            (revolutions, thickness(condition, std::f64::consts::TAU * vibrations_per_rev * revolutions))
        })
        .collect()
}

/// Position of the tool over the angle within one revolution (path vibration page, "Will the chip break?").
fn track(condition: &CutCondition, revolution: u32) -> Vec<(f64, f64)> {
    (0..=POINTS_PER_REVOLUTION)
        .map(|step| {
            let share = f64::from(step) / f64::from(POINTS_PER_REVOLUTION);
            let revolutions = f64::from(revolution) + share;
            let phase_rad = std::f64::consts::TAU * condition.vibrations_per_rev() * revolutions;
            let position = condition.feed_per_rev_mm * revolutions + condition.amplitude_mm * phase_rad.sin();
            (360.0 * share, position)
        })
        .collect()
}
