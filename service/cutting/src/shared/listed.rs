//! Reports of which a program may have very many.

/// The first reports in full, and how many there were.
#[derive(Clone, Debug)]
pub(crate) struct Listed<T> {
    pub(crate) first: Vec<T>,
    pub(crate) count: u64,
    /// Numbers in those that are kept.
    numbers: usize,
    /// Whether one was left out: so are all that follow.
    is_full: bool,
}

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Self { first: Vec::new(), count: 0, numbers: 0, is_full: false }
    }
}

impl<T> Listed<T> {
    /// Counts a report, and keeps it while there are fewer than `most`.
    pub(crate) fn push(&mut self, report: T, most: usize) {
        self.push_of_size(report, 0, most, 0);
    }

    /// Counts a report of so many numbers, and keeps it while there are fewer than `most` and no more than `most_numbers` in
    /// all.
    pub(crate) fn push_of_size(&mut self, report: T, numbers: usize, most: usize, most_numbers: usize) {
        self.count += 1;
        let fits = self.first.len() < most && self.numbers + numbers <= most_numbers;
        if fits && !self.is_full {
            self.numbers += numbers;
            self.first.push(report);
        } else {
            self.is_full = true;
        }
    }
}
