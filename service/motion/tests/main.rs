//! Motion: geometry, limits, planning, kinematics. One binary: see `feedwave-cutting`.

mod chain_limits;
mod common;
mod corners_in_curves;
mod geometry;
mod kinematics;
mod least_time;
mod optimality;
mod planning;
mod programs;
mod replanning;
mod sharp_corners;
mod spline_limits;
mod splines;
mod superposed;
mod window_bytes;
