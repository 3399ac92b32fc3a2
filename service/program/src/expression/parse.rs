//! The reader: recursive descent over the bytes of a line, evaluating as it goes.

use std::borrow::Cow;

use super::function::{self, Function};
use super::name::Name;
use super::operator::{Impossible, Operation, Operator, operator_at};
use super::rules::Rules;
use super::{Context, Defect, Note, NoteKind, Reading, Target, Value};
use crate::lookalike;
use crate::number::{self, Scan};
use crate::parameters::profile_row;
use crate::{AngleRange, code};

/// A value within an expression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Operand {
    Vacant,
    Number(f64),
    /// What a comparison gives where truth values are no numbers.
    Truth(bool),
}

impl Operand {
    /// The number for arithmetic, 0 for a vacant value; `None` for a truth value.
    pub(super) const fn or_zero(self) -> Option<f64> {
        match self {
            Self::Vacant => Some(0.0),
            Self::Number(value) => Some(value),
            Self::Truth(_) => None,
        }
    }
}

type Result<T> = core::result::Result<T, Box<Defect>>;

/// A parameter's number may differ by this much from a whole one.
pub(crate) const WHOLE_TOLERANCE: f64 = 0.0001;

/// Largest number of a parameter; far beyond any control's.
const LARGEST_NUMBER: f64 = 999_999.0;

/// The whole number from 0 on that is meant by a value.
pub(crate) fn whole_near(value: f64, largest: f64) -> Option<u32> {
    let whole = libm::round(value);
    ((value - whole).abs() < WHOLE_TOLERANCE && (0.0..=largest).contains(&whole)).then_some(whole as u32)
}

/// Reads one value or expression.
pub(super) struct Parser<'l, 'c, 'v> {
    line: &'l [u8],
    at: usize,
    /// Brackets, functions and parameters that are open.
    depth: u32,
    context: &'c mut Context<'v>,
}

impl<'l, 'c, 'v> Parser<'l, 'c, 'v> {
    pub(super) const fn new(line: &'l [u8], at: usize, context: &'c mut Context<'v>) -> Self {
        Self { line, at, depth: 0, context }
    }

    /// Where what it has read ends, without the blanks behind it.
    pub(super) fn at(&self) -> usize {
        let read = &self.line[..self.at];
        self.at - read.iter().rev().take_while(|byte| matches!(byte, b' ' | b'\t')).count()
    }

    pub(super) const fn rules(&self) -> &'static Rules {
        self.context.rules
    }

    /// The next byte that is no blank.
    #[inline]
    fn peek(&mut self) -> Option<u8> {
        loop {
            match self.line.get(self.at) {
                Some(b' ' | b'\t') => self.at += 1,
                byte => return byte.copied(),
            }
        }
    }

    /// Whether this byte comes next; it is then read.
    #[inline]
    pub(super) fn takes(&mut self, byte: u8) -> bool {
        let is_next = self.peek() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    /// A character that only looks like one of a program where the expression cannot be read on.
    fn lookalike(&self, at: usize) -> Option<Box<Defect>> {
        let found = lookalike::find(self.line).into_iter().find(|found| (found.start..found.end).contains(&at))?;
        Some(Defect::new(code::LOOKALIKE, found.start, found.end, found.message(self.line)).cure(found.cure()))
    }

    #[cold]
    fn malformed(&self, message: &str) -> Box<Defect> {
        let end = (self.at + 1).min(self.line.len());
        let start = self.at.min(end.saturating_sub(1));
        if let Some(defect) = self.lookalike(start) {
            return defect;
        }
        Defect::new(code::EXPRESSION_MALFORMED, start, end, message)
            .cure("check the brackets, and that there is an operator between two values")
    }

    fn expect(&mut self, byte: u8, message: &str) -> Result<()> {
        if self.takes(byte) { Ok(()) } else { Err(self.malformed(message)) }
    }

    /// Goes one level down.
    fn enter(&mut self, start: usize) -> Result<()> {
        self.depth += 1;
        let limit = self.rules().max_depth;
        if self.depth <= limit {
            return Ok(());
        }
        let message = format!("the expression is more than {limit} levels deep");
        Err(Defect::new(code::EXPRESSION_DEPTH, start, self.at, message)
            .value("max_depth", f64::from(limit))
            .cure("compute a part of it before, in a parameter of its own"))
    }

    /// The number or vacant value that an operand is.
    pub(super) fn number(&self, operand: Operand, start: usize) -> Result<Value> {
        match self.numbered(operand) {
            Operand::Vacant => Ok(None),
            Operand::Number(value) => Ok(Some(value)),
            Operand::Truth(_) => Err(truth(start, self.at)),
        }
    }

    /// A truth value as the number that it is, where it is one.
    fn numbered(&self, operand: Operand) -> Operand {
        match operand {
            Operand::Truth(holds) if self.rules().truths_are_numbers => Operand::Number(f64::from(u8::from(holds))),
            operand => operand,
        }
    }

    /// The number of an operand, 0 where it is vacant.
    fn arithmetic(&self, operand: Operand, start: usize) -> Result<f64> {
        operand.or_zero().ok_or_else(|| truth(start, self.at))
    }

    /// Values joined by operators.
    #[inline]
    pub(super) fn expression(&mut self) -> Result<Operand> {
        self.operations(0)
    }

    /// Values joined by operators of this level of precedence and tighter ones.
    fn operations(&mut self, least: u8) -> Result<Operand> {
        self.peek();
        let start = self.at;
        let mut left = self.operand()?;
        while let Some(operator) = self.operator() {
            if operator.level < least {
                break;
            }
            self.at += operator.text.len();
            let right = self.operations(operator.level + 1)?;
            left = self.operate(operator, left, right, start)?;
        }
        Ok(left)
    }

    /// The operator that comes next; it is not read yet.
    #[inline]
    fn operator(&mut self) -> Option<&'static Operator> {
        match self.peek() {
            None | Some(b']' | b',' | b'(' | b';' | b'#') => None,
            Some(_) => operator_at(self.rules().operators, &self.line[self.at..]),
        }
    }

    #[inline]
    fn operate(&mut self, operator: &Operator, left: Operand, right: Operand, start: usize) -> Result<Operand> {
        let end = self.at();
        // Whether a value is vacant is exact.
        if self.rules().has_truth_values
            && matches!(operator.operation, Operation::Equal | Operation::NotEqual)
            && ![left, right].contains(&Operand::Vacant)
            && [left, right].iter().any(|side| side.or_zero().is_some_and(|value| libm::trunc(value) != value))
        {
            self.context.notes.push(Note { kind: NoteKind::Equality, start, end });
        }
        // Of these it is plain what is meant, whatever the precedence of a control.
        let (left, right) = match operator.operation.is_arithmetic() {
            true => (self.numbered(left), self.numbered(right)),
            false => (left, right),
        };
        match (self.rules().apply)(operator.operation, left, right) {
            Ok(Operand::Number(value)) if !value.is_finite() => Err(overflow(start, end)),
            Ok(result) => Ok(result),
            Err(reason) => Err(impossible(reason, operator, left, right, start, end)),
        }
    }

    /// One value, with its signs.
    #[inline]
    pub(super) fn operand(&mut self) -> Result<Operand> {
        let mut negative = false;
        let mut signs = 0;
        while let Some(sign @ (b'-' | b'+')) = self.peek() {
            negative ^= sign == b'-';
            signs += 1;
            self.at += 1;
        }
        // One sign belongs to the value everywhere; more are read by LinuxCNC alone.
        if signs > 1 && self.rules().has_truth_values {
            return Err(self.malformed("there are two signs"));
        }
        let start = self.at;
        let operand = match self.peek() {
            Some(b'#') => self.parameter()?,
            Some(b'[') => self.bracketed()?,
            Some(b'0'..=b'9' | b'.') => self.literal()?,
            Some(byte) if byte.is_ascii_alphabetic() => self.function()?,
            _ => return Err(self.malformed("a value is missing here")),
        };
        if signs == 0 {
            return Ok(operand);
        }
        match self.numbered(operand) {
            Operand::Number(value) => Ok(Operand::Number(if negative { -value } else { value })),
            Operand::Vacant => Ok(Operand::Vacant),
            Operand::Truth(_) => Err(truth(start, self.at)),
        }
    }

    #[inline]
    fn literal(&mut self) -> Result<Operand> {
        let Scan { end, number, defect } = number::scan_operand(self.line, self.at);
        let start = core::mem::replace(&mut self.at, end);
        if defect.is_some() {
            return Err(Defect::new(code::EXPRESSION_MALFORMED, start, end, "this number cannot be read")
                .cure("write digits and at most one decimal point"));
        }
        Ok(Operand::Number(number.value()))
    }

    /// An expression in brackets.
    pub(super) fn bracketed(&mut self) -> Result<Operand> {
        self.peek();
        let start = self.at;
        self.expect(b'[', "[ is missing here")?;
        self.enter(start)?;
        let operand = self.expression()?;
        self.expect(b']', "] or an operator is missing here")?;
        self.depth -= 1;
        Ok(operand)
    }

    /// `#` and what follows it.
    fn parameter(&mut self) -> Result<Operand> {
        let start = self.at;
        let target = self.target()?;
        let variables = self.context.variables;
        let reading = match &target {
            Target::Numbered(number) => variables.numbered(*number),
            Target::Named(name) => variables.named(name).and_then(|value| match value {
                Some(value) => Ok(Reading::from(Some(value))),
                None => Err(super::Refusal {
                    code: code::PARAMETER_UNSET,
                    message: format!("#<{}> is read, but nothing was assigned to it", name.as_str()),
                    cure: unset_cure(name),
                }),
            }),
        };
        match reading {
            Ok(Reading { value, is_probed }) => {
                if is_probed {
                    self.context.notes.push(Note { kind: NoteKind::Probe, start, end: self.at });
                }
                Ok(value.map_or(Operand::Vacant, Operand::Number))
            }
            Err(refusal) => Err(Defect::refused(refusal, start, self.at)),
        }
    }

    /// `#` with a number, a name or an expression: which parameter is meant.
    pub(super) fn target(&mut self) -> Result<Target> {
        self.peek();
        let start = self.at;
        self.expect(b'#', "# is missing here")?;
        let index_at = self.at;
        let index = match self.peek() {
            Some(b'<') => return self.name(start).map(Target::Named),
            Some(b'0'..=b'9' | b'.') => self.literal()?,
            Some(b'[') => self.bracketed()?,
            Some(_) if self.rules().chains_parameters => {
                self.enter(start)?;
                let operand = self.operand()?;
                self.depth -= 1;
                operand
            }
            Some(b'#') => {
                return Err(Defect::new(code::EXPRESSION_MALFORMED, start, self.at + 1, "## has no meaning here")
                    .cure("write brackets: #[#1]"));
            }
            _ => return Err(self.malformed("the number of a parameter is missing here")),
        };
        let Operand::Number(index) = self.numbered(index) else {
            let message = "the number of the parameter is vacant, or a condition";
            return Err(Defect::new(code::PARAMETER_NUMBER, start, self.at, message)
                .cure("assign the parameter that holds the number before"));
        };
        match whole_near(index, LARGEST_NUMBER) {
            Some(index) => Ok(Target::Numbered(index)),
            None => Err(Defect::new(code::PARAMETER_NUMBER, index_at, self.at, format!("#[{index}] is no parameter"))
                .value("number", index)
                .cure("the number of a parameter must be whole and within those of the control")),
        }
    }

    /// `<name>` behind a `#` at `start`.
    fn name(&mut self, start: usize) -> Result<Name> {
        let rest = &self.line[self.at + 1..];
        let Some(length) = rest.iter().position(|&byte| byte == b'>') else {
            return Err(self.malformed("the name is not closed: > is missing"));
        };
        self.at += length + 2;
        if !self.rules().has_names {
            let message = "parameters have no names in this dialect";
            return Err(Defect::new(code::EXPRESSION_MALFORMED, start, self.at, message)
                .cure("use a numbered variable, or the dialect linuxcnc"));
        }
        Name::read(&rest[..length]).ok_or_else(|| {
            let longest = super::name::LONGEST;
            let message = format!("a name has 1 to {longest} letters, digits and signs");
            Defect::new(code::PARAMETER_NAME, start, self.at, message).cure("choose a shorter name")
        })
    }

    /// A function with its arguments.
    fn function(&mut self) -> Result<Operand> {
        let start = self.at;
        while self.line.get(self.at).is_some_and(u8::is_ascii_alphabetic) {
            self.at += 1;
        }
        let text = &self.line[start..self.at];
        let Some(function) = function::function_named(self.rules().functions, text) else {
            let message = format!("{} is no function of this dialect", String::from_utf8_lossy(text));
            return Err(Defect::new(code::EXPRESSION_FUNCTION, start, self.at, message)
                .cure("check its spelling, and the dialect of the machine profile"));
        };
        match function {
            Function::Exists => return self.exists(),
            Function::AddPoint => {
                let message = "what ADP gives depends on how the argument was written in the calling block";
                return Err(Defect::new(code::EXPRESSION_DIFFERS, start, self.at, message)
                    .cure("write the argument with a decimal point, and leave ADP out"));
            }
            _ => {}
        }
        self.peek();
        let bracket = self.at;
        self.expect(b'[', "[ of the function is missing here")?;
        self.enter(start)?;
        let operand = self.expression()?;
        let argument = self.arithmetic(operand, bracket)?;
        let result = if function == Function::Power {
            self.expect(b',', "a comma and the exponent are missing here")?;
            let operand = self.expression()?;
            let exponent = self.arithmetic(operand, bracket)?;
            self.expect(b']', "] is missing here")?;
            self.power(argument, exponent, start)?
        } else if function == Function::ArcTangent && self.rules().has_truth_values && self.takes(b',') {
            let operand = self.expression()?;
            let x = self.arithmetic(operand, bracket)?;
            self.expect(b']', "] is missing here")?;
            self.arc_tangent(argument, x, start)?
        } else {
            self.expect(b']', "] or an operator is missing here")?;
            self.apply(function, argument, start)?
        };
        self.depth -= 1;
        if result.is_finite() { Ok(Operand::Number(result)) } else { Err(overflow(start, self.at)) }
    }

    fn power(&self, argument: f64, exponent: f64, start: usize) -> Result<f64> {
        let operator = Operator { text: b"POW", operation: Operation::Power, level: 0 };
        let (left, right) = (Operand::Number(argument), Operand::Number(exponent));
        match (self.rules().apply)(Operation::Power, left, right) {
            Ok(Operand::Number(value)) => Ok(value),
            Ok(_) => Err(truth(start, self.at)),
            Err(reason) => Err(impossible(reason, &operator, left, right, start, self.at)),
        }
    }

    /// A function of one argument, or the arc tangent with its second one.
    fn apply(&mut self, function: Function, argument: f64, start: usize) -> Result<f64> {
        if function == Function::ArcTangent && self.opens_second_argument() {
            let operand = self.bracketed()?;
            let x = self.arithmetic(operand, start)?;
            return self.arc_tangent(argument, x, start);
        }
        if function == Function::ArcTangent && !self.rules().has_truth_values {
            return Err(self.malformed("/ and the second argument of ATAN are missing here"));
        }
        function::apply(function, argument, self.angle_range(), self.context.increments).map_err(|must| {
            let message = format!("the argument of this function is {argument}, but {must}");
            Defect::new(code::EXPRESSION_ARITHMETIC, start, self.at, message)
                .value("argument", argument)
                .cure("check the values that it is computed from")
        })
    }

    /// `ATAN[y]/[x]`, on newer FANUC controls `ATAN[y,x]` as well.
    fn arc_tangent(&self, y: f64, x: f64, start: usize) -> Result<f64> {
        if x == 0.0 && y == 0.0 && self.rules().has_truth_values {
            let message = "ATAN[0]/[0] has no direction";
            return Err(Defect::new(code::EXPRESSION_ARITHMETIC, start, self.at, message)
                .cure("check the values before: one of them must not be 0"));
        }
        Ok(function::arc_tangent(y, x, self.angle_range()))
    }

    fn angle_range(&self) -> AngleRange {
        if self.rules().chooses_angle_range { self.context.angle_range } else { AngleRange::Signed }
    }

    /// Whether `/[` comes next; the `/` is then read.
    fn opens_second_argument(&mut self) -> bool {
        if self.peek() != Some(b'/') {
            return false;
        }
        let slash = self.at;
        self.at += 1;
        if self.peek() == Some(b'[') {
            return true;
        }
        self.at = slash;
        false
    }

    /// `EXISTS[#<name>]`: 1 where the parameter was assigned.
    fn exists(&mut self) -> Result<Operand> {
        self.expect(b'[', "[ of the function is missing here")?;
        self.peek();
        let start = self.at;
        let exists = match self.target()? {
            Target::Named(name) => match self.context.variables.named(&name) {
                Ok(value) => value.is_some(),
                Err(refusal) => return Err(Defect::refused(refusal, start, self.at)),
            },
            Target::Numbered(_) => {
                return Err(Defect::new(
                    code::EXPRESSION_MALFORMED,
                    start,
                    self.at,
                    "EXISTS takes a name: EXISTS[#<name>]",
                )
                .cure("numbered parameters exist always"));
            }
        };
        self.expect(b']', "] is missing here")?;
        Ok(Operand::Number(f64::from(u8::from(exists))))
    }
}

#[cold]
fn truth(start: usize, end: usize) -> Box<Defect> {
    Defect::new(code::EXPRESSION_TRUTH, start, end, "this is a condition where a number is needed")
        .cure("use it in IF or WHILE; to store it, assign 1 or 0 behind IF ... THEN")
}

#[cold]
fn overflow(start: usize, end: usize) -> Box<Defect> {
    Defect::new(code::EXPRESSION_ARITHMETIC, start, end, "the result is too large for a number")
        .cure("check the values that it is computed from")
}

#[cold]
fn impossible(
    reason: Impossible,
    operator: &Operator,
    left: Operand,
    right: Operand,
    start: usize,
    end: usize,
) -> Box<Defect> {
    let name = String::from_utf8_lossy(operator.text);
    let (code, message, cure) = match reason {
        Impossible::DivisionByZero => (
            code::EXPRESSION_ARITHMETIC,
            "division by zero".to_owned(),
            "check the divisor before, and that its parameter was assigned",
        ),
        Impossible::Power => (
            code::EXPRESSION_ARITHMETIC,
            "a negative number has no power that is not whole".to_owned(),
            "check the values that it is computed from",
        ),
        Impossible::NegativeModulo => (
            code::EXPRESSION_DIFFERS,
            "MOD of negative numbers differs between controls".to_owned(),
            "use MOD for numbers from 0 on, or FIX: #3=#1-FIX[#1/#2]*#2",
        ),
        Impossible::Bits => (
            code::EXPRESSION_DIFFERS,
            format!("{name} joins the bits of whole numbers of at most 32 bits"),
            "round the values with ROUND, FIX or FUP; conditions that it joins need brackets each",
        ),
        Impossible::Truth => (
            code::EXPRESSION_TRUTH,
            format!("{name} joins a condition and a number"),
            "put each condition in brackets of its own: [[#1 GT 0] AND [#2 LT 5]]",
        ),
    };
    let mut defect = Defect::new(code, start, end, message).cure(cure);
    for (name, side) in [("left", left), ("right", right)] {
        if let Some(value) = side.or_zero() {
            defect = defect.value(name, value);
        }
    }
    defect
}

/// How to give a name a value.
#[cold]
fn unset_cure(name: &Name) -> Cow<'static, str> {
    match name.is_global() {
        true => {
            format!("assign it before, ask with EXISTS, or let the profile bring it: {}", profile_row(name.as_str()))
        }
        false => return "assign it before, or ask with EXISTS".into(),
    }
    .into()
}
