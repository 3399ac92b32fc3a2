//! Messages that the broker has not confirmed yet.
//!
//! The client numbers messages when it sends them and uses a number again once it is confirmed; here is what each number stands for.

use std::collections::{HashMap, VecDeque};

use rumqttc::{Event, Outgoing, Packet, Request};

/// Most messages that wait for the broker: what brokers commonly hold of one client.
pub(super) const MAX_IN_FLIGHT: u16 = 20;

/// What a message is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    /// Whether the service is connected.
    Status,
    /// The state of a machine.
    State,
    /// The decision at this place of the log.
    Decision(i64),
}

impl What {
    /// Its name in the metrics.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Status => "status",
            Self::State => "state",
            Self::Decision(_) => "decision",
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    what: What,
    /// Place in the order of sending.
    place: u64,
}

/// Messages that the broker has not confirmed yet.
#[derive(Debug, Default)]
pub(super) struct InFlight {
    /// Handed to the client, which has not numbered them yet.
    queued: VecDeque<Waiting>,
    numbered: HashMap<u16, Waiting>,
    /// Messages since none was waiting. The numbers go round, so that fewer than there are numbers never meet one that is in use,
    /// in whatever order the broker confirms them.
    since_none: u16,
    places: u64,
}

impl InFlight {
    /// Whether another message may be sent.
    pub(super) fn has_room(&self) -> bool {
        self.since_none < MAX_IN_FLIGHT
    }

    pub(super) fn is_empty(&self) -> bool {
        self.queued.is_empty() && self.numbered.is_empty()
    }

    /// A message was handed to the client.
    pub(super) fn push(&mut self, what: What) {
        self.queued.push_back(Waiting { what, place: self.places });
        self.places += 1;
        self.since_none += 1;
    }

    /// Takes note of what the client did or was told; the message that the broker has confirmed by it.
    pub(super) fn take(&mut self, event: &Event) -> Option<What> {
        match event {
            Event::Outgoing(Outgoing::Publish(number)) => {
                // What is sent again after a break has its number already.
                if !self.numbered.contains_key(number)
                    && let Some(waiting) = self.queued.pop_front()
                {
                    self.numbered.insert(*number, waiting);
                }
                None
            }
            Event::Incoming(Packet::PubAck(rumqttc::PubAck { pkid }) | Packet::PubComp(rumqttc::PubComp { pkid })) => {
                let confirmed = self.numbered.remove(pkid)?;
                if self.is_empty() {
                    self.since_none = 0;
                }
                Some(confirmed.what)
            }
            _ => None,
        }
    }

    /// The broker knows of none of them any more.
    pub(super) fn clear(&mut self) {
        self.queued.clear();
        self.numbered.clear();
        self.since_none = 0;
    }

    /// Brings what the client is to send again into the order in which it was sent first.
    pub(super) fn sort(&self, pending: &mut VecDeque<Request>) {
        let place = |number: &u16| self.numbered.get(number).map_or(u64::MAX, |waiting| waiting.place);
        pending.make_contiguous().sort_by_key(|request| match request {
            Request::Publish(publish) => place(&publish.pkid),
            Request::PubRel(release) => place(&release.pkid),
            _ => u64::MAX,
        });
    }
}

#[cfg(test)]
mod tests {
    use rumqttc::{PubAck, PubComp, PubRel, Publish, QoS};

    use super::*;

    fn sent(number: u16) -> Event {
        Event::Outgoing(Outgoing::Publish(number))
    }

    fn acknowledged(number: u16) -> Event {
        Event::Incoming(Packet::PubAck(PubAck { pkid: number }))
    }

    #[test]
    fn each_message_is_confirmed_once_whatever_the_order() {
        let mut in_flight = InFlight::default();
        for what in [What::Status, What::State, What::Decision(7)] {
            in_flight.push(what);
        }
        for number in 1..=3 {
            assert_eq!(in_flight.take(&sent(number)), None);
        }
        let completed = Event::Incoming(Packet::PubComp(PubComp { pkid: 3 }));
        assert_eq!(in_flight.take(&completed), Some(What::Decision(7)));
        assert_eq!(in_flight.take(&completed), None);
        assert_eq!(in_flight.take(&acknowledged(1)), Some(What::Status));
        assert!(!in_flight.is_empty());
        // After a break the client sends it again, under the number that it has.
        assert_eq!(in_flight.take(&sent(2)), None);
        assert_eq!(in_flight.take(&acknowledged(2)), Some(What::State));
        assert!(in_flight.is_empty());
    }

    #[test]
    fn a_number_in_use_is_never_met_again() {
        let mut in_flight = InFlight::default();
        for number in 1..=MAX_IN_FLIGHT {
            assert!(in_flight.has_room());
            in_flight.push(What::State);
            in_flight.take(&sent(number));
        }
        // All but the first are confirmed; the next number round would be that of the first.
        for number in 2..=MAX_IN_FLIGHT {
            in_flight.take(&acknowledged(number));
        }
        assert!(!in_flight.has_room());
        in_flight.take(&acknowledged(1));
        assert!(in_flight.has_room());
    }

    #[test]
    fn what_is_sent_again_comes_in_the_order_of_the_first_time() {
        let mut in_flight = InFlight::default();
        // The numbers have gone round.
        for number in [19, 20, 1, 2] {
            in_flight.push(What::State);
            in_flight.take(&sent(number));
        }
        let publish = |number| {
            let mut publish = Publish::new("topic", QoS::AtLeastOnce, Vec::new());
            publish.pkid = number;
            Request::Publish(publish)
        };
        let mut pending: VecDeque<_> =
            [publish(0), publish(1), publish(2), publish(20), Request::PubRel(PubRel { pkid: 19 })].into();
        in_flight.sort(&mut pending);
        let numbers: Vec<u16> = pending
            .iter()
            .map(|request| match request {
                Request::Publish(publish) => publish.pkid,
                Request::PubRel(release) => release.pkid,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(numbers, [19, 20, 1, 2, 0]);
    }
}
