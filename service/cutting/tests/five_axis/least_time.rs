//! Five axes planned for the least time, under live changes of the feed: every axis within its limits at every setpoint, and the
//! same bits however the stream is made.

use feedwave_cutting::{OverrideChange, PipelineConfig, PlanQuality};
use proptest::prelude::*;

use super::freeform;
use super::machine::config;
use crate::common::{Setpoints, all_bits, resume, run, run_appending, snapshots};

/// Polynomials hold the axes of a chain to 1e-10 mm or degrees; differences of setpoints take a multiple of it.
const FIT: f64 = 1e-9;

/// A machine that passes no corner with a step of velocity, planned for the least time.
fn least_time(overrides: &[(u64, f64)]) -> PipelineConfig {
    let mut config = config();
    config.profile.plan_quality = PlanQuality::LeastTime;
    for axis in &mut config.profile.machine.axes {
        axis.max_velocity_step_per_s = 0.0;
    }
    config.overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    config
}

/// A pass over a freeform surface, every block of it, and a wave of short blocks with turning axes.
fn programs() -> [String; 2] {
    let freeform = freeform::program(1, 40).replace("M33\n", "").replace("M34\n", "");
    let mut wave = String::from("G43.4 H1\nG0 X0 Y0 Z20 A-20 C0\nG1 F12000\n");
    for k in 1..=250 {
        let t = 0.05 * f64::from(k);
        wave += &format!(
            "X{:.4} Y{:.4} Z{:.4} A{:.4} C{:.4}\n",
            8.0 * t,
            3.0 * t.sin(),
            20.0 + 0.5 * (1.3 * t).sin(),
            -20.0 - 4.0 * (0.7 * t).sin(),
            6.0 * t
        );
    }
    [format!("G64 P0.02\n{freeform}"), format!("G64 P0.02\n{wave}M30\n")]
}

/// First, second and third differences of every axis stay within its limits.
pub fn check_limits(setpoints: &Setpoints, config: &PipelineConfig) -> Result<(), TestCaseError> {
    let h = config.period_s();
    for (axis, column) in config.profile.machine.axes.iter().zip(&setpoints.axes) {
        for (k, p) in column.windows(4).enumerate() {
            let velocity = (p[3] - p[2]) / h;
            let acceleration = (p[3] - 2.0 * p[2] + p[1]) / (h * h);
            let jerk = (p[3] - 3.0 * p[2] + 3.0 * p[1] - p[0]) / (h * h * h);
            let line = setpoints.line[k];
            let holds = |value: f64, limit: f64, noise: f64| value.abs() <= limit * (1.0 + 1e-6) + noise;
            let name = &axis.name;
            prop_assert!(holds(velocity, axis.max_velocity_per_s, FIT / h), "{velocity} of {name} at {k}, line {line}");
            let noise = FIT / (h * h);
            prop_assert!(
                holds(acceleration, axis.max_acceleration_per_s2, noise),
                "{acceleration} of {name} at {k}, line {line}"
            );
            prop_assert!(holds(jerk, axis.max_jerk_per_s3, noise / h), "{jerk} of {name} at {k}, line {line}");
        }
    }
    Ok(())
}

fn changes() -> impl Strategy<Value = Vec<(u64, f64)>> {
    let ratio = prop_oneof![3 => 0.05..1.5_f64, 1 => Just(0.0), 1 => Just(1.0)];
    (prop::collection::vec((20..700_u64, ratio), 1..8), 0.4..1.3_f64).prop_map(|(steps, last)| {
        let mut index = 0;
        let mut changes: Vec<_> = Vec::new();
        for (step, ratio) in steps {
            index += step;
            changes.push((index, ratio));
        }
        changes.push((index + 600, last));
        changes
    })
}

#[test]
fn five_axes_take_less_time_within_their_limits() {
    for program in programs() {
        let config = least_time(&[]);
        let mut fast = least_time(&[]);
        fast.profile.plan_quality = PlanQuality::Fast;
        let [fast, least] = [run(&program, &fast), run(&program, &config)];
        check_limits(&least, &config).expect("within the limits");
        assert!(least.len() <= fast.len(), "{} and {}", least.len(), fast.len());
        for (index, offset, snapshot) in snapshots(program.as_bytes(), &config) {
            let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
            assert_eq!(first, index);
            assert!(all_bits(&rest) == all_bits(&least)[index as usize..], "resumed at {index}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    #[test]
    fn live_changes_of_the_feed_keep_five_axes_within_their_limits(changes in changes(), most in 1..400_usize, wave: bool) {
        let program = &programs()[usize::from(wave)];
        let configured = least_time(&changes);
        let whole = run(program, &configured);
        check_limits(&whole, &configured)?;
        let end = |setpoints: &Setpoints| setpoints.bits(setpoints.len() - 1)[..5].to_vec();
        prop_assert_eq!(end(&whole), end(&run(program, &least_time(&[]))), "the end is the same to the bit");
        let appended = run_appending(program, &least_time(&[]), &configured.overrides, most);
        prop_assert!(all_bits(&appended) == all_bits(&whole), "appended changes give other bits");
        for (index, offset, snapshot) in snapshots(program.as_bytes(), &configured) {
            let (first, rest) = resume(program.as_bytes(), &configured, offset, &snapshot);
            prop_assert_eq!(first, index);
            prop_assert!(all_bits(&rest) == all_bits(&whole)[index as usize..], "resumed at {}", index);
        }
    }
}
