//! The haptic tick: what it renders, what it guards, what energy it gives; and the simulated hand against the theory of sampled walls.
//!
//! `CUTIS_MEASURED=1` prints what was measured.

mod bench;
mod energy;
mod guarded;
mod haply;
mod rendered;
mod runner;
mod running;
#[path = "../shared/small.rs"]
mod small;
