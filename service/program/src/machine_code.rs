//! M codes that the machine carries out itself: what the profile and the dialect say about them, and the operation.

use serde::{Deserialize, Serialize};

use crate::{DialectName, FunctionWord, LanguageSettings};

/// Largest number of an M code: eight digits, as long as controls take them.
const LARGEST_MACHINE_CODE: u32 = 99_999_999;

/// Most M codes that a profile lists.
const MOST_MACHINE_CODES: usize = 256;

/// Longest wait for an M code, s: a working day.
const LONGEST_DWELL_S: f64 = 86_400.0;

/// An M code that a machine carries out itself: a clamp, a chuck, a conveyor, an output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineCode {
    /// Its number.
    pub number: u32,
    /// What it does to the path.
    #[serde(default)]
    pub effect: MachineEffect,
    /// Whether it takes effect before or behind the motion of its block.
    #[serde(default)]
    pub timing: MachineTiming,
    /// The letters of the words that it takes, such as `PQ`.
    #[serde(default)]
    pub words: String,
}

/// What an M code of the machine does to the path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MachineEffect {
    /// Nothing: the path goes on.
    #[default]
    None,
    /// It waits for the operator, as `M0`.
    Stop,
    /// It takes this long, and the path rests meanwhile.
    Dwell {
        /// Time, s.
        seconds: f64,
    },
    /// The path rests, for a time that only the machine knows.
    Barrier,
}

/// When an M code of the machine takes effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MachineTiming {
    /// Before the motion of its block.
    #[default]
    Before,
    /// Behind the motion of its block.
    After,
}

/// What becomes of an M code that neither the dialect nor the profile lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnlistedMachineCodes {
    /// It is handed on without an effect, and noted once.
    #[default]
    Note,
    /// It is refused.
    Error,
}

/// An M code as the program asks for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MachineCommand {
    /// Number of the M code.
    pub number: u32,
    /// What it does to the path.
    pub effect: MachineEffect,
    /// Its words, as written and unscaled.
    pub words: Vec<FunctionWord>,
}

/// What makes the M codes of a profile unusable: the field and why.
#[must_use]
pub fn machine_code_problems(language: &LanguageSettings) -> Vec<(String, String)> {
    let mut problems = Vec::new();
    let codes = &language.machine_codes;
    if codes.len() > MOST_MACHINE_CODES {
        let message = format!("must list at most {MOST_MACHINE_CODES}, lists {}", codes.len());
        problems.push(("machine_codes".to_owned(), message));
        return problems;
    }
    for (index, code) in codes.iter().enumerate() {
        let mut add =
            |field: &str, message: String| problems.push((format!("machine_codes[{index}].{field}"), message));
        let number = code.number;
        if number > LARGEST_MACHINE_CODE {
            add("number", format!("must be at most {LARGEST_MACHINE_CODE}, is {number}"));
        } else if is_taken(language.dialect, language, number) {
            add("number", format!("M{number} has a meaning of its own in this dialect"));
        } else if codes[..index].iter().any(|earlier| earlier.number == number) {
            add("number", format!("M{number} is listed twice"));
        }
        if let MachineEffect::Dwell { seconds } = code.effect
            && !(0.0..=LONGEST_DWELL_S).contains(&seconds)
        {
            add("dwell_s", format!("must be 0 to {LONGEST_DWELL_S}, is {seconds}"));
        }
        let is_word = |byte: u8| byte.is_ascii_uppercase() && !b"GMNO".contains(&byte);
        if let Some(letter) = code.words.chars().find(|letter| !u8::try_from(*letter).is_ok_and(is_word)) {
            add("words", format!("must be letters of words, upper case without G, M, N and O, has {letter:?}"));
        }
    }
    problems
}

/// Whether the dialect or a machining function has this M code, so that a profile cannot list it.
fn is_taken(dialect: DialectName, language: &LanguageSettings, number: u32) -> bool {
    let number = f64::from(number);
    dialect.knows_m_code(number) || language.thinning.is_some_and(|codes| number == codes.on || number == codes.off)
}
