//! Frequencies and amplitudes of vibrations along the path, and where nothing else helps the spindle speed.

use std::collections::BTreeMap;

use feedwave_program::{Finding, Severity};

use super::actions::{FunctionBlock, Meant};
use super::edits::Edits;
use super::judged::{self, ROUNDING, Wanted, margin, vibration_text};
use super::speed::{self, Programmed};
use super::stability;
use super::words::Word;
use super::work::{FunctionWords, Work};
use super::written::{Words, rounded, written_at_corners};
use super::{
    ImprovementFigure, ImprovementGoals, ImprovementKind, ImprovementOutcome, ImprovementStep, State, Surroundings,
    WordChange,
};
use crate::shared::wording::{decimal, round_up};
use crate::{
    FoundVibration, PipelineConfig, SearchGoals, SectionCorners, SectionReport, TooManyCorners, Unsearchable,
    ValidationReport, VibrationSearch,
};

/// All that one block switches on.
#[derive(Clone, Debug)]
pub(super) struct Section {
    /// The line of the block.
    pub(super) line: u32,
    /// The vibration as programmed.
    pub(super) programmed: FoundVibration,
    /// How far beyond breaking the worst chip is, at the largest override and the worst speed of the tolerance, with what arrives.
    pub(super) margin: f64,
    /// The axes can follow it.
    is_followed: bool,
    /// Where blends at corners leave the chip whole: the line, and revolutions.
    corner: Option<(u32, f64)>,
    /// Largest share of a limit that an axis needs.
    utilisation: f64,
    /// Share of the amplitude that arrives at the chip, where least of it does.
    pub(super) arriving: f64,
    pub(super) outcome: Outcome,
}

impl Section {
    /// The margin with what became of it.
    pub(super) const fn margin_now(&self) -> f64 {
        match &self.outcome {
            Outcome::Changed(changed) => changed.margin,
            Outcome::Holds | Outcome::NotPossible(_) => self.margin,
        }
    }
}

/// What becomes of it.
#[derive(Clone, Debug)]
pub(super) enum Outcome {
    /// It does what is wanted.
    Holds,
    /// It is changed.
    Changed(Box<Changed>),
    /// What is wanted does not hold, for this reason.
    NotPossible(String),
}

#[derive(Clone, Debug)]
pub(super) struct Changed {
    /// The vibration that it becomes.
    pub(super) found: FoundVibration,
    /// The margin by the same measure.
    pub(super) margin: f64,
    /// The words and what takes their place.
    pub(super) words: Vec<(Word, String)>,
    /// The spindle speed before and after, where that changes.
    pub(super) speed_rev_per_min: Option<[f64; 2]>,
}

/// Plans the changes of all sections, makes those that validation bears out, and says what came of each.
pub(super) fn improve<S: Surroundings>(
    work: &mut Work<'_, S>,
    before: &ValidationReport,
    found: &FunctionWords,
    state: &mut State,
) -> Result<Vec<Section>, S::Error> {
    let mut sections = plan_all(work, before, found)?;
    for section in &mut sections {
        let Outcome::Changed(changed) = &section.outcome else { continue };
        if changed.speed_rev_per_min.is_some() {
            let mut edits = Edits::default();
            changed.words.iter().for_each(|(word, new)| drop(edits.set(word, new.clone())));
            if !work.is_same(&edits, Meant::SpindleSpeeds)? {
                section.outcome =
                    Outcome::NotPossible("the word of its spindle speed says something else as well".into());
            }
        }
    }
    settle(work, before, &mut sections, state)?;
    for section in &sections {
        let step = step(section, before, state, work.goals);
        state.steps.push(step);
    }
    Ok(sections)
}

/// Makes the changes and validates what comes out; changes that validation does not bear out are taken back, until all that are
/// left hold together.
fn settle<S: Surroundings>(
    work: &mut Work<'_, S>,
    before: &ValidationReport,
    sections: &mut [Section],
    state: &mut State,
) -> Result<(), S::Error> {
    loop {
        let mut edits = Edits::default();
        for section in &*sections {
            if let Outcome::Changed(changed) = &section.outcome {
                changed.words.iter().for_each(|(word, new)| drop(edits.set(word, new.clone())));
            }
        }
        let unchanged = edits == Edits::default();
        let after = if unchanged { before.clone() } else { work.validate(&edits.apply(work.program, &work.lines))? };
        let mut taken_back = false;
        for section in &mut *sections {
            let Outcome::Changed(changed) = &section.outcome else { continue };
            let wanted = Wanted { found: changed.found, margin: changed.margin, arriving: section.arriving };
            let fault = judged::fault(section.line, &wanted, before, &after, work.config, &work.goals.vibration);
            let spread = || {
                // Another speed is that of all that follows.
                changed.speed_rev_per_min?;
                judged::worse(before, &after, |finding| !finding.code.name().starts_with("VIB-CHIP-"))
                    .map(|worse| format!("another spindle speed would be worse in another way: {worse}"))
            };
            let unstable = || {
                let own: Vec<_> = after.sections.iter().filter(|it| it.on_line == section.line).collect();
                let judged = stability::of(&own, work.goals).filter(|it| !it.is_stable())?;
                Some(format!("with the change it would not be stable: {}", judged.text()))
            };
            if let Some(reason) = fault.or_else(spread).or_else(unstable) {
                section.outcome = Outcome::NotPossible(reason);
                taken_back = true;
            }
        }
        if !taken_back && let Some(reason) = worse_for_others(work, sections, [before, &after]) {
            let sped = |section: &&mut Section| matches!(&section.outcome, Outcome::Changed(changed) if changed.speed_rev_per_min.is_some());
            for section in sections.iter_mut().filter(sped) {
                section.outcome = Outcome::NotPossible(reason.to_owned());
                taken_back = true;
            }
        }
        if !taken_back && has_new_errors(before, &after) {
            // What is wrong belongs to no section: nothing is changed.
            for section in &mut *sections {
                if matches!(section.outcome, Outcome::Changed(_)) {
                    section.outcome =
                        Outcome::NotPossible("the program as a whole would be refused with it".to_owned());
                    taken_back = true;
                }
            }
        }
        if !taken_back {
            (state.edits, state.after) = (edits, after);
            return Ok(());
        }
    }
}

/// Whether validation refuses something that it did not refuse before.
fn has_new_errors(before: &ValidationReport, after: &ValidationReport) -> bool {
    let is_known = |finding: &Finding| {
        let place = |it: &Finding| (it.code, it.severity, it.span.program, it.span.line);
        before.findings.iter().any(|known| place(known) == place(finding))
    };
    let mut errors = after.findings.iter().filter(|finding| finding.severity == Severity::Error);
    after.summary.errors > before.summary.errors || errors.any(|finding| !is_known(finding))
}

/// What becomes worse in a section that stays as it is: it breaks its chips less surely than before and than is wanted, or is no longer
/// stable.
fn worse_for_others<S: Surroundings>(
    work: &Work<'_, S>,
    sections: &[Section],
    reports: [&ValidationReport; 2],
) -> Option<&'static str> {
    let goals = work.goals;
    sections.iter().filter(|section| !matches!(section.outcome, Outcome::Changed(_))).find_map(|section| {
        let own =
            reports.map(|report| report.sections.iter().filter(|it| it.on_line == section.line).collect::<Vec<_>>());
        let [before, after] = [0, 1].map(|at| judged::margin_of(&own[at], work.config, &goals.vibration));
        let [was_stable, is_stable] = [0, 1].map(|at| stability::of(&own[at], goals).is_none_or(|it| it.is_stable()));
        if after < before.min(goals.vibration.margin) * (1.0 - ROUNDING) {
            return Some("another spindle speed would leave chips of other sections unbroken");
        }
        (was_stable && !is_stable).then_some("at another spindle speed other sections would not be stable")
    })
}

/// What is to be done for every block that switches a vibration on.
fn plan_all<S: Surroundings>(
    work: &mut Work<'_, S>,
    report: &ValidationReport,
    found: &FunctionWords,
) -> Result<Vec<Section>, S::Error> {
    let mut by_line: BTreeMap<u32, Vec<&SectionReport>> = BTreeMap::new();
    for section in &report.sections {
        by_line.entry(section.on_line).or_default().push(section);
    }
    let accepted = report.is_accepted();
    by_line
        .into_iter()
        .map(|(line, sections)| {
            let is_followed = accepted || sections.iter().all(|section| section.feasible);
            plan(work, line, &sections, found.blocks.get(&line), is_followed)
        })
        .collect()
}

/// What is looked for in these sections, with what the drives lose commanded besides.
pub(super) fn search(
    sections: &[&SectionReport],
    arriving: f64,
    config: &PipelineConfig,
    goals: &SearchGoals,
) -> Result<VibrationSearch, Unsearchable> {
    let commanded = SearchGoals { margin: goals.margin / arriving, ..*goals };
    if sections.iter().all(|section| section.feasible) {
        return VibrationSearch::of_sections(sections, &config.vibration(), &commanded);
    }
    let own: Vec<SectionReport> = sections.iter().map(|section| with_own_limits(section, config)).collect();
    let own: Vec<&SectionReport> = own.iter().collect();
    VibrationSearch::of_sections(&own, &config.vibration(), &commanded)
}

/// A section with the axes' own limits: where an axis cannot follow, the report has what the vibration as programmed leaves of them.
fn with_own_limits(section: &SectionReport, config: &PipelineConfig) -> SectionReport {
    let mut section = section.clone();
    for load in &mut section.axes {
        let axis = config.profile.machine.axes.iter().find(|axis| axis.name == load.axis);
        if let Some(axis) = axis {
            load.max_velocity_per_s = axis.max_velocity_per_s;
            load.max_acceleration_per_s2 = axis.max_acceleration_per_s2;
            load.max_jerk_per_s3 = axis.max_jerk_per_s3;
        }
    }
    section
}

/// What is to be done for one block, of which the margin and the outcome are not known yet.
#[derive(Clone, Copy, Debug)]
struct Draft {
    line: u32,
    programmed: FoundVibration,
    is_followed: bool,
    corner: Option<(u32, f64)>,
    utilisation: f64,
    arriving: f64,
}

impl Draft {
    fn with(self, margin: f64, outcome: Outcome) -> Section {
        let Self { line, programmed, is_followed, corner, utilisation, arriving } = self;
        Section { line, programmed, margin, is_followed, corner, utilisation, arriving, outcome }
    }

    fn not_possible(self, margin: f64, reason: impl Into<String>) -> Section {
        self.with(margin, Outcome::NotPossible(reason.into()))
    }

    fn changed(self, margin: f64, changed: Changed) -> Section {
        self.with(margin, Outcome::Changed(Box::new(changed)))
    }

    /// Other words of the block, at its spindle speed; none: it holds.
    fn written(
        self,
        margin: f64,
        search: &VibrationSearch,
        found: FoundVibration,
        words: Vec<(Word, String)>,
    ) -> Section {
        if words.is_empty() {
            return self.with(margin, Outcome::Holds);
        }
        let after = self.arriving * judged::margin(search, found);
        self.changed(margin, Changed { found, margin: after, words, speed_rev_per_min: None })
    }
}

const NO_WORDS: &str = "its F and A are not both written as numbers in one block, so no word is changed";

fn plan<S: Surroundings>(
    work: &mut Work<'_, S>,
    line: u32,
    sections: &[&SectionReport],
    block: Option<&FunctionBlock>,
    is_followed: bool,
) -> Result<Section, S::Error> {
    work.step()?;
    let condition = sections[0].condition;
    let programmed = FoundVibration { frequency_hz: condition.frequency_hz, amplitude_mm: condition.amplitude_mm };
    let goals = &work.goals.vibration;
    let (utilisation, arriving) = (judged::utilisation(sections), judged::arriving(sections, goals));
    let corner = sections.iter().find_map(|it| it.unbroken_between_blends());
    let draft = Draft { line, programmed, is_followed, corner, utilisation, arriving };
    if let Some(reason) = unjudged(sections, arriving) {
        return Ok(draft.not_possible(0.0, reason));
    }
    let (config, least_amplitude) = (work.config, work.goals.least_amplitude);
    let search = match search(sections, arriving, config, goals) {
        Ok(search) => search,
        Err(reason) => return Ok(draft.not_possible(0.0, unsearchable(reason, sections))),
    };
    let margin = arriving * margin(&search, programmed);
    let words = block.and_then(Words::of);
    let as_programmed = Programmed { sections, arriving, vibration: programmed, words: words.as_ref() };
    if let Some(goal) = &work.goals.stability
        && stability::of(sections, work.goals).is_some_and(|it| !it.is_stable())
    {
        // Whatever else would be changed, it would be at a speed that is not stable.
        return Ok(match speed::stable(work, &as_programmed, goal)? {
            Ok(changed) => draft.changed(margin, changed),
            Err(reason) => draft.not_possible(margin, reason),
        });
    }
    let suffices = is_followed && margin >= goals.margin * (1.0 - ROUNDING);
    let corners = SectionCorners::of(sections, &work.config.vibration());
    let at_corners = || match &corners {
        Ok(Some(corners)) => written_at_corners(&search, corners, &as_programmed, least_amplitude),
        _ => None,
    };
    if suffices && let Some((line, revolutions)) = corner {
        return Ok(match at_corners() {
            Some((found, words)) => draft.written(margin, &search, found, words),
            None => draft.not_possible(margin, whole_at_corners(line, revolutions, &corners, words.is_some())),
        });
    }
    if suffices && !least_amplitude {
        return Ok(draft.with(margin, Outcome::Holds));
    }
    let Some(found) = search.solve() else {
        if suffices {
            return Ok(draft.with(margin, Outcome::Holds));
        }
        let changed = if words.is_some() { speed::another(work, &as_programmed)? } else { None };
        let passing = judged::reached(sections, &work.goals.vibration);
        return Ok(match changed {
            Some(changed) => draft.changed(margin, changed),
            None => draft.not_possible(margin, nothing_breaks(passing)),
        });
    };
    let Some(words) = &words else { return Ok(draft.not_possible(margin, NO_WORDS)) };
    let plain = rounded(&search, found, programmed, words, least_amplitude);
    // A vibration that leaves the chip whole at corners is the best only where none breaks it there.
    let breaks = |it: &FoundVibration| !matches!(&corners, Ok(Some(corners)) if !corners.break_with(*it));
    let written = match plain {
        Some((found, changes)) if breaks(&found) => Some((found, changes)),
        plain => at_corners().or(plain),
    };
    Ok(match written {
        Some((found, changes)) => draft.written(margin, &search, found, changes),
        None => {
            draft.not_possible(margin, "what is enough cannot be written in the decimals of a word within the limits")
        }
    })
}

/// Why nothing can be looked for in these sections, whatever the limits.
fn unjudged(sections: &[&SectionReport], arriving: f64) -> Option<&'static str> {
    if sections.iter().any(|section| section.condition != sections[0].condition) {
        return Some("the block switches on different vibrations, as its words are computed");
    }
    if judged::followed(sections) <= 0.0 {
        return Some("the drives erase the vibration: nothing of it arrives at the tool");
    }
    (arriving <= 0.0)
        .then_some("its blends let nothing of the vibration through to the chip: it needs a longer section")
}

/// Why no vibration is enough, where blends let this share of the amplitude through to the chip.
fn nothing_breaks(passing: f64) -> String {
    if passing < 1.0 {
        return format!(
            "the blends let {} % of the amplitude through to the chip, and no vibration within the limits breaks it with that: a longer \
             section, or fewer corners in it, would let the whole through",
            decimal(100.0 * passing, 1)
        );
    }
    "no vibration within the range of frequencies, nine tenths of the axes' acceleration and jerk (the rest is kept for the feed) and the \
     limits of the profile breaks every chip so surely: a smaller feed, a smaller margin or tolerance, or another spindle speed would"
        .to_owned()
}

/// Why the chip stays whole at corners.
fn whole_at_corners(
    line: u32,
    revolutions: f64,
    corners: &Result<Option<SectionCorners<'_>>, TooManyCorners>,
    has_words: bool,
) -> String {
    let why = match corners {
        Err(TooManyCorners) => "there are too many corners to look for a vibration that breaks it",
        _ if !has_words => NO_WORDS,
        _ => "no vibration within the limits breaks it there",
    };
    format!("{}, and {why}: tangent arcs would let the vibration go on", left_by_corners(line, revolutions))
}

/// What corners leave of the chip, as a clause.
fn left_by_corners(line: u32, revolutions: f64) -> String {
    format!(
        "where the vibration is blended out and in at corners, the chip stays whole for up to {} revolutions, first from line {line} on",
        decimal(round_up(revolutions, 2), 2)
    )
}

fn unsearchable(reason: Unsearchable, sections: &[&SectionReport]) -> String {
    let text = match reason {
        Unsearchable::NoCut => "nothing is cut with a turning spindle",
        Unsearchable::SurfaceSpeed => {
            let speeds =
                sections.iter().filter_map(|section| section.surface_speed.as_ref()).map(|it| it.spindle_rev_per_min);
            let [slowest, fastest] =
                speeds.fold([f64::INFINITY, 0.0], |[low, high], it| [low.min(it[0]), high.max(it[1])]);
            let vibrations = |speed: f64| decimal(60.0 * sections[0].condition.frequency_hz / speed, 2);
            return format!(
                "at constant surface speed its spindle turns at {} to {} rev/min, and a revolution has {} to {} vibrations along the path: a \
                 constant spindle speed (G97) would make one frequency right",
                decimal(slowest, 0),
                decimal(fastest, 0),
                vibrations(fastest),
                vibrations(slowest)
            );
        }
        Unsearchable::TooManyCuts => "it has more different cuts than a report lists",
        Unsearchable::NoFrequency => "no frequency of the range is within the limits of the machine and the sampling",
    };
    text.to_owned()
}

/// Where chips of a line's sections do not break: as programmed, or only at some speed or feed that has to be safe as well.
fn unbroken<'a>(mut sections: impl Iterator<Item = &'a SectionReport>, goals: &SearchGoals) -> String {
    if !sections.all(|section| section.broken_share.is_some_and(|share| share >= 1.0)) {
        return "the chip does not break everywhere".to_owned();
    }
    let [speed, feed] = [goals.speed_tolerance, goals.max_feed_override].map(|share| decimal(100.0 * share, 2));
    format!(
        "the chip breaks as programmed, but not at every spindle speed within {speed} % and every feed up to {feed} %"
    )
}

/// What is said of a section.
fn step(section: &Section, before: &ValidationReport, state: &State, goals: &ImprovementGoals) -> ImprovementStep {
    let Section { line, programmed, margin, utilisation, .. } = section;
    let subject = vibration_text(*programmed);
    let [was, is] = [before, &state.after].map(|report| {
        let own: Vec<_> = report.sections.iter().filter(|it| it.on_line == *line).collect();
        stability::of(&own, goals)
    });
    let stability = is.map_or_else(String::new, |judged| format!("; {}", judged.text()));
    let of_kind = |kind, outcome, reason: String| ImprovementStep {
        line: *line,
        kind,
        subject: subject.clone(),
        outcome,
        reason: reason + &stability,
        changes: Vec::new(),
        figures: Vec::new(),
    };
    let changed = match &section.outcome {
        Outcome::Holds => {
            let reason = format!("margin {}", decimal(*margin, 4));
            return of_kind(ImprovementKind::Vibration, ImprovementOutcome::Stays, reason);
        }
        Outcome::NotPossible(reason) => {
            return of_kind(ImprovementKind::Vibration, ImprovementOutcome::NotPossible, reason.clone());
        }
        Outcome::Changed(changed) => changed,
    };
    let after: Vec<_> = state.after.sections.iter().filter(|it| it.on_line == *line).collect();
    let why = if !section.is_followed {
        "an axis cannot follow the vibration".to_owned()
    } else if *margin < 1.0 {
        unbroken(before.sections.iter().filter(|it| it.on_line == *line), &goals.vibration)
    } else if let Some((line, revolutions)) = section.corner {
        left_by_corners(line, revolutions)
    } else {
        format!("the chip breaks with a margin of {}", decimal(*margin, 4))
    };
    let was_unstable = was.filter(|it| !it.is_stable()).map_or_else(String::new, |it| format!(", and {}", it.text()));
    let figure = |name: &'static str, before, after, unit| ImprovementFigure { name: name.into(), before, after, unit };
    let mut figures = vec![figure("margin", *margin, changed.margin, "")];
    if changed.found.amplitude_mm != programmed.amplitude_mm {
        figures.push(figure("amplitude", programmed.amplitude_mm, changed.found.amplitude_mm, "mm"));
    }
    figures.push(figure("largest axis load", *utilisation, judged::utilisation(&after), ""));
    let mut kind = ImprovementKind::Vibration;
    if let Some([old, new]) = changed.speed_rev_per_min {
        kind = ImprovementKind::SpindleSpeed;
        figures.push(figure("spindle speed", old, new, "rev/min"));
        let margins = was.and_then(|it| it.margin()).zip(is.and_then(|it| it.margin()));
        figures.extend(margins.map(|(before, after)| figure("stability margin", before, after, "")));
        figures.push(figure("machining time", before.summary.duration_s, state.after.summary.duration_s, "s"));
    }
    let change = |(word, new): &(Word, String)| WordChange {
        span: word.span,
        old: word.text.clone(),
        new: word.in_its_case(new.clone()),
    };
    let step = of_kind(kind, ImprovementOutcome::Changed, format!("at {subject} {why}{was_unstable}"));
    ImprovementStep { changes: changed.words.iter().map(change).collect(), figures, ..step }
}
