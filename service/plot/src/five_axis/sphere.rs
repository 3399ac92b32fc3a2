//! Tool directions on the sphere: where they lie, and close up what they do as programmed and thinned.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use super::super::figure::{Axis, Beside, DEGREES, Figure, Layout, Panel, Place, extent, padded};
use super::super::theme::{self, Ink};
use super::super::trace::PathTrace;
use super::FiveAxisPlots;
use feedwave_motion::kinematics::vector::{Vec3, angle, cross, dot, norm, scale as scaled, unit};

/// Meridians and parallels, degrees apart.
const GRID_DEG: u32 = 15;
/// Chords of a circle on the globe.
const CHORDS: u32 = 120;
/// Half of the globe's panel, in radii.
const GLOBE_SCALE: f64 = 1.12;
/// Curves over less than this hide each other on the globe.
const WIDE_DEG: f64 = 40.0;
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
        let across = |direction: Vec3| unit(cross(direction, out));
        let right = across(pole).or_else(|| across([0.0, 1.0, 0.0])).unwrap_or([1.0, 0.0, 0.0]);
        Self { right, up: cross(out, right), out }
    }

    /// The globe as it is seen from far away; nothing for the far side.
    fn globe(&self, direction: Vec3) -> Option<Place> {
        (dot(direction, self.out) > 0.0).then(|| (dot(direction, self.right), dot(direction, self.up)))
    }

    /// The direction at a place of the map, degrees.
    fn at_place(&self, (x_deg, y_deg): Place) -> Vec3 {
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
    fn map(&self, direction: Vec3) -> Place {
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

impl SpherePicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let plots = self.plots;
        let letter = plots.setup.letters[0];
        let subtitle = format!(
            "{} \u{b7} while cutting, seen from the work \u{b7} pole: the {letter} axis \u{b7} close up: angles from the \
             middle, in their true size",
            self.program
        );
        let center = middle(&plots.as_run.directions);
        let axis = plots.setup.on_work(plots.setup.directions.first_axis());
        let pole = if dot(axis, center) < 0.0 { scaled(axis, -1.0) } else { axis };
        let map = Eye::at(center, pole);
        let (x, y) = self.extent(&map);
        let maps = plots.plans().map(|(plan, ink)| {
            let across = Axis::new("across", DEGREES, x.clone());
            let towards = Axis::new("towards the pole", DEGREES, y.clone());
            let mut panel = Panel::new(ink.name.to_string(), across, towards).in_proportion();
            for run in plan.directions.runs() {
                panel.path(&ink, run.points.iter().map(|point| map.map(*point)).collect());
            }
            panel
        });
        let maps = Layout::column(maps.collect());
        let globe = self.globe((center, pole), &map.frame(&x, &y), (x.end - x.start).max(y.end - y.start) > WIDE_DEG);
        let body = Layout::Row(vec![(0.36, globe.into()), (0.64, maps)]);
        Figure::new("tool-direction", "Tool direction on the sphere", subtitle, body)
    }

    /// What the maps show, degrees.
    fn extent(&self, map: &Eye) -> (Range<f64>, Range<f64>) {
        let runs = self.plots.plans().flat_map(|(plan, _)| plan.directions.runs());
        let places: Vec<Place> = runs.flat_map(|run| run.points.iter().map(|point| map.map(*point))).collect();
        let range = |of: fn(&Place) -> f64| {
            extent(places.iter().map(of)).map_or(-1.0..1.0, |(low, high)| padded(low, high, 0.0))
        };
        (range(|place| place.0), range(|place| place.1))
    }

    /// The globe with the part that the maps show; with the curves themselves where it is `wide`.
    fn globe(&self, (center, pole): (Vec3, Vec3), frame_of_maps: &[Vec3], wide: bool) -> Panel {
        let mut panel = Panel::bare("", GLOBE_SCALE);
        let circle: Vec<Place> = (0..=CHORDS)
            .map(|step| TAU * f64::from(step) / f64::from(CHORDS))
            .map(|turn| (turn.cos(), turn.sin()))
            .collect();
        panel.area(&Ink::fill("", theme::RAPID, 0.10), circle.clone());
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
        let grid = Ink::line(format!("every {GRID_DEG} degrees from the pole"), theme::RAPID, 1.0);
        for line in grid_lines(at) {
            draw_visible(&mut panel, &eye, &line, &grid);
        }
        panel.path(&grid, circle);
        for (plan, ink) in self.plots.plans().filter(|_| wide) {
            for run in plan.directions.runs() {
                draw_visible(&mut panel, &eye, &run.points, &ink);
            }
        }
        let part = "directions while cutting: the part shown close up";
        if !wide {
            let outline = frame_of_maps.iter().filter_map(|point| eye.globe(*point)).collect();
            panel.area(&Ink::fill(part, theme::INK, 0.45), outline);
        }
        draw_visible(&mut panel, &eye, frame_of_maps, &Ink::line(part, theme::INK, 1.8));
        if let Some(place) = eye.globe(pole) {
            let name = format!("{} axis", self.plots.setup.letters[0]);
            panel.place(&Ink::dot("", theme::INK, 4.5), place);
            panel.label(place, name, theme::INK, Beside { by: (8.0, -3.0), ..Beside::INSIDE_BOTTOM });
        }
        for tilt_deg in [30, 60, 90] {
            // Beside the directions.
            if let Some(place) = eye.globe(at(f64::from(tilt_deg).to_radians(), turn_rad + 2.0 * aside_rad)) {
                panel.label(
                    place,
                    format!("{tilt_deg}°"),
                    theme::MUTED,
                    Beside { by: (4.0, -2.0), ..Beside::INSIDE_BOTTOM },
                );
            }
        }
        panel
    }
}

/// Lines of the grid around the pole, of points `at` a tilt from it and a turn around it, rad.
fn grid_lines(at: impl Fn(f64, f64) -> Vec3) -> Vec<Vec<Vec3>> {
    let steps = || (0..=CHORDS).map(|step| f64::from(step) / f64::from(CHORDS));
    let circles = (GRID_DEG..180).step_by(GRID_DEG as usize);
    let circles = circles.map(|tilt_deg| f64::from(tilt_deg).to_radians());
    let circles = circles.map(|tilt_rad| steps().map(|share| at(tilt_rad, TAU * share)).collect());
    // Meridians end beside the poles, where they would run into each other.
    let end = f64::from(GRID_DEG) / 180.0;
    let meridians = (0..360).step_by(2 * GRID_DEG as usize).map(|turn_deg| f64::from(turn_deg).to_radians());
    let meridians =
        meridians.map(|turn_rad| steps().map(|place| at(PI * (end + (1.0 - 2.0 * end) * place), turn_rad)).collect());
    circles.chain(meridians).collect()
}

/// Draws what of a line on the sphere is on the near side.
fn draw_visible(panel: &mut Panel, eye: &Eye, line: &[Vec3], ink: &Ink) {
    let near = |point: &Vec3| eye.globe(*point).unwrap_or((f64::NAN, f64::NAN));
    panel.path(ink, line.iter().map(near).collect());
}
