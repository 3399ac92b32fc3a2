//! What depends on the terminal: colours, widths, progress bars.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use feedwave_contract::json::{self, Name};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::CliError;

/// Where text for people goes, and whether it is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Style {
    coloured: bool,
}

impl Style {
    /// For standard output: coloured on a terminal, unless `NO_COLOR` is set or `TERM` is `dumb`.
    pub(super) fn stdout() -> Self {
        Self::of(&io::stdout())
    }

    /// For standard error.
    pub(super) fn stderr() -> Self {
        Self::of(&io::stderr())
    }

    /// Without colours, wherever the text goes.
    #[cfg(test)]
    pub(super) const fn plain() -> Self {
        Self { coloured: false }
    }

    fn of(stream: &impl IsTerminal) -> Self {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let dumb = set("TERM").is_some_and(|term| term == "dumb");
        Self { coloured: stream.is_terminal() && set("NO_COLOR").is_none() && !dumb }
    }

    pub(super) const fn is_coloured(self) -> bool {
        self.coloured
    }

    fn paint(self, code: &str, text: &str) -> String {
        if self.coloured { format!("\u{1b}[{code}m{text}\u{1b}[0m") } else { text.to_owned() }
    }

    pub(super) fn bold(self, text: &str) -> String {
        self.paint("1", text)
    }

    pub(super) fn faint(self, text: &str) -> String {
        self.paint("2", text)
    }

    pub(super) fn good(self, text: &str) -> String {
        self.paint("32", text)
    }

    pub(super) fn warning(self, text: &str) -> String {
        self.paint("33", text)
    }

    pub(super) fn bad(self, text: &str) -> String {
        self.paint("31", text)
    }
}

/// Writes a result.
pub(super) fn print(text: &str) -> Result<(), CliError> {
    print_bytes(text.as_bytes())
}

/// Writes a result that need not be text.
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes).and_then(|()| stdout.flush()).map_err(|error| CliError::written("standard output", &error))
}

/// Writes a message of the contract as one JSON object.
pub(super) fn print_json<M: Name>(message: &M) -> Result<(), CliError> {
    let mut text = json::to_string_pretty(message);
    text.push('\n');
    print(&text)
}

/// Writes to standard error; a failure cannot be reported.
pub(super) fn tell(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// What a progress bar counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Bytes,
    Setpoints,
}

/// A progress bar on standard error; nothing where that is no terminal, or while the work is short.
pub(super) fn progress(what: &'static str, unit: Unit, total: u64) -> ProgressBar {
    let worth_showing = match unit {
        Unit::Bytes => total > 1 << 20,
        Unit::Setpoints => total > 1 << 18,
    };
    if !worth_showing || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let counts = match unit {
        Unit::Bytes => "{decimal_bytes} of {decimal_total_bytes}, {decimal_bytes_per_sec}",
        Unit::Setpoints => "{human_pos} of {human_len} setpoints, {per_sec}",
    };
    let template = format!("{{msg:10}} {{wide_bar:.cyan/blue}} {counts}, {{eta}} left");
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(10));
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style.progress_chars("━╸─"));
    }
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A number for people: up to `digits` significant digits, no superfluous zeros.
pub(super) fn number(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { format!("{value}") };
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = usize::try_from((digits - 1 - magnitude).max(0)).unwrap_or(0).min(12);
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A count with thin groups of three digits.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (position, digit) in digits.chars().enumerate() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A noun in the number that fits.
pub(super) fn counted(value: u64, noun: &str) -> String {
    let ending = match value {
        1 => "",
        _ if noun.ends_with('s') => "es",
        _ => "s",
    };
    format!("{} {noun}{ending}", count(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_but_not_wrong() {
        let shown = [0.0, 0.03, 41.666_666, 1_234_567.8, -0.000_012_345, 100.0].map(|value| number(value, 4));
        assert_eq!(shown, ["0", "0.03", "41.67", "1234568", "-0.00001234", "100"]);
        assert_eq!(count(1_234_567), "1 234 567");
        assert_eq!([counted(1, "warning"), counted(2, "pass")], ["1 warning", "2 passes"]);
    }
}
