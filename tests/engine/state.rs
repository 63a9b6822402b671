//! A run that goes on from a state gives the same bits as one that was never interrupted.

use crate::states::{SCENES, resumes, scene, simulation, steps, text};
use cutis::scene::{Load, LoadKind};
use cutis::step::{Platform, Simulation};

#[test]
fn a_run_goes_on_from_its_state_bit_for_bit() {
    for (name, k, n) in SCENES {
        for platform in [Platform::Cpu64, Platform::Cpu32] {
            resumes(name, &platform, *k, *n).unwrap_or_else(|said| panic!("{said}"));
        }
    }
}

#[test]
fn a_bit_that_is_not_kept_is_noticed() {
    let scene = scene("dental_probe");
    let mut first = simulation(&scene, &Platform::Cpu64);
    steps(&mut first, 22);
    let state = first.state().expect("no device fails");
    let mut from = |change: &dyn Fn(&mut Simulation)| {
        first.restore(&state).expect("it is its own");
        change(&mut first);
        let reports = steps(&mut first, 4);
        text(&reports, &mut first)
    };
    let same = from(&|_| ());
    assert!(same == from(&|_| ()), "the same state twice");
    let moved = from(&|simulation| simulation.tools[0].position.z = simulation.tools[0].position.z.next_up());
    assert!(same != moved, "a tool that is an ulp higher goes the same way");
}

#[test]
fn a_state_of_another_scene_is_refused() {
    let mut skin = simulation(&scene("dental_probe"), &Platform::Cpu64);
    let mut other = scene("dental_probe");
    other.skins[0].cells[0] += 1;
    let said = skin.restore(&simulation(&other, &Platform::Cpu64).state().expect("no device fails"));
    let said = said.expect_err("the grids differ").to_string();
    assert!(said.contains("nodes where the simulation has"), "{said}");
    let stack = simulation(&scene("verify/stack_five_soft"), &Platform::Cpu64).state().expect("no device fails");
    let said = skin.restore(&stack).expect_err("the bodies differ").to_string();
    assert!(said.contains("bodies where the simulation has"), "{said}");
}

#[test]
fn a_scene_may_change_while_it_runs() {
    let mut scene = scene("skin_block");
    (scene.skins[0].cells, scene.time.step, scene.time.duration) = ([8, 8], 0.02, 1.0);
    let settled = |simulation: &mut Simulation| steps(simulation, 40).pop().map_or(0.0, |last| last.probes[0]);
    let mut running = simulation(&scene, &Platform::Cpu64);
    let first = settled(&mut running);
    // twice the load, then twice the stiffness as well
    let doubled = |load: &mut Load| {
        if let LoadKind::Pressure { pressure, .. } = &mut load.kind {
            *pressure *= 2.0;
        }
    };
    running.change(|scene| scene.loads.iter_mut().for_each(doubled)).expect("the body is the same");
    let time = running.time;
    let pressed = settled(&mut running);
    assert!((pressed / first - 2.0).abs() < 0.1, "{first} m, then {pressed} m");
    assert!((running.time - time - 0.8).abs() < 1e-9, "the time goes on");
    let stiffer =
        |scene: &mut cutis::scene::Scene| scene.skins[0].layers.iter_mut().for_each(|layer| layer.young *= 2.0);
    running.change(stiffer).expect("the body is the same");
    let held = settled(&mut running);
    assert!((held / first - 1.0).abs() < 0.05, "{first} m, then {held} m");
    let said = running.change(|scene| scene.skins[0].cells[0] += 1).expect_err("the grid is another").to_string();
    assert!(said.contains("nodes where the simulation has"), "{said}");
    let said = running.change(|scene| scene.time.step *= 2.0).expect_err("the step is another").to_string();
    assert!(said.contains("the step length of a running simulation"), "{said}");
    assert!((settled(&mut running) / held - 1.0).abs() < 1e-2, "what was refused has changed something");
}

#[test]
fn a_load_begins_at_its_step_whatever_the_step() {
    let mut scene = scene("skin_block");
    (scene.skins[0].cells, scene.time.step, scene.time.substeps) = ([4, 4], 2e-3, 3);
    scene.loads.iter_mut().for_each(|load| load.start = 0.1);
    let mut running = simulation(&scene, &Platform::Cpu64);
    let last = |running: &mut Simulation, count| steps(running, count).pop().map_or(0.0, |step| step.probes[0].abs());
    let before = last(&mut running, 50);
    assert!(last(&mut running, 5) > 10.0 * before.max(1e-9), "nothing presses at 0.11 s");
}

#[test]
fn a_state_of_the_start_is_one_too() {
    let mut scene = scene("dental_probe");
    scene.skins[0].velocity = [0.0, 0.0, 0.5];
    let mut running = simulation(&scene, &Platform::Cpu64);
    let start = running.state().expect("no device fails");
    let reports = steps(&mut running, 3);
    let wanted = text(&reports, &mut running);
    running.restore(&start).expect("it is its own");
    let reports = steps(&mut running, 3);
    assert!(text(&reports, &mut running) == wanted);
}
