//! The stability chart: lines that never lie above the exact limit.

use super::limit::Exact;
use super::{ChartLimit, Check, LobeError, Lobes};

/// Most speeds of a chart that can be asked for.
const MAX_CHART_SPEEDS: f64 = 20_000.0;
/// Speeds from which on no more are added where the limit bends; what is left is drawn at its least.
const FULL: usize = 40_000;
/// How far a line may be seen to lie below the limit, as a fraction: half of what is promised, as it is not seen everywhere.
const BELOW: f64 = 5e-4;
/// How far it may lie above: rounding.
const ABOVE: f64 = 1e-9;
/// How far the crossing of two tangents is drawn below them, for the rounding of their slopes.
const TANGENT: f64 = 1e-8;
/// Speeds closer than this fraction are one: the limit jumps there.
const NARROW: f64 = 1e-10;

/// One speed of the stability chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartPoint {
    /// Spindle speed, rev/min.
    pub spindle_rev_per_min: f64,
    /// Limit; `None` where nothing chatters.
    pub limit: Option<ChartLimit>,
}

/// A speed with its exact limit.
#[derive(Debug, Clone, Copy)]
struct Vertex<'a> {
    spindle_rev_per_min: f64,
    exact: Option<Exact<'a>>,
    slope: f64,
}

impl Vertex<'_> {
    fn point(&self) -> ChartPoint {
        ChartPoint { spindle_rev_per_min: self.spindle_rev_per_min, limit: self.exact.map(|exact| exact.limit) }
    }
}

/// What to draw between two speeds.
enum Between {
    /// A line.
    Line,
    /// Two lines that meet here.
    Corner(ChartPoint),
    /// Something else: the limit bends too much.
    More,
}

/// Works out a chart.
struct Chart<'a> {
    lobes: &'a Lobes,
    last_lobe: u32,
    least_mm: f64,
}

impl Lobes {
    /// Evenly spaced speeds of a chart by default.
    pub const CHART_SPEEDS: u32 = 1_000;

    /// The stability chart: at evenly spaced speeds from the lowest to the highest, and at as many between them as it
    /// needs, the limit with its lobe, and how the tool chatters above it. Both panels of a stability chart are in it,
    /// depth and chatter frequency over speed. Lines from one speed to the next lie on the exact limit or up to 0.1 %
    /// below.
    ///
    /// Where the limit is convex the lines are tangents, whose crossings lie below it; where it is concave, they are
    /// chords. With 40 000 speeds the chart is full: where more would be needed it is drawn flat, at its least.
    ///
    /// # Errors
    /// [`LobeError`] for an impossible range or number of speeds (2 to 20 000).
    pub fn chart(
        &self,
        lowest_rev_per_min: f64,
        highest_rev_per_min: f64,
        speeds: u32,
    ) -> Result<Vec<ChartPoint>, LobeError> {
        let mut check = Check::default();
        check.speeds(lowest_rev_per_min, highest_rev_per_min);
        check.within("speeds", f64::from(speeds), 2.0, MAX_CHART_SPEEDS);
        check.finish()?;
        let last_lobe = self.last_lobe(lowest_rev_per_min)?;
        let chart = Chart { lobes: self, last_lobe, least_mm: self.least_limit_mm().unwrap_or_default() };
        let step = (highest_rev_per_min - lowest_rev_per_min) / f64::from(speeds - 1);
        let mut spindle_rev_per_min: Vec<f64> =
            (0..speeds - 1).map(|index| lowest_rev_per_min + step * f64::from(index)).collect();
        spindle_rev_per_min.push(highest_rev_per_min);
        let lows = self.low_speeds(last_lobe);
        let inside = |&&(spindle_rev_per_min, _): &&(f64, f64)| {
            spindle_rev_per_min > lowest_rev_per_min && spindle_rev_per_min < highest_rev_per_min
        };
        let shown = lows.iter().filter(inside).filter(|&&(spindle_rev_per_min, limit_mm)| {
            let exact = self.exact(spindle_rev_per_min, last_lobe);
            exact.is_some_and(|exact| exact.limit.limit_mm >= limit_mm * (1.0 - 1e-9))
        });
        spindle_rev_per_min.extend(shown.map(|low| low.0).take(FULL));
        spindle_rev_per_min.sort_by(f64::total_cmp);
        spindle_rev_per_min.dedup_by(|next, before| *next <= *before * (1.0 + NARROW));
        Ok(chart.draw(&spindle_rev_per_min))
    }
}

impl<'a> Chart<'a> {
    fn vertex(&self, spindle_rev_per_min: f64) -> Vertex<'a> {
        let exact = self.lobes.exact(spindle_rev_per_min, self.last_lobe);
        Vertex { spindle_rev_per_min, exact, slope: exact.map_or(f64::NAN, |exact| self.lobes.slope(&exact)) }
    }

    fn draw(&self, spindle_rev_per_min: &[f64]) -> Vec<ChartPoint> {
        let vertices: Vec<_> =
            spindle_rev_per_min.iter().map(|&spindle_rev_per_min| self.vertex(spindle_rev_per_min)).collect();
        let mut points: Vec<_> = vertices.iter().map(Vertex::point).collect();
        let mut open: Vec<[Vertex<'a>; 2]> = vertices.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        while !open.is_empty() && points.len() + open.len() <= FULL {
            let mut halves = Vec::new();
            for [from, to] in open {
                match self.between(&from, &to) {
                    Between::Line => {}
                    Between::Corner(corner) => points.push(corner),
                    Between::More => {
                        let middle = self.vertex(0.5 * (from.spindle_rev_per_min + to.spindle_rev_per_min));
                        points.push(middle.point());
                        halves.extend([[from, middle], [middle, to]]);
                    }
                }
            }
            open = halves;
        }
        let lows = if open.is_empty() { Vec::new() } else { self.lobes.low_speeds(self.last_lobe) };
        points.extend(open.iter().flat_map(|[from, to]| flat(from, to, &lows)).flatten());
        points.sort_by(|a, b| a.spindle_rev_per_min.total_cmp(&b.spindle_rev_per_min));
        points
    }

    fn between(&self, from: &Vertex<'_>, to: &Vertex<'_>) -> Between {
        let width = to.spindle_rev_per_min - from.spindle_rev_per_min;
        let (start, end) = match (from.exact, to.exact) {
            (None, None) => return Between::Line,
            _ if width <= NARROW * to.spindle_rev_per_min => return Between::Line,
            (Some(start), Some(end)) => (start, end),
            _ => return Between::More,
        };
        let (start_mm, end_mm) = (start.limit.limit_mm, end.limit.limit_mm);
        let chord = (end_mm - start_mm) / width;
        if from.slope < chord && chord < to.slope && (start.branch, start.limit.lobe) == (end.branch, end.limit.lobe) {
            let share = (to.slope - chord) / (to.slope - from.slope);
            let at_rev_per_min = from.spindle_rev_per_min + share * width;
            let corner_mm = ((start_mm + share * width * from.slope) * (1.0 - TANGENT)).max(self.least_mm);
            let drawn = |spindle_rev_per_min: f64| {
                if spindle_rev_per_min < at_rev_per_min {
                    start_mm
                        + (corner_mm - start_mm) * (spindle_rev_per_min - from.spindle_rev_per_min)
                            / (at_rev_per_min - from.spindle_rev_per_min)
                } else {
                    end_mm
                        + (corner_mm - end_mm) * (to.spindle_rev_per_min - spindle_rev_per_min)
                            / (to.spindle_rev_per_min - at_rev_per_min)
                }
            };
            let at = self.lobes.exact(at_rev_per_min, self.last_lobe);
            let fits = at.is_some_and(|at| fits(corner_mm, at.limit.limit_mm, BELOW));
            if let Some(at) = at.filter(|_| fits && self.holds(from, to, BELOW, drawn)) {
                let limit = ChartLimit { limit_mm: corner_mm, ..at.limit };
                return Between::Corner(ChartPoint { spindle_rev_per_min: at_rev_per_min, limit: Some(limit) });
            }
        }
        // Between two of the places that are examined it may lie twice as far below.
        let line = |spindle_rev_per_min: f64| start_mm + chord * (spindle_rev_per_min - from.spindle_rev_per_min);
        if self.holds(from, to, 0.5 * BELOW, line) { Between::Line } else { Between::More }
    }

    /// Whether lines lie where they may.
    fn holds(&self, from: &Vertex<'_>, to: &Vertex<'_>, below: f64, drawn: impl Fn(f64) -> f64) -> bool {
        [0.5, 0.25, 0.75].into_iter().all(|share| {
            let spindle_rev_per_min =
                from.spindle_rev_per_min + share * (to.spindle_rev_per_min - from.spindle_rev_per_min);
            let exact = self.lobes.exact(spindle_rev_per_min, self.last_lobe);
            exact.is_some_and(|exact| fits(drawn(spindle_rev_per_min), exact.limit.limit_mm, below))
        })
    }
}

fn fits(drawn_mm: f64, exact_mm: f64, below: f64) -> bool {
    drawn_mm <= exact_mm * (1.0 + ABOVE) && drawn_mm >= exact_mm * (1.0 - below)
}

/// A flat line at the least limit between two speeds.
fn flat(from: &Vertex<'_>, to: &Vertex<'_>, lows: &[(f64, f64)]) -> [Option<ChartPoint>; 2] {
    let within = lows.partition_point(|low| low.0 < from.spindle_rev_per_min)
        ..lows.partition_point(|low| low.0 <= to.spindle_rev_per_min);
    let ends = [from, to].map(|end| end.exact.map(|exact| exact.limit));
    let least = ends.into_iter().flatten().min_by(|a, b| a.limit_mm.total_cmp(&b.limit_mm));
    let limit = least.map(|least| {
        let limit_mm = lows[within].iter().map(|low| low.1).fold(least.limit_mm, f64::min);
        ChartLimit { limit_mm, ..least }
    });
    let beside = [from.spindle_rev_per_min * (1.0 + NARROW), to.spindle_rev_per_min * (1.0 - NARROW)];
    beside.map(|spindle_rev_per_min| limit.map(|limit| ChartPoint { spindle_rev_per_min, limit: Some(limit) }))
}
