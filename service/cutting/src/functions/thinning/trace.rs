//! The deviations of dropped blocks along the program, in bounded memory: for pictures.

/// Stretches of lines at most: more than a picture has pixels.
const MAX_STRETCHES: usize = 4_096;

/// Deviations of a dropped block from what is left, or the largest ones of a stretch of lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Distance of the tool centre point, mm.
    pub position_mm: f64,
    /// Angle of the direction, degrees.
    pub direction_deg: f64,
}

/// The deviations along the lines of a program. Lines whose blocks were kept have none. In long programs several lines share
/// a stretch, which has the largest of their deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviationTrace {
    first_line: u32,
    lines_per_stretch: u32,
    stretches: Vec<Deviation>,
}

impl Default for DeviationTrace {
    fn default() -> Self {
        Self { first_line: 0, lines_per_stretch: 1, stretches: Vec::new() }
    }
}

impl DeviationTrace {
    /// Adds a dropped block; lines ascend.
    pub(super) fn add(&mut self, line: u32, deviation: Deviation) {
        if self.stretches.is_empty() {
            self.first_line = line;
        }
        let lines = line.saturating_sub(self.first_line);
        while (lines / self.lines_per_stretch) as usize >= MAX_STRETCHES {
            self.stretches = self
                .stretches
                .chunks(2)
                .map(|pair| pair.iter().copied().reduce(Deviation::larger).unwrap_or_default())
                .collect();
            self.lines_per_stretch *= 2;
        }
        let place = (lines / self.lines_per_stretch) as usize;
        if self.stretches.len() <= place {
            self.stretches.resize(place + 1, Deviation::default());
        }
        self.stretches[place] = self.stretches[place].larger(deviation);
    }

    /// First line of each stretch and the deviations in it, in order.
    pub fn stretches(&self) -> impl Iterator<Item = (u32, Deviation)> {
        (self.first_line..).step_by(self.lines_per_stretch as usize).zip(self.stretches.iter().copied())
    }

    /// Lines in a stretch.
    #[must_use]
    pub const fn lines_per_stretch(&self) -> u32 {
        self.lines_per_stretch
    }
}

impl Deviation {
    const fn larger(self, other: Self) -> Self {
        Self {
            position_mm: self.position_mm.max(other.position_mm),
            direction_deg: self.direction_deg.max(other.direction_deg),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_program_keeps_its_peaks_in_bounded_memory() {
        let mut trace = DeviationTrace::default();
        let of = |line: u32| Deviation { position_mm: f64::from(line % 1_000), direction_deg: f64::from(line % 7) };
        for line in (11..1_000_011).filter(|line| line % 14 != 0) {
            trace.add(line, of(line));
        }
        let stretches: Vec<_> = trace.stretches().collect();
        assert!(stretches.len() <= MAX_STRETCHES && stretches.len() > MAX_STRETCHES / 4, "{}", stretches.len());
        assert_eq!((stretches[0].0, trace.lines_per_stretch()), (11, 256));
        for (line, deviation) in &stretches {
            let lines = (*line..(line + 256).min(1_000_011)).filter(|line| line % 14 != 0);
            assert_eq!(Some(*deviation), lines.map(of).reduce(Deviation::larger));
        }
    }

    #[test]
    fn kept_lines_have_no_deviation() {
        let mut trace = DeviationTrace::default();
        let deviation = Deviation { position_mm: 0.004, direction_deg: 0.2 };
        trace.add(5, deviation);
        trace.add(8, deviation);
        let none = Deviation::default();
        assert_eq!(trace.stretches().collect::<Vec<_>>(), [(5, deviation), (6, none), (7, none), (8, deviation)]);
    }
}
