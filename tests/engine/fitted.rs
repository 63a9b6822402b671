//! Springs fitted to Young's modulus: what the network of a mesh shows of it under even and local loads.

use crate::networks::{parsed, scenes};
use cutis::bodies::Kind;
use cutis::scene::{Element, Law, Material, Scene, TetrahedralMesh};
use cutis::step::{Platform, Simulation};
use std::sync::Arc;

/// kPa
const YOUNG: f64 = 200.0;
/// Even pull, kPa.
const PULL: f64 = 0.2;

/// Rest shape of the mesh, m.
const SIZE: [f64; 3] = [20e-3, 20e-3, 2.3e-3];

fn layer(young: f64) -> String {
    format!("[[skin.layer]]\nname = \"skin\"\nyoung_kpa = {young}\ndensity_kg_m3 = 1116.0\n")
}

/// A body that stands between smooth walls and is pulled along an axis.
fn pulled(layers: &str, axis: usize) -> Scene {
    let [region, letter] = [["side_x_max", "x"], ["side_y_max", "y"], ["top", "z"]][axis];
    let mut traction = [0.0; 3];
    traction[axis] = PULL;
    let text = format!(
        "title = \"pulled\"
        [time]
        step_ms = 1000.0
        duration_s = 1.0
        integrator = \"static\"
        gravity_m_s2 = [0.0, 0.0, 0.0]
        [solver]
        preconditioner = \"block\"
        tolerance = 1e-6
        [skin]
        mesh = \"meshes/skin_fine.msh\"
        law = \"springs\"
        spring_damping_n_s_m = 0.0
        {layers}
        [[boundary]]
        region = \"side_x_min\"
        axes = \"x\"
        [[boundary]]
        region = \"side_y_min\"
        axes = \"y\"
        [[boundary]]
        region = \"bottom\"
        axes = \"z\"
        [[load]]
        region = \"{region}\"
        traction_kpa = {traction:?}
        [[probe]]
        name = \"u\"
        kind = \"mean_displacement\"
        region = \"{region}\"
        axis = \"{letter}\"
        "
    );
    parsed(&text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Displacement of the pulled side, m.
fn displacement(scene: &Scene) -> f64 {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    simulation.step(false).unwrap_or_else(|e| panic!("{e}")).probes[0]
}

/// Along each axis: strain less that of the material, relative.
fn errors(layers: &str, law: Option<Law>) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let mut scene = pulled(layers, axis);
        scene.skins[0].law = law.unwrap_or(scene.skins[0].law);
        displacement(&scene) / (SIZE[axis] * PULL / YOUNG) - 1.0
    })
}

#[test]
fn a_fitted_mesh_stretches_as_its_material_along_each_axis() {
    let one = layer(YOUNG);
    let found = errors(&one, None);
    println!("errors {found:?}");
    assert!(found[..2].iter().all(|e| e.abs() < 0.05) && found[2].abs() < 0.12, "{found:?}");
    // equal springs are right along one axis at most
    let stiffness = {
        let simulation = Simulation::new(&pulled(&one, 0), &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        let Kind::Springs(springs) = simulation.bodies[0].model.kind.clone() else { panic!("springs") };
        springs.law.iter().map(|law| law[1]).sum::<f64>() / springs.law.len() as f64
    };
    let equal = errors(&one, Some(Law::Springs { stiffness: Some(stiffness), damping: 0.0 }));
    println!("equal springs of {stiffness} N/m: {equal:?}");
    let [least, most] = [f64::min, f64::max].map(|of| equal.map(|e| 1.0 + e).into_iter().reduce(of).expect("three"));
    assert!(most > 1.5 * least, "{equal:?}");
}

#[test]
fn stiffnesses_are_in_proportion_to_the_modulus_of_their_layer() {
    let [one, double] = [1.0, 2.0].map(|factor| displacement(&pulled(&layer(factor * YOUNG), 0)));
    assert!((one / double - 2.0).abs() < 1e-3, "{one}, {double}");
    // a change between steps takes the fit that is there
    let mut simulation = Simulation::new(&pulled(&layer(YOUNG), 0), &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let stiffnesses = |simulation: &Simulation| match &simulation.bodies[0].model.kind {
        Kind::Springs(springs) => springs.law.iter().map(|law| law[1]).collect::<Vec<_>>(),
        _ => panic!("springs"),
    };
    let before = stiffnesses(&simulation);
    simulation.change(|scene| scene.skins[0].layers[0].young *= 2.0).unwrap_or_else(|e| panic!("{e}"));
    let doubled: Vec<f64> = before.iter().map(|k| 2.0 * k).collect();
    assert!(before[0] > 0.0 && stiffnesses(&simulation) == doubled, "{:?}", &before[..3]);
    // a stiff upper half takes its share of the pull: the mean of the moduli, since both halves are stretched alike
    let halves = |scene: &mut Scene| {
        let skin = &mut scene.skins[0];
        let mesh = skin.mesh.clone().expect("it has one");
        let is_high = |e: usize| mesh.corners(e).iter().map(|x| x[2]).sum::<f64>() > 2.0 * SIZE[2];
        let layers = (0..mesh.tetrahedra().len()).map(|e| u32::from(is_high(e))).collect();
        let mesh = TetrahedralMesh::new(mesh.nodes().to_vec(), mesh.tetrahedra().to_vec(), layers);
        skin.mesh = Some(Arc::new(mesh.unwrap_or_else(|defect| panic!("{defect}"))));
        skin.layers.push(skin.layers[0].clone());
        skin.layers[1].name = "stiff".into();
        skin.layers[1].young *= 3.0;
    };
    let mut scene = pulled(&layer(YOUNG), 0);
    halves(&mut scene);
    let found = displacement(&scene) / (SIZE[0] * PULL / (2.0 * YOUNG));
    println!("two layers: {found} of the mean");
    assert!((found - 1.0).abs() < 0.15, "{found}");
}

#[test]
fn a_grid_and_a_layer_without_modulus_are_refused_with_words() {
    let text = std::fs::read_to_string(scenes().join("skin_springs.toml")).expect("the scene is there");
    let words =
        parsed(&text.replace("spring_stiffness_n_m = 100.0\n", "")).map(|_| ()).expect_err("a grid is not fitted");
    assert!(words.contains("spring_stiffness_n_m") && words.contains("mesh"), "{words}");
    let mut scene = pulled(&layer(YOUNG), 0);
    scene.skins[0].layers[0].young = 0.0;
    let words = Simulation::new(&scene, &Platform::Cpu64).map(|_| ()).expect_err("nothing to fit to").to_string();
    assert!(words.contains("young"), "{words}");
}

/// Force of the ball-ended probe of scenes/skin_tetra.toml after its way down, N.
fn pressed(law: Law) -> f64 {
    let text = std::fs::read_to_string(scenes().join("skin_tetra.toml")).expect("the scene is there");
    let mut scene = parsed(&text).unwrap_or_else(|e| panic!("{e}"));
    scene.skins[0].law = law;
    scene.skins[0].layers[0].poisson = 0.25;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let steps = (0..32).map(|_| simulation.step(false).unwrap_or_else(|e| panic!("{e}")));
    steps.last().expect("32 steps").probes[2]
}

/// A local load bends the outside, which a network resists less than a solid does; the documentation says by how much.
#[test]
fn a_fitted_mesh_is_a_third_too_soft_under_a_probe() {
    let solid = pressed(Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra });
    let springs = pressed(Law::Springs { stiffness: None, damping: 0.0 });
    println!("{springs} N for {solid} N: {:.3}", springs / solid);
    assert!((0.6..0.8).contains(&(springs / solid)), "{springs} N for {solid} N");
}
