//! Passes along one axis, level by level, in the frame of [`super::frame`].
//!
//! A level is cut wherever the contour is below it: from the start of the cycle on, and in each pocket. What is open at a level
//! lies within what was open at the level above, so that the pieces form a tree; a pocket is cut to its bottom before the
//! next one. Where the contour has no pockets, the tree is one row, and these are the passes of the cycle's first type.

use super::contour::{Part, SAME_MM};
use super::passes::{Path, Refusal};
use crate::compensation::geometry::{Curve, Point};

/// What is to be removed.
pub(super) struct Stock {
    /// Where the passes are counted from, and go back to.
    pub(super) corner: Point,
    /// The contour with its allowances.
    pub(super) contour: Vec<Curve>,
    pub(super) parts: Vec<Part>,
    pub(super) depth_mm: f64,
    pub(super) escape_mm: f64,
    pub(super) plunges_rapidly: bool,
    /// Behind a pass the tool goes up the wall to the level before.
    pub(super) follows_walls: bool,
}

/// Where a stretch of a level begins.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    /// At the corner of the stock.
    Open,
    /// On a wall: its part, and the point.
    Wall(usize, Point),
}

/// A stretch of a level that is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    /// How many levels below the corner.
    level: u32,
    entry: Entry,
    /// Where it ends, and the part whose wall it meets.
    end: Point,
    wall: Option<usize>,
}

impl Stock {
    fn level(&self, number: u32) -> f64 {
        self.corner[1] - f64::from(number) * self.depth_mm
    }

    /// The first and the last part that a stretch lies on.
    fn range(&self, stretch: &Stretch) -> (usize, usize) {
        let first = match stretch.entry {
            Entry::Open => 0,
            Entry::Wall(part, _) => part,
        };
        (first, stretch.wall.unwrap_or(self.parts.len() - 1))
    }

    /// Whether a level is cut from the corner on: the first of these parts begins below it, or at it and goes below it later, before it
    /// comes out again. A contour that stays at the level is cut by the last pass, along it.
    fn is_open_at(&self, height: f64, first: usize, last: usize) -> bool {
        let start = self.parts[first].curve.from[1];
        let mut reached = self.parts[first..=last].iter().map(|part| part.curve.to[1]);
        start < height - SAME_MM
            || start <= height + SAME_MM
                && reached.find(|to| (to - height).abs() > SAME_MM).is_some_and(|to| to < height)
    }

    /// The stretches of a level between two parts, in the order of the contour.
    fn stretches(&self, level: u32, is_open: bool, (first, last): (usize, usize), found: &mut Vec<Stretch>) {
        let height = self.level(level);
        let mut entry = (is_open && self.is_open_at(height, first, last)).then_some(Entry::Open);
        for (index, part) in self.parts.iter().enumerate().take(last + 1).skip(first) {
            let (from, to) = (part.curve.from, part.curve.to);
            match entry {
                None if from[1] > height + SAME_MM && to[1] <= height + SAME_MM => {
                    let point = if to[1] < height { part.crossing(height) } else { [to[0], height] };
                    entry = Some(Entry::Wall(index, point));
                }
                Some(start) if to[1] > height + SAME_MM => {
                    let point = if from[1] < height { part.crossing(height) } else { [from[0], height] };
                    found.push(Stretch { level, entry: start, end: point, wall: Some(index) });
                    entry = None;
                }
                _ => {}
            }
        }
        if let (Some(start), Some(part)) = (entry, self.parts.get(last)) {
            found.push(Stretch { level, entry: start, end: [part.curve.to[0], height], wall: None });
        }
    }
}

/// All passes, and the contour behind them.
pub(super) fn rough(stock: &Stock, path: &mut Path) -> Result<(), Refusal> {
    let top = stock.parts.iter().map(|part| part.curve.from[1].max(part.curve.to[1])).fold(stock.corner[1], f64::max);
    // Above everything that is left: clear of a contour that is higher than the stock.
    let clear = if top > stock.corner[1] { top + stock.escape_mm } else { top };
    path.rapid(stock.corner);
    let mut found = Vec::new();
    stock.stretches(1, true, (0, stock.parts.len() - 1), &mut found);
    found.reverse();
    // The last one is cut next.
    let mut waiting = found;
    let mut below = Vec::new();
    while let Some(stretch) = waiting.pop() {
        if path.is_full() {
            return Err(Refusal::too_many());
        }
        cut(stock, &stretch, clear, path);
        below.clear();
        let is_open = stretch.entry == Entry::Open;
        stock.stretches(stretch.level + 1, is_open, stock.range(&stretch), &mut below);
        waiting.extend(below.iter().rev());
    }
    let contour_start = stock.contour[0].from;
    if stock.follows_walls {
        path.rapid([path.at[0], path.at[1].max(clear)]);
    }
    path.rapid([stock.corner[0], path.at[1]]);
    path.straight([stock.corner[0], contour_start[1]], stock.plunges_rapidly);
    path.straight(contour_start, stock.plunges_rapidly);
    for (block, curve) in stock.contour.iter().enumerate() {
        path.follow(curve, block);
    }
    Ok(())
}

/// One pass: to its start, along the level, up the wall behind it, and away from it.
fn cut(stock: &Stock, stretch: &Stretch, clear: f64, path: &mut Path) {
    let height = stock.level(stretch.level);
    let above = stock.level(stretch.level - 1);
    match stretch.entry {
        Entry::Open => {
            path.rapid([stock.corner[0], path.at[1]]);
            path.straight([stock.corner[0], height], stock.plunges_rapidly);
        }
        Entry::Wall(part, point) => descend(stock, part, point, above, stretch.level == 1, clear, path),
    }
    let begin = path.at;
    path.feed(stretch.end);
    if let Some(wall) = stretch.wall
        && stock.follows_walls
    {
        climb(stock, wall, above, path);
    }
    let back = stock.escape_mm.min((path.at[0] - begin[0]).max(0.0));
    path.rapid([path.at[0] - back, path.at[1] + stock.escape_mm]);
    if stretch.entry == Entry::Open {
        path.rapid([stock.corner[0], path.at[1]]);
    }
}

/// Over the top of a wall, or the level above, and down the wall to the level.
fn descend(stock: &Stock, part: usize, point: Point, above: f64, is_first: bool, clear: f64, path: &mut Path) {
    let mut top = part;
    while stock.parts[top].curve.from[1] < above && top > 0 && stock.parts[top - 1].falls() {
        top -= 1;
    }
    let curve = &stock.parts[top].curve;
    let from = if curve.from[1] > above { stock.parts[top].crossing(above) } else { curve.from };
    let over = if is_first { clear } else { above + stock.escape_mm };
    path.rapid([path.at[0], path.at[1].max(over)]);
    path.rapid([from[0], path.at[1]]);
    path.feed(from);
    let mut at = from;
    for (index, wall) in stock.parts.iter().enumerate().take(part + 1).skip(top) {
        let to = if index == part { point } else { wall.curve.to };
        path.follow(&wall.stretch(at, to), wall.block);
        at = to;
    }
}

/// Up a wall to the level above, or to its top.
fn climb(stock: &Stock, wall: usize, above: f64, path: &mut Path) {
    for part in stock.parts.iter().skip(wall) {
        if !part.rises() || path.at[1] >= above {
            break;
        }
        let to = if part.curve.to[1] > above { part.crossing(above) } else { part.curve.to };
        let curve = part.stretch(path.at, to);
        path.follow(&curve, part.block);
    }
}
