//! What of a run's configuration every machining function is given.

use super::PipelineConfig;
use crate::functions::five_axis::GuideInputs;
use crate::functions::path_vibration::VibrationInputs;
use crate::functions::thread::ThreadInputs;

impl PipelineConfig {
    pub(crate) fn vibration_inputs(&self) -> VibrationInputs<'_> {
        VibrationInputs {
            settings: self.vibration(),
            machine: &self.profile.machine,
            following: &self.profile.following,
            period_s: self.period_s(),
            max_feed_override: self.profile.max_feed_override,
            has_overrides: !self.overrides.is_empty(),
        }
    }

    pub(crate) fn thread_inputs(&self) -> ThreadInputs<'_> {
        ThreadInputs {
            settings: &self.profile.thread_vibration,
            machine: &self.profile.machine,
            period_s: self.period_s(),
        }
    }

    pub(crate) fn guide_inputs(&self) -> GuideInputs<'_> {
        GuideInputs {
            tools: &self.tools,
            pole_tolerance_deg: self.profile.pole_tolerance_deg,
            corner_direction_tolerance_deg: self.profile.corner_direction_tolerance_deg,
        }
    }
}
