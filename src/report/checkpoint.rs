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
use super::listing::Listing;
use super::{CheckpointUnfit as Unfit, Refused};
use crate::error::Result;
use crate::output::{Failed, TableMark, checksum, replace};
use crate::runner;
use crate::scene::{Scene, bytes_of};
use crate::step::Platform;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// First bytes of each checkpoint.
const MAGIC: &[u8; 16] = b"cutis checkpoint";
/// Format version; a program reads only the one that it writes.
const VERSION: u32 = 13;
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
    platform: String,
}

/// Identity of a run's checkpoints.
pub(super) fn identity(scene: &Scene, platform: &Platform) -> Identity {
    let nameless = Scene { file: PathBuf::new(), lines: Default::default(), ..scene.clone() };
    let scene_sum = checksum(format!("{nameless:?}").as_bytes());
    Identity { title: scene.title.clone(), scene: scene_sum, platform: platform.backend_and_precision().join(" ") }
}

/// Writes a checkpoint to its folder, replacing the last one.
pub(super) fn write(checkpoint: &Checkpoint, listing: &mut Listing) -> Result<()> {
    let path = listing.add(CHECKPOINT)?;
    let failed = |e: postcard::Error| Failed::Write { path: path.clone(), source: std::io::Error::other(e) };
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
/// [`Refused::Checkpoint`] for a file that is no checkpoint, is damaged, of another version, scene or backend, or of more than `steps` steps.
/// One of as many is of a run that was killed after its last step, and lacks its report.
pub(super) fn read(path: &Path, scene: &Scene, platform: &Platform, steps: u32) -> Result<Checkpoint> {
    let refused = |unfit| Refused::Checkpoint { path: path.to_owned(), unfit };
    let file = bytes_of(path).map_err(|source| refused(Unfit::Unread { source }))?;
    let checkpoint: Checkpoint = unpack(&file).map_err(refused)?;
    let done = checkpoint.runner.steps();
    let (found, wanted) = (&checkpoint.identity, identity(scene, platform));
    let unfit = if found.platform != wanted.platform {
        Unfit::Platform { found: found.platform.clone(), wanted: wanted.platform }
    } else if *found != wanted {
        Unfit::Scene { title: found.title.clone() }
    } else if done > steps {
        Unfit::Over { done, steps }
    } else {
        return Ok(checkpoint);
    };
    Err(refused(unfit).into())
}

/// Checkpoint in a file's bytes, or why it cannot be used.
fn unpack(file: &[u8]) -> std::result::Result<Checkpoint, Unfit> {
    if !file.starts_with(MAGIC) {
        return Err(Unfit::Strange);
    }
    let cut_off = || Unfit::CutOff { bytes: file.len() };
    let field = |from: usize, bytes: usize| {
        let slice = file.get(from..from + bytes).ok_or_else(cut_off)?;
        Ok(slice.iter().rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte)))
    };
    let version = field(MAGIC.len(), 4)?;
    if version != u64::from(VERSION) {
        return Err(Unfit::Format { found: version, wanted: u64::from(VERSION) });
    }
    let (length, sum) = (field(MAGIC.len() + 4, 8)?, field(MAGIC.len() + 12, 8)?);
    let bytes = file.get(HEADER..).ok_or_else(cut_off)?;
    if (bytes.len() as u64) < length {
        return Err(cut_off());
    }
    if bytes.len() as u64 > length || checksum(bytes) != sum {
        return Err(Unfit::Damaged);
    }
    postcard::from_bytes(bytes).map_err(|_| Unfit::Damaged)
}
