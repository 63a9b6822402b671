//! `cutis view`: a running scene in a window, seen, held and changed from there.
//!
//! The main thread draws (`app`), one of its own simulates ([`session`]); between them lies the newest state (`link`),
//! which is replaced, never waited for. A state is read for a picture only once the last one has been drawn, and at most 30 times a second:
//! a slow picture makes fewer pictures, not slower steps. The window has a device of its own, so that its work does not stand in the queue
//! of the simulation's.

mod app;
mod link;
mod orbit;
mod overlays;
#[cfg(feature = "gamepad")]
mod pad;
mod panel;
mod plots;
mod state;

use crate::error::{Error, Result};
use crate::gpu::Failed;
use crate::runner;
use crate::scene::Scene;
use crate::session::audience::MOST_COMMANDS;
use crate::session::{self, Motion};
use eframe::egui_wgpu::{WgpuError, WgpuSetup, WgpuSetupCreateNew};
use eframe::{NativeOptions, egui, wgpu};
use link::{Link, Screen};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{channel, sync_channel};
use std::sync::{Arc, PoisonError};
use std::thread;
use std::time::Instant;

/// Size of the window at first, points.
const SIZE: [f32; 2] = [1240.0, 800.0];

/// Options of a window.
#[derive(Clone, Debug)]
pub struct Options {
    /// The simulation.
    pub session: session::Options,
    /// Folder of what is saved.
    pub folder: PathBuf,
}

/// Errors of the window.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// No window can be opened.
    #[error(
        "no window can be opened ({message}); `cutis view` needs a display: run it in a desktop session, or use `cutis serve` and a browser \
         elsewhere"
    )]
    NoDisplay {
        /// Reason of the system.
        message: String,
    },
}

/// What a window has shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// It was closed; otherwise the session was interrupted.
    pub closed: bool,
    /// Number of pictures.
    pub pictures: u64,
    /// Time that it was open, s.
    pub seconds: f64,
    /// Time that the scene had come to, s.
    pub time_s: f64,
}

/// Runs a scene in a window until that is closed, or the session interrupted.
///
/// # Errors
/// [`Refused::NoDisplay`], [`Failed::NoAdapter`] if nothing here draws on windows, [`Failed::Device`] if what draws fails, and those of the
/// session.
///
/// # Panics
/// Outside the main thread, on systems where windows belong to that.
pub fn show(scene: &Scene, options: &Options) -> Result<Shown> {
    let (sender, commands) = sync_channel(MOST_COMMANDS);
    let link = Arc::new(Link::default());
    let (ready, prepared) = channel();
    let motion = Motion::default();
    let recorded = motion.clone();
    thread::scope(|scope| {
        let mut screen = Screen::new(commands, link.clone());
        let simulates = thread::Builder::new().name("simulation".into()).spawn_scoped(scope, move || {
            session::run(scene, &options.session, &mut screen, recorded, &mut || {
                ready.send(()).ok();
            })
        });
        let simulates = simulates.map_err(|source| runner::Refused::Threads { source })?;
        // however the window ends, the simulation ends with it
        let ends = Ends(&options.session.interrupt);
        // a scene that cannot be prepared is said without a window
        let mut begun = Instant::now();
        let opened = match prepared.recv() {
            Ok(()) => {
                begun = Instant::now();
                open(
                    &scene.title,
                    app::Start { link: link.clone(), sender, folder: options.folder.clone(), motion: motion.clone() },
                )
            }
            Err(_) => Ok(()),
        };
        let shown = Shown {
            closed: !link.has_ended(),
            pictures: link.pictures(),
            seconds: begun.elapsed().as_secs_f64(),
            time_s: link.time(),
        };
        drop(ends);
        let simulated = simulates.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        opened?;
        simulated?;
        let fault = link.fault.lock().unwrap_or_else(PoisonError::into_inner).take();
        fault.map_or(Ok(shown), |message| Err(Failed::Device { message }.into()))
    })
}

/// Ends the session when it is dropped, be that by a panic of what draws.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Opens the window; returns once it is closed.
fn open(title: &str, start: app::Start) -> Result<()> {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    setup.native_adapter_selector = Some(Arc::new(select));
    let mut native = NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title(format!("cutis: {title}"))
            .with_app_id("cutis")
            .with_inner_size(SIZE)
            .with_icon(egui::IconData::default()),
        ..Default::default()
    };
    native.wgpu_options.wgpu_setup = WgpuSetup::CreateNew(setup);
    let made = eframe::run_native("cutis", native, Box::new(|context| Ok(Box::new(app::App::new(context, start)?))));
    made.map_err(|error| match error {
        eframe::Error::Wgpu(WgpuError::RequestDeviceError(error)) => {
            Failed::Device { message: error.to_string() }.into()
        }
        // no driver, or none that draws on windows
        eframe::Error::Wgpu(error) => {
            let found = match error {
                WgpuError::CustomNativeAdapterSelectionError(found) => found,
                _ => "none".into(),
            };
            Failed::NoAdapter { wanted: "an adapter that draws on this window".into(), found }.into()
        }
        // the last part says what is missing, the first ones where in the library
        error => {
            let words = error.to_string();
            let message = words.rsplit(": ").next().unwrap_or_default().trim_end_matches('.').into();
            Error::from(Refused::NoDisplay { message })
        }
    })
}

/// The adapter that draws on a window: hardware first.
fn select(adapters: &[wgpu::Adapter], surface: Option<&wgpu::Surface>) -> std::result::Result<wgpu::Adapter, String> {
    let is_software = |adapter: &&wgpu::Adapter| adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    let fits = |adapter: &&wgpu::Adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface));
    adapters.iter().filter(fits).min_by_key(is_software).cloned().ok_or_else(|| {
        let names: Vec<String> = adapters.iter().map(|adapter| format!("`{}`", adapter.get_info().name)).collect();
        if names.is_empty() { "none".into() } else { names.join(", ") }
    })
}
