//! The removal and the floor against a simulation that knows nothing of staircases and rows: small steps in time, every
//! point of every edge, cells lowered one by one.

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, FloorArea, FloorError, HeightField, OscillationCondition, OscillationCut, RemovedLayer,
    ToolGeometry, ToolOscillation, Waveform, plane_section,
};

use super::{assert_near, condition};

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

#[test]
fn the_floor_is_that_of_small_steps() {
    let tool = tool();
    for (condition, clockwise, trailing) in
        [(&conditions()[0], true, false), (&conditions()[1], true, true), (&conditions()[1], false, true)]
    {
        let cut = cut(clockwise);
        let oscillation = ToolOscillation::new(&tool, condition, 1, 2).expect("possible");
        let area = FloorArea { length_mm: 0.6, width_mm: 3.9, across_mm: 0.0, resolution_mm: 0.02, trailing };
        let field = HeightField::simulate(&tool, &oscillation, &cut, &area).expect("possible");
        assert_eq!((field.columns, field.rows), (30, 195));

        let mut brute = vec![f32::INFINITY; field.heights_mm.len()];
        // From before the front reaches the strip until the trailing half has left it.
        let (first, last) = (-14.0, 18.0);
        let steps_per_rev = 2_500;
        let steps = ((last - first) * f64::from(steps_per_rev)) as u32;
        for step in 0..=steps {
            let turns = first + f64::from(step) / f64::from(steps_per_rev);
            for edge in 0..tool.edges.len() {
                let azimuth = turns - tool.edges[edge].angle_deg / 360.0;
                let ahead = (azimuth - azimuth.round()).abs() <= 0.25;
                if !ahead && !trailing {
                    continue;
                }
                for part in 0..=80 {
                    let from_edge_mm = 0.4 * f64::from(part) / 80.0;
                    let [x, y, z] = point(&tool, &oscillation, &cut, edge, turns, from_edge_mm);
                    let (column, row) = ((x / 0.02).floor(), ((y + 1.95) / 0.02).floor());
                    // What passes a cell near its middle.
                    let off = |place: f64, cell: f64| (place / 0.02 - cell - 0.5).abs();
                    let is_near = off(x, column) < 0.25 && off(y + 1.95, row) < 0.25;
                    if is_near && (0.0..30.0).contains(&column) && (0.0..195.0).contains(&row) {
                        let cell = &mut brute[row as usize * 30 + column as usize];
                        *cell = cell.min(z as f32);
                    }
                }
            }
        }
        // They differ where a pass ends within that distance of the middle, and by the slope over it.
        let mut close = 0;
        for (index, height) in field.heights_mm.iter().enumerate() {
            let (row, column) = (index / 30, index % 30);
            let here = brute[index];
            assert!(here <= height + 2e-4, "{here} above {height}");
            // At the rim of the area a part of what lies around is not known.
            if !(1..194).contains(&row) || !(1..29).contains(&column) {
                continue;
            }
            let around = (row - 1..=row + 1).flat_map(|row| (column - 1..=column + 1).map(move |c| row * 30 + c));
            let highest = around.map(|cell| brute[cell]).fold(f32::NEG_INFINITY, f32::max);
            // The top of a ridge may lie in this cell alone: the relief falls by up to 0.9 µm to the cell beside it.
            assert!(*height <= highest + 9e-4, "{row} {column}: {height} above everything around, {highest}");
            close += u32::from((height - here).abs() < 1e-3 || *height == here);
        }
        let share = f64::from(close) / (28.0 * 193.0);
        assert!(share > 0.93, "{share} of the cells agree");
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
