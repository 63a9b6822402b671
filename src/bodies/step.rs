//! Constants of the time step for each integrator.
//!
//! The unknowns are displacement increments: `A Δx = b`, `A = inertia · M + stiffness_factor · K`, `b = f_ext − f_int + momentum_factor · M v/h`,
//! then `u' = u + Δx`, `v' = v + velocity_factor (Δx/h − v)`. With Rayleigh damping `C = r_M M + r_K K`:
//!
//! | integrator | inertia | stiffness factor | momentum factor | velocity factor | `f_int` of `b` at | a step solved to its balance: at |
//! | --- | --- | --- | --- | --- | --- | --- |
//! | implicit Euler | `(1 + h r_M)/h²` | `1 + r_K/h` | 1 | 1 | `u` | `u + Δx` |
//! | Newmark, β ¼, γ ½ | `(2 + h r_M)/h²` | `½ + r_K/h` | 2 | 2 | `u` | (linear law) |
//! | midpoint | the same | the same | 2 | 2 | `u` | `u + Δx/2` |
//! | symplectic Euler | `1/h²` | 0 | `1 − h r_M` | 1 | `u + r_K v` | `u + r_K v` |
//! | static | 10⁻⁹ s⁻², or as below | 1 | 0 | 0 | `u` | `u + Δx` |
//!
//! Newmark's `u' = u + h v + h²/4 (a + a')`, `v' = v + h/2 (a + a')` are the trapezoidal rules `Δx = h/2 (v + v')`,
//! `v' − v = h/2 (a + a')`. Inserted into the sum of the balances `M a + C v + K u = f` at both ends they eliminate `a`, so it is not
//! stored: `(2/h² M + C/h + K/2) Δx = f_ext − f_int + 2 M v/h`. The trajectories are exactly Newmark's if the loads are constant within a
//! step and the initial acceleration satisfies the balance.
//!
//! The implicit midpoint rule is `Δx = h/2 (v + v')`, `M (v' − v) = h (f_ext − f_int(u + Δx/2) − C Δx/h)`: for a linear law the same method. It
//! keeps linear and angular momentum, and for a nonlinear law the energy up to an excess that is taken from the velocities at the end of each step
//! (`src/backend/conserve.rs`). Symplectic Euler is `v' = v + h M⁻¹ (f_ext − f_int − C v)`, `u' = u + h v'`,
//! stable up to [`super::Model::stable_step`]. A static step is repeated until the forces balance; its trace of inertia keeps a rigid-body
//! mode that nothing holds from being singular. A body that is held by its contacts or by ties to others alone has more of it
//! ([`Step::yield_slowly`]), which changes the way to the balance and not the balance.
//! Source: Newmark 1959; Hughes 1987, chapter 9; Hairer, Lubich, Wanner 2003 (symplectic Euler); Simo, Tarnow 1992 (momenta and energy of the
//! midpoint rule).
//!
//! A nonlinear law and second order: average acceleration that keeps the energy of a linear body gains energy without bound where the law is not
//! linear (Hughes, Caughey, Liu 1978), and so does the midpoint rule by itself. The linearised step of corotational hexahedra and springs is the
//! same by both, so for these laws there is no second-order integrator here; hyperelastic bodies have the midpoint rule ([`Integrator::fits`]).
//!
//! Effect on an undamped vibration `ω`, `z = h ω` (tests/verify/integrators.rs checks each entry):
//!
//! | integrator | fraction of amplitude lost per period | energy | period, relative | order |
//! | --- | --- | --- | --- | --- |
//! | implicit Euler | `1 − (1 + z²)^(−π/atan z)`: 27 % at z 0.1 | decreases in every step | `z/atan z` | 1 |
//! | Newmark | 0 | constant | `z/(2 atan(z/2))` | 2 |
//! | symplectic Euler | 0 up to `z = 2` | oscillates by up to `z/2` of it, no drift | `z/(2 asin(z/2))` | 1 |
//!
//! Effect on skin: the block of scenes/verify/skin_block_045.toml (20×20×5 cells), one millisecond after its load is released, undamped,
//! CPU path, solves to 10⁻⁶ (same tests, with `CUTIS_MEASURED=1`; times relative to implicit Euler with 8 steps in the same run):
//!
//! | integrator | steps in 1 ms | energy left | error, of the initial displacement | time per step |
//! | --- | --- | --- | --- | --- |
//! | implicit Euler | 1, 8, 64 | 2.9 %, 4.7 %, 54 % | 63 %, 56 %, 14 % | 1.07, 1, 0.69 |
//! | Newmark | 1, 8, 64 | 100.0 % | 123 %, 21 %, 2.4 % | 1.03, 0.91, 0.58 |
//! | symplectic Euler | 446 (the stable step) | 103 % | 0.45 % | 0.007 |
//!
//! Per millisecond, explicit steps cost as much as 3 implicit ones here, undamped. With the default `r_K` of 10 ms their stable step is 10⁴
//! times shorter: stiffness damping needs implicit steps.

use crate::scene::{Integrator, Preconditioner, Scene, Skin};

/// Factor of `M` in `A` of a static step, 1/s².
const STATIC_INERTIA: f64 = 1e-9;

/// Inertia of a floating body in static steps, as a share of `E/(ρ L²)`, a measure of its lowest vibration: its rigid-body modes then give way
/// a thousand times as much as its shape. With 10⁻⁹ s⁻² they give way 10¹² times as much, and rounding was all that contact forces saw.
const FLOATING_SHARE: f64 = 1e-3;

/// Constants of the time step.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// s
    pub step: f64,
    /// m/s²
    pub gravity: [f64; 3],
    /// 1/s
    pub rayleigh_mass: f64,
    /// s
    pub rayleigh_stiffness: f64,
    /// Code of `Params::preconditioner`.
    pub preconditioner: u32,
    /// Integrator.
    pub integrator: Integrator,
    /// Factor of `M` in `A` of static steps, 1/s².
    pub(super) static_inertia: f64,
}

impl Step {
    /// Constants for a body of the scene.
    pub(super) fn new(scene: &Scene, skin: &Skin) -> Self {
        Self {
            step: scene.time.part(),
            gravity: scene.time.gravity,
            rayleigh_mass: skin.rayleigh_mass,
            rayleigh_stiffness: skin.rayleigh_stiffness,
            preconditioner: match scene.solver.preconditioner {
                Preconditioner::None => 0,
                Preconditioner::Jacobi => 1,
                Preconditioner::Block => 2,
                Preconditioner::Column | Preconditioner::Multigrid | Preconditioner::Direct => 3,
            },
            integrator: scene.time.integrator,
            static_inertia: STATIC_INERTIA,
        }
    }

    /// Has a floating body of an extent, m, give way to forces in static steps no more than a thousand times as far as its shape does.
    pub fn yield_slowly(&mut self, skin: &Skin, extent: f64) {
        let softest = skin.layers.iter().map(|layer| layer.young / layer.density).fold(f64::INFINITY, f64::min);
        let inertia = FLOATING_SHARE * softest / (extent * extent);
        self.static_inertia = if inertia.is_finite() { inertia.max(STATIC_INERTIA) } else { STATIC_INERTIA };
    }

    /// True if the system matrix is diagonal, so that no solve is needed.
    pub fn explicit(&self) -> bool {
        self.integrator == Integrator::SymplecticEuler
    }

    /// Factor of `M` in `A`, 1/s².
    pub fn inertia(&self) -> f64 {
        let (h, drag) = (self.step, self.rayleigh_mass);
        match self.integrator {
            Integrator::ImplicitEuler => (1.0 + h * drag) / (h * h),
            Integrator::Newmark | Integrator::Midpoint => (2.0 + h * drag) / (h * h),
            Integrator::SymplecticEuler => 1.0 / (h * h),
            Integrator::Static => self.static_inertia,
        }
    }

    /// `τ`: a step has the elastic forces at `u + τ Δx`.
    pub fn elastic_at(&self) -> f64 {
        match self.integrator {
            Integrator::ImplicitEuler | Integrator::Static => 1.0,
            Integrator::Newmark | Integrator::Midpoint => 0.5,
            Integrator::SymplecticEuler => 0.0,
        }
    }

    /// Factor of `K` in `A`.
    pub fn stiffness_factor(&self) -> f64 {
        match self.integrator {
            Integrator::SymplecticEuler => 0.0,
            Integrator::Static => 1.0,
            _ => self.elastic_at() + self.rayleigh_stiffness / self.step,
        }
    }

    /// Coefficient of `M v/h` in `b`.
    pub fn momentum_factor(&self) -> f64 {
        match self.integrator {
            Integrator::ImplicitEuler => 1.0,
            Integrator::Newmark | Integrator::Midpoint => 2.0,
            Integrator::SymplecticEuler => 1.0 - self.step * self.rayleigh_mass,
            Integrator::Static => 0.0,
        }
    }

    /// Velocity factor: change of velocity over a step relative to the change to the mean velocity.
    pub fn velocity_factor(&self) -> f64 {
        match self.integrator {
            Integrator::Newmark | Integrator::Midpoint => 2.0,
            Integrator::Static => 0.0,
            _ => 1.0,
        }
    }

    /// Lead time of the elastic forces: they are evaluated at `u + τ v`, s.
    pub fn lead_time(&self) -> f64 {
        if self.explicit() { self.rayleigh_stiffness } else { 0.0 }
    }
}
