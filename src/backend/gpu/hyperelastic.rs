//! Neo-Hookean bricks on the device: products with their tangents, and the places of Newton's method ([`super::super::newton`]).
//!
//! No tangent is kept: a product takes it anew from the place where it is wanted (`neo_tangent`). What a place is worth comes back in one
//! read: sums over groups of nodes, and the energy of each cell, from which the host takes the energy at the step's start in f64, so that
//! the little that a step changes is not lost in what the body holds.
//! What touches is solved with one linearisation per step, at the step's start, as on the CPU path.

use super::GpuBackend;
use super::arrays::{Arrays, Dispatch, Maker};
use super::exchange::triples;
use crate::backend::newton::{Attempt, Descent, SHIFTS, newton, raised};
use crate::backend::{FREE, Nonlinear, Target, Wanted};
use crate::error::{Error, Result};
use crate::gpu::{Batch, Buffer, Gpu, cast};
use crate::kernels::neo_forces::INSIDE_OUT;
use crate::kernels::{GROUP, Params, Source, attempt, collect_product, neo_forces, neo_tangent, product, residual};
use crate::linear::Outcome;
use crate::model::{MAX_LAYERS, Model};

/// Roundings of the sums of a place's potential, relative to what they sum.
const ROUNDINGS: f64 = 4.0 * f32::EPSILON as f64;

/// The law's arrays and kernels.
pub(super) struct Neo {
    /// Those that other kernels bind by name.
    pub arrays: Arrays,
    /// Work of the step so far.
    pub count: Nonlinear,
    newton: bool,
    params: Params<f32>,
    /// Share of the change of forces over a step that it sees; `r_K/h`; what has been added for tangents that are not positive.
    end_share: f64,
    damping: f64,
    shift: f64,
    /// Parameter blocks of the linear products, which have `damping + shift`.
    blocks: Vec<(Params<f32>, Buffer)>,
    energy: Buffer,
    /// The step's right-hand side, `[node]` N.
    b: Buffer,
    way: Option<Way>,
    /// `[cell]` energies at the step's start, J; empty before a place was tried.
    start: Vec<f32>,
    /// Norm of the step's load, N.
    load: f64,
}

/// Arrays and kernels of the way to a step's solution.
struct Way {
    gain: Buffer,
    kernels: Vec<Dispatch>,
    dx: [Buffer; 2],   // where it stands, and what was tried
    rest: [Buffer; 2], // the same
    promise: Buffer,
    balance: Buffer,
    load: Buffer,
}

impl Neo {
    /// Of a model with that law.
    pub fn new(made: &mut Maker, model: &Model, u: &Buffer, params: Params<f32>) -> Result<Option<Self>> {
        let Some(law) = &model.neo_hookean else {
            return Ok(None);
        };
        made.gpu.making("neo-Hookean law");
        let (n, cells) = (params.node_count as usize, params.cell_count as usize);
        let words: Vec<u32> = law.lame::<f32>().iter().flatten().map(|c| c.to_bits()).collect();
        let corner_force = made.of("corner_force", &vec![0f32; cells * 24 * params.slot_count as usize])?;
        let energy = made.of("energy", &vec![0f32; cells])?;
        // with one linearisation per step the tangents are those at its start
        let place = if law.newton { made.vec4("place", n)? } else { u.clone() };
        let own = [made.uniform("lame", MAX_LAYERS * 16, &words), corner_force, energy.clone()];
        let arrays = Arrays::of(&own).joined(&Arrays::one("place", &place));
        let end_share = model.step.end_share();
        Ok(Some(Self {
            arrays,
            count: Nonlinear::default(),
            newton: law.newton,
            params,
            end_share,
            damping: model.step.stiffness_factor() - end_share,
            shift: 0.0,
            blocks: vec![],
            energy,
            b: made.vec4("b", n)?,
            way: None,
            start: vec![],
            load: 0.0,
        }))
    }

    fn block(&self, made: &mut Maker, params: Params<f32>, factor: f64) -> (Params<f32>, Buffer) {
        let params = Params { stiffness_factor: factor as f32, ..params };
        (params, made.params(&params))
    }

    /// A product with the tangents: of inertia and damping, of each cell's tangent, and their sum.
    pub fn products(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        (linear, threads): (&'static Source, usize),
        params: Params<f32>,
    ) -> Result<Vec<Dispatch>> {
        let (damped, summed) = (self.block(made, params, self.damping), self.block(made, params, self.end_share));
        let bind = |source, block: &Buffer| arrays.bind(made.gpu, source, &[("params", block)]);
        let out = vec![
            (bind(linear, &damped.1)?, threads),
            (bind(&neo_tangent::SOURCE, &damped.1)?, params.cell_count as usize),
            (bind(&collect_product::SOURCE, &summed.1)?, params.node_count as usize),
        ];
        self.blocks.push(damped);
        Ok(out)
    }

    /// Makes what Newton's method needs, if it is wanted.
    pub fn search(&mut self, made: &mut Maker, arrays: &Arrays, x: &Buffer) -> Result<()> {
        if !self.newton {
            return Ok(());
        }
        made.gpu.making("neo-Hookean law");
        let n = self.params.node_count as usize;
        let groups = n.div_ceil(GROUP as usize);
        let mut vector = |name| made.vec4(name, n);
        let dx = [vector("dx")?, vector("dx_next")?];
        let rest = [vector("rest")?, vector("rest_next")?];
        let w = vector("w")?;
        let promise = made.of("promise", &vec![0f32; groups])?;
        let balance = made.of("balance", &vec![[0f32; 2]; groups])?;
        let sums = made.of("partial_product", &vec![0f32; self.params.product_groups as usize])?;
        let running = made.vec4("scalars", 2)?;
        let gain = made.params(&self.params);
        let (_, damped) = self.block(made, self.params, self.damping);
        let (_, shared) = self.block(made, self.params, self.end_share);
        let along = [("params", &gain), ("dx", &dx[0]), ("x", x), ("rest", &rest[0]), ("dx_next", &dx[1])];
        let along = [&along[..], &[("promise", &promise)]].concat();
        let linear = [("params", &damped), ("z", &dx[1]), ("w", &w), ("partial_product", &sums), ("scalars", &running)];
        let left = [("params", &shared), ("b", &self.b), ("w", &w), ("dx", &dx[1]), ("rest", &rest[1])];
        let left = [&left[..], &[("balance", &balance)]].concat();
        let bind = |source, more: &[(&'static str, &Buffer)]| arrays.bind(made.gpu, source, more);
        let kernels = vec![
            (bind(&attempt::SOURCE, &along)?, n),
            (bind(&neo_forces::SOURCE, &[("params", &shared)])?, self.params.cell_count as usize),
            (bind(&product::SOURCE, &linear)?, product::tiles(&self.params) * GROUP as usize),
            (bind(&residual::SOURCE, &left)?, n),
        ];
        let load = arrays.get("partial_load").unwrap_or_else(|| unreachable!("every body has it"));
        self.way = Some(Way { gain, kernels, dx, rest, promise, balance, load });
        Ok(())
    }

    /// Launches per place that is tried.
    pub fn launches(&self) -> u32 {
        self.way.as_ref().map_or(0, |way| way.kernels.len() as u32)
    }

    /// Adds `shift` of `K₀` to the tangents from now on.
    fn shift(&mut self, gpu: &Gpu, shift: f64) {
        if shift == self.shift {
            return;
        }
        self.shift = shift;
        for (params, block) in &self.blocks {
            let params = Params { stiffness_factor: (self.damping + shift) as f32, ..*params };
            gpu.write(block, 0, &params.words());
        }
    }

    /// The first cell that is inside out.
    fn outside_in(&self, energy: &[f32]) -> Option<Error> {
        let cell = energy.iter().position(|e| *e >= INSIDE_OUT || e.is_nan())?;
        Some(Error::InsideOut { cell: self.params.cell_at(cell) })
    }
}

impl GpuBackend {
    /// Bytes of a vector of one slot.
    fn vector(&self) -> u64 {
        self.offset(1)
    }

    fn raise(&mut self) {
        if let Some(neo) = &mut self.neo {
            let shift = raised(neo.shift);
            neo.shift(&self.gpu, shift);
            neo.count.indefinite += 1;
        }
    }

    /// Sets the free motion's right-hand side, and starts it from zero.
    fn restart(&mut self, from: &Buffer) {
        let mut batch = self.record();
        batch.copy(from, 0, &self.solver.r, 0, self.vector());
        batch.clear(&self.solver.x, 0, self.vector());
        self.pending = Some(batch);
    }

    /// A solve of a body with that law.
    pub(super) fn solve_neo(
        &mut self,
        wanted: &[Wanted],
        pick: &[(usize, u32)],
    ) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let Some(neo) = &mut self.neo else { return Ok((vec![], vec![])) };
        match wanted {
            [Wanted { slot: FREE, target: Target::OfLoad(tolerance) }] if neo.newton => {
                let (tolerance, floor) = (*tolerance, self.floor);
                (neo.count, neo.start) = (Nonlinear::default(), vec![]);
                let (outcome, own) = newton(self, tolerance, floor)?;
                let values = self.found(own, pick)?;
                Ok((vec![outcome], values))
            }
            _ => self.solve_linearised(wanted, pick),
        }
    }

    /// Takes over what Newton's method has found, and its values at nodes.
    fn found(&mut self, own: u32, pick: &[(usize, u32)]) -> Result<Vec<[f64; 3]>> {
        let mut batch = self.record();
        if let Some(neo) = &mut self.neo {
            neo.count.iterations = own;
            neo.shift(&self.gpu, 0.0);
        }
        let way = self.neo.as_ref().and_then(|neo| neo.way.as_ref());
        way.iter().for_each(|way| batch.copy(&way.dx[0], 0, &self.solver.x, 0, self.vector()));
        if pick.is_empty() {
            self.pending = Some(batch);
            return Ok(vec![]);
        }
        let ids: Vec<u32> = pick.iter().map(|(slot, node)| (slot * self.node_count) as u32 + node).collect();
        let picked = self.record_pick(&mut batch, &self.pick.x, &ids);
        Ok(triples(&self.gpu.submit_and_read(batch, &[(&self.pick.picked, picked)])?[0]))
    }

    /// One linearisation for every slot; the free motion, which comes first in a step, finds out whether it is positive.
    fn solve_linearised(&mut self, wanted: &[Wanted], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let Some(free) = wanted.iter().position(|w| w.slot == FREE) else {
            return self.solve_slots(wanted, pick);
        };
        let mut batch = self.record();
        if let Some(neo) = &mut self.neo {
            batch.copy(&self.solver.r, 0, &neo.b, 0, (self.node_count * 16) as u64);
            neo.count = Nonlinear::default();
            neo.shift(&self.gpu, 0.0);
            let energy = &self.gpu.submit_and_read(batch, &[(&neo.energy, u64::from(neo.params.cell_count) * 4)])?[0];
            neo.outside_in(&cast::<f32>(energy)).map_or(Ok(()), Err)?;
        }
        let mut found = self.solve_slots(wanted, pick)?;
        for _ in 0..SHIFTS {
            if !found.0[free].broken(self.max_iterations) {
                break;
            }
            self.raise();
            let b = self.neo.as_ref().map(|neo| neo.b.clone());
            b.iter().for_each(|b| self.restart(b));
            found = self.solve_slots(wanted, pick)?;
        }
        Ok(found)
    }

    /// Before the first place of a step: keeps its right-hand side, and clears what is added to the start.
    fn set_out(&self, batch: &mut Batch, neo: &Neo, way: &Way) {
        batch.copy(&self.solver.r, 0, &neo.b, 0, self.vector());
        for vector in [&way.dx[0], &way.rest[0], &self.solver.x] {
            batch.clear(vector, 0, self.vector());
        }
    }
}

impl Descent for GpuBackend {
    fn attempt(&mut self, share: f64) -> Result<Option<Attempt>> {
        let mut batch = self.record();
        let Some((neo, way)) = self.neo.as_ref().and_then(|neo| Some((neo, neo.way.as_ref()?))) else {
            return Ok(None);
        };
        let first = neo.start.is_empty();
        if first {
            self.set_out(&mut batch, neo, way);
        }
        self.gpu.write(&way.gain, 0, &Params { gain: share as f32, ..neo.params }.words());
        way.kernels.iter().for_each(|(kernel, threads)| batch.run(kernel, *threads, 1));
        let groups = self.node_count.div_ceil(GROUP as usize) as u64;
        let wanted = [
            (&way.promise, groups * 4),
            (&way.balance, groups * 8),
            (&neo.energy, u64::from(neo.params.cell_count) * 4),
            (&way.load, groups * 4),
        ];
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        let sum = |values: Vec<f32>| values.iter().map(|v| f64::from(*v)).sum::<f64>();
        let (balance, energy) = (cast::<[f32; 2]>(&parts[1]), cast::<f32>(&parts[2]));
        let (outside, end_share) = (neo.outside_in(&energy).is_some(), neo.end_share);
        if first && let Some(neo) = &mut self.neo {
            neo.start = energy.clone();
            neo.load = sum(cast(&parts[3])).sqrt();
        }
        if outside {
            return Ok(None);
        }
        let start = self.neo.iter().flat_map(|neo| &neo.start);
        let gained: f64 = energy.iter().zip(start).map(|(e, s)| f64::from(*e) - f64::from(*s)).sum();
        let of_nodes = |part: fn(&[f32; 2]) -> f32| balance.iter().map(|b| f64::from(part(b))).sum::<f64>();
        let held = of_nodes(|b| b[0].abs()) + end_share * sum(energy);
        Ok(Some(Attempt {
            potential: of_nodes(|b| b[0]) + end_share * gained,
            noise: ROUNDINGS * held,
            size: of_nodes(|b| b[1]).sqrt(),
            promise: sum(cast(&parts[0])),
        }))
    }

    fn take(&mut self) {
        let mut batch = self.record();
        if let Some(way) = self.neo.as_ref().and_then(|neo| neo.way.as_ref()) {
            for [here, tried] in [&way.dx, &way.rest] {
                batch.copy(tried, 0, here, 0, self.vector());
            }
        }
        self.pending = Some(batch);
    }

    fn direction(&mut self, residual: f64) -> Result<Outcome> {
        if let Some(neo) = &mut self.neo {
            neo.shift(&self.gpu, 0.0);
        }
        let rest = self.neo.as_ref().and_then(|neo| neo.way.as_ref()).map(|way| way.rest[0].clone());
        let wanted = [Wanted { slot: FREE, target: Target::Absolute(residual) }];
        let mut spent = 0;
        for attempt in 0..=SHIFTS {
            rest.iter().for_each(|rest| self.restart(rest));
            let mut outcome = self.solve_slots(&wanted, &[])?.0[0];
            spent += outcome.iterations;
            if !outcome.broken(self.max_iterations) || attempt == SHIFTS {
                outcome.iterations = spent;
                return Ok(outcome);
            }
            self.raise();
        }
        unreachable!("the last attempt returns")
    }

    fn load(&self) -> f64 {
        self.neo.as_ref().map_or(0.0, |neo| neo.load)
    }

    fn inside_out(&self) -> Error {
        let found = self.neo.as_ref().and_then(|neo| neo.outside_in(&neo.start));
        found.unwrap_or_else(|| unreachable!("only a cell that is inside out ends the first place"))
    }
}
