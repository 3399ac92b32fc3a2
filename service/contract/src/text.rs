//! Texts of bounded length.

use std::borrow::Cow;

/// Placeholder of the middle that is left out.
const LEFT_OUT: &str = "…";

/// The text where it costs at most `most`; else its beginning and its end, since the value is at one of them and
/// the reason at the other. `cost` is that of a character, at least 1.
pub fn shortened(text: &str, most: usize, cost: impl Fn(char) -> usize) -> Cow<'_, str> {
    // Costs stop being added where they are too much, so that a text of megabytes is not read through.
    let within = |limit: usize, chars: &mut dyn Iterator<Item = char>| {
        let mut left = limit;
        let mut bytes = 0;
        for character in chars {
            let Some(rest) = left.checked_sub(cost(character)) else { return (bytes, false) };
            (left, bytes) = (rest, bytes + character.len_utf8());
        }
        (bytes, true)
    };
    if within(most, &mut text.chars()).1 {
        return Cow::Borrowed(text);
    }
    let side = most.saturating_sub(LEFT_OUT.chars().map(&cost).sum()) / 2;
    let (head, _) = within(side, &mut text.chars());
    let (tail, _) = within(side, &mut text.chars().rev());
    Cow::Owned(format!("{}{LEFT_OUT}{}", &text[..head], &text[text.len() - tail..]))
}

/// What a character takes in the header `grpc-message`, which percent-encodes what is not plain; at most three bytes for
/// each of it.
pub const fn percent_encoded(character: char) -> usize {
    let plain = character.is_ascii_alphanumeric() || matches!(character, '.' | ',' | ':' | ';' | '-' | '_' | '/' | '=');
    if plain { 1 } else { 3 * character.len_utf8() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_stays_whole() {
        assert_eq!(shortened("feed", 4, char::len_utf8), "feed");
        assert_eq!(shortened("", 0, char::len_utf8), "");
    }

    #[test]
    fn what_does_not_fit_loses_its_middle_at_the_borders_of_characters() {
        assert_eq!(shortened("abcdefghij", 9, char::len_utf8), "abc…hij");
        assert_eq!(shortened("ääääääääää", 10, char::len_utf8), "ä…ä");
        for most in 9..200 {
            let text = "a µ\"".repeat(50);
            let short = shortened(&text, most, percent_encoded);
            assert!(short.chars().map(percent_encoded).sum::<usize>() <= most, "{most}: {short}");
        }
    }
}
