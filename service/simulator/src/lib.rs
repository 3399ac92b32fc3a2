//! A simulated machine: setpoints in, telemetry out, so that the loop from sensor to feed override is closed without iron.
//!
//! The setpoints are those a client receives, overrides included: the chip thickness follows from their feed and spindle
//! angle, the forces from the chip, the deflection from the forces, the readings from the deflection. Invariants: pure and
//! deterministic to the bit from the seed, whatever the block boundaries; memory is bounded by the description; nothing is
//! allocated between [`Simulator::new`] and drop.
//!
//! - **Forces**: K_t and K_r with the chip thickness of every edge, edge forces, run-out of the edges (Altintas 2012, ch. 2).
//! - **Tool**: one mode in each of two directions, advanced exactly over each step by its closed-form transition;
//!   160 000 steps a second at least, whatever the sensors' rate.
//! - **Chatter**: from the wave that the edge before left on the surface (regeneration), or at a frequency on demand.
//! - **Sensors**: displacement, strain or acceleration at tool and work, with noise, outliers, drift and lost samples.
//! - **Faults** on demand: everything a monitor must not decide on.

#![forbid(unsafe_code)]

mod description;
mod forces;
mod oscillator;
mod random;
mod setpoints;
mod simulator;
mod telemetry;

pub use description::{
    Chatter, Contact, Description, Fault, FaultKind, Material, Mounting, Process, Ripple, SensorPair, Sway, Tool, Where,
};
pub use setpoints::{SetpointError, Setpoints};
pub use simulator::Simulator;
