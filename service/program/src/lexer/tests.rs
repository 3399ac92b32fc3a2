use proptest::prelude::*;

use super::*;

/// One line per token: kind, and the text it covers.
fn render(line: &[u8]) -> String {
    let tokens = Lexer::new(line).map(|token| {
        let text = String::from_utf8_lossy(&line[token.start as usize..token.end as usize]);
        match token.kind {
            TokenKind::Word => format!("{}={}", char::from(token.letter), token.number.value()),
            TokenKind::LoneLetter => format!("lone<{text}>"),
            TokenKind::MalformedNumber => format!("bad<{text}>"),
            kind => format!("{kind:?}<{text}>"),
        }
    });
    tokens.collect::<Vec<_>>().join(" ")
}

#[track_caller]
fn check(line: impl AsRef<[u8]>, expected: &str) {
    assert_eq!(render(line.as_ref()), expected);
}

#[test]
fn words() {
    check("N10 G01 X10. Z-5", "N=10 G=1 X=10 Z=-5");
    check("g1x+.5z 20.", "G=1 X=0.5 Z=20");
    check(" \tG 43.4 ", "G=43.4");
    check(":1234", "O=1234");
    check("%O1", "Percent<%> O=1");
    check("/2N5G0", "BlockDelete</2> N=5 G=0");
    check("/ G0", "BlockDelete</> G=0");
}

#[test]
fn comments() {
    check("G1 (rough X10) X5 ; X6", "G=1 Comment<(rough X10)> X=5 Comment<; X6>");
    check("G1 (open X10", "G=1 UnclosedComment<(open X10>");
}

#[test]
fn defects() {
    check("X", "lone<X>");
    check("X(c)5", "lone<X> Comment<(c)> StrayNumber<5>");
    check("XY10", "lone<X> Y=10");
    check("X Y10", "lone<X> Y=10");
    check("X1.2.3 Z--1 Y.", "bad<X1.2.3> bad<Z--1> bad<Y.>");
    check("HELLO 10 WORLD", "Text<HELLO 10> Text<WORLD>");
    check("G1 !& X1", "G=1 Unexpected<!&> X=1");
    check("G1 \u{e9}\u{e8} X1", "G=1 Unexpected<\u{e9}\u{e8}> X=1");
    check(b"G1 \xe9\xe8 X1", "G=1 NotUtf8<\u{fffd}\u{fffd}> X=1");
    check(b"G1\0\0X1", "G=1 Nul<\0\0> X=1");
    check("G1\rX1", "G=1 Unexpected<\r> X=1");
}

#[test]
fn values_that_are_computed() {
    check("G1 X[#1+2] Z5", "G=1 Computed<X[#1+2]> Z=5");
    check("X-#1 Y - [2] Z+SIN[30]F5", "Computed<X-#1> Computed<Y - [2]> Computed<Z+SIN[30]> F=5");
    check("XSIN[30] Y SQRT [4]", "Computed<XSIN[30]> Computed<Y SQRT [4]>");
    check("G#1M##2", "Computed<G#1> Computed<M##2>");
    check("X#<wide one>Y1", "Computed<X#<wide one>> Y=1");
    check("X[1", "Computed<X[1>");
    check("X# Y1", "Computed<X# > Y=1");
}

#[test]
fn assignments() {
    check("#100 = 5", "Assignment<#100 = 5>");
    check("#1=#2+3*[4] (c)", "Assignment<#1=#2+3*[4]> Comment<(c)>");
    check("#3=6 G1 X#3", "Assignment<#3=6> G=1 Computed<X#3>");
    check("#1=5 #<a b>=-SIN[30]", "Assignment<#1=5> Assignment<#<a b>=-SIN[30]>");
    check("#1 X5", "Assignment<#1> X=5");
}

#[test]
fn control_statements_are_one_token_to_the_end_of_the_line() {
    check("N5 GOTO 10", "N=5 Statement<GOTO 10>");
    check("N5 GOTO[#1]", "N=5 Statement<GOTO[#1]>");
    check("if [#1 EQ 0] goto 5", "Statement<if [#1 EQ 0] goto 5>");
    check("END1", "Statement<END1>");
    check("DPRNT[X#1]", "Output<DPRNT[X#1]>");
}

proptest! {
    #[test]
    fn every_byte_is_blank_or_in_one_token(line in prop_oneof![prop::collection::vec(any::<u8>(), 0..200), "[-+*/#<>\\[\\]0-9.A-Z= ]{0,60}".prop_map(String::into_bytes)]) {
        let mut covered = 0;
        for token in Lexer::new(&line) {
            let (start, end) = (token.start as usize, token.end as usize);
            prop_assert!(start < end && start >= covered && end <= line.len());
            prop_assert!(line[covered..start].iter().all(|byte| matches!(byte, b' ' | b'\t')));
            covered = end;
        }
        prop_assert!(line[covered..].iter().all(|byte| matches!(byte, b' ' | b'\t')));
    }
}
