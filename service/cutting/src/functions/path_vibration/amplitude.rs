//! The amplitude of a vibration that follows the feed override, so that the chip stays broken: the feed per revolution
//! changes with the override, and what breaks the chip is the ratio of the amplitude to it.
//!
//! Between two ratios the amplitude goes along a smooth step over some vibrations, slowly enough that the vibration's peaks
//! grow by no more than [`PEAK_RESERVE`]. It is never behind the feed: a higher feed waits until the amplitude is
//! there, and the amplitude goes down only after the time that the feed has had for it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::SectionStart;
use crate::shared::blend::blend;

/// Vibrations over which the amplitude changes.
pub(crate) const RAMP_VIBRATIONS: f64 = 4.0;

/// By how much the peaks of velocity, acceleration and jerk may exceed those at the largest amplitude while it changes.
/// For the worst sequence of changes there is, the smooth step over [`RAMP_VIBRATIONS`] gives 1.0, 1.006 and 1.027.
pub(crate) const PEAK_RESERVE: f64 = 1.03;

/// Ratios of the amplitude to the programmed one that are gone to in turn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Amplitude {
    /// The feed override asked for last.
    wanted: f64,
    /// The first one is reached; the others by the index from which on they are gone to. Ascending, and none beyond the
    /// limit of the section.
    steps: VecDeque<Step>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Step {
    index: u64,
    ratio: f64,
}

impl Default for Amplitude {
    fn default() -> Self {
        Self { wanted: 1.0, steps: VecDeque::new() }
    }
}

impl SectionStart {
    /// Largest amplitude that there can be, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        self.amplitude_mm * self.follows_up_to.unwrap_or(1.0)
    }

    /// Setpoints over which the amplitude changes.
    fn ramp(&self, period_s: f64) -> u64 {
        (RAMP_VIBRATIONS / (self.frequency_hz * period_s)).ceil().max(1.0) as u64
    }
}

impl Amplitude {
    /// A section starts with the amplitude of the present override: the vibration itself starts with its full speed.
    pub(crate) fn open(&mut self, section: &SectionStart) {
        self.steps.clear();
        if let Some(limit) = section.follows_up_to {
            self.steps.push_back(Step { index: 0, ratio: self.wanted.min(limit) });
        }
    }

    /// The feed override asked for is another one from the setpoint `index` on.
    pub(crate) fn follow(&mut self, section: Option<&SectionStart>, period_s: f64, index: u64, wanted: f64) {
        self.wanted = wanted;
        let Some((section, limit)) = section.and_then(|section| Some((section, section.follows_up_to?))) else {
            return;
        };
        let ramp = section.ramp(period_s);
        while self.steps.len() > 1 && self.steps.back().is_some_and(|last| last.index > index) {
            self.steps.pop_back();
        }
        while self.steps.get(1).is_some_and(|second| second.index + ramp <= index) {
            self.steps.pop_front();
        }
        let ratio = wanted.min(limit);
        match self.steps.back() {
            Some(last) if ratio < last.ratio => self.steps.push_back(Step { index: index + ramp, ratio }),
            Some(last) if ratio > last.ratio => self.steps.push_back(Step { index, ratio }),
            _ => {}
        }
    }

    /// First setpoint at which the amplitude is large enough for this feed override, and stays so.
    pub(crate) fn suffices_from(&self, section: &SectionStart, period_s: f64, wanted: f64) -> u64 {
        let Some(limit) = section.follows_up_to else { return 0 };
        let enough = self.steps.iter().rev().take_while(|step| step.ratio >= wanted.min(limit)).last();
        match (enough, self.steps.front()) {
            (Some(enough), Some(first)) if enough != first => enough.index + section.ramp(period_s),
            _ => 0,
        }
    }

    /// Amplitudes of the setpoints from `first` on, mm.
    pub(crate) fn fill(&self, section: &SectionStart, period_s: f64, first: u64, out: &mut [f64]) {
        let ramp = section.ramp(period_s);
        let changes = self.steps.back().is_some_and(|last| last.index + ramp > first);
        if !changes || self.steps.len() < 2 {
            out.fill(section.amplitude_mm * self.steps.back().map_or(1.0, |last| last.ratio));
            return;
        }
        for (k, amplitude_mm) in out.iter_mut().enumerate() {
            let index = first + k as u64;
            let mut ratio = self.steps[0].ratio;
            let mut from = ratio;
            for step in self.steps.iter().skip(1).take_while(|step| step.index < index) {
                let past = index - step.index;
                if past >= ramp {
                    // What was gone to is reached to the bit.
                    ratio = step.ratio;
                } else {
                    ratio += (step.ratio - from) * blend(past as f64 / ramp as f64);
                }
                from = step.ratio;
            }
            *amplitude_mm = section.amplitude_mm * ratio;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn section(follows_up_to: Option<f64>) -> SectionStart {
        SectionStart { frequency_hz: 40.0, amplitude_mm: 0.1, follows_up_to }
    }

    fn ratios(amplitude: &Amplitude, section: &SectionStart, first: u64, count: usize) -> Vec<f64> {
        let mut out = vec![0.0; count];
        amplitude.fill(section, PERIOD_S, first, &mut out);
        out.iter().map(|mm| mm / section.amplitude_mm).collect()
    }

    #[test]
    fn a_fixed_amplitude_never_changes_and_never_makes_the_feed_wait() {
        let section = section(None);
        let mut amplitude = Amplitude::default();
        amplitude.open(&section);
        amplitude.follow(Some(&section), PERIOD_S, 10, 0.3);
        assert_eq!(amplitude.suffices_from(&section, PERIOD_S, 2.0), 0);
        assert!(ratios(&amplitude, &section, 0, 1_000).iter().all(|ratio| *ratio == 1.0));
    }

    #[test]
    fn it_leads_a_rising_feed_and_lags_a_falling_one() {
        let section = section(Some(1.5));
        let mut amplitude = Amplitude::default();
        amplitude.open(&section);
        amplitude.follow(Some(&section), PERIOD_S, 10, 1.4);
        // Four vibrations of 25 ms.
        assert_eq!(amplitude.suffices_from(&section, PERIOD_S, 1.4), 110);
        let up = ratios(&amplitude, &section, 10, 101);
        assert!((up[0] - 1.0).abs() < 1e-12 && (up[100] - 1.4).abs() < 1e-12);
        assert!(up.windows(2).all(|pair| pair[1] >= pair[0]) && (up[50] - 1.2).abs() < 1e-12);
        amplitude.follow(Some(&section), PERIOD_S, 200, 0.6);
        assert_eq!(amplitude.suffices_from(&section, PERIOD_S, 0.6), 0, "a falling feed does not wait");
        let down = ratios(&amplitude, &section, 200, 201);
        assert!(down[..=100].iter().all(|ratio| (ratio - 1.4).abs() < 1e-12));
        assert!((down[200] - 0.6).abs() < 1e-12);
    }

    #[test]
    fn it_stays_within_what_was_asked_for_whatever_the_sequence() {
        let section = section(Some(1.2));
        let mut amplitude = Amplitude::default();
        amplitude.open(&section);
        let mut index = 0;
        for (pause, wanted) in [(3, 2.0), (1, 0.0), (1, 2.0), (40, 0.5), (60, 0.7), (150, 0.0), (30, 1.0), (400, 0.1)] {
            index += pause;
            amplitude.follow(Some(&section), PERIOD_S, index, wanted);
            let all = ratios(&amplitude, &section, index, 30);
            assert!(all.iter().all(|ratio| (0.0..=1.2 + 1e-12).contains(ratio)), "{all:?} after {wanted}");
        }
        assert!(amplitude.steps.len() < 4, "what is past is forgotten");
        assert!((ratios(&amplitude, &section, 5_000, 1)[0] - 0.1).abs() < 1e-12);
    }
}
