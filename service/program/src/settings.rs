//! Language settings: what a machine profile says about how its programs are written.

mod coordinates;
mod drilling;
mod turning;

use serde::{Deserialize, Serialize};

pub use self::coordinates::{CoordinateSettings, CoordinateStyle};
pub use self::drilling::{BoringShift, DrillingSettings, DrillingStyle, PeckReturn};
pub(crate) use self::drilling::{FANUC_RETRACT_MM, LINUXCNC_RETRACT_MM};
pub(crate) use self::turning::ESCAPE_MM;
pub use self::turning::{GCodeSystem, TurningSettings};

use crate::{
    CodeReplacement, CompensationCorner, CompensationEntry, InitialParameters, MachineCode, PathControl, Position,
    UnlistedMachineCodes,
};

/// Which table of codes a program is read with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DialectName {
    /// Turning: `G50`/`G92 S` speed clamp, `G98`/`G99` and `G94`/`G95` feed modes, `U`/`W` incremental words, `T0101`.
    #[default]
    Lathe,
    /// Milling: `G93`/`G94`/`G95` feed modes, `G17` plane.
    Mill,
    /// LinuxCNC, mills and lathes: `G7`/`G8`, `G33`, `G76` with a drive line, its own order of execution.
    #[serde(rename = "linuxcnc")]
    LinuxCnc,
}

impl DialectName {
    /// Whether this dialect itself knows the M code of this number, so that a profile cannot assign it to a machining
    /// function.
    #[must_use]
    pub fn knows_m_code(self, number: f64) -> bool {
        crate::dialect::knows_m_code(self, number)
    }
}

/// How a number without a decimal point is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DecimalPointRule {
    /// `X10` is 10 mm.
    #[default]
    Calculator,
    /// `X10` is ten least increments: 0.010 mm (0.0010 inch, 0.010°). Only axis and length words are scaled.
    LeastIncrement,
}

/// What an X word means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum XWord {
    /// X (and U) words are diameters.
    #[default]
    Diameter,
    /// X words are radii.
    Radius,
}

/// Feed mode at program start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeedMode {
    /// mm/min
    PerMinute,
    /// mm/rev
    #[default]
    PerRevolution,
}

/// The motion that a control has in force before the program names one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InitialMotion {
    /// `G0`
    Rapid,
    /// `G1`
    Linear,
}

/// A mode of path control (modal group 13).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathControlMode {
    /// `G61`
    #[default]
    ExactPath,
    /// `G61.1`
    ExactStop,
    /// `G64`, at program start with the default tolerance.
    Continuous,
}

/// Largest tolerance of `G64`, mm. A path that may leave the programmed one by more is no longer that path.
pub const MAX_PATH_TOLERANCE_MM: f64 = 10.0;

/// Unit of the `P` word of `G4`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DwellUnit {
    /// `G4 P500` is half a second.
    #[default]
    Milliseconds,
    /// `G4 P0.5` is half a second.
    Seconds,
}

/// The codes that switch a machining function; a number may have one decimal place (`43.4`). They are G codes unless the
/// function says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunctionCodes {
    /// Code that switches it on.
    pub on: f64,
    /// Code that switches it off.
    pub off: f64,
}

/// The code of a machining function that is switched on and off by the `P` word of one G code.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunctionSwitch {
    /// G code of the function; may have one decimal place.
    pub code: f64,
    /// `P` word that switches it on.
    pub on_p: u32,
    /// `P` word that switches it off.
    pub off_p: u32,
}

/// What the `E` word of a thread says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThreadEWord {
    /// Threads per inch: the lead is 25.4 mm / E.
    #[default]
    ThreadsPerInch,
    /// The lead itself, as `F` says it, mm or inch.
    PreciseLead,
}

/// Range of the angles that `ASIN` and `ATAN[a]/[b]` of Macro B give, which a parameter of the control chooses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AngleRange {
    /// `ATAN` from 0 to 360 degrees, `ASIN` from 270 over 0 to 90.
    #[default]
    Positive,
    /// `ATAN` from -180 to 180 degrees, `ASIN` from -90 to 90.
    Signed,
}

/// How FANUC controls and the like join the blocks of a contour with radius compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CompensationSettings {
    /// Moves to the contour and from it.
    pub entry: CompensationEntry,
    /// How outside corners are passed.
    pub corner: CompensationCorner,
}

/// How programs for one machine are written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LanguageSettings {
    /// Table of codes.
    pub dialect: DialectName,
    /// The G-code system of a lathe; without it, codes that the systems read differently are refused.
    pub g_code_system: Option<GCodeSystem>,
    /// Numbers without a decimal point.
    pub decimal_point: DecimalPointRule,
    /// Diameter or radius in X.
    pub x_word: XWord,
    /// Feed mode at program start.
    pub initial_feed_mode: FeedMode,
    /// Motion before the first motion code, which a parameter of the control says (FANUC: 3402, bit 0). Without it a program that
    /// relies on it is refused, but for Haas controls, which start with `G0`. LinuxCNC has none.
    pub initial_motion: Option<InitialMotion>,
    /// Path control at program start.
    pub initial_path_control: PathControlMode,
    /// Tolerance of a `G64` without `P`, mm, 0 to [`MAX_PATH_TOLERANCE_MM`].
    pub default_path_tolerance_mm: f64,
    /// Tolerance of the levels 1 (fast) to 10 (accurate) of contour control (`G5.1 Q1 R`, `G187 P`), mm, each 0 to
    /// [`MAX_PATH_TOLERANCE_MM`].
    pub contour_tolerances_mm: [f64; 10],
    /// `X` and `U` of `G4` under feed per revolution are revolutions instead of seconds.
    pub dwell_in_revolutions: bool,
    /// On a lathe without axes A and C these letters are the angle of a line and a chamfer, without a comma. R and C then need no sign.
    pub plain_drawing_words: bool,
    /// Inch (`G20`) at program start instead of mm.
    pub initial_inch: bool,
    /// Unit of `G4 P`.
    pub dwell_p_unit: DwellUnit,
    /// Whether blocks with `/` are skipped.
    pub block_delete: bool,
    /// Codes of vibration along the path.
    pub path_vibration: FunctionCodes,
    /// Codes of the oscillation of a rotary tool.
    pub tool_oscillation: FunctionCodes,
    /// M codes of the thinning of five-axis blocks, which `G43.4 P1` and `G43.4 P0` switch as well. None where the dialect or the
    /// machine has no tool centre point control: they are then M codes of the machine like others.
    pub thinning: Option<FunctionCodes>,
    /// M codes that the machine carries out itself.
    pub machine_codes: Vec<MachineCode>,
    /// M codes that neither the dialect nor `machine_codes` lists.
    pub unlisted_machine_codes: UnlistedMachineCodes,
    /// Codes that the machine replaces by other words.
    pub code_replacements: Vec<CodeReplacement>,
    /// What a wait for an input (`M66` of LinuxCNC, #5399) is taken to bring: -1 for a time that ran out.
    pub input_result: f64,
    /// Code of vibration in threads.
    pub thread_vibration: FunctionSwitch,
    /// `E` in threads.
    pub thread_e_word: ThreadEWord,
    /// Drilling, boring and tapping cycles.
    pub drilling: DrillingSettings,
    /// Turning cycles.
    pub turning: TurningSettings,
    /// Radius compensation, except in LinuxCNC.
    pub compensation: CompensationSettings,
    /// Work offsets `G54`…`G59`: machine position = work position + offset, mm (X a radius) and degrees.
    pub work_offsets: [Position; 6],
    /// Coordinates and offsets beyond these.
    pub coordinates: CoordinateSettings,
    /// Reference position of `G28`, machine coordinates, mm (X a radius) and degrees.
    pub reference_position: Position,
    /// Machine position at program start, mm (X a radius) and degrees.
    pub initial_position: Position,
    /// Largest difference between start and end radius of an arc, mm; in inch programs 0.0003 inch at least.
    pub arc_radius_tolerance_mm: f64,
    /// Range of `ASIN` and `ATAN[a]/[b]` of Macro B.
    pub angle_range: AngleRange,
    /// Initial values of parameters, and values of the control that programs read and only the machine knows.
    pub parameters: InitialParameters,
    /// Digits of a program number where `M98 P` has more and no L: the digits before them are repetitions. 4, or 8 for none.
    pub program_number_digits: u32,
    /// Most blocks executed in a run of the program.
    pub max_executed_blocks: u64,
    /// Most blocks executed one after another without motion in one loop, or in the runs of one call.
    pub max_still_blocks: u64,
    /// Longest line read, bytes; a longer one is a finding and is skipped.
    pub max_line_bytes: u32,
}

impl Default for LanguageSettings {
    fn default() -> Self {
        Self {
            dialect: DialectName::Lathe,
            g_code_system: None,
            decimal_point: DecimalPointRule::Calculator,
            x_word: XWord::Diameter,
            initial_feed_mode: FeedMode::PerRevolution,
            initial_motion: None,
            initial_path_control: PathControlMode::ExactPath,
            // Below the tolerances of ordinary parts, and enough to carry most of the feed through a corner.
            default_path_tolerance_mm: 0.01,
            // From roughing to finishing, the default tolerance in the middle.
            contour_tolerances_mm: [0.05, 0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.004, 0.003, 0.002],
            dwell_in_revolutions: false,
            plain_drawing_words: false,
            initial_inch: false,
            dwell_p_unit: DwellUnit::Milliseconds,
            block_delete: false,
            path_vibration: FunctionCodes { on: 200.0, off: 201.0 },
            tool_oscillation: FunctionCodes { on: 202.0, off: 203.0 },
            thinning: None,
            machine_codes: Vec::new(),
            unlisted_machine_codes: UnlistedMachineCodes::Note,
            code_replacements: Vec::new(),
            input_result: -1.0,
            thread_vibration: FunctionSwitch { code: 165.0, on_p: 3, off_p: 0 },
            thread_e_word: ThreadEWord::ThreadsPerInch,
            drilling: DrillingSettings::default(),
            turning: TurningSettings::default(),
            compensation: CompensationSettings::default(),
            work_offsets: [[0.0; 9]; 6],
            coordinates: CoordinateSettings::default(),
            reference_position: [0.0; 9],
            initial_position: [0.0; 9],
            // Posts write three decimals: two rounded ends and a rounded centre differ by up to about 2 µm.
            arc_radius_tolerance_mm: 0.005,
            angle_range: AngleRange::Positive,
            parameters: InitialParameters::default(),
            program_number_digits: 4,
            max_executed_blocks: 50_000_000,
            max_still_blocks: 5_000_000,
            max_line_bytes: 4_096,
        }
    }
}

impl LanguageSettings {
    /// The motion in force before the first motion code, where it is known.
    pub(crate) fn motion_at_power_on(&self) -> Option<InitialMotion> {
        if self.dialect == DialectName::LinuxCnc {
            return None;
        }
        // The manuals of Haas controls state theirs, and no parameter changes it.
        self.initial_motion.or(self.is_haas().then_some(InitialMotion::Rapid))
    }

    /// Whether the control skips what stands behind the `%` that begins a file, to the end of the line.
    pub(crate) fn skips_titles(&self) -> bool {
        self.dialect != DialectName::LinuxCnc && !self.is_haas()
    }

    /// Whether the control is one of Haas, as far as the settings say so. Haas lathes have system A: others may have their drilling cycles.
    pub(crate) fn is_haas(&self) -> bool {
        let may_be = match self.dialect {
            DialectName::Lathe => matches!(self.g_code_system, None | Some(GCodeSystem::A)),
            DialectName::Mill => true,
            DialectName::LinuxCnc => false,
        };
        may_be && (self.drilling.style == DrillingStyle::Haas || self.coordinates.style == CoordinateStyle::Haas)
    }

    /// The codes of feed per minute and per revolution, as findings name them. A lathe whose G-code system is not known reads
    /// those of system A.
    pub(crate) const fn feed_codes(&self) -> [&'static str; 2] {
        match (self.dialect, self.g_code_system) {
            (DialectName::Lathe, None | Some(GCodeSystem::A)) => ["G98", "G99"],
            _ => ["G94", "G95"],
        }
    }

    /// Default settings of a milling machine: `mill` dialect, radius X, feed per minute.
    #[must_use]
    pub fn mill() -> Self {
        Self {
            dialect: DialectName::Mill,
            x_word: XWord::Radius,
            initial_feed_mode: FeedMode::PerMinute,
            thinning: Some(FunctionCodes { on: 33.0, off: 34.0 }),
            ..Self::default()
        }
    }

    /// Default settings of LinuxCNC: `linuxcnc` dialect, radius X, feed per minute, dwell in seconds.
    #[must_use]
    pub fn linuxcnc() -> Self {
        Self { dialect: DialectName::LinuxCnc, dwell_p_unit: DwellUnit::Seconds, thinning: None, ..Self::mill() }
    }

    /// What machine coordinates are more than work coordinates before the first block: the work offset of `G54`, and
    /// whatever else is in force then.
    #[must_use]
    pub fn initial_offset(&self) -> Position {
        crate::InterpreterState::new(self).coords.total
    }

    /// Whether the dialect, in the G-code system that is named, itself carries out the G code of this number, so that a profile
    /// should not assign it to a machining function, which would win.
    #[must_use]
    pub fn carries_out_g_code(&self, number: f64) -> bool {
        crate::dialect::carries_out_g_code(self, number)
    }

    /// A mode of path control, `G64` with the default tolerance.
    pub(crate) const fn path_control(&self, mode: PathControlMode) -> PathControl {
        match mode {
            PathControlMode::ExactPath => PathControl::ExactPath,
            PathControlMode::ExactStop => PathControl::ExactStop,
            PathControlMode::Continuous => PathControl::Continuous {
                tolerance_mm: self.default_path_tolerance_mm,
                merge_tolerance_mm: self.default_path_tolerance_mm,
            },
        }
    }
}
