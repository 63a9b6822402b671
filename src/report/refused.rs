//! Errors of runs, comparisons and studies.

use crate::scene::Scene;
use std::io;
use std::path::PathBuf;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Number of steps that leaves no run or no checkpoint.
    #[error(
        "a run of 0 steps, or a checkpoint after every 0 steps; ask for at least one step, or for at least half a step of time"
    )]
    NoSteps,

    /// Scene that does not fit into memory.
    #[error(
        "{at}: the scene needs {:.1} GB of memory at least, and {:.1} GB are free; lower {key}, or close what takes memory",
        *wanted as f64 * 1e-9,
        *free as f64 * 1e-9
    )]
    Memory {
        /// Where.
        at: String,
        /// Bytes.
        wanted: u64,
        /// Bytes.
        free: u64,
        /// Key to lower.
        key: &'static str,
    },

    /// Case of a verification that does not fit into memory.
    #[error(
        "the case {case} needs {:.2} GB of memory at least, and {:.2} GB are free; close what takes memory, raise the limit that this \
         program runs under (ulimit -v, control group), or verify with --quick",
        *wanted as f64 * 1e-9,
        *free as f64 * 1e-9
    )]
    CaseMemory {
        /// Name of the case.
        case: &'static str,
        /// Bytes.
        wanted: u64,
        /// Bytes.
        free: u64,
    },

    /// Step too long for the wall clock.
    #[error(
        "{at}: steps of {step} s with --realtime; at most {most} s; take a shorter step_ms, or leave out --realtime"
    )]
    StepInRealTime {
        /// Where.
        at: String,
        /// s
        step: f64,
        /// s
        most: f64,
    },

    /// Two tools whose recordings have one name.
    #[error("two tools are recorded as {name}, which has _ for what is no letter, digit, - or _; rename one of them")]
    RecordingsAlike {
        /// Name of the file.
        name: String,
    },

    /// Checkpoint of a run by the wall clock.
    #[error(
        "a checkpoint of a run by the wall clock, whose hands do not wait; leave out --realtime, or --checkpoint and --resume"
    )]
    CheckpointInRealTime,

    /// Checkpoint of a run that records its devices: the recording could have gaps.
    #[error("a checkpoint of a run that records its devices; leave out --record, or --checkpoint and --resume")]
    CheckpointOfRecording,

    /// Checkpoint that a run cannot be resumed from.
    #[error("{}: the checkpoint {unfit}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        unfit: CheckpointUnfit,
    },

    /// Folder that another command writes to.
    #[error("{}: another run writes there; wait for its end, or choose another folder with --out", path.display())]
    Locked {
        /// The folder.
        path: PathBuf,
    },

    /// Something that this program has not written, under the name of a result.
    #[error(
        "{}: stands where a result goes, and is not on the folder's list of files that cutis has written (cutis-files.txt); move it away, or \
         choose another folder with --out",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },

    /// Folder without results of a run.
    #[error(
        "{}: no results of a run in it: {wanted} is looked for; make some with `cutis run --out {}`",
        path.display(),
        path.display()
    )]
    NoResults {
        /// The folder.
        path: PathBuf,
        /// What is looked for.
        wanted: &'static str,
    },

    /// Field that a saved mesh does not have.
    #[error(
        "{}: no field {name}; run the scene again with the field in its [output] (fields = [\"stress\"] for von Mises stress), or colour by \
         another one",
        path.display()
    )]
    NoField {
        /// The mesh.
        path: PathBuf,
        /// Name of the array.
        name: String,
    },

    /// Result that is damaged, or was not written by a run.
    #[error("{at}: {found} where {wanted} is wanted; draw a folder as `cutis run` has left it, or run the scene again")]
    Table {
        /// The file, with the line if there is one.
        at: String,
        /// What stands there.
        found: String,
        /// What is wanted.
        wanted: &'static str,
    },

    /// Check on an unknown key.
    #[error(
        "{at}: [check] names `{key}`, which is not a number of the report; name one of {known}, warnings.NAME or probes.NAME"
    )]
    UnknownCheck {
        /// Where.
        at: String,
        /// Key in the scene.
        key: String,
        /// Known keys, separated by commas.
        known: String,
    },

    /// Comparison of a scene that cannot run on a GPU.
    #[error(
        "a comparison of GPU and CPU path on a scene of rigid bodies alone, which the CPU moves; compare a scene with a `[skin]` or a \
         `[[block]]`"
    )]
    NothingToCompare,

    /// Scene that cannot be studied as asked.
    #[error("{}: {unfit}", path.display())]
    Study {
        /// The scene file.
        path: PathBuf,
        /// The reason.
        unfit: StudyUnfit,
    },

    /// Known answer that is read of a probe which its scene lacks.
    #[error("{}: no probe is called \"{name}\", which this case reads; name one of the scene's probes", path.display())]
    UnknownProbe {
        /// The scene file.
        path: PathBuf,
        /// Name of the probe.
        name: String,
    },

    /// Plot that cannot be drawn.
    #[error("{file} cannot be drawn ({message}); the tables (.csv) have the same numbers")]
    Plot {
        /// Name of the plot.
        file: &'static str,
        /// Message of the drawing library.
        message: String,
    },
}

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointUnfit {
    /// The file cannot be read.
    #[error("cannot be read ({source}); give the checkpoint.bin that a run with --checkpoint has left in its folder")]
    Unread {
        /// Reason given by the system.
        source: io::Error,
    },

    /// Not a checkpoint.
    #[error("is no checkpoint of cutis; give the checkpoint.bin that a run with --checkpoint has left")]
    Strange,

    /// Truncated.
    #[error("is cut off after {bytes} bytes; take an older one, or run from the start")]
    CutOff {
        /// Length of the file.
        bytes: usize,
    },

    /// Wrong checksum.
    #[error("is damaged: its checksum is not that of its bytes; take an older one, or run from the start")]
    Damaged,

    /// Other format version.
    #[error(
        "is of {} program (format {found}; this one reads {wanted}); resume with the program that wrote it, or run from the start",
        if found > wanted { "a newer" } else { "an older" }
    )]
    Format {
        /// Version in the file.
        found: u64,
        /// Supported version.
        wanted: u64,
    },

    /// Other backend or precision.
    #[error("is of a run on {found}, and this one is on {wanted}; take the same --backend and --precision")]
    Platform {
        /// That of the checkpoint: `cpu f64`, `cpu f32` or `gpu f32`.
        found: String,
        /// That of the run to be resumed.
        wanted: String,
    },

    /// Other scene.
    #[error(
        "is of the scene \"{title}\" as it was then, which is not the one that is to be run; resume with the same scene, meshes and \
         trajectories and the same options, or run from the start"
    )]
    Scene {
        /// Title of the checkpoint's scene.
        title: String,
    },

    /// More steps than the run is to have.
    #[error(
        "was written after step {done}, and {steps} steps are asked for; ask for more --steps, or run from the start"
    )]
    Over {
        /// Completed steps.
        done: u32,
        /// Steps in total.
        steps: u32,
    },
}

/// Why a scene cannot be studied.
#[derive(Debug, thiserror::Error)]
pub enum StudyUnfit {
    /// No quantity to take errors of.
    #[error(
        "nothing to study: errors are of probes of a deformable scene; give the scene a `[skin]` or a `[[block]]`, and a `[[probe]]`"
    )]
    Nothing,

    /// Too many steps.
    #[error("a run of the study has more than {most:e} steps; give [study] a shorter duration_s")]
    Steps {
        /// Most steps of a run.
        most: f64,
    },

    /// Reference too large for a quick study to set up.
    #[error(
        "the reference of a quick study has {cells:.0} cells; give [study] a quick_grid with which twice as fine a grid has {most:.0} at most"
    )]
    Cells {
        /// Cells of the reference.
        cells: f64,
        /// Most cells in a quick study.
        most: f64,
    },

    /// Reference too slow for a quick study.
    #[error(
        "{what} takes too long for a quick study; give [study] a smaller quick_grid or a shorter duration_s, or study without --quick"
    )]
    Slow {
        /// Name of the reference.
        what: String,
    },

    /// Non-finite reference.
    #[error(
        "{what} of the study became non-finite; take a shorter reference_step_ms, or a scene that `cutis run` gets through"
    )]
    NonFinite {
        /// Name of the reference.
        what: String,
    },

    /// Grid with a fractional number of cells.
    #[error(
        "[study] grid {factor}: {cells} cells times it are {refined} cells; take factors that give whole numbers of cells along x and y"
    )]
    PartsOfCells {
        /// Refinement relative to the scene's grid.
        factor: f64,
        /// Cells of the scene along an axis.
        cells: u32,
        /// Cells of the refined grid along it.
        refined: f64,
    },

    /// Refinement of a mesh.
    #[error(
        "[study] grid {factor}: the scene has a mesh, which is not refined; study a scene of each mesh, or leave the grids out"
    )]
    Mesh {
        /// Refinement relative to the scene's mesh.
        factor: f64,
    },

    /// Grid with more nodes than 32-bit indices reach.
    #[error("[study] grid {factor}: it has more nodes than 32-bit indices reach; take a coarser grid")]
    Nodes {
        /// Refinement relative to the scene's grid.
        factor: f64,
    },

    /// Grid too coarse for a region of a boundary, of rest-shape springs or of a probe.
    #[error("[study] grid {factor}: a region holds no node of it; take a finer grid, or a wider region")]
    EmptyRegion {
        /// Refinement relative to the scene's grid.
        factor: f64,
    },
}

impl StudyUnfit {
    /// Error of a study of a scene for this reason.
    pub(super) fn of(self, scene: &Scene) -> Refused {
        Refused::Study { path: scene.file.clone(), unfit: self }
    }
}
