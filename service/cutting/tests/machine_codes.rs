//! M codes of the machine on the path: nothing, a stop, a dwell, a barrier.

use crate::common::{resume, run, snapshots};
use feedwave_cutting::{MachineProfile, PipelineConfig};
use feedwave_program::{MachineCode, MachineEffect, MachineTiming};

fn mill(effect: MachineEffect) -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    let code = MachineCode { number: 10, effect, timing: MachineTiming::Before, words: String::new() };
    profile.language.machine_codes = vec![code];
    PipelineConfig::new(profile)
}

/// Setpoints of a straight cut with an M code in its middle.
fn setpoints(between: &str, effect: MachineEffect) -> usize {
    run(&format!("G1 X10 F3000\n{between}\nX20\nM30\n"), &mill(effect)).len()
}

#[test]
fn the_effect_is_what_the_profile_says() {
    let straight = setpoints("G94", MachineEffect::None);
    assert_eq!(setpoints("M10", MachineEffect::None), straight, "the path goes on");
    let stopped = setpoints("M0", MachineEffect::None);
    assert!(stopped > straight, "M0 stops: {stopped} setpoints, {straight} without");
    for effect in [MachineEffect::Stop, MachineEffect::Barrier, MachineEffect::Dwell { seconds: 0.0 }] {
        assert_eq!(setpoints("M10", effect), stopped, "{effect:?}");
    }
    let dwelled = setpoints("M10", MachineEffect::Dwell { seconds: 0.25 });
    assert_eq!(dwelled, setpoints("G4 P250", MachineEffect::None));
    assert!(dwelled > stopped);
}

#[test]
fn a_stream_resumes_across_m_codes() {
    let program = "G1 X10 F3000\nM29 S500\nM11\nM10\nX20\nM11\nX30\nM30\n";
    let config = mill(MachineEffect::Dwell { seconds: 0.1 });
    let whole = run(program, &config);
    for (_, offset, snapshot) in snapshots(program.as_bytes(), &config) {
        let (first, rest) = resume(program.as_bytes(), &config, offset, &snapshot);
        assert!((0..rest.len()).all(|index| rest.bits(index) == whole.bits(first as usize + index)));
    }
}
