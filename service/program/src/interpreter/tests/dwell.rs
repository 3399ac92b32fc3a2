//! `G4`: section 1 of the page on the program language.

use super::*;
use crate::DecimalPointRule;

#[test]
fn p_is_in_milliseconds_and_with_a_point_in_seconds() {
    for settings in [mill(), lathe()] {
        check(&settings, "G4 P500\nG4 P1.5\nG4 P2.", "dwell 0.5\ndwell 1.5\ndwell 2");
    }
    check(&linuxcnc(), "G4 P500\nG4 P.5", "dwell 500\ndwell 0.5");
}

#[test]
fn x_and_u_are_seconds_unless_the_profile_says_revolutions() {
    check(&lathe(), "G4 X1.5\nG4 U2", "dwell 1.5\ndwell 2");
    let least = LanguageSettings { decimal_point: DecimalPointRule::LeastIncrement, ..lathe() };
    check(&least, "G4 X1500\nG4 U2.", "dwell 1.5\ndwell 2");
    let turns = LanguageSettings { dwell_in_revolutions: true, ..lathe() };
    check(&turns, "G99 G4 X3.\nG4 U2\nG4 P500\nG98 G4 X3.", "dwell 3 rev\ndwell 2 rev\ndwell 0.5\ndwell 3");
    check(&turns, "G99 G4 X-1", "! 1:5+2 PRG-DWELL-TIME");
}
