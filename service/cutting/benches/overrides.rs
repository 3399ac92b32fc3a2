//! Changes of the feed override and feed hold with thousands of blocks ahead: the time from the change to the next setpoint, and the
//! longest time that one of the next setpoints takes, beside those of the same setpoints without a change.
//!
//! `cargo bench -p feedwave-cutting --bench overrides`

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

use feedwave_cutting::{MachineProfile, OverrideChange, Pipeline, PipelineConfig, PlanQuality, SetpointBlock, Step};

const BLOCKS: usize = 20_000;
/// Places at which the feed changes, this many setpoints apart.
const PLACES: usize = 20;
const APART: u64 = 150;
/// Setpoints that are taken behind a change.
const BEHIND: u64 = 100;

/// A closed curve with ripples in blocks of this length.
fn ripples(block_mm: f64, feed_mm_per_min: f64) -> String {
    let scale = block_mm / 0.2;
    let at = |t: f64| {
        let wave = |turns: f64| (turns * t).sin_cos();
        let x = 30.0 * wave(1.0).1 + 3.0 * wave(5.0).1 + 0.4 * wave(31.0).0;
        let y = 20.0 * wave(1.0).0 + 5.0 * wave(2.0).0 + 2.0 * wave(5.0).0 + 0.4 * wave(29.0).1;
        [x, y, 2.0 * wave(2.0).1 + 0.01 * t].map(|value| scale * value)
    };
    let mut program = format!("G21 G90 G94 G17 G64 P{:.3}\n", 0.05 * scale);
    let mut t = 0.0;
    for block in 0..=BLOCKS {
        let [x, y, z] = at(t);
        let word = match block {
            0 => "G0".to_owned(),
            1 => format!("G1 F{feed_mm_per_min}"),
            _ => String::new(),
        };
        let _ = writeln!(program, "{word} X{x:.4} Y{y:.4} Z{z:.4}");
        let ([x0, y0, z0], [x1, y1, z1]) = (at(t - 1e-4), at(t + 1e-4));
        let speed = (x1 - x0).hypot(y1 - y0).hypot(z1 - z0) / 2e-4;
        t += block_mm / speed;
    }
    program + "M30\n"
}

/// The time of the next setpoint, and of the slowest of those behind it, ms.
fn taken_ms(mut pipeline: Pipeline, ratio: Option<f64>) -> [f64; 3] {
    let mut block = pipeline.new_block();
    let mut take = |pipeline: &mut Pipeline| {
        let start = Instant::now();
        assert_eq!(pipeline.next_setpoints(&mut block, 1), Step::Block);
        1e3 * start.elapsed().as_secs_f64()
    };
    let start = Instant::now();
    if let Some(ratio) = ratio {
        let index = pipeline.next_index();
        pipeline.append_override(OverrideChange { index, ratio }).expect("in time");
    }
    let appended_ms = 1e3 * start.elapsed().as_secs_f64();
    let first_ms = appended_ms + take(&mut pipeline);
    let mut slowest_ms = 0.0_f64;
    let mut all_ms = first_ms;
    for _ in 0..BEHIND {
        let ms = take(&mut pipeline);
        slowest_ms = slowest_ms.max(ms);
        all_ms += ms;
    }
    [first_ms, slowest_ms, all_ms]
}

/// Median and largest.
fn spread(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() - 1]]
}

fn advance(pipeline: &mut Pipeline, block: &mut SetpointBlock, to: u64) {
    while pipeline.next_index() < to {
        let most = (to - pipeline.next_index()).min(1_024) as usize;
        assert_eq!(pipeline.next_setpoints(block, most), Step::Block);
    }
}

fn main() {
    let cases =
        [("none", None), ("to 80 %", Some(0.8)), ("to 120 %", Some(1.2)), ("to 100 %", Some(1.0)), ("hold", Some(0.0))];
    println!("ms: median and most of the next setpoint, of the slowest of {BEHIND} behind it, and of all");
    for block_mm in [0.2, 1.0, 10.0] {
        for feed in [1_000.0, 6_000.0, 30_000.0] {
            let program = ripples(block_mm, feed);
            for plan_quality in [PlanQuality::Fast, PlanQuality::LeastTime] {
                let profile = MachineProfile { plan_quality, ..MachineProfile::mill() };
                let mut pipeline = Pipeline::new(Arc::new(PipelineConfig::new(profile)));
                pipeline.push(program.as_bytes());
                pipeline.finish_input();
                let mut block = pipeline.new_block();
                let mut times: Vec<Vec<[f64; 3]>> = vec![Vec::new(); cases.len() + 1];
                for place in 0..PLACES {
                    advance(&mut pipeline, &mut block, 2_000 + APART * place as u64);
                    for (times, (_, ratio)) in times.iter_mut().zip(cases) {
                        times.push(taken_ms(pipeline.clone(), ratio));
                    }
                    let mut held = pipeline.clone();
                    let index = held.next_index();
                    held.append_override(OverrideChange { index, ratio: 0.0 }).expect("in time");
                    advance(&mut held, &mut block, index + 600);
                    times[cases.len()].push(taken_ms(held, Some(1.0)));
                }
                let names = cases.iter().map(|(name, _)| *name).chain(["resume"]);
                for (name, times) in names.zip(times) {
                    let column = |k: usize| spread(times.iter().map(|times| times[k]).collect());
                    let [first, slowest, all] = [0, 1, 2].map(column);
                    println!(
                        "{block_mm} mm F{feed} {plan_quality:?} {name}: {:.2} {:.2} | {:.2} {:.2} | {:.2} {:.2}",
                        first[0], first[1], slowest[0], slowest[1], all[0], all[1]
                    );
                }
            }
        }
    }
}
