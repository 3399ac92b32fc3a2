//! A pair of sensors, and its form in a file.

use feedwave_monitoring::Quantity;
use serde::{Deserialize, Serialize};

/// Two equal sensors at 90°. Values are in the sensor's unit: mm, strain or mm/s².
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "InFile", into = "InFile")]
pub struct SensorPair {
    /// What they measure.
    pub quantity: Quantity,
    /// Reading at rest.
    pub stand_off: f64,
    /// Standard deviation of the noise.
    pub noise: f64,
    /// Chance of a wrong value per sample and pair.
    pub outlier_rate: f64,
    /// How far a wrong value is off: between half of this and all of it, to either side.
    pub outlier_size: f64,
    /// Drift of the reading per second.
    pub drift_per_s: f64,
}

impl Default for SensorPair {
    /// Distance at 1 mm with a noise of 0.1 µm.
    fn default() -> Self {
        Self {
            quantity: Quantity::Displacement,
            stand_off: 1.0,
            noise: 1e-4,
            outlier_rate: 0.0,
            outlier_size: 0.0,
            drift_per_s: 0.0,
        }
    }
}

/// What sensors measure, as the contract names it.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
enum SensorQuantity {
    #[serde(rename = "SENSOR_QUANTITY_DISPLACEMENT")]
    Displacement,
    #[serde(rename = "SENSOR_QUANTITY_STRAIN")]
    Strain,
    #[serde(rename = "SENSOR_QUANTITY_ACCELERATION")]
    Acceleration,
}

/// A pair as a file has it: the fields of the contract's `Sensors`, and what is wrong with them.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct InFile {
    quantity: SensorQuantity,
    mm_per_strain: f64,
    stand_off: f64,
    noise: f64,
    outlier_rate: f64,
    outlier_size: f64,
    drift_per_s: f64,
}

impl Default for InFile {
    fn default() -> Self {
        SensorPair::default().into()
    }
}

impl From<SensorPair> for InFile {
    fn from(pair: SensorPair) -> Self {
        let SensorPair { quantity, stand_off, noise, outlier_rate, outlier_size, drift_per_s } = pair;
        let (quantity, mm_per_strain) = match quantity {
            Quantity::Displacement => (SensorQuantity::Displacement, 0.0),
            Quantity::Strain { mm_per_strain } => (SensorQuantity::Strain, mm_per_strain),
            Quantity::Acceleration => (SensorQuantity::Acceleration, 0.0),
        };
        Self { quantity, mm_per_strain, stand_off, noise, outlier_rate, outlier_size, drift_per_s }
    }
}

impl From<InFile> for SensorPair {
    fn from(file: InFile) -> Self {
        let InFile { quantity, mm_per_strain, stand_off, noise, outlier_rate, outlier_size, drift_per_s } = file;
        let quantity = match quantity {
            SensorQuantity::Displacement => Quantity::Displacement,
            SensorQuantity::Strain => Quantity::Strain { mm_per_strain },
            SensorQuantity::Acceleration => Quantity::Acceleration,
        };
        Self { quantity, stand_off, noise, outlier_rate, outlier_size, drift_per_s }
    }
}
