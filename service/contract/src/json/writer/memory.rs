//! Texts that were written before: in a series of like messages, most of the messages within them are again what they were.

/// How many texts are kept of each kind of message: of positions, the two ends of a move and an offset.
const KEPT: usize = 3;

/// Bytes of the largest encoding that is kept, so that what is kept is small whatever is written.
const MAX_BYTES: usize = 256;

/// The messages within messages that were written last, without spaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// By the place of the kind's row; each the latest first.
    kinds: Vec<Vec<Written>>,
}

/// A message that was written.
#[derive(Clone, Debug)]
struct Written {
    bytes: Vec<u8>,
    text: Vec<u8>,
}

impl Memory {
    /// The text of a message with these bytes of the kind whose row is at `place`.
    pub(super) fn find(&mut self, place: usize, bytes: &[u8]) -> Option<&[u8]> {
        let kind = self.kinds.get_mut(place)?;
        let found = kind.iter().position(|written| written.bytes == bytes)?;
        kind[..=found].rotate_right(1);
        Some(&kind[0].text)
    }

    /// Keeps a text in place of the one that was not asked for longest.
    pub(super) fn keep(&mut self, place: usize, bytes: &[u8], text: &[u8]) {
        if bytes.len() > MAX_BYTES {
            return;
        }
        if self.kinds.len() <= place {
            self.kinds.resize_with(place + 1, Vec::new);
        }
        let kind = &mut self.kinds[place];
        if kind.len() < KEPT {
            kind.push(Written { bytes: Vec::new(), text: Vec::new() });
        }
        kind.rotate_right(1);
        let written = &mut kind[0];
        written.bytes.clear();
        written.bytes.extend_from_slice(bytes);
        written.text.clear();
        written.text.extend_from_slice(text);
    }
}
