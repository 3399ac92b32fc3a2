//! Feeds of vibrating sections, raised to the largest chip thickness that is permitted, as far as a vibration within the limits of the
//! axes still breaks every chip.

use std::collections::BTreeMap;

use feedwave_program::Feed;

use super::actions::Meant;
use super::judged::{self, Wanted};
use super::vibration::{Outcome, Section, search};
use super::words::Word;
use super::work::{FunctionWords, Work};
use super::written::{Words, rounded};
use super::{ImprovementFigure, ImprovementKind, ImprovementOutcome, ImprovementStep, State, Surroundings, WordChange};
use crate::shared::wording::{decimal, round_down, word};
use crate::{FoundVibration, SectionReport, ValidationReport};

/// Share by which a feed has to rise to be worth a change.
const LEAST_RISE: f64 = 0.01;
/// Steps of a bisection of the largest feed.
const BISECTION_STEPS: u32 = 30;
/// Times that half of a rise is tried where validation does not bear out the whole of it.
const HALVINGS: u32 = 3;
/// Decimals of a feed of a revolution, and of a minute.
const REVOLUTION_DECIMALS: usize = 4;
const MINUTE_DECIMALS: usize = 1;

/// Raises them, section by section.
pub(super) fn improve<S: Surroundings>(
    work: &mut Work<'_, S>,
    found: &FunctionWords,
    sections: &mut [Section],
    state: &mut State,
) -> Result<(), S::Error> {
    let Some(limit_mm) = work.goals.max_feed_per_rev_mm else { return Ok(()) };
    for section in sections {
        let vibration = match &section.outcome {
            Outcome::Holds => section.programmed,
            Outcome::Changed(changed) => changed.found,
            Outcome::NotPossible(_) => continue,
        };
        let words = found.blocks.get(&section.line).and_then(Words::of);
        let mut raise = Raise { work, section, vibration, words, limit_mm };
        let step = raise.step(state)?;
        state.steps.push(step);
    }
    Ok(())
}

/// What is tried for one section.
struct Raise<'w, 'a, S> {
    work: &'w mut Work<'a, S>,
    section: &'w Section,
    vibration: FoundVibration,
    words: Option<Words>,
    limit_mm: f64,
}

/// A feed that is programmed for cuts of a section: its word, and whether it is of a minute.
#[derive(Clone, Debug)]
struct FeedWord {
    word: Word,
    per_minute: bool,
}

/// A vibration as words can say it.
struct WrittenVibration {
    found: FoundVibration,
    /// Of its chip at the feeds that it was found for.
    margin: f64,
    /// Words to change, with their new text; none where the vibration stays.
    words: Vec<(Word, String)>,
}

impl<S: Surroundings> Raise<'_, '_, S> {
    fn step(&mut self, state: &mut State) -> Result<ImprovementStep, S::Error> {
        let line = self.section.line;
        let own: Vec<SectionReport> = state.after.sections.iter().filter(|it| it.on_line == line).cloned().collect();
        let spans = own.iter().flat_map(|section| &section.chip_spans);
        let feed_mm = spans.map(|span| span.feed_per_rev_mm / span.feed_override).fold(0.0, f64::max);
        let override_ratio = self.work.goals.vibration.max_feed_override;
        let subject = format!("{} mm/rev", decimal(feed_mm, 4));
        let stays = |reason: String| ImprovementStep {
            line,
            kind: ImprovementKind::Feed,
            subject: subject.clone(),
            outcome: ImprovementOutcome::Stays,
            reason,
            changes: Vec::new(),
            figures: Vec::new(),
        };
        let most = self.limit_mm / (override_ratio * feed_mm);
        if !(feed_mm > 0.0 && most >= 1.0 + LEAST_RISE) {
            let largest = decimal(feed_mm * override_ratio, 4);
            return Ok(stays(format!("{largest} mm/rev at the largest override is all that is permitted")));
        }
        if !self.work.may_try() {
            return Ok(stays(Work::<S>::no_more()));
        }
        let feeds = match self.feed_words(&own)? {
            Ok(feeds) => feeds,
            Err(reason) => return Ok(stays(reason.to_owned())),
        };
        let headroom = self.headroom(&own, most);
        let mut reason = if headroom < most {
            "no vibration within nine tenths of the axes' acceleration and jerk (the rest is kept for the feed) and the limits of the \
             profile breaks a thicker chip"
                .to_owned()
        } else {
            String::new()
        };
        let mut rise = headroom - 1.0;
        for _ in 0..=HALVINGS {
            if rise < LEAST_RISE {
                break;
            }
            if !self.work.may_try() {
                return Ok(stays(Work::<S>::no_more()));
            }
            match self.attempt(&own, &feeds, 1.0 + rise, state)? {
                Ok(step) => return Ok(ImprovementStep { subject, line, ..step }),
                Err(why) => reason = why,
            }
            rise *= 0.5;
        }
        Ok(stays(reason))
    }

    /// The words that say the feeds of the cuts; the inner error is why they cannot be changed.
    fn feed_words(&mut self, own: &[SectionReport]) -> Result<Result<Vec<FeedWord>, &'static str>, S::Error> {
        let lines = own.iter().map(|section| section.first_line..=section.last_line);
        let mut found: BTreeMap<(u32, u32), FeedWord> = BTreeMap::new();
        let feeds = self.work.feeds_of(lines)?;
        let cut_lines: Vec<u32> = feeds.keys().copied().collect();
        let words = self.work.words_above(&cut_lines, 'F', self.section.line);
        for (feed, word) in feeds.into_values().zip(words) {
            let per_minute = match feed {
                Feed::PerMinute(_) => true,
                Feed::PerRevolution(_) => false,
                Feed::InverseTime(_) => return Ok(Err("its feed is programmed as a time (G93)")),
            };
            let Some(word) = word else {
                return Ok(Err("its feed is not written as a number"));
            };
            found.insert((word.span.line, word.span.column), FeedWord { word, per_minute });
        }
        Ok(Ok(found.into_values().collect()))
    }

    /// By how much the feeds can rise at most so that a vibration within the limits still breaks every chip.
    fn headroom(&self, own: &[SectionReport], most: f64) -> f64 {
        let possible = |ratio: f64| self.vibration_at(own, ratio).is_some();
        if possible(most) {
            return most;
        }
        let (mut inside, mut outside) = (1.0, most);
        for _ in 0..BISECTION_STEPS {
            let middle = 0.5 * (inside + outside);
            if possible(middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// The vibration at feeds that are so much larger, as words, with its margin.
    fn vibration_at(&self, own: &[SectionReport], ratio: f64) -> Option<WrittenVibration> {
        let mut raised: Vec<SectionReport> = own.to_vec();
        raised.iter_mut().flat_map(|section| &mut section.chip_spans).for_each(|span| span.feed_per_rev_mm *= ratio);
        let raised: Vec<&SectionReport> = raised.iter().collect();
        let arriving = judged::arriving(&raised, &self.work.goals.vibration);
        let search = search(&raised, arriving, self.work.config, &self.work.goals.vibration).ok()?;
        let margin = |it| arriving * judged::margin(&search, it);
        if search.suffices(self.vibration.frequency_hz, self.vibration.amplitude_mm) {
            return Some(WrittenVibration { found: self.vibration, margin: margin(self.vibration), words: Vec::new() });
        }
        let (found, words) = rounded(&search, search.solve()?, self.vibration, self.words.as_ref()?, false)?;
        Some(WrittenVibration { found, margin: margin(found), words })
    }

    /// Tries feeds that are so much larger; the inner error is why it is not to be.
    fn attempt(
        &mut self,
        own: &[SectionReport],
        feeds: &[FeedWord],
        ratio: f64,
        state: &mut State,
    ) -> Result<Result<ImprovementStep, String>, S::Error> {
        let Some(WrittenVibration { found, margin, words: vibration }) = self.vibration_at(own, ratio) else {
            return Ok(Err("no vibration that can be written breaks a thicker chip".to_owned()));
        };
        let mut edits = state.edits.clone();
        let mut changes: Vec<WordChange> = Vec::new();
        for FeedWord { word: old, per_minute } in feeds {
            let decimals = if *per_minute { MINUTE_DECIMALS } else { REVOLUTION_DECIMALS };
            let new = round_down(old.value * ratio, decimals).max(old.value);
            changes.extend(edits.set(old, word('F', new, decimals)));
        }
        for (word, new) in vibration {
            changes.extend(edits.set(&word, new));
        }
        let (Some(first), Some(last)) =
            (own.iter().map(|it| it.first_line).min(), own.iter().map(|it| it.last_line).max())
        else {
            return Ok(Err("it has no cut".to_owned()));
        };
        let Some(after) = self.work.attempt(&state.edits, &edits, Meant::Feeds { first, last })? else {
            return Ok(Err("the word of its feed is that of other cuts as well".to_owned()));
        };
        let own: Vec<&SectionReport> = own.iter().collect();
        let goals = &self.work.goals.vibration;
        let wanted = Wanted { found, margin, arriving: judged::arriving(&own, goals) };
        if let Some(fault) = judged::fault(self.section.line, &wanted, &state.after, &after, self.work.config, goals) {
            return Ok(Err(fault));
        }
        let [was_s, is_s] = [&state.after, &after].map(|report| report.summary.duration_s);
        if !after.is_accepted() || is_s >= was_s {
            return Ok(Err("it saves no time".to_owned()));
        }
        let thickest = |report: &ValidationReport| {
            let own = report.sections.iter().filter(|it| it.on_line == self.section.line);
            let spans = own.flat_map(|section| &section.chip_spans);
            spans.map(|span| span.feed_per_rev_mm / span.feed_override).fold(0.0, f64::max)
        };
        let figure =
            |name: &'static str, before, after, unit| ImprovementFigure { name: name.into(), before, after, unit };
        let figures = vec![
            figure("feed", thickest(&state.after), thickest(&after), "mm/rev"),
            figure("margin", self.section.margin_now(), margin, ""),
            figure("machining time", was_s, is_s, "s"),
        ];
        let reason = format!(
            "{} mm/rev are permitted at the largest override, and the vibration that is written breaks that chip",
            decimal(self.limit_mm, 4)
        );
        let (line, kind, outcome) = (self.section.line, ImprovementKind::Feed, ImprovementOutcome::Changed);
        (state.edits, state.after) = (edits, after);
        Ok(Ok(ImprovementStep { line, kind, subject: String::new(), outcome, reason, changes, figures }))
    }
}
