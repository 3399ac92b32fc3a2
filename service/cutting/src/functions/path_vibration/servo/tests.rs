use proptest::prelude::*;

use super::*;

const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

fn condition(commanded_mm: f64, signed_amplitude_mm: f64, clamp: (f64, f64)) -> ServoCondition {
    ServoCondition { commanded_mm, signed_amplitude_mm, clamp_low_mm: clamp.0, clamp_high_mm: clamp.1 }
}

fn generate(
    previous: &ServoCondition,
    current: &ServoCondition,
    shared: &ServoWave,
    period_s: f64,
    substeps: usize,
) -> Vec<f64> {
    let mut wave = vec![0.0; substeps];
    let period = shared.fill(period_s, &mut wave);
    let mut positions_mm = vec![0.0; substeps];
    fill_servo_positions(previous, current, &wave, period, &mut positions_mm);
    positions_mm
}

#[test]
fn an_axis_without_vibration_is_interpolated_linearly() {
    let positions = generate(&condition(1.0, 0.0, FREE), &condition(2.0, 0.0, FREE), &ServoWave::OFF, 0.001, 4);
    assert_eq!(positions, [1.25, 1.5, 1.75, 2.0]);
}

#[test]
fn sub_periods_follow_the_wave_of_a_long_stream() {
    // 100 Hz at 1 ms: ten periods per vibration, each refined by eight; the command moves at 10 mm/s along Z.
    let (frequency_hz, period_s, substeps, amplitude_mm) = (100.0, 0.001, 8, -0.05);
    let mut previous = condition(0.0, amplitude_mm, FREE);
    for k in 1..=50u32 {
        let time_s = f64::from(k) * period_s;
        let current = condition(10.0 * time_s, amplitude_mm, FREE);
        let shared = ServoWave { on: true, frequency_hz, phase_turns: frequency_hz * time_s };
        let positions = generate(&previous, &current, &shared, period_s, substeps);
        for (i, position) in positions.iter().enumerate() {
            let sub_time_s = time_s - period_s * (substeps - 1 - i) as f64 / substeps as f64;
            let expected = 10.0 * sub_time_s + amplitude_mm * sin_turns(frequency_hz * sub_time_s);
            assert!((position - expected).abs() < 1e-12, "period {k}, servo period {i}");
        }
        previous = current;
    }
}

#[test]
fn a_section_that_starts_inside_the_period_vibrates_and_clamps_only_from_there() {
    // Three quarters into the period the section starts at 1.0 mm; before that the tool approaches from 0.7 mm.
    let current = condition(1.1, 0.5, (1.0, 5.0));
    let shared = ServoWave { on: true, frequency_hz: 100.0, phase_turns: 0.025 };
    let positions = generate(&condition(0.7, 0.0, FREE), &current, &shared, 0.001, 4);
    assert!((positions[0] - 0.8).abs() < 1e-12 && (positions[1] - 0.9).abs() < 1e-12, "{positions:?}");
    assert!((positions[2] - 1.0).abs() < 1e-12, "phase 0 has no offset: {positions:?}");
    assert_eq!(positions[3], 1.1 + 0.5 * sin_turns(0.025));
}

#[test]
fn positions_are_clamped_and_rejoin_the_wave() {
    let clamp = (0.0, 10.0);
    let shared = |k: u32| ServoWave { on: true, frequency_hz: 50.0, phase_turns: 0.05 * f64::from(k) };
    let at = |k: u32| condition(0.001 * f64::from(k), 0.03, clamp);
    let mut touched = 0;
    for k in 1..=200 {
        for (i, position) in generate(&at(k - 1), &at(k), &shared(k), 0.001, 5).into_iter().enumerate() {
            let k_exact = f64::from(k - 1) + (i + 1) as f64 / 5.0;
            let free = 0.001 * k_exact + 0.03 * sin_turns(0.05 * k_exact);
            assert!((position - free.max(0.0)).abs() < 1e-12);
            touched += u32::from(position == 0.0);
        }
    }
    assert!(touched > 20, "the start of the section must clamp the backward strokes, {touched} did");
}

proptest! {
    #[test]
    fn one_servo_period_equals_the_tangential_mode_to_the_bit(
        before in -100.0..100.0f64,
        commanded in -100.0..100.0f64,
        amplitude_before in -1.0..1.0f64,
        amplitude in -1.0..1.0f64,
        phase_turns in 0.0..10_000.0f64,
        low in -100.0..0.0f64,
        high in 0.0..100.0f64,
    ) {
        let shared = ServoWave { on: true, frequency_hz: 50.0, phase_turns };
        let previous = condition(before, amplitude_before, FREE);
        let current = condition(commanded, amplitude, (low, high));
        let positions = generate(&previous, &current, &shared, 0.001, 1);
        let tangential = (commanded + amplitude * sin_turns(phase_turns)).max(low).min(high);
        prop_assert_eq!(positions.len(), 1);
        prop_assert_eq!(positions[0].to_bits(), tangential.to_bits());
    }
}
