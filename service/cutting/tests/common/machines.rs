//! Seven kinds of five-axis machines, and poses of their setpoints by forward kinematics.

use feedwave_cutting::{MachineProfile, PipelineConfig, Tool};
use feedwave_motion::MachineAxis;
use feedwave_motion::kinematics::vector::Vec3;
use feedwave_motion::kinematics::{
    BranchPreference, ChainAxis, Kinematics, KinematicsDescription, Setup, ToolPose, Wrap,
};
use feedwave_program::{Axis, LanguageSettings, ToolOffset};

use super::Setpoints;

pub const X: Vec3 = [1.0, 0.0, 0.0];
pub const Y: Vec3 = [0.0, 1.0, 0.0];
pub const Z: Vec3 = [0.0, 0.0, 1.0];

/// Length of tool 1.
pub const LENGTH_MM: f64 = 120.0;

fn linear(axis: Axis, direction: Vec3) -> ChainAxis {
    ChainAxis { axis, direction, point_mm: [0.0; 3], range: None, wrap: Wrap::Counting }
}

fn rotary(axis: Axis, direction: Vec3, point_mm: Vec3) -> ChainAxis {
    ChainAxis { axis, direction, point_mm, range: None, wrap: Wrap::Counting }
}

/// Two trunnion tables, a nutating table, a swivelling head over a rotary table, a fork head, a nutating head, and one with a
/// rotary axis between linear ones that are out of square and a tool that lies down.
pub fn kinds() -> Vec<(&'static str, KinematicsDescription)> {
    let machine = |chain: Vec<ChainAxis>| KinematicsDescription {
        chain,
        gauge_point_mm: [0.0, 0.0, 500.0],
        tool_direction: Z,
        preferred_branch: BranchPreference::Nearest,
    };
    let [x, y, z] = [linear(Axis::X, X), linear(Axis::Y, Y), linear(Axis::Z, Z)];
    let c = rotary(Axis::C, Z, [10.0, 5.0, 0.0]);
    let trunnion_a = rotary(Axis::A, X, [0.0, 5.3, 40.0]);
    let trunnion_b = rotary(Axis::B, Y, [12.0, 0.0, -30.0]);
    let nutating_table = rotary(Axis::B, [0.0, 1.0, 1.0], [3.0, -20.0, 15.0]);
    let swivel = rotary(Axis::B, Y, [3.0, 0.0, 650.0]);
    let fork = rotary(Axis::A, X, [0.0, 2.0, 640.0]);
    let nutating_head = rotary(Axis::B, [0.0, 1.0, 1.0], [0.0, 30.0, 600.0]);
    let head_c = rotary(Axis::C, Z, [0.5, -1.0, 0.0]);
    let oblique = KinematicsDescription {
        tool_direction: X,
        gauge_point_mm: [300.0, -20.0, 80.0],
        ..machine(vec![
            linear(Axis::Y, [0.01, 1.0, 0.0]),
            rotary(Axis::B, [0.02, 1.0, -0.01], [12.0, 0.0, -7.0]),
            linear(Axis::X, [1.0, 0.0, 0.02]),
            linear(Axis::Z, [0.0, -0.015, 1.0]),
            rotary(Axis::C, [0.3, 0.1, 1.0], [40.0, 3.0, 9.0]),
        ])
    };
    vec![
        ("table-table A/C", machine(vec![c.clone(), trunnion_a, y.clone(), x.clone(), z.clone()])),
        ("table-table B/C", machine(vec![c.clone(), trunnion_b, x.clone(), y.clone(), z.clone()])),
        ("nutating table", machine(vec![c.clone(), nutating_table, x.clone(), y.clone(), z.clone()])),
        ("head-table", machine(vec![c, x.clone(), y.clone(), z.clone(), swivel])),
        ("head-head", machine(vec![x.clone(), y.clone(), z.clone(), head_c.clone(), fork])),
        ("nutating head", machine(vec![x, y, z, head_c, nutating_head])),
        ("mixed", oblique),
    ]
}

/// A mill of this kind with tool 1, and work offset G54 beside the zero of the machine.
pub fn config_of(kinematics: KinematicsDescription) -> PipelineConfig {
    let mut profile = MachineProfile::mill();
    for axis in kinematics.chain.iter().filter(|axis| axis.axis.is_rotary()) {
        profile.machine.axes.push(MachineAxis::new(axis.axis, 120.0, 600.0, 20_000.0));
    }
    profile.language.thinning = LanguageSettings::mill().thinning;
    profile.kinematics = Some(kinematics);
    profile.language.work_offsets[0][..3].copy_from_slice(&[30.0, -40.0, 55.0]);
    assert_eq!(profile.problems(), []);
    let tools = vec![Tool { number: 1, offset: ToolOffset::new(1).with_length(LENGTH_MM), ..Tool::default() }];
    PipelineConfig { tools, ..PipelineConfig::new(profile) }
}

pub fn kinematics(config: &PipelineConfig) -> Kinematics {
    Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid")
}

/// Where the work lies with G54, and the tool's length.
pub fn setup(config: &PipelineConfig) -> Setup {
    let kinematics = kinematics(config);
    let offset = config.profile.language.work_offsets[0];
    Setup::new(kinematics.gauge_point_at(&kinematics.from_position(&offset)), LENGTH_MM)
}

/// Machine position of a setpoint by axis.
pub fn position(setpoints: &Setpoints, config: &PipelineConfig, index: usize) -> [f64; 9] {
    let mut position = [0.0; 9];
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        position[axis.axis.index()] = column[index];
    }
    position
}

/// Poses of the tool in work coordinates by forward kinematics.
pub fn poses(setpoints: &Setpoints, config: &PipelineConfig) -> Vec<ToolPose> {
    let (kinematics, setup) = (kinematics(config), setup(config));
    let pose = |index| kinematics.forward(&kinematics.from_position(&position(setpoints, config, index)), &setup);
    (0..setpoints.len()).map(pose).collect()
}

/// Tool direction in work coordinates with the rotary axes at these angles (first the one next to the work), degrees.
pub fn direction_at(config: &PipelineConfig, rotary_deg: [f64; 2]) -> Vec3 {
    kinematics(config).rotary_directions().at(rotary_deg.map(f64::to_radians))
}
