//! `tricurve rehydrate`: a proof becomes the full recording it stands for.

use std::fs;
use std::path::{Path, PathBuf};

use messages::recording::{Recording, count_parts, part_path};
use record::WriteError;
use serde::Serialize;

use super::proof::{Rehydrated, Wanted, rehydrate};
use crate::cli::Rehydrate as Args;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let proof = Recording::open(&args.file).map_err(Failure::failed)?;
    let name = args.file.display();
    if !proof.is_proof() {
        return Err(Failure::usage(format!(
            "{name} is no proof: there are no digests in it, and it holds what it was recorded with"
        )));
    }
    let output = std::path::absolute(&args.output.output).map_err(Failure::failed)?;
    let old = record::Writer::check(&output, args.output.force).map_err(|error| match error {
        WriteError::Exists(_) => Failure::usage(error),
        error => Failure::failed(error),
    })?;
    let read: Vec<PathBuf> = proof.parts.iter().map(|part| part.path.clone()).collect();
    let written = old.iter().map(PathBuf::as_path).chain([&*output]);
    if let Some(both) = record::read_and_written(&read, written) {
        return Err(Failure::usage(format!(
            "{} is read and cannot be written too; choose another name",
            both.display()
        )));
    }
    drop(proof);
    let aside = Aside::of(&output)?;
    let Rehydrated { scans, is_less } = rehydrate(&Wanted {
        file: &args.file,
        scans: args.scans,
        without: &[],
        output: &aside.path,
        is_quiet: args.output.json,
    })
    .map_err(|failure| Failure {
        text: format!("{name}: {}", failure.text),
        ..failure
    })?;
    let parts = aside.move_to(&output, &old)?;
    let bytes = parts.iter().filter_map(|part| fs::metadata(part).ok());
    let report = Report {
        scans,
        bytes: bytes.map(|file| file.len()).sum(),
        parts,
    };
    match args.output.json {
        true => super::print_json(&report)?,
        false => super::print(&report.text())?,
    }
    Ok(match is_less {
        true => Outcome::Lost,
        false => Outcome::Done,
    })
}

/// What came of it.
#[derive(Debug, Serialize)]
struct Report {
    /// Scans of which every message is what was recorded.
    scans: u64,
    bytes: u64,
    parts: Vec<PathBuf>,
}

impl Report {
    fn text(&self) -> String {
        let scans = match self.scans {
            1 => "1 scan".to_owned(),
            scans => format!("{scans} scans"),
        };
        let parts = self
            .parts
            .iter()
            .map(|part| format!("{}\n", part.display()));
        format!(
            "{scans} computed anew, every digest is the recorded one: {:.1} MB\n{}",
            self.bytes as f64 / 1e6,
            parts.collect::<String>()
        )
    }
}

/// A hidden folder beside the recording to be, in which it lies until it is whole.
struct Aside {
    folder: PathBuf,
    path: PathBuf,
}

impl Aside {
    fn of(output: &Path) -> Result<Self, Failure> {
        let name = output.file_name().unwrap_or_default().to_string_lossy();
        let folder = output.with_file_name(format!(".{name}.part"));
        let cannot = |error| Failure::failed(format!("cannot write {}: {error}", folder.display()));
        // What one that was killed left.
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(cannot)?;
        }
        fs::create_dir(&folder).map_err(cannot)?;
        Ok(Self {
            path: folder.join(&*name),
            folder,
        })
    }

    /// Puts all parts in their places, where others lay.
    fn move_to(&self, output: &Path, old: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
        let cannot = |error| Failure::failed(format!("cannot write {}: {error}", output.display()));
        for old in old {
            fs::remove_file(old).map_err(cannot)?;
        }
        let mut parts = Vec::new();
        // The first comes last: without it the others are no recording.
        for number in (0..count_parts(&self.path)).rev() {
            let part = part_path(output, number);
            fs::rename(part_path(&self.path, number), &part).map_err(cannot)?;
            parts.insert(0, part);
        }
        Ok(parts)
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.folder).unwrap_or_default();
    }
}
