//! Files that are no program of the language at all: recognised as a whole, so that they are one finding that says what they
//! are instead of one for every line.
//!
//! A line is examined when it is the first with anything in it, or cannot be read. So a file that can be read is never
//! taken for something else, and the marks need only be such that no program holds them where a line cannot be read.

mod controls;
#[cfg(test)]
mod tests;

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
    pub(crate) const XML: Self = foreign("an XML document", UPLOAD);
    pub(crate) const COMMENTS: Self = foreign("a file with nothing but comments", UPLOAD);
    pub(crate) const NUL: Self =
        foreign("a file of NUL bytes, as a transfer that broke off leaves it", "transfer it again");
}

const UTF_16: Foreign = foreign("text in UTF-16", AS_TEXT);
const UTF_32: Foreign = foreign("text in UTF-32", AS_TEXT);
pub(crate) const BINARY: Foreign =
    foreign("binary data, such as a program of a conversational control", "upload a program in G-code as plain text");

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
    by_start.or_else(|| controls::recognise(line))
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
        return Some(Foreign::XML);
    }
    let json_array = text.first() == Some(&b'[') && matches!(text[1..].trim_ascii().first(), Some(b'{' | b'"'));
    if text.first() == Some(&b'{') || json_array {
        return Some(foreign("a JSON document", UPLOAD));
    }
    if starts_with(text, b"SOLID ") || text.eq_ignore_ascii_case(b"solid") {
        return Some(foreign("an STL model", POST));
    }
    document(line).or_else(|| binary(line))
}

/// Codes of Gerber that stand between `%` and `*%`.
const GERBER: [&[u8]; 9] = [b"%FS", b"%MO", b"%AD", b"%AM", b"%LP", b"%TF", b"%TA", b"%IP", b"%OF"];

/// Headers of a mail whose value none of the language's lines has.
const MAIL: [&[u8]; 6] = [
    b"Received: from ",
    b"MIME-Version: ",
    b"Message-ID: <",
    b"Return-Path: <",
    b"Delivered-To: ",
    b"Content-Type: text/",
];

/// Texts that hold programs or drawings, told by one line of theirs.
fn document(line: &[u8]) -> Option<Foreign> {
    let text = line.trim_ascii();
    if text.starts_with(b"diff --git ") || is_hunk(text) {
        return Some(foreign("a list of differences (diff)", UPLOAD));
    }
    let is_sender = text.starts_with(b"From: ") || text.starts_with(b"From ");
    if is_sender && has_address(text) || MAIL.iter().any(|header| starts_with(text, header)) {
        return Some(foreign("a mail", UPLOAD));
    }
    let is_gerber = text.ends_with(b"*%") && GERBER.iter().any(|code| text.starts_with(code));
    is_gerber.then_some(foreign("a drawing of a circuit board (Gerber)", POST))
}

/// `@@ -1,7 +1,7 @@`
fn is_hunk(text: &[u8]) -> bool {
    let Some(rest) = text.strip_prefix(b"@@ -") else { return false };
    let place = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b',' | b' ' | b'+');
    let places = rest.iter().take_while(|byte| place(byte)).count();
    rest[..places].windows(2).any(|pair| pair == b" +") && rest[places..].starts_with(b"@@")
}

/// `name@host.domain`
fn has_address(text: &[u8]) -> bool {
    let mut words = text.split(|byte| matches!(byte, b' ' | b'<' | b'>'));
    words.any(|word| {
        let at = word.iter().position(|byte| *byte == b'@');
        at.is_some_and(|at| {
            at > 0 && word[at..].iter().skip(1).any(u8::is_ascii_alphabetic) && word[at..].contains(&b'.')
        })
    })
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
