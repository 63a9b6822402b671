//! `cutis serve`: a running scene in a browser, seen, held and changed from there.
//!
//! One thread simulates ([`session`]), one per page sends and receives ([`hub`]); a page draws by itself. A frame is made at most 30 times
//! a second and only if a page is open, so the price of a picture to the simulation is that of reading the state and packing the surface.
//! Any number of pages watch and hold one run.

pub mod hub;
pub mod mouse;
pub mod session;
pub mod wire;

pub use session::{Options, serve};

use std::io;
use std::net::SocketAddr;

/// Errors of the server.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Address that cannot be listened on.
    #[error("cannot listen on {address} ({source}); take another --listen address; port 0 is any free one")]
    Port {
        /// Address.
        address: SocketAddr,
        /// Reason of the system.
        source: io::Error,
    },
}
