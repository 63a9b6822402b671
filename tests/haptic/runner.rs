//! A program that drives a run by itself: devices of its own, pauses, states.

use cutis::error::Result;
use cutis::haptic::device::{Device, Limits, Reading, Wrench};
use cutis::runner::{Clock, Runner};
use cutis::scene::{Scene, read};
use cutis::step::{Platform, Simulation};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A device of a program's own: sinks at constant speed, and keeps what it is given.
struct Own {
    start: DVec3,
    rotation: DQuat,
    given: Arc<Mutex<Vec<f64>>>,
}

impl Device for Own {
    fn name(&self) -> &str {
        "own"
    }
    fn limits(&self) -> Limits {
        Limits { force: 2.0, torque: 0.0 }
    }
    fn read(&mut self, time: f64) -> Reading {
        let velocity = DVec3::new(0.0, 0.0, -5e-3);
        let position = self.start + velocity * time;
        Reading { position, rotation: self.rotation, velocity, ..Reading::at_rest(0.0) }
    }
    fn write(&mut self, _time: f64, wrench: Wrench) {
        self.given.lock().expect("nobody panics").push(wrench.force.z);
    }
    fn close(&mut self) -> Result<()> {
        self.given.lock().expect("nobody panics").push(f64::NAN);
        Ok(())
    }
}

/// The dental probe on few cells.
fn probe() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/dental_probe.toml");
    read(&file).unwrap_or_else(|e| panic!("{e}")).in_test_form()
}

fn runner(scene: &Scene, clock: Clock) -> Runner {
    Runner::new(scene, Simulation::new(scene, &Platform::Cpu64).expect("the scene fits"), clock)
}

fn held(scene: &Scene, clock: Clock) -> (Runner, Arc<Mutex<Vec<f64>>>) {
    let mut runner = runner(scene, clock);
    let (start, rotation) = runner.simulation.tools[0].hand(0.0);
    let given = Arc::new(Mutex::new(vec![]));
    runner.attach(0, Box::new(Own { start, rotation, given: given.clone() })).expect("a hand holds it");
    (runner, given)
}

#[test]
fn a_device_of_ones_own_moves_the_tool_and_is_pushed() {
    let scene = probe();
    let (mut own, given) = held(&scene, Clock::Scene);
    let mut recorded = runner(&scene, Clock::Scene);
    let mut ticks = 0;
    for _ in 0..60 {
        own.step(false, &mut |tool, _| {
            ticks += u32::from(tool == 0);
            Ok(())
        })
        .expect("it runs");
        recorded.step(false, &mut |_, _| Ok(())).expect("it runs");
    }
    let z = |runner: &Runner| runner.simulation.tools[0].position.z;
    let sunk = scene.tools[0].trajectory[0].position[2] - z(&own);
    let far = 5e-3 * scene.time.step * 60.0;
    assert!(sunk > 0.5 * far && sunk < 1.01 * far, "{sunk} m of {far} m");
    assert!((z(&own) - z(&recorded)).abs() > 1e-5, "the counter-test: the recorded hand goes elsewhere");
    let most = given.lock().expect("nobody panics").iter().fold(0.0, |a: f64, f| a.max(*f));
    assert!(most > 1e-3 && most <= 2.0, "{most} N");
    assert_eq!(ticks, given.lock().expect("nobody panics").len() as u32);
    own.stop(&mut |_, _| Ok(())).expect("it closes");
    let closed = || given.lock().expect("nobody panics").iter().filter(|force| force.is_nan()).count();
    assert_eq!(closed(), 1);
    let said = own.step(false, &mut |_, _| Ok(())).expect_err("its devices are gone").to_string();
    assert!(said.contains("was stopped"), "{said}");
    own.stop(&mut |_, _| Ok(())).expect("it is closed");
    drop(own);
    assert_eq!(closed(), 1, "once");
    let (mut dropped, given) = held(&scene, Clock::Scene);
    dropped.step(false, &mut |_, _| Ok(())).expect("it runs");
    assert!(dropped.start(false).is_err(), "it has begun");
    drop(dropped);
    assert!(given.lock().expect("nobody panics").last().is_some_and(|last| last.is_nan()), "a dropped run lets go");
}

#[test]
fn a_device_is_attached_before_the_run_and_to_a_tool() {
    let scene = probe();
    let (mut runner, given) = held(&scene, Clock::Scene);
    let another = || Box::new(Own { start: DVec3::ZERO, rotation: DQuat::IDENTITY, given: given.clone() });
    let said = runner.attach(9, another()).expect_err("there are not ten tools").to_string();
    assert!(said.contains("a tool that the scene does not have"), "{said}");
    runner.step(false, &mut |_, _| Ok(())).expect("it runs");
    let said = runner.attach(0, another()).expect_err("it has begun").to_string();
    assert!(said.contains("before the first step"), "{said}");
}

#[test]
fn a_run_that_pauses_takes_that_much_longer() {
    let scene = probe();
    let (mut runner, _) = held(&scene, Clock::Wall);
    let (steps, pause) = (6, Duration::from_millis(120));
    let begin = Instant::now();
    for k in 0..steps {
        if k == 3 {
            runner.pause();
            std::thread::sleep(pause);
        }
        runner.step(false, &mut |_, _| Ok(())).expect("it runs");
    }
    let least = Duration::from_secs_f64(f64::from(steps - 1) * scene.time.step) + pause;
    assert!(begin.elapsed() >= least, "{:?} of {least:?}", begin.elapsed());
    let said = runner.state().expect_err("hands do not wait").to_string();
    assert!(said.contains("by the wall clock"), "{said}");
}

/// Not made up for, or all the steps after it would be late as well.
#[test]
fn a_late_step_puts_the_clock_back() {
    let scene = probe();
    let (mut runner, _) = held(&scene, Clock::Wall);
    let (steps, busy) = (40, Duration::from_millis(120));
    let begin = Instant::now();
    for k in 0..steps {
        if k == 3 {
            std::thread::sleep(busy);
        }
        runner.step(false, &mut |_, _| Ok(())).expect("it runs");
    }
    let took = begin.elapsed();
    let behind = Duration::from_secs_f64(runner.haptic().expect("a device").behind);
    let step = Duration::from_secs_f64(scene.time.step);
    assert!(behind + step >= busy, "{behind:?}");
    assert!(took >= step * (steps - 1) + behind, "{took:?}, {behind:?} behind");
    assert!(runner.haptic().is_some_and(|counts| counts.late_steps >= 1));
}

#[test]
fn a_run_goes_on_from_its_state_with_its_hands() {
    let mut scene = probe();
    scene.tools[0].device = Some(cutis::scene::Device {
        kind: cutis::scene::DeviceKind::Hand { mass: 0.05, stiffness: 300.0, damping: 3.0, encoder: 0.0 },
        ..Default::default()
    });
    let mut first = runner(&scene, Clock::Scene);
    let ahead = |runner: &mut Runner, steps: usize| {
        let mut seen = vec![];
        for _ in 0..steps {
            runner
                .step(false, &mut |_, record| {
                    seen.push(format!("{record:?}"));
                    Ok(())
                })
                .expect("it runs");
        }
        seen
    };
    ahead(&mut first, 25);
    let state = first.state().expect("no device fails");
    let wanted = ahead(&mut first, 10);
    let mut second = runner(&scene, Clock::Scene);
    second.restore(&state).expect("it is of this scene");
    assert_eq!(ahead(&mut second, 10), wanted);
    second.restore(&state).expect("it is of this scene");
    assert_eq!(ahead(&mut second, 10), wanted, "once more, from where it had come to");
    assert!(ahead(&mut second, 10) != wanted, "the counter-test: it is elsewhere now");
}

#[test]
fn an_interrupted_run_releases_its_device_before_the_next_step() {
    let (mut runner, given) = held(&probe(), Clock::Wall);
    let flag = Arc::new(AtomicBool::new(false));
    runner.interrupt_by(flag.clone());
    runner.step(false, &mut |_, _| Ok(())).expect("it is not interrupted yet");
    flag.store(true, Ordering::Release);
    let begin = Instant::now();
    let closed = || given.lock().expect("nobody panics").last().is_some_and(|force| force.is_nan());
    while !closed() {
        assert!(begin.elapsed() < Duration::from_secs(10), "no step is taken, and the device is still held");
        std::thread::sleep(Duration::from_millis(1));
    }
    // the last force was none
    let forces = given.lock().expect("nobody panics").clone();
    assert_eq!(forces[forces.len() - 2], 0.0);
    let refused = runner.step(false, &mut |_, _| Ok(())).expect_err("it is interrupted").to_string();
    assert_eq!(refused, "interrupted");
    // a run that ends leaves the flag of its caller as it is
    let (mut next, _) = held(&probe(), Clock::Wall);
    flag.store(false, Ordering::Release);
    next.interrupt_by(flag.clone());
    next.step(false, &mut |_, _| Ok(())).expect("it is not interrupted");
    next.stop(&mut |_, _| Ok(())).expect("it ends");
    assert!(!flag.load(Ordering::Acquire));
}
