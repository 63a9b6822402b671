//! Springs along the edges of a mesh's tetrahedra: their reactions, what a cut leaves of them, and what is refused.

use cutis::bodies::Kind;
use cutis::kernels::cut::Hit;
use cutis::mesh::Edges;
use cutis::scene::{Boundary, Files, Integrator, Probe, ProbeKind, Region, Scene, parse};
use cutis::step::{Platform, Simulation};
use std::path::{Path, PathBuf};

pub fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn text() -> String {
    std::fs::read_to_string(scenes().join("skin_springs_tetra.toml")).expect("the scene is there")
}

pub fn parsed(text: &str) -> Result<Scene, String> {
    parse(text, Path::new("skin_springs_tetra.toml"), &Files::Folder(scenes())).map_err(|error| error.to_string())
}

fn skin() -> Scene {
    parsed(&text()).unwrap_or_else(|e| panic!("{e}"))
}

/// Force on the lifted top of a network that stands on smooth ground between smooth walls, N, and its energy, J.
fn lifted(by: f64) -> [f64; 2] {
    let mut scene = skin();
    (scene.tools, scene.contact) = (vec![], None);
    scene.time.integrator = Integrator::Static;
    scene.time.gravity = [0.0; 3];
    (scene.solver.tolerance, scene.solver.max_iterations) = (1e-8, 20_000);
    let [x, y] = scene.skins[0].size;
    let hold = |region, axis: usize, up: f64| Boundary {
        region,
        axes: std::array::from_fn(|n| n == axis),
        displacement: [0.0, 0.0, up],
        ..scene.boundaries[0].clone()
    };
    let side = |through: [f64; 3], normal| Region::Plane { through, normal, within: 1e-7 };
    scene.boundaries = vec![
        hold(Region::Bottom, 2, 0.0),
        hold(side([-0.5 * x, 0.0, 0.0], [1.0, 0.0, 0.0]), 0, 0.0),
        hold(side([0.0, -0.5 * y, 0.0], [0.0, 1.0, 0.0]), 1, 0.0),
        hold(Region::Top, 2, by),
    ];
    let pull = ProbeKind::Reaction { body: 0, region: Region::Top, axis: 2 };
    scene.probes = vec![Probe { name: "pull".into(), kind: pull }];
    scene.skins[0].layers.iter_mut().for_each(|layer| layer.break_strain = f64::INFINITY);
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let pull = simulation.step(false).unwrap_or_else(|e| panic!("{e}")).probes[0];
    let state = &simulation.snapshots().expect("the CPU path has no device to fail")[0];
    let model = &simulation.bodies[0].model;
    [pull, model.mechanics().energy(model, state, &[])]
}

#[test]
fn the_reaction_of_a_network_is_the_change_of_its_energy() {
    let [force, energy] = lifted(50e-6);
    let [[_, more], [_, less]] = [51e-6, 49e-6].map(lifted);
    println!("{force} N, {energy:e} J");
    assert!(force > 1e-3 && (force / ((more - less) / 2e-6) - 1.0).abs() < 1e-4, "{force} N, {more:e} and {less:e} J");
}

/// The springs across a plane `z`, as hits of a blade's sweep.
fn across(simulation: &Simulation, z: f64) -> Vec<Hit<f64>> {
    let model = &simulation.bodies[0].model;
    let Kind::Springs(springs) = &model.kind else { panic!("springs") };
    let cut = |ends: &[u32; 2]| ends.map(|n| model.rest[n as usize][2] > z);
    let crossed = springs.ends.iter().enumerate().filter(|(_, ends)| cut(ends)[0] != cut(ends)[1]);
    crossed.map(|(segment, _)| Hit { segment: segment as u32, at: 0.5 }).collect()
}

#[test]
fn a_cut_right_through_parts_the_skin_and_the_upper_part_falls() {
    let mut scene = skin();
    (scene.tools, scene.contact, scene.probes) = (vec![], None, vec![]);
    scene.boundaries = vec![Boundary { region: Region::Bottom, ..scene.boundaries[0].clone() }];
    scene.skins[0].rayleigh_mass = 0.0;
    scene.solver.tolerance = 1e-6;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let (mass, faces) = (simulation.bodies[0].wound.mass_of_nodes(), simulation.bodies[0].wound.surface.all().len());
    let hits = across(&simulation, 1.2e-3);
    let severed = simulation.bodies[0].sever(&hits).expect("the CPU path has no device to fail");
    assert!(severed as usize == hits.len() && severed > 500, "{severed}");
    let wound = &simulation.bodies[0].wound;
    assert_eq!(wound.totals.springs_removed, hits.len());
    // two closed surfaces, with walls
    assert_eq!(wound.surface.edges().open, 0);
    let now = wound.surface.all();
    assert!(now.len() > faces && now.iter().any(|face| face.wall), "{faces} {}", now.len());
    // the area of the section, estimated from the number of springs: the skin is 12 × 12 mm
    let model = &simulation.bodies[0].model;
    let [x, y] = [0, 1].map(|n| 2.0 * model.rest.iter().map(|p| p[n]).fold(0.0, f64::max));
    let area = wound.totals.area / (x * y);
    println!("area {area} of the section's, {} tetrahedra open", wound.totals.tetrahedra);
    assert!((0.7..1.3).contains(&area), "{area}");
    assert!((wound.mass_of_nodes() - mass).abs() < 1e-12 * mass);
    // what is above the cut falls as a free body: by g h² n (n + 1)/2 in n implicit steps
    let upper: Vec<bool> = model.rest.iter().map(|p| p[2] > 1.2e-3).collect();
    let steps = 20;
    (0..steps).for_each(|_| drop(simulation.step(false).expect("the CPU path has no device to fail")));
    let state = simulation.snapshots().expect("the CPU path has no device to fail");
    let mean = |above: bool| {
        let own: Vec<f64> = (0..upper.len()).filter(|n| upper[*n] == above).map(|n| state[0].u[n][2]).collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    let fall = -9.81 * scene.time.step.powi(2) * f64::from(steps * (steps + 1)) / 2.0;
    assert!((mean(true) / fall - 1.0).abs() < 0.01, "{} of {fall} m", mean(true));
    assert!(mean(false).abs() < 0.01 * fall.abs(), "{} m", mean(false));
}

#[test]
fn a_few_cut_springs_leave_a_tetrahedron_whole_and_its_surface_closed() {
    let scene = skin();
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let before = simulation.bodies[0].wound.surface.all();
    // one spring: every tetrahedron around it still joins its corners
    simulation.bodies[0].sever(&[Hit { segment: 4000, at: 0.5 }]).expect("no device");
    let wound = &simulation.bodies[0].wound;
    assert!(wound.totals.springs_removed == 1 && wound.totals.tetrahedra == 0 && wound.surface.all() == before);
    // all springs of a node but one: what is around it opens, and each further removal keeps the surface closed
    let Kind::Springs(springs) = simulation.bodies[0].model.kind.clone() else { panic!("springs") };
    for node in [300, 301, 302, 700] {
        let own = &springs.half[springs.first[node] as usize..springs.first[node + 1] as usize];
        let mut hits: Vec<Hit<f64>> = own[1..].iter().map(|[_, s]| Hit { segment: *s, at: 0.5 }).collect();
        hits.sort_by_key(|hit| hit.segment);
        simulation.bodies[0].sever(&hits).expect("no device");
        let Edges { open, .. } = simulation.bodies[0].wound.surface.edges();
        assert_eq!(open, 0, "node {node}");
    }
    assert!(simulation.bodies[0].wound.totals.tetrahedra > 40);
    for _ in 0..5 {
        let report = simulation.step(true).expect("no device");
        // a node on one spring swings farther in a step than a linearised spring knows
        assert!(report.warnings.keys().all(|name| *name == "energy_grew"), "{:?}", report.warnings);
    }
}

#[test]
fn what_a_network_does_not_have_is_refused_with_words() {
    let strain = "\n[[probe]]\nname = \"e\"\nkind = \"strain\"\npoint_mm = [0.0, 0.0, 1.0]\ncomponent = \"xx\"\n";
    let refused = |text: String, wanted: &[&str]| {
        let words = match parsed(&text) {
            Err(words) => words,
            Ok(scene) => Simulation::new(&scene, &Platform::Cpu64).err().map(|e| e.to_string()).unwrap_or_default(),
        };
        assert!(wanted.iter().all(|word| words.contains(word)), "{words:?}, wanted {wanted:?}");
    };
    refused(text().replace("spring_damping_n_s_m = 1.0\n", ""), &["spring_damping_n_s_m", "law = \"springs\""]);
    refused(text().replace("spring_stiffness_n_m = 100.0\n", ""), &["young_kpa", "spring_stiffness_n_m"]);
    refused(text().replace("\"springs\"", "\"neo_hookean\""), &["spring_stiffness_n_m", "law = \"springs\""]);
    refused(
        text().replace("law = \"springs\"", "law = \"springs\"\nelement = \"tetra\""),
        &["element", "edges of the mesh"],
    );
    refused(text().replace("\"block\"", "\"multigrid\""), &["preconditioner", "multigrid"]);
    refused(text().replace("law = \"springs\"", "law = \"springs\"\ncut = \"split\""), &["cut", "mesh"]);
    refused(text() + strain, &["`e`", "springs", "[output] fields"]);
}
