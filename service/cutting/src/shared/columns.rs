//! From places on the path to the columns of a block: the machine's axes and the direction of the tool.

use std::ops::Range;
use std::sync::Arc;

use feedwave_motion::kinematics::{Kinematics, RotaryDirections, Setup, ToolPose};
use feedwave_motion::{Curve, Element, Machine};
use feedwave_program::{Axis, Position};

use super::setpoint::{Frame, ServoColumns, SetpointBlock};
use super::track::Track;

/// How a column follows from a program axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ColumnMap {
    pub(crate) axis: Axis,
    /// −1 where the workpiece carries the axis.
    pub(crate) sign: f64,
    /// 1 where the work offset is added.
    offset_share: f64,
    /// Coordinates of the column.
    frame: Frame,
}

impl ColumnMap {
    pub(crate) fn of(machine: &Machine, frame: Frame) -> Vec<Self> {
        let map = |axis: &feedwave_motion::MachineAxis| match frame {
            Frame::Machine => Self { axis: axis.axis, sign: axis.sign(), offset_share: 1.0, frame },
            Frame::Work => Self { axis: axis.axis, sign: 1.0, offset_share: 0.0, frame },
        };
        machine.axes.iter().map(map).collect()
    }

    /// Whether the column is in work coordinates.
    pub(crate) fn is_of_work(&self) -> bool {
        self.frame == Frame::Work
    }

    /// Coordinates of the column.
    pub(crate) const fn frame(&self) -> Frame {
        self.frame
    }

    /// The same column in machine coordinates but for the sign: work coordinates of rotary axes turn with their own offset,
    /// so that nothing could be told by them.
    const fn of_machine(self) -> Self {
        Self { offset_share: 1.0, ..self }
    }

    pub(crate) fn value(self, work: f64, work_offset: &Position) -> f64 {
        self.sign * (work + self.offset_share * work_offset[self.axis.index()])
    }

    /// Value at the arc length `s` of one element, seen from another one that may have another work offset.
    pub(crate) fn value_of(self, of: &Element, s: f64, seen_from: &Element) -> f64 {
        let index = self.axis.index();
        let mut point = [0.0];
        match self.frame {
            Frame::Machine => of.fill_axis(self.axis, &[s], &mut point),
            Frame::Work => of.fill_work_axis(self.axis, &[s], &mut point),
        }
        let shift = of.work_offset[index] - seen_from.work_offset[index];
        self.value(point[0] + shift, &seen_from.work_offset)
    }

    /// Values on an element at the arc lengths `s`.
    pub(crate) fn fill(self, element: &Element, s: &[f64], out: &mut [f64]) {
        match self.frame {
            Frame::Machine => element.fill_axis(self.axis, s, out),
            Frame::Work => element.fill_work_axis(self.axis, s, out),
        }
        self.apply(&element.work_offset, out);
    }

    /// Derivatives by arc length, without the sign.
    pub(crate) fn fill_tangent(self, element: &Element, s: &[f64], out: &mut [f64]) {
        match self.frame {
            Frame::Machine => element.fill_tangent(self.axis, s, out),
            Frame::Work => element.fill_work_tangent(self.axis, s, out),
        }
    }

    pub(crate) fn apply(self, work_offset: &Position, column: &mut [f64]) {
        let offset = self.offset_share * work_offset[self.axis.index()];
        if self.sign != 1.0 || offset != 0.0 {
            for value in column {
                *value = self.sign * (*value + offset);
            }
        }
    }
}

/// Samples on one element: commanded arc lengths, and where the path goes before and after it.
pub(crate) struct Samples<'a, B> {
    pub(crate) columns: &'a [ColumnMap],
    /// Where the direction of the tool is asked for.
    pub(crate) tool: Option<&'a ToolColumns>,
    pub(crate) track: &'a Track<B>,
    /// The element's item on the track.
    pub(crate) item: usize,
    pub(crate) element: &'a Element,
    /// Commanded arc lengths in the element, mm.
    pub(crate) s: &'a [f64],
    /// Index of the first setpoint.
    pub(crate) index: u64,
    /// Interpolation period, s.
    pub(crate) period_s: f64,
}

/// Fills the rows from `start` on with the place at the arc lengths `s` of an element.
pub(crate) fn fill_axes(
    columns: &[ColumnMap],
    tool: Option<&ToolColumns>,
    element: &Element,
    s: &[f64],
    block: &mut SetpointBlock,
    start: usize,
) {
    let rows = start..start + s.len();
    for (map, column) in columns.iter().zip(&mut block.axes) {
        map.fill(element, s, &mut column[rows.clone()]);
    }
    if let Some(tool) = tool {
        let setup = match &element.curve {
            Curve::FiveAxis(five_axis) => Some(five_axis.setup()),
            _ => None,
        };
        tool.fill(block, rows, &element.work_offset, setup);
    }
}

/// The tool direction from the columns of the rotary axes.
#[derive(Clone, Debug)]
pub(crate) struct ToolColumns {
    kinematics: Arc<Kinematics>,
    directions: RotaryDirections,
    /// The rotary axes of the chain: program axis and column.
    rotary: [(Axis, usize); 2],
}

impl ToolColumns {
    /// For a machine that has both rotary axes.
    pub(crate) fn of(machine: &Machine, kinematics: &Arc<Kinematics>) -> Option<Self> {
        let [first, second] = kinematics.letters().1;
        let place = |axis: Axis| machine.column_of(axis).map(|column| (axis, column));
        let (directions, rotary) = (kinematics.rotary_directions(), [place(first)?, place(second)?]);
        Some(Self { kinematics: kinematics.clone(), directions, rotary })
    }

    /// Has the columns of the rotary axes, which the direction follows from, in machine coordinates whatever guides the tool.
    pub(crate) fn settle(&self, columns: &mut [ColumnMap]) {
        for (_, column) in self.rotary {
            columns[column] = columns[column].of_machine();
        }
    }

    /// Fills rows whose axes are there with the direction in work coordinates: those of a guided tool, or those of this offset.
    pub(crate) fn fill(
        &self,
        block: &mut SetpointBlock,
        rows: Range<usize>,
        work_offset: &Position,
        setup: Option<&Setup>,
    ) {
        let [x, y, z] = block.tool_direction.as_mut_slice() else { return };
        // A rotary offset turns the work coordinates of plain moves as it does those of a guided tool.
        let is_turned = self.rotary.iter().any(|(axis, _)| work_offset[axis.index()] != 0.0);
        let plain = (is_turned && setup.is_none()).then(|| {
            let work = self.kinematics.work_frame_at(&self.kinematics.from_position(work_offset));
            Setup { work, tool_length_mm: 0.0 }
        });
        let setup = setup.or(plain.as_ref());
        for row in rows {
            let rotary_rad = self.rotary.map(|(_, column)| block.axes[column][row].to_radians());
            let direction = self.directions.at(rotary_rad);
            let on_work = |setup: &Setup| setup.to_work(&ToolPose { tip_mm: [0.0; 3], direction }).direction;
            [x[row], y[row], z[row]] = setup.map_or(direction, on_work);
        }
    }
}

/// No vibration for the drives.
pub(crate) fn still(servo: &mut ServoColumns, start: usize) {
    for column in &mut servo.clamp_low_mm {
        column[start..].fill(f64::NEG_INFINITY);
    }
    for column in &mut servo.clamp_high_mm {
        column[start..].fill(f64::INFINITY);
    }
}
