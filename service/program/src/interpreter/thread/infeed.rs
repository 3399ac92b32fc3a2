//! How deep each pass of a threading cycle cuts.

/// Most passes of one cycle.
pub(super) const MAX_PASSES: u32 = 100;

/// Depths that differ by less than this, mm, are one pass: below any increment, far above rounding.
const SAME_DEPTH_MM: f64 = 1e-6;

/// The depth law of a threading cycle. Pass n cuts to `first · n^(1/degression)`, yet at least `least` deeper than
/// the pass before: every degression of 2 removes the same area of a V from pass to pass, 1 is the same infeed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Infeed {
    pub(super) first_mm: f64,
    pub(super) degression: f64,
    pub(super) least_mm: f64,
    /// Where the law ends.
    pub(super) rough_mm: f64,
    /// Depth of the passes after that.
    pub(super) full_mm: f64,
    pub(super) finishing_passes: u32,
}

/// One pass of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pass {
    /// Below the crest of the thread, mm on the radius.
    pub(super) depth_mm: f64,
    pub(super) finishing: bool,
}

impl Infeed {
    /// The passes in order, or `None` if they are more than [`MAX_PASSES`].
    pub(super) fn passes(&self) -> Option<Vec<Pass>> {
        let roughing = MAX_PASSES.checked_sub(self.finishing_passes)?;
        let mut passes = Vec::new();
        let mut depth_mm = 0.0;
        for pass in 1..=roughing {
            depth_mm = self.law(pass).max(depth_mm + self.least_mm);
            if depth_mm >= self.rough_mm - SAME_DEPTH_MM {
                passes.push(Pass { depth_mm: self.rough_mm, finishing: false });
                let last = Pass { depth_mm: self.full_mm, finishing: true };
                passes.extend((0..self.finishing_passes).map(|_| last));
                return Some(passes);
            }
            passes.push(Pass { depth_mm, finishing: false });
        }
        None
    }

    fn law(&self, pass: u32) -> f64 {
        let pass = f64::from(pass);
        let factor = match self.degression {
            1.0 => pass,
            2.0 => pass.sqrt(),
            degression => libm::pow(pass, 1.0 / degression),
        };
        self.first_mm * factor
    }

    /// A first depth with which the passes are not too many, mm, rounded up to micrometres.
    pub(super) fn sufficient_first_mm(&self) -> f64 {
        let one = Self { first_mm: 1.0, ..*self };
        let roughing = MAX_PASSES.saturating_sub(self.finishing_passes).max(1);
        (self.rough_mm / one.law(roughing) * 1_000.0).ceil() / 1_000.0
    }
}
