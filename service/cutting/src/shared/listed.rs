//! Reports of which a program may have very many.

/// The first reports in full, and how many there were.
#[derive(Clone, Debug)]
pub(crate) struct Listed<T> {
    pub(crate) first: Vec<T>,
    pub(crate) count: u64,
}

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Self { first: Vec::new(), count: 0 }
    }
}

impl<T> Listed<T> {
    /// Counts a report, and keeps it while there are fewer than `most`.
    pub(crate) fn push(&mut self, report: T, most: usize) {
        self.count += 1;
        if self.first.len() < most {
            self.first.push(report);
        }
    }
}
