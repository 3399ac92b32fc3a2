//! What the drives leave of a vibration along the path (docs/functions/path-vibration.md, "Will the machine follow?").

use feedwave_motion::{Curve, Element};
use feedwave_program::{AXIS_COUNT, Axis};

use super::VibrationCondition;
use crate::shared::following::{
    AxisFollowing, DriveModel, FollowingContour, FollowingModel, PathPlace, Response, largest_between,
};

/// Tangents of an axis below this do not move it.
const MOVES: f64 = 1e-9;

/// What arrives at the tool of a vibration that was commanded.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowingReport {
    /// Gain of the filter, |sin(π·f·T_f) / (π·f·T_f)|, on the axis through which least arrives.
    pub filter_gain: f64,
    /// Gain of its position loop.
    pub loop_gain: f64,
    /// Phase lag of its position loop, rad.
    pub phase_lag_rad: f64,
    /// Amplitude along the path at the tool, mm, where it is least.
    pub arriving_amplitude_mm: f64,
    /// Amplitude along the path at the tool, mm, where it is largest.
    pub largest_arriving_amplitude_mm: f64,
    /// Amplitude to command so that the programmed one arrives there, mm; `None` when the drives erase the vibration.
    pub amplitude_to_command_mm: Option<f64>,
    /// By how much what arrives there lags, rad from 0 to 2π: the phase by which the command has to run ahead.
    pub lag_rad: f64,
    /// Each axis that the section moves.
    pub axes: Vec<AxisFollowing>,
    /// How far the drives leave the contour; `None` where nothing is stated of them.
    pub contour: Option<FollowingContour>,
}

impl FollowingReport {
    /// Where nothing is stated, all of it arrives.
    pub(super) const fn of_all(amplitude_mm: f64) -> Self {
        Self {
            filter_gain: 1.0,
            loop_gain: 1.0,
            phase_lag_rad: 0.0,
            arriving_amplitude_mm: amplitude_mm,
            largest_arriving_amplitude_mm: amplitude_mm,
            amplitude_to_command_mm: Some(amplitude_mm),
            lag_rad: 0.0,
            axes: Vec::new(),
            contour: None,
        }
    }
}

/// What share of a vibration arrives at the tool for certain, at most all of it.
#[derive(Clone, Debug)]
pub(super) struct Arriving {
    model: FollowingModel,
    axes: Vec<Axis>,
    frequency_hz: f64,
    /// At that frequency.
    share: f64,
}

impl Arriving {
    /// The path has other directions as well.
    pub(super) fn join(&mut self, other: &Self) {
        self.share = self.share.min(other.share);
        let more: Vec<Axis> = other.axes.iter().copied().filter(|axis| !self.axes.contains(axis)).collect();
        self.axes.extend(more);
    }

    /// The least share at a frequency: that of the section at its own, at another one that of any direction of the path.
    pub(super) fn share(&self, frequency_hz: f64) -> f64 {
        if frequency_hz == self.frequency_hz {
            return self.share;
        }
        let responses: Vec<Response> =
            self.axes.iter().map(|axis| self.model.of(*axis).response(frequency_hz)).collect();
        least_mean(&responses).min(1.0)
    }
}

/// The least magnitude of a mean of responses, whatever their weights: how far 0 is from all that is between them.
fn least_mean(responses: &[Response]) -> f64 {
    let dot = |a: Response, b: Response| a.re * b.re + a.im * b.im;
    let mut nearest = Response { re: 1.0, im: 0.0 };
    let mut least = f64::INFINITY;
    for (index, first) in responses.iter().enumerate() {
        for second in &responses[index..] {
            let across = second.minus(*first);
            let square = dot(across, across);
            let share = if square > 0.0 { (-dot(*first, across) / square).clamp(0.0, 1.0) } else { 0.0 };
            let between = first.plus(across.scaled(share));
            if between.magnitude() < least {
                (nearest, least) = (between, between.magnitude());
            }
        }
    }
    // Where some are on its other side, 0 is among them.
    let is_outside = responses.iter().all(|own| dot(*own, nearest) >= least * least * (1.0 - 1e-9));
    if is_outside { least } else { 0.0 }
}

/// Gathers it over the elements of a section.
#[derive(Clone, Debug)]
pub(super) struct FollowingLoss {
    model: FollowingModel,
    condition: VibrationCondition,
    /// Largest |tangent| of every axis.
    tangents: [f64; AXIS_COUNT],
    /// Responses along the path with the least and the largest gain; where rotary axes move, those of each axis.
    mixed: Option<[Response; 2]>,
    contour: FollowingContour,
}

impl FollowingLoss {
    pub(super) fn new(model: &FollowingModel, condition: VibrationCondition) -> Self {
        Self {
            model: model.clone(),
            condition,
            tangents: [0.0; AXIS_COUNT],
            mixed: None,
            contour: FollowingContour::default(),
        }
    }

    /// Adds an element that is cut at `feed_mm_per_s`.
    pub(super) fn add(&mut self, element: &Element, feed_mm_per_s: f64) {
        let largest = element.largest_tangent();
        for (tangent, largest) in self.tangents.iter_mut().zip(largest) {
            *tangent = tangent.max(largest);
        }
        let moved = |axis: &Axis| largest[axis.index()] > MOVES;
        let (model, frequency_hz) = (&self.model, self.condition.frequency_hz);
        if Axis::ALL.iter().any(|axis| axis.is_rotary() && moved(axis)) || matches!(element.curve, Curve::FiveAxis(_)) {
            // What the lag of a rotary axis does to the tool is not known: it is judged by what each of the axes does.
            for axis in Axis::ALL.into_iter().filter(moved) {
                keep(&mut self.mixed, model.of(axis).response(frequency_hz));
            }
            self.contour.unjudged_mm += element.length;
            return;
        }
        let shared = model.shared_by(Axis::ALL.into_iter().filter(moved));
        let is_straight = matches!(element.curve, Curve::Line);
        if let Some(drive) = shared {
            keep(&mut self.mixed, drive.response(frequency_hz));
        }
        if shared.is_some() && is_straight {
            // The axes lag alike: the tool is late, and on its line.
            return;
        }
        let most = |value: &dyn Fn(&PathPlace) -> f64| {
            if is_straight {
                value(&PathPlace::of(element, 0.0))
            } else {
                largest_between(element.length, |at_mm| value(&PathPlace::of(element, at_mm))).0
            }
        };
        let feed_mm = most(&|place| place.feed_error(model, feed_mm_per_s));
        let mut vibration_mm = 0.0;
        if shared.is_none() {
            vibration_mm = self.condition.amplitude_mm * most(&|place| place.vibration_error(model, frequency_hz));
            let along = |at_mm: f64| PathPlace::of(element, at_mm).arriving(model, frequency_hz);
            let ends = if is_straight { [along(0.0); 2] } else { extremes(element.length, along) };
            for response in ends {
                keep(&mut self.mixed, response);
            }
        }
        let (contour, line) = (&mut self.contour, element.source.line);
        if feed_mm > contour.feed_mm {
            (contour.feed_mm, contour.feed_line) = (feed_mm, line);
        }
        if vibration_mm > contour.vibration_mm {
            (contour.vibration_mm, contour.vibration_line) = (vibration_mm, line);
        }
        contour.together_mm = contour.together_mm.max(feed_mm + vibration_mm);
    }

    /// What arrives, and what would of another vibration.
    pub(super) fn into_parts(self) -> (FollowingReport, Arriving) {
        let (model, VibrationCondition { frequency_hz, amplitude_mm }) = (self.model.clone(), self.condition);
        let report = self.into_report();
        let share = (report.arriving_amplitude_mm / amplitude_mm).min(1.0);
        let axes = report.axes.iter().map(|own| own.axis).collect();
        (report, Arriving { model, axes, frequency_hz, share })
    }

    fn into_report(self) -> FollowingReport {
        let VibrationCondition { frequency_hz, amplitude_mm } = self.condition;
        let moving = || Axis::ALL.into_iter().filter(|axis| self.tangents[axis.index()] > MOVES);
        let axes: Vec<AxisFollowing> = moving().map(|axis| self.model.axis(axis, frequency_hz)).collect();
        let worst = axes.iter().min_by(|a, b| a.gain.total_cmp(&b.gain));
        let drive = worst.map_or(self.model.common, |worst| self.model.of(worst.axis));
        let (least, largest, lag_rad) = match (&self.mixed, self.model.shared_by(moving())) {
            (Some([least, largest]), None) => (least.magnitude(), largest.magnitude(), least.lag_rad()),
            // All axes have one drive.
            _ => {
                let largest = axes.iter().map(|axis| axis.gain).fold(drive.gain(frequency_hz), f64::max);
                (drive.gain(frequency_hz), largest, drive.lag_rad(frequency_hz))
            }
        };
        FollowingReport {
            filter_gain: drive.filter_gain(frequency_hz),
            loop_gain: drive.loop_gain(frequency_hz),
            phase_lag_rad: drive.loop_lag_rad(frequency_hz),
            arriving_amplitude_mm: amplitude_mm * least,
            largest_arriving_amplitude_mm: amplitude_mm * largest,
            amplitude_to_command_mm: DriveModel::command_for(amplitude_mm, least),
            lag_rad,
            axes,
            contour: Some(self.contour),
        }
    }
}

/// The responses with the least and the largest gain on a curve.
fn extremes(length_mm: f64, response: impl Fn(f64) -> Response) -> [Response; 2] {
    [-1.0, 1.0].map(|sign| response(largest_between(length_mm, |at_mm| sign * response(at_mm).magnitude()).1))
}

fn keep(mixed: &mut Option<[Response; 2]>, response: Response) {
    let [least, largest] = mixed.get_or_insert([response; 2]);
    if response.magnitude() < least.magnitude() {
        *least = response;
    }
    if response.magnitude() > largest.magnitude() {
        *largest = response;
    }
}
