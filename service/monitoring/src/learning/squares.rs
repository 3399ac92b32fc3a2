//! Normal equations of least squares, scaled by their diagonal, and Cholesky's factors of them.

/// A pivot below this share of its diagonal is rounding.
const SINGULAR: f64 = 1e-11;

/// JᵀJ and Jᵀr, row by row.
#[derive(Debug, Clone)]
pub(super) struct Normal {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
    pub(super) squares: f64,
}

impl Normal {
    pub(super) fn new(size: usize) -> Self {
        Self { size, matrix: vec![0.0; size * size], right: vec![0.0; size], squares: 0.0 }
    }

    /// Adds a sample: its derivatives by the parameters `places`, and what is left of it.
    pub(super) fn add(&mut self, places: &[usize], row: &[f64], left: f64) {
        for (index, (&place, &value)) in places.iter().zip(row).enumerate() {
            for (&other, &factor) in places[..=index].iter().zip(row) {
                let (high, low) = if place > other { (place, other) } else { (other, place) };
                self.matrix[high * self.size + low] += value * factor;
            }
            self.right[place] += value * left;
        }
        self.squares += left * left;
    }

    /// Cholesky's factor with `damping` times the diagonal added; the parameter that cannot be told from those before it where
    /// there is none.
    pub(super) fn factor(&self, damping: f64) -> Result<Factor, usize> {
        let size = self.size;
        let scale: Vec<f64> = (0..size).map(|place| self.matrix[place * size + place].sqrt()).collect();
        if let Some(flat) = scale.iter().position(|scale| !(*scale > 0.0 && scale.is_finite())) {
            return Err(flat);
        }
        let mut lower = vec![0.0; size * size];
        for row in 0..size {
            for column in 0..=row {
                let mut value = self.matrix[row * size + column] / (scale[row] * scale[column]);
                if row == column {
                    value += damping;
                }
                for inner in 0..column {
                    value -= lower[row * size + inner] * lower[column * size + inner];
                }
                lower[row * size + column] = if row == column {
                    if value <= SINGULAR {
                        return Err(row);
                    }
                    value.sqrt()
                } else {
                    value / lower[column * size + column]
                };
            }
        }
        Ok(Factor { size, lower, scale })
    }

    /// The step to the least squares.
    pub(super) fn step(&self, factor: &Factor) -> Vec<f64> {
        factor.solve(&self.right)
    }
}

impl Normal {
    /// By how much a whole step would lower the squares.
    pub(super) fn gain(&self, factor: &Factor) -> f64 {
        self.step(factor).iter().zip(&self.right).map(|(step, right)| step * right).sum()
    }
}

/// Cholesky's factor of the scaled equations.
pub(super) struct Factor {
    size: usize,
    lower: Vec<f64>,
    scale: Vec<f64>,
}

impl Factor {
    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let size = self.size;
        let mut values: Vec<f64> = right.iter().zip(&self.scale).map(|(value, scale)| value / scale).collect();
        for row in 0..size {
            for column in 0..row {
                values[row] -= self.lower[row * size + column] * values[column];
            }
            values[row] /= self.lower[row * size + row];
        }
        for row in (0..size).rev() {
            for below in row + 1..size {
                values[row] -= self.lower[below * size + row] * values[below];
            }
            values[row] /= self.lower[row * size + row];
        }
        values.iter().zip(&self.scale).map(|(value, scale)| value / scale).collect()
    }

    /// A column of the inverse: covariances of a parameter with all, over the variance of a sample.
    pub(super) fn inverse_column(&self, place: usize) -> Vec<f64> {
        let mut unit = vec![0.0; self.size];
        unit[place] = 1.0;
        self.solve(&unit)
    }
}
