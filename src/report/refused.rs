//! Why a run, a comparison or a study is not done as asked.

use crate::error::Error;
use crate::scene::Scene;
use std::io;
use std::path::PathBuf;

/// See the module.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// A run that ends before it begins, or a checkpoint that is never due.
    #[error(
        "a run of 0 steps, or a checkpoint after every 0 steps; ask for at least one step, or for at least half a step of time"
    )]
    NoSteps,

    /// A checkpoint of a run whose hands go on moving meanwhile.
    #[error(
        "a checkpoint of a run by the wall clock, whose hands do not wait; leave out --realtime, or --checkpoint and --resume"
    )]
    CheckpointInRealTime,

    /// A checkpoint of a run whose recording could have gaps.
    #[error("a checkpoint of a run that records its devices; leave out --record, or --checkpoint and --resume")]
    CheckpointOfRecording,

    /// A checkpoint that a run cannot go on from.
    #[error("{}: the checkpoint {unfit}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        unfit: CheckpointUnfit,
    },

    /// A bound on what no report has.
    #[error(
        "{}: [check] names `{key}`, which is no number of the report; name one of {known}, warnings.NAME or probes.NAME",
        path.display()
    )]
    UnknownCheck {
        /// The scene file.
        path: PathBuf,
        /// As the scene has it.
        key: String,
        /// Known keys, with commas.
        known: String,
    },

    /// A comparison of what never runs on a GPU.
    #[error(
        "a comparison of GPU and CPU path on a scene of rigid bodies alone, which the CPU moves; compare a scene with a `[skin]` or a \
         `[[block]]`"
    )]
    NothingToCompare,

    /// A scene that cannot be studied as asked.
    #[error("{}: {unfit}", path.display())]
    Study {
        /// The scene file.
        path: PathBuf,
        /// What stands against it.
        unfit: StudyUnfit,
    },

    /// A picture that cannot be drawn.
    #[error("study.svg cannot be drawn ({message}); study.csv has the same numbers")]
    Plot {
        /// The drawing library's words.
        message: String,
    },
}

/// What is wrong with a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointUnfit {
    /// The system does not give it.
    #[error("cannot be read ({source}); give the checkpoint.bin that a run with --checkpoint has left in its folder")]
    Unread {
        /// The system's reason.
        source: io::Error,
    },

    /// Another file.
    #[error("is no checkpoint of cutis; give the checkpoint.bin that a run with --checkpoint has left")]
    Strange,

    /// Its end is missing.
    #[error("is cut off after {bytes} bytes; take an older one, or run from the start")]
    CutOff {
        /// The file's length.
        bytes: usize,
    },

    /// Its bytes are not those that were written.
    #[error("is damaged: its checksum is not that of its bytes; take an older one, or run from the start")]
    Damaged,

    /// Of a program that writes another format.
    #[error(
        "is of {} program (format {found}; this one reads {wanted}); resume with the program that wrote it, or run from the start",
        if found > wanted { "a newer" } else { "an older" }
    )]
    Format {
        /// In the file.
        found: u64,
        /// What this program reads.
        wanted: u64,
    },

    /// Of a run elsewhere.
    #[error("is of a run on {found}, and this one is on {wanted}; take the same --backend and --precision")]
    Place {
        /// `cpu f64`, `cpu f32` or `gpu f32`.
        found: String,
        /// Of the run that is to go on.
        wanted: String,
    },

    /// Of another scene.
    #[error(
        "is of the scene \"{title}\" as it was then, which is not the one that is to be run; resume with the same scene, meshes and \
         trajectories and the same options, or run from the start"
    )]
    Scene {
        /// Of the scene that it is of.
        title: String,
    },

    /// Of a run that has come as far as this one is to.
    #[error(
        "was written after step {done}, and {steps} steps are asked for; ask for more --steps, or run from the start"
    )]
    Over {
        /// Steps done.
        done: u32,
        /// Steps in all.
        steps: u32,
    },
}

/// Why a scene cannot be studied as asked.
#[derive(Debug, thiserror::Error)]
pub enum StudyUnfit {
    /// Nothing that errors could be of.
    #[error(
        "nothing to study: errors are of probes of a deformable scene; give the scene a `[skin]` or a `[[block]]`, and a `[[probe]]`"
    )]
    Nothing,

    /// Runs without end.
    #[error("a run of the study has more than {most:e} steps; give [study] a shorter duration_s")]
    Steps {
        /// The limit for one run.
        most: f64,
    },

    /// A reference that a quick study has no time to set up.
    #[error(
        "the reference of a quick study has {cells:.0} cells; give [study] a quick_grid with which twice as fine a grid has {most:.0} at most"
    )]
    Cells {
        /// Of the reference.
        cells: f64,
        /// The limit for a quick study.
        most: f64,
    },

    /// A reference that a quick study has no time to run.
    #[error(
        "{what} takes too long for a quick study; give [study] a smaller quick_grid or a shorter duration_s, or study without --quick"
    )]
    Slow {
        /// What others are measured against.
        what: String,
    },

    /// A reference that is no number.
    #[error(
        "{what} of the study left the numbers; take a shorter reference_step_ms, or a scene that `cutis run` gets through"
    )]
    NonFinite {
        /// What others are measured against.
        what: String,
    },

    /// A grid with parts of cells.
    #[error(
        "[study] grid {factor}: {cells} cells times it are {refined} cells; take factors that give whole numbers of cells along x and y"
    )]
    PartsOfCells {
        /// Cells of the grid, times the scene's.
        factor: f64,
        /// Of the scene along an axis.
        cells: u32,
        /// Of the grid there.
        refined: f64,
    },

    /// A grid beyond all indices.
    #[error("[study] grid {factor}: it has more nodes than 32-bit indices reach; take a coarser grid")]
    Nodes {
        /// Cells of the grid, times the scene's.
        factor: f64,
    },

    /// A grid too coarse for what is held or loaded.
    #[error("[study] grid {factor}: a region holds no node of it; take a finer grid, or a wider region")]
    EmptyRegion {
        /// Cells of the grid, times the scene's.
        factor: f64,
    },

    /// A grid on which a probe measures elsewhere.
    #[error(
        "[study] grid {factor}: probe {probe} is at no node of it; probe points that are nodes of every grid of the study, or name others \
         in `probes`"
    )]
    ProbeBetween {
        /// Cells of the grid, times the scene's.
        factor: f64,
        /// Its name.
        probe: String,
    },
}

impl StudyUnfit {
    /// The error that a study of the scene ends with.
    pub(super) fn of(self, scene: &Scene) -> Error {
        Refused::Study { path: scene.file.clone(), unfit: self }.into()
    }
}
