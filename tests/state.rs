//! A run that goes on from a state gives the same bits as one that was never interrupted.

mod states;

use cutis::step::{Place, Simulation};
use states::{SCENES, goes_on, scene, simulation, steps, text};

#[test]
fn a_run_goes_on_from_its_state_bit_for_bit() {
    for (name, k, n) in SCENES {
        for place in [Place::Cpu64, Place::Cpu32] {
            goes_on(name, &place, *k, *n).unwrap_or_else(|said| panic!("{said}"));
        }
    }
}

#[test]
fn a_bit_that_is_not_kept_is_noticed() {
    let scene = scene("dental_probe");
    let mut first = simulation(&scene, &Place::Cpu64);
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
    let mut skin = simulation(&scene("dental_probe"), &Place::Cpu64);
    let mut other = scene("dental_probe");
    other.skins[0].cells[0] += 1;
    let said = skin.restore(&simulation(&other, &Place::Cpu64).state().expect("no device fails"));
    let said = said.expect_err("the grids differ").to_string();
    assert!(said.contains("nodes where the simulation has"), "{said}");
    let stack = simulation(&scene("verify/stack_five_soft"), &Place::Cpu64).state().expect("no device fails");
    let said = skin.restore(&stack).expect_err("the bodies differ").to_string();
    assert!(said.contains("bodies where the simulation has"), "{said}");
}
