//! Cutting forces of all edges at one instant.

use crate::description::{Description, Material, Process, Tool};
use std::f64::consts::TAU;

/// Least number of steps in a second. What they leave of the continuous machine is a ten-thousandth of the largest deflection (`tests/physics.rs`), with
/// regeneration and edges that jump out of the cut two thousandths; it falls with their square, there in proportion.
const LEAST_STEPS_PER_S: u32 = 160_000;
/// Memory of the surface, steps of all edges: a revolution at 92 rev/min.
const WAVE_STEPS: usize = 1 << 17;
/// Slower than this the spindle is stopped, rev/min.
const STANDSTILL_REV_PER_MIN: f64 = 1e-3;

/// An edge relative to the first one.
#[derive(Debug, Clone)]
struct Edge {
    sin: f64,
    cos: f64,
    /// What run-out adds to its chip, mm: its radius less that of the edge before, of the one before that, and so on to its own a turn ago.
    extra_mm: Vec<f64>,
}

/// Steps between two samples.
pub(crate) fn steps(sample_rate_hz: u32) -> u32 {
    LEAST_STEPS_PER_S.div_ceil(sample_rate_hz)
}

/// A step of the machine: angle and speed of the spindle in its middle, and what is the same over it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Instant {
    pub angle_rad: f64,
    pub feed_mm_per_min: f64,
    /// `None` while tool and work do not touch.
    pub depth_mm: Option<f64>,
    pub deflection_mm: [f64; 2],
    /// By how much the deflection changes over half of the step, mm.
    pub change_mm: [f64; 2],
}

/// Force on the tool over a step, N: its mean, and by how much the straight line of the same first moment changes over half of the step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Force {
    pub mean_n: [f64; 2],
    pub change_n: [f64; 2],
}

/// A chip in the middle of a step, mm, and by how much it changes over half of the step.
#[derive(Debug, Clone, Copy)]
struct Chip {
    middle_mm: f64,
    change_mm: f64,
}

/// A part of a step, in −1 to 1.
#[derive(Debug, Clone, Copy)]
struct Part {
    from: f64,
    to: f64,
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
    /// Turn of a step.
    step_rad: f64,
    /// Time between two edges at one place, steps.
    delay_steps: f64,
}

/// What the edges left on the surface in the past: how far outside of its undeflected cut, mm, step by step and edge by edge.
#[derive(Debug, Clone)]
struct Waves {
    ring: Vec<f64>,
    edges: usize,
    steps: usize,
    next: usize,
}

impl Waves {
    fn new(edges: usize) -> Self {
        let steps = WAVE_STEPS / edges;
        Self { ring: vec![0.0; steps * edges], edges, steps, next: 0 }
    }

    /// Starts a step in which no edge has cut.
    fn start(&mut self) {
        self.next = (self.next + 1) % self.steps;
        self.ring[self.next * self.edges..][..self.edges].fill(0.0);
    }

    /// What an edge left so many steps (2 or more) ago, and by how much it changed over half of a step; beyond the memory its oldest.
    fn past(&self, edge: usize, steps: f64) -> [f64; 2] {
        let steps = steps.clamp(2.0, (self.steps - 3) as f64);
        let whole = steps as usize;
        let share = steps - whole as f64;
        let at = |back: usize| self.ring[(self.next + self.steps - back) % self.steps * self.edges + edge];
        let [nearest, near, far, farthest] = [whole - 1, whole, whole + 1, whole + 2].map(at);
        // Central differences: a delay of whole steps has the same on either side.
        let change = 0.25 * (nearest - far + share * (near - farthest - nearest + far));
        [near + share * (far - near), change]
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
    steps_per_s: f64,
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
            let extra_mm = (1..=count).map(|back| radius(edge) - radius((edge + count - back) % count));
            Edge { sin, cos, extra_mm: extra_mm.collect() }
        });
        Self {
            tool,
            material,
            process,
            edges: edges.collect(),
            entry: libm::sincos(entry_deg.to_radians()),
            exit: libm::sincos(exit_deg.to_radians()),
            steps_per_s: f64::from(description.sample_rate_hz) * f64::from(steps(description.sample_rate_hz)),
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
            step_rad: spindle_rad_per_s.abs().max(STANDSTILL_REV_PER_MIN * TAU / 60.0) / self.steps_per_s,
            delay_steps: self.steps_per_s * 60.0 / (self.edges.len() as f64 * rev_per_min.max(STANDSTILL_REV_PER_MIN)),
        }
    }

    /// Whether the spindle turns.
    pub fn turns(motion: &Motion) -> bool {
        motion.rev_per_min >= STANDSTILL_REV_PER_MIN
    }

    /// Force on the tool over a step in the sensors' directions.
    #[inline]
    pub fn force(&mut self, motion: &Motion, instant: &Instant) -> Force {
        if let Some(waves) = &mut self.waves {
            waves.start();
        }
        let Some(depth_mm) = instant.depth_mm else { return Force::default() };
        let [along, across] = motion.frame;
        let in_frame = |[x, y]: [f64; 2]| [x * along[0] + y * along[1], x * across[0] + y * across[1]];
        let (at, moves) = (in_frame(instant.deflection_mm), in_frame(instant.change_mm));
        let per_edge_mm = instant.feed_mm_per_min / (self.edges.len() as f64 * motion.rev_per_min);
        let turn_rad = 0.5 * motion.step_rad;
        let mut force = Force::default();
        match self.process {
            Process::Milling { .. } => {
                let (sin, cos) = libm::sincos(motion.rotation * instant.angle_rad);
                for index in 0..self.edges.len() {
                    let edge = &self.edges[index];
                    let (sin, cos) = (sin * edge.cos + cos * edge.sin, cos * edge.cos - sin * edge.sin);
                    let part = self.engaged(motion, sin, cos);
                    if part.is_none() && self.waves.is_none() {
                        continue;
                    }
                    let outwards_mm = [
                        at[0] * sin + at[1] * cos,
                        moves[0] * sin + moves[1] * cos + (at[0] * cos - at[1] * sin) * turn_rad,
                    ];
                    let Some(part) = part else {
                        // What it would leave: in the step before its entry, the next edge's chip begins between both.
                        self.leave(index, outwards_mm[0]);
                        continue;
                    };
                    let feed_mm = [per_edge_mm * sin, per_edge_mm * cos * turn_rad];
                    let chip = self.chip(index, feed_mm, outwards_mm, motion.delay_steps);
                    self.cut(chip, part, depth_mm, motion.radial_ratio, ([sin, cos], turn_rad), &mut force);
                }
            }
            // The work lies in X− and comes down on the tool in Y+.
            Process::Turning => {
                let chip = self.chip(0, [per_edge_mm, 0.0], [-at[0], -moves[0]], motion.delay_steps);
                let whole = Part { from: -1.0, to: 1.0 };
                self.cut(chip, whole, depth_mm, motion.radial_ratio, ([-1.0, 0.0], 0.0), &mut force);
            }
        }
        let turned = |[x, y]: [f64; 2]| [x * along[0] + y * across[0], x * along[1] + y * across[1]];
        Force { mean_n: turned(force.mean_n), change_n: turned(force.change_n) }
    }

    #[inline]
    fn leave(&mut self, edge: usize, wave_mm: f64) {
        if let Some(waves) = &mut self.waves {
            waves.leave(edge, wave_mm);
        }
    }

    /// Part of a step over which an edge is in the work whose angle in its middle has this sine and cosine.
    #[inline]
    fn engaged(&self, motion: &Motion, sin: f64, cos: f64) -> Option<Part> {
        let half_rad = 0.5 * motion.step_rad;
        // Sines of φ − entry and exit − φ: both are positive inside an arc of at most half a turn, and close to its ends angles. Which end
        // is close, the cosines say.
        let [entered, leaving] = [sin * self.entry.1 - cos * self.entry.0, self.exit.0 * cos - self.exit.1 * sin];
        if entered <= -half_rad || leaving <= -half_rad {
            return None;
        }
        let is_near_entry = cos * self.entry.1 + sin * self.entry.0 >= 0.0;
        let is_near_exit = cos * self.exit.1 + sin * self.exit.0 >= 0.0;
        if !is_near_entry && !is_near_exit {
            return None;
        }
        let from = if is_near_entry { (-entered / half_rad).max(-1.0) } else { -1.0 };
        let to = if is_near_exit { (leaving / half_rad).min(1.0) } else { 1.0 };
        Some(Part { from, to })
    }

    /// Chip of an edge from what it advances and how far it bends outwards, each with its change over half of a step: its advance beyond the
    /// edge before, and with regeneration its deflection outwards beyond the wave that was left there. Where that is no chip the surface stays,
    /// and lies further inside of the next edge's cut.
    #[inline]
    fn chip(&mut self, index: usize, feed_mm: [f64; 2], outwards_mm: [f64; 2], delay_steps: f64) -> Chip {
        let edge = &self.edges[index];
        let Some(waves) = &mut self.waves else {
            // Beyond that of the edges before which has left the surface furthest inside.
            let mut least = Chip { middle_mm: f64::INFINITY, change_mm: 0.0 };
            for (extra_mm, back) in edge.extra_mm.iter().zip(1_u32..) {
                let [middle_mm, change_mm] = feed_mm.map(|feed_mm| f64::from(back) * feed_mm);
                if middle_mm + extra_mm < least.middle_mm {
                    least = Chip { middle_mm: middle_mm + extra_mm, change_mm };
                }
            }
            return least;
        };
        let advance_mm = feed_mm[0] + edge.extra_mm[0];
        let before = if index == 0 { self.edges.len() - 1 } else { index - 1 };
        let [past_mm, past_change_mm] = waves.past(before, delay_steps);
        let middle_mm = advance_mm + outwards_mm[0] - past_mm;
        waves.leave(index, if middle_mm > 0.0 { outwards_mm[0] } else { past_mm - advance_mm });
        Chip { middle_mm, change_mm: feed_mm[1] + outwards_mm[1] - past_change_mm }
    }

    /// Adds the force −F_r·r̂ − F_t·t̂ of an edge with r̂ = (sin φ, cos φ) pointing outwards and t̂ along its motion, over the part of a step in
    /// which there is a chip; φ turns by `turn_rad` over half of the step.
    #[inline]
    fn cut(
        &self,
        chip: Chip,
        part: Part,
        depth_mm: f64,
        radial_ratio: f64,
        ([sin, cos], turn_rad): ([f64; 2], f64),
        force: &mut Force,
    ) {
        let Some(Part { from, to }) = part.with(chip) else { return };
        let (share, middle) = (0.5 * (to - from), 0.5 * (from + to));
        let (sin, cos) = (sin + cos * turn_rad * middle, cos - sin * turn_rad * middle);
        // Thicker than the tool it is no chip.
        let chip_mm = (chip.middle_mm + chip.change_mm * middle).min(self.tool.radius_mm);
        let material = &self.material;
        let by_chip = depth_mm * material.tangential_n_per_mm2;
        let tangential = by_chip * chip_mm + depth_mm * material.edge_tangential_n_per_mm;
        let radial = radial_ratio * by_chip * chip_mm + depth_mm * material.edge_radial_n_per_mm;
        let [tangential_change, radial_change] = [by_chip, radial_ratio * by_chip].map(|it| it * chip.change_mm);
        let at = [-tangential * cos - radial * sin, tangential * sin - radial * cos];
        let change = [
            -tangential_change * cos - radial_change * sin + turn_rad * at[1],
            tangential_change * sin - radial_change * cos - turn_rad * at[0],
        ];
        for axis in 0..2 {
            force.mean_n[axis] += share * at[axis];
            force.change_n[axis] += share * (3.0 * middle * at[axis] + share * share * change[axis]);
        }
    }
}

impl Part {
    /// The part of it in which there is a chip.
    #[inline]
    fn with(self, chip: Chip) -> Option<Self> {
        let Self { mut from, mut to } = self;
        let Chip { middle_mm, change_mm } = chip;
        if middle_mm <= change_mm.abs() {
            let zero = -middle_mm / change_mm;
            if change_mm > 0.0 {
                from = from.max(zero);
            } else if change_mm < 0.0 {
                to = to.min(zero);
            } else {
                return None;
            }
        }
        (from < to).then_some(Self { from, to })
    }
}
