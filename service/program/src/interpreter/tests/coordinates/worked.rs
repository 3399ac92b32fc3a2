//! Three cases for each code of coordinates and each control that has it: where the machine ends, worked by hand from
//! docs/coordinates.md. The machine is at 0 before, the control has G54 at (100, 50, 10), G55 at (200, 50, 10), reference positions
//! at (1, 2, 3) and (4, 5, 6), and tools of 100 mm (T1) and 50 mm (T2).

use super::*;

fn with_offsets(mut settings: LanguageSettings) -> LanguageSettings {
    (settings.work_offsets[0], settings.work_offsets[1]) = (at([100.0, 50.0, 10.0]), at([200.0, 50.0, 10.0]));
    settings.reference_position = at([1.0, 2.0, 3.0]);
    settings.coordinates.more_reference_positions[0] = Some(at([4.0, 5.0, 6.0]));
    settings
}

fn at([x, y, z]: [f64; 3]) -> Position {
    let mut position = Position::default();
    (position[0], position[1], position[2]) = (x, y, z);
    position
}

/// The last position of each program.
#[track_caller]
fn worked(settings: LanguageSettings, cases: &[(&str, [f64; 3])]) {
    let settings = with_offsets(settings);
    for (program, expected) in cases {
        let run = run_with(&settings, &tools(), program);
        assert!(run.findings.is_empty(), "{program}: {:?}", run.findings);
        let end = run.moves.last().map(|(_, end)| *end).unwrap_or_default();
        assert!(end.iter().zip(expected).all(|(one, other)| (one - other).abs() < 1e-9), "{program}: {end:?}");
    }
}

fn haas() -> LanguageSettings {
    let mut settings = mill();
    settings.coordinates.style = crate::CoordinateStyle::Haas;
    settings
}

fn turning() -> LanguageSettings {
    LanguageSettings { g_code_system: Some(crate::GCodeSystem::A), ..lathe() }
}

#[test]
fn systems() {
    worked(
        mill(),
        &[
            ("G0 X1 Y2 Z3", [101.0, 52.0, 13.0]),
            ("G55 G0 X1 Y2 Z3", [201.0, 52.0, 13.0]),
            ("G56 G0 X1 Y2 Z3", [1.0, 2.0, 3.0]),
            ("G53 G0 X1 Y2 Z3", [1.0, 2.0, 3.0]),
            ("G0 X1 Y1 Z1\nG53 Z0", [101.0, 51.0, 0.0]),
            ("G1 G53 X5 F100\nG0 X5", [105.0, 0.0, 0.0]),
            ("G10 L20 P7 X7 Y8\nG54.1 P7 G0 X1 Y1 Z1", [8.0, 9.0, 1.0]),
            ("G10 L20 P48 Z5\nG54 P48 G0 X1 Y1 Z1", [1.0, 1.0, 6.0]),
            ("G10 L20 P1 X5\nG91 G10 L20 P1 X5\nG90 G54.1 P1 G0 X1", [11.0, 0.0, 0.0]),
        ],
    );
    worked(
        haas(),
        &[
            ("G10 L20 P1 X7\nG154 P1 G0 X1 Y0 Z0", [8.0, 0.0, 0.0]),
            ("G10 L20 P99 Y7\nG154 P99 G0 X1 Y1 Z1", [1.0, 8.0, 1.0]),
            ("G10 L20 P2 X7\nG111 G0 X1 Y1 Z1", [8.0, 1.0, 1.0]),
        ],
    );
    worked(
        linuxcnc(),
        &[
            ("G55 G0 X1 Y2 Z3", [201.0, 52.0, 13.0]),
            ("G10 L2 P9 X7\nG59.3 G0 X1 Y0 Z0", [8.0, 0.0, 0.0]),
            ("G10 L2 P7 Z7\nG59.1 G0 X1 Y1 Z1", [1.0, 1.0, 8.0]),
            ("G0 G53 X5", [5.0, 0.0, 0.0]),
            ("G0 X0 Y0 Z0\nG53 Z1\nX1", [101.0, 50.0, 1.0]),
            ("G53 G0 X5\nG91 X1", [6.0, 0.0, 0.0]),
        ],
    );
}

#[test]
fn shifts() {
    worked(
        mill(),
        &[
            ("G52 X5\nG0 X1 Y0 Z0", [106.0, 50.0, 10.0]),
            ("G52 X5 Y5\nG55 G0 X1 Y0 Z0", [206.0, 55.0, 10.0]),
            ("G52 X5 Y5\nG52 X0\nG0 X1 Y1 Z0", [101.0, 56.0, 10.0]),
            ("G0 X10 Y10 Z0\nG92 X0\nX1 Y1", [111.0, 51.0, 10.0]),
            ("G0 X10\nG92 X2\nG55 X0", [208.0, 0.0, 0.0]),
            ("G0 X10 Y10\nG92 X0 Y0\nG92.1 X0\nX1 Y1", [101.0, 61.0, 0.0]),
            ("G0 X10\nG92 X0\nG92.1 X0 Y0\nX1 Y1", [101.0, 51.0, 0.0]),
            ("G0 X10 Z4\nG92 Z0\nG92.1 Z0\nZ1", [110.0, 0.0, 11.0]),
        ],
    );
    worked(
        linuxcnc(),
        &[
            ("G52 X5\nG0 X1 Y0 Z0", [106.0, 50.0, 10.0]),
            ("G52 X5\nG55 G0 X1 Y0 Z0", [206.0, 50.0, 10.0]),
            ("G52 X5 Y5\nG52 X1\nG0 X0 Y0 Z0", [101.0, 55.0, 10.0]),
            ("G0 X10\nG92 X0\nX1 Y1", [111.0, 51.0, 0.0]),
            ("G0 X10\nG92 X0\nG92.1\nX1", [101.0, 0.0, 0.0]),
            ("G0 X10\nG92 X0\nG92.2\nX1\nG92.3\nX1", [111.0, 0.0, 0.0]),
        ],
    );
    // X is a diameter in the words and a radius in the machine.
    worked(
        turning(),
        &[
            ("G52 X4. Z5.\nG0 X10. Z0", [107.0, 0.0, 15.0]),
            ("G0 X20. Z0\nG50 X10. Z5.\nX0 Z0", [105.0, 0.0, 5.0]),
            ("G0 X20. Z0\nG50 U4. W-5.\nX20. Z0", [108.0, 0.0, 15.0]),
            ("G0 X20. Z0\nG50 X10.\nG50.3 X0\nX20. Z1.", [110.0, 0.0, 11.0]),
            ("G53 X10. Z5.", [5.0, 0.0, 5.0]),
        ],
    );
}

#[test]
fn data() {
    worked(
        mill(),
        &[
            ("G10 L2 P1 X10\nG0 X1 Y0 Z0", [11.0, 50.0, 10.0]),
            ("G91 G10 L2 P1 X10\nG90 G0 X1 Y0 Z0", [111.0, 50.0, 10.0]),
            ("G10 L2 P0 Z-2\nG0 X0 Y0 Z0", [100.0, 50.0, 8.0]),
            ("G10 L10 P5 R30.\nG43 H5 G0 Z1", [0.0, 0.0, 41.0]),
            ("G10 L10 P5 R30.\nG10 L11 P5 R2.\nG43 H5 G0 Z1", [0.0, 0.0, 43.0]),
            ("G10 L10 P5 R30.\nG44 H5 G0 Z1", [0.0, 0.0, -19.0]),
        ],
    );
    worked(
        linuxcnc(),
        &[
            ("G10 L2 P1 X10\nG0 X1 Y0 Z0", [11.0, 50.0, 10.0]),
            ("G91 G10 L2 P0 X10\nG90 G0 X1", [11.0, 0.0, 0.0]),
            ("G10 L2 P1 R90\nG0 X1 Y0 Z0", [100.0, 51.0, 10.0]),
            ("G0 X0 Y0\nG10 L20 P1 X7\nX8", [101.0, 50.0, 0.0]),
            ("G0 X0\nG10 L20 P2 X0\nG55 X1", [101.0, 0.0, 0.0]),
            ("G0 X0\nG52 X3\nG10 L20 P1 X0\nX1", [101.0, 0.0, 0.0]),
        ],
    );
    worked(
        turning(),
        &[
            ("G10 L2 P1 X10. Z20.\nG0 X4. Z1.", [7.0, 0.0, 21.0]),
            ("G10 L2 P1 U10. W20.\nG0 X4. Z1.", [107.0, 0.0, 31.0]),
            ("G10 P0 X4. Z5.\nG0 X0. Z0.", [102.0, 0.0, 15.0]),
        ],
    );
}

#[test]
fn reference_positions() {
    worked(
        mill(),
        &[
            ("G91 G28 Z0", [0.0, 0.0, 3.0]),
            ("G28 X10 Y0 Z0", [1.0, 2.0, 3.0]),
            ("G0 X5 Y5\nG91 G28 X0 Y0", [1.0, 2.0, 0.0]),
            ("G91 G30 Z0", [0.0, 0.0, 6.0]),
            ("G30 P2 X0 Y0 Z0", [4.0, 5.0, 6.0]),
            ("G0 X1 Y1\nG91 G30 P2 X0", [4.0, 51.0, 0.0]),
            ("G91 G28 Z1\nG90 G29 Z5", [0.0, 0.0, 15.0]),
        ],
    );
    worked(haas(), &[("G28", [1.0, 2.0, 3.0]), ("G91 G28", [1.0, 2.0, 3.0]), ("G0 X5\nG28", [1.0, 2.0, 3.0])]);
    worked(
        linuxcnc(),
        &[
            ("G28", [1.0, 2.0, 3.0]),
            ("G28 Z5", [0.0, 0.0, 3.0]),
            ("G30", [4.0, 5.0, 6.0]),
            ("G0 X5 Y5 Z5\nG28.1\nX0 Y0 Z0\nG28", [105.0, 55.0, 15.0]),
            ("G0 X5\nG30.1\nX0\nG30 X1", [105.0, 0.0, 0.0]),
            ("G91 G30 X1 Z1", [4.0, 0.0, 6.0]),
        ],
    );
    worked(
        turning(),
        &[
            ("G0 X10. Z5.\nG28 U0 W0", [1.0, 0.0, 3.0]),
            ("G0 X10. Z5.\nG28 U0", [1.0, 0.0, 15.0]),
            ("G0 X10. Z5.\nG28 X20. Z10.", [1.0, 0.0, 3.0]),
            ("G0 X10. Z5.\nG30 U0 W0", [4.0, 0.0, 6.0]),
        ],
    );
}

#[test]
fn planar_transformations() {
    let root = 3.0_f64.sqrt();
    worked(
        mill(),
        &[
            ("G0 X0 Y0\nG16 X10 Y30", [100.0 + 5.0 * root, 55.0, 0.0]),
            ("G0 X0 Y0\nG16 X10 Y90\nY180", [90.0, 50.0, 0.0]),
            ("G0 X0 Y0\nG16 X10 Y0\nG15 X0 Y1", [100.0, 51.0, 0.0]),
            ("G68 X0 Y0 R90\nG0 X10 Y0", [100.0, 60.0, 0.0]),
            ("G68 X10 Y10 R180\nG0 X0 Y0", [120.0, 70.0, 0.0]),
            ("G0 X10 Y0\nG68 R90\nG90 X20 Y0\nG69\nX0 Y0", [100.0, 50.0, 0.0]),
            ("G51 X0 Y0 P2.\nG0 X10 Y5", [120.0, 60.0, 0.0]),
            ("G51 X10 Y0 P2000\nG0 X20 Y5", [130.0, 60.0, 0.0]),
            ("G51 X0 Y0 Z0 I2. J3. K1.\nG0 X10 Y5 Z1", [120.0, 65.0, 11.0]),
            ("G51.1 X0\nG0 X10 Y5", [90.0, 55.0, 0.0]),
            ("G51.1 X10\nG0 X0 Y5", [120.0, 55.0, 0.0]),
            ("G51.1 X0 Y0\nG0 X1 Y1\nG50.1 X0\nX1 Y1", [101.0, 49.0, 0.0]),
        ],
    );
    worked(
        haas(),
        &[
            ("G101 X0\nG0 X10 Y5", [90.0, 55.0, 0.0]),
            ("G101 X0 Y0\nG0 X10 Y5", [90.0, 45.0, 0.0]),
            ("G101 X0\nG0 X1\nG100 X0\nX1", [101.0, 0.0, 0.0]),
        ],
    );
}

#[test]
fn tool_lengths() {
    worked(
        mill(),
        &[
            ("G43 H1 G0 Z5", [0.0, 0.0, 115.0]),
            ("G44 H2 G0 Z5", [0.0, 0.0, -35.0]),
            ("G43 H1 G0 Z5\nG49\nZ5", [0.0, 0.0, 15.0]),
        ],
    );
    worked(
        linuxcnc(),
        &[
            ("G43 H1 G0 Z5", [0.0, 0.0, 115.0]),
            ("T2 M6 G43\nG0 Z5", [0.0, 0.0, 65.0]),
            ("G43 H1\nG0 Z5\nG49\nZ5", [0.0, 0.0, 15.0]),
            ("G43.1 X1 Z2\nG0 X0 Z0", [101.0, 0.0, 12.0]),
            ("G43.1 Z2\nG43.2 H2\nG0 Z0", [0.0, 0.0, 62.0]),
            ("G43 H1\nG43.2 H2\nG0 Z0", [0.0, 0.0, 160.0]),
        ],
    );
}
