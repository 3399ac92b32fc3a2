//! Numbers and words of findings and programs as text.

/// `value` with at most `places` decimals and no trailing zeros.
pub(crate) fn decimal(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// `value` rounded up to `places` decimals; a decimal but for its rounding stays that decimal.
pub(crate) fn round_up(value: f64, places: usize) -> f64 {
    let scale = scale(places);
    (value * scale * (1.0 - 4.0 * f64::EPSILON)).ceil() / scale
}

/// `value` rounded down to `places` decimals; a decimal but for its rounding stays that decimal.
pub(crate) fn round_down(value: f64, places: usize) -> f64 {
    let scale = scale(places);
    (value * scale * (1.0 + 4.0 * f64::EPSILON)).floor() / scale
}

/// `value` rounded to `places` decimals.
pub(crate) fn round_to(value: f64, places: usize) -> f64 {
    let scale = scale(places);
    (value * scale).round() / scale
}

fn scale(places: usize) -> f64 {
    (0..places).fold(1.0, |scale, _| scale * 10.0)
}

/// A word with at most `places` decimals, always with a decimal point, whatever a machine reads without one.
pub(crate) fn word(letter: char, value: f64, places: usize) -> String {
    let text = decimal(value, places);
    // No machine wants a negative zero.
    let text = if text == "-0" { "0" } else { &text };
    if text.contains('.') { format!("{letter}{text}") } else { format!("{letter}{text}.0") }
}
