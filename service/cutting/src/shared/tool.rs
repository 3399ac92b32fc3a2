//! A tool: its length and speed, where its cutting edges are and how far they reach.

use feedwave_program::ToolOffset;
use serde::{Deserialize, Serialize};

/// What validation needs to know of a tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Number of the `T` word.
    pub number: u32,
    /// Name for people.
    #[serde(default)]
    pub name: String,
    /// Highest permitted spindle speed, rev/min.
    #[serde(default)]
    pub max_rev_per_min: Option<f64>,
    /// Its row in the table of tool offsets: what `H` and `D` with the number of the tool mean. The row has the tool's number,
    /// whatever is stated here.
    #[serde(default)]
    pub offset: ToolOffset,
    /// Its cutting edges, which oscillation needs.
    #[serde(default)]
    pub geometry: Option<ToolGeometry>,
}

/// Most cutting edges of a tool.
pub const MAX_EDGES: usize = 64;

/// One cutting edge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CuttingEdge {
    /// Spindle angle, in the direction of rotation from the spindle's zero, at which the edge points in the work plane's
    /// first direction (+X in `G17`), degrees.
    pub angle_deg: f64,
    /// By how much it protrudes beyond the nominal radius, mm.
    #[serde(default)]
    pub radial_set_over_mm: f64,
    /// By how much it protrudes below the nominal end of the tool, mm.
    #[serde(default)]
    pub axial_set_over_mm: f64,
    /// Whether it is meant for finishing, where the tool data say so.
    #[serde(default)]
    pub finishing: bool,
}

/// A rotary tool with several cutting edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolGeometry {
    /// The edges in the order in which they pass one place: 1 to [`MAX_EDGES`].
    pub edges: Vec<CuttingEdge>,
    /// Nominal radius R, mm.
    pub radius_mm: f64,
    /// Effective radial length of an edge b: its end cuts from R − b to R, mm.
    pub radial_edge_length_mm: f64,
    /// Effective axial height of an edge, mm.
    pub axial_edge_height_mm: f64,
    /// Angle by which the end of an edge rises towards the axis, degrees; 0 for a wiper.
    #[serde(default)]
    pub end_relief_deg: f64,
}

/// A value of the tool that is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the tool's {name} must be {range}, is {value}{unit}")]
pub struct ToolError {
    /// Which value.
    pub name: &'static str,
    /// What it may be.
    pub range: &'static str,
    /// What it is.
    pub value: f64,
    /// Its unit with a space before it, or nothing.
    pub unit: &'static str,
}

impl ToolGeometry {
    /// A tool with `edges` equal edges, the first at the spindle's zero. What is impossible is found by
    /// [`ToolGeometry::check`].
    #[must_use]
    pub fn even(edges: usize, radius_mm: f64, radial_edge_length_mm: f64, axial_edge_height_mm: f64) -> Self {
        let edges = edges.min(MAX_EDGES);
        let edge = |index: usize| CuttingEdge {
            angle_deg: 360.0 * index as f64 / edges as f64,
            radial_set_over_mm: 0.0,
            axial_set_over_mm: 0.0,
            finishing: false,
        };
        Self {
            edges: (0..edges).map(edge).collect(),
            radius_mm,
            radial_edge_length_mm,
            axial_edge_height_mm,
            end_relief_deg: 0.0,
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that is out of its range.
    pub fn check(&self) -> Result<(), ToolError> {
        self.problems().into_iter().next().map_or(Ok(()), |(_, error)| Err(error))
    }

    /// Every value that is out of its range, with the path of its field.
    #[must_use]
    pub fn problems(&self) -> Vec<(String, ToolError)> {
        let mut problems = Vec::new();
        let mut require = |holds: bool, field: String, name, range, value: f64, unit| {
            if !holds {
                problems.push((field, ToolError { name, range, value, unit }));
            }
        };
        let count = self.edges.len();
        require((1..=MAX_EDGES).contains(&count), "edges".to_owned(), "number of edges", "1 to 64", count as f64, "");
        let (radius, length, height) = (self.radius_mm, self.radial_edge_length_mm, self.axial_edge_height_mm);
        let range = "positive and at most 1000 mm";
        require(radius > 0.0 && radius <= 1_000.0, "radius_mm".to_owned(), "radius", range, radius, " mm");
        let is_length = length > 0.0 && length <= radius;
        let length_range = "positive and at most the radius";
        require(is_length, "radial_edge_length_mm".to_owned(), "radial edge length", length_range, length, " mm");
        let is_height = height > 0.0 && height <= 1_000.0;
        require(is_height, "axial_edge_height_mm".to_owned(), "axial edge height", range, height, " mm");
        let relief = self.end_relief_deg;
        let is_relief = (0.0..=45.0).contains(&relief);
        require(is_relief, "end_relief_deg".to_owned(), "end relief", "0 to 45 degrees", relief, " degrees");
        let mut before = f64::NEG_INFINITY;
        let first = self.edges.first().map_or(0.0, |edge| edge.angle_deg);
        // More edges than there may be are one problem.
        for (index, edge) in self.edges.iter().enumerate().take(MAX_EDGES) {
            let angle = edge.angle_deg;
            let in_order = angle >= before + 0.01 && angle <= first + 359.99;
            let range = "within 0 and 360 degrees and at least 0.01 beyond that of the edge before";
            let holds = (0.0..360.0).contains(&angle) && in_order;
            require(holds, format!("edges[{index}].angle_deg"), "edge angle", range, angle, " degrees");
            before = angle;
            for (field, name, set_over_mm) in [
                ("radial_set_over_mm", "radial set-over", edge.radial_set_over_mm),
                ("axial_set_over_mm", "axial set-over", edge.axial_set_over_mm),
            ] {
                let holds = set_over_mm.abs() <= 0.5 * length.min(height);
                let range = "at most half an edge's length and height";
                require(holds, format!("edges[{index}].{field}"), name, range, set_over_mm, " mm");
            }
        }
        problems
    }

    /// Number of edges z.
    #[must_use]
    pub fn edge_count(&self) -> u32 {
        self.edges.len() as u32
    }

    /// Angle of an edge behind the first one, turns.
    #[must_use]
    pub fn turns_behind_first(&self, edge: usize) -> f64 {
        (self.edges[edge].angle_deg - self.edges[0].angle_deg) / 360.0
    }

    /// Largest angle between two edges that follow each other, turns: 1/z where they are even.
    #[must_use]
    pub fn widest_gap_turns(&self) -> f64 {
        let count = self.edges.len();
        let gap = |index: usize| {
            let to_next = self.edges[(index + 1) % count].angle_deg - self.edges[index].angle_deg;
            if index + 1 == count { to_next + 360.0 } else { to_next }
        };
        (0..count).map(gap).fold(0.0, f64::max) / 360.0
    }
}
