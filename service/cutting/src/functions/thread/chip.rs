//! What a pass finds of the groove that earlier passes left (docs/functions/thread-vibration.md, "Chip report per
//! pass").
//!
//! A pass k lies in the air over pass j where r_k − r_j ≥ t_kj, r the retreats and t the step between the grooves:
//! Δd at the level of depth only, Δd + |Δz|/tan β at the level of the full section; and in the air over the uncut
//! work where r_k ≥ d_k. All retreats have the same period at the same place on the work, so every difference is one
//! sinusoid of the phase ψ = D·ϑ, and air, breaks, longest chip and largest thickness follow in closed form from
//! arcs of a circle.
//!
//! For a pointed tool the condition over single passes is exact: a wedge whose tip is inside another wedge of the
//! same angle is inside it entirely. A flat tip may also be covered by two passes together, which is not counted:
//! there the report is on the safe side.

use core::f64::consts::TAU;

use feedwave_motion::sin_turns;

use super::ThreadJob;

/// How much of the groove a model of the chip looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipLevel {
    /// The depth of the tip only.
    Depth,
    /// The full section with both flanks.
    Section,
}

/// What becomes of the chip of one pass at one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadChip {
    /// Whether the chip is cut through at all.
    pub broken: bool,
    /// Share of a revolution in which the tool cuts air.
    pub air_share: f64,
    /// Breaks per revolution; 0 when unbroken.
    pub breaks_per_rev: f64,
    /// Longest chip, mm along the helix at the work diameter; the whole pass when unbroken.
    pub longest_chip_mm: f64,
    /// Largest thickness, mm on the radius; 0 where the pass cuts nothing.
    pub largest_thickness_mm: f64,
    /// Smallest amplitude of this pass that cuts its chip through, mm on the radius, the others being as they are.
    pub least_amplitude_mm: f64,
}

/// Relative to the depths compared: limits that were computed to be met exactly count as met.
const ALLOWANCE_MM: f64 = 1e-9;

/// constant + cosine·cos ψ + sine·sin ψ, mm: by how much a pass is above what an earlier one left.
#[derive(Clone, Copy, Debug)]
struct Margin {
    constant: f64,
    cosine: f64,
    sine: f64,
}

impl Margin {
    /// Retreat of a pass at the same place on the work.
    fn retreat(amplitude_mm: f64, phase_shift_deg: f64) -> Self {
        let half = 0.5 * amplitude_mm;
        let shift = phase_shift_deg.to_radians();
        Self { constant: half, cosine: -half * libm::cos(shift), sine: -half * libm::sin(shift) }
    }

    fn minus(self, other: Self, step_mm: f64) -> Self {
        Self {
            constant: self.constant - other.constant - step_mm,
            cosine: self.cosine - other.cosine,
            sine: self.sine - other.sine,
        }
    }

    fn swing(self) -> f64 {
        libm::hypot(self.cosine, self.sine)
    }

    /// Value at the phase with this cosine and sine.
    fn at(self, cosine: f64, sine: f64) -> f64 {
        self.constant + self.cosine * cosine + self.sine * sine
    }

    fn peak(self) -> f64 {
        self.constant + self.swing()
    }

    /// Phase of the peak.
    fn middle(self) -> f64 {
        libm::atan2(self.sine, self.cosine)
    }

    /// Whether this is at least `other` at every phase.
    fn covers(self, other: Self) -> bool {
        let difference = self.minus(other, 0.0);
        difference.constant - difference.swing() >= 0.0
    }

    /// Phases where it is zero: middle ± the result.
    fn half_arc(self) -> Option<f64> {
        let (swing, constant) = (self.swing(), self.constant);
        if constant + swing < -ALLOWANCE_MM {
            None
        } else if constant >= swing {
            Some(0.5 * TAU)
        } else {
            Some(libm::acos((-constant / swing).clamp(-1.0, 1.0)))
        }
    }
}

/// How far the tool of one pass is out of the uncut work and of all that earlier passes left, over the phase.
///
/// The largest of several sinusoids of the phase ψ = D·ϑ, ϑ the spindle angle of the groove's first pass.
#[derive(Clone, Debug, Default)]
pub struct Clearance {
    margins: Vec<Margin>,
}

impl Clearance {
    /// Of pass `index` over the uncut work and all earlier passes of its groove.
    ///
    /// # Panics
    /// Where the thread has no such pass.
    #[must_use]
    pub fn of(job: &ThreadJob, index: usize, level: ChipLevel) -> Self {
        let (pass, place) = (&job.passes[index], job.place(index));
        let own = Margin::retreat(pass.amplitude_mm, place.phase_shift_deg);
        let still = Margin::retreat(0.0, 0.0);
        let mut clearance = Self { margins: vec![own.minus(still, pass.depth_mm)] };
        for (earlier, other) in job.passes[..index].iter().enumerate() {
            if other.start == pass.start {
                let left = Margin::retreat(other.amplitude_mm, job.place(earlier).phase_shift_deg);
                clearance.add(own.minus(left, step_mm(job, earlier, index, level)));
            }
        }
        clearance
    }

    /// Adds what one more pass left, unless it changes nothing: few passes are ever seen by a later one.
    fn add(&mut self, margin: Margin) {
        if self.margins.iter().all(|known| !known.covers(margin)) {
            self.margins.retain(|known| !margin.covers(*known));
            self.margins.push(margin);
        }
    }

    /// Clearance at a phase ψ, degrees, mm on the radius: 0 and above in the air, below it the thickness is what is
    /// missing.
    #[must_use]
    pub fn at_mm(&self, phase_deg: f64) -> f64 {
        let (cosine, sine) = (cos_deg(phase_deg), cos_deg(phase_deg - 90.0));
        self.margins.iter().map(|margin| margin.at(cosine, sine)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Arcs of air as start and end phase, apart and in order; one of a full turn where everything is air.
    fn arcs(&self) -> Vec<(f64, f64)> {
        let mut arcs: Vec<(f64, f64)> = Vec::new();
        for margin in &self.margins {
            let Some(half) = margin.half_arc() else { continue };
            if half >= 0.5 * TAU {
                return vec![(0.0, TAU)];
            }
            let mut start = margin.middle() - half;
            if start < 0.0 {
                start += TAU;
            }
            arcs.push((start, start + 2.0 * half));
        }
        arcs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut apart: Vec<(f64, f64)> = Vec::new();
        for arc in arcs {
            match apart.last_mut() {
                Some(last) if arc.0 <= last.1 => last.1 = last.1.max(arc.1),
                _ => apart.push(arc),
            }
        }
        // The last ones may reach around into the first.
        while apart.len() > 1 && apart[apart.len() - 1].1 >= apart[0].0 + TAU {
            let first = apart.remove(0);
            let last = apart.len() - 1;
            apart[last].1 = apart[last].1.max(first.1 + TAU);
        }
        if let [(start, end)] = apart[..]
            && end - start >= TAU
        {
            return vec![(0.0, TAU)];
        }
        apart
    }

    /// The deepest that the tool is in the work at any phase, mm on the radius.
    ///
    /// The largest of sinusoids is smallest at the trough of one of them or where two of them are equal.
    #[must_use]
    pub fn largest_thickness_mm(&self) -> f64 {
        let mut thickness_mm = 0.0_f64;
        let mut look = |phase: f64| {
            let (cosine, sine) = (libm::cos(phase), libm::sin(phase));
            let highest = self.margins.iter().map(|margin| margin.at(cosine, sine)).fold(f64::NEG_INFINITY, f64::max);
            thickness_mm = thickness_mm.max(-highest);
        };
        for (index, margin) in self.margins.iter().enumerate() {
            look(margin.middle() + 0.5 * TAU);
            for other in &self.margins[..index] {
                let difference = margin.minus(*other, 0.0);
                if difference.swing() > 0.0 && difference.constant.abs() <= difference.swing() {
                    let half = libm::acos(-difference.constant / difference.swing());
                    look(difference.middle() - half);
                    look(difference.middle() + half);
                }
            }
        }
        thickness_mm
    }
}

/// Step t between the grooves of an earlier and a later pass, mm on the radius: what the retreat must reach
/// (docs/functions/thread-vibration.md, "Chip report per pass").
fn step_mm(job: &ThreadJob, earlier: usize, later: usize, level: ChipLevel) -> f64 {
    let (before, after) = (job.place(earlier), job.place(later));
    match level {
        ChipLevel::Depth => job.passes[later].depth_mm - job.passes[earlier].depth_mm,
        ChipLevel::Section => {
            let across_mm = (after.axial_offset_mm - before.axial_offset_mm).abs();
            after.tip_depth_mm - before.tip_depth_mm + across_mm / job.profile.tan_half_angle()
        }
    }
}

/// What becomes of the chip of a pass.
pub(super) fn chip(job: &ThreadJob, index: usize, level: ChipLevel) -> ThreadChip {
    let clearance = Clearance::of(job, index, level);
    let arcs = clearance.arcs();
    let broken = clearance.margins.iter().any(|margin| margin.peak() >= -ALLOWANCE_MM);
    let everything = arcs.first().is_some_and(|(start, end)| end - start >= TAU);
    let air: f64 = arcs.iter().map(|(start, end)| end - start).sum();
    let longest_gap = arcs.iter().enumerate().map(|(arc, (_, end))| {
        let next = arcs.get(arc + 1).map_or(arcs[0].0 + TAU, |next| next.0);
        (next - end).max(0.0)
    });
    let revolutions = match arcs.len() {
        0 => (job.end_angle_deg(&job.passes[index]) - job.passes[index].start_angle_deg) / 360.0,
        _ => longest_gap.fold(0.0, f64::max) / TAU / job.vibrations_per_rev,
    };
    ThreadChip {
        broken,
        air_share: (air / TAU).min(1.0),
        breaks_per_rev: if everything { 0.0 } else { arcs.len() as f64 * job.vibrations_per_rev },
        longest_chip_mm: revolutions * helix_mm(job),
        largest_thickness_mm: clearance.largest_thickness_mm(),
        least_amplitude_mm: least_amplitude_mm(job, index, level),
    }
}

/// One revolution along the helix on the surface of the work, on a face where it is longest, mm.
fn helix_mm(job: &ThreadJob) -> f64 {
    libm::hypot(TAU * job.geometry.winding_radius_mm(), job.geometry.lead_mm)
}

/// Smallest amplitude with which a pass is cut through, mm.
///
/// Over an earlier pass with amplitude a and phase difference s, the largest r_k − r_j is
/// (A − a)/2 + |A − a·e^{is}|/2; it reaches t from A = 2t(t + a)/(2t + a(1 − cos s)) on. With s = 180° that is t, with
/// s = 0 it is t + a.
pub(super) fn least_amplitude_mm(job: &ThreadJob, index: usize, level: ChipLevel) -> f64 {
    let (pass, place) = (&job.passes[index], job.place(index));
    let mut least_mm = pass.depth_mm.max(0.0);
    for (earlier, other) in job.passes[..index].iter().enumerate() {
        if other.start == pass.start {
            let apart = 1.0 - cos_deg(place.phase_shift_deg - job.place(earlier).phase_shift_deg);
            let (t, a) = (step_mm(job, earlier, index, level), other.amplitude_mm);
            let needed_mm = if t <= 0.0 { 0.0 } else { 2.0 * t * (t + a) / (2.0 * t + a * apart) };
            least_mm = least_mm.min(needed_mm);
        }
    }
    least_mm
}

/// Smallest common ratio of amplitude to infeed with which every pass is cut through where all amplitudes follow the
/// ratio; `None` where none does. Pass `index` only.
///
/// With A = q·i and a = q·i' the condition of the smallest amplitude becomes
/// i·i'(1 − cos s)·q² + 2t(i − i')·q − 2t² ≥ 0, whose left side is negative at q = 0: one positive root at most.
pub(super) fn least_ratio(job: &ThreadJob, index: usize, level: ChipLevel) -> Option<f64> {
    let (pass, place) = (&job.passes[index], job.place(index));
    let infeed_mm = job.infeed_mm(index);
    if infeed_mm <= 0.0 {
        return None;
    }
    let mut least = pass.depth_mm / infeed_mm;
    for (earlier, other) in job.passes[..index].iter().enumerate() {
        if other.start != pass.start {
            continue;
        }
        let t = step_mm(job, earlier, index, level);
        if t <= 0.0 {
            return Some(0.0);
        }
        let before_mm = if other.vibrates() { job.infeed_mm(earlier) } else { 0.0 };
        let apart = 1.0 - cos_deg(place.phase_shift_deg - job.place(earlier).phase_shift_deg);
        let (square, linear) = (infeed_mm * before_mm * apart, t * (infeed_mm - before_mm));
        // 2t²/(linear + √(linear² + 2·square·t²)): the positive root without cancellation.
        let denominator = linear + libm::sqrt(linear * linear + 2.0 * square * t * t);
        if denominator > 1e-12 * t {
            least = least.min(2.0 * t * t / denominator);
        }
    }
    Some(least)
}

fn cos_deg(angle_deg: f64) -> f64 {
    sin_turns(angle_deg / 360.0 + 0.25)
}
