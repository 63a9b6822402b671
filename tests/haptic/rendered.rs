//! What is felt: stiffness, torque, no allocation.

use crate::bench::{TICK, at, measured, plain, problem, reading, servo, spring, wall};
use cutis::haptic::device::Reading;
use cutis::haptic::servo::Servo;
use cutis::haptic::{Hand, Renderer};
use cutis::scene::{Coupling, Rendering};
use glam::{DQuat, DVec3};

/// Relative error of a force: sweeps end at 1e-4 of it.
const SAME: f64 = 1e-4;
/// Half the distance of the two contacts of the tilting tests, m.
const HALF: f64 = 4e-3;

/// Force per depth that a servo gives at rest, N/m.
fn felt(mut servo: Servo, compliance: f64, depth: f64) -> f64 {
    let wall = problem(wall(&[DVec3::ZERO], compliance));
    let hand = reading(DVec3::new(0.0, 0.0, -depth));
    (0..50).map(|k| servo.tick(hand, &wall, f64::from(k) * TICK).wrench.force.z).last().expect("ticks") / depth
}

#[test]
fn a_rigid_wall_feels_as_stiff_as_the_coupling_and_skin_is_in_series_with_it() {
    for commanded in [200.0, 1000.0, 3000.0, 10_000.0] {
        for compliance in [0.0, 1e-4, 1e-3] {
            let wanted = 1.0 / (1.0 / commanded + compliance);
            let found = felt(servo(plain(spring(commanded))), compliance, 1e-3);
            measured(&format!("coupling {commanded} N/m, skin {compliance:e} m/N: felt / wanted {}", found / wanted));
            assert!((found / wanted - 1.0).abs() < SAME, "{found} N/m instead of {wanted}");
            // counter-test: with the coupling's spring counted twice
            let twice = 1.0 / (2.0 / commanded + compliance);
            assert!((found / twice - 1.0).abs() > 0.05, "{found} is not {twice}");
        }
    }
}

#[test]
fn direct_rendering_feels_the_skin_alone() {
    for compliance in [1e-4, 1e-3, 5e-3] {
        let settings = cutis::haptic::servo::Settings { rendering: Rendering::Direct, ..plain(spring(1000.0)) };
        let found = felt(servo(settings), compliance, 1e-3);
        measured(&format!("direct, skin {compliance:e} m/N: felt / wanted {}", found * compliance));
        assert!((found * compliance - 1.0).abs() < SAME, "{found} N/m instead of {}", 1.0 / compliance);
    }
}

/// Energy of coupling and skin with a hand at a depth and tilted about y, by the forces of the two contacts, J; and the torque.
fn energy(coupling: Coupling, compliance: f64, depth: f64, tilt: f64) -> (f64, f64) {
    let hand =
        |depth: f64, tilt: f64| Hand { position: DVec3::new(0.0, 0.0, -depth), rotation: DQuat::from_rotation_y(tilt) };
    let wall = wall(&[DVec3::new(HALF, 0.0, 0.0), DVec3::new(-HALF, 0.0, 0.0)], compliance);
    let mut renderer = Renderer::new(coupling, at(DVec3::ZERO));
    let tick = (0..200).map(|_| renderer.tick(&wall, hand(depth, tilt), TICK, 0.0)).last().expect("ticks");
    let (force, torque) = (tick.force.z, tick.torque.y);
    // at x = ±HALF the torque about y is ∓HALF times the force
    let [a, b] = [1.0, -1.0].map(|side| 0.5 * force - side * 0.5 * torque / HALF);
    let coupling = 0.5 * force * force / coupling.stiffness + 0.5 * torque * torque / coupling.angular_stiffness;
    (coupling + 0.5 * compliance * (a * a + b * b), torque)
}

#[test]
fn a_tilted_hand_feels_the_slope_of_the_energy() {
    let coupling = spring(800.0);
    let (compliance, depth) = (5e-4, 2e-3);
    for tilt in [-0.02, 0.005, 0.03] {
        let e = 1e-4;
        let slope = (energy(coupling, compliance, depth, tilt + e).0 - energy(coupling, compliance, depth, tilt - e).0)
            / (2.0 * e);
        let torque = energy(coupling, compliance, depth, tilt).1;
        assert!((torque + slope).abs() < 1e-3 * slope.abs(), "{torque} N·m, energy falls by {}", -slope);
        let wanted = -tilt / (1.0 / coupling.angular_stiffness + compliance / (2.0 * HALF * HALF));
        assert!((torque / wanted - 1.0).abs() < 1e-3, "{torque} N·m instead of {wanted}");
        // counter-test: a tick that knows no rotation
        let ignored = energy(coupling, compliance, depth, 0.0).1;
        assert!((ignored + slope).abs() > 0.5 * slope.abs(), "without the rotation {ignored} N·m");
    }
}

#[test]
fn the_proxy_does_not_jump_back_when_an_old_problem_comes_in() {
    let coupling = Coupling { damping: 5.0, ..spring(1000.0) };
    let jump = |late: bool| {
        let mut renderer = Renderer::new(coupling, at(DVec3::ZERO));
        let (soft, speed) = (wall(&[DVec3::ZERO], 1e-3), 0.05);
        let mut last = 0.0;
        for k in 0..100 {
            last = renderer.tick(&soft, at(DVec3::new(0.0, 0.0, -speed * TICK * f64::from(k))), TICK, 0.0).force.z;
        }
        if late {
            renderer.receive_late(&soft, TICK)
        } else {
            renderer.receive(&soft, TICK)
        }
        (renderer.tick(&soft, at(DVec3::new(0.0, 0.0, -speed * 0.1)), TICK, 0.0).force.z - last).abs() / last
    };
    assert!(jump(true) < 0.03, "{}", jump(true));
    assert!(jump(false) > 0.3, "the counter-test: {}", jump(false));
}

#[test]
fn a_tick_allocates_nothing() {
    let budget = Some(cutis::haptic::servo::BUDGET);
    let settings = cutis::haptic::servo::Settings { passivity: true, guarded: true, budget, ..plain(spring(1000.0)) };
    let mut servo = servo(settings);
    let arms: Vec<DVec3> = (0..8).map(|k| DVec3::new(1e-3 * f64::from(k), 0.0, 0.0)).collect();
    let mut problems = [problem(wall(&arms, 1e-3)), problem(wall(&arms[..3], 2e-3))];
    let mut ticks = |servo: &mut Servo, kept: &mut Vec<Reading>, keep: bool| {
        for k in 0..1000 {
            let time = f64::from(k) * TICK;
            let hand = reading(DVec3::new(0.0, 0.0, -1e-3 * (10.0 * time).sin()));
            // each hundred ticks a problem that it has not seen
            let problem = &mut problems[usize::from(k / 100 % 2 == 1)];
            problem.number += u64::from(k % 100 == 0);
            servo.tick(hand, problem, time);
            if keep && k == 500 {
                kept.push(hand);
            }
        }
    };
    let counted = allocation_counter::measure(|| ticks(&mut servo, &mut Vec::new(), false));
    assert_eq!(counted.count_total, 0);
    let counted = allocation_counter::measure(|| ticks(&mut servo, &mut Vec::new(), true));
    assert_eq!(counted.count_total, 1, "the counter-test: one push is one allocation");
}

#[test]
fn handing_over_allocates_nothing_once_the_buffers_have_grown() {
    let arms: Vec<DVec3> = (0..8).map(|k| DVec3::new(1e-3 * f64::from(k), 0.0, 0.0)).collect();
    let (large, small) = (wall(&arms, 1e-3), wall(&arms[..2], 1e-3));
    let first = problem(small.clone());
    let (mut servo_end, mut ours) = cutis::haptic::servo::cells(&first, &servo(plain(spring(1.0))).felt());
    let mut pass = |count: u32| {
        for k in 0..count {
            ours.publish(if k % 2 == 0 { &large } else { &small }, 0.0, 0);
            servo_end.problem.read();
        }
    };
    let growing = allocation_counter::measure(|| pass(6)).count_total;
    assert!(growing > 0, "the counter-test: growing is seen");
    assert_eq!(allocation_counter::measure(|| pass(100)).count_total, 0);
}
