//! `feedwave improve`: what it changes is enough, what it does not change it says, and nothing else of a program moves.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use super::{code, feedwave, fixture, run, stderr, stdout, validate_json};

/// Random sections that are tried; 200 of them were, once.
const SECTIONS_NEAR_CURVES: u32 = 40;

/// A program in a directory of its own.
fn program(text: &str) -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("part.nc");
    fs::write(&path, text).unwrap();
    (directory, path)
}

fn improve(path: &Path, options: &[&str]) -> Output {
    feedwave().arg("improve").args(options).arg(path).output().unwrap()
}

/// Least margin of a program at the largest override.
fn margin(path: &Path) -> f64 {
    let (report, _) = validate_json(path);
    let sections = report["sections"].as_array().unwrap().iter();
    sections
        .map(|section| section["atMaxFeedOverride"]["breakingMargin"].as_f64().unwrap())
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn the_trap_is_left_and_only_its_words_change() {
    let (directory, path) = program(&fs::read_to_string(fixture("spec-trap.nc")).unwrap());
    let better = directory.path().join("better.nc");
    let output = run(&[&"improve", &path, &"--out", &better]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let diff = stdout(&output);
    let changed: Vec<&str> = diff.lines().filter(|line| line.starts_with(['+', '-'])).collect();
    assert_eq!(changed.len(), 4, "{diff}");
    assert_eq!(changed[2], "-G200 F50 A0.03");
    // The amplitude is more than enough and stays.
    assert_eq!(changed[3], "+G200 F41.65 A0.03", "{diff}");
    let before = fs::read_to_string(&path).unwrap();
    assert_eq!(fs::read_to_string(&better).unwrap(), before.replace("F50 A0.03", "F41.65 A0.03"));
    let told = stderr(&output);
    // At the corner between the line and the arc the vibration is blended out and in.
    for said in ["1 word changed", "line 6: F50 becomes F41.65", "does not break", "margin 0 to ", "before", "99.87 %"]
    {
        assert!(told.contains(said), "{said} is not in\n{told}");
    }
    // The vibration leaves something for the feed, and there is one kind of margin.
    assert!(told.contains("leaves the feed a tenth of every axis' acceleration and jerk"), "{told}");
    assert!(!told.contains("least margin at the largest override"), "{told}");
    assert!(margin(&path) < 1e-9 && margin(&better) > 1.1, "{}", margin(&better));
    // What is improved has nothing left to change.
    let again = run(&[&"improve", &better]);
    assert_eq!((code(&again), stdout(&again)), (0, String::new()));
    assert!(stderr(&again).contains("nothing is changed"), "{}", stderr(&again));
}

#[test]
fn the_least_amplitude_is_asked_for_and_the_diff_can_be_applied() {
    let (directory, path) = program(&fs::read_to_string(fixture("spec-trap.nc")).unwrap());
    let output =
        improve(&path, &["--least-amplitude", "--speed-tolerance", "0", "--margin", "1", "--feed-override", "100"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    // Half the feed of a revolution, at half a vibration: F41.667 or F58.333, rounded to words.
    let diff = stdout(&output);
    assert!(diff.contains(" A0.0051"), "{diff}");
    let patch = directory.path().join("a.patch");
    fs::write(&patch, &diff).unwrap();
    let patched = directory.path().join("patched.nc");
    let applied = std::process::Command::new("patch").arg("-o").arg(&patched).arg(&path).arg(&patch).output();
    let Ok(applied) = applied else { return };
    assert!(applied.status.success(), "{}", String::from_utf8_lossy(&applied.stderr));
    assert!(fs::read_to_string(&patched).unwrap().contains(" A0.0051"));
}

/// A lathe program with a vibration of these words over a cut at this speed and feed.
fn turning(words: &str, rev_per_min: u32, feed: &str) -> String {
    format!(
        "%\r\nO1 (\u{fc})\r\nG21 G97 G99 S{rev_per_min} M3\r\nG0 X40. Z2.\r\nN30  G200 {words} (KEEP , THIS)\r\nG1 Z-30. {feed}\r\nG201\r\n\
         G0 X60.\r\nM30\r\n%\r\n"
    )
}

#[test]
fn layout_comments_and_line_ends_stay() {
    let (directory, path) = program(&turning("A.02F40.", 600, "F0.1"));
    let better = directory.path().join("better.nc");
    let output = run(&[&"improve", &path, &"--out", &better]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let (before, after) = (fs::read_to_string(&path).unwrap(), fs::read_to_string(&better).unwrap());
    let lines = before.split("\r\n").zip(after.split("\r\n")).filter(|(one, other)| one != other);
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), 1, "{after}");
    let (new_start, new_end) = (lines[0].1.starts_with("N30  G200 A0."), lines[0].1.ends_with(" (KEEP , THIS)"));
    assert!(new_start && new_end, "{}", lines[0].1);
    assert!(margin(&better) >= 1.1, "{}", margin(&better));
}

#[test]
fn a_program_in_inches_gets_an_amplitude_in_inches() {
    let text = turning("F50. A0.0008", 1_000, "F.004")
        .replace("G21", "G20")
        .replace("X40. Z2.", "X1.5 Z.1")
        .replace("Z-30.", "Z-1.");
    let (directory, path) = program(&text.replace("X60.", "X2."));
    let better = directory.path().join("better.nc");
    let output = run(&[&"improve", &path, &"--out", &better]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let after = fs::read_to_string(&better).unwrap();
    let amplitude = after.split(" A").nth(1).unwrap().split(' ').next().unwrap();
    let inches: f64 = amplitude.parse().unwrap();
    // Half of 0.004 in, with margin, override and tolerance.
    assert!((0.002..0.004).contains(&inches), "{after}");
    assert!(margin(&better) >= 1.1);
}

#[test]
fn what_cannot_be_improved_says_why_and_stays() {
    for (text, options, reason) in [
        // A thick chip, and axes that are asked for too much.
        (turning("F50 A0.03", 1_000, "F3.0"), &[][..], "no vibration within the range"),
        (turning("F50 A0.03", 1_000, "F0.1"), &["--frequency", "50:50"][..], "no vibration within the range"),
        (turning("F50 A0.03", 1_000, "F0.1"), &["--frequency", "900:950"][..], "no frequency of the range"),
        (
            turning("F50 A0.03", 1_000, "F0.1")
                .replace("G97 G99 S1000", "G96 G99 S100")
                .replace("G1 Z-30.", "G1 X60. Z-30."),
            &[][..],
            "at constant surface speed its spindle turns at",
        ),
        (
            turning("F#1 A0.03", 1_000, "F0.1").replace("%\r\nO1", "%\r\nO1\r\n#1=50.\r\n(").replace("(\u{fc})", ")"),
            &[][..],
            "not both written as numbers",
        ),
        (turning("F50 A0.03", 1_000, "F0.1").replace(" M3", ""), &[][..], "nothing is cut with a turning spindle"),
    ] {
        let (_directory, path) = program(&text);
        let output = improve(&path, options);
        assert_eq!((code(&output), stdout(&output)), (1, String::new()), "{reason}: {}", stderr(&output));
        let told = stderr(&output);
        let refused =
            told.contains("nothing is improved in a program with errors") && reason.contains("turning spindle");
        assert!(told.contains(reason) || refused, "{reason} is not in\n{told}");
    }
}

/// Whether validation on this machine says that too little arrives at the tool to break the chip.
fn loses_the_chip(path: &Path, options: &[&str]) -> bool {
    let output = feedwave().arg("validate").args(options).args(["--format", "json"]).arg(path).output().unwrap();
    let report: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let findings = report["findings"].as_array().unwrap();
    findings.iter().any(|finding| finding["message"].as_str().unwrap().contains("too little to break the chip"))
}

#[test]
fn what_the_drives_lose_is_commanded_besides() {
    let profile = fixture("following-lathe.toml");
    let profile = ["--profile", profile.to_str().unwrap()];
    let (directory, path) = program(&turning("F50 A0.03", 1_000, "F0.1"));
    let better = directory.path().join("better.nc");
    let options = [&profile[..], &["--out", better.to_str().unwrap()]].concat();
    let output = improve(&path, &options);
    // Either enough arrives, or the program stays and the reason is told.
    let lost = loses_the_chip(&better, &profile);
    match code(&output) {
        0 => assert!(!lost, "{}", stdout(&output)),
        1 => assert!(
            stdout(&output).is_empty() && stderr(&output).contains("does not hold and stays"),
            "{}",
            stderr(&output)
        ),
        other => panic!("{other}: {}", stderr(&output)),
    }
    // A chip that breaks with what arrives is not made worse for a smaller amplitude.
    let tight = directory.path().join("tight.toml");
    fs::write(&tight, "[machine]\nkind = \"MACHINE_KIND_LATHE\"\n[following]\nposition_loop_gain_per_s = 150.0\n")
        .unwrap();
    let tight = ["--profile", tight.to_str().unwrap()];
    let (_directory, good) = program(&turning("F41.65 A0.13", 1_000, "F0.1"));
    assert!(!loses_the_chip(&good, &tight));
    let out = directory.path().join("less.nc");
    let output =
        improve(&good, &[&tight[..], &["--least-amplitude", "--margin", "1", "--out", out.to_str().unwrap()]].concat());
    assert!(code(&output) < 2, "{}", stderr(&output));
    assert!(!loses_the_chip(&out, &tight), "{}{}", stdout(&output), stderr(&output));
}

/// Random sections with arcs, on a machine whose axes are nearly at their limits on them.
#[test]
fn what_is_found_near_curves_holds_there() {
    let directory = tempfile::tempdir().unwrap();
    let profile = directory.path().join("lathe.toml");
    let path = directory.path().join("part.nc");
    let mut state = 20_261_124_u64;
    let mut random = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut improved, mut limited) = (0, 0);
    for case in 0..SECTIONS_NEAR_CURVES {
        let acceleration = random(500.0, 5_000.0);
        let limits = format!(
            "max_velocity_per_s = 250.0\nmax_acceleration_per_s2 = {acceleration:.1}\nmax_jerk_per_s3 = {:.1}",
            400.0 * acceleration
        );
        let axes = ["X", "Z"]
            .map(|name| format!("[[machine.axes]]\nname = \"{name}\"\naxis = \"AXIS_LETTER_{name}\"\n{limits}\nmax_velocity_step_per_s = 2.0\n"))
            .concat();
        fs::write(&profile, format!("[machine]\nkind = \"MACHINE_KIND_LATHE\"\n{axes}")).unwrap();
        let (speed, feed, radius) = (random(300.0, 1_500.0).round(), random(0.02, 0.12), random(8.0, 30.0));
        let frequency = random(1.2, 3.8) * speed / 60.0;
        let text = format!(
            "G21 G97 G99 S{speed} M3\nG0 X40. Z2.\nG200 F{frequency:.3} A{:.4}\nG1 Z-20. F{feed:.4}\nG2 X{:.4} Z{:.4} R{radius:.4}\n\
             G201\nG0 X120.\nM30\n",
            random(0.2, 0.5) * feed,
            40.0 + 2.0 * radius,
            -20.0 - radius,
        );
        fs::write(&path, &text).unwrap();
        let output = improve(&path, &["--profile", profile.to_str().unwrap()]);
        let told = stderr(&output);
        assert!(code(&output) < 2, "case {case}: {told}");
        // Nothing is proposed that the axes then cannot follow on the arc.
        assert!(
            !told.contains("would be refused") && !told.contains("worse in another way"),
            "case {case}: {text}{told}"
        );
        improved += u32::from(!stdout(&output).is_empty());
        limited += u32::from(told.contains("no vibration within the range"));
    }
    assert!(improved >= SECTIONS_NEAR_CURVES / 4 && limited > 0, "{improved} improved, {limited} not");
}

#[test]
fn a_change_that_is_worse_in_another_way_is_not_made() {
    let (_directory, path) = program(&turning("F50 A0.03", 1_000, "F0.15"));
    let output = improve(&path, &["--envelope", "published"]);
    assert_eq!((code(&output), stdout(&output)), (1, String::new()), "{}", stderr(&output));
    assert!(stderr(&output).contains("worse in another way: VIB-PUBLISHED-ENDS"), "{}", stderr(&output));
}

#[test]
fn one_frequency_is_judged_as_well() {
    let (_directory, path) = program(&turning("F50 A0.03", 1_000, "F0.1"));
    let output = improve(&path, &["--frequency", "41.65:41.65"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("+N30  G200 F41.65 A0.0"), "{}", stdout(&output));
}

#[test]
fn diffs_apply_in_every_encoding_and_with_every_line_end() {
    let text = turning("F50 A0.03", 1_000, "F0.1");
    let latin: Vec<u8> = text.chars().map(|character| character as u8).collect();
    let mac: Vec<u8> = latin.iter().copied().filter(|&byte| byte != b'\n').collect();
    for bytes in [latin, mac, text.into_bytes()] {
        let directory = tempfile::tempdir().unwrap();
        let (path, better) = (directory.path().join("part.nc"), directory.path().join("better.nc"));
        fs::write(&path, &bytes).unwrap();
        let output = run(&[&"improve", &path, &"--out", &better]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let (patch, patched) = (directory.path().join("a.patch"), directory.path().join("patched.nc"));
        fs::write(&patch, &output.stdout).unwrap();
        let mut command = std::process::Command::new("patch");
        let Ok(applied) = command.arg("--binary").arg("-o").arg(&patched).arg(&path).arg(&patch).output() else {
            return;
        };
        assert!(applied.status.success(), "{}", String::from_utf8_lossy(&applied.stdout));
        assert!(fs::read(&patched).unwrap() == fs::read(&better).unwrap());
    }
}

#[test]
fn sections_beyond_those_of_a_report_are_said_not_to_be_judged() {
    let cut = "G200 F50 A0.03\nG1 W-1. F0.1\nG201\n";
    let text = format!("G21 G97 G99 S1000 M3\nG0 X40. Z2.\n{}M30\n", cut.repeat(1_100));
    let (_directory, path) = program(&text);
    let output = improve(&path, &[]);
    assert_eq!(code(&output), 1);
    assert!(stderr(&output).contains("100 sections not judged"), "{}", stderr(&output));
}

#[cfg(unix)]
#[test]
fn another_name_of_the_program_is_the_program() {
    let (directory, path) = program(&turning("F50 A0.03", 1_000, "F0.1"));
    let other = directory.path().join("other.nc");
    fs::hard_link(&path, &other).unwrap();
    let output = run(&[&"improve", &path, &"--out", &other]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[test]
fn programs_with_errors_and_wrong_options_are_refused() {
    let output = run(&[&"improve", &fixture("bad.nc")]);
    assert_eq!((code(&output), stdout(&output)), (1, String::new()));
    assert!(stderr(&output).contains("nothing is improved"), "{}", stderr(&output));
    let (_directory, path) = program(&turning("F50 A0.03", 1_000, "F0.1"));
    let same = path.clone();
    let output = run(&[&"improve", &path, &"--out", &same]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("is the program itself"), "{}", stderr(&output));
    for option in [
        "--margin=0.5",
        "--margin=nan",
        "--speed-tolerance=50",
        "--frequency=80:30",
        "--frequency=80",
        "--feed-override=90",
    ] {
        assert_eq!(code(&run(&[&"improve", &path, &option])), 2, "{option}");
    }
}

#[test]
fn slow_places_are_suggestions_with_their_figures() {
    let output = run(&[&"improve", &"--machine-kind", &"mill", &fixture("contour-mill.nc")]);
    assert_eq!((code(&output), stdout(&output)), (0, String::new()), "{}", stderr(&output));
    let told = stderr(&output);
    assert!(told.contains("would save time") && told.contains(" s lost at "), "{told}");
}

#[test]
fn speeds_keep_to_the_lobes_of_a_file() {
    let (directory, path) = program(&turning("F41.65 A0.08", 1_000, "F0.1"));
    let lobes = directory.path().join("lobes.json");
    let points = [(500, 1.0), (1_100, 1.0), (1_150, 3.0), (1_500, 3.0)]
        .map(|(speed, limit)| format!("{{\"spindleRevPerMin\": {speed}, \"limitMm\": {limit}}}"))
        .join(", ");
    fs::write(&lobes, format!("{{\"chart\": [{points}]}}")).unwrap();
    let plain = improve(&path, &[]);
    assert!(stderr(&plain).contains("stability is not judged: no lobes are given"), "{}", stderr(&plain));
    let given = ["--lobes", lobes.to_str().unwrap(), "--depth", "1.5"];
    let kept = improve(&path, &given);
    assert_eq!((code(&kept), stdout(&kept)), (1, String::new()), "{}", stderr(&kept));
    for said in
        ["speeds stay, as none are permitted", "not stable: 1 mm at worst, 0.606 of the largest depth of 1.65 mm"]
    {
        assert!(stderr(&kept).contains(said), "{said} is not in\n{}", stderr(&kept));
    }
    // 1.65 mm from 1116.25 rev/min on, which may turn 2 % slower.
    let sped = improve(&path, &[&given[..], &["--spindle-speed", "800:1500"]].concat());
    assert_eq!(code(&sped), 0, "{}", stderr(&sped));
    assert!(stdout(&sped).contains("+G21 G97 G99 S1140 M3"), "{}", stdout(&sped));
    assert!(
        stderr(&sped).contains("stability margin 0.606") || stderr(&sped).contains("stability margin 0.6061 to 1.")
    );
    for options in [&["--lobes", "lobes.json"][..], &["--depth", "1.5"], &["--lobes", "nowhere.json", "--depth", "1"]] {
        assert_eq!(code(&improve(&path, options)), 2, "{options:?}");
    }
}
