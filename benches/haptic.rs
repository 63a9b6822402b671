//! What a haptic tick costs and how right it is, what it keeps of its 1 kHz beside a simulation, and what the simulation's rate does to the
//! force. Prints Markdown.
//!
//! `cargo bench --bench haptic` measures the tick and the loop; `-- rates FILE.svg` the force of `scenes/dental_probe.toml` at three rates of
//! simulation, against one of 1 kHz, as a table and as curves. Ticks are on a dent of skin-like compliance (what two contacts share falls off
//! over 2 mm) with friction; a tick's error is that of its force against the same problem solved to its end.

use cutis::constraints::Law;
use cutis::haptic::device::{Device, Limits, Reading, Workspace, Wrench};
use cutis::haptic::servo::{BUDGET, Buttons, Problem, Servo, Settings, cells};
use cutis::haptic::thread::Histogram;
use cutis::haptic::thread::{Loop, Timing};
use cutis::haptic::{Hand, MAX_SWEEPS, Reduced};
use cutis::report::run::{Options, run};
use cutis::scene::{Coupling, Rendering, Scene, read};
use cutis::step::{Platform, Simulation};
use glam::{DQuat, DVec3};
use plotters::prelude::*;
use rtrb::RingBuffer;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// At 1 kHz, s.
const TICK: f64 = 1e-3;
/// Ticks per row of the first table.
const TICKS: u32 = 4000;
/// Seconds per row of the second one.
const SECONDS: f64 = 10.0;
/// Target of a tick with twenty contacts, 99 of 100, µs.
const TARGET: f64 = 100.0;
/// What two contacts share of their compliance falls to 1/e over this, m.
const REACH: f64 = 2e-3;
/// Normal and tangential compliance of one contact, m/N, as of a tip on the probe scene's skin.
const GIVES: [f64; 3] = [2e-3, 1.5e-3, 1.5e-3];

fn settings(rows: usize) -> Settings {
    Settings {
        tick: TICK,
        step: 5e-3,
        coupling: Coupling { stiffness: 1000.0, damping: 0.0, angular_stiffness: 1.0, angular_damping: 0.0 },
        rendering: Rendering::Coupling,
        force_scale: 1.0,
        limits: Limits { force: 10.0, torque: 1.0 },
        workspace: Workspace::SAME,
        buttons: Buttons::default(),
        passivity: true,
        resolution: 0.0,
        guarded: false,
        budget: Some(BUDGET),
        max_sweeps: MAX_SWEEPS,
        rows,
    }
}

/// So many contacts on a spiral in a dent, with friction, at a tool that just touches.
fn dent(contacts: usize) -> Problem {
    let arm = |k: usize| {
        let (turn, out) = (2.4 * k as f64, 0.4e-3 * (k as f64 + 0.5).sqrt());
        DVec3::new(out * turn.cos(), out * turn.sin(), 0.0)
    };
    let arms: Vec<DVec3> = (0..contacts).flat_map(|k| [arm(k); 3]).collect();
    let rows = arms.len();
    let shared = |i: usize, j: usize| match i % 3 == j % 3 {
        true => GIVES[i % 3] * (-(arms[i] - arms[j]).length() / REACH).exp(),
        false => 0.0,
    };
    let reduced = Reduced {
        axes: (0..contacts).flat_map(|_| [DVec3::Z, DVec3::X, DVec3::Y]).collect(),
        laws: vec![Law::contact(0.3); contacts],
        compliance: (0..rows * rows).map(|k| shared(k / rows, k % rows)).collect(),
        violation: vec![0.0; rows],
        force: vec![0.0; rows],
        arms,
        ..Reduced::default()
    };
    Problem { reduced, time: f64::INFINITY, ..Problem::default() }
}

/// A hand that presses by half a millimetre, sways and trembles.
fn hand(time: f64) -> Reading {
    let sway =
        DVec3::new(0.2e-3 * (9.0 * time).sin(), 0.1e-3 * (14.0 * time).cos(), -0.5e-3 + 0.2e-3 * (11.0 * time).sin());
    Reading { position: sway, rotation: DQuat::from_rotation_x(0.02 * (5.0 * time).sin()), ..Reading::at_rest(0.0) }
}

fn servo(contacts: usize) -> Servo {
    Servo::new(settings(3 * contacts), Hand { position: DVec3::ZERO, rotation: DQuat::IDENTITY })
}

/// One row of the first tables.
fn tick_row(contacts: usize, max_sweeps: u32) {
    // what the controller leaves out of a force is no error of the sweeps
    let settings = Settings { max_sweeps, passivity: false, ..settings(3 * contacts) };
    let (mut servo, problem) = (Servo::new(settings, servo(contacts).felt().hand), dent(contacts));
    let (mut times, mut errors, mut sweeps) = (Histogram::new(1e-6), Histogram::new(1e-5), 0u64);
    for k in 0..TICKS {
        let time = f64::from(k) * TICK;
        let reading = hand(time);
        let begin = Instant::now();
        let record = servo.tick(reading, &problem, time);
        times.add(begin.elapsed().as_secs_f64());
        sweeps += u64::from(record.sweeps);
        if k % 40 == 0 && k > 0 {
            // the same problem to its end: ticks of a hand at rest go on where the last one stopped
            let mut further = servo.clone();
            let exact = (0..200).fold(record, |_, _| further.tick(reading, &problem, time)).felt.force;
            errors.add((record.felt.force - exact).length() / exact.length().max(1e-3));
        }
    }
    let of = |h: &Histogram, share: f64| h.quantile(share).unwrap_or(f64::NAN);
    let p99 = of(&times, 0.99) * 1e6;
    println!(
        "| {contacts} | {max_sweeps} | {:.0} | {p99:.0} | {:.2} | {:.1} | {:.2} | {:.2} |",
        of(&times, 0.5) * 1e6,
        p99 / TARGET,
        sweeps as f64 / f64::from(TICKS),
        of(&errors, 0.5) * 100.0,
        of(&errors, 0.99) * 100.0,
    );
}

/// A hand as a device.
struct Swaying;

impl Device for Swaying {
    fn name(&self) -> &str {
        "swaying"
    }
    fn limits(&self) -> Limits {
        Limits { force: 10.0, torque: 1.0 }
    }
    fn read(&mut self, time: f64) -> Reading {
        hand(time)
    }
    fn write(&mut self, _time: f64, _wrench: Wrench) {}
    fn close(&mut self) -> cutis::error::Result<()> {
        Ok(())
    }
}

/// The loop in a thread of its own while something else goes on.
fn looped(contacts: usize, mut meanwhile: impl FnMut()) -> Timing {
    let (ours, servo) = (dent(contacts), servo(contacts));
    let (ends, _simulation) = cells(&ours, &servo.felt());
    // records are not looked at: the ring holds them all
    let (records, _read) = RingBuffer::new((2.0 * SECONDS / TICK) as usize);
    let (start, stop) = (Instant::now(), Arc::new(AtomicBool::new(false)));
    let device_loop = Loop { servo, device: Box::new(Swaying), cells: ends, records };
    let told = stop.clone();
    let thread = std::thread::spawn(move || device_loop.run(start, [&told; 2]));
    while start.elapsed().as_secs_f64() < SECONDS {
        meanwhile();
    }
    stop.store(true, Ordering::Release);
    thread.join().expect("the loop does not panic").0
}

fn loop_row(name: &str, timing: &Timing) {
    let us = |h: &Histogram, share: f64| h.quantile(share).unwrap_or(f64::NAN) * 1e6;
    let due = SECONDS / TICK;
    println!(
        "| {name} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.2} |",
        us(&timing.tick, 0.5),
        us(&timing.tick, 0.99),
        us(&timing.tick, 1.0),
        us(&timing.period, 0.5),
        us(&timing.period, 0.99),
        us(&timing.period, 1.0),
        timing.missed as f64 / due * 100.0,
    );
}

fn probe_scene() -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    read(&root.join("scenes/dental_probe.toml")).expect("the shipped scene is valid")
}

fn ticks() {
    let head = "| contacts | sweeps at most | tick p50, µs | p99, µs | p99 / target of 100 µs | sweeps, mean | force error p50, % | p99, % |";
    println!("{head}\n| --- | --- | --- | --- | --- | --- | --- | --- |");
    [1, 2, 5, 10, 20, 40, 60].into_iter().for_each(|contacts| tick_row(contacts, MAX_SWEEPS));
    [1, 2, 5, 10].into_iter().for_each(|sweeps| tick_row(20, sweeps));
    println!("\n20 contacts, {SECONDS} s at 1 kHz beside the probe scene's simulation:\n");
    println!("| beside it | tick p50, µs | p99 | max | period p50, µs | p99 | max | missed, % |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    loop_row("nothing", &looped(20, || std::thread::sleep(std::time::Duration::from_millis(10))));
    let simulation = || Simulation::new(&probe_scene(), &Platform::Cpu64).expect("the scene fits");
    let mut all = simulation();
    let step = |simulation: &mut Simulation| drop(simulation.step(false).expect("the CPU path does not fail"));
    loop_row("a simulation on all cores", &looped(20, || step(&mut all)));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1)).build();
    let beside = pool.expect("threads").install(|| {
        let mut fewer = simulation();
        looped(20, || step(&mut fewer))
    });
    loop_row("one that leaves a core", &beside);
}

/// Force on the hand along z at 1 kHz over a run at a rate of simulation, N, and what it was rendered with.
fn force_at(hz: f64) -> Vec<f64> {
    let mut scene = probe_scene();
    scene.skins[0].cells = [12, 12];
    (scene.time.step, scene.view.frames) = (1.0 / hz, 0);
    let out = std::env::temp_dir().join(format!("cutis-bench-haptic-{}", std::process::id()));
    let options = Options::new(Platform::Cpu64, &out);
    run(&scene, &options, &mut |_| {}).expect("the shipped scene runs");
    let text = std::fs::read_to_string(out.join("haptic.csv")).expect("a run with a tool writes it");
    std::fs::remove_dir_all(&out).expect("it was made above");
    let force = |line: &str| line.split(',').nth(10).and_then(|cell| cell.parse().ok());
    text.lines().skip(1).filter_map(force).collect()
}

fn rates(file: &Path) {
    let reference = force_at(1000.0);
    let most = reference.iter().copied().fold(0.0, f64::max);
    let curves: Vec<(f64, Vec<f64>)> = [20.0, 60.0, 200.0].into_iter().map(|hz| (hz, force_at(hz))).collect();
    println!(
        "| simulation, Hz | largest jump per tick, mN | of the largest force, % | difference from 1 kHz, rms, % of the largest force |"
    );
    println!("| --- | --- | --- | --- |");
    for (hz, force) in curves.iter().chain([&(1000.0, reference.clone())]) {
        let jump = force.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        let apart = force.iter().zip(&reference).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let rms = (apart / force.len().min(reference.len()) as f64).sqrt();
        println!("| {hz} | {:.2} | {:.1} | {:.1} |", jump * 1e3, jump / most * 100.0, rms / most * 100.0);
    }
    plot(file, &curves, &reference).expect("the picture can be written");
}

fn plot(file: &Path, curves: &[(f64, Vec<f64>)], reference: &[f64]) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(file, (900, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let seconds = reference.len() as f64 * TICK;
    let most = reference.iter().copied().fold(0.0, f64::max) * 1.1e3;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(55)
        .build_cartesian_2d(0.0..seconds, -0.02 * most..most)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).x_desc("time, s").y_desc("force on the hand, mN").draw()?;
    let colors = [RGBColor(200, 80, 60), RGBColor(60, 130, 190), RGBColor(70, 150, 90)];
    let black = (1000.0, reference.to_vec());
    for ((hz, force), color) in [&black].into_iter().chain(curves).zip([BLACK].into_iter().chain(colors)) {
        let points = force.iter().enumerate().map(|(k, f)| (k as f64 * TICK, f * 1e3));
        let line = chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?;
        let legend = move |(x, y)| PathElement::new(vec![(x, y), (x + 20, y)], color.stroke_width(2));
        line.label(format!("simulation at {hz} Hz")).legend(legend);
    }
    chart.configure_series_labels().background_style(WHITE).border_style(BLACK.mix(0.3)).draw()?;
    area.present()?;
    Ok(())
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["rates", file] => rates(Path::new(file)),
        [] => ticks(),
        _ => eprintln!("nothing, or `rates FILE.svg`"),
    }
}
