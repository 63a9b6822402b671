//! Bodies of the tetrahedra of a mesh file: the operator on an irregular mesh, the same tetrahedra in a grid, the outside, loads, contacts,
//! whole runs of scenes/skin_tetra.toml beside bricks, and what is refused.

use crate::small::{self, held};
use cutis::backend::{Needs, on_cpu};
use cutis::bodies::tetrahedra::operator::Arrays;
use cutis::bodies::{Kind, Model, Wound};
use cutis::collide::broad::Boxes;
use cutis::formats;
use cutis::math::{V3, V4, rotation_matrix};
use cutis::mesh::{Face, Grid, Surface};
use cutis::report;
use cutis::scene::Element::{self, PlainTetra, Tetra};
use cutis::scene::{
    BodyId, Boundary, COMPONENTS, Component, Cut, Defect, Files, Integrator, Law, Load, LoadKind, Mass, Plane,
    Preconditioner, Probe, ProbeKind, Region, Scene, TetrahedralMesh, parse,
};
use cutis::step::{Platform, Simulation};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Text of the skin's scene on a mesh of a size.
fn text(size: &str) -> String {
    let text = std::fs::read_to_string(scenes().join("skin_tetra.toml")).expect("the scene is there");
    let changed = text.replace("skin_fine.msh\"", &format!("skin_{size}.msh\""));
    assert!(changed.contains(&format!("skin_{size}.msh\"")));
    changed
}

fn read(text: &str) -> Scene {
    parse(text, Path::new("skin_tetra.toml"), &Files::Folder(scenes())).unwrap_or_else(|e| panic!("{e}"))
}

/// The skin of a size and an element, with as much rest-shape stiffness under it as the fine one has.
fn skin(size: &str, element: Element) -> Scene {
    let mut scene = read(&text(size));
    scene.skins[0].law = Law::Fem { element, corotational: true };
    let of = |scene: &Scene| Model::new(scene, 0).expect("a valid scene").rest_spring_count() as f64;
    scene.rest_springs[0].stiffness *= of(&read(&text("fine"))) / of(&scene);
    scene.view.frames = 0;
    scene
}

fn model(scene: &Scene) -> Model {
    Model::new(scene, 0).unwrap_or_else(|e| panic!("{e}"))
}

fn arrays(model: &Model) -> &Arrays<f64> {
    let Kind::Tetrahedra(tetrahedra) = &model.kind else { panic!("tetrahedra") };
    &tetrahedra.arrays
}

fn forces(a: &Arrays<f64>, u: &[V4<f64>], corotational: bool) -> Vec<V4<f64>> {
    let rotations = a.rotations(u, corotational);
    let mut f = vec![[0.0; 4]; u.len()];
    a.forces(u, &rotations, &mut f, &mut a.scratch());
    f
}

fn field(model: &Model, of: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<V4<f64>> {
    model.rest.iter().map(|x| V3::of(of(*x)).pad(0.0)).collect()
}

/// Displacements of 1 % of the size that repeat nowhere.
fn wavy(model: &Model) -> Vec<V4<f64>> {
    let size = model.extent();
    let wave = |x: f64, y: f64| 0.01 * size * (3.0 * x / size + 1.7 * y / size).sin();
    field(model, |[x, y, z]| [wave(x, y), wave(y + z, x), wave(z, x - y)])
}

fn scale(f: &[V4<f64>]) -> f64 {
    f.iter().flatten().fold(0.0, |m: f64, c| m.max(c.abs()))
}

fn dot(a: &[V4<f64>], b: &[V4<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| V3::from4(*a).dot(V3::from4(*b))).sum()
}

const ELEMENTS: [Element; 2] = [Tetra, PlainTetra];

#[test]
fn an_irregular_mesh_passes_the_patch_test() {
    for (element, corotational) in ELEMENTS.into_iter().flat_map(|e| [(e, false), (e, true)]) {
        let mut scene = skin("coarse", element);
        scene.skins[0].law = Law::Fem { element, corotational };
        let model = model(&scene);
        let outside = &model.grid.unstructured.as_ref().expect("a mesh").outside.faces;
        let mut inner = vec![true; model.rest.len()];
        outside.iter().flat_map(|face| face.corners().to_vec()).for_each(|node| inner[node as usize] = false);
        assert!(inner.contains(&true), "the coarse mesh has inner nodes");
        let of = |u: &[V4<f64>]| {
            let f = forces(arrays(&model), u, corotational);
            let own: Vec<V4<f64>> = f.iter().zip(&inner).filter(|(_, inner)| **inner).map(|(f, _)| *f).collect();
            scale(&own) / scale(&f)
        };
        let g = [V3::new(0.01, 0.003, 0.0), V3::new(-0.002, 0.02, 0.004), V3::new(0.001, 0.0, -0.015)];
        let found = of(&field(&model, |x| g.map(|row| row.dot(V3::of(x)))));
        assert!(found < 1e-11, "{element:?} corotational {corotational}: {found:e}");
        // the counter-test: a strain that is not constant
        assert!(of(&wavy(&model)) > 1e-3);
    }
}

#[test]
fn rigid_motion_gives_no_force_on_an_irregular_mesh() {
    let r = rotation_matrix([0.48, -0.36, 0.0, 0.8]);
    for element in ELEMENTS {
        let model = model(&skin("coarse", element));
        let rigid = field(&model, |x| (r * V3::of(x) - V3::of(x) + V3::new(1e-3, -2e-3, 5e-3)).f64());
        let strained = scale(&forces(arrays(&model), &wavy(&model), true));
        let found = scale(&forces(arrays(&model), &rigid, true)) / strained;
        assert!(found < 1e-9, "{element:?}: {found:e}");
        assert!(arrays(&model).energy(&rigid, true) < 1e-15 * arrays(&model).energy(&wavy(&model), true));
        // the counter-test: small strains resist a rotation
        assert!(scale(&forces(arrays(&model), &rigid, false)) > strained);
    }
}

#[test]
fn virtual_work_of_an_irregular_mesh_is_the_change_of_energy() {
    for element in ELEMENTS {
        let model = model(&skin("coarse", element));
        let (a, u) = (arrays(&model), wavy(&model));
        let v = field(&model, |[x, y, z]| [1e-4 * (900.0 * y).sin(), 1e-4 * (700.0 * z).cos(), 0.03 * x]);
        // small strains: reciprocal, and the energy is half of the work
        let [ku, kv] = [&u, &v].map(|u| forces(a, u, false));
        let (forth, back) = (dot(&ku, &v), dot(&kv, &u));
        assert!((forth / back - 1.0).abs() < 1e-9, "{element:?}: {forth:e} {back:e}");
        assert!((0.5 * dot(&ku, &u) / a.energy(&u, false) - 1.0).abs() < 1e-10);
        // corotational: the volume's rotations are held in the forces, of second order in strains of 3 %
        let moved = |by: f64| u.iter().zip(&v).map(|(u, v)| [0, 1, 2, 3].map(|n| u[n] + by * v[n])).collect::<Vec<_>>();
        let slope = (a.energy(&moved(1e-4), true) - a.energy(&moved(-1e-4), true)) / 2e-4;
        let work = dot(&forces(a, &u, true), &v);
        assert!((slope / work - 1.0).abs() < 3e-2, "{element:?}: {slope:e} {work:e}");
    }
}

#[test]
fn masses_volumes_and_areas_are_those_of_the_box() {
    let scene = skin("coarse", Tetra);
    let model = model(&scene);
    let of = model.grid.unstructured.as_ref().expect("a mesh");
    let volume = 20e-3 * 20e-3 * 2.3e-3;
    let sums = [model.dofs.iter().map(|f| f[3]).sum::<f64>() / 1116.0, of.around.iter().sum()];
    assert!(sums.iter().all(|sum| (sum / volume - 1.0).abs() < 1e-12), "{sums:?}");
    // a stretch by 1 %, 2 % and 3 % along the axes
    let stretched = field(&model, |[x, y, z]| [0.01 * x, 0.02 * y, 0.03 * z]);
    let [rest, change] = Wound::new(&model).volume(&model, &stretched);
    assert!((rest / volume - 1.0).abs() < 1e-12 && (change / volume - (1.01 * 1.02 * 1.03 - 1.0)).abs() < 1e-13);
    // outward normals: a closed surface of the box's area
    let surface = Surface::new(&model.grid);
    let edges = surface.edges();
    assert!(edges.open == 0 && edges.nonmanifold == 0, "{edges:?}");
    let (mut sum, mut area, mut inward) = (DVec3::ZERO, 0.0, 0);
    for face in surface.all() {
        let [a, b, c] = [0, 1, 2].map(|k| DVec3::from(model.rest[face.nodes[k] as usize]));
        let normal = 0.5 * (b - a).cross(c - a);
        let centre = DVec3::new(0.0, 0.0, 1.15e-3);
        inward += usize::from(normal.dot((a + b + c) / 3.0 - centre) <= 0.0);
        (sum, area) = (sum + normal, area + normal.length());
    }
    let wanted = 2.0 * (20e-3 * 20e-3) + 4.0 * 20e-3 * 2.3e-3;
    assert!(sum.length() < 1e-12 * area && (area / wanted - 1.0).abs() < 1e-9 && inward == 0, "{area} {inward}");
}

/// A block of bonded layers of tetrahedra in a grid, pulled at a corner of its top.
fn block() -> Scene {
    let layers = [(2, 1.2e-3, 50e3, 0.45, 1000.0), (1, 1.0e-3, 200e3, 0.3, 1100.0)];
    let mut scene = small::block([8e-3, 6e-3], [4, 3], &layers);
    scene.boundaries = vec![small::held(Region::Bottom, [true; 3])];
    scene.solver.preconditioner = Preconditioner::Block;
    (scene.solver.tolerance, scene.solver.floor) = (1e-12, 0.0);
    let kind = LoadKind::PointForce { force: [2e-3, -1e-3, 4e-3], at: [4e-3, 3e-3, 2.2e-3] };
    scene.loads = vec![Load { body: 0, region: Region::All, kind, start: 0.0, end: f64::INFINITY }];
    let skin = &mut scene.skins[0];
    // the shares of the nodes in a cell's mass differ from those in its tetrahedra's
    (skin.law, skin.mass) = (Law::Fem { element: Tetra, corotational: true }, Mass::Uniform);
    scene
}

/// The same tetrahedra as a mesh.
fn as_mesh(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    let skin = &mut scene.skins[0];
    let grid = Grid::new(skin);
    let (tetrahedra, layers): (Vec<_>, Vec<_>) =
        grid.tetrahedra().into_iter().map(|(corners, layer)| (corners, layer as u32)).unzip();
    let nodes = (0..grid.node_count()).map(|node| grid.rest(node)).collect();
    let mesh = TetrahedralMesh::new(nodes, tetrahedra, layers).unwrap_or_else(|e| panic!("{e}"));
    (skin.size, skin.cells, skin.cut) = ([mesh.size()[0], mesh.size()[1]], [0; 2], Cut::Remove);
    skin.layers.iter_mut().for_each(|layer| (layer.thickness, layer.cells) = (0.0, 0));
    skin.mesh = Some(Arc::new(mesh));
    scene
}

fn simulation(scene: &Scene) -> Simulation {
    Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"))
}

fn steps(simulation: &mut Simulation, count: u32) {
    (0..count).for_each(|_| drop(simulation.step(false).expect("the CPU path has no device to fail")));
}

/// `[node]` displacements after some steps, m.
fn moved(scene: &Scene) -> Vec<V4<f64>> {
    let mut simulation = simulation(scene);
    steps(&mut simulation, 12);
    simulation.bodies[0].snapshot().expect("it has a state").u
}

#[test]
fn the_same_tetrahedra_in_a_grid_and_as_a_mesh_move_alike() {
    let grid = block();
    let (a, b) = (moved(&grid), moved(&as_mesh(&grid)));
    let off = a.iter().zip(&b).flat_map(|(a, b)| (0..3).map(move |n| (a[n] - b[n]).abs())).fold(0.0, f64::max);
    assert!(a.len() == b.len() && off <= 1e-12 * scale(&a), "{off:e} of {:e}", scale(&a));
    // the counter-test: other elements
    let mut plain = as_mesh(&grid);
    plain.skins[0].law = Law::Fem { element: PlainTetra, corotational: true };
    let c = moved(&plain);
    let off = a.iter().zip(&c).map(|(a, c)| (a[2] - c[2]).abs()).fold(0.0, f64::max);
    assert!(off > 1e-2 * scale(&a), "{off:e}");
}

#[test]
fn preconditioners_of_a_mesh_give_one_answer() {
    let mut scene = as_mesh(&block());
    use Preconditioner::{Block, Jacobi, Multigrid, None};
    let answers = [None, Jacobi, Block, Multigrid].map(|preconditioner| {
        scene.solver.preconditioner = preconditioner;
        moved(&scene)
    });
    for other in &answers[1..] {
        let off = answers[0].iter().zip(other).map(|(a, b)| (a[2] - b[2]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9 * scale(other), "{off:e}");
    }
}

/// Iterations of one static step of the skin under its weight, held by rest-shape springs.
fn iterations(preconditioner: Preconditioner) -> u32 {
    let mut scene = skin("fine", Tetra);
    scene.tools.clear();
    scene.contact = None;
    scene.probes.clear();
    scene.time.integrator = Integrator::Static;
    (scene.solver.preconditioner, scene.solver.tolerance) = (preconditioner, 1e-6);
    let report = simulation(&scene).step(true).unwrap_or_else(|e| panic!("{e}"));
    report.free.iterations
}

#[test]
fn multigrid_of_a_grid_over_a_mesh_takes_fewer_iterations() {
    let [blocks, multigrid] = [Preconditioner::Block, Preconditioner::Multigrid].map(iterations);
    println!("{blocks} by node blocks, {multigrid} by multigrid");
    assert!(3 * multigrid < 2 * blocks, "{blocks} by node blocks, {multigrid} by multigrid");
}

#[test]
fn faces_near_a_box_are_found_and_none_of_the_inside_is_without_one() {
    let scene = skin("coarse", Tetra);
    let model = model(&scene);
    let of = model.grid.unstructured.as_ref().expect("a mesh");
    let surface = Surface::new(&model.grid);
    let u = wavy(&model);
    let mut boxes = Boxes::new(&surface);
    let mut backend = {
        let needs = Needs { contact: true, ..cutis::step::needs(&scene, &model) };
        let start = cutis::backend::Snapshot { u: u.clone(), ..cutis::step::start(&scene, &model) };
        on_cpu(false, &model, needs, 100, 0.0, &start)
    };
    let query = cutis::backend::Query { bounds: true, ..Default::default() };
    let bounds = backend.read(&query).expect("the CPU path has no device to fail").bounds;
    assert_eq!(boxes.refit(&surface, &bounds), 0);
    let at = |id: u32| DVec3::from(model.rest[id as usize]) + DVec3::from([0, 1, 2].map(|n| u[id as usize][n]));
    let area = |centre: DVec3, half: f64| cutis::collide::area(centre, centre, half);
    let mut fewer = 0;
    for corners in of.mesh.tetrahedra() {
        let centre = corners.iter().map(|id| at(*id)).sum::<DVec3>() * 0.25;
        let near = area(centre, 1e-9);
        let found = boxes.faces(&surface, &near);
        // what has sunk to the middle of a tetrahedron is behind a face
        assert!(!found.is_empty(), "{centre}");
        fewer += usize::from(2 * found.len() < of.outside.faces.len());
        let meets = |face: &&Face| {
            let [a, b, c] = [0, 1, 2].map(|k| at(face.nodes[k]));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            (0..3).all(|n| low[n] <= centre[n] + 5e-4 && high[n] >= centre[n] - 5e-4)
        };
        let wide = boxes.faces(&surface, &area(centre, 5e-4));
        assert!(of.outside.faces.iter().filter(meets).all(|face| wide.contains(face)));
    }
    // the counter-test: the search leaves faces out
    assert!(10 * fewer > 9 * of.mesh.tetrahedra().len(), "{fewer}");
}

#[test]
fn loads_on_groups_of_triangles_have_their_resultants() {
    let scene = skin("middle", Tetra);
    let model = model(&scene);
    let group = |name: &str| {
        let found = scene.skins[0].mesh.as_ref().expect("a mesh").groups().iter().find(|group| group.name() == name);
        Region::Group(found.unwrap_or_else(|| panic!("no {name}")).clone())
    };
    let of = |region: Region, kind| vec![Load { body: 0, region, kind, start: 0.0, end: f64::INFINITY }];
    let sum = |loads: &[[f64; 3]]| loads.iter().map(|f| DVec3::from(*f)).sum::<DVec3>();
    let pressed = |follower| LoadKind::Pressure { pressure: 1e4, follower };
    let top = sum(&model.load_at(&of(group("top"), pressed(false)), 0.0));
    assert!((top - DVec3::new(0.0, 0.0, -1e4 * 4e-4)).length() < 1e-12, "{top}");
    // a box region has the same triangles
    let at_top = Region::Box { min: [-10e-3, -10e-3, 2.3e-3], max: [10e-3, 10e-3, 2.3e-3] };
    assert_eq!(sum(&model.load_at(&of(at_top, LoadKind::Traction([0.0, 0.0, -1e4])), 0.0)), top);
    let force = sum(&model.load_at(&of(group("sides"), LoadKind::Force([1.0, 2.0, -3.0])), 0.0));
    assert!((force - DVec3::new(1.0, 2.0, -3.0)).length() < 1e-12, "{force}");
    // a follower on all of a deformed surface has no resultant; a dead one has none at rest alone
    let u = wavy(&model);
    let at = |node: usize| [0, 1, 2].map(|n| u[node][n]);
    let uncut = |e: usize| {
        let [a, b, c, d] = scene.skins[0].mesh.as_ref().expect("a mesh").tetrahedra()[e].map(|id| id as usize);
        [a, b, c, d, a, b, c, d]
    };
    let closed = sum(&model.load_on(&of(Region::All, pressed(true)), 0.0, uncut, at));
    assert!(closed.length() < 1e-12, "{closed}");
    let open = sum(&model.load_on(&of(group("top"), pressed(true)), 0.0, uncut, at));
    assert!((open - top).length() > 1e-3, "the counter-test: it follows the surface");
    // a force at a point has its moment too
    let kind = LoadKind::PointForce { force: [1.0, -2.0, 0.5], at: [2.1e-3, -3.3e-3, 1.7e-3] };
    let loads = model.load_at(&of(Region::All, kind), 0.0);
    let moment = |(f, x): (&[f64; 3], &[f64; 3])| DVec3::from(*x).cross(DVec3::from(*f));
    let wanted = DVec3::new(2.1e-3, -3.3e-3, 1.7e-3).cross(DVec3::new(1.0, -2.0, 0.5));
    assert!((loads.iter().zip(&model.rest).map(moment).sum::<DVec3>() - wanted).length() < 1e-15);
}

#[test]
fn loads_on_parts_of_triangles_have_the_area_and_the_moment_of_their_region() {
    let model = model(&skin("fine", Tetra));
    let kind = LoadKind::Traction([0.0, 0.0, -1e4]);
    let of = |region: Region| {
        let load = Load { body: 0, region, kind, start: 0.0, end: f64::INFINITY };
        let loads = model.load_at(&[load], 0.0);
        let moment = |(f, x): (&[f64; 3], &[f64; 3])| DVec3::from(*x).cross(DVec3::from(*f));
        let force = loads.iter().map(|f| DVec3::from(*f)).sum::<DVec3>();
        (force, loads.iter().zip(&model.rest).map(moment).sum::<DVec3>())
    };
    let top = 2.3e-3;
    for half in [0.2e-3, 1.5e-3, 2.5e-3, 4.1e-3] {
        let region = Region::Box { min: [-half, -0.5 * half, top], max: [2.0 * half, half, top] };
        let (force, moment) = of(region);
        let wanted = DVec3::new(0.0, 0.0, -1e4 * 4.5 * half * half);
        let about = DVec3::new(0.5 * half, 0.25 * half, top).cross(wanted);
        assert!((force - wanted).length() < 1e-9 * wanted.length(), "{half} m: {force} for {wanted} N");
        assert!((moment - about).length() < 1e-9 * wanted.length() * half, "{half} m: {moment} for {about} N·m");
    }
    let ball = |z| Region::Sphere { centre: [0.5e-3, -1e-3, z], radius: 2e-3 };
    let disc = std::f64::consts::PI * 4e-6 * 1e4;
    assert!((of(ball(top)).0.z / -disc - 1.0).abs() < 0.01, "{} for {disc} N", of(ball(top)).0);
    // the counter-test: a region in the flesh has no surface
    assert_eq!(of(Region::Box { min: [-1e-3, -1e-3, 1e-3], max: [1e-3, 1e-3, 1.2e-3] }).0, DVec3::ZERO);
}

/// Force on the probe at the end, N: bricks of mean dilatation on 40 × 40 × 9 cells, with as much rest-shape stiffness under them and up to
/// 1000 contacts (16 × 16 × 4 cells have 0.3401 N, 24 × 24 × 6 have 0.3394 N).
const BRICKS: f64 = 0.3433;

/// Force on the probe and mean displacement of the top at the end of the scene.
fn pressed(scene: &Scene, platform: &Platform) -> [f64; 2] {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let mut last = [0.0; 2];
    for _ in 0..scene.time.steps() {
        let report = simulation.step(true).expect("the CPU path has no device to fail");
        // the small-strain law is used beyond its range under the ball's edge
        let others = report.warnings.keys().filter(|key| **key != "strain_beyond_law").count();
        assert_eq!(others, 0, "at {} s: {:?}", report.time, report.warnings);
        last = [report.probes[2], report.probes[1]];
    }
    last
}

#[test]
fn the_pressed_skin_of_tetrahedra_nears_the_bricks_and_plain_ones_lock() {
    let of = |size, element| pressed(&skin(size, element), &Platform::Cpu64)[0] / BRICKS - 1.0;
    let [coarse, middle, fine] = ["coarse", "middle", "fine"].map(|size| of(size, Tetra));
    let plain = of("fine", PlainTetra);
    println!("error of the force: smoothed {coarse:.3}, {middle:.3}, {fine:.3}; plain, fine {plain:.3}");
    assert!(coarse.abs() < 0.30 && middle.abs() < 0.14 && fine.abs() < 0.05, "{coarse} {middle} {fine}");
    assert!(fine.abs() < middle.abs() && middle.abs() < coarse.abs());
    // the counter-test
    assert!(plain > 0.3, "{plain}");
    let single = pressed(&skin("middle", Tetra), &Platform::Cpu32)[0] / BRICKS - 1.0;
    assert!((single - middle).abs() < 5e-3, "{single} in f32, {middle}");
}

#[test]
fn a_skin_of_a_mesh_goes_on_from_its_state_on_any_number_of_threads() {
    let scene = skin("middle", Tetra);
    let bytes = |simulation: &mut Simulation| {
        postcard::to_allocvec(&simulation.state().expect("it has a state")).expect("it can be written")
    };
    let within = |threads: usize, count: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads can be had");
        pool.install(|| {
            let mut simulation = simulation(&scene);
            steps(&mut simulation, count);
            (bytes(&mut simulation), simulation.state().expect("it has a state"))
        })
    };
    let ([whole, others], (_, half)) = ([within(1, 30).0, within(3, 30).0], within(3, 20));
    assert_eq!(whole, others, "threads");
    let mut rest = simulation(&scene);
    rest.restore(&half).expect("the same scene");
    assert_ne!(whole, bytes(&mut rest), "the counter-test");
    steps(&mut rest, 10);
    assert_eq!(whole, bytes(&mut rest), "restored");
}

#[test]
fn a_free_mesh_rests_on_a_wall_with_its_weight() {
    let mut scene = skin("coarse", Tetra);
    (scene.rest_springs, scene.tools, scene.probes) = (vec![], vec![], vec![]);
    scene.planes = vec![Plane { name: "table".into(), through: [0.0; 3], normal: [0.0, 0.0, 1.0] }];
    scene.solver.tolerance = 1e-5;
    if let Some(contact) = &mut scene.contact {
        contact.max_contacts = 200;
    }
    let weight = 9.81 * model(&scene).dofs.iter().map(|f| f[3]).sum::<f64>();
    let mut simulation = simulation(&scene);
    let mut pushed = 0.0;
    for _ in 0..20 {
        let report = simulation.step(true).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
        pushed = report.contact.force(BodyId::Deformable(0), None)[2];
    }
    assert!((pushed / weight - 1.0).abs() < 0.02, "{pushed} N of {weight} N");
}

#[test]
fn probes_of_a_mesh_have_its_volume_and_shares() {
    let mut scene = skin("coarse", Tetra);
    (scene.rest_springs, scene.tools, scene.contact) = (vec![], vec![], None);
    scene.time.gravity = [0.0; 3];
    scene.skins[0].displacement = [1e-3, 2e-3, -3e-3];
    scene.probes.truncate(2);
    scene.probes[0].kind = ProbeKind::Volume { body: 0 };
    scene.probes[1].kind = ProbeKind::CentreOfMass { of: BodyId::Deformable(0), axis: 2 };
    let mut found = simulation(&scene);
    let probes = found.step(false).expect("the CPU path has no device to fail").probes;
    assert!((probes[0] / (20e-3 * 20e-3 * 2.3e-3) - 1.0).abs() < 1e-12, "{probes:?}");
    assert!((probes[1] - (1.15e-3 - 3e-3)).abs() < 2e-5, "{probes:?}");
    // of a region, by the volumes around its nodes, and of a point in a tetrahedron
    scene.probes[0].kind = ProbeKind::MeanDisplacement { body: 0, region: Region::Top, axis: 1 };
    scene.probes[1].kind = ProbeKind::Displacement { body: 0, point: [1.234e-3, -4.321e-3, 1.1e-3], axis: 2 };
    let mut found = simulation(&scene);
    let probes = found.step(false).expect("the CPU path has no device to fail").probes;
    assert!((probes[0] - 2e-3).abs() < 1e-12 && (probes[1] + 3e-3).abs() < 1e-12, "{probes:?}");
}

/// The skin in static steps without contact, and no probes.
fn still(element: Element) -> Scene {
    let mut scene = skin("coarse", element);
    (scene.rest_springs, scene.tools, scene.contact, scene.probes) = (vec![], vec![], None, vec![]);
    (scene.time.integrator, scene.solver.tolerance, scene.solver.max_iterations) = (Integrator::Static, 1e-13, 5000);
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.0, 0.0);
    scene.solver.floor = 1e-17;
    scene
}

fn probe(scene: &mut Scene, kind: ProbeKind) {
    scene.probes.push(Probe { name: format!("p{}", scene.probes.len()), kind });
}

/// Values of the probes after static steps.
fn probed(scene: &Scene, steps: usize) -> (Vec<f64>, Simulation) {
    let mut own = simulation(scene);
    let reports = (0..steps).map(|_| own.step(false).expect("the CPU path has no device to fail").probes);
    (reports.last().expect("there is a step"), own)
}

#[test]
fn a_uniform_field_of_an_irregular_mesh_has_its_exact_stress_and_strain() {
    const MOST: f64 = 1e-9;
    let (stretch, size) = (1.02, [20e-3, 20e-3, 2.3e-3]);
    for element in ELEMENTS {
        let mut scene = still(element);
        scene.time.gravity = [0.0; 3];
        let (young, poisson) = (scene.skins[0].layers[0].young, scene.skins[0].layers[0].poisson);
        // drawn along x, free across
        let plane = |through, normal| Region::Plane { through, normal, within: 1e-9 };
        let far = held(plane([10e-3, 0.0, 0.0], [1.0, 0.0, 0.0]), [true, false, false]);
        scene.boundaries = vec![
            held(plane([-10e-3, 0.0, 0.0], [1.0, 0.0, 0.0]), [true, false, false]),
            held(plane([0.0, -10e-3, 0.0], [0.0, 1.0, 0.0]), [false, true, false]),
            held(Region::Bottom, [false, false, true]),
            Boundary { displacement: [(stretch - 1.0) * size[0], 0.0, 0.0], ..far.clone() },
        ];
        // on a node inside, on the outside, in a tetrahedron
        let middle = model(&scene).grid.rest(121);
        for point in [middle, [0.0, 0.0, size[2]], [1.234e-3, -4.321e-3, 1.1e-3]] {
            for (_, component) in COMPONENTS {
                probe(&mut scene, ProbeKind::Stress { body: 0, point, component });
                if component != Component::VonMises {
                    probe(&mut scene, ProbeKind::Strain { body: 0, point, component });
                }
            }
        }
        probe(&mut scene, ProbeKind::Reaction { body: 0, region: far.region, axis: 0 });
        let (found, mut own) = probed(&scene, 4);
        let pull = young * (stretch - 1.0);
        let strain = |along: bool| {
            let by: f64 = if along { stretch } else { 1.0 - poisson * (stretch - 1.0) };
            0.5 * (by * by - 1.0)
        };
        for (kind, found) in scene.probes.iter().map(|probe| &probe.kind).zip(&found) {
            let (wanted, size) = match kind {
                ProbeKind::Stress { component: Component::VonMises | Component::Entry(0, 0), .. } => (pull, pull),
                ProbeKind::Stress { .. } => (0.0, pull),
                ProbeKind::Strain { component: Component::Entry(i, j), .. } if i == j => {
                    (strain(*i == 0), strain(true))
                }
                ProbeKind::Reaction { .. } => (pull * size[1] * size[2], pull * size[1] * size[2]),
                _ => (0.0, strain(true)),
            };
            assert!((found - wanted).abs() < MOST * size, "{element:?} {kind:?}: {found:e}, wanted {wanted:e}");
        }
        // the field saved for all of them, and the counter-test: what is bent has another stress at each place
        let saved = |own: &mut Simulation| {
            let state = own.snapshots().expect("no device to fail").remove(0);
            let body = &own.bodies[0];
            let all = body.model.mechanics().strains_and_stresses(&body.model, &body.wound, &state.u);
            all.into_iter().map(|[_, stress]| (stress.0[0].x / pull - 1.0).abs()).fold(0.0, f64::max)
        };
        let off = saved(&mut own);
        assert!(off < MOST, "{element:?}: {off:e}");
        scene.boundaries[3].rotation = 0.1;
        scene.boundaries[3].axes = [true; 3];
        assert!(saved(&mut probed(&scene, 4).1) > 0.1, "{element:?}");
    }
}

#[test]
fn held_nodes_of_a_mesh_bear_its_weight_and_load() {
    for element in ELEMENTS {
        let mut scene = still(element);
        scene.time.gravity = [1.5, -0.7, -9.81];
        scene.boundaries = vec![held(Region::Bottom, [true; 3])];
        scene.loads.push(Load::on_top(&scene.skins[0], 40.0, [-3e-3; 2], [4e-3; 2]));
        for region in [Region::Bottom, Region::Top] {
            (0..3).for_each(|axis| probe(&mut scene, ProbeKind::Reaction { body: 0, region: region.clone(), axis }));
        }
        let (found, own) = probed(&scene, 12);
        let body = &own.bodies[0];
        let mass: f64 = body.model.dofs.iter().map(|dofs| dofs[3]).sum();
        let corners = |cell| body.wound.surface.corners_of(cell);
        let load = body.model.load_on(&scene.loads, 0.0, corners, |_| [0.0; 3]);
        for axis in 0..3 {
            let borne = mass * scene.time.gravity[axis] + load.iter().map(|f| f[axis]).sum::<f64>();
            let error = (found[axis] + borne).abs() / (9.81 * mass);
            println!("{element:?} {axis}: {} N, wanted {} N, off by {error:e} of the weight", found[axis], -borne);
            assert!(error < 1e-9, "{element:?} {axis}: {error:e} of the weight");
            // the counter-test: nothing holds the top
            assert_eq!(found[3 + axis], 0.0);
        }
    }
}

#[test]
fn a_run_leaves_tetrahedra_for_paraview_and_a_picture() {
    let mut scene = skin("coarse", Tetra);
    scene.view.frames = 1;
    scene.time.duration = 0.1;
    let out = std::env::temp_dir().join(format!("cutis-meshes-{}", std::process::id()));
    let options = report::run::Options::new(Platform::Cpu64, &out);
    let report = report::run::run(&scene, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}")).report;
    assert_eq!((report.tets, report.hexes), (768, 0));
    let volume = formats::read(&out.join("vtu/volume_0001.vtu"), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((volume.points.len(), volume.tetrahedra.len()), (243, 768));
    assert!(volume.tetrahedra.iter().all(|nodes| volume.volume(nodes) > 0.0));
    let surface = formats::read(&out.join("vtu/surface_0001.vtu"), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(surface.triangles.len(), 2 * 2 * 8 * 8 + 4 * 2 * 8 * 2);
    assert!(out.join("frames/frame_0001.png").exists());
    std::fs::remove_dir_all(&out).expect("it is ours");
    // what it takes, without a device
    let plan = report::inspect::inspect(&scene).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((plan.nodes, plan.cells), (243, 768));
    let forces = plan.arrays.iter().find(|array| array.name == "tetrahedron_force").expect("it has forces");
    assert_eq!(forces.elements, 3 * 768 * plan.right_hand_sides as u64);
    assert!(plan.kernels.contains(&"tetrahedra_smoothed") && !plan.kernels.contains(&"tetrahedra_plain"));
    assert_eq!(plan.host_bytes, model(&scene).host_bytes());
}

/// A mesh file of two tetrahedra, `changed`, and what the reader says of the scene with it and with `keys` in place of its layer's.
fn said(change: impl Fn(&str) -> String, keys: &str) -> String {
    let mesh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 \"fat\"\n3 2 \"dermis\"\n$EndPhysicalNames\n\
                $Nodes\n5\n1 0 0 0\n2 4 0 0\n3 0 4 0\n4 0 0 3\n5 4 4 3\n$EndNodes\n\
                $Elements\n2\n1 4 2 1 1 1 2 3 4\n2 4 2 2 2 2 5 3 4\n$EndElements\n";
    let text =
        format!("title = \"Two\"\n[time]\nstep_ms = 5.0\nduration_s = 0.1\n[skin]\nmesh = \"two.msh\"\n{keys}\n");
    let files: &'static [(&'static str, &'static str)] =
        Box::leak(Box::new([("two.msh", &*Box::leak(change(mesh).into_boxed_str()))]));
    match parse(&text, Path::new("two.toml"), &Files::Embedded(files)) {
        Ok(scene) => match Simulation::new(&scene, &Platform::Cpu64) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        },
        Err(error) => error.to_string(),
    }
}

const LAYER: &str = "young_kpa = 100.0\npoisson = 0.45\ndensity_kg_m3 = 1000.0\n";

/// A change of a file.
fn of(from: &'static str, to: &'static str) -> impl Fn(&str) -> String {
    move |mesh| {
        assert!(mesh.contains(from), "{from}");
        mesh.replace(from, to)
    }
}

fn layers() -> String {
    format!("[[skin.layer]]\nname = \"fat\"\n{LAYER}[[skin.layer]]\nname = \"upper\"\ngroup = \"dermis\"\n{LAYER}")
}

#[test]
fn unfit_meshes_are_refused_with_what_to_do() {
    let all = layers();
    let one = all.split("[[skin.layer]]\nname = \"upper\"").next().expect("the first layer").to_string();
    assert_eq!(said(str::to_string, &all), "", "the two tetrahedra are sound");
    let cases: [(String, &str); 9] = [
        (
            said(of("4 2 1 1 1 2 3 4", "4 2 1 1 1 3 2 4"), &all),
            "1 of its tetrahedra are inverted … tetrahedron 0 … --mend",
        ),
        (said(of("4 0 0 3\n5", "4 4 4 0\n5"), &all), "1 of its tetrahedra are flat … optimise"),
        (said(of("$Nodes\n5", "$Nodes\n6\n6 1 1 1"), &all), "1 of its points are in no tetrahedron … --mend"),
        (said(of("2\n1 4 2 1 1 1 2 3 4\n2 4 2 2 2 2 5 3 4", "1\n1 2 2 1 1 1 2 3"), &all), "no tetrahedron … gmsh -3"),
        (
            said(of("\"dermis\"", "\"derma\""), &all),
            "no physical group … \"upper\" … \"fat\" (1), \"derma\" (2) … `group`",
        ),
        (said(of("4 2 2 2", "4 2 0 0"), &all), "no physical group … \"upper\""),
        (said(str::to_string, &one), "\"dermis\" (2) with 1 tetrahedra is no layer … add a layer"),
        (said(str::to_string, &all.replace("\"dermis\"", "\"fat\"")), "\"fat\" (1) is two layers"),
        (
            said(of("$Elements\n2\n", "$Elements\n4\n3 4 2 1 1 2 5 3 4\n4 4 2 2 2 2 5 3 4\n"), &all),
            "more than two tetrahedra … --mend",
        ),
    ];
    for (said, words) in cases {
        let mut rest = said.as_str();
        for part in words.split(" … ") {
            let Some(at) = rest.find(part) else { panic!("`{part}` is not in: {said}") };
            rest = &rest[at + part.len()..];
        }
        assert!(said.starts_with("two.toml:6: mesh names two.msh"), "{said}");
    }
    // a group without a name is asked for by its number, and tetrahedra without groups are of the only layer
    let numbered = of("2\n3 1 \"fat\"\n3 2 \"dermis\"", "1\n3 1 \"fat\"");
    assert_eq!(said(numbered, &all.replace("group = \"dermis\"", "group = \"2\"")), "");
    let bare = |mesh: &str| mesh.replace("4 2 1 1", "4 2 0 0").replace("4 2 2 2", "4 2 0 0");
    assert_eq!(said(bare, &format!("[[skin.layer]]\nname = \"all\"\n{LAYER}")), "");
}

#[test]
fn keys_that_do_not_go_with_a_mesh_are_refused() {
    let with = |keys: &str| said(str::to_string, &format!("{keys}\n{}", layers()));
    let after = |keys: &str| said(str::to_string, &format!("{}{keys}\n", layers()));
    for (said, words) in [
        (with("cells = [4, 4]"), "`cells` has no effect"),
        (with("size_mm = [4.0, 4.0]"), "`size_mm` has no effect"),
        (with("cut = \"split\"\ncut_reserve_columns = 0"), "cut_reserve_columns = 0"),
        (with("element = \"bbar\""), "tetra, plain_tetra"),
        (with("law = \"holzapfel\""), "corotational"),
        (with("mass = \"consistent\""), "or law = \"corotational\""),
        (with("law = \"corotational\"\nmass = \"consistent\""), "take \"lumped\""),
        (with("mesh_unit_mm = 0.0"), "mesh_unit_mm"),
        (after("thickness_mm = 1.0"), "`thickness_mm` has no effect"),
        (after("[test]\ncells = [4, 4]"), "`cells` has no effect"),
        (after("[study]\ngrids = [2]"), "a mesh is not refined"),
        (after("[solver]\npreconditioner = \"column\""), "preconditioner"),
        (after("[[boundary]]\nregion = \"group\"\ngroup = \"bottom\""), "fat, dermis"),
        (after("[[boundary]]\nregion = \"bottom\"\ngroup = \"fat\""), "region = \"group\""),
        (after("[[boundary]]\nregion = \"box\"\nbox_mm = [[9.0, 9.0, 9.0], [9.5, 9.5, 9.5]]"), "holds no node"),
        (
            after("[[probe]]\nname = \"p\"\nkind = \"displacement\"\npoint_mm = [1.9, 1.9, 0.1]"),
            "no tetrahedron of the mesh",
        ),
        (after("[[load]]\npressure_kpa = 1.0\nregion = \"side_x_max\""), "no face"),
    ] {
        assert!(said.contains(words), "`{words}` is not in: {said}");
    }
    // a grid has no groups
    let grid = format!(
        "title = \"A grid\"\n[time]\nstep_ms = 5.0\nduration_s = 0.1\n[skin]\nsize_mm = [4.0, 4.0]\ncells = [2, 2]\n\
         [[skin.layer]]\nname = \"a\"\nthickness_mm = 1.0\ncells = 1\n{LAYER}"
    );
    let of = |more: &str| {
        parse(&format!("{grid}{more}\n"), Path::new("grid.toml"), &Files::Embedded(&[]))
            .err()
            .unwrap_or_else(|| panic!("{more} is taken"))
            .to_string()
    };
    assert!(of("group = \"fat\"").contains("only a mesh has groups"));
    assert!(of("[[boundary]]\nregion = \"group\"\ngroup = \"fat\"").contains("a grid has no groups"));
}

#[test]
fn unfit_meshes_in_code_are_refused() {
    let nodes = vec![[0.0; 3], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3]];
    let of = |nodes: &[[f64; 3]], tetrahedra: &[[u32; 4]], layers: &[u32]| {
        TetrahedralMesh::new(nodes.to_vec(), tetrahedra.to_vec(), layers.to_vec()).err()
    };
    assert_eq!(of(&nodes, &[[0, 1, 2, 3]], &[0]), None);
    assert_eq!(of(&nodes, &[], &[]), Some(Defect::Empty));
    assert_eq!(of(&nodes, &[[0, 1, 2, 3]], &[]), Some(Defect::Layers));
    assert_eq!(of(&nodes, &[[0, 1, 2, 4]], &[0]), Some(Defect::Node(0)));
    assert_eq!(of(&[[f64::NAN; 3]; 4], &[[0, 1, 2, 3]], &[0]), Some(Defect::NonFinite(0)));
    // a body with more layers in its mesh than it has, or with a grid's size
    let mut scene = as_mesh(&block());
    scene.skins[0].layers.truncate(1);
    assert!(scene.check().is_err());
    let mut scene = as_mesh(&block());
    scene.skins[0].size = [1.0, 1.0];
    assert!(scene.check().is_err_and(|e| e.to_string().contains("that of the mesh")));
}
