//! cutis: layered skin that is pressed and cut with a haptic device, on any vendor's GPU or on the CPU.
//!
//! A [`Scene`](scene::Scene), read from a file or made in code, becomes a [`Model`](bodies::Model) per deformable body: flat arrays that never
//! change during a run. A [`Backend`](backend::Backend) (CPU in f64 or f32, or GPU) stores the state of one body and runs kernels on it; each
//! kernel exists twice, in WGSL and as its Rust twin ([`kernels`]). The time step is written once, over `Backend` ([`step`]). It ends with a
//! [`Reduced`](haptic::Reduced) contact problem, which the 1 kHz haptic loop solves at each tick ([`haptic`]).
//!
//! ```text
//! scene (file | code) ─▶ model ─▶ backend (cpu | gpu): forces · unconstrained motion (matrix-free PCG) · cut
//!                          │           ▲ few words back per step: positions near the tool, scalars of the solve
//!      hand (recorded | device) ─▶ step: collide (parry3d) ─▶ rows ─▶ W, δ ─▶ contact law ─▶ correction ─▶ cut
//!                          │                                └─ Reduced ─▶ haptic tick, 1 kHz ─▶ force
//!                          └─▶ runner ─▶ report.json, CSV, VTU/PVD, PNG, checkpoints
//! ```
//!
//! | module | what it is | read there |
//! | --- | --- | --- |
//! | [`scene`] | plain data in SI, reader, validation | all keys: [`scene::keys`] |
//! | [`kernels`] | computations on flat arrays, in WGSL and Rust | formula, units, source |
//! | [`formats`] | mesh files: Gmsh, VTK, OBJ, STL, PLY | what each keeps; defects of meshes |
//! | [`mesh`] | the grid, its links, duplicated nodes and surface; surfaces embedded in it; meshes of tetrahedra | how a cut separates cells and nodes; shares of cells |
//! | [`bodies`] | bodies by kind: hexahedra, tetrahedra, springs, rigid bodies | elements, hyperelastic laws, multigrid, wounds |
//! | [`collide`], [`constraints`] | contacts between any two bodies; contact laws | blades, lips, normal cones; the contact solvers |
//! | [`backend`], [`linear`], [`gpu`] | the state on a device, and solvers | Newton's method; read-backs and launches |
//! | [`step`] | one time step over all bodies | the equations, contact, the state of a simulation |
//! | [`haptic`] | devices and the 1 kHz loop | passivity, threads, the vendor's protocol |
//! | [`runner`], `report`, `cli` | the run loop, its observers, the program: `commands` | report keys, studies, known answers, plots, pictures |
//! | `session` | a running scene that is watched, held and changed | commands, pictures, figures |
//! | `serve`, `http` | a session in a browser | messages between page and session |
//! | `window` | a session in a window (feature `view`) | threads |
//!
//! Speed and error are measured in the same run: `cutis study` separates the errors of law, grid, step, solver and rounding, each relative
//! to a stated reference (root of the sum of squares over the samples of a run). `cutis verify` holds known answers to stated bounds; its page,
//! `benches/results/verification.md`, gives reference, source, error, grid and law of each. Tables and curves, with the machines they were
//! measured on, are in `benches/results`.
//!
//! # As a library
//! `default-features = false` excludes the program, its files and pictures. Load a scene, step it, read a force:
//!
//! ```
//! use cutis::scene::{Scene, incision};
//! use cutis::step::{Platform, Simulation};
//!
//! let scene: Scene = incision()?.in_test_form(); // or cutis::scene::read("my.toml".as_ref())?
//! let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
//! let mut force = 0.0; // of the skin on the scalpel, N
//! for _ in 0..30 {
//!     let step = simulation.step(false)?;
//!     force = step.contact.largest_on_tools();
//!     println!("{:.3} s: {force:.3} N", step.time);
//! }
//! assert!(force > 0.01);
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Or build a scene in code, press it and cut it; an invalid scene gives an error:
//!
//! ```
//! use cutis::scene::{Blade, Boundary, Contact, Pose, Region, Scene, Skin, Tool};
//! use cutis::step::{Platform, Simulation};
//!
//! let pose = |time, x, z| Pose { time, position: [x, 0.0, z], ..Pose::default() }; // s, m
//! let scalpel = Tool {
//!     blade: Some(Blade::default()),
//!     round: None,
//!     trajectory: vec![pose(0.0, 2e-3, 2.4e-3), pose(0.05, 2e-3, 0.8e-3), pose(0.2, -2e-3, 0.8e-3)],
//!     ..Tool::default()
//! };
//! let held = |region| Boundary { region, ..Boundary::default() };
//! let scene = Scene {
//!     skins: vec![Skin::default()],
//!     boundaries: vec![held(Region::Bottom), held(Region::Sides)],
//!     tools: vec![scalpel],
//!     contact: Some(Contact::default()),
//!     ..Scene::default()
//! };
//! let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
//! for _ in 0..40 {
//!     let step = simulation.step(false)?;
//!     println!("{:.3} s: {:.3} N, {} links cut", step.time, step.contact.largest_on_tools(), step.severed);
//! }
//! assert!(simulation.totals().links > 0);
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Attach your own device to a tool; [`runner`] calls it at 1 kHz, on request by the wall clock in a thread of its own:
//!
//! ```
//! use cutis::error::Result;
//! use cutis::haptic::device::{Device, Limits, Reading, Wrench};
//! use cutis::runner::{Clock, Runner};
//! use cutis::scene::incision;
//! use cutis::step::{Platform, Simulation};
//! use glam::{DQuat, DVec3};
//!
//! struct Mine(DVec3, DQuat);
//!
//! impl Device for Mine {
//!     fn name(&self) -> &str { "mine" }
//!     fn limits(&self) -> Limits { Limits { force: 3.0, torque: 0.0 } }
//!     fn read(&mut self, time: f64) -> Reading {
//!         let position = self.0 - DVec3::Z * 0.02 * time; // sinks by 20 mm/s
//!         Reading { position, rotation: self.1, ..Reading::at_rest(0.0) }
//!     }
//!     fn write(&mut self, _time: f64, wrench: Wrench) { /* wrench.force goes to the motors, N */ }
//!     fn close(&mut self) -> Result<()> { Ok(()) }
//! }
//!
//! let scene = incision()?.in_test_form();
//! let mut runner = Runner::new(&scene, Simulation::new(&scene, &Platform::Cpu64)?, Clock::Scene);
//! let (position, rotation) = runner.simulation.tools[0].hand(0.0);
//! runner.attach(0, Box::new(Mine(position, rotation)))?;
//! for _ in 0..10 {
//!     runner.step(false, &mut |tool, tick| {
//!         assert!(tool == 0 && tick.wrench.force.length() <= 3.0);
//!         Ok(())
//!     })?;
//! }
//! runner.stop(&mut |_, _| Ok(()))?;
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Change a scene during a run, save a state and restore it (a state has no scene: what was changed stays changed):
//!
//! ```
//! # use cutis::step::{Platform, Simulation};
//! # let scene = cutis::scene::incision()?.in_test_form();
//! let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
//! simulation.step(false)?;
//! let before = simulation.state()?;
//! simulation.change(|scene| {
//!     scene.skins[0].layers[0].young *= 2.0;
//!     scene.contact.iter_mut().for_each(|contact| contact.friction = 0.1);
//!     scene.time.gravity = [0.0, 0.0, -9.81];
//! })?;
//! simulation.step(false)?;
//! simulation.restore(&before)?;
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Compute on the host program's own wgpu device, which it may also use for drawing:
//!
//! ```
//! use cutis::gpu::{Gpu, adapters};
//! use cutis::{step::Simulation, wgpu};
//! use std::sync::Arc;
//!
//! let Some(adapter) = adapters().into_iter().next() else { return Ok(()) }; // no GPU here
//! let (adapter, (device, queue)) = adapter.request(&wgpu::DeviceDescriptor::default())?;
//! let gpu = Gpu::from_wgpu(adapter, device.clone(), queue.clone())?;
//! let scene = cutis::scene::incision()?.in_test_form();
//! let mut simulation = Simulation::with_gpu(&scene, Arc::new(gpu))?; // Send: it may run in a thread of its own
//! for _ in 0..3 {
//!     simulation.step(false)?;
//!     let frame = device.create_command_encoder(&Default::default()); // what the host draws
//!     queue.submit([frame.finish()]);
//! }
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! # Rules that hold everywhere
//! - Imports go downward: main > cli > serve, window > session > report > runner, output, view > step > haptic > backend > collide > constraints >
//!   bodies > mesh, gpu, linear > kernels, scene > formats > http, error, math. Modules of one level do not import each other (a test reads this); `error` alone names the
//!   errors of those above it.
//!   `gpu` knows no physics; `collide` alone names parry3d; `scene` alone reads scene syntax.
//! - SI units inside; scene keys carry their unit.
//! - The GPU keeps displacements, not positions; buffers are flat arrays of scalars, vec2 or vec4.
//! - One writer per array entry and a fixed order of sums. The CPU path gives the same bits on every x86-64 and aarch64 machine and for any
//!   number of threads ([`math::wide`], [`math::elementary`]); a GPU repeats its own bits, and differs from others within stated bounds.
//!   Exceptions: the sparse factor ([`bodies::grid::direct`]), runs by the clock, pictures and plots.
//! - Core WebGPU limits: 8 storage buffers per kernel, no subgroups, no f64. A size beyond a limit is an error that names the limit.
//! - Solves stop at a residual relative to the step's load, not after a fixed count; solves that did not converge are counted.
//! - Bad input is an [`Error`](error::Error) that says where, what and how to fix it; a broken invariant of ours is an assertion.

/// The version of wgpu that [`gpu::Gpu::from_wgpu`] takes devices of.
pub use wgpu;

pub mod backend;
pub mod bodies;
pub mod collide;
#[doc = include_str!("commands.md")]
#[cfg(feature = "program")]
pub mod commands {}
pub mod constraints;
pub mod error;
pub mod formats;
pub mod gpu;
pub mod haptic;
#[cfg(any(feature = "haply", feature = "serve"))]
pub mod http;
#[path = "../kernels/mod.rs"]
pub mod kernels;
pub mod linear;
pub mod math;
pub mod mesh;
#[cfg(feature = "program")]
pub mod output;
#[cfg(feature = "program")]
pub mod report;
pub mod runner;
pub mod scene;
#[cfg(feature = "serve")]
pub mod serve;
#[cfg(feature = "program")]
pub mod session;
pub mod step;
#[cfg(feature = "program")]
pub mod view;
#[cfg(feature = "view")]
pub mod window;
