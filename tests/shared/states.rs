//! Runs that go on from a state, bit for bit as if they had not been interrupted: on any platform.

use cutis::scene::{BodyId, Component, Law, Probe, ProbeKind, Region, Scene, read};
use cutis::step::{Platform, Simulation, State, StepReport};
use std::path::Path;

/// Scenes in their test forms, the step after which the state is taken, and all steps: in contact, and between two cuts of a blade.
pub const SCENES: &[(&str, usize, usize)] = &[
    ("incision", 37, 44),
    ("dental_probe", 22, 34),
    ("skin_springs", 35, 40),
    ("skin_springs_tetra", 55, 62),
    ("verify/stack_five_soft", 3, 6),
    ("hard/press_50kpa", 2, 5),
];

/// A shipped scene in its test form.
pub fn scene(name: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.toml"));
    read(&file).unwrap_or_else(|e| panic!("{e}")).in_test_form()
}

/// Adds a probe of each kind that reads from the first body.
fn probed(scene: &mut Scene) {
    let point = [0.4e-3, 0.3e-3, 1.9e-3];
    let (body, axis, component) = (0, 2, Component::Entry(2, 2));
    let mut kinds = vec![
        ProbeKind::Displacement { body, point, axis },
        ProbeKind::MeanDisplacement { body, region: Region::Top, axis },
        ProbeKind::Reaction { body, region: Region::All, axis },
        ProbeKind::VolumeChange { body },
        ProbeKind::CentreOfMass { of: BodyId::Deformable(body), axis },
    ];
    // a mesh of springs has no strain at a point
    if scene.skins[body].mesh.is_none() {
        kinds.push(ProbeKind::Strain { body, point, component });
    }
    if scene.contact.is_some() {
        kinds.push(ProbeKind::Pressure { body, region: Region::Top });
    }
    if !matches!(scene.skins[body].law, Law::Springs { .. }) {
        kinds.push(ProbeKind::Stress { body, point, component: Component::VonMises });
    }
    scene.probes.extend(kinds.into_iter().map(|kind| Probe { name: "own".into(), kind }));
}

pub fn simulation(scene: &Scene, platform: &Platform) -> Simulation {
    Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{}: {e}", scene.title))
}

/// Steps on; a third of them are checked in f64. Reports without times.
pub fn steps(simulation: &mut Simulation, count: usize) -> Vec<StepReport> {
    let one = |k| {
        let mut report = simulation.step(k % 3 == 0).unwrap_or_else(|e| panic!("{e}"));
        report.costs.seconds = Default::default();
        report
    };
    (0..count).map(one).collect()
}

/// Every number of some reports, and of the state after them: floats as the shortest text that reads back the same.
pub fn text(reports: &[StepReport], simulation: &mut Simulation) -> String {
    format!("{reports:?} {:?}", simulation.state().expect("no device fails"))
}

/// As written to a file and read back.
fn kept(state: &State) -> State {
    let bytes = postcard::to_stdvec(state).expect("a state has bytes");
    postcard::from_bytes(&bytes).expect("its own bytes are a state")
}

/// Whether `k` steps, the state, and the rest of `n` steps from it are `n` steps; says where they part.
pub fn resumes(name: &str, platform: &Platform, k: usize, n: usize) -> Result<(), String> {
    let mut scene = scene(name);
    probed(&mut scene);
    let mut first = simulation(&scene, platform);
    steps(&mut first, k);
    let state = kept(&first.state().map_err(|e| e.to_string())?);
    let rest = steps(&mut first, n - k);
    let wanted = text(&rest, &mut first);
    let touches = rest.iter().any(|step| !step.contact.contacts.is_empty());
    let cuts = rest.iter().any(|step| step.severed > 0);
    if touches != scene.contact.is_some() || cuts != scene.tools.iter().any(|tool| tool.blade.is_some()) {
        return Err(format!("{name}: after {k} steps nothing touches, or nothing is cut"));
    }
    // a simulation that is new, and one that has come further
    for mut second in [simulation(&scene, platform), first] {
        second.restore(&state).map_err(|e| e.to_string())?;
        let reports = steps(&mut second, n - k);
        let found = text(&reports, &mut second);
        if let Some(at) = found.bytes().zip(wanted.bytes()).position(|(a, b)| a != b) {
            let [found, wanted] = [&found, &wanted].map(|text| &text[at.saturating_sub(80)..(at + 40).min(text.len())]);
            return Err(format!("{name} on {platform:?}: {found} instead of {wanted}"));
        }
    }
    Ok(())
}
