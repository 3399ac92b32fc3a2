//! The vibration of the least amplitude with which the chip breaks at the corners of sections as well, where it is blended out and in.
//!
//! How long the chip stays whole there depends on the frequency, the amplitude and the length of the blends, which follow from both:
//! there is no closed form. Each vibration is judged as validation judges the sections; frequencies are gone through in equal steps, and
//! around the best of them in ever smaller ones. At a frequency the least amplitude is looked for, from what a cut without corners needs on.

use super::super::chip::{CutCondition, FeedCoupling};
use super::super::chip_course::{ChipCourse, Following, Piece};
use super::super::chips::ChipBlock;
use super::super::report::unbroken_between;
use super::super::{ChipSpan, SectionReport, VibrationCondition, VibrationSettings};
use super::{FoundVibration, VibrationSearch};

/// Steps of the frequency.
const FREQUENCY_STEPS: u32 = 480;
/// Steps on each side of the best frequency, of which each round divides the ones before.
const REFINING_STEPS: u32 = 8;
/// Rounds of that.
const REFINING_ROUNDS: u32 = 6;
/// Amplitudes that are tried at a frequency, in equal ratios.
const AMPLITUDE_STEPS: u32 = 16;
/// Steps of a bisection of the amplitude.
const BISECTION_STEPS: u32 = 20;

/// Sections with corners, and how they are blended.
#[derive(Clone, Debug)]
pub struct SectionCorners<'a> {
    settings: VibrationSettings,
    sections: Vec<&'a SectionReport>,
}

impl<'a> SectionCorners<'a> {
    /// Those of these sections that have junctions at which the vibration is blended out and in; `None` where none has, and an error
    /// where one has more of them than a report keeps.
    ///
    /// # Errors
    /// [`TooManyCorners`].
    pub fn of(sections: &[&'a SectionReport], settings: &VibrationSettings) -> Result<Option<Self>, TooManyCorners> {
        let sections: Vec<_> = sections.iter().copied().filter(|section| section.blended_junctions > 0).collect();
        if sections.iter().any(|section| section.parts.len() as u64 != section.blended_junctions + 1) {
            return Err(TooManyCorners);
        }
        Ok((!sections.is_empty()).then_some(Self { settings: *settings, sections }))
    }

    /// Whether no chip of a revolution or more would be left at the corners, on more than a hundredth of the length.
    #[must_use]
    pub fn break_with(&self, vibration: FoundVibration) -> bool {
        let FoundVibration { frequency_hz, amplitude_mm } = vibration;
        let condition = VibrationCondition { frequency_hz, amplitude_mm };
        self.sections.iter().all(|section| !is_unbroken(section, condition, &self.settings))
    }

    /// The vibration of the least amplitude that does what is wanted and breaks the chip at the corners; `None` where none was found.
    #[must_use]
    pub fn solve(&self, search: &VibrationSearch) -> Option<FoundVibration> {
        let [low_hz, high_hz] = search.frequency_hz;
        let parts: usize = self.sections.iter().map(|section| section.parts.len()).sum();
        let steps = (4 * FREQUENCY_STEPS / u32::try_from(parts).unwrap_or(u32::MAX).max(1)).clamp(60, FREQUENCY_STEPS);
        let step_hz = (high_hz - low_hz) / f64::from(steps);
        let mut tried: Vec<(f64, f64)> = (0..=steps)
            .map(|step| low_hz + step_hz * f64::from(step))
            .filter_map(|frequency_hz| Some((search.least_amplitude_mm(frequency_hz)?, frequency_hz)))
            .collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<FoundVibration> = None;
        for (_, frequency_hz) in tried {
            best = self.better_at(search, frequency_hz, best);
        }
        let mut step_hz = step_hz;
        for _ in 0..REFINING_ROUNDS {
            let centre_hz = best?.frequency_hz;
            let width_hz = step_hz / f64::from(REFINING_STEPS);
            for side in [-1.0, 1.0] {
                for step in 1..=REFINING_STEPS {
                    let frequency_hz = centre_hz + side * width_hz * f64::from(step);
                    if (low_hz..=high_hz).contains(&frequency_hz) {
                        best = self.better_at(search, frequency_hz, best);
                    }
                }
            }
            step_hz = width_hz;
        }
        best
    }

    /// The least amplitude at a frequency that is enough, where it is less than that of the best vibration so far.
    fn better_at(
        &self,
        search: &VibrationSearch,
        frequency_hz: f64,
        best: Option<FoundVibration>,
    ) -> Option<FoundVibration> {
        let of = |amplitude_mm| FoundVibration { frequency_hz, amplitude_mm };
        let Some(least_mm) = search.least_amplitude_mm(frequency_hz) else { return best };
        let most_mm = search.largest_amplitude_mm(frequency_hz);
        let most_mm = best.map_or(most_mm, |best| most_mm.min(best.amplitude_mm * (1.0 - 1e-9)));
        if least_mm > most_mm {
            return best;
        }
        if self.break_with(of(least_mm)) {
            return Some(of(least_mm));
        }
        let ratio = libm::pow(most_mm / least_mm, 1.0 / f64::from(AMPLITUDE_STEPS));
        let (mut below_mm, mut enough_mm) = (least_mm, None);
        for step in 1..=AMPLITUDE_STEPS {
            let tried_mm = if step == AMPLITUDE_STEPS { most_mm } else { below_mm * ratio };
            if self.break_with(of(tried_mm)) {
                enough_mm = Some(tried_mm);
                break;
            }
            below_mm = tried_mm;
        }
        let Some(mut enough_mm) = enough_mm else { return best };
        for _ in 0..BISECTION_STEPS {
            let middle_mm = 0.5 * (below_mm + enough_mm);
            if self.break_with(of(middle_mm)) {
                enough_mm = middle_mm;
            } else {
                below_mm = middle_mm;
            }
        }
        Some(of(enough_mm))
    }
}

/// A section has more corners than a report keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyCorners;

/// Whether a section with another vibration would leave a revolution of its chip whole at corners.
fn is_unbroken(section: &SectionReport, condition: VibrationCondition, settings: &VibrationSettings) -> bool {
    let following = Following::of(condition, settings);
    let mut course = ChipCourse::new(condition, settings);
    let ends = section.parts.iter().skip(1).map(|part| part.start_mm).chain([section.length_mm]);
    for (part, end_mm) in section.parts.iter().zip(ends) {
        course.start_part(part.start_mm, settings.ramp_mm(condition, part.feed_mm_per_s), part.feed_mm_per_s);
        for span in &section.chip_spans {
            let (start_mm, stop_mm) = (span.start_mm.max(part.start_mm), (span.start_mm + span.length_mm).min(end_mm));
            if stop_mm > start_mm {
                let cut = cut(span, condition, following.ratio_at(span.feed_override));
                let (line, length_mm, surface) = (span.first_line, stop_mm - start_mm, span.surface);
                let block = ChipBlock { line, start_mm, length_mm, cut, surface, feed_override: span.feed_override };
                course.add(Piece::Constant(block));
            }
        }
    }
    let verdict = course.finish(section.length_mm);
    unbroken_between(verdict.blend.as_ref(), verdict.broken_share, section.blended_junctions).is_some()
}

const fn cut(span: &ChipSpan, condition: VibrationCondition, amplitude_ratio: f64) -> CutCondition {
    CutCondition {
        feed_per_rev_mm: span.feed_per_rev_mm,
        amplitude_mm: condition.amplitude_mm * amplitude_ratio,
        frequency_hz: condition.frequency_hz,
        spindle_rev_per_min: span.spindle_rev_per_min,
        diameter_mm: 0.0,
        feed_coupling: FeedCoupling::PerRevolution,
    }
}
