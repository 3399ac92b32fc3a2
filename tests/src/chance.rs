//! What a test leaves to chance.

use proptest::SEED;

/// Numbers that differ from each other and are the same in every run: from the seed of the project, or from
/// `PROPTEST_RNG_SEED` as in the property tests.
#[derive(Debug)]
pub struct Chance {
    seed: u64,
    state: u64,
}

impl Chance {
    /// Its first number comes next.
    ///
    /// # Panics
    /// When the variable is no number.
    #[must_use]
    pub fn new() -> Self {
        let seed = std::env::var("PROPTEST_RNG_SEED").map_or(SEED, |seed| seed.parse().expect("a seed is a number"));
        Self { seed, state: seed }
    }

    /// The seed, for a failure to name.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// A number from 1 to `largest`.
    pub const fn up_to(&mut self, largest: u64) -> u64 {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        1 + (self.state >> 33) % largest
    }
}

impl Default for Chance {
    fn default() -> Self {
        Self::new()
    }
}
