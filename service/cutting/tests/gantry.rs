//! Two axes for one letter: both follow it, and the weaker one limits the path.

use crate::common::{run, validate};
use feedwave_cutting::{MachineProfile, PipelineConfig};
use feedwave_motion::{CarriedBy, MachineAxis};
use feedwave_program::Axis;

const PROGRAM: &str = "G64 P0.05\nG1 X40 Y3 F20000\nX0 Y10\nG3 X20 Y30 I20\nG0 X-50 Z5\nG61 G1 X10 F5000\nY0\nM30\n";

fn mill() -> PipelineConfig {
    PipelineConfig::new(MachineProfile::mill())
}

/// Half as strong as the default X axis.
fn weak_x() -> MachineAxis {
    MachineAxis { name: "X2".to_owned(), ..MachineAxis::new(Axis::X, 250.0, 5_000.0, 2_500_000.0) }
}

#[test]
fn both_axes_follow_and_the_weaker_one_limits() {
    for weak_is_first in [false, true] {
        let mut gantry = mill();
        let twin = MachineAxis { carried_by: CarriedBy::Workpiece, ..weak_x() };
        gantry.profile.machine.axes.insert(usize::from(!weak_is_first), twin);
        let mut weak = mill();
        weak.profile.machine.axes[0] = MachineAxis { name: "X".to_owned(), ..weak_x() };

        let (both, one) = (run(PROGRAM, &gantry), run(PROGRAM, &weak));
        assert!(one.len() > 100 && run(PROGRAM, &mill()).len() < one.len(), "the weak axis is the limit");
        let (reversed, straight) = if weak_is_first { (0, 1) } else { (1, 0) };
        assert_eq!(both.axes[straight], one.axes[0]);
        assert!(both.axes[reversed].iter().zip(&one.axes[0]).all(|(twin, x)| *twin == -x));
        assert_eq!(both.axes[2..], one.axes[1..]);
        assert_eq!(both.feed, one.feed);
    }
}

#[test]
fn each_axis_has_its_own_travel() {
    let mut gantry = mill();
    let twin = MachineAxis { travel_min: Some(-39.9), carried_by: CarriedBy::Workpiece, ..weak_x() };
    gantry.profile.machine.axes.insert(1, twin);
    let findings = validate(PROGRAM, &gantry).findings;
    assert!(findings.iter().any(|finding| finding.code == "AXIS-TRAVEL"), "{findings:?}");
}
