//! The path of a run without oscillation as a function of its length, by polynomials through neighbouring setpoints.

use super::Setpoints;

/// Distance between two places that are kept, mm: so short that polynomials through six are exact.
const STEP_MM: f64 = 0.002;

pub struct Course {
    along_mm: Vec<f64>,
    places_mm: Vec<[f64; 3]>,
    length_mm: f64,
}

impl Course {
    /// Of places by setpoint on the lines that `takes`; the tool rests where they start.
    pub fn of(setpoints: &Setpoints, places_mm: &[[f64; 3]], takes: impl Fn(u32) -> bool) -> Self {
        let first = (0..setpoints.len()).find(|&index| takes(setpoints.line[index])).expect("a cut") - 1;
        let base_mm = setpoints.path[first];
        let mut course = Self { along_mm: Vec::new(), places_mm: Vec::new(), length_mm: 0.0 };
        for index in (first..setpoints.len()).filter(|&index| index == first || takes(setpoints.line[index])) {
            let along_mm = setpoints.path[index] - base_mm;
            course.length_mm = along_mm;
            if course.along_mm.last().is_none_or(|last| along_mm - last >= STEP_MM) {
                course.along_mm.push(along_mm);
                course.places_mm.push(places_mm[index]);
            }
        }
        course
    }

    /// Of the first three columns.
    pub fn of_tip(setpoints: &Setpoints, takes: impl Fn(u32) -> bool) -> Self {
        let places_mm: Vec<[f64; 3]> =
            (0..setpoints.len()).map(|index| [0, 1, 2].map(|axis| setpoints.axes[axis][index])).collect();
        Self::of(setpoints, &places_mm, takes)
    }

    /// Its length, mm.
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// Place and unit direction at a distance along it.
    pub fn at(&self, s: f64) -> ([f64; 3], [f64; 3]) {
        let after = self.along_mm.partition_point(|along| *along < s);
        let first = after.saturating_sub(3).min(self.along_mm.len() - 6);
        let knots = &self.along_mm[first..first + 6];
        let (mut place, mut slope) = ([0.0; 3], [0.0; 3]);
        // Lagrange's polynomials from the first of the places, so that no digits are lost.
        let origin = self.places_mm[first];
        for k in 0..6 {
            let others: Vec<usize> = (0..6).filter(|&other| other != k).collect();
            let below: f64 = others.iter().map(|&other| knots[k] - knots[other]).product();
            let value: f64 = others.iter().map(|&other| s - knots[other]).product::<f64>() / below;
            let rate: f64 = others
                .iter()
                .map(|&left_out| {
                    others.iter().filter(|&&other| other != left_out).map(|&other| s - knots[other]).product::<f64>()
                })
                .sum::<f64>()
                / below;
            for axis in 0..3 {
                let from = self.places_mm[first + k][axis] - origin[axis];
                place[axis] += value * from;
                slope[axis] += rate * from;
            }
        }
        let length = slope.iter().map(|part| part * part).sum::<f64>().sqrt();
        (core::array::from_fn(|axis| origin[axis] + place[axis]), slope.map(|part| part / length))
    }
}
