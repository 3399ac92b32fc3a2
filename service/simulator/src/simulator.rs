//! The machine: follows setpoints and sends telemetry.

use crate::description::{Description, FaultKind, Mounting, Process, SensorPair};
use crate::forces::{Force, Forces, Instant, Motion, steps};
use crate::oscillator::Oscillator;
use crate::random::Random;
use crate::setpoints::{Setpoint, SetpointError, Setpoints};
use crate::telemetry::{Faulty, Has, Reading, Telemetry};
use feedwave_monitoring::{Batch, Quantity, Violation};
use std::f64::consts::TAU;

const NS_PER_S: u64 = 1_000_000_000;
/// Longest idling at once, s.
const MAX_IDLE_S: f64 = 3600.0;
/// Highest spindle speed, rad/s: 10⁶ rev/min.
const MAX_SPINDLE_RAD_PER_S: f64 = 1e6 * TAU / 60.0;

/// A pair of sensors with its random numbers.
#[derive(Debug, Clone)]
struct Pair {
    sensors: SensorPair,
    noise: Random,
    wrong: Random,
    last: [f64; 2],
}

/// What the sensors of a pair are moved by: mm, and mm/s².
#[derive(Debug, Clone, Copy)]
struct Moved {
    position_mm: [f64; 2],
    acceleration: [f64; 2],
}

/// From one setpoint to the next.
#[derive(Debug, Clone)]
struct Segment {
    from: Setpoint,
    to: Setpoint,
    /// Spindle angle with the override, rad.
    angle_rad: [f64; 2],
    start_ns: u64,
    end_ns: u64,
    spindle_rad_per_s: f64,
    motion: Motion,
    /// Commanded velocity, mm/s, and acceleration, mm/s².
    velocity: [f64; 2],
    acceleration: [f64; 2],
}

/// A simulated machine.
#[derive(Debug, Clone)]
pub struct Simulator {
    description: Description,
    forces: Forces,
    tool: [Oscillator; 2],
    /// Steps of forces and tool from one sample to the next, and the time of one, s.
    steps: u32,
    step_s: f64,
    pairs: [Option<Pair>; 2],
    drops: Random,
    telemetry: Telemetry,
    /// The setpoint reached, its time and index, the spindle's true angle there, and the velocity towards it, mm/s.
    at: Setpoint,
    at_ns: u64,
    next_index: Option<u64>,
    angle_rad: f64,
    velocity: [f64; 2],
    feed_direction: [f64; 2],
    spindle_override: f64,
    /// Number and time of the next sample.
    sample: u64,
    sample_ns: u64,
    peak_mm: f64,
}

impl Simulator {
    /// A machine at rest.
    ///
    /// # Errors
    /// Everything that is wrong with the description.
    pub fn new(description: Description) -> Result<Self, Vec<Violation>> {
        let violations = description.violations();
        if !violations.is_empty() {
            return Err(violations);
        }
        let steps = steps(description.sample_rate_hz);
        let step_s = 1.0 / (f64::from(description.sample_rate_hz) * f64::from(steps));
        let pair = |sensors: Option<SensorPair>, stream: u64| {
            sensors.map(|sensors| Pair {
                sensors,
                noise: Random::new(description.seed, stream),
                wrong: Random::new(description.seed, stream + 1),
                last: [sensors.stand_off; 2],
            })
        };
        let pairs = [pair(description.tool_sensors, 1), pair(description.work_sensors, 3)];
        let has = Has {
            pairs: [pairs[0].is_some(), pairs[1].is_some()],
            commanded: pairs.iter().flatten().any(|pair| pair.sensors.quantity == Quantity::Acceleration),
        };
        Ok(Self {
            forces: Forces::new(&description),
            tool: [description.tool.mode_x, description.tool.mode_y].map(|mode| Oscillator::new(&mode, step_s)),
            steps,
            step_s,
            pairs,
            drops: Random::new(description.seed, 5),
            telemetry: Telemetry::new(description.batch_samples as usize, has),
            at: Setpoint::default(),
            at_ns: 0,
            next_index: None,
            angle_rad: 0.0,
            velocity: [0.0; 2],
            feed_direction: [1.0, 0.0],
            spindle_override: 1.0,
            sample: 0,
            sample_ns: 0,
            peak_mm: 0.0,
            description,
        })
    }

    /// What is simulated.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Time that the machine has reached, ns, on the sensors' clock while that is right.
    pub fn clock_ns(&self) -> u64 {
        self.at_ns
    }

    /// Index of the setpoint that is expected next; `None` before the first, which may have any.
    pub fn next_index(&self) -> Option<u64> {
        self.next_index
    }

    /// Largest true deflection of the tool since the last call, mm.
    pub fn take_peak_deflection_mm(&mut self) -> f64 {
        std::mem::take(&mut self.peak_mm)
    }

    /// The spindle override of the machine's control, as a factor of the angle's progress in the setpoints that follow;
    /// 1 when their angle has it already.
    ///
    /// # Errors
    /// [`SetpointError::Spindle`] when it is not between 0 and 10.
    pub fn set_spindle_override(&mut self, factor: f64) -> Result<(), SetpointError> {
        if !(0.0..=10.0).contains(&factor) {
            return Err(SetpointError::Spindle(factor));
        }
        self.spindle_override = factor;
        Ok(())
    }

    /// Stands still with the spindle turning, before a program for instance: what a baseline or a run-up is measured on.
    /// The time, up to an hour, and the speed, negative backwards, count without override.
    ///
    /// # Errors
    /// [`SetpointError`] for a time or speed that is not possible; nothing happens.
    pub fn idle(
        &mut self,
        seconds: f64,
        rev_per_min: f64,
        sink: &mut dyn FnMut(&Batch<'_>),
    ) -> Result<(), SetpointError> {
        if !(0.0..=MAX_IDLE_S).contains(&seconds) {
            return Err(SetpointError::Value {
                index: self.next_index.unwrap_or(0),
                column: "idle time",
                value: seconds,
            });
        }
        if !(-1e6..=1e6).contains(&rev_per_min) {
            return Err(SetpointError::Spindle(rev_per_min));
        }
        let still = Setpoint { feed_mm_per_min: 0.0, ..self.at };
        self.at = still;
        let turned = TAU * rev_per_min / 60.0 * seconds;
        self.go(still, self.at_ns + (seconds * 1e9).round() as u64, turned, sink);
        Ok(())
    }

    /// Follows setpoints. The first one is where the machine is now; each later one is reached one period after the one
    /// before.
    ///
    /// # Errors
    /// [`SetpointError`] for setpoints that cannot be followed; none of them is.
    pub fn push(&mut self, setpoints: &Setpoints<'_>, sink: &mut dyn FnMut(&Batch<'_>)) -> Result<(), SetpointError> {
        setpoints.check(self.next_index.unwrap_or(setpoints.first_index))?;
        self.check_spindle(setpoints)?;
        let period_ns = u64::from(self.description.interpolation_period_us) * 1000;
        for at in 0..setpoints.len() {
            let to = setpoints.get(at);
            if self.next_index.is_none() {
                self.at = to;
                self.angle_rad = to.angle_rad;
                self.next_index = Some(setpoints.first_index);
            } else {
                let turned = (to.angle_rad - self.at.angle_rad) * self.spindle_override;
                self.go(to, self.at_ns + period_ns, turned, sink);
            }
            self.next_index = self.next_index.map(|index| index + 1);
        }
        Ok(())
    }

    /// Sends the samples of a batch that is not full yet.
    pub fn flush(&mut self, sink: &mut dyn FnMut(&Batch<'_>)) {
        self.telemetry.flush(sink);
    }

    fn check_spindle(&self, setpoints: &Setpoints<'_>) -> Result<(), SetpointError> {
        let most = MAX_SPINDLE_RAD_PER_S * self.period_s();
        let mut last = self.next_index.map(|_| self.at.angle_rad);
        for at in 0..setpoints.len() {
            let angle_rad = setpoints.get(at).angle_rad;
            let step = last.replace(angle_rad).map_or(0.0, |last| (angle_rad - last).abs());
            if step > most {
                return Err(SetpointError::Spindle(step / self.period_s() * 60.0 / TAU));
            }
        }
        Ok(())
    }

    fn period_s(&self) -> f64 {
        f64::from(self.description.interpolation_period_us) * 1e-6
    }

    /// Moves to a setpoint, turning the spindle by this angle, and takes the samples in between.
    fn go(&mut self, to: Setpoint, end_ns: u64, turned_rad: f64, sink: &mut dyn FnMut(&Batch<'_>)) {
        if end_ns > self.at_ns {
            let seconds = (end_ns - self.at_ns) as f64 * 1e-9;
            let velocity = [0, 1].map(|axis| (to.axes_mm[axis] - self.at.axes_mm[axis]) / seconds);
            let acceleration = [0, 1].map(|axis| (velocity[axis] - self.velocity[axis]) / seconds);
            let speed = libm::hypot(velocity[0], velocity[1]);
            // Along the third axis, or at rest, the direction stays.
            if speed > 1e-9 {
                self.feed_direction = velocity.map(|component| component / speed);
            }
            let spindle_rad_per_s = turned_rad / seconds;
            let segment = Segment {
                from: self.at,
                to,
                angle_rad: [self.angle_rad, self.angle_rad + turned_rad],
                start_ns: self.at_ns,
                end_ns,
                spindle_rad_per_s,
                motion: self.forces.motion(self.feed_direction, spindle_rad_per_s),
                velocity,
                acceleration,
            };
            while self.sample_ns < end_ns {
                self.take(&segment, sink);
            }
            self.velocity = velocity;
            self.at_ns = end_ns;
            self.angle_rad = segment.angle_rad[1];
        }
        self.at = to;
    }

    /// Takes one sample and lets the tool go on to the next.
    #[inline]
    fn take(&mut self, segment: &Segment, sink: &mut dyn FnMut(&Batch<'_>)) {
        let share = (self.sample_ns - segment.start_ns) as f64 / (segment.end_ns - segment.start_ns) as f64;
        let between = |from: f64, to: f64| from + share * (to - from);
        let time_s = self.sample_ns as f64 * 1e-9;
        let path_mm = between(segment.from.path_mm, segment.to.path_mm);
        let feed_mm_per_min = between(segment.from.feed_mm_per_min, segment.to.feed_mm_per_min);
        let line = segment.to.line;
        let mut angle_rad = between(segment.angle_rad[0], segment.angle_rad[1]);
        let mut spindle_rad_per_s = segment.spindle_rad_per_s;
        let ripple = self.description.ripple;
        if ripple.fraction > 0.0 {
            let omega = TAU * ripple.frequency_hz;
            let (sin, cos) = libm::sincos(omega * time_s);
            angle_rad += ripple.fraction * spindle_rad_per_s / omega * sin;
            spindle_rad_per_s *= 1.0 + ripple.fraction * cos;
        }
        let touches = feed_mm_per_min > 0.0 && Forces::turns(&segment.motion);
        let contact = self.description.contacts.iter().find(|contact| contact.at.holds(time_s, path_mm, line));
        let depth_mm = contact.filter(|_| touches).map(|contact| contact.depth_mm);
        let deflection_mm = [self.tool[0].deflection_mm, self.tool[1].deflection_mm];
        let instant = Instant { angle_rad, feed_mm_per_min, depth_mm, deflection_mm, change_mm: [0.0; 2] };
        let acceleration = self.go_on(&segment.motion, instant, spindle_rad_per_s);
        let mut moved = Moved { position_mm: deflection_mm, acceleration };
        if depth_mm.is_some() {
            for chatter in self.description.chatter.iter().filter(|chatter| chatter.at.holds(time_s, path_mm, line)) {
                let (sin, cos) = libm::sincos(chatter.direction_deg.to_radians());
                moved.vibrate(chatter.amplitude_mm, chatter.frequency_hz, time_s, [cos, sin]);
            }
        }
        let [x, y] = moved.position_mm;
        self.peak_mm = self.peak_mm.max((x * x + y * y).sqrt());
        let faulty = self.faulty(time_s, path_mm, line);
        let pairs = self.read(moved, segment, angle_rad, spindle_rad_per_s, time_s, &faulty);
        let reading = Reading {
            time_ns: self.sample_ns.saturating_add_signed(faulty.clock_offset_ns),
            pairs,
            commanded: segment.acceleration,
            velocity: segment.velocity,
            angle_rad,
            rev_per_min: spindle_rad_per_s.abs() * (60.0 / TAU),
            contact: depth_mm.is_some(),
            line,
        };
        let dropped = self.description.drop_rate > 0.0 && self.drops.uniform() < self.description.drop_rate;
        if !dropped {
            self.telemetry.record(&reading, &faulty, sink);
        }
        self.sample += 1;
        let rate = u64::from(self.description.sample_rate_hz);
        self.sample_ns = self.sample / rate * NS_PER_S + self.sample % rate * NS_PER_S / rate;
    }

    /// Lets the tool go on from one sample to the next, from this angle on. Gives its acceleration at the begin.
    #[inline]
    fn go_on(&mut self, motion: &Motion, mut instant: Instant, spindle_rad_per_s: f64) -> [f64; 2] {
        let angle_rad = instant.angle_rad;
        let mut acceleration = [0.0; 2];
        for step in 0..self.steps {
            instant.angle_rad = angle_rad + spindle_rad_per_s * self.step_s * (f64::from(step) + 0.5);
            instant.change_mm = [0, 1].map(|axis| self.tool[axis].change_mm());
            instant.deflection_mm = [0, 1].map(|axis| self.tool[axis].deflection_mm + instant.change_mm[axis]);
            let Force { mean_n, change_n } = self.forces.force(motion, &instant);
            for (axis, tool) in self.tool.iter_mut().enumerate() {
                if step == 0 {
                    acceleration[axis] = tool.acceleration(mean_n[axis] - change_n[axis]);
                }
                tool.advance(mean_n[axis], change_n[axis]);
            }
        }
        acceleration
    }

    /// What the sensors say.
    fn read(
        &mut self,
        tool: Moved,
        segment: &Segment,
        angle_rad: f64,
        spindle_rad_per_s: f64,
        time_s: f64,
        faulty: &Faulty,
    ) -> [[f64; 2]; 2] {
        let mut moved = [tool, Moved { position_mm: [0.0; 2], acceleration: [0.0; 2] }];
        // The spindle's angle counts clockwise seen against Z. With its speed steady the run-out accelerates inwards.
        let (sin, cos) = libm::sincos(angle_rad);
        let run_out = [cos, -sin].map(|component| self.description.tool.run_out_mm * component);
        let rotating = usize::from(self.description.process == Process::Turning);
        let inwards = spindle_rad_per_s * spindle_rad_per_s;
        for (axis, offset) in run_out.into_iter().enumerate() {
            moved[rotating].position_mm[axis] += offset;
            moved[rotating].acceleration[axis] -= inwards * offset;
        }
        if let Some(sway) = self.description.sway {
            moved.iter_mut().for_each(|moved| moved.vibrate(sway.amplitude_mm, sway.frequency_hz, time_s, [1.0, 1.0]));
        }
        let mut readings = [[0.0; 2]; 2];
        for (which, pair) in self.pairs.iter_mut().enumerate() {
            let Some(pair) = pair else { continue };
            let read = pair.read(moved[which], segment.acceleration, time_s);
            if !faulty.stuck[which] {
                pair.last = read;
            }
            readings[which] = if faulty.not_a_number[which] { [f64::NAN; 2] } else { pair.last };
        }
        readings
    }

    fn faulty(&self, time_s: f64, path_mm: f64, line: u32) -> Faulty {
        let mut faulty = Faulty::default();
        let pair = |mounting: Mounting| usize::from(mounting == Mounting::Work);
        for fault in self.description.faults.iter().filter(|fault| fault.at.holds(time_s, path_mm, line)) {
            match fault.kind {
                FaultKind::SensorLost(mounting) => faulty.lost[pair(mounting)] = true,
                FaultKind::NotANumber(mounting) => faulty.not_a_number[pair(mounting)] = true,
                FaultKind::Stuck(mounting) => faulty.stuck[pair(mounting)] = true,
                FaultKind::ClockJump(offset_ns) => faulty.clock_offset_ns = offset_ns,
                FaultKind::DuplicateBatches => faulty.duplicate = true,
                FaultKind::SwappedBatches => faulty.swap = true,
                FaultKind::LostBatches => faulty.lose_batch = true,
                FaultKind::Silence => faulty.silence = true,
            }
        }
        faulty
    }
}

impl Moved {
    /// Adds a·sin 2πft along a direction.
    fn vibrate(&mut self, amplitude_mm: f64, frequency_hz: f64, time_s: f64, direction: [f64; 2]) {
        let omega = TAU * frequency_hz;
        let offset = amplitude_mm * libm::sin(omega * time_s);
        for (axis, component) in direction.into_iter().enumerate() {
            self.position_mm[axis] += offset * component;
            self.acceleration[axis] -= omega * omega * offset * component;
        }
    }
}

impl Pair {
    fn read(&mut self, moved: Moved, commanded: [f64; 2], time_s: f64) -> [f64; 2] {
        let SensorPair { quantity, stand_off, noise, outlier_rate, outlier_size, drift_per_s } = self.sensors;
        let mut values = match quantity {
            Quantity::Displacement => moved.position_mm,
            Quantity::Strain { mm_per_strain } => moved.position_mm.map(|position| position / mm_per_strain),
            Quantity::Acceleration => [0, 1].map(|axis| moved.acceleration[axis] + commanded[axis]),
        };
        for value in &mut values {
            *value += stand_off + drift_per_s * time_s + noise * self.noise.normal();
        }
        if outlier_rate > 0.0 && self.wrong.uniform() < outlier_rate {
            let offset = 2.0 * self.wrong.uniform() - 1.0;
            values[usize::from(self.wrong.uniform() < 0.5)] += outlier_size * 0.5 * (offset + offset.signum());
        }
        values
    }
}
