//! Programs of other controls, told by a line that cannot be read.

use super::{Foreign, POST, foreign, starts_with};

const SIEMENS: Foreign = foreign("a program for a SIEMENS SINUMERIK control", POST);
const HEIDENHAIN: Foreign = foreign("a program for a HEIDENHAIN control", POST);

/// Programs of other controls.
pub(super) fn recognise(line: &[u8]) -> Option<Foreign> {
    let text = line.trim_ascii();
    let siemens: [&[u8]; 4] = [b"%_N_", b";$PATH=", b"%MPF", b"%SPF"];
    if siemens.iter().any(|start| starts_with(text, start)) {
        return Some(SIEMENS);
    }
    if is_fagor_head(text) {
        return Some(foreign("a program for a FAGOR control", POST));
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
    if is_siemens(block) || is_siemens_statement(block) {
        return Some(SIEMENS);
    }
    // The name of a file opens its program.
    if text.len() > 2 && text.starts_with(b"$") && text.ends_with(b"%") {
        return Some(foreign("a program for an OKUMA control", POST));
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

/// Most characters of the comment that a FAGOR program begins with.
const FAGOR_COMMENT: usize = 20;

/// `%COMMENT,MX`: a comment, and what may be done with the program (manual of the 8055, "Format of the program").
fn is_fagor_head(text: &[u8]) -> bool {
    let Some(head) = text.strip_prefix(b"%") else { return false };
    let mut parts = head.split(|byte| *byte == b',').map(<[u8]>::trim_ascii);
    let comment = parts.next().is_some_and(|comment| comment.len() <= FAGOR_COMMENT && !comment.contains(&b'('));
    let permissions = parts.next().is_some_and(|it| !it.is_empty() && it.iter().all(|byte| b"MXHO".contains(byte)));
    comment && permissions
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

/// Words behind the name of a subprogram for SINUMERIK.
const SIEMENS_PROPERTIES: [&[u8]; 5] = [b"SAVE", b"DISPLOF", b"DISPLON", b"SBLOF", b"ACTBLOCNO"];

/// `PROC NAME(REAL L)`, `PROC NAME SAVE`, `PROC L6`, `CALL "NAME"`, `REPEAT LABEL P=3`.
fn is_siemens_statement(block: &[u8]) -> bool {
    let mut words = words(block);
    let Some((first, first_end)) = words.next() else { return false };
    let is = |name: &[u8]| block.starts_with(first) && first.eq_ignore_ascii_case(name);
    if is(b"CALL") {
        return block[first_end..].trim_ascii_start().starts_with(b"\"");
    }
    let is_repeat = is(b"REPEAT") || is(b"REPEATB");
    if !is_repeat && !is(b"PROC") {
        return false;
    }
    // Its name is the next thing.
    let Some((name, end)) = words.next() else { return false };
    if !block[first_end..].trim_ascii_start().starts_with(name) || name.len() < 2 {
        return false;
    }
    let behind = block[end..].trim_ascii_start();
    if is_repeat {
        let count = words.last().filter(|(word, _)| word.eq_ignore_ascii_case(b"P"));
        return count.is_some_and(|(_, end)| block[end..].trim_ascii_start().starts_with(b"="));
    }
    let is_coded = name.iter().any(|byte| byte.is_ascii_digit() || *byte == b'_');
    let has_property =
        words.next().is_some_and(|(word, _)| SIEMENS_PROPERTIES.iter().any(|it| word.eq_ignore_ascii_case(it)));
    behind.starts_with(b"(") && behind.ends_with(b")") && !behind.starts_with(b"()")
        || has_property
        || is_coded && behind.is_empty()
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
