//! Cutting forces of all edges at one instant.

use crate::description::{Description, Material, Process, Tool};
use std::f64::consts::TAU;

/// Memory of the surface, samples of all edges: a revolution at 92 rev/min with 100 kHz.
const WAVE_SAMPLES: usize = 1 << 16;
/// Slower than this the spindle is stopped, rev/min.
const STANDSTILL_REV_PER_MIN: f64 = 1e-3;

/// An edge relative to the first one.
#[derive(Debug, Clone)]
struct Edge {
    sin: f64,
    cos: f64,
    /// What run-out adds to its chip: its radius less that of the edge before, mm.
    extra_mm: f64,
}

/// What stays the same between two setpoints.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// Unit vectors of the forces' frame: along the feed, and across to the side where a chip is thinnest at entry.
    pub frame: [[f64; 2]; 2],
    /// 1 forwards, −1 backwards.
    pub rotation: f64,
    pub rev_per_min: f64,
    radial_ratio: f64,
    /// Time between two edges at one place, samples.
    delay_samples: f64,
}

/// What the edges left on the surface in the past: how far outside of its undeflected cut, mm, sample by sample and edge by
/// edge.
#[derive(Debug, Clone)]
struct Waves {
    ring: Vec<f64>,
    edges: usize,
    samples: usize,
    next: usize,
}

impl Waves {
    fn new(edges: usize) -> Self {
        let samples = WAVE_SAMPLES / edges;
        Self { ring: vec![0.0; samples * edges], edges, samples, next: 0 }
    }

    /// Starts a sample in which no edge has cut.
    fn start(&mut self) {
        self.next = (self.next + 1) % self.samples;
        self.ring[self.next * self.edges..][..self.edges].fill(0.0);
    }

    /// What an edge left so many samples (1 or more) ago; beyond the memory its oldest.
    fn past(&self, edge: usize, samples: f64) -> f64 {
        let samples = samples.clamp(1.0, (self.samples - 2) as f64);
        let whole = samples as usize;
        let share = samples - whole as f64;
        let at = |back: usize| self.ring[(self.next + self.samples - back) % self.samples * self.edges + edge];
        let (near, far) = (at(whole), at(whole + 1));
        near + share * (far - near)
    }

    fn leave(&mut self, edge: usize, wave_mm: f64) {
        self.ring[self.next * self.edges + edge] = wave_mm;
    }
}

/// Force model.
#[derive(Debug, Clone)]
pub(crate) struct Forces {
    tool: Tool,
    material: Material,
    process: Process,
    edges: Vec<Edge>,
    /// Sine and cosine of entry and exit.
    entry: (f64, f64),
    exit: (f64, f64),
    sample_rate_hz: f64,
    waves: Option<Waves>,
}

impl Forces {
    pub fn new(description: &Description) -> Self {
        let Description { tool, material, process, .. } = *description;
        let (entry_deg, exit_deg, count) = match process {
            Process::Milling { entry_deg, exit_deg } => (entry_deg, exit_deg, tool.edge_count),
            Process::Turning => (0.0, 180.0, 1),
        };
        let pitch = TAU / f64::from(count);
        let radius = |edge: u32| tool.edge_run_out_mm * libm::cos(pitch * f64::from(edge));
        // Later edges follow behind in the direction of rotation.
        let edges = (0..count).map(|edge| {
            let (sin, cos) = libm::sincos(-pitch * f64::from(edge));
            Edge { sin, cos, extra_mm: radius(edge) - radius((edge + count - 1) % count) }
        });
        Self {
            tool,
            material,
            process,
            edges: edges.collect(),
            entry: libm::sincos(entry_deg.to_radians()),
            exit: libm::sincos(exit_deg.to_radians()),
            sample_rate_hz: f64::from(description.sample_rate_hz),
            waves: description.regenerative.then(|| Waves::new(count as usize)),
        }
    }

    /// Motion between two setpoints: feed direction (a unit vector) and spindle speed, rad/s, negative backwards.
    pub fn motion(&self, feed_direction: [f64; 2], spindle_rad_per_s: f64) -> Motion {
        let rotation = if spindle_rad_per_s < 0.0 { -1.0 } else { 1.0 };
        let frame = match self.process {
            Process::Milling { .. } => {
                let [x, y] = feed_direction;
                [[x, y], [-y * rotation, x * rotation]]
            }
            Process::Turning => [[1.0, 0.0], [0.0, -1.0]],
        };
        let rev_per_min = spindle_rad_per_s.abs() * (60.0 / TAU);
        let speed_m_per_min = TAU * self.tool.radius_mm * 1e-3 * rev_per_min;
        let exponent = self.material.radial_speed_exponent;
        let falling = if exponent == 0.0 || rev_per_min < STANDSTILL_REV_PER_MIN {
            1.0
        } else {
            libm::pow(speed_m_per_min / self.material.reference_speed_m_per_min, -exponent)
        };
        Motion {
            frame,
            rotation,
            rev_per_min,
            radial_ratio: self.material.radial_ratio * falling,
            delay_samples: self.sample_rate_hz * 60.0
                / (self.edges.len() as f64 * rev_per_min.max(STANDSTILL_REV_PER_MIN)),
        }
    }

    /// Whether the spindle turns.
    pub fn turns(motion: &Motion) -> bool {
        motion.rev_per_min >= STANDSTILL_REV_PER_MIN
    }

    /// Force on the tool in N in the sensors' directions. `depth_mm` is `None` while tool and work do not touch.
    #[inline]
    pub fn force_n(
        &mut self,
        motion: &Motion,
        angle_rad: f64,
        feed_mm_per_min: f64,
        depth_mm: Option<f64>,
        deflection_mm: [f64; 2],
    ) -> [f64; 2] {
        if let Some(waves) = &mut self.waves {
            waves.start();
        }
        let Some(depth_mm) = depth_mm else { return [0.0; 2] };
        let [along, across] = motion.frame;
        let [x, y] = deflection_mm;
        let deflection_mm = [x * along[0] + y * along[1], x * across[0] + y * across[1]];
        let per_edge_mm = feed_mm_per_min / (self.edges.len() as f64 * motion.rev_per_min);
        let mut force = [0.0; 2];
        match self.process {
            Process::Milling { .. } => {
                let (sin, cos) = libm::sincos(motion.rotation * angle_rad);
                for index in 0..self.edges.len() {
                    let edge = &self.edges[index];
                    let (sin, cos) = (sin * edge.cos + cos * edge.sin, cos * edge.cos - sin * edge.sin);
                    // sin(φ − entry) and sin(exit − φ): both are positive inside an arc of at most half a turn.
                    let entered = sin * self.entry.1 - cos * self.entry.0 >= 0.0;
                    let leaving = self.exit.0 * cos - self.exit.1 * sin >= 0.0;
                    if entered && leaving {
                        let advance_mm = per_edge_mm * sin + edge.extra_mm;
                        let outwards_mm = deflection_mm[0] * sin + deflection_mm[1] * cos;
                        let chip_mm = self.chip_mm(index, advance_mm, outwards_mm, motion.delay_samples);
                        self.cut(chip_mm, depth_mm, motion.radial_ratio, [sin, cos], &mut force);
                    }
                }
            }
            // The work lies in X− and comes down on the tool in Y+.
            Process::Turning => {
                let chip_mm = self.chip_mm(0, per_edge_mm, -deflection_mm[0], motion.delay_samples);
                self.cut(chip_mm, depth_mm, motion.radial_ratio, [-1.0, 0.0], &mut force);
            }
        }
        [force[0] * along[0] + force[1] * across[0], force[0] * along[1] + force[1] * across[1]]
    }

    /// Chip of an edge: its advance beyond the edge before, and with regeneration its deflection outwards beyond the wave
    /// that was left there. Where that is no chip the surface stays, and lies further inside of the next edge's cut.
    #[inline]
    fn chip_mm(&mut self, edge: usize, advance_mm: f64, outwards_mm: f64, delay_samples: f64) -> f64 {
        let Some(waves) = &mut self.waves else { return advance_mm };
        let before = if edge == 0 { self.edges.len() - 1 } else { edge - 1 };
        let past_mm = waves.past(before, delay_samples);
        let chip_mm = advance_mm + outwards_mm - past_mm;
        waves.leave(edge, if chip_mm > 0.0 { outwards_mm } else { past_mm - advance_mm });
        chip_mm
    }

    /// Adds the force −F_r·r̂ − F_t·t̂ of an edge with r̂ = (sin φ, cos φ) pointing outwards and t̂ along its motion;
    /// without a chip there is none.
    #[inline]
    fn cut(&self, chip_mm: f64, depth_mm: f64, radial_ratio: f64, [sin, cos]: [f64; 2], force: &mut [f64; 2]) {
        if chip_mm <= 0.0 {
            return;
        }
        // Thicker than the tool it is no chip.
        let chip_mm = chip_mm.min(self.tool.radius_mm);
        let material = &self.material;
        let chip_n_per_mm = material.tangential_n_per_mm2 * chip_mm;
        let tangential = depth_mm * (chip_n_per_mm + material.edge_tangential_n_per_mm);
        let radial = depth_mm * (radial_ratio * chip_n_per_mm + material.edge_radial_n_per_mm);
        force[0] += -tangential * cos - radial * sin;
        force[1] += tangential * sin - radial * cos;
    }
}
