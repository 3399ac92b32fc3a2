use core::f64::consts::TAU;

use feedwave_program::{
    AXIS_COUNT, ArcGeometry, Finding, Move, MoveKind, Plane, Position, Severity, SpindleDirection, SpindleSpeed,
};
use proptest::prelude::*;

use super::*;
use crate::shared::following::{AxisFollowing, DriveModel, FollowingContour};

const ON: SourceSpan = SourceSpan { program: 0, line: 2, column: 1, length: 14 };
const F_WORD: SourceSpan = SourceSpan { program: 0, line: 2, column: 6, length: 3 };
const A_WORD: SourceSpan = SourceSpan { program: 0, line: 2, column: 10, length: 5 };
const WORDS: VibrationWordSpans = VibrationWordSpans { frequency: Some(F_WORD), amplitude: Some(A_WORD), inch: false };

/// X as a radius and Z, mm.
fn at(x: f64, z: f64) -> Position {
    let mut position = [0.0; AXIS_COUNT];
    position[Axis::X.index()] = x;
    position[Axis::Z.index()] = z;
    position
}

fn element(start: Position, end: Position, arc: Option<ArcGeometry>, line: u32) -> Element {
    let mv = Move {
        kind: MoveKind::Cutting,
        start,
        end,
        work_offset: [0.0; AXIS_COUNT],
        arc,
        feed: Feed::PerRevolution(0.01),
        spindle: Spindle::STOPPED,
        tool: 1,
        spline: None,
        path_control: feedwave_program::PathControl::default(),
        leads_xyz: false,
        cycle: None,
    };
    Element::from_move(&mv, SourceSpan { line, column: 1, length: 20, ..SourceSpan::default() })
        .expect("the element moves")
}

fn straight(from: (f64, f64), to: (f64, f64), line: u32) -> Element {
    element(at(from.0, from.1), at(to.0, to.1), None, line)
}

/// A quarter circle of `radius` in ZX from (x, z) to (x + radius, z + radius), centre above the start.
fn quarter(x: f64, z: f64, radius: f64, line: u32) -> Element {
    let arc = ArcGeometry { plane: Plane::Zx, center: [z, x + radius], clockwise: false, sweep_rad: TAU / 4.0 };
    element(at(x, z), at(x + radius, z + radius), Some(arc), line)
}

fn turning(rev_per_min: f64) -> Spindle {
    Spindle { direction: SpindleDirection::Clockwise, speed: SpindleSpeed::Constant { rev_per_min } }
}

fn surface(m_per_min: f64, max_rev_per_min: f64) -> Spindle {
    Spindle { direction: SpindleDirection::Clockwise, speed: SpindleSpeed::Surface { m_per_min, max_rev_per_min } }
}

/// One section on the generic lathe.
struct Run {
    condition: VibrationCondition,
    settings: VibrationSettings,
    following: FollowingModel,
    period_s: f64,
    blocks: Vec<(Element, Feed, Spindle)>,
}

impl Run {
    /// The example of the source with its vibration changed: 20 mm along Z at diameter 10, S1000 F0.01.
    fn example(frequency_hz: f64, amplitude_mm: f64) -> Self {
        let block = (straight((5.0, 0.0), (5.0, 20.0), 3), Feed::PerRevolution(0.01), turning(1_000.0));
        Self {
            condition: VibrationCondition { frequency_hz, amplitude_mm },
            settings: VibrationSettings::default(),
            following: FollowingModel::default(),
            period_s: 0.001,
            blocks: vec![block],
        }
    }

    fn published(mut self) -> Self {
        self.settings.envelope = VibrationEnvelope::Published;
        self
    }

    fn with_blocks(mut self, blocks: Vec<(Element, Feed, Spindle)>) -> Self {
        self.blocks = blocks;
        self
    }

    fn with_mode(mut self, generation_mode: GenerationMode) -> Self {
        self.settings.generation_mode = generation_mode;
        self
    }

    fn finish(&self) -> (SectionReport, Vec<Finding>) {
        let machine = Machine::lathe();
        let mut analyzer =
            SectionAnalyzer::new(self.condition, ON, &self.settings, &machine, &self.following, self.period_s)
                .with_word_spans(WORDS);
        let mut previous: Option<&Element> = None;
        let top = |element, feed, spindle| feedwave_motion::top_command(element, feed, spindle, &machine);
        let mut first_feed = 0.0;
        for (element, feed, spindle) in &self.blocks {
            let jump = previous.map_or(0.0, |previous| {
                let [before, after] = [previous.tangent(previous.length), element.tangent(0.0)];
                before.iter().zip(after).map(|(before, after)| (after - before) * (after - before)).sum::<f64>().sqrt()
            });
            let ends = self.settings.generation_mode != GenerationMode::AlongPath && jump > 1e-3;
            if ends {
                analyzer.end_part(jump, element.source.line);
            }
            let feed_mm_per_s = top(element, *feed, spindle);
            if previous.is_none() || ends {
                analyzer.start_part(feed_mm_per_s);
                first_feed = feed_mm_per_s;
            }
            let pieces =
                self.settings.demand(self.condition, first_feed).limit_pieces(element, &machine, feed_mm_per_s);
            let limits = pieces.map(|pieces| PathLimits::tightest(pieces.iter().map(|piece| &piece.limits)));
            analyzer.add_element(element, *feed, spindle, &limits);
            previous = Some(element);
        }
        let mut log = FindingLog::default();
        let report = analyzer.finish(30, 100, &mut log);
        (report, log.findings().to_vec())
    }
}

fn codes(findings: &[Finding]) -> Vec<&str> {
    findings.iter().map(|finding| finding.code.name()).collect()
}

fn replacements(finding: &Finding) -> Vec<&str> {
    finding.suggestions.iter().filter_map(|suggestion| suggestion.replacement.as_deref()).collect()
}

fn suggested(finding: &Finding, name: &str) -> Vec<f64> {
    let values = finding.suggestions.iter().filter_map(|suggestion| suggestion.value.as_ref());
    values.filter(|value| value.name == name).map(|value| value.value).collect()
}

#[test]
fn the_trap_of_the_source_is_caught_and_the_suggested_frequencies_cure_it() {
    let (report, findings) = Run::example(50.0, 0.03).finish();
    assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
    let finding = &findings[0];
    assert_eq!((finding.severity, finding.span), (Severity::Warning, F_WORD));
    assert_eq!(replacements(finding), ["F41.667", "F58.333"]);
    let speeds = suggested(finding, "spindle_speed");
    // As they are written.
    assert_eq!(speeds, [857.1, 1_200.0]);
    assert_eq!(suggested(finding, "amplitude"), [] as [f64; 0], "no amplitude breaks the chip at D = 3");
    assert!(report.feasible, "the machine can do it; it is only useless");
    assert_eq!(report.broken_share, Some(0.0));
    assert_eq!(report.chip.as_ref().unwrap().vibrations_per_rev, 3.0);
    assert_eq!((report.on_line, report.first_line, report.last_line), (2, 3, 3));
    assert_eq!(report.clamped_share, 0.3);

    for frequency_hz in suggested(finding, "frequency") {
        let (cured, findings) = Run::example(frequency_hz, 0.03).finish();
        assert_eq!(codes(&findings), [] as [&str; 0]);
        assert_eq!(cured.broken_share, Some(1.0));
    }
}

#[test]
fn an_amplitude_below_half_the_feed_is_the_first_thing_to_change() {
    let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), Feed::PerRevolution(0.1), turning(1_000.0))];
    let (_, findings) = Run::example(40.0, 0.03).with_blocks(blocks).finish();
    assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
    assert_eq!(findings[0].span, A_WORD);
    // D = 2.4: 0.05/sin(0.4π) = 0.05257 mm, rounded up to what can be written.
    assert_eq!(replacements(&findings[0]), ["A0.0526"]);
    assert_eq!(suggested(&findings[0], "frequency").len(), 2);
}

#[test]
fn every_cure_says_which_amplitude_it_needs_and_changes_something() {
    let cures = |frequency_hz, feed| -> Vec<String> {
        let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), feed, turning(1_000.0))];
        let (_, findings) = Run::example(frequency_hz, 0.03).with_blocks(blocks).finish();
        assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
        findings[0].suggestions.iter().map(|suggestion| suggestion.message.clone()).collect()
    };
    // D = 2.4: at 2.5 the feed of a revolution is 0.1 mm, or 1000/960 of it where a minute's is programmed.
    let speed = |cures: Vec<String>| cures.into_iter().find(|cure| cure.contains("960 rev/min")).unwrap();
    let per_revolution = speed(cures(40.0, Feed::PerRevolution(0.1)));
    assert_eq!(per_revolution, "turn the spindle at 960 rev/min: D = 2.5, where 0.05 mm suffice; write A0.05 as well");
    let per_minute = speed(cures(40.0, Feed::PerMinute(100.0)));
    assert_eq!(per_minute, "turn the spindle at 960 rev/min: D = 2.5, where 0.0521 mm suffice; write A0.0521 as well");
    // D = 2.5 already: neither this frequency nor this speed is a cure.
    let cures = cures(125.0 / 3.0, Feed::PerRevolution(0.1));
    assert!(cures[0].starts_with("raise the amplitude to at least 0.05 mm"), "{cures:?}");
    assert!(!cures.iter().any(|cure| cure.contains("41.667 Hz") || cure.contains("1000 rev/min")), "{cures:?}");
}

#[test]
fn feed_per_minute_and_inverse_time_are_analysed_per_revolution() {
    for feed in [Feed::PerMinute(10.0), Feed::InverseTime(0.5)] {
        let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), feed, turning(1_000.0))];
        let (report, _) = Run::example(40.0, 0.03).with_blocks(blocks).finish();
        let cut = report.chip.unwrap().condition;
        assert_eq!((cut.feed_per_rev_mm, cut.feed_coupling), (0.01, FeedCoupling::PerMinute));
        assert_eq!(cut.diameter_mm, 10.0);
    }
}

#[test]
fn sampling_is_judged_by_the_period_at_which_the_wave_is_generated() {
    let (report, findings) = Run::example(62.5, 0.03).finish();
    assert_eq!(report.sampling.samples_per_vibration, 16.0);
    assert!((report.sampling.peak_error - (1.0 - libm::cos(TAU / 32.0))).abs() < 1e-15);
    assert!(!codes(&findings).iter().any(|code| code.starts_with("VIB-SAMPLING")));

    let (report, findings) = Run::example(200.0, 0.002).finish();
    let coarse = findings.iter().find(|finding| finding.code == "VIB-SAMPLING-COARSE").unwrap();
    assert_eq!(coarse.severity, Severity::Warning);
    assert!(coarse.suggestions[0].message.contains("servo-side"));
    assert!(report.feasible);
    let (report, findings) = Run::example(200.0, 0.002).with_mode(GenerationMode::ServoSide).finish();
    assert_eq!(report.sampling.samples_per_vibration, 40.0);
    assert!(!codes(&findings).contains(&"VIB-SAMPLING-COARSE"));

    let (report, findings) = Run { period_s: 0.02, ..Run::example(50.0, 0.03) }.finish();
    let aliased = findings.iter().find(|finding| finding.code == "VIB-SAMPLING-NYQUIST").unwrap();
    assert_eq!((aliased.severity, replacements(aliased)), (Severity::Error, vec!["F6.25"]));
    assert!((report.sampling.peak_error - 1.0).abs() < 1e-15);
    assert!(!report.feasible);
    // Exactly eight samples are enough, exactly two are not an error.
    assert!(!codes(&Run::example(125.0, 0.005).finish().1).contains(&"VIB-SAMPLING-COARSE"));
    let two = Run { period_s: 0.01, ..Run::example(50.0, 0.03) }.finish().1;
    assert!(codes(&two).contains(&"VIB-SAMPLING-COARSE") && !codes(&two).contains(&"VIB-SAMPLING-NYQUIST"));
}

#[test]
fn axes_that_cannot_follow_are_named_with_what_fits() {
    let (report, findings) = Run::example(100.0, 0.5).published().finish();
    assert!(!report.feasible);
    let jerk = findings.iter().find(|finding| finding.code == "VIB-AXIS-JERK").unwrap();
    assert_eq!(jerk.severity, Severity::Error);
    assert!(jerk.message.contains("Z axis"), "{}", jerk.message);
    assert!(codes(&findings).contains(&"VIB-AXIS-ACCELERATION"));
    assert!(!codes(&findings).contains(&"VIB-AXIS-VELOCITY"), "314 mm/s are within 500");
    assert_eq!(report.axes.len(), 1, "only Z moves");
    let rad_per_s = TAU * 100.0;
    let inside = rad_per_s * rad_per_s * rad_per_s * 0.5;
    // A step of 2πfA in setpoints of 1 ms, beside the sine's own jerk.
    assert!(report.axes[0].jerk_per_s3 > inside + rad_per_s * 0.5 / 1e-6);
    assert!(report.axes[0].utilisation > 1.0);

    // Blended, its ends ask for a little more than what is inside.
    let (blended, findings) = Run::example(100.0, 0.5).finish();
    assert!(blended.axes[0].jerk_per_s3 > inside && blended.axes[0].jerk_per_s3 < 1.001 * inside);
    let jerk = findings.iter().find(|finding| finding.code == "VIB-AXIS-JERK").unwrap();
    // What is suggested fits, and hardly more does.
    let amplitude_mm = suggested(jerk, "amplitude")[0];
    let fits = |run: Run| !codes(&run.finish().1).iter().any(|code| code.starts_with("VIB-AXIS"));
    assert!(fits(Run::example(100.0, amplitude_mm)) && !fits(Run::example(100.0, amplitude_mm + 0.0002)));
    let frequency_hz = suggested(jerk, "frequency")[0];
    assert!(fits(Run::example(frequency_hz, 0.5)) && !fits(Run::example(frequency_hz + 0.002, 0.5)));
}

#[test]
fn the_feed_counts_towards_the_velocity() {
    // 480 mm/s of feed and 31 mm/s of vibration.
    let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), Feed::PerMinute(28_800.0), turning(1_000.0))];
    let (report, findings) = Run::example(50.0, 0.1).with_blocks(blocks).published().finish();
    let velocity = findings.iter().find(|finding| finding.code == "VIB-AXIS-VELOCITY").unwrap();
    assert!(velocity.suggestions.iter().any(|suggestion| suggestion.message.contains("feed")));
    // (500 − 480)/(2π·50) mm.
    assert_eq!(replacements(velocity), ["A0.0636"]);
    assert!((report.axes[0].velocity_per_s - (480.0 + TAU * 5.0)).abs() < 1e-9);
}

#[test]
fn a_curve_takes_its_part_of_the_limits() {
    let blocks = vec![(quarter(5.0, 0.0, 0.05, 4), Feed::PerRevolution(0.01), turning(1_000.0))];
    let (report, findings) = Run::example(125.0 / 3.0, 0.1).with_blocks(blocks).finish();
    assert!(!report.feasible);
    let finding = findings.iter().find(|finding| finding.code.name().starts_with("VIB-AXIS")).unwrap();
    assert!(finding.message.contains("line 4"), "{}", finding.message);
    let largest_mm = report.largest_amplitude_mm.unwrap();
    assert!(largest_mm > 0.0 && largest_mm < 0.1);
}

#[test]
fn a_section_shorter_than_its_travel_is_mostly_clamped() {
    let blocks = vec![(straight((5.0, 0.0), (5.0, 0.05), 3), Feed::PerRevolution(0.01), turning(1_000.0))];
    let (_, findings) = Run::example(125.0 / 3.0, 0.03).with_blocks(blocks).published().finish();
    assert_eq!(codes(&findings), ["VIB-TRAVEL-SHORT", "VIB-PUBLISHED-ENDS"]);
    assert!(findings[0].message.contains("30 %"), "{}", findings[0].message);
    assert_eq!(replacements(&findings[0]), ["A0.025"]);

    // Blended, its amplitude never is the whole one.
    let blocks = vec![(straight((5.0, 0.0), (5.0, 0.05), 3), Feed::PerRevolution(0.01), turning(1_000.0))];
    let (report, findings) = Run::example(125.0 / 3.0, 0.03).with_blocks(blocks).finish();
    assert_eq!(codes(&findings), ["VIB-TRAVEL-SHORT"]);
    assert!(findings[0].message.contains("never reaches its amplitude"), "{}", findings[0].message);
    assert_eq!((report.full_amplitude_share, report.published_ends), (0.0, None));
}

#[test]
fn the_tangential_modes_leave_the_contour_on_a_curve() {
    let blocks = || vec![(quarter(5.0, 0.0, 4.0, 4), Feed::PerRevolution(0.01), turning(1_000.0))];
    let run = |amplitude_mm, mode| Run::example(20.0, amplitude_mm).with_blocks(blocks()).with_mode(mode).finish();
    let (report, findings) = run(0.1, GenerationMode::Tangential);
    assert!((report.contour_deviation_mm - 0.01 / 8.0).abs() < 1e-9);
    assert!((report.min_radius_mm.unwrap() - 4.0).abs() < 1e-9);
    let contour = findings.iter().find(|finding| finding.code == "VIB-CONTOUR").unwrap();
    assert_eq!(contour.severity, Severity::Error);
    assert_eq!(replacements(contour), ["A0.0894"]);
    assert!(!codes(&run(0.0894, GenerationMode::ServoSide).1).contains(&"VIB-CONTOUR"));
    let (report, findings) = run(0.1, GenerationMode::AlongPath);
    assert_eq!(report.contour_deviation_mm, 0.0);
    assert!(!codes(&findings).contains(&"VIB-CONTOUR"));
}

#[test]
fn corners_make_the_tangential_command_rest() {
    let blocks = || {
        let cut = |element| (element, Feed::PerRevolution(0.01), turning(1_000.0));
        vec![
            cut(straight((5.0, 0.0), (5.0, 20.0), 3)),
            cut(straight((5.0, 20.0), (15.0, 20.0), 4)),
            cut(straight((15.0, 20.0), (25.0, 20.0), 5)),
        ]
    };
    let run = |mode| Run::example(125.0 / 3.0, 0.03).with_blocks(blocks()).with_mode(mode).published().finish();
    for mode in [GenerationMode::Tangential, GenerationMode::ServoSide] {
        let (report, findings) = run(mode);
        assert_eq!(codes(&findings), ["VIB-JUNCTION-JUMP", "VIB-PUBLISHED-ENDS"]);
        assert!((report.junction_jump_mm - 0.03 * 2.0f64.sqrt()).abs() < 1e-12);
        assert!(findings[0].message.contains("line 4"));
    }
    assert_eq!(codes(&run(GenerationMode::AlongPath).1), ["VIB-PUBLISHED-ENDS"]);
}

#[test]
fn without_a_turning_spindle_nothing_is_said_about_the_chip() {
    let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), Feed::PerMinute(10.0), Spindle::STOPPED)];
    let (report, findings) = Run::example(50.0, 0.03).with_blocks(blocks).finish();
    assert_eq!(codes(&findings), ["VIB-SPINDLE-STOPPED"]);
    assert_eq!((report.chip, report.broken_share), (None, None));
}

#[test]
fn a_slow_spindle_leaves_little_room_for_its_speed() {
    // D = 50.5: half a vibration per revolution is one per cent of the speed.
    let blocks = vec![(straight((5.0, 0.0), (5.0, 20.0), 3), Feed::PerRevolution(0.01), turning(60.0))];
    let (report, findings) = Run::example(50.5, 0.03).with_blocks(blocks).finish();
    assert_eq!(codes(&findings), ["VIB-CHIP-MARGINAL"]);
    assert!(report.chip.unwrap().broken);
}

#[test]
fn losses_between_setpoint_and_tool_are_predicted() {
    let common = |drive| FollowingModel { common: drive, axes: Vec::new() };
    let filtered = common(DriveModel { filter_length_s: Some(0.02), ..DriveModel::default() });
    let (report, findings) = Run { following: filtered, ..Run::example(175.0 / 3.0, 0.03) }.finish();
    assert_eq!(codes(&findings), ["VIB-FOLLOWING-LOSS"]);
    assert_eq!(findings[0].severity, Severity::Warning);
    assert!(findings[0].message.contains("too little to break"), "{}", findings[0].message);
    assert!(report.following.arriving_amplitude_mm < 0.005);
    let loop_only = DriveModel { position_loop_gain_per_s: Some(300.0), ..DriveModel::default() };
    let (report, findings) = Run { following: common(loop_only), ..Run::example(125.0 / 3.0, 0.03) }.finish();
    assert_eq!(codes(&findings), ["VIB-FOLLOWING-LOSS"]);
    // What arrives breaks the chip, so there is nothing to cure, and no amplitude would end it.
    assert_eq!(findings[0].severity, Severity::Info);
    assert_eq!(suggested(&findings[0], "amplitude"), []);
    // At a lower frequency enough of it arrives.
    assert!(suggested(&findings[0], "frequency").iter().all(|passing_hz| loop_only.gain(*passing_hz) > 0.9));
    let following = report.following;
    assert_eq!(following.arriving_amplitude_mm, 0.03 * loop_only.gain(125.0 / 3.0));
    assert_eq!(following.phase_lag_rad, loop_only.loop_lag_rad(125.0 / 3.0));
    assert_eq!((following.lag_rad, following.loop_gain), (following.phase_lag_rad, loop_only.loop_gain(125.0 / 3.0)));
    let z = [AxisFollowing { axis: Axis::Z, gain: following.loop_gain, lag_rad: following.lag_rad }];
    assert_eq!(following.axes, z);
    // On a straight line the tool is late, and on its path.
    assert_eq!(following.contour, Some(FollowingContour::default()));
}

#[test]
fn constant_surface_speed_reports_the_spans_that_do_not_break() {
    let facing = straight((40.0, 0.0), (1.0, 0.0), 3);
    let blocks = vec![(facing, Feed::PerRevolution(0.01), surface(150.0, 3_000.0))];
    let (report, findings) = Run::example(60.0, 0.03).with_blocks(blocks).finish();
    let partly = findings.iter().find(|finding| finding.code == "VIB-PARTLY-UNBROKEN").unwrap();
    assert_eq!(partly.severity, Severity::Warning);
    let surface_speed = report.surface_speed.unwrap();
    assert!(surface_speed.broken_share > 0.5 && surface_speed.broken_share < 1.0);
    assert!((report.broken_share.unwrap() - surface_speed.broken_share).abs() < 1e-12);
    let chip = report.chip.unwrap();
    assert!(!chip.broken, "the report shows the worst place");
    let first = &surface_speed.unbroken_spans[0];
    assert!(partly.message.contains(&format!("line {}", first.first_line)));
}

#[test]
fn an_arc_at_constant_surface_speed_agrees_with_sampling() {
    let arc = quarter(2.0, 0.0, 30.0, 3);
    let spindle = surface(150.0, 3_000.0);
    let samples = 50_000;
    let broken = (0..samples).filter(|&i| {
        let radius_mm = arc.position(arc.length * (f64::from(i) + 0.5) / f64::from(samples))[Axis::X.index()];
        let cut = CutCondition {
            feed_per_rev_mm: 0.02,
            amplitude_mm: 0.03,
            frequency_hz: 60.0,
            spindle_rev_per_min: 60.0 * spindle.rev_per_s(radius_mm),
            diameter_mm: 0.0,
            feed_coupling: FeedCoupling::PerRevolution,
        };
        cut.breaks_chip()
    });
    let sampled_share = broken.count() as f64 / f64::from(samples);
    let blocks = vec![(arc.clone(), Feed::PerRevolution(0.02), spindle)];
    let (report, _) = Run::example(60.0, 0.03).with_blocks(blocks).finish();
    // Where the clamp holds the spindle speed is constant.
    let surface = report.surface_speed.unwrap();
    let clamped = report.chip_spans.iter().filter(|span| span.broken).map(|span| span.length_mm);
    let share = (clamped.sum::<f64>() + surface.broken_share * surface.length_mm) / report.length_mm;
    assert!(surface.length_mm < report.length_mm && surface.spindle_rev_per_min[1] <= 3_000.0 + 1e-6);
    assert!((surface.spindle_rev_per_min[0] - 150e3 / (TAU * 32.0)).abs() < 1e-6, "{surface:?}");
    assert!((share - sampled_share).abs() < 0.003, "{share} but {sampled_share} sampled");
}

#[test]
fn the_worst_of_many_blocks_is_named_and_memory_stays_bounded() {
    let cut = |i: u32, feed: f64, speed: f64| {
        let z = f64::from(i);
        (straight((5.0, z), (5.0, z + 1.0), 10 + i), Feed::PerRevolution(feed), turning(speed))
    };
    // Equal blocks are one stretch.
    let even = (0..1_000).map(|i| cut(i, 0.01, 1_200.0)).collect();
    let (report, findings) = Run::example(50.0, 0.03).with_blocks(even).finish();
    assert_eq!((report.chip_spans.len(), report.chip_spans_not_listed), (1, 0));
    assert_eq!((report.chip_spans[0].first_line, report.chip_spans[0].last_line), (10, 1_009));
    assert!((report.chip_spans[0].share - 1.0).abs() < 1e-12);
    assert_eq!(codes(&findings), [] as [&str; 0]);
    // Different ones are listed up to a limit; the one in phase is named.
    let uneven =
        (0..1_000).map(|i| cut(i, 0.01, if i == 500 { 1_000.0 } else { 1_200.0 + f64::from(i % 2) })).collect();
    let (report, findings) = Run::example(50.0, 0.03).with_blocks(uneven).finish();
    assert_eq!((report.chip_spans.len(), report.chip_spans_not_listed), (64, 936));
    assert_eq!(codes(&findings), ["VIB-CHIP-UNBROKEN"]);
    assert!(findings[0].message.contains("line 510"), "{}", findings[0].message);
    assert!((report.broken_share.unwrap() - 0.999).abs() < 1e-12);
}

proptest! {
    #[test]
    fn any_section_ends_in_finite_numbers(
        frequency_hz in prop_oneof![0.001..5_000.0f64, 1e-9..1e12f64],
        amplitude_mm in prop_oneof![0.0001..2.0f64, 1e-9..1e9f64],
        feed in prop_oneof![0.001..1.0f64, 1e-9..1e9f64],
        kind in 0..3u8,
        speed in prop_oneof![1.0..5_000.0f64, 1e-9..1e9f64],
        constant: bool,
        x in -50.0..50.0f64,
        z in 0.001..50.0f64,
        mode in prop_oneof![Just(GenerationMode::AlongPath), Just(GenerationMode::Tangential), Just(GenerationMode::ServoSide)],
    ) {
        let feed = match kind {
            0 => Feed::PerRevolution(feed),
            1 => Feed::PerMinute(feed),
            _ => Feed::InverseTime(feed),
        };
        let spindle = if constant { turning(speed) } else { surface(speed, f64::INFINITY) };
        let blocks = vec![
            (straight((10.0, 0.0), (x, z), 3), feed, spindle),
            (quarter(x, z, 3.0, 4), feed, spindle),
        ];
        let (report, findings) = Run::example(frequency_hz, amplitude_mm).with_blocks(blocks).with_mode(mode).finish();
        prop_assert!(report.broken_share.is_some_and(|share| (0.0..=1.0).contains(&share)));
        prop_assert!(report.axes.iter().all(|axis| axis.utilisation.is_finite()));
        prop_assert_eq!(report.feasible, findings.iter().all(|finding| finding.severity != Severity::Error));
        let values = findings.iter().flat_map(|finding| &finding.values);
        prop_assert!(values.clone().all(|value| value.value.is_finite()), "{:?}", findings);
        if let Some(chip) = report.chip {
            prop_assert!(chip.largest_thickness_mm.is_finite() && (0.0..=1.0).contains(&chip.air_share));
        }
    }
}
