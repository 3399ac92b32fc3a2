//! Files that are no program: one finding that says what they are.

use super::*;

/// The only finding, after whatever was read before.
#[track_caller]
fn only_finding(program: &[u8]) -> Finding {
    for settings in [lathe(), mill(), linuxcnc()] {
        let (operations, findings) = interpret(program, settings);
        assert_eq!(operations.last().map(|operation| &operation.kind), Some(&OperationKind::End));
        assert_eq!(findings.findings().len(), 1, "{findings:?}");
        assert_eq!((findings.count(Severity::Error), findings.dropped()), (1, 0));
    }
    interpret(program, mill()).1.findings()[0].clone()
}

#[track_caller]
fn check_file(program: impl AsRef<[u8]>, what: &str, line: u32) {
    let finding = only_finding(program.as_ref());
    assert_eq!((finding.code.name(), finding.severity), ("PRG-NOT-A-PROGRAM", Severity::Error));
    assert!(finding.message.contains(what), "{}", finding.message);
    assert_eq!((finding.span.line, finding.span.column), (line, 1));
    assert_eq!(finding.suggestions.len(), 1);
}

const PROGRAM: &str = "%\r\nO1000 (SHAFT)\r\nG21 G40\r\nG0 X10. Z5.\r\nG1 Z-20. F100\r\nM30\r\n%\r\n";

#[test]
fn wide_text() {
    for mark in [true, false] {
        for (name, wide) in [("UTF-16", 2), ("UTF-32", 4)] {
            for big_endian in [false, true] {
                let text = if mark { format!("\u{feff}{PROGRAM}") } else { PROGRAM.to_owned() };
                let bytes: Vec<u8> = text
                    .chars()
                    .flat_map(|character| {
                        let bytes = u32::from(character).to_be_bytes();
                        let mut bytes = bytes[4 - wide..].to_vec();
                        if !big_endian {
                            bytes.reverse();
                        }
                        bytes
                    })
                    .collect();
                check_file(bytes, name, 1);
            }
        }
    }
}

#[test]
fn other_files() {
    let mut pseudo_random = 1u64;
    let mut noise = |length: usize| {
        let next = |_| {
            pseudo_random =
                pseudo_random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (pseudo_random >> 56) as u8
        };
        (0..length).map(next).collect::<Vec<u8>>()
    };
    for (start, what) in [
        (&b"\x7fELF\x02\x01\x01\0"[..], "ELF"),
        (b"MZ\x90\0\x03\0\0\0", "PE"),
        (b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n1 0 obj\n", "PDF"),
        (b"PK\x03\x04\n\0\0\0", "ZIP"),
        (b"\x1f\x8b\x08\0", "gzip"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"<!DOCTYPE html>\n<html>\n<body>", "HTML"),
        (b"\n\n  <html>", "HTML"),
        (b"{\n  \"name\": 5,\n", "JSON"),
    ] {
        let line = if start.starts_with(b"\n") { 3 } else { 1 };
        check_file([start, &noise(5_000)].concat(), what, line);
    }
}

#[test]
fn programs_of_other_controls() {
    check_file(
        "%_N_WELLE_MPF\n;$PATH=/_N_WKS_DIR/_N_WELLE_WPD\nN10 G18 G54 DIAMON\nN20 T=\"SCHRUPP\" D1 M6\nN30 LIMS=3000\n",
        "SINUMERIK",
        1,
    );
    // Nothing is reported of what was read before the first line that says what it is.
    check_file(
        "; shaft\nN10 G0 G90 G54\nN20 M7 S500 D1 M3\nN30 G1 X10 F100 E5\nN40 TRANS X10 Z5\nN50 R1=5\nN60 G0 X=R1\nM30\n",
        "SINUMERIK",
        5,
    );
    check_file(
        "0 BEGIN PGM 100 MM\n1 BLK FORM 0.1 Z X+0 Y+0 Z-20\n2 TOOL CALL 3 Z S5000\n3 L X+10 R0 FMAX\n",
        "HEIDENHAIN",
        1,
    );
    check_file("UNo. MATERIAL OUTER-DIA MIN INNER-DIA LENGTH\n0 S45C 100. 0. 120.\nUNo. UNIT CONTI.\n", "MAZATROL", 1);
    check_file("; from elsewhere\n6 L X+10 Y+5 R0 FMAX M3\n7 L Z-5\n", "HEIDENHAIN", 2);
}

#[test]
fn a_program_with_strange_lines_is_read_on() {
    check(
        &mill(),
        "G0 X1\n#100=5\nIF [#100 EQ 6] GOTO 10\nTHIS IS TEXT\nX2\nG65 P9100 A5. R1.",
        "rapid 0 -> X1
         rapid X1 -> X2
         ! 4:1+4 PRG-TEXT
         ! 4:6+2 PRG-TEXT
         ! 4:9+4 PRG-TEXT
         ! 6:1+17 PRG-SUBPROGRAM-MISSING",
    );
}
