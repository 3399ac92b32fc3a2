//! The frames of a connection of HTTP/2 (RFC 9113, section 4.1) as far as they are complete: what they say is read elsewhere.

/// Bytes before the payload of a frame: three of length, its kind, its flags, four of its stream.
const HEAD_BYTES: usize = 9;

/// Kinds of frames.
mod kind {
    pub(super) const DATA: u8 = 0;
    pub(super) const HEADERS: u8 = 1;
    pub(super) const CONTINUATION: u8 = 9;
}

/// The flag of the last frame of a head.
const END_HEADERS: u8 = 4;

/// What was begun and is not complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partial {
    /// The head of a request: nothing else may come before its end.
    Head,
    /// The first frame after the preface, or any other but one of data.
    Frame,
    /// A frame of data: what comes behind it waits, also for other calls.
    Data,
}

/// Where in its frames a connection is.
#[derive(Debug, Default)]
pub(super) struct Frames {
    head: [u8; HEAD_BYTES],
    /// Bytes of the head of a frame that have come.
    head_bytes: usize,
    /// Bytes of its payload that have not.
    rest: usize,
    /// Whether the head of a request goes on with the next frame.
    is_head_open: bool,
    /// Whether any frame has been complete.
    has_begun: bool,
}

impl Frames {
    /// What is incomplete.
    pub(super) const fn partial(&self) -> Option<Partial> {
        let of_head = self.rest > 0 && matches!(self.head[3], kind::HEADERS | kind::CONTINUATION);
        if self.is_head_open || of_head {
            return Some(Partial::Head);
        }
        if self.rest > 0 && self.head[3] == kind::DATA && self.has_begun {
            return Some(Partial::Data);
        }
        if self.head_bytes > 0 || self.rest > 0 || !self.has_begun { Some(Partial::Frame) } else { None }
    }

    /// Takes what has come; whether there was a moment at which nothing was incomplete.
    pub(super) fn receive(&mut self, mut bytes: &[u8]) -> bool {
        let mut was_complete = false;
        while !bytes.is_empty() {
            if self.rest > 0 {
                let taken = self.rest.min(bytes.len());
                self.rest -= taken;
                bytes = &bytes[taken..];
            } else {
                let taken = (HEAD_BYTES - self.head_bytes).min(bytes.len());
                self.head[self.head_bytes..self.head_bytes + taken].copy_from_slice(&bytes[..taken]);
                self.head_bytes += taken;
                bytes = &bytes[taken..];
                if self.head_bytes < HEAD_BYTES {
                    break;
                }
                self.head_bytes = 0;
                let [high, middle, low, kind, flags, ..] = self.head;
                self.rest = usize::from(high) << 16 | usize::from(middle) << 8 | usize::from(low);
                if matches!(kind, kind::HEADERS | kind::CONTINUATION) {
                    self.is_head_open = flags & END_HEADERS == 0;
                }
            }
            self.has_begun |= self.rest == 0;
            was_complete |= self.partial().is_none();
        }
        was_complete
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn frame(kind: u8, flags: u8, length: usize) -> Vec<u8> {
        let mut bytes = (length as u32).to_be_bytes()[1..].to_vec();
        bytes.extend([kind, flags, 0, 0, 0, 1]);
        bytes.resize(bytes.len() + length, 0xff);
        bytes
    }

    proptest! {
        #[test]
        fn frames_end_where_they_end_however_they_are_cut(
            kinds in prop::collection::vec((0_u8..10, any::<u8>(), 0_usize..600), 1..12),
            cuts in prop::collection::vec(1_usize..400, 1..100),
        ) {
            let mut frames = Frames::default();
            let mut is_head_open = false;
            let mut cuts = cuts.into_iter().cycle();
            for (kind, flags, length) in kinds {
                if matches!(kind, kind::HEADERS | kind::CONTINUATION) {
                    is_head_open = flags & END_HEADERS == 0;
                }
                let bytes = frame(kind, flags, length);
                let mut rest = bytes.as_slice();
                while !rest.is_empty() {
                    let (piece, after) = rest.split_at(cuts.next().unwrap_or(1).min(rest.len()));
                    frames.receive(piece);
                    rest = after;
                }
                prop_assert_eq!(frames.partial(), is_head_open.then_some(Partial::Head));
            }
        }
    }
}
