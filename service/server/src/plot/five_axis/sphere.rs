//! Tool directions on the sphere: where they lie, and close up what they do as programmed and thinned.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use feedwave_motion::kinematics::vector::{Vec3, angle, cross, dot, norm, scale as scaled, unit};
use plotters::chart::ChartBuilder;
use plotters::coord::Shift;
use plotters::element::{Circle, EmptyElement, Polygon, Text};
use plotters::prelude::{DrawingArea, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::super::DrawResult;
use super::super::canvas::Picture;
use super::super::theme::{self, AxisSpec, Scale, Swatch};
use super::super::tool_path::same_scale;
use super::super::trace::PathTrace;
use super::{AS_RUN, FiveAxisPlots};

/// Meridians and parallels, degrees apart.
const GRID_DEG: u32 = 15;
/// Chords of a circle on the globe.
const CHORDS: u32 = 120;
/// Half of the globe's panel, in radii.
const GLOBE_ROOM: f64 = 1.12;
/// How far the globe is turned from the directions: away from the nearer pole, and to the side.
const TURN_DEG: (f64, f64) = (32.0, 24.0);

pub(super) struct SpherePicture<'a> {
    pub(super) program: &'a str,
    pub(super) plots: &'a FiveAxisPlots,
}

/// Unit vectors to the right, upwards and towards the eye.
#[derive(Clone, Copy, Debug)]
struct Eye {
    right: Vec3,
    up: Vec3,
    out: Vec3,
}

impl Eye {
    /// Looks at the sphere from a direction, the pole upwards.
    fn at(out: Vec3, pole: Vec3) -> Self {
        let across = |way: Vec3| unit(cross(way, out));
        let right = across(pole).or_else(|| across([0.0, 1.0, 0.0])).unwrap_or([1.0, 0.0, 0.0]);
        Self { right, up: cross(out, right), out }
    }

    /// The globe as it is seen from far away; nothing for the far side.
    fn globe(&self, direction: Vec3) -> Option<(f64, f64)> {
        (dot(direction, self.out) > 0.0).then(|| (dot(direction, self.right), dot(direction, self.up)))
    }

    /// The direction at a place of the map, degrees.
    fn at_place(&self, (x_deg, y_deg): (f64, f64)) -> Vec3 {
        let away_deg = x_deg.hypot(y_deg);
        let (sine, cosine) = away_deg.to_radians().sin_cos();
        let share = if away_deg > 0.0 { sine / away_deg } else { 0.0 };
        [0, 1, 2].map(|axis| cosine * self.out[axis] + share * (x_deg * self.right[axis] + y_deg * self.up[axis]))
    }

    /// The outline of a map.
    fn frame(&self, x: &Range<f64>, y: &Range<f64>) -> Vec<Vec3> {
        let corners = [(x.start, y.start), (x.end, y.start), (x.end, y.end), (x.start, y.end), (x.start, y.start)];
        let sides = corners.windows(2).flat_map(|side| {
            let (from, to) = (side[0], side[1]);
            (0..=CHORDS).map(move |step| {
                let share = f64::from(step) / f64::from(CHORDS);
                (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1))
            })
        });
        sides.map(|place| self.at_place(place)).collect()
    }

    /// A map around the eye's direction: angles from there in their true size and sense, degrees.
    fn map(&self, direction: Vec3) -> (f64, f64) {
        let flat = (dot(direction, self.right), dot(direction, self.up));
        let length = flat.0.hypot(flat.1);
        let away_deg = angle(direction, self.out).to_degrees();
        if length > 0.0 { (flat.0 / length * away_deg, flat.1 / length * away_deg) } else { (0.0, 0.0) }
    }
}

/// Middle of all directions.
fn middle(trace: &PathTrace) -> Vec3 {
    let points = trace.runs().iter().flat_map(|run| &run.points);
    let (mut least, mut greatest) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        least = [0, 1, 2].map(|axis| least[axis].min(point[axis]));
        greatest = [0, 1, 2].map(|axis| greatest[axis].max(point[axis]));
    }
    unit([0, 1, 2].map(|axis| least[axis] + greatest[axis])).unwrap_or([0.0, 0.0, 1.0])
}

impl Picture for SpherePicture<'_> {
    fn name(&self) -> String {
        "tool-direction".to_owned()
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB> {
        let plots = self.plots;
        let letter = plots.setup.letters[0];
        let subtitle = format!(
            "{} \u{b7} while cutting, seen from the work \u{b7} pole: the {letter} axis \u{b7} close up: angles from the \
             middle, in their true size",
            self.program
        );
        let body = theme::headline(area, scale, "Tool direction on the sphere", &subtitle)?;
        let entries: Vec<_> = plots.plans().map(|(_, color, name)| (Swatch::Line, color, name)).collect();
        let body = theme::legend(&body, scale, &entries)?;
        let (width, height) = body.dim_in_pixel();
        let (left, right) = body.split_horizontally(width * 36 / 100);
        let globe_px = left.dim_in_pixel().0.min(height);
        let (_, globe) = left.split_vertically((height - globe_px) / 2);
        let (globe, _) = globe.split_vertically(globe_px);

        let center = middle(&plots.as_run.directions);
        let axis = plots.setup.on_work(plots.setup.directions.first_axis());
        let pole = if dot(axis, center) < 0.0 { scaled(axis, -1.0) } else { axis };
        let map = Eye::at(center, pole);
        let (x, y) = self.extent(&map);
        let panels = right.split_evenly((plots.plans().count(), 1));
        let (x, y) = same_scale(panels[0].dim_in_pixel(), scale, x, y);
        self.draw_globe(&globe, scale, (center, pole), &map.frame(&x, &y))?;
        for ((plan, color, name), panel) in plots.plans().zip(&panels) {
            let (x, y) =
                (AxisSpec::new("across, degrees", x.clone()), AxisSpec::new("towards the pole, degrees", y.clone()));
            let mut chart = theme::panel(panel, scale, name, &x, &y)?;
            for run in plan.directions.runs() {
                let points: Vec<_> = run.points.iter().map(|point| map.map(*point)).collect();
                theme::curve(&mut chart, &points, scale.stroke(color, 1.4))?;
            }
        }
        Ok(())
    }
}

impl SpherePicture<'_> {
    /// What the maps show, degrees.
    fn extent(&self, map: &Eye) -> (Range<f64>, Range<f64>) {
        let mut low = (f64::INFINITY, f64::INFINITY);
        let mut high = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for (plan, _, _) in self.plots.plans() {
            for point in plan.directions.runs().iter().flat_map(|run| &run.points) {
                let (x, y) = map.map(*point);
                low = (low.0.min(x), low.1.min(y));
                high = (high.0.max(x), high.1.max(y));
            }
        }
        (theme::padded(low.0, high.0, 0.0), theme::padded(low.1, high.1, 0.0))
    }

    fn draw_globe<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
        scale: Scale,
        (center, pole): (Vec3, Vec3),
        frame_of_maps: &[Vec3],
    ) -> DrawResult<(), DB> {
        let mut chart = ChartBuilder::on(area)
            .margin(scale.px(8.0))
            .build_cartesian_2d(-GLOBE_ROOM..GLOBE_ROOM, -GLOBE_ROOM..GLOBE_ROOM)?;
        let circle = |radius: f64| {
            (0..=CHORDS)
                .map(move |step| TAU * f64::from(step) / f64::from(CHORDS))
                .map(move |turn| (radius * turn.cos(), radius * turn.sin()))
        };
        chart.draw_series([Polygon::new(circle(1.0).collect::<Vec<_>>(), theme::RAPID.mix(0.10).filled())])?;
        let frame =
            Eye::at(pole, if norm(cross(pole, [1.0, 0.0, 0.0])) > 1e-6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] });
        let at = |tilt_rad: f64, turn_rad: f64| -> Vec3 {
            let (sine, cosine) = tilt_rad.sin_cos();
            [0, 1, 2].map(|axis| {
                cosine * pole[axis] + sine * (turn_rad.cos() * frame.right[axis] + turn_rad.sin() * frame.up[axis])
            })
        };
        // Turned away from the directions, so that their place on the sphere is plain.
        let tilt_rad = angle(center, pole);
        let turn_rad = dot(center, frame.up).atan2(dot(center, frame.right));
        let (away_rad, aside_rad) = (TURN_DEG.0.to_radians(), TURN_DEG.1.to_radians());
        let away_rad = if tilt_rad < 0.5 * PI { away_rad } else { -away_rad };
        let eye = Eye::at(at(tilt_rad + away_rad, turn_rad + aside_rad), pole);
        let steps = || (0..=CHORDS).map(|step| f64::from(step) / f64::from(CHORDS));
        let grid = scale.stroke(theme::RAPID.mix(0.7), 1.0);
        let equator = scale.stroke(theme::MUTED, 1.2);
        for tilt_deg in (GRID_DEG..180).step_by(GRID_DEG as usize) {
            let line: Vec<_> = steps().map(|share| at(f64::from(tilt_deg).to_radians(), TAU * share)).collect();
            draw_visible(&mut chart, &eye, &line, if tilt_deg == 90 { equator } else { grid })?;
        }
        for turn_deg in (0..360).step_by(2 * GRID_DEG as usize) {
            // Meridians end beside the poles, where they would run into each other.
            let share = f64::from(GRID_DEG) / 180.0;
            let line: Vec<_> = steps()
                .map(|place| at(PI * (share + (1.0 - 2.0 * share) * place), f64::from(turn_deg).to_radians()))
                .collect();
            draw_visible(&mut chart, &eye, &line, grid)?;
        }
        theme::curve(&mut chart, &circle(1.0).collect::<Vec<_>>(), scale.stroke(theme::MUTED, 1.6))?;
        for run in self.plots.as_run.directions.runs() {
            draw_visible(&mut chart, &eye, &run.points, scale.stroke(AS_RUN, 1.2))?;
        }
        draw_visible(&mut chart, &eye, frame_of_maps, scale.stroke(theme::INK, 1.4))?;
        if let Some(place) = eye.globe(pole) {
            chart.draw_series([Circle::new(place, scale.px(4.0), theme::INK.filled())])?;
            let label = format!("{} axis", self.plots.setup.letters[0]);
            draw_label(&mut chart, scale, place, &label, theme::INK)?;
        }
        for tilt_deg in [30, 60, 90] {
            // Beside the directions.
            if let Some(place) = eye.globe(at(f64::from(tilt_deg).to_radians(), turn_rad + 2.0 * aside_rad)) {
                draw_label(&mut chart, scale, place, &format!("{tilt_deg}°"), theme::MUTED)?;
            }
        }
        Ok(())
    }
}

fn draw_label<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    scale: Scale,
    place: (f64, f64),
    label: &str,
    color: RGBColor,
) -> DrawResult<(), DB> {
    let style = scale.text(14.0, color).pos(Pos::new(HPos::Left, VPos::Bottom));
    let text = Text::new(label.to_owned(), (scale.px(7.0), scale.px(-3.0)), style);
    chart.draw_series([EmptyElement::at(place) + text])?;
    Ok(())
}

/// Draws what of a line on the sphere is on the near side.
fn draw_visible<'a, DB: DrawingBackend + 'a>(
    chart: &mut theme::Panel<'a, DB>,
    eye: &Eye,
    line: &[Vec3],
    style: plotters::style::ShapeStyle,
) -> DrawResult<(), DB> {
    let mut part = Vec::new();
    for point in line {
        match eye.globe(*point) {
            Some(place) => part.push(place),
            None => theme::curve(chart, &std::mem::take(&mut part), style)?,
        }
    }
    theme::curve(chart, &part, style)
}
