//! The broad phase against brute force: no face that is near may be missed, whatever the skin does.

use cutis::bodies::rigid::Instrument;
use cutis::collide::broad::Boxes;
use cutis::collide::sides::Last;
use cutis::collide::{Contact, Patch, Resistance, Search, contacts, tool_box};
use cutis::kernels::bounds;
use cutis::math::V4;
use cutis::math::random::Random;
use cutis::mesh::Face;
use cutis::mesh::{Grid, Surface};
use cutis::scene::{Coupling, Filter, Pose, Scene, Tool, ToolMesh, read};
use cutis::step::{Platform, Simulation, StepReport};
use glam::DVec3;
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;
use proptest::prelude::*;
use std::path::Path;

/// Numbers in −1 to 1 from a seed.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    move || random.signed()
}

/// 0.8 mm wide cells, two levels of 1 mm.
fn grid(x: usize, y: usize) -> Grid {
    Grid {
        cells: [x, y, 2],
        nodes: [x + 1, y + 1, 3],
        edge: [8e-4; 2],
        heights: vec![0.0, 1e-3, 2e-3],
        layer_of: vec![0, 0],
        unstructured: None,
        embedded: None,
    }
}

/// A skin that has moved, some of whose cells are gone.
struct Skin {
    grid: Grid,
    surface: Surface,
    u: Vec<V4<f64>>,
    boxes: Boxes,
}

impl Skin {
    fn new(grid: Grid, u: Vec<V4<f64>>) -> Self {
        let surface = Surface::new(&grid);
        let mut skin = Self { boxes: Boxes::new(&surface), surface, grid, u };
        skin.refit();
        skin
    }

    /// Waves up to `size`, noise of a tenth of it, and one cell in ten gone.
    fn random(cells: [usize; 2], size: f64, seed: u64) -> Self {
        let grid = grid(cells[0], cells[1]);
        let mut next = random(seed);
        let phases: Vec<f64> = (0..9).map(|_| 3.0 * next()).collect();
        let wave = |p: [f64; 3], n: usize| {
            (0..3).map(|m| (500.0 * p[m] * phases[n] + phases[3 + m] + n as f64).sin()).product::<f64>()
        };
        let count = grid.node_count();
        let rest: Vec<[f64; 3]> = (0..count).map(|n| grid.rest(n)).collect();
        let u =
            rest.iter().map(|p| [0, 1, 2].map(|n| size * (wave(*p, n) + 0.1 * next()))).map(|[x, y, z]| [x, y, z, 0.0]);
        let mut skin = Self::new(grid.clone(), u.collect());
        skin.surface.alive.iter_mut().for_each(|alive| *alive = next() > -0.8);
        skin
    }

    fn bounds(&self) -> Vec<[V4<f64>; 2]> {
        let params = self.grid.params();
        (0..self.boxes.count()).map(|tile| bounds::bounds_of_tile(&params, &self.u, tile)).collect()
    }

    fn refit(&mut self) -> usize {
        let bounds = self.bounds();
        self.boxes.refit(&self.surface, &bounds)
    }

    fn at(&self, id: u32) -> DVec3 {
        let (x, u) = (self.grid.rest(id as usize), self.u[id as usize]);
        DVec3::new(x[0] + u[0], x[1] + u[1], x[2] + u[2])
    }

    fn faces(&self, area: &Aabb) -> Vec<Face> {
        self.boxes.faces(&self.surface, area)
    }

    /// Every face whose own box meets the area.
    fn brute_force(&self, area: &Aabb) -> Vec<Face> {
        let meets = |q: &Face| Aabb::from_points(q.nodes.map(|n| self.at(n).as_vec3())).intersects(area);
        self.surface.all().into_iter().filter(meets).collect()
    }
}

fn area(centre: DVec3, half: f64) -> Aabb {
    Aabb::from_half_extents(centre.as_vec3(), Vector::splat(half as f32))
}

/// Faces of cells whose rest box, widened by `reach` and by the area's, meets the area: how far skin has moved is guessed.
fn within_reach(skin: &Skin, area: &Aabb, reach: f64) -> Vec<Face> {
    let wide = area.loosened(reach as f32);
    let rest = |q: &Face| q.nodes.map(|n| DVec3::from_array(skin.grid.rest(n as usize)).as_vec3());
    skin.surface.all().into_iter().filter(|q| Aabb::from_points(rest(q)).intersects(&wide)).collect()
}

/// Nothing is cut.
const BEARS: Resistance = Resistance { edge: 0.0, splitting: 0.0, cell: 0.0 };

/// A tool of blunt points in its own frame, at a position.
fn tool(at: DVec3, points: Vec<[f64; 3]>) -> Instrument {
    let tool = Tool {
        name: "tip".into(),
        mesh: ToolMesh { positions: vec![], triangles: vec![] },
        mass: 0.02,
        inertia: [1e-6; 3],
        blade: None,
        points,
        tip_radius: 0.0,
        round: None,
        lines: None,
        cuboid: None,
        carve: None,
        free: None,
        device: None,
        coupling: Coupling { stiffness: 1000.0, damping: 5.0, angular_stiffness: 1.0, angular_damping: 0.01 },
        trajectory: vec![Pose { time: 0.0, position: at.to_array(), rotation: [0.0, 0.0, 0.0, 1.0] }],
    };
    Instrument::new(&tool, [0.0; 3])
}

const SEARCH: Search = Search { alarm: 5e-4, distance: 1e-4, friction: 0.3, filter: Filter::Points, angle_cone: 0.0 };
const TRAVEL: f64 = 1e-4;
const MARGIN: f64 = SEARCH.alarm + SEARCH.distance + TRAVEL;

fn contacts_with(skin: &Skin, tool: &Instrument, faces: &[Face]) -> Vec<Contact> {
    let patch = Patch::new(faces, |id| skin.at(id));
    let of = |patch| contacts((0, tool), (0, &patch), &SEARCH, TRAVEL, |_| BEARS, |_| None, &Last::none()).0;
    patch.map_or(vec![], of)
}

/// Lengths in f32 are known to this within the few centimetres that a body and its displacements span, m: 2⁻²⁴ × 0.1 m, a few times.
const SINGLE: f64 = 4e-8;

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn the_tree_finds_the_tiles_that_a_list_finds(
        x in 1usize..40, y in 1usize..40, size in 0.0..2e-2, half in 1e-5..2e-2, seed: u64
    ) {
        let mut skin = Skin::random([x, y], size, seed);
        let mut next = random(!seed);
        // refitted, not rebuilt: the skin moves again, and the tree follows
        skin.u.iter_mut().flatten().for_each(|c| *c *= next());
        prop_assert_eq!(skin.refit(), 0);
        for _ in 0..20 {
            let area = area(DVec3::new(next(), next(), next()) * 2e-2, half);
            let list: Vec<usize> = (0..skin.boxes.count()).filter(|t| skin.boxes.around(*t).intersects(&area)).collect();
            prop_assert_eq!(skin.boxes.tiles(&area), list);
        }
    }

    #[test]
    fn no_face_that_is_near_is_missed(x in 1usize..30, y in 1usize..30, size in 0.0..1e-2, half in 1e-5..5e-3, seed: u64) {
        let skin = Skin::random([x, y], size, seed);
        let mut next = random(!seed);
        for _ in 0..20 {
            let near = skin.at((skin.u.len() as f64 * 0.5 * (1.0 + next())) as u32) + DVec3::new(next(), next(), next()) * half;
            let area = area(near, half);
            let found = skin.faces(&area);
            for face in skin.brute_force(&area) {
                prop_assert!(found.contains(&face), "{:?} was missed", face);
            }
        }
    }

    #[test]
    fn contacts_with_the_candidates_are_those_with_the_whole_surface(x in 3usize..30, y in 3usize..30, size in 0.0..4e-4, seed: u64) {
        // folds of the surface are left out: where it crosses itself, inside and outside mean nothing
        let mut skin = Skin::random([x, y], size, seed);
        skin.surface.alive.fill(true);
        let all = skin.surface.all();
        let top = skin.u.len() - (x + 1) * (y + 1);
        let mut next = random(!seed);
        for _ in 0..10 {
            let node = top + ((x + 1) as f64 * (y + 1) as f64 * 0.5 * (1.0 + next())) as usize;
            let at = skin.at(node as u32) + DVec3::new(next(), next(), next()) * 8e-4;
            let tool = tool(at, vec![[0.0; 3], [3e-4, 0.0, 2e-4], [0.0, 3e-4, 1e-4]]);
            let mut sunk = 0.0;
            let (mut found, mut depth);
            loop {
                let faces = skin.faces(&tool_box(&tool, MARGIN + sunk));
                found = contacts_with(&skin, &tool, &faces);
                depth = Patch::new(&faces, |id| skin.at(id)).map_or(0.0, |patch| patch.deepest(&tool));
                if depth <= MARGIN + sunk {
                    break;
                }
                sunk = depth;
            }
            let wanted = contacts_with(&skin, &tool, &all);
            prop_assert_eq!(found.len(), wanted.len());
            for (a, b) in found.iter().zip(&wanted) {
                prop_assert_eq!(a.id(), b.id());
                prop_assert!((a.gap[0] - b.gap[0]).abs() < SINGLE, "{} m and {} m", a.gap[0], b.gap[0]);
            }
        }
    }
}

/// A dome that has come 10 mm up and aside, far from where a tool was last: 40 × 40 cells, moved around one corner.
fn dome() -> Skin {
    let grid = grid(40, 40);
    let of = |n: usize| {
        let p = grid.rest(n);
        let far = ((p[0] - 0.012).hypot(p[1] - 0.012) / 4e-3).powi(2);
        let share = (-far).exp();
        [-6e-3 * share, 0.0, 1e-2 * share, 0.0]
    };
    let u = (0..grid.node_count()).map(of).collect();
    Skin::new(grid, u)
}

#[test]
fn skin_that_has_come_10_mm_is_found_where_it_is() {
    let skin = dome();
    let top = (0..skin.u.len() as u32).map(|n| skin.at(n)).max_by(|a, b| a.z.total_cmp(&b.z)).expect("there are nodes");
    assert!(top.z > 0.0115, "{top}");
    let tool = tool(top + DVec3::Z * 2e-4, vec![[0.0; 3]]);
    let area = tool_box(&tool, MARGIN);
    let found = contacts_with(&skin, &tool, &skin.faces(&area));
    let wanted = contacts_with(&skin, &tool, &skin.surface.all());
    assert_eq!((found.len(), wanted.len()), (1, 1));
    assert!((found[0].gap[0] - wanted[0].gap[0]).abs() < SINGLE && found[0].gap[0].abs() < 2e-4, "{}", found[0].gap[0]);
    // the counter-test: a reach as of skin that has moved by its thickness finds no face there
    let guessed = within_reach(&skin, &area, skin.grid.heights[2]);
    assert!(contacts_with(&skin, &tool, &guessed).is_empty(), "{} faces", guessed.len());
    // and boxes that were not refitted find none
    let stale = Boxes::new(&skin.surface).faces(&skin.surface, &area);
    assert!(stale.is_empty(), "{} faces", stale.len());
}

#[test]
fn far_motion_costs_no_candidates_elsewhere() {
    let skin = dome();
    let half = area(DVec3::new(-0.012, -0.012, 2e-3), 1e-3);
    let (found, needed) = (skin.faces(&half).len(), skin.brute_force(&half).len());
    // columns have a bottom too, and a cell more on each side
    assert!(
        needed > 0 && found <= 2 * (needed as f64).sqrt().mul_add(1.0, 4.0).powi(2) as usize,
        "{found} for {needed}"
    );
    let all_within = within_reach(&skin, &half, 1.2e-2).len();
    assert!(all_within > 5 * found, "{all_within} within the largest displacement, {found} found");
}

#[test]
fn nodes_that_are_nowhere_are_counted_and_the_others_found() {
    let mut skin = dome();
    skin.u[5][1] = f64::NAN;
    skin.u[8] = [0.0, 0.0, f64::INFINITY, 0.0]; // on the seam of two tiles: counted in each
    assert_eq!(skin.refit(), 3);
    let area = area(DVec3::new(-0.012, -0.012, 2e-3), 1e-3);
    assert!(!skin.faces(&area).is_empty());
    // a tile that is nowhere altogether keeps its rest box
    skin.u.iter_mut().for_each(|u| *u = [f64::NAN; 4]);
    assert!(skin.refit() > skin.u.len());
    assert_eq!(skin.faces(&area), Skin::new(grid(40, 40), vec![[0.0; 4]; skin.u.len()]).faces(&area));
}

fn ball() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/sphere_press.toml");
    read(&file).unwrap_or_else(|e| panic!("{e}"))
}

/// First step of a scene whose tool is a blunt point that starts somewhere, m from the middle of the skin's top.
fn started_at(from_top: [f64; 3], cells: u32) -> StepReport {
    let mut scene = ball();
    (scene.skins[0].cells, scene.time.step) = ([cells; 2], 1e-3);
    let top: f64 = scene.skins[0].layers.iter().map(|l| l.thickness).sum();
    let position = [from_top[0], from_top[1], top + from_top[2]];
    scene.tools[0].round = None;
    scene.tools[0].points = vec![[0.0; 3]];
    scene.tools[0].trajectory = vec![Pose { time: 0.0, position, rotation: [0.0, 0.0, 0.0, 1.0] }];
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    simulation.step(false).expect("the CPU path has no device to fail")
}

#[test]
fn a_point_that_starts_inside_is_held_by_the_surface_above_it_and_the_depth_is_told() {
    let law = ball().contact.expect("the scene has contact");
    for deep in [0.5 * law.alarm, 2.0 * law.alarm] {
        let report = started_at([0.0, 0.0, -deep], 10);
        assert_eq!(report.contact.count(), 1, "{deep} m");
        assert!((report.contact.depth - deep - law.distance).abs() < SINGLE, "{} m", report.contact.depth);
        assert!(report.contact.on_tool[0][2] > 0.0 && report.contact.candidates > 0);
    }
    // the counter-test: above the surface there is no depth
    let above = started_at([0.0, 0.0, 0.5 * law.alarm], 10);
    assert_eq!((above.contact.count(), above.contact.depth), (1, 0.0));
}

#[test]
fn a_point_deep_inside_finds_a_wall_that_is_nearer_than_the_surface_above_but_not_near() {
    let law = ball().contact.expect("the scene has contact");
    // the wall's cells, half a millimetre wide, begin beyond what a point outside would look at
    let (deep, aside) = (1.10e-3, 1.05e-3);
    assert!(aside - 5e-4 > law.alarm + law.distance && aside < deep);
    let report = started_at([0.01 - aside, 0.0, -deep], 40);
    assert_eq!(report.contact.count(), 1);
    assert!((report.contact.depth - aside - law.distance).abs() < SINGLE, "{} m", report.contact.depth);
    // the counter-test: with the wall further than the top it is the top
    let report = started_at([0.01 - 1.2e-3, 0.0, -deep], 40);
    assert!((report.contact.depth - deep - law.distance).abs() < SINGLE, "{} m", report.contact.depth);
}
