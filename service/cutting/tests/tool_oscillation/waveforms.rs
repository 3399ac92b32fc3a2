//! Closed forms against numerics, and what every waveform and the phase have to hold.

use feedwave_cutting::tool_oscillation::{
    BLEND_STEEPNESS, ConditionTable, Interpolation, LeadingEdge, MAX_HOLD_SHARE, RoleRotation, TableQuantity,
    ToolOscillation, Wave, Waveform, WaveformError, blend, ramp_mm,
};
use proptest::prelude::*;

use super::{assert_near, condition, tool};

fn waveform() -> impl Strategy<Value = Waveform> {
    let share = || prop_oneof![Just(0.0), Just(0.3), 0.0..=MAX_HOLD_SHARE];
    prop_oneof![
        Just(Waveform::Sine),
        share().prop_map(|hold_share| Waveform::HeldPeak { hold_share }),
        share().prop_map(|hold_share| Waveform::JerkLimitedHeldPeak { hold_share }),
        table(),
    ]
}

/// Points at least a fiftieth apart with one value at ±1.
fn table() -> impl Strategy<Value = Waveform> {
    let values = proptest::collection::vec((-1.0..=1.0f64, 0.0..0.6f64), 2..12);
    (values, any::<bool>()).prop_map(|(values, up)| {
        let count = values.len() as f64;
        let mut points: Vec<[f64; 2]> =
            (0u32..).zip(&values).map(|(index, (value, shift))| [(f64::from(index) + shift) / count, *value]).collect();
        points[0][1] = if up { 1.0 } else { -1.0 };
        Waveform::Table { points }
    })
}

/// Largest |difference quotients| of orders 1 to 3 on a fine grid, between joints.
fn numeric_peaks(wave: &Wave) -> [f64; 3] {
    let (count, step) = (4_000u32, 1.0 / 4_000.0);
    let mut peaks = [0.0f64; 3];
    for index in 0..count {
        let x = f64::from(index) * step;
        let at = |k: f64| wave.value(x + k * step);
        peaks[0] = peaks[0].max(((at(0.5) - at(-0.5)) / step).abs());
        peaks[1] = peaks[1].max(((at(1.0) - 2.0 * at(0.0) + at(-1.0)) / step / step).abs());
        peaks[2] = peaks[2].max(((at(1.5) - 3.0 * at(0.5) + 3.0 * at(-0.5) - at(-1.5)) / step / step / step).abs());
    }
    peaks
}

#[test]
fn peaks_are_those_of_the_numeric_derivatives() {
    for waveform in [
        Waveform::Sine,
        Waveform::HeldPeak { hold_share: 0.0 },
        Waveform::HeldPeak { hold_share: 0.3 },
        Waveform::JerkLimitedHeldPeak { hold_share: 0.0 },
        Waveform::JerkLimitedHeldPeak { hold_share: 0.3 },
        Waveform::JerkLimitedHeldPeak { hold_share: 0.1 },
    ] {
        let wave = waveform.compile().expect("possible");
        let (peaks, [first, second, third]) = (wave.peaks(), numeric_peaks(&wave));
        assert_near(first, peaks.first, 2e-3 * peaks.first);
        assert_near(second, peaks.second, 5e-3 * peaks.second);
        if peaks.second_step == 0.0 {
            assert_near(third, peaks.third, 1.5e-2 * peaks.third);
        } else {
            // The step divided by the width of the stencil exceeds everything.
            assert!(third > 10.0 * peaks.third, "{third} for {waveform:?}");
        }
    }
}

#[test]
fn a_table_of_a_sine_is_nearly_one() {
    let points = (0..64).map(|index| f64::from(index) / 64.0);
    let points = points.map(|phase| [phase, feedwave_cutting::sin_turns(phase)]).collect();
    let wave = Waveform::Table { points }.compile().expect("possible");
    for step in 0..1_000 {
        let turns = f64::from(step) * 0.001 - 0.3;
        assert_near(wave.value(turns), feedwave_cutting::sin_turns(turns), 2e-3);
    }
    assert_near(wave.trough().0, 0.75, 1e-12);
}

#[test]
fn a_level_part_of_a_table_is_its_hold() {
    let points = vec![[0.1, 1.0], [0.4, 1.0], [0.6, -1.0], [0.9, -1.0]];
    let wave = Waveform::Table { points }.compile().expect("possible");
    assert_near(wave.trough().0, 0.75, 1e-12);
    assert_near(wave.trough().1, 0.3, 1e-12);
    assert_near(wave.crest().0, 0.25, 1e-12);
    assert_eq!(wave.value(0.7), -1.0);
    assert!(wave.peaks().second_step > 0.0);
}

#[test]
fn impossible_waveforms_are_refused() {
    let refused = |waveform: Waveform| waveform.compile().expect_err("impossible");
    assert_eq!(refused(Waveform::HeldPeak { hold_share: 0.5 }), WaveformError::HoldShare(0.5));
    assert!(matches!(
        refused(Waveform::JerkLimitedHeldPeak { hold_share: f64::NAN }),
        WaveformError::HoldShare(share) if share.is_nan()
    ));
    assert_eq!(refused(Waveform::Table { points: vec![[0.0, 1.0]] }), WaveformError::PointCount(1));
    let points = vec![[0.0, 1.0], [0.5, 0.0], [0.5, -1.0]];
    assert_eq!(refused(Waveform::Table { points }), WaveformError::Phase { number: 3, phase: 0.5 });
    // The last point is the first one's neighbour too.
    let points = vec![[0.0, 1.0], [0.9999, -1.0]];
    assert_eq!(refused(Waveform::Table { points }), WaveformError::Phase { number: 1, phase: 0.0 });
    let points = vec![[0.0, 0.5], [0.5, -0.75]];
    assert_eq!(refused(Waveform::Table { points }), WaveformError::Peak(0.75));
    let points = vec![[0.0, 1.0], [0.5, f64::NAN]];
    assert!(matches!(refused(Waveform::Table { points }), WaveformError::Peak(peak) if peak.is_nan()));
}

#[test]
fn a_blend_keeps_the_amplitude_within_the_section() {
    let steepest = (1..=10_000).map(|step| f64::from(step) / 10_000.0).map(|x| blend(x) / x).fold(0.0, f64::max);
    assert!(steepest <= BLEND_STEEPNESS && steepest > BLEND_STEEPNESS - 1e-3, "{steepest}");
    assert_eq!((blend(-1.0), blend(0.0), blend(1.0), blend(7.0)), (0.0, 0.0, 1.0, 1.0));
    // A whole number of periods, at least the one asked for.
    assert_eq!(ramp_mm(2, 1.0, 0.4, false), 2.0);
    assert_eq!(ramp_mm(2, 0.1, 0.4, false), 5.0 * 0.1);
    assert_eq!(ramp_mm(2, 0.1, 0.4, true), 0.2);
}

#[test]
fn tables_are_read_between_and_at_their_ends() {
    let mut table = ConditionTable {
        quantity: TableQuantity::FeedAmplitude,
        interpolation: Interpolation::Linear,
        feed_mm_per_min: vec![100.0, 200.0, 400.0],
        spindle_rev_per_min: vec![500.0, 1_000.0],
        values: vec![vec![0.1, 0.2, 0.2], vec![0.3, 0.4, 0.4]],
    };
    assert_eq!(table.problem(), None);
    assert_near(table.value(150.0, 750.0), 0.25, 1e-15);
    assert_near(table.value(1.0, 1.0), 0.1, 1e-15);
    assert_near(table.value(9_999.0, 9_999.0), 0.4, 1e-15);
    table.interpolation = Interpolation::Monotone;
    for step in 0..=300 {
        let value = table.value(100.0 + f64::from(step), 500.0);
        assert!((0.1..=0.2).contains(&value), "{value}");
    }
    assert_near(table.value(200.0, 500.0), 0.2, 1e-15);
    table.values.pop();
    assert!(table.problem().is_some());
}

#[test]
fn roles_rotate_the_same_way_every_time() {
    let mut leading = LeadingEdge { edge: 3, phase_deg: 0.0, rotation: RoleRotation::EveryParts(10) };
    let edges: Vec<u32> = [0, 9, 10, 20, 40].map(|parts| leading.edge_after(parts, 0.0, 4)).to_vec();
    assert_eq!(edges, [3, 3, 4, 1, 3]);
    leading.rotation = RoleRotation::EverySeconds(60.0);
    assert_eq!(
        [59.9, 60.0, 1e30].map(|seconds| leading.edge_after(7, seconds, 4)),
        [3, 4, leading.edge_after(0, 1e30, 4)]
    );
    leading.rotation = RoleRotation::EveryParts(0);
    assert_eq!(leading.edge_after(1_000, 0.0, 4), 3);
}

proptest! {
    #[test]
    fn waveforms_are_periodic_continuous_and_within_one(waveform in waveform(), turns in -3.0..3.0f64) {
        let wave = waveform.compile().expect("possible");
        let value = wave.value(turns);
        prop_assert!(value.abs() <= 1.0 + 1e-12);
        prop_assert!((wave.value(turns + 5.0) - value).abs() <= 1e-12 * (1.0 + wave.peaks().first));
        let near = wave.value(turns + 1e-7);
        prop_assert!((near - value).abs() <= 1e-7 * wave.peaks().first * (1.0 + 1e-6) + 1e-12);
        let mut filled = [0.0];
        wave.fill(&[turns], &mut filled);
        prop_assert_eq!(filled[0].to_bits(), value.to_bits());
    }

    #[test]
    fn derivatives_stay_below_their_peaks(waveform in waveform(), turns in 0.0..1.0f64) {
        let wave = waveform.compile().expect("possible");
        let (peaks, step) = (wave.peaks(), 1e-4);
        let at = |k: f64| wave.value(turns + k * step);
        let second = (at(1.0) - 2.0 * at(0.0) + at(-1.0)) / (step * step);
        prop_assert!(second.abs() <= peaks.second * (1.0 + 1e-6) + 1e-5, "{} of {}", second, peaks.second);
        prop_assert!(wave.value(wave.trough().0) <= wave.value(turns) + 1e-9);
        prop_assert!(wave.value(wave.crest().0) >= wave.value(turns) - 1e-9);
    }

    #[test]
    fn the_phase_is_locked_to_the_spindle_whatever_its_speed(
        speeds in proptest::collection::vec(0.0..200.0f64, 1..50),
        edge in 0usize..4,
        periods in prop_oneof![Just(1u32), Just(2), Just(4)],
        feed_turns in -0.5..0.5f64,
    ) {
        let tool = tool();
        let oscillation = ToolOscillation::new(&tool, &condition(), periods, edge as u32 + 1).expect("possible");
        // However the spindle got there: at the leading edge's angle the phase is the condition's.
        let turned: f64 = speeds.iter().map(|speed| speed * 0.01).sum();
        let spindle = turned.floor() + tool.edges[edge].angle_deg / 360.0 + feed_turns;
        let phase = oscillation.phase_turns(spindle, feed_turns);
        prop_assert!((phase - phase.round()).abs() < 1e-9, "{}", phase);
    }
}
