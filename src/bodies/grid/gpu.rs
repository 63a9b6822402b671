//! Hexahedra on a device: element matrices of the layers as uniforms, rotations of the cells, the table of split nodes, and the multigrid
//! levels.
//!
//! The multigrid preconditioner is one V-cycle, unrolled into a flat list of dispatches. Each level has its own arrays and one parameter
//! block per pair of smoothing coefficients. Tangents of a hyperelastic body are not stored: each product computes them from the
//! displacements (`hyperelastic_tangent`).

use super::multigrid::steps;
use super::{Hyperelastic, Multigrid, element};
use crate::bodies::gpu::{Arrays, Dispatch, Maker, NonlinearLaw, Recorded, Search, TOUCHED, over_columns, over_nodes};
use crate::bodies::{MAX_LAYERS, Model, Refused, Removal};
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::{
    GROUP, Params, Source, blocks, centres, coarsen, collect, collect_product, factor, forces, hyperelastic_forces,
    hyperelastic_tangent, momentum, product, prolongation, relax, residual, restriction, rotations, split_product,
    trial_point,
};
use crate::math::{M3, V3, V4};
use crate::mesh::Parts;
use crate::scene::Mass;

/// Element matrices as 3×3 blocks; a mat3x3 in a uniform is three columns of 16 bytes.
fn stiffness_uniform(made: &mut Maker, stiffness: &[element::Matrix]) -> Buffer {
    let column = |c: V3<f32>| [c.x.to_bits(), c.y.to_bits(), c.z.to_bits(), 0];
    let blocks: Vec<M3<f32>> = element::blocks(stiffness);
    let words: Vec<u32> = blocks.iter().flat_map(|m| m.0.map(column)).flatten().collect();
    made.uniform("stiffness", MAX_LAYERS * 64 * 48, &words)
}

/// Element matrices as mirror blocks; they are symmetric, so rows serve as columns.
fn modes_uniform(made: &mut Maker, stiffness: &[element::Matrix]) -> Buffer {
    let column = |c: &[f32; 3]| [c[0].to_bits(), c[1].to_bits(), c[2].to_bits(), 0];
    let modes: Vec<product::Modes<f32>> = element::rounded_modes(stiffness);
    let words: Vec<u32> = modes.iter().flatten().flatten().flat_map(column).collect();
    made.uniform("modes", MAX_LAYERS * 8 * 48, &words)
}

/// Four values per layer.
fn layers_uniform(made: &mut Maker, name: &'static str, rows: &[V4<f32>]) -> Buffer {
    let words: Vec<u32> = rows.iter().flatten().map(|c| c.to_bits()).collect();
    made.uniform(name, MAX_LAYERS * 16, &words)
}

/// Arrays of a hyperelastic body that is solved by Newton's method.
struct Law {
    /// `τ` ([`crate::bodies::Step::elastic_at`]).
    elastic_at: f64,
    /// `r_K/h`
    damping: f64,
    energy: Buffer,
    b: Buffer,
    /// Parameter blocks of the small-strain products, and of the sums of tangent products.
    blocks: Vec<(Params<f32>, Buffer)>,
    sums: Vec<(Params<f32>, Buffer)>,
}

/// One level of multigrid: its arrays, sizes and smoothing coefficients.
struct Level {
    arrays: Arrays,
    params: Params<f32>,
    main: Buffer,
    steps: Vec<[f64; 2]>,
}

/// Arrays over cells and layers on a device.
pub(super) struct Hexahedra {
    shared: Arrays,
    rotation: Buffer,
    /// For a consistent mass: `stiffness` of the blocks and `v` of the right-hand side.
    consistent: Option<[Buffer; 2]>,
    params: Params<f32>,
    corotational: u32,
    hyperelastic: bool,
    split: Option<(Buffer, Vec<u32>)>,
    law: Option<Law>,
    multigrid: Option<Multigrid>,
    levels: Vec<Level>,
}

impl Hexahedra {
    pub fn new(
        hexahedra: &super::Hexahedra,
        model: &Model,
        made: &mut Maker,
        u: &Buffer,
        params: &Params<f32>,
    ) -> Result<Self> {
        if hexahedra.direct {
            return Err(Refused::DirectOnGpu.into());
        }
        // arrays of all laws
        let rotation = made.with("rotation", params.frames(), || model.first_rotations::<f32>())?;
        // the table of split nodes, or one word to bind where there is none
        let host = if made.gpu.is_dry() { vec![] } else { Parts::new(model.params()).table().to_vec() };
        let table = match hexahedra.extra_columns {
            0 => made.zeros::<u32>("split", 1)?,
            _ => made.with("split", params.layout().words, || host.clone())?,
        };
        let system = model.system_matrices();
        let mut shared = Arrays::of(&[
            table.clone(),
            layers_uniform(made, "shape", &model.shapes()),
            stiffness_uniform(made, if hexahedra.hyperelastic.is_some() { &system } else { &hexahedra.stiffness }),
            modes_uniform(made, &system),
            made.of("layer_of", &model.grid.layer_of)?,
            rotation.clone(),
            layers_uniform(made, "pre_strain", &model.pre_strains()),
        ]);
        // arrays of a consistent mass
        let mut consistent = None;
        if model.mass == Mass::Consistent {
            let mean_v = made.vec4("mean_v", model.node_count())?;
            shared = shared.joined(&Arrays::of(std::slice::from_ref(&mean_v)));
            consistent = Some([stiffness_uniform(made, &system), mean_v]);
        }
        let mut out = Self {
            shared,
            rotation,
            consistent,
            params: *params,
            corotational: hexahedra.corotational,
            hyperelastic: hexahedra.hyperelastic.is_some(),
            split: (hexahedra.extra_columns > 0).then_some((table, host)),
            law: None,
            multigrid: hexahedra.multigrid.clone(),
            levels: vec![],
        };
        if let Some(law) = &hexahedra.hyperelastic {
            out.add_law(law, model, made, u)?;
        }
        Ok(out)
    }

    /// Adds the arrays of a hyperelastic body.
    fn add_law(&mut self, law: &Hyperelastic, model: &Model, made: &mut Maker, u: &Buffer) -> Result<()> {
        made.gpu.making("hyperelastic law");
        let (n, cells) = (self.params.node_count as usize, self.params.cell_count as usize);
        // products with the consistent tangent write corner forces for each right-hand side
        let rhs_count = if law.newton { self.params.rhs_count as usize } else { 1 };
        let corner_force = made.zeros::<f32>("corner_force", cells * 24 * rhs_count)?;
        let energy = made.zeros::<f32>("energy", cells)?;
        let displacement = if law.newton { made.vec4("displacement", n)? } else { u.clone() };
        let fibres: Vec<u32> = law.rounded_fibres::<f32>().as_flattened().iter().map(|c| c.to_bits()).collect();
        let fibres = made.uniform("fibres", MAX_LAYERS * 32, &fibres);
        let scale = made.with("scale", law.scale_count(), || law.rounded_scale::<f32>())?;
        let own = [layers_uniform(made, "material", &law.rounded()), fibres, corner_force, energy.clone(), scale];
        self.shared = self.shared.joined(&Arrays::of(&own)).joined(&Arrays::one("displacement", &displacement));
        if !law.newton {
            return Ok(());
        }
        let elastic_at = model.step.elastic_at();
        self.law = Some(Law {
            elastic_at,
            damping: model.step.stiffness_factor() - elastic_at,
            energy,
            b: made.vec4("b", n)?,
            blocks: vec![],
            sums: vec![],
        });
        Ok(())
    }

    /// Contribution of split cells to a product; `None` where no cell can be split.
    fn split_product(
        &self,
        gpu: &Gpu,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Option<Dispatch>> {
        if params.extra_columns == 0 {
            return Ok(None);
        }
        let system = self.consistent.iter().map(|[system, _]| ("stiffness", system));
        let more: Vec<_> = system.chain([("params", main)]).collect();
        Ok(Some((arrays.bind(gpu, &split_product::SOURCE, &more)?, TOUCHED)))
    }

    /// One V-cycle from level `number` downwards, in the order of `bodies::grid::multigrid::cycle`.
    fn cycle(&self, made: &mut Maker, number: usize, first_rhs: u32, out: &mut Vec<Dispatch>) -> Result<()> {
        let (gpu, own) = (made.gpu, &self.levels[number]);
        let params = Params { first_rhs, ..own.params };
        // product with the level's matrix, and one smoothing kernel per coefficient pair
        let main = made.params(&params);
        let product = own.arrays.bind(gpu, &product::SOURCE, &[("params", &main)])?;
        let mut products = vec![(product, product::tiles(&params) * GROUP as usize)];
        products.extend(self.split_product(gpu, &own.arrays, &params, &main)?);
        let mut smoother = |fresh: bool, [keep, gain]: [f64; 2]| -> Result<Dispatch> {
            let params = Params { fresh: u32::from(fresh), keep: keep as f32, gain: gain as f32, ..params };
            let words = made.params(&params);
            Ok((own.arrays.bind(gpu, &relax::SOURCE, &[("params", &words)])?, over_columns(&params)))
        };
        let first = smoother(true, own.steps[0])?;
        let later: Vec<Dispatch> = own.steps.iter().map(|s| smoother(false, *s)).collect::<Result<_>>()?;
        let sweep = |steps: &[Dispatch], out: &mut Vec<Dispatch>| {
            for step in steps {
                out.extend(products.iter().chain([step]).cloned());
            }
        };
        // pre-smoothing; the first step starts from zero and needs no product
        out.push(first);
        sweep(&later[1..], out);
        let Some(next) = self.levels.get(number + 1) else {
            return Ok(());
        };
        // arrays of the coarser level under the names of the transfer kernels
        let coarse = |names: &[(&'static str, &'static str)]| -> Vec<(&'static str, Buffer)> {
            names.iter().filter_map(|(theirs, ours)| Some((*ours, next.arrays.get(theirs)?))).collect()
        };
        let bind = |source: &Source, names: &[(&'static str, &'static str)]| {
            let below = coarse(names);
            let mut more: Vec<_> = below.iter().map(|(name, buffer)| (*name, buffer)).collect();
            more.push(("params", &main));
            own.arrays.bind(gpu, source, &more)
        };
        // residual, restriction, coarse correction, prolongation, post-smoothing
        out.extend(products.iter().cloned());
        let threads = next.params.node_count as usize;
        out.push((bind(&restriction::SOURCE, &[("dofs", "coarse_dofs"), ("r", "coarse_r")])?, threads));
        self.cycle(made, number + 1, first_rhs, out)?;
        out.push((bind(&prolongation::SOURCE, &[("z", "coarse_z")])?, over_nodes(&params)));
        sweep(&later, out);
        Ok(())
    }

    /// Kernels that evaluate a trial point of the line search.
    fn search(&self, made: &mut Maker, arrays: &Arrays, x: &Buffer, law: &Law) -> Result<Search> {
        let n = self.params.node_count as usize;
        let groups = n.div_ceil(GROUP as usize);
        // arrays: increment and residual at the current and the trial point, and sums over groups
        let mut vector = |name| made.vec4(name, n);
        let dx = [vector("dx")?, vector("dx_next")?];
        let residual_force = [vector("residual_force")?, vector("residual_force_next")?];
        let w = vector("w")?;
        let predicted_decrease = made.zeros::<f32>("predicted_decrease", groups)?;
        let potential_and_residual = made.vec4("potential_and_residual", groups)?;
        let sums = made.zeros::<f32>("partial_product", self.params.product_groups as usize)?;
        let running = made.vec4("scalars", 2)?;
        // parameter blocks: step length and position of the elastic forces, factor of damping
        let gain = made.params(&self.params);
        let (_, damped) = with_factor(made, &self.params, law.damping);
        let along =
            [("params", &gain), ("dx", &dx[0]), ("x", x), ("residual_force", &residual_force[0]), ("dx_next", &dx[1])];
        let along = [&along[..], &[("predicted_decrease", &predicted_decrease)]].concat();
        let linear = [("params", &damped), ("z", &dx[1]), ("w", &w), ("partial_product", &sums), ("scalars", &running)];
        let left =
            [("params", &gain), ("b", &law.b), ("w", &w), ("dx", &dx[1]), ("residual_force", &residual_force[1])];
        let left = [&left[..], &[("potential_and_residual", &potential_and_residual)]].concat();
        let bind = |source, more: &[(&'static str, &Buffer)]| arrays.bind(made.gpu, source, more);
        // trial point, elastic forces, inertia and damping, residual
        let kernels = vec![
            (bind(&trial_point::SOURCE, &along)?, n),
            (bind(&hyperelastic_forces::SOURCE, &[("params", &gain)])?, self.params.cell_count as usize),
            (bind(&product::SOURCE, &linear)?, product::tiles(&self.params) * GROUP as usize),
            (bind(&residual::SOURCE, &left)?, n),
        ];
        let load = arrays.get("partial_load").unwrap_or_else(|| unreachable!("every body has it"));
        Ok(Search { gain, kernels, dx, residual_force, predicted_decrease, potential_and_residual, load })
    }
}

/// Parameter block with another factor of the small-strain matrix.
fn with_factor(made: &mut Maker, params: &Params<f32>, factor: f64) -> (Params<f32>, Buffer) {
    let params = Params { stiffness_factor: factor as f32, ..*params };
    (params, made.params(&params))
}

fn columns(params: &Params<f32>) -> usize {
    params.columns() + params.extra_columns as usize
}

/// The finest level, which uses the body's arrays, and the coarse levels.
fn make_levels(
    made: &mut Maker,
    multigrid: &Multigrid,
    finest: &Arrays,
    shared: &Arrays,
    params: &Params<f32>,
    main: &Buffer,
) -> Result<Vec<Level>> {
    made.gpu.making("multigrid");
    let rhs_count = params.rhs_count as usize;
    let levels = 1 + multigrid.coarse.len();
    let d = made.vec4("d", params.node_count as usize * rhs_count)?;
    let first = steps(multigrid.largest, 0, levels);
    let finest = finest.joined(&Arrays::of(&[d]));
    let layer_of = finest.get("layer_of");
    let mut out = vec![Level { arrays: finest, params: *params, main: main.clone(), steps: first }];
    // sums of the coarse smoothers, which nothing reads; on the finest level, entries beyond those in use must stay zero
    let unread = multigrid.coarse.first().map_or(0, |level| columns(&level.params(*params)).div_ceil(GROUP as usize));
    let unread = made.zeros::<f32>("partial_gamma", unread * rhs_count)?;
    for (number, level) in multigrid.coarse.iter().enumerate() {
        let params = level.params(*params);
        let n = params.node_count as usize;
        let dofs: &dyn Fn() -> Vec<V4<f32>> = &|| level.dofs.iter().map(|f| f.map(|c| c as f32)).collect();
        let mut own = vec![stiffness_uniform(made, &level.stiffness), modes_uniform(made, &level.stiffness)];
        own.push(unread.clone());
        own.extend(layer_of.clone());
        own.push(made.with("dofs", n, dofs)?);
        own.push(made.vec4("rotation", params.frames())?);
        own.push(made.vec4("block", n * 4)?);
        for name in ["r", "z", "d", "w"] {
            own.push(made.vec4(name, n * rhs_count)?);
        }
        // an array of its own, so that the finest level's sums persist
        own.push(made.zeros::<f32>("partial_product", params.product_groups as usize * rhs_count)?);
        let main = made.params(&params);
        let steps = steps(level.largest, 1 + number, levels);
        out.push(Level { arrays: shared.joined(&Arrays::of(&own)), params, main, steps });
    }
    Ok(out)
}

impl Recorded for Hexahedra {
    fn shared(&self) -> Arrays {
        self.shared.clone()
    }

    fn elements(&self) -> Option<Buffer> {
        Some(self.rotation.clone())
    }

    fn take(&self, gpu: &Gpu, removal: &Removal) {
        let Some(scale) = self.shared.get("scale") else { return };
        for run in removal.scale.chunk_by(|a, b| a.0 + 1 == b.0) {
            let factors: Vec<f32> = run.iter().map(|(_, factor)| *factor as f32).collect();
            gpu.write(&scale, 4 * u64::from(run[0].0), &factors);
        }
    }

    fn mean_velocities(&self) -> Option<Buffer> {
        self.consistent.as_ref().map(|[_, mean_v]| mean_v.clone())
    }

    fn forces(&self, gpu: &Gpu, arrays: &Arrays, main: &Buffer, at: Option<&Buffer>) -> Result<Vec<Dispatch>> {
        let (cells, nodes) = (self.params.cell_count as usize, over_nodes(&self.params));
        let bind = |source: &Source, more: Option<(&'static str, &Buffer)>| {
            let more: Vec<_> = more.into_iter().chain([("params", main)]).collect();
            arrays.bind(gpu, source, &more)
        };
        let mut list = vec![];
        if self.corotational != 0 {
            list.push((bind(&rotations::SOURCE, None)?, cells));
        }
        if self.hyperelastic {
            let u = arrays.get("u");
            let displacement = at.or(u.as_ref()).map(|at| ("displacement", at));
            list.push((bind(&hyperelastic_forces::SOURCE, displacement)?, cells));
            list.push((bind(&collect::SOURCE, None)?, nodes));
        } else {
            list.push((bind(&forces::SOURCE, at.map(|at| ("u", at)))?, nodes));
        }
        if self.consistent.is_some() {
            list.push((bind(&momentum::SOURCE, None)?, nodes));
        }
        Ok(list)
    }

    fn forces_of_law(
        &self,
        made: &mut Maker,
        arrays: &Arrays,
        at: &Buffer,
        to: &Buffer,
    ) -> Result<Option<Vec<Dispatch>>> {
        if !self.hyperelastic || self.law.is_some() {
            return Ok(None);
        }
        // as of a small-strain law the kernel leaves the linearisation alone
        let main = made.params(&Params { corotational: 1, ..self.params });
        let cells = [("params", &main), ("displacement", at)];
        Ok(Some(vec![
            (arrays.bind(made.gpu, &hyperelastic_forces::SOURCE, &cells)?, self.params.cell_count as usize),
            (arrays.bind(made.gpu, &collect::SOURCE, &[("params", &main), ("f", to)])?, over_nodes(&self.params)),
        ]))
    }

    fn blocks(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        let system = self.consistent.iter().map(|[system, _]| ("stiffness", system));
        let more: Vec<_> = system.chain(more.iter().copied()).collect();
        arrays.bind(gpu, &blocks::SOURCE, &more)
    }

    fn product(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        let gpu = made.gpu;
        let threads = product::tiles(params) * GROUP as usize;
        let bind = |source, block: &Buffer| arrays.bind(gpu, source, &[("params", block)]);
        let mut out = match &mut self.law {
            None => vec![(bind(&product::SOURCE, main)?, threads)],
            // inertia and damping, tangent of each cell, and the sum at the nodes
            Some(law) => {
                let damped = with_factor(made, params, law.damping);
                let summed = with_factor(made, params, law.elastic_at);
                let list = vec![
                    (bind(&product::SOURCE, &damped.1)?, threads),
                    (bind(&hyperelastic_tangent::SOURCE, &damped.1)?, params.cell_count as usize),
                    (bind(&collect_product::SOURCE, &summed.1)?, params.node_count as usize),
                ];
                law.blocks.push(damped);
                law.sums.push(summed);
                list
            }
        };
        out.extend(self.split_product(gpu, arrays, params, main)?);
        Ok(out)
    }

    fn refresh(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        sums: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        let Some(multigrid) = &self.multigrid else { return Ok(vec![]) };
        let shared = sums.joined(&Arrays::of(&arrays.get("split").into_iter().collect::<Vec<_>>()));
        self.levels = make_levels(made, multigrid, arrays, &shared, params, main)?;
        let gpu = made.gpu;
        let mut out = vec![];
        for pair in self.levels.windows(2) {
            let (fine, coarse) = (&pair[0], &pair[1]);
            let rotation = coarse.arrays.get("rotation");
            let below: Vec<_> =
                rotation.iter().map(|r| ("coarse_rotation", r)).chain([("params", &fine.main)]).collect();
            out.push((fine.arrays.bind(gpu, &coarsen::SOURCE, &below)?, coarse.params.cell_count as usize));
            let own = [("params", &coarse.main)];
            out.push((coarse.arrays.bind(gpu, &blocks::SOURCE, &own)?, coarse.params.node_count as usize));
            out.push((coarse.arrays.bind(gpu, &factor::SOURCE, &own)?, columns(&coarse.params)));
        }
        Ok(out)
    }

    fn precondition(&self, made: &mut Maker, params: &Params<f32>) -> Result<Option<Vec<Dispatch>>> {
        if self.levels.is_empty() {
            return Ok(None);
        }
        let mut out = vec![];
        self.cycle(made, 0, params.first_rhs, &mut out)?;
        Ok(Some(out))
    }

    fn points(&self, gpu: &Gpu, main: &Buffer, u: &Buffer, to: &Buffer) -> Result<Option<Dispatch>> {
        let list = [("params", main), ("u", u), ("point_u", to)];
        Ok(Some((self.shared.bind(gpu, &centres::SOURCE, &list)?, self.params.cell_count as usize)))
    }

    fn split(&self) -> Option<(Buffer, Vec<u32>)> {
        self.split.clone()
    }

    fn nonlinear(&mut self, made: &mut Maker, arrays: &Arrays, x: &Buffer) -> Result<Option<NonlinearLaw>> {
        let Some(law) = &self.law else { return Ok(None) };
        made.gpu.making("hyperelastic law");
        let search = self.search(made, arrays, x, law)?;
        let Law { elastic_at, damping, energy, b, blocks, sums } = law;
        let (blocks, sums, energy, b) = (blocks.clone(), sums.clone(), energy.clone(), b.clone());
        Ok(Some(NonlinearLaw { elastic_at: *elastic_at, damping: *damping, blocks, sums, energy, b, search }))
    }
}
