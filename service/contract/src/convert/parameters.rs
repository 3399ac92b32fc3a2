//! Parameters of programs, to and from the contract.

use feedwave_program::InitialParameters;

use crate::proto;
use crate::violations::Violations;

/// Parameters that a profile may bring.
const MOST_PARAMETERS: usize = 1_000;

/// Largest number of a parameter.
const LARGEST_NUMBER: u32 = 99_999;

/// The parameters of a field; each that cannot be one, or comes twice, is a violation.
pub(super) fn parameters_from_proto(
    violations: &mut Violations,
    prefix: &str,
    parameters: &[proto::ParameterValue],
) -> InitialParameters {
    let mut initial = InitialParameters::default();
    if parameters.len() > MOST_PARAMETERS {
        let count = parameters.len();
        violations.add(prefix, format!("must list at most {MOST_PARAMETERS}, lists {count}"));
        return initial;
    }
    for (index, proto::ParameterValue { parameter, value }) in parameters.iter().enumerate() {
        let field = |name: &str| format!("{prefix}[{index}].{name}");
        if !value.is_finite() {
            violations.add(field("value"), format!("must be finite, is {value}"));
        }
        let is_new = match parameter.parse::<u32>() {
            Ok(number) if (1..=LARGEST_NUMBER).contains(&number) => initial.numbered.insert(number, *value).is_none(),
            Ok(number) => {
                violations.add(field("parameter"), format!("must be 1 to {LARGEST_NUMBER}, is {number}"));
                continue;
            }
            Err(_) => match InitialParameters::name_problem(parameter) {
                None => initial.named.insert(parameter.clone(), *value).is_none(),
                Some(problem) => {
                    violations.add(field("parameter"), problem);
                    continue;
                }
            },
        };
        if !is_new {
            violations.add(field("parameter"), format!("{parameter} is listed before"));
        }
    }
    initial
}

pub(super) fn parameters_to_proto(parameters: &InitialParameters) -> Vec<proto::ParameterValue> {
    let numbered = parameters.numbered.iter().map(|(number, value)| (number.to_string(), *value));
    let named = parameters.named.iter().map(|(name, value)| (name.clone(), *value));
    numbered.chain(named).map(|(parameter, value)| proto::ParameterValue { parameter, value }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(parameters: &[(&str, f64)]) -> (InitialParameters, Violations) {
        let mut violations = Violations::default();
        let value =
            |&(parameter, value): &(&str, f64)| proto::ParameterValue { parameter: parameter.to_owned(), value };
        let parameters: Vec<_> = parameters.iter().map(value).collect();
        let initial = parameters_from_proto(&mut violations, "language.parameters", &parameters);
        (initial, violations)
    }

    #[test]
    fn parameters_come_back() {
        let (initial, violations) = given(&[("500", 1.5), ("_depth", -2.0)]);
        assert!(violations.is_empty());
        assert_eq!((initial.numbered[&500], initial.named["_depth"]), (1.5, -2.0));
        let mut again = Violations::default();
        assert_eq!(parameters_from_proto(&mut again, "language.parameters", &parameters_to_proto(&initial)), initial);
    }

    #[test]
    fn what_is_no_parameter_is_refused() {
        for parameters in [
            &[("0", 1.0)][..],
            &[("100000", 1.0)],
            &[("depth", 1.0)],
            &[("_Depth", 1.0)],
            &[("", 1.0)],
            &[("500", f64::NAN)],
            &[("500", 1.0), ("500", 2.0)],
        ] {
            assert!(!given(parameters).1.is_empty(), "{parameters:?}");
        }
        assert!(!given(&vec![("500", 1.0); 1_001]).1.is_empty());
    }
}
