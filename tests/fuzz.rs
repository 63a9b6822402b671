//! Inputs that nobody would write: scenes, trajectories, meshes and folders of results, changed at random. Whatever they hold, the
//! program does not panic, comes back, takes no memory beyond what the input is worth, and says where the input is wrong and how to
//! mend it. 10⁴ inputs of each kind; `CUTIS_FUZZ=1000000` asks for another number, `CUTIS_FUZZ_SEED` for other ones.

#[path = "fuzz/bounds.rs"]
mod bounds;
#[path = "fuzz/change.rs"]
mod change;
#[path = "fuzz/files.rs"]
mod files;
#[path = "fuzz/found.rs"]
mod found;
#[path = "fuzz/scenes.rs"]
mod scenes;
