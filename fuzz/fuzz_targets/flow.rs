//! Bytes as the decisions of a program of expressions and control flow, of Macro B and of LinuxCNC: one end, bounded work, finite
//! coordinates, and the same after restoring the interpreter. The random tests of `feedwave-program` run the same loop.

#![no_main]

#[path = "../../service/program/tests/common/mod.rs"]
mod common;

use common::{bounded, check, program};
use feedwave_program::{DialectName, LanguageSettings};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let linuxcnc = LanguageSettings { dialect: DialectName::LinuxCnc, ..LanguageSettings::mill() };
    check(&program(bytes, false), &bounded(LanguageSettings::mill()));
    check(&program(bytes, true), &bounded(linuxcnc));
});
