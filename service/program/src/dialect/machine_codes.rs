//! M codes of the machine: those that a dialect knows, and those that the profile lists.

use super::{Group, letter_bit};
use crate::{DialectName, LanguageSettings, MachineEffect, MachineTiming};

/// An M code of the machine, as a block meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MachineRule {
    pub(crate) number: u32,
    pub(crate) effect: MachineEffect,
    pub(crate) step: MachineStep,
    /// Mask of the letters that it takes.
    pub(crate) words: u32,
    /// The modal group that it shares with other M codes of its block.
    pub(crate) group: Option<Group>,
    /// What it does beside its effect.
    pub(crate) action: MachineAction,
}

/// Where in the order of a block an M code of the machine takes effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum MachineStep {
    /// LinuxCNC's outputs and inputs: before the tool and the spindle.
    Signals,
    /// With the spindle.
    Spindle,
    /// Behind the coolant, before everything that moves.
    Before,
    /// Behind the motion.
    After,
}

/// What the interpreter does for an M code of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MachineAction {
    /// Hands it on.
    Pass,
    /// `M19`: the spindle is turned to an angle, and stops there.
    Orient,
    /// `M29`: the tapping cycle behind it is rigid.
    RigidTapping,
    /// `M61`: another tool is in the spindle.
    SetTool,
    /// `M70`, `M73`: saves the modes.
    SaveModes {
        /// The end of the called program restores them.
        for_return: bool,
    },
    /// `M71`: forgets the saved modes.
    ForgetModes,
    /// `M72`: restores the saved modes.
    RestoreModes,
}

impl MachineRule {
    /// An M code that is neither the dialect's nor listed.
    pub(crate) const fn unlisted(number: u32) -> Self {
        rule(number, MachineEffect::None, "")
    }

    const fn at(mut self, step: MachineStep) -> Self {
        self.step = step;
        self
    }

    const fn of(mut self, group: Group) -> Self {
        self.group = Some(group);
        self
    }

    const fn acts(mut self, action: MachineAction) -> Self {
        self.action = action;
        self
    }
}

const fn rule(number: u32, effect: MachineEffect, words: &str) -> MachineRule {
    let words = mask(words.as_bytes());
    MachineRule { number, effect, step: MachineStep::Before, words, group: None, action: MachineAction::Pass }
}

const fn mask(letters: &[u8]) -> u32 {
    let mut mask = 0;
    let mut at = 0;
    while at < letters.len() {
        mask |= letter_bit(letters[at]);
        at += 1;
    }
    mask
}

use MachineAction::{ForgetModes, Orient, RestoreModes, RigidTapping, SaveModes, SetTool};
use MachineEffect::{Barrier, None as Nothing, Stop};

/// FANUC and Haas, lathe and mill.
const FANUC: &[MachineRule] = &[
    rule(19, Barrier, "RSP").at(MachineStep::Spindle).of(Group::Spindle).acts(Orient),
    rule(29, Barrier, "").at(MachineStep::Spindle).of(Group::Tapping).acts(RigidTapping),
];

/// What mills have beside; on lathes these are the builder's.
const MILL: &[MachineRule] = &[
    rule(48, Nothing, "").of(Group::Overrides),
    rule(49, Nothing, "").of(Group::Overrides),
    rule(60, Stop, "").at(MachineStep::After).of(Group::Stop),
];

/// What Haas lathes have beside: `M24` ends the chamfers of threads that `M23` begins.
const HAAS_LATHE: &[MachineRule] = &[rule(24, Nothing, "")];

/// LinuxCNC, but for the codes of the user, 100 to 199.
const LINUXCNC: &[MachineRule] = &[
    rule(19, Barrier, "RPQ").at(MachineStep::Spindle).of(Group::Spindle).acts(Orient),
    rule(48, Nothing, "").of(Group::Overrides),
    rule(49, Nothing, "").of(Group::Overrides),
    rule(50, Nothing, "P").of(Group::Overrides),
    rule(51, Nothing, "P").of(Group::Overrides),
    rule(52, Nothing, "P").of(Group::Overrides),
    rule(53, Nothing, "P").of(Group::Overrides),
    rule(60, Stop, "").at(MachineStep::After).of(Group::Stop),
    rule(61, Barrier, "Q").at(MachineStep::Spindle).of(Group::ToolChange).acts(SetTool),
    rule(62, Nothing, "P").at(MachineStep::Signals).of(Group::Signal),
    rule(63, Nothing, "P").at(MachineStep::Signals).of(Group::Signal),
    rule(64, Nothing, "P").at(MachineStep::Signals).of(Group::Signal),
    rule(65, Nothing, "P").at(MachineStep::Signals).of(Group::Signal),
    rule(66, Barrier, "PELQ").at(MachineStep::Signals).of(Group::Signal),
    rule(67, Nothing, "EQ").at(MachineStep::Signals).of(Group::Signal),
    rule(68, Nothing, "EQ").at(MachineStep::Signals).of(Group::Signal),
    rule(70, Nothing, "").at(MachineStep::Spindle).of(Group::Spindle).acts(SaveModes { for_return: false }),
    rule(71, Nothing, "").at(MachineStep::Spindle).of(Group::Spindle).acts(ForgetModes),
    rule(72, Nothing, "").at(MachineStep::Spindle).of(Group::Spindle).acts(RestoreModes),
    rule(73, Nothing, "").at(MachineStep::Spindle).of(Group::Spindle).acts(SaveModes { for_return: true }),
];

/// The first code of LinuxCNC's users, whose commands wait for the path.
const FIRST_USER_CODE: u32 = 100;
const LAST_USER_CODE: u32 = 199;

/// The M codes of the machine, ascending; what the profile lists takes the place of the dialect's.
pub(super) fn rules(settings: &LanguageSettings) -> Vec<MachineRule> {
    let own: [&[MachineRule]; 2] = match settings.dialect {
        DialectName::Lathe if settings.is_haas() => [FANUC, HAAS_LATHE],
        DialectName::Lathe => [FANUC, &[]],
        DialectName::Mill => [FANUC, MILL],
        DialectName::LinuxCnc => [LINUXCNC, &[]],
    };
    let is_listed = |number: u32| settings.machine_codes.iter().any(|code| code.number == number);
    let user = (FIRST_USER_CODE..=LAST_USER_CODE).map(|number| rule(number, Barrier, "PQ").of(Group::UserCode));
    let user = user.filter(|_| settings.dialect == DialectName::LinuxCnc);
    let own = own.into_iter().flatten().copied().chain(user).filter(|rule| !is_listed(rule.number));
    let listed = settings.machine_codes.iter().map(|code| {
        let step = match code.timing {
            MachineTiming::Before => MachineStep::Before,
            MachineTiming::After => MachineStep::After,
        };
        rule(code.number, code.effect, &code.words).at(step)
    });
    let mut rules: Vec<_> = own.chain(listed).collect();
    rules.sort_by_key(|rule| rule.number);
    rules
}
