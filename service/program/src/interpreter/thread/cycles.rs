//! Threading cycles of FANUC lathes: `G92`, and `G76` in two lines and in one.
//!
//! A cycle becomes the moves that the control makes: rapid to the start of a pass, the pass, rapid out in X, rapid
//! back in Z; after the last it is where it started. Lengths of cycles are on the radius, but for X itself. The
//! vibration of a pass follows from its infeed and the ratio of `G165`; finishing passes do not vibrate.
//!
//! `G76` of two lines: pass n cuts to Q·√n, at least the least infeed Q of the first line deeper than the pass before,
//! down to the allowance R of the first line; then come P(m) passes at full depth. `G76` of one line: P1 and P2 keep
//! the removed area (D·√n), P3 and P4 the infeed (D·n); P1 and P3 feed in along one flank, P2 and P4 on both in turn.
//! Along a flank a pass starts before the start of the cycle, by tan(angle / 2) times what its depth lacks of the height, on the
//! other flank as far behind it; the last pass starts at the start of the cycle, and all end at Z.

use core::ops::RangeInclusive;

use super::super::doubt::SYSTEM_CURE;
use super::super::execute::{Execution, MM_PER_INCH};
use super::super::motion::Frame;
use super::infeed::{Infeed, MAX_PASSES, Pass};
use super::words::AMOUNTS_MM;
use super::{AngleOf, Cut};
use crate::code;
use crate::dialect::{Group, Meaning, letter_bit};
use crate::state::{CycleModes, Motion};
use crate::{Axis, DialectName, Finding, Function, PullOut};

/// Tapers, mm on the radius.
const TAPERS_MM: RangeInclusive<f64> = -1_000.0..=1_000.0;

/// Tool angles of the `G76` of two lines, degrees.
const TOOL_ANGLES_DEG: [u32; 6] = [80, 60, 55, 30, 29, 0];

/// Rounding that a start exactly on the crest is forgiven, mm.
pub(super) const ON_THE_CREST_MM: f64 = 1e-9;

/// The letters of X and Z.
const ENDS: [u32; 2] = [letter_bit(b'X') | letter_bit(b'U'), letter_bit(b'Z') | letter_bit(b'W')];

/// Which `G76` a block is, by its words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// `G76 P(m)(r)(a) Q R`, the first of two lines.
    Modes,
    /// `G76 X Z R P Q F`, the second of two lines.
    TwoLines,
    /// `G76 X Z I K D F A P Q`
    OneLine,
    /// LinuxCNC's `G76 P Z I J R K Q H E L`.
    DriveLine,
}

impl Form {
    /// The form that has all these letters, if there is exactly one.
    fn of(letters: u32) -> Option<Self> {
        let any = |text: &[u8]| text.iter().any(|&letter| letters & letter_bit(letter) != 0);
        if any(b"J") {
            return (!any(b"XUDFA")).then_some(Self::DriveLine);
        }
        if any(b"D") {
            return (!any(b"RHL")).then_some(Self::OneLine);
        }
        if any(b"IKAHL") {
            return None;
        }
        Some(if any(b"XUZWFE") { Self::TwoLines } else { Self::Modes })
    }
}

/// A cycle of passes in a V, lengths in mm on the radius.
struct VCycle {
    /// X and Z of the thread's root at its end.
    root: [f64; 2],
    taper_mm: f64,
    height_mm: f64,
    alternating: bool,
    lead_mm: f64,
    start_angle_deg: f64,
    included_angle_deg: f64,
    chamfer_tenths: u32,
}

impl Execution<'_> {
    /// A block with a lathe's `G92`.
    pub(in super::super) fn open_thread_cycle(&mut self) {
        if !self.is_thread_block() {
            // The speed clamp.
            return;
        }
        if self.block.unclear {
            self.state.motion = Motion::Unclear;
            return;
        }
        if let Some((_, span)) = self.code(Group::NonModal)
            && self.is_doubtful_thread(span)
        {
            return;
        }
        if let Some((_, span)) = self.code(Group::Motion).filter(|(meaning, _)| *meaning != Meaning::ThreadCycle) {
            self.findings.push_with(code::GROUP_CONFLICT, |code| {
                Finding::new(code, span, "a threading cycle is a motion code itself")
                    .suggest("keep one of them, or write them in two blocks")
            });
        }
        if let Some(word) = self.block.word(b'S').copied() {
            self.word_conflict(&word, "S makes G92 the speed clamp, and axis words make it a threading cycle");
        }
        let axes = self.block.letters & self.table.axis_letters & !self.used;
        if self.state.motion != Motion::ThreadCycle {
            self.state.thread.taper_mm = 0.0;
            if ENDS.into_iter().any(|letters| axes & letters == 0) {
                self.state.motion = Motion::Unclear;
                self.used |= axes | letter_bit(b'R') | letter_bit(b'Q') | letter_bit(b'F') | letter_bit(b'E');
                return self.cycle_word_missing("the threading cycle needs X (or U) and Z (or W) in its first block");
            }
        }
        self.state.motion = Motion::ThreadCycle;
        self.state.spline_exit = None;
        self.note_chamfer();
        self.thread_cycle(axes);
    }

    /// A pass of `G92`.
    pub(super) fn thread_cycle(&mut self, axes: u32) {
        let lead_mm = self.lead();
        let start_angle_deg = self.start_angle(AngleOf::Cycle);
        // Older controls, and Haas, write I.
        let is_older = self.block.word(b'I').is_some() && self.block.word(b'R').is_none();
        let taper = self.optional_length(if is_older { b'I' } else { b'R' }, "taper", TAPERS_MM);
        let only_x_and_z = self.are_thread_axes(axes);
        let turns = self.spindle_cuts_threads();
        let end = self.target(axes, Frame::Work);
        for (place, axis) in [Axis::X, Axis::Z].into_iter().enumerate() {
            if axes & ENDS[place] != 0 {
                self.state.thread.end[place] = end[axis.index()];
            }
        }
        if let Some(Some(taper_mm)) = taper {
            self.state.thread.taper_mm = taper_mm;
        }
        let (Some(lead_mm), Some(start_angle_deg), Some(_)) = (lead_mm, start_angle_deg, taper) else {
            return;
        };
        if !only_x_and_z || !turns {
            return;
        }
        let cycle = VCycle {
            root: self.state.thread.end,
            taper_mm: self.state.thread.taper_mm,
            height_mm: 0.0,
            alternating: false,
            lead_mm,
            start_angle_deg,
            included_angle_deg: 0.0,
            chamfer_tenths: self.thread_modes().chamfer_tenths,
        };
        // One pass, as deep as X says.
        self.v_cycle(&cycle, &[Pass { depth_mm: 0.0, finishing: false }]);
    }

    /// A block with a lathe's `G76`.
    pub(in super::super) fn thread_cycles(&mut self) {
        self.state.spline_exit = None;
        let letters = self.block.letters & !self.used;
        if self.block.unclear {
            return;
        }
        if let Some((_, span)) = self.code(Group::NonModal) {
            self.used |= letters;
            return self.findings.push_with(code::GROUP_CONFLICT, |code| {
                Finding::new(code, span, "a threading cycle needs a block of its own")
                    .suggest("write them in two blocks")
            });
        }
        // LinuxCNC knows its own form only.
        if self.is_groove_of_system_c(letters) {
            return;
        }
        match Form::of(letters).filter(|form| self.table.dialect.f_is_lead || *form == Form::DriveLine) {
            Some(Form::Modes) => self.cycle_modes(),
            Some(Form::TwoLines) => self.two_line_cycle(),
            Some(Form::OneLine) => self.one_line_cycle(),
            Some(Form::DriveLine) => self.drive_line_cycle(),
            None => {
                self.used |= letters;
                let span = self.block.span();
                let has_all_forms = self.table.dialect.f_is_lead;
                self.findings.push_with(code::THREAD_CYCLE_FORM, |code| {
                    let message = "the words of this threading cycle belong to none or several of its forms";
                    let finding = Finding::new(code, span, message);
                    if !has_all_forms {
                        return finding.suggest("write it as G76 P Z I J K, with R Q H E L as needed");
                    }
                    finding
                        .suggest("in two lines: G76 P(passes)(chamfer)(angle) Q R, then G76 X Z R P Q F")
                        .suggest("in one line: G76 X Z I K D F A P")
                        .suggest("as in LinuxCNC: G76 P Z I J K, with R Q H E L as needed")
                });
            }
        }
    }

    /// Whether a `G76` may be the grooving cycle along Z of G-code system C, where neither the profile nor the program says which it
    /// is; it is then reported.
    fn is_groove_of_system_c(&mut self, letters: u32) -> bool {
        if self.settings.dialect != DialectName::Lathe || self.settings.g_code_system.is_some() {
            return false;
        }
        let has = |text: &[u8]| text.iter().any(|&letter| letters & letter_bit(letter) != 0);
        // In C the first line has R alone, and one line no kind of infeed and no angle. A second line follows its first.
        let is_certain = match Form::of(letters) {
            Some(Form::Modes) => has(b"PQ") || !has(b"R"),
            Some(Form::OneLine) => has(b"APQ"),
            Some(Form::TwoLines | Form::DriveLine) | None => true,
        };
        self.state.not_system_c |= has(b"PQA") && is_certain && Form::of(letters) != Some(Form::TwoLines);
        if is_certain || self.state.not_system_c || self.is_system_a() {
            return false;
        }
        self.used |= letters;
        let Some((_, span)) = self.code(Group::Motion) else { return true };
        self.findings.push_with(code::CODE_AMBIGUOUS, |code| {
            let message =
                "with these words the code is a thread in G-code systems A and B, and the grooving cycle along Z in C";
            Finding::new(code, span, message)
                .suggest("for a thread in one line, write its kind of infeed as well, such as P1")
                .suggest(SYSTEM_CURE)
        });
        true
    }

    /// `G76 P(m)(r)(a) Q R`
    fn cycle_modes(&mut self) {
        let modes = self.read_cycle_modes();
        self.state.thread.cycle_refused = modes.is_none();
        self.state.thread.cycle = modes.or(self.state.thread.cycle);
    }

    /// Its words on top of those before; `None` after a finding.
    fn read_cycle_modes(&mut self) -> Option<CycleModes> {
        let before = self.state.thread.cycle;
        let mut modes = before.unwrap_or_default();
        let [word, least, allowance] = [b'P', b'Q', b'R'].map(|letter| self.take(letter));
        if word.is_none() && before.is_none() {
            self.cycle_word_missing("the first line of the threading cycle needs P: passes, chamfer, angle");
            return None;
        }
        if let Some(word) = word {
            let digits = self.whole(&word)?;
            let angle_deg = digits % 100;
            modes.finishing_passes = digits / 10_000;
            modes.chamfer_tenths = digits / 100 % 100;
            modes.included_angle_deg = f64::from(angle_deg);
            if !(1..=99).contains(&modes.finishing_passes) || !TOOL_ANGLES_DEG.contains(&angle_deg) {
                self.cycle_value(&word, |mut finding| {
                    finding.message = format!(
                        "P{digits:06} says {} finishing passes and a tool angle of {angle_deg}°, \
                         but they must be 1 to 99 and 80, 60, 55, 30, 29 or 0",
                        modes.finishing_passes
                    );
                    finding
                        .with_value("finishing_passes", f64::from(modes.finishing_passes), "")
                        .with_value("tool_angle", f64::from(angle_deg), "deg")
                        .suggest("write passes, chamfer in tenths of a lead and angle with two digits each: P021060")
                });
                return None;
            }
        }
        if let Some(word) = least {
            modes.least_infeed_mm = self.checked(&word, self.thousandths(&word), "least_infeed", AMOUNTS_MM)?;
        }
        if let Some(word) = allowance {
            modes.allowance_mm = self.checked(&word, self.scaled(&word, true), "finishing_allowance", AMOUNTS_MM)?;
        }
        Some(modes)
    }

    /// `G76 X Z R P Q F`
    fn two_line_cycle(&mut self) {
        let root = self.cycle_end();
        let taper = self.optional_length(b'R', "taper", TAPERS_MM);
        let height = self.depth(b'P', "thread_height", Self::thousandths);
        let first = self.depth(b'Q', "first_depth", Self::thousandths);
        let lead_mm = self.lead();
        let turns = self.spindle_cuts_threads();
        let modes = self.state.thread.cycle;
        if modes.is_none() && !self.state.thread.cycle_refused {
            self.cycle_word_missing(
                "the first line of the threading cycle is missing: G76 P(passes)(chamfer)(angle) Q R",
            );
        }
        if let (Some(root), Some(taper), Some(height), Some(first), Some(lead_mm), Some(modes)) =
            (root, taper, height, first, lead_mm, modes)
            && turns
        {
            let cycle = VCycle {
                root,
                taper_mm: taper.unwrap_or(0.0),
                height_mm: height,
                alternating: false,
                lead_mm,
                start_angle_deg: 0.0,
                included_angle_deg: modes.included_angle_deg,
                chamfer_tenths: modes.chamfer_tenths,
            };
            self.multiple_cycle(&cycle, first, 2.0, &modes);
        }
    }

    /// `G76 X Z I K D F A P Q`
    fn one_line_cycle(&mut self) {
        let root = self.cycle_end();
        let taper = self.optional_length(b'I', "taper", TAPERS_MM);
        let height = self.depth(b'K', "thread_height", |execution, word| execution.scaled(word, true));
        let first = self.depth(b'D', "first_depth", Self::thousandths);
        let start_angle_deg = self.start_angle(AngleOf::Cycle);
        let angle_deg = match self.take(b'A') {
            Some(word) => self.checked(&word, word.number.value(), "tool_angle", 0.0..=120.0),
            None => Some(0.0),
        };
        let pattern = self.cycle_count(b'P', "infeed_pattern", 1, 1.0..=4.0);
        let lead_mm = self.lead();
        let turns = self.spindle_cuts_threads();
        if let (Some(root), Some(taper), Some(height), Some(first), Some(start_angle_deg)) =
            (root, taper, height, first, start_angle_deg)
            && let (Some(angle_deg), Some(pattern), Some(lead_mm)) = (angle_deg, pattern, lead_mm)
            && turns
        {
            self.note_chamfer();
            let modes = self.thread_modes();
            let cycle = VCycle {
                root,
                taper_mm: taper.unwrap_or(0.0),
                height_mm: height,
                alternating: pattern % 2 == 0,
                lead_mm,
                start_angle_deg,
                included_angle_deg: angle_deg,
                chamfer_tenths: modes.chamfer_tenths,
            };
            self.multiple_cycle(&cycle, first, if pattern < 3 { 2.0 } else { 1.0 }, &modes);
        }
    }

    /// The modal words of threading cycles; where none was written, the chamfer of the profile.
    fn thread_modes(&self) -> CycleModes {
        let chamfer_tenths = self.settings.turning.thread_chamfer_tenths.unwrap_or(0);
        self.state.thread.cycle.unwrap_or(CycleModes { chamfer_tenths, ..CycleModes::default() })
    }

    /// Says that there is no chamfer at the end of a thread, where nothing states one.
    fn note_chamfer(&mut self) {
        if self.settings.turning.thread_chamfer_tenths.is_some() || self.state.thread.cycle.is_some() {
            return;
        }
        let span = self.block.span();
        self.findings.push_with(code::THREAD_CHAMFER, |code| {
            let message = "neither the program nor language.turning.thread_chamfer_tenths of the machine profile states the chamfer \
                           at the end of the thread: it has none";
            Finding::new(code, span, message).suggest("set thread_chamfer_tenths as the control has it, 0 for none")
        });
    }

    /// Says on which side the passes of a flank infeed start.
    fn note_flank(&mut self, shift_mm: f64) {
        let span = self.block.span();
        self.findings.push_with(code::THREAD_FLANK, |code| {
            let message = format!(
                "with the infeed along the flank the passes start up to {shift_mm:.4} mm before the start of the cycle; some controls \
                 start them behind it"
            );
            Finding::new(code, span, message)
                .with_value("shift", shift_mm, "mm")
                .suggest("start the cycle at least that far from the work")
        });
    }

    /// X and Z of the root at the end of a `G76`.
    fn cycle_end(&mut self) -> Option<[f64; 2]> {
        let axes = self.block.letters & !self.used & (ENDS[0] | ENDS[1]);
        let end = self.target(axes, Frame::Work);
        if ENDS.into_iter().any(|letters| axes & letters == 0) {
            self.cycle_word_missing("the threading cycle needs X (or U) and Z (or W)");
            return None;
        }
        Some([Axis::X, Axis::Z].map(|axis| end[axis.index()]))
    }

    /// A `G76` of FANUC: roughing by the depth law, then the finishing passes.
    fn multiple_cycle(&mut self, cycle: &VCycle, first_mm: f64, degression: f64, modes: &CycleModes) {
        if modes.allowance_mm < cycle.height_mm {
            let infeed = Infeed {
                first_mm,
                degression,
                least_mm: modes.least_infeed_mm,
                rough_mm: cycle.height_mm - modes.allowance_mm,
                full_mm: cycle.height_mm,
                finishing_passes: modes.finishing_passes,
            };
            if let Some(passes) = self.cycle_passes(&infeed) {
                self.v_cycle(cycle, &passes);
            }
            return;
        }
        let span = self.block.span();
        let unit_mm = if self.state.inch { MM_PER_INCH } else { 1.0 };
        // A tenth of the height, as the program writes it.
        let smaller = (0.1 * cycle.height_mm / unit_mm * 10_000.0).ceil() / 10_000.0;
        self.findings.push_with(code::THREAD_CYCLE_VALUE, |code| {
            let (allowance, height) = (modes.allowance_mm, cycle.height_mm);
            let message =
                format!("the finishing allowance of {allowance} mm is all of the thread's height of {height} mm");
            Finding::new(code, span, message)
                .with_value("finishing_allowance", allowance, "mm")
                .with_value("thread_height", height, "mm")
                .suggest(format!("write a smaller R in the first line of the cycle, such as R{smaller:?}"))
        });
    }

    /// The passes of a cycle in a V.
    fn v_cycle(&mut self, cycle: &VCycle, passes: &[Pass]) {
        let start = self.state.position;
        let [x, z] = [Axis::X, Axis::Z].map(|axis| start[axis.index()]);
        let [root_x, end_z] = cycle.root;
        let length = (end_z - z).abs();
        if length == 0.0 {
            return self.thread_travel("the thread ends at the Z where it starts");
        }
        let forwards = (end_z - z).signum();
        let outwards = if x < root_x { -1.0 } else { 1.0 };
        // The return path runs along X = x, and may not touch the crest at either end.
        let slope = libm::tan((cycle.included_angle_deg * 0.5).to_radians());
        let largest_shift = cycle.height_mm * slope;
        let taper_towards = (outwards * cycle.taper_mm).max(0.0) * (1.0 + largest_shift / length);
        let needed = cycle.height_mm + taper_towards;
        let clear = outwards * (x - root_x);
        if x == root_x || clear < needed - ON_THE_CREST_MM {
            return self.starts_within(clear, needed);
        }
        let chamfer_mm = f64::from(cycle.chamfer_tenths) * 0.1 * cycle.lead_mm;
        if largest_shift + chamfer_mm >= length {
            return self
                .thread_travel("the thread is shorter than the infeed along its flank and the chamfer at its end");
        }
        if chamfer_mm > 0.0 && cycle.taper_mm.abs() > length {
            return self.thread_travel("a thread steeper than 45° has no chamfer: set it to 00 in the P of G76");
        }
        if self.vibrates_into_work(cycle, outwards * (end_z - z), passes) {
            return;
        }
        if largest_shift > 0.0 && !cycle.alternating {
            let first_mm = passes.first().map_or(0.0, |pass| pass.depth_mm);
            self.note_flank(slope * (cycle.height_mm - first_mm));
        }
        for (index, &Pass { depth_mm, finishing }) in passes.iter().enumerate() {
            let other_flank = cycle.alternating && index % 2 == 1;
            let lack_mm = cycle.height_mm - depth_mm;
            // Ahead of the start of the cycle where it is positive.
            let shift = slope * if other_flank { lack_mm } else { -lack_mm };
            let end_x = root_x + outwards * (cycle.height_mm - depth_mm);
            let start_x = end_x + cycle.taper_mm * (1.0 - shift / length);
            self.rapid_to(start_x, z + forwards * shift);
            // At 45°, and no further than the return path.
            let retreat_mm = outwards * chamfer_mm.min((x - end_x).abs());
            self.cut_thread(
                self.moved(end_x, end_z),
                Cut {
                    lead_mm: cycle.lead_mm,
                    start_angle_deg: cycle.start_angle_deg,
                    amplitude_mm: finishing.then_some(0.0),
                    pull_out: (chamfer_mm > 0.0).then_some(PullOut { travel_mm: chamfer_mm, retreat_mm }),
                    included_angle_deg: (cycle.included_angle_deg > 0.0).then_some(cycle.included_angle_deg),
                    ..Cut::default()
                },
            );
            self.rapid_to(x, end_z);
            self.rapid_to(x, z);
        }
        self.state.position = start;
    }

    /// Refuses the vibration of a cycle whose lead is along X, where the work is on the side of larger Z: there it would
    /// retreat into the work. `outwards_mm` is the travel along Z, negative where X grows into the work.
    fn vibrates_into_work(&mut self, cycle: &VCycle, outwards_mm: f64, passes: &[Pass]) -> bool {
        let vibrates = self.state.functions_on.contains(Function::ThreadVibration)
            && passes.iter().any(|pass| !pass.finishing)
            && cycle.taper_mm.abs() >= outwards_mm.abs();
        if !vibrates || cycle.taper_mm * outwards_mm > 0.0 {
            return false;
        }
        let span = self.block.span();
        self.findings.push_with(code::THREAD_CYCLE_SIDE, |code| {
            let message = format!(
                "the taper of {} mm over {} mm leads along X, and the work is on the side of larger Z, to which the vibration retreats",
                cycle.taper_mm,
                outwards_mm.abs()
            );
            Finding::new(code, span, message)
                .with_value("taper", cycle.taper_mm, "mm")
                .with_value("length", outwards_mm.abs(), "mm")
                .suggest("switch the vibration of threads off for this cycle")
        });
        true
    }

    /// The passes of a cycle; `None` after a finding.
    pub(super) fn cycle_passes(&mut self, infeed: &Infeed) -> Option<Vec<Pass>> {
        let passes = infeed.passes();
        if passes.is_none() {
            let span = self.block.span();
            self.findings.push_with(code::THREAD_CYCLE_PASSES, |code| {
                let first_mm = infeed.first_mm;
                let better_mm = infeed.sufficient_first_mm();
                let message = format!(
                    "with a first depth of {first_mm} mm the cycle has more than {MAX_PASSES} passes to {} mm",
                    infeed.full_mm
                );
                Finding::new(code, span, message)
                    .with_value("first_depth", first_mm, "mm")
                    .with_value("thread_height", infeed.full_mm, "mm")
                    .with_value("max_passes", f64::from(MAX_PASSES), "")
                    .suggest_value(
                        format!("use a first depth of at least {better_mm} mm on the radius"),
                        None,
                        "first_depth",
                        better_mm,
                        "mm",
                    )
            });
        }
        passes
    }

    fn starts_within(&mut self, clear_mm: f64, needed_mm: f64) {
        let span = self.block.span();
        self.findings.push_with(code::THREAD_CYCLE_START, |code| {
            let message = format!(
                "the cycle starts {clear_mm:.4} mm from the thread's root on the radius, within the crest at {needed_mm:.4} mm: \
                 its rapids would cut the work"
            );
            Finding::new(code, span, message)
                .with_value("distance", clear_mm, "mm")
                .with_value("needed", needed_mm, "mm")
                .suggest("move X clear of the work before the cycle")
        });
    }
}
