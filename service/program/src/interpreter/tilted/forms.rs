//! The forms of `G68.2`: Euler angles (none or `P0`), roll, pitch and yaw (`P1`), three points (`P2`), two vectors (`P3`), and
//! projection angles (`P4`).
//!
//! Controls read some of their words differently. A plane is tilted where every reading makes the same one; otherwise it is
//! refused, and each reading is stated as Euler angles, which all read alike.

use super::{Execution, PLANE_LETTERS};
use crate::code;
use crate::interpreter::execute::MM_PER_INCH;
use crate::state::{PlaneSequence, ToolMode};
use crate::{DecimalPointRule, Finding, SourceSpan, TiltedPlane};

/// Planes closer than this are the same, mm and as components of unit vectors.
const SAME_PLANE: f64 = 1e-9;
/// Points closer than this, mm, or three points this close to a line, make no plane.
const NO_PLANE_MM: f64 = 1e-6;
/// The two vectors of `P3` may be this far from a right angle, rad, by the rounding of their decimals. The normal is kept, and the
/// other one made perpendicular to it; what is further off may be meant otherwise.
const SQUARE_RAD: f64 = 5e-4;

type Vec3 = [f64; 3];

/// What the words of a block are.
pub(super) enum Form {
    /// A plane.
    Plane(TiltedPlane),
    /// A part of one: further blocks complete it.
    Part,
    /// Neither, which was reported.
    Refused,
}

/// A reading of the words of a plane: what it does, and its origin and axes.
type Reading = (&'static str, Vec3, [Vec3; 3]);

impl Execution<'_> {
    /// The words of `G68.2`.
    pub(super) fn plane_form(&mut self, span: SourceSpan) -> Form {
        let form = self.take(b'P').map_or(0.0, |word| word.number.value());
        if let Some(sequence) = self.state.plane_sequence.as_deref().copied()
            && f64::from(sequence.form) != form
        {
            self.plane_incomplete(sequence);
        }
        let plane = match form {
            0.0 => {
                let origin_mm = self.plane_point();
                let angles_deg = self.plane_vector();
                Some(TiltedPlane::by_euler_angles(origin_mm, angles_deg, span.line))
            }
            1.0 => self.by_roll_pitch_yaw(span),
            2.0 | 3.0 => return self.by_sequence(form as u32, span),
            4.0 => self.by_projection(span),
            _ => {
                self.used |= PLANE_LETTERS;
                self.plane_words(span, "P says how the plane is given: none or P0 to P4", |finding| {
                    finding.suggest("write the origin X Y Z and the Euler angles I J K, without P")
                });
                None
            }
        };
        plane.map_or(Form::Refused, Form::Plane)
    }

    /// `X Y Z`, mm.
    fn plane_point(&mut self) -> Vec3 {
        let x_mm = self.take(b'X').map_or(0.0, |word| self.radius(&word));
        let [y_mm, z_mm] = [b'Y', b'Z'].map(|letter| self.take(letter).map_or(0.0, |word| self.scaled(&word, true)));
        [x_mm, y_mm, z_mm]
    }

    /// `I J K`: angles, or a direction.
    fn plane_vector(&mut self) -> Vec3 {
        [b'I', b'J', b'K'].map(|letter| self.take(letter).map_or(0.0, |word| self.scaled(&word, false)))
    }

    /// `I J K` as a direction, which has no unit, so that the rule of the decimal point does not scale it; nothing after a finding.
    fn plane_direction(&mut self, span: SourceSpan) -> Option<Vec3> {
        let words = [b'I', b'J', b'K'].map(|letter| self.take(letter));
        let mut points = words.iter().flatten().filter(|it| it.number.value() != 0.0).map(|it| it.number.has_point());
        let is_scaled = self.settings.decimal_point == DecimalPointRule::LeastIncrement;
        let first = points.next();
        if is_scaled && points.any(|has_point| Some(has_point) != first) {
            self.plane_words(span, "components of one vector with and without a decimal point", |it| {
                it.suggest("write I, J and K of the vector all with a decimal point, such as I1. J1. K0.")
            });
            return None;
        }
        Some(words.map(|word| word.map_or(0.0, |word| word.number.value())))
    }

    /// Reports `X Y Z` in a block of a plane that reads none; they would be taken for a move.
    fn foreign_origin(&mut self) {
        for letter in [b'X', b'Y', b'Z'] {
            if let Some(word) = self.take(letter) {
                self.word_unused(&word, letter);
            }
        }
    }

    /// `P1`: turned about X, Y and Z, in the order that `Q` says (123: X first, then Y, then Z).
    fn by_roll_pitch_yaw(&mut self, span: SourceSpan) -> Option<TiltedPlane> {
        let order = self.take(b'Q');
        let (origin_mm, angles_deg) = (self.plane_point(), self.plane_vector());
        let order = match order.map(|word| word.number.value()) {
            None => [0, 1, 2],
            Some(value) => {
                let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
                let digits = |order: &[usize; 3]| order.iter().fold(0.0, |sum, axis| 10.0 * sum + (axis + 1) as f64);
                let Some(order) = orders.into_iter().find(|order| digits(order) == value) else {
                    self.plane_words(span, "Q is the order of the three axes: 123, 132, 213, 231, 312 or 321", |it| {
                        it.suggest("write Q123 to turn about X, then Y, then Z")
                    });
                    return None;
                };
                order
            }
        };
        // By axis, and by place in the order.
        let by_axis = order.map(|axis| TiltedPlane::about(axis, angles_deg[axis]));
        let by_place = [0, 1, 2].map(|place| TiltedPlane::about(order[place], angles_deg[place]));
        let fixed = |turns: &[[Vec3; 3]; 3]| product(&turns[2], &product(&turns[1], &turns[0]));
        let moving = |turns: &[[Vec3; 3]; 3]| product(&turns[0], &product(&turns[1], &turns[2]));
        self.settle(
            span,
            span.line,
            &[
                (
                    "turning about the fixed axes of the work, I about X, J about Y, K about Z",
                    origin_mm,
                    fixed(&by_axis),
                ),
                (
                    "turning about the axes as they are turned already, I about X, J about Y, K about Z",
                    origin_mm,
                    moving(&by_axis),
                ),
                ("turning about the fixed axes of the work, I J K in the order of Q", origin_mm, fixed(&by_place)),
                (
                    "turning about the axes as they are turned already, I J K in the order of Q",
                    origin_mm,
                    moving(&by_place),
                ),
            ],
        )
    }

    /// `P4`: X is turned about Y by I, Y about X by J; both lie in the plane, whose X is the first of them turned by K in it.
    fn by_projection(&mut self, span: SourceSpan) -> Option<TiltedPlane> {
        let (origin_mm, [i, j, k]) = (self.plane_point(), self.plane_vector());
        let plane = |sense: f64| {
            // The turned X and Y; a right-handed turn about Y lowers X.
            let [along, _, _] = TiltedPlane::about(1, sense * i);
            let [_, across, _] = TiltedPlane::about(0, j);
            let normal = unit(cross(along, across))?;
            Some(product(&[along, cross(normal, along), normal], &TiltedPlane::about(2, k)))
        };
        let (Some(turned), Some(raised)) = (plane(1.0), plane(-1.0)) else {
            self.plane_words(span, "the two projected axes are parallel: they make no plane", |it| {
                it.suggest("write the plane with Euler angles, without P")
            });
            return None;
        };
        self.settle(
            span,
            span.line,
            &[
                ("I as a right-handed turn of X about Y, which lowers it", origin_mm, turned),
                ("I as the angle by which X rises", origin_mm, raised),
            ],
        )
    }

    /// A block of `P2` or `P3`, which `Q` numbers.
    fn by_sequence(&mut self, form: u32, span: SourceSpan) -> Form {
        let number = self.take(b'Q').map(|word| word.number.value());
        let last = if form == 2 { 3 } else { 2 };
        let before = self.state.plane_sequence.take().map(|sequence| *sequence);
        let next = before.map_or(u32::from(form == 3), |sequence| sequence.next);
        if before.is_none() && self.state.is_plane_refused() && number.is_some_and(|it| it >= 2.0) {
            // The rest of a plane that was refused.
            self.used |= PLANE_LETTERS;
            return Form::Refused;
        }
        // Three points may be without the shift of the origin, and then begin with the first one.
        let number = number.filter(|&it| it == f64::from(next) || form == 2 && before.is_none() && it == 1.0);
        let Some(number) = number.map(|it| it as usize) else {
            let message = if form == 2 {
                "three points are written in blocks one after the other: G68.2 P2 Q1, Q2 and Q3"
            } else {
                "two vectors are written in two blocks one after the other: G68.2 P3 Q1, then Q2"
            };
            self.plane_words(span, message, |it| it.suggest(format!("write Q{next} in this block")));
            return Form::Refused;
        };
        let mut sequence = before.unwrap_or(PlaneSequence { form, line: span.line, ..PlaneSequence::default() });
        sequence.next = number as u32 + 1;
        sequence.has_shift |= number == 0;
        // With the shift R belongs to it; without it no control says what it does, which is reported in the end.
        let reads_turn = number == 0 || number == 1 && form == 3 || form == 2 && !sequence.has_shift;
        if reads_turn {
            sequence.turn_deg += self.take(b'R').map_or(0.0, |word| self.scaled(&word, false));
        }
        if form == 2 || number == 1 {
            sequence.points_mm[number] = self.plane_point();
        } else {
            self.foreign_origin();
        }
        if form == 3 {
            let Some(vector) = self.plane_direction(span) else { return Form::Refused };
            sequence.vectors[number] = vector;
        }
        if number < last {
            self.state.plane_sequence = Some(Box::new(sequence));
            return Form::Part;
        }
        let plane = if form == 2 { self.by_points(&sequence, span) } else { self.by_vectors(&sequence, span) };
        plane.map_or(Form::Refused, Form::Plane)
    }

    /// From the first point to the second goes X, and the third one is on the side of positive Y.
    fn by_points(&mut self, sequence: &PlaneSequence, span: SourceSpan) -> Option<TiltedPlane> {
        let [shift_mm, first_mm, second_mm, third_mm] = sequence.points_mm;
        let (along, beside) = (difference(second_mm, first_mm), difference(third_mm, first_mm));
        let normal = cross(along, beside);
        let far_mm = length(along).max(length(beside));
        if length(along) < NO_PLANE_MM || length(normal) < NO_PLANE_MM * far_mm {
            self.plane_words(span, "the three points lie on one line, or two of them on one another", |it| {
                it.suggest("choose points that are apart")
            });
            return None;
        }
        let (x, z) = (unit(along)?, unit(normal)?);
        let axes = [x, cross(z, x), z];
        let turn = TiltedPlane::about(2, sequence.turn_deg);
        let in_plane = product(&axes, &turn);
        if !sequence.has_shift {
            return self.settle(
                span,
                sequence.line,
                &[
                    ("R without meaning, as there is no Q0", first_mm, axes),
                    ("R in the plane", first_mm, in_plane),
                    ("R about Z of the work", first_mm, product(&turn, &axes)),
                ],
            );
        }
        let before_turn = TiltedPlane { origin_mm: first_mm, axes, line: 0 }.to_work(shift_mm);
        self.settle(
            span,
            sequence.line,
            &[
                ("Q0 as a shift from the first point in the plane, turned by R in it", before_turn, in_plane),
                ("Q0 as the origin in work coordinates, turned by R in the plane", shift_mm, in_plane),
                (
                    "Q0 as the origin in work coordinates, turned by R about Z of the work",
                    shift_mm,
                    product(&turn, &axes),
                ),
            ],
        )
    }

    /// The first vector is X of the plane, the second one its normal.
    fn by_vectors(&mut self, sequence: &PlaneSequence, span: SourceSpan) -> Option<TiltedPlane> {
        let [_, along, normal, _] = sequence.vectors;
        let (Some(along), Some(z)) = (unit(along), unit(normal)) else {
            self.plane_words(span, "a vector of the plane has no length", |it| {
                it.suggest("write X of the plane in Q1 and its normal in Q2, such as I0 J0 K1")
            });
            return None;
        };
        let beside = dot(along, z);
        let x = unit([0, 1, 2].map(|k| along[k] - beside * z[k]));
        let (Some(x), true) = (x, beside.abs() <= SQUARE_RAD) else {
            let off_deg = libm::asin(beside.abs().min(1.0)).to_degrees();
            self.plane_words(span, "the two vectors of the plane are not perpendicular", |it| {
                it.with_value("beside", off_deg, "deg")
                    .suggest("write X of the plane perpendicular to its normal, both with six decimals")
            });
            return None;
        };
        let axes = [x, cross(z, x), z];
        if sequence.turn_deg != 0.0 {
            let turn = TiltedPlane::about(2, sequence.turn_deg);
            let origin_mm = sequence.points_mm[1];
            return self.settle(
                span,
                sequence.line,
                &[
                    ("R in the plane", origin_mm, product(&axes, &turn)),
                    ("R about Z of the work", origin_mm, product(&turn, &axes)),
                ],
            );
        }
        self.settle(span, sequence.line, &[("", sequence.points_mm[1], axes)])
    }

    /// The plane that all readings make of the lines from `first_line` on; where they differ they are reported, each as Euler angles.
    fn settle(&mut self, span: SourceSpan, first_line: u32, readings: &[Reading]) -> Option<TiltedPlane> {
        let &(_, origin_mm, axes) = readings.first()?;
        let line = span.line;
        let differs = |one: &Reading, other: &Reading| {
            let apart = |a: &Vec3, b: &Vec3| (0..3).any(|k| (a[k] - b[k]).abs() > SAME_PLANE * a[k].abs().max(1.0));
            apart(&one.1, &other.1) || (0..3).any(|k| apart(&one.2[k], &other.2[k]))
        };
        let mut different: Vec<&Reading> = Vec::new();
        for reading in readings {
            if different.iter().all(|other| differs(reading, other)) {
                different.push(reading);
            }
        }
        if different.len() < 2 {
            return Some(TiltedPlane { origin_mm, axes, line });
        }
        let unit_mm = if self.state.inch { MM_PER_INCH } else { 1.0 };
        let per_radius = if self.state.x_diameter { 2.0 } else { 1.0 };
        let place = match line > first_line {
            true => format!(", in place of the blocks from line {first_line} to line {line}"),
            false => String::new(),
        };
        self.findings.push_with(code::PLANE_DOUBT, |code| {
            let message = format!("controls make {} different planes of these words", different.len());
            different.iter().fold(Finding::new(code, span, message), |finding, (what, origin_mm, axes)| {
                let [i, j, k] = TiltedPlane { origin_mm: *origin_mm, axes: *axes, line }.euler_angles_deg().map(shown);
                let [x, y, z] = [per_radius * origin_mm[0], origin_mm[1], origin_mm[2]].map(|it| shown(it / unit_mm));
                finding.suggest(format!("for {what}{place}: write G68.2 X{x} Y{y} Z{z} I{i} J{j} K{k}"))
            })
        });
        None
    }

    /// The block is not the next one of a plane that several blocks give.
    #[cold]
    pub(in crate::interpreter) fn plane_incomplete(&mut self, sequence: PlaneSequence) {
        self.state.plane_sequence = None;
        if self.state.tool_control.mode == ToolMode::Off {
            self.enter_plane(None, sequence.line);
        }
        let span = self.block.span();
        let PlaneSequence { form, line, next, .. } = sequence;
        self.findings.push_with(code::PLANE_INCOMPLETE, |code| {
            let message =
                format!("the plane begun in line {line} is not complete: G68.2 P{form} Q{next} is missing before");
            Finding::new(code, span, message)
                .with_value("begun_in_line", f64::from(line), "")
                .suggest(format!("write the block with Q{next} directly behind the one before it"))
        });
    }

    #[cold]
    fn plane_words(&mut self, span: SourceSpan, message: &'static str, fill: impl FnOnce(Finding) -> Finding) {
        self.state.plane_sequence = None;
        self.used |= PLANE_LETTERS;
        self.findings.push_with(code::PLANE_WORDS, |code| fill(Finding::new(code, span, message)));
    }
}

/// As a word has it: six decimals at most, without a negative zero, and with a point, as without one a number counts least increments
/// on some controls.
fn shown(value: f64) -> String {
    let value = (value * 1e6).round() / 1e6 + 0.0;
    let point = if value.fract() == 0.0 { "." } else { "" };
    format!("{value}{point}")
}

/// The axes of `first`, each given in the axes of `turned`, in the coordinates of the latter: the rotation `turned`·`first`.
fn product(turned: &[Vec3; 3], first: &[Vec3; 3]) -> [Vec3; 3] {
    first.map(|axis| core::array::from_fn(|k| (0..3).map(|along| turned[along][k] * axis[along]).sum()))
}

fn difference(a: Vec3, b: Vec3) -> Vec3 {
    core::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(v: Vec3) -> f64 {
    dot(v, v).sqrt()
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: Vec3) -> Option<Vec3> {
    super::super::tool_control::normalised(v)
}
