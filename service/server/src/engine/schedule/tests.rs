//! Shares, order and bounds of the schedule.

use super::*;

const TURN: Duration = Duration::from_millis(200);
const SHORT: Duration = Duration::from_millis(2);

/// A schedule whose validations are told by numbers; the number is how many turns each takes.
struct Workshop {
    schedule: Schedule<(u32, u32)>,
    served: Vec<u32>,
}

impl Workshop {
    fn new(most_begun: usize) -> Self {
        Self { schedule: Schedule::new(most_begun, TURN), served: Vec::new() }
    }

    fn add(&mut self, client: &str, bytes: u64, name: u32, turns: u32) {
        self.schedule.add(client, bytes, None, false, (name, turns));
    }

    /// Gives one turn on the one worker; false when nothing waits.
    fn serve(&mut self) -> bool {
        let Some(Given { what: (name, turns), client, class, suspect }) = self.schedule.next() else { return false };
        self.served.push(name);
        self.schedule.charge(&client, class, if turns == 0 { SHORT } else { TURN });
        self.schedule.turn_ended(&client);
        let held = class == Class::Begun;
        if turns <= 1 {
            self.schedule.leave(&client, held, suspect);
        } else if held || self.schedule.begin(&client) {
            self.schedule.rest(&client, suspect, (name, turns - 1));
        } else {
            // What it had done is lost.
            self.schedule.leave(&client, false, suspect);
            self.schedule.set_aside(&client, None, suspect, (name, turns));
        }
        true
    }

    fn serve_all(&mut self) -> Vec<u32> {
        while self.serve() {}
        assert!(self.schedule.clients.is_empty() && self.schedule.begun == 0, "{:?}", self.schedule);
        std::mem::take(&mut self.served)
    }
}

#[test]
fn short_programs_pass_long_ones_and_both_go_on() {
    let mut shop = Workshop::new(8);
    for long in 1..=3 {
        shop.add("a", 0, long, 50);
    }
    for _ in 0..6 {
        shop.serve();
    }
    shop.add("a", 0, 9, 0);
    let served = shop.serve_all();
    let place = served.iter().position(|name| *name == 9).unwrap();
    assert!(place <= 7, "a short one waits for one turn at most: {place}");
    assert_eq!(served.iter().filter(|name| **name == 3).count(), 50);
}

#[test]
fn many_short_ones_do_not_starve_a_long_one() {
    let mut shop = Workshop::new(8);
    shop.add("a", 0, 1, 5);
    for _ in 0..1_000 {
        shop.add("a", 0, 2, 0);
    }
    let served = shop.serve_all();
    let last = served.iter().rposition(|name| *name == 1).unwrap();
    // 100 short ones take the time of one turn.
    assert!(last < 500, "{last}");
}

#[test]
fn each_client_has_the_same_share_however_many_jobs_it_has() {
    let mut shop = Workshop::new(8);
    for _ in 0..100 {
        shop.add("many", 0, 1, 3);
    }
    shop.serve();
    shop.add("few", 0, 2, 3);
    shop.add("few", 0, 3, 3);
    shop.served.clear();
    for _ in 0..14 {
        shop.serve();
    }
    let of_few = shop.served.iter().filter(|name| **name > 1).count();
    assert!(of_few >= 6, "{:?}", shop.served);
}

#[test]
fn small_programs_come_first_but_pass_a_large_one_so_often_only() {
    let mut shop = Workshop::new(8);
    shop.add("a", 32 * PASSED_PER_BYTES, 1, 1);
    for _ in 0..100 {
        shop.add("a", 0, 2, 1);
    }
    let served = shop.serve_all();
    assert_eq!(served.iter().position(|name| *name == 1), Some(31));

    shop.add("a", u64::MAX, 1, 1);
    for _ in 0..MOST_PASSED + 100 {
        shop.add("a", 0, 2, 1);
    }
    assert_eq!(shop.serve_all().iter().position(|name| *name == 1), Some(4_095));
}

#[test]
fn no_more_are_begun_than_may_be_and_all_of_them_end() {
    let mut shop = Workshop::new(4);
    for name in 1..=20 {
        shop.add(if name % 2 == 0 { "a" } else { "b" }, 0, name, 4);
    }
    let mut most = 0;
    while shop.serve() {
        most = most.max(shop.schedule.begun());
        assert!(shop.schedule.clients.values().all(|client| client.begun <= 2), "a client has half of the places");
    }
    assert_eq!(most, 4);
    shop.serve_all();
}

#[test]
fn a_place_is_wanted_by_those_who_could_have_it() {
    let mut schedule = Schedule::new(2, TURN);
    schedule.add("a", 0, None, false, 1);
    schedule.next().unwrap();
    schedule.turn_ended("a");
    assert!(schedule.begin("a") && !schedule.begin("a"), "half of the places are one client's");
    schedule.set_aside("a", None, false, 2);
    assert!(schedule.wants_place("a") && !schedule.wants_place("b"));
    schedule.set_aside("b", None, false, 3);
    assert!(schedule.wants_place("a") && schedule.wants_place("b"));
    assert_eq!(schedule.next().unwrap().what, 3, "there is a place for another client");
}

#[test]
fn suspects_are_under_way_one_at_a_time_and_hold_up_nobody_else() {
    let mut schedule = Schedule::new(4, TURN);
    for name in 1..=3 {
        schedule.add("a", 0, Some(Uuid::from_u128(name)), true, name);
    }
    schedule.add("a", 0, None, false, 4);
    let first = schedule.next().unwrap();
    assert_eq!((first.what, first.suspect), (1, true));
    let second = schedule.next().unwrap();
    assert_eq!((second.what, second.suspect), (4, false));
    assert!(schedule.next().is_none() && !schedule.has_next());
    schedule.turn_ended("a");
    schedule.leave("a", false, true);
    assert_eq!(schedule.next().unwrap().what, 2);
}

#[test]
fn places_tell_how_many_begin_before() {
    let mut schedule = Schedule::new(4, TURN);
    let id = |number: u32| Uuid::from_u128(number.into());
    for number in 1..=4 {
        schedule.add("a", 0, Some(id(number)), false, number);
    }
    for number in 5..=6 {
        schedule.add("b", 0, Some(id(number)), false, number);
    }
    let places = schedule.places(&[id(1), id(4), id(6), id(7)]);
    assert_eq!((places.get(&id(1)), places.get(&id(4)), places.get(&id(6))), (Some(&1), Some(&6), Some(&3)));
    assert!(!places.contains_key(&id(7)));
    let mut order = Vec::new();
    while let Some(given) = schedule.next() {
        order.push(given.what);
        schedule.charge(&given.client, given.class, TURN);
    }
    assert_eq!(order, [1, 5, 2, 6, 3, 4]);
    assert!(schedule.places(&[id(4)]).is_empty());
    // Those that were set aside wait for a place.
    for (client, number) in [("a", 1), ("a", 2), ("b", 5)] {
        schedule.set_aside(client, Some(id(number)), false, number);
    }
    let places = schedule.places(&[id(1), id(2), id(5)]);
    assert_eq!([1, 2, 5].map(|number| places.get(&id(number)).copied()), [Some(1), Some(3), Some(1)]);
}

#[test]
fn one_turn_that_takes_long_holds_up_short_programs_for_two_turns_at_most() {
    let mut schedule = Schedule::new(4, TURN);
    schedule.add("a", 0, None, false, 1);
    let long = schedule.next().unwrap();
    schedule.charge("a", long.class, Duration::from_secs(3_600));
    schedule.turn_ended("a");
    assert!(schedule.begin("a"));
    schedule.rest("a", false, 1);
    let again = schedule.next().unwrap();
    assert_eq!(again.class, Class::Begun);
    schedule.add("a", 0, None, false, 2);
    schedule.charge("a", again.class, TURN / 100);
    schedule.turn_ended("a");
    schedule.rest("a", false, 1);
    let mut turns = 0;
    while schedule.next().unwrap().what != 2 {
        schedule.charge("a", Class::Begun, TURN);
        schedule.turn_ended("a");
        schedule.rest("a", false, 1);
        turns += 1;
    }
    assert!(turns <= 2, "{turns}");
}

#[test]
fn what_a_client_used_elsewhere_counts_and_is_no_debt_for_ever() {
    let mut workshop = Workshop::new(8);
    let turns = |served: &[u32], name| served.iter().filter(|served| **served == name).count();
    workshop.add("everywhere", 0, 1, 1_000);
    workshop.add("here", 0, 2, 1_000);
    for _ in 0..20 {
        assert!(workshop.serve());
    }
    assert_eq!((turns(&workshop.served, 1), turns(&workshop.served, 2)), (10, 10));
    // As much as both have here, the first one has at another replica.
    for _ in 0..20 {
        workshop.schedule.charge_elsewhere("everywhere", TURN);
        assert!(workshop.serve());
    }
    assert!(turns(&workshop.served, 1) <= 11, "{:?}", workshop.served);
    // An hour that nobody else wanted holds it up for some seconds.
    workshop.schedule.charge_elsewhere("everywhere", Duration::from_secs(3_600));
    workshop.served.clear();
    while turns(&workshop.served, 1) == 0 {
        assert!(workshop.serve());
    }
    assert!(workshop.served.len() <= 55, "{}", workshop.served.len());
    // Who has nothing here is not remembered for it.
    workshop.schedule.charge_elsewhere("nobody", TURN);
}
