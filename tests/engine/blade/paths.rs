//! Random paths of blades through small skins, and what a run of one is judged by.

use cutis::bodies::Model;
use cutis::bodies::grid::{cell_centres, links};
use cutis::bodies::rigid::Instrument;
use cutis::error::Result;
use cutis::kernels::cut::cut;
use cutis::math::random;
use cutis::report::Report;
use cutis::report::run::{Options, run};
use cutis::scene::{Cut, Files, Pose, Probe, ProbeKind, Scene, parse};
use cutis::step::Platform;
use glam::{DQuat, DVec3};
use std::fmt::{Display, Formatter};
use std::path::Path;

/// Numbers that look random and are the same for the same seed.
pub struct Random(random::Random);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        Self(random::Random::split_mix(seed))
    }
    /// Between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }
    /// One of some.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.between(0.0, of.len() as f64) as usize).min(of.len() - 1)]
    }
}

/// A kind of path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Straight down, a straight cut of some length, straight up; the skin's sides and bottom are held.
    Straight,
    /// The same right across the skin and through all of it, whose bottom is free.
    Through,
    /// Anywhere at any speed: sideways, backwards, from inside, through the border.
    Any,
    /// Two blades, each on a straight cut; the cuts cross, and the second blade comes while the first is in the skin or has just left it.
    Crossing,
    /// A straight cut along the same line 20 times.
    Again,
    /// Four straight cuts around a piece, through all of the skin, whose bottom is free: the piece falls.
    Piece,
    /// A straight cut that once threw the blade with 53 N, number 0, and the same moved by up to 0.3 mm along x and y.
    Thrown,
    /// A path after which the tool once was NaN, number 0, and the same moved by up to 0.3 mm along x and y.
    NonFinite,
}

/// A skin and the blade's path through it.
pub struct Case {
    /// To run.
    pub scene: Scene,
    /// What it is, for messages.
    pub name: String,
    kind: Kind,
}

/// Side of the skin, mm, cells across, and cells over the thickness of each layer.
const SKINS: [(f64, u32, [u32; 3]); 4] =
    [(10.0, 10, [1, 1, 1]), (10.0, 13, [2, 1, 1]), (20.0, 16, [2, 2, 1]), (20.0, 24, [2, 2, 1])];

const HEAD: &str = r#"title = "A random path"
[time]
step_ms = 5.0
duration_s = 1.0
[solver]
preconditioner = "multigrid"
tolerance = 1e-2
[skin]
size_mm = [SIZE, SIZE]
cells = [CELLS, CELLS]
rayleigh_mass_per_s = 0.01
rayleigh_stiffness_s = 0.01
[[skin.layer]]
name = "hypodermis"
thickness_mm = 1.2
cells = FAT
young_kpa = 34.0
poisson = 0.45
density_kg_m3 = 971.0
toughness_kj_m2 = 0.15
[[skin.layer]]
name = "dermis"
thickness_mm = 1.0
cells = DERMIS
young_kpa = 200.0
poisson = 0.45
density_kg_m3 = 1116.0
toughness_kj_m2 = 0.2
pre_strain = [TAUT]
[[skin.layer]]
name = "epidermis"
thickness_mm = 0.1
cells = EPIDERMIS
young_kpa = 1000.0
poisson = 0.45
density_kg_m3 = 1116.0
toughness_kj_m2 = 0.2
pre_strain = [TAUT]
HELD
[[tool]]
name = "scalpel"
mesh = "meshes/scalpel.obj"
trajectory = "incision.csv"
mass_g = 20.0
inertia_g_mm2 = [4000.0, 6000.0, 4000.0]
[tool.coupling]
stiffness_n_m = 3000.0
damping_n_s_m = 10.0
angular_stiffness_n_m_rad = 3.0
angular_damping_n_m_s_rad = 0.01
[tool.blade]
edge_mm = [[-12.0, 0.0, -14.0], [-8.0, 0.0, -10.0]]
normal = [0.0, 1.0, 0.0]
thickness_mm = 0.4
edge_spacing_mm = SPACING
flat_spacing_mm = 1.0
depth_mm = 1.0
[contact]
friction = 0.3
alarm_mm = 0.2
max_contacts = 48
"#;

/// Probe of how far the middle of the skin has risen, m.
const RISEN: &str = "risen";
/// Thickness of all layers, m.
const THICK: f64 = 2.3e-3;
/// Toughness of the toughest layer, J/m².
const TOUGHNESS: f64 = 200.0;
/// Length of the edge, m.
const EDGE: f64 = 5.657e-3;
/// Thickness of the blade, m.
const THICKNESS: f64 = 4e-4;
/// Stiffness of the hand's coupling, N/m, and its damping, N·s/m.
const COUPLING: f64 = 3000.0;
const DAMPING: f64 = 10.0;
/// Haptic ticks per second.
const TICKS: f64 = 1000.0;
/// How far the blade is behind the hand while it cuts: what the coupling and the skin give under 0.4 N, m.
const LAG: f64 = 4e-4;
/// Bound of the force on a tool, N: three times toughness × edge, and what the hand's spring bears while the blade lags behind it.
const FORCE: f64 = 3.0 * TOUGHNESS * EDGE + COUPLING * LAG;
/// The blade's tip in its own frame, m.
const TIP: DVec3 = DVec3::new(-12e-3, 0.0, -14e-3);

/// Repetitions of [`Kind::Again`].
const STROKES: u32 = 20;
/// Time that a piece is given to fall, s.
const FALL: f64 = 0.1;
/// m/s²
const GRAVITY: f64 = 9.81;

impl Case {
    /// The case of a kind and number.
    pub fn new(kind: Kind, number: u64) -> Self {
        // the skin; all kinds draw what some of them replace, so that a number stays the same case
        let mut random = Random::new(number.wrapping_mul(1_000_003).wrapping_add(kind as u64));
        let (size, cells, layers) = random.pick(match kind {
            // cuts right through touch along the whole height of the skin, and 20 strokes are many: small grids are dear enough
            Kind::Through | Kind::Piece | Kind::NonFinite => &SKINS[..1],
            Kind::Again => &SKINS[..2],
            Kind::Thrown => &SKINS[3..],
            Kind::Straight | Kind::Any | Kind::Crossing => &SKINS,
        });
        let held: &[&str] = match kind {
            Kind::Through | Kind::Piece | Kind::NonFinite => &["sides"],
            Kind::Any => random.pick(&[&["sides"] as &[&str], &["bottom", "sides"]]),
            _ => &["bottom", "sides"],
        };
        let drawn = random.pick(&["0.0, 0.0", "0.05, 0.1"]);
        let taut = match kind {
            Kind::Through | Kind::Piece | Kind::NonFinite => "0.0, 0.0",
            Kind::Thrown => "0.05, 0.1",
            _ => drawn,
        };
        // the scene's text
        let boundary = |region: &&str| format!("[[boundary]]\nregion = \"{region}\"\n");
        let fine = matches!(kind, Kind::Straight | Kind::Crossing | Kind::Again | Kind::Thrown);
        let text = HEAD
            .replace("SPACING", if fine { "0.2" } else { "0.4" })
            .replace("SIZE", &size.to_string())
            .replace("CELLS", &cells.to_string())
            .replace("FAT", &layers[0].to_string())
            .replace("EPIDERMIS", &layers[2].to_string())
            .replace("DERMIS", &layers[1].to_string())
            .replace("TAUT", taut)
            .replace("HELD", &held.iter().map(boundary).collect::<String>());
        let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
        let mut scene = parse(&text, Path::new("scenes/random.toml"), &files).unwrap_or_else(|e| panic!("{e}"));
        // the paths
        let size = 1e-3 * size;
        let (paths, name) = match kind {
            Kind::Straight => alone(straight(&mut random, size)),
            Kind::Through => alone(through(&mut random, size)),
            Kind::Any => alone(any(&mut random, size)),
            Kind::Crossing => crossing(&mut random, size),
            Kind::Again => alone(again(&mut random, size)),
            Kind::Piece => alone(piece(&mut random, size)),
            Kind::Thrown => alone(moved(&THROWN, &mut random, number)),
            Kind::NonFinite => alone(moved(&NON_FINITE, &mut random, number)),
        };
        // what a piece needs to part and fall
        if kind == Kind::Piece {
            // copies for any cut: eight cells around a node are at most eight parts
            scene.skins[0].cut = Cut::Split { reserve_columns: 7 * (cells + 1).pow(2) };
            scene.time.gravity = [0.0, 0.0, -GRAVITY];
            let middle = ProbeKind::Displacement { body: 0, point: [0.0, 0.0, THICK], axis: 2 };
            scene.probes.push(Probe { name: RISEN.into(), kind: middle });
        }
        // a blade for each path
        scene.time.duration = paths.iter().flatten().map(|pose| pose.time).fold(0.1, f64::max) + 0.02;
        let first = scene.tools.remove(0);
        for (number, path) in (1..).zip(paths) {
            let mut tool = first.clone();
            (tool.name, tool.trajectory) = (format!("scalpel {number}"), path);
            scene.tools.push(tool);
        }
        scene.view.frames = 0;
        Self {
            scene,
            kind,
            name: format!("{kind:?} {number}: {} mm, {cells} x {cells} x {layers:?}, {name}", 1e3 * size),
        }
    }

    /// Links that the edges cross where the hands take them, raised by a height, m, through skin that does not give way.
    pub fn links_on_the_path(&self, raised: f64) -> usize {
        let model = Model::new(&self.scene, 0).unwrap_or_else(|e| panic!("{e}"));
        let links = links(&model.grid.params::<f64>());
        let centres: Vec<[f64; 4]> = cell_centres(&model).into_iter().map(|[x, y, z]| [x, y, z, 0.0]).collect();
        let still = vec![[0.0; 4]; centres.len()];
        let steps = (self.scene.time.duration / self.scene.time.step).round() as usize;
        let mut crossed = vec![false; links.len()];
        for tool in self.instruments() {
            let edge = tool.edge.as_ref().map_or(&[][..], |edge| &edge.points);
            let at = |step: usize| {
                let (position, rotation) = tool.hand(step as f64 * self.scene.time.step);
                let swept = |p: &DVec3| (position + DVec3::Z * raised + rotation * *p).extend(0.0).to_array();
                edge.iter().map(swept).collect::<Vec<_>>()
            };
            for step in 0..steps {
                let (old, new) = (at(step), at(step + 1));
                let quads = (1..edge.len()).flat_map(|k| [old[k - 1], old[k], new[k], new[k - 1]]);
                for hit in cut(&links, &centres, &still, &still, &quads.collect::<Vec<_>>()) {
                    crossed[hit.segment as usize] = true;
                }
            }
        }
        crossed.iter().filter(|c| **c).count()
    }

    /// Links that a cut may sever: those on the path, more or fewer by a share. Skin gives way before it is cut, so the cut is less deep and
    /// less long than the path by as much.
    pub fn links_expected(&self, share: f64) -> [f64; 2] {
        let (least, most) = (self.links_on_the_path(LAG) as f64, self.links_on_the_path(0.0) as f64);
        [(1.0 - share) * least - 1.0, (1.0 + share) * most + 1.0]
    }

    fn instruments(&self) -> impl Iterator<Item = Instrument> {
        self.scene.tools.iter().map(|tool| Instrument::new(tool, [0.0; 3]))
    }

    /// Largest change that a hand's own motion makes of the coupling's force from one tick to the next, N.
    fn push_of_the_hand(&self) -> f64 {
        let ticks = (self.scene.time.duration * TICKS) as usize;
        let largest = |tool: Instrument| {
            let velocity =
                |tick: usize| (tool.hand((tick + 1) as f64 / TICKS).0 - tool.hand(tick as f64 / TICKS).0) * TICKS;
            let push = |tick| {
                COUPLING * velocity(tick).length() / TICKS + DAMPING * (velocity(tick) - velocity(tick + 1)).length()
            };
            (0..ticks).map(push).fold(0.0, f64::max)
        };
        self.instruments().map(largest).fold(0.0, f64::max)
    }

    /// What is wrong with a run.
    ///
    /// Links severed are judged against those on the path at rest: of straight cuts, and those right through, within 10 %. A wild path drags skin along, and cuts it
    /// elsewhere than it crosses it at rest: of 150 of [`Kind::Any`] eight were off by more than 10 %, by up to a third, so that half and one and
    /// a half times the path's are allowed, and links that had no nodes left for them count as severed. The flap of a piece that hangs by its
    /// last side gives way as much, so its links are not judged, nor whether it parts (9 of 12 did); a piece that has parted must fall.
    pub fn faults(&self, report: &Report) -> Vec<String> {
        let mut faults = vec![];
        let mut bound = |what: &str, value: f64, most: f64| {
            if value > most || value.is_nan() {
                faults.push(format!("{what} {value:.3}, at most {most:.3}"));
            }
        };
        let straight = matches!(self.kind, Kind::Straight | Kind::Crossing | Kind::Again | Kind::Piece | Kind::Thrown);
        bound("force N", report.contact_force_n_max, FORCE);
        let jump = 0.5 + if straight { 0.0 } else { self.push_of_the_hand() };
        bound("jump N", report.haptic.force_jump_n_max, jump);
        bound("depth mm", report.contact.depth_mm_max, 1e3 * THICKNESS / 2.0);
        for (name, count) in &report.warnings {
            if !self.may_warn().contains(&name.as_str()) {
                faults.push(format!("warning {name} x {count}"));
            }
        }
        let (severed, pieces) = (report.cut.links_severed, report.cut.pieces.unwrap_or(0));
        let refused = report.warnings.get("cut_reserve_exhausted").copied().unwrap_or(0);
        let mut links = |share: f64, refused: u64| {
            let [least, most] = self.links_expected(share);
            if ((severed as u64 + refused) as f64) < least || severed as f64 > most {
                faults.push(format!("{severed} links severed, {least:.1} to {most:.1} expected"));
            }
        };
        match self.kind {
            Kind::Straight | Kind::Crossing | Kind::Again | Kind::Thrown => links(0.1, 0),
            Kind::Any | Kind::NonFinite => links(0.5, refused),
            Kind::Through if pieces < 2 => faults.push(format!("one piece, {severed} links severed")),
            Kind::Through => links(0.1, refused),
            Kind::Piece if pieces > 1 => {
                let risen = report.probes.get(RISEN).copied().unwrap_or(f64::NAN);
                if risen > -THICK || risen.is_nan() {
                    faults.push(format!("{pieces} pieces, but the middle has risen by {:.3} mm", 1e3 * risen));
                }
            }
            Kind::Piece => {}
        }
        faults
    }

    /// Warnings that a run may end with. A blade right through a border, or on a wild path, drags flaps along and turns their cells inside
    /// out; what is inside such a cell says nothing, and contacts with it are left out and counted.
    fn may_warn(&self) -> &[&str] {
        match self.kind {
            Kind::Straight | Kind::Crossing | Kind::Again | Kind::Piece | Kind::Thrown => &[],
            Kind::Through | Kind::Any | Kind::NonFinite => {
                &["contacts_unexplained", "cut_reserve_exhausted", "inverted_cells"]
            }
        }
    }

    /// Runs it on the CPU path.
    ///
    /// # Errors
    /// As [`run`].
    pub fn run(&self, platform: Platform, out: &Path) -> Result<Report> {
        let options = Options::new(platform, out);
        Ok(run(&self.scene, &options, &mut |_| ())?.report)
    }
}

/// A pose with the tip at a position, the blade turned about the vertical.
fn pose(time: f64, tip: DVec3, rotation: DQuat) -> Pose {
    Pose { time, position: (tip - rotation * TIP).to_array(), rotation: rotation.to_array() }
}

/// The path of a blade that is alone.
fn alone((path, name): (Vec<Pose>, String)) -> (Vec<Vec<Pose>>, String) {
    (vec![path], name)
}

/// A straight cut.
struct Line {
    yaw: f64,
    speed: f64,
    depth: f64,
    length: f64,
    middle: DVec3,
}

impl Line {
    fn random(random: &mut Random, size: f64) -> Self {
        let yaw = random.between(0.0, std::f64::consts::TAU);
        let (speed, depth) = (random.between(0.02, 0.08), random.between(0.7e-3, 1.5e-3));
        let length = random.between(0.2, 0.4) * size;
        let room = 0.35 * size - 0.5 * length;
        let middle = DVec3::new(random.between(-room, room), random.between(-room, room), 0.0);
        Self { yaw, speed, depth, length, middle }
    }

    /// Down, along and up, from a time on, s.
    fn poses(&self, start: f64) -> Vec<Pose> {
        let rotation = DQuat::from_rotation_z(self.yaw);
        let ahead = rotation * DVec3::X;
        let [from, to] = [-0.5, 0.5].map(|s| self.middle + ahead * (s * self.length));
        let (above, below) = (DVec3::Z * (THICK + 0.5e-3), DVec3::Z * (THICK - self.depth));
        let down = start + (above.z - below.z) / self.speed.min(0.03);
        let across = down + self.length / self.speed;
        vec![
            pose(start, from + above, rotation),
            pose(down, from + below, rotation),
            pose(across, to + below, rotation),
            pose(across + 0.1, to + above + DVec3::Z * 1e-3, rotation),
        ]
    }
}

impl Display for Line {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { yaw, speed, depth, length, .. } = self;
        let (yaw, speed, length, depth) = (yaw.to_degrees(), speed * 1e3, length * 1e3, depth * 1e3);
        write!(f, "yaw {yaw:.1} deg, {speed:.1} mm/s, {length:.2} mm long, {depth:.2} mm deep")
    }
}

fn straight(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let line = Line::random(random, size);
    (line.poses(0.0), line.to_string())
}

fn crossing(random: &mut Random, size: f64) -> (Vec<Vec<Pose>>, String) {
    let first = Line::random(random, size);
    let mut second = Line::random(random, size);
    second.yaw = first.yaw + random.between(1.0, 2.0);
    second.middle = first.middle + DQuat::from_rotation_z(first.yaw) * DVec3::X * random.between(-0.05, 0.05) * size;
    let poses = first.poses(0.0);
    // the blades are not in the crossing at the same time: the second goes down when the first is half way along, or later
    let start = 0.5 * (poses[1].time + poses[2].time) + random.between(0.0, 0.1);
    let mut others = second.poses(start);
    others.insert(0, Pose { time: 0.0, ..others[0] });
    (vec![poses, others], format!("{first}, then {second} from {start:.3} s on"))
}

fn again(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let line = Line::random(random, size);
    let mut poses: Vec<Pose> = vec![];
    for _ in 0..STROKES {
        poses.extend(line.poses(poses.last().map_or(0.0, |last| last.time + 0.05)));
    }
    (poses, format!("{STROKES} times {line}"))
}

fn piece(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let (yaw, speed) = (random.between(0.0, std::f64::consts::TAU), random.between(0.02, 0.08));
    let half = random.between(0.16, 0.2) * size;
    // the edge is steep, so that a cut is hardly longer at the top than at the bottom, and goes on beyond the corners by more than a cell
    let (steep, beyond) = (DQuat::from_rotation_y(-0.35), 1.2e-3);
    let (above, below) = (THICK + 0.5e-3, random.between(-1.2e-3, -0.8e-3));
    let mut poses = vec![];
    let mut time = 0.0;
    for side in 0..4 {
        let turned = DQuat::from_rotation_z(yaw + f64::from(side) * std::f64::consts::FRAC_PI_2);
        let at = |along: f64, height: f64| turned * DVec3::new(along, -half, height);
        let from = -half - beyond;
        poses.push(pose(time, at(from, above), turned * steep));
        time += (above - below) / speed.min(0.03);
        poses.push(pose(time, at(from, below), turned * steep));
        time += 2.0 * -from / speed;
        poses.push(pose(time, at(-from, below), turned * steep));
        poses.push(pose(time + 0.1, at(-from, above), turned * steep));
        time += 0.2;
    }
    let last = poses[poses.len() - 1];
    poses.push(Pose { time: last.time + FALL, ..last });
    let name = format!(
        "yaw {:.1} deg, {:.1} mm/s, {:.2} mm wide, tip {:.2} mm under the bottom",
        yaw.to_degrees(),
        speed * 1e3,
        2e3 * half,
        -1e3 * below
    );
    (poses, name)
}

/// A path of the table, moved along x and y unless it is number 0.
fn moved(path: &[[f64; 8]], random: &mut Random, number: u64) -> (Vec<Pose>, String) {
    let mut aside = || if number == 0 { 0.0 } else { random.between(-0.3e-3, 0.3e-3) };
    let by = DVec3::new(aside(), aside(), 0.0);
    let pose = |row: &[f64; 8]| {
        let [time, x, y, z, ..] = *row;
        let position = (DVec3::new(x, y, z) * 1e-3 + by).to_array();
        let rotation = DQuat::from_xyzw(row[4], row[5], row[6], row[7]).normalize();
        Pose { time, position, rotation: rotation.to_array() }
    };
    (path.iter().map(pose).collect(), format!("moved by {:.3}, {:.3} mm", 1e3 * by.x, 1e3 * by.y))
}

fn through(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let along_x = random.between(0.0, 1.0) < 0.5;
    let yaw = if along_x { 0.0 } else { std::f64::consts::FRAC_PI_2 } + random.between(-0.1, 0.1);
    let rotation = DQuat::from_rotation_z(yaw);
    let speed = random.between(0.02, 0.08);
    let ahead = rotation * DVec3::X;
    let aside = DVec3::Z.cross(ahead);
    let middle = aside * random.between(-0.2, 0.2) * size;
    // the whole edge, 4 mm high, passes the whole skin: in from beside it and out on the other side
    let reach = 0.5 * size + 4.5e-3;
    let low = DVec3::Z * random.between(-1.2e-3, -0.5e-3);
    let poses = vec![
        pose(0.0, middle - ahead * reach + low, rotation),
        pose(2.0 * reach / speed, middle + ahead * reach + low, rotation),
    ];
    (
        poses,
        format!(
            "yaw {:.1} deg, {:.1} mm/s, tip {:.2} mm under the bottom",
            yaw.to_degrees(),
            speed * 1e3,
            -low.z * 1e3
        ),
    )
}

fn any(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let speed = random.between(0.02, 0.2);
    let mut poses = vec![];
    let mut time = 0.0;
    let mut last: Option<DVec3> = None;
    let yaw = random.between(0.0, std::f64::consts::TAU);
    for _ in 0..8 {
        let mut side = || random.between(-0.7, 0.7) * size;
        let tip = DVec3::new(side(), side(), random.between(0.0, 2.0 * THICK));
        let tilt = DVec3::new(random.between(-0.5, 0.5), random.between(-0.5, 0.5), yaw + random.between(-0.7, 0.7));
        let rotation = DQuat::from_rotation_z(tilt.z) * DQuat::from_rotation_y(tilt.y) * DQuat::from_rotation_x(tilt.x);
        time += last.map_or(0.0, |from| from.distance(tip) / speed);
        last = Some(tip);
        poses.push(pose(time, tip, rotation));
    }
    // no longer than it takes to see what happens
    poses.retain(|pose| pose.time < 0.6);
    (poses, format!("{:.1} mm/s", speed * 1e3))
}

/// Path of [`Kind::Thrown`]: time, s, position, mm, rotation as a quaternion. 6 mm, 1.1 mm deep, 40 mm/s, turned by 300 degrees.
const THROWN: [[f64; 8]; 4] = [
    [0.0, 4.488302, -9.136435, 17.2, 0.0, 0.0, 0.5, -0.866025404],
    [0.12, 4.488302, -9.136435, 15.2, 0.0, 0.0, 0.5, -0.866025404],
    [0.27, 7.488302, -14.332587, 15.2, 0.0, 0.0, 0.5, -0.866025404],
    [0.37, 7.488302, -14.332587, 18.0, 0.0, 0.0, 0.5, -0.866025404],
];

/// Path of [`Kind::NonFinite`], as above.
const NON_FINITE: [[f64; 8]; 31] = [
    [0.0, 14.037182, -7.758587, 8.329292, 0.223715301, 0.278574362, 0.027084607, 0.933602813],
    [0.01, 14.494696, -7.192598, 8.378979, 0.201239522, 0.268010595, 0.017438857, 0.942002581],
    [0.02, 14.939983, -6.596717, 8.426875, 0.178427166, 0.257151691, 0.007703087, 0.949724916],
    [0.03, 15.373501, -5.97067, 8.470268, 0.155327505, 0.246018203, -0.002100522, 0.956736117],
    [0.04, 15.795835, -5.314473, 8.506417, 0.131992836, 0.234633063, -0.011948872, 0.963006979],
    [0.05, 16.20769, -4.628436, 8.532601, 0.108477922, 0.223021371, -0.021818205, 0.96851328],
    [0.06, 16.609885, -3.913169, 8.546164, 0.08483936, 0.211210121, -0.03168439, 0.973236183],
    [0.07, 17.003336, -3.16957, 8.544556, 0.061134908, 0.199227896, -0.041523209, 0.977162521],
    [0.08, 17.389046, -2.398814, 8.52538, 0.037422783, 0.187104521, -0.051310656, 0.980284984],
    [0.09, 17.768084, -1.602333, 8.486423, 0.01376095, 0.174870696, -0.061023229, 0.982602179],
    [0.1, 18.141573, -0.781789, 8.425698, -0.009793582, 0.162557609, -0.070638209, 0.984118567],
    [0.11, 18.510663, 0.060959, 8.341463, -0.033185428, 0.150196549, -0.080133914, 0.984844292],
    [0.12, 18.386882, 0.925381, 8.548839, -0.050875796, 0.133466286, -0.082557837, 0.986297423],
    [0.13, 15.962586, 1.771581, 10.165411, -0.043449753, 0.096603195, -0.053180356, 0.992951052],
    [0.14, 13.414975, 2.55415, 11.740522, -0.035877011, 0.059290832, -0.0235006, 0.997318986],
    [0.15, 10.75507, 3.263149, 13.259192, -0.028209579, 0.021788497, 0.006274561, 0.999344841],
    [0.16, 7.997106, 3.890657, 14.70795, -0.02050167, -0.01563946, 0.035935412, 0.999021389],
    [0.17, 6.039371, 4.435102, 15.823709, -0.018302295, -0.046619496, 0.062177064, 0.996807735],
    [0.18, 6.740558, 4.955244, 16.113121, -0.033026167, -0.058670949, 0.078767292, 0.994616864],
    [0.19, 7.409975, 5.468471, 16.368208, -0.047792349, -0.070736585, 0.095378338, 0.991773764],
    [0.2, 8.0492, 5.971675, 16.587965, -0.06257219, -0.082792768, 0.111977676, 0.988276823],
    [0.21, 8.660069, 6.461791, 16.771654, -0.077336696, -0.094815701, 0.128532549, 0.984128245],
    [0.22, 9.244652, 6.935834, 16.918815, -0.092056815, -0.106781659, 0.145010293, 0.979334077],
    [0.23, 9.805229, 7.390941, 17.029271, -0.106703717, -0.11866722, 0.161378657, 0.973904172],
    [0.24, 10.344258, 7.824407, 17.103137, -0.12124908, -0.130449499, 0.177606116, 0.967852084],
    [0.25, 10.864346, 8.233718, 17.140807, -0.13566536, -0.142106363, 0.193662175, 0.961194909],
    [0.26, 11.357854, 8.588457, 17.128165, -0.146041355, -0.148320636, 0.20795779, 0.955733472],
    [0.27, 11.760204, 8.703712, 16.915667, -0.125067681, -0.111815509, 0.209530164, 0.9633029],
    [0.28, 12.148056, 8.81692, 16.582615, -0.103590339, -0.074631478, 0.210731414, 0.969170499],
    [0.29, 12.506215, 8.933112, 16.129773, -0.08171923, -0.036965267, 0.211542064, 0.973244826],
    [0.38, 12.506215, 8.933112, 16.129773, -0.08171923, -0.036965267, 0.211542064, 0.973244826],
];
