//! A device that is taken away while a scene runs, memory that is used up, and the work that a run hands over beside what `inspect` says.

use super::{Failure, platform};
use cutis::error::Error;
use cutis::gpu::{Failed, Gpu, Handle, Work};
use cutis::report::{inspect, run};
use cutis::scene::{Load, Preconditioner, Probe, ProbeKind, Region, Scene, read};
use cutis::step::{Platform, Simulation, StepReport};
use std::path::{Path, PathBuf};

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_lost_device_ends_the_run_and_leaves_what_was_done", a_lost_device_ends_the_run_and_leaves_what_was_done),
    (
        "a_device_without_memory_ends_the_run_and_leaves_what_was_done",
        a_device_without_memory_ends_the_run_and_leaves_what_was_done,
    ),
    (
        "a_device_that_fails_says_so_at_the_next_read_and_from_then_on",
        a_device_that_fails_says_so_at_the_next_read_and_from_then_on,
    ),
    ("a_run_launches_and_waits_as_inspect_says", a_run_launches_and_waits_as_inspect_says),
    ("a_step_with_contact_waits_as_inspect_says", a_step_with_contact_waits_as_inspect_says),
    ("work_is_booked_without_waiting", work_is_booked_without_waiting),
    (
        "a_reaction_of_any_number_of_nodes_is_that_of_the_cpu_path",
        a_reaction_of_any_number_of_nodes_is_that_of_the_cpu_path,
    ),
];

fn require(holds: bool, what: impl FnOnce() -> String) -> Result<(), Failure> {
    if holds { Ok(()) } else { Err(what().into()) }
}

/// A shipped scene on a few cells.
fn small(name: &str) -> Result<Scene, Failure> {
    let mut scene = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name))?;
    for skin in &mut scene.skins {
        skin.cells = skin.cells.map(|n| n.min(8));
        skin.layers.iter_mut().for_each(|layer| layer.cells = 1);
    }
    scene.checks.clear();
    (scene.view.frames, scene.view.size) = (10, [32, 24]);
    Ok(scene)
}

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

/// Steps before the device goes.
const DONE: u32 = 3;

/// Ends a run from the third step on by `fail`, and looks at what it leaves; without that it goes on to the end.
fn ended(gpu: &Gpu, name: &str, says: &str, mut fail: impl FnMut(&Handle)) -> Result<(), Failure> {
    let scene = small("verify/sphere_press.toml")?;
    let label = format!("cutis-{name}-{}-{}", std::process::id(), super::label(&gpu.adapter));
    let folder = Folder(std::env::temp_dir().join(label));
    let mut run = |fails: bool| {
        let simulation = Simulation::new(&scene, &platform(gpu))?;
        let device = simulation.bodies[0].gpu().map(Gpu::handle).ok_or("it is not on a GPU")?;
        let out = folder.0.clone();
        let options = run::Options { steps: Some(10), record: true, ..run::Options::new(platform(gpu), out) };
        let ended = run::run_prepared(&scene, &options, simulation, &mut |progress| {
            if fails && progress.step == DONE {
                fail(&device);
            }
        });
        Ok::<_, Failure>(ended.map(|summary| summary.report))
    };
    let error = match run(true)? {
        Err(error @ Error::Gpu(Failed::Device { .. })) => error,
        other => return Err(format!("ended with {:?}", other.map(|r| r.steps).map_err(|e| e.to_string())).into()),
    };
    let words = error.to_string();
    require(words.contains(says) && error.exit_code() == 1, || words.clone())?;
    let left =
        |name: &str| std::fs::read_to_string(folder.0.join(name)).map_err(|e| Failure::from(format!("{name}: {e}")));
    let report: serde_json::Value = serde_json::from_str(&left("report.json")?).map_err(|e| e.to_string())?;
    require(report["steps"] == DONE && report["error"] == words, || format!("{report}"))?;
    require(report["contact_force_n_max"].is_number() && report["probes"].is_object(), || format!("{report}"))?;
    require(left("probes.csv")?.lines().count() == 1 + DONE as usize, || left("probes.csv").unwrap_or_default())?;
    require(left("haptic.csv")?.lines().count() > 1, || "no ticks are left".into())?;
    // the picture of the last step needed the device
    let frames = std::fs::read_dir(folder.0.join("frames")).map_err(|e| e.to_string())?.count();
    require(frames == DONE as usize - 1, || format!("{frames} pictures"))?;
    // the counter-test: with its device it goes on to the end
    let whole = run(false)??;
    require(whole.steps == 10 && whole.error.is_empty(), || format!("{} steps, {}", whole.steps, whole.error))
}

fn a_lost_device_ends_the_run_and_leaves_what_was_done(gpu: &Gpu) -> Result<(), Failure> {
    ended(gpu, "lost", "the GPU device failed: it was lost", Handle::destroy)
}

/// All of the device's memory is taken: it says so itself, and the arrays of the run are whole but nothing more can be made.
fn a_device_without_memory_ends_the_run_and_leaves_what_was_done(gpu: &Gpu) -> Result<(), Failure> {
    let mut count = 0;
    ended(gpu, "memory", "its memory is used up; run again, with a smaller scene", |device| {
        count = device.exhaust().count(); // given back at once, so that nobody else is short of it
    })?;
    require(count > 1, || format!("{count} arrays were refused: that is a limit of one array, not of memory"))
}

fn a_device_that_fails_says_so_at_the_next_read_and_from_then_on(gpu: &Gpu) -> Result<(), Failure> {
    let own = Gpu::open(Some(&format!("{} {} {}", gpu.adapter.name, gpu.adapter.backend, gpu.adapter.driver)))?;
    let array = own.array_of("array", &[1u32, 2, 3, 4])?;
    require(own.check_health().is_ok() && own.read::<u32>(&array, 4)? == [1, 2, 3, 4], || {
        "it does not work to begin with".into()
    })?;
    own.handle().destroy();
    for _ in 0..2 {
        own.submit(own.batch());
        let said = own.read::<u32>(&array, 4).map_err(|e| e.to_string());
        require(said.as_ref().is_err_and(|e| e.contains("it was lost") && e.contains("run again")), || {
            format!("{said:?}")
        })?;
    }
    let array = own.array::<u32>("another", 4).map(|_| ());
    require(array.is_ok() && own.check_health().is_err(), || {
        "an array of a lost device is found out at its first read".into()
    })
}

/// Work of each of some steps, and what each has said.
fn worked(scene: &Scene, gpu: &Gpu, steps: u32) -> Result<Vec<(Work, StepReport)>, Failure> {
    let mut simulation = Simulation::new(scene, &platform(gpu))?;
    let now = |simulation: &Simulation| simulation.bodies[0].gpu().map(Gpu::work).unwrap_or_default();
    let mut before = now(&simulation);
    let mut out = vec![];
    for _ in 0..steps {
        let report = simulation.step(false)?;
        let after = now(&simulation);
        let work = Work {
            dispatches: after.dispatches - before.dispatches,
            read_backs: after.read_backs - before.read_backs,
            compiled: after.compiled - before.compiled,
        };
        out.push((work, report));
        before = after;
    }
    // what a step leaves recorded is handed over by the next one: from the second on, each hands over the work of a whole step
    Ok(out.split_off(1))
}

/// A reaction reads displacements and velocities of its nodes, in parts where they are more than one read holds, which is no multiple of four.
fn a_reaction_of_any_number_of_nodes_is_that_of_the_cpu_path(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = small("verify/sphere_press.toml")?;
    (scene.tools, scene.contact) = (vec![], None);
    scene.time.gravity = [0.0, 0.0, -9.81];
    for (cells, nodes) in [(4, 50), (5, 72), (6, 98)] {
        scene.skins[0].cells = [cells; 2];
        scene.skins[0].layers.truncate(1);
        let kind = ProbeKind::Reaction { body: 0, region: Region::All, axis: 2 };
        scene.probes = vec![Probe { name: "all".into(), kind }];
        let force = |platform| -> Result<f64, Failure> {
            let mut simulation = Simulation::new(&scene, &platform)?;
            let count = simulation.bodies[0].model.rest.len();
            require(count == nodes, || format!("{count} nodes, {nodes} wanted"))?;
            simulation.step(false)?;
            Ok(simulation.step(false)?.probes[0])
        };
        let (found, wanted) = (force(platform(gpu))?, force(Platform::Cpu64)?);
        let near = (found - wanted).abs() <= 1e-3 * wanted.abs() && wanted != 0.0;
        require(near, || format!("{cells} × {cells} cells: {found} N, on the CPU path {wanted}"))?;
    }
    Ok(())
}

/// What a plan says happens so many times per step, in all.
fn per_step(list: &[inspect::Count]) -> u64 {
    list.iter().filter(|count| count.per == "step").map(|count| u64::from(count.count)).sum()
}

/// Energy costs an unchecked step no wait, and no launch: but for the displacements under a load where it changes.
fn work_is_booked_without_waiting(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = small("verify/sphere_press.toml")?;
    (scene.tools, scene.contact) = (vec![], None);
    scene.probes.clear();
    let half = [1e-3; 2];
    let skin = scene.skins[0].clone();
    let load = |pressure, end| Load { end, ..Load::on_top(&skin, pressure, half.map(|h| -h), half) };
    // one that stays, and one so small that its end, with step 7 of 10, costs the solver nothing
    let waits = |end: f64, scene: &mut Scene| -> Result<Vec<u64>, Failure> {
        scene.loads = vec![load(100.0, f64::INFINITY), load(1e-6, end)];
        Ok(worked(scene, gpu, 10)?.iter().map(|(work, _)| work.read_backs).collect())
    };
    let (ends, goes_on) = (waits(5.5 * scene.time.step, &mut scene)?, waits(f64::INFINITY, &mut scene)?);
    let planned = per_step(&inspect::inspect(&scene)?.read_backs);
    let more: Vec<u64> = ends.iter().zip(&goes_on).map(|(ends, goes_on)| ends.abs_diff(*goes_on)).collect();
    require(goes_on.iter().min() == Some(&planned), || format!("{goes_on:?} waits, inspect says {planned}"))?;
    require(more == [0, 0, 0, 0, 0, 1, 0, 0, 0], || format!("{ends:?} waits, without the end {goes_on:?}"))
}

fn a_run_launches_and_waits_as_inspect_says(gpu: &Gpu) -> Result<(), Failure> {
    let mut free = small("verify/sphere_press.toml")?;
    (free.tools, free.contact) = (vec![], None);
    let mut springs = small("skin_springs.toml")?;
    springs.time.duration = springs.time.step * 20.0;
    let mut plain = free.clone();
    plain.probes.clear();
    plain.solver.preconditioner = Preconditioner::Jacobi;
    let mut far = small("incision.toml")?;
    far.tools.iter_mut().flat_map(|tool| &mut tool.trajectory).for_each(|pose| pose.position[2] += 0.1);
    for (name, scene) in
        [("free skin", free), ("plain solver", plain), ("springs", springs), ("a blade that is far", far)]
    {
        let plan = inspect::inspect(&scene)?;
        let solver = plan.dispatches.iter().find(|count| count.name == "solver").ok_or("no solver in the plan")?;
        let (launches, waits) = (per_step(&plan.dispatches), per_step(&plan.read_backs));
        let steps = worked(&scene, gpu, 8)?;
        for (work, report) in &steps {
            let (iterations, contacts) = (report.free.iterations, report.contact.count());
            let of_solver = work.dispatches.checked_sub(launches).ok_or("fewer launches than per step")?;
            let rounds = of_solver / u64::from(solver.count);
            let words = || {
                format!(
                    "{name}: {work:?} with {iterations} iterations; inspect says {launches} and {} each",
                    solver.count
                )
            };
            require(contacts > 0 || of_solver % u64::from(solver.count) == 0, words)?;
            require(contacts > 0 || rounds >= u64::from(iterations), words)?;
        }
        // once the count of iterations is known, a step waits for the solver once
        let free = |step: &&(Work, StepReport)| step.1.contact.count() == 0;
        let fewest = steps.iter().filter(free).map(|step| step.0.read_backs).min();
        require(fewest.is_none_or(|fewest| fewest == waits), || {
            format!("{name}: {fewest:?} waits, inspect says {waits}")
        })?;
        require(steps.iter().any(|step| free(&step)), || {
            format!("{name}: it touches all the time, so nothing was compared")
        })?;
    }
    Ok(())
}

/// A sphere that rests on the skin, and a blade that cuts it: what a step waits for beside its passes, columns and cuts is what the plan
/// says of each step, where the tool comes near no other faces and no solve takes longer than expected.
fn a_step_with_contact_waits_as_inspect_says(gpu: &Gpu) -> Result<(), Failure> {
    let blade = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml"))?.in_test_form();
    let sphere = small("verify/sphere_press.toml")?;
    let (mut probed, mut unprobed) = (sphere.clone(), sphere);
    let kinds = [
        ProbeKind::Displacement { body: 0, point: [0.0; 3], axis: 2 },
        ProbeKind::Reaction { body: 0, region: Region::Bottom, axis: 2 },
    ];
    probed.probes.extend(kinds.map(|kind| Probe { name: "probe".into(), kind }));
    unprobed.probes.clear();
    for (name, scene, steps) in
        [("a sphere", probed, 12), ("a sphere without probes", unprobed, 12), ("a blade", blade, 56)]
    {
        let waits = per_step(&inspect::inspect(&scene)?.read_backs);
        let mut fewest = [u64::MAX; 2]; // of steps that sever nothing, and of those that sever
        let presses = |step: &&(Work, StepReport)| step.1.contact.largest_on_tools() > 0.0;
        for (work, report) in worked(&scene, gpu, steps)?.iter().filter(presses) {
            let severs = usize::from(report.severed > 0);
            let passes = u64::from(report.contact.passes + report.contact.columns.div_ceil(6)) + severs as u64;
            fewest[severs] = fewest[severs].min(work.read_backs.saturating_sub(passes));
        }
        // few steps sever, and an edge that moves on comes near other faces in each of them
        let as_planned = fewest[0] == waits && (fewest[1] == u64::MAX || fewest[1] <= waits + 1);
        require(as_planned, || format!("{name}: {fewest:?} waits, inspect says {waits}"))?;
        require((name == "a blade") == (fewest[1] < u64::MAX), || format!("{name}: severs or not, {fewest:?}"))?;
    }
    Ok(())
}
