//! `feedwave run`: a simulated machine in the loop with a real service.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use feedwave_contract::proto::{Escalation, OverrideBounds};

use super::service::Service;
use super::{code, feedwave, stderr, stdout};

/// One slot along X at 20 mm/s and 3000 rev/min; line 3 cuts.
const SLOT: &str = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X100 F1200\nG0 X110\nM30\n";

fn slot(service: &Service) -> String {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("slot.nc");
    std::fs::write(&file, SLOT).unwrap();
    let submitted = service.run(&["submit", file.to_str().unwrap(), "--wait", "--machine", "mill"]);
    assert_eq!(code(&submitted), 0, "{}", stderr(&submitted));
    stdout(&submitted).lines().last().unwrap().to_owned()
}

/// The rows of the table of overrides: from, s, the override, %, and the deviation of its last window, mm.
fn overrides(text: &str) -> Vec<[f64; 3]> {
    let rows = text.lines().skip_while(|line| !line.contains("last deviation")).skip(1);
    let rows = rows.take_while(|line| !line.is_empty());
    rows.map(|line| {
        let values: Vec<f64> = line.split_whitespace().map(|value| value.parse().unwrap_or(f64::NAN)).collect();
        values.try_into().unwrap()
    })
    .collect()
}

#[test]
fn too_high_a_feed_comes_down_until_the_deflection_is_inside_the_limits() {
    let service = Service::start();
    let job = slot(&service);
    let pictures = tempfile::tempdir().unwrap();
    let plots = pictures.path().join("plots");
    let plots_option = plots.to_str().unwrap();
    let output = service.run(&["run", &job, "--simulate", "--cut", "3:0.75", "--seed", "7", "--plots", plots_option]);
    assert_eq!(code(&output), 0, "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("had no monitoring; set: deflection between 0.003 and 0.01 mm"));
    let text = stdout(&output);
    let overrides = overrides(&text);
    assert!(overrides.len() >= 3, "{text}");
    for (step, [from_s, percent, deviation]) in overrides.iter().enumerate() {
        assert!((percent - 100.0 * 0.95f64.powi(step as i32)).abs() < 0.06, "{text}");
        let is_last = step + 1 == overrides.len();
        assert_eq!((0.003..=0.01).contains(deviation), is_last, "{text}");
        assert!(step == 0 || *from_s > overrides[step - 1][0], "{text}");
    }
    assert!(text.contains("change, feed above limit") && text.contains("keep, within limits"), "{text}");
    // Once inside the limits, nothing changes any more.
    let (_, inside) = text.split_once("within limits").unwrap();
    assert!(!inside.contains("above limit"), "{text}");

    let picture = std::fs::read_to_string(plots.join("run.svg")).unwrap();
    assert!(picture.contains("upper limit 0.01 mm") && picture.contains("lower limit 0.003 mm"));
    assert!(picture.contains("judged: largest mean deflection") && picture.contains("feed override, %"));
    assert!(plots.join("run.png").is_file());

    let name = text.lines().next().unwrap();
    let replayed = service.run(&["replay", name]);
    assert_eq!(code(&replayed), 0, "{}", stdout(&replayed));
    let digest = text.trim_end().rsplit_once("SHA-256 ").unwrap().1;
    assert!(text.contains(": finished: ") && stdout(&replayed).contains(digest), "{text}");
    // What was shown is what is in the log.
    let listed = stdout(&service.run(&["decisions", name]));
    let shown: Vec<_> = text.lines().skip(1).take(listed.lines().count()).collect();
    assert_eq!(shown, listed.lines().collect::<Vec<_>>());
}

#[test]
fn a_run_without_a_cut_is_a_dry_run_and_says_so() {
    let service = Service::start();
    let job = slot(&service);
    let output = service.run(&["run", &job, "--simulate"]);
    assert_eq!(code(&output), 0, "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("a dry run") && stderr(&output).contains("--cut 3-7:0.5"), "{}", stderr(&output));
    let overrides = overrides(&stdout(&output));
    assert_eq!((overrides.len(), overrides[0][1]), (1, 100.0), "{overrides:?}");
}

#[test]
fn a_run_whose_feed_is_held_waits_until_somebody_acknowledges() {
    let service = Service::start();
    let job = slot(&service);
    let run = ["run", job.as_str(), "--simulate", "--seed", "7", "--cut"];
    assert_eq!(code(&service.run(&[&run[..], &["3:0.5"]].concat())), 0);
    service.judge(&job, |config| {
        let rules = config.rules.as_mut().unwrap();
        rules.feed.as_mut().unwrap().step = Some(0.5);
        rules.feed_bounds = Some(OverrideBounds { lower: 0.5, upper: 1.5 });
        rules.escalation = Some(Escalation { windows: Some(3), ..Default::default() });
    });
    let server = format!("http://{}", service.address());
    let mut child = feedwave()
        .args(run)
        .args(["3:5", "--server", &server])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It says what it waits for, each time: the deflection stays too large.
    let mut acknowledged = 0;
    let mut name = String::new();
    for line in BufReader::new(child.stderr.take().unwrap()).lines() {
        let line = line.unwrap();
        let Some((run, _)) = line.split_once(": the feed is held; acknowledge it: feedwave acknowledge runs/") else {
            continue;
        };
        name = run.to_owned();
        let shown = service.run(&["acknowledge", run, "--by", "Ada", "--note", "seen"]);
        assert_eq!(code(&shown), 0, "{}", stderr(&shown));
        let text = stdout(&shown);
        assert!(text.starts_with(&format!("{run}: condition of decision ")) && text.contains("by Ada"), "{text}");
        acknowledged += 1;
    }
    let output = child.wait_with_output().unwrap();
    let text = stdout(&output);
    assert_eq!(code(&output), 0, "{text}");
    assert!(text.contains(": finished: ") && acknowledged >= 2, "{acknowledged}: {text}");
    assert_eq!(text.matches("hold feed, above limit at bound").count(), acknowledged, "{text}");
    // Again is harmless, and changes nothing.
    let again = service.run(&["acknowledge", name.strip_prefix("runs/").unwrap(), "--by", "Bob"]);
    assert!(code(&again) == 0 && stdout(&again).contains("by Ada"), "{}", stdout(&again));
    let nothing = service.run(&["acknowledge", &name, "--by", "Ada", "--decision", "0"]);
    assert_eq!(code(&nothing), 2, "{}", stdout(&nothing));
    let replayed = service.run(&["replay", &name]);
    assert_eq!(code(&replayed), 0, "{}", stdout(&replayed));
}

#[test]
fn a_run_that_makes_no_sense_is_refused_before_it_begins() {
    let service = Service::start();
    let job = slot(&service);
    let refused = |arguments: &[&str]| {
        let output = service.run(&[&["run", &job], arguments].concat());
        assert_eq!((code(&output), stdout(&output)), (2, String::new()));
        stderr(&output)
    };
    assert!(refused(&[]).contains("--simulate"));
    assert!(refused(&["--simulate", "--cut", "7-3:1"]).contains("the last is not before the first"));
    assert!(refused(&["--simulate", "--cut", "3:-1"]).contains("depth"));
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("machine.json");
    let description = ["--simulate", "--cut", "3:1", "--description", file.to_str().unwrap()];
    std::fs::write(&file, r#"{"sample_rate": 20000}"#).unwrap();
    assert!(refused(&description).contains("unknown field `sample_rate`"));
    std::fs::write(&file, r#"{"process": {"milling": {"entry_deg": 90, "exit_deg": 45}}}"#).unwrap();
    assert!(refused(&description).contains("process.exit_deg: 45° is not after the entry at 90°"));
    std::fs::write(&file, r#"{"sample_rate_hz": 0}"#).unwrap();
    assert!(refused(&description).contains("sample_rate_hz"));
    let strain = r#"{"tool_sensors": {"quantity": "SENSOR_QUANTITY_STRAIN", "mm_per_strain": 1.5}}"#;
    std::fs::write(&file, strain).unwrap();
    assert!(refused(&description).contains("set it first"));

    let unknown = "jobs/00000000-0000-7000-8000-000000000000";
    let output = service.run(&["run", unknown, "--simulate", "--cut", "3:1"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("does not exist"), "{}", stderr(&output));
    let help = stdout(&feedwave().args(["run", "--help"]).output().unwrap());
    assert!(help.contains("--description") && help.contains("half immersed"), "{help}");
}
