//! The removal and the floor against a simulation that knows nothing of staircases and rows: small steps in time, every
//! point of every edge, and from the nearest of them the very place at which it passes over the middle of a cell.

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, FloorArea, FloorError, HeightField, OscillationCondition, OscillationCut, RemovedLayer,
    ToolGeometry, ToolOscillation, Waveform, plane_section,
};

use super::{assert_near, condition};

/// Tolerance for the end of a pass at the very middle of a cell.
const ROUNDING_MM: f64 = 1e-9;

/// A small tool, so that small steps suffice: uneven edges, set-overs, relief, a third direction.
fn tool() -> ToolGeometry {
    let mut tool = ToolGeometry::even(3, 2.0, 0.4, 2.0);
    tool.end_relief_deg = 2.0;
    for (edge, (angle_deg, radial, axial)) in
        tool.edges.iter_mut().zip([(10.0, 0.0, 0.002), (120.0, 0.01, 0.0), (250.0, -0.005, 0.001)])
    {
        edge.angle_deg = angle_deg;
        edge.radial_set_over_mm = radial;
        edge.axial_set_over_mm = axial;
    }
    tool
}

fn conditions() -> [OscillationCondition; 2] {
    let plain = OscillationCondition {
        feed: DirectionOscillation { amplitude_mm: 0.08, ..condition().feed },
        axial: DirectionOscillation { waveform: Waveform::HeldPeak { hold_share: 0.2 }, ..condition().axial },
        ..condition()
    };
    let waveform = Waveform::JerkLimitedHeldPeak { hold_share: 0.1 };
    let cross = DirectionOscillation { amplitude_mm: 0.02, waveform, phase_deg: 60.0 };
    [plain.clone(), OscillationCondition { cross: Some(cross), ..plain }]
}

fn cut(clockwise: bool) -> OscillationCut {
    OscillationCut {
        feed_mm_per_min: 120.0,
        spindle_rev_per_min: 600.0,
        clockwise,
        depth_mm: 0.5,
        engagement_deg: [-90.0, 90.0],
        incline_deg: 0.0,
    }
}

/// Point at `radius_mm` of an edge after `turns` of the spindle from zero: along the feed, across it (to the right), height.
fn point(
    tool: &ToolGeometry,
    oscillation: &ToolOscillation,
    cut: &OscillationCut,
    edge: usize,
    turns: f64,
    radius_from_edge_mm: f64,
) -> [f64; 3] {
    let edge = &tool.edges[edge];
    let offset = oscillation.offset(oscillation.phase_turns(turns, 0.0));
    let azimuth = core::f64::consts::TAU * (turns - edge.angle_deg / 360.0);
    let azimuth = if cut.clockwise { azimuth } else { -azimuth };
    let radius_mm = tool.radius_mm + edge.radial_set_over_mm - radius_from_edge_mm;
    // The fields' origin along the feed is the commanded centre when the first edge points ahead.
    let centre_mm = cut.feed_per_rev_mm() * (turns - tool.edges[0].angle_deg / 360.0);
    [
        centre_mm + offset.feed_mm + radius_mm * libm::cos(azimuth),
        offset.cross_mm + radius_mm * libm::sin(azimuth),
        offset.retraction_mm - edge.axial_set_over_mm
            + radius_from_edge_mm * libm::tan(tool.end_relief_deg.to_radians()),
    ]
}

/// Turns of the spindle and distance from the edge's end at which the edge passes over a place, from near it: Newton's
/// method with differences.
fn refine(point: impl Fn(f64, f64) -> [f64; 3], [mut turns, mut from_edge_mm]: [f64; 2], place: [f64; 2]) -> [f64; 2] {
    const STEP: f64 = 1e-6;
    for _ in 0..4 {
        let [x, y, _] = point(turns, from_edge_mm);
        let [x_turned, y_turned, _] = point(turns + STEP, from_edge_mm);
        let [x_inward, y_inward, _] = point(turns, from_edge_mm + STEP);
        let [a, b, c, d] = [x_turned - x, x_inward - x, y_turned - y, y_inward - y].map(|change| change / STEP);
        let [left_x, left_y] = [place[0] - x, place[1] - y];
        turns += (d * left_x - b * left_y) / (a * d - b * c);
        from_edge_mm += (a * left_y - c * left_x) / (a * d - b * c);
    }
    [turns, from_edge_mm]
}

#[test]
fn the_floor_is_that_of_small_steps() {
    let tool = tool();
    let length_mm = tool.radial_edge_length_mm;
    for (condition, clockwise, trailing) in
        [(&conditions()[0], true, false), (&conditions()[1], true, true), (&conditions()[1], false, true)]
    {
        let cut = cut(clockwise);
        let oscillation = ToolOscillation::new(&tool, condition, 1, 2).expect("possible");
        let area = FloorArea { length_mm: 0.6, width_mm: 3.9, across_mm: 0.0, resolution_mm: 0.02, trailing };
        let field = HeightField::simulate(&tool, &oscillation, &cut, &area).expect("possible");
        assert_eq!((field.columns, field.rows), (30, 195));

        let mut brute = vec![f64::INFINITY; field.heights_mm.len()];
        // From before the front reaches the strip until the trailing half has left it.
        let (first, last, steps_per_rev) = (-14.0, 18.0, 1_000);
        let steps = ((last - first) * f64::from(steps_per_rev)) as u32;
        for step in 0..=steps {
            let turns = first + f64::from(step) / f64::from(steps_per_rev);
            for edge in 0..tool.edges.len() {
                let is_ahead = |turns: f64| {
                    let azimuth = turns - tool.edges[edge].angle_deg / 360.0;
                    (azimuth - azimuth.round()).abs() <= 0.25
                };
                let at = |turns, from_edge_mm| point(&tool, &oscillation, &cut, edge, turns, from_edge_mm);
                for part in 0..=40 {
                    let from_edge_mm = length_mm * f64::from(part) / 40.0;
                    let [x, y, _] = at(turns, from_edge_mm);
                    let (column, row) = ((x / 0.02).floor(), ((y + 1.95) / 0.02).floor());
                    if !((0.0..30.0).contains(&column) && (0.0..195.0).contains(&row)) {
                        continue;
                    }
                    // The very place at which the edge passes over the middle of the cell, where it does.
                    let middle = [(column + 0.5) * 0.02, (row + 0.5) * 0.02 - 1.95];
                    let [turns, from_edge_mm] = refine(at, [turns, from_edge_mm], middle);
                    let passes = (-ROUNDING_MM..=length_mm + ROUNDING_MM).contains(&from_edge_mm);
                    if passes && (trailing || is_ahead(turns)) {
                        let cell = &mut brute[row as usize * 30 + column as usize];
                        *cell = cell.min(at(turns, from_edge_mm)[2]);
                    }
                }
            }
        }
        // In every cell, at the ends of the passes too: between its knots the field is straight where the edge is curved,
        // which is 6 nm here, and its cells are single precision.
        for (index, (&height, &brute)) in field.heights_mm.iter().zip(&brute).enumerate() {
            let (row, column) = (index / 30, index % 30);
            let is_same = f64::from(height) == brute || (f64::from(height) - brute).abs() < 1e-5;
            assert!(is_same, "{row} {column}: {height} instead of {brute}");
        }
        assert!(brute.iter().filter(|height| height.is_finite()).count() > 5_000);
    }
}

#[test]
fn the_layers_are_those_of_a_grid_that_is_cut_away() {
    let tool = ToolGeometry { end_relief_deg: 0.0, ..tool() };
    for (condition, clockwise) in [(&conditions()[0], true), (&conditions()[1], true), (&conditions()[1], false)] {
        let cut = cut(clockwise);
        let oscillation = ToolOscillation::new(&tool, condition, 1, 1).expect("possible");
        for azimuth_deg in [-70.0f64, 0.0, 35.0] {
            // A grid of the plane: 1 µm along it, 1 µm up; gone cells are kept as a front per height.
            let heights = 560;
            let mut fronts = vec![f64::NEG_INFINITY; heights];
            let mut areas = [0.0; 3];
            let direction = azimuth_deg.to_radians();
            let side = if clockwise { 1.0 } else { -1.0 };
            for rev in 0..12 {
                for (edge, area) in areas.iter_mut().enumerate() {
                    let turns = f64::from(rev) + (tool.edges[edge].angle_deg + azimuth_deg) / 360.0;
                    let [x, y, z] = point(&tool, &oscillation, &cut, edge, turns, 0.0);
                    let front = x * libm::cos(direction) + side * y * libm::sin(direction);
                    for (index, gone) in fronts.iter_mut().enumerate() {
                        let height = -0.06 + 0.001 * (index as f64 + 0.5);
                        if z <= height && front > *gone {
                            if rev == 11 {
                                *area += 0.001 * (front - *gone);
                            }
                            *gone = front;
                        }
                    }
                }
            }
            for (pass, area) in plane_section(&tool, &oscillation, &cut, azimuth_deg).iter().zip(areas) {
                let staged: f64 = pass.layers.iter().map(RemovedLayer::area_mm2).sum();
                assert_near(staged, area, 4e-4);
            }
        }
    }
}

#[test]
fn impossible_areas_are_refused() {
    let (tool, cut) = (tool(), cut(true));
    let oscillation = ToolOscillation::new(&tool, &conditions()[0], 1, 1).expect("possible");
    let area = FloorArea { length_mm: 1.0, width_mm: 3.0, across_mm: 0.0, resolution_mm: 0.01, trailing: true };
    let refused = |area: FloorArea, cut: &OscillationCut| {
        HeightField::simulate(&tool, &oscillation, cut, &area).expect_err("impossible")
    };
    assert_eq!(refused(FloorArea { width_mm: 4.1, ..area }, &cut), FloorError::Size);
    assert_eq!(refused(FloorArea { resolution_mm: f64::NAN, ..area }, &cut), FloorError::Size);
    assert_eq!(refused(FloorArea { length_mm: f64::INFINITY, ..area }, &cut), FloorError::Size);
    assert!(matches!(refused(FloorArea { resolution_mm: 1e-5, ..area }, &cut), FloorError::Cells(_)));
    let slow = OscillationCut { feed_mm_per_min: 0.001, ..cut };
    assert!(matches!(refused(area, &slow), FloorError::Passes(_)));
}
