//! Which setpoints belong to rapid moves: pictures of feeds are scaled for the cuts.

use std::collections::BTreeMap;

/// Lines with rapid moves that are kept; what is not known to be rapid counts as a cut, which hides nothing.
const MAX_LINES: usize = 200_000;
/// A cut's feed may be this much above the programmed one before it counts as a rapid move of the same line.
const MARGIN: f64 = 1.02;

/// What one line of the program moves.
#[derive(Clone, Copy, Debug, Default)]
struct Moves {
    rapid: bool,
    /// Largest feed of its cuts, mm/min; none where it only moves rapidly.
    cut_mm_per_min: Option<f64>,
}

/// The lines of a program with rapid moves.
#[derive(Clone, Debug, Default)]
pub struct RapidLines {
    lines: BTreeMap<u32, Moves>,
    line: u32,
    moves: Moves,
}

impl RapidLines {
    /// Takes in a rapid move of a line.
    pub fn rapid(&mut self, line: u32) {
        self.at(line).rapid = true;
    }

    /// Takes in a cut of a line with the largest feed that it may have, mm/min.
    pub fn cut(&mut self, line: u32, largest_mm_per_min: f64) {
        let known = &mut self.at(line).cut_mm_per_min;
        *known = Some(known.map_or(largest_mm_per_min, |known| known.max(largest_mm_per_min)));
    }

    fn at(&mut self, line: u32) -> &mut Moves {
        if line != self.line {
            self.finish();
            // A line may be run more than once.
            self.line = line;
            self.moves = self.lines.get(&line).copied().unwrap_or_default();
        }
        &mut self.moves
    }

    /// Keeps the last line.
    pub fn finish(&mut self) {
        if self.moves.rapid && (self.lines.len() < MAX_LINES || self.lines.contains_key(&self.line)) {
            self.lines.insert(self.line, self.moves);
        }
        self.moves = Moves::default();
        self.line = 0;
    }

    /// Whether a setpoint of this line and feed belongs to a rapid move.
    #[must_use]
    pub fn contains(&self, line: u32, feed_mm_per_min: f64) -> bool {
        self.lines.get(&line).is_some_and(|moves| match moves.cut_mm_per_min {
            None => true,
            Some(largest) => feed_mm_per_min > largest * MARGIN,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_told_apart_and_cycles_by_their_feed() {
        let mut lines = RapidLines::default();
        lines.rapid(1);
        lines.cut(2, 100.0);
        for line in [3, 3] {
            lines.rapid(line);
            lines.cut(line, 750.0);
            lines.rapid(line);
        }
        lines.cut(5, 200.0);
        lines.rapid(4);
        // The same line again, which cut before and moves rapidly now.
        lines.cut(4, 80.0);
        lines.finish();
        assert!(lines.contains(1, 0.0) && lines.contains(1, 30_000.0));
        assert!(!lines.contains(2, 30_000.0) && !lines.contains(5, 1.0) && !lines.contains(9, 1.0));
        assert!(!lines.contains(3, 750.0) && lines.contains(3, 800.0));
        assert!(!lines.contains(4, 80.0) && lines.contains(4, 90.0));
    }

    #[test]
    fn what_is_too_much_counts_as_cuts() {
        let mut lines = RapidLines::default();
        for line in 1..=MAX_LINES as u32 + 10 {
            lines.rapid(line);
        }
        lines.finish();
        assert_eq!(lines.lines.len(), MAX_LINES);
        assert!(!lines.contains(MAX_LINES as u32 + 5, 30_000.0));
    }
}
