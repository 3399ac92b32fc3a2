//! Golden numbers of forces, deflections and readings.

mod common;

use common::{Path, everywhere, follow};
use feedwave_monitoring::{Mode, Quantity};
use feedwave_simulator::{Chatter, Contact, Description, Material, Process, Ripple, SensorPair, Sway, Tool, Where};
use std::f64::consts::{PI, TAU};

/// Sensors without noise at 0.
fn exact(quantity: Quantity) -> Option<SensorPair> {
    Some(SensorPair { quantity, stand_off: 0.0, noise: 0.0, ..SensorPair::default() })
}

/// Stiff enough that the deflection is F/k at any moment: 100 kHz, critically damped almost.
fn stiff(stiffness_n_per_mm: f64) -> Mode {
    Mode { frequency_hz: 50_000.0, damping_ratio: 0.7, stiffness_n_per_mm }
}

fn turning() -> Description {
    Description {
        process: Process::Turning,
        tool: Tool { mode_x: stiff(10_000.0), mode_y: stiff(20_000.0), run_out_mm: 0.0, ..Tool::default() },
        contacts: everywhere(2.0),
        tool_sensors: exact(Quantity::Displacement),
        ..Description::default()
    }
}

fn milling(edges: u32) -> Description {
    Description {
        process: Process::Milling { entry_deg: 0.0, exit_deg: 180.0 },
        tool: Tool {
            edge_count: edges,
            mode_x: stiff(10_000.0),
            mode_y: stiff(10_000.0),
            run_out_mm: 0.0,
            ..Tool::default()
        },
        ..turning()
    }
}

#[test]
fn turning_deflects_by_force_over_stiffness() {
    // 0.1 mm/rev and 2 mm: F_t = 2000·0.1·2 = 400 N, F_r = 0.3·400 = 120 N; 120/10 000 and 400/20 000 mm.
    let log = follow(turning(), Path::default().add(100, 100.0, 1000.0, [1.0, 0.0]));
    assert!((log.tool[0].last().unwrap() - 0.012).abs() < 1e-12);
    assert!((log.tool[1].last().unwrap() - 0.02).abs() < 1e-12);
    // Half the feed is half the chip; twice the speed again half of it.
    let log = follow(turning(), Path::default().add(100, 50.0, 2000.0, [1.0, 0.0]));
    assert!((log.tool[0].last().unwrap() - 0.003).abs() < 1e-12);
}

#[test]
fn edge_forces_and_cutting_speed_count() {
    let material = Material {
        edge_tangential_n_per_mm: 10.0,
        edge_radial_n_per_mm: 5.0,
        radial_speed_exponent: 0.5,
        reference_speed_m_per_min: PI * 10.0 * 0.25,
        ..Material::default()
    };
    // Four times the reference speed: K_r = 0.3/2. F_t = 400 + 2·10, F_r = 60 + 2·5.
    let log = follow(Description { material, ..turning() }, Path::default().add(100, 100.0, 1000.0, [1.0, 0.0]));
    assert!((log.tool[0].last().unwrap() - 70.0 / 10_000.0).abs() < 1e-12);
    assert!((log.tool[1].last().unwrap() - 420.0 / 20_000.0).abs() < 1e-12);
}

#[test]
fn slotting_with_four_edges_has_the_constant_force_of_the_textbook() {
    // z = 4 from 0 to π: F_x = −z·b·c/4·K_t·K_r and F_y = z·b·c/4·K_t at every angle; c = 200/(4·1000) = 0.05 mm.
    let path = Path::default().add(200, 200.0, 1000.0, [1.0, 0.0]).clone();
    let log = follow(milling(4), &path);
    for (x, y) in log.tool[0].iter().zip(&log.tool[1]).skip(100) {
        assert!((x + 0.3 * 200.0 / 10_000.0).abs() < 1e-12 && (y - 200.0 / 10_000.0).abs() < 1e-12, "{x} {y}");
    }
    // Feed along Y turns the forces by 90°, feed backwards by 180°.
    let up = follow(milling(4), Path::default().add(200, 200.0, 1000.0, [0.0, 1.0]));
    assert!((up.tool[0].last().unwrap() + 0.02).abs() < 1e-12 && (up.tool[1].last().unwrap() + 0.006).abs() < 1e-12);
    let back = follow(milling(4), Path::default().add(200, 200.0, 1000.0, [-1.0, 0.0]));
    assert!(
        (back.tool[0].last().unwrap() - 0.006).abs() < 1e-12 && (back.tool[1].last().unwrap() + 0.02).abs() < 1e-12
    );
    // A left-handed tool under M4 is the mirror image.
    let left = follow(milling(4), Path::default().add(200, 200.0, -1000.0, [1.0, 0.0]));
    assert!(
        (left.tool[0].last().unwrap() + 0.006).abs() < 1e-12 && (left.tool[1].last().unwrap() + 0.02).abs() < 1e-12
    );
}

/// Deflection of a milling tool over a turn in a steady cut without run-out, mm, from the harmonics of the force: each bends a mode by its complex
/// compliance. What is simulated in steps is summed here without any.
fn deflection_by_harmonics(description: &Description, feed_mm_per_min: f64, rev_per_min: f64) -> [Vec<f64>; 2] {
    const HARMONICS: u32 = 300;
    const PLACES: usize = 400;
    let Process::Milling { entry_deg, exit_deg } = description.process else { panic!("milling") };
    let (tool, material) = (&description.tool, &description.material);
    let edges = f64::from(tool.edge_count);
    let per_edge_mm = feed_mm_per_min / (edges * rev_per_min);
    let depth_mm = description.contacts[0].depth_mm;
    // Simpson's rule over the arc.
    let steps = 4_000_u32;
    let width = (exit_deg - entry_deg).to_radians() / f64::from(steps);
    let arc: Vec<(f64, [f64; 2])> = (0..=steps)
        .map(|step| {
            let angle = entry_deg.to_radians() + f64::from(step) * width;
            let weight = width / 3.0 * if step == 0 || step == steps { 1.0 } else { f64::from(2 + 2 * (step % 2)) };
            let (sin, cos) = libm::sincos(angle);
            let by_chip = material.tangential_n_per_mm2 * per_edge_mm * sin;
            let tangential = depth_mm * (by_chip + material.edge_tangential_n_per_mm);
            let radial = depth_mm * (material.radial_ratio * by_chip + material.edge_radial_n_per_mm);
            (angle, [-tangential * cos - radial * sin, tangential * sin - radial * cos].map(|force| weight * force))
        })
        .collect();
    let [x, y] = [tool.mode_x, tool.mode_y];
    [(0, x), (1, y)].map(|(axis, mode)| {
        let mut deflection_mm = vec![0.0; PLACES];
        for harmonic in 0..HARMONICS {
            let order = edges * f64::from(harmonic);
            let (mut re, mut im) = (0.0, 0.0);
            for (angle, force) in &arc {
                let (sin, cos) = libm::sincos(order * angle);
                (re, im) = (re + force[axis] * cos, im - force[axis] * sin);
            }
            let ratio = order * rev_per_min / 60.0 / mode.frequency_hz;
            let (stiff, damped) = (1.0 - ratio * ratio, 2.0 * mode.damping_ratio * ratio);
            let scale = edges / TAU * if harmonic == 0 { 1.0 } else { 2.0 }
                / (mode.stiffness_n_per_mm * (stiff * stiff + damped * damped));
            let (re, im) = (scale * (re * stiff + im * damped), scale * (im * stiff - re * damped));
            for (place, deflection_mm) in deflection_mm.iter_mut().enumerate() {
                let (sin, cos) = libm::sincos(order * TAU * place as f64 / PLACES as f64);
                *deflection_mm += re * cos - im * sin;
            }
        }
        deflection_mm
    })
}

#[test]
fn the_deflection_is_that_of_the_harmonics_of_the_force_whatever_the_sample_rate() {
    let edge = Material { edge_tangential_n_per_mm: 22.0, edge_radial_n_per_mm: 31.0, ..Material::default() };
    for (entry_deg, exit_deg, material) in [(90.0, 180.0, Material::default()), (25.0, 130.0, edge), (0.0, 90.0, edge)]
    {
        let description = Description {
            process: Process::Milling { entry_deg, exit_deg },
            material,
            tool: Tool { run_out_mm: 0.0, ..Tool::default() },
            contacts: everywhere(1.0),
            tool_sensors: exact(Quantity::Displacement),
            ..Description::default()
        };
        let expected = deflection_by_harmonics(&description, 1_200.0, 3_000.0);
        let largest = expected.iter().flatten().fold(0.0_f64, |most, value| most.max(value.abs()));
        // Of every turn of 20 ms the last samples, of 0.9° and more.
        for (sample_rate_hz, step) in [(20_000, 1), (10_000, 2), (4_000, 5), (2_000, 10)] {
            let path = Path::default().add(202, 1_200.0, 3_000.0, [1.0, 0.0]).clone();
            let log = follow(Description { sample_rate_hz, ..description.clone() }, &path);
            for (measured, expected) in log.tool.iter().zip(&expected) {
                let turn = &measured[9 * 400 / step..][..400 / step];
                for (measured, expected) in turn.iter().zip(expected.iter().step_by(step)) {
                    assert!((measured - expected).abs() < 1e-4 * largest, "{sample_rate_hz} Hz: {measured} {expected}");
                }
            }
        }
    }
}

#[test]
fn edges_pass_at_their_frequency_and_run_out_adds_that_of_the_spindle() {
    // 3000 rev/min, 2 edges, half immersion: 50 Hz and 100 Hz. Power by direct sums over whole revolutions.
    let power = |log: &common::Log, frequency_hz: f64| {
        let values = &log.tool[1][2000..12_000];
        let sum = values.iter().enumerate().fold((0.0, 0.0), |(re, im), (index, value)| {
            let (sin, cos) = libm::sincos(TAU * frequency_hz * index as f64 / 20_000.0);
            (re + value * cos, im + value * sin)
        });
        libm::hypot(sum.0, sum.1) / 5000.0
    };
    let mut description = milling(2);
    description.process = Process::Milling { entry_deg: 90.0, exit_deg: 180.0 };
    let mut path = Path::default().add(650, 300.0, 3000.0, [1.0, 0.0]).clone();
    // A sample is 0.9°: half of it keeps every sample clear of entry and exit.
    path.angle_deg.iter_mut().for_each(|angle| *angle += 0.45);
    let even = follow(description.clone(), &path);
    assert!(power(&even, 100.0) > 1e-3 && power(&even, 50.0) < 1e-12);
    description.tool.edge_run_out_mm = 0.01;
    let uneven = follow(description, &path);
    assert!(power(&uneven, 50.0) > 0.1 * power(&uneven, 100.0));
}

#[test]
fn the_surface_run_out_is_seen_where_it_rotates() {
    let mut description = milling(4);
    description.contacts.clear();
    description.tool.run_out_mm = 0.004;
    description.work_sensors = exact(Quantity::Displacement);
    let path = Path::default().add(200, 200.0, 1000.0, [1.0, 0.0]).clone();
    let log = follow(description.clone(), &path);
    for ((x, y), angle) in log.tool[0].iter().zip(&log.tool[1]).zip(&log.spindle_angle_deg) {
        assert!(
            (x - 0.004 * libm::cos(angle.to_radians())).abs() < 1e-15
                && (y + 0.004 * libm::sin(angle.to_radians())).abs() < 1e-15
        );
    }
    assert!(log.work[0].iter().all(|&value| value == 0.0));
    description.process = Process::Turning;
    let log = follow(description, &path);
    assert!(log.tool[0].iter().all(|&value| value == 0.0) && log.work[0][0] == 0.004);
}

#[test]
fn accelerometers_feel_the_commanded_motion_too_and_strain_gauges_the_deflection() {
    let mut description = turning();
    description.tool_sensors = exact(Quantity::Acceleration);
    description.contacts.clear();
    let mut path = Path::default();
    for index in 0..300 {
        // 2 m/s² along X, from rest.
        let t = f64::from(index) * 1e-3;
        path.add(1, 0.0, 1000.0, [1.0, 0.0]);
        *path.axes[0].last_mut().unwrap() = 0.5 * 2000.0 * t * t;
    }
    let log = follow(description, &path);
    for at in 100..5000 {
        assert!((log.tool[0][at] - 2000.0).abs() < 1e-3 && (log.commanded[0][at] - 2000.0).abs() < 1e-3);
        assert_eq!((log.tool[1][at], log.commanded[1][at]), (0.0, 0.0));
    }
    let strain = Description { tool_sensors: exact(Quantity::Strain { mm_per_strain: 50.0 }), ..turning() };
    let log = follow(strain, Path::default().add(100, 100.0, 1000.0, [1.0, 0.0]));
    assert!((log.tool[0].last().unwrap() - 0.012 / 50.0).abs() < 1e-12);
}

#[test]
fn contact_is_a_stretch_with_feed_and_a_turning_spindle() {
    let mut description = turning();
    description.contacts = vec![Contact { at: Where::Path { from_mm: 0.1, to_mm: 0.2 }, depth_mm: 1.0 }];
    // 0.1 mm in 60 ms; a stop of 50 ms inside.
    let mut path = Path::default();
    path.add(91, 100.0, 1000.0, [1.0, 0.0]).add(50, 0.0, 1000.0, [1.0, 0.0]).add(100, 100.0, 1000.0, [1.0, 0.0]);
    let log = follow(description.clone(), &path);
    let touching = |from_ms: usize, to_ms: usize| log.contact[from_ms * 20..to_ms * 20].iter().all(|&contact| contact);
    let free = |from_ms: usize, to_ms: usize| !log.contact[from_ms * 20..to_ms * 20].iter().any(|&contact| contact);
    assert!(free(0, 60) && touching(61, 90) && free(91, 140) && touching(142, 170) && free(171, 239));
    assert!(log.tool[0][2500] == 0.0 || log.tool[0][2500].abs() < 1e-12, "no chip, no force");
    let mut still = Path::default();
    still.add(100, 200.0, 0.0, [1.0, 0.0]);
    assert!(!follow(description, &still).contact.iter().any(|&contact| contact));
}

#[test]
fn speed_fluctuates_sway_is_shared_and_chatter_comes_on_demand() {
    let mut description = turning();
    description.ripple = Ripple { fraction: 0.02, frequency_hz: 10.0 };
    description.sway = Some(Sway { amplitude_mm: 0.01, frequency_hz: 25.0 });
    description.work_sensors = exact(Quantity::Displacement);
    description.chatter = vec![Chatter {
        at: Where::Time { from_s: 0.1, to_s: 0.2 },
        frequency_hz: 333.0,
        amplitude_mm: 0.005,
        direction_deg: 0.0,
    }];
    let path = Path::default().add(300, 100.0, 1000.0, [1.0, 0.0]).clone();
    let log = follow(description, &path);
    let most = log.rev_per_min.iter().copied().fold(0.0, f64::max);
    let least = log.rev_per_min.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((most - 1020.0).abs() < 0.1 && (least - 980.0).abs() < 0.1, "{least}..{most}");
    let turned = log.spindle_angle_deg[4000] - log.spindle_angle_deg[0];
    assert!((turned - 360.0 * 1000.0 / 60.0 * 0.2).abs() < 6e-8, "whole periods of the fluctuation cancel");
    assert!((log.work[0][200] - 0.01).abs() < 1e-12, "10 ms are a quarter of the sway's period");
    for at in 100..5800 {
        let relative = log.tool[0][at] - log.work[0][at] - 0.012;
        let t = log.time_ns[at] as f64 * 1e-9;
        let expected = if (2000..4000).contains(&at) { 0.005 * libm::sin(TAU * 333.0 * t) } else { 0.0 };
        assert!((relative - expected).abs() < 1e-9, "{at}: {relative} {expected}");
    }
}

#[test]
fn noise_outliers_drift_and_lost_samples_have_their_rates() {
    let mut description = turning();
    description.contacts.clear();
    description.drop_rate = 0.01;
    description.tool_sensors = Some(SensorPair {
        stand_off: 1.0,
        noise: 1e-3,
        outlier_rate: 0.002,
        outlier_size: 0.5,
        drift_per_s: 0.01,
        ..SensorPair::default()
    });
    let log = follow(description, Path::default().add(5001, 100.0, 1000.0, [1.0, 0.0]));
    let sent = log.time_ns.len() as f64;
    assert!((sent - 99_000.0).abs() < 300.0, "{sent}");
    let wrong = log.tool.iter().flatten().filter(|value| (*value - 1.025).abs() > 0.2).count();
    assert!((150..250).contains(&wrong), "{wrong}");
    let rest = |from_s: u64, to_s: u64| {
        let values = log.time_ns.iter().zip(&log.tool[0]).filter(|(time, value)| {
            (from_s * 1_000_000_000..to_s * 1_000_000_000).contains(*time) && (*value - 1.025).abs() < 0.2
        });
        let values: Vec<f64> = values.map(|(_, value)| *value).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
    };
    let ((first, _), (last, _)) = (rest(0, 1), rest(4, 5));
    assert!((last - first - 0.04).abs() < 1e-4, "{first} {last}");
    // 1e-3 of noise and 0.01 mm of drift over a second, spread evenly: σ² = 1e-6 + 1e-4/12.
    assert!((rest(0, 1).1 - libm::sqrt(1e-6 + 1e-4 / 12.0)).abs() < 1e-4);
}

/// A tool whose lobes are known: deep cuts chatter, shallow ones do not.
fn regenerative(depth_mm: f64) -> Description {
    Description {
        process: Process::Milling { entry_deg: 90.0, exit_deg: 180.0 },
        tool: Tool {
            mode_x: Mode { frequency_hz: 600.0, damping_ratio: 0.03, stiffness_n_per_mm: 10_000.0 },
            mode_y: Mode { frequency_hz: 660.0, damping_ratio: 0.03, stiffness_n_per_mm: 10_000.0 },
            run_out_mm: 0.0,
            ..Tool::default()
        },
        material: Material { tangential_n_per_mm2: 700.0, ..Material::default() },
        contacts: everywhere(depth_mm),
        regenerative: true,
        sample_rate_hz: 50_000,
        ..turning()
    }
}

#[test]
fn regeneration_chatters_above_the_stability_limit_and_not_below() {
    let lobes = regenerative(1.0).milling_model().unwrap().lobes().unwrap();
    // Difference of the deflection from one revolution to the next: what is periodic with the spindle cancels.
    let unsteady = |depth_mm: f64, rev_per_min: f64| {
        let revolution = (50_000.0 * 60.0 / rev_per_min) as usize;
        let mut path = Path::default().add(1500, 0.05 * 4.0 * rev_per_min, rev_per_min, [1.0, 0.0]).clone();
        // Half a sample clear of entry and exit.
        path.angle_deg.iter_mut().for_each(|angle| *angle += 180.0 / revolution as f64);
        let log = follow(regenerative(depth_mm), &path);
        let last = &log.tool[1][log.tool[1].len() - 10 * revolution..];
        let difference = |pair: (&f64, &f64)| (pair.0 - pair.1).abs();
        last.iter().zip(&last[revolution..]).map(difference).fold(0.0, f64::max)
    };
    // 50 kHz · 60/rev_per_min is a whole number of samples.
    for rev_per_min in [6000.0, 7500.0, 10_000.0] {
        let limit_mm = lobes.limit_mm(rev_per_min).unwrap().unwrap();
        let (stable, unstable) = (unsteady(0.7 * limit_mm, rev_per_min), unsteady(1.4 * limit_mm, rev_per_min));
        assert!(stable < 1e-4, "{rev_per_min} rev/min, {limit_mm} mm: {stable} mm below the limit");
        // Edges that jump out of the cut keep the vibration bounded: to some chips, not some tools.
        assert!((0.01..1.0).contains(&unstable), "{rev_per_min} rev/min, {limit_mm} mm: {unstable} mm above the limit");
    }
}
