//! Splines on a grid.

use super::{Piece, Spline};
use crate::tolerance::on_grid;

impl Spline {
    /// The same curve from another origin, with every coefficient and length on the grid of [`on_grid`]: curves that differ by rounding
    /// alone become equal. `None` where it has more than `most_pieces` pieces, or one that is shorter than `least_mm`.
    pub(crate) fn on_grid(&self, origin_mm: [f64; 3], most_pieces: usize, least_mm: f64) -> Option<Self> {
        if self.pieces.len() > most_pieces || self.pieces.iter().any(|piece| piece.length < least_mm) {
            return None;
        }
        let mut pieces = Vec::with_capacity(self.pieces.len());
        let mut length_mm = 0.0;
        for piece in &self.pieces {
            let mut coefficients = piece.coefficients;
            for (axis, origin_mm) in coefficients.iter_mut().zip(origin_mm) {
                axis[0] -= origin_mm;
                axis.iter_mut().for_each(|coefficient| *coefficient = on_grid(*coefficient));
            }
            let piece = Piece::new(length_mm, on_grid(piece.length), coefficients);
            length_mm = piece.end();
            pieces.push(piece);
        }
        Some(Self { pieces, length_mm, moves: self.moves })
    }
}
