//! The binary under test.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// Path of the `feedwave` binary, built from the sources as they are, in the profile of the caller.
///
/// Built once per process: cargo gives the path of a binary only to tests of its own package, and a binary that happens
/// to lie in the target directory may be an old one. A test asks for exactly what `cargo test --workspace` builds, with
/// the same features of every dependency, so that after it nothing is left to do.
///
/// # Panics
/// When the binary cannot be built.
pub fn feedwave_binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(build)
}

fn build() -> PathBuf {
    let what: &[&str] = if cfg!(debug_assertions) {
        &["test", "--workspace", "--no-run"]
    } else {
        &["build", "--release", "--package", "feedwave", "--bin", "feedwave"]
    };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(what).arg("--message-format=json-render-diagnostics");
    // A test is told of its own package this way; build scripts that look there would run anew.
    for (name, _) in std::env::vars_os() {
        let name = name.to_string_lossy();
        if name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_") {
            cargo.env_remove(&*name);
        }
    }
    // Where the caller was built, whichever way that was chosen.
    let me = std::env::current_exe().expect("a test knows its own path");
    let profile_dir = me.ancestors().find(|dir| dir.ends_with("debug") || dir.ends_with("release"));
    cargo.arg("--target-dir").arg(profile_dir.and_then(Path::parent).expect("cargo's layout of the target directory"));
    let output = cargo
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .stderr(Stdio::inherit())
        .output()
        .expect("cargo can be started");
    assert!(output.status.success(), "the binary does not build");
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["target"]["name"] == "feedwave" && message["target"]["kind"][0] == "bin")
        // The unit tests of the binary are an executable too.
        .filter(|message| message["profile"]["test"] == false)
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
        .expect("cargo names the binary")
}
