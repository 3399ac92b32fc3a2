//! The feed of a live run: what decisions and the operator want of it, and the log of its changes.

use std::fmt;
use std::str::FromStr;

use feedwave_contract::proto;
use feedwave_cutting::{OverrideChange, SpindleChange};
use feedwave_store::RunOverride;
use proto::FeedChangeCause;

use crate::error::{Error, Result};

/// Why the feed changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cause {
    /// The decision with this number.
    Decision(u64),
    Hold,
    Resume,
    /// The decision with this number stops the machine.
    Stop(u64),
    Abort,
    /// The decision with this number holds the feed.
    Escalation(u64),
    /// A planned change of the spindle speed, of which the decision with this number says that it is reached.
    Spindle(u64, SpindleChange),
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Decision(number) => write!(f, "decision {number}"),
            Self::Hold => f.write_str("hold"),
            Self::Resume => f.write_str("resume"),
            Self::Stop(number) => write!(f, "stop {number}"),
            Self::Abort => f.write_str("abort"),
            Self::Escalation(number) => write!(f, "escalation {number}"),
            // The shortest decimals that are this ratio.
            Self::Spindle(number, SpindleChange { index, ratio }) => write!(f, "spindle {number} {index} {ratio}"),
        }
    }
}

impl FromStr for Cause {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (word, number) = text.split_once(' ').unwrap_or((text, ""));
        if word == "spindle"
            && let Some(cause) = spindle_cause(number)
        {
            return Ok(cause);
        }
        match (word, number.parse()) {
            ("decision", Ok(number)) => Ok(Self::Decision(number)),
            ("stop", Ok(number)) => Ok(Self::Stop(number)),
            ("escalation", Ok(number)) => Ok(Self::Escalation(number)),
            ("hold", _) => Ok(Self::Hold),
            ("resume", _) => Ok(Self::Resume),
            ("abort", _) => Ok(Self::Abort),
            _ => Err(Error::internal(format!("a stored change of the feed has the cause {text:?}"))),
        }
    }
}

fn spindle_cause(words: &str) -> Option<Cause> {
    let mut words = words.split(' ');
    let (number, index) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    let ratio = words.next()?.parse().ok()?;
    words.next().is_none().then_some(Cause::Spindle(number, SpindleChange { index, ratio }))
}

/// A stored change as the contract has it.
///
/// # Errors
/// [`Error::Internal`] for a cause that nothing writes.
pub(crate) fn feed_change_to_proto(change: &RunOverride) -> Result<proto::RunFeedChange> {
    let mut spindle = None;
    let (cause, decision_number) = match change.cause.parse()? {
        Cause::Decision(number) => (FeedChangeCause::Decision, number),
        Cause::Hold => (FeedChangeCause::Hold, 0),
        Cause::Resume => (FeedChangeCause::Resume, 0),
        Cause::Stop(number) => (FeedChangeCause::Stop, number),
        Cause::Abort => (FeedChangeCause::Abort, 0),
        Cause::Escalation(number) => (FeedChangeCause::Escalation, number),
        Cause::Spindle(number, SpindleChange { index, ratio }) => {
            spindle = Some(proto::RunSpindleChange { setpoint_index: index, ratio });
            (FeedChangeCause::Spindle, number)
        }
    };
    let RunOverride { setpoint_index, ratio, .. } = *change;
    Ok(proto::RunFeedChange { setpoint_index, ratio, cause: cause.into(), decision_number, spindle })
}

/// The log of feed changes of a run, and what the operator and the decisions request now.
#[derive(Debug)]
pub(super) struct Feed {
    log: Vec<RunOverride>,
    /// The operator holds.
    pub(super) held: bool,
    /// Why the run is to end at rest.
    pub(super) ending: Option<Cause>,
    /// Cause of the next change, where there is one.
    cause: Option<Cause>,
    /// A change of the spindle speed that is to be logged.
    spindle: Option<Cause>,
}

impl Feed {
    /// As the log left it.
    pub(super) fn new(log: &[RunOverride]) -> Result<Self> {
        let last: Option<Cause> = log.last().map(|last| last.cause.parse()).transpose()?;
        // What holds the feed is what came before the changes of the spindle speed.
        let lasting =
            log.iter().rev().map(|change| change.cause.parse()).find(|cause| !matches!(cause, Ok(Cause::Spindle(..))));
        Ok(Self {
            log: log.to_vec(),
            held: lasting.transpose()? == Some(Cause::Hold),
            ending: last.filter(|last| matches!(last, Cause::Stop(_) | Cause::Abort)),
            cause: None,
            spindle: None,
        })
    }

    /// Changes so far.
    pub(super) fn log(&self) -> &[RunOverride] {
        &self.log
    }

    /// Changes so far, for the pipeline.
    pub(super) fn changes(&self) -> Vec<OverrideChange> {
        self.log.iter().map(|change| OverrideChange { index: change.setpoint_index, ratio: change.ratio }).collect()
    }

    /// Changes of the spindle speed so far, for the pipeline.
    pub(super) fn spindle_changes(&self) -> Result<Vec<SpindleChange>> {
        let causes = self.log.iter().map(|change| change.cause.parse());
        causes.filter_map(|cause| spindle_of(cause).transpose()).collect()
    }

    /// Logs a change of the spindle speed with the next change of the feed.
    pub(super) const fn set_spindle(&mut self, decision: u64, change: SpindleChange) {
        self.spindle = Some(Cause::Spindle(decision, change));
    }

    /// Sets the cause of the next change of the feed.
    pub(super) fn set_cause(&mut self, cause: Cause) {
        match cause {
            Cause::Hold => self.held = true,
            Cause::Resume => self.held = false,
            Cause::Stop(_) | Cause::Abort => self.ending = self.ending.or(Some(cause)),
            Cause::Decision(_) | Cause::Escalation(_) | Cause::Spindle(..) => {}
        }
        self.cause = Some(cause);
    }

    /// The change that is due at setpoint `index`, given the feed decided last; it is in the log from now on.
    pub(super) fn change(&mut self, decided: f64, index: u64) -> Option<RunOverride> {
        let rest = self.held || self.ending.is_some();
        let ratio = if rest { 0.0 } else { decided };
        let spindle = self.spindle.take();
        let cause = spindle.or(self.cause.take());
        let now = self.log.last().map_or(1.0, |last| last.ratio);
        // A hold is noted even where an escalation holds the feed already, so that it is known when the run is taken up.
        let marks = self.log.last().is_some_and(|last| cause.is_some_and(|cause| changes_kind(&last.cause, cause)));
        if ratio == now && !marks && spindle.is_none() {
            return None;
        }
        let cause = spindle.or(self.ending).or(cause)?;
        let number = self.log.len() as u64;
        let change = RunOverride { number, setpoint_index: index, ratio, cause: cause.to_string() };
        self.log.push(change.clone());
        Some(change)
    }
}

fn spindle_of(cause: Result<Cause>) -> Result<Option<SpindleChange>> {
    cause.map(|cause| match cause {
        Cause::Spindle(_, change) => Some(change),
        _ => None,
    })
}

/// Whether a change for this cause says something about the run that the last one did not.
fn changes_kind(last: &str, cause: Cause) -> bool {
    match cause {
        Cause::Stop(_) | Cause::Abort => !last.starts_with("stop") && !last.starts_with("abort"),
        Cause::Hold => last.starts_with("escalation"),
        Cause::Resume | Cause::Decision(_) | Cause::Escalation(_) | Cause::Spindle(..) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hold_outlives_decisions_and_a_resume_takes_the_last_one() {
        let mut feed = Feed::new(&[]).unwrap();
        assert_eq!(feed.change(1.0, 5), None, "nothing has happened");
        feed.set_cause(Cause::Decision(3));
        assert_eq!(feed.change(0.95, 10).map(|change| (change.setpoint_index, change.ratio)), Some((10, 0.95)));
        feed.set_cause(Cause::Hold);
        assert_eq!(feed.change(0.95, 20).unwrap().ratio, 0.0);
        feed.set_cause(Cause::Decision(4));
        assert_eq!(feed.change(0.9, 25), None);
        let again = Feed::new(&feed.log).unwrap();
        assert!(again.held && again.ending.is_none());
        feed.set_cause(Cause::Resume);
        let change = feed.change(0.9, 30).unwrap();
        assert_eq!((change.ratio, change.cause.as_str(), change.number), (0.9, "resume", 2));
    }

    #[test]
    fn a_stop_is_the_last_change_and_known_after_a_restart() {
        let mut feed = Feed::new(&[]).unwrap();
        feed.set_cause(Cause::Hold);
        feed.change(1.0, 1);
        feed.set_cause(Cause::Stop(7));
        assert_eq!(feed.change(1.0, 9).unwrap().cause, "stop 7");
        feed.set_cause(Cause::Resume);
        assert_eq!(feed.change(1.0, 11), None);
        assert_eq!(Feed::new(&feed.log).unwrap().ending, Some(Cause::Stop(7)));
    }

    #[test]
    fn causes_survive_the_log() {
        let spindle = Cause::Spindle(4, SpindleChange { index: 1_500, ratio: 0.1 + 0.2 });
        for cause in [
            Cause::Decision(7),
            Cause::Hold,
            Cause::Resume,
            Cause::Stop(0),
            Cause::Abort,
            Cause::Escalation(3),
            spindle,
        ] {
            assert_eq!(cause.to_string().parse::<Cause>().unwrap(), cause);
        }
        assert!("decision x".parse::<Cause>().is_err());
        assert!("spindle 4 1500".parse::<Cause>().is_err());
        assert!("spindle 4 1500 0.9 1".parse::<Cause>().is_err());
    }

    #[test]
    fn a_change_of_the_spindle_is_logged_though_the_feed_stays_and_ends_no_hold() {
        let mut feed = Feed::new(&[]).unwrap();
        feed.set_cause(Cause::Hold);
        feed.change(1.0, 5);
        let change = SpindleChange { index: 20, ratio: 0.9 };
        feed.set_spindle(3, change);
        feed.set_cause(Cause::Decision(4));
        let logged = feed.change(0.9, 20).unwrap();
        assert_eq!((logged.ratio, logged.cause.as_str()), (0.0, "spindle 3 20 0.9"));
        let again = Feed::new(feed.log()).unwrap();
        assert!(again.held);
        assert_eq!(again.spindle_changes().unwrap(), [change]);
        feed.set_cause(Cause::Resume);
        assert_eq!(feed.change(0.9, 30).unwrap().ratio, 0.9);
    }
}
