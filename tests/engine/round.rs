//! Spheres and capsules on the skin: what holds them, what they feel, and what each check would miss without it.

use cutis::math::random::Random;
use cutis::scene::{Files, Filter, Integrator, Law, Pose, Scene, parse, read};
use cutis::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use std::path::Path;

fn scene(name: &str) -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    read(&root.join(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// Runs to the end of the scene, or `steps`; reports of all steps.
fn run(scene: &Scene, steps: Option<u32>) -> (Simulation, Vec<StepReport>) {
    let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
    let count = steps.unwrap_or((scene.time.duration / scene.time.step).round() as u32);
    let mut reports = vec![];
    for _ in 0..count {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
        reports.push(report);
    }
    (simulation, reports)
}

fn force(report: &StepReport, tool: usize) -> DVec3 {
    DVec3::from_array(report.contact.on_tool.get(tool).copied().unwrap_or_default())
}

fn peak(reports: &[StepReport]) -> f64 {
    reports.iter().map(|r| force(r, 0).length()).fold(0.0, f64::max)
}

fn last(reports: &[StepReport]) -> f64 {
    reports.last().map_or(0.0, |r| force(r, 0).length())
}

/// How far the lowest point of a tool's first axis end is under the top of the skin there, m; negative above it.
fn depth(simulation: &mut Simulation, tool: usize) -> f64 {
    let u = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u;
    let instrument = &simulation.tools[tool];
    let round = instrument.round.expect("the tool is round");
    let centre = instrument.at(DVec3::from_array(round.ends[0]));
    let top = simulation.bodies[0].model.grid.thickness();
    let rest = &simulation.bodies[0].model.rest;
    let position = |id: u32| {
        let (x, u) = (rest[id as usize], u[id as usize]);
        DVec3::new(x[0] + u[0], x[1] + u[1], x[2] + u[2])
    };
    let faces = simulation.bodies[0].wound.surface.all();
    let tops = faces.iter().filter(|q| q.nodes.iter().all(|n| (rest[*n as usize][2] - top).abs() < 1e-9));
    for [a, b, c] in tops.flat_map(|q| q.triangles()).map(|t| t.map(position)) {
        let twice = |p: DVec3, q: DVec3, r: DVec3| (q - p).truncate().perp_dot((r - p).truncate());
        let weights = [twice(b, c, centre), twice(c, a, centre), twice(a, b, centre)].map(|w| w / twice(a, b, c));
        if weights.iter().all(|w| *w >= -1e-9) {
            let height = a.z * weights[0] + b.z * weights[1] + c.z * weights[2];
            return height - (centre.z - round.radius);
        }
    }
    panic!("the tool is beside the skin: {centre}")
}

fn moved(scene: &Scene, x: f64, y: f64) -> Scene {
    let mut scene = scene.clone();
    for pose in &mut scene.tools[0].trajectory {
        pose.position[0] += x;
        pose.position[1] += y;
    }
    scene
}

/// 20 × 20 × 5 cells of neo-Hookean skin.
fn coarse_press() -> Scene {
    let mut scene = scene("verify/sphere_press_neo_hookean.toml");
    scene.skins[0].cells = [20, 20];
    for (layer, cells) in scene.skins[0].layers.iter_mut().zip([2, 2, 1]) {
        layer.cells = cells;
    }
    scene
}

/// Converged, neo-Hookean, N.
const REFERENCE: f64 = 0.172;

#[test]
fn a_sphere_of_2_mm_is_right_on_cells_of_1_mm_and_neither_one_point_nor_small_strain_is() {
    let press = coarse_press();
    let error = |scene: &Scene| last(&run(scene, None).1) / REFERENCE - 1.0;
    // over a node, an edge and a face: measured +3, +9 and +4 %; +18, +17 and +8 % with chords whose mean lies on the tool
    for (x, y) in [(0.0, 0.0), (5e-4, 0.0), (5e-4, 5e-4)] {
        let found = error(&moved(&press, x, y));
        assert!(found.abs() < 0.1, "at {x}, {y}: {found}");
    }
    // one point never comes to rest: each step finds another nearest one
    let mut one = press.clone();
    (one.time.integrator, one.time.step) = (Integrator::ImplicitEuler, 0.1);
    one.contact.as_mut().expect("it has a tool").filter = Filter::One;
    let (_, reports) = run(&one, None);
    assert!(reports.iter().all(|r| r.contact.count() <= 1));
    assert!(last(&reports) < 0.8 * REFERENCE, "one point: {} N", last(&reports));
    let mut turned = press;
    turned.skins[0].law = Law::Fem { element: cutis::scene::Element::Bbar, corotational: true };
    assert!(error(&turned) < -0.1, "corotational");
}

#[test]
fn a_small_sphere_never_slips_through_wherever_it_is_pressed() {
    let press = scene("hard/press_vertex_edge_face.toml");
    let radius = press.tools[0].round.expect("it is round").radius;
    let mut generator = Random::new(20);
    let mut random = || (generator.unit() - 0.5) * 2e-3;
    // vertex, edges along x and y, the diagonal, faces
    let mut positions = vec![[0.0, 0.0], [5e-4, 0.0], [0.0, 5e-4], [2.5e-4, 2.5e-4], [7.5e-4, 2.5e-4], [5e-4, 5e-4]];
    positions.extend((0..200).map(|_| [random(), random()]));
    let pressed = |[x, y]: [f64; 2]| {
        let (mut simulation, reports) = run(&moved(&press, x, y), None);
        let forces: Vec<f64> = reports.iter().map(|r| force(r, 0).length()).collect();
        let rest = &forces[forces.len() - 6..];
        let noise = rest.windows(2).map(|f| (f[1] - f[0]).abs()).fold(0.0, f64::max) / rest[5];
        let most = reports.iter().map(|r| r.contact.count()).max().unwrap_or(0);
        assert!(rest[5] > 0.01, "at {x}, {y}: {} N", rest[5]);
        (depth(&mut simulation, 0), noise, most)
    };
    let (left, right) = positions.split_at(positions.len() / 2);
    let all = |positions: &[[f64; 2]]| positions.iter().map(|p| pressed(*p)).collect::<Vec<_>>();
    let mut found = std::thread::scope(|scope| {
        let other = scope.spawn(|| all(right));
        [all(left), other.join().expect("its message is above")].concat()
    });
    println!("vertex, edges, diagonals, face: {:?}", &found[..6]);
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = found[found.len() - 1].0;
    let noise = found.iter().map(|f| f.1).fold(0.0, f64::max);
    let most = found.iter().map(|f| f.2).max();
    println!(
        "depth/R median {:.4}, largest {:.4}; noise {noise:.4}; contacts {most:?}",
        found[found.len() / 2].0 / radius,
        worst / radius
    );
    assert!(worst < DEEPEST * radius, "{worst} m under the surface");
    assert!(noise < NOISE, "the force at rest changes by {noise} of itself in a step");
    let mut free = press;
    free.contact = None;
    let mut simulation = run(&free, None).0;
    assert!(depth(&mut simulation, 0) > 0.9e-3, "without contact it goes through");
}

/// How far a sphere at rest may be under the surface, radii: the first touch is found to 1 % of the radius, and the skin turns under
/// it within a step.
const DEEPEST: f64 = 0.05;
/// Change of the force at rest from step to step, share: measured 0.035 at the worst of 206 positions, and 0.51 with one nearest point.
const NOISE: f64 = 0.1;

/// Force on the bed of a scene's test form at its end, N.
fn on_bed(scene: &Scene) -> f64 {
    let (_, reports) = run(&scene.in_test_form(), None);
    reports.last().map_or(f64::NAN, |r| r.probes[0].abs())
}

#[test]
fn a_sphere_on_a_half_space_meets_hertz_and_neither_one_point_nor_plain_hexahedra_do() {
    let hertz = scene("verify/hertz.toml");
    let (r, d, h, poisson, young) = (5e-3f64, 1e-4f64, 1e-2, 0.49, 1e5);
    let alpha = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson * poisson) / (1.0 - poisson);
    let beta = (0.6387 - 1.0277 * poisson + 1.5164 * poisson * poisson) / (1.0 - poisson);
    let (pi, thin) = (std::f64::consts::PI, (r * d).sqrt() / h);
    let terms = [1.0, -2.0 * alpha / pi, (2.0 * alpha / pi).powi(2)];
    let third = -8.0 / pi.powi(3) * (alpha.powi(3) + 4.0 * pi * pi / 15.0 * beta);
    let correction = terms[0] + thin * (terms[1] + thin * (terms[2] + thin * third));
    let quarter = young / (3.0 * (1.0 - poisson * poisson)) * r.sqrt() * d.powf(1.5) * correction;
    let error = |scene: &Scene| on_bed(scene) / quarter - 1.0;
    let found = error(&hertz);
    println!("{:.2} % on cells of 0.375 mm", found * 100.0);
    assert!(found.abs() < 0.02, "{found}");
    let mut one = hertz.clone();
    one.contact.as_mut().expect("it has a tool").filter = Filter::One;
    assert!(error(&one) < -0.2, "one point: {}", error(&one));
    let mut plain = hertz;
    plain.skins[0].law = Law::Fem { element: cutis::scene::Element::Plain, corotational: false };
    assert!(error(&plain) > 0.05, "plain hexahedra: {}", error(&plain));
}

#[test]
fn friction_slides_with_its_limit_and_sticks_below() {
    let known = scene("verify/friction_known.toml");
    let at_end = |scene: &Scene| {
        let reports = run(scene, None).1;
        let end = reports.last().expect("it has steps").clone();
        [0, 1].map(|tool| force(&end, tool))
    };
    let tangential = |f: DVec3| f.truncate().length();
    let [slides, sticks] = at_end(&known);
    assert!((slides.z / 1e-3 - 1.0).abs() < 0.01 && (sticks.z / 1e-3 - 1.0).abs() < 0.01, "{slides} {sticks}");
    assert!((tangential(slides) / 0.3e-3 - 1.0).abs() < 0.02, "{slides}");
    assert!((tangential(sticks) / 0.15e-3 - 1.0).abs() < 0.02, "{sticks}");
    let mut smooth = known;
    smooth.contact.as_mut().expect("it has tools").friction = 0.1;
    let [_, slips] = at_end(&smooth);
    assert!(tangential(slips) < 0.11e-3, "under μ 0.1 the second slides too: {slips}");
}

#[test]
fn a_deep_press_is_held_by_the_same_force_fast_and_slow() {
    let press = scene("hard/press_deep.toml");
    let (mut simulation, reports) = run(&press, None);
    let radius = press.tools[0].round.expect("it is round").radius;
    let (slow, fast) = (force(&reports[39], 0), force(&reports[79], 0));
    println!("slow {slow}, fast {fast}");
    assert!((slow.z - fast.z).abs() < 0.1 * slow.z, "{slow} and {fast}");
    assert!(depth(&mut simulation, 0) < DEEPEST * radius);
    let mut free = press;
    free.contact = None;
    assert!(depth(&mut run(&free, None).0, 0) > 1.0e-3, "without contact it goes through");
}

#[test]
fn a_sudden_withdrawal_never_pulls_and_leaves_no_force() {
    let (mut simulation, reports) = run(&scene("hard/withdraw_sudden.toml"), None);
    assert!(peak(&reports) > 0.02);
    assert!(reports.iter().all(|r| force(r, 0).z >= 0.0), "it pulls");
    let left = &reports[21..];
    assert!(left.iter().all(|r| force(r, 0) == DVec3::ZERO && r.contact.count() == 0));
    let u = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u;
    let most = u.iter().flat_map(|u| u[..3].to_vec()).fold(0.0f64, |m, c| m.max(c.abs()));
    assert!(most < 2e-6, "{most} m away from rest");
}

#[test]
fn a_tool_that_starts_inside_is_pushed_out() {
    let inside = scene("hard/tool_starts_inside.toml");
    let (mut simulation, reports) = run(&inside, None);
    let radius = inside.tools[0].round.expect("it is round").radius;
    let found = depth(&mut simulation, 0);
    assert!(found < DEEPEST * radius, "{found} m under the surface");
    assert!(force(&reports[59], 0).z > 0.01 && simulation.tools[0].position.z > 2.2e-3);
    let mut free = inside;
    free.contact = None;
    assert!(depth(&mut run(&free, None).0, 0) > radius, "without contact it stays");
}

#[test]
fn two_tools_in_one_dent_share_what_they_press() {
    let both = scene("hard/tools_two_in_one_dent.toml");
    let (_, reports) = run(&both, None);
    let (left, right) = (force(&reports[29], 0).z, force(&reports[29], 1).z);
    assert!((left - right).abs() < 0.05 * left, "{left} and {right}");
    let mut alone = both;
    alone.tools.truncate(1);
    let alone = force(&run(&alone, None).1[29], 0).z;
    println!("each {left} N, alone {alone} N");
    assert!(left < 0.95 * alone, "each {left}, alone {alone}");
}

#[test]
fn a_tip_at_1_m_s_does_not_pass_through_2_mm_of_skin() {
    let thrust = scene("hard/tip_fast.toml");
    let radius = thrust.tools[0].round.expect("it is round").radius;
    let (mut simulation, reports) = run(&thrust, None);
    assert!(peak(&reports) > 0.05, "it has hit");
    assert!(depth(&mut simulation, 0) < DEEPEST * radius);
    assert!(force(&reports[59], 0).z > 0.005, "it rests on the skin");
    let (mut hit, _) = run(&thrust, Some(3));
    assert!(depth(&mut hit, 0) < 0.5 * radius, "right after the hit: {}", depth(&mut hit, 0));
    let mut free = thrust;
    free.contact = None;
    let lowest = run(&free, Some(3)).0.tools[0].position.z;
    assert!(lowest + radius < 0.0, "without contact the step ends below the skin: {lowest}");
}

#[test]
fn a_capsule_lies_on_the_skin_along_its_whole_length() {
    let mut lying = scene("hard/withdraw_sudden.toml");
    let tool = &mut lying.tools[0];
    tool.round.as_mut().expect("it is round").ends = [[-2e-3, 0.0, 0.0], [2e-3, 0.0, 0.0]];
    let pose = |time: f64, z: f64| Pose { time, position: [0.0, 0.0, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    tool.trajectory = vec![pose(0.0, 3.31e-3), pose(0.05, 3.0e-3)];
    let (mut simulation, reports) = run(&lying, Some(30));
    assert!(reports[29].contact.count() >= 8, "{}", reports[29].contact.count());
    assert!(depth(&mut simulation, 0) < 0.05e-3);
    let tilt = 2.0 * simulation.tools[0].rotation.xyz().length();
    assert!(tilt < 0.02, "tilted by {tilt} rad");
    let sphere = last(&run(&scene("hard/withdraw_sudden.toml"), Some(20)).1);
    println!("capsule at 0.3 mm {} N, sphere at 0.5 mm {sphere} N", last(&reports));
}

/// A thin block held at its bottom, with a ball that presses as deep as the block is thick, then moves aside: `skin` and `layer` have further
/// keys of these sections, `tool` further sections, and the path goes from above to below by way of the heights, mm.
fn pressed_flat(skin: &str, layer: &str, [radius, stiffness]: [f64; 2], [above, below]: [f64; 2], tool: &str) -> Scene {
    let text = format!(
        "title = \"pressed flat\"
[time]
step_ms = 5.0
duration_s = 0.4
[solver]
tolerance = 1e-2
[skin]
size_mm = [8.0, 8.0]
cells = [8, 8]
rayleigh_mass_per_s = 0.01
rayleigh_stiffness_s = 0.01
{skin}
[[skin.layer]]
name = \"skin\"
thickness_mm = 2.3
cells = 4
density_kg_m3 = 1100.0
{layer}
[[boundary]]
region = \"bottom\"
[[tool]]
name = \"ball\"
path_mm = [[0.0, -1.5, 0.05, {above}], [0.2, -1.5, 0.05, {below}], [0.4, 1.5, 0.05, {below}]]
mass_g = 20.0
inertia_g_mm2 = [80.0, 80.0, 80.0]
[tool.round]
radius_mm = {radius}
points_mm = [[0.0, 0.0, 0.0]]
[tool.coupling]
stiffness_n_m = {stiffness}
damping_n_s_m = 10.0
angular_stiffness_n_m_rad = 3.0
angular_damping_n_m_s_rad = 0.01
{tool}
[contact]
friction = 0.1
alarm_mm = 0.2
max_contacts = 400
"
    );
    parse(&text, Path::new("pressed.toml"), &Files::Folder(Path::new(".").into())).unwrap_or_else(|e| panic!("{e}"))
}

/// A ball goes 0.3 mm past a held bottom, and one carves down to it. The nearest surface to its axis then is the bottom, from the inside, which
/// would push it down: 63 N and 89 N.
#[test]
fn a_ball_that_presses_the_skin_flat_is_pushed_back_to_its_side() {
    let soft = "young_kpa = 40.0\npoisson = 0.45";
    let (_, reports) = run(&pressed_flat("", soft, [1.5, 20000.0], [4.0, 1.2], ""), None);
    assert!(reports[16..].iter().all(|report| force(report, 0).z > 0.0), "pulled down");
    assert!((2.0..8.0).contains(&peak(&reports)), "{} N", peak(&reports));
    let stiff = "young_kpa = 300.0\npoisson = 0.45";
    let carve = "[tool.carve]\ndistance_mm = 0.1\npressure_kpa = 40.0";
    let (_, reports) = run(&pressed_flat("cut = \"remove\"", stiff, [1.0, 20000.0], [3.5, 1.3], carve), None);
    assert!((0.5..8.0).contains(&peak(&reports)), "{} N", peak(&reports));
}

/// A Mooney–Rivlin block whose cells are pressed flat bears little more than a neo-Hookean one of its moduli. With the linearisation of the
/// latter steps diverge: 106 N.
#[test]
fn mooney_rivlin_skin_that_is_pressed_flat_stays_stable() {
    let shape = ([0.5, 1000.0], [3.0, 0.6]);
    let neo = pressed_flat("", "young_kpa = 38.9\npoisson = 0.4515", shape.0, shape.1, "");
    let constants = "c10_kpa = 5.0\nc01_kpa = 1.7\nbulk_kpa = 134.0";
    let mooney = pressed_flat("law = \"mooney_rivlin\"", constants, shape.0, shape.1, "");
    let [neo, mooney] = [neo, mooney].map(|scene| peak(&run(&scene, None).1));
    assert!((1.0..1.5).contains(&(mooney / neo)), "{mooney} N, {neo} N");
}

/// A block of 8 × 8 × 4 mm that is held at its sides, with a tool that is pressed in, then dragged over an edge by a hand along this path.
fn dragged_over_an_edge(young: f64, tool: &str, path: [[f64; 4]; 3]) -> Scene {
    let text = format!(
        "title = \"dragged over an edge\"
[time]
step_ms = 5.0
duration_s = {}
gravity_m_s2 = [0.0, 0.0, 0.0]
[solver]
preconditioner = \"multigrid\"
tolerance = 1e-2
[skin]
size_mm = [8.0, 8.0]
cells = [8, 8]
rayleigh_stiffness_s = 0.01
[[skin.layer]]
name = \"gel\"
thickness_mm = 4.0
cells = 4
young_kpa = {young:?}
poisson = 0.45
density_kg_m3 = 1000.0
[[boundary]]
region = \"sides\"
[[tool]]
name = \"tool\"
path_mm = {path:?}
mass_g = 20.0
inertia_g_mm2 = [100.0, 100.0, 100.0]
{tool}
[tool.coupling]
stiffness_n_m = 3000.0
damping_n_s_m = 10.0
angular_stiffness_n_m_rad = 3.0
angular_damping_n_m_s_rad = 0.01
[contact]
friction = 0.3
",
        (path[2][0] / 0.005).ceil() * 0.005 + 0.1
    );
    const MESHES: [(&str, &str); 2] = [
        ("lines.obj", "v 0 0 0\nv 0 0 3\nv 1.5 0 0.5\np 1\nl 1 2\nl 1 3\n"),
        ("shape.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"),
    ];
    parse(&text, Path::new("dragged.toml"), &Files::Embedded(&MESHES)).unwrap_or_else(|e| panic!("{e}"))
}

/// The skin holds a tool by no more than the hand pulls it. Behind the held edge cells are crushed and fold over: by the nearest surface alone
/// spheres, points and lines count as inside, through skin that they have never touched, and were thrown by 34, 23, 35, 67 and 15 N.
#[test]
fn a_tool_that_is_dragged_over_a_held_edge_is_not_thrown() {
    let ball = |radius: f64| format!("[tool.round]\nradius_mm = {radius}\npoints_mm = [[0, 0, 0]]");
    let points = "points_mm = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0.6, 0, 0.5], [1.2, 0, 1]]\ntip_radius_mm = 0.5";
    let points = format!("mesh = \"shape.obj\"\n{points}");
    let lines = "mesh = \"shape.obj\"\n[tool.lines]\nmesh = \"lines.obj\"".to_string();
    let over = [
        (100.0, ball(1.0), [[0.0, 1.51, 0.324, 5.5], [0.1, 1.51, 0.324, 4.1436], [0.3588, 3.1894, -7.4976, 4.1436]]),
        (
            100.0,
            ball(0.492),
            [[0.0, -2.4647, -0.8288, 4.9921], [0.1, -2.4647, -0.8288, 3.179], [0.2525, 0.0852, -8.4116, 3.179]],
        ),
        (
            100.0,
            ball(1.458),
            [[0.0, -0.2815, -0.0235, 5.958], [0.1, -0.2815, -0.0235, 3.9936], [0.5337, -0.9464, 7.9489, 3.9936]],
        ),
        (
            30.0,
            points,
            [[0.0, -2.0833, -0.7157, 4.6], [0.1, -2.0833, -0.7157, 3.0808], [0.5022, -4.6825, 6.8503, 3.0808]],
        ),
        (
            100.0,
            lines,
            [[0.0, -0.1054, -0.7225, 4.6], [0.1, -0.1054, -0.7225, 3.6416], [0.3722, -8.0216, 0.4328, 3.6416]],
        ),
    ];
    for (young, tool, path) in over {
        let scene = dragged_over_an_edge(young, &tool, path);
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
        let hand = |time: f64| {
            let at = |k: usize| DVec3::from_slice(&path[k][1..]) * 1e-3;
            let share = |k: usize| ((time - path[k][0]) / (path[k + 1][0] - path[k][0])).clamp(0.0, 1.0);
            let k = usize::from(time > path[1][0]);
            at(k).lerp(at(k + 1), share(k))
        };
        let (mut before, mut felt) = (0.0, 0.0f64);
        for _ in 0..(scene.time.duration / scene.time.step).round() as u32 {
            let report = simulation.step(false).expect("the CPU path has no device to fail");
            let ahead = hand(report.time).distance(simulation.tools[0].position);
            // the spring, two thirds more for the damper and the tool's inertia, and 1 N to stop the tool
            let (borne, most) = (force(&report, 0).length(), 5000.0 * ahead.max(before) + 1.0);
            assert!(borne < most, "{tool}: {borne} N, the hand {ahead} m ahead at {} s", report.time);
            (before, felt) = (ahead, felt.max(borne));
        }
        assert!(felt > 0.5, "{tool}: {felt} N: the edge is not met");
    }
}

/// Contacts and force of a sphere of so many cells' width that is pressed into the whole patch by 0.1 mm.
fn pressed_by_a_large_sphere(cells: f64) -> (usize, f64) {
    let mut scene = scene("hard/press_deep.toml");
    scene.skins[0].cells = [6, 6];
    let contact = scene.contact.as_mut().expect("it has contact");
    (contact.max_contacts, contact.friction) = (400, 0.0);
    let radius = cells * scene.skins[0].size[0] / 6.0;
    let top = scene.skins[0].layers.iter().map(|layer| layer.thickness).sum::<f64>();
    let tool = &mut scene.tools[0];
    tool.round.as_mut().expect("it is round").radius = radius;
    tool.coupling.stiffness = 1e6;
    let pose =
        |time: f64, down: f64| Pose { time, position: [0.0, 0.0, top + radius - down], rotation: [0.0, 0.0, 0.0, 1.0] };
    tool.trajectory = vec![pose(0.0, -1e-5), pose(0.05, 1e-4)];
    let (_, reports) = run(&scene, Some(20));
    (reports.last().map_or(0, |report| report.contact.count()), last(&reports))
}

#[test]
fn nearly_a_plane_touches_the_corners_of_faces_alone_and_feels_the_same() {
    // pressed edges are a little longer than cells; those of diagonals longer by √2
    let [points, edges, wider, corners] = [980.0, 1030.0, 1370.0, 1480.0].map(pressed_by_a_large_sphere);
    let counts = [points, edges, wider, corners].map(|found| found.0);
    assert_eq!(counts, [49 + 84 + 36, 49 + 36, 49 + 36, 49], "corners, midpoints of edges, of diagonals");
    for (fewer, more) in [(edges, points), (corners, wider)] {
        assert!((fewer.1 / more.1 - 1.0).abs() < 1e-2, "{fewer:?} {more:?}");
    }
    let smaller = pressed_by_a_large_sphere(100.0);
    assert!(smaller.1 < 0.9 * points.1, "the counter-test: the radius is felt, {smaller:?} {points:?}");
}
