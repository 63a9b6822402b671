//! Results of a run (report, tables, meshes, pictures) and of the other commands.
//!
//! [`run`] steps a scene and writes its folder, [`compare`] compares the GPU with the CPU path, [`inspect`] lists what a scene will
//! allocate without running it, [`verify`] runs known answers, [`mesh`] examines a mesh file, [`plot`] and [`render`] draw what a
//! run has left. Nothing here prints; the program does.

pub mod check;
mod checkpoint;
mod collect;
pub mod compare;
mod files;
pub mod film;
pub mod frames;
mod glb;
pub mod haptics;
pub mod inspect;
mod keys;
mod listing;
pub mod mesh;
mod meshes;
pub mod plot;
mod refused;
pub mod render;
pub mod run;
pub mod slice;
pub mod study;
mod tables;
pub mod verify;

pub use keys::{
    CostReport, CutReport, DissipationReport, EnergyReport, Extremes, HapticReport, Memory, Passes, Periods, Report,
    Share, SolverReport, Spread, WorkReport,
};
pub use listing::Listing;
pub use refused::{CheckpointUnfit, Refused, StudyUnfit};
