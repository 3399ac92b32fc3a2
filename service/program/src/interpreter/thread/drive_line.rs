//! LinuxCNC's threading cycle: `G76 P Z I J R K Q H E L`.
//!
//! The drive line is the parallel to Z through the X where the cycle starts. The crest of the thread lies I from it,
//! pass n cuts J·n^(1/R) below the crest, the last K, and H more passes after that at K. With Q the whole pass moves
//! along the drive line by depth · tan Q in the direction of the cut, such that the last one ends at Z. Between two passes the
//! tool is the distance I + K from the cut before, so that the last one ends on the drive line. E is the length
//! of the tapers at the ends that L names. The cycle ends on the drive line at Z. With diameters in X, I, J and K are
//! diameters too.

use core::ops::RangeInclusive;

use super::super::execute::Execution;
use super::super::motion::Frame;
use super::Cut;

use super::infeed::{Infeed, Pass};
use super::words::DEPTHS_MM;
use crate::code;
use crate::dialect::letter_bit;
use crate::{Axis, Finding, Plane, PullOut};

/// Degressions: with larger ones the passes hardly get deeper.
const DEGRESSIONS: RangeInclusive<f64> = 1.0..=100.0;

/// Compound slide angles, degrees.
const SLIDE_ANGLES_DEG: RangeInclusive<f64> = -80.0..=80.0;

impl Execution<'_> {
    pub(super) fn drive_line_cycle(&mut self) {
        let z_letters = self.block.letters & (letter_bit(b'Z') | letter_bit(b'W')) & !self.used;
        let end = self.target(z_letters, Frame::Work);
        let pitch = self.needed(b'P', "pitch").and_then(|word| self.checked_lead(&word, self.scaled(&word, true)));
        let crest = self.needed(b'I', "crest_offset").and_then(|word| {
            let offset_mm = self.radius(&word);
            let distance_mm = self.checked(&word, offset_mm.abs(), "crest_offset", DEPTHS_MM)?;
            Some(distance_mm.copysign(offset_mm))
        });
        let first = self.radial_depth(b'J', "first_depth");
        let full = self.full_depth(first);
        let degression = self.cycle_number(b'R', "degression", 1.0, DEGRESSIONS);
        let slide_deg = self.cycle_number(b'Q', "slide_angle", 0.0, SLIDE_ANGLES_DEG);
        let spring_passes = self.cycle_count(b'H', "spring_passes", 0, 0.0..=99.0);
        let ends = self.cycle_count(b'L', "tapered_ends", 0, 0.0..=3.0);
        let taper = self.optional_length(b'E', "taper_length", 0.0..=1_000.0);
        let turns = self.spindle_cuts_threads();
        let [_, z] = self.drive_line();
        let end_z = end[Axis::Z.index()];
        if end_z == z {
            self.thread_travel("the drive line ends where it starts: Z says where it ends");
        } else if let (Some(lead_mm), Some(crest), Some(first_mm), Some(full_mm)) = (pitch, crest, first, full)
            && let (Some(degression), Some(slide_deg), Some(finishing_passes)) = (degression, slide_deg, spring_passes)
            && let (Some(ends), Some(taper)) = (ends, taper)
            && self.is_turning_plane()
            && turns
        {
            let infeed = Infeed { first_mm, degression, least_mm: 0.0, rough_mm: full_mm, full_mm, finishing_passes };
            self.drive_line_passes(lead_mm, crest, &infeed, slide_deg, ends, taper.unwrap_or(0.0), end_z);
        }
        self.state.position = self.moved(self.drive_line()[0], end_z);
    }

    #[allow(clippy::too_many_arguments, reason = "each is one word of the block")]
    fn drive_line_passes(
        &mut self,
        lead_mm: f64,
        crest_mm: f64,
        infeed: &Infeed,
        slide_deg: f64,
        ends: u32,
        taper_mm: f64,
        end_z: f64,
    ) {
        let [x, z] = self.drive_line();
        let forwards = (end_z - z).signum();
        let inwards = crest_mm.signum();
        let full_mm = infeed.full_mm;
        let slope = libm::tan(slide_deg.to_radians());
        let (entry, exit) = (taper_mm > 0.0 && ends & 1 != 0, taper_mm > 0.0 && ends & 2 != 0);
        let drive_line_mm = (end_z - z).abs();
        // Every pass is as long as the last, which has moved furthest.
        let length_mm = drive_line_mm - full_mm * slope;
        let tapered_mm = taper_mm * f64::from(u32::from(entry) + u32::from(exit));
        if taper_mm > drive_line_mm * 0.5 || length_mm <= tapered_mm {
            let span = self.block.span();
            return self.findings.push_with(code::THREAD_CYCLE_VALUE, |code| {
                let message = format!(
                    "tapers of {taper_mm} mm do not fit the drive line of {drive_line_mm} mm, of which passes take {length_mm:.4} mm"
                );
                Finding::new(code, span, message)
                    .with_value("taper_length", taper_mm, "mm")
                    .with_value("drive_line", drive_line_mm, "mm")
                    .with_value("pass_length", length_mm, "mm")
                    .suggest("use a shorter taper, at most half of the drive line, or a smaller slide angle")
            });
        }
        let Some(passes) = self.cycle_passes(infeed) else {
            return;
        };
        for Pass { depth_mm, finishing } in passes {
            let cut_x = x + crest_mm + inwards * depth_mm;
            let start_z = z + forwards * slope * depth_mm;
            // Every pass leaves the work by the same distance: the last one to the drive line, those before it beyond.
            let clear_x = x - inwards * (full_mm - depth_mm);
            self.rapid_to(clear_x, start_z);
            let cut = Cut { lead_mm, amplitude_mm: finishing.then_some(0.0), ..Cut::default() };
            if entry {
                self.rapid_to(cut_x - inwards * full_mm, start_z);
                // The pitch is along Z on the taper too; the lead is along the axis that travels further.
                let lead_mm = lead_mm * (full_mm / taper_mm).max(1.0);
                self.cut_thread(self.moved(cut_x, start_z + forwards * taper_mm), Cut { lead_mm, ..cut });
            } else {
                self.rapid_to(cut_x, start_z);
            }
            let pull_out = exit.then_some(PullOut { travel_mm: taper_mm, retreat_mm: -inwards * full_mm });
            // Exactly Z for the last pass.
            let pass_end_z = end_z - forwards * slope * (full_mm - depth_mm);
            self.cut_thread(self.moved(cut_x, pass_end_z), Cut { pull_out, ..cut });
            self.rapid_to(clear_x, pass_end_z);
        }
        self.rapid_to(x, end_z);
    }

    /// X and Z of the tool.
    const fn drive_line(&self) -> [f64; 2] {
        [self.state.position[Axis::X.index()], self.state.position[Axis::Z.index()]]
    }

    fn is_turning_plane(&mut self) -> bool {
        let valid = self.state.plane == Plane::Zx;
        if !valid {
            let span = self.block.span();
            self.findings.push_with(code::THREAD_CYCLE_FORM, |code| {
                Finding::new(code, span, "this threading cycle needs the plane of Z and X")
                    .suggest("select it before, G18")
            });
        }
        valid
    }

    fn radial_depth(&mut self, letter: u8, name: &'static str) -> Option<f64> {
        let word = self.needed(letter, name)?;
        self.checked(&word, self.radius(&word), name, DEPTHS_MM)
    }

    /// The depth of the thread, which is more than that of the first pass; `None` after a finding.
    fn full_depth(&mut self, first_mm: Option<f64>) -> Option<f64> {
        let word = self.needed(b'K', "thread_height")?;
        let full_mm = self.checked(&word, self.radius(&word), "thread_height", DEPTHS_MM)?;
        let Some(first_mm) = first_mm.filter(|&first_mm| full_mm <= first_mm) else { return Some(full_mm) };
        self.cycle_value(&word, |mut finding| {
            finding.message =
                format!("the thread height K is {full_mm} mm, not more than the first depth J, {first_mm} mm");
            finding
                .with_value("thread_height", full_mm, "mm")
                .with_value("first_depth", first_mm, "mm")
                .suggest("write a K that is larger than J")
        });
        None
    }

    /// A pure number or an angle; `None` after a finding.
    fn cycle_number(
        &mut self,
        letter: u8,
        name: &'static str,
        default: f64,
        range: RangeInclusive<f64>,
    ) -> Option<f64> {
        match self.take(letter) {
            Some(word) => self.checked(&word, word.number.value(), name, range),
            None => Some(default),
        }
    }
}
