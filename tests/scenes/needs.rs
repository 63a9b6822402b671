//! Only what a scene needs is made: `inspect` states it for every shipped scene, and a feature takes its kernels, arrays and read-backs
//! with it when it goes.

use cutis::backend::{GpuBackend, Needs, Snapshot};
use cutis::bodies::{Kind, Model};
use cutis::gpu::{Gpu, Made};
use cutis::kernels::Params;
use cutis::mesh::Parts;
use cutis::report::inspect::{Plan, inspect};
use cutis::scene::{
    Correction, Element, Law, Mass, Material, Preconditioner, ProbeKind, Region, RestSpring, Scene, read,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// A shipped scene on a few cells.
fn small(name: &str) -> Scene {
    let mut scene = read(&scenes().join(name)).unwrap_or_else(|e| panic!("{e}"));
    scene.skins.iter_mut().for_each(|skin| skin.cells = skin.cells.map(|n| n.min(6)));
    scene
}

fn said(arguments: &[&str]) -> String {
    let ran = Command::new(env!("CARGO_BIN_EXE_cutis")).args(arguments).output().expect("the program is built");
    assert!(ran.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8_lossy(&ran.stdout).into_owned()
}

/// Scene files in a folder and below.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).expect("the scenes are there").flatten().map(|entry| entry.path()) {
        match path.extension() {
            _ if path.is_dir() => files(&path, found),
            Some(end) if end == "toml" => found.push(path),
            _ => {}
        }
    }
}

#[test]
fn inspect_states_what_every_shipped_scene_makes_and_does() {
    let mut all = vec![];
    files(&scenes(), &mut all);
    assert!(all.len() > 20, "{all:?}");
    for path in all {
        let name = path.to_str().expect("a plain name");
        let scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        if scene.solver.preconditioner == Preconditioner::Direct {
            let refused = inspect(&scene).map(drop).expect_err("a GPU has no direct solver").to_string();
            assert!(refused.contains("the direct solver runs on the CPU path"), "{name}: {refused}");
            continue;
        }
        let text = said(&["inspect", name]);
        let plan: serde_json::Value = serde_json::from_str(&said(&["inspect", name, "--json"])).expect("whole JSON");
        let list = |key: &str| plan[key].as_array().unwrap_or_else(|| panic!("{name}: no {key}")).clone();
        if scene.skins.is_empty() {
            assert!(list("kernels").is_empty() && list("arrays").is_empty(), "{name}: rigid bodies need no device");
            continue;
        }
        let bytes: u64 = list("arrays").iter().filter_map(|array| array["bytes"].as_u64()).sum();
        assert_eq!(plan["device_bytes"].as_u64(), Some(bytes), "{name}");
        for key in ["kernels", "arrays", "dispatches", "read_backs"] {
            assert!(!list(key).is_empty(), "{name}: no {key}");
            for entry in list(key) {
                let word = entry.as_str().or(entry["name"].as_str()).expect("a name");
                assert!(text.contains(word), "{name}: the text does not name {word} of {key}");
            }
        }
        for entry in list("dispatches").iter().chain(&list("read_backs")) {
            let [count, per] = [entry["count"].to_string(), entry["per"].as_str().expect("per what").to_string()];
            assert!(
                entry["count"].as_u64() > Some(0) && text.contains(&per) && text.contains(&count),
                "{name}: {entry}"
            );
        }
    }
}

/// Arrays, launches and kernels of a body's set-up.
fn set_up(scene: &Scene, model: &Model, needs: Needs, start: &Snapshot) -> (Vec<Made>, [u32; 4], Vec<&'static str>) {
    let gpu = Gpu::dry().expect("wgpu has its no-op device");
    let solver = scene.solver;
    let backend = GpuBackend::new(gpu, model, needs, solver.max_iterations, solver.floor, start);
    let backend = backend.unwrap_or_else(|e| panic!("{}: {e}", scene.file.display()));
    (backend.gpu().arrays(), backend.launches(), backend.gpu().kernels())
}

/// Bytes of the arrays that a model has on the host.
fn bytes_of_arrays(model: &Model) -> usize {
    let own = match &model.kind {
        Kind::Springs(s) => {
            let of_mesh = &s.tetrahedra;
            let lists = size_of_val(&of_mesh.first[..]) + size_of_val(&of_mesh.around[..]);
            let around = size_of_val(&s.first[..]) + size_of_val(&s.half[..]) + size_of_val(&s.breaks_at[..]);
            size_of_val(&s.ends[..]) + size_of_val(&s.law[..]) + around + size_of_val(&of_mesh.springs[..]) + lists
        }
        Kind::Hexahedra(h) => {
            let factors = h.hyperelastic.as_ref().map_or(0, |law| size_of_val(&law.rounded_scale::<f64>()[..]));
            size_of_val(&h.stiffness[..]) + size_of_val(&h.pre_strain[..]) + factors
        }
        Kind::Tetrahedra(t) => {
            let a = &t.arrays;
            let of_elements = size_of_val(&a.corners[..]) + size_of_val(&a.gradients[..]);
            let around =
                size_of_val(&a.first_of_node[..]) + size_of_val(&a.of_node[..]) + size_of_val(&a.per_volume[..]);
            let domains =
                size_of_val(&a.first_of_domain[..]) + size_of_val(&a.of_domain[..]) + size_of_val(&a.shear[..]);
            let of = &a.patches;
            let patches = size_of_val(&of.corners[..]) + size_of_val(&of.first[..]) + size_of_val(&of.members[..]);
            let law = size_of_val(&a.laws[..]) + patches + size_of_val(&of.per_volume[..]);
            of_elements + around + domains + law + size_of_val(&a.domains[..]) + size_of_val(&a.rest_block[..])
        }
    };
    let nodes = size_of_val(&model.rest[..]) + size_of_val(&model.dofs[..]) + size_of_val(&model.prescribed[..]);
    let rest_springs = size_of_val(&model.rest_springs.nodes[..]) + size_of_val(&model.rest_springs.stiffness[..]);
    let mesh = model.grid.unstructured.as_ref().map_or(0, |of| {
        // triangles, their boxes twice, and which of them each tetrahedron is in
        let (mesh, boxes) = (&of.mesh, 2 * size_of_val(&of.outside.behind[..]));
        let outside = size_of_val(&of.outside.faces[..]) + boxes + 4 * mesh.tetrahedra().len();
        let file = size_of_val(mesh.nodes()) + size_of_val(mesh.tetrahedra()) + size_of_val(mesh.layers());
        file + outside + size_of_val(&of.around[..]) + of.links.bytes()
    });
    let embedded = model.grid.embedded.as_ref().map_or(0, |of| {
        let surface = size_of_val(of.surface.points()) + size_of_val(of.surface.triangles());
        let cells = size_of_val(&of.share[..]) + size_of_val(&of.mass[..]);
        let points = size_of_val(&of.nodes[..]) + size_of_val(&of.weights[..]);
        surface + cells + points + size_of_val(&of.outside[..]) + size_of_val(&of.behind[..])
    });
    own + nodes + rest_springs + mesh + embedded + size_of_val(&model.shape[..])
}

/// Sizes that a model of sizes states, beside those of the arrays that the model has.
fn sizes_are_of_the_arrays(scene: &Scene, body: usize) {
    let name = scene.file.display();
    let model = Model::new(scene, body).unwrap_or_else(|e| panic!("{name}: {e}"));
    let sizes = Model::of_sizes(scene, body).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(sizes.rest.is_empty() && sizes.dofs.is_empty() && sizes.prescribed.is_empty(), "{name}");
    assert!(sizes.rest_springs.nodes.is_empty() && sizes.paths.nodes.is_empty(), "{name}");
    // nodes, degrees of freedom, springs of both kinds
    assert_eq!([sizes.own_nodes(), sizes.node_count()], [model.rest.len(), model.dofs.len()], "{name}");
    assert_eq!(
        [sizes.rest_spring_count(), sizes.driven_count()],
        [model.rest_springs.nodes.len(), model.paths.nodes.len()],
        "{name}"
    );
    assert_eq!(sizes.degrees_of_freedom(), model.degrees_of_freedom(), "{name}");
    assert_eq!(sizes.elements(), model.elements(), "{name}");
    assert_eq!([sizes.host_bytes(), model.host_bytes()], [bytes_of_arrays(&model) as u64; 2], "{name}");
    let (segments, mechanics) = (model.mechanics().segments(&model), sizes.mechanics());
    let counts = [mechanics.segment_count(&sizes), mechanics.point_count(&sizes)];
    assert_eq!(counts, [segments.ends.len(), segments.rest.len()], "{name}");
    match (&model.kind, &sizes.kind) {
        (Kind::Springs(springs), Kind::Springs(none)) => {
            assert!(none.ends.is_empty() && none.half.is_empty(), "{name}");
            let count = sizes.elements().spring_count;
            assert_eq!(
                [springs.ends.len(), springs.law.len(), springs.half.len()],
                [count, count, 2 * count],
                "{name}"
            );
            assert_eq!(springs.first.len(), sizes.own_nodes() + 1, "{name}");
        }
        (Kind::Hexahedra(_), Kind::Hexahedra(hexahedra)) => {
            let params: Params<f64> = model.params();
            let words = if hexahedra.extra_columns > 0 { params.layout().words } else { 0 };
            assert_eq!(Parts::new(params).table().len(), words, "{name}");
            let levels = |model: &Model| -> Vec<(usize, usize)> {
                let coarse = model.hexahedra().multigrid.iter().flat_map(|m| &m.coarse);
                coarse.map(|level| (level.params(params).node_count as usize, level.dofs.len())).collect()
            };
            assert!(levels(&model).iter().all(|(stated, there)| stated == there), "{name}: {:?}", levels(&model));
            let stated: Vec<(usize, usize)> = levels(&model).iter().map(|(stated, _)| (*stated, 0)).collect();
            assert_eq!(levels(&sizes), stated, "{name}");
        }
        (Kind::Tetrahedra(_), Kind::Tetrahedra(none)) => assert!(none.arrays.corners.is_empty(), "{name}"),
        _ => panic!("{name}: elements of another kind"),
    }
    // what a device is given
    let [of_model, of_sizes] = [&model, &sizes].map(|model| cutis::step::needs(scene, model));
    assert_eq!(of_sizes, of_model, "{name}");
    let start = cutis::step::start(scene, &model);
    let whole = set_up(scene, &model, of_model, &start);
    assert!(!whole.0.is_empty(), "{name}");
    assert_eq!(set_up(scene, &sizes, of_sizes, &Snapshot::default()), whole, "{name}");
}

#[test]
fn a_model_of_sizes_states_the_arrays_of_every_shipped_scene() {
    let mut all = vec![];
    files(&scenes(), &mut all);
    let (mut springs, mut driven, mut split) = (0, 0, 0);
    for path in all {
        let scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        if scene.solver.preconditioner == Preconditioner::Direct {
            continue;
        }
        for body in 0..scene.skins.len() {
            sizes_are_of_the_arrays(&scene, body);
            let sizes = Model::of_sizes(&scene, body).unwrap_or_else(|e| panic!("{e}"));
            springs += sizes.elements().spring_count;
            driven += sizes.driven_count();
            split += sizes.mechanics().extra_columns();
        }
    }
    // the shipped scenes have each, so none of the above compares nothing with nothing; rest-shape springs have a test of their own
    assert!([springs, driven, split].iter().all(|n| *n > 0), "{springs} {driven} {split}");
}

#[test]
fn regions_that_overlap_are_counted_once() {
    let mut scene = small("incision.toml");
    scene.skins[0].mass = Mass::Lumped;
    let rest_spring = |region| RestSpring { body: 0, region, stiffness: 1.0 };
    scene.rest_springs = vec![rest_spring(Region::Top), rest_spring(Region::Sides), rest_spring(Region::Top)];
    sizes_are_of_the_arrays(&scene, 0);
    let mut without = scene.clone();
    without.rest_springs.pop();
    let [a, b] = [scene, without].map(|scene| Model::of_sizes(&scene, 0).expect("valid").rest_spring_count());
    assert!(a == b && a > 0, "{a} {b}");
}

/// Kernels, arrays and read-backs by name, with how often each is there.
fn parts(plan: &Plan) -> BTreeMap<String, i64> {
    let mut out = BTreeMap::new();
    let kernels = plan.kernels.iter().map(|kernel| format!("kernel {kernel}"));
    let arrays = plan.arrays.iter().map(|array| format!("array {}: {}", array.purpose, array.name));
    let waits = plan.read_backs.iter().map(|count| format!("wait {} per {}", count.name, count.per));
    out.insert("right-hand side".into(), plan.right_hand_sides as i64);
    for part in kernels.chain(arrays).chain(waits) {
        *out.entry(part).or_default() += 1;
    }
    out
}

/// What a scene has that another one has not.
fn beyond(with: &Scene, without: &Scene) -> Vec<String> {
    let [with, without] = [with, without].map(|scene| parts(&inspect(scene).unwrap_or_else(|e| panic!("{e}"))));
    let more = with.into_iter().map(|(part, count)| (count - without.get(&part).copied().unwrap_or(0), part));
    more.filter(|(count, _)| *count > 0).map(|(count, part)| format!("{count} {part}")).collect()
}

/// A skin on its bed, without anything else.
fn bare() -> Scene {
    let mut scene = small("incision.toml");
    (scene.tools, scene.contact, scene.probes, scene.loads, scene.rest_springs) =
        (vec![], None, vec![], vec![], vec![]);
    scene.solver.preconditioner = Preconditioner::Column;
    scene.skins[0].mass = Mass::Lumped;
    law_of(&mut scene, true);
    scene.skins[0].layers.iter_mut().for_each(|layer| layer.pre_strain = [0.0; 2]);
    scene
}

fn touched() -> Scene {
    let shipped = small("incision.toml");
    let mut scene = bare();
    (scene.tools, scene.contact) = (shipped.tools, shipped.contact);
    scene.tools.iter_mut().for_each(|tool| tool.blade = None);
    scene
}

fn cutting() -> Scene {
    let mut scene = touched();
    scene.tools = small("incision.toml").tools;
    scene
}

fn changed(scene: &Scene, change: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = scene.clone();
    change(&mut scene);
    scene
}

fn law_of(scene: &mut Scene, corotational: bool) {
    scene.skins[0].law = Law::Fem { element: Element::Bbar, corotational };
}

/// Ties a node to its rest position.
fn tied(scene: &mut Scene) {
    scene.contact = touched().contact;
    let region = cutis::scene::Region::Sphere { centre: [0.0; 3], radius: 1e-3 };
    scene.attachments.push(cutis::scene::Attachment { body: 0, region, to: cutis::scene::BodyId::World, slide: None });
}

/// Feature, the scene with it, the scene without, and what it adds.
fn table() -> Vec<(&'static str, Scene, Scene, &'static [&'static str])> {
    let probe = |kind: ProbeKind| cutis::scene::Probe { name: "p".into(), kind };
    let held = cutis::scene::Region::Bottom;
    let displacement = probe(ProbeKind::Displacement { body: 0, point: [0.0; 3], axis: 2 });
    let reaction = probe(ProbeKind::Reaction { body: 0, region: held.clone(), axis: 2 });
    let rest_spring = cutis::scene::RestSpring { body: 0, region: held, stiffness: 1.0 };
    let load = cutis::scene::Load {
        end: 1.0,
        ..cutis::scene::Load::on_top(&cutis::scene::Skin::default(), 1.0, [-1e-3; 2], [1e-3; 2])
    };
    let uncoupled = changed(&touched(), |s| s.contact.iter_mut().for_each(|c| c.correction = Correction::Uncoupled));
    vec![
        (
            "tools",
            touched(),
            bare(),
            &[
                "1 array exchange with the host: ids",
                "2 array exchange with the host: params",
                "1 array exchange with the host: tile_bounds",
                "1 array exchange with the host: values",
                "1 array solver: params",
                "1 kernel bounds",
                "1 kernel scatter",
                "7 right-hand side",
                "1 wait compliance per two nodes that the tools newly reach",
                "1 wait contact per step whose tools come near other faces",
                "1 wait correction per pass",
                "1 wait state per step",
            ],
        ),
        (
            "a blade",
            cutting(),
            touched(),
            &[
                "1 array cut: ends",
                "1 array cut: hit_count",
                "1 array cut: hits",
                "1 array cut: pairs",
                "2 array cut: params",
                "1 array cut: point_before",
                "1 array cut: point_u",
                "1 array cut: quads",
                "1 array cut: rest",
                "1 kernel centres",
                "1 kernel cut",
                "1 kernel duplicate",
                "1 kernel split_product",
                "1 wait cut per step that severs links or springs",
            ],
        ),
        (
            "exact correction",
            touched(),
            uncoupled.clone(),
            &[
                "6 right-hand side",
                "1 wait compliance per two nodes that the tools newly reach",
                "1 wait correction per pass",
            ],
        ),
        (
            "uncoupled correction",
            uncoupled,
            touched(),
            &[
                "1 array exchange with the host: block",
                "1 array exchange with the host: params",
                "1 wait blocks per step with contact",
            ],
        ),
        (
            "attachments",
            changed(&bare(), tied),
            bare(),
            &[
                "1 array exchange with the host: ids",
                "2 array exchange with the host: params",
                "1 array exchange with the host: tile_bounds",
                "1 array exchange with the host: values",
                "1 array solver: params",
                "1 kernel bounds",
                "1 kernel scatter",
                "7 right-hand side",
                "1 wait compliance per two nodes that the tools newly reach",
                "1 wait contact per step whose tools come near other faces",
                "1 wait correction per pass",
                "1 wait state per step",
            ],
        ),
        (
            "a probe of a displacement",
            changed(&bare(), |s| s.probes.push(displacement)),
            bare(),
            &["1 wait state per step"],
        ),
        ("a probe of a reaction", changed(&bare(), |s| s.probes.push(reaction)), bare(), &["1 wait state per step"]),
        (
            "rest_springs",
            changed(&bare(), |s| s.rest_springs.push(rest_spring)),
            bare(),
            &[
                "1 array rest_springs: dofs",
                "1 array rest_springs: ids",
                "1 array rest_springs: params",
                "1 array rest_springs: spring_stiffness",
                "1 kernel rest_springs",
            ],
        ),
        ("loads", changed(&bare(), |s| s.loads.push(load)), bare(), &["1 wait loads per step in which a load changes"]),
        (
            "multigrid",
            changed(&bare(), |s| s.solver.preconditioner = Preconditioner::Multigrid),
            bare(),
            &[
                "2 array multigrid: block",
                "3 array multigrid: d",
                "2 array multigrid: dofs",
                "2 array multigrid: modes",
                "17 array multigrid: params",
                "1 array multigrid: partial_gamma",
                "2 array multigrid: partial_product",
                "2 array multigrid: r",
                "2 array multigrid: rotation",
                "2 array multigrid: stiffness",
                "2 array multigrid: w",
                "2 array multigrid: z",
                "1 kernel coarsen",
                "1 kernel converge",
                "1 kernel prolongation",
                "1 kernel relax",
                "1 kernel restriction",
            ],
        ),
        (
            "corotational hexahedra",
            changed(&bare(), |s| law_of(s, true)),
            changed(&bare(), |s| law_of(s, false)),
            &["1 kernel rotations"],
        ),
        (
            "a consistent mass",
            changed(&bare(), |s| s.skins[0].mass = Mass::Consistent),
            bare(),
            &["1 array state: mean_v", "1 array state: stiffness", "1 kernel momentum"],
        ),
        ("a pre-strain", changed(&bare(), |s| s.skins[0].layers[0].pre_strain = [0.1; 2]), bare(), &[]),
        (
            "neo-Hookean hexahedra and Newton's method",
            changed(&bare(), |s| (s.skins[0].law, s.solver.newton) = (Law::Hyperelastic(Material::NeoHookean), true)),
            changed(&bare(), |s| law_of(s, true)),
            &[
                "1 array hyperelastic law: b",
                "1 array hyperelastic law: corner_force",
                "1 array hyperelastic law: displacement",
                "1 array hyperelastic law: dx",
                "1 array hyperelastic law: dx_next",
                "1 array hyperelastic law: energy",
                "1 array hyperelastic law: fibres",
                "1 array hyperelastic law: material",
                "2 array hyperelastic law: params",
                "1 array hyperelastic law: partial_product",
                "1 array hyperelastic law: potential_and_residual",
                "1 array hyperelastic law: predicted_decrease",
                "1 array hyperelastic law: residual_force",
                "1 array hyperelastic law: residual_force_next",
                "1 array hyperelastic law: scalars",
                "1 array hyperelastic law: scale",
                "1 array hyperelastic law: w",
                "2 array solver: params",
                "1 kernel collect",
                "1 kernel collect_product",
                "1 kernel hyperelastic_forces",
                "1 kernel hyperelastic_tangent",
                "1 kernel residual",
                "1 kernel trial_point",
                "1 wait line search per trial point",
                "1 wait solver per Newton iteration",
            ],
        ),
        (
            "neo-Hookean hexahedra that are touched",
            changed(&touched(), |s| s.skins[0].law = Law::Hyperelastic(Material::NeoHookean)),
            changed(&touched(), |s| law_of(s, true)),
            &[
                "1 array hyperelastic law: corner_force",
                "1 array hyperelastic law: energy",
                "1 array hyperelastic law: fibres",
                "1 array hyperelastic law: material",
                "1 array hyperelastic law: scale",
                "1 kernel collect",
                "1 kernel hyperelastic_forces",
            ],
        ),
        (
            "steps with contact that are solved in full",
            changed(&touched(), |s| {
                (s.skins[0].law, s.solver.newton) = (Law::Hyperelastic(Material::NeoHookean), true)
            }),
            changed(&touched(), |s| s.skins[0].law = Law::Hyperelastic(Material::NeoHookean)),
            &[
                "1 array defect of the linearisation: end",
                "1 array defect of the linearisation: f_end",
                "2 array defect of the linearisation: params",
                "1 array defect of the linearisation: partial_product",
                "1 array defect of the linearisation: scalars",
                "1 array defect of the linearisation: v",
                "1 array defect of the linearisation: w",
                "1 kernel defect",
                "1 wait solver per solve of a step, 2 to 4 times",
            ],
        ),
        (
            "springs",
            changed(&bare(), |s| s.skins[0].law = Law::Springs { stiffness: Some(1.0), damping: 0.0 }),
            bare(),
            &[
                "1 array state: first",
                "1 array state: half",
                "1 array state: law",
                "1 array state: rest",
                "1 array state: tangent",
                "1 kernel springs",
                "1 kernel springs_blocks",
                "1 kernel springs_product",
            ],
        ),
        (
            "hexahedra",
            bare(),
            changed(&bare(), |s| s.skins[0].law = Law::Springs { stiffness: Some(1.0), damping: 0.0 }),
            &[
                "1 array state: layer_of",
                "1 array state: modes",
                "1 array state: pre_strain",
                "1 array state: rotation",
                "1 array state: shape",
                "1 array state: split",
                "1 array state: stiffness",
                "1 kernel blocks",
                "1 kernel forces",
                "1 kernel product",
                "1 kernel rotations",
            ],
        ),
    ]
}

#[test]
fn a_feature_takes_its_kernels_arrays_and_read_backs_with_it() {
    let mut wrong = vec![];
    for (name, with, without, wanted) in table() {
        let found = beyond(&with, &without);
        if found != wanted {
            wrong.push(format!(
                "{name}:\n        {}",
                found.iter().map(|f| format!("\"{f}\",")).collect::<Vec<_>>().join("\n        ")
            ));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
