//! A thread as program text, in the words of docs/functions/thread-vibration.md, "Program words" and "Worked programs".

use feedwave_program::Axis;

use super::{LeadAxis, SpindleRotation, ThreadJob, default_phase_shift_deg};
use crate::shared::wording::{decimal, word};

/// What a program says besides its passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadTextOptions {
    /// Distance of the return path from the work's surface, mm on the radius.
    pub clearance_mm: f64,
    /// Amplitude ratio of the `G165` word; passes that follow it have no `A` word.
    pub ratio: f64,
}

impl Default for ThreadTextOptions {
    fn default() -> Self {
        Self { clearance_mm: 2.0, ratio: 1.2 }
    }
}

/// Program text of a thread, X, and A where X vibrates, as diameters, lengths in mm.
///
/// `A` is written where the amplitude does not follow the ratio, `R` where the phase shift is not the default one; both
/// are always written in a thread of several starts, whose passes a control may count differently, and on a taper,
/// where X differs between start positions at equal depth.
#[must_use]
pub fn thread_program_text(job: &ThreadJob, options: &ThreadTextOptions) -> String {
    let geometry = &job.geometry;
    let mut text = String::new();
    let mut line = |words: &[String]| {
        text.push_str(&words.join(" "));
        text.push('\n');
    };
    let spindle = match geometry.rotation {
        SpindleRotation::Forward => "M3",
        SpindleRotation::Reverse => "M4",
    };
    line(&[format!("(THREAD WITH VIBRATION, D = {})", decimal(job.vibrations_per_rev, 4))]);
    line(&["G97".to_owned(), format!("S{}", decimal(job.spindle_rev_per_min, 3)), spindle.to_owned()]);
    // Program words of a place along the lead and of one across it: X as a diameter.
    let [along, across] = [geometry.lead_axis.along(), geometry.lead_axis.across()];
    let scale = |axis: Axis| if axis == Axis::X { 2.0 } else { 1.0 };
    let along = |mm: f64| word(along.letter(), scale(along) * mm, 4);
    let across_scale = scale(across);
    let across = |mm: f64| word(across.letter(), across_scale * mm, 4);
    line(&["G165 P3".to_owned(), across(geometry.work_mm), word('Q', options.ratio, 4)]);
    // Clear of the work at both ends, whichever of them the taper makes the higher one.
    let clear_mm = |travel_mm: f64| geometry.across_mm(-options.clearance_mm, travel_mm);
    let ends = [clear_mm(0.0), clear_mm(geometry.length_mm())];
    let higher = |a: f64, b: f64| if geometry.inwards() > 0.0 { a.max(b) } else { a.min(b) };
    let mut clear = higher(ends[0], ends[1]);
    for pass in &job.passes {
        clear = higher(clear, clear_mm(pass.start_travel_mm));
    }
    // A narrow bore leaves no space for all of the clearance.
    let clear = across(if geometry.lead_axis == LeadAxis::Z { clear.max(0.0) } else { clear });
    let plain = geometry.starts <= 1 && geometry.taper == 0.0;
    for (index, pass) in job.passes.iter().enumerate() {
        line(&["G0".to_owned(), clear.clone()]);
        line(&["G0".to_owned(), along(geometry.along_mm(pass.start_travel_mm))]);
        line(&["G0".to_owned(), across(geometry.across_mm(pass.depth_mm, pass.start_travel_mm))]);
        let mut ends = vec![along(geometry.end_mm)];
        if geometry.taper != 0.0 {
            ends.push(across(geometry.across_mm(pass.depth_mm, geometry.length_mm())));
        }
        // In the order of a lathe's words: X, then Z.
        ends.sort();
        let mut words = vec!["G32".to_owned()];
        words.append(&mut ends);
        words.push(word('F', geometry.lead_mm, 6));
        words.push(word('Q', pass.start_angle_deg, 3));
        let followed_mm = job.infeed_mm(index) * options.ratio;
        if !plain || !pass.vibrates() || (pass.amplitude_mm - followed_mm).abs() > 1e-6 {
            words.push(word('A', across_scale * pass.amplitude_mm, 4));
        }
        let shift = pass.phase_shift_deg - default_phase_shift_deg(index);
        if pass.vibrates() && (!plain || shift.abs() > 1e-6) {
            words.push(word('R', pass.phase_shift_deg, 3));
        }
        line(&words);
    }
    line(&["G0".to_owned(), clear]);
    text.push_str("G165 P0\nM5\nM30\n");
    text
}
