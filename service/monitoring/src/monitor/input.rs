//! Reads one sample out of a batch's columns: conversion, removal of wrong values, relative vector.

use crate::batch::{Batch, Pair};
use crate::channel::{Channel, Worth};
use crate::config::{ContactSource, Grouping, MonitoringConfig, Quality, Quantity, Sensors};
use serde::{Deserialize, Serialize};

/// Largest believable commanded acceleration, mm/s²; beyond it values count as not finite.
const MAX_COMMANDED: f64 = 1e9;

/// One sample, ready for the state machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub time_ns: u64,
    /// Vector in mm or mm/s²; meaningful when `worth` is good.
    pub value: [f64; 2],
    /// Spindle angle, 0 when points are in time.
    pub angle_deg: f64,
    pub worth: Worth,
    /// A needed column is missing.
    pub missing: bool,
    /// Measured spindle speed, where it is a number.
    pub rev_per_min: Option<f64>,
    pub contact: Option<bool>,
}

/// History of all channels: X and Y of tool and work.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Channels {
    tool: [Channel; 2],
    work: [Channel; 2],
}

impl Channels {
    pub fn interrupt(&mut self) {
        self.tool.iter_mut().chain(&mut self.work).for_each(Channel::interrupt);
    }
}

/// Whether the batch lacks a column that the configuration needs.
pub(crate) fn lacks_column(batch: &Batch<'_>, config: &MonitoringConfig) -> bool {
    let sensors = [(config.tool, batch.tool), (config.work, batch.work)];
    let acceleration = sensors.iter().any(|(sensors, _)| sensors.is_some_and(|s| s.quantity == Quantity::Acceleration));
    sensors.iter().any(|(sensors, pair)| sensors.is_some() && pair.is_none())
        || (acceleration && batch.commanded.is_none())
        || (matches!(config.grouping, Grouping::Angle { .. }) && batch.spindle_angle_deg.is_none())
        || (config.contact == ContactSource::Flag && batch.contact.is_none())
}

/// Reads sample `index`.
#[inline]
pub(crate) fn read(
    batch: &Batch<'_>,
    index: usize,
    missing: bool,
    config: &MonitoringConfig,
    channels: &mut Channels,
) -> Sample {
    let mut sample = Sample {
        time_ns: batch.time_ns[index],
        value: [0.0; 2],
        angle_deg: 0.0,
        worth: Worth::Good,
        missing,
        rev_per_min: batch
            .spindle_rev_per_min
            .map(|column| column[index])
            .filter(|rev_per_min| (0.0..=1e6).contains(rev_per_min)),
        contact: batch.contact.map(|column| column[index]),
    };
    if missing {
        return sample;
    }
    let quality = &config.quality;
    let commanded = batch.commanded.map_or([0.0; 2], |pair| [pair.x[index], pair.y[index]]);
    let tool = read_pair(config.tool, batch.tool, index, commanded, &mut channels.tool, quality, &mut sample.worth);
    let work = read_pair(config.work, batch.work, index, commanded, &mut channels.work, quality, &mut sample.worth);
    sample.value = match (config.tool, config.work) {
        (Some(_), Some(_)) => [tool[0] - work[0], tool[1] - work[1]],
        (Some(_), None) => tool,
        (None, _) => work,
    };
    if let (Grouping::Angle { .. }, Some(column)) = (config.grouping, batch.spindle_angle_deg) {
        sample.angle_deg = column[index];
        if !sample.angle_deg.is_finite() {
            sample.worth = Worth::NonFinite;
        }
    }
    sample
}

/// Value of a pair in mm or mm/s²; the first fault of a channel becomes the worth of the sample.
#[inline]
fn read_pair(
    sensors: Option<Sensors>,
    pair: Option<Pair<'_>>,
    index: usize,
    commanded: [f64; 2],
    channels: &mut [Channel; 2],
    quality: &Quality,
    worth: &mut Worth,
) -> [f64; 2] {
    let (Some(sensors), Some(pair)) = (sensors, pair) else { return [0.0; 2] };
    let raw = [pair.x[index], pair.y[index]];
    for (channel, value) in channels.iter_mut().zip(raw) {
        let judged = channel.judge(value, &sensors, quality);
        if *worth == Worth::Good {
            *worth = judged;
        }
    }
    match sensors.quantity {
        Quantity::Displacement => raw,
        Quantity::Strain { mm_per_strain } => raw.map(|strain| strain * mm_per_strain),
        Quantity::Acceleration => {
            if *worth == Worth::Good && !commanded.iter().all(|value| value.abs() <= MAX_COMMANDED) {
                *worth = Worth::NonFinite;
            }
            [raw[0] - commanded[0], raw[1] - commanded[1]]
        }
    }
}
