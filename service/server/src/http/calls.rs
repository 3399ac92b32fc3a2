//! What the page calls: a few methods of the contract, by gRPC-Web on the origin that the page is from, and the messages of
//! these methods as a module of JavaScript.
//!
//! The methods are those of the gRPC port, with all that is around them there. Nothing else is answered here: whoever is let
//! through to the HTTP port alone can run no machine.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use axum::Router;
use axum::routing::post_service;
use feedwave_contract::proto::DESCRIPTORS;
use prost_reflect::{Cardinality, FieldDescriptor, Kind, MessageDescriptor, MethodDescriptor};
use serde_json::{Value, json};

use crate::connections::App;

/// The methods, by their paths.
const METHODS: [&str; 6] = [
    "/feedwave.v1.Jobs/CreateJob",
    "/feedwave.v1.Jobs/UploadProgram",
    "/feedwave.v1.Jobs/ValidateProgram",
    "/feedwave.v1.Machines/ListMachines",
    "/feedwave.v1.Programs/Interpret",
    "/feedwave.v1.Tools/ListTools",
];

/// The routes of the methods, which `calls` answers.
pub(super) fn routes<S: Clone + Send + Sync + 'static>(calls: &App) -> Router<S> {
    METHODS.iter().fold(Router::new(), |router, path| router.route(path, post_service(calls.clone())))
}

/// The name of the module among the page's files.
pub(super) const NAME: &str = "contract.js";

/// The module: methods with the names of their messages, messages as lists of fields, enums as names by number.
pub(super) static MODULE: LazyLock<String> = LazyLock::new(|| {
    let mut methods = BTreeMap::new();
    let mut waiting = Vec::new();
    for path in METHODS {
        let Some(method) = method(path) else { continue };
        methods.insert(path, [method.input().name().to_owned(), method.output().name().to_owned()]);
        waiting.extend([method.input(), method.output()]);
    }
    let mut messages = BTreeMap::new();
    let mut enums = BTreeMap::new();
    while let Some(message) = waiting.pop() {
        if messages.contains_key(message.name()) {
            continue;
        }
        let fields: Vec<Value> =
            message.fields().filter_map(|field| described(&field, &mut waiting, &mut enums)).collect();
        messages.insert(message.name().to_owned(), fields);
    }
    format!(
        "// Made from the contract by the service: what the page's calls carry.\n\
         export const METHODS = {};\nexport const MESSAGES = {};\nexport const ENUMS = {};\n",
        json!(methods),
        json!(messages),
        json!(enums)
    )
});

fn method(path: &str) -> Option<MethodDescriptor> {
    let (service, method) = path.strip_prefix('/')?.split_once('/')?;
    DESCRIPTORS.get_service_by_name(service)?.methods().find(|found| found.name() == method)
}

/// A field as `[number, name in JSON, kind, label, type]`; label 0: always there, 1: only where it is populated, 2: a list.
/// Times are left out: no call of the page has a use for one, and in JSON they are texts.
fn described(
    field: &FieldDescriptor,
    waiting: &mut Vec<MessageDescriptor>,
    enums: &mut BTreeMap<String, BTreeMap<i32, String>>,
) -> Option<Value> {
    let label = match field.cardinality() {
        Cardinality::Repeated => 2,
        _ if field.supports_presence() => 1,
        _ => 0,
    };
    let (kind, named) = match field.kind() {
        Kind::Message(message) if message.package_name() != "feedwave.v1" => return None,
        Kind::Message(message) => {
            let name = message.name().to_owned();
            waiting.push(message);
            ("message".to_owned(), Some(name))
        }
        Kind::Enum(named) => {
            let names = named.values().map(|value| (value.number(), value.name().to_owned()));
            enums.insert(named.name().to_owned(), names.collect());
            ("enum".to_owned(), Some(named.name().to_owned()))
        }
        scalar => (format!("{scalar:?}").to_ascii_lowercase(), None),
    };
    Some(match named {
        Some(named) => json!([field.number(), field.json_name(), kind, label, named]),
        None => json!([field.number(), field.json_name(), kind, label]),
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_method_of_the_page_is_of_the_contract_and_moves_no_machine() {
        for path in METHODS {
            let method = method(path).unwrap_or_else(|| panic!("no {path}"));
            let moves = ["feedwave.v1.Runs", "feedwave.v1.Telemetry"].contains(&method.parent_service().full_name());
            assert!(!moves, "{path}");
        }
    }

    #[test]
    fn the_module_has_all_messages_that_calls_carry_in_kinds_that_the_page_knows() {
        let part = |name: &str| -> Value {
            let line = MODULE.lines().find_map(|line| line.strip_prefix(&format!("export const {name} = ")));
            serde_json::from_str(line.unwrap().trim_end_matches(';')).unwrap()
        };
        let (messages, enums) = (part("MESSAGES"), part("ENUMS"));
        let known: BTreeSet<&str> = [
            "double", "float", "int32", "int64", "sint64", "uint32", "uint64", "bool", "string", "bytes", "message",
            "enum",
        ]
        .into();
        for (name, fields) in messages.as_object().unwrap() {
            for field in fields.as_array().unwrap() {
                let kind = field[2].as_str().unwrap();
                assert!(known.contains(kind), "{name}: {field}");
                match kind {
                    "message" => assert!(messages.get(field[4].as_str().unwrap()).is_some(), "{name}: {field}"),
                    "enum" => assert!(enums.get(field[4].as_str().unwrap()).is_some(), "{name}: {field}"),
                    _ => assert_eq!(field.as_array().unwrap().len(), 4, "{name}: {field}"),
                }
            }
        }
        assert_eq!(messages["Finding"][0], json!([1, "code", "string", 0]));
        assert_eq!(messages["Suggestion"][1], json!([2, "replacement", "string", 1]));
        assert_eq!(enums["Severity"]["3"], "SEVERITY_ERROR");
        assert!(!DESCRIPTORS.all_messages().any(|message| message.is_map_entry()), "the page knows no maps");
    }
}
