//! What is simulated: tool, work, sensors, and what goes wrong. Its file has the names and units of the contract.

mod sensors;
mod validate;

use feedwave_monitoring::{Length, MillingModel, Mode, MonitoringConfig, Quantity, Sensors, Violation};
pub use sensors::SensorPair;
use serde::{Deserialize, Serialize};

/// A stretch of the run. Lower ends belong to it, upper ends do not, except for lines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Where {
    /// By time since the simulator's start, idling included, s.
    Time {
        /// Start.
        from_s: f64,
        /// End.
        to_s: f64,
    },
    /// By path position, mm.
    Path {
        /// Start.
        from_mm: f64,
        /// End.
        to_mm: f64,
    },
    /// By source line, both included.
    Lines {
        /// First.
        first: u32,
        /// Last.
        last: u32,
    },
}

impl Where {
    /// Whether a place is in the stretch.
    #[inline]
    pub(crate) fn holds(&self, time_s: f64, path_mm: f64, line: u32) -> bool {
        match *self {
            Self::Time { from_s, to_s } => time_s >= from_s && time_s < to_s,
            Self::Path { from_mm, to_mm } => path_mm >= from_mm && path_mm < to_mm,
            Self::Lines { first, last } => (first..=last).contains(&line),
        }
    }
}

/// The cutting tool. Directions are those of the sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Tool {
    /// Cutting edges z.
    pub edge_count: u32,
    /// Radius of what rotates, mm: of the mill, or of the turned work. Gives the cutting speed.
    pub radius_mm: f64,
    /// Mode in X.
    pub mode_x: Mode,
    /// Mode in Y.
    pub mode_y: Mode,
    /// Run-out of the surface that the sensors see, mm: half of the total indicated reading. It is the tool's in milling and
    /// the work's in turning.
    pub run_out_mm: f64,
    /// Run-out of the edges, mm: they cut chips of different thickness.
    pub edge_run_out_mm: f64,
}

impl Default for Tool {
    fn default() -> Self {
        Self {
            edge_count: 4,
            radius_mm: 5.0,
            mode_x: Mode { frequency_hz: 900.0, damping_ratio: 0.04, stiffness_n_per_mm: 12_000.0 },
            mode_y: Mode { frequency_hz: 950.0, damping_ratio: 0.04, stiffness_n_per_mm: 13_000.0 },
            run_out_mm: 0.002,
            edge_run_out_mm: 0.0,
        }
    }
}

/// Cutting forces of the material: F_t = b·(K_t·h + K_te), F_r = b·(K_r·K_t·h + K_re) for depth b and chip thickness h.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// K_t, N/mm².
    pub tangential_n_per_mm2: f64,
    /// K_r at the reference speed.
    pub radial_ratio: f64,
    /// K_te, N/mm.
    pub edge_tangential_n_per_mm: f64,
    /// K_re, N/mm.
    pub edge_radial_n_per_mm: f64,
    /// Exponent m of K_r·(v/v_ref)^−m: friction on the rake face falls with the cutting speed v.
    pub radial_speed_exponent: f64,
    /// v_ref, m/min.
    pub reference_speed_m_per_min: f64,
}

impl Default for Material {
    /// Unalloyed steel, without edge forces.
    fn default() -> Self {
        Self {
            tangential_n_per_mm2: 2000.0,
            radial_ratio: 0.3,
            edge_tangential_n_per_mm: 0.0,
            edge_radial_n_per_mm: 0.0,
            radial_speed_exponent: 0.0,
            reference_speed_m_per_min: 100.0,
        }
    }
}

/// What rotates, and where an edge is in the material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Process {
    /// The tool rotates. Angles from the normal of the feed direction in the direction of rotation, as in [`MillingModel`];
    /// chip h = c·sin φ with the feed per edge c.
    Milling {
        /// Entry angle, degrees, 0 to below 180.
        entry_deg: f64,
        /// Exit angle, degrees, above the entry angle, at most 180.
        exit_deg: f64,
    },
    /// The work rotates; the chip is the feed per revolution. The radial force pushes the tool in X+, the tangential in Y+.
    Turning,
}

/// A stretch in which tool and work touch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Stretch; there is contact in it while the feed is not 0 and the spindle turns.
    pub at: Where,
    /// Depth (milling) or width (turning) of cut b, mm. The first stretch that holds a place decides.
    pub depth_mm: f64,
}

/// Fluctuation of the spindle speed: Ω·(1 + a·cos 2πft).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ripple {
    /// a, as a fraction of the speed.
    pub fraction: f64,
    /// f, Hz.
    pub frequency_hz: f64,
}

/// Vibration that tool and work share, for instance of the floor: a·sin 2πft in both directions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sway {
    /// a, mm.
    pub amplitude_mm: f64,
    /// f, Hz.
    pub frequency_hz: f64,
}

/// Chatter on demand, added to what the forces do to the tool.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chatter {
    /// Stretch; the tool chatters in it while it touches the work.
    pub at: Where,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude, mm.
    pub amplitude_mm: f64,
    /// Direction from X, degrees, −360 to 360.
    pub direction_deg: f64,
}

/// Which pair of sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mounting {
    /// The one at the tool.
    Tool,
    /// The one at the work.
    Work,
}

/// Something that goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum FaultKind {
    /// Batches come without this pair's columns.
    SensorLost(Mounting),
    /// The pair reads NaN.
    NotANumber(Mounting),
    /// The pair repeats what it read last.
    Stuck(Mounting),
    /// The sensors' clock is off by this many ns.
    ClockJump(i64),
    /// Every batch comes twice.
    DuplicateBatches,
    /// A batch comes after the one that follows it.
    SwappedBatches,
    /// Batches are lost in transit.
    LostBatches,
    /// No telemetry.
    Silence,
}

/// A fault and where it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Stretch. Faults of batches concern every batch with a sample in it.
    pub at: Where,
    /// What goes wrong.
    pub kind: FaultKind,
}

/// Everything about one simulated run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Description {
    /// Seed of all that is random.
    pub seed: u64,
    /// Time between setpoints, µs.
    pub interpolation_period_us: u32,
    /// Tool.
    pub tool: Tool,
    /// Material.
    pub material: Material,
    /// Process.
    pub process: Process,
    /// Whether an edge meets the wave that the edge before left: deep cuts then chatter of themselves.
    pub regenerative: bool,
    /// Where tool and work touch.
    pub contacts: Vec<Contact>,
    /// Fluctuation of the spindle speed.
    pub ripple: Ripple,
    /// Vibration that tool and work share.
    pub sway: Option<Sway>,
    /// Chatter on demand.
    pub chatter: Vec<Chatter>,
    /// Samples per second of every channel.
    pub sample_rate_hz: u32,
    /// Samples of a batch.
    pub batch_samples: u32,
    /// Chance that a sample is lost.
    pub drop_rate: f64,
    /// Sensors at the tool.
    pub tool_sensors: Option<SensorPair>,
    /// Sensors at the work.
    pub work_sensors: Option<SensorPair>,
    /// Faults.
    pub faults: Vec<Fault>,
}

impl Default for Description {
    /// A four-edged mill of 10 mm in steel, half immersed, one pair of distance sensors at 20 kHz, nothing in contact.
    fn default() -> Self {
        Self {
            seed: 0,
            interpolation_period_us: 1000,
            tool: Tool::default(),
            material: Material::default(),
            process: Process::Milling { entry_deg: 90.0, exit_deg: 180.0 },
            regenerative: false,
            contacts: Vec::new(),
            ripple: Ripple::default(),
            sway: None,
            chatter: Vec::new(),
            sample_rate_hz: 20_000,
            batch_samples: 200,
            drop_rate: 0.0,
            tool_sensors: Some(SensorPair::default()),
            work_sensors: None,
            faults: Vec::new(),
        }
    }
}

impl Description {
    /// All that is wrong, one violation per field; empty when it can be simulated.
    pub fn violations(&self) -> Vec<Violation> {
        validate::violations(self)
    }

    /// How the telemetry is judged by default: the default limits of the deflection, with windows as short as simulated
    /// programs are. `None` with other sensors than those of distance, whose limits cannot be guessed.
    pub fn monitoring(&self) -> Option<MonitoringConfig> {
        let pairs = [self.tool_sensors, self.work_sensors];
        if pairs.iter().flatten().any(|pair| pair.quantity != Quantity::Displacement) {
            return None;
        }
        // A millimetre around the stand-off: far more than a tool bends.
        let sensors = |pair: Option<SensorPair>| {
            pair.map(|pair| Sensors { quantity: pair.quantity, min: pair.stand_off - 1.0, max: pair.stand_off + 1.0 })
        };
        let mut config = MonitoringConfig {
            sample_rate_hz: f64::from(self.sample_rate_hz),
            tool: sensors(self.tool_sensors),
            work: sensors(self.work_sensors),
            settling_s: 0.1,
            window: Length::Seconds(0.2),
            ..MonitoringConfig::default()
        };
        // A simulated machine rests while its computer is busy: that is no silence, and its telemetry is not stale.
        config.quality.silence_s = 600.0;
        config.quality.stale_s = 600.0;
        Some(config)
    }

    /// The model whose stability lobes are those of this tool in a straight cut along X; `None` in turning.
    pub fn milling_model(&self) -> Option<MillingModel> {
        let Process::Milling { entry_deg, exit_deg } = self.process else { return None };
        Some(MillingModel {
            modes_x: vec![self.tool.mode_x],
            modes_y: vec![self.tool.mode_y],
            edges: self.tool.edge_count,
            entry_rad: entry_deg.to_radians(),
            exit_rad: exit_deg.to_radians(),
            tangential_n_per_mm2: self.material.tangential_n_per_mm2,
            radial_ratio: self.material.radial_ratio,
        })
    }
}
