//! Tool oscillation under tool centre point control: along the feed direction that the tool sees, and along the tool axis.

use feedwave_cutting::tool_oscillation::{
    DirectionOscillation, Engagement, LeadingEdge, NamedCondition, OscillationCondition, OscillationPeriod,
    ToolGeometry, ToolOscillation, Waveform, blend,
};
use feedwave_cutting::{Frame, PipelineConfig};
use feedwave_motion::kinematics::vector::{dot, norm, sub};
use feedwave_motion::kinematics::{JointValues, Kinematics, Setup, ToolPose};

use super::machine::{LENGTH_MM, config};
use super::{distance, poses};
use crate::common::{resume, run, snapshots, validate};

/// Two periods of 1 mm.
pub const RAMP_MM: f64 = 2.0;

pub fn condition() -> OscillationCondition {
    let direction = |amplitude_mm, waveform| DirectionOscillation { amplitude_mm, waveform, phase_deg: 0.0 };
    OscillationCondition {
        period: OscillationPeriod::PerRevolution(1),
        feed: direction(0.4, Waveform::Sine),
        axial: direction(0.03, Waveform::HeldPeak { hold_share: 0.3 }),
        cross: None,
        leading_edge: LeadingEdge::default(),
        ramp_periods: 2,
        may_overrun: false,
        engagement: Engagement::Slot,
    }
}

pub fn geometry() -> ToolGeometry {
    ToolGeometry::even(4, 60.0, 1.5, 5.0)
}

fn oscillating() -> PipelineConfig {
    let mut config = config();
    let named = NamedCondition {
        name: "face".to_owned(),
        number: 1,
        tools: Vec::new(),
        condition: condition(),
        tables: Vec::new(),
    };
    config.profile.tool_oscillation = vec![named];
    config.tools[0].geometry = Some(geometry());
    config
}

const START: [f64; 3] = [0.0, 0.0, 20.0];
const END: [f64; 3] = [40.0, 5.0, 20.0];
const PROGRAM: &str =
    "T1 M6\nM3 S600\nG43.4 H1 G0 X0 Y0 Z20 A-20 C0\nG202 P1 D1\nG1 X40 Y5 A-26 C12 F600\nG203\nG49\nM30\n";

#[test]
fn a_setpoint_less_its_offset_is_on_the_segment() {
    let config = oscillating();
    let report = validate(PROGRAM, &config);
    assert!(report.is_accepted(), "{:#?}", report.findings);
    let setpoints = run(PROGRAM, &config);
    let kinematics = Kinematics::new(config.profile.kinematics.as_ref().expect("five axes")).expect("valid");
    let setup = Setup::new(kinematics.gauge_point_at(&JointValues::default()), LENGTH_MM);
    let oscillation = ToolOscillation::new(&geometry(), &condition(), 1, 1).expect("possible");
    let length_mm = norm(sub(END, START));
    let cut: Vec<usize> = (0..setpoints.len()).filter(|&index| setpoints.line[index] == 5).collect();
    let base_mm = setpoints.path[*cut.last().expect("a cut")] - length_mm;
    let [mut whole, mut off_path] = [0, 0];
    for index in cut {
        let mut joints = JointValues::default();
        let column = |letter: usize| setpoints.axes[letter][index];
        // Chain: Y X Z, then C A; columns: X Y Z A C.
        joints.linear_mm = [column(1), column(0), column(2)];
        joints.rotary_rad = [column(4).to_radians(), column(3).to_radians()];
        let tip_of = |joints: &JointValues| kinematics.forward(joints, &setup).tip_mm;
        let along_work = sub(END, START).map(|travel| travel / length_mm);
        // What the path does along each linear axis, by moving it alone.
        let seen = [1, 0, 2].map(|place| {
            let mut moved = joints;
            moved.linear_mm[place] += 1.0;
            dot(sub(tip_of(&moved), tip_of(&joints)), along_work)
        });
        let azimuth_deg = libm::atan2(seen[1], seen[0]).to_degrees();
        let along_mm = setpoints.path[index] - base_mm;
        let share = blend(along_mm / RAMP_MM) * blend((length_mm - along_mm) / RAMP_MM);
        whole += u32::from(share == 1.0);
        let offset = oscillation.offset((setpoints.spindle[index] + azimuth_deg) / 360.0);
        assert!((setpoints.vibration[index] - share * offset.feed_mm).abs() < 1e-8);
        off_path += u32::from(distance(tip_of(&joints), START, END) > 1e-3);
        let commanded = [
            joints.linear_mm[0] - share * offset.feed_mm * seen[1],
            joints.linear_mm[1] - share * offset.feed_mm * seen[0],
            joints.linear_mm[2] - share * (offset.feed_mm * seen[2] + offset.retraction_mm),
        ];
        let tip = tip_of(&JointValues { linear_mm: commanded, ..joints });
        let off = distance(tip, START, END);
        assert!(off < 1e-9, "setpoint {index}: {off:e}");
        let place = norm(sub(tip, START));
        assert!((place - along_mm).abs() < 1e-8, "setpoint {index}: {place} {along_mm}");
    }
    assert!(whole > 100 && off_path > 100, "{whole} {off_path}");
}

#[test]
fn work_coordinates_show_the_tip_as_it_oscillates() {
    let config = oscillating();
    let work = run(PROGRAM, &PipelineConfig { frame: Frame::Work, ..config.clone() });
    let machine = run(PROGRAM, &config);
    for (index, pose) in poses(&machine, &config).into_iter().enumerate().filter(|(index, _)| machine.line[*index] == 5)
    {
        let ToolPose { tip_mm, .. } = pose;
        let shown = [0, 1, 2].map(|axis| work.axes[axis][index]);
        assert!(norm(sub(tip_mm, shown)) < 1e-9, "setpoint {index}: {tip_mm:?} {shown:?}");
    }
    for (_, offset, snapshot) in snapshots(PROGRAM.as_bytes(), &config) {
        let (first, rest) = resume(PROGRAM.as_bytes(), &config, offset, &snapshot);
        for place in 0..rest.len() {
            assert_eq!(rest.bits(place), machine.bits(first as usize + place), "setpoint {place} from {first}");
        }
    }
}

#[test]
fn the_limits_of_every_axis_hold_with_the_oscillation() {
    let config = oscillating();
    let setpoints = run(PROGRAM, &config);
    let period_s = config.period_s();
    for (column, axis) in setpoints.axes.iter().zip(&config.profile.machine.axes) {
        for k in column.windows(3) {
            let [velocity, acceleration] =
                [(k[1] - k[0]) / period_s, (k[2] - 2.0 * k[1] + k[0]) / (period_s * period_s)].map(f64::abs);
            assert!(velocity <= axis.max_velocity_per_s * 1.001, "{}: {velocity}", axis.name);
            assert!(acceleration <= axis.max_acceleration_per_s2 * 1.01, "{}: {acceleration}", axis.name);
        }
    }
}

#[test]
fn a_tip_that_rests_has_no_feed_direction() {
    let still = PROGRAM.replace("X40 Y5 A-26 C12", "A-26 C12");
    let report = validate(&still, &oscillating());
    assert!(report.findings.iter().any(|finding| finding.code == "OSC-ROTARY"), "{:?}", report.findings);
}
