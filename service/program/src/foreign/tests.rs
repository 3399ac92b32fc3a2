//! Files by their lines, and programs of the language that are none of them.

use super::*;

#[track_caller]
fn is(line: impl AsRef<[u8]>, what: &str) {
    let found = recognise(line.as_ref(), true).map(|foreign| foreign.what).unwrap_or_default();
    assert!(found.contains(what) && !found.is_empty(), "{:?} is {found:?}", String::from_utf8_lossy(line.as_ref()));
}

#[test]
fn files_by_their_first_bytes() {
    is(b"\x7fELF\x02\x01\x01\0\0", "ELF");
    is(b"MZ\x90\0\x03\0", "PE");
    is(b"%PDF-1.7", "PDF");
    is(b"PK\x03\x04\x14\0", "ZIP");
    is(b"\x1f\x8b\x08\0", "gzip");
    is(b"\x89PNG", "PNG");
    is(b"\xff\xd8\xff\xe0\0\x10JFIF", "JPEG");
    is("<!doctype html><html>", "HTML");
    is("<?xml version=\"1.0\"?>", "XML");
    is("{", "JSON");
    is("[ {\"a\": 1}]", "JSON");
    is("ISO-10303-21;", "STEP");
    is(b"\x02\x00\x10\xff\xfe\xab\x80\x81\x03\x04MAZ", "binary");
}

#[test]
fn archives_by_the_head_of_their_first_file() {
    for (name, mark) in [("shaft.nc", &b"ustar\x0000"[..]), ("G1 X10", b"ustar  \0"), ("%", b"")] {
        let mut head = [0; 512];
        head[..name.len()].copy_from_slice(name.as_bytes());
        head[100..107].copy_from_slice(b"0000644");
        head[124..135].copy_from_slice(b"00000000012");
        head[257..257 + mark.len()].copy_from_slice(mark);
        head[148..156].copy_from_slice(b"        ");
        let sum: u32 = head.iter().copied().map(u32::from).sum();
        head[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        is([&head[..], b"G1 X10"].concat(), "tar");
    }
}

#[test]
fn wide_characters() {
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    let wide_be = |text: &str| text.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<_>>();
    for text in ["%", "O1234", "G0 X10"] {
        is(wide(text), "UTF-16");
        is(wide_be(text), "UTF-16");
        is([&b"\xff\xfe"[..], &wide(text)].concat(), "UTF-16");
        // The zero of the line end before or behind it.
        is([&b"\0"[..], &wide(text)].concat(), "UTF-16");
        let utf_32: Vec<_> = text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
        is(utf_32, "UTF-32");
    }
}

#[test]
fn programs_of_other_controls() {
    for line in [
        "%_N_WELLE_MPF",
        "%MPF123",
        "%SPF10",
        ";$PATH=/_N_WKS_DIR",
        "N10 G0 X=R1 Z5",
        "G3 X10 Y5 CR=5",
        "N5 DEF REAL LENGTH",
        "CYCLE83(10, 0, 2, -30)",
        "N20 CYCLE832(0.01,1)",
        "TRANS X10 Y5",
        "N30 G0 SUPA Z0 D0",
        "T=\"FRAESER_10\"",
        "S1=1000 M1=3",
        "MSG(\"ready\")",
        "R1=5 R2=R1+3",
        "LIMS=3000",
        "G0 X=IC(5)",
        "$P_UIFR[1]=CTRANS(X,10)",
        "R1 = 5",
        "r1=5 r2=r1+3",
        "n10 g1 x1 = 5 f100",
        "PROC TASCHE(REAL L, REAL B)",
        "PROC CONTOUR_1",
        "PROC L6 SAVE DISPLOF",
        "N30 CALL \"SUB1\"",
        "N40 REPEAT LAB P=3",
        "REPEATB START P=2",
    ] {
        is(line, "SIEMENS");
    }
    for line in [
        "BEGIN PGM 100 MM",
        "0 BEGIN PGM WELLE MM",
        "1 BLK FORM 0.1 Z X+0 Y+0 Z-20",
        "5 TOOL CALL 3 Z S5000",
        "6 L X+10 Y+5 R0 FMAX M3",
        "7 L Z-5 F200",
        "8 CC X+0 Y+0",
        "9 C X+10 Y+0 DR-",
        "10 CYCL DEF 200 DRILLING",
        "11 FN 0: Q1 = +5",
        "12 LBL 1",
        "%TEST G71 *",
    ] {
        is(line, "HEIDENHAIN");
    }
    is("PARTNO/HOUSING", "APT");
    is("$TEST.MIN%", "OKUMA");
    for line in ["%SHAFT,MX,", "%FLANGE 12, MX", "%,HMXO"] {
        is(line, "FAGOR");
    }
    for line in ["%SHAFT, REV B", "%SHAFT", "%SHAFT,"] {
        assert_eq!(recognise(line.as_bytes(), true), None, "{line}");
    }
}

#[test]
fn documents_by_a_line() {
    for line in ["diff --git a/shaft.nc b/shaft.nc", "@@ -1,7 +1,7 @@", "@@ -1 +1,2 @@ O1000"] {
        is(line, "differences");
    }
    for line in [
        "From: Jo <jo@shop.example>",
        "Received: from mail.shop.example",
        "MIME-Version: 1.0",
        "From jo@shop.example Mon Nov 3",
    ] {
        is(line, "mail");
    }
    for line in ["%FSLAX24Y24*%", "%MOMM*%", "%TF.FileFunction,Copper,L1,Top*%", "%ADD10C,0.15*%"] {
        is(line, "Gerber");
    }
}

#[test]
fn programs_of_the_language_are_never_something_else() {
    for line in [
        "%",
        "%O1234",
        "O1234 (SHAFT)",
        ":1234",
        "(<HTML>)",
        "N10 G0 X10. Z5.",
        "G1 X-5 F.2 ; CR=5",
        "#100=5",
        "N10 #1=#2+3",
        "IF [#1 EQ 5] GOTO 10",
        "#<feed>=100",
        "o100 sub",
        "o<rect> call [10]",
        "WHILE [#1 LT 5] DO1",
        "G1 X[#1+2] R5.",
        "M3 S1000 (T=\"X\")",
        "\0\0\0\0\0\0%",
        "\0\0\0",
        "G0\0\0\0X1\0",
        "G0 X1 (Fr\u{e4}ser)",
        "N10 L5 X1",
        "LAP",
        "CLEAR",
        "T0101 (ROT)",
        "X10 Y5 L2",
        "#[#1]=5",
        "G10 L2 P1 X0",
        "C90.",
        "L10",
        "END1",
        "DPRNT[X#100[53]]",
        "POPEN",
        "T1 D=10. CR=0. - ZMIN=-3. - FLAT END MILL",
        "G0 X=10.",
        "X=#5 Z=-3",
        "L X10 Z5",
        "L X[#1+2]",
        "MIRROR PART",
        "ROT",
        "THE SCALE IS 2 TO 1",
        "X\u{2212}5",
        "G1 X1 \u{e9}\u{e8}",
        "#3000=1(ROT)",
        "x1 = 5",
        "x1, y1 = 5, 3",
        "r2 = 2 * r1",
        "t = \"MILL\"",
        "    if r1 == 5:",
        "if (x1==5) {",
        "int x1 = 5;",
        "const X1 = 5;",
        "G68.2 X0 I0 J0 K0",
        "PROC SHEET",
        "PROC 10 ROUGHING",
        "CALL 100",
        "CALL PETER BEFORE THE CUT",
        "REPEAT 5",
        "REPEAT 5 TIMES P=3",
        "o100 repeat [5]",
        "FROM: CAM",
        "FROM: MILL TO: LATHE",
        "TO: jo@shop.example",
        "SUBJECT: SHAFT 12",
        "DATE: 2024-05-01",
        "---",
        "--- A",
        "+++",
        "@1 ^30",
        "@@ SEE DRAWING",
        "%1000",
        "$TEST",
        "INDEX 4",
        "",
    ] {
        assert_eq!(recognise(line.as_bytes(), true), None, "{line:?}");
    }
}
