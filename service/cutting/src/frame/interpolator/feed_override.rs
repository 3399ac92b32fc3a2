//! A change of the feed override while the path is run, and feed hold.
//!
//! What was handed out stays. From the instant of the change on, the acceleration in progress is ended as soon as the
//! jerk allows; from there on everything ahead is planned anew. While the path brakes, it goes on braking first. The
//! path itself is the same all the time.

use feedwave_motion::{
    Ahead, Course, PathItem, Planned, PlannedMotion, PlannedStretch, Planner, ProfilePart, StretchProfile,
};

use super::{Activity, ActivityKind, After, Barrier, Interpolator, State, Track};
use crate::frame::config::MAX_SETPOINTS;

/// A place this close to the end of a stretch is its end, mm: rounding of path lengths.
const SAME_PLACE_MM: f64 = 1e-9;
/// When a change is tried again that the course in progress has no room for, s.
const TRY_AGAIN_S: f64 = 0.01;

/// Whether this stretch of the present motion is on a course.
fn is_on_course(state: &State, index: usize) -> bool {
    let motion = state.track.motion(state.track.current_index());
    let stretch = motion.and_then(|motion| motion.stretches.get(index));
    stretch.is_some_and(|stretch| matches!(stretch.profile, StretchProfile::Course(_)))
}

impl Interpolator {
    /// Makes [`Interpolator::fill`] stop before the setpoint with this index.
    pub(crate) fn pause_at(&mut self, index: Option<u64>) {
        self.state.pause = index;
    }

    /// See [`Interpolator::pause_at`].
    pub(crate) fn pause(&self) -> Option<u64> {
        self.state.pause
    }

    /// Changes the feed override at the instant of the next setpoint, where [`Interpolator::fill`] has paused. Where the
    /// path brakes too hard to be planned anew, it is run as it is, and where a vibration has to become larger first, the
    /// feed waits: the answer is the index at which to try again.
    pub(crate) fn change_override(&mut self, planner: &mut Planner<Barrier>, ratio: f64) -> Option<u64> {
        let activity = self.state.activity?;
        if ratio > self.state.feed_override {
            let ready = self.state.functions.vibration.suffices_from(self.settings.period_s, ratio);
            if ready > self.state.next {
                return Some(ready);
            }
        }
        let current = self.state.track.current_index();
        let changed = match activity.kind {
            ActivityKind::Stretch(index) if is_on_course(&self.state, index) => {
                self.change_course(planner, activity, index, ratio)
            }
            ActivityKind::Stretch(index) => self.break_off(planner, activity, index, ratio),
            // Nothing is in progress: the current item has not been begun.
            ActivityKind::Hold { .. } if self.state.after == After::Continue => {
                self.restart_at_rest(planner, current, ratio)
            }
            // A pass that has begun is cut to its end.
            _ => self.restart_at_rest(planner, current + 1, ratio),
        };
        let Some(motions) = changed else {
            let soon = self.state.next + (TRY_AGAIN_S / self.settings.period_s).ceil() as u64;
            let is_course = matches!(activity.kind, ActivityKind::Stretch(index) if is_on_course(&self.state, index));
            return Some(if is_course { soon } else { activity.last + 1 });
        };
        for motion in motions {
            self.push(Planned::Motion(motion));
        }
        None
    }

    /// Lets the amplitude of a vibration follow a feed override that is asked for from the next setpoint on.
    pub(crate) fn follow_with_amplitude(&mut self, ratio: f64) {
        self.state.functions.vibration.follow(self.settings.period_s, self.state.next, ratio);
    }

    /// Commanded place of the next setpoint in the vibrating section in progress, mm from its start.
    pub(crate) fn section_place_mm(&self) -> Option<f64> {
        let state = &self.state;
        let item = state.track.current_index();
        let start_mm = state.functions.vibration.place_mm(state.track.section_place(item).0)?;
        let (Some(activity), Some(motion)) = (state.activity, state.track.motion(item)) else { return Some(start_mm) };
        let s = match activity.kind {
            ActivityKind::Stretch(index) => {
                let PlannedStretch { start, profile, .. } = motion.stretches.get(index)?;
                let (mut s, mut speed) = ([0.0], [0.0]);
                let first = state.next - state.clock.period;
                profile.fill(first, self.settings.period_s, state.clock.lead_s, &mut s, &mut speed);
                start + s[0]
            }
            ActivityKind::FeedHold { s } => s,
            _ => motion.element.length,
        };
        Some(start_mm + s)
    }

    /// Rests while no speed is commanded. Without a next change that lasts, as one activity, until one is appended or there are too many
    /// setpoints: where activities end, the spindle's angle is rounded.
    pub(crate) fn hold_feed(&mut self) {
        let until = self.state.pause.unwrap_or(MAX_SETPOINTS + 1).max(self.state.next);
        let current = self.state.track.current_index();
        let kind = match self.state.track.motion(current) {
            Some(motion) => ActivityKind::FeedHold { s: motion.stretches.last().map_or(0.0, |last| last.stretch.end) },
            None => ActivityKind::Hold { line: self.state.rest.line },
        };
        self.hold(kind, self.duration_until_s(until), After::Continue);
        self.end_activity_at(until);
    }

    /// Ends the feed hold in progress, where there is one, at the setpoint with the index `until` if it would last
    /// longer.
    pub(crate) fn end_feed_hold_at(&mut self, until: u64) {
        let Some(activity) = self.state.activity else { return };
        // Of all rests only a feed hold goes on with what it interrupted.
        let is_feed_hold = self.state.after == After::Continue
            && matches!(activity.kind, ActivityKind::Hold { .. } | ActivityKind::FeedHold { .. });
        if is_feed_hold && activity.last > until {
            self.end_activity_at(until);
        }
    }

    fn duration_until_s(&self, until: u64) -> f64 {
        ((until - self.state.clock.period) as f64 * self.settings.period_s - self.state.clock.lead_s).max(0.0)
    }

    fn end_activity_at(&mut self, until: u64) {
        let duration_s = self.duration_until_s(until);
        if let Some(activity) = &mut self.state.activity {
            activity.duration_s = duration_s;
            activity.end.period = until;
            activity.end.lead_s = 0.0;
            activity.last = until;
        }
    }

    /// Shows the path beyond a feed hold to the vibration, which may reach over it.
    pub(crate) fn show_path<'a>(&mut self, path: impl Iterator<Item = Ahead<'a, Barrier>>) {
        let State { track, functions, .. } = &mut self.state;
        track.show_path(path, |track| functions.know_path(track));
    }

    /// Whether an activity is not over, or there is a planned motion to go on with.
    pub(crate) fn goes_on(&self) -> bool {
        if self.state.activity.is_some() {
            return true;
        }
        let motion = self.state.track.motion(self.state.track.current_index());
        motion.is_some_and(|motion| self.state.resume.unwrap_or(0) < motion.stretches.len())
    }

    /// Has everything from an item of the track on planned anew, from rest.
    fn restart_at_rest(
        &mut self,
        planner: &mut Planner<Barrier>,
        from: usize,
        ratio: f64,
    ) -> Option<Vec<PlannedMotion>> {
        let track = &mut self.state.track;
        planner.restart(0.0, ratio, track.planned_from(from).map(PathItem::from).collect()).ok()?;
        track.withdraw(from);
        Some(Vec::new())
    }

    /// Ends the acceleration of the stretch in progress and has the path from there on planned anew.
    fn break_off(
        &mut self,
        planner: &mut Planner<Barrier>,
        activity: Activity,
        index: usize,
        ratio: f64,
    ) -> Option<Vec<PlannedMotion>> {
        let now_s = self.now_s();
        let track = &mut self.state.track;
        let current = track.current_index();
        let mut parts = vec![phases(track, current, index)?.broken_off(now_s)];
        let (mut item, mut stretch) = (current, index);
        // The run may go on over several elements before its acceleration has ended.
        let end_mm = loop {
            let part = parts.last()?;
            let planned = track.motion(item)?.stretches.get(stretch)?;
            let [_, wanted] = planned.profile.phases()?.range();
            let [_, reached] = part.range();
            if reached < wanted - SAME_PLACE_MM {
                break planned.start + part.length();
            }
            if reached >= part.whole().length() - SAME_PLACE_MM {
                break planned.stretch.end;
            }
            (item, stretch) = next_stretch(track, planner, item, stretch)?;
            let next = phases(track, item, stretch)?.after(parts.last()?);
            parts.push(next);
        };
        let motion = track.motion(item)?;
        let next = if end_mm < motion.stretches[stretch].stretch.end { stretch } else { stretch + 1 };
        let rest_of_element = (next < motion.stretches.len()).then(|| motion.request_from(next, end_mm));
        let mut path: Vec<_> = rest_of_element.map(PathItem::Motion).into_iter().collect();
        path.extend(track.planned_from(item + 1).map(PathItem::from));
        planner.restart(parts.last()?.whole().end_velocity(), ratio, path).ok()?;

        track.withdraw(item + 1);
        let (mut at, mut own) = (current, index);
        for part in parts {
            let motion = track.motion_mut(at)?;
            motion.stretches[own].profile = StretchProfile::Phases(part);
            (at, own) = if own + 1 < motion.stretches.len() { (at, own + 1) } else { (at + 1, 0) };
        }
        let motion = track.motion_mut(item)?;
        motion.stretches.truncate(stretch + 1);
        motion.stretches[stretch].stretch.end = end_mm;
        self.end_with_stretch(activity, index)?;
        Some(Vec::new())
    }

    /// Has the course in progress planned anew from the present speed and acceleration, and the path behind it; the motions on the
    /// course.
    fn change_course(
        &mut self,
        planner: &mut Planner<Barrier>,
        activity: Activity,
        index: usize,
        ratio: f64,
    ) -> Option<Vec<PlannedMotion>> {
        let now_s = self.now_s();
        let track = &mut self.state.track;
        let current = track.current_index();
        let mut item = current;
        let (first, mut behind) = track.motion(current)?.rest_of_course(index, now_s)?;
        let length_mm = |motion: &PlannedMotion| motion.stretches.iter().map(|own| own.profile.length()).sum::<f64>();
        let mut known_mm = length_mm(&first);
        let mut rest = vec![first];
        // It may go on over several elements.
        while behind.is_none() && known_mm < planner.reach_of_change(&rest) {
            item += 1;
            if track.motion(item).is_none() {
                // What is known may do where the next one waits for more of the path.
                let Some(next) = planner.pop() else { break };
                track.push(next);
            }
            let Some((motion, next)) = track.motion(item).and_then(|motion| motion.rest_of_course(0, 0.0)) else {
                break;
            };
            known_mm += length_mm(&motion);
            rest.push(motion);
            behind = next;
        }
        let last = current + rest.len() - 1;
        let motion = track.motion(last)?;
        let rest_of_element = behind.and_then(|next| {
            let planned = motion.stretches.get(next)?;
            Some(PathItem::Motion(motion.request_from(next, planned.start)))
        });
        let mut path: Vec<_> = rest_of_element.into_iter().collect();
        path.extend(track.planned_from(last + 1).map(PathItem::from));
        let run = self.course_until(current, index, now_s)?;
        let motions = planner.change_course(&rest, ratio, path)?;

        let track = &mut self.state.track;
        track.withdraw(current + 1);
        let motion = track.motion_mut(current)?;
        motion.stretches.truncate(index + 1);
        let planned = motion.stretches.get_mut(index)?;
        planned.stretch.end = planned.start + run.length();
        planned.profile = StretchProfile::Course(run);
        self.end_with_stretch(activity, index)?;
        Some(motions)
    }

    /// Time since the activity in progress began, s.
    fn now_s(&self) -> f64 {
        let clock = self.state.clock;
        (self.state.next - clock.period) as f64 * self.settings.period_s - clock.lead_s
    }

    /// What comes of the course of a stretch before a local time, s.
    fn course_until(&self, item: usize, stretch: usize, t_s: f64) -> Option<Course> {
        match &self.state.track.motion(item)?.stretches.get(stretch)?.profile {
            StretchProfile::Course(course) => Some(course.until(t_s)),
            StretchProfile::Phases(_) => None,
        }
    }

    /// Ends the activity in progress with the stretch of the current motion that it is on, which was changed.
    fn end_with_stretch(&mut self, activity: Activity, stretch: usize) -> Option<()> {
        let motion = self.state.track.motion(self.state.track.current_index())?;
        let duration_s = motion.stretches.get(stretch)?.profile.duration();
        let end = self.state.clock.advanced(duration_s, self.settings.period_s);
        self.state.activity = Some(Activity { end, last: end.period, duration_s, ..activity });
        Some(())
    }
}

/// The phases of a stretch of a motion of the track.
fn phases(track: &Track<Barrier>, item: usize, stretch: usize) -> Option<&ProfilePart> {
    track.motion(item)?.stretches.get(stretch)?.profile.phases()
}

/// The stretch behind this one, of its motion or of the next one, which is taken where it was not.
fn next_stretch(
    track: &mut Track<Barrier>,
    planner: &mut Planner<Barrier>,
    item: usize,
    stretch: usize,
) -> Option<(usize, usize)> {
    if stretch + 1 < track.motion(item)?.stretches.len() {
        return Some((item, stretch + 1));
    }
    if track.motion(item + 1).is_none() {
        track.push(planner.pop()?);
    }
    Some((item + 1, 0))
}
