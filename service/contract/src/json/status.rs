//! Errors of calls as JSON.

use std::sync::LazyLock;

use prost::Message as _;
use prost_reflect::{DescriptorPool, DynamicMessage, SerializeOptions};

/// A message of any schema as JSON; see [`super::to_string`].
fn dynamic_to_string(dynamic: &DynamicMessage) -> String {
    let mut json = serde_json::Serializer::new(Vec::new());
    let options = SerializeOptions::new().skip_default_fields(false);
    dynamic.serialize_with_options(&mut json, &options).expect("writing into memory does not fail");
    String::from_utf8(json.into_inner()).expect("JSON is UTF-8")
}

/// The `google.rpc.Status` of an error as JSON, with its details.
#[must_use]
pub fn status_to_string(status: &tonic::Status) -> String {
    static RPC_DESCRIPTORS: LazyLock<DescriptorPool> = LazyLock::new(|| {
        DescriptorPool::decode(tonic_types::pb::FILE_DESCRIPTOR_SET).expect("the descriptors of google.rpc are valid")
    });

    let descriptor = RPC_DESCRIPTORS.get_message_by_name("google.rpc.Status").expect("it is in its own set");
    let bytes = if status.details().is_empty() {
        let plain = tonic_types::pb::Status {
            code: status.code() as i32,
            message: status.message().to_owned(),
            details: Vec::new(),
        };
        plain.encode_to_vec().into()
    } else {
        bytes::Bytes::copy_from_slice(status.details())
    };
    match DynamicMessage::decode(descriptor, bytes) {
        Ok(dynamic) => dynamic_to_string(&dynamic),
        Err(_) => serde_json::json!({ "code": status.code() as i32, "message": status.message() }).to_string(),
    }
}
