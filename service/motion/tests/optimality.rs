//! How close plans come to independent optima: the acceleration-limited one on a fine grid, and the jerk-limited one by
//! exhaustive search on short paths. `cargo test -p feedwave-motion --test motion -- --nocapture optimality` lists the ratios.

use std::collections::HashSet;

use feedwave_motion::{
    Element, Machine, MachineAxis, MotionRequest, PathLimits, PathMotion, Planned, Planner, PlannerSettings, Stretch,
    limit_pieces, stretches,
};
use feedwave_program::{
    ArcGeometry, Axis, Feed, Move, MoveKind, PathControl, Plane, Position, SourceSpan, Spindle, SplineGeometry,
};

const PERIOD_S: f64 = 1e-3;

fn machine(jerk: f64) -> Machine {
    let axis = |axis, scale: f64| MachineAxis::new(axis, 500.0 * scale, 5_000.0 * scale, jerk * scale);
    Machine { axes: vec![axis(Axis::X, 1.0), axis(Axis::Y, 0.8), axis(Axis::Z, 0.6)], ..Machine::mill() }
}

fn mv(start: Position, end: Position) -> Move {
    Move {
        kind: MoveKind::Cutting,
        start,
        end,
        work_offset: [0.0; 9],
        arc: None,
        feed: Feed::PerMinute(1.0),
        spindle: Spindle::STOPPED,
        tool: 0,
        spline: None,
        path_control: PathControl::default(),
        cycle: None,
        leads_xyz: false,
    }
}

fn element(mv: &Move) -> Element {
    Element::from_move(mv, SourceSpan::default()).expect("it moves")
}

/// A path in the plane, built piece by piece in the present direction.
struct Path {
    at: Position,
    heading: f64,
    elements: Vec<Element>,
}

impl Path {
    fn new() -> Self {
        Self { at: [0.0; 9], heading: 0.3, elements: Vec::new() }
    }

    fn line(mut self, length: f64) -> Self {
        let start = self.at;
        self.at[0] += length * self.heading.cos();
        self.at[1] += length * self.heading.sin();
        self.elements.push(element(&mv(start, self.at)));
        self
    }

    fn arc(mut self, radius: f64, sweep_rad: f64) -> Self {
        let side = sweep_rad.signum();
        let start = self.at;
        let center = [start[0] - side * radius * self.heading.sin(), start[1] + side * radius * self.heading.cos()];
        self.heading += sweep_rad;
        self.at[0] = center[0] + side * radius * self.heading.sin();
        self.at[1] = center[1] - side * radius * self.heading.cos();
        let arc = ArcGeometry { plane: Plane::Xy, center, clockwise: sweep_rad < 0.0, sweep_rad };
        self.elements.push(element(&Move { arc: Some(arc), ..mv(start, self.at) }));
        self
    }

    fn chords(mut self, radius: f64, sweep_rad: f64, count: u32) -> Self {
        let step = sweep_rad / f64::from(count);
        for _ in 0..count {
            self.heading += 0.5 * step;
            self = self.line(2.0 * radius * (0.5 * step).abs().sin());
            self.heading += 0.5 * step;
        }
        self
    }

    fn turn(mut self, angle_rad: f64) -> Self {
        self.heading += angle_rad;
        self
    }

    fn spline(mut self, points: &[[f64; 2]]) -> Self {
        let (sin, cos) = self.heading.sin_cos();
        let turned = |[u, v]: [f64; 2]| [self.at[0] + u * cos - v * sin, self.at[1] + u * sin + v * cos];
        let points: Vec<_> = std::iter::once([0.0; 2]).chain(points.iter().copied()).map(turned).collect();
        let [before, last] = [points[points.len() - 2], points[points.len() - 1]];
        let start = self.at;
        [self.at[0], self.at[1]] = last;
        self.heading = (last[1] - before[1]).atan2(last[0] - before[0]);
        let weights = vec![1.0; points.len()];
        let spline = SplineGeometry { plane: Plane::Xy, order: 4, points, weights };
        self.elements.push(element(&Move { spline: Some(Box::new(spline)), ..mv(start, self.at) }));
        self
    }
}

fn requests(elements: &[Element], machine: &Machine, feed_mm_per_min: f64) -> Vec<MotionRequest> {
    let request = |element: &Element| {
        let limits = limit_pieces(element, machine, PathMotion::ZERO, f64::INFINITY).expect("nothing is superposed");
        let feed = Feed::PerMinute(feed_mm_per_min);
        MotionRequest::new(element.clone(), stretches(element, feed, &Spindle::STOPPED, machine, &limits))
    };
    elements.iter().map(request).collect()
}

fn planned_s(requests: Vec<MotionRequest>, machine: &Machine) -> f64 {
    let mut planner = Planner::<()>::new(PlannerSettings::new(machine, 5_000, PERIOD_S));
    for request in requests {
        planner.push_motion(request);
    }
    planner.finish();
    let mut total_s = 0.0;
    while let Some(Planned::Motion(motion)) = planner.pop() {
        total_s += motion.stretches.iter().map(|stretch| stretch.profile.duration()).sum::<f64>();
    }
    total_s
}

/// Time of the fastest motion within velocity and acceleration of every axis, from rest to rest: the square of the speed,
/// integrated forwards and backwards on a fine grid, as high as the axes permit everywhere. It rests at corners.
fn acceleration_limited_s(elements: &[Element], machine: &Machine, feed_mm_per_min: f64) -> f64 {
    let mut total_s = 0.0;
    let mut chain: Vec<&Element> = Vec::new();
    for element in elements {
        let is_corner = chain.last().is_some_and(|before| {
            let (from, to) = (before.tangent(before.length), element.tangent(0.0));
            (0..3).map(|axis| (to[axis] - from[axis]).powi(2)).sum::<f64>() > 1e-6
        });
        if is_corner {
            total_s += chain_s(&chain, machine, feed_mm_per_min);
            chain.clear();
        }
        chain.push(element);
    }
    total_s + chain_s(&chain, machine, feed_mm_per_min)
}

fn chain_s(chain: &[&Element], machine: &Machine, feed_mm_per_min: f64) -> f64 {
    let length: f64 = chain.iter().map(|element| element.length).sum();
    let step = length / 40_000.0;
    // Per grid interval: step, tangent and curvature vector in its middle.
    let mut cells = Vec::new();
    for element in chain {
        let count = (element.length / step).ceil();
        let ds = element.length / count;
        for k in 0..count as u32 {
            let s = (f64::from(k) + 0.5) * ds;
            let tangent = element.tangent(s);
            let h = 0.5 * ds;
            let (before, after) = (element.tangent(s - h), element.tangent(s + h));
            let bend: Position = std::array::from_fn(|axis| (after[axis] - before[axis]) / (2.0 * h));
            cells.push((ds, tangent, bend));
        }
    }
    let feed = feed_mm_per_min / 60.0;
    let top = |(_, tangent, bend): &(f64, Position, Position)| {
        let axes = machine.axes.iter().enumerate().map(|(axis, limits)| {
            let by_velocity = (limits.max_velocity_per_s / tangent[axis].abs()).powi(2);
            by_velocity.min(limits.max_acceleration_per_s2 / bend[axis].abs())
        });
        axes.fold(feed * feed, f64::min)
    };
    // Largest acceleration along the path at this squared speed.
    let acceleration = |(_, tangent, bend): &(f64, Position, Position), q: f64| {
        let axes = machine.axes.iter().enumerate().filter(|(axis, _)| tangent[*axis].abs() > 1e-12);
        let left = axes.map(|(axis, limits)| {
            (limits.max_acceleration_per_s2 - (bend[axis] * q).abs()).max(0.0) / tangent[axis].abs()
        });
        left.fold(f64::INFINITY, f64::min)
    };
    let mut q = vec![0.0; cells.len() + 1];
    for (k, cell) in cells.iter().enumerate() {
        let cap = top(cell).min(cells.get(k + 1).map_or(0.0, top));
        q[k + 1] = (q[k] + 2.0 * cell.0 * acceleration(cell, q[k])).min(cap);
    }
    for (k, cell) in cells.iter().enumerate().rev() {
        q[k] = q[k].min(q[k + 1] + 2.0 * cell.0 * acceleration(cell, q[k + 1]));
    }
    let cell_s = |(k, cell): (usize, &(f64, Position, Position))| 2.0 * cell.0 / (q[k].sqrt() + q[k + 1].sqrt());
    cells.iter().enumerate().map(cell_s).sum()
}

#[test]
fn with_high_jerk_plans_take_the_time_of_the_acceleration_limited_optimum() {
    let machine = machine(1e9);
    let quarter = std::f64::consts::FRAC_PI_2;
    let cases: Vec<(&str, Path, f64)> = vec![
        ("one line, 60 mm", Path::new().line(60.0), 20_000.0),
        ("300 lines of 0.2 mm", (0..300).fold(Path::new(), |path, _| path.line(0.2)), 20_000.0),
        ("6 000 lines of 0.01 mm", (0..6_000).fold(Path::new(), |path, _| path.line(0.01)), 20_000.0),
        ("square", (0..4).fold(Path::new(), |path, _| path.line(30.0).turn(quarter)), 12_000.0),
        ("zigzag with reversals", (0..10).fold(Path::new(), |path, _| path.line(8.0).turn(2.0 * quarter)), 12_000.0),
        ("slot, arcs below their limit", Path::new().line(40.0).arc(10.0, 2.0 * quarter).line(40.0), 6_000.0),
        ("circle in 2 000 chords at 3 m/min", Path::new().chords(40.0, 4.0 * quarter, 6_400), 3_000.0),
        ("spline below its limit", Path::new().line(10.0).spline(&[[20.0, 0.0], [40.0, 20.0], [60.0, 20.0]]), 4_000.0),
    ];
    let mut slow = Vec::new();
    for (name, path, feed) in cases {
        let optimum_s = acceleration_limited_s(&path.elements, &machine, feed);
        let time_s = planned_s(requests(&path.elements, &machine, feed), &machine);
        let ratio = time_s / optimum_s;
        println!("{ratio:.4}  {name}: {time_s:.4} s of {optimum_s:.4} s");
        assert!(ratio > 0.999, "{name} is faster than possible");
        if ratio > 1.02 {
            slow.push((name, ratio));
        }
    }
    assert!(slow.is_empty(), "{slow:?}");
}

#[test]
fn where_curves_limit_the_speed_the_loss_is_what_their_shares_leave() {
    // On a curve the centripetal acceleration may use a fixed share of the axes' and the speed changes another, and both
    // are those of the weakest axis in the plane, see `limits`; the optimum trades one for the other at every place and
    // uses each axis where the curve asks for it.
    let machine = machine(1e9);
    let half = std::f64::consts::PI;
    let cases = [
        ("full circle of 10 mm", Path::new().arc(10.0, 2.0 * half)),
        ("slot with fast arcs", Path::new().line(40.0).arc(10.0, half).line(40.0).arc(10.0, half)),
        ("fillets of 2 mm", (0..4).fold(Path::new(), |path, _| path.line(30.0).arc(2.0, 0.5 * half))),
        ("wave of arcs", (0..6).fold(Path::new(), |path, k| path.arc(5.0, if k % 2 == 0 { half } else { -half }))),
        ("sharp spline", Path::new().line(10.0).spline(&[[20.0, 0.0], [20.0, 20.0], [40.0, 20.0]]).line(10.0)),
    ];
    for (name, path) in cases {
        let optimum_s = acceleration_limited_s(&path.elements, &machine, 30_000.0);
        let time_s = planned_s(requests(&path.elements, &machine, 30_000.0), &machine);
        let ratio = time_s / optimum_s;
        println!("{ratio:.4}  {name}: {time_s:.4} s of {optimum_s:.4} s");
        assert!(ratio > 0.999 && ratio < 1.3, "{name}: {ratio}");
    }
}

/// Speed cap and length of each piece of a straight path in units of the lattice: speeds J·h²/2, lengths J·h³/6.
type Pieces = Vec<(i64, i64)>;

/// Largest acceleration in units of J·h.
const TOP_ACCELERATION: i64 = 5;

/// Fewest steps in which a motion of constant jerk −J, 0 or J per step goes along the pieces from rest to rest: an
/// exhaustive search, step by step, over every state that can be reached.
fn fewest_steps(pieces: &Pieces) -> u32 {
    let length: i64 = pieces.iter().map(|piece| piece.1).sum();
    let cap = |s: i64| {
        let mut end = 0;
        let mut caps = pieces.iter().filter_map(|&(cap, length)| {
            let start = end;
            end += length;
            (start <= s && s <= end).then_some(cap)
        });
        let first = caps.next().unwrap_or(0);
        caps.fold(first, i64::min)
    };
    let mut states = HashSet::from([(0_i64, 0_i64, 0_i64)]);
    for step in 1.. {
        let mut next = HashSet::new();
        for &(s, v, a) in &states {
            for j in -1..=1 {
                // s + v·h + a·h²/2 + j·h³/6 in their units: 3·v, 3·a, j.
                let state @ (s, v, a) = (s + 3 * v + 3 * a + j, v + 2 * a + j, a + j);
                let is_possible = a.abs() <= TOP_ACCELERATION && v >= 0 && s <= length && v <= cap(s);
                // What must still be gone while the acceleration ends must not lead beyond the cap, nor below rest.
                if !is_possible || v + a.abs() * a < 0 {
                    continue;
                }
                if state == (length, 0, 0) {
                    return step;
                }
                next.insert(state);
            }
        }
        assert!(!next.is_empty(), "the end cannot be reached exactly");
        states = next;
    }
    unreachable!("the loop ends")
}

// The slow case is a short fast stretch between two slow ones: runs meet without acceleration, so that the fast stretch
// starts from none, where the optimum is already at full acceleration when it leaves the slow stretch. It costs two jerk
// ramps (20 ms of a 40 ms path here) and matters less the longer the stretch is.
#[test]
fn short_paths_come_close_to_the_exhaustive_optimum() {
    // Lengths are multiples of 6: the lattice reaches them exactly.
    let cases: Vec<Pieces> = vec![
        vec![(1_000, 600)],
        vec![(60, 1_200)],
        vec![(40, 600), (80, 900)],
        vec![(80, 900), (40, 600)],
        vec![(80, 900), (30, 300), (80, 900)],
        vec![(40, 300), (60, 300), (80, 600)],
        vec![(80, 600), (60, 300), (40, 300), (60, 300), (80, 600)],
        vec![(70, 150), (50, 150), (70, 150), (50, 150), (70, 600)],
        vec![(20, 120), (80, 1_200), (20, 120)],
        vec![(60, 60), (70, 60), (80, 60), (70, 60), (60, 60), (80, 900)],
    ];
    // J = 1e5 mm/s³, h = 2 ms.
    let (jerk, h) = (1e5_f64, 2e-3_f64);
    let (mm, mm_per_s) = (jerk * h * h * h / 6.0, 0.5 * jerk * h * h);
    let mut ratios = Vec::new();
    for pieces in cases {
        let optimum_s = f64::from(fewest_steps(&pieces)) * h;
        let mut at = [0.0; 9];
        let request = |&(cap, length): &(i64, i64)| {
            let start = at;
            at[0] += length as f64 * mm;
            let element = element(&mv(start, at));
            let acceleration = TOP_ACCELERATION as f64 * jerk * h;
            let limits = PathLimits { velocity: cap as f64 * mm_per_s, acceleration, jerk };
            let stretch =
                Stretch { end: element.length, speed_mm_per_s: f64::INFINITY, spindle_rev_per_s: 0.0, limits };
            MotionRequest::new(element, std::iter::once(stretch).collect())
        };
        let time_s = planned_s(pieces.iter().map(request).collect(), &machine(jerk));
        println!("{:.4}  {pieces:?}: {time_s:.4} s of {optimum_s:.4} s", time_s / optimum_s);
        ratios.push(time_s / optimum_s);
    }
    ratios.sort_by(f64::total_cmp);
    let (median, worst) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
    println!("median {median:.4}, worst {worst:.4}");
    // The search can only spend whole steps of some 3 % of the time each, a plan is not bound to them.
    assert!(ratios[0] > 0.9 && median <= 1.1 && worst <= 1.3, "{ratios:?}");
}
