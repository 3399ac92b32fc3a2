//! Oscillation in programs: setpoints against the formula of docs/functions/tool-oscillation.md ("Motion"), step by
//! step from their own spindle angle and path position.

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, NamedCondition, OscillationPeriod, ToolOscillation, Waveform, blend,
};
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, Tool, ValidationReport};
use feedwave_program::Severity;
use proptest::prelude::*;

use super::{condition, tool};
use crate::common::{Setpoints, machines, resume, run, snapshots, validate};

const DEPTH_MM: f64 = 1.0;
/// Two periods of 1 mm.
const RAMP_MM: f64 = 2.0;

pub fn config() -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    let named = |number, name: &str| NamedCondition {
        name: name.to_owned(),
        number,
        tools: Vec::new(),
        condition: condition(),
        tables: Vec::new(),
    };
    let mut smooth = named(2, "smooth");
    smooth.condition.axial.waveform = Waveform::JerkLimitedHeldPeak { hold_share: 0.3 };
    let mut odd = named(3, "odd");
    odd.condition.period = OscillationPeriod::PerRevolution(3);
    profile.tool_oscillation = vec![named(1, "accuracy"), smooth, odd];
    PipelineConfig {
        tools: vec![
            Tool { number: 4, geometry: Some(tool()), ..Tool::default() },
            Tool { number: 5, ..Tool::default() },
        ],
        ..PipelineConfig::new(profile)
    }
}

pub fn program(path: &str) -> String {
    format!("G21 G90 G17 G94 T4 M6\nM3 S600\nG0 X0 Y0 Z-1\nG202 P1 D{DEPTH_MM}\n{path}\nG203\nM30\n")
}

/// Command and feed direction at a distance along the path.
type Path = dyn Fn(f64) -> ([f64; 2], [f64; 2]);

/// Every setpoint of the section of `length_mm` is the command plus the oscillation at its own spindle angle.
#[track_caller]
fn assert_oscillates(setpoints: &Setpoints, clockwise: bool, length_mm: f64, path: &Path) {
    let oscillation = ToolOscillation::new(&tool(), &condition(), 1, 1).expect("possible");
    let base_mm = setpoints.path.last().expect("setpoints") - length_mm;
    let mut whole = 0;
    for index in 0..setpoints.len() {
        let along_mm = setpoints.path[index] - base_mm;
        if along_mm <= 0.0 {
            continue;
        }
        let share = blend(along_mm / RAMP_MM) * blend((length_mm - along_mm) / RAMP_MM);
        whole += u32::from(share == 1.0);
        let ([x, y], [dx, dy]) = path(along_mm);
        let azimuth_deg = libm::atan2(dy, dx).to_degrees();
        // An edge points ahead when the spindle has turned it there.
        let turned_deg =
            if clockwise { setpoints.spindle[index] + azimuth_deg } else { -setpoints.spindle[index] - azimuth_deg };
        let offset = oscillation.offset(turned_deg / 360.0);
        let expected = [
            x + share * offset.feed_mm * dx,
            y + share * offset.feed_mm * dy,
            -DEPTH_MM + share * offset.retraction_mm,
        ];
        for (column, expected) in setpoints.axes.iter().zip(expected) {
            assert!(
                (column[index] - expected).abs() < 1e-8,
                "setpoint {index}: {} instead of {expected}",
                column[index]
            );
        }
        assert!((setpoints.vibration[index] - share * offset.feed_mm).abs() < 1e-8);
    }
    assert!(whole > 100, "{whole} setpoints of the whole oscillation");
}

#[track_caller]
fn refused(program: &str, code: &str) -> ValidationReport {
    let report = validate(program, &config());
    let found = report.findings.iter().find(|finding| finding.code == code);
    let found = found.unwrap_or_else(|| panic!("no {code} among {:#?}", report.findings));
    assert_eq!(found.severity, Severity::Error);
    assert!(!found.suggestions.is_empty());
    assert!(!report.is_accepted());
    report
}

#[test]
fn a_line_oscillates_in_step_with_the_spindle() {
    for (path, azimuth_deg, length_mm) in [
        ("G1 X30 F600", 0.0f64, 30.0),
        ("G1 Y-20 F600", -90.0, 20.0),
        ("G1 X-12 Y16 F600", 126.869_897_645_844_02, 20.0),
    ] {
        let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
        let line = move |s: f64| ([s * cos, s * sin], [cos, sin]);
        for (spindle, clockwise) in [("M3 ", true), ("M4 ", false)] {
            let setpoints = run(&program(path).replace("M3 ", spindle), &config());
            assert_oscillates(&setpoints, clockwise, length_mm, &line);
            // Both ends are exact, and the tool never passes them.
            for index in 0..setpoints.len() {
                let along = setpoints.axes[0][index] * cos + setpoints.axes[1][index] * sin;
                assert!((-1e-9..=length_mm + 1e-9).contains(&along), "{along}");
            }
            let last = setpoints.len() - 1;
            assert!((setpoints.axes[0][last] - length_mm * cos).abs() < 1e-9);
            assert_eq!(setpoints.axes[2][last], -DEPTH_MM);
        }
    }
}

#[test]
fn the_feed_direction_follows_an_arc() {
    let setpoints = run(&program("G3 X0 Y80 I0 J40 F600"), &config());
    let circle = |s: f64| {
        let (sin, cos) = libm::sincos(s / 40.0);
        ([40.0 * sin, 40.0 - 40.0 * cos], [cos, sin])
    };
    assert_oscillates(&setpoints, true, 40.0 * core::f64::consts::PI, &circle);
}

#[test]
fn an_override_keeps_the_step() {
    let line = |s: f64| ([s, 0.0], [1.0, 0.0]);
    let changes = [(1_500, 1.7), (2_000, 0.4), (2_600, 0.0), (3_100, 2.0)];
    let overrides = changes.map(|(index, ratio)| OverrideChange { index, ratio }).to_vec();
    let setpoints = run(&program("G1 X30 F600"), &PipelineConfig { overrides, ..config() });
    assert!((2_700..3_000).any(|index| setpoints.feed[index] == 0.0 && setpoints.vibration[index] != 0.0));
    assert_oscillates(&setpoints, true, 30.0, &line);
}

#[test]
fn a_hold_within_short_blocks_ends_with_little_looked_ahead() {
    // The blend reaches over twenty blocks, of which four are planned at a time.
    let blocks: String = (1..=300).map(|block| format!("G1 X{:.1} F600\n", 0.1 * f64::from(block))).collect();
    let overrides = [(900, 0.0), (1_200, 1.0), (1_937, 0.3), (2_400, 0.0), (2_500, 1.5)];
    let overrides = overrides.map(|(index, ratio)| OverrideChange { index, ratio }).to_vec();
    let mut config = PipelineConfig { overrides, ..config() };
    config.profile.look_ahead_blocks = 4;
    let text = program(&blocks);
    let setpoints = run(&text, &config);
    assert_oscillates(&setpoints, true, 30.0, &|s: f64| ([s, 0.0], [1.0, 0.0]));
    for (index, offset, snapshot) in &snapshots(text.as_bytes(), &config) {
        let (first, resumed) = resume(text.as_bytes(), &config, *offset, snapshot);
        assert_eq!(first, *index);
        assert!((0..resumed.len()).all(|k| resumed.bits(k) == setpoints.bits(first as usize + k)));
    }
}

#[test]
fn the_oscillation_rests_at_corners() {
    let setpoints = run(&program("G1 X15 F600\nG1 Y15"), &config());
    let corner = (0..setpoints.len()).min_by(|a, b| {
        let distance = |index: &usize| libm::hypot(setpoints.axes[0][*index] - 15.0, setpoints.axes[1][*index]);
        distance(a).total_cmp(&distance(b))
    });
    let corner = corner.expect("setpoints");
    assert!(setpoints.vibration[corner].abs() < 1e-6);
    for index in 0..setpoints.len() {
        assert!(setpoints.axes[0][index] < 15.0 + 1e-9 && setpoints.axes[1][index] > -1e-9);
    }
    assert!(setpoints.vibration.iter().any(|offset| *offset > 0.399));
}

#[test]
fn axes_stay_within_their_limits() {
    let mut config = config();
    for axis in &mut config.profile.machine.axes {
        (axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3) = (60.0, 4_500.0, 1_200_000.0);
    }
    let text = program("G1 X30 F600\nG3 X30 Y40 I0 J20").replace("P1", "P2");
    let report = validate(&text, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    for axis in &report.summary.axes {
        assert!(axis.peak_velocity_per_s <= 60.0 * 1.000_1, "{axis:?}");
        assert!(axis.peak_acceleration_per_s2 <= 4_500.0 * 1.000_1, "{axis:?}");
        assert!(axis.peak_jerk_per_s3 <= 1_200_000.0 * 1.001, "{axis:?}");
    }
    let [one] = &report.oscillations[..] else { panic!("{:#?}", report.oscillations) };
    assert_eq!((one.on_line, one.line, one.tool, one.condition.as_str()), (4, 5, 4, "smooth"));
    assert_eq!(one.report.finishing_edges, [4]);
    assert_eq!(report.summary.oscillation_count, 1);
}

/// Every block a section of its own: no two follow each other without a corner.
const PATH: [(&str, [f64; 3]); 5] = [
    ("G1 X20 F617", [20.0, 0.0, -DEPTH_MM]),
    ("G1 X19 Y12.3 F600", [19.0, 12.3, -DEPTH_MM]),
    ("G3 X0.7 Y30.6 I-18.3 J0", [0.7, 30.6, -DEPTH_MM]),
    ("G1 X-13.137 Y20 F590", [-13.137, 20.0, -DEPTH_MM]),
    ("G2 X0 Y0 R30", [0.0, 0.0, -DEPTH_MM]),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn the_last_setpoint_of_every_section_is_its_programmed_end(
        period_us in 500_u32..5_000,
        overrides in prop::collection::vec((1_u64..1_500, 0_u32..=20), 0..6),
    ) {
        let mut index = 0;
        let mut changes = Vec::new();
        for (pause, tenths) in overrides {
            index += pause;
            changes.push(OverrideChange { index, ratio: f64::from(tenths) / 10.0 });
        }
        // A hold that nothing ends lasts for ever.
        changes.push(OverrideChange { index: index + 700, ratio: 1.0 });
        let config = PipelineConfig { interpolation_period_us: period_us, overrides: changes, ..config() };
        let text = program(&PATH.map(|(block, _)| block).join("\n"));
        let setpoints = run(&text, &config);
        for (line, (block, end)) in (5..).zip(PATH) {
            let last = (0..setpoints.len()).rev().find(|&k| setpoints.line[k] == line).expect("it is cut");
            let found: Vec<u64> = setpoints.axes.iter().map(|column| column[last].to_bits()).collect();
            prop_assert_eq!(&found[..], &end.map(f64::to_bits)[..], "{} at {}: {:?}", block, last, end);
            prop_assert_eq!(setpoints.vibration[last], 0.0);
            let reach = (0..setpoints.len()).filter(|&k| setpoints.line[k] == line);
            prop_assert!(reach.into_iter().any(|k| setpoints.vibration[k].abs() > 0.1), "{} oscillates", block);
        }
    }
}

#[test]
fn a_resumed_stream_continues_to_the_bit() {
    let (text, config) = (program("G1 X12 F600\nG2 X12 Y-20 I0 J-10"), config());
    let whole = run(&text, &config);
    let taken = snapshots(text.as_bytes(), &config);
    assert!(taken.len() > 3);
    for (index, offset, snapshot) in &taken {
        let (first, resumed) = resume(text.as_bytes(), &config, *offset, snapshot);
        assert_eq!(first, *index);
        for k in 0..resumed.len() {
            assert_eq!(resumed.bits(k), whole.bits(first as usize + k));
        }
    }
}

#[test]
fn words_override_the_condition() {
    let text = program("G1 X20 F600").replace("P1", "P1 A0.2 Q0.01 L3");
    let report = validate(&text, &config());
    let one = &report.oscillations[0].report;
    assert_eq!((one.loads[0].amplitude_mm, one.loads[1].amplitude_mm), (0.2, 0.01));
    assert_eq!((one.leading_edge, &one.finishing_edges[..]), (3, &[2][..]));
    let setpoints = run(&text, &config());
    let oscillating = setpoints.axes[2].iter().zip(&setpoints.vibration).filter(|(_, offset)| **offset != 0.0);
    let highest = oscillating.map(|(z, _)| *z).fold(f64::NEG_INFINITY, f64::max);
    assert!((highest + 0.99).abs() < 1e-9, "{highest}");
}

#[test]
fn contradictions_are_refused_before_anything_moves() {
    let line = "G1 X30 F600";
    refused(&program(line).replace("P1", "P9"), "OSC-CONDITION-UNKNOWN");
    refused(&program(line).replace("P1", ""), "OSC-WORD");
    refused(&program(line).replace("P1", "P1 L7"), "OSC-LEADING-EDGE");
    refused(&program(line).replace("P1", "P1 A-0.4"), "OSC-VALUE");
    refused(&program(line).replace("P1", "P3"), "OSC-EDGES-PERIOD");
    refused(&program(line).replace("T4", "T5"), "OSC-TOOL-UNKNOWN");
    refused(&program(line).replace("M3 S600\n", ""), "OSC-SPINDLE-STOPPED");
    refused(&program("G1 Z-5 F600"), "OSC-PLUNGE");
    refused(&program("G1 X30 F1200"), "OSC-STEP-LONG");
    refused(&program("G1 X30 F600\nG2 X31 Y-1 R1"), "OSC-TURNING");
    refused(&program("G202 P1\nG1 X30 F600"), "OSC-NESTED");
    refused(&program(line).replace("G202 P1 D1", "G4 P1"), "OSC-OFF-WITHOUT-ON");
    refused(&program("G200 F50 A0.01\nG1 X30 F600\nG201"), "OSC-WITH-VIBRATION");
    refused(&program(line).replace("D1", "D4.98"), "OSC-DEPTH");
    refused(&program("G1 X30 F600 B10"), "AXIS-MISSING");
    let report = validate(&program("G1 X1.5 F600"), &config());
    assert!(report.findings.iter().any(|finding| finding.code == "OSC-SECTION-SHORT"));
}

#[test]
fn what_is_said_of_a_corner_that_turns_too_fast_cures_it() {
    let text = |control: &str, feed: f64| program(&format!("{control}\nG1 X30 F{feed}\nX50 Y20"));
    let report = validate(&text("G64 P0.02", 600.0), &config());
    let turning: Vec<_> = report.findings.iter().filter(|finding| finding.code == "OSC-TURNING").collect();
    let [finding] = turning[..] else { panic!("{:#?}", report.findings) };
    let cure = &finding.suggestions[0];
    let feed = cure.value.as_ref().expect("a feed").value;
    let most = (feed * 10.0).floor() / 10.0;
    assert!(cure.message.contains(&format!(", {most} mm/min at most")), "{}", cure.message);
    assert!(finding.suggestions[1].message.contains("raise P of G64"), "{finding:#?}");
    for (control, feed) in [("G64 P0.02", most), ("G64 P2", 600.0), ("G61", 600.0)] {
        let report = validate(&text(control, feed), &config());
        assert!(
            report.findings.iter().all(|finding| finding.code != "OSC-TURNING"),
            "{control}: {:#?}",
            report.findings
        );
    }
}

#[test]
fn an_arc_that_becomes_parallel_to_the_tool_axis_is_refused_wherever_it_does() {
    // Five sixths of a circle of 300 mm: start, middle and end lie far from both vertical tangents.
    let text = |arc: &str| format!("T4 M6\nM3 S600\nG0 X0 Y0 Z0\nG202 P1 D1\n{arc} F600\nG203\nM30\n");
    for (arc, places_mm) in [
        ("G18 G2 X0 Z0 I-150 K259.808", [[-450.0, 0.0, 259.808], [150.0, 0.0, 259.808]]),
        ("G18 G3 X0 Z0 I150 K-259.808", [[-150.0, 0.0, -259.808], [450.0, 0.0, -259.808]]),
        ("G19 G3 Y0 Z0 J-150 K259.808", [[0.0, -450.0, 259.808], [0.0, 150.0, 259.808]]),
    ] {
        let report = refused(&text(arc), "OSC-PLUNGE");
        let finding = report.findings.iter().find(|finding| finding.code == "OSC-PLUNGE").expect("is refused");
        let place = ["x", "y", "z"].map(|name| {
            finding.values.iter().find(|value| value.name == name).unwrap_or_else(|| panic!("{finding:#?}")).value
        });
        let is_at = |at: &[f64; 3]| place.iter().zip(at).all(|(place, at)| (place - at).abs() < 1e-3);
        assert!(places_mm.iter().any(is_at), "{arc}: {place:?}");
    }
    // A bow that stays below 84 degrees is none.
    let report = validate(&text("G18 G3 X50 Z0 I25 K-20"), &config());
    assert!(report.findings.iter().all(|finding| finding.code != "OSC-PLUNGE"), "{:#?}", report.findings);
}

#[test]
fn what_every_feed_of_one_switch_repeats_is_one_finding() {
    let report = validate(&program("G1 X30 F500\nG1 X60 F600\nG1 X30 F700\nG1 X60 F800"), &config());
    assert_eq!(report.oscillations.len(), 4, "every feed is judged");
    let steps: Vec<_> = report.findings.iter().filter(|finding| finding.code == "OSC-JERK-STEP").collect();
    let [step] = steps[..] else { panic!("{steps:#?}") };
    let line = |number| Some(feedwave_program::Occurrence { name: "line".into(), number });
    assert_eq!((step.occurrences, &step.first), (4, &line(5)));
    let codes: std::collections::BTreeSet<_> = report.findings.iter().map(|finding| finding.code.name()).collect();
    assert_eq!(codes.len(), report.findings.len(), "{:#?}", report.findings);

    let short = validate(&program("G1 X1 F600\nG1 Y1\nG1 X1.5\nG1 Y2.5"), &config());
    let short: Vec<_> = short.findings.iter().filter(|finding| finding.code == "OSC-SECTION-SHORT").collect();
    let [short] = short[..] else { panic!("{short:#?}") };
    assert_eq!((short.occurrences, &short.first, &short.worst), (4, &line(5), &line(7)));
}

#[test]
fn a_section_that_the_axes_refuse_is_reported_as_it_was_judged() {
    let mut config = config();
    for axis in &mut config.profile.machine.axes {
        // The feed direction's peak is 0.4·(2π/0.1)² = 1 579 mm/s²: within the limit, but nothing is left for the feed.
        axis.max_acceleration_per_s2 = 1_600.0;
    }
    let report = validate(&program("G1 X30 F600"), &config);
    assert!(report.findings.iter().any(|finding| finding.code == "OSC-AXIS-LIMIT"), "{:#?}", report.findings);
    let [judged] = &report.oscillations[..] else { panic!("{} reports", report.oscillations.len()) };
    assert!(!judged.report.feasible && judged.report.edges.len() == 4);
    assert_eq!(report.summary.oscillation_count, 1);
}

/// A travel that setpoints would leave refuses the program, and one that commands and amplitudes keep does not.
#[test]
fn axes_stay_within_their_travel_with_the_oscillation() {
    let mut config = config();
    config.profile.tool_oscillation[0].condition.cross =
        Some(DirectionOscillation { amplitude_mm: 0.2, waveform: Waveform::Sine, phase_deg: 0.0 });
    for path in ["G1 X30 F600", "G1 X20 Y25 F600", "G2 X40 Y0 I20 F600", "G1 X20 F600\nG3 X30 Y10 J10\nG1 Y30"] {
        let setpoints = run(&program(path), &config);
        for (index, column) in setpoints.axes.iter().enumerate().take(3) {
            let [least, most] = [f64::min, f64::max].map(|of| column.iter().copied().fold(column[0], of));
            // The travel of the axis, and its range in the chain of a machine with five of them.
            let with = |travel: [Option<f64>; 2]| {
                let mut limited = config.clone();
                let axis = &mut limited.profile.machine.axes[index];
                (axis.travel_min, axis.travel_max) = travel.into();
                let mut ranged = config.clone();
                let machine = machines::config_of(machines::kinds().remove(0).1).profile;
                (ranged.profile.machine.axes, ranged.profile.kinematics) = (machine.machine.axes, machine.kinematics);
                let chain = &mut ranged.profile.kinematics.as_mut().expect("a chain").chain;
                let link = chain.iter_mut().find(|link| link.axis.index() == index).expect("a linear axis");
                link.range = Some([travel[0].unwrap_or(-1e6), travel[1].unwrap_or(1e6)]);
                let [by_travel, by_range] = [limited, ranged].map(|config| {
                    let report = validate(&program(path), &config);
                    report.findings.iter().any(|finding| finding.code == "AXIS-TRAVEL")
                });
                // Of a range, only where moves end counts, and not where the first one begins.
                let begins_within =
                    travel[0].is_none_or(|low| column[0] >= low) && travel[1].is_none_or(|high| column[0] <= high);
                assert!(by_travel == by_range || !begins_within, "{path}: axis {index} {travel:?}");
                by_travel
            };
            let wide = [0.62, 0.62, 0.05][index];
            assert!(!with([Some(least - wide), Some(most + wide)]), "{path}: axis {index}");
            // X and Y leave the path in places where the oscillation is whole, Z retracts from -1.
            let leaves = |end: f64, others: [f64; 2]| others.iter().all(|other| (other - end).abs() > 1e-3);
            if leaves(least, [0.0, -1.0]) {
                assert!(with([Some(least + 1e-4), None]), "{path}: axis {index} below {least}");
            }
            if leaves(most, [30.0, 5.0]) {
                assert!(with([None, Some(most - 1e-4)]), "{path}: axis {index} above {most}");
            }
        }
    }
}
