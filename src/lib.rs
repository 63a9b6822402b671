//! cutis: layered skin that is pressed and cut with a haptic device, on any vendor's GPU or on the CPU.
//!
//! This page is the architecture. The idea in nine nouns:
//! [`Scene`](scene::Scene) (a file) → [`Grid`](mesh::Grid) → [`Model`](model::Model) (flat arrays that never change) and the state (flat
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
//! `f_int` and `K`, [`model::Anchors`]): external forces and inertia stand in one right-hand side, nothing is lost to f32. `A` is never
//! assembled, but by the CPU path when a scene asks for a factor of it ([`linear::direct`]).
//!
//! Newmark's method and symplectic Euler are other factors in the same `A` and `b` ([`model::Step`] has them, and what each does to a
//! vibration); the latter's `A` is diagonal, so that nothing is solved. Neo-Hookean bricks ([`model::NeoHookean`]) have a tangent of
//! their own in each cell, kept on the CPU path and taken anew in each product on a GPU, and a step is solved by Newton's method, written
//! once for both.
//!
//! Bodies are grids of skin, each with its own backend, and rigid ones ([`instrument`]): tools held by a hand, and those that fall. Only
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
//! ([`linear::multigrid`], [`model::levels`]): x and y coarsened by two, z kept; each level and layer is one 24×24 matrix turned by its
//! children's mean rotation; z-columns solved exactly, three times, under a Chebyshev polynomial of degree 3, whose bound of the
//! spectrum is proved cell by cell. Iterations to 10⁻³ and 10⁻⁶ of the load on any grid: 4–5 and 9–11 at ν 0.45, 8–11 and 20–24 at ν
//! 0.49 (`benches/results`). Tried and left: degrees 1 (14 and 31 iterations at 16×16×5, ν 0.45), 2 (7 and 16) and 4 (4 and 9), which
//! cost as many products; Chebyshev polynomials of the fourth kind (no better); more sweeps on the coarsest level (nothing); four-colour
//! Gauss–Seidel over columns (in the prototype a little less work than degree 2, at four times the dispatches).
//!
//! f32 carries a step to about 10⁻⁶ of its displacement, whatever its recurrence promises; with `refinements` it ends at the rounding of
//! the displacement itself, 2·10⁻⁸.
//!
//! # Speed against error
//! [`report::study`] runs a scene in many settings and keeps the errors of grid, step, solver and rounding apart. Of the skin block under
//! 10 kPa (`benches/results/two_cores/study_skin_block`; steps of 5 ms, time beside the default's in the same run):
//!
//! | setting | total % | grid % | step % | solver % | time per step |
//! |---|---|---|---|---|---|
//! | the default: 20 × 20 × 5, B-bar, multigrid to 10⁻², f64 | 6.0 | 0.59 | 6.5 | 0.01 | 1.00 |
//! | the same with Newmark, f32 | 0.57 | 0.59 | 0.06 | 0.02 | 0.88 |
//! | Newmark, column to 10⁻¹, f32 | 0.64 | 0.59 | 0.06 | 0.46 | 0.53 |
//! | 10 × 10 × 3, Newmark, column to 10⁻¹, f32 | 5.6 | 6.3 | 0.26 | 2.0 | 0.07 |
//! | 40 × 40 × 10, Newmark, f32 | 0.05 | 0.10 | 0.13 | 0.03 | 4.95 |
//! | 40 × 40 × 10, 25 iterations of plain gradients, f64 | 62 | 0.10 | 6.7 | 56 | 6.34 |
//!
//! # What contact corrections cost
//! `cargo bench --bench contact` on two cores: `scenes/dental_probe.toml`, force on the instrument against everything solved to 10⁻⁹ by a
//! sparse factor, time per step beside the default's in the same run (all rows and what they say: `benches/results/two_cores/contact.md`).
//!
//! | correction | force error at hold % | over the run % | passes, mean | time per step |
//! |---|---|---|---|---|
//! | exact (the default: `tolerance = 1e-3`) | 0.04 | 1.3 | 2.6 | 1.00 |
//! | exact, `tolerance = 1e-1` | 0.75 | 10 | 1.7 | 0.79 |
//! | exact, `tolerance = 1e-5` | 0.004 | 0.02 | 4.0 | 1.89 |
//! | exact, `column_tolerance = 0.3` | 0.30 | 1.4 | 2.5 | 0.93 |
//! | exact, `max_passes = 1` | 6.0 | 8.9 | 1.0 | 0.61 |
//! | exact, `max_passes = 2` | 0.64 | 0.57 | 2.0 | 0.92 |
//! | `precomputed` | 9.0 | 13 | 1.0 | 0.58 |
//! | `uncoupled` | 1118 | 1071 | 1.0 | 0.32 |
//! | penalty, 100 N/m | 30 | 46 | – | 0.56 |
//! | penalty, 1000 N/m, 4 substeps | 53 | 128 | – | 3.14 |
//!
//! Passes set the error, how loosely columns are solved does not; a step cut short after one pass is about as wrong as columns at rest. The
//! skin without the tool takes 0.12 of a step.
//!
//! # The haptic side
//! Each device has a [`Servo`](haptic::servo::Servo): one plain function per tick, without allocation, lock or wait. It places the reading
//! in the scene, solves the newest [`Reduced`](haptic::Reduced) problem again with the hand where it is now, limits the force and watches the
//! energy ([`haptic::passivity`]). By the wall clock (`cutis run --realtime`) it runs in a thread of its own ([`haptic::thread`]): problems
//! come and hands go through triple buffers ([`haptic::cells`]), records through a ring, and a slow step costs the force, never a tick: it
//! is held by the last problem, fades when that is too old ([`haptic::guard`]), and comes back. By the scene's clock the same function runs
//! between the steps, so that a run repeats.
//!
//! # Rules that hold everywhere
//! - Imports go downward: main > cli > report > runner, output, view > step > haptic > backend > collide, cut > constraints, linear,
//!   instrument > model > mesh, gpu > kernels, scene > error, math. Modules of one level do not import each other (a test reads this).
//!   `gpu` knows no physics; `collide` alone names parry3d; `scene` alone reads scene syntax.
//! - SI units inside; scene keys carry their unit.
//! - The GPU keeps displacements, not positions; buffers are flat arrays of scalars, vec2 or vec4.
//! - One writer per array slot and a fixed order of sums. The CPU path gives the same bits on every x86-64 and aarch64 machine and for any
//!   number of threads ([`math::wide`], [`math::elementary`]); a GPU repeats its own bits, and differs from others within stated bounds. Who
//!   is left out: the sparse factor ([`linear::direct`]), pictures and plots.
//! - Core WebGPU limits: 8 storage buffers a kernel, no subgroups, no f64. Sizes beyond a limit are refused with its name.
//! - Solves stop at a residual relative to the step's load, never after a fixed count; what did not converge is counted.
//! - Bad input is an [`Error`](error::Error) that says where, what and how to mend; a broken invariant of ours is an assertion.

/// The version of wgpu that [`gpu::Gpu::from_wgpu`] takes devices of.
pub use wgpu;

pub mod backend;
pub mod collide;
pub mod constraints;
pub mod cut;
pub mod error;
pub mod gpu;
pub mod haptic;
pub mod instrument;
#[path = "../kernels/mod.rs"]
pub mod kernels;
pub mod linear;
pub mod math;
pub mod mesh;
pub mod model;
pub mod output;
pub mod report;
pub mod runner;
pub mod scene;
pub mod step;
pub mod view;
