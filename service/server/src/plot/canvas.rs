//! From a picture to its files: SVG as drawn, PNG drawn larger and averaged down so that lines are smooth.

use std::path::{Path, PathBuf};

use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::WHITE;

use super::theme::{self, Scale};

/// A picture cannot be drawn or written.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct PlotError(pub String);

/// What drawing on a backend returns.
pub(super) type DrawResult<T, DB> = Result<T, DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

/// Something to look at.
pub(super) trait Picture {
    /// File name without the ending.
    fn name(&self) -> String;

    /// Width and height, design units.
    fn size(&self) -> (u32, u32) {
        (1_400, 900)
    }

    /// Draws it.
    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, scale: Scale) -> DrawResult<(), DB>;
}

/// How much larger bitmaps are drawn before they are averaged down.
const OVERSAMPLING: u32 = 2;
/// Bitmaps start white.
const WHITE_BYTE: u8 = 255;

/// Writes a picture as SVG and PNG; the paths of both.
pub(super) fn write(picture: &impl Picture, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    theme::load_font()?;
    let svg = directory.join(format!("{}.svg", picture.name()));
    let png = directory.join(format!("{}.png", picture.name()));
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, picture.size()).into_drawing_area();
        area.fill(&WHITE).map_err(|error| failed(&svg, &error))?;
        draw_on(&area, picture, Scale(1.0)).map_err(|error| failed(&svg, &error))?;
    }
    std::fs::write(&svg, text).map_err(|error| failed(&svg, &error))?;
    write_png(picture, &png)?;
    Ok([svg, png])
}

fn draw_on<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    picture: &impl Picture,
    scale: Scale,
) -> DrawResult<(), DB> {
    picture.draw(area, scale)?;
    area.present()
}

fn write_png(picture: &impl Picture, path: &Path) -> Result<(), PlotError> {
    let (width, height) = picture.size();
    let large = (width * OVERSAMPLING, height * OVERSAMPLING);
    let mut pixels = vec![WHITE_BYTE; large.0 as usize * large.1 as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, large).into_drawing_area();
        draw_on(&area, picture, Scale(f64::from(OVERSAMPLING))).map_err(|error| failed(path, &error))?;
    }
    let averaged = average(&pixels, width as usize);
    let mut backend = BitMapBackend::new(path, (width, height));
    backend.blit_bitmap((0, 0), (width, height), &averaged).map_err(|error| failed(path, &error))?;
    backend.present().map_err(|error| failed(path, &error))
}

/// Each pixel the mean of the square of pixels that it stands for.
#[allow(clippy::cast_possible_truncation, reason = "a mean of bytes is a byte")]
fn average(pixels: &[u8], width: usize) -> Vec<u8> {
    let factor = OVERSAMPLING as usize;
    let count = (factor * factor) as u32;
    let row_bytes = width * 3;
    let mut averaged = Vec::with_capacity(pixels.len() / (factor * factor));
    let mut sums = vec![0_u32; row_bytes];
    for rows in pixels.chunks_exact(row_bytes * factor * factor) {
        sums.fill(0);
        for row in rows.chunks_exact(row_bytes * factor) {
            for (sums, square) in sums.chunks_exact_mut(3).zip(row.chunks_exact(3 * factor)) {
                for pixel in square.chunks_exact(3) {
                    sums[0] += u32::from(pixel[0]);
                    sums[1] += u32::from(pixel[1]);
                    sums[2] += u32::from(pixel[2]);
                }
            }
        }
        averaged.extend(sums.iter().map(|sum| ((sum + count / 2) / count) as u8));
    }
    averaged
}

fn failed(path: &Path, error: &dyn std::fmt::Display) -> PlotError {
    PlotError(format!("cannot draw {}: {error}", path.display()))
}
