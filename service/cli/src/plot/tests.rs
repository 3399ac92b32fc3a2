use std::path::Path;

use feedwave_cutting::{CutCondition, FeedCoupling, SetpointBlock};
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, Kinematics, KinematicsDescription, Wrap};
use feedwave_program::Axis;

use super::canvas;
use super::figure::Figure;
use super::{AxisShown, CloseView, Cut, PathDeviations, PathTrace, Plots, RapidLines, RunTrace, Stretch};

mod rules;

/// A table that turns by C and tilts by A.
pub(super) fn trunnion() -> Kinematics {
    let axis = |axis, direction| ChainAxis { axis, direction, point_mm: [0.0; 3], range: None, wrap: Wrap::Counting };
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let description = KinematicsDescription {
        chain: vec![axis(Axis::C, z), axis(Axis::A, x), axis(Axis::Y, y), axis(Axis::X, x), axis(Axis::Z, z)],
        gauge_point_mm: [0.0; 3],
        tool_direction: z,
        preferred_branch: BranchPreference::Nearest,
    };
    Kinematics::new(&description).unwrap()
}

fn axes(names: &[&str]) -> Vec<AxisShown> {
    let axis = |name: &&str| AxisShown {
        name: (*name).to_owned(),
        rotary: matches!(*name, "A" | "C"),
        max_velocity_per_s: 500.0,
        max_acceleration_per_s2: 10_000.0,
        max_jerk_per_s3: 5e6,
    };
    names.iter().map(axis).collect()
}

/// A straight cut along Z with a vibration of 41.667 Hz from 0.5 s on.
fn block(first_index: u64, rows: usize) -> SetpointBlock {
    let rows = (0..rows).map(|row| (first_index + row as u64) as f64 * 1e-3);
    let offset = |time_s: f64| 0.03 * (std::f64::consts::TAU * 41.667 * (time_s - 0.5)).sin();
    let offset = |time_s: f64| if time_s > 0.5 { offset(time_s) } else { 0.0 };
    SetpointBlock {
        first_index,
        axes: vec![
            rows.clone().map(|_| 10.0).collect(),
            rows.clone().map(|time_s| 2.0 - time_s - offset(time_s)).collect(),
        ],
        tool_direction: Vec::new(),
        path_position_mm: rows.clone().collect(),
        feed_mm_per_min: rows.clone().map(|_| 60.0).collect(),
        vibration_offset_mm: rows.clone().map(offset).collect(),
        spindle_angle_deg: rows.clone().map(|time_s| time_s * 6_000.0).collect(),
        line: rows.map(|_| 3).collect(),
        servo: None,
    }
}

fn condition(frequency_hz: f64) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: 0.01,
        amplitude_mm: 0.03,
        frequency_hz,
        spindle_rev_per_min: 1_000.0,
        diameter_mm: 20.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}

fn plots() -> Plots {
    let mut plots = Plots::new("test.nc", true, axes(&["X", "Z"]), 1e-3, 1e-3);
    let mut trace = PathTrace::default();
    trace.line(Stretch::Rapid, [100.0, 0.0, 150.0], [10.0, 0.0, 2.0]);
    trace.line(Stretch::Vibrating, [10.0, 0.0, 2.0], [10.0, 0.0, -8.0]);
    trace.line(Stretch::VibratingThread, [10.0, 0.0, -8.0], [10.0, 0.0, -9.0]);
    let mut rapids = RapidLines::default();
    rapids.rapid(1);
    rapids.cut(3, 60.0);
    rapids.finish();
    plots.set_path(trace, rapids);
    plots.set_deviations(deviations(true));
    plots.add_window("start of the vibration", 0.49..0.56);
    plots.add_override(3.0, 0.4);
    plots.add_override(4.0, 0.0);
    plots.add_override(5.0, 1.0);
    for number in 0..10 {
        let mut block = block(number * 1_000, 1_000);
        if number == 0 {
            // A rapid move of 0.2 s before the cut.
            block.line[..200].fill(1);
            block.feed_mm_per_min[..200].fill(30_000.0);
            for (row, position) in block.axes[1][..200].iter_mut().enumerate() {
                *position += 0.5 * (200 - row) as f64;
            }
        }
        plots.push_commands(&block);
        plots.push(&block);
    }
    let cut = |frequency_hz: f64| Cut {
        heading: format!("{frequency_hz} Hz"),
        verdict: "3.000 vibrations per revolution: in phase, no amplitude breaks the chip".to_owned(),
        condition: condition(frequency_hz),
    };
    plots.add_chip("chip-1", "line 3", vec![cut(50.0), cut(41.667)]);
    plots
}

/// A path with two corners, each run round as an arc would be; upright or lying.
fn deviations(turning: bool) -> PathDeviations {
    let place = |a: f64, b: f64| if turning { [10.0 + b, 0.0, a] } else { [a, b, 0.2 * a] };
    let corners = [place(0.0, 0.0), place(20.0, 0.0), place(20.0, 20.0), place(0.0, 20.0)];
    let view = |title: &str, center, deviation_mm| CloseView { title: title.to_owned(), center, deviation_mm };
    let views =
        vec![view("farthest apart, line 3", corners[1], 0.05), view("most time lost, line 4", corners[2], 0.02)];
    let mut deviations = PathDeviations::new(0.05, views);
    for pair in corners.windows(2) {
        deviations.programmed(pair[0], pair[1]);
    }
    let cut = |along: f64, off: f64| [(along - off, 0.0), (along, off)].map(|(a, b)| place(a, b));
    let [before, behind] = cut(20.0, 0.3);
    deviations.deviates(0.0);
    deviations.run(corners[0], before);
    deviations.deviates(0.05);
    deviations.run(before, behind);
    deviations.deviates(0.0);
    let [upper, last] = [place(20.0, 19.9), place(19.9, 20.0)];
    deviations.run(behind, upper);
    deviations.deviates(0.02);
    deviations.run(upper, last);
    deviations.deviates(0.03);
    deviations.run(last, corners[3]);
    deviations
}

fn run() -> RunTrace {
    let mut run = RunTrace::new("jobs/1 \u{b7} runs/2", Some([0.003, 0.01]));
    for step in 0..60 {
        run.deflect(0.1 * f64::from(step), if step > 3 { 0.02 } else { 0.0 });
    }
    // Heard after the machine had gone on to 1.1 s, as from the log when a connection broke.
    for (time_s, feed) in [(0.565, 0.95), (0.765, 0.9025), (0.965, 0.857)] {
        run.measure(time_s, 0.012);
        run.decide(time_s, feed);
    }
    run.measure(1.165, 0.009);
    run.decide(1.165, 0.857);
    run
}

#[test]
fn a_close_view_shows_what_colours_tell() {
    for turning in [true, false] {
        let deviations = deviations(turning);
        let figure = super::PathDeviationPicture { program: "part.nc", deviations: &deviations, turning }.figure();
        assert!(figure.subtitle.contains("at most 50 µm apart"), "{}", figure.subtitle);
        let page = super::layout::Page::of(&figure);
        let axes: Vec<_> =
            page.panels.iter().map(|placed| [placed.panel.x.label.as_str(), placed.panel.y.label.as_str()]).collect();
        let expected = if turning { ["Z", "X (radius)"] } else { ["X", "Y"] };
        assert_eq!(axes, [expected; 3]);
        // What is not off, what is within a quarter of the largest, and so on.
        let names: Vec<_> = page.legend.iter().map(|entry| entry.name.as_ref()).collect();
        for name in
            ["as programmed", "as run, 0 to 12.5 µm off", "as run, 25 to 37.5 µm off", "as run, 37.5 to 50 µm off"]
        {
            assert!(names.contains(&name), "{name}: {names:?}");
        }
        // Close views are true to scale, and as large as what they show needs.
        for placed in &page.panels[1..] {
            let side = placed.panel.x.range.end - placed.panel.x.range.start;
            assert!((0.4..1.3).contains(&side), "{side} mm");
        }
    }
}

#[test]
fn every_picture_is_written_as_svg_and_png() {
    let directory = tempfile::tempdir().unwrap();
    let files = plots().write(&directory.path().join("pictures")).unwrap();
    let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(
        names,
        [
            "tool-path.svg",
            "tool-path.png",
            "path-deviation.svg",
            "path-deviation.png",
            "position.svg",
            "position.png",
            "feed.svg",
            "feed.png",
            "motion.svg",
            "motion.png",
            "chip-1.svg",
            "chip-1.png"
        ]
    );
    for file in files {
        let bytes = std::fs::read(&file).unwrap();
        if file.extension().unwrap() == "png" {
            assert_eq!(bytes[..8], *b"\x89PNG\r\n\x1a\n");
            assert_eq!(bytes[16..20], [0, 0, 5, 120], "1400 pixels wide");
        } else {
            let text = String::from_utf8(bytes).unwrap();
            assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        }
    }
}

#[test]
fn a_picture_has_title_axes_with_units_and_legend() {
    let figures = plots().figures();
    for (name, wanted) in [
        ("tool-path", &["Tool path", "Z, mm", "X (radius), mm", "rapid", "cutting with vibration"][..]),
        ("tool-path", &["threading with vibration of X", "beyond the scale: start at Z 150 mm, X (radius) 100 mm"]),
        ("position", &["time, s", "path position, mm", "with vibration", "start of the vibration"]),
        (
            "feed",
            &[
                "velocity of X",
                "velocity of Z",
                "feed, mm/min",
                "beyond the scale: rapid moves, up to 30\u{a0}000 mm/min",
            ],
        ),
        ("feed", &["limit of Z 30\u{a0}000 mm/min is beyond the scale"]),
        (
            "motion",
            &["feed, mm/min", "acceleration, m/s²", "jerk, m/s³", "time, s", "40 %", "hold", "override changes"],
        ),
        ("motion", &["acceleration along the path", "limit of X, Z 30\u{a0}000 mm/min"]),
        ("chip-1", &["chip thickness h, mm", "air: the chip is cut through", "41.667 Hz"]),
    ] {
        let text = canvas::svg_text(figures.iter().find(|figure| figure.name == name).unwrap()).unwrap();
        for wanted in wanted {
            assert!(text.contains(wanted), "{name}: {wanted}");
        }
    }
}

#[test]
fn feeds_are_scaled_for_the_cuts() {
    let figures = plots().figures();
    let feed = figures.iter().find(|figure| figure.name == "feed").unwrap();
    let panels = super::layout::panels(&feed.body);
    assert_eq!(panels.iter().map(|panel| panel.y.label.as_str()).collect::<Vec<_>>(), ["feed", "X", "Z"]);
    assert!(panels[0].y.range.end < 120.0 && panels[0].y.range.contains(&60.0), "{:?}", panels[0].y.range);
    // The vibration's velocity is seen whole, the rapid move's is not.
    assert!((400.0..800.0).contains(&panels[2].y.range.end), "{:?}", panels[2].y.range);
}

#[test]
fn a_run_goes_forwards_and_names_its_limits() {
    let figure = run().figure();
    let panels = super::layout::panels(&figure.body);
    let steps: Vec<_> = panels[1]
        .layers
        .iter()
        .filter_map(
            |layer| if let super::figure::Shape::Path(points) = &layer.shape { Some(points.clone()) } else { None },
        )
        .flatten()
        .collect();
    assert!(steps.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{steps:?}");
    assert_eq!(steps.len(), 8, "{steps:?}");
    assert_eq!((steps[0], steps[7]), ((0.0, 100.0), (5.9, 85.7)));
    let labels: Vec<_> = panels[0].labels.iter().map(|label| label.text.as_str()).collect();
    assert!(labels.iter().any(|label| label.ends_with("upper limit 0.01 mm")), "{labels:?}");
    assert!(labels.iter().any(|label| label.ends_with("lower limit 0.003 mm")), "{labels:?}");
    assert!(panels[0].notes.iter().any(|note| note.contains("means of the windows")));
}

#[test]
fn an_empty_program_still_draws() {
    let directory = tempfile::tempdir().unwrap();
    assert_eq!(Plots::new("empty.nc", false, axes(&["X", "Z"]), 1e-3, 1e-3).write(directory.path()).unwrap().len(), 8);
}

#[test]
fn an_unwritable_directory_is_said_plainly() {
    let error = plots().write(Path::new("/dev/null/pictures")).unwrap_err();
    assert!(error.to_string().starts_with("cannot create /dev/null/pictures: "));
}

mod thread {
    use feedwave_cutting::thread::{
        DepthLaw, GrooveProfile, InfeedPattern, LeadAxis, PassMethod, SpindleRotation, StartUp, ThreadGeometry,
        ThreadLimits, ThreadPlan, ThreadRequest, ThreadSide, judge_thread, plan_thread,
    };

    use crate::plot::{ThreadPictures, canvas, write_thread};

    pub(super) fn figures() -> Vec<super::Figure> {
        let plans = [(ThreadSide::External, 1, 0.6), (ThreadSide::Internal, 3, 0.25)];
        let figures = plans.map(|(side, starts, first_depth_mm)| {
            let plan = plan(side, starts, first_depth_mm);
            let pictures = ThreadPictures { name: "thread".to_owned(), job: &plan.job, report: &plan.report };
            crate::plot::thread::figures(&pictures)
        });
        figures.concat()
    }

    fn plan(side: ThreadSide, starts: u32, first_depth_mm: f64) -> ThreadPlan {
        let geometry = ThreadGeometry {
            lead_axis: LeadAxis::Z,
            side,
            work_mm: 10.0,
            start_mm: 10.0,
            end_mm: -20.0,
            taper: 0.02,
            lead_mm: 2.0 * f64::from(starts),
            starts,
            rotation: SpindleRotation::Forward,
        };
        let request = ThreadRequest {
            geometry,
            hand: None,
            profile: GrooveProfile::pointed(60.0),
            depth_mm: 1.2,
            finishing_allowance_mm: 0.02,
            first_depth_mm,
            infeed: InfeedPattern::Flank,
            law: DepthLaw::SquareRoot,
            method: PassMethod::StartAngle,
            start_up: StartUp::Preparatory,
            vibrations_per_rev: 1.5,
            spindle_rev_per_min: 200.0,
            amplitude_margin: 1.1,
            limits: ThreadLimits { finishing_thickness_mm: Some(0.1), ..ThreadLimits::default() },
        };
        plan_thread(&request).unwrap()
    }

    #[test]
    fn a_thread_has_three_pictures_whatever_its_passes() {
        for (side, starts, first_depth_mm) in [(ThreadSide::External, 1, 0.6), (ThreadSide::Internal, 3, 0.25)] {
            let plan = plan(side, starts, first_depth_mm);
            let pictures = ThreadPictures { name: "thread".to_owned(), job: &plan.job, report: &plan.report };
            let figures = crate::plot::thread::figures(&pictures);
            let names: Vec<_> = figures.iter().map(|figure| figure.name.as_str()).collect();
            assert_eq!(names, ["thread-unrolled", "thread-position", "thread-section"]);
            let text =
                |name: &str| canvas::svg_text(figures.iter().find(|figure| figure.name == name).unwrap()).unwrap();
            for (name, wanted) in [
                ("thread-unrolled", ["spindle angle (360 degrees are", "Z, mm", "in the air with the full section"]),
                ("thread-position", ["spindle angle, degrees", "X (radius), mm", "a ribbon holds the chip"]),
                ("thread-section", ["along Z from the tip", "finished groove", "most is left at"]),
                ("thread-unrolled", ["magnified", "no vibration", "mm of the circumference), degrees"]),
            ] {
                let text = text(name);
                for wanted in wanted {
                    assert!(text.contains(wanted), "{name}: {wanted}");
                }
            }
            if starts > 1 {
                assert!(text("thread-section").contains("first of 3 starts"));
            }
        }
    }

    #[test]
    fn an_impossible_thread_has_none() {
        let mut job = plan(ThreadSide::External, 1, 0.6).job;
        job.geometry.lead_mm = f64::NAN;
        let report = judge_thread(&job, &ThreadLimits::default());
        let directory = tempfile::tempdir().unwrap();
        let pictures = ThreadPictures { name: "thread".to_owned(), job: &job, report: &report };
        assert!(write_thread(&pictures, directory.path()).unwrap().is_empty());
    }
}

mod tool_oscillation {
    use feedwave_cutting::tool_oscillation::{
        DirectionLimits, DirectionOscillation, Engagement, LeadingEdge, OscillationCondition, OscillationCut,
        OscillationJob, OscillationLimits, OscillationPeriod, OscillationSectionReport, RoleReport, RoleRotation,
        ToolGeometry, ToolOscillation, Waveform, judge,
    };

    use crate::plot::{OscillationPictures, canvas};

    pub(super) fn figures() -> Vec<super::Figure> {
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
            .flat_map(|(tool, periods)| with(tool, *periods, 600.0, Some(0.05), crate::plot::tool_oscillation::figures))
            .collect()
    }

    /// Name and SVG of every picture.
    fn draw(
        tool: &ToolGeometry,
        periods_per_rev: u32,
        feed_mm_per_min: f64,
        across_mm: Option<f64>,
    ) -> Vec<(String, String)> {
        let figures = with(tool, periods_per_rev, feed_mm_per_min, across_mm, crate::plot::tool_oscillation::figures);
        let names: Vec<_> = figures.iter().map(|figure| figure.name.as_str()).collect();
        assert_eq!(
            names,
            ["waveform", "path", "edges", "stages", "layers", "floor"].map(|name| format!("pass-{name}"))
        );
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
        };
        let limits =
            DirectionLimits { velocity_mm_per_s: 500.0, acceleration_mm_per_s2: 1e5, jerk_mm_per_s3: 5_000_000.0 };
        let job = OscillationJob {
            tool,
            condition: &condition,
            leading_edge: 1,
            cut,
            limits: OscillationLimits { plane: limits, axial: limits },
            max_feed_override: 1.0,
            drives: None,
            floor: None,
            span: feedwave_program::SourceSpan {
                line: 7,
                column: 1,
                length: 4,
                ..feedwave_program::SourceSpan::default()
            },
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
        let notes = |figure: &super::Figure| -> String {
            crate::plot::layout::panels(&figure.body).iter().flat_map(|panel| panel.notes.clone()).collect()
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
}
