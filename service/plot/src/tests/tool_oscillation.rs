//! Pictures of oscillating passes.

use feedwave_cutting::tool_oscillation::{
    DirectionLimits, DirectionOscillation, Engagement, LeadingEdge, OscillationCondition, OscillationCut,
    OscillationJob, OscillationLimits, OscillationPeriod, OscillationSectionReport, RoleReport, RoleRotation,
    ToolGeometry, ToolOscillation, Waveform, judge,
};

use crate::figure::Figure;
use crate::{OscillationPictures, canvas};

pub(super) fn figures() -> Vec<Figure> {
    let mut measured = ToolGeometry::even(4, 60.0, 1.5, 5.0);
    measured.end_relief_deg = 0.1;
    for (edge, out_mm) in measured.edges.iter_mut().zip([0.003, -0.002, 0.004, 0.001]) {
        edge.axial_set_over_mm = out_mm;
    }
    let mut many = ToolGeometry::even(25, 3.0, 2.0, 0.02);
    many.end_relief_deg = 10.0;
    let tools = [(ToolGeometry::even(4, 60.0, 1.5, 5.0), 1), (measured, 1), (many, 25)];
    tools
        .iter()
        .flat_map(|(tool, periods)| with(tool, *periods, 600.0, Some(0.05), crate::tool_oscillation::figures))
        .collect()
}

/// Name and SVG of every picture.
fn draw(
    tool: &ToolGeometry,
    periods_per_rev: u32,
    feed_mm_per_min: f64,
    across_mm: Option<f64>,
) -> Vec<(String, String)> {
    let figures = with(tool, periods_per_rev, feed_mm_per_min, across_mm, crate::tool_oscillation::figures);
    let names: Vec<_> = figures.iter().map(|figure| figure.name.as_str()).collect();
    assert_eq!(names, ["waveform", "path", "edges", "stages", "layers", "floor"].map(|name| format!("pass-{name}")));
    for figure in &figures {
        canvas::pixels(figure).unwrap();
    }
    figures.iter().map(|figure| (figure.name.clone(), canvas::svg_text(figure).unwrap())).collect()
}

/// The worked example of docs/functions/tool-oscillation.md, or it with another tool, feed and motion across.
fn with<T>(
    tool: &ToolGeometry,
    periods_per_rev: u32,
    feed_mm_per_min: f64,
    across_mm: Option<f64>,
    use_it: impl FnOnce(&OscillationPictures<'_>) -> T,
) -> T {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    let condition = OscillationCondition {
        period: OscillationPeriod::PerRevolution(periods_per_rev),
        feed: direction(0.4, Waveform::Sine),
        axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }),
        cross: across_mm.map(|amplitude_mm| direction(amplitude_mm, Waveform::Sine)),
        leading_edge: LeadingEdge::default(),
        ramp_periods: 2,
        may_overrun: false,
        engagement: Engagement::default(),
    };
    let cut = OscillationCut {
        feed_mm_per_min,
        spindle_rev_per_min: 600.0,
        clockwise: true,
        depth_mm: 1.0,
        engagement_deg: [-90.0, 90.0],
        incline_deg: 0.0,
    };
    let limits = DirectionLimits { velocity_mm_per_s: 500.0, acceleration_mm_per_s2: 1e5, jerk_mm_per_s3: 5_000_000.0 };
    let job = OscillationJob {
        tool,
        condition: &condition,
        leading_edge: 1,
        cut,
        limits: OscillationLimits { plane: limits, axial: limits },
        max_feed_override: 1.0,
        drives: None,
        floor: None,
        span: feedwave_program::SourceSpan { line: 7, column: 1, length: 4, ..feedwave_program::SourceSpan::default() },
    };
    let report = judge(&job).0.unwrap();
    let oscillation = ToolOscillation::new(tool, &condition, periods_per_rev, 1).unwrap();
    let condition = "accuracy".to_owned();
    let roles = RoleReport {
        first_edge: 1,
        rotation: RoleRotation::Fixed,
        parts_before: 0,
        cutting_time_before_s: 0.0,
        changes: 0,
    };
    let section = OscillationSectionReport { on_line: 7, line: 8, tool: 4, condition, roles, cut, report };
    let pass = OscillationPictures { name: "pass".to_owned(), tool, oscillation: &oscillation, section: &section };
    use_it(&pass)
}

fn text<'a>(drawn: &'a [(String, String)], name: &str) -> &'a str {
    let wanted = format!("pass-{name}");
    &drawn.iter().find(|(name, _)| *name == wanted).unwrap().1
}

#[test]
fn a_pass_has_six_pictures_with_its_figures() {
    let drawn = draw(&ToolGeometry::even(4, 60.0, 1.5, 5.0), 1, 600.0, None);
    for (name, wanted) in [
        ("waveform", ["held for 0.3 of the period, 0.25 needed", "E4", "forwards, mm"]),
        ("path", ["along the feed, mm", "away from the work, mm", "E4 points ahead"]),
        ("edges", ["to the right of the feed, mm", "without oscillation", "E2"]),
        ("stages", ["removes 0.3545 mm²", "1 × 0.03 mm", "surface of the work at 1 mm"]),
        ("stages", ["are magnified", "0.35 ×", "surface after the pass"]),
        ("layers", ["1.03 mm² per revolution", "35.5 %", "finishes"]),
        ("layers", ["surface before and after", "the same without oscillation", "of the volume, %"]),
        ("floor", ["both floors are flat", "along the feed, mm", "without oscillation"]),
    ] {
        let text = text(&drawn, name);
        for wanted in wanted {
            assert!(text.contains(wanted), "{name}: {wanted}");
        }
    }
}

#[test]
fn an_oscillation_that_leaves_the_rougher_floor_says_why() {
    let figures = figures();
    let floors: Vec<_> = figures.iter().filter(|figure| figure.name == "pass-floor").collect();
    let notes = |figure: &Figure| -> String {
        crate::layout::panels(&figure.body).iter().flat_map(|panel| panel.notes.clone()).collect()
    };
    let wanted = "E4 finishes ahead of the tool, but E3 protrudes 3 µm further";
    assert!(notes(floors[1]).contains(wanted), "{}", notes(floors[1]));
    assert!(!notes(floors[0]).contains("rougher"));
}

#[test]
fn unusual_tools_and_feeds_are_drawn_too() {
    let mut tool = ToolGeometry::even(25, 3.0, 2.0, 0.02);
    tool.end_relief_deg = 10.0;
    assert!(text(&draw(&tool, 25, 600.0, Some(0.05)), "waveform").contains("across both"));
    let drawn = draw(&ToolGeometry::even(1, 1_000.0, 1e-3, 1_000.0), 1, 0.01, None);
    assert!(text(&drawn, "floor").contains("the feed is too small"));
}
