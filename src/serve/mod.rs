//! `cutis serve`: a running scene in a browser, seen, held and changed from there.
//!
//! One thread simulates ([`session`]), one per page sends and receives ([`hub`]); a page draws by itself. A frame is made at
//! most 30 times a second and only if a page is open, so the price of a picture to the simulation is that of reading the state and packing
//! the surface. Any number of pages watch and hold one run.

pub mod hub;
pub mod wire;

use crate::error::Result;
use crate::scene::Scene;
use crate::session::{self, Audience, Command, Shown};
use hub::{Frame, Hub};
use serde_json::json;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use wire::Vertices;

/// Options of a served session.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address to listen on.
    pub listen: SocketAddr,
    /// What is served.
    pub session: session::Options,
}

/// Serves a scene until it is interrupted; calls `tell` with the address once it listens.
///
/// # Errors
/// If the address is taken, or the scene cannot be prepared.
pub fn serve(scene: &Scene, options: &Options, tell: &mut dyn FnMut(&str)) -> Result<()> {
    let hub = Hub::start(options.listen)?;
    let (url, motion) = (hub.url(), hub.motion());
    let mut pages =
        Pages { hub, scene: scene.clone(), vertices: Vertices::default(), shape: Arc::default(), surface: 0, frame: 0 };
    session::run(scene, &options.session, &mut pages, motion, &mut || tell(&url))
}

/// The pages that are open.
struct Pages {
    hub: Hub,
    scene: Scene,
    vertices: Vertices,
    shape: Arc<[u8]>,
    surface: u32,
    frame: u32,
}

impl Audience for Pages {
    fn commands(&self) -> &Receiver<(u64, Command)> {
        self.hub.commands()
    }

    fn watchers(&self) -> usize {
        self.hub.clients()
    }

    fn is_ready(&self) -> bool {
        self.hub.clients() > 0
    }

    fn begin(&mut self, scene: &Scene, held: &[bool]) {
        self.hub.set_scene(&wire::scene(scene, held).to_string());
    }

    fn show(&mut self, shown: Shown) {
        let vertices = Vertices::new(&shown.surface, &self.scene);
        if vertices != self.vertices || self.surface == 0 {
            self.surface += 1;
            self.vertices = vertices;
            self.shape = self.vertices.message(self.surface, &shown.surface).into();
        }
        self.frame += 1;
        let motion = self.vertices.frame([self.frame, self.surface], &shown);
        let figures = json!({ "figures": shown.figures }).to_string();
        let (number, surface, shape) = (self.frame, self.surface, self.shape.clone());
        self.hub.show(Frame { number, surface, shape, motion: motion.into(), figures: figures.into() });
    }

    fn refuse(&mut self, to: Option<u64>, words: &str) {
        self.hub.tell(to, &json!({ "error": words }).to_string());
    }
}

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
