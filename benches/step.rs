//! One step of the incision scene while the blade is in the skin: the CPU path in f64 and f32, and the GPU on the first adapter.
//! Each is brought to the same step first and its tool force compared with the f64 path's before its time counts; each sample starts from there.

use criterion::{Criterion, criterion_group, criterion_main};
use cutis::scene::Scene;
use cutis::step::{Platform, Simulation};
use std::path::Path;
use std::time::{Duration, Instant};

/// Steps before the clock starts: the blade rests in the dent it has pressed.
const WARM_UP: u32 = 40;
/// Steps of a sample, while the blade enters and cuts.
const STEPS: u32 = 40;
/// Contact is chaotic in the last digits; forces agree to this part.
const BOUND: f64 = 0.05;

fn scene() -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    cutis::scene::read(&root.join("scenes/incision.toml")).expect("the shipped scene is valid")
}

fn advance(simulation: &mut Simulation, steps: u32) -> f64 {
    let mut force = 0.0;
    for _ in 0..steps {
        let report = simulation.step(false).expect("the device works");
        let on_tool = report.contact.on_tool.first().copied().unwrap_or_default();
        force = on_tool.iter().map(|f| f * f).sum::<f64>().sqrt();
    }
    force
}

fn steps(c: &mut Criterion) {
    let scene = scene();
    let mut group = c.benchmark_group("incision_step");
    group.sample_size(10).measurement_time(Duration::from_secs(5)).warm_up_time(Duration::from_millis(200));
    let mut reference = None;
    for (name, platform) in
        [("cpu_f64", Platform::Cpu64), ("cpu_f32", Platform::Cpu32), ("gpu_f32", Platform::Gpu(None))]
    {
        let mut simulation = match Simulation::new(&scene, &platform) {
            Ok(simulation) => simulation,
            Err(e) => {
                println!("{name} is left out: {e}");
                continue;
            }
        };
        let force = advance(&mut simulation, WARM_UP);
        let exact = *reference.get_or_insert(force);
        let error = (force / exact - 1.0).abs();
        println!("{name} on {}: force {force:.4} N, {:.2} % from cpu_f64", simulation.device().adapter, 100.0 * error);
        assert!(exact > 0.0 && error <= BOUND, "{name} is wrong: its time would mean nothing");
        let state = simulation.state().expect("the device works");
        let mut sample = || {
            simulation.restore(&state).expect("the state is this simulation's");
            let clock = Instant::now();
            advance(&mut simulation, STEPS);
            clock.elapsed() / STEPS
        };
        group.bench_function(name, |b| b.iter_custom(|samples| (0..samples).map(|_| sample()).sum()));
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
