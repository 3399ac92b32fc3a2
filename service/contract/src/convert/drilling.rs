//! Settings of drilling cycles, to and from the contract.

use feedwave_program::{BoringShift, DrillingSettings, DrillingStyle, PeckReturn};

use crate::convert::enumeration;
use crate::proto;
use crate::violations::Violations;

/// The settings; `None` with a violation.
pub(super) fn drilling_from_proto(
    violations: &mut Violations,
    settings: &proto::DrillingSettings,
) -> Option<DrillingSettings> {
    let style = enumeration(violations, "language.drilling.style", settings.style);
    let shift = enumeration(violations, "language.drilling.boring_shift", settings.boring_shift);
    let lathe_peck = peck_return_from_proto(violations, "language.drilling.lathe_peck", settings.lathe_peck);
    let tap_peck = peck_return_from_proto(violations, "language.drilling.tap_peck", settings.tap_peck);
    Some(DrillingSettings {
        style: match style? {
            proto::DrillingStyle::Unspecified | proto::DrillingStyle::Fanuc => DrillingStyle::Fanuc,
            proto::DrillingStyle::Haas => DrillingStyle::Haas,
        },
        chip_break_retract_mm: settings.chip_break_retract_mm,
        peck_clearance_mm: settings.peck_clearance_mm,
        peck_lift_mm: settings.peck_lift_mm,
        lathe_peck: lathe_peck?,
        rigid_tapping: settings.rigid_tapping,
        tap_peck: tap_peck?,
        boring_shift: match shift? {
            proto::BoringShift::Unspecified => None,
            proto::BoringShift::FirstPlus => Some(BoringShift::FirstPlus),
            proto::BoringShift::FirstMinus => Some(BoringShift::FirstMinus),
            proto::BoringShift::SecondPlus => Some(BoringShift::SecondPlus),
            proto::BoringShift::SecondMinus => Some(BoringShift::SecondMinus),
        },
        lathe_r_is_level: settings.lathe_r_is_level,
    })
}

fn peck_return_from_proto(violations: &mut Violations, field: &str, value: i32) -> Option<Option<PeckReturn>> {
    Some(match enumeration(violations, field, value)? {
        proto::PeckReturn::Unspecified => None,
        proto::PeckReturn::RLevel => Some(PeckReturn::RLevel),
        proto::PeckReturn::Back => Some(PeckReturn::Back),
    })
}

pub(super) fn drilling_to_proto(settings: &DrillingSettings) -> proto::DrillingSettings {
    let style = match settings.style {
        DrillingStyle::Fanuc => proto::DrillingStyle::Fanuc,
        DrillingStyle::Haas => proto::DrillingStyle::Haas,
    };
    let peck_return = |value: Option<PeckReturn>| match value {
        None => proto::PeckReturn::Unspecified,
        Some(PeckReturn::RLevel) => proto::PeckReturn::RLevel,
        Some(PeckReturn::Back) => proto::PeckReturn::Back,
    };
    let boring_shift = match settings.boring_shift {
        None => proto::BoringShift::Unspecified,
        Some(BoringShift::FirstPlus) => proto::BoringShift::FirstPlus,
        Some(BoringShift::FirstMinus) => proto::BoringShift::FirstMinus,
        Some(BoringShift::SecondPlus) => proto::BoringShift::SecondPlus,
        Some(BoringShift::SecondMinus) => proto::BoringShift::SecondMinus,
    };
    proto::DrillingSettings {
        style: style.into(),
        chip_break_retract_mm: settings.chip_break_retract_mm,
        peck_clearance_mm: settings.peck_clearance_mm,
        peck_lift_mm: settings.peck_lift_mm,
        lathe_peck: peck_return(settings.lathe_peck).into(),
        rigid_tapping: settings.rigid_tapping,
        tap_peck: peck_return(settings.tap_peck).into(),
        boring_shift: boring_shift.into(),
        lathe_r_is_level: settings.lathe_r_is_level,
    }
}
