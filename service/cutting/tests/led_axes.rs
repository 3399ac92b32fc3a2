//! Which axes a feed leads where U, V and W move beside X, Y and Z.

use crate::common::{run, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig};
use feedwave_motion::MachineAxis;
use feedwave_program::{Axis, DialectName};

fn with_u(dialect: DialectName) -> PipelineConfig {
    let mut config = PipelineConfig::new(MachineProfile::mill());
    config.profile.machine.axes.push(MachineAxis::new(Axis::U, 500.0, 10_000.0, 5e6));
    config.profile.language.dialect = dialect;
    config
}

/// Seconds that the program takes.
fn seconds(program: &str, config: &PipelineConfig) -> f64 {
    let report = validate(program, config);
    assert!(report.is_accepted(), "{program}: {:#?}", report.findings);
    report.summary.duration_s
}

#[test]
fn linuxcnc_leads_x_y_and_z_while_they_move() {
    let [linuxcnc, mill] = [DialectName::LinuxCnc, DialectName::Mill].map(with_u);
    // At 60 mm/min: 30 mm of X take 30 s, of which U makes a path of 50 mm.
    for (program, here, elsewhere) in [
        ("G91 G1 X30. U40. F60.\nM30\n", 30.0, 50.0),
        ("G91 G1 U40. F60.\nM30\n", 40.0, 40.0),
        ("G91 G1 X30. F60.\nM30\n", 30.0, 30.0),
        // Half a circle of 10 mm, beside which U moves.
        ("G91 G3 X20. U40. I10. F60.\nM30\n", 10.0 * std::f64::consts::PI, (10.0 * std::f64::consts::PI).hypot(40.0)),
        ("G91 G93 G1 X30. U40. F2.\nM30\n", 30.0, 30.0),
    ] {
        for (config, expected) in [(&linuxcnc, here), (&mill, elsewhere)] {
            let found = seconds(program, config);
            assert!((found - expected).abs() < 0.05, "{program}: {found} and not {expected}");
        }
    }
    // The limit of U holds all the same.
    let setpoints = run("G91 G1 X1. U100. F6000.\nM30\n", &linuxcnc);
    let fastest = setpoints.axes[3].windows(2).map(|pair| (pair[1] - pair[0]) / 1e-3).fold(0.0, f64::max);
    assert!((499.0..500.1).contains(&fastest), "{fastest}");
}
