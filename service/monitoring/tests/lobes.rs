//! Limits, charts and tables of stability lobes against a reference that shares nothing with them: at a given speed and
//! chatter frequency the depth that closes the loop is a complex number, and a limit is where it is real and positive.

use feedwave_monitoring::{ChartPoint, LobeError, Lobes, MillingModel, Mode, Pocket, PocketRequest, TurningModel};
use std::f64::consts::{PI, TAU};

type Complex = (f64, f64);

fn mul(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn add(a: Complex, b: Complex) -> Complex {
    (a.0 + b.0, a.1 + b.1)
}

fn scale(a: Complex, by: f64) -> Complex {
    (a.0 * by, a.1 * by)
}

fn inverse(a: Complex) -> Complex {
    let norm = a.0 * a.0 + a.1 * a.1;
    (a.0 / norm, -a.1 / norm)
}

fn root(a: Complex) -> Complex {
    let (magnitude, angle) = (a.0.hypot(a.1).sqrt(), a.1.atan2(a.0) / 2.0);
    (magnitude * angle.cos(), magnitude * angle.sin())
}

fn response(modes: &[Mode], hz: f64) -> Complex {
    modes.iter().fold((0.0, 0.0), |sum, mode| {
        let r = hz / mode.frequency_hz;
        let stiffness = scale((1.0 - r * r, 2.0 * mode.damping_ratio * r), mode.stiffness_n_per_mm);
        add(sum, inverse(stiffness))
    })
}

enum Cut {
    Turning(TurningModel),
    Milling(MillingModel),
}

/// Eigenvalues of the loop without delay and depth, along a dense grid of frequencies, each followed from one to the next.
struct Reference {
    cut: Cut,
    edges: f64,
    grid: Vec<(f64, [Complex; 2])>,
}

impl Cut {
    fn modes(&self) -> Vec<Mode> {
        match self {
            Self::Turning(model) => model.modes.clone(),
            Self::Milling(model) => [&model.modes_x[..], &model.modes_y].concat(),
        }
    }

    fn lobes(&self) -> Lobes {
        match self {
            Self::Turning(model) => model.lobes(),
            Self::Milling(model) => model.lobes(),
        }
        .unwrap()
    }

    /// The loop per mm of depth, as eigenvalues.
    fn eigenvalues(&self, hz: f64) -> [Complex; 2] {
        match self {
            Self::Turning(model) => {
                let loop_gain = scale(response(&model.modes, hz), model.specific_n_per_mm2);
                [loop_gain; 2]
            }
            Self::Milling(model) => {
                let [xx, xy, yx, yy] = model.directional_coefficients();
                let [x, y] = [&model.modes_x, &model.modes_y].map(|modes| response(modes, hz));
                let gain = -f64::from(model.edges) * model.tangential_n_per_mm2 / (4.0 * PI);
                let [a, b, c, d] = [scale(x, xx), scale(y, xy), scale(x, yx), scale(y, yy)];
                let half = scale(add(a, d), 0.5);
                let spread =
                    add(mul(scale(add(a, scale(d, -1.0)), 0.5), scale(add(a, scale(d, -1.0)), 0.5)), mul(b, c));
                [1.0, -1.0].map(|sign| scale(add(half, scale(root(spread), sign)), gain))
            }
        }
    }
}

impl Reference {
    fn new(cut: Cut) -> Self {
        let modes = cut.modes();
        let [low, high] =
            [f64::min, f64::max].map(|pick| modes.iter().map(|mode| mode.frequency_hz).reduce(pick).unwrap_or(1.0));
        let (low, high) = (0.01 * low, 12.0 * high);
        let mut frequencies: Vec<f64> =
            (0..=2_500).map(|step| low * (high / low).powf(f64::from(step) / 2_500.0)).collect();
        for mode in &modes {
            let width = mode.frequency_hz * mode.damping_ratio;
            frequencies.extend((-200..=200).map(|step| mode.frequency_hz + 0.05 * width * f64::from(step)));
        }
        frequencies.retain(|hz| *hz > 0.0);
        frequencies.sort_by(f64::total_cmp);
        let mut last: Option<[Complex; 2]> = None;
        let grid = frequencies.into_iter().map(|hz| {
            let mut values = cut.eigenvalues(hz);
            let apart = |a: Complex, b: Complex| (a.0 - b.0).hypot(a.1 - b.1);
            if let Some([first, second]) = last
                && apart(first, values[1]) + apart(second, values[0])
                    < apart(first, values[0]) + apart(second, values[1])
            {
                values.swap(0, 1);
            }
            last = Some(values);
            (hz, values)
        });
        let grid = grid.collect();
        let edges = if let Cut::Milling(model) = &cut { f64::from(model.edges) } else { 1.0 };
        Self { cut, edges, grid }
    }

    /// −1/(eigenvalue · (1 − e^(−iωT))): the depth, where it is real.
    fn depth(&self, value: Complex, hz: f64, spindle_rev_per_min: f64) -> Complex {
        let turn = TAU * hz * 60.0 / (self.edges * spindle_rev_per_min);
        scale(inverse(mul(value, (1.0 - turn.cos(), turn.sin()))), -1.0)
    }

    fn limit_mm(&self, spindle_rev_per_min: f64) -> f64 {
        let mut best = f64::INFINITY;
        let values = if matches!(self.cut, Cut::Turning(_)) { 0..1 } else { 0..2 };
        for which in values {
            let mut before = self.depth(self.grid[0].1[which], self.grid[0].0, spindle_rev_per_min);
            for pair in self.grid.windows(2) {
                let after = self.depth(pair[1].1[which], pair[1].0, spindle_rev_per_min);
                let crosses = (before.1 < 0.0) != (after.1 < 0.0);
                if crosses && (before.0 > 0.0 || after.0 > 0.0) && before.0.min(after.0) < 2.0 * best {
                    best = best.min(self.crossing([pair[0], pair[1]], which, before.1 < 0.0, spindle_rev_per_min));
                }
                before = after;
            }
        }
        best
    }

    fn crossing(&self, ends: [(f64, [Complex; 2]); 2], which: usize, rises: bool, spindle_rev_per_min: f64) -> f64 {
        let [(mut low, start), (mut high, end)] = ends;
        let (width, from) = (high - low, low);
        let mut depth = (f64::INFINITY, 0.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let share = (middle - from) / width;
            let expected = add(scale(start[which], 1.0 - share), scale(end[which], share));
            let apart = |a: &Complex| (a.0 - expected.0).hypot(a.1 - expected.1);
            let values = self.cut.eigenvalues(middle);
            let value = if apart(&values[0]) <= apart(&values[1]) { values[0] } else { values[1] };
            depth = self.depth(value, middle, spindle_rev_per_min);
            if (depth.1 < 0.0) == rises { low = middle } else { high = middle }
        }
        if depth.0 > 0.0 && depth.1.abs() < 1e-3 * depth.0 { depth.0 } else { f64::INFINITY }
    }
}

/// Numbers from 0 to 1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.next())
    }

    fn mode(&mut self) -> Mode {
        Mode {
            frequency_hz: self.between(150.0, 2_500.0),
            damping_ratio: self.between(0.005, 0.15),
            stiffness_n_per_mm: self.between(3e3, 8e4),
        }
    }
}

fn mode(frequency_hz: f64, damping_ratio: f64, stiffness_n_per_mm: f64) -> Mode {
    Mode { frequency_hz, damping_ratio, stiffness_n_per_mm }
}

fn turning(modes: Vec<Mode>) -> Cut {
    Cut::Turning(TurningModel { modes, specific_n_per_mm2: 2_000.0 })
}

fn milling(modes_x: Vec<Mode>, modes_y: Vec<Mode>, edges: u32, entry_deg: f64, exit_deg: f64) -> Cut {
    Cut::Milling(MillingModel {
        modes_x,
        modes_y,
        edges,
        entry_rad: entry_deg.to_radians(),
        exit_rad: exit_deg.to_radians().min(PI),
        tangential_n_per_mm2: 800.0,
        radial_ratio: 0.35,
    })
}

/// Cuts with their range of speeds, rev/min.
fn cuts() -> Vec<(Cut, [f64; 2])> {
    let lathe = [2_000.0, 30_000.0];
    let mill = [1_500.0, 20_000.0];
    let mut cuts = vec![
        (turning(vec![mode(600.0, 0.01, 20_000.0)]), lathe),
        (turning(vec![mode(600.0, 0.03, 10_000.0), mode(900.0, 0.03, 10_000.0)]), lathe),
        (turning(vec![mode(250.0, 0.04, 8_000.0), mode(260.0, 0.02, 30_000.0), mode(1_400.0, 0.01, 9_000.0)]), lathe),
        (milling(vec![mode(600.0, 0.03, 10_000.0)], vec![mode(660.0, 0.03, 10_000.0)], 4, 90.0, 180.0), mill),
        (milling(vec![mode(600.0, 0.03, 10_000.0)], Vec::new(), 2, 0.0, 90.0), mill),
        (milling(Vec::new(), vec![mode(420.0, 0.05, 15_000.0)], 3, 60.0, 120.0), mill),
        (milling(vec![mode(700.0, 0.01, 9_000.0)], vec![mode(715.0, 0.01, 9_500.0)], 1, 0.0, 180.0), mill),
        // Equal in both directions: the two roots are mirror images.
        (milling(vec![mode(800.0, 0.02, 20_000.0)], vec![mode(800.0, 0.02, 20_000.0)], 2, 0.0, 180.0), mill),
    ];
    let mut numbers = Numbers(20_261_122);
    for count in [1, 2, 3, 5] {
        cuts.push((turning((0..count).map(|_| numbers.mode()).collect()), lathe));
        for arc in [[0.0, 35.0], [120.0, 180.0], [20.0, 160.0]] {
            let [modes_x, modes_y] = [0, 1].map(|_| (0..count).map(|_| numbers.mode()).collect());
            cuts.push((milling(modes_x, modes_y, 2 + count, arc[0], arc[1]), mill));
        }
    }
    cuts
}

/// What lines between the points of a chart show at a speed.
fn drawn_mm(chart: &[ChartPoint], spindle_rev_per_min: f64) -> f64 {
    let after =
        chart.partition_point(|point| point.spindle_rev_per_min < spindle_rev_per_min).clamp(1, chart.len() - 1);
    let [from, to] = [&chart[after - 1], &chart[after]];
    let share = (spindle_rev_per_min - from.spindle_rev_per_min) / (to.spindle_rev_per_min - from.spindle_rev_per_min);
    let [start, end] = [from, to].map(|point| point.limit.unwrap().limit_mm);
    start + share * (end - start)
}

#[test]
fn the_limit_at_a_speed_is_exact() {
    for (case, (cut, [lowest, highest])) in cuts().into_iter().enumerate() {
        let (lobes, reference) = (cut.lobes(), Reference::new(cut));
        let mut numbers = Numbers(case as u64);
        for _ in 0..60 {
            let spindle_rev_per_min = numbers.between(lowest, highest);
            let (found, exact) =
                (lobes.limit_mm(spindle_rev_per_min).unwrap().unwrap(), reference.limit_mm(spindle_rev_per_min));
            assert!(
                (found - exact).abs() < 1e-7 * exact,
                "case {case}, {spindle_rev_per_min} rev/min: {found} for {exact} mm"
            );
        }
    }
}

#[test]
fn the_chart_never_shows_more_than_the_exact_limit() {
    for (case, (cut, [lowest, highest])) in cuts().into_iter().enumerate() {
        let (lobes, reference) = (cut.lobes(), Reference::new(cut));
        for speeds in [2, 200] {
            let chart = lobes.chart(lowest, highest, speeds).unwrap();
            assert!(
                chart.windows(2).all(|pair| pair[0].spindle_rev_per_min < pair[1].spindle_rev_per_min),
                "case {case}"
            );
            assert!(chart.len() < 10_000, "case {case}: {} points", chart.len());
            for asked in 0..speeds {
                let spindle_rev_per_min = lowest + (highest - lowest) * f64::from(asked) / f64::from(speeds - 1);
                let nearest = chart
                    .iter()
                    .map(|point| (point.spindle_rev_per_min / spindle_rev_per_min - 1.0).abs())
                    .fold(1.0, f64::min);
                assert!(nearest < 1e-12, "case {case}: {spindle_rev_per_min} rev/min is missing");
            }
            let mut numbers = Numbers(case as u64);
            let random = (0..40).map(|_| numbers.between(lowest, highest));
            let points = chart.iter().map(|point| point.spindle_rev_per_min).step_by(chart.len() / 20 + 1);
            for spindle_rev_per_min in random.chain(points.collect::<Vec<_>>()) {
                let (drawn, exact) = (drawn_mm(&chart, spindle_rev_per_min), reference.limit_mm(spindle_rev_per_min));
                assert!(
                    drawn <= exact * (1.0 + 1e-8),
                    "case {case}, {spindle_rev_per_min} rev/min: {drawn} above {exact} mm"
                );
                // Where a lobe turns back in speed the limit jumps, and the grid of the reference is too wide for its last
                // stretch: there the limit is that of a speed beside it.
                let beside = |share: f64| reference.limit_mm(spindle_rev_per_min * share);
                let lower =
                    if drawn < 0.999 * exact { exact.min(beside(1.0 - 1e-4)).min(beside(1.0 + 1e-4)) } else { exact };
                assert!(
                    drawn >= lower * (1.0 - 1e-3),
                    "case {case}, {spindle_rev_per_min} rev/min: {drawn} of {exact} mm"
                );
            }
        }
    }
}

#[test]
fn a_depth_of_the_table_holds_within_the_tolerance_of_its_speed() {
    for (case, (cut, [lowest_rev_per_min, highest_rev_per_min])) in cuts().into_iter().enumerate() {
        let (lobes, reference) = (cut.lobes(), Reference::new(cut));
        for (speed_tolerance, margin) in [(0.01, 0.15), (0.04, 0.0), (0.0, 0.1)] {
            let request = PocketRequest {
                lowest_rev_per_min,
                highest_rev_per_min,
                bands: 4,
                margin,
                speed_tolerance,
                required_mm: None,
            };
            for Pocket { row, stable_mm } in lobes.pockets(&request).unwrap() {
                let promised = stable_mm.unwrap() / (1.0 - margin);
                let least = (-5..=5)
                    .map(|step| {
                        reference.limit_mm(row.spindle_rev_per_min * (1.0 + speed_tolerance * f64::from(step) / 5.0))
                    })
                    .fold(f64::INFINITY, f64::min);
                let at = format!("case {case}, {} rev/min ± {speed_tolerance}", row.spindle_rev_per_min);
                assert!(promised <= least * (1.0 + 1e-8), "{at}: {promised} promised, {least} mm hold");
                assert!(promised >= least * 0.97, "{at}: {promised} promised, {least} mm hold");
            }
        }
    }
}

#[test]
fn the_turning_tool_that_was_promised_too_much_is_not() {
    let cut = turning(vec![mode(600.0, 0.01, 20_000.0)]);
    let (lobes, reference) = (cut.lobes(), Reference::new(cut));
    // b_lim = 2kζ(1 + ζ)/K_s.
    let least = 2.0 * 20_000.0 * 0.01 * 1.01 / 2_000.0;
    assert!((lobes.least_limit_mm().unwrap() - least).abs() < 1e-12);
    let chart = lobes.chart(10_000.0, 40_000.0, 1_000).unwrap();
    for step in 0..300 {
        let spindle_rev_per_min = 10_050.0 + 99.7 * f64::from(step);
        let (drawn, exact) = (drawn_mm(&chart, spindle_rev_per_min), reference.limit_mm(spindle_rev_per_min));
        assert!(
            drawn <= exact * (1.0 + 1e-9) && drawn >= exact * (1.0 - 1e-3),
            "{spindle_rev_per_min}: {drawn} {exact}"
        );
        assert!(drawn >= least * (1.0 - 1e-9));
    }
}

#[test]
fn hostile_data_costs_bounded_work() {
    let mut numbers = Numbers(7);
    let modes: Vec<Mode> = (0..32)
        .map(|_| mode(numbers.between(1.0, 1e5), numbers.between(1e-5, 0.7), numbers.between(1e-3, 1e12)))
        .collect();
    let sharp: Vec<Mode> = (0..32).map(|index| mode(500.0 + f64::from(index), 1e-5, 1e4)).collect();
    for (modes_x, modes_y) in [(modes, sharp.clone()), (sharp, Vec::new())] {
        let cut = milling(modes_x, modes_y, 1_000, 0.0, 100.0);
        let lobes = cut.lobes();
        assert!(lobes.branches().map(<[_]>::len).sum::<usize>() < 700_000);
        let chart = |lowest| lobes.chart(lowest, 1e6, 2_000);
        match chart(1.0) {
            Ok(chart) => assert!(chart.len() < 130_000),
            Err(LobeError::TooManyLobes { .. }) => assert!(chart(100.0).unwrap().len() < 130_000),
            Err(other) => panic!("{other}"),
        }
    }
}
