//! Symmetric matrices with two diagonals beside the main one, factored as L·D·Lᵀ.

/// A symmetric positive definite matrix by its diagonals; factored in place.
#[derive(Clone, Debug, Default)]
pub(super) struct Banded {
    /// The main diagonal, then the first and the second one below it: `below[k][i]` is the entry of row i and column i − k − 1.
    diagonal: Vec<f64>,
    below: [Vec<f64>; 2],
}

impl Banded {
    /// A matrix of this size, all zeros.
    pub(super) fn clear(&mut self, size: usize) {
        for diagonal in core::iter::once(&mut self.diagonal).chain(&mut self.below) {
            diagonal.clear();
            diagonal.resize(size, 0.0);
        }
    }

    pub(super) fn add_diagonal(&mut self, row: usize, value: f64) {
        self.diagonal[row] += value;
    }

    /// Adds a symmetric block of three rows from `first` on, by its upper triangle.
    #[inline]
    pub(super) fn add(&mut self, first: usize, block: &[f64; 6]) {
        let [a, ab, ac, b, bc, c] = *block;
        self.diagonal[first] += a;
        self.diagonal[first + 1] += b;
        self.diagonal[first + 2] += c;
        self.below[0][first + 1] += ab;
        self.below[0][first + 2] += bc;
        self.below[1][first + 2] += ac;
    }

    /// Takes a variable out: its row and column become those of the unit matrix.
    pub(super) fn fix(&mut self, row: usize) {
        self.diagonal[row] = 1.0;
        for (offset, below) in self.below.iter_mut().enumerate() {
            below[row] = 0.0;
            if let Some(value) = below.get_mut(row + offset + 1) {
                *value = 0.0;
            }
        }
    }

    /// Factors the matrix.
    pub(super) fn factor(&mut self) {
        let [first, second] = &mut self.below;
        for row in 0..self.diagonal.len() {
            let mut diagonal = self.diagonal[row];
            let mut beside = first[row];
            if row >= 2 {
                let far = second[row] / self.diagonal[row - 2];
                diagonal -= far * second[row];
                // L of the row above, times its D.
                beside -= far * (first[row - 1] * self.diagonal[row - 2]);
                second[row] = far;
            }
            if row >= 1 {
                let near = beside / self.diagonal[row - 1];
                diagonal -= near * beside;
                first[row] = near;
            }
            self.diagonal[row] = diagonal;
        }
    }

    /// Solves with the factors, in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let [first, second] = &self.below;
        let size = x.len();
        for row in 1..size {
            let mut value = x[row] - first[row] * x[row - 1];
            if row >= 2 {
                value -= second[row] * x[row - 2];
            }
            x[row] = value;
        }
        for (value, diagonal) in x.iter_mut().zip(&self.diagonal) {
            *value /= diagonal;
        }
        for row in (0..size).rev() {
            let mut value = x[row];
            if row + 1 < size {
                value -= first[row + 1] * x[row + 1];
            }
            if row + 2 < size {
                value -= second[row + 2] * x[row + 2];
            }
            x[row] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::needless_range_loop, reason = "rows and columns of a matrix")]
    fn a_factored_matrix_solves_its_system() {
        let size = 9;
        let mut matrix = Banded::default();
        matrix.clear(size);
        let mut dense = vec![[0.0; 9]; size];
        for row in 0..size {
            matrix.add_diagonal(row, 1.0 + row as f64);
            dense[row][row] += 1.0 + row as f64;
        }
        for first in 0..size - 2 {
            let a = [1.0, -2.0 + 0.3 * first as f64, 0.7];
            matrix.add(
                first,
                &[a[0] * a[0], a[0] * a[1], a[0] * a[2], a[1] * a[1], a[1] * a[2], a[2] * a[2]].map(|it| 0.5 * it),
            );
            for i in 0..3 {
                for j in 0..3 {
                    dense[first + i][first + j] += 0.5 * a[i] * a[j];
                }
            }
        }
        matrix.fix(4);
        for k in 0..size {
            dense[4][k] = 0.0;
            dense[k][4] = 0.0;
        }
        dense[4][4] = 1.0;
        let wanted: Vec<f64> = (0..size).map(|k| (k as f64 - 3.5) * 0.4).collect();
        let mut x: Vec<f64> = dense.iter().map(|row| row.iter().zip(&wanted).map(|(a, b)| a * b).sum()).collect();
        matrix.factor();
        matrix.solve(&mut x);
        for (x, wanted) in x.iter().zip(&wanted) {
            assert!((x - wanted).abs() < 1e-12, "{x} instead of {wanted}");
        }
    }
}
