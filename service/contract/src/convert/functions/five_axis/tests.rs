use feedwave_motion::MachineAxis;
use feedwave_program::{Axis, FunctionCodes};

use super::*;
use crate::convert::profile::tests::from_proto;
use crate::convert::profile_to_proto;

/// A trunnion with everything that a profile can say of five axes.
pub(in crate::convert) fn five_axis_mill() -> MachineProfile {
    let axis = |axis: Axis, direction: [f64; 3]| ChainAxis {
        axis,
        direction,
        point_mm: [1.0, 2.0, 3.0],
        range: (axis == Axis::A).then_some([-120.0, 30.0]),
        wrap: if axis == Axis::C { Wrap::Rollover } else { Wrap::Counting },
    };
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let mut mill = MachineProfile::mill();
    for letter in [Axis::A, Axis::C] {
        mill.machine.axes.push(MachineAxis::new(letter, 100.0, 1_000.0, 10_000.0));
    }
    mill.kinematics = Some(KinematicsDescription {
        chain: vec![axis(Axis::C, z), axis(Axis::A, x), axis(Axis::X, x), axis(Axis::Y, y), axis(Axis::Z, z)],
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: z,
        preferred_branch: BranchPreference::Smaller,
    });
    mill.thinning.group_blocks = 77;
    mill.thinning.interpolated_direction_tolerance_deg = Some(2.5);
    mill.pole_tolerance_deg = 0.5;
    mill.corner_direction_tolerance_deg = 0.25;
    mill.language.thinning = Some(FunctionCodes { on: 133.0, off: 134.0 });
    mill
}

#[test]
fn kinematics_are_checked_with_their_fields() {
    let mut profile = profile_to_proto(&five_axis_mill());
    let kinematics = profile.kinematics.as_mut().unwrap();
    kinematics.chain[0].axis = 0;
    kinematics.chain[1].direction = None;
    let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
    assert_eq!(fields, ["profile.kinematics.chain[0].axis", "profile.kinematics.chain[1].direction"]);
    let mut profile = profile_to_proto(&five_axis_mill());
    profile.machine.as_mut().unwrap().axes.pop();
    profile.thinning.as_mut().unwrap().group_blocks = Some(1);
    let fields: Vec<String> = from_proto(&profile).unwrap_err().into_iter().map(|(field, _)| field).collect();
    assert_eq!(fields, ["profile.thinning.group_blocks", "profile.kinematics.chain[0].axis"]);
}
