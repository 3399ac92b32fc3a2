//! Programs of all kinds of blocks in random order: every axis within its limits, the end exact.

use std::fmt::Write;

use crate::common::run;
use feedwave_cutting::{MachineProfile, OverrideChange, PipelineConfig, PlanQuality};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Block {
    /// Length, mm, and turn of direction before it, rad.
    Line(f64, f64),
    /// Many short lines that turn a little each.
    Chords(u32, f64, f64),
    /// Radius, sweep and rise.
    Arc(f64, f64, f64),
    /// Cubic spline: lengths of its two handles, distance and side step of its end.
    Spline(f64, f64, f64, f64),
    /// Back along the path.
    Reversal(f64),
    Control(&'static str),
    Feed(f64),
}

fn blocks() -> impl Strategy<Value = Vec<Block>> {
    let length = || (-3.0..1.5_f64).prop_map(|exponent| 10.0_f64.powf(exponent));
    let sign = || prop_oneof![Just(-1.0), Just(1.0)];
    let block = prop_oneof![
        4 => (length(), -3.0..3.0_f64).prop_map(|(length, turn)| Block::Line(length, turn)),
        2 => (length(), -2e-3..2e-3_f64).prop_map(|(length, turn)| Block::Line(length, turn)),
        2 => (3..60_u32, -3.0..-0.5_f64, -0.1..0.1_f64)
            .prop_map(|(count, exponent, turn)| Block::Chords(count, 10.0_f64.powf(exponent), turn)),
        3 => (0.2..20.0_f64, 0.05..5.0_f64, sign(), prop_oneof![Just(0.0), -5.0..5.0_f64])
            .prop_map(|(radius, sweep, side, rise)| Block::Arc(radius, side * sweep, rise)),
        // Handles of less than two thirds of the distance, and an end well ahead: it has no cusp, which would be refused.
        2 => (0.05..0.65_f64, 0.05..0.65_f64, 2.0..30.0_f64, -0.8..0.8_f64).prop_map(|(first, second, ahead, beside)| {
            Block::Spline(first * ahead, second * ahead, ahead, beside * ahead)
        }),
        1 => length().prop_map(Block::Reversal),
        2 => prop_oneof![
            Just("G61"), Just("G61.1"), Just("G64 P0.01"), Just("G64 P0.1 Q0.02"), Just("G64 P0.002 Q0"), Just("G64"),
        ].prop_map(Block::Control),
        1 => (100.0..25_000.0_f64).prop_map(Block::Feed),
    ];
    prop::collection::vec(block, 1..25)
}

fn quality() -> impl Strategy<Value = PlanQuality> {
    // Least time takes most of the time of these tests.
    prop_oneof![3 => Just(PlanQuality::Fast), 1 => Just(PlanQuality::LeastTime)]
}

/// The program, and where it ends.
fn program(blocks: &[Block], exact: bool) -> (String, [f64; 3]) {
    let mut text = String::from("G21 G90 G94 G17\nG0 X0 Y0 Z0\nF3000\n");
    let (mut at, mut heading) = ([0.0_f64; 3], 0.3_f64);
    let round = |value: f64| (value * 1e6).round() / 1e6;
    let line = |text: &mut String, at: &mut [f64; 3], length: f64, heading: f64| {
        at[0] = round(at[0] + length * heading.cos());
        at[1] = round(at[1] + length * heading.sin());
        writeln!(text, "G1 X{:.6} Y{:.6}", at[0], at[1]).unwrap();
    };
    for block in blocks {
        match *block {
            Block::Line(length, turn) => {
                heading += turn;
                line(&mut text, &mut at, length, heading);
            }
            Block::Chords(count, length, turn) => {
                for _ in 0..count {
                    heading += turn;
                    line(&mut text, &mut at, length, heading);
                }
            }
            Block::Reversal(length) => {
                heading += std::f64::consts::PI;
                line(&mut text, &mut at, length, heading);
            }
            Block::Arc(radius, sweep, rise) => {
                let side = sweep.signum();
                let to_center = [-side * radius * heading.sin(), side * radius * heading.cos()];
                let center = [at[0] + to_center[0], at[1] + to_center[1]];
                heading += sweep;
                at[0] = round(center[0] + side * radius * heading.sin());
                at[1] = round(center[1] - side * radius * heading.cos());
                at[2] = round(at[2] + rise);
                let code = if sweep < 0.0 { 2 } else { 3 };
                let [i, j] = to_center;
                writeln!(text, "G{code} X{:.6} Y{:.6} Z{:.6} I{i:.6} J{j:.6}", at[0], at[1], at[2]).unwrap();
            }
            Block::Spline(first, second, ahead, beside) => {
                let (sin, cos) = heading.sin_cos();
                let [i, j] = [first * cos, first * sin];
                at[0] = round(at[0] + ahead * cos - beside * sin);
                at[1] = round(at[1] + ahead * sin + beside * cos);
                heading += 0.4;
                let [p, q] = [-second * heading.cos(), -second * heading.sin()];
                writeln!(text, "G5 X{:.6} Y{:.6} I{i:.6} J{j:.6} P{p:.6} Q{q:.6}", at[0], at[1]).unwrap();
            }
            Block::Control(words) if !exact => writeln!(text, "{words}").unwrap(),
            Block::Control(_) => {}
            Block::Feed(feed) => writeln!(text, "F{feed:.1}").unwrap(),
        }
    }
    text.push_str("M30\n");
    (text, at)
}

fn check(
    blocks: &[Block],
    jerk: f64,
    period_us: u32,
    overrides: &[(u64, f64)],
    plan_quality: PlanQuality,
) -> Result<(), TestCaseError> {
    check_program(&program(blocks, false), jerk, period_us, overrides, plan_quality)
}

fn check_program(
    (text, end): &(String, [f64; 3]),
    jerk: f64,
    period_us: u32,
    overrides: &[(u64, f64)],
    plan_quality: PlanQuality,
) -> Result<(), TestCaseError> {
    let mut profile = MachineProfile { plan_quality, ..MachineProfile::mill() };
    for (axis, scale) in profile.machine.axes.iter_mut().zip([1.0, 0.8, 0.6]) {
        axis.max_jerk_per_s3 = jerk * scale;
        axis.max_acceleration_per_s2 *= scale;
    }
    let overrides = overrides.iter().map(|&(index, ratio)| OverrideChange { index, ratio }).collect();
    let config = PipelineConfig { interpolation_period_us: period_us, overrides, ..PipelineConfig::new(profile) };
    let setpoints = run(text, &config);
    let h = config.period_s();
    for (column, axis) in config.profile.machine.axes.iter().enumerate() {
        let p = &setpoints.axes[column];
        prop_assert_eq!(p.last().copied().unwrap_or_default(), end[column], "the end is the programmed point");
        let farthest = p.iter().fold(1.0_f64, |farthest, value| farthest.max(value.abs()));
        // A position rounds to an ulp or two of itself, an arc's or spline's also by its angle or parameter.
        let noise = 16.0 * f64::EPSILON * farthest + 2e-13;
        for (k, p) in p.windows(4).enumerate() {
            let velocity = (p[3] - p[2]) / h;
            let acceleration = ((p[3] - p[2]) - (p[2] - p[1])) / (h * h);
            let jerk = ((p[3] - p[2]) - 2.0 * (p[2] - p[1]) + (p[1] - p[0])) / (h * h * h);
            let holds = |found: f64, limit: f64, order: i32| {
                found.abs() <= limit * (1.0 + 1e-6) + 2.0_f64.powi(order) * noise / h.powi(order)
            };
            let place = || format!("{} at {k}, line {}\n{text}", axis.name, setpoints.line[k + 3]);
            prop_assert!(holds(velocity, axis.max_velocity_per_s, 1), "velocity {velocity} of {}", place());
            prop_assert!(
                holds(acceleration, axis.max_acceleration_per_s2, 2),
                "acceleration {acceleration} of {}",
                place()
            );
            prop_assert!(holds(jerk, axis.max_jerk_per_s3, 3), "jerk {jerk} of {}", place());
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn every_axis_keeps_its_limits(
        blocks in blocks(), jerk_exponent in 4.7..7.0_f64, period_us in prop_oneof![Just(1_000_u32), Just(2_000), Just(500)],
        quality in quality(),
    ) {
        check(&blocks, 10.0_f64.powf(jerk_exponent), period_us, &[], quality)?;
    }

    #[test]
    fn every_axis_keeps_its_limits_under_changes_of_the_override(
        blocks in blocks(), jerk_exponent in 4.7..7.0_f64,
        steps in prop::collection::vec((1..300_u64, prop_oneof![3 => 0.0..2.0_f64, 1 => Just(0.0)]), 1..8),
        quality in quality(),
    ) {
        let mut index = 0;
        let mut overrides = Vec::new();
        for (step, ratio) in steps {
            index += step;
            overrides.push((index, ratio));
        }
        overrides.push((index + 50, 1.0));
        check(&blocks, 10.0_f64.powf(jerk_exponent), 1_000, &overrides, quality)?;
    }
}

/// Feed holds of plans of the least time, near to corners: found by random programs.
#[test]
fn a_feed_hold_near_a_corner_keeps_the_limits() {
    let arcs = "G21 G90 G94 G17\nG0 X0 Y0 Z0\nF3000\nG1 X20.007457 Y6.189032\nF21595.0\nG64 P0.002 Q0\n\
                G3 X34.052319 Y26.512970 Z0.000000 I-5.907445 J19.097163\nG1 X34.997199 Y26.185552\n\
                G1 X35.005729 Y26.188002\nG5 X36.927987 Y26.740202 I7.938528 J2.280473 P-0.388870 Q-0.314293\n\
                G1 X37.695793 Y26.099519\nG2 X28.876543 Y20.780138 Z0.000000 I-3.490665 J-4.183277\n\
                G2 X56.282033 Y29.891953 Z0.000000 I14.210168 J3.029739\nM30\n";
    let holds = [(257, 1.516_987_815_459_784_2), (487, 0.0), (488, 0.0), (538, 1.0)];
    let program = (arcs.to_owned(), [56.282033, 29.891953, 0.0]);
    check_program(&program, 10.0_f64.powf(4.7), 1_000, &holds, PlanQuality::LeastTime).unwrap();
    let chords = "G21 G90 G94 G17\n\
                 G0 X0 Y0 Z0\n\
                 F3000\n\
                 G1 X0.017539 Y0.005425\n\
                 F10794.5\n\
                 G1 X0.014021 Y0.004337\n\
                 G5 X-13.402186 Y-4.145782 I-3.498121 J-1.082096 P5.012526 Q4.221992\n\
                 G2 X-26.471979 Y-8.818056 Z0.000000 I-12.804598 J15.202154\n\
                 G5 X-48.084275 Y-8.529671 I-7.458024 J0.099517 P1.480975 Q0.602983\n\
                 G2 X-60.682007 Y24.088290 Z0.000000 I-6.593857 J16.195048\n\
                 G64 P0.002 Q0\n\
                 G3 X-52.628888 Y38.730859 Z0.000000 I-4.363406 J11.935597\n\
                 G1 X-52.639026 Y38.792000\n\
                 G1 X-52.646076 Y38.853573\n\
                 G1 X-52.650019 Y38.915423\n\
                 G1 X-52.650846 Y38.977393\n\
                 G1 X-52.648555 Y39.039326\n\
                 G1 X-52.643151 Y39.101065\n\
                 G1 X-52.634648 Y39.162454\n\
                 G1 X-52.623067 Y39.223338\n\
                 G1 X-52.608438 Y39.283562\n\
                 G1 X-52.590798 Y39.342974\n\
                 G1 X-52.570192 Y39.401423\n\
                 G1 X-52.546671 Y39.458762\n\
                 G1 X-52.520296 Y39.514845\n\
                 G1 X-52.491133 Y39.569530\n\
                 G3 X-81.808529 Y45.690033 Z0.641826 I-13.765048 J7.340865\n\
                 G1 X-82.110670 Y46.643296\n\
                 G5 X-82.714953 Y48.549822 I-0.151071 J0.476632 P0.324754 Q-0.380177\n\
                 M30\n";
    let (mut index, mut holds) = (0, Vec::new());
    for (step, ratio) in [
        (44, 1.928_241_225_771_384_3),
        (139, 0.368_223_318_618_677_74),
        (22, 1.754_104_093_544_304_2),
        (277, 0.0),
        (71, 1.965_886_753_571_697_7),
        (159, 1.547_410_751_841_530_3),
        (278, 0.0),
        (50, 1.0),
    ] {
        index += step;
        holds.push((index, ratio));
    }
    let program = (chords.to_owned(), [-82.714953, 48.549822, 0.641826]);
    check_program(&program, 10.0_f64.powf(5.646801394390512), 1_000, &holds, PlanQuality::LeastTime).unwrap();
}

/// A change of the feed where what brakes from the speed of that instant can just come to rest before a corner, and rounding lacks
/// 2.4e-11 of the length: found by random programs.
#[test]
fn a_change_of_the_feed_where_a_stop_just_fits_keeps_the_limits() {
    let blocks = [
        Block::Line(1.0, 1.681_569_245_869_841_2),
        Block::Spline(0.1, 1.025_893_136_175_345_4, 2.0, -0.331_361_324_400_477_5),
        Block::Control("G64 P0.002 Q0"),
        Block::Line(0.018_024_636_362_946_61, 2.807_632_646_072_888_4),
        Block::Line(0.557_421_610_726_973_2, 1.898_707_929_244_712),
        Block::Line(0.044_277_117_513_908_53, 0.141_968_270_439_567_45),
        Block::Chords(49, 0.038_404_944_594_409_58, -0.065_294_943_542_437_88),
        Block::Line(1.0, -2.693_723_098_412_091_7),
        Block::Line(0.027_710_144_965_761_532, 0.0),
        Block::Spline(1.133_497_070_832_522, 0.864_846_835_078_044_8, 2.306_415_550_955_185_4, 1.545_836_635_210_824_8),
        Block::Line(0.002_676_530_375_586_389_6, 0.801_849_493_048_919_3),
    ];
    let mut index = 0;
    let mut overrides = Vec::new();
    for (step, ratio) in [
        (240, 0.0),
        (107, 1.081_783_353_388_049_2),
        (259, 0.992_828_759_584_019_6),
        (256, 0.0),
        (91, 1.604_237_103_033_205),
        (136, 1.357_602_103_448_238_8),
        (50, 1.0),
    ] {
        index += step;
        overrides.push((index, ratio));
    }
    check(&blocks, 10.0_f64.powf(4.799_488_926_670_524_5), 1_000, &overrides, PlanQuality::Fast).unwrap();
}
