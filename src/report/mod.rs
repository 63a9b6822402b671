//! What a run leaves: the report, tables, meshes and pictures; and the other commands' answers.
//!
//! [`run`] steps a scene and writes its folder, [`compare`] puts the GPU beside the CPU path, [`inspect`] says what a scene will
//! allocate without running it. Nothing here prints: the program does.

pub mod check;
mod checkpoint;
mod collect;
pub mod compare;
mod files;
pub mod frames;
mod haptics;
pub mod inspect;
mod keys;
pub mod recording;
mod refused;
pub mod run;
pub mod study;

pub use keys::{CutReport, EnergyReport, HapticReport, Memory, Passes, Periods, Report, SolverReport, Spread};
pub use refused::{CheckpointUnfit, Refused, StudyUnfit};
