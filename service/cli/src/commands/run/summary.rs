//! Summary of a run.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use feedwave_contract::proto::decision_inputs::Evidence;
use feedwave_contract::proto::{Decision, RunEnded, RunFeedChange};

/// One feed override in force.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    first_index: u64,
    ratio: f64,
    /// Deviation of the last window under it.
    deviation: Option<f64>,
}

/// Collects it.
#[derive(Debug)]
pub(in crate::commands) struct Summary {
    stretches: Vec<Stretch>,
    /// Decisions by action.
    actions: BTreeMap<&'static str, u64>,
    pub(in crate::commands) end: Option<RunEnded>,
}

impl Default for Summary {
    fn default() -> Self {
        let programmed = Stretch { first_index: 0, ratio: 1.0, deviation: None };
        Self { stretches: vec![programmed], actions: BTreeMap::new(), end: None }
    }
}

impl Summary {
    /// A decision; that of the window that causes a change comes before the change.
    pub(super) fn decided(&mut self, decision: &Decision) {
        let action = decision.outcome.unwrap_or_default().action().as_str_name();
        *self.actions.entry(action.trim_start_matches("DECISION_ACTION_")).or_default() += 1;
        let evidence = decision.inputs.as_ref().and_then(|inputs| inputs.evidence.as_ref());
        if let (Some(Evidence::Process(process)), Some(stretch)) = (evidence, self.stretches.last_mut()) {
            stretch.deviation = Some(process.max_deviation);
        }
    }

    /// Changes of the feed so far.
    pub(in crate::commands) fn changes(&self) -> usize {
        self.stretches.len() - 1
    }

    pub(super) fn changed(&mut self, change: RunFeedChange) {
        self.stretches.push(Stretch { first_index: change.setpoint_index, ratio: change.ratio, deviation: None });
    }

    /// Whether a list of all changes begins with those heard of.
    pub(super) fn begins(&self, changes: &[RunFeedChange]) -> bool {
        let heard = &self.stretches[1..];
        heard.len() <= changes.len()
            && heard
                .iter()
                .zip(changes)
                .all(|(heard, change)| (heard.first_index, heard.ratio) == (change.setpoint_index, change.ratio))
    }

    /// As text for people.
    pub(super) fn text(&self, run: &str, period_us: f64) -> String {
        let mut text = format!("\n{:>12}  {:>12}  {:>15}\n", "from s", "feed %", "last deviation");
        let time_s = |index: u64| index as f64 * period_us * 1e-6;
        for stretch in &self.stretches {
            let deviation = stretch.deviation.map_or_else(|| "-".to_owned(), |value| format!("{value:.6}"));
            let (from_s, percent) = (time_s(stretch.first_index), 100.0 * stretch.ratio);
            let _ = writeln!(text, "{from_s:>12.3}  {percent:>12.1}  {deviation:>15}");
        }
        let decisions: u64 = self.actions.values().sum();
        let each: Vec<_> =
            self.actions.iter().map(|(action, count)| format!("{count} {}", action.to_lowercase())).collect();
        let _ = writeln!(text, "\n{decisions} decisions: {}", each.join(", "));
        if let Some(end) = &self.end {
            let state = end.state().as_str_name().trim_start_matches("RUN_STATE_").to_lowercase();
            let why = if end.message.is_empty() { String::new() } else { format!(" ({})", end.message) };
            let (setpoints, seconds) = (end.setpoint_count, time_s(end.setpoint_count));
            let _ =
                writeln!(text, "{run}: {state}{why}: {setpoints} setpoints, {seconds:.3} s, SHA-256 {}", end.digest);
        }
        text
    }
}
