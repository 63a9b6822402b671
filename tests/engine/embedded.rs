//! Closed surfaces embedded in a grid: volumes and masses, weights, a box that is a plain body, stretched and tilted bars, contact, restart.

use cutis::bodies::Model;
use cutis::math::random::Random;
use cutis::mesh::{MaterialPoint, Surface};
use cutis::scene::{
    BodyId, Boundary, ClosedSurface, Contact, Cut, Integrator, Law, Layer, Leak, Lines, Load, LoadKind, Material, Pose,
    Preconditioner, Probe, ProbeKind, Region, RestSpring, Round, Scene, Skin, Tool,
};
use cutis::step::{Platform, Simulation, StepReport};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Points and triangles of a box of `count` squares along each edge, outward.
fn cuboid(low: [f64; 3], high: [f64; 3], count: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut ids: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let (mut points, mut triangles) = (vec![], vec![]);
    for (axis, upper) in (0..3).flat_map(|axis| [(axis, false), (axis, true)]) {
        let [p, q] = [(axis + 1) % 3, (axis + 2) % 3];
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            let mut corner = |i: u32, j: u32| {
                let mut at = [0; 3];
                (at[axis], at[p], at[q]) = (if upper { count } else { 0 }, i, j);
                *ids.entry(at).or_insert_with(|| {
                    let share = at.map(|n| f64::from(n) / f64::from(count));
                    points.push([0, 1, 2].map(|n| low[n] + share[n] * (high[n] - low[n])));
                    points.len() as u32 - 1
                })
            };
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            match upper {
                true => triangles.extend([[a, b, c], [a, c, d]]),
                false => triangles.extend([[a, c, b], [a, d, c]]),
            }
        }
    }
    (points, triangles)
}

fn surface((points, triangles): (Vec<[f64; 3]>, Vec<[u32; 3]>)) -> Arc<ClosedSurface> {
    Arc::new(ClosedSurface::new(points, triangles).unwrap_or_else(|leak| panic!("{leak}")))
}

/// An ellipsoid of these half axes, m: a box blown up.
fn ellipsoid(half: [f64; 3], count: u32) -> Arc<ClosedSurface> {
    let (points, triangles) = cuboid([-1.0; 3], [1.0; 3], count);
    let round = |x: [f64; 3]| {
        let length = x.iter().map(|c| c * c).sum::<f64>().sqrt();
        [0, 1, 2].map(|n| half[n] * x[n] / length)
    };
    surface((points.into_iter().map(round).collect(), triangles))
}

const DENSITY: f64 = 1100.0;

/// A body of a surface in a grid of its own size, or of another one.
fn body(surface: &Arc<ClosedSurface>, [x, y, z]: [u32; 3], size: Option<[f64; 3]>) -> Skin {
    let size = size.unwrap_or(surface.size());
    let layer = Layer { thickness: size[2], cells: z, young: 50e3, poisson: 0.3, density: DENSITY, ..Layer::default() };
    Skin {
        size: [size[0], size[1]],
        cells: [x, y],
        layers: vec![layer],
        cut: Cut::Remove,
        law: Law::Hyperelastic(Material::NeoHookean),
        embedded: Some(surface.clone()),
        ..Skin::default()
    }
}

fn model(skin: Skin) -> Model {
    Model::new(&Scene { skins: vec![skin], ..Scene::default() }, 0).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_body_has_the_volume_mass_and_centre_of_its_surface() {
    let half = [4e-3, 3e-3, 2e-3];
    let surface = ellipsoid(half, 24);
    for cells in [4, 8, 16, 32] {
        let model = model(body(&surface, [cells, cells * 3 / 4, cells / 2], None));
        let embedded = model.grid.embedded.as_ref().expect("it is");
        let cell = model.shape[0][..3].iter().product::<f64>();
        let volume = embedded.share.iter().sum::<f64>() * cell;
        let mass: f64 = model.dofs.iter().map(|dofs| dofs[3]).sum();
        let moment = |n: usize| model.dofs.iter().zip(&model.rest).map(|(dofs, x)| dofs[3] * x[n]).sum::<f64>() / mass;
        let centre = [moment(0), moment(1), moment(2) - half[2]];
        let [apart, heavier] = [volume / surface.volume() - 1.0, mass / (DENSITY * surface.volume()) - 1.0];
        let off = centre.map(|c| c.abs()).into_iter().fold(0.0, f64::max) / half[2];
        println!("{cells} cells: volume {apart:.2e}, mass {heavier:.2e}, centre {off:.2e}");
        assert!(apart.abs() < 1e-6 && heavier.abs() < 1e-6 && off < 1e-6);
        // the counter-test: whole cells
        let whole = embedded.share.iter().filter(|share| **share > 0.0).count() as f64 * cell;
        assert!(whole / surface.volume() - 1.0 > 0.05, "{whole:e}");
    }
}

#[test]
fn a_box_aslant_has_its_volume_and_cavities_are_left_out() {
    // turned about all axes
    let (points, triangles) = cuboid([-3e-3, -2e-3, -1e-3], [3e-3, 2e-3, 1e-3], 3);
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 0.3);
    let turned = points.iter().map(|x| (turn * glam::DVec3::from(*x)).to_array()).collect();
    let aslant = surface((turned, triangles));
    assert!((aslant.volume() / 48e-9 - 1.0).abs() < 1e-12);
    let of = |surface: &Arc<ClosedSurface>, cells| {
        let model = model(body(surface, cells, None));
        model.grid.embedded.as_ref().expect("it is").share.iter().sum::<f64>()
            * model.shape[0][..3].iter().product::<f64>()
    };
    assert!((of(&aslant, [12, 10, 8]) / 48e-9 - 1.0).abs() < 1e-6, "{}", of(&aslant, [12, 10, 8]) / 48e-9);
    // a box in a box, turned inside out
    let (mut points, mut triangles) = cuboid([-3e-3; 3], [3e-3; 3], 2);
    let (inner, inside) = cuboid([-1.1e-3; 3], [1.1e-3; 3], 1);
    let first = points.len() as u32;
    points.extend(inner);
    triangles.extend(inside.iter().map(|[a, b, c]| [a + first, c + first, b + first]));
    let hollow = surface((points, triangles));
    let wanted = 6e-3f64.powi(3) - 2.2e-3f64.powi(3);
    assert!((hollow.volume() / wanted - 1.0).abs() < 1e-12);
    let found = of(&hollow, [10, 10, 10]);
    assert!((found / wanted - 1.0).abs() < 1e-11, "{found:e} of {wanted:e}");
}

#[test]
fn long_edges_are_halved_and_the_surface_stays_what_it_is() {
    let of = |id: &u32, points: &[[f64; 3]]| glam::DVec3::from(points[*id as usize]);
    for surface in [surface(cuboid([0.0; 3], [9e-3, 4e-3, 1e-3], 1)), ellipsoid([4e-3, 3e-3, 2e-3], 3)] {
        let fine = surface.refined(0.7e-3);
        let (points, triangles) = (fine.points(), fine.triangles());
        let edges = triangles.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
        let longest = edges.map(|[a, b]| of(a, points).distance(of(b, points))).fold(0.0, f64::max);
        assert!(longest <= 0.7e-3 && triangles.len() > 100, "{longest:e}, {}", triangles.len());
        // closed, of the same volume and size
        let again = ClosedSurface::new(points.to_vec(), triangles.to_vec()).unwrap_or_else(|leak| panic!("{leak}"));
        assert!((again.volume() / surface.volume() - 1.0).abs() < 1e-12 && fine.volume() == surface.volume());
        assert!(fine.refined(0.7e-3).triangles().len() == triangles.len() && fine.size() == surface.size());
    }
}

#[test]
fn a_surface_of_a_few_triangles_is_pressed_like_one_of_many() {
    // a plate on a ball's way and under a pressure on its top: two triangles there, or triangles like the cells
    let answers = |count: u32| {
        let plate = surface(cuboid([0.0; 3], [12e-3, 12e-3, 4e-3], count));
        let mut scene = block(body(&plate, [13, 13, 5], Some([13e-3, 13e-3, 5e-3])), Preconditioner::Multigrid);
        scene.time.integrator = Integrator::Static;
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        let kind = LoadKind::Pressure { pressure: 500.0, follower: false };
        let top = Region::Plane { through: [0.0, 0.0, 4e-3], normal: [0.0, 0.0, 1.0], within: 1e-6 };
        scene.loads.push(Load { body: 0, region: top, kind, start: 0.0, end: f64::INFINITY });
        scene.probes = [0.0, 3e-3].map(|x| displacement("u", [x, 0.0, 3e-3], 2)).to_vec();
        (run(&scene, &Platform::Cpu64, 1).probes, Model::new(&scene, 0).expect("it fits").grid.embedded.clone())
    };
    let ((few, coarse), (many, _)) = (answers(1), answers(12));
    println!("{few:?} {many:?}");
    // at the corners of the two alone the pressure would not reach the middle
    assert!(apart(&few, &many) < 0.005, "{few:?} {many:?}");
    assert!(many.iter().all(|u| *u < -1e-5), "{many:?}");
    // of the 12 triangles that it was
    assert!(coarse.expect("it is").outside.len() > 200);
}

#[test]
fn surfaces_with_a_hole_or_turned_triangles_are_refused() {
    let (points, triangles) = cuboid([0.0; 3], [1e-2; 3], 2);
    let leak = |triangles: Vec<[u32; 3]>| ClosedSurface::new(points.clone(), triangles).err();
    assert_eq!(leak(triangles.clone()), None);
    assert!(matches!(leak(triangles[1..].to_vec()), Some(Leak::Open(3, _))));
    let mut turned = triangles.clone();
    turned[0].swap(0, 1);
    assert!(matches!(leak(turned), Some(Leak::Open(3, _))));
    let inverted = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert_eq!(leak(inverted), Some(Leak::Inverted));
    assert_eq!(leak(vec![]), Some(Leak::Empty));
    assert_eq!(leak(vec![[0, 1, 999]]), Some(Leak::Point(0)));
    let far = ClosedSurface::new(points.iter().map(|x| x.map(|c| c * 1e300)).collect(), triangles.clone());
    assert_eq!(far, Err(Leak::NonFinite(1)));
}

#[test]
fn forces_on_the_surface_do_the_work_that_they_do_on_the_nodes() {
    let surface = ellipsoid([4e-3, 3e-3, 2e-3], 17);
    // a grid that the surface does not fill, so that some points lie in cells that are gone
    let model = model(body(&surface, [9, 8, 7], Some([8.9e-3, 7e-3, 4.3e-3])));
    let cut = Surface::new(&model.grid);
    let first = model.node_count() as u32;
    let mut random = Random::new(5);
    let count = model.node_count();
    let u: Vec<[f64; 3]> = (0..count).map(|_| [0, 1, 2].map(|_| random.signed())).collect();
    let at = |id: u32| cut.corner(id as usize).moved(|node| u[node as usize]);
    let (mut outside, mut inside, mut size, mut other) = (0.0, 0.0, 0.0, 0.0);
    for face in cut.all() {
        let [a, b, c, _] = face.nodes;
        let mut weights = [0, 1, 2].map(|_| 0.5 + 0.5 * random.signed());
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        let force: [f64; 3] = [0, 1, 2].map(|_| random.signed());
        let work = |moved: [f64; 3]| (0..3).map(|n| force[n] * moved[n]).sum::<f64>();
        outside += [a, b, c].iter().zip(weights).map(|(id, w)| w * work(at(*id))).sum::<f64>();
        let on_nodes = |point: MaterialPoint| {
            let point = model.on_nodes(point);
            assert!(
                point.nodes().all(|node| node < first)
                    && (point.0.iter().map(|p| p.1).sum::<f64>() - 1.0).abs() < 1e-12
            );
            point.0.iter().map(|(node, w)| w * work(u[*node as usize])).sum::<f64>()
        };
        inside += on_nodes(MaterialPoint::of([a, b, c], weights));
        other += on_nodes(MaterialPoint::node(a));
        size += outside.abs();
    }
    assert!((outside - inside).abs() < 1e-14 * size, "{outside} on the surface, {inside} on the nodes");
    // the counter-test: as if each force acted at a corner of its triangle
    assert!((outside - other).abs() > 1e-3 * outside.abs(), "{outside}, {other}");
    // a linear field arrives exactly, also beyond the cells
    let field = |x: [f64; 3]| [0.3 + 2.0 * x[0] - x[1], 4.0 * x[2] - 3.0 * x[1], x[0] + 0.5 * x[2]];
    for (k, x) in surface.points().iter().enumerate() {
        let moved = cut.corner(first as usize + k).moved(|node| field(model.grid.rest(node as usize)));
        let wanted = field(*x);
        assert!((0..3).all(|n| (moved[n] - wanted[n]).abs() < 1e-15), "{moved:?} for {wanted:?}");
    }
}

/// Runs a scene without a warning but this one; the last step's report.
fn run_with(scene: &Scene, platform: &Platform, steps: usize, warning: &str) -> StepReport {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let mut last = StepReport::default();
    for _ in 0..steps {
        last = simulation.step(true).unwrap_or_else(|e| panic!("{e}"));
        assert!(last.warnings.keys().all(|key| *key == warning), "{:?}", last.warnings);
    }
    last
}

fn run(scene: &Scene, platform: &Platform, steps: usize) -> StepReport {
    run_with(scene, platform, steps, "")
}

fn held(region: Region, axes: [bool; 3]) -> Boundary {
    Boundary { region, axes, ..Boundary::default() }
}

fn displacement(name: &str, point: [f64; 3], axis: usize) -> Probe {
    Probe { name: name.into(), kind: ProbeKind::Displacement { body: 0, point, axis } }
}

/// A block of 8 × 6 × 3 mm under gravity aslant, on the bottom's nodes.
fn block(skin: Skin, preconditioner: Preconditioner) -> Scene {
    let mut scene = Scene { skins: vec![skin], ..Scene::default() };
    scene.boundaries.push(held(Region::Bottom, [true; 3]));
    scene.time.gravity = [3.0, -2.0, -9.81];
    scene.solver.preconditioner = preconditioner;
    (scene.solver.tolerance, scene.solver.floor) = (1e-10, 0.0);
    let top = [1e-3, 1.5e-3, 3e-3];
    scene.probes = (0..3).map(|axis| displacement("top", top, axis)).collect();
    let kinds = [
        ProbeKind::Volume { body: 0 },
        ProbeKind::CentreOfMass { of: BodyId::Deformable(0), axis: 0 },
        ProbeKind::Reaction { body: 0, region: Region::Bottom, axis: 2 },
        ProbeKind::Stress { body: 0, point: [1e-3, 1.5e-3, 1.5e-3], component: cutis::scene::Component::VonMises },
    ];
    scene.probes.extend(kinds.into_iter().map(|kind| Probe { name: "of".into(), kind }));
    scene
}

/// Largest relative difference.
fn apart(found: &[f64], wanted: &[f64]) -> f64 {
    found.iter().zip(wanted).map(|(a, b)| ((a - b) / b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_box_that_fills_its_grid_is_a_plain_body() {
    let size = [8e-3, 6e-3, 3e-3];
    let exact = surface(cuboid([0.0; 3], size, 5));
    let longer = surface(cuboid([0.0; 3], [8.5e-3, 6e-3, 3e-3], 5)); // half a cell
    // a grid with cells beyond the box on all sides but the bottom
    let wider = body(&exact, [10, 8, 4], Some([10e-3, 8e-3, 4e-3]));
    let own = body(&exact, [8, 6, 3], None);
    let plain = Skin { embedded: None, ..own.clone() };
    for preconditioner in
        [Preconditioner::Multigrid, Preconditioner::Column, Preconditioner::Block, Preconditioner::Direct]
    {
        for newton in [false, true] {
            let answers = |skin: &Skin| {
                let mut scene = block(skin.clone(), preconditioner);
                scene.solver.newton = newton;
                run(&scene, &Platform::Cpu64, 5).probes
            };
            let (wanted, found, within) = (answers(&plain), answers(&own), answers(&wider));
            let off = [apart(&found, &wanted), apart(&within, &wanted)];
            println!("{preconditioner:?}, Newton {newton}: {:.1e}, in a larger grid {:.1e}", off[0], off[1]);
            assert!(off[0] < 1e-9 && off[1] < 1e-8, "{found:?}, {within:?}, wanted {wanted:?}");
            // the counter-test
            let other = answers(&body(&longer, [10, 8, 4], Some([10e-3, 8e-3, 4e-3])));
            assert!(apart(&other, &wanted) > 1e-2, "{other:?}, {wanted:?}");
        }
    }
}

/// A static scene of one body without contact, by Newton's method.
fn balanced(skin: Skin) -> Scene {
    let mut scene = Scene { skins: vec![skin], ..Scene::default() };
    scene.time.integrator = Integrator::Static;
    scene.time.gravity = [0.0; 3];
    (scene.solver.tolerance, scene.solver.floor) = (1e-9, 0.0);
    scene
}

#[test]
fn a_bar_that_cuts_cells_lengthwise_has_the_stiffness_of_its_section() {
    // 4 × 4 mm in cells of 1 mm from −2.5 mm on: the outer ones are half inside, a quarter in the corners
    let (size, strain) = ([4e-3, 4e-3, 10e-3], 1e-5);
    let bar = |width: f64| surface(cuboid([0.0; 3], [width, width, size[2]], 3));
    let pulled = |surface: &Arc<ClosedSurface>| {
        let mut scene = balanced(body(surface, [5, 5, 10], Some([5e-3, 5e-3, size[2]])));
        scene.boundaries = vec![
            held(Region::Bottom, [false, false, true]),
            Boundary { displacement: [0.0, 0.0, strain * size[2]], ..held(Region::Top, [false, false, true]) },
            // against rigid motion, which nothing else hinders
            held(Region::Box { min: [-0.6e-3; 3], max: [0.6e-3; 3] }, [true, true, false]),
        ];
        let kind = ProbeKind::Reaction { body: 0, region: Region::Top, axis: 2 };
        scene.probes.push(Probe { name: "pull".into(), kind });
        run(&scene, &Platform::Cpu64, 1).probes[0]
    };
    let of = |width: f64| 50e3 * width * width * strain;
    let found = pulled(&bar(4e-3)) / of(4e-3) - 1.0;
    println!("bar along z: {found:.2e}");
    // the held points at the bottom hinder its contraction there
    assert!(found.abs() < 5e-3, "{found:e}");
    // the counter-test
    assert!(pulled(&bar(4.4e-3)) / of(4e-3) > 1.15);
}

#[test]
fn a_column_that_ends_within_a_cell_is_pressed_by_its_own_weight() {
    let height = 9.5e-3;
    let sunk = |height: f64| {
        let column = surface(cuboid([0.0; 3], [3e-3, 3e-3, height], 2));
        let mut skin = body(&column, [3, 3, 10], Some([3e-3, 3e-3, 10e-3]));
        skin.layers[0].poisson = 0.0;
        let mut scene = balanced(skin);
        scene.time.gravity = [0.0, 0.0, -9.81];
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        scene.probes.push(displacement("high", [0.0, 0.0, 9e-3], 2));
        run(&scene, &Platform::Cpu64, 1).probes[0]
    };
    let wanted = -DENSITY * 9.81 / 50e3 * (height * 9e-3 - 0.5 * 9e-3 * 9e-3);
    let found = sunk(height) / wanted - 1.0;
    println!("column: {found:.2e}");
    // strains of 2·10⁻³, of which the law is not linear
    assert!(found.abs() < 3e-3, "{found:e}");
    // the counter-test
    assert!((sunk(10e-3) / wanted - 1.0).abs() > 0.05);
}

/// Lengthening between two places on the axis of a bar of 3 × 3 × 12 mm that hangs aslant, against the closed form.
fn hanging(cells: f64, tilt: f64) -> f64 {
    let half = [1.5e-3, 1.5e-3, 6e-3];
    let (points, triangles) = cuboid(half.map(|c| -c), half, 4);
    let turn = glam::DQuat::from_rotation_y(tilt);
    let turned = points.iter().map(|x| (turn * glam::DVec3::from(*x)).to_array()).collect();
    let bar = surface((turned, triangles));
    let size = bar.size();
    let mut skin = body(&bar, size.map(|edge| (edge / 3e-3 * cells).round() as u32), None);
    skin.layers[0].young = 5e3; // of soft tissue, since it is short
    let mut scene = balanced(skin);
    let down = turn * glam::DVec3::NEG_Z;
    scene.time.gravity = (down * 1.0).to_array();
    let at = |along: f64| glam::DVec3::new(0.0, 0.0, 0.5 * size[2]) - down * along;
    // the upper end by its nodes
    let end = Region::Plane { through: at(7e-3).to_array(), normal: down.to_array(), within: 2e-3 };
    scene.boundaries.push(held(end, [true; 3]));
    let places = [1e-3, -5e-3];
    for along in places {
        scene.probes.extend((0..3).map(|axis| displacement("u", at(along).to_array(), axis)));
    }
    let u = run(&scene, &Platform::Cpu64, 1).probes;
    let along = |k: usize| down.dot(glam::DVec3::new(u[k], u[k + 1], u[k + 2]));
    let below = |s: f64| 6e-3 + s; // of the bar, m
    let wanted = DENSITY * 1.0 / 5e3 * 0.5 * (below(places[0]).powi(2) - below(places[1]).powi(2));
    (along(3) - along(0)) / wanted - 1.0
}

#[test]
fn a_bar_aslant_stretches_as_it_should() {
    let upright = hanging(4.0, 0.0);
    let aslant: Vec<f64> = [2.0, 4.0, 8.0].into_iter().map(|cells| hanging(cells, 0.5)).collect();
    println!("upright {upright:.2e}, aslant {aslant:?}");
    assert!(upright.abs() < 5e-3, "{upright:e}");
    for (found, bound) in aslant.iter().zip([0.2, 0.1, 0.05]) {
        assert!(found.abs() < bound, "{aslant:?}");
    }
    assert!(aslant[2].abs() < 0.6 * aslant[0].abs());
}

#[test]
fn a_beam_that_cuts_cells_in_half_bends_as_on_a_grid_of_its_own() {
    let size = [16e-3, 4e-3, 4e-3];
    let beam = surface(cuboid([0.0; 3], size, 4));
    let bent = |skin: Skin, middle: f64| {
        let mut scene = balanced(skin);
        scene.time.gravity = [0.0, 0.0, -1.0];
        scene.boundaries.push(held(Region::SideXMin, [true; 3]));
        scene.probes.push(displacement("end", [8e-3, 0.0, middle], 2));
        run(&scene, &Platform::Cpu64, 1).probes[0]
    };
    let mut all = vec![];
    for n in [1, 2, 4] {
        let edge = 1e-3 / f64::from(n);
        let plain = Skin { embedded: None, ..body(&beam, [16 * n, 4 * n, 4 * n], None) };
        // the beam stands on the bottom of its grid, so it is cut along y and at its top
        let height = 4e-3 * f64::from(4 * n + 1) / (f64::from(4 * n) + 0.5);
        let cut = body(&beam, [16 * n, 4 * n + 1, 4 * n + 1], Some([16e-3, 4e-3 + edge, height]));
        all.push(bent(cut, 2e-3) / bent(plain, 2e-3) - 1.0);
    }
    println!("beam: {all:?}");
    assert!(all[0].abs() < 0.25 && all[1].abs() < 0.1 && all[2].abs() < 0.05 && all[2].abs() < 0.4 * all[0].abs());
}

/// A pad: an ellipsoid of 16 × 12 × 8 mm that lies on rest-shape springs and is pressed by a ball.
fn pad(count: u32, cells: [u32; 3]) -> Scene {
    let half = [8e-3, 6e-3, 4e-3];
    let skin = body(&ellipsoid(half, count), cells, None);
    let mut scene = Scene { skins: vec![skin], ..Scene::default() };
    scene.solver.tolerance = 1e-6;
    let low = Region::Box { min: [-1.0, -1.0, 0.0], max: [1.0, 1.0, 1.5e-3] };
    scene.rest_springs.push(RestSpring { body: 0, region: low.clone(), stiffness: 2000.0 });
    let pose = |time, z| Pose { time, position: [1e-3, 0.5e-3, z], ..Pose::default() };
    scene.tools.push(Tool {
        name: "ball".into(),
        round: Some(Round { radius: 3e-3, ends: [[0.0; 3]; 2] }),
        trajectory: vec![pose(0.0, 11.1e-3), pose(0.1, 9.9e-3), pose(1.0, 9.9e-3)],
        ..Tool::default()
    });
    scene.contact = Some(Contact { friction: 0.3, max_contacts: 1000, alarm: 2e-4, ..Contact::default() });
    scene
        .probes
        .push(Probe { name: "on".into(), kind: ProbeKind::Force { on: BodyId::Rigid(0), from: None, axis: 2 } });
    scene.probes.push(displacement("low", [0.0, 0.0, 4e-3], 2));
    scene.probes.push(Probe { name: "held".into(), kind: ProbeKind::Reaction { body: 0, region: low, axis: 2 } });
    scene
}

#[test]
fn a_ball_presses_an_embedded_pad_and_its_support_bears_it() {
    let steps = 60;
    let double = run(&pad(16, [16, 12, 8]), &Platform::Cpu64, steps);
    let [force, low, support] = double.probes[..] else { panic!("three probes") };
    let count = 17 * 13 * 9; // nodes
    let nodes = || double.contact.contacts.iter().map(|contact| &contact.points[1]);
    assert!(nodes().all(|point| point.nodes().all(|node| node < count)) && nodes().any(|point| point.0.len() > 8));
    println!("force {force} N, middle {low} m, support {support} N, {} contacts", double.contact.contacts.len());
    let weight = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * 8e-3 * 6e-3 * 4e-3 * 9.81;
    assert!(force > 0.05 && low < -1e-4);
    // action is reaction; the ball has come to rest
    assert!((support / (force + weight) - 1.0).abs() < 0.02, "{support} of {}", force + weight);
    let single = run(&pad(16, [16, 12, 8]), &Platform::Cpu32, steps).probes;
    let off = apart(&single, &double.probes);
    println!("f32: {off:.1e}");
    // to which the contact is solved
    assert!(off < 1e-3);
}

#[test]
fn an_embedded_pad_goes_on_from_its_state() {
    let scene = pad(10, [8, 6, 4]);
    let steps = |simulation: &mut Simulation, count: u32| {
        (0..count).for_each(|_| drop(simulation.step(false).expect("the CPU path has no device to fail")));
    };
    let [mut whole, mut first, mut rest] =
        [(); 3].map(|()| Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}")));
    steps(&mut whole, 24);
    steps(&mut first, 16);
    rest.restore(&first.state().expect("it has a state")).expect("the same scene");
    steps(&mut rest, 8);
    let bytes = |simulation: &mut Simulation| {
        postcard::to_allocvec(&simulation.state().expect("it has a state")).expect("it can be written")
    };
    assert_eq!(bytes(&mut whole), bytes(&mut rest));
    assert_ne!(bytes(&mut whole), bytes(&mut first), "the counter-test");
}

/// A plain block and one embedded in a grid that it cuts in half at the sides and the top, pressed by a ball.
#[test]
fn a_ball_on_an_embedded_block_feels_the_block() {
    let size = [10e-3, 8e-3, 5e-3];
    let pressed = |skin: Skin| {
        let mut scene = pad(8, [4, 4, 4]);
        scene.skins = vec![skin];
        scene.rest_springs.clear();
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        scene.probes.truncate(1);
        let pose = |time, z| Pose { time, position: [0.0, 0.0, z], ..Pose::default() };
        scene.tools[0].trajectory = vec![pose(0.0, 11.05e-3), pose(0.08, 10.5e-3), pose(1.0, 10.5e-3)];
        scene.tools[0].round = Some(Round { radius: 6e-3, ends: [[0.0; 3]; 2] });
        scene.tools[0].coupling.stiffness = 2e4;
        // more rows than nodes, on either body
        run_with(&scene, &Platform::Cpu64, 20, "contact_not_converged").probes[0]
    };
    let block = |count| surface(cuboid([0.0; 3], size, count));
    let plain = |n: u32| pressed(Skin { embedded: None, ..body(&block(1), [10, 8, 5].map(|c| c * n), None) });
    let wanted = [1, 2].map(plain);
    let found = [1u32, 2].map(|n| {
        let edge = 1e-3 / f64::from(n);
        let beyond = [size[0] + edge, size[1] + edge, size[2] + 0.5 * edge];
        pressed(body(&block(4 + 5 * n), [10 * n + 1, 8 * n + 1, 5 * n + 1], Some(beyond)))
    });
    let off = [0, 1].map(|k| found[k] / wanted[k] - 1.0);
    println!("plain {wanted:?} N, embedded {found:?} N: {off:?}");
    // the contact is 1.4 and 2.8 cells in radius
    assert!(wanted[0] > 0.05 && off[0].abs() < 0.18 && off[1].abs() < 0.09 && off[1].abs() < 0.6 * off[0].abs());
}

/// A cushion: a box bent at its corners and its top.
fn cushion([x, y, z]: [f64; 3]) -> [f64; 3] {
    let low = 0.3 * (x * x + y * y - x * x * y * y);
    [8e-3 * x * (1.0 - 0.3 * y * y).sqrt(), 6e-3 * y * (1.0 - 0.3 * x * x).sqrt(), 8e-3 * z * (1.0 - low)]
}

#[test]
fn a_cushion_sags_like_its_tetrahedra() {
    // tetrahedra of a bent grid, small strains
    let bent = |n: u32| {
        let layer = Layer { thickness: 1.0, cells: 3 * n, ..Layer::default() };
        let raster =
            Skin { size: [2.0; 2], cells: [4 * n, 4 * n], layers: vec![layer], cut: Cut::Remove, ..Skin::default() };
        let grid = cutis::mesh::Grid::new(&raster);
        let points: Vec<[f64; 3]> = (0..grid.node_count()).map(|node| cushion(grid.rest(node))).collect();
        (points, grid.tetrahedra().into_iter().map(|(corners, _)| corners).collect::<Vec<_>>())
    };
    let sagged = |skin: Skin| {
        let mut scene = Scene { skins: vec![skin], ..Scene::default() };
        scene.time.integrator = Integrator::Static;
        scene.time.gravity = [1.0, -0.5, -1.0];
        (scene.solver.tolerance, scene.solver.floor) = (1e-9, 0.0);
        if scene.skins[0].embedded.is_none() {
            scene.solver.preconditioner = Preconditioner::Block;
        }
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        scene.probes = (0..3).map(|axis| displacement("u", [1e-3, 0.5e-3, 6.5e-3], axis)).collect();
        run(&scene, &Platform::Cpu64, 1).probes
    };
    let tetrahedra = |n: u32| {
        let (points, corners) = bent(n);
        let layers = vec![0; corners.len()];
        let mesh = cutis::scene::TetrahedralMesh::new(points, corners, layers).unwrap_or_else(|e| panic!("{e}"));
        let [x, y, _] = mesh.size();
        let layer = Layer { thickness: 0.0, cells: 0, young: 50e3, poisson: 0.3, density: DENSITY, ..Layer::default() };
        let law = Law::Fem { element: cutis::scene::Element::Tetra, corotational: true };
        sagged(Skin {
            size: [x, y],
            cells: [0; 2],
            layers: vec![layer],
            mesh: Some(Arc::new(mesh)),
            law,
            cut: Cut::Remove,
            ..Skin::default()
        })
    };
    let wanted = tetrahedra(6);
    let coarse = tetrahedra(3);
    // the boundary of the finest tetrahedra in grids of cells of 2, 1 and 2/3 mm
    let (points, corners) = bent(6);
    let mut faces: BTreeMap<[u32; 3], Vec<[u32; 3]>> = BTreeMap::new();
    for [a, b, c, d] in corners {
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut key = face;
            key.sort_unstable();
            faces.entry(key).or_default().push(face);
        }
    }
    let outside = faces.into_values().filter(|same| same.len() == 1).map(|same| same[0]).collect();
    let surface = surface((points, outside));
    let apart = |u: &[f64]| [0, 1, 2].map(|n| u[n] / wanted[n] - 1.0);
    let found = [1, 2, 3].map(|n| apart(&sagged(body(&surface, [8 * n, 6 * n, 4 * n], None))));
    println!("tetrahedra half as fine {:?}; embedded {found:?}", apart(&coarse));
    assert!(found[2].iter().all(|off| off.abs() < 0.03) && found[0].iter().all(|off| off.abs() < 0.1), "{found:?}");
}

#[test]
fn an_embedded_body_rests_on_a_wall_and_on_another_body() {
    let half = [4e-3, 3e-3, 2e-3];
    let mut pebble = body(&ellipsoid(half, 10), [8, 6, 4], None);
    (pebble.name, pebble.position) = ("pebble".into(), [0.2e-3, 0.1e-3, 0.0]);
    pebble.rayleigh_mass = 20.0;
    let weight = |simulation: &Simulation| simulation.bodies[0].wound.mass_of_nodes() * 9.81;
    let falls = |other: Option<Skin>| {
        let mut scene = Scene { skins: vec![pebble.clone()], ..Scene::default() };
        scene.contact = Some(Contact { friction: 0.3, max_contacts: 200, alarm: 2e-4, ..Contact::default() });
        let from = match other {
            None => {
                scene.planes.push(cutis::scene::Plane {
                    name: "floor".into(),
                    through: [0.0; 3],
                    normal: [0.0, 0.0, 1.0],
                });
                BodyId::Plane(0)
            }
            Some(block) => {
                scene.skins.push(block);
                scene.boundaries.push(Boundary { body: 1, ..held(Region::Bottom, [true; 3]) });
                BodyId::Deformable(1)
            }
        };
        let kind = ProbeKind::Force { on: BodyId::Deformable(0), from: Some(from), axis: 2 };
        scene.probes.push(Probe { name: "borne".into(), kind });
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        let mut last = StepReport::default();
        for _ in 0..120 {
            last = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        }
        last.probes[0] / weight(&simulation)
    };
    let layer = Layer { thickness: 3e-3, cells: 3, young: 50e3, poisson: 0.3, ..Layer::default() };
    let block = Skin { name: "block".into(), position: [0.0, 0.0, -3e-3], layers: vec![layer], ..Skin::default() };
    let borne = [falls(None), falls(Some(block))];
    println!("borne, of the weight: {borne:?}");
    assert!(borne.iter().all(|share| (share - 1.0).abs() < 0.1), "{borne:?}");
}

#[test]
fn what_a_surface_leaves_out_of_its_grid_is_refused() {
    let words =
        |scene: &Scene| Simulation::new(scene, &Platform::Cpu64).err().map(|e| e.to_string()).unwrap_or_default();
    let of = |skin: Skin| Scene { skins: vec![skin], ..Scene::default() };
    let round = ellipsoid([8e-3, 6e-3, 4e-3], 12);
    let sound = of(body(&round, [8, 6, 4], None));
    assert_eq!(words(&sound), "");
    // a sheet aslant, thinner than a cell; two balls joined by a thread, or apart within a cell
    let (points, triangles) = cuboid([-5e-3, -5e-3, -0.01e-3], [5e-3, 5e-3, 0.01e-3], 6);
    let turn = glam::DQuat::from_rotation_x(0.6);
    let sheet = surface((points.iter().map(|x| (turn * glam::DVec3::from(*x)).to_array()).collect(), triangles));
    let said = words(&of(body(&sheet, [4, 4, 4], None)));
    assert!(said.contains("use more cells"), "{said}");
    let (mut points, mut triangles) = cuboid([0.0; 3], [4e-3; 3], 4);
    let (more, others) = cuboid([4.2e-3, 0.0, 0.0], [8.2e-3, 4e-3, 4e-3], 4);
    let first = points.len() as u32;
    points.extend(more);
    triangles.extend(others.iter().map(|t| t.map(|id| id + first)));
    let twins = surface((points, triangles));
    let said = words(&of(body(&twins, [8, 4, 4], None)));
    assert!(said.contains("encloses 2 separate bodies") && said.contains("come in 1"), "{said}");
    assert_eq!(words(&of(body(&twins, [82, 8, 8], None))), "");
    // regions and points beside it
    let mut beside = sound.clone();
    beside.boundaries.push(held(Region::Box { min: [-8e-3, -6e-3, 0.0], max: [-7.9e-3, -5.9e-3, 0.1e-3] }, [true; 3]));
    assert!(words(&beside).contains("the region of boundary has no node"), "{}", words(&beside));
    let mut beside = sound.clone();
    beside.probes.push(displacement("corner", [7.9e-3, 5.9e-3, 0.1e-3], 0));
    assert!(
        words(&beside).contains("[7.9000, 5.9000, 0.1000] mm of the probe corner lies outside"),
        "{}",
        words(&beside)
    );
    // what `Scene::check` has for scenes in code
    for (change, wanted) in [
        ((|skin| skin.size = [1e-2; 2]) as fn(&mut Skin), "a box around `embedded`"),
        (|skin| skin.cut = Cut::Split { reserve_columns: 9 }, "is not cut"),
        (|skin| skin.mass = cutis::scene::Mass::Uniform, "lumped"),
        (|skin| skin.law = Law::Fem { element: cutis::scene::Element::Bbar, corotational: true }, "a hyperelastic one"),
    ] {
        let mut other = sound.clone();
        change(&mut other.skins[0]);
        assert!(words(&other).contains(wanted), "{}", words(&other));
    }
    let mut other = sound.clone();
    other.tools.push(Tool { blade: Some(cutis::scene::Blade::default()), round: None, ..Tool::default() });
    other.contact = Some(Contact::default());
    assert!(words(&other).contains("the blade of tool is not available"), "{}", words(&other));
    let mut other = sound;
    let region = Region::Bottom;
    other.probes.push(Probe { name: "under".into(), kind: ProbeKind::Pressure { body: 0, region } });
    other.contact = Some(Contact::default());
    assert!(words(&other).contains("the probe under of pressure is not available"), "{}", words(&other));
}

#[test]
fn loads_on_the_surface_have_its_area_and_a_pressure_all_around_presses_evenly() {
    let half = [4e-3, 3e-3, 2e-3];
    let surface = ellipsoid(half, 16);
    let pushed = |kind: LoadKind, follower_moves: f64| {
        let model = model(body(&surface, [8, 6, 4], None));
        let load = Load { body: 0, region: Region::All, kind, start: 0.0, end: 1.0 };
        let corners = |cell: usize| model.grid.params::<f64>().corners(cell);
        let moved = |node: usize| model.grid.rest(node).map(|x| follower_moves * x);
        let forces = model.load_on(&[load], 0.0, corners, moved);
        let total = [0, 1, 2].map(|n| forces.iter().map(|f| f[n]).sum::<f64>());
        // virial: 3 p V of a pressure
        let virial: f64 = forces.iter().zip(&model.rest).map(|(f, x)| (0..3).map(|n| f[n] * x[n]).sum::<f64>()).sum();
        (total, virial)
    };
    let area: f64 = surface
        .triangles()
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|id| glam::DVec3::from(surface.points()[id as usize]));
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let (total, _) = pushed(LoadKind::Traction([1.0, 0.0, -2.0]), 0.0);
    assert!((total[0] / area - 1.0).abs() < 1e-12 && (total[2] / area + 2.0).abs() < 1e-12, "{total:?}, {area}");
    for (follower, stretch) in [(false, 0.0), (true, 0.0), (true, 0.1)] {
        let (total, virial) = pushed(LoadKind::Pressure { pressure: 7.0, follower }, stretch);
        assert!(total.iter().all(|f| f.abs() < 1e-12 * area), "{total:?}");
        let wanted = -3.0 * 7.0 * surface.volume() * if follower { (1.0 + stretch).powi(2) } else { 1.0 };
        assert!((virial / wanted - 1.0).abs() < 1e-12, "{virial}, wanted {wanted}");
    }
    // a part of the surface
    let caps = |region: Region| {
        let model = model(body(&surface, [8, 6, 4], None));
        let kind = LoadKind::Pressure { pressure: 1.0, follower: false };
        model.load_at(&[Load { body: 0, region, kind, start: 0.0, end: 1.0 }], 0.0).iter().map(|f| f[2]).sum::<f64>()
    };
    let upper = caps(Region::Box { min: [-1.0, -1.0, half[2] - 1e-6], max: [1.0; 3] });
    let section = std::f64::consts::PI * half[0] * half[1];
    assert!((-upper / section - 1.0).abs() < 0.02, "{upper:e} of {section:e}");
    // volume under pressure all around: K = E/(3 (1 − 2 ν))
    let shrunk = |cells: [u32; 3]| {
        let mut scene = balanced(body(&surface, cells, None));
        let kind = LoadKind::Pressure { pressure: 10.0, follower: false };
        scene.loads.push(Load { body: 0, region: Region::All, kind, start: 0.0, end: f64::INFINITY });
        scene.boundaries.push(held(
            Region::Plane { through: [0.0; 3], normal: [1.0, 0.0, 0.0], within: 1e-9 },
            [true, false, false],
        ));
        scene.boundaries.push(held(
            Region::Plane { through: [0.0; 3], normal: [0.0, 1.0, 0.0], within: 1e-9 },
            [false, true, false],
        ));
        scene.boundaries.push(held(
            Region::Plane { through: [0.0, 0.0, half[2]], normal: [0.0, 0.0, 1.0], within: 1e-9 },
            [false, false, true],
        ));
        scene.probes.push(Probe { name: "change".into(), kind: ProbeKind::VolumeChange { body: 0 } });
        run(&scene, &Platform::Cpu64, 1).probes[0] * (50e3 / (3.0 * (1.0 - 0.6))) / -10.0
    };
    let found = [shrunk([8, 6, 4]), shrunk([16, 12, 8])];
    println!("volume change under pressure, of what it should be: {found:?}");
    assert!((found[0] - 1.0).abs() < 0.1 && (found[1] - 1.0).abs() < 0.05, "{found:?}");
}

#[test]
fn points_and_edges_of_tools_press_an_embedded_pad() {
    let pressed = |change: fn(&mut Tool)| {
        let mut scene = pad(12, [12, 9, 6]);
        let tool = &mut scene.tools[0];
        tool.round = None;
        tool.trajectory.iter_mut().for_each(|pose| pose.position[2] -= 3e-3);
        change(tool);
        let report = run_with(&scene, &Platform::Cpu64, 40, "contact_not_converged");
        let weight = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * 8e-3 * 6e-3 * 4e-3 * 9.81;
        (report.probes[0], report.probes[2] / (report.probes[0] + weight))
    };
    let tip = pressed(|tool| (tool.points, tool.tip_radius) = (vec![[0.0; 3]], 1.5e-3));
    let edge = pressed(|tool| {
        let positions = vec![[-3e-3, 0.0, 0.0], [3e-3, 0.0, 0.0]];
        tool.lines = Some(Lines { positions, segments: vec![[0, 1]], radius: 0.0 });
    });
    println!("tip {tip:?}, edge {edge:?}");
    for (force, borne) in [tip, edge] {
        assert!(force > 0.02 && (borne - 1.0).abs() < 0.03, "{force} N, {borne}");
    }
}

#[test]
fn a_block_hangs_on_an_embedded_body_and_that_on_a_group_of_its_mesh() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = r#"title = "Tied"
[time]
step_ms = 5
duration_s = 1
[skin]
mesh = "meshes/skin_coarse.msh"
embed = "bricks"
size_mm = [20.8, 20.8]
cells = [8, 8]
rayleigh_mass_per_s = 20.0
[[skin.layer]]
name = "skin"
cells = 3
young_kpa = 200
poisson = 0.45
density_kg_m3 = 1100
[[block]]
name = "block"
position_mm = [0.3, -0.2, -4.0]
size_mm = [6, 6]
cells = [3, 3]
rayleigh_mass_per_s = 20.0
[[block.layer]]
name = "block"
thickness_mm = 4
cells = 2
young_kpa = 200
poisson = 0.45
density_kg_m3 = 1100
[[boundary]]
body = "skin"
region = "group"
group = "top"
[[attach]]
body = "block"
region = "top"
to = "skin"
[[probe]]
name = "held"
kind = "reaction"
body = "skin"
region = "group"
group = "top"
axis = "z"
"#;
    let scene = cutis::scene::parse(text, std::path::Path::new("tied.toml"), &cutis::scene::Files::Folder(folder))
        .unwrap_or_else(|e| panic!("{e}"));
    // the upper nodes of the cells that the top goes along
    let model = Model::new(&scene, 0).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(model.nodes_in(&scene.boundaries[0].region).len(), 81);
    assert!(
        (model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>() / (1100.0 * 20e-3 * 20e-3 * 2.3e-3) - 1.0).abs() < 1e-9
    );
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let mut last = StepReport::default();
    for _ in 0..100 {
        last = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
    }
    let weight: f64 = simulation.bodies.iter().map(|body| body.wound.mass_of_nodes() * 9.81).sum();
    println!("held {:?} N of {weight} N", last.probes);
    assert!((last.probes[0] / weight - 1.0).abs() < 0.01, "{:?}, {weight}", last.probes);
}
