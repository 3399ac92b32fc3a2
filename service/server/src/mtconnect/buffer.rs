//! The last observations of all devices, by their sequence numbers.

use std::collections::{BTreeMap, VecDeque};

use super::values::{Active, Value};

/// Which item an observation is of: the device by its number, the item by its place in it.
pub(super) type ItemKey = (u32, u32);

/// What an observation says.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Observed {
    /// A value; of a condition only that it is not available.
    Value(Value),
    /// A condition is active, or says something new.
    Active(Active),
    /// The condition with this code is over.
    Over(String),
    /// No condition of the item is active.
    Normal,
}

/// Something that was observed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Observation {
    pub(super) sequence: u64,
    pub(super) item: ItemKey,
    /// When, µs since the Unix epoch.
    pub(super) time_us: i64,
    pub(super) what: Observed,
}

/// What every item shows at some sequence number.
#[derive(Clone, Debug, Default)]
pub(super) struct Snapshot(BTreeMap<ItemKey, Vec<Observation>>);

impl Snapshot {
    /// Takes an observation over.
    fn apply(&mut self, observation: &Observation) {
        let kept = self.0.entry(observation.item).or_default();
        let code_of = |kept: &Observation| match &kept.what {
            Observed::Active(active) => Some(active.code.clone()),
            _ => None,
        };
        match &observation.what {
            Observed::Value(_) | Observed::Normal => {
                kept.clear();
                kept.push(observation.clone());
            }
            Observed::Active(active) => {
                // What was before a condition is no more: normal, or not available.
                kept.retain(|kept| code_of(kept).is_some_and(|code| code != active.code));
                kept.push(observation.clone());
            }
            Observed::Over(over) => {
                kept.retain(|kept| code_of(kept).as_deref() != Some(over));
                if kept.is_empty() {
                    kept.push(Observation { what: Observed::Normal, ..observation.clone() });
                }
            }
        }
    }

    /// What an item shows: one value, or every active condition.
    pub(super) fn of(&self, item: ItemKey) -> &[Observation] {
        self.0.get(&item).map_or(&[], Vec::as_slice)
    }
}

/// The observations that are kept.
#[derive(Debug)]
pub(super) struct Buffer {
    capacity: usize,
    /// Consecutive in their sequence numbers.
    kept: VecDeque<Observation>,
    next: u64,
    newest: Snapshot,
    /// As it was before the oldest observation that is kept.
    oldest: Snapshot,
}

/// A part of the observations.
#[derive(Debug)]
pub(super) struct Part<'a> {
    pub(super) observations: Vec<&'a Observation>,
    /// Where a client goes on.
    pub(super) next: u64,
}

impl Buffer {
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, kept: VecDeque::new(), next: 1, newest: Snapshot::default(), oldest: Snapshot::default() }
    }

    pub(super) const fn capacity(&self) -> usize {
        self.capacity
    }

    /// Sequence number of the next observation.
    pub(super) const fn next(&self) -> u64 {
        self.next
    }

    /// That of the oldest that is kept; 1 while there is none.
    pub(super) fn first(&self) -> u64 {
        self.kept.front().map_or(1, |oldest| oldest.sequence)
    }

    /// That of the newest; 1 while there is none.
    pub(super) fn last(&self) -> u64 {
        self.kept.back().map_or(1, |newest| newest.sequence)
    }

    pub(super) fn push(&mut self, item: ItemKey, time_us: i64, what: Observed) {
        let observation = Observation { sequence: self.next, item, time_us, what };
        self.next += 1;
        self.newest.apply(&observation);
        self.kept.push_back(observation);
        if self.kept.len() > self.capacity
            && let Some(passed) = self.kept.pop_front()
        {
            self.oldest.apply(&passed);
        }
    }

    /// Forgets what the items of a device showed, of which no observation is kept.
    pub(super) fn forget(&mut self, device: u32) {
        for snapshot in [&mut self.newest, &mut self.oldest] {
            snapshot.0.retain(|item, _| item.0 != device);
        }
    }

    pub(super) const fn newest(&self) -> &Snapshot {
        &self.newest
    }

    /// What every item showed when `sequence` was the newest, which has to be kept.
    pub(super) fn at(&self, sequence: u64) -> Snapshot {
        let mut snapshot = self.oldest.clone();
        let until = self.kept.iter().take_while(|observation| observation.sequence <= sequence);
        until.for_each(|observation| snapshot.apply(observation));
        snapshot
    }

    /// Observations that are wanted, from `from` on up to `to`, at most `count`.
    pub(super) fn forwards(&self, from: u64, to: u64, count: usize, wanted: impl Fn(ItemKey) -> bool) -> Part<'_> {
        let mut next = from.max(self.first());
        let mut observations = Vec::new();
        let skipped = usize::try_from(next - self.first()).unwrap_or(usize::MAX);
        for observation in self.kept.iter().skip(skipped) {
            if observation.sequence > to || observations.len() >= count {
                break;
            }
            next = observation.sequence + 1;
            if wanted(observation.item) {
                observations.push(observation);
            }
        }
        Part { observations, next }
    }

    /// The same backwards, from `from` on; the next one is the one before the last that was looked at.
    pub(super) fn backwards(&self, from: u64, count: usize, wanted: impl Fn(ItemKey) -> bool) -> Part<'_> {
        let mut next = from.min(self.last());
        let mut observations = Vec::new();
        let known = self.kept.iter().rev().skip_while(|observation| observation.sequence > from);
        for observation in known {
            if observations.len() >= count {
                break;
            }
            next = observation.sequence.saturating_sub(1).max(self.first());
            if wanted(observation.item) {
                observations.push(observation);
            }
        }
        Part { observations, next }
    }
}

/// The observations that lead from what an item showed to a value of it.
pub(super) fn differences(shown: &[Observation], value: &Value) -> Vec<Observed> {
    match value {
        Value::Condition(active) => of_conditions(shown, active),
        value => {
            let same = matches!(shown, [Observation { what: Observed::Value(old), .. }] if old == value);
            if same { Vec::new() } else { vec![Observed::Value(value.clone())] }
        }
    }
}

fn of_conditions(shown: &[Observation], active: &[Active]) -> Vec<Observed> {
    let old: Vec<&Active> = shown
        .iter()
        .filter_map(|shown| match &shown.what {
            Observed::Active(active) => Some(active),
            _ => None,
        })
        .collect();
    if active.is_empty() {
        let is_normal = matches!(shown, [Observation { what: Observed::Normal, .. }]);
        return if is_normal { Vec::new() } else { vec![Observed::Normal] };
    }
    let over = old.iter().filter(|old| active.iter().all(|new| new.code != old.code));
    let over = over.map(|old| Observed::Over(old.code.clone()));
    let new = active.iter().filter(|new| !old.contains(new)).cloned().map(Observed::Active);
    new.chain(over).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn condition(code: &str, text: &str) -> Active {
        Active { is_fault: false, code: code.to_owned(), qualifier: None, text: text.to_owned() }
    }

    fn filled(capacity: usize, count: u64) -> Buffer {
        let mut buffer = Buffer::new(capacity);
        for number in 1..=count {
            let item = (0, (number % 2) as u32);
            buffer.push(item, number as i64, Observed::Value(Value::Whole(number)));
        }
        buffer
    }

    fn sequences(part: &Part<'_>) -> Vec<u64> {
        part.observations.iter().map(|observation| observation.sequence).collect()
    }

    #[test]
    fn a_client_goes_on_behind_what_was_looked_at() {
        let buffer = filled(10, 25);
        assert_eq!((buffer.first(), buffer.last(), buffer.next()), (16, 25, 26));
        let part = buffer.forwards(16, u64::MAX, 3, |_| true);
        assert_eq!((sequences(&part), part.next), (vec![16, 17, 18], 19));
        // What does not pass the filter was looked at as well.
        let part = buffer.forwards(19, u64::MAX, 100, |item| item.1 == 0);
        assert_eq!((sequences(&part), part.next), (vec![20, 22, 24], 26));
        let part = buffer.forwards(26, u64::MAX, 100, |_| true);
        assert_eq!((sequences(&part), part.next), (vec![], 26));
        let part = buffer.forwards(17, 19, 100, |_| true);
        assert_eq!((sequences(&part), part.next), (vec![17, 18, 19], 20));
        let part = buffer.backwards(25, 3, |_| true);
        assert_eq!((sequences(&part), part.next), (vec![25, 24, 23], 22));
        let part = buffer.backwards(17, 100, |_| true);
        assert_eq!((sequences(&part), part.next), (vec![17, 16], 16));
    }

    #[test]
    fn the_past_is_known_as_far_as_it_is_kept() {
        let buffer = filled(10, 25);
        for at in 16..=25 {
            let snapshot = buffer.at(at);
            let value = |item| match &snapshot.of((0, item))[0].what {
                Observed::Value(Value::Whole(value)) => *value,
                other => panic!("{other:?}"),
            };
            assert_eq!(value(0).max(value(1)), at);
            assert_eq!(value(0).abs_diff(value(1)), 1);
        }
    }

    #[test]
    fn conditions_of_an_item_are_active_together_and_end_one_by_one() {
        let mut buffer = Buffer::new(100);
        let key = (0, 0);
        let mut show = |active: &[Active]| {
            let new = differences(buffer.newest().of(key), &Value::Condition(active.to_vec()));
            let count = new.len();
            new.into_iter().for_each(|what| buffer.push(key, 0, what));
            (count, buffer.newest().of(key).len())
        };
        assert_eq!(show(&[]), (1, 1), "normal");
        assert_eq!(show(&[]), (0, 1));
        let (one, two) = (condition("A", "a"), condition("B", "b"));
        assert_eq!(show(std::slice::from_ref(&one)), (1, 1));
        assert_eq!(show(&[one.clone(), two.clone()]), (1, 2));
        assert_eq!(show(&[condition("A", "worse"), two.clone()]), (1, 2));
        assert_eq!(show(&[two]), (1, 1));
        assert_eq!(show(&[]), (1, 1));
        let shown = &buffer.newest().of(key)[0].what;
        assert_eq!(*shown, Observed::Normal);
        let gone = differences(buffer.newest().of(key), &Value::Unavailable);
        assert_eq!(gone, [Observed::Value(Value::Unavailable)]);
    }
}
