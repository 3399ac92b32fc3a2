//! The program language of a machine, to and from the contract.

use feedwave_motion::MachineKind;
use feedwave_program::{
    AngleRange, CompensationCorner, CompensationEntry, CompensationSettings, DecimalPointRule, DialectName, DwellUnit,
    FeedMode, GCodeSystem, InitialMotion, LanguageSettings, PathControlMode, Position, ThreadEWord, TurningSettings,
    UnlistedMachineCodes, XWord,
};

use super::drilling::{drilling_from_proto, drilling_to_proto};
use super::functions;
use super::machine_codes::{
    code_replacement_from_proto, code_replacement_to_proto, machine_code_to_proto, machine_codes_from_proto,
};
use super::offsets::{apply_offsets, check_offsets, coordinates_from_proto, coordinates_to_proto, offsets_to_proto};
use super::parameters::{parameters_from_proto, parameters_to_proto};
use crate::convert::enumeration;
use crate::proto;
use crate::violations::Violations;

/// A choice of the contract, whose unspecified value leaves what the dialect has.
trait Choice: Sized {
    type Message: TryFrom<i32> + Into<i32>;

    /// `None` where the message leaves it open.
    fn stated(message: Self::Message) -> Option<Self>;

    fn message(&self) -> Self::Message;
}

/// Says which values of a choice are which of the contract.
macro_rules! choices {
    ($($own:ident = $message:ident { $($value:ident = $named:ident),+ })+) => {$(
        impl Choice for $own {
            type Message = proto::$message;

            fn stated(message: proto::$message) -> Option<Self> {
                match message {
                    proto::$message::Unspecified => None,
                    $(proto::$message::$named => Some(Self::$value),)+
                }
            }

            fn message(&self) -> proto::$message {
                match self {
                    $(Self::$value => proto::$message::$named,)+
                }
            }
        }
    )+};
}

choices! {
    DialectName = Dialect { Lathe = Lathe, Mill = Mill, LinuxCnc = Linuxcnc }
    DecimalPointRule = DecimalPointRule { Calculator = Calculator, LeastIncrement = LeastIncrement }
    XWord = XWord { Diameter = Diameter, Radius = Radius }
    FeedMode = FeedMode { PerMinute = PerMinute, PerRevolution = PerRevolution }
    PathControlMode = PathControl { ExactPath = ExactPath, ExactStop = ExactStop, Continuous = Continuous }
    DwellUnit = DwellUnit { Milliseconds = Milliseconds, Seconds = Seconds }
    ThreadEWord = ThreadEWord { ThreadsPerInch = ThreadsPerInch, PreciseLead = PreciseLead }
    AngleRange = AngleRange { Positive = Positive, Signed = Signed }
    UnlistedMachineCodes = UnlistedMachineCodes { Note = Note, Error = Error }
    CompensationEntry = CompensationEntry { A = A, B = B, C = C }
    CompensationCorner = CompensationCorner { Linear = Linear, Circular = Circular }
    GCodeSystem = GCodeSystem { A = A, B = B, C = C }
    InitialMotion = InitialMotion { Rapid = Rapid, Linear = Linear }
}

/// A choice; what `default` says where it is open, and, with a violation, where it is unknown.
fn choice<C: Choice>(violations: &mut Violations, field: &str, given: i32, default: C) -> C {
    enumeration(violations, field, given).and_then(C::stated).unwrap_or(default)
}

/// The language of a machine of this kind, with what the message leaves open as in its dialect.
pub(super) fn language_from_proto(
    violations: &mut Violations,
    given: &proto::LanguageSettings,
    kind: MachineKind,
) -> LanguageSettings {
    let of_kind = match kind {
        MachineKind::Lathe => DialectName::Lathe,
        MachineKind::Mill => DialectName::Mill,
    };
    let dialect = choice(violations, "language.dialect", given.dialect, of_kind);
    let default = match dialect {
        DialectName::Lathe => LanguageSettings::default(),
        DialectName::Mill => LanguageSettings::mill(),
        DialectName::LinuxCnc => LanguageSettings::linuxcnc(),
    };
    let position = |given: &Option<proto::AxisPosition>, default| given.as_ref().map_or(default, position_from_proto);
    let mut language = LanguageSettings {
        dialect,
        machine_codes: machine_codes_from_proto(violations, &given.machine_codes).unwrap_or_default(),
        code_replacements: given.code_replacements.iter().map(code_replacement_from_proto).collect(),
        contour_tolerances_mm: contour_tolerances(
            violations,
            &given.contour_tolerances_mm,
            default.contour_tolerances_mm,
        ),
        dwell_in_revolutions: given.dwell_in_revolutions,
        plain_drawing_words: given.plain_drawing_words,
        input_result: given.input_result.unwrap_or(default.input_result),
        default_path_tolerance_mm: given.default_path_tolerance_mm.unwrap_or(default.default_path_tolerance_mm),
        initial_inch: given.initial_inch,
        block_delete: given.block_delete,
        reference_position: position(&given.reference_position, default.reference_position),
        initial_position: position(&given.initial_position, default.initial_position),
        arc_radius_tolerance_mm: given.arc_radius_tolerance_mm.unwrap_or(default.arc_radius_tolerance_mm),
        max_line_bytes: given.max_line_bytes.unwrap_or(default.max_line_bytes),
        program_number_digits: given.program_number_digits.unwrap_or(default.program_number_digits),
        max_executed_blocks: given.max_executed_blocks.unwrap_or(default.max_executed_blocks),
        max_still_blocks: given.max_still_blocks.unwrap_or(default.max_still_blocks),
        parameters: parameters_from_proto(violations, "language.parameters", &given.parameters),
        coordinates: coordinates_from_proto(violations, &given.coordinates.clone().unwrap_or_default()),
        drilling: drilling_from_proto(violations, &given.drilling.unwrap_or_default()).unwrap_or_default(),
        g_code_system: enumeration(violations, "language.g_code_system", given.g_code_system).and_then(Choice::stated),
        initial_motion: enumeration(violations, "language.initial_motion", given.initial_motion)
            .and_then(Choice::stated),
        turning: turning_from_proto(&given.turning.unwrap_or_default()),
        ..chosen(violations, given, default)
    };
    let (count, most) = (given.work_offsets.len(), language.work_offsets.len());
    if count > most {
        violations.add("language.work_offsets", format!("must list at most {most}, lists {count}"));
    }
    for (offset, given) in language.work_offsets.iter_mut().zip(&given.work_offsets) {
        *offset = position_from_proto(given);
    }
    if let Some(offsets) = &given.offsets {
        check_offsets(violations, "language.offsets", offsets);
        apply_offsets(offsets, &mut language);
    }
    functions::words_from_proto(given, &mut language);
    language
}

/// The choices of a message; those that it leaves open, and everything else, as in the dialect.
fn chosen(violations: &mut Violations, given: &proto::LanguageSettings, dialect: LanguageSettings) -> LanguageSettings {
    let mut language = dialect;
    /// Reads a choice of the same name.
    macro_rules! choose {
        ($($field:ident),+) => {
            $(language.$field = choice(violations, concat!("language.", stringify!($field)), given.$field, language.$field);)+
        };
    }
    choose!(decimal_point, x_word, initial_feed_mode, dwell_p_unit, initial_path_control, thread_e_word);
    choose!(unlisted_machine_codes, angle_range);
    let CompensationSettings { entry, corner } = &mut language.compensation;
    *entry = choice(violations, "language.compensation_entry", given.compensation_entry, *entry);
    *corner = choice(violations, "language.compensation_corner", given.compensation_corner, *corner);
    language
}

/// All levels, or none for what the dialect has.
fn contour_tolerances<const LEVELS: usize>(
    violations: &mut Violations,
    given: &[f64],
    default: [f64; LEVELS],
) -> [f64; LEVELS] {
    if given.is_empty() {
        return default;
    }
    given.try_into().unwrap_or_else(|_| {
        violations.add("language.contour_tolerances_mm", format!("must list none or ten, lists {}", given.len()));
        default
    })
}

/// The language as the contract has it, with every value stated.
pub(super) fn language_to_proto(language: &LanguageSettings) -> proto::LanguageSettings {
    let mut shown = proto::LanguageSettings {
        dialect: language.dialect.message().into(),
        decimal_point: language.decimal_point.message().into(),
        x_word: language.x_word.message().into(),
        initial_feed_mode: language.initial_feed_mode.message().into(),
        initial_inch: language.initial_inch,
        dwell_p_unit: language.dwell_p_unit.message().into(),
        block_delete: language.block_delete,
        work_offsets: language.work_offsets.iter().map(position_to_proto).collect(),
        reference_position: Some(position_to_proto(&language.reference_position)),
        initial_position: Some(position_to_proto(&language.initial_position)),
        arc_radius_tolerance_mm: Some(language.arc_radius_tolerance_mm),
        max_line_bytes: Some(language.max_line_bytes),
        initial_path_control: language.initial_path_control.message().into(),
        default_path_tolerance_mm: Some(language.default_path_tolerance_mm),
        thread_e_word: language.thread_e_word.message().into(),
        machine_codes: language.machine_codes.iter().map(machine_code_to_proto).collect(),
        code_replacements: language.code_replacements.iter().map(code_replacement_to_proto).collect(),
        program_number_digits: Some(language.program_number_digits),
        max_executed_blocks: Some(language.max_executed_blocks),
        max_still_blocks: Some(language.max_still_blocks),
        angle_range: language.angle_range.message().into(),
        parameters: parameters_to_proto(&language.parameters),
        drilling: Some(drilling_to_proto(&language.drilling)),
        coordinates: Some(coordinates_to_proto(&language.coordinates)),
        offsets: offsets_to_proto(language),
        unlisted_machine_codes: language.unlisted_machine_codes.message().into(),
        input_result: Some(language.input_result),
        contour_tolerances_mm: language.contour_tolerances_mm.to_vec(),
        dwell_in_revolutions: language.dwell_in_revolutions,
        plain_drawing_words: language.plain_drawing_words,
        compensation_entry: language.compensation.entry.message().into(),
        compensation_corner: language.compensation.corner.message().into(),
        g_code_system: language.g_code_system.map_or(0, |system| system.message().into()),
        initial_motion: language.initial_motion.map_or(0, |motion| motion.message().into()),
        turning: Some(turning_to_proto(&language.turning)),
        ..proto::LanguageSettings::default()
    };
    functions::words_to_proto(language, &mut shown);
    shown
}

const fn turning_from_proto(settings: &proto::TurningSettings) -> TurningSettings {
    let proto::TurningSettings { escape_mm, groove_return_mm, thread_chamfer_tenths } = *settings;
    TurningSettings { escape_mm, groove_return_mm, thread_chamfer_tenths }
}

const fn turning_to_proto(settings: &TurningSettings) -> proto::TurningSettings {
    let TurningSettings { escape_mm, groove_return_mm, thread_chamfer_tenths } = *settings;
    proto::TurningSettings { escape_mm, groove_return_mm, thread_chamfer_tenths }
}

pub(super) fn position_from_proto(position: &proto::AxisPosition) -> Position {
    let proto::AxisPosition { x, y, z, a, b, c, u, v, w } = *position;
    [x, y, z, a, b, c, u, v, w]
}

pub(super) fn position_to_proto(position: &Position) -> proto::AxisPosition {
    let [x, y, z, a, b, c, u, v, w] = *position;
    proto::AxisPosition { x, y, z, a, b, c, u, v, w }
}
