//! The floor that the ends of the edges leave, as a height field.
//!
//! The end of an edge is a radial line from R − b to R. On a row of cells (constant distance across the feed) each pass
//! sweeps one interval, once with its front and once with its trailing half; place and height along it follow from where
//! the edge crosses the row, so that a pass costs one run over neighbouring cells. In the steady state a pass
//! is that of the revolution before, one feed further on, so that it is computed once for each row. The lowest pass stays.

use core::f64::consts::{PI, TAU};

use super::{OscillationCut, ToolGeometry, ToolOscillation};

/// Most cells of a height field.
pub const MAX_FLOOR_CELLS: usize = 32_000_000;
/// Most runs over cells of a row, so that a tiny feed does not take for ever.
const MAX_PASSES_PER_ROW: f64 = 20_000.0;
/// Angle that an edge turns at most between two places at which its crossing of a row is computed, rad.
const KNOT_RAD: f64 = 0.01;
/// Most of those places.
const MAX_KNOTS: usize = 64;
/// Tolerance for the rounding of computed lengths.
const ROUNDING: f64 = 1e-9;
/// Height of a cell that no edge has swept.
const UNTOUCHED: f32 = f32::INFINITY;

/// The part of the floor that is simulated: `length_mm` along the feed, `width_mm` across it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorArea {
    /// Along the feed, mm.
    pub length_mm: f64,
    /// Across the feed, mm.
    pub width_mm: f64,
    /// Middle of the width from the path of the tool's centre, mm, positive to the right of the feed; the area must lie
    /// within the tool's diameter.
    pub across_mm: f64,
    /// Size of a square cell, mm.
    pub resolution_mm: f64,
    /// Whether the trailing half of the tool cuts as well; not where the spindle is tilted.
    pub trailing: bool,
}

/// Why a floor is not simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FloorError {
    /// A length is not positive, or the tool does not sweep the whole area.
    #[error("length, width and resolution of the floor must be positive, and the area within the tool's diameter")]
    Size,
    /// The path is not square to the tool axis: with the whole end of the tool tilted to it, one half leaves the floor.
    #[error("the path is inclined by {0:.1} degrees, a floor is simulated where it is square to the tool axis")]
    Inclined(f64),
    /// More cells than [`MAX_FLOOR_CELLS`].
    #[error("the floor has {0:.0} cells, at most {MAX_FLOOR_CELLS} are simulated: use a coarser resolution")]
    Cells(f64),
    /// The edges pass too often.
    #[error(
        "{0:.0} passes of an edge cross a row, at most {MAX_PASSES_PER_ROW} are simulated: simulate a shorter strip"
    )]
    Passes(f64),
}

/// Roughness of a floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    /// Peak to valley (Rz of the whole area), mm.
    pub peak_to_valley_mm: f64,
    /// Mean distance from the mean height (Ra), mm.
    pub mean_mm: f64,
    /// Mean height above the commanded end of the tool, mm.
    pub height_mm: f64,
    /// Share of the cells that no end of an edge sweeps: what is left there is not known to be cut to depth.
    pub unswept_share: f64,
}

/// The floor as heights above the commanded end of the tool.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// Cells along the feed.
    pub columns: usize,
    /// Cells across it.
    pub rows: usize,
    /// Size of a cell, mm.
    pub resolution_mm: f64,
    /// Heights row by row, mm; infinite where nothing swept.
    pub heights_mm: Vec<f32>,
}

impl HeightField {
    /// The floor in the steady state.
    ///
    /// # Errors
    /// [`FloorError`] where the area is impossible or too large.
    pub fn simulate(
        tool: &ToolGeometry,
        oscillation: &ToolOscillation,
        cut: &OscillationCut,
        area: &FloorArea,
    ) -> Result<Self, FloorError> {
        let FloorArea { length_mm, width_mm, across_mm, resolution_mm, .. } = *area;
        let is_possible = resolution_mm > 0.0 && length_mm >= resolution_mm && width_mm >= resolution_mm;
        let reach_mm = across_mm.abs() + 0.5 * width_mm;
        if !(is_possible && reach_mm <= tool.radius_mm * (1.0 + ROUNDING) && length_mm.is_finite()) {
            return Err(FloorError::Size);
        }
        if cut.incline_deg != 0.0 {
            return Err(FloorError::Inclined(cut.incline_deg));
        }
        let cells_along = (length_mm / resolution_mm * (1.0 + ROUNDING)).floor();
        let cells_across = (width_mm / resolution_mm * (1.0 + ROUNDING)).floor();
        if cells_along * cells_across > MAX_FLOOR_CELLS as f64 {
            return Err(FloorError::Cells(cells_along * cells_across));
        }
        let per_rev_mm = cut.feed_per_rev_mm();
        let passes = (length_mm + tool.radius_mm) / per_rev_mm * tool.edges.len() as f64;
        if passes.is_nan() || passes > MAX_PASSES_PER_ROW {
            return Err(FloorError::Passes(passes));
        }
        let (columns, rows) = (cells_along as usize, cells_across as usize);
        let mut heights_mm = vec![UNTOUCHED; columns * rows];
        let mut sweep = Sweep::new(tool, oscillation, cut, resolution_mm);
        for (row, cells) in heights_mm.chunks_exact_mut(columns).enumerate() {
            let from_middle_mm = (row as f64 + 0.5 - 0.5 * cells_across) * resolution_mm;
            sweep.row(across_mm + from_middle_mm, area.trailing, cells);
        }
        Ok(Self { columns, rows, resolution_mm, heights_mm })
    }

    /// Roughness over the whole field. Cells that nothing swept do not count.
    #[must_use]
    pub fn roughness(&self) -> Roughness {
        let (mut low, mut high, mut sum, mut swept) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0u64);
        for &height in self.heights_mm.iter().filter(|height| height.is_finite()) {
            let height = f64::from(height);
            low = low.min(height);
            high = high.max(height);
            sum += height;
            swept += 1;
        }
        if swept == 0 {
            return Roughness { peak_to_valley_mm: 0.0, mean_mm: 0.0, height_mm: 0.0, unswept_share: 1.0 };
        }
        let height_mm = sum / swept as f64;
        let swept_heights = self.heights_mm.iter().filter(|height| height.is_finite());
        let distances: f64 = swept_heights.map(|&height| (f64::from(height) - height_mm).abs()).sum();
        Roughness {
            peak_to_valley_mm: high - low,
            mean_mm: distances / swept as f64,
            height_mm,
            unswept_share: 1.0 - swept as f64 / self.heights_mm.len() as f64,
        }
    }
}

/// Place along the feed and height of a point of an edge's end on a row, mm.
#[derive(Clone, Copy, Debug, Default)]
struct Knot {
    along_mm: f64,
    height_mm: f64,
}

struct Sweep<'a> {
    tool: &'a ToolGeometry,
    oscillation: &'a ToolOscillation,
    per_rev_mm: f64,
    /// 1 where azimuths turn to the right of the feed, which is the positive direction across.
    side: f64,
    rise: f64,
    resolution_mm: f64,
    /// Where every edge crosses the row, with the front and the trailing half.
    crossings: Vec<Crossing>,
}

/// Where the end of an edge crosses a row in one revolution: from the inside to the outside.
#[derive(Clone, Debug, Default)]
struct Crossing {
    knots: Vec<Knot>,
    /// Ends along the feed, mm.
    along_mm: [f64; 2],
    /// Lowest and highest point, mm.
    height_mm: [f64; 2],
}

impl Crossing {
    fn measure(&mut self) {
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        (self.along_mm, self.height_mm) = (nothing, nothing);
        for knot in &self.knots {
            self.along_mm = [self.along_mm[0].min(knot.along_mm), self.along_mm[1].max(knot.along_mm)];
            self.height_mm = [self.height_mm[0].min(knot.height_mm), self.height_mm[1].max(knot.height_mm)];
        }
    }
}

impl<'a> Sweep<'a> {
    fn new(tool: &'a ToolGeometry, oscillation: &'a ToolOscillation, cut: &OscillationCut, resolution_mm: f64) -> Self {
        Self {
            tool,
            oscillation,
            per_rev_mm: cut.feed_per_rev_mm(),
            side: if cut.clockwise { 1.0 } else { -1.0 },
            rise: libm::tan(tool.end_relief_deg.to_radians()),
            resolution_mm,
            crossings: vec![Crossing::default(); 2 * tool.edges.len()],
        }
    }

    /// Lowers the cells of a row to what all passes leave.
    fn row(&mut self, across_mm: f64, trailing: bool, cells: &mut [f32]) {
        let mut crossings = std::mem::take(&mut self.crossings);
        for (index, crossing) in crossings.iter_mut().enumerate() {
            let is_trailing = index % 2 == 1;
            crossing.knots.clear();
            if trailing || !is_trailing {
                self.find_knots(index / 2, across_mm, is_trailing, &mut crossing.knots);
            }
            crossing.measure();
        }
        // A crossing longer than the feed closes the row by itself: what lies wholly above it need not be examined.
        let closes = |crossing: &&Crossing| {
            crossing.along_mm[1] - crossing.along_mm[0] >= self.per_rev_mm + 2.0 * self.resolution_mm
        };
        let ceiling_mm =
            crossings.iter().filter(closes).map(|crossing| crossing.height_mm[1]).fold(f64::INFINITY, f64::min);
        let mut is_closed = false;
        for crossing in &crossings {
            let is_level = crossing.height_mm == [ceiling_mm; 2] && closes(&crossing);
            if crossing.height_mm[0] < ceiling_mm || (is_level && !is_closed) {
                is_closed |= is_level;
                self.stamp_all(crossing, cells);
            }
        }
        self.crossings = crossings;
    }

    /// Lowers the cells of a row to what an edge leaves in all revolutions.
    fn stamp_all(&self, crossing: &Crossing, cells: &mut [f32]) {
        let length_mm = cells.len() as f64 * self.resolution_mm;
        let first_rev = (-crossing.along_mm[1] / self.per_rev_mm).ceil();
        let revs = ((length_mm - crossing.along_mm[0]) / self.per_rev_mm).floor() - first_rev;
        // Both were bounded before anything was simulated.
        for rev in 0..=(revs.max(-1.0) + 1.0) as u32 {
            let shift_mm = (first_rev + f64::from(rev)) * self.per_rev_mm;
            for pair in crossing.knots.windows(2) {
                stamp(pair[0], pair[1], shift_mm, self.resolution_mm, cells);
            }
        }
    }

    /// Where the edge's end crosses the row, from the inside to the outside, in the revolution in which it passes the feed
    /// direction after the first edge does.
    fn find_knots(&self, edge: usize, across_mm: f64, trailing: bool, knots: &mut Vec<Knot>) {
        let cutting_edge = &self.tool.edges[edge];
        let outer_mm = self.tool.radius_mm + cutting_edge.radial_set_over_mm;
        let inner_mm = outer_mm - self.tool.radial_edge_length_mm;
        let base_turns = cutting_edge.angle_deg / 360.0;
        let progress_mm = self.per_rev_mm * self.tool.turns_behind_first(edge);
        let azimuth = |radius_mm: f64, centre_mm: f64| {
            let angle = libm::asin(((across_mm - centre_mm) * self.side / radius_mm).clamp(-1.0, 1.0));
            if trailing { PI - angle } else { angle }
        };
        let knot = |radius_mm: f64| {
            let mut azimuth_rad = azimuth(radius_mm, 0.0);
            let mut offset = self.oscillation.offset(self.oscillation.phase_turns(base_turns + azimuth_rad / TAU, 0.0));
            if self.oscillation.cross.is_some() {
                // The centre moves across by much less than the radius: this contracts quickly.
                for _ in 0..3 {
                    azimuth_rad = azimuth(radius_mm, offset.cross_mm);
                    let turns = base_turns + azimuth_rad / TAU;
                    offset = self.oscillation.offset(self.oscillation.phase_turns(turns, 0.0));
                }
            }
            let centre_mm = progress_mm + self.per_rev_mm * azimuth_rad / TAU + offset.feed_mm;
            Knot {
                along_mm: centre_mm + radius_mm * libm::cos(azimuth_rad),
                height_mm: offset.retraction_mm - cutting_edge.axial_set_over_mm + (outer_mm - radius_mm) * self.rise,
            }
        };
        // A row that the inner end never reaches is crossed from where the edge lies along it.
        let beside_turns = base_turns + (0.25 * self.side).copysign(across_mm * self.side);
        let beside = self.oscillation.offset(self.oscillation.phase_turns(beside_turns, 0.0));
        let least_mm = inner_mm.max((across_mm - beside.cross_mm).abs());
        if least_mm >= outer_mm {
            return;
        }
        let turned = (azimuth(outer_mm, beside.cross_mm) - azimuth(least_mm, beside.cross_mm)).abs();
        let intervals = ((turned / KNOT_RAD).ceil() as usize).clamp(1, MAX_KNOTS);
        for index in 0..=intervals {
            // Near the rim of a row the azimuth changes with the root of the radius: denser knots there.
            let share = index as f64 / intervals as f64;
            let share = if intervals > 1 { share * share } else { share };
            let radius_mm = least_mm + share * (outer_mm - least_mm);
            knots.push(knot(radius_mm));
        }
    }
}

/// Lowers the cells between two knots to the line between them.
fn stamp(from: Knot, to: Knot, shift_mm: f64, resolution_mm: f64, cells: &mut [f32]) {
    let (from, to) = if from.along_mm <= to.along_mm { (from, to) } else { (to, from) };
    let (start_mm, end_mm) = (from.along_mm + shift_mm, to.along_mm + shift_mm);
    // Cells whose middles lie within.
    let first = (start_mm / resolution_mm - 0.5).ceil().max(0.0);
    let last = (end_mm / resolution_mm - 0.5).floor().min(cells.len() as f64 - 1.0);
    if first > last {
        return;
    }
    let slope = if end_mm > start_mm { (to.height_mm - from.height_mm) / (end_mm - start_mm) } else { 0.0 };
    let height = from.height_mm + slope * ((first + 0.5) * resolution_mm - start_mm);
    let (height, per_cell) = (height as f32, (slope * resolution_mm) as f32);
    let run = &mut cells[first as usize..=last as usize];
    if per_cell == 0.0 {
        for cell in run {
            *cell = cell.min(height);
        }
        return;
    }
    for (index, cell) in run.iter_mut().enumerate() {
        // A field is less than 2²⁴ cells long, exact in an f32, and `u32` converts by vector instructions.
        let here = height + per_cell * index as u32 as f32;
        *cell = cell.min(here);
    }
}
