//! How far values reach.

use proptest::prelude::*;

use super::super::{operation_end, starts_value, value_end};

#[test]
fn values_end_where_they_are_read_to() {
    for (text, end) in [
        ("#1 Z5", 2),
        ("-#[#1+[2]]Z5", 10),
        ("[1+[2]] Y", 7),
        ("ATAN[1]/[2] X", 11),
        ("SIN[30]/[2]", 7),
        ("-SIN [30]X", 9),
        ("#<a b> X", 6),
        ("##2X", 3),
        ("[1", 2),
        ("X5", 0),
    ] {
        assert_eq!(value_end(text.as_bytes(), 0), end, "{text}");
    }
}

#[test]
fn operations_end_behind_the_last_value() {
    for (text, end) in [("#2+1 (c)", 4), ("6 G1 X#3", 1), ("[#1+1] #2=3", 6), ("#2 MOD 4*SIN[3]", 15), ("1+", 1)] {
        assert_eq!(operation_end(text.as_bytes(), 0), end, "{text}");
    }
}

#[test]
fn what_starts_a_value() {
    for (text, starts) in [
        ("#1", true),
        ("-#1", true),
        ("- [2]", true),
        ("SIN[3]", true),
        ("-5", false),
        ("Y5", false),
        ("", false),
        ("A[3]", false),
    ] {
        assert_eq!(starts_value(text.as_bytes(), 0), starts, "{text}");
    }
}

proptest! {
    #[test]
    fn ends_are_in_the_line(line in "[-+#<>\\[\\]0-9.A-Z *]{0,40}") {
        for end in [value_end(line.as_bytes(), 0), operation_end(line.as_bytes(), 0)] {
            prop_assert!(end <= line.len());
        }
    }
}
