//! Another spindle speed, where nothing else breaks the chip or the present one is not stable.

use super::Surroundings;
use super::judged::{margin, vibration_text};
use super::stability::StabilityGoal;
use super::vibration::{Changed, search};
use super::words::Word;
use super::work::Work;
use super::written::{Words, rounded};
use crate::shared::wording::{decimal, round_down, round_to, round_up};
use crate::{FeedCoupling, FoundVibration, SectionReport, SurfaceCut, VibrationSearch};

/// Steps of a spindle speed that are tried on both sides of the programmed one, as a share of it.
const STEP: f64 = 0.01;
/// How many of them.
const STEPS: u32 = 200;
/// Decimals of a surface speed.
const SURFACE_DECIMALS: usize = 1;
const M_PER_FOOT: f64 = 0.3048;

/// What one block switches on, as programmed.
pub(super) struct Programmed<'s> {
    pub(super) sections: &'s [&'s SectionReport],
    /// Share of the amplitude that arrives at the chip.
    pub(super) arriving: f64,
    pub(super) vibration: FoundVibration,
    /// Its words, where both are numbers.
    pub(super) words: Option<&'s Words>,
}

/// Another spindle speed of those that are permitted, as near as possible to the programmed one, with the vibration that is enough at
/// it; `None` where there is none, or where speeds are to stay.
pub(super) fn another<S: Surroundings>(
    work: &mut Work<'_, S>,
    programmed: &Programmed<'_>,
) -> Result<Option<Changed>, S::Error> {
    match permitted(work) {
        Some(range) => nearest(work, programmed, range),
        None => Ok(None),
    }
}

/// The same for a section that is not stable at its speed; the inner error is why there is none.
pub(super) fn stable<S: Surroundings>(
    work: &mut Work<'_, S>,
    programmed: &Programmed<'_>,
    goal: &StabilityGoal,
) -> Result<Result<Changed, String>, S::Error> {
    if constant_speed(work, programmed.sections).is_none() {
        return Ok(Err("its cuts have different spindle speeds, or theirs is not written as a number".to_owned()));
    }
    let tolerance = work.goals.vibration.speed_tolerance;
    let ends = [goal.chart.first(), goal.chart.last()].map(|point| point.map_or(0.0, |(speed, _)| *speed));
    let range = permitted(work).unwrap_or([ends[0], ends[1].min(work.config.profile.machine.max_spindle_rev_per_min)]);
    let [low, high] = range.map(|speed| decimal(speed, 0));
    Ok(match nearest(work, programmed, range)? {
        Some(changed) if work.goals.spindle_rev_per_min.is_some() => Ok(changed),
        Some(Changed { found, speed_rev_per_min: Some([_, new]), .. }) => Err(format!(
            "speeds stay, as none are permitted: with {} it would break every chip, {}",
            vibration_text(found),
            goal.judge([new; 2], tolerance).text()
        )),
        _ if goal.stable_speeds(tolerance, range).is_empty() => Err(goal.best_text(tolerance, range)),
        _ => Err(format!(
            "at no stable speed from {low} to {high} rev/min does a vibration within the limits break every chip"
        )),
    })
}

/// The speeds that are permitted, rev/min.
fn permitted<S: Surroundings>(work: &Work<'_, S>) -> Option<[f64; 2]> {
    let [low, high] = work.goals.spindle_rev_per_min?;
    Some([low, high.min(work.config.profile.machine.max_spindle_rev_per_min)])
}

/// The speed between two that is nearest to the programmed one, with its vibration.
fn nearest<S: Surroundings>(
    work: &mut Work<'_, S>,
    programmed: &Programmed<'_>,
    [low, high]: [f64; 2],
) -> Result<Option<Changed>, S::Error> {
    let Some(word) = constant_speed(work, programmed.sections) else { return Ok(None) };
    let speed = word.rev_per_min;
    for (value, tried) in candidates(work, &word, [low, high]) {
        if tried < low.max(1.0) || tried > high.min(word.max_rev_per_min) || value == word.word.value {
            continue;
        }
        work.step()?;
        let at_speed: Vec<SectionReport> = programmed.sections.iter().map(|section| at_speed(section, tried)).collect();
        let at_speed: Vec<&SectionReport> = at_speed.iter().collect();
        let arriving = programmed.arriving;
        let Ok(search) = search(&at_speed, arriving, work.config, &work.goals.vibration) else { continue };
        if let Some((found, mut words)) = vibration_at(&search, programmed) {
            words.push((word.word, format!("S{}", decimal(value, word.decimals))));
            let (margin, speeds) = (arriving * margin(&search, found), Some([speed, tried]));
            return Ok(Some(Changed { found, margin, words, speed_rev_per_min: speeds }));
        }
    }
    Ok(None)
}

/// The vibration that is enough where something is searched for, and its words.
fn vibration_at(
    search: &VibrationSearch,
    programmed: &Programmed<'_>,
) -> Option<(FoundVibration, Vec<(Word, String)>)> {
    let Programmed { vibration, words, .. } = programmed;
    match words {
        Some(words) => rounded(search, search.solve()?, *vibration, words, false),
        None => search.suffices(vibration.frequency_hz, vibration.amplitude_mm).then(|| (*vibration, Vec::new())),
    }
}

/// Values of the word of the speed that are tried, and the speeds that they stand for, rev/min, the nearest first: in steps to both
/// sides, and with lobes those that are stable, where that begins and ends, and between.
fn candidates<S: Surroundings>(work: &Work<'_, S>, word: &SpeedWord, range: [f64; 2]) -> Vec<(f64, f64)> {
    let speed = word.rev_per_min;
    let shares = (1..=STEPS).map(|step| STEP * f64::from(step)).flat_map(|share| [1.0 - share, 1.0 + share]);
    let mut tried: Vec<(f64, f64)> = shares.map(|share| word.written(speed * share)).collect();
    let Some(goal) = &work.goals.stability else { return tried };
    let tolerance = work.goals.vibration.speed_tolerance;
    for [from, to] in goal.stable_speeds(tolerance, range) {
        // Rounded into the stretch.
        let [low, high] = [
            round_up(from / word.unit_rev_per_min, word.decimals),
            round_down(to / word.unit_rev_per_min, word.decimals),
        ];
        tried.extend([low, high].map(|value| (value, value * word.unit_rev_per_min)));
        tried.push(word.written(0.5 * (from + to)));
    }
    tried.retain(|(_, at)| goal.judge([*at; 2], tolerance).is_stable());
    tried.sort_by(|a, b| (a.1 - speed).abs().total_cmp(&(b.1 - speed).abs()));
    tried.dedup();
    tried
}

/// The one spindle speed of sections, and the word that says it.
struct SpeedWord {
    word: Word,
    rev_per_min: f64,
    /// Speed that one unit of the word stands for, rev/min: 1, or under constant surface speed what it makes at the diameter.
    unit_rev_per_min: f64,
    decimals: usize,
    /// Largest speed that is programmed, rev/min.
    max_rev_per_min: f64,
}

impl SpeedWord {
    /// The value nearest to a speed, and the speed that it stands for, rev/min.
    fn written(&self, rev_per_min: f64) -> (f64, f64) {
        let value = round_to(rev_per_min / self.unit_rev_per_min, self.decimals);
        (value, value * self.unit_rev_per_min)
    }
}

/// The one spindle speed of these sections: programmed in rev/min, or by a surface speed at one diameter, where no clamp holds.
fn constant_speed<S: Surroundings>(work: &Work<'_, S>, sections: &[&SectionReport]) -> Option<SpeedWord> {
    if sections.iter().any(|section| section.surface_speed.is_some()) {
        return None;
    }
    let mut spans = sections.iter().flat_map(|section| &section.chip_spans);
    let first = spans.next()?;
    let (rev_per_min, surface) = (first.spindle_rev_per_min, first.surface);
    if spans.any(|span| span.spindle_rev_per_min != rev_per_min || span.surface != surface) {
        return None;
    }
    let first_line = sections.iter().map(|section| section.first_line).min()?;
    let word = work.spindle_word_above(first_line)?;
    let is = |value: f64| (word.value - value).abs() <= 1e-9 * value;
    let (decimals, max_rev_per_min) = match surface {
        None => (0, f64::INFINITY),
        Some(SurfaceCut { diameter_mm: Some(_), max_rev_per_min, .. }) => (SURFACE_DECIMALS, max_rev_per_min),
        Some(_) => return None,
    };
    let is_meant = match surface {
        None => is(rev_per_min),
        Some(surface) => is(surface.m_per_min) || is(surface.m_per_min / M_PER_FOOT),
    };
    let unit_rev_per_min = if surface.is_some() { rev_per_min / word.value } else { 1.0 };
    is_meant.then_some(SpeedWord { word, rev_per_min, unit_rev_per_min, decimals, max_rev_per_min })
}

/// A section as it would be at another spindle speed.
fn at_speed(section: &SectionReport, rev_per_min: f64) -> SectionReport {
    let mut section = section.clone();
    let coupling = section.chip.as_ref().map(|chip| chip.condition.feed_coupling);
    for span in &mut section.chip_spans {
        if coupling == Some(FeedCoupling::PerMinute) {
            span.feed_per_rev_mm *= span.spindle_rev_per_min / rev_per_min;
        }
        span.spindle_rev_per_min = rev_per_min;
    }
    section
}
