//! A five-axis mill: an A/C trunnion table under a spindle with three linear axes.

use feedwave_cutting::{MachineProfile, PipelineConfig, Tool};
use feedwave_motion::MachineAxis;
use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{BranchPreference, ChainAxis, KinematicsDescription, Wrap};
use feedwave_program::{Axis, LanguageSettings, ToolOffset};

pub const LENGTH_MM: f64 = 120.0;

fn axis(axis: Axis, direction: Vec3, point_mm: Vec3, range: Option<[f64; 2]>) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range, wrap: Wrap::Counting }
}

pub fn trunnion() -> KinematicsDescription {
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    KinematicsDescription {
        chain: vec![
            axis(Axis::C, z, [10.0, 5.0, 0.0], None),
            axis(Axis::A, x, [0.0, 5.3, 40.0], Some([-120.0, 30.0])),
            axis(Axis::Y, y, [0.0; 3], None),
            axis(Axis::X, x, [0.0; 3], None),
            axis(Axis::Z, z, [0.0; 3], None),
        ],
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: z,
        preferred_branch: BranchPreference::Nearest,
    }
}

/// The mill with tool 1.
pub fn config() -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    profile.machine.axes.push(MachineAxis::new(Axis::A, 120.0, 600.0, 20_000.0));
    profile.machine.axes.push(MachineAxis::new(Axis::C, 180.0, 900.0, 30_000.0));
    for axis in &mut profile.machine.axes {
        axis.max_velocity_step_per_s = if axis.axis.is_rotary() { 0.2 } else { 5.0 };
    }
    profile.language.thinning = LanguageSettings::mill().thinning;
    profile.kinematics = Some(trunnion());
    assert_eq!(profile.problems(), []);
    let tools = vec![Tool { number: 1, offset: ToolOffset::new(1).with_length(LENGTH_MM), ..Tool::default() }];
    PipelineConfig { tools, ..PipelineConfig::new(profile) }
}
