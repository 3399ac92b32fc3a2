//! Which validation gets the next turn. Nothing here has a clock or a thread: what is put in and charged decides.
//!
//! - Each client has the same share: the one that has used the least time is next, what it used at other replicas included.
//! - Within a client, validations not yet begun and those begun have the same share, so that a short program is not held up by
//!   long ones, nor these by many short ones.
//! - Of those not begun a small program comes before a large one, but each is passed by only so many later ones
//!   ([`MOST_PASSED`]): none starves. Those begun take turns.
//! - A validation whose earlier attempts ended with the process is begun while no other such one is under way: what it
//!   brings down again are not always the same others.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::time::Duration;

use uuid::Uuid;

/// Bytes of program for which a validation lets one later one pass.
const PASSED_PER_BYTES: u64 = 16 << 10;
/// Most later validations that one lets pass because it is large.
const MOST_PASSED: u64 = 4_096;

/// Most by which a client that used other replicas is behind those that have only this one: what nobody else wanted there is no debt
/// for ever.
const MOST_AHEAD: Duration = Duration::from_secs(10);

/// Place of a validation among those of its client that are not begun.
type Key = (u64, u64);

/// What a validation is to the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Its first turn.
    Fresh,
    /// It keeps what it has done between its turns.
    Begun,
}

/// A turn that was given.
#[derive(Debug)]
pub(super) struct Given<T> {
    pub(super) what: T,
    pub(super) client: String,
    pub(super) class: Class,
    pub(super) suspect: bool,
}

#[derive(Debug)]
struct Waiting<T> {
    what: T,
    job: Option<Uuid>,
}

#[derive(Debug)]
struct Client<T> {
    /// Time used by all its validations, and by those of each class.
    used: Duration,
    fresh_used: Duration,
    begun_used: Duration,
    fresh: BTreeMap<Key, Waiting<T>>,
    suspects: BTreeMap<Key, Waiting<T>>,
    /// Those begun, between two turns.
    resting: VecDeque<(T, bool)>,
    /// Those that were longer than a turn while no more could be begun: they wait for a place.
    set_aside: VecDeque<(Waiting<T>, bool)>,
    /// Begun validations, running or resting.
    begun: usize,
    running: usize,
}

impl<T> Client<T> {
    fn at(used: Duration) -> Self {
        Self {
            used,
            fresh_used: Duration::ZERO,
            begun_used: Duration::ZERO,
            fresh: BTreeMap::new(),
            suspects: BTreeMap::new(),
            resting: VecDeque::new(),
            set_aside: VecDeque::new(),
            begun: 0,
            running: 0,
        }
    }

    fn is_idle(&self) -> bool {
        self.running == 0
            && self.begun == 0
            && self.fresh.is_empty()
            && self.suspects.is_empty()
            && self.set_aside.is_empty()
    }

    /// Where the next one not begun is, among those that may be.
    fn first(&self, suspects_too: bool) -> Option<(Key, bool)> {
        let fresh = self.fresh.first_key_value().map(|(key, _)| (*key, false));
        let suspect = self.suspects.first_key_value().map(|(key, _)| (*key, true)).filter(|_| suspects_too);
        fresh.into_iter().chain(suspect).min()
    }
}

/// The schedule of all validations.
#[derive(Debug)]
pub(super) struct Schedule<T> {
    clients: BTreeMap<String, Client<T>>,
    /// Where a job that is not begun waits.
    places: HashMap<Uuid, (String, Key, bool)>,
    /// Counts what was ever put in.
    arrivals: u64,
    /// Time used by the client that was served last: a client that comes starts there.
    virtual_time: Duration,
    /// Most that one turn counts among the classes of a client: one step that took long is no reason for short ones to wait.
    most_charged: Duration,
    /// Most begun at a time; of these one client has at most half.
    most_begun: usize,
    begun: usize,
    /// Suspects under way.
    suspects: usize,
}

impl<T> Schedule<T> {
    /// An empty schedule that lets `most_begun` validations keep what they have done between their turns, which are about as
    /// long as `turn`.
    pub(super) fn new(most_begun: usize, turn: Duration) -> Self {
        Self {
            clients: BTreeMap::new(),
            places: HashMap::new(),
            arrivals: 0,
            virtual_time: Duration::ZERO,
            most_charged: 2 * turn,
            most_begun,
            begun: 0,
            suspects: 0,
        }
    }

    fn client(&mut self, name: &str) -> &mut Client<T> {
        // Not `entry`: the name is copied for a new client only.
        if !self.clients.contains_key(name) {
            self.clients.insert(name.to_owned(), Client::at(self.virtual_time));
        }
        self.clients.get_mut(name).expect("it was just put in")
    }

    /// Puts in a validation that is not begun: of a stored job, or of a request.
    pub(super) fn add(&mut self, client: &str, program_bytes: u64, job: Option<Uuid>, suspect: bool, what: T) {
        self.arrivals += 1;
        let key = (self.arrivals + (program_bytes / PASSED_PER_BYTES).min(MOST_PASSED), self.arrivals);
        if let Some(id) = job {
            self.places.insert(id, (client.to_owned(), key, suspect));
        }
        let client = self.client(client);
        let queue = if suspect { &mut client.suspects } else { &mut client.fresh };
        if queue.is_empty() {
            client.fresh_used = client.fresh_used.max(client.begun_used);
        }
        queue.insert(key, Waiting { what, job });
    }

    /// Puts in a validation again that keeps what it has done: it holds a place among those begun.
    pub(super) fn rest(&mut self, client: &str, suspect: bool, what: T) {
        let client = self.client(client);
        if client.resting.is_empty() && client.set_aside.is_empty() {
            client.begun_used = client.begun_used.max(client.fresh_used);
        }
        client.resting.push_back((what, suspect));
    }

    /// Puts in a validation that gave up what it had done, since it found no place among those begun: of a stored job, or of a request.
    pub(super) fn set_aside(&mut self, client: &str, job: Option<Uuid>, suspect: bool, what: T) {
        let client = self.client(client);
        client.set_aside.push_back((Waiting { what, job }, suspect));
    }

    /// Whether a validation that had its first turn may keep what it has done; if so it holds a place from now on.
    pub(super) fn begin(&mut self, client: &str) -> bool {
        let most_of_one = self.most_begun.div_ceil(2);
        if self.begun >= self.most_begun || self.clients.get(client).is_none_or(|client| client.begun >= most_of_one) {
            return false;
        }
        self.begun += 1;
        self.client(client).begun += 1;
        true
    }

    /// Gives the next turn; `None` where nothing may have one.
    pub(super) fn next(&mut self) -> Option<Given<T>> {
        let most_of_one = self.most_begun.div_ceil(2);
        let (suspects_too, place) = (self.suspects == 0, self.begun < self.most_begun);
        let may_begin = |client: &Client<T>| {
            let next = client.set_aside.front();
            place && client.begun < most_of_one && next.is_some_and(|(_, suspect)| suspects_too || !suspect)
        };
        let ready = |client: &Client<T>| {
            !client.resting.is_empty() || client.first(suspects_too).is_some() || may_begin(client)
        };
        let (name, client) =
            self.clients.iter_mut().filter(|(_, client)| ready(client)).min_by_key(|(_, client)| client.used)?;
        let first = client.first(suspects_too);
        let long = !client.resting.is_empty() || may_begin(client);
        let class = match first {
            Some(_) if !long || client.fresh_used <= client.begun_used => Class::Fresh,
            _ => Class::Begun,
        };
        let (what, suspect) = match (class, first) {
            (Class::Fresh, Some((key, suspect))) => {
                let queue = if suspect { &mut client.suspects } else { &mut client.fresh };
                let waiting = queue.remove(&key)?;
                if let Some(id) = waiting.job {
                    self.places.remove(&id);
                }
                self.suspects += usize::from(suspect);
                (waiting.what, suspect)
            }
            // A place that is free is taken before those who have one go on.
            _ if may_begin(client) => {
                let (waiting, suspect) = client.set_aside.pop_front()?;
                client.begun += 1;
                self.begun += 1;
                self.suspects += usize::from(suspect);
                (waiting.what, suspect)
            }
            _ => client.resting.pop_front()?,
        };
        client.running += 1;
        self.virtual_time = self.virtual_time.max(client.used);
        Some(Given { what, client: name.clone(), class, suspect })
    }

    /// Charges a turn that has ended, for the time during which others waited.
    pub(super) fn charge(&mut self, name: &str, class: Class, used: Duration) {
        if let Some(client) = self.clients.get_mut(name) {
            client.used += used;
            let charged = used.min(self.most_charged);
            match class {
                Class::Fresh => client.fresh_used += charged,
                Class::Begun => client.begun_used += charged,
            }
        }
    }

    /// Charges what a client used at other replicas, where it has validations here: others come first until they had as much.
    pub(super) fn charge_elsewhere(&mut self, name: &str, used: Duration) {
        let most = self.virtual_time + MOST_AHEAD;
        if let Some(client) = self.clients.get_mut(name) {
            client.used = (client.used + used).min(most.max(client.used));
        }
    }

    /// Whether any client has validations.
    pub(super) fn is_idle(&self) -> bool {
        self.clients.is_empty()
    }

    /// Notes that a turn has ended; call before what had it is put in again.
    pub(super) fn turn_ended(&mut self, name: &str) {
        if let Some(client) = self.clients.get_mut(name) {
            client.running = client.running.saturating_sub(1);
        }
    }

    /// Notes that a validation is no longer under way; `begun` if it held a place.
    pub(super) fn leave(&mut self, name: &str, begun: bool, suspect: bool) {
        self.suspects = self.suspects.saturating_sub(usize::from(suspect));
        self.begun = self.begun.saturating_sub(usize::from(begun));
        if let Some(client) = self.clients.get_mut(name) {
            client.begun = client.begun.saturating_sub(usize::from(begun));
        }
        self.forget_if_idle(name);
    }

    /// Clients are remembered while they have validations only, so that their number is bounded by these.
    fn forget_if_idle(&mut self, name: &str) {
        if self.clients.get(name).is_some_and(Client::is_idle) {
            self.clients.remove(name);
        }
    }

    /// Whether something may have a turn now.
    pub(super) fn has_next(&self) -> bool {
        let place = self.begun < self.most_begun;
        self.clients.values().any(|client| {
            !client.resting.is_empty()
                || client.first(self.suspects == 0).is_some()
                || (place && !client.set_aside.is_empty())
        })
    }

    /// Whether a validation that was set aside could have the place of one of this client.
    pub(super) fn wants_place(&self, name: &str) -> bool {
        let most_of_one = self.most_begun.div_ceil(2);
        self.clients
            .iter()
            .any(|(other, client)| !client.set_aside.is_empty() && (other == name || client.begun < most_of_one))
    }

    /// Validations that hold a place.
    pub(super) const fn begun(&self) -> usize {
        self.begun
    }

    /// About how many validations begin up to each of these jobs, itself included: have their first turn, or find a place after they were
    /// set aside. Jobs that do not wait for it are left out.
    pub(super) fn places(&self, jobs: &[Uuid]) -> HashMap<Uuid, u64> {
        let mut found = self.places_aside(jobs);
        for id in jobs {
            let Some((name, key, _)) = self.places.get(id) else { continue };
            let before = |client: &Client<T>| client.fresh.range(..key).count() + client.suspects.range(..key).count();
            let Some(own) = self.clients.get(name).map(before) else { continue };
            let of_others = self.clients.iter().filter(|(other, _)| *other != name).map(|(_, client)| {
                // Clients take turns, so that as many of each other one come before.
                (client.fresh.len() + client.suspects.len()).min(own)
            });
            found.insert(*id, 1 + own as u64 + of_others.sum::<usize>() as u64);
        }
        found
    }

    /// The same among those set aside.
    fn places_aside(&self, jobs: &[Uuid]) -> HashMap<Uuid, u64> {
        let mut found = HashMap::new();
        for (name, client) in self.clients.iter().filter(|(_, client)| !client.set_aside.is_empty()) {
            for (own, (waiting, _)) in client.set_aside.iter().enumerate() {
                let Some(id) = waiting.job.filter(|id| jobs.contains(id)) else { continue };
                let of_others = self.clients.iter().filter(|(other, _)| *other != name);
                let of_others: usize = of_others.map(|(_, client)| client.set_aside.len().min(own)).sum();
                found.insert(id, 1 + own as u64 + of_others as u64);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests;
