//! The subcommands for people, as people call them: the built binary, its output and its exit codes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::Value;

mod database;
mod encryption;
mod five_axis;
mod improve;
mod installation;
mod interpret;
mod lobes;
mod lsp;
mod oscillation;
mod reports;
mod resources;
mod robustness;
mod run;
mod service;
mod thread_plan;
mod validate;
mod watch;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures").join(name)
}

fn feedwave() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_feedwave"));
    command.env_remove("FEEDWAVE_CONFIG").env_remove("FEEDWAVE_SERVER").stdin(Stdio::null());
    command
}

/// Runs a command to its end.
fn run(arguments: &[&dyn AsRef<std::ffi::OsStr>]) -> Output {
    let mut command = feedwave();
    for argument in arguments {
        command.arg(argument);
    }
    command.output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn validate_json(path: &Path) -> (Value, i32) {
    let output = run(&[&"validate", &path, &"--format", &"json"]);
    (
        serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", stderr(&output))),
        code(&output),
    )
}

/// A count in JSON: 64-bit integers are strings there.
fn number(value: &Value) -> u64 {
    value.as_str().and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{value} is not a count"))
}

#[test]
fn a_plan_gives_its_report_beside_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("a.csv");
    let program = fixture("spec-trap.nc");
    let output = run(&[&"plan", &program, &"--out", &file, &"--format", &"json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report, validate_json(&program).0);
    let rows = std::fs::read_to_string(&file).unwrap().lines().count() as u64 - 1;
    assert_eq!(number(&report["summary"]["setpointCount"]), rows);

    let output = run(&[&"plan", &fixture("bad.nc"), &"--out", &file, &"--format", &"json"]);
    assert_eq!(code(&output), 1);
    assert!(number(&serde_json::from_slice::<Value>(&output.stdout).unwrap()["summary"]["errors"]) > 0);
    let output = run(&[&"plan", &program, &"--out", &"-", &"--format", &"json"]);
    assert_eq!((code(&output), stdout(&output)), (2, String::new()));
    assert!(stderr(&output).contains("--format json: "), "{}", stderr(&output));
}

fn plan_to(directory: &Path, name: &str, arguments: &[&str]) -> PathBuf {
    let path = directory.join(name);
    let program = fixture("spec-trap-cured.nc");
    let output = feedwave().arg("plan").arg(program).arg("--out").arg(&path).args(arguments).output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    path
}

fn rows(csv: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
    csv.lines().skip(1).map(row).collect()
}

#[test]
fn csv_names_units_and_ends_on_the_programmed_point() {
    let directory = tempfile::tempdir().unwrap();
    let csv = std::fs::read_to_string(plan_to(directory.path(), "a.csv", &[])).unwrap();
    assert_eq!(
        csv.lines().next().unwrap(),
        "index,time_s,X_mm,Z_mm,path_position_mm,feed_mm_per_min,vibration_offset_mm,spindle_angle_deg,source_line"
    );
    let rows = rows(&csv);
    let last = rows.last().unwrap();
    assert_eq!((last[2], last[3]), (7.0, 23.5), "X is programmed as a diameter and written as a radius");
    let (report, _) = validate_json(&fixture("spec-trap-cured.nc"));
    assert_eq!(rows.len() as u64, number(&report["summary"]["setpointCount"]));
    assert!(rows.iter().zip(0_u32..).all(|(row, index)| row[0] == f64::from(index)));
    assert_eq!(rows[1_234][1], 1.234);
    let peak = rows.iter().map(|row| row[6].abs()).fold(0.0, f64::max);
    assert!(peak > 0.0295 && peak <= 0.030_000_001, "{peak}");
}

#[test]
fn the_published_form_is_a_choice_that_says_what_it_asks_for() {
    let program = fixture("spec-trap-cured.nc");
    let blended = stdout(&run(&[&"validate", &program]));
    assert!(blended.contains("blended in and out over 0.036 mm"), "{blended}");
    let published = stdout(&run(&[&"validate", &program, &"--envelope", &"published"]));
    assert!(published.contains("as published: steps of velocity of 7.854 mm/s at the start"), "{published}");
    assert!(!published.contains("blended in and out"), "{published}");
    let directory = tempfile::tempdir().unwrap();
    let of = |name: &str, options: &[&str]| {
        rows(&std::fs::read_to_string(plan_to(directory.path(), name, options)).unwrap())
    };
    let first_offset = |rows: &[Vec<f64>]| rows.iter().map(|row| row[6].abs()).find(|offset| *offset > 0.0).unwrap();
    assert!(first_offset(&of("blended.csv", &[])) < 1e-6);
    assert!(first_offset(&of("published.csv", &["--envelope", "published"])) > 1e-3);
}

#[test]
fn parquet_reads_back_as_the_csv() {
    let directory = tempfile::tempdir().unwrap();
    let csv = rows(&std::fs::read_to_string(plan_to(directory.path(), "a.csv", &[])).unwrap());
    let path = plan_to(directory.path(), "a.parquet", &[]);
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let mut count = 0;
    for (row, wanted) in reader.get_row_iter(None).unwrap().zip(&csv) {
        for ((_, field), wanted) in row.unwrap().get_column_iter().zip(wanted) {
            let value = match field {
                Field::Long(value) => *value as f64,
                Field::Int(value) => f64::from(*value),
                Field::Double(value) => *value,
                other => panic!("unexpected {other:?}"),
            };
            assert_eq!(value.to_bits(), wanted.to_bits());
        }
        count += 1;
    }
    assert_eq!(count, csv.len());
}

#[test]
fn a_part_of_a_plan_is_that_part_of_the_whole() {
    let directory = tempfile::tempdir().unwrap();
    let read = |name: &str, arguments: &[&str]| {
        let text = std::fs::read_to_string(plan_to(directory.path(), name, arguments)).unwrap();
        text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let whole = read("whole.csv", &[]);
    assert_eq!(read("a.csv", &["--from-index", "1500", "--count", "3000"]), whole[1_500..4_500]);
    assert_eq!(read("b.csv", &["--from-time", "2.0005", "--count", "1"]), whole[2_001..2_002]);
    assert_eq!(read("c.csv", &["--from-index", "86000"]), whole[86_000..]);
    let output = run(&[&"plan", &fixture("spec-trap-cured.nc"), &"--out", &"-", &"--from-time", &"-1"]);
    assert_eq!(code(&output), 2);
    let said = stderr(&output);
    assert!(said.contains("'--from-time <SECONDS>': must be a number of seconds, not negative"), "{said}");
    let output = run(&[&"plan", &fixture("spec-trap-cured.nc"), &"--out", &"-", &"--from-index", &"99999999"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("lies beyond the last one, 86"), "{}", stderr(&output));
}

#[test]
fn counts_of_nothing_are_refused_with_their_range() {
    let program = fixture("spec-trap-cured.nc");
    for (option, range) in [("--count=0", "0 is not in 1.."), ("--servo-substeps=0", "0 is not in 1..=64")] {
        let output = run(&[&"plan", &program, &"--out", &"-", &"--mode", &"servo-side", &option]);
        assert_eq!(code(&output), 2, "{option}");
        assert!(stderr(&output).contains(range), "{}", stderr(&output));
    }
    let of_the_profile =
        run(&[&"plan", &program, &"--count=9", &"--mode", &"servo-side", &"--out=-", &"--servo-substeps"]);
    assert_eq!(code(&of_the_profile), 0, "{}", stderr(&of_the_profile));
}

#[test]
fn servo_side_writes_conditions_or_what_the_drives_make_of_them() {
    let directory = tempfile::tempdir().unwrap();
    let conditions = plan_to(directory.path(), "a.csv", &["--mode", "servo-side"]);
    let header = std::fs::read_to_string(conditions).unwrap().lines().next().unwrap().to_owned();
    assert!(header.contains("vibration_phase_turns") && header.contains("Z_vibration_amplitude_mm"), "{header}");
    let read = |name: &str, arguments: &[&str]| {
        rows(&std::fs::read_to_string(plan_to(directory.path(), name, arguments)).unwrap())
    };
    let expanded = read("b.csv", &["--mode", "servo-side", "--servo-substeps", "4"]);
    assert_eq!(expanded[1][1], 0.000_25);
    // With one substep the drive generates what the tangential mode commands.
    let single = read("c.csv", &["--mode", "servo-side", "--servo-substeps", "1"]);
    let tangential = read("d.csv", &["--mode", "tangential"]);
    assert_eq!(single.len(), tangential.len());
    let differ = single.iter().zip(&tangential).any(|(a, b)| a[2] != b[2] || a[3] != b[3]);
    assert!(!differ, "one substep is the tangential mode");
    assert_eq!(expanded.len(), (single.len() - 1) * 4 + 1);
    assert!(expanded.iter().step_by(4).zip(&single).all(|(a, b)| a[2] == b[2] && a[3] == b[3]));
}

#[test]
fn a_divided_command_is_said_to_show_a_multiple_of_its_acceleration() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.csv");
    let said = |substeps: &str| {
        let program = fixture("spec-trap-cured.nc");
        let output =
            run(&[&"plan", &program, &"--out", &path, &"--mode", &"servo-side", &"--servo-substeps", &substeps]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stderr(&output)
    };
    assert!(!said("1").contains("divided"));
    let said = said("4");
    // The rapid moves take all of the limit.
    assert!(said.contains("shows up to 4 times") && said.contains("000 mm/s\u{b2} on"), "{said}");
    // As the setpoints have it.
    let setpoints = rows(&std::fs::read_to_string(&path).unwrap());
    let largest = |column: usize| {
        let bends = setpoints.windows(3).map(|rows| rows[2][column] - 2.0 * rows[1][column] + rows[0][column]);
        bends.fold(0.0, |largest, bend| f64::max(largest, bend.abs())) / (0.000_25 * 0.000_25)
    };
    assert!(f64::max(largest(2), largest(3)) > 30_000.0);
}

#[test]
fn a_refused_program_leaves_no_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bad.csv");
    let output = run(&[&"plan", &fixture("bad.nc"), &"--out", &path, &"--plots", &directory.path().join("plots")]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("PRG-UNKNOWN-CODE") && stderr(&output).contains("rejected"));
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
    let output = run(&[&"plan", &fixture("spec-trap-cured.nc"), &"--out", &"/no/such/directory/a.csv"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("/no/such/directory/a.csv: no such file"), "{}", stderr(&output));
}

#[test]
fn pictures_are_drawn_of_a_mill_program_too() {
    let directory = tempfile::tempdir().unwrap();
    let output = run(&[&"plan", &fixture("pocket-mill.nc"), &"--machine-kind", &"mill", &"--plots", &directory.path()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let tool_path = std::fs::read_to_string(directory.path().join("tool-path.svg")).unwrap();
    assert!(tool_path.contains("from above") && tool_path.contains("from the front"));
    assert!(directory.path().join("feed.png").is_file() && directory.path().join("position.png").is_file());
}

#[test]
fn deviation_and_slowdowns_are_told_and_drawn() {
    let directory = tempfile::tempdir().unwrap();
    let (program, exact) = (directory.path().join("corner.nc"), directory.path().join("exact.nc"));
    std::fs::write(&program, "G21 G90 G94 G17 F6000 G64 P0.05\nG1 X30\nY30\nX0\nG61.1 Y0\nM30\n").unwrap();
    std::fs::write(&exact, "G21 G90 G94 G17 F3000 G61\nG1 X30\nY30\nM30\n").unwrap();
    let mill = |command: &str, program: &Path, option: &str, value: Option<&Path>| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&command, &program, &"--machine-kind", &"mill", &option];
        if let Some(value) = &value {
            arguments.push(value);
        }
        run(&arguments)
    };
    let output = mill("validate", &program, "--compare-qualities", None);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    for said in [
        "mm from the programmed path, line 3 at X 29.9",
        "axis limits",
        "slowdowns",
        "rounded corner  a larger tolerance, G64 P",
        "fast ",
        "close to the least time ",
    ] {
        let words: Vec<_> = text.split_whitespace().collect();
        let wanted: Vec<_> = said.split_whitespace().collect();
        let last = wanted.len() - 1;
        let is_said = words
            .windows(wanted.len())
            .any(|window| window[..last] == wanted[..last] && window[last].starts_with(wanted[last]));
        assert!(is_said, "{said} is not in\n{text}");
    }
    assert!(stderr(&output).contains("s of machining per second"), "{}", stderr(&output));
    let pictures = |program: &Path, name: &str| {
        let folder = directory.path().join(name);
        let output = mill("plan", program, "--plots", Some(&folder));
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        folder
    };
    let drawn = pictures(&program, "rounded");
    let picture = std::fs::read_to_string(drawn.join("path-deviation.svg")).unwrap();
    for said in ["Path as programmed and as run", "as programmed", "1: farthest apart", "most time lost"] {
        assert!(picture.contains(said), "{said}");
    }
    assert!(drawn.join("path-deviation.png").is_file());
    assert!(!pictures(&exact, "exact").join("path-deviation.svg").exists(), "an exact path needs no picture of it");
}

#[test]
fn vibrating_threads_are_told_from_plain_ones_and_feeds_scaled_for_them() {
    let directory = tempfile::tempdir().unwrap();
    let output = run(&[&"plan", &fixture("thread-a.nc"), &"--plots", &directory.path()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let picture = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
    let tool_path = picture("tool-path.svg");
    // Three passes vibrate, the finishing pass does not.
    assert!(tool_path.contains("threading with vibration") && tool_path.contains("\nthreading\n"), "{tool_path}");
    assert!(tool_path.contains("beyond the scale: start at Z 0 mm, X (radius) 0 mm"));
    // The cut at 750 mm/min fills the scale, rapid moves leave it.
    let feed = picture("feed.svg");
    assert!(feed.contains("beyond the scale: rapid moves") && !feed.contains("\n10\u{a0}000\n"));
}

#[test]
fn splines_and_rounded_corners_are_drawn_as_they_are_run() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("curves.nc");
    let picture_of = |text: &str| {
        std::fs::write(&program, text).unwrap();
        let output = run(&[&"plan", &program, &"--machine-kind", &"mill", &"--plots", &directory.path()]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        std::fs::read_to_string(directory.path().join("tool-path.svg")).unwrap()
    };
    // Points of the longest line drawn: chords of curves, or the corners of straight moves.
    let longest = |svg: &str| {
        let lines = svg.split("points=\"").skip(1).filter_map(|rest| rest.split('"').next());
        lines.map(|points| points.split_whitespace().count()).max().unwrap_or(0)
    };
    let head = "G21 G90 G94 G17 F2000\n";
    assert!(longest(&picture_of(&format!("{head}G61 G1 X30\nY30\nM30\n"))) <= 3);
    assert!(longest(&picture_of(&format!("{head}G64 P0.5 G1 X30\nY30\nM30\n"))) > 5);
    assert!(longest(&picture_of(&format!("{head}G5 I10 J0 P0 Q-10 X30 Y30\nM30\n"))) > 20);
}

#[test]
fn a_feed_override_changes_the_time_and_not_the_path() {
    let directory = tempfile::tempdir().unwrap();
    let rows = |name: &str, overrides: &[&str]| -> Vec<Vec<f64>> {
        let out = directory.path().join(name);
        let mut command = feedwave();
        command.arg("plan").arg(fixture("spec-trap-cured.nc")).arg("--out").arg(&out);
        let output = command.args(overrides.iter().flat_map(|change| ["--override", change])).output().unwrap();
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let text = std::fs::read_to_string(out).unwrap();
        text.lines().skip(1).map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
    };
    let plain = rows("plain.csv", &[]);
    let changed = rows("changed.csv", &["10:50", "20:0", "25:100"]);
    assert!(plain[..=10_000] == changed[..=10_000]);
    // Index and time differ at the end, the place does not.
    assert_eq!(plain.last().unwrap()[2..5], changed.last().unwrap()[2..5]);
    // 10 s at half the feed, which take 5 s of the program, and 5 s of feed hold: 10 s longer.
    assert!(changed.len().abs_diff(plain.len() + 10_000) < 50, "{} and {}", plain.len(), changed.len());
    let feed = |index: usize| changed[index][5];
    assert_eq!((feed(15_000) / feed(9_000), feed(22_000)), (0.5, 0.0));
    let summary = |overrides: &[&str]| -> Value {
        let mut command = feedwave();
        command.arg("validate").arg(fixture("spec-trap-cured.nc")).args(["--format", "json"]);
        let output = command.args(overrides.iter().flat_map(|change| ["--override", change])).output().unwrap();
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["summary"].clone()
    };
    let count = |summary: &Value| number(&summary["setpointCount"]) as usize;
    assert_eq!(count(&summary(&["10:50", "20:0", "25:100"])), changed.len());
    let plain_summary = summary(&[]);
    assert_eq!(count(&plain_summary), plain.len());
    let times = plain_summary["limitTimes"].as_object().unwrap();
    let total: f64 = times.values().map(|time_s| time_s.as_f64().unwrap()).sum();
    assert!((total - plain_summary["durationS"].as_f64().unwrap()).abs() < 1e-9, "{times:?}");
}

#[test]
fn overrides_that_make_no_sense_are_refused_as_they_were_typed() {
    let program = fixture("spec-trap-cured.nc");
    for (overrides, reason) in [
        (&["10"][..], "with a colon between them"),
        (&["10:250"], "the percentage \"250\" must be 0 (feed hold), or a number from 1 to 200"),
        (&["0:1e-9"], "the percentage \"1e-9\" must be 0 (feed hold), or a number from 1 to 200"),
        (&["0:0", "90000:100"], "--override 90000:100: must lie within 86400 s"),
        (&["10:50", "5:100"], "--override 5:100: must not lie before"),
        (&["10:0"], "--override 10:0: must be above 0 in the last change"),
    ] {
        let mut command = feedwave();
        command.arg("plan").arg(&program).args(["--out", "-"]);
        let output = command.args(overrides.iter().flat_map(|change| ["--override", change])).output().unwrap();
        assert_eq!((code(&output), stdout(&output)), (2, String::new()));
        assert!(stderr(&output).contains(reason), "{}", stderr(&output));
    }
}

#[test]
fn the_demo_holds_what_it_claims_and_draws_it() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("demo");
    let output = run(&[&"demo", &"--out", &out]);
    let text = stdout(&output);
    assert_eq!(code(&output), 0, "{text}{}", stderr(&output));
    assert!(text.contains("all 52 checks hold") && !text.contains('✗'), "{text}");
    assert!(text.contains("D = 3.000") && text.contains("G200 F41.667 A0.05"), "{text}");
    for file in [
        "as-programmed/chip-line-32.png",
        "as-programmed/chip-line-32.svg",
        "cured/position.png",
        "milling/motion.png",
        "oscillation/oscillation-line-9-stages.png",
    ] {
        assert!(out.join(file).metadata().unwrap().len() > 1_000, "{file}");
    }
    let csv = std::fs::read_to_string(out.join("turning-demo-cured.csv")).unwrap();
    assert!(csv.lines().count() > 90_000);
}

#[cfg(target_os = "linux")]
#[test]
fn standard_output_and_devices_are_written_by_their_names() {
    let directory = tempfile::tempdir().unwrap();
    let plan = |out: &str| {
        let mut command = feedwave();
        command.arg("plan").arg(fixture("spec-trap-cured.nc")).args([
            "--count",
            "3",
            "--file-format",
            "csv",
            "--out",
            out,
        ]);
        command
    };
    let wanted = stdout(&plan("-").output().unwrap());
    assert_eq!(stdout(&plan("/dev/stdout").output().unwrap()), wanted);
    let path = directory.path().join("a.csv");
    let file = std::fs::File::create(&path).unwrap();
    assert!(plan("/proc/self/fd/1").stdout(file).status().unwrap().success());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), wanted);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    assert_eq!(code(&plan("/dev/null").output().unwrap()), 0);
}

#[test]
fn what_a_command_reads_is_not_written_over() {
    let directory = tempfile::tempdir().unwrap();
    let place = |name: &str| directory.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(place(name), text).unwrap();
    write("main.nc", "G21 G90 G94\nM98 P7\nM30\n");
    write("machine.toml", "[machine]\nkind = \"MACHINE_KIND_MILL\"\n");
    write("tools.toml", "number = 1\nlength_mm = 120\n");
    write("offsets.toml", "external = { z = 1 }\n");
    std::fs::create_dir(place("subs")).unwrap();
    write("subs/O7.nc", "O7\nG1 X1 F100\nM99\n");
    let plan = |out: &str| {
        let options = ["--profile", "machine.toml", "--tools", "tools.toml", "--offsets", "offsets.toml"];
        let mut command = feedwave();
        command.current_dir(&directory).args(["plan", "main.nc", "--include", "subs", "--file-format", "csv"]);
        command.args(options).args(["--out", out]).output().unwrap()
    };
    for (out, what) in [
        ("./main.nc", "the program"),
        ("subs/../machine.toml", "the file of --profile"),
        ("tools.toml", "the file of --tools"),
        ("offsets.toml", "the file of --offsets"),
        ("subs/O7.nc", "a file of --include"),
    ] {
        let before = std::fs::read(place(out)).unwrap();
        let output = plan(out);
        assert_eq!(code(&output), 2, "{out}: {}", stderr(&output));
        assert!(stderr(&output).contains(&format!("--out: is {what} itself")), "{}", stderr(&output));
        assert_eq!(std::fs::read(place(out)).unwrap(), before, "{out}");
    }
    // Written again and again, also beside what is included.
    for _ in 0..2 {
        let output = plan("subs/a.csv");
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
}

#[test]
fn help_teaches_with_examples() {
    for command in ["validate", "plan", "submit", "stream", "demo"] {
        let text = stdout(&run(&[&command, &"--help"]));
        assert!(text.contains("Examples:") && text.contains(&format!("feedwave {command}")), "{text}");
    }
}
