//! Groups of device arrays: the state, the segments that a blade can cut, the bounding boxes of tiles.

use crate::backend::NOT_KEPT;
use crate::bodies::gpu::{Dispatch, Maker, Recorded};
use crate::bodies::{Model, Refused, Segments};
use crate::error::Result;
use crate::gpu::{Batch, Bound, Buffer, Gpu, cast};
use crate::kernels::cut::Hit;
use crate::kernels::{Params, bounds, cut, probe};
use crate::math::{V3, V4};

/// State of a body.
pub(super) struct Body {
    pub u: Buffer,
    pub v: Buffer,
    pub dofs: Buffer,   // DOF mask and mass as in A
    pub masses: Buffer, // DOF mask and nodal mass; the same array without rest-shape springs
    pub load: Buffer,
    pub elements: Option<Buffer>, // rotations of cells, or laws of springs
}

pub(super) struct Cutting {
    centres: Option<[Dispatch; 2]>, // at the start and the end of the step; None for springs, which end at nodes
    point_before: Buffer,
    cut: Bound,
    params: Buffer,
    quads: Buffer,
    hits: Buffer,
    hit_count: Buffer,
    segments: usize,
    kept: bool, // `point_before` is from the last step
}

/// Maximum number of hits read back per step; a blade crosses a few hundred links at most.
const MAX_HITS: usize = 65_536;

/// Hits read with their count; there are usually fewer, and more take a read-back of their own.
const FIRST_HITS: u64 = 1024;

/// Maximum number of swept quads per step; one per piece of the blade's edge.
const MAX_QUADS: usize = 256;

/// Runs the probe that tests compensated summation on the device.
pub(super) fn compensation_survives(made: &mut Maker) -> Result<bool> {
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

impl Cutting {
    pub fn new(made: &mut Maker, model: &Model, main: &Buffer, kind: &dyn Recorded, u: &Buffer) -> Result<Self> {
        let gpu = made.gpu;
        let mechanics = model.mechanics();
        let (segments, points) = (mechanics.segment_count(model), mechanics.point_count(model));
        // buffers of the segments, the quads and the hits
        let of_body = if gpu.is_dry() { Segments::default() } else { mechanics.segments(model) };
        let rest = || of_body.rest.iter().map(|p| V3::of(*p).pad(0.0)).collect();
        let rest: &dyn Fn() -> Vec<V4<f32>> = &rest;
        let ends = made.with("ends", segments, || of_body.ends.clone())?;
        let rest = made.with("rest", points, rest)?;
        let params = made.uniform("params", 16, &[0; 4]);
        let quads = made.vec4("quads", MAX_QUADS * 4)?;
        let hits = made.zeros::<[u32; 2]>("hits", MAX_HITS)?;
        let hit_count = made.of("hit_count", &[0u32; 4])?;
        let point_before = made.vec4("point_before", points)?;
        // segments end at nodes, or at points computed from nodes
        let (centres, point_u) = match kind.points(gpu, main, u, &point_before)? {
            None => (None, u.clone()),
            Some(before) => {
                let point_u = made.vec4("point_u", points)?;
                let now = kind.points(gpu, main, u, &point_u)?.unwrap_or_else(|| before.clone());
                (Some([before, now]), point_u)
            }
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

    /// Saves the positions of the segments' ends if `cuts`; must precede the step's integration.
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

    /// Records the search for segments crossed by the quads; returns what [`Cutting::hits`] needs read.
    pub fn record(&self, gpu: &Gpu, batch: &mut Batch, quads: &[[f64; 3]]) -> Result<[(&Buffer, u64); 2]> {
        let corners: Vec<V4<f32>> = quads.iter().map(|p| V3::of(*p).pad(0.0)).collect();
        if corners.len() > MAX_QUADS * 4 {
            return Err(Refused::SweptQuads { count: corners.len() / 4, most: MAX_QUADS }.into());
        }
        assert!(self.kept, "{NOT_KEPT}");
        gpu.write(&self.params, 0, &[self.segments as u32, corners.len() as u32 / 4, MAX_HITS as u32, 0]);
        gpu.write(&self.quads, 0, &corners);
        gpu.write(&self.hit_count, 0, &[0u32; 4]);
        if let Some([_, (centres, cells)]) = &self.centres {
            batch.run(centres, *cells, 1);
        }
        batch.run(&self.cut, self.segments, 1);
        Ok([(&self.hit_count, 4), (&self.hits, FIRST_HITS * 8)])
    }

    /// Segments crossed by the quads, in ascending order.
    pub fn hits(&self, gpu: &Gpu, [count, first]: [&[u8]; 2]) -> Result<Vec<Hit<f64>>> {
        let count = cast::<u32>(count)[0] as usize;
        if count > MAX_HITS {
            return Err(Refused::CutLinks { count, most: MAX_HITS }.into());
        }
        let mut hits: Vec<[u32; 2]> =
            if count as u64 <= FIRST_HITS { cast(first) } else { gpu.read(&self.hits, count)? };
        hits.truncate(count);
        hits.sort_unstable();
        Ok(hits.iter().map(|[segment, at]| Hit { segment: *segment, at: f64::from(f32::from_bits(*at)) }).collect())
    }
}

/// Bounding boxes of the displacements of the skin's tiles.
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

    /// Records the bounding boxes; `threads` and `bytes` come from the tiles in use. Returns what is to be read.
    pub fn record(&self, batch: &mut Batch, (threads, bytes): (usize, u64)) -> (&Buffer, u64) {
        batch.run(&self.kernel, threads, 1);
        (&self.out, bytes)
    }
}

pub(super) fn axes(dofs: V4<f64>) -> V3<f32> {
    V3::of([dofs[0], dofs[1], dofs[2]])
}
