//! What setpoints ask of the axes, by finite differences.

use core::f64::consts::TAU;

use feedwave_cutting::PipelineConfig;

use super::Setpoints;

/// The positions of an axis; in servo-side mode those that one servo period per interpolation period gives, clamped.
pub fn positions(setpoints: &Setpoints, axis: usize) -> Vec<f64> {
    let mut positions = setpoints.axes[axis].clone();
    if let Some(amplitude) = setpoints.servo_amplitude.get(axis) {
        let clamps = setpoints.servo_low[axis].iter().zip(&setpoints.servo_high[axis]);
        let waves = amplitude.iter().zip(&setpoints.servo_phase);
        for ((position, (amplitude, phase)), (low, high)) in positions.iter_mut().zip(waves).zip(clamps) {
            *position = (*position + amplitude * (TAU * phase).sin()).max(*low).min(*high);
        }
    }
    positions
}

/// Largest ratio of velocity, acceleration and jerk of any axis to its limit by finite differences, and the place. Positions
/// are good to `fit`, mm or degrees, besides the rounding of their numbers.
pub fn worst_use(setpoints: &Setpoints, config: &PipelineConfig, fit: f64) -> ([f64; 3], [usize; 3]) {
    let h = config.period_s();
    let (mut worst, mut at) = ([0.0_f64; 3], [0; 3]);
    for (column, axis) in config.profile.machine.axes.iter().enumerate() {
        let positions = positions(setpoints, column);
        let farthest = positions.iter().fold(1.0_f64, |farthest, value| farthest.max(value.abs()));
        let noise = 16.0 * f64::EPSILON * farthest + fit;
        for (k, p) in positions.windows(4).enumerate() {
            let differences = [p[3] - p[2], (p[3] - p[2]) - (p[2] - p[1]), p[3] - 3.0 * (p[2] - p[1]) - p[0]];
            let limits = [axis.max_velocity_per_s, axis.max_acceleration_per_s2, axis.max_jerk_per_s3];
            for (order, (difference, limit)) in differences.into_iter().zip(limits).enumerate() {
                let order_i = order as i32 + 1;
                let found = (difference.abs() - 2.0_f64.powi(order_i) * noise).max(0.0) / h.powi(order_i) / limit;
                if found > worst[order] {
                    (worst[order], at[order]) = (found, k + 3);
                }
            }
        }
    }
    (worst, at)
}
