//! What a cutting block asks for besides its path.

use feedwave_motion::{Carried, Element, Machine, top_command};
use feedwave_program::{Feed, Move, Spindle, SpindleSpeed};
use serde::{Deserialize, Serialize};

/// Feed and spindle of a block; of a rapid, too, where the feed means nothing. What path smoothing carries along.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cut {
    /// Per minute or per revolution.
    pub feed: Feed,
    /// Spindle command.
    pub spindle: Spindle,
}

impl Cut {
    /// Those of a block. Inverse time becomes the feed that it means on the programmed length: what is run may be shorter.
    #[must_use]
    pub fn of(mv: &Move, element: &Element) -> Self {
        let feed = match mv.feed_on_path(element.length) {
            Feed::InverseTime(per_min) => Feed::PerMinute(element.length * per_min),
            feed => feed,
        };
        Self { feed, spindle: mv.spindle }
    }
}

impl Carried for Cut {
    /// The slower feed, under one spindle command; feeds of different kinds are not compared.
    fn at_corner(&self, next: &Self) -> Option<Self> {
        let feed = match (self.feed, next.feed) {
            (Feed::PerMinute(a), Feed::PerMinute(b)) => Feed::PerMinute(a.min(b)),
            (Feed::PerRevolution(a), Feed::PerRevolution(b)) => Feed::PerRevolution(a.min(b)),
            _ => return None,
        };
        (self.spindle == next.spindle).then_some(Self { feed, ..*self })
    }

    fn commanded_mm_per_s(&self, element: &Element, machine: &Machine) -> f64 {
        top_command(element, self.feed, &self.spindle, machine)
    }

    /// Not where the spindle speed follows the diameter.
    fn is_alike_everywhere(&self) -> bool {
        matches!(self.feed, Feed::PerMinute(_)) || !matches!(self.spindle.speed, SpindleSpeed::Surface { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(feed: Feed) -> Cut {
        Cut { feed, spindle: Spindle::STOPPED }
    }

    #[test]
    fn a_feed_per_revolution_depends_on_the_diameter_at_constant_surface_speed() {
        let surface = SpindleSpeed::Surface { m_per_min: 200.0, max_rev_per_min: f64::INFINITY };
        let at_surface_speed = |feed: Feed| Cut { feed, spindle: Spindle { speed: surface, ..Spindle::STOPPED } };
        assert!(!at_surface_speed(Feed::PerRevolution(0.1)).is_alike_everywhere());
        assert!(at_surface_speed(Feed::PerMinute(100.0)).is_alike_everywhere());
        assert!(cut(Feed::PerRevolution(0.1)).is_alike_everywhere());
    }

    #[test]
    fn corners_have_the_slower_feed_of_one_kind() {
        let at_corner = |a: Feed, b: Feed| cut(a).at_corner(&cut(b)).map(|cut| cut.feed);
        assert_eq!(at_corner(Feed::PerMinute(100.0), Feed::PerMinute(50.0)), Some(Feed::PerMinute(50.0)));
        assert_eq!(at_corner(Feed::PerRevolution(0.1), Feed::PerRevolution(0.2)), Some(Feed::PerRevolution(0.1)));
        assert_eq!(at_corner(Feed::PerMinute(100.0), Feed::PerRevolution(0.2)), None);
    }
}
