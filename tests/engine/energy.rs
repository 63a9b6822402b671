//! Energy of runs: work and dissipation against known answers, growth that nothing explains, strain beyond the law, energy.csv.

use crate::small::{block, held};
use cutis::bodies::Model;
use cutis::report::{EnergyReport, Report};
use cutis::scene::Integrator::{self, ImplicitEuler, Midpoint, Newmark, SymplecticEuler};
use cutis::scene::{Element, Law, Load, LoadKind, Material, Preconditioner, Region, Scene, Start};
use cutis::step::{Measured, Platform, Simulation};
use std::path::Path;

const COROTATIONAL: Law = Law::Fem { element: Element::Bbar, corotational: true };
const LINEAR: Law = Law::Fem { element: Element::Bbar, corotational: false };
const NEO_HOOKEAN: Law = Law::Hyperelastic(Material::NeoHookean);

/// A scene of the repository.
fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    cutis::scene::read(&path).unwrap_or_else(|e| panic!("{e}"))
}

/// Report and energy.csv of a run into a folder of its own.
fn run(name: &str, scene: &Scene, platform: &Platform) -> (Report, String) {
    let out = std::env::temp_dir().join(format!("cutis-energy-{}-{name}", std::process::id()));
    let options = cutis::report::run::Options::new(platform.clone(), &out);
    let report = cutis::report::run::run(scene, &options, &mut |_| {}).expect("it runs").report;
    let table = std::fs::read_to_string(out.join("energy.csv")).expect("it is written by default");
    std::fs::remove_dir_all(&out).expect("the folder is this test's");
    (report, table)
}

/// Measures of a run whose steps are all checked, one per step and one at the end.
fn measures(scene: &Scene, platform: &Platform) -> Vec<Measured> {
    let mut simulation = Simulation::new(scene, platform).expect("the scene is valid");
    let mut out: Vec<Measured> = (0..scene.time.steps())
        .map(|_| simulation.step(true).expect("it runs").measured.expect("each step is checked"))
        .collect();
    let states = simulation.snapshots().expect("the CPU path has no device to fail");
    out.extend(simulation.measure(&states));
    out
}

/// How often a run warned that its energy grew, checked every so many steps, and how far it rose.
fn grew(scene: &Scene, every: u32) -> (u32, f64) {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene is valid");
    let states = simulation.snapshots().expect("the CPU path has no device to fail");
    let start = simulation.measure(&states).expect("there is a body").energy.total();
    let (mut count, mut most) = (0, start);
    for step in 1..=scene.time.steps() {
        // a run that has blown up may end with an error
        let Ok(report) = simulation.step(step % every == 0) else { break };
        count += report.warnings.get("energy_grew").copied().unwrap_or_default();
        most = report.measured.map_or(most, |now| most.max(now.energy.total()));
    }
    (count, most / start.abs().max(f64::MIN_POSITIVE))
}

/// A free block that starts twisted by 45°, all but undamped.
fn twisted(law: Law, integrator: Integrator, step: f64) -> Scene {
    let mut scene = block([10e-3; 2], [4, 4], &[(8, 20e-3, 34e3, 0.45, 1000.0)]);
    let skin = &mut scene.skins[0];
    (skin.law, skin.start) = (law, Start::Twist(0.25 * std::f64::consts::PI));
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.0, 1e-5);
    (scene.time.gravity, scene.time.integrator) = ([0.0; 3], integrator);
    (scene.time.step, scene.time.duration) = (step, if step < 1e-3 { 400.0 * step } else { 60.0 * step });
    scene
}

/// A cantilever of 40 × 8 × 8 mm that falls under its own weight.
fn cantilever(law: Law, integrator: Integrator) -> Scene {
    let mut scene = block([40e-3, 8e-3], [12, 3], &[(3, 8e-3, 34e3, 0.45, 1000.0)]);
    scene.skins[0].law = law;
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.0, 1e-5);
    let end = Region::Box { min: [-1.0, -1.0, -1.0], max: [-19.9e-3, 1.0, 1.0] };
    scene.boundaries = vec![held(end, [true; 3])];
    scene.time.integrator = integrator;
    (scene.time.step, scene.time.duration) = (20e-3, 2.0);
    scene
}

#[test]
fn implicit_steps_make_no_energy() {
    for (law, integrator) in [(COROTATIONAL, ImplicitEuler), (NEO_HOOKEAN, ImplicitEuler), (NEO_HOOKEAN, Midpoint)] {
        let runs = [twisted(law, integrator, 0.5e-3), twisted(law, integrator, 5e-3), cantilever(law, integrator)];
        for (what, scene) in ["twisted, 0.5 ms", "twisted, 5 ms", "cantilever, 20 ms"].iter().zip(&runs) {
            let (count, most) = grew(scene, 5);
            println!("{what}: {law:?} {integrator:?}: {count} warnings, energy up to {most:.6e} of that at the start");
            assert!(count == 0, "{what}: {law:?} {integrator:?}: {most:e}");
        }
    }
}

#[test]
fn energy_that_unfinished_solves_make_is_told() {
    let warnings = |tolerance: f64| {
        let mut scene = twisted(LINEAR, Newmark, 5e-3);
        (scene.solver.preconditioner, scene.solver.tolerance) = (Preconditioner::None, tolerance);
        let (count, most) = grew(&scene, 5);
        println!(
            "linear, Newmark, solves to {tolerance}: {count} warnings, energy up to {most:.3e} of that at the start"
        );
        count
    };
    assert!(warnings(0.3) > 0, "what the solves leave is a force that works");
    assert_eq!(warnings(1e-8), 0, "counter-test: average acceleration keeps the energy of a linear body");
}

/// A linear layer that a load presses from 5 to 12 ms, without damping unless `damping`.
fn pressed(integrator: Integrator, damping: f64) -> Scene {
    let mut scene = block([8e-3; 2], [4, 4], &[(3, 3e-3, 34e3, 0.45, 1000.0)]);
    let skin = &mut scene.skins[0];
    (skin.law, skin.rayleigh_mass, skin.rayleigh_stiffness) = (LINEAR, 10.0 * damping, 1e-4 * damping);
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    let half = [2e-3; 2];
    let load = Load::on_top(&scene.skins[0], 200.0, half.map(|h| -h), half);
    scene.loads = vec![Load { start: 5e-3, end: 12e-3, ..load }];
    (scene.time.integrator, scene.solver.tolerance, scene.solver.floor) = (integrator, 1e-11, 0.0);
    (scene.time.step, scene.time.duration) = (0.25e-3, 20e-3);
    scene
}

#[test]
fn a_load_does_its_force_times_the_way() {
    let scene = pressed(Newmark, 0.0);
    let found = measures(&scene, &Platform::Cpu64);
    let (first, last) = (found[0], found[found.len() - 1]);
    // by hand: Σ f·Δu while the load acts
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene is valid");
    let load = simulation.bodies[0].model.load_at(&scene.loads, 6e-3);
    let way = |simulation: &mut Simulation| -> f64 {
        let u = simulation.snapshots().expect("the CPU path has no device to fail").remove(0).u;
        load.iter().zip(&u).map(|(f, u)| (0..3).map(|n| f[n] * u[n]).sum::<f64>()).sum()
    };
    let mut at = vec![way(&mut simulation)];
    for _ in 0..scene.time.steps() {
        simulation.step(false).expect("it runs");
        at.push(way(&mut simulation));
    }
    let work = at[48] - at[20];
    assert!(work > 1e-9, "{work:e}");
    assert!((last.booked.loads / work - 1.0).abs() < 1e-9, "{:e}, by hand {work:e}", last.booked.loads);
    // average acceleration keeps a linear body's energy: all of the work is there at the end, vibrating
    let rise = last.energy.total() - first.energy.total();
    assert!((rise / work - 1.0).abs() < 1e-6, "{rise:e} of {work:e}");
    assert!(found.iter().all(|m| !m.grew), "what a load does is no growth");
    // counter-test: without the booking it would be
    let unbooked = |m: &Measured| Measured { booked: Default::default(), ..*m };
    let off = unbooked(&last).unexplained(&unbooked(&first));
    assert!(off > unbooked(&last).allowance(&unbooked(&first), 1e-3), "{off:e}");
}

#[test]
fn damping_takes_what_is_missing() {
    {
        let scene = pressed(Newmark, 1.0);
        let found = measures(&scene, &Platform::Cpu64);
        let (first, last) = (found[0], found[found.len() - 1]);
        let damping = last.booked.damping().expect("all steps are checked");
        let lost = last.booked.work() - (last.energy.total() - first.energy.total());
        assert!(damping > 0.1 * last.booked.loads, "{damping:e}");
        assert!((damping / lost - 1.0).abs() < 1e-6, "{damping:e}, missing {lost:e}");
        // not known where steps are not checked
        let report = run("damped", &scene, &Platform::Cpu64).0;
        let EnergyReport { dissipated, .. } = report.energy_j;
        assert!(dissipated.damping.is_none() && dissipated.numerical.is_some_and(|n| (n / lost - 1.0).abs() < 1e-6));
    }
    // nothing to damp: known whatever is checked
    let report = run("undamped", &pressed(ImplicitEuler, 0.0), &Platform::Cpu64).0;
    assert_eq!(report.energy_j.dissipated.damping, Some(0.0));
    assert!(report.energy_j.dissipated.numerical.is_some_and(|n| n > 0.0), "implicit Euler dissipates");
}

#[test]
fn friction_takes_the_weight_times_the_way() {
    // the box of 100 g slides down by 1.178 m/s · 0.5 s · ½ (and a half step), pressed on with 0.85 N, μ 0.3
    let scene = scene("verify/incline_slide.toml");
    let report = run("slide", &scene, &Platform::Cpu64).0;
    let EnergyReport { start, end, work_in, dissipated, potential, kinetic, .. } = report.energy_j;
    let [start, end] = [start, end].map(|e| e.expect("a free rigid body has energy"));
    let [before, after] = [potential.start, potential.end].map(|e| e.expect("it has weight"));
    let way = (before - after) / (0.1 * 4.905);
    let friction = dissipated.friction.expect("it is booked");
    let wanted = 0.3 * 0.1 * 8.495709211125344 * way;
    assert!((friction / wanted - 1.0).abs() < 1e-5, "{friction:e} J, wanted {wanted:e} J over {way} m");
    assert!(kinetic.end.is_some_and(|k| (k / (0.5 * 0.1 * 1.1781_f64.powi(2)) - 1.0).abs() < 1e-3));
    assert_eq!(work_in.hands, Some(0.0));
    // what is left is implicit Euler's own: ½ m Δv² a step
    let numerical = dissipated.numerical.expect("nothing damps");
    let own = 0.5 * 0.1 * (1.1781_f64 / 100.0).powi(2) * 100.0;
    assert!((numerical / own - 1.0).abs() < 0.02, "{numerical:e}, wanted {own:e}; {start:e} to {end:e}");
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
}

#[test]
fn a_hand_does_its_force_times_the_way() {
    let mut scene = scene("verify/sphere_press_neo_hookean.toml").in_test_form();
    (scene.time.integrator, scene.time.step, scene.time.duration) = (ImplicitEuler, 0.1, 1.6);
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene is valid");
    let mut by_hand = 0.0;
    let mut before = simulation.tools[0].position;
    for _ in 0..scene.time.steps() {
        let report = simulation.step(false).expect("it runs");
        let now = simulation.tools[0].position;
        let force = report.contact.on_tool.first().map_or([0.0; 3], |force| *force);
        by_hand -= (0..3).map(|n| force[n] * (now - before)[n]).sum::<f64>();
        before = now;
    }
    let states = simulation.snapshots().expect("the CPU path has no device to fail");
    let last = simulation.measure(&states).expect("there is a body");
    // a sphere that is pressed straight down does not turn
    assert!(by_hand > 1e-5 && (last.booked.hands / by_hand - 1.0).abs() < 1e-3, "{:e}, {by_hand:e}", last.booked.hands);
    // at rest at last, the work is elastic energy, what damping and the steps took, and a little in the contact
    let kept = last.energy.elastic / by_hand;
    assert!(kept > 0.3 && kept < 1.0, "{kept}");
}

#[test]
fn the_table_of_energies_has_whole_lines_and_adds_up() {
    let mut scene = pressed(Newmark, 0.0);
    scene.solver.true_residual_every = 8;
    let (report, text) = run("table", &scene, &Platform::Cpu64);
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a line of names").split(',').collect();
    let number = |text: &str| text.parse::<f64>().unwrap_or_else(|_| panic!("{text:?} is no number"));
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(number).collect()).collect();
    assert!(text.ends_with('\n') && rows.iter().all(|row| row.len() == names.len()), "{text}");
    // the start, each eighth step of 80, the end
    assert_eq!(rows.len(), 12, "{text}");
    assert!(rows.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{text}");
    let column = |name: &str| names.iter().position(|n| *n == name).unwrap_or_else(|| panic!("no {name} in {names:?}"));
    let total = |row: &[f64]| row[column("kinetic_j")] + row[column("elastic_j")] + row[column("potential_j")];
    let last = &rows[11];
    let off = total(last) - total(&rows[0]) - last[column("work_loads_j")];
    assert!(off.abs() < 1e-6 * last[column("work_loads_j")], "{off:e}");
    assert!((total(last) - report.energy_j.end.expect("it has one")).abs() <= 1e-9 * total(last).abs());
}

#[test]
fn strain_beyond_the_law_is_counted_and_large_strain_is_not() {
    let beyond = |law: Law, pressure: f64, platform: &Platform| {
        let mut scene = pressed(ImplicitEuler, 1.0);
        (scene.loads[0].kind, scene.skins[0].law) = (LoadKind::Pressure { pressure, follower: false }, law);
        (scene.solver.tolerance, scene.solver.true_residual_every) = (1e-5, 4);
        let report = run("strained", &scene, platform).0;
        report.warnings.get("strain_beyond_law").copied().unwrap_or_default()
    };
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        for law in [LINEAR, COROTATIONAL] {
            assert!(beyond(law, 20e3, &platform) > 0, "{law:?}: half of the modulus");
            assert_eq!(beyond(law, 200.0, &platform), 0, "{law:?}: counter-test, 1 % of strain");
        }
        for law in [NEO_HOOKEAN, Law::Hyperelastic(Material::MooneyRivlin)] {
            assert_eq!(beyond(law, 20e3, &platform), 0, "{law:?} is for large strain");
        }
    }
}

#[test]
fn explicit_steps_swing_and_do_not_grow() {
    let mut scene = pressed(SymplecticEuler, 0.0);
    (scene.time.step, scene.time.duration) = (0.02e-3, 20e-3);
    let found = measures(&scene, &Platform::Cpu64);
    let most = found.windows(2).map(|m| m[1].unexplained(&m[0])).fold(0.0, f64::max);
    let largest = found[found.len() - 1].largest;
    println!("symplectic Euler: {most:e} of {largest:e}");
    assert!(most > 1e-3 * largest, "it swings: {most:e} of {largest:e}");
    assert!(found.iter().all(|m| !m.grew), "a swing is no growth");
}

/// A layer without damping in 2000 explicit steps of a share of the one that is stable at rest.
fn explicit(law: Law, start: Start, pressure: f64, share: f64) -> Scene {
    let mut scene = pressed(SymplecticEuler, 0.0);
    (scene.skins[0].law, scene.skins[0].start) = (law, start);
    let kind = LoadKind::Pressure { pressure, follower: false };
    scene.loads[0] = Load { kind, start: 0.0, end: 1.0, ..scene.loads[0].clone() };
    scene.time.gravity = [0.0; 3];
    scene.time.step = share * Model::new(&scene, 0).expect("it is small").stable_step();
    scene.time.duration = 2000.0 * scene.time.step;
    scene
}

/// The first step that warned that the energy grew, with the energy then over what was there, and the last step before the run became
/// non-finite; the most that the energy rose by, over what was there.
fn growth(scene: &Scene, platform: &Platform) -> (Option<(u32, f64)>, u32, f64) {
    let mut simulation = Simulation::new(scene, platform).expect("the step is at most the stable one");
    let states = simulation.snapshots().expect("the CPU path has no device to fail");
    let first = simulation.measure(&states).expect("there is a body");
    let (mut told, mut last, mut least, mut most) = (None, 0, first, 0.0_f64);
    for step in 1..=scene.time.steps() {
        let Ok(report) = simulation.step(true) else { break };
        let now = report.measured.expect("each step is checked");
        if !now.energy.total().is_finite() {
            break;
        }
        let rise = now.unexplained(&least);
        if rise <= 0.0 {
            least = now;
        }
        most = most.max(rise / now.largest);
        if told.is_none() && report.warnings.contains_key("energy_grew") {
            told = Some((step, rise / now.largest));
        }
        last = step;
    }
    (told, last, most)
}

const RANDOM: Start = Start::Random { amplitude: 1e-4, seed: 1 };

#[test]
fn stable_explicit_steps_are_not_warned_of() {
    let twist = Start::Twist(0.5);
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        let mut widest = 0.0_f64;
        for (law, start, pressure, share) in [
            (LINEAR, RANDOM, 0.0, 0.9),
            (LINEAR, RANDOM, 0.0, 0.99),
            (LINEAR, twist, 0.0, 0.99),
            (LINEAR, Start::Rest, 200.0, 0.999),
            (LINEAR, Start::Rest, 15e3, 0.99),
            (NEO_HOOKEAN, RANDOM, 0.0, 0.8),
            (NEO_HOOKEAN, twist, 0.0, 0.8),
            (NEO_HOOKEAN, Start::Rest, 200.0, 0.99),
            (NEO_HOOKEAN, Start::Rest, 15e3, 0.8),
        ] {
            let scene = explicit(law, start, pressure, share);
            let (told, last, most) = growth(&scene, &platform);
            println!("{platform:?}, {law:?}, {start:?}, {pressure} Pa, {share} of the stable step: {most:.2} times");
            assert!(told.is_none() && last == scene.time.steps(), "{told:?} of {last} steps");
            widest = widest.max(most);
        }
        assert!(widest > 10.0, "the counter-test: a tenth of what is let pass would be told, {widest}");
    }
}

/// Rise over what was there by which growth is to be told: ten times the largest found, of a step in which cells invert.
const IN_TIME: f64 = 1e4;

#[test]
fn growing_explicit_steps_are_told_before_they_overflow() {
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        for (law, start, pressure, share) in [
            // the double root at the limit: the motion grows with the steps, its energy with their square
            (LINEAR, RANDOM, 0.0, 1.0),
            (LINEAR, Start::Rest, 200.0, 1.0),
            // compressed cells are stiffer than at rest
            (NEO_HOOKEAN, RANDOM, 0.0, 0.97),
            (NEO_HOOKEAN, Start::Rest, 200.0, 1.0),
            (NEO_HOOKEAN, Start::Rest, 5e3, 0.9),
            (NEO_HOOKEAN, Start::Rest, 15e3, 0.9),
        ] {
            let scene = explicit(law, start, pressure, share);
            let (told, last, most) = growth(&scene, &platform);
            println!(
                "{platform:?}, {law:?}, {start:?}, {pressure} Pa, {share} of the stable step: told at {told:?} of {last}, most {most:.1e}"
            );
            let (step, rise) = told.unwrap_or_else(|| panic!("not told in {last} steps, a rise of {most:e}"));
            assert!(step < last && rise < IN_TIME, "{rise:e} at step {step} of {last}");
        }
    }
}

/// 48 neo-Hookean cells, each step solved to its balance by Newton's method, to 1e-8 without a floor.
fn solved_fully(pressure: f64, gravity: f64) -> Scene {
    let mut scene = pressed(ImplicitEuler, 0.0);
    scene.skins[0].law = NEO_HOOKEAN;
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.0, 0.01);
    let kind = LoadKind::Pressure { pressure, follower: false };
    scene.loads[0] = Load { kind, start: 0.0, end: 0.1, ..scene.loads[0].clone() };
    scene.time.gravity = [0.0, 0.0, -gravity];
    (scene.time.step, scene.time.duration) = (10e-3, 1.2);
    (scene.solver.newton, scene.solver.tolerance, scene.solver.floor) = (true, 1e-8, 0.0);
    scene
}

#[test]
fn at_rest_newtons_method_has_nothing_to_do() {
    for platform in [Platform::Cpu64, Platform::Cpu32] {
        for (what, pressure, gravity, most) in [
            ("nothing moves", 0.0, 0.0, 0),
            ("weight", 0.0, 9.81, 3),
            ("back from a load", 2e3, 0.0, 3),
            ("both", 2e3, 9.81, 3),
        ] {
            let scene = solved_fully(pressure, gravity);
            let mut simulation = Simulation::new(&scene, &platform).expect("the scene is valid");
            let (mut all, mut last, mut warned) = (0, 0, 0);
            for step in 0..scene.time.steps() {
                let report = simulation.step(false).expect("it runs");
                all = all.max(report.newton_iterations);
                if step >= 100 {
                    last = last.max(report.newton_iterations);
                    warned += report.warnings.values().sum::<u32>();
                }
            }
            println!("{what}, {platform:?}: at most {all} iterations, {last} at rest, {warned} warnings at rest");
            assert!(last <= most, "{what}, {platform:?}: {last} iterations at rest");
            // counter-test: what moves is solved for
            assert!((pressure == 0.0 && gravity == 0.0) || all > 1, "{what}, {platform:?}: {all}");
        }
    }
}
