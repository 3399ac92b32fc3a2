//! Tool oscillation on the command line: machine and tools from files.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

use serde_json::Value;

use super::{code, fixture, run, stderr};

type Vec3 = [f64; 3];

/// Tool of `oscillation-tools.toml`, distance of the head's pivot from the gauge point and Z of G54 in `oscillation-head.toml`, mm.
const TOOL_MM: f64 = 68.4;
const PIVOT_MM: f64 = 250.0;
const ORIGIN_Z_MM: f64 = -500.0;
/// Over how much of the path the oscillation is blended in and out there, mm.
const RAMP_MM: f64 = 5.0;

fn validate(program: &Path, tools: &Path, more: &[&str]) -> std::process::Output {
    let profile = fixture("oscillation-mill.toml");
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        vec![&"validate", &program, &"--profile", &profile, &"--tools", &tools, &"--format", &"json"];
    arguments.extend(more.iter().map(|argument| argument as &dyn AsRef<std::ffi::OsStr>));
    run(&arguments)
}

#[test]
fn a_tool_library_makes_the_oscillation_possible() {
    let (program, tools) = (fixture("oscillation-mill.nc"), fixture("oscillation-tools.toml"));
    let output = validate(&program, &tools, &[]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let one = &report["oscillations"][0];
    assert_eq!((one["tool"].as_u64(), one["condition"].as_str()), (Some(4), Some("accuracy")));
    let areas = one["edges"].as_array().unwrap().iter().map(|edge| edge["areaMm2"].as_f64().unwrap());
    assert!((areas.sum::<f64>() - 1.03).abs() < 1e-9);
    for condition in ["P2", "P3"] {
        let directory = tempfile::tempdir().unwrap();
        let other = directory.path().join("other.nc");
        let text = std::fs::read_to_string(&program).unwrap();
        std::fs::write(&other, text.replace("P1", condition)).unwrap();
        assert_eq!(code(&validate(&other, &tools, &["--deny-warnings"])), 0, "{condition}");
    }
}

#[test]
fn what_is_wrong_with_a_tool_library_is_said_before_anything_is_read() {
    let directory = tempfile::tempdir().unwrap();
    let library = directory.path().join("tools.toml");
    let text = std::fs::read_to_string(fixture("oscillation-tools.toml")).unwrap();
    std::fs::write(&library, text.replace("radius_mm = 60", "radius_mm = 0")).unwrap();
    let output = validate(&fixture("oscillation-mill.nc"), &library, &[]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("tools.toml: tools[0].geometry.radius_mm: "), "{}", stderr(&output));
    let output = validate(&fixture("oscillation-mill.nc"), &fixture("oscillation-tools.toml"), &["--tool", "4=60"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("--tool 4: that tool is stated already"), "{}", stderr(&output));
    // Without cutting edges there is nothing that could oscillate.
    std::fs::write(&library, "[[tools]]\nnumber = 4\n").unwrap();
    let output = validate(&fixture("oscillation-mill.nc"), &library, &[]);
    assert_eq!(code(&output), 1);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let codes: Vec<_> = report["findings"].as_array().unwrap().iter().map(|finding| &finding["code"]).collect();
    assert!(codes.contains(&&Value::from("OSC-TOOL-UNKNOWN")), "{codes:?}");
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// The axis of a fork head, and the tool centre point in work coordinates: X Y Z, then C and B, from the work to the tool.
fn forward([x, y, z]: Vec3, [c_deg, b_deg]: [f64; 2]) -> (Vec3, Vec3) {
    let ((sin_c, cos_c), (sin_b, cos_b)) = (c_deg.to_radians().sin_cos(), b_deg.to_radians().sin_cos());
    let axis = [sin_b * cos_c, sin_b * sin_c, cos_b];
    let arm = PIVOT_MM + TOOL_MM;
    ([x - arm * axis[0], y - arm * axis[1], z + PIVOT_MM - ORIGIN_Z_MM - arm * axis[2]], axis)
}

/// A cut of `oscillation-head.nc`: its line, its length, and its point and direction at a place along it.
struct Cut {
    line: &'static str,
    length_mm: f64,
    /// The edge that leads points along the feed so many turns of the spindle later than along the tool's own X.
    later_turns: f64,
    place: fn(f64) -> (Vec3, Vec3),
}

/// The crest, of radius 200 within a micrometre, about an axis along Y.
fn crest(s: f64) -> (Vec3, Vec3) {
    let radius = 51.764_f64.hypot(193.185);
    let (sin, cos) = (s / radius - (51.764 / radius).asin()).sin_cos();
    ([radius * sin, 0.0, radius * cos - 6.815 - 193.185], [cos, 0.0, -sin])
}

/// The cone at the height of the cut.
fn cone(s: f64) -> (Vec3, Vec3) {
    let (sin, cos) = (s / 80.0).sin_cos();
    ([80.0 * cos, 100.0 + 80.0 * sin, 0.0], [-sin, cos, 0.0])
}

#[test]
fn a_head_that_turns_the_tool_oscillates_it_along_feed_and_tool_axis() {
    let directory = tempfile::tempdir().unwrap();
    let (out, plots) = (directory.path().join("head.csv"), directory.path().join("pictures"));
    let (program, profile) = (fixture("oscillation-head.nc"), fixture("oscillation-head.toml"));
    let tools = fixture("oscillation-tools.toml");
    let output =
        run(&[&"plan", &program, &"--profile", &profile, &"--tools", &tools, &"--out", &out, &"--plots", &plots]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let table = std::fs::read_to_string(&out).unwrap();
    let mut rows = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let column = |name: &str| header.iter().position(|own| *own == name).unwrap_or_else(|| panic!("no {name}"));
    let line = column("source_line");
    let columns = ["X_mm", "Y_mm", "Z_mm", "C_deg", "B_deg", "path_position_mm", "spindle_angle_deg"].map(column);
    let rows: Vec<_> = rows.collect();
    let crest_mm = 51.764_f64.hypot(193.185) * 2.0 * (51.764 / 51.764_f64.hypot(193.185)).asin();
    for cut in [
        Cut { line: "11", length_mm: crest_mm, later_turns: 0.0, place: crest },
        Cut { line: "18", length_mm: 80.0 * FRAC_PI_2, later_turns: -0.25, place: cone },
    ] {
        let own = rows.iter().filter(|row| row[line] == cut.line);
        let own: Vec<_> = own.map(|row| columns.map(|column| row[column].parse::<f64>().unwrap())).collect();
        let from_mm = own.last().unwrap()[5] - cut.length_mm;
        let mut whole = 0;
        for [x, y, z, c, b, path, spindle] in own {
            let s = path - from_mm;
            if !(RAMP_MM..=cut.length_mm - RAMP_MM).contains(&s) {
                continue;
            }
            whole += 1;
            let (tip, axis) = forward([x, y, z], [c, b]);
            let (point, feed) = (cut.place)(s);
            let offset: Vec3 = std::array::from_fn(|axis| tip[axis] - point[axis]);
            let across =
                std::array::from_fn(|k| feed[(k + 1) % 3] * axis[(k + 2) % 3] - feed[(k + 2) % 3] * axis[(k + 1) % 3]);
            let turns = (spindle / 360.0 - cut.later_turns).rem_euclid(1.0);
            // Numbers of the program have three digits: the crest is square to the tool within 1e-6 rad, and the offset along it has that part
            // along the tool.
            let along = dot(offset, feed) - 0.4 * (TAU * turns).sin();
            assert!(along.abs() < 1e-6 && dot(offset, across).abs() < 1e-9, "line {}, {s} mm: {offset:?}", cut.line);
            let axial = dot(offset, axis);
            let held = if (0.1..0.4).contains(&turns) {
                0.03
            } else if (0.6..0.9).contains(&turns) {
                -0.03
            } else {
                axial.clamp(-0.03, 0.03)
            };
            assert!((axial - held).abs() < 5e-7, "line {}, {s} mm: {axial} along the axis", cut.line);
        }
        assert!(whole > 18_000, "line {}: {whole}", cut.line);
    }
    for picture in
        ["rotary-axes.svg", "oscillation-line-11-stages.svg", "oscillation-line-18-stages.svg", "position.svg"]
    {
        assert!(plots.join(picture).is_file(), "{picture}");
    }
}
