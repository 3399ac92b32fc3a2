//! From a picture to its files: SVG in fine coordinates, PNG drawn larger and averaged down so that lines are smooth.

use std::path::{Path, PathBuf};

use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::drawing::{DrawingAreaErrorKind, IntoDrawingArea};

use super::draw;
use super::figure::Figure;
use super::theme::{self, Scale};

/// A picture cannot be drawn or written.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct PlotError(pub String);

/// What drawing on a backend returns.
pub(super) type DrawResult<T, DB> = Result<T, DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

/// How much larger bitmaps are drawn before they are averaged down. Lines are drawn between whole pixels: with fewer of
/// them arcs are seen as polygons.
const OVERSAMPLING: u32 = 3;
/// Bytes of a pixel: red, green, blue.
const CHANNELS: usize = 3;
/// Units of the SVG's coordinates in a design unit: they are whole numbers, too.
const SVG_UNITS: u32 = 10;
/// Bitmaps start white.
const WHITE_BYTE: u8 = 255;

/// Creates a directory where it is missing.
pub(super) fn make(directory: &Path) -> Result<(), PlotError> {
    std::fs::create_dir_all(directory)
        .map_err(|error| PlotError(format!("cannot create {}: {error}", directory.display())))
}

/// Writes a picture as SVG and PNG; the paths of both.
pub(super) fn write(figure: &Figure, directory: &Path) -> Result<[PathBuf; 2], PlotError> {
    let svg = directory.join(format!("{}.svg", figure.name));
    let png = directory.join(format!("{}.png", figure.name));
    let text = svg_text(figure).map_err(|error| failed(&svg, &error))?;
    std::fs::write(&svg, text).map_err(|error| failed(&svg, &error))?;
    let pixels = pixels(figure).map_err(|error| failed(&png, &error))?;
    blit(&png, figure.size, &pixels).map_err(|error| failed(&png, &error))?;
    Ok([svg, png])
}

fn blit(png: &Path, size: (u32, u32), pixels: &[u8]) -> Result<(), PlotError> {
    let mut backend = BitMapBackend::new(png, size);
    backend.blit_bitmap((0, 0), size, pixels).map_err(|error| PlotError(error.to_string()))?;
    backend.present().map_err(|error| PlotError(error.to_string()))
}

/// The picture as the text of an SVG file.
pub(super) fn svg_text(figure: &Figure) -> Result<String, PlotError> {
    theme::load_font()?;
    let (width, height) = figure.size;
    let fine = (width * SVG_UNITS, height * SVG_UNITS);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, fine).into_drawing_area();
        let drawn = draw::clear(&area).and_then(|()| draw::figure(&area, Scale(f64::from(SVG_UNITS)), figure));
        drawn.and_then(|()| area.present()).map_err(|error| PlotError(error.to_string()))?;
    }
    // Shown in its size, whatever the units of its coordinates.
    let size = |(width, height): (u32, u32)| format!("<svg width=\"{width}\" height=\"{height}\"");
    Ok(text.replacen(&size(fine), &size(figure.size), 1))
}

/// The picture as bytes of red, green and blue, row by row.
pub(super) fn pixels(figure: &Figure) -> Result<Vec<u8>, PlotError> {
    theme::load_font()?;
    let (width, height) = figure.size;
    let large = (width * OVERSAMPLING, height * OVERSAMPLING);
    let mut pixels = vec![WHITE_BYTE; large.0 as usize * large.1 as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, large).into_drawing_area();
        let drawn = draw::figure(&area, Scale(f64::from(OVERSAMPLING)), figure);
        drawn.and_then(|()| area.present()).map_err(|error| PlotError(error.to_string()))?;
    }
    Ok(average(&pixels, width as usize))
}

/// Each pixel the mean of the square of pixels that it represents.
#[allow(clippy::cast_possible_truncation, reason = "a mean of bytes is a byte")]
fn average(pixels: &[u8], width: usize) -> Vec<u8> {
    const FACTOR: usize = OVERSAMPLING as usize;
    const COUNT: u32 = OVERSAMPLING * OVERSAMPLING;
    let row_bytes = CHANNELS * width * FACTOR;
    let mut averaged = vec![0; pixels.len() / (FACTOR * FACTOR)];
    let (mut from, mut to) = (0, 0);
    // Counted by hand: builds without optimisation draw pictures, too, and iterators are ten times slower there.
    while from + FACTOR * row_bytes <= pixels.len() {
        let row_end = from + row_bytes;
        while from < row_end {
            let mut channel = 0;
            while channel < CHANNELS {
                let mut sum = COUNT / 2;
                let mut row = 0;
                while row < FACTOR {
                    let mut at = from + channel + row * row_bytes;
                    let end = at + FACTOR * CHANNELS;
                    while at < end {
                        sum += pixels[at] as u32;
                        at += CHANNELS;
                    }
                    row += 1;
                }
                averaged[to] = (sum / COUNT) as u8;
                to += 1;
                channel += 1;
            }
            from += FACTOR * CHANNELS;
        }
        from += (FACTOR - 1) * row_bytes;
    }
    averaged
}

fn failed(path: &Path, error: &dyn std::fmt::Display) -> PlotError {
    PlotError(format!("cannot draw {}: {error}", path.display()))
}
