//! Five-axis programs on the command line: files in machine and work coordinates, and the report.

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;

use crate::{code, feedwave, fixture, number, rows, stderr, stdout};

/// The freeform program on the five-axis mill.
fn on_mill(command: &str, arguments: &[&str]) -> std::process::Output {
    on("five-axis-mill.toml", command, arguments)
}

/// The same on the mill of a profile.
fn on(profile: &str, command: &str, arguments: &[&str]) -> std::process::Output {
    let (program, profile) = (fixture("freeform.nc"), fixture(profile));
    let mut call = feedwave();
    call.arg(command).arg(program).arg("--profile").arg(profile).args(["--tool", "1=120"]).args(arguments);
    call.output().unwrap()
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Values by letter of a block of the program.
fn words(line: &str) -> impl Fn(char) -> Option<f64> + '_ {
    |letter| {
        let word = line.split_whitespace().find(|word| word.starts_with(letter))?;
        word[1..].parse().ok()
    }
}

#[test]
fn work_coordinates_are_the_tool_centre_point_and_its_direction() {
    let output = on_mill("plan", &["--out", "-", "--frame", "work"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let csv = stdout(&output);
    let header: Vec<_> = csv.lines().next().unwrap().split(',').collect();
    assert_eq!(header[2..7], ["X_mm", "Y_mm", "Z_mm", "A_deg", "C_deg"]);
    assert_eq!(header[11..], ["tool_direction_X", "tool_direction_Y", "tool_direction_Z", "source_line"]);

    // Where each line of the program ends: words are modal.
    let program = std::fs::read_to_string(fixture("freeform.nc")).unwrap();
    let mut place = [0.0; 3];
    let ends: Vec<[f64; 3]> = program
        .lines()
        .map(|line| {
            let word = words(line);
            for (letter, value) in ['X', 'Y', 'Z'].into_iter().zip(&mut place) {
                *value = word(letter).unwrap_or(*value);
            }
            place
        })
        .collect();
    let end_of = |line: usize| ends[line - 1];
    let guided = 9..program.lines().position(|line| line == "M34").unwrap();
    // Thinned blocks: each setpoint is on the segment from the end of the kept block before to the end of its own.
    let (mut lines, mut farthest_mm, mut turned_deg) = (Vec::new(), 0.0_f64, 0.0_f64);
    for row in rows(&csv) {
        let line = row[14] as usize;
        if !guided.contains(&line) {
            continue;
        }
        if lines.last() != Some(&line) {
            lines.push(line);
        }
        let direction: [f64; 3] = std::array::from_fn(|axis| row[11 + axis]);
        assert!((norm(direction) - 1.0).abs() < 1e-12);
        // v = Rz(C)·Rx(A)·z
        let ((a_sine, a_cosine), (c_sine, c_cosine)) = (row[5].to_radians().sin_cos(), row[6].to_radians().sin_cos());
        let expected = [c_sine * a_sine, -c_cosine * a_sine, a_cosine];
        turned_deg = turned_deg.max(norm(std::array::from_fn(|axis| direction[axis] - expected[axis])).to_degrees());
        let [.., before, this] = lines[..] else { continue };
        if end_of(before) == end_of(this) {
            continue;
        }
        let (start, end) = (end_of(before), end_of(this));
        let travel: [f64; 3] = std::array::from_fn(|axis| end[axis] - start[axis]);
        let from_start: [f64; 3] = std::array::from_fn(|axis| row[2 + axis] - start[axis]);
        let share = (0..3).map(|axis| travel[axis] * from_start[axis]).sum::<f64>() / norm(travel).powi(2);
        assert!((-1e-9..=1.0 + 1e-9).contains(&share), "line {line}: {share}");
        farthest_mm = farthest_mm.max(norm(std::array::from_fn(|axis| from_start[axis] - share * travel[axis])));
    }
    assert!(lines.len() > 200 && lines.is_sorted());
    assert!(farthest_mm < 1e-9 && turned_deg < 1e-9, "{farthest_mm} mm, {turned_deg} degrees");
}

#[test]
fn parquet_has_the_tool_direction_too() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("part.parquet");
    let arguments = ["--frame", "work", "--from-index", "9000", "--count", "1000", "--out"];
    let output = on_mill("plan", &[&arguments[..], &[path.to_str().unwrap()]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let csv = on_mill("plan", &[&arguments[..], &["-"]].concat());
    let wanted = rows(&stdout(&csv));
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let mut count = 0;
    for (row, wanted) in reader.get_row_iter(None).unwrap().zip(&wanted) {
        for ((name, field), wanted) in row.unwrap().get_column_iter().zip(wanted) {
            if let Field::Double(value) = field {
                assert_eq!(value.to_bits(), wanted.to_bits(), "{name}");
            }
        }
        count += 1;
    }
    assert_eq!((count, wanted.len(), wanted[0].len()), (1_000, 1_000, 15));
}

#[test]
fn the_report_says_what_thinning_did_and_has_units_of_rotary_axes() {
    let output = on_mill("validate", &[]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("2 627 read in 13 groups") && text.contains("velocity, °/min"), "{text}");
    let output = on_mill("validate", &["--format", "json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let thinning = &report["thinning"];
    let axes = thinning["rotaryAxes"].as_array().unwrap();
    let sum = |of: &str| axes.iter().map(|axis| number(&axis[of])).sum::<u64>();
    let (before, after) = (sum("reversalsBefore"), sum("reversalsAfter"));
    assert!(after * 10 < before, "{before} reversals before, {after} after");
    let deviation_mm = thinning["positionDeviationMm"].as_f64().unwrap();
    assert!(deviation_mm > 0.005 && deviation_mm < 0.01, "{deviation_mm}");
    // Both methods with the same tolerances, whichever the program is run by.
    assert!(text.contains("published") && text.contains("fitted") && text.contains("unbounded"), "{text}");
    let methods = thinning["methods"].as_array().unwrap();
    let of = |place: usize, name: &str| methods[place][name].as_f64().unwrap();
    assert_eq!(methods[0]["method"], "THINNING_METHOD_PUBLISHED");
    assert_eq!((methods.len(), number(&methods[0]["blocksKept"])), (2, number(&thinning["blocksKept"])));
    assert_eq!(methods[1]["method"], "THINNING_METHOD_FITTED");
    assert!(of(1, "positionDeviationMm") < 0.01 && of(1, "directionBoundDeg") <= 1.0, "{methods:?}");
    assert!(of(1, "directionDeviationDeg") <= of(1, "directionBoundDeg"), "{methods:?}");
    let rotary: Vec<_> = report["summary"]["axes"].as_array().unwrap().iter().map(|axis| &axis["rotary"]).collect();
    assert_eq!(rotary, [false, false, false, true, true]);
}

#[test]
fn pictures_compare_the_program_with_what_thinning_leaves() {
    let directory = tempfile::tempdir().unwrap();
    let picture = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
    let output = on_mill("plan", &["--plots", directory.path().to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rotary = picture("rotary-axes.svg");
    assert!(rotary.contains("reversals inside the cuts: 639 as programmed, 0 thinned by a fit, 2 thinned as"));
    assert!(rotary.contains("in the whole program"), "turns between the cuts are counted, too");
    let sphere = picture("tool-direction.svg");
    assert!(sphere.contains("as programmed") && sphere.contains("thinned") && sphere.contains("90\u{b0}"));
    assert!(picture("thinning-deviation.svg").contains("2388 of 2627 blocks dropped"));
    assert!(picture("tool-path.svg").contains("cutting"));

    let directory = tempfile::tempdir().unwrap();
    let output = on_mill("plan", &["--every-block", "--plots", directory.path().to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let sphere = std::fs::read_to_string(directory.path().join("tool-direction.svg")).unwrap();
    assert!(sphere.contains("as run") && !sphere.contains("thinned"));
    assert!(!directory.path().join("thinning-deviation.svg").exists());
}

#[test]
fn the_fitted_method_is_reported_and_drawn_in_three_views() {
    let output = on("five-axis-fitted.toml", "validate", &["--format", "json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let thinning = &report["thinning"];
    assert_eq!(thinning["method"], "THINNING_METHOD_FITTED");
    let of = |name: &str| thinning[name].as_f64().unwrap();
    // Both tolerances hold everywhere, and the time is less than that of the published method.
    assert!(of("positionDeviationMm") < 0.01 && of("directionBoundDeg") <= 1.0, "{thinning}");
    let times: Vec<f64> =
        thinning["methods"].as_array().unwrap().iter().map(|method| method["timeS"].as_f64().unwrap()).collect();
    assert!(times.len() == 2 && times[1] < 0.9 * times[0] && of("timeAfterS") == times[1], "{times:?}");
    let axes = thinning["rotaryAxes"].as_array().unwrap();
    let sum = |of: &str| axes.iter().map(|axis| axis.get(of).map_or(0, number)).sum::<u64>();
    let (before, after) = (sum("reversalsBefore"), sum("reversalsAfter"));
    assert!(before > 1_500 && after < 20, "{before} {after}");

    let directory = tempfile::tempdir().unwrap();
    let picture = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
    let output = on("five-axis-fitted.toml", "plan", &["--plots", directory.path().to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    for name in ["rotary-axes.svg", "tool-direction.svg"] {
        let text = picture(name);
        for way in ["as programmed", "thinned as published", "thinned by a fit"] {
            assert!(text.contains(way), "{name}: {way}");
        }
    }
    assert!(picture("rotary-axes.svg").contains("blocks dropped"));
    let deviation = picture("thinning-deviation.svg");
    assert!(deviation.contains("every block, dropped or kept") && deviation.contains("tolerance 10"), "{deviation}");
}
