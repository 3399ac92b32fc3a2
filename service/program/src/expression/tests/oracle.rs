//! Random expressions, made as trees, evaluated as trees and printed for the reader: both must agree.

use proptest::prelude::*;

use super::*;

/// An expression as a tree; the reader knows nothing of it.
#[derive(Clone, Debug)]
enum Tree {
    Number(f64),
    Parameter(u32),
    Negated(Box<Tree>),
    /// Operator as written, precedence, sides.
    Binary(&'static str, u8, Box<Tree>, Box<Tree>),
    Function(&'static str, Box<Tree>),
    ArcTangent(Box<Tree>, Box<Tree>),
}

/// The operators that both dialects have, in precedence of each: FANUC, LinuxCNC.
const SHARED: [(&str, u8, u8); 4] = [("*", 3, 4), ("/", 3, 4), ("+", 2, 3), ("-", 2, 3)];

/// Operators of LinuxCNC alone, or that mean the same for its numbers only.
const LINUX: [(&str, u8); 10] =
    [("**", 5), ("MOD", 4), ("EQ", 2), ("NE", 2), ("GT", 2), ("GE", 2), ("LT", 2), ("LE", 2), ("AND", 1), ("OR", 1)];

const FUNCTIONS: [&str; 6] = ["SIN", "COS", "ABS", "ROUND", "FIX", "FUP"];

fn tree(is_linux: bool) -> impl Strategy<Value = Tree> {
    let number = (0_u32..100_000).prop_map(|value| Tree::Number(f64::from(value) / 1_000.0));
    let leaf = prop_oneof![number, (1_u32..5).prop_map(Tree::Parameter)];
    let depth = if is_linux { 8 } else { 4 };
    leaf.prop_recursive(depth, 40, 2, move |inner| {
        let shared = (prop::sample::select(SHARED.to_vec()), inner.clone(), inner.clone()).prop_map(
            move |((text, fanuc, linux), left, right)| {
                Tree::Binary(text, if is_linux { linux } else { fanuc }, Box::new(left), Box::new(right))
            },
        );
        let own = (prop::sample::select(LINUX.to_vec()), inner.clone(), inner.clone())
            .prop_map(|((text, level), left, right)| Tree::Binary(text, level, Box::new(left), Box::new(right)));
        let function = (prop::sample::select(FUNCTIONS.to_vec()), inner.clone())
            .prop_map(|(name, inner)| Tree::Function(name, Box::new(inner)));
        let tangent = (inner.clone(), inner.clone()).prop_map(|(y, x)| Tree::ArcTangent(Box::new(y), Box::new(x)));
        let negated = inner.prop_map(|inner| Tree::Negated(Box::new(inner)));
        if is_linux {
            prop_oneof![3 => shared.boxed(), 3 => own.boxed(), 1 => function, 1 => tangent, 1 => negated].boxed()
        } else {
            prop_oneof![5 => shared.boxed(), 1 => function, 1 => tangent, 1 => negated].boxed()
        }
    })
}

/// The value by the words of the page; `None` where it says error.
fn meaning(tree: &Tree, is_linux: bool, parameters: &Table) -> Option<f64> {
    let of = |tree: &Tree| meaning(tree, is_linux, parameters);
    let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
    let value = match tree {
        Tree::Number(value) => *value,
        Tree::Parameter(number) => parameters.numbered[number],
        Tree::Negated(inner) => -of(inner)?,
        Tree::Function(name, inner) => {
            let value = of(inner)?;
            let magnitude = value.abs();
            match *name {
                "SIN" => (value * core::f64::consts::PI / 180.0).sin(),
                "COS" => (value * core::f64::consts::PI / 180.0).cos(),
                "ABS" => magnitude,
                "ROUND" => (magnitude + 0.5).floor() * if value < 0.0 { -1.0 } else { 1.0 },
                "FIX" if is_linux => value.floor(),
                "FIX" => magnitude.floor() * value.signum(),
                "FUP" if is_linux => value.ceil(),
                _ => magnitude.ceil() * value.signum(),
            }
        }
        Tree::ArcTangent(y, x) => {
            let (y, x) = (of(y)?, of(x)?);
            if !is_linux && y == 0.0 && x == 0.0 {
                return None;
            }
            let angle = y.atan2(x) * 180.0 / core::f64::consts::PI;
            if !is_linux && angle < 0.0 { angle + 360.0 } else { angle }
        }
        Tree::Binary(text, _, left, right) => {
            let (left, right) = (of(left)?, of(right)?);
            match *text {
                "*" => left * right,
                "/" if right == 0.0 => return None,
                "/" => left / right,
                "+" => left + right,
                "-" => left - right,
                "**" if left < 0.0 && right.fract() != 0.0 || left == 0.0 && right < 0.0 => return None,
                "**" => left.powf(right),
                "MOD" if right == 0.0 => return None,
                "MOD" => left.rem_euclid(right),
                "EQ" => truth((left - right).abs() < 1e-6),
                "NE" => truth((left - right).abs() >= 1e-6),
                "GT" => truth(left > right),
                "GE" => truth(left >= right),
                "LT" => truth(left < right),
                "LE" => truth(left <= right),
                "AND" => truth(left != 0.0 && right != 0.0),
                _ => truth(left != 0.0 || right != 0.0),
            }
        }
    };
    value.is_finite().then_some(value)
}

/// Prints with brackets only where precedence needs them, or everywhere.
fn print(tree: &Tree, everywhere: bool) -> String {
    let side = |tree: &Tree, least: u8| match tree {
        Tree::Binary(_, level, ..) if everywhere || *level < least => format!("[{}]", print(tree, everywhere)),
        _ => print(tree, everywhere),
    };
    match tree {
        Tree::Number(value) => format!("{value:.3}"),
        Tree::Parameter(number) => format!("#{number}"),
        Tree::Negated(inner) => match **inner {
            Tree::Binary(..) | Tree::Negated(_) => format!("-[{}]", print(inner, everywhere)),
            _ => format!("-{}", print(inner, everywhere)),
        },
        // All operators of one level are carried out from left to right.
        Tree::Binary(text, level, left, right) => format!("{} {text} {}", side(left, *level), side(right, level + 1)),
        Tree::Function(name, inner) => format!("{name}[{}]", print(inner, everywhere)),
        Tree::ArcTangent(y, x) => format!("ATAN[{}]/[{}]", print(y, everywhere), print(x, everywhere)),
    }
}

/// Whether a rounding error could change the value: a step of a function, or a comparison, right at a value.
fn is_sensitive(tree: &Tree, is_linux: bool, parameters: &Table) -> bool {
    let near_whole = |tree: &Tree| {
        meaning(tree, is_linux, parameters).is_none_or(|value| {
            let doubled = value * 2.0;
            (doubled - doubled.round()).abs() < 1e-6 || value.abs() > 1e9
        })
    };
    let of = |tree: &Tree| is_sensitive(tree, is_linux, parameters);
    match tree {
        Tree::Number(_) | Tree::Parameter(_) => false,
        Tree::Negated(inner) => of(inner),
        Tree::Function(name, inner) => {
            let large = |tree: &Tree| meaning(tree, is_linux, parameters).is_none_or(|value| value.abs() > 1e6);
            of(inner) || (matches!(*name, "ROUND" | "FIX" | "FUP") && near_whole(inner)) || large(inner)
        }
        Tree::ArcTangent(y, x) => {
            let small = |tree: &Tree| meaning(tree, is_linux, parameters).is_none_or(|value| value.abs() < 1e-6);
            of(y) || of(x) || small(y) || small(x)
        }
        Tree::Binary(text, _, left, right) => {
            let values = (meaning(left, is_linux, parameters), meaning(right, is_linux, parameters));
            let (Some(one), Some(other)) = values else { return true };
            let scale = one.abs().max(other.abs()).max(1.0);
            let close = (one - other).abs() < 1e-4 * scale;
            let at_zero = one.abs() < 1e-6 || other.abs() < 1e-6;
            let step = match *text {
                "MOD" => (one / other - (one / other).round()).abs() < 1e-6 || (one / other).abs() > 1e6,
                "**" => at_zero || one.abs() > 1e3 || other.abs() > 20.0,
                "/" => at_zero,
                "*" => false,
                "+" | "-" => (one.abs() - other.abs()).abs() < 1e-4 * scale,
                "AND" | "OR" => at_zero && one != 0.0 && other != 0.0,
                _ => close,
            };
            of(left) || of(right) || step
        }
    }
}

fn agree(tree: &Tree, is_linux: bool) -> Result<(), TestCaseError> {
    let parameters = table();
    let rules = if is_linux { &LINUXCNC } else { &FANUC };
    if is_sensitive(tree, is_linux, &parameters) {
        return Ok(());
    }
    let expected = meaning(tree, is_linux, &parameters);
    for everywhere in [false, true] {
        let text = format!("[{}]", print(tree, everywhere));
        match (evaluate(text.as_bytes(), 0, &mut context(rules, &parameters)), expected) {
            (Ok((Some(found), end)), Some(expected)) => {
                prop_assert_eq!(end, text.len());
                prop_assert!(
                    (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
                    "{} = {}, not {}",
                    text,
                    found,
                    expected
                );
            }
            (Err(defect), _) if defect.code == code::EXPRESSION_DEPTH => {
                prop_assert!(!is_linux || text.len() > 32, "{}", text);
            }
            (found, expected) => {
                prop_assert!(found.is_err() && expected.is_none(), "{}: {:?}, {:?}", text, found, expected);
            }
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    #[test]
    fn linuxcnc_agrees_with_the_tree(tree in tree(true)) {
        agree(&tree, true)?;
    }

    #[test]
    fn fanuc_agrees_with_the_tree(tree in tree(false)) {
        agree(&tree, false)?;
    }

    #[test]
    fn any_text_is_read_or_refused(text in "[-+*/#<>\\[\\]0-9.,A-Zm= ]{0,60}") {
        let parameters = table();
        for rules in [&FANUC, &LINUXCNC] {
            for result in [
                evaluate(text.as_bytes(), 0, &mut context(rules, &parameters)).map(|(_, end)| end),
                condition(text.as_bytes(), 0, &mut context(rules, &parameters)).map(|(_, end)| end),
                assignment(text.as_bytes(), 0, &mut context(rules, &parameters)).map(|found| found.end),
            ] {
                match result {
                    Ok(end) => prop_assert!(end > 0 && end <= text.len()),
                    Err(defect) => prop_assert!(defect.start <= defect.end && defect.end <= text.len().max(1), "{:?}", defect),
                }
            }
        }
    }
}
