//! Numbers of O-words, held against LinuxCNC's interpreter.

use super::*;

/// The message of the one finding of a program that is refused.
#[track_caller]
fn refusal(program: &str) -> String {
    let (_, findings) = ends(&format!("{program}\nM2\n"), &LanguageSettings::linuxcnc());
    let [finding] = &findings.into_findings()[..] else { panic!("{program}") };
    assert_eq!(finding.severity, Severity::Error, "{program}: {finding:?}");
    assert!(!finding.suggestions.is_empty(), "{program}: {finding:?}");
    finding.message.clone()
}

#[test]
fn a_number_begins_one_thing_of_those_that_are_executed() {
    for second in ["if [1]\no1 endif", "while [0]\no1 endwhile", "do\no1 while [0]", "repeat [1]\no1 endrepeat"] {
        let message = refusal(&format!("o1 if [1]\nG0 X1\no1 endif\no1 {second}"));
        assert_eq!(message, "o1 is that of the if on line 1 already");
    }
    // One of two branches is executed, and every subprogram has its own.
    let branches = "o9 if [1]\no1 if [1]\nG0 X1\no1 endif\no9 else\no1 if [1]\nX2\no1 endif\no9 endif";
    assert_eq!(linuxcnc_xs(branches), [1.0]);
    let subs = "o1 sub\no5 if [1]\nG0 X1\no5 endif\no1 endsub\no2 sub\no5 repeat [2]\nX2\no5 endrepeat\no2 endsub";
    assert_eq!(linuxcnc_xs(&format!("{subs}\no5 if [1]\no1 call\no5 endif\no2 call\no1 call")), [1.0, 2.0, 1.0]);
    let rounds = "G91\no1 repeat [2]\no2 if [1]\nG0 X1\no2 endif\no1 endrepeat";
    assert_eq!(linuxcnc_xs(rounds), [1.0, 2.0], "round by round");
}

#[test]
fn what_ends_something_comes_behind_its_beginning() {
    for (program, message) in [
        ("o1 endif", "o1 endif without an o1 if that was executed before it"),
        ("o1 else\nG0 X1\no1 endif", "o1 else without an o1 if that was executed before it"),
        ("o1 if [1]\nG0 X1\no2 endif", "o2 endif without an o2 if that was executed before it"),
        ("o1 break", "o1 break without an o1 while that was executed before it"),
        ("o1 if [1]\no1 break\no1 endif", "o1 break, but o1 is the if on line 1"),
        (
            "o1 repeat [2]\nG0 X1\no1 continue\no1 endrepeat",
            "continue leaves while and do, but o1 is the repeat on line 1",
        ),
        ("o1 repeat [2]\nG0 X1\no1 break\no1 endrepeat", "break leaves while and do, but o1 is the repeat on line 1"),
        ("o1 sub\no2 if [1]\no1 endsub\no2 endif", "o2 endif without an o2 if that was executed before it"),
    ] {
        assert_eq!(refusal(program), message, "{program}");
    }
}

#[test]
fn a_subprogram_is_defined_before_its_first_call_or_behind_the_end() {
    let sub = "o1 sub\nG0 X1\no1 endsub";
    let message = "o1 sub is passed although it was called or passed before";
    assert_eq!(refusal(&format!("o1 call\n{sub}")), message);
    assert_eq!(refusal(&format!("{sub}\n{sub}")), "o1 is that of the sub on line 1 already");
    assert_eq!(refusal("o1 sub\no2 sub\nG0 X1\no2 endsub\no1 endsub"), "o2 sub begins on line 2, within o1 sub");
    assert_eq!(linuxcnc_xs(&format!("{sub}\no1 call")), [1.0]);
    assert_eq!(linuxcnc_xs(&format!("o1 call\nX2\nM2\n{sub}")), [1.0, 2.0]);
    assert_eq!(
        refusal("o1 sub\nG0 X1\nM99\no1 endsub\no1 call").split(',').next(),
        Some("M99 returns from a program that M98 has called")
    );
}

#[test]
fn numbers_are_written_out_but_for_calls() {
    assert_eq!(linuxcnc_xs("o200 sub\nG0 X#1\no200 endsub\no[100+100] call [4]"), [4.0]);
    assert_eq!(
        refusal("o[1+1] if [1]\nG0 X1\no[1+1] endif"),
        "only call may compute its number: that of if is written out"
    );
    assert_eq!(linuxcnc_xs("o<1> sub\nG0 X1\no<1> endsub\no1 call"), [1.0], "the same number");
    let message = "behind repeat must be the number of rounds in brackets";
    let (_, findings) = ends("o1 repeat 2\no1 endrepeat\nM2\n", &LanguageSettings::linuxcnc());
    assert_eq!(findings.into_findings()[0].message, message);
    assert_eq!(refusal("(A) o1 if [1]\nG0 X1"), "O is behind a comment: an O-word is the first of its line");
}

#[test]
fn a_program_number_within_a_program_is_passed() {
    assert_eq!(linuxcnc_xs("G0 X1\no100\nX2"), [1.0, 2.0]);
}
