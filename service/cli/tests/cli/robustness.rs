//! `feedwave robustness`: worst cases and shares, maps, and lobes of a file.

use std::fs;

use super::{code, fixture, run, stderr, stdout};

#[test]
fn the_trap_is_sure_to_fail_and_its_cure_to_hold() {
    let trap = run(&[&"robustness", &fixture("spec-trap.nc")]);
    assert_eq!(code(&trap), 1, "{}", stderr(&trap));
    let text = stdout(&trap);
    for said in ["does not break for all values", "0 at worst", "D = 3"] {
        assert!(text.contains(said), "{said} is not in\n{text}");
    }
    let cured = run(&[&"robustness", &fixture("spec-trap-cured.nc")]);
    assert_eq!(code(&cured), 0, "{}", stderr(&cured));
    // 6·cos(π·(2.5/0.98 − 2.5))·0.9/1.05 with F41.667 for 41.6667.
    assert!(
        stdout(&cured).contains("margin 6 as programmed, 5.077 at worst; it breaks for 100 % of the values"),
        "{}",
        stdout(&cured)
    );
    let loose: [&dyn AsRef<std::ffi::OsStr>; 4] =
        [&"robustness", &fixture("spec-trap-cured.nc"), &"--speed-tolerance", &"20"];
    assert_eq!(code(&run(&loose)), 1, "D = 3 is within 20 %");
}

#[test]
fn a_corner_that_leaves_revolutions_whole_is_said_however_short() {
    let directory = tempfile::tempdir().unwrap();
    let program = directory.path().join("corner.nc");
    let text = "G21 G90 G95\nG97 S1800 M3\nG0 X20 Z1\nG200 F75 A0.015\nG1 Z-1 F0.016\nG1 X24\nG201\nG0 X60\nM5\nM30\n";
    fs::write(&program, text).unwrap();
    let judged = run(&[&"robustness", &program]);
    assert_eq!(code(&judged), 0, "{}", stderr(&judged));
    let text = stdout(&judged);
    for said in ["breaks for all values", "but at corners", "whole for up to 2.18 revolutions, from line 5 on"] {
        assert!(text.contains(said), "{said} is not in\n{text}");
    }
}

#[test]
fn what_the_drives_let_through_is_what_breaks() {
    let directory = tempfile::tempdir().unwrap();
    let profile = directory.path().join("slow.toml");
    fs::write(&profile, "machine = { kind = \"MACHINE_KIND_LATHE\" }\nfollowing = { position_loop_gain_per_s = 30 }\n")
        .unwrap();
    let cured = run(&[&"robustness", &fixture("spec-trap-cured.nc"), &"--profile", &profile]);
    // 1/√(1 + (2π·41.667/30)²) = 0.1138 arrives, so that 6 becomes 0.683.
    assert_eq!(code(&cured), 1, "{}", stderr(&cured));
    let text = stdout(&cured);
    for said in ["0.003415 mm of 0.03 mm, which the drives let through", "margin 0.6831 as programmed"] {
        assert!(text.contains(said), "{said} is not in\n{text}");
    }
}

#[test]
fn maps_have_the_safe_region_as_values_and_picture() {
    let directory = tempfile::tempdir().unwrap();
    let maps = directory.path().join("maps");
    let output = run(&[&"robustness", &fixture("spec-trap-cured.nc"), &"--out", &maps]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let mut names: Vec<_> =
        fs::read_dir(&maps).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let stem = names[0].strip_suffix(".csv").unwrap().to_owned();
    assert_eq!(names, ["csv", "png", "svg"].map(|ending| format!("{stem}.{ending}")));
    let csv = fs::read_to_string(maps.join(&names[0])).unwrap();
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("spindle_rev_per_min,feed_mm_per_rev,margin,worst_margin,stability_margin,safe"));
    // Without lobes nothing is said of stability.
    let values =
        |line: &str| line.split(',').filter(|value| !value.is_empty()).map(|value| value.parse().unwrap()).collect();
    let rows: Vec<Vec<f64>> = lines.map(values).collect();
    assert_eq!(rows.len(), 401 * 100);
    for row in &rows {
        let [speed, feed, margin, worst, safe] = row[..] else { panic!("{row:?}") };
        // The margin is that of the page: 2A·|sin πD|/f_r with A = 0.03 and 41.667 Hz.
        let expected = 0.06 * (std::f64::consts::PI * 60.0 * 41.667 / speed).sin().abs() / feed;
        assert!((margin - expected).abs() < 1e-9 * (1.0 + expected), "{row:?} {expected}");
        assert!(worst <= margin + 1e-12 && safe == f64::from(u8::from(worst >= 1.0)), "{row:?}");
    }
    assert!(rows.iter().any(|row| row[4] == 0.0) && rows.iter().any(|row| row[4] == 1.0));
    let svg = fs::read_to_string(maps.join(&names[2])).unwrap();
    assert!(svg.contains("breaks for all values within the tolerances") && svg.contains("spindle speed, rev/min"));
}

#[test]
fn lobes_of_a_file_judge_the_depth() {
    let directory = tempfile::tempdir().unwrap();
    let lobes = directory.path().join("lobes.json");
    let computed = run(&[
        &"lobes",
        &"--turning",
        &"--mode-normal",
        &"250,0.04,8000",
        &"--specific",
        &"2000",
        &"--lowest-rev-per-min",
        &"500",
        &"--highest-rev-per-min",
        &"4000",
        &"--format",
        &"json",
    ]);
    assert_eq!(code(&computed), 0, "{}", stderr(&computed));
    fs::write(&lobes, stdout(&computed)).unwrap();
    let program = fixture("spec-trap-cured.nc");
    let judge = |depth: &str| run(&[&"robustness", &program, &"--lobes", &lobes, &"--depth", &depth]);
    let shallow = judge("0.01");
    assert_eq!(code(&shallow), 0, "{}{}", stdout(&shallow), stderr(&shallow));
    assert!(stdout(&shallow).contains("stable for 100 % of the values"), "{}", stdout(&shallow));
    let deep = judge("50");
    assert_eq!(code(&deep), 1);
    assert!(stdout(&deep).contains("stable for 0 % of the values"), "{}", stdout(&deep));
    // In the map, nothing is safe that is not stable.
    for (depth, is_stable) in [("0.01", true), ("50", false)] {
        let maps = directory.path().join(depth);
        run(&[&"robustness", &program, &"--lobes", &lobes, &"--depth", &depth, &"--out", &maps]);
        let csv = fs::read_dir(&maps)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .find(|path| path.extension().unwrap() == "csv");
        let text = fs::read_to_string(csv.unwrap()).unwrap();
        let mut safe = 0;
        for line in text.lines().skip(1) {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            assert_eq!(values[4] >= 1.0, is_stable, "{line}");
            assert_eq!(values[5] == 1.0, is_stable && values[3] >= 1.0, "{line}");
            safe += u32::from(values[5] == 1.0);
        }
        assert_eq!(safe > 0, is_stable);
    }
    // Speeds that the lobes do not have are not judged, and so do not hold.
    fs::write(
        &lobes,
        "{\"chart\": [{\"spindleRevPerMin\": 2000, \"limitMm\": 1}, {\"spindleRevPerMin\": 2500, \"limitMm\": 1}]}",
    )
    .unwrap();
    let beyond = judge("0.01");
    assert_eq!(code(&beyond), 1);
    assert!(stdout(&beyond).contains("the lobes do not have all speeds"), "{}", stdout(&beyond));
    for (text, reason) in [("{}", "has no chart"), ("[", "lobes.json: ")] {
        fs::write(&lobes, text).unwrap();
        let output = judge("1");
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains(reason), "{}", stderr(&output));
    }
}

#[test]
fn what_cannot_be_judged_is_said() {
    let facing = run(&[&"robustness", &fixture("facing-g96.nc")]);
    assert_eq!(code(&facing), 1);
    assert!(stdout(&facing).contains("constant surface speed are not judged"), "{}", stdout(&facing));
    let output = run(&[&"robustness", &fixture("bad.nc")]);
    assert_eq!(code(&output), 1);
    for option in ["--speed-tolerance=60", "--feed-tolerance=x", "--depth=1", "--depth=-1"] {
        assert_eq!(code(&run(&[&"robustness", &fixture("spec-trap.nc"), &option])), 2, "{option}");
    }
}

#[test]
fn a_short_section_is_judged_by_what_its_blends_let_through() {
    let directory = tempfile::tempdir().unwrap();
    let of = |name: &str, blocks: &str| {
        let path = directory.path().join(name);
        fs::write(&path, format!("G97 G99\nM3 S970\nG0 X20 Z0\nG200 F40.417 A0.05\n{blocks}G201\nM30\n")).unwrap();
        run(&[&"robustness", &path])
    };
    // The margin of the whole amplitude is 2.
    let short = of("short.nc", "G1 Z-0.1 F0.05\n");
    assert_eq!(code(&short), 1, "{}", stdout(&short));
    for said in ["of 0.05 mm, which its blends let through", "it breaks for 0 % of the values"] {
        assert!(stdout(&short).contains(said), "{}", stdout(&short));
    }
    let long = of("long.nc", "G1 Z-2 F0.05\n");
    assert!(code(&long) == 0 && stdout(&long).contains("margin 2 as programmed"), "{}", stdout(&long));
    let corners = of("corners.nc", "G1 Z-0.5 F0.05\nX21\nZ-1\n");
    assert!(code(&corners) == 1 && stdout(&corners).contains("corners"), "{}", stdout(&corners));
}
