//! The two rows of a limit, and what a pass over them finds and changes.

/// Steps of slacks and prices.
pub(super) type Steps = [f64; 2];

#[inline]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The two one-sided rows of a limit |value| ≤ bound: g(c) = ±value − bound ≤ 0, each with its slack and its price.
#[derive(Clone, Copy, Default)]
pub(super) struct Pair {
    /// g + slack.
    residual: [f64; 2],
    slack: [f64; 2],
    /// 1/slack.
    per_slack: [f64; 2],
    price: [f64; 2],
    /// Change of the slack along the present direction.
    change: [f64; 2],
    /// What the predictor's products miss, then the change of the price.
    correction: [f64; 2],
}

/// What a pass over all rows needs to renew them.
#[derive(Clone, Copy)]
pub(super) enum Renewal {
    /// First slacks and prices: the complementarity, and the least slack as a share of the limit.
    Start(f64, f64),
    /// After a step.
    Step(Steps),
}

/// What such a pass finds.
#[derive(Clone, Copy, Default)]
pub(super) struct Found {
    /// Largest residual, as a share of the row's scale.
    pub(super) residual: f64,
    /// Sum of the products of slack and price.
    pub(super) products: f64,
}

impl Pair {
    /// Renews a pair of rows ±value ≤ bound, and bounds its prices to keep products near their mean; its weights, and those times
    /// the residuals.
    #[inline]
    #[allow(clippy::needless_range_loop, reason = "two rows, side by side")]
    pub(super) fn renew(
        &mut self,
        value: f64,
        bound: f64,
        per_scale: f64,
        renewal: Renewal,
        prices: [f64; 2],
        found: &mut Found,
    ) -> [[f64; 2]; 2] {
        let g = [value - bound, -value - bound];
        let (mut weights, mut pulls) = ([0.0; 2], [0.0; 2]);
        match renewal {
            Renewal::Start(complementarity, least) => {
                for k in 0..2 {
                    self.slack[k] = larger(-g[k], least / per_scale);
                    self.price[k] = complementarity / self.slack[k];
                }
            }
            Renewal::Step([step, price_step]) => {
                for k in 0..2 {
                    self.slack[k] = larger(self.slack[k] + step * self.change[k], -g[k]);
                    self.price[k] += price_step * self.correction[k];
                }
            }
        }
        for k in 0..2 {
            self.per_slack[k] = 1.0 / self.slack[k];
            self.residual[k] = g[k] + self.slack[k];
            found.products += self.slack[k] * self.price[k];
            let [least, most] = prices.map(|product| product * self.per_slack[k]);
            let price = larger(self.price[k], least);
            self.price[k] = if price < most { price } else { most };
            weights[k] = self.price[k] * self.per_slack[k];
            pulls[k] = weights[k] * self.residual[k];
        }
        found.residual = larger(found.residual, larger(self.residual[0], self.residual[1]) * per_scale);
        [weights, pulls]
    }

    /// How far the predictor gets where the rows change by `changes`.
    #[inline]
    pub(super) fn predict(
        &mut self,
        changes: [f64; 2],
        most: &mut [[f64; 2]; 2],
        sums: &mut [[f64; 2]; 4],
    ) -> [[f64; 2]; 2] {
        let mut corrections = [0.0; 2];
        for k in 0..2 {
            let grows = -self.residual[k] - changes[k];
            let shrinks = -grows * self.per_slack[k];
            most[0][k] = larger(most[0][k], shrinks);
            most[1][k] = larger(most[1][k], 1.0 - shrinks);
            let price = self.price[k] * (shrinks - 1.0);
            self.correction[k] = grows * price;
            sums[0][k] += self.slack[k] * self.price[k];
            sums[1][k] += grows * self.price[k];
            sums[2][k] += self.slack[k] * price;
            sums[3][k] += self.correction[k];
            corrections[k] = self.correction[k] * self.per_slack[k];
        }
        [self.per_slack, corrections]
    }

    /// The changes of slacks and prices where the rows change by `changes`.
    #[inline]
    pub(super) fn correct(
        &mut self,
        changes: [f64; 2],
        [target, part]: [f64; 2],
        most: &mut [[f64; 2]; 2],
        sums: &mut [[f64; 2]; 3],
    ) {
        for k in 0..2 {
            let grows = -self.residual[k] - changes[k];
            let shrinks = -grows * self.per_slack[k];
            most[0][k] = larger(most[0][k], shrinks);
            let price = (target - part * self.correction[k]) * self.per_slack[k] - self.price[k] * (1.0 - shrinks);
            most[1][k] = larger(most[1][k], -price / self.price[k]);
            sums[0][k] += grows * self.price[k];
            sums[1][k] += self.slack[k] * price;
            sums[2][k] += grows * price;
            self.change[k] = grows;
            self.correction[k] = price;
        }
    }
}

/// The largest of what both rows of every pair ask for.
pub(super) fn largest(most: [[f64; 2]; 2]) -> [f64; 2] {
    most.map(|[a, b]| larger(a, b))
}
