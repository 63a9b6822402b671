//! CPU path: the kernels' twins in f32 or f64 on all cores; the reference for the GPU.

mod reserve;
mod solver;

use super::conserve::Conserved;
use super::{
    Backend, CORRECTION, Device, FREE, NOT_KEPT, Needs, Nonlinear, Query, Snapshot, SolveRequest, Target, Values,
    Vector,
};
use crate::bodies::cpu::{System, Workspace};
use crate::bodies::{Model, Removal, RestSprings, rate};
use crate::error::Result;
use crate::kernels::advance::Request;
use crate::kernels::cut::Hit;
use crate::kernels::{Params, ahead, blocks, bounds, cut, defect, duplicate, integrate, prescribe, rest_springs, rhs};
use crate::linear::Outcome;
use crate::math::{Real, V3, V4, round, widen};
use crate::scene::Mass;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// State and constant arrays of a body in one precision.
pub struct CpuBackend<R> {
    params: Params<R>,
    system: Box<dyn System<R>>,
    nonlinear: Nonlinear,
    elastic_at: f64, // τ of `bodies::Step::elastic_at`
    conserved: Option<Conserved>,
    ended: Vec<V4<f64>>, // velocities at the end of the step that conserve energy
    max_iterations: u32,
    interrupt: Arc<AtomicBool>,
    floor: f64,
    node_count: usize, // in use; `all_nodes` includes the reserve of duplicates
    all_nodes: usize,
    contact: bool,
    explicit: bool,
    driven: bool,       // has nodes on prescribed paths
    advanced: Vec<u32>, // nodes whose initial guess Newton's method keeps
    u: Vec<V4<R>>,
    v: Vec<V4<R>>,
    ahead: Vec<V4<R>>,  // for damped explicit steps; otherwise empty
    mean_v: Vec<V4<R>>, // for a consistent mass; otherwise empty
    f: Vec<V4<R>>,
    dofs: Vec<V4<R>>,   // DOF mask and mass as in A
    masses: Vec<V4<R>>, // DOF mask and mass without rest-shape springs; empty if there are none
    rest_springs: RestSprings,
    rest_stiffness: Vec<R>,
    mass_per_stiffness: f64,
    load: Vec<V4<R>>,
    load_squared: R,
    // [rhs][node]
    x: Vec<V4<R>>,
    r: Vec<V4<R>>,
    p: Vec<V4<R>>,
    s: Vec<V4<R>>,
    z: Vec<V4<R>>,
    w: Vec<V4<R>>,
    cutting: Option<Cutting<R>>,
    space: Vec<Workspace<R>>, // [rhs]
}

/// Segments that a blade can cut, and the positions of their ends.
struct Cutting<R> {
    ends: Vec<[u32; 2]>,
    rest: Vec<V4<R>>,
    point_u: Vec<V4<R>>,
    point_before: Vec<V4<R>>,
    kept: bool, // `point_before` is from the last step
}

impl<R: Real> Cutting<R> {
    fn new(model: &Model) -> Self {
        let segments = model.mechanics().segments(model);
        let rest: Vec<V4<R>> = segments.rest.iter().map(|p| V3::of(*p).pad(R::zero())).collect();
        let zeros = vec![[R::zero(); 4]; rest.len()];
        Self { ends: segments.ends, rest, point_u: zeros.clone(), point_before: zeros, kept: false }
    }
}

impl<R: Real> CpuBackend<R> {
    /// The body in its initial state, with the arrays that `needs` names.
    pub fn new(model: &Model, needs: Needs, max_iterations: u32, floor: f64, start: &Snapshot) -> Self {
        // sizes, and constructors of nodal arrays with room for the reserve
        let params: Params<R> = model.params();
        let (all_nodes, node_count) = (model.node_count(), params.nodes_in_use(&start.split));
        let rhs_count = needs.right_hand_sides();
        let solved = usize::from(!model.step.explicit()); // work vectors only if the step needs a solve
        let zeros = |of_node: usize| reserve::zeros(node_count * of_node, all_nodes * of_node);
        let in_use = |values: &[V4<f64>]| reserve::rounded(values, node_count);
        let system = model.system::<R>();
        let (rest_springs, mass_per_stiffness) = (model.rest_springs.clone(), rate(&model.step));
        let cutting = needs.cutting.then(|| Cutting::new(model));
        Self {
            params: Params { node_count: node_count as u32, ..params },
            nonlinear: Nonlinear::default(),
            elastic_at: model.step.elastic_at(),
            conserved: Conserved::of(model),
            ended: vec![],
            max_iterations,
            interrupt: Arc::default(),
            floor,
            node_count,
            all_nodes,
            contact: needs.contact,
            explicit: model.step.explicit(),
            driven: !model.paths.nodes.is_empty(),
            advanced: vec![],
            u: in_use(&start.u),
            v: in_use(&start.v),
            ahead: zeros(usize::from(model.step.lead_time() > 0.0)),
            mean_v: zeros(usize::from(model.mass == Mass::Consistent)),
            f: zeros(1),
            dofs: in_use(&model.in_system()),
            masses: if rest_springs.nodes.is_empty() { vec![] } else { in_use(&model.dofs) },
            rest_stiffness: rest_springs.stiffness.iter().map(|k| R::of(*k)).collect(),
            mass_per_stiffness,
            rest_springs,
            load: zeros(1),
            load_squared: R::zero(),
            x: zeros(rhs_count),
            r: zeros(rhs_count),
            p: zeros(solved * rhs_count),
            s: zeros(solved * rhs_count),
            z: zeros(solved * rhs_count),
            w: zeros(solved * rhs_count),
            cutting,
            space: vec![system.workspace(&params); rhs_count],
            system,
        }
    }

    /// DOF masks and masses without rest-shape springs.
    fn nodal_masses(&self) -> &[V4<R>] {
        if self.masses.is_empty() { &self.dofs } else { &self.masses }
    }

    /// Sets the right-hand side of the unconstrained motion from the elastic forces at the step's start; returns load², N².
    fn set_right_hand_side(&mut self) -> R {
        let v = if self.mean_v.is_empty() { &self.v } else { &self.mean_v };
        let masses = if self.masses.is_empty() { &self.dofs } else { &self.masses };
        let at = if self.ahead.is_empty() { &self.u } else { &self.ahead };
        let load_squared = rhs::rhs(&self.params, &self.f, v, masses, &self.load, &mut self.r);
        rest_springs::rest_springs(&self.rest_springs.nodes, &self.rest_stiffness, masses, at, &mut self.r);
        load_squared
    }

    /// Segments that swept quads crossed.
    fn crossed(&mut self, quads: &[[f64; 3]]) -> Vec<Hit<f64>> {
        let Some(c) = self.cutting.as_mut().filter(|_| !quads.is_empty()) else { return vec![] };
        assert!(c.kept, "{NOT_KEPT}");
        self.system.points(&self.params, &self.u, &mut c.point_u);
        let quads: Vec<V4<R>> = quads.iter().map(|p| V3::of(*p).pad(R::zero())).collect();
        let hits = cut::cut(&c.ends, &c.rest, &c.point_u, &c.point_before, &quads);
        hits.iter().map(|hit| Hit { segment: hit.segment, at: hit.at.f64() }).collect()
    }

    /// `[node]` in f64, with zeros for the nodes not in use.
    fn of_all(&self, values: &[V4<R>]) -> Vec<V4<f64>> {
        let mut all = widen(values);
        all.resize(self.all_nodes, [0.0; 4]);
        all
    }

    fn rhs_mut<'a>(&self, array: &'a mut [V4<R>], rhs: usize) -> &'a mut [V4<R>] {
        &mut array[rhs * self.node_count..(rhs + 1) * self.node_count]
    }
}

impl<R: Real> Backend for CpuBackend<R> {
    fn device(&self) -> Device {
        let arrays = [&self.u, &self.v, &self.f, &self.dofs, &self.masses, &self.load, &self.x];
        let solver = [&self.r, &self.p, &self.s, &self.z, &self.w, &self.ahead];
        let bytes: usize = arrays.iter().chain(&solver).map(|a| a.capacity()).sum();
        Device {
            backend: "cpu",
            precision: R::NAME,
            adapter: format!("{} threads", rayon::current_num_threads()),
            driver: String::new(),
            software: false,
            sums: "plain",
            device_bytes: (bytes * size_of::<V4<R>>()) as u64 + self.system.stored_bytes() as u64,
        }
    }

    fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = flag;
    }

    fn set_load(&mut self, load: &[[f64; 3]]) {
        self.load.iter_mut().zip(load).for_each(|(to, l)| *to = V3::of(*l).pad(R::zero()));
    }

    fn prescribe(&mut self, nodes: &[u32], target: &[[f64; 3]]) -> Result<()> {
        let target: Vec<V4<R>> = target.iter().map(|t| V3::of(*t).pad(R::zero())).collect();
        prescribe::prescribe(nodes, &target, &self.dofs, &self.u, &mut self.x);
        Ok(())
    }

    fn begin(&mut self) -> Result<()> {
        let params = self.params;
        self.advanced.clear();
        self.system.set_shift(0.0);
        ahead::ahead(&params, &self.u, &self.v, &mut self.ahead);
        let at = if self.ahead.is_empty() { &self.u } else { &self.ahead };
        self.system.forces(&params, &self.u, at, &mut self.f, &mut self.space[FREE].scratch)?;
        self.nonlinear = Nonlinear::default();
        self.system.mean_velocities(&params, &self.dofs, &self.v, &mut self.mean_v);
        self.load_squared = self.set_right_hand_side();
        if self.explicit {
            return Ok(());
        }
        self.system.refresh(&params, &self.dofs);
        Ok(())
    }

    fn add_defect(&mut self, corrected: bool) -> Result<()> {
        let (n, zero) = (self.node_count, [R::zero(); 4]);
        // the increment so far, and where it ends
        let (dx, others) = self.x.split_at_mut(n);
        if corrected {
            dx.iter_mut().zip(others).for_each(|(dx, by)| *dx = (V3::from4(*dx) + V3::from4(*by)).pad(R::zero()));
        }
        let moved = self.u.iter().zip(&*dx).map(|(u, dx)| (V3::from4(*u) + V3::from4(*dx)).pad(R::zero()));
        let (end, mut f_end) = (moved.collect::<Vec<_>>(), vec![zero; n]);
        self.set_right_hand_side();
        if self.system.forces_of_law(&self.params, &end, &mut f_end) {
            let mut w = vec![zero; n];
            let Self { params, system, dofs, x, f, r, space, .. } = self;
            system.product(params, dofs, &x[..n], &mut w, &mut space[FREE].scratch);
            defect::defect(params, &w, x, dofs, f, &f_end, r);
        }
        Ok(())
    }

    fn set_rows(&mut self, rhs_ids: &[usize], entries: &[(usize, u32, [f64; 3])]) -> Result<()> {
        let mut r = std::mem::take(&mut self.r);
        for rhs in rhs_ids {
            self.rhs_mut(&mut r, *rhs).fill([R::zero(); 4]);
        }
        for (rhs, node, value) in entries {
            let axes = V3::from4(self.dofs[*node as usize]);
            r[rhs * self.node_count + *node as usize] = V3::of(*value).times(axes).pad(R::zero());
        }
        self.r = r;
        Ok(())
    }

    fn add_forces(&mut self, entries: &[(u32, [f64; 3])]) -> Result<()> {
        for (node, value) in entries {
            let node = *node as usize;
            let force = V3::of(*value).times(V3::from4(self.dofs[node]));
            self.r[node] = (V3::from4(self.r[node]) + force).pad(R::zero());
        }
        Ok(())
    }

    fn set_vector(&mut self, which: Vector, rhs: usize, values: &[V4<f64>]) -> Result<()> {
        let array = if which == Vector::Solution { &mut self.x } else { &mut self.r };
        let nodes = rhs * self.node_count..(rhs + 1) * self.node_count;
        array[nodes].iter_mut().zip(values).for_each(|(to, v)| *to = round(v));
        Ok(())
    }

    fn reset_initial_guess(&mut self, rhs_ids: &[usize]) -> Result<()> {
        for rhs in rhs_ids {
            self.x[rhs * self.node_count..(rhs + 1) * self.node_count].fill([R::zero(); 4]);
        }
        Ok(())
    }

    fn advance_guess(&mut self, rhs: usize, entries: &[(u32, [f64; 3])]) -> Result<()> {
        for (node, by) in entries {
            let at = rhs * self.node_count + *node as usize;
            self.x[at] = (V3::from4(self.x[at]) + V3::of(*by)).pad(R::zero());
        }
        if rhs == FREE {
            self.advanced = entries.iter().map(|(node, _)| *node).collect();
        }
        Ok(())
    }

    fn solve(&mut self, requests: &[SolveRequest], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        if self.explicit {
            return Ok(self.accelerate(requests, pick));
        }
        match requests {
            [SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) }] if self.system.newton() => {
                let outcome = self.newton(*tolerance)?;
                Ok((vec![outcome], self.picked(pick)))
            }
            _ => self.solve_linear(requests, pick),
        }
    }

    fn nonlinear(&self) -> Nonlinear {
        self.nonlinear
    }

    fn set_correction(&mut self, nodes: &[(u32, [f64; 3])]) -> Result<()> {
        self.reset_initial_guess(&[CORRECTION])?;
        for (node, dx) in nodes {
            let axes = V3::from4(self.dofs[*node as usize]);
            self.x[self.node_count + *node as usize] = V3::of(*dx).times(axes).pad(R::zero());
        }
        Ok(())
    }

    fn node_blocks(&mut self, nodes: &[u32]) -> Result<Vec<[[f64; 3]; 3]>> {
        let params = Params { preconditioner: 2, ..self.params };
        let mut out = vec![[R::zero(); 4]; self.node_count * 4];
        self.system.blocks(&params, &self.dofs, &mut out);
        let read = |n: &u32| {
            let d = blocks::unpack(&out[*n as usize * 4..*n as usize * 4 + 4]).d;
            d.0.map(V3::f64)
        };
        Ok(nodes.iter().map(read).collect())
    }

    fn finish(&mut self, corrected: bool, cuts: bool) -> Result<()> {
        if let Some(c) = &mut self.cutting {
            c.kept = cuts;
            if cuts {
                self.system.points(&self.params, &self.u, &mut c.point_before);
            }
        }
        let params = Params { rhs_count: if corrected { 2 } else { 1 }, ..self.params };
        integrate::integrate(&params, &mut self.x, &mut self.u, &mut self.v);
        self.v.iter_mut().zip(std::mem::take(&mut self.ended)).for_each(|(to, v)| *to = round(&v));
        Ok(())
    }

    fn read(&mut self, query: &Query) -> Result<Values> {
        let at = |values: &[V4<R>], nodes: &[u32]| nodes.iter().map(|n| V3::from4(values[*n as usize]).f64()).collect();
        let tiles = if self.contact && query.bounds { bounds::tile_count(&self.params) } else { 0 };
        let of = |tile| bounds::bounds_of_tile(&self.params, &self.u, tile).map(|v| v.map(R::f64));
        Ok(Values {
            displacements: at(&self.u, &query.displacements),
            velocities: at(&self.v, &query.velocities),
            elastic_forces: at(&self.f, &query.elastic_forces),
            bounds: (0..tiles).into_par_iter().map(of).collect(),
            hits: self.crossed(&query.quads),
        })
    }

    fn remove(&mut self, removal: &Removal) -> Result<()> {
        self.system.take(&self.params, removal);
        self.take_reserve();
        for values in [&mut self.u, &mut self.v, &mut self.x] {
            duplicate::duplicate(self.node_count, &removal.copies, values);
        }
        for (node, value) in &removal.dofs {
            let in_system = self.rest_springs.in_system(self.mass_per_stiffness, *node, *value);
            let node = *node as usize;
            self.dofs[node] = round(&in_system);
            if let Some(mass) = self.masses.get_mut(node) {
                *mass = round(value);
            }
            if value[3] == 0.0 {
                // a node without cells leaves the system where it is
                self.v[node] = [R::zero(); 4];
                for rhs in self.x.chunks_mut(self.node_count) {
                    rhs[node] = [R::zero(); 4];
                }
            }
        }
        Ok(())
    }

    fn set_state(&mut self, u: &[V4<f64>], v: &[V4<f64>], rotation: &[V4<f64>]) -> Result<()> {
        let set = |to: &mut [V4<R>], from: &[V4<f64>]| to.iter_mut().zip(from).for_each(|(to, from)| *to = round(from));
        set(&mut self.u, u);
        set(&mut self.v, v);
        self.system.set_rotations(rotation);
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Snapshot> {
        let (rotation, law, split) = (self.system.rotations(), self.system.law(), self.system.split().to_vec());
        let [u, v, dofs] = [&self.u[..], &self.v, self.nodal_masses()].map(|values| self.of_all(values));
        Ok(Snapshot { u, v, rotation, split, dofs, law, shares: vec![] })
    }

    fn displacements(&mut self) -> Result<Vec<V4<f64>>> {
        Ok(self.of_all(&self.u))
    }

    fn solution(&mut self, rhs: usize) -> Result<Vec<V4<f64>>> {
        Ok(self.of_all(&self.x[rhs * self.node_count..(rhs + 1) * self.node_count]))
    }
}

fn request<R: Real>(target: Target, floor: f64, driven: bool) -> Request<R> {
    let (tolerance, reference, use_load) = match target {
        Target::OfLoad(t) => (t, 0.0, R::of(if driven { 2.0 } else { 1.0 })),
        Target::Absolute(norm) | Target::Loose(norm, _) => (1.0, norm * norm, R::zero()),
    };
    Request {
        tolerance_squared: R::of(tolerance * tolerance),
        reference_squared: R::of(reference),
        floor_squared: R::of(floor * floor),
        use_load,
    }
}

const _: () = assert!(FREE == 0 && CORRECTION == 1);
