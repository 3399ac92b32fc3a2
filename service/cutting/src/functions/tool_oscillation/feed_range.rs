//! The range of feed within which the conditions of a pass that depend on the feed hold: the step per period, and the staged removal
//! where the edges are not as high as depth and axial travel together.

use super::OscillationJob;
use super::findings::{NOTHING_MM, ROUNDING};
use super::motion::ToolOscillation;
use super::removal::{OscillationCut, removal};

/// Feeds between none and the largest one at which the staged removal is examined.
const PLACES: u32 = 32;
/// Halvings of the stretch between two of them in which the range ends.
const HALVINGS: u32 = 20;

/// The range of feed about the programmed one, mm/min, within which an edge cuts as far as the feed goes in one period and no material
/// meets the tool above an edge; `[0, 0]` where that is so at the programmed feed neither. Where the edges are high enough
/// without stages its end is exact: 60·b/P. Otherwise the removal is examined at 32 feeds, and the ends found between them.
pub(super) fn feed_range(job: &OscillationJob<'_>, oscillation: &ToolOscillation, period_s: f64) -> [f64; 2] {
    let feed = job.cut.feed_mm_per_min;
    let top = 60.0 * job.tool.radial_edge_length_mm / period_s;
    let reach_mm = job.cut.depth_mm + 2.0 * job.condition.axial.amplitude_mm;
    if reach_mm <= job.tool.axial_edge_height_mm * (1.0 + ROUNDING) {
        return [0.0, top];
    }
    let holds = |feed_mm_per_min: f64| {
        removal(job.tool, oscillation, &OscillationCut { feed_mm_per_min, ..job.cut }).above_edge_mm <= NOTHING_MM
    };
    if feed > top * (1.0 + ROUNDING) || !holds(feed) {
        return [0.0; 2];
    }
    // Towards an end, from place to place as long as the condition holds; then between the last two.
    let towards = |end: f64| {
        let (mut inside, mut outside) = (feed, None);
        for place in 1..=PLACES {
            let next = feed + (end - feed) * f64::from(place) / f64::from(PLACES);
            // Without any feed nothing is removed.
            if next > 0.0 && !holds(next) {
                outside = Some(next);
                break;
            }
            inside = next;
        }
        let Some(mut outside) = outside else { return end };
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            *(if holds(middle) { &mut inside } else { &mut outside }) = middle;
        }
        inside
    };
    [towards(0.0), towards(top.max(feed))]
}
