//! Arrays of the body on the device by the names that the kernels use, and the groups of them that belong together.

use super::in_use::over_nodes;
use crate::backend::{NOT_KEPT, cell_centres, links};
use crate::error::{Error, Result};
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::cut::Hit;
use crate::kernels::{
    self, Params, Source, blocks, bounds, centres, collect, cut, forces, momentum, neo_forces, probe, product,
    rotations, springs, springs_blocks, springs_product,
};
use crate::math::{M3, V3, V4};
use crate::mesh::Parts;
use crate::model::{MAX_LAYERS, Model, element};
use crate::scene::Mass;

/// A kernel with its arrays, and how many threads it takes.
pub(super) type Dispatch = (Bound, usize);

/// Arrays by name; of two with one name the later counts.
#[derive(Clone, Default)]
pub(super) struct Arrays(Vec<(&'static str, Buffer)>);

impl Arrays {
    /// Arrays under their own names.
    pub fn of(buffers: &[Buffer]) -> Self {
        Self(buffers.iter().map(|b| (b.name, b.clone())).collect())
    }
    /// These and more.
    pub fn joined(&self, more: &Self) -> Self {
        Self(self.0.iter().chain(&more.0).cloned().collect())
    }
    /// One array under another name.
    pub fn one(name: &'static str, buffer: &Buffer) -> Self {
        Self(vec![(name, buffer.clone())])
    }
    /// The array of a name.
    pub fn get(&self, name: &str) -> Option<Buffer> {
        self.0.iter().rev().find(|(n, _)| *n == name).map(|(_, buffer)| buffer.clone())
    }
    /// Binds what a kernel names.
    pub fn bind(&self, gpu: &Gpu, source: &Source, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        let list: Vec<(&str, &Buffer)> =
            self.0.iter().map(|(name, buffer)| (*name, buffer)).chain(more.iter().copied()).collect();
        gpu.bind_from(source, &list)
    }
}

/// What a step changes.
pub(super) struct Body {
    pub u: Buffer,
    pub v: Buffer,
    pub free: Buffer,   // as A has them
    pub masses: Buffer, // as they are; the same array where nothing is anchored
    pub load: Buffer,
    pub cell: Buffer, // rotations of bricks, or the law of springs
}

pub(super) struct Cutting {
    centres: Option<[Dispatch; 2]>, // at the step's start and end; of springs the nodes count
    point_before: Buffer,
    cut: Bound,
    params: Buffer,
    quads: Buffer,
    hits: Buffer,
    hit_count: Buffer,
    segments: usize,
    kept: bool, // `point_before` is of the last step
}

/// Hits of one step that the device can hand back; a blade crosses some hundred links at most.
const MAX_HITS: usize = 65_536;

/// Swept quads of one step; a blade has as many as its edge has pieces.
const MAX_QUADS: usize = 256;

/// Runs the probe of compensated sums.
pub(super) fn keeps_what_sums_lose(made: &mut Maker) -> Result<bool> {
    let gpu = made.gpu;
    let cases = probe::cases();
    let errors = made.of("errors", &[0f32; probe::CASES])?;
    let params = made.uniform("params", 0, &Params::<f32>::default().words());
    let list = [("params", &params), ("cases", &made.of("cases", &cases)?), ("errors", &errors)];
    let mut batch = gpu.batch();
    batch.run(&gpu.bind(&probe::SOURCE, &list)?, probe::CASES, 1);
    let found: Vec<f32> = cast(&gpu.submit_and_read(batch, &[(&errors, errors.bytes)])?[0]);
    let mut exact = [0f32; probe::CASES];
    probe::probe(&cases, &mut exact);
    Ok(found[..probe::CASES] == exact)
}

/// Makes buffers and adds up their bytes.
pub(super) struct Maker<'a> {
    pub gpu: &'a Gpu,
    pub bytes: u64,
    /// What changes with the first cut.
    pub reserved: Reserved,
}

/// What does not know of a reserve of copies until the first of them is taken.
#[derive(Default)]
pub(super) struct Reserved {
    /// Parameter blocks, as they will be.
    pub blocks: Vec<(Params<f32>, Buffer)>,
    /// Sums over columns, which are counted otherwise then.
    pub sums: Vec<Buffer>,
}

impl<'a> Maker<'a> {
    pub fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, bytes: 0, reserved: Reserved::default() }
    }
    /// A parameter block. Until the first cut it knows of no reserve of copies, so that no kernel looks for one.
    pub fn params(&mut self, params: &Params<f32>) -> Buffer {
        let buffer = self.uniform("params", 0, &Params { extra_columns: 0, ..*params }.words());
        if params.extra_columns > 0 {
            self.reserved.blocks.push((*params, buffer.clone()));
        }
        buffer
    }
    pub fn uniform(&mut self, name: &'static str, bytes: usize, data: &[u32]) -> Buffer {
        let buffer = self.gpu.uniform(name, bytes, data);
        self.bytes += buffer.bytes;
        buffer
    }
    pub fn vec4(&mut self, name: &'static str, count: usize) -> Result<Buffer> {
        let buffer = self.gpu.array::<V4<f32>>(name, count)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
    pub fn of<T: bytemuck::NoUninit>(&mut self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.gpu.array_of(name, data)?;
        self.bytes += buffer.bytes;
        Ok(buffer)
    }
}

/// Element matrices as 3×3 blocks; mat3x3 in a uniform: three columns of 16 bytes.
pub(super) fn stiffness_uniform(made: &mut Maker, stiffness: &[element::Matrix]) -> Buffer {
    let column = |c: V3<f32>| [c.x.to_bits(), c.y.to_bits(), c.z.to_bits(), 0];
    let blocks: Vec<M3<f32>> = element::blocks(stiffness);
    let words: Vec<u32> = blocks.iter().flat_map(|m| m.0.map(column)).flatten().collect();
    made.uniform("stiffness", MAX_LAYERS * 64 * 48, &words)
}

/// Element matrices in mirror blocks, which are symmetric, so rows serve as columns.
pub(super) fn modes_uniform(made: &mut Maker, stiffness: &[element::Matrix]) -> Buffer {
    let column = |c: &[f32; 3]| [c[0].to_bits(), c[1].to_bits(), c[2].to_bits(), 0];
    let modes: Vec<product::Modes<f32>> = element::rounded_modes(stiffness);
    let words: Vec<u32> = modes.iter().flatten().flatten().flat_map(column).collect();
    made.uniform("modes", MAX_LAYERS * 8 * 48, &words)
}

/// Arrays and kernels of the elastic law.
pub(super) struct Law {
    pub shared: Arrays,
    /// `stiffness` of the blocks and `v` of the right-hand side with a consistent mass.
    pub consistent: Option<[Buffer; 2]>,
    pub cell: Buffer,
    pub springs: usize,
    pub elastic: Vec<(&'static kernels::Source, usize)>,
    pub product: &'static kernels::Source,
    pub blocks: &'static kernels::Source,
}

impl Law {
    pub fn new(made: &mut Maker, model: &Model) -> Result<Self> {
        if model.direct {
            return Err(Error::Usage {
                what: "the direct solver runs on the CPU path, not on a GPU".into(),
                fix: "run it with --backend cpu, or take the preconditioner multigrid".into(),
            });
        }
        let n = model.node_count();
        if let Some(s) = &model.springs {
            let rest: Vec<V4<f32>> = model.rest.iter().map(|p| V3::of(*p).pad(0.0)).collect();
            let law: Vec<V4<f32>> = s.law.iter().map(|l| l.map(|c| c as f32)).collect();
            let cell = made.of("law", &law)?;
            let shared = Arrays::of(&[
                made.of("rest", &rest)?,
                made.of("first", &s.first)?,
                made.of("half", &s.half)?,
                made.vec4("tangent", s.half.len() * 2)?,
                cell.clone(),
            ]);
            return Ok(Self {
                shared,
                consistent: None,
                cell,
                springs: s.ends.len(),
                elastic: vec![(&springs::SOURCE, n)],
                product: &springs_product::SOURCE,
                blocks: &springs_blocks::SOURCE,
            });
        }
        let cells = model.grid.cell_count();
        let cell = made.of("rotation", &vec![[0f32, 0.0, 0.0, 1.0]; cells])?;
        let words = |rows: Vec<V4<f32>>| rows.iter().flatten().map(|c| c.to_bits()).collect::<Vec<u32>>();
        let parts = Parts::new(model.params());
        let table = if parts.table().is_empty() { &[0] } else { parts.table() };
        let mut shared = Arrays::of(&[
            made.of("split", table)?,
            made.uniform("shape", MAX_LAYERS * 16, &words(model.shapes())),
            stiffness_uniform(made, &model.stiffness),
            modes_uniform(made, &model.system()),
            made.of("layer_of", &model.grid.layer_of)?,
            cell.clone(),
        ]);
        let mut elastic: Vec<(&'static kernels::Source, usize)> = vec![];
        if model.corotational {
            elastic.push((&rotations::SOURCE, cells));
        }
        let n = over_nodes(&model.params());
        if model.neo_hookean.is_some() {
            elastic.extend([(&neo_forces::SOURCE, cells), (&collect::SOURCE, n)]);
        } else {
            let pre_strain = made.uniform("pre_strain", MAX_LAYERS * 16, &words(model.pre_strains()));
            shared = shared.joined(&Arrays::of(&[pre_strain]));
            elastic.push((&forces::SOURCE, n));
        }
        let mut consistent = None;
        if model.mass == Mass::Consistent {
            let mean_v = made.vec4("mean_v", model.node_count())?;
            shared = shared.joined(&Arrays::of(std::slice::from_ref(&mean_v)));
            elastic.push((&momentum::SOURCE, n));
            consistent = Some([stiffness_uniform(made, &model.system()), mean_v]);
        }
        Ok(Self { shared, consistent, cell, springs: 0, elastic, product: &product::SOURCE, blocks: &blocks::SOURCE })
    }
}

impl Cutting {
    pub fn new(made: &mut Maker, model: &Model, main: &Buffer, law: &Arrays, u: &Buffer) -> Result<Self> {
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
        let hits = made.of("hits", &vec![[0u32; 2]; MAX_HITS])?;
        let hit_count = made.of("hit_count", &[0u32; 4])?;
        let points = if model.springs.is_some() { model.grid.node_count() } else { model.grid.cell_count() };
        let point_before = made.vec4("point_before", points)?;
        let (centres, point_u) = if model.springs.is_some() {
            (None, u.clone())
        } else {
            let point_u = made.vec4("point_u", points)?;
            let of = |to: &Buffer| law.bind(gpu, &centres::SOURCE, &[("params", main), ("u", u), ("point_u", to)]);
            (Some([(of(&point_before)?, points), (of(&point_u)?, points)]), point_u)
        };
        let cut = gpu.bind(
            &cut::SOURCE,
            &[
                ("params", &params),
                ("ends", &ends),
                ("rest", &rest),
                ("point_u", &point_u),
                ("point_before", &point_before),
                ("quads", &quads),
                ("hits", &hits),
                ("hit_count", &hit_count),
            ],
        )?;
        Ok(Self { centres, point_before, cut, params, quads, hits, hit_count, segments, kept: false })
    }

    /// Keeps where the segments' ends are, if `cuts`; comes before the step's integration.
    pub fn keep_points(&mut self, batch: &mut Batch, u: &Buffer, cuts: bool) {
        self.kept = cuts;
        if !cuts {
            return;
        }
        match &self.centres {
            Some([(before, cells), _]) => batch.run(before, *cells, 1),
            None => batch.copy(u, 0, &self.point_before, 0, u.bytes),
        }
    }

    /// Runs what the batch holds and the cut: segments crossed by the quads, in their order.
    pub fn hits(&self, gpu: &Gpu, mut batch: Batch, quads: &[[f64; 3]]) -> Result<Vec<Hit<f64>>> {
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
        assert!(self.kept, "{NOT_KEPT}");
        gpu.write(&self.params, 0, &[self.segments as u32, corners.len() as u32 / 4, MAX_HITS as u32, 0]);
        gpu.write(&self.quads, 0, &corners);
        gpu.write(&self.hit_count, 0, &[0u32; 4]);
        if let Some([_, (centres, cells)]) = &self.centres {
            batch.run(centres, *cells, 1);
        }
        batch.run(&self.cut, self.segments, 1);
        // few hits are usual: count and the first of them come in one read-back
        let first = 1024u64;
        let parts = gpu.submit_and_read(batch, &[(&self.hit_count, 4), (&self.hits, first * 8)])?;
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
        let mut hits: Vec<[u32; 2]> =
            if count as u64 <= first { cast(&parts[1]) } else { gpu.read(&self.hits, count)? };
        hits.truncate(count);
        hits.sort_unstable();
        Ok(hits.iter().map(|[segment, at]| Hit { segment: *segment, at: f64::from(f32::from_bits(*at)) }).collect())
    }
}

/// What each tile of the skin moves between.
pub(super) struct Bounds {
    kernel: Bound,
    out: Buffer,
}

impl Bounds {
    pub fn new(made: &mut Maker, model: &Model, main: &Buffer, u: &Buffer) -> Result<Self> {
        let tiles = bounds::tile_count(&model.params::<f32>());
        let out = made.vec4("tile_bounds", tiles * 2)?;
        let list = [("params", main), ("u", u), ("tile_bounds", &out)];
        Ok(Self { kernel: made.gpu.bind(&bounds::SOURCE, &list)?, out })
    }

    /// Runs what the batch holds, and the bounds of the skin then; of so many threads and bytes of tiles.
    pub fn read(&self, gpu: &Gpu, mut batch: Batch, (threads, bytes): (usize, u64)) -> Result<Vec<[V4<f64>; 2]>> {
        batch.run(&self.kernel, threads, 1);
        let parts = gpu.submit_and_read(batch, &[(&self.out, bytes)])?;
        let all: Vec<[V4<f32>; 2]> = cast(&parts[0]);
        Ok(all.iter().map(|pair| pair.map(|v| v.map(f64::from))).collect())
    }
}

pub(super) fn axes(free: V4<f64>) -> V3<f32> {
    V3::of([free[0], free[1], free[2]])
}
