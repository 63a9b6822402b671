//! The lips of a wound do not pass through each other.

use crate::inside::inside;
use cutis::bodies::Model;
use cutis::collide::lips::{contacts, faces};
use cutis::kernels::cut::Hit;
use cutis::mesh::Surface;
use cutis::scene::{Files, Scene, parse};
use cutis::step::{Platform, Simulation};
use glam::DVec3;
use std::path::Path;

/// Skin that is drawn by so much, or pressed, on 12 × 12 cells, cut as the incision scene cuts.
fn incision(strain: f64) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml");
    let mut scene = cutis::scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    scene.skins[0].cells = [12, 12];
    scene.contact.as_mut().expect("it has a blade").lips = true;
    scene.skins[0].layers[1..].iter_mut().for_each(|layer| layer.pre_strain = [strain; 2]);
    scene
}

/// How far the lips part and overlap while the skin is cut and after, m.
fn cut(scene: &Scene) -> [f64; 2] {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
    let (mut widest, mut deepest, mut severed) = (0.0f64, 0.0f64, 0);
    for _ in 0..220 {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
        (widest, deepest, severed) =
            (widest.max(report.opening), deepest.max(report.overlap), severed + report.severed);
    }
    assert!(severed > 15, "{severed} links: there is hardly a wound");
    [widest, deepest]
}

#[test]
fn pressed_skin_closes_its_wound_and_no_further() {
    let [gape, none] = cut(&incision(0.08));
    let [_, overlap] = cut(&incision(-0.08));
    println!("drawn: {gape} m apart; pressed: {overlap} m through each other");
    assert!(gape > 2e-4 && none < 1e-8, "drawn skin gapes: {gape} m, overlap {none} m");
    assert!(overlap > 0.0 && overlap < 4e-3 * gape, "{overlap} m through each other, {gape} m apart when drawn");
}

/// How far the lips of a bar in two halves that are pushed against each other pass through, in the mean over their nodes, m.
fn pushed(lips: bool) -> f64 {
    let text = "title = \"halves\"\n[time]\nstep_ms = 5.0\nduration_s = 1.0\ngravity_m_s2 = [0, 0, 0]\n\
        [solver]\npreconditioner = \"multigrid\"\ntolerance = 1e-4\n\
        [skin]\nsize_mm = [8, 4]\ncells = [8, 4]\nrayleigh_mass_per_s = 1.0\nrayleigh_stiffness_s = 0.01\n\
        [[skin.layer]]\nname = \"bar\"\nthickness_mm = 3\ncells = 3\nyoung_kpa = 50\npoisson = 0.3\ndensity_kg_m3 = 1000\n\
        pre_strain = [-0.05, 0.0]\n[[boundary]]\nregion = \"sides_x\"\n\
        [[tool]]\nname = \"scalpel\"\nmesh = \"meshes/scalpel.obj\"\npath_mm = [[0, 0, 0, 1000]]\nmass_g = 20.0\n\
        inertia_g_mm2 = [4000, 6000, 4000]\n[tool.blade]\nedge_mm = [[-12, 0, -14], [-8, 0, -10]]\nthickness_mm = 0.4\n\
        [contact]\nalarm_mm = 0.2\nmax_contacts = 48\n";
    let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
    let mut scene = parse(text, Path::new("scenes/halves.toml"), &files).unwrap_or_else(|e| panic!("{e}"));
    scene.contact.as_mut().expect("it has a blade").lips = lips;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let params = simulation.bodies[0].model.grid.params::<f64>();
    let cells = (0..4).flat_map(|y| (0..3).map(move |z| [3, y, z]));
    let hits: Vec<Hit<f64>> = cells.map(|cell| Hit { segment: 3 * params.cell_id(cell) as u32, at: 0.5 }).collect();
    simulation.bodies[0].sever(&hits).expect("the CPU path has no device to fail");
    for _ in 0..40 {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
    }
    let u = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u;
    let lips = {
        let surface = &simulation.bodies[0].wound.surface;
        faces(&surface.parts, &surface.alive)
    };
    let mean = |side: usize| {
        let nodes = || lips.iter().skip(side).step_by(2).flat_map(|face| face.nodes);
        nodes().map(|node| u[node as usize][0]).sum::<f64>() / nodes().count() as f64
    };
    mean(0) - mean(1)
}

/// Two halves of a bar that is pressed bear on each other as if it were whole, and move as if it were: not at all.
#[test]
fn halves_that_are_pushed_together_bear_on_each_other() {
    let [with, without] = [true, false].map(pushed);
    println!("{with} m through each other, {without} m without contact");
    // each half, 4 mm long, is free to grow by 5 %
    assert!((without / 4e-4 - 1.0).abs() < 0.1, "{without} m instead of 0.4 mm");
    assert!(with.abs() < 1e-3 * without, "{with} m through each other, {without} m without contact");
}

/// A grid with `size` × `size` links cut across an axis, and the nodes beyond them moved: gaps, normals towards what moved, and how many of
/// the contacts are of nodes that moved.
fn parted(axis: usize, size: usize, motion: DVec3) -> (Vec<f64>, Vec<DVec3>, usize) {
    let scene = incision(0.0);
    let model = Model::new(&scene, 0).unwrap_or_else(|e| panic!("{e}"));
    let params = model.params();
    let mut surface = Surface::with_reserve(&model.grid, params);
    // a whole patch of links, so that the nodes inside of it come apart
    let at = |u: usize, v: usize| {
        let mut cell = [5, 5, 1];
        cell[(axis + 1) % 3] += u;
        cell[(axis + 2) % 3] += v;
        (3 * params.cell_id(cell) as u32 + axis as u32, 0.5)
    };
    let links: Vec<(u32, f64)> = (0..size * size).map(|k| at(k % size, k / size)).collect();
    let change = surface.parts.cut(&links);
    assert_eq!(change.refused, 0);
    let lips = faces(&surface.parts, &surface.alive);
    assert_eq!(lips.len(), 2 * size * size);
    let side = |side: usize| lips.iter().skip(side).step_by(2).flat_map(|face| face.nodes).collect::<Vec<u32>>();
    let [before, beyond] = [0, 1].map(side);
    // the front of the cut is of both sides
    let moves = |node: u32| beyond.contains(&node) && !before.contains(&node);
    let position = |node: u32| {
        let rest = DVec3::from_array(model.rest[surface.parts.original(node as usize)]);
        [if moves(node) { rest + motion } else { rest }, rest]
    };
    let found = contacts(0, &lips, position, |_| true, 1e-4);
    let normal = |c: &cutis::collide::Contact| if moves(c.points[0].0[0].0) { c.axes[0] } else { -c.axes[0] };
    let moved = found.iter().filter(|c| moves(c.points[0].0[0].0)).count();
    (found.iter().map(|c| c.gap[0]).collect(), found.iter().map(normal).collect(), moved)
}

/// All within 3 % of a gap; there are some.
fn are(gaps: &[f64], gap: f64) -> bool {
    !gaps.is_empty() && gaps.iter().all(|found| (found - gap).abs() < 3e-2 * gap.abs())
}

#[test]
fn lips_meet_along_the_normal_of_their_faces() {
    for axis in 0..3 {
        let along = DVec3::AXES[axis];
        let (gaps, normals, _) = parted(axis, 2, -3e-5 * along);
        assert!(are(&gaps, -3e-5), "axis {axis}: {gaps:?}");
        assert!(normals.iter().all(|n| n.dot(along) > 0.99), "axis {axis}: {normals:?}");
        let (gaps, ..) = parted(axis, 2, 5e-5 * along);
        assert!(are(&gaps, 5e-5), "axis {axis}: {gaps:?}");
        assert!(parted(axis, 2, 3e-4 * along).0.is_empty(), "axis {axis}: lips that have parted touch");
        // beyond the rim there is nothing to rest on; the faces that it has stretched cover what stayed
        let aside = DVec3::AXES[(axis + 1) % 3] * 5e-3;
        assert_eq!(parted(axis, 2, aside - 3e-5 * along).2, 0, "axis {axis}: a node that has slid away touches");
    }
}

/// Lips that slide along each other rest on whatever faces them now; pairs of nodes would lose each other after a cell.
#[test]
fn lips_that_have_slid_by_more_than_a_cell_still_meet() {
    for (axis, across) in [(0, 1), (1, 0), (2, 0)] {
        let aside = DVec3::AXES[across] * 1.6 * 20e-3 / 12.0;
        let (gaps, normals, _) = parted(axis, 3, aside - 3e-5 * DVec3::AXES[axis]);
        assert!(gaps.iter().any(|gap| (gap + 3e-5).abs() < 3e-6), "axis {axis}: {gaps:?}");
        assert!(normals.iter().all(|n| n.dot(DVec3::AXES[axis]) > 0.99), "axis {axis}: {normals:?}");
    }
}

/// Cuts an S, a cross and a corner that is lifted off its bed: how many nodes of the wound are inside of foreign cells, summed over every
/// fifth step, and the deepest of them, m.
fn shapes(lips: bool) -> (usize, f64) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision_shapes.toml");
    let mut scene = cutis::scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    scene.skins[0].cells = [14, 14];
    scene.contact.as_mut().expect("it has a blade").lips = lips;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let (mut nodes, mut deepest) = (0, 0.0f64);
    for step in 0..680 {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        let found = ["contacts_dropped", "inverted_cells", "non_finite_nodes", "solver_not_converged"]
            .map(|name| report.warnings.get(name).copied().unwrap_or(0));
        assert_eq!(found, [0; 4], "at {} s: {:?}", report.time, report.warnings);
        if step % 5 == 4 {
            let depths = inside(&mut simulation);
            (nodes, deepest) = (nodes + depths.len(), depths.iter().fold(deepest, |a, b| a.max(*b)));
        }
    }
    (nodes, deepest)
}

/// Measured in the cells themselves, which know nothing of the contacts. A cell is 1.4 mm wide. The deepest, a node at a corner of the flap, is
/// at 0.02 to 0.05 mm with moduli that differ by 1e-4; 0.07 to 0.13 mm without contacts by cells.
#[test]
fn a_flap_that_folds_does_not_pass_through_the_skin() {
    let [(with, deepest), (without, through)] = [true, false].map(shapes);
    println!("with contact {with} nodes, {deepest} m; without {without} nodes, {through} m");
    assert!(deepest < 1e-4 && through > 2e-4, "{deepest} m, without contact {through} m");
    assert!(2 * with < without, "{with} nodes inside of foreign cells, without contact {without}");
}
