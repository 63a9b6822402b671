//! The twin of each kernel on a [`Body`]: what the kernel's read-write arrays must hold afterwards, by name.
//!
//! Partial sums appear as their sum over the groups of a right-hand side.

use super::body::{BESIDE, Body, NO_HIT};
use super::bounded::{Bounded, uncertain_comparisons};
use cutis::kernels;
use cutis::kernels::advance::{Request, Scalars};
use cutis::kernels::cut::Hit;
use cutis::kernels::linearised::{HYPERELASTIC, Rows};
use cutis::kernels::product::{Frames, LANES, cell_groups};
use cutis::kernels::{PART, Params};
use cutis::math::{Real, V3, V4, rotation_matrix};

/// Name and elements of each read-write array.
pub type Outputs<R> = Vec<(&'static str, Vec<R>)>;

fn flat<R: Real>(vectors: &[V4<R>]) -> Vec<R> {
    vectors.concat()
}

/// Right-hand sides that a dispatch works on, with their range in `[rhs][node]` arrays.
fn running(b: &Body) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
    let (n, scalars) = (b.nodes(), b.v4::<f32>("scalars"));
    (b.first_rhs..b.rhs_count)
        .filter(move |rhs| scalars[rhs * 2][3] == 0.0)
        .map(move |rhs| (rhs, rhs * n..(rhs + 1) * n))
}

/// Sums of a `[rhs][group]` array over its groups.
pub fn rhs_sums<R: Real>(parts: &[R], groups: usize) -> Vec<R> {
    parts.chunks_exact(groups).map(|rhs| rhs.iter().copied().sum()).collect()
}

/// Before the kernel: noise in right-hand sides that it leaves alone, zero where it writes.
fn start_sums<R: Real>(b: &Body, name: &str, groups: usize) -> Vec<R> {
    let mut sums = rhs_sums(&b.scalars::<R>(name), groups);
    sums[b.first_rhs..].fill(R::zero());
    sums
}

pub fn accelerate<R: Real>(b: &Body) -> Outputs<R> {
    let mut x = b.v4::<R>("x");
    kernels::accelerate::accelerate(&b.params(), &b.v4("dofs"), &b.v4("b"), &mut x);
    vec![("x", flat(&x))]
}

pub fn ahead<R: Real>(b: &Body) -> Outputs<R> {
    let mut y = b.v4::<R>("y");
    kernels::ahead::ahead(&b.params(), &b.v4("u"), &b.v4("v"), &mut y);
    vec![("y", flat(&y))]
}

pub fn advance<R: Real>(b: &Body) -> Outputs<R> {
    let product = rhs_sums(&b.scalars::<R>("partial_product"), b.product_groups());
    let gamma = rhs_sums(&b.scalars::<R>("partial_gamma"), b.column_groups());
    let residual = rhs_sums(&b.scalars::<R>("partial_residual"), b.node_groups());
    let load = b.scalars::<R>("partial_load").into_iter().sum();
    let mut scalars = b.scalars::<R>("scalars");
    let requests = b.v4::<R>("requests");
    for (rhs, _) in running(b) {
        let at = &mut scalars[rhs * 8..rhs * 8 + 8];
        let [tolerance_squared, reference_squared, floor_squared, use_load] = requests[rhs];
        let request = Request { tolerance_squared, reference_squared, floor_squared, use_load };
        let mut k = read_scalars(at);
        kernels::advance::advance(&request, load, product[rhs], gamma[rhs], residual[rhs], &mut k);
        at.copy_from_slice(&write_scalars(&k));
    }
    vec![("scalars", scalars)]
}

fn read_scalars<R: Real>(k: &[R]) -> Scalars<R> {
    Scalars {
        alpha: k[0],
        beta: k[1],
        gamma: k[2],
        done: k[3],
        target_squared: k[4],
        residual_squared: k[5],
        iterations: k[6],
        state: k[7],
    }
}

fn write_scalars<R: Real>(k: &Scalars<R>) -> [R; 8] {
    [k.alpha, k.beta, k.gamma, k.done, k.target_squared, k.residual_squared, k.iterations, k.state]
}

pub fn rest_springs<R: Real>(b: &Body) -> Outputs<R> {
    let mut right = b.v4::<R>("b");
    kernels::rest_springs::rest_springs(
        &b.ids(),
        &b.scalars("spring_stiffness"),
        &b.v4("dofs"),
        &b.v4("u"),
        &mut right,
    );
    vec![("b", flat(&right))]
}

pub fn trial_point<R: Real>(b: &Body) -> Outputs<R> {
    let [u, dx, x, residual_force] = ["u", "dx", "x", "residual_force"].map(|name| b.v4::<R>(name));
    let (mut dx_next, mut displacement) = (b.v4("dx_next"), b.v4("displacement"));
    let predicted_decrease =
        kernels::trial_point::trial_point(&b.params(), &u, &dx, &x, &residual_force, &mut dx_next, &mut displacement);
    vec![
        ("dx_next", flat(&dx_next)),
        ("displacement", flat(&displacement)),
        ("predicted_decrease", vec![predicted_decrease]),
    ]
}

pub fn defect<R: Real>(b: &Body) -> Outputs<R> {
    let [w, x, dofs, f, f_end] = ["w", "x", "dofs", "f", "f_end"].map(|name| b.v4::<R>(name));
    let mut right = b.v4::<R>("b");
    kernels::defect::defect(&b.params(), &w, &x, &dofs, &f, &f_end, &mut right);
    vec![("b", flat(&right))]
}

pub fn blocks<R: Real>(b: &Body) -> Outputs<R> {
    let mut block = b.v4::<R>("block");
    let (layer_of, rotation) = (&b.grid.layer_of, b.v4("rotation"));
    let (stiffness, dofs) = (b.stiffness(), b.v4("dofs"));
    kernels::blocks::blocks(&b.params(), &stiffness, layer_of, &rotation, &dofs, &b.split(), &mut block);
    vec![("block", flat(&block))]
}

pub fn bounds<R: Real>(b: &Body) -> Outputs<R> {
    let mut tile_bounds = b.v4::<R>("tile_bounds");
    kernels::bounds::bounds(&b.params(), &b.v4("u"), &mut tile_bounds);
    vec![("tile_bounds", flat(&tile_bounds))]
}

pub fn centres<R: Real>(b: &Body) -> Outputs<R> {
    let mut point_u = b.v4::<R>("point_u");
    kernels::centres::centres(&b.params(), &b.split(), &b.v4("u"), &mut point_u);
    vec![("point_u", flat(&point_u))]
}

pub fn coarsen<R: Real>(b: &Body) -> Outputs<R> {
    let mut coarse = vec![[R::zero(); 4]; b.coarse_frames()];
    kernels::coarsen::coarsen(&b.params(), &b.v4("rotation"), &mut coarse);
    vec![("coarse_rotation", flat(&coarse))]
}

pub fn collect<R: Real>(b: &Body) -> Outputs<R> {
    let mut f = b.v4::<R>("f");
    kernels::collect::collect(&b.params(), &b.split(), &b.scalars("corner_force"), &mut f);
    vec![("f", flat(&f))]
}

pub fn collect_product<R: Real>(b: &Body) -> Outputs<R> {
    let (mut w, mut sums) = (b.v4::<R>("w"), start_sums(b, "partial_product", b.product_groups()));
    let (force, z, dofs) = (b.scalars::<R>("corner_force"), b.v4::<R>("z"), b.v4("dofs"));
    let cells = b.grid.cell_count() * 24;
    for (rhs, nodes) in running(b) {
        let own = &force[rhs * cells..(rhs + 1) * cells];
        let dot = kernels::collect_product::collect_product(&b.params(), own, &dofs, &z[nodes.clone()], &mut w[nodes]);
        sums[rhs] += dot;
    }
    vec![("w", flat(&w)), ("partial_product", sums)]
}

pub fn hyperelastic_forces<R: Real>(b: &Body) -> Outputs<R> {
    let (mut force, mut energy) = (b.scalars("corner_force"), b.scalars("energy"));
    let (shape, material, layer_of) = (b.v4::<R>("shape"), b.v4("material"), &b.grid.layer_of);
    let (params, mut rotation) = (b.params(), b.v4("rotation"));
    kernels::hyperelastic_forces::hyperelastic_forces(
        &params,
        &shape,
        &material,
        b.v4("fibres").as_chunks::<2>().0,
        &b.v4("pre_strain"),
        layer_of,
        &b.scalars("scale"),
        &b.split(),
        &mut rotation,
        &b.v4("displacement"),
        &mut force,
        &mut energy,
    );
    vec![("corner_force", force), ("energy", energy), ("rotation", flat(&rotation))]
}

pub fn hyperelastic_tangent<R: Real>(b: &Body) -> Outputs<R> {
    let (mut force, z) = (b.scalars("corner_force"), b.v4::<R>("z"));
    let (shape, material, layer_of, displacement) =
        (b.v4::<R>("shape"), b.v4("material"), &b.grid.layer_of, b.v4("displacement"));
    let cells = b.grid.cell_count() * 24;
    for (rhs, nodes) in running(b) {
        let own = &mut force[rhs * cells..(rhs + 1) * cells];
        kernels::hyperelastic_tangent::hyperelastic_tangent(
            &b.params(),
            &shape,
            &material,
            b.v4("fibres").as_chunks::<2>().0,
            &b.v4("pre_strain"),
            layer_of,
            &b.scalars("scale"),
            &displacement,
            &z[nodes],
            own,
        );
    }
    vec![("corner_force", force)]
}

pub fn residual<R: Real>(b: &Body) -> Outputs<R> {
    let [f, right, w, dx, dofs] = ["f", "b", "w", "dx", "dofs"].map(|name| b.v4::<R>(name));
    let mut residual_force = b.v4("residual_force");
    let force = b.scalars("corner_force");
    let potential_and_residual =
        kernels::residual::residual(&b.params(), &force, &f, &right, &w, &dx, &dofs, &mut residual_force);
    vec![("residual_force", flat(&residual_force)), ("potential_and_residual", potential_and_residual.to_vec())]
}

/// Exact, or useless: the bound of every error is zero.
pub fn probe<R: Real>(b: &Body) -> Outputs<R> {
    let (cases, mut errors) = (b.v4::<f32>("cases"), b.scalars::<f32>("errors"));
    kernels::probe::probe(&cases, &mut errors);
    vec![("errors", errors.iter().map(|e| R::of(f64::from(*e))).collect())]
}

pub fn converge<R: Real>(b: &Body) -> Outputs<R> {
    let residual = rhs_sums(&b.scalars::<R>("partial_residual"), b.node_groups());
    let mut scalars = b.scalars::<R>("scalars");
    for (rhs, _) in running(b) {
        let at = &mut scalars[rhs * 8..rhs * 8 + 8];
        let mut k = read_scalars(at);
        kernels::converge::converge(residual[rhs], &mut k);
        at.copy_from_slice(&write_scalars(&k));
    }
    vec![("scalars", scalars)]
}

pub fn cut<R: Real>(b: &Body) -> Outputs<R> {
    let segments = b.pairs("ends");
    let found = hits_of(b, &segments);
    let whole = |k: u32| R::of(f64::from(k));
    let mut hits: Vec<R> = found.iter().flat_map(|hit| [whole(hit.segment), hit.at]).collect();
    hits.resize(2 * segments.len(), whole(NO_HIT));
    let count = [found.len() as u32, 0, 0, 0].map(whole);
    vec![("hits", hits), ("hit_count", count.to_vec())]
}

fn hits_of<R: Real>(b: &Body, segments: &[[u32; 2]]) -> Vec<Hit<R>> {
    let [rest, point_u, point_before, quads] = ["rest", "point_u", "point_before", "quads"].map(|name| b.v4::<R>(name));
    kernels::cut::cut(segments, &rest, &point_u, &point_before, &quads)
}

/// Segments of a body whose hits rounding decides.
pub fn uncertain_segments(b: &Body) -> Vec<usize> {
    let segments = b.pairs("ends");
    let [rest, point_u, point_before, quads] =
        ["rest", "point_u", "point_before", "quads"].map(|name| b.v4::<Bounded>(name));
    let uncertain = |k: &usize| {
        uncertain_comparisons();
        kernels::cut::cut(&segments[*k..k + 1], &rest, &point_u, &point_before, &quads);
        uncertain_comparisons() > 0
    };
    (0..segments.len()).filter(uncertain).collect()
}

pub fn factor<R: Real>(b: &Body) -> Outputs<R> {
    let mut block = b.v4::<R>("block");
    kernels::factor::factor(&b.params(), &mut block);
    each_part(&b.params(), &mut block, |part| by_node::<R, 16>(part.as_flattened_mut()));
    vec![("block", flat(&block))]
}

pub fn forces<R: Real>(b: &Body) -> Outputs<R> {
    let mut f = b.v4::<R>("f");
    let (shape, pre_strain, stiffness) = (b.v4("shape"), b.v4("pre_strain"), b.stiffness());
    let (u, rotation) = (b.v4("u"), b.v4("rotation"));
    let (layer_of, split) = (&b.grid.layer_of, b.split());
    kernels::forces::forces(&b.params(), &shape, &pre_strain, &stiffness, layer_of, &split, &u, &rotation, &mut f);
    vec![("f", flat(&f))]
}

pub fn gather<R: Real>(b: &Body) -> Outputs<R> {
    let mut picked = b.v4::<R>("picked");
    kernels::gather::gather(Body::FIRST, &b.ids(), &b.v4("source"), &mut picked);
    vec![("picked", flat(&picked))]
}

pub fn integrate<R: Real>(b: &Body) -> Outputs<R> {
    let (mut x, mut u, mut v) = (b.v4::<R>("x"), b.v4("u"), b.v4("v"));
    kernels::integrate::integrate(&b.params(), &mut x, &mut u, &mut v);
    vec![("x", flat(&x)), ("u", flat(&u)), ("v", flat(&v))]
}

pub fn momentum<R: Real>(b: &Body) -> Outputs<R> {
    let (shape, rotation, dofs) = (b.v4("shape"), b.v4("rotation"), b.v4("dofs"));
    let mut mean_v = b.v4::<R>("mean_v");
    let (layer_of, split, v) = (&b.grid.layer_of, b.split(), b.v4("v"));
    kernels::momentum::momentum(&b.params(), &shape, layer_of, &split, &rotation, &dofs, &v, &mut mean_v);
    vec![("mean_v", flat(&mean_v))]
}

/// Calls a function with the values at the nodes of each part of each level.
fn each_part<R: Real>(params: &Params<R>, values: &mut [V4<R>], change: impl Fn(&mut [V4<R>])) {
    let each = values.len() / params.node_count as usize;
    for (first, set) in params.column_sets() {
        let levels = values[each * first..][..each * set.node_count as usize].chunks_mut(each * set.columns());
        levels.flat_map(|level| level.chunks_mut(each * PART)).for_each(&change);
    }
}

/// Re-arranges numbers that a twin leaves by component: `[number][node]` into `[node][number]`, `COUNT` numbers a node.
fn by_node<R: Real, const COUNT: usize>(part: &mut [R]) {
    let (width, from) = (part.len() / COUNT, part.to_vec());
    for (i, to) in part.iter_mut().enumerate() {
        *to = from[i % COUNT * width + i / COUNT];
    }
}

/// Factors of the columns, as the twins have them.
fn factors<R: Real>(b: &Body) -> Vec<V4<R>> {
    let mut block = b.v4("block");
    each_part(&b.params::<R>(), &mut block, kernels::columns::by_component);
    block
}

pub fn precondition<R: Real>(b: &Body) -> Outputs<R> {
    let (block, r, mut z) = (factors::<R>(b), b.v4("r"), b.v4("z"));
    let mut gamma = start_sums(b, "partial_gamma", b.column_groups());
    for (rhs, at) in running(b) {
        gamma[rhs] = kernels::precondition::precondition(&b.params(), &block, &r[at.clone()], &mut z[at]);
    }
    vec![("z", flat(&z)), ("partial_gamma", gamma)]
}

pub fn product<R: Real>(b: &Body) -> Outputs<R> {
    let (modes, rotation) = (b.modes(), b.v4("rotation"));
    let (dofs, z, mut w) = (b.v4::<R>("dofs"), b.v4("z"), b.v4("w"));
    let (p, layer_of, split) = (b.params(), &b.grid.layer_of, b.split());
    let frames = Frames::new(&p, &rotation, &split);
    let mut scratch = vec![[[[R::zero(); LANES]; 3]; 8]; cell_groups(&p)];
    let mut dots = start_sums(b, "partial_product", b.product_groups());
    for (rhs, at) in running(b) {
        let (z, w) = (&z[at.clone()], &mut w[at]);
        dots[rhs] = kernels::product::product(&p, &modes, layer_of, &frames, &dofs, z, w, &mut scratch);
    }
    vec![("w", flat(&w)), ("partial_product", dots)]
}

pub fn prolongation<R: Real>(b: &Body) -> Outputs<R> {
    let (coarse, mut z, count) = (b.v4::<R>("coarse_z"), b.v4("z"), b.coarse_nodes());
    for (rhs, at) in running(b) {
        let coarse = &coarse[rhs * count..(rhs + 1) * count];
        kernels::prolongation::prolongation(&b.params(), &b.v4("dofs"), &b.split(), coarse, &mut z[at]);
    }
    vec![("z", flat(&z))]
}

pub fn relax<R: Real>(b: &Body) -> Outputs<R> {
    let (block, r) = (factors::<R>(b), b.v4("r"));
    let [mut w, mut d, mut z] = ["w", "d", "z"].map(|name| b.v4(name));
    let mut gamma = start_sums(b, "partial_gamma", b.column_groups());
    for (rhs, at) in running(b) {
        let at = || at.clone();
        gamma[rhs] = kernels::relax::relax(&b.params(), &block, &r[at()], &mut w[at()], &mut d[at()], &mut z[at()]);
        each_part(&b.params(), &mut w[at()], |part| {
            by_node::<R, 4>(part.as_flattened_mut());
            part.iter_mut().for_each(|node| node[3] = R::zero());
        });
    }
    vec![("w", flat(&w)), ("d", flat(&d)), ("z", flat(&z)), ("partial_gamma", gamma)]
}

pub fn restriction<R: Real>(b: &Body) -> Outputs<R> {
    let (dofs, r, w, mut coarse) = (b.v4::<R>("coarse_dofs"), b.v4("r"), b.v4("w"), b.v4("coarse_r"));
    let count = b.coarse_nodes();
    for (rhs, at) in running(b) {
        let coarse = &mut coarse[rhs * count..(rhs + 1) * count];
        kernels::restriction::restriction(&b.params(), &dofs, &b.split(), &r[at.clone()], &w[at], coarse);
    }
    vec![("coarse_r", flat(&coarse))]
}

pub fn duplicate<R: Real>(b: &Body) -> Outputs<R> {
    let mut values = b.v4::<R>("values");
    let rhs_count = (b.rhs_count - b.first_rhs) * b.nodes();
    kernels::duplicate::duplicate(b.nodes(), &b.copies(), &mut values[..rhs_count]);
    vec![("values", flat(&values))]
}

/// The shader is given 3×3 blocks, the twin the same matrices in mirror blocks: those of `stiffness` have no mirrors, so the twin here
/// is the gather that the shader does, over the split cells alone.
pub fn split_product<R: Real>(b: &Body) -> Outputs<R> {
    let (p, split): (Params<R>, _) = (b.params(), b.split());
    let (stiffness, rotation, dofs) = (b.stiffness::<R>(), b.v4::<R>("rotation"), b.v4::<R>("dofs"));
    let (z, mut w) = (b.v4::<R>("z"), b.v4("w"));
    let mut dots = start_sums(b, "partial_product", b.product_groups());
    for (rhs, at) in running(b) {
        let (z, w) = (&z[at.clone()], &mut w[at]);
        for i in p.touched(&split).iter().map(|n| *n as usize) {
            let own = V3::from4(z[i]);
            let mut sum = V3::zero();
            for cell in b.parts.cells_of(i).into_iter().filter(|cell| p.is_split(&split, *cell)) {
                let corners = p.corner_nodes(&split, cell);
                let a = corners.iter().position(|n| *n == i).expect("a cell of the node");
                let first = b.grid.layer_of[p.cell_at(cell)[2]] as usize * 64 + a * 8;
                let r = rotation_matrix(rotation[cell]);
                let hyperelastic = p.corotational >= HYPERELASTIC;
                let mut local = V3::zero();
                for (k, node) in corners.into_iter().enumerate() {
                    let moved = r.transpose() * (V3::from4(z[node]) - own);
                    local += stiffness[first + k] * moved;
                    if hyperelastic {
                        local += Rows::of(&p, &rotation, cell).between(a, k) * moved;
                    }
                }
                sum += r * local;
            }
            let mut out = sum * p.stiffness_factor;
            let of_grid = i < p.grid_nodes();
            if !of_grid {
                out += own * (p.inertia * dofs[i][3]);
            }
            out = out.times(V3::from4(dofs[i]));
            dots[rhs] += own.dot(out);
            w[i] = if of_grid { (out + V3::from4(w[i])).pad(R::zero()) } else { out.pad(R::zero()) };
        }
    }
    vec![("w", flat(&w)), ("partial_product", dots)]
}

pub fn rhs<R: Real>(b: &Body) -> Outputs<R> {
    let mut right = b.v4::<R>("b");
    let (f, v, dofs, load) = (b.v4("f"), b.v4("v"), b.v4("dofs"), b.v4("load"));
    let sum = kernels::rhs::rhs(&b.params(), &f, &v, &dofs, &load, &mut right);
    vec![("b", flat(&right)), ("partial_load", vec![sum])]
}

pub fn rotations<R: Real>(b: &Body) -> Outputs<R> {
    let mut rotation = b.v4::<R>("rotation");
    let (shape, u) = (b.v4("shape"), b.v4("u"));
    kernels::rotations::rotations(&b.params(), &shape, &b.grid.layer_of, &b.split(), &u, &mut rotation);
    vec![("rotation", flat(&rotation))]
}

pub fn prescribe<R: Real>(b: &Body) -> Outputs<R> {
    let mut x = b.v4::<R>("x");
    kernels::prescribe::prescribe(&b.ids(), &b.v4("values"), &b.v4("dofs"), &b.v4("u"), &mut x);
    vec![("x", flat(&x))]
}

pub fn scatter<R: Real>(b: &Body) -> Outputs<R> {
    let mut destination = b.v4::<R>("destination");
    kernels::scatter::scatter(true, &b.ids(), &b.v4("values"), &mut destination);
    vec![("destination", flat(&destination))]
}

pub fn springs<R: Real>(b: &Body) -> Outputs<R> {
    let (mut f, mut tangent) = (b.v4::<R>("f"), b.v4("tangent"));
    let (rest, u, law) = (b.v4("rest"), b.v4("u"), b.v4("law"));
    let s = &b.springs;
    kernels::springs::springs(&b.params(), &rest, &u, &s.first, &s.half, &law, &mut f, &mut tangent);
    vec![("f", flat(&f)), ("tangent", flat(&tangent))]
}

pub fn springs_blocks<R: Real>(b: &Body) -> Outputs<R> {
    let mut block = b.v4::<R>("block");
    let (tangent, dofs, s) = (b.v4("tangent"), b.v4("dofs"), &b.springs);
    kernels::springs_blocks::springs_blocks(&b.params(), &s.first, &s.half, &tangent, &dofs, &mut block);
    vec![("block", flat(&block))]
}

pub fn springs_product<R: Real>(b: &Body) -> Outputs<R> {
    let (tangent, dofs, s) = (b.v4("tangent"), b.v4("dofs"), &b.springs);
    let (z, mut w) = (b.v4::<R>("z"), b.v4("w"));
    let mut dots = start_sums(b, "partial_product", b.product_groups());
    for (rhs, at) in running(b) {
        dots[rhs] = kernels::springs_product::springs_product(
            &b.params(),
            &s.first,
            &s.half,
            &tangent,
            &dofs,
            &z[at.clone()],
            &mut w[at],
        );
    }
    vec![("w", flat(&w)), ("partial_product", dots)]
}

/// Right-hand sides that a dispatch works on, with their numbers in `[rhs][count]` arrays.
fn running_of(b: &Body, count: usize) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
    running(b).map(move |(rhs, _)| (rhs, rhs * count..(rhs + 1) * count))
}

pub fn auxiliary_rotations<R: Real>(b: &Body) -> Outputs<R> {
    let (mut rotation, (first, nodes)) = (b.v4::<R>("rotation"), b.in_cells());
    let (scale, of_nodes) = (b.scalars("scale"), b.v4("node_rotation"));
    let cells = b.params::<f64>().cell_count as usize;
    kernels::auxiliary_rotations::auxiliary_rotations(&first, &nodes, &scale[..cells], &of_nodes, &mut rotation);
    vec![("rotation", flat(&rotation))]
}

pub fn auxiliary_restriction<R: Real>(b: &Body) -> Outputs<R> {
    let (mut out, (first, nodes)) = (b.v4::<R>("auxiliary_r"), b.weighted());
    let (weight, dofs, r) = (b.scalars("weight_around"), b.v4("auxiliary_dofs"), b.v4("r"));
    let beside: Vec<_> = running_of(b, b.nodes() + BESIDE).map(|(_, at)| at).collect();
    for ((_, at), from) in running(b).zip(beside) {
        let out = &mut out[at];
        kernels::auxiliary_restriction::auxiliary_restriction(&first, &nodes, &weight, &dofs, &r[from], out);
    }
    vec![("auxiliary_r", flat(&out))]
}

pub fn auxiliary_correction<R: Real>(b: &Body) -> Outputs<R> {
    let ([mut z, mut w], (first, nodes)) = (["z", "w"].map(|name| b.v4::<R>(name)), b.weighted());
    let (weight, dofs, from_grid) = (b.scalars("weight"), b.v4("dofs"), b.v4("auxiliary_z"));
    let beside: Vec<_> = running_of(b, b.nodes() + BESIDE).map(|(_, at)| at).collect();
    for ((_, at), from) in running(b).zip(beside) {
        let (z, w) = (&mut z[at.clone()], &mut w[at]);
        kernels::auxiliary_correction::auxiliary_correction(&first, &nodes, &weight, &dofs, &from_grid[from], z, w);
    }
    vec![("z", flat(&z)), ("w", flat(&w))]
}

pub fn tetrahedra_centres<R: Real>(b: &Body) -> Outputs<R> {
    let mut point_u = b.v4("point_u");
    kernels::tetrahedra_centres::tetrahedra_centres(&b.tetrahedra.corners, &b.v4("u"), &mut point_u);
    vec![("point_u", flat(&point_u))]
}

pub fn tetrahedra_rotations<R: Real>(b: &Body) -> Outputs<R> {
    let mut q = b.v4::<R>("element_rotation");
    let corners = &b.tetrahedra.corners;
    kernels::tetrahedra_rotations::tetrahedra_rotations(corners, &b.v4("gradients"), &b.v4("u"), &mut q);
    vec![("element_rotation", flat(&q))]
}

pub fn tetrahedra_means<R: Real>(b: &Body) -> Outputs<R> {
    let mut q = b.v4::<R>("mean_rotation");
    let (gradients, strain, of) = (b.v4("gradients"), b.v4("strain"), &b.tetrahedra);
    kernels::tetrahedra_means::tetrahedra_means(&gradients, &of.first_of_node, &of.of_node, &strain, &mut q);
    vec![("mean_rotation", flat(&q))]
}

pub fn tetrahedra_strains<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, rotation, z) = (b.v4("gradients"), b.v4("element_rotation"), b.v4::<R>("z"));
    let (mut strain, corners) = (b.v4("strain"), &b.tetrahedra.corners);
    for ((_, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        let (z, strain) = (&z[nodes], &mut strain[at]);
        kernels::tetrahedra_strains::tetrahedra_strains(&b.params(), corners, &gradients, &rotation, z, strain);
    }
    vec![("strain", flat(&strain))]
}

pub fn tetrahedra_plain<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, rotation, z) = (b.v4("gradients"), b.v4("element_rotation"), b.v4::<R>("z"));
    let (mut force, corners) = (b.v4("tetrahedron_force"), &b.tetrahedra.corners);
    for ((_, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        let (z, force) = (&z[nodes], &mut force[at]);
        kernels::tetrahedra_plain::tetrahedra_plain(&b.params(), corners, &gradients, &rotation, z, force);
    }
    vec![("tetrahedron_force", flat(&force))]
}

pub fn tetrahedra_domains<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, rotation, shear, of) = (b.v4("gradients"), b.v4("domain_rotation"), b.v2("shear"), &b.tetrahedra);
    let (strain, mut stress) = (b.v4::<R>("strain"), b.v4("domain_stress"));
    for ((_, at), (_, to)) in running_of(b, gradients.len()).zip(running_of(b, 3 * shear.len())) {
        kernels::tetrahedra_domains::tetrahedra_domains(
            &b.params(),
            &gradients,
            &of.first_of_domain,
            &of.of_domain,
            &shear,
            &rotation,
            &strain[at],
            &mut stress[to],
        );
    }
    vec![("domain_stress", flat(&stress))]
}

pub fn tetrahedra_deformations<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, corners) = (b.v4("gradients"), &b.tetrahedra.corners);
    let (mut strain, mut cofactor) = (b.v4::<R>("strain"), b.v4("cofactor"));
    let own = &mut strain[..gradients.len()];
    kernels::tetrahedra_deformations::tetrahedra_deformations(corners, &gradients, &b.v4("u"), own, &mut cofactor);
    vec![("strain", flat(&strain)), ("cofactor", flat(&cofactor))]
}

pub fn tetrahedra_pressed<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, corners, nodal) = (b.v4("gradients"), &b.tetrahedra.corners, b.scalars("nodal_strain"));
    let (mut strain, mut cofactor) = (b.v4::<R>("strain"), b.v4("cofactor"));
    let own = &mut strain[..gradients.len()];
    kernels::tetrahedra_pressed::tetrahedra_pressed(corners, &gradients, &nodal, own, &mut cofactor);
    vec![("strain", flat(&strain)), ("cofactor", flat(&cofactor))]
}

pub fn tetrahedra_laws<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, shear, of) = (b.v4("gradients"), b.v2("shear"), &b.tetrahedra);
    let (mut stress, mut frame) = (b.v4::<R>("domain_stress"), b.v4("frame"));
    kernels::tetrahedra_laws::tetrahedra_laws(
        &b.params(),
        &gradients,
        &of.first_of_domain,
        &of.of_domain,
        &shear,
        &b.v4("laws"),
        &b.v4("strain")[..gradients.len()],
        &b.v4("domain_rotation"),
        &mut stress[..3 * shear.len()],
        &mut frame,
    );
    vec![("domain_stress", flat(&stress)), ("frame", flat(&frame))]
}

pub fn tetrahedra_changes<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, cofactor, z) = (b.v4("gradients"), b.v4("cofactor"), b.v4::<R>("z"));
    let (mut strain, corners) = (b.v4("strain"), &b.tetrahedra.corners);
    for ((_, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        let (z, strain) = (&z[nodes], &mut strain[at]);
        kernels::tetrahedra_changes::tetrahedra_changes(corners, &gradients, &cofactor, z, strain);
    }
    vec![("strain", flat(&strain))]
}

pub fn tetrahedra_frames<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, rotation, frame, of) = (b.v4("gradients"), b.v4("domain_rotation"), b.v4("frame"), &b.tetrahedra);
    let (strain, mut stress) = (b.v4::<R>("strain"), b.v4("domain_stress"));
    for ((_, at), (_, to)) in running_of(b, gradients.len()).zip(running_of(b, 3 * frame.len())) {
        kernels::tetrahedra_frames::tetrahedra_frames(
            &gradients,
            &of.first_of_domain,
            &of.of_domain,
            &rotation,
            &frame,
            &strain[at],
            &mut stress[to],
        );
    }
    vec![("domain_stress", flat(&stress))]
}

pub fn tetrahedra_large<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, cofactor, of) = (b.v4::<R>("gradients"), b.v4("cofactor"), &b.tetrahedra);
    let (stress, pressure, mut force) = (b.v4("domain_stress"), b.scalars("pressure"), b.v4("tetrahedron_force"));
    let domains = 3 * of.shear.len();
    for ((rhs, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        kernels::tetrahedra_large::tetrahedra_large(
            &of.corners,
            &gradients,
            &cofactor,
            &of.domains,
            &stress[rhs * domains..(rhs + 1) * domains],
            &pressure[nodes],
            &mut force[at],
        );
    }
    vec![("tetrahedron_force", flat(&force))]
}

pub fn tetrahedra_volumes<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, per_volume, of) = (b.v4("gradients"), b.scalars("per_volume"), &b.tetrahedra);
    let (strain, mut nodal) = (b.v4::<R>("strain"), b.scalars("nodal_strain"));
    for ((_, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        kernels::tetrahedra_volumes::tetrahedra_volumes(
            &gradients,
            &of.first_of_node,
            &of.of_node,
            &per_volume,
            &strain[at],
            &mut nodal[nodes],
        );
    }
    vec![("nodal_strain", nodal)]
}

pub fn tetrahedra_pressures<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, per_volume, of) = (b.v4::<R>("gradients"), b.scalars("per_volume"), &b.tetrahedra);
    let (nodal, mut pressure) = (b.scalars::<R>("nodal_strain"), b.scalars("pressure"));
    for (_, nodes) in running(b) {
        kernels::tetrahedra_pressures::tetrahedra_pressures(
            &of.corners,
            &gradients,
            &of.first_of_node,
            &of.of_node,
            &per_volume,
            &nodal[nodes.clone()],
            &mut pressure[nodes],
        );
    }
    vec![("pressure", pressure)]
}

pub fn tetrahedra_smoothed<R: Real>(b: &Body) -> Outputs<R> {
    let (gradients, rotation, of) = (b.v4::<R>("gradients"), b.v4("element_rotation"), &b.tetrahedra);
    let (stress, pressure, mut force) = (b.v4("domain_stress"), b.scalars("pressure"), b.v4("tetrahedron_force"));
    let domains = 3 * of.shear.len();
    for ((rhs, at), (_, nodes)) in running_of(b, gradients.len()).zip(running(b)) {
        kernels::tetrahedra_smoothed::tetrahedra_smoothed(
            &of.corners,
            &gradients,
            &rotation,
            &of.domains,
            &stress[rhs * domains..(rhs + 1) * domains],
            &pressure[nodes],
            &mut force[at],
        );
    }
    vec![("tetrahedron_force", flat(&force))]
}

pub fn tetrahedra_forces<R: Real>(b: &Body) -> Outputs<R> {
    let (force, mut f, of) = (b.v4::<R>("tetrahedron_force"), b.v4("f"), &b.tetrahedra);
    kernels::tetrahedra_forces::tetrahedra_forces(&of.first_of_node, &of.of_node, &force, &mut f);
    vec![("f", flat(&f))]
}

pub fn tetrahedra_product<R: Real>(b: &Body) -> Outputs<R> {
    let (force, dofs, of) = (b.v4::<R>("tetrahedron_force"), b.v4("dofs"), &b.tetrahedra);
    let (z, mut w) = (b.v4::<R>("z"), b.v4("w"));
    let mut dots = start_sums(b, "partial_product", b.product_groups());
    for ((rhs, at), (_, nodes)) in running_of(b, 3 * of.corners.len()).zip(running(b)) {
        dots[rhs] = kernels::tetrahedra_product::tetrahedra_product(
            &b.params(),
            &of.first_of_node,
            &of.of_node,
            &force[at],
            &dofs,
            &z[nodes.clone()],
            &mut w[nodes],
        );
    }
    vec![("w", flat(&w)), ("partial_product", dots)]
}

pub fn tetrahedra_blocks<R: Real>(b: &Body) -> Outputs<R> {
    let (rest, rotation, dofs) = (b.v4("rest_block"), b.v4("node_rotation"), b.v4("dofs"));
    let mut block = b.v4::<R>("block");
    kernels::tetrahedra_blocks::tetrahedra_blocks(&b.params(), &rest, &rotation, &dofs, &mut block);
    vec![("block", flat(&block))]
}

pub fn update<R: Real>(b: &Body) -> Outputs<R> {
    let (z, w, scalars) = (b.v4::<R>("z"), b.v4("w"), b.scalars("scalars"));
    let [mut x, mut p, mut s, mut r] = ["x", "p", "s", "r"].map(|name| b.v4(name));
    // a done right-hand side keeps its sums
    let mut residual = rhs_sums(&b.scalars::<R>("partial_residual"), b.node_groups());
    for (rhs, at) in running(b) {
        let k = read_scalars(&scalars[rhs * 8..rhs * 8 + 8]);
        let at = || at.clone();
        residual[rhs] =
            kernels::update::update(&k, &z[at()], &w[at()], &mut x[at()], &mut p[at()], &mut s[at()], &mut r[at()]);
    }
    vec![("x", flat(&x)), ("p", flat(&p)), ("s", flat(&s)), ("r", flat(&r)), ("partial_residual", residual)]
}
