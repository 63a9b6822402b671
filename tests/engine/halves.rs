//! What a cut does to a body: two halves are two bodies, a slit in taut skin opens as far as it must, whichever way it lies on the grid.
//!
//! `CUTIS_MEASURED=1` prints what was measured.

use cutis::kernels::cut::Hit;
use cutis::scene::{Files, Load, Pose, Scene, parse};
use cutis::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use std::path::Path;

/// A body that a blade could cut, and the blade far above it.
fn scene(body: &str) -> Scene {
    let text = format!(
        "title = \"wound\"\n[time]\nstep_ms = 1.0\nduration_s = 1.0\ngravity_m_s2 = [0, 0, 0]\n\
         [solver]\npreconditioner = \"multigrid\"\ntolerance = 1e-10\nfloor_n = 1e-14\n{body}\
         [[tool]]\nname = \"scalpel\"\nmesh = \"meshes/scalpel.obj\"\ntrajectory = \"incision.csv\"\nmass_g = 20.0\n\
         inertia_g_mm2 = [4000, 6000, 4000]\n[tool.coupling]\nstiffness_n_m = 3000\ndamping_n_s_m = 10\n\
         angular_stiffness_n_m_rad = 3\nangular_damping_n_m_s_rad = 0.01\n\
         [tool.blade]\nedge_mm = [[-12, 0, -14], [-8, 0, -10]]\nnormal = [0, 1, 0]\nthickness_mm = 0.02\nedge_spacing_mm = 0.2\n\
         depth_mm = 1\nflat_spacing_mm = 1\n[contact]\nfriction = 0.0\nalarm_mm = 0.2\nmax_contacts = 48\n"
    );
    let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
    let mut scene = parse(&text, Path::new("scenes/wound.toml"), &files).unwrap_or_else(|e| panic!("{e}"));
    scene.tools[0].trajectory = vec![Pose { time: 0.0, position: [0.0, 0.0, 1.0], rotation: [0.0, 0.0, 0.0, 1.0] }];
    scene
}

fn simulation(scene: &Scene) -> Simulation {
    Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"))
}

fn step(simulation: &mut Simulation) -> StepReport {
    let report = simulation.step(false).expect("the CPU path has no device to fail");
    assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
    report
}

fn measured(what: &str, value: f64) {
    if std::env::var_os("CUTIS_MEASURED").is_some() {
        println!("{what}: {value:.4e}");
    }
}

/// Links that a plane through `at` with this normal crosses within a band along it, with the places of the crossings.
fn across(simulation: &Simulation, at: DVec3, normal: DVec3, within: impl Fn(DVec3) -> bool) -> Vec<Hit<f64>> {
    let grid = &simulation.bodies[0].model.grid;
    let params = grid.params::<f64>();
    let centre = |cell: usize| {
        let corners = params.corners(cell);
        (DVec3::from_array(grid.rest(corners[0])) + DVec3::from_array(grid.rest(corners[6]))) * 0.5
    };
    let mut hits = vec![];
    for cell in 0..grid.cell_count() {
        for axis in 0..3 {
            let mut beyond = params.cell_at(cell);
            beyond[axis] += 1;
            if beyond[axis] == grid.cells[axis] {
                continue;
            }
            let (p, q) = (centre(cell), centre(params.cell_id(beyond)));
            let (a, b) = ((p - at).dot(normal), (q - at).dot(normal));
            if (a < 0.0) != (b < 0.0) && within(p.lerp(q, a / (a - b))) {
                hits.push(Hit { segment: (3 * cell + axis) as u32, at: a / (a - b) });
            }
        }
    }
    hits
}

const BAR: &str = "[skin]\nsize_mm = [SIZE, 4]\ncells = [CELLS, 4]\nrayleigh_mass_per_s = 0\nrayleigh_stiffness_s = 0.001\n\
                   [[skin.layer]]\nname = \"bar\"\nthickness_mm = 3\ncells = 3\nyoung_kpa = 50\npoisson = 0.45\ndensity_kg_m3 = 1000\n";

fn bar(cells: usize) -> Scene {
    scene(&BAR.replace("SIZE", &cells.to_string()).replace("CELLS", &cells.to_string()))
}

/// Σ m v and Σ m of a body.
fn momentum(simulation: &mut Simulation) -> (DVec3, f64) {
    let state = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail");
    let sum = |f: &dyn Fn(usize) -> DVec3| (0..state.v.len()).map(f).sum::<DVec3>();
    let p = sum(&|n| DVec3::new(state.v[n][0], state.v[n][1], state.v[n][2]) * state.dofs[n][3]);
    (p, state.dofs.iter().map(|f| f[3]).sum())
}

/// A pressure on 2 mm × 2 mm of the top, from an instant on.
fn pressed(scene: &mut Scene, x: f64) {
    let (min, max) = ([x - 1e-3, -1e-3], [x + 1e-3, 1e-3]);
    scene.loads = vec![Load::on_top(&scene.skins[0], 1e3, min, max)];
    scene.skins[0].velocity = [0.1, 0.2, -0.05];
}

#[test]
fn a_bar_cut_through_is_two_bars() {
    const STEPS: u32 = 40;
    let mut whole = bar(8);
    pressed(&mut whole, 2e-3);
    let mut cut = simulation(&whole);
    let before = momentum(&mut cut);
    let hits = across(&cut, DVec3::ZERO, DVec3::X, |_| true);
    assert_eq!(hits.len(), 12);
    cut.bodies[0].sever(&hits).expect("the CPU path has no device to fail");
    let wound = &cut.bodies[0].wound;
    assert_eq!(wound.surface.parts.pieces(&wound.surface.alive), 2);
    assert_eq!(wound.totals.copies, 20, "every node of the section");
    assert!((wound.totals.area - 12e-6).abs() < 1e-18);
    let mut half_scene = bar(4);
    pressed(&mut half_scene, 0.0);
    let mut half = simulation(&half_scene);
    for _ in 0..STEPS {
        step(&mut cut);
        step(&mut half);
    }
    let (all, own) = (cut.bodies[0].snapshot(), half.bodies[0].snapshot());
    let (all, own) = (all.expect("no device").u, own.expect("no device").u);
    let (params, of_half) = (cut.bodies[0].model.grid.params::<f64>(), half.bodies[0].model.grid.params::<f64>());
    let time = f64::from(STEPS) * 1e-3;
    let (mut largest, mut worst, mut drift) = (0.0f64, 0.0f64, 0.0f64);
    for cell in 0..params.cell_count as usize {
        let at = params.cell_at(cell);
        let corners = cut.bodies[0].wound.surface.parts.corners(cell);
        let there = of_half.corners(of_half.cell_id([at[0] % 4, at[1], at[2]]));
        for a in 0..8 {
            for n in 0..3 {
                let u = all[corners[a]][n];
                if at[0] >= 4 {
                    worst = worst.max((u - own[there[a]][n]).abs());
                    largest = largest.max(u.abs());
                } else {
                    drift = drift.max((u - [0.1, 0.2, -0.05][n] * time).abs());
                }
            }
        }
    }
    measured("half against a bar of its length", worst / largest);
    assert!(worst < 1e-8 * largest, "{worst:e} of {largest:e} m");
    assert!(drift < 1e-9 * largest, "the other half feels {drift:e} m");
    // the bar in one piece does otherwise
    let mut uncut = simulation(&whole);
    (0..STEPS).for_each(|_| drop(step(&mut uncut)));
    let u = uncut.bodies[0].snapshot().expect("no device").u;
    assert!((u[0][2] + 0.05 * time).abs() > 1e-4 * largest, "an uncut bar turns as a whole");
    let after = momentum(&mut cut);
    let impulse = DVec3::new(0.0, 0.0, -1e3 * 4e-6 * time);
    assert!((after.1 / before.1 - 1.0).abs() < 1e-14, "mass {:e}", after.1 / before.1 - 1.0);
    let lost = (after.0 - before.0 - impulse).length() / before.0.length();
    measured("momentum lost", lost);
    assert!(lost < 1e-9, "momentum {lost:e}");
}

/// A sheet with held sides, taut along both axes, linear.
fn sheet(cells: usize) -> Simulation {
    held_sheet(cells, "[0.1, 0.1]", "[[boundary]]\nregion = \"sides\"\n")
}

/// A linear sheet with this strain, held as the boundaries say.
fn held_sheet(cells: usize, pre_strain: &str, boundaries: &str) -> Simulation {
    let text = format!(
        "[skin]\nsize_mm = [20, 20]\ncells = [{cells}, {cells}]\nlaw = \"linear\"\ncut_reserve_columns = 600\n\
         [[skin.layer]]\nname = \"sheet\"\nthickness_mm = 1\ncells = 2\nyoung_kpa = 100\npoisson = 0.3\ndensity_kg_m3 = 1000\n\
         pre_strain = {pre_strain}\n{boundaries}"
    );
    let mut scene = scene(&text);
    // a step so long that inertia is nothing
    (scene.time.step, scene.solver.tolerance) = (1e3, 1e-8);
    simulation(&scene)
}

/// Opens a slit of this length through the sheet, in a direction; how far its middle parts at rest, m, and the area of its walls, m².
fn slit(simulation: &mut Simulation, length: f64, degrees: f64) -> (f64, f64) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (along, normal) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
    // beside the nodes, whatever the grid
    let at = DVec3::new(1.3e-5, 1.7e-5, 0.0);
    let hits = across(simulation, at, normal, |x| (x - at).dot(along).abs() < 0.5 * length);
    let body = &mut simulation.bodies[0];
    body.sever(&hits).expect("no device");
    let walls: Vec<_> = body.wound.surface.all().into_iter().filter(|quad| quad.wall).collect();
    let grid = body.model.grid.clone();
    let rest = |body: &cutis::step::Body, node: u32| {
        let corner = body.wound.surface.parts.corner(&grid, node as usize);
        DVec3::from_array(body.wound.rest[node as usize]) + DVec3::from_array(corner.offset)
    };
    let area = |t: [u32; 3]| {
        let [a, b, c] = t.map(|n| rest(body, n));
        0.5 * (b - a).cross(c - a).length()
    };
    let walls_area: f64 = walls.iter().flat_map(|quad| quad.triangles()).map(area).sum();
    let step = simulation.step(false).expect("no device");
    assert!(step.warnings.is_empty(), "{:?}", step.warnings);
    // each severed link near the middle says how far its two cells' faces have parted across the slit
    let body = &mut simulation.bodies[0];
    let u = body.snapshot().expect("no device").u;
    let params = grid.params::<f64>();
    let (mut sum, mut count) = (0.0, 0.0);
    for hit in hits {
        let (cell, axis) = ((hit.segment / 3) as usize, (hit.segment % 3) as usize);
        let mut beyond = params.cell_at(cell);
        beyond[axis] += 1;
        let centre = |cell: usize| -> DVec3 {
            let corners = params.corners(cell);
            (DVec3::from_array(grid.rest(corners[0])) + DVec3::from_array(grid.rest(corners[6]))) * 0.5
        };
        let (p, q) = (centre(cell), centre(params.cell_id(beyond)));
        if (p.lerp(q, hit.at) - at).dot(along).abs() > 1.2e-3 {
            continue;
        }
        let near = body.wound.surface.parts.corners(cell);
        let far = body.wound.surface.parts.corners(params.cell_id(beyond));
        for a in (0..8).filter(|a| cutis::kernels::corner(*a)[axis] == 1) {
            let mut o = cutis::kernels::corner(a);
            o[axis] = 0;
            let b = (0..8).find(|b| cutis::kernels::corner(*b) == o).expect("a corner");
            let parted = DVec3::from_slice(&u[far[b]][..3]) - DVec3::from_slice(&u[near[a]][..3]);
            let side = if (q - p).dot(normal) > 0.0 { 1.0 } else { -1.0 };
            sum += side * parted.dot(normal);
            count += 1.0;
        }
    }
    (sum / count, 0.5 * walls_area)
}

#[test]
fn a_slit_in_a_taut_sheet_opens_the_same_on_finer_grids() {
    let openings: Vec<f64> = [15, 30, 60].into_iter().map(|cells| slit(&mut sheet(cells), 8e-3, 0.0).0).collect();
    openings.iter().for_each(|o| measured("opening, mm", o * 1e3));
    let order = ((openings[0] - openings[1]) / (openings[1] - openings[2])).abs().log2();
    measured("order", order);
    // the sheet without its slit does not open
    assert!(openings[2] > 1e-4);
    let finest = openings[2] + (openings[2] - openings[1]);
    assert!((openings[1] / finest - 1.0).abs() < 0.1, "{openings:?}");
}

#[test]
fn a_slit_opens_alike_whichever_way_it_lies_on_the_grid() {
    let found: Vec<(f64, f64)> = [0.0, 15.0, 30.0, 45.0].into_iter().map(|a| slit(&mut sheet(40), 8e-3, a)).collect();
    for (opening, area) in &found {
        measured("opening, mm", opening * 1e3);
        measured("wall, mm2", area * 1e6);
    }
    for (opening, area) in &found {
        assert!((opening / found[0].0 - 1.0).abs() < 0.1, "{found:?}");
        assert!((area / 8e-6 - 1.0).abs() < 0.1, "{found:?}");
    }
}

/// A sheet that is taut along y by a tenth of its 20 mm, with its two ends brought together by so much each, m.
fn brought_together(by: f64) -> Simulation {
    let end = |y: f64, by: f64| {
        format!(
            "[[boundary]]\nregion = \"plane\"\nthrough_mm = [0, {y}, 0]\nnormal = [0, 1, 0]\nwithin_mm = 0.01\n\
             axes = \"xy\"\ndisplacement_mm = [0, {by}, 0]\n"
        )
    };
    // its thickness is free to follow
    let bottom = "[[boundary]]\nregion = \"bottom\"\naxes = \"z\"\n";
    held_sheet(24, "[0.0, 0.1]", &(end(10.0, -by * 1e3) + &end(-10.0, by * 1e3) + bottom))
}

#[test]
fn a_slit_closes_when_its_sides_are_brought_together() {
    let opening = |by: f64| slit(&mut brought_together(by), 8e-3, 0.0).0;
    let (taut, half, slack) = (opening(0.0), opening(0.5e-3), opening(1e-3));
    [taut, half, slack].iter().for_each(|o| measured("opening, mm", o * 1e3));
    assert!(taut > 1e-4, "{taut}");
    // linear: by as much as the stretch is taken back; without stretch there is nothing that opens it
    assert!((half / taut - 0.5).abs() < 1e-5, "{half} of {taut}");
    assert!((slack / taut).abs() < 1e-5, "{slack} of {taut}");
    assert!(opening(-0.5e-3) > 1.4 * taut, "pulled apart it opens further");
}

/// A block on its bottom, and a blade that passes straight through its upper half in 0.2 s, in steps of some length.
fn sliced(step_ms: f64, toughness: f64) -> (Simulation, f64) {
    let text = format!(
        "[skin]\nsize_mm = [12, 8]\ncells = [12, 8]\n[[skin.layer]]\nname = \"gel\"\nthickness_mm = 3\ncells = 5\n\
         young_kpa = 100\npoisson = 0.45\ndensity_kg_m3 = 1000\ntoughness_kj_m2 = {toughness}\n[[boundary]]\nregion = \"bottom\"\n"
    );
    let mut scene = scene(&text);
    (scene.time.step, scene.solver.tolerance) = (step_ms * 1e-3, 1e-4);
    // the tip enters at one side, 1.4 mm deep, and leaves at the other
    let pose = |time: f64, x: f64| Pose {
        time,
        position: [x + 12e-3, 1.3e-4, 1.6e-3 + 14e-3],
        rotation: [0.0, 0.0, 0.0, 1.0],
    };
    scene.tools[0].trajectory = vec![pose(0.0, -11e-3), pose(0.2, 9e-3), pose(9.0, 9e-3)];
    let mut simulation = simulation(&scene);
    let mut work = 0.0;
    for _ in 0..(220.0 / step_ms).round() as u32 {
        let before = simulation.tools[0].position;
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        let force = report.contact.on_tool.first().map_or(DVec3::ZERO, |f| DVec3::from_array(*f));
        work -= force.dot(simulation.tools[0].position - before);
    }
    (simulation, work)
}

#[test]
fn a_straight_path_through_a_body_at_rest_cuts_the_same_links_in_steps_of_any_length() {
    // tissue that bears nothing stays where it is
    let cuts = |step_ms: f64| -> Vec<(u32, usize)> {
        let (simulation, _) = sliced(step_ms, 1e-9);
        simulation.bodies[0].wound.surface.parts.cuts().map(|(cell, axis, _)| (cell, axis)).collect()
    };
    let fine = cuts(1.0);
    assert_eq!(fine.len(), 24, "two levels of cells have their middle above the tip: {fine:?}");
    assert_eq!(fine, cuts(5.0));
    assert_eq!(fine, cuts(20.0));
}

#[test]
fn the_work_of_a_slice_is_toughness_times_area() {
    const TOUGHNESS: f64 = 0.05;
    let (simulation, work) = sliced(2.0, TOUGHNESS);
    let area = simulation.totals().area;
    // the tip goes 1.4 mm under the top of 12 mm of gel
    let swept = 1.4e-3 * 12e-3;
    measured("work over toughness times swept area", work / (TOUGHNESS * 1e3 * swept));
    measured("severed area over swept area", area / swept);
    assert!((work / (TOUGHNESS * 1e3 * swept) - 1.0).abs() < 0.1, "{:e} J over {:e}", work, TOUGHNESS * 1e3 * swept);
}
