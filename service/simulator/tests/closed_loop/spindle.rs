//! The spindle rules, and chatter.

use super::harness::{SLOT, SLOT_REV_PER_MIN, judging, line, mill, run, run_on};
use feedwave_cutting::MachineProfile;
use feedwave_monitoring::{
    Evidence, LineOrigin, Mode, MonitoringConfig, PocketRequest, Property, Reason, SpectrumConfig, SpindleRule,
    SpindleTable,
};
use feedwave_simulator::{Chatter, Description, Material, Process, Tool, Where};

fn with_spectrum(mut config: MonitoringConfig) -> MonitoringConfig {
    config.spectrum = Some(SpectrumConfig {
        samples: 2048,
        min_frequency_hz: 30.0,
        noise_floor: 1e-3,
        harmonic_tolerance_hz: 12.0,
        edges: 4,
    });
    config
}

#[test]
fn chatter_is_found_and_named_with_its_frequency() {
    let mut description = mill(0.5);
    description.chatter = vec![Chatter {
        at: Where::Time { from_s: 2.0, to_s: 4.0 },
        frequency_hz: 1234.5,
        amplitude_mm: 0.02,
        direction_deg: 40.0,
    }];
    let live = run(SLOT, SLOT_REV_PER_MIN, description, with_spectrum(judging()));
    let mut named = 0;
    for decision in &live.decisions {
        let Evidence::Process(properties) = decision.inputs.evidence else { continue };
        let line = properties.line.unwrap();
        let (first_s, last_s) = (decision.span.first_ns as f64 * 1e-9, decision.span.last_ns as f64 * 1e-9);
        if first_s >= 2.0 && last_s < 4.0 {
            assert_eq!(line.origin, LineOrigin::Chatter);
            assert!((line.frequency_hz - 1234.5).abs() < 0.5, "{line:?}");
            assert!((line.amplitude - 0.02).abs() < 0.001, "{line:?}");
            named += 1;
        } else if last_s < 2.0 || first_s >= 4.0 {
            assert!(matches!(line.origin, LineOrigin::EdgePassing(_)), "{line:?}");
        }
    }
    assert!(named >= 8, "{named}");
}

/// Cutting at 7500 rev/min with 0.05 mm per edge.
const FAST: &str = "G21 G90 G94 G17 S7500 M3\nG0 X10 Y0 Z0\nG1 X160 F1500\nM30\n";

#[test]
fn a_speed_that_chatters_is_left_for_the_pocket_of_the_lobes_and_the_chip_stays() {
    let mode = |frequency_hz| Mode { frequency_hz, damping_ratio: 0.03, stiffness_n_per_mm: 10_000.0 };
    let mut description = Description {
        seed: 3,
        // A full slot with four edges: the force is constant but for chatter. The best pockets lie where edges pass at a natural
        // frequency, so another immersion would answer them with forced vibration.
        process: Process::Milling { entry_deg: 0.0, exit_deg: 180.0 },
        tool: Tool { mode_x: mode(600.0), mode_y: mode(660.0), ..Tool::default() },
        material: Material { tangential_n_per_mm2: 700.0, ..Material::default() },
        regenerative: true,
        ..Description::default()
    };
    let lobes = description.milling_model().unwrap().lobes().unwrap();
    let pockets = lobes
        .pockets(&PocketRequest {
            lowest_rev_per_min: 6500.0,
            highest_rev_per_min: 9000.0,
            bands: 1,
            margin: 0.15,
            speed_tolerance: 0.01,
            required_mm: None,
        })
        .unwrap();
    let unstable_mm = lobes.limit_mm(7500.0).unwrap().unwrap();
    let stable_mm = pockets[0].stable_mm.unwrap();
    let depth_mm = 0.9 * stable_mm;
    assert!(depth_mm > 1.2 * unstable_mm, "{depth_mm} mm chatters at 7500 rev/min: {unstable_mm} mm");
    description.contacts = line(3, depth_mm);
    let mut config = with_spectrum(judging());
    config.rules.property = Property::VibrationAmplitude;
    (config.rules.feed.lower, config.rules.feed.upper) = (0.0, 0.005);
    config.rules.spindle = SpindleRule::Milling { limit: 0.005, table: SpindleTable::from_pockets(&pockets) };
    let live = run(FAST, 7500.0, description, config);
    let lines: Vec<_> = live.windows().map(|(properties, _)| properties.line.unwrap()).collect();
    let reasons = live.reasons();
    let changed = reasons.iter().position(|reason| *reason == Reason::SpeedFromTable).expect("the speed never changed");
    let chatter = lines[changed - 1];
    assert_eq!(chatter.origin, LineOrigin::Chatter, "{chatter:?}");
    assert!((500.0..800.0).contains(&chatter.frequency_hz), "near a natural frequency: {chatter:?}");
    let after = live.decisions[changed].outcome.after;
    assert!((after.spindle * 7500.0 - pockets[0].row.spindle_rev_per_min).abs() < 1e-6 && after.feed == after.spindle);
    assert!(reasons[changed + 3..].iter().all(|reason| *reason == Reason::WithinLimits), "{reasons:?}");
    assert!(reasons.len() > changed + 8, "{reasons:?}");
    let last = lines.last().unwrap();
    assert!(!matches!(last.origin, LineOrigin::Chatter) && last.amplitude < 0.2 * chatter.amplitude, "{last:?}");
}

/// 2 mm of width at 0.2 mm/rev.
const TURN: &str = "G21 G90 G94 G18 S600 M3\nG0 X40 Z2\nG1 Z-10 F120\nM30\n";

#[test]
fn the_angle_of_the_deflection_steers_the_speed_of_turning() {
    let mode = Mode { frequency_hz: 900.0, damping_ratio: 0.05, stiffness_n_per_mm: 20_000.0 };
    let description = Description {
        process: Process::Turning,
        tool: Tool { radius_mm: 20.0, mode_x: mode, mode_y: mode, run_out_mm: 0.0, ..Tool::default() },
        material: Material {
            radial_ratio: 0.5,
            radial_speed_exponent: 0.5,
            reference_speed_m_per_min: 75.0,
            ..Material::default()
        },
        contacts: line(3, 0.4),
        ..Description::default()
    };
    let with = |lower_deg, upper_deg| {
        let mut config = judging();
        config.rules.spindle = SpindleRule::Turning { lower_deg, upper_deg, step: 0.05, min_concentration: 0.5 };
        run_on(MachineProfile::lathe(), TURN, 600.0, description.clone(), config)
    };
    // tan α = F_t/F_r = 1/K_r: K_r = 0.5·(75.4/75)^−0.5 gives 63.5° at first, and 1 % more speed some 0.1° more.
    let live = with(64.46, 65.89);
    let reasons = live.reasons();
    let faster = reasons.iter().filter(|reason| **reason == Reason::AngleBelowLimit).count();
    assert!(faster >= 1 && reasons[1..=faster].iter().all(|reason| *reason == Reason::AngleBelowLimit), "{reasons:?}");
    let angles: Vec<f64> = live.windows().map(|(properties, _)| properties.mean_angle.unwrap().0).collect();
    assert!((angles[0] - libm::atan(2.0 * libm::sqrt(75.398 / 75.0)).to_degrees()).abs() < 0.05, "{angles:?}");
    assert!((64.46..=65.89).contains(angles.last().unwrap()), "{angles:?}");
    let overrides = live.monitor.overrides();
    assert_eq!(overrides.feed, overrides.spindle, "the feed per revolution stays");
    // The chip stayed, and the deflection with it: 1.006² of the tangential part at most.
    let deflections: Vec<f64> = live.windows().map(|(properties, _)| properties.max_deviation).collect();
    assert!((deflections.last().unwrap() / deflections[0] - 1.0).abs() < 0.05, "{deflections:?}");
    assert!(with(1.0, 1.08).reasons().contains(&Reason::AngleAboveLimit));
}
