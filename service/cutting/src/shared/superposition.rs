//! Where a function superposes offsets on the path.

/// A barrier of a part of the path on which a function superposes offsets, blended in and out at its ends.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SuperpositionBarrier<R> {
    /// The part starts; how the function runs on it.
    Start(Box<R>),
    /// It ends.
    End,
}
