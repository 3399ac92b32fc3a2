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
    check_file("PROC TASCHE(REAL L, REAL B)\nG1 X=L\nRET\n", "SINUMERIK", 1);
    check_file("N10 G0 X0 Y0\nN20 G1 X10 F100\nN30 CALL \"SUB1\"\nN40 REPEAT LAB P=3\nM30\n", "SINUMERIK", 3);
    check_file("$TEST.MIN%\nG15 H1\nN1 G0 X50 Z2\nCALL OO88 PX=5\nNEND M2\n", "OKUMA", 1);
    check_file("; from elsewhere\n6 L X+10 Y+5 R0 FMAX M3\n7 L Z-5\n", "HEIDENHAIN", 2);
}

#[test]
fn text_tables_and_drawings() {
    check_file("--- a/shaft.nc\n+++ b/shaft.nc\n@@ -1 +1 @@\n-G0 X1\n+G0 X2\n".repeat(60), "differences", 3);
    check_file("diff --git a/a.nc b/a.nc\n@@ -1 +1 @@\n-G0 X1\n+G0 X2\n", "differences", 1);
    check_file("From: a@b.c\nTo: d@e.f\nSubject: prog\n\nG0 X10\nM30\n".repeat(20), "mail", 1);
    check_file("Subject: prog\nMIME-Version: 1.0\n\nG0 X10\nM30\n", "mail", 2);
    check_file("%FSLAX24Y24*%\n%MOIN*%\nG01*\nX0Y0D02*\nX1000Y0D01*\nM02*\n".repeat(20), "Gerber", 1);
    let prose = "Dear colleagues,\n\nplease find the drawing of the new shaft in the attachment. It is 12 mm longer\n\
                 than the old one, and has 2 more grooves of 3 mm.\n\nBest regards\n";
    check_file(prose, "text", 1);
    check_file(prose.replace('\n', "\r"), "text", 1);
    check_file("one two three four five six seven eight", "text", 1);
    let row = "1.25,0.5,3.75\n12.5,0.25,0.0\n";
    check_file(format!("time_s,x_mm,z_mm\n{}", row.repeat(20)), "CSV", 1);
    check_file(row.replace(',', "\t").repeat(3_000), "CSV", 1);
    for separator in [";", ",", "\t"] {
        check_file("T1;10.0\nT2;12.5\nT3;6.0\n".replace(';', separator), "CSV", 1);
        check_file("Tool;Diameter\nT1;10.0\nT2;12.5\nT3;6.0\n".replace(';', separator), "CSV", 1);
        check_file("X1;2.5;Y2\nX2;3.5;Y3\n".replace(';', separator), "CSV", 1);
    }
    check_file("import math\nx1 = 5\ny1 = 3\nr2 = 7.5\nprint(math.hypot(x1, y1))\n", "source code", 1);
    let entity = "  0\nLINE\n  5\nA4\n330\n1F\n100\nAcDbEntity\n  8\nCONTOUR\n100\nAcDbLine\n 10\n0.0\n 20\n1.5\n 11\n25.0\n 21\n1.5\n";
    let drawing = format!("  0\nSECTION\n  2\nENTITIES\n{}  0\nENDSEC\n  0\nEOF\n", entity.repeat(40));
    check_file(&drawing, "DXF", 1);
    check_file(drawing.replace('\n', "\r\n"), "DXF", 1);
    check_file(
        "import os\nimport sys\nfrom pathlib import Path\n\ndef main():\n    while True:\n        print('G1 X5')\n\nmain()\n",
        "source code",
        1,
    );
    check_file("#include <stdio.h>\nint main(void) {\n    return printf(\"hello\\n\");\n}\n", "source code", 1);
    check_file("# Machines\n\n## Lathe\n\n- turns\n- drills holes of 5 mm\n- cuts threads\n", "Markdown", 1);
    check_file(
        "# A machine\nIt turns parts of up to 40 mm, and drills holes\n\n## Axes\n- two of them\n",
        "Markdown",
        1,
    );
    check_file("S = 0\nL = range(5)\nx = y\nfor value in L:\n    print(value, x)\n    S = S + value\n", "text", 1);
    let tools = "[[tools]]\nnumber = 1\nlength_mm = 120.0\nradius_mm = 5.0\nname = \"end mill\"\n".repeat(4);
    check_file(tools, "configuration", 1);
    check_file("solid shaft\nfacet normal 0 0 1\nouter loop\n", "STL", 1);
    let cyrillic = "\u{41f}\u{440}\u{43e}\u{441}\u{44c}\u{431}\u{430} \u{43d}\u{430}\u{439}\u{442}\u{438} \u{43d}\u{43e}\u{432}\u{44b}\u{439} \
                    \u{447}\u{435}\u{440}\u{442}\u{451}\u{436} \u{432}\u{430}\u{43b}\u{430}\n";
    check_file(cyrillic.repeat(3), "text", 1);
    check_file([b"\n  \n" as &[u8], &[0xe9, b' '].repeat(3_000)].concat(), "binary", 3);
}

#[test]
fn a_file_with_nothing_in_it() {
    for empty in ["", "\n\n", "\u{feff}", " \t\r\n", "%\n%\n"] {
        check_file(empty, "empty", 1);
    }
    check_file("(nothing)\n(yet)\n", "comments", 1);
    for nul in [&[0; 3][..], &[0; 20_000], &[b'%', b'\n', 0, 0, b'\n', 0, b'\n']] {
        check_file(nul, "NUL", 1);
    }
    // A number, an end, or a block that is deleted, is a program.
    for program in ["O1000\n", "T#101\n", "DPRNT[X#101[53]]\n", "M30\n", "%\nO1\n%\n", "\0\0\0\0\0%\nM30\n%\n\0\0"] {
        assert!(!is_refused(program.as_bytes(), mill()), "{program:?}");
    }
    assert!(!is_refused(b"/G0 X1\n", LanguageSettings { block_delete: true, ..mill() }));
}

fn is_refused(program: &[u8], settings: LanguageSettings) -> bool {
    interpret(program, settings).1.findings().iter().any(|finding| finding.code == code::NOT_A_PROGRAM)
}

/// Every program of the fixtures and of the reference, with its path.
fn real_programs() -> Vec<(String, Vec<u8>)> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/");
    let mut folders =
        vec![format!("{root}fixtures").into(), std::path::PathBuf::from(format!("{root}reference/programs"))];
    let mut programs = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(std::ffi::OsStr::to_str) {
                _ if path.is_dir() => folders.push(path),
                Some("nc" | "ngc") => programs.push((path.display().to_string(), std::fs::read(path).unwrap())),
                _ => {}
            }
        }
    }
    assert!(programs.len() > 200, "{}", programs.len());
    programs
}

#[test]
fn a_real_program_is_none_whatever_is_wrong_with_it() {
    let lines = |program: &str, change: &dyn Fn(usize, &str) -> String| {
        program.lines().enumerate().map(|(number, line)| change(number, line) + "\n").collect::<String>()
    };
    let header =
        "Shaft 1234 of the customer ACME\nfirst clamping, turn it round behind operation 3\nask Peter for jaws\n";
    for (path, program) in real_programs() {
        let text: String =
            String::from_utf8_lossy(&program).lines().take(200).map(|line| format!("{line}\n")).collect();
        let headers = if text.lines().count() < 10 { 1 } else { 4 };
        let damaged = [
            text.clone(),
            header.repeat(headers) + &text,
            text.replace(['(', ')'], ""),
            text.replace(';', " "),
            lines(&text, &|_, line| format!("{line} rough it")),
            lines(&text, &|number, line| if number % 3 == 0 { "@?! §$&".to_owned() } else { line.to_owned() }),
            text.replace('.', ","),
            text.replace('0', "O"),
            text.replace('X', "\u{425}").replace('Y', "\u{423}").replace('G', "\u{413}"),
            lines(&text, &|_, line| line.to_owned() + &"\0".repeat(5)),
            text.replace(['\n', ';'], " "),
            text.replace("X", "X="),
            lines(&text, &|_, line| format!("L {line}")),
            lines(&text, &|_, line| format!("{line} MIRROR PART")),
        ];
        for (damage, program) in damaged.iter().enumerate() {
            for settings in [lathe(), mill(), linuxcnc()] {
                // Damaged loops may be endless.
                let settings = LanguageSettings { max_executed_blocks: 2_000, ..settings };
                assert!(!is_refused(program.as_bytes(), settings), "{path}, damage {damage}");
            }
        }
    }
}

#[test]
fn a_program_with_strange_lines_is_read_on() {
    check(
        &mill(),
        "G0 X1\n#100=5\nIF [#100 EQ 6] GOTO 10\nTHIS IS TEXT\nX2\nG65 P9100 A5. R1.",
        "rapid 0 -> X1
         rapid X1 -> X2
         ! 4:1+12 PRG-TEXT
         ! 6:1+17 PRG-SUBPROGRAM-MISSING",
    );
}
