//! Directions that lead straight through a pole, from every side of it.

use feedwave_cutting::PlanQuality;

use crate::common::machines::{config_of, direction_at, kinds};
use crate::common::measured::worst_use;
use crate::common::{run, validate};
use feedwave_motion::kinematics::vector::{Vec3, add_scaled, cross, dot, norm, scale};

/// Where the tool is parallel to the first rotary axis: the direction that does not change as that axis turns.
fn pole(config: &feedwave_cutting::PipelineConfig) -> Vec3 {
    let turned = |second_deg: f64, first_deg: f64| direction_at(config, [first_deg, second_deg]);
    let moved = |second_deg: f64| {
        let [a, b] = [turned(second_deg, 0.0), turned(second_deg, 90.0)];
        norm(add_scaled(a, b, -1.0))
    };
    let mut best = 0.0;
    let mut step = 1.0;
    for _ in 0..12 {
        let around = (-180..=180).map(|k| best + step * f64::from(k));
        best = around.min_by(|a, b| moved(*a).total_cmp(&moved(*b))).expect("angles");
        step *= 0.02;
    }
    turned(best, 0.0)
}

/// A direction beside the pole by so many degrees on this side of it.
fn beside(pole: Vec3, tilt_deg: f64, side_deg: f64) -> Vec3 {
    let other = if pole[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let first = add_scaled(other, pole, -dot(other, pole));
    let first = scale(first, 1.0 / norm(first));
    let (sine, cosine) = side_deg.to_radians().sin_cos();
    let aside = add_scaled(scale(first, cosine), cross(pole, first), sine);
    let (sine, cosine) = tilt_deg.to_radians().sin_cos();
    add_scaled(scale(pole, cosine), aside, sine)
}

/// Where the first rotary axis begins to turn beside the pole is at the start of the block, but for rounding.
#[test]
fn a_block_straight_through_a_pole_starts_and_ends_at_rest() {
    let mut blocks = 0;
    let mut machines: Vec<_> = kinds().into_iter().map(|(name, kind)| (name, config_of(kind))).collect();
    machines.push(("trunnion", super::machine::config()));
    for (name, mut config) in machines {
        // What rounding leaves of a piece without length is another thing far from the zero of the machine.
        config.profile.language.work_offsets[0][..3].copy_from_slice(&[-25.0, -15.0, -500.0]);
        let pole = pole(&config);
        for quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
            config.profile.plan_quality = quality;
            for tilt_deg in [0.1, 3.0, 5.0] {
                for side_deg in (0..360).step_by(20) {
                    let words = |side_deg: f64| {
                        let [i, j, k] = beside(pole, tilt_deg, side_deg);
                        format!("I{i:.10} J{j:.10} K{k:.10}")
                    };
                    let side_deg = f64::from(side_deg);
                    let program = format!(
                        "G21 G17 G90 G94 T1 M6\nS8000 M3\nG43.5 H1\nG0 X0 Y0 Z0 {}\nG1 X1 {} F1000\nG49\nM30\n",
                        words(side_deg),
                        words(side_deg + 180.0)
                    );
                    // The axes of some do not come close to their pole.
                    let found = validate(&program, &config).findings;
                    if found.iter().any(|finding| finding.code == "FIVE-AXIS-UNREACHABLE") {
                        continue;
                    }
                    blocks += 1;
                    let setpoints = run(&program, &config);
                    let (used, at) = worst_use(&setpoints, &config, 1e-9);
                    let worst = used.into_iter().fold(0.0, f64::max);
                    assert!(
                        worst <= 1.0 + 1e-6,
                        "{name}, {tilt_deg} deg, side {side_deg}: {used:?} at {at:?}\n{program}"
                    );
                }
            }
        }
    }
    assert!(blocks > 500, "{blocks} blocks");
}
