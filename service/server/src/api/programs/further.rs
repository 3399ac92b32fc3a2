//! Further program files of a request: checked, named as calls find them, and stored where a job is made of them.

use std::collections::BTreeMap;

use feedwave_contract::convert::{self, MAX_PROGRAM_FILES};
use feedwave_contract::names;
use feedwave_contract::proto::ProgramFile;
use feedwave_contract::proto::program_file::Source as FileSource;
use feedwave_store::ProgramId;

use super::program_id;
use crate::api::Api;
use crate::engine::{File, Source};
use crate::error::{Error, Result, Violations};

/// The identifier of a checked further file that is stored.
fn stored_id(file: &ProgramFile) -> Result<ProgramId> {
    match &file.source {
        Some(FileSource::Program(name)) => program_id("programs", name),
        _ => Err(Error::internal("a further file was neither accepted nor refused")),
    }
}

impl Api {
    /// Checks the further program files of a request that has `inline_bytes` beside them.
    pub(in crate::api) fn check_program_files(
        &self,
        violations: &mut Violations,
        field: &str,
        files: &[ProgramFile],
        inline_bytes: usize,
    ) {
        convert::check_file_names(violations, field, files.iter().map(|file| file.name.as_str()));
        let mut bytes = inline_bytes as u64;
        for (index, file) in files.iter().take(MAX_PROGRAM_FILES).enumerate() {
            let field = format!("{field}[{index}]");
            match &file.source {
                Some(FileSource::InlineProgram(program)) => {
                    bytes += program.len() as u64;
                    if file.name.is_empty() {
                        violations.add(format!("{field}.name"), "must be set for an inline program");
                    }
                }
                Some(FileSource::Program(name)) => {
                    violations.check(format!("{field}.program"), names::parse_program::<ProgramId>(name));
                }
                None => violations.add(format!("{field}.source"), "inline_program or program must be set"),
            }
        }
        let limit = self.limits.inline_program_bytes;
        if bytes > limit && !files.is_empty() {
            let reason =
                format!("have {bytes} bytes inline with the program, more than the {limit} allowed; upload them");
            violations.add(field, reason);
        }
    }

    /// The bytes of a program with its checked further files, and those files with the names by which calls find them.
    pub(in crate::api) async fn sources(&self, own: File, files: &[ProgramFile]) -> Result<(Source, Vec<ProgramFile>)> {
        let mut all = vec![own];
        let mut named = self.named_files(files).await?;
        for file in &mut named {
            all.push(match &file.source {
                Some(FileSource::InlineProgram(program)) => File::Memory(program.clone()),
                _ => {
                    let own = stored_id(file)?.of_tenant(self.caller.tenant());
                    File::stored(self.store.of_all_tenants().clone(), own)
                }
            });
            // Only the names are needed further on.
            file.source = None;
        }
        Ok((Source::new(all), named))
    }

    /// Checked further files, with the names of their uploads where they state none; those that are stored are there.
    pub(in crate::api) async fn named_files(&self, files: &[ProgramFile]) -> Result<Vec<ProgramFile>> {
        let mut violations = Violations::default();
        let mut named: Vec<ProgramFile> = files.to_vec();
        for (index, file) in named.iter_mut().enumerate() {
            if let Some(FileSource::Program(_)) = &file.source {
                let entry = self.store.program_entry(stored_id(file)?).await?;
                if file.name.is_empty() {
                    file.name = entry.file_name;
                }
            }
            if file.name.is_empty() {
                violations.add(format!("programs[{index}].name"), "must be set: its upload had no file name");
            }
        }
        let mut seen = BTreeMap::new();
        for (index, file) in named.iter().enumerate().filter(|(_, file)| !file.name.is_empty()) {
            if let Some(first) = seen.insert(file.name.to_lowercase(), index) {
                violations.add(format!("programs[{index}].name"), format!("is that of file {first} too"));
            }
        }
        violations.finish()?;
        Ok(named)
    }

    /// Stores the inline ones of checked further files; all of them as references, and their identifiers.
    pub(in crate::api) async fn store_files(
        &self,
        files: &[ProgramFile],
    ) -> Result<(Vec<ProgramFile>, Vec<ProgramId>)> {
        let mut named = self.named_files(files).await?;
        let mut ids = Vec::with_capacity(named.len());
        for file in &mut named {
            let id = match &file.source {
                Some(FileSource::InlineProgram(program)) => self.store.put_program(program.clone()).await?.id,
                _ => stored_id(file)?,
            };
            file.source = Some(FileSource::Program(names::program(id)));
            ids.push(id);
        }
        Ok((named, ids))
    }
}
