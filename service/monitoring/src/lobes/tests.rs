use super::*;
use crate::rules::SpindleTable;

fn mode() -> Mode {
    Mode { frequency_hz: 600.0, damping_ratio: 0.03, stiffness_n_per_mm: 10_000.0 }
}

fn milling() -> MillingModel {
    MillingModel {
        modes_x: vec![mode()],
        modes_y: vec![Mode { frequency_hz: 660.0, ..mode() }],
        edges: 4,
        entry_rad: PI / 2.0,
        exit_rad: PI,
        tangential_n_per_mm2: 700.0,
        radial_ratio: 0.3,
    }
}

fn request() -> PocketRequest {
    PocketRequest {
        lowest_rev_per_min: 2000.0,
        highest_rev_per_min: 12_000.0,
        bands: 5,
        margin: 0.15,
        speed_tolerance: 0.01,
        required_mm: None,
    }
}

/// The fields of impossible values.
fn refused(errors: impl IntoIterator<Item = LobeError>) -> Vec<String> {
    let field = |error| match error {
        LobeError::Value { field, .. } => field,
        other => panic!("{other}"),
    };
    errors.into_iter().map(field).collect()
}

#[test]
fn the_width_of_turning_is_that_of_one_mode() {
    // Re G_min = −1/(4kζ(1 + ζ)), so b_lim = 2kζ(1 + ζ)/K_s = 2·10 000·0.03·1.03/2000 = 0.309 mm.
    let lobes = TurningModel { modes: vec![mode()], specific_n_per_mm2: 2000.0 }.lobes().unwrap();
    assert!((lobes.least_limit_mm().unwrap() - 0.309).abs() < 1e-5, "{:?}", lobes.least_limit_mm());
    let at = TurningModel { modes: vec![mode()], specific_n_per_mm2: 2000.0 };
    let point = at.limit_at(600.0 * (1.0f64 + 2.0 * 0.03).sqrt()).unwrap();
    assert!((point.limit_mm - 0.309).abs() < 1e-12);
    assert!((limiting_width_mm(2000.0, -1.0 / (4.0 * 10_000.0 * 0.03 * 1.03)) - 0.309).abs() < 1e-12);
}

#[test]
fn turning_points_solve_the_characteristic_equation() {
    let model =
        TurningModel { modes: vec![mode(), Mode { frequency_hz: 900.0, ..mode() }], specific_n_per_mm2: 1500.0 };
    for point in model.lobes().unwrap().branches().flatten() {
        let g = receptance(&model.modes, point.frequency_hz);
        let wave = (1.0 - libm::cos(point.phase_rad), libm::sin(point.phase_rad));
        let loop_gain = mul(mul(g, wave), (model.specific_n_per_mm2 * point.limit_mm, 0.0));
        assert!(libm::hypot(loop_gain.0 + 1.0, loop_gain.1) < 1e-6, "{point:?}: {loop_gain:?}");
    }
}

#[test]
fn milling_points_solve_the_characteristic_equation() {
    // det(I + Λ A₀ G) = 0 with Λ = −(z/4π) a K_t (1 − e^(−iε)).
    let model = milling();
    let [xx, xy, yx, yy] = model.directional_coefficients();
    let mut points = 0;
    for point in model.lobes().unwrap().branches().flatten() {
        let gain = -4.0 / (4.0 * PI) * point.limit_mm * model.tangential_n_per_mm2;
        let lambda = mul((gain, 0.0), (1.0 - libm::cos(point.phase_rad), libm::sin(point.phase_rad)));
        let (gx, gy) = (receptance(&model.modes_x, point.frequency_hz), receptance(&model.modes_y, point.frequency_hz));
        let diagonal = |alpha: f64, g: Complex| {
            let term = mul(lambda, g);
            (1.0 + alpha * term.0, alpha * term.1)
        };
        let cross = mul(mul(lambda, lambda), mul(gx, gy));
        let product = mul(diagonal(xx, gx), diagonal(yy, gy));
        let determinant = (product.0 - xy * yx * cross.0, product.1 - xy * yx * cross.1);
        let scale = 1.0 + libm::hypot(cross.0, cross.1) * (xy * yx).abs() + libm::hypot(product.0, product.1);
        assert!(libm::hypot(determinant.0, determinant.1) < 1e-9 * scale, "{point:?}: {determinant:?}");
        points += 1;
    }
    assert!(points > 1000);
}

#[test]
fn full_slotting_has_the_known_directional_coefficients() {
    // From 0 to π: [cos 2φ] = [sin 2φ] = 0, which leaves −πK_r, −π, π, −πK_r.
    let model = MillingModel { entry_rad: 0.0, exit_rad: PI, ..milling() };
    for (value, expected) in model.directional_coefficients().into_iter().zip([-0.3 * PI, -PI, PI, -0.3 * PI]) {
        assert!((value - expected).abs() < 1e-12);
    }
}

#[test]
fn one_flexible_direction_is_no_special_case() {
    let model = MillingModel { modes_y: Vec::new(), ..milling() };
    let g = receptance(&model.modes_x, 650.0);
    let xx = model.directional_coefficients()[0];
    // a₀ = 0 leaves Λ = −1/(α_xx G_xx).
    let lambda = div((-1.0, 0.0), (xx * g.0, xx * g.1));
    let expected = -TAU * lambda.0 / (4.0 * 700.0) * (1.0 + (lambda.1 / lambda.0).powi(2));
    let found: Vec<_> = model.limits_at(650.0).into_iter().flatten().collect();
    if expected > 0.0 {
        assert_eq!(found.len(), 1);
        assert!((found[0].limit_mm - expected).abs() < 1e-9 * expected);
    } else {
        assert!(found.is_empty());
        assert!(!model.limits_at(550.0).into_iter().flatten().collect::<Vec<_>>().is_empty());
    }
}

#[test]
fn pockets_fill_a_table_without_gaps_and_beat_the_least_limit() {
    let lobes = milling().lobes().unwrap();
    let pockets = lobes.pockets(&request()).unwrap();
    let least = lobes.least_limit_mm().unwrap();
    assert_eq!(pockets.len(), 5);
    for pocket in &pockets {
        let stable = pocket.stable_mm.unwrap();
        assert!(stable >= 0.85 * least);
        let limit = lobes.limit_mm(pocket.row.spindle_rev_per_min).unwrap().unwrap();
        assert!(stable <= 0.85 * limit * (1.0 + 1e-9), "{stable} {limit}");
        assert!(
            pocket.row.above_rev_per_min < pocket.row.spindle_rev_per_min
                && pocket.row.spindle_rev_per_min <= pocket.row.up_to_rev_per_min
        );
    }
    assert!(pockets.windows(2).all(|pair| pair[0].row.up_to_rev_per_min == pair[1].row.above_rev_per_min));
    // Between 8000 and 10 000 rev/min lies the pocket of edge passing at a natural frequency: 60·600/4 = 9000 rev/min.
    assert!(pockets[3].stable_mm.unwrap() > 2.0 * least, "{pockets:?}");
    let config = crate::MonitoringConfig {
        rules: crate::Rules {
            spindle: crate::SpindleRule::Milling { limit: 0.05, table: SpindleTable::from_pockets(&pockets) },
            ..crate::Rules::default()
        },
        ..crate::MonitoringConfig::default()
    };
    assert_eq!(config.violations(), []);
}

#[test]
fn impossible_data_is_refused_with_numbers() {
    let no_modes = TurningModel { modes: Vec::new(), specific_n_per_mm2: 2000.0 };
    assert_eq!(no_modes.lobes(), Err(LobeError::Value { field: "modes".into(), value: 0.0, least: 1.0, most: 32.0 }));
    let undamped = TurningModel { modes: vec![Mode { damping_ratio: 0.0, ..mode() }], specific_n_per_mm2: 2000.0 };
    assert_eq!(refused(undamped.problems()), ["modes[0].damping_ratio"]);
    assert!(undamped.lobes().is_err());
    let backwards = MillingModel { entry_rad: 2.0, exit_rad: 1.0, ..milling() };
    assert_eq!(refused(backwards.problems()), ["exit_rad"]);
    let nan = MillingModel { radial_ratio: f64::NAN, ..milling() };
    assert_eq!(refused(nan.problems()), ["radial_ratio"]);
    let soft = Mode { stiffness_n_per_mm: -1.0, ..mode() };
    let all = MillingModel { modes_x: vec![mode(), soft], edges: 0, tangential_n_per_mm2: 0.0, ..milling() };
    assert_eq!(refused(all.problems()), ["modes_x[1].stiffness_n_per_mm", "edge_count", "tangential_n_per_mm2"]);
    let pockets =
        PocketRequest { lowest_rev_per_min: 9.0, highest_rev_per_min: 8.0, bands: 0, margin: 1.0, ..request() };
    assert_eq!(refused(pockets.problems()), ["highest_rev_per_min", "bands", "margin"]);
    let lobes = milling().lobes().unwrap();
    assert!(matches!(lobes.limit_mm(2.0), Err(LobeError::TooManyLobes { lowest_rev_per_min: 2.0, .. })));
    let deep = PocketRequest { required_mm: Some(1000.0), ..request() };
    assert!(matches!(lobes.pockets(&deep), Err(LobeError::TooDeep { required_mm: 1000.0, .. })));
}

#[test]
fn a_pocket_at_the_end_of_the_range_keeps_away_from_it() {
    let lobes = milling().lobes().unwrap();
    // The deepest pocket lies above 9000 rev/min; of this range it is the end that is best.
    let narrow = PocketRequest { lowest_rev_per_min: 8000.0, highest_rev_per_min: 8800.0, bands: 1, ..request() };
    let best_rev_per_min = lobes.pockets(&narrow).unwrap()[0].row.spindle_rev_per_min;
    assert!(best_rev_per_min * 1.01 <= 8800.0 && best_rev_per_min * 1.01 > 8797.0, "{best_rev_per_min}");
    let none = PocketRequest { lowest_rev_per_min: 8000.0, highest_rev_per_min: 8100.0, ..narrow };
    let refused = lobes.pockets(&none);
    assert!(matches!(refused, Err(LobeError::BandTooNarrow { up_to_rev_per_min: 8100.0, .. })), "{refused:?}");
}

#[test]
fn the_chart_is_the_limit_with_its_lobe_and_chatter_frequency() {
    let lobes = milling().lobes().unwrap();
    let chart = lobes.chart(2000.0, 12_000.0, 501).unwrap();
    // Those asked for, and others between them.
    assert!(chart.len() > 501 && chart.len() < 2_000, "{}", chart.len());
    assert_eq!((chart[0].spindle_rev_per_min, chart[chart.len() - 1].spindle_rev_per_min), (2000.0, 12_000.0));
    for index in 0..501 {
        let spindle_rev_per_min = 2000.0 + 20.0 * f64::from(index);
        let point =
            chart[chart.partition_point(|point| point.spindle_rev_per_min < spindle_rev_per_min * (1.0 - 1e-9))];
        assert!((point.spindle_rev_per_min - spindle_rev_per_min).abs() < 1e-6, "{spindle_rev_per_min}");
        assert_eq!(Some(point.limit.unwrap().limit_mm), lobes.limit_mm(point.spindle_rev_per_min).unwrap());
    }
    for point in &chart {
        let limit = point.limit.unwrap();
        let exact = lobes.limit_mm(point.spindle_rev_per_min).unwrap().unwrap();
        assert!(limit.limit_mm <= exact && limit.limit_mm >= 0.999 * exact, "{point:?}: {exact}");
        // Between two edges lie k whole waves and a part of one.
        let waves = limit.frequency_hz * 60.0 / (4.0 * point.spindle_rev_per_min);
        assert!((f64::from(limit.lobe)..f64::from(limit.lobe) + 1.0).contains(&waves), "{point:?}: {waves}");
        assert!((550.0..1000.0).contains(&limit.frequency_hz), "{point:?}");
    }
    let lobes_of: Vec<_> = chart.iter().map(|point| point.limit.unwrap().lobe).collect();
    assert!(lobes_of.last() == Some(&0) && lobes_of[0] >= 4);
    assert!(lobes_of.windows(2).all(|pair| pair[1] <= pair[0] + 1));
    let chart = |highest_rev_per_min, speeds| refused(lobes.chart(2000.0, highest_rev_per_min, speeds).err());
    assert_eq!((chart(12_000.0, 1), chart(f64::NAN, 9)), (vec!["speeds".into()], vec!["highest_rev_per_min".into()]));
}

#[test]
fn radial_immersion_is_the_share_of_the_diameter() {
    let immersion = |entry_rad, exit_rad| MillingModel { entry_rad, exit_rad, ..milling() }.radial_immersion();
    assert!((immersion(0.0, PI) - 1.0).abs() < 1e-15 && (immersion(PI / 2.0, PI) - 0.5).abs() < 1e-15);
    // A tenth of the diameter, conventional: cos φ_exit = 1 − 2·0.1.
    assert!((immersion(0.0, libm::acos(0.8)) - 0.1).abs() < 1e-15);
}
