//! Vibrations in the decimals of the words that say them.

use super::actions::FunctionBlock;
use super::speed::Programmed;
use super::words::Word;
use crate::shared::wording::{round_up, word};
use crate::{FoundVibration, SectionCorners, VibrationSearch};

/// Decimals of a frequency, Hz.
const FREQUENCY_DECIMALS: usize = 3;
/// What the last one stands for, Hz.
const FREQUENCY_STEP_HZ: f64 = 1e-3;
/// Most steps from the best frequency at which another one is looked for.
const MOST_STEPS: f64 = 65_536.0;
/// Decimals of an amplitude in mm, and in inches.
const AMPLITUDE_DECIMALS: [usize; 2] = [4, 5];
const MM_PER_INCH: f64 = 25.4;

/// The words of a block that switches a vibration on, both written as numbers.
#[derive(Clone, Debug)]
pub(super) struct Words {
    frequency: Word,
    amplitude: Word,
    inch: bool,
}

impl Words {
    pub(super) fn of(block: &FunctionBlock) -> Option<Self> {
        Some(Self { frequency: block.frequency.clone()?, amplitude: block.amplitude.clone()?, inch: block.inch })
    }
}

/// The vibration in the decimals of words, and the words; `None` where none of the rounded ones is enough within the limits. An
/// amplitude that is more than enough stays where only the frequency has to change.
pub(super) fn rounded(
    search: &VibrationSearch,
    found: FoundVibration,
    programmed: FoundVibration,
    words: &Words,
    least_amplitude: bool,
) -> Option<(FoundVibration, Vec<(Word, String)>)> {
    let unit_mm = if words.inch { MM_PER_INCH } else { 1.0 };
    let decimals = AMPLITUDE_DECIMALS[usize::from(words.inch)];
    let [low_hz, high_hz] = search.frequency_hz;
    let range = low_hz * (1.0 - 1e-12)..=high_hz * (1.0 + 1e-12);
    let at = |steps: f64| {
        let frequency_hz = steps * FREQUENCY_STEP_HZ;
        let least_mm = search.least_amplitude_mm(frequency_hz).filter(|_| range.contains(&frequency_hz))?;
        let rounded_mm = round_up(least_mm / unit_mm, decimals) * unit_mm;
        let keeps = !least_amplitude
            && programmed.amplitude_mm >= least_mm
            && programmed.amplitude_mm <= search.largest_amplitude_mm(frequency_hz);
        let amplitude_mm = if keeps { programmed.amplitude_mm } else { rounded_mm };
        search
            .suffices(frequency_hz, amplitude_mm * (1.0 + 1e-12))
            .then_some(FoundVibration { frequency_hz, amplitude_mm })
    };
    let nearest = (found.frequency_hz / FREQUENCY_STEP_HZ).round();
    let best = |candidates: &[Option<FoundVibration>]| {
        candidates.iter().flatten().copied().min_by(|a, b| a.amplitude_mm.total_cmp(&b.amplitude_mm))
    };
    // The next ones where the nearest is just beyond a limit, and where the limits leave no room there for an amplitude that is
    // rounded up, the nearest ones that have it.
    let best = best(&[0.0, -1.0, 1.0].map(|steps| at(nearest + steps)))
        .or_else(|| best(&[-1.0, 1.0].map(|sense| nearest_room(|steps| at(nearest + sense * steps)))))?;
    // No change that gains nothing: what is programmed is as good as can be written.
    if search.suffices(programmed.frequency_hz, programmed.amplitude_mm) && best.amplitude_mm >= programmed.amplitude_mm
    {
        return Some((programmed, Vec::new()));
    }
    let mut changes = Vec::new();
    if (programmed.frequency_hz - best.frequency_hz).abs() > 1e-3 * FREQUENCY_STEP_HZ {
        changes.push((words.frequency.clone(), word('F', best.frequency_hz, FREQUENCY_DECIMALS)));
    }
    if (programmed.amplitude_mm - best.amplitude_mm).abs() > 1e-9 {
        changes.push((words.amplitude.clone(), word('A', best.amplitude_mm / unit_mm, decimals)));
    }
    Some((best, changes))
}

/// The vibration of the fewest steps that has one, of a limit that leaves more room with every step.
fn nearest_room(at: impl Fn(f64) -> Option<FoundVibration>) -> Option<FoundVibration> {
    let (mut none, mut some) = (1.0, 2.0);
    while at(some).is_none() {
        (none, some) = (some, 2.0 * some);
        if some > MOST_STEPS {
            return None;
        }
    }
    while some - none > 1.0 {
        let middle = (0.5 * (none + some)).floor();
        *(if at(middle).is_some() { &mut some } else { &mut none }) = middle;
    }
    at(some)
}

/// The best vibration that breaks the chip at corners as well, in the decimals of words, where it changes one.
pub(super) fn written_at_corners(
    search: &VibrationSearch,
    corners: &SectionCorners<'_>,
    programmed: &Programmed<'_>,
    least_amplitude: bool,
) -> Option<(FoundVibration, Vec<(Word, String)>)> {
    let (words, as_is) = (programmed.words?, programmed.vibration);
    let found = corners.solve(search)?;
    // In the nearest decimals it may just miss; a little more amplitude makes up for it.
    let raised = [0.0, 1e-4, 3e-4, 1e-3].map(|more_mm| VibrationSearch {
        margin: search.margin * (found.amplitude_mm + more_mm)
            / search.least_amplitude_mm(found.frequency_hz).unwrap_or(found.amplitude_mm),
        ..search.clone()
    });
    let written = raised.iter().filter_map(|search| rounded(search, found, as_is, words, least_amplitude));
    let mut written = written.filter(|(vibration, changes)| !changes.is_empty() && corners.break_with(*vibration));
    written.next()
}
