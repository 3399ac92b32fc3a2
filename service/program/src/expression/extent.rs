//! How far values reach in a line, by their form alone: the lexer cuts a line into tokens without knowing any parameter.

use super::operator::operator_at;
use super::rules;

fn skip_blanks(line: &[u8], mut at: usize) -> usize {
    while matches!(line.get(at), Some(b' ' | b'\t')) {
        at += 1;
    }
    at
}

fn skip_while(line: &[u8], mut at: usize, belongs: impl Fn(u8) -> bool) -> usize {
    while line.get(at).is_some_and(|&byte| belongs(byte)) {
        at += 1;
    }
    at
}

/// Where the brackets end that open at `at`; the end of the line where they do not.
fn brackets_end(line: &[u8], at: usize) -> usize {
    let mut depth = 0_u32;
    for (place, byte) in line.iter().enumerate().skip(at) {
        match byte {
            b'[' => depth += 1,
            b']' if depth <= 1 => return place + 1,
            b']' => depth -= 1,
            _ => {}
        }
    }
    line.len()
}

/// The `[` of a function whose name starts at `at`.
fn function_bracket(line: &[u8], at: usize) -> Option<usize> {
    let name = skip_while(line, at, |byte| byte.is_ascii_alphabetic());
    let bracket = skip_blanks(line, name);
    (name - at >= 2 && line.get(bracket) == Some(&b'[')).then_some(bracket)
}

/// Whether a value that is no plain number starts at `at`: a parameter, brackets or a function, with signs or without.
pub(crate) fn starts_value(line: &[u8], at: usize) -> bool {
    let at = skip_while(line, at, |byte| matches!(byte, b'+' | b'-' | b' ' | b'\t'));
    match line.get(at) {
        Some(b'#' | b'[') => true,
        Some(byte) if byte.is_ascii_alphabetic() => function_bracket(line, at).is_some(),
        _ => false,
    }
}

/// Where the value ends that starts at `at`; `at` itself where none does.
pub(crate) fn value_end(line: &[u8], start: usize) -> usize {
    let at = skip_while(line, start, |byte| matches!(byte, b'+' | b'-' | b' ' | b'\t' | b'#'));
    // A `#` belongs to the value even where nothing follows it.
    let nothing = if line[start..at].contains(&b'#') { at } else { start };
    match line.get(at) {
        None => at,
        Some(b'<') => skip_while(line, at, |byte| byte != b'>').saturating_add(1).min(line.len()),
        Some(b'[') => brackets_end(line, at),
        Some(b'0'..=b'9' | b'.') => crate::number::scan_operand(line, at).end,
        Some(byte) if byte.is_ascii_alphabetic() => {
            function_bracket(line, at).map_or(nothing, |bracket| function_end(line, at, bracket))
        }
        Some(_) => nothing,
    }
}

/// Where a function ends whose name starts at `at`, with its second argument.
fn function_end(line: &[u8], at: usize, bracket: usize) -> usize {
    let end = brackets_end(line, bracket);
    let slash = skip_blanks(line, end);
    let second = skip_blanks(line, slash + 1);
    let is_arc_tangent = line[at..bracket].to_ascii_uppercase().starts_with(b"ATAN");
    if is_arc_tangent && line.get(slash) == Some(&b'/') && line.get(second) == Some(&b'[') {
        brackets_end(line, second)
    } else {
        end
    }
}

/// Where values that operators join end; the first of them starts at `at`.
pub(crate) fn operation_end(line: &[u8], at: usize) -> usize {
    let mut end = value_end(line, at);
    loop {
        let operator = skip_blanks(line, end);
        let text = line.get(operator..).unwrap_or_default();
        let tables = [rules::LINUXCNC.operators, rules::FANUC.operators];
        let Some(operator_text) = tables.into_iter().find_map(|table| operator_at(table, text)) else { return end };
        let next = operator + operator_text.text.len();
        let behind = value_end(line, next);
        if behind == next {
            return end;
        }
        end = behind;
    }
}
