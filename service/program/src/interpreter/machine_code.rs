//! M codes that the machine carries out itself: their words, what they do to the modes, and their operations.

use super::execute::Execution;
use super::saved;
use crate::block::MachineWord;
use crate::code;
use crate::dialect::{Group, Letter, MachineAction, MachineStep, letter_bit};
use crate::state::ModeContext;
use crate::{Finding, FunctionWord, MachineCommand, OperationKind, SourceSpan, SpindleDirection, UnlistedMachineCodes};

/// Most unlisted M codes that are noted, each once; a program with more has said enough.
const MOST_NOTED: usize = 256;

/// An M code of the machine with its words, on its way to its place in the order of the block.
pub(super) struct Pending {
    word: MachineWord,
    words: Vec<FunctionWord>,
}

impl Pending {
    fn value(&self, letter: char) -> Option<f64> {
        self.words.iter().find(|word| word.letter == letter).map(|word| word.value)
    }
}

impl Execution<'_> {
    /// The M codes of the machine in this block with their words, which are used by this.
    #[cold]
    pub(super) fn machine_codes(&mut self) -> Vec<Pending> {
        let block = self.block;
        let mut pending = Vec::with_capacity(block.machine_codes().len());
        for word in block.machine_codes() {
            let mut words = Vec::new();
            let letters = if word.is_unlisted { self.letters_of_unlisted() } else { word.rule.words };
            for letter in (b'A'..=b'Z').filter(|letter| letters & letter_bit(*letter) != 0) {
                if let Some(word) = self.take(letter) {
                    let span = block.word_span(&word);
                    words.push(FunctionWord { letter: char::from(letter), value: word.number.value(), span });
                }
            }
            if word.is_unlisted {
                self.note_unlisted(word, &words);
                self.check_speed_beside(word);
            }
            let code = Pending { word: *word, words };
            if self.table.dialect.m_codes_closed {
                self.check_words(&code);
            }
            pending.push(code);
        }
        pending
    }

    /// Carries out those of one step.
    #[inline(always)]
    pub(super) fn machine_step(&mut self, pending: &mut [Pending], step: MachineStep) {
        // Almost no block has any.
        if !pending.is_empty() {
            self.carry_out(pending, step);
        }
    }

    fn carry_out(&mut self, pending: &mut [Pending], step: MachineStep) {
        for code in pending.iter_mut().filter(|code| code.word.rule.step == step) {
            let MachineWord { rule, span, .. } = code.word;
            match rule.action {
                MachineAction::Pass => self.state.machine.overrides.switch(rule.number, code.value('P')),
                MachineAction::Orient => self.stop_spindle(span),
                MachineAction::RigidTapping => self.state.machine.rigid_tapping = true,
                MachineAction::SetTool => {
                    let number = code.value('Q').unwrap_or(0.0) as u32;
                    self.state.tool = number;
                    self.emit(span, OperationKind::Tool { number, offset: 0 });
                    continue;
                }
                MachineAction::SaveModes { for_return } => {
                    let saved = Some(Box::new(saved::SavedModes::of(self.state)));
                    let context = &mut self.state.machine.context;
                    context.saved = saved;
                    context.restores_at_return |= for_return;
                    continue;
                }
                MachineAction::ForgetModes => {
                    self.state.machine.context = ModeContext::default();
                    continue;
                }
                MachineAction::RestoreModes => {
                    self.restore_modes(span);
                    continue;
                }
            }
            let words = std::mem::take(&mut code.words);
            let command = MachineCommand { number: rule.number, effect: rule.effect, words };
            self.emit(span, OperationKind::MachineCode(command));
        }
    }

    /// Keeps the M codes of a block with a lathe's drilling cycle for its holes: they clamp the C axis, which first has to turn there.
    #[cold]
    pub(super) fn keep_clamps(&mut self, pending: &mut Vec<Pending>) {
        let is_clamp = |code: &mut Pending| {
            code.word.rule.step == MachineStep::Before && code.word.rule.action == MachineAction::Pass
        };
        for code in pending.extract_if(.., is_clamp) {
            let MachineWord { rule, span, .. } = code.word;
            self.state.machine.overrides.switch(rule.number, code.value('P'));
            let command = MachineCommand { number: rule.number, effect: rule.effect, words: code.words };
            self.clamps.push((span, command));
        }
    }

    /// Hands them on.
    pub(super) fn clamp(&mut self, clamps: &[(SourceSpan, MachineCommand)]) {
        for (span, command) in clamps {
            self.emit(*span, OperationKind::MachineCode(command.clone()));
        }
    }

    /// `M6`. In LinuxCNC it stops the spindle, and the tool stays selected; without any, the spindle is left empty.
    pub(super) fn change_tool(&mut self, span: SourceSpan) {
        let keeps = self.table.dialect.tool_stays_selected;
        if keeps {
            self.stop_spindle(span);
        }
        let selected = if keeps { self.state.next_tool } else { self.state.next_tool.take() };
        if selected.is_none() {
            let code = if keeps { code::TOOL_NONE } else { code::TOOL_MISSING };
            self.findings.push_with(code, |code| {
                Finding::new(code, span, "a tool change, but no T word says to which tool")
                    .suggest("write the tool number in this block or before it")
            });
        }
        if let Some(number) = selected.or(keeps.then_some(0)) {
            self.state.tool = number;
            let length = &self.state.length;
            self.state.machine.keeps_length = length.is_on && ![0, number].contains(&length.number) && number != 0;
            self.emit(span, OperationKind::Tool { number, offset: 0 });
        }
    }

    fn stop_spindle(&mut self, span: SourceSpan) {
        let before = self.state.spindle();
        self.state.spindle_direction = SpindleDirection::Stopped;
        self.emit_spindle(before, span);
    }

    /// `M72`: LinuxCNC refuses it without saved modes.
    fn restore_modes(&mut self, span: SourceSpan) {
        match self.state.machine.context.saved.clone() {
            Some(saved) => self.restore_codes(&saved, span),
            None => self.findings.push_with(code::MODES_NOT_SAVED, |code| {
                Finding::new(code, span, "no modes are saved that could be restored")
                    .suggest("save them before with M70 or M73")
            }),
        }
    }

    /// The letters of the words that an unlisted M code takes: those that nothing else in its block could.
    fn letters_of_unlisted(&self) -> u32 {
        if !self.block.has_only_machine_codes() {
            return 0;
        }
        let places = (0..26).filter(|place| self.table.dialect.letters[*place] == Letter::Parameter);
        places.fold(0, |mask, place| mask | 1 << place)
    }

    /// Says once that nobody has said what an M code does, or refuses it as the profile says.
    fn note_unlisted(&mut self, word: &MachineWord, words: &[FunctionWord]) {
        let number = word.rule.number;
        let code = match self.settings.unlisted_machine_codes {
            UnlistedMachineCodes::Error => code::MACHINE_CODE_REFUSED,
            UnlistedMachineCodes::Note => {
                let noted = &mut self.state.machine.noted;
                if noted.contains(&number) || noted.len() >= MOST_NOTED {
                    return;
                }
                noted.push(number);
                code::MACHINE_CODE_UNLISTED
            }
        };
        self.findings.push_with(code, |code| {
            let message = format!("M{number} is neither a code of this dialect nor listed by the profile");
            Finding::new(code, word.span, message)
                .with_value("m_code", f64::from(number), "")
                .suggest(match words {
                    [] => format!("list M{number} in machine_codes of the profile's language, with its effect"),
                    words => {
                        let letters: String = words.iter().map(|word| word.letter).collect();
                        format!("list M{number} in machine_codes of the profile's language, with its effect and its words {letters}")
                    }
                })
        });
    }

    /// Warns of an `S` in the block of an unlisted M code and of nothing else that takes it: it may be the speed of another spindle or
    /// of a live tool. `M40` to `M45` are the gears of the main spindle.
    fn check_speed_beside(&mut self, word: &MachineWord) {
        let number = word.rule.number;
        let is_of_main = [Group::Spindle, Group::SpeedMode].into_iter().any(|group| self.block.code(group).is_some())
            || matches!(number, 40..=45);
        let Some(speed) = self.block.word(b'S').copied().filter(|_| !is_of_main) else { return };
        let (span, value) = (self.block.word_span(&speed), speed.number.value());
        self.findings.push_with(code::MACHINE_CODE_SPEED, |code| {
            let message = format!("S{value} beside M{number}, which nobody has listed, is read as the speed of the main spindle");
            Finding::new(code, span, message)
                .with_value("speed", value, "")
                .with_value("m_code", f64::from(number), "")
                .suggest(format!(
                    "where M{number} takes it, list M{number} with its word S in machine_codes of the profile's language; where it \
                     starts the main spindle, list it in code_replacements, such as M3 M8 for M13"
                ))
                .suggest("where it is the speed of the main spindle, write S in a block of its own")
        });
    }

    /// The words of LinuxCNC's own codes, as its interpreter checks them.
    fn check_words(&mut self, code: &Pending) {
        let value = |letter| code.value(letter);
        let is_whole = |value: f64| value >= 0.0 && f64::from(value as u32) == value;
        let missing = |letter: char| value(letter).is_none();
        let message = match code.word.rule.number {
            19 if value('R').is_some_and(|angle| !(0.0..=360.0).contains(&angle)) => "the angle R must be 0 to 360",
            19 if value('P').is_some_and(|direction| ![0.0, 1.0, 2.0].contains(&direction)) => {
                "the direction P must be 0, 1 or 2"
            }
            19 if value('Q').is_some_and(|time| time <= 0.0) => "the time Q must be positive",
            61 if !value('Q').is_some_and(is_whole) => "it needs the number of the tool, Q",
            62..=65 if !value('P').is_some_and(is_whole) => "it needs the number of the output, P",
            66 if missing('P') == missing('E') => {
                "it needs the number of one input, P for a digital or E for an analogue one"
            }
            66 if !value('P').or(value('E')).is_some_and(is_whole) => "the number of the input must be whole",
            66 if value('L').is_some_and(|mode| !is_whole(mode) || mode > 4.0) => {
                "the kind of waiting, L, must be 0 to 4"
            }
            66 if !missing('E') && value('L').is_some_and(|mode| mode != 0.0) => {
                "an analogue input is read at once: L must be 0"
            }
            66 if value('L').is_some_and(|mode| mode != 0.0) && value('Q').is_none_or(|time| time <= 0.0) => {
                "waiting needs a time, Q"
            }
            67 | 68 if !value('E').is_some_and(is_whole) => "it needs the number of the output, E",
            67 | 68 if missing('Q') => "it needs the value of the output, Q",
            _ => return self.note_input(code),
        };
        let (number, span) = (code.word.rule.number, code.word.span);
        self.findings.push_with(code::MACHINE_WORD, |code| Finding::new(code, span, format!("M{number}: {message}")));
    }

    /// The result of an input is what the profile says, as only the machine knows it.
    fn note_input(&mut self, code: &Pending) {
        if code.word.rule.number != 66 {
            return;
        }
        let result = self.settings.input_result;
        self.findings.push_with(code::INPUT_UNKNOWN, |found| {
            Finding::new(found, code.word.span, format!("what the input says is not known: #5399 is {result}"))
                .with_value("result", result, "")
                .suggest("say in input_result of the profile's language which result the program is judged with")
        });
    }
}
