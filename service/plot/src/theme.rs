//! How pictures look: colours, sizes of text, and inks. An ink is what something is drawn with together with the name
//! that the legend gives it, so that a legend cannot show anything else than the picture.

use std::borrow::Cow;
use std::sync::OnceLock;

use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle, register_font};

use super::PlotError;

/// Text and frames.
pub(super) const INK: RGBColor = RGBColor(24, 32, 44);
/// Secondary text.
pub(super) const MUTED: RGBColor = RGBColor(75, 85, 99);
/// Grid lines.
pub(super) const GRID: RGBColor = RGBColor(226, 229, 234);
// Colours that can be distinguished without seeing red or green.
/// What the program commands.
pub(super) const COMMAND: RGBColor = RGBColor(0, 100, 170);
/// Rapid moves, and work that stays.
pub(super) const RAPID: RGBColor = RGBColor(130, 141, 156);
/// What vibrates.
pub(super) const VIBRATION: RGBColor = RGBColor(205, 85, 0);
/// Good news.
pub(super) const GOOD: RGBColor = RGBColor(0, 148, 108);
/// Bad news, and limits.
pub(super) const BAD: RGBColor = RGBColor(130, 0, 70);
/// Colours of curves that are distinguished only by the legend.
pub(super) const PALETTE: [RGBColor; 6] =
    [COMMAND, VIBRATION, RGBColor(0, 165, 120), RGBColor(205, 130, 200), RGBColor(240, 190, 50), RGBColor(60, 60, 60)];

const FONT: &str = "sans-serif";
/// Sizes of text, design units: the README shows a picture at six tenths of its size.
pub(super) const TITLE_SIZE: f64 = 31.0;
pub(super) const SUBTITLE_SIZE: f64 = 18.0;
pub(super) const PANEL_TITLE_SIZE: f64 = 20.0;
pub(super) const NOTE_SIZE: f64 = 17.0;
pub(super) const LEGEND_SIZE: f64 = 18.5;
pub(super) const AXIS_SIZE: f64 = 18.5;
pub(super) const TICK_SIZE: f64 = 17.0;
pub(super) const LABEL_SIZE: f64 = 17.5;

/// Makes the embedded font known, once.
pub(super) fn load_font() -> Result<(), PlotError> {
    static LOADED: OnceLock<bool> = OnceLock::new();
    let loaded =
        *LOADED.get_or_init(|| register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok());
    if loaded { Ok(()) } else { Err(PlotError("the embedded font cannot be read".to_owned())) }
}

/// Width of a text, design units.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let estimate = 0.55 * size * text.chars().count() as f64;
    // Measured at a large size: the font measures in whole pixels.
    (FONT, 10.0 * size).into_font().box_size(text).map_or(estimate, |(width, _)| 0.1 * f64::from(width))
}

/// A text in lines no wider than this, design units; a single longer word stays whole.
pub(super) fn wrapped(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Remarks behind each other in lines no wider than this, design units; each stays whole where a line has space for it.
pub(super) fn wrapped_whole(remarks: &[String], size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for remark in remarks {
        let joined = lines.last().map(|line| format!("{line} \u{b7} {remark}"));
        match joined.filter(|joined| text_width(joined, size) <= width) {
            Some(joined) => lines.splice(lines.len() - 1.., [joined]).for_each(drop),
            None => lines.extend(wrapped(remark, size, width)),
        }
    }
    lines
}

/// Pixels per design unit: more than one, because backends draw at whole pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale(pub(super) f64);

impl Scale {
    /// A length in pixels.
    #[allow(clippy::cast_possible_truncation, reason = "pixel counts are small")]
    pub(super) fn px(self, units: f64) -> i32 {
        (units * self.0).round() as i32
    }

    /// A stroke.
    #[allow(clippy::cast_sign_loss, reason = "widths are positive")]
    pub(super) fn stroke(self, color: impl Color, width: f64) -> ShapeStyle {
        ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: self.px(width).max(1) as u32 }
    }

    /// A text style.
    pub(super) fn text(self, size: f64, color: RGBColor) -> TextStyle<'static> {
        (FONT, size * self.0).into_font().color(&color)
    }
}

/// How an ink covers the paper; lengths in design units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mark {
    Line { width: f64 },
    Dashed { width: f64, dash: f64, gap: f64 },
    Fill { opacity: f64 },
    Dot { radius: f64 },
}

/// What something is drawn with, and what the legend calls it. Inks of one name share a legend entry that shows them all;
/// one without a name belongs to something that is explained where it is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ink {
    pub(super) name: Cow<'static, str>,
    pub(super) color: RGBColor,
    pub(super) mark: Mark,
}

impl Ink {
    fn new(name: impl Into<Cow<'static, str>>, color: RGBColor, mark: Mark) -> Self {
        Self { name: name.into(), color, mark }
    }

    pub(super) fn line(name: impl Into<Cow<'static, str>>, color: RGBColor, width: f64) -> Self {
        Self::new(name, color, Mark::Line { width })
    }

    pub(super) fn dashed(name: impl Into<Cow<'static, str>>, color: RGBColor, width: f64) -> Self {
        Self::new(name, color, Mark::Dashed { width, dash: 8.0, gap: 6.0 })
    }

    /// The ink of an axis of rotation, told from dashed moves by its long dashes.
    pub(super) fn centre_line(name: impl Into<Cow<'static, str>>) -> Self {
        Self::new(name, INK, Mark::Dashed { width: 1.0, dash: 26.0, gap: 5.0 })
    }

    pub(super) fn fill(name: impl Into<Cow<'static, str>>, color: RGBColor, opacity: f64) -> Self {
        Self::new(name, color, Mark::Fill { opacity })
    }

    pub(super) fn dot(name: impl Into<Cow<'static, str>>, color: RGBColor, radius: f64) -> Self {
        Self::new(name, color, Mark::Dot { radius })
    }

    /// The ink of limits: always dashed, always labelled with what it bounds.
    pub(super) fn limit(name: impl Into<Cow<'static, str>>) -> Self {
        Self::dashed(name, BAD, 2.0)
    }
}
