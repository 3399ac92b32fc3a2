//! What a change of the feed override leaves to be planned again: it is taken up piece by piece, when something is to be taken that
//! is not planned yet. So a change costs what lies close ahead, however much is known behind it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::refine::Released;
use super::request::{Ahead, PathItem};
use super::{Planned, Waiting};

/// Part of what is to be planned, as it was known before; moved as a whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Part<B> {
    /// It was planned.
    Released(VecDeque<Released<B>>),
    /// It waited for more to be known.
    Waiting(VecDeque<Waiting>),
    /// Nothing was known of its plan.
    Items(VecDeque<PathItem<B>>),
}

impl<B> Part<B> {
    fn len(&self) -> usize {
        match self {
            Self::Released(items) => items.len(),
            Self::Waiting(items) => items.len(),
            Self::Items(items) => items.len(),
        }
    }

    fn pop_front(&mut self) -> Option<PathItem<B>> {
        match self {
            Self::Released(items) => items.pop_front().map(|released| PathItem::from(released.planned)),
            Self::Waiting(items) => items.pop_front().map(|waiting| PathItem::Motion(waiting.request)),
            Self::Items(items) => items.pop_front(),
        }
    }

    fn remove_front(&mut self, count: usize) {
        match self {
            Self::Released(items) => drop(items.drain(..count)),
            Self::Waiting(items) => drop(items.drain(..count)),
            Self::Items(items) => drop(items.drain(..count)),
        }
    }

    fn get(&self, index: usize) -> Option<Ahead<'_, B>> {
        match self {
            Self::Released(items) => items.get(index).map(|released| Ahead::from(&released.planned)),
            Self::Waiting(items) => items.get(index).map(|waiting| Ahead::Motion(&waiting.request)),
            Self::Items(items) => items.get(index).map(Ahead::from),
        }
    }
}

/// What is to be planned, in order; none of its parts is empty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Behind<B> {
    parts: VecDeque<Part<B>>,
}

impl<B> Default for Behind<B> {
    fn default() -> Self {
        Self { parts: VecDeque::new() }
    }
}

impl<B> Behind<B> {
    /// What was released and not taken, what waits, and what is behind both.
    pub(super) fn new(ready: VecDeque<Released<B>>, chain: VecDeque<Waiting>, behind: Self) -> Self {
        let mut all = Self { parts: VecDeque::from([Part::Released(ready), Part::Waiting(chain)]) };
        all.parts.retain(|part| part.len() > 0);
        all.parts.extend(behind.parts);
        all
    }

    pub(super) fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    pub(super) fn push_back(&mut self, item: PathItem<B>) {
        match self.parts.back_mut() {
            Some(Part::Items(items)) => items.push_back(item),
            _ => self.parts.push_back(Part::Items(VecDeque::from([item]))),
        }
    }

    pub(super) fn push_front(&mut self, item: PathItem<B>) {
        match self.parts.front_mut() {
            Some(Part::Items(items)) => items.push_front(item),
            _ => self.parts.push_front(Part::Items(VecDeque::from([item]))),
        }
    }

    pub(super) fn pop_front(&mut self) -> Option<PathItem<B>> {
        let first = self.parts.front_mut()?;
        let item = first.pop_front();
        if first.len() == 0 {
            self.parts.pop_front();
        }
        item
    }

    /// Puts items in front of it, in order.
    pub(super) fn prepend(&mut self, items: VecDeque<PathItem<B>>) {
        if !items.is_empty() {
            self.parts.push_front(Part::Items(items));
        }
    }

    /// Forgets the first items.
    pub(super) fn remove_front(&mut self, mut count: usize) {
        while let Some(first) = self.parts.front_mut()
            && count > 0
        {
            let own = count.min(first.len());
            if own == first.len() {
                self.parts.pop_front();
            } else {
                first.remove_front(own);
            }
            count -= own;
        }
    }

    /// All of it, in order.
    pub(super) fn items(&self) -> impl Iterator<Item = Ahead<'_, B>> {
        self.parts.iter().flat_map(|part| (0..part.len()).filter_map(|index| part.get(index)))
    }
}

impl<'a, B> From<&'a Planned<B>> for Ahead<'a, B> {
    fn from(planned: &'a Planned<B>) -> Self {
        match planned {
            Planned::Motion(motion) => Self::Planned(motion),
            Planned::Barrier(barrier) => Self::Barrier(barrier),
        }
    }
}

impl<'a, B> From<&'a PathItem<B>> for Ahead<'a, B> {
    fn from(item: &'a PathItem<B>) -> Self {
        match item {
            PathItem::Motion(request) => Self::Motion(request),
            PathItem::Barrier(barrier) => Self::Barrier(barrier),
        }
    }
}
