//! Random threads: resumption, limits, the phase at every spindle angle, and a follower behind any spindle.

use feedwave_cutting::PipelineConfig;
use feedwave_cutting::thread::{StartUp, ThreadFollower, ThreadPath};
use proptest::prelude::*;

use super::{check_limits, cutting, lathe, near, wave};
use crate::common::{resume, run, run_in_pieces, snapshots, validate};

/// A random thread.
#[derive(Clone, Debug)]
struct Thread {
    passes: Vec<(f64, f64, f64)>,
    lead_mm: f64,
    taper_mm: f64,
    rev_per_min: u32,
    reverse: bool,
    vibrates: bool,
    delayed: bool,
    combined: bool,
    inside: bool,
}

fn threads() -> impl Strategy<Value = Thread> {
    let pass = (0.01..0.15_f64, prop_oneof![Just(0.0), 0.0..359.0_f64], -0.4..0.4_f64);
    (
        prop::collection::vec(pass, 1..5),
        // Four passes of 0.15 mm make a groove of 0.69 mm, which no finer pitch has room for.
        0.7..4.0_f64,
        prop_oneof![Just(0.0), -1.0..1.0_f64],
        // What the axis can follow at the largest amplitude.
        100..640_u32,
        any::<[bool; 5]>(),
    )
        .prop_map(|(passes, lead_mm, taper_mm, rev_per_min, flags)| Thread {
            passes,
            lead_mm,
            taper_mm,
            rev_per_min,
            reverse: flags[0],
            vibrates: flags[1],
            delayed: flags[2],
            combined: flags[3],
            inside: flags[4],
        })
}

impl Thread {
    fn text(&self) -> String {
        let spindle = if self.reverse { "M4" } else { "M3" };
        let mut text = format!("G97 S{} {spindle}\nG0 X30. Z10.\n", self.rev_per_min);
        if self.vibrates {
            text += "G165 P3 X30. Q1.3\n";
        }
        let mut depth = 0.0;
        let clear = if self.inside { 24.0 } else { 36.0 };
        for (infeed, start_deg, shift_mm) in &self.passes {
            depth += infeed;
            let x = if self.inside { 30.0 + 2.0 * depth } else { 30.0 - 2.0 * depth };
            text += &format!("G0 X{clear:.1}\nG0 Z{:.3}\nG0 X{x:.4}\n", 10.0 + shift_mm);
            text += &format!("G32 X{:.4} Z-15. F{:.4} Q{start_deg:.3}\n", x + self.taper_mm, self.lead_mm);
        }
        text += &format!("G0 X{clear:.1}\n");
        if self.vibrates {
            text += "G165 P0\n";
        }
        text + "M30\n"
    }

    fn config(&self) -> PipelineConfig {
        let mut config = lathe();
        let settings = &mut config.profile.thread_vibration;
        settings.start_up = if self.delayed { StartUp::Delayed } else { StartUp::Preparatory };
        settings.combined_preparation = self.combined;
        config
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_stream_resumed_in_a_thread_is_the_original(thread in threads(), choice in any::<prop::sample::Index>(), piece in 1..100_usize) {
        let (program, config) = (thread.text(), thread.config());
        let original = run(&program, &config);
        prop_assert!(original == run_in_pieces(program.as_bytes(), &config, piece));
        let taken = snapshots(program.as_bytes(), &config);
        let (index, offset, snapshot) = choice.get(&taken);
        let (first, resumed) = resume(program.as_bytes(), &config, *offset, snapshot);
        prop_assert_eq!(first, *index);
        prop_assert_eq!(first as usize + resumed.len(), original.len());
        for k in 0..resumed.len() {
            prop_assert_eq!(original.bits(first as usize + k), resumed.bits(k), "setpoint {}", first as usize + k);
        }
    }

    #[test]
    fn limits_hold_and_figures_agree(thread in threads()) {
        let (program, config) = (thread.text(), thread.config());
        let report = validate(&program, &config);
        prop_assert!(report.is_accepted(), "{:?}", report.findings);
        let setpoints = run(&program, &config);
        let summary = &report.summary;
        prop_assert!(near(summary.cutting_time_s + summary.rapid_time_s + summary.rest_time_s, summary.duration_s, 1e-6));
        prop_assert!(near(summary.path_length_mm, *setpoints.path.last().unwrap(), 1e-6));
        check_limits(&setpoints, &config);
        // Never deeper than programmed, and at rest without retreat.
        prop_assert!(setpoints.vibration.iter().all(|offset| *offset >= 0.0));
        prop_assert_eq!(*setpoints.vibration.last().unwrap(), 0.0);
    }

    #[test]
    fn the_phase_at_a_spindle_angle_depends_on_nothing_else(thread in threads()) {
        prop_assume!(thread.vibrates);
        let (program, config) = (thread.text(), thread.config());
        let setpoints = run(&program, &config);
        let report = validate(&program, &config);
        let sign = if thread.reverse { -1.0 } else { 1.0 };
        let passes = report.threads.iter().flat_map(|section| &section.job.passes);
        let mut compared = 0;
        for pass in passes {
            let line = pass.span.line;
            let samples = cutting(&setpoints, line);
            let started_deg = sign * setpoints.spindle[samples[0]] + 360.0;
            for k in samples {
                let turned_deg = sign * setpoints.spindle[k];
                if turned_deg > started_deg {
                    let expected = wave(pass.amplitude_mm, turned_deg, pass.phase_shift_deg);
                    prop_assert!(near(setpoints.vibration[k], expected, 1e-9), "setpoint {k}");
                    compared += 1;
                }
            }
        }
        prop_assert!(compared > 0);
    }

    #[test]
    fn a_follower_plays_any_spindle(thread in threads(), steps in prop::collection::vec(-20.0..170.0_f64, 1..400)) {
        let report = validate(&thread.text(), &thread.config());
        let job = &report.threads[0].job;
        let pass = job.passes[0];
        let path = ThreadPath::of_pass(job, &pass);
        let sign = if thread.reverse { -1.0 } else { 1.0 };
        let mut follower = ThreadFollower::new(path.clone(), job.geometry.rotation, 17.0);
        // The first reading is before the reference point.
        let mut angle_deg = -1.0;
        follower.encoder(17.0 + sign * angle_deg).unwrap();
        for step_deg in steps {
            angle_deg += step_deg;
            let place = follower.encoder((17.0 + sign * angle_deg).rem_euclid(360.0)).unwrap();
            let expected = path.at(angle_deg);
            prop_assert!(near(place.radius_mm, expected.radius_mm, 1e-6) && near(place.z_mm, expected.z_mm, 1e-6));
            let ideal = job.position(&pass, angle_deg);
            prop_assert!(near(ideal.z_mm, expected.z_mm, 1e-9));
            if angle_deg < path.lead_end_deg() {
                prop_assert!(near(ideal.radius_mm, expected.radius_mm, 1e-9));
            }
        }
        prop_assert!(follower.encoder(f64::NAN).is_err());
    }
}
