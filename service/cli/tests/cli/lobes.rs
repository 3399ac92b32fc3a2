//! `feedwave lobes` as people call it.

use serde_json::Value;

use super::{code, run, stderr, stdout};

const MILL: [&str; 10] = [
    "lobes",
    "--mode-x=600,0.03,10000",
    "--mode-y=660,0.03,10000",
    "--tangential=700",
    "--radial-ratio=0.3",
    "--edges=4",
    "--entry=90",
    "--lowest-rev-per-min=2000",
    "--highest-rev-per-min=12000",
    "--bands=5",
];

fn lobes(more: &[&str]) -> std::process::Output {
    let own = MILL.iter().filter(|own| more.iter().all(|other| own.split('=').next() != other.split('=').next()));
    let arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
        own.chain(more).map(|argument| argument as &dyn AsRef<std::ffi::OsStr>).collect();
    run(&arguments)
}

#[test]
fn the_table_is_the_result_and_the_picture_is_drawn() {
    let directory = tempfile::tempdir().unwrap();
    let plots = format!("--plots={}", directory.path().join("pictures").display());
    let output = lobes(&[&plots]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    for wanted in ["radial immersion 50.0 %", "a margin of 15.0 %", "8000.0 to 10000.0"] {
        assert!(text.contains(wanted), "{wanted}: {text}");
    }
    for picture in ["lobes.svg", "lobes.png"] {
        assert!(directory.path().join("pictures").join(picture).metadata().unwrap().len() > 5_000);
    }
}

#[test]
fn json_has_the_documented_keys() {
    let output = lobes(&["--format=json", "--exit=120", "--entry=110", "--margin=0.05", "--chart-speeds=11"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let lobes: Value = serde_json::from_slice(&output.stdout).unwrap();
    let keys: Vec<_> = lobes.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["chart", "findings", "leastLimitMm", "pockets", "radialImmersion", "search"]);
    let chart = lobes["chart"].as_array().unwrap();
    assert_eq!(lobes["pockets"].as_array().unwrap().len(), 5);
    // Those asked for, and others where the limit bends.
    let speeds: Vec<_> = chart.iter().map(|point| point["spindleRevPerMin"].as_f64().unwrap()).collect();
    for asked in 0..11 {
        assert!(speeds.contains(&(2_000.0 + 1_000.0 * f64::from(asked))), "{asked}");
    }
    assert!(speeds.len() > 50, "{}", speeds.len());
    assert_eq!(lobes["findings"][0]["code"], "LOBES-LOW-IMMERSION");
    assert_eq!(lobes["findings"][0]["severity"], "SEVERITY_WARNING");
}

#[test]
fn what_cannot_be_is_told_by_its_option() {
    let output = lobes(&["--mode-y=660,0,10000", "--exit=80", "--bands=0"]);
    assert_eq!((code(&output), stdout(&output)), (2, String::new()));
    for wanted in ["--mode-y: damping_ratio must be", "--exit: must be above the entry angle of 90", "--bands: must be"]
    {
        assert!(stderr(&output).contains(wanted), "{wanted}: {}", stderr(&output));
    }
    let output = lobes(&["--required=100"]);
    assert_eq!((code(&output), stdout(&output)), (1, String::new()));
    assert!(stderr(&output).contains("--required: ") && stderr(&output).contains("no table"), "{}", stderr(&output));
}
