//! Stability lobes of milling and turning, and the spindle table they fill (docs/functions/adaptive-feed.md,
//! "Spindle table from stability lobes").

mod chart;
mod limit;
mod pockets;
mod robustness;
mod stable_speeds;
mod trace;

pub use chart::ChartPoint;
pub use limit::ChartLimit;
pub use pockets::{Pocket, PocketRequest};
pub use robustness::{StabilityRobustness, stability_robustness};
use serde::{Deserialize, Serialize};
pub use stable_speeds::{most_stable_speed, stable_speeds};
use std::f64::consts::{PI, TAU};
use thiserror::Error;

/// Most modes of one direction.
const MAX_MODES: usize = 32;
/// Most lobes.
const MAX_LOBES: u32 = 300;
/// Largest ratio of radial to tangential coefficient.
const MAX_RADIAL_RATIO: f64 = 10.0;

/// Below this radial immersion, as a fraction of the diameter, cutting is so much interrupted that the zeroth order,
/// which averages the cutting forces over the revolution, errs on the unsafe side.
pub const LOW_IMMERSION: f64 = 0.25;
/// By how much it errs there, at most, as a fraction of the limit.
pub const LOW_IMMERSION_ERROR: f64 = 0.15;

/// One mode of vibration of tool or workpiece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio ζ.
    pub damping_ratio: f64,
    /// Modal stiffness, N/mm.
    pub stiffness_n_per_mm: f64,
}

/// Milling: transfer functions in X (feed direction) and Y, immersion, cutting coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct MillingModel {
    /// Modes in the feed direction; may be empty.
    pub modes_x: Vec<Mode>,
    /// Modes across; may be empty when the others are not.
    pub modes_y: Vec<Mode>,
    /// Cutting edges z.
    pub edges: u32,
    /// Entry angle, rad from Y+ in the direction of rotation, 0..π.
    pub entry_rad: f64,
    /// Exit angle, rad, above the entry angle, to π.
    pub exit_rad: f64,
    /// Tangential cutting coefficient K_t, N/mm².
    pub tangential_n_per_mm2: f64,
    /// Radial over tangential coefficient K_r.
    pub radial_ratio: f64,
}

/// Turning: one direction normal to the cut surface.
#[derive(Debug, Clone, PartialEq)]
pub struct TurningModel {
    /// Modes normal to the cut surface.
    pub modes: Vec<Mode>,
    /// Specific cutting coefficient K_s, N/mm².
    pub specific_n_per_mm2: f64,
}

/// Modal or cutting data from which no lobes follow.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LobeError {
    /// A value that is impossible.
    #[error("{field}: {value} is not between {least} and {most}")]
    Value {
        /// Path of the field, such as `modes_x[0].damping_ratio`.
        field: String,
        /// Its value.
        value: f64,
        /// Smallest possible value.
        least: f64,
        /// Largest possible value.
        most: f64,
    },
    /// The speeds asked for lie on lobes of too high an order.
    #[error("{lowest_rev_per_min} rev/min lies on lobe {lobe}, at most {limit} are computed: start at a higher speed")]
    TooManyLobes {
        /// Lowest speed asked for.
        lowest_rev_per_min: f64,
        /// Its lobe.
        lobe: u32,
        /// Most lobes.
        limit: u32,
    },
    /// All speeds of the first or last band are closer to the end of the range than speeds are sure.
    #[error(
        "between {above_rev_per_min} and {up_to_rev_per_min} rev/min no speed is surely inside the range when speeds may be off by \
         {speed_tolerance} of themselves: ask for fewer bands or a wider range"
    )]
    BandTooNarrow {
        /// Start of the band.
        above_rev_per_min: f64,
        /// End of the band.
        up_to_rev_per_min: f64,
        /// How far speeds may be off, as a fraction.
        speed_tolerance: f64,
    },
    /// No pocket of a band is deep enough.
    #[error(
        "between {above_rev_per_min} and {up_to_rev_per_min} rev/min at most {stable_mm} mm are stable with the margin of {margin}, \
         {required_mm} mm are required: cut less deep or leave the band out"
    )]
    TooDeep {
        /// Start of the band.
        above_rev_per_min: f64,
        /// End of the band.
        up_to_rev_per_min: f64,
        /// Stable depth or width of its best pocket, margin taken off.
        stable_mm: f64,
        /// Depth or width asked for.
        required_mm: f64,
        /// Margin.
        margin: f64,
    },
}

/// Everything impossible that was found, field by field.
#[derive(Debug, Default)]
struct Check(Vec<LobeError>);

impl Check {
    /// The value is a number in the closed interval.
    fn within(&mut self, field: impl Into<String>, value: f64, least: f64, most: f64) {
        if !(value >= least && value <= most) {
            self.0.push(LobeError::Value { field: field.into(), value, least, most });
        }
    }

    fn modes(&mut self, field: &str, modes: &[Mode], least: usize) {
        self.within(field, modes.len() as f64, least as f64, MAX_MODES as f64);
        for (index, mode) in modes.iter().take(MAX_MODES).enumerate() {
            self.within(format!("{field}[{index}].frequency_hz"), mode.frequency_hz, 1.0, 1e5);
            self.within(format!("{field}[{index}].damping_ratio"), mode.damping_ratio, 1e-5, 0.7);
            self.within(format!("{field}[{index}].stiffness_n_per_mm"), mode.stiffness_n_per_mm, 1e-3, 1e12);
        }
    }

    /// A cutting coefficient, N/mm².
    fn coefficient(&mut self, field: &str, value: f64) {
        self.within(field, value, 1.0, 1e6);
    }

    /// The first of what was found.
    fn finish(self) -> Result<(), LobeError> {
        self.0.into_iter().next().map_or(Ok(()), Err)
    }
}

/// Everything that is impossible in modal and cutting data that is kept for later, field by field: lists may be empty
/// and coefficients absent.
pub fn dynamics_problems(
    modes: &[(&'static str, &[Mode])],
    coefficients_n_per_mm2: &[(&'static str, Option<f64>)],
    radial_ratio: Option<f64>,
) -> Vec<LobeError> {
    let mut check = Check::default();
    for (field, modes) in modes {
        check.modes(field, modes, 0);
    }
    for (field, value) in coefficients_n_per_mm2 {
        if let Some(value) = value {
            check.coefficient(field, *value);
        }
    }
    if let Some(ratio) = radial_ratio {
        check.within("radial_ratio", ratio, 0.0, MAX_RADIAL_RATIO);
    }
    check.0
}

/// Complex number (real, imaginary).
type Complex = (f64, f64);

fn mul(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn div(a: Complex, b: Complex) -> Complex {
    let norm = b.0 * b.0 + b.1 * b.1;
    ((a.0 * b.0 + a.1 * b.1) / norm, (a.1 * b.0 - a.0 * b.1) / norm)
}

fn sqrt(a: Complex) -> Complex {
    let magnitude = libm::hypot(a.0, a.1);
    let real = (0.5 * (magnitude + a.0)).max(0.0).sqrt();
    let imaginary = (0.5 * (magnitude - a.0)).max(0.0).sqrt();
    (real, if a.1 < 0.0 { -imaginary } else { imaginary })
}

/// Receptance G in mm/N at a frequency: Σ (1/k)/(1 − r² + 2iζr), r = f/f_n.
fn receptance(modes: &[Mode], frequency_hz: f64) -> Complex {
    modes.iter().fold((0.0, 0.0), |sum, mode| {
        let ratio = frequency_hz / mode.frequency_hz;
        let denominator = (1.0 - ratio * ratio, 2.0 * mode.damping_ratio * ratio);
        let term = div((1.0 / mode.stiffness_n_per_mm, 0.0), denominator);
        (sum.0 + term.0, sum.1 + term.1)
    })
}

/// A point of the stability limit before it is spread over the lobes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobePoint {
    /// Chatter frequency ω_c/2π, Hz.
    pub frequency_hz: f64,
    /// Limiting depth a_lim (milling) or width b_lim (turning), mm.
    pub limit_mm: f64,
    /// Phase ε between two waves on the surface, rad, in 0..2π.
    pub phase_rad: f64,
}

impl MillingModel {
    /// Directional coefficients α_xx, α_xy, α_yx, α_yy (Altintas and Budak 1995).
    pub fn directional_coefficients(&self) -> [f64; 4] {
        let k_r = self.radial_ratio;
        let at = |angle: f64| {
            let (sin, cos) = (libm::sin(2.0 * angle), libm::cos(2.0 * angle));
            [
                0.5 * (cos - 2.0 * k_r * angle + k_r * sin),
                0.5 * (-sin - 2.0 * angle + k_r * cos),
                0.5 * (-sin + 2.0 * angle + k_r * cos),
                0.5 * (-cos - 2.0 * k_r * angle - k_r * sin),
            ]
        };
        let (entry, exit) = (at(self.entry_rad), at(self.exit_rad));
        std::array::from_fn(|index| exit[index] - entry[index])
    }

    /// Limits at a chatter frequency, one for each eigenvalue with a positive depth.
    ///
    /// a₀Λ² + a₁Λ + 1 = 0; a_lim = −(2π Re Λ/(z K_t))·(1 + κ²), κ = Im Λ/Re Λ; ε = π − 2 atan κ.
    pub fn limits_at(&self, frequency_hz: f64) -> [Option<LobePoint>; 2] {
        self.limits_with(self.directional_coefficients(), frequency_hz)
    }

    /// The same with directional coefficients that are known already.
    fn limits_with(&self, [xx, xy, yx, yy]: [f64; 4], frequency_hz: f64) -> [Option<LobePoint>; 2] {
        let (g_x, g_y) = (receptance(&self.modes_x, frequency_hz), receptance(&self.modes_y, frequency_hz));
        let determinant = xx * yy - xy * yx;
        let product = mul(g_x, g_y);
        let a0 = (product.0 * determinant, product.1 * determinant);
        let a1 = (xx * g_x.0 + yy * g_y.0, xx * g_x.1 + yy * g_y.1);
        let square = mul(a1, a1);
        let root = sqrt((square.0 - 4.0 * a0.0, square.1 - 4.0 * a0.1));
        // Λ = 2/(−a₁ ∓ √(a₁² − 4a₀)): this form stays valid when a₀ vanishes, as with one flexible direction.
        let scale = libm::hypot(a1.0, a1.1) + libm::hypot(root.0, root.1);
        [1.0, -1.0].map(|sign| {
            let denominator = (-a1.0 - sign * root.0, -a1.1 - sign * root.1);
            if libm::hypot(denominator.0, denominator.1) <= 1e-12 * scale {
                return None;
            }
            let (real, imaginary) = div((2.0, 0.0), denominator);
            let kappa = imaginary / real;
            let limit_mm = -TAU * real / (f64::from(self.edges) * self.tangential_n_per_mm2) * (1.0 + kappa * kappa);
            (limit_mm > 0.0 && limit_mm.is_finite()).then(|| LobePoint {
                frequency_hz,
                limit_mm,
                phase_rad: PI - 2.0 * libm::atan(kappa),
            })
        })
    }

    /// Everything that is impossible, field by field.
    pub fn problems(&self) -> Vec<LobeError> {
        let mut check = Check::default();
        check.modes("modes_x", &self.modes_x, 0);
        check.modes("modes_y", &self.modes_y, usize::from(self.modes_x.is_empty()));
        check.within("edge_count", f64::from(self.edges), 1.0, 1000.0);
        check.within("entry_rad", self.entry_rad, 0.0, PI);
        check.within("exit_rad", self.exit_rad, self.entry_rad + 1e-6, PI);
        check.coefficient("tangential_n_per_mm2", self.tangential_n_per_mm2);
        check.within("radial_ratio", self.radial_ratio, 0.0, MAX_RADIAL_RATIO);
        check.0
    }

    /// Radial depth of cut over the diameter of the tool: (cos φ_entry − cos φ_exit)/2, 1 in full slotting.
    pub fn radial_immersion(&self) -> f64 {
        0.5 * (libm::cos(self.entry_rad) - libm::cos(self.exit_rad))
    }

    /// Limits over all chatter frequencies.
    ///
    /// # Errors
    /// [`LobeError::Value`] for modal or cutting data that is impossible.
    pub fn lobes(&self) -> Result<Lobes, LobeError> {
        Check(self.problems()).finish()?;
        let coefficients = self.directional_coefficients();
        Ok(Lobes::trace(Model::Milling(self.clone(), coefficients)))
    }
}

/// Limiting width of turning whatever the speed, mm: b_lim = −1/(2 K_s Re G_min).
pub fn limiting_width_mm(specific_n_per_mm2: f64, least_real_mm_per_n: f64) -> f64 {
    -1.0 / (2.0 * specific_n_per_mm2 * least_real_mm_per_n)
}

impl TurningModel {
    /// Limit at a chatter frequency, where Re G < 0.
    ///
    /// 1 + K_s b (1 − e^(−iε)) G = 0 has b = −1/(2 K_s Re G) and ε = 3π + 2 atan2(Im G, Re G).
    pub fn limit_at(&self, frequency_hz: f64) -> Option<LobePoint> {
        let (real, imaginary) = receptance(&self.modes, frequency_hz);
        (real < 0.0).then(|| LobePoint {
            frequency_hz,
            limit_mm: limiting_width_mm(self.specific_n_per_mm2, real),
            phase_rad: 3.0 * PI + 2.0 * libm::atan2(imaginary, real),
        })
    }

    /// Everything that is impossible, field by field.
    pub fn problems(&self) -> Vec<LobeError> {
        let mut check = Check::default();
        check.modes("modes", &self.modes, 1);
        check.coefficient("specific_n_per_mm2", self.specific_n_per_mm2);
        check.0
    }

    /// Limits over all chatter frequencies.
    ///
    /// # Errors
    /// [`LobeError::Value`] for modal or cutting data that is impossible.
    pub fn lobes(&self) -> Result<Lobes, LobeError> {
        Check(self.problems()).finish()?;
        Ok(Lobes::trace(Model::Turning(self.clone())))
    }
}

/// What lobes are traced of.
#[derive(Debug, Clone, PartialEq)]
enum Model {
    /// With its directional coefficients.
    Milling(MillingModel, [f64; 4]),
    Turning(TurningModel),
}

impl Model {
    fn limits_at(&self, frequency_hz: f64) -> [Option<LobePoint>; 2] {
        match self {
            Self::Milling(model, coefficients) => model.limits_with(*coefficients, frequency_hz),
            Self::Turning(model) => [model.limit_at(frequency_hz), None],
        }
    }

    fn modes(&self) -> impl Iterator<Item = &Mode> {
        let [first, second]: [&[Mode]; 2] = match self {
            Self::Milling(model, _) => [&model.modes_x, &model.modes_y],
            Self::Turning(model) => [&model.modes, &[]],
        };
        first.iter().chain(second)
    }

    /// Cutting edges that follow each other; turning has one.
    fn edges(&self) -> f64 {
        match self {
            Self::Milling(model, _) => f64::from(model.edges),
            Self::Turning(_) => 1.0,
        }
    }
}

/// Stability limit over the chatter frequency, in branches that are continuous, fine enough to find the exact limit
/// from.
#[derive(Debug, Clone, PartialEq)]
pub struct Lobes {
    model: Model,
    branches: Vec<trace::Branch>,
    /// Where a branch has a least limit, and its ends.
    lows: Vec<LobePoint>,
}

impl Lobes {
    /// The limit over the chatter frequency, branch by branch.
    pub fn branches(&self) -> impl Iterator<Item = &[LobePoint]> {
        self.branches.iter().map(|branch| &*branch.points)
    }

    /// Smallest limit of all speeds, mm: below it nothing chatters. `None` when nothing ever does.
    pub fn least_limit_mm(&self) -> Option<f64> {
        self.lows.iter().map(|point| point.limit_mm).reduce(f64::min)
    }

    /// Spindle speed in rev/min of a point on lobe k: S = 60·ω_c/(z·(ε + 2πk)).
    pub fn spindle_rev_per_min(&self, point: &LobePoint, lobe: u32) -> f64 {
        60.0 * TAU * point.frequency_hz / (self.model.edges() * (point.phase_rad + TAU * f64::from(lobe)))
    }
}

#[cfg(test)]
mod tests;
