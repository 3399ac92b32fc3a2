//! Elements on which the position goes ahead of the command and behind it, as a vibration along the path does: what an axis
//! follows at the position bounds the feed at the command, so that every place has the strictest limits within reach.
//!
//! Elements wait here until all within reach behind their end is known.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::{MotionRequest, PathLimits, Stretch, Stretches};

/// Elements that wait at most, 8 mm before and behind with blocks of 1 µm: only those shorter than this part of the reach are
/// more. All that wait are then planned without those that follow ([`TooManyWithinReach`]).
pub const MOST_WITHIN_REACH: usize = 1 << 14;
/// Bytes that they take at most, whatever curves they are: twice what so many straight blocks take.
pub const MOST_BYTES_WITHIN_REACH: usize = 40 << 20;

/// Share of the reach that is not worth a stretch of its own.
const LEAST_PART: f64 = 0.1;

/// More is within reach than may wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyWithinReach {
    /// Elements; fewer than [`MOST_WITHIN_REACH`] where their bytes are too many.
    pub elements: usize,
}

/// What waits, and what it has to go by.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct WithinReach {
    /// Each with the path position of its arc length 0, mm.
    held: VecDeque<(f64, MotionRequest)>,
    /// Bytes that they take.
    bytes: usize,
    /// The stretches within reach of the end as they were pushed.
    spans: VecDeque<Span>,
    /// Path position of the end, mm.
    end_mm: f64,
}

/// A stretch as it was pushed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Span {
    end_mm: f64,
    limits: PathLimits,
}

impl WithinReach {
    /// Takes in an element. All that wait have the same reach.
    pub(super) fn push(&mut self, mut request: MotionRequest) -> Option<TooManyWithinReach> {
        let reach_mm = request.reach_mm;
        let origin_mm = self.end_mm - request.start;
        let mut start = request.start;
        for stretch in request.stretches.clone() {
            let from_mm = origin_mm + start;
            for span in &self.spans {
                let to = stretch.end.min(span.end_mm + reach_mm - origin_mm);
                lower(&mut request, [start, to], &span.limits, reach_mm);
            }
            // What the stretch before has not lowered is out of reach.
            if self.spans.back().is_none_or(|before| is_lower(&stretch.limits, &before.limits)) {
                for (held_origin_mm, held) in &mut self.held {
                    self.bytes -= held.bytes();
                    lower(held, [from_mm - reach_mm - *held_origin_mm, f64::INFINITY], &stretch.limits, reach_mm);
                    self.bytes += held.bytes();
                }
            }
            lower(&mut request, [start - reach_mm, start], &stretch.limits, reach_mm);
            start = stretch.end;
            self.end_mm = origin_mm + start;
            match self.spans.back_mut().filter(|span| span.limits == stretch.limits) {
                Some(span) => span.end_mm = self.end_mm,
                None => self.spans.push_back(Span { end_mm: self.end_mm, limits: stretch.limits }),
            }
        }
        let out_of_reach = |span: &Span| span.end_mm <= self.end_mm - reach_mm;
        let gone = self.spans.iter().take_while(|span| out_of_reach(span)).count();
        self.spans.drain(..gone);
        self.bytes += request.bytes();
        self.held.push_back((origin_mm, request));
        if self.is_known() { None } else { self.too_many() }
    }

    /// What waits, where that is more than may.
    fn too_many(&self) -> Option<TooManyWithinReach> {
        let elements = self.held.len();
        let too_many = elements > MOST_WITHIN_REACH || self.bytes > MOST_BYTES_WITHIN_REACH;
        too_many.then_some(TooManyWithinReach { elements })
    }

    /// Whether all within reach behind the end of the first is known.
    fn is_known(&self) -> bool {
        self.held.front().is_some_and(|(origin_mm, first)| {
            let end_mm = origin_mm + first.stretches.last().map_or(first.start, |stretch| stretch.end);
            end_mm <= self.end_mm - first.reach_mm
        })
    }

    /// The next element behind whose end all within reach is known.
    pub(super) fn pop(&mut self) -> Option<MotionRequest> {
        if !self.is_known() {
            return None;
        }
        let (_, first) = self.held.pop_front()?;
        self.bytes -= first.bytes();
        Some(first)
    }

    /// What waits, in order.
    pub(super) fn waiting(&self) -> impl Iterator<Item = &MotionRequest> {
        self.held.iter().map(|(_, request)| request)
    }

    /// All that waits, in order: nothing behind it is within reach.
    pub(super) fn take(&mut self) -> VecDeque<(f64, MotionRequest)> {
        core::mem::take(self).held
    }
}

/// Whether any of these limits is below that of others.
fn is_lower(limits: &PathLimits, others: &PathLimits) -> bool {
    limits.velocity < others.velocity || limits.acceleration < others.acceleration || limits.jerk < others.jerk
}

/// Lowers the limits of an element between two arc lengths to these.
fn lower(request: &mut MotionRequest, [from, to]: [f64; 2], limits: &PathLimits, reach_mm: f64) {
    let mut start = request.start;
    let is_met = |start: f64, stretch: &Stretch| start < to && stretch.end > from && is_lower(limits, &stretch.limits);
    let mut starts = request.stretches.iter().map(|stretch| core::mem::replace(&mut start, stretch.end));
    if !request.stretches.iter().any(|stretch| starts.next().is_some_and(|start| is_met(start, stretch))) {
        return;
    }
    let least_mm = LEAST_PART * reach_mm;
    let mut lowered = Stretches::new();
    let mut start = request.start;
    for stretch in &request.stretches {
        if is_met(start, stretch) {
            if from - start > least_mm {
                lowered.push(Stretch { end: from, ..*stretch });
            }
            let end = if stretch.end - to > least_mm { to } else { stretch.end };
            let limits = PathLimits::tightest([stretch.limits, *limits].iter());
            lowered.push(Stretch { end, limits, ..*stretch });
        }
        if lowered.last().is_none_or(|last| last.end < stretch.end) {
            lowered.push(*stretch);
        }
        start = stretch.end;
    }
    request.stretches = lowered;
}

#[cfg(test)]
mod tests {
    use feedwave_program::{Feed, Move, MoveKind, PathControl, SourceSpan, Spindle};

    use super::*;
    use crate::Element;

    fn limits(acceleration: f64) -> PathLimits {
        PathLimits { velocity: 100.0, acceleration, jerk: 1e5 }
    }

    fn request(length: f64, acceleration: f64) -> MotionRequest {
        let mut end = [0.0; 9];
        end[0] = length;
        let mv = Move {
            kind: MoveKind::Cutting,
            start: [0.0; 9],
            end,
            work_offset: [0.0; 9],
            arc: None,
            spline: None,
            path_control: PathControl::default(),
            feed: Feed::PerMinute(600.0),
            spindle: Spindle::STOPPED,
            tool: 0,
            leads_xyz: false,
            cycle: None,
        };
        let element = Element::from_move(&mv, SourceSpan::default()).expect("it moves");
        let stretch =
            Stretch { end: length, speed_mm_per_s: 10.0, spindle_rev_per_s: 0.0, limits: limits(acceleration) };
        MotionRequest { reach_mm: 1.0, ..MotionRequest::new(element, Stretches::from_elem(stretch, 1)) }
    }

    /// Ends and accelerations of the stretches of an element.
    fn parts(request: &MotionRequest) -> Vec<(f64, f64)> {
        request.stretches.iter().map(|stretch| (stretch.end, stretch.limits.acceleration)).collect()
    }

    #[test]
    fn limits_reach_to_both_sides_and_no_further() {
        let mut within = WithinReach::default();
        for (length, acceleration) in [(10.0, 500.0), (0.5, 200.0), (10.0, 800.0)] {
            within.push(request(length, acceleration));
        }
        let [first, second] = [(); 2].map(|()| within.pop().expect("known"));
        assert_eq!(parts(&first), [(9.0, 500.0), (10.0, 200.0)]);
        assert_eq!(parts(&second), [(0.5, 200.0)]);
        assert_eq!(within.pop(), None, "what follows is not known");
        let last = within.take();
        assert_eq!(
            last.iter().map(|(_, request)| parts(request)).collect::<Vec<_>>(),
            [[(0.5, 200.0), (1.0, 200.0), (10.0, 800.0)]]
        );
    }

    #[test]
    fn what_is_within_reach_waits_however_short_it_is_up_to_a_bound() {
        let mut within = WithinReach::default();
        let short = 0.5 / MOST_WITHIN_REACH as f64;
        for _ in 0..MOST_WITHIN_REACH - 1 {
            assert_eq!(within.push(request(short, 500.0)), None);
        }
        assert_eq!(within.push(request(short, 100.0)), None);
        assert_eq!(within.pop(), None, "all of it is within reach");
        assert!(within.waiting().all(|request| parts(request) == [(short, 100.0)]));
        let too_many = TooManyWithinReach { elements: MOST_WITHIN_REACH + 1 };
        assert_eq!(within.push(request(short, 100.0)), Some(too_many));
        assert_eq!(within.take().len(), too_many.elements);
    }

    #[test]
    fn a_lower_limit_reaches_over_several_elements_and_equal_ones_divide_nothing() {
        let mut within = WithinReach::default();
        for length in [0.3, 0.3, 0.3, 5.0] {
            within.push(request(length, 500.0));
        }
        within.push(request(2.0, 100.0));
        let held = within.take();
        let found: Vec<_> = held.iter().map(|(_, request)| parts(request)).collect();
        assert_eq!(found[..3], [[(0.3, 500.0)], [(0.3, 500.0)], [(0.3, 500.0)]]);
        assert_eq!(found[3], [(4.0, 500.0), (5.0, 100.0)]);
    }
}
