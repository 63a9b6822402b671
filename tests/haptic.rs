//! The haptic tick: what it renders, what it guards, what energy it gives; and the simulated hand against the theory of sampled walls.
//!
//! `CUTIS_MEASURED=1` prints what was measured.

#[path = "haptic/bench.rs"]
mod bench;
#[path = "haptic/energy.rs"]
mod energy;
#[path = "haptic/guarded.rs"]
mod guarded;
#[path = "haptic/rendered.rs"]
mod rendered;
#[path = "haptic/running.rs"]
mod running;
mod small;
