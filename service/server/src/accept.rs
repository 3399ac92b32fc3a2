//! Which form of an answer a client prefers: `Accept` (RFC 9110, section 12.5.1).

use std::cmp::Reverse;

use http::{HeaderMap, header};

/// A form that an answer has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offer<T> {
    pub(crate) form: T,
    /// Types by which clients ask for it, lower case.
    pub(crate) types: &'static [&'static str],
}

/// One entry of `Accept`: types, and how welcome they are, in thousandths.
struct Range {
    name: String,
    weight: u16,
}

impl Range {
    fn parse(text: &str) -> Self {
        let mut parts = text.split(';').map(str::trim);
        let name = parts.next().unwrap_or_default().to_ascii_lowercase();
        let weight = parts.find_map(|parameter| {
            let (name, value) = parameter.split_once('=')?;
            name.trim_end().eq_ignore_ascii_case("q").then(|| value.trim().parse::<f32>().ok())?
        });
        let weight = weight.filter(|weight| (0.0..=1.0).contains(weight)).map_or(1_000, |weight| (weight * 1e3) as u16);
        Self { name, weight }
    }

    /// How exactly it names a form, if it does.
    fn names<T>(&self, offer: &Offer<T>) -> Option<u8> {
        if offer.types.contains(&self.name.as_str()) {
            return Some(2);
        }
        let family = self.name.strip_suffix('*').filter(|family| family.ends_with('/'));
        match family {
            Some("*/") => Some(0),
            Some(family) => offer.types.iter().any(|name| name.starts_with(family)).then_some(1),
            None => None,
        }
    }
}

/// The form that is most welcome: of those that are equally so, the one named most exactly, then the one named first, then the one
/// offered first. `None` where none is named, or the client says nothing.
pub(crate) fn preferred<T: Copy>(headers: &HeaderMap, offers: &[Offer<T>]) -> Option<T> {
    let values = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    let ranges: Vec<Range> = values.flat_map(|value| value.split(',')).map(Range::parse).collect();
    let welcome = |offer: &Offer<T>| {
        let named = ranges.iter().zip(0_usize..).filter_map(|(range, place)| Some((range.names(offer)?, range, place)));
        // What is said of a type counts more than what is said of its family.
        let (exact, range, place) =
            named.max_by_key(|(exact, range, place)| (*exact, range.weight, Reverse(*place)))?;
        (range.weight > 0).then_some((range.weight, exact, Reverse(place)))
    };
    let best =
        offers.iter().zip(0_usize..).filter_map(|(offer, index)| Some(((welcome(offer)?, Reverse(index)), offer.form)));
    best.max_by_key(|(rank, _)| *rank).map(|(_, form)| form)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFERS: [Offer<char>; 2] =
        [Offer { form: 'a', types: &["text/a", "application/a"] }, Offer { form: 'b', types: &["text/b"] }];

    #[test]
    fn what_is_most_welcome_is_preferred() {
        for (accept, expected) in [
            ("text/b", Some('b')),
            ("TEXT/B", Some('b')),
            ("text/b, text/a", Some('b')),
            ("text/a;q=0.5, text/b;q=0.6", Some('b')),
            ("text/b;v=1; Q=0.2, application/a;q=0.3", Some('a')),
            ("text/b, */*", Some('b')),
            ("*/*", Some('a')),
            ("text/*", Some('a')),
            ("text/a;q=0, */*", Some('b')),
            ("text/a;q=0, application/a;q=0, text/*;q=0.1", Some('b')),
            ("text/b;q=0.1, text/*;q=0.9", Some('a')),
            ("text/b;q=nonsense, text/a;q=0.9", Some('b')),
            ("", None),
            ("image/png", None),
            ("text/b;q=0", None),
            ("text/b;q=0.000", None),
        ] {
            let headers = HeaderMap::from_iter([(header::ACCEPT, accept.parse().unwrap())]);
            assert_eq!(preferred(&headers, &OFFERS), expected, "{accept}");
        }
        assert_eq!(preferred(&HeaderMap::new(), &OFFERS), None);
    }
}
