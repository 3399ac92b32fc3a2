//! Picture of the chip of a vibration along the path: how thick it is around the revolution, and the tracks of the tool that make it so.

use feedwave_cutting::{CutCondition, thickness};
use plotters::style::RGBColor;

use super::figure::{Axis, DEGREES, Figure, Layout, MM, Panel, Place, REVOLUTIONS as TURNS, extent, padded};
use super::theme::{self, Ink};

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

impl ChipPicture {
    pub(super) fn figure(&self) -> Figure {
        // One scale for all, so that the cuts can be compared.
        let curves: Vec<_> = self.cuts.iter().map(|cut| thickness_curve(&cut.condition)).collect();
        let thickness = curves.iter().flatten().map(|point| point.1).chain([0.0]);
        let range = extent(thickness).map_or(0.0..1.0, |(low, high)| padded(low, high, 0.1));
        let columns = self.cuts.iter().zip(curves).map(|(cut, curve)| {
            let upper = thickness_panel(cut, curve, range.clone());
            (1.0, Layout::Column(vec![(0.55, upper.into()), (0.45, tracks(&cut.condition).into())]))
        });
        let title = "Chip thickness around the revolution";
        Figure::new(&self.name, title, &self.subtitle, Layout::Row(columns.collect())).with_height(960)
    }
}

fn thickness_panel(cut: &Cut, curve: Vec<Place>, range: std::ops::Range<f64>) -> Panel {
    let x = Axis::new("spindle angle", TURNS, 0.0..f64::from(REVOLUTIONS));
    let mut panel = Panel::new(&cut.heading, x, Axis::new("chip thickness h", MM, range));
    panel.note(&cut.verdict);
    let cutting = Ink::fill("material cut", theme::COMMAND, 0.22);
    fill_to_zero(&mut panel, &curve, &cutting, |value| value.max(0.0));
    let air = Ink::fill("air: the chip is cut through", theme::VIBRATION, 0.6);
    fill_to_zero(&mut panel, &curve, &air, |value| value.min(0.0));
    let zero = Ink::line("no thickness", theme::INK, 1.2);
    panel.endless(&zero, vec![(0.0, 0.0), (f64::from(REVOLUTIONS), 0.0)]);
    panel
        .path(&Ink::line("chip thickness; below 0 the distance of the tool from the work", theme::COMMAND, 2.2), curve);
    panel
}

/// Fills between the curve and zero, one side of zero at a time.
fn fill_to_zero(panel: &mut Panel, curve: &[Place], ink: &Ink, side: impl Fn(f64) -> f64) {
    // One polygon per stretch: a single one with parts of no height confuses rasterizers.
    for stretch in curve.split(|point| side(point.1) == 0.0).filter(|stretch| stretch.len() > 1) {
        let (first, last) = (stretch[0].0, stretch[stretch.len() - 1].0);
        let outline = std::iter::once((first, 0.0)).chain(stretch.iter().copied()).chain([(last, 0.0)]);
        panel.area(ink, outline.collect());
    }
}

fn tracks(condition: &CutCondition) -> Panel {
    let tracks: Vec<Vec<Place>> = (0..REVOLUTIONS).map(|revolution| track(condition, revolution)).collect();
    let positions = extent(tracks.iter().flatten().map(|point| point.1));
    let range = positions.map_or(0.0..1.0, |(low, high)| padded(low, high, 0.08));
    let x = Axis::new("spindle angle within the revolution", DEGREES, 0.0..360.0);
    let title = "tracks of successive revolutions: where they cross, the chip breaks";
    let mut panel = Panel::new(title, x, Axis::new("tool position", MM, range));
    for (revolution, track) in (0_u32..).zip(tracks) {
        // The newest track is highlighted, earlier ones fade.
        let share = f64::from(revolution + 1) / f64::from(REVOLUTIONS);
        let fade = |channel: u8| (255.0 - (0.25 + 0.75 * share) * (255.0 - f64::from(channel))).round() as u8;
        let RGBColor(red, green, blue) = theme::VIBRATION;
        let color = RGBColor(fade(red), fade(green), fade(blue));
        panel.path(&Ink::line(format!("track of revolution {}", revolution + 1), color, 1.4 + 1.4 * share), track);
    }
    panel
}

/// h over the spindle angle in revolutions.
fn thickness_curve(condition: &CutCondition) -> Vec<Place> {
    let vibrations_per_rev = condition.vibrations_per_rev();
    (0..=REVOLUTIONS * POINTS_PER_REVOLUTION)
        .map(|step| {
            let revolutions = f64::from(step) / f64::from(POINTS_PER_REVOLUTION);
            (revolutions, thickness(condition, std::f64::consts::TAU * vibrations_per_rev * revolutions))
        })
        .collect()
}

/// Position of the tool over the angle within one revolution (docs/functions/path-vibration.md, "Will the chip
/// break?").
fn track(condition: &CutCondition, revolution: u32) -> Vec<Place> {
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
