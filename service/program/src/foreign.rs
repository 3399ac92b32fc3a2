//! Files that are no program of the language at all: recognised as a whole, so that they are one finding that says what they
//! are instead of one for every line.
//!
//! A line is examined when it is the first with anything in it, or cannot be read. So a file that can be read is never
//! taken for something else, and the marks need only be such that no program holds them where a line cannot be read.

/// What a file is, and what to do with it instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Foreign {
    pub(crate) what: &'static str,
    pub(crate) cure: &'static str,
}

pub(crate) const fn foreign(what: &'static str, cure: &'static str) -> Foreign {
    Foreign { what, cure }
}

const AS_TEXT: &str = "save it as plain text in UTF-8 or ASCII";
pub(crate) const POST: &str = "let the CAM post write it for the dialect of the machine profile";
pub(crate) const UPLOAD: &str = "upload the program itself";
const UNPACK: &str = "unpack it, and upload the program itself";

impl Foreign {
    pub(crate) const EMPTY: Self = foreign("an empty file", UPLOAD);
    pub(crate) const COMMENTS: Self = foreign("a file with nothing but comments", UPLOAD);
    pub(crate) const NUL: Self =
        foreign("a file of NUL bytes, as a transfer that broke off leaves it", "transfer it again");
}

const UTF_16: Foreign = foreign("text in UTF-16", AS_TEXT);
const UTF_32: Foreign = foreign("text in UTF-32", AS_TEXT);
pub(crate) const BINARY: Foreign =
    foreign("binary data, such as a program of a conversational control", "upload a program in G-code as plain text");
const SIEMENS: Foreign = foreign("a program for a SIEMENS SINUMERIK control", POST);
const HEIDENHAIN: Foreign = foreign("a program for a HEIDENHAIN control", POST);

/// The first bytes of files.
const SIGNATURES: &[(&[u8], Foreign)] = &[
    (b"\xff\xfe\0\0", UTF_32),
    (b"\0\0\xfe\xff", UTF_32),
    (b"\xff\xfe", UTF_16),
    (b"\xfe\xff", UTF_16),
    (b"\x7fELF", foreign("an executable (ELF)", UPLOAD)),
    (b"MZ\x90", foreign("an executable (PE)", UPLOAD)),
    (b"MZ\0", foreign("an executable (PE)", UPLOAD)),
    (b"MZP\0", foreign("an executable (PE)", UPLOAD)),
    (b"\xcf\xfa\xed\xfe", foreign("an executable (Mach-O)", UPLOAD)),
    (b"%PDF-", foreign("a PDF document", UPLOAD)),
    (b"%!PS", foreign("a PostScript document", UPLOAD)),
    (b"PK\x03\x04", foreign("a ZIP archive (or an office document)", UNPACK)),
    (b"PK\x05\x06", foreign("an empty ZIP archive", UNPACK)),
    (b"\x1f\x8b", foreign("a gzip archive", UNPACK)),
    (b"BZh", foreign("a bzip2 archive", UNPACK)),
    (b"\xfd7zXZ", foreign("an xz archive", UNPACK)),
    (b"7z\xbc\xaf\x27\x1c", foreign("a 7-Zip archive", UNPACK)),
    (b"Rar!\x1a", foreign("a RAR archive", UNPACK)),
    (b"\x28\xb5\x2f\xfd", foreign("a Zstandard archive", UNPACK)),
    (b"\x1f\x9d", foreign("a compress archive (.Z)", UNPACK)),
    (b"LZIP", foreign("an lzip archive", UNPACK)),
    (b"\x04\x22\x4d\x18", foreign("an LZ4 archive", UNPACK)),
    (b"MSCF", foreign("a cabinet archive (CAB)", UNPACK)),
    (b"!<arch>", foreign("an archive (ar or Debian package)", UNPACK)),
    (b"070701", foreign("a cpio archive", UNPACK)),
    (b"070707", foreign("a cpio archive", UNPACK)),
    (b"\x89PNG", foreign("an image (PNG)", UPLOAD)),
    (b"\xff\xd8\xff", foreign("an image (JPEG)", UPLOAD)),
    (b"GIF87a", foreign("an image (GIF)", UPLOAD)),
    (b"GIF89a", foreign("an image (GIF)", UPLOAD)),
    (b"\xd0\xcf\x11\xe0", foreign("an office document", UPLOAD)),
    (b"{\\rtf", foreign("an RTF document", AS_TEXT)),
    (b"SQLite format 3", foreign("an SQLite database", UPLOAD)),
    (b"ISO-10303-21", foreign("a STEP model", POST)),
    (b"#!", foreign("a script", UPLOAD)),
];

/// A tar archive begins with the name of its first file.
const TAR: Foreign = foreign("a tar archive", UNPACK);
/// Where the mark of its format is in the head of a file, and the mark.
const TAR_MARK: (usize, &[u8]) = (257, b"ustar");
/// Length of that head, and where the sum of its bytes is, as octal digits.
const TAR_HEAD_BYTES: usize = 512;
const TAR_SUM: core::ops::Range<usize> = 148..156;

/// Share of bytes, one in so many, that are no text in a line of binary data.
const BINARY_SHARE: usize = 4;

/// Fewest such bytes.
const FEWEST_BINARY_BYTES: usize = 8;

/// What the file with this line is, if it is no program; `is_first` while no line before it could be read.
pub(crate) fn recognise(line: &[u8], is_first: bool) -> Option<Foreign> {
    let by_start = if is_first { first_line(line) } else { None };
    by_start.or_else(|| controls(line))
}

fn first_line(line: &[u8]) -> Option<Foreign> {
    if let Some((_, foreign)) = SIGNATURES.iter().find(|(bytes, _)| line.starts_with(bytes)) {
        return Some(*foreign);
    }
    if is_tar(line) {
        return Some(TAR);
    }
    if let Some(foreign) = wide_text(line) {
        return Some(foreign);
    }
    let text = line.trim_ascii();
    if starts_with(text, b"<!DOCTYPE HTML") || starts_with(text, b"<HTML") || starts_with(text, b"<HEAD") {
        return Some(foreign("an HTML page", UPLOAD));
    }
    if text.first() == Some(&b'<') {
        return Some(foreign("an XML document", UPLOAD));
    }
    let json_array = text.first() == Some(&b'[') && matches!(text[1..].trim_ascii().first(), Some(b'{' | b'"'));
    if text.first() == Some(&b'{') || json_array {
        return Some(foreign("a JSON document", UPLOAD));
    }
    if starts_with(text, b"SOLID ") || text.eq_ignore_ascii_case(b"solid") {
        return Some(foreign("an STL model", POST));
    }
    binary(line)
}

/// By its mark, or before there was one, by the sum of its head.
fn is_tar(line: &[u8]) -> bool {
    let (at, mark) = TAR_MARK;
    if line.get(at..).is_some_and(|rest| rest.starts_with(mark)) {
        return true;
    }
    let Some(head) = line.get(..TAR_HEAD_BYTES) else { return false };
    let digits = head[TAR_SUM].iter().copied().filter(u8::is_ascii_digit);
    let stated = digits.fold(0, |sum, digit| 8 * sum + u32::from(digit - b'0'));
    let sum = |bytes: &[u8]| bytes.iter().copied().map(u32::from).sum::<u32>();
    let blanks = TAR_SUM.len() as u32 * u32::from(b' ');
    stated > 0 && head.contains(&0) && stated == sum(head) - sum(&head[TAR_SUM]) + blanks
}

/// Characters of two or four bytes: zeros in all places but those of one remainder.
fn wide_text(line: &[u8]) -> Option<Foreign> {
    let fits = |width: usize, place: usize| {
        line.len() >= 2
            && line.len() + 1 >= width
            && line.iter().enumerate().all(|(at, &byte)| (byte == 0) == (at % width != place))
            && line.iter().any(|&byte| byte != 0)
    };
    if fits(4, 0) || fits(4, 3) {
        return Some(UTF_32);
    }
    (fits(2, 0) || fits(2, 1)).then_some(UTF_16)
}

/// Much that is no text. Zeros at the ends of a line are the leader of a punched tape.
pub(crate) fn binary(line: &[u8]) -> Option<Foreign> {
    let start = line.iter().position(|&byte| byte != 0)?;
    let end = line.iter().rposition(|&byte| byte != 0)?;
    let line = &line[start..=end];
    let no_text: usize = line.utf8_chunks().map(|chunk| chunk.invalid().len()).sum();
    let control = line.iter().filter(|byte| byte.is_ascii_control() && **byte != b'\t').count();
    let found = no_text + control;
    (found >= FEWEST_BINARY_BYTES && found * BINARY_SHARE >= line.len()).then_some(BINARY)
}

fn starts_with(text: &[u8], start: &[u8]) -> bool {
    text.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
}

/// Programs of other controls.
fn controls(line: &[u8]) -> Option<Foreign> {
    let text = line.trim_ascii();
    if starts_with(text, b"%_N_") || starts_with(text, b";$PATH=") {
        return Some(SIEMENS);
    }
    if text.is_empty() {
        return None;
    }
    let block = without_number(text);
    if is_heidenhain(block, text[0].is_ascii_digit()) {
        return Some(HEIDENHAIN);
    }
    // A name and G70 or G71 behind the per cent sign, and an asterisk at the end, open a HEIDENHAIN program in ISO.
    if text.first() == Some(&b'%') && text.last() == Some(&b'*') {
        return Some(HEIDENHAIN);
    }
    if is_siemens(block) {
        return Some(SIEMENS);
    }
    // Printed programs begin with the head of their table of units.
    if starts_with(text, b"MAZATROL") || starts_with(text, b"UNo.") {
        return Some(foreign("a program for a MAZATROL control", POST));
    }
    let is_cl_data = [&b"PARTNO"[..], b"PPRINT", b"LOADTL/", b"FEDRAT/", b"CUTTER/", b"GOTO/", b"SPINDL/"];
    is_cl_data
        .iter()
        .any(|word| starts_with(text, word))
        .then_some(foreign("cutter location data (APT) of a CAM system", POST))
}

/// A block without its block delete and its number, with or without `N`.
fn without_number(text: &[u8]) -> &[u8] {
    let text = text.strip_prefix(b"/").unwrap_or(text).trim_ascii_start();
    let number = text.strip_prefix(b"N").or_else(|| text.strip_prefix(b"n")).unwrap_or(text).trim_ascii_start();
    let digits = number.iter().take_while(|byte| byte.is_ascii_digit()).count();
    if digits == 0 { text } else { number[digits..].trim_ascii_start() }
}

/// The words of a block outside comments and strings: runs of letters, digits and underscores that begin with a letter, each
/// with the offset behind it.
fn words(block: &[u8]) -> impl Iterator<Item = (&[u8], usize)> {
    let code = block.split(|byte| matches!(byte, b';' | b'(')).next().unwrap_or_default();
    let mut at = 0;
    core::iter::from_fn(move || {
        while at < code.len() && !code[at].is_ascii_alphabetic() {
            // The names of macro variables are no words.
            at += if code[at] == b'#' {
                code[at..].iter().position(|byte| *byte == b'=').unwrap_or(code.len()) + 1
            } else {
                1
            };
        }
        let rest = code.get(at..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_').count();
        at += length;
        Some((&rest[..length], at))
    })
}

/// Words that programs for SINUMERIK have before axes, and others in their comments.
const SIEMENS_FRAMES: [&[u8]; 10] =
    [b"TRANS", b"ATRANS", b"ROT", b"AROT", b"ROTS", b"AROTS", b"MIRROR", b"AMIRROR", b"SCALE", b"ASCALE"];

/// Words that only programs for SINUMERIK have.
const SIEMENS_WORDS: [&[u8]; 32] = [
    b"SUPA",
    b"DIAMON",
    b"DIAMOF",
    b"DIAM90",
    b"CFTCP",
    b"CFIN",
    b"FFWON",
    b"FFWOF",
    b"BRISK",
    b"BRISKA",
    b"COMPCAD",
    b"COMPCURV",
    b"COMPOF",
    b"COMPON",
    b"TRAORI",
    b"TRAFOOF",
    b"TRANSMIT",
    b"TRACYL",
    b"ORIWKS",
    b"ORIMKS",
    b"ORIAXES",
    b"STOPRE",
    b"MCALL",
    b"EXTERN",
    b"EXTCALL",
    b"SETMS",
    b"GOTOF",
    b"GOTOB",
    b"ENDLOOP",
    b"PRESETON",
    b"UPATH",
    b"WAITM",
];

/// Types of a `DEF`.
const SIEMENS_TYPES: [&[u8]; 7] = [b"REAL", b"INT", b"BOOL", b"CHAR", b"STRING", b"AXIS", b"FRAME"];

fn is_siemens(block: &[u8]) -> bool {
    if block.starts_with(b"$") && block.contains(&b'=') {
        return true;
    }
    let mut before: &[u8] = b"";
    for (word, at) in words(block) {
        let behind = block[at..].iter().copied().find(|byte| !matches!(byte, b' ' | b'\t'));
        let is = |name: &[u8]| word.eq_ignore_ascii_case(name);
        let numbered = |name: &[u8]| {
            starts_with(word, name) && word.len() > name.len() && word[name.len()..].iter().all(u8::is_ascii_digit)
        };
        let frame = SIEMENS_FRAMES.iter().any(|name| before.eq_ignore_ascii_case(name));
        let named = SIEMENS_WORDS.iter().any(|name| is(name))
            || frame && is_axis_word(word, behind)
            || numbered(b"CYCLE")
            || (numbered(b"POCKET") || numbered(b"HOLES") || numbered(b"SLOT")) && behind == Some(b'(')
            || (is(b"MSG") || is(b"WORKPIECE") || is(b"LONGHOLE")) && behind == Some(b'(')
            || before.eq_ignore_ascii_case(b"DEF") && SIEMENS_TYPES.iter().any(|kind| starts_with(word, kind));
        // X=R1, X=IC(5), CR=5, S1=1000, T="MILL", LIMS=3000: FANUC assigns to #i and LinuxCNC to #<name> only. X=5 may be a slip of
        // the pen, and x=y or `x1 = 5` is source code.
        let value = block[at..].trim_ascii_start().strip_prefix(b"=").unwrap_or_default().trim_ascii_start();
        let assigns = behind == Some(b'=')
            && is_siemens_address(word)
            && (word.len() > 1 || is(b"R") || is_siemens_value(value))
            && !is_source(block, word, at);
        if named || assigns && !is_prose(block) {
            return true;
        }
        before = word;
    }
    false
}

/// Whether a block has several words of letters alone, as a comment has: `T1 D=10. CR=0. FLAT END MILL`.
fn is_prose(block: &[u8]) -> bool {
    let is_plain = |&(word, at): &(&[u8], usize)| {
        let before = at.checked_sub(word.len() + 1).map(|before| block[before]);
        let is_name = before == Some(b'"') || matches!(block[at..].trim_ascii_start().first(), Some(b'(' | b'='));
        word.len() > 2 && word.iter().all(u8::is_ascii_alphabetic) && !is_name
    };
    words(block).filter(is_plain).count() > 1
}

/// Whether `word`, which ends at `at` and is assigned or compared, is a variable of source code: `int x1 = 5;`,
/// `if r1 == 5:`. Blocks are written in capitals or without blanks, or have codes before it.
fn is_source(block: &[u8], word: &[u8], at: usize) -> bool {
    let is_lower = |word: &[u8]| word.iter().all(|byte| !byte.is_ascii_uppercase());
    let is_plain = |word: &[u8]| word.iter().all(u8::is_ascii_alphabetic);
    let is_spaced = block[at..].starts_with(b" ") || block[at..].starts_with(b"==");
    let is_code = |(other, _): (&[u8], usize)| b"gmnst".contains(&other[0]) && matches!(other, [_, b'0'..=b'9', ..]);
    let first = words(block).next().map(|(first, _)| first).filter(|first| first.len() > 2 && is_plain(first));
    let is_declared = first.is_some_and(|first| first != word && is_lower(first)) && block.ends_with(b";");
    is_declared || is_lower(word) && is_spaced && !words(&block[..at - word.len()]).any(is_code)
}

/// `X10`, `Z-5`, `X=R1`
fn is_axis_word(word: &[u8], behind: Option<u8>) -> bool {
    let is_numbered = word.len() > 1 && word[1..].iter().all(u8::is_ascii_digit);
    is_numbered || word.len() == 1 && matches!(behind, Some(b'-' | b'+' | b'.' | b'='))
}

/// `R1`, `IC(5)`, `"MILL"`, `$AA_IW[X]`, `(R1+5)`, with a sign.
fn is_siemens_value(value: &[u8]) -> bool {
    let value = value.strip_prefix(b"-").unwrap_or(value);
    let calls: [&[u8]; 5] = [b"IC(", b"AC(", b"DC(", b"ACP(", b"ACN("];
    matches!(value, [b'R' | b'r', b'0'..=b'9', ..] | [b'"' | b'$' | b'(', ..])
        || calls.iter().any(|call| starts_with(value, call))
}

/// Addresses that take a value with `=`.
fn is_siemens_address(word: &[u8]) -> bool {
    let name = &word[..word.iter().take_while(|byte| byte.is_ascii_alphabetic()).count()];
    let only_digits = word[name.len()..].iter().all(u8::is_ascii_digit);
    let longer: [&[u8]; 10] = [b"CR", b"AR", b"RP", b"AP", b"LIMS", b"TURN", b"CHF", b"CHR", b"RND", b"SF"];
    only_digits && (name.len() == 1 || longer.iter().any(|longer| name.eq_ignore_ascii_case(longer)))
}

/// Beginnings of HEIDENHAIN blocks.
const HEIDENHAIN_BLOCKS: [&[u8]; 14] = [
    b"BEGIN PGM",
    b"END PGM",
    b"BLK FORM",
    b"TOOL CALL",
    b"TOOL DEF",
    b"CYCL DEF",
    b"CYCL CALL",
    b"CALL LBL",
    b"LBL ",
    b"CALL PGM",
    b"PLANE SPATIAL",
    b"PLANE RESET",
    b"APPR ",
    b"DEP L",
];

/// Whether there is a word such as `X+10`.
fn has_signed_word(block: &[u8]) -> bool {
    block.windows(2).any(|pair| pair[0].is_ascii_alphabetic() && pair[1] == b'+')
}

/// `is_numbered`: its number has no `N` before it.
fn is_heidenhain(block: &[u8], is_numbered: bool) -> bool {
    if HEIDENHAIN_BLOCKS.iter().any(|start| starts_with(block, start)) {
        return true;
    }
    let mut words = words(block).map(|(word, _)| word);
    let first = words.next().unwrap_or_default();
    // `L X+10 Y+5 R0 FMAX`, `CC X+0 Y+0`, `C X+5 Y+5 DR-`, `FN 0: Q1 = +5`
    let last = words.any(|word| {
        word.eq_ignore_ascii_case(b"FMAX") || word.eq_ignore_ascii_case(b"FAUTO") || word.eq_ignore_ascii_case(b"DR")
    });
    let is = |name: &[u8]| first.eq_ignore_ascii_case(name);
    let axis_behind = |length: usize| {
        let rest = block[length.min(block.len())..].trim_ascii_start();
        matches!(
            rest,
            [b'X' | b'Y' | b'Z' | b'I' | b'P', b'+' | b'-' | b'0'..=b'9' | b'X' | b'Y' | b'Z' | b'R' | b'A', ..]
        ) && rest.len() < block.len() - length + 1
            && block.get(length).is_some_and(|byte| *byte == b' ')
    };
    is(b"CC") && axis_behind(2)
        // `L X10` may be a slip of the pen.
        || is(b"L") && (last || axis_behind(1) && (is_numbered || has_signed_word(block)))
        || is(b"C") && last
        || is(b"FN") && block.contains(&b':')
}

#[cfg(test)]
mod tests {
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
            "",
        ] {
            assert_eq!(recognise(line.as_bytes(), true), None, "{line:?}");
        }
    }
}
