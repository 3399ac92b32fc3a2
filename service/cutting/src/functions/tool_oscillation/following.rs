//! What the drives leave of an oscillation (docs/functions/path-vibration.md, "Will the machine follow?").

use feedwave_program::{Axis, Finding};

use super::findings::PHASE_TOLERANCE_DEG;
use super::motion::DirectionMotion;
use super::{OscillationDirection, OscillationJob, OscillationReport, ToolOscillation, code};
use crate::shared::following::{DriveModel, FollowingModel, Harmonics};
use crate::shared::wording::{decimal, round_to};

/// Shares of an amplitude between which what arrives is not worth a word.
const UNMENTIONED_SHARES: core::ops::RangeInclusive<f64> = 0.9..=1.1;

/// The drives of the axes that carry out an oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationDrives<'a> {
    /// What the machine profile states of them.
    pub model: &'a FollowingModel,
    /// Whether the tool is guided: any linear axis then carries a part of any direction.
    pub guided: bool,
}

/// What arrives at the tool of an oscillation.
#[derive(Clone, Debug, PartialEq)]
pub struct OscillationFollowing {
    /// Every direction on every axis that may carry it.
    pub directions: Vec<DirectionFollowing>,
    /// By how much the largest protrusion at the tool comes after the largest retreat there, degrees within ±180, of the axes
    /// with which that is worst.
    pub phase_error_deg: f64,
    /// How far the tool leaves its path across the feed because the axes of the plane differ, mm, at most; `None` where a guided
    /// tool or an inclined path mixes three axes that differ, which is not judged.
    pub contour_error_mm: Option<f64>,
}

/// What arrives of one direction where one axis carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionFollowing {
    /// The direction.
    pub direction: OscillationDirection,
    /// The axis.
    pub axis: Axis,
    /// Gain at the frequency of the oscillation.
    pub gain: f64,
    /// Lag at that frequency, degrees of the oscillation from 0 to 360.
    pub lag_deg: f64,
    /// Half of the peak to peak that arrives, with all harmonics of the waveform, mm.
    pub arriving_amplitude_mm: f64,
    /// Amplitude to command so that the programmed one arrives, mm; `None` where the drive erases it.
    pub amplitude_to_command_mm: Option<f64>,
    /// Phase to command: the condition's with the lag added, degrees within ±180.
    pub phase_to_command_deg: f64,
}

impl OscillationFollowing {
    /// What arrives; `None` where nothing is stated of the drives.
    pub(super) fn of(job: &OscillationJob<'_>, oscillation: &ToolOscillation, period_s: f64) -> Option<Self> {
        let drives = job.drives.filter(|drives| drives.model.is_stated())?;
        const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];
        let (plane, axial): (&[Axis], &[Axis]) =
            if drives.guided { (&ALL, &ALL) } else { (&[Axis::X, Axis::Y], &[Axis::Z]) };
        // Where the path climbs or descends, Z has a part of the feed.
        let feed: &[Axis] = if job.cut.incline_deg == 0.0 { plane } else { &ALL };
        let cross = oscillation.cross.as_ref().map(|cross| (OscillationDirection::Cross, cross, plane));
        let moving = [
            (OscillationDirection::Feed, &oscillation.feed, feed),
            (OscillationDirection::Axial, &oscillation.axial, axial),
        ];
        let mut directions = Vec::new();
        for (direction, motion, axes) in moving.into_iter().chain(cross).filter(|it| it.1.amplitude_mm > 0.0) {
            let harmonics = Harmonics::of(|turns| motion.offset_mm(turns));
            directions.extend(
                axes.iter()
                    .map(|&axis| arrival(direction, axis, motion, &harmonics, &drives.model.of(axis), 1.0 / period_s)),
            );
        }
        Some(Self {
            phase_error_deg: worst_phase_error_deg(oscillation, &directions),
            contour_error_mm: contour_error_mm(&drives, feed, oscillation, 1.0 / period_s),
            directions,
        })
    }
}

fn arrival(
    direction: OscillationDirection,
    axis: Axis,
    motion: &DirectionMotion,
    harmonics: &Harmonics,
    drive: &DriveModel,
    frequency_hz: f64,
) -> DirectionFollowing {
    let arriving = harmonics.through(drive, frequency_hz);
    let lag_deg = arriving.lag_rad.to_degrees();
    let share = arriving.amplitude / motion.amplitude_mm;
    DirectionFollowing {
        direction,
        axis,
        gain: arriving.gain,
        lag_deg,
        arriving_amplitude_mm: arriving.amplitude,
        amplitude_to_command_mm: DriveModel::command_for(motion.amplitude_mm, share),
        phase_to_command_deg: within_half_turn(360.0 * motion.phase_turns + lag_deg),
    }
}

/// The phase errors at the tool: a lagging axis comes later to its largest protrusion, or to its largest retreat.
fn phase_errors_deg(commanded_deg: f64, directions: &[DirectionFollowing]) -> impl Iterator<Item = f64> {
    let of = move |direction| directions.iter().filter(move |it| it.direction == direction);
    of(OscillationDirection::Axial).flat_map(move |axial| {
        of(OscillationDirection::Feed).map(move |feed| within_half_turn(commanded_deg + axial.lag_deg - feed.lag_deg))
    })
}

/// That of the axes with which it is worst.
fn worst_phase_error_deg(oscillation: &ToolOscillation, directions: &[DirectionFollowing]) -> f64 {
    phase_errors_deg(oscillation.phase_error_deg(), directions)
        .fold(None, |worst: Option<f64>, error| Some(worst.filter(|worst| worst.abs() >= error.abs()).unwrap_or(error)))
        .unwrap_or(0.0)
}

/// Of a unit vector s over axes with the responses H, ‖(H − sᵀHs)·s‖² = Σ sᵢ²·|Hᵢ − m|² with m their weighted mean is largest
/// for two axes at half of |H₁ − H₂|.
fn contour_error_mm(
    drives: &OscillationDrives<'_>,
    plane: &[Axis],
    oscillation: &ToolOscillation,
    frequency_hz: f64,
) -> Option<f64> {
    if drives.model.shared_by(plane.iter().copied()).is_some() {
        return Some(0.0);
    }
    let [first, second] = plane else { return None };
    let [first, second] = [first, second].map(|axis| drives.model.of(*axis).response(frequency_hz));
    let cross_mm = oscillation.cross.as_ref().map_or(0.0, |cross| cross.amplitude_mm);
    Some(0.5 * first.minus(second).magnitude() * (oscillation.feed.amplitude_mm + cross_mm))
}

/// What the drives make of an oscillation that is possible.
pub(super) fn findings(job: &OscillationJob<'_>, report: &OscillationReport, findings: &mut Vec<Finding>) {
    let Some(following) = &report.following else { return };
    for arriving in &following.directions {
        let Some(load) = report.loads.iter().find(|load| load.direction == arriving.direction) else { continue };
        let share = arriving.arriving_amplitude_mm / load.amplitude_mm;
        if UNMENTIONED_SHARES.contains(&share) {
            continue;
        }
        let name = match arriving.direction {
            OscillationDirection::Feed => "feed",
            OscillationDirection::Axial => "axial",
            OscillationDirection::Cross => "cross",
        };
        let letter = arriving.axis.letter();
        let message = format!(
            "of the {name} amplitude of {} mm {} mm arrive at the tool where {letter} carries it",
            decimal(load.amplitude_mm, 4),
            decimal(arriving.arriving_amplitude_mm, 5)
        );
        let finding = Finding::new(code::OSC_FOLLOWING_NOTED, job.span, message)
            .ranked(format!("{name} {letter}"), (share - 1.0).abs())
            .with_value("arriving_amplitude", arriving.arriving_amplitude_mm, "mm")
            .with_value("gain", arriving.gain, "")
            .with_value("lag", arriving.lag_deg, "deg");
        // The share is the same of every amplitude: no amplitude ends the finding.
        let finding = match arriving.amplitude_to_command_mm {
            Some(command_mm) => finding.suggest(format!(
                "nothing has to be changed where that is wanted; {} mm arrive of {} mm running ahead by {} degrees, and of every \
                 amplitude the same share, so that this is said of it again",
                decimal(load.amplitude_mm, 4),
                decimal(round_to(command_mm, 4), 4),
                decimal(arriving.phase_to_command_deg, 3)
            )),
            None => finding,
        };
        findings.push(finding.suggest("a slower spindle, or a drive with less lag, lets it arrive as it is commanded"));
    }
    phase(job, report, following.phase_error_deg, findings);
}

/// The drives move protrusion and retreat apart.
fn phase(job: &OscillationJob<'_>, report: &OscillationReport, error_deg: f64, findings: &mut Vec<Finding>) {
    if error_deg.abs() <= PHASE_TOLERANCE_DEG || report.phase_error_deg.abs() > PHASE_TOLERANCE_DEG {
        return;
    }
    let message = format!(
        "at the tool the largest protrusion comes {} degrees {} the largest retreat in the feed direction",
        decimal(error_deg.abs(), 2),
        if error_deg > 0.0 { "after" } else { "before" }
    );
    let finding = Finding::new(code::OSC_FOLLOWING, job.span, message).ranked("phase", error_deg.abs()).with_value(
        "phase_error",
        error_deg,
        "deg",
    );
    findings.push(suggest_phase(finding, job, report));
}

/// The axial phase with which protrusion and retreat come together at the tool, whichever axes carry them.
pub(super) fn suggest_phase(finding: Finding, job: &OscillationJob<'_>, report: &OscillationReport) -> Finding {
    let commanded_deg = report.phase_error_deg;
    let [least, most] = match &report.following {
        Some(following) => phase_errors_deg(commanded_deg, &following.directions)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], error| [least.min(error), most.max(error)]),
        None => [commanded_deg; 2],
    };
    if most - least > 2.0 * PHASE_TOLERANCE_DEG {
        let message = format!(
            "no phase serves all axes that carry the feed: their errors lie between {} and {} degrees; give them the same \
             drive",
            decimal(least, 2),
            decimal(most, 2)
        );
        return finding.suggest(message);
    }
    // To a thousandth, and no negative zero.
    let cure_deg = round_to(within_half_turn(job.condition.axial.phase_deg + 0.5 * (least + most)), 3) + 0.0;
    finding.suggest_value(
        format!("let the axial oscillation run ahead by {} degrees", decimal(cure_deg, 3)),
        None,
        "axial_phase",
        cure_deg,
        "deg",
    )
}

/// An angle, degrees, within ±180.
fn within_half_turn(angle_deg: f64) -> f64 {
    angle_deg - 360.0 * (angle_deg / 360.0).round()
}
