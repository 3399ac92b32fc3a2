//! Compiles the contract in `proto/` with a protobuf compiler written in Rust, so that building needs no system
//! package. The descriptor set keeps the comments; it feeds reflection and the JSON mapping.

#[path = "build/lines.rs"]
mod lines;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new("../../proto");
    let package = root.join("feedwave/v1");
    println!("cargo:rerun-if-changed={}", root.display());

    let mut files: Vec<PathBuf> =
        fs::read_dir(&package)?.map(|entry| Ok(entry?.path())).collect::<Result<_, std::io::Error>>()?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "proto"));
    files.sort();

    let mut compiler = protox::Compiler::new([root])?;
    compiler.include_imports(true).include_source_info(true).open_files(files)?;

    // The compiler's own encoding keeps what reflection clients may ask for and the typed set would lose.
    let out_dir = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out_dir.join("feedwave_descriptor.bin"), compiler.encode_file_descriptor_set())?;

    let descriptors = compiler.file_descriptor_set();
    assert!(descriptors.encoded_len() > 0, "the contract is empty");
    fs::write(out_dir.join("lines.rs"), lines::generate(&descriptors)?)?;
    let mut config = tonic_prost_build::Config::new();
    // The JSON mapping finds a message's descriptor by its name.
    config.enable_type_names();
    let services = env::var_os("CARGO_FEATURE_SERVICES").is_some();
    let generator = tonic_prost_build::configure().build_client(services).build_server(services);
    let generator = generator.codec_path("crate::codec::AccountedCodec");
    generator.bytes(".").compile_fds_with_config(descriptors, config)?;
    Ok(())
}
