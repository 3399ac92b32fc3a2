//! Writes a freeform five-axis program of any size to standard output, such as one of 100 000 blocks:
//! `cargo run --release -p feedwave-tests --bin freeform -- --length 100 --width 100 --passes 250 > freeform.nc`.
//! Without arguments it is `tests/fixtures/freeform.nc`.

use std::io::{BufWriter, Write as _};

use clap::Parser;
use feedwave_tests::{Directions, Freeform};

/// Writes a freeform five-axis program: a gently concave surface, a block at each edge of its triangles.
#[derive(Parser)]
struct Arguments {
    /// Extent along the passes, mm.
    #[arg(long, default_value_t = 50.0)]
    length: f64,
    /// Extent across them, mm.
    #[arg(long, default_value_t = 30.0)]
    width: f64,
    /// Side of the squares of two triangles each, mm.
    #[arg(long, default_value_t = 0.5)]
    mesh: f64,
    /// Passes, to and fro.
    #[arg(long, default_value_t = 13)]
    passes: u32,
    /// Directions as vectors (G43.5), not as angles (G43.4).
    #[arg(long)]
    vectors: bool,
}

fn main() -> std::io::Result<()> {
    let Arguments { length, width, mesh, passes, vectors } = Arguments::parse();
    let directions = if vectors { Directions::Vectors } else { Directions::Angles };
    let program = Freeform { length_mm: length, width_mm: width, mesh_mm: mesh, passes, directions };
    let mut out = BufWriter::new(std::io::stdout().lock());
    for line in program.lines() {
        out.write_all(line.as_bytes())?;
    }
    out.flush()
}
