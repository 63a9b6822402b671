//! What a feature costs that is there and has nothing to do: a skin alone, and the same skin with a tool that is far away, a blade that
//! cuts nothing, probes, a load that has not begun. Steps of both are taken in turn, and the medians compared; a step of both takes the
//! same iterations, or the ratio would mean nothing. Prints the table of `benches/results/two_cores/idle.md`.

use cutis::gpu::Gpu;
use cutis::scene::{Load, Plane, Probe, ProbeKind, Region, Scene};
use cutis::step::{Platform, Simulation};
use std::path::Path;
use std::time::Instant;

/// Pairs of steps. The first row, of the same skin twice, says how far medians of so many are from each other by chance.
const PAIRS: usize = 201;
/// Steps before the clock starts, in which the skin settles.
const WARM_UP: usize = 20;
/// How far away what is far is, m.
const FAR: f64 = 0.2;

fn shipped(name: &str) -> Scene {
    let mut scene = cutis::scene::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name))
        .expect("the shipped scene is valid");
    scene.skins.iter_mut().for_each(|skin| skin.cells = [32, 24]);
    scene
}

/// The skin of the incision alone.
fn alone() -> Scene {
    let mut scene = shipped("incision.toml");
    (scene.tools, scene.contact, scene.probes, scene.checks) = (vec![], None, vec![], vec![]);
    scene
}

/// With the tool of a scene, far above.
fn with_tool(name: &str, blade: bool) -> Scene {
    let (mut scene, other) = (alone(), shipped(name));
    (scene.tools, scene.contact) = (other.tools, other.contact);
    scene.tools.truncate(1);
    for tool in &mut scene.tools {
        tool.trajectory.iter_mut().for_each(|pose| pose.position[2] += FAR);
        if !blade {
            tool.blade = None;
        }
    }
    scene
}

fn variants() -> Vec<(&'static str, Scene)> {
    let probe = |name: &str, kind: ProbeKind| Probe { name: name.into(), kind };
    let of = |change: &dyn Fn(&mut Scene)| {
        let mut scene = alone();
        change(&mut scene);
        scene
    };
    let moved =
        |s: &mut Scene| s.probes.push(probe("u", ProbeKind::Displacement { body: 0, point: [0.0; 3], axis: 2 }));
    let held =
        |s: &mut Scene| s.probes.push(probe("f", ProbeKind::Reaction { body: 0, region: Region::Bottom, axis: 2 }));
    let load = |s: &mut Scene| {
        let load = Load::on_top(&s.skins[0], 1e3, [-1e-3; 2], [1e-3; 2]);
        s.loads.push(Load { start: 1e6, end: 2e6, ..load });
    };
    let wall = |s: &mut Scene| {
        s.contact = shipped("incision.toml").contact;
        s.planes.push(Plane { name: "floor".into(), through: [0.0, 0.0, -FAR], normal: [0.0, 0.0, 1.0] });
    };
    vec![
        ("nothing (the same skin again)", alone()),
        ("a blunt tool, far", with_tool("incision.toml", false)),
        ("a blade, far", with_tool("incision.toml", true)),
        ("a sphere, far", with_tool("verify/sphere_press.toml", true)),
        ("a wall, far", of(&wall)),
        ("a probe of a displacement", of(&moved)),
        ("a probe of a reaction, the whole bottom", of(&held)),
        ("a load that has not begun", of(&load)),
    ]
}

/// Median, and the value that a tenth are below, which other work on the machine touches least.
fn spread(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() / 10]]
}

/// Steps, with the time of the device's work included; iterations.
fn timed(simulation: &mut Simulation) -> (f64, u32) {
    let begin = Instant::now();
    let report = simulation.step(false).expect("the device works");
    assert_eq!(report.contact.count(), 0, "it is idle");
    (begin.elapsed().as_secs_f64(), report.free.iterations)
}

/// Ratios of the medians and of the fastest tenths, and what a step of each hands over to a device: launches and waits.
fn compared(scene: &Scene, platform: &Platform) -> Result<([f64; 2], [String; 2]), cutis::error::Error> {
    let mut pair = [Simulation::new(&alone(), platform)?, Simulation::new(scene, platform)?];
    for _ in 0..WARM_UP {
        for simulation in &mut pair {
            timed(simulation);
        }
    }
    let work = |s: &Simulation| s.bodies[0].gpu().map(Gpu::work);
    let before = [work(&pair[0]), work(&pair[1])];
    let mut times = [vec![], vec![]];
    for number in 0..PAIRS {
        let mut iterations = [0; 2];
        for turn in 0..2 {
            let k = (number + turn) % 2;
            let (time, count) = timed(&mut pair[k]);
            times[k].push(time);
            iterations[k] = count;
        }
        assert_eq!(iterations[0], iterations[1], "both solve the same");
    }
    let each = [0, 1].map(|k| match (before[k], work(&pair[k])) {
        (Some(a), Some(b)) => {
            let per = |count: u64| count as f64 / PAIRS as f64;
            format!("{:.1} / {:.1}", per(b.dispatches - a.dispatches), per(b.read_backs - a.read_backs))
        }
        _ => "–".into(),
    });
    let [without, with] = times.map(spread);
    Ok(([0, 1].map(|k| with[k] / without[k]), each))
}

fn main() {
    for (name, platform) in [("CPU path, f64", Platform::Cpu64), ("GPU", Platform::Gpu(None))] {
        let adapter = match Simulation::new(&alone(), &platform) {
            Ok(simulation) => simulation.device().adapter,
            Err(e) => {
                println!("{name} is left out: {e}");
                continue;
            }
        };
        println!("\n{name}: {adapter}\n");
        println!(
            "| idle feature | median step, the skin alone = 1 | fastest tenth | launches / waits per step, alone | with it |"
        );
        println!("|---|---|---|---|---|");
        for (feature, scene) in variants() {
            let ([median, tenth], [alone, with]) = compared(&scene, &platform).expect("the scene fits");
            println!("| {feature} | {median:.3} | {tenth:.3} | {alone} | {with} |");
        }
    }
}
