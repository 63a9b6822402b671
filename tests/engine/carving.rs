//! Carving: whole cells behind a tool's contacts are removed, and with them what would hang by an edge or a corner, as far as SOFA's
//! CarvingManager does not: with any number of points, through held nodes, and with every gram accounted for.

use crate::small::{block, held};
use cutis::bodies::{Model, Wound};
use cutis::math::random::Random;
use cutis::mesh::Edges;
use cutis::scene::{Carve, Contact, Cut, Pose, Region, Round, Scene, Tool};
use cutis::step::{Platform, Simulation, StepReport};

/// Fewest cells of a piece.
const FRAGMENT: usize = 8;

/// A block of 8 × 8 × 5 cells of 1 mm, held at its bottom, that can be carved.
fn body() -> Scene {
    let mut scene = block([8e-3, 8e-3], [8, 8], &[(3, 3e-3, 30e3, 0.45, 1000.0), (2, 2e-3, 100e3, 0.45, 1100.0)]);
    scene.skins[0].cut = Cut::Remove;
    scene.boundaries = vec![held(Region::Bottom, [true; 3])];
    scene
}

/// The block under a tool that goes down and along, and carves.
fn carved(tool: Tool) -> Scene {
    let mut scene = body();
    let pose = |time, x, z| Pose { time, position: [x, 0.1e-3, z], ..Pose::default() };
    let trajectory: Vec<Pose> = vec![pose(0.0, -2e-3, 7e-3), pose(0.1, -2e-3, 5.2e-3), pose(0.3, 2e-3, 5.2e-3)];
    let round = tool.round.filter(|_| tool.points.is_empty());
    scene.tools = vec![Tool { blade: None, trajectory, round, ..tool }];
    scene.contact = Some(Contact { max_contacts: 200, ..Contact::default() });
    scene.time.duration = 0.3;
    scene
}

fn ball(carve: Carve) -> Scene {
    let round = Round { ends: [[0.0; 3]; 2], radius: 1e-3 };
    carved(Tool { round: Some(round), points: vec![], carve: Some(carve), ..Tool::default() })
}

fn run(scene: &Scene, platform: &Platform) -> (Simulation, Vec<StepReport>) {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    let steps = (0..scene.time.steps()).map(|_| simulation.step(false).unwrap_or_else(|e| panic!("{e}"))).collect();
    (simulation, steps)
}

/// Cells of the body that remain.
fn alive(wound: &Wound) -> Vec<usize> {
    (0..wound.surface.alive.len()).filter(|cell| wound.surface.alive[*cell]).collect()
}

/// Number of connected components of some cells by shared faces.
fn components(model: &Model, cells: &[usize]) -> Vec<usize> {
    let cell_at = |cell: usize| model.params::<f64>().cell_at(cell);
    let mut left: Vec<usize> = cells.to_vec();
    let mut sizes = vec![];
    while let Some(first) = left.pop() {
        let mut found = vec![first];
        let mut seen = 0;
        while seen < found.len() {
            let here = cell_at(found[seen]);
            let touches =
                |cell: &usize| cell_at(*cell).iter().zip(here).map(|(a, b)| a.abs_diff(b)).sum::<usize>() == 1;
            let (more, rest) = left.iter().partition(|cell| touches(cell));
            (left, found) = (rest, [found, more].concat());
            seen += 1;
        }
        sizes.push(found.len());
    }
    sizes
}

/// What no carved body may have: cells around a node or an edge that do not share faces, pieces that are too small, masses that are not the cells'.
fn faults(model: &Model, wound: &Wound) -> Vec<String> {
    let mut out = vec![];
    let params = model.params::<f64>();
    let alive = alive(wound);
    for node in 0..model.own_nodes() {
        let around: Vec<usize> = alive.iter().copied().filter(|cell| params.corners(*cell).contains(&node)).collect();
        if components(model, &around).len() > 1 {
            out.push(format!("node {node} holds {around:?} together"));
        }
        if around.is_empty() != (wound.dofs[node][3] == 0.0) {
            out.push(format!("node {node} of {} cells has {} kg", around.len(), wound.dofs[node][3]));
        }
    }
    let edges = wound.surface.edges();
    if edges != Edges::default() {
        out.push(format!("{edges:?}"));
    }
    out.extend(
        components(model, &alive).iter().filter(|size| **size < FRAGMENT).map(|size| format!("a piece of {size}")),
    );
    let [mass, wanted] = [wound.mass_of_nodes(), model.mechanics().mass_left(model, wound)];
    if (mass - wanted).abs() > 1e-12 * model.dofs.iter().map(|dofs| dofs[3]).sum::<f64>() {
        out.push(format!("{mass} kg at the nodes, {wanted} kg in the cells"));
    }
    let volume = (wound.surface.alive.len() - alive.len()) as f64 * 1e-9;
    if (wound.totals.volume - volume).abs() > 1e-12 * volume {
        out.push(format!("{} m³ booked, {volume} m³ gone", wound.totals.volume));
    }
    out
}

#[test]
fn random_carving_leaves_nothing_that_hangs_and_books_every_gram() {
    let scene = body();
    let model = Model::new(&scene, 0).unwrap_or_else(|e| panic!("{e}"));
    let cells = model.grid.cell_count() as u64;
    for seed in 1..20u64 {
        let mut wound = Wound::new(&model);
        let mut random = Random::new(seed);
        // until nine cells of ten are gone, through held nodes too
        while alive(&wound).len() as u64 * 10 > cells {
            let chosen: Vec<u32> = (0..=random.below(6)).map(|_| random.below(cells) as u32).collect();
            let removal = wound.carve(&model, &chosen);
            assert!(chosen.iter().all(|cell| !wound.surface.alive[*cell as usize]));
            assert!(removal.cells.iter().all(|cell| !wound.surface.alive[*cell as usize]));
            let found = faults(&model, &wound);
            assert!(found.is_empty(), "seed {seed}: {found:?}");
        }
    }
    // the counter-test: two cells that share an edge alone
    let mut wound = Wound::new(&model);
    for cell in 0..model.grid.cell_count() {
        let [x, y, z] = model.params::<f64>().cell_at(cell);
        wound.surface.alive[cell] = z < 2 || (x + y) % 2 == 0;
    }
    assert!(faults(&model, &wound).iter().any(|fault| fault.contains("together")));
}

#[test]
fn a_ball_carves_a_groove_as_deep_as_it_goes() {
    let scene = ball(Carve { distance: 2e-5, pressure: 0.0, whole_cells: true });
    let (simulation, steps) = run(&scene, &Platform::Cpu64);
    let body = &simulation.bodies[0];
    let carved: u32 = steps.iter().map(|step| step.carved).sum();
    let totals = simulation.totals();
    assert!(carved as usize == totals.hexahedra && carved >= 6, "{carved} {}", totals.hexahedra);
    assert!(faults(&body.model, &body.wound).is_empty(), "{:?}", faults(&body.model, &body.wound));
    // the ball's lowest point is 0.8 mm below the top: one cell deep or two, and as long as its way
    assert!((0.99e-3..2.01e-3).contains(&totals.depth) && totals.length >= 4e-3, "{totals:?}");
    assert!(
        steps.iter().all(|step| step.warnings.is_empty()),
        "{:?}",
        steps.iter().map(|s| &s.warnings).collect::<Vec<_>>()
    );
    // without carving it presses, and presses harder
    let whole =
        run(&Scene { tools: vec![Tool { carve: None, ..scene.tools[0].clone() }], ..scene.clone() }, &Platform::Cpu64);
    let peak = |steps: &[StepReport]| steps.iter().map(|s| s.contact.largest_on_tools()).fold(0.0, f64::max);
    assert!(
        whole.0.totals().hexahedra == 0 && peak(&whole.1) > 1.5 * peak(&steps),
        "{} {}",
        peak(&whole.1),
        peak(&steps)
    );
    // in f32 the same cells go, but for those that rounding decides
    let single = run(&scene, &Platform::Cpu32).0.totals().hexahedra;
    assert!(single.abs_diff(totals.hexahedra) <= 2, "{single} {}", totals.hexahedra);
}

#[test]
fn a_pressure_has_to_be_reached() {
    let removed = |pressure| {
        run(&ball(Carve { distance: 2e-5, pressure, whole_cells: true }), &Platform::Cpu64).0.totals().hexahedra
    };
    let [at_once, pressed, never] = [0.0, 20e3, 1e9].map(removed);
    assert!(at_once > pressed && pressed > 0 && never == 0, "{at_once} {pressed} {never}");
}

/// SOFA's CarvingManager crashes with four.
#[test]
fn any_number_of_points_carves() {
    for side in [1u32, 2, 8] {
        let at = |k: u32| 3e-3 * (f64::from(k) / f64::from((side - 1).max(1)) - 0.5);
        let points = (0..side * side).map(|k| [at(k % side), at(k / side), 0.0]).collect();
        let mut scene = carved(Tool {
            points,
            carve: Some(Carve { distance: 2e-5, pressure: 0.0, whole_cells: true }),
            ..Tool::default()
        });
        for pose in &mut scene.tools[0].trajectory {
            pose.position[2] -= 1e-3;
        }
        let (simulation, steps) = run(&scene, &Platform::Cpu64);
        let body = &simulation.bodies[0];
        assert!(simulation.totals().hexahedra >= side as usize, "{side}: {}", simulation.totals().hexahedra);
        assert!(faults(&body.model, &body.wound).is_empty(), "{side}");
        assert!(
            steps.iter().all(|step| step.contact.on_tool.iter().flatten().all(|force| force.is_finite())),
            "{side}"
        );
    }
}

/// Asserts that `k` steps, the state, and 15 more from it are `k` + 15 steps bit for bit, with something carved before and after, by what is
/// `removed`; returns the simulation that was not interrupted.
pub fn goes_on(scene: &Scene, k: u32, removed: fn(&Simulation) -> f64) -> Simulation {
    let make = || Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let steps = |simulation: &mut Simulation, count: u32| {
        (0..count).for_each(|_| drop(simulation.step(false).unwrap_or_else(|e| panic!("{e}"))));
    };
    let (mut whole, mut first, mut rest) = (make(), make(), make());
    steps(&mut whole, k + 15);
    steps(&mut first, k);
    assert!(removed(&first) > 0.0 && removed(&whole) > removed(&first), "carved before and after");
    rest.restore(&first.state().expect("it has a state")).expect("the same scene");
    steps(&mut rest, 15);
    let bytes = |simulation: &mut Simulation| {
        postcard::to_allocvec(&simulation.state().expect("it has a state")).expect("it can be written")
    };
    assert_eq!(bytes(&mut whole), bytes(&mut rest));
    assert_ne!(bytes(&mut whole), bytes(&mut first), "the counter-test");
    whole
}

#[test]
fn a_carved_body_goes_on_from_its_state() {
    let scene = ball(Carve { distance: 2e-5, pressure: 0.0, whole_cells: true });
    goes_on(&scene, 35, |simulation| simulation.totals().hexahedra as f64);
}

#[test]
fn a_body_that_cannot_be_carved_is_refused() {
    let scene = ball(Carve { distance: 2e-5, pressure: 0.0, whole_cells: true });
    let refused = |change: fn(&mut Scene)| {
        let mut changed = scene.clone();
        change(&mut changed);
        changed.check().expect_err("it cannot be carved").to_string()
    };
    let split = refused(|scene| scene.skins[0].cut = Cut::Split { reserve_columns: 4 });
    assert!(split.contains("cut = \"remove\"") && split.contains("carves"), "{split}");
    let near = refused(|scene| scene.tools[0].carve = Some(Carve { distance: -1.0, pressure: 0.0, whole_cells: true }));
    assert!(near.contains("distance"), "{near}");
    assert!(scene.check().is_ok());
}
