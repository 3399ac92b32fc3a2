//! The columns of setpoints: one table for the stream, for files and for whoever decodes a stream.
//!
//! Invariants: a column's name ends with its unit, and holds the name of an axis as the machine has it (`X_mm`,
//! `A_deg`, `X_vibration_amplitude_mm`); a stream and a file of the same setpoints have the same columns in the same order.

use feedwave_cutting::SetpointBlock;
use feedwave_motion::Machine;

use crate::proto::{ColumnInfo, ColumnKind as Kind, Encoding};

/// How often a kind of column comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Each {
    Stream,
    /// Once per machine axis.
    Axis,
    /// Once per component of a vector in work coordinates.
    Component,
}

/// When a kind of column is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    Always,
    /// Where the drives generate the vibration from conditions.
    Conditions,
    /// In work coordinates of a machine with kinematics.
    Directions,
}

/// One row of the table.
struct Row {
    kind: Kind,
    /// `{axis}` stands for the axis or component, `{unit}` for the unit of the axis.
    name: &'static str,
    /// `None`: that of the axis.
    unit: Option<&'static str>,
    each: Each,
    when: When,
    /// In fixed-point encoding.
    steps_per_unit: f64,
}

const fn row(
    kind: Kind,
    name: &'static str,
    unit: Option<&'static str>,
    each: Each,
    when: When,
    steps_per_unit: f64,
) -> Row {
    Row { kind, name, unit, each, when, steps_per_unit }
}

/// In the order of a stream. Steps: a nanometre, a microdegree, a microhertz, a billionth of a turn or of a unit vector.
const TABLE: [Row; 11] = [
    row(Kind::AxisPosition, "{axis}_{unit}", None, Each::Axis, When::Always, 1e6),
    row(Kind::PathPosition, "path_position_mm", Some("mm"), Each::Stream, When::Always, 1e6),
    row(Kind::Feed, "feed_mm_per_min", Some("mm/min"), Each::Stream, When::Always, 1e6),
    row(Kind::VibrationOffset, "vibration_offset_mm", Some("mm"), Each::Stream, When::Always, 1e6),
    row(Kind::SpindleAngle, "spindle_angle_deg", Some("deg"), Each::Stream, When::Always, 1e6),
    row(Kind::ServoAmplitude, "{axis}_vibration_amplitude_{unit}", None, Each::Axis, When::Conditions, 1e6),
    row(Kind::ServoFrequency, "vibration_frequency_hz", Some("Hz"), Each::Stream, When::Conditions, 1e6),
    row(Kind::ServoPhase, "vibration_phase_turns", Some("turns"), Each::Stream, When::Conditions, 1e9),
    row(Kind::ServoClampLow, "{axis}_clamp_low_{unit}", None, Each::Axis, When::Conditions, 1e6),
    row(Kind::ServoClampHigh, "{axis}_clamp_high_{unit}", None, Each::Axis, When::Conditions, 1e6),
    row(Kind::ToolDirection, "tool_direction_{axis}", Some(""), Each::Component, When::Directions, 1e9),
];

/// Components of a vector in work coordinates.
const COMPONENTS: [&str; 3] = ["X", "Y", "Z"];

/// Which columns setpoints have beside those that all have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extras {
    /// Conditions for drives that generate the vibration.
    pub conditions: bool,
    /// The tool direction in work coordinates.
    pub directions: bool,
}

impl Extras {
    const fn include(self, when: When) -> bool {
        match when {
            When::Always => true,
            When::Conditions => self.conditions,
            When::Directions => self.directions,
        }
    }
}

/// One column of doubles.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What it means.
    pub kind: Kind,
    /// Which axis of the machine, or component of a vector; 0 for kinds that come once.
    pub index: usize,
    /// Name with the unit at its end.
    pub name: String,
    /// Name of the machine axis; empty for kinds that do not come per axis.
    pub axis: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// Steps per unit in fixed-point encoding.
    pub steps_per_unit: f64,
}

/// Whether setpoints can have columns of this kind at all, and need what for it; `None` for a kind that is not in the
/// table.
#[must_use]
pub fn needs(kind: Kind) -> Option<Extras> {
    let row = TABLE.iter().find(|row| row.kind == kind)?;
    Some(Extras { conditions: row.when == When::Conditions, directions: row.when == When::Directions })
}

/// The columns of a machine's setpoints, in their order.
#[must_use]
pub fn of_machine(machine: &Machine, extras: Extras) -> Vec<Column> {
    let rows = TABLE.iter().filter(|row| extras.include(row.when));
    rows.flat_map(|row| {
        let count = match row.each {
            Each::Stream => 1,
            Each::Axis => machine.axes.len(),
            Each::Component => COMPONENTS.len(),
        };
        (0..count).map(move |index| {
            let axis = if row.each == Each::Axis { machine.axes[index].name.as_str() } else { "" };
            let axis_unit = || if machine.axes[index].axis.is_rotary() { "deg" } else { "mm" };
            let unit = row.unit.unwrap_or_else(axis_unit);
            let place = if row.each == Each::Component { COMPONENTS[index] } else { axis };
            Column {
                kind: row.kind,
                index,
                name: row.name.replace("{axis}", place).replace("{unit}", unit),
                axis: axis.to_owned(),
                unit: unit.to_owned(),
                steps_per_unit: row.steps_per_unit,
            }
        })
    })
    .collect()
}

/// The columns that a stream's header announces, with the names and units that it gives them. A kind that this version
/// does not know has no values that it could read.
#[must_use]
pub fn of_header(infos: &[ColumnInfo]) -> Vec<Column> {
    let column = |(position, info): (usize, &ColumnInfo)| Column {
        kind: info.kind(),
        index: infos[..position].iter().filter(|before| before.kind == info.kind).count(),
        name: info.name.clone(),
        axis: info.axis.clone(),
        unit: info.unit.clone(),
        steps_per_unit: if info.resolution > 0.0 { (1.0 / info.resolution).round() } else { 1.0 },
    };
    infos.iter().enumerate().map(column).collect()
}

impl Column {
    /// What a stream's header says about it.
    #[must_use]
    pub fn info(&self, encoding: Encoding) -> ColumnInfo {
        ColumnInfo {
            kind: self.kind.into(),
            name: self.name.clone(),
            axis: self.axis.clone(),
            unit: self.unit.clone(),
            resolution: if encoding == Encoding::FixedPointDelta { 1.0 / self.steps_per_unit } else { 0.0 },
        }
    }

    /// Its values in a block; `None` where the block does not have it.
    #[must_use]
    pub fn values<'a>(&self, block: &'a SetpointBlock) -> Option<&'a [f64]> {
        let servo = block.servo.as_ref();
        let values = match self.kind {
            Kind::AxisPosition => block.axes.get(self.index)?,
            Kind::PathPosition => &block.path_position_mm,
            Kind::Feed => &block.feed_mm_per_min,
            Kind::VibrationOffset => &block.vibration_offset_mm,
            Kind::SpindleAngle => &block.spindle_angle_deg,
            Kind::ToolDirection => block.tool_direction.get(self.index)?,
            Kind::ServoAmplitude => servo?.amplitude_mm.get(self.index)?,
            Kind::ServoFrequency => &servo?.frequency_hz,
            Kind::ServoPhase => &servo?.phase_turns,
            Kind::ServoClampLow => servo?.clamp_low_mm.get(self.index)?,
            Kind::ServoClampHigh => servo?.clamp_high_mm.get(self.index)?,
            Kind::Unspecified => return None,
        };
        Some(values)
    }

    /// Puts values where [`Column::values`] finds them; those of a kind that this version does not know are dropped.
    pub fn put(&self, block: &mut SetpointBlock, values: Vec<f64>) {
        let servo = &mut block.servo;
        let place = match self.kind {
            Kind::AxisPosition => at(&mut block.axes, self.index),
            Kind::PathPosition => &mut block.path_position_mm,
            Kind::Feed => &mut block.feed_mm_per_min,
            Kind::VibrationOffset => &mut block.vibration_offset_mm,
            Kind::SpindleAngle => &mut block.spindle_angle_deg,
            Kind::ToolDirection => at(&mut block.tool_direction, self.index),
            Kind::ServoAmplitude => at(&mut servo.get_or_insert_default().amplitude_mm, self.index),
            Kind::ServoFrequency => &mut servo.get_or_insert_default().frequency_hz,
            Kind::ServoPhase => &mut servo.get_or_insert_default().phase_turns,
            Kind::ServoClampLow => at(&mut servo.get_or_insert_default().clamp_low_mm, self.index),
            Kind::ServoClampHigh => at(&mut servo.get_or_insert_default().clamp_high_mm, self.index),
            Kind::Unspecified => return,
        };
        *place = values;
    }
}

fn at(columns: &mut Vec<Vec<f64>>, index: usize) -> &mut Vec<f64> {
    if columns.len() <= index {
        columns.resize(index + 1, Vec::new());
    }
    &mut columns[index]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Extras = Extras { conditions: true, directions: true };

    fn five_axis() -> Machine {
        let mut machine = Machine::mill();
        let mut rotary = machine.axes[0].clone();
        rotary.name = "A".to_owned();
        rotary.axis = feedwave_program::Axis::A;
        machine.axes.push(rotary);
        machine
    }

    #[test]
    fn every_column_has_its_axis_and_its_unit_in_its_name() {
        let columns = of_machine(&five_axis(), ALL);
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(
            names[..8],
            [
                "X_mm",
                "Y_mm",
                "Z_mm",
                "A_deg",
                "path_position_mm",
                "feed_mm_per_min",
                "vibration_offset_mm",
                "spindle_angle_deg",
            ]
        );
        assert_eq!(
            names[8..14],
            [
                "X_vibration_amplitude_mm",
                "Y_vibration_amplitude_mm",
                "Z_vibration_amplitude_mm",
                "A_vibration_amplitude_deg",
                "vibration_frequency_hz",
                "vibration_phase_turns",
            ]
        );
        assert_eq!(names[14..18], ["X_clamp_low_mm", "Y_clamp_low_mm", "Z_clamp_low_mm", "A_clamp_low_deg"]);
        assert_eq!(names[22..], ["tool_direction_X", "tool_direction_Y", "tool_direction_Z"]);
        for column in &columns {
            let suffix = column.unit.to_ascii_lowercase().replace('/', "_per_");
            assert!(column.name.ends_with(&suffix), "{column:?}");
        }
    }

    #[test]
    fn every_kind_of_the_contract_is_in_the_table() {
        for number in 1.. {
            let Ok(kind) = Kind::try_from(number) else {
                assert_eq!(usize::try_from(number).unwrap(), TABLE.len() + 1);
                break;
            };
            assert!(needs(kind).is_some(), "{kind:?}");
        }
        assert_eq!(needs(Kind::Unspecified), None);
    }

    #[test]
    fn a_header_gives_the_columns_back_and_values_return_from_where_they_were_put() {
        for encoding in [Encoding::PackedDouble, Encoding::FixedPointDelta, Encoding::RawDouble] {
            let columns = of_machine(&five_axis(), ALL);
            let infos: Vec<ColumnInfo> = columns.iter().map(|column| column.info(encoding)).collect();
            let read = of_header(&infos);
            let mut block = SetpointBlock::default();
            for (number, (column, read)) in (0_u32..).zip(columns.iter().zip(&read)) {
                assert_eq!((column.kind, column.index, &column.name), (read.kind, read.index, &read.name));
                read.put(&mut block, vec![f64::from(number)]);
            }
            for (number, column) in (0_u32..).zip(&columns) {
                assert_eq!(column.values(&block), Some(&[f64::from(number)][..]), "{}", column.name);
            }
        }
    }

    #[test]
    fn a_block_without_a_column_says_so() {
        let columns = of_machine(&five_axis(), ALL);
        let block = SetpointBlock::default();
        let missing = columns.iter().filter(|column| column.values(&block).is_none()).count();
        assert_eq!(missing, 4 + 3 * 4 + 2 + 3);
        assert_eq!(of_machine(&five_axis(), Extras::default()).len(), 8);
    }
}
