//! The GPU path: the same arrays and kernels in WGSL, f32.
//!
//! Commands are recorded and submitted together with the next read-back: a step without contact is one submission, a step with
//! contact one for the solve of free motion and columns, one per pass of the correction. A solve is recorded for as many iterations
//! as the last one of its kind took and a quarter more; slots that are done skip their work; if some is not done when its scalars
//! come back (with the values that the host needs anyway), more iterations are submitted.

use super::{Backend, CORRECTION, Device, FREE, Needs, Snapshot, Target, Wanted, cell_centres, links};
use crate::error::{Error, Result};
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::{
    self, GROUP, Params, advance, blocks, centres, combine, cut, factor, forces, gather, integrate, momentum,
    precondition, product, rhs, rotations, scatter, springs, springs_blocks, springs_product, update,
};
use crate::linear::Outcome;
use crate::math::{M3, V3, V4};
use crate::model::{MAX_LAYERS, Model};
use crate::scene::Mass;

/// Hits of one step that the device can hand back; a blade crosses some hundred links at most.
const MAX_HITS: usize = 65_536;

/// The body's state on the device.
pub struct GpuBackend {
    gpu: Gpu,
    params: Params<f32>,
    node_count: usize,
    column_count: usize,
    spring_count: usize,
    slots: usize,
    max_iterations: u32,
    floor: f64,
    expected: [u32; 2],
    pending: Option<Batch>,
    rows_pending: bool,
    axes: Vec<V3<f32>>, // [node] 1 free, 0 held
    bytes: u64,
    buffers: Buffers,
    kernels: Kernels,
    put: Option<Put>,
    cutting: Option<Cutting>,
    node_blocks: Option<(Bound, Buffer)>,
}

struct Buffers {
    u: Buffer,
    v: Buffer,
    free: Buffer,
    load: Buffer,
    cell: Buffer, // rotations of bricks, or the law of springs
    x: Buffer,
    r: Buffer,
    z: Buffer,
    scalars: Buffer,
    requests: Buffer,
    pick_params: Buffer,
    ids: Buffer,
    picked: Buffer,
}

/// Values from the host by index: rows and coefficients of contacts, and what a cut changes.
struct Put {
    coefficient: Buffer,
    row_params: Buffer,
    params: Buffer,
    ids: Buffer,
    values: Buffer,
    rows: Bound,
}

struct Iteration {
    product: Bound,
    advance: Bound,
    update: Bound,
    precondition: Bound,
}

struct Kernels {
    elastic: Vec<(Bound, usize)>, // kernel, threads
    rhs: Bound,
    blocks: Bound,
    factor: Bound,
    all: Iteration,
    correction: Option<(Iteration, Bound)>, // with `combine`
    integrate: [Bound; 2],                  // without, with correction
    pick_x: Bound,
    pick_u: Bound,
    pick_f: Bound,
}

struct Cutting {
    centres: Option<Bound>,
    cut: Bound,
    params: Buffer,
    quads: Buffer,
    hits: Buffer,
    hit_count: Buffer,
    segments: usize,
}

/// Swept quads of one step; a blade has as many as its edge has pieces.
const MAX_QUADS: usize = 256;

impl GpuBackend {
    /// The body at rest on a device, with the arrays that `needs` names.
    ///
    /// # Errors
    /// When an array passes a limit of the adapter, or a kernel does not compile.
    pub fn new(
        gpu: Gpu,
        model: &Model,
        needs: Needs,
        max_iterations: u32,
        floor: f64,
        start: &Snapshot,
    ) -> Result<Self> {
        let n = model.grid.node_count();
        let slots = needs.slots();
        let mut params = model.params::<f32>();
        params.slot_count = slots as u32;
        let column_count = (params.nodes_x * params.nodes_y) as usize;
        let groups = n.div_ceil(GROUP as usize);
        let mut made = Maker { gpu: &gpu, bytes: 0 };
        let words = |p: Params<f32>| p.words();
        let main = made.uniform("params", 0, &words(params));
        let vec = |v: &[V4<f64>]| v.iter().map(|a| a.map(|c| c as f32)).collect::<Vec<_>>();
        let x = made.vec4("x", n * slots)?;
        let r = made.vec4("r", n * slots)?;
        let (p, s) = (made.vec4("p", n * slots)?, made.vec4("s", n * slots)?);
        let (z, w) = (made.vec4("z", n * slots)?, made.vec4("w", n * slots)?);
        let u = made.of("u", &vec(&start.u))?;
        let v = made.of("v", &vec(&start.v))?;
        let f = made.vec4("f", n)?;
        let free = made.of("free", &vec(&model.free))?;
        let load = made.vec4("load", n)?;
        let block = made.vec4("block", n * 4)?;
        let scalars = made.vec4("scalars", slots * 2)?;
        let requests = made.vec4("requests", slots)?;
        let partial_product = made.of("partial_product", &vec![0f32; params.product_groups as usize * slots])?;
        let partial_dots = made.of("partial_dots", &vec![[0f32; 2]; column_count.div_ceil(GROUP as usize) * slots])?;
        let partial_load = made.of("partial_load", &vec![0f32; groups])?;

        let consistent = model.mass == Mass::Consistent;
        let mean_v = if consistent { made.vec4("mean_v", n)? } else { v.clone() };
        let law = Law::new(&mut made, model)?;
        let mut with_law: Vec<(&str, &Buffer)> = law.shared.iter().map(|b| (b.name, b)).collect();
        with_law.extend([("free", &free), ("u", &u), ("f", &f), ("block", &block)]);
        with_law.extend([("v", &v), ("mean_v", &mean_v)]);
        with_law.extend([("z", &z), ("w", &w), ("partial_product", &partial_product), ("scalars", &scalars)]);
        // binds what a kernel names out of the replacements, and out of all the body's arrays
        let bind_with = |source: &kernels::Source, replaced: &[(&'static str, &Buffer)]| {
            let shader = crate::gpu::Shader::read(source)?;
            let kept = with_law.iter().filter(|(name, _)| replaced.iter().all(|r| r.0 != *name));
            let mut list: Vec<(&str, &Buffer)> = kept.chain(replaced).copied().collect();
            list.retain(|(name, _)| shader.variables.iter().any(|v| v.name == *name));
            gpu.bind(source, &list)
        };
        let bind = |source: &kernels::Source, params: &Buffer| bind_with(source, &[("params", params)]);
        let bind_blocks = |params: &Buffer, block: &Buffer| {
            let mut replaced = vec![("params", params), ("block", block)];
            replaced.extend(law.system.iter().map(|system| ("stiffness", system)));
            bind_with(law.blocks, &replaced)
        };
        let iteration = |params: &Buffer| -> Result<Iteration> {
            Ok(Iteration {
                product: bind(law.product, params)?,
                advance: gpu.bind(
                    &advance::SOURCE,
                    &[
                        ("params", params),
                        ("requests", &requests),
                        ("partial_product", &partial_product),
                        ("partial_dots", &partial_dots),
                        ("partial_load", &partial_load),
                        ("scalars", &scalars),
                    ],
                )?,
                update: gpu.bind(
                    &update::SOURCE,
                    &[
                        ("params", params),
                        ("scalars", &scalars),
                        ("z", &z),
                        ("w", &w),
                        ("x", &x),
                        ("p", &p),
                        ("s", &s),
                        ("r", &r),
                    ],
                )?,
                precondition: gpu.bind(
                    &precondition::SOURCE,
                    &[
                        ("params", params),
                        ("block", &block),
                        ("r", &r),
                        ("z", &z),
                        ("partial_dots", &partial_dots),
                        ("scalars", &scalars),
                    ],
                )?,
            })
        };
        let integrate =
            |params: &Buffer| gpu.bind(&integrate::SOURCE, &[("params", params), ("x", &x), ("u", &u), ("v", &v)]);
        let single = made.uniform("params", 0, &words(Params { slot_count: 1, ..params }));
        let pick_params = made.uniform("params", 16, &[0u32; 4]);
        // a pick takes a few nodes of every slot, a put at most one whole array
        let picked_at_once = n.min(3 * needs.columns) * slots;
        let capacity = n + picked_at_once + model.grid.cell_count() + law.springs;
        let ids = made.of("ids", &vec![0u32; capacity])?;
        let picked = made.vec4("picked", capacity)?;
        let put = if needs.contact || needs.cutting { Some(Put::new(&mut made, slots, capacity, &r)?) } else { None };
        let correction = match &put {
            Some(put) if needs.contact => {
                let second = made.uniform("params", 0, &words(Params { first_slot: CORRECTION as u32, ..params }));
                let list = [("params", &main), ("coefficient", &put.coefficient), ("x", &x)];
                Some((iteration(&second)?, gpu.bind(&combine::SOURCE, &list)?))
            }
            _ => None,
        };
        let pick = |source: &Buffer| {
            gpu.bind(
                &gather::SOURCE,
                &[("params", &pick_params), ("ids", &ids), ("source", source), ("picked", &picked)],
            )
        };
        let kernels = Kernels {
            elastic: law
                .elastic
                .iter()
                .map(|(source, threads)| Ok((bind(source, &main)?, *threads)))
                .collect::<Result<_>>()?,
            rhs: gpu.bind(
                &rhs::SOURCE,
                &[
                    ("params", &main),
                    ("f", &f),
                    ("v", &mean_v),
                    ("free", &free),
                    ("load", &load),
                    ("b", &r),
                    ("partial_load", &partial_load),
                ],
            )?,
            blocks: bind_blocks(&main, &block)?,
            factor: bind(&factor::SOURCE, &main)?,
            all: iteration(&main)?,
            correction,
            integrate: [integrate(&single)?, integrate(&main)?],
            pick_x: pick(&x)?,
            pick_u: pick(&u)?,
            pick_f: pick(&f)?,
        };
        let cutting = if needs.cutting { Some(Cutting::new(&mut made, model, &main, &u, &v)?) } else { None };
        let node_blocks = if needs.node_blocks {
            let out = made.vec4("block", n * 4)?;
            let params = made.uniform("params", 0, &words(Params { preconditioner: 2, ..params }));
            Some((bind_blocks(&params, &out)?, out))
        } else {
            None
        };
        let bytes = made.bytes;
        let cell = law.cell;
        let buffers = Buffers { u, v, free, load, cell, x, r, z, scalars, requests, pick_params, ids, picked };
        Ok(Self {
            params,
            node_count: n,
            column_count,
            spring_count: law.springs,
            slots,
            max_iterations,
            floor,
            expected: [8, 8],
            pending: None,
            rows_pending: false,
            axes: model.free.iter().map(|f| axes(*f)).collect(),
            bytes,
            buffers,
            kernels,
            put,
            cutting,
            node_blocks,
            gpu,
        })
    }

    /// The device, with its lists of arrays and kernels.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    fn record(&mut self) -> Batch {
        self.pending.take().unwrap_or_else(|| {
            self.rows_pending = false;
            self.gpu.batch()
        })
    }

    fn offset(&self, slot: usize) -> u64 {
        (slot * self.node_count * 16) as u64
    }

    /// Gathers by index from one of the bound sources in the batch's submission; returns the bytes to read from `picked`.
    fn record_pick(&self, batch: &mut Batch, kernel: &Bound, ids: &[u32]) -> u64 {
        let b = &self.buffers;
        self.gpu.write(&b.pick_params, 0, &[ids.len() as u32, 0, 0, 0]);
        self.gpu.write(&b.ids, 0, ids);
        batch.run(kernel, ids.len(), 1);
        (ids.len() * 16) as u64
    }

    fn read_picked(&mut self, ids: &[u32], kernel: fn(&Kernels) -> &Bound) -> Result<Vec<[f64; 3]>> {
        let mut out = Vec::with_capacity(ids.len());
        for part in ids.chunks((self.buffers.ids.bytes / 4) as usize) {
            let mut batch = self.record();
            let bytes = self.record_pick(&mut batch, kernel(&self.kernels), part);
            out.extend(triples(&self.gpu.submit_and_read(batch, &[(&self.buffers.picked, bytes)])?[0]));
        }
        Ok(out)
    }

    /// Puts values into an array by index, in its own submission.
    fn put(&mut self, destination: &Buffer, ids: &[u32], values: &[V4<f32>]) -> Result<()> {
        if ids.is_empty() {
            return Ok(());
        }
        let batch = self.record();
        self.gpu.submit(batch);
        let Some(put) = &self.put else {
            return Ok(()); // a body without tools changes on the device alone
        };
        let list = [("params", &put.params), ("ids", &put.ids), ("values", &put.values), ("destination", destination)];
        let kernel = self.gpu.bind(&scatter::SOURCE, &list)?;
        self.gpu.write(&put.params, 0, &[ids.len() as u32, 0, 0, 0]);
        self.gpu.write(&put.ids, 0, ids);
        self.gpu.write(&put.values, 0, values);
        let mut batch = self.gpu.batch();
        batch.run(&kernel, ids.len(), 1);
        self.gpu.submit(batch);
        Ok(())
    }

    fn record_iterations(&self, batch: &mut Batch, only_correction: bool, rows: u32, count: u32) {
        let k = match (&self.kernels.correction, only_correction) {
            (Some((k, _)), true) => k,
            _ => &self.kernels.all,
        };
        let product_threads = (self.params.product_groups * GROUP) as usize;
        for _ in 0..count {
            batch.run(&k.product, product_threads, rows);
            batch.run(&k.advance, 1, rows);
            batch.run(&k.update, self.node_count, rows);
            batch.run(&k.precondition, self.column_count, rows);
        }
    }

    fn write_requests(&self, wanted: &[Wanted], rows: usize) {
        // idle slots are done before they start
        let mut scalars = vec![[1f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]; rows];
        let mut requests = vec![[0f32; 4]; rows];
        for w in wanted {
            scalars[w.slot][3] = 0.0;
            let floor = (self.floor * self.floor) as f32;
            requests[w.slot] = match w.target {
                Target::OfLoad(t) => [(t * t) as f32, 0.0, floor, 1.0],
                Target::Absolute(norm) => [1.0, (norm * norm) as f32, floor, 0.0],
            };
        }
        self.gpu.write(&self.buffers.scalars, 0, &scalars);
        self.gpu.write(&self.buffers.requests, 0, &requests);
    }
}

impl Put {
    fn new(made: &mut Maker, slots: usize, capacity: usize, r: &Buffer) -> Result<Self> {
        let gpu = made.gpu;
        let coefficient = made.of("coefficient", &vec![0f32; slots])?;
        let (row_params, params) = (made.uniform("params", 16, &[0u32; 4]), made.uniform("params", 16, &[0u32; 4]));
        let (ids, values) = (made.of("ids", &vec![0u32; capacity])?, made.vec4("values", capacity)?);
        let list = [("params", &row_params), ("ids", &ids), ("values", &values), ("destination", r)];
        let rows = gpu.bind(&scatter::SOURCE, &list)?;
        Ok(Self { coefficient, row_params, params, ids, values, rows })
    }
}

/// Makes buffers and adds up their bytes.
struct Maker<'a> {
    gpu: &'a Gpu,
    bytes: u64,
}

impl Maker<'_> {
    fn uniform(&mut self, name: &'static str, bytes: usize, data: &[u32]) -> Buffer {
        let buffer = self.gpu.uniform(name, bytes, data);
        self.bytes += buffer.bytes;
        buffer
    }
    fn vec4(&mut self, name: &'static str, count: usize) -> Result<Buffer> {
        let buffer = self.gpu.array::<V4<f32>>(name, count)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
    fn of<T: bytemuck::NoUninit>(&mut self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.gpu.array_of(name, data)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
}

/// Arrays and kernels of the elastic law.
struct Law {
    shared: Vec<Buffer>,
    system: Option<Buffer>, // of a consistent mass: for blocks, instead of the stiffness
    cell: Buffer,
    springs: usize,
    elastic: Vec<(&'static kernels::Source, usize)>,
    product: &'static kernels::Source,
    blocks: &'static kernels::Source,
}

impl Law {
    fn new(made: &mut Maker, model: &Model) -> Result<Self> {
        let n = model.grid.node_count();
        if let Some(s) = &model.springs {
            let rest: Vec<V4<f32>> = model.rest.iter().map(|p| V3::of(*p).pad(0.0)).collect();
            let law: Vec<V4<f32>> = s.law.iter().map(|l| l.map(|c| c as f32)).collect();
            let cell = made.of("law", &law)?;
            let shared = vec![
                made.of("rest", &rest)?,
                made.of("first", &s.first)?,
                made.of("half", &s.half)?,
                made.vec4("tangent", s.half.len() * 2)?,
                cell.clone(),
            ];
            return Ok(Self {
                shared,
                system: None,
                cell,
                springs: s.ends.len(),
                elastic: vec![(&springs::SOURCE, n)],
                product: &springs_product::SOURCE,
                blocks: &springs_blocks::SOURCE,
            });
        }
        let cells = model.grid.cell_count();
        let cell = made.of("rotation", &vec![[0f32, 0.0, 0.0, 1.0]; cells])?;
        // mat3x3 in a uniform: three columns of 16 bytes
        let columns = |blocks: Vec<M3<f32>>| -> Vec<u32> {
            blocks
                .iter()
                .flat_map(|m| m.0.map(|c| [c.x.to_bits(), c.y.to_bits(), c.z.to_bits(), 0]))
                .flatten()
                .collect()
        };
        let mut blocks = |list: Vec<M3<f32>>| made.uniform("stiffness", MAX_LAYERS * 64 * 48, &columns(list));
        let stiffness = blocks(model.stiffness_blocks());
        let consistent = model.mass == Mass::Consistent;
        let system = consistent.then(|| blocks(model.system_blocks()));
        // symmetric, so rows serve as columns
        let modes: Vec<u32> = model
            .modes::<f32>()
            .iter()
            .flatten()
            .flatten()
            .flat_map(|c| [c[0].to_bits(), c[1].to_bits(), c[2].to_bits(), 0])
            .collect();
        let shape: Vec<u32> = model.shapes::<f32>().iter().flatten().map(|c| c.to_bits()).collect();
        let shared = vec![
            made.uniform("shape", MAX_LAYERS * 16, &shape),
            stiffness,
            made.uniform("modes", MAX_LAYERS * 8 * 48, &modes),
            made.of("layer_of", &model.grid.layer_of)?,
            cell.clone(),
        ];
        let mut elastic: Vec<(&'static kernels::Source, usize)> = vec![];
        if model.corotational {
            elastic.push((&rotations::SOURCE, cells));
        }
        elastic.push((&forces::SOURCE, n));
        if consistent {
            elastic.push((&momentum::SOURCE, n));
        }
        Ok(Self { shared, system, cell, springs: 0, elastic, product: &product::SOURCE, blocks: &blocks::SOURCE })
    }
}

impl Cutting {
    fn new(made: &mut Maker, model: &Model, main: &Buffer, u: &Buffer, v: &Buffer) -> Result<Self> {
        let gpu = made.gpu;
        let (ends, rest) = match &model.springs {
            Some(s) => (s.ends.clone(), model.rest.clone()),
            None => (links(&model.grid.params()), cell_centres(model)),
        };
        let rest: Vec<V4<f32>> = rest.iter().map(|p| V3::of(*p).pad(0.0)).collect();
        let segments = ends.len();
        let (ends, rest) = (made.of("ends", &ends)?, made.of("rest", &rest)?);
        let params = made.uniform("params", 16, &[0; 4]);
        let quads = made.vec4("quads", MAX_QUADS * 4)?;
        let hits = made.of("hits", &vec![0u32; MAX_HITS])?;
        let hit_count = made.of("hit_count", &[0u32; 4])?;
        let (centres, point_u, point_v) = if model.springs.is_some() {
            (None, u.clone(), v.clone())
        } else {
            let cells = model.grid.cell_count();
            let (point_u, point_v) = (made.vec4("point_u", cells)?, made.vec4("point_v", cells)?);
            let list = [("params", main), ("u", u), ("v", v), ("point_u", &point_u), ("point_v", &point_v)];
            (Some(gpu.bind(&centres::SOURCE, &list)?), point_u, point_v)
        };
        let cut = gpu.bind(
            &cut::SOURCE,
            &[
                ("params", &params),
                ("ends", &ends),
                ("rest", &rest),
                ("point_u", &point_u),
                ("point_v", &point_v),
                ("quads", &quads),
                ("hits", &hits),
                ("hit_count", &hit_count),
            ],
        )?;
        Ok(Self { centres, cut, params, quads, hits, hit_count, segments })
    }
}

fn axes(free: V4<f64>) -> V3<f32> {
    V3::of([free[0], free[1], free[2]])
}

fn triples(bytes: &[u8]) -> Vec<[f64; 3]> {
    cast::<V4<f32>>(bytes).into_iter().map(|v| V3::from4(v).f64()).collect()
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
            device_bytes: self.bytes,
        }
    }

    fn set_load(&mut self, load: &[[f64; 3]]) {
        let load: Vec<V4<f32>> = load.iter().map(|l| V3::of(*l).pad(0.0)).collect();
        self.gpu.write(&self.buffers.load, 0, &load);
    }

    fn begin(&mut self) -> Result<()> {
        let mut batch = self.record();
        for (kernel, threads) in &self.kernels.elastic {
            batch.run(kernel, *threads, 1);
        }
        batch.run(&self.kernels.rhs, self.node_count, 1);
        batch.run(&self.kernels.blocks, self.node_count, 1);
        batch.run(&self.kernels.factor, self.column_count, 1);
        self.pending = Some(batch);
        Ok(())
    }

    fn set_rows(&mut self, slots: &[usize], entries: &[(usize, u32, [f64; 3])]) -> Result<()> {
        let mut batch = self.record();
        if self.rows_pending {
            // the entries below would replace those that the batch has yet to put
            self.gpu.submit(batch);
            batch = self.gpu.batch();
        }
        self.rows_pending = true;
        let bytes = self.offset(1);
        for slot in slots {
            batch.clear(&self.buffers.r, self.offset(*slot), bytes);
        }
        let ids: Vec<u32> = entries.iter().map(|(s, n, _)| (s * self.node_count) as u32 + n).collect();
        let free = |n: u32, v: [f64; 3]| V3::of(v).times(self.axes[n as usize]).pad(0.0);
        let values: Vec<V4<f32>> = entries.iter().map(|(_, n, v)| free(*n, *v)).collect();
        if let Some(put) = &self.put {
            self.gpu.write(&put.row_params, 0, &[ids.len() as u32, 0, 0, 0]);
            self.gpu.write(&put.ids, 0, &ids);
            self.gpu.write(&put.values, 0, &values);
            batch.run(&put.rows, ids.len(), 1);
        }
        self.pending = Some(batch);
        Ok(())
    }

    fn forget(&mut self, slots: &[usize]) -> Result<()> {
        let mut batch = self.record();
        for slot in slots {
            batch.clear(&self.buffers.x, self.offset(*slot), self.offset(1));
        }
        self.pending = Some(batch);
        Ok(())
    }

    fn solve(&mut self, wanted: &[Wanted], pick: &[(usize, u32)]) -> Result<(Vec<Outcome>, Vec<[f64; 3]>)> {
        let only_correction = wanted.iter().all(|w| w.slot == CORRECTION);
        let last = wanted.iter().map(|w| w.slot).max().unwrap_or(FREE);
        let (first, rows) = if only_correction { (CORRECTION, 1) } else { (FREE, last as u32 + 1) };
        self.write_requests(wanted, last + 1);
        let ids: Vec<u32> = pick.iter().map(|(slot, node)| (slot * self.node_count) as u32 + node).collect();
        let mut batch = self.record();
        let (from, bytes) = (self.offset(first), self.offset(rows as usize));
        batch.copy(&self.buffers.x, from, &self.buffers.z, from, bytes);
        let kind = usize::from(only_correction);
        // one product more forms the start's residual, one more finds out that it is small enough
        let mut count = (self.expected[kind] * 5 / 4 + 4).min(self.max_iterations + 2);
        loop {
            self.record_iterations(&mut batch, only_correction, rows, count);
            let picked = self.record_pick(&mut batch, &self.kernels.pick_x, &ids);
            let heads = 32 * (last as u64 + 1);
            let parts =
                self.gpu.submit_and_read(batch, &[(&self.buffers.scalars, heads), (&self.buffers.picked, picked)])?;
            let heads: Vec<[f32; 8]> = cast(&parts[0]);
            let of = |w: &Wanted| {
                let [alpha, beta, gamma, done, target_squared, residual_squared, iterations, state] = heads[w.slot];
                advance::Scalars { alpha, beta, gamma, done, target_squared, residual_squared, iterations, state }
            };
            let running = wanted.iter().any(|w| of(w).done == 0.0 && of(w).iterations < self.max_iterations as f32);
            if !running {
                let outcomes: Vec<Outcome> = wanted.iter().map(|w| Outcome::of(&of(w))).collect();
                self.expected[kind] = outcomes.iter().map(|o| o.iterations).max().unwrap_or(0);
                return Ok((outcomes, triples(&parts[1])));
            }
            batch = self.gpu.batch();
            count = count.clamp(8, 64);
        }
    }

    fn correct(&mut self, forces: &[(u32, [f64; 3])], coefficients: &[(usize, f64)], keep: bool) -> Result<()> {
        let entries: Vec<_> = forces.iter().map(|(node, f)| (CORRECTION, *node, *f)).collect();
        self.set_rows(&[CORRECTION], &entries)?;
        let mut by_slot = vec![0f32; self.slots];
        by_slot[CORRECTION] = if keep { 1.0 } else { 0.0 };
        for (slot, c) in coefficients {
            by_slot[*slot] = *c as f32;
        }
        let mut batch = self.record();
        if let (Some((_, combine)), Some(put)) = (&self.kernels.correction, &self.put) {
            self.gpu.write(&put.coefficient, 0, &by_slot);
            batch.run(combine, self.node_count, 1);
        }
        self.pending = Some(batch);
        Ok(())
    }

    fn set_correction(&mut self, nodes: &[(u32, [f64; 3])]) -> Result<()> {
        self.forget(&[CORRECTION])?;
        let ids: Vec<u32> = nodes.iter().map(|(n, _)| self.node_count as u32 + n).collect();
        let free = |n: u32, v: [f64; 3]| V3::of(v).times(self.axes[n as usize]).pad(0.0);
        let values: Vec<V4<f32>> = nodes.iter().map(|(n, v)| free(*n, *v)).collect();
        let x = self.buffers.x.clone();
        self.put(&x, &ids, &values)
    }

    fn node_blocks(&mut self, nodes: &[u32]) -> Result<Vec<[[f64; 3]; 3]>> {
        let mut batch = self.record();
        let Some((kernel, out)) = &self.node_blocks else {
            return Ok(vec![]);
        };
        batch.run(kernel, self.node_count, 1);
        let parts = self.gpu.submit_and_read(batch, &[(out, out.bytes)])?;
        let all: Vec<V4<f32>> = cast(&parts[0]);
        let read = |n: &u32| blocks::unpack(&all[*n as usize * 4..*n as usize * 4 + 4]).d.0.map(V3::f64);
        Ok(nodes.iter().map(read).collect())
    }

    fn finish(&mut self, corrected: bool) -> Result<()> {
        let mut batch = self.record();
        batch.run(&self.kernels.integrate[usize::from(corrected)], self.node_count, 1);
        self.pending = Some(batch);
        Ok(())
    }

    fn displacements(&mut self, nodes: &[u32]) -> Result<Vec<[f64; 3]>> {
        self.read_picked(nodes, |k| &k.pick_u)
    }

    fn elastic_forces(&mut self, nodes: &[u32]) -> Result<Vec<[f64; 3]>> {
        self.read_picked(nodes, |k| &k.pick_f)
    }

    fn cut(&mut self, quads: &[[f64; 3]]) -> Result<Vec<u32>> {
        let mut batch = self.record();
        let Some(c) = &self.cutting else {
            return Ok(vec![]);
        };
        let corners: Vec<V4<f32>> = quads.iter().map(|p| V3::of(*p).pad(0.0)).collect();
        if corners.len() > MAX_QUADS * 4 {
            return Err(Error::TooLarge {
                what: "the blade's pieces".into(),
                need: corners.len() as u64 / 4,
                limit_name: "swept quads per step",
                limit: MAX_QUADS as u64,
                fix: "set a larger edge_spacing_mm".into(),
            });
        }
        let step = self.params.step.to_bits();
        self.gpu.write(&c.params, 0, &[c.segments as u32, corners.len() as u32 / 4, MAX_HITS as u32, step]);
        self.gpu.write(&c.quads, 0, &corners);
        self.gpu.write(&c.hit_count, 0, &[0u32; 4]);
        if let Some(centres) = &c.centres {
            batch.run(centres, self.params.cell_count as usize, 1);
        }
        batch.run(&c.cut, c.segments, 1);
        // few hits are usual: count and the first of them come in one read-back
        let first = 1024u64;
        let parts = self.gpu.submit_and_read(batch, &[(&c.hit_count, 4), (&c.hits, first * 4)])?;
        let count = cast::<u32>(&parts[0])[0] as usize;
        if count > MAX_HITS {
            return Err(Error::TooLarge {
                what: "the links cut in one step".into(),
                need: count as u64,
                limit_name: "hits per step",
                limit: MAX_HITS as u64,
                fix: "use a shorter step_ms".into(),
            });
        }
        let mut hits: Vec<u32> = if count as u64 <= first { cast(&parts[1]) } else { self.gpu.read(&c.hits, count)? };
        hits.truncate(count);
        hits.sort_unstable();
        Ok(hits)
    }

    fn remove(&mut self, cells: &[u32], springs: &[u32], free: &[(u32, V4<f64>)]) -> Result<()> {
        let cell = self.buffers.cell.clone();
        let gone = if self.spring_count > 0 { springs } else { cells };
        self.put(&cell, gone, &vec![[0.0; 4]; gone.len()])?;
        let ids: Vec<u32> = free.iter().map(|(n, _)| *n).collect();
        let values: Vec<V4<f32>> = free.iter().map(|(_, v)| v.map(|c| c as f32)).collect();
        let buffer = self.buffers.free.clone();
        self.put(&buffer, &ids, &values)?;
        for (node, value) in free {
            self.axes[*node as usize] = axes(*value);
        }
        // nodes without cells leave the system where they are
        let dead: Vec<u32> = free.iter().filter(|(_, v)| v[3] == 0.0).map(|(n, _)| *n).collect();
        let zeros = vec![[0.0; 4]; dead.len()];
        let v = self.buffers.v.clone();
        self.put(&v, &dead, &zeros)?;
        let x = self.buffers.x.clone();
        for slot in 0..self.slots {
            let ids: Vec<u32> = dead.iter().map(|n| (slot * self.node_count) as u32 + n).collect();
            self.put(&x, &ids, &zeros)?;
        }
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Snapshot> {
        let batch = self.record();
        let b = &self.buffers;
        let wanted = [(&b.u, b.u.bytes), (&b.v, b.v.bytes), (&b.free, b.free.bytes), (&b.cell, b.cell.bytes)];
        let parts = self.gpu.submit_and_read(batch, &wanted)?;
        let wide = |k: usize| cast::<V4<f32>>(&parts[k]).iter().map(|v| v.map(f64::from)).collect::<Vec<_>>();
        let (rotation, law) = if self.spring_count > 0 { (vec![], wide(3)) } else { (wide(3), vec![]) };
        Ok(Snapshot { u: wide(0), v: wide(1), rotation, free: wide(2), law })
    }

    fn solution(&mut self, slot: usize) -> Result<Vec<V4<f64>>> {
        let batch = self.record();
        let n = self.node_count;
        let parts = self.gpu.submit_and_read(batch, &[(&self.buffers.x, self.offset(slot + 1))])?;
        let all: Vec<V4<f32>> = cast(&parts[0]);
        Ok(all[slot * n..].iter().map(|v| v.map(f64::from)).collect())
    }
}
