//! Query parameters as fields of a request, by their names in JSON: every wrong one is reported, unknown ones included.

use std::collections::BTreeMap;
use std::str::FromStr;

use feedwave_contract::convert;
use feedwave_contract::proto::JobState;
use prost_types::Timestamp;

use super::HttpError;
use crate::error::Violations;

/// The first time that a timestamp of the contract has.
const YEAR_1: jiff::Timestamp = jiff::Timestamp::constant(-62_135_596_800, 0);

/// The parameters not taken yet.
pub(super) struct Query {
    parameters: BTreeMap<String, Vec<String>>,
    violations: Violations,
}

impl Query {
    /// The parameters of a URL.
    pub(super) fn parse(raw: Option<&str>) -> Self {
        let mut query = Self { parameters: BTreeMap::new(), violations: Violations::default() };
        let pairs = axum::extract::Query::<Vec<(String, String)>>::try_from_uri(
            &format!("/?{}", raw.unwrap_or_default()).parse().unwrap_or_default(),
        );
        match pairs {
            Ok(pairs) => {
                for (name, value) in pairs.0 {
                    query.parameters.entry(name).or_default().push(value);
                }
            }
            Err(error) => query.violations.add("query", error.to_string()),
        }
        query
    }

    /// A text, empty where it is absent.
    pub(super) fn text(&mut self, name: &str) -> String {
        let values = self.parameters.remove(name).unwrap_or_default();
        if values.len() > 1 {
            self.violations.add(name, "must be given once");
        }
        values.into_iter().next().unwrap_or_default()
    }

    /// A number, its default where it is absent.
    pub(super) fn number<T: FromStr<Err: std::fmt::Display> + Default>(&mut self, name: &str) -> T {
        self.number_option(name).unwrap_or_default()
    }

    /// A number, `None` where it is absent.
    pub(super) fn number_option<T: FromStr<Err: std::fmt::Display>>(&mut self, name: &str) -> Option<T> {
        let text = self.text(name);
        if text.is_empty() {
            return None;
        }
        self.violations.check(name, text.parse())
    }

    /// States by name, with or without their prefix; may be given more than once.
    pub(super) fn states(&mut self, name: &str) -> Vec<i32> {
        let values = self.parameters.remove(name).unwrap_or_default();
        let mut states = Vec::with_capacity(values.len());
        for value in values {
            let upper = value.to_ascii_uppercase();
            let known =
                JobState::from_str_name(&upper).or_else(|| JobState::from_str_name(&format!("JOB_STATE_{upper}")));
            match known {
                Some(state) => states.push(state.into()),
                None => self.violations.add(name, format!("{value:?} is not a state of a job")),
            }
        }
        states
    }

    /// An RFC 3339 time.
    pub(super) fn time(&mut self, name: &str) -> Option<Timestamp> {
        let text = self.text(name);
        if text.is_empty() {
            return None;
        }
        let time = text.parse::<jiff::Timestamp>().ok().filter(|time| *time >= YEAR_1);
        let time = time.ok_or("must be a time such as 2026-01-31T08:00:00Z, from 0001-01-01 to 9999-12-30");
        Some(convert::timestamp(self.violations.check(name, time)?.as_microsecond()))
    }

    /// Ends the reading: what was not taken is not known.
    pub(super) fn finish(mut self) -> Result<(), HttpError> {
        for name in std::mem::take(&mut self.parameters).into_keys() {
            self.violations.add(name, "is not a parameter of this path");
        }
        // Parameters are called as the client wrote them.
        self.violations.finish().map_err(|invalid| HttpError(invalid.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn parameters_become_fields() {
        let mut query = Query::parse(Some(
            "pageSize=7&states=ready&states=JOB_STATE_FAILED&createdFrom=2026-01-02T03:04:05Z&machine=machines%2Flathe",
        ));
        assert_eq!(query.number::<i32>("pageSize"), 7);
        assert_eq!(query.states("states"), [i32::from(JobState::Ready), i32::from(JobState::Failed)]);
        assert_eq!(query.time("createdFrom").unwrap().seconds, 1_767_323_045);
        assert_eq!(query.text("machine"), "machines/lathe");
        assert_eq!(query.number::<u64>("after"), 0);
        assert!(query.finish().is_ok());
    }

    #[test]
    fn everything_wrong_is_reported_at_once() {
        let mut query = Query::parse(Some("pageSize=many&states=lost&createdFrom=yesterday&colour=red"));
        query.number::<i32>("pageSize");
        query.states("states");
        query.time("createdFrom");
        let Err(HttpError(Error::Invalid(violations))) = query.finish() else { panic!("accepted") };
        let fields: Vec<_> = violations.as_slice().iter().map(|violation| violation.field.as_str()).collect();
        assert_eq!(fields, ["pageSize", "states", "createdFrom", "colour"]);
    }

    #[test]
    fn times_that_the_contract_does_not_have_are_refused_in_words() {
        for text in ["9999-12-31T23:59:59Z", "-009999-01-02T01:59:59Z", "0000-12-31T23:59:59Z"] {
            let mut query = Query::parse(Some(&format!("createdBefore={text}")));
            assert_eq!(query.time("createdBefore"), None);
            let Err(HttpError(Error::Invalid(violations))) = query.finish() else { panic!("accepted") };
            assert!(violations.as_slice()[0].description.contains("0001-01-01 to 9999-12-30"), "{text}");
        }
        let mut query = Query::parse(Some("createdFrom=0001-01-01T00:00:00Z"));
        assert_eq!(query.time("createdFrom").unwrap().seconds, -62_135_596_800);
    }
}
