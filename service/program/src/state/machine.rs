//! What M codes leave for the blocks behind them: saved modes, overrides.

use serde::{Deserialize, Serialize};

use crate::interpreter::SavedModes;

/// What M codes of the machine leave for the blocks behind them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct MachineModes {
    /// What overrides the machine takes.
    pub(crate) overrides: Overrides,
    /// `M29`: the next tapping cycle is rigid, until the end of the cycles.
    pub(crate) rigid_tapping: bool,
    /// The tool was changed while a length was in force, and neither has a length been called nor Z moved since.
    pub(crate) keeps_length: bool,
    /// Numbers of the unlisted M codes that have been noted.
    pub(crate) noted: Vec<u32>,
    /// What `M70` or `M73` has saved in the program that is read.
    pub(crate) context: ModeContext,
    /// Modes that the end of a called program restores (`M73`), until that is done.
    pub(crate) returning: Option<Box<SavedModes>>,
}

/// LinuxCNC: what overrides the machine takes (`M48` to `M53`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
pub(crate) struct Overrides {
    pub(crate) feed: bool,
    pub(crate) speed: bool,
    pub(crate) adaptive_feed: bool,
    pub(crate) feed_hold: bool,
}

impl Default for Overrides {
    /// As LinuxCNC starts.
    fn default() -> Self {
        Self { feed: true, speed: true, adaptive_feed: false, feed_hold: true }
    }
}

impl Overrides {
    /// Carries out an M code with its `P`: 0 switches off.
    pub(crate) fn switch(&mut self, number: u32, p: Option<f64>) {
        let on = p != Some(0.0);
        match number {
            48 | 49 => (self.feed, self.speed) = (number == 48, number == 48),
            50 => self.feed = on,
            51 => self.speed = on,
            52 => self.adaptive_feed = on,
            53 => self.feed_hold = on,
            _ => {}
        }
    }

    /// Of these the ones that `M72` restores. Its interpreter writes one code for both overrides, which switches on what was on
    /// alone and leaves the other as it is. Adaptive feed and feed hold it switches on where they were on, and off never.
    pub(crate) const fn restore(&mut self, saved: Self) {
        match (saved.feed, saved.speed) {
            _ if self.feed == saved.feed && self.speed == saved.speed => {}
            (true, false) => self.feed = true,
            (false, true) => self.speed = true,
            (feed, speed) => (self.feed, self.speed) = (feed, speed),
        }
        self.adaptive_feed |= saved.adaptive_feed;
        self.feed_hold |= saved.feed_hold;
    }
}

/// What `M70` or `M73` has saved: each called program has its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ModeContext {
    pub(crate) saved: Option<Box<SavedModes>>,
    /// `M73`: the end of the program restores them.
    pub(crate) restores_at_return: bool,
}
