//! Picture of the tool path: where the tool goes, what is rapid, what vibrates. Both axes have the same scale.

use std::collections::HashSet;
use std::ops::Range;

use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

use super::figure::{Axis, Beside, Figure, Layout, MM, Panel, Place, extent};
use super::theme::{self, Ink};
use super::trace::{PathTrace, Point, Stretch};

/// The tool path of a program.
pub(super) struct ToolPathPicture<'a> {
    pub(super) program: &'a str,
    pub(super) trace: &'a PathTrace,
    /// Drawn like a lathe: Z to the right, X upwards, the spindle's axis at X = 0.
    pub(super) turning: bool,
}

/// A view: which coordinates run to the right and upwards.
struct View {
    title: &'static str,
    right: (usize, &'static str),
    up: (usize, &'static str),
}

const TURNING: View = View { title: "", right: (2, "Z"), up: (0, "X (radius)") };
const FROM_ABOVE: View = View { title: "from above", right: (0, "X"), up: (1, "Y") };
const FROM_FRONT: View = View { title: "from the front", right: (0, "X"), up: (2, "Z") };

/// Space around what is cut, in which rapids are shown, as a share of its larger side.
const MARGIN_SHARE: f64 = 0.25;

/// Width of what vibrates: it is seen on both sides of a plain cut along the same path, such as the last pass of a thread.
const WIDE: f64 = 7.0;

/// What a stretch is drawn with.
fn ink(stretch: Stretch) -> Ink {
    match stretch {
        Stretch::Cutting => Ink::line("cutting", theme::COMMAND, 2.2),
        Stretch::Vibrating => Ink::line("cutting with vibration along the path", theme::VIBRATION, WIDE),
        Stretch::Oscillating => Ink::line("cutting with an oscillating tool", theme::PALETTE[4], WIDE),
        Stretch::Threading => Ink::line("threading", theme::PALETTE[5], 2.2),
        Stretch::VibratingThread => Ink::line("threading with vibration", theme::PALETTE[3], WIDE),
        Stretch::Rapid => Ink::dashed("rapid moves", theme::MUTED, 1.5),
        Stretch::Unknown => Ink::dashed("swung by the rotary axes: only the ends are known", theme::BAD, 1.2),
    }
}

/// From the lowest to the highest: rapid moves are seen on cuts that they run along.
const ORDER: [Stretch; 7] = [
    Stretch::Vibrating,
    Stretch::Oscillating,
    Stretch::VibratingThread,
    Stretch::Cutting,
    Stretch::Threading,
    Stretch::Rapid,
    Stretch::Unknown,
];

impl ToolPathPicture<'_> {
    pub(super) fn figure(&self) -> Figure {
        let subtitle = format!("{} \u{b7} work coordinates \u{b7} both axes to the same scale", self.program);
        let views: &[View] = if self.turning { &[TURNING] } else { &[FROM_ABOVE, FROM_FRONT] };
        let panels = views.iter().map(|view| self.view(view)).collect();
        Figure::new("tool-path", "Tool path", subtitle, Layout::row(panels))
    }

    fn view(&self, view: &View) -> Panel {
        let project = |point: &Point| (point[view.right.0], point[view.up.0]);
        let (x, y) = self.part(project);
        let axis = Axis::new(view.right.1, MM, x.clone());
        let mut panel = Panel::new(view.title, axis, Axis::new(view.up.1, MM, y.clone())).in_proportion();
        if self.turning {
            let spindle = Ink::centre_line("spindle axis");
            let far = 1e3 * (x.end - x.start).max(y.end - y.start).max(1.0);
            panel.endless(&spindle, vec![(x.start - far, 0.0), (x.end + far, 0.0)]);
        }
        for stretch in ORDER {
            let runs = self.trace.runs().iter().filter(|run| run.stretch == stretch);
            let lines = runs.map(|run| run.points.iter().map(project).collect());
            if stretch == Stretch::Rapid {
                once(lines).into_iter().for_each(|line| panel.path(&ink(stretch), line));
            } else {
                lines.for_each(|line| panel.path(&ink(stretch), line));
            }
        }
        for pair in self.trace.runs().windows(2) {
            let (Some(from), Some(to)) = (pair[0].points.last(), pair[1].points.first()) else { continue };
            let (from, to) = (project(from), project(to));
            if !is_same(from, to) {
                panel.path_beyond(&ink(Stretch::Unknown), vec![from, to], "the swing of the rotary axes");
            }
        }
        self.mark_ends(&mut panel, project, &x);
        panel
    }

    /// Start and end of the program.
    fn mark_ends(&self, panel: &mut Panel, project: impl Fn(&Point) -> Place, x: &Range<f64>) {
        let first = self.trace.runs().first().and_then(|run| run.points.first()).map(&project);
        let last = self.trace.runs().last().and_then(|run| run.points.last()).map(&project);
        let (Some(first), Some(last)) = (first, last) else { return };
        let ends: &[(Place, &str, RGBColor)] = if is_same(first, last) {
            &[(first, "start and end", theme::INK)]
        } else {
            &[(first, "start", theme::GOOD), (last, "end", theme::INK)]
        };
        for &(place, name, color) in ends {
            panel.place(&Ink::dot(name, color, 5.5), place);
            let middle = 0.5 * (x.start + x.end);
            let (side, by) = if place.0 > middle { (HPos::Right, -9.0) } else { (HPos::Left, 9.0) };
            panel.label(place, name, theme::INK, Beside { x: side, y: VPos::Bottom, by: (by, -4.0) });
        }
    }

    /// What of the path is shown: all that is cut with a margin around it. Rapids to a far tool change would
    /// make the part tiny, so they leave the picture at its edge.
    fn part(&self, project: impl Fn(&Point) -> Place) -> (Range<f64>, Range<f64>) {
        let points = |cuts_only: bool| -> Vec<Place> {
            let runs = self.trace.runs().iter();
            let shown = runs.filter(|run| !(cuts_only && matches!(run.stretch, Stretch::Rapid | Stretch::Unknown)));
            shown.flat_map(|run| run.points.iter().map(&project)).collect()
        };
        let (cut, all) = (points(true), points(false));
        let range = |places: &[Place], of: fn(&Place) -> f64| {
            extent(places.iter().map(of)).map_or(0.0..1.0, |(low, high)| low..high)
        };
        let shown = if cut.is_empty() { &all } else { &cut };
        let (x, mut y) = (range(shown, |place| place.0), range(shown, |place| place.1));
        if self.turning {
            // The spindle's axis belongs to the picture of a turned part.
            y.start = y.start.min(0.0);
        }
        let margin = if cut.is_empty() { 0.0 } else { MARGIN_SHARE * (x.end - x.start).max(y.end - y.start) };
        let grown = |part: Range<f64>, whole: Range<f64>| {
            (part.start - margin).max(whole.start.min(part.start))..(part.end + margin).min(whole.end.max(part.end))
        };
        (grown(x, range(&all, |place| place.0)), grown(y, range(&all, |place| place.1)))
    }
}

/// Every segment of some lines once and in one sense, and those along an axis that overlap as one: dashes that go over each
/// other are a solid line.
fn once(lines: impl Iterator<Item = Vec<Place>>) -> Vec<Vec<Place>> {
    let before = |a: &Place, b: &Place| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).is_le();
    let mut drawn = HashSet::new();
    let mut segments = Vec::new();
    for line in lines {
        for pair in line.windows(2) {
            let (from, to) = if before(&pair[0], &pair[1]) { (pair[0], pair[1]) } else { (pair[1], pair[0]) };
            if drawn.insert([from.0, from.1, to.0, to.1].map(f64::to_bits)) {
                segments.push([from, to]);
            }
        }
    }
    let swap = |[from, to]: [Place; 2]| [from, to].map(|(a, b)| (b, a));
    let upright = joined(segments);
    joined(upright.into_iter().map(swap).collect()).into_iter().map(|segment| swap(segment).to_vec()).collect()
}

/// Segments of which the upright ones that touch or overlap are one, which goes upwards.
fn joined(segments: Vec<[Place; 2]>) -> Vec<[Place; 2]> {
    let (mut upright, mut joined): (Vec<_>, Vec<_>) = segments.into_iter().partition(|[from, to]| from.0 == to.0);
    for segment in &mut upright {
        segment.sort_by(|a, b| a.1.total_cmp(&b.1));
    }
    upright.sort_by(|[a, _], [b, _]| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for [from, to] in upright {
        match joined.last_mut() {
            Some([first, last]) if first.0 == last.0 && first.0 == from.0 && from.1 <= last.1 => {
                last.1 = last.1.max(to.1);
            }
            _ => joined.push([from, to]),
        }
    }
    joined
}

/// Whether two places are one for the eye.
fn is_same(a: Place, b: Place) -> bool {
    (a.0 - b.0).hypot(a.1 - b.1) < 1e-6
}
