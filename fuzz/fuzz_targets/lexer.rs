//! Any bytes as one line: every byte is blank or in exactly one token, and numbers are numbers.

#![no_main]

use feedwave_program::lexer::{Lexer, TokenKind};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|line: &[u8]| {
    let mut covered = 0;
    for token in Lexer::new(line) {
        let (start, end) = (token.start as usize, token.end as usize);
        assert!(covered <= start && start < end && end <= line.len());
        assert!(line[covered..start].iter().all(|byte| matches!(byte, b' ' | b'\t')));
        if token.kind == TokenKind::Word {
            let value = token.number.value();
            assert!(token.letter.is_ascii_uppercase() && value.is_finite());
            assert!(value != 0.0 || value.is_sign_positive());
            // The reader agrees with the standard library on every number.
            let text: String = line[start + 1..end].iter().map(|&byte| char::from(byte)).collect();
            let text = text.replace([' ', '\t'], "");
            assert_eq!(text.parse::<f64>().map(|parsed| parsed + 0.0), Ok(value));
        }
        covered = end;
    }
    assert!(line[covered..].iter().all(|byte| matches!(byte, b' ' | b'\t')));
});
