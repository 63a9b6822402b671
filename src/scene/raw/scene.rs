//! Tables of the whole scene: the file, time, solvers, contact.

use super::*;
use crate::scene::{Correction, Filter, Integrator, Preconditioner};

table! {
    struct Scene = "The file" {
        /// One line on what the scene shows.
        title: text,
    }
    beside {
        time: Table<Time>,
        solver: Option<Table<Solver>>,
        skin: Option<Table<Skin>>,
        #[serde(default)]
        block: Vec<Table<Skin>>,
        #[serde(default)]
        rigid: Vec<Table<Rigid>>,
        #[serde(default)]
        plane: Vec<Table<Plane>>,
        #[serde(default)]
        attach: Vec<Table<Attach>>,
        #[serde(default)]
        boundary: Vec<Table<Boundary>>,
        #[serde(default)]
        rest_spring: Vec<Table<RestSpring>>,
        #[serde(default)]
        inclusion: Vec<Table<Inclusion>>,
        #[serde(default)]
        load: Vec<Table<Load>>,
        #[serde(default)]
        tool: Vec<Table<Tool>>,
        contact: Option<Table<Contact>>,
        haptic: Option<Table<Haptic>>,
        #[serde(default)]
        probe: Vec<Table<Probe>>,
        #[serde(default)]
        check: BTreeMap<At<String>, Table<Check>>,
        study: Option<Table<Study>>,
        test: Option<Table<Test>>,
        view: Option<Table<View>>,
        output: Option<Table<Output>>,
    }
}

table! {
    struct Time = "`[time]`" {
        /// Length of a step.
        step_ms: number(MS, > 0),
        /// Length of the run, at least one step.
        duration_s: number(SECOND, > 0),
        /// Acceleration of gravity.
        gravity_m_s2: vector(3, ACCELERATION) = [0.0, 0.0, -9.81],
        /// Parts that each step is divided into; results are of whole steps.
        substeps: count(1 ..= 10000) = 1,
        /// Time integration; Newmark's method (linear law), the midpoint rule (linear and hyperelastic laws) and symplectic Euler are for
        /// one body that touches nothing, static steps not for `[[rigid]]` bodies or blades.
        integrator: choice(Integrator:
            "implicit_euler" => Integrator::ImplicitEuler, "newmark" => Integrator::Newmark,
            "midpoint" => Integrator::Midpoint, "symplectic_euler" => Integrator::SymplecticEuler,
            "static" => Integrator::Static
        ) = "implicit_euler",
    }
}

table! {
    struct Solver: Default = "`[solver]`" {
        /// Preconditioner of the conjugate gradients; `"direct"` is a sparse Cholesky factor of hexahedra on the CPU path. `"multigrid"` of
        /// tetrahedra is that of a grid of hexahedra over them: for statics and meshes of more than some thousand nodes.
        preconditioner: choice(Preconditioner:
            "none" => Preconditioner::None, "jacobi" => Preconditioner::Jacobi, "block" => Preconditioner::Block,
            "column" => Preconditioner::Column, "multigrid" => Preconditioner::Multigrid,
            "direct" => Preconditioner::Direct
        ) or "(`\"multigrid\"`; springs: `\"column\"`; tetrahedra, and springs of a mesh: `\"block\"`)",
        /// Residual of a solve relative to the load of the step.
        tolerance: number(PLAIN, 0 < x < 1) = 1e-3,
        /// Residual below which a solve ends whatever the load is.
        floor_n: number(NEWTON, >= 0) = 1e-10,
        /// Iterations of a solve at most; beyond, the step counts as not converged.
        max_iterations: count(1 ..= 4294967295) = 1000,
        /// Solve each step of a hyperelastic body to its nonlinear balance: by Newton's method, or with contact and for tetrahedra by
        /// repeated linear solves; otherwise a step is one linear solve.
        newton: flag = false,
        /// Rounds of iterative refinement with the residual in f64; not with Newton's method.
        refinements: count(0 ..= 100) = 0,
        /// Steps between two checks of the residual, energy and inverted cells in f64; by the wall clock the last step alone is checked.
        true_residual_every: count(1 ..= 4294967295) = 20,
    }
}

table! {
    struct Contact: Default = "`[contact]`" {
        /// Coulomb's coefficient.
        friction: number(PLAIN, >= 0) = 0.3,
        /// Distance within which contacts are made.
        alarm_mm: number(MM, > 0) = 0.5,
        /// Gap at rest of points and flats.
        distance_mm: number(MM, >= 0) = 0.0,
        /// Signorini's and Coulomb's laws, or springs on the penetration.
        forces: choice(bool: "constraints" => false, "penalty" => true) = "constraints",
        /// Of `forces = "penalty"`.
        penalty_n_m: number(STIFFNESS, > 0) or "",
        /// Compliance of the bodies: their own, that at rest (without a blade), or block-diagonal: each node by itself.
        correction: choice(Correction:
            "exact" => Correction::Exact, "precomputed" => Correction::Precomputed,
            "uncoupled" => Correction::Uncoupled
        ) = "exact",
        /// Contacts of round tools and tools of lines: all pairs, one, or local minima of the distance.
        filter: choice(Filter:
            "points" => Filter::Points, "one" => Filter::One, "cones" => Filter::Cones
        ) or "(`\"points\"` of round tools, `\"cones\"` of lines)",
        /// Of `filter = "cones"`: sine by which normal cones are widened; 0.02 if absent.
        angle_cone: number(PLAIN, >= 0) or "",
        /// Contacts of a step at most; those that bear a force and the deepest are kept, the others counted.
        max_contacts: count(1 ..= 4294967295) = 16,
        /// Share of the forces that one more pass may change.
        tolerance: number(PLAIN, 0 < x < 1) = 1e-3,
        /// How exactly columns of the compliance are solved.
        column_tolerance: number(PLAIN, 0 < x < 1) = 0.2,
        /// Corrections of a step at most.
        max_passes: count(1 ..= 100) = 16,
        /// The lips of wounds rest on each other.
        lips: flag = false,
    }
}

table! {
    struct Haptic: Default = "`[haptic]`" {
        /// Ticks per second.
        rate_hz: within(HERTZ, 100 ..= 4000) = 1000.0,
    }
}

table! {
    /// The form in which the tests run the scene.
    struct Test = "`[test]`" {
        /// Hexahedra along x and y.
        cells: counts(1 ..= 4294967295) or "(the scene's)",
        /// Steps.
        steps: count(1 ..= 4294967295) or "(the scene's)",
    }
}
