//! cutis: layered skin that is pressed and cut with a haptic device, on any vendor's GPU or on the CPU.
//!
//! This page is the architecture. The idea in nine nouns:
//! [`Scene`](scene::Scene) (a file) → [`Grid`](mesh::Grid) → [`Model`](bodies::Model) (flat arrays that never change) and the state (flat
//! arrays that change). A kernel computes one thing on arrays and exists twice: WGSL, and a Rust twin ([`kernels`]). A
//! [`Backend`](backend::Backend) (CPU in f64 or f32, or GPU) holds the state and runs kernels. One step is written once over `Backend`
//! ([`step`]). What is left of the skin after a step, the [`Reduced`](haptic::Reduced) contact problem, goes to the 1 kHz haptic side.
//!
//! ```text
//! scene file ─▶ grid ─▶ model ─┬─▶ backend (cpu | gpu): forces · free motion (matrix-free PCG) · cut
//!                              │        ▲ few words back per step: positions near the tool, scalars of the solve
//!              recorded hand ─▶ step: collide (parry3d) ─▶ rows ─▶ W, δ ─▶ contact law ─▶ correction ─▶ cut
//!                              │                                   └─ Reduced ─▶ haptic tick, 1 kHz ─▶ force
//!                              └─▶ report.json, CSV, VTU/PVD, PNG
//! ```
//!
//! # One step
//! With displacement increments Δx = h·v' as unknowns, implicit Euler with Rayleigh damping is `A Δx = b`, `A = (1 + h r_M)/h² M + (1 +
//! r_K/h) K`, `b = f_ext − f_int + M v/h` ([`kernels::rhs`], M lumped, uniform or consistent; springs to rest positions are part of
//! `f_int` and `K`, [`bodies::Anchors`]): external forces and inertia stand in one right-hand side, nothing is lost to f32. `A` is never
//! assembled, but by the CPU path when a scene asks for a factor of it ([`bodies::grid::direct`]).
//!
//! Newmark's method and symplectic Euler are other factors in the same `A` and `b` ([`bodies::Step`] has them, and what each does to a
//! vibration); the latter's `A` is diagonal, so that nothing is solved. Neo-Hookean bricks ([`bodies::grid::Hyperelastic`]) have a tangent of
//! their own in each cell, kept on the CPU path and taken anew in each product on a GPU, and a step is solved by Newton's method, written
//! once for both.
//!
//! Bodies are grids of skin, each with its own backend, and rigid ones ([`bodies::rigid`]): tools held by a hand, and those that fall. Only
//! rows couple them, of contacts and of ties, between any two bodies or a body and a wall ([`collide`], [`constraints`]). Contacts are
//! found at the step's start: a tree of boxes over tiles of each grid, refitted to what the device says that they move between
//! ([`collide::broad`]), gives the few faces whose nodes are read back; sphere, capsule, point, line and box then have their own narrow
//! phase. The compliance of a body at the nodes that rows reach, columns of `A⁻¹` solved loosely, is kept from step to step, learns in
//! each pass, and is solved anew by batches where it has aged; forces λ come from the laws on `W λ + δ`, `W = Σ J C Jᵀ` over the bodies; the correction `A Δx = Jᵀλ` is solved
//! accurately and δ taken again until the laws hold, so λ does not depend on how loose the columns are ([`step`]). The edge of a blade is
//! held by what the tissue bears (toughness × length); beyond that it goes on, and the links or springs that it sweeps are cut; what a held
//! piece passes is swept when it lets go. Its flats push the walls aside with at most what would split the tissue before the edge, and the
//! lips of a wound may rest on each other where they meet ([`collide::lips`]).
//!
//! # Cutting
//! Nothing is removed: a blade severs links between face-neighbour cells ([`kernels::cut`]), and where the cells around a node hang together
//! no more, each part of them gets a copy of the node from a reserve ([`mesh::Parts`], [`kernels::split`]). Arrays and the product over the
//! grid stay as they are; cells with copies among their corners are added one by one ([`kernels::split_product`]), the smoother runs over
//! extra columns, and the coarse levels ignore the cut. Places that no copy has taken are the last of all arrays and nothing runs over them. The wound's surface goes through the crossings, not along the cells. Parts are found
//! on the host, where the hits are anyway: 0.03 ms of a cutting step of the default scene, 0.03 % of it, as much as one empty round trip
//! to a device takes.
//!
//! # Solving
//! Conjugate gradients with one reduction per iteration ([`kernels::advance`], [`kernels::update`]) around one V-cycle
//! ([`bodies::grid::multigrid`], [`bodies::grid::levels`]): x and y coarsened by two, z kept; each level and layer is one 24×24 matrix turned by its
//! children's mean rotation; z-columns solved exactly, three times, under a Chebyshev polynomial of degree 3, whose bound of the
//! spectrum is proved cell by cell. Iterations to 10⁻³ and 10⁻⁶ of the load on any grid: 4–5 and 9–11 at ν 0.45, 8–11 and 20–24 at ν
//! 0.49 (`benches/results`). Tried and left: degrees 1 (14 and 31 iterations at 16×16×5, ν 0.45), 2 (7 and 16) and 4 (4 and 9), which
//! cost as many products; Chebyshev polynomials of the fourth kind (no better); more sweeps on the coarsest level (nothing); four-colour
//! Gauss–Seidel over columns (in the prototype a little less work than degree 2, at four times the dispatches).
//!
//! f32 carries a step to about 10⁻⁶ of its displacement, whatever its recurrence promises; with `refinements` it ends at the rounding of
//! the displacement itself, 2·10⁻⁸.
//!
//! # Speed and error
//! Both are measured together, in one run: `cutis study` takes a scene through many settings and keeps the errors of grid, step, solver and
//! rounding apart (`report::study`); `cargo bench --bench contact` does so for contact corrections. Tables and curves with the machines that they
//! are of: `benches/results`.
//!
//! # The haptic side
//! Each device has a [`Servo`](haptic::servo::Servo): one plain function per tick, without allocation, lock or wait. It places the reading
//! in the scene, solves the newest [`Reduced`](haptic::Reduced) problem again with the hand where it is now, limits the force and watches the
//! energy ([`haptic::passivity`]). By the wall clock (`cutis run --realtime`) it runs in a thread of its own ([`haptic::thread`]): problems
//! come and hands go through triple buffers ([`haptic::cells`]), records through a ring, and a slow step costs the force, never a tick: it
//! is held by the last problem, fades when that is too old ([`haptic::guard`]), and comes back. By the scene's clock the same function runs
//! between the steps, so that a run repeats.
//!
//! # State
//! Everything that a step depends on beside the scene is a [`State`](step::State): a simulation that goes on from one gives the same bits as
//! one that was never interrupted. Checkpoints are that, with where the files have come to.
//!
//! # As a library
//! `default-features = false` leaves the program, its files and pictures out. Load a scene, step it, read a force:
//!
//! ```
//! use cutis::scene::{Scene, incision};
//! use cutis::step::{Place, Simulation};
//!
//! let scene: Scene = incision()?.in_test_form(); // or cutis::scene::read("my.toml".as_ref())?
//! let mut simulation = Simulation::new(&scene, &Place::Cpu64)?;
//! for _ in 0..30 {
//!     let step = simulation.step(false)?;
//!     println!("{:.3} s: {:.3} N, {} links cut", step.time, step.contact.largest_on_tools(), step.severed);
//! }
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Or build one in code, press it and cut it; what cannot run is refused with words:
//!
//! ```
//! use cutis::scene::{Blade, Boundary, Contact, Pose, Region, Scene, Skin, Tool};
//! use cutis::step::{Place, Simulation};
//!
//! let pose = |time, x, z| Pose { time, position: [x, 0.0, z], ..Pose::default() }; // s, m
//! let scalpel = Tool {
//!     blade: Some(Blade::default()),
//!     round: None,
//!     trajectory: vec![pose(0.0, 2e-3, 2.4e-3), pose(0.05, 2e-3, 0.8e-3), pose(0.2, -2e-3, 0.8e-3)],
//!     ..Tool::default()
//! };
//! let held = |region| Boundary { body: 0, region, axes: [true; 3], displacement: [0.0; 3], turn: 0.0 };
//! let scene = Scene {
//!     skins: vec![Skin::default()],
//!     boundaries: vec![held(Region::Bottom), held(Region::Sides)],
//!     tools: vec![scalpel],
//!     contact: Some(Contact::default()),
//!     ..Scene::default()
//! };
//! let mut simulation = Simulation::new(&scene, &Place::Cpu64)?;
//! for _ in 0..40 {
//!     let step = simulation.step(false)?;
//!     println!("{:.3} s: {:.3} N, {} links cut", step.time, step.contact.largest_on_tools(), step.severed);
//! }
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Hold a tool by a device of one's own; [`runner`] gives it ticks at 1 kHz, in a thread by the wall clock if wanted:
//!
//! ```
//! use cutis::error::Result;
//! use cutis::haptic::device::{Device, Limits, Reading, Wrench};
//! use cutis::runner::{Clock, Runner};
//! use cutis::scene::incision;
//! use cutis::step::{Place, Simulation};
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
//! let mut runner = Runner::new(&scene, Simulation::new(&scene, &Place::Cpu64)?, Clock::Scene);
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
//! Change a scene while it runs, keep a state and go back to it:
//!
//! ```
//! # use cutis::step::{Place, Simulation};
//! # let scene = cutis::scene::incision()?.in_test_form();
//! let mut simulation = Simulation::new(&scene, &Place::Cpu64)?;
//! simulation.step(false)?;
//! let before = simulation.state()?;
//! simulation.change(|scene| scene.skins[0].layers[0].young *= 2.0)?;
//! simulation.step(false)?;
//! simulation.restore(&before)?;
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! Compute on a device of the host program, beside what it draws:
//!
//! ```no_run
//! # fn host() -> (wgpu::Adapter, wgpu::Device, wgpu::Queue) { unimplemented!() }
//! use cutis::{gpu::Gpu, step::Simulation, wgpu};
//! use std::sync::Arc;
//!
//! let (adapter, device, queue) = host();
//! let gpu = Arc::new(Gpu::from_wgpu(adapter, device, queue)?);
//! let scene = cutis::scene::read("my.toml".as_ref())?;
//! let mut simulation = Simulation::with_gpu(&scene, gpu.clone())?; // Send: it may run in a thread of its own
//! simulation.step(false)?;
//! # Ok::<(), cutis::error::Error>(())
//! ```
//!
//! # Rules that hold everywhere
//! - Imports go downward: main > cli > report > runner, output, view > step > haptic > backend > collide > constraints, linear >
//!   bodies > mesh, gpu > kernels, scene > error, math. Modules of one level do not import each other (a test reads this); `error` alone names the
//!   errors of those above it.
//!   `gpu` knows no physics; `collide` alone names parry3d; `scene` alone reads scene syntax.
//! - SI units inside; scene keys carry their unit.
//! - The GPU keeps displacements, not positions; buffers are flat arrays of scalars, vec2 or vec4.
//! - One writer per array slot and a fixed order of sums. The CPU path gives the same bits on every x86-64 and aarch64 machine and for any
//!   number of threads ([`math::wide`], [`math::elementary`]); a GPU repeats its own bits, and differs from others within stated bounds. Who
//!   is left out: the sparse factor ([`bodies::grid::direct`]), pictures and plots.
//! - Core WebGPU limits: 8 storage buffers a kernel, no subgroups, no f64. Sizes beyond a limit are refused with its name.
//! - Solves stop at a residual relative to the step's load, never after a fixed count; what did not converge is counted.
//! - Bad input is an [`Error`](error::Error) that says where, what and how to mend; a broken invariant of ours is an assertion.

/// The version of wgpu that [`gpu::Gpu::from_wgpu`] takes devices of.
pub use wgpu;

pub mod backend;
pub mod bodies;
pub mod collide;
pub mod constraints;
pub mod error;
pub mod gpu;
pub mod haptic;
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
pub mod step;
#[cfg(feature = "program")]
pub mod view;
