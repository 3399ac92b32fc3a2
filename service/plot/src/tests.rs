use std::path::Path;

use feedwave_cutting::{CutCondition, FeedCoupling, SetpointBlock};
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, Kinematics, KinematicsDescription, Wrap};
use feedwave_program::Axis;

use super::canvas;
use super::{AxisShown, CloseView, Cut, PathDeviations, PathTrace, Plots, RapidLines, RunTrace, Stretch};

mod rules;
mod thread;
mod tool_oscillation;

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
        ("tool-path", &["threading with vibration", "beyond the scale: start at Z 150 mm, X (radius) 100 mm"]),
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
            &[
                "feed, mm/min",
                "acceleration / limit, %",
                "jerk / limit, %",
                "time, s",
                "40 %",
                "hold",
                "override changes",
            ],
        ),
        (
            "motion",
            &[
                "limit of the axis 100 %",
                "limits of the axes: X, Z 30\u{a0}000 mm/min",
                "limits of the axes: X, Z 10 m/s²",
            ],
        ),
        ("chip-1", &["chip thickness h, mm", "air: the chip is cut through", "41.667 Hz"]),
    ] {
        let text = canvas::svg_text(figures.iter().find(|figure| figure.name == name).unwrap()).unwrap();
        for wanted in wanted {
            assert!(text.contains(wanted), "{name}: {wanted}");
        }
    }
}

#[test]
fn vibrating_cuts_are_seen_under_plain_ones_and_rapids_stay_dashed() {
    let (start, end) = ([10.0, 0.0, 2.0], [10.0, 0.0, -8.0]);
    let mut trace = PathTrace::default();
    for (x, stretch) in [(12.0, Stretch::VibratingThread), (11.0, Stretch::Threading)] {
        trace.line(Stretch::Rapid, [20.0, 0.0, 2.0], [x, 0.0, 2.0]);
        trace.line(stretch, start, end);
        trace.line(Stretch::Rapid, [x, 0.0, -8.0], [20.0, 0.0, -8.0]);
    }
    let figure = super::ToolPathPicture { program: "thread.nc", trace: &trace, turning: true }.figure();
    let layers = &super::layout::panels(&figure.body)[0].layers;
    let width = |name: &str| {
        let layer = layers.iter().find(|layer| layer.ink.name == name).unwrap();
        let super::theme::Mark::Line { width } = layer.ink.mark else { panic!("{name}") };
        width
    };
    // At least a pixel and a half on either side.
    assert!(width("threading with vibration") >= width("threading") + 3.0);
    let rapids: Vec<_> = layers.iter().filter(|layer| layer.ink.name == "rapid moves").collect();
    let points: Vec<_> = rapids
        .iter()
        .filter_map(|layer| if let super::figure::Shape::Path(points) = &layer.shape { Some(points) } else { None })
        .collect();
    let at = |z: f64| points.iter().filter(|line| line.iter().all(|place| place.0 == z)).count();
    assert_eq!((at(2.0), at(-8.0)), (1, 1), "{points:?}");
}

#[test]
fn motion_says_what_its_curves_are_without() {
    let subtitle = |plots: Plots| plots.figures().into_iter().find(|figure| figure.name == "motion").unwrap().subtitle;
    let plain = subtitle(Plots::new("empty.nc", false, axes(&["X", "Z"]), 1e-3, 1e-3));
    assert!(plain.contains("as commanded") && !plain.contains("superposed") && !plain.contains("vibration"), "{plain}");
    let vibrating = subtitle(plots());
    assert!(
        vibrating.contains("without what is superposed") && !vibrating.contains("without vibration"),
        "{vibrating}"
    );
}

#[test]
fn motion_holds_each_axis_against_its_own_limit() {
    use super::figure::Shape;
    // To 0.3 m/s and back along a diagonal of X and Y, as fast as both axes together can, then along X alone.
    let (h, diagonal) = (1e-3, 10_000.0 * std::f64::consts::SQRT_2);
    let (mut speed, mut place, mut at) = (0.0, 0.0, [0.0; 2]);
    let mut block = SetpointBlock { line: vec![2; 141], ..block(0, 141) };
    for row in 0..141_usize {
        let (acceleration, direction) = match row {
            1..=20 => (diagonal, [std::f64::consts::FRAC_1_SQRT_2; 2]),
            51..=70 => (-diagonal, [std::f64::consts::FRAC_1_SQRT_2; 2]),
            81..=100 => (10_000.0, [1.0, 0.0]),
            121..=140 => (-10_000.0, [1.0, 0.0]),
            _ => (0.0, if row < 75 { [std::f64::consts::FRAC_1_SQRT_2; 2] } else { [1.0, 0.0] }),
        };
        speed += acceleration * h;
        place += speed * h;
        at = [at[0] + direction[0] * speed * h, at[1] + direction[1] * speed * h];
        (block.axes[0][row], block.axes[1][row]) = (at[0], at[1]);
        (block.path_position_mm[row], block.feed_mm_per_min[row]) = (place, 60.0 * speed);
        block.vibration_offset_mm[row] = 0.0;
    }
    let mut plots = Plots::new("corner.nc", false, axes(&["X", "Y"]), h, h);
    plots.push_commands(&block);
    let motion = |plots: &Plots| plots.figures().into_iter().find(|figure| figure.name == "motion").unwrap();
    let figure = motion(&plots);
    let acceleration = super::layout::panels(&figure.body)[1].clone();
    assert_eq!(acceleration.notes, ["limits of the axes: X, Y 10 m/s²"]);
    // Along the diagonal the path has 14 m/s², each axis what it can follow.
    for name in ["X", "Y"] {
        let layer = acceleration.layers.iter().find(|layer| layer.ink.name == name).unwrap();
        let Shape::Path(points) = &layer.shape else { panic!("{name}") };
        let largest = points.iter().map(|point| point.1.abs()).fold(0.0, f64::max);
        assert!((99.9..100.1).contains(&largest), "{name}: {largest} %");
    }
    assert!(acceleration.y.range.contains(&-100.0) && acceleration.y.range.contains(&100.0));
    // In coordinates of the work no axis of the machine is known.
    plots.show_the_work();
    let figure = motion(&plots);
    let panels = super::layout::panels(&figure.body);
    assert!(panels[1].layers.iter().all(|layer| layer.ink.name == "acceleration along the path"));
    assert!(!figure.subtitle.contains("limit"), "{}", figure.subtitle);
}

#[test]
fn numbers_of_close_views_are_not_written_over_each_other() {
    let view = |x: f64| CloseView { title: format!("at {x}"), center: [x, 0.0, 0.0], deviation_mm: 0.01 };
    let sides = |x: f64| {
        let mut deviations = PathDeviations::new(0.01, vec![view(50.0), view(x)]);
        for (from, to) in [([0.0; 3], [100.0, 0.0, 0.0]), ([100.0, 0.0, 0.0], [100.0, 80.0, 0.0])] {
            deviations.programmed(from, to);
            deviations.run(from, to);
        }
        let figure = super::PathDeviationPicture { program: "p.nc", deviations: &deviations, turning: false }.figure();
        let labels = super::layout::panels(&figure.body)[0].labels.clone();
        labels.iter().map(|label| label.beside.by.1.signum()).collect::<Vec<_>>()
    };
    assert_eq!(sides(52.0), [-1.0, 1.0]);
    assert_eq!(sides(70.0), [-1.0, -1.0]);
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
