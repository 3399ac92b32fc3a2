//! `docs/api.md`: services, messages and enums of the contract with their comments.

use std::fmt::Write;

use feedwave_contract::comments::Comments;
use feedwave_contract::openapi::query_fields;
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_contract::routes::{Body, ROUTES};
use prost_reflect::{Cardinality, EnumDescriptor, FieldDescriptor, FileDescriptor, Kind, MessageDescriptor};

const PACKAGE: &str = "feedwave.v1";

const HEAD: &str = "# The contract

Services, messages and enums of `feedwave.v1`, file by file as in `proto/feedwave/v1`. In JSON, fields have their names in
lowerCamelCase, enums their values' names, and 64-bit integers are strings (the protobuf JSON mapping); the names given here are
accepted too. Answers have every field that is neither a message nor *optional*, at its default as well; requests and files may leave
out what is at its default. An *optional* field distinguishes \"not set\" from 0. The HTTP answers for
dashboards are messages of this page, and so are the requests whose fields are their parameters.

";

const ROUTES_HEAD: &str = "
## HTTP

The port for dashboards, Prometheus, probes and the page (`http.listen`, 8080 where nothing else is configured). Every route of the table
is only read, by GET and HEAD. Parameters are the fields of a request by their names in JSON; under `/v1` an unknown one is refused, elsewhere
parameters mean nothing. Errors are `google.rpc.Status` in JSON with the fitting status code and the details of the services. Answers under `/v1` but the stream have an entity tag: with `If-None-Match` what has not
changed is answered by 304. `/v1/openapi.json` says the same for machines. Besides, the port answers the methods that its
[page](shop-floor.md#the-page) calls, by gRPC-Web: with `CreateJob` and `UploadProgram` of a planner they create jobs and programs.

| path | parameters | answer | |
| --- | --- | --- | --- |
";

/// The whole page.
pub fn page() -> String {
    let mut page = HEAD.to_owned();
    let mut files: Vec<FileDescriptor> = DESCRIPTORS.files().filter(|file| file.package_name() == PACKAGE).collect();
    files.sort_by(|one, other| one.name().cmp(other.name()));
    for file in &files {
        let name = file_name(file);
        let _ = writeln!(page, "- [{name}](#{})", name.replace('.', ""));
    }
    page.push_str("- [HTTP](#http)\n");
    for file in &files {
        write_file(&mut page, file);
    }
    write_routes(&mut page);
    page
}

/// The routes of the HTTP port, from the table that registers them.
fn write_routes(page: &mut String) {
    page.push_str(ROUTES_HEAD);
    for entry in &ROUTES {
        let local = |name: &str| format!("{PACKAGE}.{name}");
        let parameters = entry.parameters.map_or_else(
            || "none".to_owned(),
            |request| {
                let request = DESCRIPTORS.get_message_by_name(&local(request)).expect("a message of the contract");
                let names: Vec<String> =
                    query_fields(&request).iter().map(|field| format!("`{}`", field.json_name())).collect();
                format!("{} of {}", names.join(", "), message_link(&request))
            },
        );
        let body = match entry.body {
            Body::Message(name) => link(&local(name)),
            Body::Text { what, .. } | Body::Json(what) => what.to_owned(),
        };
        let _ = writeln!(page, "| `{}` | {parameters} | {body} | {} |", entry.path, entry.purpose);
    }
}

fn file_name(file: &FileDescriptor) -> &str {
    file.name().rsplit('/').next().unwrap_or_default()
}

fn write_file(page: &mut String, file: &FileDescriptor) {
    let comments = Comments::of(file);
    let _ = write!(page, "\n## {}\n\n", file_name(file));
    // The comment of a file is that of its `syntax`.
    write_paragraphs(page, &comments, &[12]);
    for service in file.services() {
        let path = service.path().to_vec();
        let _ = write!(page, "\n### {}\n\n", service.name());
        write_paragraphs(page, &comments, &path);
        page.push_str("\n| method | request | answer | |\n| --- | --- | --- | --- |\n");
        for method in service.methods() {
            let side = |message: &MessageDescriptor, streams: bool| {
                format!("{}{}", if streams { "stream of " } else { "" }, message_link(message))
            };
            let _ = writeln!(
                page,
                "| `{}` | {} | {} | {} |",
                method.name(),
                side(&method.input(), method.is_client_streaming()),
                side(&method.output(), method.is_server_streaming()),
                cell(&comments, method.path())
            );
        }
    }
    file.messages().for_each(|message| write_message(page, &message, &comments));
    file.enums().for_each(|values| write_enum(page, &values, &comments));
}

fn write_message(page: &mut String, message: &MessageDescriptor, comments: &Comments) {
    if message.is_map_entry() {
        return;
    }
    let _ = write!(page, "\n### {}\n\n", local_name(message.full_name()));
    write_paragraphs(page, comments, message.path());
    if message.fields().len() > 0 {
        page.push_str("\n| field | type | |\n| --- | --- | --- |\n");
    }
    for field in fields_as_written(message) {
        let one_of = field.containing_oneof().filter(|oneof| !oneof.is_synthetic());
        let one_of = one_of.map_or_else(String::new, |oneof| format!("One of `{}`. ", oneof.name()));
        let comment = cell(comments, field.path());
        let _ = writeln!(page, "| `{}` | {} | {one_of}{comment} |", field.name(), field_type(&field));
    }
    for oneof in message.oneofs().filter(|oneof| !oneof.is_synthetic()) {
        let comment = cell(comments, oneof.path());
        if !comment.is_empty() {
            let _ = write!(page, "\n`{}`: {comment}\n", oneof.name());
        }
    }
    message.child_messages().for_each(|message| write_message(page, &message, comments));
    message.child_enums().for_each(|values| write_enum(page, &values, comments));
}

/// In the order of the source.
fn fields_as_written(message: &MessageDescriptor) -> Vec<FieldDescriptor> {
    let mut fields: Vec<FieldDescriptor> = message.fields().collect();
    fields.sort_by(|one, other| one.path().cmp(other.path()));
    fields
}

fn write_enum(page: &mut String, values: &EnumDescriptor, comments: &Comments) {
    let _ = write!(page, "\n### {}\n\n", local_name(values.full_name()));
    write_paragraphs(page, comments, values.path());
    page.push_str("\n| value | |\n| --- | --- |\n");
    for value in values.values() {
        let _ = writeln!(page, "| `{}` = {} | {} |", value.name(), value.number(), cell(comments, value.path()));
    }
}

fn field_type(field: &FieldDescriptor) -> String {
    if field.is_map() {
        let Kind::Message(entry) = field.kind() else { unreachable!("a map is of entries") };
        return format!(
            "map of {} by {}",
            kind(&entry.map_entry_value_field().kind()),
            kind(&entry.map_entry_key_field().kind())
        );
    }
    let kind = kind(&field.kind());
    match field.cardinality() {
        Cardinality::Repeated => format!("repeated {kind}"),
        _ if field.field_descriptor_proto().proto3_optional() => format!("optional {kind}"),
        _ => kind,
    }
}

fn kind(kind: &Kind) -> String {
    match kind {
        Kind::Message(message) => message_link(message),
        Kind::Enum(values) => link(values.full_name()),
        other => format!("{other:?}").to_lowercase(),
    }
}

fn message_link(message: &MessageDescriptor) -> String {
    link(message.full_name())
}

/// A link on the page, or the whole name of what another package declares.
fn link(full_name: &str) -> String {
    match full_name.strip_prefix(PACKAGE) {
        Some(_) => {
            let name = local_name(full_name);
            format!("[{name}](#{})", name.to_lowercase().replace('.', ""))
        }
        None => format!("`{full_name}`"),
    }
}

fn local_name(full_name: &str) -> &str {
    full_name.strip_prefix(PACKAGE).map_or(full_name, |name| name.trim_start_matches('.'))
}

/// A comment as paragraphs.
fn write_paragraphs(page: &mut String, comments: &Comments, path: &[i32]) {
    let comment = comments.paragraphs(path);
    if !comment.is_empty() {
        let _ = writeln!(page, "{comment}");
    }
}

/// A comment in one line, for a table.
fn cell(comments: &Comments, path: &[i32]) -> String {
    comments.line(path).replace('|', "\\|")
}
