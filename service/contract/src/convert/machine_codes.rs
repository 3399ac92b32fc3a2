//! M codes of a machine, to and from the contract.

use feedwave_program::{CodeReplacement, MachineCode, MachineEffect, MachineTiming};

use super::enumeration;
use crate::proto;
use crate::violations::Violations;

/// The M codes; those with an unknown value are violations.
pub(super) fn machine_codes_from_proto(
    violations: &mut Violations,
    codes: &[proto::MachineCode],
) -> Option<Vec<MachineCode>> {
    let codes = codes.iter().enumerate().map(|(index, code)| {
        let field = format!("language.machine_codes[{index}]");
        let effect = enumeration(violations, &format!("{field}.effect"), code.effect);
        let timing = enumeration(violations, &format!("{field}.timing"), code.timing);
        let effect = match effect? {
            proto::MachineCodeEffect::Unspecified | proto::MachineCodeEffect::None => MachineEffect::None,
            proto::MachineCodeEffect::Stop => MachineEffect::Stop,
            proto::MachineCodeEffect::Dwell => MachineEffect::Dwell { seconds: code.dwell_s },
            proto::MachineCodeEffect::Barrier => MachineEffect::Barrier,
        };
        if code.dwell_s != 0.0 && !matches!(effect, MachineEffect::Dwell { .. }) {
            violations.add(format!("{field}.dwell_s"), "must not be set where the effect is no dwell");
        }
        let timing = match timing? {
            proto::MachineCodeTiming::Unspecified | proto::MachineCodeTiming::Before => MachineTiming::Before,
            proto::MachineCodeTiming::After => MachineTiming::After,
        };
        Some(MachineCode { number: code.number, effect, timing, words: code.words.clone() })
    });
    let codes: Vec<_> = codes.collect();
    codes.into_iter().collect()
}

/// The effect of an M code, and how long it lasts, s, where it is a dwell.
pub(super) const fn effect_to_proto(effect: MachineEffect) -> (proto::MachineCodeEffect, Option<f64>) {
    match effect {
        MachineEffect::None => (proto::MachineCodeEffect::None, None),
        MachineEffect::Stop => (proto::MachineCodeEffect::Stop, None),
        MachineEffect::Dwell { seconds } => (proto::MachineCodeEffect::Dwell, Some(seconds)),
        MachineEffect::Barrier => (proto::MachineCodeEffect::Barrier, None),
    }
}

/// As the contract has it.
pub(super) fn machine_code_to_proto(code: &MachineCode) -> proto::MachineCode {
    let (effect, dwell_s) = effect_to_proto(code.effect);
    let timing = match code.timing {
        MachineTiming::Before => proto::MachineCodeTiming::Before,
        MachineTiming::After => proto::MachineCodeTiming::After,
    };
    proto::MachineCode {
        number: code.number,
        effect: effect.into(),
        dwell_s: dwell_s.unwrap_or_default(),
        timing: timing.into(),
        words: code.words.clone(),
    }
}

/// A replaced code; what it may not be, the profile says.
pub(super) fn code_replacement_from_proto(given: &proto::CodeReplacement) -> CodeReplacement {
    CodeReplacement { code: given.code.clone(), words: given.words.clone() }
}

/// As the contract has it.
pub(super) fn code_replacement_to_proto(replacement: &CodeReplacement) -> proto::CodeReplacement {
    proto::CodeReplacement { code: replacement.code.clone(), words: replacement.words.clone() }
}
