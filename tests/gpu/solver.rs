//! Whole solves: the GPU backend against the CPU backend in f32 and in f64, on a small block of three layers.

use super::{Failure, small};
use cutis::backend::{
    Backend, CORRECTION, FIRST_COLUMN, FREE, GpuBackend, Needs, Query, Snapshot, SolveRequest, Target, Values, on_cpu,
};
use cutis::bodies::Model;
use cutis::gpu::Gpu;
use cutis::linear::Outcome;
use cutis::math::{V3, V4};
use cutis::scene::Mass::{Consistent, Lumped};
use cutis::scene::Preconditioner::{Block, Column, Jacobi, Multigrid};
use cutis::scene::{Element, Law, Load, Mass, Preconditioner, Region, RestSpring, Scene};

type Test = Box<dyn Fn(&Gpu) -> Result<(), Failure> + Send>;

/// Residual that solves stop at, relative to the load.
const TOLERANCE: f64 = 1e-6;
/// Difference of two solutions, relative to the largest displacement. Condition of the block-preconditioned system, about 1e3, times
/// the residual of 1e-6 would be 1e-3; the load is smooth, so that a fifth of it is enough. f32 adds 1e-4 (NUMBERS: 7.7e-5).
const SOLUTION: f64 = 2e-4;
/// Difference of elastic forces, relative to the largest: in f32 the true residual ends at 2.1e-3 of the load (NUMBERS, section 4).
const FORCE: f64 = 5e-3;
/// Rounding moves where the residual passes the target: share and number of iterations. Against f64 only with columns: in f32 the
/// others lose orthogonality early and take 15 to 60 % more iterations to 1e-3 (without preconditioner, Jacobi, blocks: 241, 152, 151
/// on the CPU, 237, 152, 150 on lavapipe, but 153, 132, 129 in f64).
const ITERATIONS: (f64, f64) = (0.1, 2.0);
/// Residual at which iterations are counted.
const COUNTED: f64 = 1e-3;
/// Most iterations of any solve here; plain conjugate gradients need some hundred.
const MAX_ITERATIONS: u32 = 3000;
/// Difference of where links are crossed, in their lengths: solutions differ by SOLUTION of at most 0.1 mm, the shortest link has 0.1 mm,
/// and the blade meets the links at a slope of no more than 5.
const ALONG: f64 = 5.0 * SOLUTION;
/// N
const FLOOR: f64 = 1e-9;
/// Columns at a time.
const COLUMNS: usize = 4;

/// The middle third of a three-layer block is pressed.
fn scene(law: Law, mass: Mass, preconditioner: Preconditioner, on_rest_springs: bool) -> Scene {
    let layers = [(2, 1.2e-3, 34e3, 0.45, 971.0), (2, 1.0e-3, 200e3, 0.45, 1116.0), (1, 0.1e-3, 1000e3, 0.45, 1116.0)];
    let mut scene = small::block([6e-3; 2], [6; 2], &layers);
    // so short that a consistent mass weighs as much as stiffness
    scene.time.step = if mass == Mass::Consistent { 0.05e-3 } else { 10e-3 };
    scene.solver.preconditioner = preconditioner;
    (scene.skins[0].law, scene.skins[0].mass) = (law, mass);
    scene.boundaries = vec![small::held(Region::Bottom, [true; 3])];
    scene.loads = vec![Load::on_top(&scene.skins[0], 10e3, [-1e-3; 2], [1e-3; 2])];
    if on_rest_springs {
        // every node on a spring, a node's share of the cells' stiffness along x here
        scene.rest_springs = vec![RestSpring { body: 0, region: Region::All, stiffness: 20.0 }];
    }
    scene
}

/// By the words of scene files.
const PRECONDITIONERS: [(&str, Preconditioner); 5] = [
    ("none", Preconditioner::None),
    ("jacobi", Jacobi),
    ("block", Block),
    ("column", Column),
    ("multigrid", Multigrid),
];
const FEM: Law = Law::Fem { element: Element::Bbar, corotational: true };
const SPRINGS: Law = Law::Springs { stiffness: Some(30.0), damping: 0.02 };
const TETRAHEDRA: Law = Law::Fem { element: Element::Tetra, corotational: true };
const SMALL_STRAINS: Law = Law::Fem { element: Element::Tetra, corotational: false };
const PLAIN: Law = Law::Fem { element: Element::PlainTetra, corotational: true };

/// Every test here, by name.
pub fn tests() -> Vec<(String, Test)> {
    let mut all: Vec<(String, Test)> = vec![];
    let cases = [
        ("hexahedra", FEM, Lumped),
        ("heavy_hexahedra", FEM, Consistent),
        ("springs", SPRINGS, Lumped),
        ("tetrahedra", TETRAHEDRA, Lumped),
        ("tetrahedra_of_small_strains", SMALL_STRAINS, Lumped),
        ("plain_tetrahedra", PLAIN, Lumped),
    ];
    for (name, law, mass) in cases {
        let tetrahedral = law.is_tetrahedral();
        let preconditioner = if tetrahedral { Block } else { Column };
        let case = Case { name, law, mass, preconditioner, on_rest_springs: false };
        for (kind, preconditioner) in PRECONDITIONERS {
            if preconditioner == Multigrid && name == "springs" || preconditioner == Column && tetrahedral {
                continue;
            }
            let case = Case { preconditioner, ..case };
            all.push((format!("free_motion_of_{name}_{kind}"), Box::new(move |gpu| case.free_motion(gpu))));
        }
        all.push((format!("columns_of_{name}_alone_or_together"), Box::new(move |gpu| case.columns(gpu))));
        all.push((format!("wrong_load_on_{name}_is_found_out"), Box::new(move |gpu| case.wrong_load(gpu))));
        if !tetrahedral {
            all.push((format!("cut_of_{name}"), Box::new(move |gpu| case.cut(gpu))));
        }
        all.push((format!("two_steps_of_{name}"), Box::new(move |gpu| case.two_steps(gpu))));
        if mass != Consistent {
            let case = Case { on_rest_springs: true, ..case };
            all.push((format!("two_steps_of_{name}_on_rest_springs"), Box::new(move |gpu| case.two_steps(gpu))));
        }
    }
    let case = Case { name: "hexahedra", law: FEM, mass: Lumped, preconditioner: Multigrid, on_rest_springs: true };
    all.push(("free_motion_of_hexahedra_on_rest_springs_multigrid".into(), Box::new(move |gpu| case.free_motion(gpu))));
    all
}

/// A law and a preconditioner.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    law: Law,
    mass: Mass,
    preconditioner: Preconditioner,
    on_rest_springs: bool,
}

/// The same body on each backend.
struct Three {
    model: Model,
    gpu: GpuBackend,
    single: Box<dyn Backend>,
    double: Box<dyn Backend>,
}

impl Case {
    fn report(self, gpu: &Gpu, text: &str) {
        super::report(gpu, &format!("{}, {:?}: {text}", self.name, self.preconditioner));
    }

    fn model(self) -> Result<(Model, Vec<[f64; 3]>), Failure> {
        let scene = scene(self.law, self.mass, self.preconditioner, self.on_rest_springs);
        scene.check()?;
        let model = Model::new(&scene, 0)?;
        let load = model.load_at(&scene.loads, 0.0);
        Ok((model, load))
    }

    fn three(self, gpu: &Gpu) -> Result<Three, Failure> {
        let (model, load) = self.model()?;
        let rest = vec![[0.0; 4]; model.grid.node_count()];
        let start = Snapshot { u: rest.clone(), v: rest, ..Snapshot::default() };
        let needs =
            Needs { contact: true, columns: COLUMNS, near: 64, cutting: true, node_blocks: true, ..Needs::default() };
        let a = &gpu.adapter;
        let own = Gpu::open(Some(&format!("{} {} {}", a.name, a.backend, a.driver)))?;
        let mut three = Three {
            gpu: GpuBackend::new(own, &model, needs, MAX_ITERATIONS, FLOOR, &start)?,
            single: on_cpu(true, &model, needs, MAX_ITERATIONS, FLOOR, &start),
            double: on_cpu(false, &model, needs, MAX_ITERATIONS, FLOOR, &start),
            model,
        };
        three.each(|b| {
            b.set_load(&load);
            b.begin()
        })?;
        Ok(three)
    }

    fn free_motion(self, gpu: &Gpu) -> Result<(), Failure> {
        let mut three = self.three(gpu)?;
        let free = |tolerance| SolveRequest { rhs: FREE, target: Target::OfLoad(tolerance) };
        let counted = three.each(|b| Ok(b.solve(&[free(COUNTED)], &[])?.0[0]))?;
        same_iterations(&counted, self.preconditioner == Column)?;
        // on from there: the start is the last solution
        let outcomes = three.each(|b| {
            b.begin()?;
            Ok(b.solve(&[free(TOLERANCE)], &[])?.0[0])
        })?;
        converged(&outcomes)?;
        let x = three.each(|b| b.solution(FREE))?;
        let used = same("the free motion", &x.map(|x| triples(&x)), SOLUTION)?;
        let counts = [counted, outcomes].map(|all| all.map(|o| o.iterations));
        self.report(gpu, &format!("free motion: {used:.1} % of the bound; iterations on GPU, f32, f64: {counts:?}"));
        Ok(())
    }

    /// The comparison can fail: a load that is off by a thousandth is seen.
    fn wrong_load(self, gpu: &Gpu) -> Result<(), Failure> {
        let mut three = self.three(gpu)?;
        let load = self.model()?.1.iter().map(|f| f.map(|c| 1.001 * c)).collect::<Vec<_>>();
        three.gpu.set_load(&load);
        let free = SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) };
        let x = three.each(|b| {
            b.begin()?;
            b.solve(&[free], &[])?;
            b.solution(FREE)
        })?;
        match same("the free motion", &x.map(|x| triples(&x)), SOLUTION) {
            Ok(_) => Err("a load of 1.001 is taken for 1".into()),
            Err(_) => Ok(()),
        }
    }

    /// Columns do not see each other: solved one at a time, they come out with the same bits.
    fn columns(self, gpu: &Gpu) -> Result<(), Failure> {
        let mut three = self.three(gpu)?;
        let top = three.top();
        let row = |k: usize| {
            let forces = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.7, 0.7], [0.0, -1.0, 0.0]];
            (FIRST_COLUMN + k, top[3 + 11 * k], forces[k])
        };
        let rows: Vec<_> = (0..COLUMNS).map(row).collect();
        let rhs_ids: Vec<usize> = rows.iter().map(|r| r.0).collect();
        let wanted = |rhs| SolveRequest { rhs, target: Target::Absolute(TOLERANCE) };
        let free = SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) };
        let mut together = vec![free];
        together.extend(rhs_ids.iter().map(|s| wanted(*s)));
        let solved = three.each(|b| {
            b.set_rows(&rhs_ids, &rows)?;
            Ok(b.solve(&together, &[])?.0)
        })?;
        let [on_gpu, single, double] = &solved;
        for ((g, s), d) in on_gpu.iter().zip(single).zip(double) {
            converged(&[*g, *s, *d])?;
        }
        let all =
            |b: &mut dyn Backend| (0..FIRST_COLUMN + COLUMNS).map(|s| b.solution(s)).collect::<Result<Vec<_>, _>>();
        let before = three.each(all)?;
        for rhs in [FREE].iter().chain(&rhs_ids) {
            let x = [0, 1, 2].map(|n| triples(&before[n][*rhs]));
            let used = same(&format!("rhs {rhs}"), &x, SOLUTION)?;
            self.report(gpu, &format!("rhs {rhs}: {used:.1} % of the bound"));
        }
        three.each(|b| b.reset_initial_guess(&(0..FIRST_COLUMN + COLUMNS).collect::<Vec<_>>()))?;
        let load = self.model()?.1;
        let gone = three.gpu.solution(FIRST_COLUMN)?.iter().any(|x| *x != [0.0; 4]);
        if gone {
            return Err("a forgotten column is still there".into());
        }
        three.gpu.set_load(&load);
        three.gpu.begin()?;
        let mut outcomes = three.gpu.solve(&[free], &[])?.0;
        for row in &rows {
            three.gpu.set_rows(&[row.0], &[*row])?;
            outcomes.extend(three.gpu.solve(&[wanted(row.0)], &[])?.0);
        }
        if outcomes != solved[0] {
            return Err(format!("alone {outcomes:?}, together {:?}", solved[0]).into());
        }
        let after = all(&mut three.gpu)?;
        match (0..after.len()).find(|s| after[*s] != before[0][*s]) {
            Some(rhs) => Err(format!("rhs {rhs} has other bits when it is solved alone").into()),
            None => Ok(()),
        }
    }

    fn cut(self, gpu: &Gpu) -> Result<(), Failure> {
        let mut three = self.three(gpu)?;
        let free = SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) };
        // down through epidermis and dermis, in two pieces of the edge; and one that stays above the skin
        let quad = |x: [f64; 2], z: [f64; 2]| {
            let at = |x: f64, z: f64| [1e-3 * x, 1e-3 * (0.13 + 0.05 * x), 1e-3 * z];
            [at(x[0], z[0]), at(x[1], z[0]), at(x[1], z[1]), at(x[0], z[1])]
        };
        let quads =
            [quad([-2.2, -0.3], [3.0, 1.03]), quad([-0.3, 1.7], [3.0, 0.71]), quad([-3.0, 3.0], [4.0, 3.0])].concat();
        let hits = three.each(|b| {
            b.solve(&[free], &[])?;
            b.finish(false, true)?;
            b.read(&swept(&quads))
        })?;
        let hits = hits.map(|values| values.hits);
        let segments = |k: usize| hits[k].iter().map(|hit| hit.segment).collect::<Vec<_>>();
        if segments(0) != segments(1) || segments(0) != segments(2) || hits[0].len() < 5 {
            return Err(format!("{hits:?}").into());
        }
        for (k, hit) in hits[0].iter().enumerate() {
            let apart = (1..3).map(|n| (hits[n][k].at - hit.at).abs()).fold(0.0, f64::max);
            if apart > ALONG {
                return Err(format!("segment {} is crossed {apart:e} of its length apart", hit.segment).into());
            }
        }
        let none = three.each(|b| b.read(&swept(&quads[8..])))?;
        if none.iter().any(|values| !values.hits.is_empty()) {
            return Err(format!("cut in the air: {none:?}").into());
        }
        Ok(())
    }

    /// A step with contact forces and a step after a cell is gone: everything that a backend hands back.
    fn two_steps(self, gpu: &Gpu) -> Result<(), Failure> {
        let mut three = self.three(gpu)?;
        let model = three.model.clone();
        let top = three.top();
        let seen = three.each(|b| script(b, &model, &top))?;
        for (k, (name, bound, _)) in seen[0].iter().enumerate() {
            let values = [0, 1, 2].map(|n| seen[n][k].2.clone());
            let used = same(name, &values, *bound)?;
            self.report(gpu, &format!("{name}: {used:.1} % of the bound"));
        }
        Ok(())
    }
}

impl Three {
    /// Does the same on each: GPU, CPU in f32, CPU in f64.
    fn each<T>(&mut self, mut act: impl FnMut(&mut dyn Backend) -> cutis::error::Result<T>) -> Result<[T; 3], Failure> {
        Ok([act(&mut self.gpu)?, act(self.single.as_mut())?, act(self.double.as_mut())?])
    }
    fn top(&self) -> Vec<u32> {
        self.model.nodes_in(&cutis::scene::Region::Top)
    }
}

/// Name, allowed difference relative to the largest entry, values.
type Seen = Vec<(&'static str, f64, Vec<[f64; 3]>)>;

fn swept(quads: &[[f64; 3]]) -> Query {
    Query { quads: quads.to_vec(), ..Query::default() }
}

fn script(b: &mut dyn Backend, model: &Model, top: &[u32]) -> cutis::error::Result<Seen> {
    let mut seen: Seen = vec![];
    let (pressed, bottom) = (top[24], 8u32);
    let free = SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) };
    let absolute = |rhs| SolveRequest { rhs, target: Target::Absolute(TOLERANCE) };
    // a force on a held node is lost, whoever gives it
    let rows = [(FIRST_COLUMN, pressed, [0.0, 0.0, -1.0]), (FIRST_COLUMN, bottom, [1.0, 2.0, 3.0])];
    b.set_rows(&[FIRST_COLUMN], &rows)?;
    // a second call in the same submission leaves the first as it was
    b.set_rows(&[FIRST_COLUMN + 1], &[(FIRST_COLUMN + 1, top[3], [0.5, 0.0, 0.0])])?;
    let picks = [(FREE, pressed), (FIRST_COLUMN, pressed), (FIRST_COLUMN + 1, top[3]), (FIRST_COLUMN, bottom)];
    let wanted = [free, absolute(FIRST_COLUMN), absolute(FIRST_COLUMN + 1)];
    let picked = b.solve(&wanted, &picks)?.1;
    seen.push(("picked free motion", SOLUTION, picked[..1].to_vec()));
    seen.push(("picked columns", SOLUTION, picked[1..].to_vec()));
    let f = [0.0, 0.0, -0.05];
    b.set_rows(&[CORRECTION], &[(CORRECTION, pressed, f), (CORRECTION, bottom, f)])?;
    b.solve(&[absolute(CORRECTION)], &[])?;
    seen.push(("correction", SOLUTION, triples(&b.solution(CORRECTION)?)));
    b.finish(true, false)?;
    // velocities, and forces of the step just finished, come with them, in lists of their own
    let query = Query {
        displacements: top.to_vec(),
        velocities: top[3..20].to_vec(),
        elastic_forces: top[..9].to_vec(),
        bounds: true,
        ..Query::default()
    };
    let Values { displacements, velocities, elastic_forces, bounds, .. } = b.read(&query)?;
    let u = b.displacements()?;
    let own: Vec<[f64; 3]> = top.iter().map(|node| V3::from4(u[*node as usize]).f64()).collect();
    assert!(own == displacements && velocities.len() == 17 && elastic_forces.len() == 9);
    let v = b.snapshot()?.v;
    assert!(velocities.iter().zip(&top[3..20]).all(|(own, node)| *own == V3::from4(v[*node as usize]).f64()));
    seen.push(("displacements", SOLUTION, displacements));
    seen.push(("velocities", SOLUTION, velocities));
    seen.push(("elastic forces at the start", FORCE, elastic_forces));
    seen.push(("tile bounds", SOLUTION, triples(&bounds.concat())));
    // one cell (or its springs) and, at the corner, a node go
    let (cells, springs, nodes) = removal(model);
    b.remove(&cutis::bodies::Removal { cells, springs, dofs: nodes, ..Default::default() })?;
    b.begin()?;
    let all: Vec<u32> = (0..model.grid.node_count() as u32).collect();
    let query = Query { elastic_forces: all.clone(), ..Query::default() };
    seen.push(("elastic forces", FORCE, b.read(&query)?.elastic_forces));
    seen.push(("node blocks", SOLUTION, b.node_blocks(&all)?.concat()));
    b.solve(&[free], &[])?;
    b.set_correction(&[(pressed, [0.0, 0.0, -1e-5]), (bottom, [1e-5; 3])])?;
    b.finish(true, false)?;
    let s = b.snapshot()?;
    seen.push(("u", SOLUTION, triples(&s.u)));
    seen.push(("v", SOLUTION, triples(&s.v)));
    seen.push(("free axes", SOLUTION, triples(&s.dofs)));
    seen.push(("masses", SOLUTION, s.dofs.iter().map(|f| [f[3]; 3]).collect()));
    let fourth = |q: &[f64; 4]| [[q[0], q[1], q[2]], [q[3]; 3]];
    seen.push(("rotations", SOLUTION, s.rotation.iter().flat_map(fourth).collect()));
    seen.push(("law", SOLUTION, s.law.iter().flat_map(fourth).collect()));
    Ok(seen)
}

/// Cells, springs, and free axes and mass of nodes.
type Removal = (Vec<u32>, Vec<u32>, Vec<(u32, V4<f64>)>);

/// The last cell, its springs to the last node, and what is left of its corners: the last node has no other cell and leaves the system.
/// Of tetrahedra, which are not cut, nothing.
fn removal(model: &Model) -> Removal {
    if model.elements().tetrahedron_count > 0 {
        return Removal::default();
    }
    let params = model.grid.params::<f64>();
    let (cell, last) = (model.grid.cell_count() - 1, model.grid.node_count() - 1);
    let share = model.shape[model.shape.len() - 1][3];
    let left = |node: usize| {
        let [x, y, z, mass] = model.dofs[node];
        if node == last { [0.0; 4] } else { [x, y, z, mass - share] }
    };
    let nodes = params.corners(cell).map(|n| (n as u32, left(n))).to_vec();
    let springs = model.springs().map_or(vec![], |s| {
        let own = s.first[last] as usize..s.first[last + 1] as usize;
        s.half[own].iter().map(|[_, spring]| *spring).collect()
    });
    (vec![cell as u32], springs, nodes)
}

fn triples(x: &[[f64; 4]]) -> Vec<[f64; 3]> {
    x.iter().map(|v| [v[0], v[1], v[2]]).collect()
}

fn converged(outcomes: &[Outcome; 3]) -> Result<(), Failure> {
    let all = outcomes.iter().all(|o| o.converged);
    all.then_some(()).ok_or_else(|| format!("GPU, f32 and f64: {outcomes:?}").into())
}

fn same_iterations(outcomes: &[Outcome; 3], as_f64: bool) -> Result<(), Failure> {
    converged(outcomes)?;
    let [gpu, single, double] = outcomes.map(|o| f64::from(o.iterations));
    let (share, count) = ITERATIONS;
    let near = |other: f64| (gpu - other).abs() <= share * other + count;
    if near(single) && (near(double) || !as_f64) {
        Ok(())
    } else {
        Err(format!("GPU, f32 and f64 took {gpu}, {single} and {double} iterations").into())
    }
}

/// The GPU's values are those of the CPU in both precisions, up to a share of the largest entry in f64; per cent of that share used.
fn same(name: &str, values: &[Vec<[f64; 3]>; 3], bound: f64) -> Result<f64, Failure> {
    let mut used: f64 = 0.0;
    let [gpu, single, double] = values.each_ref().map(|v| v.concat());
    let scale = double.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    for (precision, other) in [("f32", single), ("f64", double)] {
        if gpu.len() != other.len() {
            return Err(format!("{name}: {} values, {} in {precision}", gpu.len(), other.len()).into());
        }
        let worst = gpu.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // written so that NaN fails it
        if !(worst <= bound * scale && gpu.iter().all(|c| c.is_finite())) {
            return Err(format!("{name}: {worst:.2e} off the CPU in {precision}, of {scale:.2e}").into());
        }
        if scale > 0.0 {
            used = used.max(100.0 * worst / (bound * scale));
        }
    }
    Ok(used)
}
