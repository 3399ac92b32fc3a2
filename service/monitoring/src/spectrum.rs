//! Dominant spectral line of a window and whether it is chatter (docs/functions/adaptive-feed.md, "Amplitude and
//! frequency of vibration").

mod fft;

use crate::config::SpectrumConfig;
use fft::{Complex, Fft};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Most samples that are transformed.
pub(crate) const MAX_SAMPLES: u32 = 65_536;

/// Where a spectral line comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LineOrigin {
    /// The given harmonic of the edge-passing frequency z·n.
    EdgePassing(u32),
    /// The given harmonic of the spindle frequency n that is not one of z·n.
    Spindle(u32),
    /// No harmonic: chatter at the line's frequency.
    Chatter,
    /// Below the noise floor.
    Noise,
    /// The spindle speed is unknown, or its harmonics are closer together than the tolerance can tell apart.
    Undetermined,
}

/// Dominant line of a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpectralLine {
    /// Frequency in Hz, interpolated between bins.
    pub frequency_hz: f64,
    /// Amplitude (half of peak to peak) √(A_x² + A_y²), interpolated, in the unit of the deviation.
    pub amplitude: f64,
    /// Origin.
    pub origin: LineOrigin,
}

impl SpectralLine {
    /// Amplitude of the displacement in mm behind an amplitude of acceleration in mm/s²: A/(2πf)².
    pub fn displacement_amplitude_mm(&self) -> f64 {
        let omega = TAU * self.frequency_hz;
        self.amplitude / (omega * omega)
    }
}

/// Tells harmonics of the spindle from chatter.
pub(crate) fn origin(
    frequency_hz: f64,
    amplitude: f64,
    spindle_rev_per_min: Option<f64>,
    config: &SpectrumConfig,
) -> LineOrigin {
    if amplitude <= config.noise_floor {
        return LineOrigin::Noise;
    }
    let Some(rotation_hz) = spindle_rev_per_min.map(|rev_per_min| rev_per_min / 60.0).filter(|&hz| hz > 0.0) else {
        return LineOrigin::Undetermined;
    };
    let tolerance_hz = config.harmonic_tolerance_hz;
    if rotation_hz <= 2.0 * tolerance_hz {
        return LineOrigin::Undetermined;
    }
    let order = (frequency_hz / rotation_hz).round();
    if order < 1.0 || (frequency_hz - order * rotation_hz).abs() > tolerance_hz {
        return LineOrigin::Chatter;
    }
    // At most half the sample rate over twice the tolerance: far below 2³² by the configuration's bounds.
    let order = order.min(f64::from(u32::MAX)) as u32;
    if order.is_multiple_of(config.edges) {
        LineOrigin::EdgePassing(order / config.edges)
    } else {
        LineOrigin::Spindle(order)
    }
}

/// The last samples of a window.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(into = "Kept", try_from = "Kept")]
pub(crate) struct Record {
    /// Ring of (x, y), a power of two.
    ring: Vec<[f64; 2]>,
    next: usize,
    filled: usize,
}

/// A record in a snapshot: nothing but its samples, so that after a decision, when there are none, it takes no space.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Samples that fit in.
    length: u32,
    /// Those that are there, oldest first.
    samples: Vec<[f64; 2]>,
}

impl From<Record> for Kept {
    fn from(mut record: Record) -> Self {
        let length = record.ring.len() as u32;
        if record.filled == record.ring.len() {
            record.ring.rotate_left(record.next);
        }
        record.ring.truncate(record.filled);
        Self { length, samples: record.ring }
    }
}

impl TryFrom<Kept> for Record {
    type Error = &'static str;

    fn try_from(Kept { length, samples }: Kept) -> Result<Self, Self::Error> {
        let filled = samples.len();
        if !length.is_power_of_two() || length > MAX_SAMPLES || filled > length as usize {
            return Err("a record of impossible length");
        }
        let mut ring = samples;
        ring.resize(length as usize, [0.0; 2]);
        Ok(Self { next: filled & (ring.len() - 1), ring, filled })
    }
}

impl Record {
    pub fn new(samples: u32) -> Self {
        Self { ring: vec![[0.0; 2]; samples as usize], next: 0, filled: 0 }
    }

    #[inline]
    pub fn push(&mut self, value: [f64; 2]) {
        self.ring[self.next] = value;
        self.next = (self.next + 1) & (self.ring.len() - 1);
        self.filled = (self.filled + 1).min(self.ring.len());
    }

    /// Repeats the last value for samples that were removed or dropped, so that the grid stays even.
    #[inline]
    pub fn repeat(&mut self, times: u64) {
        if self.filled == 0 {
            return;
        }
        let last = self.ring[(self.next + self.ring.len() - 1) & (self.ring.len() - 1)];
        for _ in 0..times.min(self.ring.len() as u64) {
            self.push(last);
        }
    }

    pub fn clear(&mut self) {
        self.next = 0;
        self.filled = 0;
    }

    pub fn fits(&self, config: &SpectrumConfig) -> bool {
        self.ring.len() == config.samples as usize
    }
}

/// Transform and its working memory; holds nothing that a later window depends on.
#[derive(Debug, Clone)]
pub(crate) struct Analyser {
    fft: Fft,
    window: Vec<f64>,
    data: Vec<Complex>,
    power: Vec<f64>,
}

impl Analyser {
    pub fn new(samples: u32) -> Self {
        let length = samples as usize;
        let hann = |index: usize| 0.5 - 0.5 * libm::cos(TAU * index as f64 / length as f64);
        Self {
            fft: Fft::new(length),
            window: (0..length).map(hann).collect(),
            data: vec![[0.0; 2]; length],
            power: vec![0.0; length / 2],
        }
    }

    /// Frequency in Hz and amplitude of the dominant line; `None` while the record is not full or silent.
    ///
    /// X and Y are transformed at once as x + iy. With the Hann window the ratio r of the larger neighbour to the peak
    /// gives the line's distance from the bin δ = (2r − 1)/(r + 1), and the peak is A·N/4·sinc(δ)/(1 − δ²) (Grandke
    /// 1983).
    pub fn line(&mut self, record: &Record, config: &SpectrumConfig, sample_rate_hz: f64) -> Option<(f64, f64)> {
        let length = record.ring.len();
        if record.filled < length {
            return None;
        }
        let samples = || record.ring[record.next..].iter().chain(&record.ring[..record.next]);
        let count = length as f64;
        let mut mean = [0.0; 2];
        for value in samples() {
            mean[0] += value[0];
            mean[1] += value[1];
        }
        let mean = mean.map(|sum| sum / count);
        for ((data, value), weight) in self.data.iter_mut().zip(samples()).zip(&self.window) {
            *data = [(value[0] - mean[0]) * weight, (value[1] - mean[1]) * weight];
        }
        self.fft.transform(&mut self.data);
        for bin in 1..length / 2 {
            // |X|² + |Y|² of the two real signals.
            let [[pr, pi], [nr, ni]] = [self.data[bin], self.data[length - bin]];
            self.power[bin] = 0.5 * (pr * pr + pi * pi + nr * nr + ni * ni);
        }
        let bin_hz = sample_rate_hz / count;
        let peak = self.peak(config.min_frequency_hz / bin_hz)?;
        let offset = self.offset(peak);
        let distance = offset.abs();
        let sinc = if distance == 0.0 { 1.0 } else { libm::sin(PI * distance) / (PI * distance) };
        let amplitude = 4.0 / count * self.power[peak].sqrt() * (1.0 - distance * distance) / sinc;
        Some(((peak as f64 + offset) * bin_hz, amplitude))
    }

    /// Bin of the largest line at or above `least` bins. The flank of a line outside of the range is none, nor is what the window
    /// leaves of such a line further off.
    fn peak(&self, least: f64) -> Option<usize> {
        let power = &self.power;
        // The bin beside 0 holds what is left of the mean and of slow changes; the last one has a line beyond half the sample rate.
        let last = power.len() - 1;
        let larger = |best: usize, bin: usize| if power[bin] > power[best] { bin } else { best };
        let tops = || (2..last).filter(|&bin| power[bin] >= power[bin - 1] && power[bin] >= power[bin + 1]);
        let is_inside = |bin: &usize| *bin as f64 + self.offset(*bin) >= least;
        let below = tops().filter(|bin| !is_inside(bin)).fold(1, larger);
        let leaks = |bin: usize| {
            [below, last].into_iter().any(|outside| {
                let bins = bin.abs_diff(outside) as f64;
                // Side lobes of the Hann window: |W(d)/W(0)| is at most 1/(π·d·(d² − 1)), d within half a bin of this.
                let near = bins - 0.5;
                near > 1.0 && (power[bin] / power[outside]).sqrt() * PI * near * (near * near - 1.0) < 1.0
            })
        };
        tops().filter(|bin| power[*bin] > 0.0 && is_inside(bin) && !leaks(*bin)).reduce(larger)
    }

    /// Distance of a line from the bin of its peak, bins.
    fn offset(&self, peak: usize) -> f64 {
        let (side, sign) =
            if self.power[peak + 1] >= self.power[peak - 1] { (peak + 1, 1.0) } else { (peak - 1, -1.0) };
        let ratio = (self.power[side] / self.power[peak]).sqrt();
        sign * ((2.0 * ratio - 1.0) / (ratio + 1.0)).clamp(0.0, 0.5)
    }
}

#[cfg(test)]
mod tests;
