//! Stability lobes from the tool library, and the spindle tables that monitoring takes from them.

use feedwave_contract::proto::spindle_rule::Rule;
use feedwave_contract::proto::stability_model::Cut;
use feedwave_contract::proto::telemetry_client::TelemetryClient;
use feedwave_contract::proto::{
    ComputeStabilityLobesRequest, CreateToolRequest, GetMonitoringRequest, MillingCut, MillingRule, MonitoringConfig,
    PocketSearch, SetMonitoringRequest, Severity, SpindleBand, SpindleRule, StabilityLobes, StabilityModel,
    TableFromLobes, Tool, ToolDynamics, ToolKind, TurningCut, VibrationMode,
};
use tonic::{Code, Status};

use crate::support::{TestServer, lathe_job, resting, told};
use crate::telemetry::config;

fn mode(frequency_hz: f64) -> VibrationMode {
    VibrationMode { frequency_hz, damping_ratio: 0.03, stiffness_n_per_mm: 10_000.0 }
}

fn mill() -> Tool {
    Tool {
        number: 12,
        kind: ToolKind::Mill.into(),
        edge_count: Some(4),
        dynamics: Some(ToolDynamics {
            modes_x: vec![mode(600.0)],
            modes_y: vec![mode(660.0)],
            modes_normal: vec![mode(600.0)],
            tangential_n_per_mm2: Some(700.0),
            radial_ratio: Some(0.3),
            specific_n_per_mm2: Some(2_000.0),
            ..Default::default()
        }),
        ..Default::default()
    }
}

async fn with_mill() -> TestServer {
    let server = TestServer::start().await;
    let create = CreateToolRequest { tool_id: "em12".to_owned(), tool: Some(mill()) };
    server.tools().create_tool(create).await.unwrap();
    server
}

fn milling(entry_deg: f64, exit_deg: f64) -> StabilityModel {
    let cut = Cut::Milling(MillingCut { entry_deg, exit_deg, edge_count: None });
    StabilityModel { tool: "tools/em12".to_owned(), dynamics: None, cut: Some(cut) }
}

fn search() -> PocketSearch {
    PocketSearch { lowest_rev_per_min: 2_000.0, highest_rev_per_min: 12_000.0, bands: Some(5), ..Default::default() }
}

async fn compute(server: &TestServer, model: StabilityModel, search: PocketSearch) -> Result<StabilityLobes, Status> {
    let request = ComputeStabilityLobesRequest { model: Some(model), search: Some(search), chart_speeds: Some(501) };
    let response = server.tools().compute_stability_lobes(request).await?;
    Ok(response.into_inner().lobes.unwrap())
}

#[tokio::test]
async fn a_stored_tool_gives_chart_and_table_with_the_stated_margin() {
    let server = with_mill().await;
    let lobes = compute(&server, milling(90.0, 180.0), search()).await.unwrap();
    let ends = [lobes.chart.first(), lobes.chart.last()].map(|point| point.unwrap().spindle_rev_per_min);
    assert!(lobes.chart.len() > 501 && ends == [2_000.0, 12_000.0], "{} {ends:?}", lobes.chart.len());
    assert_eq!(lobes.search.unwrap().margin, Some(0.15));
    assert!((lobes.radial_immersion.unwrap() - 0.5).abs() < 1e-12);
    assert!(lobes.findings.is_empty(), "half immersion is not low");
    let least = lobes.least_limit_mm.unwrap();
    assert!(lobes.chart.iter().all(|point| point.limit_mm.unwrap() >= least * (1.0 - 1e-9)));
    let bands: Vec<_> = lobes.pockets.iter().map(|pocket| pocket.band.unwrap()).collect();
    assert_eq!((bands.len(), bands[0].above_rev_per_min, bands[4].up_to_rev_per_min), (5, 2_000.0, 12_000.0));
    assert!(bands.windows(2).all(|pair| pair[0].up_to_rev_per_min == pair[1].above_rev_per_min));
    // Edge passing at a natural frequency, 60·600/4 = 9000 rev/min: the deepest pocket. The margin is taken off every one.
    let plain = compute(&server, milling(90.0, 180.0), PocketSearch { margin: Some(0.0), ..search() }).await.unwrap();
    for (pocket, plain) in lobes.pockets.iter().zip(&plain.pockets) {
        assert_eq!(pocket.band, plain.band);
        assert!((pocket.stable_mm.unwrap() - 0.85 * plain.stable_mm.unwrap()).abs() < 1e-12);
    }
    assert!(lobes.pockets[3].stable_mm.unwrap() > 2.0 * least);

    // Turning: b_lim = 2kζ(1 + ζ)/K_s = 0.309 mm; the request's coefficient takes the place of the tool's.
    let turning = |specific_n_per_mm2| StabilityModel {
        dynamics: Some(ToolDynamics { specific_n_per_mm2, ..Default::default() }),
        cut: Some(Cut::Turning(TurningCut {})),
        ..milling(0.0, 0.0)
    };
    for (specific, expected) in [(None, 0.309), (Some(1_000.0), 0.618)] {
        let lobes = compute(&server, turning(specific), search()).await.unwrap();
        assert!((lobes.least_limit_mm.unwrap() - expected).abs() < 1e-4, "{:?}", lobes.least_limit_mm);
        assert_eq!(lobes.radial_immersion, None);
    }
}

#[tokio::test]
async fn low_radial_immersion_is_warned_of_unless_the_margin_covers_it() {
    let server = with_mill().await;
    // A tenth of the diameter: cos φ = 1 − 2·0.1.
    let thin = milling(0.0, 0.8_f64.acos().to_degrees());
    for (margin, severity) in [(0.05, Severity::Warning), (0.15, Severity::Info)] {
        let lobes = compute(&server, thin.clone(), PocketSearch { margin: Some(margin), ..search() }).await.unwrap();
        let [finding] = &lobes.findings[..] else { panic!("{:?}", lobes.findings) };
        assert_eq!((finding.code.as_str(), finding.severity()), ("LOBES-LOW-IMMERSION", severity));
        let value = |name: &str| finding.values.iter().find(|value| value.name == name).unwrap().value;
        assert!((value("radial_immersion") - 0.1).abs() < 1e-12);
        assert_eq!((value("margin"), value("largest_error")), (margin, 0.15));
        assert_eq!(finding.suggestions.len(), usize::from(severity == Severity::Warning));
    }
}

#[tokio::test]
async fn everything_impossible_and_everything_missing_is_named() {
    let server = with_mill().await;
    let refused = async |model, search| told(&compute(&server, model, search).await.unwrap_err());
    let (code, _, fields) = refused(
        StabilityModel {
            dynamics: Some(ToolDynamics {
                modes_x: vec![mode(600.0), VibrationMode { stiffness_n_per_mm: -1.0, ..mode(f64::NAN) }],
                ..Default::default()
            }),
            ..milling(120.0, 90.0)
        },
        PocketSearch { margin: Some(1.0), bands: Some(0), ..Default::default() },
    )
    .await;
    assert_eq!(code, Code::InvalidArgument);
    assert_eq!(
        fields,
        [
            "model.dynamics.modes_x[1].frequency_hz",
            "model.dynamics.modes_x[1].stiffness_n_per_mm",
            "model.milling.exit_deg",
            "search.lowest_rev_per_min",
            "search.bands",
            "search.margin"
        ]
    );
    let nothing = StabilityModel { tool: String::new(), ..milling(0.0, 90.0) };
    let missing = ["tangential_n_per_mm2", "radial_ratio", "modes_x"].map(|field| format!("model.dynamics.{field}"));
    let (_, _, fields) = refused(nothing, search()).await;
    assert_eq!(fields, [&missing[..2], &["model.milling.edge_count".to_owned()], &missing[2..]].concat());
    let (_, _, fields) = refused(StabilityModel::default(), search()).await;
    assert_eq!(fields, ["model.cut"]);
    let (_, _, fields) = refused(milling(0.0, 180.0), PocketSearch { required_mm: Some(100.0), ..search() }).await;
    assert_eq!(fields, ["search.required_mm"]);
    let (_, _, fields) = refused(milling(0.0, 180.0), PocketSearch { lowest_rev_per_min: 1.0, ..search() }).await;
    assert_eq!(fields, ["search.lowest_rev_per_min"]);
    let unknown = StabilityModel { tool: "tools/none".to_owned(), ..milling(0.0, 180.0) };
    assert_eq!(compute(&server, unknown, search()).await.unwrap_err().code(), Code::NotFound);
}

#[tokio::test]
async fn a_tool_with_impossible_modes_is_not_kept() {
    let server = TestServer::start().await;
    let mut tool = mill();
    let dynamics = tool.dynamics.as_mut().unwrap();
    dynamics.modes_y[0].damping_ratio = 0.0;
    dynamics.modes_normal = vec![mode(100.0); 33];
    dynamics.radial_ratio = Some(f64::INFINITY);
    let create = CreateToolRequest { tool_id: "em12".to_owned(), tool: Some(tool) };
    let (code, _, fields) = told(&server.tools().create_tool(create).await.unwrap_err());
    assert_eq!(code, Code::InvalidArgument);
    let expected = ["modes_y[0].damping_ratio", "modes_normal", "radial_ratio"];
    assert_eq!(fields, expected.map(|field| format!("tool.dynamics.{field}")));
}

fn monitoring(table_from: TableFromLobes) -> MonitoringConfig {
    let mut config = config();
    let rule = MillingRule { limit: 0.02, table: Vec::new(), table_from: Some(table_from) };
    config.rules.as_mut().unwrap().spindle = Some(SpindleRule { rule: Some(Rule::Milling(rule)) });
    config
}

fn table(config: &MonitoringConfig) -> &[SpindleBand] {
    match config.rules.as_ref().and_then(|rules| rules.spindle.as_ref()).and_then(|spindle| spindle.rule.as_ref()) {
        Some(Rule::Milling(rule)) => &rule.table,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn a_monitoring_takes_its_spindle_table_from_the_tool() {
    let server = with_mill().await;
    let job = server.ready(lathe_job(&resting(1))).await.name;
    let mut client = TelemetryClient::new(server.channel.clone());
    let from = TableFromLobes { model: Some(milling(90.0, 180.0)), search: Some(search()) };
    let set = SetMonitoringRequest { job: job.clone(), config: Some(monitoring(from.clone())) };
    let stored = client.set_monitoring(set).await.unwrap().into_inner().config.unwrap();
    let lobes = compute(&server, milling(90.0, 180.0), search()).await.unwrap();
    let pockets: Vec<_> = lobes.pockets.iter().map(|pocket| pocket.band.unwrap()).collect();
    assert_eq!(table(&stored), pockets);
    let got = client.get_monitoring(GetMonitoringRequest { job: job.clone() }).await.unwrap().into_inner();
    assert_eq!(got.config.as_ref(), Some(&stored));
    // What comes back may be sent again.
    let again = SetMonitoringRequest { job: job.clone(), config: got.config };
    assert_eq!(client.set_monitoring(again).await.unwrap().into_inner().config, Some(stored));

    let deep = PocketSearch { required_mm: Some(50.0), ..search() };
    let from = TableFromLobes { search: Some(deep), ..from };
    let set = SetMonitoringRequest { job: job.clone(), config: Some(monitoring(from)) };
    let (code, _, fields) = told(&client.set_monitoring(set).await.unwrap_err());
    assert_eq!(code, Code::InvalidArgument);
    assert_eq!(fields, ["config.rules.spindle.milling.table_from.search.required_mm"]);
    let turning = StabilityModel { cut: Some(Cut::Turning(TurningCut {})), ..milling(0.0, 0.0) };
    let from = TableFromLobes { model: Some(turning), search: None };
    let set = SetMonitoringRequest { job, config: Some(monitoring(from)) };
    let (_, _, fields) = told(&client.set_monitoring(set).await.unwrap_err());
    let expected = ["model.turning", "search"].map(|field| format!("config.rules.spindle.milling.table_from.{field}"));
    assert_eq!(fields, expected);
}
