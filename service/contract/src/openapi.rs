//! The HTTP port as an `OpenAPI` 3.1 document, made from the table of routes and the descriptors of the contract: whatever generates
//! clients or checks answers reads it.

use std::collections::{BTreeMap, HashMap, VecDeque};

use prost_reflect::{EnumDescriptor, FieldDescriptor, Kind, MessageDescriptor};
use serde_json::{Map, Value, json};

use crate::comments::Comments;
use crate::proto::DESCRIPTORS;
use crate::routes::{Body, ROUTES, Route, RouteEntry};

const PACKAGE: &str = "feedwave.v1";

/// What every answer that is no success is.
const ERROR: &str = "Status";

/// The document.
#[must_use]
pub fn document() -> Value {
    let mut schemas = Schemas::default();
    let paths: Map<String, Value> =
        ROUTES.iter().map(|entry| (entry.path.to_owned(), path_item(entry, &mut schemas))).collect();
    let mut schemas = schemas.all();
    schemas.insert(ERROR.to_owned(), error_schema());
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "feedwave",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "The HTTP port for dashboards, Prometheus, probes and the page. Each of these paths is only read, by GET and \
                HEAD; the methods that the page calls by gRPC-Web at the same port, which create jobs and programs, are those of the \
                gRPC contract. Bodies are messages of the contract in the protobuf JSON mapping: 64-bit integers are strings, and fields that have no presence \
                are always written.",
            "license": { "name": env!("CARGO_PKG_LICENSE") },
        },
        "paths": paths,
        "components": {
            "schemas": schemas,
            "parameters": {
                "Tenant": {
                    "name": "x-feedwave-tenant",
                    "in": "header",
                    "description": "Tenant to act for, where the client acts for any.",
                    "schema": { "type": "string" },
                },
                "IfNoneMatch": {
                    "name": "if-none-match",
                    "in": "header",
                    "description": "Entity tags of what the client has: what has not changed is answered by 304.",
                    "schema": { "type": "string" },
                },
                "LastEventId": {
                    "name": "last-event-id",
                    "in": "header",
                    "description": "Id of the last event that the client was told: the stream goes on behind it.",
                    "schema": { "type": "string" },
                },
            },
            "headers": {
                "ETag": {
                    "description": "Strong entity tag: it changes with the answer.",
                    "schema": { "type": "string" },
                },
            },
            "responses": {
                "Error": {
                    "description": "What went wrong, with details to act on.",
                    "content": { "application/json": { "schema": reference(ERROR) } },
                },
            },
            "securitySchemes": {
                "token": { "type": "http", "scheme": "bearer" },
                "certificate": { "type": "mutualTLS" },
            },
        },
        // Who may call what, and how clients say who they are, is a matter of configuration.
        "security": [{}, { "token": [] }, { "certificate": [] }],
    })
}

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

/// `google.rpc.Status` in JSON.
fn error_schema() -> Value {
    json!({
        "type": "object",
        "description": "google.rpc.Status.",
        "required": ["code", "message", "details"],
        "properties": {
            "code": { "type": "integer", "description": "A code of google.rpc.Code." },
            "message": { "type": "string", "description": "What went wrong, in a sentence." },
            "details": {
                "type": "array",
                "description": "Messages of google.rpc such as ErrorInfo and BadRequest, each with its `@type`.",
                "items": { "type": "object", "required": ["@type"], "properties": { "@type": { "type": "string" } } },
            },
        },
    })
}

fn message(name: &str) -> MessageDescriptor {
    DESCRIPTORS.get_message_by_name(&format!("{PACKAGE}.{name}")).expect("a test holds the table against the contract")
}

fn path_item(entry: &RouteEntry, schemas: &mut Schemas) -> Value {
    let mut parameters = vec![json!({ "$ref": "#/components/parameters/Tenant" })];
    if entry.path.contains("{id}") {
        parameters.push(json!({ "name": "id", "in": "path", "required": true, "schema": { "type": "string" } }));
    }
    for field in entry.parameters.into_iter().flat_map(|request| query_fields(&message(request))) {
        parameters.push(query_parameter(&field));
    }
    if entry.route == Route::Follow {
        parameters.push(json!({ "$ref": "#/components/parameters/LastEventId" }));
    }
    if has_tag(entry) {
        parameters.push(json!({ "$ref": "#/components/parameters/IfNoneMatch" }));
    }
    let name = format!("{:?}", entry.route);
    let operation = |id: String, content: Option<Value>| {
        json!({
            "operationId": id,
            "description": entry.purpose,
            "parameters": parameters,
            "responses": responses(has_tag(entry), content),
        })
    };
    json!({
        "get": operation(lower_first(&name), Some(content(entry, schemas))),
        "head": operation(format!("head{name}"), None),
    })
}

/// Whether answers have an entity tag.
fn has_tag(entry: &RouteEntry) -> bool {
    matches!(entry.body, Body::Message(_) | Body::Json(_)) || entry.route == Route::ReadProgram
}

/// The forms of an answer.
fn content(entry: &RouteEntry, schemas: &mut Schemas) -> Value {
    let text = json!({ "schema": { "type": "string" } });
    match entry.body {
        Body::Message(name) => {
            schemas.want(&message(name));
            json!({ "application/json": { "schema": reference(name) } })
        }
        Body::Json(_) => json!({ "application/json": { "schema": { "type": "object" } } }),
        Body::Text { media_type, .. } if entry.route == Route::GetMetrics => {
            json!({ media_type: text, "application/openmetrics-text": text })
        }
        Body::Text { media_type, .. } => json!({ media_type: text }),
    }
}

/// The answers of an operation; none has a body where there is no content.
fn responses(has_tag: bool, content: Option<Value>) -> Value {
    let mut success = json!({ "description": "The answer." });
    let mut failure = json!({ "$ref": "#/components/responses/Error" });
    match content {
        Some(content) => success["content"] = content,
        None => failure = json!({ "description": "What went wrong, by its status alone." }),
    }
    if !has_tag {
        return json!({ "200": success, "default": failure });
    }
    let tag = json!({ "ETag": { "$ref": "#/components/headers/ETag" } });
    success["headers"] = tag.clone();
    json!({ "200": success, "304": { "description": "Not changed.", "headers": tag }, "default": failure })
}

/// The fields of a request that are parameters of the query: all but the name of a resource, which is in the path.
pub fn query_fields(request: &MessageDescriptor) -> Vec<FieldDescriptor> {
    // In the order of the source.
    let mut fields: Vec<FieldDescriptor> = request.fields().filter(|field| field.name() != "name").collect();
    fields.sort_by(|one, other| one.path().cmp(other.path()));
    fields
}

fn query_parameter(field: &FieldDescriptor) -> Value {
    let schema = match field.kind() {
        Kind::Message(time) if time.full_name() == "google.protobuf.Timestamp" => {
            json!({ "type": "string", "format": "date-time" })
        }
        Kind::String | Kind::Enum(_) => json!({ "type": "string" }),
        _ => json!({ "type": "integer" }),
    };
    let schema = if field.is_list() { json!({ "type": "array", "items": schema }) } else { schema };
    let comments = Comments::of(&field.parent_message().parent_file());
    json!({ "name": field.json_name(), "in": "query", "description": comments.line(field.path()), "schema": schema })
}

fn lower_first(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map(|first| first.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

/// The schemas of all messages that answers are made of.
#[derive(Default)]
struct Schemas {
    made: BTreeMap<String, Value>,
    wanted: VecDeque<MessageDescriptor>,
    comments: HashMap<String, Comments>,
}

impl Schemas {
    fn want(&mut self, message: &MessageDescriptor) {
        self.wanted.push_back(message.clone());
    }

    fn all(mut self) -> BTreeMap<String, Value> {
        while let Some(message) = self.wanted.pop_front() {
            let name = local_name(message.full_name());
            if !self.made.contains_key(&name) {
                let schema = self.of_message(&message);
                self.made.insert(name, schema);
            }
        }
        self.made
    }

    fn comment(&mut self, file: &prost_reflect::FileDescriptor, path: &[i32]) -> String {
        let comments = self.comments.entry(file.name().to_owned()).or_insert_with(|| Comments::of(file));
        comments.line(path)
    }

    fn of_message(&mut self, message: &MessageDescriptor) -> Value {
        let mut properties = Map::new();
        let mut required = Vec::new();
        for field in message.fields() {
            let mut schema = self.of_field(&field);
            schema["description"] = self.comment(&message.parent_file(), field.path()).into();
            // What has no presence is always written, at its default as well.
            if field.is_list() || !field.supports_presence() {
                required.push(field.json_name().to_owned());
            }
            properties.insert(field.json_name().to_owned(), schema);
        }
        let description = self.comment(&message.parent_file(), message.path());
        json!({ "type": "object", "description": description, "properties": properties, "required": required })
    }

    fn of_field(&mut self, field: &FieldDescriptor) -> Value {
        if field.is_map() {
            let Kind::Message(entry) = field.kind() else { unreachable!("a map is of entries") };
            let values = self.of_kind(&entry.map_entry_value_field().kind());
            return json!({ "type": "object", "additionalProperties": values });
        }
        let one = self.of_kind(&field.kind());
        if field.is_list() { json!({ "type": "array", "items": one }) } else { one }
    }

    fn of_kind(&mut self, kind: &Kind) -> Value {
        match kind {
            Kind::Bool => json!({ "type": "boolean" }),
            Kind::Int32 | Kind::Sint32 | Kind::Sfixed32 => json!({ "type": "integer", "format": "int32" }),
            Kind::Uint32 | Kind::Fixed32 => json!({ "type": "integer", "minimum": 0, "maximum": u32::MAX }),
            Kind::Int64 | Kind::Sint64 | Kind::Sfixed64 => json!({ "type": "string", "pattern": "^-?[0-9]+$" }),
            Kind::Uint64 | Kind::Fixed64 => json!({ "type": "string", "pattern": "^[0-9]+$" }),
            Kind::Float | Kind::Double => {
                json!({ "anyOf": [{ "type": "number" }, { "enum": ["NaN", "Infinity", "-Infinity"] }] })
            }
            Kind::String => json!({ "type": "string" }),
            Kind::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
            Kind::Enum(values) => of_enum(values),
            Kind::Message(message) => match message.full_name() {
                "google.protobuf.Timestamp" => json!({ "type": "string", "format": "date-time" }),
                "google.protobuf.Duration" => json!({ "type": "string" }),
                _ => {
                    self.want(message);
                    reference(&local_name(message.full_name()))
                }
            },
        }
    }
}

fn of_enum(values: &EnumDescriptor) -> Value {
    json!({ "type": "string", "enum": values.values().map(|value| value.name().to_owned()).collect::<Vec<_>>() })
}

fn local_name(full_name: &str) -> String {
    full_name.trim_start_matches(PACKAGE).trim_start_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every reference of a document.
    fn references(value: &Value, found: &mut Vec<String>) {
        match value {
            Value::Object(members) => {
                found.extend(members.get("$ref").and_then(Value::as_str).map(str::to_owned));
                members.values().for_each(|member| references(member, found));
            }
            Value::Array(members) => members.iter().for_each(|member| references(member, found)),
            _ => {}
        }
    }

    #[test]
    fn every_route_is_there_and_every_reference_leads_somewhere() {
        let document = document();
        assert_eq!(document["paths"].as_object().unwrap().len(), ROUTES.len());
        let mut found = Vec::new();
        references(&document, &mut found);
        assert!(found.len() > 100, "{}", found.len());
        for reference in found {
            let place = reference.strip_prefix('#').unwrap();
            assert!(document.pointer(place).is_some(), "{reference}");
        }
    }

    #[test]
    fn operations_say_what_is_sent_besides_the_body() {
        let document = document();
        let operation = |path: &str, method: &str| document["paths"][path][method].clone();
        for (path, item) in document["paths"].as_object().unwrap() {
            let is_tagged = path.starts_with("/v1/") && path != "/v1/stream";
            for method in ["get", "head"] {
                let responses = &item[method]["responses"];
                let has_tag = responses["200"]["headers"]["ETag"].is_object();
                let is_conditional = responses["304"]["headers"]["ETag"].is_object();
                assert_eq!((has_tag, is_conditional), (is_tagged, is_tagged), "{path}");
                assert_eq!(responses["200"]["content"].is_object(), method == "get", "{path}");
            }
        }
        let figures = &operation("/metrics", "get")["responses"]["200"]["content"];
        assert!(figures["text/plain"].is_object() && figures["application/openmetrics-text"].is_object());
        let stream = operation("/v1/stream", "get")["parameters"].to_string();
        assert!(stream.contains("LastEventId"), "{stream}");
    }

    #[test]
    fn a_schema_says_what_the_json_mapping_writes() {
        let document = document();
        let job = &document["components"]["schemas"]["Job"];
        assert_eq!(job["properties"]["programBytes"]["type"], "string");
        assert_eq!(job["properties"]["createTime"]["format"], "date-time");
        let required = job["required"].as_array().unwrap();
        assert!(required.contains(&"state".into()) && !required.contains(&"summary".into()));
        let list = &document["paths"]["/v1/jobs"]["get"]["parameters"];
        let names: Vec<_> =
            list.as_array().unwrap().iter().filter_map(|parameter| parameter["name"].as_str()).collect();
        assert_eq!(names, ["pageSize", "pageToken", "states", "machine", "createdFrom", "createdBefore"]);
    }
}
