//! Superposition of the oscillation of a rotary tool: offsets along the feed direction, across it and along the tool axis,
//! with the phase from the spindle angle.
//!
//! The offsets are blended in and out by the place on the path, so that they are 0 at both ends of the section and the tool
//! never leaves it in the feed direction; nothing depends on time, on the feed or on its override.

use core::f64::consts::TAU;

use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{ToolFrame, ToolPose};
use feedwave_motion::{Arc, Curve, Element, FiveAxis, sincos_turns};
use feedwave_program::Axis;
use serde::{Deserialize, Serialize};

use super::inclination::FeedDirection;
use super::{DirectionMotion, ToolOscillation, ramp_mm};
use crate::shared::blend::BlendedPath;
use crate::shared::columns::{ColumnMap, Samples};
use crate::shared::setpoint::{BLOCK_LENGTH, SetpointBlock};
use crate::shared::superposition::SuperpositionBarrier;
use crate::shared::track::PathBarrier;
use crate::shared::wording::round_down;

/// A barrier of a part of the path on which the tool oscillates.
pub(crate) type OscillationBarrier = SuperpositionBarrier<OscillationRun>;

/// What the generator needs to know of a part of the path on which the tool oscillates. Where the tool is not guided, its axis is Z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct OscillationRun {
    pub(crate) oscillation: ToolOscillation,
    /// Whether the spindle turns clockwise, seen from it.
    pub(crate) clockwise: bool,
    /// Length of path over which the oscillation is blended in and out, mm.
    pub(crate) ramp_mm: f64,
    /// The frame of the tool on a machine with kinematics.
    pub(crate) frame: Option<ToolFrame>,
}

/// Path direction of a guided tool as the tool sees it, across and along it, at an arc length of an element.
pub(crate) fn seen_by_tool(frame: &ToolFrame, element: &Element, five_axis: &FiveAxis, s: f64) -> Vec3 {
    let mut tangent = [0.0; 3];
    for (axis, value) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(&mut tangent) {
        element.fill_work_tangent(axis, &[s], core::slice::from_mut(value));
    }
    let tangent = five_axis.setup().to_chain(&ToolPose { tip_mm: [0.0; 3], direction: tangent }).direction;
    frame.seen(rotary_rad(element, five_axis, s), tangent)
}

/// The rotary axes at an arc length of an element, rad.
pub(crate) fn rotary_rad(element: &Element, five_axis: &FiveAxis, s: f64) -> [f64; 2] {
    let [.., first, second] = *five_axis.axes();
    [first, second].map(|axis| {
        let mut angle_deg = [0.0];
        element.fill_axis(axis, &[s], &mut angle_deg);
        angle_deg[0].to_radians()
    })
}

/// Buffers of one block.
#[derive(Clone, Debug)]
pub(crate) struct OscillationScratch {
    /// Phase, turns.
    turns: Vec<f64>,
    /// Offset in one direction, mm.
    offset: Vec<f64>,
    /// Share of the oscillation, 0 to 1.
    share: Vec<f64>,
    /// ĥ: the feed direction in X and Y, square to the tool axis.
    direction: [Vec<f64>; 2],
    /// c and s: how much of the feed direction lies along ĥ, and along the tool axis.
    slope: [Vec<f64>; 2],
    /// Offsets in the tool's own directions, mm.
    own: [Vec<f64>; 3],
}

impl OscillationScratch {
    pub(crate) fn new() -> Self {
        let column = || vec![0.0; BLOCK_LENGTH];
        Self {
            turns: column(),
            offset: column(),
            share: column(),
            direction: [column(), column()],
            slope: [column(), column()],
            own: [column(), column(), column()],
        }
    }
}

impl OscillationRun {
    /// Amplitudes along the feed, across it and along the tool axis, mm.
    pub(crate) fn amplitudes_mm(&self) -> [f64; 3] {
        let ToolOscillation { feed, cross, axial, .. } = &self.oscillation;
        [feed.amplitude_mm, cross.as_ref().map_or(0.0, |cross| cross.amplitude_mm), axial.amplitude_mm]
    }

    /// The same with all amplitudes multiplied by a share, as they are written. A blend that is as long as the amplitude needs may be
    /// shorter then.
    pub(crate) fn with_amplitudes(&self, share: f64, feed_per_period_mm: f64) -> Self {
        let needed_mm = |run: &Self| ramp_mm(1, feed_per_period_mm, run.oscillation.feed.amplitude_mm, false);
        let mut run = self.clone();
        let plane = core::iter::once(&mut run.oscillation.feed).chain(&mut run.oscillation.cross);
        let written = |motion: &mut DirectionMotion| motion.amplitude_mm = round_down(share * motion.amplitude_mm, 4);
        plane.chain([&mut run.oscillation.axial]).for_each(written);
        if self.ramp_mm <= needed_mm(self) * (1.0 + 1e-9) {
            run.ramp_mm = needed_mm(&run);
        }
        run
    }

    /// Adds the oscillation to the rows from `start` on.
    pub(crate) fn superpose<B: PathBarrier>(
        &self,
        at: &Samples<'_, B>,
        scratch: &mut OscillationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let count = at.s.len();
        let (before_mm, length_mm) = at.track.section_place(at.item);
        self.fill_share(before_mm, length_mm, at.s, &mut scratch.share[..count]);
        if let (Curve::FiveAxis(five_axis), Some(frame)) = (&at.element.curve, &self.frame) {
            self.superpose_guided(at, five_axis, frame, scratch, block, start);
        } else {
            self.superpose_upright(at, scratch, block, start);
        }
    }

    /// Along the feed, across it in the work plane, and along Z.
    fn superpose_upright<B>(
        &self,
        at: &Samples<'_, B>,
        scratch: &mut OscillationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let (columns, count) = (at.columns, at.s.len());
        let angles_deg = &block.spindle_angle_deg[start..start + count];
        let climbs = self.fill_direction_and_phase(at.element, at.s, angles_deg, scratch);
        let OscillationScratch { turns, offset, share, direction: [along_x, along_y], slope, own: [.., axial] } =
            scratch;
        let (turns, offset, share) = (&mut turns[..count], &mut offset[..count], &mut share[..count]);
        let (along_x, along_y) = (&mut along_x[..count], &mut along_y[..count]);

        // Along the feed: c of it in the plane, and s along Z.
        self.fill_offset(&self.oscillation.feed, turns, share, offset);
        block.vibration_offset_mm[start..start + count].copy_from_slice(offset);
        if climbs {
            let [across, along] = slope;
            for (k, value) in offset.iter_mut().enumerate() {
                axial[k] = *value * along[k];
                *value *= across[k];
            }
        }
        for (map, column) in columns.iter().zip(&mut block.axes) {
            let column = &mut column[start..start + count];
            match map.axis {
                Axis::X => add(column, map.sign, offset, along_x),
                Axis::Y => add(column, map.sign, offset, along_y),
                _ => {}
            }
        }
        // Across it, along (x, y, 0) × (0, 0, 1) = (y, −x, 0).
        if let Some(cross) = &self.oscillation.cross {
            self.fill_offset(cross, turns, share, offset);
            for (map, column) in columns.iter().zip(&mut block.axes) {
                let column = &mut column[start..start + count];
                match map.axis {
                    Axis::X => add(column, map.sign, offset, along_y),
                    Axis::Y => add(column, -map.sign, offset, along_x),
                    _ => {}
                }
            }
        }
        // Along the tool axis, positive away from the work.
        self.fill_offset(&self.oscillation.axial, turns, share, offset);
        if climbs {
            for (value, climbed) in offset.iter_mut().zip(&*axial) {
                *value += climbed;
            }
        }
        for (map, column) in columns.iter().zip(&mut block.axes) {
            if map.axis == Axis::Z {
                for (value, offset) in column[start..start + count].iter_mut().zip(&*offset) {
                    *value += map.sign * offset;
                }
            }
        }
    }

    /// For a guided tool: the feed direction is that which the tool sees, and the offsets are along its own directions, which the
    /// linear axes carry out, whatever the rotary ones turn.
    fn superpose_guided<B>(
        &self,
        at: &Samples<'_, B>,
        five_axis: &FiveAxis,
        frame: &ToolFrame,
        scratch: &mut OscillationScratch,
        block: &mut SetpointBlock,
        start: usize,
    ) {
        let Samples { columns, element, s, .. } = *at;
        let count = s.len();
        let OscillationScratch { turns, offset, share, direction: [along_x, along_y], slope, own: [x, y, z] } = scratch;
        let (turns, offset, share) = (&mut turns[..count], &mut offset[..count], &mut share[..count]);
        let rotation = if self.clockwise { 1.0 } else { -1.0 };
        for (k, &s) in s.iter().enumerate() {
            let feed = FeedDirection::of(seen_by_tool(frame, element, five_axis, s));
            ([along_x[k], along_y[k]], slope[0][k], slope[1][k]) = (feed.plane, feed.across, feed.along);
            let feed_turns = -rotation * libm::atan2(along_y[k], along_x[k]) / TAU;
            let spindle_turns = rotation * block.spindle_angle_deg[start + k] / 360.0;
            turns[k] = self.oscillation.phase_turns(spindle_turns, feed_turns);
        }
        self.fill_offset(&self.oscillation.feed, turns, share, offset);
        block.vibration_offset_mm[start..start + count].copy_from_slice(offset);
        for k in 0..count {
            let in_plane_mm = offset[k] * slope[0][k];
            (x[k], y[k], z[k]) = (in_plane_mm * along_x[k], in_plane_mm * along_y[k], offset[k] * slope[1][k]);
        }
        if let Some(cross) = &self.oscillation.cross {
            self.fill_offset(cross, turns, share, offset);
            for k in 0..count {
                x[k] += offset[k] * along_y[k];
                y[k] -= offset[k] * along_x[k];
            }
        }
        self.fill_offset(&self.oscillation.axial, turns, share, offset);
        for (z, offset) in z.iter_mut().zip(&*offset) {
            *z += offset;
        }
        let is_of_work = columns.iter().any(ColumnMap::is_of_work);
        for (k, &s) in s.iter().enumerate() {
            let (own, rotary_rad) = ([x[k], y[k], z[k]], rotary_rad(element, five_axis, s));
            [x[k], y[k], z[k]] = if is_of_work {
                let pose = ToolPose { tip_mm: [0.0; 3], direction: frame.carried(rotary_rad, own) };
                five_axis.setup().to_work(&pose).direction
            } else {
                // The builder refuses poses in which the linear axes do not span space.
                frame.linear_mm(rotary_rad, own).unwrap_or_default()
            };
        }
        let moved = if is_of_work { [Axis::X, Axis::Y, Axis::Z] } else { frame.linear_axes() };
        for (map, column) in columns.iter().zip(&mut block.axes) {
            let Some(place) = moved.iter().position(|&axis| axis == map.axis) else { continue };
            let offsets = [&*x, &*y, &*z][place];
            for (value, offset) in column[start..start + count].iter_mut().zip(offsets) {
                *value += map.sign * offset;
            }
        }
    }

    /// How much of the oscillation there is at every place: 0 at the ends of the section, 1 further inside.
    fn fill_share(&self, before_mm: f64, length_mm: Option<f64>, s: &[f64], share: &mut [f64]) {
        let path = BlendedPath { ramp_mm: self.ramp_mm, before_mm, length_mm };
        if path.is_whole(s) { share.fill(1.0) } else { path.fill_share(s, share) }
    }

    /// The feed direction by its parts, and the phase; whether the feed has a part along the tool axis.
    fn fill_direction_and_phase(
        &self,
        element: &Element,
        s: &[f64],
        angles_deg: &[f64],
        scratch: &mut OscillationScratch,
    ) -> bool {
        let OscillationScratch {
            turns, direction: [along_x, along_y], slope: [across, along], own: [.., rising], ..
        } = scratch;
        let (across, along, rising) = (&mut across[..s.len()], &mut along[..s.len()], &mut rising[..s.len()]);
        let (turns, along_x, along_y) = (&mut turns[..s.len()], &mut along_x[..s.len()], &mut along_y[..s.len()]);
        // The spindle angle counts down where it turns counter-clockwise; azimuths from X to Y are counter-clockwise.
        let rotation = if self.clockwise { 1.0 } else { -1.0 };
        let feed_turns = |x: f64, y: f64| -rotation * libm::atan2(y, x) / TAU;
        if element.curve == Curve::Line {
            let feed = upright(element);
            let [x, y] = feed.plane;
            let feed_turns = feed_turns(x, y);
            along_x.fill(x);
            along_y.fill(y);
            across.fill(feed.across);
            along.fill(feed.along);
            for (turns, angle_deg) in turns.iter_mut().zip(angles_deg) {
                *turns = self.oscillation.phase_turns(rotation * angle_deg / 360.0, feed_turns);
            }
            return feed.along != 0.0;
        }
        if let Curve::Arc(arc) = &element.curve
            && let Some(heading) = Heading::of(arc, element.length)
        {
            for (((x, y), turns), (s, angle_deg)) in
                along_x.iter_mut().zip(along_y).zip(turns).zip(s.iter().zip(angles_deg))
            {
                let heading = heading.start_turns + heading.per_mm * element.evened(*s);
                (*y, *x) = sincos_turns(heading);
                *turns = self.oscillation.phase_turns(rotation * angle_deg / 360.0, -rotation * heading);
            }
            // A helix climbs evenly.
            let feed = upright(element);
            across.fill(feed.across);
            along.fill(feed.along);
            return feed.along != 0.0;
        }
        element.fill_tangent(Axis::X, s, along_x);
        element.fill_tangent(Axis::Y, s, along_y);
        element.fill_tangent(Axis::Z, s, rising);
        let mut climbs = false;
        for (k, angle_deg) in angles_deg.iter().enumerate() {
            let feed = FeedDirection::of([along_x[k], along_y[k], rising[k]]);
            [along_x[k], along_y[k]] = feed.plane;
            (across[k], along[k]) = (feed.across, feed.along);
            climbs |= feed.along != 0.0;
            turns[k] = self.oscillation.phase_turns(rotation * angle_deg / 360.0, feed_turns(along_x[k], along_y[k]));
        }
        climbs
    }

    fn fill_offset(&self, motion: &DirectionMotion, turns: &mut [f64], share: &[f64], offset: &mut [f64]) {
        motion.fill_offset_mm(turns, offset);
        for (offset, share) in offset.iter_mut().zip(share) {
            *offset *= share;
        }
    }
}

/// Change of the angle outwards along an arc that its heading leaves out, rad.
const EVEN_RAD: f64 = 1e-11;

/// Azimuth of the path on an arc in the work plane, turns from X to Y: it changes evenly.
struct Heading {
    start_turns: f64,
    per_mm: f64,
}

impl Heading {
    /// `None` for an arc in another plane, and where the radius changes by more than rounding of the program: the path then does not
    /// go outwards by the same angle everywhere.
    fn of(arc: &Arc, length_mm: f64) -> Option<Self> {
        let outwards_mm = arc.end_radius_mm - arc.start_radius_mm;
        let least_mm = arc.start_radius_mm.min(arc.end_radius_mm);
        let is_even = outwards_mm * outwards_mm <= EVEN_RAD * arc.sweep_rad.abs() * least_mm * least_mm;
        if (arc.first, arc.second) != (Axis::X, Axis::Y) || !is_even {
            return None;
        }
        let around_mm = 0.5 * (arc.start_radius_mm + arc.end_radius_mm) * arc.sweep_rad.abs();
        let outwards_rad = libm::atan2(outwards_mm, around_mm);
        let side = arc.sweep_rad.signum();
        let start_rad = arc.start_angle_rad + side * (0.25 * TAU - outwards_rad);
        Some(Self { start_turns: start_rad / TAU, per_mm: arc.sweep_rad / TAU / length_mm })
    }
}

fn add(column: &mut [f64], sign: f64, offset: &[f64], direction: &[f64]) {
    for ((value, offset), direction) in column.iter_mut().zip(offset).zip(direction) {
        *value += sign * (offset * direction);
    }
}

/// The feed direction of a tool that stands along Z, where the element starts.
fn upright(element: &Element) -> FeedDirection {
    let tangent = element.tangent(0.0);
    FeedDirection::of([Axis::X, Axis::Y, Axis::Z].map(|axis| tangent[axis.index()]))
}
