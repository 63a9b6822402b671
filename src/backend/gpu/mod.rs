//! GPU path: the same arrays and kernels in WGSL, f32.
//!
//! Commands are recorded and submitted with the next read-back. A step without contact is one submission; a step with contact adds one per
//! pass of the correction, and one that reads all that the host asks of the new state. A solve is recorded with a few more iterations than the last one of its kind took. Converged right-hand sides
//! skip their work; if one has not converged, more iterations are submitted.

mod arrays;
mod defect;
mod exchange;
mod explicit;
mod newton;
mod paths;
mod rest_springs;
mod solver;
mod split;

use super::{Backend, CORRECTION, Device, FREE, Needs, Nonlinear, Query, Snapshot, SolveRequest, Values, Vector};
use crate::bodies::gpu::{Arrays, Dispatch, Maker, Recorded, over_columns, over_nodes, untouched};
use crate::bodies::{Model, Removal};
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::{GROUP, Params, blocks, factor, integrate, rhs};
use crate::linear::Outcome;
use crate::math::{V3, V4, round};
use arrays::{Body, Bounds, Cutting, axes, compensation_survives};
use defect::Defect;
use exchange::{Gather, Scatter};
use newton::Newton;
use paths::Driven;
use rest_springs::RestSpringPass;
use solver::Solver;
use split::Split;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Minimum number of values per right-hand side that one read-back can hold; more need another submission.
const PICKED: usize = 1024;

/// State of a body on the device.
pub struct GpuBackend {
    gpu: Arc<Gpu>,
    params: Params<f32>,
    node_count: usize,
    rotates: bool, // its elements are cells, which have rotations
    max_iterations: u32,
    interrupt: Arc<AtomicBool>,
    floor: f64,
    expected: [u32; 3], // iterations of the last solve of a step's motion, of the correction, and of the motion again
    pending: Option<Batch>,
    unread: Option<u32>, // explicit bodies: steps submitted since the last wait
    rows_pending: bool,
    axes: Vec<V3<f32>>, // [node] 1 free, 0 fixed
    bytes: u64,
    body: Body,
    rest_springs: Option<RestSpringPass>,
    solver: Solver,
    newton: Option<Newton>,
    driven: Option<Driven>,
    begin: Vec<Dispatch>,
    right_hand_side: Vec<Dispatch>, // of the unconstrained motion; part of `begin`
    defect: Option<Defect>,
    integrate: [Bound; 2], // without and with the correction
    pick: Gather,
    put: Option<Scatter>,
    bounds: Option<Bounds>,
    cutting: Option<Cutting>,
    split: Option<Split>,
    kind: Box<dyn Recorded>,
    node_blocks: Option<(Bound, Buffer)>,
}

impl GpuBackend {
    /// The body in its initial state on a device, with the arrays that `needs` names. On a dry device a model of sizes
    /// ([`Model::of_sizes`]) and an empty state do.
    ///
    /// # Errors
    /// If an array exceeds a limit of the adapter or a kernel does not compile.
    pub fn new(
        gpu: impl Into<Arc<Gpu>>,
        model: &Model,
        needs: Needs,
        max_iterations: u32,
        floor: f64,
        start: &Snapshot,
    ) -> Result<Self> {
        let gpu: Arc<Gpu> = gpu.into();
        let (n, rhs_count) = (model.node_count(), needs.right_hand_sides());
        let mut made = Maker::new(&gpu);
        gpu.making("probe of sums");
        let compensated = u32::from(compensation_survives(&mut made)?);
        let params = Params { rhs_count: rhs_count as u32, compensated, ..model.params::<f32>() };
        // state and constant arrays of the law
        gpu.making("state");
        let main = made.params(&params);
        let (u, v) = (made.with("u", n, || rounded(&start.u))?, made.with("v", n, || rounded(&start.v))?);
        let explicit = model.step.explicit();
        let ahead = explicit::Ahead::new(&mut made, model, &main, &u, &v)?;
        let (f, load) = (made.vec4("f", n)?, made.vec4("load", n)?);
        let dofs = made.with("dofs", n, || rounded(&model.in_system()))?;
        let rest_springs = RestSpringPass::new(&mut made, model)?;
        let masses = rest_springs.as_ref().map_or(&dofs, |a| &a.masses).clone();
        let mut kind = model.mechanics().recorded(model, &mut made, &u, &params)?;
        let elements = kind.elements();
        // preconditioner blocks; those of unused nodes keep their initial values
        gpu.making("columns");
        let grid_nodes = model.own_nodes();
        let block = made.vec4("block", if explicit { 0 } else { n * 4 })?;
        if !explicit && !gpu.is_dry() {
            gpu.write(&block, grid_nodes as u64 * 64, &untouched(n - grid_nodes));
        }
        gpu.making("solver");
        let partial_load = made.zeros::<f32>("partial_load", n.div_ceil(GROUP as usize))?;
        // the conjugate gradients, bound to these arrays by name
        let state = [&u, &v, &f, &load, &dofs, &block, &partial_load].map(Buffer::clone);
        let arrays = kind.shared().joined(&Arrays::of(&state));
        let solver = Solver::new(&mut made, model, kind.as_mut(), &arrays, params, &main, needs.contact)?;
        let newton = kind.nonlinear(&mut made, &arrays, &solver.x)?.map(|law| Newton::new(law, params, model));
        // Newton's method has the increments of a step in an array of its own
        let increments = newton.as_ref().map_or(&solver.x, Newton::increments);
        let driven = Driven::new(&mut made, model, &dofs, &u, increments)?;
        gpu.making("solver");
        let of_main = |source, more: &[(&'static str, &Buffer)]| {
            arrays.bind(&gpu, source, &[&[("params", &main)], more].concat())
        };
        // dispatches at the start of a step: rotations, forces, right-hand side, blocks and factors, coarse levels
        let mut begin: Vec<Dispatch> = ahead.iter().map(|a| a.kernel.clone()).collect();
        begin.extend(kind.forces(&gpu, &arrays, &main, ahead.as_ref().map(|a| &a.y))?);
        let mean_v = kind.mean_velocities();
        let mean_v = mean_v.as_ref().unwrap_or(&v);
        let sums = of_main(&rhs::SOURCE, &[("b", &solver.r), ("v", mean_v), ("dofs", &masses)])?;
        let mut right_hand_side = vec![(sums, over_nodes(&params))];
        let at = ahead.as_ref().map_or(&u, |a| &a.y);
        right_hand_side.extend(rest_springs.iter().map(|a| a.bind(&gpu, at, &solver.r)).collect::<Result<Vec<_>>>()?);
        begin.extend(right_hand_side.iter().cloned());
        if !explicit {
            begin.push((kind.blocks(&gpu, &arrays, &[("params", &main)])?, over_nodes(&params)));
            begin.push((of_main(&factor::SOURCE, &[])?, over_columns(&params)));
        }
        begin.extend(solver.refresh.iter().cloned());
        // integration of the unconstrained motion alone, or with the correction
        let single = made.params(&Params { rhs_count: 1, ..params });
        let integrate =
            |params: &Buffer| arrays.bind(&gpu, &integrate::SOURCE, &[("params", params), ("x", &solver.x)]);
        let integrate = [integrate(&single)?, integrate(&main)?];
        let defect = match needs.in_full {
            true => {
                let solved = [&solver.x, &solver.r];
                Some(Defect::new(&mut made, model, kind.as_mut(), &arrays, solved, [&single, &main])?)
            }
            false => None,
        };
        gpu.making("exchange with the host");
        // host exchange: gathered values, scattered values, bounding boxes of tiles, swept quads
        let picked = n.min(needs.near.max(PICKED)) * rhs_count;
        let pick = Gather::new(&mut made, picked, [&solver.x, &u, &v, &f])?;
        let most = n.max(elements.as_ref().map_or(0, |elements| (elements.bytes / 16) as usize));
        let changes = needs.contact || needs.cutting || needs.breaking;
        let put = if changes { Some(Scatter::new(&mut made, most, &solver.r)?) } else { None };
        let bounds = if needs.contact { Some(Bounds::new(&mut made, model, &main, &u)?) } else { None };
        gpu.making("cut");
        let cutting =
            if needs.cutting { Some(Cutting::new(&mut made, model, &main, kind.as_ref(), &u)?) } else { None };
        gpu.making("exchange with the host");
        let own_blocks = |made: &mut Maker| -> Result<(Bound, Buffer)> {
            let out = made.vec4("block", n * 4)?;
            let params = made.params(&Params { preconditioner: 2, ..params });
            Ok((kind.blocks(&gpu, &arrays, &[("params", &params), ("block", &out)])?, out))
        };
        let node_blocks = needs.node_blocks.then(|| own_blocks(&mut made)).transpose()?;
        gpu.making("cut");
        // node duplication comes last, because it needs all arrays
        let split = Split::new(&mut made, model, kind.as_ref(), &[(&u, 1), (&v, 1), (&solver.x, rhs_count as u32)])?;
        let bytes = made.bytes;
        gpu.check_health()?; // report allocation failures before anything runs
        Ok(Self {
            params,
            node_count: n,
            rotates: model.mechanics().rotation_count(model) > 0,
            max_iterations,
            interrupt: Arc::default(),
            floor,
            expected: [8; 3],
            pending: None,
            unread: explicit.then_some(0),
            rows_pending: false,
            axes: model.dofs.iter().map(|f| axes(*f)).collect(),
            bytes,
            body: Body { u, v, dofs, masses, load, elements },
            rest_springs,
            solver,
            newton,
            driven,
            begin,
            right_hand_side,
            defect,
            integrate,
            pick,
            put,
            bounds,
            cutting,
            split,
            kind,
            node_blocks,
            gpu,
        })
    }

    fn record(&mut self) -> Batch {
        self.pending.take().unwrap_or_else(|| {
            self.rows_pending = false;
            self.gpu.batch()
        })
    }

    /// Writes (rhs, node, N) entries into right-hand sides, or adds them; zeroes `rhs_ids` first.
    fn scatter_rows(&mut self, rhs_ids: &[usize], entries: &[(usize, u32, [f64; 3])], add: bool) -> Result<()> {
        let mut batch = self.record();
        if self.rows_pending {
            // the entries below would overwrite those that the batch still has to scatter
            self.gpu.submit(batch);
            batch = self.gpu.batch();
        }
        self.rows_pending = true;
        let bytes = self.offset(1);
        for rhs in rhs_ids {
            batch.clear(&self.solver.r, self.offset(*rhs), bytes);
        }
        let ids: Vec<u32> = entries.iter().map(|(s, n, _)| (s * self.node_count) as u32 + n).collect();
        let masked = |n: u32, v: [f64; 3]| V3::of(v).times(self.axes[n as usize]).pad(0.0);
        let values: Vec<V4<f32>> = entries.iter().map(|(_, n, v)| masked(*n, *v)).collect();
        if let Some(put) = &self.put {
            self.gpu.write(&put.row_params, 0, &[ids.len() as u32, u32::from(add), 0, 0]);
            self.gpu.write(&put.ids, 0, &ids);
            self.gpu.write(&put.values, 0, &values);
            batch.run(&put.rows, ids.len(), 1);
        }
        self.pending = Some(batch);
        Ok(())
    }

    fn offset(&self, rhs: usize) -> u64 {
        (rhs * self.node_count * 16) as u64
    }
}

impl Backend for GpuBackend {
    fn device(&self) -> Device {
        let a = &self.gpu.adapter;
        Device {
            backend: "gpu",
            precision: "f32",
            adapter: format!("{} ({})", a.name, a.backend),
            driver: a.driver.clone(),
            software: a.software,
            sums: if self.params.compensated == 1 { "compensated" } else { "plain" },
            device_bytes: self.bytes,
        }
    }

    fn interrupt_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = flag;
    }

    fn set_load(&mut self, load: &[[f64; 3]]) {
        let load: Vec<V4<f32>> = load.iter().map(|l| V3::of(*l).pad(0.0)).collect();
        self.gpu.write(&self.body.load, 0, &load);
    }

    fn prescribe(&mut self, nodes: &[u32], target: &[[f64; 3]]) -> Result<()> {
        self.drive(nodes, target);
        Ok(())
    }

    fn begin(&mut self) -> Result<()> {
        let mut batch = self.record();
        self.newton.iter_mut().for_each(|newton| newton.advanced.clear());
        self.run_all(&mut batch, &self.begin);
        self.pending = Some(batch);
        Ok(())
    }

    fn add_defect(&mut self, corrected: bool) -> Result<()> {
        self.record_defect(corrected);
        Ok(())
    }

    fn set_rows(&mut self, rhs_ids: &[usize], entries: &[(usize, u32, [f64; 3])]) -> Result<()> {
        self.scatter_rows(rhs_ids, entries, false)
    }

    fn add_forces(&mut self, entries: &[(u32, [f64; 3])]) -> Result<()> {
        let entries: Vec<_> = entries.iter().map(|(node, force)| (FREE, *node, *force)).collect();
        self.scatter_rows(&[], &entries, true)
    }

    fn set_vector(&mut self, which: Vector, rhs: usize, values: &[V4<f64>]) -> Result<()> {
        let batch = self.record();
        self.gpu.submit(batch); // a write takes effect before later commands
        let array = if which == Vector::Solution { &self.solver.x } else { &self.solver.r };
        self.gpu.write(array, self.offset(rhs), &rounded(values));
        Ok(())
    }

    fn reset_initial_guess(&mut self, rhs_ids: &[usize]) -> Result<()> {
        let mut batch = self.record();
        for rhs in rhs_ids {
            batch.clear(&self.solver.x, self.offset(*rhs), self.offset(1));
        }
        self.pending = Some(batch);
        Ok(())
    }

    fn advance_guess(&mut self, rhs: usize, entries: &[(u32, [f64; 3])]) -> Result<()> {
        self.advance(rhs, entries)
    }

    fn solve(&mut self, requests: &[SolveRequest], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        if self.unread.is_some() {
            return self.accelerate(requests, pick);
        }
        match self.newton {
            Some(_) => self.solve_nonlinear(requests, pick),
            None => self.solve_linear(requests, pick),
        }
    }

    fn nonlinear(&self) -> Nonlinear {
        self.newton.as_ref().map(|newton| newton.count).unwrap_or_default()
    }

    fn set_correction(&mut self, nodes: &[(u32, [f64; 3])]) -> Result<()> {
        self.reset_initial_guess(&[CORRECTION])?;
        let ids: Vec<u32> = nodes.iter().map(|(n, _)| self.node_count as u32 + n).collect();
        let masked = |n: u32, v: [f64; 3]| V3::of(v).times(self.axes[n as usize]).pad(0.0);
        let values: Vec<V4<f32>> = nodes.iter().map(|(n, v)| masked(*n, *v)).collect();
        let x = self.solver.x.clone();
        self.put(&x, &ids, &values)
    }

    fn node_blocks(&mut self, nodes: &[u32]) -> Result<Vec<[[f64; 3]; 3]>> {
        let mut batch = self.record();
        let Some((kernel, out)) = &self.node_blocks else {
            return Ok(vec![]);
        };
        batch.run(kernel, self.solver.in_use.nodes, 1);
        let parts = self.gpu.submit_and_read(batch, &[(out, out.bytes)])?;
        let all: Vec<V4<f32>> = cast(&parts[0]);
        let read = |n: &u32| blocks::unpack(&all[*n as usize * 4..*n as usize * 4 + 4]).d.0.map(V3::f64);
        Ok(nodes.iter().map(read).collect())
    }

    fn finish(&mut self, corrected: bool, cuts: bool) -> Result<()> {
        let mut batch = self.record();
        if let Some(cutting) = &mut self.cutting {
            cutting.keep_points(&mut batch, &self.body.u, cuts);
        }
        batch.run(&self.integrate[usize::from(corrected)], self.solver.in_use.nodes, 1);
        self.pending = Some(batch);
        self.set_ended();
        Ok(())
    }

    fn read(&mut self, query: &Query) -> Result<Values> {
        self.answer(query)
    }

    fn remove(&mut self, removal: &Removal) -> Result<()> {
        self.take(removal)
    }

    fn set_state(&mut self, u: &[V4<f64>], v: &[V4<f64>], rotation: &[V4<f64>]) -> Result<()> {
        let batch = self.record();
        self.gpu.submit(batch); // a write takes effect before later commands
        self.gpu.write(&self.body.u, 0, &rounded(u));
        self.gpu.write(&self.body.v, 0, &rounded(v));
        // for springs the array holds the law, which only cuts change
        if let Some(elements) = &self.body.elements {
            self.gpu.write(elements, 0, &rounded(rotation));
        }
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Snapshot> {
        let batch = self.record();
        let b = &self.body;
        // without what is computed from the displacements in each step
        let bytes = |elements: &Buffer| {
            if self.rotates { 16 * u64::from(self.params.cell_count) } else { elements.bytes }
        };
        let mut wanted = vec![(&b.u, b.u.bytes), (&b.v, b.v.bytes), (&b.masses, b.masses.bytes)];
        wanted.extend(b.elements.iter().map(|elements| (elements, bytes(elements))));
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        let all = parts.iter().map(|part| cast::<V4<f32>>(part).iter().map(|v| v.map(f64::from)).collect());
        let mut all: Vec<Vec<V4<f64>>> = all.collect();
        let elements = if all.len() > 3 { all.remove(3) } else { vec![] };
        let (rotation, law) = if self.rotates { (elements, vec![]) } else { (vec![], elements) };
        let split = self.split.as_ref().map_or(vec![], |split| split.host.clone());
        let [u, v, dofs] = [0, 1, 2].map(|k| std::mem::take(&mut all[k]));
        Ok(Snapshot { u, v, rotation, split, dofs, law, shares: vec![] })
    }

    fn gpu(&self) -> Option<&Gpu> {
        Some(&self.gpu)
    }

    fn flush(&mut self) {
        let batch = self.record();
        self.gpu.submit(batch);
    }

    fn displacements(&mut self) -> Result<Vec<V4<f64>>> {
        let batch = self.record();
        let parts = self.gpu.submit_and_read(batch, &[(&self.body.u, self.body.u.bytes)])?;
        Ok(cast::<V4<f32>>(&parts[0]).iter().map(|v| v.map(f64::from)).collect())
    }

    fn solution(&mut self, rhs: usize) -> Result<Vec<V4<f64>>> {
        let batch = self.record();
        let n = self.node_count;
        let parts = self.gpu.submit_and_read(batch, &[(&self.solver.x, self.offset(rhs + 1))])?;
        let all: Vec<V4<f32>> = cast(&parts[0]);
        Ok(all[rhs * n..].iter().map(|v| v.map(f64::from)).collect())
    }
}

fn rounded(values: &[V4<f64>]) -> Vec<V4<f32>> {
    values.iter().map(round).collect()
}
