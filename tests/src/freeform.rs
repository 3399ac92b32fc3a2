//! A freeform program as CAM systems write it: a gently concave surface cut into triangles within a tolerance, a block
//! where the path crosses a triangle edge, the tool direction averaged over the two triangles at the edge.

type Vector = [f64; 3];

/// Lead of the tool against the normal, rad: finishing cuts keep off the pole, where the table axis would be free.
const LEAD_RAD: f64 = 0.35;
/// The modeller's tolerance: nodes of the mesh are off the surface by half of it at most, mm.
const MESH_TOLERANCE_MM: f64 = 0.0016;
/// Radius of the bowl along the passes, mm.
const RADIUS_MM: f64 = 200.0;
/// Share of that curvature across the passes.
const CROSSWISE: f64 = 0.7;

/// How far above the surface the tool goes from pass to pass, mm.
const CLEARANCE_MM: f64 = 3.0;

/// How the program gives tool directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directions {
    /// `G43.4`: angles of an A/C trunnion table.
    Angles,
    /// `G43.5`: vectors.
    Vectors,
}

/// A finishing program over a rectangle of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Freeform {
    /// Extent along the passes, mm.
    pub length_mm: f64,
    /// Extent across them, mm.
    pub width_mm: f64,
    /// Side of the squares, of two triangles each, mm.
    pub mesh_mm: f64,
    /// Passes, to and fro.
    pub passes: u32,
    /// How directions are given.
    pub directions: Directions,
}

impl Freeform {
    /// The program, line by line, with thinning on during the passes and rapids over the work between them.
    pub fn lines(self) -> impl Iterator<Item = String> {
        let on = match self.directions {
            Directions::Angles => "G43.4 H1",
            Directions::Vectors => "G43.5 H1",
        };
        let [a_deg, c_deg] = angles_deg(self.point(0, 0).1);
        let header = [
            "%\n".to_owned(),
            "O1526 (FREEFORM SURFACE, FINISHING, 5 AXES)\n".to_owned(),
            "G21 G17 G90 G94 G54\n".to_owned(),
            "T1 M6\n".to_owned(),
            "S12000 M3\n".to_owned(),
            format!("G0 A{a_deg:.4} C{c_deg:.4}\n"),
            format!("{on}\n"),
            format!("G0 {} Z60.\n", self.words(&self.point(0, 0), "XY")),
            "M33\n".to_owned(),
        ];
        let footer = ["M34\n", "G49\n", "G91 G28 Z0.\n", "M30\n", "%\n"].map(str::to_owned);
        let passes = (0..self.passes).flat_map(move |pass| self.pass(pass));
        header.into_iter().chain(passes).chain(footer)
    }

    /// One pass: over its start, down, along the surface, up.
    fn pass(self, pass: u32) -> impl Iterator<Item = String> {
        let steps = 2 * self.cells();
        let (first, last) = (self.point(pass, 0), self.point(pass, steps - 1));
        let way_in = [
            format!("G0 {} Z{:.4}\n", self.words(&first, "XY"), first.0[2] + CLEARANCE_MM),
            format!("G1 Z{:.4} F800.\n", first.0[2]),
        ];
        let blocks = (1..steps).map(move |step| {
            let feed = if step == 1 { " F3000." } else { "" };
            format!("{}{feed}\n", self.words(&self.point(pass, step), "XYZ"))
        });
        let way_out = format!("G0 Z{:.4}\n", last.0[2] + CLEARANCE_MM);
        way_in.into_iter().chain(blocks).chain([way_out])
    }

    /// Squares along a pass.
    fn cells(self) -> u32 {
        (self.length_mm / self.mesh_mm).round() as u32
    }

    /// Tool centre point and direction where a pass crosses its next edge: an edge along Y, then a diagonal.
    fn point(self, pass: u32, step: u32) -> (Vector, Vector) {
        let step = if pass.is_multiple_of(2) { step } else { 2 * self.cells() - 1 - step };
        let place = (f64::from(pass) + 0.37) / f64::from(self.passes) * self.width_mm / self.mesh_mm;
        let (i, j, share) = (i64::from(step / 2), place as i64, place.fract());
        let node = |i, j| self.node(i, j);
        let (a, b, c, d) = (node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1));
        let (lower, upper) = (normal(a, b, c), normal(a, c, d));
        let (to, normals) =
            if step.is_multiple_of(2) { (d, [normal(node(i - 1, j), a, d), upper]) } else { (c, [upper, lower]) };
        let tip = [0, 1, 2].map(|axis| a[axis] + (to[axis] - a[axis]) * share);
        let averaged = unit([0, 1, 2].map(|axis| normals[0][axis] + normals[1][axis]));
        let (sine, cosine) = LEAD_RAD.sin_cos();
        (tip, [averaged[0], averaged[1] * cosine + averaged[2] * sine, averaged[2] * cosine - averaged[1] * sine])
    }

    /// A node of the mesh, off the surface by the modeller's noise.
    fn node(self, i: i64, j: i64) -> Vector {
        let (x, y) = (i as f64 * self.mesh_mm, j as f64 * self.mesh_mm);
        let (u, v) = (x - self.length_mm / 2.0, y - self.width_mm / 2.0);
        let z = (u * u + CROSSWISE * v * v) / (2.0 * RADIUS_MM);
        [x, y, z + MESH_TOLERANCE_MM * (noise(i, j) - 0.5)]
    }

    /// The words of a block: these linear axes, and the direction.
    fn words(self, (tip, direction): &(Vector, Vector), axes: &str) -> String {
        let mut words: String = axes.chars().zip(tip).map(|(axis, value)| format!("{axis}{value:.4} ")).collect();
        words.push_str(&match self.directions {
            Directions::Angles => {
                let [a_deg, c_deg] = angles_deg(*direction);
                format!("A{a_deg:.4} C{c_deg:.4}")
            }
            Directions::Vectors => {
                let [x, y, z] = direction;
                format!("I{x:.6} J{y:.6} K{z:.6}")
            }
        });
        words
    }
}

/// A and C of the table for a direction: v = Rz(C)·Rx(A)·z with A negative.
fn angles_deg([x, y, z]: Vector) -> [f64; 2] {
    [-x.hypot(y).atan2(z).to_degrees(), (-x).atan2(y).to_degrees()]
}

/// A number from 0 to 1 for a node: the finaliser of SplitMix64, so that neighbours have nothing in common.
fn noise(i: i64, j: i64) -> f64 {
    let mut bits = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (j as u64).wrapping_mul(0xD1B5_4A32_D192_ED03);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn normal(a: Vector, b: Vector, c: Vector) -> Vector {
    let (p, q) = ([0, 1, 2].map(|axis| b[axis] - a[axis]), [0, 1, 2].map(|axis| c[axis] - a[axis]));
    unit([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]])
}

fn unit(vector: Vector) -> Vector {
    let length = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    vector.map(|value| value / length)
}
