//! Document URIs as editors write them: what RFC 3986 does not permit in one, such as a `%` that encodes nothing, is encoded on the way
//! in, and written as the editor has it on the way out.

use std::collections::HashMap;

use serde_json::Value;

/// How the editor writes the open documents whose URIs are none, by what they are called here.
#[derive(Debug, Default)]
pub(super) struct Uris {
    written: HashMap<String, String>,
}

impl Uris {
    /// Encodes every URI of a message; with `opens` they are remembered until they are [forgotten](Uris::forget).
    pub(super) fn take_in(&mut self, message: &mut Value, opens: bool) {
        match message {
            Value::Object(fields) => {
                for (name, value) in fields {
                    match value {
                        Value::String(uri) if matches!(name.as_str(), "uri" | "rootUri") => {
                            let Some(encoded) = encoded(uri) else { continue };
                            let written = std::mem::replace(uri, encoded.clone());
                            if opens {
                                self.written.insert(encoded, written);
                            }
                        }
                        value => self.take_in(value, opens),
                    }
                }
            }
            Value::Array(values) => values.iter_mut().for_each(|value| self.take_in(value, opens)),
            _ => {}
        }
    }

    /// Writes the URIs of a message as the editor does.
    pub(super) fn give_out(&self, message: &mut Value) {
        match message {
            _ if self.written.is_empty() => {}
            Value::String(text) => {
                if let Some(written) = self.written.get(text) {
                    text.clone_from(written);
                }
            }
            Value::Array(values) => values.iter_mut().for_each(|value| self.give_out(value)),
            Value::Object(fields) => {
                // Edits have them as names.
                let named: Vec<String> =
                    fields.keys().filter(|name| self.written.contains_key(*name)).cloned().collect();
                for name in named {
                    let value = fields.remove(&name).unwrap_or_default();
                    fields.insert(self.written[&name].clone(), value);
                }
                fields.values_mut().for_each(|value| self.give_out(value));
            }
            _ => {}
        }
    }

    /// A document is closed.
    pub(super) fn forget(&mut self, uri: &str) {
        self.written.remove(uri);
    }
}

/// A URI with everything encoded that cannot be in one; `None` where that is nothing.
fn encoded(uri: &str) -> Option<String> {
    let bytes = uri.as_bytes();
    let is_hex = |place: usize| bytes.get(place).is_some_and(u8::is_ascii_hexdigit);
    let mut encoded = String::with_capacity(uri.len());
    for (place, &byte) in bytes.iter().enumerate() {
        let is_permitted = match byte {
            b'%' => is_hex(place + 1) && is_hex(place + 2),
            byte => byte.is_ascii_alphanumeric() || b"-._~:/?#[]@!$&'()*+,;=".contains(&byte),
        };
        if is_permitted {
            encoded.push(char::from(byte));
        } else {
            encoded.push_str(&format!("%{byte:02X}"));
        }
    }
    (encoded != uri).then_some(encoded)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_no_uri_is_encoded_and_written_back() {
        assert_eq!(encoded("file:///a/50%25.nc"), None);
        for (uri, expected) in [
            ("file:///a/100%.nc", "file:///a/100%25.nc"),
            ("file:///a/5%G.nc", "file:///a/5%25G.nc"),
            ("file:///a b/ü%41.nc", "file:///a%20b/%C3%BC%41.nc"),
        ] {
            assert_eq!(encoded(uri).as_deref(), Some(expected));
        }
        let mut uris = Uris::default();
        let mut opened = json!({ "textDocument": { "uri": "file:///100%.nc", "text": "100%" } });
        uris.take_in(&mut opened, true);
        assert_eq!(opened, json!({ "textDocument": { "uri": "file:///100%25.nc", "text": "100%" } }));
        let answer = json!({ "uri": "file:///100%25.nc", "changes": { "file:///100%25.nc": [1] } });
        let (mut first, mut second) = (answer.clone(), answer.clone());
        uris.give_out(&mut first);
        assert_eq!(first, json!({ "uri": "file:///100%.nc", "changes": { "file:///100%.nc": [1] } }));
        uris.forget("file:///100%25.nc");
        uris.give_out(&mut second);
        assert_eq!(second, answer);
    }
}
