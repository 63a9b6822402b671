//! Inputs that nobody would write: scenes, trajectories, meshes, folders of results and command lines, changed at random, and outputs
//! that take nothing. Whatever they hold, the program does not panic, comes back, takes no memory beyond what the input is worth, and says
//! where the input is wrong and how to mend it. 10⁴ inputs of each kind, fewer where each takes a run or a process;
//! `CUTIS_FUZZ=1000000` asks for another number, `CUTIS_FUZZ_SEED` for other ones.

mod bounds;
mod change;
mod files;
mod found;
mod meshes;
#[cfg(unix)]
mod program;
mod scenes;
