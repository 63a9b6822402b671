//! Scenes in code: the defaults are those of scene files, and what cannot run is refused with words, not by a panic.

use cutis::scene::{
    Attachment, Blade, BodyId, Boundary, Component, Contact, Coupling, Device, Element, Files, Group, Integrator, Law,
    Layer, Lines, Load, LoadKind, Material, Motion, Pose, Preconditioner, Probe, ProbeKind, Region, Scene, Skin, Tool,
    parse,
};
use cutis::step::{Platform, Simulation};
use std::path::Path;

/// A patch whose bottom and sides are held, and a scalpel that a hand draws through it.
fn cut() -> Scene {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let pose = |time, x: f64, z: f64| Pose { time, position: [x, 0.0, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    let scalpel = Tool {
        name: "scalpel".into(),
        blade: Some(Blade { edge: vec![[0.0; 3], [4e-3 * half, 0.0, 4e-3 * half]], ..Blade::default() }),
        round: None,
        coupling: Coupling { stiffness: 500.0, ..Coupling::default() },
        trajectory: vec![pose(0.0, 2e-3, 2.4e-3), pose(0.05, 2e-3, 0.8e-3), pose(0.2, -2e-3, 0.8e-3)],
        ..Tool::default()
    };
    let held = |region| Boundary { region, ..Boundary::default() };
    let mut scene = Scene {
        title: "a cut in code".into(),
        skins: vec![Skin::default()],
        boundaries: vec![held(Region::Bottom), held(Region::Sides)],
        tools: vec![scalpel],
        contact: Some(Contact::default()),
        ..Scene::default()
    };
    scene.time.duration = 0.2;
    scene.skins[0].layers[0].toughness = 100.0;
    scene
}

#[test]
fn a_patch_in_code_is_pressed_and_cut() {
    let scene = cut();
    scene.check().unwrap_or_else(|e| panic!("{e}"));
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let mut largest = 0.0f64;
    for _ in 0..scene.time.steps() {
        let step = simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        largest = largest.max(step.contact.largest_on_tools());
    }
    let totals = simulation.totals();
    assert!(largest > 0.01 && totals.length > 2e-3 && totals.depth > 0.5e-3, "{largest} N, {totals:?}");
}

#[test]
fn defaults_are_those_of_scene_files() {
    let text = "title = \"t\"\n[time]\nstep_ms = 5\nduration_s = 1\n[skin]\nsize_mm = [10, 10]\ncells = [10, 10]\n\
                [[skin.layer]]\nname = \"dermis\"\nthickness_mm = 2\ncells = 4\nyoung_kpa = 200\npoisson = 0.45\ndensity_kg_m3 = 1100\n\
                [[tool]]\nname = \"tool\"\nmass_g = 20\ninertia_g_mm2 = [1000, 1000, 1000]\npath_mm = [[0, 0, 0, 20]]\n[tool.round]\nradius_mm = 2\npoints_mm = [[0, 0, 0]]\n";
    let read = parse(text, Path::new("t.toml"), &Files::Embedded(&[])).unwrap_or_else(|e| panic!("{e}"));
    let words = |value: &dyn std::fmt::Debug| format!("{value:?}");
    let made = Scene::default();
    assert_eq!(words(&read.time), words(&made.time));
    assert_eq!(words(&read.solver), words(&made.solver));
    assert_eq!(words(&read.haptic), words(&made.haptic));
    assert_eq!(words(&read.study), words(&made.study));
    assert_eq!(words(&read.contact), words(&Some(Contact::default())));
    assert_eq!(words(&read.tools[0].coupling), words(&Coupling::default()));
    let layer = Layer { color: read.skins[0].layers[0].color, ..Layer::default() };
    assert_eq!(words(&read.skins[0].layers), words(&vec![layer]));
    let skin = Skin { layers: read.skins[0].layers.clone(), ..Skin::default() };
    assert_eq!(words(&read.skins[0]), words(&skin));
    // counter-test: another default is another word
    assert_ne!(words(&Contact { friction: 0.31, ..Contact::default() }), words(&Contact::default()));
}

/// What makes a scene one that cannot run.
type Change<'a> = &'a dyn Fn(&mut Scene);

/// What a changed scene is refused with.
fn refused(change: impl Fn(&mut Scene)) -> String {
    let mut scene = cut();
    change(&mut scene);
    let error = scene.check().expect_err("it cannot run").to_string();
    let run =
        Simulation::new(&scene, &Platform::Cpu64).map(|_| ()).expect_err("it is checked before it runs").to_string();
    assert_eq!(error, run);
    error
}

fn blade(scene: &mut Scene) -> &mut Blade {
    scene.tools[0].blade.as_mut().expect("it is a scalpel")
}

#[test]
fn what_cannot_run_is_refused_with_words() {
    let springs = Law::Springs { stiffness: Some(f64::NAN), damping: 0.0 };
    let bricks = Law::LargeTetra { material: Material::NeoHookean, element: Element::Bbar };
    let force = ProbeKind::Force { on: BodyId::Rigid(3), from: None, axis: 0 };
    let strain = |component| ProbeKind::Strain { body: 0, point: [0.0; 3], component };
    let stress = |body| ProbeKind::Stress { body, point: [0.0; 3], component: Component::VonMises };
    let centre = |of| ProbeKind::CentreOfMass { of, axis: 0 };
    let probe = |s: &mut Scene, kind| s.probes.push(Probe { name: "p".into(), kind });
    let load = Load::on_top(&Skin::default(), 1.0, [0.0; 2], [1e-3; 2]);
    let of_kind = |kind| Load { kind, ..load.clone() };
    let flat = Skin::default().top([0.0; 2], [0.0, 1e-3]);
    let path = |times: [f64; 2]| times.map(|time| Pose { time, ..Pose::default() }).to_vec();
    let sphere = Region::Sphere { centre: [f64::NAN; 3], radius: 1e-3 };
    let wire = Lines { positions: vec![[0.0; 3]], segments: vec![], radius: 0.0 };
    let group = Region::Group(Group::new("left".into(), vec![7]));
    let tie = |to| Attachment { body: 0, region: Region::Bottom, to, slide: None };
    let cases: &[(Change, &str)] = &[
        (&|s| s.time.step = 0.0, "time.step is 0"),
        (&|s| s.time.substeps = 0, "time.substeps is 0"),
        (&|s| s.time.gravity[2] = f64::NAN, "time.gravity is NaN"),
        (&|s| s.solver.tolerance = 2.0, "solver.tolerance is 2"),
        (&|s| s.skins[0].cells = [0, 4], "skins[0].cells is 0"),
        (&|s| s.skins[0].cells = [u32::MAX; 2], "skins[0].cells is"),
        (&|s| s.skins[0].size[1] = -1.0, "skins[0].size is -1"),
        (&|s| s.skins[0].layers.clear(), "skins[0].layers is none"),
        (&|s| s.skins[0].layers[0].cells = 0, "skins[0].layers[0].cells is 0"),
        (&|s| s.skins[0].layers[0].poisson = 0.5, "skins[0].layers[0].poisson is 0.5"),
        (&|s| s.skins[0].law = springs, "skins[0].law.stiffness is NaN"),
        (&|s| s.boundaries[1].body = 1, "boundaries[1].body is 1"),
        (&|s| s.loads.push(Load { body: 2, ..load.clone() }), "loads[0].body is 2"),
        (&|s| s.tools[0].mass = 0.0, "tools[0].mass is 0"),
        (&|s| s.tools[0].trajectory.clear(), "tools[0].trajectory is empty"),
        (&|s| s.tools[0].trajectory[1].time = 9.0, "tools[0].trajectory is times that do not rise"),
        (&|s| s.tools[0].trajectory[1].rotation = [1.0; 4], "tools[0].trajectory.rotation is 2"),
        (&|s| s.tools[0].mesh.triangles = vec![[0, 1, 2]], "tools[0].mesh.triangles is 0"),
        (&|s| blade(s).edge.truncate(1), "tools[0].blade.edge is fewer"),
        (&|s| blade(s).edge_spacing = 0.0, "edge_spacing, flat_spacing, depth is 0"),
        (&|s| s.attachments.push(tie(BodyId::Deformable(4))), "attachments[0].to.Deformable is 4"),
        (&|s| s.attachments.push(tie(BodyId::Deformable(0))), "attachments[0].to is the body itself"),
        (&|s| s.probes.push(Probe { name: "p".into(), kind: force.clone() }), "probes[0].on.Rigid is 3"),
        (&|s| probe(s, strain(Component::VonMises)), "probes[0].component is VonMises"),
        (&|s| probe(s, strain(Component::Entry(0, 3))), "probes[0].component is 3"),
        (&|s| probe(s, stress(7)), "probes[0].body is 7"),
        (&|s| probe(s, centre(BodyId::World)), "probes[0].of is without a mass"),
        (&|s| probe(s, ProbeKind::Spin { body: 5, axis: 0 }), "probes[0].body is 5"),
        (&|s| probe(s, ProbeKind::Volume { body: 1 }), "probes[0].body is 1"),
        (
            &|s| probe(s, ProbeKind::MeanDisplacement { body: 0, region: sphere.clone(), axis: 0 }),
            "region.centre is NaN",
        ),
        (&|s| s.contact.as_mut().expect("contact").max_passes = 0, "contact.max_contacts, max_passes is 0"),
        (&|s| s.haptic.rate = 0.0, "haptic.rate is 0"),
        (&|s| s.haptic.rate = 1e12, "haptic.rate is 1000000000000; it has to be from 100"),
        (&|s| s.time.duration = 1e12, "time.duration, step is"),
        (&|s| s.time.integrator = Integrator::Static, "time.integrator is Static, which finds the balance"),
        (
            &|s| (s.time.integrator, s.skins[0].velocity, s.tools) = (Integrator::Static, [0.1; 3], vec![]),
            "has no velocities",
        ),
        (&|s| s.view.size = [960, 9000], "view.size is 9000"),
        (&|s| s.view.eye = s.view.target, "view.eye is the target"),
        (&|s| s.tools[0].inertia = [1e-9, 1e-9, 3e-9], "tools[0].inertia is 0.000000003"),
        (&|s| s.tools[0].cuboid = Some([1e-3; 3]), "tools[0].cuboid is beside"),
        (&|s| s.skins[0].law = bricks, "skins[0].law.element is of hexahedra"),
        (
            &|s| probe(s, ProbeKind::Displacement { body: 0, point: [0.0, 0.0, 1.0], axis: 2 }),
            "probes[0].point is [0.0",
        ),
        (
            &|s| probe(s, ProbeKind::Stress { body: 0, point: [1.0; 3], component: Component::VonMises }),
            "probes[0].point",
        ),
        (&|s| s.boundaries[0].region = sphere.clone(), "boundaries[0].region.centre is NaN"),
        (
            &|s| s.loads.push(Load { region: flat.clone(), ..load.clone() }),
            "loads[0].region.min, max is without an area",
        ),
        (&|s| s.boundaries[0].region = group.clone(), "boundaries[0].region is a group with node 7"),
        (&|s| s.loads.push(Load { end: 0.0, ..load.clone() }), "loads[0].start, end is in the wrong order"),
        (&|s| s.loads.push(of_kind(LoadKind::Force([f64::NAN; 3]))), "loads[0].kind is NaN"),
        (&|s| s.loads.push(of_kind(LoadKind::Traction([f64::INFINITY; 3]))), "loads[0].kind is inf"),
        (
            &|s| s.loads.push(of_kind(LoadKind::PointForce { force: [0.0; 3], at: [0.0, 0.0, 1.0] })),
            "loads[0].kind.at is [0.0, 0.0, 1.0]",
        ),
        (&|s| s.boundaries[0].path = path([1.0, 0.0]), "boundaries[0].path is with times that do not rise"),
        (&|s| s.boundaries[0].path = path([0.0, f64::NAN]), "boundaries[0].path.time, position is NaN"),
        (&|s| s.skins[0].layers[0].pre_strain[0] = 1.5, "skins[0].layers[0].pre_strain is 1.5"),
        (&|s| s.view.field_of_view = 0.0, "view.field_of_view is 0"),
        (&|s| s.tools[0].free = Some(Motion { angular_velocity: [f64::NAN; 3], ..Motion::default() }), "tools[0].free"),
        (&|s| s.tools[0].device = Some(Device { scale: 0.0, ..Device::default() }), "tools[0].device.scale is 0"),
        (&|s| s.tools[0].lines = Some(wire.clone()), "tools[0].lines is beside"),
        (&|s| blade(s).normal = [1.0, 0.0, 0.0], "tools[0].blade.normal is 45.0 degrees off"),
        (&|s| blade(s).edge = vec![[0.0; 3], [1e-3; 3], [0.0; 3]], "tools[0].blade.edge is closed"),
        (&|s| blade(s).edge_spacing = 1e-12, "tools[0].blade.edge_spacing, flat_spacing is"),
    ];
    for (change, wanted) in cases {
        let error = refused(change);
        assert!(error.contains(wanted) && error.contains("a cut in code") && error.contains("has to be"), "{error}");
    }
    // counter-test: what runs is not refused
    let mut other = cut();
    other.solver.preconditioner = Preconditioner::Column;
    other.skins[0].law = Law::Fem { element: Element::Enhanced, corotational: false };
    assert!(other.check().is_ok());
}
