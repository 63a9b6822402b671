//! A deformable body on any platform, driven step by step without a scene's tools; and what tests compare it with.

use super::small;
use cutis::backend::{Backend, FREE, GpuBackend, Needs, Nonlinear, Query, Snapshot, SolveRequest, Target, on_cpu};
use cutis::bodies::Model;
use cutis::bodies::Removal;
use cutis::gpu::Gpu;
use cutis::linear::Outcome;
use cutis::math::{V4, norm, random};
use cutis::scene::{Element, Integrator, Law, Layer, Material, Preconditioner, Scene, Solver, read};
use cutis::step::Platform;
use std::path::Path;

/// A step so long (s) that inertia vanishes beside stiffness (1e-6 × kg/m³ against Pa/m²: 1e-15 and less): one step is the static answer.
pub const LONG: f64 = 1e3;

/// A free block of three layers of uneven height, one material, no gravity, no damping; tests change what they need.
pub fn block(element: Element, corotational: bool) -> Scene {
    let layers = [(2, 1.2e-3), (1, 1.0e-3), (1, 0.3e-3)].map(|(cells, height)| (cells, height, 50e3, 0.45, 1000.0));
    let mut scene = small::block([8e-3, 6e-3], [4, 3], &layers);
    (scene.time.step, scene.time.gravity) = (1e-3, [0.0; 3]);
    scene.solver = Solver { tolerance: 1e-12, floor: 0.0, max_iterations: 5000, ..scene.solver };
    let skin = &mut scene.skins[0];
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.0, 0.0);
    skin.law = Law::Fem { element, corotational };
    scene
}

/// Relative error of values computed from the displacements of a [`static_block`]: residuals of its solves and, in f32, displacements that are
/// rounded to 6·10⁻⁸ of themselves, over cells that have a tenth of the strained length.
pub fn exact(place: &Platform) -> f64 {
    match place {
        Platform::Cpu64 => 1e-8,
        Platform::Cpu32 | Platform::Gpu(_) => 2e-5,
    }
}

/// The block of three layers of one material, in steps without inertia.
pub fn static_block(place: &Platform, law: Law) -> Scene {
    let mut scene = block(Element::Bbar, true);
    scene.time.step = LONG;
    scene.solver.tolerance = if *place == Platform::Cpu64 { 1e-12 } else { 1e-6 };
    scene.skins[0].law = law;
    if let Law::Springs { .. } = law {
        scene.solver.preconditioner = Preconditioner::Column;
    }
    if law.is_tetrahedral() {
        scene.solver.preconditioner = Preconditioner::Block;
    }
    scene
}

/// Nominal stress of a bar of 2 × 2 × 2 cells of a layer's material that is stretched along an axis and held by its ends alone, Pa.
pub fn pulled(platform: &Platform, material: Material, layer: &Layer, axis: usize, stretch: f64) -> f64 {
    let mut scene = block(Element::Bbar, true);
    scene.solver.newton = true;
    scene.time.step = LONG;
    let skin = &mut scene.skins[0];
    (skin.law, skin.cells) = (Law::Hyperelastic(material), [2, 2]);
    skin.layers = vec![Layer { cells: 2, thickness: 1.2e-3, ..layer.clone() }];
    let edges = [skin.size[0], skin.size[1], 1.2e-3];
    let mut model = model(&scene);
    let at: Vec<[usize; 3]> = (0..model.rest.len()).map(|node| model.grid.params::<f64>().node_at(node)).collect();
    // free across but for the middle planes, and along but for the ends
    for (dofs, at) in model.dofs.iter_mut().zip(&at) {
        (0..3).for_each(|n| dofs[n] = f64::from(u8::from((at[n] == 1) == (n == axis))));
    }
    // a little at a time, each from the places that it ends at and the width that the last one left
    let mut u = displaced(&model, |_| [0.0; 3]);
    let mut body = None;
    for part in 1..=4 {
        let moved = 1.0 + (stretch - 1.0) * f64::from(part) / 4.0;
        for (node, x) in model.rest.iter().enumerate() {
            u.u[node][axis] = (moved - 1.0) * x[axis];
        }
        let mut now = Body::new(platform, model.clone(), &u, 100.0 * tolerance(platform));
        now.step();
        now.step(); // whose load is what the first has left
        u.u = now.state().u;
        body = Some(now);
    }
    let forces = body.expect("four parts").forces();
    let ends = forces.iter().zip(&at).filter(|(_, at)| at[axis] == 2);
    ends.map(|(force, _)| force[axis]).sum::<f64>() * edges[axis] / edges.iter().product::<f64>()
}

/// A scene of the repository.
pub fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    read(&path).unwrap_or_else(|e| panic!("{e}"))
}

/// A static scene of the repository in steps of [`LONG`], undamped and by implicit Euler: each of its solves is one of the static balance.
pub fn in_long_steps(name: &str) -> Scene {
    let mut scene = scene(name);
    assert_eq!(scene.time.integrator, Integrator::Static, "{name}");
    (scene.time.integrator, scene.time.step, scene.time.duration) = (Integrator::ImplicitEuler, LONG, LONG);
    let skin = &mut scene.skins[0];
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.0, 0.0);
    scene
}

/// The model of a scene.
pub fn model(scene: &Scene) -> Model {
    Model::new(scene, 0).unwrap_or_else(|e| panic!("{e}"))
}

/// Relative rounding of a platform's numbers.
pub fn epsilon(platform: &Platform) -> f64 {
    match platform {
        Platform::Cpu64 => f64::EPSILON,
        Platform::Cpu32 | Platform::Gpu(_) => f64::from(f32::EPSILON),
    }
}

/// Residual that a platform's CG can reach on small well-scaled bodies: a few thousand roundings.
pub fn tolerance(platform: &Platform) -> f64 {
    match platform {
        Platform::Cpu64 => 1e-12,
        Platform::Cpu32 | Platform::Gpu(_) => 1e-6,
    }
}

/// Prints a measured value beside its reference when `CUTIS_MEASURED` is set: the tables of reports come from here.
pub fn measured(what: &str, value: f64, reference: f64) {
    if std::env::var_os("CUTIS_MEASURED").is_some() {
        println!("measured {what}: {value:.6e} (reference {reference:.6e})");
    }
}

/// A body without contact.
pub struct Body {
    pub model: Model,
    backend: Box<dyn Backend>,
    tolerance: f64,
    taken: Nonlinear,
}

impl Body {
    /// The body in a state; `tolerance` of every solve relative to the step's load.
    pub fn new(platform: &Platform, model: Model, start: &Snapshot, tolerance: f64) -> Self {
        const CAP: u32 = 20_000;
        let needs = Needs { cutting: model.mechanics().extra_columns() > 0, ..Needs::default() };
        let backend: Box<dyn Backend> = match platform {
            Platform::Cpu64 => on_cpu(false, &model, needs, CAP, 0.0, start),
            Platform::Cpu32 => on_cpu(true, &model, needs, CAP, 0.0, start),
            Platform::Gpu(text) => {
                let gpu = Gpu::open(text.as_deref()).unwrap_or_else(|e| panic!("{e}"));
                let backend = GpuBackend::new(gpu, &model, needs, CAP, 0.0, start);
                Box::new(backend.unwrap_or_else(|e| panic!("{e}")))
            }
        };
        Self { model, backend, tolerance, taken: Nonlinear::default() }
    }

    /// Sets the dead loads, [node] N.
    pub fn load(&mut self, load: &[[f64; 3]]) {
        self.backend.set_load(load);
    }

    /// Newton iterations of the last step.
    pub fn newton(&self) -> u32 {
        self.taken.iterations
    }

    /// Tangents of the last step that were not positive.
    pub fn indefinite(&self) -> u32 {
        self.taken.indefinite
    }

    /// True if the last step had its elastic forces elsewhere than in its middle.
    pub fn moved(&self) -> bool {
        self.taken.elastic_at.is_some()
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> u64 {
        self.backend.device().device_bytes
    }

    /// Takes what a cut has changed.
    pub fn remove(&mut self, removal: &Removal) {
        self.backend.begin().expect("the device works");
        self.backend.remove(removal).expect("the device works");
    }

    /// One implicit step that may be refused; what its solve reports.
    pub fn fallible_step(&mut self) -> cutis::error::Result<Outcome> {
        let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(self.tolerance) }];
        self.backend.begin()?;
        let (outcomes, _) = self.backend.solve(&wanted, &[])?;
        self.taken = self.backend.nonlinear();
        self.backend.finish(false, false)?;
        Ok(outcomes[0])
    }

    /// One implicit step; what its solve reports.
    pub fn try_step(&mut self) -> Outcome {
        self.fallible_step().expect("the device works")
    }

    /// One implicit step that must converge.
    pub fn step(&mut self) {
        let outcome = self.try_step();
        assert!(outcome.converged, "not converged: {outcome:?}");
    }

    /// Elastic forces in the present state, [node] N.
    pub fn forces(&mut self) -> Vec<[f64; 3]> {
        let query = Query { elastic_forces: (0..self.model.grid.node_count() as u32).collect(), ..Query::default() };
        self.backend.begin().expect("the device works");
        self.backend.read(&query).expect("the device works").elastic_forces
    }

    /// Present state, in which a cell may be inverted; rotations belong to it.
    pub fn fallible_state(&mut self) -> cutis::error::Result<Snapshot> {
        self.backend.begin()?;
        self.backend.snapshot()
    }

    /// Present state; rotations belong to it.
    pub fn state(&mut self) -> Snapshot {
        self.fallible_state().expect("the device works")
    }
}

/// A state with displacements from rest positions and no velocity.
pub fn displaced(model: &Model, u: impl Fn([f64; 3]) -> [f64; 3]) -> Snapshot {
    let field = |x: &[f64; 3]| {
        let [a, b, c] = u(*x);
        [a, b, c, 0.0]
    };
    Snapshot { u: model.rest.iter().map(field).collect(), v: vec![[0.0; 4]; model.rest.len()], ..Snapshot::default() }
}

/// `|a − b| / |b|` of two fields.
pub fn apart(a: &[V4<f64>], b: &[V4<f64>]) -> f64 {
    let difference: Vec<_> = a.iter().zip(b).map(|(a, b)| [0, 1, 2, 3].map(|n| a[n] - b[n])).collect();
    norm(&difference) / norm(b)
}

/// `m x`, matrix by rows.
pub fn times(m: &[[f64; 3]; 3], x: [f64; 3]) -> [f64; 3] {
    m.map(|row| dot(row, x))
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn xyz(a: V4<f64>) -> [f64; 3] {
    [a[0], a[1], a[2]]
}

/// Largest component of a field.
pub fn largest<'a>(field: impl IntoIterator<Item = &'a [f64; 3]>) -> f64 {
    field.into_iter().flatten().fold(0.0, |m, c| f64::max(m, c.abs()))
}

/// Numbers in −1…1, the same on every machine.
pub struct Random(random::Random);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(random::Random::new(seed))
    }

    pub fn next(&mut self) -> f64 {
        self.0.signed()
    }

    /// [node] vectors with a fourth 0.
    pub fn field(&mut self, count: usize, size: f64) -> Vec<V4<f64>> {
        let mut one = || size * self.next();
        (0..count).map(|_| [one(), one(), one(), 0.0]).collect()
    }

    /// Unit quaternion.
    pub fn quaternion(&mut self) -> V4<f64> {
        let q = [self.next(), self.next(), self.next(), self.next()];
        let n = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        q.map(|c| c / n)
    }
}
