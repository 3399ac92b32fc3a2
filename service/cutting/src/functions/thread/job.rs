//! The passes of a thread, and the position of the tool as a pure function of pass and spindle angle
//! (docs/functions/thread-vibration.md, "Amplitude" and "Phase").

use feedwave_program::{SourceSpan, ThreadAmplitudeWord};
use serde::{Deserialize, Serialize};

use super::run_up::LeadTravel;
use super::{GrooveProfile, RetreatWave, RunUp, StartUp, ThreadGeometry};
use crate::shared::wording::{decimal, word};

/// Decimals of an amplitude word, in mm: half of its 0.1 µm on the radius is written exactly.
const MM_PLACES: usize = 4;
/// The same in inches: 25 pm.
const INCH_PLACES: usize = 9;

/// One threading pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ThreadPass {
    /// Which start of a multi-start thread it cuts, from 0.
    pub start: u32,
    /// Depth below the work's surface, mm on the radius.
    pub depth_mm: f64,
    /// Start position, mm of travel beyond the thread's start position: 0 on every pass of method 2.
    pub start_travel_mm: f64,
    /// Start angle Q, degrees: 0 on every pass of method 1 of a thread with one start.
    pub start_angle_deg: f64,
    /// Peak-to-peak vibration A, mm on the radius; 0 without vibration.
    pub amplitude_mm: f64,
    /// The word of the amplitude, where the pass is of a program and can have one.
    pub amplitude_word: Option<ThreadAmplitudeWord>,
    /// Phase shift Δ, degrees.
    pub phase_shift_deg: f64,
    /// Place in the program.
    pub span: SourceSpan,
}

impl ThreadPass {
    /// Whether the tool vibrates in this pass.
    #[must_use]
    pub fn vibrates(&self) -> bool {
        self.amplitude_mm > 0.0
    }

    /// The place at which its amplitude is changed: its word, or the block.
    pub(super) fn amplitude_span(&self) -> SourceSpan {
        self.amplitude_word.and_then(|word| word.span).unwrap_or(self.span)
    }

    /// An amplitude, mm, as it is told: `place` says in which direction it is, and the word how it is written.
    pub(super) fn amplitude_text(&self, amplitude_mm: f64, place: &str) -> String {
        let mm = decimal(amplitude_mm, 4);
        match self.amplitude_written(amplitude_mm) {
            Some(word) => format!("{mm} mm {place} ({word})"),
            None => format!("{mm} mm {place}"),
        }
    }

    /// A cure by the amplitude or the phase shift of this pass alone: a cycle has a word for neither.
    pub(super) fn cure_by_word(&self, cure: String) -> String {
        let is_of_cycle = self.amplitude_word.is_none() && self.span.column > 0;
        if is_of_cycle { format!("{cure}; a cycle has no word for it, a threading block of its own has") } else { cure }
    }

    /// The word that replaces that at [`ThreadPass::amplitude_span`]; `None` where that is the block.
    pub(super) fn amplitude_replacement(&self, amplitude_mm: f64) -> Option<String> {
        self.amplitude_word?.span?;
        self.amplitude_written(amplitude_mm)
    }

    fn amplitude_written(&self, amplitude_mm: f64) -> Option<String> {
        let unit_mm = self.amplitude_word?.mm_per_unit;
        Some(word('A', amplitude_mm / unit_mm, if unit_mm > 1.0 { INCH_PLACES } else { MM_PLACES }))
    }
}

/// A thread with all its passes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadJob {
    /// The thread.
    pub geometry: ThreadGeometry,
    /// Section of its groove.
    pub profile: GrooveProfile,
    /// Vibrations per spindle revolution D.
    pub vibrations_per_rev: f64,
    /// How the vibration of every pass starts.
    pub start_up: StartUp,
    /// How the lead axis starts; it comes to rest at the end by the same law backwards.
    pub run_up: RunUp,
    /// Spindle speed S, rev/min.
    pub spindle_rev_per_min: f64,
    /// The passes in the order of cutting.
    pub passes: Vec<ThreadPass>,
}

/// Where the tool is in a pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThreadPosition {
    /// X on the radius, mm.
    pub radius_mm: f64,
    /// Z, mm.
    pub z_mm: f64,
    /// Travel of the lead axis from the thread's start position, mm.
    pub travel_mm: f64,
    /// Retreat from the programmed depth, mm across the lead, within 0 and A.
    pub retreat_mm: f64,
}

/// Where a pass lies against the first pass of its groove.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroovePlace {
    /// Revolutions by which it comes later to the same place on the work: a start angle of nearly a full turn
    /// makes it one.
    pub turns_later: i64,
    /// Axial offset, mm in the direction of travel, at most half a lead.
    pub axial_offset_mm: f64,
    /// Depth of the tip below the work's surface where the first pass is at the same moment, mm: on a taper the
    /// axial offset changes it.
    pub tip_depth_mm: f64,
    /// Phase shift at the same place on the work, degrees from 0 to 360: Δ − D·360°·turns.
    pub phase_shift_deg: f64,
}

impl ThreadJob {
    /// Vibration of a pass.
    #[must_use]
    pub fn wave(&self, pass: &ThreadPass) -> RetreatWave {
        RetreatWave {
            amplitude_mm: pass.amplitude_mm,
            vibrations_per_rev: self.vibrations_per_rev,
            phase_shift_deg: pass.phase_shift_deg,
        }
    }

    /// Position of the tool in a pass at a spindle angle from the thread-start reference point, degrees; negative
    /// before it, beyond 360 in later revolutions.
    ///
    /// Before its start the lead axis rests at the start position, beyond its end it rests there. The
    /// vibration depends on the spindle angle only: not on start angle, start position or spindle speed.
    #[must_use]
    pub fn position(&self, pass: &ThreadPass, spindle_angle_deg: f64) -> ThreadPosition {
        let turned_deg = self.lead_travel(pass).synchronous_deg(spindle_angle_deg - pass.start_angle_deg);
        let travel_mm = pass.start_travel_mm + self.geometry.lead_mm * (turned_deg / 360.0);
        // A pass that would start beyond the end stays where it starts.
        let travel_mm = travel_mm.min(self.geometry.length_mm().max(pass.start_travel_mm));
        let retreat_mm = self.wave(pass).retreat_mm(self.start_up, spindle_angle_deg);
        // First the depth and then the retreat: a retreat of 0 is the programmed position to the bit.
        let across_mm = self.geometry.across_mm(pass.depth_mm, travel_mm) + self.geometry.inwards() * retreat_mm;
        let [radius_mm, z_mm] = self.geometry.lead_axis.place(across_mm, self.geometry.along_mm(travel_mm));
        ThreadPosition { radius_mm, z_mm, travel_mm, retreat_mm }
    }

    /// Spindle angle at which the lead axis reaches the end of a pass, degrees.
    #[must_use]
    pub fn end_angle_deg(&self, pass: &ThreadPass) -> f64 {
        pass.start_angle_deg + self.lead_travel(pass).angle_deg()
    }

    fn lead_travel(&self, pass: &ThreadPass) -> LeadTravel {
        let travel_mm = (self.geometry.length_mm() - pass.start_travel_mm).max(0.0);
        LeadTravel::new(self.run_up, 360.0 * travel_mm / self.geometry.lead_mm)
    }

    /// Length of a pass on which the lead is exact: without the travel of run-up and run-down, mm; negative where they
    /// do not fit.
    #[must_use]
    pub fn exact_length_mm(&self, pass: &ThreadPass) -> f64 {
        let wrong_mm = 2.0 * self.run_up.travel_mm(self.geometry.lead_mm);
        self.geometry.length_mm() - pass.start_travel_mm - wrong_mm
    }

    /// Infeed of a pass: the difference of its depth to the pass before it in the same groove, or to the
    /// work's surface, mm on the radius.
    ///
    /// The infeed |X_{k−1} − X_k|, which says nothing of several starts: each of them is a thread of its own.
    #[must_use]
    pub fn infeed_mm(&self, index: usize) -> f64 {
        let Some(pass) = self.passes.get(index) else { return 0.0 };
        let before = self.passes[..index].iter().rev().find(|before| before.start == pass.start);
        (pass.depth_mm - before.map_or(0.0, |before| before.depth_mm)).abs()
    }

    /// Gives every vibrating pass without an amplitude of its own A = infeed × ratio
    /// (docs/functions/thread-vibration.md, "Amplitude"); `own` says which amplitudes are programmed, mm on the radius.
    pub fn apply_ratio(&mut self, ratio: f64, own: impl Fn(usize) -> Option<f64>) {
        for index in 0..self.passes.len() {
            self.passes[index].amplitude_mm = own(index).unwrap_or_else(|| self.infeed_mm(index) * ratio);
        }
    }

    /// Where a pass lies against the first pass of its groove.
    #[must_use]
    pub fn place(&self, index: usize) -> GroovePlace {
        let Some(pass) = self.passes.get(index) else { return GroovePlace::default() };
        let first = self.passes.iter().find(|first| first.start == pass.start).unwrap_or(pass);
        let lead_mm = self.geometry.lead_mm;
        let origin = |pass: &ThreadPass| pass.start_travel_mm - lead_mm * pass.start_angle_deg / 360.0;
        let offset_mm = origin(pass) - origin(first);
        // A tool that is a whole lead behind comes to the same place one revolution later.
        let turns_later = -(offset_mm / lead_mm).round();
        let axial_offset_mm = offset_mm + turns_later * lead_mm;
        GroovePlace {
            turns_later: turns_later as i64,
            axial_offset_mm,
            tip_depth_mm: pass.depth_mm - self.geometry.inwards() * self.geometry.taper * axial_offset_mm,
            phase_shift_deg: super::reduce_deg(pass.phase_shift_deg - 360.0 * self.vibrations_per_rev * turns_later),
        }
    }

    /// Vibration phase at the moment at which the lead axis of a pass starts, degrees, not reduced and without its
    /// phase shift: D·Q (651.168° for D = 2 and Q = 325.584°).
    #[must_use]
    pub fn phase_advance_deg(&self, pass: &ThreadPass) -> f64 {
        self.vibrations_per_rev * pass.start_angle_deg
    }

    /// Vibrations per second, Hz.
    #[must_use]
    pub fn frequency_hz(&self) -> f64 {
        self.vibrations_per_rev * self.spindle_rev_per_min / 60.0
    }
}
