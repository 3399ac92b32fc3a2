//! What changes of the feed override are tried on, and what they have to keep.

use feedwave_cutting::PipelineConfig;
use proptest::prelude::*;

use super::Setpoints;

/// Differences of every axis stay within the limits of the machine.
pub fn check_limits(setpoints: &Setpoints, config: &PipelineConfig) -> Result<(), TestCaseError> {
    let h = config.period_s();
    for (axis, column) in config.profile.machine.axes.iter().zip(&setpoints.axes) {
        for (k, p) in column.windows(4).enumerate() {
            let velocity = (p[3] - p[2]) / h;
            let acceleration = (p[3] - 2.0 * p[2] + p[1]) / (h * h);
            let jerk = (p[3] - 3.0 * p[2] + 3.0 * p[1] - p[0]) / (h * h * h);
            // Positions round to 1e-14 mm.
            let noise = 1e-12 / (h * h * h);
            prop_assert!(velocity.abs() <= axis.max_velocity_per_s * (1.0 + 1e-6), "{velocity} at {k}");
            prop_assert!(acceleration.abs() <= axis.max_acceleration_per_s2 * (1.0 + 1e-6), "{acceleration} at {k}");
            prop_assert!(jerk.abs() <= axis.max_jerk_per_s3 * (1.0 + 1e-6) + noise, "{jerk} at {k} of {}", axis.name);
        }
    }
    Ok(())
}

/// A wavy cut of short blocks within a tolerance, close to the limits of the machine all along.
pub fn wave() -> String {
    let mut program = String::from("G21 G90 G94 G17 G64 P0.02\nG0 X0 Y0 Z0\nG1 F20000\n");
    for k in 1..=900 {
        let x = 0.2 * f64::from(k);
        program += &format!("X{x:.4} Y{:.4}\n", 4.0 * (0.35 * x).sin() + 1.5 * (0.11 * x).cos() - 1.5);
    }
    program + "M30\n"
}
