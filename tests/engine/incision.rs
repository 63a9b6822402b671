//! What the blade does to the skin, and what a run says of the wound, on a small form of the incision scene on the CPU path.

use cutis::scene::{Correction, Cut, Element, Law, Material, Pose, Scene};
use cutis::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use std::path::Path;
use std::time::Instant;

/// Gap that comes to the force of a press in the hand's spring, m; a pass may leave the tolerance's share of it.
const PRESS: f64 = 1e-4;

/// The incision scene on 12 × 12 cells.
fn incision() -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = cutis::scene::read(&root.join("scenes/incision.toml")).expect("the shipped scene is valid");
    scene.skins[0].cells = [12, 12];
    scene
}

/// Its hand replaced: down by `depth` from where the tip touches, within 0.1 s, then still.
fn pressed(depth: f64) -> Scene {
    let mut scene = incision();
    scene.solver.tolerance = 1e-3;
    let tool = &mut scene.tools[0];
    let tip = tool.blade.as_ref().expect("a scalpel has a blade").edge[0];
    let top = scene.skins[0].layers.iter().map(|l| l.thickness).sum::<f64>();
    let pose = |time: f64, down: f64| Pose {
        time,
        position: [-tip[0], 1e-4 - tip[1], top - down - tip[2]],
        rotation: [0.0, 0.0, 0.0, 1.0],
    };
    tool.trajectory = vec![pose(0.0, -1e-4), pose(0.1, depth), pose(10.0, depth)];
    scene
}

fn run(scene: &Scene, steps: u32) -> (Simulation, StepReport) {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
    let mut last = StepReport::default();
    for _ in 0..steps {
        last = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(!last.warnings.contains_key("non_finite_nodes"));
    }
    (simulation, last)
}

fn force(report: &StepReport) -> DVec3 {
    DVec3::from_array(report.contact.on_tool.first().copied().unwrap_or_default())
}

#[test]
fn a_light_press_dents_and_does_not_cut() {
    let (simulation, report) = run(&pressed(1e-4), 40);
    assert_eq!(simulation.totals().links, 0);
    assert!(force(&report).z > 1e-3, "the skin pushes back: {}", force(&report));
}

/// A step that is due ends after its first pass, says what that leaves, and the next one makes it good: neither forces nor the wound stray.
#[test]
fn steps_that_are_due_end_after_one_pass_and_stay_near() {
    let scene = incision();
    let run = |due: bool, steps: u32| {
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
        let (mut most_passes, mut peak, mut shortened) = (0, 0.0f64, vec![]);
        for _ in 0..steps {
            if due {
                simulation.finish_by(Instant::now());
            }
            let report = simulation.step(false).expect("the CPU path has no device to fail");
            assert!(report.warnings.is_empty(), "{:?}", report.warnings);
            most_passes = most_passes.max(report.contact.passes);
            peak = peak.max(force(&report).length());
            shortened
                .extend(report.contact.shortened.then_some([report.contact.residual_n, report.contact.residual_m]));
        }
        (simulation, most_passes, peak, shortened)
    };
    let steps = 170;
    let (free, passes, peak, shortened) = run(false, steps);
    assert!(passes > 2 && shortened.is_empty(), "the counter-test: {passes} passes, {shortened:?}");
    let (mut due, passes, peak_due, shortened) = run(true, steps);
    assert_eq!(passes, 1);
    assert!(shortened.len() > 20, "{}", shortened.len());
    assert!(shortened.iter().all(|left| left[0] > 1e-5 || left[1] > 1e-8), "not to be felt: {shortened:?}");
    assert!((peak_due / peak - 1.0).abs() < 0.1, "{peak_due} N for {peak}");
    let [links, links_due] = [&free, &due].map(|simulation| simulation.totals().links as f64);
    assert!((links_due / links - 1.0).abs() < 0.15, "{links_due} links for {links}");
    // with time again, and a hand that has left or rests, the forces are those of the laws
    let report = due.step(false).expect("the CPU path has no device to fail");
    assert!(!report.contact.shortened && report.contact.residual_n < 3e-3, "{:?}", report.contact.residual_n);
}

#[test]
fn hyperelastic_skin_is_cut_alike() {
    // pressed in, then drawn along; the laws differ by what the skin's strain makes of them
    let drawn = |law: Law| {
        let mut scene = pressed(1.6e-3);
        scene.skins[0].law = law;
        scene.skins[0].layers.iter_mut().for_each(|layer| layer.pre_strain = [0.0; 2]);
        let mut along = scene.tools[0].trajectory[1];
        (along.time, along.position[0]) = (0.3, along.position[0] + 3e-3);
        scene.tools[0].trajectory.insert(2, along);
        scene.tools[0].trajectory[3].position[0] = along.position[0];
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
        let (mut most, mut warned) = (0.0f64, 0);
        for _ in 0..70 {
            let report = simulation.step(false).expect("the CPU path has no device to fail");
            most = most.max(force(&report).length());
            warned += report.warnings.len();
        }
        let end = simulation.step(true).expect("the CPU path has no device to fail");
        assert!(!end.warnings.contains_key("residual_true_above_tolerance"), "{:?}", end.warnings);
        (simulation.totals().links, most, warned)
    };
    let (links, most, warned) = drawn(Law::Hyperelastic(Material::NeoHookean));
    let (wanted, least, _) = drawn(Law::Fem { element: Element::Bbar, corotational: true });
    assert_eq!(warned, 0);
    assert!(links > 5 && links.abs_diff(wanted) * 4 < wanted, "{links} links, {wanted} of corotational skin");
    assert!((most / least - 1.0).abs() < 0.25, "{most} N, {least} N of corotational skin");
}

#[test]
fn a_hard_press_enters_and_tougher_skin_withstands_it() {
    let scene = pressed(1.8e-3);
    let (cut, _) = run(&scene, 60);
    assert!(cut.totals().links > 0, "the blade should have entered");
    assert_eq!(cut.totals().hexahedra, 0, "nothing is removed");
    let mut tough = scene;
    tough.skins[0].layers.iter_mut().for_each(|l| l.toughness *= 100.0);
    let (dented, report) = run(&tough, 60);
    assert_eq!(dented.totals().links, 0, "a hundred times the toughness was cut");
    assert!(force(&report).z > 0.05);
}

#[test]
fn duplicates_without_cells_do_not_move() {
    let (mut cut, _) = run(&pressed(1.8e-3), 60);
    assert!(cut.totals().links > 0, "the blade should have entered");
    let state = cut.snapshots().expect("the CPU path has no device to fail").remove(0);
    let spare: Vec<usize> = (0..state.u.len()).filter(|node| state.dofs[*node][3] == 0.0).collect();
    assert!(!spare.is_empty(), "columns of duplicates are whole, and the cut is not");
    assert!(
        spare.iter().all(|node| state.v[*node] == [0.0; 4]),
        "{:?}",
        spare.iter().map(|n| state.v[*n]).collect::<Vec<_>>()
    );
}

#[test]
fn refinement_counts_contact_forces_in() {
    let mut scene = pressed(1e-4);
    scene.solver.tolerance = 1e-7;
    let (_, plain) = run(&scene, 25);
    scene.solver.refinements = 4;
    let mut single = Simulation::new(&scene, &Platform::Cpu32).expect("the scene fits");
    let mut last = StepReport::default();
    let mut rounds = 0;
    for _ in 0..25 {
        last = single.step(false).expect("the CPU path has no device to fail");
        assert!(last.free.converged, "{:?}", last.free);
        rounds += last.refinements;
    }
    assert!(rounds > 0 && last.contact.count() > 0);
    let difference = (force(&last) - force(&plain)).length() / force(&plain).length();
    assert!(difference < 1e-3, "{difference:e}");
}

#[test]
fn at_rest_the_contact_force_is_the_coupling_force() {
    // SOFA reports 1/1.2 of it: its contact compliance of the tool leaves the coupling out
    let mut scene = pressed(3e-4);
    scene.solver.tolerance = 1e-4; // at 1e-3 the force goes to and fro by 3e-3
    let (simulation, report) = run(&scene, 300);
    let tool = &simulation.tools[0];
    let pull = (DVec3::from_array(scene.tools[0].trajectory[2].position) - tool.position) * tool.coupling.stiffness;
    let balance = (force(&report) + pull).length() / pull.length();
    assert!(pull.length() > 0.01, "there is a force to compare: {pull}");
    assert!(balance < 2e-3, "contact {} against coupling {pull}", force(&report));
}

#[test]
fn forces_do_not_depend_on_how_well_the_columns_were_solved() {
    let of = |tolerance: f64| {
        let mut scene = pressed(3e-4);
        let law = scene.contact.as_mut().expect("the scene has contact");
        (law.column_tolerance, law.tolerance) = (tolerance, 1e-4);
        force(&run(&scene, 40).1)
    };
    // each step's passes end at 1e-4 of the contact energy's norm; sticking remembers forty of them
    let (rough, fine) = (of(0.2), of(1e-4));
    assert!((rough - fine).length() < 1e-2 * fine.length(), "{rough} against {fine}");
}

#[test]
fn a_step_cut_short_is_counted_and_further_from_the_exact_force() {
    let after = |passes: u32| {
        let mut scene = pressed(3e-4);
        scene.skins[0].law = Law::Fem { element: Element::Bbar, corotational: true };
        let law = scene.contact.as_mut().expect("the scene has contact");
        (law.max_passes, law.column_tolerance, law.tolerance) = (passes, 0.5, 1e-5);
        let wanted = law.tolerance;
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene is valid");
        let mut last = StepReport::default();
        let mut short = 0;
        for _ in 0..40 {
            last = simulation.step(false).expect("the CPU path has no device to fail");
            let counted = last.warnings.contains_key("contact_passes_exhausted");
            assert!(last.contact.passes <= passes, "{} of {passes} passes", last.contact.passes);
            // counted is what can be felt: more than the tolerance of the largest force, or of the gap of a press
            let largest = last.contact.forces.iter().flatten().fold(0.0f64, |most, f| most.max(f.abs()));
            let felt = last.contact.residual_n > wanted * largest || last.contact.residual_m > wanted * PRESS;
            assert_eq!(counted, last.contact.passes == passes && last.contact.residual > wanted && felt);
            short += u32::from(counted);
        }
        (force(&last), short)
    };
    let ((one, cut), (two, _), (exact, none)) = (after(1), after(2), after(16));
    let [one, two] = [one, two].map(|f| (f - exact).length() / exact.length());
    println!("one pass is {one:e} off, two {two:e}; {cut} steps cut short");
    assert!(cut > 0 && none == 0, "{cut} steps cut short by one pass, {none} by sixteen");
    assert!(one > 3.0 * two, "one pass is {one} off, two {two}");
}

#[test]
fn the_uncoupled_correction_runs_and_its_true_residual_shows_what_it_leaves() {
    let mut scene = pressed(3e-4);
    let residual = |scene: &Scene| {
        let report = run(scene, 30).0.step(true).expect("the CPU path has no device to fail");
        let warned = report.warnings.contains_key("residual_true_above_tolerance");
        (report.true_residual.expect("it was asked for"), warned)
    };
    let (exact, quiet) = residual(&scene);
    scene.contact.as_mut().expect("the scene has contact").correction = Correction::Uncoupled;
    let (uncoupled, warned) = residual(&scene);
    assert!(!quiet && warned, "more than twice the tolerance is a warning: {exact} {quiet}, {uncoupled} {warned}");
    assert!(exact < 3e-3, "exact correction leaves {exact}");
    assert!(uncoupled > 10.0 * exact, "uncoupled {uncoupled} against exact {exact}");
}

#[test]
fn a_run_repeats_bit_for_bit() {
    let scene = pressed(1.2e-3);
    let state = |_| {
        let mut simulation = run(&scene, 30).0;
        simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u
    };
    assert_eq!(state(0), state(1));
}

#[test]
fn a_cut_leaves_no_hole_in_the_surface() {
    let mut scene = pressed(1.8e-3);
    scene.skins[0].cut = Cut::Split { reserve_columns: 200 };
    let (simulation, _) = run(&scene, 60);
    let surface = &simulation.bodies[0].wound.surface;
    assert!(simulation.totals().links > 0 && surface.all().iter().any(|quad| quad.wall));
    assert_eq!(surface.edges().open, 0);
}

/// The whole slice: where the blade was after each step, m, how many links were said to hold for want of copies, and how it ended.
fn sliced(reserve_columns: u32) -> (Vec<DVec3>, usize, Simulation) {
    let mut scene = incision();
    scene.skins[0].cut = Cut::Split { reserve_columns };
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let (mut path, mut held) = (vec![], 0);
    for _ in 0..scene.time.steps() {
        let step = simulation.step(false).expect("the CPU path has no device to fail");
        let other: Vec<_> = step.warnings.keys().filter(|name| **name != "cut_reserve_exhausted").collect();
        assert!(other.is_empty(), "{reserve_columns} columns at {} s: {other:?}", step.time);
        held += step.warnings.get("cut_reserve_exhausted").copied().unwrap_or_default() as usize;
        path.push(simulation.tools[0].position);
    }
    (path, held, simulation)
}

#[test]
fn a_blade_goes_on_where_the_reserve_is_used_up() {
    let (free, none, whole) = sliced(200);
    let (path, held, mut simulation) = sliced(3);
    let (all, totals) = (whole.totals(), simulation.totals());
    let apart = path.iter().zip(&free).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    let way = path.iter().map(|p| (p.x - path[0].x).abs()).fold(0.0, f64::max);
    println!("{totals:?}, {held} held, of {all:?}; the blade goes {way} m, {apart} m beside the other");
    assert!(none == 0 && all.refused == 0 && all.links > 0);
    assert!(held == totals.refused && held > 0 && totals.links > 0 && totals.links < all.links);
    let body = &mut simulation.bodies[0];
    assert_eq!(body.wound.surface.parts.parents().len(), 3, "the reserve is used up");
    // both follow the hand, whose spring gives by a tenth of a millimetre
    assert!(way > 9e-3 && apart < 3e-4, "{way} m, {apart} m beside the other");
    let surface = &body.wound.surface;
    assert_eq!((surface.edges().open, surface.parts.pieces(&surface.alive)), (0, 1));
    let mass = |dofs: &[[f64; 4]]| dofs.iter().map(|f| f[3]).sum::<f64>();
    let state = body.snapshot().expect("the CPU path has no device to fail");
    assert!((mass(&state.dofs) / mass(&body.model.dofs) - 1.0).abs() < 1e-12);
    assert!(state.u.as_flattened().iter().chain(state.v.as_flattened()).all(|c| c.is_finite()));
}

/// Links severed by a straight cut at `y`, m, on 13 × 13 cells, whose middle row has its centres at 0.
fn straight(y: f64) -> u32 {
    let mut scene = incision();
    scene.skins[0].cells = [13, 13];
    let pose = |(time, x, z): (f64, f64, f64)| Pose { time, position: [x, y, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    let way = [(0.0, 7.0, 17.8), (0.3, 7.2, 14.9), (0.75, 16.5, 15.0), (0.8, 17.0, 15.0), (1.0, 17.2, 19.0)];
    scene.tools[0].trajectory = way.map(|(time, x, z)| pose((time, 1e-3 * x, 1e-3 * z))).to_vec();
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    (0..200).map(|_| simulation.step(false).expect("the CPU path has no device to fail").severed).sum()
}

/// Which side the links of a row are severed on is a tie that the least motion of the skin would decide, in a zigzag.
#[test]
fn a_cut_through_the_centres_of_a_row_of_cells_stays_on_one_side_of_them() {
    let [through, beside] = [0.0, 5e-5].map(straight);
    assert_eq!(through, beside, "links");
    assert!((18..26).contains(&through), "{through} links for 11 mm");
}

/// A blade that is put a millimetre under the skin between two steps, as no motion of it could: what it then is in bears no force, and is not
/// cut by it.
#[test]
fn a_blade_that_came_through_no_surface_neither_presses_nor_cuts() {
    let [mut put, mut left] = [(); 2].map(|()| run(&pressed(-1e-4), 2).0);
    put.tools[0].position.z -= 1.1e-3;
    let [put, left] = [&mut put, &mut left].map(|s| s.step(false).expect("the CPU path has no device to fail"));
    assert!(put.warnings.contains_key("contacts_unexplained"), "{:?}", put.warnings);
    assert!(force(&put).length() < 1e-5 && put.severed == 0, "{} N, {} links", force(&put), put.severed);
    assert!(left.warnings.is_empty(), "the counter-test: {:?}", left.warnings);
    // a blade may start inside, and then it cuts on
    let mut inside = pressed(1e-3);
    let path = &mut inside.tools[0].trajectory;
    path.remove(0);
    (path[0].time, path[1].time) = (0.0, 0.1);
    path[1].position[0] += 2e-3;
    let (_, cutting) = run(&inside, 20);
    assert!(force(&cutting).length() > 1e-2, "the counter-test: {} N", force(&cutting));
}
