//! Tools of points and lines on the skin: each pair of features on a configuration known by hand, the normal cones, the way out of the
//! skin, and whole presses; each check with what it would miss.

use cutis::bodies::rigid::{Instrument, UnconstrainedMotion};
use cutis::collide::features::closest;
use cutis::collide::features::cones::Cone;
use cutis::collide::features::{self, contacts_among};
use cutis::collide::sides::Last;
use cutis::collide::{Contact, Patch, Search};
use cutis::constraints::Law;
use cutis::math::random::Random;
use cutis::mesh::Face;
use cutis::scene::{Coupling, Filter, Lines, Pose, Scene, Tool, ToolMesh, read};
use cutis::step::{Platform, Simulation, StepReport};
use glam::{DMat3, DVec3};
use proptest::prelude::*;
use std::path::Path;

/// m
const MM: f64 = 1e-3;

/// Contacts of a first step.
fn contacts(
    tool: (usize, &Instrument),
    lines: &Lines,
    skin: (usize, &Patch),
    search: &Search,
    free: &UnconstrainedMotion,
) -> Vec<Contact> {
    features::contacts(tool, lines, skin, search, free, &Last::none()).0
}

/// Relative error of positions and gaps that are known exactly.
const EXACT: f64 = 1e-9;
/// Nodes along a side of the hand-made surfaces, a millimetre apart, the middle one at the origin.
const SIDE: u32 = 7;

fn node(i: i32, j: i32) -> u32 {
    let half = (SIDE / 2) as i32;
    ((j + half) * SIDE as i32 + i + half) as u32
}

fn position(id: u32) -> [f64; 2] {
    let half = f64::from(SIDE / 2);
    [f64::from(id % SIDE) - half, f64::from(id / SIDE) - half]
}

/// A surface of heights over x and y, mm.
fn surface(height: impl Fn(f64, f64) -> f64) -> Patch {
    let mut quads = vec![];
    for j in 0..SIDE - 1 {
        for i in 0..SIDE - 1 {
            let a = j * SIDE + i;
            quads.push(Face { nodes: [a, a + 1, a + SIDE + 1, a + SIDE], cell: 0, wall: false });
        }
    }
    let position = |id: u32| {
        let [x, y] = position(id);
        DVec3::new(x, y, height(x, y)) * MM
    };
    Patch::new(&quads, position).expect("it has faces")
}

/// A tool at the origin, vertices in mm.
fn tool(vertices: &[[f64; 3]], segments: &[[u32; 2]], radius: f64) -> (Instrument, Lines) {
    let positions = vertices.iter().map(|p| p.map(|c| c * MM)).collect();
    let lines = Lines { positions, segments: segments.to_vec(), radius: radius * MM };
    let tool = Instrument::new(
        &Tool {
            name: "wire".into(),
            mesh: ToolMesh { positions: vec![], triangles: vec![] },
            mass: 0.01,
            inertia: [1e-6; 3],
            blade: None,
            points: vec![],
            tip_radius: 0.0,
            round: None,
            cuboid: None,
            carve: None,
            free: None,
            device: None,
            lines: Some(lines.clone()),
            coupling: Coupling { stiffness: 1000.0, damping: 5.0, angular_stiffness: 1.0, angular_damping: 0.01 },
            trajectory: vec![Pose { time: 0.0, position: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] }],
        },
        [0.0; 3],
    );
    (tool, lines)
}

fn still(translation: DVec3) -> UnconstrainedMotion {
    UnconstrainedMotion { translation, rotation: DVec3::ZERO, compliance: 1e-3, angular_compliance: DMat3::ZERO }
}

fn search(filter: Filter) -> Search {
    Search { alarm: 0.2 * MM, distance: 0.0, friction: 0.3, filter, angle_cone: 0.02 }
}

/// Contacts of a tool that rests.
fn found(patch: &Patch, vertices: &[[f64; 3]], segments: &[[u32; 2]]) -> Vec<Contact> {
    let (tool, lines) = tool(vertices, segments, 0.0);
    contacts((0, &tool), &lines, (0, patch), &search(Filter::Own), &still(DVec3::ZERO))
}

/// Nodes of a contact that bear something, with their weights, in rising order.
fn bearing(contact: &Contact) -> Vec<(u32, f64)> {
    let mut list: Vec<(u32, f64)> = contact.points[1].0.clone();
    list.sort_by_key(|n| n.0);
    list
}

#[track_caller]
fn is(contact: &Contact, nodes: &[(u32, f64)], normal: DVec3, gap: f64) {
    let bears = bearing(contact);
    let same =
        bears.len() == nodes.len() && bears.iter().zip(nodes).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < EXACT);
    assert!(same, "{bears:?}, wanted {nodes:?}");
    assert!(contact.axes[0].distance(normal.normalize()) < EXACT, "{}", contact.axes[0]);
    assert!((contact.gap[0] - gap * MM).abs() < EXACT * MM, "gap {} m, wanted {gap} mm", contact.gap[0]);
}

#[track_caller]
fn only(list: &[Contact]) -> &Contact {
    assert_eq!(list.len(), 1, "{list:#?}");
    &list[0]
}

fn ridge(x: f64, _: f64) -> f64 {
    -0.5 * x.abs()
}

/// Flat but for the node at the origin.
fn lone(height: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| if x == 0.0 && y == 0.0 { height } else { 0.0 }
}

#[test]
fn a_point_meets_triangle_edge_and_vertex() {
    let list = found(&surface(|_, _| 0.0), &[[0.6, 0.2, 0.1]], &[]);
    is(only(&list), &[(node(0, 0), 0.4), (node(1, 0), 0.4), (node(1, 1), 0.2)], DVec3::Z, 0.1);
    let list = found(&surface(ridge), &[[0.02, 0.3, 0.1]], &[]);
    let away = DVec3::new(0.02, 0.0, 0.1);
    is(only(&list), &[(node(0, 0), 0.7), (node(0, 1), 0.3)], away, away.length());
    let list = found(&surface(lone(0.5)), &[[0.01, -0.02, 0.6]], &[]);
    let away = DVec3::new(0.01, -0.02, 0.1);
    is(only(&list), &[(node(0, 0), 1.0)], away, away.length());
    assert!(found(&surface(lone(0.5)), &[[0.0, 0.0, 0.71]], &[]).is_empty(), "beyond the alarm distance");
}

#[test]
fn a_segment_meets_edge_and_vertex() {
    // its ends are 0.9 mm above the flanks
    let list = found(&surface(ridge), &[[-1.8, 0.3, 0.1], [1.8, 0.3, 0.1]], &[[0, 1]]);
    is(only(&list), &[(node(0, 0), 0.7), (node(0, 1), 0.3)], DVec3::Z, 0.1);
    let list = found(&surface(lone(0.9)), &[[-1.8, -0.6, 1.0], [1.8, 0.6, 1.0]], &[[0, 1]]);
    is(only(&list), &[(node(0, 0), 1.0)], DVec3::Z, 0.1);
    // a thickness comes off the gap, and the tool is touched at its surface
    let (tool, lines) = tool(&[[-1.8, 0.3, 0.15], [1.8, 0.3, 0.15]], &[[0, 1]], 0.05);
    let list = contacts((0, &tool), &lines, (0, &surface(ridge)), &search(Filter::Cones), &still(DVec3::ZERO));
    is(only(&list), &[(node(0, 0), 0.7), (node(0, 1), 0.3)], DVec3::Z, 0.1);
    assert!(list[0].point.distance(DVec3::new(0.0, 0.3, 0.1) * MM) < EXACT * MM, "{}", list[0].point);
}

#[test]
fn a_segment_that_pierces_is_pushed_out() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(DVec3::from_array);
    let line = |z: [f64; 2], x: f64| [DVec3::new(x, 0.2, z[0]), DVec3::new(x, 0.2, z[1])];
    assert_eq!(closest::pierces(line([1.0, -3.0], 0.3), triangle), Some((0.25, true)));
    assert_eq!(closest::pierces(line([-1.0, 1.0], 0.3), triangle), Some((0.5, false)));
    assert_eq!(closest::pierces(line([1.0, 0.1], 0.3), triangle), None);
    assert_eq!(closest::pierces(line([1.0, -3.0], 0.9), triangle), None);
    // under the ridge both ends are outside: the edge above it holds it
    let list = found(&surface(ridge), &[[-1.8, 0.3, -0.1], [1.8, 0.3, -0.1]], &[[0, 1]]);
    is(only(&list), &[(node(0, 0), 0.7), (node(0, 1), 0.3)], DVec3::Z, -0.1);
    // so deep under it that no pair is within reach, the stretch inside is held at its middle
    let list = found(&surface(ridge), &[[-2.5, 0.3, -0.5], [2.5, 0.3, -0.5]], &[[0, 1]]);
    let depth = 0.5 * (1.0f64 / 1.25).sqrt(); // to a flank of slope 1/2
    assert!((only(&list).gap[0] + depth * MM).abs() < EXACT * MM, "{list:?}");
    assert!((list[0].axes[0].z - (1.0f64 / 1.25).sqrt()).abs() < EXACT && list[0].point.x.abs() < EXACT * MM);
    // through a peak's flank
    let pyramid = surface(lone(0.9));
    let chord = [[0.6, 0.1, -0.5], [0.6, 0.3, 1.3]];
    let list = found(&pyramid, &chord, &[[0, 1]]);
    assert!(list.iter().any(|c| c.gap[0] < 0.0), "its lower end is inside: {list:?}");
    let through = [[0.75, -0.5, 0.2], [0.45, 0.9, 0.2]];
    let list = found(&pyramid, &through, &[[0, 1]]);
    let ends_outside = through.iter().all(|p| pyramid.project(DVec3::from_array(*p) * MM).2 > 0.0);
    let deepest = list.iter().map(|c| c.gap[0]).fold(0.0, f64::min);
    assert!(ends_outside && deepest < -0.02 * MM, "ends outside {ends_outside}, deepest {deepest}");
    assert!(list.iter().all(|c| c.axes[0].z > 0.3), "it is pushed into the skin: {list:?}");
    // counter-test: without its segment the same tool is nowhere inside
    assert!(found(&pyramid, &through, &[]).iter().all(|c| c.gap[0] > 0.0));
}

#[test]
fn a_cone_admits_what_its_formula_says() {
    // an edge between two triangles that fall off at slope 1/2 on both sides
    let unit = |x: f64, z: f64| DVec3::new(x, 0.0, z).normalize();
    let convex = Cone { normal: DVec3::Z, outward: vec![unit(1.0, 0.5), unit(-1.0, 0.5)] };
    let concave = Cone { normal: DVec3::Z, outward: vec![unit(1.0, -0.5), unit(-1.0, -0.5)] };
    let flat = Cone { normal: DVec3::Z, outward: vec![DVec3::X, -DVec3::X] };
    // the exact cone of the convex edge ends at 26.57°; with half of n·l = 0.447 it ends where l·d = −0.2236, 12.92° further
    let tilted = |degrees: f64| DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
    assert!(convex.admits(tilted(39.4), 0.0) && !convex.admits(tilted(39.6), 0.0));
    assert!(convex.admits(tilted(-39.4), 0.0) && !convex.admits(tilted(-39.6), 0.0));
    assert!(convex.admits(tilted(40.5), 0.02) && !convex.admits(tilted(41.0), 0.02)); // l·d = −0.2436: 40.67°
    assert!(!convex.admits(-DVec3::Z, 0.5), "from behind");
    assert!(flat.admits(DVec3::Z, 0.0) && !flat.admits(tilted(1.0), 0.0));
    assert!(flat.admits(tilted(1.1), 0.02) && !flat.admits(tilted(1.2), 0.02)); // sine 0.02: 1.146°
    assert!(!concave.admits(DVec3::Z, 0.02) && concave.admits(DVec3::Z, 0.45), "l·d = −0.447");
    let face = Cone { normal: DVec3::Z, outward: vec![] };
    assert!(face.admits(tilted(89.0), 0.0) && !face.admits(tilted(91.0), 0.5));
}

#[test]
fn a_vertex_in_a_dimple_of_rounding_is_lost_without_widened_cones_and_held_with_them() {
    let dimple = surface(lone(-3e-7));
    let (tool, lines) = tool(&[[0.0, 0.0, 0.1]], &[], 0.0);
    let count = |angle_cone: f64| {
        let search = Search { angle_cone, ..search(Filter::Cones) };
        contacts((0, &tool), &lines, (0, &dimple), &search, &still(DVec3::ZERO)).len()
    };
    assert_eq!(count(0.0), 0, "no feature has the pair");
    assert_eq!(count(0.02), 1, "the default holds it");
}

#[test]
fn a_tool_vertex_meets_what_is_before_it_and_not_what_its_segments_are_nearer_to() {
    let flat = surface(|_, _| 0.0);
    // a wire that rises from its first end by 45°: that end alone
    let rising = [[0.3, 0.1, 0.05], [0.4, 0.1, 0.15], [0.5, 0.1, 0.25]];
    let list = found(&flat, &rising, &[[0, 1], [1, 2]]);
    assert_eq!((only(&list).feature, only(&list).gap[0]), (0, 0.05 * MM));
    // counter-test: as loose points the second one is near enough too
    assert_eq!(found(&flat, &rising, &[]).len(), 2);
}

#[test]
fn a_point_inside_is_pushed_out_along_the_nearest_surface() {
    let list = found(&surface(ridge), &[[0.4, 0.3, -0.3]], &[]);
    let contact = only(&list);
    let depth = 0.1 * (1.0f64 / 1.25).sqrt(); // under a flank of slope 1/2
    assert!((contact.gap[0] + depth * MM).abs() < 1e-6 * MM, "{} m", contact.gap[0]);
    assert!(contact.axes[0].distance(DVec3::new(0.5, 0.0, 1.0).normalize()) < 1e-6);
    // counter-test: the direction from skin to tool, which LocalMinDistance looks along, is refused by the face
    let face = Cone { normal: DVec3::new(0.5, 0.0, 1.0).normalize(), outward: vec![] };
    assert!(!face.admits(-contact.axes[0], 0.02));
}

#[test]
fn contact_does_not_depend_on_which_side_of_the_surface_rounding_puts_a_tool_at_rest() {
    for (vertices, segments) in [
        (vec![[0.0, 0.0, 0.0]], vec![]),
        (vec![[0.3, 0.0, 0.0]], vec![]),
        (vec![[0.6, 0.2, 0.0]], vec![]),
        (vec![[0.2, 0.5, 0.0], [0.9, 0.55, 0.0]], vec![[0, 1]]),
    ] {
        let mut counts = vec![];
        for height in [-1e-7, -1e-10, 0.0, 1e-10, 1e-7, 1e-5] {
            let lifted: Vec<[f64; 3]> = vertices.iter().map(|[x, y, z]| [*x, *y, z + height]).collect();
            let list = found(&surface(|_, _| 0.0), &lifted, &segments);
            assert!(list.iter().all(|c| c.axes[0].z > 1.0 - 1e-6), "{vertices:?} at {height} mm: {list:?}");
            counts.push(list.len());
        }
        assert!(counts[0] >= 1 && counts.iter().all(|n| *n == counts[0]), "{vertices:?}: {counts:?}");
    }
}

#[test]
fn a_fast_point_is_stopped_where_it_comes_to_the_skin() {
    // 3 mm along x and 2 mm down in the step: it would end under the flat, and meets it at x = 0.3
    let (tool, lines) = tool(&[[-1.2, 0.1, 1.0]], &[], 0.0);
    let step = |motion: DVec3| {
        contacts((0, &tool), &lines, (0, &surface(|_, _| 0.0)), &search(Filter::Cones), &still(motion * MM))
    };
    let list = step(DVec3::new(3.0, 0.0, -2.0));
    let hit = list.iter().find(|c| bearing(c).len() == 3).expect("it meets a face");
    let x: f64 = bearing(hit).iter().map(|(n, w)| position(*n)[0] * w).sum();
    // it is taken at up to two hundredths of the alarm distance above the skin
    assert!((x - 0.3).abs() < 0.02 * 0.2 * 1.5 + 1e-6, "{x} mm");
    assert!((hit.gap[0] - MM).abs() < 1e-6 * MM && hit.axes[0].z > 1.0 - 1e-9);
    // counter-tests: it is not stopped by what it passes over, and a search at the step's start alone finds nothing
    assert!(step(DVec3::new(3.0, 0.0, 0.0)).is_empty());
    assert!(step(DVec3::ZERO).is_empty());
}

#[test]
fn a_probe_along_a_curved_skin_keeps_few_contacts() {
    let curved = surface(|x, y| -0.02 * (x * x + 0.5 * y * y));
    let vertices: Vec<[f64; 3]> = (0..11).map(|k| [-2.5 + 0.5 * f64::from(k), 0.21, 0.01]).collect();
    let segments: Vec<[u32; 2]> = (0..10).map(|k| [k, k + 1]).collect();
    let (tool, lines) = tool(&vertices, &segments, 0.0);
    let count = |filter| contacts((0, &tool), &lines, (0, &curved), &search(filter), &still(DVec3::ZERO)).len();
    let (cones, points) = (count(Filter::Cones), count(Filter::Points));
    println!("{cones} contacts with cones, {points} without");
    assert!((1..=12).contains(&cones), "{cones}");
    assert!(points > 3 * cones, "counter-test: {points} without cones, {cones} with");
}

/// Everything that contacts say, bit for bit.
fn said(list: &[Contact]) -> Vec<String> {
    list.iter().map(|c| format!("{:?} {:?} {:?} {:?}", c.id(), c.points[1], c.axes, c.gap[0])).collect()
}

/// Waves of heights up to 0.3 mm, and a wire near them.
fn waves() -> impl Strategy<Value = (Vec<f64>, Vec<[f64; 3]>, [f64; 3])> {
    let heights = prop::collection::vec(-0.3..0.3f64, (SIDE * SIDE) as usize);
    let wire = prop::collection::vec([-2.0..2.0f64, -2.0..2.0f64, -0.3..0.6f64], 4);
    (heights, wire, [-0.5..0.5f64, -0.5..0.5f64, -0.8..0.2f64])
}

fn wavy(heights: &[f64]) -> Patch {
    surface(|x, y| heights[node(x as i32, y as i32) as usize])
}

const WIRE: [[u32; 2]; 3] = [[0, 1], [1, 2], [2, 3]];

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn the_tree_of_boxes_finds_what_all_triangles_find((heights, wire, motion) in waves()) {
        let patch = wavy(&heights);
        let (tool, lines) = tool(&wire, &WIRE, 0.02);
        let free = UnconstrainedMotion { rotation: DVec3::new(0.02, -0.01, 0.03), ..still(DVec3::from_array(motion) * MM) };
        let everything: Vec<u32> = (0..2 * (SIDE - 1) * (SIDE - 1)).collect();
        for filter in [Filter::Cones, Filter::Points] {
            let search = search(filter);
            let quick = contacts((0, &tool), &lines, (0, &patch), &search, &free);
            let all = |_, _| everything.clone();
            let brute = contacts_among((0, &tool), &lines, (0, &patch), &search, &free, &Last::none(), &all).0;
            prop_assert_eq!(said(&quick), said(&brute));
        }
    }

    #[test]
    fn the_nearest_place_of_the_skin_is_always_a_contact((heights, wire, _) in waves()) {
        let patch = wavy(&heights);
        for [x, y, z] in wire {
            let p = DVec3::new(x, y, z) * MM;
            let (_, _, distance, normal) = patch.project(p);
            let list = found(&patch, &[[x, y, z]], &[]);
            let held = |c: &Contact| (c.gap[0] - distance).abs() < 1e-3 * MM && c.axes[0].dot(normal) > 0.99;
            let reached = distance < 0.19 * MM && distance.abs() > 1e-3 * MM;
            prop_assert!(!reached || list.iter().any(held), "{distance} m along {normal}: {list:?}");
            // counter-test: a point that is off by 0.05 mm is no contact
            let wrong = |c: &Contact| (c.gap[0] - distance + 0.05 * MM).abs() < 1e-3 * MM;
            prop_assert!(!(list.len() == 1 && list.iter().any(wrong)));
        }
    }
}

#[test]
fn a_search_that_misses_a_triangle_would_be_noticed() {
    let (tool, lines) = tool(&[[0.6, 0.2, 0.1]], &[], 0.0);
    let (flat, still, search) = (surface(|_, _| 0.0), still(DVec3::ZERO), search(Filter::Cones));
    let all: Vec<u32> = (0..2 * (SIDE - 1) * (SIDE - 1)).collect();
    let whole = contacts_among((0, &tool), &lines, (0, &flat), &search, &still, &Last::none(), &|_, _| all.clone()).0;
    let below = |t: &u32| flat.project(DVec3::new(0.6, 0.2, 0.1) * MM).0 as u32 != *t;
    let rest: Vec<u32> = all.iter().copied().filter(below).collect();
    assert_eq!((whole.len(), rest.len()), (1, all.len() - 1));
    let left = contacts_among((0, &tool), &lines, (0, &flat), &search, &still, &Last::none(), &|_, _| rest.clone()).0;
    assert!(left.is_empty());
}

#[test]
fn faces_that_rise_round_a_point_hold_it_without_friction() {
    // on a flank of a valley with slopes of 1/2, 0.1 mm beside its bottom, and moving in the step
    let (tool, lines) = tool(&[[0.1, 0.3, 0.05]], &[], 0.0);
    let valley = surface(|x, y| -ridge(x, y));
    let held = |motion: f64| {
        let free = still(DVec3::new(0.0, 0.0, -motion * MM));
        contacts((0, &tool), &lines, (0, &valley), &search(Filter::Cones), &free)
    };
    assert_eq!(held(0.1).len(), 1, "the other flank is further away than that");
    let list = held(0.25); // 0.112 mm along the flank, which is 0.089 mm from the other one
    let across = DVec3::new(0.5, 0.0, 1.0).normalize();
    let (own, other): (Vec<Contact>, Vec<Contact>) = list.into_iter().partition(|c| c.axes[0].x < 0.0);
    assert!(own.len() == 1 && own[0].gap[0].abs() < EXACT * MM, "{own:?}");
    assert!(!other.is_empty(), "the other flank");
    for wall in other {
        assert!(wall.axes[0].distance(across) < EXACT, "{wall:?}");
        assert!((wall.gap[0] - 0.1 * MM * across.z).abs() < EXACT * MM, "{wall:?}"); // 2 × 0.1 mm × slope, across
        assert!(matches!(wall.law, Law::Coulomb { friction: 0.0, .. }), "{wall:?}");
    }
    // counter-test: on a ridge the other flank falls off, and must not hold the point
    let list = found(&surface(ridge), &[[0.1, 0.3, -0.05]], &[]);
    assert_eq!(only(&list).axes[0].x.signum(), 1.0);
}

fn scene(name: &str) -> Scene {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    read(&root.join(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene's sphere replaced by the end of a vertical wire.
fn with_wire(mut scene: Scene) -> Scene {
    let tool = &mut scene.tools[0];
    let radius = tool.round.take().map_or(0.0, |round| round.radius);
    let positions = vec![[0.0, 0.0, -radius], [0.0, 0.0, 2e-3], [0.0, 0.0, 5e-3]];
    tool.lines = Some(Lines { positions, segments: vec![[0, 1], [1, 2]], radius: 0.0 });
    scene
}

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

fn force(report: &StepReport) -> f64 {
    report.contact.on_tool.first().map_or(0.0, |f| DVec3::from_array(*f).length())
}

/// How far the tool's first point is under the surface of the skin, m; negative outside.
fn depth(simulation: &mut Simulation) -> f64 {
    let tip = simulation.tools[0].at(simulation.tools[0].samples[0].position);
    deepest(simulation, &[tip])
}

/// How far the deepest point of the tool's segments is under the surface, m: 50 points along each.
fn depth_along(simulation: &mut Simulation) -> f64 {
    let tool = &simulation.tools[0];
    let lines = tool.lines.as_ref().expect("it has lines");
    let at = |id: u32| tool.at(DVec3::from_array(lines.positions[id as usize]));
    let along = |[a, b]: [u32; 2]| (0..=50).map(move |k| at(a).lerp(at(b), f64::from(k) / 50.0));
    let points: Vec<DVec3> = lines.segments.iter().copied().flat_map(along).collect();
    deepest(simulation, &points)
}

fn deepest(simulation: &mut Simulation, points: &[DVec3]) -> f64 {
    let u = simulation.bodies[0].snapshot().expect("the CPU path has no device to fail").u;
    let rest = &simulation.bodies[0].model.rest;
    let position = |id: u32| {
        let (x, u) = (rest[id as usize], u[id as usize]);
        DVec3::new(x[0] + u[0], x[1] + u[1], x[2] + u[2])
    };
    let patch = Patch::new(&simulation.bodies[0].wound.surface.all(), position).expect("the skin has faces");
    points.iter().map(|p| -patch.project(*p).2).fold(f64::NEG_INFINITY, f64::max)
}

/// How far a wire may be under the surface after a step, m: what the surface turns under it within the step. Measured 0.1 µm
/// at rest; 120 µm when the faces that rise round a point are left out.
const DEEPEST: f64 = 2e-3 * MM;

#[test]
fn the_end_of_a_wire_never_slips_through_wherever_it_is_pressed() {
    let press = with_wire(scene("hard/press_vertex_edge_face.toml"));
    // vertex, edges along x and y, the diagonal, face, and anywhere
    let mut points = vec![[0.0, 0.0], [5e-4, 0.0], [0.0, 5e-4], [2.5e-4, 2.5e-4], [7.5e-4, 2.5e-4], [5e-4, 5e-4]];
    let mut generator = Random::new(30);
    let mut random = || (generator.unit() - 0.5) * 2e-3;
    points.extend((0..8).map(|_| [random(), random()]));
    let mut worst = f64::NEG_INFINITY;
    for [x, y] in points {
        let mut moved = press.clone();
        for pose in &mut moved.tools[0].trajectory {
            pose.position[0] += x;
            pose.position[1] += y;
        }
        let (mut simulation, reports) = run(&moved, None);
        let last = reports.last().map_or(0.0, force);
        let deep = depth(&mut simulation);
        println!("at {:.3}, {:.3} mm: {:.3} µm under, {last:.4} N", x / MM, y / MM, deep * 1e6);
        worst = worst.max(deep);
        assert!(last > 0.01, "at {x}, {y}: {last} N");
    }
    assert!(worst < DEEPEST, "{worst} m under the surface");
    let mut free = press;
    free.contact = None;
    assert!(depth(&mut run(&free, None).0) > 0.5e-3, "without contact it goes through");
}

#[test]
fn a_tip_of_lines_at_1_m_s_does_not_pass_through_2_mm_of_skin() {
    let thrust = scene("hard/tip_fast_lines.toml");
    let (mut simulation, reports) = run(&thrust, None);
    assert!(reports.iter().map(force).fold(0.0, f64::max) > 0.05, "it has hit");
    let deep = depth(&mut simulation);
    assert!(deep < DEEPEST, "{deep} m under the surface");
    assert!(reports.last().map_or(0.0, force) > 0.005, "it rests on the skin");
    let (mut hit, _) = run(&thrust, Some(3));
    let deep = depth(&mut hit);
    assert!(deep < 0.1 * MM, "right after the hit: {deep} m");
    let mut free = thrust;
    free.contact = None;
    let simulation = run(&free, Some(3)).0;
    let lowest = simulation.tools[0].at(simulation.tools[0].samples[0].position).z;
    assert!(lowest < 0.0, "without contact the step ends below the skin: {lowest}");
}

#[test]
fn a_press_is_held_the_same_without_cones() {
    let mut press = with_wire(scene("hard/press_vertex_edge_face.toml"));
    let cones = run(&press, None).1.last().map_or(0.0, force);
    press.contact.as_mut().expect("it has a tool").filter = Filter::Points;
    let (mut simulation, reports) = run(&press, None);
    let points = reports.last().map_or(0.0, force);
    assert!(depth(&mut simulation) < DEEPEST);
    assert!((points / cones - 1.0).abs() < 0.02, "{points} N, with cones {cones} N");
}

#[test]
fn a_wire_that_starts_inside_is_pushed_out() {
    let mut inside = with_wire(scene("hard/tool_starts_inside.toml"));
    let (mut simulation, reports) = run(&inside, None);
    let deep = depth(&mut simulation);
    assert!(deep < DEEPEST, "{deep} m under the surface");
    assert!(reports.last().map_or(0.0, force) > 0.005);
    inside.contact = None;
    assert!(depth(&mut run(&inside, None).0) > 0.1 * MM, "without contact it stays");
}

#[test]
fn a_wire_lies_on_the_skin_along_its_whole_length() {
    let mut lying = with_wire(scene("hard/withdraw_sudden.toml"));
    let positions = [[-2.2, 0.13], [-0.9, 0.2], [0.7, 0.26], [2.1, 0.2]].map(|[x, y]| [x * MM, y * MM, 0.0]);
    let lines = Lines { positions: positions.to_vec(), segments: vec![[0, 1], [1, 2], [2, 3]], radius: 0.0 };
    lying.tools[0].lines = Some(lines);
    let pose = |time: f64, z: f64| Pose { time, position: [0.0, 0.0, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    lying.tools[0].trajectory = vec![pose(0.0, 2.31 * MM), pose(0.05, 2.0 * MM)];
    let (mut simulation, reports) = run(&lying, Some(30));
    let under = depth_along(&mut simulation);
    println!("{} contacts, {} N, {} µm under", reports[29].contact.count(), force(&reports[29]), under * 1e6);
    assert!(under < DEEPEST, "{under} m under the surface");
    let mut loose = lying;
    loose.tools[0].lines.as_mut().expect("set above").segments.clear();
    let (mut simulation, _) = run(&loose, Some(30));
    simulation.tools[0].lines = Instrument::new(&loose_with(&loose, &[[0, 1], [1, 2], [2, 3]]), [0.0; 3]).lines;
    let through = depth_along(&mut simulation);
    assert!(through > 10.0 * DEEPEST, "counter-test: its points alone let the skin through, {through} m");
}

fn loose_with(scene: &Scene, segments: &[[u32; 2]]) -> Tool {
    let mut tool = scene.tools[0].clone();
    tool.lines.as_mut().expect("it has lines").segments = segments.to_vec();
    tool
}

#[test]
fn a_probe_lies_on_the_skin_with_its_side_and_stays_within_its_contacts() {
    let probe = scene("dental_probe.toml").in_test_form();
    let most = probe.contact.expect("it has a tool").max_contacts as usize;
    let (mut held, _) = run(&probe, Some(60));
    let under = depth_along(&mut held);
    println!("along the hook {} µm under", under * 1e6);
    assert!(under < DEEPEST, "{under} m");
    let (_, reports) = run(&probe, None);
    let counts: Vec<usize> = reports.iter().map(|r| r.contact.count()).collect();
    println!("{counts:?}");
    assert!(counts.iter().all(|n| *n <= most));
    assert!(counts[40..65].iter().all(|n| *n >= 2), "tip and side: {counts:?}");
    let held: Vec<f64> = reports[55..65].iter().map(force).collect();
    let (least, most) = held.iter().fold((f64::MAX, 0.0f64), |(l, m), f| (l.min(*f), m.max(*f)));
    assert!(least > 0.05 && most < 1.02 * least, "a hand that rests is pushed evenly: {held:?}");
    assert!(reports.last().map_or(1.0, force) == 0.0, "withdrawn");
}
