//! Tetrahedra on a device: the arrays of [`super::operator`], rotations of the step, and the results of each pass for each right-hand side.

use super::auxiliary::{Auxiliary, GAIN, Lists, Transfer};
use super::operator::Arrays as Operator;
use crate::bodies::gpu::{Arrays, Dispatch, Maker, Recorded, over_columns};
use crate::bodies::{MAX_LAYERS, Model, Removal};
use crate::error::Result;
use crate::gpu::{Bound, Buffer, Gpu};
use crate::kernels::polar::UPRIGHT;
use crate::kernels::{
    GROUP, Params, Source, auxiliary_correction, auxiliary_restriction, auxiliary_rotations, factor, relax,
    tetrahedra_blocks, tetrahedra_centres, tetrahedra_changes, tetrahedra_deformations, tetrahedra_domains,
    tetrahedra_forces, tetrahedra_frames, tetrahedra_large, tetrahedra_laws, tetrahedra_means, tetrahedra_plain,
    tetrahedra_pressed, tetrahedra_pressures, tetrahedra_product, tetrahedra_rotations, tetrahedra_smoothed,
    tetrahedra_strains, tetrahedra_volumes,
};
use crate::math::round;
use std::cell::RefCell;

/// Arrays over tetrahedra, domains and nodes on a device.
pub(super) struct Tetrahedra {
    shared: Arrays,
    params: Params<f32>,
    corotational: bool,
    smoothed: bool,
    /// Parameter block of the forces, which are those of all displacements.
    total: Buffer,
    /// The same for passes over patches.
    total_of_patches: Buffer,
    /// Solver scalars of a right-hand side that is not done, for the forces.
    running: Buffer,
    /// Parameter blocks of the mean rotations of domains and of nodes.
    means: [Buffer; 2],
    /// Corners, where tools cut or carve.
    corners: Option<(Buffer, Vec<u32>)>,
    /// Whether the law is hyperelastic.
    hyperelastic: bool,
    /// Of a hyperelastic law with plain elements: lists of its patches, under the names of those of the nodes.
    patches: Vec<(&'static str, Buffer)>,
    multigrid: Option<Multigrid>,
}

/// The auxiliary grid.
struct Multigrid {
    transfer: RefCell<Transfer>,
    hexahedra: Box<dyn Recorded>,
    params: Params<f32>,
    main: Buffer,
    /// Of the grid.
    own: Arrays,
    /// Weights of the nodes, and the smoother's increment.
    of_body: Arrays,
    /// All arrays of the body and of its solver.
    body: Arrays,
}

impl Multigrid {
    fn new(host: &Auxiliary, model: &Model, made: &mut Maker, u: &Buffer, body: &Params<f32>) -> Result<Self> {
        made.gpu.making("multigrid");
        let (rhs_count, compensated) = (body.rhs_count, body.compensated);
        let params = Params { rhs_count, compensated, ..host.model.params::<f32>() };
        let hexahedra = host.model.mechanics().recorded(&host.model, made, u, &params)?;
        let (n, cells, rhs_count) = (params.node_count as usize, params.cell_count as usize, rhs_count as usize);
        let sums = |threads: usize| threads.div_ceil(GROUP as usize) * rhs_count;
        let own = [
            made.with("dofs", n, || rounded(&host.model.dofs))?,
            made.vec4("block", n * 4)?,
            made.vec4("r", n * rhs_count)?,
            made.vec4("z", n * rhs_count)?,
            made.vec4("w", n * rhs_count)?,
            made.zeros::<f32>("partial_product", params.product_groups as usize * rhs_count)?,
            made.zeros::<f32>("partial_gamma", sums(params.columns()))?,
            made.with("first_of_cell", cells + 1, || host.in_cell.first.clone())?,
            made.with("in_cell", host.inside, || host.in_cell.members.clone())?,
            made.with("scale", cells, || host.scale.iter().map(|s| *s as f32).collect())?,
        ];
        // with room for the copies that a cut makes
        let (nodes, most) = (body.node_count as usize, Auxiliary::most_weights(model));
        let of_body = [
            made.with("first_weight", nodes + 1, || host.transfer.weights.first.clone())?,
            made.zeros::<u32>("weighted", most)?,
            made.zeros::<f32>("weight", most)?,
            made.with("first_around", n + 1, || host.transfer.around.first.clone())?,
            made.zeros::<u32>("around", most)?,
            made.zeros::<f32>("weight_around", most)?,
            made.vec4("d", nodes * rhs_count)?,
        ];
        let out = Self {
            transfer: RefCell::new(host.transfer.clone()),
            own: hexahedra.shared().joined(&Arrays::of(&own)),
            of_body: Arrays::of(&of_body),
            body: Arrays::default(),
            main: made.params(&params),
            hexahedra,
            params,
        };
        if !made.gpu.is_dry() {
            out.write(made.gpu);
        }
        Ok(out)
    }

    /// Writes the weights of the nodes.
    fn write(&self, gpu: &Gpu) {
        let transfer = self.transfer.borrow();
        let lists = [
            (&transfer.weights, ["first_weight", "weighted", "weight"]),
            (&transfer.around, ["first_around", "around", "weight_around"]),
        ];
        for (Lists { first, members, weight }, names) in lists {
            let [to_first, to_members, to_weight] =
                names.map(|name| self.of_body.get(name).unwrap_or_else(|| unreachable!("the grid has {name}")));
            let weight: Vec<f32> = weight.iter().map(|w| *w as f32).collect();
            gpu.write(&to_first, 0, first);
            gpu.write(&to_members, 0, members);
            gpu.write(&to_weight, 0, &weight);
        }
    }

    /// Arrays of the grid under the names that the kernels of both have for them.
    fn named(&self, names: &[(&'static str, &'static str)]) -> Arrays {
        let one = |(theirs, ours): &(&'static str, &'static str)| Some(Arrays::one(ours, &self.own.get(theirs)?));
        names.iter().filter_map(one).fold(self.body.clone(), |all, one| all.joined(&one))
    }

    /// Rotations of the cells, columns and coarse levels.
    fn refresh(&mut self, made: &mut Maker, body: &Arrays, sums: &Arrays) -> Result<Vec<Dispatch>> {
        self.body = body.joined(&self.of_body);
        let own = sums.joined(&self.own);
        let gpu = made.gpu;
        let main = ("params", &self.main);
        let node_rotation = body.get("node_rotation").unwrap_or_else(|| unreachable!("tetrahedra have it"));
        let turn = own.bind(gpu, &auxiliary_rotations::SOURCE, &[main, ("node_rotation", &node_rotation)])?;
        let mut list = vec![
            (turn, self.params.cell_count as usize),
            (self.hexahedra.blocks(gpu, &own, &[main])?, self.params.node_count as usize),
            (own.bind(gpu, &factor::SOURCE, &[main])?, self.params.columns()),
        ];
        list.extend(self.hexahedra.refresh(made, &own, sums, &self.params, &self.main)?);
        Ok(list)
    }

    fn precondition(&self, made: &mut Maker, body: &Params<f32>) -> Result<Vec<Dispatch>> {
        let gpu = made.gpu;
        let params = Params { first_rhs: body.first_rhs, ..self.params };
        // restriction, V-cycle, correction, and the node blocks' share
        let down = made.params(&params);
        let names = [("dofs", "auxiliary_dofs"), ("r", "auxiliary_r"), ("z", "auxiliary_z")];
        let both = self.named(&names);
        let restrict = both.bind(gpu, &auxiliary_restriction::SOURCE, &[("params", &down)])?;
        let mut list = vec![(restrict, params.node_count as usize)];
        list.extend(self.hexahedra.precondition(made, &params)?.into_iter().flatten());
        let up = made.params(body);
        let correct = both.bind(gpu, &auxiliary_correction::SOURCE, &[("params", &up)])?;
        list.push((correct, body.node_count as usize));
        let added = made.params(&Params { fresh: 0, keep: 0.0, gain: GAIN as f32, ..*body });
        list.push((both.bind(gpu, &relax::SOURCE, &[("params", &added)])?, over_columns(body)));
        Ok(list)
    }
}

/// Rounds an array of the host when the device stores it.
fn rounded<const N: usize>(values: &[[f64; N]]) -> Vec<[f32; N]> {
    values.iter().map(round).collect()
}

impl Tetrahedra {
    pub fn new(
        tetrahedra: &super::Tetrahedra,
        model: &Model,
        made: &mut Maker,
        u: &Buffer,
        params: &Params<f32>,
    ) -> Result<Self> {
        let multigrid = tetrahedra.auxiliary.as_deref();
        let multigrid = multigrid.map(|host| Multigrid::new(host, model, made, u, params)).transpose()?;
        let (own, smoothed): (&Operator<f64>, _) = (&tetrahedra.arrays, tetrahedra.smoothed);
        let hyperelastic = tetrahedra.law.is_some();
        let [nodes, count, domains] =
            [params.node_count, params.tetrahedron_count, params.domain_count].map(|n| n as usize);
        let rhs_count = params.rhs_count as usize;
        // constant arrays
        let per_volume: &dyn Fn() -> Vec<f32> = &|| own.per_volume.iter().map(|v| *v as f32).collect();
        let mut shared = vec![
            made.with("corners", count, || own.corners.clone())?,
            made.with("gradients", 3 * count, || rounded(&own.gradients))?,
            made.with("first_of_node", nodes + 1, || own.first_of_node.clone())?,
            made.with("of_node", 4 * count, || own.of_node.clone())?,
            made.with("rest_block", 2 * nodes, || rounded(&own.rest_block))?,
        ];
        // rotations of the step, and forces of the tetrahedra, whose array has their strains before
        let upright = |count: usize| move || vec![UPRIGHT.map(|c| c as f32); count];
        shared.push(made.with("node_rotation", nodes, upright(nodes))?);
        let force = made.vec4("tetrahedron_force", 3 * count * rhs_count)?;
        // strains and pressures of domains
        let patches = Self::patch_count(params, smoothed);
        if smoothed || hyperelastic {
            shared.extend([
                made.with("first_of_domain", domains + 1, || own.first_of_domain.clone())?,
                made.with("of_domain", if smoothed { 6 * count } else { count }, || own.of_domain.clone())?,
                made.with("shear", domains, || rounded(&own.shear))?,
                made.with("domains", 6 * count, || own.domains.clone())?,
                made.vec4("domain_stress", 3 * domains * rhs_count)?,
                made.zeros::<f32>("nodal_strain", patches * rhs_count)?,
                made.zeros::<f32>("pressure", patches * rhs_count)?,
            ]);
        }
        if smoothed {
            shared.push(made.with("per_volume", nodes, per_volume)?);
        }
        // linearisation of a large-strain law, or rotations of a small-strain one
        match hyperelastic {
            true => {
                let laws: Vec<u32> =
                    rounded(&own.laws).as_flattened().iter().map(|number: &f32| number.to_bits()).collect();
                shared.push(made.uniform("laws", MAX_LAYERS * 16, &laws));
                shared.extend([made.vec4("cofactor", 3 * count)?, made.vec4("frame", domains)?]);
            }
            false => shared.push(made.with("element_rotation", count, upright(count))?),
        }
        if smoothed || hyperelastic {
            shared.push(made.with("domain_rotation", domains, upright(domains))?);
        }
        // patches of plain elements: around each tetrahedron those that share a node
        let mut of_patches = vec![];
        if hyperelastic && !smoothed {
            let of = &own.patches;
            let volumes = || of.per_volume.iter().map(|v| *v as f32).collect();
            of_patches = vec![
                ("corners", made.with("patch_corners", count, || of.corners.clone())?),
                ("first_of_node", made.with("first_of_patch", count + 1, || of.first.clone())?),
                ("of_node", made.with("of_patch", count, || of.members.clone())?),
                ("per_volume", made.with("per_patch_volume", count, volumes)?),
            ];
        }
        let corners = || if made.gpu.is_dry() { vec![] } else { own.corners.as_flattened().to_vec() };
        Ok(Self {
            corners: tetrahedra.can_change.then(|| (shared[0].clone(), corners())),
            shared: Arrays::of(&shared)
                .joined(&Arrays::of(std::slice::from_ref(&force)))
                .joined(&Arrays::one("strain", &force)),
            total: made.params(&Params { total: 1, ..*params }),
            total_of_patches: made.params(&Params {
                total: 1,
                node_count: Self::patch_count(params, smoothed) as u32,
                ..*params
            }),
            running: made.vec4("scalars", 2)?,
            means: [domains, nodes].map(|count| made.uniform("params", 16, &[count as u32, 0, 0, 0])),
            params: *params,
            corotational: tetrahedra.corotational,
            smoothed,
            hyperelastic,
            patches: of_patches,
            multigrid,
        })
    }

    /// Number of patches that volumes are averaged over: nodes, of plain elements tetrahedra.
    fn patch_count(params: &Params<f32>, smoothed: bool) -> usize {
        if smoothed { params.node_count as usize } else { params.tetrahedron_count as usize }
    }

    /// Parameter block of the passes over patches.
    fn over_patches(&self, made: &mut Maker, params: &Params<f32>) -> Buffer {
        made.params(&Params { node_count: Self::patch_count(params, self.smoothed) as u32, ..*params })
    }

    /// Rotations of the tetrahedra, domains and nodes at the displacements `u`.
    fn rotations(&self, gpu: &Gpu, arrays: &Arrays, u: &Buffer) -> Result<Vec<Dispatch>> {
        let [_, count, _] = self.threads();
        let total = ("params", &self.total);
        let mut list = vec![
            (arrays.bind(gpu, &tetrahedra_rotations::SOURCE, &[total])?, count),
            (arrays.bind(gpu, &tetrahedra_strains::SOURCE, &[total, ("z", u), ("scalars", &self.running)])?, count),
        ];
        list.extend(self.mean_rotations(gpu, arrays)?);
        Ok(list)
    }

    /// Mean rotations of domains and nodes by the displacement gradients of the tetrahedra.
    fn mean_rotations(&self, gpu: &Gpu, arrays: &Arrays) -> Result<Vec<Dispatch>> {
        let [nodes, _, domains] = self.threads();
        let mut list = vec![];
        let lists =
            [("first_of_domain", "of_domain", "domain_rotation"), ("first_of_node", "of_node", "node_rotation")];
        for (((first, members, rotation), params), threads) in lists.iter().zip(&self.means).zip([domains, nodes]) {
            let named = [("first", first), ("members", members), ("mean_rotation", rotation)];
            let own: Vec<_> = named.iter().filter_map(|(name, own)| Some((*name, arrays.get(own)?))).collect();
            // plain elements of small strains have no domains
            if own.len() == named.len() {
                let mut more: Vec<_> = own.iter().map(|(name, buffer)| (*name, buffer)).collect();
                more.push(("params", params));
                list.push((arrays.bind(gpu, &tetrahedra_means::SOURCE, &more)?, threads));
            }
        }
        Ok(list)
    }

    /// Forces of the tetrahedra at their corners; `more` overrides arrays of the body.
    fn corner_forces(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Vec<Dispatch>> {
        let [nodes, count, domains] = self.threads();
        let passes: &[(&Source, usize)] = if self.smoothed {
            &[
                (&tetrahedra_strains::SOURCE, count),
                (&tetrahedra_domains::SOURCE, domains),
                (&tetrahedra_volumes::SOURCE, nodes),
                (&tetrahedra_pressures::SOURCE, nodes),
                (&tetrahedra_smoothed::SOURCE, count),
            ]
        } else {
            &[(&tetrahedra_plain::SOURCE, count)]
        };
        passes.iter().map(|(source, threads)| Ok((arrays.bind(gpu, source, more)?, *threads))).collect()
    }

    /// Forces of a hyperelastic law at displacements, its linearisation, and the rotations of the nodes.
    fn law_at(&self, gpu: &Gpu, arrays: &Arrays, u: &Buffer) -> Result<Vec<Dispatch>> {
        let [_, count, domains] = self.threads();
        let patches = Self::patch_count(&self.params, self.smoothed);
        let of_patches: Vec<_> = self.patches.iter().map(|(name, buffer)| (*name, buffer)).collect();
        let running = [("params", &self.total_of_patches), ("scalars", &self.running)];
        let over_patches = [&of_patches[..], &running].concat();
        let pressure = arrays.get("pressure").unwrap_or_else(|| unreachable!("a hyperelastic body has it"));
        let averaged = [&over_patches[..], &[("nodal_strain", &pressure)]].concat();
        let total = ("params", &self.total);
        let mut list = vec![(arrays.bind(gpu, &tetrahedra_deformations::SOURCE, &[total, ("u", u)])?, count)];
        list.extend(self.mean_rotations(gpu, arrays)?);
        list.extend([
            (arrays.bind(gpu, &tetrahedra_volumes::SOURCE, &over_patches)?, patches),
            (arrays.bind(gpu, &tetrahedra_pressed::SOURCE, &over_patches)?, count),
            (arrays.bind(gpu, &tetrahedra_volumes::SOURCE, &averaged)?, patches),
            (arrays.bind(gpu, &tetrahedra_laws::SOURCE, &[total])?, domains),
            (arrays.bind(gpu, &tetrahedra_large::SOURCE, &over_patches)?, count),
        ]);
        Ok(list)
    }

    /// Forces of the linearisation of a hyperelastic law.
    fn changes_of_law(
        &self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        let [_, count, domains] = self.threads();
        let patches = Self::patch_count(params, self.smoothed);
        let block = self.over_patches(made, params);
        let cofactor = arrays.get("cofactor").unwrap_or_else(|| unreachable!("a hyperelastic body has it"));
        let of_patches: Vec<_> = self.patches.iter().map(|(name, buffer)| (*name, buffer)).collect();
        let over_patches = [&of_patches[..], &[("params", &block)]].concat();
        // the stiffness of the volume stands where the bulk modulus does in `gradients`
        let stiff = [&over_patches[..], &[("gradients", &cofactor)]].concat();
        let gpu = made.gpu;
        Ok(vec![
            (arrays.bind(gpu, &tetrahedra_changes::SOURCE, &[("params", main)])?, count),
            (arrays.bind(gpu, &tetrahedra_frames::SOURCE, &[("params", main)])?, domains),
            (arrays.bind(gpu, &tetrahedra_volumes::SOURCE, &over_patches)?, patches),
            (arrays.bind(gpu, &tetrahedra_pressures::SOURCE, &stiff)?, patches),
            (arrays.bind(gpu, &tetrahedra_large::SOURCE, &over_patches)?, count),
        ])
    }

    /// Numbers of nodes, tetrahedra and domains.
    fn threads(&self) -> [usize; 3] {
        [self.params.node_count, self.params.tetrahedron_count, self.params.domain_count].map(|n| n as usize)
    }
}

/// Writes the values of some owners, `each` of them for one, in one piece per run of consecutive owners.
fn write<T: bytemuck::NoUninit>(gpu: &Gpu, buffer: &Buffer, owners: &[u32], each: usize, value: impl Fn(usize) -> T) {
    for run in owners.chunk_by(|a, b| a + 1 == *b) {
        let values: Vec<T> = (run[0] as usize * each..(run[run.len() - 1] as usize + 1) * each).map(&value).collect();
        gpu.write(buffer, (run[0] as usize * each * size_of::<T>()) as u64, &values);
    }
}

impl Recorded for Tetrahedra {
    fn shared(&self) -> Arrays {
        self.shared.clone()
    }

    fn elements(&self) -> Option<Buffer> {
        None
    }

    fn mean_velocities(&self) -> Option<Buffer> {
        None
    }

    fn forces(&self, gpu: &Gpu, arrays: &Arrays, main: &Buffer, at: Option<&Buffer>) -> Result<Vec<Dispatch>> {
        assert!(at.is_none(), "scenes of tetrahedra with explicit steps are refused");
        let u = arrays.get("u").unwrap_or_else(|| unreachable!("every body has it"));
        if self.hyperelastic {
            let mut list = self.law_at(gpu, arrays, &u)?;
            list.push((arrays.bind(gpu, &tetrahedra_forces::SOURCE, &[("params", main)])?, self.threads()[0]));
            return Ok(list);
        }
        let mut list = if self.corotational { self.rotations(gpu, arrays, &u)? } else { vec![] };
        let of_all = [("params", &self.total), ("z", &u), ("scalars", &self.running)];
        list.extend(self.corner_forces(gpu, arrays, &of_all)?);
        list.push((arrays.bind(gpu, &tetrahedra_forces::SOURCE, &[("params", main)])?, self.threads()[0]));
        Ok(list)
    }

    fn forces_of_law(
        &self,
        made: &mut Maker,
        arrays: &Arrays,
        at: &Buffer,
        to: &Buffer,
    ) -> Result<Option<Vec<Dispatch>>> {
        if !self.hyperelastic {
            return Ok(None);
        }
        let gpu = made.gpu;
        let mut list = self.law_at(gpu, arrays, at)?;
        let sums = [("params", &self.total), ("f", to)];
        list.push((arrays.bind(gpu, &tetrahedra_forces::SOURCE, &sums)?, self.threads()[0]));
        // the passes leave a linearisation behind: that of the start again
        let u = arrays.get("u").unwrap_or_else(|| unreachable!("every body has it"));
        list.extend(self.law_at(gpu, arrays, &u)?);
        Ok(Some(list))
    }

    fn points(&self, gpu: &Gpu, main: &Buffer, u: &Buffer, to: &Buffer) -> Result<Option<Dispatch>> {
        let list = [("params", main), ("u", u), ("point_u", to)];
        Ok(Some((self.shared.bind(gpu, &tetrahedra_centres::SOURCE, &list)?, self.threads()[1])))
    }

    fn split(&self) -> Option<(Buffer, Vec<u32>)> {
        self.corners.clone()
    }

    /// Writes what has changed, and where tetrahedra have got other nodes all of the lists of nodes and domains; the corners are the table of split nodes.
    fn take(&self, gpu: &Gpu, removal: &Removal) {
        if let (Some(multigrid), false) = (&self.multigrid, removal.copies.is_empty()) {
            multigrid.transfer.borrow_mut().copy(&removal.copies);
            multigrid.write(gpu);
        }
        let Some((operator, changes)) = &removal.operator else { return };
        let own = |name: &str| self.shared.get(name).unwrap_or_else(|| unreachable!("the body has {name}"));
        write(gpu, &own("gradients"), &changes.tetrahedra, 3, |at| operator.gradients[at].map(|c| c as f32));
        write(gpu, &own("rest_block"), &changes.nodes, 2, |at| operator.rest_block[at].map(|c| c as f32));
        if changes.lists {
            gpu.write(&own("first_of_node"), 0, &operator.first_of_node);
            gpu.write(&own("of_node"), 0, &operator.of_node);
        }
        if self.smoothed {
            write(gpu, &own("per_volume"), &changes.nodes, 1, |at| operator.per_volume[at] as f32);
            write(gpu, &own("shear"), &changes.domains, 1, |at| operator.shear[at].map(|c| c as f32));
            write(gpu, &own("domains"), &changes.tetrahedra, 6, |at| operator.domains[at]);
            if changes.lists {
                gpu.write(&own("first_of_domain"), 0, &operator.first_of_domain);
                gpu.write(&own("of_domain"), 0, &operator.of_domain);
            }
        }
    }

    fn blocks(&self, gpu: &Gpu, arrays: &Arrays, more: &[(&'static str, &Buffer)]) -> Result<Bound> {
        arrays.bind(gpu, &tetrahedra_blocks::SOURCE, more)
    }

    fn refresh(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        sums: &Arrays,
        _: &Params<f32>,
        _: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        self.multigrid.as_mut().map_or(Ok(vec![]), |multigrid| multigrid.refresh(made, arrays, sums))
    }

    fn precondition(&self, made: &mut Maker, params: &Params<f32>) -> Result<Option<Vec<Dispatch>>> {
        self.multigrid.as_ref().map(|multigrid| multigrid.precondition(made, params)).transpose()
    }

    fn product(
        &mut self,
        made: &mut Maker,
        arrays: &Arrays,
        params: &Params<f32>,
        main: &Buffer,
    ) -> Result<Vec<Dispatch>> {
        let mut list = match self.hyperelastic {
            true => self.changes_of_law(made, arrays, params, main)?,
            false => self.corner_forces(made.gpu, arrays, &[("params", main)])?,
        };
        let kernel = arrays.bind(made.gpu, &tetrahedra_product::SOURCE, &[("params", main)])?;
        list.push((kernel, params.product_groups as usize * GROUP as usize));
        Ok(list)
    }
}
