//! Programs that the tests send.

/// The worked example of docs/functions/path-vibration.md: three vibrations per revolution, so that the chip never
/// breaks.
pub const SHAFT: &str = "%
O0101 (SHAFT, VIBRATING)
G21 G97 S1000 M3
G0 X6. Z10.
G200 F50 A0.03
G1 X10. Z20. F0.05
G2 X14.02 Z23.51 R4.
G201
M30
%
";

/// The same at two and a half vibrations per revolution: the chip breaks.
pub const SHAFT_CURED: &str = "%
O0101 (SHAFT, VIBRATING)
G21 G97 S1000 M3
G0 X6. Z10.
G200 F41.667 A0.03
G1 X10. Z20. F0.05
G2 X14.02 Z23.51 R4.
G201
M30
%
";

/// Where both end: X is programmed as a diameter and streamed as a radius.
pub const SHAFT_END_X_MM: f64 = 14.02 / 2.0;
/// See [`SHAFT_END_X_MM`].
pub const SHAFT_END_Z_MM: f64 = 23.51;

/// A program that rests for `seconds`: many setpoints from few bytes.
#[must_use]
pub fn long_dwell(seconds: u32) -> String {
    format!("G21 G97 S1000 M3\nG0 X10. Z1.\nG4 P{}\nG1 Z2. F0.5\nM30\n", u64::from(seconds) * 1000)
}

/// A program of about `bytes` bytes that cuts short straight pieces to and fro, as a CAM system would write them.
pub fn many_blocks(bytes: u64) -> impl Iterator<Item = String> {
    let mut written = 0;
    let mut number = 0_u64;
    let mut ended = false;
    std::iter::from_fn(move || {
        if ended {
            return None;
        }
        let block = if written >= bytes {
            ended = true;
            "M30\n".to_owned()
        } else if number == 0 {
            "G21 G98 G97 S1000 M3\nG0 X10. Z0.\nG1 F6000.\n".to_owned()
        } else {
            let x_um = 10_000 + (number * 7) % 40;
            let z_um = (number * 13) % 50;
            format!("N{} G1 X{}.{:03} Z0.{z_um:03}\n", number % 100_000, x_um / 1000, x_um % 1000)
        };
        number += 1;
        written += block.len() as u64;
        Some(block)
    })
}
