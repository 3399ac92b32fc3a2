//! What every edge removes, in planes through the tool axis (docs/functions/tool-oscillation.md, "Report").
//!
//! In the plane at azimuth β (from the feed direction, in the direction of rotation) a pass of an edge clears everything
//! behind its front and above its end. Fronts lie at
//!
//! ```text
//! x_j = c·(feed·turns_j + u)·cos β ± y·sin β + radial set-over,     z_j = w − axial set-over
//! ```
//!
//! measured from the nominal radius about the commanded centre at the first edge's pass, z above the commanded end of the
//! tool. On a path inclined by γ, c = cos γ of the feed and of u is across the tool. Their parts along the axis do not count: heights are
//! above the inclined path, which u never leaves, and so a revolution is as the one before there, too. The tool's turning by β while the centre goes on moves every front alike and the slight turn of the radius by
//! the offsets is of second order (u²/2R, 1 µm at 0.4 mm and R = 60 mm); both are left out. As everything repeats with the revolution, the
//! front that a pass meets is the foremost of the last passes that went at least as deep: no steps in time are needed.

use super::{ToolGeometry, ToolOffset, ToolOscillation};

/// Planes in which the engagement is examined.
const PLANES: u32 = 180;
/// Lengths below this do not count as cut, mm.
const NOTHING_MM: f64 = 1e-9;
/// Ends of edges that differ by less lie equally deep, mm.
const SAME_DEPTH_MM: f64 = 1e-6;

/// How the tool is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationCut {
    /// Feed, mm/min.
    pub feed_mm_per_min: f64,
    /// Spindle speed, rev/min.
    pub spindle_rev_per_min: f64,
    /// Whether the spindle turns clockwise (`M3`), seen from the spindle to the work.
    pub clockwise: bool,
    /// Height of the work's surface above the commanded end of the tool, mm.
    pub depth_mm: f64,
    /// Azimuths between which the tool is in the work, degrees from the feed direction in the direction of rotation, within
    /// ±90: a full slot is −90 to 90.
    pub engagement_deg: [f64; 2],
    /// Inclination of the path to the plane square to the tool axis, degrees, 0 to less than 90: 0 on a level cut.
    pub incline_deg: f64,
}

impl OscillationCut {
    /// Feed per revolution, mm.
    #[must_use]
    pub fn feed_per_rev_mm(&self) -> f64 {
        self.feed_mm_per_min / self.spindle_rev_per_min
    }

    /// How much of the path is across the tool: the cosine of the inclination.
    #[must_use]
    pub fn share_across(&self) -> f64 {
        libm::cos(self.incline_deg.to_radians())
    }
}

/// A rectangle of material that an edge removes in one revolution, in a plane through the tool axis, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemovedLayer {
    /// Lower end above the commanded end of the tool.
    pub low_mm: f64,
    /// Upper end.
    pub high_mm: f64,
    /// Front that the edge meets.
    pub from_mm: f64,
    /// Front that it leaves.
    pub to_mm: f64,
}

impl RemovedLayer {
    /// Area, mm².
    #[must_use]
    pub fn area_mm2(&self) -> f64 {
        (self.high_mm - self.low_mm) * (self.to_mm - self.from_mm)
    }
}

/// One edge's pass through a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgePass {
    /// Offset of the tool at the pass.
    pub offset: ToolOffset,
    /// Position of the edge along the plane, mm.
    pub front_mm: f64,
    /// Its end above the commanded end of the tool, mm.
    pub end_mm: f64,
    /// What it removes, from below.
    pub layers: Vec<RemovedLayer>,
    /// Height of material that meets the tool above the edge, mm.
    pub above_edge_mm: f64,
}

/// What one edge does in a revolution.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeReport {
    /// Edge, counted from 1.
    pub edge: u32,
    /// Phase of the oscillation while it points in the feed direction, degrees.
    pub phase_deg: f64,
    /// Offset in the feed direction then, mm.
    pub feed_offset_mm: f64,
    /// Axial offset then, mm, positive retracted.
    pub retraction_mm: f64,
    /// Offset across then, mm.
    pub cross_offset_mm: f64,
    /// Its front along the plane of the layers, mm, from the commanded centre at the first edge's pass plus the radius.
    pub front_mm: f64,
    /// What it removes in the plane of feed and axis, from below; where that plane is not in the work, in the nearest one
    /// that is.
    pub layers: Vec<RemovedLayer>,
    /// Area of that, mm².
    pub area_mm2: f64,
    /// Largest chip thickness over the engagement, mm.
    pub max_chip_mm: f64,
    /// Azimuth (degrees) and chip thickness (mm) over the engagement.
    pub chip_over_angle: Vec<[f64; 2]>,
    /// Share of the removed volume.
    pub volume_share: f64,
    /// Share of the revolution during which it cuts.
    pub duty: f64,
    /// Whether it leaves the floor behind it in the plane of the layers.
    pub finishes: bool,
}

/// Passes of all edges through the plane at `azimuth_deg`, in the steady state.
#[must_use]
pub fn plane_section(
    tool: &ToolGeometry,
    oscillation: &ToolOscillation,
    cut: &OscillationCut,
    azimuth_deg: f64,
) -> Vec<EdgePass> {
    let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
    // Clockwise rotation turns from the feed direction to its right, which is feed direction × tool axis.
    let across = if cut.clockwise { sin } else { -sin };
    let share_across = cut.share_across();
    let per_rev_mm = cut.feed_per_rev_mm() * share_across;
    let mut passes: Vec<EdgePass> = tool
        .edges
        .iter()
        .enumerate()
        .map(|(index, edge)| {
            let offset = oscillation.offset(oscillation.phase_turns((edge.angle_deg + azimuth_deg) / 360.0, 0.0));
            let progress_mm = per_rev_mm * tool.turns_behind_first(index);
            EdgePass {
                offset,
                front_mm: (progress_mm + offset.feed_mm * share_across) * cos
                    + offset.cross_mm * across
                    + edge.radial_set_over_mm,
                end_mm: offset.retraction_mm - edge.axial_set_over_mm,
                layers: Vec::new(),
                above_edge_mm: 0.0,
            }
        })
        .collect();
    let height_mm = tool.axial_edge_height_mm;
    let ends = passes.iter().flat_map(|pass| [pass.end_mm, pass.end_mm + height_mm]);
    let mut levels: Vec<f64> = ends.chain([cut.depth_mm]).filter(|&level| level <= cut.depth_mm).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup_by(|a, b| *a - *b < NOTHING_MM);
    let cuts = |pass: &EdgePass, low: f64, high: f64| {
        pass.end_mm <= low + NOTHING_MM && high <= pass.end_mm + height_mm + NOTHING_MM
    };
    let advance_mm = per_rev_mm * cos;
    for index in 0..passes.len() {
        for level in levels.windows(2) {
            let (low_mm, high_mm) = (level[0], level[1]);
            let met = passes.iter().enumerate().filter(|(_, pass)| cuts(pass, low_mm, high_mm));
            // Edges that come later in the revolution passed one feed further back.
            let met = met.map(|(other, pass)| if other < index { pass.front_mm } else { pass.front_mm - advance_mm });
            let from_mm = met.fold(f64::NEG_INFINITY, f64::max);
            let pass = &passes[index];
            let to_mm = pass.front_mm;
            if cuts(pass, low_mm, high_mm) {
                if to_mm > from_mm + NOTHING_MM {
                    passes[index].layers.push(RemovedLayer { low_mm, high_mm, from_mm, to_mm });
                }
            } else if pass.end_mm <= low_mm && to_mm > from_mm + NOTHING_MM {
                passes[index].above_edge_mm += high_mm - low_mm;
            }
        }
    }
    passes
}

/// What every edge does, over the whole engagement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Removal {
    /// Azimuth of the plane of the layers, degrees.
    pub(super) plane_deg: f64,
    pub(super) edges: Vec<EdgeReport>,
    /// Largest height of material that meets the tool above an edge, mm.
    pub(super) above_edge_mm: f64,
    /// Removed volume per revolution, mm³.
    pub(super) volume_mm3: f64,
}

pub(super) fn removal(tool: &ToolGeometry, oscillation: &ToolOscillation, cut: &OscillationCut) -> Removal {
    let [first_deg, last_deg] = cut.engagement_deg;
    let plane_deg = 0.0f64.max(first_deg).min(last_deg);
    let ahead = plane_section(tool, oscillation, cut, plane_deg);
    let deepest_mm = ahead.iter().map(|pass| pass.end_mm).fold(f64::INFINITY, f64::min);
    let mut above_edge_mm = ahead.iter().map(|pass| pass.above_edge_mm).fold(0.0, f64::max);
    let mut edges: Vec<EdgeReport> = (0u32..)
        .zip(ahead)
        .map(|(index, pass)| {
            let phase_turns = oscillation.phase_of_edge(tool, index as usize);
            (index, phase_turns, oscillation.offset(phase_turns), pass)
        })
        .map(|(index, phase_turns, offset, pass)| EdgeReport {
            edge: index + 1,
            phase_deg: 360.0 * phase_turns,
            feed_offset_mm: offset.feed_mm,
            retraction_mm: offset.retraction_mm,
            cross_offset_mm: offset.cross_mm,
            front_mm: pass.front_mm,
            area_mm2: pass.layers.iter().map(RemovedLayer::area_mm2).sum(),
            finishes: pass.end_mm <= deepest_mm + SAME_DEPTH_MM,
            layers: pass.layers,
            max_chip_mm: 0.0,
            chip_over_angle: Vec::with_capacity(PLANES as usize),
            volume_share: 0.0,
            duty: 0.0,
        })
        .collect();
    let step_deg = (last_deg - first_deg) / f64::from(PLANES);
    let mut volume_mm3 = 0.0;
    for plane in 0..PLANES {
        let azimuth_deg = first_deg + (f64::from(plane) + 0.5) * step_deg;
        for (edge, pass) in edges.iter_mut().zip(plane_section(tool, oscillation, cut, azimuth_deg)) {
            let chip_mm = pass.layers.iter().map(|layer| layer.to_mm - layer.from_mm).fold(0.0, f64::max);
            let area_mm2: f64 = pass.layers.iter().map(RemovedLayer::area_mm2).sum();
            let part_mm3 = area_mm2 * tool.radius_mm * step_deg.to_radians();
            edge.max_chip_mm = edge.max_chip_mm.max(chip_mm);
            edge.chip_over_angle.push([azimuth_deg, chip_mm]);
            edge.volume_share += part_mm3;
            edge.duty += if chip_mm > 0.0 { step_deg / 360.0 } else { 0.0 };
            volume_mm3 += part_mm3;
            above_edge_mm = above_edge_mm.max(pass.above_edge_mm);
        }
    }
    for edge in &mut edges {
        edge.volume_share = if volume_mm3 > 0.0 { edge.volume_share / volume_mm3 } else { 0.0 };
    }
    Removal { plane_deg, edges, above_edge_mm, volume_mm3 }
}
