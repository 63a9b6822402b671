//! A running scene behind a page or a window: paced, paused, begun anew, taken back, changed, and held by a mouse.
//!
//! The thread of the session simulates ([`run()`]) and does nothing else. Whoever watches ([`Audience`]) sends [`Command`]s and gets the surface
//! and the [`Figures`] of the newest state; a picture's price to the simulation is that of reading the state.

pub mod audience;
pub mod mouse;
pub mod quantity;
pub mod run;

pub use audience::{Audience, Command, Figures, Hand, Motion, Shown};
pub use quantity::{Asked, Quantity, Read, Values};
pub use run::{Options, is_live, run};
