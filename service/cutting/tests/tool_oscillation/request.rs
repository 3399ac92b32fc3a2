//! What a job asks for, and where the work is: conditions by name, the lead that moves on from part to part,
//! engagements, and the floor in the report of a program.

use feedwave_cutting::tool_oscillation::{
    Engagement, FloorArea, FloorSettings, HeightField, LeadingEdge, NamedCondition, OscillationRequest,
    OscillationSectionReport, RoleRotation, ToolGeometry, ToolOscillation, Waveform, WorkSide, judge,
};
use feedwave_cutting::{MachineProfile, PipelineConfig, Tool};
use feedwave_program::Finding;

use super::{assert_near, condition, job, tool};
use crate::common::{resume, run, snapshots, validate};

fn config() -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    let named = |number, name: &str| NamedCondition {
        name: name.to_owned(),
        number,
        tools: Vec::new(),
        condition: condition(),
        tables: Vec::new(),
    };
    let mut speed = named(2, "speed");
    speed.condition.feed.amplitude_mm = 0.2;
    profile.tool_oscillation = vec![named(1, "accuracy"), speed];
    let tool = Tool { number: 4, geometry: Some(tool()), ..Tool::default() };
    PipelineConfig { tools: vec![tool], ..PipelineConfig::new(profile) }
}

fn rotating(rotation: RoleRotation, request: OscillationRequest) -> PipelineConfig {
    let mut config = PipelineConfig { oscillation: request, ..config() };
    config.profile.tool_oscillation[0].condition.leading_edge = LeadingEdge { rotation, ..LeadingEdge::default() };
    config
}

fn program(word: &str, path: &str) -> String {
    format!("G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 {word} D1\n{path}\nG203\nM30\n")
}

const LINE: &str = "G1 X30 F600";

fn judged(text: &str, config: &PipelineConfig) -> (Vec<OscillationSectionReport>, Vec<Finding>) {
    let report = validate(text, config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    (report.oscillations, report.findings)
}

#[test]
fn the_job_chooses_the_condition_by_name() {
    let by_name = |name: &str| PipelineConfig {
        oscillation: OscillationRequest { condition: Some(name.to_owned()), ..Default::default() },
        ..config()
    };
    let amplitude = |sections: &[OscillationSectionReport]| sections[0].report.loads[0].amplitude_mm;
    let overridden = |findings: &[Finding]| findings.iter().filter(|it| it.code == "OSC-CONDITION-OVERRIDDEN").count();
    // It stands in for the program's, agrees with it, or overrides it.
    for (word, name, expected, warnings) in
        [("", "speed", 0.2, 0), ("P2", "speed", 0.2, 0), ("P1", "speed", 0.2, 1), ("P9", "accuracy", 0.4, 1)]
    {
        let text = program(word, LINE);
        let (sections, findings) = judged(&text, &by_name(name));
        assert_eq!((sections[0].condition.as_str(), amplitude(&sections)), (name, expected));
        assert_eq!(overridden(&findings), warnings, "{word}");
        let largest = run(&text, &by_name(name)).vibration.iter().copied().fold(0.0, f64::max);
        assert_near(largest, expected, 1e-3);
    }
    let report = validate(&program("P1", LINE), &by_name("fast"));
    assert!(!report.is_accepted());
    let unknown = report.findings.iter().find(|finding| finding.code == "OSC-CONDITION-UNKNOWN").expect("refused");
    assert!(unknown.suggestions[0].message.contains("P1 accuracy, P2 speed"), "{unknown:?}");
}

#[test]
fn requests_have_their_bounds() {
    let conditions = config().profile.tool_oscillation;
    let wrong = OscillationRequest {
        condition: Some("fast".to_owned()),
        parts_before: u64::MAX,
        cutting_time_before_s: f64::NAN,
    };
    let problems = wrong.problems(&conditions);
    let fields: Vec<&str> = problems.iter().map(|problem| problem.field.as_str()).collect();
    assert_eq!(fields, ["condition", "parts_before", "cutting_time_before_s"]);
    assert!(problems[0].message.contains("P1 accuracy, P2 speed"), "{}", problems[0].message);
    let valid = OscillationRequest { condition: Some("speed".to_owned()), ..Default::default() };
    assert_eq!(valid.problems(&conditions), []);
}

#[test]
fn the_lead_moves_on_from_part_to_part() {
    for (parts_before, edge) in [(0, 1), (9, 1), (10, 2), (35, 4), (40, 1)] {
        let request = OscillationRequest { parts_before, ..Default::default() };
        let config = rotating(RoleRotation::EveryParts(10), request);
        let text = program("P1", LINE);
        let (sections, findings) = judged(&text, &config);
        assert_eq!((sections[0].report.leading_edge, sections[0].roles.changes), (edge, parts_before / 10));
        assert_eq!((sections[0].roles.first_edge, sections[0].roles.parts_before), (1, parts_before));
        let log = findings.iter().find(|finding| finding.code == "OSC-ROLES-TURNED").expect("logged");
        assert_near(log.values[0].value, f64::from(edge), 0.0);
        // The setpoints are those of that edge.
        let setpoints = run(&text, &config);
        let oscillation = ToolOscillation::new(&tool(), &condition(), 1, edge).expect("possible");
        for index in setpoints.len() / 3..setpoints.len() / 2 {
            let expected = oscillation.offset(oscillation.phase_turns(setpoints.spindle[index] / 360.0, 0.0)).feed_mm;
            assert_near(setpoints.vibration[index], expected, 1e-8);
        }
    }
    // A word says which edge leads the first part.
    let request = OscillationRequest { parts_before: 25, ..Default::default() };
    let (sections, _) = judged(&program("P1 L4", LINE), &rotating(RoleRotation::EveryParts(10), request));
    assert_eq!((sections[0].report.leading_edge, sections[0].roles.first_edge), (2, 4));
}

#[test]
fn the_lead_moves_on_with_the_cutting_time_of_the_program_too() {
    // Every line takes three seconds, and the first seven came before.
    let request = OscillationRequest { cutting_time_before_s: 7.0, ..Default::default() };
    let config = rotating(RoleRotation::EverySeconds(5.0), request);
    let text = program("P1", "G1 X30 F600\nG203\nG202 P1 D1\nG1 X0\nG203\nG202 P1 D1\nG1 Y15\nG1 X15");
    let (sections, _) = judged(&text, &config);
    let leads: Vec<(u32, u64)> = sections.iter().map(|it| (it.report.leading_edge, it.roles.changes)).collect();
    assert_eq!(leads, [(2, 1), (3, 2), (3, 2)]);
    assert_near(sections[2].roles.cutting_time_before_s, 13.0, 1e-9);
    assert_near(validate(&text, &config).summary.oscillating_cutting_time_s, 9.0, 1e-9);
    // The time so far is part of what a stream resumes from.
    let whole = run(&text, &config);
    for (index, offset, snapshot) in &snapshots(text.as_bytes(), &config) {
        let (first, resumed) = resume(text.as_bytes(), &config, *offset, snapshot);
        assert_eq!(first, *index);
        for k in 0..resumed.len() {
            assert_eq!(resumed.bits(k), whole.bits(first as usize + k));
        }
    }
}

#[test]
fn another_feed_is_another_oscillation() {
    // The blend belongs to the feed: where it grows the oscillation is blended out and in again.
    let (sections, _) = judged(&program("P1", "G1 X20 F300\nG1 X40 F600\nG1 X60 F400"), &config());
    let ramps: Vec<f64> = sections.iter().map(|section| section.report.ramp_mm).collect();
    assert_eq!((sections.len(), &ramps[..]), (2, &[1.0, 2.0][..]));
    let setpoints = run(&program("P1", "G1 X20 F300\nG1 X40 F600\nG1 X60 F400"), &config());
    let base_mm = setpoints.path.last().expect("setpoints") - 60.0;
    let share_at = |mm: f64| {
        let index = setpoints.path.partition_point(|path| path - base_mm < mm);
        setpoints.vibration[index].abs()
    };
    assert!(share_at(20.0) < 1e-6, "{}", share_at(20.0));
    assert!((0..50).any(|step| share_at(39.5 + 0.02 * f64::from(step)) > 0.3));
}

#[test]
fn the_engagement_decides_chips_shares_and_duty() {
    let (tool, mut narrow) = (tool(), condition());
    let whole = judge(&job(&tool, &narrow)).0.expect("a report");
    assert_eq!(whole.plane_deg, 0.0);
    narrow.engagement = Engagement::Angles { entry_deg: 30.0, exit_deg: 90.0 };
    let mut narrow_job = job(&tool, &narrow);
    narrow_job.cut.engagement_deg = narrow.engagement.azimuths_deg(60.0, true);
    let report = judge(&narrow_job).0.expect("a report");
    assert_eq!(report.plane_deg, 30.0);
    // Half of the radius is in the work: feed times depth times width.
    assert_near(report.plain_volume_mm3_per_rev, 30.0, 0.01);
    for (edge, full) in report.plain.iter().zip(&whole.plain) {
        assert_near(edge.duty, full.duty / 3.0, 1e-9);
        assert_near(edge.max_chip_mm, 0.25 * libm::cos(30.0f64.to_radians()), 2e-3);
    }
    for edge in &report.edges {
        assert!(edge.chip_over_angle.iter().all(|[azimuth, _]| (30.0..=90.0).contains(azimuth)));
        assert!(edge.layers.iter().all(|layer| layer.to_mm > layer.from_mm));
        // Where it points in the feed direction is the same, in the work or not.
        let full = &whole.edges[edge.edge as usize - 1];
        assert_eq!((edge.phase_deg, edge.feed_offset_mm), (full.phase_deg, full.feed_offset_mm));
    }
    assert_near(report.edges.iter().map(|edge| edge.volume_share).sum(), 1.0, 1e-12);

    // As a width of the condition, in a program.
    let mut config = config();
    config.profile.tool_oscillation[0].condition.engagement =
        Engagement::Width { width_mm: 30.0, side: WorkSide::Right };
    let (sections, _) = judged(&program("P1", LINE), &config);
    let [entry_deg, exit_deg] = sections[0].cut.engagement_deg;
    assert_near(entry_deg, 30.0, 1e-9);
    assert_near(exit_deg, 90.0, 1e-9);
    assert_near(sections[0].report.volume_mm3_per_rev, report.volume_mm3_per_rev, 1e-6);
    config.profile.tool_oscillation[0].condition.engagement =
        Engagement::Width { width_mm: 121.0, side: WorkSide::Right };
    let refused = validate(&program("P1", LINE), &config);
    assert!(refused.findings.iter().any(|it| it.code == "OSC-VALUE" && it.values[0].value == 121.0));
}

#[test]
fn the_report_of_a_program_has_its_floor() {
    let relieved = |waveform| {
        let mut config = config();
        config.profile.tool_oscillation[0].condition.axial.waveform = waveform;
        config.tools[0].geometry = Some(ToolGeometry { end_relief_deg: 1.0, ..tool() });
        config
    };
    let held = relieved(Waveform::HeldPeak { hold_share: 0.3 });
    let (sections, _) = judged(&program("P1", LINE), &held);
    let floor = sections[0].report.floor.expect("a floor");
    assert_eq!((floor.area.length_mm, floor.area.resolution_mm, floor.area.trailing), (2.0, 0.02, true));
    assert_near(floor.oscillating.unswept_share, 0.0, 0.0);
    // Ahead, edge 4 alone finishes: it leaves the rise of its end over the feed of a revolution, and without oscillation
    // every edge leaves that over its own.
    let rise = libm::tan(1f64.to_radians());
    assert!(floor.plain.peak_to_valley_mm <= 0.25 * rise && floor.plain.peak_to_valley_mm > 0.1 * rise, "{floor:?}");
    assert!(floor.oscillating.peak_to_valley_mm > floor.plain.peak_to_valley_mm, "{floor:?}");
    assert!(floor.oscillating.mean_mm > 0.0 && floor.oscillating.mean_mm < floor.oscillating.peak_to_valley_mm);
    // It is the field's own roughness.
    let oscillation = ToolOscillation::new(
        held.tools[0].geometry.as_ref().expect("edges"),
        &held.profile.tool_oscillation[0].condition,
        1,
        1,
    );
    let geometry = held.tools[0].geometry.as_ref().expect("edges");
    let field = HeightField::simulate(geometry, &oscillation.expect("possible"), &sections[0].cut, &floor.area);
    assert_eq!(field.expect("possible").roughness(), floor.oscillating);
    // Without a hold it is rougher by what the protrusion lacks between two edges.
    let (sections, _) = judged(&program("P1", LINE), &relieved(Waveform::Sine));
    let rough = sections[0].report.floor.expect("a floor");
    assert!(rough.oscillating.peak_to_valley_mm > floor.oscillating.peak_to_valley_mm + 0.002, "{rough:?}");

    let mut without = held.clone();
    without.profile.oscillation_floor = FloorSettings { simulate: false, ..FloorSettings::default() };
    assert_eq!(judged(&program("P1", LINE), &without).0[0].report.floor, None);
    // A pass that is nearly still has no floor that could be examined, which forbids nothing.
    let (sections, findings) = judged(&program("P1", "G1 X0.001 F0.1"), &held);
    assert_eq!(sections[0].report.floor, None);
    assert!(findings.iter().all(|finding| finding.code != "OSC-FLOOR" || !finding.message.is_empty()));
}

#[test]
fn like_passes_are_judged_once_and_alike() {
    let pass = "G1 X30 F600\nG203\nG0 Z10\nG0 X0\nG0 Z-1\nG202 P1 D1\n";
    let text = program("P1", &format!("{}G1 X30", pass.repeat(40)));
    let (sections, findings) = judged(&text, &config());
    assert_eq!(sections.len(), 41);
    assert!(sections.iter().all(|section| section.report == sections[0].report));
    // Every pass has its findings in its own place.
    let lines: Vec<u32> =
        findings.iter().filter(|finding| finding.code == "OSC-ROLES").map(|finding| finding.span.line).collect();
    let places: Vec<u32> = sections.iter().map(|section| section.on_line).collect();
    assert_eq!(lines, places);
}

/// Whatever a profile permits, a program of many different cuts has a report of bounded size, and what was left out is said.
#[test]
fn floors_and_reports_of_extreme_profiles_are_bounded() {
    let mut extreme = config();
    let geometry = ToolGeometry::even(64, 60.0, 1.5, 5.0);
    extreme.tools[0].geometry = Some(geometry);
    extreme.profile.oscillation_floor =
        FloorSettings { revolutions: 100, resolution_mm: 0.001, max_cells: 32_000_000, ..FloorSettings::default() };
    let passes: String =
        (0..300).map(|index| format!("S{}\nG1 X{} F500\nG203\nG202 P1 D1\n", 500 + index, (index % 2) * 30)).collect();
    let report = validate(&program("P1", &format!("{passes}G1 Y30")), &extreme);
    let numbers = |section: &OscillationSectionReport| -> usize {
        section.report.edges.iter().map(|edge| 4 * edge.layers.len() + 2 * edge.chip_over_angle.len()).sum()
    };
    let listed: usize = report.oscillations.iter().map(numbers).sum();
    assert!(listed <= 800_000, "{listed}");
    assert!(report.summary.oscillation_count >= report.oscillations.len() as u64);
    let floors = report.oscillations.iter().filter_map(|section| section.report.floor).collect::<Vec<_>>();
    let cells = |area: &FloorArea| area.length_mm * area.width_mm / (area.resolution_mm * area.resolution_mm);
    assert!(floors.iter().all(|floor| cells(&floor.area) < 4_000_100.0) && floors.len() <= 32);
    let left_out = report.oscillations.iter().any(|section| section.report.floor.is_none());
    let said = report.findings.iter().any(|finding| finding.code == "OSC-FLOOR");
    assert_eq!(left_out, said);
}

#[test]
fn the_floors_of_a_program_are_counted() {
    // Every pass has a feed of its own.
    let passes: String =
        (0..40).map(|index| format!("G1 X{} F{}\nG203\nG202 P1 D1\n", (index % 2) * 30, 500 + index)).collect();
    let (sections, findings) = judged(&program("P1", &format!("{passes}G1 Y30")), &config());
    let floors = sections.iter().filter(|section| section.report.floor.is_some()).count();
    assert_eq!((sections.len(), floors), (40, 32));
    let ended = findings.iter().filter(|finding| finding.code == "OSC-FLOOR").count();
    assert_eq!(ended, 1);
}
