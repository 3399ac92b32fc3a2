use feedwave_store::StoreError;
use proptest::prelude::*;

use super::*;

/// Bytes of message and details as they are sent.
fn sent_bytes(status: &Status) -> usize {
    let mut headers = HeaderMap::new();
    status.add_header(&mut headers).unwrap();
    [Status::GRPC_MESSAGE, Status::GRPC_STATUS_DETAILS]
        .iter()
        .filter_map(|name| headers.get(name))
        .map(http::HeaderValue::len)
        .sum()
}

fn of(violations: impl IntoIterator<Item = (String, String)>) -> Status {
    let mut collected = Violations::default();
    for (field, description) in violations {
        collected.add(field, description);
    }
    Status::from(Error::from(collected.finish().unwrap_err()))
}

#[test]
fn every_violation_becomes_one_field_violation() {
    let mut violations = Violations::default();
    violations.add("machine", "must be set");
    violations.add("interpolation_period_us", "must be 50 to 20000, is 7");
    let status = Status::from(Error::from(violations.finish().unwrap_err()));
    assert_eq!(status.code(), Code::InvalidArgument);
    let expected = "invalid request: machine: must be set; interpolation_period_us: must be 50 to 20000, is 7";
    assert_eq!(status.message(), expected);
    let details = status.get_error_details();
    let fields: Vec<_> = details.bad_request().unwrap().field_violations.iter().map(|v| v.field.as_str()).collect();
    assert_eq!(fields, ["machine", "interpolation_period_us"]);
    let info = details.error_info().unwrap();
    assert_eq!((info.reason.as_str(), info.domain.as_str()), ("INVALID_FIELDS", DOMAIN));
    assert!(info.metadata.is_empty(), "nothing is left out");
}

#[test]
fn what_does_not_fit_is_counted_in_message_and_details() {
    let status = of((0..500).map(|index| (format!("tools[{index}]"), "must be of the form `tools/{tool}`".to_owned())));
    assert!(sent_bytes(&status) <= MAX_STATUS_BYTES);
    let details = status.get_error_details();
    let listed = details.bad_request().unwrap().field_violations.len();
    assert!(listed >= 20, "{listed} listed");
    assert_eq!(details.error_info().unwrap().metadata[NOT_LISTED], (500 - listed).to_string());
    let (_, more) = status.message().rsplit_once("; and ").unwrap();
    let shown = status.message().matches("tools[").count();
    assert_eq!(more, format!("{} more", 500 - shown));
}

#[test]
fn one_hostile_value_still_says_what_is_wrong_with_it() {
    let status = of([("name".to_owned(), format!("must be short, is {:?}", "\u{1f529}\"%".repeat(100_000)))]);
    assert!(sent_bytes(&status) <= MAX_STATUS_BYTES);
    assert!(status.message().starts_with("invalid request: name: must be short, is"), "{}", status.message());
    assert_eq!(status.get_error_details().bad_request().unwrap().field_violations.len(), 1);
}

proptest! {
    #[test]
    fn no_status_is_larger_than_clients_take(
        violations in prop::collection::vec((".{0,300}", ".{0,900}"), 1..100),
        texts in prop::array::uniform4(prop_oneof![".{0,2000}", "[a-z:/]{0,3000}"]),
    ) {
        let count = violations.len();
        let status = of(violations);
        prop_assert!(sent_bytes(&status) <= MAX_STATUS_BYTES, "{}", sent_bytes(&status));
        let details = status.get_error_details();
        let listed = details.bad_request().unwrap().field_violations.len();
        let not_listed = details.error_info().unwrap().metadata.get(NOT_LISTED).map_or(0, |n| n.parse().unwrap());
        prop_assert!(listed >= 1);
        prop_assert_eq!(listed + not_listed, count);

        let [a, b, c, d] = texts;
        for error in [
            Error::NotFound { kind: "job".to_owned(), name: a.clone() },
            Error::RequestIdReused { request_id: a.clone(), job: "jobs/1".to_owned() },
            Error::EtagMismatch { name: a.clone(), etag: b.clone() },
            Error::Precondition { reason: "PROGRAM_REFUSED", subject: a.clone(), message: b.clone() },
            Error::OutOfRange { reason: "UPLOAD_OFFSET", message: a, metadata: vec![("x", b), ("y", c), ("z", d)] },
        ] {
            let status = Status::from(error);
            prop_assert!(sent_bytes(&status) <= MAX_STATUS_BYTES, "{status:?}: {}", sent_bytes(&status));
        }
    }
}

#[test]
fn a_status_of_the_transport_gets_details() {
    let completed = |status: Status| {
        let mut headers = HeaderMap::new();
        status.add_header(&mut headers).unwrap();
        complete(&mut headers, 4_096);
        Status::from_header_map(&headers).unwrap()
    };
    for status in [Status::out_of_range("too long"), Status::resource_exhausted("decompressing: too long")] {
        let completed = completed(status);
        assert_eq!(completed.code(), Code::ResourceExhausted);
        let details = completed.get_error_details();
        let info = details.error_info().unwrap();
        assert_eq!((info.reason.as_str(), info.metadata["limit_bytes"].as_str()), ("MESSAGE_TOO_LARGE", "4096"));
        assert_eq!(details.quota_failure().unwrap().violations[0].subject, "limits.message_bytes");
    }
    let unknown = completed(Status::unimplemented("x".repeat(100_000)));
    assert_eq!((unknown.code(), sent_bytes(&unknown) <= MAX_STATUS_BYTES), (Code::Unimplemented, true));
    assert_eq!(unknown.get_error_details().error_info().unwrap().reason, "NOT_SERVED");

    let mut ours = HeaderMap::new();
    Status::from(Error::Overloaded { what: "runs", limit: 3 }).add_header(&mut ours).unwrap();
    let before = ours.clone();
    complete(&mut ours, 4_096);
    assert_eq!(ours, before, "what has details already keeps them");
}

#[test]
fn the_cause_of_an_internal_error_stays_inside() {
    let status = Status::from(Error::internal("secret path /var/lib"));
    assert_eq!(status.message(), "internal error");
}

#[test]
fn a_draining_server_says_when_to_come_back() {
    let status = Status::from(Error::Draining);
    assert_eq!(status.code(), Code::Unavailable);
    assert_eq!(status.get_error_details().retry_info().unwrap().retry_delay, Some(RETRY_AFTER));
    assert_eq!(status.get_error_details().error_info().unwrap().reason, "SERVER_DRAINING");
}

#[test]
fn a_wrong_offset_names_the_right_one() {
    let error = Error::from(StoreError::WrongOffset { upload_id: uuid::Uuid::nil(), expected: 4_096, given: 0 });
    let status = Status::from(error);
    assert_eq!(status.code(), Code::OutOfRange);
    assert_eq!(status.get_error_details().error_info().unwrap().metadata["expected_offset"], "4096");
}
