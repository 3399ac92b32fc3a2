//! Refuses descriptions that cannot be simulated.

use super::{Description, Process, SensorPair, Where};
use feedwave_monitoring::{MAX_BATCH_SAMPLES, Mode, Quantity, Violation};

/// Most stretches of one kind: each is examined for every sample.
const MAX_STRETCHES: usize = 256;
/// Largest value of anything that is not bounded more closely.
const LARGE: f64 = 1e9;

struct Check(Vec<Violation>);

impl Check {
    fn require(&mut self, holds: bool, field: impl Into<String>, problem: impl FnOnce() -> String) {
        if !holds {
            self.0.push(Violation { field: field.into(), problem: problem() });
        }
    }

    fn within(&mut self, field: impl Into<String>, value: f64, least: f64, most: f64) {
        self.require(value >= least && value <= most, field, || format!("{value} is not between {least} and {most}"));
    }

    fn mode(&mut self, field: &str, mode: &Mode) {
        self.within(format!("{field}.frequency_hz"), mode.frequency_hz, 1.0, 1e5);
        self.within(format!("{field}.damping_ratio"), mode.damping_ratio, 1e-5, 0.7);
        self.within(format!("{field}.stiffness_n_per_mm"), mode.stiffness_n_per_mm, 1e-3, 1e12);
    }

    fn count(&mut self, field: &str, count: usize) {
        self.require(count <= MAX_STRETCHES, field, || {
            format!("{count} stretches, at most {MAX_STRETCHES} are possible")
        });
    }

    fn stretch(&mut self, field: String, at: &Where) {
        let (from, to) = match *at {
            Where::Time { from_s, to_s } => (from_s, to_s),
            Where::Path { from_mm, to_mm } => (from_mm, to_mm),
            Where::Lines { first, last } => (f64::from(first), f64::from(last) + 1.0),
        };
        self.require(from < to, field, || format!("the stretch from {from} to {to} is empty"));
    }

    fn stretches(&mut self, description: &Description) {
        let rate_hz = f64::from(description.sample_rate_hz);
        self.count("contacts", description.contacts.len());
        self.count("chatter", description.chatter.len());
        self.count("faults", description.faults.len());
        for (index, contact) in description.contacts.iter().take(MAX_STRETCHES).enumerate() {
            self.stretch(format!("contacts[{index}].at"), &contact.at);
            self.within(format!("contacts[{index}].depth_mm"), contact.depth_mm, 0.0, 1e3);
        }
        for (index, chatter) in description.chatter.iter().take(MAX_STRETCHES).enumerate() {
            self.stretch(format!("chatter[{index}].at"), &chatter.at);
            self.within(format!("chatter[{index}].frequency_hz"), chatter.frequency_hz, 0.0, rate_hz / 2.0);
            self.within(format!("chatter[{index}].amplitude_mm"), chatter.amplitude_mm, 0.0, 10.0);
            self.within(format!("chatter[{index}].direction_deg"), chatter.direction_deg, -360.0, 360.0);
        }
        for (index, fault) in description.faults.iter().take(MAX_STRETCHES).enumerate() {
            self.stretch(format!("faults[{index}].at"), &fault.at);
        }
    }

    fn sensors(&mut self, name: &str, pair: &SensorPair) {
        self.within(format!("{name}.stand_off"), pair.stand_off, -LARGE, LARGE);
        self.within(format!("{name}.noise"), pair.noise, 0.0, LARGE);
        self.within(format!("{name}.outlier_rate"), pair.outlier_rate, 0.0, 1.0);
        self.within(format!("{name}.outlier_size"), pair.outlier_size, 0.0, LARGE);
        self.within(format!("{name}.drift_per_s"), pair.drift_per_s, -LARGE, LARGE);
        if let Quantity::Strain { mm_per_strain } = pair.quantity {
            let possible = mm_per_strain.abs() >= 1e-9 && mm_per_strain.abs() <= LARGE;
            self.require(possible, format!("{name}.mm_per_strain"), || {
                format!("{mm_per_strain} mm per unit of strain does not turn displacement into strain")
            });
        }
    }
}

// As long as the list of quantities: every condition is one line.
pub(super) fn violations(description: &Description) -> Vec<Violation> {
    let mut check = Check(Vec::new());
    let rate_hz = f64::from(description.sample_rate_hz);
    check.within("interpolation_period_us", f64::from(description.interpolation_period_us), 50.0, 20_000.0);
    check.within("sample_rate_hz", rate_hz, 1.0, 100_000.0);
    check.within("batch_samples", f64::from(description.batch_samples), 1.0, MAX_BATCH_SAMPLES as f64);
    check.within("drop_rate", description.drop_rate, 0.0, 1.0);
    let tool = &description.tool;
    check.within("tool.edge_count", f64::from(tool.edge_count), 1.0, 64.0);
    check.within("tool.radius_mm", tool.radius_mm, 1e-3, 1e4);
    check.mode("tool.mode_x", &tool.mode_x);
    check.mode("tool.mode_y", &tool.mode_y);
    check.within("tool.run_out_mm", tool.run_out_mm, 0.0, 10.0);
    check.within("tool.edge_run_out_mm", tool.edge_run_out_mm, 0.0, 10.0);
    let material = &description.material;
    check.within("material.tangential_n_per_mm2", material.tangential_n_per_mm2, 0.0, 1e6);
    check.within("material.radial_ratio", material.radial_ratio, 0.0, 10.0);
    check.within("material.edge_tangential_n_per_mm", material.edge_tangential_n_per_mm, 0.0, 1e6);
    check.within("material.edge_radial_n_per_mm", material.edge_radial_n_per_mm, 0.0, 1e6);
    check.within("material.radial_speed_exponent", material.radial_speed_exponent, -2.0, 2.0);
    check.within("material.reference_speed_m_per_min", material.reference_speed_m_per_min, 1e-3, 1e5);
    if let Process::Milling { entry_deg, exit_deg } = description.process {
        check.within("process.entry_deg", entry_deg, 0.0, 180.0);
        check.within("process.exit_deg", exit_deg, 0.0, 180.0);
        check.require(entry_deg < exit_deg, "process.exit_deg", || {
            format!("{exit_deg}° is not after the entry at {entry_deg}°")
        });
    }
    check.within("ripple.fraction", description.ripple.fraction, 0.0, 0.5);
    check.within("ripple.frequency_hz", description.ripple.frequency_hz, 0.0, rate_hz / 2.0);
    let still = description.ripple.fraction > 0.0 && description.ripple.frequency_hz == 0.0;
    check.require(!still, "ripple.frequency_hz", || "a fluctuation needs a frequency above 0".to_owned());
    if let Some(sway) = &description.sway {
        check.within("sway.amplitude_mm", sway.amplitude_mm, 0.0, 10.0);
        check.within("sway.frequency_hz", sway.frequency_hz, 0.0, rate_hz / 2.0);
    }
    let sensors = [("tool_sensors", &description.tool_sensors), ("work_sensors", &description.work_sensors)];
    check.require(sensors.iter().any(|(_, pair)| pair.is_some()), "tool_sensors", || {
        "neither the tool nor the work has sensors; give at least one pair".to_owned()
    });
    for (name, pair) in sensors {
        if let Some(pair) = pair {
            check.sensors(name, pair);
        }
    }
    check.stretches(description);
    check.0
}
