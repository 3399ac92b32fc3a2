//! Telemetry that stops while tool and work touch, and what follows.

use super::{Monitor, State};
use crate::decision::{Decision, Evidence, HoldReason};
use crate::rules::Fallback;
use serde::{Deserialize, Serialize};

/// How far a silence has come. In snapshots as 0, 1 and 2: the first two were a flag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Silence {
    /// There is none, or it was not noticed yet.
    None,
    /// It has brought its fallback.
    Told,
    /// Its fallback is due when nothing locks the overrides any more.
    Owed,
}

impl Monitor {
    /// Whether telemetry is silent, and its fallback waits for the end of a thread or of a hold.
    pub fn owes_fallback(&self) -> bool {
        self.run.silence == Silence::Owed
    }

    /// Telemetry stopped: the fallback, once, if tool and work touch.
    pub(super) fn fall_silent(&mut self, sink: &mut dyn FnMut(Decision)) {
        if !self.is_cutting() || self.run.silence != Silence::None {
            return;
        }
        let is_locked = self.run.threading || self.run.held_feed.is_some();
        let waits = is_locked && self.config.rules.fallback == Fallback::Full;
        self.run.silence = if waits { Silence::Owed } else { Silence::Told };
        let time_ns = self.run.last_ns.map_or(0, |last| last.saturating_add(self.times.silence));
        self.decide_in_silence(time_ns, sink);
    }

    /// A thread or a hold may have ended: the fallback that waited for that.
    pub(super) fn settle_silence(&mut self, sink: &mut dyn FnMut(Decision)) {
        let is_locked = self.run.threading || self.run.held_feed.is_some();
        if !self.owes_fallback() || is_locked || !self.is_cutting() {
            return;
        }
        self.run.silence = Silence::Told;
        let noticed = self.run.last_ns.map_or(0, |last| last.saturating_add(self.times.silence));
        self.decide_in_silence(self.run.clock_ns.map_or(noticed, |clock| clock.max(noticed)), sink);
    }

    fn decide_in_silence(&mut self, time_ns: u64, sink: &mut dyn FnMut(Decision)) {
        let span = std::mem::take(&mut self.run.window.span);
        self.decide(time_ns, span, Evidence::Silence { tolerated_ns: self.times.silence }, sink);
        if self.run.state != State::Stopped {
            self.restart_window();
            self.run.window.invalidate(HoldReason::TimeGap);
        }
    }
}
