//! From blocks of five-axis motion to elements: the machine's axes as functions of the tool centre point's path.
//!
//! A block is solved once, when its element is made: what is kept are polynomials that give every machine axis by arc
//! length, as [`FiveAxis`] explains. Nothing of the machine is needed to run along it, backwards as well as forwards,
//! and what the axes do between two setpoints is known as exactly as what they do at them.

mod block;
mod corner;
mod fit;
mod linear;
mod series;
mod turning;

pub use block::{FiveAxisBlock, FiveAxisMotion, FiveAxisPoint, FiveAxisRefusal, Toward};
pub use corner::FiveAxisCorners;
