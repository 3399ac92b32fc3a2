//! The words of cycles along a contour, on FANUC controls, Haas and in LinuxCNC.

use serde::{Deserialize, Serialize};

use super::super::execute::Execution;
use super::follow::ContourRun;
use super::{DEPTHS_MM, LENGTHS_MM, Reading, SCALED, SIGNED_MM, THOUSANDTHS};
use crate::code;
use crate::dialect::letter_bit;
use crate::settings::ESCAPE_MM;
use crate::state::{Pockets, TurningCycle};
use crate::{DialectName, DrillingStyle, Feed};

/// Passes of a pattern, and of LinuxCNC's finishing.
const PASSES: core::ops::RangeInclusive<u32> = 1..=1_000;

/// Numbers of blocks.
const LABELS: core::ops::RangeInclusive<u32> = 1..=99_999_999;

/// What is made along a contour; lengths in mm, along X on the radius, points as Z and X.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Job {
    /// The contour as it is written.
    Finish,
    /// Passes parallel to an axis.
    Rough {
        /// Along X instead of Z.
        facing: bool,
        depth_mm: f64,
        escape_mm: f64,
        /// From the finished contour to the one that is roughed.
        allowance: [f64; 2],
    },
    /// Passes along the contour.
    Pattern { relief: [f64; 2], passes: u32, allowance: [f64; 2] },
    /// LinuxCNC's roughing; its tolerances are in the unit of the program.
    Steps { facing: bool, pockets: Pockets, depth_mm: f64, escape_mm: f64, stock_mm: f64, unit_mm: f64 },
    /// LinuxCNC's finishing, likewise.
    Offsets { first_mm: f64, last_mm: f64, passes: u32, unit_mm: f64 },
}

/// Where the contour is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Whereabouts {
    /// From one numbered block to another.
    Blocks { first: u32, last: u32 },
    /// A numbered subprogram.
    Sub(u32),
}

/// A cycle along a contour as it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Request {
    pub(super) job: Job,
    pub(super) contour: Whereabouts,
    /// Feed of the passes; without one where the contour has its own.
    pub(super) feed: Option<Feed>,
    /// Z and X where the cycle begins.
    pub(super) start: [f64; 2],
    /// Z and X of the tool.
    pub(super) tool: [f64; 2],
    /// The last blocks of the contour may lead back from it (Haas).
    pub(super) may_depart: bool,
}

const RADIUS: Reading = |this, word| this.radius(word);

impl Execution<'_> {
    /// A block with `G70` to `G73` of a FANUC or Haas lathe.
    pub(super) fn contour_cycle(&mut self, cycle: TurningCycle) {
        let letters = self.block.letters & !self.used;
        let has = |letter| letters & letter_bit(letter) != 0;
        let contour =
            [self.turning_count(b'P', "first_block", &LABELS), self.turning_count(b'Q', "last_block", &LABELS)];
        if !has(b'P') && !has(b'Q') && cycle != TurningCycle::Finish {
            return self.first_line(cycle);
        }
        let job = match cycle {
            TurningCycle::Finish => Some(Job::Finish),
            TurningCycle::Turn(_) => self.roughing(false),
            TurningCycle::Face(_) => self.roughing(true),
            _ => self.pattern(),
        };
        let [Some(first), Some(last)] = contour else { return };
        let (Some(first), Some(last)) = (first, last) else {
            return self.turning_word_missing("contour", "add P and Q with the numbers of its first and last block");
        };
        self.ask_for(cycle, Whereabouts::Blocks { first, last }, job, self.tool_place());
    }

    /// Asks for the contour of a job; without a job, for it to be passed over after a finding.
    fn ask_for(&mut self, cycle: TurningCycle, contour: Whereabouts, job: Option<Job>, [x, z]: [f64; 2]) {
        if self.state.flow.contour.is_some() {
            return self.turning_finding(
                code::TURNING_CONTOUR,
                "a turning cycle within the contour of another one",
                "end the contour before it: Q names its last block",
            );
        }
        let finishes = cycle == TurningCycle::Finish;
        let is_linuxcnc = self.settings.dialect == DialectName::LinuxCnc;
        let what = if finishes { "a finishing cycle" } else { "a roughing cycle" };
        if is_linuxcnc && self.is_cycle_on_contour(what) {
            return;
        }
        let needs_feed = job != Some(Job::Finish);
        let feed = if needs_feed { self.cutting_feed() } else { None };
        let [tool_x, tool_z] = self.tool_place();
        let tool = [tool_z, tool_x];
        let is_broken = job.is_none() || needs_feed && feed.is_none();
        // Without a job the contour is read all the same, and passed over.
        let nothing = Job::Pattern { relief: [0.0; 2], passes: 0, allowance: [0.0; 2] };
        let job = job.unwrap_or(if finishes { Job::Finish } else { nothing });
        let request = Request {
            job,
            contour,
            feed,
            start: [z, x],
            tool,
            may_depart: !is_linuxcnc && self.settings.drilling.style == DrillingStyle::Haas,
        };
        let mut run = ContourRun::asked(request, self.block.span(), is_broken);
        if !is_linuxcnc {
            run.suspend_compensation(self);
        }
        self.state.flow.contour = Some(Box::new(run));
    }

    /// The first of two lines: what stays in force for the cycles behind it.
    fn first_line(&mut self, cycle: TurningCycle) {
        if cycle == TurningCycle::Pattern {
            let along_x = self.turning_length(b'U', "relief_along_x", &SIGNED_MM, SCALED);
            let along_z = self.turning_length(b'W', "relief_along_z", &SIGNED_MM, SCALED);
            let passes = self.turning_count(b'R', "passes", &PASSES);
            let (Some(along_x), Some(along_z), Some(passes)) = (along_x, along_z, passes) else { return };
            if along_x.is_none() && along_z.is_none() && passes.is_none() {
                return self.turning_word_missing("words", "write U and W with the relief, and R with the passes");
            }
            let modes = &mut self.state.turning;
            let before = modes.relief_mm.unwrap_or_default();
            if along_x.is_some() || along_z.is_some() {
                modes.relief_mm = Some([along_x.unwrap_or(before[0]), along_z.unwrap_or(before[1])]);
            }
            modes.passes = passes.or(modes.passes);
            return;
        }
        let letter = if matches!(cycle, TurningCycle::Face(_)) { b'W' } else { b'U' };
        let depth = self.turning_length(letter, "depth", &DEPTHS_MM, SCALED);
        let escape = self.turning_length(b'R', "escape", &LENGTHS_MM, SCALED);
        let (Some(depth), Some(escape)) = (depth, escape) else { return };
        if depth.is_none() && escape.is_none() {
            let cure = format!("write {} with the depth of a pass and R with the escape", char::from(letter));
            return self.turning_word_missing("words", &cure);
        }
        let modes = &mut self.state.turning;
        modes.depth_mm = depth.or(modes.depth_mm);
        modes.escape_mm = escape.or(modes.escape_mm);
    }

    /// Allowances along Z and X; `None` after a finding.
    fn allowance(&mut self) -> Option<[f64; 2]> {
        let along_x = self.turning_length(b'U', "allowance_along_x", &SIGNED_MM, RADIUS);
        let along_z = self.turning_length(b'W', "allowance_along_z", &SIGNED_MM, SCALED);
        Some([along_z?.unwrap_or(0.0), along_x?.unwrap_or(0.0)])
    }

    /// `D` of one line.
    fn one_line_depth(&mut self) -> Option<Option<f64>> {
        let read = if self.settings.drilling.style == DrillingStyle::Haas { SCALED } else { THOUSANDTHS };
        self.turning_length(b'D', "depth", &DEPTHS_MM, read)
    }

    /// The second of two lines of `G71` or `G72`, or the one line.
    fn roughing(&mut self, facing: bool) -> Option<Job> {
        let has_pre_finish = self.block.word(b'I').is_some() || self.block.word(b'K').is_some();
        if has_pre_finish {
            self.used |= letter_bit(b'I') | letter_bit(b'K');
            self.turning_finding(
                code::TURNING_FORM,
                "I and K are allowances of a pass of older controls before the finishing, which is not known here",
                "leave I and K out, and write U and W with the whole allowance",
            );
        }
        let (depth, allowance) = (self.one_line_depth(), self.allowance());
        let in_one_line = self.settings.turning.escape_mm;
        let (depth, allowance) = (depth?, allowance?);
        if has_pre_finish {
            return None;
        }
        let stated = self.state.turning.escape_mm.or(in_one_line);
        let Some(depth_mm) = depth.or(self.state.turning.depth_mm) else {
            let letter = if facing { 'W' } else { 'U' };
            let cure = format!("write {letter} and R in a block of the cycle before it, or D in this one");
            self.turning_word_missing("depth of a pass", &cure);
            return None;
        };
        let escape_mm = self.turning_default(0, stated, "escape_mm", ESCAPE_MM);
        Some(Job::Rough { facing, depth_mm, escape_mm, allowance })
    }

    /// The second of two lines of `G73`, or the one line.
    fn pattern(&mut self) -> Option<Job> {
        let along_x = self.turning_length(b'I', "relief_along_x", &SIGNED_MM, SCALED);
        let along_z = self.turning_length(b'K', "relief_along_z", &SIGNED_MM, SCALED);
        let passes = self.turning_count(b'D', "passes", &PASSES);
        let allowance = self.allowance();
        let (along_x, along_z, passes, allowance) = (along_x?, along_z?, passes?, allowance?);
        let in_one_line = along_x.is_some() || along_z.is_some() || passes.is_some();
        let modes = &self.state.turning;
        let before = if in_one_line { None } else { modes.relief_mm };
        let relief = match (along_x, along_z, before) {
            (None, None, None) => None,
            (along_x, along_z, before) => {
                let [x, z] = before.unwrap_or_default();
                Some([along_z.unwrap_or(z), along_x.unwrap_or(x)])
            }
        };
        let passes = if in_one_line { passes } else { modes.passes };
        let (Some(relief), Some(passes)) = (relief, passes) else {
            let cure = "write U, W and R in a block of the cycle before it, or I, K and D in this one";
            self.turning_word_missing("relief and passes", cure);
            return None;
        };
        Some(Job::Pattern { relief, passes, allowance })
    }

    /// A block with `G70` to `G72.2` of LinuxCNC: the contour is a subprogram.
    pub(super) fn contour_of_linuxcnc(&mut self, cycle: TurningCycle) {
        let sub = self.turning_count(b'Q', "subprogram", &(0..=99_999_999));
        let x = self.take(b'X').map(|word| self.radius(&word));
        let z = self.take(b'Z').map(|word| self.scaled(&word, true));
        let job = match cycle {
            TurningCycle::Finish => self.offsets(),
            TurningCycle::Turn(pockets) => self.steps(false, pockets),
            TurningCycle::Face(pockets) => self.steps(true, pockets),
            _ => None,
        };
        let Some(sub) = sub else { return };
        let Some(sub) = sub else {
            return self.turning_word_missing("contour", "add Q with the number of the subprogram that has it");
        };
        if !self.state.absolute {
            return self.turning_finding(
                code::TURNING_FORM,
                "a turning cycle needs absolute coordinates",
                "write G90 before it",
            );
        }
        let [here_x, here_z] = self.tool_place();
        self.ask_for(cycle, Whereabouts::Sub(sub), job, [x.unwrap_or(here_x), z.unwrap_or(here_z)]);
    }

    fn steps(&mut self, facing: bool, pockets: Pockets) -> Option<Job> {
        let depth = self.turning_length(b'I', "depth", &DEPTHS_MM, SCALED);
        let escape = self.turning_length(b'R', "escape", &LENGTHS_MM, SCALED);
        let stock = self.turning_length(b'D', "stock", &SIGNED_MM, SCALED);
        let unit_mm = self.unit_mm();
        Some(Job::Steps {
            facing,
            pockets,
            depth_mm: depth?.unwrap_or(unit_mm),
            escape_mm: escape?.unwrap_or(0.5 * unit_mm),
            stock_mm: stock?.unwrap_or(0.0),
            unit_mm,
        })
    }

    fn offsets(&mut self) -> Option<Job> {
        let first = self.turning_length(b'D', "first_distance", &SIGNED_MM, SCALED);
        let last = self.turning_length(b'E', "last_distance", &SIGNED_MM, SCALED);
        let passes = self.turning_count(b'P', "passes", &PASSES);
        Some(Job::Offsets {
            first_mm: first?.unwrap_or(0.0),
            last_mm: last?.unwrap_or(0.0),
            passes: passes?.unwrap_or(1),
            unit_mm: self.unit_mm(),
        })
    }

    /// Millimetres in a unit of the program.
    const fn unit_mm(&self) -> f64 {
        if self.state.inch { super::super::execute::MM_PER_INCH } else { 1.0 }
    }
}
