//! The bytes of programs at hand: pages that a host supplies where they are wanted, so that a program of any size can be
//! read at any place in bounded memory.

#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

/// A place in the programs of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Place {
    /// Which of them, 0 for the one that is run; the others follow in the order in which they are named.
    pub program: u32,
    /// Offset of a byte in it.
    pub offset: u64,
}

impl Place {
    /// How far apart two places of one program are, bytes; those of two programs are by what of the second is behind its
    /// start.
    #[must_use]
    pub const fn distance(self, from: Self) -> u64 {
        if self.program == from.program { self.offset.abs_diff(from.offset) } else { self.offset }
    }
}

/// Pages begin at multiples of this but where reading began, bytes.
const PAGE_BYTES: u64 = 64 * 1024;

/// Most pages that have been read and are kept, so that the bodies of loops and subprograms need not be supplied again.
const MAX_READ_PAGES: usize = 32;

/// The pages of all programs of a job. They are no part of a snapshot: what is missing is asked for again.
#[derive(Clone, Debug, Default)]
pub struct SourcePages {
    pages: Vec<Page>,
    /// Place in `pages` of the page read last.
    recent: usize,
    wanted: Place,
    /// Lengths of the programs whose end is known, bytes.
    lengths: Vec<(u32, u64)>,
    clock: u64,
}

/// Consecutive bytes of a program, within one multiple of [`PAGE_BYTES`].
#[derive(Clone, Debug)]
struct Page {
    start: Place,
    bytes: Vec<u8>,
    /// When it was read last, 0 for never.
    read_at: u64,
}

/// Bytes from a place on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window<'a> {
    /// At least one byte, but at the end of a program.
    pub(crate) bytes: &'a [u8],
    /// Whether the program ends behind them.
    pub(crate) ends: bool,
}

impl Page {
    fn end(&self) -> u64 {
        self.start.offset + self.bytes.len() as u64
    }

    fn holds(&self, place: Place) -> bool {
        self.start.program == place.program && (self.start.offset..self.end()).contains(&place.offset)
    }
}

impl SourcePages {
    /// No pages yet; the first bytes wanted are those from `place` on.
    #[must_use]
    pub fn from(place: Place) -> Self {
        Self { wanted: place, ..Self::default() }
    }

    /// Where the bytes begin that are to be supplied next.
    #[must_use]
    pub const fn wanted(&self) -> Place {
        self.wanted
    }

    /// Supplies bytes from [`SourcePages::wanted`] on, as many as are at hand; those behind them are wanted then.
    pub fn push(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let wanted = self.wanted;
            let space = (PAGE_BYTES - wanted.offset % PAGE_BYTES) as usize;
            let (now, later) = bytes.split_at(space.min(bytes.len()));
            let continued = |page: &&mut Page| page.start.program == wanted.program && page.end() == wanted.offset;
            match self.pages.iter_mut().find(continued) {
                Some(page) if !wanted.offset.is_multiple_of(PAGE_BYTES) => page.bytes.extend_from_slice(now),
                _ => self.add_page(wanted, now),
            }
            self.wanted.offset += now.len() as u64;
            bytes = later;
        }
    }

    /// Says that the program ends at [`SourcePages::wanted`].
    pub fn finish(&mut self) {
        let Place { program, offset } = self.wanted;
        self.lengths.retain(|(of, _)| *of != program);
        self.lengths.push((program, offset));
    }

    /// The bytes from `place` on that one page holds, or an empty window at the end of the program. Where there are none
    /// yet, they are wanted.
    #[inline]
    pub(crate) fn window(&mut self, place: Place) -> Option<Window<'_>> {
        if !self.pages.get(self.recent).is_some_and(|page| page.holds(place)) {
            match self.pages.iter().position(|page| page.holds(place)) {
                Some(found) => self.turn_to(found),
                None => return self.window_without_page(place),
            }
        }
        let page = &self.pages[self.recent];
        let bytes = &page.bytes[(place.offset - page.start.offset) as usize..];
        Some(Window { bytes, ends: self.lengths.contains(&(place.program, page.end())) })
    }

    #[cold]
    fn turn_to(&mut self, page: usize) {
        self.clock += 1;
        self.recent = page;
        self.pages[page].read_at = self.clock;
    }

    #[cold]
    fn window_without_page(&mut self, place: Place) -> Option<Window<'_>> {
        if self.lengths.contains(&(place.program, place.offset)) {
            return Some(Window { bytes: &[], ends: true });
        }
        let continues = |page: &Page| page.start.program == place.program && page.end() == place.offset;
        self.wanted = place;
        if !self.wanted.offset.is_multiple_of(PAGE_BYTES) && !self.pages.iter().any(continues) && !self.pages.is_empty()
        {
            self.wanted.offset -= place.offset % PAGE_BYTES;
        }
        None
    }

    /// Adds a page, in place of the one that was read longest ago where there are enough.
    fn add_page(&mut self, start: Place, bytes: &[u8]) {
        let read = self.pages.iter().enumerate().filter(|(index, page)| page.read_at > 0 && *index != self.recent);
        let count = read.clone().count();
        let oldest = read.min_by_key(|(_, page)| page.read_at).map(|(index, _)| index);
        match oldest.filter(|_| count >= MAX_READ_PAGES) {
            Some(oldest) => {
                let page = &mut self.pages[oldest];
                page.bytes.clear();
                page.bytes.extend_from_slice(bytes);
                (page.start, page.read_at) = (start, 0);
            }
            None => self.pages.push(Page { start, bytes: bytes.to_vec(), read_at: 0 }),
        }
    }
}
