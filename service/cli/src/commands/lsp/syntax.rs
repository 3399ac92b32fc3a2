//! What follows from the text alone: colours of words, folds, and the list of what a program has.

use feedwave_program::lexer::{Lexer, TokenKind};
use feedwave_program::{Outline, StretchKind, Vocabulary, WordRole};
use lsp_types::{
    DocumentSymbol, FoldingRange, FoldingRangeKind, SemanticToken, SemanticTokenModifier, SemanticTokenType,
    SemanticTokensLegend, SymbolKind,
};

use super::document::Document;

/// Most words that are coloured in one answer.
const MAX_TOKENS: usize = 200_000;

/// Kinds of words; their places are what answers contain.
const TYPES: [SemanticTokenType; 11] = [
    SemanticTokenType::KEYWORD,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::MACRO,
    SemanticTokenType::COMMENT,
    SemanticTokenType::NUMBER,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::PROPERTY,
    SemanticTokenType::PARAMETER,
    SemanticTokenType::DECORATOR,
    SemanticTokenType::OPERATOR,
    SemanticTokenType::STRING,
];

/// The names of the kinds.
pub(super) fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend { token_types: TYPES.to_vec(), token_modifiers: Vec::<SemanticTokenModifier>::new() }
}

fn kind_of(token: &feedwave_program::lexer::Token, vocabulary: &Vocabulary) -> Option<SemanticTokenType> {
    Some(match token.kind {
        TokenKind::Word => match vocabulary.role(token) {
            WordRole::Motion | WordRole::Code => SemanticTokenType::KEYWORD,
            WordRole::Function => SemanticTokenType::MACRO,
            WordRole::Call => SemanticTokenType::FUNCTION,
            WordRole::Label => SemanticTokenType::DECORATOR,
            WordRole::Axis | WordRole::Centre => SemanticTokenType::PROPERTY,
            WordRole::Feed | WordRole::Speed | WordRole::Tool => SemanticTokenType::NUMBER,
            WordRole::Parameter => SemanticTokenType::PARAMETER,
            WordRole::UnknownCode | WordRole::Unknown => return None,
        },
        TokenKind::Comment | TokenKind::UnclosedComment => SemanticTokenType::COMMENT,
        TokenKind::Computed | TokenKind::Assignment => SemanticTokenType::VARIABLE,
        TokenKind::Expression | TokenKind::Statement => SemanticTokenType::FUNCTION,
        TokenKind::Output => SemanticTokenType::STRING,
        TokenKind::Percent | TokenKind::BlockDelete => SemanticTokenType::OPERATOR,
        TokenKind::Corner | TokenKind::Polar => SemanticTokenType::PARAMETER,
        _ => return None,
    })
}

/// The words of some lines, counted from 0, the end not among them.
pub(super) fn tokens(
    document: &Document,
    vocabulary: &Vocabulary,
    lines: std::ops::Range<usize>,
) -> Vec<SemanticToken> {
    let mut tokens = Vec::new();
    let (mut last_line, mut last_start) = (0, 0);
    for line in lines.start..lines.end.min(document.line_count()) {
        for token in Lexer::new(document.counted_line(line).as_bytes()) {
            let Some(kind) = kind_of(&token, vocabulary) else { continue };
            let place = document.range(line as u32 + 1, token.start + 1, token.end - token.start);
            let (line, start) = (place.start.line, place.start.character);
            let kind = TYPES.iter().position(|known| *known == kind).unwrap_or_default();
            tokens.push(SemanticToken {
                delta_line: line - last_line,
                delta_start: if line == last_line { start - last_start } else { start },
                length: place.end.character - start,
                token_type: kind as u32,
                token_modifiers_bitset: 0,
            });
            (last_line, last_start) = (line, start);
            if tokens.len() == MAX_TOKENS {
                return tokens;
            }
        }
    }
    tokens
}

/// What can be folded.
pub(super) fn folds(outline: &Outline) -> Vec<FoldingRange> {
    let longer = outline.stretches.iter().filter(|stretch| stretch.last_line > stretch.first_line);
    let fold = |stretch: &feedwave_program::Stretch| FoldingRange {
        start_line: stretch.first_line - 1,
        start_character: None,
        end_line: stretch.last_line - 1,
        end_character: None,
        kind: (stretch.kind == StretchKind::Comment).then_some(FoldingRangeKind::Comment),
        collapsed_text: None,
    };
    longer.map(fold).collect()
}

/// Programs, subprograms and stretches with a machining function.
#[allow(deprecated, reason = "the type has a field that is deprecated and has no other constructor")]
pub(super) fn symbols(document: &Document, outline: &Outline) -> Vec<DocumentSymbol> {
    let symbol = |stretch: &feedwave_program::Stretch| {
        let kind = match stretch.kind {
            StretchKind::Program => SymbolKind::MODULE,
            StretchKind::Subprogram => SymbolKind::FUNCTION,
            StretchKind::Function => SymbolKind::EVENT,
            StretchKind::Block | StretchKind::Comment => return None,
        };
        let head = document.line_range(stretch.first_line - 1);
        let end = document.line_range(stretch.last_line - 1).end;
        Some(DocumentSymbol {
            name: stretch.name.clone(),
            detail: Some(document.counted_line(stretch.first_line as usize - 1).to_owned()),
            kind,
            tags: None,
            deprecated: None,
            range: lsp_types::Range { start: head.start, end },
            selection_range: head,
            children: None,
        })
    };
    outline.stretches.iter().filter_map(symbol).collect()
}
