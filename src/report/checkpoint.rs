//! Checkpoints, from which a run can be resumed: `checkpoint.bin` in its folder, replaced atomically.
//!
//! ```text
//! "cutis checkpoint" · version u32 · bytes u64 · checksum u64 · the bytes: a Checkpoint in postcard's format; little-endian
//! ```
//! A resumed run ends with the same tables, files and report (except for timings) as an uninterrupted one, given the same options,
//! including `--steps`: pictures are distributed over all steps, and the last step is checked in f64. A GPU reproduces its bits on the same
//! adapter only.

use super::collect::Collected;
use super::files::{CHECKPOINT, Written};
use crate::error::{Error, Result};
use crate::output::{TableMark, checksum, replace};
use crate::runner;
use crate::scene::Scene;
use crate::step::Place;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// First bytes of each checkpoint.
const MAGIC: &[u8; 16] = b"cutis checkpoint";
/// Format version; a program reads only the one that it writes.
const VERSION: u32 = 1;
/// Bytes before the checkpoint itself.
const HEADER: usize = MAGIC.len() + 4 + 8 + 8;

/// Content of the file.
#[derive(Serialize, Deserialize)]
pub(super) struct Checkpoint {
    pub identity: Identity,
    pub runner: runner::State,
    pub collected: Collected,
    pub files: Written,
    /// Mark of `haptic.csv`; `None` without haptic devices.
    pub ticks: Option<TableMark>,
    /// Probes of the last step.
    pub last: Vec<f64>,
}

/// Identity of the run that a checkpoint belongs to.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Identity {
    /// Title, for messages.
    title: String,
    /// Checksum of the scene's content, without its file name.
    scene: u64,
    /// `cpu f64`, `cpu f32` or `gpu f32`.
    place: String,
}

/// Identity of a run's checkpoints.
pub(super) fn identity(scene: &Scene, place: &Place) -> Identity {
    let nameless = Scene { file: PathBuf::new(), ..scene.clone() };
    let scene_sum = checksum(format!("{nameless:?}").as_bytes());
    Identity { title: scene.title.clone(), scene: scene_sum, place: place.words().join(" ") }
}

/// Writes a checkpoint to a folder, replacing the last one.
pub(super) fn write(checkpoint: &Checkpoint, folder: &Path) -> Result<()> {
    let path = folder.join(CHECKPOINT);
    let failed = |e: postcard::Error| Error::Write { path: path.clone(), source: std::io::Error::other(e) };
    let bytes = postcard::to_stdvec(checkpoint).map_err(failed)?;
    let mut file = Vec::with_capacity(HEADER + bytes.len());
    file.extend_from_slice(MAGIC);
    file.extend_from_slice(&VERSION.to_le_bytes());
    file.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
    file.extend_from_slice(&checksum(&bytes).to_le_bytes());
    file.extend_from_slice(&bytes);
    replace(&path, &file)
}

/// Reads a checkpoint for a run of this scene on this backend with `steps` steps in total.
///
/// # Errors
/// [`Error::Checkpoint`] for a file that is none, is damaged, of another version, of another scene or place, or of a run that is over.
pub(super) fn read(path: &Path, scene: &Scene, place: &Place, steps: u32) -> Result<Checkpoint> {
    let refused = |what: String, fix: &'static str| Error::Checkpoint { path: path.to_owned(), what, fix };
    let file = std::fs::read(path).map_err(|e| {
        refused(
            format!("cannot be read ({e})"),
            "give the checkpoint.bin that a run with --checkpoint has left in its folder",
        )
    })?;
    let checkpoint: Checkpoint = unpack(&file).map_err(|(what, fix)| refused(what, fix))?;
    let (found, wanted) = (&checkpoint.identity, identity(scene, place));
    if found.place != wanted.place {
        return Err(refused(
            format!("is of a run on {}, and this one is on {}", found.place, wanted.place),
            "take the same --backend and --precision",
        ));
    }
    if *found != wanted {
        return Err(refused(
            format!("is of the scene \"{}\" as it was then, which is not the one that is to be run", found.title),
            "resume with the same scene, meshes and trajectories and the same options, or run from the start",
        ));
    }
    if checkpoint.runner.steps() >= steps {
        return Err(refused(
            format!("was written after step {}, and {steps} steps are asked for", checkpoint.runner.steps()),
            "ask for more --steps, or run from the start",
        ));
    }
    Ok(checkpoint)
}

/// What a file's bytes hold, or what is wrong with them and what to do.
fn unpack(file: &[u8]) -> std::result::Result<Checkpoint, (String, &'static str)> {
    const AGAIN: &str = "take an older one, or run from the start";
    if !file.starts_with(MAGIC) {
        return Err((
            "is no checkpoint of cutis".into(),
            "give the checkpoint.bin that a run with --checkpoint has left",
        ));
    }
    let cut_off = || (format!("is cut off after {} bytes", file.len()), AGAIN);
    let field = |from: usize, bytes: usize| {
        let slice = file.get(from..from + bytes).ok_or_else(cut_off)?;
        Ok(slice.iter().rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte)))
    };
    let version = field(MAGIC.len(), 4)?;
    if version != u64::from(VERSION) {
        let age = if version > u64::from(VERSION) { "a newer" } else { "an older" };
        return Err((
            format!("is of {age} program (format {version}; this one reads {VERSION})"),
            "resume with the program that wrote it, or run from the start",
        ));
    }
    let (length, sum) = (field(MAGIC.len() + 4, 8)?, field(MAGIC.len() + 12, 8)?);
    let bytes = file.get(HEADER..).ok_or_else(cut_off)?;
    if (bytes.len() as u64) < length {
        return Err(cut_off());
    }
    let damaged = || ("is damaged: its checksum is not that of its bytes".to_string(), AGAIN);
    if bytes.len() as u64 > length || checksum(bytes) != sum {
        return Err(damaged());
    }
    postcard::from_bytes(bytes).map_err(|_| damaged())
}
