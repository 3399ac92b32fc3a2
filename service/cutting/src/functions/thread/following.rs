//! What the drives leave of a vibrating thread (docs/functions/path-vibration.md, "Will the machine follow?").
//!
//! X is commanded to retreat by (A/2)·(1 − cos ψ). Its mean arrives, its wave with gain g and lag φ:
//! (A/2)·(1 − g) + (g·A/2)·(1 − cos(ψ − φ)): a thread of amplitude g·A, phase shift Δ + φ, and less deep by (A/2)·(1 − g), or
//! deeper where the drives resonate. So A/g, Δ − φ and a depth larger by (A/g − A)/2 make the thread that is programmed.

use feedwave_program::{Finding, FindingCode, FindingLog};

use super::chip::chip;
use super::{ChipLevel, ThreadJob, ThreadLimits, ThreadPass, ThreadReport, code, following_cures, reduce_deg};
use crate::shared::following::DriveModel;
use crate::shared::wording::{decimal, round_up};

/// Share of an amplitude that has to arrive at the tool.
const ARRIVING_SHARE: f64 = 0.9;
/// Depth beyond the programmed one that is not worth a word, mm.
const TOO_DEEP_MM: f64 = 1e-4;

/// The drives of a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThreadDrives {
    /// Of the axis that vibrates.
    pub vibrating: DriveModel,
    /// Of the lead axis.
    pub lead: DriveModel,
}

/// What arrives of a thread behind its start-up.
#[derive(Clone, Debug, PartialEq)]
pub struct ThreadFollowing {
    /// Gain of the vibrating axis at the vibration's frequency.
    pub gain: f64,
    /// Its lag, degrees of the vibration from 0 to 360.
    pub lag_deg: f64,
    /// By how much the lead axis is behind the spindle, mm; the same in every pass at the same speed.
    pub lead_lag_mm: f64,
    /// On a taper, how far the thread is beside the programmed one because both axes lag differently, mm; 0 for a straight
    /// thread.
    pub contour_error_mm: f64,
    /// Every pass.
    pub passes: Vec<PassFollowing>,
}

/// What arrives of one pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassFollowing {
    /// Peak-to-peak amplitude at the tool, mm on the radius; 0 without vibration.
    pub arriving_amplitude_mm: f64,
    /// By how much the tool stays above the programmed depth, mm on the radius; negative where it goes deeper.
    pub above_depth_mm: f64,
    /// Amplitude to command, mm on the radius; `None` where the drives erase the vibration.
    pub amplitude_to_command_mm: Option<f64>,
    /// Depth to command with it, mm below the work's surface on the radius.
    pub depth_to_command_mm: Option<f64>,
    /// Phase shift to command, degrees from 0 to 360.
    pub phase_shift_to_command_deg: f64,
    /// Whether the chip is cut through by what arrives, looking at the depth only.
    pub depth_broken: bool,
    /// The same with the full section.
    pub section_broken: bool,
}

impl ThreadFollowing {
    /// What arrives of a thread; `None` where nothing is stated of its drives.
    pub(super) fn of(job: &ThreadJob, drives: &ThreadDrives) -> Option<Self> {
        if !drives.vibrating.is_stated() && !drives.lead.is_stated() {
            return None;
        }
        let frequency_hz = job.frequency_hz();
        let gain = drives.vibrating.gain(frequency_hz);
        let lag_deg = drives.vibrating.lag_rad(frequency_hz).to_degrees();
        let above_mm = |pass: &ThreadPass| 0.5 * pass.amplitude_mm * (1.0 - gain);
        let mut arriving = job.clone();
        for pass in &mut arriving.passes {
            pass.depth_mm -= above_mm(pass);
            pass.amplitude_mm *= gain;
            pass.phase_shift_deg = reduce_deg(pass.phase_shift_deg + lag_deg);
        }
        let broken = |index, level| chip(&arriving, index, level).broken;
        let passes = job.passes.iter().enumerate().map(|(index, pass)| {
            let amplitude_to_command_mm = DriveModel::command_for(pass.amplitude_mm, gain);
            PassFollowing {
                arriving_amplitude_mm: arriving.passes[index].amplitude_mm,
                above_depth_mm: above_mm(pass),
                amplitude_to_command_mm,
                depth_to_command_mm: amplitude_to_command_mm
                    .map(|amplitude_mm| pass.depth_mm + 0.5 * (amplitude_mm - pass.amplitude_mm)),
                phase_shift_to_command_deg: reduce_deg(pass.phase_shift_deg - lag_deg),
                depth_broken: broken(index, ChipLevel::Depth),
                section_broken: broken(index, ChipLevel::Section),
            }
        });
        let passes = passes.collect();
        let lead_mm_per_s = job.geometry.lead_mm * job.spindle_rev_per_min / 60.0;
        let [lead_lag_s, across_lag_s] = [drives.lead, drives.vibrating].map(|drive| drive.steady_lag_s());
        // δ = −(L_x·ẋ, L_z·ż), across the path (ẋ, ż): |L_x − L_z|·|ẋ·ż|/|v|.
        let taper = job.geometry.taper;
        let across_mm = (across_lag_s - lead_lag_s).abs() * taper.abs() * lead_mm_per_s;
        Some(Self {
            gain,
            lag_deg,
            lead_lag_mm: lead_lag_s * lead_mm_per_s,
            contour_error_mm: across_mm / libm::hypot(1.0, taper),
            passes,
        })
    }
}

/// Whether a pass goes beyond its depth.
pub(super) fn is_too_deep(arriving: &PassFollowing) -> bool {
    arriving.above_depth_mm < -TOO_DEEP_MM
}

/// Passes that lose their vibration, their broken chip or their depth to the drives.
pub(super) fn findings(job: &ThreadJob, limits: &ThreadLimits, report: &ThreadReport, findings: &mut FindingLog) {
    let Some(following) = &report.following else { return };
    let passes = job.passes.iter().zip(&report.passes).zip(&following.passes).enumerate();
    // Of the thread as a whole, and looked for once.
    let (mut ratio, mut speed) = (None, None);
    for (index, ((pass, own), arriving)) in passes.filter(|(_, ((pass, _), _))| pass.vibrates()) {
        if own.depth.broken && !arriving.depth_broken {
            let amplitude_mm = following_cures::amplitude_mm(job, index, limits);
            let ratio = *ratio.get_or_insert_with(|| following_cures::ratio(job, limits));
            let speed = *speed.get_or_insert_with(|| following_cures::spindle_speed(job, limits));
            let finding = lost(job, index, arriving, code::THREAD_FOLLOWING_LOSS, ", too little to break the chip");
            findings.push(suggest(finding.ranked("", 1.0 + pass.amplitude_mm), job, index, amplitude_mm, ratio, speed));
        } else if following.gain < ARRIVING_SHARE {
            let enough = if arriving.depth_broken { ", enough to break the chip" } else { "" };
            let finding = lost(job, index, arriving, code::THREAD_FOLLOWING_LOSS_NOTED, enough);
            findings.push(compensation(finding.ranked("", pass.amplitude_mm), job, pass, arriving));
        }
        if is_too_deep(arriving) {
            let speed = *speed.get_or_insert_with(|| following_cures::spindle_speed(job, limits));
            let finding = suggest(too_deep(job, index, arriving), job, index, None, None, speed);
            findings.push(compensation(finding, job, pass, arriving));
        }
    }
}

fn too_deep(job: &ThreadJob, index: usize, arriving: &PassFollowing) -> Finding {
    let (pass, number, deeper_mm) = (&job.passes[index], index as u64 + 1, -arriving.above_depth_mm);
    let message = format!(
        "the drives make {} mm of the amplitude of {} mm {} in pass {number}: it cuts {} mm too deep",
        decimal(arriving.arriving_amplitude_mm, 4),
        decimal(pass.amplitude_mm, 4),
        job.geometry.lead_axis.across_words(),
        decimal(deeper_mm, 4)
    );
    Finding::new(code::THREAD_FOLLOWING_DEEP, pass.span, message)
        .at("pass", number)
        .ranked("", deeper_mm)
        .with_value("arriving_amplitude", arriving.arriving_amplitude_mm, "mm")
        .with_value("too_deep", deeper_mm, "mm")
}

fn lost(job: &ThreadJob, index: usize, arriving: &PassFollowing, code: FindingCode, consequence: &str) -> Finding {
    let (pass, number) = (&job.passes[index], index as u64 + 1);
    let message = format!(
        "of {} mm amplitude {} only {} mm arrive in pass {number}, {} mm above its depth{consequence}",
        decimal(pass.amplitude_mm, 4),
        job.geometry.lead_axis.across_words(),
        decimal(arriving.arriving_amplitude_mm, 4),
        decimal(arriving.above_depth_mm, 4)
    );
    Finding::new(code, pass.amplitude_span(), message)
        .at("pass", number)
        .with_value("arriving_amplitude", arriving.arriving_amplitude_mm, "mm")
        .with_value("above_depth", arriving.above_depth_mm, "mm")
}

/// The changes that were judged to end a finding.
fn suggest(
    mut finding: Finding,
    job: &ThreadJob,
    index: usize,
    amplitude_mm: Option<f64>,
    ratio: Option<f64>,
    speed: Option<f64>,
) -> Finding {
    let pass = &job.passes[index];
    if let Some(ratio) = ratio {
        let cure = format!("use a ratio of {} for all passes", decimal(ratio, 2));
        finding = finding.suggest_value(cure, None, "ratio", ratio, "");
    }
    if let Some(amplitude_mm) = amplitude_mm {
        let text = pass.amplitude_text(amplitude_mm, job.geometry.lead_axis.across_words());
        let word = pass.amplitude_replacement(amplitude_mm);
        let cure = pass.cure_by_word(format!("command {text} in this pass, of which enough arrives"));
        finding = finding.suggest_value(cure, word, "amplitude", amplitude_mm, "mm");
    }
    if let Some(speed) = speed {
        let cure =
            format!("turn at {} rev/min, where what arrives breaks the chip and cuts no deeper", decimal(speed, 1));
        finding = finding.suggest_value(cure, None, "spindle_speed", speed, "rev/min");
    }
    if finding.suggestions.is_empty() {
        return finding.suggest("use fewer vibrations per revolution, or state a drive that follows them");
    }
    finding
}

/// What makes the thread that the program states; the program then states another one, of which the same is said.
fn compensation(finding: Finding, job: &ThreadJob, pass: &ThreadPass, arriving: &PassFollowing) -> Finding {
    let (Some(amplitude_mm), Some(depth_mm)) = (arriving.amplitude_to_command_mm, arriving.depth_to_command_mm) else {
        return finding.suggest("turn slower, use fewer vibrations per revolution, or shorten the filter of the drive");
    };
    let across = job.geometry.lead_axis.across_words();
    finding.suggest(format!(
        "nothing has to be changed where what arrives is wanted; the amplitude and depth of this pass arrive of {} at a depth of {} \
         mm {across}, with a phase shift of {} degrees, of which the same is said again: the share that arrives stays",
        pass.amplitude_text(round_up(amplitude_mm, 4), across),
        decimal(depth_mm, 4),
        decimal(arriving.phase_shift_to_command_deg, 3)
    ))
}
