//! Planning requests: from the contract to the pass planner.

use std::ops::RangeInclusive;

use feedwave_cutting::thread::{
    DepthLaw, GrooveProfile, Hand, InfeedPattern, LeadAxis, PassMethod, SpindleRotation, TAPER_SHARE, ThreadDrives,
    ThreadGeometry, ThreadLimits, ThreadRequest, ThreadTextOptions, ThreadVibrationSettings,
};
use feedwave_cutting::{DEFAULT_PERIOD_US, MAX_PERIOD_US, MIN_PERIOD_US, MachineProfile};
use feedwave_motion::{MachineAxis, MachineKind};
use feedwave_program::Axis;

use super::{side_from_proto, start_up_from_proto};
use crate::convert::enumeration;
use crate::proto;
use crate::proto::plan_thread_request::Advance;
use crate::violations::Violations;

/// Lengths that a thread can have, mm.
const LENGTH_MM: RangeInclusive<f64> = 1e-3..=1e6;
/// Ratios and margins: what is not above 1 breaks no chip.
const ABOVE_ONE: RangeInclusive<f64> = 1.000_001..=10.0;
const MM_PER_INCH: f64 = 25.4;

/// What the planner is asked; a violation for each field that is wrong, and for `machine_field` where the machine
/// cannot turn threads. Without a machine, which is a violation already, the fields are checked nevertheless.
pub fn thread_request_from_proto(
    violations: &mut Violations,
    given: &proto::PlanThreadRequest,
    machine_field: &str,
    profile: Option<&MachineProfile>,
) -> Option<(ThreadRequest, ThreadTextOptions)> {
    let known = violations.count();
    let converted = convert(&mut Checked(violations), given, machine_field, profile);
    converted.filter(|_| violations.count() == known)
}

/// Violations of values that lie outside their range.
struct Checked<'a>(&'a mut Violations);

impl Checked<'_> {
    fn within(&mut self, field: &str, value: f64, range: RangeInclusive<f64>) -> f64 {
        if !range.contains(&value) {
            self.0.add(field, format!("must be {} to {}, is {value}", range.start(), range.end()));
        }
        value
    }

    /// A value that need not be stated.
    fn or(&mut self, field: &str, value: Option<f64>, default: f64, range: RangeInclusive<f64>) -> f64 {
        value.map_or(default, |value| self.within(field, value, range))
    }
}

fn convert(
    checked: &mut Checked<'_>,
    given: &proto::PlanThreadRequest,
    machine_field: &str,
    profile: Option<&MachineProfile>,
) -> Option<(ThreadRequest, ThreadTextOptions)> {
    let hand = enumeration(checked.0, "hand", given.hand).and_then(hand_from_proto);
    let geometry = geometry(checked, given, hand);
    let limits = limits(checked, given, machine_field, profile);
    let infeed = infeed(checked, given);
    let depth_mm = checked.within("depth_mm", given.depth_mm, LENGTH_MM);
    let allowance_mm = checked.or("finishing_allowance_mm", given.finishing_allowance_mm, 0.02, 0.0..=1e3);
    if allowance_mm >= depth_mm {
        checked.0.add("finishing_allowance_mm", format!("must be less than the depth of {depth_mm} mm"));
    }
    let settings = profile.map_or_else(ThreadVibrationSettings::default, |profile| profile.thread_vibration);
    let fastest = profile.map_or(1e6, |profile| profile.machine.max_spindle_rev_per_min);
    let law = enumeration(checked.0, "law", given.law);
    let method = enumeration(checked.0, "method", given.method);
    let start_up = enumeration(checked.0, "start_up", given.start_up);
    let profile = groove_profile(checked, given, &settings);
    let default = ThreadTextOptions::default();
    let options = ThreadTextOptions {
        clearance_mm: checked.or("clearance_mm", given.clearance_mm, default.clearance_mm, 0.0..=1e3),
        ratio: checked.or("amplitude_ratio", given.amplitude_ratio, default.ratio, ABOVE_ONE),
    };
    let request = ThreadRequest {
        hand,
        profile,
        depth_mm,
        finishing_allowance_mm: allowance_mm,
        first_depth_mm: checked.within("first_depth_mm", given.first_depth_mm, LENGTH_MM),
        vibrations_per_rev: checked.or(
            "vibrations_per_rev",
            given.vibrations_per_rev,
            settings.vibrations_per_rev,
            0.01..=100.0,
        ),
        spindle_rev_per_min: checked.within("spindle_rev_per_min", given.spindle_rev_per_min, 1e-3..=fastest),
        amplitude_margin: checked.or("amplitude_margin", given.amplitude_margin, 1.1, ABOVE_ONE),
        geometry: geometry?,
        infeed: infeed?,
        law: match law? {
            proto::DepthLaw::Unspecified | proto::DepthLaw::SquareRoot => DepthLaw::SquareRoot,
            proto::DepthLaw::Constant => DepthLaw::Constant,
        },
        method: match method? {
            proto::PassMethod::Unspecified | proto::PassMethod::StartAngle => PassMethod::StartAngle,
            proto::PassMethod::StartPosition => PassMethod::StartPosition,
        },
        start_up: match start_up? {
            proto::ThreadStartUp::Unspecified => settings.start_up,
            stated => start_up_from_proto(stated),
        },
        limits: limits?,
    };
    Some((request, options))
}

fn groove_profile(
    checked: &mut Checked<'_>,
    given: &proto::PlanThreadRequest,
    settings: &ThreadVibrationSettings,
) -> GrooveProfile {
    let (stated_deg, default_deg) = (given.included_angle_deg, settings.included_angle_deg);
    GrooveProfile {
        included_angle_deg: checked.or("included_angle_deg", stated_deg, default_deg, 1.0..=170.0),
        root_flat_mm: checked.within("root_flat_mm", given.root_flat_mm, 0.0..=1e3),
    }
}

fn geometry(checked: &mut Checked<'_>, given: &proto::PlanThreadRequest, hand: Option<Hand>) -> Option<ThreadGeometry> {
    let starts = given.starts.max(1);
    checked.within("starts", f64::from(starts), 1.0..=30.0);
    let pitch_mm = match given.advance {
        Some(Advance::LeadMm(lead_mm)) => Some(checked.within("lead_mm", lead_mm, LENGTH_MM) / f64::from(starts)),
        Some(Advance::PitchMm(pitch_mm)) => Some(checked.within("pitch_mm", pitch_mm, LENGTH_MM)),
        Some(Advance::ThreadsPerInch(threads)) => {
            Some(MM_PER_INCH / checked.within("threads_per_inch", threads, 0.1..=1e3))
        }
        None => {
            checked.0.add("advance", "a pitch, a lead or threads per inch must be stated");
            None
        }
    };
    let lead_axis = lead_axis(checked, given);
    let [work_mm, start_mm, end_mm] = place(checked, given, lead_axis.unwrap_or_default());
    let taper = checked.within("taper", given.taper, -1.0..=1.0);
    let side = enumeration(checked.0, "side", given.side);
    let rotation = enumeration(checked.0, "rotation", given.rotation);
    let forward = ThreadGeometry {
        lead_axis: lead_axis?,
        side: side_from_proto(side?),
        work_mm,
        start_mm,
        end_mm,
        taper,
        // A stated lead is the lead to the last bit.
        lead_mm: match given.advance {
            Some(Advance::LeadMm(lead_mm)) => lead_mm,
            _ => pitch_mm? * f64::from(starts),
        },
        starts,
        rotation: SpindleRotation::Forward,
    };
    Some(ThreadGeometry { rotation: rotation_for(&forward, rotation?, hand), ..forward })
}

fn lead_axis(checked: &mut Checked<'_>, given: &proto::PlanThreadRequest) -> Option<LeadAxis> {
    let lead_axis = match enumeration(checked.0, "lead_axis", given.lead_axis)? {
        proto::ThreadLeadAxis::Unspecified | proto::ThreadLeadAxis::Z => return Some(LeadAxis::Z),
        proto::ThreadLeadAxis::X => LeadAxis::X,
    };
    if given.side() == proto::ThreadSide::Internal {
        checked.0.add("side", "must be outside along X: a face is threaded from its side of larger Z");
    }
    if given.hand() != proto::ThreadHand::Unspecified {
        checked.0.add("hand", "must be unspecified along X: only a thread along Z has a hand");
    }
    Some(lead_axis)
}

/// Surface of the work, start and end of the lead: what belongs to one axis of the lead must not be stated with the other.
fn place(checked: &mut Checked<'_>, given: &proto::PlanThreadRequest, lead_axis: LeadAxis) -> [f64; 3] {
    let along_z =
        [("work_diameter_mm", given.work_diameter_mm), ("start_z_mm", given.start_z_mm), ("end_z_mm", given.end_z_mm)];
    let along_x = [
        ("face_z_mm", given.face_z_mm),
        ("start_radius_mm", given.start_radius_mm),
        ("end_radius_mm", given.end_radius_mm),
    ];
    let (stated, others, work_scale, ranges) = match lead_axis {
        LeadAxis::Z => (along_z, along_x, 0.5, [LENGTH_MM, -1e6..=1e6]),
        LeadAxis::X => (along_x, along_z, 1.0, [-1e6..=1e6, 0.0..=1e6]),
    };
    for (field, value) in others {
        if value != 0.0 {
            checked.0.add(field, "must be absent with this axis of the lead");
        }
    }
    let [work, start, end] = stated;
    if start.1 == end.1 {
        checked.0.add(end.0, "must differ from where the lead starts");
    }
    let [work_range, range] = ranges;
    let work_mm = work_scale * checked.within(work.0, work.1, work_range);
    [work_mm, checked.within(start.0, start.1, range.clone()), checked.within(end.0, end.1, range)]
}

/// The stated rotation, or the one that makes the requested hand in this direction of cut.
fn rotation_for(forward: &ThreadGeometry, stated: proto::SpindleRotation, hand: Option<Hand>) -> SpindleRotation {
    match stated {
        proto::SpindleRotation::Reverse => SpindleRotation::Reverse,
        proto::SpindleRotation::Unspecified if hand.is_some_and(|wanted| wanted != forward.hand()) => {
            SpindleRotation::Reverse
        }
        proto::SpindleRotation::Forward | proto::SpindleRotation::Unspecified => SpindleRotation::Forward,
    }
}

const fn hand_from_proto(hand: proto::ThreadHand) -> Option<Hand> {
    match hand {
        proto::ThreadHand::Unspecified => None,
        proto::ThreadHand::Right => Some(Hand::Right),
        proto::ThreadHand::Left => Some(Hand::Left),
    }
}

fn infeed(checked: &mut Checked<'_>, given: &proto::PlanThreadRequest) -> Option<InfeedPattern> {
    let relief_deg = checked.or("relief_angle_deg", given.relief_angle_deg, 3.0, 0.0..=85.0);
    Some(match enumeration(checked.0, "infeed", given.infeed)? {
        proto::InfeedPattern::Unspecified | proto::InfeedPattern::Radial => InfeedPattern::Radial,
        proto::InfeedPattern::Flank => InfeedPattern::Flank,
        proto::InfeedPattern::ModifiedFlank => InfeedPattern::ModifiedFlank { relief_deg },
        proto::InfeedPattern::AlternatingFlank => InfeedPattern::AlternatingFlank,
    })
}

/// What machine and request allow: one axis carries the lead, the other the vibration; of several axes for one letter the
/// weakest counts. What neither states is not judged.
fn limits(
    checked: &mut Checked<'_>,
    given: &proto::PlanThreadRequest,
    machine_field: &str,
    profile: Option<&MachineProfile>,
) -> Option<ThreadLimits> {
    let period_us = if given.interpolation_period_us == 0 { DEFAULT_PERIOD_US } else { given.interpolation_period_us };
    let periods = f64::from(MIN_PERIOD_US)..=f64::from(MAX_PERIOD_US);
    let settings = profile.map_or_else(ThreadVibrationSettings::default, |profile| profile.thread_vibration);
    let approach_mm = settings.approach_mm.unwrap_or(f64::INFINITY);
    let thickness_mm = settings.max_thickness_mm.unwrap_or(f64::INFINITY);
    let finishing_mm = given.finishing_thickness_mm.map(|mm| checked.within("finishing_thickness_mm", mm, LENGTH_MM));
    let stated = ThreadLimits {
        approach_mm: checked.or("approach_mm", given.approach_mm, approach_mm, 0.0..=1e6),
        thickness_mm: checked.or("max_thickness_mm", given.max_thickness_mm, thickness_mm, LENGTH_MM),
        finishing_thickness_mm: finishing_mm.or(settings.max_finishing_thickness_mm),
        period_s: checked.within("interpolation_period_us", f64::from(period_us), periods) * 1e-6,
        ..ThreadLimits::default()
    };
    let profile = profile?;
    let machine = &profile.machine;
    let least = |letter: Axis, limit: fn(&MachineAxis) -> f64| {
        machine.axes.iter().filter(|axis| axis.axis == letter).map(limit).reduce(f64::min)
    };
    let of = |letter| {
        let velocity = least(letter, |axis| axis.max_velocity_per_s)?;
        let acceleration = least(letter, |axis| axis.max_acceleration_per_s2)?;
        Some((velocity, acceleration, least(letter, |axis| axis.max_jerk_per_s3)?))
    };
    let (MachineKind::Lathe, Some(x), Some(z)) = (machine.kind, of(Axis::X), of(Axis::Z)) else {
        checked.0.add(machine_field, "must be a lathe with axes X and Z");
        return None;
    };
    let (lead_axis, lead, vibrating) = match given.lead_axis() {
        proto::ThreadLeadAxis::X => (LeadAxis::X, x, z),
        proto::ThreadLeadAxis::Z | proto::ThreadLeadAxis::Unspecified => (LeadAxis::Z, z, x),
    };
    // On a taper the axis across accelerates with the lead axis, too.
    let share = if given.taper == 0.0 { 1.0 } else { 1.0 - TAPER_SHARE };
    Some(ThreadLimits {
        lead_velocity_mm_per_s: lead.0,
        lead_acceleration_mm_per_s2: lead.1,
        lead_jerk_mm_per_s3: lead.2,
        vibration_velocity_mm_per_s: vibrating.0,
        vibration_acceleration_mm_per_s2: share * vibrating.1,
        vibration_jerk_mm_per_s3: share * vibrating.2,
        max_spindle_rev_per_min: machine.max_spindle_rev_per_min,
        drives: ThreadDrives {
            vibrating: profile.following.of(lead_axis.across()),
            lead: profile.following.of(lead_axis.along()),
        },
        ..stated
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> proto::PlanThreadRequest {
        proto::PlanThreadRequest {
            advance: Some(Advance::PitchMm(1.5)),
            work_diameter_mm: 10.0,
            start_z_mm: 5.0,
            end_z_mm: -20.0,
            depth_mm: 0.92,
            first_depth_mm: 0.35,
            spindle_rev_per_min: 300.0,
            ..proto::PlanThreadRequest::default()
        }
    }

    fn convert_on(profile: &MachineProfile, request: &proto::PlanThreadRequest) -> Result<ThreadRequest, Vec<String>> {
        let mut violations = Violations::default();
        let converted = thread_request_from_proto(&mut violations, request, "machine", Some(profile));
        let fields = violations.as_slice().iter().map(|violation| violation.field.clone()).collect();
        converted.map(|(request, _)| request).ok_or(fields)
    }

    #[test]
    fn what_is_left_open_is_as_documented() {
        let lathe = MachineProfile::lathe();
        let converted = convert_on(&lathe, &request()).unwrap();
        assert_eq!((converted.geometry.lead_mm, converted.geometry.starts), (1.5, 1));
        assert_eq!(converted.profile, GrooveProfile::pointed(60.0));
        assert_eq!((converted.finishing_allowance_mm, converted.vibrations_per_rev), (0.02, 2.0));
        assert_eq!(converted.limits.period_s, 0.001);
        assert!(converted.limits.approach_mm.is_infinite() && converted.limits.thickness_mm.is_infinite());
        let z = lathe.machine.axes.iter().find(|axis| axis.axis == Axis::Z).unwrap();
        assert_eq!(converted.limits.lead_jerk_mm_per_s3, z.max_jerk_per_s3);
    }

    #[test]
    fn pitch_lead_and_threads_per_inch_say_the_same() {
        let lathe = MachineProfile::lathe();
        for (advance, lead_mm) in
            [(Advance::PitchMm(1.27), 2.54), (Advance::LeadMm(2.54), 2.54), (Advance::ThreadsPerInch(20.0), 2.54)]
        {
            let request = proto::PlanThreadRequest { advance: Some(advance), starts: 2, ..request() };
            assert!((convert_on(&lathe, &request).unwrap().geometry.lead_mm - lead_mm).abs() < 1e-12);
        }
    }

    #[test]
    fn the_spindle_turns_as_the_wanted_hand_needs() {
        let lathe = MachineProfile::lathe();
        let hand = |hand: proto::ThreadHand, rotation: proto::SpindleRotation| {
            let request = proto::PlanThreadRequest { hand: hand.into(), rotation: rotation.into(), ..request() };
            convert_on(&lathe, &request).unwrap().geometry.rotation
        };
        let open = proto::SpindleRotation::Unspecified;
        assert_eq!(hand(proto::ThreadHand::Right, open), SpindleRotation::Forward);
        assert_eq!(hand(proto::ThreadHand::Left, open), SpindleRotation::Reverse);
        // What contradicts is left to the planner, which says so.
        assert_eq!(hand(proto::ThreadHand::Left, proto::SpindleRotation::Forward), SpindleRotation::Forward);
    }

    #[test]
    fn a_thread_on_a_face_leads_along_x() {
        let mut lathe = MachineProfile::lathe();
        lathe.machine.axes[0].max_velocity_per_s = 123.0;
        let face = proto::PlanThreadRequest {
            lead_axis: proto::ThreadLeadAxis::X.into(),
            work_diameter_mm: 0.0,
            start_z_mm: 0.0,
            end_z_mm: 0.0,
            face_z_mm: -1.5,
            start_radius_mm: 40.0,
            end_radius_mm: 10.0,
            ..request()
        };
        let converted = convert_on(&lathe, &face).unwrap();
        let geometry = converted.geometry;
        assert_eq!((geometry.lead_axis, geometry.work_mm), (LeadAxis::X, -1.5));
        assert_eq!((geometry.start_mm, geometry.end_mm), (40.0, 10.0));
        assert_eq!(converted.limits.lead_velocity_mm_per_s, 123.0);
        let wrong = proto::PlanThreadRequest {
            side: proto::ThreadSide::Internal.into(),
            hand: proto::ThreadHand::Left.into(),
            start_z_mm: 5.0,
            end_radius_mm: -1.0,
            ..face
        };
        let fields = convert_on(&lathe, &wrong).unwrap_err();
        assert_eq!(fields, ["side", "hand", "start_z_mm", "end_radius_mm"]);
        let mixed = proto::PlanThreadRequest { face_z_mm: 1.0, ..request() };
        assert_eq!(convert_on(&lathe, &mixed).unwrap_err(), ["face_z_mm"]);
    }

    #[test]
    fn every_wrong_field_is_named() {
        let wrong = proto::PlanThreadRequest {
            side: 9,
            advance: None,
            work_diameter_mm: f64::NAN,
            starts: 31,
            taper: 2.0,
            end_z_mm: 5.0,
            depth_mm: -1.0,
            finishing_allowance_mm: Some(3.0),
            spindle_rev_per_min: 1e9,
            vibrations_per_rev: Some(0.0),
            amplitude_ratio: Some(1.0),
            interpolation_period_us: 7,
            infeed: 77,
            ..request()
        };
        let mut fields = convert_on(&MachineProfile::mill(), &wrong).unwrap_err();
        fields.sort_unstable();
        assert_eq!(
            fields,
            [
                "advance",
                "amplitude_ratio",
                "depth_mm",
                "end_z_mm",
                "finishing_allowance_mm",
                "infeed",
                "interpolation_period_us",
                "machine",
                "side",
                "spindle_rev_per_min",
                "starts",
                "taper",
                "vibrations_per_rev",
                "work_diameter_mm"
            ]
        );
    }
}
