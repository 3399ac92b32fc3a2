//! `proptest` with one seed for all: the same random cases in every clone and every run, by whatever starts the test.
//!
//! The crates of the workspace get this under the name `proptest`, so that no property test can do without. What fails is
//! found again by running the test again; no file remembers it. The variables of `proptest` apply:
//! `PROPTEST_RNG_SEED` takes other cases, `PROPTEST_CASES` another number of them.

pub use proptest_itself::*;

use test_runner::{Config, RngSeed};

/// Seed of the cases that a change is judged by.
pub const SEED: u64 = 20_261_121;

/// What tests bring in.
pub mod prelude {
    pub use proptest_itself::prelude::*;

    pub use crate::proptest;
}

/// A configuration with the seed of the project, unless it has one, and without memory of earlier failures.
#[must_use]
pub fn repeatable(config: Config) -> Config {
    let rng_seed = match config.rng_seed {
        RngSeed::Random => RngSeed::Fixed(SEED),
        fixed => fixed,
    };
    Config { rng_seed, failure_persistence: None, ..config }
}

/// Property tests, as the macro of this name in `proptest` takes them.
#[macro_export]
macro_rules! proptest {
    (#![proptest_config($config:expr)] $($tests:tt)*) => {
        $crate::__itself::proptest! { #![proptest_config($crate::repeatable($config))] $($tests)* }
    };
    ($($tests:tt)*) => {
        $crate::proptest! { #![proptest_config($crate::test_runner::Config::default())] $($tests)* }
    };
}

#[doc(hidden)]
pub use proptest_itself as __itself;

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn the_seed_is_that_of_the_project_or_the_one_asked_for() {
        let asked = std::env::var("PROPTEST_RNG_SEED").ok().and_then(|seed| seed.parse().ok());
        assert_eq!(repeatable(Config::default()).rng_seed, RngSeed::Fixed(asked.unwrap_or(SEED)));
        let own = Config { rng_seed: RngSeed::Fixed(7), ..Config::default() };
        assert_eq!(repeatable(own).rng_seed, RngSeed::Fixed(7));
        assert!(repeatable(Config::default()).failure_persistence.is_none());
    }

    static DRAWN: Mutex<Vec<u64>> = Mutex::new(Vec::new());

    proptest! {
        fn draw(value in 0_u64..) {
            DRAWN.lock().expect("no test panicked").push(value);
        }
    }

    #[test]
    fn every_run_draws_the_same_cases() {
        let drawn = [(), ()].map(|()| {
            draw();
            std::mem::take(&mut *DRAWN.lock().expect("no test panicked"))
        });
        assert!(!drawn[0].is_empty());
        assert_eq!(drawn[0], drawn[1]);
    }
}
