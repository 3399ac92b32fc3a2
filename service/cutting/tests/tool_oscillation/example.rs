//! The worked example of docs/functions/tool-oscillation.md as golden numbers.

use feedwave_cutting::tool_oscillation::{FloorArea, RemovedLayer, ToolOscillation, judge, plane_section};
use feedwave_program::Severity;

use super::{assert_near, condition, cut, job, tool};

fn oscillation() -> ToolOscillation {
    ToolOscillation::new(&tool(), &condition(), 1, 1).expect("the example is possible")
}

#[test]
fn the_protrusion_follows_the_page() {
    let oscillation = oscillation();
    let protrusion = |turns: f64| oscillation.offset(turns).protrusion_mm();
    for turns in [0.1, 0.2, 0.399, 1.25] {
        assert_near(protrusion(turns), -0.03, 1e-15);
    }
    for turns in [0.6, 0.75, 0.9] {
        assert_near(protrusion(turns), 0.03, 1e-15);
    }
    let pi = core::f64::consts::PI;
    for step in 0..=100 {
        let turns = 0.4 + 0.002 * f64::from(step);
        assert_near(protrusion(turns), -0.03 * libm::cos(pi * (turns - 0.4) / 0.2), 1e-14);
        let turns = 0.9 + 0.002 * f64::from(step);
        assert_near(protrusion(turns), 0.03 * libm::cos(pi * (turns - 0.9) / 0.2), 1e-14);
    }
    // The retraction is in the forward half, the protrusion in the backward half.
    for turns in [0.25, 0.75] {
        let offset = oscillation.offset(turns);
        assert_near(offset.feed_mm, 0.4 * (4.0 * (0.5 - turns)), 1e-15);
        assert_eq!(offset.feed_mm > 0.0, offset.retraction_mm > 0.0);
    }
}

#[test]
fn edges_remove_their_layers() {
    let passes = plane_section(&tool(), &oscillation(), &cut(), 0.0);
    let fronts: Vec<f64> = passes.iter().map(|pass| pass.front_mm).collect();
    for (front, expected) in fronts.iter().zip([0.0, 0.65, 0.5, 0.35]) {
        assert_near(*front, expected, 1e-12);
    }
    let ends: Vec<f64> = passes.iter().map(|pass| pass.end_mm).collect();
    for (end, expected) in ends.iter().zip([0.0, 0.03, 0.0, -0.03]) {
        assert_near(*end, expected, 1e-12);
    }
    // E1: middle layer from −0.50, above it from −0.35. E2: the surface only. E3: the middle. E4: the deepest, 1 mm far.
    let expected: [&[[f64; 4]]; 4] = [
        &[[0.0, 0.03, -0.5, 0.0], [0.03, 1.0, -0.35, 0.0]],
        &[[0.03, 1.0, 0.0, 0.65]],
        &[[0.0, 0.03, 0.0, 0.5]],
        &[[-0.03, 0.0, -0.65, 0.35]],
    ];
    for (pass, expected) in passes.iter().zip(expected) {
        assert_eq!(pass.layers.len(), expected.len(), "{:?}", pass.layers);
        for (layer, [low, high, from, to]) in pass.layers.iter().zip(expected) {
            for (value, expected) in
                [(layer.low_mm, low), (layer.high_mm, high), (layer.from_mm, from), (layer.to_mm, to)]
            {
                assert_near(value, *expected, 1e-12);
            }
        }
        assert_eq!(pass.above_edge_mm, 0.0);
    }
    let area: f64 = passes.iter().flat_map(|pass| &pass.layers).map(RemovedLayer::area_mm2).sum();
    assert_near(area, 1.0 * 1.03, 1e-12);
}

#[test]
fn the_report_carries_the_figures() {
    let (tool, condition) = (tool(), condition());
    let mut job = job(&tool, &condition);
    job.floor =
        Some(FloorArea { length_mm: 2.0, width_mm: 110.0, across_mm: 0.0, resolution_mm: 0.05, trailing: true });
    let (report, findings) = judge(&job);
    let report = report.expect("a report");
    assert!(report.feasible, "{findings:?}");
    assert_eq!((report.periods_per_rev, report.edges_per_period), (1, 4.0));
    assert_near(report.period_s, 0.1, 1e-15);
    assert_near(report.feed_per_period_mm, 1.0, 1e-12);
    assert_near(report.hold_share, 0.3, 1e-12);
    assert_near(report.required_hold_share, 0.25, 1e-12);
    assert_near(report.phase_error_deg, 0.0, 1e-9);
    assert_eq!(report.finishing_edges, [4]);
    let phases: Vec<f64> = report.edges.iter().map(|edge| edge.phase_deg).collect();
    assert_eq!(phases, [0.0, 90.0, 180.0, 270.0]);

    let axial = report.loads[1].peaks;
    let rate = core::f64::consts::TAU / 0.04;
    assert_near(axial.acceleration_step_mm_per_s2, 740.22, 0.01);
    assert_near(axial.acceleration_mm_per_s2, 0.03 * rate * rate, 1e-9);
    assert_near(axial.velocity_mm_per_s, 0.03 * rate, 1e-12);
    let step = findings.iter().find(|finding| finding.code == "OSC-JERK-STEP").expect("the step is reported");
    assert_eq!(step.severity, Severity::Warning);
    assert_near(step.values[0].value, 740.22, 0.01);

    // Over the whole engagement: what the feed goes on, times depth and width of the cut.
    assert_near(report.plain_volume_mm3_per_rev, 1.0 * 1.0 * 120.0, 0.01);
    let shares: f64 = report.edges.iter().map(|edge| edge.volume_share).sum();
    assert_near(shares, 1.0, 1e-12);
    for edge in &report.plain {
        assert_near(edge.volume_share, 0.25, 1e-12);
        assert_near(edge.max_chip_mm, 0.25, 1e-4);
        assert_near(edge.duty, 0.5, 1e-12);
    }
    // Held long enough everywhere: the floor is as flat as without, 0.03 mm deeper.
    let floor = report.floor.expect("a floor");
    assert_eq!(floor.oscillating.unswept_share, 0.0);
    assert_near(floor.oscillating.height_mm, -0.03, 1e-8);
    assert!(floor.oscillating.peak_to_valley_mm < 1e-8, "{floor:?}");
    assert_eq!(floor.plain.peak_to_valley_mm, 0.0);
}

#[test]
fn an_unheld_protrusion_leaves_a_rough_floor() {
    let (tool, mut condition) = (tool(), condition());
    condition.axial.waveform = feedwave_cutting::tool_oscillation::Waveform::Sine;
    let mut job = job(&tool, &condition);
    job.floor =
        Some(FloorArea { length_mm: 2.0, width_mm: 110.0, across_mm: 0.0, resolution_mm: 0.05, trailing: false });
    let (report, _) = judge(&job);
    let floor = report.and_then(|report| report.floor).expect("a floor");
    // Midway between two passes the deepest one is 45° of the period off its peak.
    let expected = 0.03 * (1.0 - libm::cos(core::f64::consts::FRAC_PI_4));
    assert_near(floor.oscillating.peak_to_valley_mm, expected, 1e-4);
}

#[test]
fn the_step_of_roles_spreads_wear() {
    let (tool, condition) = (tool(), condition());
    for (leading, finishing) in [(1, 4), (2, 1), (3, 2), (4, 3)] {
        let mut job = job(&tool, &condition);
        job.leading_edge = leading;
        let (report, _) = judge(&job);
        let report = report.expect("a report");
        assert_eq!(report.finishing_edges, [finishing]);
        let edge = &report.edges[leading as usize - 1];
        assert_near(edge.phase_deg, 0.0, 1e-9);
    }
}

#[test]
fn two_periods_per_revolution_finish_with_two_edges() {
    let (tool, mut condition) = (tool(), condition());
    condition.period = feedwave_cutting::tool_oscillation::OscillationPeriod::Seconds(0.05);
    condition.leading_edge.phase_deg = -90.0;
    let (report, _) = judge(&job(&tool, &condition));
    let report = report.expect("a report");
    assert_eq!((report.periods_per_rev, report.edges_per_period), (2, 2.0));
    assert_eq!(report.finishing_edges, [1, 3]);
}
