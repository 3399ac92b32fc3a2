//! Learning from runs through the built binary: a simulated machine cuts, the run keeps it, `feedwave learn` tells what the machine
//! is, and only `--adopt` changes the tool. What the simulator really is must lie within the intervals.

use std::path::Path;
use std::process::{Output, Stdio};

use feedwave_contract::proto::{GetToolRequest, Tool};
use feedwave_tests::{Home, Server};
use serde_json::Value;
use tokio::process::Command;

use crate::FEEDWAVE;

/// Straight cuts at two feeds and in two directions.
const CUTS: &str = "G21 G90 G94 G17 S3100 M3
G0 X0 Y0 Z0
G1 X8 F700
G1 X8 Y12 F1500
G1 X0 F1500
G1 Y0 F700
M30
";
/// K_tc, N/mm²; K_te, N/mm; K_r; K_re, N/mm.
const MATERIAL: [f64; 4] = [1_850.0, 22.0, 0.35, 31.0];
const EDGE_RUN_OUT_MM: f64 = 0.006;
const RUN_OUT_MM: f64 = 0.004;

fn description(seed: u64) -> String {
    let [tangential, edge_tangential, radial_ratio, edge_radial] = MATERIAL;
    serde_json::json!({
        "seed": seed,
        "process": { "milling": { "entry_deg": 25.0, "exit_deg": 130.0 } },
        "tool": { "run_out_mm": RUN_OUT_MM, "edge_run_out_mm": EDGE_RUN_OUT_MM },
        "material": {
            "tangential_n_per_mm2": tangential, "edge_tangential_n_per_mm": edge_tangential,
            "radial_ratio": radial_ratio, "edge_radial_n_per_mm": edge_radial,
        },
        "tool_sensors": { "quantity": "SENSOR_QUANTITY_DISPLACEMENT", "stand_off": 1.0, "noise": 4e-4 },
    })
    .to_string()
}

/// What the library says: stiffness as it is, the rest not quite.
const TOOL: &str = r#"{"number": 3, "edgeCount": 4, "dynamics": {
    "modesX": [{"frequencyHz": 864, "dampingRatio": 0.05, "stiffnessNPerMm": 12000}],
    "modesY": [{"frequencyHz": 980, "dampingRatio": 0.05, "stiffnessNPerMm": 13000}],
    "tangentialNPerMm2": 1500, "radialRatio": 0.3, "specificNPerMm2": 1700}}"#;

async fn feedwave(server: &Server, arguments: &[&str]) -> Output {
    let mut command = Command::new(FEEDWAVE);
    command.args(arguments).args(["--server", &format!("http://{}", server.grpc)]);
    command.stdin(Stdio::null()).kill_on_drop(true).output().await.expect("the binary runs")
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn said(output: &Output) -> String {
    format!("{}{}", out(output), String::from_utf8_lossy(&output.stderr))
}

async fn done(server: &Server, arguments: &[&str]) -> String {
    let output = feedwave(server, arguments).await;
    assert!(output.status.success(), "{arguments:?}: {}", said(&output));
    out(&output)
}

/// A run of the cuts; its name.
async fn cut(server: &Server, home: &Path, seed: u64, more: &[&str]) -> String {
    let [program, machine] = ["cuts.nc", "machine.json"].map(|name| home.join(name).display().to_string());
    std::fs::write(&program, CUTS).expect("written");
    std::fs::write(&machine, description(seed)).expect("written");
    let submitted = done(server, &["submit", &program, "--wait", "--machine", "mill"]).await;
    let job = submitted.lines().last().expect("the job's name").to_owned();
    let run = ["run", &job, "--simulate", "--description", &machine, "--cut", "3-6:0.6"];
    done(server, &[&run[..], more].concat()).await.lines().next().expect("the run's name").to_owned()
}

async fn put_tool(server: &Server, home: &Path) {
    let tool = home.join("em12.json").display().to_string();
    std::fs::write(&tool, TOOL).expect("written");
    done(server, &["tool", "put", &tool, "em12"]).await;
}

async fn tool(server: &Server) -> Tool {
    let mut clients = server.connect().await;
    let request = GetToolRequest { name: "tools/em12".to_owned() };
    clients.tools.get_tool(request).await.expect("the tool").into_inner().tool.expect("a tool")
}

fn learn<'a>(run: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let all = ["learn", run, "--tool", "tools/em12", "--cut", "3-6:0.6", "--entry", "25", "--exit", "130"];
    [&all[..], more].concat()
}

/// Estimates of a proposal beside what the machine is.
fn beside_truth(proposal: &Value) -> [(&'static str, &Value, f64); 10] {
    let [tangential, edge_tangential, radial_ratio, edge_radial] = MATERIAL;
    let (x, y) = (&proposal["modeX"], &proposal["modeY"]);
    [
        ("K_tc", &proposal["tangentialNPerMm2"], tangential),
        ("K_te", &proposal["edgeTangentialNPerMm"], edge_tangential),
        ("K_rc", &proposal["radialNPerMm2"], radial_ratio * tangential),
        ("K_re", &proposal["edgeRadialNPerMm"], edge_radial),
        ("run-out of the edges", &proposal["edgeRunOutMm"], EDGE_RUN_OUT_MM),
        ("run-out of the surface", &proposal["runOutMm"], RUN_OUT_MM),
        ("frequency in X", &x["frequencyHz"], 900.0),
        ("damping in X", &x["dampingRatio"], 0.04),
        ("frequency in Y", &y["frequencyHz"], 950.0),
        ("damping in Y", &y["dampingRatio"], 0.04),
    ]
}

#[tokio::test]
async fn what_the_machine_really_is_lies_within_the_intervals() {
    let server = Server::start(FEEDWAVE).await;
    let home = tempfile::tempdir().expect("a directory");
    put_tool(&server, home.path()).await;
    const SEEDS: u64 = 4;
    let mut within = 0;
    for seed in 0..SEEDS {
        let run = cut(&server, home.path(), 40 + seed, &["--record", "700000"]).await;
        let learnt = done(&server, &learn(&run, &["--format", "json"])).await;
        let proposal: Value = serde_json::from_str(&learnt).expect("JSON");
        for (name, estimate, truth) in beside_truth(&proposal) {
            let of = |key: &str| estimate[key].as_f64().unwrap_or_else(|| panic!("{name}: {key} in {estimate}"));
            let (lower, upper, error) = (of("lower"), of("upper"), of("standardError"));
            within += u64::from((lower..=upper).contains(&truth));
            // An interval as wide as the value would hold anything; far outside of it is no chance.
            assert!(error < 0.1 * truth, "{name}, seed {seed}: {estimate}, {truth}");
            assert!((of("value") - truth).abs() < 4.0 * error, "{name}, seed {seed}: {estimate}, {truth}");
        }
        assert_eq!(proposal["isXDominant"], true, "2ζk of X is smaller");
    }
    // 95 % of 40 are 38; by chance three standard deviations of 1.4 fewer.
    assert!(within >= 34, "{within} of {}", 10 * SEEDS);
    assert_eq!(
        tool(&server).await.dynamics.expect("dynamics").tangential_n_per_mm2,
        Some(1_500.0),
        "nothing is adopted"
    );
}

#[tokio::test]
async fn only_a_call_that_says_so_adopts_and_the_audit_log_tells() {
    let server = Home::new(FEEDWAVE, "").start().await;
    let home = tempfile::tempdir().expect("a directory");
    put_tool(&server, home.path()).await;
    let unrecorded = cut(&server, home.path(), 7, &[]).await;
    let refused = feedwave(&server, &learn(&unrecorded, &[])).await;
    assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
    assert!(said(&refused).contains("nothing was kept of these runs"), "{}", said(&refused));

    let run = cut(&server, home.path(), 7, &["--record", "700000"]).await;
    // What was kept outlives the service.
    let server = server.kill().await.start().await;
    let table = ["--lowest-rev-per-min", "3000", "--highest-rev-per-min", "9000", "--bands", "3"];
    let before = tool(&server).await;
    let shown = done(&server, &learn(&run, &table)).await;
    assert!(shown.contains("Spindle table that would follow") && shown.contains("K_tc tangential"), "{shown}");
    assert!(shown.contains("line 3: 700 mm/min") || shown.contains("line 3:"), "{shown}");
    assert_eq!(tool(&server).await, before, "showing changes nothing");
    // Other lines are left out, and said to be.
    let part = feedwave(
        &server,
        &["learn", &run, "--tool", "tools/em12", "--cut", "3-4:0.6", "--entry", "25", "--exit", "130"],
    )
    .await;
    assert!(said(&part).contains("left out: no depth was given for its line"), "{}", said(&part));
    // Angles of another cut explain nothing that a tool has, or leave much more.
    let wrong = feedwave(
        &server,
        &["learn", &run, "--tool", "tools/em12", "--depth", "0.6", "--entry", "150", "--exit", "180"],
    )
    .await;
    assert_eq!(wrong.status.code(), Some(1), "{}", said(&wrong));

    let adopted = feedwave(&server, &learn(&run, &[&table[..], &["--adopt"]].concat())).await;
    assert!(adopted.status.success() && said(&adopted).contains("adopted: tools/em12"), "{}", said(&adopted));
    let after = tool(&server).await;
    let dynamics = after.dynamics.clone().expect("dynamics");
    assert!((dynamics.tangential_n_per_mm2.expect("K_t") / 1_850.0 - 1.0).abs() < 0.1, "{dynamics:?}");
    assert!((dynamics.modes_x[0].frequency_hz - 900.0).abs() < 10.0, "{dynamics:?}");
    assert_eq!(dynamics.modes_x[0].stiffness_n_per_mm, 12_000.0, "what was not learnt stays");
    assert_eq!((dynamics.specific_n_per_mm2, after.number, after.edge_count), (Some(1_700.0), 3, Some(4)));
    assert_ne!(after.etag, before.etag);

    let log = done(&server, &["audit"]).await;
    let entries: Vec<Value> = log.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let adopting: Vec<_> =
        entries.iter().filter(|entry| entry["method"] == "/feedwave.v1.Tools/AdoptToolProposal").collect();
    assert_eq!(adopting.len(), 1, "{log}");
    assert_eq!((&adopting[0]["resource"], &adopting[0]["result"]), (&"tools/em12".into(), &"OK".into()), "{log}");
    assert!(!log.contains("ComputeToolProposal"), "reading is not logged: {log}");
}
