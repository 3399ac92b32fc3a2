//! Every condition of docs/functions/tool-oscillation.md ("Conditions") with its numbers and its cure.

use feedwave_cutting::tool_oscillation::{
    ConditionChoice, ConditionTable, DirectionOscillation, Engagement, FloorArea, HeightField, Interpolation,
    NamedCondition, OscillationCondition, OscillationCut, OscillationDrives, OscillationJob, OscillationPeriod,
    TableQuantity, ToolGeometry, ToolOscillation, Waveform, condition_problems, find_condition, judge,
};
use feedwave_cutting::{AxisDrive, DriveModel, FollowingModel};
use feedwave_program::{Axis, Finding, Severity};

use super::{assert_near, condition, job, tool};

#[track_caller]
fn found(job: &OscillationJob<'_>, code: &str, severity: Severity) -> Finding {
    let (_, findings) = judge(job);
    let finding = findings.iter().find(|finding| finding.code == code);
    let finding = finding.unwrap_or_else(|| panic!("no {code} among {findings:?}"));
    assert_eq!(finding.severity, severity);
    assert_eq!(finding.span.line, 7);
    finding.clone()
}

#[track_caller]
fn suggested(finding: &Finding, name: &str) -> f64 {
    let values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
    values.filter(|value| value.name == name).map(|value| value.value).next().expect("a suggested value")
}

#[track_caller]
fn value(finding: &Finding, name: &str) -> f64 {
    finding.values.iter().find(|value| value.name == name).map(|value| value.value).expect("a value")
}

#[test]
fn the_example_has_nothing_but_its_step_and_its_roles() {
    let (_, findings) = judge(&job(&tool(), &condition()));
    let codes: Vec<&str> = findings.iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes, ["OSC-ROLES", "OSC-JERK-STEP"]);
}

#[test]
fn a_period_that_fits_no_revolution_is_refused() {
    let mut condition = condition();
    condition.period = OscillationPeriod::Seconds(0.06);
    let tool = tool();
    let finding = found(&job(&tool, &condition), "OSC-PERIOD-FRACTION", Severity::Error);
    assert_eq!(suggested(&finding, "periods_per_rev"), 2.0);
    assert_near(suggested(&finding, "period"), 0.05, 1e-12);
    condition.period = OscillationPeriod::Seconds(0.050_000_1);
    assert!(judge(&job(&tool, &condition)).0.is_some());
}

#[test]
fn periods_have_to_divide_the_edges() {
    let mut condition = condition();
    condition.period = OscillationPeriod::PerRevolution(3);
    let finding = found(&job(&tool(), &condition), "OSC-EDGES-PERIOD", Severity::Error);
    assert_eq!(suggested(&finding, "periods_per_rev"), 2.0);
    let (report, _) = judge(&job(&tool(), &condition));
    assert!(!report.expect("the figures all the same").feasible);
}

#[test]
fn a_short_hold_says_the_required_one() {
    let mut condition = condition();
    condition.axial.waveform = Waveform::HeldPeak { hold_share: 0.2 };
    let finding = found(&job(&tool(), &condition), "OSC-HOLD-SHORT", Severity::Warning);
    assert_near(value(&finding, "hold_share"), 0.2, 1e-12);
    assert_near(suggested(&finding, "hold_share"), 0.25, 1e-12);
    // Two edges per period need more than both holds can have.
    condition.period = OscillationPeriod::PerRevolution(2);
    let finding = found(&job(&tool(), &condition), "OSC-HOLD-SHORT", Severity::Warning);
    assert_eq!(suggested(&finding, "periods_per_rev"), 1.0);
    // An uneven pitch needs a longer hold.
    let mut uneven = tool();
    uneven.edges[1].angle_deg = 100.0;
    let finding = found(&job(&uneven, &super::condition()), "OSC-ROLES", Severity::Info);
    assert_eq!(value(&finding, "expected_finishing_edges"), 1.0);
    uneven.edges[1].angle_deg = 120.0;
    let finding = found(&job(&uneven, &super::condition()), "OSC-HOLD-SHORT", Severity::Warning);
    assert_near(suggested(&finding, "hold_share"), 0.3334, 1e-9);
}

#[test]
fn a_long_step_says_the_largest_feed() {
    let (mut tool, condition) = (tool(), condition());
    tool.radial_edge_length_mm = 0.8;
    let finding = found(&job(&tool, &condition), "OSC-STEP-LONG", Severity::Error);
    assert_near(suggested(&finding, "feed"), 480.0, 1e-9);
    assert_near(suggested(&finding, "spindle_speed"), 750.0, 1e-9);
    let mut cured = job(&tool, &condition);
    cured.cut.feed_mm_per_min = 480.0;
    assert!(judge(&cured).0.expect("a report").feasible);
}

#[test]
fn the_phase_error_is_cured_by_its_suggestion() {
    for (phase_deg, severity) in [(-30.0, Severity::Warning), (40.0, Severity::Warning), (170.0, Severity::Error)] {
        let mut condition = condition();
        condition.axial.phase_deg = phase_deg;
        let finding = found(&job(&tool(), &condition), "OSC-PHASE", severity);
        assert_near(value(&finding, "phase_error"), -phase_deg, 1e-9);
        condition.axial.phase_deg = suggested(&finding, "axial_phase");
        assert_near(judge(&job(&tool(), &condition)).0.expect("a report").phase_error_deg, 0.0, 1e-9);
    }
}

#[test]
fn the_phase_that_the_drives_ask_for_ends_every_word_about_it() {
    let drive = |gain_per_s| DriveModel { position_loop_gain_per_s: Some(gain_per_s), ..DriveModel::default() };
    let model = FollowingModel { common: drive(120.0), axes: vec![AxisDrive { axis: Axis::Z, drive: drive(60.0) }] };
    let (tool, mut condition) = (tool(), condition());
    let warned = |condition: &OscillationCondition| {
        let drives = Some(OscillationDrives { model: &model, guided: false });
        let findings = judge(&OscillationJob { drives, ..job(&tool, condition) }).1;
        let about = |finding: &&Finding| ["OSC-FOLLOWING", "OSC-PHASE"].contains(&finding.code.name());
        let warned = findings.into_iter().filter(|finding| about(&finding) && finding.severity != Severity::Info);
        warned.collect::<Vec<_>>()
    };
    let found = warned(&condition);
    assert_eq!(found.len(), 1, "{found:#?}");
    condition.axial.phase_deg = suggested(&found[0], "axial_phase");
    assert_eq!(warned(&condition), []);
}

#[test]
fn limits_say_the_largest_amplitude_and_speed() {
    let (tool, condition) = (tool(), condition());
    let mut limited = job(&tool, &condition);
    limited.limits.axial.acceleration_mm_per_s2 = 500.0;
    limited.limits.plane.velocity_mm_per_s = 30.0;
    let finding = found(&limited, "OSC-AXIS-ACCELERATION", Severity::Error);
    assert_near(value(&finding, "demanded"), 740.22, 0.01);
    let amplitude_mm = suggested(&finding, "axial_amplitude");
    assert_near(amplitude_mm, 0.0202, 1e-9);
    let velocity = found(&limited, "OSC-AXIS-VELOCITY", Severity::Error);
    let mut cured = condition.clone();
    cured.axial.amplitude_mm = amplitude_mm;
    cured.feed.amplitude_mm = suggested(&velocity, "feed_amplitude");
    let cured = OscillationJob { condition: &cured, ..limited };
    assert!(judge(&cured).0.expect("a report").feasible);
    limited.cut.spindle_rev_per_min = suggested(&finding, "spindle_speed");
    limited.limits.plane.velocity_mm_per_s = 500.0;
    let (_, findings) = judge(&limited);
    assert!(findings.iter().all(|finding| finding.code != "OSC-AXIS-ACCELERATION"), "{findings:?}");
}

#[test]
fn the_jerk_limited_peak_has_no_step() {
    let mut condition = condition();
    condition.axial.waveform = Waveform::JerkLimitedHeldPeak { hold_share: 0.3 };
    let (report, findings) = judge(&job(&tool(), &condition));
    assert!(findings.iter().all(|finding| finding.code != "OSC-JERK-STEP"));
    // 15/(0.1·0.1 s)³ · 0.03 mm
    assert_near(report.expect("a report").loads[1].peaks.jerk_mm_per_s3, 450_000.0, 1e-3);
}

#[test]
fn depth_beyond_the_edges_needs_stages() {
    let (mut tool, condition) = (tool(), condition());
    tool.axial_edge_height_mm = 1.03;
    // E2 takes the surface away before E4 comes down: 1.06 mm on edges of 1.03 mm.
    let finding = found(&job(&tool, &condition), "OSC-DEPTH", Severity::Info);
    assert_near(value(&finding, "reach"), 1.06, 1e-12);
    tool.axial_edge_height_mm = 0.9;
    let finding = found(&job(&tool, &condition), "OSC-DEPTH", Severity::Error);
    assert!(value(&finding, "left_above_edge") > 0.0);
    let mut cured = job(&tool, &condition);
    cured.cut.depth_mm = suggested(&finding, "depth");
    assert!(judge(&cured).0.expect("a report").feasible);
}

#[test]
fn a_cure_of_the_phase_is_no_negative_zero() {
    let (tool, mut condition) = (tool(), condition());
    condition.axial.phase_deg = 30.0;
    let finding = found(&job(&tool, &condition), "OSC-PHASE", Severity::Warning);
    assert_eq!(finding.suggestions[0].message, "let the axial oscillation run ahead by 0 degrees");
    assert_eq!(suggested(&finding, "axial_phase").to_bits(), 0.0f64.to_bits());
}

#[test]
fn finishing_edges_of_the_tool_data_are_led_to() {
    let (mut tool, condition) = (tool(), condition());
    tool.edges[1].finishing = true;
    let finding = found(&job(&tool, &condition), "OSC-FINISHING-EDGE", Severity::Warning);
    let mut cured = job(&tool, &condition);
    cured.leading_edge = suggested(&finding, "leading_edge") as u32;
    assert_eq!(judge(&cured).0.expect("a report").finishing_edges, [2]);
}

#[test]
fn impossible_values_are_refused_with_numbers() {
    let mut bad = condition();
    bad.feed.amplitude_mm = f64::NAN;
    bad.axial.waveform = Waveform::HeldPeak { hold_share: 0.9 };
    bad.ramp_periods = 0;
    let tool = tool();
    let mut job = job(&tool, &bad);
    job.leading_edge = 5;
    job.cut.spindle_rev_per_min = 0.0;
    let (report, findings) = judge(&job);
    assert!(report.is_none());
    let codes: Vec<&str> = findings.iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes, ["OSC-VALUE", "OSC-VALUE", "OSC-VALUE", "OSC-WAVEFORM", "OSC-LEADING-EDGE"]);
    assert!(findings.iter().all(|finding| !finding.suggestions.is_empty() && !finding.values.is_empty()));
    for broken in [
        ToolGeometry { edges: Vec::new(), ..tool.clone() },
        ToolGeometry { radius_mm: f64::INFINITY, ..tool.clone() },
        ToolGeometry { radial_edge_length_mm: 61.0, ..tool.clone() },
        ToolGeometry { end_relief_deg: -1.0, ..tool.clone() },
    ] {
        found(&super::job(&broken, &condition()), "OSC-TOOL", Severity::Error);
    }
    let mut swapped = tool.clone();
    swapped.edges.swap(0, 1);
    found(&super::job(&swapped, &condition()), "OSC-TOOL", Severity::Error);
}

#[test]
fn a_named_condition_is_found_for_its_tool() {
    let named = |name: &str, number, tools: &[u32], amplitude_mm| NamedCondition {
        name: name.to_owned(),
        number,
        tools: tools.to_vec(),
        condition: OscillationCondition {
            feed: DirectionOscillation { amplitude_mm, ..condition().feed },
            ..condition()
        },
        tables: Vec::new(),
    };
    let kept = [named("accuracy", 1, &[], 0.4), named("accuracy", 1, &[12], 0.3), named("speed", 2, &[5], 0.6)];
    let amplitude =
        |choice, tool| find_condition(&kept, choice, tool).map(|found| found.at(600.0, 600.0).feed.amplitude_mm);
    use ConditionChoice::{Name, Number};
    assert_eq!(amplitude(Number(1), 3), Some(0.4));
    assert_eq!(amplitude(Number(1), 12), Some(0.3));
    assert_eq!(amplitude(Number(2), 5), Some(0.6));
    assert_eq!(amplitude(Number(2), 6), None);
    assert_eq!(amplitude(Name("accuracy"), 12), Some(0.3));
    assert_eq!(amplitude(Name("speed"), 5), Some(0.6));
    assert_eq!(amplitude(Name("Speed"), 5), None);
    assert_eq!(condition_problems(&kept), []);
}

#[test]
fn what_a_machine_keeps_is_bounded_and_unambiguous() {
    let named = |name: &str, number, tools: std::ops::Range<u32>| NamedCondition {
        name: name.to_owned(),
        number,
        tools: tools.collect(),
        condition: condition(),
        tables: Vec::new(),
    };
    let table = |quantity| ConditionTable {
        quantity,
        interpolation: Interpolation::Linear,
        feed_mm_per_min: vec![100.0],
        spindle_rev_per_min: vec![600.0],
        values: vec![vec![0.1]],
    };
    let fields = |conditions: &[NamedCondition]| -> Vec<String> {
        condition_problems(conditions).into_iter().map(|problem| problem.field).collect()
    };
    let many: Vec<_> = (0..65).map(|number| named(&number.to_string(), number, 0..0)).collect();
    assert_eq!(fields(&many), ["tool_oscillation"]);
    let mut some = vec![
        named("a", 1, 1..257),
        named("b", 2, 1..258),
        named("a", 3, 256..300),
        named("c", 1, 256..300),
        named("d", 4, 0..0),
        named("e", 5, 0..0),
        named("f", 6, 0..0),
    ];
    some[4].tables = vec![table(TableQuantity::FeedAmplitude); 5];
    some[5].tables = vec![table(TableQuantity::FeedAmplitude), table(TableQuantity::FeedAmplitude)];
    some[5].tables[0].feed_mm_per_min = (0..33).map(f64::from).collect();
    some[6].condition.engagement = Engagement::Angles { entry_deg: 40.0, exit_deg: 30.0 };
    let expected = [
        "tool_oscillation[1].tools",
        "tool_oscillation[2].name",
        "tool_oscillation[3].number",
        "tool_oscillation[4].tables",
        "tool_oscillation[5].tables[0]",
        "tool_oscillation[5].tables[1].quantity",
        "tool_oscillation[6].engagement",
    ];
    assert_eq!(fields(&some), expected);
}

/// Points of the table that a cure names.
fn points(cure: &str) -> Vec<[f64; 2]> {
    let points = cure.split('(').skip(1).map(|point| {
        let numbers: Vec<f64> =
            point.split(')').next().unwrap().split(", ").map(|number| number.parse().unwrap()).collect();
        [numbers[0], numbers[1]]
    });
    points.collect()
}

/// Peak to valley of the middle of the floor.
fn floor_mm(tool: &ToolGeometry, condition: &OscillationCondition, trailing: bool) -> f64 {
    let cut = OscillationCut { feed_mm_per_min: 300.0, ..super::cut() };
    let oscillation = ToolOscillation::new(tool, condition, 1, 1).expect("possible");
    let area = FloorArea { length_mm: 1.0, width_mm: 2.0, across_mm: 0.0, resolution_mm: 0.02, trailing };
    HeightField::simulate(tool, &oscillation, &cut, &area).expect("bounded").roughness().peak_to_valley_mm
}

#[test]
fn the_hold_that_is_asked_for_makes_a_smooth_floor_whatever_the_number_of_edges() {
    for edges in 2..=6 {
        let tool = ToolGeometry::even(edges, 5.0, 1.5, 5.0);
        let mut condition = condition();
        let needed = 1.0 / edges as f64;
        condition.axial.waveform = Waveform::HeldPeak { hold_share: (needed - 0.02).min(0.48) };
        let finding = found(&job(&tool, &condition), "OSC-HOLD-SHORT", Severity::Warning);
        assert_near(value(&finding, "required"), needed, 1e-12);
        let rough_mm = [true, false].map(|trailing| floor_mm(&tool, &condition, trailing));
        let cure = &finding.suggestions[0];
        condition.axial.waveform = if edges == 2 {
            Waveform::Table { points: points(&cure.message) }
        } else {
            Waveform::HeldPeak { hold_share: suggested(&finding, "hold_share") }
        };
        let (report, findings) = judge(&job(&tool, &condition));
        assert!(findings.iter().all(|finding| finding.code != "OSC-HOLD-SHORT"), "{edges} edges: {findings:#?}");
        let report = report.expect("a report");
        assert!(report.hold_share >= needed - 1e-9 && report.phase_error_deg.abs() < 1e-6, "{report:#?}");
        let smooth_mm = [true, false].map(|trailing| floor_mm(&tool, &condition, trailing));
        assert_eq!(smooth_mm, [0.0; 2], "{edges} edges");
        condition.axial.waveform = Waveform::HeldPeak { hold_share: 0.0 };
        let unheld_mm = floor_mm(&tool, &condition, true);
        assert!(unheld_mm > 1e-5, "{edges} edges without hold: {unheld_mm} mm");
        if edges == 2 {
            // However long extremes are held alike, both edges pass one azimuth half way between them.
            assert!(rough_mm.iter().all(|rough_mm| *rough_mm > 0.9 * 0.03), "{rough_mm:?}");
        }
    }
}

#[test]
fn the_range_of_feed_ends_where_the_step_is_as_long_as_the_edge() {
    let (tool, condition) = (tool(), condition());
    let (report, _) = judge(&job(&tool, &condition));
    // 1.5 mm of edge in a period of 0.1 s.
    assert_eq!(report.expect("possible").feed_range_mm_per_min, [0.0, 900.0]);
    let with_override = |feed_mm_per_min: f64, max_feed_override: f64| {
        let job = job(&tool, &condition);
        let cut = OscillationCut { feed_mm_per_min, ..job.cut };
        let (report, findings) = judge(&OscillationJob { cut, max_feed_override, ..job });
        assert_eq!(report.expect("possible").feed_range_mm_per_min, [0.0, 900.0]);
        findings.into_iter().find(|finding| finding.code == "OSC-OVERRIDE")
    };
    assert_eq!(with_override(600.0, 1.5), None);
    let finding = with_override(800.0, 1.5).expect("1200 mm/min are too many");
    assert_eq!((value(&finding, "override"), value(&finding, "max_feed")), (1.125, 900.0));
    let cure = suggested(&finding, "feed");
    assert_eq!(cure, 600.0);
    assert_eq!(with_override(cure, 1.5), None);
    // What does not hold at the programmed feed is another finding.
    assert_eq!(with_override(1_000.0, 1.5), None);
}

#[test]
fn the_range_of_feed_of_a_staged_removal_is_where_nothing_is_left_above_an_edge() {
    let condition = condition();
    // Depth and axial travel are higher than the edges.
    let tool = ToolGeometry::even(4, 60.0, 1.5, 1.03);
    let job = job(&tool, &condition);
    let (report, findings) = judge(&job);
    let report = report.expect("possible");
    assert!(report.axial_reach_mm > tool.axial_edge_height_mm);
    let above_mm = |feed_mm_per_min: f64| {
        let cut = OscillationCut { feed_mm_per_min, ..job.cut };
        judge(&OscillationJob { cut, ..job }).0.expect("possible").above_edge_mm
    };
    let [low, high] = report.feed_range_mm_per_min;
    if report.above_edge_mm > 1e-6 {
        assert_eq!([low, high], [0.0; 2], "{findings:?}");
        return;
    }
    for share in 1..20 {
        let feed = low + (high - low) * f64::from(share) / 20.0;
        assert!(above_mm(feed) <= 1e-6, "{feed}");
    }
    if high < 900.0 - 1e-3 {
        assert!(above_mm(high + 1e-2) > 1e-6, "{high}");
    }
    if low > 0.0 {
        assert!(above_mm(low - 1e-2) > 1e-6, "{low}");
    }
}
