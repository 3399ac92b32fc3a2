//! The devices of the agent: one for each machine, with its components and data items.

use feedwave_contract::proto::{AxisLetter, Machine, MachineAxis, MachineState, ProcessProperty, ProcessReading};

use super::values::{self, Value};

/// Where a data item belongs in a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Component {
    /// Name of the element.
    pub(super) kind: &'static str,
    /// Unique in all documents.
    pub(super) id: String,
    /// Name for clients.
    pub(super) name: Option<String>,
    /// The component that it is part of; `None` for the device itself.
    pub(super) parent: Option<usize>,
}

/// Sort of a data item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Category {
    Sample,
    Event,
    Condition,
}

impl Category {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Sample => "SAMPLE",
            Self::Event => "EVENT",
            Self::Condition => "CONDITION",
        }
    }
}

/// What a data item shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Availability,
    ControllerMode,
    Execution,
    Program,
    LineNumber,
    ToolNumber,
    PathFeed,
    FeedOverride,
    ProcessTimer,
    PartCount,
    PathPosition,
    /// Position of the axis that its component is named after.
    Axis,
    SpindleCommanded,
    SpindleProgrammed,
    SpindleOverride,
    RotaryMode,
    Deviation,
    DeviationAcceleration,
    Frequency,
    Amplitude,
    MotionProgram,
    Communications,
    System,
}

/// A data item.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) role: Role,
    /// Unique in all documents.
    pub(super) id: String,
    pub(super) component: usize,
    pub(super) category: Category,
    /// Its type, upper case; the element of an observation has the same name in camel case.
    pub(super) kind: &'static str,
    pub(super) sub_type: Option<&'static str>,
    pub(super) statistic: Option<&'static str>,
    pub(super) name: Option<&'static str>,
    pub(super) units: Option<&'static str>,
    pub(super) coordinate_system: Option<&'static str>,
    /// The only value that it has.
    pub(super) constant: Option<&'static str>,
}

impl Item {
    /// Name of the element of an observation: `PATH_FEEDRATE` is `PathFeedrate`.
    pub(super) fn element(&self) -> String {
        let word = |word: &str| {
            let (first, rest) = word.split_at(word.len().min(1));
            first.to_owned() + &rest.to_lowercase()
        };
        self.kind.split('_').map(word).collect()
    }

    /// The attributes that say what it is, in a probe, but for its id.
    pub(super) fn attributes(&self) -> Vec<(&'static str, String)> {
        let optional = [
            ("subType", self.sub_type),
            ("statistic", self.statistic),
            ("name", self.name),
            ("units", self.units),
            ("coordinateSystem", self.coordinate_system),
        ];
        let given = optional.into_iter().filter_map(|(name, value)| Some((name, value?.to_owned())));
        [("type", self.kind.to_owned()), ("category", self.category.name().to_owned())]
            .into_iter()
            .chain(given)
            .collect()
    }

    /// Those that are repeated in every observation.
    pub(super) fn repeated(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let repeated = [("subType", self.sub_type), ("statistic", self.statistic), ("name", self.name)];
        repeated.into_iter().filter_map(|(name, value)| Some((name, value?)))
    }
}

/// What limits of a data item mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LimitKind {
    /// What the axis can reach.
    Travel,
    /// Within them the feed stays as it is.
    Control,
}

/// The limits of a data item; at least one of them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Limits {
    pub(super) kind: LimitKind,
    /// Index of the data item, which has their unit.
    pub(super) item: usize,
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
}

impl Limits {
    /// Name of the element, and that of the one around its numbers.
    pub(super) const fn elements(&self) -> (&'static str, Option<&'static str>) {
        match self.kind {
            LimitKind::Travel => ("Specification", None),
            LimitKind::Control => ("ProcessSpecification", Some("ControlLimits")),
        }
    }

    /// The attributes of that element.
    pub(super) fn attributes(&self, item: &Item) -> Vec<(&'static str, String)> {
        let originator = match self.kind {
            LimitKind::Travel => "MANUFACTURER",
            LimitKind::Control => "USER",
        };
        let optional = [("subType", item.sub_type), ("units", item.units)];
        let given = optional.into_iter().filter_map(|(name, value)| Some((name, value?.to_owned())));
        [
            ("id", format!("{}_limits", item.id)),
            ("type", item.kind.to_owned()),
            ("originator", originator.to_owned()),
            ("dataItemIdRef", item.id.clone()),
        ]
        .into_iter()
        .chain(given)
        .collect()
    }

    /// The numbers with the names of their elements, the upper one first.
    pub(super) fn numbers(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let [upper, lower] = match self.kind {
            LimitKind::Travel => ["Maximum", "Minimum"],
            LimitKind::Control => ["UpperLimit", "LowerLimit"],
        };
        [(upper, self.upper), (lower, self.lower)].into_iter().filter_map(|(name, value)| Some((name, value?)))
    }
}

/// A machine as the agent shows it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Device {
    /// Identifier of the machine; the device has it as its id and name.
    pub(super) id: String,
    /// The device itself first; parts behind what they are part of.
    pub(super) components: Vec<Component>,
    pub(super) items: Vec<Item>,
    pub(super) limits: Vec<Limits>,
}

/// An axis of a machine as a device shows it.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) turns: bool,
    /// Lowest and highest position, mm or degrees; `None`: unlimited.
    pub(super) travel: [Option<f64>; 2],
}

/// Puts a device together.
struct Builder {
    device: Device,
}

impl Builder {
    fn component(&mut self, kind: &'static str, suffix: &str, name: Option<&str>, parent: usize) -> usize {
        let id = format!("{}_{suffix}", self.device.id);
        self.device.components.push(Component { kind, id, name: name.map(str::to_owned), parent: Some(parent) });
        self.device.components.len() - 1
    }

    fn item(
        &mut self,
        component: usize,
        role: Role,
        suffix: &str,
        category: Category,
        kind: &'static str,
    ) -> &mut Item {
        let id = format!("{}_{suffix}", self.device.id);
        self.device.items.push(Item {
            role,
            id,
            component,
            category,
            kind,
            sub_type: None,
            statistic: None,
            name: None,
            units: None,
            coordinate_system: None,
            constant: None,
        });
        let last = self.device.items.len() - 1;
        &mut self.device.items[last]
    }
}

impl Device {
    /// The device of a machine with these axes.
    pub(super) fn new(id: &str, axes: &[Axis]) -> Self {
        let itself = Component { kind: "Device", id: id.to_owned(), name: Some(id.to_owned()), parent: None };
        let device = Self { id: id.to_owned(), components: vec![itself], items: Vec::new(), limits: Vec::new() };
        let mut builder = Builder { device };
        builder.item(0, Role::Availability, "avail", Category::Event, "AVAILABILITY");
        builder.axes(axes);
        builder.controller();
        builder.device
    }

    /// The device of a machine of the store.
    pub(super) fn of(id: &str, machine: &Machine) -> Self {
        let model = machine.profile.as_ref().and_then(|profile| profile.machine.as_ref());
        let shown = |axis: &MachineAxis| Axis {
            name: axis.name.clone(),
            turns: is_rotary(axis),
            travel: [axis.travel_min, axis.travel_max],
        };
        let axes: Vec<_> = model.map(|model| model.axes.iter().map(shown).collect()).unwrap_or_default();
        Self::new(id, &axes)
    }

    /// The limits that a run is monitored with, as its last reading has them.
    pub(super) fn control_limits(&self, reading: &ProcessReading) -> Option<Limits> {
        let role = match (reading.property(), reading.unit.as_str()) {
            (ProcessProperty::Deviation, "mm") => Role::Deviation,
            (ProcessProperty::Deviation, _) => Role::DeviationAcceleration,
            (ProcessProperty::VibrationAmplitude, "mm") => Role::Amplitude,
            (ProcessProperty::VibrationFrequency, _) => Role::Frequency,
            (ProcessProperty::VibrationAmplitude | ProcessProperty::Unspecified, _) => return None,
        };
        let item = self.items.iter().position(|item| item.role == role)?;
        Some(Limits { kind: LimitKind::Control, item, lower: Some(reading.lower), upper: Some(reading.upper) })
    }

    pub(super) fn uuid(&self) -> String {
        format!("feedwave.{}", self.id)
    }

    /// The limits of the data items of a component, with these.
    pub(super) fn limits_of(&self, component: usize) -> impl Iterator<Item = (&Item, &Limits)> {
        let with_item = self.limits.iter().map(|limits| (&self.items[limits.item], limits));
        with_item.filter(move |(item, _)| item.component == component)
    }

    /// The value of every item in a state of the machine.
    pub(super) fn values(&self, state: &MachineState) -> Vec<Value> {
        let name = |item: &Item| self.components[item.component].name.as_deref().unwrap_or_default();
        self.items.iter().map(|item| values::of(item, name(item), state)).collect()
    }
}

fn is_rotary(axis: &MachineAxis) -> bool {
    matches!(axis.axis(), AxisLetter::A | AxisLetter::B | AxisLetter::C)
}

impl Builder {
    fn axes(&mut self, axes: &[Axis]) {
        let group = self.component("Axes", "ax", None, 0);
        for (index, Axis { name, turns, travel: [lower, upper] }) in axes.iter().enumerate() {
            let (kind, suffix) = if *turns { ("Rotary", "ang") } else { ("Linear", "pos") };
            // By number: names of axes may be those of other things.
            let axis = self.component(kind, &format!("a{index}"), Some(name), group);
            let (of, units) = if *turns { ("ANGLE", "DEGREE") } else { ("POSITION", "MILLIMETER") };
            let item = self.item(axis, Role::Axis, &format!("a{index}{suffix}"), Category::Sample, of);
            item.sub_type = Some("COMMANDED");
            item.units = Some(units);
            item.coordinate_system = Some("MACHINE");
            if lower.or(*upper).is_some() {
                let item = self.device.items.len() - 1;
                self.device.limits.push(Limits { kind: LimitKind::Travel, item, lower: *lower, upper: *upper });
            }
        }
        let spindle = self.component("Rotary", "spindle", Some("S"), group);
        for (role, suffix, sub_type) in
            [(Role::SpindleCommanded, "scmd", "COMMANDED"), (Role::SpindleProgrammed, "sprg", "PROGRAMMED")]
        {
            let item = self.item(spindle, role, suffix, Category::Sample, "ROTARY_VELOCITY");
            item.sub_type = Some(sub_type);
            item.units = Some("REVOLUTION/MINUTE");
        }
        let item = self.item(spindle, Role::SpindleOverride, "sovr", Category::Event, "ROTARY_VELOCITY_OVERRIDE");
        item.units = Some("PERCENT");
        let item = self.item(spindle, Role::RotaryMode, "smode", Category::Event, "ROTARY_MODE");
        item.constant = Some("SPINDLE");
        let item = self.item(spindle, Role::Deviation, "sdef", Category::Sample, "DISPLACEMENT");
        item.statistic = Some("MAXIMUM");
        item.units = Some("MILLIMETER");
        let item = self.item(spindle, Role::DeviationAcceleration, "sacc", Category::Sample, "ACCELERATION");
        item.statistic = Some("MAXIMUM");
        item.units = Some("MILLIMETER/SECOND^2");
        let item = self.item(spindle, Role::Frequency, "sfreq", Category::Sample, "FREQUENCY");
        item.units = Some("HERTZ");
        let item = self.item(spindle, Role::Amplitude, "samp", Category::Sample, "DISPLACEMENT");
        item.name = Some("vibrationAmplitude");
        item.units = Some("MILLIMETER");
    }

    fn controller(&mut self) {
        let controller = self.component("Controller", "ctl", None, 0);
        self.item(controller, Role::ControllerMode, "mode", Category::Event, "CONTROLLER_MODE");
        self.item(controller, Role::Communications, "com", Category::Condition, "COMMUNICATIONS");
        self.item(controller, Role::System, "sys", Category::Condition, "SYSTEM");
        let path = self.component("Path", "path", Some("path"), controller);
        self.item(path, Role::Execution, "exec", Category::Event, "EXECUTION");
        self.item(path, Role::Program, "prog", Category::Event, "PROGRAM").sub_type = Some("MAIN");
        self.item(path, Role::LineNumber, "line", Category::Event, "LINE_NUMBER").sub_type = Some("ABSOLUTE");
        self.item(path, Role::ToolNumber, "tool", Category::Event, "TOOL_NUMBER");
        let item = self.item(path, Role::PathFeed, "feed", Category::Sample, "PATH_FEEDRATE");
        item.sub_type = Some("COMMANDED");
        item.units = Some("MILLIMETER/SECOND");
        let item = self.item(path, Role::FeedOverride, "fovr", Category::Event, "PATH_FEEDRATE_OVERRIDE");
        item.sub_type = Some("PROGRAMMED");
        item.units = Some("PERCENT");
        let item = self.item(path, Role::PathPosition, "ppos", Category::Sample, "PATH_POSITION");
        item.sub_type = Some("COMMANDED");
        item.units = Some("MILLIMETER_3D");
        item.coordinate_system = Some("WORK");
        let item = self.item(path, Role::ProcessTimer, "time", Category::Sample, "PROCESS_TIMER");
        item.sub_type = Some("PROCESS");
        item.units = Some("SECOND");
        self.item(path, Role::PartCount, "parts", Category::Event, "PART_COUNT").sub_type = Some("COMPLETE");
        self.item(path, Role::MotionProgram, "mot", Category::Condition, "MOTION_PROGRAM");
    }
}
