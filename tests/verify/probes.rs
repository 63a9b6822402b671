//! Probes against closed forms: what a support bears, what lies between nodes, stress and strain of uniform fields, volumes, centres, spin.
//!
//! Uniform stretch by `s` along z, free across: `σ_zz = E (s − 1)` of small strains; neo-Hookean with the stretch `a` across from
//! `μ (a² − 1) + λ ln(a² s) = 0`, `σ = (μ (FFᵀ − I) + λ ln J I)/J`.

use super::setup::{exact, measured, static_block};
use super::small::held;
use super::{Case, Everywhere};
use cutis::kernels::Params;
use cutis::kernels::cut::Hit;
use cutis::math::V4;
use cutis::scene::Element::{Bbar, Enhanced, Plain, PlainTetra, Tetra};
use cutis::scene::{
    Blade, BodyId, Boundary, COMPONENTS, Component, Contact, Coupling, Law, Load, LoadKind, Material, Motion, Plane,
    Pose, Probe, ProbeKind, Region, RestSpring, Round, Scene, Tool,
};
use cutis::step::{Platform, Simulation, StepReport};

pub const CASES: &[Case] = &[
    ("a_reaction_has_the_contact_forces_on_held_nodes", touched),
    ("a_point_on_a_node_has_the_nodes_bits", at_node),
    ("a_pressure_times_its_area_is_the_force_of_the_press", pressed),
    ("a_rigid_bodys_spin_and_centre_are_read", spinning),
    ("probes_follow_the_duplicates_of_a_cut", cut),
];
pub const EVERYWHERE: &[Everywhere] = &[
    ("a_reaction_bears_weight_and_load_in_one_static_step", borne),
    ("a_reaction_of_held_nodes_has_their_own_weight_and_load", all_held),
    ("reactions_are_the_change_of_momentum", momentum),
    ("a_reaction_of_rest_springs_is_what_they_hold", on_rest_springs),
    ("a_point_between_nodes_is_interpolated", between),
    ("a_stretched_block_has_its_closed_form", stretched),
    ("a_hyperelastic_block_has_its_closed_form", hyperelastic),
    ("a_turned_cell_has_the_turned_stress", turned),
    ("a_falling_block_has_the_integrators_centre_of_mass", falling),
];

/// Top of the block of [`block`], m.
const TOP: f64 = 2.5e-3;
const YOUNG: f64 = 50e3;
const POISSON: f64 = 0.45;
/// kg: 1000 kg/m³ over 8 mm × 6 mm.
const MASS: f64 = 1000.0 * 8e-3 * 6e-3 * TOP;

const LINEAR: Law = Law::Fem { element: Bbar, corotational: false };
const COROTATIONAL: Law = Law::Fem { element: Bbar, corotational: true };
const NEO_HOOKEAN: Law = Law::Hyperelastic(Material::NeoHookean);
const TETRAHEDRA: Law = Law::Fem { element: Tetra, corotational: true };
const SOFT_TETRAHEDRA: Law = Law::LargeTetra { material: Material::NeoHookean, element: Tetra };
const SPRINGS: Law = Law::Springs { stiffness: Some(30.0), damping: 0.0 };

fn probe(scene: &mut Scene, kind: ProbeKind) {
    scene.probes.push(Probe { name: format!("p{}", scene.probes.len()), kind });
}

fn reactions(scene: &mut Scene, region: &Region) {
    (0..3).for_each(|axis| probe(scene, ProbeKind::Reaction { body: 0, region: region.clone(), axis }));
}

fn run(scene: &Scene, place: &Platform, steps: u32) -> (StepReport, Simulation) {
    let mut scene = scene.clone();
    scene.solver.newton = scene.contact.is_none() && matches!(scene.skins[0].law, Law::Hyperelastic(_));
    let mut simulation = Simulation::new(&scene, place).unwrap_or_else(|e| panic!("{e}"));
    let reports = (0..steps).map(|_| simulation.step(false).unwrap_or_else(|e| panic!("{e}")));
    let last = reports.last().expect("there is a step");
    assert!(last.probes.len() == scene.probes.len());
    (last, simulation)
}

fn close(what: &str, place: &Platform, found: f64, wanted: f64, size: f64) {
    measured(&format!("{what} {place:?}"), found, wanted);
    let error = (found - wanted).abs() / size;
    assert!(error < exact(place), "{what} {place:?}: {found:e}, wanted {wanted:e}, off by {error:e} of {size:e}");
}

/// Gravity aslant and a pressure on part of the top.
fn loaded(scene: &mut Scene) -> [f64; 3] {
    scene.time.gravity = [1.5, -0.7, -9.81];
    let (min, max) = ([-1.7e-3, -1.1e-3], [3.1e-3, 2.9e-3]);
    scene.loads.push(Load::on_top(&scene.skins[0], 40.0, min, max));
    let load = -40.0 * (max[0] - min[0]) * (max[1] - min[1]);
    [MASS * 1.5, MASS * -0.7, MASS * -9.81 + load]
}

fn borne(place: &Platform) {
    // small strains and Newton's method end in one step; rotations and springs are linearised at its start
    for (law, steps) in
        [(LINEAR, 1), (NEO_HOOKEAN, 1), (COROTATIONAL, 8), (TETRAHEDRA, 8), (SOFT_TETRAHEDRA, 12), (SPRINGS, 12)]
    {
        let mut scene = static_block(place, law);
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        let total = loaded(&mut scene);
        reactions(&mut scene, &Region::Bottom);
        let (report, simulation) = run(&scene, place, steps);
        let size = total[2].abs();
        for axis in 0..3 {
            close(&format!("reaction {law:?} along {axis}"), place, report.probes[axis], -total[axis], size);
        }
        // the counter-test: without the weight of the held nodes themselves it is off
        let model = &simulation.bodies[0].model;
        let own: f64 = model.nodes_in(&Region::Bottom).iter().map(|node| model.dofs[*node as usize][3]).sum();
        assert!(own * 9.81 > 0.05 * size, "{own} kg are held");
    }
}

fn all_held(place: &Platform) {
    for law in [COROTATIONAL, NEO_HOOKEAN, SPRINGS, TETRAHEDRA] {
        let mut scene = static_block(place, law);
        scene.boundaries.push(held(Region::All, [true; 3]));
        let total = loaded(&mut scene);
        reactions(&mut scene, &Region::All);
        reactions(&mut scene, &Region::Top);
        let (report, simulation) = run(&scene, place, 1);
        (0..3).for_each(|n| close("reaction of all", place, report.probes[n], -total[n], total[2].abs()));
        // of the top alone: the whole load, and the weight of its nodes
        let model = &simulation.bodies[0].model;
        let own: f64 = model.nodes_in(&Region::Top).iter().map(|node| model.dofs[*node as usize][3]).sum();
        let wanted = -(total[2] + 9.81 * (MASS - own));
        close("reaction of the top", place, report.probes[5], wanted, total[2].abs());
    }
}

/// Momentum, kg m/s.
fn impulse(simulation: &mut Simulation) -> [f64; 3] {
    let state = simulation.snapshots().expect("the device works").remove(0);
    let of = |n: usize| state.v.iter().zip(&state.dofs).map(|(v, dofs)| dofs[3] * v[n]).sum();
    [0, 1, 2].map(of)
}

fn momentum(place: &Platform) {
    for law in [LINEAR, NEO_HOOKEAN, TETRAHEDRA, Law::Springs { stiffness: Some(30.0), damping: 0.02 }] {
        let mut scene = static_block(place, law);
        scene.time.step = 1e-4;
        let drag = 300.0;
        (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (drag, 1e-4);
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        let mut total = loaded(&mut scene);
        if law != LINEAR {
            // small enough for the damping, which has the rotations and springs of the step's start
            scene.time.gravity.iter_mut().for_each(|g| *g *= 1e-2);
            scene.loads[0].kind = LoadKind::Pressure { pressure: 0.4, follower: false };
            total.iter_mut().for_each(|f| *f *= 1e-2);
        }
        reactions(&mut scene, &Region::Bottom);
        let (_, mut simulation) = run(&scene, place, 2);
        let before = impulse(&mut simulation);
        let report = simulation.step(false).expect("the device works");
        let after = impulse(&mut simulation);
        let size = total[2].abs();
        for n in 0..3 {
            let wanted = (after[n] - before[n]) / scene.time.step + drag * after[n] - total[n];
            measured(&format!("reaction {law:?} {place:?}"), report.probes[n], wanted);
            let error = (report.probes[n] - wanted).abs() / size;
            // a change of momentum in f32 is of velocities that agree in their first digits
            let bound = 1e2 * exact(place) + if law == LINEAR { 0.0 } else { 1e-4 };
            assert!(error < bound, "{law:?} {place:?} {n}: {}, wanted {wanted}, off by {error:e}", report.probes[n]);
        }
        // the counter-test: it is not at rest
        assert!((report.probes[2] + total[2]).abs() > 0.02 * size, "{} of {}", report.probes[2], total[2]);
    }
}

fn on_rest_springs(place: &Platform) {
    for (law, steps) in [(LINEAR, 1), (NEO_HOOKEAN, 1), (SPRINGS, 12)] {
        let mut scene = static_block(place, law);
        scene.rest_springs.push(RestSpring { body: 0, region: Region::Bottom, stiffness: 25.0 });
        let total = loaded(&mut scene);
        reactions(&mut scene, &Region::Bottom);
        reactions(&mut scene, &Region::Top);
        let (report, _) = run(&scene, place, steps);
        (0..3)
            .for_each(|n| close(&format!("rest_springs {law:?}"), place, report.probes[n], -total[n], total[2].abs()));
        assert_eq!(report.probes[3..], [0.0; 3], "nothing holds the top");
    }
}

/// All nodes held at a turn about the vertical and a displacement: the field is linear.
fn posed(law: Law, place: &Platform, turn: f64) -> Scene {
    let mut scene = static_block(place, law);
    let displacement = [1e-4, -2e-4, 3e-4];
    scene.boundaries.push(Boundary { region: Region::All, displacement, rotation: turn, ..Boundary::default() });
    scene
}

fn between(place: &Platform) {
    let points = [[1.1e-3, 0.3e-3, 0.7e-3], [-3.9e-3, 2.7e-3, 2.45e-3], [0.0, -0.4e-3, 0.6e-3], [0.4e-3, 1e-3, TOP]];
    for law in [COROTATIONAL, NEO_HOOKEAN, SPRINGS] {
        let mut scene = posed(law, place, 0.3);
        for point in points {
            (0..3).for_each(|axis| probe(&mut scene, ProbeKind::Displacement { body: 0, point, axis }));
        }
        let (report, simulation) = run(&scene, place, 1);
        let model = &simulation.bodies[0].model;
        for (k, point) in points.iter().enumerate() {
            let field = |p: [f64; 3]| {
                let [x, y, z] = cutis::bodies::turned(p, 0.3);
                [x + 1e-4, y - 2e-4, z + 3e-4]
            };
            let wanted = field(*point);
            (0..3).for_each(|n| close("a point", place, report.probes[3 * k + n], wanted[n], 1e-3));
            // the counter-test: the nearest node has another one
            let nearest = model.grid.rest(model.nearest(*point) as usize);
            let off = (0..2).map(|n| (field(nearest)[n] - wanted[n]).abs()).fold(0.0, f64::max);
            assert!(off > 1e-5, "{point:?}: the nearest node is off by {off} m alone");
        }
    }
}

fn at_node() {
    let mut scene = static_block(&Platform::Cpu64, COROTATIONAL);
    scene.boundaries.push(held(Region::Bottom, [true; 3]));
    loaded(&mut scene);
    let params: Params<f64> = super::setup::model(&scene).grid.params();
    let (node, point) = (params.node_id([1, 2, 3]), [-2e-3, 1e-3, 2.2e-3]);
    // and one that a decimal has rounded
    for point in [point, [point[0] + 1e-8, point[1] - 1e-8, point[2]]] {
        (0..3).for_each(|axis| probe(&mut scene, ProbeKind::Displacement { body: 0, point, axis }));
    }
    let (report, mut simulation) = run(&scene, &Platform::Cpu64, 1);
    let u = simulation.snapshots().expect("no device to fail")[0].u[node];
    assert!(u[2] != 0.0);
    for (k, found) in report.probes.iter().enumerate() {
        assert_eq!(found.to_bits(), u[k % 3].to_bits(), "{k}");
    }
}

/// The block stretched to `stretch` of its height, free across: on the planes x = −4 mm, y = −3 mm and z = 0 it slides.
fn stretch(place: &Platform, law: Law, stretch: f64) -> Scene {
    let mut scene = static_block(place, law);
    let plane = |through, normal| Region::Plane { through, normal, within: 0.0 };
    let faces = [
        (plane([-4e-3, 0.0, 0.0], [1.0, 0.0, 0.0]), [true, false, false]),
        (plane([0.0, -3e-3, 0.0], [0.0, 1.0, 0.0]), [false, true, false]),
        (Region::Bottom, [false, false, true]),
    ];
    scene.boundaries = faces.map(|(region, axes)| held(region, axes)).to_vec();
    let displacement = [0.0, 0.0, (stretch - 1.0) * TOP];
    let top = Boundary { displacement, ..held(Region::Top, [false, false, true]) };
    scene.boundaries.push(top);
    // inside a cell, on a face of two, on an interface of layers, on a corner of the body
    for point in [[1.1e-3, 0.3e-3, 0.7e-3], [0.0, 0.4e-3, 0.9e-3], [0.5e-3, 0.5e-3, 1.2e-3], [4e-3, 3e-3, TOP]] {
        for (_, component) in COMPONENTS {
            probe(&mut scene, ProbeKind::Stress { body: 0, point, component });
            if component != Component::VonMises {
                probe(&mut scene, ProbeKind::Strain { body: 0, point, component });
            }
        }
    }
    probe(&mut scene, ProbeKind::Volume { body: 0 });
    probe(&mut scene, ProbeKind::VolumeChange { body: 0 });
    (0..3).for_each(|axis| probe(&mut scene, ProbeKind::CentreOfMass { of: BodyId::Deformable(0), axis }));
    probe(&mut scene, ProbeKind::MeanDisplacement { body: 0, region: Region::All, axis: 2 });
    reactions(&mut scene, &Region::Top);
    scene
}

/// What the probes of [`stretch`] are for a stretch `a` across and a stress along z, Pa.
fn check_stretched(what: &str, place: &Platform, scene: &Scene, found: &[f64], [a, s]: [f64; 2], stress: f64) {
    let strain = |stretch: f64| 0.5 * (stretch * stretch - 1.0);
    let volume = 8e-3 * 6e-3 * TOP;
    for (kind, found) in scene.probes.iter().map(|p| &p.kind).zip(found) {
        let (wanted, size) = match kind {
            ProbeKind::Stress { component: Component::VonMises, .. } => (stress.abs(), stress.abs()),
            ProbeKind::Stress { component: Component::Entry(2, 2), .. } => (stress, stress.abs()),
            ProbeKind::Stress { .. } => (0.0, stress.abs()),
            ProbeKind::Strain { component: Component::Entry(2, 2), .. } => (strain(s), strain(s).abs()),
            ProbeKind::Strain { component: Component::Entry(i, j), .. } if i == j => (strain(a), strain(s).abs()),
            ProbeKind::Strain { .. } => (0.0, strain(s).abs()),
            ProbeKind::Volume { .. } => (volume * a * a * s, volume),
            ProbeKind::VolumeChange { .. } => (a * a * s - 1.0, s - 1.0),
            ProbeKind::CentreOfMass { axis, .. } => {
                ([-4e-3 + 4e-3 * a, -3e-3 + 3e-3 * a, 0.5 * TOP * s][*axis], 1e-3 * (s - 1.0))
            }
            ProbeKind::MeanDisplacement { .. } => (0.5 * TOP * (s - 1.0), TOP * (s - 1.0)),
            ProbeKind::Reaction { axis, .. } => ([0.0, 0.0, stress * 8e-3 * 6e-3][*axis], stress.abs() * 48e-6),
            other => panic!("{other:?} has no closed form here"),
        };
        // the force of small strains is per area at rest, of others per present area
        let wanted = match kind {
            ProbeKind::Reaction { .. } if what.contains("hyperelastic") => wanted * a * a,
            _ => wanted,
        };
        // stress is strain times a modulus ten times Young's at ν 0.45, of strains rounded in cells a tenth as thick as the block
        close(&format!("{what} {kind:?}"), place, *found, wanted, 10.0 * size.abs());
    }
}

fn stretched(place: &Platform) {
    let s = 1.01;
    for element in [Plain, Bbar, Enhanced, Tetra, PlainTetra] {
        for corotational in [false, true] {
            let law = Law::Fem { element, corotational };
            let scene = stretch(place, law, s);
            let (report, _) = run(&scene, place, 1);
            let across = 1.0 - POISSON * (s - 1.0);
            check_stretched(&format!("{law:?}"), place, &scene, &report.probes, [across, s], YOUNG * (s - 1.0));
        }
    }
    // counter-tests: the mean of the nodes is not that of the body; another ratio is another strain
    let model = super::setup::model(&stretch(place, LINEAR, s));
    let mean = model.rest.iter().map(|p| p[2]).sum::<f64>() / model.rest.len() as f64;
    assert!((mean / (0.5 * TOP) - 1.0).abs() > 0.03, "{mean} m");
    let mut other = stretch(place, LINEAR, s);
    other.skins[0].layers.iter_mut().for_each(|layer| layer.poisson = 0.44);
    let (report, _) = run(&other, place, 1);
    let across =
        other.probes.iter().position(|p| matches!(p.kind, ProbeKind::Strain { component: Component::Entry(0, 0), .. }));
    let found = report.probes[across.expect("it is probed")];
    assert!((found + POISSON * (s - 1.0)).abs() > 5e-5, "{found}");
}

fn hyperelastic(place: &Platform) {
    let s = 1.2f64;
    let (lambda, mu) = cutis::bodies::grid::element::lame(YOUNG, POISSON);
    // the stretch across without stress, by bisection
    let across = |a: f64| mu * (a * a - 1.0) + lambda * (a * a * s).ln();
    let (mut low, mut high) = (0.5, 1.5);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if across(middle) < 0.0 { low = middle } else { high = middle }
    }
    let volume = low * low * s;
    let stress = (mu * (s * s - 1.0) + lambda * volume.ln()) / volume;
    // one static step by Newton's method, or many of one linear solve
    for (law, steps) in [
        (NEO_HOOKEAN, 1),
        (SOFT_TETRAHEDRA, 40),
        (Law::LargeTetra { material: Material::NeoHookean, element: PlainTetra }, 40),
    ] {
        let scene = stretch(place, law, s);
        let (report, _) = run(&scene, place, steps);
        check_stretched(&format!("hyperelastic {law:?}"), place, &scene, &report.probes, [low, s], stress);
    }
    // counter-tests: the force per area at rest is another stress, and the elongation another strain
    assert!(low * low < 0.9, "{low}");
    assert!(0.5 * (s * s - 1.0) > 1.05 * (s - 1.0));
}

fn turned(place: &Platform) {
    const STRAIN: [f64; 2] = [0.2, 0.1];
    let turn = 0.6f64;
    let (lambda, mu) = cutis::bodies::grid::element::lame(YOUNG, POISSON);
    let across = -POISSON / (1.0 - POISSON) * (STRAIN[0] + STRAIN[1]);
    let trace = STRAIN[0] + STRAIN[1] + across;
    let [x, y] = STRAIN.map(|e| lambda * trace + 2.0 * mu * e);
    let (s, c) = turn.sin_cos();
    let wanted = [c * c * x + s * s * y, s * s * x + c * c * y, 0.0, c * s * (x - y), 0.0, 0.0];
    let found = |law: Law| {
        let mut scene = posed(law, place, turn);
        scene.skins[0].layers.iter_mut().for_each(|layer| layer.pre_strain = STRAIN);
        for (_, component) in &COMPONENTS[..6] {
            let point = [1.1e-3, 0.3e-3, 0.7e-3];
            probe(&mut scene, ProbeKind::Stress { body: 0, point, component: *component });
            probe(&mut scene, ProbeKind::Strain { body: 0, point, component: *component });
        }
        run(&scene, place, 1).0.probes
    };
    for element in [Plain, Bbar, Enhanced] {
        let own = found(Law::Fem { element, corotational: true });
        for k in 0..6 {
            close(&format!("{element:?} stress {k}"), place, own[2 * k], wanted[k], 10.0 * x);
            close(&format!("{element:?} strain {k}"), place, own[2 * k + 1], 0.0, 1.0);
        }
    }
    // the counter-test: without rotations the turn is a strain
    let linear = found(LINEAR);
    assert!((linear[0] - wanted[0]).abs() > 0.1 * x, "{} Pa", linear[0]);
}

fn falling(place: &Platform) {
    let mut scene = static_block(place, COROTATIONAL);
    (scene.time.step, scene.time.gravity) = (1e-3, [0.0, 2.0, -9.81]);
    scene.skins[0].position = [0.1, -0.2, 0.3];
    // a heavy top
    scene.skins[0].layers[2].density = 5000.0;
    (0..3).for_each(|axis| probe(&mut scene, ProbeKind::CentreOfMass { of: BodyId::Deformable(0), axis }));
    let layers = [(1.2e-3, 1000.0), (1.0e-3, 1000.0), (0.3e-3, 5000.0)];
    let (mut bottom, mut mass, mut moment) = (0.0, 0.0, 0.0);
    for (height, density) in layers {
        mass += height * density;
        moment += height * density * (bottom + 0.5 * height);
        bottom += height;
    }
    let steps = 20;
    let (report, _) = run(&scene, place, steps);
    // implicit Euler: h² g n (n + 1)/2
    let fallen = |g: f64| g * 1e-6 * f64::from(steps * (steps + 1)) / 2.0;
    let wanted = [0.1, -0.2 + fallen(2.0), 0.3 + moment / mass + fallen(-9.81)];
    (0..3).for_each(|n| close("centre of mass", place, report.probes[n], wanted[n], fallen(9.81)));
    // counter-tests: it is not the middle, and the step is not the limit of short ones
    assert!((moment / mass - 0.5 * TOP).abs() > 0.1 * fallen(9.81));
    assert!((fallen(9.81) / (0.5 * 9.81 * 4e-4) - 1.0).abs() > 0.04);
}

/// A sphere that a hand presses 0.1 mm into the top.
fn ball() -> Tool {
    let pose = |time, z| Pose { time, position: [0.0, 0.0, z], ..Pose::default() };
    Tool {
        name: "ball".into(),
        mass: 0.01,
        inertia: [1e-7; 3],
        round: Some(Round { radius: 2e-3, ends: [[0.0; 3]; 2] }),
        coupling: Coupling { stiffness: 1e3, ..Coupling::default() },
        trajectory: vec![pose(0.0, TOP + 2.01e-3), pose(0.01, TOP + 1.9e-3)],
        ..Tool::default()
    }
}

fn touched() {
    let mut scene = static_block(&Platform::Cpu64, COROTATIONAL);
    (scene.time.step, scene.time.gravity) = (1e-3, [0.0; 3]);
    scene.boundaries.push(held(Region::All, [true; 3]));
    (scene.tools, scene.contact) = (vec![ball()], Some(Contact { friction: 0.0, ..Contact::default() }));
    reactions(&mut scene, &Region::All);
    probe(&mut scene, ProbeKind::Force { on: BodyId::Deformable(0), from: None, axis: 2 });
    let (report, _) = run(&scene, &Platform::Cpu64, 12);
    let force = report.probes[3];
    assert!(force < -1e-3, "the counter-test: it presses, {force} N");
    assert!((report.probes[2] + force).abs() < 1e-12 * force.abs(), "{} N bears {force} N", report.probes[2]);
}

/// Present area of a grid's bottom, m².
fn bottom_area(simulation: &mut Simulation) -> f64 {
    let u: Vec<V4<f64>> = simulation.snapshots().expect("no device to fail").remove(0).u;
    let model = &simulation.bodies[0].model;
    let params: Params<f64> = model.grid.params();
    let mut area = 0.0;
    for j in 0..model.grid.cells[1] {
        for i in 0..model.grid.cells[0] {
            let nodes = params.corners(params.cell_id([i, j, 0]));
            let at = |a: usize| glam::DVec3::from_array([0, 1, 2].map(|n| model.rest[nodes[a]][n] + u[nodes[a]][n]));
            let half = |a: usize, b: usize, c: usize| 0.5 * (at(b) - at(a)).cross(at(c) - at(a)).length();
            area += half(0, 1, 2) + half(0, 2, 3);
        }
    }
    area
}

fn pressed() {
    let mut scene = static_block(&Platform::Cpu64, COROTATIONAL);
    (scene.time.step, scene.time.gravity) = (5e-3, [0.0, 0.0, -300.0]);
    scene.skins[0].rayleigh_stiffness = 0.01;
    let normal = [0.0, 0.0, 1.0];
    scene.planes.push(Plane { name: "floor".into(), through: [0.0; 3], normal });
    scene.contact = Some(Contact { friction: 0.0, max_contacts: 100, ..Contact::default() });
    scene.solver.tolerance = 1e-6;
    probe(&mut scene, ProbeKind::Pressure { body: 0, region: Region::Bottom });
    probe(&mut scene, ProbeKind::Force { on: BodyId::Deformable(0), from: None, axis: 2 });
    probe(&mut scene, ProbeKind::Pressure { body: 0, region: Region::Top });
    let left = Region::Box { min: [-4e-3, -3e-3, 0.0], max: [0.0, 3e-3, 0.0] };
    probe(&mut scene, ProbeKind::Pressure { body: 0, region: left });
    let (report, mut simulation) = run(&scene, &Platform::Cpu64, 30);
    let [pressure, force, top, left] = report.probes[..] else { panic!("four probes") };
    let area = bottom_area(&mut simulation);
    measured("force of the press", pressure * area, force);
    assert!((force / (300.0 * MASS) - 1.0).abs() < 0.02, "it rests: {force} N of {} N", 300.0 * MASS);
    assert!((pressure * area / force - 1.0).abs() < 1e-9, "{pressure} Pa on {area} m² are not {force} N");
    assert_eq!(top, 0.0, "nothing touches the top");
    // half of it: the forces of its nodes, the middle row's among them
    assert!(left > 0.9 * pressure && left < 1.6 * pressure, "{left} Pa of {pressure} Pa");
    // the counter-test: on the area at rest it would be another force
    assert!((area / 48e-6 - 1.0).abs() > 1e-3, "{area} m²");
}

fn spinning() {
    let mut scene = static_block(&Platform::Cpu64, COROTATIONAL);
    (scene.time.step, scene.time.gravity) = (1e-3, [0.0; 3]);
    scene.boundaries.push(held(Region::All, [true; 3]));
    let motion = Motion { velocity: [0.5, 0.0, 0.0], angular_velocity: [1.0, -2.0, 3.0] };
    let none = Coupling { stiffness: 0.0, damping: 0.0, angular_stiffness: 0.0, angular_damping: 0.0 };
    scene.tools = vec![Tool { free: Some(motion), coupling: none, ..ball() }];
    scene.tools[0].trajectory.truncate(1);
    (0..3).for_each(|axis| probe(&mut scene, ProbeKind::Spin { body: 0, axis }));
    (0..3).for_each(|axis| probe(&mut scene, ProbeKind::CentreOfMass { of: BodyId::Rigid(0), axis }));
    let (report, _) = run(&scene, &Platform::Cpu64, 10);
    for (found, wanted) in report.probes.iter().zip([1.0, -2.0, 3.0, 5e-3, 0.0, TOP + 2.01e-3]) {
        assert!((found - wanted).abs() < 1e-12, "{:?}", report.probes);
    }
}

fn cut() {
    for law in [LINEAR, NEO_HOOKEAN] {
        let mut scene = static_block(&Platform::Cpu64, law);
        // a blade far away, so that nodes may be duplicated; with contact a hyperelastic step is linear, so there are several
        let blade = Blade { edge: vec![[0.0; 3], [4e-3, 0.0, 4e-3]], ..Blade::default() };
        let far = vec![Pose { time: 0.0, position: [1.0, 0.0, 1.0], ..Pose::default() }];
        scene.tools = vec![Tool { blade: Some(blade), round: None, trajectory: far, ..ball() }];
        scene.contact = Some(Contact::default());
        scene.boundaries.push(held(Region::Bottom, [true; 3]));
        let total = loaded(&mut scene);
        reactions(&mut scene, &Region::Bottom);
        let point = [0.0, 0.4e-3, 0.9e-3];
        probe(&mut scene, ProbeKind::Stress { body: 0, point, component: Component::Entry(0, 0) });
        probe(&mut scene, ProbeKind::Volume { body: 0 });
        let (whole, mut simulation) = run(&scene, &Platform::Cpu64, 30);
        // right through at x = 0
        let params = *simulation.bodies[0].wound.surface.params();
        let cells = (0..params.cell_count as usize).filter(|cell| params.cell_at(*cell)[0] == 1);
        let hits: Vec<Hit<f64>> = cells.map(|cell| Hit { segment: 3 * cell as u32, at: 0.5 }).collect();
        assert_eq!(simulation.bodies[0].sever(&hits).expect("no device to fail") as usize, hits.len());
        let steps = (0..30).map(|_| simulation.step(false).expect("no device to fail"));
        let report = steps.last().expect("there are steps");
        let size = total[2].abs();
        for (axis, total) in total.into_iter().enumerate() {
            close(&format!("{law:?}, whole"), &Platform::Cpu64, whole.probes[axis], -total, size);
            close(&format!("{law:?}, cut"), &Platform::Cpu64, report.probes[axis], -total, size);
        }
        // counter-tests: duplicates bear part of it, and the wall is free of the stress that was there
        let body = &simulation.bodies[0];
        let copies: Vec<u32> = body
            .model
            .nodes_in(&Region::Bottom)
            .into_iter()
            .filter(|node| !body.wound.surface.parts.copies(*node as usize).is_empty())
            .collect();
        assert_eq!(copies.len(), 4, "the bottom's nodes at the cut have duplicates");
        let stress = [&whole, &report].map(|report| report.probes[3].abs());
        assert!(stress[1] < 0.9 * stress[0], "{stress:?}");
        assert!((report.probes[4] / whole.probes[4] - 1.0).abs() < 1e-3, "no volume is lost");
    }
}
