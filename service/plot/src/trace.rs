//! The tool path as a few polylines: bounded memory, faithful to less than a pixel.

use feedwave_cutting::ToolMotion;

/// What the tool does along a stretch of the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stretch {
    /// Rapid move.
    Rapid,
    /// Cutting.
    Cutting,
    /// Cutting with vibration along the path.
    Vibrating,
    /// Cutting while the tool oscillates.
    Oscillating,
    /// A threading pass.
    Threading,
    /// A threading pass with vibration.
    VibratingThread,
    /// Where the tool goes with the rotary axes, and how, only the machine knows.
    Unknown,
}

impl From<ToolMotion> for Stretch {
    fn from(motion: ToolMotion) -> Self {
        match motion {
            ToolMotion::Rapid => Self::Rapid,
            ToolMotion::Cutting => Self::Cutting,
            ToolMotion::Vibrating => Self::Vibrating,
            ToolMotion::Oscillating => Self::Oscillating,
            ToolMotion::Threading => Self::Threading,
            ToolMotion::VibratingThread => Self::VibratingThread,
        }
    }
}

/// A point of the path: X (radius), Y, Z, mm.
pub type Point = [f64; 3];

/// A run of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Run<K = Stretch> {
    /// What the tool does.
    pub stretch: K,
    /// Corners, with everything straight between them left out.
    pub points: Vec<Point>,
}

/// Corners kept at most.
const MAX_POINTS: usize = 60_000;

/// Collects the tool path. Points closer to the drawn line than a tolerance are left out; the tolerance starts
/// near zero and grows only when the path has more corners than a picture can show. Kinds of runs are those of a [`Stretch`], or
/// others.
#[derive(Clone, Debug)]
pub struct PathTrace<K = Stretch> {
    runs: Vec<Run<K>>,
    points: usize,
    tolerance_mm: f64,
    /// What left-out points of the current line have already taken of the tolerance.
    spent_mm: f64,
}

impl<K> Default for PathTrace<K> {
    fn default() -> Self {
        Self { runs: Vec::new(), points: 0, tolerance_mm: 1e-6, spent_mm: 0.0 }
    }
}

impl<K: Copy + PartialEq> PathTrace<K> {
    /// Continues the path in a straight line from `from` to `to`.
    pub fn line(&mut self, stretch: K, from: Point, to: Point) {
        let continues = self.runs.last().is_some_and(|run| run.stretch == stretch && run.points.last() == Some(&from));
        if !continues {
            self.runs.push(Run { stretch, points: vec![from] });
            self.points += 1;
            self.spent_mm = 0.0;
        }
        if let Some(run) = self.runs.last_mut() {
            self.points -= run.points.len();
            extend(&mut run.points, to, self.tolerance_mm, &mut self.spent_mm);
            self.points += run.points.len();
        }
        if self.points > MAX_POINTS {
            self.thin_out();
        }
    }

    /// The path, in order.
    #[must_use]
    pub fn runs(&self) -> &[Run<K>] {
        &self.runs
    }

    fn thin_out(&mut self) {
        let extent_mm = self.extent_mm();
        while self.points > MAX_POINTS / 2 {
            self.tolerance_mm = (self.tolerance_mm * 2.0).max(extent_mm * 1e-5);
            let tolerance_mm = self.tolerance_mm;
            let last = self.runs.len() - 1;
            let mut position = 0;
            // Runs too small to see go; the last one stays, the path goes on from it.
            self.runs.retain_mut(|run| {
                let mut thinned = Vec::new();
                let mut spent_mm = 0.0;
                for &point in &run.points {
                    extend(&mut thinned, point, tolerance_mm, &mut spent_mm);
                }
                run.points = thinned;
                let first = run.points[0];
                let visible = run.points.iter().any(|point| distance_mm(first, *point) > tolerance_mm);
                position += 1;
                visible || position - 1 == last
            });
            self.points = self.runs.iter().map(|run| run.points.len()).sum();
        }
    }

    fn extent_mm(&self) -> f64 {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for point in self.runs.iter().flat_map(|run| &run.points) {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        distance_mm(low, high)
    }
}

/// Appends a point and leaves out the one before where the line to the new one passes it closely. Each point left
/// out moves the drawn line by at most its distance, so the sum of distances bounds the error of the whole line.
fn extend(points: &mut Vec<Point>, to: Point, tolerance_mm: f64, spent_mm: &mut f64) {
    if let [.., anchor, last] = points.as_slice()
        && let Some(distance_mm) = passing_distance_mm(*anchor, to, *last)
        && *spent_mm + distance_mm <= tolerance_mm
    {
        points.pop();
        *spent_mm += distance_mm;
    } else {
        *spent_mm = 0.0;
    }
    points.push(to);
}

/// How far from `point` the straight line from `from` to `to` passes; `None` when the point is beyond its ends.
fn passing_distance_mm(from: Point, to: Point, point: Point) -> Option<f64> {
    let direction = difference(to, from);
    let offset = difference(point, from);
    let length_squared = dot(direction, direction);
    if length_squared == 0.0 {
        return Some(dot(offset, offset).sqrt());
    }
    let share = dot(offset, direction) / length_squared;
    let foot = [0, 1, 2].map(|axis| from[axis] + share * direction[axis]);
    (0.0..=1.0).contains(&share).then(|| distance_mm(foot, point))
}

fn difference(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn distance_mm(a: Point, b: Point) -> f64 {
    let d = difference(a, b);
    dot(d, d).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_stretches_become_one_line() {
        let mut trace = PathTrace::default();
        for step in 0..1_000 {
            trace.line(Stretch::Cutting, [0.0, 0.0, f64::from(step)], [0.0, 0.0, f64::from(step + 1)]);
        }
        trace.line(Stretch::Cutting, [0.0, 0.0, 1_000.0], [5.0, 0.0, 1_000.0]);
        trace.line(Stretch::Rapid, [5.0, 0.0, 1_000.0], [0.0; 3]);
        assert_eq!(trace.runs().len(), 2);
        assert_eq!(trace.runs()[0].points, [[0.0; 3], [0.0, 0.0, 1_000.0], [5.0, 0.0, 1_000.0]]);
    }

    #[test]
    fn a_circle_of_tiny_steps_stays_round() {
        let mut trace = PathTrace::default();
        let on_circle = |step: u32| {
            let (sine, cosine) = (f64::from(step) * 1e-5).sin_cos();
            [20.0 * sine, 0.0, 20.0 * cosine]
        };
        for step in 0..600_000 {
            trace.line(Stretch::Cutting, on_circle(step), on_circle(step + 1));
        }
        let points = &trace.runs()[0].points;
        let middles = points.windows(2).map(|pair| [0, 1, 2].map(|axis| (pair[0][axis] + pair[1][axis]) / 2.0));
        let error_mm = middles.map(|point| (dot(point, point).sqrt() - 20.0).abs()).fold(0.0, f64::max);
        assert!(points.len() < MAX_POINTS && error_mm < 0.01, "{} points, {error_mm} mm", points.len());
    }

    #[test]
    fn a_path_of_nothing_but_corners_stays_bounded_and_reaches_its_end() {
        let mut trace = PathTrace::default();
        let corner = |step: u32| [f64::from(step % 2), 0.0, f64::from(step) * 1e-3];
        for step in 0..400_000 {
            let stretch = if step % 2 == 0 { Stretch::Rapid } else { Stretch::Vibrating };
            trace.line(stretch, corner(step), corner(step + 1));
        }
        assert!(trace.points <= MAX_POINTS, "{}", trace.points);
        assert_eq!(trace.points, trace.runs().iter().map(|run| run.points.len()).sum::<usize>());
        let end = trace.runs().last().and_then(|run| run.points.last()).copied().unwrap();
        assert_eq!(end, corner(400_000));
    }
}
