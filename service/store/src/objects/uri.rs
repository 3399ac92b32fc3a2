//! Where objects are kept: a URI whose scheme chooses the object store.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use object_store::ObjectStoreScheme;
use serde::{Deserialize, Serialize};
use url::Url;

/// Options that the query of a URI of each scheme may have, by their names in `object_store`. What is secret is none of them.
const OPTIONS: [(&str, &[&str]); 5] = [
    ("file", &[]),
    (
        "s3",
        &[
            "endpoint",
            "region",
            "virtual_hosted_style_request",
            "server_side_encryption",
            "sse_kms_key_id",
            "allow_http",
            "skip_signature",
            "timeout",
        ],
    ),
    ("az", AZURE),
    ("abfss", AZURE),
    // It asks for a token before it writes, whatever skip_signature says.
    ("gs", &["base_url", "allow_http", "timeout"]),
];
const AZURE: &[&str] = &["account_name", "endpoint", "allow_http", "skip_signature", "timeout"];

/// Where large programs are kept. The scheme chooses the object store:
///
/// | URI | object store |
/// | --- | --- |
/// | `file:///absolute/path` | this folder, which exists and which every replica sees |
/// | `s3://bucket/prefix` | S3 and what speaks its protocol |
/// | `az://container/prefix`, `abfss://container@account.dfs.core.windows.net/prefix` | Azure Blob Storage |
/// | `gs://bucket/prefix` | Google Cloud Storage |
///
/// Options follow as in `s3://programs?endpoint=https://minio.plant.example:9000&region=plant`: `endpoint`, `region`,
/// `virtual_hosted_style_request`, `server_side_encryption` and `sse_kms_key_id` of S3, `account_name` and `endpoint` of Azure,
/// `base_url` of Google, `skip_signature` (asks without credentials) of S3 and Azure, and of each `allow_http` and `timeout` (of one
/// request, as in `30s`, which is the default). Credentials are none of them: they come from the environment
/// in the way of each object store (`AWS_*`, `AZURE_*`, `GOOGLE_*`, and the files that these name).
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ObjectsUri(Url);

/// Why a text is not the URI of an object store. The message never repeats the text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InvalidObjectsUri(String);

impl ObjectsUri {
    /// A URI as it may be.
    pub const EXAMPLE: &str = "s3://bucket/prefix";

    pub(super) const fn url(&self) -> &Url {
        &self.0
    }

    /// The folder, where it is one.
    pub(super) fn folder(&self) -> Option<PathBuf> {
        if self.0.scheme() == "file" { self.0.to_file_path().ok() } else { None }
    }
}

impl FromStr for ObjectsUri {
    type Err = InvalidObjectsUri;

    fn from_str(text: &str) -> Result<Self, InvalidObjectsUri> {
        let invalid = |reason: String| InvalidObjectsUri(reason);
        let example = Self::EXAMPLE;
        let url = Url::parse(text).map_err(|error| invalid(format!("it is no URI as in {example}: {error}")))?;
        let scheme = url.scheme();
        if url.password().is_some() || (!url.username().is_empty() && !scheme.starts_with("abfs")) {
            return Err(invalid("credentials are not part of it: they come from the environment".into()));
        }
        if url.fragment().is_some() {
            return Err(invalid("it has no fragment".into()));
        }
        let options = OPTIONS.iter().find(|(known, _)| *known == scheme).map(|(_, options)| *options);
        let mut place = url.clone();
        place.set_query(None);
        let Some(options) = options.filter(|_| ObjectStoreScheme::parse(&place).is_ok()) else {
            return Err(invalid(format!("it begins with file:///, s3://, az://, abfss:// or gs://, as in {example}")));
        };
        if scheme == "file" && (url.path() == "/" || url.query().is_some() || url.to_file_path().is_err()) {
            return Err(invalid("file:// is followed by the absolute path of a folder, and by no options".into()));
        }
        for (option, _) in url.query_pairs() {
            if !options.contains(&&*option) {
                return Err(invalid(format!("it has an option that is none of {}", options.join(", "))));
            }
        }
        Ok(Self(url))
    }
}

impl TryFrom<String> for ObjectsUri {
    type Error = InvalidObjectsUri;

    fn try_from(text: String) -> Result<Self, InvalidObjectsUri> {
        text.parse()
    }
}

impl From<ObjectsUri> for String {
    fn from(uri: ObjectsUri) -> Self {
        uri.0.into()
    }
}

impl fmt::Display for ObjectsUri {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::ObjectsUri;

    #[test]
    fn a_uri_names_an_object_store_and_no_secret() {
        for text in [
            "file:///var/lib/feedwave/objects",
            "s3://bucket",
            "s3://bucket/a/b?endpoint=http://127.0.0.1:9000&allow_http=true&region=plant",
            "az://container/a?account_name=plant",
            "abfss://container@account.dfs.core.windows.net/a",
            "gs://bucket/a",
        ] {
            assert_eq!(text.parse::<ObjectsUri>().expect(text).to_string(), text);
        }
        for (text, says) in [
            ("", "no URI"),
            ("objects", "no URI"),
            ("memory:///", "begins with"),
            ("https://plant.example/a", "begins with"),
            ("file:///", "absolute path"),
            ("file://folder/a", "begins with"),
            ("file:///a?region=b", "no options"),
            ("s3:///a", "begins with"),
            ("s3://key:secret@bucket/a", "credentials"),
            ("s3://key@bucket/a", "credentials"),
            ("s3://bucket?secret_access_key=secret", "none of endpoint"),
            ("s3://bucket?account_name=plant", "none of endpoint, region"),
            ("gs://bucket?region=plant", "none of base_url"),
            ("gs://bucket?skip_signature=true", "none of base_url"),
            ("s3://bucket/a#b", "fragment"),
        ] {
            let error = text.parse::<ObjectsUri>().expect_err(text).to_string();
            assert!(error.contains(says) && !error.contains("secret@"), "{text}: {error}");
        }
    }
}
