//! `feedwave thread-plan` as people call it.

use serde_json::Value;

use super::{code, run, stderr, stdout};

const M10: [&str; 14] = [
    "thread-plan",
    "--work-diameter=10",
    "--pitch=1.5",
    "--depth=0.92",
    "--first-depth=0.35",
    "--start-z=5",
    "--end-z=-20",
    "--approach=5",
    "--spindle=300",
    "--finishing-thickness=0.08",
    "--infeed=flank",
    "--included-angle=60",
    "--vibrations-per-rev=2",
    "--method=start-angle",
];

fn plan(more: &[&str]) -> std::process::Output {
    let arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = M10
        .iter()
        .filter(|own| more.iter().all(|other| own.split('=').next() != other.split('=').next()))
        .chain(more)
        .map(|argument| argument as &dyn AsRef<std::ffi::OsStr>)
        .collect();
    run(&arguments)
}

#[test]
fn the_program_is_the_result_and_the_passes_are_told_beside_it() {
    let output = plan(&[]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let program = stdout(&output);
    let off_and_end = program.contains("\nG165 P0\n") && program.trim_end().ends_with("M30");
    assert!(program.contains("G165 P3 X10.0 Q1.2") && off_and_end, "{program}");
    let passes = program.lines().filter(|line| line.starts_with("G32 ")).count();
    let told = stderr(&output);
    for wanted in [&*format!("Thread in {passes} passes"), "amplitude A, mm", "full section", "crests"] {
        assert!(told.contains(wanted), "{wanted}: {told}");
    }
    assert!(!told.contains("unbroken"), "{told}");
}

#[test]
fn what_the_machine_has_to_have_is_noted() {
    let directory = tempfile::tempdir().unwrap();
    let (out, profile) = (directory.path().join("m10.nc"), directory.path().join("lathe.toml"));
    let out = format!("--out={}", out.display());
    let told = stderr(&plan(&[&out, "--start-up=delayed", "--vibrations-per-rev=3"]));
    let wanted = [
        "thread_vibration.vibrations_per_rev = 3\n",
        "thread_vibration.start_up = \"THREAD_START_UP_DELAYED\"\n",
        "thread_vibration.approach_mm = 5\n",
        "thread_vibration.max_finishing_thickness_mm = 0.08\n",
    ];
    for key in wanted {
        assert!(told.contains(key), "{key} is not in {told}");
    }
    assert_eq!(told.matches("note: --").count(), wanted.len(), "{told}");
    // A machine that has it needs no word.
    let keys = wanted.concat();
    std::fs::write(&profile, format!("machine.kind = \"MACHINE_KIND_LATHE\"\n{keys}")).unwrap();
    let profile = format!("--profile={}", profile.display());
    let output = plan(&[&out, &profile, "--start-up=delayed", "--vibrations-per-rev=3"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(!stderr(&output).contains("note: --"), "{}", stderr(&output));
}

#[test]
fn starts_beyond_their_range_are_refused() {
    for starts in ["--starts=0", "--starts=31"] {
        let output = plan(&[starts]);
        assert_eq!(code(&output), 2, "{starts}");
        assert!(stderr(&output).contains("is not in 1..=30"), "{}", stderr(&output));
    }
}

#[test]
fn files_pictures_and_json_have_the_same_plan() {
    let directory = tempfile::tempdir().unwrap();
    let (file, pictures) = (directory.path().join("m10.nc"), directory.path().join("pictures"));
    let (out, plots) = (format!("--out={}", file.display()), format!("--plots={}", pictures.display()));
    let output = plan(&[&out, &plots, "--format=json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let program = std::fs::read_to_string(&file).unwrap();
    assert_eq!(answer["program"], program.as_str());
    let passes = answer["thread"]["passes"].as_array().unwrap();
    let report = answer["report"]["passes"].as_array().unwrap();
    assert_eq!(passes.len(), report.len());
    for (pass, report) in passes.iter().zip(report).filter(|(pass, _)| pass["amplitudeMm"].as_f64() > Some(0.0)) {
        assert_eq!((&report["depth"]["broken"], &report["section"]["broken"]), (&true.into(), &true.into()), "{pass}");
    }
    assert_eq!(std::fs::read_dir(pictures).unwrap().count(), 6);
}

#[test]
fn a_thread_that_cannot_be_cut_so_is_refused_with_a_cure() {
    // Z comes into step over more than a hundredth of a millimetre.
    let output = plan(&["--approach=0.001"]);
    assert_eq!(code(&output), 1);
    assert_eq!(stdout(&output), "", "no program");
    assert!(stderr(&output).contains("THREAD-APPROACH-SHORT") && stderr(&output).contains("help: "), "{output:?}");
    let output = plan(&["--hand=left", "--rotation=forward", "--format=json"]);
    assert_eq!(code(&output), 1);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["findings"][0]["code"], "THREAD-HAND");
    assert_eq!((answer.get("thread"), answer["program"].as_str()), (None, Some("")));
}

#[test]
fn every_wrong_option_is_named() {
    let output = plan(&["--work-diameter=-1", "--spindle=1e9", "--amplitude-margin=1", "--machine-kind=mill"]);
    assert_eq!(code(&output), 2);
    let told = stderr(&output);
    for option in ["--work-diameter: ", "--spindle: ", "--amplitude-margin: ", "--machine-kind: must be a lathe"] {
        assert!(told.contains(option), "{option}: {told}");
    }
    let output = plan(&["--lead=3"]);
    assert_eq!(code(&output), 2, "pitch and lead at once");
}

const SCROLL: [&str; 10] = [
    "thread-plan",
    "--face-z=0",
    "--start-radius=40",
    "--end-radius=10",
    "--pitch=4",
    "--depth=1",
    "--first-depth=0.4",
    "--finishing-allowance=0.05",
    "--finishing-thickness=0.2",
    "--spindle=200",
];

#[test]
fn a_scroll_is_planned_along_x_and_its_program_is_accepted() {
    let directory = tempfile::tempdir().unwrap();
    let (file, pictures) = (directory.path().join("scroll.nc"), directory.path().join("pictures"));
    let more =
        [format!("--out={}", file.display()), format!("--plots={}", pictures.display()), "--format=json".to_owned()];
    let scroll = |more: &[String]| {
        let arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            SCROLL.iter().map(|argument| argument as _).chain(more.iter().map(|argument| argument as _)).collect();
        run(&arguments)
    };
    let output = scroll(&more);
    assert_eq!(code(&output), 0, "{}{}", stderr(&output), stdout(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let geometry = &answer["thread"]["geometry"];
    assert_eq!(
        (geometry["leadAxis"].as_str(), geometry["startRadiusMm"].as_f64()),
        (Some("THREAD_LEAD_AXIS_X"), Some(40.0))
    );
    let program = std::fs::read_to_string(&file).unwrap();
    assert!(program.contains("G165 P3 Z0.0 Q1.2") && program.contains("G32 X20.0 F4.0"), "{program}");
    assert_eq!(std::fs::read_dir(pictures).unwrap().count(), 6);
    let (report, accepted) = super::validate_json(&file);
    assert_eq!(accepted, 0, "{:#?}", report["findings"]);
    let thread = &report["threads"][0];
    assert_eq!(thread["thread"]["geometry"]["leadAxis"], "THREAD_LEAD_AXIS_X");
    let passes = thread["report"]["passes"].as_array().unwrap();
    let planned = answer["report"]["passes"].as_array().unwrap();
    assert_eq!(passes.len(), planned.len());
    for (pass, planned) in passes.iter().zip(planned) {
        assert_eq!(
            (&pass["depth"]["broken"], &pass["section"]["broken"]),
            (&planned["depth"]["broken"], &planned["section"]["broken"])
        );
    }
    // What belongs to threads along Z is no word of a face.
    for other in ["--start-z=5", "--side=internal", "--hand=left", "--work-diameter=10"] {
        assert_eq!(code(&scroll(&[other.to_owned()])), 2, "{other}");
    }
    let incomplete =
        run(&[&"thread-plan", &"--face-z=0", &"--pitch=4", &"--depth=1", &"--first-depth=0.4", &"--spindle=200"]);
    assert_eq!(code(&incomplete), 2);
}

#[test]
fn the_pictures_of_a_thread_on_a_face_name_its_axes() {
    let directory = tempfile::tempdir().unwrap();
    let (out, plots) = (directory.path().join("face.csv"), directory.path().join("pictures"));
    let output = run(&[&"plan", &super::fixture("thread-face.nc"), &"--out", &out, &"--plots", &plots]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let told = stdout(&run(&[&"validate", &super::fixture("thread-face.nc")]));
    assert!(told.contains("pass 3 leaves 0.385 mm along Z"), "{told}");
    let picture = |name: &str| std::fs::read_to_string(plots.join(name)).unwrap();
    for (name, wanted) in [
        ("thread-line-11-section.svg", ["along X from the tip of the first pass", "on a face at Z 0 mm"]),
        ("thread-line-11-position.svg", ["Z over the spindle angle", "Z, mm"]),
        ("thread-line-11-unrolled.svg", ["X (radius), mm", "of the circumference, at its largest"]),
        ("tool-path.svg", ["threading with vibration", "spindle axis"]),
    ] {
        let text = picture(name);
        for wanted in wanted {
            assert!(text.contains(wanted), "{name}: {wanted}");
        }
        assert!(!text.contains("vibration of X") && !text.contains("along Z from"), "{name}");
    }
}
