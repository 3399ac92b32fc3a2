//! Tests of parameters: section 2 of the page on the language.

use super::*;

fn name(text: &str) -> Name {
    Name::read(text.as_bytes()).expect("a name")
}

fn arguments(values: &[(usize, f64)]) -> [Value; LOCALS] {
    let mut arguments = [None; LOCALS];
    for &(number, value) in values {
        arguments[number - 1] = Some(value);
    }
    arguments
}

#[test]
fn section_2_which_numbers_there_are() {
    for (number, fanuc, linuxcnc) in [
        (0, Some(Kind::Vacant), None),
        (1, Some(Kind::Local), Some(Kind::Local)),
        (30, Some(Kind::Local), Some(Kind::Local)),
        (31, Some(Kind::Local), Some(Kind::Common)),
        (33, Some(Kind::Local), Some(Kind::Common)),
        (34, None, Some(Kind::Common)),
        (99, None, Some(Kind::Common)),
        (100, Some(Kind::Common), Some(Kind::Common)),
        (199, Some(Kind::Common), Some(Kind::Common)),
        (200, None, Some(Kind::Common)),
        (999, Some(Kind::Common), Some(Kind::Common)),
        (5_000, Some(Kind::System), Some(Kind::Common)),
        (5_601, Some(Kind::System), Some(Kind::System)),
        (5_602, Some(Kind::System), None),
    ] {
        assert_eq!((FANUC.kind(number), LINUXCNC.kind(number)), (fanuc, linuxcnc), "#{number}");
    }
    assert!(LINUXCNC.unknown(5_602).message.contains("#5001 to #5601"));
}

#[test]
fn calls_have_locals_of_their_own_and_share_the_rest() {
    let mut parameters = Parameters::default();
    parameters.set_local(1, Some(10.0));
    parameters.set_common(100, Some(1.0));
    parameters.set_named(&name("a"), 5.0).expect("room for a name");
    parameters.enter(arguments(&[(1, 7.0), (33, 9.0)]));
    assert_eq!((parameters.depth(), parameters.local(1), parameters.local(2)), (1, Some(7.0), None));
    assert_eq!((parameters.local(33), parameters.named(&name("a"))), (Some(9.0), None));
    parameters.set_local(1, Some(8.0));
    parameters.set_common(100, Some(2.0));
    parameters.set_named(&name("_g"), 6.0).expect("room for a name");
    parameters.leave();
    assert_eq!((parameters.depth(), parameters.local(1), parameters.local(33)), (0, Some(10.0), None));
    assert_eq!((parameters.common(100), parameters.named(&name("_G"))), (Some(Some(2.0)), Some(6.0)));
    assert_eq!(parameters.named(&name("A")), Some(5.0));
    parameters.leave();
    assert_eq!(parameters.local(1), Some(10.0), "the main program has no caller");
}

#[test]
fn only_what_changes_a_value_counts_as_a_change() {
    let mut parameters = Parameters::default();
    let mut counts = vec![parameters.changes()];
    let mut count = |parameters: &Parameters| counts.push(parameters.changes());
    parameters.set_local(1, None);
    count(&parameters);
    parameters.set_local(1, Some(1.0));
    count(&parameters);
    parameters.set_local(1, Some(1.0));
    count(&parameters);
    parameters.set_common(100, Some(1.0));
    count(&parameters);
    parameters.set_common(100, Some(1.0));
    count(&parameters);
    parameters.set_named(&name("a"), 1.0).expect("room for a name");
    parameters.set_named(&name("a"), 1.0).expect("it is there");
    count(&parameters);
    parameters.set_returned(Some(1.0));
    parameters.set_returned(Some(1.0));
    count(&parameters);
    assert_eq!(counts, [0, 0, 1, 1, 2, 2, 3, 4]);
}

#[test]
fn a_vacant_value_may_be_assigned_over_an_initial_one() {
    let mut parameters = Parameters::default();
    assert_eq!(parameters.common(500), None);
    parameters.set_common(500, None);
    assert_eq!(parameters.common(500), Some(None));
}

#[test]
fn names_are_limited_in_number_and_freed_with_their_call() {
    let mut parameters = Parameters::default();
    parameters.enter([None; LOCALS]);
    for number in 0..MOST_NAMES {
        parameters.set_named(&name(&format!("n{number}")), 1.0).expect("room for a name");
    }
    let refusal = parameters.set_named(&name("more"), 1.0).expect_err("no room");
    assert_eq!(refusal.code, code::PARAMETER_LIMIT);
    assert_eq!(parameters.set_named(&name("n5"), 2.0), Ok(()), "it is there already");
    parameters.leave();
    assert_eq!(parameters.set_named(&name("more"), 1.0), Ok(()));
}

#[test]
fn parameters_survive_a_snapshot_and_are_small_when_unused() {
    let mut parameters = Parameters::default();
    assert!(postcard::to_allocvec(&parameters).expect("it can be written").len() < 16);
    parameters.enter(arguments(&[(3, 0.1)]));
    parameters.set_common(500, Some(1.0 / 3.0));
    parameters.set_named(&name("_depth"), -0.25).expect("room for a name");
    let bytes = postcard::to_allocvec(&parameters).expect("it can be written");
    assert_eq!(postcard::from_bytes::<Parameters>(&bytes).expect("it can be read"), parameters);
}

#[test]
fn names_of_initial_values() {
    for (name, ok) in [("_speed", true), ("speed", false), ("_Speed", false), ("_a b", false), ("", false)] {
        assert_eq!(InitialParameters::name_problem(name).is_none(), ok, "{name}");
    }
}

#[test]
fn a_range_of_one_number_is_that_number() {
    let message = FANUC.unknown(99_999).message;
    assert!(message.starts_with("#99999 does not exist; there are #0, #1 to #33,"), "{message}");
}
